r"""A heavy beam clamped at both ends above a floor, so long that a part of it lies there.

    |==._                  |
    |    '.             _.=|      its height y over the place t along it
    |------'===========----|

The energy of bending and that of height together are least, and the beam is not below the floor.
Where it leaves the floor it is not bent, and there the floor pushes with a force at a point. The
parameter is no time: it runs along the beam.
"""

from __future__ import annotations

import numpy as np

from actionopt.scenes._scene import Facts, Measure, Setup, Words, curve
from actionopt.scenes._shapes import body, ground, rod

TITLE = "a heavy beam, a part of it on the floor"
SOURCE = (
    "Landau and Lifshitz, Theory of Elasticity (3rd ed. 1986), sections 17 and 20; Bryson, Denham "
    "and Dreyfus, AIAA Journal 1 (1963) 2544, section 5"
)
WORDS = Words(
    question="With what does a floor carry a beam that lies on it?",
    answer=(
        "It carries the part that lies with its weight, and at both ends of that part a third of "
        "the weight of what hangs beside it: the walls carry the rest."
    ),
    look="It comes down to the floor level and not bent; only its shear force jumps there.",
    captions={
        "contact": (
            "The floor carries the part that lies on it, evenly. The arrows are forces at points, "
            "where the beam leaves it."
        )
    },
    beside=("clamped_beam", "rope_on_floor"),
)


def lagrangian(q, v, a, t, *, B, w):
    """L = B y''^2 / 2 + w y."""
    return B * a[0] ** 2 / 2 + w * q[0]


def obstacle(q, t):
    """Keep y: at least zero."""
    return q[0]


def scene(*, B=2.0, w=60.0, heights=(0.4, 0.2), duration=2.5):
    """Clamp a beam of stiffness `B` (N m^2) and weight `w` (N/m) level at the `heights` (m).

    The walls are `duration` m apart. From each the beam hangs over the length
    l, w l^4 = 72 B y, with y = w s^3 (4 l - 3 s) / (72 B) at s from the floor. The facts have
    where contact begins and ends (m), the floor's force (N/m) between, and its impulses there, the
    forces w l / 3 (N). Raises ValueError if the beam does not lie anywhere, or for values that are
    not above 0.
    """
    up = np.asarray(heights, dtype=float)
    if min(B, w, duration, *up) <= 0:
        raise ValueError(
            f"expected B, w, heights and duration above 0, found {B}, {w}, {heights}, {duration}"
        )
    left, right = (72 * B * up / w) ** 0.25
    first, last = left, duration - right
    if not first < last:
        raise ValueError(
            f"expected walls farther apart than {left + right:.6g}, where the beam lies on the "
            f"floor, found duration = {duration}"
        )

    def hanging(t):
        """Return the distances s from where it lies, to the left and to the right."""
        t = np.asarray(t, dtype=float)
        return np.maximum(first - t, 0.0), np.maximum(t - last, 0.0)

    def place(t):
        s, r = hanging(t)
        return [w / (72 * B) * (s**3 * (4 * left - 3 * s) + r**3 * (4 * right - 3 * r))]

    def velocity(t):
        s, r = hanging(t)
        return [w / (6 * B) * (r**2 * (right - r) - s**2 * (left - s))]

    grid = np.linspace(0.0, duration, 51)
    shape = [*zip(grid.tolist(), place(grid)[0].tolist(), strict=True)]
    walls = [((x, 1.6 * y), (x, 0.0)) for x, y in zip((0.0, duration), up.tolist(), strict=True)]
    return Setup(
        ["y"],
        duration,
        measure=Measure(""),
        draw=lambda q, t: [
            *(ground(*wall) for wall in walls),
            ground((0.0, 0.0), (duration, 0.0)),
            rod(*shape),
            body((t, q[0])),
        ],
        exact=curve(place),
        rates=(([0.0],), ([0.0],)),
        facts=Facts(
            velocity=curve(velocity),
            action=float(w**2 / (135 * B) * (left**5 + right**5)),
            energy=0.0,
            morse_index=0,
            numbers={
                "contact_begin": float(first),
                "contact_end": float(last),
                "contact_force": float(w),
                "begin_impulse": float(w * left / 3),
                "end_impulse": float(w * right / 3),
            },
        ),
    )
