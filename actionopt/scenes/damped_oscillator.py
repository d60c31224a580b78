r"""A mass on a spring in a viscous fluid: a force that no Lagrangian without time gives.

    |     ~ ~ ~
    |/\/\/\/\/[ m ] ~          k, drag force -b v
    |     ~ ~ ~ |--> x

The drag is -b x'.
"""

import numpy as np

from actionopt.scenes import oscillator
from actionopt.scenes._scene import Facts, Setup, Words, curve

TITLE = "oscillator with viscous drag"
SOURCE = "Competitive Physics: Mechanics and Waves (2018), section 12.3, eq. (12.3), p. 627"
WORDS = Words(
    question=(
        "A mass on a spring moves through oil. Is there an action that its path makes stationary?"
    ),
    answer=(
        "Not of this form: drag enters as a force of its own, and the equations of Lagrange and "
        "d'Alembert replace the principle."
    ),
    look="The mass swings out and comes back slower than it left at the same place.",
    captions={
        "motion": (
            "Out and back: on the way in the mass is slower at every place than on the way out."
        ),
        "path": (
            "Out to the turning point the mass hurries, for it has to arrive in time in spite "
            "of the drag."
        ),
        "conserved": (
            "Nothing is conserved: the drag takes energy all the time, and H falls to half of "
            "what it was."
        ),
    },
    beside=("oscillator", "drag_linear"),
)

lagrangian = oscillator.lagrangian


def force(q, v, t, *, b):
    """Q = -b x'."""
    return [-b * v[0]]


def scene(*, m=1.0, k=1.0, b=0.4, start=1.0, end=0.5, duration=2.5):
    """Join `start` and `end` (m) in `duration` (s) against the drag b (kg/s), weak or strong.

    Raises ValueError if the damping is critical, b^2 = 4 m k, or the ends are conjugate.
    """
    T, decay = duration, b / (2 * m)
    w = np.emath.sqrt(k / m - decay**2)  # imaginary when overdamped: sines become hyperbolic
    s = np.sin(w * T)
    if abs(s) < 1e-12:
        raise ValueError(
            "expected no critical damping, b^2 = 4 m k, and a duration that is no multiple of "
            f"pi / {w}, found b = {b} and duration = {T}; change either slightly"
        )

    def position(t):
        swing = start * np.sin(w * (T - t)) + end * np.exp(decay * T) * np.sin(w * t)
        return np.exp(-decay * t) * np.real(swing / s)

    def velocity(t):
        turn = -start * np.cos(w * (T - t)) + end * np.exp(decay * T) * np.cos(w * t)
        return np.exp(-decay * t) * np.real(w * turn / s) - decay * position(t)

    def decaying(q, v, t):
        return m * v[0] ** 2 / 2 + k * q[0] ** 2 / 2 + b * q[0] * v[0] / 2

    return Setup(
        ["x"],
        T,
        ends=([start], [end]),
        draw=lambda q, t: oscillator.draw(q[0], reach=max(abs(start), abs(end))),
        exact=curve(lambda t: [position(t)]),
        facts=Facts(
            velocity=curve(lambda t: [velocity(t)]),
            acceleration=lambda q, v, t: -(k * q + b * v) / m,
            # The energy of x exp(decay t), which is an undamped oscillator of frequency w.
            conserved={
                "undamped energy": lambda q, v, t: np.exp(2 * decay * t) * decaying(q, v, t)
            },
        ),
    )
