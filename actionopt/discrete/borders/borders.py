"""Borders: what is to be found beside a path, with as many equations.

A question is stationary in everything unknown. Edges the coordinates z of the path that is the
logarithm of a duration, the multipliers of a surface on which an event lies, or the forces that
hold a closed path in its place; `bordered` puts them round the KKT matrix.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple, Protocol

import numpy as np

from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.borders.integrals import integrals, integrals_by_times, integrands
from actionopt.discrete.borders.surfaces import event_at, reactions, surface_at
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.mechanics.conservation.symmetry import find_symmetries
from actionopt.mechanics.laws.identity import general_points
from actionopt.mechanics.laws.tracing import MULTIPLIERS
from actionopt.mechanics.question.problem import Problem
from actionopt.mechanics.question.scales import first_state
from actionopt.tools.immutable import immutable
from actionopt.tools.types import EPS, Array, NDInt

OFF = 20.0  # |log T| against the first duration that is reckoned with; ad hoc
# The same of a leg beside others, whose times have to be told apart: exp(-24) is 4e-11. Ad hoc.
FAR_OFF = 12.0
# Directions in which a path moves less than this, in the coordinates' sizes, against its others are
# none of their own, as time along a path at rest, or a turn of one that turns anyway. Ad hoc.
DISTINCT = 1e-4
# Rate of a coordinate, in its largest, from which it says where a path begins, or which of a family
# it is.
SWIFT, SLOW = 0.1, 1e-3  # ad hoc


@dataclass(eq=False)
class Gradient:
    """The derivatives of W, the sum of the action and of all borders' terms, in units of action."""

    path: Array  # (size,): by the unknowns of the path: the residual of its equations
    times: Array  # (k + 2,): by the times of the events, at fixed coordinates at the nodes


@dataclass(eq=False)
class Bend:
    """The second derivatives of W by the path and by the times, which borders add their own to."""

    K: Array  # the nonzeros of the path's own matrix
    # (size, k + 2): of the residual of the path's equations by the times of the events, if they are
    # unknown.
    path: Array | None = None
    # (k + 2, k + 2): by the times twice.
    times: Array = field(default_factory=lambda: np.zeros((0, 0)))


class Edges(NamedTuple):
    """A border's parts of the matrix: columns (size, b), rows (b, size) and a corner (b, b).

    `columns` are the derivatives of the path's equations by its unknowns beta, `rows` those of its
    own equations by the path's unknowns, `corner` those by beta. A term of W has rows = columns'.
    `times` (b, k + 2), if there are any, are those of its own equations by the times of the events.
    """

    columns: Array
    rows: Array
    corner: Array
    times: Array | None = None


class Border(Protocol):
    """A few unknowns beta (b,) beside the path, and b equations: by default dW/dbeta = 0.

    `Bordered` holds a tuple of borders, in the order of their unknowns behind those of the path. No
    border knows of another one: one whose terms contain times of events adds their derivatives to
    `Gradient.times` and `Bend`, as if each time were a variable of its own, and `Bordered` makes of
    them derivatives by the unknowns of `Times`. A border that replaces an equation (tangency for
    [H] = 0, an arclength) returns its own in place of dW/dbeta.
    With each multiplier among them the matrix has one negative eigenvalue more than W has
    directions in which it falls: index = negative eigenvalues - multipliers.
    """

    @property
    def size(self) -> int:
        """The number b of unknowns, and of equations."""
        ...

    @property
    def multipliers(self) -> int:
        """How many of them are multipliers."""
        ...

    def begin(self, at: DiscretePath) -> Array:
        """Return first values of the unknowns, (b,), for a path near the one that is sought."""
        ...

    def residual(self, at: DiscretePath, beta: Array, gradient: Gradient) -> Array:
        """Return the border's own equations, (b,), and add its terms' derivatives to `gradient`.

        What borders before it have added, is there already.
        """
        ...

    def derivative(self, at: DiscretePath, beta: Array, bend: Bend) -> Edges:
        """Return its parts of the matrix, at fixed times; add second derivatives to `bend`."""
        ...


# -- the times of the events ----------------------------------------------------------------------


