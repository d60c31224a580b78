"""Layers at the ends: L = eps^2 v^2 / 2 + q^2 / 2 from 1 to 1 over unit time."""

from __future__ import annotations

from functools import cache

import numpy as np

from actionopt import Event, Problem, System
from benchmarks.stress.case import Case, Criterion, Question, mine, within

TITLE = "Layers"
WIDTHS = tuple(10.0**-k for k in range(2, 7))


@cache
def system() -> System:
    """Return it, derived once."""
    return System(
        lambda q, v, t, *, eps: eps**2 * v[0] ** 2 / 2 + q[0] ** 2 / 2,
        ["q"],
        parameters={"eps": 1e-2},
        name="layer",
    )


def layer(eps: float) -> Question:
    """Return the question; q = cosh((t - 1/2) / eps) / cosh(1 / (2 eps)), safe from overflow."""

    def exact(t):
        return np.array([np.exp(-t / eps) + np.exp(-(1 - t) / eps)]) / (1 + np.exp(-1 / eps))

    return Question(
        Problem(system(), Event(0.0, [1.0]), Event(1.0, [1.0]), parameters={"eps": eps}), exact
    )


def cases(quick: bool) -> list[Case]:
    """Return them."""
    return [Case(f"eps = {eps:.0e}", lambda eps=eps: layer(eps)) for eps in WIDTHS]


def criteria(rows) -> list[Criterion]:
    """Return them."""
    own = mine(rows)
    count = np.array([r["unknowns"] for r in own])
    a_decade = np.diff(count)
    growth = count[-1] / count[0]
    allowed = np.log(WIDTHS[-1]) / np.log(WIDTHS[0])
    return [
        within(own, 1e-9),
        Criterion(
            "growth of unknowns, eps = 1e-2 to 1e-6",
            f"<= {allowed:.1f}, that of log(1 / eps)",
            f"{growth:.2f} ({', '.join(map(str, count))}; a decade adds at most {a_decade.max()})",
            bool(growth <= allowed),
        ),
    ]
