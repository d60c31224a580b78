"""From a question whose duration is to be found, or whose paths close anywhere, to a solution.

Newton's method on a first path (`first_paths`) and what is beside it (`bordered`) takes it to the
energy, or closes it, on a coarse mesh; from there it is followed from mesh to mesh, as between
given times.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any, Literal, NamedTuple

import numpy as np

from actionopt.analysis.solution import Solution
from actionopt.analysis.status import Status
from actionopt.discrete.bordered import FULL, Bordered, moves_of, over
from actionopt.discrete.discrete_path import DiscretePath
from actionopt.discrete.factors import Factors
from actionopt.discrete.mesh import Mesh
from actionopt.discrete.newton import approach, follow, is_roundoff
from actionopt.discrete.path import Path
from actionopt.discrete.resolution import refined, resolution
from actionopt.discrete.transcription import Transcription
from actionopt.mechanics.problem import Problem
from actionopt.solver.arguments import Guess
from actionopt.solver.closed import passes, rolled
from actionopt.solver.first_paths import (
    FIRST_ELEMENTS,
    REPRESENTED,
    FirstPaths,
    guessed,
    line,
    stretched,
)
from actionopt.solver.iterate import (
    SAFETY,
    UNKNOWN_GAIN,
    amplified,
    estimate,
    hidden,
    measured,
)
from actionopt.solver.ladder import COARSE_DEGREE
from actionopt.solver.record import Record
from actionopt.solver.refine import ILL_CONDITIONED, MAX_UNKNOWNS, ROUNDS, STALLED, UNDETERMINED
from actionopt.solver.workspace import MEASURABLE, PASSABLE, alike
from actionopt.tools.types import Array
from actionopt.tools.watch import OutOfTime, Watch

STOPS = "an end free in place and time is where a motion of the energy comes to rest"
# Ad hoc.
APPROACHES = 40  # damped steps of Newton's method
ON_START = 1e-9  # of a coordinate's size, how far from that it may begin: the tolerance if larger
# Singular values of Newton's matrix, of the largest, at a family; the step that ends there; and how
# far a path moves that is no rest, of its size.
SINGULAR, SETTLED, MOVING = 1e-7, 1e-7, 1e-6
ROUGH = 1e-2  # what the first mesh of a family leaves out of a guess
NEAR_START, NEAR_GUESS = 1e-2, 0.1  # as far as a first mesh tells, or a guess
# Force on a closed path: measured, 1e-14 on motions, 1e-5 at most on first meshes of them, and 1 or
# more on what is none, such as a path that has shrunk to a rest, whose refinement would not end.
PUSHED, HELD = 1e-8, 1.0


class Reached(NamedTuple):
    """A path and what is beside it."""

    bordered: Bordered
    y: Array

    @property
    def at(self) -> DiscretePath:
        """The path."""
        return self.bordered.discrete(self.y)

    @property
    def pushed(self) -> float:
        """The forces that hold a closed path, in its units and sizes: none hold a motion."""
        forces = self.y[self.y.size - self.bordered.borders.c.size :]
        q = self.y[: self.bordered.first.layout.unknowns]
        largest = np.abs(forces).max(initial=0.0)
        return float(largest / np.abs(q).max()) if largest else 0.0


@dataclass
class Unfixed:
    """A search under way.

    Attributes
    ----------
    problem : Problem
    tol : float
    watch : Watch or None
    record : Record
    hint : str
        What to add to the verdict.
    here : Reached or None
        The path at hand, whether it is one or not.
    """

    problem: Problem
    tol: float
    watch: Watch | None = None
    record: Record = field(default_factory=Record)
    hint: str = ""
    here: Reached | None = None
    gain: float = UNKNOWN_GAIN
    noise: float = 0.0
    error: float = np.inf
    found_by: str = "none"
    along: tuple[Path, ...] = ()  # directions of a family that no symmetry tells
    _reached: bool = False
    # Over a first duration, for sizes; and on its last mesh, for units.
    _known: dict[Problem, Problem] = field(default_factory=dict)
    _units: dict[Problem, Transcription] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.moves = moves_of(self.problem)

    # -- from a first path to one ---------------------------------------------------------------

    def reach(self, path: Path, lam: Array | None, *, damped: bool) -> bool:
        """Go to the path of the energy, or one that closes, near a rough one."""
        self.hint = ""
        if self.problem.closes and self.problem.start.pinned and self._begun_near(path):
            return True
        problem = self.problem.loose
        self.here = self._around(path, None if lam is None else np.nan_to_num(lam), problem)
        # Of closed paths that are a family the steps do not contract, which is to be seen.
        if not (self._follow(passing=True) or (damped and self._approach())):
            return False
        return problem is self.problem or not self.problem.start.pinned or self._begun(NEAR_START)

    def _approach(self) -> bool:
        """Go to the path by damped steps."""
        assert self.here is not None
        bordered, y = self.here
        with self.record.clock("solve"):
            found = approach(bordered, y, APPROACHES)  # type: ignore[arg-type]
        if found is None:
            return False
        self.record.iterations["newton"] += found[1]
        self.here = Reached(bordered, found[0])
        return self._follow()

    def _begun_near(self, path: Path) -> bool:
        """Go to the closed path near a rough one that begins where that passes what is given."""
        begins = [s for s, off in self._passes(path) if off <= NEAR_GUESS]
        if not begins:
            return False
        shift = min(begins, key=abs)
        self.here = self._around(rolled(path, shift, self.problem) if shift else path, None)
        return self._follow(passing=True)

    def _passes(self, path: Path) -> list[tuple[float, float]]:
        """Return when a closed path passes what the start gives, and how far off in its sizes."""
        problem, pinned = self.problem, list(self.problem.start.pinned)
        wanted = np.array([problem.start.q[i] for i in pinned], dtype=float)
        lengths = measured(self._over(problem, path), path.values.T)[1]
        return passes(path, problem, pinned, wanted, lengths[pinned])

    def _over(self, problem: Problem, path: Path) -> Problem:
        """Return the problem over a duration, that of the first path that was asked about."""
        if problem not in self._known:
            self._known[problem] = over(problem, path.mesh.duration)
        return self._known[problem]

    def _begun(self, near: float) -> bool:
        """Begin a closed path where it passes the coordinates that the start gives, or so near."""
        assert self.here is not None
        at = self.here.at
        passed = self._passes(at.path)
        begins = [s for s, off in passed if off <= near]
        if not begins:
            self.hint = (
                "the closed path near the guess does not pass what the start gives: it comes as "
                f"near as {min(off for _, off in passed):.2g} of the size of the coordinate; leave "
                "it free, or give fewer coordinates there"
            )
            return False
        shift = min(begins, key=abs)
        self.here = self._around(rolled(at.path, shift, self.problem), None)
        if not self._follow():
            self.hint = "no closed path near the guess begins at what the start gives"
            return False
        return True

    def _is_begun(self) -> bool:
        """Whether a closed path begins at what the start gives."""
        assert self.here is not None
        at, pinned = self.here.at, list(self.problem.start.pinned)
        if not self.problem.closes or not pinned:
            return True
        wanted = np.array([self.problem.start.q[i] for i in pinned], dtype=float)
        off = np.abs(at.Q[0, pinned] - wanted) / at.tr.lengths[pinned]
        return bool(off.max() <= ON_START)

    def _around(self, path: Path, lam: Array | None, problem: Problem | None = None) -> Reached:
        problem = problem or self.problem
        with self.record.clock("assemble"):
            lengths = measured(self._over(problem, path), path.values.T)[1]
            like = self._units.get(problem)
            like = like if like is not None and alike(lengths, like) else None
            along = [stretched(problem, d).on(path.mesh).values for d in self.along]
            bordered, y = Bordered.around(problem, path, lam, lengths, self.moves, along, like)
            self._units[problem] = bordered.first
        bordered.first.counts, bordered.first.watch = self.record.evaluations, self.watch
        return Reached(bordered, y)

    def _follow(self, *, passing: bool = False) -> bool:
        """Polish the path where it is; False if it is not there.

        If `passing`, roughly where it goes on to another mesh.
        """
        assert self.here is not None
        target = min(self.tol / (10 * SAFETY), 1e-13)
        bordered, y = self.here

        def passable(y: Array) -> float:
            """Return how far a path may be from stationary that goes on to another mesh."""
            at = bordered.discrete(y)
            shown = resolution(at.mesh, at.Q, measured(bordered.first.problem, at.Q)[0])
            goes_on = SAFETY * self.gain * shown.expected > self.tol
            return PASSABLE * shown.worst if goes_on else 0.0

        with self.record.clock("solve"):
            enough = passable if passing else None
            result = follow(bordered, y, target=target, enough=enough, steps=20)  # type: ignore[arg-type]
        self.record.iterations["newton"] += result.iterations
        self._reached = result.converged
        if not result.converged:  # where it was may be one of a family of paths
            with np.errstate(all="ignore"):
                stays = is_roundoff(bordered, y, bordered.residual(y))  # type: ignore[arg-type]
            self.noise = np.inf if stays else self.noise
            return stays
        self.here, self.noise, self.factors = (
            Reached(bordered, result.z),
            result.noise,
            result.factors,
        )
        return True

    def in_family(self, guess: Guess, *, thorough: bool) -> bool:
        """Go to a closed path near the guess if such paths are a family, and refine it there.

        By Newton's steps of least norm, as its matrix has no inverse at any of them. Then the
        directions in which it may be moved are known: bordered by them, the matrix has one.
        With `thorough` also on larger meshes.
        """
        if not self.problem.closes:
            return False
        before = self.here, self.hint, self.gain, self.noise, self.error
        for represented in (ROUGH, REPRESENTED[0]):
            self.along, self.gain = (), UNKNOWN_GAIN
            path = guessed(self.problem, guess, represented)
            if self.problem.start.pinned:
                begins = [s for s, off in self._passes(path) if off <= NEAR_GUESS]
                if not begins:
                    break
                path = rolled(path, min(begins, key=abs), self.problem)
            first = self._around(path, None)
            if first.y.size > (2 * FULL if thorough else FULL):
                break
            if not self._moved_along(first):
                continue
            status = self.judged(self.settled())
            if status.success or status is Status.FLOOR:
                self.found_by = "guess"
                self.hint = self._told()
                return True
        self.along = ()
        self.here, self.hint, self.gain, self.noise, self.error = before
        return False

    def _moved_along(self, here: Reached) -> bool:
        """Go to a path by steps of least norm, and keep the directions of its family there."""
        bordered, y = here
        with np.errstate(all="ignore"):
            for _ in range(APPROACHES if bordered.layout.small else APPROACHES // 4):
                matrix, residual = bordered.layout.full(bordered.kkt(y)), bordered.residual(y)
                if not (np.isfinite(matrix).all() and np.isfinite(residual).all()):
                    return False
                left, values, right = np.linalg.svd(matrix)
                rank = int((values > SINGULAR * values[0]).sum())
                step = right[:rank].T @ ((left[:, :rank].T @ residual) / values[:rank])
                y = y - step
                if bordered.measured(step) < SETTLED:
                    here = Reached(bordered, y)
                    if rank == y.size or not _moves(here.at):
                        return False
                    z, at = y[: here.at.z.size], here.at
                    moved = [DiscretePath(at.tr, z + d[: z.size]).Q - at.Q for d in right[rank:]]
                    self.along = tuple(Path(at.mesh, d.T) for d in moved)
                    self.here = self._around(at.path, at.rows)
                    return self._follow() or self._approach()
        return False

    def _told(self) -> str:
        """Return of how many dimensions the family of closed paths is."""
        assert self.here is not None
        borders = self.here.bordered.borders
        count = borders.c.size - max(len(borders.held), 1)
        where = "that begin there" if borders.held else "besides where each begins"
        return (
            f"closed paths near the guess {where} are a family of dimension {count}, of one action "
            "and one period; the one returned is stationary, and resolved to "
            f"{self.error:.2g}"
        )

    def settled(self) -> Status:
        """Refine, and begin a closed path where its start says: its mesh moves with it."""
        status = self.refine()
        if not status.success or self._is_begun():
            return status
        near = max(self.tol, ON_START)
        return self.refine() if self._begun(near) else Status.NOT_FOUND

    def refine(self) -> Status:
        """Follow the path from mesh to mesh until the tolerance is met or cannot be."""
        stalled, last, pushed = 0, np.inf, np.inf
        for _ in range(ROUNDS):
            started = perf_counter()
            if self._reached and SAFETY * self.noise > self.tol:
                self._follow()  # the last step may have been more than round-off
            here = self.here
            assert here is not None
            if here.pushed > HELD:
                return self._held()
            at = here.at
            sizes = measured(here.bordered.first.problem, at.Q)[0]
            shown = resolution(at.mesh, at.Q, sizes)
            unit = float((here.bordered.first.lengths / sizes).max())
            noise = self.noise * max(unit, 1.0)
            self.gain = max(self.gain, amplified(noise))
            self.error = estimate(self.gain, shown.expected, noise)
            self.record.round(at.tr, perf_counter() - started)
            self.record.rounds[-1]["estimate"] = self.error
            if self.error <= self.tol:
                missed = self._missed(here, shown.worst) * max(unit, 1.0)
                self.error = max(self.error, SAFETY * missed)
                if self.error <= self.tol:
                    if self._is_pushed(here) and here.pushed < pushed / 2:
                        pushed = here.pushed  # less, perhaps, where it is nearest to this iterate
                        if self._again(at):
                            continue
                        self.here = here
                    return Status.SOLVED
                stalled += 1
                cuts = at.tr.cuts(at.z)
                parts = [np.append(b, c) for b, c in zip(at.mesh.since, cuts, strict=False)]
                degrees = np.repeat(at.mesh.degrees, [p.size for p in parts])
                mesh = at.mesh.cut(np.concatenate([*parts, at.mesh.since[-1:]]), degrees)
            else:
                rounded = shown.expected < MEASURABLE or self.gain * shown.expected < noise
                if rounded and (SAFETY * noise > self.tol or stalled):
                    return Status.DEGENERATE if noise > UNDETERMINED else Status.FLOOR
                stalled = stalled + 1 if shown.worst > last / 2 else 0
                mesh = refined(shown, self.tol / (2 * SAFETY * self.gain))
            last = shown.worst
            if stalled == STALLED or mesh.offsets[-1] * at.problem.system.n > MAX_UNKNOWNS:
                return self._failed()
            path = at.path.on(mesh)
            first = path.values.T
            self.here = self._around(path, at.rows_on(mesh))
            # Where paths are sensitive another mesh is enough to leave what Newton contracts in.
            if not (self._follow(passing=True) or self._approach()):
                self.here = here
                return self._failed()
            there = self.here.at
            change = float(np.max(np.abs(there.Q - first) / sizes))
            longer = abs(there.mesh.duration / at.mesh.duration - 1)
            change += self.here.bordered.reach * longer
            if shown.expected > MEASURABLE:
                self.gain = max(change / shown.expected, 1.0)
        return self._failed()

    def judged(self, status: Status) -> Status:
        """Return the verdict on the path at hand: one that has to be pushed is none."""
        found = status.success or status is Status.FLOOR
        if found and self.here and self._is_pushed(self.here):
            return self._held()
        return status

    def _is_pushed(self, here: Reached) -> bool:
        """Whether a closed path is none; one of a family is not held by what resolves it badly."""
        return here.pushed > max(self.tol, 0.0 if self.along else self.error, PUSHED)

    def _again(self, at: DiscretePath) -> bool:
        """Follow a closed path on its mesh once more, its phase about where it is now."""
        if self.along:
            return False
        self.here = self._around(at.path, at.rows)
        return self._follow() and _moves(self.here.at)

    def _held(self) -> Status:
        self.hint = "near the guess a path closes only if it is pushed along itself"
        self.error = np.inf
        return Status.NOT_FOUND

    def _missed(self, here: Reached, left: float) -> float:
        """Return how far the path would move if its forces were summed over other points."""
        bordered, y = here
        at = here.at
        structure = at.problem.system.structure
        if structure.steady:
            return 0.0
        residual, drift = at.tr.missed(at.z, followed=hidden(structure, left, self.tol))
        right = np.concatenate([residual, np.zeros(y.size - residual.size)])
        factors = self.factors or Factors(bordered.layout, bordered.kkt(y))
        step = factors.solve(right)
        return max(bordered.measured(step), drift / (1.0 + at.tr.turns(at.z)))

    def _failed(self) -> Status:
        return Status.DEGENERATE if self.noise > ILL_CONDITIONED else Status.UNRESOLVED


def _moves(at: DiscretePath) -> bool:
    return bool(np.ptp(at.Q, axis=0).max() > MOVING * np.abs(at.Q).max())


def solve_unfixed(
    problem: Problem,
    solve: Callable[..., Solution],
    tol: float,
    guess: Guess | None,
    principle: Literal["auto", "least", "stationary"],
    watch: Watch | None,
    *,
    thorough: bool = True,
) -> tuple[Solution, str]:
    """Return the solution of a problem whose duration is free or whose paths close, and a hint.

    With `thorough`, also on a mesh that represents the guess better, and by damped steps.
    """
    started = perf_counter()
    run, first = Unfixed(problem, tol, watch), FirstPaths(problem, tol, solve)
    if isinstance(guess, Solution) and guess.success:
        run.gain = guess.stats.get("gain", run.gain)  # a neighbour is as sensitive
    status = Status.NOT_FOUND
    try:
        for damped in (False, True):
            for k, (path, lam, how) in enumerate(first.firsts(guess)):
                if k and not thorough:
                    break
                if not run.reach(path, lam, damped=damped):
                    continue
                run.found_by = how
                status = run.judged(run.settled())
                if status.success or status is Status.FLOOR:
                    break
            if run.here is not None and np.isfinite(run.error):
                break
        known = status.success or guess is None
        if not known and run.in_family(guess, thorough=thorough):  # type: ignore[arg-type]
            status = Status.DEGENERATE
    except OutOfTime:
        status = Status.OUT_OF_TIME
    if watch is not None and watch.raised is not None and not isinstance(watch.raised, OutOfTime):
        raise watch.raised
    events = () if problem.closes else (problem.start, problem.end)
    anywhere = any(e.t is None and e.on is None and not e.pinned for e in events)
    hint = run.hint or first.hint
    if anywhere and not status.success:
        hint = f"{STOPS}; {hint}" if hint else STOPS
    if first.merged and status in (Status.NOT_FOUND, Status.UNRESOLVED):
        status = Status.DEGENERATE
    solution = _solution(run, status, started)
    if principle == "least" and status.success and solution.morse_index > 0:
        solution = _solution(run, Status.NOT_LEAST, started)
    return solution, hint


def _solution(run: Unfixed, status: Status, started: float) -> Solution:
    """Return the path at hand as a solution of the problem, with its times found."""
    if run.here is None:
        path, rows, duration = None, None, 1.0
    else:
        at = run.here.at
        path, rows, duration = at.path, at.rows, at.mesh.duration
    problem = over(run.problem, duration)
    # An error as large as the path: it ran away, and lies on no surface.
    if path is not None and run.problem.on_surface and run.error < 1:
        problem = run.problem.found(problem.start.t, problem.end.t, path.values[:, [0, -1]].T)
    if path is None:
        mesh = Mesh.uniform(problem.start.t, problem.end.t, FIRST_ELEMENTS, COARSE_DEGREE)
        path = Path(mesh, line(problem, mesh))
    known = _on_its_mesh(run, problem, path, rows)
    record = run.record
    record.time["total"] = perf_counter() - started
    noise = run.noise
    stats: dict[str, Any] = {
        "rung": run.found_by,
        "unknowns": known.tr.layout.unknowns,
        "rows": known.tr.layout.rows,
        "iterations": dict(record.iterations),
        "evaluations": dict(record.evaluations),
        "rounds": record.rounds,
        "gain": run.gain,
        "noise": noise,
        "condition": max(noise / np.finfo(float).eps, 1.0),
        "derived": problem.system.derived,
        "time": dict(record.time),
    }
    lam = known.rows.T
    known_error = status.success or status is Status.FLOOR or run.along
    error = run.error if known_error else np.inf
    action = known.action
    return Solution(problem, known.path, action, lam, error, status, stats, known=known)


def _on_its_mesh(run: Unfixed, problem: Problem, path: Path, rows: Array | None) -> DiscretePath:
    """Return the path of the problem with its times found, in the units at hand."""
    if run.here is None or run.problem.on_surface:
        return DiscretePath.of(problem, path, rows)
    tr = Transcription(problem, path.mesh, run.here.at.tr.lengths, like=run.here.at.tr)
    return DiscretePath(tr, tr.pack(path.values.T, rows))
