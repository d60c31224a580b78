"""Profiles: how many problems a solver has solved at a cost, for all costs.

The *performance profile* of a solver is the fraction of problems it solves within tau times the
cost of the best solver for each: E. D. Dolan and J. J. More, Mathematical Programming 91 (2002),
201-213, eq. (2.1). Solved is what the verdict calls right. Where the best takes less than
`LEAST_TIMED` seconds, the clock measures calls of functions and not solvers: those problems are
left out of profiles of time.

The *data profile* is the fraction of problems for which alpha (n + 1) evaluations of f are enough
for the convergence test

    f(x) <= f_L + tau (f(x_0) - f_L),

f_L being the least f that any solver finds: J. J. More and S. M. Wild, SIAM J. Optimization 20
(2009), 172-191, eqs. (2.2) and (2.8). Here f_L is the least f known of a minimum, if no solver
finds less; what has constraints, which theirs had not, is to violate them by no more than tau, in
units of the coordinates; and f(x_0) may be less than f_L then: their distance is what counts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from actionopt.suite.solvers import is_counted
from actionopt.suite.verdict import UNSCORED, verdict
from actionopt.tools.types import Array

TAUS = (1e-3, 1e-6)
LEAST_TIMED = 0.01  # seconds; ad hoc

Record = Mapping[str, Any]
Records = Sequence[Record]


def costs(records: Records, measure: str, mode: str, accuracy: float) -> dict[str, Array]:
    """Return each solver's cost of each problem, infinite where the verdict is not right.

    Parameters
    ----------
    records : sequence of mapping
        As the runner writes them.
    measure : {"seconds", "f", "grad", ...}
        Processor time, or evaluations of that function.
    mode : {"minimise", "stationary"}
    accuracy : float
        Distance from the stationary point that is allowed, in units of the coordinates.

    Returns
    -------
    dict of str to (problems,) array
        NaN where a solver is not scored, for it was not there or not run. Solvers whose
        evaluations are not counted have no others than seconds.
    """
    if measure != "seconds":
        records = [r for r in records if is_counted(r["solver"])]
    table = _table(records, lambda r: _cost(r, measure, mode, accuracy))
    if measure != "seconds" or not table:
        return table
    long = np.fmin.reduce(list(table.values())) >= LEAST_TIMED
    return {solver: row[long] for solver, row in table.items()}


def _cost(record: Record, measure: str, mode: str, accuracy: float) -> float:
    if verdict(record, mode, accuracy) != "right":
        return np.inf
    if measure == "seconds":
        return max(float(record["seconds"]), 1e-6)  # a clock's tick: ratios need it positive
    return float(max(record["evaluations"].get(measure, 0), 1))


def _table(records: Records, cost: Any) -> dict[str, Array]:
    cells = {(question_key(r), r["solver"]): r for r in records}
    problems = list(dict.fromkeys(where for where, _ in cells))
    table = {}
    for solver in dict.fromkeys(r["solver"] for r in records):
        row = np.full(len(problems), np.nan)
        for i, where in enumerate(problems):
            record = cells.get((where, solver))
            if record is not None and record["outcome"] not in UNSCORED:
                row[i] = cost(record)
        table[solver] = row
    return table


def question_key(record: Record) -> tuple:
    """Return what was asked of the solver: the problem, its mesh, its parameters and the start."""
    parameters = tuple(sorted(record.get("parameters", {}).items()))
    return tuple(record.get(k) for k in ("problem", "elements", "degree", "start")) + parameters


def evaluations_per_unknown(records: Records, tau: float) -> dict[str, Array]:
    """Return each solver's evaluations of f, over n + 1, until the convergence test holds.

    Problems without a least f are left out: those unbounded below, and those of which no minimum
    is known and none was found.
    """
    least = _least(records)
    bounded = [r for r in records if question_key(r) in least and is_counted(r["solver"])]
    return _table(
        bounded, lambda r: _evaluations_to(r, least[question_key(r)], tau) / (r.get("n", 0) + 1)
    )


def _least(records: Records) -> dict[tuple, float]:
    """Return f_L of each problem that has one."""
    found: dict[tuple, float] = {}
    for r in records:
        if r["outcome"] != "answered" or r["unbounded"] or r.get("infeasible"):
            continue
        mine = [r["f_lowest"]] if r.get("f_lowest") is not None else []
        if r.get("at") and not r.get("index"):
            mine.append(r["f_there"])
        if mine:
            found[question_key(r)] = min(found.get(question_key(r), np.inf), *mine)
    return found


def _evaluations_to(record: Record, least: float, tau: float) -> float:
    """Return the evaluations of f until the test holds for the first time."""
    if record["outcome"] != "answered":
        return np.inf
    goal = least + tau * abs(record["f_start"] - least)
    # Values of f have round-off of their own.
    goal += 4 * np.finfo(float).eps * max(abs(least), abs(record["f_start"]))
    return next((float(k) for k, f, v in record["history"] if f <= goal and v <= tau), np.inf)


def performance(table: Mapping[str, Array]) -> dict[str, tuple[Array, Array]]:
    """Return each solver's performance profile: its steps' tau, and the fractions reached there.

    Problems that no solver solved count in the denominator; those a solver is not scored on do not.
    """
    with np.errstate(invalid="ignore"):
        best = np.fmin.reduce(list(table.values()))
        return {solver: _steps(row / best, ~np.isnan(row)) for solver, row in table.items()}


def data(table: Mapping[str, Array]) -> dict[str, tuple[Array, Array]]:
    """Return each solver's data profile, for evaluations over n + 1."""
    return {solver: _steps(row, ~np.isnan(row)) for solver, row in table.items()}


def _steps(values: Array, scored: Array) -> tuple[Array, Array]:
    reached = np.sort(values[np.isfinite(values)])
    return reached, np.arange(1, reached.size + 1) / max(np.count_nonzero(scored), 1)
