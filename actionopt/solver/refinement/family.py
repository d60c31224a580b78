"""Whether a path is one of a family: suspected by inverse iteration, decided by the index."""

from __future__ import annotations

from dataclasses import replace
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

from actionopt.analysis.solution import Solution
from actionopt.analysis.status import Status
from actionopt.discrete.matrices.factors import Factors
from actionopt.mechanics.question.problem import Problem
from actionopt.solver.refinement.iterate import POLYNOMIAL_ROUNDOFF, ROUNDED, Iterate, is_at_rest
from actionopt.solver.refinement.workspace import Workspace
from actionopt.tools.types import Array
from actionopt.tools.watch import TimeUp, check_time, time_limit

if TYPE_CHECKING:
    from actionopt.analysis.quadratic.index import Inertia
    from actionopt.discrete.borders.bordered import Bordered

# Growth of a variation in a step of inverse iteration, from where on eigenvalues are counted.
# Measured at tolerances from 1e-12 to 0.1: on the scenes 0.3 to 9, on families 1e6 and more.
NEAR_SINGULAR = 1e4
# Growth times the distance of the path from its matrix, from where on the matrix may hide a family,
# whose eigenvalues are as large in it as that distance. Measured: of 55 scenes 3 are above, two
# thousandths at most; families 0.15 and more, of closed paths 0.05 (3e-3 the least of all).
OUTDATED = 3e-4
LEAST_COUNT = 0.1  # seconds for counting, if the time given is over before; ad hoc
LOST = (Status.NOT_FOUND, Status.UNRESOLVED)  # where one of a family may have been near


def may_be_family(ws: Workspace, status: Status) -> bool:
    """Whether the ends may leave a family of paths, or did so where one was lost."""
    if ws.problem.system.structure.forced or ws.unbalance is not None:
        return False  # that knows no index; or no path, as the energy tells
    if status is Status.DEGENERATE:  # of linear equations there may be no path at all
        return not ws.linear
    if not (status.success or status is Status.FLOOR):
        lost = status is Status.UNRESOLVED or (status in LOST and ws.unpolished is not None)
        return lost and not is_alone(ws.problem)
    here = ws.here
    if ws.problem.closes and is_at_rest(here.Q, here.tr.lengths.max()):
        return True  # the mesh of a rest resolves none of its neighbours
    if is_alone(ws.problem):
        return False
    # With one coordinate the noise tells by itself, in units of the motion.
    if not here.can_be_one_of_many and here.noise * (here.sizes / here.lengths).max() <= ROUNDED:
        return False
    try:
        here = ws.here = here.with_probed(ws.many)
        if not ws.linear and here.growth < NEAR_SINGULAR and here.growth * here.since > OUTDATED:
            here = ws.here = here.with_fresh_factors().with_probed(ws.many)
        grown = here.growth
    except np.linalg.LinAlgError:
        return True
    return not 0 < grown < NEAR_SINGULAR


def is_soft(here: Iterate) -> bool:
    """Whether the action hardly bends in some direction at a path, as at one of a family."""
    try:
        return not here.with_probed(many=False).growth < NEAR_SINGULAR
    except np.linalg.LinAlgError:
        return True


def is_alone(problem: Problem) -> bool:
    """Whether paths are no family: of one coordinate, whose energy tells the velocity anywhere.

    Beside a saddle they change by much with the energy, which looks like a family.
    """
    law = problem.system
    if not (problem.free_time and law.n == law.order == 1):
        return False
    if problem.closes:
        return True
    given = bool(problem.start.pinned and problem.end.pinned) and problem.integral is None
    return given and not law.structure.depends_on_time


