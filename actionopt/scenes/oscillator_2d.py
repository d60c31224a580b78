r"""A particle bound to a centre by equal springs in every direction of the plane.

    y |    . o
      |  .   | k r
      | .    v
      *------------ x

Its paths are ellipses about the centre.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np

from actionopt.mechanics.problem import Event, Problem
from actionopt.mechanics.system import System
from actionopt.scenes._scene import Scene, defaults
from actionopt.scenes._shapes import body, ground, spring
from actionopt.scenes.rotating_frame_bound import turned

TITLE = "two-dimensional oscillator"
SOURCE = "Competitive Physics: Mechanics and Waves (2018), section 12.5.4, p. 646"


def lagrangian(q, v, t, *, m, k):
    """L = m (x'^2 + y'^2) / 2 - k (x^2 + y^2) / 2."""
    x, y = q
    vx, vy = v
    return m * (vx**2 + vy**2) / 2 - k * (x**2 + y**2) / 2


@cache
def system() -> System:
    """Return the system, derived once."""
    return System(
        lagrangian, ["x", "y"], parameters=defaults(scene, "m", "k"), name="oscillator_2d"
    )


def scene(
    *,
    m: float = 1.0,
    k: float = 2.0,
    start: Sequence[float] = (1.0, 0.0),
    end: Sequence[float] = (-0.3, 0.6),
    duration: float = 1.5,
) -> Scene:
    """Join two points (m) in `duration` (s).

    Raises ValueError if the duration is a multiple of half the period.
    """
    T, w = duration, float(np.sqrt(k / m))
    c, s = np.cos(w * T), np.sin(w * T)
    if abs(s) < 1e-12:
        raise ValueError(f"expected a duration that is no multiple of {np.pi / w}, found {T}")
    exact, velocity = turned(w, 0.0, start, end, T)
    times = np.pi / w * np.arange(1, 4 + int(w * T / np.pi))
    squares, product = np.dot(start, start) + np.dot(end, end), np.dot(start, end)
    return Scene(
        Problem(system(), Event(0.0, start), Event(T, end), parameters={"m": m, "k": k}),
        TITLE,
        SOURCE,
        draw=lambda q, t: [ground((0.0, 0.0)), spring((0.0, 0.0), q), body(q)],
        exact=exact,
        facts={
            "velocity": velocity,
            "acceleration": lambda q, v, t: -(k / m) * q,
            "action": m * w / (2 * s) * (squares * c - 2 * product),
            "energy": k / 2 * (squares - 2 * product * c) / s**2,
            "conjugate_times": np.repeat(times, 2),
            "morse_index": 2 * int(np.sum(times < T)),
            "conserved": {
                "energy": lambda q, v, t: m * np.sum(v**2, 0) / 2 + k * np.sum(q**2, 0) / 2,
                "angular momentum": lambda q, v, t: m * (q[0] * v[1] - q[1] * v[0]),
            },
        },
    )
