"""Paths with numbers to be found beside them: borders round the KKT matrix.

The unknowns are y = (z, beta_1, beta_2, ...), those of the path and of each border (`borders`).
With the coordinates at fixed fractions of the time, S + E T is a function of z and T, and
stationary in both: the derivative by T is E - H. Multipliers mu of a surface are unknowns, too, in
which S + E T + mu.on is stationary. A closed path without a clock may be moved along itself, or as
a whole if L has symmetries, and S does not change; so the KKT matrix K is singular. Phase
conditions C z = c say where it is, and forces a along these directions B make the matrix regular,

    [ K        on_x'  dr/dT    B ] [ dz  ]     [ r + B a + mu on_x ]
    [ on_x     0      don/dT   0 ] [ dmu ]     [ on                ]
    [ (dr/dT)' ..     d2S/dT2  0 ] [ dT  ] = - [ dS/dT + E         ]
    [ C        0      0        0 ] [ da  ]     [ C z - c           ].
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.borders.borders import (
    Bend,
    Border,
    Gradient,
    Integral,
    Move,
    PhaseCondition,
    Rows,
    Times,
    times_of,
    times_over,
)
from actionopt.discrete.borders.integrals import integrals
from actionopt.discrete.borders.stretch import Stretch, by_joints
from actionopt.discrete.borders.surfaces import reactions
from actionopt.discrete.matrices.factors import Factors
from actionopt.discrete.matrices.layout import BorderedLayout
from actionopt.discrete.meshes.boundaries import carry_boundaries
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.mechanics.question.problem import Problem
from actionopt.tools.types import RANK, Array, NDInt

# Of the interval of multipliers with which L_vv is not definite: how far from it a first one is at
# least. Measured on ropes: .02 to 3 lead to the same paths.
DEFINITE = 0.3


@dataclass(eq=False)
class Bordered:
    """The equations of a path and of what is beside it, of the form of a `Transcription`."""

    # as asked: its duration is free, its paths close, or its events lie on surfaces
    problem: Problem
    first: Transcription  # of its `loose` problem, over a first duration: it sets the units
    borders: tuple[Border, ...]  # what stands beside the path
    layout: BorderedLayout = field(init=False)

    def __post_init__(self) -> None:
        self.free = self.problem.loose
        ends = np.cumsum([self.first.layout.size, *(b.size for b in self.borders)]).tolist()
        self.layout = self.first.layout.with_border(ends[-1] - ends[0])
        self.parts = [slice(a, b) for a, b in pairwise(ends)]
        pairs = zip(self.borders, self.parts, strict=True)
        # The border of the events' times, and where its unknowns are; None if there is none.
        self.times_border = next(((b, part) for b, part in pairs if isinstance(b, Times)), None)
        found = self.times_border  # whose events' times are unknown
        self.moving = np.zeros(0, dtype=int) if found is None else found[0].moving
        # How far a path moves, in its sizes, as its duration grows by a part of itself.
        self.reach = 1.0
        self._last: Transcription | None = self.first
        self._times_of: tuple[bytes, Gradient] | None = None  # of the last residual
        self._stretched: Stretch | None = None  # of the last path
        # The unknowns beside the path, and before the forces, of the last one, if there is one.
        self._beside: bytes | None = b""
        self._like: Transcription | None = self.first

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
        times: Array | None = None,
        kappa: Array | None = None,
    ) -> tuple[Bordered, Array]:
        """Return the equations on the mesh of a path, with a phase near it, and their unknowns.

        `along`, (n, K) each, are the directions in which it may be moved where there are more than
        along itself and by the `moves`; the units of action and of constraints are those of `like`,
        if that is given. `times` (k + 2,) are those of the events of a course, at the path, and
        `kappa` (c,) the multipliers of integrals; those that balance the forces best if None.
        """
        if times is None:
            times = np.array(times_over(asked, path.mesh.duration))
        if asked.integral is not None and kappa is None:
            kappa = _fit_multipliers(asked.found_at(times), path, lengths)
        problem = asked.loose.found_at(times, kappa=kappa)
        tr = Transcription(problem, path.mesh, lengths, like=like)
        at = DiscretePath(tr, tr.pack(path.values.T, lam))
        with np.errstate(all="ignore"):  # L may be infinite on the path
            return cls.beside(asked, at, moves, along, times)

    @classmethod
    def beside(
        cls,
        asked: Problem,
        at: DiscretePath,
        moves: Sequence[Move] = (),
        along: Sequence[Array] = (),
        times: Array | None = None,
    ) -> tuple[Bordered, Array]:
        """Return the equations around a path over its own duration, or over `times` of events."""
        tr, path = at.tr, at.path
        borders: list[Border] = [*Rows.of(at)]
        given = times_of(asked)
        if not np.isfinite(given).all():
            legs = np.diff(times_of(tr.problem) if times is None else times)
            borders.append(Times(given, legs, asked.energy or 0.0))
        if asked.integral is not None:
            borders.append(Integral.of(at))
        if asked.closes or along:
            borders.append(PhaseCondition.near(asked, at, moves, along))
        found = cls(asked, tr, tuple(borders))
        if found.moving.size:
            speeds = np.abs(path.velocity(path.mesh.nodes)).max(axis=1)
            found.reach = max(1.0, float((speeds * path.mesh.duration / tr.lengths).max()))
        return found, np.concatenate([at.z, *(border.begin(at) for border in borders)])

    def of(self, asked: Problem) -> Bordered:
        """Return the equations of another member of a family, in the same unknowns."""
        borders: list[Border] = []
        for border in self.borders:
            if isinstance(border, PhaseCondition):
                border = border.of(asked, self.first.lengths)
            elif isinstance(border, Times):
                border = replace(border, given=times_of(asked), energy=asked.energy or 0.0)
            elif isinstance(border, Integral):
                border = replace(border, values=np.array(asked.integral))
            borders.append(border)
        other = Bordered(asked, self.first, tuple(borders))
        other._last = other._like = other._beside = None
        other.reach = self.reach
        return other

    def around_another(self, tr: Transcription) -> Bordered:
        """Return the same borders around another discrete action of the same shape."""
        problem = tr.problem
        other = Bordered(problem.original, tr, self.borders)
        other.reach = self.reach
        return other

    @property
    def is_multiplier(self) -> Array:
        """Which unknowns are multipliers, of the path's rows and of borders, (size,)."""
        found = [np.full(b.size, b.multipliers > 0) for b in self.borders]
        return np.concatenate([self.first.is_multiplier, *found])

    def without(self, *kinds: type) -> tuple[Bordered, NDInt]:
        """Return the equations without borders of these kinds, and their unknowns' places in y."""
        pairs = zip(self.borders, self.parts, strict=True)
        kept = [(b, part) for b, part in pairs if not isinstance(b, kinds)]
        other = Bordered(self.problem, self.first, tuple(b for b, _ in kept))
        inner, places = np.arange(self.first.layout.size), np.arange(self.layout.size)
        return other, np.concatenate([inner, *(places[part] for _, part in kept)])

    @property
    def lengths(self) -> Array:
        """Units of the coordinates, (n,)."""
        return self.first.lengths

    @cached_property
    def forces(self) -> slice:
        """Where the forces on a closed path are among the unknowns: the last ones."""
        count = sum(b.size for b in self.borders if isinstance(b, PhaseCondition))
        return slice(self.layout.size - count, self.layout.size)

    @property
    def phases(self) -> int:
        """The number of directions in which a closed path may be moved."""
        return self.layout.size - self.forces.start

    @property
    def start_coordinates(self) -> tuple[int, ...]:
        """Coordinates at the start that say where a closed path begins."""
        return next((b.given for b in self.borders if isinstance(b, PhaseCondition)), ())

    def at(self, y: Array) -> Transcription:
        """Return the discrete action over the times, and of the multipliers, that belong to y."""
        beside = y[self.first.layout.size : self.forces.start].tobytes()
        if beside != self._beside:
            kappa = None
            for border, part in zip(self.borders, self.parts, strict=True):
                if isinstance(border, Integral):
                    kappa = border.kappa(y[part])
            times, found = times_of(self.problem), self.times_border
            if found is not None:
                times = found[0].times(y[found[1]])
            self._beside = beside
            self._last = self._over(times, kappa)
        assert self._last is not None
        return self._last

    def _over(self, times: Array, kappa: Array | None) -> Transcription:
        """Return the discrete action over times (k + 2,), the last one if they are its own."""
        last, first = self._last, self.first
        if (
            last is not None
            and (times == times_of(last.problem)).all()
            and (kappa is None or (kappa == last.problem.kappa).all())
        ):
            return last
        problem = self.free.found_at(times, kappa=kappa)
        if self._like is not None and self._keeps_rates:
            return self._like.over_times(problem)
        before, ends = first.problem.boundaries, (float(times[0]), float(times[-1]))
        was, now = (np.array([e.t for e in p.through]) for p in (first.problem, problem))
        mesh = carry_boundaries(first.mesh, before, problem.boundaries, *ends, (was, now))
        last = Transcription(problem, mesh, first.lengths, like=first)
        last.counts, last.watch = first.counts, first.watch
        self._like = self._like or last
        return last

    @cached_property
    def _keeps_rates(self) -> bool:
        """Whether nothing but the rates changes with the duration, by which all are divided."""
        problem = self.problem
        timed = problem.has_moving_surface or problem.system.structure.depends_on_time
        return not (timed or problem.is_joined)

    def quadrature_defect(self, y: Array, *, followed: bool = True) -> tuple[Array, float]:
        """Return what another quadrature adds to the residual, (size,), and a free body's drift."""
        miss, drift = self.at(y).quadrature_defect(y, followed=followed)
        return self._of_path(miss), drift

    def misread(self, y: Array) -> Array:
        """Return the change of the residual, (size,), if numbers are read as the next floats."""
        found = self._of_path(self.at(y).misread(y))
        for border, part in zip(self.borders, self.parts, strict=True):
            if isinstance(border, Integral):
                found[part] = border.misread(self.discrete(y))
        return found

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
        gradient = self._gradient(at)
        pairs = zip(self.borders, self.parts, strict=True)
        own = [border.residual(at, y[part], gradient) for border, part in pairs]
        self._times_of = y.tobytes(), gradient
        return np.concatenate([gradient.path, *own])

    def _gradient(self, at: DiscretePath) -> Gradient:
        """Return the derivatives of the action, by the times only if they are unknown."""
        times = np.zeros(len(at.problem.through) + 2)
        if self.moving.size:
            times[self.moving] = self._stretch(at).slopes() / at.tr.action_unit
        return Gradient(at.tr.residual(at.z).copy(), times)

    def _stretch(self, at: DiscretePath) -> Stretch:
        """Return how the action changes with the unknown times, kept until the path changes."""
        kept = self._stretched
        if kept is None or kept.at.tr is not at.tr or (kept.at.z != at.z).any():
            self._stretched = kept = by_joints(at, self.moving)
        return kept

    def kkt(self, y: Array) -> Array:
        """Return the nonzeros of the derivative of `residual`, as the layout says."""
        return self.layout.join(*self._derivatives(y))

    def symmetric_kkt(self, y: Array) -> Array:
        """Return the matrix with C' in place of B, which makes it symmetric."""
        K, _, C, D = self._derivatives(y)
        return self.layout.join(K, C.T, C, D)

    def kinetic(self, y: Array) -> Array:
        """Return the kinetic part of the path's matrix, stored as `kkt` is; of times that of rates.

        A time has that of the path which is run through faster, int v.L_vv v dt.
        """
        at, size = self.discrete(y), self.first.layout.size
        b = self.layout.border
        D = np.zeros((b, b))
        if self.times_border is not None:
            second, point = at.problem.system.pointwise("second"), at.tr.place(at.x)
            mass = second.product(2, at.tr.second(at.x)[2], point.v, symmetric=True)
            part = self.times_border[1]
            own = np.arange(part.start - size, part.stop - size)
            D[own, own] = float(np.sum(at.tr.weight * point.v * mass)) / at.tr.action_unit
        edge = np.zeros((size, b))
        return self.layout.join(at.tr.kinetic(at.z), edge, edge.T, D)

    def _derivatives(self, y: Array) -> tuple[Array, Array, Array, Array]:
        """Return the nonzeros of K, the columns B and rows C beside it, and the corner D."""
        at, size, timed = self.discrete(y), self.first.layout.size, self.times_border
        if timed is not None:
            at.tr.keep_second(at.x)  # they are asked for twice
        K, added = at.tr.kkt(at.z), self.layout.border
        B, C, D = np.zeros((size, added)), np.zeros((added, size)), np.zeros((added, added))
        events = len(at.problem.through) + 2
        bend = Bend(K)
        if timed is not None:
            stretch, moving = self._stretch(at), self.moving
            bend.path, bend.times = np.zeros((size, events)), np.zeros((events, events))
            bend.path[:, moving] = stretch.residuals()
            bend.times[moving[:, None], moving] = stretch.twice() / at.tr.action_unit
        of_times = np.zeros((added, events))
        for border, part in zip(self.borders, self.parts, strict=True):
            own = slice(part.start - size, part.stop - size)
            edges = border.derivative(at, y[part], bend)
            B[:, own], C[own], D[own, own] = edges[:3]
            if edges.times is not None:
                of_times[own] = edges.times
        if timed is not None:
            self._by_times(at, y, bend, of_times, (B, C, D))
        return K, B, C, D

    def _by_times(
        self, at: DiscretePath, y: Array, bend: Bend, of_times: Array, edges: tuple[Array, ...]
    ) -> None:
        """Write derivatives by the unknowns of `Times` into the edges B, C and D of the matrix.

        By the chain rule from those by the times of events: of the path's residual and of the times
        themselves in `bend`, and of the other borders, (b, k + 2), in `of_times`.
        """
        assert self.times_border is not None and bend.path is not None
        (border, part), size, (B, C, D) = self.times_border, len(bend.path), edges
        own = slice(part.start - size, part.stop - size)
        if self._times_of is None or self._times_of[0] != y.tobytes():
            self._equations(at, y)
        assert self._times_of is not None
        gradient = self._times_of[1]
        dt = border.jacobian(y[part])
        B[:, own] = bend.path @ dt
        C[own] = B[:, own].T
        D[:, own] = of_times @ dt
        D[own] = D[:, own].T
        D[own, own] = dt.T @ bend.times @ dt + border.twice(y[part], border.slopes(at, gradient))

    def relative_step(self, step: Array) -> float:
        """Return the largest change of a coordinate by a step, as a function of time."""
        found = self.first.relative_step(step)
        if self.times_border is None:
            return found
        return max(found, self.reach * float(np.abs(step[self.times_border[1]]).max()))

    @property
    def magnitudes(self) -> Array:
        """Sizes of the unknowns in their units, (size,)."""
        beside = self.layout.size - self.first.layout.size
        found = np.concatenate([self.first.magnitudes, np.ones(beside)])
        found[self.forces] = 0.0  # they vanish
        return found


