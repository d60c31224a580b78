r"""Dido's land: the shortest fence round a given area on the shore.

             .-''-.
            /      \            x along the shore, y inland
        ---*--------o----

Of all fences from one place on the shore that enclose so much land the shortest is half of a
circle. Where it comes back to the shore is not given: it does so at a right angle. The multiplier
of the area bends the fence evenly, as a magnetic field does the path of a charge.
"""

from __future__ import annotations

import numpy as np

from actionopt.scenes._scene import Facts, Setup, Words, curve
from actionopt.scenes._shapes import body, ground

TITLE = "the shortest fence round a given area"
SOURCE = "Gelfand and Fomin, Calculus of Variations (1963), section 12; Virgil, Aeneid, 1.365-368"
WORDS = Words(
    question="Which is the shortest fence that encloses a given area on a straight shore?",
    answer="Half of a circle, at right angles to the shore.",
    look="It leaves the shore at a right angle, turns evenly, and comes back at a right angle.",
    beside=("rope_of_length", "soap_bridge", "charge_planar"),
)


def length(q, v):
    """L = (x'^2 + y'^2) / 2, half the square of a length."""
    return np.sqrt(v @ v)


def integral(q, v, t):
    """G = y x': the rate at which land is enclosed."""
    return q[1] * v[0]


def on(q, t):
    """Vanish on the shore."""
    return q[1]


def scene(*, area=1.0, duration=1.0):
    """Enclose the `area` (m^2) by a fence from x = 0 to anywhere on the shore.

    The facts have its radius, sqrt(2 area / pi). Raises ValueError unless the area is above 0.
    """
    if not area > 0:
        raise ValueError(f"expected an area above 0, found {area}")
    r, w = np.sqrt(2 * area / np.pi), np.pi / duration
    return Setup(
        ["x", "y"],
        duration,
        draw=lambda q, t: [ground((-0.3 * r, 0.0), (2.3 * r, 0.0)), body(q)],
        ends=((0.0, 0.0), (2 * r, 0.0)),
        exact=curve(lambda t: (r - r * np.cos(w * t), r * np.sin(w * t))),
        integral=[area],
        facts=Facts(
            velocity=curve(lambda t: (r * w * np.sin(w * t), r * w * np.cos(w * t))),
            action=float(np.pi * area / duration),
            energy=float((r * w) ** 2 / 2),
            morse_index=0,
            conserved={"energy": lambda q, v, t: (v[0] ** 2 + v[1] ** 2) / 2},
            integral_multipliers=[-w],
            numbers={"radius": float(r)},
        ),
    )
