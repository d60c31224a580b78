"""The second variation of a path between two events as one matrix, on a mesh that resolves it.

The KKT matrix [d2S, G'; G, 0] of the discrete path, of which an index, modes and derivatives of S
by the events take a factorization or a few: work and memory are those of Newton's method, where the
forms of `second_variation`, full on each element, take what grows with the coordinates' cube. It
serves where the variations are simply those between two events and L_vv surely is positive.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

import numpy as np

from actionopt.analysis.quadratic.jacobi import (
    BORDERED_TOL,
    FIELD_ROUNDS,
    coefficients_left_out,
    decay,
    propagate,
    refine_where,
    tails,
)
from actionopt.analysis.quadratic.second_variation import (
    check_independent,
    couples_at_rest,
    normals,
    tangent,
    typical_frequency,
)
from actionopt.discrete.matrices.blocks import Condensed, in_parts
from actionopt.discrete.matrices.factors import Factors, SparseFactors, diagonal, solve_inside
from actionopt.discrete.meshes.mesh import Group
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.mechanics.laws.compiled import Pointwise
from actionopt.mechanics.question.scales import diagonal as diagonal_of
from actionopt.tools.immutable import immutable
from actionopt.tools.types import EPS, Array, NDInt

# How much more a mesh may leave out of Jacobi fields, the root of how far eigenvalues are off, than
# of the coefficients of d2S, which is as far: both far below the tolerance of a sign. Derived.
FIELDS_TO_COEFFICIENTS = 1e2
RANDOM_FIELDS = 4  # between random ends of an element: each has a part of all Jacobi fields there
# Numbers of right-hand sides that are solved for at once, 0.5 MB, of which there are half a dozen
# copies, and how many at least: they share a factorization. Measured on a lattice of 160 masses: 37
# columns as a whole take 5 ms, in two parts 1 ms more, and 3 MB less.
SOLVED_AT_ONCE, FEWEST_SOLVED = 2**16, 16
BOUND_LEFT = 1e-4  # of the slowest motion: with such a shift values keep twelve digits. Derived
EVEN_UNITS = 10.0  # how far units of coordinates may be from those of equal inertia


@immutable
class AssembledForm:
    """d2S on the variations z of a discrete path, in its units, and the rows that restrict them."""

    at: DiscretePath
    matrix: Array  # nonzeros of its KKT matrix

    singular = ()  # evaluations at which L_vv vanishes: `is_convex` refuses any

    @property
    def units(self) -> Array:
        """The sizes of the coordinates, (n,): units of Jacobi fields."""
        return self.at.tr.lengths

    @cached_property
    def factors(self) -> Condensed | SparseFactors:
        """The factors of the matrix; their `negative` eigenvalues are the index and the rows."""
        return self.shifted(None)

    @cached_property
    def second(self) -> list[Array]:
        """Nonzeros of L_qq, L_qv and L_vv at the evaluations."""
        return self.at.tr.second(self.at.x)

    def shifted(self, masses: Array | None) -> Condensed | SparseFactors:
        """Return the factors with `masses` (unknowns,) taken off the diagonal."""
        layout, matrix = self.at.tr.layout, self.matrix
        if masses is not None:
            matrix = matrix - diagonal(layout, np.r_[masses, np.zeros(layout.rows)])
        if layout.storage == "blocks":
            return Condensed(layout.blocks, matrix)
        return SparseFactors(layout, matrix)

    def fields(self) -> list[Array]:
        """Return solutions of the linearised equations on each element, (E, d + 1, n c), of size 1.

        Between random ends, tangent to the constraints.
        """
        at, tr, layout = self.at, self.at.tr, self.at.tr.layout
        n, count = tr.problem.system.n, layout.offsets.size
        ends = scattered_numbers(count * n * RANDOM_FIELDS).reshape(-1, n, RANDOM_FIELDS)
        if tr.problem.system.m:
            t = tr.mesh.boundaries[:, None]
            G = normals(tr.problem, at.Q[layout.offsets], t) * tr.lengths
            ends -= np.linalg.pinv(G) @ (G @ ends)
        ends = ends[np.arange(count - 1)[:, None] + [0, 1]]  # of each element
        tables = [x.reshape(*x.shape[:2], -1) for x, _ in self._between(ends)]
        return [x / np.abs(x).max(axis=(1, 2), keepdims=True) for x in tables]

    def _between(self, ends: Array) -> list[tuple[Array, Array]]:
        """Return solutions of the linearised equations on each element, (E, d + 1, n, c), by group.

        In the sizes of the coordinates, with given `ends` (N, 2, n, c). And d2S there of any two of
        them, (E, c, c); what single nodes add to it is that of the element before.
        """
        tr, layout, (_, _, n, count), found = self.at.tr, self.at.tr.layout, ends.shape, []
        if layout.storage == "blocks":
            assert isinstance(self.factors, Condensed)
            nodal = layout.blocks.split(self.matrix)[1]
            given = np.pad(ends, ((0, 0), (0, 0), (0, nodal.shape[1] - n), (0, 0)))
            inside = self.factors.between([given[g.elements] for g in layout.groups])
            for g, part, eta in zip(layout.groups, self.factors.inner, inside, strict=True):
                own = given[g.elements].reshape(len(eta), -1, count)
                S = part.end_blocks.reshape(len(eta), 2, -1, 2, nodal.shape[1])
                S = S[:, ::-1, :, ::-1].copy()  # the last node stands first there
                S[:, 1, :, 1] += nodal[g.elements + 1]
                work = own.swapaxes(1, 2) @ (S.reshape(len(eta), own.shape[1], -1) @ own)
                found.append((eta[:, :, :n], tr.action_unit * work))
            return found
        free = ~np.isin(layout.free // n, layout.offsets)  # inside
        node, place = np.divmod(layout.free[free], n)
        whole = np.zeros((layout.node_count, n, count))
        for g in layout.groups:
            eta = np.zeros((*g.nodes.shape, n, count))
            eta[:, [0, -1]] = ends[g.elements]
            found.append((eta, self.forces(g, eta)))
            whole[g.nodes] = found[-1][1]
        for some in some_columns(count * free.any(), layout.size):
            pushed = whole[node, place, some]
            load = np.zeros((layout.size, pushed.shape[1]))
            load[: layout.unknowns][free] = -pushed / tr.action_unit
            whole[node, place, some] = solve_inside(layout, self.matrix, load)[: layout.unknowns][
                free
            ]
        for k, (g, (eta, forces)) in enumerate(zip(layout.groups, found, strict=True)):
            eta[:, 1:-1] = whole[g.nodes[:, 1:-1]]
            one, other = (x.reshape(len(eta), -1, count) for x in (eta, forces))
            found[k] = eta, one.swapaxes(1, 2) @ other
        return found

    @cached_property
    def frequency(self) -> float:
        """How fast variations may turn, on the whole."""
        mass = diagonal_of(self.at.problem.system, 2, self.second[2])
        mixed = (*self._second.sparsity(1), self.second[1])
        springs = [(*function.sparsity(0), values) for function, values in self._springs]
        return typical_frequency(self.at.problem.duration, mass, springs, [mixed])

    def jacobi_fields(self) -> list[Array]:
        """Return the Jacobi fields that vanish at the start, on each element (d + 1, n, r).

        In the sizes of the coordinates, recombined from one element to the next.
        """
        at, tr, layout = self.at, self.at.tr, self.at.tr.layout
        Z = tangent(at.problem, at.Q[layout.offsets], tr.mesh.boundaries[:, None], tr.lengths)
        count, n, r = Z.shape
        ends = np.zeros((count - 1, 2, n, 2, r))  # of which one moves, then the other
        ends[:, 0, :, 0], ends[:, 1, :, 1] = Z[:-1], Z[1:]
        found: list[Array] = [np.empty(0)] * (count - 1)
        stiffness: list[Array] = found.copy()
        for g, parts in zip(
            layout.groups, self._between(ends.reshape(-1, 2, n, 2 * r)), strict=True
        ):
            for e, eta, work in zip(g.elements.tolist(), *parts, strict=True):
                found[e], stiffness[e] = eta, work
        mass = diagonal_of(at.problem.system, 2, self.second[2]) * tr.lengths**2
        unit = float(mass.mean()) * self.frequency  # as `Form.momentum_unit`
        planes = propagate(stiffness, unit, np.eye(2 * r)[:, r:])[0]
        return [x @ a.reshape(2 * r, r) for x, a in zip(found, planes, strict=True)]

    def forces(self, g: Group, eta: Array) -> Array:
        """Return the change of each element's dS/dq, of a group, with variations eta.

        Both (E, d + 1, n, c), in the sizes of the coordinates.
        """
        tr, second, found = self.at.tr, self._second, np.empty_like(eta)
        _, B, C = (x[g.span] for x in self.second)
        for c in range(eta.shape[3]):
            local = eta[..., c] * tr.lengths
            rate = g.rule.derivative @ (local - local[:, :1]) / tr.half[g.elements, None, None]
            q, v = local.reshape(len(B), -1), rate.reshape(len(B), -1)
            p = second.product(2, C, v, symmetric=True) + second.product(1, B, q, transposed=True)
            force = second.product(1, B, v)
            for function, springs in self._springs:
                force += function.product(0, springs[g.span], q, symmetric=True)
            work = g.rule.weighted_derivative.T @ p.reshape(local.shape)
            found[..., c] = (work + (tr.weight[g.span] * force).reshape(local.shape)) * tr.lengths
        return found

    @property
    def _second(self) -> Pointwise:
        """The function of L_qq, L_qv and L_vv."""
        return self.at.problem.system.pointwise("second")

    @cached_property
    def _springs(self) -> list[tuple[Pointwise, Array]]:
        """The functions of L_qq and of how rows bend, and their nonzeros at the evaluations."""
        at, tr, system = self.at, self.at.tr, self.at.problem.system
        springs = [(self._second, self.second[0])]
        if tr.layout.rows and not system.structure.affine_constraint:
            bend, places = system.pointwise("constraint_curvature"), tr.layout.node_of
            lam = np.nan_to_num(at.lam[places])
            springs.append((bend, bend(at.Q[places], lam, tr.times, at.problem.packed)[0].copy()))
        return springs

    def bound(self, units: Array) -> float:
        """Return what eigenvalues of d2S are not below, in the norm int |eta / units|^2 dt.

        With `units` (n,) of the coordinates. That is a bound of L_qq and the rows' curvature, at
        each time alone (Gershgorin), and of L_vv times the least square of a frequency. Where
        velocities couple to coordinates it may be more: by how much, roughly, is taken off.
        """
        tr, system = self.at.tr, self.at.problem.system
        second, (_, B, C) = self._second, self.second
        stiffness, mass = (
            _gershgorin([(f.sparsity(k), x) for f, x in parts], units)
            for k, parts in ((0, self._springs), (2, [(second, C)]))
        )
        if B.any():
            (row, col), sums = second.sparsity(1), np.zeros((2, units.size, len(B)))
            for found, i in zip(sums, (row, col), strict=True):
                np.add.at(found, i, np.abs(B * units[row] * units[col]).T)
            own = np.equal(*second.sparsity(2))
            least = (C[:, own] * units**2).min()
            return stiffness - float(sums[0].max() * sums[1].max() / least)
        pinned = [len(event.pinned) for event in (tr.problem.start, tr.problem.end)]
        slowest = np.pi / tr.problem.duration / (1 if min(pinned) == system.n else 2)
        # A little is left: the bound would be an eigenvalue where L_qq and L_vv are constant.
        return stiffness + (1 - BOUND_LEFT) * slowest**2 * max(mass, 0.0)

    @cached_property
    def couplings(self) -> tuple[Coupling, Coupling]:
        """Those of the first node and of the last one."""
        return self.coupling(0), self.coupling(-1)

    def coupling(self, k: int) -> Coupling:
        """Return how dS/dq at all nodes, (K n,), changes with the place (n,) of an end of the path.

        That is the first node (k = 0) or the last one (k = -1).
        """
        tr, layout = self.at.tr, self.at.tr.layout
        end, second = (0, layout.node_count - 1)[k], self._second
        i, e = next(
            (i, e) for i, g in enumerate(layout.groups) for e in (g.nodes[:, k] == end).nonzero()[0]
        )
        g, half = layout.groups[i], tr.halves[i][e]
        points, work = g.rule.degree + 1, g.rule.weighted_derivative
        span = slice(g.span.start + e * points, g.span.start + (e + 1) * points)
        nodes, weight = g.nodes[e][:, None], tr.weight[span]
        slope = (g.rule.derivative[:, k] / half.ravel())[:, None]
        _, B, C = (x[span] for x in self.second)
        mixed, of_v = (second.sparsity(j) for j in (1, 2))
        found: list[tuple[Array, ...]] = []
        for at, (row, col), values, triangle in (
            *(
                (nodes[[k]], f.sparsity(0), weight[k] * x[span][[k]], True)
                for f, x in self._springs
            ),
            (nodes, of_v, work.T @ (C * slope), True),
            (nodes, mixed, weight * B * slope, False),
            (nodes, mixed[::-1], np.outer(work[k], B[k]), False),
        ):
            for i, j, some in ((row, col, row >= 0), (col, row, (row != col) & triangle)):
                rows = tr.problem.system.n * at + i[some]
                found.append((rows, np.broadcast_to(j[some], rows.shape), values[:, some]))
        return Coupling(
            *(np.concatenate([x.ravel() for x in part]) for part in zip(*found, strict=True))
        )


@immutable
class Coupling:
    """A sparse matrix, by the rows, columns and values of its entries."""

    rows: NDInt
    cols: NDInt
    values: Array

    @cached_property
    def transpose(self) -> Coupling:
        """The transposed matrix."""
        return Coupling(self.cols, self.rows, self.values)

    def part(self, number: NDInt, units: Array | None = None) -> Coupling:
        """Return the rows that have a number, times their `units`; others have -1."""
        own = np.flatnonzero(number[self.rows] >= 0)
        rows, values = number[self.rows[own]], self.values[own]
        return Coupling(rows, self.cols[own], values if units is None else values * units[rows])

    @cached_property
    def _by_row(self) -> tuple[Coupling, NDInt]:
        """The same, row by row, and where each row begins."""
        order = np.argsort(self.rows, kind="stable")
        found = Coupling(self.rows[order], self.cols[order], self.values[order, None])
        return found, np.flatnonzero(np.diff(found.rows, prepend=-1))

    def times(self, v: Array, height: int) -> Array:
        """Return the matrix, of so many rows, times the columns of v, (height, c)."""
        by, first = self._by_row
        found = np.zeros((height, v.shape[1]))
        for some in in_parts(v.shape[1], by.rows.size):
            found[by.rows[first], some] = np.add.reduceat(by.values * v[by.cols, some], first)
        return found


def on_mesh(at: DiscretePath, error: float, factors: Factors | None = None) -> AssembledForm | None:
    """Return d2S of a path known to `error` as its own mesh has it, or None as `assemble` does.

    The matrix of `factors`, if they are given. Raises ValueError where the constraints are not
    independent.
    """
    if not (is_plain(at) and is_convex(at)):
        return None
    check_independent(at, at.tr.lengths, error)
    return AssembledForm(at, at.tr.kkt(at.z) if factors is None else factors.nonzeros)


def assemble(
    first: DiscretePath,
    error: float,
    fields: float,
    *,
    polish: bool = False,
    curves: bool = False,
    form: AssembledForm | None = None,
) -> AssembledForm | None:
    """Return d2S of a path known to `error`, on a mesh that resolves its Jacobi fields to `fields`.

    And the path with `polish`, which Newton's method improves there. Where that is asked for, or
    fields as `curves`, which have half the digits of values, degrees are raised by more. `form` is
    that of `on_mesh`, if it is known. None where the variations are not simply those between two
    events, L_vv may not be positive, or a part of the path is conjugate. Raises ValueError where
    the constraints are not independent, or along a path through a singularity.
    """
    if not is_plain(first):
        return None
    at = _in_even_units(first)
    form = None if form is None or form.at is not at else form
    for _ in range(FIELD_ROUNDS):
        mesh, Q = at.mesh, at.Q / at.tr.lengths
        key = mesh.degrees, mesh.boundaries.tobytes()
        tail = at.left_out.get(key)
        if tail is None:
            form = form or on_mesh(at, error)
            if form is None:
                return None
            try:
                tail = decay(mesh, form.fields())
            except np.linalg.LinAlgError:
                return None
            if not np.isfinite(tail).all():
                return None
            tail = np.maximum(tail, FIELDS_TO_COEFFICIENTS * coefficients_left_out(at))
            at.left_out[key] = tail
        if polish:
            tail = np.maximum(tail, tails(mesh, [Q[g.nodes] for g in mesh.groups]))
        finer = refine_where(mesh, tail[0], fields, None if curves or polish else tail[1])
        if finer is None:
            form = form or on_mesh(at, error)
            if form is None or not polish:
                return form
            at = _polish(form)
            return AssembledForm(at, at.tr.kkt(at.z))
        form = None  # before the next is made
        at = at.on(finer, first.multipliers(finer.nodes))
    return None


def _polish(form: AssembledForm) -> DiscretePath:
    """Return the stationary path near, by Newton's method with the factors at hand if these do."""
    tr, z, last = form.at.tr, form.at.z, np.inf
    while True:
        step = form.factors.solve(tr.residual(z))
        size = np.abs(step).max()
        if not size < last / 2:
            return form.at.polish()
        z, last = z - step, size
        if size < BORDERED_TOL:
            return DiscretePath(tr, z)


