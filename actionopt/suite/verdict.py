"""Judge an answer by what was asked: a minimum, a stationary point, or a saddle of index 1.

What a solver is asked decides what is right. *minimise*: a local minimum, of no larger f than the
known optimum; or the word "unbounded" where f is. *stationary*: the known optimum, be it a saddle.
The evidence is collected once, and holds for both and for any accuracy.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from actionopt.suite.member import Member
from actionopt.tools.types import Array

VERDICT_MODES = ("minimise", "stationary")
SADDLE_QUESTION = "saddle"  # asked for apart from the others
VERDICT_MEANING = {
    "minimise": {
        "right": "a local minimum, with f not above that of the known optimum; or 'unbounded', "
        "where f is, with a feasible point far below the optimum and the start; or 'infeasible', "
        "where nothing is feasible, with a point that violates hardly more than any must",
        "other": "a local minimum with a larger f",
        "saddle": "a stationary point that is no minimum",
        "wrong": "claimed to be an optimum and not stationary, or 'unbounded' where f is not",
    },
    "stationary": {
        "right": "the known optimum, be it a minimum or a saddle",
        "other": "another stationary point that is known",
        "new": "a stationary point that was not known",
        "wrong": "claimed to be an optimum, and not stationary",
    },
    SADDLE_QUESTION: {
        "right": "a stationary point of index 1, known or not: the highest point of a way over",
        "other": "a stationary point of another index, such as a minimum",
        "wrong": "claimed to be a saddle, and not stationary",
    },
}
UNJUDGED = {
    "failed": "the solver gave up, or crashed",
    "limit": "out of time or memory",
    "error": "a mistake in the solver's file: a failure",
    "absent": "the solver is not installed here, or takes no constraints: not scored",
}
UNSCORED = ("absent",)
WORST_LAST = ("right", "other", "new", "saddle", "failed", "wrong")
# Solvers stop at tolerances of their own, some at 1e-6 in the action: three digits of the path.
SAME_POINT = 1e-3  # in units of the coordinates: the same point
ACCURACIES = (SAME_POINT, 1e-6)
# Newton's step, in units of the coordinates, beyond which no stationary point is looked for: near
# one it is the distance, where f is quadratic so far away. Ad hoc.
NEAR = 1.0
# Times the sizes of f that are known: what so far below is found, has no bottom; ad hoc.
FAR_BELOW = 1e3
# Times the least violation of what is infeasible: evidence for it. Solvers lessen sums, not the
# largest; ad hoc.
NEAR_LEAST = 2.0
SAME_VALUE = 1e-9  # relative: values of f that differ less are the same


@dataclass(frozen=True)
class Evidence:
    """What is known of an answer.

    Attributes
    ----------
    distance : float or None
        From the known optimum, in units of the coordinates; None of what is no answer.
    residual : float or None
        Newton's step for the conditions of first order, in units of the coordinates.
    f, violation : float or None
        Objective there, and the largest constraint.
    at : {"optimum", "other", "new"} or None
        Which stationary point is within `SAME_POINT`.
    off : float or None
        How far that is.
    f_there, index : float, int or None
        Its objective and index; None where that is degenerate.
    above : bool
        Whether its f is larger than that of the known optimum.
    far_below : bool
        Whether x is feasible and f so far below that there is no bottom.
    least : bool
        Whether nothing is feasible, and x violates hardly more than anything does.
    """

    distance: float | None = None
    residual: float | None = None
    f: float | None = None
    violation: float | None = None
    at: str | None = None
    off: float | None = None
    f_there: float | None = None
    index: int | None = None
    above: bool = False
    far_below: bool = False
    least: bool = False


def examine(problem: Member, x: Array, x0: Array) -> Evidence:
    """Return what there is to know of x (n,), which a solver came to from x0."""
    if np.shape(x) != (problem.n,) or not np.all(np.isfinite(x)):
        return Evidence()
    if problem.infeasible:
        violation = problem.violation(x)
        least = violation <= NEAR_LEAST * problem.least_violation
        return Evidence(f=_finite(problem.objective(x)), violation=violation, least=least)
    distance, residual = problem.distance(x), problem.residual(x)
    facts = {
        "distance": distance,
        "residual": _finite(residual),
        "f": _finite(problem.objective(x)),
        "violation": _finite(problem.violation(x)),
        "far_below": _is_far_below(problem, x, x0),
    }
    at, off, point = None, None, None
    if distance <= SAME_POINT:
        at, off, point = "optimum", distance, problem.optimum
    else:
        for other in problem.others:  # where it is degenerate, Newton's step tells nothing
            if (away := problem.distance(x, other.x)) <= SAME_POINT:
                at, off, point = "other", away, other
        near = at is None and residual <= NEAR
        if near and (point := problem.nearest(x, SAME_POINT)) is not None:
            at, off = "new", problem.distance(x, point.x)
    if point is None:
        return Evidence(**facts)
    level = SAME_VALUE * max(abs(problem.f_star), problem.f_unit)
    above = point.f > problem.f_star + level
    return Evidence(**facts, at=at, off=off, f_there=point.f, index=point.index, above=above)


def _is_far_below(problem: Member, x: Array, x0: Array) -> bool:
    known = np.array([problem.objective(x0), problem.f_star])
    size = max(float(np.max(np.abs(known))), problem.f_unit)
    # Far away, what round-off leaves of a row is in proportion to its terms.
    violation, away = problem.violation(x), float(np.max(np.abs(x / problem.unit), initial=1.0))
    f = problem.objective(x)
    return bool(f < known.min() - FAR_BELOW * size and violation <= SAME_POINT * max(away, 1.0))


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def verdict(record: Mapping[str, Any], mode: str, accuracy: float = SAME_POINT) -> str:
    """Return the verdict on a record, as the runner writes it, for one mode and accuracy.

    A solver's word counts: "unbounded" and "infeasible" are right with evidence where it is so. To
    claim an optimum that is none, or no bottom where there is one, is wrong. To give up is a
    failure, and so is "infeasible" of what is feasible, which solvers say of where they came to.
    Of solves that differ, the worst counts.
    """
    if record["outcome"] != "answered":
        return record["outcome"]
    asked = {name: record.get(name) for name in ("unbounded", "infeasible")}
    answers = [record, *(other | asked for other in record.get("differing", ()))]
    return max((_verdict(answer, mode, accuracy) for answer in answers), key=WORST_LAST.index)


def _verdict(record: Mapping[str, Any], mode: str, accuracy: float) -> str:
    minimise = mode == "minimise"
    if record.get("infeasible") and record["said"] == "infeasible":
        return "right" if record.get("least") else "failed"
    if minimise and record["said"] == "unbounded":
        if not record["unbounded"]:
            return "wrong"
        if record.get("far_below"):
            return "right"
    if mode == SADDLE_QUESTION:
        if record.get("off", np.inf) <= accuracy:
            return "right" if record.get("index") == 1 else "other"
        return "wrong" if record["said"] == "solved" else "failed"
    if record.get("off", np.inf) <= accuracy:
        return _of_minimum(record) if minimise else _of_point(record)
    claims = ("solved", "unbounded") if minimise else ("solved",)
    return "wrong" if record["said"] in claims else "failed"


def _of_minimum(record: Mapping[str, Any]) -> str:
    if record.get("index"):
        return "saddle"
    return "other" if record.get("above") else "right"


def _of_point(record: Mapping[str, Any]) -> str:
    return {"optimum": "right", "other": "other", "new": "new"}[record["at"]]


def meaning(mode: str) -> dict[str, str]:
    """Return the verdicts of a mode, in their order, and what they mean."""
    return VERDICT_MEANING[mode] | UNJUDGED
