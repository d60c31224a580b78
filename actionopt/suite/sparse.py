"""Derivatives of a test problem as sparse arrays."""

from __future__ import annotations

import numpy as np

from actionopt.suite.program import Program
from actionopt.tools.types import Array, NDInt


def jacobian(problem: Program, x: Array):
    """Return dc/dx as a scipy.sparse array, (m, n)."""
    return _matrix(problem.jacobian(x), problem.jacobian_structure, (problem.m, problem.n))


def hessian(problem: Program, x: Array, lam: Array | None = None, factor: float = 1.0):
    """Return the whole Hessian of the Lagrangian as a scipy.sparse array, (n, n)."""
    values = problem.hessian(x, lam, factor)
    rows, cols, from_upper = whole(problem.hessian_structure)
    return _matrix(values[from_upper], (rows, cols), (problem.n, problem.n))


def whole(structure: tuple[NDInt, NDInt]) -> tuple[NDInt, NDInt, NDInt]:
    """Return rows and columns of a symmetric matrix, and which entry of the triangle each is."""
    rows, cols = structure
    off = np.flatnonzero(rows != cols)
    first = np.concatenate([rows, cols[off]]), np.concatenate([cols, rows[off]])
    return *first, np.concatenate([np.arange(rows.size), off])


def _matrix(values: Array, structure: tuple[NDInt, NDInt], shape: tuple[int, int]):
    from scipy.sparse import csc_array

    return csc_array((values, structure), shape=shape)
