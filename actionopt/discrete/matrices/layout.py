"""Numbering and sparsity of the discrete problem: what depends on the mesh's shape alone.

Contributions of elements are computed in a fixed order and summed into the nonzeros of a sparse
matrix by one index array, so that assembly has no loop over elements.
"""

from __future__ import annotations

import threading
from functools import lru_cache
from typing import Any, Literal

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from actionopt.discrete.matrices.blocks import FULL_SIZE, Blocks, is_large
from actionopt.discrete.meshes.boundaries import find_boundaries
from actionopt.discrete.meshes.element import Element, element
from actionopt.discrete.meshes.mesh import KEPT_NODES, SHAPES_KEPT, Elements, Mesh
from actionopt.mechanics.question.problem import Problem
from actionopt.mechanics.system import System
from actionopt.tools.cached import cached_property
from actionopt.tools.immutable import immutable
from actionopt.tools.types import Array, NDInt


class MatrixLayout:
    """Numbering and storage of a KKT matrix, as Newton's method and `factors` see them."""

    system: System
    unknowns: int  # coordinates that are free
    rows: int  # multipliers
    storage: Literal["blocks", "sparse"]
    border: int = 0  # unknowns beside these, with dense rows and columns
    closed: tuple[int, ...]  # where the last node's places are at the first one, of a closed path
    partial: bool = False  # whether rows are not in force at some nodes
    blocks: Blocks
    kkt: Pattern
    probe: Array  # (size,), a smooth right-hand side of no symmetry

    def __init__(self) -> None:
        self._own = _Solvers()

    @property
    def solvers(self) -> dict[str, Any]:
        """The solvers compiled for this shape, by kind; each thread has its own, with memory."""
        return self._own.kinds

    @property
    def inside_solvers(self) -> dict[tuple[int, int], Any]:
        """Those of what is inside elements, by their degree and how many columns at once.

        All layouts of a system share them.
        """
        return self.system.memoize("inside", _Solvers).kinds

    @property
    def size(self) -> int:
        """All unknowns together."""
        return self.unknowns + self.rows + self.border

    @cached_property
    def small(self) -> bool:
        """Whether the blocks are best put together in one full matrix to solve with."""
        held = self.partial and self.system.order == 1
        return self.storage == "blocks" and self.size <= (HELD_SIZE if held else FULL_SIZE)

    @cached_property
    def uses_condensation(self) -> bool:
        """Whether the blocks are condensed to solve with."""
        return self.storage == "blocks" and not self.small

    @cached_property
    def may_be_uneven(self) -> bool:
        """Whether the equations may be of very different sizes, and pivoting mixes them.

        The events of a closed path do not tell how large each coordinate is, and an inertia may
        vary along a path.
        """
        structure = self.system.structure
        varies = structure.depends_on_time or not structure.constant_mass
        return self.storage == "blocks" and (bool(self.closed) or (varies and not self.rows))

    @property
    def needs_no_pivoting(self) -> bool:
        """Whether factors without pivoting serve: those of a symmetric matrix."""
        return not (self.system.structure.forced or self.border)

    @property
    def keeps_factors(self) -> bool:
        """Whether sparse factors are kept: solutions under constraints have to be refined."""
        kept = self.storage == "sparse" and self.needs_no_pivoting and self.size > KEPT_SIZE
        return kept and self.rows > 0

    @cached_property
    def row_diagonal(self) -> NDInt:
        """Positions of the rows' diagonal entries among the nonzeros of `kkt`."""
        pattern = self.kkt
        return np.flatnonzero((pattern.row == pattern.col) & (pattern.row >= self.unknowns))


