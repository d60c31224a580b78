"""Times at which contact with an obstacle begins and ends, as unknowns beside the path.

A path of least action meets an obstacle tangentially: the slip

    s = f_q . v + f_t = 0,    L_v(q, v) - G' mu = p,    G v = -f_t  in the rows in force,

on the free side of where contact begins or ends, v from the discrete momentum p of the element
there, which is accurate to order 2d. (The derivative of the action by such a time is the square of
the slip: as an equation it would have a double root.) As such a time moves, so do the boundaries of
elements between its neighbours, and the equations change with them (`by_boundaries`). Where L
contains accelerations velocities are continuous, unknowns of the path, and df/dt = 0 is theirs.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from actionopt.discrete.action.equations import Equations
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.borders.bordered import Bordered
from actionopt.discrete.borders.borders import Integral, Times
from actionopt.discrete.borders.integrals import integrals_by, integrands
from actionopt.discrete.borders.stretch import Stretch
from actionopt.discrete.matrices.factors import Factors
from actionopt.discrete.matrices.layout import border_matrix
from actionopt.discrete.meshes.boundaries import carry_boundaries
from actionopt.discrete.meshes.mesh import Group
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.mechanics.question.held import Held, contacts_of
from actionopt.mechanics.question.obstacle import Arc, rates_of_rows
from actionopt.mechanics.question.problem import Problem
from actionopt.tools.types import Array

# Slips that change by less with the times of contact, over the duration and in a typical rate of f,
# change by round-off, as where nothing presses, whatever the times are. Ad hoc.
PRESSING = 1e-12
FLAT_MOMENT = 1e-8  # in a typical f over the duration's square: d2f/dt2 that is none; ad hoc
VELOCITY_STEPS = 4  # of Newton's method from the polynomial's velocity: it converges in two


def with_contact_times(tr: Transcription, times: Array, moves: Array) -> Transcription:
    """Return the discrete problem whose times of contact (J,) move, and the elements with them."""
    held = contacts_of(tr.problem)
    after = dict(zip(times.tolist(), (times + moves).tolist(), strict=True))
    moved = held.holding(
        tuple(
            Arc(arc.row, after.get(arc.begin, arc.begin), after.get(arc.end, arc.end))
            for arc in held.arcs or ()
        )
    )
    before, now = (np.union1d(held.knots, t) - held.start.t for t in (times, times + moves))
    before[-1] = now[-1] = held.duration
    mesh = tr.mesh.cut(np.interp(tr.mesh.since, before, now), tr.mesh.degrees)
    return Transcription(moved, mesh, tr.lengths, like=tr)


class TangencyMatrix:
    """The factors of Newton's matrix for a path and its times of contact, J of them, at one path.

    Those of the path alone are its `factors`. Both at once: between given times of contact a path
    that is stationary meets the obstacle at an angle whose square the times determine, and may not
    exist at all. Raises LinAlgError where the matrix of the path is singular, or not finite.
    """

    def __init__(self, equations: Equations, z: Array, times: Array) -> None:
        tr, held = equations.at(z), contacts_of(equations.at(z).problem)
        where, each = np.searchsorted(held.knots, times), np.arange(times.size)
        # All times from one on move, so that a short part behind it keeps its length.
        self._shifted = (where[:, None] == where) & (each[:, None] >= each)
        columns, rows, corner, self._values = contact_edges(equations, z, times)
        self._z, self._rows = z, rows
        self.factors = Factors(equations.layout, equations.kkt(z), many=True)
        moves = [self.factors.solve(move) for move in (columns @ self._shifted).T]
        self._moves = -np.stack(moves, axis=1)
        slopes = rows @ self._moves + corner @ self._shifted
        across, sizes, along = np.linalg.svd(slopes, full_matrices=False)
        pressed = sizes > PRESSING * float(tr.row_units.max()) / held.duration**2
        self._inverse = -(along[pressed].T / sizes[pressed]) @ across.T[pressed]

    def step(
        self, equations: Equations, z: Array, force: Array | float = 0.0
    ) -> tuple[Array, Array]:
        """Return the step (J,) for the times of contact and that of z (size,), with it.

        It is Newton's where the matrix is that at z; a simplified one where times and z have moved
        since. A `force` (size,) is what the residual of the path is to be in place of zero.
        """
        step = self.factors.solve(force - equations.residual(z))
        if z is self._z:
            slip = self._values + self._rows @ step
        else:
            there = DiscretePath(equations.at(z + step), (z + step)[: equations.at(z).layout.size])
            slip = slip_values(there)
        change = self._inverse @ slip
        return self._shifted @ change, step + self._moves @ change


def contact_edges(equations: Equations, z: Array, times: Array) -> tuple[Array, ...]:
    """Return the border of the matrix of a path for its times of contact (J,).

    The derivatives of its residual by each time alone (size, J), and of the slips by z (J, size)
    and by the times (J, J). And the slips (J,).
    """
    tr, count = equations.at(z), times.size
    at, b = DiscretePath(tr, z[: tr.layout.size]), tr.mesh.boundaries
    knots = np.union1d(contacts_of(tr.problem).knots, times)
    rates = np.array([np.interp(b, knots, row) for row in np.eye(knots.size)])
    rates, beside = rates[np.searchsorted(knots, times)], []
    events = np.zeros(0, dtype=int)  # whose times are unknown, too
    if isinstance(equations, Bordered):
        beside, events = zip(equations.borders, equations.parts, strict=True), equations.moving
        rates = np.vstack([rates, tr.joint_rates[events]])
    stretch, met = Stretch(at, rates), slips(at)
    columns, rows = np.zeros((z.size, count)), np.zeros((len(met), z.size))
    columns[: tr.layout.size] = stretch.residuals()[:, :count]
    for row, slip in zip(rows, met, strict=True):
        row[: tr.layout.unknowns] = slip.by_path(at, stretch.second)
    own = np.array([slip.by_times(stretch) for slip in met])
    for border, part in beside:
        if isinstance(border, Times):
            bend = stretch.twice()[count:, :count]
            # The parts of a leg at which contact is change with its duration.
            joints = tr.mesh.nodes[tr.joints]
            leg = np.searchsorted(joints, times, side="right") - 1
            turn = stretch.slopes()[:count] / np.diff(joints)[leg]
            bend += turn * ((events[:, None] == leg + 1).astype(float) - (events[:, None] == leg))
            change = border.jacobian(z[part])[events]
            columns[part] = change.T @ bend / tr.action_unit
            rows[:, part] = own[:, count:] @ change
        elif isinstance(border, Integral):
            columns[part] = integrals_by(stretch)[:, :count] / border.units[:, None]
            for row, slip in zip(rows, met, strict=True):
                row[part] = slip.by_multipliers(at) * border.unit / border.units
    return columns, rows, own[:, :count], np.array([slip.value for slip in met])


@dataclass(eq=False)
class ContactEquations:
    """The equations of a path and of its times of contact, J of them, as a branch has them.

    The unknowns are (y, theta), y those of the `equations` of a path whose contact is given: times
    of contact are farther by theta than on their first mesh, in durations of the legs there, with
    which they are stretched. With as many equations, slip = 0.

    Raises
    ------
    ValueError
        If contact of one row begins where that of another ends.
    """

    equations: Transcription | Bordered
    held: Held = field(init=False)

    def __post_init__(self) -> None:
        first = self.first
        self.held, self.lengths = contacts_of(first.problem), first.lengths
        self.times = self.held.contact_times
        arcs = [t for arc in self.held.arcs or () for t in (arc.begin, arc.end)]
        if first.order > 1:  # of a moment, once
            arcs = [t for x in self.held.arcs or () for t in dict.fromkeys((x.begin, x.end))]
        if np.sum(~np.isin(arcs, self.held.fixed_times)) != self.times.size:
            raise ValueError(
                "expected times of contact that differ, found one at which two rows meet: give "
                "sweep, which looks for contact anew"
            )
        self.layout = first.layout.with_border(self.equations.layout.border + self.times.size)
        self.unit = float(first.row_units.max()) / self.held.duration  # of slips

    @property
    def first(self) -> Transcription:
        """The discrete action on the first mesh."""
        equations = self.equations
        return equations.first if isinstance(equations, Bordered) else equations

    def of(self, problem: Problem) -> ContactEquations:
        """Return the equations of another member of a family, in the same unknowns."""
        first, old = self.first, self.held
        if isinstance(self.equations, Bordered):
            return ContactEquations(self.equations.of(Held(problem, old.arcs, span=old.span)))
        ends = problem.start.t, problem.end.t
        mesh = carry_boundaries(first.mesh, old.instants, problem.instants, *ends)
        moved = dict(zip(first.mesh.boundaries.tolist(), mesh.boundaries.tolist(), strict=True))
        arcs = tuple(Arc(x.row, moved[x.begin], moved[x.end]) for x in old.arcs or ())
        return ContactEquations(Transcription(Held(problem, arcs), mesh, self.lengths, like=first))

    def _durations(self, tr: Transcription) -> Array:
        """Return the durations of the legs in which the times of contact lie, (J,)."""
        joints = tr.mesh.nodes[tr.joints]
        times = contacts_of(tr.problem).contact_times
        return np.diff(joints)[np.searchsorted(joints, times, side="right") - 1]

    def _equations_at(self, y: Array) -> tuple[Transcription | Bordered, Array]:
        """Return the equations at the times of contact of unknowns y, and their own unknowns.

        Raises LinAlgError where a part in contact is gone.
        """
        size = self.equations.layout.size
        first, equations, theta = self.first, self.equations, y[size:]
        if theta.any():
            moves = self._durations(first) * theta
            knots = np.union1d(self.held.knots, self.times)
            after = knots.copy()
            after[np.isin(knots, self.times)] += moves
            if not (np.diff(after) > 0).all():
                raise np.linalg.LinAlgError("a part in contact, or between two, has vanished")
            tr = with_contact_times(first, self.times, moves)
            if isinstance(equations, Bordered):
                asked = equations.problem.free
                held = Held(asked, contacts_of(tr.problem).arcs, span=self.held.span)
                equations = equations.around_another(tr).of(held)
            else:
                equations = tr
        return equations, y[:size]

    def discrete(self, y: Array) -> DiscretePath:
        """Return the path of unknowns y. Raises LinAlgError where a part in contact is gone."""
        equations, own = self._equations_at(y)
        return DiscretePath(equations.at(own), own[: self.first.layout.size])

    def residual(self, y: Array) -> Array:
        """Return the residual of the path, and the slips, (size,); NaN where a part is gone."""
        try:
            equations, own = self._equations_at(y)
        except np.linalg.LinAlgError:
            return np.full(y.size, np.nan)
        met = slip_values(DiscretePath(equations.at(own), own[: self.first.layout.size]))
        return np.r_[equations.residual(own), met / self.unit]

    def kkt(self, y: Array) -> Array:
        """Return the nonzeros of the derivative of `residual`, as the layout says."""
        equations, own = self._equations_at(y)
        tr = equations.at(own)
        T = self._durations(tr)
        columns, rows, corner, _ = contact_edges(
            equations, own, contacts_of(tr.problem).contact_times
        )
        edges = columns * T, rows / self.unit, corner * T / self.unit
        return border_matrix(equations.layout, equations.kkt(own), *edges)[1]


def bend_of_contacts(at: DiscretePath) -> tuple[Array, Array]:
    """Return what contacts add to the second variation of a path with accelerations.

    An obstacle gives an impulse nu at the moment at which f is zero and least. That moment moves
    with the path by -d(df/dt) / f'', and f there, held at zero, is less by half the square of it:
    nu (d(df/dt))^2 / f'' in all, nonzeros of the path's matrix. (The term of a constraint that
    holds at infinitely many times; R. Hettich and K. O. Kortanek, *SIAM Review* 35 (1993) 380,
    section 5.) Where an arc begins or ends f'' = 0, and what holds f there holds df/dt as well:
    rows (c, unknowns) that are to vanish.
    """
    held, tr = contacts_of(at.problem), at.tr
    layout, nonzeros, rows = tr.layout, np.zeros(tr.layout.blocks.count), []
    function, kept = rates_of_rows(held.system), tr.row_multipliers(at.z)
    flat = FLAT_MOMENT * tr.row_units / held.duration**2
    for rate in _rates(at):
        node = layout.offsets[rate.boundary]
        place, time = tr.place(at.x).places[node][None], at.mesh.nodes[node : node + 1, None]
        a = at.rates[1][node][None]
        bent = function(place, a, time, held.packed)[3][0][rate.row]
        number = layout.number[node]
        free = number >= 0
        slope = (rate.by_place * tr.place_units)[free]
        if rate.edge or bent < flat[rate.row]:
            rows.append(np.zeros(layout.unknowns))
            rows[-1][number[free]] = slope
            continue
        nu = -kept[node, rate.row] / tr.action_unit
        layout.blocks.add(nonzeros, number[free], nu / bent * np.outer(slope, slope))
    return nonzeros, np.array(rows).reshape(-1, layout.unknowns)


def restrict(basis: Array, rows: Array) -> Array:
    """Return a basis (size, c) of what of another one leaves rows (r, unknowns) at zero."""
    if not len(rows):
        return basis
    of_basis = rows @ basis[: rows.shape[1]]
    of_basis /= np.linalg.norm(of_basis, axis=1, keepdims=True)
    return basis @ np.linalg.svd(of_basis)[2][len(rows) :].T


def merge_contacts(held: Held, a: float, b: float, *, moments: bool) -> tuple[Arc, ...]:
    """Return the parts in contact when what is between two times of contact has vanished.

    With `moments` what is left of an arc is one, and of two of them one; else there are none but
    at given times.
    """
    both = a if a in held.fixed_times else b if b in held.fixed_times else (a + b) / 2
    found: list[Arc] = []
    for arc in sorted(held.arcs or (), key=lambda arc: (arc.row, arc.begin)):
        begin, end = (both if t in (a, b) else t for t in (arc.begin, arc.end))
        if begin == end and not moments and begin not in held.fixed_times:
            continue
        if found and found[-1].row == arc.row and begin <= found[-1].end:
            begin = found.pop().begin
        found.append(Arc(arc.row, begin, end))
    return tuple(found)


@dataclass(frozen=True)
class Rate:
    """What `Slip` is where L contains accelerations: df/dt, of q and v at a node.

    Attributes
    ----------
    value : float
    row : int
        Of the obstacle.
    edge : bool
        Whether an arc begins or ends there.
    boundary : int
        Of the mesh, where that is.
    by_place : (2 n,) array
        Derivatives by q and v there.
    by_t : float
    """

    value: float
    row: int
    edge: bool
    boundary: int
    by_place: Array
    by_t: float

    def by_times(self, stretch: Stretch) -> Array:
        """Return its derivatives as boundaries move, (J,)."""
        return self.by_t * stretch.rates[:, self.boundary]

    def by_path(self, at: DiscretePath, second: list[Array]) -> Array:
        """Return its derivative by x, (unknowns,)."""
        tr = at.tr
        number = tr.layout.number[tr.layout.offsets[self.boundary]]
        free, found = number >= 0, np.zeros(tr.layout.unknowns)
        found[number[free]] = self.by_place[free]
        return found * tr.x_unit

    def by_multipliers(self, at: DiscretePath) -> Array:
        """Return its derivatives by the multipliers of integrals that are given, (c,): none."""
        return np.zeros(at.problem.original.kappa.size)


class Slip(NamedTuple):
    """How fast a path comes to an obstacle, or leaves it, at one time of contact.

    Attributes
    ----------
    value : float
        df/dt on the free side: zero where the path meets the obstacle tangentially.
    boundary : int
        Of the mesh, where that is.
    group, span, node : Group, slice and int
        The free element's: those of its degree, its nodes among all evaluations, and which of them.
    by_p, by_q, by_t : (n,) and (n,) arrays and float
        Derivatives by the gradient of the element's action there, the coordinates and the time.
    """

    value: float
    boundary: int
    group: Group
    span: slice
    node: int
    by_p: Array
    by_q: Array
    by_t: float

    def by_times(self, stretch: Stretch) -> Array:
        """Return its derivatives as boundaries move, (J,)."""
        by_p = stretch.parts[:, self.span.start + self.node] @ self.by_p
        return by_p + self.by_t * stretch.rates[:, self.boundary]

    def by_path(self, at: DiscretePath, second: list[Array]) -> Array:
        """Return its derivative by x, (unknowns,), from the second derivatives of L.

        The element's Hessian is symmetric: that of its gradient at one node, times `by_p`, is the
        change of the whole gradient as that node moves along it.
        """
        tr, rule = at.tr, self.group.rule
        pointwise = at.problem.system.pointwise("second")
        A, B, C = (pointwise.full(k, x[self.span], symmetric=k != 1) for k, x in enumerate(second))
        by_v = rule.derivative[:, self.node, None, None] * 2 / at.mesh.lengths[self.element]
        force = by_v * B @ self.by_p
        force[self.node] += A[self.node] @ self.by_p
        p = by_v * C @ self.by_p
        p[self.node] += B[self.node].T @ self.by_p
        gradient = tr.weight[self.span] * force + rule.weighted_derivative.T @ p
        gradient[self.node] += self.by_q
        place = tr.layout.number[tr.layout.node_of[self.span]]
        free, found = place >= 0, np.zeros(tr.layout.unknowns)
        found[place[free]] = gradient[free]
        return found * tr.x_unit

    def by_multipliers(self, at: DiscretePath) -> Array:
        """Return its derivatives by the multipliers of integrals that are given, (c,)."""
        _, by_q, by_v, _ = integrands(at)
        i, sign = self.span.start + self.node, 1.0 if self.node else -1.0
        p = [
            at.tr.pull_back(by_q[:, k], by_v[:, k])[i] - sign * by_v[i, k]
            for k in range(by_q.shape[1])
        ]
        return np.array(p) @ self.by_p

    @property
    def element(self) -> int:
        """Its number in the mesh."""
        return int(self.group.elements[(self.span.start - self.group.span.start) // self.size])

    @property
    def size(self) -> int:
        """How many nodes the element has."""
        return self.group.rule.degree + 1


def slips(at: DiscretePath) -> list[Slip] | list[Rate]:
    """Return how the path meets the obstacle where contact begins and ends, on the free side."""
    if at.tr.order > 1:
        return list(_rates(at))
    met = _Meetings(at)
    return met.slips() if met.sides else []


def slip_values(at: DiscretePath) -> Array:
    """Return the values (S,) of what `slips` are."""
    if at.tr.order > 1:
        return np.array([rate.value for rate in _rates(at)])
    met = _Meetings(at)
    return met.values if met.sides else np.zeros(0)


def _rates(at: DiscretePath) -> Iterator[Rate]:
    """Yield df/dt where contact begins and ends, of a path whose velocities are unknowns."""
    held, mesh, tr = contacts_of(at.problem), at.mesh, at.tr
    m, n, places = held.system.m, held.system.n, tr.place(at.x).places
    function = rates_of_rows(held.system)
    for arc in held.arcs or ():
        for t in dict.fromkeys((arc.begin, arc.end)):
            if t in held.fixed_times:
                continue
            b = int(np.argmin(np.abs(mesh.boundaries - t)))
            place, time = places[tr.layout.offsets[b]][None], mesh.boundaries[b : b + 1, None]
            found = function(place, np.zeros((1, n)), time, held.packed)
            value, by_place, by_t = (x[0].copy() for x in found[:3])
            i, by_place = arc.row, by_place.reshape(m, -1)  # columns of the Jacobian's transpose
            yield Rate(float(value[i]), i, not arc.point, b, by_place[i], float(by_t[i]))


class _Meetings:
    """The places, S of them, where a path comes to an obstacle or leaves it, on the free side.

    They are the first or the last nodes of elements. The velocities there satisfy the constraints
    in force, by Newton's method from the polynomial's: one step where L is quadratic in v.
    """

    def __init__(self, at: DiscretePath) -> None:
        self.at, self.held, tr = at, contacts_of(at.problem), at.tr
        held, boundaries, m = self.held, tr.mesh.boundaries, self.held.free.system.m
        # The row, the boundary, the element, those of its degree and its first evaluation.
        self.sides: list[tuple[int, int, int, Group, int]] = []
        for arc in held.arcs or ():
            for t, after in ((arc.begin, False), (arc.end, True)):
                if t not in held.fixed_times:
                    b = int(np.argmin(np.abs(boundaries - t)))
                    element = b if after else b - 1
                    group = next(g for g in tr.layout.groups if element in g.elements)
                    k = int(np.searchsorted(group.elements, element))
                    begin = group.span.start + k * (group.rule.degree + 1)
                    self.sides.append((m + arc.row, b, element, group, begin))
        if self.sides:
            self._find_velocities()

    def _find_velocities(self) -> None:
        """Find the velocities (S, n), the multipliers (S, m) with them, and the slips (S,)."""
        at, held, tr, system = self.at, self.held, self.at.tr, self.held.system
        n, m, point, packed = system.n, system.m, tr.place(at.x), held.packed
        rows, where, elements, groups, begins = zip(*self.sides, strict=True)
        first = np.array(where) == elements
        self.node = np.where(first, 0, [g.rule.degree for g in groups])
        self.sign, i = np.where(first, -1.0, 1.0)[:, None], begins + self.node
        p, v = self.sign * tr.parts(at.x)[i], point.v[i]
        self.q, self.t = point.at[i], tr.times[i]
        jacobian = system.pointwise("constraint_jacobian")
        normals = jacobian.full(0, jacobian(self.q, self.t, packed)[0])
        rate = system.pointwise("constraint_rate")(self.q, self.t, packed)[0]
        b, each = tr.mesh.boundaries, np.arange(len(rows))
        self.on = held.active((b[elements,] + b[np.add(elements, 1),]) / 2).T
        G = np.where(self.on[:, :, None], normals, 0.0)
        self.K = np.zeros((each.size, n + m, n + m))
        self.K[:, n:, :n], self.K[:, :n, n:] = G, -G.transpose(0, 2, 1)
        self.K[:, range(n, n + m), range(n, n + m)] = ~self.on  # no multipliers of the others
        first_of, second = system.pointwise("first"), system.pointwise("second")
        for _ in range(1 if system.structure.constant_mass else VELOCITY_STEPS):
            mass = second(self.q, v, self.t, packed)[2]
            self.K[:, :n, :n] = second.full(2, mass, symmetric=True)
            short = p - first_of(self.q, v, self.t, packed)[1]
            off = -self.on.astype(float) * rate - (G @ v[:, :, None])[:, :, 0]
            found = np.linalg.solve(self.K, np.concatenate([short, off], axis=1)[:, :, None])
            v, self.lam = v + found[:, :n, 0], found[:, n:, 0]
        self.v, self.normal = v, normals[each, rows]
        self.values = np.sum(self.normal * v, axis=1) + rate[each, rows]

    def slips(self) -> list[Slip]:
        """Return the slips with their derivatives."""
        n, (rows, where, _, groups, begins) = self.q.shape[1], zip(*self.sides, strict=True)
        right = np.concatenate([self.normal, np.zeros(self.lam.shape)], axis=1)
        by = np.linalg.solve(self.K.transpose(0, 2, 1), right[:, :, None])[:, :, 0]
        by_p, weights = self.sign * by[:, :n], -by[:, n:]
        weights[np.arange(len(rows)), rows] = 1.0
        meeting = self.held.system.pointwise("meeting")
        state = self.q, self.v, self.t, self.held.packed
        by_q, by_t = (x.copy() for x in meeting(*state, by[:, :n], weights, self.lam))
        spans = [slice(i, i + g.rule.degree + 1) for i, g in zip(begins, groups, strict=True)]
        values, nodes, by_t = self.values.tolist(), self.node.tolist(), by_t[:, 0].tolist()
        parts = values, where, groups, spans, nodes, by_p, by_q, by_t
        return [Slip(*x) for x in zip(*parts, strict=True)]
