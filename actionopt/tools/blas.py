"""Small matrices, without the threads of the library that numpy calls for them.

OpenBLAS divides matrices from some dozens of rows on among its threads. That pays for none as small
as ours, and where others want the cores as well they wait for one another: `eigh` of 32 rows takes
0.1 ms on one thread, and was seen to take 16 on two.
"""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Callable
from contextlib import ContextDecorator
from functools import cache
from typing import Any

import numpy as np

from actionopt.tools.types import Array

# Measured: numpy takes 0.1 us for each matrix of a stack, however small; one product of all takes a
# twentieth of that for one column each, and as long for nine. Fewer matrices cost nothing.
MANY_MATRICES, NARROW_MATRIX = 1000, 4
# Before and after what it is called in numpy's wheels, and in OpenBLAS itself.
LIBRARY_NAMES = ("scipy_openblas", "64_"), ("openblas", "64_"), ("openblas", "")


@cache
def _library() -> ctypes.CDLL | None:
    """Return what numpy calls for matrices."""
    try:
        return ctypes.CDLL(np.linalg._umath_linalg.__file__)
    except (AttributeError, OSError):
        return None


@cache
def thread_count() -> tuple[Callable[[], int], Callable[[int], None]] | None:
    """Return what gets and sets the number of OpenBLAS's threads, or None of other libraries."""
    library = _library()
    for before, after in LIBRARY_NAMES:
        names = [f"{before}_{what}_num_threads{after}" for what in ("get", "set")]
        if all(hasattr(library, name) for name in names):
            return getattr(library, names[0]), getattr(library, names[1])
    return None


class _OneThread(ContextDecorator):
    """One thread for OpenBLAS within, and as many as before after the last that is within."""

    def __init__(self) -> None:
        self._lock, self._within, self._before = threading.Lock(), 0, 1

    def __enter__(self) -> None:
        count = thread_count()
        if count is None:
            return
        with self._lock:
            if self._within == 0:
                self._before = count[0]()
                if self._before > 1:
                    count[1](1)
            self._within += 1

    def __exit__(self, *_: object) -> None:
        count = thread_count()
        if count is None:
            return
        with self._lock:
            self._within -= 1
            if self._within == 0 and self._before > 1:
                count[1](self._before)


one_thread = _OneThread()


def by_each(matrix: Array, stack: Array) -> Array:
    """Return a matrix (r, p) times each of a stack, (E, p, k): (E, r, k)."""
    count, _, columns = stack.shape
    if columns == 1:
        return (stack[:, :, 0] @ matrix.T)[:, :, None]
    if count < MANY_MATRICES or columns > NARROW_MATRIX:
        return matrix @ stack
    wide = np.kron(matrix.T, np.eye(columns))
    return (stack.reshape(count, -1) @ wide).reshape(count, -1, columns)


def _of_each(name: str, whole: Callable[..., Array], *given: Array) -> Array:
    """Return what numpy does to stacks of matrices, or what `whole` does if that is not finite.

    Of matrices as small as ours numpy's own takes a third of the time, and checks what it is given
    the rest; an error of a singular matrix is for `whole` to raise.
    """
    inner = getattr(getattr(np.linalg, "_umath_linalg", None), name, None)
    if inner is not None:
        with np.errstate(all="ignore"):
            found = inner(*given)
        if np.logical_and.reduce(np.isfinite(found), axis=None):
            return found
    return whole(*given)


def solve_each(matrices: Array, right: Array) -> Array:
    """Return the solutions (K, n) of matrices (K, n, n) and right-hand sides (K, n), as numpy."""
    return _of_each("solve1", _solve, matrices, right)


def _solve(matrices: Array, right: Array) -> Array:
    return np.linalg.solve(matrices, right[:, :, None])[:, :, 0]


def invert_each(matrices: Array) -> Array:
    """Return the inverses of matrices, as numpy.linalg.inv."""
    return _of_each("inv", np.linalg.inv, matrices)


def check_definite(matrices: Array) -> None:
    """Raise numpy.linalg.LinAlgError where one of them is not positive definite."""
    _of_each("cholesky_lo", np.linalg.cholesky, matrices)