def over(problem: Problem, duration: float) -> Problem:
    """Return the problem at a duration, where its own is free; the times that are given stay."""
    if not problem.free_time:  # times between the ends may be unknown still
        return problem
    return problem.found_at(times_over(problem, duration))


def times_over(problem: Problem, duration: float) -> tuple[float, float]:
    """Return the times of the events at a duration, where one of them or both are free."""
    t0, t1 = problem.start.t, problem.end.t
    if t0 is None:
        t0 = 0.0 if t1 is None else t1 - duration
    return t0, t0 + duration if t1 is None else t1


def times_of(problem: Problem) -> Array:
    """Return the times of a problem's events, (k + 2,); NaN where one is to be found."""
    return np.array([np.nan if e.t is None else e.t for e in problem.joints_found])


class Legs(NamedTuple):
    """The times of events (k + 2,) and dt/dbeta (k + 2, b) that belong to unknowns of `Times`.

    And of each run its legs, its unknowns, its durations, and whether these share a time.
    """

    times: Array
    jacobian: Array
    parts: list[tuple[slice, slice, Array, bool]]


@immutable
class Times:
    """The times of the events: [H] = 0 at each that is free, H = E at an end.

    Unknowns are the logarithms of the legs' durations in units of `first`, so that times cannot
    cross. Between two times that are given the durations share what there is,

        h_j = T exp(beta_j) first_j / sum exp(beta) first,

    and the last of these legs has no unknown of its own.
    """

    given: Array  # (k + 2,): the times that are given; NaN for the others
    first: Array  # (k + 1,)
    energy: float  # E
    multipliers = 0
    _last: dict[str, Any] = field(default_factory=dict, init=False, repr=False)

    @cached_property
    def runs(self) -> list[tuple[slice, float | None]]:
        """The legs between events of given times, and what time they share; None if they do not.

        Only runs of which something is unknown.
        """
        fixed = np.flatnonzero(np.isfinite(self.given)).tolist()
        if not fixed:  # the first time may be chosen
            return [(slice(0, self.first.size), None)]
        found: list[tuple[slice, float | None]] = []
        if fixed[0]:
            found.append((slice(0, fixed[0]), None))
        for a, b in pairwise(fixed):
            if b > a + 1:
                found.append((slice(a, b), float(self.given[b] - self.given[a])))
        if fixed[-1] < self.first.size:
            found.append((slice(fixed[-1], self.first.size), None))
        return found

    @property
    def moving(self) -> NDInt:
        """The events whose times are unknown; the first one's may be chosen if all are."""
        free = np.isnan(self.given)
        free[0] &= not free.all()
        return np.flatnonzero(free)

    @property
    def size(self) -> int:
        """The number of unknown durations."""
        return sum(run.stop - run.start - (T is not None) for run, T in self.runs)

    def begin(self, at: DiscretePath) -> Array:
        """Return the unknowns of a path, (b,)."""
        times = at.mesh.nodes_since[at.tr.joints]
        ratio, found = np.log(np.diff(times) / self.first), []
        for run, T in self.runs:
            part = ratio[run]
            found.append(part if T is None else part[:-1] - part[-1])
        return np.concatenate(found)

    def times(self, beta: Array) -> Array:
        """Return the times of the events, (k + 2,)."""
        return self._at(beta).times

    def _at(self, beta: Array) -> Legs:
        """Return the legs for the unknowns beta (b,); they are kept until beta changes."""
        key = beta.tobytes()
        known = self._last.get("legs")
        if known is None or known[0] != key:
            self._last["legs"] = known = key, self._legs(beta)
        return known[1]

    @cached_property
    def _given_events(self) -> NDInt:
        """The events whose times are given, or the first one if none is."""
        fixed = np.flatnonzero(np.isfinite(self.given))
        return fixed if fixed.size else np.zeros(1, dtype=int)

    def _legs(self, beta: Array) -> Legs:
        """Return the legs for the unknowns beta (b,), computed anew."""
        if self.first.size == 1:  # in short what follows does
            h = self.first * math.exp(min(max(float(beta[0]), -OFF), OFF))
            t0, t1 = self.given.tolist()
            change = np.array([[0.0, -h[0]], [h[0], 0.0]])[:, int(t1 == t1), None]
            start = t1 - h[0] if t1 == t1 else t0 if t0 == t0 else 0.0
            times = [start, t1 if t1 == t1 else start + h[0]]
            return Legs(np.array(times), change, [(slice(0, 1), slice(0, 1), h, False)])
        known = self.given[1:] - self.given[:-1]
        h = np.where(np.isfinite(known), known, self.first)
        by_h, parts, place = np.zeros((h.size, beta.size)), [], 0
        factors = np.exp(np.minimum(np.maximum(beta, -FAR_OFF), FAR_OFF))
        for run, T in self.runs:
            count = run.stop - run.start - (T is not None)
            own = slice(place, place := place + count)
            if T is None:
                part = self.first[run] * factors[own]
                by_h[range(run.start, run.stop), range(own.start, own.stop)] = part
            else:
                part = self.first[run] * np.append(factors[own], 1.0)
                part *= T / part.sum()
                by_h[run, own] = (np.diag(part) - np.outer(part, part) / T)[:, :-1]
            h[run] = part
            parts.append((run, own, part, T is not None))
        since, change = np.zeros(h.size + 1), np.zeros((h.size + 1, beta.size))
        since[1:], change[1:] = h.cumsum(), by_h.cumsum(axis=0)
        start, given = self._given_events[0], self.given[self._given_events]
        times = since - since[start]
        if given[0] == given[0]:
            times += given[0]
            times[self._given_events] = given
        return Legs(times, change - change[start], parts)

    def residual(self, at: DiscretePath, beta: Array, gradient: Gradient) -> Array:
        """Return d(W + E T)/dbeta, (b,)."""
        return self.jacobian(beta).T @ self.slopes(at, gradient)

    def slopes(self, at: DiscretePath, gradient: Gradient) -> Array:
        """Return d(W + E T)/dt, (k + 2,)."""
        found = gradient.times.copy()
        found[[0, -1]] += np.array([-1.0, 1.0]) * self.energy / at.tr.action_unit
        return found

    def jacobian(self, beta: Array) -> Array:
        """Return dt/dbeta, (k + 2, b)."""
        return self._at(beta).jacobian

    def twice(self, beta: Array, slopes: Array) -> Array:
        """Return sum slopes d2t/dbeta2, (b, b), for slopes (k + 2,)."""
        if self.first.size == 1:  # in short what follows does
            by_h = slopes[1] - (slopes.sum() if self._given_events[0] else 0.0)
            return by_h * self._at(beta).parts[0][2][:, None]
        by_h = np.cumsum(slopes[:0:-1])[::-1].copy()  # by the durations
        by_h[: self._given_events[0]] -= slopes.sum()
        found = np.zeros((beta.size, beta.size))
        for run, own, h, shared in self._at(beta).parts:
            g = by_h[run]
            if not shared:
                found[own, own] = np.diag(g * h)
                continue
            T, mean = h.sum(), float(g @ h / h.sum())
            part = np.diag(h * (g - mean))
            part -= (np.outer(h * (g - mean), h) + np.outer(h, h * (g - mean))) / T
            found[own, own] = part[:-1, :-1]
        return found

    def derivative(self, at: DiscretePath, beta: Array, bend: Bend) -> Edges:
        """Return zeros: `Bordered` makes those by beta of what `bend` has by the times."""
        b = self.size
        empty = np.zeros((at.tr.layout.size, b))
        return Edges(empty, empty.T, np.zeros((b, b)))


