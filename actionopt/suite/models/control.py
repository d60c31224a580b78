"""Controls between bounds: full on one side, full on the other, and in between.

Steps are of constant control, which the motion follows exactly. States and controls are unknowns.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from actionopt.suite.models.model import KnownAnswer, WrittenModel
from actionopt.tools.types import Array

CONTROLLED = ("control",)
MOST_HALVINGS = 200  # more than the digits of a float


def double_integrator(*, elements: int = 50, most: float = 5.0) -> WrittenModel:
    """Return how to push a mass from rest to rest, a length of 1 in a time of 1, with least effort.

    Without a bound the force falls evenly from 6 to -6; it is at most `most`, and less than 4 will
    not do. Source: A. E. Bryson and Y.-C. Ho, *Applied Optimal Control* (1975), section 3.8.
    """
    if not 4.0 < most < np.inf:
        raise ValueError(f"expected a bound of more than 4, else it is not reached, found {most!r}")
    count, h = check_elements(elements), 1 / elements
    q, v = ca.SX.sym("q", count - 1), ca.SX.sym("v", count - 1)
    u = ca.SX.sym("u", count)
    places, speeds = ca.vertcat(0, q, 1), ca.vertcat(0, v, 0)
    rows = ca.vertcat(
        speeds[1:] - speeds[:-1] - h * u,
        places[1:] - places[:-1] - h * speeds[:-1] - h**2 / 2 * u,
    )
    middle = (np.arange(count) + 0.5) * h

    def push(slope: float) -> Array:
        return np.clip(slope * (0.5 - middle), -most, most)

    def switching() -> KnownAnswer:
        low, high = 0.0, 1 / np.finfo(float).eps
        for _ in range(MOST_HALVINGS):  # the farther, the steeper
            slope = (low + high) / 2
            short = h * np.sum(push(slope) * (1 - middle)) < 1
            low, high = (slope, high) if short else (low, slope)
        best = push(high)
        speed = h * np.cumsum(best)
        place = np.cumsum(h * np.append(0, speed[:-1]) + h**2 / 2 * best)
        of_speed = high * (0.5 - h * np.arange(1, count + 1))
        lam = np.concatenate([of_speed, np.full(count, high)])
        x = np.concatenate([place[:-1], speed[:-1], best])
        return KnownAnswer(x, lam, "closed form: one number by bisection")

    free = np.full(2 * (count - 1), np.inf)
    bound = np.append(free, np.full(count, most))
    return WrittenModel(
        "double_integrator",
        ca.vertcat(q, v, u),
        h * ca.sumsqr(u) / 2,
        rows,
        bounds=(-bound, bound),
        start=np.zeros(3 * count - 2),
        answer=switching,
        tags=CONTROLLED,
    )


def singular_arc(*, elements: int = 50, distance: float = 0.55) -> WrittenModel:
    """Return how to bring x' = u, |u| <= 1, near zero in a time of 1: least integral of x^2.

    Full speed, and then, without any bound in force, a singular arc. No |x_k| can be less than the
    distance less the time, nor than 0: where all are, the sum is least.
    """
    if not 0 < distance < 1:
        raise ValueError(f"expected a distance between 0 and 1, found {distance!r}")
    count, h = check_elements(elements), 1 / elements
    x, u = ca.SX.sym("x", count), ca.SX.sym("u", count)
    places = ca.vertcat(distance, x)

    def fastest() -> KnownAnswer:
        best = np.maximum(distance - h * np.arange(count + 1), 0)
        lam = -h * np.cumsum(best[:0:-1])[::-1]
        z = np.concatenate([best[1:], np.diff(best) / h])
        return KnownAnswer(z, lam, "closed form: no place can be nearer")

    free = np.full(count, np.inf)
    bound = np.append(free, np.ones(count))
    return WrittenModel(
        "singular_arc",
        ca.vertcat(x, u),
        h * ca.sumsqr(x) / 2,
        places[1:] - places[:-1] - h * u,
        bounds=(-bound, bound),
        start=np.concatenate([np.full(count, distance), np.zeros(count)]),
        answer=fastest,
        tags=(*CONTROLLED, "singular arc"),
    )


def check_elements(elements: int) -> int:
    """Return the number of elements; raises ValueError if there are less than 2, or not whole."""
    if elements != int(elements) or elements < 2:
        raise ValueError(f"expected a whole number of elements, at least 2, found {elements!r}")
    return int(elements)
