r"""A ball on a round table.

            .-'''-.
          .'*------'.
          | \  o /  |      x, y from the middle
           '.\ /  .'
             '-.-'

At the wall its velocity is reflected, along the radius alone: its angular momentum is always the
same, and all chords between two reflections are as long as one another. Where and when it meets the
wall is not given but found, with a rough guess of the places.
"""

from __future__ import annotations

import numpy as np

from actionopt.mechanics.question.events import Bounce
from actionopt.scenes._legs import about, billiard, rays, rough, to_conic
from actionopt.scenes._scene import Facts, Setup, Words
from actionopt.scenes._shapes import body, circle

TITLE = "a ball on a round table"
SOURCE = "Tabachnikov, Geometry and Billiards (2005), chapter 2"
WORDS = Words(
    question="How does a ball go on a round table, reflected again and again?",
    answer="All its chords are as long, and touch one smaller circle.",
    look="It keeps the same distance from the middle, chord after chord.",
    captions={"conserved": "Neither component of the momentum lasts; the angular momentum does."},
    beside=("billiard_ellipse", "billiard_stadium"),
)


def lagrangian(q, v, t, *, m):
    """L = m (x'^2 + y'^2) / 2."""
    return m * (v @ v) / 2


def scene(*, m=1.0, R=1.0, start=(-0.6, 0.2), angle=0.5, last=0.7, bounces=4, duration=4.0):
    """Send a ball of mass `m` (kg) from `start` (m) at an `angle` (rad) on a table of radius `R`.

    It is reflected `bounces` times, and the path ends a distance `last` (m) behind. The facts have
    the radius of the circle that its chords touch, `caustic`.
    """
    points = billiard(start, angle, last, bounces, *to_conic((R, R)))
    exact, facts = rays(points, duration, np.sqrt(m))
    moment = about()
    a, b = points[0], points[1]
    wall = Bounce(lambda q, t: 1 - q @ q / R**2)
    return Setup(
        ["x", "y"],
        duration,
        draw=lambda q, t: [circle(R), body(q)],
        exact=exact,
        guess=rough(points),
        through=[wall] * bounces,
        facts=Facts(
            **facts,
            conserved={"angular momentum": lambda q, v, t: m * moment(q, v, t)},
            numbers={"caustic": float(np.abs(moment(a, b - a, 0.0)) / np.linalg.norm(b - a))},
        ),
    )
