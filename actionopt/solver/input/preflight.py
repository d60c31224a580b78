"""What can be wrong with a question, found before any solver runs.

The checks look at a few points of the first path: the constraint Jacobian must have full rank
there and the mass matrix must be regular on the motions that the constraints allow.
"""

from __future__ import annotations

import numpy as np

from actionopt.discrete.action.transcription import Transcription
from actionopt.mechanics.laws.lengths import is_length
from actionopt.mechanics.question.scales import first_state
from actionopt.mechanics.question.singular_ends import BESIDE_EVENT, nonfinite
from actionopt.mechanics.system import System
from actionopt.tools.types import RANK, Array

# Ad hoc.
CHECKED_POINTS = 3  # of the path; a defect shows at all of them


def check(tr: Transcription, Q: Array, *, borrowed: bool = False) -> None:
    """Look at the path with node coordinates Q (K, n).

    Units that are `borrowed` from a neighbour tell its inertia, which may vanish here.

    Raises
    ------
    ValueError
        If constraints are redundant or inconsistent (the rows are named), the mass matrix is
        singular (the coordinate is named), or L is not finite: along the whole path, or at an event
        (the coordinate is named).
    """
    problem = tr.problem.free  # an obstacle, whatever is in contact, is none of its constraints
    system = problem.system
    nodes = tr.mesh.nodes
    with np.errstate(all="ignore"):
        if not tr.finite(tr.pack(Q)):
            _check_events(tr, Q)
            _check_finite(tr, Q)
    second = system.pointwise("second")
    row, col = second.sparsity(2)
    inertia = tr.inertia
    if borrowed:
        middle = slice(nodes.size // 2, nodes.size // 2 + 1)
        rest = first_state(system, Q[middle], np.zeros_like(Q[middle]))
        inertia = second(*rest, nodes[middle, None], problem.packed)[2][0]
    if (row == col).all():  # the full matrix of many coordinates has far more numbers
        regular = row.size == system.n and bool((inertia > 0).all())
    else:
        regular = _definite(second.full(2, inertia[None], symmetric=True)[0])
    if regular and not system.m:
        return
    last = nodes.size - 1
    chosen = sorted({k * last // (CHECKED_POINTS + 1) for k in range(CHECKED_POINTS + 2)})[
        1:-1
    ] or [0]
    q, t = Q[chosen], nodes[chosen][:, None]
    G = None
    if system.m:
        jacobian = system.pointwise("constraint_jacobian")
        G, f = jacobian(q, t, problem.packed)
        G = jacobian.full(0, G)
        _check_rank(system, f, G * tr.lengths)
    if regular:
        return
    # Generic velocities: a mass matrix such as that of v^4 is singular at rest only.
    rates = tr.lengths / problem.duration
    v = rates * (1 + 0.5 * np.cos(np.arange(q.size).reshape(q.shape)))
    state = first_state(system, q, v)
    M = second.full(2, second(*state, t, problem.packed)[2], symmetric=True)
    M = M * tr.lengths[:, None] * tr.lengths
    finite = np.isfinite(M).all(axis=(1, 2))
    if not finite.any():
        raise ValueError(
            "expected a Lagrangian that is finite along the first path, found NaN or infinity at "
            f"q = {q[0].tolist()}, t = {t[0, 0]}; give a guess that avoids the singularity"
        )
    try:
        _check_mass(system.coordinates, M[finite], None if G is None else (G * tr.lengths)[finite])
    except ValueError as error:
        if not is_length(system):
            raise
        raise ValueError(
            f"{error}. This L is homogeneous of degree one in the velocities, a length or a travel "
            "time, stationary at whatever rate its path is run through: make the system by "
            "System.geodesic(length, coordinates)"
        ) from None


def _check_finite(tr: Transcription, Q: Array) -> None:
    """Raise ValueError if L is finite nowhere along the path with node coordinates Q (K, n)."""
    (at, v), problem = tr.state_of(Q), tr.problem
    L = problem.system.pointwise("first")(at, v, tr.times, problem.packed)[2]
    if not np.isfinite(L).any():
        raise ValueError(
            "expected a Lagrangian that is finite along the first path, found NaN or infinity at "
            f"all of its times, such as at q = {at[0].tolist()}, t = {tr.times[0, 0]}; keep to "
            "its domain, or give a guess that avoids the singularity"
        )


def _check_events(tr: Transcription, Q: Array) -> None:
    """Raise ValueError if L, its derivatives or Q are infinite at an event at every velocity."""
    problem, nodes = tr.problem, tr.mesh.nodes
    n, rates = problem.system.n, tr.lengths / problem.duration

    def at(q: Array, t: float) -> str:
        return nonfinite(problem, q, t, rates)

    for k, role, event in ((0, "start", problem.start), (-1, "end", problem.end)):
        what = at(Q[k], nodes[k])
        if not what or problem.singular_ends[k]:  # the path may be regular there all the same
            continue
        beside = tr.mesh.duration * BESIDE_EVENT * (1 if k == 0 else -1)
        where = [f"t = {event.t:g}"] if not at(Q[k], nodes[k] + beside) else []
        for i in event.pinned:
            name = problem.system.coordinates[i]
            step = np.where(np.arange(n) == i, BESIDE_EVENT * tr.lengths, 0.0)
            if not (at(Q[k] + step, nodes[k]) and at(Q[k] - step, nodes[k])):
                where.append(f"{name} = {Q[k, i]:g}")
        if not where:  # nor is it beside the event
            around = [Q[k] + sign * BESIDE_EVENT * tr.lengths for sign in (1, -1)]
            if what == "L" or len(event.pinned) < n or not all(at(q, nodes[k]) for q in around):
                continue
            raise ValueError(
                f"expected a Lagrangian whose derivatives are finite at the {role} event, found "
                f"that {what} is not at and near q = {Q[k].tolist()}, where L is: a function in it "
                "overflows, as cosh(x) beyond 710; write 1 / cosh(x) as "
                "2 exp(-|x|) / (1 + exp(-2 |x|))"
            )
        raise ValueError(
            f"expected a Lagrangian that is finite at the {role} event, found that {what} is not, "
            f"where {' and '.join(where)}, whatever the velocity; put the event a "
            "little beside (`trace` may then follow the path towards it), or use coordinates in "
            "which the place is regular"
        )


def _check_rank(system: System, f: Array, G: Array) -> None:
    """Raise ValueError if G (K, m, n), scaled, lacks rank at all of K points, where f is (K, m).

    It names the rows of the null vector, and says whether they contradict each other.
    """
    if system.m > system.n:
        raise ValueError(
            f"expected at most {system.n} constraints on {system.n} coordinates, found {system.m}"
        )
    size = np.linalg.norm(G, axis=2, keepdims=True)
    if not np.isfinite(G).all():
        return
    unit = G / np.where(size > 0, size, 1.0)
    if _definite(unit[0] @ unit[0].T):
        return
    left, values, _ = np.linalg.svd(unit, full_matrices=False)
    if not np.all(values[:, -1] <= RANK * values[:, 0]):
        return
    null = np.abs(left[0, :, -1])
    rows = np.flatnonzero(null > 1e-6 * null.max()).tolist()
    miss = np.abs(f / np.maximum(size[..., 0], np.finfo(float).tiny))[:, rows].max()
    if len(rows) == 1:
        raise ValueError(
            f"expected constraints that each restrict the coordinates, found that row {rows[0]} "
            "does not depend on any of them there; remove it, or correct it"
        )
    verdict = "contradict each other" if miss > 1e-6 else "say the same thing"
    raise ValueError(
        f"expected independent constraints, found that rows {rows} {verdict} (their gradients are "
        "linearly dependent along the path), so that their multipliers are not determined; "
        f"remove one of rows {rows}"
    )


def _check_mass(names: tuple[str, ...], M: Array, G: Array | None) -> None:
    """Raise ValueError if M (K, n, n) is singular on the null space of G (K, m, n) everywhere."""
    for k in range(len(M)):
        units = _equilibrating(M[k])
        basis = np.eye(len(names))
        if G is not None:
            _, values, right = np.linalg.svd(G[k] * units)
            basis = right[np.sum(values > RANK * values[0]) :].T
        if basis.shape[1] == 0:
            return
        on_motions = basis.T @ (M[k] * units * units[:, None]) @ basis
        _, values, right = np.linalg.svd(on_motions)
        if values[-1] > RANK * values[0]:
            return
        direction = np.abs(basis @ right[-1])
    worst = [names[i] for i in np.flatnonzero(direction > 0.1 * direction.max())]
    raise ValueError(
        f"expected a regular mass matrix d2L/dv2, found it singular in the direction of "
        f"{', '.join(worst)}: L is not quadratic or convex in that velocity, so its motion is not "
        "determined by two events. That is legitimate only in a direction that the constraints "
        "fix; eliminate the coordinate where it is cyclic or has no inertia, give it a mass, or "
        "use v . v / 2 in place of a length |v|"
    )


def _equilibrating(M: Array) -> Array:
    """Return r so that diag(r) M diag(r) has rows of size one, whatever the coordinates' units.

    A coordinate without inertia keeps its own unit, beside those of the largest inertia.
    """
    largest = np.max(np.abs(M))
    r = np.full(len(M), 1 / np.sqrt(largest) if largest > 0 else 1.0)
    for _ in range(5):  # Ruiz scaling
        row = np.max(np.abs(M * r * r[:, None]), axis=1)
        r /= np.sqrt(np.where(row > 0, row, 1.0))
    return r


def _definite(M: Array) -> bool:
    """Whether M is plainly positive definite in any units, the ordinary case, quickly found out."""
    try:
        pivots = np.diagonal(np.linalg.cholesky(M)) ** 2
    except np.linalg.LinAlgError:
        return False
    return bool((pivots > RANK * np.diagonal(M)).all())
