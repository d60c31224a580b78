"""All the paths to events on surfaces, as far as they can be found: from points all over these."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

import numpy as np

from actionopt.analysis.solution import Solution
from actionopt.families.free_times import is_new
from actionopt.mechanics.problem import Problem
from actionopt.solver.on_surface import firsts, solve_on_surface
from actionopt.solver.solve import solve

SPREAD = np.array([0.3, 1.0, 3.0])  # of the coordinates' sizes, from where surfaces are looked for
EACH = 6  # directions a start; ad hoc


def all_on_surfaces(
    problem: Problem,
    tol: float,
    angles: int,
    starts: int,
    seed: int,
    progress: Callable[[str, int, int, int], object] | None,
) -> tuple[list[tuple[Solution, tuple[int, ...], str]], Counter[str], bool]:
    """Return paths with their windings and how each was found, what was tried, and an interruption.

    `angles` coordinates have windings, which are not varied: the surface says where a path ends.
    """
    found: list[tuple[Solution, tuple[int, ...], str]] = []
    tried: Counter[str] = Counter()
    n, count, none = problem.system.n, EACH * starts, (0,) * angles
    random = np.random.default_rng(seed).standard_normal((count, n))
    random *= np.resize(SPREAD, count)[:, None]
    directions = np.concatenate([np.zeros((1, n)), np.eye(n), -np.eye(n), random])
    try:
        for i, first in enumerate(firsts(problem, solve, tol, directions)):
            tried["points on surfaces"] += 1
            if progress is not None:
                progress("points on surfaces", i, len(directions), len(found))
            path, _ = solve_on_surface(problem, solve, tol, first, "auto", None, thorough=False)
            if path.success and is_new(path, none, found):
                found.append((path, none, "a point on a surface"))
    except KeyboardInterrupt:
        return found, tried, True
    return found, tried, False