# -- rows of a surface ----------------------------------------------------------------------------


@immutable
class Rows:
    """An event on a surface, on(q, t) = 0: W has the term mu.on, and mu are the unknowns.

    They balance the momentum there. With holonomic constraints f the moves along both are left, and
    p1 = -mu on_q - nu f_q: the end's own part nu of the constraint's multiplier is a force that
    acts for no time.
    """

    event: int  # its number, the start being 0
    free: NDInt  # (k,): coordinates that the event does not give
    places: NDInt  # (k,): theirs among the unknowns
    # (s,): of the rows: what they change by as the coordinates change by their lengths.
    units: Array

    @property
    def size(self) -> int:
        """The number s of expressions."""
        return self.units.size

    multipliers = size  # all of them are

    @classmethod
    def of(cls, at: DiscretePath) -> list[Rows]:
        """Return the rows of the events of a path that lie on surfaces, and are free to move."""
        found = []
        for k, event in enumerate(at.problem.joints):
            if event.on is not None:
                free = np.array([i for i, x in enumerate(event.q) if x is None])
                by_q = surface_at(at, k)[1]
                sizes = np.abs(by_q[:, free] * at.tr.lengths[free]).max(axis=1)
                units = np.where(np.isfinite(sizes) & (sizes > 0), sizes, 1.0)
                found.append(cls(k, free, at.tr.layout.number[at.tr.joints[k], free], units))
        return found

    def begin(self, at: DiscretePath) -> Array:
        """Return the multipliers that balance the momentum best, (s,)."""
        return self.units * reactions(at, self.event)[0] / at.tr.action_unit

    def residual(self, at: DiscretePath, beta: Array, gradient: Gradient) -> Array:
        """Return on (s,), in units of the rows."""
        on, by_q, by_t, _ = surface_at(at, self.event)
        gradient.path[self.places] += beta @ self._scale(at, by_q)
        gradient.times[self.event] += float(beta @ (by_t / self.units))
        return on / self.units

    def _scale(self, at: DiscretePath, by_q: Array) -> Array:
        """Return the derivatives of the rows by the unknowns, (s, k), of those by q (s, n)."""
        return by_q[:, self.free] * at.tr.lengths[self.free] / self.units[:, None]

    def derivative(self, at: DiscretePath, beta: Array, bend: Bend) -> Edges:
        """Return the rows' derivatives; their curvature is added to the path's."""
        layout, s, k = at.tr.layout, self.size, self.event
        rows = np.zeros((s, layout.size))
        _, by_q, by_t, _ = surface_at(at, k)
        rows[:, self.places] = self._scale(at, by_q)
        event, t = event_at(at, k)
        q = at.Q[at.tr.joints[k]]
        bent = event.on.bending(q, t, at.problem.packed, beta / self.units)
        lengths = at.tr.lengths[self.free]
        curved = bent[np.ix_(self.free, self.free)] * lengths[:, None] * lengths
        layout.add(bend.K, self.places, curved)
        edges = Edges(rows.T, rows, np.zeros((s, s)))
        if bend.path is None:
            return edges
        bend.path[self.places, k] += bent[self.free, -1] * lengths
        bend.times[k, k] += bent[-1, -1]
        times = np.zeros((s, len(bend.times)))
        times[:, k] = by_t / self.units
        return edges._replace(times=times)