def cholesky(matrix: Array) -> Callable[[Array], Array]:
    """Return what solves A x = b (n,) or (n, c), for a positive definite A (n, n), factorized once.

    Neither n nor c is zero.

    numpy has no solution from a factor: LAPACK's own (`dpotrf`, `dpotrs`) takes a sixth of the time
    of `numpy.linalg.solve` at 94 rows, which serves where there is none of known integers. Raises
    numpy.linalg.LinAlgError if A is not positive definite.
    """
    library = _library()
    if not hasattr(library, "scipy_dpotrs_64_"):
        np.linalg.cholesky(matrix)
        return lambda right: np.linalg.solve(matrix, right)
    assert library is not None
    factor = np.array(matrix, dtype=float, order="C")  # its rows, as columns, are the same
    n, info, a = _constant(len(factor)), _number(0), _place(factor)
    library.scipy_dpotrf_64_(b"L", n, a, n, info, 1)
    if info._obj.value:
        raise np.linalg.LinAlgError("the matrix is not positive definite")

    def solve(right: Array) -> Array:
        x = np.array(right.T, dtype=float, order="C")
        columns = _constant(1 if x.ndim == 1 else len(x))
        library.scipy_dpotrs_64_(b"L", n, columns, a, n, _place(x), n, info, 1)
        return x.T

    return solve


def lu(matrix: Array) -> Callable[[Array], Array]:
    """Return what solves A x = b (n,) or (n, c), for a regular A (n, n); its factors are kept.

    LAPACK's `dgetrf` and `dgetrs`, to the bit what `numpy.linalg.solve` returns, which factorizes
    for each solution: at 94 rows one from the factors takes a tenth. Raises
    numpy.linalg.LinAlgError if A is singular, at the first solution where they are not at hand.
    """
    library = _library()
    if not len(matrix) or not hasattr(library, "scipy_dgetrs_64_"):
        return lambda right: np.linalg.solve(matrix, right)
    assert library is not None
    factor, pivots = np.array(matrix.T, dtype=float, order="C"), np.empty(len(matrix), np.int64)
    n, info, a, p = _constant(len(factor)), _number(0), _place(factor), _place(pivots)
    library.scipy_dgetrf_64_(n, n, a, n, p, info)
    if info._obj.value:
        raise np.linalg.LinAlgError("the matrix is singular")

    def solve(right: Array) -> Array:
        x = np.array(right.T, dtype=float, order="C")
        columns = _constant(1 if x.ndim == 1 else len(x))
        library.scipy_dgetrs_64_(b"N", n, columns, a, n, p, _place(x), n, info, 1)
        return x.T

    return solve


def count_negative(matrix: Array) -> int:
    """Return the number of negative eigenvalues of a symmetric matrix (n, n).

    Those of the blocks that LAPACK's `dsytrf` leaves on the diagonal (J. R. Bunch, L. Kaufman,
    Mathematics of Computation 31 (1977) 163): it pivots, and each block of two rows has one of
    either sign. That takes a fifth of the time of all eigenvalues, which serve where it is not at
    hand.
    """
    library = _library()
    if not len(matrix) or not hasattr(library, "scipy_dsytrf_64_"):
        return int(np.count_nonzero(np.linalg.eigvalsh(matrix) < 0))
    assert library is not None
    factor, pivots = np.array(matrix, dtype=float, order="C"), np.empty(len(matrix), np.int64)
    n, a, p, work = _constant(len(factor)), _place(factor), _place(pivots), np.empty(factor.size)
    arguments = n, a, n, p, _place(work), _constant(work.size), _number(0)
    library.scipy_dsytrf_64_(b"U", *arguments, 1)  # of the rows the lower triangle
    alone = pivots > 0
    return int(np.sum(~alone) // 2 + np.sum(factor.diagonal()[alone] < 0))


def _number(number: int) -> Any:
    """Return where an integer stands, as LAPACK reads all arguments."""
    return ctypes.byref(ctypes.c_int64(number))


_constant = cache(_number)  # of what LAPACK does not write

# Where the numbers of an array stand, row by row; they are kept as long as this is.
_place = (ctypes.c_char * 0).from_buffer
