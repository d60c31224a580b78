r"""A plane pendulum, by its angle.

        -----+-----
             |\
             | \  l
             |  \
             |   \
         theta    o  m

Gravity g points downward; theta is measured from straight down.
"""

from __future__ import annotations

import numpy as np

from actionopt.scenes._elliptic import complete, jacobi
from actionopt.scenes._scene import Facts, Setup, Words, curve
from actionopt.scenes._shapes import body, ground, rod

TITLE = "plane pendulum with a large swing"
SOURCE = (
    "Competitive Physics: Mechanics and Waves (2018), section 12.4, p. 640; "
    "Whittaker, Analytical Dynamics (4th ed. 1937), section 44, for the elliptic functions"
)
WORDS = Words(
    question=("A pendulum swings up past where it started. Does it obey the same law as a spring?"),
    answer="Nearly, for small swings. The force is a sine, and wide swings take longer.",
    look="The bob slows down, stops for an instant at the top of its swing, and falls back.",
    captions={
        "motion": "The pictures crowd at the turning point, where the bob is slow.",
        "path": (
            "The angle rises to 0.79 rad and falls through zero; its curve is flatter at the "
            "top than a sine."
        ),
        "conserved": (
            "H is conserved; the momentum of the angle is not, for gravity has a torque."
        ),
    },
    beside=("rod_pendulum", "polar_pendulum", "double_pendulum", "moving_pivot", "hoop_bead"),
)


def lagrangian(q, v, t, *, m, l, g):
    """L = m (l theta')^2 / 2 + m g l cos theta."""
    return m * (l * v[0]) ** 2 / 2 + m * g * l * np.cos(q[0])


def scene(
    *, m=1.0, l=1.0, g=9.81, amplitude=0.7916850338091145, since=0.12755488176729738, duration=1.0
):
    """Swing with the given `amplitude` (rad), from `since` (s) after the lowest point upward.

    m in kg, l in m, g in m/s^2. By default from 0.3 to -0.2 rad in one second, as far as
    rounding lets; the facts have the `period` (s).
    """
    theta, rate = motion(g / l, amplitude, since)
    T, k, w = duration, np.sin(amplitude / 2), np.sqrt(g / l)
    integral = np.diff(jacobi(w * (since + np.array([0.0, T])), k)[3])[0]
    energy = -m * g * l * np.cos(amplitude)
    # T = 2 m g l k^2 cn^2, and k^2 cn^2 = dn^2 - (1 - k^2); S is the integral of 2 T - H.
    doubled = 4 * m * g * l * (integral / w - (1 - k**2) * T)
    return Setup(
        ["theta"],
        T,
        draw=lambda q, t: draw(l, q[0]),
        exact=curve(lambda t: [theta(t)]),
        facts=Facts(
            velocity=curve(lambda t: [rate(t)]),
            acceleration=lambda q, v, t: -(g / l) * np.sin(q),
            action=doubled - energy * T,
            energy=energy,
            conserved={
                "energy": lambda q, v, t: m * (l * v[0]) ** 2 / 2 - m * g * l * np.cos(q[0])
            },
            numbers={"period": 4 * complete(k) / w},
        ),
    )


def motion(stiffness: float, amplitude: float, since: float):
    """Return theta(t) and theta'(t) of theta'' = -stiffness sin theta, swinging.

    sin(theta / 2) = k sn(w (t + since)), theta' = 2 k w cn, with w^2 = stiffness (1/s^2) and
    k = sin(amplitude / 2). Raises ValueError unless the amplitude lies between 0 and pi.
    """
    if not 0.0 < amplitude < np.pi:
        raise ValueError(f"expected an amplitude between 0 and pi radians, found {amplitude}")
    w, k = float(np.sqrt(stiffness)), float(np.sin(amplitude / 2))

    def theta(t):
        return 2 * np.arcsin(k * jacobi(w * (t + since), k)[0])

    def rate(t):
        return 2 * k * w * jacobi(w * (t + since), k)[1]

    return theta, rate


def draw(l: float, theta: float, pivot=(0.0, 0.0)):
    """Draw a rod of length l that hangs at `theta` from its pivot."""
    end = (pivot[0] + l * np.sin(theta), pivot[1] - l * np.cos(theta))
    return [ground(pivot), rod(pivot, end), body(end)]
