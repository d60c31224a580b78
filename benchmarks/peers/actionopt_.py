"""The package itself: a Lagrangian and two events."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

import actionopt as ao
from benchmarks.peers._peer import TOLERANCES, Answer, Failed, Peer
from benchmarks.problems import Case, Ends

ANSWERS = ("ends", "energy", "orbit", "infinity")
Method = Literal["auto", "ipopt"]


def _asked(system: ao.System, case: Case, ends: Ends) -> ao.Problem:
    start, end = ao.Event(0.0, ends.start), ao.Event(case.duration, ends.end)
    if case.asks == "energy":
        end = ao.Event(None, ends.end)
    elif case.asks == "orbit":
        end = ao.Periodic(None)
    elif case.asks == "infinity":
        start, end = ao.Event(-math.inf, ends.start), ao.Event(math.inf, ends.end)
    return ao.Problem(system, start, end, energy=case.energy)


def _solve(system: ao.System, case: Case, ends: Ends, tol: float, guess, method: Method) -> Answer:
    try:
        solution = ao.solve(_asked(system, case, ends), tol=tol, guess=guess, method=method)
    except ao.SolveError as error:
        raise Failed(str(error)) from error
    if case.asks == "infinity":
        return Answer(lambda t: solution(t - case.duration / 2), solution)
    return Answer(solution, solution, solution.duration if case.energy is not None else None)


def _system(case: Case) -> ao.System:
    given = {"parameters": case.parameters, "constraint": case.constraint, "name": case.name}
    if case.length is not None:
        return ao.System.geodesic(case.length, case.coordinates, **given)
    return ao.System(case.lagrangian, case.coordinates, **given)


def cold(case: Case, ends: Ends, start: str, tol: float, method: Method = "auto") -> Answer:
    """Trace the Lagrangian and solve, with no guess where the straight line is meant."""
    guess = None
    if start != "line":
        knots, points = case.guess(ends, start)
        guess = lambda t: np.stack([np.interp(t, knots, row) for row in points])  # noqa: E731
        if case.energy is not None:
            mesh = ao.Mesh.uniform(0.0, case.duration, len(knots) - 1, 2)
            guess = ao.Path.interpolate(guess, mesh)
    return _solve(_system(case), case, ends, tol, guess, method)


def again(answer: Answer, case: Case, ends: Ends, tol: float, method: Method = "auto") -> Answer:
    """Solve on the same system from the last solution; a kink back is another one."""
    guess = None if case.asks == "infinity" else answer.state
    return _solve(answer.state.problem.system, case, ends, tol, guess, method)


PEER = Peer(("actionopt", "casadi"), TOLERANCES, cold, again, ANSWERS)
