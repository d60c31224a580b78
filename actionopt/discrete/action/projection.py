"""Paths moved onto the constraint surface."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from actionopt.discrete.action.transcription import Transcription
from actionopt.tools.types import Array

# Ad hoc, where nothing else is said.
PROJECTIONS = 12  # Gauss-Newton steps, which converge quadratically where they do
RIDGE = 1e-10  # of the trace of G G': dependent constraints leave their common direction alone
PROJECTED = 1e-8  # a step of this size is the last: the next would be its square
DENSE_ROWS = 300  # constraints above which dense projections cost more than a start off the surface


def project(tr: Transcription, Q: Array) -> Array:
    """Return the node coordinates Q (K, n) moved onto the constraint surface where that works.

    Gauss-Newton steps of least length in units of the coordinates' sizes; a node that does not
    get nearer (the centre of a circle, say) stays.
    """
    system, layout = tr.problem.system, tr.layout
    at = layout.row_nodes if system.order == 1 else np.arange(layout.node_count)
    if layout.partial and system.order > 1:  # what is in contact is on it, or nearly
        return Q
    if system.m > DENSE_ROWS or not at.size:
        return Q
    t = tr.mesh.nodes[at][:, None]
    free = (layout.number[at, : system.n] >= 0) * tr.lengths  # pinned coordinates do not move
    if system.order > 1:  # values between the ends of elements are not unknowns
        inside = np.setdiff1d(at, layout.offsets)
        free[inside] = tr.lengths
    q = _onto(tr, Q[at], t, free)
    moved = Q.copy()
    good = np.isfinite(q).all(axis=1)
    moved[at[good]] = q[good]
    return moved


def project_on(tr: Transcription, Q: Array) -> Array:
    """Return nodes Q (K, n) of a straight line moved onto the constraint surface one after another.

    What an event does not give the constraints may give but for a choice, as those of a mechanism
    do whose crank is given. Nodes that are moved by themselves, as by `project`, choose for
    themselves, and no motion leads from one choice to another where the surface has parts. So each
    begins with what is chosen beside it, the first at the event that gives more.
    """
    problem, layout = tr.problem, tr.layout
    moved, ends = project(tr, Q), (problem.start.near, problem.end.near)
    given = np.array([[x is not None for x in end] for end in ends])
    way = -1 if given[1].sum() > given[0].sum() else 1
    free = (layout.number[:, : problem.system.n] >= 0) * tr.lengths
    nodes = range(len(Q))[::way]
    for last, k in pairwise(nodes):
        near = np.where(given.all(axis=0), Q[k], moved[last] + Q[k] - Q[last])
        q = _onto(tr, near[None], tr.mesh.nodes[[k]][:, None], free[[k]])[0]
        moved[k] = q if np.isfinite(q).all() else near
    return moved


def _onto(tr: Transcription, q: Array, t: Array, free: Array) -> Array:
    """Return places q (K, n) moved onto the surface at times t (K, 1), in units `free` (K, n)."""
    problem, system = tr.problem, tr.problem.system
    q = q.copy()
    jacobian = system.pointwise("constraint_jacobian")
    miss, unit = np.inf, np.eye(system.m)
    for _ in range(PROJECTIONS):
        G, f = jacobian(q, t, problem.packed)
        G = jacobian.full(0, G) * free[:, None, :]
        normals = G.transpose(0, 2, 1)
        gram = G @ normals
        ridge = RIDGE * gram.trace(axis1=1, axis2=2)[:, None, None] + np.finfo(float).tiny
        move = (normals @ np.linalg.solve(gram + ridge * unit, f[..., None]))[..., 0]
        far = np.abs(move).max(axis=1, keepdims=True)
        # No farther at once than the coordinates' own size: the surface may be nearly flat.
        q = q - free * move / np.maximum(far, 1.0)
        last, miss = miss, float(far.max())
        if miss < PROJECTED or miss > 2 * last:
            break
    return q
