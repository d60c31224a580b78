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
from typing import NamedTuple, Protocol

import numpy as np

from actionopt.discrete.discrete_path import DiscretePath
from actionopt.discrete.integrals import integrals, integrals_by_times
from actionopt.discrete.stretch import Stretch, joint_rates
from actionopt.discrete.surfaces import event_at, reactions, surface_at
from actionopt.discrete.transcription import Transcription
from actionopt.mechanics.problem import Problem
from actionopt.mechanics.symmetry import find_symmetries
from actionopt.tools.types import Array, NDInt

OFF = 20.0  # |log T| against the first duration that is reckoned with; ad hoc
# The same of a leg beside others, whose times have to be told apart: exp(-24) is 4e-11. Ad hoc.
FAR_OFF = 12.0
# Of the coordinates' sizes: directions in which a path moves less than this against its others
# are none of their own, as time along a path at rest, or a turn of one that turns anyway. Ad hoc.
DISTINCT = 1e-4
# Of its largest rate, at which a coordinate says where a path begins, or which of a family it is.
SWIFT, SLOW = 0.1, 1e-3  # ad hoc


@dataclass(eq=False)
class Gradient:
    """The derivatives of W, the sum of the action and of all borders' terms, in units of action.

    Attributes
    ----------
    path : (size,) array
        By the unknowns of the path: the residual of its equations.
    times : (k + 2,) array
        By the times of the events, at fixed coordinates at the nodes.
    """

    path: Array
    times: Array


