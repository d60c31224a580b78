"""What is known exactly about a scene, next to what was found."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from actionopt import scenes
from actionopt.gallery import units
from actionopt.gallery.page import escape, number
from actionopt.gallery.subject import Subject
from actionopt.quadrature import Array
from actionopt.scenes._scene import MEANINGS
from actionopt.solve import solve

DIGITS = 10


@dataclass(frozen=True)
class Known:
    """A row of the table: HTML each.

    Attributes
    ----------
    what, expected, found, difference : str
    """

    what: str
    expected: str
    found: str
    difference: str = ""


def known(subject: Subject) -> list[Known]:
    """Return all that the scene's facts say, compared with the solution."""
    rows: list[Known] = []
    for part in (_path, _action, _energy, _index, _rates, _conserved, _start, _twin, _others):
        rows += part(subject)
    return rows


Rows = Iterator[Known]


def _path(s: Subject) -> Rows:
    if s.scene.exact is not None:
        yield _curve("path", s.scene.exact(s.t), s.q)
    if "velocity" in s.scene.facts:
        yield _curve("velocity", s.scene.facts["velocity"](s.t), s.v)


def _action(s: Subject) -> Rows:
    if s.scene.action is not None:
        yield _numbers("action", s.scene.action, s.solution.action, "J s")


def _energy(s: Subject) -> Rows:
    if "energy" in s.scene.facts:
        found = float(s.solution.energy(s.t[0]))
        yield _numbers("energy function H", s.scene.facts["energy"], found, "J")


def _index(s: Subject) -> Rows:
    facts, end = s.scene.facts, s.t[-1]
    if "morse_index" in facts and not s.forced:
        yield Known("Morse index", str(facts["morse_index"]), str(s.solution.morse_index))
    if "conjugate_times" in facts:
        found = [p.t for p in s.conjugate for _ in range(p.multiplicity)]
        times = np.asarray(facts["conjugate_times"], dtype=float)
        for k, (a, b) in enumerate(zip(times[times <= end], found, strict=False)):
            yield _numbers(f"conjugate time {k + 1}", float(a), b, "s")
        later = times[times > end]
        if not found and later.size:
            yield Known("first conjugate time", f"{number(later[0], DIGITS)} s", "after the end")


def _rates(s: Subject) -> Rows:
    facts, system = s.scene.facts, s.solution.problem.system
    if "acceleration" in facts:
        expected = facts["acceleration"](s.q, s.v, s.t)
        yield _curve("acceleration", expected, s.solution.acceleration(s.t), "equation of motion")
    if "multipliers" in facts and system.m:
        expected = facts["multipliers"](s.q, s.v, s.t)
        yield _curve("multiplier", expected, s.solution.multipliers(s.t))


def _conserved(s: Subject) -> Rows:
    for name, quantity in s.scene.facts.get("conserved", {}).items():
        values = quantity(s.q, s.v, s.t)
        size = max(float(np.max(np.abs(values))), _size_of(quantity, s))
        drift = float(np.ptp(values)) / size if size else 0.0
        yield Known(
            escape(name), "constant", f"{number(float(values[0]), DIGITS)}", number(drift, 2)
        )


def _start(s: Subject) -> Rows:
    if "start" in s.scene.facts:
        yield _curve("velocity at the start", s.scene.facts["start"].v, s.solution.start.v)


def _twin(s: Subject) -> Rows:
    facts = s.scene.facts
    if "twin" not in facts:
        return
    twin = scenes.get(facts["twin"])
    other = solve(twin.problem, tol=1e-10, guess=twin.guess)
    what = f"path of <code>{facts['twin']}</code>"
    yield _curve(what, other(s.t), s.q, "the same")
    F = np.asarray(facts["gauge"](s.q[:, [0, -1]], s.t[[0, -1]]), dtype=float)
    yield _numbers(
        "action less the other's, F at the end less F at the start",
        float(F[1] - F[0]),
        s.solution.action - other.action,
        "J s",
    )


def _others(s: Subject) -> Rows:
    for name, value in s.scene.facts.items():
        if name not in MEANINGS and np.ndim(value) == 0 and not callable(value):
            unit = units.html(units.FACTS.get(name, ""))
            yield Known(name.replace("_", " "), f"{number(float(value), DIGITS)} {unit}", "")


def _numbers(what: str, expected: float, found: float, unit: str) -> Known:
    """Return the row of a number; the difference is relative to the number if that is large."""
    difference = abs(found - expected) / max(1.0, abs(expected))
    return Known(
        what,
        f"{number(expected, DIGITS)} {unit}",
        f"{number(found, DIGITS)} {unit}",
        number(difference, 2),
    )


def _curve(what: str, expected: Array, found: Array, words: str = "closed form") -> Known:
    """Return the row of a curve; the difference is relative to the size of each coordinate."""
    a, b = (np.asarray(x, dtype=float).reshape(len(found), -1) for x in (expected, found))
    size = np.max(np.abs(a), axis=1, keepdims=True)
    size = np.where(size > 1e-9 * np.max(size), size, np.max(size) or 1.0)
    return Known(what, words, "", number(float(np.max(np.abs(a - b) / size)), 2))


def _size_of(quantity: Callable[..., Any], s: Subject) -> float:
    """Return how large a quantity is where its terms do not cancel: at other velocities."""
    return float(np.max(np.abs(quantity(s.q, 0.5 * s.v, s.t))))
