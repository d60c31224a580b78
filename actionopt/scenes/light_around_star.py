r"""Light between two events around a black hole.

                  .--.
        *---------  M ---.     r, phi; Schwarzschild's coordinates
                  '--'    '--o

In a static spacetime light takes the least or a stationary coordinate time (Fermat's principle):
its paths are the geodesics of the optical metric. M is half the hole's radius.
"""

import numpy as np

from actionopt.scenes._scene import Facts, Measure, Setup, Words
from actionopt.scenes._shapes import body, circle

TITLE = "light around a black hole"
SOURCE = (
    "Wald, General Relativity (1984), section 6.3, p. 136; Landau and Lifshitz, vol. 2, section 84"
)
WORDS = Words(
    question="How does light get from one side of a black hole to the other?",
    answer="It bends around it, and comes nearest half way.",
    look="It falls towards the hole, turns about it most quickly where it is nearest, and leaves.",
    beside=("fish_eye", "kepler_polar"),
)


def length(q, v, *, M):
    """L = (r'^2 / f^2 + r^2 phi'^2 / f) / 2, with f = 1 - 2 M / r, half the square of a length."""
    f = 1 - 2 * M / q[0]
    return np.sqrt((v[0] / f) ** 2 + (q[0] * v[1]) ** 2 / f)


def scene(*, M=1.0, r=20.0, angle=3.3, duration=1.0):
    """Join two events at the distance `r`, the azimuths apart by `angle` (rad).

    Raises ValueError within the horizon.
    """
    if not r > 3 * M > 0:
        raise ValueError(f"expected M > 0 and r > 3 M, outside the circle of light, found {r}, {M}")
    return Setup(
        ["r", "phi"],
        duration,
        measure=Measure("optical length"),
        draw=lambda q, t: [circle(2 * M), body((q[0] * np.cos(q[1]), q[0] * np.sin(q[1])))],
        ends=((r, 0.0), (r, angle)),
        facts=Facts(
            conserved={
                "angular momentum": lambda q, v, t: q[0] ** 2 * v[1] / (1 - 2 * M / q[0]),
            },
        ),
        guess=lambda t: np.stack(
            [
                r - (r - 6 * M) * np.sin(np.pi * np.asarray(t, dtype=float) / duration),
                angle * np.asarray(t, dtype=float) / duration,
            ]
        ),
    )
