"""Elimination in many symmetric matrices at once, without pivoting, where they have entries.

Which matrix it is is the last axis of every array, so that one call of numpy does one operation for
all of them. Of each the upper rows are there. L D L': the signs of the pivots are the inertia.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from actionopt.mechanics.system import System
from actionopt.tools.types import Array, NDInt


class Band(NamedTuple):
    """Where symmetric matrices have entries, or get some as rows are eliminated."""

    first: list[int]  # the first row with an entry in each column
    beyond: list[list[slice]]  # the columns from each row's own on in which it has entries
    # beside, empty: rows inside, and columns of the ends, with entries; and rows and columns that
    # are to be zero before any are put there.
    beside: list[tuple[slice, slice]]
    empty: list[tuple[slice, slice]]
    size: int  # how many entries there are, about

    @classmethod
    def full(cls, rows: int) -> Band:
        """Return that of matrices whose entries are all there."""
        return cls([0] * rows, [[slice(r, rows)] for r in range(rows)], [], [], rows**2)

    @classmethod
    def of(cls, system: System, inside: int, *, ends: bool) -> Band:
        """Return that of elements' matrices, so many nodes `inside`, in the order of its rows.

        With rows and columns of their `ends`, or those of the nodes inside alone.
        """
        n, (early, last) = system.n, couplings(system)
        places, inner = (inside + 2) * n, inside * n
        first, beyond = [], []
        for a in range(n):
            stop, far = inside * (last[a] + 1), last[a] + 1
            whole = ends and far == n
            at_ends = [slice(k, k + far) for k in (inner, inner + n)] if ends else []
            for r in range(a * inside, (a + 1) * inside):
                first.append(inside * early[a])
                beyond.append([slice(r, places)] if whole else [slice(r, stop), *at_ends])
        for r in range(inner, places if ends else inner):
            first.append(inside * early[(r - inner) % n])
            beyond.append([slice(r, places)])
        size = 2 * sum(here.stop - here.start for spans in beyond for here in spans)
        beside, empty = [], [(slice(inner, places), slice(inner, places))]
        for a in range(n):
            rows = slice(a * inside, (a + 1) * inside)
            far = slice(0, n) if ends else slice(early[a], last[a] + 1)
            beside += [(rows, slice(k + far.start, k + far.stop)) for k in (inner, inner + n)]
            # As far as the rows below it are read.
            empty.append((rows, slice(a * inside, inside * (last[last[a]] + 1))))
        whole = system.pointwise("second").sparsity(2)[0].size == n * (n + 1) // 2
        return cls(first, beyond, beside, [] if whole else empty + beside, size)

    @property
    def work(self) -> int:
        """How many multiplications elimination takes, about."""
        return sum(
            (r - first) * (here.stop - here.start)
            for r, (first, spans) in enumerate(zip(self.first, self.beyond, strict=True))
            for here in spans
        )


def couplings(system: System) -> tuple[list[int], list[int]]:
    """Return the first and the last coordinate with which each is coupled as it is eliminated.

    In their order, so that the first, and the last, of a later one is no earlier.
    """
    n, pointwise = system.n, system.pointwise("second")
    beside = np.eye(n, dtype=bool)
    for k in range(3):
        rows, cols = (x % n for x in pointwise.sparsity(k))  # of q and v where L contains a
        beside[rows, cols] = beside[cols, rows] = True
    last = np.maximum.accumulate(n - 1 - np.argmax(beside[:, ::-1], axis=1))
    return np.searchsorted(last, np.arange(n)).tolist(), last.tolist()


def eliminate(M: Array, count: int, band: Band) -> Array:
    """Eliminate the first rows of symmetric matrices (f, f, B), upper rows, in place: U = D L'.

    Return the inverse pivots (count, B). Row by row, each from all rows above it.
    """
    inverse = np.empty((count, M.shape[2]))
    for r in range(len(band.first)):
        above = slice(band.first[r], min(r, count))
        scaled = M[above, r] * inverse[above]
        for here in band.beyond[r]:
            M[r, here] -= np.einsum("ib,icb->cb", scaled, M[above, here])
        if r < count:
            np.divide(1.0, M[r, r], out=inverse[r])
    return inverse


class RowElimination:
    """The first `count` rows of symmetric matrices, upper rows, eliminated one after the other.

    In place, in M (f, f, B): what is left there are the matrices of the other rows.
    """

    def __init__(self, M: Array, count: int, band: Band) -> None:
        self.M, self.band = M, band
        self.inverse = eliminate(M, count, band)

    def forward(self, right: Array) -> None:
        """Eliminate in right-hand sides (f, ..., B), in place."""
        count, band = len(self.inverse), self.band
        for r in range(len(band.first)):
            above = slice(band.first[r], min(r, count))
            right[r] -= np.einsum("ib,i...b->...b", self.M[above, r], right[above])
            if r < count:
                right[r] *= self.inverse[r]

    def backward(self, right: Array) -> None:
        """Solve for the rows that were eliminated, in place, the others known."""
        for r in range(len(self.inverse) - 1, -1, -1):
            for k, here in enumerate(self.band.beyond[r]):
                here = slice(here.start + 1, here.stop) if k == 0 else here
                beyond = np.einsum("cb,c...b->...b", self.M[r, here], right[here])
                beyond *= self.inverse[r]
                right[r] -= beyond


class Inverses:
    """What `RowElimination` does, of a few matrices by their inverses: some calls for all rows.

    Where one is singular nothing is known of any.
    """

    def __init__(self, M: Array, count: int) -> None:
        whole = M.transpose(2, 0, 1)
        upper = np.triu(whole[:, :count, :count])
        inside = upper + np.triu(upper, 1).swapaxes(1, 2)
        try:
            self.inverse = np.linalg.inv(inside)
        except np.linalg.LinAlgError:
            self.inverse = np.full_like(inside, np.nan)
        beside = whole[:, :count, count:]
        self.response = self.inverse @ beside
        whole[:, count:, count:] -= beside.swapaxes(1, 2) @ self.response

    def forward(self, right: Array) -> None:
        """Eliminate in right-hand sides (f, ..., B), in place."""
        inside, rest = self._parts(right)
        rest -= self.response.swapaxes(1, 2) @ inside
        inside[...] = self.inverse @ inside

    def backward(self, right: Array) -> None:
        """Solve for the rows that were eliminated, in place, the others known."""
        inside, rest = self._parts(right)
        inside -= self.response @ rest

    def _parts(self, right: Array) -> tuple[Array, Array]:
        """Return the rows that are eliminated, and the others, matrix by matrix: views."""
        count = self.inverse.shape[1]
        whole = right.reshape(len(right), -1, right.shape[-1]).transpose(2, 0, 1)
        return whole[:, :count], whole[:, count:]


def invert(D: Array) -> tuple[Array, Array]:
    """Return the inverses of symmetric matrices (n, n, B), and their negative eigenvalues (B,)."""
    n = len(D)
    if n == 1:
        return 1.0 / D, (D[0, 0] < 0).astype(int)
    M = np.zeros((n, 2 * n, D.shape[2]))
    M[:, :n] = D
    M[np.arange(n), n + np.arange(n)] = 1.0
    pivots = np.empty((n, D.shape[2]))
    for i in range(n):  # Gauss and Jordan
        pivots[i] = M[i, i]
        M[i] /= pivots[i]
        for r in range(n):
            if r != i:
                M[r] -= M[r, i] * M[i]
    return M[:, n:], (pivots < 0).sum(axis=0)


def multiply(A: Array, x: Array) -> Array:
    """Return the products of matrices (n, n, B) and x (n, ..., B)."""
    return np.einsum("icb,c...b->i...b", A, x)


def least_pivots(n: int, rows: NDInt, cols: NDInt, values: Array) -> Array:
    """Return the least pivots of symmetric matrices (n, n), from nonzeros (P, nonzeros, E, C)."""
    points, _, elements, members = values.shape
    M = np.zeros((n, n, points * elements * members))
    M[rows, cols] = M[cols, rows] = values.swapaxes(0, 1).reshape(rows.size, -1)
    eliminate(M, n, Band.full(n))
    at = np.arange(n)
    return M[at, at].min(axis=0).reshape(points, elements, members)
