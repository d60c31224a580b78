"""How long a motion of given energy takes along a curve, before any path is known.

Along a curve q(s) the energy function H(q, u ds/dt) of the direction u = dq/ds is E at one rate
ds/dt, and the duration is the integral of ds over it. Where the potential is above E there is none:
no motion takes that curve, and a part of the largest rate is reckoned with there.
"""

from __future__ import annotations

import numpy as np

from actionopt.mechanics.problem import Problem, diagonal
from actionopt.tools.types import Array

# Ad hoc: what comes of it is a guess.
STEPS = 40  # of the fixed point for the rate: one where L is quadratic in v
SEEN = np.logspace(-4, 4, 65)  # of a coordinate's size: how far from its start a well is looked for
BISECTIONS, ROUND = 50, 81  # of a turning point; waypoints of a guess
LEAST_RATE = 0.1  # of the largest rate: turning points are passed at a finite one


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
        for _ in range(STEPS):
            T = H(rate[:, None] * u) - rest
            factor = np.sqrt(np.abs(left / T))
            factor = np.where(np.isfinite(factor) & (factor > 0), np.clip(factor, 1e-6, 1e6), 0.5)
            rate = rate * factor
            if np.all(np.abs(factor - 1) < 1e-12):
                break
    return np.where(left > 0, rate, np.nan), left


def along(problem: Problem, q: Array, t: float) -> tuple[Array, float] | None:
    """Return the times (K,) from zero at which a motion of the energy passes q (K, n).

    And the least of E less the energy at rest. None where it can be nowhere on the curve.
    """
    u = np.gradient(q, axis=0) * (len(q) - 1)
    found, left = rates(problem, q, u, np.full((len(q), 1), t))
    good = np.isfinite(found)
    if not good.any() or not np.any(u):
        return None
    largest = float(np.nanmax(found))
    rate = np.where(good, found, 0.0)
    mean = (rate[1:] + rate[:-1]) / 2  # exact at a constant force, from or to rest too
    steps = 1 / np.where(mean > 0, mean, LEAST_RATE * largest) / (len(q) - 1)
    return np.concatenate([[0.0], np.cumsum(steps)]), float(left.min())


def returning(problem: Problem, q: Array, t: float) -> float:
    """Return about how long a motion of the energy takes from q (n,) back to it: 2 p / |force|.

    1 where there is no force.
    """
    n = problem.system.n
    at = q[None], np.zeros((1, n)), np.array([[t]]), problem.packed
    force = np.abs(problem.system.pointwise("first")(*at)[0][0])
    inertia = diagonal(problem.system, 2, problem.system.pointwise("second")(*at)[2])[0]
    _, left = rates(problem, q[None], np.ones((1, n)), np.array([[t]]))
    with np.errstate(all="ignore"):
        found = 2 * np.sqrt(2 * np.abs(left) * inertia) / force
    found = found[np.isfinite(found) & (found > 0)]
    return float(found.min()) if found.size else 1.0


def well(problem: Problem) -> Array | None:
    """Return waypoints (1, K) there and back between the turning points of the energy.

    Of a closed path of one coordinate, in the well that is nearest to where it starts, or to zero;
    with an advance, straight on over all of it. None where no motion of the energy is seen.
    """
    if problem.system.n > 1 or problem.system.m or problem.advance is None:
        return None
    first, t = problem.system.pointwise("first"), problem.start.t

    def left(x: Array) -> Array:
        """E less the energy at rest."""
        q, at = x[:, None], np.full((x.size, 1), t)
        with np.errstate(all="ignore"):
            return problem.energy + first(q, 0 * q, at, problem.packed)[2][:, 0]  # type: ignore[operator]

    centre = problem.start.q[0] or 0.0
    if problem.advance.any():
        turn = centre + problem.advance * np.linspace(0, 1, ROUND)
        return turn[None] if (left(turn) > 0).all() else None
    x = centre + problem.scales[0] * np.concatenate([-SEEN[::-1], [0.0], SEEN])
    inside = left(x) > 0
    if not inside.any():
        return None
    k = int(np.argmin(np.where(inside, np.abs(x - centre), np.inf)))
    walls = np.flatnonzero(~inside)
    if not (walls[0] < k < walls[-1]):
        return None
    ends = []
    for wall, step in ((walls[walls < k][-1], 1), (walls[walls > k][0], -1)):
        within, beyond = x[wall + step], x[wall]
        for _ in range(BISECTIONS):
            middle = (within + beyond) / 2
            within, beyond = (
                (middle, beyond) if left(np.array([middle]))[0] > 0 else (within, middle)
            )
        ends.append(within)
    a, b = ends
    turn = np.linspace(0, 2 * np.pi, ROUND)
    return (a + (b - a) * (1 - np.cos(turn)) / 2)[None]
