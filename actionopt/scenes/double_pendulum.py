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

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np

from actionopt.mechanics.problem import Event, Problem
from actionopt.mechanics.system import System
from actionopt.scenes._scene import Scene, defaults
from actionopt.scenes._shapes import body, ground, rod

TITLE = "double pendulum"
SOURCE = "Landau and Lifshitz, Mechanics (3rd ed. 1976), section 5, problem 1"


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


@cache
def system() -> System:
    """Return the system, derived once."""
    return System(
        lagrangian,
        ["theta1", "theta2"],
        parameters=defaults(scene, "m1", "m2", "l1", "l2", "g"),
        name="double_pendulum",
    )


def scene(
    *,
    m1: float = 1.0,
    m2: float = 1.0,
    l1: float = 1.0,
    l2: float = 1.0,
    g: float = 9.81,
    start: Sequence[float] = (1.0, 0.5),
    end: Sequence[float] = (-0.2, 0.05),
    duration: float = 2.0,
) -> Scene:
    """Join two pairs of angles (rad) in `duration` (s); masses in kg, lengths in m.

    No closed form is known. The default end is, rounded, where a release from rest at the
    default start arrives after two seconds. That motion is a saddle of the action; other paths
    join the same ends, least ones among them, and one of those is found without a guess.
    """
    values = {"m1": m1, "m2": m2, "l1": l1, "l2": l2, "g": g}

    def energy(q, v, t):
        (a, b), (u, w) = q, v
        kinetic = (m1 + m2) * (l1 * u) ** 2 / 2 + m2 * (l2 * w) ** 2 / 2
        coupling = m2 * l1 * l2 * u * w * np.cos(a - b)
        return kinetic + coupling - (m1 + m2) * g * l1 * np.cos(a) - m2 * g * l2 * np.cos(b)

    def draw(q, t):
        joint = l1 * np.array([np.sin(q[0]), -np.cos(q[0])])
        tip = joint + l2 * np.array([np.sin(q[1]), -np.cos(q[1])])
        return [ground((0.0, 0.0)), rod((0.0, 0.0), joint, tip), body(joint), body(tip)]

    return Scene(
        Problem(system(), Event(0.0, start), Event(duration, end), parameters=values),
        TITLE,
        SOURCE,
        draw=draw,
        facts={"conserved": {"energy": energy}},
    )
