"""From a nearer question to the one asked: as far as a path can be followed, where none was found.

A geodesic is followed as its end moves away from its start along the straight line, a path of one
coordinate without a clock over longer and longer times. Where it ends, it has as a rule merged with
another path, and no path of its kind is there beyond.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from actionopt.analysis.solution import Solution
from actionopt.discrete.path import Path
from actionopt.mechanics.events import Event
from actionopt.mechanics.problem import Problem

# Ad hoc: the nearest end that is tried, in parts of the way or of the time; the longest and the
# shortest step, as factors of it; tries in all; how much longer the next step is; and the accuracy
# on the way.
NEAREST, LONGEST, SHORTEST, TRIES, LONGER, ON_THE_WAY = 2.0**-24, 2.0, 1.0002, 120, 1.5, 1e-4


def applies(problem: Problem) -> bool:
    """Whether a nearer question is another one of the kind."""
    system = problem.system
    free = not (system.m or system.r or system.structure.forced or problem.advance is not None)
    whole = len(problem.start.pinned) == system.n == len(problem.end.pinned)
    timed = system.n == 1 and not system.structure.depends_on_time
    return free and whole and (system.F is not None or timed)


def nearer(problem: Problem, part: float) -> Problem:
    """Return the question with its end at a part of the way, for geodesics, or of the time."""
    start, end = problem.start, problem.end
    if problem.system.F is None:
        return problem.replace(end=end.at(start.t + part * problem.duration))
    a, b = (np.array(e.q, dtype=float) for e in (start, end))
    return problem.replace(end=Event(end.t, a + part * (b - a)))


def outwards(
    problem: Problem, solve: Callable[[Problem, Path | None, float], Solution], tol: float
) -> tuple[Solution | None, float]:
    """Return the path that was followed to the end asked, or None; and how far it was followed.

    `solve(problem, guess, tol)` returns what is near a guess.
    """
    here, part = None, 1.0
    while here is None and part > NEAREST:
        part /= LONGEST
        found = solve(nearer(problem, part), None, ON_THE_WAY)
        here = found if found.success else None
    if here is None:
        return None, 0.0
    step = LONGEST
    for _ in range(TRIES):
        to = min(1.0, part * step)
        there = nearer(problem, to)
        found = solve(there, _led(here, there, to / part), tol if to == 1 else ON_THE_WAY)
        if found.success and to == 1:
            return found, 1.0
        if found.success:
            here, part, step = found, to, min(step**LONGER, LONGEST)
        else:
            step = np.sqrt(step)
            if step < SHORTEST:
                break
    return None, part


def _led(path: Solution, problem: Problem, factor: float) -> Path:
    """Return a path stretched to another end; of a geodesic what leaves the straight line grows."""
    mesh = path.mesh.moved(problem.start.t, problem.end.t)
    values = path.path.values
    if problem.system.F is None:
        return Path(mesh, values)
    s = mesh.nodes_since / mesh.duration
    a, b = (np.array(e.q, dtype=float)[:, None] for e in (problem.start, problem.end))
    line = values[:, :1] + s * (values[:, -1:] - values[:, :1])
    return Path(mesh, a + s * (b - a) + factor * (values - line))
