"""Times far from zero, of which 64 bits hold only so much.

L = (v^2 - x^2) / 2 + 5 cos(3 t) x from t0 to t0 + 100, between seeded ends, and the same without
the force between times that are large, or next to each other. The motion is known in closed form,
evaluated with 64-bit mantissas. Where the resolution of t forbids the tolerance, FLOOR is right
if it says so; solved or not, the true error is to be within the error that is claimed.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from time import process_time

import numpy as np

import actionopt as ao
from actionopt import Event, Problem, System
from benchmarks.stress.case import Case, Criterion, Row, every, measured, mine
from benchmarks.stress.tally import judged, never_wrong, row

TITLE = "Far clocks"
STARTS = (0.0, 1e3, 1e6, 1e9, 1.7e9)
TOLERANCES = (1e-5, 1e-6, 1e-7, 1e-8)
DURATION, FREQUENCY, AMPLITUDE = 100.0, 3.0, 5.0
STEADY = ((1e12, 2.0), (1e15, 4.0), (-1e15, 4.0), (1e9, 0.0), (1e12, 0.0), (1e15, 0.0))
COUNT, SEED = 2, 19
SAMPLES = 2001
ACCURACY = 1e-13  # of the closed form, in units of the largest |q|
MOST = 50_000  # unknowns
SAID = "are known to"  # what a FLOOR says that comes from the resolution of time


@cache
def system(forced: bool) -> System:
    """Return it, derived once."""
    amplitude = AMPLITUDE if forced else 0.0
    return System(
        lambda q, v, t: (
            (v[0] ** 2 - q[0] ** 2) / 2
            + (amplitude * np.cos(FREQUENCY * t) * q[0] if forced else 0.0)
        ),
        ["x"],
        name="forced oscillator" if forced else "oscillator",
    )


def motion(t0: float, t1: float, a: float, b: float, amplitude: float) -> Callable:
    """Return x(t) of x'' = -x + amplitude cos(3 t) through (t0, a) and (t1, b).

    3 t is exact in 64 bits of mantissa for every float t, and so is t - t0.
    """

    def particular(t):
        return amplitude / (1 - FREQUENCY**2) * np.cos(FREQUENCY * np.asarray(t, np.longdouble))

    T = np.longdouble(t1) - np.longdouble(t0)
    c = a - particular(t0)
    s = (b - particular(t1) - c * np.cos(T)) / np.sin(T)

    def x(t):
        since = np.asarray(t, np.longdouble) - np.longdouble(t0)
        return c * np.cos(since) + s * np.sin(since) + particular(t)

    return x


def off(solution: ao.Solution, exact: Callable) -> float:
    """Return the true error in units of the largest |q|, at times that floats can tell apart."""
    t0, t1 = solution.problem.start.t, solution.problem.end.t
    t = np.unique(np.linspace(t0, t1, SAMPLES))
    known = exact(t)
    return float(np.max(np.abs(solution(t)[0] - known)) / np.max(np.abs(known)))


def measure(t0: float, t1: float, forced: bool, tol: float, count: int) -> list[Row]:
    """Return the row of a start and a tolerance.

    `within` counts the answers whose true error is within their claim; `explained` those that are
    solved, or a FLOOR that says that it is the clock's; `unknowns` is the most.
    """
    outcomes, within, explained, unknowns = [], 0, 0, 0
    for a, b in np.random.default_rng(SEED).uniform(-1, 1, (count, 2)):
        problem = Problem(system(forced), Event(t0, [a]), Event(t1, [b]))
        exact = motion(t0, t1, a, b, AMPLITUDE if forced else 0.0)
        solution, right, spent = asked(problem, tol)
        outcomes.append(judged(solution, lambda s, e=exact: off(s, e), tol, spent, ACCURACY))
        within += off(solution, exact) <= solution.error + ACCURACY
        explained += right
        unknowns = max(unknowns, solution.stats["unknowns"])
    return [{**row(outcomes), "within": within, "explained": explained, "unknowns": unknowns}]


def asked(problem: Problem, tol: float) -> tuple[ao.Solution, bool, float]:
    """Return the solution, whether its verdict is explained, and the time it took.

    A verdict is explained that is SOLVED, or FLOOR with a message of times that are too coarse.
    """
    problem.system.pointwise("second")  # deriving a system belongs to the system
    clock = process_time()
    try:
        return ao.solve(problem, tol=tol), True, process_time() - clock
    except ao.SolveError as error:
        solution = error.solution
        explained = solution.status is ao.Status.FLOOR and SAID in str(error)
        return solution, explained, process_time() - clock


def cases(quick: bool) -> list[Case]:
    """Return them."""
    count = 2 if quick else COUNT
    far = [
        measured(
            f"forced, t0 = {t0:g}, tol {tol:.0e}", measure, t0, t0 + DURATION, True, tol, count
        )
        for t0 in STARTS
        for tol in TOLERANCES
    ]
    steady = [
        measured(
            f"steady, t0 = {t0:g}, " + (f"{T:g} later" if T else "the next float"),
            measure,
            *(t0, t0 + T if T else np.nextafter(t0, np.inf), False, 1e-8, count),
        )
        for t0, T in STEADY
    ]
    return far + steady


def criteria(rows) -> list[Criterion]:
    """Return them."""
    out = []
    for what in ("forced", "steady"):
        own = mine(rows, what)
        count = sum(r["count"] for r in own)
        out.append(never_wrong(what, own))
        for name, key in (
            ("true error within the claim, solved or not", "within"),
            ("solved, or FLOOR for the resolution of time", "explained"),
        ):
            out.append(every(f"{what}: {name}", sum(r[key] for r in own), count))
        most = max(r["unknowns"] for r in own)
        out.append(Criterion(f"{what}: unknowns", f"<= {MOST}", f"{most}", most <= MOST))
    return out
