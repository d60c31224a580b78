r"""The plane pendulum in polar coordinates, its length held by a multiplier.

        -----+-----
             |\
             | \  r = l
             |  \
        theta    o  m

Gravity g points downward; the multiplier is the tension, negative because it points inward.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from actionopt.mechanics.problem import Event, Problem
from actionopt.mechanics.system import System
from actionopt.scenes import pendulum
from actionopt.scenes._scene import Scene, curve, defaults

TITLE = "plane pendulum in polar coordinates, with the tension as multiplier"
SOURCE = "Competitive Physics: Mechanics and Waves (2018), section 12.4, p. 640"


def lagrangian(q, v, t, *, m, g):
    """L = m (r'^2 + r^2 theta'^2) / 2 + m g r cos theta."""
    r, theta = q
    u, w = v
    return m * (u**2 + (r * w) ** 2) / 2 + m * g * r * np.cos(theta)


def constraint(q, t, *, l):
    """Hold f = r - l = 0."""
    return q[0] - l


@cache
def system() -> System:
    """Return the system, derived once."""
    return System(
        lagrangian,
        ["r", "theta"],
        parameters=defaults(scene, "m", "l", "g"),
        constraint=constraint,
        name="polar_pendulum",
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
    """Swing as in the scene `pendulum`, with the same parameters."""
    twin = pendulum.scene(m=m, l=l, g=g, amplitude=amplitude, since=since, duration=duration)
    theta, rate = pendulum.motion(g / l, amplitude, since)
    exact = curve(lambda t: (l + 0 * t, theta(t)))

    def tension(q, v, t):
        return -(m * l * v[1] ** 2 + m * g * np.cos(q[1]))[None]

    def energy(q, v, t):
        return m * (v[0] ** 2 + (q[0] * v[1]) ** 2) / 2 - m * g * q[0] * np.cos(q[1])

    return Scene(
        Problem(
            system(),
            Event(0.0, exact(0.0)),
            Event(duration, exact(duration)),
            parameters={"m": m, "l": l, "g": g},
        ),
        TITLE,
        SOURCE,
        draw=lambda q, t: pendulum.draw(*q),
        exact=exact,
        facts={
            **{name: twin.facts[name] for name in ("action", "energy", "period")},
            "velocity": curve(lambda t: (0 * t, rate(t))),
            "multipliers": tension,
            "conserved": {"energy": energy},
        },
    )
