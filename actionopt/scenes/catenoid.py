r"""A film of soap between two rings.

        |\          /|
        | '-.____.-' |      radius y, over the axis x
        |  .-''''-.  |      rings of radius R at a distance d
        |/          \|

Its area is the action: that of light where the index is y / R, up to a factor 2 pi R. L is half the
square of that length per unit of the parameter. Two films hang between rings that are close, the
wider one least, and none beyond d = 1.3255 R. From d = 1.0554 R on two plane discs have less area
(Goldschmidt), which is no such curve.
"""

from __future__ import annotations

import numpy as np

from actionopt.scenes._scene import Facts, Measure, Setup, Words, curve
from actionopt.scenes._shapes import body, ground
from actionopt.tools.types import Array

TITLE = "a film of soap between two rings"
SOURCE = (
    "Goldstein, Classical Mechanics (3rd ed. 2002), section 2.2, p. 40; OEIS A033259 and A253545"
)
WORDS = Words(
    question="Which surface has the least area between two rings?",
    answer="A catenary turned about its axis, as long as the rings are close.",
    look="The film is narrowest half way between the rings.",
    beside=("brachistochrone", "chain"),
)


def length(q, v, *, R):
    """L = y^2 (x'^2 + y'^2) / (2 R^2), half the square of a length."""
    return q[1] * np.sqrt(v @ v) / R


def scene(*, R=1.0, d=1.0, duration=1.0):
    """Hang the wider film between rings of radius `R` at the distance `d` (m).

    y = c cosh((x - d / 2) / c). The facts have its narrowest radius `waist` and its `area`. Raises
    ValueError where the rings are too far apart.
    """
    h = d / 2
    if not 0 < h < 0.6627434 * R:
        raise ValueError(f"expected 0 < d < 1.32548 R, beyond which no film hangs, found d = {d}")
    c = R
    for _ in range(200):  # from above it comes down to the larger root
        step = (c * np.cosh(h / c) - R) / (np.cosh(h / c) - h / c * np.sinh(h / c))
        c -= step
        if abs(step) < 1e-15 * c:
            break
    total = c / R * (h + c / 2 * np.sinh(2 * h / c))  # the length, R times that of the parameter

    def along(t) -> Array:
        """Return x - d / 2 where the length is that at t: c / R (x / 2 + c / 4 sinh(2 x / c))."""
        wanted = total * (np.asarray(t, dtype=float) / duration - 0.5)
        x = 2 * h * (np.asarray(t, dtype=float) / duration - 0.5)
        for _ in range(60):
            miss = c / R * (x / 2 + c / 4 * np.sinh(2 * x / c)) - wanted
            x = x - miss / (c / R * np.cosh(x / c) ** 2)
        return x

    def velocity(t):
        x = along(t)
        rate = total / duration / (c / R * np.cosh(x / c) ** 2)
        return [rate, rate * np.sinh(x / c)]

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
        exact=curve(lambda t: [along(t) + h, c * np.cosh(along(t) / c)]),
        facts=Facts(
            velocity=curve(velocity),
            action=total**2 / (2 * duration),
            energy=(total / duration) ** 2 / 2,
            conserved={"momentum along x": lambda q, v, t: (q[1] / R) ** 2 * v[0]},
            numbers={"waist": c, "area": 2 * np.pi * R * total},
        ),
    )
