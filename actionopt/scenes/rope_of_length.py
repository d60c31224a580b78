r"""A rope of given length.

        *                 o
         \               /       height y over the floor, x along it
          '.           .'
            '-._____.-'

Of all ropes of its length between two nails the one hangs whose weight is lowest: a catenary. The
weight is that of light where the index is y / h, and the length is given: its multiplier shifts the
height from which the tension is measured. L is half the square of the weight per unit of the
parameter.
"""

from __future__ import annotations

import numpy as np

from actionopt.scenes._scene import Facts, Measure, Setup, Words, curve
from actionopt.scenes._shapes import body, ground

TITLE = "a rope of given length"
SOURCE = "Gelfand and Fomin, Calculus of Variations (1963), section 12; Routh, Statics, vol. 1"
WORDS = Words(
    question="How does a rope of given length hang between two nails?",
    answer="As a catenary, the curve of the hyperbolic cosine.",
    look="It is lowest where it is level, and steeper the farther from there.",
    beside=("chain_on_floor", "catenoid", "dido"),
)


def length(q, v, *, h):
    """L = y^2 (x'^2 + y'^2) / (2 h^2), half the square of a length."""
    return q[1] * np.sqrt(v @ v) / h


def integral(q, v, t):
    """G = sqrt(x'^2 + y'^2): the rate at which rope is used up."""
    return np.sqrt(v @ v)


def scene(*, h=1.0, c=0.7, low=1.0, left=0.9, right=1.2, duration=1.0):
    """Hang a rope that is lowest, `low` over the floor, `left` and `right` (m) from the nails.

    c (m) is the radius of the catenary at its lowest point; the tension is the weight of a rope as
    long as it is high over the line c below. The facts have the `rope_length` (m). Raises
    ValueError for lengths that are not above 0.
    """
    if min(h, c, low, left, right) <= 0:
        raise ValueError(
            f"expected h, c, low, left and right above 0, found {h}, {c}, {low}, {left}, {right}"
        )
    base = low - c

    def weight(u):
        return (base * c * np.sinh(u / c) + c * u / 2 + c**2 / 4 * np.sinh(2 * u / c)) / h

    def height(u):
        return base + c * np.cosh(u / c)

    begin, whole = weight(-left), weight(right) - weight(-left)

    def at(t):
        wanted = begin + whole * np.asarray(t, dtype=float) / duration
        u = np.interp(wanted, weight(grid), grid)
        for _ in range(4):  # from within a hundredth Newton's method doubles the digits
            u = u - (weight(u) - wanted) * h / (height(u) * np.cosh(u / c))
        return u

    def velocity(t):
        u = at(t)
        rate = whole / duration * h / (height(u) * np.cosh(u / c))
        return [rate, rate * np.sinh(u / c)]

    def guess(t):  # a parabola from each nail down to the lowest point
        x = (left + right) * np.asarray(t, dtype=float) / duration
        u = np.where(x < left, (x - left) / left, (x - left) / right)
        return np.stack([x, low + u**2 * np.where(u < 0, height(-left) - low, height(right) - low)])

    grid = np.linspace(-left, right, 201)
    kappa = float(-whole * base / (h * duration))
    return Setup(
        ["x", "y"],
        duration,
        measure=Measure(""),
        draw=lambda q, t: [
            ground((0.0, 0.0), (left + right, 0.0)),
            ground((0.0, height(-left))),
            ground((left + right, height(right))),
            body(q),
        ],
        exact=curve(lambda t: (left + at(t), height(at(t)))),
        guess=guess,
        integral=[float(c * (np.sinh(right / c) + np.sinh(left / c)))],
        facts=Facts(
            velocity=curve(velocity),
            action=float(whole**2 / (2 * duration)),
            energy=float((whole / duration) ** 2 / 2),
            morse_index=0,
            conserved={
                "tension along x": lambda q, v, t: (
                    (q[1] / h) ** 2 * v[0] + kappa * v[0] / np.sqrt(v[0] ** 2 + v[1] ** 2)
                )
            },
            integral_multipliers=[kappa],
            numbers={"rope_length": float(c * (np.sinh(right / c) + np.sinh(left / c)))},
        ),
    )
