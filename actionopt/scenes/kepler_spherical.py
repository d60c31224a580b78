"""The Kepler ellipse in spherical coordinates, in a plane tilted against the equator.

        z |   o  r, theta from the z axis, phi azimuth
          | .'
          *'------ y
        .'
      x'  perihelion

The plane of the orbit is turned about the x axis.
"""

from dataclasses import replace

import numpy as np

from actionopt.scenes import kepler
from actionopt.scenes._scene import Words, curve, like
from actionopt.scenes._shapes import body, ground

TITLE = "Kepler ellipse in spherical coordinates, in a tilted plane"
SOURCE = "Competitive Physics: Mechanics and Waves (2018), section 12.3.1, eq. (12.5), p. 629"
WORDS = Words(
    question="Does the plane of an orbit need to be known before it is solved for?",
    answer=(
        "No: in spherical coordinates the path finds its own plane, through both places and the "
        "sun."
    ),
    look="The orbit is tilted: the ellipse is the same as in the plane, seen from the side.",
    captions={
        "motion": (
            "The tilted ellipse in space; in the film it can be turned until it is seen edge-on."
        ),
        "path": "Three coordinates change at once, and yet the points lie in a plane.",
        "conserved": (
            "Of the three momenta one is conserved, that of the azimuth: the component of the "
            "angular momentum along z."
        ),
    },
    beside=("kepler", "kepler_polar"),
)


def lagrangian(q, v, t, *, mu):
    """L = (r'^2 + r^2 sin(theta)^2 phi'^2 + r^2 theta'^2) / 2 + mu / r, for unit mass."""
    r, theta, _ = q
    u, w, z = v
    return (u**2 + (r * np.sin(theta) * z) ** 2 + (r * w) ** 2) / 2 + mu / r


@like(kepler)
def scene(twin, *, mu, a, eccentricity, start, inclination=0.7):
    """Follow the ellipse of the scene `kepler`, tilted by the `inclination` (rad, below pi / 2)."""
    orbit = kepler.Ellipse(mu, a, eccentricity, start)
    sine, cosine = np.sin(inclination), np.cos(inclination)

    def position(t):
        r, u = orbit.polar(t)
        lag = np.arctan2(  # u - phi, continuous
            (1 - cosine) * np.sin(u) * np.cos(u), np.cos(u) ** 2 + cosine * np.sin(u) ** 2
        )
        return r, np.arccos(sine * np.sin(u)), u - lag

    def velocity(t):
        (_, u), (radial, angular) = orbit.polar(t), orbit.polar_velocity(t)
        square = 1 - (sine * np.sin(u)) ** 2  # of sin theta
        turn = -sine * np.cos(u) * angular / np.sqrt(square)
        return radial, turn, cosine * angular / square

    def acceleration(q, v, t):
        r, theta, _ = q
        u, w, z = v
        s, c = np.sin(theta), np.cos(theta)
        return np.stack(
            [
                r * (s * z) ** 2 + r * w**2 - mu / r**2,
                s * c * z**2 - 2 * u * w / r,
                -2 * u * z / r - 2 * c / s * z * w,
            ]
        )

    def energy(q, v, t):
        r, theta, _ = q
        return (v[0] ** 2 + (r * np.sin(theta) * v[2]) ** 2 + (r * v[1]) ** 2) / 2 - mu / r

    def draw(q, t):
        r, theta, phi = q
        flat = r * np.sin(theta)
        return [
            ground((0.0, 0.0, 0.0)),
            body((flat * np.cos(phi), flat * np.sin(phi), r * np.cos(theta))),
        ]

    return replace(
        twin,
        coordinates=["r", "theta", "phi"],
        draw=draw,
        exact=curve(position),
        facts=replace(
            twin.facts,
            conjugate_times=None,
            morse_index=None,
            velocity=curve(velocity),
            acceleration=acceleration,
            conserved={
                "energy": energy,
                "angular momentum about z": lambda q, v, t: (q[0] * np.sin(q[1])) ** 2 * v[2],
                "angular momentum, squared": lambda q, v, t: (
                    q[0] ** 4 * (v[1] ** 2 + (np.sin(q[1]) * v[2]) ** 2)
                ),
            },
        ),
    )
