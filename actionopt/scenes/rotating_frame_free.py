r"""A free particle seen from a turning table.

    Y \      . o  / X         the axes X, Y turn anticlockwise at w
       \  .      /
        *       /  wt         at rest the path is straight
          `----*------ x

Coriolis and centrifugal forces alone bend the path in the turning coordinates.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np

from actionopt.mechanics.problem import Event, Problem
from actionopt.mechanics.system import System
from actionopt.scenes._scene import Scene, defaults
from actionopt.scenes._shapes import body
from actionopt.scenes.rotating_frame_bound import axes, rotate, turned

TITLE = "free particle in a rotating frame"
SOURCE = "Competitive Physics: Mechanics and Waves (2018), section 12.3.1, pp. 631-633"


def lagrangian(q, v, t, *, m, w):
    """L = m (X'^2 + Y'^2 + 2 w (X Y' - X' Y) + w^2 (X^2 + Y^2)) / 2."""
    X, Y = q
    U, V = v
    return m * (U**2 + V**2 + 2 * w * (X * V - U * Y) + w**2 * (X**2 + Y**2)) / 2


@cache
def system() -> System:
    """Return the system, derived once."""
    return System(
        lagrangian, ["X", "Y"], parameters=defaults(scene, "m", "w"), name="rotating_frame_free"
    )


def scene(
    *,
    m: float = 1.0,
    w: float = 0.8,
    start: Sequence[float] = (1.0, 0.0),
    end: Sequence[float] = (-0.5, 0.7),
    duration: float = 1.5,
) -> Scene:
    """Join two points (X, Y) (m) of a frame turning at w (rad/s) in `duration` (s)."""
    exact, velocity = turned(0.0, w, start, end, duration)
    distance = np.linalg.norm(rotate(end, w * duration) - np.asarray(start))

    def acceleration(q, v, t):  # a_rot = -2 w x v_rot - w x (w x r)
        return 2 * w * np.stack([v[1], -v[0]]) + w**2 * q

    return Scene(
        Problem(system(), Event(0.0, start), Event(duration, end), parameters={"m": m, "w": w}),
        TITLE,
        SOURCE,
        draw=lambda q, t: [
            *axes(w * t, 1.2 * float(np.linalg.norm(start))),
            body(rotate(q, w * t)),
        ],
        exact=exact,
        facts={
            "velocity": velocity,
            "acceleration": acceleration,
            "action": m * distance**2 / (2 * duration),
            "morse_index": 0,
            "conserved": {
                "angular momentum": lambda q, v, t: (
                    m * (q[0] * v[1] - q[1] * v[0] + w * (q[0] ** 2 + q[1] ** 2))
                ),
                "kinetic energy at rest": lambda q, v, t: (
                    m * ((v[0] - w * q[1]) ** 2 + (v[1] + w * q[0]) ** 2) / 2
                ),
            },
        },
    )
