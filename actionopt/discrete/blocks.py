"""The KKT matrix element by element: dense blocks, condensed onto the nodes between elements.

Coordinates and multipliers of one node couple to those of its own element only. So the nodes inside
each element are eliminated first, all elements of one degree at once, and what is left is a block
tridiagonal matrix over the nodes between elements; every other node of it is eliminated in turn
(cyclic reduction; Golub and Van Loan, *Matrix Computations* (4th ed. 2013), section 4.5) until the
rest is small. Work and memory grow with the number of elements, no pattern is analysed, and every
pivot is a block that LAPACK inverts with pivoting.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from actionopt.discrete.mesh import Group
from actionopt.tools.types import Array, NDInt

# Rows up to which one full matrix is quicker than blocks, n^3 in LAPACK against calls from Python:
# where two costs cross, never timed with care.
FULL_SIZE = 100
# Places inside an element that are eliminated at once: of more, what is left beside them takes
# half the work of one inverse. Measured: from 40 to 160 flat, 30 and 100 coordinates.
PLACES_AT_ONCE = 80
AT_HAND = 2**20  # numbers of a product, 8 MB, whose memory is used again; ad hoc
# glibc keeps of what is freed twice the largest array it has seen (`tools.memory`): let it have
# seen one. Measured: of ten links at 1e-9 a fifth of the time went into asking for it again.
np.empty(AT_HAND)


def in_parts(count: int, numbers: int) -> Iterator[slice]:
    """Yield the elements in parts of about `AT_HAND` numbers, if one of them has so many."""
    few = max(AT_HAND // numbers, 1)
    for first in range(0, count, few):
        yield slice(first, first + few)


class Blocks:
    """Numbering of a matrix stored in blocks.

    A node has f = n + m places, its coordinates first. The nonzeros of a matrix are the blocks of
    the elements, (E, (d + 1) f, (d + 1) f) for each degree, and those of the nodes between them,
    (N + 1, f, f), one after the other; they add up.

    Parameters
    ----------
    width : int
        f = n + m.
    groups : list of Group
    offsets : (N + 1,) array of int
        The nodes between elements.
    node_of : (evaluations,) array of int
        The node of each evaluation.
    places : (size,) array of int
        Place of each unknown and row among the K f of all nodes.
    """

    def __init__(
        self, width: int, groups: list[Group], offsets: NDInt, node_of: NDInt, places: NDInt
    ) -> None:
        self.width = f = width
        self.groups, self.offsets, self.places = groups, offsets, places
        self.nodes = int(offsets[-1]) + 1
        self.shapes = [(*g.nodes.shape, f) for g in groups]
        used = np.zeros(self.nodes * f, dtype=bool)
        used[places] = True
        self.absent = ~used.reshape(-1, f)[offsets]  # (N + 1, f): pinned, or no row
        self._scatter = (node_of[:, None] * f + np.arange(f)).ravel()

    @cached_property
    def count(self) -> int:
        """Number of nonzeros stored."""
        inside = sum(count * (nodes * f) ** 2 for count, nodes, f in self.shapes)
        return inside + self.offsets.size * self.width**2

    def split(self, nonzeros: Array) -> tuple[list[Array], Array]:
        """Return the blocks of the elements, degree by degree, and those of the nodes, as views."""
        parts, first = [], 0
        for count, nodes, f in self.shapes:
            size = count * (nodes * f) ** 2
            parts.append(nonzeros[first : first + size].reshape(count, nodes * f, nodes * f))
            first += size
        return parts, nonzeros[first:].reshape(-1, self.width, self.width)

    def product(self, nonzeros: Array, z: Array) -> Array:
        """Return the matrix times z."""
        elements, nodes = self.split(nonzeros)
        full = self.spread(z)
        parts = [
            (M @ full[g.nodes].reshape(*M.shape[:2], 1)).ravel()
            for M, g in zip(elements, self.groups, strict=True)
        ]
        total = np.bincount(self._scatter, np.concatenate(parts), full.size).reshape(full.shape)
        total[self.offsets] += (nodes @ full[self.offsets][:, :, None])[:, :, 0]
        return total.ravel()[self.places]

    def of_ends(self, nonzeros: Array, ends: Array) -> Array:
        """Return the matrix over all places times values (2, f) at the first and the last node.

        Shape (size,): how the other side of the equations changes with what is pinned there.
        """
        elements, nodes = self.split(nonzeros)
        total = np.zeros((self.nodes, self.width))
        for side, values in zip((0, -1), ends, strict=True):
            total[side] += nodes[side] @ values
            for blocks, g in zip(elements, self.groups, strict=True):
                if g.nodes[side, side] == self.offsets[side]:
                    block = blocks[side].reshape(g.nodes.shape[1], self.width, -1, self.width)
                    total[g.nodes[side]] += block[:, :, side] @ values
        return total.ravel()[self.places]

    def full(self, nonzeros: Array) -> Array:
        """Return the matrix itself, (size, size)."""
        elements, nodes = self.split(nonzeros)
        f = self.width
        matrix = np.zeros((self.nodes * f, self.nodes * f))
        for blocks, g in zip(elements, self.groups, strict=True):
            for block, first in zip(blocks, (g.nodes[:, 0] * f).tolist(), strict=True):
                part = slice(first, first + len(block))
                matrix[part, part] += block
        if nodes.any():
            matrix.reshape(self.nodes, f, self.nodes, f)[self.offsets, :, self.offsets] += nodes
        return matrix[self._whole]

    @cached_property
    def _whole(self) -> tuple[Any, ...]:
        """What to take of the matrix over all places: a part of it where that does."""
        first, size = self.places[:1].sum(), self.places.size
        if (self.places == first + np.arange(size)).all():
            return slice(first, first + size), slice(first, first + size)
        return np.ix_(self.places, self.places)

    def diagonal(self, values: Array) -> Array:
        """Return the nonzeros of the matrix that has `values` (size,) on its diagonal."""
        nonzeros, full = np.zeros(self.count), self.spread(values)
        elements, nodes = self.split(nonzeros)
        i = np.arange(self.width)
        nodes[:, i, i] = full[self.offsets]
        for M, g in zip(elements, self.groups, strict=True):
            k = np.arange(self.width, M.shape[1] - self.width)
            M[:, k, k] = full[g.nodes[:, 1:-1]].reshape(len(M), -1)
        return nonzeros

    def spread(self, z: Array) -> Array:
        """Return z by node and place, (K, f), zero where there is nothing."""
        full = np.zeros((self.nodes, self.width))
        full.ravel()[self.places] = z
        return full

    @cached_property
    def targets(self) -> tuple[NDInt, NDInt]:
        """Rows and columns of all nonzeros; -1 where there is nothing."""
        number = np.full(self.nodes * self.width, -1)
        number[self.places] = np.arange(self.places.size)
        number = number.reshape(self.nodes, -1)
        rows, cols = [], []
        for nodes in (*(g.nodes for g in self.groups), self.offsets[:, None]):
            at = number[nodes].reshape(len(nodes), -1)
            row, col = np.broadcast_arrays(at[:, :, None], at[:, None, :])
            rows.append(row.ravel())
            cols.append(col.ravel())
        return np.concatenate(rows), np.concatenate(cols)


class Condensed:
    """A matrix in blocks, factorized.

    Raises
    ------
    numpy.linalg.LinAlgError
        If a pivot block is singular; if `definite` is asked for, at the first that is not.
    """

    def __init__(self, blocks: Blocks, nonzeros: Array, *, definite: bool = False) -> None:
        self.blocks = blocks
        elements, nodes = blocks.split(nonzeros)
        f = blocks.width
        D = nodes.copy()
        U, V = np.empty((2, len(D) - 1, f, f))  # to the right of D, and below it
        self.inner: list[_Inner] = []
        for M, g in zip(elements, blocks.groups, strict=True):
            inner = _Inner(M, f, definite)
            self.inner.append(inner)
            S = inner.condensed
            D[g.elements] += S[:, f:, f:]
            D[g.elements + 1] += S[:, :f, :f]
            U[g.elements], V[g.elements] = S[:, f:, :f], S[:, :f, f:]
        for node in (0, -1):
            pinned = blocks.absent[node]
            D[node][pinned], D[node][:, pinned] = 0.0, 0.0
            D[node][pinned, pinned] = 1.0
            side = 0 if node == 0 else -1
            (U if side == 0 else V)[side][pinned] = 0.0
            (V if side == 0 else U)[side][:, pinned] = 0.0
        self.levels: list[_Level] = []
        while D.shape[0] * f > FULL_SIZE and D.shape[0] > 2:
            level = _Level.of(D, U, V, definite)
            self.levels.append(level)
            D, U, V = level.rest
        self.last = _tridiagonal(D, U, V)
        if definite:
            np.linalg.cholesky(self.last)
        self.inverse = np.linalg.inv(self.last)

    def solve(self, right: Array) -> Array:
        """Return the solution for one right-hand side, (size,)."""
        blocks, f = self.blocks, self.blocks.width
        full = blocks.spread(right)
        between = full[blocks.offsets]
        inside = []
        for inner, g in zip(self.inner, blocks.groups, strict=True):
            local = np.zeros((*inner.W.shape[:2], 1))
            local[:, : inner.places, 0] = full[g.nodes[:, 1:-1]].reshape(len(g.nodes), -1)
            inner.down(local)
            between[g.elements + 1] += local[:, -2 * f : -f, 0]
            between[g.elements] += local[:, -f:, 0]
            inside.append(local)
        between[blocks.absent] = 0.0
        between = self._between(between, 0)
        full[blocks.offsets] = between
        for inner, g, local in zip(self.inner, blocks.groups, inside, strict=True):
            local[:, -2 * f : -f, 0], local[:, -f:, 0] = (
                between[g.elements + 1],
                between[g.elements],
            )
            inner.up(local)
            full[g.nodes[:, 1:-1]] = local[:, : inner.places].reshape(len(g.nodes), -1, f)
        return full.ravel()[blocks.places]

    def _between(self, right: Array, depth: int) -> Array:
        """Solve for the nodes (N + 1, f) that are left at this depth."""
        if depth == len(self.levels):
            return (self.inverse @ right.ravel()).reshape(right.shape)
        level = self.levels[depth]
        y, even = level.down(right)
        return level.up(y, self._between(even, depth + 1))

    def negative(self) -> int:
        """Return the number of negative eigenvalues: the sum over the pivots (Haynsworth)."""
        pivots = [pivot for inner in self.inner for pivot in inner.pivots]
        pivots += [*(level.pivot for level in self.levels), self.last]
        return sum(int(np.sum(np.linalg.eigvalsh(p) < 0)) for p in pivots)


class _Inner:
    """The places inside all elements of one degree, eliminated in parts.

    Attributes
    ----------
    W : (E, p + 2 f, p + 2 f) array
        The p places inside come first, then those of the last node and those of the first. A
        part's rows hold the pivot, and right of it the inverse times the columns that are left;
        below the pivot stand its columns in the rows that are left.
    places : int
        p.
    parts : list of (slice, (E, c, c) array)
        The places of each part, and the pivot's inverse.
    """

    def __init__(self, M: Array, f: int, definite: bool) -> None:
        W = self.W = np.empty_like(M)
        W[:, :-f, :-f], W[:, :-f, -f:] = M[:, f:, f:], M[:, f:, :f]
        W[:, -f:, :-f], W[:, -f:, -f:] = M[:, :f, f:], M[:, :f, :f]
        self.places = W.shape[1] - 2 * f
        self.parts: list[tuple[slice, Array]] = []
        size = max(PLACES_AT_ONCE // f, 1) * f
        for first in range(0, self.places, size):
            part = slice(first, min(first + size, self.places))
            rest = slice(part.stop, None)
            pivot = W[:, part, part]
            if definite:
                np.linalg.cholesky(pivot)
            inverse = np.linalg.inv(pivot)
            self.parts.append((part, inverse))
            for some in in_parts(len(W), (W.shape[1] - part.stop) ** 2):
                W[some, part, rest] = inverse[some] @ W[some, part, rest]
                W[some, rest, rest] -= W[some, rest, part] @ W[some, part, rest]

    @property
    def condensed(self) -> Array:
        """Schur's complement at the last and the first node, (E, 2 f, 2 f)."""
        return self.W[:, self.places :, self.places :]

    @property
    def pivots(self) -> list[Array]:
        """The pivots (E, c, c) of the parts."""
        return [self.W[:, part, part] for part, _ in self.parts]

    def down(self, local: Array) -> None:
        """Put in place of the right sides (E, p + 2 f, 1) those of the ends, others zero there."""
        for part, inverse in self.parts:
            local[:, part] = inverse @ local[:, part]
            local[:, part.stop :] -= self.W[:, part.stop :, part] @ local[:, part]

    def up(self, local: Array) -> None:
        """Put the solution inside in its place, that of the ends given."""
        for part, _ in reversed(self.parts):
            local[:, part] -= self.W[:, part, part.stop :] @ local[:, part.stop :]


