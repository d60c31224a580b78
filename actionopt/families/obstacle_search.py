"""All the least paths along an obstacle, as far as they can be found: from curves to all sides."""

from __future__ import annotations

from collections import Counter

import numpy as np

from actionopt.analysis.solution import Solution
from actionopt.discrete.mesh import Mesh
from actionopt.discrete.path import Path
from actionopt.discrete.transcription import Transcription
from actionopt.families.free_times import is_new
from actionopt.mechanics.problem import Problem
from actionopt.solver.solve import solve
from actionopt.solver.touching import lines
from actionopt.tools.watch import Progress, check_time

SIDE_SPREAD = np.array([0.3, 1.0, 3.0])  # of the coordinates' sizes, how far curves go to a side
CURVE_WAVES, CURVE_ELEMENTS = 3, 64  # sines of a curve, and its elements; ad hoc


def all_sides(
    problem: Problem,
    tol: float,
    starts: int,
    seed: int,
    progress: Progress | None,
) -> tuple[list[tuple[Solution, tuple[int, ...], str]], Counter[str], bool]:
    """Return paths and how each was found, what was tried, and whether it was interrupted.

    From what `solve` finds, from a line past all of the obstacle on either side, and from `starts`
    random curves and their mirror images.
    """
    found: list[tuple[Solution, tuple[int, ...], str]] = []
    tried: Counter[str] = Counter()
    mesh = Mesh.uniform(problem.start.t, problem.end.t, CURVE_ELEMENTS, 1)
    line = Transcription(problem, mesh, problem.lengths).straight().T
    sines = np.sin(
        np.pi * np.outer(np.arange(1, CURVE_WAVES + 1), mesh.nodes_since / mesh.duration)
    )
    drawn = np.random.default_rng(seed).standard_normal((starts, problem.system.n, CURVE_WAVES))
    drawn *= np.resize(SIDE_SPREAD, starts)[:, None, None] / np.arange(1, CURVE_WAVES + 1)
    aside = [sign * problem.lengths[:, None] * (a @ sines) for a in drawn for sign in (1, -1)]
    guesses = [*lines(problem, mesh), *(Path(mesh, line + away) for away in aside)]
    try:
        for i, guess in enumerate(guesses):
            how = "the straight line" if guess is None else "a curve to a side"
            tried[how] += 1
            check_time()
            if progress is not None:
                progress("curves to all sides", i, len(guesses), {"found": len(found)})
            path = solve(problem, tol=tol, guess=guess, throw=False)
            if path.success and is_new(path, (), found):
                found.append((path, (), how))
    except KeyboardInterrupt:
        return found, tried, True
    return found, tried, False
