"""Solve linear systems with the KKT matrix, and count its negative eigenvalues.

Small matrices are made full, those of a few coordinates condensed block by block. The others are
sparse, and factorized as L D L' without pivoting, ten times faster than with it; a tiny negative
diagonal on the constraint rows makes that possible. The error of that is taken away by iterative
refinement, whose residual also shows when factors fail: then a sparse QR factorization serves
instead. A border of a few unknowns is eliminated last, however the matrix is stored.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any

import casadi as ca
import numpy as np

from actionopt.discrete.matrices.blocks import Condensed
from actionopt.discrete.matrices.layout import (
    SLIM,
    BorderedLayout,
    Layout,
    MatrixLayout,
    Pattern,
    border_matrix,
)
from actionopt.discrete.matrices.matrices import Matrices, read
from actionopt.tools.blas import cholesky, count_negative, lu
from actionopt.tools.cached import cached_property
from actionopt.tools.memory import give_back
from actionopt.tools.types import Array, NDInt
from actionopt.tools.watch import check_time

# Ad hoc, where nothing else is said: a third of each or three times as much (but `REFINEMENTS`)
# changes no iteration on any scene.
# Unknowns and rows from which they take less than a full matrix, if there are to be many. Measured
# on one and two coordinates, factors and three solutions: of 47 unknowns 97 us against 57, of 79 88
# against 94, of 95 94 against 122.
SPARSE = 80
PATTERN = 2000  # unknowns and rows up to which finding their pattern takes little memory
# Nonzeros of L in a row up to which factorizing again, for several right-hand sides at once, takes
# less than handing L over as an object. Measured: at 16 five take 1.4 and 2.3 ms, at 35 20 and 8.
COLUMN_FACTORS = 24
# Columns for which what is inside an element is solved at once, if there are as many. Measured, on
# 960 and 1560 unknowns: of 16 one takes .11 and .14 ms, of 4 thrice as long, of 64 .09 and .12.
INSIDE_AT_ONCE = 16
LARGE_SIZE = 50_000  # unknowns and rows whose factors take a second or so; ad hoc
REGULAR = 1e-10  # on the rows' diagonal, whose gradients are of size one
# Size below which a row is scaled. Measured: counts are right where all are 1e-3, wrong from 1e-6.
SMALL_ROW = 1e-3
# Seconds of a step with factors that are kept, over this power of the matrix' nonzeros. Measured on
# chains of 40 and 100 links: factors take 3.35e-9 of it to 40 %, from 25 thousand nonzeros, .011 s,
# to 1.6 million, 2.4 s; what goes on with them until the next ones as much to half as much again.
STEP_SECONDS, STEP_POWER = 5e-9, 1.43
# Seconds of all eigenvalues of a full matrix, over the cube of its size. Measured.
EIGENVALUE_SECONDS = 1.3e-10
# Growth of pivots from where on signs are those of the full matrix: an element as long as the time
# between conjugate points is singular inside. Derived: round-off of 1e-12, where mu is 1e-8.
# Measured: of 187 matrices in blocks all that grow by 6e3 at most have the right signs, 11 of 20
# that grow by 2e6 and more have not, and none is between.
PIVOT_GROWTH = 1e4
# Steps of iteration for the largest eigenvalue of what tells a matrix from one near it. Ad hoc.
NEAR_STEPS = 3
REFINEMENTS = 6  # each leaves half of the residual at most
ACCURATE = 1e-10  # residual relative to |b| that is enough: Newton's method corrects the rest
USEFUL = 1e-8  # residual above which the factors are given up
RESIDUAL_FLOOR = 1e-13  # residual relative to |K| |x| that no refinement removes


class Factors:
    """A KKT matrix of one layout, ready to solve with; `solve` may be called many times.

    Parameters
    ----------
    layout : MatrixLayout
    nonzeros : array
        As `Transcription.kkt` returns them.
    many : bool
        Whether many factorizations on this layout are to come: then finding the sparsity of very
        few coordinates' blocks pays.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the matrix is singular or not finite; `solve` may raise it too.
    """

    def __init__(self, layout: MatrixLayout, nonzeros: Array, *, many: bool = False) -> None:
        if not np.logical_and.reduce(np.isfinite(nonzeros)):
            raise np.linalg.LinAlgError("the matrix is not finite")
        if isinstance(layout, BorderedLayout) and not layout.border:
            layout = layout.inner
        self.layout, self.nonzeros = layout, nonzeros
        self._many = many
        self._accurate = False  # whether a solution was accurate before it was refined
        self._definite: Callable[[Array], Array] | None = None  # what solves, if that was asked
        self._near: Callable[[Array], Array] | None = None  # what solves with a matrix near this
        self._beside: Factors | None = None  # those of that matrix
        self.within: Factors | None = None  # those of the matrix beside which there is a border
        if layout.small and not many:  # nothing is quicker
            self._direct = None
        # Where they are, the matrix is scaled, and this keeps by what its rows and columns are.
        self._even = _equilibrate(layout, nonzeros, many) if layout.may_be_uneven else None

    def near(self, nonzeros: Array) -> Factors:
        """Return factors for a matrix near this one: its solutions are refined from this one's.

        Where that does not converge, the other matrix is factorized.
        """
        other = Factors(self.layout, nonzeros, many=self._many)
        if not (self.layout.small or self._even):
            other._near, other._beside = self._direct, self
        return other

    def with_border(self, B: Array, C: Array, D: Array) -> Factors:
        """Return factors of [K B; C D], with one column, row and number beside this matrix.

        Solutions are refined from those of K alone. Where K is too near a singular matrix for
        that, the whole one is factorized.
        """
        layout = self.layout
        assert isinstance(layout, (Layout, BorderedLayout))
        whole = Factors(*border_matrix(layout, self.nonzeros, B, C, D), many=self._many)
        whole.within = self
        known = self._near or layout.small or self._direct
        if known is not None and not (layout.small or layout.border or self._even):
            whole._near = _Eliminated(self, B[:, 0], C[0], float(D[0, 0])).solve
        return whole

    def direct(self, *right: Array) -> list[Array]:
        """Return solutions but for errors for one right-hand side or two, where any are quick."""
        if self._near is not None:
            return [self._near(x) for x in right]
        assert self._direct is not None
        layout = self.layout
        together = not layout.keeps_factors and (self._pays or layout.storage == "sparse")
        if len(right) > 1 and together:
            return list(_solver(layout, "ldl", len(right))(self._regular, np.stack(right)))
        return [self._direct(x) for x in right]

    @cached_property
    def _direct(self) -> Callable[[Array], Array] | None:
        """A function that solves but for errors; None if nothing does so quickly."""
        layout, pays = self.layout, self._pays
        if layout.small and not pays:
            return None
        if layout.uses_condensation and not pays:
            with suppress(np.linalg.LinAlgError):  # a block may be singular where all are not
                return self._condensed_blocks.solve
        elif layout.needs_no_pivoting:
            if layout.keeps_factors:
                return self._kept_solver.solve
            return partial(_solver(layout, "ldl"), self._regular)
        elif isinstance(layout, BorderedLayout):
            with suppress(np.linalg.LinAlgError):
                return self._edge_factors.solve
        return None

    @property
    def _pays(self) -> bool:
        """Whether sparse factors take less time than blocks or a full matrix."""
        layout, system = self.layout, self.layout.system
        slim = system.n + system.m <= SLIM and SPARSE <= layout.size <= PATTERN
        return self._many and slim and layout.needs_no_pivoting

    @cached_property
    def _regular(self) -> Array:
        return _regular(self.layout, kkt_nonzeros(self.layout, self.nonzeros))

    @cached_property
    def _kept_solver(self) -> SparseFactors:
        return SparseFactors(self.layout, self.nonzeros)

    @cached_property
    def _edge_factors(self) -> _Edged:
        assert isinstance(self.layout, BorderedLayout)
        return _Edged(self.layout, self.nonzeros)

    @cached_property
    def _condensed_blocks(self) -> Condensed:
        layout = self.layout
        if isinstance(layout, BorderedLayout):
            K, *border = layout.split(self.nonzeros)
            return Condensed(layout.blocks, K, (border[0], border[1], border[2]))
        return Condensed(layout.blocks, self.nonzeros)

    @cached_property
    def _full(self) -> Array:
        return full(self.layout, self.nonzeros)

    @cached_property
    def _full_factors(self) -> Callable[[Array], Array]:
        return lu(self._full)

    @property
    def cheap(self) -> bool:
        """Whether another solution costs far less than another factorization."""
        # Beside a border it is the derivatives by what is there that cost.
        layout = self.layout
        return layout.border > 0 or layout.keeps_factors or layout.storage == "blocks"

    def solve(self, right: Array, enough: float = ACCURATE) -> Array:
        """Return the solution for one right-hand side, (size,).

        Its residual is `enough` where it has to be refined, relative to the right-hand side.
        """
        if self._even is not None:
            factors, scale = self._even
            return scale * factors.solve(scale * right, enough)
        if self._definite is not None:
            return self._definite(right)
        if self._near is not None:
            x = self._refine(self._near, right, enough)
            if x is not None:
                return x
            self._near, self._accurate = None, False
        if self._direct is not None:
            x = self._direct(right) if self._accurate else self._refine(self._direct, right, enough)
            if x is not None:
                return x
            self._direct = None
        if self.layout.small:
            return self._full_factors(right)
        if self.layout.border:  # which would fill sparse factors
            if self.layout.size > PATTERN:
                raise np.linalg.LinAlgError("the matrix is singular")
            return np.linalg.solve(full(self.layout, self.nonzeros), right)
        x = _solver(self.layout, "qr")(kkt_nonzeros(self.layout, self.nonzeros), right)
        if not np.all(np.isfinite(x)):
            raise np.linalg.LinAlgError("the matrix is singular")
        return x

    @property
    def pairs(self) -> bool:
        """Whether two right-hand sides take hardly more than one."""
        return self._accurate if self._pays else self.layout.small

    def solve_many(self, right: Array) -> Array:
        """Return the solutions for right-hand sides (size, K), all at once where that is quick."""
        if self._even is None and self._definite is not None:
            return self._definite(right)
        layout = self.layout
        direct = self._even is self._near is None and self._direct
        if direct and layout.storage == "sparse" and not (layout.keeps_factors or layout.border):
            solver, regular = _solver(layout, "ldl", right.shape[1]), self._regular
            scale = np.maximum.reduce(np.abs(right))  # each is to be as accurate as one alone
            scale[scale == 0] = 1.0
            x = self._refine(lambda miss: solver(regular, miss.T).T, right / scale)
            if x is not None:
                return x * scale
        found = [self.solve(right[:, 0])]
        direct = self._even is self._near is None and self._accurate and self._direct
        if direct and self.layout.uses_condensation and not self._pays and right.shape[1] > 1:
            return np.concatenate([found[0][:, None], direct(right[:, 1:])], axis=1)
        direct = self._even, self._definite, self._near, self._direct
        if all(way is None for way in direct) and (self.layout.small or self.layout.border):
            return self._full_factors(right)
        found += [self.solve(column) for column in right.T[1:]]
        return np.stack(found, axis=1)

    def solve_both(self, one: Array, other: Array) -> tuple[Array, Array]:
        """Return the solutions for two right-hand sides, which may be factorized for once."""
        if self._pays and self._even is None:
            x, y = _solver(self.layout, "ldl", 2)(self._regular, np.stack([one, other]))
            if not self._accurate:
                miss = np.abs(one - product(self.layout, self.nonzeros, x)).max()
                self._accurate = bool(miss <= ACCURATE * np.abs(one).max())
            if self._accurate:
                return x, y
        elif self.pairs and self._even is None:
            one, other = self._full_factors(np.array([one, other]).T).T
            return one, other
        return self.solve(one), self.solve(other)

    def definite(self) -> bool:
        """Return whether the matrix, one without constraint rows, is positive definite."""
        if self.layout.storage == "sparse":
            return self._pivots.negative() == 0
        try:
            if not self.layout.small:
                self._condensed_blocks = Condensed(self.layout.blocks, self.nonzeros, definite=True)
                return True
            self._definite = cholesky(self._full)
        except np.linalg.LinAlgError:
            return False
        return True

    def negative(self) -> int:
        """Return the number of negative eigenvalues of a symmetric matrix (its inertia)."""
        return self._negative

    @cached_property
    def _negative(self) -> int:
        layout = self.layout
        if self._even is not None:
            return self._even[0].negative()
        scale = _row_scale(layout, self.nonzeros) if layout.rows else None
        if scale is not None:  # D K D has the inertia of K (Sylvester)
            return Factors(layout, _rescale(layout, self.nonzeros, scale)).negative()
        if layout.small and not layout.rows:
            if not isinstance(layout, BorderedLayout):
                return 0 if self.definite() else negative_signs(self._full)
            K, B, C, D = layout.split(self.nonzeros)
            inner = Factors(layout.inner, K)
            if inner.definite():  # the others are those of Schur's complement (Haynsworth)
                return negative_signs(D - C @ inner.solve_many(B))
        if layout.small:
            return negative_signs(self._full)
        if layout.size > PATTERN:
            return self._pivots.negative()
        counted = self._pivots
        if not counted.largest <= PIVOT_GROWTH * np.abs(self.nonzeros).max():
            return negative_signs(self._full)
        return counted.negative()

    def negative_pivots(self) -> int:
        """Return the number of negative pivots, however they are rounded."""
        if self._beside is not None and self._has_signs_of(self._beside):
            return self._beside.negative_pivots()
        if self.layout.small:
            return self.negative()
        sparse = self.layout.storage == "sparse" and self.layout.needs_no_pivoting
        if self._pays or (sparse and "_kept_solver" not in vars(self)):
            return negative_pivots(self.layout, self._regular)
        return self._pivots.negative()

    def _has_signs_of(self, beside: Factors) -> bool:
        """Whether this matrix K has as many negative eigenvalues as one K' near it.

        They have if none of K' + t (K - K') is singular, 0 <= t <= 1, as where the eigenvalues of
        1 - inv(K') K are less than one. The largest is found by iteration.
        """
        layout = self.layout
        try:
            x = beside.direct(layout.probe)[0]
            for _ in range(NEAR_STEPS):
                last = x
                x = x - beside.direct(product(layout, self.nonzeros, x))[0]
        except np.linalg.LinAlgError:
            return False
        return bool(np.linalg.norm(x) < np.linalg.norm(last) / 2)

    @property
    def _pivots(self) -> Condensed | _Edged | SparseFactors:
        """What eliminates the unknowns one after the other, and keeps by what it divided."""
        if self.layout.storage == "blocks":
            return self._condensed_blocks
        if isinstance(self.layout, BorderedLayout):
            return self._edge_factors
        return self._kept_solver

    def _refine(
        self, direct: Callable[[Array], Array], right: Array, enough: float = ACCURATE
    ) -> Array | None:
        """Return the solution by refinement of a direct one, or None if that does not converge."""
        x, miss, last = right, right, np.inf
        size = float(np.maximum.reduce(np.abs(right), axis=None))
        for _ in range(REFINEMENTS):
            nearer = direct(miss) if last == np.inf else x + direct(miss)
            miss = right - product(self.layout, self.nonzeros, nearer)
            left = float(np.maximum.reduce(np.abs(miss), axis=None))
            if not left < last / 2:  # no better than before, or not a number
                break
            self._accurate = left <= ACCURATE * size and last == np.inf
            x, last = nearer, left
            if left <= enough * size:
                return x
        if last == np.inf:
            return None
        norm = float(np.max(np.abs(self.nonzeros))) * float(np.max(np.abs(x)))
        return x if last <= USEFUL * size + RESIDUAL_FLOOR * norm else None


def _equilibrate(layout: MatrixLayout, nonzeros: Array, many: bool) -> tuple[Factors, Array] | None:
    """Return factors of the matrix with rows and columns scaled to one size, and by what, (size,).

    None where they are of one size.
    """
    K = layout.split(nonzeros)[0] if isinstance(layout, BorderedLayout) else nonzeros
    scale = layout.blocks.scale(K) if layout.closed else layout.blocks.grade(K)
    if scale is None:
        return None
    whole = np.concatenate([scale, np.ones(layout.border)])
    return Factors(layout, _rescale(layout, nonzeros, whole), many=many), whole


def _row_scale(layout: MatrixLayout, nonzeros: Array) -> Array | None:
    """Return factors (size,) that bring the constraints' rows to size one, powers of two.

    None where none is small: pivots of rows beside which others are large are round-off.
    """
    scale, rows = np.ones(layout.size), slice(layout.unknowns, layout.unknowns + layout.rows)
    size = product(layout, np.abs(nonzeros), scale)[rows]
    if size.min() >= SMALL_ROW:
        return None
    scale[rows] = 2 ** -np.round(np.log2(np.where(size > 0, size, 1.0)))
    return scale if (scale != 1).any() else None


def _rescale(layout: MatrixLayout, nonzeros: Array, scale: Array) -> Array:
    """Return the nonzeros of the matrix with rows and columns times factors (size,)."""
    if isinstance(layout, BorderedLayout):
        K, B, C, D = layout.split(nonzeros)
        inner, beside = scale[: len(B)], scale[len(B) :]
        K = _rescale(layout.inner, K, inner)
        edges = inner[:, None] * B * beside, beside[:, None] * C * inner
        return layout.join(K, *edges, beside[:, None] * D * beside)
    if layout.storage == "blocks":
        return layout.blocks.rescale(nonzeros, scale)
    pattern = layout.kkt
    return nonzeros * scale[pattern.row] * scale[pattern.col]


def product(layout: MatrixLayout, nonzeros: Array, z: Array) -> Array:
    """Return the matrix with these nonzeros times z, (size,) or (size, c)."""
    if z.ndim > 1:
        return np.array([product(layout, nonzeros, column) for column in z.T]).T
    if isinstance(layout, BorderedLayout):
        K, B, C, D = layout.split(nonzeros)
        x, beside = z[: len(B)], z[len(B) :]
        return np.concatenate([product(layout.inner, K, x) + B @ beside, C @ x + D @ beside])
    if layout.storage == "blocks":
        return layout.blocks.product(nonzeros, z)
    pattern = layout.kkt
    return np.bincount(pattern.row, nonzeros * z[pattern.col], z.size)


def diagonal(layout: MatrixLayout, values: Array) -> Array:
    """Return the nonzeros of the matrix that has `values` (size,) on its diagonal."""
    if isinstance(layout, BorderedLayout):
        size = layout.inner.size
        edge = np.zeros((size, layout.border))
        own = diagonal(layout.inner, values[:size])
        return layout.join(own, edge, edge.T, np.diag(values[size:]))
    if layout.storage == "blocks":
        return layout.blocks.diagonal(values)
    pattern = layout.kkt
    return np.where(pattern.row == pattern.col, values[pattern.row], 0.0)


def kkt_nonzeros(layout: MatrixLayout, nonzeros: Array) -> Array:
    """Return the nonzeros (nnz,) on the pattern `layout.kkt`."""
    return layout.kkt.sum(nonzeros) if layout.storage == "blocks" else nonzeros


def full(layout: MatrixLayout, nonzeros: Array) -> Array:
    """Return the full matrix, (size, size)."""
    if isinstance(layout, BorderedLayout):
        size, matrix = layout.inner.size, np.empty((layout.size, layout.size))
        K, matrix[:size, size:], matrix[size:, :size], matrix[size:, size:] = layout.split(nonzeros)
        matrix[:size, :size] = full(layout.inner, K)
        return matrix
    if layout.storage == "blocks":
        return layout.blocks.full(nonzeros)
    matrix = np.zeros((layout.size, layout.size))
    matrix[layout.kkt.row, layout.kkt.col] = nonzeros
    return matrix


class Sparse:
    """A sparse direct solver of CasADi's for one sparsity, fed and read in place.

    CasADi's linear solvers factorize anew for every call; that costs less than handing matrices
    over as objects, by an order of magnitude where they are small. `count` right-hand sides are
    solved for at once. One that is `alike` but for their number has analysed the pattern.
    """

    def __init__(
        self, pattern: Pattern, kind: str, count: int = 1, alike: Sparse | None = None
    ) -> None:
        self._pattern, self._kind, self._count = pattern, kind, count
        self.analysed = alike.analysed if alike else ca.Linsol(kind, kind, pattern.sparsity)
        self._values = alike._values if alike else np.empty(pattern.nnz)

    @cached_property
    def _own(self) -> tuple[Any, Any, Array | None, ca.Function]:
        """The memory of CasADi's function, what evaluates it there, and one right-hand side's.

        With place for its solution. More of them are handed over where they are.
        """
        pattern, size, one = self._pattern, self._pattern.shape[0], None
        values, right = ca.MX.sym("values", pattern.nnz), ca.MX.sym("right", size, self._count)
        solved = self.analysed.solve(ca.MX(pattern.sparsity, values), right)
        function = ca.Function(self._kind, [values, right], [solved])
        buffer, trigger = function.buffer()
        buffer.set_arg(0, memoryview(self._values))  # type: ignore
        if self._count == 1:
            one = np.empty((2, size))
            buffer.set_arg(1, memoryview(one[0]))  # type: ignore
            buffer.set_res(0, memoryview(one[1]))  # type: ignore
        return buffer, trigger, one, function

    def __call__(self, nonzeros: Array, right: Array) -> Array:
        """Return the solution, (size,) or (count, size), of as many right-hand sides.

        Raise numpy.linalg.LinAlgError if the matrix is singular.
        """
        buffer, trigger, one, _ = self._own
        self._values[:] = nonzeros
        if one is not None:
            given, solved = one
            given[:] = right
        else:
            given, solved = np.ascontiguousarray(right), np.empty(right.shape)
            buffer.set_arg(1, memoryview(given))
            buffer.set_res(0, memoryview(solved))
        solved[:] = np.nan  # what a failed factorization leaves behind
        try:
            trigger()
        except RuntimeError as error:
            raise np.linalg.LinAlgError("the matrix is singular") from error
        return solved if one is None else solved.copy()


class SparseFactors:
    """The factors of a sparse matrix, kept where they cost what many solutions do.

    CasADi does not tell its linear solvers' factors apart from their solutions; it returns those
    of L D L' as objects. Handing these over takes five times as long as factorizing again in place
    where there are no constraints.
    """

    def __init__(self, layout: MatrixLayout, nonzeros: Array) -> None:
        self._layout, self._values = layout, _regular(layout, kkt_nonzeros(layout, nonzeros))

    @cached_property
    def _order(self) -> NDInt | None:
        """The order of rows and columns in the factors; None where CasADi finds it."""
        return self._layout.solvers.get("order")

    @cached_property
    def _factors(self) -> tuple[Any, ...]:
        layout, values = self._layout, self._values
        if layout.size > LARGE_SIZE:
            give_back()  # what the pattern was made with, a sixth of the most that is taken
        if self._order is None:  # the first on this layout finds it
            factors = ca.ldl(_matrix(layout, values))
            layout.solvers["order"] = np.array(factors[2])
            return factors
        if "ordered" not in layout.solvers:
            layout.solvers["ordered"] = _reorder(layout.kkt, self._order)
        matrices, source = layout.solvers["ordered"]
        return ca.ldl(matrices.of(values[source]), False)

    def solve(self, right: Array) -> Array:
        """Return the solution for one right-hand side, (size,), or several, (size, c)."""
        layout, factors = self._layout, self._factors if self._layout.keeps_factors else None
        if right.ndim == 1 and factors is None:
            return _solver(layout, "ldl")(self._values, right)
        if factors is None or (right.ndim > 1 and factors[1].nnz() < COLUMN_FACTORS * layout.size):
            found = _solver(layout, "ldl", right.shape[1])(self._values, right.T)
            return found.T.reshape(right.shape)
        right = right if self._order is None else right[self._order]
        found = read(ca.ldl_solve(_columns(layout, right), *factors)).reshape(right.shape)
        if self._order is None:
            return found
        x = np.empty_like(found)
        x[self._order] = found
        return x

    def negative(self) -> int:
        """Return the number of negative pivots."""
        if not self._layout.keeps_factors and "_factors" not in self.__dict__:
            return negative_pivots(self._layout, self._values)
        return int(np.sum(self._factors[0].full() < 0))

    @property
    def largest(self) -> float:
        """The largest pivot; zero with rows, which are regular by pivots that grow."""
        return 0.0 if self._layout.rows else float(np.abs(self._factors[0].full()).max(initial=0.0))


def _reorder(pattern: Pattern, order: NDInt) -> tuple[Matrices, NDInt]:
    """Return matrices with rows and columns in this order, and which nonzero is each of theirs."""
    place = np.empty_like(order)
    place[order] = np.arange(order.size)
    row, col = place[pattern.row], place[pattern.col]
    source = np.argsort(col * order.size + row)
    ordered = Pattern(pattern.shape, row[source], col[source], source)
    return Matrices(ordered.sparsity), source


class _Eliminated:
    """Solutions of [K B; C D], with one column B and one row C, by those of K alone.

    Where K is nearly singular they lose digits, which refinement brings back (W. J. F. Govaerts,
    *Numerical Methods for Bifurcations of Dynamical Equilibria* (2000), chapter 3).
    """

    def __init__(self, factors: Factors, B: Array, C: Array, D: float) -> None:
        self._factors, self._column, self._row, self._corner = factors, B, C, D
        self._carried: Array | None = None  # K x = B

    def solve(self, right: Array) -> Array:
        """Return the solution for one right-hand side, (size,); NaN where K is singular."""
        inner, last = right[:-1], right[-1]
        try:
            if self._carried is None:
                x, self._carried = self._factors.direct(inner, self._column)
            else:
                x = self._factors.direct(inner)[0] if inner.any() else np.zeros_like(inner)
        except np.linalg.LinAlgError:
            return np.full(right.size, np.nan)
        beside = (last - self._row @ x) / (self._corner - self._row @ self._carried)
        return np.append(x - beside * self._carried, beside)


class _Edged:
    """The factors of a sparse matrix K with a border, [K R; C D].

    K may be singular along the directions R. With as many springs E s E' on single unknowns it is
    not, and is factorized; they are taken off again with the edges,

        K x + R y - s E z = r,    C x + D y = r',    E'x - z = 0.
    """

    def __init__(self, layout: BorderedLayout, nonzeros: Array) -> None:
        inner, (K, R, C, D) = layout.inner, layout.split(nonzeros)
        self._layout, self._size = inner, inner.size
        n = inner.size
        springs = _largest(R[: inner.unknowns])
        self._spring = size = np.abs(K).max()
        tied = np.zeros(n)
        tied[springs] = size
        self._held = K = K + diagonal(inner, tied)
        self._factors = SparseFactors(inner, K) if inner.needs_no_pivoting else None
        E, self._springs = np.zeros((n, springs.size)), springs.size
        E[springs, np.arange(springs.size)] = 1.0
        self._beside = np.concatenate([R, -size * E], axis=1)
        self._across = np.concatenate([C, E.T])
        self._corner = np.zeros((len(self._across), len(self._across)))
        self._corner[: len(D), : len(D)] = D
        self._corner[len(D) :, len(D) :] = -np.eye(springs.size)
        self._carried = np.zeros((n, 0))  # the solutions for the edges, once K is eliminated

    def _eliminate(self, *right: Array) -> Array:
        """Eliminate K, and return the solutions (size, c) of its own for c right-hand sides.

        One factorization serves for these and for the edges. Raises numpy.linalg.LinAlgError if K
        is singular.
        """
        edges = self._beside.shape[1]
        found = self._solve_inner(np.column_stack([self._beside, *right]))
        corner = self._corner - self._across @ found[:, :edges]
        if not np.isfinite(corner).all():
            raise np.linalg.LinAlgError("the matrix is singular")
        self._carried, self._corner = found[:, :edges], corner
        return found[:, edges:]

    def _solve_inner(self, right: Array) -> Array:
        """Return the solution of K with springs for one right-hand side, or several (size, c)."""
        if self._factors is not None:
            return self._factors.solve(right)
        count = right.shape[1] if right.ndim > 1 else 1
        return _solver(self._layout, "qr", count)(self._held, right.T).T

    def solve(self, right: Array) -> Array:
        """Return the solution for one right-hand side, (size,); NaN where K is singular."""
        n, edges = self._size, right.size - self._size
        try:
            known = self._carried.size
            x = self._solve_inner(right[:n]) if known else self._eliminate(right[:n])[:, 0]
        except np.linalg.LinAlgError:
            return np.full_like(right, np.nan)
        other = np.zeros(len(self._across))
        other[:edges] = right[n:]
        y = np.linalg.solve(self._corner, other - self._across @ x)
        return np.concatenate([x - self._carried @ y, y[:edges]])

    @property
    def largest(self) -> float:
        """The largest pivot of K with its springs."""
        return self._factors.largest if self._factors else 0.0

    def negative(self) -> int:
        """Return the number of negative eigenvalues of the whole, if that is symmetric.

        With w = -z and rows of springs times s it is [K R sE; R' D 0; sE' 0 s], which has those of
        the whole, and those of K and of what is left of it besides (Haynsworth).
        """
        if not self._carried.size:
            self._eliminate()
        corner, k = self._corner.copy(), self._springs
        corner[len(corner) - k :] *= self._spring
        corner[:, len(corner) - k :] *= -1.0
        inner = self._factors or Factors(self._layout, self._held)
        return inner.negative() + count_negative((corner + corner.T) / 2)


def _largest(columns: Array) -> NDInt:
    """Return rows (k,) in which the columns (n, k) are independent: the largest, one by one."""
    left, rows = columns.copy(), []
    for _ in range(columns.shape[1]):
        size = np.einsum("ij,ij->i", left, left)
        k = int(np.argmax(size))
        if not size[k] > 0:
            break
        rows.append(k)
        if len(rows) < columns.shape[1]:
            unit = left[k] / np.sqrt(size[k])
            left = left - np.outer(left @ unit, unit)
    return np.array(sorted(set(rows)), dtype=int)


def negative_signs(matrix: Array) -> int:
    """Return the number of negative eigenvalues of a full symmetric matrix.

    Raises TimeUp if the time that is given will be over before.
    """
    check_time(EIGENVALUE_SECONDS * len(matrix) ** 3)
    return count_negative(matrix)


def expected_seconds(layout: MatrixLayout) -> float:
    """Return about how many seconds a step by factors will take; zero where that is little."""
    if not layout.keeps_factors or isinstance(layout, BorderedLayout):
        return 0.0
    return STEP_SECONDS * layout.kkt.nnz**STEP_POWER


def solve_inside(layout: Layout, nonzeros: Array, right: Array) -> Array:
    """Return the solutions (size, c) with the rows and columns inside elements, others zero.

    Elements of one degree have one pattern, on every mesh, that is analysed once.
    """
    parts = layout.solvers.get("inside")
    if parts is None:
        parts = layout.solvers["inside"] = [_inside(layout, g.elements) for g in layout.groups]
    values, found = _regular(layout, kkt_nonzeros(layout, nonzeros)), np.zeros_like(right)
    solvers, few = layout.inside_solvers, min(max(right.shape[1], 2), INSIDE_AT_ONCE)
    for g, (pattern, places, entries) in zip(layout.groups, parts, strict=True):
        key = g.rule.degree, few
        if key not in solvers:
            alike = next((x for k, x in solvers.items() if k[0] == key[0]), None)
            solvers[key] = Sparse(pattern, "ldl", few, alike)
        solver = solvers[key]
        load = np.zeros((few, pattern.shape[0]))
        for at, own in zip(places, entries, strict=True):
            for first in range(0, right.shape[1], few):
                some = slice(first, min(first + few, right.shape[1]))
                count = some.stop - first
                load[:count], load[count:] = right[at, some].T, 0.0
                found[at, some] = solver(values[own], load)[:count].T
    return found


def _inside(layout: Layout, elements: NDInt) -> tuple[Pattern, NDInt, NDInt]:
    """Return the pattern inside each element of one degree, and of all the places and nonzeros.

    Arrays (E, places) and (E, nonzeros).
    """
    of_node = np.full(layout.node_count, -1)
    for e in elements:
        of_node[layout.offsets[e] + 1 : layout.offsets[e + 1]] = e
    own = of_node[np.concatenate([layout.free // layout.width, layout.row_node])]
    places = np.argsort(own, kind="stable")[np.sum(own < 0) :].reshape(len(elements), -1)
    number, (row, col) = np.zeros(layout.size, dtype=int), (layout.kkt.row, layout.kkt.col)
    number[places] = np.arange(places.shape[1])
    mine = np.flatnonzero((own[row] == own[col]) & (own[row] >= 0))
    row, col = row[mine], col[mine]
    entries = mine[np.lexsort((number[row], number[col], own[row]))].reshape(len(elements), -1)
    one, shape = entries[0], (places.shape[1], places.shape[1])
    return (
        Pattern(shape, number[layout.kkt.row[one]], number[layout.kkt.col[one]], one),
        places,
        entries,
    )


def negative_pivots(layout: MatrixLayout, nonzeros: Array) -> int:
    """Return the number of negative pivots of a sparse matrix, whose factors are not kept."""
    matrix, solver = _matrix(layout, nonzeros), _solver(layout, "ldl")
    solver.analysed.nfact(matrix)
    return int(solver.analysed.neig(matrix))


def negative_eigenvalues(layout: MatrixLayout, nonzeros: Array) -> int:
    """Return the number of negative eigenvalues of a symmetric KKT matrix (its inertia)."""
    return Factors(layout, nonzeros).negative()


def _solver(layout: MatrixLayout, kind: str, count: int = 1) -> Sparse:
    """Return the layout's sparse solver, analysed once for its sparsity."""
    key = kind if count == 1 else f"{kind} {count}"
    if key not in layout.solvers:
        alike = layout.solvers.get(f"first {kind}")
        layout.solvers[key] = Sparse(layout.kkt, kind, count, alike)
        layout.solvers.setdefault(f"first {kind}", layout.solvers[key])
    return layout.solvers[key]


def _matrix(layout: MatrixLayout, nonzeros: Array) -> ca.DM:
    """Return a matrix for CasADi."""
    if "matrices" not in layout.solvers:
        layout.solvers["matrices"] = Matrices(layout.kkt.sparsity)
    return layout.solvers["matrices"].of(nonzeros)


def _columns(layout: MatrixLayout, right: Array) -> ca.DM:
    """Return columns (size,) or (size, c) for CasADi."""
    count = right.size // layout.size
    key = f"columns {count}"
    if key not in layout.solvers:
        layout.solvers[key] = Matrices(ca.Sparsity.dense(layout.size, count))
    return layout.solvers[key].of(right.T)


def _regular(layout: MatrixLayout, nonzeros: Array) -> Array:
    """Return the nonzeros with `REGULAR` taken off the diagonal of the constraint rows."""
    if not layout.rows:
        return nonzeros
    shifted = nonzeros.copy()
    shifted[layout.row_diagonal] -= REGULAR
    return shifted
