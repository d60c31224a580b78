r"""Two bodies under their mutual gravity, their centre of mass drifting.

      o m1
       \
        + ->  drift
         \
          O m2

The relative position moves on a Kepler ellipse.
"""

import numpy as np

from actionopt.scenes._scene import Facts, Setup, Words, curve
from actionopt.scenes._shapes import body
from actionopt.scenes.kepler import Ellipse

TITLE = "two bodies and their mutual gravity"
SOURCE = (
    "Competitive Physics: Mechanics and Waves (2018), section 12.5, p. 642; Goldstein, "
    "Classical Mechanics (3rd ed. 2002), section 3.1"
)
WORDS = Words(
    question="Two bodies attract each other. Does either move on an ellipse?",
    answer="Each does about their centre of mass, once the drift of that is taken out.",
    look=(
        "The lighter body swings wide and the heavier one little; together they drift to the right."
    ),
    captions={
        "motion": "Both trails bend around a point between the bodies that moves evenly.",
        "path": (
            "Four coordinates; their difference is a Kepler ellipse and their mean, weighted by "
            "mass, a straight line."
        ),
        "conserved": "No single momentum is conserved, but the sum of both along each axis is.",
    },
    beside=("kepler", "figure_eight"),
)


def lagrangian(q, v, t, *, m1, m2, G):
    """L = m1 v1^2 / 2 + m2 v2^2 / 2 + G m1 m2 / |r1 - r2|."""
    x1, y1, x2, y2 = q
    u1, w1, u2, w2 = v
    kinetic = m1 * (u1**2 + w1**2) / 2 + m2 * (u2**2 + w2**2) / 2
    return kinetic + G * m1 * m2 / np.sqrt((x1 - x2) ** 2 + (y1 - y2) ** 2)


def scene(
    *, m1=1.0, m2=0.5, G=1.0, a=1.0, eccentricity=0.4, start=0.1, fraction=0.4, drift=(0.2, 0.1)
):
    """Follow both bodies for a `fraction` of the period, from `start` periods past periastron.

    Masses in kg, G in m^3/(kg s^2), semi-major axis a (m) of the relative motion, velocity
    `drift` (m/s) of the centre of mass. The facts have the `period` (s).
    """
    orbit = Ellipse(G * (m1 + m2), a, eccentricity, start)
    T, M = fraction * orbit.period, m1 + m2
    E = orbit.anomaly(np.array([0.0, T]))
    cx, cy = drift

    def apart(x, y):  # relative vector from body 1 to body 2
        return -m2 / M * x, -m2 / M * y, m1 / M * x, m1 / M * y

    def position(t):
        x1, y1, x2, y2 = apart(*orbit.position(t))
        return x1 + cx * t, y1 + cy * t, x2 + cx * t, y2 + cy * t

    def velocity(t):
        u1, w1, u2, w2 = apart(*orbit.velocity(t))
        return u1 + cx, w1 + cy, u2 + cx, w2 + cy

    def energy(q, v, t):
        kinetic = m1 * (v[0] ** 2 + v[1] ** 2) / 2 + m2 * (v[2] ** 2 + v[3] ** 2) / 2
        return kinetic - G * m1 * m2 / np.hypot(q[0] - q[2], q[1] - q[3])

    def turning(q, v, t):
        return m1 * (q[0] * v[1] - q[1] * v[0]) + m2 * (q[2] * v[3] - q[3] * v[2])

    centre = M * (cx**2 + cy**2) / 2
    reduced = m1 * m2 / M
    relative = orbit.energy * T + 2 * np.sqrt(orbit.mu * a) * (E[1] - E[0])  # as in `kepler`
    return Setup(
        ["x1", "y1", "x2", "y2"],
        T,
        draw=lambda q, t: [body(q[:2]), body(q[2:])],
        exact=curve(position),
        facts=Facts(
            velocity=curve(velocity),
            action=centre * T + reduced * relative,
            energy=centre + reduced * orbit.energy,
            conjugate_times=np.array([orbit.period]),
            conserved={
                "energy": energy,
                "momentum, x": lambda q, v, t: m1 * v[0] + m2 * v[2],
                "momentum, y": lambda q, v, t: m1 * v[1] + m2 * v[3],
                "angular momentum": turning,
            },
            numbers={"period": orbit.period},
        ),
    )
