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

from collections.abc import Iterable
from dataclasses import dataclass, field

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
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.mechanics.question.held import Held, contacts_of
from actionopt.mechanics.question.obstacle import Arc, rates_of_rows
from actionopt.mechanics.question.problem import Problem
from actionopt.tools.blas import solve_each
from actionopt.tools.cached import cached_property
from actionopt.tools.types import Array, NDInt

# Slips that change by less with the times of contact, over the duration and in a typical rate of f,
# change by round-off, as where nothing presses, whatever the times are. Ad hoc.
PRESSING = 1e-12
FLAT_MOMENT = 1e-8  # in a typical f over the duration's square: d2f/dt2 that is none; ad hoc
VELOCITY_STEPS = 4  # of Newton's method from the polynomial's velocity: it converges in two


def with_contact_times(tr: Transcription, moves: Array) -> Transcription:
    """Return the discrete problem whose times of contact (J,) move, and the elements with them."""
    held = contacts_of(tr.problem)
    before, now = held.divisions - held.start.t, held.divisions.copy()
    now[held.divisions.searchsorted(held.contact_times)] += moves
    after = dict(zip(held.divisions.tolist(), now.tolist(), strict=True))
    moved = held.holding(
        tuple(
            [
                Arc(arc.row, after.get(arc.begin, arc.begin), after.get(arc.end, arc.end))
                for arc in held.arcs or ()
            ]
        )
    )
    now -= held.start.t
    before[-1] = now[-1] = held.duration
    mesh = tr.mesh.with_times(np.interp(tr.mesh.since, before, now))
    return tr.on_elements(moved, mesh)


class TangencyMatrix:
    """The factors of Newton's matrix for a path and its times of contact, J of them, at one path.

    Those of the path alone are its `factors`. Both at once: between given times of contact a path
    that is stationary meets the obstacle at an angle whose square the times determine, and may not
    exist at all. A `force` (size,) is what the residual of the path is to be in place of zero.
    Raises LinAlgError where the matrix of the path is singular, or not finite.
    """

    def __init__(self, equations: Equations, z: Array, force: Array | float = 0.0) -> None:
        tr, held = equations.at(z), contacts_of(equations.at(z).problem)
        where = held.knots.searchsorted(held.contact_times)
        each = np.arange(where.size)
        # All times from one on move, so that a short part behind it keeps its length.
        self._shifted = (where[:, None] == where) & (each[:, None] >= each)
        columns, rows, corner, self._values = contact_edges(equations, z)
        self._z, self._rows = z, rows
        self.factors = Factors(equations.layout, equations.kkt(z), many=True)
        pull = force - equations.residual(z)
        solved = self.factors.solve_many(np.column_stack([columns @ self._shifted, pull]))
        self._moves, self._step = -solved[:, :-1], solved[:, -1]
        slopes = rows @ self._moves + corner @ self._shifted
        across, sizes, along = np.linalg.svd(slopes, full_matrices=False)
        pressed = sizes > PRESSING * float(tr.row_units.max()) / held.duration**2
        self._inverse = -(along[pressed].T / sizes[pressed]) @ across.T[pressed]

    def step(
        self, equations: Equations, z: Array, force: Array | float = 0.0
    ) -> tuple[Array, Array]:
        """Return the step (J,) for the times of contact and that of z (size,), with it.

        It is Newton's where the matrix is that at z; a simplified one where times and z have moved
        since. With the `force` of the matrix.
        """
        if z is self._z:
            step = self._step
            slip = self._values + self._rows @ step
        else:
            step = self.factors.solve(force - equations.residual(z))
            there = DiscretePath(equations.at(z + step), (z + step)[: equations.at(z).layout.size])
            slip = slips(there).values
        change = self._inverse @ slip
        return self._shifted @ change, step + self._moves @ change


