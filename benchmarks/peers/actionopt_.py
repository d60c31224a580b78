"""The package itself: a Lagrangian and two events."""

from __future__ import annotations

import numpy as np

import actionopt as ao
from benchmarks.peers._peer import TOLERANCES, Answer, Failed, Peer
from benchmarks.problems import Case, Ends


def _solve(system, case: Case, ends: Ends, tol: float, guess, method: str) -> Answer:
    problem = ao.Problem(system, ao.Event(0.0, ends.start), ao.Event(case.duration, ends.end))
    try:
        solution = ao.solve(problem, tol=tol, guess=guess, method=method)
    except ao.SolveError as error:
        raise Failed(str(error)) from error
    return Answer(solution, solution)


def cold(case: Case, ends: Ends, start: str, tol: float, method: str = "auto") -> Answer:
    """Trace the Lagrangian and solve, with no guess where the straight line is meant."""
    system = ao.System(
        case.lagrangian,
        case.coordinates,
        parameters=case.parameters,
        constraint=case.constraint,
        name=case.name,
    )
    guess = None
    if start != "line":
        knots, points = case.guess(ends, start)
        guess = lambda t: np.stack([np.interp(t, knots, row) for row in points])  # noqa: E731
    return _solve(system, case, ends, tol, guess, method)


def again(answer: Answer, case: Case, ends: Ends, tol: float, method: str = "auto") -> Answer:
    """Solve on the same system from the last solution."""
    return _solve(answer.state.problem.system, case, ends, tol, answer.state, method)


PEER = Peer(("actionopt", "casadi"), TOLERANCES, cold, again)
