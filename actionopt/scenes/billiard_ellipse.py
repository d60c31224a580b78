r"""A ball on an elliptic table.

            .--'''''--.
          .'   F1  F2  '.      x, y from the middle, half axes a and b
          '.     o     .'
            '--.....--'

Each chord is reflected as by a mirror, and touches the same conic with the foci of the table: an
ellipse if the ball passes outside of both foci, a hyperbola if it passes between them. The product
of its angular momenta about both foci is the same on all chords (Joachimsthal).
"""

from __future__ import annotations

import numpy as np

from actionopt.mechanics.question.events import Bounce
from actionopt.scenes._legs import about, billiard, rays, rough, to_conic
from actionopt.scenes._scene import Facts, Setup, Words
from actionopt.scenes._shapes import Shape, body, ground
from actionopt.scenes.billiard_circle import lagrangian

__all__ = ["SOURCE", "TITLE", "WORDS", "lagrangian", "scene"]

TITLE = "a ball on an elliptic table"
SOURCE = "Tabachnikov, Geometry and Billiards (2005), chapter 4"
WORDS = Words(
    question="Is anything but its speed kept of a ball on an elliptic table?",
    answer="The product of its angular momenta about both foci is.",
    look="It passes between the foci on every chord, or on none.",
    captions={
        "conserved": "Neither component of the momentum is kept, nor is the product of them."
    },
    beside=("billiard_circle", "billiard_stadium", "heron"),
)


def scene(*, m=1.0, a=2.0, b=1.0, start=(-1.0, -0.2), angle=0.5, last=0.7, bounces=4, duration=8.0):
    """Send a ball of mass `m` (kg) from `start` at an `angle` (rad) on a table of half axes a, b.

    It is reflected `bounces` times, and the path ends a distance `last` (m) behind. The facts have
    the product of the angular momenta about the foci, over m^2 and the speed's square, as
    `joachimsthal` (m^2): above zero where it passes outside of both.

    Raises ValueError unless a > b.
    """
    if not a > b > 0:
        raise ValueError(f"expected half axes a > b > 0, found a = {a} and b = {b}")
    points = billiard(start, angle, last, bounces, *to_conic((a, b)))
    exact, facts = rays(points, duration, np.sqrt(m))
    c = np.sqrt(a * a - b * b)
    foci = [about((x, 0.0)) for x in (-c, c)]
    turn = np.linspace(0, 2 * np.pi, 121)
    rim = np.stack([a * np.cos(turn), b * np.sin(turn)])
    wall = Bounce(lambda q, t: 1 - (q[0] / a) ** 2 - (q[1] / b) ** 2)
    d = (points[1] - points[0]) / np.linalg.norm(points[1] - points[0])
    return Setup(
        ["x", "y"],
        duration,
        draw=lambda q, t: [
            Shape("ground", rim),
            ground((-c, 0.0)),
            ground((c, 0.0)),
            body(q),
        ],
        exact=exact,
        guess=rough(points),
        through=[wall] * bounces,
        facts=Facts(
            **facts,
            conserved={
                "product of the angular momenta about the foci": lambda q, v, t: (
                    m**2 * foci[0](q, v, t) * foci[1](q, v, t)
                )
            },
            numbers={"joachimsthal": float(foci[0](points[0], d, 0) * foci[1](points[0], d, 0))},
        ),
    )
