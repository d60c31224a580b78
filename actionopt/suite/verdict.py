"""Judge an answer: by where it is and whether it is stationary, never by the solver's word."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from actionopt.suite.problem import TestProblem
from actionopt.tools.types import Array

VERDICTS = ("right", "other", "new", "wrong", "failed", "limit", "absent")
MEANING = {
    "right": "the optimum",
    "other": "another stationary point that is known",
    "new": "a stationary point that was not known",
    "wrong": "claimed to be an optimum, and not stationary",
    "failed": "the solver gave up, or crashed",
    "limit": "out of time or memory",
    "absent": "the solver is not installed here",
}
# Solvers stop at tolerances of their own, some at 1e-6 in the action: three digits of the path.
NEAR = 1e-3  # in units of the coordinates: the same point
STATIONARY = 1e-4  # relative KKT residual, multipliers fitted


@dataclass(frozen=True)
class Judgement:
    """A verdict and its evidence: distance to the optimum, and relative KKT residual."""

    verdict: str
    distance: float | None = None
    residual: float | None = None


def judge(problem: TestProblem, x: Array, claimed: bool) -> Judgement:
    """Return what to think of x (n,); `claimed` only tells a wrong answer from a failure."""
    astray = "wrong" if claimed else "failed"
    if np.shape(x) != (problem.n,) or not np.all(np.isfinite(x)):
        return Judgement(astray)
    distance, residual = problem.distance(x), problem.residual(x)
    verdict = astray
    if residual <= STATIONARY:
        if distance <= NEAR:
            verdict = "right"
        elif any(problem.distance(x, other) <= NEAR for other in problem.others):
            verdict = "other"
        elif problem.is_near_stationary(x, NEAR):
            verdict = "new"
    return Judgement(verdict, distance, residual if np.isfinite(residual) else None)
