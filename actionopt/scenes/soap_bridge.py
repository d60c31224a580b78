r"""A film of soap round a given volume between two rings.

         .-'''''-.
        |         |
        |         |      radius y, over the axis x
        |         |      rings of radius R at a distance d
         '-.....-'

The air within is given, and presses evenly: of all films round so much air the one of least area
has the same mean curvature everywhere (Delaunay). For one volume it is a part of a sphere; the
pressure is the multiplier. L is half the square of the area per unit of the parameter.
"""

from __future__ import annotations

import numpy as np

from actionopt.scenes._scene import Facts, Measure, Setup, Words, curve
from actionopt.scenes._shapes import body, ground

TITLE = "a film of soap round a given volume"
SOURCE = "Isenberg, The Science of Soap Films and Soap Bubbles (1992), section 4.3; Delaunay (1841)"
WORDS = Words(
    question="Air is blown into a film of soap between two rings. Which shape does it take?",
    answer="One that is curved as much everywhere: for this volume a part of a sphere.",
    look="The film is widest half way between the rings.",
    beside=("catenoid", "dido"),
)


def length(q, v, *, R):
    """L = y^2 (x'^2 + y'^2) / (2 R^2), half the square of a length."""
    return q[1] * np.sqrt(v @ v) / R


def integral(q, v, t):
    """G = y^2 x': the rate at which volume is enclosed, over pi."""
    return q[1] ** 2 * v[0]


def scene(*, R=1.0, d=1.2, duration=1.0):
    """Blow a film between rings of radius `R` at the distance `d` (m) up to a part of a sphere.

    The facts have the radius of the sphere, sqrt(R^2 + d^2 / 4), the `volume` and the `area`.
    """
    half = d / 2
    r = np.sqrt(R**2 + half**2)
    speed = d / duration
    whole = r * d / R
    volume = float(np.pi * (r**2 * d - d**3 / 12))
    kappa = -d / (R**2 * duration)

    def place(t):
        x = speed * t
        return [x, np.sqrt(r**2 - (x - half) ** 2)]

    def velocity(t):
        x, y = place(t)
        return [speed + 0 * x, -speed * (x - half) / y]

    return Setup(
        ["x", "y"],
        duration,
        measure=Measure("area", "m^2", 2 * np.pi * R),
        draw=lambda q, t: [
            ground((0.0, -R), (0.0, R)),
            ground((d, -R), (d, R)),
            body(q),
            body((q[0], -q[1])),
        ],
        ends=((0.0, R), (d, R)),
        exact=curve(place),
        integral=[volume / np.pi],
        facts=Facts(
            velocity=curve(velocity),
            action=float(whole**2 / (2 * duration)),
            energy=float((whole / duration) ** 2 / 2),
            morse_index=0,
            conserved={"energy": lambda q, v, t: (q[1] / R) ** 2 * (v[0] ** 2 + v[1] ** 2) / 2},
            integral_multipliers=[kappa],
            numbers={"radius": float(r), "volume": volume, "area": float(2 * np.pi * r * d)},
        ),
    )