@dataclass(frozen=True, eq=False)
class _Level:
    """Every other node of a block tridiagonal matrix, the k odd ones, eliminated: blocks (k, f, f).

    `left` and `right` are the inverse times the blocks beside the pivot, `above` and `below` the
    blocks that the neighbours' rows have in its columns, `rest` the matrix that is left.
    """

    pivot: Array
    inverse: Array
    left: Array
    right: Array
    above: Array
    below: Array
    rest: tuple[Array, Array, Array]

    @classmethod
    def of(cls, D: Array, U: Array, V: Array, definite: bool) -> _Level:
        pivot = D[1::2]
        if definite:
            np.linalg.cholesky(pivot)
        inverse = np.linalg.inv(pivot)
        above, below = U[0::2], V[1::2]
        left, right = inverse @ V[0::2], inverse[: len(U[1::2])] @ U[1::2]
        k = len(right)
        rest = D[0::2].copy()
        rest[: len(left)] -= above @ left
        rest[1 : 1 + k] -= below @ right
        return cls(
            pivot, inverse, left, right, above, below,
            (rest, -(above[:k] @ right), -(below @ left[:k])),
        )  # fmt: skip

    def down(self, right: Array) -> tuple[Array, Array]:
        """Return the eliminated nodes (k, f) with zero neighbours; the right side of the rest."""
        y = (self.inverse @ right[1::2, :, None])[:, :, 0]
        even = right[0::2].copy()
        even[: len(y)] -= (self.above @ y[:, :, None])[:, :, 0]
        k = len(self.below)
        even[1 : 1 + k] -= (self.below @ y[:k, :, None])[:, :, 0]
        return y, even

    def up(self, y: Array, even: Array) -> Array:
        """Return all nodes, from those of the rest, `even`."""
        whole = np.empty((len(y) + len(even), y.shape[1]))
        whole[0::2] = even
        y = y - (self.left @ even[: len(y), :, None])[:, :, 0]
        k = len(self.right)
        y[:k] -= (self.right @ even[1 : 1 + k, :, None])[:, :, 0]
        whole[1::2] = y
        return whole


def _tridiagonal(D: Array, U: Array, V: Array) -> Array:
    """Return the full matrix with blocks D (N, f, f) and U, V (N - 1, f, f) beside them."""
    count, f = D.shape[:2]
    matrix = np.zeros((count, f, count, f))
    i = np.arange(count)
    matrix[i, :, i, :] = D
    matrix[i[:-1], :, i[1:], :] = U
    matrix[i[1:], :, i[:-1], :] = V
    return matrix.reshape(count * f, count * f)