def contact_edges(equations: Equations, z: Array) -> tuple[Array, ...]:
    """Return the border of the matrix of a path for its times of contact, J of them.

    The derivatives of its residual by each time alone (size, J), and of the slips by z (J, size)
    and by the times (J, J). And the slips (J,).
    """
    tr = equations.at(z)
    held, layout = contacts_of(tr.problem), tr.layout
    at = DiscretePath(tr, z[: layout.size])
    where = held.divisions.searchsorted(held.contact_times)
    count, beside = where.size, []
    # Boundaries move in proportion between the times that do and their neighbours.
    part = np.interp(tr.mesh.boundaries, held.divisions, np.arange(held.divisions.size))
    rates = np.maximum(1 - np.abs(part - where[:, None]), 0.0)
    events = np.zeros(0, dtype=int)  # whose times are unknown, too
    if isinstance(equations, Bordered):
        beside, events = zip(equations.borders, equations.parts, strict=True), equations.moving
        rates = np.vstack([rates, tr.joint_rates[events]])
    stretch, met = Stretch(at, rates), slips(at)
    columns, rows = np.zeros((z.size, count)), np.zeros((met.values.size, z.size))
    columns[: layout.size] = stretch.residuals()[:, :count]
    rows[:, : layout.unknowns] = met.by_path(stretch.second)
    own = met.by_times(stretch)
    for border, part in beside:
        if isinstance(border, Times):
            bend = stretch.twice()[count:, :count]
            # The parts of a leg at which contact is change with its duration.
            joints = tr.mesh.nodes[tr.joints]
            leg = np.searchsorted(joints, held.contact_times, side="right") - 1
            turn = stretch.slopes()[:count] / np.diff(joints)[leg]
            bend += turn * ((events[:, None] == leg + 1).astype(float) - (events[:, None] == leg))
            change = border.jacobian(z[part])[events]
            columns[part] = change.T @ bend / tr.action_unit
            rows[:, part] = own[:, count:] @ change
        elif isinstance(border, Integral):
            columns[part] = integrals_by(stretch)[:, :count] / border.units[:, None]
            rows[:, part] = met.by_multipliers() * border.unit / border.units
    return columns, rows, own[:, :count], met.values


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
            after = self.held.divisions.copy()
            after[after.searchsorted(self.times)] += moves
            if not (np.diff(after) > 0).all():
                raise np.linalg.LinAlgError("a part in contact, or between two, has vanished")
            tr = with_contact_times(first, moves)
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
        met = slips(DiscretePath(equations.at(own), own[: self.first.layout.size])).values
        return np.r_[equations.residual(own), met / self.unit]

    def kkt(self, y: Array) -> Array:
        """Return the nonzeros of the derivative of `residual`, as the layout says."""
        equations, own = self._equations_at(y)
        tr = equations.at(own)
        T = self._durations(tr)
        columns, rows, corner, _ = contact_edges(equations, own)
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
    kept, flat = tr.row_multipliers(at.z), FLAT_MOMENT * tr.row_units / held.duration**2
    met = Rates(at)
    accelerations = met.accelerations()
    for row, slope, edge, node, bent in zip(
        met.row, met.by_place * tr.place_units, met.edge, met.nodes, accelerations, strict=True
    ):
        number = layout.number[node]
        free = number >= 0
        if edge or bent < flat[row]:
            rows.append(np.zeros(layout.unknowns))
            rows[-1][number[free]] = slope[free]
            continue
        nu = -kept[node, row] / tr.action_unit
        square = np.outer(slope[free], slope[free])
        layout.blocks.add(nonzeros, number[free], nu / bent * square)
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


class Rates:
    """What `Slips` are where L contains accelerations: df/dt, of q and v at S nodes.

    Each is of a `row` of the obstacle; an arc begins or ends there if `edge` says so. The `values`
    (S,) of df/dt have derivatives by q and v, `by_place` (S, 2 n), and by the time, `by_t` (S,).
    """

    def __init__(self, at: DiscretePath) -> None:
        self.at, held = at, contacts_of(at.problem)
        self.row, times, self.edge = _columns(
            (arc.row, t, not arc.point)
            for arc in held.arcs or ()
            for t in dict.fromkeys((arc.begin, arc.end))
            if t not in held.fixed_times
        )
        self.boundary = _nearest(at.mesh.boundaries, times)
        self.nodes = at.tr.layout.offsets[self.boundary]
        each, count = np.arange(times.size), times.size
        value, by_place, by_t, _ = self._evaluate(np.zeros((count, held.system.n)))
        # Of the Jacobian's transpose.
        by_place = by_place.reshape(count, held.system.m, 2 * held.system.n)
        self.values, self.by_place = value[each, self.row], by_place[each, self.row]
        self.by_t = by_t[each, self.row]

    def _evaluate(self, a: Array) -> list[Array]:
        at, held = self.at, contacts_of(self.at.problem)
        times = at.mesh.boundaries[self.boundary, None]
        places = at.tr.place(at.x).places[self.nodes]
        return rates_of_rows(held.system)(places, a, times, held.packed)

    def accelerations(self) -> Array:
        """Return d2f/dt2, (S,)."""
        return self._evaluate(self.at.rates[1][self.nodes])[3][np.arange(self.row.size), self.row]

    def by_times(self, stretch: Stretch) -> Array:
        """Return their derivatives as boundaries move, (S, J)."""
        return (self.by_t * stretch.rates[:, self.boundary]).T

    def by_path(self, _: list[Array]) -> Array:
        """Return their derivatives by x, (S, unknowns)."""
        return _at_unknowns(self.at.tr, self.at.tr.layout.number[self.nodes], self.by_place)

    def by_multipliers(self) -> Array:
        """Return their derivatives by the multipliers of integrals, (S, c): none."""
        return np.zeros((self.row.size, self.at.problem.original.kappa.size))


