r"""A free particle seen from a turning table.

    Y \      . o  / X         the axes X, Y turn anticlockwise at w
       \  .      /
        *       /  wt         at rest the path is straight
          `----*------ x

Coriolis and centrifugal forces alone bend the path in the turning coordinates.
"""

import numpy as np

from actionopt.scenes._scene import Facts, Setup, Words
from actionopt.scenes._shapes import body
from actionopt.scenes.rotating_frame_bound import axes, rotate, turned_curves

TITLE = "free particle in a rotating frame"
SOURCE = "Competitive Physics: Mechanics and Waves (2018), section 12.3.1, pp. 631-633"
WORDS = Words(
    question="Nothing acts on a particle, and on a turning table its path is bent. Why?",
    answer="Because the axes turn: the velocity that stays is the one seen at rest.",
    look="Seen at rest the particle moves straight on; its trail is a straight line.",
    captions={
        "motion": (
            "A straight path at constant speed, drawn from outside; on the table it is a curve."
        ),
        "path": "The coordinates on the table bend although no force acts.",
        "conserved": (
            "H is conserved here; p is m times the velocity at rest, seen along axes that turn, "
            "and so not conserved."
        ),
    },
    beside=("rotating_frame_bound", "projectile"),
)


def lagrangian(q, v, t, *, m, w):
    """L = m (X'^2 + Y'^2 + 2 w (X Y' - X' Y) + w^2 (X^2 + Y^2)) / 2."""
    X, Y = q
    U, V = v
    return m * (U**2 + V**2 + 2 * w * (X * V - U * Y) + w**2 * (X**2 + Y**2)) / 2


def scene(*, m=1.0, w=0.8, start=(1.0, 0.0), end=(-0.5, 0.7), duration=1.5):
    """Join two points (X, Y) (m) of a frame turning at w (rad/s) in `duration` (s)."""
    exact, velocity = turned_curves(0.0, w, start, end, duration)
    distance = float(np.linalg.norm(rotate(end, w * duration) - np.asarray(start)))

    def acceleration(q, v, t):  # a_rot = -2 w x v_rot - w x (w x r)
        return 2 * w * np.stack([v[1], -v[0]]) + w**2 * q

    return Setup(
        ["X", "Y"],
        duration,
        ends=(start, end),
        draw=lambda q, t: [
            *axes(w * t, 1.2 * float(np.linalg.norm(start))),
            body(rotate(q, w * t)),
        ],
        kinetic=lambda q, v, t: m * ((v[0] - w * q[1]) ** 2 + (v[1] + w * q[0]) ** 2) / 2,
        exact=exact,
        facts=Facts(
            velocity=velocity,
            acceleration=acceleration,
            action=m * distance**2 / (2 * duration),
            morse_index=0,
            conserved={
                "angular momentum": lambda q, v, t: (
                    m * (q[0] * v[1] - q[1] * v[0] + w * (q[0] ** 2 + q[1] ** 2))
                ),
                "kinetic energy at rest": lambda q, v, t: (
                    m * ((v[0] - w * q[1]) ** 2 + (v[1] + w * q[0]) ** 2) / 2
                ),
            },
        ),
    )
