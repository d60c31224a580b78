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


def cold(case: Case, ends: Ends, start: str, tol: float) -> Answer:
    """Solve from a uniform mesh."""
    x = np.linspace(0.0, case.duration, FIRST_MESH)
    q, v = waypoints(case, ends, start, x)
    return solve(case, ends, x, np.concatenate([q, v * case.time_unit]), tol)


def again(answer: Answer, case: Case, ends: Ends, tol: float) -> Answer:
    """Solve from the last solution on the mesh of the first."""
    mesh, last = answer.state
    return solve(case, ends, mesh, last(mesh), tol, keep=mesh)


PEER = Peer(("scipy",), TOLERANCES, cold, again)
