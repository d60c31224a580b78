"""Whether a path is one of a family: suspected by amplified round-off, decided by the index."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from actionopt.analysis.index import INDEX_TOLERANCE, Inertia
from actionopt.analysis.solution import Solution
from actionopt.analysis.status import Status
from actionopt.discrete.factors import product
from actionopt.solver.iterate import POLYNOMIAL_ROUNDOFF
from actionopt.solver.workspace import Workspace

# Amplified round-off above which a path may be one of many, and above which that is to be counted;
# measured: of 400 families in all directions and at any tol the least is 2.4e-7, and chains of 10
# to 30 links show 3e-8 to 1.6e-7.
SUSPECTED, AMPLIFICATION = 1e-8, 5e-7
CHANGE = 2.0  # of it by two more steps; measured: single paths 1.0, families 20 and more
NOISE = 1e-9  # of one coordinate the noise itself tells; ad hoc
OUTDATED = 1e-6  # change of multipliers, in whose matrix no family may show; ad hoc
# Amplification times the distance from its matrix, from where on a family may not show in it;
# measured at a tolerance of 1e-3: families 1e-12 and more, straight paths 3e-14 and less.
HIDDEN = 1e-13
BENT = 1e-4  # in units of kinetic energy, as the index has it: of a family 1e-8; ad hoc
MANY_UNKNOWNS = 5000  # from where a few solutions are asked for before the index; ad hoc
# Measured: the second shows what bends least to a tenth of it, on chains of 20 to 100 links.
INVERSE_ITERATIONS = 3
ROUGH = 1e-2  # residual of their solutions: the next one outgrows it; ad hoc
LOST = (Status.NOT_FOUND, Status.UNRESOLVED)  # where one of a family may have been near


def suspected(ws: Workspace, status: Status) -> bool:
    """Whether the ends may leave a family of paths, or did so where one was lost."""
    if ws.problem.system.structure.forced:
        return False
    if status is Status.DEGENERATE:  # of linear equations there may be no path at all
        return not ws.linear
    if not (status.success or status is Status.FLOOR):
        return status is Status.UNRESOLVED or (status in LOST and ws.unpolished is not None)
    here = ws.here
    if not here.can_be_one_of_many:  # nothing is zero on one side of a symmetry
        return here.noise > NOISE
    try:
        if ws.problem.system.m and here.since > OUTDATED:
            if _far_from_singular(ws):
                return False
            here = ws.here = here.updated()
        before = here.amplification(ws.many)
        if not ws.linear and before < SUSPECTED and before * here.since > HIDDEN:
            here = ws.here = here.updated()
            before = here.amplification(ws.many)
        if not SUSPECTED < before < AMPLIFICATION:
            return before >= AMPLIFICATION
        if _far_from_singular(ws):
            return False
        # What is nearly singular by chance stays so; in a family the last steps decide.
        after = here.polished().polished().amplification(ws.many)
    except np.linalg.LinAlgError:
        return True
    return not before / CHANGE < after < before * CHANGE


def judged(ws: Workspace, solution: Solution) -> Solution:
    """Return the verdict DEGENERATE if the path is one of a family, else the solution as it is."""
    near = solution
    if solution.status not in LOST and _far_from_singular(ws):
        return solution
    if solution.status in LOST and ws.unpolished is not None:
        last = ws.unpolished
        kept = {"path": last.path, "lam": last.rows.T, "action": last.action, "known": last}
        near = replace(solution, error=np.inf, **kept)
    try:
        found = near.inertia
    except (ValueError, np.linalg.LinAlgError):
        return solution
    if not found.nullity or found.tolerance > INDEX_TOLERANCE:
        return solution
    condition = conditioned(found)
    ws.hint = f"the paths between the ends are a family of dimension {found.nullity}"
    noise = max(ws.here.noise, condition * POLYNOMIAL_ROUNDOFF)
    ws.here = replace(ws.here, noise=noise, error=near.error)
    stats = near.stats | {"condition": condition, "nullity": found.nullity, "noise": noise}
    return replace(near, status=Status.DEGENERATE, stats=stats)


def conditioned(found: Inertia) -> float:
    """Return the condition that the direction which bends least gives to a path."""
    return 1 / max(found.smallest or 0.0, float(np.finfo(float).eps))


def _far_from_singular(ws: Workspace) -> bool:
    """Whether no direction on the mesh is near one in which the action does not bend.

    Asked of many unknowns, where round-off is amplified without any, and the index costs more. By
    inverse iteration in the kinetic metric (Golub and Van Loan, *Matrix Computations* (4th ed.
    2013), section 7.6): factors are at hand, and such a direction outgrows all others. Where they
    are those of a path a little off, its Rayleigh quotient is right to second order. Under
    constraints paths bend less, and what the index calls nothing is taken.
    """
    here, m = ws.here, ws.problem.system.m
    tr, layout = here.tr, here.tr.layout
    if (m or not ws.many_coordinates) and layout.unknowns < MANY_UNKNOWNS:
        return False
    if m and layout.storage == "blocks":  # they have no kinetic part
        return False
    y = layout.probe
    try:
        factors = here.factored(ws.many).factors
        assert factors is not None
        matrix = factors.nonzeros if here.factors is None else tr.kkt(here.z)
        momentum = tr.momentum(here.z)
        with np.errstate(all="ignore"):
            for _ in range(INVERSE_ITERATIONS):
                p = momentum(y)
                p[layout.unknowns :] = 0.0
                y = factors.solve(p / np.sqrt(y @ p), ROUGH)
            y[layout.unknowns :] = 0.0
            kinetic, bent = y @ momentum(y), y @ product(layout, matrix, y)
            least = min(1 / np.sqrt(kinetic), abs(bent / kinetic))
    except np.linalg.LinAlgError:
        return False
    return bool(least > max(BENT if m == 0 else 10 * INDEX_TOLERANCE, here.since))
