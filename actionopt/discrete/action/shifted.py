"""A path that runs ahead of a neighbour or behind it, moved in time with its mesh.

Where ends move, the tangent of the family of paths moves a node by dq. A fast passage, such as that
of a pericentre, only comes sooner or later; there the tangent is a displacement along the path of
many times its own extent, and leads to a curve far from any motion. Taken as the shift of time that
it is,

    t -> t + tau,   q -> q + dq + v tau,   tau = -(dq . v) / (v . v),

it keeps the form of the passage, and its short elements stay where it is.
"""

from __future__ import annotations

import numpy as np

from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.tools.types import Array

# Ad hoc. Of the largest v . v, below which a motion is too slow to tell a time; and of its length,
# by which an element may be stretched.
SLUGGISH, STRETCHED = 1e-3, 0.5


def shift_path(tr: Transcription, z: Array, Q: Array) -> tuple[Mesh, Array] | None:
    """Return the mesh and the coordinates (K, n) of the path z of `tr` when it moves to Q (K, n).

    The nodes are as many; the first and the last keep their times. None where elements would be
    stretched too far.
    """
    point, mesh = tr.place(z), tr.mesh
    v = np.empty_like(Q)
    v[tr.layout.node_of] = point.v
    along = (((Q - point.Q) * v) / tr.lengths**2).sum(axis=1)
    square = ((v / tr.lengths) ** 2).sum(axis=1)
    tau = -(along / (square + SLUGGISH * square.max()))[mesh.offsets]
    tau[[0, -1]] = 0.0
    if not (np.abs(np.diff(tau)) < STRETCHED * mesh.lengths).all():
        return None
    found = mesh.cut(mesh.since + tau, mesh.degrees)
    return found, Q + v * np.interp(mesh.nodes_since, mesh.since, tau)[:, None]
