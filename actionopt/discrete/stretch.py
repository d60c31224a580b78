"""How the discrete equations change as the boundaries of elements move in time.

The nodes keep their unknowns and their fractions s of the elements. Where a boundary moves at the
rate b, an element's length h at the rate h' = b_1 - b_0, velocities change by -v h' / h, times by
t' = b_0 + s h', and with them what the element's equations are made of:

    d(h L_q) = h (L_q - L_qv v) h' / h + h L_qt t',    d(L_v) = -L_vv v h' / h + L_vt t'.
"""

from __future__ import annotations

import numpy as np

from actionopt.discrete.discrete_path import DiscretePath
from actionopt.tools.types import Array


class Stretch:
    """The derivatives of a path's equations by the times of the boundaries, at fixed unknowns.

    Parameters
    ----------
    at : DiscretePath
        Of a system without non-conservative forces.
    """

    def __init__(self, at: DiscretePath) -> None:
        tr, system = at.tr, at.problem.system
        self.at, point, groups = at, tr.place(at.x), tr.layout.groups
        if not system.structure.steady:  # they are asked for again
            point.second = [x.copy() for x in tr.second(at.x)]
        self.second = tr.second(at.x)
        state, v = (point.at, point.v, tr.times, at.problem.packed), point.v
        self.element = np.concatenate([np.repeat(g.elements, g.rule.degree + 1) for g in groups])
        self.timed = system.structure.depends_on_time
        pointwise = system.pointwise("second")
        mixed = pointwise.product(1, self.second[1], v)
        mass = pointwise.product(2, self.second[2], v, symmetric=True)
        force, p, L = system.pointwise("first")(*state)
        self.own = tr.weight * (L + np.sum(v * (mass - p), axis=1, keepdims=True))
        self.longer = tr.weight * (force - mixed) - self._work(mass)
        self.longer /= tr.mesh.lengths[self.element, None]
        if self.timed:
            self.later = [x.copy() for x in system.pointwise("first_rate")(*state)]
            self.fraction = tr.times[:, 0] - tr.mesh.boundaries[self.element]
            self.fraction /= tr.mesh.lengths[self.element]

    def _work(self, p: Array) -> Array:
        """Return what momenta (evaluations, n) work at the nodes of their elements."""
        found = np.empty_like(p)
        for g in self.at.tr.layout.groups:
            local = p[g.span].reshape(*g.nodes.shape, -1)
            found[g.span] = (g.rule.weighted_derivative.T @ local).reshape(-1, p.shape[1])
        return found

    def _times(self, rates: Array) -> Array:
        """Return how times change at the evaluations, (evaluations, 1)."""
        change = rates[self.element] + self.fraction * np.diff(rates)[self.element]
        return change[:, None]

    def parts(self, rates: Array) -> Array:
        """Return how dS/dq of the elements changes, (evaluations, n), as boundaries (N + 1,) do."""
        found = self.longer * np.diff(rates)[self.element, None]
        if self.timed:
            t, (force, momentum) = self._times(rates), self.later
            found += self.at.tr.weight * t * force + self._work(t * momentum)
        return found

    def longer_by_time(self, rates: Array) -> float:
        """Return d2S/d(log T) of a direction in which boundaries (N + 1,) move, without a clock.

        In units of action: the sum of w (L - v.p + v.L_vv v) h' / h.
        """
        tr = self.at.tr
        part = (np.diff(rates) / tr.mesh.lengths)[self.element]
        return float(part @ self.own[:, 0]) / tr.action_unit

    def residual(self, rates: Array, parts: Array) -> Array:
        """Return how the residual changes, (size,); `parts` are those of the rates."""
        tr, layout = self.at.tr, self.at.tr.layout
        n, m = tr.problem.system.n, tr.problem.system.m
        whole = np.bincount(layout.scatter, parts.ravel(), layout.node_count * n)
        if not (self.timed and layout.rows):
            return np.concatenate([tr.free_part(whole), np.zeros(layout.rows)])
        t = np.empty((layout.node_count, 1))
        t[layout.node_of] = self._times(rates)
        t = t[layout.row_nodes]
        Q, times = self.at.Q[layout.row_nodes], tr.row_times
        lam = np.zeros(layout.row_nodes.size * m)
        units = tr.row_units[layout.row_constraint]
        lam[layout.row_select] = self.at.z[layout.unknowns : layout.size] / units * tr.action_unit
        pointwise, packed = tr.problem.system.pointwise, tr.problem.packed
        turned = pointwise("normal_rate")(Q, lam.reshape(-1, m), times, packed)[0]
        np.add.at(whole.reshape(-1, n), layout.row_nodes, t * turned)
        rows = t * pointwise("constraint_rate")(Q, times, packed)[0]
        return np.concatenate([tr.free_part(whole), rows.ravel()[layout.row_select] / units])