class Numbering:
    """Numbers of the coordinates at the nodes of all meshes of one shape, whatever the system is.

    Parameters are those of `Layout`, and the `order` and the number of coordinates of a system.
    """

    closed: tuple[int, ...]

    def __init__(
        self,
        shape: Elements,
        order: int,
        n: int,
        start: tuple[int, ...],
        end: tuple[int, ...],
        closed: tuple[int, ...],
        inner: tuple[tuple[int, tuple[int, ...]], ...],
    ) -> None:
        self.order, self.n, self.closed = order, n, closed
        self.offsets = shape.offsets  # nodes between elements
        self.node_count = int(shape.offsets[-1]) + 1
        self.groups = shape.groups
        self.evaluations = shape.groups[-1].span.stop
        self.node_of = np.concatenate([g.nodes.ravel() for g in self.groups])
        self.unseen = self._find_unseen()

        self.width = order * n
        number = np.full((self.node_count, self.width), -1 if order > 1 else 0)
        if order > 1:
            for g, shape_of in zip(self.groups, self.shapes, strict=True):
                number.reshape(-1, order, n)[g.nodes[:, shape_of.node], shape_of.derivative] = 0
        number[0, list(start)] = -1
        number[-1, slice(None) if closed else list(end)] = -1
        for boundary, pinned in inner:
            number[shape.offsets[boundary], list(pinned)] = -1
        self.free = (number.ravel() == 0).nonzero()[0]
        self.unknowns = self.free.size
        number.ravel()[self.free] = np.arange(self.unknowns)
        if closed:
            number[-1] = number[0, list(closed)]
        self.number = number
        self.scatter = self._scatter()

    @cached_property
    def shapes(self) -> list[Element]:
        """The polynomials of each degree; of paths of order one nobody asks for them."""
        return [element(g.rule.degree, self.order) for g in self.groups]

    def _find_unseen(self) -> tuple[NDInt, NDInt]:
        """Return the evaluations at open ends of elements, of no weight, and those next to them."""
        found = []
        for g in self.groups:
            if any(g.rule.ends):  # one element
                first, last = g.span.start, g.span.stop - 1
                sides = (first, first + 1), (last, last - 1)
                found += [pair for pair, out in zip(sides, g.rule.ends, strict=True) if out]
        at, beside = np.array(found, dtype=np.intp).reshape(-1, 2).T
        return at, beside

    def _scatter(self) -> NDInt:
        """Return where in the full gradient (K width) each element's gradients are, flattened."""
        n = self.n
        if self.order == 1:
            return (self.node_of[:, None] * n + np.arange(n)).ravel()
        at = [
            (g.nodes[:, el.node] * self.width + el.derivative * n).ravel()
            for g, el in zip(self.groups, self.shapes, strict=True)
        ]
        return (np.concatenate(at)[:, None] + np.arange(n)).ravel()

    @cached_property
    def derivative(self) -> NDInt:
        """Which derivative each of the elements' unknowns is the value of, (evaluations,)."""
        pairs = zip(self.groups, self.shapes, strict=True)
        return np.concatenate([np.tile(el.derivative, len(g.nodes)) for g, el in pairs])

    @cached_property
    def element_ends(self) -> NDInt:
        """Positions of both ends of each element among the evaluations, (2 elements,)."""
        at = np.empty((self.offsets.size - 1, 2), dtype=np.intp)
        for g in self.groups:
            first = np.arange(g.span.start, g.span.stop, g.nodes.shape[1])
            at[g.elements] = first[:, None] + [0, g.nodes.shape[1] - 1]
        return at.ravel()

    @cached_property
    def element_of(self) -> NDInt:
        """The element of each evaluation, (evaluations,)."""
        return np.concatenate([np.repeat(g.elements, g.rule.degree + 1) for g in self.groups])

    @cached_property
    def plain_blocks(self) -> Blocks:
        """The places of everything in a symmetric matrix stored in blocks, without constraints."""
        parts = self.groups, self.offsets, self.node_of, self.free, self.closed
        return Blocks(self.width, 0, *parts, symmetric=True)


_numbering = lru_cache(SHAPES_KEPT)(Numbering)


