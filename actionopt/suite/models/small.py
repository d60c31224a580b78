"""Small problems, n = 2 to 20: a path of few points, amplitudes, velocities to aim with.

The last knows no derivatives: its objective comes from an integrator, whose tolerance is the noise.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from actionopt.suite.models.black_box import BlackModel
from actionopt.suite.models.integrate import integrate
from actionopt.suite.models.model import KnownAnswer, WrittenModel
from actionopt.tools.types import Array

SNELL_HALVINGS = 200  # halvings: more than the digits of a float
FEW_UNKNOWNS = ("small",)


def brachistochrone(*, points: int = 6, width: float = 1.5) -> WrittenModel:
    """Return the way of least time from (0, 0) to (width, -1) under gravity 1, straight in layers.

    Unknowns are where it crosses from one of the equal layers to the next. Snell's law holds: with
    the mean speed s of each layer, sin(angle)/s is one number p, which the width determines.

    Source: J. Bernoulli, Acta Eruditorum (1697), whose layers these are.
    """
    count = _whole(points, "points")
    if not width > 0:
        raise ValueError(f"expected a positive width, found {width!r}")
    depth = np.linspace(0, 1, count + 2)
    speed = np.sqrt(2 * depth)
    mean = (speed[1:] + speed[:-1]) / 2
    x = ca.SX.sym("x", count)
    steps = ca.vertcat(x, width) - ca.vertcat(0, x)
    f = ca.sum1(ca.sqrt(steps**2 + 1 / (count + 1) ** 2) / mean)

    def across(p: float) -> Array:  # of each layer
        sine = p * mean
        return sine / np.sqrt(1 - sine**2) / (count + 1)

    def snell() -> KnownAnswer:
        low, high = 0.0, 1 / mean[-1]
        for _ in range(SNELL_HALVINGS):
            p = (low + high) / 2
            low, high = (p, high) if p < 1 / mean[-1] and across(p).sum() < width else (low, p)
        way = np.cumsum(across(low))
        return KnownAnswer(way[:-1] * width / way[-1], np.zeros(0), "Snell's law, by bisection")

    straight = width * np.arange(1, count + 1) / (count + 1)
    return WrittenModel(
        "brachistochrone", x, f, start=straight, answer=snell, tags=FEW_UNKNOWNS, unit=width
    )


def ritz_oscillator(*, amplitudes: int = 6, duration: float = 3.0) -> WrittenModel:
    """Return Ritz's method for q'' = -q from 1 to 1/2: the amplitudes of sine waves on a line.

    The action is a sum over them; from durations of pi on, it has no least. Raises ValueError then.

    Source: W. Ritz, J. reine angew. Math. 135 (1909), 1-61.
    """
    count = _whole(amplitudes, "amplitudes")
    if not 0 < duration < np.pi:
        raise ValueError(
            f"expected a duration below pi, where the action has a least, found {duration!r}"
        )
    T, k = duration, np.arange(1, count + 1)
    stiff = T / 2 * ((k * np.pi / T) ** 2 - 1)
    pull = -T * (1.0 - (-1.0) ** k * 0.5) / (k * np.pi)
    line = 0.25 / (2 * T) - T / 6 * (1 + 0.5 + 0.25)
    a = ca.SX.sym("a", count)
    f = line + ca.dot(pull, a) + ca.dot(stiff, a**2) / 2

    def diagonal() -> KnownAnswer:
        return KnownAnswer(-pull / stiff, np.zeros(0), "closed form: a diagonal matrix")

    return WrittenModel(
        "ritz_oscillator", a, f, start=np.zeros(count), answer=diagonal, tags=FEW_UNKNOWNS
    )


def shooting(*, masses: int = 4, tolerance: float = 1e-6, duration: float = 1.0) -> BlackModel:
    """Return how to throw masses on a chain of springs so that they come to given places.

    Unknowns are their velocities at the beginning; f is half the square of how far they miss. The
    motion is integrated with steps of a `tolerance`, and f is not smooth below it.
    """
    count = _whole(masses, "masses")
    if not 1e-14 <= tolerance < 1:
        raise ValueError(f"expected a tolerance of 1e-14 to 1, found {tolerance!r}")
    if not 0 < duration <= 1.5:
        raise ValueError(
            f"expected a duration of at most 1.5, half a period of the fastest mode being longer, "
            f"found {duration!r}"
        )
    springs = 2 * np.eye(count) - np.eye(count, k=1) - np.eye(count, k=-1)
    target = np.cos(np.arange(count))

    def end(v: Array) -> Array:
        def rate(y: Array) -> Array:
            return np.concatenate([y[count:], -springs @ y[:count]])

        return integrate(rate, np.concatenate([np.zeros(count), v]), duration, tolerance)[:count]

    def miss(v: Array) -> float:
        return float(np.sum((end(v) - target) ** 2)) / 2

    def modes() -> KnownAnswer:
        squares, shapes = np.linalg.eigh(springs)
        w = np.sqrt(squares)
        best = shapes @ (w / np.sin(w * duration) * (shapes.T @ target))
        return KnownAnswer(best, np.zeros(0), "closed form: normal modes")

    return BlackModel(
        "shooting",
        miss,
        start=np.zeros(count),
        answer=modes,
        tags=(*FEW_UNKNOWNS, "noise"),
        f_star=0.0,
    )


def _whole(count: int, what: str) -> int:
    if count != int(count) or not 2 <= count <= 20:
        raise ValueError(f"expected 2 to 20 {what}, found {count!r}")
    return int(count)
