"""A body falling through air, towards its terminal speed.

      o      s: depth, downward
      |
      v      drag force -c v |v|, gravity g

The drag enters as virtual work.
"""

import numpy as np

from actionopt.scenes._scene import Facts, Setup, Words, curve
from actionopt.scenes._shapes import body, ground

TITLE = "fall with quadratic drag"
SOURCE = "Competitive Physics: Mechanics and Waves (2018), section 12.3, eq. (12.3), p. 627"
WORDS = Words(
    question="A stone falls through the air. How close does it come to its terminal speed?",
    answer="Very close within a second and a half: it arrives at 98 per cent of it.",
    look="The steps between equal times grow at first, and are nearly equal at the end.",
    captions={
        "motion": (
            "At the end the stone covers nearly the same distance in each step: its speed has "
            "settled."
        ),
        "path": "The curve of depth starts as a parabola and ends all but straight.",
        "conserved": (
            "H falls ever faster, in the end at the rate at which the drag turns the work of "
            "gravity into heat."
        ),
    },
    beside=("drag_linear", "projectile"),
)


def lagrangian(q, v, t, *, m, g):
    """L = m s'^2 / 2 + m g s."""
    return m * v[0] ** 2 / 2 + m * g * q[0]


def force(q, v, t, *, c):
    """Q = -c s' |s'|."""
    return [-c * v[0] * np.abs(v[0])]


def scene(*, m=1.0, g=9.81, c=0.2, since=0.1, duration=1.5):
    """Fall for `duration` (s) from `since` (s) after being let go; c in kg/m.

    The facts have the `terminal_speed` sqrt(m g / c) (m/s).
    """
    terminal = np.sqrt(m * g / c)
    rate = g / terminal
    exact = curve(lambda t: [m / c * np.log(np.cosh(rate * (t + since)))])
    depth = 1.1 * float(exact(duration)[0])
    return Setup(
        ["s"],
        duration,
        draw=lambda q, t: [ground((0.0, 0.0), (0.0, -depth)), body((0.0, -q[0]))],
        exact=exact,
        facts=Facts(
            velocity=curve(lambda t: [terminal * np.tanh(rate * (t + since))]),
            acceleration=lambda q, v, t: g - c / m * v * np.abs(v),
            conserved={  # while it falls
                "exp(2 c s / m) (m g - c s'^2)": lambda q, v, t: (
                    np.exp(2 * c * q[0] / m) * (m * g - c * v[0] ** 2)
                ),
            },
            numbers={"terminal_speed": terminal},
        ),
    )
