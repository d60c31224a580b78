r"""A path between the tops of two hills: the kink, or instanton.

          _       _
         / \     / \
        * ->\___/-> o       a body that rolls from near one top to near the other
           -a   a

L = T - V with V = -k (a^2 - x^2)^2 / (8 a^2). With the sign of V turned it is tunnelling between
two wells in imaginary time, whose action is that of a whole kink: 2 m w a^2 / 3.
"""

import numpy as np

from actionopt.scenes._scene import Facts, Setup, Words, curve
from actionopt.scenes._shapes import body, ground

TITLE = "kink between two hills"
SOURCE = "Coleman, Aspects of Symmetry (1985), chapter 7, section 2.2, p. 270"
WORDS = Words(
    question="How long does a body with just enough energy take from one hilltop to another?",
    answer="For ever: near the tops it creeps, and the valley it crosses in a moment.",
    look="It leaves slowly, is fastest half way, at the bottom, and arrives as slowly.",
    beside=("pendulum", "vacuum_decay"),
)


def lagrangian(q, v, t, *, m, k, a):
    """L = m x'^2 / 2 + k (a^2 - x^2)^2 / (8 a^2)."""
    x = q[0]
    return m * v[0] ** 2 / 2 + k * (a**2 - x**2) ** 2 / (8 * a**2)


def scene(*, m=1.0, k=4.0, a=1.0, duration=5.0):
    """Cross in the middle of the time, with no energy to spare: x = a tanh(w (t - T / 2) / 2).

    w^2 = k / m. The facts have the action of a whole kink, `whole_action`.
    """
    w = np.sqrt(k / m)

    def x(t):
        return a * np.tanh(w * (t - duration / 2) / 2)

    end = x(duration)
    hills = np.linspace(-1.3 * a, 1.3 * a, 61)
    return Setup(
        ["x"],
        duration,
        draw=lambda q, t: [
            ground(*zip(hills, -((a**2 - hills**2) ** 2) / a**3, strict=True)),
            body((q[0], -((a**2 - q[0] ** 2) ** 2) / a**3)),
        ],
        exact=curve(lambda t: [x(t)]),
        facts=Facts(
            velocity=curve(lambda t: [w * (a**2 - x(t) ** 2) / (2 * a)]),
            acceleration=lambda q, v, t: -k / (2 * m * a**2) * q * (a**2 - q**2),
            action=m * w / a * (a**2 * end - end**3 / 3),
            energy=0.0,
            numbers={"whole_action": 2 * m * w * a**2 / 3},
        ),
    )
