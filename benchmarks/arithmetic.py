"""One hand-derived formula, three kinds of numbers.

The accelerations of a problem are written once, with `x.sin`, `x.cos`, `x.sqrt` and `x.solve`
of an arithmetic `x`. NUMPY evaluates them for many times at once; `elementwise` evaluates them
on object arrays of multiple-precision numbers or of another package's expressions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Arithmetic:
    """Elementary functions of arrays, and `solve(A, b)` for A (n, n, ...) and b (n, ...)."""

    sin: Callable[[Any], Any]
    cos: Callable[[Any], Any]
    sqrt: Callable[[Any], Any]
    solve: Callable[[Any, Any], Any]


def _solve_numbers(A, b):
    if A.ndim == 2:
        return np.linalg.solve(A, b)
    x = np.linalg.solve(np.moveaxis(A, -1, 0), np.moveaxis(b, -1, 0)[..., None])
    return np.moveaxis(x[..., 0], 0, -1)


def _solve_symmetric(A, b):
    """Solve by elimination without pivots: A (n, n) is positive definite."""
    A, b = np.array(A, dtype=object), np.array(b, dtype=object)
    n = len(b)
    for k in range(n):
        for i in range(k + 1, n):
            if isinstance(A[i, k], int) and A[i, k] == 0:
                continue
            factor = A[i, k] / A[k, k]
            A[i, k + 1 :] = A[i, k + 1 :] - factor * A[k, k + 1 :]
            b[i] = b[i] - factor * b[k]
    for k in reversed(range(n)):
        b[k] = (b[k] - np.dot(A[k, k + 1 :], b[k + 1 :])) / A[k, k]
    return b


NUMPY = Arithmetic(np.sin, np.cos, np.sqrt, _solve_numbers)


def elementwise(library: Any) -> Arithmetic:
    """Return the arithmetic of object arrays whose elements `library` knows how to treat."""

    def apply(name: str):
        return np.frompyfunc(getattr(library, name), 1, 1)

    return Arithmetic(apply("sin"), apply("cos"), apply("sqrt"), _solve_symmetric)
