"""Paths with numbers to be found beside them: a duration, and where a closed one begins.

The unknowns are y = (z, log T, a). With the coordinates at fixed fractions of the time, S + E T is
a function of z and T, and stationary in both: the derivative by T is E - H. A closed path without
a clock may be moved along itself, or as a whole if L has symmetries, and S does not change; so
the KKT matrix K is singular. Phase conditions C z = c say where it is, and forces a along these
directions B make the matrix regular,

    [ K        dr/dT    B ] [ dz ]     [ r + B a      ]
    [ (dr/dT)' d2S/dT2  0 ] [ dT ] = - [ dS/dT + E    ]
    [ C        0        0 ] [ da ]     [ C z - c      ].

The forces vanish at a path up to its discretization, as no symmetric system can be pushed along its
symmetry and close: they are the unfolding parameters of Munoz-Almaraz, Freire, Galan, Doedel and
Vanderbauwhede, *Physica D* 181 (2003), p. 1. The phase condition is that of least distance from the
first iterate, int xi.(q - q_first) dt = 0 (Doedel, in *Numerical Continuation Methods for
Dynamical Systems* (2007), section 1.3.6), or a coordinate that the start gives.

Where an event lies on a surface its coordinates are free, and S + E T + mu.on is stationary in mu,
too: unknowns mu stand between the duration and the forces, as rows on(q, t) = 0 do (`foot`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from actionopt.discrete.boundaries import moved
from actionopt.discrete.discrete_path import DiscretePath
from actionopt.discrete.end_times import by_stretch, by_times
from actionopt.discrete.factors import Factors
from actionopt.discrete.foot import Foot, feet, reactions
from actionopt.discrete.layout import BorderedLayout
from actionopt.discrete.path import Path
from actionopt.discrete.transcription import Transcription
from actionopt.mechanics.problem import Problem
from actionopt.mechanics.symmetry import find_symmetries
from actionopt.tools.types import Array

STRETCH = 1e-6  # of log T, for dr/dT: near EPS^(1/3), as central differences ask
OFF = 20.0  # |log T| against the first duration that is reckoned with; ad hoc
# Of the coordinates' sizes: directions in which a path moves less than this against its others
# are none of their own, as time along a path at rest, or a turn of one that turns anyway. Ad hoc.
DISTINCT = 1e-4
# Of its largest rate, at which a coordinate says where a path begins, or which of a family it is.
SWIFT, SLOW = 0.1, 1e-3  # ad hoc


class Move(NamedTuple):
    """A motion of configuration space xi = b + A q under which L does not change."""

    A: Array
    b: Array


def over(problem: Problem, duration: float) -> Problem:
    """Return the problem at a duration, where its own is free; the times that are given stay."""
    if not problem.free_time:
        return problem
    return problem.found(*times(problem, duration))


def times(problem: Problem, duration: float) -> tuple[float, float]:
    """Return the times of the events at a duration, where one of them or both are free."""
    t0, t1 = problem.start.t, problem.end.t
    if t0 is None:
        t0 = 0.0 if t1 is None else t1 - duration
    return t0, t0 + duration if t1 is None else t1


def moves_of(problem: Problem) -> tuple[Move, ...]:
    """Return the motions of configuration space that a closed path may be subjected to."""
    if not problem.closes or problem.system.n == 1:
        return ()
    system, advance = problem.system, problem.advance
    known = system.made("moves", dict)
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


class Borders(NamedTuple):
    """What is beside the KKT matrix: directions B (size, k), rows C (k, size) and C z there (k,).

    The first rows are those of the coordinates `held` that the start gives.
    """

    B: Array
    C: Array
    c: Array
    held: tuple[int, ...] = ()


@dataclass(eq=False)
class Bordered:
    """The equations of a path and of what is to be found beside it, as a `Transcription` has them.

    Parameters
    ----------
    asked : Problem
        Its duration is free, its paths close, or its events lie on surfaces.
    first : Transcription
        Of the asked one's `loose` problem, over a first duration: it sets the units.
    borders : Borders
    feet : tuple of Foot
    """

    asked: Problem
    first: Transcription
    borders: Borders
    feet: tuple[Foot, ...] = ()
    layout: BorderedLayout = field(init=False)

    def __post_init__(self) -> None:
        self.free = self.asked.loose
        self.timed = int(self.asked.free_time)  # unknowns of the duration
        self.held = sum(foot.units.size for foot in self.feet)  # and multipliers of surfaces
        self.unit = self.first.mesh.duration
        # How far a path moves, in its sizes, as its duration grows by a part of itself.
        self.reach = 1.0
        self._last: Transcription | None = self.first
        self._like: Transcription | None = self.first
        beside = self.timed + self.held + self.borders.c.size
        self.layout = self.first.layout.bordered(beside)

    @classmethod
    def around(
        cls,
        asked: Problem,
        path: Path,
        lam: Array | None,
        lengths: Array,
        moves: Sequence[Move] = (),
        along: Sequence[Array] = (),
        like: Transcription | None = None,
    ) -> tuple[Bordered, Array]:
        """Return the equations on the mesh of a path, with a phase near it, and their unknowns.

        `along`, (n, K) each, are the directions in which it may be moved where there are more than
        along itself and by the `moves`; the units of action and of constraints are those of `like`,
        if that is given.
        """
        problem = over(asked.loose, path.mesh.duration)
        tr = Transcription(problem, path.mesh, lengths, like=like)
        z = tr.pack(path.values.T, lam)
        borders, at = _borders(asked, tr, z, moves, along), DiscretePath(tr, z)
        found = cls(asked, tr, borders, feet(at) if asked.on_surface else ())
        mu = [foot.units * reactions(at, foot.end)[0] / tr.action_unit for foot in found.feet]
        speeds = np.abs(path.velocity(path.mesh.nodes)).max(axis=1)
        found.reach = max(1.0, float((speeds * path.mesh.duration / lengths).max()))
        return found, np.concatenate([z, np.zeros(found.timed), *mu, np.zeros(borders.c.size)])

    def of(self, asked: Problem) -> Bordered:
        """Return those of another member of a family, in the same unknowns."""
        values = [asked.start.q[i] / self.first.lengths[i] for i in self.borders.held]  # type: ignore[operator]
        borders = self.borders._replace(c=np.r_[values, self.borders.c[len(values) :]])
        other = Bordered(asked, self.first, borders, self.feet)
        other._last, other._like, other.reach = None, None, self.reach
        return other

    @property
    def lengths(self) -> Array:
        """Units of the coordinates, (n,)."""
        return self.first.lengths

    def duration(self, y: Array) -> float:
        """Return the duration of unknowns y (size,)."""
        if not self.timed:
            return self.unit
        late = float(y[self.first.layout.size])
        return self.unit * math.exp(min(max(late, -OFF), OFF))

    def at(self, y: Array) -> Transcription:
        """Return the discrete action over the duration that belongs to y."""
        return self._over(self.duration(y))

    def _over(self, duration: float) -> Transcription:
        if self._last is None or duration != self._last.mesh.duration:
            problem, like = over(self.free, duration), self._like
            if like is not None and not self._clocked:
                self._last = like.stretched(problem)
                return self._last
            like, ends = self.first, (problem.start.t, problem.end.t)
            mesh = moved(like.mesh, like.problem.instants, problem.instants, *ends)
            self._last = Transcription(problem, mesh, like.lengths, like=like)
            self._last.counts, self._last.watch = like.counts, like.watch
            self._like = self._like or self._last
        return self._last

    @property
    def _clocked(self) -> bool:
        """Whether more than the rates changes with the duration."""
        timed = any(e is not None and e.on.timed for e in self.asked.surfaces)
        return timed or self.asked.system.structure.depends_on_time

    def missed(self, y: Array, *, followed: bool = True) -> tuple[Array, float]:
        """Return what another quadrature adds to the residual, (size,), and a free body's drift."""
        miss, drift = self.at(y).missed(y, followed=followed)
        return self._of_path(miss), drift

    def misread(self, y: Array) -> Array:
        """Return the change of the residual, (size,), if numbers are read as the next floats."""
        return self._of_path(self.at(y).misread(y))

    def _of_path(self, residual: Array) -> Array:
        """Return the residual (size,) of which that of the path is given, the rest zero."""
        return np.concatenate([residual, np.zeros(self.layout.size - residual.size)])

    def discrete(self, y: Array) -> DiscretePath:
        """Return the path of unknowns y."""
        return DiscretePath(self.at(y), y[: self.first.layout.size])

    def residual(self, y: Array) -> Array:
        """Return the equations' residual, (size,)."""
        return self._equations(self.discrete(y), y)

    def _equations(self, at: DiscretePath, y: Array) -> Array:
        """Return the residual of unknowns y over the duration of a path `at` of theirs, (size,)."""
        k, (B, C, c, _) = self.borders.c.size, self.borders
        r = at.tr.residual(at.z)
        forces = y[y.size - k :]
        r = r + B @ forces if k else r
        later, rows = [self._excess(at)] if self.timed else [], []
        for foot, mu in zip(self.feet, self._multipliers(y), strict=True):
            on, by_x, by_t = foot.rows(at)
            r[foot.places] += mu @ by_x
            rows.append(on)
            if self.timed and foot.end == self.moving:
                later[0] += (1 if foot.end else -1) * at.mesh.duration * float(mu @ by_t)
        return np.concatenate([r, later, *rows, C @ at.z - c])

    @property
    def moving(self) -> int:
        """Which event's time moves with the duration, 0 or 1."""
        return 0 if self.asked.end.t is not None else 1

    def _multipliers(self, y: Array) -> list[Array]:
        """Return those of the surfaces, (s,) for each foot, in units of action."""
        first = self.first.layout.size + self.timed
        ends = np.cumsum([foot.units.size for foot in self.feet]).tolist()
        return np.split(y[first : first + self.held], ends)[:-1] if self.feet else []

    def _excess(self, at: DiscretePath) -> float:
        """Return d(S + E T)/d log T, which is T (E - H), in units of action."""
        t0, t1 = by_times(at)
        slope = t1 if self.moving else -t0
        return (slope + self.asked.energy) * at.mesh.duration / at.tr.action_unit  # type: ignore[operator]

    def kkt(self, y: Array) -> Array:
        """Return the nonzeros of the derivative of `residual`, as the layout says."""
        return self.layout.joined(*self._derivatives(y))

    def _derivatives(self, y: Array) -> tuple[Array, Array, Array, Array]:
        """Return the nonzeros of K, the columns B and rows C beside it, and the corner D."""
        at, (B, C, _, _) = self.discrete(y), self.borders
        inner, size, k = self.first.layout, self.first.layout.size, self.borders.c.size
        clocked = self._clocked
        if self.timed and not clocked:  # they are asked for twice
            at.tr.place(at.x).second = [x.copy() for x in at.tr.second(at.x)]
        K = at.tr.kkt(at.z)
        added = self.timed + self.held + k
        below, beside = np.zeros((added, self.layout.size)), np.zeros((size, added))
        beside[:, added - k :], below[added - k :, :size] = B, C
        row = self.timed
        for foot, mu in zip(self.feet, self._multipliers(y), strict=True):
            by_x, rows = foot.rows(at)[1], row + np.arange(mu.size)
            below[rows[:, None], foot.places] = by_x
            beside[foot.places[:, None], rows] = by_x.T
            inner.add(K, foot.places, foot.curvature(at, mu))
            row += mu.size
        if self.timed:
            by_time = self._by_duration(at, y) if clocked else np.zeros(self.layout.size)
            if not clocked:
                by_time[: inner.unknowns], own = by_stretch(at)
                by_time[size] = own + self.asked.energy * at.mesh.duration / at.tr.action_unit  # type: ignore[operator]
            beside[:, 0] = by_time[:size]
            below[0] = by_time
            below[: self.timed + self.held, size] = by_time[size : size + self.timed + self.held]
        return K, beside, below[:, :size], below[:, size:]

    def _by_duration(self, at: DiscretePath, y: Array) -> Array:
        """Return the derivative of `residual` by log T, (size,), by differences."""
        T, h, sides = at.mesh.duration, STRETCH, []
        for sign in (1, -1):
            tr = self._over(T * float(np.exp(sign * h)))
            sides.append(self._equations(DiscretePath(tr, at.z), y))
        self._last = at.tr
        return (sides[0] - sides[1]) / (2 * h)

    def bend(self, y: Array) -> float:
        """Return d2S/d(log T)2 along the paths over fixed durations, in units of action.

        Raises numpy.linalg.LinAlgError where they do not follow one another.
        """
        K, B, C, D = self._derivatives(y)
        row, column, own = np.r_[C[0], D[0]], np.r_[B[:, 0], D[:, 0]], D[0, 0]
        B[:, 0], C[0], D[0], D[:, 0], D[0, 0] = 0.0, 0.0, 0.0, 0.0, 1.0
        row[len(B)] = column[len(B)] = 0.0
        return float(own - row @ Factors(self.layout, self.layout.joined(K, B, C, D)).solve(column))

    def by_duration(self, y: Array) -> Array:
        """Return the derivative of T (E - H) by the unknowns, log T among them, (size,)."""
        _, _, C, D = self._derivatives(y)
        return np.r_[C[0], D[0]]

    def measured(self, step: Array) -> float:
        """Return the largest change of a coordinate by a step, as a function of time."""
        found = self.first.measured(step)
        if not self.timed:
            return found
        return max(found, self.reach * abs(float(step[self.first.layout.size])))

    @property
    def magnitudes(self) -> Array:
        """Sizes of the unknowns in their units, (size,)."""
        beside = self.layout.size - self.first.layout.size
        found = np.concatenate([self.first.magnitudes, np.ones(beside)])
        found[found.size - self.borders.c.size :] = 0.0  # the forces vanish
        return found


