"""The discrete action on a mesh: its value, its gradient, and what its derivatives are made of.

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

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import numpy as np

from actionopt.discrete.matrices.layout import layout_for
from actionopt.discrete.meshes.boundaries import boundaries_at, find_boundaries, sides
from actionopt.discrete.meshes.mesh import Mesh, rise, with_singular_ends
from actionopt.discrete.meshes.nodal import Term, rest_action, terms
from actionopt.mechanics.question.problem import Problem
from actionopt.mechanics.question.scales import diagonal, ends_of
from actionopt.tools.blas import by_each
from actionopt.tools.cached import cached_property
from actionopt.tools.immutable import make_unchecked
from actionopt.tools.lobatto import RESTING
from actionopt.tools.types import Array, NDInt
from actionopt.tools.watch import Watch, check_time

# Rates are measured by this over the duration: about the elements of a mesh. Ad hoc.
RATE = 8.0


@dataclass(eq=False, slots=True)
class Evaluations:
    """The results for some unknowns, to be used again; `x` are their bytes, soon compared.

    Coordinates Q (K, n) at the nodes; coordinates and velocities at the evaluations, `at` and `v`,
    both (evaluations, n), or all derivatives but the highest and that one
    (`mechanics.laws.tracing`). The `places` (K, width) of the nodes are Q where the order is one.
    """

    x: bytes
    places: Array
    Q: Array
    at: Array
    v: Array
    first: list[Array] | None = None
    values: tuple[float, Array, Array] | None = None
    second: list[Array] | None = None
    rows: tuple[Array, Array] | None = None  # the constraints' normals and values
    between: tuple[Array, ...] | None = None  # q, v, L_q, L_v, L and dL/dt elsewhere


class ActionUnits(NamedTuple):
    """The origin of coordinates, an inertia, and the units of action and of constraints' rows.

    And a rate: derivatives are measured in units of `lengths` times its powers.
    """

    origin: Array | None
    inertia: Array
    action_unit: float
    row_units: Array
    rate: float


class Action:
    """The discrete action of one problem on one mesh.

    Vectors z = (x, mu) hold the free coordinates, measured from the problem's `origin` in units of
    `lengths`, node by node, and the multipliers of the rows in units of their own. `counts` says
    how often each function was evaluated.

    Parameters
    ----------
    problem : Problem
    mesh : Mesh
        Over the times of the problem's events.
    lengths : (n,) array
        Unit of each coordinate.
    like : Action, optional
        One of a neighbouring problem on a mesh of the same shape, whose origin and units of action
        and of the rows are taken, so that vectors z mean the same to both.
    """

    def __init__(
        self,
        problem: Problem,
        mesh: Mesh,
        lengths: Array,
        *,
        like: Action | ActionUnits | None = None,
    ) -> None:
        mesh = with_singular_ends(mesh, problem.singular_ends)
        self.problem, self.mesh, self.lengths = problem, mesh, lengths
        self.order = problem.system.order  # that of the highest derivative in the Lagrangian
        self.nodal = terms(problem, mesh)
        nodal = tuple(term.node for term in self.nodal)
        if any(event.on is not None for event in problem.joints_found):
            at = zip(self.joints.tolist(), problem.joints_found, strict=True)
            nodal += tuple(node for node, event in at if event.on is not None)
        self.layout = layout_for(problem, mesh, nodal)
        self.counts: Counter[str] = Counter()
        self.watch: Watch | None = None  # called with each second derivative
        layout, n = self.layout, problem.system.n
        self._measure_times()
        self.rest = rest_action(problem, self.times, self.weight) if self.nodal else 0.0
        self.ends = self._ends()
        # Vectors z are to mean the same on another mesh, over other times.
        self.rate = RATE / problem.duration if like is None else like.rate
        self.place_units = lengths
        if problem.system.order > 1:
            powers = self.rate ** np.arange(problem.system.order)
            self.place_units = (powers[:, None] * lengths).ravel()
        self.x_unit = self.place_units[layout.free % layout.width]
        self.origin = problem.origin if like is None else like.origin
        self.x_origin = None if self.origin is None else self.origin[layout.free % n]
        self._point: Evaluations | None = None
        self._kept: dict[str, Any] = {}
        self.unfolded: dict[tuple[str, int], tuple[Array, Array]] = {}
        # Nonzeros of the mass matrix half way along the straight line, its upper triangle.
        self.inertia = np.zeros(0) if like is None else like.inertia
        self.action_unit, self.row_units = (
            self._units() if like is None else (like.action_unit, like.row_units)
        )
        self.gradient_unit = self.x_unit / self.action_unit
        self.row_weight, self.row_unit = self._row_measures(self.weight[:, 0])
        self.mu_unit = self.action_unit / self.row_unit

    def _measure_times(self) -> None:
        """Set the times of the evaluations, and their weights."""
        problem, mesh, layout = self.problem, self.mesh, self.layout
        self.sides = sides(mesh, problem.instants) if problem.instants else None
        self.times = np.concatenate(
            [self.element_times(g.elements, mesh.nodes[g.nodes]) for g in layout.groups]
        )
        at, beside = layout.unseen
        if at.size:
            self.times[at] = self.times[beside]
        self.half = mesh.lengths / 2
        self.halves = [self.half[g.elements][:, None, None] for g in layout.groups]
        weights = [
            (h[:, 0] * g.rule.weights).ravel()
            for h, g in zip(self.halves, layout.groups, strict=True)
        ]
        self.weight = np.concatenate(weights)[:, None]

    def _row_measures(self, weight: Array) -> tuple[Array, Array]:
        """Return the weights of the rows, and the units of each, by those of evaluations."""
        layout = self.layout
        if not layout.rows:
            return np.zeros((0, 1)), np.zeros(0)
        units = self.row_units[layout.row_constraint]
        if self.order > 1:
            weights = self._row_weights()
            which = layout.row_constraint // self.problem.system.m
            return weights, weights[layout.row_node, which] * units
        node_weight = np.bincount(layout.node_of, weight, layout.node_count)
        if layout.closed:
            node_weight[0] += node_weight[-1]
        # Rows w f are scaled to gradients of size one, whatever the element's length.
        return node_weight[layout.row_nodes][:, None], node_weight[layout.row_node] * units

    def _ends(self) -> Array:
        """Return the places that are given, (K, width), and zeros."""
        ends, problem = np.zeros((self.layout.node_count, self.layout.width)), self.problem
        for k, event in zip(
            self.joints if problem.through else (0, -1), problem.joints_found, strict=True
        ):
            given = event.q if self.order == 1 else event.places(self.order)
            ends[k] = [0.0 if x is None else x for x in given]
        return ends

    @cached_property
    def joints(self) -> NDInt:
        """Nodes at the events of the problem, (k + 2,)."""
        through = self.problem.through
        inner = find_boundaries(self.mesh, np.array([e.t for e in through])) if through else []
        return self.mesh.offsets[[0, *inner, -1]]

    @cached_property
    def joint_rates(self) -> Array:
        """The rates (k + 2, N + 1) at which boundaries move with the time of each event.

        Legs are stretched between their events. Where laws take turns they do so at the events;
        other switches of the clock, and pulses, stay where they are.
        """
        since = self.mesh.since
        known = joints = np.searchsorted(self.mesh.offsets, self.joints)
        if self.problem.boundaries:
            known = np.union1d(joints, boundaries_at(self.mesh, self.problem.boundaries))
        rates = (joints[:, None] == known).astype(float)
        return np.array([np.interp(since, since[known], rate) for rate in rates])

    @property
    def units(self) -> ActionUnits:
        """The units, which may be those of another mesh: `like` needs no more."""
        return ActionUnits(self.origin, self.inertia, self.action_unit, self.row_units, self.rate)

    def element_times(self, elements: NDInt, times: Array) -> Array:
        """Return times in elements (E,), (E, K), in a column: on the elements' side of a switch."""
        if self.sides is not None:
            low, high = self.sides
            times = np.clip(times, low[elements, None], high[elements, None])
        return times.reshape(-1, 1)

    def at(self, z: Array) -> Self:
        """Return itself: the times of its events are given, whatever z is."""
        return self

    def between(self, problem: Problem) -> Self:
        """Return that of a problem which differs in the values at its ends only, in these units."""
        other = make_unchecked(type(self), **vars(self))
        other.problem, other.counts = problem, Counter()  # what is kept of the mass is the same
        other._point = None
        other.ends = other._ends()
        if self.nodal:
            other.nodal = terms(problem, self.mesh)
        return other

    def over_times(self, problem: Problem) -> Self:
        """Return that of a problem over other times alone, in these units; L contains no time."""
        start, end = problem.start.t, problem.end.t
        other, before = make_unchecked(type(self), **vars(self)), self.mesh
        other.joint_rates = self.joint_rates  # the same at all times
        other.problem, other.mesh = problem, before.moved(start, end)
        factor = other.mesh.duration / before.duration
        other._point, other._kept = None, {}
        for name in ("between_nodes", "row_times", "probe_momentum"):  # if they were made
            other.__dict__.pop(name, None)
        other.times = start + (self.times - before.boundaries[0]) * factor
        other.halves = [half * factor for half in self.halves]
        for name in ("half", "weight", "row_weight", "row_unit"):
            setattr(other, name, getattr(self, name) * factor)
        other.mu_unit = self.mu_unit / factor
        return other

    def on_elements(self, problem: Problem, mesh: Mesh) -> Self:
        """Return that of a problem on elements of these degrees that end at other times.

        In the same units; the problem differs in the times at which rows are in force at most.
        """
        if self.nodal:
            return type(self)(problem, mesh, self.lengths, like=self)
        other = make_unchecked(type(self), **vars(self))
        other.problem, other.mesh, other.counts, other.watch = problem, mesh, Counter(), None
        other._point, other._kept, other.unfolded = None, {}, {}
        for name in ("joint_rates", "between_nodes", "row_times", "probe_momentum"):
            other.__dict__.pop(name, None)
        other._measure_times()
        other.row_weight, other.row_unit = other._row_measures(other.weight[:, 0])
        other.mu_unit = other.action_unit / other.row_unit
        return other

    def with_ends(self, ends: Array) -> Self:
        """Return the action with other coordinates (2, n) at the first and the last node.

        The problem, whose events they need not be, stays the same.
        """
        other = make_unchecked(type(self), **vars(self))
        other.ends = self.ends.copy()
        other.ends[[0, -1]] = ends
        other._point = None
        return other

    def _units(self) -> tuple[float, Array]:
        """Return the unit of action and of each constraint's row, from typical curvatures."""
        system, problem = self.problem.system, self.problem
        Q = self.straight()
        duration = problem.duration
        x = self.pack(Q)[: self.layout.unknowns]
        self.keep_second(x)  # where a search begins they are asked for again
        C = self.second(x)[2]
        self.inertia = C[len(C) // 2].copy()
        inertias = diagonal(system, 2, C) * self.lengths**2 / duration ** (2 * self.order - 1)
        good = inertias[np.isfinite(inertias) & (inertias > 0)]
        unit = float(np.partition(good, good.size // 2)[good.size // 2]) if good.size else 1.0
        layout = self.layout
        if self.order == 1 and not layout.rows:
            return unit, np.ones(system.m)
        # Of rows that are not in contact slopes along the line, which may be far from the obstacle,
        # are a unit where there is no other: with velocities alone they are measured in contact.
        on = slice(None) if self.order > 1 and not layout.rows else layout.row_nodes
        nodes = self.mesh.nodes[on][:, None]
        G = system.pointwise("constraint_jacobian")(Q[on], nodes, problem.packed)[0]
        sizes = np.zeros(system.m)
        largest = np.max(np.abs(G), axis=0, initial=0.0, where=np.isfinite(G))
        np.maximum.at(sizes, layout.G_rows, largest * self.lengths[layout.G_cols])
        return unit, np.tile(np.where(sizes > 0, sizes, 1.0), self.order)

    def _row_weights(self) -> Array:
        """Return weights of the rows, (K, order): int phi^2, in units of the places.

        So gradients of rows are as large as the second derivatives of S by what is in an element,
        (h / 2)^(1 - 2 r), and signs of eigenvalues stay out of round-off.
        """
        found = np.zeros((self.layout.node_count, self.order))
        for k, (g, shape, half) in enumerate(
            zip(self.layout.groups, self.layout.shapes, self.halves, strict=True)
        ):
            points, h = g.nodes.shape[1], half[:, 0]
            if self.layout.partial:
                part = self.contact_row_weights(k)
            else:
                square = (shape.stiffness[0][0] @ np.ones(points))[:: points + 1]
                part = h * (self.rate * h) ** (2 * self.order - 1) * square
                part = part * shape.scale(half.ravel()) ** 2
            np.add.at(found, (g.nodes[:, shape.node], shape.derivative), part)
        if self.layout.closed:
            found[0] += found[-1]
        return found * self.rate ** np.arange(self.order)

    def with_row_units(self, row_units: Array) -> Self:
        """Return the action with other units (m,) of the constraints' rows."""
        other = make_unchecked(type(self), **vars(self))
        other.row_units = row_units
        ratio = (row_units / self.row_units)[self.layout.row_constraint]
        other.row_unit, other.mu_unit = self.row_unit * ratio, self.mu_unit / ratio
        return other

    # -- vectors -----------------------------------------------------------------------------

    def straight(self) -> Array:
        """Return straight lines between the events, (K, n); a free end keeps the other's."""
        if self.problem.through:
            return self._straight_through()
        start, end = ends_of(self.problem)
        if self.problem.advance is not None:
            end = self.problem.closed_from(start)
        since, T = self.mesh.nodes_since, self.mesh.duration
        s = since / T
        if RESTING in self.mesh.singular_ends:
            s = rise(since, T - since, self.mesh.singular_ends)[0]
        return start + s[:, None] * (end - start)

    def _straight_through(self) -> Array:
        """Return the straight lines through what is given of each coordinate, (K, n)."""
        near = [e.near for e in self.problem.joints_found]
        Q, t = np.zeros((self.layout.node_count, self.problem.system.n)), self.mesh.nodes_since
        for i, row in enumerate(zip(*near, strict=True)):
            given = [k for k, x in zip(self.joints, row, strict=True) if x is not None]
            if given:
                Q[:, i] = np.interp(t, t[given], [x for x in row if x is not None])
        return Q

    def pack(self, Q: Array, lam: Array | None = None) -> Array:
        """Return z for node coordinates Q (K, n) and multipliers lam (K, m) (zero if None)."""
        layout = self.layout
        z = np.zeros(layout.size)
        places = Q if self.order == 1 else self.places_of(Q)
        z[: layout.unknowns] = self.pack_places(places)
        if lam is not None and layout.rows and self.order > 1 and layout.partial:
            z[layout.unknowns :] = self._fit_multipliers(z[: layout.unknowns])
            return z
        if lam is not None and layout.rows and self.order > 1:
            lam = self._places(np.nan_to_num(lam))
        if lam is not None and layout.rows:
            z[layout.unknowns :] = lam[layout.row_node, layout.row_constraint] / self.mu_unit
        return z

    def pack_curve(self, variation: Array) -> Array:
        """Return x (unknowns,) of a variation of all nodes, (K, n), in the units of z."""
        whole = variation if self.order == 1 else self.places_of(variation)
        return whole.ravel()[self.layout.free] / self.x_unit

    def pack_places(self, places: Array) -> Array:
        """Return x (unknowns,) for what is at the nodes, (K, width)."""
        x = places.ravel()[self.layout.free]
        return (x if self.x_origin is None else x - self.x_origin) / self.x_unit

    def unknowns_of(self, places: Array) -> Array:
        """Return z of what is at the nodes, (K, width), where L contains accelerations.

        With the multipliers of rows in contact that belong to it; without those of constraints.
        """
        x = self.pack_places(places)
        if not (self.layout.rows and self.layout.partial):
            return x
        return np.concatenate([x, self._fit_multipliers(x)])

    def unpack(self, z: Array) -> tuple[Array, Array]:
        """Return coordinates (K, n) and multipliers (K, m); NaN where there is no row."""
        return self.coordinates(z), self.multipliers(z)

    def multipliers(self, z: Array) -> Array:
        """Return the multipliers (K, m); NaN where there is no row."""
        layout = self.layout
        lam = np.full((layout.node_count, self.problem.system.m), np.nan)
        if layout.rows and self.order > 1 and layout.partial:
            return self._contact_multipliers(z)
        if layout.rows and self.order > 1:
            lam[layout.node_of] = self.multipliers_between(z)
        elif layout.rows:
            lam[layout.row_node, layout.row_constraint] = (
                z[layout.unknowns : layout.size] * self.mu_unit
            )
        return lam

    def coordinates(self, z: Array) -> Array:
        """Return the coordinates at the nodes, (K, n)."""
        return self.curve(self.places(z))

    def curve(self, places: Array) -> Array:
        """Return the coordinates at the nodes, (K, n), of the `places` (K, width)."""
        if self.order == 1:
            return places
        Q = places[:, : self.problem.system.n].copy()
        for k, (g, shape) in enumerate(zip(self.layout.groups, self.layout.shapes, strict=True)):
            Q[g.nodes[:, 1:-1]] = shape.basis[0][1:-1] @ self.local(k, places)
        return Q

    def local(self, group: int, places: Array) -> Array:
        """Return the elements' unknowns of one degree in their own time xi, (E, d + 1, n)."""
        g, shape = self.layout.groups[group], self.layout.shapes[group]
        each = places.reshape(len(places), self.order, -1)
        scale = shape.scale(self.halves[group].ravel())
        return each[g.nodes[:, shape.node], shape.derivative] * scale[:, :, None]

    def contact_rows(self, group: int) -> Array:
        """Return what rows in contact make of the constraints, (E, d + 1, d + 1), of one degree.

        As `Element.contact` says; at a node of two elements each has half of the row.
        """
        g, shape = self.layout.groups[group], self.layout.shapes[group]
        rows, power = shape.contact
        found = rows * (self.halves[group] ** power[:, None])
        inner = np.isin(g.nodes[:, [0, -1]], self.layout.offsets[1:-1]) | bool(self.layout.closed)
        share, r = np.where(inner, 0.5, 1.0), self.order
        found[:, :r] *= share[:, :1, None]
        found[:, -r:] *= share[:, 1:, None]
        return found

    def contact_row_weights(self, group: int) -> Array:
        """Return the parts (E, d + 1) of `_row_weights` of such rows: int f phi of what they hold.

        They grow as its length to the power of 2 r - 1, of 2 r where a row is an integral.
        """
        shape, half = self.layout.shapes[group], self.halves[group].ravel()
        own = np.einsum("eak,ka->ea", self.contact_rows(group), shape.basis[0])
        stiff = (self.rate * half[:, None]) ** (2 * self.order - 1)
        return stiff * np.abs(own) * shape.scale(half)

    def row_multipliers(self, z: Array) -> Array:
        """Return the multipliers of the rows where they are kept, (K, order m); zero for none."""
        layout = self.layout
        places = np.zeros(layout.row_number.shape)
        places[layout.row_node, layout.row_constraint] = (
            z[layout.unknowns : layout.size] * self.mu_unit
        )
        return places

    def _by_elements(self, group: int, places: Array) -> Array:
        """Return what is kept for the elements of one degree, (E, d + 1, m), as it is kept."""
        g, shape = self.layout.groups[group], self.layout.shapes[group]
        each = places.reshape(len(places), self.order, -1)
        return each[g.nodes[:, shape.node], shape.derivative]

    def contact_density(self, places: Array) -> Array:
        """Return what presses between the nodes that rows hold, (evaluations, m), of `places`.

        As `row_multipliers` has them: without impulses and couples at these nodes.
        """
        found = np.zeros((self.layout.evaluations, self.problem.system.m))
        for k, (g, shape) in enumerate(zip(self.layout.groups, self.layout.shapes, strict=True)):
            inner = np.isin(np.arange(g.nodes.shape[1]), shape.ends, invert=True)
            rows = self.contact_rows(k)[:, inner]
            of_inner = self._by_elements(k, places)[:, inner]
            part = np.einsum("eak,eai->eki", rows, of_inner)
            found[g.span] = part.reshape(-1, found.shape[1]) / self.weight[g.span]
        return found

    def _contact_multipliers(self, z: Array) -> Array:
        """Return the multipliers (K, m) of rows in contact: per time, impulses as all others."""
        layout, m = self.layout, self.problem.system.m
        work, weight = self.multipliers_between(z) * self.weight, self.weight[:, 0]
        found = np.stack([np.bincount(layout.node_of, w, layout.node_count) for w in work.T], 1)
        if layout.closed:
            found[0] = found[-1] = found[0] + found[-1]
        found /= np.bincount(layout.node_of, weight, layout.node_count)[:, None]
        on = self.problem.in_force(self.mesh.boundaries, layout.offsets)
        assert on is not None
        on = on[:, :m].copy()
        on[layout.offsets] &= layout.row_number[layout.offsets, :m] >= 0
        return np.where(on, found, np.nan)

    def _fit_multipliers(self, x: Array) -> Array:
        """Return the multipliers (rows,) of rows in contact with which x is nearest stationary."""
        layout = self.layout
        rows, J = np.zeros((layout.rows, layout.unknowns)), layout.jacobian
        rows[J.row, J.col] = self.jacobian(x)
        pull = self.gradient(x)
        if not (np.isfinite(rows).all() and np.isfinite(pull).all()):
            return np.zeros(layout.rows)
        return np.linalg.lstsq(rows.T, -pull, rcond=None)[0]

    def multipliers_between(self, z: Array) -> Array:
        """Return the multipliers at the evaluations, (evaluations, m): functions as paths are.

        In contact, what rows make of an evaluation over its weight.
        """
        layout, places = self.layout, self.row_multipliers(z)
        found = np.empty((layout.evaluations, self.problem.system.m))
        for k, (g, shape) in enumerate(zip(layout.groups, layout.shapes, strict=True)):
            if layout.partial:
                of_rows = self._by_elements(k, places)
                part = np.einsum("eak,eai->eki", self.contact_rows(k), of_rows)
                found[g.span] = part.reshape(-1, found.shape[1]) / self.weight[g.span]
                continue
            part = by_each(shape.basis[0], self.local(k, places))
            found[g.span] = part.reshape(-1, found.shape[1])
        return found

    def places_of(self, Q: Array) -> Array:
        """Return the places (K, width) of a curve by its values Q (K, n) at the nodes.

        Where elements meet the derivatives are the means of theirs, or what is given there.
        """
        return self._places(Q, given=True)

    def _places(self, Q: Array, *, given: bool = False) -> Array:
        """Return the places of any functions; values that are `given` at events replace theirs."""
        layout, order = self.layout, self.order
        places = np.zeros((len(Q), order, Q.shape[1]))
        for g, half in zip(layout.groups, self.halves, strict=True):
            rates = Q[g.nodes]
            for k in range(1, order):
                rates = by_each(g.rule.derivative, rates) / half
                for end in (0, -1):
                    places[g.nodes[:, end], k] += rates[:, end] / 2
        places[[0, -1]] *= 2  # no neighbour beyond
        places[layout.offsets, 0] = Q[layout.offsets]
        flat = places.reshape(len(Q), -1)
        if given:
            at = layout.offsets[:, None], np.arange(layout.width)
            flat[at] = np.where(layout.number[at] < 0, self.ends[at], flat[at])
        for k, (g, shape) in enumerate(zip(layout.groups, layout.shapes, strict=True)):
            fit, by_ends = shape.fit
            rest = Q[g.nodes[:, 1:-1]] - by_ends @ self.local(k, flat)[:, shape.ends]
            places[g.nodes[:, order:-order], 0] = fit @ rest
        return flat

    def state(self, places: Array) -> tuple[Array, Array]:
        """Return what L takes at the evaluations, `at` and `v`, of places (K, width)."""
        if self.order == 1:
            at = places.take(self.layout.node_of, 0)
            v, (ends, beside) = self.velocities(at), self.layout.unseen
            if ends.size:  # what is there counts for nothing, but is to be finite
                at[ends], v[ends] = at[beside], v[beside]
            return at, v
        n = self.problem.system.n
        found = np.empty((self.layout.evaluations, (self.order + 1) * n))
        for k, (g, shape) in enumerate(zip(self.layout.groups, self.layout.shapes, strict=True)):
            for i, rates in enumerate(shape.derivatives(self.local(k, places))):
                part = rates / self.halves[k] ** i
                found[g.span, i * n : (i + 1) * n] = part.reshape(-1, n)
        return found[:, :-n], found[:, -n:]

    def shifts(self, places: Array) -> list[Array]:
        """Return the derivatives of the state by log h, h an element's length, with places kept.

        The first and the second one, (evaluations, width + n) each: the derivative of order k at an
        end contributes to the derivative of order i of the path in proportion to h^(k - i).
        """
        n, layout = self.problem.system.n, self.layout
        found = [np.empty((layout.evaluations, layout.width + n)) for _ in range(2)]
        for k, (g, shape) in enumerate(zip(layout.groups, layout.shapes, strict=True)):
            local = self.local(k, places)
            for i, basis in enumerate(shape.basis):
                for power, change in enumerate(found, 1):
                    weighed = local * ((shape.derivative - i) ** power)[:, None]
                    part = by_each(basis, weighed) / self.halves[k] ** i
                    change[g.span, i * n : (i + 1) * n] = part.reshape(-1, n)
        return found

    def pull_back(self, by_place: Array, by_rate: Array) -> Array:
        """Return derivatives by the elements' unknowns, (evaluations, n), of a sum w L over nodes.

        `by_place` (evaluations, width) and `by_rate` (evaluations, n) are the derivatives of L.
        """
        if self.order == 1:
            return self.add_work(self.weight * by_place, by_rate)
        n, parts = self.problem.system.n, np.concatenate([by_place, by_rate], axis=1)
        found = np.empty((self.layout.evaluations, n))
        for k, (g, shape) in enumerate(zip(self.layout.groups, self.layout.shapes, strict=True)):
            local = parts[g.span].reshape(*g.nodes.shape, self.order + 1, n)
            half, w = self.halves[k], g.rule.weights[:, None]
            work = half * by_each(shape.basis[0].T, w * local[:, :, 0])
            for i in range(1, self.order + 1):
                # The integral of a constant is known from the ends: its round-off stays there.
                constant, below = local[:, :1, i], shape.basis[i - 1]
                part = by_each(shape.basis[i].T, w * (local[:, :, i] - constant))
                work += (part + (below[-1] - below[0])[:, None] * constant) * half ** (1 - i)
            found[g.span] = (work * shape.scale(half.ravel())[:, :, None]).reshape(-1, n)
        return found

    def places(self, z: Array) -> Array:
        """Return the coordinates at the nodes and derivatives at boundaries, (K, width)."""
        Q = self.ends.copy()
        x = z[: self.layout.unknowns] * self.x_unit
        Q.ravel()[self.layout.free] = x if self.x_origin is None else x + self.x_origin
        if self.problem.advance is not None:
            Q[-1] = Q[0, list(self.layout.closed)]
            Q[-1, : self.problem.advance.size] += self.problem.advance
        return Q

    def relative_step(self, step: Array) -> float:
        """Return the largest change of a coordinate by a step in z, in units of its own size.

        That is the unit of z, but for coordinates whose origin is far from zero.
        """
        x = step[: self.layout.unknowns]
        if not x.size:
            return 0.0
        if self.x_origin is None:
            return float(np.maximum.reduce(np.abs(x)))
        return float((np.abs(x) / self.magnitudes[: x.size]).max())

    @property
    def magnitudes(self) -> Array:
        """Sizes of coordinates and multipliers in the units of z, (size,): one near zero."""
        found = np.ones(self.layout.size)
        if self.x_origin is not None:
            found[: self.layout.unknowns] += np.abs(self.x_origin) / self.x_unit
        return found

    # -- values and first derivatives ----------------------------------------------------------

    def velocities(self, at: Array) -> Array:
        """Return the velocities at the evaluations, for coordinates `at` there, both (E, n)."""
        found = np.empty(at.shape)
        for g, half in zip(self.layout.groups, self.halves, strict=True):
            shape = *g.nodes.shape, at.shape[1]
            q = at[g.span].reshape(shape)
            q = q - q[:, :1]  # a constant has no velocity, nor the round-off of one
            np.divide(by_each(g.rule.derivative, q), half, out=found[g.span].reshape(shape))
        return found

    def place(self, x: Array) -> Evaluations:
        """Return the evaluations at x (unknowns,); those of the last x are kept."""
        point = self._point
        key = x.tobytes()
        if point is None or point.x != key:
            places = self.places(x)
            # Several threads may read one solution: what one found is never taken for another x.
            self._point = point = Evaluations(key, places, self.curve(places), *self.state(places))
        return point

    def _first(self, x: Array) -> tuple[float, Array, Array]:
        """Return S, its gradient (virtual work included) at all nodes, (K n), and its parts, at x.

        The parts (evaluations, n) are those of each element's nodes, before they are summed.
        """
        point = self.place(x)
        if point.values is None:
            point.values = self._action_and_gradient(point.at, point.v, point.first)
        return point.values

    def action_and_gradient(self, Q: Array) -> tuple[float, Array]:
        """Return S and grad S + sum w Q over all nodes, (K n), in the user's units."""
        S, gradient, _ = self._action_and_gradient(*self.state_of(Q))
        if self.nodal:
            S += self._beyond(Q)
            for term, row in self._pulls(Q):
                gradient[term.node * row.size : (term.node + 1) * row.size] += row
        return S, gradient

    def state_of(self, Q: Array) -> tuple[Array, Array]:
        """Return `state` of a curve by its values Q (K, n) at the nodes."""
        return self.state(Q if self.order == 1 else self.places_of(Q))

    def value(self, Q: Array) -> float:
        """Return S over all nodes, coordinates Q (K, n), in the user's units."""
        return self._sum(*self.state_of(Q)) + (self._beyond(Q) if self.nodal else 0.0)

    def _sum(self, at: Array, v: Array) -> float:
        L = self.problem.system.pointwise("value")(at, v, self.times, self.problem.packed)[0]
        return float(self.weight[:, 0] @ L[:, 0])

    def first(self, x: Array) -> list[Array]:
        """Return L_q, L_v and L at the evaluations, kept for the gradient at the same x."""
        point = self.place(x)
        if point.first is None:
            state = point.at, point.v, self.times, self.problem.packed
            point.first = [y.copy() for y in self.problem.system.pointwise("first")(*state)]
            self.counts["first"] += 1
        return point.first

    def _action_and_gradient(
        self, at: Array, v: Array, known: list[Array] | None = None
    ) -> tuple[float, Array, Array]:
        """Return S, gradient (K n) and its parts (evaluations, n) for q and v (evaluations, n)."""
        if known is None:
            state = at, v, self.times, self.problem.packed
            known = self.problem.system.pointwise("first")(*state)
            self.counts["first"] += 1
        Lq, Lv, L = known
        return float(self.weight[:, 0] @ L[:, 0]), *self._slope(at, v, Lq, Lv)

    def _slope(self, at: Array, v: Array, Lq: Array, Lv: Array) -> tuple[Array, Array]:
        """Return the gradient (K n) and its parts (evaluations, n), of L_q and L_v there."""
        system, layout = self.problem.system, self.layout
        parts = self.weight * Lq if self.order == 1 else Lq
        if system.structure.forced:
            force = system.pointwise("force")(at, v, self.times, self.problem.packed)[0]
            self.counts["force"] += 1
            if self.order == 1:
                parts += self.weight * force
            else:
                parts = Lq + np.pad(force, ((0, 0), (0, layout.width - system.n)))
        parts = self.add_work(parts, Lv) if self.order == 1 else self.pull_back(parts, Lv)
        return np.bincount(layout.scatter, parts.ravel(), layout.node_count * layout.width), parts

    def add_work(self, found: Array, p: Array) -> Array:
        """Add D' w p, what momenta p work at the nodes of their elements; both (evaluations, n)."""
        for g in self.layout.groups:
            local = p[g.span].reshape(*g.nodes.shape, -1)
            part = found[g.span].reshape(local.shape)  # a view
            # A constant momentum works at the element's ends only: taken out of the sum, its
            # round-off stays out of the nodes between.
            part += by_each(g.rule.weighted_derivative.T, local - local[:, :1])
            part[:, 0] -= local[:, 0]
            part[:, -1] += local[:, 0]
        return found

    def at_unknowns(self, parts: Array) -> Array:
        """Return the sums (unknowns,) of what stands at the evaluations, (evaluations, n)."""
        layout = self.layout
        whole = np.bincount(layout.scatter, parts.ravel(), layout.node_count * layout.width)
        return self.free_part(whole)

    def action(self, x: Array) -> float:
        """Return S in its own unit."""
        S = self._first(x)[0]
        return (S + self._beyond(self.place(x).Q) if self.nodal else S) / self.action_unit

    def action_alone(self, x: Array) -> float:
        """Return S in its own unit without its derivatives, which `action` keeps for `gradient`."""
        point = self.place(x)
        S = self._sum(point.at, point.v) if point.values is None else point.values[0]
        return (S + self._beyond(point.Q) if self.nodal else S) / self.action_unit

    def actions_along(self, x: Array, away: Array, parts: Array) -> Array:
        """Return S in its own unit at x + parts (c,) of `away`, all at once."""
        first, last = self.places(x), self.places(x + away)
        ends = zip(self.state(first), self.state(last), strict=True)
        at, v = ((a + parts[:, None, None] * (b - a)).reshape(-1, a.shape[1]) for a, b in ends)
        times = self.times[None].repeat(parts.size, axis=0).reshape(-1, 1)
        L = self.problem.system.pointwise("value")(at, v, times, self.problem.packed)[0]
        S = L.reshape(parts.size, -1) @ self.weight[:, 0]
        if self.nodal:
            S = S + [self._beyond(first + part * (last - first)) for part in parts]
        return S / self.action_unit

    def gradient_alone(self, x: Array) -> Array:
        """Return dS/dx as `gradient` does, without S, which that keeps for `action`."""
        point = self.place(x)
        if point.values is not None or self.nodal:
            return self.gradient(x)
        state = point.at, point.v, self.times, self.problem.packed
        slopes = self.problem.system.pointwise("slopes")(*state)
        return self.free_part(self._slope(point.at, point.v, *slopes)[0])

    def gradient(self, x: Array) -> Array:
        """Return dS/dx (virtual work included), (unknowns,), in units of action."""
        whole = self._first(x)[1]
        if self.nodal:
            whole = whole.copy()
            for term, row in self._pulls(self.place(x).Q):
                whole[term.node * row.size : (term.node + 1) * row.size] += row
        return self.free_part(whole)

    def summed_gradient(self, x: Array) -> Array:
        """Return dS/dx without the terms of single nodes (`nodal`)."""
        return self.free_part(self._first(x)[1])

    def _beyond(self, Q: Array) -> float:
        """Return the terms of single nodes in the action, for coordinates Q (K, n)."""
        return sum(term.value(Q[term.node]) for term in self.nodal) - self.rest

    def _pulls(self, Q: Array) -> list[tuple[Term, Array]]:
        """Return the derivatives (n,) of the terms of single nodes."""
        return [(term, term.gradient(Q[term.node])) for term in self.nodal]

    def finite(self, z: Array) -> bool:
        """Return whether S and all its derivatives are finite, those at given ends included."""
        S, gradient, _ = self._first(z[: self.layout.unknowns])
        return math.isfinite(S) and bool(np.isfinite(gradient).all())

    def work(self, x: Array) -> list[Array]:
        """Return dS/dq (virtual work included) of the elements of each degree, (E, d + 1, n)."""
        parts, n = self.parts(x), self.problem.system.n
        return [parts[g.span].reshape(*g.nodes.shape, n) for g in self.layout.groups]

    def parts(self, x: Array) -> Array:
        """Return dS/dq (virtual work included) at the evaluations, (evaluations, n)."""
        return self._first(x)[2]

    def free_part(self, whole: Array) -> Array:
        """Return the derivatives by x, in units of action, of those by all coordinates (K n)."""
        free = whole[self.layout.free]
        if self.layout.closed:  # the last node moves with the first
            width = self.layout.width
            first, last = self.layout.free[self.layout.free < width], np.empty(width)
            last[list(self.layout.closed)] = whole[-width:]
            free[: first.size] += last[first]
        return free * self.gradient_unit

    def constraint(self, x: Array) -> Array:
        """Return the weighted constraint rows w_k f(q_k, t_k), (rows,), in units of `row_unit`."""
        f = self._at_rows(x)[1]
        if self.order > 1:  # int f times each function that a multiplier may be
            found = np.zeros(self.layout.row_number.shape)
            for k, (g, shape) in enumerate(
                zip(self.layout.groups, self.layout.shapes, strict=True)
            ):
                half, w = self.halves[k], g.rule.weights[:, None]
                local = f[g.span].reshape(*g.nodes.shape, -1)
                if self.layout.partial:
                    part = self.contact_rows(k) @ local
                else:
                    part = half * by_each(shape.basis[0].T, w * local)
                    part *= shape.scale(half.ravel())[:, :, None]
                at = shape.derivative[:, None] * f.shape[1] + np.arange(f.shape[1])
                np.add.at(found, (g.nodes[:, shape.node][:, :, None], at), part)
            if self.layout.closed:
                found[0] += found[-1]
            rows = found[self.layout.row_node, self.layout.row_constraint]
            return rows / self.row_unit
        return (self.row_weight * f).ravel()[self.layout.row_select] / self.row_unit

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
        reaction = np.bincount(
            J.col, self.jacobian(x) * z[layout.unknowns + J.row], layout.unknowns
        )
        return np.concatenate([g + reaction, self.constraint(x)])

    # -- second derivatives ----------------------------------------------------------------------

    def second(self, x: Array) -> list[Array]:
        """Return the nonzeros of L_qq, L_qv and L_vv, each (evaluations, nonzeros)."""
        check_time()
        if self.watch is not None:
            self.watch(self.mesh.elements)
        function, p = self.problem.system.pointwise("second"), self.problem.packed
        if self.problem.system.structure.steady_forces:  # they are the same everywhere
            rest = np.zeros((1, self.layout.width)), np.zeros((1, self.problem.system.n))
            count = self.layout.evaluations
            return self.memoize_if_constant(
                "second",
                lambda: [x.repeat(count, axis=0) for x in function(*rest, self.times[:1], p)],
            )
        point = self.place(x)
        if point.second is not None:
            return point.second
        self.counts["second"] += 1
        return function(point.at, point.v, self.times, p)

    def keep_second(self, x: Array) -> list[Array]:
        """Return `second` at x and keep it until it is asked for at another; [] where constant."""
        if self.problem.system.structure.steady_forces:
            return []
        point = self.place(x)
        if point.second is None:
            point.second = [values.copy() for values in self.second(x)]
        return point.second

    def forces(self, x: Array) -> list[Array]:
        """Return the nonzeros of dQ/dq and dQ/dv, each (evaluations, nonzeros)."""
        point = self.place(x)
        self.counts["force_jacobian"] += 1
        function = self.problem.system.pointwise("force_jacobian")
        return function(point.at, point.v, self.times, self.problem.packed)

    def normals(self, x: Array) -> Array:
        """Return the nonzeros of G at the rows' nodes, (R, nonzeros)."""
        return self._at_rows(x)[0]

    def _at_rows(self, x: Array) -> tuple[Array, Array]:
        """Return the nonzeros of G and the constraints at the rows' nodes, (R, ...)."""
        point = self.place(x)
        if point.rows is None:
            self.counts["constraint"] += 1
            self.counts["constraint_jacobian"] += 1
            function = self.problem.system.pointwise("constraint_jacobian")
            at, times = point.Q[self.layout.row_nodes], self.row_times
            if self.order > 1:  # at all evaluations
                at, times = point.at[:, : point.Q.shape[1]], self.times
            G, f = function(at, times, self.problem.packed)
            point.rows = G.copy(), f.copy()
        return point.rows

    def constraint_curvature(self, z: Array) -> Array | None:
        """Return the nonzeros of w lam f_qq at the rows' nodes, (R, nonzeros); else None."""
        layout, system = self.layout, self.problem.system
        if not layout.rows or system.structure.affine_constraint:
            return None
        if self.order > 1:
            at = self.place(z[: layout.unknowns]).at[:, : system.n], self.multipliers_between(z)
            return system.pointwise("constraint_curvature")(*at, self.times, self.problem.packed)[0]
        Q = self.place(z[: layout.unknowns]).Q
        lam = np.zeros(layout.row_nodes.size * system.m)
        lam[layout.row_select] = z[layout.unknowns : layout.size] * self.mu_unit
        curvature = system.pointwise("constraint_curvature")(
            Q[layout.row_nodes], lam.reshape(-1, system.m), self.row_times, self.problem.packed
        )[0]
        self.counts["constraint_curvature"] += 1
        return self.row_weight * curvature

    def jacobian(self, x: Array) -> Array:
        """Return the nonzeros of the derivative of `constraint`, (nnz,) of `layout.jacobian`."""
        J = self.layout.jacobian
        if self.order > 1:
            values = J.sum(np.concatenate([part.ravel() for part in self.normals_between(x)]))
        else:
            values = J.sum((self.row_weight * self.normals(x)).ravel())
        return values * self.x_unit[J.col] / self.row_unit[J.row]

    def normals_between(self, x: Array) -> list[Array]:
        """Return int phi_a G phi_b of each element's functions, (E, d + 1, d + 1, nonzeros)."""
        G, found = self.normals(x), []
        for k, (g, shape) in enumerate(zip(self.layout.groups, self.layout.shapes, strict=True)):
            half, points = self.halves[k], g.nodes.shape[1]
            if self.layout.partial:
                rows = self.contact_rows(k)[:, :, None] * shape.basis[0].T
                part = rows @ G[g.span].reshape(len(g.nodes), 1, points, -1)
                found.append(part * shape.scale(half.ravel())[:, None, :, None])
                continue
            local = G[g.span].reshape(len(g.nodes), points, -1) * half
            part = (shape.stiffness[0][0] @ local).reshape(len(g.nodes), points, points, -1)
            scale = shape.scale(half.ravel())
            found.append(part * (scale[:, :, None] * scale[:, None])[..., None])
        return found

    @cached_property
    def hessian_unit(self) -> Array:
        """Units of the nonzeros (nnz,) of `layout.hessian`."""
        H = self.layout.hessian
        return self.x_unit[H.row] * self.x_unit[H.col] / self.action_unit

    def memoize_if_constant(self, name: str, made: Callable[[], Any]) -> Any:
        """Return `made()`, of the mass matrix alone: it is called once if that is constant."""
        if not self.problem.system.structure.constant_mass:
            return made()
        kept = self._kept
        if name not in kept:
            kept[name] = made()
        return kept[name]

    def forget(self) -> None:
        """Free what can be computed again."""
        self._point = None
        self._kept = {}
