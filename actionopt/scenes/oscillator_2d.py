r"""A particle bound to a centre by equal springs in every direction of the plane.

    y |    . o
      |  .   | k r
      | .    v
      *------------ x

Its paths are ellipses about the centre.
"""

import numpy as np

from actionopt.scenes._scene import Facts, Setup, Words, conjugates
from actionopt.scenes._shapes import body, ground, spring
from actionopt.scenes.rotating_frame_bound import turned_curves

TITLE = "two-dimensional oscillator"
SOURCE = "Competitive Physics: Mechanics and Waves (2018), section 12.5.4, p. 646"
WORDS = Words(
    question="A particle is drawn to a centre by springs. What curve does it follow?",
    answer="An ellipse about the centre: both coordinates swing with the same period.",
    look=(
        "The particle moves on an ellipse whose middle is the centre, not a focus as for a planet."
    ),
    captions={
        "motion": "A part of an ellipse, faster near the centre than far from it.",
        "path": "Two sines of one frequency, one for each coordinate.",
        "conserved": (
            "H is conserved and neither momentum is; the angular momentum is, which no single "
            "coordinate shows."
        ),
    },
    beside=("oscillator", "rotating_frame_bound"),
)


def lagrangian(q, v, t, *, m, k):
    """L = m (x'^2 + y'^2) / 2 - k (x^2 + y^2) / 2."""
    x, y = q
    vx, vy = v
    return m * (vx**2 + vy**2) / 2 - k * (x**2 + y**2) / 2


def scene(*, m=1.0, k=2.0, start=(1.0, 0.0), end=(-0.3, 0.6), duration=1.5):
    """Join two points (m) in `duration` (s).

    Raises ValueError if the duration is a multiple of half the period.
    """
    T, w = duration, float(np.sqrt(k / m))
    foci = conjugates(w, T, multiplicity=2)
    c, s = np.cos(w * T), np.sin(w * T)
    exact, velocity = turned_curves(w, 0.0, start, end, T)
    squares, product = np.dot(start, start) + np.dot(end, end), np.dot(start, end)
    return Setup(
        ["x", "y"],
        T,
        ends=(start, end),
        draw=lambda q, t: [ground((0.0, 0.0)), spring((0.0, 0.0), q), body(q)],
        exact=exact,
        facts=Facts(
            velocity=velocity,
            acceleration=lambda q, v, t: -(k / m) * q,
            action=m * w / (2 * s) * (squares * c - 2 * product),
            energy=k / 2 * (squares - 2 * product * c) / s**2,
            **foci,
            conserved={
                "energy": lambda q, v, t: m * np.sum(v**2, 0) / 2 + k * np.sum(q**2, 0) / 2,
                "angular momentum": lambda q, v, t: m * (q[0] * v[1] - q[1] * v[0]),
            },
        ),
    )
