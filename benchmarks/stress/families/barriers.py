"""Over a barrier of given energy, and under it, where there is no path.

Two points in the plane lie on either side of a ridge, V = h (1 + b y^2) exp(-x^2 / 2 w^2)
+ k y^2 / 2: a random one, and one where a motion from there arrives. Asked with the motion's energy
there is an answer; what is found is followed from its own momentum (DOP853), and its error is by
how much it misses the end, and the energy. Of an energy below h no motion passes, and that is to be
said: a path that is called solved is wrong. What it costs to find that there is none is told in
what it costs, in the median, to find one.
"""

from __future__ import annotations

from functools import cache
from time import process_time

import numpy as np
from scipy.integrate import solve_ivp

import actionopt as ao
from benchmarks.stress.case import Case, Criterion, Row, measured, mine
from benchmarks.stress.tally import Outcome, all_solved, judged, never_wrong, row

TITLE = "Barriers and given energies"
COUNT, SEED, TOL = (24, 2), 59, 1e-8
SECONDS = 60.0  # for one question
ACCURACY = 1e-7  # of the reference: a motion near the top of the ridge amplifies 1e-12
LONGEST, FAR = 20.0, 50.0  # time of a motion, and distance
PRICE = 10.0  # that a search which finds nothing may have, in those that find


@cache
def ridge() -> ao.System:
    """Return the system, derived once."""

    def law(q, v, t, *, h, b, w, k):
        barrier = h * (1 + b * q[1] ** 2) * np.exp(-(q[0] ** 2) / (2 * w**2))
        return v @ v / 2 - barrier - k * q[1] ** 2 / 2

    return ao.System(law, ["x", "y"], parameters={"h": 1.0, "b": 1.0, "w": 0.5, "k": 0.0})


class Ridge:
    """A ridge and a motion over it: `values`, its energy, the start, and where it arrives."""

    def __init__(self, random: np.random.Generator) -> None:
        self.h = float(random.uniform(0.5, 2.0))
        parts = random.uniform([0.1, 0.2, 0.0], [2.0, 0.6, 1.0])
        self.values = {"h": self.h, **dict(zip("bwk", parts.tolist(), strict=True))}
        self.E = self.h * (1 + random.uniform(0.1, 1.0))
        while True:
            self.start = np.array([-random.uniform(2, 3), 0.5 * random.uniform(-1, 1)])
            speed = np.sqrt(2 * (self.E - self.potential(self.start)))
            aim = np.arctan2(-self.start[1], -self.start[0]) + random.uniform(-0.2, 0.2)
            velocity = speed * np.array([np.cos(aim), np.sin(aim)])
            self.end = self.arrival(velocity, LONGEST, random.uniform(2, 3))
            if self.end[0] > 1:
                break

    def potential(self, q: np.ndarray) -> float:
        """Return V at q."""
        h, b, w, k = self.values.values()
        hill = h * (1 + b * q[1] ** 2) * np.exp(-(q[0] ** 2) / (2 * w**2))
        return float(hill + k * q[1] ** 2 / 2)

    def arrival(self, v: np.ndarray, T: float, x: float = np.inf) -> np.ndarray:
        """Return where the motion from the start with v is after T, or where it passes x."""
        h, b, w, k = self.values.values()

        def rates(t, y):
            hill = h * np.exp(-(y[0] ** 2) / (2 * w**2))
            along = hill * (1 + b * y[1] ** 2) * y[0] / w**2
            return [y[2], y[3], along, -2 * hill * b * y[1] - k * y[1]]

        def beyond(t, y):
            return y[0] - min(x, FAR)

        beyond.terminal = True  # type: ignore[attr-defined]
        first = [*self.start, *v]
        run = solve_ivp(rates, (0, T), first, "DOP853", events=beyond, rtol=1e-12, atol=1e-13)
        return run.y[:2, -1]


def ask(over: bool, i: int) -> Outcome:
    """Return what came of a question."""
    random = np.random.default_rng([SEED, i])
    made = Ridge(random)
    E = made.E if over else made.h * (1 - random.uniform(0.05, 0.5))
    lowest = max(made.potential(made.start), made.potential(made.end))
    E = max(E, (lowest + made.h) / 2)  # both ends are in its reach
    start, end = ao.Event(0.0, made.start), ao.Event(None, made.end)
    problem = ao.Problem(ridge(), start, end, parameters=made.values, energy=E)
    clock = process_time()
    solution = ao.solve(problem, tol=TOL, throw=False, seconds=SECONDS)
    spent = process_time() - clock

    def error(s: ao.Solution) -> float:
        if not over:
            return np.inf
        missed = made.arrival(s.start.v, s.duration) - made.end
        own = s.start.v @ s.start.v / 2 + made.potential(made.start)
        size = float(np.max(np.abs(s.path.values)))
        return float(max(np.max(np.abs(missed)) / size, abs(own / E - 1)))

    return judged(solution, error, TOL, spent, ACCURACY)


def measure(over: bool, count: int) -> list[Row]:
    """Return the row of energies over the barrier, or under it."""
    return [row([ask(over, i) for i in range(count)])]


def cases(quick: bool) -> list[Case]:
    """Return them."""
    return [measured(kind, measure, kind == "over", COUNT[quick]) for kind in ("over", "under")]


def criteria(rows) -> list[Criterion]:
    """Return them."""
    over, under = mine(rows, "over"), mine(rows, "under")
    price = under[0]["time"] / over[0]["time"]
    worst = under[0]["longest"] / over[0]["time"]
    return [
        never_wrong("over", over),
        all_solved("over", over, 1),
        never_wrong("under", under),
        Criterion(
            "under: time, in that of finding one",
            f"<= {PRICE:.0f} in the median",
            f"{price:.1f}, at most {worst:.0f}",
            price <= PRICE,
        ),
    ]
