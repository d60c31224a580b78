r"""A mass on a spring.

    |
    |/\/\/\/\/[ m ]            k
    |           |--> x

x is measured from where the spring is slack.
"""

from __future__ import annotations

import numpy as np

from actionopt.scenes._scene import Facts, Setup, Words, conjugates, curve
from actionopt.scenes._shapes import body, ground, spring

TITLE = "harmonic oscillator"
SOURCE = (
    "Feynman and Hibbs, Quantum Mechanics and Path Integrals (1965), problem 2-2; "
    "Competitive Physics: Mechanics and Waves (2018), section 12.2"
)
WORDS = Words(
    question=(
        "A mass on a spring has to be at two places at two times. Is its action the least there is?"
    ),
    answer=(
        "Here yes, because the motion lasts less than half a period. After that it would be a "
        "saddle."
    ),
    look="The mass swings out to more than twice the distance it starts from, and comes back.",
    captions={
        "motion": "Out and back along one line: the pictures crowd at the turning point.",
        "path": (
            "A piece of a sine: it starts upward, for the end comes later than the turning point."
        ),
        "conserved": "H is conserved; p is not, it falls evenly with the area under x.",
    },
    beside=("oscillator_gauge", "oscillator_2d", "damped_oscillator", "driven_oscillator"),
)


def lagrangian(q, v, t, *, m, k):
    """L = m x'^2 / 2 - k x^2 / 2."""
    return m * v[0] ** 2 / 2 - k * q[0] ** 2 / 2


def scene(*, m=1.0, k=1.0, start=1.0, end=0.5, duration=2.5):
    """Carry a mass m (kg) on a spring k (N/m) from `start` to `end` (m) in `duration` (s).

    With w = sqrt(k / m), the path is a minimum of the action for durations below pi / w and a
    saddle above. Raises ValueError if the duration is a multiple of pi / w: then no path or
    infinitely many join the events.
    """
    T, w = duration, float(np.sqrt(k / m))
    foci = conjugates(w, T)
    c, s = np.cos(w * T), np.sin(w * T)
    return Setup(
        ["x"],
        T,
        ends=([start], [end]),
        draw=lambda q, t: draw(q[0], reach=max(abs(start), abs(end))),
        exact=curve(lambda t: [(start * np.sin(w * (T - t)) + end * np.sin(w * t)) / s]),
        facts=Facts(
            velocity=curve(lambda t: [w * (end * np.cos(w * t) - start * np.cos(w * (T - t))) / s]),
            acceleration=lambda q, v, t: -(k / m) * q,
            action=m * w / (2 * s) * ((start**2 + end**2) * c - 2 * start * end),
            energy=k / 2 * (start**2 + end**2 - 2 * start * end * c) / s**2,
            **foci,
            conserved={"energy": lambda q, v, t: m * v[0] ** 2 / 2 + k * q[0] ** 2 / 2},
        ),
    )


def draw(x: float, reach: float, wall: float = 0.0):
    """Draw a mass `x` from where its spring is slack; the wall stands two reaches to the left."""
    foot = wall - 2 * reach
    return [
        ground((foot, -reach / 4), (foot, reach / 4)),
        spring((foot, 0.0), (wall + x, 0.0)),
        body((wall + x, 0.0)),
    ]
