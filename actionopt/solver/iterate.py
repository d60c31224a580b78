"""A path under way: where it is, the ways to move it, and the record of what was done.

The path stands on one mesh at a time, as the vector z of a `Transcription`. It is placed there,
sought by one method or another, followed to rounding by Newton's, and carried to the next mesh.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from contextlib import suppress
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any

import numpy as np

from actionopt.discrete.boundaries import bounded
from actionopt.discrete.discrete_path import DiscretePath
from actionopt.discrete.factors import Factors
from actionopt.discrete.mesh import Mesh
from actionopt.discrete.newton import Followed, approach, follow, moved
from actionopt.discrete.path import Path
from actionopt.discrete.projection import project
from actionopt.discrete.resolution import Resolution, resolution
from actionopt.discrete.transcription import Transcription
from actionopt.mechanics.problem import NEGLIGIBLE, Problem
from actionopt.solver.descent import descend
from actionopt.solver.homotopy import release
from actionopt.solver.ipopt import Principle, find
from actionopt.solver.preflight import check
from actionopt.tools.types import Array
from actionopt.tools.watch import Watch

FEW = 3  # coordinates up to which descending costs less than entering Ipopt
ALIKE = 4.0  # ratio of coordinates' sizes within which the units of action are kept
DENSE_MOTION = 400  # coordinates and constraints up to which the equations are solved as they are
LARGE = 1500  # unknowns above which Ipopt takes too long over a square system
QUICK = 12  # damped steps before something else is tried
PASSABLE = 0.01  # of the coefficients a mesh leaves out, what Newton's method may leave there
NEAR = 0.1  # a path that moves farther than this when refined, in its own size, is another one
EXPECTED = 2.0  # times what is missed, to first order, that a path may move when it is seen
TINY, SHORT = 1e-6, 1e-2  # of the time, elements that only singularities need; and need first
LATE = 1e3  # durations from zero, where the round-off of times counts
SHOWN = 2e-2  # omitted coefficients of a path that is worth a second look
ASTRAY = 10.0  # times its speed, an error of the velocity; on the scenes at most 0.08
SAFETY = 4.0  # between the measured error of the last round and the estimate for the next
ROUNDOFF = 2 * float(np.finfo(float).eps)  # of evaluating the polynomial, to begin with
ORDINARY = 100.0  # amplification of round-off on a mesh where nothing is sensitive, at most
MEASURABLE = 1e-12  # coefficients below this are too near to rounding to measure a gain
UNLIKELY = 100.0  # ratio of global to local error that has another reason as a rule
UNKNOWN_GAIN = 10.0  # assumed ratio of global to local error before any was measured


@dataclass(eq=False)
class Walk:
    """A path of `problem` under way, and what was done so far.

    `error` estimates how far it is from the continuous path: the omitted coefficients times
    `gain`, the ratio of global to local error, and `noise`, round-off amplified by the problem.
    """

    problem: Problem
    linear: bool = False
    tol: float = 0.0
    refines: bool = True  # whether a path that is not resolved goes on to another mesh
    many: bool = False  # whether it is one of many such paths, on meshes of the same shapes
    sizes: Array = field(init=False)  # of the coordinates: the units of errors
    lengths: Array = field(init=False)  # of the motion: the units of steps
    tr: Transcription = field(init=False)
    z: Array = field(init=False)
    gain: float = UNKNOWN_GAIN
    noise: float = 0.0
    error: float = np.inf
    units: Transcription | None = None  # whose units of action and constraints serve again
    checked: bool = False
    diverged: bool = False  # whether the last descent found the action unbounded
    hint: str = ""  # what to add to the verdict
    watch: Watch | None = None
    best: tuple[Transcription, Array, float] | None = None  # where it was polished last, the error
    lost: tuple[Transcription, Array] | None = None  # a path that was near, and not to be polished
    resolved: tuple[Array, Resolution] | None = None  # of the current z
    factors: tuple[Array, Factors] | None = None  # z, and those found close to it, if not large
    probed: tuple[Array, Array] | None = None  # z, and how the `probe` of its layout moves it
    iterations: Counter[str] = field(default_factory=Counter)
    evaluations: Counter[str] = field(default_factory=Counter)
    rounds: list[dict[str, Any]] = field(default_factory=list)
    time: dict[str, float] = field(default_factory=lambda: defaultdict(float))

    def __post_init__(self) -> None:
        self.begin()

    # -- where it is ---------------------------------------------------------------------------

    @property
    def large(self) -> bool:
        """Whether the problem on the mesh at hand is too large for what takes long."""
        return self.tr.layout.size > LARGE

    @property
    def can_descend(self) -> bool:
        """Whether descending is open to the problem, and costs less than entering Ipopt."""
        return self.problem.system.m == 0 and self.problem.system.n <= FEW

    def path(self) -> Path:
        """Return the path as it is now."""
        return Path(self.tr.mesh, self.tr.coordinates(self.z).T)

    def rough(self) -> float:
        """Return what the mesh at hand leaves out, in units of the motion."""
        return self.resolution().worst * float((self.sizes / self.lengths).max())

    def resolution(self) -> Resolution:
        """Return how well the mesh at hand represents it."""
        if self.resolved is None or self.resolved[0] is not self.z:
            found = resolution(self.tr.mesh, self.tr.coordinates(self.z), self.sizes)
            self.resolved = (self.z, found)
        return self.resolved[1]

    def index(self) -> int:
        """Return the number of variations on the mesh at hand that lower the action."""
        layout = self.tr.layout
        if self.factors is not None and self.factors[0] is self.z:
            return self.factors[1].negative() - layout.rows
        return Factors(layout, self.tr.kkt(self.z)).negative() - layout.rows

    # -- ways to move ----------------------------------------------------------------------------

    def stop(self) -> None:
        """Go back to where it was polished last, for want of time; watched no more."""
        self.watch, self.error = None, np.inf
        if self.best is not None:
            self.tr, self.z, self.error = self.best
        elif not hasattr(self, "tr"):
            problem = self.problem
            self.begin()
            self.checked = True
            self.place(Mesh.uniform(problem.start.t, problem.end.t, 4, 6), None)
        self.tr.watch = None

    def begin(self, path: Path | None = None) -> None:
        """Measure as the events tell, or as `path` does."""
        self.sizes, self.lengths = self.problem.scales, self.problem.lengths
        if path is not None:
            self.measure(path.values.T)

    def measure(self, Q: Array) -> None:
        """Measure as the path with node coordinates Q (K, n) tells."""
        self.sizes = self.lengths = sizes(Q, self.problem.scales)
        if self.problem.origin is not None:
            self.lengths = sizes(Q - self.problem.origin, self.problem.lengths)

    def restart(self) -> None:
        """Forget what was measured on a path that is given up."""
        self.gain, self.error, self.best = UNKNOWN_GAIN, np.inf, None

    def place(self, mesh: Mesh, path: Path | None, lam: Array | None = None) -> None:
        """Transcribe on `mesh`, starting from `path` there, or from the straight line.

        Multipliers (K, m) that are not given are those that the motion along it would need.
        """
        clock = perf_counter()
        system = self.problem.system
        if self.refines and self.problem.instants:
            mesh = bounded(mesh, self.problem.instants)
        like = self.units if self.units is not None and self._alike(self.units.lengths) else None
        self.tr = self.units = Transcription(self.problem, mesh, self.lengths, like=like)
        self.evaluations.update(self.tr.counts)
        self.tr.counts, self.tr.watch = self.evaluations, self.watch
        if path is None:
            Q = self.tr.straight()
        else:
            Q = path.values.T if path.mesh is mesh else path.on(mesh).values.T
        if system.m and lam is None:
            Q = project(self.tr, Q)
        if not self.checked:
            check(self.tr, Q)
            self.checked = True
        if system.m and lam is None and system.n + system.m <= DENSE_MOTION:
            lam = self._motion_multipliers(mesh, Q)
        self.z = self.tr.pack(Q, lam)
        self.time["assemble"] += perf_counter() - clock

    def join(self, tr: Transcription, z: Array) -> bool:
        """Stand where the path z of a problem goes when its ends move to this one's.

        They may differ in nothing else. False if the path is lost, or grows out of its units.
        """
        clock = perf_counter()
        mine = tr.between(self.problem)
        ends = mine.ends[[0, -1]]
        origin = 0.0 if tr.origin is None else tr.origin
        self.sizes = np.maximum(tr.lengths, np.max(np.abs(ends), axis=0))
        self.lengths = np.maximum(tr.lengths, np.max(np.abs(ends - origin), axis=0))
        if not self._alike(tr.lengths):
            return False
        if not self.linear:
            try:
                z = moved(tr, z, mine)
            except np.linalg.LinAlgError:
                return False
            finally:
                tr.forget()
        self.tr = self.units = mine
        mine.counts, mine.watch = self.evaluations, self.watch
        self.z = z
        self.time["assemble"] += perf_counter() - clock
        return bool(np.all(np.isfinite(z)))

    def _alike(self, lengths: Array) -> bool:
        """Whether units of these lengths serve for the present sizes as well."""
        ratio = self.lengths / lengths
        return bool(ratio.max() < ALIKE and ratio.min() > 1 / ALIKE)

    def _motion_multipliers(self, mesh: Mesh, Q: Array) -> Array | None:
        """Return the multipliers (K, m) of the index-1 equations of motion along Q (K, n)."""
        v = Path(mesh, Q.T).velocity(mesh.nodes)
        parameters = self.problem.parameters
        try:
            lam = self.problem.system.multipliers(Q.T, v, mesh.nodes, parameters=parameters).T
        except np.linalg.LinAlgError:
            return None
        return np.nan_to_num(lam, posinf=0.0, neginf=0.0)

    def find(self, principle: Principle) -> bool:
        """Ask Ipopt for a path; False if it finds none."""
        clock = perf_counter()
        attempt = find(self.tr, self.z, principle)
        self.iterations["ipopt"] += attempt.iterations
        self.diverged = attempt.diverged
        self.time["solve"] += perf_counter() - clock
        if not attempt.converged:
            return False
        self.z = attempt.z
        self._record(perf_counter() - clock)
        return True

    def root(self) -> bool:
        """Ask Ipopt for a root of the stationarity conditions, unless that takes too long."""
        if self.large:
            return False
        before, self.z = self.z, self._unheld()
        if self.find("stationary"):
            return True
        self.z = before
        return False

    def release(self) -> bool:
        """Continue from the straight line by releasing the force that makes it a motion."""
        clock = perf_counter()
        released = release(self.tr, self.z)
        if released is not None:
            self.z = released[0]
            self.iterations["continuation"] += released[1]
        self.time["solve"] += perf_counter() - clock
        return released is not None and self._polished()

    def descend(self) -> bool:
        """Minimise the action from the path at hand."""
        clock = perf_counter()
        result = descend(self.tr, self.z)
        self.iterations["descent"] += result.iterations
        self.diverged = result.runaway
        if result.found:
            self.z = result.z
        self.time["solve"] += perf_counter() - clock
        return result.found and self._polished()

    def approach(self, steps: int = QUICK, *, convex: bool = False) -> bool:
        """Go to a path by damped Newton steps; if `convex`, only from where the action is that.

        Near a resonance the multipliers of the motion along the first path make the matrix
        nearly singular there; without any it is stiff, and the way may be open.
        """
        clock = perf_counter()
        near = approach(self.tr, self.z, steps, convex=convex)
        if near is None and self.tr.layout.rows:
            near = approach(self.tr, self._unheld(), steps)
        if near is not None:
            self.z = near[0]
            self.iterations["newton"] += near[1]
        self.time["solve"] += perf_counter() - clock
        return near is not None and self._polished()

    def _polished(self) -> bool:
        """Polish the path that was reached; where that does not work, keep in mind where it was."""
        if self.follow():
            return True
        self._lose(self.tr, self.z)
        return False

    def _lose(self, tr: Transcription, z: Array) -> None:
        """Keep a path in mind that was near, unless it runs through a singularity."""
        mesh, Q = tr.mesh, tr.coordinates(z)
        shown = resolution(mesh, Q, sizes(Q, self.problem.scales)).worst < SHOWN
        if shown and mesh.lengths.min() > SHORT * mesh.duration:
            self.lost = tr, z

    def _unheld(self) -> Array:
        """Return the path at hand without multipliers."""
        cut = self.tr.layout.unknowns
        return np.concatenate([self.z[:cut], np.zeros(self.z.size - cut)])

    def follow(self, reach: float = np.inf) -> bool:
        """Polish the path where it is; False if it is not there, or farther than `reach`."""
        clock = perf_counter()
        self.factors = None  # frees them before others are made
        first = self.refines and reach == np.inf and not self.many  # others are resolved already
        # What is left of a linear problem after one step is round-off, none of it a lack of steps.
        negligible = (UNKNOWN_GAIN if self.linear else 1.0) * ORDINARY * ROUNDOFF
        result: Followed = follow(
            self.tr,
            self.z,
            linear=self.linear,
            many=self.many,
            target=min(self.tol / (10 * SAFETY), negligible),
            enough=self._passable if first else None,
        )
        self.iterations["newton"] += result.iterations
        self.time["solve"] += perf_counter() - clock
        arrived = result.converged and (self.linear or result.travelled < reach)
        if arrived:
            self.z = result.z
            self.measure(self.tr.coordinates(self.z))
            self.noise = result.noise * self._unit
            self.factors = (self.z, result.factors) if result.factors else None
            self.gain = max(self.gain, self._sensitivity())
            self.error = SAFETY * (self.gain * self.resolution().worst + self.noise + ROUNDOFF)
            self._record(perf_counter() - clock)
            self.best = self.tr, self.z, self.error
        return arrived

    def missed(self) -> float:
        """Return how far the path would move if its forces were summed over other points.

        Nothing is missed where they are linear in the path and do not depend on time.
        """
        if self.problem.system.structure.steady:
            return 0.0
        clock = perf_counter()
        factors, tr = self._factors(), self.tr
        residual, carried = _unseen(tr, self.z, self.tol / self._unit)
        with np.errstate(all="ignore"):
            if self.can_be_one_of_many and tr.layout.small:
                step, probed = factors.solve_both(residual, self._probe(factors))
                self.probed = self.z, probed
            else:
                step = factors.solve(residual)
        self.time["verify"] += perf_counter() - clock
        return max(tr.measured(step), carried) * self._unit

    @property
    def can_be_one_of_many(self) -> bool:
        """Whether ends may leave a family of paths that the path's own round-off does not show."""
        system = self.problem.system
        return system.n > 1 and not system.structure.forced

    def amplification(self) -> float:
        """Return how far round-off in every entry of the matrix may move the path.

        Without forces, or to one side of a symmetry, the residual of a path has no round-off of
        its own that would tell.
        """
        if self.probed is None or self.probed[0] is not self.z:
            factors = self._factors()
            self.probed = self.z, factors.solve(self._probe(factors))
        return self.tr.measured(self.probed[1]) * self._unit

    def _probe(self, factors: Factors) -> Array:
        return (ROUNDOFF * float(np.abs(factors.nonzeros).max())) * self.tr.layout.probe

    def _factors(self) -> Factors:
        """Return factors of the matrix at the path, or close to it."""
        if self.factors is None or self.factors[0] is not self.z:
            self.factors = (self.z, Factors(self.tr.layout, self.tr.kkt(self.z), many=self.many))
        return self.factors[1]

    @property
    def late(self) -> bool:
        """Whether times matter and are rounded more coarsely than what happens in them."""
        start, end = self.problem.start.t, self.problem.end.t
        far = max(abs(start), abs(end)) > LATE * (end - start)
        return far and self.problem.system.structure.depends_on_time

    def misread(self) -> float:
        """Return how far the path moves if times and coordinates are read as their neighbours.

        That is their round-off; zero where they are near zero: there it is that of all numbers.
        """
        if not self.late and self.tr.origin is None:
            return 0.0
        factors = Factors(self.tr.layout, self.tr.kkt(self.z))
        return self.tr.measured(factors.solve(self.tr.misread(self.z))) * self._unit

    def torn(self) -> bool:
        """Whether the path is known and its velocity is not: it runs through a singularity.

        Only where the mesh has been refined out of proportion.
        """
        mesh = self.tr.mesh
        shortest = mesh.lengths.min() / self.problem.duration
        if shortest > SHORT:
            return False
        path, k = self.path(), np.array(mesh.degrees) + 1
        speeds = np.maximum(
            np.abs(path.velocity(mesh.nodes)).max(axis=1), self.sizes / self.problem.duration
        )
        rates = self.resolution().omitted * k * (k + 1) / mesh.lengths
        limit = ASTRAY if shortest > TINY else 1.0
        return bool(rates.max() * (self.sizes / speeds).max() > limit)

    @property
    def _unit(self) -> float:
        """What `measured` is in the path's own size, at most."""
        unit = self.tr.lengths if self.tr.origin is None else self.tr.lengths + abs(self.tr.origin)
        return max(1.0, float((unit / self.sizes).max()))

    def _passable(self, z: Array) -> float:
        """Return how far a path may be from stationary that goes on to another mesh; 0 if none."""
        worst = resolution(self.tr.mesh, self.tr.coordinates(z), self.sizes).worst
        return PASSABLE * worst if SAFETY * self.gain * worst > self.tol else 0.0

    def carry(self, mesh: Mesh, *, least: bool, missed: float = 0.0) -> bool:
        """Take the path to another mesh and polish it there; False if it was lost.

        It may move as far as what was `missed` on the last mesh lets expect.

        What was found as a `least` path may be found again by minimising.
        """
        old, before = self.path(), self.resolution()
        there = self.tr, self.z
        lam = DiscretePath(self.tr, self.z).rows_on(mesh)
        Q = self.tr.coordinates(self.z)
        self.measure(Q)
        self.place(mesh, old, lam)
        carried = self.tr.coordinates(self.z)
        reach = max(NEAR, EXPECTED * missed)
        if not self.follow(reach=reach):
            if not self._recover(least):
                self._lose(*there)
                return False
            moved = np.max(np.abs(self.tr.coordinates(self.z) - carried) / self.lengths)
            if not least and moved > reach:
                return False
        change = np.max(np.abs(self.tr.coordinates(self.z) - carried) / self.sizes)
        if before.worst > MEASURABLE:
            left = before.worst
            if change > UNLIKELY * left and not self.problem.system.structure.steady:
                with suppress(np.linalg.LinAlgError):  # what was not seen moves the path as well
                    tr, factors = there[0], Factors(there[0].layout, there[0].kkt(there[1]))
                    residual, carried = _unseen(*there, self.tol)
                    left += max(tr.measured(factors.solve(residual)), carried)
            self.gain = max(float(change) / left, 1.0)
        elif self.gain == UNKNOWN_GAIN:
            self.gain = 1.0
        self.gain = max(self.gain, self._sensitivity())
        self.error = SAFETY * (self.gain * self.resolution().worst + self.noise + ROUNDOFF)
        self.rounds[-1]["estimate"] = self.error
        return True

    def _recover(self, least: bool) -> bool:
        """Find the path again on a mesh where following it did not work."""
        if not least:
            return self.root() and self.follow()
        if self.can_descend and self.descend():
            return True
        return self.find("patient least") and self.follow()

    def _sensitivity(self) -> float:
        """Return how much amplified round-off says that other errors are amplified, at least."""
        return self.noise / (ORDINARY * ROUNDOFF)

    def _record(self, seconds: float) -> None:
        mesh = self.tr.mesh
        self.rounds.append(
            {
                "elements": mesh.elements,
                "degrees": [min(mesh.degrees), max(mesh.degrees)],
                "unknowns": self.tr.layout.size,
                "estimate": None,
                "time": seconds,
            }
        )


def _unseen(tr: Transcription, z: Array, tol: float) -> tuple[Array, float]:
    """Return the residual of z if its forces are summed over other points, and how far z would go.

    That is by what holds the path on the whole, beside what holds it there: where a feature in q is
    not resolved, the curvature that one node happens to see there would hold it far too well. The
    momentum that is missed carries a body 1 / (1 + w T) as far as a free one, w the typical rate.
    """
    with np.errstate(all="ignore"):
        residual, carried = tr.missed(z)
        if SAFETY * carried > tol:
            carried /= 1.0 + tr.turns(z)
        return residual, carried


def sizes(Q: Array, fallback: Array) -> Array:
    """Return the largest |q| of each coordinate along a path, (n,), positive.

    One that is negligible beside another is zero up to rounding, unless `fallback`, the problem's
    own `scales`, says that it is small as it is.
    """
    size = np.abs(Q).max(axis=0)
    largest = size.max()
    if not largest > 0:
        return fallback
    negligible = NEGLIGIBLE * largest
    zero = size <= negligible
    if not zero.any():
        return size
    return np.where(zero & ((size == 0) | (fallback > negligible)), largest, size)
