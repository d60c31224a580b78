"""What is known exactly about a scene, next to what was found."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from actionopt import scenes
from actionopt.gallery import units
from actionopt.gallery.page import typeset
from actionopt.gallery.subject import Subject
from actionopt.solver.solve import solve
from actionopt.tools.mathml import inline
from actionopt.tools.types import Array
from actionopt.tools.words import number, say

FACT_DIGITS = 10
# Numbers that are compared.
CONTACT_NUMBERS = (
    "contact_begin", "contact_end", "contact_force", "begin_impulse", "end_impulse",
)  # fmt: skip
ZERO_WITHIN = 1e-9  # what is smaller than this part of a size is zero


@dataclass(frozen=True)
class TableRow:
    """A row of the table.

    Attributes
    ----------
    what, expected, found : str
        HTML.
    difference : float, optional
        Relative to the size of what is compared.
    """

    what: str
    expected: str
    found: str
    difference: float | None = None


def facts_of(subject: Subject) -> list[TableRow]:
    """Return all that the scene's facts say, compared with the solution."""
    rows: list[TableRow] = []
    motion = _path, _action, _energy, _index, _rates, _conserved_rows, _start, _joints, _contact
    for part in (*motion, _twin, _others):
        rows += part(subject)
    return rows


Rows = Iterator[TableRow]


def _path(s: Subject) -> Rows:
    if s.scene.exact is not None:
        yield _curve("path", s.scene.exact(s.t), s.q)
    if velocity := s.scene.facts.velocity:
        joints = np.array([event.t for event in s.solution.problem.through])
        away = (np.abs(s.t[:, None] - joints) > ZERO_WITHIN * s.duration).all(axis=1)  # it may jump
        yield _curve("velocity", velocity(s.t[away]), s.v[:, away], least=_sizes(s) / s.duration)


def _action(s: Subject) -> Rows:
    if s.scene.action is not None:
        yield _numbers("action", s.scene.action, s.solution.action, s.units.action)


def _energy(s: Subject) -> Rows:
    if s.scene.facts.energy is not None:
        found = float(s.solution.energy(s.t[0]))
        yield _numbers("energy function H", s.scene.facts.energy, found, s.units.energy)


def _index(s: Subject) -> Rows:
    facts, end = s.scene.facts, s.t[-1]
    if facts.morse_index is not None and not s.has_forces:
        yield TableRow("Morse index", str(facts.morse_index), str(s.solution.morse_index))
    if facts.conjugate_times is not None:
        found = [p.t for p in s.conjugate for _ in range(p.multiplicity)]
        times = facts.conjugate_times
        for k, (a, b) in enumerate(zip(times[times <= end], found, strict=False)):
            yield _numbers(say("conjugate time {k}", k=k + 1), float(a), b, s.units.time)
        later = times[times > end]
        if not found and later.size:
            yield TableRow(
                "first conjugate time",
                f"{number(later[0], FACT_DIGITS)} {s.units.time}",
                "after the end",
            )


def _rates(s: Subject) -> Rows:
    facts, system = s.scene.facts, s.solution.problem.system
    if facts.acceleration:
        expected = facts.acceleration(s.q, s.v, s.t)
        found = s.solution.acceleration(s.t)
        least = _sizes(s) / s.duration**2
        yield _curve("acceleration", expected, found, "equation of motion", least=least)
    if facts.multipliers and system.m:
        expected = facts.multipliers(s.q, s.v, s.t)
        yield _curve("multiplier", expected, s.solution.multipliers(s.t))


def _conserved_rows(s: Subject) -> Rows:
    for name, quantity in (s.scene.facts.conserved or {}).items():
        values = quantity(s.q, s.v, s.t)
        with np.errstate(all="ignore"):  # where bodies would meet
            terms = quantity(np.abs(s.q), np.abs(s.v), s.t)  # they may cancel in what is conserved
        # Of other signs bodies may all but meet, where terms are of no common size.
        known = np.abs(terms[np.isfinite(terms)])
        common = float(np.median(known)) if known.size else 0.0
        size = max(float(np.max(np.abs(values))), common) or 1.0
        start = float(values[0]) if abs(values[0]) > ZERO_WITHIN * size else 0.0
        drift = float(np.ptp(values)) / size
        yield TableRow(name_of(s, name), "constant", number(start, FACT_DIGITS), drift)


