"""How long a motion of given energy takes along a curve, before any path is known.

Along a curve q(s) the energy function H(q, u ds/dt) of the direction u = dq/ds is E at one rate, and
the duration is the integral of ds over it. Where the potential is above E there is no rate; the curve is
none that a motion takes, and the rate there is that of the largest found.
"""

from __future__ import annotations

import numpy as np

from actionopt.mechanics.problem import Problem
from actionopt.tools.types import Array

# Ad hoc: what comes of it is a guess.
ROUNDS = 40  # of the fixed point for the rate: one where L is quadratic in v
SLOWEST = 0.1  # of the largest rate: turning points are passed at a finite one


def rates(problem: Problem, q: Array, u: Array, t: Array) -> tuple[Array, Array]:
    """Return ds/dt (K,) at q with dq/ds = u, both (K, n), and E less the energy at rest, (K,).

    NaN where the motion cannot be; t (K, 1).
    """
    first, p = problem.system.pointwise("first"), problem.packed
    energy = problem.energy or 0.0

    def H(v: Array) -> Array:
        _, Lv, L = first(q, v, t, p)
        return np.sum(v * Lv, axis=1) - L[:, 0]

    with np.errstate(all="ignore"):
        rest = H(0 * u)
        left, rate = energy - rest, np.ones(len(q))
        # The unit of rates is unknown: kinetic energies that are not finite are too large.
        for _ in range(ROUNDS):
            T = H(rate[:, None] * u) - rest
            factor = np.sqrt(np.abs(left / T))
            factor = np.where(np.isfinite(factor) & (factor > 0), np.clip(factor, 1e-6, 1e6), 0.5)
            rate = rate * factor
            if np.all(np.abs(factor - 1) < 1e-12):
                break
    return np.where(left > 0, rate, np.nan), left


def along(problem: Problem, q: Array, t: float) -> tuple[Array, float] | None:
    """Return times (K,) from zero at which a motion of the energy passes q (K, n), and the least
    of E less the energy at rest. None where it can be nowhere on the curve.
    """
    u = np.gradient(q, axis=0) * (len(q) - 1)
    found, left = rates(problem, q, u, np.full((len(q), 1), t))
    good = np.isfinite(found)
    if not good.any() or not np.any(u):
        return None
    largest = float(np.nanmax(found))
    rate = np.fmax(np.where(good, found, 0.0), SLOWEST * largest)
    steps = (1 / rate[1:] + 1 / rate[:-1]) / 2 / (len(q) - 1)
    return np.concatenate([[0.0], np.cumsum(steps)]), float(left.min())
