"""Closed paths in contact with an obstacle that begin on a surface.

Without a clock a closed path may begin anywhere along itself: it is found free of the surface, and
where it meets that it is found again with the coordinate given that passes fastest there.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from actionopt.analysis.solution import Solution
from actionopt.analysis.status import Status
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.mechanics.question.events import Event
from actionopt.mechanics.question.held import Held
from actionopt.mechanics.question.problem import Problem
from actionopt.solver.ends.closed import LOOKED_AT, begin_later, states_beyond
from actionopt.solver.kinds.between import Choices, Found, between
from actionopt.solver.kinds.through import objection
from actionopt.solver.refinement.iterate import ORDINARY
from actionopt.solver.refinement.verdict import message_of
from actionopt.tools.bisection import bisect
from actionopt.tools.types import EPS, Array

NOT_MET = "the closed path found without its surface does not meet it: move the surface"


def begin_at_surface(problem: Problem, free: Solution, choices: Choices) -> Found:
    """Return a closed path along an obstacle begun where it meets its surface, and the verdict."""
    shift = _first_passage(problem, free)
    if shift is None:
        lost = replace(free, status=Status.NOT_FOUND, error=np.inf)
        return lost, message_of(lost, choices.tol, NOT_MET)
    path = begin_later(free.path, shift, free.problem)
    q, v = path.values[:, 0], path.velocity(path.mesh.nodes[:1])[:, 0]
    size = np.abs(path.values).max(axis=1)
    zero = np.abs(q) <= ORDINARY * EPS * size  # else that is taken for the size of the motion
    q = np.where(zero, 0.0, q)
    fastest = int(np.argmax(np.abs(v) / problem.scales))
    start = Event(problem.start.t, [x if i == fastest else None for i, x in enumerate(q.tolist())])
    given = Problem(problem.system, start, free.problem.end, parameters=problem.parameters)
    found, message = between(given, path, choices)
    if found.success:
        ends = found.path.values.T[[0, -1]]
        asked = problem.found_at(path.mesh.boundaries[[0, -1]], ends)
        held = Held(asked, found.contacts)
        at = DiscretePath.of(held, found.path, found.discrete.rows)
        found = replace(found, problem=asked, known=at)
        message = objection(found)
        if message:
            found = replace(found, status=Status.NOT_FOUND, error=np.inf)
            message = message_of(found, choices.tol, message)
    return found, message


def _first_passage(problem: Problem, free: Solution) -> float | None:
    """Return when a closed path first passes the surface on which it is to begin, or None."""
    on = problem.start.on
    assert on is not None
    T = free.path.mesh.duration

    def off(since: Array) -> Array:
        q = states_beyond(free.path, free.problem, since)[0]
        return on.values(q.T, np.full(since.size, problem.start.t), problem.packed)[:, 0]

    since = np.linspace(0.0, T, LOOKED_AT + 1)
    values = off(since)
    passed = np.flatnonzero(values[:-1] * values[1:] <= 0)
    if not passed.size:
        return None
    k = int(passed[0])
    _, high = bisect(since[[k]], since[[k + 1]], lambda s: off(s) * values[k] > 0)
    return float(high[0])
