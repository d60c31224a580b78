"""A body falling through air, towards its terminal speed.

      o      s: depth, downward
      |
      v      drag force -c v |v|, gravity g

The drag enters as virtual work.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from actionopt.mechanics.problem import Event, Problem
from actionopt.mechanics.system import System
from actionopt.scenes._scene import Scene, curve, defaults
from actionopt.scenes._shapes import body, ground

TITLE = "fall with quadratic drag"
SOURCE = "Competitive Physics: Mechanics and Waves (2018), section 12.3, eq. (12.3), p. 627"


def lagrangian(q, v, t, *, m, g):
    """L = m s'^2 / 2 + m g s."""
    return m * v[0] ** 2 / 2 + m * g * q[0]


def force(q, v, t, *, c):
    """Q = -c s' |s'|."""
    return [-c * v[0] * np.abs(v[0])]


@cache
def system() -> System:
    """Return the system, derived once."""
    return System(
        lagrangian,
        ["s"],
        parameters=defaults(scene, "m", "g", "c"),
        force=force,
        name="drag_quadratic",
    )


def scene(
    *,
    m: float = 1.0,
    g: float = 9.81,
    c: float = 0.2,
    since: float = 0.1,
    duration: float = 1.5,
) -> Scene:
    """Fall for `duration` (s) from `since` (s) after being let go; c in kg/m.

    The facts have the `terminal_speed` sqrt(m g / c) (m/s).
    """
    terminal = np.sqrt(m * g / c)
    rate = g / terminal
    exact = curve(lambda t: [m / c * np.log(np.cosh(rate * (t + since)))])
    depth = 1.1 * float(exact(duration)[0])
    return Scene(
        Problem(
            system(),
            Event(0.0, exact(0.0)),
            Event(duration, exact(duration)),
            parameters={"m": m, "g": g, "c": c},
        ),
        TITLE,
        SOURCE,
        draw=lambda q, t: [ground((0.0, 0.0), (0.0, -depth)), body((0.0, -q[0]))],
        exact=exact,
        facts={
            "velocity": curve(lambda t: [terminal * np.tanh(rate * (t + since))]),
            "acceleration": lambda q, v, t: g - c / m * v * np.abs(v),
            "terminal_speed": terminal,
            "conserved": {  # while it falls
                "exp(2 c s / m) (terminal^2 - s'^2)": lambda q, v, t: (
                    np.exp(2 * c * q[0] / m) * (terminal**2 - v[0] ** 2)
                ),
            },
        },
    )
