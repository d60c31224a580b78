r"""A probe between two stars, a quarter of the way round an orbit about the point between them.

                   o
                .'
      O        *   +              O
     star                        star

In coordinates that turn with both, mirror images of the arc make the orbit.
"""

import numpy as np

from actionopt.mechanics.question.events import State
from actionopt.scenes._scene import Facts, Setup, Words
from actionopt.scenes._shapes import body, ground

TITLE = "a quarter of a Lyapunov orbit between two stars"
SOURCE = (
    "Szebehely, Theory of Orbits (1967), chapters 8 and 9 (the Copenhagen problem, the point L1); "
    "the orbit's numbers by integrating it from one crossing of an axis at a right angle to the "
    "next"
)
WORDS = Words(
    question="Can a probe stay where the pulls of two stars balance?",
    answer="Near there: it goes round that point, and mirror images of the arc make the orbit.",
    look="It leaves the line between the stars at a right angle, and meets the other axis so.",
    beside=("rotating_frame_bound", "henon_heiles", "figure_eight"),
)

# At unit distance and mu: how far it crosses the axes from the middle, the period, S over it.
ORBIT_NEAR, ORBIT_FAR = 0.039940550658995384, 0.17159161129259726
ORBIT_PERIOD, ORBIT_ACTION, ORBIT_ENERGY = 2.3112249200870445, 4.615694735459387, -1.9


def lagrangian(q, v, t, *, mu, D):
    """L = T - V of a probe of unit mass in coordinates that turn at the rate w of both stars.

    L = ((x' - w y)^2 + (y' + w x)^2) / 2 + mu / (2 X) + mu / (2 Y), with w = sqrt(mu / D^3),
    with X = sqrt((x + D / 2)^2 + y^2), with Y = sqrt((x - D / 2)^2 + y^2), for unit mass.
    """
    x, y = q
    w = np.sqrt(mu / D**3)
    return ((v[0] - w * y) ** 2 + (v[1] + w * x) ** 2) / 2 - potential(x, y, mu, D)


def potential(x, y, mu, D):
    """Return the potential of two stars of mu / 2 each, at -D / 2 and D / 2 on the x axis."""
    one, other = np.sqrt((x + D / 2) ** 2 + y**2), np.sqrt((x - D / 2) ** 2 + y**2)
    return -mu / (2 * one) - mu / (2 * other)


def scene(*, mu=1.0, D=1.0):
    """Go a quarter round at the energy -1.9 mu / D: mu (m^3/s^2) of both stars, D (m) apart.

    The facts have the `period` (s) of the whole orbit and `period_action`, S over it.
    """
    w = np.sqrt(mu / D**3)
    q0, q1 = D * np.array([-ORBIT_NEAR, 0.0]), D * np.array([0.0, ORBIT_FAR])
    u = D * w * np.sqrt(2 * (ORBIT_ENERGY - potential(ORBIT_NEAR, 0.0, 1.0, 1.0)) + ORBIT_NEAR**2)
    whole = ORBIT_ACTION * w * D**2

    def energy(q, v, t):
        rest = potential(q[0], q[1], mu, D) - w**2 * np.sum(q**2, axis=0) / 2
        return np.sum(v**2, axis=0) / 2 + rest

    return Setup(
        ["x", "y"],
        ORBIT_PERIOD / 4 / w,
        ends=(q0, q1),
        draw=lambda q, t: [ground((-D / 2, 0.0), (D / 2, 0.0)), body(q)],
        facts=Facts(
            start=State(0.0, q0, np.array([0.0, u])),
            action=whole / 4,
            energy=ORBIT_ENERGY * mu / D,
            conserved={"Jacobi integral": energy},
            numbers={"period": ORBIT_PERIOD / w, "period_action": whole},
        ),
    )
