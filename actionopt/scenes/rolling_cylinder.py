r"""A cylinder rolling straight down a slope.

    ( o )_              x: distance down the slope
   ------  `-_          phi: angle turned, x = R phi
               `-_
   angle of slope  `

Rolling along one line integrates to a condition on positions; friction is its multiplier.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from actionopt.mechanics.problem import Event, Problem
from actionopt.mechanics.system import System
from actionopt.scenes._scene import Scene, curve, defaults
from actionopt.scenes._shapes import body, circle, ground, rod

TITLE = "cylinder rolling down a slope without slipping"
SOURCE = "Competitive Physics: Mechanics and Waves (2018), section 12.4, p. 634"


def lagrangian(q, v, t, *, m, R, inertia, angle, g):
    """L = m x'^2 / 2 + I phi'^2 / 2 + m g x sin(angle), with I = inertia m R^2."""
    x, _ = q
    u, w = v
    return m * (u**2 + inertia * (R * w) ** 2) / 2 + m * g * x * np.sin(angle)


def constraint(q, t, *, R):
    """Hold f = x - R phi = 0."""
    x, phi = q
    return x - R * phi


@cache
def system() -> System:
    """Return the system, derived once."""
    return System(
        lagrangian,
        ["x", "phi"],
        parameters=defaults(scene, "m", "R", "inertia", "angle", "g"),
        constraint=constraint,
        name="rolling_cylinder",
    )


def scene(
    *,
    m: float = 1.0,
    R: float = 0.2,
    inertia: float = 0.5,
    angle: float = 0.3,
    g: float = 9.81,
    start: float = 0.0,
    end: float = 1.0,
    duration: float = 1.2,
) -> Scene:
    """Roll from `start` to `end` (m) in `duration` (s); moment of inertia `inertia` m R^2.

    The facts have the uniform `rolling_acceleration` (m/s^2) and the `friction` (N), which is
    the multiplier: negative, up the slope.
    """
    a = g * np.sin(angle) / (1 + inertia)
    u = (end - start) / duration - a * duration / 2

    def energy(q, v, t):
        return m * (v[0] ** 2 + inertia * (R * v[1]) ** 2) / 2 - m * g * q[0] * np.sin(angle)

    def draw(q, t):
        c, s = np.cos(angle), np.sin(angle)
        center = q[0] * np.array([c, -s])
        spoke = R * np.array([np.sin(q[1]), np.cos(q[1])])
        foot = -R * np.array([s, c])
        far = 1.2 * max(abs(start), abs(end)) * np.array([c, -s])
        slope = ground(foot - far / 4, foot + far)
        rim = rod(*circle(R, center).points.T)
        return [slope, rim, rod(center - spoke, center + spoke), body(center)]

    return Scene(
        Problem(
            system(),
            Event(0.0, [start, start / R]),
            Event(duration, [end, end / R]),
            parameters={"m": m, "R": R, "inertia": inertia, "angle": angle, "g": g},
        ),
        TITLE,
        SOURCE,
        draw=draw,
        exact=curve(
            lambda t: (
                start + u * t + a * t**2 / 2,
                (start + u * t + a * t**2 / 2) / R,
            )
        ),
        facts={
            "velocity": curve(lambda t: (u + a * t, (u + a * t) / R)),
            "acceleration": lambda q, v, t: np.stack([a + 0 * v[0], a / R + 0 * v[0]]),
            "multipliers": lambda q, v, t: (-m * inertia * a + 0 * v[0])[None],
            "morse_index": 0,
            "rolling_acceleration": a,
            "friction": -m * inertia * a,
            "conserved": {"energy": energy},
        },
    )
