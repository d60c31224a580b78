r"""The plane pendulum again, in Cartesian coordinates: the rod's tension is a multiplier.

        -----+-----
             |\
             | \  x^2 + y^2 = l^2
             |  \
                 o  m

Gravity g points downward, y upward, and the pivot is the origin.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from actionopt.mechanics.problem import Event, Problem
from actionopt.mechanics.system import System
from actionopt.scenes import pendulum
from actionopt.scenes._scene import Scene, curve, defaults
from actionopt.scenes._shapes import body, ground, rod

TITLE = "plane pendulum in Cartesian coordinates, with the tension of its rod"
SOURCE = "Competitive Physics: Mechanics and Waves (2018), section 12.4, eqs. (12.7)-(12.9), p. 640"


def lagrangian(q, v, t, *, m, g):
    """L = m (x'^2 + y'^2) / 2 - m g y."""
    _, y = q
    vx, vy = v
    return m * (vx**2 + vy**2) / 2 - m * g * y


def constraint(q, t, *, l):
    """Hold f = x^2 + y^2 - l^2 = 0."""
    x, y = q
    return x**2 + y**2 - l**2


@cache
def system() -> System:
    """Return the system, derived once."""
    return System(
        lagrangian,
        ["x", "y"],
        parameters=defaults(scene, "m", "l", "g"),
        constraint=constraint,
        name="rod_pendulum",
    )


def scene(
    *,
    m: float = 1.0,
    l: float = 1.0,
    g: float = 9.81,
    amplitude: float = 0.7916850338091145,
    since: float = 0.12755488176729738,
    duration: float = 1.0,
) -> Scene:
    """Swing as in the scene `pendulum`, with the same parameters.

    The force of constraint is 2 lambda (x, y), so the rod pulls inward with -2 l lambda.
    """
    twin = pendulum.scene(m=m, l=l, g=g, amplitude=amplitude, since=since, duration=duration)
    theta, rate = pendulum.motion(g / l, amplitude, since)
    exact = curve(lambda t: (l * np.sin(theta(t)), -l * np.cos(theta(t))))

    def velocity(t):
        return l * rate(t) * np.cos(theta(t)), l * rate(t) * np.sin(theta(t))

    def tension(q, v):
        return (m * (v[0] ** 2 + v[1] ** 2) - m * g * q[1]) / l

    return Scene(
        Problem(
            system(),
            Event(0.0, exact(0.0)),
            Event(duration, exact(duration)),
            parameters={"m": m, "l": l, "g": g},
        ),
        TITLE,
        SOURCE,
        draw=lambda q, t: [ground((0.0, 0.0)), rod((0.0, 0.0), q), body(q)],
        exact=exact,
        facts={
            "velocity": curve(velocity),
            "multipliers": lambda q, v, t: -tension(q, v)[None] / (2 * l),
            "action": twin.facts["action"],
            "energy": twin.facts["energy"],
            "period": twin.facts["period"],
            "conserved": {"energy": lambda q, v, t: m * (v[0] ** 2 + v[1] ** 2) / 2 + m * g * q[1]},
        },
    )
