"""Meshes of one degree, on which many members of a family are solved together."""

from __future__ import annotations

import numpy as np

from actionopt.analysis.quadratic.jacobi import HIGHEST_DEGREE
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.meshes.resolution import left_out
from actionopt.tools.lobatto import lgl
from actionopt.tools.types import Array

# Ad hoc, where nothing else is said.
MESH_DEGREES = (10, 14, 17)
ROW_COST = 35.0  # of a row of a matrix, in rows: measured, for one to three coordinates
ELEMENT_HALVINGS = 12  # of elements


def transfer_matrix(a: Mesh, b: Mesh) -> Array:
    """Return the matrix (K', K) from values at the nodes of a mesh to those of another."""
    return Path(a, np.eye(a.offsets[-1] + 1)).on(b).values.T


def denser(mesh: Mesh) -> Mesh:
    """Return a mesh of four degrees more, or of half the elements' lengths, as `jacobi.finer`."""
    degree = mesh.degrees[0]
    if degree + 4 <= HIGHEST_DEGREE:
        return mesh.cut(mesh.since, degree + 4)
    middles = (mesh.since[:-1] + mesh.since[1:]) / 2
    return mesh.cut(np.sort(np.concatenate([mesh.since, middles])), degree)


def even(path: Path, size: Array, target: float) -> Mesh:
    """Return the cheapest mesh over [0, 1] of elements of one degree that resolves a path.

    By halving elements until they leave out no coefficient above `target`, in units of `size`.
    """
    b = path.mesh.boundaries
    best, cost = None, np.inf
    for degree in MESH_DEGREES:
        rule, edges, done = lgl(degree), np.array([0.0, 1.0]), np.zeros(1, dtype=bool)
        for _ in range(ELEMENT_HALVINGS):
            open_ = np.flatnonzero(~done)
            if not open_.size:
                break
            h = edges[open_ + 1] - edges[open_]
            s = edges[open_][:, None] + h[:, None] / 2 * (1 + rule.nodes)
            t = np.clip(b[0] + s.ravel() * (b[-1] - b[0]), b[0], b[-1])
            values = path(t).T.reshape(open_.size, degree + 1, -1)
            done[open_] = left_out(rule, values / size)[0] <= target
            split = open_[~done[open_]]
            edges = np.sort(np.concatenate([edges, (edges[split] + edges[split + 1]) / 2]))
            done = np.insert(done, split + 1, False)
        rows = (degree + 1) * len(size)
        row_cost = done.size * rows * (ROW_COST + rows)
        if done.all() and row_cost < cost:
            best, cost = Mesh(edges, degree), row_cost
    if best is None:
        since = path.mesh.moved(0.0, 1.0).since
        best = Mesh(since, max(path.mesh.degrees))
    return best
