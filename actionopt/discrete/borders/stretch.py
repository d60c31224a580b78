"""How the action and its equations change as the boundaries of elements move in time.

The nodes keep their unknowns and their fractions s of the elements. Where a boundary moves at the
rate b, an element's length h at the rate h' = b_1 - b_0, velocities change by -v h' / h, times by
t' = b_0 + s h', and with them the action and what its gradient is made of, p = L_v:

    dS = sum w [(L - v.p) h' / h + L_t t'],
    d(w L_q) = w (L_q - L_qv v) h' / h + w L_qt t',    d(L_v) = -L_vv v h' / h + L_vt t',
    d2S = sum w [v.L_vv v (h' / h)^2 + 2 (L_t - v.p_t) t' h' / h + L_tt t'^2],

and constraints f(q, t) = 0 add sum w lam f_t t' and sum w lam f_tt t'^2.

In higher orders, the state y = (q, v, ...) changes by D h' / h (`Action.shifts`), with D = (0, -v)
for the first, and to second order by D2:

    dS = sum w [(L + D.L_y) h' / h + ...],
    d2S = sum w [(D.L_yy D + D.L_y + D2.L_y) (h' / h)^2 + ...].
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from actionopt.discrete.borders.stretched_rows import StretchedRows
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.mechanics.laws.compiled import Pointwise
from actionopt.mechanics.laws.laws import keep
from actionopt.mechanics.system import System
from actionopt.tools.cached import cached_property
from actionopt.tools.tape import parameter_gradient
from actionopt.tools.types import Array, NDInt


class Stretch:
    """The derivatives of the action and of a path's equations as boundaries move, z kept.

    The boundaries of the elements move at the `rates` (J, N + 1) with each of J times. The system
    has no non-conservative forces.
    """

    def __init__(self, at: DiscretePath, rates: Array) -> None:
        tr = at.tr
        self.at, self.rates, self.weight = at, rates, tr.weight[:, 0]
        self.timed = at.problem.system.structure.depends_on_time
        self._element = tr.layout.element_of
        # h' / h at the evaluations, (J, evaluations)
        self.longer = ((rates[:, 1:] - rates[:, :-1]) / tr.mesh.lengths)[:, self._element]
        self._first, point = tr.first(at.x), tr.place(at.x)  # L_q, p and L
        self._state = point.at, point.v, tr.times, at.problem.packed

    @cached_property
    def later(self) -> Array:
        """How times change at the evaluations, t', (J, evaluations)."""
        tr = self.at.tr
        since = tr.mesh.nodes_since[tr.layout.node_of] - tr.mesh.since[self._element]
        return self.rates[:, self._element] + since * self.longer

    @cached_property
    def second(self) -> list[Array]:
        """The nonzeros of the second derivatives of L."""
        self.at.tr.keep_second(self.at.x)  # asked for again
        return self.at.tr.second(self.at.x)

    @cached_property
    def _products(self) -> tuple[Array, Array]:
        """L_yy D by its parts in q and in v; where the order is one, -L_qv v and -L_vv v."""
        pointwise, (A, B, C) = self.at.problem.system.pointwise("second"), self.second
        below, highest = self._shifts[0]
        mixed = pointwise.product(1, B, highest).copy()
        mass = pointwise.product(2, C, highest, symmetric=True).copy()
        if below is not None:
            mixed += pointwise.product(0, A, below, symmetric=True)
            mass += pointwise.product(1, B, below, transposed=True)
        return mixed, mass

    @cached_property
    def _shifts(self) -> list[tuple[Array | None, Array]]:
        """D and D2, each by its parts in q, None for zero, and in v."""
        tr, v = self.at.tr, self._state[1]
        if tr.order == 1:
            return [(None, -v), (None, v)]
        n = v.shape[1]
        return [(x[:, :-n], x[:, -n:]) for x in tr.shifts(tr.place(self.at.x).places)]

    @cached_property
    def _rows(self) -> StretchedRows | None:
        """What holds a path with accelerations on an obstacle, if anything does."""
        tr = self.at.tr
        if tr.order == 1 or not tr.layout.rows:
            return None
        n = self.at.problem.system.n
        (first, _), (second, _) = self._shifts
        assert first is not None and second is not None
        return StretchedRows(self.at, self.longer, self.later, (first[:, :n], second[:, :n]))

    @cached_property
    def _clock(self) -> list[Array]:
        """L_qt, p_t, L_t, and L_tt + sum lam f_tt."""
        at, system = self.at, self.at.problem.system
        lam = np.zeros((at.tr.layout.evaluations, system.m))
        if self._rows is not None:
            lam = self._rows.lam
        elif at.tr.order == 1:
            lam = np.nan_to_num(at.rows)[at.tr.layout.node_of]
        return [x.copy() for x in _clock_derivatives(system)(*self._state, lam)]

    def _along(self, which: int, by_q: Array, by_v: Array) -> Array:
        """Return D.L_y (0) or D2.L_y (1) at the evaluations, for what stands for L_q and L_v."""
        below, highest = self._shifts[which]
        found = np.einsum("ki,ki->k", highest, by_v)
        return found if below is None else found + np.einsum("ki,ki->k", below, by_q)

    def sums(self, L: Array, by_q: Array, by_v: Array, by_t: Array | float) -> Array:
        """Return how sum w L changes, (J,), for L and its derivatives."""
        change = self.longer @ (self.weight * (L + self._along(0, by_q, by_v)))
        if not self.timed:
            return change
        moved = np.where(self.later, by_t, 0.0)  # an infinite L_t matters where times move alone
        return change + (self.weight * self.later * moved).sum(axis=1)

    def slopes(self, lam: Array | None = None) -> Array:
        """Return dS, (J,), in the user's units; with constraints L stands for L + sum lam f.

        The multipliers lam (K, m) are those of the rows if None: a pinned end has none.
        """
        force, p, L = self._first
        by_t = 0.0
        if self.timed:
            at, system = self.at, self.at.problem.system
            if system.m and at.tr.order == 1:
                lam = np.nan_to_num(at.rows) if lam is None else lam
                lam = lam[at.tr.layout.node_of]
                by_t = explicit(system)(*self._state, lam)[0][:, 0].copy()
            else:
                by_t = system.pointwise("rate")(*self._state)[0][:, 0].copy()
        found = self.sums(L[:, 0], force, p, by_t)
        return found if self._rows is None else found + self._rows.work()

    @cached_property
    def parts(self) -> Array:
        """How dS/dq of the elements changes, (J, evaluations, n)."""
        tr, (force, p, _), (mixed, mass) = self.at.tr, self._first, self._products
        if tr.order == 1:
            own = tr.pull_back(force + mixed, mass)
        else:
            n, order = p.shape[1], tr.order
            fewer = force * (1 - np.repeat(np.arange(order), n))
            own = tr.pull_back(fewer + mixed, (1 - order) * p + mass)
            own += tr.pull_back(force, p) * tr.layout.derivative[:, None]
        found = self.longer[:, :, None] * own
        # The work of L_vv v h' / h is that of L_vv v, times h' / h of the element.
        if self.timed:
            by_q, by_v = self._clock[:2]
            for part, later in zip(found, self.later[:, :, None], strict=True):
                part += tr.pull_back(later * by_q, later * by_v)
        return found

    def residuals(self) -> Array:
        """Return how the residual of the path's equations changes, (size, J)."""
        tr, layout = self.at.tr, self.at.tr.layout
        found = np.zeros((layout.size, len(self.rates)))
        for j, part in enumerate(self.parts):
            found[: layout.unknowns, j] = tr.at_unknowns(part)
        if self._rows is not None:
            self._rows.add_residuals(found)
        elif self.timed and layout.rows:
            self._add_rows(found)
        return found

    def _add_rows(self, found: Array) -> None:
        """Add what the constraints change by, and with them the forces that keep them."""
        at, tr, layout = self.at, self.at.tr, self.at.tr.layout
        n, m = tr.problem.system.n, tr.problem.system.m
        Q, times = at.Q[layout.row_nodes], tr.row_times
        lam = np.zeros(layout.row_nodes.size * m)
        units = tr.row_units[layout.row_constraint]
        lam[layout.row_select] = at.z[layout.unknowns : layout.size] / units * tr.action_unit
        pointwise, packed = tr.problem.system.pointwise, tr.problem.packed
        turned = pointwise("normal_rate")(Q, lam.reshape(-1, m), times, packed)[0].copy()
        moving = pointwise("constraint_rate")(Q, times, packed)[0].copy()
        later = np.empty((layout.node_count, len(self.rates)))
        later[layout.node_of] = self.later.T
        for j, t in enumerate(later[layout.row_nodes].T[:, :, None]):
            whole = np.zeros((layout.node_count, n))
            np.add.at(whole, layout.row_nodes, t * turned)
            found[: layout.unknowns, j] += tr.free_part(whole.ravel())
            found[layout.unknowns :, j] = (t * moving).ravel()[layout.row_select] / units

    def twice(self) -> Array:
        """Return d2S, (J, J), in the user's units."""
        force, p, _ = self._first
        bent = self._along(0, *self._products)
        if self.at.tr.order > 1:  # else they cancel
            bent += self._along(0, force, p) + self._along(1, force, p)
        found = (self.longer * (self.weight * bent)) @ self.longer.T
        if self.timed:
            by_q, by_v, by_t, by_tt = self._clock
            off = self.weight * (by_t[:, 0] + self._along(0, by_q, by_v))
            mixed = (self.longer * off) @ self.later.T
            found += mixed + mixed.T + (self.later * (self.weight * by_tt[:, 0])) @ self.later.T
        return found if self._rows is None else found + self._rows.work_twice()


