r"""A particle sliding inside a cone that stands on its apex.

    \     |     /
     \    |    o  m          l: distance from the apex
      \   |   / l            phi: azimuth
       \  |  /
        \ | /
         \|/ half-angle      gravity g downward

Without friction; the surface of the cone is built into the coordinates.
"""

import numpy as np

from actionopt.scenes._scene import Facts, Setup, Words, curve
from actionopt.scenes._shapes import body, ground

TITLE = "particle circling inside an inverted cone"
SOURCE = "Competitive Physics: Mechanics and Waves (2018), section 12.4, pp. 636-638"
WORDS = Words(
    question="How fast must a marble circle inside a cone to stay at its height?",
    answer=(
        "Just so fast that the centripetal force is what the wall and gravity leave: the "
        "smaller the circle, the faster the turn."
    ),
    look="The marble stays at one height, without anything holding it there but its speed.",
    captions={
        "motion": "A level circle, seen a little from above, hence the ellipse.",
        "path": "One coordinate stays, the other grows evenly: this is a relative equilibrium.",
        "conserved": (
            "The angular momentum is conserved by symmetry; the other momentum is zero on this "
            "circle only."
        ),
    },
    beside=("hoop_bead", "heavy_top"),
)


def lagrangian(q, v, t, *, m, angle, g):
    """L = m (l'^2 + l^2 sin(angle)^2 phi'^2) / 2 - m g l cos(angle)."""
    l, _ = q
    u, w = v
    return m * (u**2 + (l * np.sin(angle) * w) ** 2) / 2 - m * g * l * np.cos(angle)


def scene(*, m=1.0, angle=0.5, g=9.81, w=4.0, duration=0.7):
    """Circle at w (rad/s) for `duration` (s) in a cone of half-angle `angle` (rad).

    The facts have the distance `circle` = g cos(angle) / (w sin(angle))^2 (m) of the circle
    from the apex, and the frequency `oscillation` = sqrt(3) sin(angle) w (rad/s) of small
    oscillations about it.
    """
    sine, cosine = np.sin(angle), np.cos(angle)
    circle = g * cosine / (w * sine) ** 2

    def acceleration(q, v, t):
        (l, _), (u, z) = q, v
        return np.stack([l * (sine * z) ** 2 - g * cosine, -2 * u * z / l])

    def energy(q, v, t):
        return m * (v[0] ** 2 + (q[0] * sine * v[1]) ** 2) / 2 + m * g * q[0] * cosine

    def place(l, phi):
        return l * sine * np.cos(phi), l * sine * np.sin(phi), l * cosine

    def draw(q, t):
        rim = [place(1.3 * circle, phi) for phi in np.linspace(0, 2 * np.pi, 61)]
        sides = [ground((0.0, 0.0, 0.0), edge) for edge in rim[:-1:10]]
        return [ground(*rim), *sides, body(place(*q))]

    return Setup(
        ["l", "phi"],
        duration,
        draw=draw,
        exact=curve(lambda t: (circle + 0 * t, w * t)),
        facts=Facts(
            velocity=curve(lambda t: (0 * t, w + 0 * t)),
            acceleration=acceleration,
            action=(m * (circle * sine * w) ** 2 / 2 - m * g * circle * cosine) * duration,
            conserved={
                "energy": energy,
                "angular momentum": lambda q, v, t: m * (q[0] * sine) ** 2 * v[1],
            },
            numbers={"circle": circle, "oscillation": np.sqrt(3) * sine * abs(w)},
        ),
    )
