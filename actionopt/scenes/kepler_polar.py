"""The Kepler ellipse in polar coordinates.

            o  r, phi
          .'
        *'____ perihelion

The azimuth phi does not appear in L: its momentum, the angular momentum, is constant.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from actionopt.mechanics.problem import Event, Problem
from actionopt.mechanics.system import System
from actionopt.scenes import kepler
from actionopt.scenes._scene import Scene, curve, defaults
from actionopt.scenes._shapes import body, ground

TITLE = "Kepler ellipse in polar coordinates"
SOURCE = (
    "Competitive Physics: Mechanics and Waves (2018), sections 12.3.1 and 12.5, pp. 628 and 642"
)


def lagrangian(q, v, t, *, mu):
    """L = (r'^2 + r^2 phi'^2) / 2 + mu / r, for unit mass."""
    r, _ = q
    u, w = v
    return (u**2 + r**2 * w**2) / 2 + mu / r


@cache
def system() -> System:
    """Return the system, derived once."""
    return System(lagrangian, ["r", "phi"], parameters=defaults(scene, "mu"), name="kepler_polar")


def scene(
    *,
    mu: float = 1.0,
    a: float = 1.0,
    eccentricity: float = 0.6,
    start: float = 0.0,
    fraction: float = 0.4,
) -> Scene:
    """Follow the ellipse of the scene `kepler`, with the same parameters."""
    twin = kepler.scene(mu=mu, a=a, eccentricity=eccentricity, start=start, fraction=fraction)
    orbit = kepler.Ellipse(mu, a, eccentricity, start)
    T = twin.problem.duration
    exact = curve(orbit.polar)
    facts = {key: twin.facts[key] for key in ("action", "energy", "period", "conjugate_times")}
    return Scene(
        Problem(system(), Event(0.0, exact(0.0)), Event(T, exact(T)), parameters={"mu": mu}),
        TITLE,
        SOURCE,
        draw=lambda q, t: [
            ground((0.0, 0.0)),
            body((q[0] * np.cos(q[1]), q[0] * np.sin(q[1]))),
        ],
        exact=exact,
        facts={
            **facts,
            "velocity": curve(orbit.polar_velocity),
            "acceleration": lambda q, v, t: np.stack(
                [q[0] * v[1] ** 2 - mu / q[0] ** 2, -2 * v[0] * v[1] / q[0]]
            ),
            "conserved": {
                "energy": lambda q, v, t: (v[0] ** 2 + (q[0] * v[1]) ** 2) / 2 - mu / q[0],
                "angular momentum": lambda q, v, t: q[0] ** 2 * v[1],
            },
        },
    )
