"""Whether an expression vanishes identically.

An expression that CasADi reduces to nothing vanishes. Any other is a sum of terms, and is
evaluated, term by term, at points in general position: an analytic function that is not zero
everywhere is zero there with probability zero, and what is zero leaves only the rounding of its
terms.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from actionopt.tools.types import Array

GENERIC = 24  # points; ad hoc: one would do for a function that is analytic and finite there
SIZE_DECADES = (-8, -4, 0, 4, 8)  # sizes of coordinates and velocities: atoms to planets, any units
# What a sum that is zero leaves of its terms, at the most. Ad hoc: far above the round-off of a
# thousand operations, 1e-13, and below any term that somebody writes.
CANCELLED = 1e-10
POINTS_SEED = 20180612  # any number


def general_points(count: int, points: int = GENERIC) -> Array:
    """Return the same points in general position every time, (points, count), of size one."""
    return np.random.default_rng(POINTS_SEED).standard_normal((points, count))


def general_states(n: int, points: int = GENERIC, order: int = 1) -> tuple[Array, Array, Array]:
    """Return q, v (K, n) and t (K, 1) in general position, the first `points` of size one.

    Behind them come coordinates and velocities of all sizes: a term that is small beside the others
    at one size is large beside them at another. For a higher `order` q stands for all derivatives
    below it, (K, order n), and v for those of it.
    """
    size = 10.0 ** np.array([(a, b) for a in SIZE_DECADES for b in SIZE_DECADES])
    values = general_points((order + 1) * n + 1, points + len(size))
    q, v = np.concatenate([np.ones((points, 2)), size]).T
    size = [q, *(v * (v / q) ** k for k in range(order))]
    values[:, :-1] *= np.repeat(np.transpose(size), n, axis=1)
    return values[:, : order * n], values[:, order * n : -1], values[:, -1:]


def mismatch(terms: ca.SX, arguments: Sequence[ca.SX], points: Sequence[Array]) -> Array:
    """Return |sum of the terms| over the sum of their sizes, row by row: (rows, K).

    Parameters
    ----------
    terms : SX, (rows, k)
        Row i stands for the expression that is the sum of its entries.
    arguments : sequence of SX
    points : sequence of (K, size) arrays
        Values of the arguments, one row a point; (1, size) for the same at all points.

    Returns
    -------
    (rows, K) array
        Numbers from 0 to 1, NaN where a term is not finite.
    """
    count = max(len(p) for p in points)
    if ca.sparsify(ca.simplify(terms)).nnz() == 0:
        return np.zeros((terms.shape[0], count))
    function = ca.Function("terms", list(arguments), [ca.densify(terms)]).map(count)
    columns = [ca.DM(np.broadcast_to(p, (count, np.shape(p)[1])).T) for p in points]
    return remainder(np.asarray(function(*columns)).reshape(terms.shape[0], count, terms.shape[1]))


def remainder(values: Array) -> Array:
    """Return |sum| over the sum of sizes for terms (rows, K, k): (rows, K), NaN if not finite."""
    with np.errstate(all="ignore"):
        size = np.sum(np.abs(values), axis=2)
        result = np.abs(np.sum(values, axis=2)) / np.where(size > 0, size, 1.0)
    return np.where(np.isfinite(size), result, np.nan)


def vanishes(terms: ca.SX, arguments: Sequence[ca.SX], points: Sequence[Array]) -> bool:
    """Return whether every row of `terms` sums to zero wherever it is finite.

    Raises ValueError if it is finite at none of the points.
    """
    return negligible(mismatch(terms, arguments, points))


def negligible(found: Array) -> bool:
    """Return whether sums vanish up to round-off, `found` (rows, K) in the sizes of their terms.

    Raises ValueError if they are finite at no point.
    """
    known = np.isfinite(found).all(axis=0)
    if not known.any():
        raise ValueError(
            "expected an expression that is finite at some points in general position, found none; "
            "give the system in units in which coordinates and velocities are of size one"
        )
    return bool(np.all(found[:, known] <= CANCELLED))