def shares(tr: Transcription) -> Array:
    """Return the part of the duration for which the node of each unknown stands, (unknowns,)."""
    layout = tr.layout
    weight = np.bincount(layout.node_of, tr.weight[:, 0], layout.node_count) / tr.mesh.duration
    weight[0] += weight[-1]  # of a closed path they are one
    return weight[layout.free // tr.problem.system.n]


def _borders(
    asked: Problem, tr: Transcription, z: Array, moves: Sequence[Move], along: Sequence[Array]
) -> Borders:
    """Return the directions in which a closed path may be moved, and the conditions for where."""
    layout, size = tr.layout, tr.layout.size
    if not asked.closes:
        return Borders(np.zeros((size, 0)), np.zeros((0, size)), np.zeros(0))
    at, n = DiscretePath(tr, z), asked.system.n
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
    # Coordinates that the start gives are conditions as far as they can be met by moving the path.
    pinned = [int(layout.number[0, i]) for i in asked.start.pinned]
    size = np.zeros(n)
    np.maximum.at(size, layout.free % n, np.linalg.norm(directions, axis=1))
    size = size[list(asked.start.pinned), None]
    swift = SLOW if along else SWIFT  # what is one of a family can be made to begin there
    held = _independent(directions[pinned] / np.where(size > 0, size, 1.0), swift) if k else []
    for row, j in enumerate(held):
        i = asked.start.pinned[j]
        C[row, pinned[j]] = 1.0
        c[row] = asked.start.q[i] / tr.lengths[i]  # type: ignore[operator]
    rest = np.eye(k)
    if held:
        _, _, right = np.linalg.svd(directions[[pinned[j] for j in held]])
        rest = right[len(held) :].T
    C[len(held) :] = (B @ rest).T if held else B.T
    c[len(held) :] = C[len(held) :] @ z
    return Borders(B, C, c, tuple(asked.start.pinned[j] for j in held))


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