def name_of(s: Subject, name: str) -> str:
    """Return the name of what is conserved as HTML: words, or the formula if that is its name."""
    system = s.solution.problem.system
    scalars = {*system.coordinates, *system.parameters, "p1", "p2"}
    return inline(name, scalars) if re.search("['^+]| - ", name) else typeset(say(name))


def _start(s: Subject) -> Rows:
    if start := s.scene.facts.start:
        yield _curve("velocity at the start", np.array(start.v), s.solution.start.v)


def _joints(s: Subject) -> Rows:
    """Yield when the events between the ends are passed, and the multipliers of integrals."""
    facts, solution = s.scene.facts, s.solution
    times = [event.t for event in solution.problem.through]
    for k, (known, t) in enumerate(zip(facts.event_times or (), times, strict=False), 1):
        yield _numbers(say("time of event {k} between", k=k), known, t, s.units.time)
    multipliers = facts.integral_multipliers or ()
    for known, kappa in zip(multipliers, solution.problem.kappa, strict=bool(multipliers)):
        yield _numbers(say("multiplier κ"), known, float(kappa), "")


def _contact(s: Subject) -> Rows:
    """Yield the rows of the first part in contact, as long as the force is one number."""
    if not s.touches:
        return
    numbers, (arc, *_) = s.scene.facts.numbers, s.solution.contacts
    force = s.solution.contact_force((arc.begin + arc.end) / 2)[arc.row]
    values = arc.begin, arc.end, float(force), *s.solution.contact_impulses[0].tolist()
    for name, found in zip(CONTACT_NUMBERS, values, strict=True):
        if name in numbers:
            unit = units.html(units.fact_unit(s.scene.name, name))
            yield _numbers(say(name.replace("_", " ")), numbers[name], found, unit)


def _twin(s: Subject) -> Rows:
    facts = s.scene.facts
    if not (facts.twin and facts.gauge):
        return
    twin = scenes.get(facts.twin)
    other = solve(twin.problem, tol=1e-10, guess=twin.guess)
    name = f"<code>{facts.twin}</code>"
    what = say("path of {name}", name=name)
    yield _curve(what, other(s.t), s.q, "the same")
    F = np.asarray(facts.gauge(s.q[:, [0, -1]], s.t[[0, -1]]), dtype=float)
    yield _numbers(
        say("action less that of {name}: F at the end less F at the start", name=name),
        float(F[1] - F[0]),
        s.solution.action - other.action,
        "J s",
    )


def _others(s: Subject) -> Rows:
    for name, value in s.scene.facts.numbers.items():
        if name in CONTACT_NUMBERS:
            continue
        unit = units.html(units.fact_unit(s.scene.name, name))
        yield TableRow(
            say(name.replace("_", " ")), f"{number(float(value), FACT_DIGITS)} {unit}", ""
        )


def _numbers(what: str, expected: float, found: float, unit: str) -> TableRow:
    """Return the row of a number; the difference is relative to the number if that is large."""
    difference = abs(found - expected) / max(1.0, abs(expected))
    if expected == 0 and difference < ZERO_WITHIN:
        found = 0.0
    return TableRow(
        what,
        f"{number(expected, FACT_DIGITS)} {unit}",
        f"{number(found, FACT_DIGITS)} {unit}",
        difference,
    )


def _curve(
    what: str,
    expected: Array,
    found: Array,
    words: str = "closed form",
    least: Array | float = 0.0,
) -> TableRow:
    """Return the row of a curve; the difference is relative to the size of each coordinate.

    That is the largest value it has, or `least` if that is larger.
    """
    a, b = (np.asarray(x, dtype=float).reshape(len(found), -1) for x in (expected, found))
    size = np.maximum(np.max(np.abs(a), axis=1), least)
    size = np.where(size > ZERO_WITHIN * np.max(size), size, np.max(size) or 1.0)[:, None]
    return TableRow(what, words, "", float(np.max(np.abs(a - b) / size)))


def _sizes(s: Subject) -> Array:
    """Return how large each coordinate gets, (n,)."""
    return np.max(np.abs(s.q), axis=1)