class Layout(MatrixLayout, Numbering):
    """Numbering and sparsity of the discrete problem on all meshes of one shape.

    A node has places for the coordinates and, of a system of higher order, for their derivatives at
    the boundaries of elements (`element`): `width` of them.

    Parameters
    ----------
    system : System
    shape : Mesh
        Its degrees count, its times do not.
    start, end : tuple of int
        Indices of the places pinned at either end.
    closed : tuple of int
        Of a path that closes, the first node's place that each of the last node's is: it has no
        unknowns and no rows of its own. Else empty.
    nodal : tuple of int
        Nodes whose coordinates are coupled by a term of their own (`nodal`).
    in_force : (K, order m) array of bool, optional
        Which constraints are so at each node; all of them if None. In higher orders, which of their
        rates below the order are so as well.
    inner : tuple of (int, tuple of int)
        Boundaries between elements at which a path passes events, and the places given there.

    Raises
    ------
    ValueError
        For a closed path of one element, which would meet itself in it, and for elements of too low
        a degree for the system's order.
    """

    def __init__(
        self,
        system: System,
        shape: Mesh,
        start: tuple[int, ...],
        end: tuple[int, ...],
        closed: tuple[int, ...] = (),
        nodal: tuple[int, ...] = (),
        in_force: NDArray[np.bool_] | None = None,
        inner: tuple[tuple[int, tuple[int, ...]], ...] = (),
    ) -> None:
        super().__init__()
        self.system, self.nodal = system, nodal
        self.partial = in_force is not None
        if closed and shape.elements == 1:
            raise ValueError("expected at least two elements for a path that closes, found one")
        elements, order, n = shape.shape, system.order, system.n
        make = _numbering if elements.offsets[-1] * order * n <= KEPT_NODES else Numbering
        self.numbering = make(elements, order, n, start, end, closed, inner)
        vars(self).update(vars(self.numbering))
        m = system.m
        places = system.order * m  # of multipliers, which live where the coordinates do
        self.rows, self.row_number = 0, np.full((self.node_count, places), -1, dtype=np.intp)
        self.row_nodes = self.row_select = self.row_node = self.row_constraint = _NONE
        self.G_rows = self.G_cols = _NONE
        if m:
            self._number_rows(in_force)
        self._bordered: dict[int, BorderedLayout] = {}

    def with_border(self, border: int) -> BorderedLayout:
        """Return that of such a matrix with so many unknowns and equations beside it."""
        if border not in self._bordered:
            self._bordered[border] = BorderedLayout(self, border)
        return self._bordered[border]

    def release(self) -> None:
        """Leave what refers back to this: else its memory waits for a search for circles."""
        self._bordered.clear()

    def _number_rows(self, in_force: NDArray[np.bool_] | None) -> None:
        """Give the constraint rows their numbers, node by node."""
        self.G_rows, self.G_cols = self.system.pointwise("constraint_jacobian").sparsity(0)
        m, n = self.system.m, self.system.n
        keep = np.zeros(self.row_number.shape, dtype=bool)
        for k in range(self.system.order):
            for i, a in zip(self.G_rows, self.G_cols, strict=True):
                keep[:, k * m + i] |= self.number[:, k * n + a] >= 0
        keep[-1] &= not self.closed
        if in_force is not None:
            keep &= in_force
        self.row_nodes = np.flatnonzero(keep.any(axis=1))
        self.row_select = np.flatnonzero(keep[self.row_nodes].ravel())
        self.rows = self.row_select.size
        self.row_node, self.row_constraint = np.nonzero(keep)
        self.row_number[keep] = np.arange(self.rows)

    @cached_property
    def probe(self) -> Array:
        """A variation (size,) to begin inverse iteration with: smooth, and of no symmetry.

        It has a part in every low mode, so also in the turn about the line between the ends, which
        is normal to the side to which first paths are curved.
        """
        node, place = np.divmod(self.free, self.width)
        found = np.zeros(self.size)
        s = node / self.node_count
        found[: self.unknowns] = np.sin(1.0 + place) * np.exp(2 * s) * (place < self.system.n)
        return found

    @cached_property
    def storage(self) -> Literal["blocks", "sparse"]:
        """How the KKT matrix is stored: many coordinates make blocks large and mostly zeros.

        Closed paths without a clock and forces have a border, which would fill sparse factors.
        """
        if self.system.order > 1:
            return "blocks"
        inner = (self.system.n + self.system.m) * (max(g.rule.degree for g in self.groups) - 1)
        if inner > BLOCK_SIZE and self.system.fill_ratio <= FILLED:
            return "sparse"
        structure = self.system.structure
        bordered = not (self.partial or structure.depends_on_time or structure.forced)
        slim = self.system.n + self.system.m <= SLIM
        return "sparse" if slim and (self.closed or self.partial) and not bordered else "blocks"

    @cached_property
    def blocks(self) -> Blocks:
        """The places of everything in a matrix stored in blocks."""
        n = self.width
        f = n + self.row_number.shape[1]
        large = is_large(max(g.nodes.shape[1] for g in self.groups), f)
        if not (large or self.system.m or self.system.structure.forced):
            return self.numbering.plain_blocks
        node, coordinate = np.divmod(self.free, n)
        rows = self.row_node * f + n + self.row_constraint
        places = np.concatenate([node * f + coordinate, rows])
        symmetric = not self.system.structure.forced
        parts = self.groups, self.offsets, self.node_of, places, self.closed
        across = self._across(f) if large and not self.closed and self.system.order == 1 else None
        return Blocks(n, f - n, *parts, symmetric=symmetric, across=across)

    def _across(self, f: int) -> NDInt | None:
        """Return rows and columns of what couples nodes of an element, (2, P); None if many do."""
        given = [("second", 2), ("second", 1)]
        if self.system.structure.forced:
            given.append(("force_jacobian", 1))
        pairs = [self.system.pointwise(name).sparsity(output) for name, output in given]
        both = [pair for row, col in pairs for pair in ((row, col), (col, row))]
        known = np.unique(np.concatenate([row * f + col for row, col in both]))
        return np.stack(np.divmod(known, f)) if known.size < FEW_ACROSS * f * f else None

    def add(self, nonzeros: Array, places: NDInt, matrix: Array) -> None:
        """Add a matrix (k, k) to the nonzeros of K for unknowns of one of the `nodal` nodes."""
        if self.storage == "blocks":
            self.blocks.add(nonzeros, places, matrix)
        else:
            pattern = self.kkt
            key = pattern.col * self.size + pattern.row  # in order
            nonzeros[np.searchsorted(key, places * self.size + places[:, None])] += matrix

    @cached_property
    def hessian(self) -> Pattern:
        """Upper triangle of the Hessian of S + sum w lam f in the unknowns."""
        targets = []
        if self.nodal:
            row, col = np.triu_indices(self.system.n)
            targets += [(self.number[k][row], self.number[k][col]) for k in self.nodal]
        targets += [
            self._diagonal("second", 0),
            self._mixed_targets("second"),
            self._stiff("second", 2),
        ]
        if self.system.m and not self.system.structure.affine_constraint:
            rows, cols = self.system.pointwise("constraint_curvature").sparsity(0)
            at = self.number[self.row_nodes]
            targets.append(_pairs(at[:, rows], at[:, cols]))
        row, col = (np.concatenate(side) for side in zip(*targets, strict=True))
        upper = np.minimum(row, col), np.maximum(row, col)
        return Pattern.build(self.unknowns, self.unknowns, [upper])

    @cached_property
    def masses(self) -> Pattern:
        """Upper triangle of sum_k w_k L_vv, which couples coordinates of one node only."""
        return Pattern.build(self.unknowns, self.unknowns, [self._diagonal("second", 2)])

    @cached_property
    def jacobian(self) -> Pattern:
        """Constraint rows against the unknowns."""
        if self.system.order > 1:
            return Pattern.build(self.rows, self.unknowns, self._pairs_in_elements())
        at_row = self.row_number[self.row_nodes][:, self.G_rows]
        at_col = self.number[self.row_nodes][:, self.G_cols]
        return Pattern.build(self.rows, self.unknowns, [_pairs(at_row, at_col)])

    @cached_property
    def forcing(self) -> Pattern:
        """Derivative of the virtual work of the non-conservative forces."""
        targets = [self._diagonal("force_jacobian", 0), self._mixed_targets("force_jacobian")]
        return Pattern.build(self.unknowns, self.unknowns, targets)

    @cached_property
    def kkt(self) -> Pattern:
        """The square system [H + F, G'; G, 0], scattered from the nonzeros of its parts."""
        if self.storage == "blocks":
            return Pattern.build(self.size, self.size, [self.blocks.targets])
        H = self.hessian
        off = H.row != H.col
        ids = np.arange(H.nnz)
        rows, cols, source = [H.row, H.col[off]], [H.col, H.row[off]], [ids, ids[off]]
        first = H.nnz
        if self.rows:
            J = self.jacobian
            ids = first + np.arange(J.nnz)
            rows += [J.row + self.unknowns, J.col]
            cols += [J.col, J.row + self.unknowns]
            source += [ids, ids]
            first += J.nnz
            # A place on the diagonal of the rows, for factorizations that need one there.
            diagonal = self.unknowns + np.arange(self.rows)
            rows.append(diagonal)
            cols.append(diagonal)
            source.append(np.full(self.rows, -1))
        if self.system.structure.forced:
            F = self.forcing
            rows.append(F.row)
            cols.append(F.col)
            source.append(first + np.arange(F.nnz))
        # -1 is the zero behind the last nonzero.
        shape, self.kkt_source = (self.size, self.size), np.concatenate(source)
        row, col = np.concatenate(rows), np.concatenate(cols)
        if self.system.structure.forced:
            return Pattern.build(*shape, [(row, col)])
        order = np.argsort(col * self.size + row)  # no two contributions meet
        self.kkt_source = self.kkt_source[order]
        return Pattern(shape, row[order], col[order], _NONE)

    def _diagonal(self, function: str, output: int):
        """Targets of w_k A_k: both at node k, order (evaluation, nonzero)."""
        rows, cols = self.system.pointwise(function).sparsity(output)
        at = self.number[self.node_of]
        return _pairs(at[:, rows], at[:, cols])

    def _pairs_in_elements(self) -> list[tuple[NDInt, NDInt]]:
        """Return rows and unknowns of each element's, order (element, row, unknown, nonzero)."""
        m, n, found = self.system.m, self.system.n, []
        for g, el in zip(self.groups, self.shapes, strict=True):
            node, k = g.nodes[:, el.node][:, :, None], el.derivative[:, None]
            rows = self.row_number[node, k * m + self.G_rows]
            cols = self.number[node, k * n + self.G_cols]
            found.append(_pairs(rows[:, :, None], cols[:, None]))
        return found

    def _mixed_targets(self, function: str):
        """Targets of w_j D_jl B_j: row at node j, column at node l, order (E, j, l, nonzero)."""
        rows, cols = self.system.pointwise(function).sparsity(1)
        parts = []
        for g in self.groups:
            at = self.number[g.nodes]
            parts.append(_pairs(at[:, :, None, rows], at[:, None, :, cols]))
        return tuple(np.concatenate(side) for side in zip(*parts, strict=True))

    def _stiff(self, function: str, output: int):
        """Targets of D_kj C_k D_kl; for a diagonal entry of C the pair (j, l) only counts once."""
        rows, cols = self.system.pointwise(function).sparsity(output)
        parts = []
        for g in self.groups:
            at = self.number[g.nodes]
            row = at[:, :, None, rows]
            col = at[:, None, :, cols]
            local = np.arange(g.rule.degree + 1)
            twice = (local[:, None] > local)[None, :, :, None] & (rows == cols)
            parts.append(_pairs(np.where(twice, -1, row), col))
        return tuple(np.concatenate(side) for side in zip(*parts, strict=True))


