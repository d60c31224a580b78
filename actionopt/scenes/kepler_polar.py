"""The Kepler ellipse in polar coordinates.

            o  r, phi
          .'
        *'____ perihelion

The azimuth phi does not appear in L: its momentum, the angular momentum, is constant.
"""

from dataclasses import replace

import numpy as np

from actionopt.scenes import kepler
from actionopt.scenes._scene import Words, curve, like
from actionopt.scenes._shapes import body, ground

TITLE = "Kepler ellipse in polar coordinates"
SOURCE = (
    "Competitive Physics: Mechanics and Waves (2018), sections 12.3.1 and 12.5, pp. 628 and 642"
)
WORDS = Words(
    question="What is gained by writing the planet's motion in polar coordinates?",
    answer="The azimuth is missing from L, and so the angular momentum is seen to be conserved.",
    look="The film is that of the Cartesian scene: the path does not depend on the coordinates.",
    captions={
        "motion": (
            "The same ellipse and the same places at the same times as in Cartesian coordinates."
        ),
        "path": (
            "The distance grows all the way from perihelion; the azimuth grows fast, then slowly."
        ),
        "conserved": (
            "The momentum of the azimuth is the angular momentum, conserved; that of the "
            "distance is not."
        ),
    },
    beside=("kepler", "kepler_spherical"),
)


def lagrangian(q, v, t, *, mu):
    """L = (r'^2 + r^2 phi'^2) / 2 + mu / r, for unit mass."""
    r, _ = q
    u, w = v
    return (u**2 + r**2 * w**2) / 2 + mu / r


@like(kepler)
def scene(twin, *, mu, a, eccentricity, start):
    """Follow the ellipse of the scene `kepler`, with the same parameters."""
    orbit = kepler.Ellipse(mu, a, eccentricity, start)
    return replace(
        twin,
        coordinates=["r", "phi"],
        draw=lambda q, t: [
            ground((0.0, 0.0)),
            body((q[0] * np.cos(q[1]), q[0] * np.sin(q[1]))),
        ],
        exact=curve(orbit.polar),
        facts=replace(
            twin.facts,
            morse_index=None,
            velocity=curve(orbit.polar_velocity),
            acceleration=lambda q, v, t: np.stack(
                [q[0] * v[1] ** 2 - mu / q[0] ** 2, -2 * v[0] * v[1] / q[0]]
            ),
            conserved={
                "energy": lambda q, v, t: (v[0] ** 2 + (q[0] * v[1]) ** 2) / 2 - mu / q[0],
                "angular momentum": lambda q, v, t: q[0] ** 2 * v[1],
            },
        ),
    )
