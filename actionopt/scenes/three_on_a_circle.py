r"""Three equal bodies chasing each other around one circle.

         2
       .' '.
      3     |
       '.  /
         '1

A third of the period later each body stands where the next one stood.
"""

from __future__ import annotations

import numpy as np

from actionopt.scenes._choreography import attraction, part
from actionopt.scenes._scene import Setup, Words

TITLE = "three bodies on a circle, a third of the way round"
SOURCE = (
    "Lagrange, Essai sur le probleme des trois corps (1772); at unit masses, G and radius "
    "w^2 = 1 / sqrt(3), the pull of two bodies at the distance sqrt(3)"
)
WORDS = Words(
    question="Can three equal bodies stay as far from each other as they are?",
    answer="Yes, if they turn at the right rate: the triangle that they span stays as it is.",
    look="Each body goes round a third of the circle, to where the next one was.",
    beside=("figure_eight", "four_on_an_eight"),
)

CIRCLE_RATE = 3**-0.25  # at unit masses, G and radius


def lagrangian(q, v, t, *, m, G):
    """L = sum over i of m v_i^2 / 2 + sum over i < j of G m^2 / |r_i - r_j|."""
    return m * np.sum(v**2) / 2 + attraction(q, m, G)


def scene(*, m=1.0, G=1.0, radius=1.0) -> Setup:
    """Turn three masses m (kg) on a circle of the radius (m) by a third.

    The facts have the `period` (s) and `period_action`, S over one.
    """
    angle = 2 * np.pi * np.arange(3) / 3
    r = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    v = CIRCLE_RATE * np.stack([-np.sin(angle), np.cos(angle)], axis=1)
    period = 2 * np.pi / CIRCLE_RATE
    # T = 3 RATE^2 / 2 and V = -sqrt(3) = -2 T
    return part(r, v, period, 9 / 2 * CIRCLE_RATE**2 * period, m, G, radius, turning=CIRCLE_RATE)