class BorderedLayout(MatrixLayout):
    """The layout of [K B; C D]: a KKT matrix with a border of b unknowns and equations.

    The nonzeros are those of K, and B (size, b), C (b, size) and D (b, b), one after the other.
    """

    def __init__(self, inner: Layout, border: int) -> None:
        super().__init__()
        self.inner, self.border, self.closed = inner, border, inner.closed
        self.system, self.storage, self.blocks = inner.system, inner.storage, inner.blocks
        self.unknowns, self.rows = inner.unknowns, inner.rows
        self.probe = np.concatenate([inner.probe, np.zeros(border)])

    def join(self, K: Array, B: Array, C: Array, D: Array) -> Array:
        """Return the nonzeros of the whole from those of K, and B, C and D."""
        return np.concatenate([K, B.ravel(), C.ravel(), D.ravel()])

    def split(self, nonzeros: Array) -> tuple[Array, Array, Array, Array]:
        """Return the nonzeros of K, and B, C and D, as views."""
        size, b = self.inner.size, self.border
        last = nonzeros.size - b * b
        B, C = nonzeros[last - 2 * size * b : last].reshape(2, -1)
        K, D = nonzeros[: last - 2 * size * b], nonzeros[last:]
        return K, B.reshape(size, b), C.reshape(b, size), D.reshape(b, b)


