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
from functools import cached_property

import numpy as np

from actionopt.path import Mesh
from actionopt.problem import Problem
from actionopt.quadrature import Array
from actionopt.transcription.layout import Group, layout_for, sparsity_of


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
        self.layout = layout_for(problem, mesh.degrees)
        self.counts: Counter[str] = Counter()
        layout, n = self.layout, problem.system.n
        self.half = mesh.lengths / 2
        nodes = mesh.nodes
        self.times = nodes[layout.node_of][:, None]
        weight = np.empty(layout.evaluations)
        for g in layout.groups:
            weight[g.span] = (self.half[g.elements][:, None] * g.rule.weights).ravel()
        self.weight = weight[:, None]
        self.ends = np.zeros((layout.node_count, n))
        for k, event in ((0, problem.start), (-1, problem.end)):
            self.ends[k] = [0.0 if x is None else x for x in event.q]
        self.x_unit = np.broadcast_to(lengths, self.ends.shape).ravel()[layout.free]
        self._last: tuple[Array, tuple] | None = None
        self._fixed_stiffness: list | None = None
        # Nonzeros of the mass matrix half way along the straight line, its upper triangle.
        self.inertia = np.zeros(0) if like is None else like.inertia
        self.action_unit, self.row_units = (
            self._units() if like is None else (like.action_unit, like.row_units)
        )
        node_weight = np.bincount(layout.node_of, weight, layout.node_count)
        if layout.closed:
            node_weight[0] += node_weight[-1]
        self.row_weight = node_weight[layout.row_nodes][:, None]
        # Rows w f are scaled to gradients of size one, whatever the element's length.
        self.row_unit = node_weight[layout.row_node] * self.row_units[layout.row_constraint]
        self.mu_unit = self.action_unit / self.row_unit

    def _units(self) -> tuple[float, Array]:
        """Return the unit of action and of each constraint's row, from typical curvatures."""
        system, problem = self.problem.system, self.problem
        Q = self.straight()
        duration = problem.duration
        _, _, C = self._second(Q[self.layout.node_of])
        rows, cols = sparsity_of(system, "second", 2)
        self.inertia = C[len(C) // 2].copy()
        diagonal = np.abs(C[:, rows == cols]) * self.lengths[rows[rows == cols]] ** 2 / duration
        good = diagonal[np.isfinite(diagonal) & (diagonal > 0)]
        unit = float(np.median(good)) if good.size else 1.0
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
        v = np.empty_like(at)
        for g in self.layout.groups:
            q = at[g.span].reshape(*g.nodes.shape, -1)
            q = q - q[:, :1]  # a constant has no velocity, nor the round-off of one
            rate = (1 / self.half[g.elements])[:, None, None]
            v[g.span] = (rate * (g.rule.derivative @ q)).reshape(-1, at.shape[1])
        return v

    def _first(self, x: Array) -> tuple[float, Array]:
        """Return S and its gradient (virtual work included) at all nodes, (K n), for x."""
        if self._last is not None and np.array_equal(self._last[0], x):
            return self._last[1]
        result = self.action_and_gradient(self.coordinates(x))
        self._last = (x.copy(), result)
        return result

    def action_and_gradient(self, Q: Array) -> tuple[float, Array]:
        """Return S and grad S + sum w Q over all nodes, (K n), in the user's units."""
        system, layout, p = self.problem.system, self.layout, self.problem.packed
        at = Q[layout.node_of]
        v = self.velocities(at)
        Lq, Lv, L = system.pointwise("first")(at, v, self.times, p)
        self.counts["first"] += 1
        contribution = self.weight * Lq
        if system.structure.forced:
            contribution += self.weight * system.pointwise("force")(at, v, self.times, p)[0]
            self.counts["force"] += 1
        for g in layout.groups:
            wD = g.rule.weights[:, None] * g.rule.derivative
            local = Lv[g.span].reshape(*g.nodes.shape, -1)
            # A constant momentum works at the element's ends only: taken out of the sum, its
            # round-off stays out of the nodes between.
            constant = local[:, 0].copy()
            pull = wD.T @ (local - constant[:, None])
            pull[:, 0] -= constant
            pull[:, -1] += constant
            contribution[g.span] += pull.reshape(-1, at.shape[1])
        gradient = np.bincount(layout.scatter, contribution.ravel(), Q.size)
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
        Q = self.coordinates(x)[layout.row_nodes]
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

    def _second(self, at: Array) -> list[Array]:
        system = self.problem.system
        self.counts["second"] += 1
        return system.pointwise("second")(at, self.velocities(at), self.times, self.problem.packed)

    def hessian(self, z: Array) -> Array:
        """Return the upper triangle's nonzeros of the Hessian of S + sum w lam f."""
        layout, system = self.layout, self.problem.system
        structure = system.structure
        Q = self.coordinates(z)
        A, B, C = self._second(Q[layout.node_of])
        if self._fixed_stiffness is None or not structure.constant_mass:
            stiff = [self._stiff_part(g, C) for g in layout.groups]
            if structure.constant_mass:
                self._fixed_stiffness = stiff
        else:
            stiff = self._fixed_stiffness
        parts: list[Array] = [(self.weight * A).ravel()]
        parts += self._mixed_part(B, diagonal_twice=True)
        parts += stiff
        if layout.rows and not structure.affine_constraint:
            lam = np.zeros(layout.row_nodes.size * system.m)
            lam[layout.row_select] = z[layout.unknowns :] * self.mu_unit
            curvature = system.pointwise("constraint_curvature")(
                Q[layout.row_nodes], lam.reshape(-1, system.m), self.row_times, self.problem.packed
            )[0]
            self.counts["constraint_curvature"] += 1
            parts.append((self.row_weight * curvature).ravel())
        H = layout.hessian
        return H.sum(np.concatenate(parts)) * self._hessian_unit

    def kinetic(self, z: Array) -> Array:
        """Return the kinetic part of the KKT matrix, D' w M D alone, on the pattern of `kkt`.

        Positive definite where the mass matrix is: the metric in which a step changes the
        velocities least. Only for systems without constraints or forces.
        """
        H = self.layout.hessian
        _, _, C = self._second(self.coordinates(z)[self.layout.node_of])
        stiff = np.concatenate([self._stiff_part(g, C) for g in self.layout.groups])
        rest = np.zeros(H.slots.size)
        rest[-stiff.size :] = stiff
        return self.layout.kkt.sum((H.sum(rest) * self._hessian_unit)[self.layout.kkt_source])

    def _stiff_part(self, g: Group, C: Array) -> Array:
        local = C[g.span].reshape(*g.nodes.shape, -1) / self.half[g.elements][:, None, None]
        return (g.stiffness @ local).ravel()

    def _mixed_part(self, B: Array, diagonal_twice: bool) -> list[Array]:
        parts = []
        for g in self.layout.groups:
            local = B[g.span].reshape(*g.nodes.shape, -1)
            wD = g.rule.weights[:, None] * g.rule.derivative
            block = wD[None, :, :, None] * local[:, :, None, :]
            if diagonal_twice and block.size:
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

    def jacobian(self, x: Array) -> Array:
        """Return the nonzeros of the derivative of `constraint`."""
        layout, system = self.layout, self.problem.system
        Q = self.coordinates(x)[layout.row_nodes]
        G = system.pointwise("constraint_jacobian")(Q, self.row_times, self.problem.packed)[0]
        self.counts["constraint_jacobian"] += 1
        J = layout.jacobian
        return J.sum((self.row_weight * G).ravel()) * self.x_unit[J.col] / self.row_unit[J.row]

    def kkt(self, z: Array) -> Array:
        """Return the nonzeros of the derivative of `residual`."""
        layout = self.layout
        pattern = layout.kkt
        x = z[: layout.unknowns]
        parts = [self.hessian(z)]
        if layout.rows:
            parts.append(self.jacobian(x))
        if self.problem.system.structure.forced:
            at = self.coordinates(x)[layout.node_of]
            Fq, Fv = self.problem.system.pointwise("force_jacobian")(
                at, self.velocities(at), self.times, self.problem.packed
            )
            self.counts["force_jacobian"] += 1
            parts.append(self._forcing(Fq, Fv))
        if layout.rows:
            parts.append(np.zeros(1))
        return pattern.sum(np.concatenate(parts)[layout.kkt_source])

    def _forcing(self, Fq: Array, Fv: Array) -> Array:
        parts = [(self.weight * Fq).ravel(), *self._mixed_part(Fv, diagonal_twice=False)]
        F = self.layout.forcing
        unit = self.x_unit[F.row] * self.x_unit[F.col] / self.action_unit
        return F.sum(np.concatenate(parts)) * unit

    # -- what follows at the ends ---------------------------------------------------------------

    def momenta(self, z: Array) -> tuple[Array, Array]:
        """Return p(t0) = -dS/dq0 and p(t1) = +dS/dq1, each (n,): Hamilton and Jacobi's identities.

        With constraints they are known only up to the constraints' normals.
        """
        gradient = self._first(z[: self.layout.unknowns])[1].reshape(self.layout.node_count, -1)
        return -gradient[0], gradient[-1].copy()
