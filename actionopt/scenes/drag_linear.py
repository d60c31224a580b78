"""A projectile in a viscous fluid.

    y |      . o
      |   .       .
      | o           o         drag force -b v
      +------------------ x

Gravity g points downward; the drag enters as virtual work.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np

from actionopt.mechanics.problem import Event, Problem
from actionopt.mechanics.system import System
from actionopt.scenes._scene import Scene, curve, defaults
from actionopt.scenes._shapes import body, ground
from actionopt.scenes.projectile import lagrangian

TITLE = "projectile with linear drag"
SOURCE = "Competitive Physics: Mechanics and Waves (2018), section 12.3, eq. (12.3), p. 627"


def force(q, v, t, *, b):
    """Q = -b v."""
    vx, vy = v
    return [-b * vx, -b * vy]


@cache
def system() -> System:
    """Return the system, derived once."""
    return System(
        lagrangian,
        ["x", "y"],
        parameters=defaults(scene, "m", "g", "b"),
        force=force,
        name="drag_linear",
    )


def scene(
    *,
    m: float = 1.0,
    g: float = 9.81,
    b: float = 0.5,
    start: Sequence[float] = (0.0, 0.0),
    end: Sequence[float] = (3.0, 1.0),
    duration: float = 1.0,
) -> Scene:
    """Throw from `start` to `end` (m) in `duration` (s) against the drag b (kg/s)."""
    T, c = duration, b / m
    x0, y0 = start
    ux = (end[0] - x0) / -np.expm1(-c * T)
    uy = (end[1] - y0 + g * T / c) / -np.expm1(-c * T)
    return Scene(
        Problem(system(), Event(0.0, start), Event(T, end), parameters={"m": m, "g": g, "b": b}),
        TITLE,
        SOURCE,
        draw=lambda q, t: [ground(start), ground(end), body(q)],
        exact=curve(lambda t: (x0 - ux * np.expm1(-c * t), y0 - uy * np.expm1(-c * t) - g * t / c)),
        facts={
            "velocity": curve(lambda t: (c * ux * np.exp(-c * t), c * uy * np.exp(-c * t) - g / c)),
            "acceleration": lambda q, v, t: np.stack([-c * v[0], -c * v[1] - g]),
            "conserved": {
                "m x' + b x": lambda q, v, t: m * v[0] + b * q[0],
                "m y' + b y + m g t": lambda q, v, t: m * v[1] + b * q[1] + m * g * t,
            },
        },
    )
