r"""The way on which noise leads a particle out of a well.

             |y            drift X, Y towards the well *
        *----+---- o       and its mirror image o; along x = 0 lies the ridge
             |
             |

For weak noise the likeliest way makes the action of Freidlin and Wentzell least, the square of what
the noise must add to the drift. The drift of Maier and Stein is no gradient: where beta exceeds 4
it is easier to leave beside the axis than along it.
"""

import numpy as np

from actionopt.scenes._scene import Measure, Setup, Words
from actionopt.scenes._shapes import body, ground

TITLE = "the way out of a well, by noise"
SOURCE = "Maier and Stein, Physical Review E 48 (1993) 931-938"
WORDS = Words(
    question="Does weak noise lead straight over the lowest point of the ridge?",
    answer="Not here: the likeliest way leaves the axis, though axis and drift are symmetric.",
    look="It goes out to one side, and comes down to the saddle along with the drift.",
    beside=("kink", "hoop_bead"),
)


def lagrangian(q, v, t, *, w, a, beta):
    """L = (|x' - X|^2 + |y' - Y|^2) / 2 for the drift X, Y.

    L = ((x' - X)^2 + (y' - Y)^2) / 2, with X = w (x - x^3 / a^2 - beta x y^2 / a^2),
    with Y = -w y (1 + x^2 / a^2), for unit mass.
    """
    x, y = q
    X = w * (x - x**3 / a**2 - beta * x * y**2 / a**2)
    Y = -w * y * (1 + x**2 / a**2)
    return ((v[0] - X) ** 2 + (v[1] - Y) ** 2) / 2


def scene(*, w=1.0, a=1.0, beta=10.0, duration=7.0):
    """Go from the bottom of the well to the saddle within the time; from -inf it takes for ever."""

    def guess(t):
        s = np.asarray(t, dtype=float) / duration
        return np.stack([-a * (1 - s), 0.3 * a * np.sin(np.pi * s) ** 2])

    return Setup(
        ["x", "y"],
        duration,
        measure=Measure(""),
        draw=lambda q, t: [ground((0.0, -a), (0.0, a)), ground((a, 0.0)), body(q)],
        ends=((-a, 0.0), (0.0, 0.0)),
        guess=guess,
    )
