r"""The shortest way from one city to another on a flattened Earth.

          .-'''-.
        .'  .-*  '.       theta, parametric latitude
       (--*--------)      phi, longitude
        '.       .'       half axes a and b
          '-...-'

The coordinate phi does not appear: its momentum is constant, Clairaut's relation.
"""

import numpy as np

from actionopt.scenes._scene import Facts, Setup, Words
from actionopt.scenes._shapes import body, ground

TITLE = "shortest way on a flattened Earth"
SOURCE = (
    "PSOPT, examples/geodesic: 5549.682 km in its documentation; do Carmo, Differential Geometry "
    "of Curves and Surfaces (1976), section 4-4, p. 257"
)
WORDS = Words(
    question="Why does the flight from New York to London pass so far north?",
    answer="The shortest way on a spheroid climbs to higher latitudes than either city.",
    look="The latitude rises above both ends; farther north each degree of longitude is shorter.",
    beside=("fish_eye", "polar_pendulum"),
)


def length(q, v, *, a, b):
    """L is half the square of the length on the ground per unit of the parameter.

    L = ((a^2 sin(theta)^2 + b^2 cos(theta)^2) theta'^2 + a^2 cos(theta)^2 phi'^2) / 2, for unit
    mass.
    """
    theta, _ = q
    u, w = v
    meridian = (a * np.sin(theta)) ** 2 + (b * np.cos(theta)) ** 2
    return np.sqrt(meridian * u**2 + (a * np.cos(theta) * w) ** 2)


def scene(*, a=6384e3, b=6353e3, start=(40.6413, -73.7781), end=(51.47, -0.4543), duration=1.0):
    """Fly from `start` to `end`, parametric latitude and longitude in degrees."""
    parallels = np.linspace(0, 2 * np.pi, 61)

    def place(theta, phi):
        across = a * np.cos(theta)
        height = b * np.sin(theta) + 0 * phi  # of a whole parallel
        return np.stack([across * np.cos(phi + np.pi), across * np.sin(phi + np.pi), height])

    return Setup(
        ["theta", "phi"],
        duration,
        draw=lambda q, t: [
            ground(*(place(0.0, x) for x in parallels)),
            ground(*(place(np.pi / 4, x) for x in parallels)),
            body(place(*q)),
        ],
        ends=(np.radians(start), np.radians(end)),
        facts=Facts(
            conserved={"Clairaut": lambda q, v, t: (a * np.cos(q[0])) ** 2 * v[1]},
        ),
    )
