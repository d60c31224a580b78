"""Profiles: how many problems a solver has solved at a cost, for all costs.

The *performance profile* of a solver is the fraction of problems it solves within tau times the
cost of the best solver for each; the *data profile* the fraction within alpha evaluations per
unknown and one. Both need no average over problems that some solver did not solve.

Sources: E. D. Dolan and J. J. More, Mathematical Programming 91 (2002), 201-213, eq. (2.1);
J. J. More and S. M. Wild, SIAM J. Optimization 20 (2009), 172-191, eq. (2.8).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from actionopt.tools.types import Array

RIGHT = ("right",)
STATIONARY = ("right", "other", "new")

Records = Sequence[Mapping[str, Any]]


def evaluations(record: Mapping[str, Any]) -> float:
    """Return the calls of all functions together."""
    return float(sum(record.get("evaluations", {}).values()))


def costs(records: Records, measure: str, accepted: Sequence[str]) -> dict[str, Array]:
    """Return each solver's cost of each problem, infinite where the verdict is not `accepted`.

    Parameters
    ----------
    records : sequence of mapping
        As the runner writes them.
    measure : {"seconds", "evaluations", "evaluations per unknown"}
    accepted : sequence of str
        Verdicts that count as solved.
    """
    cells = {(_asked(r), r["solver"]): r for r in records}
    problems = list(dict.fromkeys(asked for asked, _ in cells))
    table = {}
    for solver in dict.fromkeys(r["solver"] for r in records):
        row = np.full(len(problems), np.inf)
        for i, asked in enumerate(problems):
            record = cells.get((asked, solver))
            if record is not None and record["verdict"] in accepted:
                row[i] = _cost(record, measure)
        table[solver] = row
    return table


def _asked(record: Mapping[str, Any]) -> tuple:
    return tuple(record.get(k) for k in ("problem", "elements", "degree", "start"))


def _cost(record: Mapping[str, Any], measure: str) -> float:
    if measure == "seconds":
        return max(float(record["seconds"]), 1e-6)  # a clock's tick: ratios need it positive
    count = max(evaluations(record), 1.0)
    return count / (record["n"] + 1) if measure == "evaluations per unknown" else count


def performance(table: Mapping[str, Array]) -> dict[str, tuple[Array, Array]]:
    """Return each solver's performance profile: its steps' tau, and the fractions reached there.

    Problems that no solver solved count in the denominator.
    """
    best = np.min(list(table.values()), axis=0)
    with np.errstate(invalid="ignore"):
        return {solver: _steps(row / best) for solver, row in table.items()}


def data(table: Mapping[str, Array]) -> dict[str, tuple[Array, Array]]:
    """Return each solver's data profile, for costs in evaluations per unknown and one."""
    return {solver: _steps(row) for solver, row in table.items()}


def _steps(values: Array) -> tuple[Array, Array]:
    reached = np.sort(values[np.isfinite(values)])
    return reached, np.arange(1, reached.size + 1) / max(values.size, 1)
