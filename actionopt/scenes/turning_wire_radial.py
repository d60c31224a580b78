r"""The bead on the turning wire, by its distance along the wire.

    y |        / wire, turning at w about the origin
      |      o
      |    /  r
      |  /  w t
      *------------ x

With the moving constraint solved, t is gone from L: H is constant, the energy is not.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from actionopt.mechanics.problem import Event, Problem
from actionopt.mechanics.system import System
from actionopt.scenes import turning_wire
from actionopt.scenes._scene import Scene, curve, defaults

TITLE = "bead on a turning wire, by its distance"
SOURCE = "Competitive Physics: Mechanics and Waves (2018), section 12.5, p. 642"


def lagrangian(q, v, t, *, m, w):
    """L = m (r'^2 + w^2 r^2) / 2."""
    return m * (v[0] ** 2 + (w * q[0]) ** 2) / 2


@cache
def system() -> System:
    """Return the system, derived once."""
    return System(
        lagrangian, ["r"], parameters=defaults(scene, "m", "w"), name="turning_wire_radial"
    )


def scene(
    *,
    m: float = 1.0,
    w: float = 1.5,
    start: float = 0.5,
    end: float = 0.8,
    duration: float = 1.0,
) -> Scene:
    """Move as in the scene `turning_wire`, with the same parameters."""
    T = duration
    distance, speed = turning_wire.along(w, start, end, T)
    twin = turning_wire.scene(m=m, w=w, start=start, end=end, duration=T)
    squares = (start**2 + end**2) * np.cosh(w * T) - 2 * start * end
    return Scene(
        Problem(system(), Event(0.0, [start]), Event(T, [end]), parameters={"m": m, "w": w}),
        TITLE,
        SOURCE,
        draw=lambda q, t: twin.draw(q[0] * np.array([np.cos(w * t), np.sin(w * t)]), t),
        exact=curve(lambda t: [distance(t)]),
        facts={
            "velocity": curve(lambda t: [speed(t)]),
            "acceleration": lambda q, v, t: w**2 * q,
            "action": m * w * squares / (2 * np.sinh(w * T)),
            "morse_index": 0,
            "conserved": {
                "energy in the turning frame": lambda q, v, t: (
                    m * (v[0] ** 2 - (w * q[0]) ** 2) / 2
                ),
            },
        },
    )
