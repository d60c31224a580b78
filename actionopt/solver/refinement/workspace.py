"""What a search works on: the iterate at hand, the ways to move it, and the record of it all."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from time import perf_counter
from typing import TYPE_CHECKING, Generic, TypeVar, cast

import numpy as np

from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.matrices.factors import Factors
from actionopt.discrete.meshes.boundaries import with_boundaries
from actionopt.discrete.meshes.element import with_degrees
from actionopt.discrete.meshes.mesh import Mesh, with_singular_ends
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.meshes.resolution import resolution
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.discrete.newton.newton import approach, follow, move_ends
from actionopt.mechanics.question.problem import Problem
from actionopt.solver.input.preflight import check
from actionopt.solver.refinement.first_mesh import (
    COARSE_DEGREE,
    IPOPT_SIZE,
    LINEAR,
    uneven_elements,
)
from actionopt.solver.refinement.iterate import (
    ORDINARY,
    POLYNOMIAL_ROUNDOFF,
    SAFETY,
    SHORT_ELEMENT,
    TINY_ELEMENT,
    UNKNOWN_GAIN,
    Iterate,
    coordinate_scales,
    sizes,
    unseen,
)
from actionopt.solver.refinement.record import Record
from actionopt.tools.types import Array
from actionopt.tools.watch import Watch

if TYPE_CHECKING:
    from actionopt.discrete.between_nodes.crossing import Jump
    from actionopt.discrete.between_nodes.energy_balance import Imbalance
    from actionopt.solver.refinement.ipopt import Principle

# Ad hoc, where nothing else is said. "Flat" is what was varied by 3 either way over the scenes and
# 40 stress cases, where no status changed, and iterations by no more than 2 %.
FEW_COORDINATES = 3  # up to which descending costs next to nothing; flat
UNITS_RATIO = 4.0  # of coordinates' sizes, within which the units of action are kept
DENSE_MOTION = 400  # coordinates and constraints up to which the equations are solved as they are
DESCENTS = 3  # one after the other
QUICK_STEPS = 12  # damped, before something else is tried; flat
# The part of the coefficients that a mesh leaves out by which Newton's method may stop short of the
# path. Flat, and up to ten times as much; without it, 1.4 % more iterations.
PASSABLE = 0.01
FOLLOWED_REACH = 0.1  # a path that moves farther when refined, in its own size, is another; flat
EXPECTED = 2.0  # times what is missed, to first order, that a path may move when it is seen; flat
# Omitted coefficients below which a coarse path is worth refining. Flat, but for the verdict on a
# kink of a fiftieth of the path, which is not solved in either case.
ROUGHLY = 2e-2
PATIENT = 30  # damped steps towards a path: whatever else there is costs more
MEASURABLE = 1e-12  # coefficients below this are too near to rounding to measure a gain
UNLIKELY = 100.0  # ratio of global to local error that has another reason as a rule; flat


Place = TypeVar("Place", bound=Iterate)
Reached = tuple[Array | None, int]  # a point near a path, if a way led to one, and its cost


@dataclass(eq=False)
class Workspace(Generic[Place]):
    """The iterate at hand (`here`) and the ways to move it.

    A way that leads nowhere says so and leaves the iterate where it was, or where it was lost:
    iterates do not change, so that going back is keeping the old one.
    """

    problem: Problem
    linear: bool = False  # whether its equations are
    tol: float = 0.0  # to which the path is wanted
    refines: bool = True  # whether a path that is not resolved goes on to another mesh
    many: bool = False  # whether it is one of many such paths, on meshes of the same shapes
    watch: Watch | None = None
    record: Record = field(default_factory=Record)
    gain: float = UNKNOWN_GAIN  # ratio of global to local error to begin with
    units: Transcription | None = None  # whose units of action and constraints serve again
    checked: bool = False  # whether the question was found to be in order
    unbounded: bool = False  # whether the last minimisation found the action unbounded
    recovered: bool = False  # whether the last transfer lost the path and found it again
    # Whether a neighbour's path led to where plain Newton steps will hardly arrive.
    astray: bool = False
    # Newton's first step where a path was lost that was followed last, in its coordinates' sizes.
    first_step: float = 0.0
    hint: str = ""  # what to add to the verdict
    best: Iterate | None = None  # where it was polished last, if time may run out
    unpolished: Iterate | None = None  # a path that was near, and not to be polished
    # How far the path is inside of an obstacle where it is not held, in its own size.
    inside: float = 0.0
    # Where the balance of energy did not hold along the last path that was resolved.
    unbalance: Jump | Imbalance | None = None
    iterate: Place | None = None

    @property
    def question(self) -> Problem:
        """The problem that was asked."""
        return self.problem

    @property
    def here(self) -> Place:
        """The iterate at hand. There is none before `transcribe`."""
        assert self.iterate is not None
        return self.iterate

    @here.setter
    def here(self, there: Iterate) -> None:
        self._stand_at(there)

    def _stand_at(self, there: Iterate) -> None:
        self.iterate = cast(Place, there)

    @property
    def large(self) -> bool:
        """Whether the problem on the mesh at hand is too large for what takes long."""
        return self.here.equations.layout.size > IPOPT_SIZE

    @property
    def sparse(self) -> bool:
        """Whether the equations on the mesh at hand are solved by sparse factors."""
        return self.here.tr.layout.storage == "sparse"

    @property
    def many_coordinates(self) -> bool:
        """Whether factorizations cost more than anything else."""
        return self.problem.system.n > FEW_COORDINATES

    @property
    def can_descend(self) -> bool:
        """Whether descending is open to the problem, and costs less than anything else."""
        return self.problem.system.m == 0 and not self.many_coordinates

    @cached_property
    def uneven(self) -> float:
        """The elements on each of which the inertia along the straight line varies little."""
        return uneven_elements(self.problem)

    @property
    def has_mass(self) -> bool:
        """Whether L_vv is positive along the straight line, as along a least path (Legendre)."""
        tr = self.here.tr
        if tr.layout.rows:  # tangent to the constraints alone it has to be
            return True
        with np.errstate(all="ignore"):
            return Factors(tr.layout, tr.kinetic(tr.pack(tr.straight()))).definite()

    @property
    def has_kink(self) -> bool:
        """Whether Newton's method still loses the path where a smooth one would be resolved.

        So it is where a least curve runs through a pole of its coordinates. Measured: of 60 layers,
        walls and poles passed at a distance, the last was lost on elements of 1e-5.
        """
        mesh = self.here.mesh
        return self.recovered and bool(mesh.lengths.min() < TINY_ELEMENT * mesh.duration)

    def again(self) -> Workspace:
        """Return one for another search for a path of the same problem."""
        return replace(
            self,
            record=Record(),
            gain=UNKNOWN_GAIN,
            hint="",
            best=None,
            unpolished=None,
            unbalance=None,
            iterate=None,
        )

    # -- where it begins -----------------------------------------------------------------------

    def transcribe(
        self,
        mesh: Mesh,
        path: Path | None,
        lam: Array | None = None,
        *,
        like: Path | None = None,
    ) -> None:
        """Transcribe on `mesh`, starting from `path` there, or from the straight line.

        Sizes are those of the path `like`, or as the events tell. Multipliers (K, m) that are not
        given are those that the motion along the path would need.
        """
        self.here = self._at(mesh, path, lam, like)

    def _at(self, mesh: Mesh, path: Path | None, lam: Array | None, like: Path | None) -> Iterate:
        """Return the iterate of `transcribe`."""
        with self.record.clock("assemble"):
            system, mesh = self.problem.system, self.with_boundaries(mesh)
            size, lengths = coordinate_scales(self.problem, None if like is None else like.values.T)
            units = self.units if self.units is not None and alike(lengths, self.units) else None
            tr = self.units = Transcription(self.problem, mesh, lengths, like=units)
            self._attach(tr)
            if path is None:
                Q = tr.straight()
            else:
                Q = path.values.T if path.mesh is mesh else path.on(mesh).values.T
            if system.m and lam is None:
                from actionopt.discrete.action.projection import project, project_on

                if path is None and system.order > 1:  # others are moved on by Ipopt
                    from actionopt.discrete.borders.surfaces import shear_to_surface

                    Q = shear_to_surface(tr, Q)
                Q = (project_on if path is None and _chooses(self.problem) else project)(tr, Q)
            if not self.checked:
                check(tr, Q, borrowed=units is not None)
                self.checked = True
            small = system.n + system.m <= DENSE_MOTION
            if system.m and lam is None and small and system.order == 1:
                lam = self._motion_multipliers(mesh, Q)
            return Iterate(tr, tr.pack(Q, lam), size, lengths, self.gain)

    def ensure_iterate(self) -> None:
        """Transcribe along the straight line where no way of searching applied: for a verdict."""
        if self.iterate is None:
            mesh = Mesh.uniform(self.problem.start.t, self.problem.end.t, LINEAR, COARSE_DEGREE)
            self.transcribe(mesh, None)

    def continue_from(self, neighbour: DiscretePath) -> bool:
        """Stand where a path of a problem goes when its ends move to this one's.

        They may differ in nothing else. False if the path is lost, or grows out of its units.
        """
        tr, z = neighbour.tr, neighbour.z
        with self.record.clock("assemble"):
            mine = tr.between(self.problem)
            ends = mine.ends[[0, -1], : tr.lengths.size]
            origin = 0.0 if tr.origin is None else tr.origin
            lengths = np.maximum(tr.lengths, np.max(np.abs(ends - origin), axis=0))
            if not alike(lengths, tr):
                return False
            if not self.linear:
                try:
                    z, near = move_ends(tr, z, mine)
                    if not near:
                        mine, z = self._shift(neighbour, mine, z)
                except np.linalg.LinAlgError:
                    return False
                finally:
                    tr.forget()
            self.units = mine
            self._attach(mine)
            size = np.maximum(tr.lengths, np.max(np.abs(ends), axis=0))
            self.here = Iterate(mine, z, size, lengths, self.gain)
        return bool(np.all(np.isfinite(z)))

    def _shift(
        self, neighbour: DiscretePath, tr: Transcription, z: Array
    ) -> tuple[Transcription, Array]:
        """Return where a path goes that is far from a neighbour's as it may be sooner or later."""
        from actionopt.discrete.action.shifted import shift_path

        plain = not (self.problem.boundaries or tr.nodal)
        found = shift_path(neighbour.tr, neighbour.z, tr.coordinates(z)) if plain else None
        self.astray = found is None
        if found is None:
            return tr, z
        tr = Transcription(self.problem, found[0], tr.lengths, like=tr)
        return tr, tr.pack(found[1])

    def restart(self) -> None:
        """Forget what was found out about a path that is given up."""
        self.gain, self.best, self.unbalance = UNKNOWN_GAIN, None, None

    def stop(self) -> None:
        """Return to the path that was polished last, as the time is up, and stop the watch."""
        self.watch = None
        if self.best is not None:
            self.here = self.best
        elif self.iterate is None:
            self.checked = True
            self.ensure_iterate()
        else:
            self.here = self.here.with_values(error=np.inf)
        self.here.tr.watch = None

    def with_boundaries(self, mesh: Mesh) -> Mesh:
        """Return the mesh with boundaries where laws switch, if it is not the user's."""
        instants = self.problem.boundaries
        mesh = with_singular_ends(mesh, self.problem.singular_ends)
        if self.refines:
            mesh = with_degrees(mesh, self.problem.system.order)
        return with_boundaries(mesh, instants) if self.refines and instants else mesh

    def _attach(self, tr: Transcription) -> None:
        """Count what is evaluated from now on."""
        if tr.counts:
            self.record.evaluations.update(tr.counts)
        tr.counts, tr.watch = self.record.evaluations, self.watch

    def _motion_multipliers(self, mesh: Mesh, Q: Array) -> Array | None:
        """Return the multipliers (K, m) of the index-1 equations of motion along Q (K, n)."""
        v = Path(mesh, Q.T).velocity(mesh.nodes)
        parameters = self.problem.parameters
        try:
            lam = self.problem.system.multipliers(Q.T, v, mesh.nodes, parameters=parameters).T
        except np.linalg.LinAlgError:
            return None
        return np.nan_to_num(lam, posinf=0.0, neginf=0.0)

    # -- ways to move ----------------------------------------------------------------------------

    def find(self, principle: Principle) -> bool:
        """Ask Ipopt for a path; False if it finds none, or L contains accelerations."""
        if self.problem.system.order > 1:
            return False
        from actionopt.solver.refinement.ipopt import find

        started = perf_counter()
        with self.record.clock("solve"):
            attempt = find(self.here.tr, self.here.z, principle)
        self.record.iterations["ipopt"] += attempt.iterations
        self.unbounded = attempt.diverged
        if attempt.converged:
            self.here = self.here.moved(attempt.z)
            self.record.round(self.here.tr, perf_counter() - started)
        return attempt.converged

    def root(self) -> bool:
        """Ask Ipopt for a root of the stationarity conditions, unless that takes too long."""
        if self.large:
            return False
        before = self.here
        self.here = before.moved(_without_multipliers(before))
        if self.find("stationary"):
            return True
        self.here = before
        return False

    def descend(self) -> bool:
        """Minimise the action from the path at hand, and on where Newton's method is lost."""
        from actionopt.solver.refinement.descent import descend

        for _ in range(DESCENTS):
            with self.record.clock("solve"):
                result = descend(self.here.tr, self.here.z)
            self.unbounded = result.runaway
            if not result.found:
                self.record.iterations["descent"] += result.iterations
                return False
            if self._polish("descent", (result.z, result.iterations)):
                return True
        return False

    def settle(self) -> bool:
        """Move to the path near a rough one; if that fails, to where the residual is least."""
        from actionopt.discrete.newton.marquardt import settle

        if self.problem.system.order > 1:
            return False
        with self.record.clock("solve"):
            result = settle(self.here.tr, self.here.z)
        self.here = self.here.moved(result.z)
        self.record.iterations["marquardt"] += result.iterations
        return result.near and self.follow()

    def approach(self, steps: int = QUICK_STEPS, *, convex: bool = False) -> bool:
        """Move to a path by damped Newton steps; if `convex`, only from where the action is convex.

        Near a resonance the multipliers of the motion along the first path make the matrix
        nearly singular there; without any it is stiff, and the way may be open.
        """
        equations = self.here.equations
        with self.record.clock("solve"):
            near = approach(equations, self.here.z, steps, convex=convex, many=self.many)
            if near is None and equations.layout.rows:
                near = approach(equations, _without_multipliers(self.here), steps, many=self.many)
        return self._polish("newton", near)

    def go(self, method: str, way: Callable[[Transcription, Array], Reached]) -> bool:
        """Move to a path by a `way`, whose factorizations are counted as those of a `method`."""
        with self.record.clock("solve"):
            z, count = way(self.here.tr, self.here.z)
        self.record.iterations[method] += count
        return self._polish(method, None if z is None else (z, 0))

    def _polish(self, method: str, found: tuple[Array, int] | None) -> bool:
        """Polish what a method reached; where that does not work, keep in mind where it was."""
        if found is None:
            return False
        self.here = self.here.moved(found[0])
        self.record.iterations[method] += found[1]
        if self.follow():
            return True
        self._note_unpolished(self.here)
        return False

    def _note_unpolished(self, path: Iterate) -> None:
        """Keep a path in mind that was near, unless it runs through a singularity."""
        mesh, Q = path.mesh, path.Q
        shown = resolution(mesh, Q, sizes(Q, self.problem.scales)).worst < ROUGHLY
        if shown and mesh.lengths.min() > SHORT_ELEMENT * mesh.duration:
            self.unpolished = path.bare().with_values(error=np.inf)

    def follow(self, reach: float = np.inf, *, kept: bool = False) -> bool:
        """Polish the path where it is; False if it is not there, or farther than `reach`.

        With the factors that are `kept` with it, if they will do.
        """
        started = perf_counter()
        factors = self.here.factors if kept else None
        near = None if factors is None else (factors, self.here.since)
        here = self.here = self.here.bare()  # frees factors before others are made
        # Others are resolved already, unless that costs more than a mesh between.
        first = self.refines and (reach == np.inf or self.many_coordinates) and not self.many
        # What is left of a linear problem after one step is round-off, none of it a lack of steps.
        negligible = (UNKNOWN_GAIN if self.linear else 1.0) * ORDINARY * POLYNOMIAL_ROUNDOFF

        def passable(z: Array) -> float:
            """Return how far a path may be from stationary that goes on to another mesh."""
            left = here.moved(z).resolution.by_rate
            return PASSABLE * left if SAFETY * here.gain * left > self.tol else 0.0

        with self.record.clock("solve"):
            result = follow(
                here.equations,
                here.z,
                linear=self.linear,
                many=self.many,
                target=min(self.tol / (10 * SAFETY), negligible),
                enough=passable if first else None,
                near=near,
            )
        self.record.iterations["newton"] += result.iterations
        self.first_step = result.first_step
        if not (result.converged and (self.linear or result.travelled < reach)):
            return False
        self.here = here.at_result(result)
        self.record.round(here.tr, perf_counter() - started)
        if self.watch is not None:
            self.best = self.here.bare()
        return True

    def answer(self) -> tuple[Problem, DiscretePath]:
        """Return the question, and the path."""
        return self.question, DiscretePath(self.here.tr, self.here.z)

    def quadrature_shift(self) -> float:
        """Return how far the path would move if its forces were summed over other points.

        Or by how much its action changes, if that is more.
        """
        with self.record.clock("verify"):
            found, self.here = self.here.quadrature_shift(self.tol, self.many)
            return max(found, self.here.tr.missed_action(self.here.z))

    def find_imbalance(self) -> Jump | Imbalance | None:
        """Return where the balance of energy does not hold along the path; say so if L jumps."""
        off, structure = None, self.problem.system.structure
        if structure.pushes or not structure.jumpless:
            from actionopt.discrete.between_nodes.crossing import find_imbalance

            here = self.here
            with self.record.clock("verify"):
                off, error = find_imbalance(here, here.error, self.tol, self._impulse_gain)
                if error > here.error:
                    self.here = self.here.with_values(error=error)
        if off is None and self.problem.system.may_turn_corners:
            from actionopt.discrete.between_nodes.energy_balance import find_corners

            off = find_corners(self.here)
        if off is not None or self.unbalance is not None:
            self.hint = str(off or "")
        self.unbalance = off
        return off

    def _impulse_gain(self) -> float:
        found, self.here = self.here.impulse_gain(self.many)
        return found

    def transfer(self, mesh: Mesh, *, least: bool, missed: float = 0.0) -> bool:
        """Take the path to another mesh and polish it there; False if it was lost.

        It may move as far as what was `quadrature_shift` on the last mesh lets expect. What was
        found as a `least` path may be found again by minimising.
        """
        old, mesh = self.here.bare(), self.with_boundaries(mesh)
        self.transcribe(mesh, old.path, old.rows_on(mesh), like=old.path)
        first = self.here.with_values(gain=old.gain, noise=old.noise, error=old.error)
        self.here, reach = first, max(FOLLOWED_REACH, EXPECTED * missed)
        self.recovered = not self.follow(reach=reach)
        if self.recovered:
            if not self._recover(least):
                self._note_unpolished(old)
                return False
            moved = np.max(np.abs(self.here.Q - first.Q) / self.here.lengths)
            if not least and moved > reach:
                return False
        here = self.here
        # In the sizes of the old path, in which its omitted coefficients are.
        change, gain = self._change(first, old), here.gain
        if old.resolution.by_rate > MEASURABLE:
            left = old.resolution.by_rate
            if change > UNLIKELY * left and not self.problem.system.structure.steady_forces:
                with suppress(np.linalg.LinAlgError):  # what was not seen moves the path as well
                    factors = old.with_factors(many=False).factors
                    assert factors is not None
                    residual, carried = unseen(old, self.tol)
                    left += max(old.equations.relative_step(factors.solve(residual)), carried)
            gain = max(change / left, 1.0)
        elif gain == UNKNOWN_GAIN:
            gain = 1.0
        self.here = here.with_error(gain)
        self.record.rounds[-1]["estimate"] = self.here.error
        return True

    def _change(self, first: Iterate, old: Iterate) -> float:
        """Return by how much a path changed on its mesh, to which `first` interpolates the old."""
        return float(np.max(np.abs(self.here.Q - first.Q) / old.sizes))

    def _recover(self, least: bool) -> bool:
        """Find the path again on a mesh where following it did not work."""
        if not least:
            if self.large:  # Ipopt would take seconds
                return self.approach(PATIENT)
            return self.root() and self.follow()
        if self.problem.system.m == 0:
            if self.descend():
                return True
            if self.large:  # Ipopt would take seconds over it, hardly ever to any end
                return False
        return self.find("patient least") and self.follow()


def _without_multipliers(path: DiscretePath) -> Array:
    """Return the unknowns (size,) of a path, its multipliers zero."""
    return np.concatenate([path.x, np.zeros(path.z.size - path.x.size)])


def _chooses(problem: Problem) -> bool:
    """Whether constraints may give what an event leaves open, as they do of a mechanism."""
    system = problem.system
    left = [system.n - len(e.pinned) for e in (problem.start, problem.end)]
    plain = not (problem.closes or problem.through or problem.on_surface) and system.order == 1
    return plain and any(0 < count <= system.m for count in left)


def alike(lengths: Array, tr: Transcription) -> bool:
    """Whether units of a transcription serve for coordinates of these lengths as well."""
    ratio = lengths / tr.lengths
    return bool(ratio.max() < UNITS_RATIO and ratio.min() > 1 / UNITS_RATIO)
