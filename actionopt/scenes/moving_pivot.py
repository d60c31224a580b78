r"""A pendulum whose pivot is pulled aside with uniform acceleration.

    --+--> X = a t^2 / 2
      |\
      | \  l
 theta|  \
      |   o  m              gravity g downward

In the frame of the pivot gravity is tilted: the pendulum swings about -arctan(a / g).
"""

from __future__ import annotations

from functools import cache

import numpy as np

from actionopt.mechanics.problem import Event, Problem
from actionopt.mechanics.system import System
from actionopt.scenes import pendulum
from actionopt.scenes._scene import Scene, curve, defaults

TITLE = "pendulum with an accelerated pivot"
SOURCE = (
    "Competitive Physics: Mechanics and Waves (2018), section 12.3.1, eq. (12.4), p. 628; Landau "
    "and Lifshitz, Mechanics (3rd ed. 1976), section 5, problem 3"
)


def lagrangian(q, v, t, *, m, l, g, a):
    """L = m ((a t + l theta' cos theta)^2 + (l theta' sin theta)^2) / 2 + m g l cos theta."""
    theta, u = q[0], v[0]
    vx = a * t + l * u * np.cos(theta)
    vy = l * u * np.sin(theta)
    return m * (vx**2 + vy**2) / 2 + m * g * l * np.cos(theta)


@cache
def system() -> System:
    """Return the system, derived once."""
    return System(
        lagrangian,
        ["theta"],
        parameters=defaults(scene, "m", "l", "g", "a"),
        name="moving_pivot",
    )


def scene(
    *,
    m: float = 1.0,
    l: float = 1.0,
    g: float = 9.81,
    a: float = 3.0,
    amplitude: float = 0.8,
    since: float = 0.1,
    duration: float = 0.9,
) -> Scene:
    """Swing by `amplitude` (rad) about the tilt, from `since` (s) after passing it forward.

    a in m/s^2; the facts have the `tilt` (rad), arctan(a / g).
    """
    tilt, strength = np.arctan2(a, g), np.hypot(a, g)
    swing, rate = pendulum.motion(strength / l, amplitude, since)
    exact = curve(lambda t: [swing(t) - tilt])
    return Scene(
        Problem(
            system(),
            Event(0.0, exact(0.0)),
            Event(duration, exact(duration)),
            parameters={"m": m, "l": l, "g": g, "a": a},
        ),
        TITLE,
        SOURCE,
        draw=lambda q, t: pendulum.draw(l, q[0], (a * t**2 / 2, 0.0)),
        exact=exact,
        facts={
            "velocity": curve(lambda t: [rate(t)]),
            "acceleration": lambda q, v, t: -(g * np.sin(q) + a * np.cos(q)) / l,
            "tilt": tilt,
            "conserved": {
                "energy in tilted gravity": lambda q, v, t: (
                    m * (l * v[0]) ** 2 / 2 - m * l * (g * np.cos(q[0]) - a * np.sin(q[0]))
                ),
            },
        },
    )
