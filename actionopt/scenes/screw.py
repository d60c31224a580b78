r"""A particle on a cylinder, in a potential wound round it like a thread.

      |/    /|
      |    / |            z along the axis, phi around it
      |   /  |            U = -k cos(phi - c z)
      |  o   |
      | /    |

Turning and climbing together, (phi, z) -> (phi + c d, z + d), changes nothing.
"""

import numpy as np

from actionopt.scenes import pendulum
from actionopt.scenes._scene import Facts, Setup, Words, curve
from actionopt.scenes._shapes import body, ground, rod

TITLE = "particle on a cylinder with a helical potential"
SOURCE = "Competitive Physics: Mechanics and Waves (2018), section 12.5.4, p. 645"
WORDS = Words(
    question="A potential is wound round a cylinder like a thread. What is conserved?",
    answer=(
        "Not the angular momentum and not the momentum along the axis, but one combination of "
        "the two."
    ),
    look="The particle swings across the thread while it climbs along with it.",
    captions={
        "motion": (
            "The groove winds round the cylinder; the particle crosses it and is turned back."
        ),
        "path": "Angle and height both change unevenly; one combination of them grows evenly.",
        "conserved": (
            "Neither momentum is conserved by itself: the symmetry is to turn and climb together."
        ),
    },
    beside=("pendulum", "heavy_top"),
)


def lagrangian(q, v, t, *, m, R, k, c):
    """L = m (R^2 phi'^2 + z'^2) / 2 + k cos(phi - c z)."""
    phi, z = q
    u, w = v
    return m * ((R * u) ** 2 + w**2) / 2 + k * np.cos(phi - c * z)


def scene(*, m=1.0, R=0.5, k=1.0, c=1.5, amplitude=1.2, since=0.2, climb=0.8, duration=0.8):
    """Swing across the thread as it climbs at `climb` (m/s); k in J, c in rad/m.

    phi - c z swings as a pendulum does, by `amplitude` (rad) from `since` (s) after crossing
    the groove; c R^2 phi + z moves uniformly, at `climb` (1 + c^2 R^2).
    """
    stretch = 1 + (c * R) ** 2
    swing, rate = pendulum.motion(k * stretch / (m * R**2), amplitude, since)

    def split(across, along):  # along = (c R^2 phi + z) / (1 + c^2 R^2)
        return across / stretch + c * along, along - c * R**2 * across / stretch

    exact = curve(lambda t: split(swing(t), climb * t))

    def energy(q, v, t):
        return m * ((R * v[0]) ** 2 + v[1] ** 2) / 2 - k * np.cos(q[0] - c * q[1])

    def place(phi, z):
        return R * np.sin(phi), -R * np.cos(phi), z  # phi = 0 is in front

    heights = exact(np.linspace(0.0, duration, 41))[1]
    low, high = float(np.min(heights)) - R / 2, float(np.max(heights)) + R / 2

    def draw(q, t):
        around = np.linspace(0.0, 2 * np.pi, 61)
        ends = [ground(*(place(phi, z) for phi in around)) for z in (low, high)]
        sides = [ground(place(phi, low), place(phi, high)) for phi in around[:-1:15] + np.pi / 2]
        groove = rod(*(place(c * z, z) for z in np.linspace(low, high, 60)))
        return [*ends, *sides, groove, body(place(*q))]

    return Setup(
        ["phi", "z"],
        duration,
        draw=draw,
        exact=exact,
        facts=Facts(
            velocity=curve(lambda t: split(rate(t), climb + 0 * t)),
            conserved={
                "energy": energy,
                "screw momentum": lambda q, v, t: m * (c * R**2 * v[0] + v[1]),
            },
        ),
    )
