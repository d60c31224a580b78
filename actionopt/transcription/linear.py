"""Solve linear systems with the KKT matrix, and count its negative eigenvalues.

Symmetric systems are factorized as L D L' without pivoting, ten times faster than with it; a tiny
negative diagonal on the constraint rows makes that possible. The price is paid back by iterative
refinement, whose residual also tells when the factors are no good: then a sparse QR
factorization serves instead.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from actionopt.quadrature import Array
from actionopt.transcription.layout import Layout

DENSE = 60  # up to this size inverting a dense matrix costs less than entering a sparse solver
REGULAR = 1e-10  # on the rows' diagonal, whose gradients are of size one
REFINEMENTS = 5
ACCURATE = 1e-13  # residual, relative to |b| + |K| |x|, at which refinement has nothing to add
USEFUL = 1e-8  # residual above which the factors are given up


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
        If the matrix is singular or not finite; `solve` may raise it too.
    """

    def __init__(self, layout: Layout, nonzeros: Array) -> None:
        if not np.all(np.isfinite(nonzeros)):
            raise np.linalg.LinAlgError("the matrix is not finite")
        self.layout, self.nonzeros = layout, nonzeros
        self._inverse: Array | None = None
        self._qr: ca.DM | None = None
        if layout.size <= DENSE:
            self._inverse = np.linalg.inv(_dense(layout, nonzeros))
        elif layout.system.structure.forced:
            self._factorize_robustly()
        else:
            self._matrix = ca.DM(layout.kkt.sparsity, _regular(layout, nonzeros))
            self._ldl = _solver(layout, "ldl")
            self._ldl.nfact(self._matrix)

    def solve(self, right: Array) -> Array:
        """Return the solution for one right-hand side, (size,)."""
        if self._inverse is not None:
            return self._inverse @ right
        if self._qr is None:
            x = self._refined(right)
            if x is not None:
                return x
            self._factorize_robustly()
        x = np.asarray(_solver(self.layout, "qr").solve(self._qr, ca.DM(right))).ravel()
        if not np.all(np.isfinite(x)):
            raise np.linalg.LinAlgError("the matrix is singular")
        return x

    def _factorize_robustly(self) -> None:
        self._qr = ca.DM(self.layout.kkt.sparsity, self.nonzeros)
        _solver(self.layout, "qr").nfact(self._qr)

    def _refined(self, right: Array) -> Array | None:
        """Return the solution by L D L' and refinement, or None if that does not converge."""
        pattern, nonzeros = self.layout.kkt, self.nonzeros
        x, miss = np.zeros_like(right), right
        size, norm = float(np.max(np.abs(right))), float(np.max(np.abs(nonzeros)))
        last = np.inf
        for _ in range(REFINEMENTS):
            nearer = x + np.asarray(self._ldl.solve(self._matrix, ca.DM(miss))).ravel()
            miss = right - np.bincount(pattern.row, nonzeros * nearer[pattern.col], right.size)
            left = float(np.max(np.abs(miss)))
            if not left < last / 2:  # no better than before, or not a number
                break
            x, last = nearer, left
            if left <= ACCURATE * size:
                break
        good = last <= USEFUL * size + ACCURATE * norm * float(np.max(np.abs(x)))
        return x if good else None


def negative_eigenvalues(layout: Layout, nonzeros: Array) -> int:
    """Return the number of negative eigenvalues of a symmetric KKT matrix (its inertia)."""
    if layout.size <= 4 * DENSE:
        return int(np.sum(np.linalg.eigvalsh(_dense(layout, nonzeros)) < 0))
    solver = _solver(layout, "ldl")
    solver.nfact(ca.DM(layout.kkt.sparsity, _regular(layout, nonzeros)))
    return int(solver.neig(ca.DM(layout.kkt.sparsity, _regular(layout, nonzeros))))


def _solver(layout: Layout, kind: str) -> ca.Linsol:
    """Return the layout's sparse solver, analysed once for its sparsity."""
    if kind not in layout.solvers:
        solver = ca.Linsol(kind, kind, layout.kkt.sparsity)
        solver.sfact(ca.DM(layout.kkt.sparsity, 1.0))
        layout.solvers[kind] = solver
    return layout.solvers[kind]


def _regular(layout: Layout, nonzeros: Array) -> Array:
    if not layout.rows:
        return nonzeros
    shifted = nonzeros.copy()
    shifted[layout.row_diagonal] -= REGULAR
    return shifted


def _dense(layout: Layout, nonzeros: Array) -> Array:
    pattern = layout.kkt
    matrix = np.zeros(pattern.shape)
    matrix[pattern.row, pattern.col] = nonzeros
    return matrix
