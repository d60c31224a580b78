r"""A star in the field of Henon and Heiles, on a sixth of a closed loop.

           /\
          /  \
         / *. \         from * to o, each on one of the
        /    o \        triangle's axes: mirror images of
       /        \       the arc make the loop
      /__________\

At the energy k a^2 / 8, three quarters of what leads out of the triangle, many motions are
irregular; this one returns. How long that takes is not given but found.
"""

import numpy as np

from actionopt.mechanics.question.events import State
from actionopt.scenes._scene import Facts, Setup, Words
from actionopt.scenes._shapes import body, ground

TITLE = "a sixth of a closed loop in the field of Henon and Heiles"
SOURCE = (
    "Henon and Heiles, Astronomical Journal 69 (1964) 73-79; the loop's numbers by integrating it "
    "at this energy from one crossing of an axis at a right angle to the next"
)
WORDS = Words(
    question="A star moves in a field without a second law of conservation. Can its path close?",
    answer=(
        "Some do: this one crosses axes of symmetry at right angles, and mirror images close it."
    ),
    look="The star leaves one axis at a right angle, and meets the next one so.",
    beside=("oscillator_2d", "figure_eight"),
)

# At unit m, k and a: the distances of both ends from the middle, the loop's period and S over it.
LOOP_NEAR, LOOP_FAR = 0.3026668174698301, 0.372312783526470
LOOP_PERIOD, LOOP_ACTION, LOOP_ENERGY = 6.075615784322892, 0.012023082185968, 1 / 8


def lagrangian(q, v, t, *, m, k, a):
    """L = m (x'^2 + y'^2) / 2 - k (x^2 + y^2) / 2 - k (x^2 y - y^3 / 3) / a."""
    x, y = q
    return m * (v[0] ** 2 + v[1] ** 2) / 2 - k * (x**2 + y**2) / 2 - k * (x**2 * y - y**3 / 3) / a


def scene(*, m=1.0, k=1.0, a=1.0):
    """Go round a sixth of the loop: a mass m (kg), k in N/m, and a (m) to the triangle's corners.

    The facts have the `period` (s) of the whole loop and `period_action`, S over it.
    """
    w = np.sqrt(k / m)
    q0, q1 = a * LOOP_NEAR * np.array([0.0, 1.0]), a * LOOP_FAR * np.array([0.75**0.5, 0.5])
    u = a * w * np.sqrt(2 * LOOP_ENERGY - LOOP_NEAR**2 + 2 * LOOP_NEAR**3 / 3)
    corners = a * np.array([[0.0, 1.0], [0.75**0.5, -0.5], [-(0.75**0.5), -0.5], [0.0, 1.0]])
    whole = LOOP_ACTION * m * w * a**2

    def energy(q, v, t):
        x, y = q
        V = k * (x**2 + y**2) / 2 + k * (x**2 * y - y**3 / 3) / a
        return m * (v[0] ** 2 + v[1] ** 2) / 2 + V

    return Setup(
        ["x", "y"],
        LOOP_PERIOD / 6 / w,
        ends=(q0, q1),
        draw=lambda q, t: [ground(*corners), body(q)],
        energy=LOOP_ENERGY * k * a**2,
        facts=Facts(
            start=State(0.0, q0, np.array([u, 0.0])),
            action=whole / 6,
            energy=LOOP_ENERGY * k * a**2,
            conserved={"energy": energy},
            numbers={"period": LOOP_PERIOD / w, "period_action": whole},
        ),
    )
