r"""A cylinder rolling straight down a slope.

    ( o )_              x: distance down the slope
   ------  `-_          phi: angle turned, x = R phi
               `-_
   angle of slope  `

Rolling along one line integrates to a condition on positions; friction is its multiplier.
"""

import numpy as np

from actionopt.scenes._scene import Facts, Setup, Words, curve
from actionopt.scenes._shapes import body, circle, ground, rod

TITLE = "cylinder rolling down a slope without slipping"
SOURCE = "Competitive Physics: Mechanics and Waves (2018), section 12.4, p. 634"
WORDS = Words(
    question="What makes a cylinder roll rather than slide?",
    answer=(
        "Friction up the slope: it takes a part of the weight's pull and turns the cylinder "
        "with it."
    ),
    look="The cylinder first rolls a little uphill, stops, and rolls down ever faster.",
    captions={
        "motion": "The spoke shows the turn: the distance rolled is the angle times the radius.",
        "path": "Distance and angle are the same parabola, in different units.",
        "conserved": (
            "Neither momentum is conserved: gravity pulls, and friction passes a part of it on "
            "to the turn."
        ),
    },
    beside=("sliding_wedge",),
)


def lagrangian(q, v, t, *, m, R, inertia, angle, g):
    """L = m x'^2 / 2 + I phi'^2 / 2 + m g x sin(angle), with I = inertia m R^2."""
    x, _ = q
    u, w = v
    return m * (u**2 + inertia * (R * w) ** 2) / 2 + m * g * x * np.sin(angle)


def constraint(q, t, *, R):
    """Hold f = x - R phi = 0."""
    x, phi = q
    return x - R * phi


def scene(*, m=1.0, R=0.2, inertia=0.5, angle=0.3, g=9.81, start=0.0, end=1.0, duration=1.2):
    """Roll from `start` to `end` (m) in `duration` (s); moment of inertia `inertia` m R^2.

    The facts have the uniform `rolling_acceleration` (m/s^2) and the `friction` (N), which is
    the multiplier: negative, up the slope.
    """
    a = g * np.sin(angle) / (1 + inertia)
    u = (end - start) / duration - a * duration / 2

    def down(t):
        return start + u * t + a * t**2 / 2

    def energy(q, v, t):
        return m * (v[0] ** 2 + inertia * (R * v[1]) ** 2) / 2 - m * g * q[0] * np.sin(angle)

    def draw(q, t):
        c, s = np.cos(angle), np.sin(angle)
        center = q[0] * np.array([c, -s])
        spoke = R * np.stack([np.sin(q[1]), np.cos(q[1])])
        foot = -R * np.array([s, c])
        far = 1.2 * max(abs(start), abs(end)) * np.array([c, -s])
        slope = ground(foot - far / 4, foot + far)
        rim = rod(*circle(R, center).points.T)
        return [slope, rim, rod(center - spoke, center + spoke), body(center)]

    return Setup(
        ["x", "phi"],
        duration,
        ends=([start, start / R], [end, end / R]),
        draw=draw,
        exact=curve(lambda t: (down(t), down(t) / R)),
        facts=Facts(
            velocity=curve(lambda t: (u + a * t, (u + a * t) / R)),
            acceleration=lambda q, v, t: np.stack([a + 0 * v[0], a / R + 0 * v[0]]),
            multipliers=lambda q, v, t: (-m * inertia * a + 0 * v[0])[None],
            morse_index=0,
            conserved={"energy": energy},
            numbers={"rolling_acceleration": a, "friction": -m * inertia * a},
        ),
    )
