r"""A bead on a vertical hoop that turns about its upright diameter.

        .-|-.
       /  |  \            hoop turns at w
      |   *   |           theta from the bottom
       \  |\ /
        '-|-o             gravity g downward

H is constant, but it is not the energy: whatever turns the hoop does work.
"""

import numpy as np

from actionopt.scenes._scene import Facts, Setup, Words, curve
from actionopt.scenes._shapes import body, circle, ground

TITLE = "bead on a rotating hoop"
SOURCE = (
    "Competitive Physics: Mechanics and Waves (2018), section 12.5.1, p. 642; Goldstein, "
    "Classical Mechanics (3rd ed. 2002), chapter 2, exercise 18"
)
WORDS = Words(
    question="A bead on a hoop that turns: what does it do if the hoop turns fast enough?",
    answer="It leaves the bottom, climbs and falls back: the bottom has become unstable.",
    look="The bead climbs past the angle at which it could rest, turns, and comes back.",
    captions={
        "motion": "Up and back on the rotating hoop, seen by someone who turns with it.",
        "path": "The bead goes as high as its conserved H allows, and turns before the end.",
        "conserved": "H is conserved although T + V is not: whatever turns the hoop does work.",
    },
    beside=("pendulum", "turning_wire_radial"),
)


def lagrangian(q, v, t, *, m, R, g, w):
    """L = m R^2 (theta'^2 + w^2 sin(theta)^2) / 2 + m g R cos theta."""
    theta, u = q[0], v[0]
    return m * R**2 * (u**2 + (w * np.sin(theta)) ** 2) / 2 + m * g * R * np.cos(theta)


def scene(*, m=1.0, R=0.5, g=9.81, w=6.0, since=-0.4, duration=0.7):
    """Climb out of the bottom and fall back, from `since` (s) after the highest point.

    tan(theta / 2) = n / p sech(n t), n^2 = w^2 - g / R and p^2 = g / R: the motion that left
    the bottom at rest long ago. The facts have the angle of rest `rest_angle`, arccos(g /
    (R w^2)), and the frequency `oscillation` = w sin(rest angle) (rad/s) about it. Raises
    ValueError if the hoop turns too slowly for either, w^2 <= g / R.
    """
    if w**2 <= g / R:
        raise ValueError(f"expected w above sqrt(g / R) = {np.sqrt(g / R)}, found {w}")
    p, n = np.sqrt(g / R), np.sqrt(w**2 - g / R)

    def theta(t):
        return 2 * np.arctan(n / p / np.cosh(n * (t + since)))

    def rate(t):  # d tan(theta / 2) = (1 + tan^2) theta' / 2 dt
        return -n * np.tanh(n * (t + since)) * np.sin(theta(t))

    knots = np.sort(np.clip([0.0, -since, duration], 0.0, duration))
    rest = np.arccos(g / (R * w**2))
    return Setup(
        ["theta"],
        duration,
        draw=lambda q, t: [
            circle(R),
            ground((0.0, -1.2 * R), (0.0, 1.2 * R)),
            body((R * np.sin(q[0]), -R * np.cos(q[0]))),
        ],
        kinetic=lambda q, v, t: m * R**2 * (v[0] ** 2 + (w * np.sin(q[0])) ** 2) / 2,
        exact=curve(lambda t: [theta(t)]),
        facts=Facts(
            velocity=curve(lambda t: [rate(t)]),
            acceleration=lambda q, v, t: (w**2 * np.cos(q) - g / R) * np.sin(q),
            energy=-m * g * R,
            conserved={
                "energy in the turning frame": lambda q, v, t: (
                    m * R**2 * (v[0] ** 2 - (w * np.sin(q[0])) ** 2) / 2 - m * g * R * np.cos(q[0])
                ),
            },
            numbers={"rest_angle": rest, "oscillation": w * np.sin(rest)},
        ),
        # Less of an arc has less action: a lower path joins the events as well.
        guess=curve(lambda t: [np.interp(t, knots, theta(knots))]),
    )
