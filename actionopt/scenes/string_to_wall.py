r"""A string drawn over a drum to a wall, as short as it can be.

              .---.          /
         .-'''     '''------o
        *    (  R  )       /      x, y from the middle of the drum
              '---'       /

Where on the wall it ends is not given: it arrives at a right angle. The drum presses on it, and
where it begins and ceases to do so is found as well. L is half the square of the length per unit of
the parameter.
"""

from __future__ import annotations

import numpy as np

from actionopt.scenes._scene import Facts, Setup, Words
from actionopt.scenes._shapes import body, circle, ground
from actionopt.scenes.rope_round_post import length, obstacle, tangents

__all__ = ["SOURCE", "TITLE", "WORDS", "length", "obstacle", "on", "scene"]

TITLE = "a string over a drum to a wall"
SOURCE = "Bryson and Ho, Applied Optimal Control (1975), sections 2.4 and 3.11"
WORDS = Words(
    question="Which is the shortest way over a drum to a wall, and where does it end?",
    answer="Along the drum as far as it takes to meet the wall at a right angle.",
    look="It bends on the drum alone, and ends square to the wall.",
    captions={"contact": "The drum presses evenly, where the string lies on it."},
    beside=("rope_round_post", "descent_to_wall"),
)


def on(q, t, *, far, lean):
    """Vanish on the wall."""
    return q[0] * np.cos(lean) + q[1] * np.sin(lean) - far


def scene(*, R=1.0, start=(-2.0, -0.2), far=2.0, lean=0.2, duration=1.0):
    """Draw a string from `start` (m) over a drum of radius `R` to a wall `far` (m) from its middle.

    The wall leans by `lean` (rad) from the upright. The facts have the times at which contact
    begins and ends, and the drum's force. Raises ValueError if the string would not touch it.
    """
    square, up = np.array([np.cos(lean), np.sin(lean)]), np.array([-np.sin(lean), np.cos(lean)])
    end = R * up + far * square
    exact, facts = tangents(start, end, R, duration)
    wall = [tuple(end + k * up) for k in (-1.2, 1.0)]
    return Setup(
        ["x", "y"],
        duration,
        draw=lambda q, t: [circle(R), ground(start), ground(*wall), body(q)],
        ends=(start, tuple(end)),
        exact=exact,
        facts=Facts(
            **facts,
            conserved={"angular momentum": lambda q, v, t: q[0] * v[1] - q[1] * v[0]},
        ),
    )
