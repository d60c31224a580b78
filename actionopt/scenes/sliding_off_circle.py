r"""A mass that slides down a fixed circle and would leave it.

         _ o_  m
      .'   | \'.             theta from the upward vertical
     /     |R  \             gravity g downward
    |      *    |

The multiplier is the normal force: once it is negative the surface would have to pull.
"""

import numpy as np

from actionopt.scenes._scene import Facts, Setup, Words, curve
from actionopt.scenes._shapes import body, circle

TITLE = "mass sliding off a fixed circle"
SOURCE = "Competitive Physics: Mechanics and Waves (2018), section 12.4, p. 641"
WORDS = Words(
    question="A mass slides down a ball. Where does it leave it?",
    answer=(
        "Where the normal force vanishes: at two thirds of the height, whatever the mass or the "
        "radius."
    ),
    look=(
        "The arrow is the force of the surface. It shrinks, vanishes, and then points inward: "
        "there the surface would have to pull."
    ),
    captions={
        "motion": (
            "Towards the end the arrow points inward: a real surface cannot pull, and the mass "
            "would fly off."
        ),
        "path": "The radius is held; the angle runs away from the top faster and faster.",
        "conserved": (
            "The energy is conserved; the momentum of r is zero because the radius is held, not "
            "by a symmetry."
        ),
    },
    beside=("polar_pendulum",),
)


def lagrangian(q, v, t, *, m, g):
    """L = m (r'^2 + r^2 theta'^2) / 2 - m g r cos theta."""
    r, theta = q
    u, w = v
    return m * (u**2 + (r * w) ** 2) / 2 - m * g * r * np.cos(theta)


def constraint(q, t, *, R):
    """Hold f = r - R = 0."""
    return q[0] - R


def scene(*, m=1.0, R=1.0, g=9.81, start=0.1, duration=0.75):
    """Pass the angle `start` (rad), having left the top at rest long ago, and slide on.

    tan(theta / 4) grows as exp(t sqrt(g / R)): the motion on which theta'^2 =
    2 g / R (1 - cos theta). m in kg, R in m. The facts have the angle and the time at which
    the normal force vanishes, `contact_angle` = arccos(2/3) and `contact_time` (s); by default
    that is before the end.
    """
    W, first = np.sqrt(g / R), np.tan(start / 4)
    lost = float(np.arccos(2 / 3))

    def theta(t):
        return 4 * np.arctan(first * np.exp(W * t))

    def normal(q, v, t):
        return (m * g * np.cos(q[1]) - m * R * v[1] ** 2)[None]

    def energy(q, v, t):
        return m * (v[0] ** 2 + (q[0] * v[1]) ** 2) / 2 + m * g * q[0] * np.cos(q[1])

    return Setup(
        ["r", "theta"],
        duration,
        draw=lambda q, t: [circle(R), body((q[0] * np.sin(q[1]), q[0] * np.cos(q[1])))],
        exact=curve(lambda t: (R + 0 * t, theta(t))),
        facts=Facts(
            velocity=curve(lambda t: (0 * t, 2 * W * np.sin(theta(t) / 2))),
            multipliers=normal,
            energy=m * g * R,
            conserved={"energy": energy},
            numbers={
                "contact_angle": lost,
                "contact_time": float(np.log(np.tan(lost / 4) / first) / W),
            },
        ),
    )
