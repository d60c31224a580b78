r"""The shortest way round a ball in space.

               .---.
          *.  (  R  )  .o       x, y, z from its middle
            '--'---'--'

It lies in the plane of its ends and the middle: a tangent, a part of a great circle, and a tangent.
"""

import numpy as np

from actionopt.scenes._scene import Facts, Setup, Words
from actionopt.scenes._shapes import body, ground
from actionopt.scenes.rope_round_post import tangents

TITLE = "the shortest way round a ball"
SOURCE = (
    "Bryson and Ho, Applied Optimal Control (1975), section 3.11; do Carmo, Differential Geometry "
    "of Curves and Surfaces (1976), section 4-4"
)
WORDS = Words(
    question="How does one get past a ball in space on the shortest way?",
    answer="Along a great circle where one has to touch it, and straight before and after.",
    look="The way stays in one plane with the middle of the ball.",
    captions={"contact": "The ball presses evenly as long as it is touched."},
    beside=("rope_round_post", "great_ellipse"),
)


def length(q, v):
    """L = (x'^2 + y'^2 + z'^2) / 2, half the square of a length."""
    return np.sqrt(v @ v)


def obstacle(q, t, *, R):
    """Keep f = sqrt(x^2 + y^2 + z^2) - R: at least zero."""
    return np.sqrt(q @ q) - R


def scene(*, R=1.0, start=(-2.0, 0.3, 0.1), end=(1.5, 0.2, -0.4), duration=1.0):
    """Go from `start` to `end` (m) round a ball of radius `R` (m).

    The facts have the times at which contact begins and ends, and the ball's force. Raises
    ValueError if the straight line between the ends does not meet the ball.
    """
    exact, facts = tangents(start, end, R, duration)
    round_ = R * np.exp(1j * np.linspace(0, 2 * np.pi, 61))
    flat = np.zeros(round_.size)

    def draw(q, t):
        return [
            ground(*np.transpose([round_.real, round_.imag, flat])),
            ground(*np.transpose([round_.real, flat, round_.imag])),
            ground(start),
            ground(end),
            body(q),
        ]

    return Setup(
        ["x", "y", "z"],
        duration,
        draw=draw,
        ends=(start, end),
        exact=exact,
        facts=Facts(
            **facts,
            conserved={"angular momentum": lambda q, v, t: q[0] * v[1] - q[1] * v[0]},
        ),
    )
