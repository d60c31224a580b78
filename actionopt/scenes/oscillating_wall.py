r"""A mass on a spring whose wall is shaken.

    |<-- X = A cos(w t)
    |
    |/\/\/\/\/[ m ]
    |           |--> x

x is measured from the moving wall, beyond the rest length.
"""

from __future__ import annotations

import numpy as np

from actionopt.scenes._scene import Facts, Setup, Words, conjugates, curve
from actionopt.scenes.oscillator import draw

TITLE = "spring on an oscillating wall"
SOURCE = "Competitive Physics: Mechanics and Waves (2018), section 12.3.2, p. 633"
WORDS = Words(
    question="The wall that a spring hangs on is shaken. What does the mass feel?",
    answer=(
        "A force that swings with the wall: the Lagrangian has it without any force being put in."
    ),
    look=(
        "The wall moves by itself; the mass does not follow it, for the wall shakes faster than "
        "the spring swings."
    ),
    captions={
        "motion": "Wall and mass at equal times: the two do not move in step.",
        "path": "The distance from the wall first grows a little, then falls through zero.",
        "conserved": (
            "Nothing is conserved: the wall does work on the mass, now positive, now negative."
        ),
    },
    beside=("driven_oscillator", "oscillator"),
)


def lagrangian(q, v, t, *, m, k, A, w):
    """L = m (x' - A w sin(w t))^2 / 2 - k x^2 / 2: the wall moves as A cos(w t)."""
    return m * (v[0] - A * w * np.sin(w * t)) ** 2 / 2 - k * q[0] ** 2 / 2


def scene(*, m=1.0, k=4.0, A=0.3, w=3.0, start=0.5, end=-0.2, duration=1.2):
    """Join `start` and `end` (m) in `duration` (s) while the wall moves as A cos(w t) (m, rad/s).

    Raises ValueError at resonance, w^2 = k / m, and at conjugate ends.
    """
    foci = conjugates(np.sqrt(k / m), duration)
    exact, velocity = driven_motion(k / m, A * w**2, w, start, end, duration)
    return Setup(
        ["x"],
        duration,
        ends=([start], [end]),
        draw=lambda q, t: draw(q[0], max(abs(start), abs(end)) + abs(A), A * np.cos(w * t)),
        kinetic=lambda q, v, t: m * (v[0] - A * w * np.sin(w * t)) ** 2 / 2,
        exact=exact,
        facts=Facts(
            velocity=velocity,
            acceleration=lambda q, v, t: -(k / m) * q + A * w**2 * np.cos(w * t),
            **foci,
        ),
    )


def driven_motion(stiffness: float, B: float, w: float, start: float, end: float, T: float):
    """Return x(t) and x'(t) of x'' = -stiffness x + B cos wt from `start` to `end` in T.

    Raises ValueError at resonance, w^2 = stiffness.
    """
    w0 = np.sqrt(stiffness)
    s = np.sin(w0 * T)
    if abs(w**2 - stiffness) < 1e-9 * stiffness:
        raise ValueError(f"expected a drive off the resonance w = {w0}, found w = {w}")
    C = B / (stiffness - w**2)
    x0, x1 = start - C, end - C * np.cos(w * T)
    exact = curve(
        lambda t: [(x0 * np.sin(w0 * (T - t)) + x1 * np.sin(w0 * t)) / s + C * np.cos(w * t)]
    )
    velocity = curve(
        lambda t: [
            w0 * (x1 * np.cos(w0 * t) - x0 * np.cos(w0 * (T - t))) / s - C * w * np.sin(w * t)
        ]
    )
    return exact, velocity
