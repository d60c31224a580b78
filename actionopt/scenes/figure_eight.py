r"""Three equal bodies chasing each other along one figure-eight.

      .---.     .---.
     1     '. .'     2
     |       3       |
      '---'     '---'

A third of the period later each body stands where another stood.
"""

from __future__ import annotations

import numpy as np

from actionopt.mechanics.events import State
from actionopt.scenes._scene import Facts, Setup, Words, curve
from actionopt.scenes._shapes import body

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
    beside=("two_body", "kepler"),
)


# At unit masses and G, with the bodies at (-1, 0), (1, 0) and the origin.
VELOCITY = np.array([0.3471168881189300, 0.5327249453880287])  # of the outer two
PERIOD, ENERGY, ACTION = 6.325913982926223, -1.287141995631856, 24.42704864453737  # one period


def lagrangian(q, v, t, *, m, G):
    """L = sum over i of m v_i^2 / 2 + sum over i < j of G m^2 / |r_i - r_j|."""
    x, y = q[0::2], q[1::2]
    pairs = [(0, 1), (0, 2), (1, 2)]
    near = sum(1 / np.sqrt((x[i] - x[j]) ** 2 + (y[i] - y[j]) ** 2) for i, j in pairs)
    return m * np.sum(v**2) / 2 + G * m**2 * near


def scene(*, m=1.0, G=1.0, length=1.0):
    """Move three masses m (kg) by a third of the period; `length` (m) is the outer distance.

    Bodies 1 and 2 start at -length and length on the x axis, 3 in the middle. A straight guess
    would have them collide: the guess is the cubic with the right velocities at both ends. The
    facts have the `period` (s) and `period_action`, S over one.
    """
    speed = np.sqrt(G * m / length)
    outer = length * np.array([1.0, 0.0])
    q0, q1 = (np.concatenate(r) for r in ((-outer, outer, 0 * outer), (outer, 0 * outer, -outer)))
    u = speed * VELOCITY
    v0, v1 = np.concatenate([u, u, -2 * u]), np.concatenate([u, -2 * u, u])
    T = PERIOD / 3 * length / speed

    def guess(t):
        s = t / T
        a, b = s**2 * (3 - 2 * s), s * (1 - s)
        rows = zip(q0, q1, v0, v1, strict=True)
        return [x + (y - x) * a + T * b * ((1 - s) * p - s * r) for x, y, p, r in rows]

    def energy(q, v, t):
        x, y = q[0::2], q[1::2]
        pairs = [(0, 1), (0, 2), (1, 2)]
        near = sum(1 / np.hypot(x[i] - x[j], y[i] - y[j]) for i, j in pairs)
        return m * np.sum(v**2, axis=0) / 2 - G * m**2 * near

    def turning(q, v, t):
        return m * np.sum(q[0::2] * v[1::2] - q[1::2] * v[0::2], axis=0)

    whole = m * speed * length * ACTION
    return Setup(
        ["x1", "y1", "x2", "y2", "x3", "y3"],
        T,
        ends=(q0, q1),
        draw=lambda q, t: [body(q[i : i + 2]) for i in (0, 2, 4)],
        guess=curve(guess),
        facts=Facts(
            start=State(0.0, q0, v0),
            action=whole / 3,
            energy=m * speed**2 * ENERGY,
            morse_index=0,  # 2 over a whole period: Fukuda, Fujiwara, Ozaki, arXiv:1710.04834
            conserved={
                "energy": energy,
                "momentum, x": lambda q, v, t: m * np.sum(v[0::2], axis=0),
                "momentum, y": lambda q, v, t: m * np.sum(v[1::2], axis=0),
                "angular momentum": turning,
            },
            numbers={"period": 3 * T, "period_action": whole},
        ),
    )
