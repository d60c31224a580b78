r"""A mass on a spring with a harmonic drive.

    |
    |/\/\/\/\/[ m ]   -> m B cos(w t)
    |           |--> x

The spring on an oscillating wall once more: total time derivatives dropped, B = A w^2.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from actionopt.mechanics.problem import Event, Problem
from actionopt.mechanics.system import System
from actionopt.scenes import oscillating_wall
from actionopt.scenes._scene import Scene, defaults
from actionopt.scenes.oscillator import draw

TITLE = "driven oscillator: the oscillating wall without total derivatives"
SOURCE = "Competitive Physics: Mechanics and Waves (2018), section 12.3.2, p. 633"


def lagrangian(q, v, t, *, m, k, A, w):
    """L = m x'^2 / 2 - k x^2 / 2 + m A w^2 x cos(w t)."""
    return m * v[0] ** 2 / 2 - k * q[0] ** 2 / 2 + m * A * w**2 * q[0] * np.cos(w * t)


@cache
def system() -> System:
    """Return the system, derived once."""
    return System(
        lagrangian,
        ["x"],
        parameters=defaults(scene, "m", "k", "A", "w"),
        name="driven_oscillator",
    )


def scene(
    *,
    m: float = 1.0,
    k: float = 4.0,
    A: float = 0.3,
    w: float = 3.0,
    start: float = 0.5,
    end: float = -0.2,
    duration: float = 1.2,
) -> Scene:
    """Follow the path of the scene `oscillating_wall`, with the same parameters."""
    twin = oscillating_wall.scene(m=m, k=k, A=A, w=w, start=start, end=end, duration=duration)
    kept = ("velocity", "acceleration", "conjugate_times", "morse_index")

    def gauge(q, t):
        square = (t / 2 - np.sin(2 * w * t) / (4 * w)) * m * (A * w) ** 2 / 2
        return m * A * w * q[0] * np.sin(w * t) - square

    return Scene(
        Problem(
            system(),
            Event(0.0, [start]),
            Event(duration, [end]),
            parameters={"m": m, "k": k, "A": A, "w": w},
        ),
        TITLE,
        SOURCE,
        draw=lambda q, t: draw(q[0], max(abs(start), abs(end))),
        exact=twin.exact,
        facts={
            **{name: twin.facts[name] for name in kept},
            "twin": "oscillating_wall",
            "gauge": gauge,
        },
    )
