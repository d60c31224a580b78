"""From the path at hand to a solution, and to the sentence that says what it is."""

from __future__ import annotations

from collections.abc import Iterator
from time import perf_counter
from typing import Any

import numpy as np

from actionopt.analysis.solution import Solution
from actionopt.analysis.status import Status
from actionopt.mechanics.question.problem import Problem
from actionopt.solver.refinement.iterate import POLYNOMIAL_ROUNDOFF
from actionopt.solver.refinement.workspace import Workspace

# Verdicts on paths of which nothing is known but what their mesh leaves out.
UNKNOWN = (Status.NOT_FOUND, Status.OUT_OF_TIME, Status.UNRESOLVED)


def solution_of(ws: Workspace, status: Status, found_by: str, started: float) -> Solution:
    """Return the path at hand as a solution; `started` is when the search began."""
    here, record = ws.here, ws.record
    with record.clock("verify"):
        problem, found = ws.answer()
        with np.errstate(over="ignore", invalid="ignore"):  # of an attempt L may be infinite
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
    # Only a path that is resolved may claim an error within the tolerance: another one's, read off
    # its mesh alone, may be far too small.
    unknown = status in UNKNOWN and here.error <= ws.tol
    lam, error = found.rows.T, np.inf if unknown else here.error
    return Solution(problem, found.path, action, lam, error, status, stats, known=found)


def message_of(solution: Solution, tol: float, hint: str = "", reason: str = "") -> str:
    """Return the verdict with its figures, and what to try next.

    A `reason` that is known stands in place of those that may be.
    """
    problem, status = solution.problem, solution.status
    if status is Status.NOT_FOUND and problem.system.m and not reason:
        reason = "; ".join(_events_off_constraints(problem))
    verdict = f"{status.value.partition(': (a)')[0]}: {reason}" if reason else status.value
    figures = f"tol = {tol:g}, error estimate {solution.error:.2g}"
    if status in (Status.FLOOR, Status.DEGENERATE):
        figures += f", condition about {solution.stats['condition']:.1g}"
    hint = f"; {hint}" if hint else ""
    if problem.origin is not None:
        i = int(np.argmax(problem.scales / problem.lengths))
        size = problem.scales[i]
        hint += (
            f"; {problem.system.coordinates[i]} is about {size:.3g} and known to "
            f"{np.spacing(size):.1g} only: measure it from a point near the motion"
        )
    if not status.success and any(problem.singular_ends):
        roles = [x for x, end in zip(("start", "end"), problem.singular_ends, strict=True) if end]
        hint += (
            f"; L is not finite at the {' and the '.join(roles)}, whatever the velocity: put the "
            "event a little beside (`trace` may then follow the path towards it), or use "
            "coordinates in which the place is regular"
        )
    if status is Status.NOT_FOUND:
        from actionopt.solver.refinement.ipopt import ABSENT, is_there

        if not is_there():
            hint += f"; {ABSENT}, which finds some paths that nothing else does"
    return f"{problem.name}: {verdict} ({figures}){hint}"


def _events_off_constraints(problem: Problem) -> Iterator[str]:
    """Yield which end gives coordinates with which no point of the constraints was found."""
    from actionopt.discrete.borders.surfaces import TRIED_PLACES, onto

    system, names = problem.system, problem.system.coordinates
    spread = np.random.default_rng(0).standard_normal((TRIED_PLACES, system.n))
    ends = ("start", problem.start), ("end", problem.end)
    for role, event in ends[: 1 if problem.advance is not None else 2]:
        free = [name for name, x in zip(names, event.q, strict=True) if x is None]
        if event.t is None or not event.pinned or not free:
            continue
        times = np.full(TRIED_PLACES, event.t)
        with np.errstate(all="ignore"):
            found = onto(problem, event, spread * problem.scales, times, problem.scales)
        if not np.isfinite(found).all(axis=1).any():
            yield (
                f"no {' and '.join(free)} was found with which the {role} event keeps the "
                "constraints; change what it gives"
            )
