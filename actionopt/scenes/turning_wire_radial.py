r"""The bead on the turning wire, by its distance along the wire.

    y |        / wire, turning at w about the origin
      |      o
      |    /  r
      |  /  w t
      *------------ x

With the moving constraint solved, t is gone from L: H is constant, the energy is not.
"""

import numpy as np

from actionopt.scenes import turning_wire
from actionopt.scenes._scene import Facts, Setup, Words, curve, like

TITLE = "bead on a turning wire, by its distance"
SOURCE = "Competitive Physics: Mechanics and Waves (2018), section 12.5, p. 642"
WORDS = Words(
    question="The bead on the turning wire has one degree of freedom. What drives it outwards?",
    answer=(
        "The term w squared r squared, the centrifugal potential: T of the turning wire, seen "
        "as a potential."
    ),
    look="The film is that of the turning wire in x and y, without the force.",
    captions={
        "motion": "The bead comes in first and then is flung out, on a wire that turns evenly.",
        "path": (
            "One coordinate instead of two: an exponential that falls and one that grows, added."
        ),
        "conserved": (
            "H is conserved and is not the energy: that grows, for whatever turns the wire does "
            "work."
        ),
    },
    beside=("turning_wire", "hoop_bead"),
)


def lagrangian(q, v, t, *, m, w):
    """L = m (r'^2 + w^2 r^2) / 2."""
    return m * (v[0] ** 2 + (w * q[0]) ** 2) / 2


@like(turning_wire)
def scene(twin, *, m, w, start, end, duration):
    """Move as in the scene `turning_wire`, with the same parameters."""
    T = duration
    distance, speed = turning_wire.along(w, start, end, T)
    squares = (start**2 + end**2) * np.cosh(w * T) - 2 * start * end
    return Setup(
        ["r"],
        T,
        ends=([start], [end]),
        draw=lambda q, t: twin.draw(q[0] * np.stack([np.cos(w * t), np.sin(w * t)]), t),
        kinetic=lambda q, v, t: m * (v[0] ** 2 + (w * q[0]) ** 2) / 2,
        exact=curve(lambda t: [distance(t)]),
        facts=Facts(
            velocity=curve(lambda t: [speed(t)]),
            acceleration=lambda q, v, t: w**2 * q,
            action=m * w * squares / (2 * np.sinh(w * T)),
            morse_index=0,
            conserved={
                "energy in the turning frame": lambda q, v, t: (
                    m * (v[0] ** 2 - (w * q[0]) ** 2) / 2
                ),
            },
        ),
    )
