"""The discrete action on a mesh: its value, gradient, KKT system, and what Ipopt sees of them.

On each element the path is the polynomial through d + 1 LGL nodes and the action is summed with
the LGL weights,

    S(Q) = sum_e (h_e / 2) sum_k w_k L(q_k, v_k, t_k),    v_k = (2 / h_e) sum_j D_kj q_j.

Constraint rows f(q_k, t_k) = 0 carry the same weight, so that their multipliers are lambda(t_k).
Stationary points solve

    r(Q, lam) = grad S + sum_k w_k Q_k + sum_k w_k G_k' lam_k = 0,    w_k f(q_k, t_k) = 0.

Derivatives of L are evaluated pointwise and scattered by index arrays that depend on the degrees
alone: a `Layout` is shared by all meshes of one shape and all problems of one system. Unknowns are
the coordinates in units of their own size, so that atoms and planets look alike.
"""

from __future__ import annotations

from collections import Counter
from copy import copy
from functools import cached_property

import numpy as np

from actionopt.path import Mesh
from actionopt.problem import Problem
from actionopt.quadrature import Array
from actionopt.transcription.layout import layout_for, sparsity_of


class Transcription:
    """The discrete action of one problem on one mesh.

    Vectors z = (x, mu) hold the free coordinates in units of `lengths`, node by node, and the
    multipliers of the rows in units of their own. `counts` says how often each function was
    evaluated.

    Parameters
    ----------
    problem : Problem
    mesh : Mesh
        Over the times of the problem's events.
    lengths : (n,) array
        Unit of each coordinate.
    like : Transcription, optional
        One of a neighbouring problem on a mesh of the same shape, whose units of action and of
        the rows are taken, so that vectors z mean the same to both.
    """

    def __init__(
        self, problem: Problem, mesh: Mesh, lengths: Array, *, like: Transcription | None = None
    ) -> None:
        self.problem, self.mesh, self.lengths = problem, mesh, lengths
        self.layout = layout_for(problem, mesh)
        self.counts: Counter[str] = Counter()
        layout, n = self.layout, problem.system.n
        self.times = mesh.nodes[layout.node_of][:, None]
        self.half = mesh.lengths / 2
        self._halves = [self.half[g.elements][:, None, None] for g in layout.groups]
        weights = [
            (h[:, 0] * g.rule.weights).ravel()
            for h, g in zip(self._halves, layout.groups, strict=True)
        ]
        weight = np.concatenate(weights)
        self.weight = weight[:, None]
        self.ends = np.zeros((layout.node_count, n))
        for k, event in ((0, problem.start), (-1, problem.end)):
            self.ends[k] = [0.0 if x is None else x for x in event.q]
        self.x_unit = lengths[layout.free % n]
        self._point: tuple[Array, Array, Array, Array] | None = None
        self._values: tuple[float, Array] | None = None
        # The parts of the Hessian that a constant mass leaves as they are.
        self._stiff: Array | None = None
        self._rigid: list[Array] | None = None
        self._metric: Array | None = None
        # Nonzeros of the mass matrix half way along the straight line, its upper triangle.
        self.inertia = np.zeros(0) if like is None else like.inertia
        self.action_unit, self.row_units = (
            self._units() if like is None else (like.action_unit, like.row_units)
        )
        if layout.rows:
            node_weight = np.bincount(layout.node_of, weight, layout.node_count)
            if layout.closed:
                node_weight[0] += node_weight[-1]
            self.row_weight = node_weight[layout.row_nodes][:, None]
            # Rows w f are scaled to gradients of size one, whatever the element's length.
            self.row_unit = node_weight[layout.row_node] * self.row_units[layout.row_constraint]
        else:
            self.row_weight, self.row_unit = np.zeros((0, 1)), np.zeros(0)
        self.mu_unit = self.action_unit / self.row_unit

    def with_ends(self, ends: Array) -> Transcription:
        """Return the same with other coordinates (2, n) at the first and the last node.

        The problem, whose events they need not be, stays the same.
        """
        other = copy(self)
        other.ends = self.ends.copy()
        other.ends[[0, -1]] = ends
        other._point = other._values = None
        return other

    def _units(self) -> tuple[float, Array]:
        """Return the unit of action and of each constraint's row, from typical curvatures."""
        system, problem = self.problem.system, self.problem
        Q = self.straight()
        duration = problem.duration
        at = Q[self.layout.node_of]
        _, _, C = self._second(at, self.velocities(at))
        rows, cols = sparsity_of(system, "second", 2)
        self.inertia = C[len(C) // 2].copy()
        mine = rows == cols
        diagonal = np.abs(C[:, mine]) * self.lengths[rows[mine]] ** 2 / duration
        good = diagonal[np.isfinite(diagonal) & (diagonal > 0)]
        unit = float(np.partition(good, good.size // 2)[good.size // 2]) if good.size else 1.0
        if not system.m:
            return unit, np.ones(0)
        layout = self.layout
        nodes = self.mesh.nodes[layout.row_nodes][:, None]
        G = system.pointwise("constraint_jacobian")(Q[layout.row_nodes], nodes, problem.packed)[0]
        sizes = np.zeros(system.m)
        np.maximum.at(sizes, layout.G_rows, np.max(np.abs(G), axis=0) * self.lengths[layout.G_cols])
        return unit, np.where(sizes > 0, sizes, 1.0)

    # -- vectors -----------------------------------------------------------------------------

    def straight(self) -> Array:
        """Return the straight line between the events, (K, n); a free end keeps the other's."""
        start, end = (
            np.array([np.nan if x is None else x for x in e.q], dtype=float)
            for e in (self.problem.start, self.problem.end)
        )
        start = np.where(np.isnan(start), end, start)
        end = np.where(np.isnan(end), start, end)
        start, end = np.nan_to_num(start), np.nan_to_num(end)
        if self.problem.advance is not None:
            end = start + self.problem.advance
        s = (self.mesh.nodes - self.problem.start.t) / self.problem.duration
        return start + s[:, None] * (end - start)

    def pack(self, Q: Array, lam: Array | None = None) -> Array:
        """Return z for node coordinates Q (K, n) and multipliers lam (K, m) (zero if None)."""
        layout = self.layout
        z = np.zeros(layout.size)
        z[: layout.unknowns] = Q.ravel()[layout.free] / self.x_unit
        if lam is not None and layout.rows:
            z[layout.unknowns :] = lam[layout.row_node, layout.row_constraint] / self.mu_unit
        return z

    def unpack(self, z: Array) -> tuple[Array, Array]:
        """Return coordinates (K, n) and multipliers (K, m); NaN where there is no row."""
        layout = self.layout
        lam = np.full((layout.node_count, self.problem.system.m), np.nan)
        lam[layout.row_node, layout.row_constraint] = z[layout.unknowns :] * self.mu_unit
        return self.coordinates(z), lam

    def coordinates(self, z: Array) -> Array:
        """Return the coordinates at the nodes, (K, n)."""
        Q = self.ends.copy()
        Q.ravel()[self.layout.free] = z[: self.layout.unknowns] * self.x_unit
        if self.problem.advance is not None:
            Q[-1] = Q[0] + self.problem.advance
        return Q

    # -- values and first derivatives ----------------------------------------------------------

    def velocities(self, at: Array) -> Array:
        """Return the velocities at the evaluations, for coordinates `at` there, both (E, n)."""
        parts = []
        for g, half in zip(self.layout.groups, self._halves, strict=True):
            q = at[g.span].reshape(*g.nodes.shape, -1)
            q = q - q[:, :1]  # a constant has no velocity, nor the round-off of one
            parts.append((g.rule.derivative @ q / half).reshape(-1, at.shape[1]))
        return parts[0] if len(parts) == 1 else np.concatenate(parts)

    def _place(self, x: Array) -> tuple[Array, Array, Array]:
        """Return Q (K, n), and coordinates and velocities at the evaluations, for x."""
        if self._point is None or not np.array_equal(self._point[0], x):
            Q = self.coordinates(x)
            at = Q[self.layout.node_of]
            self._point = (x.copy(), Q, at, self.velocities(at))
            self._values = None
        return self._point[1:]

    def _first(self, x: Array) -> tuple[float, Array]:
        """Return S and its gradient (virtual work included) at all nodes, (K n), for x."""
        _, at, v = self._place(x)
        if self._values is None:
            self._values = self._action_and_gradient(at, v)
        return self._values

    def action_and_gradient(self, Q: Array) -> tuple[float, Array]:
        """Return S and grad S + sum w Q over all nodes, (K n), in the user's units."""
        at = Q[self.layout.node_of]
        return self._action_and_gradient(at, self.velocities(at))

    def _action_and_gradient(self, at: Array, v: Array) -> tuple[float, Array]:
        system, layout, p = self.problem.system, self.layout, self.problem.packed
        Lq, Lv, L = system.pointwise("first")(at, v, self.times, p)
        self.counts["first"] += 1
        contribution = self.weight * Lq
        if system.structure.forced:
            contribution += self.weight * system.pointwise("force")(at, v, self.times, p)[0]
            self.counts["force"] += 1
        for g in layout.groups:
            local = Lv[g.span].reshape(*g.nodes.shape, -1)
            # A constant momentum works at the element's ends only: taken out of the sum, its
            # round-off stays out of the nodes between.
            constant = local[:, 0]
            pull = g.rule.weighted.T @ (local - local[:, :1])
            pull[:, 0] -= constant
            pull[:, -1] += constant
            contribution[g.span] += pull.reshape(-1, at.shape[1])
        gradient = np.bincount(layout.scatter, contribution.ravel(), layout.node_count * system.n)
        return float(self.weight[:, 0] @ L[:, 0]), gradient

    def action(self, x: Array) -> float:
        """Return S in its own unit."""
        return self._first(x)[0] / self.action_unit

    def gradient(self, x: Array) -> Array:
        """Return dS/dx (with the virtual work of forces), in units of action."""
        whole = self._first(x)[1]
        free = whole[self.layout.free]
        if self.layout.closed:  # the last node moves with the first
            n = self.problem.system.n
            free[self.layout.free < n] += whole[-n:][self.layout.free[self.layout.free < n]]
        return free * (self.x_unit / self.action_unit)

    def constraint(self, x: Array) -> Array:
        """Return the weighted constraint rows w_k f(q_k, t_k)."""
        layout, p = self.layout, self.problem.packed
        Q = self._place(x)[0][layout.row_nodes]
        f = self.problem.system.pointwise("constraint")(Q, self.row_times, p)[0]
        self.counts["constraint"] += 1
        return (self.row_weight * f).ravel()[layout.row_select] / self.row_unit

    @cached_property
    def row_times(self) -> Array:
        """Times of the nodes with constraint rows, (R, 1)."""
        return self.mesh.nodes[self.layout.row_nodes][:, None]

    def residual(self, z: Array) -> Array:
        """Return the KKT residual r(z), shape (size,), zero at a stationary path."""
        layout = self.layout
        x = z[: layout.unknowns]
        g = self.gradient(x)
        if not layout.rows:
            return g
        J = layout.jacobian
        pull = np.bincount(J.col, self.jacobian(x) * z[layout.unknowns + J.row], layout.unknowns)
        return np.concatenate([g + pull, self.constraint(x)])

    # -- second derivatives ----------------------------------------------------------------------

    def _second(self, at: Array, v: Array) -> list[Array]:
        self.counts["second"] += 1
        return self.problem.system.pointwise("second")(at, v, self.times, self.problem.packed)

    def hessian(self, z: Array) -> Array:
        """Return the upper triangle's nonzeros of the Hessian of S + sum w lam f."""
        return self.layout.hessian.sum(self._curvatures(z)) * self._hessian_unit

    def _curvatures(self, z: Array) -> Array:
        """Return all contributions to the Hessian of S + sum w lam f, one after the other."""
        _, at, v = self._place(z[: self.layout.unknowns])
        A, B, C = self._second(at, v)
        stiff = self._stiffness(C) if self._stiff is None else self._stiff
        if self.problem.system.structure.constant_mass:
            self._stiff = stiff
        parts = [(self.weight * A).ravel(), *self._mixed_part(B, diagonal_twice=True), stiff]
        bent = self._constraint_curvature(z)
        return np.concatenate(parts if bent is None else [*parts, bent.ravel()])

    def _constraint_curvature(self, z: Array) -> Array | None:
        """Return w times the second derivatives of lam f at the rows' nodes, if there are any."""
        layout, system = self.layout, self.problem.system
        if not layout.rows or system.structure.affine_constraint:
            return None
        Q = self._place(z[: layout.unknowns])[0]
        lam = np.zeros(layout.row_nodes.size * system.m)
        lam[layout.row_select] = z[layout.unknowns :] * self.mu_unit
        curvature = system.pointwise("constraint_curvature")(
            Q[layout.row_nodes], lam.reshape(-1, system.m), self.row_times, self.problem.packed
        )[0]
        self.counts["constraint_curvature"] += 1
        return self.row_weight * curvature

    def _stiffness(self, C: Array) -> Array:
        parts = [
            (g.rule.stiffness @ (C[g.span].reshape(*g.nodes.shape, -1) / half)).ravel()
            for g, half in zip(self.layout.groups, self._halves, strict=True)
        ]
        return parts[0] if len(parts) == 1 else np.concatenate(parts)

    def _mixed_part(self, B: Array, diagonal_twice: bool) -> list[Array]:
        if not B.size:
            return []
        parts = []
        for g in self.layout.groups:
            local = B[g.span].reshape(*g.nodes.shape, -1)
            block = g.rule.weighted[None, :, :, None] * local[:, :, None, :]
            if diagonal_twice:
                rows, cols = sparsity_of(self.problem.system, "second", 1)
                k = np.arange(g.rule.degree + 1)
                # An entry on the diagonal receives B and its transpose.
                block[:, k[:, None], k[:, None], np.flatnonzero(rows == cols)] *= 2
            parts.append(block.ravel())
        return parts

    @cached_property
    def _hessian_unit(self) -> Array:
        H = self.layout.hessian
        return self.x_unit[H.row] * self.x_unit[H.col] / self.action_unit

    @cached_property
    def _whole_unit(self) -> Array:
        return self.x_unit[:, None] * self.x_unit / self.action_unit

    def _normals(self, x: Array) -> Array:
        """Return the nonzeros of G at the rows' nodes, (R, nonzeros)."""
        Q = self._place(x)[0][self.layout.row_nodes]
        self.counts["constraint_jacobian"] += 1
        function = self.problem.system.pointwise("constraint_jacobian")
        return function(Q, self.row_times, self.problem.packed)[0]

    def jacobian(self, x: Array) -> Array:
        """Return the nonzeros of the derivative of `constraint`."""
        J = self.layout.jacobian
        values = J.sum((self.row_weight * self._normals(x)).ravel())
        return values * self.x_unit[J.col] / self.row_unit[J.row]

    def kkt(self, z: Array) -> Array:
        """Return the nonzeros of the derivative of `residual`, stored as the layout says."""
        layout = self.layout
        if layout.storage == "blocks":
            return self._in_blocks(z)
        x = z[: layout.unknowns]
        J = self.jacobian(x) if layout.rows else np.zeros(0)
        F = self._forcing(x) if self.problem.system.structure.forced else np.zeros(0)
        return self._matrix(self._curvatures(z), J, F)

    def kinetic(self, z: Array) -> Array:
        """Return the kinetic part of the KKT matrix, D' w M D alone, stored as `kkt` is.

        Positive definite where the mass matrix is: the metric in which a step changes the
        velocities least. Only for systems without constraints or forces.
        """
        if self._metric is None or not self.problem.system.structure.constant_mass:
            self._metric = self._kinetic(z)
        return self._metric

    def _kinetic(self, z: Array) -> Array:
        _, at, v = self._place(z)
        C = self._second(at, v)[2]
        if self.layout.storage == "blocks":
            return np.concatenate(
                [
                    *(x.transpose(0, 1, 3, 2, 4).ravel() for x in self._stiff_blocks(C)),
                    np.zeros(self.layout.offsets.size * self.problem.system.n**2),
                ]
            )
        stiff = self._stiffness(C)
        rest = np.zeros(self.layout.contributions)
        rest[-stiff.size :] = stiff
        return self._matrix(rest, np.zeros(0), np.zeros(0))

    def _matrix(self, curvatures: Array, J: Array, F: Array) -> Array:
        """Return [H + F, J'; J, 0] from the contributions to H and the nonzeros of J and F."""
        layout = self.layout
        if layout.storage == "sparse":
            H = layout.hessian.sum(curvatures) * self._hessian_unit
            return layout.kkt.sum(np.concatenate([H, J, F, np.zeros(1)])[layout.kkt_source])
        cut = layout.unknowns
        H = np.bincount(layout.curvature_slots, curvatures, cut * cut + 1)[:-1].reshape(cut, cut)
        H *= self._whole_unit
        K = np.zeros((layout.size, layout.size))  # column by column: the transpose of the matrix
        K[:cut, :cut] = H + H.T
        K.ravel()[: cut * (layout.size + 1) : layout.size + 1] = H.diagonal()
        if J.size:
            at = layout.jacobian
            K[at.row + cut, at.col] = K[at.col, at.row + cut] = J
        if F.size:
            at = layout.forcing
            K[at.col, at.row] += F
        return K.ravel()

    def _forces(self, x: Array) -> list[Array]:
        """Return dQ/dq and dQ/dv at the evaluations."""
        _, at, v = self._place(x)
        self.counts["force_jacobian"] += 1
        function = self.problem.system.pointwise("force_jacobian")
        return function(at, v, self.times, self.problem.packed)

    def _forcing(self, x: Array) -> Array:
        """Return the nonzeros of the derivative of the virtual work."""
        Fq, Fv = self._forces(x)
        parts = [(self.weight * Fq).ravel(), *self._mixed_part(Fv, diagonal_twice=False)]
        F = self.layout.forcing
        unit = self.x_unit[F.row] * self.x_unit[F.col] / self.action_unit
        return F.sum(np.concatenate(parts)) * unit

    # -- the same in blocks ----------------------------------------------------------------------

    def _in_blocks(self, z: Array) -> Array:
        """Return the derivative of `residual` in blocks."""
        layout, system, n = self.layout, self.problem.system, self.problem.system.n
        x = z[: layout.unknowns]
        _, at, v = self._place(x)
        A, B, C = self._second(at, v)
        stiff = self._stiff_blocks(C) if self._rigid is None else self._rigid
        if system.structure.constant_mass:
            self._rigid = stiff
        slopes = [(self._full("second", 0, A), self._full("second", 1, B), True)]
        if system.structure.forced:
            Fq, Fv = self._forces(x)
            force = "force_jacobian"
            slopes.append((self._full(force, 0, Fq), self._full(force, 1, Fv), False))
        nonzeros = np.zeros(layout.blocks.count)
        elements, between = layout.blocks.split(nonzeros)
        at_nodes = self._constraint_blocks(z) if layout.rows else None
        for M, g, block in zip(elements, layout.groups, stiff, strict=True):
            inside = np.arange(g.rule.degree + 1)
            M = M.reshape(len(M), inside.size, layout.blocks.width, inside.size, -1)
            pairs = M[:, :, :n, :, :n].transpose(0, 1, 3, 2, 4)  # a view
            pairs[...] = block
            for a, b, symmetric in slopes:
                if b is not None:
                    local = b[g.span].reshape(*g.nodes.shape, 1, n, n)
                    mixed = g.rule.weighted[:, :, None, None] * local
                    pairs += mixed
                    if symmetric:
                        pairs += mixed.transpose(0, 2, 1, 4, 3)
                if a is not None:
                    local = self.weight[g.span][:, :, None] * a[g.span]
                    pairs[:, inside, inside] += local.reshape(*g.nodes.shape, n, n)
            if at_nodes is not None:
                k = inside[1:-1]
                M[:, k, :, k, :] += at_nodes[g.nodes[:, 1:-1]].swapaxes(0, 1)
        if at_nodes is not None:
            between += at_nodes[layout.offsets]
        return nonzeros

    def _stiff_blocks(self, C: Array) -> list[Array]:
        """Return D' w C D for the elements of each degree, (E, d + 1, d + 1, n, n)."""
        n = self.problem.system.n
        full = self._full("second", 2, C)
        assert full is not None  # a Lagrangian without any velocity has no motions
        return [
            (g.rule.stiffness @ (full[g.span].reshape(*g.nodes.shape, n * n) / half)).reshape(
                -1, g.rule.degree + 1, g.rule.degree + 1, n, n
            )
            for g, half in zip(self.layout.groups, self._halves, strict=True)
        ]

    def _full(self, function: str, output: int, values: Array) -> Array | None:
        """Return the nonzeros of an output as matrices (E, n, n) in the units of the unknowns."""
        if not values.shape[1]:
            return None
        n = self.problem.system.n
        row, col = sparsity_of(self.problem.system, function, output)
        full = np.zeros((len(values), n, n))
        scaled = values * (self.lengths[row] * self.lengths[col] / self.action_unit)
        full[:, row, col] = scaled
        if function == "second" and output != 1:  # upper triangles
            full[:, col, row] = scaled
        return full

    def _constraint_blocks(self, z: Array) -> Array:
        """Return [w lam f_qq, G'; G, 0] at each node, (K, n + m, n + m)."""
        layout, system = self.layout, self.problem.system
        f = system.n + system.m
        found = np.zeros((layout.node_count, f, f))
        node, row, col = layout.row_nodes[:, None], layout.G_rows + system.n, layout.G_cols
        # The units of the rows hold the nodes' weights already.
        unit = self.lengths[col] / self.row_units[layout.G_rows]
        found[node, row, col] = found[node, col, row] = self._normals(z[: layout.unknowns]) * unit
        bent = self._constraint_curvature(z)
        if bent is not None:
            row, col = sparsity_of(system, "constraint_curvature")
            bent = bent * (self.lengths[row] * self.lengths[col] / self.action_unit)
            found[node, row, col] = bent
            found[node, col, row] = bent
        return found

    # -- what follows at the ends ---------------------------------------------------------------

    def momenta(self, z: Array) -> tuple[Array, Array]:
        """Return p(t0) = -dS/dq0 and p(t1) = +dS/dq1, each (n,): Hamilton and Jacobi's identities.

        With constraints they are known only up to the constraints' normals.
        """
        gradient = self._first(z[: self.layout.unknowns])[1].reshape(self.layout.node_count, -1)
        return -gradient[0], gradient[-1].copy()
