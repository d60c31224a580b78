r"""The quickest course of a ship in a current.

        ~~~~~~~~~> ~~~~~~~~>   current u = w y, strongest far out
        ~~~~> ~~~~> ~~~~>  o
        ~> ~> ~> *              the ship's own speed is one

Length is the time it takes, |v - u L| = L, in the ship's own speed: a metric that differs forth and
back (Randers). L below is half its square per unit of the parameter.
"""

import numpy as np

from actionopt.scenes._scene import Facts, Measure, Setup, Words
from actionopt.scenes._shapes import body, ground

TITLE = "the quickest course in a current"
SOURCE = (
    "Zermelo, Z. angew. Math. Mech. 11 (1931) 114-124; Bryson and Ho, Applied Optimal Control "
    "(1975), section 2.7"
)
WORDS = Words(
    question="Which course takes a ship across a current in the least time?",
    answer="Not the straight one: it pays to go out where the current is stronger.",
    look="The ship bends towards the stronger current, and is carried along.",
    beside=("brachistochrone", "fish_eye"),
)


def length(q, v, *, w):
    """Return the time per unit of the parameter.

    L = (sqrt(x'^2 + (1 - u^2) y'^2) - u x')^2 / (2 (1 - u^2)^2), with u = w y, half the square of a
    length.
    """
    u = w * q[1]
    return (np.sqrt(v[0] ** 2 + (1 - u**2) * v[1] ** 2) - u * v[0]) / (1 - u**2)


def scene(*, w=0.8, across=0.6, along=2.0, duration=1.0):
    """Go from 0 to the point `along` the current and `across` it, (m).

    Raises ValueError where the current is as fast as the ship.
    """
    if not abs(w * across) < 1:
        raise ValueError(f"expected |w across| below one, found {w * across}")
    return Setup(
        ["x", "y"],
        duration,
        measure=Measure("time", "s", base="s"),
        draw=lambda q, t: [
            ground((0.0, 0.0), (along, 0.0)),
            ground((0.0, across), (w * across, across)),
            body(q),
        ],
        ends=((0.0, 0.0), (along, across)),
        facts=Facts(),
    )
