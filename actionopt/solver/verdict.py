"""From the path at hand to a solution, with what the record tells of the search."""

from __future__ import annotations

from time import perf_counter
from typing import Any

import numpy as np

from actionopt.analysis.solution import Solution
from actionopt.analysis.status import Status
from actionopt.solver.iterate import POLYNOMIAL_ROUNDOFF
from actionopt.solver.workspace import Workspace


def solution_of(ws: Workspace, status: Status, found_by: str, started: float) -> Solution:
    """Return the path at hand as a solution; `started` is when the search began."""
    here, record = ws.here, ws.record
    with record.clock("verify"):
        problem, found = ws.answer()
        action = found.action
        if status.success and not np.isfinite(action):
            status = Status.UNRESOLVED
        found.tr.forget()  # many solutions may be kept
    record.time["total"] = perf_counter() - started
    stats: dict[str, Any] = {
        "rung": found_by,
        "unknowns": found.tr.layout.unknowns,
        "rows": found.tr.layout.rows,
        "iterations": dict(record.iterations),
        "evaluations": dict(record.evaluations),
        "rounds": record.rounds,
        "gain": here.gain,
        "noise": here.noise,
        "condition": max(here.noise / POLYNOMIAL_ROUNDOFF, 1.0),
        "derived": problem.system.derived,
        "time": dict(record.time),
    }
    lam, error = found.rows.T, here.error
    return Solution(problem, found.path, action, lam, error, status, stats, known=found)
