"""Coordinates whose zero is far away: nothing but the numbers may change.

Four systems between seeded ends, each with its place shifted by X, at tol 1e-9: Henon-Heiles, a
pendulum that has turned often (X is rounded to whole turns), Kepler about a centre far away, and
a rod pendulum about a far pivot with the rod as a constraint. The reference is the same question
about zero at tol 1e-12. The tolerance is of |q|, which is X there; an answer is wrong if it is off
by more than three times that, or three times its claim, or by 0.1 at all, or if it has another
index than the one about zero.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

import actionopt as ao
from actionopt import Event, Problem, System
from benchmarks.stress.case import Case, Criterion, Row, every, measured, mine, timed
from benchmarks.stress.tally import judged, right_and_solved, row

TITLE = "Far origins"
SHIFTS = (0.0, 1e2, 1e4, 1e5, 1e6, 1e7)
TOL, FINE = 1e-9, 1e-12
COUNT, SEED = 6, 17
SAMPLES = 500
RESOLVED = 0.1  # a motion of size one that is off by more is another one
TURN = 2 * np.pi


@dataclass(frozen=True)
class Place:
    """A system that can be moved, and the ends asked for about zero.

    Attributes
    ----------
    system : System
        With the shift as its parameter X, unless it repeats itself.
    ends : callable
        A random generator to q0 and q1.
    duration : float
    whole : float
        The shift is a multiple of this, if it is not 0.
    moved : (n,) array
        The coordinates that are shifted are one, the others zero.
    """

    system: System
    ends: Callable
    duration: float
    moved: np.ndarray
    whole: float = 0.0

    def shift(self, X: float) -> float:
        """Return the shift nearest to X that changes nothing."""
        return self.whole * np.round(X / self.whole) if self.whole else X

    def problem(self, ends: np.ndarray, X: float) -> Problem:
        """Return the question between `ends` (2, n), shifted by `X`."""
        q0, q1 = ends + X * self.moved
        parameters = {} if self.whole else {"X": X}
        return Problem(self.system, Event(0.0, q0), Event(self.duration, q1), parameters=parameters)


def henon_heiles(q, v, t, *, X):
    """Return the Lagrangian."""
    x, y = q[0] - X, q[1] - X
    return v @ v / 2 - (x**2 + y**2) / 2 - x**2 * y + y**3 / 3


def turning(q, v, t):
    """Return the Lagrangian of a pendulum beside an oscillator."""
    return v @ v / 2 + 9.81 * np.cos(q[0]) - q[1] ** 2 / 2


def kepler(q, v, t, *, X):
    """Return the Lagrangian."""
    return v @ v / 2 + ((q[0] - X) ** 2 + (q[1] - X) ** 2) ** -0.5


def on_circle(radius, angle):
    """Return the point, the angle counted from below."""
    return radius * np.array([np.sin(angle), -np.cos(angle)])


@cache
def places() -> dict[str, Place]:
    """Return the four, derived once."""

    def near(random):
        return random.uniform(-0.3, 0.3, (2, 2))

    def orbit(random):
        a = random.uniform(-1, 1)
        b = a + random.uniform(1.0, 2.0)
        return [on_circle(random.uniform(0.9, 1.1), x) for x in (a, b)]

    def swing(random):
        return [on_circle(1.0, x) for x in random.uniform(-0.9, 0.9, 2)]

    both, about_zero = np.ones(2), {"X": 0.0}
    hanging = System(
        lambda q, v, t, *, X: v @ v / 2 - 9.81 * (q[1] - X),
        ["x", "y"],
        constraint=lambda q, t, *, X: (q[0] - X) ** 2 + (q[1] - X) ** 2 - 1,
        name="rod",
        parameters=about_zero,
    )
    names = ["x", "y"]
    return {
        "Henon-Heiles": Place(System(henon_heiles, names, parameters=about_zero), near, 6.0, both),
        "pendulum of many turns": Place(
            System(turning, ["theta", "y"]), near, 1.3, np.array([1.0, 0.0]), TURN
        ),
        "Kepler": Place(System(kepler, names, parameters=about_zero), orbit, 1.5, both),
        "rod": Place(hanging, swing, 0.8, both),
    }


def off(solution: ao.Solution, about_zero: ao.Solution, shift: np.ndarray) -> float:
    """Return how far the path is from the one about zero, shifted, in units of the largest |q|."""
    t = np.linspace(about_zero.problem.start.t, about_zero.problem.end.t, SAMPLES)
    known = about_zero(t)
    apart = np.max(np.abs(solution(t) - shift[:, None] - known))
    same = apart <= RESOLVED and solution.morse_index == about_zero.morse_index
    return float(apart / np.max(np.abs(known + shift[:, None]))) if same else np.inf


def measure(name: str, X: float, count: int) -> list[Row]:
    """Return the row of a system and a shift; `alike` counts the verdicts of those about zero."""
    place, random = places()[name], np.random.default_rng(SEED)
    shift, outcomes, alike = place.shift(X), [], 0
    for _ in range(count):
        ends = np.array(place.ends(random))
        about_zero = ao.solve(place.problem(ends, 0.0), tol=FINE, throw=False)
        here, _ = timed(place.problem(ends, 0.0), TOL)
        there, spent = timed(place.problem(ends, shift), TOL)
        alike += here.status is there.status
        by = shift * place.moved
        outcomes.append(judged(there, lambda s, r=about_zero, by=by: off(s, r, by), TOL, spent))
    return [{**row(outcomes), "alike": alike}]


def cases(quick: bool) -> list[Case]:
    """Return them."""
    count = 2 if quick else COUNT
    return [
        measured(f"{name}, X = {X:g}", measure, name, X, count) for name in places() for X in SHIFTS
    ]


def criteria(rows) -> list[Criterion]:
    """Return them."""
    out = []
    for name in places():
        own = mine(rows, name)
        count, alike = sum(r["count"] for r in own), sum(r["alike"] for r in own)
        out += right_and_solved(name, own)
        out.append(every(f"{name}: the verdict about zero", alike, count))
    return out
