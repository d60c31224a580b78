"""Where a path meets a surface, on(q, t) = 0, and what balances its momentum there."""

from __future__ import annotations

import numpy as np

from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.mechanics.question.events import Event
from actionopt.mechanics.question.problem import Problem
from actionopt.tools.types import Array

# Newton's method to a surface; ad hoc.
LONGEST_WAY = 60  # steps
FIRST_SURFACE_STEP = 10.0  # the first step, in the coordinates' sizes; each next one twice as far
TRIED_PLACES = 16  # from which a place that keeps the constraints is sought; ad hoc
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


@np.errstate(all="ignore")
def onto(
    problem: Problem, event: Event, q: Array, t: Array, size: Array, *, outside: bool = False
) -> Array:
    """Return points of the event's surface, and of the constraints, near q (K, n); NaN where none.

    The surface at times t (K,). Where the event lies on no surface, the constraints alone count. A
    point that is to be `outside` of the obstacle is moved on to the rows that are negative at q.
    Newton's method takes steps of least length in units of `size` (n,).
    """
    system, given = problem.system.with_contact if outside else problem.system, list(event.pinned)
    q = q.copy()
    q[:, given] = [event.q[i] for i in given]
    free = np.setdiff1d(np.arange(system.n), given) if given else slice(None)
    unit = size[free]
    if not (unit.size and len(q)):
        return q
    kept = np.ones((len(q), system.m), dtype=bool)
    parameters = {}
    if system.m:  # times at which laws take turns may be to be found; they are in no constraint
        parameters = {name: np.nan_to_num(x) for name, x in problem.parameters.items()}
    if outside:
        kept = system.constraint(q.T, t, parameters=parameters).T < 0
        kept[:, : problem.system.m] = True
    largest, empty = np.full(len(q), np.inf), np.zeros((1, 1), dtype=bool)
    for k in range(LONGEST_WAY):
        if event.on is None:
            rows, by_q = np.zeros((len(q), 0)), np.zeros((len(q), 0, system.n))
        else:
            rows, by_q, _ = event.on.along(q, t, problem.packed)
        if system.m:
            f = system.constraint(q.T, t, parameters=parameters).T
            G = system.constraint_jacobian(q.T, t, parameters=parameters)
            empty = np.pad(~kept, ((0, 0), (rows.shape[1], 0)))  # rows that are not asked for
            rows, by_q = np.hstack([rows, f]), np.hstack([by_q, np.moveaxis(G, 2, 0)])
            rows[empty], by_q[empty] = 0.0, 0.0
        by_q = by_q[:, :, free] * unit
        if rows.shape[1] == 1:
            step = by_q[:, 0] * (rows / np.add.reduce(by_q[:, 0] ** 2, axis=1)[:, None])
        else:
            known = np.isfinite(rows).all(axis=1) & np.isfinite(by_q).all(axis=(1, 2))
            known &= (by_q.any(axis=2) | empty).all(axis=1)
            step = np.full((len(q), unit.size), np.nan)
            step[known] = (np.linalg.pinv(by_q[known]) @ rows[known][:, :, None])[:, :, 0]
        largest, farthest = np.abs(step).max(axis=1), FIRST_SURFACE_STEP * 2.0**k
        q[:, free] -= step * (farthest / np.maximum(largest, farthest))[:, None] * unit
        if not (largest >= LAST_SURFACE_STEP).any():
            break
    q[~(largest < LAST_SURFACE_STEP)] = np.nan
    return q


def shear_to_surface(tr: Transcription, Q: Array) -> Array:
    """Return a straight line Q (K, n) sheared to ends that the constraints allow.

    Where an event gives a part of the coordinates, and from the line no step leads to the others:
    by symmetry, as from the middle of a circle, x given, to either y.
    """
    problem, system = tr.problem, tr.problem.system
    share = (tr.mesh.nodes_since / tr.mesh.duration)[:, None]
    spread = np.random.default_rng(0).standard_normal((TRIED_PLACES, system.n)) * tr.lengths
    events = ((problem.start, 0, 1 - share), (problem.end, -1, share))
    for event, k, weight in events[: 1 if problem.advance is not None else 2]:
        if not 0 < len(event.pinned) < system.n:
            continue
        t = np.full(1 + TRIED_PLACES, tr.mesh.nodes[k])
        found = onto(problem, event, np.vstack([Q[k], Q[k] + spread]), t, tr.lengths)
        known = found[np.isfinite(found).all(axis=1)]
        if np.isnan(found[0]).any() and len(known):
            nearest = np.argmin(np.abs((known - Q[k]) / tr.lengths).max(axis=1))
            Q = Q + weight * (known[nearest] - Q[k])
    return Q
