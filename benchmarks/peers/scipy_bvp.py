"""scipy's `solve_bvp`: hand-derived, vectorised right-hand side and Jacobians.

Both halves of the state are given in units that make them of one size (`time_unit`), the
Jacobians of the end conditions are given too, and the mesh may grow as far as it needs.
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_bvp

from benchmarks.peers._peer import TOLERANCES, Answer, Failed, Peer, waypoints
from benchmarks.problems import Case, Ends

FIRST_MESH = 17
MAX_NODES = 50_000


def solve(
    case: Case, ends: Ends, x, y, tol: float, keep=None, max_nodes: int = MAX_NODES
) -> Answer:
    """Solve from the guess y (2 n, K) at the nodes x (K,).

    `keep` is the mesh to start from when solving again; without it, the one arrived at.
    """
    n, unit = case.n, case.time_unit
    zero, eye = np.zeros((n, n)), np.eye(n)
    at_start, at_end = np.block([[eye, zero], [zero, zero]]), np.block([[zero, zero], [eye, zero]])

    def rhs(t, y):
        out = case.rhs(t, np.concatenate([y[:n], y[n:] / unit]))
        out[n:] *= unit
        return out

    def jacobian(t, y):
        J = case.jacobian(t, np.concatenate([y[:n], y[n:] / unit]))
        J[:n, n:] /= unit
        J[n:, :n] *= unit
        return J

    def conditions(a, b):
        return np.concatenate([a[:n] - ends.start, b[:n] - ends.end])

    found = solve_bvp(
        rhs,
        conditions,
        x,
        y,
        tol=tol,
        max_nodes=max_nodes,
        fun_jac=jacobian,
        bc_jac=lambda a, b: (at_start, at_end),
    )
    if not found.success:
        raise Failed(found.message)
    # Nodes are only ever added: the mesh of the first solve is kept, or it would grow.
    return Answer(lambda t: found.sol(t)[:n], (found.x if keep is None else keep, found.sol))


def of_energy(case: Case, ends: Ends, x, y, T: float, tol: float, keep=None) -> Answer:
    """Solve for y (2 n, K) over x = t / T in [0, 1] and for T, an unknown parameter."""
    n, system = case.n, _energy(case)

    def conditions(a, b, p):
        energy = system(a[:n], a[n:])[0]
        return np.concatenate([a[:n] - ends.start, b[:n] - ends.end, [energy - case.energy]])

    def slopes(a, b, p):
        at_start, at_end = np.zeros((2, 2 * n + 1, 2 * n))
        at_start[:n, :n] = at_end[n : 2 * n, :n] = np.eye(n)
        at_start[2 * n] = system(a[:n], a[n:])[1]
        return at_start, at_end, np.zeros((2 * n + 1, 1))

    found = solve_bvp(
        lambda x, y, p: p[0] * case.rhs(p[0] * x, y),
        conditions,
        x,
        y,
        p=[T],
        tol=tol,
        max_nodes=MAX_NODES,
        fun_jac=lambda x, y, p: (p[0] * case.jacobian(p[0] * x, y), case.rhs(x, y)[:, None]),
        bc_jac=slopes,
    )
    if not found.success:
        raise Failed(found.message)
    T = float(found.p[0])
    state = (found.x if keep is None else keep, found.sol, T)
    return Answer(lambda t: found.sol(t / T)[:n], state, T)


def _energy(case: Case):
    """Return (q, v) -> the energy |v|^2 / 2 + V of unit masses, from L at v = 0, and slopes."""
    zero = np.zeros(case.n)

    def energy(q, v):
        V = -case.lagrangian(q, zero, 0.0, **case.parameters)
        return v @ v / 2 + V, np.concatenate([-case.rhs(0.0, np.append(q, zero))[case.n :], v])

    return energy


def of_kink(case: Case, ends: Ends, x, y, tol: float, keep=None) -> Answer:
    """Solve half of an odd kink: from the middle to a window's edge, on the linear manifold there.

    What the edge leaves out is of the second order in the distance from rest.
    """
    J = case.jacobian(np.zeros(1), np.append(ends.end, 0.0)[:, None])[1, 0, 0]
    rate = np.sqrt(J)
    middle = (ends.start + ends.end) / 2
    found = solve_bvp(
        case.rhs,
        lambda a, b: np.array([a[0] - middle[0], b[1] + rate * (b[0] - ends.end[0])]),
        x,
        y,
        tol=tol,
        max_nodes=MAX_NODES,
        fun_jac=case.jacobian,
        bc_jac=lambda a, b: (np.array([[1.0, 0], [0, 0]]), np.array([[0.0, 0], [rate, 1]])),
    )
    if not found.success:
        raise Failed(found.message)

    def curve(t):
        late = np.abs(t - case.duration / 2)
        q = found.sol(np.minimum(late, found.x[-1]))[0]
        beyond = np.exp(-rate * np.maximum(late - found.x[-1], 0.0))
        away = (ends.end[0] - middle[0]) + (q - ends.end[0]) * beyond
        return (middle[0] + np.sign(t - case.duration / 2) * away)[None]

    return Answer(curve, (found.x if keep is None else keep, found.sol))


def cold(case: Case, ends: Ends, start: str, tol: float) -> Answer:
    """Solve from a uniform mesh."""
    if case.asks == "infinity":
        J = case.jacobian(np.zeros(1), np.append(ends.end, 0.0)[:, None])[1, 0, 0]
        x = np.linspace(0.0, (2.0 - np.log(tol) / 2) / np.sqrt(J), FIRST_MESH)
        half = (ends.end - ends.start)[:, None] / 2
        y = np.concatenate([half * x / x[-1], half / x[-1] + 0 * x[None]])
        return of_kink(case, ends, x, y, tol)
    x = np.linspace(0.0, case.duration, FIRST_MESH)
    q, v = waypoints(case, ends, start, x)
    if case.energy is not None:
        y = np.concatenate([q, v])
        return of_energy(case, ends, x / case.duration, y, case.duration, tol)
    return solve(case, ends, x, np.concatenate([q, v * case.time_unit]), tol)


def again(answer: Answer, case: Case, ends: Ends, tol: float) -> Answer:
    """Solve from the last solution on the mesh of the first."""
    mesh, last, *T = answer.state
    if case.asks == "infinity":
        return of_kink(case, ends, mesh, -last(mesh), tol, keep=mesh)
    if case.energy is not None:
        return of_energy(case, ends, mesh, last(mesh), T[0], tol, keep=mesh)
    return solve(case, ends, mesh, last(mesh), tol, keep=mesh)


PEER = Peer(("scipy",), TOLERANCES, cold, again, ("ends", "energy", "orbit", "infinity"))
