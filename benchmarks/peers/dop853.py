"""Shooting: scipy's DOP853 with the variational equations, and Newton's method on v(0)."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.peers._peer import TOLERANCES, Answer, Failed, Peer, first_velocity
from benchmarks.problems import Case, Ends

ITERATIONS = 25


def _shoot(case: Case, ends: Ends, v, tol: float) -> Answer:
    n, T = case.n, case.duration
    scale = np.max(np.abs([ends.start, ends.end]))

    def plain(t, y):
        return case.rhs(t, y)

    def varied(t, y):
        state = y[: 2 * n]
        J = case.jacobian(np.array([t]), state[:, None])[:, :, 0]
        return np.concatenate([case.rhs(t, state), (J @ y[2 * n :].reshape(2 * n, n)).ravel()])

    first = np.concatenate([np.zeros((n, n)), np.eye(n)]).ravel()
    limits = {"method": "DOP853", "rtol": max(tol, 3e-14), "atol": max(tol, 1e-15) * scale}
    last, damping = np.inf, 1.0
    for _ in range(ITERATIONS):
        out = solve_ivp(varied, (0.0, T), np.concatenate([ends.start, v, first]), **limits)
        if not out.success or not np.all(np.isfinite(out.y[:, -1])):
            raise Failed(f"integration: {out.message}")
        end = out.y[:, -1]
        miss = end[:n] - ends.end
        size = np.max(np.abs(miss)) / scale
        if size > 1e3:
            raise Failed("shooting ran away")
        step = np.linalg.solve(end[2 * n :].reshape(2 * n, n)[:n], miss)
        damping = 1.0 if size < last else damping / 2
        last = size
        v = v - damping * step
        # Newton's next miss is quadratic in this one.
        if size**2 < tol / 100 or size < 1e-14:
            break
    else:
        raise Failed(f"no convergence in {ITERATIONS} iterations")
    out = solve_ivp(plain, (0.0, T), np.concatenate([ends.start, v]), dense_output=True, **limits)
    return Answer(lambda t: out.sol(t)[:n], v)


def cold(case: Case, ends: Ends, start: str, tol: float) -> Answer:
    """Shoot with the guess's own first velocity."""
    return _shoot(case, ends, first_velocity(case, ends, start), tol)


def again(answer: Answer, case: Case, ends: Ends, tol: float) -> Answer:
    """Shoot with the last solution's first velocity."""
    return _shoot(case, ends, answer.state, tol)


PEER = Peer("shooting, DOP853", ("scipy",), TOLERANCES, cold, again)