# -- the value of an integral --------------------------------------------------------------------


@immutable
class Integral:
    """Integrals along the path that are given, int g dt = G: W has the term kappa.(int g dt - G).

    The unknowns are kappa (c,). kappa.g is part of the Lagrangian of the problem's system, so that
    all but the rows themselves follows from that (Gelfand and Fomin, *Calculus of Variations*
    (1963), section 12).
    """

    values: Array  # (c,): G
    # (c,): of the rows: what they change by as all coordinates change by their lengths.
    units: Array
    unit: float  # of the action

    @property
    def size(self) -> int:
        """The number c of integrals."""
        return self.values.size

    multipliers = size  # all of them are

    @classmethod
    def of(cls, at: DiscretePath) -> Integral:
        """Return the border of the integrals whose values the problem of a path gives."""
        values, change = np.array(at.problem.integral), np.abs(integrals(at)[1]).sum(axis=1)
        units = np.where(np.isfinite(change) & (change > 0), change, 1.0)
        return cls(values, units, at.tr.action_unit)

    def kappa(self, beta: Array) -> Array:
        """Return the multipliers in the user's units, (c,)."""
        return beta * self.unit / self.units

    def begin(self, at: DiscretePath) -> Array:
        """Return the multipliers of a path, (c,)."""
        return at.problem.kappa * self.units / self.unit

    def residual(self, at: DiscretePath, beta: Array, gradient: Gradient) -> Array:
        """Return int g dt - G, (c,), in units of the rows."""
        return (integrals(at)[0] - self.values) / self.units

    def derivative(self, at: DiscretePath, beta: Array, bend: Bend) -> Edges:
        """Return the derivatives of the rows."""
        layout, c = at.tr.layout, self.size
        rows = np.zeros((c, layout.size))
        rows[:, : layout.unknowns] = integrals(at)[1] / self.units[:, None]
        times = None if bend.path is None else integrals_by_times(at) / self.units[:, None]
        return Edges(rows.T, rows, np.zeros((c, c)), times)

    def misread(self, at: DiscretePath) -> Array:
        """Return the round-off of the rows, (c,): an eps each for the values and for the sums.

        And for the velocities: an eps of the coordinates' sizes in w v at each node, as w d / h is
        about one on an element of the length h and of degree d. They are rounded independently.
        """
        g, _, by_v, _ = integrands(at)
        velocities = np.linalg.norm(np.abs(by_v) @ at.tr.lengths, axis=0)
        return EPS * (2 * (at.tr.weight[:, 0] @ np.abs(g)) + velocities) / self.units