def by_joints(at: DiscretePath, events: NDInt | slice = slice(None)) -> Stretch:
    """Return the derivatives by the times of all events, or of some."""
    return Stretch(at, at.tr.joint_rates[events])


@keep
def explicit(system: System) -> Pointwise:
    """Return the function (q, v, t, p, lam) -> derivatives by t and p of L + sum lam f."""
    s = system.symbols
    lam = ca.SX.sym("lam", system.m)
    L = system.L + (ca.dot(lam, system.f) if system.m else 0)
    by_time = ca.densify(ca.jacobian(L, s.t))
    by_parameters = parameter_gradient(L, s.p)
    function = ca.Function("explicit", [s.q, s.v, s.t, s.p, lam], [by_time, by_parameters])
    return Pointwise(function)


@keep
def _clock_derivatives(system: System) -> Pointwise:
    """Return the function of L_qt, L_vt, L_t, and L_tt + sum lam f_tt."""
    s, lam = system.symbols, ca.SX.sym("lam", system.m)
    rate = ca.jacobian(system.L, s.t)
    whole = rate + (ca.dot(lam, ca.jacobian(system.f, s.t)) if system.m else 0)
    outputs = [ca.jacobian(rate, s.q).T, ca.jacobian(rate, s.v).T, rate, ca.jacobian(whole, s.t)]
    function = ca.Function("clocked", [s.q, s.v, s.t, s.p, lam], [ca.densify(x) for x in outputs])
    return Pointwise(function)
