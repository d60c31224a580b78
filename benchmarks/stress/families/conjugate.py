"""Past many conjugate points, and exactly at one: the oscillator, w = 1."""

from __future__ import annotations

import numpy as np

from actionopt import Event, Problem, System, scenes
from benchmarks.stress.case import Case, Criterion, Question, condition, mine, within

TITLE = "Conjugate points"
FAR, CONJUGATE = 30.5 * np.pi, 3 * np.pi


def system() -> System:
    """Return the oscillator."""
    return scenes.get("oscillator").problem.system


def far() -> Question:
    """Return the question over 30.5 pi, with 30 conjugate points on the way."""
    b = (0.3 - np.cos(FAR)) / np.sin(FAR)
    problem = Problem(system(), Event(0.0, [1.0]), Event(FAR, [0.3]))
    return Question(problem, lambda t: np.array([np.cos(t) + b * np.sin(t)]), tol=1e-10)


def at(end: float) -> Question:
    """Return the question that has no answer, or (from 1 to -1) a family of them."""
    return Question(Problem(system(), Event(0.0, [1.0]), Event(CONJUGATE, [end])))


def cases(quick: bool) -> list[Case]:
    """Return them."""
    return [
        Case("30.5 pi", far),
        Case("3 pi, no path", lambda: at(0.3), condition, peers=False),
        Case("3 pi, a family of paths", lambda: at(-1.0), peers=False),
    ]


def criteria(rows) -> list[Criterion]:
    """Return them."""
    long, none, family = mine(rows)
    said = (none["status"], family["status"])
    return [
        within([long], 1e-10, "30.5 pi"),
        Criterion(
            "exactly 3 pi: a diagnosis, not a number",
            "DEGENERATE",
            ", ".join(said) + f", condition {none['condition']:.0e}",
            set(said) == {"DEGENERATE"},
        ),
    ]
