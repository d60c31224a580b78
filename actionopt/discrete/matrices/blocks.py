"""The KKT matrix element by element: dense blocks, condensed onto the nodes between elements.

Coordinates and multipliers of one node couple to those of its own element only. So the nodes inside
each element are eliminated first, all elements of one degree at once, and what is left is a block
tridiagonal matrix over the nodes between elements; every other node of it is eliminated in turn
(cyclic reduction; Golub and Van Loan, *Matrix Computations* (4th ed. 2013), section 4.5) until the
rest is small. Work and memory grow with the number of elements, no pattern is analysed, and every
pivot is a block that LAPACK inverts with pivoting.

The last node of a closed path is its first one: both are kept to the end, and put together there. A
few unknowns may stand beside all nodes, with as many equations, [K B; C D]. What the columns B, the
rows C and the corner D become is carried along, and what is left is one small full matrix: K itself
may be singular.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from actionopt.discrete.meshes.mesh import Group
from actionopt.tools.blas import check_definite, invert_each
from actionopt.tools.cached import cached_property
from actionopt.tools.immutable import immutable
from actionopt.tools.types import EPS, Array, NDInt

# Rows up to which one full matrix is quicker than blocks, n^3 in LAPACK against calls from Python.
# Timed, of one and two coordinates, up to 150 and 250; but paths beyond 100 that are found by luck
# of round-off, as to the opposite point of a sphere, are lost with other factors.
FULL_SIZE = 100
# Places inside an element that are eliminated at once: of more, what is left beside them takes
# half the work of one inverse. Measured: from 40 to 160 flat, 30 and 100 coordinates.
PLACES_AT_ONCE = 80
# A diagonal element this small beside the largest keeps half of the digits. Derived.
GRADED = math.sqrt(EPS)
AT_HAND = 2**20  # numbers of a product, 8 MB, whose memory is used again; ad hoc
# glibc keeps of what is freed twice the largest array it has seen (`tools.memory`): let it have
# seen one. Measured: of ten links at 1e-9 a fifth of the time went into asking for it again.
np.empty(AT_HAND)


def in_parts(count: int, numbers: int) -> list[slice]:
    """Return the elements in parts of about `AT_HAND` numbers, if one of them has so many."""
    few = max(AT_HAND // numbers, 1)
    return [slice(first, first + few) for first in range(0, count, few)]


def is_large(nodes: int, width: int) -> bool:
    """Whether an element takes all the memory at hand: no other one is copied beside it."""
    return (nodes * width) ** 2 > AT_HAND


@immutable
class Coupled:
    """Large elements of one degree, of which two nodes are coupled in few places."""

    across: Array  # (E, d + 1, d + 1, P): what couples the nodes a and b, by `row` and `col`
    nodal: Array  # (E, d + 1, f, f): what is added where a node meets itself
    # row, col (P,): places of a node, all pairs that are coupled.
    row: NDInt
    col: NDInt

    @property
    def shape(self) -> tuple[int, int, int]:
        """That of the matrices, (E, (d + 1) f, (d + 1) f)."""
        E, points, f, _ = self.nodal.shape
        return E, points * f, points * f

    def put(self, element: int, whole: Array, first: int = 0) -> None:
        """Write the matrix of an element into `whole`, ((d + 1) f, (d + 1) f), from a node on."""
        points, f = self.nodal.shape[1:3]
        nodes = np.roll(np.arange(points), -first)
        whole[:] = 0.0
        places = whole.reshape(points, f, points, f)
        across = self.across[element][nodes[:, None], nodes]
        places[:, self.row, :, self.col] = across.transpose(2, 0, 1)
        same = np.einsum("aiaj->aij", places)  # a view
        same += self.nodal[element, nodes]

    def __getitem__(self, element: int) -> Array:
        whole = np.empty(self.shape[1:])
        self.put(element, whole)
        return whole

    def rescale(self, by: Array) -> None:
        """Multiply rows and columns by factors (E, (d + 1) f)."""
        by = by.reshape(self.nodal.shape[:3])
        self.across[:] *= by[:, :, None, self.row] * by[:, None, :, self.col]
        self.nodal[:] *= by[..., None] * by[:, :, None]

    def product(self, local: Array) -> Array:
        """Return the matrices times values (E, d + 1, f)."""
        found = (self.nodal @ local[..., None])[..., 0]
        across = np.einsum("eabk,ebk->eak", self.across, local[:, :, self.col])
        np.add.at(found.transpose(2, 0, 1), self.row, across.transpose(2, 0, 1))
        return found


class Blocks:
    """Numbering of a matrix stored in blocks.

    A node has f = n + m places, its coordinates first. The nonzeros of a matrix are the blocks of
    the elements, (E, (d + 1) f, (d + 1) f) for each degree, and those of the nodes between them,
    (N + 1, f, f), one after the other; they add up. Of large elements, two nodes of which are
    coupled in few places `across`, it is the parts of `Coupled`.

    Parameters
    ----------
    coordinates, rows : int
        n and m.
    groups : list of Group
    offsets : (N + 1,) array of int
        The nodes between elements.
    node_of : (evaluations,) array of int
        The node of each evaluation.
    places : (size,) array of int
        Place of each unknown and row among the K f of all nodes.
    closed : sequence of int
        Of a closed path, the first node's coordinate that each of the last node's is, (n,).
    symmetric : bool
        Whether all matrices are: there are no non-conservative forces.
    across : (2, P) array of int, optional
        Rows and columns of what two nodes of an element are coupled by, in order.
    """

    def __init__(
        self,
        coordinates: int,
        rows: int,
        groups: list[Group],
        offsets: NDInt,
        node_of: NDInt,
        places: NDInt,
        closed: Sequence[int] = (),
        *,
        symmetric: bool,
        across: NDInt | None = None,
    ) -> None:
        self.symmetric, self.across = symmetric, across
        self.coordinates, self.width = coordinates, coordinates + rows
        f = self.width
        self.groups, self.offsets, self.places = groups, offsets, places
        self.closed = np.array(closed, dtype=np.intp)
        self.nodes = int(offsets[-1]) + 1
        self.shapes = [(*g.nodes.shape, f) for g in groups]
        self.large = is_large(max(nodes for _, nodes, _ in self.shapes), f)
        used = np.zeros((self.nodes, f), dtype=bool)
        used.ravel()[places] = True
        used[-1, : self.closed.size] |= used[0, self.closed]
        self.absent = ~used[offsets]  # (N + 1, f): pinned, or no row
        self.incomplete = np.flatnonzero(self.absent.any(axis=1)).tolist()
        # The same of the nodes inside elements, (E, (d - 1) f): constraints that are not in force.
        inside = [~used[g.nodes[:, 1:-1]].reshape(len(g.nodes), -1) for g in groups]
        self.absent_inside = [part if part.any() else None for part in inside]
        self._scatter = (node_of[:, None] * f + np.arange(f)).ravel()

    @cached_property
    def count(self) -> int:
        """Number of nonzeros stored."""
        return sum(map(sum, self._sizes)) + self.offsets.size * self.width**2

    @cached_property
    def _sizes(self) -> list[tuple[int, ...]]:
        """Numbers of the elements of each degree, of each part of `Coupled`."""
        if self.across is None:
            return [(count * (nodes * f) ** 2,) for count, nodes, f in self.shapes]
        pairs = self.across.shape[1]
        return [(count * nodes**2 * pairs, count * nodes * f**2) for count, nodes, f in self.shapes]

    def split(self, nonzeros: Array) -> tuple[list[Any], Array]:
        """Return the blocks of the elements, degree by degree, and those of the nodes, as views.

        Arrays, or `Coupled`.
        """
        parts, first = [], 0
        for (count, nodes, f), (size, *more) in zip(self.shapes, self._sizes, strict=True):
            part, first = nonzeros[first : first + size], first + size
            if self.across is None:
                parts.append(part.reshape(count, nodes * f, nodes * f))
                continue
            nodal, first = nonzeros[first : first + more[0]], first + more[0]
            across, (row, col) = part.reshape(count, nodes, nodes, -1), self.across
            parts.append(Coupled(across, nodal.reshape(count, nodes, f, f), row, col))
        return parts, nonzeros[first:].reshape(-1, self.width, self.width)

    def add(self, nonzeros: Array, unknowns: NDInt, matrix: Array) -> None:
        """Add a matrix (k, k) to the nonzeros for unknowns of one node between elements."""
        node, place = np.divmod(self.places[unknowns], self.width)
        block = self.split(nonzeros)[1][np.searchsorted(self.offsets, node[0])]
        block[place[:, None], place] += matrix

    def scale(self, nonzeros: Array) -> Array | None:
        """Return factors (size,) that bring all coordinates' equations to one size, powers of two.

        None where they are so already. A coordinate that hardly moves has small equations, whose
        digits pivoting would lose among the others'.
        """
        f, n = self.width, self.coordinates
        size = np.zeros(f)
        elements, nodes = self.split(nonzeros)
        for M in elements:
            diagonal = np.abs(M[0].diagonal()).reshape(-1, f)
            np.maximum(size, diagonal.max(axis=0), out=size)
        for _ in self.closed:  # those that take each other's place have one unit
            size[:n] = np.maximum(size[:n], size[self.closed])
        least = float(size[:n].min())
        if not 0 < least < GRADED * float(size[:n].max()):
            return None
        power = np.zeros(f)
        power[:n] = -np.round(np.log2(size[:n]) / 2)
        rows = np.abs(nodes[:, n:, :n]).max(axis=0, initial=0.0) * 2 ** power[:n]
        power[n:] = -np.round(np.log2(np.fmax(rows.max(axis=1), np.finfo(float).tiny)))
        return (2**power)[self.places % f]

    def grade(self, nonzeros: Array) -> Array | None:
        """Return factors (size,) that bring the diagonal to one size, powers of two.

        None where it is so already, or not positive: where the inertia varies along the path,
        pivoting would lose the digits of the small equations.
        """
        if self.across is not None:
            return None
        values = nonzeros[self._diagonal]
        if not 0 < np.minimum.reduce(values) < GRADED * np.maximum.reduce(values):
            return None
        size = np.bincount(self._scatter, values, self.nodes * self.width)
        size.reshape(-1, self.width)[self.offsets] += np.einsum("eii->ei", self.split(nonzeros)[1])
        size = size[self.places]  # without those that are pinned, and of nodes as wholes
        if not 0 < np.minimum.reduce(size) < GRADED * np.maximum.reduce(size):
            return None
        return 2 ** -np.round(np.log2(size) / 2)

    @cached_property
    def _diagonal(self) -> NDInt:
        """Where the elements' diagonals are among the nonzeros, in the order of `_scatter`."""
        at, first = [], 0
        for count, nodes, f in self.shapes:
            k = nodes * f
            at.append((first + np.arange(count)[:, None] * k * k + np.arange(k) * (k + 1)).ravel())
            first += count * k * k
        return np.concatenate(at)

    def rescale(self, nonzeros: Array, scale: Array) -> Array:
        """Return the nonzeros of the matrix with rows and columns times factors (size,)."""
        scaled, full = nonzeros.copy(), self.spread(scale)
        self.expand(full)
        elements, nodes = self.split(scaled)
        at = [*(full[g.nodes].reshape(len(g.nodes), -1) for g in self.groups), full[self.offsets]]
        for M, s in zip([*elements, nodes], at, strict=True):
            if isinstance(M, Coupled):
                M.rescale(s)
            else:
                M *= s[:, :, None] * s[:, None, :]
        return scaled

    def product(self, nonzeros: Array, z: Array) -> Array:
        """Return the matrix times z."""
        elements, nodes = self.split(nonzeros)
        full = self.spread(z)
        self.expand(full)
        parts = [
            M.product(full[g.nodes]).ravel()
            if self.across is not None
            else (M @ full[g.nodes].reshape(*M.shape[:2], 1)).ravel()
            for M, g in zip(elements, self.groups, strict=True)
        ]
        total = np.bincount(self._scatter, np.concatenate(parts), full.size).reshape(full.shape)
        total[self.offsets] += (nodes @ full[self.offsets][:, :, None])[:, :, 0]
        self._fold(total)
        return total.ravel()[self.places]

    def expand(self, full: Array) -> None:
        """Set the last node (..., f) of a closed path to the values at the first one."""
        if self.closed.size:
            full[-1, : self.closed.size] = full[0, self.closed]

    def _fold(self, full: Array) -> None:
        """Add the values at the last node (..., f) of a closed path to those at the first one."""
        if self.closed.size:
            full[0, self.closed] += full[-1, : self.closed.size]

    def of_ends(self, nonzeros: Array, ends: Array) -> Array:
        """Return the matrix over all places times values (2, f) at the first and the last node.

        Shape (size,): how the other side of the equations changes with what is pinned there.
        """
        elements, nodes = self.split(nonzeros)
        total = np.zeros((self.nodes, self.width))
        ends = ends.copy()
        self.expand(ends)
        for side, values in zip((0, -1), ends, strict=True):
            total[side] += nodes[side] @ values
            for blocks, g in zip(elements, self.groups, strict=True):
                if g.nodes[side, side] == self.offsets[side]:
                    block = blocks[side].reshape(g.nodes.shape[1], self.width, -1, self.width)
                    total[g.nodes[side]] += block[:, :, side] @ values
        self._fold(total)
        return total.ravel()[self.places]

    def full(self, nonzeros: Array) -> Array:
        """Return the matrix itself, (size, size)."""
        size = self.places.size
        return np.bincount(self._flat, nonzeros, size * size + 1)[:-1].reshape(size, size)

    @cached_property
    def _flat(self) -> NDInt:
        """Where each nonzero stands in the full matrix, row by row; behind it what is nowhere."""
        size = self.places.size
        flat = [(row * size + col).ravel() for row, col in self._numbers(nowhere=size * size)]
        return np.minimum(np.concatenate(flat), size * size)

    def diagonal(self, values: Array) -> Array:
        """Return the nonzeros of the matrix that has `values` (size,) on its diagonal."""
        nonzeros, full = np.zeros(self.count), self.spread(values)
        elements, nodes = self.split(nonzeros)
        i = np.arange(self.width)
        nodes[:, i, i] = full[self.offsets]
        for M, g in zip(elements, self.groups, strict=True):
            inside = full[g.nodes[:, 1:-1]]
            if isinstance(M, Coupled):
                M.nodal[:, 1:-1, i, i] = inside
                continue
            k = np.arange(self.width, M.shape[1] - self.width)
            M[:, k, k] = inside.reshape(len(M), -1)
        return nonzeros

    def spread(self, z: Array) -> Array:
        """Return z (size,) or (size, c) by node and place, (K, f, ...), zero where is nothing."""
        full = np.zeros((self.nodes * self.width, *z.shape[1:]))
        full[self.places] = z
        return full.reshape(self.nodes, self.width, *z.shape[1:])

    @cached_property
    def targets(self) -> tuple[NDInt, NDInt]:
        """Rows and columns of all nonzeros; -1 where there is nothing."""
        rows, cols = [], []
        for row, col in self._numbers(nowhere=-1):
            row, col = np.broadcast_arrays(row, col)
            rows.append(row.ravel())
            cols.append(col.ravel())
        return np.concatenate(rows), np.concatenate(cols)

    def _numbers(self, nowhere: int) -> Iterator[tuple[NDInt, NDInt]]:
        """Yield rows and columns in the full matrix of the nonzeros, to be broadcast, in order."""
        number = np.full(self.nodes * self.width, nowhere)
        number[self.places] = np.arange(self.places.size)
        number = number.reshape(self.nodes, -1)
        self.expand(number)
        for nodes in [*(g.nodes for g in self.groups), self.offsets[:, None]]:
            at = number[nodes]
            if self.across is not None and nodes.shape[1] > 1:
                row, col = self.across
                yield at[:, :, None, row], at[:, None, :, col]
                yield at[..., None], at[:, :, None]
                continue
            at = at.reshape(len(nodes), -1)
            yield at[:, :, None], at[:, None, :]


