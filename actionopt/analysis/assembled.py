"""The second variation of a path between two events as one matrix, on a mesh that resolves it.

The KKT matrix [d2S, G'; G, 0] of the discrete path, of which an index, modes and derivatives of S
by the events take a factorization or a few: work and memory are those of Newton's method, where the
forms of `second_variation`, full on each element, take what grows with the coordinates' cube. It
serves where the variations are simply those between two events and L_vv surely is positive.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from actionopt.analysis.jacobi import FIELD_ROUNDS, coefficients_left_out, refine_where, tails
from actionopt.analysis.second_variation import (
    check_independent,
    couples_at_rest,
    curvature,
    normals,
    tangent,
)
from actionopt.discrete.blocks import Condensed, in_parts
from actionopt.discrete.discrete_path import DiscretePath
from actionopt.discrete.factors import SparseFactors, diagonal, solve_inside
from actionopt.discrete.mesh import Group
from actionopt.mechanics.scales import diagonal as diagonal_of
from actionopt.tools.immutable import immutable
from actionopt.tools.types import EPS, Array, NDInt

# How much more a mesh may leave out of Jacobi fields, the root of how far eigenvalues are off, than
# of the coefficients of d2S, which is as far: both far below the tolerance of a sign. Derived.
FIELDS_TO_COEFFICIENTS = 1e2
RANDOM_FIELDS = 4  # between random ends of an element: each has a part of all Jacobi fields there
EVEN_UNITS = 10.0  # how far units of coordinates may be from those of equal inertia


@immutable
class AssembledForm:
    """d2S on the variations z of a discrete path, in its units, and the rows that restrict them.

    Attributes
    ----------
    at : DiscretePath
    matrix : array
        Nonzeros of its KKT matrix.
    """

    at: DiscretePath
    matrix: Array

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
        tables = [x.reshape(*x.shape[:2], -1) for x in self._between(ends)]
        return [x / np.abs(x).max(axis=(1, 2), keepdims=True) for x in tables]

    def _between(self, ends: Array) -> list[Array]:
        """Return solutions of the linearised equations on each element, (E, d + 1, n, c).

        They are `ends` (N + 1, n, c) where elements meet, all in the sizes of the coordinates.
        """
        tr, layout, n = self.at.tr, self.at.tr.layout, ends.shape[1]
        if layout.storage == "sparse":
            whole = self._fill_elements(ends * tr.lengths[:, None]) / tr.lengths[:, None]
            return [whole[g.nodes] for g in layout.groups]
        assert isinstance(self.factors, Condensed)
        given = np.zeros((len(ends), layout.blocks.width, ends.shape[2]))
        given[:, :n] = ends
        at_ends = [np.stack([given[g.elements], given[g.elements + 1]], 1) for g in layout.groups]
        return [x[:, :, :n] for x in self.factors.between(at_ends)]

    @cached_property
    def frequency(self) -> float:
        """How fast variations may turn, on the whole: as `Form.frequency`."""
        second = self.at.problem.system.pointwise("second")
        mass = np.abs(diagonal_of(self.at.problem.system, 2, self.second[2]))
        mixed = second.sparsity(1), self.second[1]
        springs, coupling = (
            sum((values**2 / (mass[:, row] * mass[:, col])).sum() for (row, col), values in entries)
            for entries in (self._springs, [mixed])
        )
        rate = (springs / mass.size) ** 0.25 + np.sqrt(coupling / mass.size)
        return float(1 / self.at.problem.duration + rate)

    def jacobi_fields(self) -> list[Array]:
        """Return the Jacobi fields that vanish at the start, on each element (d + 1, n, r).

        In the sizes of the coordinates. From one element to the next they are recombined, as those
        of `jacobi.fields` are.
        """
        at, tr, layout, problem = self.at, self.at.tr, self.at.tr.layout, self.at.problem
        Q, t, lengths = at.Q[layout.offsets], tr.mesh.boundaries[:, None], tr.lengths
        Z = tangent(problem, Q, t, lengths)
        bend = np.zeros((len(Q), Z.shape[1], Z.shape[1]))
        if layout.rows:
            bend = curvature(problem, Q, at.lam[layout.offsets], t) * (lengths[:, None] * lengths)
        # Columns in turn for every other boundary, so that an element's ends move one by one.
        r = Z.shape[2]
        ends = np.zeros((*Z.shape[:2], 2 * r))
        ends[0::2, :, :r], ends[1::2, :, r:] = Z[0::2], Z[1::2]
        found: list[Array] = [np.empty(0)] * tr.mesh.elements
        stiffness: list[Array] = found.copy()
        for g, eta in zip(layout.groups, self._between(ends), strict=True):
            forces = self._end_forces(g, eta)
            for k, e in enumerate(g.elements.tolist()):
                weight = tr.half[e] * g.rule.weights[[0, -1], None, None]
                force = forces[k] + weight * (bend[e : e + 2] @ eta[k, [0, -1]])
                found[e] = eta[k]
                stiffness[e] = Z[e : e + 2].swapaxes(1, 2) @ force
        mass = np.abs(diagonal_of(problem.system, 2, self.second[2]) * lengths**2).mean()
        unit = float(mass) * self.frequency  # as `Form.momentum_unit`
        a, p = np.zeros((r, r)), np.eye(r)
        left, right = slice(None, r), slice(r, None)
        for e, (first, last) in enumerate(stiffness):
            later = np.linalg.solve(first[:, right], -first[:, left] @ a - unit * p)
            momentum = (last[:, left] @ a + last[:, right] @ later) / unit
            found[e] = found[e][:, :, left] @ a + found[e][:, :, right] @ later
            frame, _ = np.linalg.qr(np.concatenate([later, momentum]))
            a, p = frame[:r], frame[r:]
            left, right = right, left
        return found

    def _end_forces(self, g: Group, eta: Array) -> Array:
        """Return the change of dS/dq at both ends of the elements of a group alone, (E, 2, n, c).

        With variations eta (E, d + 1, n, c), both in the sizes of the coordinates, but for that by
        how constraints bend.
        """
        tr, second = self.at.tr, self.at.problem.system.pointwise("second")
        (E, k, n, c), ends = eta.shape, [0, -1]
        found, scale = np.empty((E, 2, n, c)), tr.lengths[:, None] * tr.lengths
        for e, own in enumerate(eta):
            some = slice(g.span.start + e * k, g.span.start + (e + 1) * k)
            A, B, C = (
                second.full(i, x[some], symmetric=i != 1) * scale for i, x in enumerate(self.second)
            )
            half = tr.half[g.elements[e]]
            rate = np.tensordot(g.rule.derivative, own, 1) / half
            p = C @ rate + B.swapaxes(1, 2) @ own
            force = half * g.rule.weights[ends, None, None] * (A @ own + B @ rate)[ends]
            found[e] = force + np.tensordot(g.rule.weighted_derivative.T[ends], p, 1)
        return found

    def _fill_elements(self, ends: Array) -> Array:
        """Return variations (K, n, c) that are `ends` (N + 1, n, c) where elements meet."""
        tr, layout, n = self.at.tr, self.at.tr.layout, ends.shape[1]
        eta = np.zeros((layout.node_count, *ends.shape[1:]))
        eta[layout.offsets] = ends
        inside = ~np.isin(layout.free // n, layout.offsets)
        node, place = np.divmod(layout.free[inside], n)
        for some in in_parts(ends.shape[2] * inside.any(), layout.size):
            load = -self.loads(self.forces(eta[:, :, some]))
            found = solve_inside(layout, self.matrix, load)[: layout.unknowns][inside]
            eta[node, place, some] = found * tr.x_unit[inside, None]
        return eta

    def loads(self, forces: Array) -> Array:
        """Return what `forces` (K, n, c) add to the equations, (size, c)."""
        tr, layout = self.at.tr, self.at.tr.layout
        found = np.zeros((layout.size, forces.shape[2]))
        units = (tr.x_unit / tr.action_unit)[:, None]
        found[: layout.unknowns] = forces.reshape(-1, forces.shape[2])[layout.free] * units
        return found

    @property
    def node_weights(self) -> Array:
        """The weights of the quadrature over time, (K,)."""
        tr = self.at.tr
        return np.bincount(tr.layout.node_of, tr.weight[:, 0])

    def forces(self, eta: Array) -> Array:
        """Return the change of dS/dq at all nodes, (K, n, c), with variations eta of them.

        But for that by how constraints bend.
        """
        tr, layout, found = self.at.tr, self.at.tr.layout, np.empty_like(eta)
        second, (A, B, C) = self.at.problem.system.pointwise("second"), self.second
        mixed = second.full(1, B) if B.size else None
        for c in range(eta.shape[2]):
            local = eta[layout.node_of, :, c]
            rate = tr.velocities(local)
            p = second.product(2, C, rate, symmetric=True)
            force = tr.weight * second.product(0, A, local, symmetric=True)
            if mixed is not None:
                p += np.einsum("kab,ka->kb", mixed, local)
                force += tr.weight * second.product(1, B, rate)
            for g in layout.groups:
                work = g.rule.weighted_derivative.T @ p[g.span].reshape(*g.nodes.shape, -1)
                force[g.span] += work.reshape(-1, eta.shape[1])
            summed = np.bincount(layout.scatter, force.ravel(), eta[:, :, c].size)
            found[:, :, c] = summed.reshape(eta.shape[:2])
        return found

    @property
    def _springs(self) -> list[tuple[tuple[NDInt, NDInt], Array]]:
        """Rows and columns of nonzeros at the evaluations, and these: of L_qq and how rows bend."""
        at, tr, system = self.at, self.at.tr, self.at.problem.system
        springs = [(system.pointwise("second").sparsity(0), self.second[0])]
        if tr.layout.rows and not system.structure.affine_constraint:
            bend, places = system.pointwise("constraint_curvature"), tr.layout.node_of
            lam = np.nan_to_num(at.lam[places])
            values = bend(at.Q[places], lam, tr.times, at.problem.packed)[0]
            springs.append((bend.sparsity(0), values))
        return springs

    def bound(self, units: Array) -> float:
        """Return what no eigenvalue is less than, in the norm int |eta / units|^2 dt; units (n,).

        It may be more where velocities couple to coordinates: by how much, roughly, is taken off.
        """
        tr, system = self.at.tr, self.at.problem.system
        second, (_, B, C) = system.pointwise("second"), self.second
        masses = [(second.sparsity(2), C)]
        stiffness, mass = (_gershgorin(x, units) for x in (self._springs, masses))
        if B.any():
            (row, col), sums = second.sparsity(1), np.zeros((2, units.size, len(B)))
            for found, i in zip(sums, (row, col), strict=True):
                np.add.at(found, i, np.abs(B * units[row] * units[col]).T)
            own = np.equal(*second.sparsity(2))
            least = (C[:, own] * units**2).min()
            return stiffness - float(sums[0].max() * sums[1].max() / least)
        pinned = [len(event.pinned) for event in (tr.problem.start, tr.problem.end)]
        slowest = np.pi / tr.problem.duration / (1 if min(pinned) == system.n else 2)
        # A hundredth is left: the bound would be an eigenvalue where L_qq and L_vv are constant.
        return stiffness + 0.99 * slowest**2 * max(mass, 0.0)

    def coupling(self, k: int) -> Coupling:
        """Return how dS/dq at all nodes, (K n,), changes with the place (n,) of an end of the path.

        That is the first node (k = 0) or the last one (k = -1).
        """
        tr, layout = self.at.tr, self.at.tr.layout
        end, second = (0, layout.node_count - 1)[k], self.at.problem.system.pointwise("second")
        i, e = next(
            (i, e) for i, g in enumerate(layout.groups) for e in (g.nodes[:, k] == end).nonzero()[0]
        )
        g, half = layout.groups[i], tr.halves[i][e]
        points, work = g.rule.degree + 1, g.rule.weighted_derivative
        span = slice(g.span.start + e * points, g.span.start + (e + 1) * points)
        nodes, weight = g.nodes[e][:, None], tr.weight[span]
        slope = (g.rule.derivative[:, k] / half.ravel())[:, None]
        A, B, C = (x[span] for x in self.second)
        of_q, mixed, of_v = (second.sparsity(j) for j in range(3))
        found: list[tuple[Array, ...]] = []
        for at, (row, col), values, triangle in (
            (nodes[[k]], of_q, weight[k] * A[[k]], True),
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

    @property
    def transpose(self) -> Coupling:
        """The transposed matrix."""
        return Coupling(self.cols, self.rows, self.values)

    def times(self, v: Array, height: int) -> Array:
        """Return the matrix, of so many rows, times the columns of v, (height, c)."""
        order = np.argsort(self.rows, kind="stable")
        rows, cols, values = self.rows[order], self.cols[order], self.values[order, None]
        first = np.flatnonzero(np.diff(rows, prepend=-1))
        found = np.zeros((height, v.shape[1]))
        for some in in_parts(v.shape[1], rows.size):
            found[rows[first], some] = np.add.reduceat(values * v[cols, some], first)
        return found


def assemble(
    first: DiscretePath, error: float, fields: float, *, polish: bool = False
) -> AssembledForm | None:
    """Return d2S of a path known to `error`, on a mesh that resolves its Jacobi fields to `fields`.

    And the path with `polish`, which Newton's method improves there.
    None where the variations are not simply those between two events, L_vv may not be positive, or
    a part of the path is conjugate. Raises ValueError where the constraints are not independent, or
    along a path through a singularity.
    """
    if not is_plain(first):
        return None
    at = _in_even_units(first)
    for _ in range(FIELD_ROUNDS):
        tr = at.tr
        if not is_convex(at):
            return None
        check_independent(at, tr.lengths, error)
        form = AssembledForm(at, tr.kkt(at.z))
        try:
            tail = tails(tr.mesh, form.fields())
        except np.linalg.LinAlgError:
            return None
        if not np.isfinite(tail).all():
            return None
        tail = np.maximum(tail, FIELDS_TO_COEFFICIENTS * coefficients_left_out(at))
        if polish:
            tail = np.maximum(
                tail, tails(tr.mesh, [at.Q[g.nodes] / tr.lengths for g in tr.mesh.groups])
            )
        mesh = refine_where(tr.mesh, tail, fields)
        if mesh is None and polish:
            at = at.polish()
            form = AssembledForm(at, at.tr.kkt(at.z))
        if mesh is None:
            return form
        at = first.on(mesh, first.multipliers(mesh.nodes))
    return None


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
    units = tr.lengths * (size.max() / size)
    return DiscretePath.of(tr.problem, at.path, at.rows_on(at.mesh), units)


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
