"""A throw with a given energy: the low one of two.

    y |     .  '  .
      |  .     - -   .      high
      | .   - '     ' o     low
      * - '
      +------------------ x

Gravity g points downward; how long the throw takes is not given but found.
"""

import numpy as np

from actionopt.scenes._scene import Facts, Setup, Words, curve
from actionopt.scenes._shapes import body, ground
from actionopt.scenes.projectile import lagrangian

__all__ = ["SOURCE", "TITLE", "WORDS", "lagrangian", "scene"]

TITLE = "throw with a given energy"
SOURCE = (
    "Landau and Lifshitz, Mechanics (3rd ed. 1976), section 44, for Maupertuis' principle; "
    "Goldstein, Classical Mechanics (3rd ed. 2002), section 8.6"
)
WORDS = Words(
    question="A ball leaves with a given energy and is to hit a mark. How long does it fly?",
    answer="That depends: a low throw and a high one have the same energy, and both arrive.",
    look="This is the low throw: it goes up only a little, and is there soon.",
    beside=("projectile", "pendulum_over_top"),
)


def scene(*, m=1.0, g=9.81, start=(0.0, 0.0), end=(4.0, 1.0), spare=10.0):
    """Throw a mass m (kg) low from `start` to `end` (m), with `spare` energy (J).

    That is what the throw has above the least energy that reaches the end. Of both throws
    g^2 T^4 / 4 - (u^2 - g h) T^2 + d^2 = 0, u the speed at the start, h the height of the end above
    it and d its distance. The facts have `high_duration` (s), that of the high throw. Raises
    ValueError unless there is energy to spare.
    """
    if not spare > 0:
        raise ValueError(f"expected energy to spare, above 0, found {spare}")
    (x0, y0), (x1, y1) = start, end
    d, h = np.hypot(x1 - x0, y1 - y0), y1 - y0
    energy = m * g * (h + d) / 2 + spare + m * g * y0
    half = g * d + 2 * spare / m  # u^2 - g h
    root = np.sqrt((half - g * d) * (half + g * d))
    T = d * np.sqrt(2 / (half + root))
    ux, uy = (x1 - x0) / T, h / T
    return Setup(
        ["x", "y"],
        T,
        ends=(start, end),
        draw=lambda q, t: [ground(start), ground(end), body(q)],
        exact=curve(lambda t: (x0 + ux * t, y0 + uy * t + g * t * (T - t) / 2)),
        energy=energy,
        facts=Facts(
            velocity=curve(lambda t: (ux, uy + g * (T / 2 - t))),
            acceleration=lambda q, v, t: np.stack([0 * v[0], 0 * v[1] - g]),
            action=m * T * ((ux**2 + uy**2) / 2 - g * (y0 + y1) / 2 - g**2 * T**2 / 24),
            energy=energy,
            morse_index=0,  # 1 of the high throw, which has touched the parabola of safety
            conserved={
                "horizontal momentum": lambda q, v, t: m * v[0],
                "energy": lambda q, v, t: m * (v[0] ** 2 + v[1] ** 2) / 2 + m * g * q[1],
            },
            numbers={"high_duration": np.sqrt(2 * (half + root)) / g},
        ),
    )
