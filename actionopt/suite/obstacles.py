"""Scenes of members with inequalities: paths that an obstacle holds, f(q, t) >= 0.

How one is degenerate is said by its tags:

- "weak complementarity": rows that touch and do not press;
- "LICQ fails": gradients of rows in contact depend on each other, multipliers are not unique;
- "MFCQ fails": no direction leads inside of all of them, multipliers are not bounded.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from actionopt.mechanics.question.problem import Event, Problem
from actionopt.mechanics.system import System
from actionopt.scenes import Facts, Scene
from actionopt.scenes._shapes import body
from actionopt.tools.types import Array

ELEMENTARY_SOURCE = "elementary: straight lines and parabolas that end tangentially"
KKT = "A. E. Bryson and Y.-C. Ho, Applied Optimal Control (1975), section 3.11"


def _scene(
    name: str,
    title: str,
    system: System,
    ends: Sequence[tuple[float, Any]],
    source: str,
    exact: Callable[[Any], Array] | None = None,
    **numbers: float,
) -> Scene:
    """Return a scene; `numbers` are its times of contact, multipliers and action."""
    problem = Problem(system, *(Event(t, q) for t, q in ends))
    action = numbers.pop("action", None)
    facts = Facts(action=action, morse_index=0, numbers=numbers)
    known = {"exact": exact, "facts": facts, "source": source}
    return Scene(problem, title=title, draw=lambda q, t: [body(q[:2])], **known)


def _string(name: str, rows: Callable[[Any, Any], Any], *, lagrangian: Any = None) -> System:
    def weighing(q, v, t):
        return v[0] ** 2 / 2 + 2 * q[0]

    return System(lagrangian or weighing, ["height"], obstacle=rows, name=name)


def string_on_floor(
    name: str, *, extra: float = 0.0, lower: float = 0.5, twice: bool = False
) -> Scene:
    """Return a string of weight 2 a length from height 1 to `lower`, above a floor.

    Parabolas end on it. Contact lasts for `extra`, with the force 2; for 0 it grazes.
    """
    rows = (lambda q, t: [q[0], 2 * q[0]]) if twice else (lambda q, t: q[0])
    begin, end = 1.0, 1.0 + extra
    T = end + np.sqrt(lower)

    def exact(t: Any) -> Array:
        before, behind = (np.maximum(x, 0) for x in (begin - np.asarray(t), np.asarray(t) - end))
        return (before**2 + behind**2)[None]

    action = 4 / 3 * (1 + lower**1.5)  # of a parabola over a time s: 4 s^3 / 3
    numbers = {"begin": begin, "end": end, "force": 2.0, "action": action}
    ends = [(0.0, [1.0]), (T, [lower])]
    return _scene(
        name, "string above a floor", _string(name, rows), ends, ELEMENTARY_SOURCE, exact, **numbers
    )


def string_over_bump(name: str) -> Scene:
    """Return a taut string over the parabola 1 - 8 (t - 1/2)^2, between two points below it."""
    begin = 1 / np.sqrt(8)
    slope = 16 * (0.5 - begin)

    def exact(t: Any) -> Array:
        t = np.asarray(t)
        beside = np.minimum(t, 1 - t)
        return np.where(beside < begin, slope * beside, 1 - 8 * (t - 0.5) ** 2)[None]

    def taut(q, v, t):
        return v[0] ** 2 / 2

    system = _string(name, lambda q, t: q[0] - 1 + 8 * (t - 0.5) ** 2, lagrangian=taut)
    action = slope**2 * begin + 256 / 3 * (0.5 - begin) ** 3
    numbers = {"begin": begin, "end": 1 - begin, "force": 16.0, "action": action}
    ends = [(0.0, [0.0]), (1.0, [0.0])]
    return _scene(
        name, "taut string over a bump", system, ends, ELEMENTARY_SOURCE, exact, **numbers
    )


def oscillating_floor(name: str, *, waves: float = 3.0) -> Scene:
    """Return a string above a floor in waves, sin(waves t) / 5."""
    system = _string(name, lambda q, t: q[0] - np.sin(waves * t) / 5)
    ends = [(0.0, [1.0]), (2 * np.pi, [1.0])]
    return _scene(name, "string above waves", system, ends, KKT)


def along_wall(name: str, *, both: bool = False) -> Scene:
    """Return the way straight along a wall that does not press; or between `both` sides of it."""

    def lagrangian(q, v, t):
        return v @ v / 2

    rows = (lambda q, t: [q[1], -q[1]]) if both else (lambda q, t: q[1])
    system = System(lagrangian, ["x", "y"], obstacle=rows, name=name)

    def exact(t: Any) -> Array:
        return np.stack([np.asarray(t), 0 * np.asarray(t)])

    ends = [(0.0, [0.0, 0.0]), (1.0, [1.0, 0.0])]
    numbers = {"force": 0.0, "action": 0.5}
    return _scene(name, "straight along a wall", system, ends, ELEMENTARY_SOURCE, exact, **numbers)


def round_discs(name: str, *, centres=((0.0, 0.0),), ends=((-2, 0.3), (2, 0))) -> Scene:
    """Return the shortest way round discs of radius 1."""

    def lagrangian(q, v, t):
        return v @ v / 2

    def rows(q, t):
        return [(q[0] - x) ** 2 + (q[1] - y) ** 2 - 1 for x, y in centres]

    system = System(lagrangian, ["x", "y"], obstacle=rows, name=name)
    problem_ends = [(0.0, ends[0]), (1.0, ends[1])]
    places = {f"{a}{i}": c[k] for i, c in enumerate(centres) for k, a in enumerate("xy")}
    return _scene(name, "shortest way round discs", system, problem_ends, KKT, **places)


def round_pegs(name: str, *, pegs: int = 3) -> Scene:
    """Return the shortest way past so many discs in a row, above and below the straight line.

    Each may be passed on either side: 2^pegs ways, most of them local minima.
    """
    if pegs != int(pegs) or pegs < 1:
        raise ValueError(f"expected a positive number of pegs, found {pegs!r}")
    centres = tuple((3.5 * (k + 1), 0.5 * (-1) ** k) for k in range(int(pegs)))
    return round_discs(name, centres=centres, ends=((0, 0), (3.5 * (pegs + 1), 0)))


def round_ball(name: str) -> Scene:
    """Return the shortest way round the unit ball in space."""

    def lagrangian(q, v, t):
        return v @ v / 2

    system = System(lagrangian, ["x", "y", "z"], obstacle=lambda q, t: q @ q - 1, name=name)
    ends = [(0.0, [-2.0, 0.3, 0.1]), (1.0, [1.5, 0.2, -0.4])]
    return _scene(name, "shortest way round a ball", system, ends, KKT)


def links_on_floor(name: str, *, links: int = 1) -> Scene:
    """Return bobs on a chain of rods, pressed down on a floor: equations and inequalities.

    The floor is half the chain's length below its support. All rods are parallel at either end.
    """
    if links != int(links) or links < 1:
        raise ValueError(f"expected a positive number of links, found {links!r}")
    count, T = int(links), 3.0

    def lagrangian(q, v, t):
        return v @ v / 2 + 3 * np.sum(q[1::2])

    def lengths(q, t):
        dx, dy = (np.concatenate([z[:1], z[1:] - z[:-1]]) for z in (q[0::2], q[1::2]))
        return (dx**2 + dy**2 - 1) / 2

    def guess(t: Any) -> Array:  # all rods turn evenly
        angle = 1.6 + 0.9 * np.asarray(t) / T
        one = np.stack([np.sin(angle), -np.cos(angle)])
        return np.concatenate([k * one for k in range(1, count + 1)])

    system = System(
        lagrangian,
        [f"{axis}{i}" for i in range(1, count + 1) for axis in "xy"],
        constraint=lengths,
        obstacle=lambda q, t: q[1::2] + 0.5 * count,
        name=name,
    )
    ends = [(t, guess(t)) for t in (0.0, T)]
    return replace(_scene(name, "bobs on rods above a floor", system, ends, KKT), guess=guess)
