"""How rows that hold a path with accelerations on an obstacle change as boundaries move.

A row is c = sum R h^k f over the evaluations of its elements (`Element.contact`), f of q, which
shifts with the length h of an element where what is unknown is a derivative, and of the time:

    f' = f_q D h' / h + f_t t',    c' = sum R h^k (f' + k f h' / h).

Multipliers are unknown in units of their rows, which grow with h, too; their work mu.c is part of
what is stationary, and has the derivatives mu.(c' - c u' / u) by the times. Of its second ones
terms in c are left out: it vanishes at a path.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.tools.types import Array


class StretchedRows:
    """The derivatives of rows in contact and of their work as boundaries move, z kept.

    By h' / h (`longer`) and t' (`later`), (J, evaluations) each, and the `shifts` (evaluations, n)
    of q with log h, to first and to second order.
    """

    def __init__(
        self, at: DiscretePath, longer: Array, later: Array, shifts: tuple[Array, Array]
    ) -> None:
        self.at, self.tr, self.layout = at, at.tr, at.tr.layout
        self.longer, self.later, self.shift, self.shift_twice = longer, later, *shifts
        system, packed, tr = at.problem.system, at.problem.packed, self.tr
        pointwise, n = system.pointwise, system.n
        state = tr.place(at.x).at[:, :n], tr.times
        self.m = system.m
        self.kept, self.lam = tr.row_multipliers(at.z), tr.multipliers_between(at.z)
        jacobian, curvature = pointwise("constraint_jacobian"), pointwise("constraint_curvature")
        G, f = (x.copy() for x in jacobian(*state, packed))
        self.G, self.f = jacobian.full(0, G), f
        bent = curvature(state[0], self.lam, state[1], packed)[0]
        bent = curvature.full(0, bent, symmetric=True)
        self.bent = np.einsum("kij,kj->ki", bent, self.shift)
        self.turned = pointwise("normal_rate")(state[0], self.lam, state[1], packed)[0].copy()
        moving = pointwise("constraint_rate")(*state, packed)[0].copy()
        along = np.einsum("kmn,kn->km", self.G, self.shift)
        # f' at the evaluations, (J, evaluations, m)
        self.rates = along * longer[:, :, None] + moving * later[:, :, None]

    def _add(self, rows: Array, values: Array, longer: Array) -> None:
        """Add to rows (K, order m) what values (evaluations, m) are, and h^k with f at them."""
        tr, layout, m = self.tr, self.layout, self.m
        for k, (g, shape) in enumerate(zip(layout.groups, layout.shapes, strict=True)):
            each, points = tr.contact_rows(k), g.nodes.shape
            grown = shape.contact[1][:, None] * longer[g.span].reshape(points)[:, :1, None]
            part = each @ values[g.span].reshape(*points, m)
            part += grown * (each @ self.f[g.span].reshape(*points, m))
            at = shape.derivative[:, None] * m + np.arange(m)
            np.add.at(rows, (g.nodes[:, shape.node][:, :, None], at), part)
        if layout.closed:
            rows[0] += rows[-1]

    @cached_property
    def rows(self) -> Array:
        """c', (J, K, order m)."""
        found = np.zeros((len(self.longer), *self.layout.row_number.shape))
        for rows, values, longer in zip(found, self.rates, self.longer, strict=True):
            self._add(rows, values, longer)
        return found

    @cached_property
    def units(self) -> Array:
        """How the logarithms of the units of rows change, u' / u, (J, K, order)."""
        tr, layout = self.tr, self.layout
        found = np.zeros((len(self.longer), layout.node_count, tr.order))
        whole = np.zeros(found.shape[1:])
        for k, (g, shape) in enumerate(zip(layout.groups, layout.shapes, strict=True)):
            part = tr.contact_row_weights(k)
            power = 2 * tr.order - 1 + shape.contact[1] + shape.derivative
            at = g.nodes[:, shape.node], shape.derivative
            np.add.at(whole, at, part)
            for each, longer in zip(found, self.longer, strict=True):
                np.add.at(each, at, part * power * longer[g.span].reshape(g.nodes.shape)[:, :1])
        if layout.closed:
            for x in (*found, whole):
                x[0] += x[-1]
        return found / np.where(whole > 0, whole, 1.0)

    @cached_property
    def changes(self) -> Array:
        """How the rows change in their units, times these: c' - c u' / u, (J, rows)."""
        at = self.layout.row_node, self.layout.row_constraint
        units = np.repeat(self.units, self.m, axis=2)
        own = self.tr.constraint(self.at.x) * self.tr.row_unit
        return self.rows[:, *at] - own * units[:, *at]

    def _weigh(self, factors: Array) -> Array:
        """Return sum_a R_ak h^k mu_a, (evaluations, m), of what elements' multipliers are times.

        `factors` (evaluations,) are those of each element's functions.
        """
        tr, layout, m = self.tr, self.layout, self.m
        found = np.zeros((layout.evaluations, m))
        kept = self.kept.reshape(len(self.kept), tr.order, m)
        for k, (g, shape) in enumerate(zip(layout.groups, layout.shapes, strict=True)):
            own = kept[g.nodes[:, shape.node], shape.derivative]
            own = own * factors[g.span].reshape(g.nodes.shape)[:, :, None]
            found[g.span] = np.einsum("eak,eai->eki", tr.contact_rows(k), own).reshape(-1, m)
        return found

    @cached_property
    def powers(self) -> Array:
        """The powers k of the elements' functions, (evaluations,)."""
        found = np.empty(self.layout.evaluations)
        for g, shape in zip(self.layout.groups, self.layout.shapes, strict=True):
            found[g.span] = np.broadcast_to(shape.contact[1], g.nodes.shape).ravel()
        return found

    def _units_by_function(self, units: Array) -> Array:
        """Return for the elements' functions, (evaluations,), what rows (K, order) have."""
        found = np.empty(self.layout.evaluations)
        for g, shape in zip(self.layout.groups, self.layout.shapes, strict=True):
            found[g.span] = units[g.nodes[:, shape.node], shape.derivative].ravel()
        return found

    def add_residuals(self, found: Array) -> None:
        """Add to how the residual changes, (size, J): what holds f, and the forces that do."""
        tr, layout, n = self.tr, self.layout, self.at.problem.system.n
        none = np.zeros((layout.evaluations, layout.width - n))
        # What weights of evaluations are made of does not change: forces are held as they are.
        force = np.concatenate([self._pull(self.lam), none], axis=1)
        force = tr.pull_back(force, np.zeros((layout.evaluations, n)))
        for j, (longer, later) in enumerate(zip(self.longer, self.later, strict=True)):
            change = self.powers * longer - self._units_by_function(self.units[j])
            work = self.bent * longer[:, None] + self.turned * later[:, None]
            work += self._pull(self._weigh(change) / tr.weight)
            parts = tr.pull_back(np.concatenate([work, none], axis=1), np.zeros(work.shape))
            parts += force * (layout.derivative * longer)[:, None]
            found[: layout.unknowns, j] += tr.at_unknowns(parts)
            found[layout.unknowns : layout.size, j] += self.changes[j] / tr.row_unit

    def _pull(self, lam: Array) -> Array:
        """Return G' lam, (evaluations, n)."""
        return np.einsum("kmn,km->kn", self.G, lam)

    def work(self) -> Array:
        """Return how the work of the rows changes, mu.(c' - c u' / u), (J,)."""
        return self.changes @ self.kept[self.layout.row_node, self.layout.row_constraint]

    def work_twice(self) -> Array:
        """Return its second derivatives, (J, J), but for lam.f_tt and for terms in c."""
        weight = self.tr.weight[:, 0]
        twice = np.sum(self.bent * self.shift, 1)
        twice += np.sum(self._pull(self.lam) * (self.shift_twice - self.shift), 1)
        falling = self.powers * (self.powers - 1)
        both = weight * twice + np.sum(self._weigh(falling) * self.f, 1)
        found = (self.longer * both) @ self.longer.T
        once = weight * np.sum(self.turned * self.shift, 1)
        mixed = (self.longer * once) @ self.later.T
        mixed += self.longer @ np.sum(self._weigh(self.powers) * self.rates, 2).T
        units = np.repeat(self.units, self.m, axis=2)
        mixed -= np.einsum("ikr,jkr,kr->ij", self.rows, units, self.kept)
        return found + mixed + mixed.T