def some_columns(count: int, size: int) -> Iterator[slice]:
    """Yield columns of so many rows, as many at once; of the last ones there may be fewer."""
    parts = -(-count // max(SOLVED_AT_ONCE // size, FEWEST_SOLVED))
    few = -(-count // max(parts, 1))
    for k in range(parts):
        yield slice(few * k, few * (k + 1))


def _gershgorin(parts: list[tuple[tuple[NDInt, NDInt], Array]], units: Array) -> float:
    """Return a bound from below of the eigenvalues of sums of symmetric matrices, in `units` (n,).

    Of each the rows and columns of its nonzeros, those of a triangle, and these, (K, nonzeros).
    """
    least = np.zeros((units.size, len(parts[0][1])))
    for (row, col), values in parts:
        size, off = (values * units[row] * units[col]).T, row != col
        np.add.at(least, row[~off], size[~off])
        for i in (row, col):
            np.subtract.at(least, i[off], np.abs(size[off]))
    return float(least.min())


def is_plain(at: DiscretePath) -> bool:
    """Whether variations are those between two events, one of which leaves nothing free."""
    problem, layout = at.problem, at.tr.layout
    n, system = problem.system.n, problem.system
    ends = len(problem.start.pinned), len(problem.end.pinned)
    simple = not (problem.touches or problem.through or any(problem.surfaces))
    return (
        simple
        and max(ends) == n
        and system.m < n
        and layout.unknowns > 0
        and not (layout.closed or at.tr.nodal or system.structure.forced)
        and couples_at_rest(system) is None
    )


def _in_even_units(at: DiscretePath) -> DiscretePath:
    """Return the path in units in which all coordinates have much the same inertia.

    In others round-off of those of large equations would hide the others' signs.
    """
    tr = at.tr
    mass = np.abs(diagonal_of(tr.problem.system, 2, tr.second(at.x)[2])).mean(axis=0)
    size = tr.lengths * np.sqrt(np.where(mass > 0, mass, 1.0))
    if not size.max() > EVEN_UNITS * size.min():
        return at
    return at.in_units(tr.lengths * (size.max() / size))


def is_convex(at: DiscretePath) -> bool:
    """Whether L_vv surely is positive definite all along the path."""
    second, C = at.problem.system.pointwise("second"), at.tr.second(at.x)[2]
    row, col = second.sparsity(2)
    own = row == col
    if not np.isfinite(C).all():
        return False
    if own.all():
        pivots = C
    elif at.tr.layout.storage == "sparse":
        return False
    else:
        try:
            L = np.linalg.cholesky(second.full(2, C, symmetric=True))
        except np.linalg.LinAlgError:
            return False
        pivots = np.einsum("kaa->ka", L) ** 2
    size = np.abs(C[:, own]).max(axis=1, keepdims=True)
    return own.sum() == at.problem.system.n and bool((pivots > np.sqrt(EPS) * size).all())


def scattered_numbers(count: int) -> Array:
    """Return numbers without a pattern, (count,); numpy's generators take 16 ms to import."""
    return np.cos(np.arange(count) ** 2.0)
