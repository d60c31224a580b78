r"""A hand that reaches for something.

        o
         '.
           '-.__
                *           from rest to rest

Hands move as if they spared jerk, the rate of change of the acceleration: along a straight line,
fastest half way, with the profile 10 s^3 - 15 s^4 + 6 s^5 of the time s.
"""

from __future__ import annotations

import numpy as np

from actionopt.scenes._scene import Facts, Measure, Setup, Words, curve
from actionopt.scenes._shapes import body, ground

TITLE = "a hand that reaches for something"
SOURCE = "Flash and Hogan, Journal of Neuroscience 5 (1985), p. 1688"
WORDS = Words(
    question="How fast does a hand move on its way to a cup?",
    answer="Slowly at first and at last, and 15/8 of the mean speed half way.",
    look="It starts and stops so gently that no acceleration is seen at the ends.",
    beside=("smoothest_way",),
)


def lagrangian(q, v, a, j, t):
    """L = (x'''^2 + y'''^2) / 2, the square of the jerk, for unit mass."""
    return (j @ j) / 2


def scene(*, x=0.4, y=0.3, duration=0.8):
    """Reach for what is `x` to the right and `y` above (m), within a `duration` (s).

    The facts have the `top_speed` (m/s).
    """
    way = np.array([x, y], dtype=float)

    def place(t):
        s = t / duration
        return list(np.multiply.outer(way, s**3 * (10 - 15 * s + 6 * s**2)))

    def velocity(t):
        s = t / duration
        return list(np.multiply.outer(way, 30 * s**2 * (1 - s) ** 2 / duration))

    rest = np.zeros(2)
    return Setup(
        ["x", "y"],
        duration,
        measure=Measure(""),
        draw=lambda q, t: [
            ground((x, y - 0.05), (x, y + 0.05)),
            ground((0.0, -0.05), (0.0, 0.05)),
            body((q[0], q[1])),
        ],
        exact=curve(place),
        rates=((rest, rest), (rest, rest)),
        facts=Facts(
            velocity=curve(velocity),
            action=float(360 * (way @ way) / duration**5),
            morse_index=0,
            numbers={"top_speed": float(1.875 * np.hypot(x, y) / duration)},
        ),
    )
