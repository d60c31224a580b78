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

REGULAR = 1e-10  # on the rows' diagonal, whose gradients are of size one
REFINEMENTS = 6
ACCURATE = 1e-10  # residual relative to |b| that is enough: Newton's method corrects the rest
USEFUL = 1e-8  # residual above which the factors are given up
ROUNDOFF = 1e-13  # residual relative to |K| |x| that no refinement removes


class Factors:
    """A KKT matrix of one layout, ready to solve with; `solve` may be called many times.

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
        self._inverse = np.linalg.inv(_whole(layout, nonzeros)) if layout.whole else None
        self._robust = layout.system.structure.forced
        self._regular = nonzeros if self._robust else _regular(layout, nonzeros)

    def solve(self, right: Array) -> Array:
        """Return the solution for one right-hand side, (size,)."""
        if self._inverse is not None:
            return self._inverse @ right
        if not self._robust:
            x = self._refined(right)
            if x is not None:
                return x
            self._robust = True
        x = _solver(self.layout, "qr")(self.nonzeros, right)
        if not np.all(np.isfinite(x)):
            raise np.linalg.LinAlgError("the matrix is singular")
        return x

    def _refined(self, right: Array) -> Array | None:
        """Return the solution by L D L' and refinement, or None if that does not converge."""
        pattern, nonzeros = self.layout.kkt, self.nonzeros
        solver = _solver(self.layout, "ldl")
        x, miss, last = np.zeros_like(right), right, np.inf
        size, norm = float(np.max(np.abs(right))), float(np.max(np.abs(nonzeros)))
        for _ in range(REFINEMENTS):
            nearer = x + solver(self._regular, miss)
            miss = right - np.bincount(pattern.row, nonzeros * nearer[pattern.col], right.size)
            left = float(np.max(np.abs(miss)))
            if not left < last / 2:  # no better than before, or not a number
                break
            x, last = nearer, left
            if left <= ACCURATE * size:
                break
        good = last <= USEFUL * size + ROUNDOFF * norm * float(np.max(np.abs(x)))
        return x if good else None


class _Sparse:
    """A sparse direct solver of CasADi's for one sparsity, fed and read in place.

    CasADi's linear solvers factorize anew for every right-hand side; that costs less than handing
    matrices over as objects, by an order of magnitude where they are small.
    """

    def __init__(self, layout: Layout, kind: str) -> None:
        values = ca.MX.sym("values", layout.kkt.nnz)
        right = ca.MX.sym("right", layout.size)
        solved = ca.solve(ca.MX(layout.kkt.sparsity, values), right, kind)
        self._function = ca.Function(kind, [values, right], [solved])
        self._values, self._right = np.empty(layout.kkt.nnz), np.empty(layout.size)
        self._solved = np.empty(layout.size)
        self._buffer, self._trigger = self._function.buffer()
        self._buffer.set_arg(0, memoryview(self._values))  # type: ignore
        self._buffer.set_arg(1, memoryview(self._right))  # type: ignore
        self._buffer.set_res(0, memoryview(self._solved))  # type: ignore

    def __call__(self, nonzeros: Array, right: Array) -> Array:
        self._values[:] = nonzeros
        self._right[:] = right
        self._solved[:] = np.nan  # what a failed factorization leaves behind
        try:
            self._trigger()
        except RuntimeError as error:
            raise np.linalg.LinAlgError("the matrix is singular") from error
        return self._solved.copy()


def definite(layout: Layout, nonzeros: Array) -> bool:
    """Return whether a symmetric matrix without constraint rows is positive definite."""
    if not layout.whole:
        return negative_eigenvalues(layout, nonzeros) == 0
    try:
        np.linalg.cholesky(_whole(layout, nonzeros))
    except np.linalg.LinAlgError:
        return False
    return True


def negative_eigenvalues(layout: Layout, nonzeros: Array) -> int:
    """Return the number of negative eigenvalues of a symmetric KKT matrix (its inertia)."""
    if layout.whole:
        if not layout.rows and definite(layout, nonzeros):
            return 0
        return int(np.sum(np.linalg.eigvalsh(_whole(layout, nonzeros)) < 0))
    matrix = ca.DM(layout.kkt.sparsity, _regular(layout, nonzeros))
    if "inertia" not in layout.solvers:
        layout.solvers["inertia"] = ca.Linsol("inertia", "ldl", layout.kkt.sparsity)
        layout.solvers["inertia"].sfact(matrix)
    layout.solvers["inertia"].nfact(matrix)
    return int(layout.solvers["inertia"].neig(matrix))


def _solver(layout: Layout, kind: str) -> _Sparse:
    """Return the layout's sparse solver, analysed once for its sparsity."""
    if kind not in layout.solvers:
        layout.solvers[kind] = _Sparse(layout, kind)
    return layout.solvers[kind]


def _regular(layout: Layout, nonzeros: Array) -> Array:
    if not layout.rows:
        return nonzeros
    shifted = nonzeros.copy()
    shifted[layout.row_diagonal] -= REGULAR
    return shifted


def _whole(layout: Layout, nonzeros: Array) -> Array:
    return nonzeros.reshape(layout.size, layout.size).T
