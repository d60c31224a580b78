"""Shooting: scipy's DOP853 with the variational equations, and damped Newton on v(0)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.peers._peer import TOLERANCES, Answer, Peer, first_velocity, meeting, tangent
from benchmarks.problems import Case, Ends

ROUNDOFF = 1e-13


def _scale(ends: Ends) -> float:
    return float(np.max(np.abs([ends.start, ends.end]))) or 1.0


def _limits(ends: Ends, tol: float) -> dict:
    scale = _scale(ends)
    return {"method": "DOP853", "rtol": max(tol, 3e-14), "atol": max(tol, 1e-15) * scale}


def end_and_slope(case: Case, ends: Ends, v, Z, tol: float):
    """Integrate with the variations Z (n, k) of v; return the miss and its derivatives.

    That is max |miss| relative to the end points' size (infinite if the integration fails),
    miss (n,), d miss / d Z (n, k) and the last velocity (n,).
    """
    n = case.n

    def varied(t, y):
        state = y[: 2 * n]
        J = case.jacobian(np.array([t]), state[:, None])[:, :, 0]
        return np.concatenate([case.rhs(t, state), (J @ y[2 * n :].reshape(2 * n, -1)).ravel()])

    first = np.concatenate([ends.start, v, np.zeros_like(Z).ravel(), Z.ravel()])
    out = solve_ivp(varied, (0.0, case.duration), first, **_limits(ends, tol))
    end = out.y[:, -1]
    if not out.success or not np.all(np.isfinite(end)):
        return np.inf, None, None, None
    miss = end[:n] - ends.end
    size = np.max(np.abs(miss)) / _scale(ends)
    return size, miss, end[2 * n :].reshape(2 * n, -1)[:n], end[n : 2 * n]


def shoot(case: Case, ends: Ends, v: np.ndarray, tol: float) -> Answer:
    """Return the path with the first velocity near v (n,) that meets the end."""
    Z = tangent(case, ends)
    v = meeting(lambda v: end_and_slope(case, ends, v, Z, tol)[:3], v, Z, tol, ROUNDOFF)
    first = np.concatenate([ends.start, v])
    span = (0.0, case.duration)
    out = solve_ivp(case.rhs, span, first, dense_output=True, **_limits(ends, tol))
    return Answer(lambda t: out.sol(t)[: case.n], v)


def of_energy(case: Case, ends: Ends, v: np.ndarray, T: float, tol: float) -> Answer:
    """Return the path whose first velocity and duration, near v and T, meet the end and energy.

    Unit masses: the energy is |v|^2 / 2 - L(v = 0).
    """
    n = case.n
    rest = -case.lagrangian(ends.start, np.zeros(n), 0.0, **case.parameters)

    def fly(u):
        if not u[n] > 0:
            return np.inf, None, None
        meant = replace(case, duration=u[n])
        size, miss, slope, last = end_and_slope(meant, ends, u[:n], np.eye(n), tol)
        if miss is None:
            return np.inf, None, None
        assert last is not None
        off = u[:n] @ u[:n] / 2 + rest - case.energy
        slopes = np.block([[slope, last[:, None]], [u[None, :n], np.zeros((1, 1))]])
        return max(size, abs(off / case.energy)), np.append(miss, off), slopes

    u = meeting(fly, np.append(v, T), np.eye(n + 1), tol, ROUNDOFF)
    first = np.concatenate([ends.start, u[:n]])
    out = solve_ivp(case.rhs, (0.0, u[n]), first, dense_output=True, **_limits(ends, tol))
    return Answer(lambda t: out.sol(t)[:n], u, float(u[n]))


def cold(case: Case, ends: Ends, start: str, tol: float) -> Answer:
    """Shoot with the guess's own first velocity."""
    if case.energy is not None:
        return of_energy(case, ends, first_velocity(case, ends, start), case.duration, tol)
    return shoot(case, ends, first_velocity(case, ends, start), tol)


def again(answer: Answer, case: Case, ends: Ends, tol: float) -> Answer:
    """Shoot with the last solution's first velocity."""
    if case.energy is not None:
        return of_energy(case, ends, answer.state[: case.n], answer.state[case.n], tol)
    return shoot(case, ends, answer.state, tol)


PEER = Peer(("scipy",), TOLERANCES, cold, again, ("ends", "energy", "orbit"))
