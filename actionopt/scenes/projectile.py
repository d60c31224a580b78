"""A projectile without air.

    y |      . o .
      |   .         .
      | o             o
      +------------------ x

Gravity g points downward; there is no air.
"""

import numpy as np

from actionopt.scenes._scene import Facts, Setup, Words, curve
from actionopt.scenes._shapes import body, ground

TITLE = "projectile in uniform gravity"
SOURCE = "Competitive Physics: Mechanics and Waves (2018), section 12.3, eq. (12.3), p. 627"
WORDS = Words(
    question="A ball is thrown and arrives a second later. Why on a parabola?",
    answer=(
        "Sideways nothing acts, so it moves evenly; upwards gravity bends the curve by the same "
        "amount all the time."
    ),
    look="Sideways the ball covers the same distance in every step; upwards it does not.",
    captions={
        "motion": "Equal steps sideways, and a height that follows a parabola.",
        "path": "One coordinate is a straight line in time, the other a parabola.",
        "conserved": (
            "The momentum along x is conserved, for x is missing from L; that along y falls evenly."
        ),
    },
    beside=("drag_linear", "rotating_frame_free"),
)


def lagrangian(q, v, t, *, m, g):
    """L = T - V = m (x'^2 + y'^2) / 2 - m g y."""
    _, y = q
    vx, vy = v
    return m * (vx**2 + vy**2) / 2 - m * g * y


def scene(*, m=1.0, g=9.81, start=(0.0, 0.0), end=(3.0, 1.0), duration=1.0):
    """Throw a mass m (kg) from `start` to `end` (m) in `duration` (s), with g in m/s^2."""
    (x0, y0), (x1, y1), T = start, end, duration
    ux, uy = (x1 - x0) / T, (y1 - y0) / T
    return Setup(
        ["x", "y"],
        T,
        ends=(start, end),
        draw=lambda q, t: [ground(start), ground(end), body(q)],
        exact=curve(lambda t: (x0 + ux * t, y0 + uy * t + g * t * (T - t) / 2)),
        facts=Facts(
            velocity=curve(lambda t: (ux, uy + g * (T / 2 - t))),
            acceleration=lambda q, v, t: np.stack([0 * v[0], 0 * v[1] - g]),
            action=m * T * ((ux**2 + uy**2) / 2 - g * (y0 + y1) / 2 - g**2 * T**2 / 24),
            energy=m * (ux**2 + (uy + g * T / 2) ** 2) / 2 + m * g * y0,
            morse_index=0,
            conserved={
                "horizontal momentum": lambda q, v, t: m * v[0],
                "energy": lambda q, v, t: m * (v[0] ** 2 + v[1] ** 2) / 2 + m * g * q[1],
            },
        ),
    )
