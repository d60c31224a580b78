r"""A pendulum whose pivot is pulled aside with uniform acceleration.

    --+--> X = a t^2 / 2
      |\
      | \  l
 theta|  \
      |   o  m              gravity g downward

In the frame of the pivot gravity is tilted: the pendulum swings about -arctan(a / g).
"""

import numpy as np

from actionopt.scenes import pendulum
from actionopt.scenes._scene import Facts, Setup, Words, curve

TITLE = "pendulum with an accelerated pivot"
SOURCE = (
    "Competitive Physics: Mechanics and Waves (2018), section 12.3.1, eq. (12.4), p. 628; Landau "
    "and Lifshitz, Mechanics (3rd ed. 1976), section 5, problem 3"
)
WORDS = Words(
    question=(
        "The pivot of a pendulum is pulled aside ever faster. Where does the pendulum hang at rest?"
    ),
    answer="Tilted backwards, along the gravity that is felt in the frame of the pivot.",
    look=(
        "The pivot runs away to the right; the rod swings about a line that is tilted to the left."
    ),
    captions={
        "motion": (
            "From one picture to the next the pivot moves farther: it is accelerated uniformly."
        ),
        "path": "The angle runs from one side of the tilt to the other and back.",
        "conserved": "Nothing is conserved: the pivot is pulled, and whoever pulls does work.",
    },
    beside=("pendulum", "oscillating_wall"),
)


def lagrangian(q, v, t, *, m, l, g, a):
    """L = m ((a t + l theta' cos theta)^2 + (l theta' sin theta)^2) / 2 + m g l cos theta."""
    theta, u = q[0], v[0]
    vx = a * t + l * u * np.cos(theta)
    vy = l * u * np.sin(theta)
    return m * (vx**2 + vy**2) / 2 + m * g * l * np.cos(theta)


def scene(*, m=1.0, l=1.0, g=9.81, a=3.0, amplitude=0.8, since=0.1, duration=0.9):
    """Swing by `amplitude` (rad) about the tilt, from `since` (s) after passing it forward.

    a in m/s^2; the facts have the `tilt` (rad), arctan(a / g).
    """
    tilt, strength = np.arctan2(a, g), np.hypot(a, g)
    swing, rate = pendulum.motion(strength / l, amplitude, since)
    return Setup(
        ["theta"],
        duration,
        draw=lambda q, t: pendulum.draw(l, q[0], (a * t**2 / 2, 0.0)),
        kinetic=lambda q, v, t: (
            m * ((a * t + l * v[0] * np.cos(q[0])) ** 2 + (l * v[0] * np.sin(q[0])) ** 2) / 2
        ),
        exact=curve(lambda t: [swing(t) - tilt]),
        facts=Facts(
            velocity=curve(lambda t: [rate(t)]),
            acceleration=lambda q, v, t: -(g * np.sin(q) + a * np.cos(q)) / l,
            conserved={
                "energy in tilted gravity": lambda q, v, t: (
                    m * (l * v[0]) ** 2 / 2 - m * l * (g * np.cos(q[0]) - a * np.sin(q[0]))
                ),
            },
            numbers={"tilt": tilt},
        ),
    )
