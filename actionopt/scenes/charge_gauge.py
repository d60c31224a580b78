r"""The charge in uniform fields again, with another vector potential.

    y |   .-.   .-.
      |  (   ) (   )          B out of the plane, E along x
      | ' `o' `-'
      +------------ x

The gauge A = (0, B x) makes y cyclic; it adds d/dt (e B x y / 2) to the Lagrangian.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

from actionopt.mechanics.problem import Event, Problem
from actionopt.mechanics.system import System
from actionopt.scenes import charge_planar
from actionopt.scenes._scene import Scene, defaults

TITLE = "charge in uniform E and B, in Landau's gauge"
SOURCE = (
    "Competitive Physics: Mechanics and Waves (2018), sections 12.3.2 and 12.5, pp. 633 and 642"
)


def lagrangian(q, v, t, *, m, e, B, E):
    """L = m (x'^2 + y'^2) / 2 + e B x y' + e E x."""
    x, _ = q
    vx, vy = v
    return m * (vx**2 + vy**2) / 2 + e * B * x * vy + e * E * x


@cache
def system() -> System:
    """Return the system, derived once."""
    return System(
        lagrangian,
        ["x", "y"],
        parameters=defaults(scene, "m", "e", "B", "E"),
        name="charge_gauge",
    )


def scene(
    *,
    m: float = 1.0,
    e: float = 1.0,
    B: float = 2.0,
    E: float = 0.3,
    start: Sequence[float] = (0.2, -0.1),
    end: Sequence[float] = (1.0, 0.5),
    duration: float = 2.0,
) -> Scene:
    """Follow the path of the scene `charge_planar`, with the same parameters."""
    twin = charge_planar.scene(m=m, e=e, B=B, E=E, start=start, end=end, duration=duration)
    return Scene(
        Problem(
            system(),
            Event(0.0, start),
            Event(duration, end),
            parameters={"m": m, "e": e, "B": B, "E": E},
        ),
        TITLE,
        SOURCE,
        draw=twin.draw,
        exact=twin.exact,
        facts={
            **twin.facts,
            "twin": "charge_planar",
            "gauge": lambda q, t: e * B * q[0] * q[1] / 2,
        },
    )