def border_matrix(
    layout: Layout | BorderedLayout, nonzeros: Array, B: Array, C: Array, D: Array
) -> tuple[BorderedLayout, Array]:
    """Return the layout and the nonzeros of [K B; C D]; K may have a border of its own."""
    if isinstance(layout, BorderedLayout):
        nonzeros, right, below, corner = layout.split(nonzeros)
        cut, layout = len(right), layout.inner
        D = np.block([[corner, B[cut:]], [C[:, cut:], D]])
        B, C = np.hstack([right, B[:cut]]), np.vstack([below, C[:, :cut]])
    whole = layout.with_border(len(D))
    return whole, whole.join(nonzeros, B, C, D)


class _Solvers(threading.local):
    def __init__(self) -> None:
        self.kinds: dict[Any, Any] = {}

    def __reduce__(self) -> tuple:
        """Leave what is compiled behind: it is made again."""
        return _Solvers, ()


# Unknowns and rows within an element up to which its block is worth its zeros; above, the share of
# its work that sparse factors do as well, at a fifth of the speed of blocks. Measured on chains of
# 1 to 10 links and lattices of 4 to 32 masses, 16 elements of degree 6: sparse factors take twice
# the time of blocks the first time and a third later, up to this size; beyond, half and a fifth.
BLOCK_SIZE, FILLED = 60, 0.2
# Share of the places of a node that couple it to others, below which they alone are kept; ad hoc.
FEW_ACROSS = 0.1
# Unknowns and rows up to which one full matrix takes less time than blocks, of a path held by an
# obstacle. Measured, factors, six solutions and signs: of 128 .4 ms against 1.7, of 172 .5 against
# 1.6.
HELD_SIZE = 200
# Coordinates and constraints up to which sparse factors take less time than blocks, if there are to
# be many, or rows that are not in force, or the path closes. Measured: a driven oscillator of two
# and contact in two coordinates take 12 % more in blocks, of five as much, of twelve 0.4 to 0.9.
SLIM = 3
# Unknowns and rows above which sparse factors are kept. Measured from 5000 to 70,000: they cost two
# to three factorizations, a solution a twentieth of one.
KEPT_SIZE = 2000
_NONE = np.zeros(0, dtype=np.intp)


