r"""A bead on a straight wire that turns in a horizontal plane.

    y |        / wire, turning at w about the origin
      |      o
      |    /
      |  /  w t
      *------------ x

The constraint moves: its force, across the wire, does work, and H = T is not constant.
"""

from __future__ import annotations

import numpy as np

from actionopt.scenes._scene import Facts, Setup, Words, curve
from actionopt.scenes._shapes import body, rod

TITLE = "bead on a turning wire, a moving constraint"
SOURCE = "Competitive Physics: Mechanics and Waves (2018), section 12.4, eqs. (12.7)-(12.9), p. 638"
WORDS = Words(
    question="A wire turns and carries a bead along. Does its force do work?",
    answer=(
        "Yes: it is across the wire, and the wire moves that way. So the energy is not conserved."
    ),
    look="The arrow is the push of the wire: always across it, and at first backwards.",
    captions={
        "motion": (
            "The wire carries the bead round while it slides along it, first inward, then outward."
        ),
        "path": "Two coordinates, one constraint that depends on time.",
        "conserved": "Nothing is conserved: L has no time in it, but the constraint has.",
    },
    beside=("turning_wire_radial",),
)


def lagrangian(q, v, t, *, m):
    """L = m (x'^2 + y'^2) / 2."""
    vx, vy = v
    return m * (vx**2 + vy**2) / 2


def constraint(q, t, *, w):
    """Hold f = y cos(w t) - x sin(w t) = 0."""
    x, y = q
    return y * np.cos(w * t) - x * np.sin(w * t)


def scene(*, m=1.0, w=1.5, start=0.5, end=0.8, duration=1.0):
    """Go from the distance `start` to `end` (m) in `duration` (s) on a wire at w t (rad).

    The multiplier is the force across the wire (N), 2 m w r'. The guess follows the wire.
    """
    distance, speed = along(w, start, end, duration)

    def on_wire(radial):
        return lambda t: (radial(t) * np.cos(w * t), radial(t) * np.sin(w * t))

    def velocity(t):
        (c, s), r, u = (np.cos(w * t), np.sin(w * t)), distance(t), speed(t)
        return u * c - w * r * s, u * s + w * r * c

    def outward(v, t):
        return v[0] * np.cos(w * t) + v[1] * np.sin(w * t)

    reach = 1.3 * max(abs(start), abs(end))
    return Setup(
        ["x", "y"],
        duration,
        draw=lambda q, t: [
            rod((0.0, 0.0), (reach * np.cos(w * t), reach * np.sin(w * t))),
            body(q),
        ],
        exact=curve(on_wire(distance)),
        guess=curve(on_wire(lambda t: start + (end - start) * t / duration)),
        facts=Facts(
            velocity=curve(velocity),
            multipliers=lambda q, v, t: (2 * m * w * outward(v, t))[None],
            morse_index=0,
            conserved={
                "r'^2 - w^2 r^2": lambda q, v, t: (
                    outward(v, t) ** 2 - w**2 * (q[0] ** 2 + q[1] ** 2)
                ),
            },
        ),
    )


def along(w: float, start: float, end: float, T: float):
    """Return r(t) and r'(t) of r'' = w^2 r from `start` to `end` in T."""

    def distance(t):
        return (start * np.sinh(w * (T - t)) + end * np.sinh(w * t)) / np.sinh(w * T)

    def speed(t):
        return w * (end * np.cosh(w * t) - start * np.cosh(w * (T - t))) / np.sinh(w * T)

    return distance, speed
