"""From the path of one member of a family to that of another, one by one, without leaving it.

A path may lead to another kind of path where its question changes much at once. So the question
changes in steps: as many as there are between the two in their grid, or so many that each goes on
as the last one did, or that twice as many lead to the same.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from actionopt.analysis.solution import Solution
from actionopt.discrete.meshes.path import Path
from actionopt.families.vary import Name, lead_to, with_values
from actionopt.mechanics.question.problem import Problem
from actionopt.solver.solve import refuse_rest, solve_near
from actionopt.tools.interrupts import ordinary_errors

# Ad hoc, all: the numbers of steps, the accuracy on the way, what is the same at the end, and by
# which part of a step a path may leave the line on which it went.
WALK_STEPS, WALK_TOL, SAME_END, WALK_BEND = (2, 4, 8, 16, 32), 1e-4, 1e-3, 0.1

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
        found, straight = _steps(problem, path, start, end, count, tol)
        if found is not None and straight:
            return found.path
        if found is not None and before is not None and _alike(found, before):
            break
        before = found or before
    return None if before is None else before.path


def _steps(
    problem: Problem, path: Path, start: Values, end: Values, count: int, tol: float
) -> tuple[Solution | None, bool]:
    """Go there in so many steps; None if one of them fails. And whether each goes on as the last.

    None does that is alone.
    """
    way, found, straight = [path], None, count > 1
    for k in range(1, count + 1):
        part = k / count
        values = end if k == count else {x: (1 - part) * start[x] + part * end[x] for x in end}
        try:
            there = with_values(problem, values)
            accuracy = tol if k == count else max(tol, WALK_TOL)
            near = lead_to(_ahead(*way[-2:]), there)
            guess = near if found is None else replace(found, path=near)
            found = refuse_rest(solve_near(there, guess, accuracy))
        except ordinary_errors():  # no problem, no sensible end, or the solver failed
            return None, False
        if not found.success:
            return None, False
        way.append(found.path)
        straight = straight and (k == 1 or not _bends(*way[-3:]))
    return found, straight


def _ahead(before: Path, here: Path | None = None) -> Path:
    """Return the path as far from one as that is from the one before, on its mesh."""
    if here is None:
        return before
    t0, t1 = here.mesh.boundaries[[0, -1]].tolist()
    moved = Path(before.mesh.moved(t0, t1), before.values).on(here.mesh)
    return Path(here.mesh, 2 * here.values - moved.values)


def _bends(before: Path, here: Path, there: Path) -> bool:
    """Whether a path leaves the line through two before it."""
    last = Path(there.mesh.moved(*here.mesh.boundaries[[0, -1]].tolist()), there.values)
    off = np.abs(last.on(here.mesh).values - _ahead(before, here).values).max()
    step = np.abs(last.on(here.mesh).values - here.values).max()
    return bool(off > WALK_BEND * step + SAME_END * np.abs(here.values).max())


def _alike(a: Solution, b: Solution) -> bool:
    """Whether two paths between the same ends set out and arrive alike."""
    p, q = np.stack(a.momenta), np.stack(b.momenta)
    return bool(np.nanmax(np.abs(p - q)) <= SAME_END * np.nanmax(np.abs(p)))