def _pairs(rows: NDInt, cols: NDInt) -> tuple[NDInt, NDInt]:
    """Return rows and columns, broadcast to one shape and flattened."""
    rows, cols = np.broadcast_arrays(rows, cols)
    return rows.ravel(), cols.ravel()


@immutable
class Pattern:
    """A sparse matrix in compressed columns, and where each contribution to it goes.

    Contributions to pinned coordinates go to one slot past the end and are dropped.
    """

    shape: tuple[int, int]
    # row, col (nnz,)
    row: NDInt
    col: NDInt
    slots: NDInt  # (contributions,)

    @classmethod
    def build(cls, rows: int, cols: int, targets) -> Pattern:
        """Return the pattern of a sum of contributions at `targets`, pairs of index arrays.

        What has a negative index is left out: its slot is one beyond the last nonzero.
        """
        row = np.concatenate([t[0] for t in targets])
        col = np.concatenate([t[1] for t in targets])
        kept = np.flatnonzero((row >= 0) & (col >= 0))  # the others need not be sorted
        unique, places = np.unique(col[kept] * rows + row[kept], return_inverse=True)
        slots = np.full(row.size, unique.size)
        slots[kept] = places
        return cls((rows, cols), unique % rows, unique // rows, slots)

    @property
    def nnz(self) -> int:
        """Number of structural nonzeros."""
        return self.row.size

    def sum(self, contributions: Array) -> Array:
        """Return the nonzeros (nnz,), contributions to one entry added up."""
        return np.bincount(self.slots, contributions, self.nnz + 1)[: self.nnz]

    @cached_property
    def sparsity(self) -> ca.Sparsity:
        """The pattern for CasADi."""
        colind = np.searchsorted(self.col, np.arange(self.shape[1] + 1))
        # As buffers: lists of numbers take five times the memory.
        return ca.Sparsity(*self.shape, memoryview(colind), memoryview(self.row))  # type: ignore


LAYOUTS_KEPT = 32  # of a system, the latest used: a large one holds much memory; ad hoc


def layout_for(problem: Problem, mesh: Mesh, nodal: tuple[int, ...] = ()) -> Layout:
    """Return the layout shared by all problems of this system, mesh shape and kind of ends.

    And of `nodal` nodes.
    """
    known, order = problem.system.layouts, problem.system.order
    ends = problem.start.pinned_places(order), problem.end.pinned_places(order)
    closed, partial = problem.closed_places, problem.in_force(mesh.boundaries, mesh.offsets)
    key = (
        mesh.degrees,
        mesh.singular_ends,
        *ends,
        closed,
        nodal,
        None if partial is None else partial.tobytes(),
    )
    inner: tuple[tuple[int, tuple[int, ...]], ...] = ()
    if problem.through:
        at = find_boundaries(mesh, np.array([e.t for e in problem.through])).tolist()
        pinned = [e.pinned_places(order) for e in problem.through]
        inner = tuple(zip(at, pinned, strict=True))
        key = (*key, inner)
    with problem.system.lock:
        parts = *ends, closed, nodal, partial, inner
        layout = known.pop(key, None) or Layout(problem.system, mesh, *parts)
        known[key] = layout
        while len(known) > LAYOUTS_KEPT:
            del known[next(iter(known))]
    return layout


def forget(layout: Layout) -> None:
    """Keep a layout no longer for other problems of its system."""
    with layout.system.lock:
        known = layout.system.layouts
        for key in [key for key, other in known.items() if other is layout]:
            del known[key]
    layout.release()
