"""From a question whose duration is to be found, or whose paths close anywhere, to a solution.

Newton's method on a first path (`first_paths`) and what is beside it (`bordered`) takes it to the
energy, or closes it, on a coarse mesh; from there it is followed from mesh to mesh, as between
given times (`refine`).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import islice
from time import perf_counter

import numpy as np

from actionopt.analysis.solution import Solution
from actionopt.analysis.status import Status
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.borders.bordered import Bordered
from actionopt.discrete.borders.borders import Move, moves_of, over, times_of
from actionopt.discrete.matrices.factors import full
from actionopt.discrete.meshes.boundaries import with_boundaries
from actionopt.discrete.meshes.element import with_degrees
from actionopt.discrete.meshes.mesh import Mesh, with_singular_ends
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.discrete.newton.newton import is_roundoff
from actionopt.mechanics.question.problem import Problem
from actionopt.solver.ends.closed import begin_later, passage_times
from actionopt.solver.ends.durations import explain_barrier
from actionopt.solver.input.arguments import Guess
from actionopt.solver.input.preflight import check
from actionopt.solver.kinds.between import Choices, Found, between
from actionopt.solver.kinds.first_paths import (
    REPRESENTED,
    FirstPaths,
    guess_path,
    straight,
    stretch_guess,
)
from actionopt.solver.kinds.nearest_points import between_places
from actionopt.solver.kinds.single_shooting import arrivals, can_depart
from actionopt.solver.refinement import family
from actionopt.solver.refinement.family import is_alone, may_be_family, soft_directions
from actionopt.solver.refinement.first_mesh import COARSE_DEGREE, LINEAR, straight_line
from actionopt.solver.refinement.iterate import (
    ROUNDED,
    SAFETY,
    UNKNOWN_GAIN,
    Iterate,
    UnfixedPath,
    coordinate_scales,
    is_at_rest,
)
from actionopt.solver.refinement.refine import refine, settle_on
from actionopt.solver.refinement.signals import SIGNALS, status_of
from actionopt.solver.refinement.verdict import message_of, solution_of
from actionopt.solver.refinement.workspace import FOLLOWED_REACH, PATIENT, Workspace, alike
from actionopt.solver.search.strategies import GUESS_ONLY, IPOPT
from actionopt.tools.types import EPS, Array
from actionopt.tools.watch import OutOfTime, limit

STOPS = "an end free in place and time is where a motion of the energy comes to rest"
# Ad hoc.
# Along a family on a coarse mesh, singular values of Newton's matrix, of which others are of order
# one, and the step to it from where on a path is held along it.
SINGULAR = 1e-3
# A step to a family, in its sizes, after which the singular values of all its directions are below
# that. Measured on families of 2 to 5 dimensions: flat from 1e-4 to 1e-5, at 3e-4 some are missed.
ON_FAMILY = 3e-5
UNREACHED = 1e6  # damping of steps to a family, in squares of the residual, that leads nowhere
ROUGH = 1e-2  # what the first mesh of a family leaves out of a guess, and how far it tells a place
FULL = 300  # unknowns of a path whose matrix is looked at as a whole in a family
NEAR_FAMILY = 0.5  # of its size, how far a closed path is from a guess of it; ad hoc
# Force on a closed path: measured, 1e-14 on motions, 1e-5 at most on first meshes of them, and 1 or
# more on spurious paths, such as one that has shrunk to a rest, whose refinement would not end.
PUSHED, HELD_FORCE = 1e-8, 1.0


@dataclass(eq=False)
class Unfixed(Workspace[UnfixedPath]):
    """The workspace of a search for a path whose duration is free, or that closes anywhere."""

    found_by: str = "none"  # the way that led to the path at hand
    # Directions of the family of closed paths that it is held along, all of them.
    along: tuple[Path, ...] = ()
    # (k + 2,): those of the events of a course where its first path passes them.
    times: Array | None = None
    # How far from zero a first path goes that closes and moves, and may shrink to a rest.
    size: float = 0.0
    _moves: tuple[Move, ...] | None = None

    @property
    def moves(self) -> tuple[Move, ...]:
        """Motions of configuration space that a closed path may be subjected to.

        Raises OutOfTime, the first time, if they are not found in what is left.
        """
        if self._moves is None:
            self._moves = ()
            with limit(self.watch):
                self._moves = moves_of(self.problem)
        return self._moves

    # -- what is other than between given events --------------------------------------------------

    def _at(self, mesh: Mesh, path: Path | None, lam: Array | None, like: Path | None) -> Iterate:
        """Return the iterate on `mesh`, starting from `path` there."""
        assert path is not None
        return self._around(path.on(mesh), lam)

    def _around(self, path: Path, lam: Array | None, problem: Problem | None = None) -> UnfixedPath:
        """Return a path on its own mesh, with the equations whose phases are set near it."""
        problem = problem or self.problem
        at = self._at_times(problem, path)
        mesh = with_degrees(path.mesh, problem.system.order)
        mesh = with_singular_ends(mesh, problem.singular_ends)
        path = path.on(with_boundaries(mesh, at.boundaries))
        with self.record.clock("assemble"):
            size, lengths = coordinate_scales(at, path.values.T)
            like = self.units if self.units is not None and alike(lengths, self.units) else None
            along = [stretch_guess(problem, d).on(path.mesh).values for d in self.along]
            known = self.moves, along, like, self._times, self._kappa
            bordered, y = Bordered.around(problem, path, lam, lengths, *known)
            tr = self.units = bordered.first
            self._attach(tr)
            if not self.checked:
                check(tr, path.values.T, borrowed=like is not None)
                self.checked = True
        return UnfixedPath(tr, y, size, lengths, self.gain, bordered=bordered)

    def renew_units(self) -> None:
        """Transcribe once more a path whose coordinates have become far smaller than their units.

        What Newton's method brings to zero has for its unit what was left of it on the last mesh.
        """
        found = self.here
        lengths = coordinate_scales(self._at_times(self.problem, found.path), found.Q)[1]
        if not alike(lengths, found.tr) and not self.transfer(found.mesh, least=False):
            self.here = found

    @property
    def _times(self) -> Array | None:
        """The times of a course's events, those of the path at hand if there is one."""
        if self.times is None or self.iterate is None:
            return self.times
        return times_of(self.iterate.problem)

    @property
    def _kappa(self) -> Array | None:
        """The multipliers of integrals that the path at hand has, if there are such."""
        if self.problem.integral is None or self.iterate is None:
            return None
        return self.iterate.problem.kappa

    def _at_times(self, problem: Problem, path: Path) -> Problem:
        """Return the problem with the times of a path."""
        times = self._times
        if times is None:
            return over(problem, path.mesh.duration)
        return problem.found_at(times, kappa=self._kappa)

    def ensure_iterate(self) -> None:
        """Transcribe along the straight line where there is no path at hand: for a verdict."""
        if self.iterate is None:
            problem = over(self.problem, 1.0)
            mesh = Mesh.uniform(problem.start.t, problem.end.t, LINEAR, COARSE_DEGREE)
            self.transcribe(mesh, straight_line(problem, mesh))

    def with_boundaries(self, mesh: Mesh) -> Mesh:
        """Return the mesh with boundaries where laws switch over its times."""
        mesh = with_degrees(mesh, self.problem.system.order)
        mesh = with_singular_ends(mesh, self.problem.singular_ends)
        if self.times is not None:
            return with_boundaries(mesh, self.here.problem.boundaries)
        if self.problem.system.clock is self.problem.system.pulses is None:
            return mesh
        return with_boundaries(mesh, over(self.problem.loose, mesh.duration).boundaries)

    def follow(self, reach: float = np.inf) -> bool:
        """Polish the path; keep one whose residual is round-off, which may be one of a family."""
        first = self.here
        if super().follow(reach):
            if SAFETY * self.here.noise > self.tol:  # the last step may have been more than that
                super().follow()
            return True
        with np.errstate(all="ignore"):
            stays = is_roundoff(first.bordered, first.z, first.bordered.residual(first.z))
        if stays:
            self.here = replace(first, noise=np.inf, error=np.inf)
        return stays

    def transfer(self, mesh: Mesh, *, least: bool, missed: float = 0.0) -> bool:
        """Take the path to another mesh; False if it was lost, is one of a family, or is pushed."""
        old = self.here
        if not np.isfinite(old.noise):
            return False
        if not super().transfer(mesh, least=least, missed=missed):
            self.here = old
            return False
        return self.here.push_force <= HELD_FORCE and bool(np.isfinite(self.here.noise))

    def _change(self, first: Iterate, old: Iterate) -> float:
        """Return by how much a path changed, and its duration."""
        durations = [np.diff(times_of(at.problem)) for at in (self.here, old)]
        longer = float(np.abs(durations[0] / durations[1] - 1).max())
        return super()._change(first, old) + self.here.bordered.reach * longer

    def _recover(self, least: bool) -> bool:
        """Find the path again, by damped steps; another mesh may be enough to lose it."""
        return self.approach(PATIENT)

    def answer(self) -> tuple[Problem, DiscretePath]:
        """Return the question with the times and ends that were found, and the path."""
        here = self.here
        # A path whose error is as large as itself has run away: its places are on no surface.
        Q = here.Q[here.tr.joints] if here.error < 1 else None
        problem = self.problem.found_at(times_of(here.problem), Q, self._kappa)
        tr = Transcription(problem, here.mesh, here.tr.lengths, like=here.tr)
        z = tr.pack(here.Q, here.rows if tr.layout.rows else None)
        # In higher orders derivatives are not read from values.
        z[: tr.layout.unknowns] = tr.pack_places(here.tr.place(here.x).places)
        return problem, DiscretePath(tr, z)

    # -- from a first path to one ---------------------------------------------------------------

    def reach(self, path: Path, lam: Array | None, *, damped: bool) -> bool:
        """Move to the path of the given energy, or a closed one, near a rough one."""
        self.hint = ""
        self.size = 0.0
        if self.problem.closes and self.problem.integral is None:  # else a rest leads to a motion
            if is_at_rest(path.values.T):
                return self.reach_family(path) and (self._is_begun() or self._begin(ROUGH))
            self.size = float(np.abs(path.values).max())
        if self.problem.phase_coordinates and self._begin_near(path):
            return True
        problem = self.problem.loose
        self.here = self._around(path, None if lam is None else np.nan_to_num(lam), problem)
        # Newton does not contract on a family of closed paths: the iterate must show that, and not
        # go to some other member, such as rest.
        closes = self.problem.closes
        near = NEAR_FAMILY if closes else np.inf
        if not (self.follow(near) or (damped and self.approach(PATIENT))):
            return False
        here = self.here
        passed = self.with_boundaries(here.mesh) is not here.mesh  # by an event: a pulse
        if passed and not self._follow_again(here.path, here.rows):
            return False
        if self._shrank():
            return False
        return problem is self.problem or self._begin(ROUGH)

    def _begin_near(self, path: Path) -> bool:
        """Move to the closed path near a rough one that begins at the given coordinates."""
        begun = self._shift_to_start(path)
        if begun is None:
            return False
        self.here = self._around(begun, None)
        return self.follow()

    def _shift_to_start(self, path: Path) -> Path | None:
        """Return a closed path begun where it nearly passes what the start gives, or None."""
        begins = [s for s, off in self._passes(path) if off <= FOLLOWED_REACH]
        return begin_later(path, min(begins, key=abs), self.problem) if begins else None

    def _passes(self, path: Path) -> list[tuple[float, float]]:
        """Return when a closed path passes what the start gives, and how far off in its sizes."""
        problem, pinned = self.problem, list(self.problem.start.pinned)
        wanted = np.array([problem.start.q[i] for i in pinned], dtype=float)
        lengths = coordinate_scales(over(problem, path.mesh.duration), path.values.T)[1]
        return passage_times(path, problem, pinned, wanted, lengths[pinned])

    def _begin(self, near: float) -> bool:
        """Begin a closed path where it passes the coordinates that the start gives, or so near."""
        here = self.here
        passed = self._passes(here.path)
        begins = [s for s, off in passed if off <= near]
        if not begins:
            self.hint = (
                "the closed path near the guess does not pass what the start gives: it comes as "
                f"near as {min(off for _, off in passed):.2g} of the size of the coordinate; leave "
                "it free, or give fewer coordinates there"
            )
            return False
        shift = min(begins, key=abs)
        if not self._follow_again(begin_later(here.path, shift, self.problem), None):
            self.hint = "no closed path near the guess begins at what the start gives"
            return False
        return True

    def _is_begun(self) -> bool:
        """Whether a closed path begins at what the start gives."""
        here, pinned = self.here, list(self.problem.phase_coordinates)
        if not pinned:
            return True
        wanted = np.array([self.problem.start.q[i] for i in pinned], dtype=float)
        off = np.abs(here.Q[0, pinned] - wanted) / here.tr.lengths[pinned]
        return bool(off.max() <= ROUNDED)

    def _follow_again(self, path: Path, lam: Array | None) -> bool:
        """Follow the path at hand, begun elsewhere or its phase set anew; False if it is lost."""
        gain = self.here.gain
        self.here = replace(self._around(path, lam), gain=gain)
        return self.follow()

    def in_family(self, guess: Guess | DiscretePath, *, thorough: bool) -> Status | None:
        """Move to a path near the guess if such paths are a family, and refine it there.

        By Newton's steps of least norm, as its matrix has no inverse at any of them. Then the
        directions in which it may be moved are known: bordered by them, the matrix has one.
        It is also tried on larger meshes if that is to be `thorough`.
        """
        before = self.iterate, self.hint
        near = guess
        for represented in (ROUGH, REPRESENTED[0]):
            self.along, self.gain = (), UNKNOWN_GAIN
            path = guess_path(self.problem, near, represented)
            if self.problem.phase_coordinates:
                begun = self._shift_to_start(path)
                if begun is None:
                    break
                path = begun
            most = (2 * FULL if thorough else FULL) // self.problem.system.n
            if path.mesh.offsets[-1] > most:  # what it resolves may be the corners of a guess
                ends = path.mesh.boundaries[[0, -1]].tolist()
                path = path.on(Mesh.uniform(*ends, most // COARSE_DEGREE, COARSE_DEGREE))
            first = self._around(path, None)
            if not self._approach_family(first):
                continue
            near = self.here.path  # on a rough mesh directions of the family may be missed
            status = self.judge(self.settle())
            if status.stationary:
                self.found_by = "guess"
                return status
        self.along = ()
        self.iterate, self.hint = before
        return None

    def keep_member(self, guess: Guess | DiscretePath) -> Status | None:
        """Hold a guess that is a closed path already along its family, and refine it there.

        Newton's steps would lead along the family, by the round-off of what is singular there.
        """
        if self.problem.phase_coordinates or is_alone(self.problem):
            return None
        most = 2 * FULL // self.problem.system.n
        path = guess_path(self.problem, guess, min(REPRESENTED[1], self.tol), most)
        if path.mesh.offsets[-1] > most:
            return None
        before, first = (self.iterate, self.hint), self._around(path, None)
        with np.errstate(all="ignore"):
            closes = np.abs(first.bordered.residual(first.z)).max() < REPRESENTED[0]
        if closes:
            with suppress(np.linalg.LinAlgError):
                if self._approach_family(first, steps=1):
                    status = self.judge(self.settle())
                    if status.stationary:
                        return status
        self.along = ()
        self.iterate, self.hint = before
        return None

    def reach_family(self, path: Path) -> bool:
        """Move to a path near a rough one that is one of a family, and hold it along that."""
        self.here = first = self._around(path, None)
        try:
            return self._approach_family(first)
        except np.linalg.LinAlgError:
            return False

    def _approach_family(self, here: UnfixedPath, steps: int | None = None) -> bool:
        """Move to a path by steps of least norm, and keep the directions of its family there.

        By Levenberg and Marquardt's method, damped by the square of the residual: it comes to a
        family as fast as Newton's to a single path (N. Yamashita and M. Fukushima, *Computing
        Suppl.* 15 (2001), p. 239).
        """
        first, bordered, y, damping = here, here.bordered, here.z, 1.0
        rests = not first.moves  # where motions about it are soft, and none of a family
        near, singular = (ROUNDED, EPS**0.5) if rests else (ON_FAMILY, SINGULAR)
        count, beside = bordered.forces.start, bordered.phases  # no phase is needed, nor a force
        residual = bordered.residual(y)[:count]
        with np.errstate(all="ignore"):
            for _ in range(steps or (PATIENT if y.size <= FULL else PATIENT // 4)):
                matrix = full(bordered.layout, bordered.kkt(y))[:count, :count]
                size = np.linalg.norm(residual)
                if not (np.isfinite(matrix).all() and np.isfinite(size)):
                    return False
                left, values, right = np.linalg.svd(matrix)
                right = np.pad(right, ((0, 0), (0, beside)))
                across, rank = left.T @ residual, int((values > singular).sum())
                step = right[:rank].T @ (across[:rank] / values[:rank])
                known = beside if steps else 0  # directions in which any closed path may be moved
                found = rank < count - known or rests
                if found and bordered.relative_step(step) < near:
                    self.here = here = here.moved(y - step)
                    moved = [here.tr.coordinates(here.z + d) - here.Q for d in right[rank:]]
                    self.along = tuple(Path(here.mesh, d.T) for d in moved)
                    path = here.path
                    if rests and np.abs(path.values).max() < ROUNDED * first.lengths.max():
                        path = Path(path.mesh, np.zeros_like(path.values))
                    self.here = self._around(path, here.rows)
                    return (rests or here.moves) and (self.follow() or self.approach(PATIENT))
                while damping < UNREACHED:
                    step = right.T @ (values * across / (values**2 + damping * size**2))
                    there = bordered.residual(y - step)[:count]
                    if np.linalg.norm(there) < size:
                        break
                    damping *= 10.0
                else:
                    return False
                y, residual, damping = y - step, there, damping / 10.0
        return False

    def _hold_along(self) -> bool:
        """Hold a closed path along the directions of its family, if it seems to be a member of one.

        On a mesh of its own, as that of a guess may be of many short elements. What is held so has
        a regular matrix; whether the directions are those of a family is counted at the end.
        """
        if self.along or not self.problem.closes or not may_be_family(self, Status.SOLVED):
            return False
        before = self.here
        with suppress(np.linalg.LinAlgError):
            found = soft_directions(before, before.bordered)
            moved = [before.tr.coordinates(before.x + d) - before.Q for d in found]
            self.along = tuple(Path(before.mesh, d.T) for d in moved)
            path = guess_path(self.problem, before.path, REPRESENTED[0])
            self.here = self._around(
                path if path.mesh.elements < before.mesh.elements else before.path, None
            )
            if self.along and self.follow():
                return True
        self.along, self.here = (), before
        return False

    # -- to the tolerance -----------------------------------------------------------------------

    def settle(self) -> Status:
        """Refine, and begin a closed path where its start says: its mesh moves with it."""
        status = self._refine()
        if not status.success or self._is_begun():
            return status
        near = max(self.tol, ROUNDED)
        return self._refine() if self._begin(near) else Status.NOT_FOUND

    def verdict(self) -> Status:
        """Return the verdict on the path at hand, refined: held along a family if it is of one."""
        first, held = self.here, self._hold_along()
        status = self.judge(self.settle())
        if held and not status.stationary:
            self.along, self.here = (), first
            return self.judge(self.settle())
        last = self.here
        if not held and self._hold_along():
            again = self.judge(self.settle())
            if again.stationary:
                return again
            self.along, self.here = (), last
        return status

    def _refine(self) -> Status:
        """Refine; a closed path that is pushed also with its phase set about where it is now."""
        while self.here.push_force > HELD_FORCE:
            if not self._lessen_push():
                return self._hold()
        status = refine(self, self.tol, least=False)
        while status.success and self._is_pushed(self.here) and self._lessen_push():
            status = refine(self, self.tol, least=False)
        return status

    def _lessen_push(self) -> bool:
        """Set the phase of a pushed path about where it is; False if that does not help.

        For a rough path round a centre, a shift of time and a turn are two directions; where it is
        held by both, it cannot become the circle on which they are one.
        """
        here = self.here
        again = not self.along and self._follow_again(here.path, here.rows)
        if again and self.here.moves and self.here.push_force < here.push_force / 2:
            return True
        self.here = here
        return False

    def judge(self, status: Status) -> Status:
        """Return the verdict on the path at hand: a closed path needs no force along itself."""
        found = status.stationary
        if self.here.push_force > HELD_FORCE or (found and self._is_pushed(self.here)):
            return self._hold()
        if found and self._shrank():
            self.here = replace(self.here, error=np.inf)
            return Status.NOT_FOUND
        return status

    def _shrank(self) -> bool:
        """Whether a closed path that moved at first is a rest; say so."""
        shrank = bool(self.size) and is_at_rest(self.here.Q, self.size)
        if shrank:
            self.hint = (
                "the closed path near the guess shrank to a rest; a guess at rest leads to one"
            )
        return shrank

    def _is_pushed(self, here: UnfixedPath) -> bool:
        """Whether a force holds the path closed, beyond what a coarse mesh of a family needs."""
        return here.push_force > max(self.tol, 0.0 if self.along else here.error, PUSHED)

    def _hold(self) -> Status:
        self.hint = "near the guess a path closes only if it is pushed along itself"
        self.here = replace(self.here, error=np.inf)
        return Status.NOT_FOUND


def _by_ipopt(problem: Problem, path: Path, choices: Choices) -> Path:
    """Return the path that Ipopt finds from this one, over its duration and between its ends."""
    there = over(problem.loose, path.mesh.duration)
    given = between_places(there, path.values.T[[0, -1]])
    return between(given, path, replace(choices, mesh=None), verdict=False)[0].path


def solve_free_boundary(
    problem: Problem, guess: Guess | DiscretePath | None, choices: Choices, *, keep: bool = False
) -> Found:
    """Return the path of a problem whose duration is free or whose paths close, and the verdict.

    Unless what is near the guess is all that is asked for, also on a mesh that represents the guess
    better, and by damped steps. Where the guess may be an answer already it is asked to `keep` it.
    """
    started, watch = perf_counter(), choices.watch
    run = Unfixed(problem, tol=choices.tol, watch=watch)
    if isinstance(guess, Solution) and guess.success:
        run.gain = guess.stats.get("gain", run.gain)  # a neighbour is as sensitive
    elif isinstance(guess, DiscretePath):
        run.units = guess.tr
    search = _FreeBoundarySearch(run, FirstPaths(problem, choices.tol, watch), guess, choices)
    try:
        status = search.seek(keep)
    except SIGNALS as signal:
        status = status_of(signal)
        run.stop()
    if watch is not None and watch.error is not None and not isinstance(watch.error, OutOfTime):
        raise watch.error
    solution = search.conclude(status, started)
    hint = search.hint(solution)
    if choices.principle == "least" and solution.status.success and solution.morse_index > 0:
        solution = replace(solution, status=Status.NOT_LEAST)
    message = "" if solution.success else message_of(solution, choices.tol, hint, search.barrier)
    return solution, message


@dataclass(eq=False)
class _FreeBoundarySearch:
    """A search for a path that closes, or whose duration is to be found."""

    run: Unfixed
    first: FirstPaths
    guess: Guess | DiscretePath | None
    choices: Choices
    # Why no motion of the energy leads to the end, if that is known.
    barrier: str = field(init=False)
    # Whether a path was found whose error is known, or one that its energy shows to be no path.
    known: bool = False

    def __post_init__(self) -> None:
        self.barrier = explain_barrier(self.run.problem)

    @property
    def thorough(self) -> bool:
        """Whether more is asked for than what is near the guess."""
        return self.choices.strategies is not GUESS_ONLY

    def tries(self) -> Iterator[tuple[Path, Array | None, str, bool]]:
        """Yield first paths, their multipliers, how each was found, and whether to damp steps."""
        if self.barrier:
            return
        problem, first, firsts = self.run.problem, self.first, []
        for path, lam, how in islice(first.firsts(self.guess), None if self.thorough else 1):
            firsts.append((path, lam, how))
            yield path, lam, how, False
        if self.known or first.barred:
            return
        yield from ((*each, True) for each in firsts)
        if self.known:
            return
        # With one coordinate every motion takes the straight line.
        shut = bool(first.blocked) and problem.system.n == 1
        if self.guess is not None or problem.on_surface or first.merged is not None or shut:
            return
        way = np.abs(np.diff(straight(problem)[[0, -1]], axis=0)[0])
        size, near = np.maximum(over(problem, 1.0).scales, way), not can_depart(problem)
        for path in arrivals(problem, [problem], size, self.choices.watch):
            near = True
            yield path, None, "motion", False
        if near:  # where no motion of the energy comes near the end, hardly any arrives
            for at in first.longer_sought():
                yield at.path, at.rows, "duration", False
                yield at.path, at.rows, "duration", True

    def seek(self, keep: bool) -> Status:
        """Move the path at hand to an answer, on the mesh asked for; return the verdict."""
        run, guess, choices = self.run, self.guess, self.choices
        status, judged, kept, asked = Status.NOT_FOUND, None, None, False
        if keep and self.thorough and guess is not None and choices.strategies is not IPOPT:
            kept = run.keep_member(guess)
        if kept is not None:
            status, run.found_by = kept, "guess"
        for path, lam, how, damped in self.tries() if kept is None else ():
            # Newton's steps do not contract on a family: those of given energy are many.
            if damped and not asked and run.problem.closes and run.problem.free_time:
                asked = True
                found = self._in_family(status)
                if found is not None:
                    status, judged = found, None
                    break
            if choices.strategies is IPOPT:
                path, lam, how = _by_ipopt(run.problem, path, choices), None, "ipopt"
            if run.units is None and self.first.solved is not None:
                run.units, run.checked = self.first.solved.tr, True
            if not run.reach(path, lam, damped=damped):
                continue
            run.found_by = how
            status = run.verdict()
            judged = run.iterate, run.hint
            self.known = bool(np.isfinite(run.here.error)) or run.unbalance is not None
            if status.stationary or status is Status.JUMP:
                break
        if judged is not None:  # what was tried since has no verdict
            run.iterate, run.hint = judged
        status = (None if asked else self._in_family(status)) or status
        return settle_on(run, status, choices.mesh, least=False)

    def _in_family(self, status: Status) -> Status | None:
        """Move to a path near the guess, or a family's, where there is one; None if it is not."""
        run = self.run
        near = self.guess if run.problem.closes else self.first.of_family
        if near is None or is_alone(run.problem) or status.success or status is Status.JUMP:
            return None
        return run.in_family(near, thorough=self.thorough)

    def conclude(self, status: Status, started: float) -> Solution:
        """Return the solution of the path at hand, or of one to which two paths merge.

        Raises ValueError for a question that was refused, if no path was begun.
        """
        run, first = self.run, self.first
        if run.iterate is None:
            if first.refused is not None:
                raise first.refused
            run.checked = True
            run.ensure_iterate()
        merged = status in (Status.NOT_FOUND, Status.UNRESOLVED) and first.merged is not None
        if first.merged is not None and merged:
            run.here, status = run._around(first.merged.path, first.merged.rows), Status.DEGENERATE
        if status.success:
            run.renew_units()
        here = run.here
        here.tr.watch = here.bordered.first.watch = None  # a verdict is not left half done
        solution = solution_of(run, status, run.found_by, started)
        if run.problem.on_surface and status.success:
            solution.stats["index"] = here.index
        if not merged and (run.along or may_be_family(run, status)):
            solution = family.judge_family(run, solution)
        return solution

    def hint(self, solution: Solution) -> str:
        """Return what to add to the verdict."""
        problem, hint = self.run.problem, self.run.hint or self.first.hint
        events = () if problem.closes else (problem.start, problem.end)
        anywhere = any(e.t is None and e.on is None and not e.pinned for e in events)
        if anywhere and not solution.status.success:
            return f"{STOPS}; {hint}" if hint else STOPS
        return hint
