"""A projectile in a viscous fluid.

    y |      . o
      |   .       .
      | o           o         drag force -b v
      +------------------ x

Gravity g points downward; the drag enters as virtual work.
"""

import numpy as np

from actionopt.scenes import projectile
from actionopt.scenes._scene import Facts, Setup, Words, curve
from actionopt.scenes._shapes import body, ground

TITLE = "projectile with linear drag"
SOURCE = "Competitive Physics: Mechanics and Waves (2018), section 12.3, eq. (12.3), p. 627"
WORDS = Words(
    question="Thrown through a viscous fluid, does a ball come down as steeply as it went up?",
    answer="More steeply: drag has taken much of its sideways velocity by then.",
    look="The path is lopsided: its highest point lies past the middle of the way.",
    captions={
        "motion": "Equal times, unequal steps: the ball slows down sideways all the while.",
        "path": "The sideways velocity decays as an exponential; without drag it would stay.",
        "conserved": "The momentum along x falls, as drag takes it; H falls with it.",
    },
    beside=("projectile", "drag_quadratic"),
)

lagrangian = projectile.lagrangian


def force(q, v, t, *, b):
    """Q = -b v."""
    vx, vy = v
    return [-b * vx, -b * vy]


def scene(*, m=1.0, g=9.81, b=0.5, start=(0.0, 0.0), end=(3.0, 1.0), duration=1.0):
    """Throw from `start` to `end` (m) in `duration` (s) against the drag b (kg/s)."""
    T, c = duration, b / m
    x0, y0 = start
    ux = (end[0] - x0) / -np.expm1(-c * T)
    uy = (end[1] - y0 + g * T / c) / -np.expm1(-c * T)
    return Setup(
        ["x", "y"],
        T,
        ends=(start, end),
        draw=lambda q, t: [ground(start), ground(end), body(q)],
        exact=curve(lambda t: (x0 - ux * np.expm1(-c * t), y0 - uy * np.expm1(-c * t) - g * t / c)),
        facts=Facts(
            velocity=curve(lambda t: (c * ux * np.exp(-c * t), c * uy * np.exp(-c * t) - g / c)),
            acceleration=lambda q, v, t: np.stack([-c * v[0], -c * v[1] - g]),
            conserved={
                "m x' + b x": lambda q, v, t: m * v[0] + b * q[0],
                "m y' + b y + m g t": lambda q, v, t: m * v[1] + b * q[1] + m * g * t,
            },
        ),
    )