class Condensed:
    """A matrix in blocks, factorized, or one bordered by columns B, rows C and a corner D.

    Raises
    ------
    numpy.linalg.LinAlgError
        If a pivot block is singular; if `definite` is asked for, at the first that is not.
    """

    def __init__(
        self,
        blocks: Blocks,
        nonzeros: Array,
        border: tuple[Array, Array, Array] | None = None,
        *,
        definite: bool = False,
    ) -> None:
        self.blocks = blocks
        elements, nodes = blocks.split(nonzeros)
        f = blocks.width
        D = nodes.copy()
        U, V = np.empty((2, len(D) - 1, f, f))  # to the right of D, and below it
        self.inner: list[_Inner] = []
        for M, g, absent in zip(elements, blocks.groups, blocks.absent_inside, strict=True):
            inner = _Inner(blocks, M, absent, definite)
            self.inner.append(inner)
            S = inner.end_blocks
            D[g.elements] += S[:, f:, f:]
            D[g.elements + 1] += S[:, :f, :f]
            U[g.elements], V[g.elements] = S[:, f:, :f], S[:, :f, f:]
        for node in blocks.incomplete:
            pinned = blocks.absent[node]
            D[node][pinned], D[node][:, pinned] = 0.0, 0.0
            D[node][pinned, pinned] = 1.0
            if node < len(U):
                U[node][pinned], V[node][:, pinned] = 0.0, 0.0
            if node:
                U[node - 1][:, pinned], V[node - 1][pinned] = 0.0, 0.0
        self.levels: list[_Level] = []
        while D.shape[0] * f > FULL_SIZE and D.shape[0] > 2:
            level = _Level.of(D, U, V, definite, keeps_last=blocks.closed.size > 0)
            self.levels.append(level)
            D, U, V = level.rest
        self.last = _tridiagonal(D, U, V)
        if blocks.closed.size:
            self._fold()
        self.carried: list[Array] = []
        if border is not None and border[2].size:  # of a path at rest no phase is to be found
            self._carry(*border)
        if definite:
            check_definite(self.last)
        # The last matrix of a family, bordered or not, is singular but for round-off: an inverse
        # would make its condition times as much of that as a solution does.
        regular = border is None and not blocks.closed.size
        self.inverse = invert_each(self.last) if regular else None

    def _fold(self) -> None:
        """Identify the last node of a closed path with the first one, in the last matrix."""
        closed, f, matrix = self.blocks.closed, self.blocks.width, self.last
        last = len(matrix) - f + np.flatnonzero(~self.blocks.absent[-1, : closed.size])
        first = closed[last - (len(matrix) - f)]
        matrix[first] += matrix[last]
        matrix[:, first] += matrix[:, last]
        self.last = matrix[:-f, :-f]

    def _carry(self, columns: Array, rows: Array, corner: Array) -> None:
        """Border the last matrix with columns (size, b), rows (b, size) and a corner (b, b).

        Eliminating all other nodes changes them as it changes the last matrix: what is left there
        is their Schur complement.
        """
        blocks, b = self.blocks, len(corner)
        self.across, C = self._eliminate(blocks.spread(rows.T), rows=True)
        for inner, y in zip(self.inner, self.across, strict=False):
            y[:, inner.places :] = 0.0  # what is left there is no pivot's
        self.carried, B = self._eliminate(blocks.spread(columns))
        B, C = self._first(B).reshape(-1, b), self._first(C).reshape(-1, b)
        self.last = np.block([[self.last, B], [C.T, corner - self._border_times(self.carried)]])

    def _first(self, between: Array) -> Array:
        """Return values at the last nodes (s, f, c), a closed path's end added to its start."""
        if not self.blocks.closed.size:
            return between
        between[0, self.blocks.closed] += between[-1, : self.blocks.closed.size]
        return between[:-1]

    def _border_times(self, eliminated: list[Array]) -> Array:
        """Return the border's rows times what was eliminated, (b, c)."""
        total = np.zeros((self.across[0].shape[2], eliminated[0].shape[2]))
        for C, y in zip(self.across, eliminated, strict=True):
            total += C.reshape(-1, C.shape[2]).T @ y.reshape(-1, y.shape[2])
        return total

    def solve(self, right: Array) -> Array:
        """Return the solution for one right-hand side, (size + b,), or several, (size + b, c)."""
        blocks, f, size = self.blocks, self.blocks.width, self.blocks.places.size
        columns = right.shape[1:]
        full = blocks.spread(right[:size]).reshape(blocks.nodes, f, -1)
        eliminated, between = self._eliminate(full)
        between = self._first(between)
        left = between.reshape(-1, *columns)
        if self.carried:
            beside = self._border_times(eliminated).reshape(-1, *columns)
            left = np.concatenate([left, right[size:] - beside])
        known = self.inverse
        left = np.linalg.solve(self.last, left) if known is None else known @ left
        between, beside = left[: len(between) * f].reshape(between.shape), left[len(between) * f :]
        if self.carried:
            for y, Y in zip(eliminated, self.carried, strict=True):
                y -= Y @ beside.reshape(len(beside), -1)
        if blocks.closed.size:
            between = np.concatenate([between, np.zeros_like(between[:1])])
            blocks.expand(between)
        for level in reversed(self.levels):
            between = level.substitute(eliminated.pop(), between)
        full[blocks.offsets] = between
        for inner, g, local in zip(self.inner, blocks.groups, eliminated, strict=True):
            local[:, -2 * f : -f], local[:, -f:] = between[g.elements + 1], between[g.elements]
            inner.substitute(local)
            inside = local[:, : inner.places]
            full[g.nodes[:, 1:-1]] = inside.reshape(len(g.nodes), -1, *full.shape[1:])
        found = full.reshape(-1, *columns)[blocks.places]
        return np.concatenate([found, beside]) if self.carried else found

    def between(self, ends: list[Array]) -> list[Array]:
        """Return all nodes (E, d + 1, f, c) of elements whose `ends` (E, 2, f, c) are given.

        Inside, the equations hold without a right side.
        """
        found, f = [], self.blocks.width
        for inner, given in zip(self.inner, ends, strict=True):
            local = np.zeros((*inner.shape, given.shape[3]))
            local[:, -2 * f : -f], local[:, -f:] = given[:, 1], given[:, 0]
            inner.substitute(local)
            inside = local[:, : inner.places].reshape(len(local), -1, *given.shape[2:])
            found.append(np.concatenate([given[:, :1], inside, given[:, 1:]], axis=1))
        return found

    def _eliminate(self, full: Array, *, rows: bool = False) -> tuple[list[Array], Array]:
        """Eliminate from right sides (K, f, c), or from `rows` beside the matrix: forward.

        Return what was eliminated, (E, p + 2 f, c) for each degree and then (k, f, c) for each
        level of the reduction, and what is left at the last nodes, (s, f, c).
        """
        blocks, f = self.blocks, self.blocks.width
        between, eliminated = full[blocks.offsets], []
        for inner, g in zip(self.inner, blocks.groups, strict=True):
            local = np.zeros((*inner.shape, full.shape[2]))
            inside = full[g.nodes[:, 1:-1]]
            local[:, : inner.places] = inside.reshape(len(inside), inner.places, full.shape[2])
            inner.eliminate(local, rows=rows)
            between[g.elements + 1] += local[:, -2 * f : -f]
            between[g.elements] += local[:, -f:]
            eliminated.append(local)
        between[blocks.absent] = 0.0
        for level in self.levels:
            y, between = level.eliminate(between, rows=rows)
            eliminated.append(y)
        return eliminated, between

    def negative(self) -> int:
        """Return the number of negative eigenvalues: the sum over the pivots (Haynsworth)."""
        return sum(int(np.sum(np.linalg.eigvalsh(p) < 0)) for p in self._pivots)

    @property
    def largest(self) -> float:
        """The largest entry of a pivot: round-off is as much more as it is beyond the matrix."""
        return max(float(np.abs(p).max(initial=0.0)) for p in self._pivots)

    @property
    def _pivots(self) -> list[Array]:
        pivots = [pivot for inner in self.inner for pivot in inner.pivots]
        return [*pivots, *(level.pivot for level in self.levels), self.last]


