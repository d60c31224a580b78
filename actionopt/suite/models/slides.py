"""The quickest slide where it may not fall as deep as it would: a cycloid, the floor, a cycloid."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np

from actionopt.suite.models.fields import MOST_ROUNDS, STEP_OF_ROUND_OFF
from actionopt.suite.models.model import KnownAnswer, WrittenModel
from actionopt.tools.types import Array

CYCLOID_POINTS = 2001  # for a guess


def slide_above_floor(
    *, elements: int = 40, width: float = 4.0, floor: float = 1.2
) -> WrittenModel:
    """Return the slide of least time from (0, 0) to (width, -1) under gravity 1, above a floor.

    It is straight in pieces of equal width, between the straight slide and a `floor` at this depth.
    Unknowns are the speeds v at its corners, where the depth is v^2/2. A piece of width h takes

        |(h / mean of v, change of v)|,

    a norm that grows with each of two convex functions: f is convex, and it is the time of that
    slide, to the last digit. `least_time` is what it falls to on finer meshes.

    Source: J. L. Troutman, *Variational Calculus and Optimal Control* (1996), chapter 3.
    """
    if elements != int(elements) or elements < 2:
        raise ValueError(f"expected a whole number of elements, at least 2, found {elements!r}")
    quickest = continuous_speeds(width, floor)
    count, h, fastest = int(elements), width / elements, np.sqrt(2 * floor)
    v = ca.SX.sym("v", count - 1)
    speeds = ca.vertcat(0, v, np.sqrt(2))
    change, mean = speeds[1:] - speeds[:-1], (speeds[1:] + speeds[:-1]) / 2
    f = ca.sum1(ca.sqrt((h / mean) ** 2 + change**2))
    straight = np.sqrt(2 * np.arange(1, count) / count)

    def newton() -> KnownAnswer:
        found = quickest(h * np.arange(1, count))
        for _ in range(MOST_ROUNDS):
            g, H = slide.slope_and_curvature(found)
            free = np.flatnonzero((found < fastest) | (np.array(g).ravel() > 0)).tolist()
            step = np.zeros(count - 1)
            if free:
                step[free] = -np.array(ca.solve(H[free, free], g[free], "ldl")).ravel()
            there = np.minimum(found + step, fastest)
            found, moved = there, np.max(np.abs(there - found))
            if moved <= STEP_OF_ROUND_OFF:
                how = "high precision: Newton's method, f is convex"
                return KnownAnswer(found, np.zeros(0), how)
        raise ValueError(f"expected elements that tell the slide, found {count}; use fewer")

    slide = WrittenModel(
        "slide_above_floor",
        v,
        f,
        bounds=(straight, fastest),
        start=straight,
        answer=newton,
        tags=("bounds on coordinates",),
    )
    return slide


def continuous_speeds(width: float, floor: float) -> Callable[[Array], Array]:
    """Return the speeds at x, (k,), of the quickest slide of all: a cycloid, the floor, a cycloid.

    Raises ValueError if the floor is above the end, or so deep that the slide does not touch it.
    """
    radius, up, along = _wheel(width, floor)
    turns = np.linspace(0, np.pi, CYCLOID_POINTS)
    down = radius * (turns - np.sin(turns))

    def speeds(x: Array) -> Array:
        to_end = radius * (up - np.sin(up)) + width - x
        turn = np.interp(np.minimum(x, to_end), down, turns)
        return np.sqrt(2 * radius * (1 - np.cos(turn)))

    return speeds


def least_time(width: float = 4.0, floor: float = 1.2) -> float:
    """Return how long the quickest slide of all takes.

    Raises ValueError as `continuous_speeds`.
    """
    radius, up, along = _wheel(width, floor)
    return float((2 * np.pi - up) * np.sqrt(radius) + along / np.sqrt(2 * floor))


def _wheel(width: float, floor: float) -> tuple[float, float, float]:
    """Return the wheel's radius, its turn where the slide ends, and the length on the floor."""
    if not (0 < width < np.inf and 1 <= floor < np.inf):
        raise ValueError(
            f"expected a positive width and a floor at a depth of at least 1, where the slide "
            f"ends, found {width!r} and {floor!r}"
        )
    radius = floor / 2
    up = np.arccos(1 - 1 / radius)
    along = width - radius * (2 * np.pi - up + np.sin(up))
    if not along >= 0:
        raise ValueError(
            f"expected a slide that touches its floor, found a width of {width!r}, too small by "
            f"{-along:.3g} for a depth of {floor!r}"
        )
    return radius, float(up), float(along)
