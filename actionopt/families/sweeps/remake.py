"""The path of a member that was solved, again from its ends and the momenta there."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from actionopt.analysis.motion.forward import IntegrationError, integrate
from actionopt.mechanics.question.events import State
from actionopt.mechanics.question.problem import Problem
from actionopt.tools.types import Array

# How far the momenta of a path that is made again may be from those kept, in their own size, and
# the action in its range: beyond that it is another path. Ad hoc.
SAME_MOMENTA = 1e-5
HALVES_TOL = 1e-10  # tol of the motions from both ends: a guess needs no more; ad hoc


def remake(problem: Problem, ends: Array, momenta: Array) -> Callable[[Array], Array] | None:
    """Return a curve near the path with momenta (2, n) at its `ends` (2, n), or None.

    It joins the motions that set out from both ends.
    """
    system, parameters = problem.system, problem.parameters
    if system.r:  # forward motions do not know contact
        return None
    t0, t1 = problem.start.t, problem.end.t
    middle = t0 + problem.duration / 2
    straight = (ends[1] - ends[0]) / problem.duration
    halves = []
    try:
        for t, q, p in zip((t0, t1), ends, momenta, strict=True):
            state = State(t, q, system.velocity(q, p, t, straight, parameters=parameters))
            halves.append(integrate(system, state, middle, tol=HALVES_TOL, parameters=parameters))
    except (ValueError, IntegrationError, np.linalg.LinAlgError):
        return None
    before, after = halves
    gap = (after(middle) - before(middle))[:, None] / 2

    def curve(t: Array) -> Array:
        """Both motions, moved by half the gap between them in proportion to the time."""
        first, last = np.minimum(t, middle), np.maximum(t, middle)
        left = before(first) + gap * ((first - t0) / (middle - t0))
        right = after(last) - gap * ((t1 - last) / (t1 - middle))
        return np.where(t <= middle, left, right)

    return curve
