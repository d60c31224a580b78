"""Where a path meets a surface, on(q, t) = 0, and what balances its momentum there."""

from __future__ import annotations

import numpy as np

from actionopt.discrete.discrete_path import DiscretePath
from actionopt.mechanics.events import Event
from actionopt.mechanics.problem import Problem
from actionopt.tools.types import Array

# Newton's method to a surface; ad hoc.
LONGEST_WAY = 60  # steps
FIRST_SURFACE_STEP = 10.0  # the first step, in the coordinates' sizes; each next one twice as far
LAST_SURFACE_STEP = 1e-9  # the last step: the next would be its square


def surface_at(at: DiscretePath, k: int) -> tuple[Array, Array, Array, Array]:
    """Return on at event k of a path, the start being 0, and its derivatives: `Surface`."""
    event, t = event_at(at, k)
    return event.on.at(at.Q[at.tr.joints[k]], t, at.problem.packed)


def reactions(at: DiscretePath, k: int) -> tuple[Array, Array]:
    """Return the multipliers mu (s,) of on and nu (m,) of f that balance the momenta at event k.

    Those of least squares where the path is not stationary.
    """
    problem, system = at.problem, at.problem.system
    event, t = event_at(at, k)
    free = [i for i, x in enumerate(event.q) if x is None]
    rows = np.zeros((0, system.n)) if event.on is None else surface_at(at, k)[1]
    if system.m:
        q = at.Q[at.tr.joints[k]]
        G = system.constraint_jacobian(q, t, parameters=problem.parameters)
        rows = np.concatenate([rows, G])
    pulls = at.tr.pulls(at.z)
    if problem.advance is not None:  # where a path closes, its start is its end
        pulls[0, list(problem.order)] += pulls[-1]
    pull = pulls[k][free] * at.tr.lengths[free]
    normals = (rows[:, free] * at.tr.lengths[free]).T
    if not (np.isfinite(normals).all() and np.isfinite(pull).all()):
        return np.zeros(len(rows) - system.m), np.zeros(system.m)
    found = -np.linalg.lstsq(normals, pull, rcond=None)[0]
    return found[: found.size - system.m], found[found.size - system.m :]


def event_at(at: DiscretePath, k: int) -> tuple[Event, float]:
    """Return event k as it was asked for, the start being 0, and the time there."""
    return at.problem.joints[k], float(at.mesh.nodes[at.tr.joints[k]])


def onto(
    problem: Problem, event: Event, q: Array, t: float, size: Array, *, outside: bool = False
) -> Array | None:
    """Return a point of the event's surface, and of the constraints, near q (n,); None if none is.

    Where the event lies on no surface, the constraints alone count. A point that is to be `outside`
    of the obstacle is moved on to the rows that are negative at q. Newton's method takes steps of
    least length in units of `size` (n,).
    """
    system, given = problem.system.with_contact if outside else problem.system, list(event.pinned)
    q = q.copy()
    q[given] = [event.q[i] for i in given]
    free, kept = np.setdiff1d(np.arange(system.n), given), np.ones(system.m, dtype=bool)
    if not free.size:
        return q
    if outside:
        kept = system.constraint(q, t, parameters=problem.parameters) < 0
        kept[: problem.system.m] = True
    for k in range(LONGEST_WAY):
        rows, by_q = np.zeros(0), np.zeros((0, system.n))
        if event.on is not None:
            rows, by_q, _, _ = event.on.at(q, t, problem.packed)
        if system.m:
            f = system.constraint(q, t, parameters=problem.parameters)
            G = system.constraint_jacobian(q, t, parameters=problem.parameters)
            rows, by_q = np.concatenate([rows, f[kept]]), np.concatenate([by_q, G[kept]])
        by_q = by_q[:, free] * size[free]
        if not (np.isfinite(rows).all() and np.isfinite(by_q).all() and by_q.any(axis=1).all()):
            return None
        if rows.size == 1:
            step = -by_q[0] * (rows[0] / (by_q[0] @ by_q[0]))
        else:
            step = -np.linalg.pinv(by_q) @ rows
        largest = np.abs(step).max()
        farthest = FIRST_SURFACE_STEP * 2.0**k
        q[free] += step * (farthest / largest if largest > farthest else 1.0) * size[free]
        if largest < LAST_SURFACE_STEP:
            return q
    return None
