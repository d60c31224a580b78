"""A branch of stationary paths (z, s), followed by its arclength.

Where a path is degenerate the KKT matrix is singular, and the branch may turn back in s: a fold.
The matrix bordered by the branch's own direction stays regular there (H. B. Keller, in
*Applications of Bifurcation Theory* (1977), p. 359; Allgower and Georg, *Numerical Continuation
Methods* (1990), chapters 6-10),

    [ K    dr/ds ] [ dz ]     [ r ]
    [ direction  ] [ ds ] = - [ 0 ].

Lengths are measured in the root mean square of the coordinates, in units of their sizes, and in
s relative to its range.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.borders.bordered import Bordered
from actionopt.discrete.borders.borders import moves_of, times_of
from actionopt.discrete.borders.contact_times import ContactEquations
from actionopt.discrete.matrices.factors import Factors
from actionopt.discrete.meshes.boundaries import carry_boundaries
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.mechanics.laws.instants import Instant
from actionopt.mechanics.question.held import Held
from actionopt.mechanics.question.obstacle import Arc
from actionopt.mechanics.question.problem import Problem
from actionopt.tools.immutable import immutable, make_unchecked
from actionopt.tools.types import Array

# Ad hoc, but for `DIFFERENCE`.
CORRECTIONS = 6  # of Newton's method: a step that takes more was too long
# a correction of this size ends the corrector: the next one would be round-off
LAST_CORRECTION = 1e-9
# Step in s, relative to its range, for dr/ds: near EPS^(1/2), as differences to one side ask.
DIFFERENCE = 1e-7
STRAIGHT_STEP = 0.95  # cosine of the angle between directions (18 degrees): short enough
# How far a branch that turns evenly by this angle is from its tangent, in parts of the step:
# farther away another branch may be found. Derived.
BEND = 0.5 * math.acos(STRAIGHT_STEP)
# How far on a matrix serves for the last correction and the direction of a branch. Near a
# collision that turns by thousands of times this. Measured on eight branches of Kepler's
# transfers: at 1e-3 five are lost, at 1e-5 and 1e-6 none.
SAME_MATRIX = 1e-6
# Corrections by a matrix that was factorized before them, as far as they contract: each takes a
# tenth to a third of a factorization. Ad hoc.
SAME_CORRECTIONS = 3
# Of a right side, what the last correction and the direction leave, and what other corrections do:
# the next one takes it. Ad hoc.
LINEAR_LEFT, ROUGHLY_LEFT = 1e-6, 1e-3
RUNAWAY_SIZE = 1e4  # coordinates this many times their size are no path worth following

Discrete = Transcription | Bordered | ContactEquations


@immutable
class BranchPoint:
    """A point of a branch: its transcription, unknowns z, s, and the direction (dz, ds).

    And the factors of its KKT matrix, or of one not farther than `SAME_MATRIX`, if they are known.
    """

    tr: Discrete
    z: Array
    s: float
    direction: Array
    factors: Factors | None = None

    @cached_property
    def at(self) -> DiscretePath:
        """The path there, with its multipliers."""
        if isinstance(self.tr, Transcription):
            return DiscretePath(self.tr, self.z)
        return self.tr.discrete(self.z)

    @property
    def path(self) -> Path:
        """The path there."""
        return self.at.path

    def without_factors(self) -> BranchPoint:
        """Return the point without its factors, which take as much memory as all else."""
        return make_unchecked(BranchPoint, **vars(self) | {"factors": None, "at": self.at})


class _Corrected(NamedTuple):
    """Where Newton's method leads: (z, s), equations and factorizations on the way."""

    y: Array
    tr: Discrete
    count: int
    factors: Factors  # from no farther than `SAME_MATRIX`


def switches_of(problem: Problem) -> tuple[Instant, ...]:
    """Return where elements are to end: where laws switch by the clock, at pulses and events."""
    if problem.has_tails:  # not where a phase is set
        events = ((e.t, e.t) for e in problem.through)
        return tuple(sorted((*problem.instants, *events)))
    return problem.boundaries