class _Inner:
    """The places inside all elements of one degree, eliminated in parts.

    Attributes
    ----------
    shape : (int, int)
        E and p + 2 f: the p places inside come first, then those of the last node and those of
        the first.
    places : int
        p.
    parts : list of tuple
        The places (a slice) of each part, the pivot (E, c, c), its inverse, this times the k
        columns that are left, (E, c, k), and the pivot's columns in the rows that are left,
        (E, k, c); None where the matrix is symmetric and large.
    end_blocks : (E, 2 f, 2 f) array
        Schur's complement at the last and the first node.
    """

    def __init__(
        self, blocks: Blocks, M: Any, absent: NDArray[np.bool_] | None, definite: bool
    ) -> None:
        f = blocks.width
        self.parts: list[tuple[slice, Array, Array, Array, Array | None]] = []
        self.shape = M.shape[:2]
        self.places = self.shape[1] - 2 * f
        size = max(PLACES_AT_ONCE // f, 1) * f
        if blocks.large:
            self._one_by_one(blocks, M, absent, size, definite)
            return
        W = np.empty_like(M)
        W[:, :-f, :-f], W[:, :-f, -f:] = M[:, f:, f:], M[:, f:, :f]
        W[:, -f:, :-f], W[:, -f:, -f:] = M[:, :f, f:], M[:, :f, :f]
        if absent is not None:
            e, k = absent.nonzero()
            W[e, k, k] = 1.0
        for first in range(0, self.places, size):
            part = slice(first, min(first + size, self.places))
            rest = slice(part.stop, None)
            pivot = W[:, part, part]
            if definite:
                check_definite(pivot)
            inverse = invert_each(pivot)
            self.parts.append((part, pivot, inverse, W[:, part, rest], W[:, rest, part]))
            for some in in_parts(len(W), (W.shape[1] - part.stop) ** 2):
                W[some, part, rest] = inverse[some] @ W[some, part, rest]
                W[some, rest, rest] -= W[some, rest, part] @ W[some, part, rest]
        self.end_blocks = W[:, self.places :, self.places :]

    def _one_by_one(
        self,
        blocks: Blocks,
        M: Any,
        absent: NDArray[np.bool_] | None,
        size: int,
        definite: bool,
    ) -> None:
        """Eliminate in one large element after the other; of each, what is needed is kept.

        Of a symmetric one that are the blocks right of the diagonal: half the work and the memory.
        """
        f, places, (E, width) = blocks.width, self.places, self.shape
        W, self.end_blocks = np.empty((width, width)), np.empty((E, 2 * f, 2 * f))
        parts = [slice(k, min(k + size, places)) for k in range(0, places, size)]
        for part in parts:
            c, k = part.stop - part.start, width - part.stop
            below: Array | None = None if blocks.symmetric else np.empty((E, k, c))
            pivots, inverses = np.empty((2, E, c, c))
            self.parts.append((part, pivots, inverses, np.empty((E, c, k)), below))
        for e in range(E):
            if isinstance(M, Coupled):
                M.put(e, W, first=1)
            else:
                W[:-f, :-f], W[:-f, -f:] = M[e, f:, f:], M[e, f:, :f]
                W[-f:, :-f], W[-f:, -f:] = M[e, :f, f:], M[e, :f, :f]
            if absent is not None:
                k = absent[e].nonzero()[0]
                W[k, k] = 1.0
            for number, (part, pivots, inverses, rights, belows) in enumerate(self.parts):
                pivots[e] = W[part, part]
                if definite:
                    check_definite(pivots[e])
                inverses[e] = invert_each(pivots[e])
                right = np.matmul(inverses[e], W[part, part.stop :], out=rights[e])
                if belows is not None:
                    belows[e] = W[part.stop :, part]
                for rows in [*parts[number + 1 :], slice(places, width)]:
                    first = rows.start if blocks.symmetric else part.stop
                    below = W[part, rows].T if blocks.symmetric else W[rows, part]
                    W[rows, first:] -= below @ right[:, first - part.stop :]
            self.end_blocks[e] = W[places:, places:]

    @property
    def pivots(self) -> list[Array]:
        """The pivots (E, c, c) of the parts."""
        return [pivot for _, pivot, *_ in self.parts]

    def eliminate(self, local: Array, *, rows: bool = False) -> None:
        """Put in place of the right sides (E, p + 2 f, c) those of the ends, others zero there.

        Or of `rows` beside the matrix.
        """
        for part, _, inverse, right, below in self.parts:
            before = local[:, part]
            after = before if rows else inverse @ before
            if rows or below is None:
                local[:, part.stop :] -= right.transpose(0, 2, 1) @ before
            else:
                local[:, part.stop :] -= below @ after
            local[:, part] = after

    def substitute(self, local: Array) -> None:
        """Put the solution inside in its place, that of the ends given."""
        for part, _, _, right, _ in reversed(self.parts):
            local[:, part] -= right @ local[:, part.stop :]


@immutable
class _Level:
    """Every other node of a block tridiagonal matrix, the k odd ones, eliminated: blocks (k, f, f).

    `left` and `right` are the inverse times the blocks beside the pivot, `above` and `below` the
    blocks that the neighbours' rows have in its columns, `rest` the matrix that is left. The last
    node of an even number is not one of the odd ones if it is `spare`.
    """

    pivot: Array
    inverse: Array
    left: Array
    right: Array
    above: Array
    below: Array
    rest: tuple[Array, Array, Array]
    spare: bool

    @classmethod
    def of(cls, D: Array, U: Array, V: Array, definite: bool, *, keeps_last: bool) -> _Level:
        """Eliminate every other block D (N, f, f) of a matrix with U and V (N - 1, f, f) beside.

        The last one is not eliminated if `keeps_last`. Raises numpy.linalg.LinAlgError where a
        matrix that is to be `definite` is not.
        """
        spare = keeps_last and len(D) % 2 == 0
        last = U[-1:], V[-1:]
        if spare:
            U, V = U[:-1], V[:-1]
        pivot = D[1:-1:2] if spare else D[1::2]
        if definite:
            check_definite(pivot)
        inverse = invert_each(pivot)
        above, below = U[0::2], V[1::2]
        left, right = inverse @ V[0::2], inverse[: len(U[1::2])] @ U[1::2]
        k = len(right)
        rest = _even(D, spare)
        rest[: len(left)] -= above @ left
        rest[1 : 1 + k] -= below @ right
        U, V = -(above[:k] @ right), -(below @ left[:k])
        if spare:
            U, V = np.concatenate([U, last[0]]), np.concatenate([V, last[1]])
        return cls(pivot, inverse, left, right, above, below, (rest, U, V), spare)

    def eliminate(self, right: Array, *, rows: bool) -> tuple[Array, Array]:
        """Return the eliminated nodes (k, f, c) with zero neighbours; the right side of the rest.

        Or the same of `rows` beside the matrix.
        """
        y, before, after = right[1:-1:2] if self.spare else right[1::2], self.above, self.below
        if rows:
            before, after = self.left.transpose(0, 2, 1), self.right.transpose(0, 2, 1)
        else:
            y = self.inverse @ y
        even = _even(right, self.spare)
        even[: len(y)] -= before @ y
        k = len(after)
        even[1 : 1 + k] -= after @ y[:k]
        return y, even

    def substitute(self, y: Array, even: Array) -> Array:
        """Return all nodes, from those of the rest, `even`."""
        whole = np.empty((len(y) + len(even), *y.shape[1:]))
        odd = whole[1::2]
        if self.spare:
            odd, whole[-1], even = whole[1:-1:2], even[-1], even[:-1]
        whole[0::2] = even
        y = y - self.left @ even[: len(y)]
        k = len(self.right)
        y[:k] -= self.right @ even[1 : 1 + k]
        odd[:] = y
        return whole


def _even(nodes: Array, spare: bool) -> Array:
    """Return the nodes of a level that are left, copied."""
    return np.concatenate([nodes[0::2], nodes[-1:]]) if spare else nodes[0::2].copy()


def _tridiagonal(D: Array, U: Array, V: Array) -> Array:
    """Return the full matrix with blocks D (N, f, f) and U, V (N - 1, f, f) beside them."""
    count, f = D.shape[:2]
    matrix = np.zeros((count, f, count, f))
    i = np.arange(count)
    matrix[i, :, i, :] = D
    matrix[i[:-1], :, i[1:], :] = U
    matrix[i[1:], :, i[:-1], :] = V
    return matrix.reshape(count * f, count * f)
