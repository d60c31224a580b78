"""Goddard's rocket: how high it comes with its fuel. Full thrust, a singular arc, a coast.

Units are those of the radius, the gravity at the ground and the mass at the start.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import casadi as ca
import numpy as np

from actionopt.suite.models.control import CONTROLLED, check_elements
from actionopt.suite.models.fields import MOST_ROUNDS, STEP_OF_ROUND_OFF
from actionopt.suite.models.integrate import integrate
from actionopt.suite.models.model import KnownAnswer, WrittenModel
from actionopt.tools.types import Array

EXHAUST = 0.5  # speed of what is burnt
DRAG, STEEPNESS = 310.0, 500.0  # of the air at the ground over v^2, and how fast it thins out
DRY_MASS = 0.6
ARC_TOLERANCE = 1e-9  # of each step along an arc
IGNITION_HALVINGS = 50  # the digits of a float
FARTHEST = 0.3  # in units of x: of one step of Newton's method; ad hoc
ROCKET_SIZES = {
    "h": 0.01,
    "v": 0.1,
    "m": 1 - DRY_MASS,
    "T": 0.2,
}  # how far it rises, and so on: orders


def goddard_rocket(*, elements: int = 50, most: float = 3.5) -> WrittenModel:
    """Return how to burn the fuel, by a thrust u <= `most`, so that a rocket rises highest.

        h' = v,   v' = (u - drag)/m - 1/h^2,   m' = -u/c,   drag = 310 v^2 exp(-500 (h - 1))

    Steps are equal, and the time of them all is free; u is constant in each, v is taken where it
    ends, h and m where it begins. So the optimum on steps has the arcs of the continuous one, and u
    does not oscillate: full thrust, thrust in no bound, none. f is linear; what determines u on the
    singular arc is the curvature of the rows alone. No flight is shorter than full thrust burns all
    fuel: where the time may be zero, the rocket on the ground is stationary with any u.

    Raises ValueError if the fuel is burnt before that arc begins, or `most` is not enough on it.

    Source: E. D. Dolan, J. J. More and T. S. Munson, *Benchmarking Optimization Software with COPS
    3.0*, Argonne ANL/MCS-TM-273 (2004), problem 12, with its numbers and its starting point.
    """
    count = check_elements(elements)
    _, time = _arcs(most)
    h, v, m = (ca.SX.sym(name, count) for name in "hvm")
    u, T = ca.SX.sym("u", count), ca.SX.sym("T")
    x, step = ca.vertcat(h, v, m, u, T), T / count
    at, fast, heavy = ca.vertcat(1, h[:-1]), ca.vertcat(0, v[:-1]), ca.vertcat(1, m[:-1])
    rows = ca.vertcat(
        h - at - step * v,
        v - fast - step * ((u - _drag(at, fast)) / heavy - 1 / at**2),
        m - heavy + step * u / EXHAUST,
    )
    free = np.full(3 * count, np.inf)
    lower = np.concatenate([-free, np.zeros(count + 1)])
    lower[3 * count - 1], lower[-1] = DRY_MASS, (1 - DRY_MASS) * EXHAUST / most
    upper = np.concatenate([free, np.full(count, most), [np.inf]])

    unit = np.repeat(
        [ROCKET_SIZES["h"], ROCKET_SIZES["v"], ROCKET_SIZES["m"], 1.0, ROCKET_SIZES["T"]],
        [*[count] * 4, 1],
    )

    def newton() -> KnownAnswer:
        lam = ca.SX.sym("lam", 3 * count)
        slope = ca.gradient(-h[-1] + ca.dot(lam, rows), x)
        curved, slopes = ca.jacobian(slope, x, {"symmetric": True}), ca.jacobian(rows, x)
        every = ca.Function("every", [x, lam], [slope, rows, curved, slopes])
        z, y = _flight(count, most, time), np.zeros(3 * count)
        g, _, _, J = every(z, y)
        inside = np.flatnonzero((lower < z) & (z < upper)).tolist()
        # With squares in place of f, a step has the multipliers that fit best.
        y = _kkt_step(ca.DM.eye(len(inside)), J[:, inside], g[inside], ca.DM(3 * count, 1))[1]
        for _ in range(MOST_ROUNDS):
            push = -np.array(every(z, y)[0]).ravel()
            at_low, at_high = push + z - lower < 0, push + z - upper > 0
            z = np.where(at_low, lower, np.where(at_high, upper, z))
            inside = np.flatnonzero(~(at_low | at_high)).tolist()
            g, c, W, J = every(z, y)
            moved, turned = _kkt_step(W[inside, inside], J[:, inside], g[inside], c)
            part = min(1.0, FARTHEST / float(np.max(np.abs(moved) / unit[inside])))
            z[inside] += part * moved
            y = y + part * turned
            if np.max(np.abs(moved)) <= STEP_OF_ROUND_OFF:
                how = "high precision: Newton's method with an active set, from the three arcs"
                return KnownAnswer(z, y, how)
        raise ValueError(f"expected elements that tell the arcs, found {count}; use more")

    k = np.arange(1, count + 1) / count
    start = [np.ones(count), k * (1 - k), 1 - (1 - DRY_MASS) * k, np.full(count, most / 2), [1.0]]
    return WrittenModel(
        "goddard_rocket",
        x,
        -h[-1],
        rows,
        bounds=(lower, upper),
        unit=unit,
        start=np.concatenate(start),
        answer=newton,
        tags=(*CONTROLLED, "singular arc"),
    )


def greatest_height(most: float = 3.5) -> float:
    """Return the height of the best flight of all, which -f* tends to on many elements.

    Raises ValueError as `goddard_rocket`.
    """
    return _arcs(most)[0]


def _kkt_step(W: ca.DM, J: ca.DM, g: ca.DM, c: ca.DM) -> tuple[Array, Array]:
    """Return the steps of x and lam to W x + J' lam = -g and J x = -c."""
    n = W.shape[0]
    matrix = ca.blockcat([[W, J.T], [J, ca.DM(J.shape[0], J.shape[0])]])
    # The column of the time is full: a sparse factorization would fill in.
    step = -np.linalg.solve(ca.densify(matrix).full(), ca.vertcat(g, c).full().ravel())
    return step[:n], step[n:]