def equations_of(
    asked: Problem, at: DiscretePath, moves: Sequence[Move] = ()
) -> tuple[Bordered | Transcription, Array]:
    """Return the equations of a path on its mesh, as `asked` between its ends, and its unknowns.

    `moves` are motions of configuration space that a closed path may be subjected to.
    """
    problem, tr = at.problem, at.tr
    if not asked.has_free_boundary and tr.order > 1 and problem.touches:
        if asked is problem:
            return tr, at.z
        equations = Transcription(asked, at.mesh, tr.lengths, like=tr)
        x = equations.pack_places(tr.place(at.x).places)
        return equations, np.concatenate([x, at.z[at.x.size :]])  # of no values at nodes
    if not asked.has_free_boundary:
        equations = Transcription(asked, at.mesh, tr.lengths, like=tr)
        return equations, equations.pack(at.Q, at.lam)
    kappa = problem.kappa if problem.kappa.size else None
    known, lam = {"moves": moves, "times": times_of(problem), "kappa": kappa, "like": tr}, None
    if tr.layout.rows:
        lam = np.nan_to_num(at.rows)
        equations, y = Bordered.around(asked, at.path, lam, tr.lengths, **known)
        # At an event whose place was found there was no row: what is there stops a jump.
        here, weight = equations.discrete(y), np.bincount(tr.layout.node_of, tr.weight[:, 0])
        for k, node in enumerate(tr.joints.tolist()[: -1 if tr.layout.closed else None]):
            lost = np.isnan(at.rows[node])
            if lost.any():
                lam[node, lost] = reactions(here, k)[1][lost] / weight[node]
    equations, y = Bordered.around(asked, at.path, lam, tr.lengths, **known)
    for border, part in zip(equations.borders, equations.parts, strict=True):
        if isinstance(border, Rows):  # coordinates given at its event bear a part of the momentum
            y[part] = border.begin(at)
    return equations, y


