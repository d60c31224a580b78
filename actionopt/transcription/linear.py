"""Solve linear systems with the KKT matrix: dense where it is small, sparse LU elsewhere."""

from __future__ import annotations

import casadi as ca
import numpy as np

from actionopt.quadrature import Array
from actionopt.transcription.layout import Layout

DENSE = 100  # below this size inverting a dense matrix costs less than entering a sparse solver


class Factors:
    """A factorized KKT matrix of one layout; `solve` may be called many times.

    Parameters
    ----------
    layout : Layout
    nonzeros : (nnz,) array
        As `Transcription.kkt` returns them.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the matrix is exactly singular or not finite.
    """

    def __init__(self, layout: Layout, nonzeros: Array) -> None:
        pattern = layout.kkt
        if not np.all(np.isfinite(nonzeros)):
            raise np.linalg.LinAlgError("the matrix is not finite")
        if layout.size <= DENSE:
            matrix = np.zeros(pattern.shape)
            matrix[pattern.row, pattern.col] = nonzeros
            self._inverse = np.linalg.inv(matrix)
            self.solve = self._solve_dense
            return
        self._matrix = ca.DM(pattern.sparsity, nonzeros)
        if "lu" not in layout.solvers:
            layout.solvers["lu"] = ca.Linsol("lu", "csparse", pattern.sparsity)
            layout.solvers["lu"].sfact(self._matrix)
        self._lu = layout.solvers["lu"]
        self.solve = self._solve_sparse
        try:
            self._lu.nfact(self._matrix)
        except RuntimeError as error:
            raise np.linalg.LinAlgError("the matrix is singular") from error

    def _solve_dense(self, right: Array) -> Array:
        """Return the solution for one right-hand side (size,) or several (size, k)."""
        return self._inverse @ right

    def _solve_sparse(self, right: Array) -> Array:
        solved = np.asarray(self._lu.solve(self._matrix, ca.DM(right)))
        return solved.reshape(right.shape)


def negative_eigenvalues(layout: Layout, nonzeros: Array) -> int:
    """Return the number of negative eigenvalues of a symmetric KKT matrix."""
    pattern = layout.kkt
    if layout.size <= 4 * DENSE:
        matrix = np.zeros(pattern.shape)
        matrix[pattern.row, pattern.col] = nonzeros
        return int(np.sum(np.linalg.eigvalsh(matrix) < 0))
    solver = ca.Linsol("ldl", "ldl", pattern.sparsity)
    matrix = ca.DM(pattern.sparsity, nonzeros)
    solver.sfact(matrix)
    solver.nfact(matrix)
    return int(solver.neig(matrix))
