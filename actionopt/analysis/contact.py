"""Where a constraint stops pushing: the roots of a multiplier.

A surface that bodies can leave only pushes: on f >= 0 the force of constraint lambda df/dq must
point outwards, lambda >= 0. A holonomic constraint holds them whatever it takes; where its
multiplier changes sign the surface would have to pull, and the motion beyond is not the one of
the body on the surface.
"""

from __future__ import annotations

import numpy as np

from actionopt.analysis.solution import Solution, question
from actionopt.mechanics.question.events import State
from actionopt.tools.bisection import bisect
from actionopt.tools.immutable import immutable
from actionopt.tools.shown import one_line
from actionopt.tools.types import Array, NDInt

SAMPLES_PER_INTERVAL = 4  # of the nodes; ad hoc: roots that lie closer together pass unseen


@immutable
class Contact:
    """A time at which a multiplier is zero and changes sign.

    Attributes
    ----------
    row : int
        Index of the constraint.
    t : float
        The time.
    state : State
        Coordinates and velocities then.
    lost : bool
        Whether the multiplier falls through zero: on f >= 0 the body leaves the surface. Where
        f <= 0 is allowed, a multiplier that rises through zero says so.
    """

    row: int
    t: float
    state: State
    lost: bool

    __repr__ = one_line


def contact_loss(solution: Solution) -> tuple[Contact, ...]:
    """Return the times at which a multiplier changes sign along a solution, in order of time.

    The roots are bracketed between samples, several to each interval of the nodes, and bisected
    to the last digit; they are as accurate as the velocity, that is about `solution.error`
    times the degree squared over an element's length.

    Raises
    ------
    ValueError
        For a system without constraints.

    References
    ----------
    *Competitive Physics: Mechanics and Waves* (2018), section 12.4, p. 641: a mass slides off a
    circle at cos(theta) = 2/3.
    """
    system = question(solution).system
    if not system.m:
        raise ValueError(
            "expected a system with constraints, found none: the force of a surface is known "
            "only where a constraint stands for it; give the surface as f(q, t) = 0"
        )
    nodes = solution.mesh.nodes
    s = np.arange(SAMPLES_PER_INTERVAL) / SAMPLES_PER_INTERVAL
    times = np.append((nodes[:-1, None] + np.diff(nodes)[:, None] * s).ravel(), nodes[-1])
    table = solution.multipliers(times)
    found = []
    for row, values in enumerate(table):
        # A sample on the root itself counts with the interval that it ends.
        positive = values > 0
        change = np.flatnonzero(positive[1:] != positive[:-1])
        for t, lost in zip(_bisect(solution, row, times, change), positive[change], strict=True):
            state = State(t, solution(t), solution.velocity(t))
            found.append(Contact(row, t, state, bool(lost)))
    return tuple(sorted(found, key=lambda contact: contact.t))


def _bisect(solution: Solution, row: int, times: Array, change: NDInt) -> list[float]:
    """Return the roots of a multiplier in the intervals `change` of the `times` (K,)."""
    low, high = times[change], times[change + 1]
    if not low.size:
        return []
    first = solution.multipliers(low)[row] > 0
    low, high = bisect(low, high, lambda t: (solution.multipliers(t)[row] > 0) == first)
    return ((low + high) / 2).tolist()