def judge_family(ws: Workspace, solution: Solution) -> Solution:
    """Return the verdict DEGENERATE if the path is one of a family, else the solution as it is."""
    from actionopt.analysis.quadratic.index import INDEX_TOLERANCE

    near, here = solution, ws.here
    if solution.status in LOST and ws.unpolished is not None:
        ws.here = ws.unpolished
        problem, last = ws.answer()
        last.tr.watch = None  # a verdict is not left half done, whatever the search has cost
        kept = {"path": last.path, "lam": last.rows.T, "action": last.action, "known": last}
        near = replace(solution, problem=problem, error=np.inf, **kept)
    end = None if ws.watch is None else ws.watch.end
    try:
        with time_limit(None if end is None else max(end - perf_counter(), LEAST_COUNT)):
            found = near.inertia
    except (ValueError, np.linalg.LinAlgError):
        found = None
    except TimeUp:
        check_time()  # of the search that this one is a part of
        ws.here = here.with_values(error=np.inf)
        return replace(solution, status=Status.OUT_OF_TIME, error=np.inf)
    if found is None or found.nullity <= found.moves or found.tolerance > INDEX_TOLERANCE:
        ws.here = here
        return solution
    condition = softest_condition(found)
    ws.hint = _describe(ws, found, near.error)
    noise = max(ws.here.noise, condition * POLYNOMIAL_ROUNDOFF)
    ws.here = ws.here.with_values(noise=noise, error=near.error)
    stats = near.stats | {"condition": condition, "nullity": found.nullity, "noise": noise}
    judged = replace(near, status=Status.DEGENERATE, stats=stats)
    vars(judged)["inertia"] = found  # counted once: what its `kind` is, and its status
    return judged


def _describe(ws: Workspace, found: Inertia, error: float) -> str:
    """Return of which paths the family is, and its dimension."""
    problem, count = ws.problem, found.nullity
    if not problem.closes:
        where = "to the surface" if problem.on_surface else "between the ends"
        return f"to second order, the paths {where} are a family of dimension {count}"
    where = "that begin there" if problem.start.pinned else "at rest"
    if not (problem.start.pinned or is_at_rest(ws.here.Q, ws.here.tr.lengths.max())):
        where, count = "besides where each begins", count - 1
    known = f"stationary, and resolved to {error:.2g}"
    if not np.isfinite(error):
        known = "near them, and was lost when it was refined"
    return (
        f"closed paths near this one {where} are a family of dimension {count}, of one action; "
        f"the one returned is {known}"
    )


def soft_directions(here: Iterate, bordered: Bordered) -> list[Array]:
    """Return variations (unknowns,) of a closed path in which the action hardly bends, all of them.

    The kernel of its matrix, shifts of time and symmetries among them. It is solved with beside
    more random directions X than it has dimensions, in the metric W = int eta.eta dt,

        [ K     W X ] [ x ]   [ 0 ]
        [ X' W   0  ] [ a ] = [ e ],

    and x is of the kernel where a vanishes (W. Govaerts, *Numerical Methods for Bifurcations of
    Dynamical Equilibria* (2000), section 3.2).
    """
    from actionopt.discrete.borders.bordered import Bordered
    from actionopt.discrete.borders.borders import PhaseCondition, shares

    cut, count = here.tr.layout.unknowns, 2 * here.problem.system.n + 1
    first, _ = np.linalg.qr(np.random.default_rng(0).standard_normal((cut, count)))
    beside = np.zeros((here.tr.layout.size, count))
    beside[:cut] = shares(here.tr)[:, None] * first
    others = bordered.without(PhaseCondition)[0].borders
    borders = *others, PhaseCondition(beside, beside.T, np.zeros(count))
    equations = Bordered(bordered.problem, bordered.first, borders)
    known = here.z[: bordered.forces.start]
    factors = Factors(equations.layout, equations.kkt(np.concatenate([known, np.zeros(count)])))
    size = equations.layout.size
    solved = factors.solve_many(np.eye(count, size, size - count).T)
    _, sizes, mix = np.linalg.svd(solved[size - count :])
    x = solved[:cut] @ mix.T
    grown = np.linalg.norm(x, axis=0) > NEAR_SINGULAR * sizes
    return list((x / np.abs(x).max(axis=0)).T[grown])


def softest_condition(found: Inertia) -> float:
    """Return the condition that the direction which bends least gives to a path."""
    return 1 / max(found.smallest or 0.0, float(np.finfo(float).eps))
