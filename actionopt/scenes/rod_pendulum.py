r"""The plane pendulum again, in Cartesian coordinates: the rod's tension is a multiplier.

        -----+-----
             |\
             | \  x^2 + y^2 = l^2
             |  \
                 o  m

Gravity g points downward, y upward, and the pivot is the origin.
"""

from dataclasses import replace

import numpy as np

from actionopt.scenes import pendulum
from actionopt.scenes._scene import Words, curve, like
from actionopt.scenes._shapes import body, ground, rod

TITLE = "plane pendulum in Cartesian coordinates, with the tension of its rod"
SOURCE = "Competitive Physics: Mechanics and Waves (2018), section 12.4, eqs. (12.7)-(12.9), p. 640"
WORDS = Words(
    question="Can a pendulum be described by x and y, which are not free of each other?",
    answer="Yes: a constraint ties them, and its multiplier is the tension of the rod.",
    look="The arrow, the force of the rod, always points at the pivot.",
    captions={
        "motion": (
            "The same swing as by the angle; the bob stays on its circle by a force and not by "
            "a coordinate."
        ),
        "path": "Two coordinates, and one constraint between them at every time.",
        "conserved": (
            "Neither momentum is conserved, for rod and weight both push; the energy is, for "
            "the rod does no work."
        ),
    },
    beside=("pendulum", "polar_pendulum", "chain"),
)


def lagrangian(q, v, t, *, m, g):
    """L = m (x'^2 + y'^2) / 2 - m g y."""
    _, y = q
    vx, vy = v
    return m * (vx**2 + vy**2) / 2 - m * g * y


def constraint(q, t, *, l):
    """Hold f = x^2 + y^2 - l^2 = 0."""
    x, y = q
    return x**2 + y**2 - l**2


@like(pendulum)
def scene(twin, *, m, l, g, amplitude, since):
    """Swing as in the scene `pendulum`, with the same parameters.

    The force of constraint is 2 lambda (x, y), so the rod pulls inward with -2 l lambda.
    """
    theta, rate = pendulum.motion(g / l, amplitude, since)

    def velocity(t):
        return l * rate(t) * np.cos(theta(t)), l * rate(t) * np.sin(theta(t))

    def tension(q, v):
        return (m * (v[0] ** 2 + v[1] ** 2) - m * g * q[1]) / l

    return replace(
        twin,
        coordinates=["x", "y"],
        draw=lambda q, t: [ground((0.0, 0.0)), rod((0.0, 0.0), q), body(q)],
        exact=curve(lambda t: (l * np.sin(theta(t)), -l * np.cos(theta(t)))),
        facts=replace(
            twin.facts,
            acceleration=None,
            velocity=curve(velocity),
            multipliers=lambda q, v, t: -tension(q, v)[None] / (2 * l),
            conserved={"energy": lambda q, v, t: m * (v[0] ** 2 + v[1] ** 2) / 2 + m * g * q[1]},
        ),
    )
