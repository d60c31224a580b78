r"""The plane pendulum in polar coordinates, its length held by a multiplier.

        -----+-----
             |\
             | \  r = l
             |  \
        theta    o  m

Gravity g points downward; the multiplier is the tension, negative because it points inward.
"""

from dataclasses import replace

import numpy as np

from actionopt.scenes import pendulum
from actionopt.scenes._scene import Words, curve, like

TITLE = "plane pendulum in polar coordinates, with the tension as multiplier"
SOURCE = "Competitive Physics: Mechanics and Waves (2018), section 12.4, p. 640"
WORDS = Words(
    question="How hard does the rod of a pendulum pull?",
    answer=(
        "Hardest at the lowest point: there it carries the weight and turns the velocity round."
    ),
    look=(
        "The arrow is the pull of the rod on the bob: longest at the bottom, shortest at the turn."
    ),
    captions={
        "motion": (
            "The same swing as with the angle alone; the arrows are the tension that the "
            "multiplier gives."
        ),
        "path": "The length stays what it is by the constraint; the angle swings.",
        "conserved": (
            "The momentum of r is zero because the rod keeps its length, not by a symmetry."
        ),
    },
    beside=("pendulum", "rod_pendulum", "sliding_off_circle"),
)


def lagrangian(q, v, t, *, m, g):
    """L = m (r'^2 + r^2 theta'^2) / 2 + m g r cos theta."""
    r, theta = q
    u, w = v
    return m * (u**2 + (r * w) ** 2) / 2 + m * g * r * np.cos(theta)


def constraint(q, t, *, l):
    """Hold f = r - l = 0."""
    return q[0] - l


@like(pendulum)
def scene(twin, *, m, l, g, amplitude, since):
    """Swing as in the scene `pendulum`, with the same parameters."""
    theta, rate = pendulum.motion(g / l, amplitude, since)

    def tension(q, v, t):
        return -(m * l * v[1] ** 2 + m * g * np.cos(q[1]))[None]

    def energy(q, v, t):
        return m * (v[0] ** 2 + (q[0] * v[1]) ** 2) / 2 - m * g * q[0] * np.cos(q[1])

    return replace(
        twin,
        coordinates=["r", "theta"],
        draw=lambda q, t: pendulum.draw(*q),
        exact=curve(lambda t: (l + 0 * t, theta(t))),
        facts=replace(
            twin.facts,
            acceleration=None,
            velocity=curve(lambda t: (0 * t, rate(t))),
            multipliers=tension,
            conserved={"energy": energy},
        ),
    )
