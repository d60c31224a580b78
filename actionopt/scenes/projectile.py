"""A projectile without air.

    y |      . o .
      |   .         .
      | o             o
      +------------------ x

Gravity g points downward; there is no air.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np

from actionopt.mechanics.problem import Event, Problem
from actionopt.mechanics.system import System
from actionopt.scenes._scene import Scene, curve, defaults
from actionopt.scenes._shapes import body, ground

TITLE = "projectile in uniform gravity"
SOURCE = "Competitive Physics: Mechanics and Waves (2018), section 12.3, eq. (12.3), p. 627"


def lagrangian(q, v, t, *, m, g):
    """L = T - V = m (x'^2 + y'^2) / 2 - m g y."""
    _, y = q
    vx, vy = v
    return m * (vx**2 + vy**2) / 2 - m * g * y


@cache
def system() -> System:
    """Return the system, derived once."""
    return System(lagrangian, ["x", "y"], parameters=defaults(scene, "m", "g"), name="projectile")


def scene(
    *,
    m: float = 1.0,
    g: float = 9.81,
    start: Sequence[float] = (0.0, 0.0),
    end: Sequence[float] = (3.0, 1.0),
    duration: float = 1.0,
) -> Scene:
    """Throw a mass m (kg) from `start` to `end` (m) in `duration` (s), with g in m/s^2."""
    (x0, y0), (x1, y1), T = start, end, duration
    ux, uy = (x1 - x0) / T, (y1 - y0) / T
    return Scene(
        Problem(system(), Event(0.0, start), Event(T, end), parameters={"m": m, "g": g}),
        TITLE,
        SOURCE,
        draw=lambda q, t: [ground(start), ground(end), body(q)],
        exact=curve(lambda t: (x0 + ux * t, y0 + uy * t + g * t * (T - t) / 2)),
        facts={
            "velocity": curve(lambda t: (ux, uy + g * (T / 2 - t))),
            "acceleration": lambda q, v, t: np.stack([0 * v[0], 0 * v[1] - g]),
            "action": m * T * ((ux**2 + uy**2) / 2 - g * (y0 + y1) / 2 - g**2 * T**2 / 24),
            "energy": m * (ux**2 + (uy + g * T / 2) ** 2) / 2 + m * g * y0,
            "morse_index": 0,
            "conserved": {
                "horizontal momentum": lambda q, v, t: m * v[0],
                "energy": lambda q, v, t: m * (v[0] ** 2 + v[1] ** 2) / 2 + m * g * q[1],
            },
        },
    )
