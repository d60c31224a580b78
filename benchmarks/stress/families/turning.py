"""Published two-point problems: Cash and Mazzia's 15 and 20, Bratu's and Troesch's.

The first two as listed in Cash and Mazzia's test set (problems 15 and 20), with the Lagrangian
whose Euler-Lagrange equation they are; Troesch's slopes from the elliptic closed form, agreeing
with the 60-digit table of Maple 2021; Bratu's u = -2 ln(cosh((t - 1/2) th / 2) / cosh(th / 4))
with th = sqrt(2 lambda) cosh(th / 4), which has two roots.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.special import airy

from actionopt import Event, Problem, System
from benchmarks.stress.case import Case, Criterion, Question, mine, within

TITLE = "Published two-point problems"
P15_WIDTHS = (1e-2, 3e-3, 1e-3, 1e-4)
P20_WIDTHS = (0.5, 0.1, 0.06)
EXTREME = 0.01  # of problem 20: its L varies by a factor of exp(149) along the path
TROESCH = {  # n: velocities at 0 and 1
    10: (0.00035833778463081369041, 148.4064211560101339),
    20: (1.6487731827804035743e-8, 22026.465749406786754),
    30: (7.4860937950438118462e-13, 3269017.372471804737),
}
BRATU = {  # th of the lower and of the upper path, lambda = 1
    "lower": 1.5171645990507543685,
    "upper": 10.9387027721221068,
}
SLOPES = 1e-6  # of Troesch's problem: tol bounds q, and the slope at 1 is 3e6 at n = 30


@cache
def systems() -> dict[str, System]:
    """Return all of them, derived once."""
    return {
        "P15": System(
            lambda q, v, t, *, eps: eps * v[0] ** 2 / 2 + t * q[0] ** 2 / 2,
            ["y"],
            parameters={"eps": 1e-2},
            name="P15",
        ),
        "P20": System(
            lambda q, v, t, *, eps: np.exp(2 * (q[0] - 1) / eps) * (v[0] ** 2 + 1) / 2,
            ["y"],
            parameters={"eps": 0.5},
            name="P20",
        ),
        "Troesch": System(
            lambda q, v, t, *, n: v[0] ** 2 / 2 + np.cosh(n * q[0]),
            ["y"],
            parameters={"n": 10.0},
            name="Troesch",
        ),
        "Bratu": System(
            lambda q, v, t: v[0] ** 2 / 2 - np.exp(q[0]),
            ["u"],
            name="Bratu",
        ),
    }


def p15(eps: float) -> Question:
    """Return eps y'' = t y, 1 at both ends; y = c1 Ai(x) + c2 Bi(x), x = t eps^(-1/3)."""
    scale = eps ** (-1 / 3)

    def pair(t):
        Ai, _, Bi, _ = airy(scale * np.asarray(t, dtype=float))
        return np.array([Ai, Bi])

    left, right = pair(-1.0), pair(1.0)
    c = np.linalg.solve([left, right / right[1]], [1.0, 1.0 / right[1]])
    problem = Problem(
        systems()["P15"], Event(-1.0, [1.0]), Event(1.0, [1.0]), parameters={"eps": eps}
    )
    return Question(problem, lambda t: (c @ pair(t))[None])


def p20(eps: float) -> Question:
    """Return eps y'' = 1 - y'^2 with y = 1 + eps ln cosh((t - 0.745) / eps)."""

    def exact(t):
        x = np.abs(np.asarray(t, dtype=float) - 0.745) / eps
        return np.array([1 + eps * (x + np.log1p(np.exp(-2 * x)) - np.log(2))])

    problem = Problem(
        systems()["P20"], Event(0.0, exact(0.0)), Event(1.0, exact(1.0)), parameters={"eps": eps}
    )
    return Question(problem, exact)


def troesch(n: int) -> Question:
    """Return y'' = n sinh(n y), from 0 to 1."""
    problem = Problem(
        systems()["Troesch"], Event(0.0, [0.0]), Event(1.0, [1.0]), parameters={"n": n}
    )
    return Question(problem)


def slopes(n: int):
    """Return the entry with the larger relative error of the velocities at both ends."""

    def entry(solution):
        found = (solution.start.v[0], solution.end.v[0])
        pairs = zip(found, TROESCH[n], strict=True)
        return {"error": max(abs(a / b - 1) for a, b in pairs)}

    return entry


def bratu(which: str) -> Question:
    """Return u'' + e^u = 0, zero at both ends; the upper path from a parabola of height 4."""
    th = BRATU[which]

    def exact(t):
        t = np.asarray(t, dtype=float)
        return np.array([-2 * np.log(np.cosh((t - 0.5) * th / 2) / np.cosh(th / 4))])

    def parabola(t):
        return np.array([16 * t * (1 - t)])

    problem = Problem(systems()["Bratu"], Event(0.0, [0.0]), Event(1.0, [0.0]))
    return Question(problem, exact, None if which == "lower" else parabola)


def cases(quick: bool) -> list[Case]:
    """Return them."""
    return [
        *(Case(f"P15, eps = {e:g}", lambda e=e: p15(e)) for e in P15_WIDTHS),
        *(Case(f"P20, eps = {e:g}", lambda e=e: p20(e)) for e in P20_WIDTHS),
        Case(f"extreme P20, eps = {EXTREME:g}", lambda: p20(EXTREME)),
        *(Case(f"Troesch, n = {n}", lambda n=n: troesch(n), slopes(n)) for n in TROESCH),
        *(Case(f"Bratu, {w}", lambda w=w: bratu(w)) for w in BRATU),
    ]


def criteria(rows) -> list[Criterion]:
    """Return them."""
    bounds = {"P15": 1e-9, "P20": 1e-9, "Troesch": SLOPES, "Bratu": 1e-9}
    out = []
    for name, bound in bounds.items():
        what = "Troesch, velocities at the ends" if name == "Troesch" else name
        out.append(within(mine(rows, name), bound, what))
    (extreme,) = mine(rows, "extreme")
    honest = not extreme["success"] or extreme["error"] <= bounds["P20"]
    said = f"{extreme['status']}, error {extreme['error']:.0e}"
    out.append(Criterion(extreme["case"], "solved, or said not to be", said, honest))
    return out
