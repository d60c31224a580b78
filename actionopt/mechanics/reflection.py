"""Reflection and refraction: the velocity with which a motion leaves a surface that it meets.

At a surface on(q, t) = 0 the momentum changes along the normal alone, and the energy by as much as
the surface moves,

    p+ - p- = mu on_q,      H+ - H- = -mu on_t,

the conditions of Weierstrass and Erdmann (Gelfand and Fomin, *Calculus of Variations* (1963),
section 15). Under constraints f(q, t) = 0 the momentum changes along f_q, too, so that the motion
keeps to them. Where H is quadratic in the velocity these are one quadratic equation for mu, whose
two roots are the motion that passes and the one that is thrown back; none is real beyond the angle
of total reflection.
"""

from __future__ import annotations

import numpy as np

from actionopt.mechanics.system import System
from actionopt.tools.types import Array

Law = tuple[System, Array]  # a system, and its parameters packed in one row

LEGENDRE_STEPS = 8  # Newton steps where H is not quadratic in the velocity; ad hoc
LEGENDRE_EXACT = 1e-13  # of the momentum: a smaller residual is round-off; ad hoc


def leave(
    laws: tuple[Law, Law],
    state: tuple[Array, Array, Array],
    normals: tuple[Array, Array],
    *,
    bounces: bool,
) -> Array:
    """Return the velocities (K, n) after motions have met a surface, NaN where there is none.

    Parameters
    ----------
    laws : two of Law
        Before and after.
    state : q (K, n), v (K, n), t (K, 1)
        Where and how they meet it.
    normals : (K, n), (K,)
        on_q and on_t there.
    bounces : bool
        Whether they are thrown back, or pass.
    """
    (q, v, t), (by_q, by_t) = state, normals
    if laws[0][0].m:
        by_q, by_t = _along_constraints(laws[0], (q, v, t), (by_q, by_t))
    with np.errstate(all="ignore"):
        p, H, M = _momenta(laws[0], q, v, t)
        arriving = np.sum(by_q * v, axis=1) + by_t
        u = v
        if laws[0] is not laws[1]:  # the velocity of the same momentum
            for _ in range(LEGENDRE_STEPS):
                other, _, M = _momenta(laws[1], q, u, t)
                step = _solve(M, other - p)
                u = u - step
                if not (np.abs(step) > LEGENDRE_EXACT * np.abs(u).max()).any():
                    break
        _, after, M = _momenta(laws[1], q, u, t)
        along = _solve(M, by_q)
        a, b = np.sum(by_q * along, axis=1), np.sum(by_q * u, axis=1) + by_t
        root = np.sqrt(b * b - 2 * a * (after - H)) * np.sign(arriving) * np.sign(a)
        mu = ((-root if bounces else root) - b) / a
        u = u + mu[:, None] * along
        for _ in range(LEGENDRE_STEPS):
            other, after, M = _momenta(laws[1], q, u, t)
            miss, energy = other - p - mu[:, None] * by_q, after - H + mu * by_t
            far = (np.abs(miss) > LEGENDRE_EXACT * np.abs(p).max()).any()
            if not far and not (np.abs(energy) > LEGENDRE_EXACT * (1 + np.abs(H)).max()).any():
                break
            along, step = _solve(M, by_q), _solve(M, miss)
            # dH = v.M dv, and dv = -M^-1 miss + dmu M^-1 on_q
            slope = np.sum(u * by_q, axis=1) + by_t
            change = -(energy - np.sum(u * miss, axis=1)) / slope
            mu, u = mu + change, u - step + change[:, None] * along
    return u


def _along_constraints(
    law: Law, state: tuple[Array, Array, Array], normals: tuple[Array, Array]
) -> tuple[Array, Array]:
    """Return on_q + nu f_q (K, n) and on_t + nu f_t (K,): a jump by which keeps to f(q, t) = 0."""
    (system, packed), (q, _, t), (by_q, by_t) = law, state, normals
    function = system.pointwise("constraint_jacobian")
    G, M = function.full(0, function(q, t, packed)[0]).copy(), _momenta(law, *state)[2]
    moving = system.pointwise("constraint_rate")(q, t, packed)[0]
    with np.errstate(all="ignore"):
        try:
            carried = np.linalg.solve(M, np.swapaxes(G, 1, 2))
            nu = -np.linalg.solve(G @ carried, np.swapaxes(carried, 1, 2) @ by_q[..., None])
        except np.linalg.LinAlgError:
            return np.full(by_q.shape, np.nan), by_t
    return by_q + np.einsum("kji,kj->ki", G, nu[..., 0]), by_t + np.sum(moving * nu[..., 0], axis=1)


def _momenta(law: Law, q: Array, v: Array, t: Array) -> tuple[Array, Array, Array]:
    """Return momenta (K, n), energies (K,) and mass matrices (K, n, n)."""
    system, packed = law
    _, p, L = system.pointwise("first")(q, v, t, packed)
    p, H = p.copy(), np.sum(p * v, axis=1) - L[:, 0]
    M = system.pointwise("motion")(q, v, t, packed)[0]
    return p, H, M.reshape(len(q), system.n, system.n).copy()


def _solve(M: Array, rows: Array) -> Array:
    """Return M^-1 rows, (K, n); NaN where one of the matrices is singular."""
    try:
        return np.linalg.solve(M, rows[..., None])[..., 0]
    except np.linalg.LinAlgError:
        return np.full(rows.shape, np.nan)
