"""Paths moved onto the constraint surface."""

from __future__ import annotations

import numpy as np

from actionopt.discrete.transcription import Transcription
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
    problem, layout = tr.problem, tr.layout
    system = problem.system
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
    q = Q[at].copy()
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
    moved = Q.copy()
    good = np.isfinite(q).all(axis=1)
    moved[at[good]] = q[good]
    return moved
