r"""A fine chain hung low between two pulleys, so that a part of it lies on the floor.

        *                   o
         \                 /       height y over the floor, x along it
          '.             .'
        ----'-.________.-'---

Its tension grows by the weight of as much chain as hangs below: at the height y it is that of the
length y + c, with c on the floor. The least of tension times length is a catenary on either side,
and straight on the floor, which cannot pull. L is half the square of that length, over c, per unit
of the parameter.
"""

from __future__ import annotations

import numpy as np

from actionopt.scenes._scene import Facts, Measure, Setup, Words, curve
from actionopt.scenes._shapes import body, ground

TITLE = "a chain hung low, a part of it on the floor"
SOURCE = (
    "Routh, A Treatise on Analytical Statics, vol. 1 (2nd ed. 1896), chapter 10; Bryson and Ho, "
    "Applied Optimal Control (1975), section 3.11"
)
WORDS = Words(
    question="Where does a chain that hangs too low begin to lie on the floor?",
    answer="Where a catenary is level: it comes down to the floor as its tangent.",
    look="The chain comes down steeply, and reaches the floor without a bend.",
    captions={"contact": "The floor carries the part that lies on it, evenly, and no other."},
    beside=("catenoid", "rope_round_post"),
)


def length(q, v, *, c):
    """L = (y + c)^2 (x'^2 + y'^2) / (2 c^2), half the square of a length."""
    return (q[1] + c) * np.sqrt(v @ v) / c


def obstacle(q, t):
    """Keep f = y: at least zero."""
    return q[1]


def scene(*, c=0.5, heights=(1.0, 0.7), apart=3.0, duration=1.0):
    """Hang a chain between pulleys at the `heights` over the floor, so far `apart` (m).

    On the floor its tension is the weight of the length `c` (m) of it. The facts have the times at
    which contact begins and ends, and the floor's force. Raises ValueError if the chain does not
    reach the floor.
    """
    left, right = c * np.arccosh(1 + np.asarray(heights, dtype=float) / c)
    flat = apart - left - right
    if not flat > 0:
        raise ValueError(
            f"expected pulleys farther apart than {left + right:.6g}, where the chain reaches the "
            f"floor, found apart = {apart}"
        )
    before, behind = far(left, c), far(right, c)
    total = before + flat + behind
    speed = total / duration

    def along(t):
        """Return the distances along the floor, and from where the chain leaves it."""
        s = speed * t - before
        on = np.clip(s, 0, flat)
        return on, foot(s - on, c)

    def place(t):
        on, u = along(t)
        return [left + on + u, c * (np.cosh(u / c) - 1)]

    def velocity(t):
        _, u = along(t)
        rate = speed / np.cosh(u / c) ** 2
        return [rate, rate * np.sinh(u / c)]

    return Setup(
        ["x", "y"],
        duration,
        measure=Measure(""),
        draw=lambda q, t: [
            ground((0.0, 0.0), (apart, 0.0)),
            ground((0.0, heights[0])),
            ground((apart, heights[1])),
            body(q),
        ],
        ends=((0.0, heights[0]), (apart, heights[1])),
        exact=curve(place),
        facts=Facts(
            velocity=curve(velocity),
            action=total**2 / (2 * duration),
            energy=speed**2 / 2,
            morse_index=0,
            conserved={"momentum along x": lambda q, v, t: (q[1] / c + 1) ** 2 * v[0]},
            numbers={
                "contact_begin": float(before / speed),
                "contact_end": float((before + flat) / speed),
                "contact_force": float(speed**2 / c),
            },
        ),
    )


def far(u, c: float):
    """Return tension times length from the lowest point of a catenary, over c."""
    return u / 2 + c / 4 * np.sinh(2 * u / c)


def foot(length, c: float):
    """Return the distance u along the floor with far(u, c) = length, by Newton's method."""
    size = np.abs(length)
    u = np.minimum(size, c / 2 * np.arcsinh(4 * size / c))  # both are beyond it, where it is convex
    for _ in range(30):
        u = u - (far(u, c) - size) / np.cosh(u / c) ** 2
    return np.copysign(u, length)
