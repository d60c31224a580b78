r"""A pendulum with a given energy, from the lowest point to the top.

             o            m, at the top
             :
        -----+-----
             |
             |  l
             |
             *            at the bottom

The energy is m g l and a little to spare; how long it takes is not given but found.
"""

import numpy as np

from actionopt.scenes._elliptic import complete, jacobi
from actionopt.scenes._scene import Facts, Setup, Words, curve
from actionopt.scenes.pendulum import draw, lagrangian

__all__ = ["SOURCE", "TITLE", "WORDS", "lagrangian", "scene"]

TITLE = "pendulum over the top, with a given energy"
SOURCE = (
    "Whittaker, Analytical Dynamics (4th ed. 1937), section 44, for the pendulum that goes round; "
    "Goldstein, Classical Mechanics (3rd ed. 2002), section 8.6, for the principle"
)
WORDS = Words(
    question="A pendulum has just enough energy to go over the top. How long does it take there?",
    answer="Longer than the half of a small swing: near the top it has hardly any speed left.",
    look="The bob shoots through the bottom and creeps over the top.",
    beside=("pendulum", "throw_at_energy", "kink"),
)


def scene(*, m=1.0, l=1.0, g=9.81, spare=0.5):
    """Rise from straight down to the top with the energy m g l + `spare` (J).

    m in kg, l in m, g in m/s^2. sin(theta / 2) = sn(w t / k, k) with w^2 = g / l and
    k^2 = 2 m g l / (energy + m g l). The facts have the `period` (s) of a whole turn. Raises
    ValueError unless there is energy to spare.
    """
    if not spare > 0:
        raise ValueError(f"expected energy to spare at the top, above 0, found {spare}")
    w, k = np.sqrt(g / l), np.sqrt(2 * m * g * l / (2 * m * g * l + spare))
    energy = m * g * l + spare
    T = complete(k) * k / w

    def theta(t):
        sn, cn, _, _ = jacobi(w * t / k, k)
        return 2 * np.arctan2(sn, cn)

    return Setup(
        ["theta"],
        T,
        draw=lambda q, t: draw(l, q[0]),
        exact=curve(lambda t: [theta(t)]),
        energy=energy,
        facts=Facts(
            velocity=curve(lambda t: [2 * w / k * jacobi(w * t / k, k)[2]]),
            acceleration=lambda q, v, t: -(g / l) * np.sin(q),
            action=4 * m * l**2 * w / k * float(jacobi(complete(k), k)[3]) - energy * T,
            energy=energy,
            morse_index=0,  # theta rises, and T falls with the energy
            conserved={
                "energy": lambda q, v, t: m * (l * v[0]) ** 2 / 2 - m * g * l * np.cos(q[0])
            },
            numbers={"period": 2 * T},
        ),
    )
