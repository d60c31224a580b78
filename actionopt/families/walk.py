"""From the path of one member of a family to that of another, one by one, without leaving it.

A path may lead to another kind of path where its question changes much at once. So the question
changes in steps: as many as there are between the two in their grid, or so many that twice as many
lead to the same.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from actionopt.analysis.solution import Solution
from actionopt.discrete.path import Path
from actionopt.families.vary import Name, lead_to, with_values
from actionopt.mechanics.problem import Problem
from actionopt.solver.solve import refuse_rest, solve_near
from actionopt.tools.interrupts import ordinary_errors

# Ad hoc, all three: the numbers of steps, the accuracy on the way, and what is the same at the end.
WALK_STEPS, WALK_TOL, SAME_END = (4, 8, 16, 32), 1e-4, 1e-3

Values = Mapping[Name, float]


def walk(
    problem: Problem, path: Path, start: Values, end: Values, distance: int, tol: float
) -> Path | None:
    """Return the path of the member at the values `end`, from the `path` of that at `start`.

    `distance` is how many steps of the grid they are apart. None if there is no such path, or it
    is lost on the way.
    """
    if distance == 0:
        return path
    before, few = None, [count for count in WALK_STEPS if count < distance]
    for count in [*few, distance] if distance <= WALK_STEPS[-1] else few:
        found = _steps(problem, path, start, end, count, tol)
        if found is not None and before is not None and _alike(found, before):
            break
        before = found or before
    return None if before is None else before.path


def _steps(
    problem: Problem, path: Path, start: Values, end: Values, count: int, tol: float
) -> Solution | None:
    """Go there in so many steps; None if one of them fails."""
    found = None
    for k in range(1, count + 1):
        part, near = k / count, path if found is None else found.path
        values = end if k == count else {x: (1 - part) * start[x] + part * end[x] for x in end}
        try:
            there = with_values(problem, values)
            accuracy = tol if k == count else max(tol, WALK_TOL)
            found = refuse_rest(solve_near(there, lead_to(near, there), accuracy))
        except ordinary_errors():  # no problem, no sensible end, or the solver failed
            return None
        if not found.success:
            return None
    return found


def _alike(a: Solution, b: Solution) -> bool:
    """Whether two paths between the same ends set out and arrive alike."""
    p, q = np.stack(a.momenta), np.stack(b.momenta)
    return bool(np.nanmax(np.abs(p - q)) <= SAME_END * np.nanmax(np.abs(p)))