# -- where a closed path begins -------------------------------------------------------------------


class Move(NamedTuple):
    """A motion of configuration space xi = b + A q under which L does not change."""

    A: Array
    b: Array


def moves_of(problem: Problem) -> tuple[Move, ...]:
    """Return the motions of configuration space that a closed path may be subjected to."""
    if not problem.closes or (problem.system.n == 1 and _has_force(problem)):
        return ()
    outside, advance = problem.free.system, problem.advance
    system = outside.without_obstacle if outside.r else outside
    known = system.memoize("moves", dict)
    key = problem.packed.tobytes()
    if key not in known:
        values = problem.parameters
        if problem.integral is not None:  # the multipliers are to be found: in general position
            values = {**values, MULTIPLIERS: general_points(problem.kappa.size)[0]}
        found = find_symmetries(system, parameters=values)
        known[key] = [Move(s.A, s.b) for s in found if not (s.time or s.rate or s.c.any())]
    # What is moved closes as well: xi(P q + a) = P xi(q).
    P = np.eye(system.n)[list(problem.order)]
    kept = [np.r_[(A @ P - P @ A).ravel(), A @ advance + b - P @ b] for A, b in known[key]]
    if outside.r:  # and moves along the obstacle's surfaces
        q, normals = general_points(system.n), outside.with_contact.pointwise("constraint_jacobian")
        G = normals.full(0, normals(q, np.zeros((len(q), 1)), problem.packed)[0])[:, system.m :]
        into = [np.einsum("kri,ki->kr", G, q @ A.T + b).ravel() for A, b in known[key]]
        kept = [np.r_[pair] for pair in zip(kept, into, strict=True)]
    if not np.any(kept):
        return tuple(known[key])
    _, values, right = np.linalg.svd(np.transpose(kept))
    size = np.zeros(len(right))
    size[: values.size] = values
    A, b = (np.array(part) for part in zip(*known[key], strict=True))
    return tuple(Move(np.tensordot(x, A, 1), x @ b) for x in right[size <= DISTINCT * size.max()])


def _has_force(problem: Problem) -> bool:
    """Whether a body is pushed where it is at rest: then nothing moves its one coordinate.

    For xi L_q + A v L_v is a derivative by the time, and vanishes where v does.
    """
    q = general_points(1)
    state = first_state(problem.system, q, np.zeros_like(q))
    with np.errstate(all="ignore"):
        force = problem.system.pointwise("first")(*state, np.zeros_like(q), problem.packed)[0]
    return bool((force[:, 0] != 0).any())


