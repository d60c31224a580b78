r"""A rope of given length, so long that a part of it lies on the floor.

        *                 o
         \               /       height y, x along the floor
          '.           .'
        ----'-._____.-'---

Of all ropes of its length between two nails and above the floor, that one hangs whose weight is
lowest: a catenary on either side, of one tension, and straight on the floor. The length is given,
and the tension found: the catenaries' radius c, where they are level, is that tension over the
weight of a length. Heights are measured from a line below the floor. L is half the square of the
weight per unit of the parameter.
"""

from __future__ import annotations

import numpy as np

from actionopt.scenes._scene import Facts, Measure, Setup, Words, curve
from actionopt.scenes._shapes import body, ground

TITLE = "a rope of given length, a part of it on the floor"
SOURCE = (
    "Gelfand and Fomin, Calculus of Variations (1963), section 12; Routh, A Treatise on Analytical "
    "Statics, vol. 1 (2nd ed. 1896), chapter 10"
)
WORDS = Words(
    question="How much of a rope lies on the floor, if it is longer than it can hang?",
    answer="What the catenaries on both sides leave: they come down as tangents, with one tension.",
    look="On both sides it rises from the floor alike, and ends at the height of its nail.",
    captions={"contact": "The floor carries the part that lies on it, evenly."},
    beside=("rope_of_length", "chain_on_floor", "catenoid"),
)


def length(q, v, *, h):
    """L = y^2 (x'^2 + y'^2) / (2 h^2), half the square of a length."""
    return q[1] * np.sqrt(v @ v) / h


def integral(q, v, t):
    """G = sqrt(x'^2 + y'^2): the rate at which rope is used up."""
    return np.sqrt(v @ v)


def obstacle(q, t, *, floor):
    """Keep f = y - floor: at least zero."""
    return q[1] - floor


def scene(*, h=1.0, c=0.6, floor=0.5, heights=(1.0, 0.7), apart=3.0, duration=1.0):
    """Hang a rope between nails at the `heights` over the floor, so far `apart` (m).

    The tension on the floor is the weight of the length `c` (m) of the rope. The facts have the
    `rope_length` (m), the times at which contact begins and ends, and the floor's force. Raises
    ValueError if the rope does not reach the floor, or for lengths that are not above 0.
    """
    up = np.asarray(heights, dtype=float)
    if min(h, c, floor, *up, apart) <= 0:
        raise ValueError(
            f"expected h, c, floor, heights and apart above 0, found {h}, {c}, {floor}, {heights}, "
            f"{apart}"
        )
    left, right = c * np.arccosh(1 + up / c)
    flat = apart - left - right
    if not flat > 0:
        raise ValueError(
            f"expected nails farther apart than {left + right:.6g}, where the rope reaches the "
            f"floor, found apart = {apart}"
        )
    base = floor - c

    def weight(u):
        return (base * c * np.sinh(u / c) + c * u / 2 + c**2 / 4 * np.sinh(2 * u / c)) / h

    before, lying, behind = weight(left), floor * flat / h, weight(right)
    whole = before + lying + behind
    speed = whole / duration

    def along(t):
        """Return the distance along the floor, and from where the rope leaves it."""
        wanted = speed * np.asarray(t, dtype=float) - before
        on = np.clip(wanted, 0, lying)
        u = np.interp(wanted - on, weight(grid), grid)
        for _ in range(4):  # from within a hundredth Newton's method doubles the digits
            rate = (base + c * np.cosh(u / c)) * np.cosh(u / c) / h
            u = u - (weight(u) - (wanted - on)) / rate
        return left + on * h / floor, u

    def place(t):
        on, u = along(t)
        return [on + u, base + c * np.cosh(u / c)]

    def velocity(t):
        _, u = along(t)
        rate = speed * h / ((base + c * np.cosh(u / c)) * np.cosh(u / c))
        return [rate, rate * np.sinh(u / c)]

    def guess(t):  # straight down to where it touches, and up again
        corners = [0.0, before / whole, (before + lying) / whole, 1.0]
        s = np.asarray(t, dtype=float) / duration
        x = np.interp(s, corners, [0.0, left, left + flat, apart])
        return np.stack([x, np.interp(s, corners, floor + np.array([up[0], 0.0, 0.0, up[1]]))])

    grid = np.linspace(-left, right, 401)
    kappa = float(-speed * base / h)
    return Setup(
        ["x", "y"],
        duration,
        measure=Measure(""),
        draw=lambda q, t: [
            ground((0.0, floor), (apart, floor)),
            ground((0.0, floor + up[0])),
            ground((apart, floor + up[1])),
            body(q),
        ],
        ends=((0.0, floor + up[0]), (apart, floor + up[1])),
        exact=curve(place),
        guess=guess,
        integral=[float(np.sqrt(up * (up + 2 * c)).sum() + flat)],
        facts=Facts(
            velocity=curve(velocity),
            action=float(whole**2 / (2 * duration)),
            energy=float(speed**2 / 2),
            morse_index=0,
            conserved={
                "tension along x": lambda q, v, t: (
                    (q[1] / h) ** 2 * v[0] + kappa * v[0] / np.sqrt(v[0] ** 2 + v[1] ** 2)
                )
            },
            integral_multipliers=[kappa],
            numbers={
                "rope_length": float(np.sqrt(up * (up + 2 * c)).sum() + flat),
                "contact_begin": float(before / speed),
                "contact_end": float((before + lying) / speed),
                "contact_force": float(speed**2 / floor),
            },
        ),
    )
