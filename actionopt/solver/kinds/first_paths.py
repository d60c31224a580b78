"""First paths where a duration is to be found: over several durations, or a guess with its own.

How long a motion of the energy takes along the straight line says which durations to begin with;
paths over fixed durations tell their energies, and where the one that is asked is passed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from actionopt.analysis.quadratic.shooting import hermite, motions
from actionopt.analysis.solution import Solution
from actionopt.analysis.status import Status
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.borders.borders import over
from actionopt.discrete.borders.end_times import by_times
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.meshes.resolution import cheapest_mesh, resolution
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.discrete.newton.newton import approach, follow
from actionopt.mechanics.question.problem import Problem
from actionopt.mechanics.question.scales import ends_of
from actionopt.solver.ends.closed import LOOKED_AT
from actionopt.solver.ends.durations import (
    LINE,
    MERGED,
    NEAR_DURATION,
    conserves_energy,
    rates,
    return_time,
    straight_passage,
    times_along,
)
from actionopt.solver.ends.lowest_pass import explain_pass
from actionopt.solver.input.arguments import Guess, curve
from actionopt.solver.input.preflight import check
from actionopt.solver.kinds.between import solve_on_the_way
from actionopt.solver.refinement.first_mesh import (
    COARSE_DEGREE,
    FIRST_TOL,
    LINEAR,
    fewest_elements,
    straight_line,
)
from actionopt.solver.refinement.iterate import SAFETY, UNKNOWN_GAIN, coordinate_scales
from actionopt.solver.refinement.refine import ROUNDS
from actionopt.solver.refinement.workspace import FEW_COORDINATES, QUICK_STEPS, ROUGHLY
from actionopt.solver.search.search import FIRST_FEW
from actionopt.tools.types import EPS, Array
from actionopt.tools.watch import Watch

# Ad hoc.
REPRESENTED = 1e-4, 1e-7  # of a guess: what its first mesh leaves out, and the next one tried
SCANNED = 9  # durations either way, each the root of two times the next, that are looked at
TRIED_DURATIONS = np.logspace(-8, 8, 65)  # durations at which a straight line is looked at
BELOW_LOWEST = 0.9  # of the duration of the lowest path
ENERGY_ROUNDOFF = 1e3 * EPS  # of an energy; measured, 40 eps on throws and transfers
# Half lengths of its first and last element, from their middles, that a motion is carried on; parts
# of its duration that are cut off at most.
AHEAD, DURATION_CUT = 3.0, 0.4


@dataclass
class FirstPaths:
    """The first paths of a search for a path of a given energy."""

    problem: Problem
    tol: float
    watch: Watch | None = None  # of the search for which they are
    hint: str = ""  # what to add to the verdict: how low the energy gets
    # The path that two paths are at the energy, if they are one there.
    merged: DiscretePath | None = None
    # Why the first question over a given duration was no question, if one was not.
    refused: ValueError | None = None
    blocked: str = ""  # that the energy is below the potential on the straight line, if it is
    # Whether it is below that on all curves that were tried: then only quick ways are worth it.
    barred: bool = False
    # Durations over which no path was found by quick ways.
    lost: list[float] = field(default_factory=list)
    of_family: Path | None = None  # one of a family of paths over one of them
    # The path over a given duration that was yielded last: its question is in order.
    solved: DiscretePath | None = None

    def firsts(
        self, guess: Guess | DiscretePath | None
    ) -> Iterator[tuple[Path, Array | None, str]]:
        """Yield paths to set out from, with multipliers (K, m) or none, and how each was found."""
        if guess is not None:
            first, last = REPRESENTED
            if isinstance(guess, Solution) and guess.success:
                known = max(self.tol, guess.error)  # finer, its elements would resolve its errors
                if not self.problem.system.structure.depends_on_time:
                    guess = cut_at_passage(self.problem, guess.path)
                path = guess if isinstance(guess, Path) else guess.path
                yield stretch_guess(self.problem, path), None, "guess"  # a neighbour's mesh will do
                first = min(known / (2 * SAFETY * UNKNOWN_GAIN), first)
            for represented in (first, last):
                yield guess_path(self.problem, guess, represented), None, "guess"
            return
        if self.problem.on_surface:
            self.hint = "no point was found on the surface of an event; give a guess"
        if self.problem.closes or self.problem.on_surface:
            return
        through = straight_passage(self.problem)
        if through is not None:
            t, q, v = through
            known = over(self.problem, float(t[-1]))
            curve_on = curve(known, hermite(known.start.t + t, q[None], v[None]))
            for represented in REPRESENTED:
                path = resolve_curve(known, curve_on, represented)
                yield path, None, "line"
                # A path over a given duration tells its energy better than its first curve.
                at = self._over(known.duration, DiscretePath.of(known, path))
                if at is not None:
                    yield at.path, at.rows, "duration"
        if not (self.problem.start.pinned and self.problem.end.pinned):
            yield from ((path, None, "motion") for path in self._motions_to_rest())
        for at in self.over_durations():
            self.solved = at
            yield at.path, at.rows, "duration"
        self.solved = None
        with suppress(ValueError):  # that no motion of the energy takes the straight line
            yield time_waypoints(self.problem, straight(self.problem).T), None, "line"

    def _look_for_pass(self, line: Array) -> None:
        """Find out whether the energy is below the potential on all curves beside the line."""
        problem, law = self.problem, self.problem.system
        pinned = len(problem.start.pinned) == len(problem.end.pinned) == law.n
        if law.n == 1 or not (problem.free_time and pinned and conserves_energy(law)):
            return
        self.hint = explain_pass(problem, line, float(problem.energy or 0.0))
        self.barred = bool(self.hint)

    def over_durations(self) -> Iterator[DiscretePath]:
        """Yield paths over fixed durations, near those that have the energy.

        Over the time that a motion of the energy takes along the straight line, or the durations
        over which that line has the energy on average; then on both sides of the last of these.
        """
        problem = self.problem
        t = given_time(problem)
        q = straight(problem)
        known = times_along(problem, q, t)
        if known is not None and known[1] > 0:
            durations = [float(known[0][-1])]
        else:
            durations = self._durations_of_energy()
            if known is not None and known[1] < 0:
                self.blocked = "the energy is below the potential on the straight line"
                self._look_for_pass(q)
            if known is not None:
                durations.append(float(known[0][-1]))
        if not durations:
            durations = [return_time(problem, q[0], t)]
        for k, T in enumerate(durations):
            first = self._over(T)
            if first is not None:
                yield first
            else:
                self.lost.append(T)
            if k == len(durations) - 1 and not self.barred:
                yield from self._scan(T, first)

    def longer_sought(self) -> Iterator[DiscretePath]:
        """Yield paths over the durations over which quick ways found none."""
        for T in self.lost:
            first = self._over(T, brief=False)
            if first is not None:
                yield first
                yield from self._scan(T, first)

    def _durations_of_energy(self) -> list[float]:
        """Return the durations over which the straight line has the energy, on the average."""
        found, last = [], None
        for T in TRIED_DURATIONS:
            known = over(self.problem, float(T))
            mesh = Mesh.uniform(known.start.t, known.end.t, 2, COARSE_DEGREE)
            at = DiscretePath.of(known, straight_line(self.problem, mesh))
            if not np.any(at.path.values[:, 0] != at.path.values[:, -1]):
                return []
            with np.errstate(all="ignore"):
                excess = self.excess(at)
            if last is not None and last[1] * excess < 0:
                part = last[1] / (last[1] - excess)
                found.append(float(last[0] * (T / last[0]) ** part))
            last = (T, excess) if np.isfinite(excess) else None
        return found

    def _scan(self, T: float, first: DiscretePath | None) -> Iterator[DiscretePath]:
        """Yield paths between whose durations the energy is passed, and say how low it gets."""
        seen = [] if first is None else [first]
        crossed = False
        for sign in (1, -1):
            last, before = first, None if first is None else self.excess(first)
            for k in range(1, SCANNED + 1):
                at = self._over(T * 2.0 ** (sign * k / 2), last)
                if at is None:
                    break
                excess = self.excess(at)
                seen.append(at)
                if before is not None and excess * before < 0:
                    crossed = True
                    part = before / (before - excess)
                    T0, T1 = (last or at).mesh.duration, at.mesh.duration
                    middle = self._over(T0 * (T1 / T0) ** part, at)
                    yield middle if middle is not None else at
                last, before = at, excess
        if not seen:
            return
        low = max(seen, key=self.excess)
        if not crossed:
            low = self._lowest(seen, low)
            # Two paths between two of the durations, or one where they merge: seen from a side.
            aside = self._over(BELOW_LOWEST * low.mesh.duration, low)
            if aside is not None:
                yield aside
        low = self._sharp(low)
        excess, T = self.excess(low), low.mesh.duration
        energy = float(self.problem.energy or 0)
        tried = [at.mesh.duration for at in seen]
        # The energies of half of the paths tell; those of the shortest durations may be any.
        size = max(float(np.median(np.abs([self.excess(at) - excess for at in seen]))), abs(energy))
        known = max(ENERGY_ROUNDOFF, self.tol**2) * size  # the error is the square of a path's
        self.hint = self.blocked
        if excess < 0 and min(tried) < T < max(tried):  # elsewhere lower ones may have been lost
            self.hint = (self.blocked and f"{self.blocked}; ") + (
                f"of the paths over {len(seen)} durations from {min(tried):.3g} to "
                f"{max(tried):.3g} that were found, the lowest energy is that over {T:.6g}, "
                f"{energy - excess:.6g}, above the one given by {-excess:.2g}"
            )
        if not crossed and abs(excess) <= known:
            self.merged = low
            self.hint = (
                f"the energy is the least of a path to there, that over {T:.6g}: two paths merge, "
                "and their duration is determined to half the digits; give a little more energy"
            )

    def _sharp(self, at: DiscretePath) -> DiscretePath:
        """Return a path over a given duration to the tolerance, if that succeeds."""
        found = solve_on_the_way(at.problem, self.tol, self.watch, at.path, brief=True)
        return found.discrete if found.success else at

    def _lowest(self, seen: list[DiscretePath], low: DiscretePath) -> DiscretePath:
        """Return a path of least energy between durations that were tried, by parabolas."""
        seen = sorted(seen, key=lambda at: at.mesh.duration)
        k = seen.index(low)
        if not 0 < k < len(seen) - 1:
            return low
        three = seen[k - 1 : k + 2]
        for _ in range(QUICK_STEPS):
            x = np.log([at.mesh.duration for at in three])
            curvature, slope, _ = np.polyfit(x - x[1], [-self.excess(at) for at in three], 2)
            to = x[1] - slope / 2 / curvature if curvature > 0 else np.nan
            if not x[0] < to < x[2] or abs(to - x[1]) < MERGED:
                break
            at = self._over(float(np.exp(to)), three[1])
            if at is None:
                break
            four = sorted([*three, at], key=lambda at: at.mesh.duration)
            k = max(1, min(2, int(np.argmax([self.excess(at) for at in four]))))
            three = four[k - 1 : k + 2]
        return max(three, key=self.excess)

    def _motions_to_rest(self) -> Iterator[Path]:
        """Yield motions from the start to where they come to rest, if nothing is given at the end.

        No momentum is left at an end that is free in all coordinates. This is for one coordinate,
        where the energy leaves the motion no choice.
        """
        problem = self.problem
        t0 = problem.start.t or 0.0
        if problem.system.n > 1 or problem.end.pinned or not problem.start.pinned:
            return
        q0 = np.array(problem.start.q, dtype=float)
        speed, left = rates(problem, q0[None], np.ones((1, 1)), np.array([[t0]]))
        if not left[0] > 0:
            return
        T = return_time(problem, q0, t0)
        for factor in np.logspace(0, SCANNED / 2, SCANNED + 1, base=2.0):
            known = over(problem, float(T * factor))
            for path in motions(known, np.array([[speed[0], -speed[0]]])):
                if path is None:
                    continue
                t = np.linspace(t0, t0 + T * factor, LOOKED_AT + 1)
                turned = np.flatnonzero(np.diff(np.sign(path.velocity(t)[0])))
                if turned.size:
                    k = turned[0]
                    b = path.mesh.boundaries
                    b = np.append(b[b < t[k]], t[k + 1])
                    cut = Mesh(b, path.mesh.degrees[: b.size - 1])
                    yield Path.interpolate(path, cut)
                    return

    def excess(self, at: DiscretePath) -> float:
        """Return by how much the given energy is above that of a path."""
        t0, t1 = by_times(at)
        slope = -t0 if self.problem.end.t is not None else t1
        return slope + float(self.problem.energy or 0.0)

    def _over(
        self, duration: float, near: DiscretePath | None = None, *, brief: bool = True
    ) -> DiscretePath | None:
        """Return a path of the problem over a duration, near another one if that is given; or None.

        That is one on the same mesh, stretched: it tells the energy well enough. Else one that is
        sought, with `brief` by quick ways.
        """
        known = over(self.problem, duration)
        values = self.problem.parameters
        fixed = Problem(known.system, known.start, known.end, parameters=values)
        if near is not None:
            mesh = near.mesh.moved(fixed.start.t, fixed.end.t)
            tr = Transcription(fixed, mesh, near.tr.lengths)
            tr.watch = self.watch
            result = follow(tr, tr.pack(near.Q, np.nan_to_num(near.rows)))
            at = DiscretePath(tr, result.z)
            if not result.converged:
                return None
            sizes = coordinate_scales(fixed, at.Q)[0]
            return at if resolution(mesh, at.Q, sizes).worst < ROUGHLY else None
        try:
            quick = self._near_line(fixed) if brief else None
            if quick is not None:
                return quick
            found = solve_on_the_way(fixed, FIRST_TOL, self.watch, brief=brief, verdict=not brief)
        except ValueError as error:
            self.refused = self.refused or error
            return None
        if found.status is Status.DEGENERATE:
            self.of_family = found.path
        return found.discrete if found.success else None

    def _near_line(self, fixed: Problem) -> DiscretePath | None:
        """Return a path that Newton's steps come near from a line along which the action is convex.

        If its mesh represents it to `FIRST_TOL`. Raises ValueError as a solve does.
        """
        if fixed.system.order > 1 or not conserves_energy(fixed.system):
            return None
        tr = straight_action(fixed)
        Q, tr.watch = tr.straight(), self.watch
        check(tr, Q)
        found = approach(tr, tr.pack(Q), QUICK_STEPS, convex=True)
        if found is None:
            return None
        at = DiscretePath(tr, found[0])
        left = resolution(tr.mesh, at.Q, coordinate_scales(fixed, at.Q)[0]).worst
        return at if SAFETY * UNKNOWN_GAIN * left <= FIRST_TOL else None


def straight_action(problem: Problem) -> Transcription:
    """Return the action near the straight line, in the time of the energy where that is free."""
    fixed = problem
    if problem.free_time:
        fixed = over(problem, duration_along(problem, straight(problem)))
    few = problem.system.n <= FEW_COORDINATES or problem.system.m > 0
    elements = LINEAR if few else max(FIRST_FEW, fewest_elements(fixed))
    mesh = Mesh.uniform(fixed.start.t, fixed.end.t, elements, COARSE_DEGREE)
    return Transcription(fixed, mesh, fixed.lengths)


def guess_path(
    problem: Problem, guess: Guess | DiscretePath, represented: float, most: float = math.inf
) -> Path:
    """Return a guess on a mesh that represents it, with its duration; as `resolve_curve` does.

    Its own mesh, where that does and it was made on the way.
    """
    made, mesh = isinstance(guess, DiscretePath), None
    if isinstance(guess, (DiscretePath, Solution)):
        guess = guess.path
    if problem.free_time and not isinstance(guess, Path):
        guess = time_waypoints(problem, guess)
    if isinstance(guess, Path):
        path, known = stretch_guess(problem, guess), over(problem, guess.mesh.duration)
        curve_on, mesh = path.on, path.mesh if made else None
    else:
        known = over(problem, 1.0)
        curve_on = curve(known, guess)
    return resolve_curve(known, curve_on, represented, most, mesh)


def resolve_curve(
    known: Problem,
    curve_on: Callable[[Mesh], Path],
    represented: float,
    most: float = math.inf,
    mesh: Mesh | None = None,
) -> Path:
    """Return a curve over the times of a problem on a mesh that represents it, perhaps on `mesh`.

    Or on one of more than `most` degrees of freedom, if it takes that many in a coordinate.
    """
    mesh = mesh or Mesh.uniform(known.start.t, known.end.t, LINEAR, COARSE_DEGREE)
    found = curve_on(mesh)
    for _ in range(ROUNDS // 2):
        size = np.abs(found.values).max(axis=1)
        size = np.where(size > 1e-9 * size.max(), size, max(size.max(), 1e-300))
        shown = resolution(mesh, found.values.T, size)
        if shown.worst <= represented or mesh.offsets[-1] > most:
            break
        mesh = cheapest_mesh(shown, represented / 2)
        found = curve_on(mesh)
    return found


def cut_at_passage(problem: Problem, path: Path) -> Path:
    """Return a motion cut off or carried on where it passes what the events give, or comes nearest.

    Without a clock each part of a motion is one, and so is what it goes on to be.
    """
    if not problem.free_time or problem.closes or problem.on_surface:
        return path
    mesh, n = path.mesh, problem.system.n
    longest, ends = (AHEAD - 1) / 2 * mesh.lengths[[0, -1]], np.array([0.0, mesh.duration])
    cut = DURATION_CUT * ends[1]
    low, high = ends - [longest[0], cut], ends + [cut, longest[1]]
    unit, wanted = np.abs(path.values).max(axis=1)[:, None], np.zeros((n, 2))
    unit, given = np.where(unit > 0, unit, 1.0), np.zeros((n, 2), dtype=bool)
    for k, event in enumerate((problem.start, problem.end)):
        for i in event.pinned:
            wanted[i, k], given[i, k] = event.q[i], True
    at = ends
    for _ in range(QUICK_STEPS):  # Gauss and Newton's method
        q, v = path.carried_on(at, AHEAD)
        away, rates = (np.where(given, x / unit, 0.0) for x in (q - wanted, v))
        square = (rates * rates).sum(axis=0)
        by = np.divide((away * rates).sum(axis=0), square, out=np.zeros(2), where=square > 0)
        at = (at - by).clip(low, high)
        if np.abs(by).max() <= NEAR_DURATION * ends[1]:
            break
    if not np.abs(at - ends).max() > NEAR_DURATION * ends[1]:
        return path
    T = at[1] - at[0]
    values = path.carried_on(at[0] + mesh.nodes_since * (T / ends[1]), AHEAD)[0]
    return Path(mesh.moved(mesh.boundaries[0], mesh.boundaries[0] + T), values)


def stretch_guess(problem: Problem, guess: Path) -> Path:
    """Return a guess over the times of the events, where it begins and ends unless it closes."""
    known = over(problem, guess.mesh.duration)
    path = Path(guess.mesh.moved(known.start.t, known.end.t), guess.values)
    return path if problem.closes else shear(path, known)


def shear(path: Path, problem: Problem) -> Path:
    """Return a path moved in proportion to time so that it begins and ends where the events say."""
    s = path.mesh.nodes_since / path.mesh.duration
    values = path.values.copy()
    for event, k, part in ((problem.start, 0, 1 - s), (problem.end, -1, s)):
        for i in event.pinned:
            values[i] += (np.array(event.q[i], dtype=float) - path.values[i, k]) * part
    return Path(path.mesh, values)


def given_time(problem: Problem) -> float:
    """Return a time that an event gives; zero where neither does."""
    return next((e.t for e in (problem.start, problem.end) if e.t is not None), 0.0)


def duration_along(problem: Problem, q: Array) -> float:
    """Return how long the path takes, or a motion of the energy along the points q (K, n)."""
    if not problem.free_time:
        return problem.duration
    known = times_along(problem, q, given_time(problem))
    return 1.0 if known is None else float(known[0][-1])


def straight(problem: Problem) -> Array:
    """Return points (K, n) on the straight line between the events."""
    start, end = ends_of(problem)
    return start + np.linspace(0, 1, LINE)[:, None] * (end - start)


def time_waypoints(problem: Problem, guess: ArrayLike | Callable[[Array], ArrayLike]) -> Path:
    """Return waypoints as a path, in the time that a motion of the energy takes along them.

    Raises ValueError for other guesses, which have no duration.
    """
    if callable(guess):
        raise ValueError(
            "expected a guess that says its duration where that is to be found, a Path or a "
            "solution, or waypoints, found a callable; Path.interpolate(callable, mesh) has one"
        )
    shape = curve(over(problem, 1.0), guess)
    start = given_time(problem)
    s = np.linspace(0.0, 1.0, 10 * LINE)
    known = over(problem, 1.0)
    unit = Mesh.uniform(known.start.t, known.end.t, 10 * LINEAR, COARSE_DEGREE)
    q = shape(unit)(known.start.t + s).T
    found = times_along(problem, q, start)
    if found is None:
        raise ValueError(
            f"expected waypoints that a motion of the energy {problem.energy:.15g} can pass, found "
            "the potential above it at all of them"
        )
    times = found[0]
    ends = over(problem, float(times[-1]))
    t0 = ends.start.t
    mesh = Mesh.uniform(t0, ends.end.t, 10 * LINEAR, COARSE_DEGREE)
    rows = lambda t: np.stack([np.interp(t - t0, times, row) for row in q.T])  # noqa: E731
    return Path.interpolate(rows, mesh)
