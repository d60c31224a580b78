r"""Balls on a table of two half circles and two straight sides.

           .---------.
          (    o      )      half circles of radius R at x = a and x = -a
           '---------'

Nothing but the energy is kept: two balls that start beside each other part, by a factor that grows
with every reflection, and in the end one of them goes everywhere (Bunimovich). The way back from a
given end is therefore hard to guess, and found from rough places of reflection.
"""

from __future__ import annotations

import numpy as np

from actionopt.mechanics.question.events import Bounce
from actionopt.scenes._legs import billiard, rays, rough, to_conic
from actionopt.scenes._scene import Facts, Setup, Words
from actionopt.scenes._shapes import Shape, body
from actionopt.scenes.billiard_circle import lagrangian

__all__ = ["SOURCE", "TITLE", "WORDS", "lagrangian", "scene"]

TITLE = "a ball on a table like a stadium"
SOURCE = "Bunimovich, Communications in Mathematical Physics 65 (1979) 295-312"
WORDS = Words(
    question="What becomes of a ball on a round table that is cut in two and drawn apart?",
    answer="Its energy is all that is kept: the angular momentum changes at every reflection.",
    look="No two chords are as long, or pass the middle at the same distance.",
    captions={"conserved": "The size of the momentum is kept, and no component of it."},
    beside=("billiard_circle", "billiard_ellipse"),
)


def scene(*, m=1.0, R=1.0, a=1.0, start=(-1.0, -0.2), angle=0.8, last=0.7, bounces=4, duration=8.0):
    """Send a ball of mass `m` (kg) from `start` at an `angle` (rad) on a table of length 2 (a + R).

    It is reflected `bounces` times, and the path ends a distance `last` (m) behind. The facts have
    by how much larger an error of the first angle is behind the last reflection, `spread` (m).
    """
    to_circle, _ = to_conic((R, R))

    def hit(p, d):
        with np.errstate(divide="ignore"):
            side = (np.copysign(R, d[1]) - p[1]) / d[1]
        if abs(p[0] + side * d[0]) <= a:
            return side
        end = np.copysign(a, p[0] + side * d[0])  # beyond it the line leaves between the sides
        return to_circle(p - (end, 0.0), d)

    def normal(p):
        return np.array([np.copysign(max(abs(p[0]) - a, 0.0), p[0]), p[1]])

    def play(angle):
        return billiard(start, angle, last, bounces, hit, normal)

    points = play(angle)
    exact, facts = rays(points, duration, np.sqrt(m))
    turn = np.linspace(-np.pi / 2, np.pi / 2, 61)
    half = np.stack([a + R * np.cos(turn), R * np.sin(turn)])
    rim = np.concatenate([half, -half, half[:, :1]], axis=1)
    wall = Bounce(lambda q, t: 1 - (q[1] ** 2 + np.maximum(np.abs(q[0]) - a, 0) ** 2) / R**2)
    h = 1e-6
    spread = np.linalg.norm(play(angle + h)[-1] - play(angle - h)[-1]) / (2 * h)
    return Setup(
        ["x", "y"],
        duration,
        draw=lambda q, t: [Shape("ground", rim), body(q)],
        exact=exact,
        guess=rough(points),
        through=[wall] * bounces,
        facts=Facts(
            **facts,
            conserved={"energy": lambda q, v, t: m * (v[0] ** 2 + v[1] ** 2) / 2},
            numbers={"spread": float(spread)},
        ),
    )