@immutable
class PhaseCondition:
    """Forces a (k,) along directions B, and as many conditions C z = c that say where the path is.

    They replace equations that W gives, which hold whatever the phase is. The forces vanish at a
    path up to its discretization, as no symmetric system can be pushed along its symmetry and
    close: they are the unfolding parameters of Munoz-Almaraz, Freire, Galan, Doedel and
    Vanderbauwhede, *Physica D* 181 (2003), p. 1. The condition is that of least distance from the
    first iterate,
    int xi.(q - q_first) dt = 0 (Doedel, in *Numerical Continuation Methods for Dynamical Systems*
    (2007), section 1.3.6), or a coordinate that the start gives.
    """

    # B, C (size, k), (k, size)
    B: Array
    C: Array
    c: Array  # (k,)
    # Coordinates that the start gives, and the first of the conditions say.
    given: tuple[int, ...] = field(default=())

    @property
    def size(self) -> int:
        """The number k of directions."""
        return self.c.size

    multipliers = size  # all of them are

    def begin(self, at: DiscretePath) -> Array:
        """Return no forces, (k,)."""
        return np.zeros(self.size)

    def residual(self, at: DiscretePath, beta: Array, gradient: Gradient) -> Array:
        """Return C z - c, (k,)."""
        gradient.path += self.B @ beta
        return self.C @ at.z - self.c

    def derivative(self, at: DiscretePath, beta: Array, bend: Bend) -> Edges:
        """Return B and C."""
        return Edges(self.B, self.C, np.zeros((self.size, self.size)))

    def of(self, problem: Problem, lengths: Array) -> PhaseCondition:
        """Return that of another member of a family, whose start gives other numbers."""
        values = [problem.start.q[i] / lengths[i] for i in self.given]  # type: ignore[operator]
        return PhaseCondition(self.B, self.C, np.r_[values, self.c[len(values) :]], self.given)

    @classmethod
    def near(
        cls, asked: Problem, at: DiscretePath, moves: Sequence[Move], along: Sequence[Array]
    ) -> PhaseCondition:
        """Return the directions in which a path may be moved, and conditions for where.

        `along`, (n, K) each, are these where there are more than along itself and by the `moves`.
        """
        tr, z = at.tr, at.z
        layout, size = tr.layout, tr.layout.size
        fields = [direction.T for direction in along]
        if not fields:
            fields = [tr.mesh.duration * at.path.velocity(tr.mesh.nodes).T]
            fields += [at.Q @ move.A.T + move.b for move in moves]
        root = np.sqrt(shares(tr))
        xi = np.stack([tr.pack_curve(f) for f in fields], axis=1)
        # An independent set: a body that turns uniformly is turned as it goes on.
        norm = np.linalg.norm(root[:, None] * xi, axis=0)
        use = norm > DISTINCT
        left, values, _ = np.linalg.svd(root[:, None] * xi[:, use] / norm[use], full_matrices=False)
        left = left[:, values > DISTINCT]
        k = left.shape[1]
        B, C, c = np.zeros((size, k)), np.zeros((k, size)), np.zeros(k)
        directions = left / root[:, None]  # in the coordinates
        B[: layout.unknowns] = left * root[:, None]
        # Coordinates that the start gives are conditions as far as they can be met by moving.
        known = asked.phase_coordinates
        pinned = [int(layout.number[0, i]) for i in known]
        size = np.zeros(layout.width)
        np.maximum.at(size, layout.free % layout.width, np.linalg.norm(directions, axis=1))
        size = size[list(known), None]
        swift = SLOW if along else SWIFT  # what is one of a family can be made to begin there
        given = _independent(directions[pinned] / np.where(size > 0, size, 1.0), swift) if k else []
        for row, j in enumerate(given):
            i = known[j]
            C[row, pinned[j]] = 1.0
            c[row] = asked.start.q[i] / tr.lengths[i]  # type: ignore[operator]
        rest = np.eye(k)
        if given:
            _, _, right = np.linalg.svd(directions[[pinned[j] for j in given]])
            rest = right[len(given) :].T
        C[len(given) :] = (B @ rest).T if given else B.T
        c[len(given) :] = C[len(given) :] @ z
        return cls(B, C, c, tuple(known[j] for j in given))


def shares(tr: Transcription) -> Array:
    """Return the part of the duration for which the node of each unknown stands, (unknowns,)."""
    layout = tr.layout
    weight = np.bincount(layout.node_of, tr.weight[:, 0], layout.node_count) / tr.mesh.duration
    weight[0] += weight[-1]  # of a closed path they are one
    return weight[layout.free // layout.width]


def _independent(rows: Array, swift: float) -> list[int]:
    """Return which of the rows are independent, the largest first (Gram and Schmidt's way).

    A coordinate that hardly moves at the start, beside elsewhere, does not say where that is.
    """
    left, chosen = rows.copy(), []
    for _ in range(min(rows.shape)):
        norms = np.linalg.norm(left, axis=1)
        j = int(np.argmax(norms))
        if not norms[j] > swift:
            break
        chosen.append(j)
        unit = left[j] / norms[j]
        left = left - np.outer(left @ unit, unit)
    return chosen