def null_space(equations: Bordered | Transcription, whole: Array) -> Array:
    """Return a basis (size, c), orthonormal, of what the rows that have multipliers allow.

    `whole` (size, size) is the matrix of the equations. On it the second derivatives of W have as
    many negative eigenvalues as the path has directions in which the action falls.
    """
    held = equations.is_multiplier
    rows = whole[np.ix_(held, ~held)]
    sizes = np.linalg.norm(rows, axis=1, keepdims=True)
    q, _ = np.linalg.qr((rows / np.where(sizes > 0, sizes, 1.0)).T, mode="complete")
    found = np.zeros((held.size, q.shape[1] - len(rows)))
    found[~held] = q[:, len(rows) :]
    return found


def _fit_multipliers(problem: Problem, path: Path, lengths: Array) -> Array:
    """Return multipliers of integrals with which a path is nearest to a stationary one, (c,).

    With a definite inertia, where one of them can give it that.
    """
    tr = Transcription(problem, path.mesh, lengths)
    at = DiscretePath(tr, tr.pack(path.values.T))
    kappa = _balance(tr, at)
    return kappa if tr.order > 1 else _make_definite(tr, at, kappa)


def _balance(tr: Transcription, at: DiscretePath) -> Array:
    """Return multipliers of integrals that balance the forces along a path best, (c,)."""
    slopes, force = integrals(at)[1], tr.gradient(at.x) * tr.action_unit
    # What pushes at an event is no force that a multiplier has to balance.
    at_events = np.isin(tr.layout.free // tr.layout.width, tr.joints)
    slopes, force = np.where(at_events, 0.0, slopes), np.where(at_events, 0.0, force)
    if not (np.isfinite(slopes).all() and np.isfinite(force).all()):
        return np.zeros(len(slopes))
    if tr.layout.rows:  # what constraints bear is no part of it
        *slopes, force = (_off_normals(tr, at, x) for x in (*slopes, force))
        slopes = np.array(slopes)
    if tr.order > 1 and not tr.layout.rows:  # rough parts count for less, as they do in motion
        inertia = Factors(tr.layout, tr.kinetic(at.x))
        with suppress(np.linalg.LinAlgError):
            carried = np.array([inertia.solve(slope) for slope in slopes])
            return -np.linalg.solve(carried @ slopes.T, carried @ force)
    return -np.linalg.lstsq(slopes.T, force, rcond=None)[0]


def _make_definite(tr: Transcription, at: DiscretePath, kappa: Array) -> Array:
    """Return multipliers of integrals near `kappa` (c,) with which L_vv is definite along a path.

    Those of rough paths may not be: of a rope, weights would be of both signs, and Newton's method
    be lost. One is changed that makes it definite on either side of an interval, the side nearer to
    it; it is left where there is none.
    """
    free, times, point = tr.problem.original.loose, times_of(tr.problem), tr.place(at.x)

    def inertia(kappa: Array) -> Array:
        problem = free.found_at(times, kappa=kappa)
        second = problem.system.pointwise("second")
        with np.errstate(all="ignore"):
            values = second(point.at, point.v, tr.times, problem.packed)[2]
            return second.full(2, values.copy(), symmetric=True)

    found = kappa.copy()
    for i, unit in enumerate(np.eye(kappa.size)):
        A = inertia(np.where(unit, 0.0, found))
        B = inertia(np.where(unit, 1.0, found)) - A
        if not (np.isfinite(A).all() and np.isfinite(B).all()):
            return kappa
        sign = np.sign(np.trace(B[0]))
        values = np.linalg.eigvalsh(sign * B)
        if not values.min() > RANK * values.max():
            continue
        root = np.linalg.inv(np.linalg.cholesky(sign * B))
        limits = -sign * np.linalg.eigvalsh(root @ A @ root.transpose(0, 2, 1))
        middle, half = (limits.max() + limits.min()) / 2, np.ptp(limits) * (0.5 + DEFINITE)
        if abs(found[i] - middle) < half:
            found[i] = middle + half * (1.0 if found[i] >= middle else -1.0)
    return found


def _off_normals(tr: Transcription, at: DiscretePath, x: Array) -> Array:
    """Return the part along the constraints of derivatives by the unknowns, (unknowns,)."""
    layout = tr.layout
    if tr.order > 1:
        J = np.zeros((layout.rows, layout.unknowns))
        J[layout.jacobian.row, layout.jacobian.col] = tr.jacobian(at.x)
        basis = np.linalg.qr(J.T)[0]
        return x - basis @ (basis.T @ x)
    whole = np.zeros(layout.node_count * layout.width)
    whole[layout.free] = x
    table = whole.reshape(layout.node_count, -1)
    G = tr.problem.system.pointwise("constraint_jacobian").full(0, tr.normals(at.x))
    G = G * tr.lengths * (layout.number[layout.row_nodes] >= 0)[:, None, :]
    rows = table[layout.row_nodes][:, :, None]
    table[layout.row_nodes] -= (np.linalg.pinv(G) @ (G @ rows))[:, :, 0]
    return whole[layout.free]