def _drag(h: Any, v: Any) -> Any:
    return DRAG * v**2 * ca.exp(-STEEPNESS * (h - 1))


def _rate(y: Array, u: float) -> Array:
    """Return the rates of h, v, m and the time."""
    h, v, m, _ = y
    return np.array([v, (u - _drag(h, v)) / m - 1 / h**2, -u / EXHAUST, 1.0])


def _beyond(y: Array) -> float:
    """Return how far a flight at full thrust is beyond the singular arc: drag (1 + v/c) = m g.

    That is where u does not change the Hamiltonian, nor its first derivative in time, the
    Hamiltonian being zero as the time is free.

    Source: A. E. Bryson and Y.-C. Ho, *Applied Optimal Control* (1975), section 8.3.
    """
    h, v, m, _ = y
    return _drag(h, v) * (1 + v / EXHAUST) - m / h**2


def _thrust(y: Array) -> float:
    """Return the thrust that stays on the singular arc."""
    h, v, m, _ = y
    drag, g = _drag(h, v), 1 / h**2
    by_speed = drag * (2 / v + 3 / EXHAUST)
    by_height = 2 * m / h**3 - STEEPNESS * drag * (1 + v / EXHAUST)
    return (by_speed * (drag / m + g) - by_height * v) / (by_speed / m + g / EXHAUST)


@cache
def _arcs(most: float) -> tuple[float, float]:
    """Return height and time of the best flight of all.

    Each arc is followed along what is known where it ends: the time, the mass, the speed.
    """

    def burnt(t: float) -> Array:
        ground = np.array([1.0, 0.0, 1.0, 0.0])
        return integrate(lambda y: _rate(y, most), ground, t, ARC_TOLERANCE)

    def along_mass(y: Array) -> Array:
        rate = _rate(y, _thrust(y))
        return rate / -rate[2]

    def along_speed(y: Array) -> Array:
        rate = _rate(y, 0.0)
        return rate / -rate[1]

    low, high = 0.0, (1 - DRY_MASS) * EXHAUST / most if 1 < most < np.inf else 0.0
    y = None
    if high and _beyond(burnt(high)) > 0:
        for _ in range(IGNITION_HALVINGS):
            t = (low + high) / 2
            low, high = (low, t) if _beyond(burnt(t)) > 0 else (t, high)
        start = burnt(low)
        end = integrate(along_mass, start, start[2] - DRY_MASS, ARC_TOLERANCE)
        if max(_thrust(start), _thrust(end)) < most:
            y = integrate(along_speed, end, end[1], ARC_TOLERANCE)
    if y is None:
        raise ValueError(
            f"expected so much thrust that a singular arc is flown: more than about 3.1 of the "
            f"weight at the start, found {most!r}"
        )
    return float(y[0]), float(y[3])


def _flight(count: int, most: float, time: float) -> Array:
    """Return the unknowns of a flight in steps that burns as the best one does."""
    step, y = time / count, np.array([1.0, 0.0, 1.0, 0.0])
    states, thrusts = [], []
    for _ in range(count):
        u = most if _beyond(y) < 0 else float(np.clip(_thrust(y), 0, most))
        u = min(u, (y[2] - DRY_MASS) * EXHAUST / step)  # no more than what is left
        rate = _rate(y, u)
        y = y + step * rate
        y[0] += step**2 * rate[1]  # at the speed where the step ends
        states.append(y[:3])
        thrusts.append(u)
    return np.concatenate([np.transpose(states).ravel(), thrusts, [time]])
