r"""Light that goes by way of a mirror.

        *             o
          \         /
            \     /           x, y; the mirror is y = 0
        ------\_/--------

Of all ways that touch the mirror the shortest is taken. Hero unfolded it: beyond the mirror the
source has an image, from which the way is straight. Where light meets the mirror is not given: the
momentum along the mirror is the same before and after, and so are the angles.
"""

from __future__ import annotations

import numpy as np

from actionopt.mechanics.question.events import Bounce
from actionopt.scenes._legs import rays
from actionopt.scenes._scene import Facts, Setup, Words
from actionopt.scenes._shapes import body, ground

TITLE = "light by way of a mirror"
SOURCE = "Feynman, Lectures on Physics, vol. 1 (1963), section 26-3"
WORDS = Words(
    question="Where must a ray meet a mirror, to get from one point to another the shortest way?",
    answer="Where it leaves under the angle under which it comes.",
    look="Fold the way back over at the mirror: it comes from the image in a straight line.",
    captions={"conserved": "Only the momentum across the mirror is turned round."},
    beside=("snell", "billiard_ellipse"),
)


def length(q, v):
    """L = (x'^2 + y'^2) / 2, half the square of a length."""
    return np.sqrt(v @ v)


def scene(*, start=(-1.2, 0.9), end=(1.3, 0.5), duration=1.0):
    """Send light from `start` to `end` (m) by way of the mirror y = 0.

    The facts have the place `foot` where it meets the mirror. Raises ValueError unless both points
    are above the mirror.
    """
    (a, h), (b, k) = start, end
    if not min(h, k) > 0:
        raise ValueError(f"expected both ends above the mirror, y > 0, found {start} and {end}")
    foot = float(a + (b - a) * h / (h + k))
    points = [start, (foot, 0.0), end]
    exact, facts = rays(points, duration)
    return Setup(
        ["x", "y"],
        duration,
        draw=lambda q, t: [ground((a, 0.0), (b, 0.0)), body(q)],
        exact=exact,
        through=[Bounce(lambda q, t: q[1])],
        facts=Facts(
            **facts,
            morse_index=0,  # the sum of two distances is convex in the place
            conserved={"momentum along x": lambda q, v, t: v[0]},
            numbers={"foot": foot},
        ),
    )