@dataclass(eq=False)
class Bend:
    """The second derivatives of W by the path and by the times, which borders add their own to.

    Attributes
    ----------
    K : array
        The nonzeros of the path's own matrix.
    path : (size, k + 2) array or None
        Of the residual of the path's equations by the times of the events, if they are unknown.
    times : (k + 2, k + 2) array
        By the times twice.
    """

    K: Array
    path: Array | None = None
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
    them derivatives by the unknowns of `Times`. (Of a `Duration` where laws contain the time it
    takes differences of all equations together.) A border that replaces an equation (tangency for
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


# -- a duration ---------------------------------------------------------------------------------


def over(problem: Problem, duration: float) -> Problem:
    """Return the problem at a duration, where its own is free; the times that are given stay."""
    if not problem.free_time:
        return problem
    return problem.with_times(*times(problem, duration))


def times(problem: Problem, duration: float) -> tuple[float, float]:
    """Return the times of the events at a duration, where one of them or both are free."""
    t0, t1 = problem.start.t, problem.end.t
    if t0 is None:
        t0 = 0.0 if t1 is None else t1 - duration
    return t0, t0 + duration if t1 is None else t1


def times_of(problem: Problem) -> Array:
    """Return the times of a problem's events, (k + 2,); NaN where one is to be found."""
    return np.array([np.nan if e.t is None else e.t for e in problem.joints_found])


@dataclass(frozen=True, eq=False)
class Duration:
    """The logarithm of the duration, in units of `unit`: T (E - H) = 0.

    Attributes
    ----------
    problem : Problem
        With the energy E, and a time that is free.
    unit : float
    """

    problem: Problem
    unit: float
    size = 1
    multipliers = 0

    def begin(self, at: DiscretePath) -> Array:
        """Return that of the path at hand, (1,)."""
        return np.array([math.log(at.mesh.duration / self.unit)])

    def duration(self, beta: Array) -> float:
        """Return T of beta (1,)."""
        return self.unit * math.exp(min(max(float(beta[0]), -OFF), OFF))

    @property
    def moving(self) -> int:
        """Which event's time moves with the duration, 0 or 1."""
        return 0 if self.problem.end.t is not None else 1

    def residual(self, at: DiscretePath, beta: Array, gradient: Gradient) -> Array:
        """Return d(W + E T)/d log T, (1,)."""
        slope = (-1, 1)[self.moving] * gradient.times[self.moving]
        return np.array([(slope + self._energy(at)) * at.mesh.duration])

    def _energy(self, at: DiscretePath) -> float:
        return self.problem.energy / at.tr.action_unit  # type: ignore[operator]

    def derivative(self, at: DiscretePath, beta: Array, bend: Bend) -> Edges:
        """Return the derivatives by log T, of a system without a clock."""
        stretch = Stretch(at, at.mesh.since[None])
        column = stretch.residuals()
        own = (stretch.twice() + stretch.slopes()) / at.tr.action_unit
        return Edges(column, column.T, own + self._energy(at) * at.mesh.duration)


# -- the times of several events ------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Times:
    """The times of the events of a course: [H] = 0 at each that is free, H = E at an end.

    Unknowns are the logarithms of the legs' durations in units of `first`, so that times cannot
    cross. Between two times that are given the durations share what there is,

        h_j = T exp(beta_j) first_j / sum exp(beta) first,

    and the last of these legs has no unknown of its own.

    Attributes
    ----------
    given : (k + 2,) array
        The times that are given; NaN for the others.
    first : (k + 1,) array
    energy : float
        E.
    """

    given: Array
    first: Array
    energy: float
    multipliers = 0

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
    def size(self) -> int:
        """The number of unknown durations."""
        return sum(run.stop - run.start - (T is not None) for run, T in self.runs)

    def begin(self, at: DiscretePath) -> Array:
        """Return those of the path at hand, (b,)."""
        times = at.mesh.nodes_since[at.tr.joints]
        ratio, found = np.log(np.diff(times) / self.first), []
        for run, T in self.runs:
            part = ratio[run]
            found.append(part if T is None else part[:-1] - part[-1])
        return np.concatenate(found)

    def times(self, beta: Array) -> Array:
        """Return the times of the events, (k + 2,)."""
        return self._times(beta)[0]

    def _times(self, beta: Array) -> tuple[Array, list[tuple[slice, slice, Array, bool]]]:
        """Return the times; and each run's legs, unknowns, durations, and if these are shared."""
        h = np.array(self.first)
        known = np.diff(self.given)
        h[np.isfinite(known)] = known[np.isfinite(known)]
        parts, place = [], 0
        for run, T in self.runs:
            count = run.stop - run.start - (T is not None)
            own = np.clip(beta[place : place + count], -FAR_OFF, FAR_OFF)
            part = self.first[run] * np.exp(own if T is None else np.append(own, 0.0))
            h[run] = part if T is None else part * (T / part.sum())
            parts.append((run, slice(place, place + count), h[run], T is not None))
            place += count
        times = np.array(self.given)
        fixed = np.flatnonzero(np.isfinite(times))
        if not fixed.size:
            times[0], fixed = 0.0, np.array([0])
        for k in range(int(fixed[0]) - 1, -1, -1):
            times[k] = times[k + 1] - h[k]
        for k in range(int(fixed[0]) + 1, times.size):
            if not np.isfinite(times[k]):
                times[k] = times[k - 1] + h[k - 1]
        return times, parts

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
        by_h = np.zeros((self.first.size, beta.size))
        for run, own, h, shared in self._times(beta)[1]:
            part = np.diag(h)
            if shared:
                part = (part - np.outer(h, h) / h.sum())[:, :-1]
            by_h[run, own] = part
        return self._add_durations(by_h)

    def _add_durations(self, by_h: Array) -> Array:
        """Return the change of the times (k + 2, ...) that belongs to that of the durations."""
        found = np.concatenate([np.zeros((1, *by_h.shape[1:])), np.cumsum(by_h, axis=0)])
        fixed = np.flatnonzero(np.isfinite(self.given))
        return found - found[fixed[0]] if fixed.size else found

    def twice(self, beta: Array, slopes: Array) -> Array:
        """Return sum slopes d2t/dbeta2, (b, b), for slopes (k + 2,)."""
        by_h = np.zeros(self.first.size)  # by the durations
        fixed = np.flatnonzero(np.isfinite(self.given))
        start = int(fixed[0]) if fixed.size else 0
        by_h[:] = np.cumsum(slopes[:0:-1])[::-1]
        by_h[:start] -= slopes.sum()
        found = np.zeros((beta.size, beta.size))
        for run, own, h, shared in self._times(beta)[1]:
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
        """Add the derivatives by the times; `Bordered` makes those by beta of them."""
        assert bend.path is not None
        stretch = Stretch(at, joint_rates(at.tr))
        bend.path += stretch.residuals()
        bend.times += stretch.twice() / at.tr.action_unit
        b = self.size
        empty = np.zeros((at.tr.layout.size, b))
        return Edges(empty, empty.T, np.zeros((b, b)))


# -- rows of a surface ----------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Rows:
    """An event on a surface, on(q, t) = 0: W has the term mu.on, and mu are the unknowns.

    They balance the momentum there. With holonomic constraints f the moves along both are left, and
    p1 = -mu on_q - nu f_q: the end's own part nu of the constraint's multiplier is a force that
    acts for no time.

    Attributes
    ----------
    event : int
        Its number, the start being 0.
    free : (k,) array of int
        Coordinates that the event does not give.
    places : (k,) array of int
        Theirs among the unknowns.
    units : (s,) array
        Of the rows: what they change by as the coordinates change by their lengths.
    """

    event: int
    free: NDInt
    places: NDInt
    units: Array

    @property
    def size(self) -> int:
        """The number s of expressions."""
        return self.units.size

    @property
    def multipliers(self) -> int:
        """All of them."""
        return self.units.size

    @classmethod
    def of(cls, at: DiscretePath) -> list[Rows]:
        """Return those of the events of a path that lie on surfaces, and are free to move."""
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


@dataclass(frozen=True, eq=False)
class Integral:
    """Integrals along the path that are given, int g dt = G: W has the term kappa.(int g dt - G).

    The unknowns are kappa (c,). kappa.g is part of the Lagrangian of the problem's system, so that
    all but the rows themselves follows from that (Gelfand and Fomin, *Calculus of Variations*
    (1963), section 12).

    Attributes
    ----------
    values : (c,) array
        G.
    units : (c,) array
        Of the rows: what they change by as all coordinates change by their lengths.
    unit : float
        Of the action.
    """

    values: Array
    units: Array
    unit: float

    @property
    def size(self) -> int:
        """The number c of integrals."""
        return self.values.size

    @property
    def multipliers(self) -> int:
        """All of them."""
        return self.values.size

    @classmethod
    def of(cls, at: DiscretePath) -> Integral:
        """Return those that the problem of a path gives."""
        values, change = np.array(at.problem.integral), np.abs(integrals(at)[1]).sum(axis=1)
        units = np.where(np.isfinite(change) & (change > 0), change, 1.0)
        return cls(values, units, at.tr.action_unit)

    def kappa(self, beta: Array) -> Array:
        """Return the multipliers in the user's units, (c,)."""
        return beta * self.unit / self.units

    def begin(self, at: DiscretePath) -> Array:
        """Return those of the path at hand, (c,)."""
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


# -- where a closed path begins -------------------------------------------------------------------


class Move(NamedTuple):
    """A motion of configuration space xi = b + A q under which L does not change."""

    A: Array
    b: Array


def moves_of(problem: Problem) -> tuple[Move, ...]:
    """Return the motions of configuration space that a closed path may be subjected to."""
    if not problem.closes or problem.system.n == 1:
        return ()
    system, advance = problem.system, problem.advance
    known = system.memoize("moves", dict)
    key = problem.packed.tobytes()
    if key not in known:
        found = find_symmetries(system, parameters=problem.parameters)
        known[key] = [Move(s.A, s.b) for s in found if not (s.time or s.rate or s.c.any())]
    # What is moved closes as well: xi(P q + a) = P xi(q).
    P = np.eye(system.n)[list(problem.order)]
    kept = [np.r_[(A @ P - P @ A).ravel(), A @ advance + b - P @ b] for A, b in known[key]]
    if not np.any(kept):
        return tuple(known[key])
    _, values, right = np.linalg.svd(np.transpose(kept))
    size = np.zeros(len(right))
    size[: values.size] = values
    A, b = (np.array(part) for part in zip(*known[key], strict=True))
    return tuple(Move(np.tensordot(x, A, 1), x @ b) for x in right[size <= DISTINCT * size.max()])


@dataclass(frozen=True, eq=False)
class PhaseCondition:
    """Forces a (k,) along directions B, and as many conditions C z = c that say where the path is.

    They replace equations that W gives, which hold whatever the phase is. The forces vanish at a
    path up to its discretization, as no symmetric system can be pushed along its symmetry and
    close: they are the unfolding parameters of Munoz-Almaraz, Freire, Galan, Doedel and
    Vanderbauwhede, *Physica D* 181 (2003), p. 1. The condition is that of least distance from the
    first iterate,
    int xi.(q - q_first) dt = 0 (Doedel, in *Numerical Continuation Methods for Dynamical Systems*
    (2007), section 1.3.6), or a coordinate that the start gives.

    Attributes
    ----------
    B, C : (size, k), (k, size) arrays
    c : (k,) array
    given : tuple of int
        Coordinates that the start gives, and the first of the conditions say.
    """

    B: Array
    C: Array
    c: Array
    given: tuple[int, ...] = field(default=())
    multipliers = 0

    @property
    def size(self) -> int:
        """The number k of directions."""
        return self.c.size

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
        tr, z, n = at.tr, at.z, asked.system.n
        layout, size = tr.layout, tr.layout.size
        fields = [direction.T for direction in along]
        if not fields:
            fields = [tr.mesh.duration * at.path.velocity(tr.mesh.nodes).T]
            fields += [at.Q @ move.A.T + move.b for move in moves]
        root = np.sqrt(shares(tr))
        xi = np.stack([f.ravel()[layout.free] / tr.x_unit for f in fields], axis=1)
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
        known = asked.start.pinned if asked.closes else ()
        pinned = [int(layout.number[0, i]) for i in known]
        size = np.zeros(n)
        np.maximum.at(size, layout.free % n, np.linalg.norm(directions, axis=1))
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
    return weight[layout.free // tr.problem.system.n]


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
