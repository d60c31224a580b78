r"""A block sliding down a wedge that is itself free to slide.

       |\
       | \ [m]  s: distance down the slope
       |  \
       | M \
       |_____\  angle         x: the wedge's own displacement
      ~~~~~~~~~~~~~~ no friction

The wedge slides without friction on the ground, as the block does on the wedge.
"""

import numpy as np

from actionopt.scenes._scene import Facts, Setup, Words, curve
from actionopt.scenes._shapes import body, ground, rod

TITLE = "block on a movable wedge"
SOURCE = "Competitive Physics: Mechanics and Waves (2018), section 12.4, p. 636"
WORDS = Words(
    question="A block slides down a wedge that can slide itself. Which way does the wedge go?",
    answer="Opposite to the block, so that the momentum along the ground stays what it was.",
    look=(
        "The block first runs up the slope a little, then down, and the wedge backs away from "
        "under it."
    ),
    captions={
        "motion": "While the block slides down to one side, the wedge slides to the other.",
        "path": "Both coordinates are parabolas: both accelerations are uniform.",
        "conserved": "The momentum of x is conserved: nothing pushes the two along the ground.",
    },
    beside=("rolling_cylinder",),
)


def lagrangian(q, v, t, *, m, M, angle, g):
    """L = (M + m) x'^2 / 2 + m s'^2 / 2 + m x' s' cos(angle) + m g s sin(angle)."""
    _, s = q
    u, w = v
    kinetic = (M + m) * u**2 / 2 + m * w**2 / 2 + m * u * w * np.cos(angle)
    return kinetic + m * g * s * np.sin(angle)


def scene(*, m=1.0, M=2.0, angle=0.5, g=9.81, start=(0.0, 0.0), end=(-0.3, 1.5), duration=0.8):
    """Join two pairs (x, s) (m) in `duration` (s); masses in kg, `angle` of the slope in rad.

    Both accelerations are uniform; the facts have them as `wedge_acceleration` and
    `block_acceleration` (m/s^2).
    """
    T = duration
    (x0, s0), (x1, s1) = start, end
    sine, cosine = np.sin(angle), np.cos(angle)
    ax = -m * g * sine * cosine / (M + m * sine**2)
    as_ = (M + m) * g * sine / (M + m * sine**2)
    ux, us = (x1 - x0) / T - ax * T / 2, (s1 - s0) / T - as_ * T / 2

    def energy(q, v, t):
        kinetic = (M + m) * v[0] ** 2 / 2 + m * v[1] ** 2 / 2 + m * v[0] * v[1] * cosine
        return kinetic - m * g * q[1] * sine

    base = 1.25 * max(abs(s0), abs(s1)) * cosine
    left, right = min(x0, x1) - base / 4, max(x0, x1) + 1.25 * base

    def draw(q, t):
        x, s = q
        top = np.stack([x, base * np.tan(angle)])
        wedge = rod((x, 0.0), top, (x + base, 0.0), (x, 0.0))
        return [ground((left, 0.0), (right, 0.0)), wedge, body(top + s * slope)]

    slope = np.array([cosine, -sine])
    return Setup(
        ["x", "s"],
        T,
        ends=(start, end),
        draw=draw,
        exact=curve(lambda t: (x0 + ux * t + ax * t**2 / 2, s0 + us * t + as_ * t**2 / 2)),
        facts=Facts(
            velocity=curve(lambda t: (ux + ax * t, us + as_ * t)),
            acceleration=lambda q, v, t: np.stack([0 * v[0] + ax, 0 * v[1] + as_]),
            morse_index=0,
            conserved={
                "horizontal momentum": lambda q, v, t: (M + m) * v[0] + m * v[1] * cosine,
                "energy": energy,
            },
            numbers={"wedge_acceleration": ax, "block_acceleration": as_},
        ),
    )
