r"""Two pendulums, one hung from the other.

        -----+-----
             |\
       theta1| \ l1
             |  o m1
                |\
          theta2| \ l2
                |  o m2

Both angles are measured from straight down.
"""

import numpy as np

from actionopt.scenes._scene import Facts, Setup, Words
from actionopt.scenes._shapes import body, ground, rod

TITLE = "double pendulum"
SOURCE = "Landau and Lifshitz, Mechanics (3rd ed. 1976), section 5, problem 1"
WORDS = Words(
    question=(
        "Between two given positions of a double pendulum there are several motions. Which one "
        "is least?"
    ),
    answer=(
        "One that is hardly thought of: it whirls up fast and back, and its action is a minimum."
    ),
    look=(
        "The inner arm nearly turns over before it comes back; the outer one whirls the other way."
    ),
    captions={
        "motion": (
            "A violent motion between two tame positions: the bobs rise high above where they "
            "start and end."
        ),
        "path": (
            "Both angles leave the straight line between their ends by more than two radians."
        ),
        "conserved": "The energy is conserved and neither momentum is: gravity turns both arms.",
    },
    beside=("chain", "pendulum"),
)


def lagrangian(q, v, t, *, m1, m2, l1, l2, g):
    """L = T - V of two point masses on massless rods.

    L = (m1 + m2) l1^2 theta1'^2 / 2 + m2 l2^2 theta2'^2 / 2
    + m2 l1 l2 theta1' theta2' cos(theta1 - theta2)
    + (m1 + m2) g l1 cos theta1 + m2 g l2 cos theta2.
    """
    a, b = q
    u, w = v
    first = (m1 + m2) * ((l1 * u) ** 2 / 2 + g * l1 * np.cos(a))
    second = m2 * ((l2 * w) ** 2 / 2 + g * l2 * np.cos(b))
    return first + second + m2 * l1 * l2 * u * w * np.cos(a - b)


def scene(
    *, m1=1.0, m2=1.0, l1=1.0, l2=1.0, g=9.81, start=(1.0, 0.5), end=(-0.2, 0.05), duration=2.0
):
    """Join two pairs of angles (rad) in `duration` (s); masses in kg, lengths in m.

    No closed form is known. The default end is, rounded, where a release from rest at the
    default start arrives after two seconds. That motion is a saddle of the action; other paths
    join the same ends, least ones among them, and one of those is found without a guess.
    """

    def energy(q, v, t):
        (a, b), (u, w) = q, v
        kinetic = (m1 + m2) * (l1 * u) ** 2 / 2 + m2 * (l2 * w) ** 2 / 2
        coupling = m2 * l1 * l2 * u * w * np.cos(a - b)
        return kinetic + coupling - (m1 + m2) * g * l1 * np.cos(a) - m2 * g * l2 * np.cos(b)

    def draw(q, t):
        joint = l1 * np.stack([np.sin(q[0]), -np.cos(q[0])])
        tip = joint + l2 * np.stack([np.sin(q[1]), -np.cos(q[1])])
        return [ground((0.0, 0.0)), rod((0.0, 0.0), joint, tip), body(joint), body(tip)]

    return Setup(
        ["theta1", "theta2"],
        duration,
        ends=(start, end),
        draw=draw,
        facts=Facts(conserved={"energy": energy}),
    )
