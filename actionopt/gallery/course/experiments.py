"""What lessons let their readers bend that is no scene of the catalogue."""

from __future__ import annotations

from collections.abc import Callable

from actionopt.mechanics.question.events import Event
from actionopt.mechanics.question.problem import Problem
from actionopt.mechanics.system import System


def minus() -> Problem:
    """Return a throw of L = T - (1 - 2 s) V: with s = 1 it is T + V."""

    def lagrangian(q, v, t, *, s, m, g):
        return m * v @ v / 2 - (1 - 2 * s) * m * g * q[1]

    system = System(lagrangian, ["x", "y"], parameters={"s": 0.0, "m": 1.0, "g": 9.81})
    return Problem(system, Event(0.0, [0.0, 0.0]), Event(1.0, [3.0, 1.0]))


EXPERIMENTS: dict[str, Callable[[], Problem]] = {"minus": minus}
