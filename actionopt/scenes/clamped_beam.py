r"""A beam clamped at both ends, under its own weight.

        =|___                 ___|=
             '--.._______..--'        its height y over the place t along it

The energy of bending and that of height together are least. The parameter is no time: it runs along
the beam.
"""

from __future__ import annotations

import numpy as np

from actionopt.scenes._scene import Facts, Measure, Setup, Words, curve
from actionopt.scenes._shapes import body, ground, rod

TITLE = "a clamped beam under its own weight"
SOURCE = "Landau and Lifshitz, Theory of Elasticity (3rd ed. 1986), section 20, problem 1"
WORDS = Words(
    question="How far does a beam sag that is built into walls?",
    answer="A fifth of what it would on two supports.",
    look="At the walls it is level, and bent the other way than in the middle.",
    beside=("buckled_beam", "smoothest_way"),
)


def lagrangian(q, v, a, t, *, B, f):
    """L = B y''^2 / 2 + f y."""
    return B * a[0] ** 2 / 2 + f * q[0]


def scene(*, B=2.0, f=12.0, duration=2.0):
    """Clamp a beam of stiffness `B` (N m^2) and weight `f` (N/m) at both ends, `duration` m apart.

    The facts have the `sag` (m) in the middle.
    """
    long, load = duration, f / (24 * B)

    def place(t):
        return [-load * t**2 * (long - t) ** 2]

    def velocity(t):
        return [-2 * load * t * (long - t) * (long - 2 * t)]

    grid = np.linspace(0.0, long, 25)
    shape = [(float(x), float(place(x)[0])) for x in grid]
    walls = [((x, -0.2 * long), (x, 0.2 * long)) for x in (0.0, long)]
    return Setup(
        ["y"],
        duration,
        measure=Measure(""),
        draw=lambda q, t: [*(ground(*wall) for wall in walls), rod(*shape), body((t, q[0]))],
        exact=curve(place),
        rates=(([0.0],), ([0.0],)),
        facts=Facts(
            velocity=curve(velocity),
            action=float(-(f**2) * long**5 / (1440 * B)),
            morse_index=0,
            numbers={"sag": float(load * long**4 / 16)},
        ),
    )
