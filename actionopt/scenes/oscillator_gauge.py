r"""The oscillator with a total time derivative added to its Lagrangian.

    |
    |/\/\/\/\/[ m ]            k
    |           |--> x

L changes by dF/dt with F = c t x^2 / 2: the path does not, S by the end values of F.
"""

from __future__ import annotations

from functools import cache

from actionopt.mechanics.problem import Event, Problem
from actionopt.mechanics.system import System
from actionopt.scenes import oscillator
from actionopt.scenes._scene import Scene, defaults

TITLE = "oscillator, with a total time derivative in L"
SOURCE = "Competitive Physics: Mechanics and Waves (2018), section 12.3.2, p. 633"


def lagrangian(q, v, t, *, m, k, c):
    """L = m x'^2 / 2 - k x^2 / 2 + d/dt (c t x^2 / 2)."""
    return m * v[0] ** 2 / 2 - k * q[0] ** 2 / 2 + c * q[0] ** 2 / 2 + c * t * q[0] * v[0]


@cache
def system() -> System:
    """Return the system, derived once."""
    return System(
        lagrangian, ["x"], parameters=defaults(scene, "m", "k", "c"), name="oscillator_gauge"
    )


def scene(
    *,
    m: float = 1.0,
    k: float = 1.0,
    start: float = 1.0,
    end: float = 0.5,
    duration: float = 2.5,
    c: float = 0.6,
) -> Scene:
    """Follow the path of the scene `oscillator`; c is in kg/s^2."""
    twin = oscillator.scene(m=m, k=k, start=start, end=end, duration=duration)
    kept = ("velocity", "acceleration", "conjugate_times", "morse_index")
    return Scene(
        Problem(
            system(),
            Event(0.0, [start]),
            Event(duration, [end]),
            parameters={"m": m, "k": k, "c": c},
        ),
        TITLE,
        SOURCE,
        draw=twin.draw,
        exact=twin.exact,
        facts={
            **{name: twin.facts[name] for name in kept},
            "twin": "oscillator",
            "gauge": lambda q, t: c * t * q[0] ** 2 / 2,
            "conserved": {
                "energy of the twin": lambda q, v, t: m * v[0] ** 2 / 2 + k * q[0] ** 2 / 2
            },
        },
    )
