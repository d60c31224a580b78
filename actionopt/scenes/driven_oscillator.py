r"""A mass on a spring with a harmonic drive.

    |
    |/\/\/\/\/[ m ]   -> m B cos(w t)
    |           |--> x

The spring on an oscillating wall once more: total time derivatives dropped, B = A w^2.
"""

from dataclasses import replace

import numpy as np

from actionopt.scenes import oscillating_wall
from actionopt.scenes._scene import Words, like
from actionopt.scenes.oscillator import draw

TITLE = "driven oscillator: the oscillating wall without total derivatives"
SOURCE = "Competitive Physics: Mechanics and Waves (2018), section 12.3.2, p. 633"
WORDS = Words(
    question="A spring is driven at its end. Can the drive be put into the Lagrangian?",
    answer="Yes: as a potential that depends on time. The path is that of the shaken wall.",
    look="The motion is the same as that of the shaken wall, seen from the wall.",
    captions={
        "motion": "The mass rises slightly before it swings through to the other side.",
        "path": (
            "The path agrees with that of the oscillating wall, though the Lagrangian is another."
        ),
        "conserved": "Nothing is conserved: the drive depends on time and does work on the mass.",
    },
    beside=("oscillating_wall", "oscillator"),
)


def lagrangian(q, v, t, *, m, k, A, w):
    """L = m x'^2 / 2 - k x^2 / 2 + m A w^2 x cos(w t)."""
    return m * v[0] ** 2 / 2 - k * q[0] ** 2 / 2 + m * A * w**2 * q[0] * np.cos(w * t)


@like(oscillating_wall)
def scene(twin, *, m, A, w, start, end):
    """Follow the path of the scene `oscillating_wall`, with the same parameters."""

    def gauge(q, t):
        square = (t / 2 - np.sin(2 * w * t) / (4 * w)) * m * (A * w) ** 2 / 2
        return m * A * w * q[0] * np.sin(w * t) - square

    return replace(
        twin,
        kinetic=None,
        draw=lambda q, t: draw(q[0], max(abs(start), abs(end))),
        facts=replace(twin.facts, twin="oscillating_wall", gauge=gauge),
    )
