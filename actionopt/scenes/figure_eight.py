r"""Three equal bodies chasing each other along one figure-eight.

      .---.     .---.
     1     '. .'     2
     |       3       |
      '---'     '---'

A third of the period later each body stands where another stood.
"""

from __future__ import annotations

import numpy as np

from actionopt.scenes._choreography import attraction, part
from actionopt.scenes._scene import Setup, Words

TITLE = "three bodies on the figure-eight, a third of the way round"
SOURCE = (
    "Chenciner and Montgomery, Annals of Mathematics 152 (2000), p. 881; initial velocity of Li "
    "and Liao, Sci. China Phys. 60 (2017) 129511, table I.A(ic)_1, with more digits"
)
WORDS = Words(
    question="Can three equal bodies follow each other along one curve for ever?",
    answer=("Yes, on a figure-eight; after a third of the period each stands where another stood."),
    look="Each body ends where another one began: the one in the middle goes left.",
    captions={
        "motion": (
            "The three trails together are one curve, an eight, each body covering a third of it."
        ),
        "path": "The centre of mass rests at the crossing of the eight all the while.",
        "conserved": (
            "The energy is conserved, and so is the total momentum, though no single one is."
        ),
    },
    beside=("two_body", "four_on_an_eight"),
)


# At unit masses and G, with the bodies at (-1, 0), (1, 0) and the origin; S over the period.
VELOCITY = np.array([0.3471168881189300, 0.5327249453880287])  # of the outer two
EIGHT_PERIOD, EIGHT_ACTION = 6.325913982926223, 24.42704864453737


def lagrangian(q, v, t, *, m, G):
    """L = sum over i of m v_i^2 / 2 + sum over i < j of G m^2 / |r_i - r_j|."""
    return m * np.sum(v**2) / 2 + attraction(q, m, G)


def scene(*, m=1.0, G=1.0, length=1.0) -> Setup:
    """Move three masses m (kg) by a third of the period; `length` (m) is the outer distance.

    Bodies 1 and 2 start at -length and length on the x axis, 3 in the middle. A straight guess
    would have them collide: the guess is the cubic with the right velocities at both ends. The
    facts have the `period` (s) and `period_action`, S over one.
    """
    r = np.array([[-1.0, 0.0], [1.0, 0.0], [0.0, 0.0]])
    v = np.array([VELOCITY, VELOCITY, -2 * VELOCITY])
    # index: 2 over a whole period (Fukuda, Fujiwara and Ozaki, arXiv:1710.04834)
    return part(r, v, EIGHT_PERIOD, EIGHT_ACTION, m, G, length, index=0)
