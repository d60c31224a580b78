r"""The curve of quickest descent.

        *----------> x
        |\
        | '.
        y   '-.___o        depth y, speed sqrt(2 g y)

The time of descent is the action: that of light where the index is sqrt(h / y). L is half the
square of that length per unit of the parameter, which is then the time, up to a factor.
"""

import numpy as np

from actionopt.scenes._scene import Facts, Measure, Setup, Words, curve
from actionopt.scenes._shapes import body, ground

TITLE = "the curve of quickest descent"
SOURCE = "Goldstein, Classical Mechanics (3rd ed. 2002), section 2.2, p. 42"
WORDS = Words(
    question="Along which curve does a body slide down in the shortest time?",
    answer="Along a cycloid, which a point on the rim of a rolling wheel draws.",
    look="It sets out steeply, to be fast early; the wheel turns evenly.",
    beside=("fish_eye", "projectile"),
)


def length(q, v, *, h):
    """L = h (x'^2 + y'^2) / (2 y), half the square of a length."""
    return np.sqrt(h * (v @ v) / q[1])


def scene(*, h=1.0, R=0.5, g=9.81, first=0.5, last=2.6, duration=1.0):
    """Roll a wheel of radius `R` below the line y = 0 from the angle `first` to `last` (rad).

    The facts have the `fall_time`, sqrt(R / g) (last - first): that of a body that started at
    rest from y = 0. Raises ValueError if the wheel turns beyond 0 to 2 pi, where the cusps are.
    """
    if not 0 < first < last < 2 * np.pi:
        raise ValueError(f"expected 0 < first < last < 2 pi, found first = {first}, last = {last}")
    w = (last - first) / duration

    def place(t):
        s = first + w * t
        return [R * (s - np.sin(s)), R * (1 - np.cos(s))]

    def velocity(t):
        s = first + w * t
        return [R * w * (1 - np.cos(s)), R * w * np.sin(s)]

    return Setup(
        ["x", "y"],
        duration,
        measure=Measure("time of descent", "s", 1 / np.sqrt(2 * g * h)),
        draw=lambda q, t: [ground((0.0, 0.0), (2 * np.pi * R, 0.0)), body((q[0], -q[1]))],
        exact=curve(place),
        facts=Facts(
            velocity=curve(velocity),
            energy=R * h * w**2,
            conserved={"momentum along x": lambda q, v, t: h * v[0] / q[1]},
            numbers={"fall_time": np.sqrt(R / g) * (last - first)},
        ),
    )
