"""Pulses and steps of the time alone that no sample sees, of a body and of a beam.

L = v^2 / 2 + k f((t - c) / w) q / w from 0 to 1 in unit time, f of unit area: a Gaussian,
1 / cosh^2, a Lorentzian or (1 + s^2)^-1.5; for steps its integral in place of f / w; for beams
a^2 / 2 in place of v^2 / 2. c is random, on a grid, or at an end; the widths w are parts of the
duration. The references are closed forms: f integrated twice, and of steps and beams what the limit
and the second moment of f leave of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.special import erf

import actionopt as ao
from benchmarks.stress.case import Case, Criterion, Row, measured, mine, timed
from benchmarks.stress.tally import Outcome, all_solved, judged, never_wrong, right_and_solved, row

TITLE = "Pulses in time, hidden from samples"
WIDTHS = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7)
TOLERANCES = (1e-3, 1e-6, 1e-9)
COUNT, SEED = (24, 3), 47  # of each kind and width, all and quick
ROUGH = 10.0  # k times a power of w, by which limits differ from what they stand for
NARROW_BEAM = 1e-5  # from where on round-off forbids more than that it is told


@dataclass(frozen=True)
class Form:
    """A pulse f(s), f integrated once and twice, and its second moment; none if it has none."""

    f: Callable
    once: Callable
    twice: Callable
    moment: float | None = None


FORMS = {
    "Gaussian": Form(
        lambda s: np.exp(-(s**2)) / np.sqrt(np.pi),
        lambda s: (1 + np.tanh(s)) / 2,  # in steps: there is no erf to be traced
        lambda s: (s * (1 + erf(s)) + np.exp(-(s**2)) / np.sqrt(np.pi)) / 2,
        0.5,
    ),
    "1 / cosh^2": Form(
        lambda s: 1 / np.cosh(s) ** 2 / 2,
        lambda s: 1 / (1 + np.exp(-2 * s)),
        lambda s: np.logaddexp(0, 2 * s) / 2,
        np.pi**2 / 12,
    ),
    "Lorentzian": Form(
        lambda s: 1 / (np.pi * (1 + s**2)),
        lambda s: 0.5 + np.arctan(s) / np.pi,
        lambda s: s / 2 + (s * np.arctan(s) - np.log1p(s**2) / 2) / np.pi,
    ),
    "tail": Form(
        lambda s: (1 + s**2) ** -1.5 / 2,
        lambda s: (1 + s / np.sqrt(1 + s**2)) / 2,
        lambda s: (s + np.sqrt(1 + s**2)) / 2,
    ),
}
LIMITED = ("Gaussian", "1 / cosh^2")  # forms of which a limit and a moment tell enough
KINDS = ("pulse", "step", "beam")


@cache
def system(kind: str, form: str) -> ao.System:
    """Return the system, derived once."""
    known = FORMS[form]

    def force(t, k, c, w):
        return k * (known.once((t - c) / w) if kind == "step" else known.f((t - c) / w) / w)

    def body(q, v, t, *, k, c, w):
        return v[0] ** 2 / 2 + force(t, k, c, w) * q[0]

    def beam(q, v, a, t, *, k, c, w):
        return a[0] ** 2 / 2 + force(t, k, c, w) * q[0]

    law = beam if kind == "beam" else body
    return ao.System(law, ["x"], parameters={"k": 1.0, "c": 0.5, "w": 0.1})


def exact(kind: str, form: str, k: float, c: float, w: float) -> tuple[Callable, float]:
    """Return the path from 0 to 1 in unit time, and the accuracy of the formula."""
    known, square = FORMS[form], np.pi**2 / 12 * w**2  # of both steps
    if kind == "beam":  # simply supported: x'''' = -k f
        assert known.moment is not None

        def bent(u):
            return k * np.where(u > 0, u**3 + 3 * u * known.moment * w**2, 0.0) / 6

        third = k * (1 - c) / 6
        first = 1 - third + bent(np.array(1 - c))
        return lambda t: first * t + third * t**3 - bent(t - c), ROUGH * k * w**3

    def twice(t):
        if kind == "step":
            return k * np.where(t > c, (t - c) ** 2 + square, 0.0) / 2
        return k * w * known.twice((t - c) / w)

    def path(t):
        first, last = twice(np.array(0.0)), twice(np.array(1.0))
        return t + twice(t) - first * (1 - t) - last * t

    return path, ROUGH * k * w**2 if kind == "step" else 0.0


def ask(kind: str, width: float, i: int) -> Outcome:
    """Return what came of a question."""
    random = np.random.default_rng([SEED, KINDS.index(kind), WIDTHS.index(width), i])
    form = str(random.choice(list(FORMS) if kind == "pulse" else LIMITED))
    k = float(random.choice([0.3, 3.0, 30.0]))
    anywhere, grid = random.uniform(0.02, 0.98), int(random.integers(1, 20)) / 20
    ends = (0.0, 1.0) if kind == "pulse" else (anywhere,)
    c = float(random.choice([anywhere, anywhere, grid, random.choice(ends)]))
    tol = TOLERANCES[i % len(TOLERANCES)]
    values = {"k": k, "c": c, "w": width}
    start, end = ao.Event(0.0, [0.0]), ao.Event(1.0, [1.0])
    problem = ao.Problem(system(kind, form), start, end, parameters=values)
    solution, spent = timed(problem, tol)
    path, accuracy = exact(kind, form, k, c, width)
    t = np.unique(np.r_[np.linspace(0, 1, 401), np.clip(c + width * np.linspace(-8, 8, 33), 0, 1)])
    known = path(t)
    size = float(np.max(np.abs(known)))

    def error(s: ao.Solution) -> float:
        return float(np.max(np.abs(s(t)[0] - known))) / size

    return judged(solution, error, tol, spent, accuracy / size)


def measure(kind: str, width: float, count: int) -> list[Row]:
    """Return the row of a kind and width."""
    return [row([ask(kind, width, i) for i in range(count)])]


def cases(quick: bool) -> list[Case]:
    """Return them."""
    return [
        measured(f"{kind} of {width:.0e}", measure, kind, width, COUNT[quick])
        for kind in KINDS
        for width in WIDTHS
    ]


def criteria(rows) -> list[Criterion]:
    """Return them."""
    found = []
    for kind in KINDS:
        own = mine(rows, kind)
        if kind == "beam":
            found.append(never_wrong("beams", own))
            known = [r for r in own if float(r["case"].split()[-1]) >= NARROW_BEAM]
            found.append(all_solved(f"beams, widths of {NARROW_BEAM:.0e} and more", known))
        else:
            found += right_and_solved(f"{kind}s", own, 0.05)
    return found