class Slips:
    """How fast a path comes to an obstacle, or leaves it, at S times of contact.

    That is df/dt on the free side, zero where the path meets the obstacle tangentially: at the
    first or the last nodes of elements. The velocities there satisfy the constraints in force, by
    Newton's method from the polynomial's: one step where L is quadratic in v.
    """

    def __init__(self, at: DiscretePath) -> None:
        held, tr = contacts_of(at.problem), at.tr
        self.at, mesh, m = at, tr.mesh, held.free.system.m
        self._row, times, after = _columns(
            (m + arc.row, t, after)
            for arc in held.arcs or ()
            for t, after in ((arc.begin, 0), (arc.end, 1))
            if t not in held.fixed_times
        )
        self._boundary = _nearest(mesh.boundaries, times)
        self._element = self._boundary - 1 + after
        # The first evaluation of each element, the node of it, and its evaluation.
        self._begin = (tr.layout.element_of == self._element[:, None]).argmax(axis=1)
        self._node = np.where(after, 0, np.array(mesh.degrees)[self._element])
        self._own = self._begin + self._node
        self._sign = np.where(after, -1.0, 1.0)[:, None]
        self._find_velocities()

    def _find_velocities(self) -> None:
        """Find the velocities (S, n), the multipliers (S, m) with them, and the slips (S,)."""
        at, held, i = self.at, contacts_of(self.at.problem), self._own
        tr, system, packed = at.tr, held.system, held.packed
        n, m, point = system.n, system.m, tr.place(at.x)
        p, v = self._sign * tr.parts(at.x)[i], point.v[i]
        self._q, self._t = q, t = point.at[i], tr.times[i]
        jacobian = system.pointwise("constraint_jacobian")
        normals = jacobian.full(0, jacobian(q, t, packed)[0])
        rate = np.zeros((i.size, m))
        if system.structure.depends_on_time:
            rate = system.pointwise("constraint_rate")(q, t, packed)[0]
        b, each = tr.mesh.boundaries, np.arange(i.size)
        on = held.active((b[self._element] + b[self._element + 1]) / 2).T
        G = np.where(on[:, :, None], normals, 0.0)
        self._K = np.zeros((i.size, n + m, n + m))
        self._K[:, n:, :n], self._K[:, :n, n:] = G, -G.transpose(0, 2, 1)
        self._K[:, range(n, n + m), range(n, n + m)] = ~on  # no multipliers of the others
        first, second = system.pointwise("first"), system.pointwise("second")
        steady = system.structure.steady_forces
        for k in range(1 if system.structure.constant_mass else VELOCITY_STEPS):
            mass = tr.second(at.x)[2][i] if steady else second(q, v, t, packed)[2]
            self._K[:, :n, :n] = second.full(2, mass, symmetric=True)
            # Of the polynomial's velocity they are known.
            short = p - (first(q, v, t, packed)[1] if k else tr.first(at.x)[1][i])
            off = -on.astype(float) * rate - (G @ v[:, :, None])[:, :, 0]
            found = solve_each(self._K, np.concatenate([short, off], axis=1))
            v, self._lam = v + found[:, :n], found[:, n:]
        self._v, self._normal = v, normals[each, self._row]
        self.values = (self._normal * v).sum(axis=1) + rate[each, self._row]

    @cached_property
    def _by(self) -> tuple[Array, Array, Array]:
        """Their derivatives by the gradient of the element's action, by q (S, n), and t (S, 1)."""
        held, n = contacts_of(self.at.problem), self._q.shape[1]
        right = np.concatenate([self._normal, np.zeros(self._lam.shape)], axis=1)
        by = solve_each(self._K.transpose(0, 2, 1), right)
        by_p, weights = by[:, :n], -by[:, n:]
        weights[np.arange(len(by)), self._row] = 1.0
        meeting = held.system.pointwise("meeting")
        state = self._q, self._v, self._t, held.packed
        by_q, by_t = meeting(*state, by_p, weights, self._lam)
        return self._sign * by_p, by_q.copy(), by_t.copy()

    def by_times(self, stretch: Stretch) -> Array:
        """Return their derivatives as boundaries move, (S, J)."""
        by_p, _, by_t = self._by
        by_parts = (stretch.parts[:, self._own] * by_p).sum(axis=2)
        return by_parts.T + by_t * stretch.rates[:, self._boundary].T

    def by_path(self, second: list[Array]) -> Array:
        """Return their derivatives by x, (S, unknowns), from the second derivatives of L.

        The element's Hessian is symmetric: that of its gradient at one node, times what the slip
        changes by with that, is the change of the whole gradient as that node moves along it.
        """
        tr, (by_p, by_q, _) = self.at.tr, self._by
        layout, n = tr.layout, by_p.shape[1]
        pointwise = self.at.problem.system.pointwise("second")
        found = np.zeros((by_p.shape[0], layout.unknowns))
        for g in layout.groups:
            mine = ((self._begin >= g.span.start) & (self._begin < g.span.stop)).nonzero()[0]
            if not mine.size:
                continue
            each, node = np.arange(mine.size), self._node[mine]
            at = self._begin[mine, None] + np.arange(g.rule.degree + 1)
            along, own = by_p[mine], (each, node)
            A, B, C = (x[at.ravel()] for x in second)
            by_v = g.rule.derivative.T[node] * (2 / tr.mesh.lengths[self._element[mine], None])
            moved = (by_v[:, :, None] * along[:, None]).reshape(-1, n)
            force = pointwise.product(1, B, moved).reshape(*at.shape, n)
            p = pointwise.product(2, C, moved, symmetric=True).reshape(*at.shape, n)
            here = each * at.shape[1] + node
            force[own] += pointwise.product(0, A[here], along, symmetric=True)
            p[own] += pointwise.product(1, B[here], along, transposed=True)
            gradient = tr.weight[at] * force + g.rule.weighted_derivative.T @ p
            gradient[own] += by_q[mine]
            found[mine] = _at_unknowns(tr, layout.number[layout.node_of[at]], gradient)
        return found

    def by_multipliers(self) -> Array:
        """Return their derivatives by the multipliers of integrals that are given, (S, c)."""
        _, by_q, by_v, _ = integrands(self.at)
        i, tr, by_p = self._own, self.at.tr, self._by[0]
        p = [
            tr.pull_back(by_q[:, k], by_v[:, k])[i] - self._sign * by_v[i, k]
            for k in range(by_q.shape[1])
        ]
        return (np.array(p) * by_p).sum(axis=2).T


def slips(at: DiscretePath) -> Slips | Rates:
    """Return how the path meets the obstacle where contact begins and ends, on the free side."""
    return Rates(at) if at.tr.order > 1 else Slips(at)


def _columns(sides: Iterable[tuple[int, float, int]]) -> tuple[NDInt, Array, NDInt]:
    """Return the columns of a table of rows, times and whether something is so, (S,) each."""
    rows, times, so = np.array([*sides], dtype=float).reshape(-1, 3).T
    return rows.astype(int), times, so.astype(int)


def _nearest(boundaries: Array, times: Array) -> NDInt:
    """Return the boundaries nearest to times (S,)."""
    return np.abs(boundaries - times[:, None]).argmin(axis=1)


def _at_unknowns(tr: Transcription, number: NDInt, by_place: Array) -> Array:
    """Return derivatives by x, (S, unknowns), of those by unknowns of a `number`, -1 for none."""
    found, shape = np.zeros((len(number), tr.layout.unknowns + 1)), (len(number), number[:1].size)
    found[np.arange(len(number))[:, None], number.reshape(shape)] = by_place.reshape(shape)
    return found[:, :-1] * tr.x_unit