@dataclass(eq=False)
class Branch:
    """A family of problems, one for each s, discretized alike."""

    family: Callable[[float], Problem]
    shape: Mesh  # over any times; it is stretched to those of each problem
    # where the problem of that mesh switches by the clock, or passes an event
    instants: tuple[Instant, ...]
    lengths: Array  # (n,): units of the coordinates
    # the unit of s, less than zero where s is to fall: a branch and its image are alike
    range: float
    # (k + 2,): those of a course's events at the path from which to begin
    times: Array | None = None
    kappa: Array | None = None  # (c,): the multipliers of its integrals there
    arcs: tuple[Arc, ...] = ()  # what is in contact with an obstacle there
    like: Transcription | None = None
    bordered: Bordered | ContactEquations | None = None  # where more than the path is to be found
    last: tuple[float, Transcription] | None = None  # what was asked for, and what it is
    solves: int = 0  # linear systems so far

    @classmethod
    def begin(
        cls,
        family: Callable[[float], Problem],
        known: Problem,
        path: Path,
        rows: Array | None,
        lengths: Array,
        ahead: tuple[float, float, float],
    ) -> tuple[Branch, BranchPoint]:
        """Return the branch through a path, with multipliers `rows` (K, m), and its point there.

        `known` is the path's problem with what was found; `ahead` are s, its range, and the sign
        with which it is to change.
        """
        s, reach, sign = ahead
        problem = family(s)
        instants = () if problem.free_time or problem.is_joined else switches_of(problem)
        branch = cls(family, path.mesh, instants, lengths, reach, times=times_of(known))
        branch.kappa = None if problem.integral is None else known.kappa
        if isinstance(known, Held):
            branch.arcs = known.arcs or ()
        lam = None if rows is None else np.nan_to_num(rows)
        return branch, branch.first(branch.first_unknowns(path, lam, s), s, sign)

    def first_unknowns(self, path: Path, lam: Array | None, s: float) -> Array:
        """Return the unknowns of the path at s, from which the branch is to begin."""
        problem = self.family(s)
        if self.arcs:
            span = None if self.times is None else tuple(self.times.tolist())
            problem = Held(problem, self.arcs, span=span)
        if problem.has_free_boundary:
            known = problem, path, lam, self.lengths, moves_of(problem)
            equations, y = Bordered.around(*known, times=self.times, kappa=self.kappa)
            self.bordered = equations
        else:
            like = Transcription(problem, path.mesh, self.lengths) if self.arcs else self.at(s)
            assert isinstance(like, Transcription)
            equations, y = like, like.pack(path.values.T, lam)
        if self.arcs:
            self.bordered = ContactEquations(equations)
            y = np.concatenate([y, np.zeros(self.bordered.layout.size - y.size)])
        return y

    def at(self, s: float) -> Discrete:
        """Return the transcription at s; all share their units."""
        if self.last is not None and self.last[0] == s:
            return self.last[1]
        problem = self.family(s)
        if self.bordered is not None:
            return self.bordered.of(problem)
        mesh = carry_boundaries(
            self.shape, self.instants, switches_of(problem), problem.start.t, problem.end.t
        )
        tr = Transcription(problem, mesh, self.lengths, like=self.like)
        self.like = self.like or tr
        self.last = s, tr
        return tr

    def first(self, z: Array, s: float, sign: float) -> BranchPoint:
        """Return the point at s, with the direction in which s grows (or falls).

        By Newton's method from z at s; beside another branch, where that finds none, across the
        direction; or z as it is. The direction is told by a matrix across it: that at s is nearly
        singular there.
        """
        ahead = np.r_[np.zeros(z.size), sign * abs(self.range)]
        point = BranchPoint(self.at(s), z, s, ahead)
        point = self.to(point, s) or self._across(point) or point
        return replace(point, direction=self._direction(point))

    def _across(self, point: BranchPoint) -> BranchPoint | None:
        """Return the point to which Newton's method leads from one, across the direction there."""
        point = replace(point, direction=self._direction(point))
        found = self.step(point, 0.0, np.r_[point.z, point.s], np.inf)
        return None if found is None else found[0]

    def step(
        self,
        point: BranchPoint,
        length: float,
        first: Array | None = None,
        most: float | None = None,
    ) -> tuple[BranchPoint, int] | None:
        """Return the point at about `length` further along and the factorizations, or None.

        From a `first` (z, s) if there is one, else from the tangent; by a first correction of at
        most `most`, else of what the branch may bend.
        """
        y = np.r_[point.z, point.s] + length * point.direction if first is None else first
        most = BEND * length if most is None else most
        found = self._correct(y, point.direction, CORRECTIONS, most)
        if found is None or not np.abs(found.y[: found.tr.layout.unknowns]).max() < RUNAWAY_SIZE:
            return None
        # The last transcription belongs to the s before the last, tiny correction.
        s = float(found.y[-1])
        there = BranchPoint(self.at(s), found.y[:-1], s, point.direction)
        complete = self._complete(there, found)
        return None if complete is None else (complete, found.count)

    def to(self, point: BranchPoint, s: float) -> BranchPoint | None:
        """Return the point at exactly s, near `point`, by Newton's method there; or None."""
        z = point.z
        if point.direction[-1]:
            z = z + (s - point.s) / point.direction[-1] * point.direction[:-1]
        found = self._correct(np.r_[z, s], np.r_[np.zeros(z.size), 1.0], CORRECTIONS + 2, np.inf)
        if found is None:
            return None
        return self._complete(BranchPoint(found.tr, found.y[:-1], s, point.direction), found)

    def _correct(self, y: Array, row: Array, most: int, first: float) -> _Corrected | None:
        """Return the point (z, s) across a row (size + 1,) to which Newton's method leads.

        None if that takes more than `most` factorizations, a longer first correction, or does not
        contract. A matrix serves for more corrections as long as few of them are left, but for one
        that takes little before a correction that is expected to be the last; that is by the matrix
        at the point. Those are not counted.
        """
        last, tr, factors, count, away = 2 * first, self.at(float(y[-1])), None, 0, 0.0
        with np.errstate(all="ignore"):
            for k in range(1, most + SAME_CORRECTIONS):
                residual = tr.residual(y[:-1])
                serves = away <= SAME_MATRIX or last**2 > SAME_MATRIX or _is_large(factors)
                try:
                    change, size = self._change(tr, factors if serves else None, residual)
                    few = size * (size / last) ** SAME_CORRECTIONS < LAST_CORRECTION
                    if factors is None or not (few or away <= SAME_MATRIX):
                        if count == most:
                            return None
                        count, away = count + (factors is None or serves), 0.0
                        factors = self._factorize(tr, y, row, residual)
                        change, size = self._change(tr, factors, residual)
                except np.linalg.LinAlgError:
                    return None
                if not np.isfinite(size) or size > max(0.5 * last, LAST_CORRECTION):
                    return None
                # The next one is smaller by as much at least.
                left = size * (size / last) if k > 1 else size
                y, last, away = y - change, size, away + size
                if away <= SAME_MATRIX and left < LAST_CORRECTION:
                    return _Corrected(y, tr, count, factors)
                if row[:-1].any():  # else s is given
                    tr = self.at(float(y[-1]))
                if away > SAME_MATRIX and left < SAME_MATRIX:
                    return self._end(tr, y, row, _Corrected(y, tr, count, factors))
        return None

    def _change(
        self, tr: Discrete, factors: Factors | None, residual: Array, enough: float = ROUGHLY_LEFT
    ) -> tuple[Array, float]:
        """Return the correction by a matrix, and its length; infinite where there is none yet."""
        if factors is None:
            return np.zeros(0), np.inf
        change = factors.solve(np.r_[residual, 0.0], enough)
        return change, self._size(tr, change)

    def _end(self, tr: Discrete, y: Array, row: Array, found: _Corrected) -> _Corrected | None:
        """Return the point by one more correction, that is by the matrix there; None if it fails.

        Solutions with a large one are refined from those of the matrix nearby.
        """
        near, residual = None, tr.residual(y[:-1])
        if _is_large(found.factors):
            near = found.factors.within
        try:
            factors = self._factorize(tr, y, row, residual, near)
            change, size = self._change(tr, factors, residual, LINEAR_LEFT)
        except np.linalg.LinAlgError:
            return None
        return _Corrected(y - change, tr, found.count, factors) if size < SAME_MATRIX else None

    def _size(self, tr: Discrete, change: Array) -> float:
        """Return the length of a correction, or how far a time moves if that is more."""
        size, times, own = self.norm(tr, change), np.zeros(0), tr
        if isinstance(tr, ContactEquations):
            own = tr.equations
            times = change[own.layout.size : -1]
        if isinstance(own, Bordered) and own.times_border is not None:
            times = np.append(times, change[own.times_border[1]])
        return max(size, float(np.abs(times).max(initial=0.0)))

    def _complete(self, point: BranchPoint, found: _Corrected) -> BranchPoint | None:
        """Return the point with the branch's direction; None where a part in contact is gone."""
        if self.arcs and not np.isfinite(point.tr.residual(point.z)).all():
            return None
        direction = self._direction(point, found.factors)
        return replace(point, direction=direction, factors=found.factors.within)

    def norm(self, tr: Discrete, change: Array) -> float:
        """Return the length of a change (dz, ds); multipliers do not count."""
        return float(np.sqrt(self.inner(tr, change, change)))

    def angle(self, one: BranchPoint, other: BranchPoint) -> float:
        """Return the cosine of the angle between the directions of two points."""
        return self.inner(one.tr, one.direction, other.direction)

    def inner(self, tr: Discrete, a: Array, b: Array) -> float:
        """Return the scalar product of two changes (dz, ds); multipliers do not count."""
        cut = tr.layout.unknowns
        return float(a[:cut] @ b[:cut] / max(cut, 1) + a[-1] * b[-1] / self.range**2)

    def _direction(self, point: BranchPoint, factors: Factors | None = None) -> Array:
        """Return the unit vector along the branch, on the side of the point's own direction.

        By the factors of a bordered matrix there, if they are known.
        """
        y = np.r_[point.z, point.s]
        try:
            if factors is None:
                factors = self._factorize(point.tr, y, point.direction, point.tr.residual(point.z))
            found = factors.solve(np.r_[np.zeros(point.z.size), 1.0], LINEAR_LEFT)
        except np.linalg.LinAlgError:
            return point.direction
        if not np.all(np.isfinite(found)):
            return point.direction
        size = self.norm(point.tr, found)
        return found / math.copysign(size, self.inner(point.tr, found, point.direction))

    def _slope(self, tr: Discrete, y: Array, residual: Array) -> Array:
        """Return dr/ds (size,) at y, where r is the residual.

        By a difference to one side; to both where more than the path is unknown, as the matrix of
        that may be nearly singular: where a ray grazes, errors of this grow a millionfold.
        """
        z, s, h = y[:-1], float(y[-1]), DIFFERENCE * self.range
        known = [(s, residual)]
        for beside in (s + h, s - h):
            try:
                known.append((beside, self.at(beside).residual(z)))
            except ValueError:  # there is no question
                continue
            if isinstance(tr, Transcription):
                break
        if len(known) == 1:
            raise ValueError(
                f"expected a goal from which {s:g} can be told, found none of a question "
                f"{abs(h):.3g} before or behind it; try a nearer goal"
            )
        (a, before), (b, after) = known[-2:]
        return (after - before) / (b - a)

    def _factorize(
        self, tr: Discrete, y: Array, row: Array, residual: Array, near: Factors | None = None
    ) -> Factors:
        """Factorize the KKT matrix bordered by dr/ds and by `row`, in the metric of the branch.

        Or have its solutions refined from those of a matrix `near` it, if that is known. Raises
        numpy.linalg.LinAlgError if it is singular.
        """
        self.solves += near is None
        z, cut, slope = y[:-1], tr.layout.unknowns, self._slope(tr, y, residual)
        last = np.r_[row[:cut] / max(cut, 1), np.zeros(z.size - cut), row[-1] / self.range**2]
        edges = slope[:, None], last[None, :-1], last[-1:, None]
        K = tr.kkt(z)
        inner = Factors(tr.layout, K, many=True) if near is None else near.near(K)
        return inner.with_border(*edges)


def _is_large(factors: Factors | None) -> bool:
    """Whether the matrix beside a border takes long to factorize."""
    within = factors and factors.within
    return within is not None and within.layout.keeps_factors
