"""Maps with holes, folds and degenerate lines: what a sweep finds of what `solve` finds alone.

Every member is solved one by one as well, from nothing. Those that a sweep calls solved are
integrated forward by DOP853 from their own momenta.
"""

from __future__ import annotations

from collections.abc import Callable
from time import process_time
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

import actionopt as ao
from actionopt.tools.types import Array
from benchmarks.stress.case import Case, Criterion, Row, every, mine

TITLE = "Sweeps with failures"
TOL = 1e-8
MISSED = 1e-5  # of the motion's size at its end, from which a member is wrong
SEED, RANDOM = 41, (4, 1)  # random maps, all and quick


def potential(V, names, slope):
    """Return a system of unit masses in V(q, c), and its slope for the integration."""
    law = ao.System(lambda q, v, t, *, c: v @ v / 2 - V(q, c), names, parameters={"c": 1.0})
    return law, slope


def anharmonic():
    """Return an oscillator that grows stiffer: infinitely many paths lead to every end."""
    law = potential(
        lambda q, c: c * q[0] ** 2 / 2 + 0.2 * q[0] ** 4, ["x"], lambda q, c: c * q + 0.8 * q**3
    )
    over = {"t1": np.linspace(0.1, 8.0, 20), ("end", "x"): np.linspace(-3.0, 3.0, 13)}
    return law, ([1.0], [0.5]), over


def bratu(over):
    """Return Bratu's problem: no path from a fold on, at c t1^2 = 3.5138307."""
    law = potential(lambda q, c: c * np.exp(q[0]), ["q"], lambda q, c: c * np.exp(q))
    return law, ([0.0], [0.0]), over


def half_period():
    """Return an oscillator over half its period on one line of the map: a family, or nothing."""
    law = potential(lambda q, c: c**2 * q[0] ** 2 / 2, ["x"], lambda q, c: c**2 * q)
    over = {"c": [0.8, 0.9, 1.0, 1.1, 1.2], ("end", "x"): np.linspace(-1.0, 1.0, 5)}
    return law, ([0.3], [1.0]), over, np.pi


def random_map(k: int) -> tuple[Any, ...]:
    """Return a map of a random bound potential of one or two coordinates."""
    rng = np.random.default_rng([SEED, k])
    n = int(rng.integers(1, 3))
    A = rng.normal(size=(n, n))
    A = A @ A.T + 0.2 * np.eye(n)
    w, b = rng.normal(0.0, 1.5, n), rng.normal(0.0, 1.5)
    law = potential(
        lambda q, c: q @ (A @ q) / 2 + b * np.cos(w @ q + c) + 0.1 * (q @ q) ** 2,
        ["x", "y"][:n],
        lambda q, c: A @ q - b * w * np.sin(w @ q + c) + 0.4 * (q @ q) * q,
    )
    over = (
        {"t1": np.linspace(0.2, 6.0, 30)}
        if k % 2
        else {"t1": np.linspace(0.5, 4.0, 7), ("end", "x"): np.linspace(-1.5, 1.5, 6)}
    )
    return law, tuple(rng.normal(0.0, 0.7, (2, n)).tolist()), over


def measure(law, ends, over, t1=1.0) -> list[Row]:
    """Return one row: what a sweep and `solve` find, and what a retry adds."""
    system, slope = law
    problem = ao.Problem(system, ao.Event(0.0, ends[0]), ao.Event(t1, ends[1]))
    ao.solve(problem, tol=TOL, throw=False)  # deriving a system belongs to the system
    started = process_time()
    runs = ao.sweep(problem, over, tol=TOL)
    spent = process_time() - started
    alone = np.zeros(runs.grid.size, dtype=bool)
    started = process_time()
    for i in range(alone.size):
        alone[i] = ao.solve(runs.grid.member(i), tol=TOL, throw=False).success
    one_by_one = process_time() - started
    again = runs.retry() if runs.failed.any() else runs
    success, unsought = runs.success.ravel(), runs.unsought.ravel()
    wrong = sum(
        _misses(again, i, slope) > MISSED for i in np.flatnonzero(again.success.ravel()).tolist()
    )
    return [
        {
            "status": "SOLVED",
            "success": True,
            "members": int(alone.size),
            "found": int(success.sum()),
            "alone": int(alone.sum()),
            "lost": int((alone & ~success & ~unsought).sum()),
            "unsought": int(unsought.sum()),
            "unsought alone": int((alone & unsought).sum()),
            "lost after retry": int((alone & ~again.success.ravel()).sum()),
            "wrong": int(wrong),
            "seconds": spent,
            "seconds alone": one_by_one,
            "time": spent,
        }
    ]


def _misses(runs: ao.Runs, i: int, slope) -> float:
    """Return how far the motion of a member ends from its end, in its own size."""
    problem = runs.grid.member(i)
    n, c = problem.system.n, float(problem.parameters["c"])
    ends, momenta = (x.reshape(-1, 2, n)[i] for x in (runs.ends, runs.momenta))

    def rates(t: float, y: Array) -> Array:
        return np.concatenate([y[n:], -slope(y[:n], c)])

    first = np.concatenate([ends[0], momenta[0]])
    times = problem.start.t, problem.end.t
    motion = solve_ivp(rates, times, first, method="DOP853", rtol=1e-12, atol=1e-13).y
    size = np.abs(motion[:n]).max()
    asked = np.abs(ends - np.array([problem.start.q, problem.end.q], dtype=float)).max()
    return max(float(np.abs(motion[:n, -1] - ends[1]).max() / size), float(asked / size))


MAPS: dict[str, Callable[[], Any]] = {
    "anharmonic": anharmonic,
    "half a period": half_period,
    "fold, one axis": lambda: bratu({"c": np.linspace(3.0, 4.1, 8)}),
    "fold, two axes": lambda: bratu(
        {"c": np.linspace(1.0, 6.0, 6), "t1": np.linspace(0.3, 1.3, 4)}
    ),
}


def cases(quick: bool) -> list[Case]:
    """Return them."""
    maps = MAPS | {f"random {k}": lambda k=k: random_map(k) for k in range(RANDOM[quick])}
    return [Case(name, measure=lambda made=made: measure(*made())) for name, made in maps.items()]


def criteria(rows) -> list[Criterion]:
    """Return them."""
    own = mine(rows)
    count = {name: sum(r[name] for r in own) for name in ("members", "found", "alone", "wrong")}
    lost, after = (sum(r[name] for r in own) for name in ("lost", "lost after retry"))
    unsought = sum(r["unsought alone"] for r in own)
    all_found = [r for r in own if r["alone"] == r["members"]]
    dear = max(r["seconds"] / r["seconds alone"] for r in own)
    return [
        every(
            "members called solved that are motions",
            count["found"] - count["wrong"],
            count["found"],
        ),
        Criterion(
            "members that `solve` finds and the sweep does not, nor says so",
            "0",
            str(lost),
            not lost,
        ),
        Criterion("the same after `retry`", "0", str(after), not after),
        Criterion(
            "members: found by the sweep, by `solve` one by one",
            "told, not asked",
            f"{count['found']} and {count['alone']} of {count['members']}; not searched for at "
            f"length {unsought} that `solve` finds",
            True,
        ),
        Criterion(
            "maps of which `solve` finds all: found",
            f"{sum(r['members'] for r in all_found)}",
            f"{sum(r['found'] for r in all_found)}",
            all(r["found"] == r["members"] for r in all_found),
        ),
        Criterion(
            "time, in that of `solve` one by one", "told, not asked", f"at most {dear:.2f}", True
        ),
    ]
