"""Searches for all paths: starts of every kind between two events, and the distinct answers.

Between given events: least paths from several coarse starts, forward motions in all directions
aimed at the second event, Newton's method that keeps away from what is known, and continuation of
every path found through folds in the end time, where paths appear in pairs. What a start leads to
is compared with what is known and with the forward motion from its own start, once.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import islice
from typing import NamedTuple

import numpy as np

from actionopt.analysis.motion.compare import is_motion
from actionopt.analysis.motion.flow import IntegrationError
from actionopt.analysis.quadratic.shooting import (
    aim,
    close,
    in_directions,
    motions,
    shoot,
    speeds,
    velocities,
)
from actionopt.analysis.solution import Solution, SolveError
from actionopt.analysis.status import Status
from actionopt.discrete.action.projection import project
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.borders.borders import times_of
from actionopt.discrete.meshes.boundaries import with_boundaries
from actionopt.discrete.meshes.element import with_degrees
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.meshes.path import Path
from actionopt.families.searches.deflation import deflate
from actionopt.families.searches.free_times import first_paths, is_first
from actionopt.families.searches.obstacle_search import curves
from actionopt.families.searches.surface_search import points
from actionopt.families.searches.velocity_scan import scan
from actionopt.families.traces.trace import trace
from actionopt.mechanics.question.problem import Problem
from actionopt.solver.contact.first_contacts import other_sides
from actionopt.solver.kinds.between import Choices
from actionopt.solver.kinds.nearest_points import motions as motions_to_surfaces
from actionopt.solver.kinds.nearest_points import paths_to_points
from actionopt.solver.kinds.through import SAME_FIRST, attempts
from actionopt.solver.pursue import first_acceptable
from actionopt.solver.refinement.ipopt import find
from actionopt.solver.search.strategies import GUESS_ONLY, STRATEGIES
from actionopt.tools.types import Array
from actionopt.tools.watch import Progress, check_time

# Ad hoc: how much is enough to find all paths cannot be derived, and what is found more, costs
# more. Lengths are in units of the coordinates' sizes, velocities and momenta in the largest's.
SEARCH_ELEMENTS, SEARCH_DEGREE = 24, 6  # of the mesh on which paths are sought
# Distance of two paths below which they are one, and so many times `tol`: on a small surface paths
# are close.
SAME_PATH, SURE = 1e-6, 10.0
PARTS = Mesh.uniform(0.0, 1.0, SEARCH_ELEMENTS, SEARCH_DEGREE).nodes  # of the time
SAME_COARSE_PATH = 1e-3
SAME_VELOCITY = 1e-3
SAME_ACTION = 1e-6  # relative difference of the actions of one family, all the same
FAMILY_REACH = 1e6  # what goes farther does so by round-off alone
CONTINUATION_TOL = 1e-5  # of paths on the way to another
# Most points on that way. Those to another path had 78 at most, and to a new one 33, on questions
# of two and three coordinates; what runs away took all of 300, in 50 times the time.
CONTINUATION_STEPS = 80
# Most batches of shots; and after one that found nothing so many at once, which take hardly longer,
# and end the search if they find nothing either.
SHOT_BATCHES, LAST_SHOTS = 20, 3
FOR_EACH_EVENT, MOST_EVENTS = 20, 2  # first paths a start and event; ad hoc
CLOSED_BATCHES = 3  # most for closed paths: there may be larger and larger ones without end
CLOSED_REACH = 4.0  # largest motions tried for closed paths, in the size of those that are known
# Classes of turns in which paths are sought, those of fewest turns: w turns of n angles have
# (2 w + 1)^n, more than can be counted from n = 30 on. Ad hoc: all for w = 1 up to n = 6.
MOST_CLASSES = 1000
LATEST_FOLD, EARLIEST_FOLD = 2.0, 0.2  # end times, relative to the duration


def whole_turns(count: int, most: int) -> Iterator[tuple[int, ...]]:
    """Yield all numbers of turns of `count` angles, each `most` at most, in order of their sum."""
    for total in range(most * count + 1):
        yield from _turns(count, most, total)


def _turns(count: int, most: int, total: int) -> Iterator[tuple[int, ...]]:
    """Yield those whose absolute values add up to `total`."""
    if not count:
        yield ()
        return
    for k in range(-min(most, total), min(most, total) + 1):
        if total - abs(k) <= most * (count - 1):
            yield from ((k, *others) for others in _turns(count - 1, most, total - abs(k)))


@dataclass(eq=False)
class Winding:
    """The paths with the same windings; those between given events have a mesh to search on."""

    turns: tuple[int, ...]
    problem: Problem
    seen: list[Array] = field(default_factory=list)  # coarse z already dealt with

    @cached_property
    def tr(self) -> Transcription:
        """The discrete problem on which they are searched for."""
        start, end = self.problem.start.t, self.problem.end.t
        mesh = Mesh.uniform(start, end, SEARCH_ELEMENTS, SEARCH_DEGREE)
        mesh = with_boundaries(
            with_degrees(mesh, self.problem.system.order), self.problem.boundaries
        )
        return Transcription(self.problem, mesh, self.problem.lengths)


class Start(NamedTuple):
    """A guess from which a path is sought, or None for the straight line, and how it was found.

    `solution` is what it led to, where that is known already.
    """

    winding: Winding
    guess: Path | None
    how: str
    solution: Solution | None = None


@dataclass(eq=False)
class Answers:
    """A search for all paths under way: what was found, and starts to find more."""

    problem: Problem
    tol: float
    turning: tuple[int, ...]
    windings: int
    seed: int
    progress: Progress | None
    found: list[tuple[Solution, tuple[int, ...], str]] = field(default_factory=list)
    families: list[tuple[Solution, tuple[int, ...]]] = field(default_factory=list)
    kinked: list[tuple[Solution, tuple[int, ...]]] = field(default_factory=list)
    refused: ValueError | None = None  # why `solve` refuses the problem itself
    tried: Counter[str] = field(default_factory=Counter)
    rejected: int = 0
    interrupted: bool = False
    scanned: bool = False  # whether all velocities of one degree of freedom were tried
    samples: dict[int, Array] = field(default_factory=dict)  # of what is kept, by its id
    last: Solution | None = None  # what the last start led to, or what that repeats

    def __post_init__(self) -> None:
        problem = self.problem
        self.closed = problem.advance is not None
        found = problem.has_open_ends or problem.is_joined
        self.given = not (found or problem.system.r)
        # Where times, places or contacts are found as well the whole question is not linear.
        self.linear = problem.system.structure.linear and self.given
        self.loose: tuple[int, ...] = ()
        if self.given:
            # One more turn is another path where both events say where it is, or it has to close;
            # where neither says, the whole path may be a turn farther, and is the same one.
            known = set(problem.start.pinned) | set(problem.end.pinned)
            self.loose = tuple(i for i in self.turning if i not in known)
            self.turning = tuple(i for i in self.turning if self.closed or i in known)
        self.choices = Choices(self.tol, "auto", STRATEGIES, None, None)
        if found:
            self.choices = Choices(self.tol, "auto", GUESS_ONLY, None, None)
        self.classes: list[Winding] = []
        for k in islice(whole_turns(len(self.turning), self.windings), MOST_CLASSES):
            by = np.zeros(problem.system.n)
            by[list(self.turning)] = 2 * np.pi * np.array(k)
            mine = problem.replace(end=problem.end.shifted(by)) if any(k) else problem
            self.classes.append(Winding(k, mine))

    @cached_property
    def far(self) -> Array:
        """How far the ends of the straight lines are apart at most, (n,)."""
        lines = [c.tr.straight() for c in self.classes]
        return np.max([np.abs(Q[-1] - Q[0]) for Q in lines], axis=0)

    def starts(self, starts: int, shots: int, continuations: int) -> Iterator[Start]:
        """Yield all starts of the question's kind; each is answered before the next is made."""
        if self.problem.system.r:
            yield from self._to_all_sides(starts)
        elif self.problem.is_joined:
            yield from self._through_events(starts)
        elif self.problem.on_surface:
            yield from self._on_surfaces(starts, shots)
        elif self.problem.free_time:
            yield from self._of_the_energy(shots)
        else:
            if self._is_scanned(shots):
                yield from self._straight(self.classes[:1])
                yield from self._scan(shots)
                if self.scanned:
                    return
            yield from self._straight(self.classes)
            if not self.linear:
                yield from self._least(starts)
                # Velocities alone start a motion, which passes no places that are given.
                if self.problem.system.order == 1 and not self.problem.through:
                    yield from self._forward_shots(shots)
                yield from self._deflate(starts)
                yield from self._folds(continuations)

    def _to_all_sides(self, starts: int) -> Iterator[Start]:
        """Yield curves past the obstacle on all of its sides."""
        given = self.problem
        if given.has_free_boundary:  # curves are drawn over times and between points found once
            given = first_acceptable(given, None, self.choices)[0].between_times.problem
        guesses = curves(given, starts, self.seed)
        for i, guess in enumerate(guesses):
            how = "the straight line" if guess is None else "a curve to a side"
            self.tell("curves to all sides", i, len(guesses), how)
            yield Start(self.classes[0], guess, how)
        for i, (solution, _, _) in enumerate(self.found):  # grows on the way
            if not solution.contacts:
                continue
            for guess in other_sides(solution.discrete, solution.contacts):
                self.tell("other sides", i, len(self.found), "curves across a contact")
                yield Start(self.classes[0], guess, "a curve across a contact")

    def _on_surfaces(self, starts: int, shots: int) -> Iterator[Start]:
        """Yield paths to points all over the surfaces, and motions that come to the end later."""
        yield Start(self.classes[0], None, "as `solve` does")
        pairs = points(self.problem, starts, self.seed)
        for i, at in enumerate(paths_to_points(self.problem, self.tol, None, pairs)):
            self.tell("points on surfaces", i, len(pairs), "points on surfaces")
            yield Start(self.classes[0], at.path, "a point on a surface")
        for i, guess in enumerate(motions_to_surfaces(self.problem, None) if shots else ()):
            self.tell("forward shots", i, i + 1, "forward shots")
            yield Start(self.classes[0], guess, "a forward shot")

    def _through_events(self, starts: int) -> Iterator[Start]:
        count = FOR_EACH_EVENT * starts * min(max(1, len(self.problem.through)), MOST_EVENTS)
        found = attempts(self.problem, self.tol, None, None, count, self.seed)
        for i, (solution, _) in enumerate(found):
            self.tell("places at events", i, count, "places at events")
            yield Start(self.classes[0], None, "places at events", solution)

    def _of_the_energy(self, shots: int) -> Iterator[Start]:
        for c in self.classes:
            found, refused = first_paths(c.problem, self.tol, self.windings, shots, self.seed)
            self.refused = self.refused or refused
            for i, (guess, how) in enumerate(found):
                self.tell(how, i, len(found), how)
                yield Start(c, guess, how)

    # -- between given events ----------------------------------------------------------------------

    def _straight(self, classes: Sequence[Winding]) -> Iterator[Start]:
        """Yield the straight lines: what `solve` begins with."""
        for k, c in enumerate(classes):
            self.tell("straight line", k, len(classes), "straight lines")
            yield Start(c, None, "a straight line")
            if self.last and not (self.problem.start.pinned or self.problem.end.pinned):
                self._resize(c, self.last)

    def _least(self, starts: int) -> Iterator[Start]:
        """Yield what minimising leads to from curves that wave about the straight line."""
        system = self.problem.system
        if system.structure.forced:
            return
        for k, (c, z) in enumerate(self._curves(starts)):
            self.tell("least starts", k, starts * len(self.classes), "least starts")
            if system.m and system.order > 1:  # Ipopt does not know these rows
                yield self._start(c, Path(c.tr.mesh, c.tr.coordinates(z).T), "a curve")
                continue
            attempt = find(c.tr, z, "least")
            path = self._unseen(c, attempt.z) if attempt.converged else None
            if path is not None:
                yield self._start(c, path, "a least start")

    def _forward_shots(self, shots: int) -> Iterator[Start]:
        """Yield forward motions that arrive at the second event, with any windings."""
        n, events = self.problem.system.n, (self.problem.start, self.problem.end)
        if shots < 4:
            return
        if self.closed:
            yield from self._close(shots)
            return
        if any(len(e.pinned) < n for e in events):
            return
        if self.problem.system.degrees_of_freedom < 2:  # `_scan` has shot
            return
        rng, far = np.random.default_rng(self.seed), self.far
        fastest, fruitless = 0.0, False
        if (
            self.problem.system.m
        ):  # no angle tells turns: on a closed surface ever faster ones arrive
            far = far + 2 * np.pi * self.windings * self.problem.lengths
            rates, units = speeds(self.problem, far)
            fastest = 1.2 * rates.max() * float(np.linalg.norm(units))
        yield from self._aim(velocities(self.problem, far, shots, rng))
        for _ in range(SHOT_BATCHES):  # with speeds like those of the paths that are known by now
            before, count = len(self.found), LAST_SHOTS * shots if fruitless else shots
            known = [float(np.linalg.norm(s.start.v)) for s, _, _ in self.found] or [1.0]
            speed = np.linspace(0.8 * min(known), fastest or 1.2 * max(known), count)
            speed += rng.random() * (speed[1] - speed[0])
            yield from self._aim(in_directions(self.problem, speed[None], rng))
            if fruitless and len(self.found) == before:
                break
            fruitless = len(self.found) == before

    def _is_scanned(self, shots: int) -> bool:
        """Whether one number, the initial velocity, tells all paths."""
        problem, n = self.problem, self.problem.system.n
        given = len(problem.start.pinned) == len(problem.end.pinned) == n
        one = problem.system.degrees_of_freedom == 1 and problem.system.order == 1
        plain = not (self.linear or self.closed or problem.through)
        return shots >= 4 and given and one and plain

    def _scan(self, shots: int) -> Iterator[Start]:
        """Yield the motions of one degree of freedom that arrive, of all velocities."""
        self.tell("shots", 0, 4 * shots)
        goals = np.array([c.problem.end.q for c in self.classes], dtype=float).T
        v0, which, sampled, self.scanned = scan(self.problem, self.far, goals, 4 * shots)
        self.tried["forward shots"] += sampled
        yield from self._arrivals([self.classes[k] for k in which], v0)

    def _close(self, shots: int) -> Iterator[Start]:
        """Yield forward motions, changed until they close."""
        if self.problem.system.m:  # they would leave the constraints
            return
        rng = np.random.default_rng(self.seed)
        for done, c in enumerate(self.classes):
            for _ in range(CLOSED_BATCHES):  # as large and as fast as what is known by now
                self.tell("shots", done, len(self.classes), "forward shots", shots)
                before = len(self.found)
                yield from self._closing(c, shots, rng)
                if len(self.found) == before:
                    break

    def _closing(self, c: Winding, shots: int, rng: np.random.Generator) -> Iterator[Start]:
        """Yield motions from random places, slow and fast ones, that close."""
        n, T, advance = self.problem.system.n, c.problem.duration, c.problem.advance
        assert advance is not None
        rates = 2 * np.pi * (c.tr.lengths + np.abs(advance)) / T
        units = np.concatenate([c.tr.lengths, rates])
        for s, _, _ in self.found:
            known = np.abs([s.path.values, s.velocity(s.mesh.nodes)]).max(axis=2).ravel()
            units = np.maximum(units, known)
        units[list(self.loose)] = np.pi
        far = np.exp(rng.uniform(np.log(0.3), np.log(CLOSED_REACH), shots))
        y = units[:, None] * far * rng.uniform(-1, 1, (2 * n, shots))
        y[n:] += advance[:, None] / T
        for i in c.problem.start.pinned:
            y[i] = c.problem.start.q[i]
        q0, v0, closed = close(c.problem, y[:n], y[n:], units)
        for path in motions(c.problem, v0, q0) if closed.size else []:
            if path is None:
                continue
            s = (path.mesh.nodes - c.problem.start.t) / T
            miss = c.problem.closed_from(path.values[:, 0]) - path.values[:, -1]
            guess = Path(path.mesh, path.values + miss[:, None] * s)
            if self._unseen(c, c.tr.pack(guess(c.tr.mesh.nodes).T)):
                yield self._start(c, guess, "a forward shot")

    def _aim(self, v0: Array) -> Iterator[Start]:
        """Aim motions at the ends that they come near, and yield those that arrive."""
        self.tell("shots", 0, v0.shape[1])
        ends = shoot(self.problem, v0[:, None])[:, 0]
        usable = np.flatnonzero(np.isfinite(ends).all(axis=0))
        targets = [self._nearest(ends[:, k]) for k in usable]
        aimed = np.array([c is not None for c in targets], dtype=bool)
        usable, targets = usable[aimed], [c for c in targets if c is not None]
        self.tried["forward shots"] += usable.size
        if not usable.size:
            return
        goals = np.array([c.problem.end.q for c in targets], dtype=float).T
        v0, arrived = aim(self.problem, v0[:, usable], goals)
        yield from self._arrivals([targets[i] for i in arrived], v0)

    def _arrivals(self, classes: list[Winding], v0: Array) -> Iterator[Start]:
        """Yield motions with velocities v0 (n, K) that nearly arrive."""
        size = np.max(np.abs(v0), axis=1, initial=1e-300)
        known = [(c, s.start.v) for s, turns, _ in self.found
                 for c in self.classes if c.turns == turns]  # fmt: skip
        chosen = []
        for i, c in enumerate(classes):
            v = v0[:, i]
            near = SAME_VELOCITY * np.max(np.abs(v) / size)
            if all(np.max(np.abs(v - w) / size) > near for d, w in known if d is c):
                known.append((c, v))
                chosen.append(i)
        if not chosen:
            return
        for done, (i, path) in enumerate(
            zip(chosen, motions(self.problem, v0[:, chosen]), strict=True)
        ):
            self.tell("shots", done, len(chosen))
            if path is None:
                continue
            c, T = classes[i], self.problem.duration
            s = (path.mesh.nodes - self.problem.start.t) / T
            miss = np.array(c.problem.end.q, dtype=float) - path.values[:, -1]
            yield self._start(c, Path(path.mesh, path.values + miss[:, None] * s), "a forward shot")

    def _nearest(self, q: Array) -> Winding | None:
        """Return the class whose end is nearest to q, if any is near in its angles."""
        turns = tuple(
            int(np.round((q[i] - (self.problem.end.q[i] or 0.0)) / (2 * np.pi)))
            for i in self.turning
        )
        return next((c for c in self.classes if c.turns == turns), None)

    def _deflate(self, starts: int) -> Iterator[Start]:
        """Yield where Newton's method leads away from every path known, until it finds no more."""
        total = starts * len(self.classes)
        for k, (c, z) in enumerate(self._curves(starts)):
            for _ in range(4):
                self.tell("deflated starts", k, total, "deflated starts")
                away = deflate(c.tr, z, c.seen)
                path = None if away is None else self._unseen(c, away)
                if path is None:
                    break
                yield self._start(c, path, "deflation")

    def _folds(self, most: int) -> Iterator[Start]:
        """Yield the path beyond a fold that tracing each path in the end time meets."""
        t0, T = self.problem.start.t, self.problem.duration
        followed: set[tuple[int, float]] = set()
        for done, (solution, turns, _) in enumerate(self.found):  # grows on the way
            if done >= most:
                break
            c = next(c for c in self.classes if c.turns == turns)
            for factor in (EARLIEST_FOLD, LATEST_FOLD):
                if (id(solution), factor) in followed:
                    continue
                self.tell("continuations", done, min(most, len(self.found)), "continuations")
                options = {"tol": CONTINUATION_TOL, "count": False, "steps": CONTINUATION_STEPS}
                try:
                    guess = _coarser(solution.path)
                    branch = trace(c.problem, "t1", t0 + factor * T, guess=guess, **options)
                except (ValueError, SolveError) as error:
                    raise_defect(error)
                    continue
                if branch.interrupted:
                    raise KeyboardInterrupt
                if branch.returned:
                    yield self._start(c, branch.paths[-1], "continuation")
                    followed.add((id(self.last), factor))  # it would only lead back

    # -- what was found ----------------------------------------------------------------------------

    def _curves(self, count: int):
        """Yield (class, z) for curves that wave about the straight line, more and more."""
        rng = np.random.default_rng(self.seed)
        for c in self.classes:
            tr = c.tr
            s = (tr.mesh.nodes - tr.mesh.nodes[0]) / c.problem.duration
            for k in range(count):
                Q = tr.straight()
                size = np.maximum(tr.lengths, np.ptp(Q, axis=0))
                for wave in self._waves(s, rng):
                    Q = Q + k / max(count - 1, 1) * 2 * size * wave
                if self.problem.system.m:
                    Q = project(tr, Q)
                yield c, tr.pack(Q)

    def _waves(self, s: Array, rng: np.random.Generator):
        """Yield random waves (K, n) over the parts s (K,) of the time, the shorter the lower.

        They vanish at the ends; those of closed paths close, and vanish where the start is given.
        """
        n = self.problem.system.n
        if not self.closed:
            for j in (1, 2, 3):
                yield np.sin(j * np.pi * s)[:, None] * rng.standard_normal(n) / j
            return
        held = list(self.problem.start.pinned)
        yield np.where(np.isin(np.arange(n), held), 0.0, rng.standard_normal(n)) + 0 * s[:, None]
        for j in (1, 2, 3):
            turn = 2 * np.pi * j * s[:, None]
            wave = np.cos(turn) * rng.standard_normal(n) + np.sin(turn) * rng.standard_normal(n)
            wave[:, held] -= wave[0, held]
            yield wave / j

    def _resize(self, c: Winding, solution: Solution) -> None:
        """Measure the paths of a class in sizes of a first one, where the events tell none."""
        size = np.max(np.abs(solution.path.values), axis=1)
        size = np.where(np.isfinite(size) & (size > 0), size, c.problem.scales)
        mesh = c.tr.mesh
        c.tr = Transcription(c.problem, mesh, size)
        c.seen = [c.tr.pack(s(mesh.nodes).T) for s, turns, _ in self.found if turns == c.turns]

    def _start(self, c: Winding, guess: Path, how: str) -> Start:
        """Return a start, whole turns of angles that no event gives left out."""
        if self.loose:
            guess = Path(guess.mesh, self._apart(guess.values, np.zeros_like(guess.values)))
        return Start(c, guess, how)

    def _unseen(self, c: Winding, z: Array) -> Path | None:
        """Return a coarse path, None if it was seen before; it is from now on."""
        if not np.isfinite(z).all():
            return None
        Q = c.tr.coordinates(z).T
        for other in c.seen:
            apart = self._apart(Q, c.tr.coordinates(other).T)
            if np.max(np.abs(apart) / c.tr.lengths[:, None]) < SAME_COARSE_PATH:
                return None
        c.seen.append(z)
        return Path(c.tr.mesh, Q)

    def _apart(self, q: Array, other: Array) -> Array:
        """Return q - other, both (n, K), whole turns of angles that no event gives left out."""
        apart = q - other
        for i in self.loose:
            apart[i] -= 2 * np.pi * np.round(apart[i, 0] / (2 * np.pi))
        return apart

    # -- what becomes of them ----------------------------------------------------------------------

    def tell(self, stage: str, done: int, total: int, counted: str = "", by: int = 1) -> None:
        """Report how far the search is, and count what is tried. Raises as `check_time` does."""
        if counted:
            self.tried[counted] += by
        check_time()
        if self.progress is not None:
            self.progress(stage, done, total, {"found": len(self.found)})

    def answer(self, start: Start) -> None:
        """Solve from a start; keep a path that is new, closed and a motion."""
        self.last, (c, guess, how, solution) = None, start
        try:
            solution = solution or first_acceptable(c.problem, guess, self.choices)[0]
        except ValueError as error:  # numpy's LinAlgError is one
            raise_defect(error)
            if guess is None and not any(c.turns):
                self.refused = error
            return
        if not (solution.success or solution.status is Status.DEGENERATE):
            return
        timed = self.problem.free_time and not self.problem.is_joined
        if timed and not is_first(solution, self.windings):
            return
        values = self._samples(solution)
        lengths = c.tr.lengths if self.given else solution.problem.lengths
        size = np.maximum(np.max(np.abs(values), axis=1), lengths * 1e-3)[:, None]
        near = max(SAME_PATH, SURE * self.tol)
        for other, turns in [(s, turns) for s, turns, _ in self.found] + self.kinked:
            if turns != c.turns or abs(other.duration / solution.duration - 1) > near:
                continue
            # One curve passes a place more than once: at which time it does is another answer.
            late = np.abs(times_of(other.problem) - times_of(solution.problem)).max()
            same = np.max(np.abs(self._apart(self.samples[id(other)], values)) / size) < near
            if same and not late > near * solution.duration:
                self.last = other
                return
        family = not _is_determined(solution)
        if family:
            largest = np.abs(values).max(axis=1) / np.maximum(solution.problem.scales, lengths)
            if not largest.max() < FAMILY_REACH:
                return
            for other, turns in self.families:
                if turns == c.turns and self._same_action(other, solution):
                    self.last = other
                    return
        if not (self.problem.system.r or _is_motion(solution)):
            self.rejected += 1
            return
        self.samples[id(solution)] = values
        if self.closed and not (self.problem.is_joined or _closes(c, solution)):
            self.kinked.append((solution, c.turns))
            return
        if family:
            self.families.append((solution, c.turns))
        else:
            self.found.append((solution, c.turns, how))
        if self.given:
            nodes = c.tr.mesh.nodes
            lam = solution.multipliers(nodes).T if solution.lam.size else None
            c.seen.append(c.tr.pack(solution(nodes).T, lam))
        self.last = solution

    def _samples(self, solution: Solution) -> Array:
        """Return the coordinates (n, K) at fixed parts of the duration, to compare paths."""
        return solution(solution.start.t + PARTS * solution.duration)

    def _same_action(self, one: Solution, other: Solution) -> bool:
        """Whether two paths may be of one family: along it S is the same, but under forces."""
        if self.problem.system.structure.forced:
            return True
        size = max(abs(one.action), abs(other.action), other.discrete.tr.action_unit)
        return abs(one.action - other.action) < SAME_ACTION * size


def _is_determined(solution: Solution) -> bool:
    """Whether the ends determine a path, to second order in its neighbours."""
    if solution.status is Status.DEGENERATE:
        return False
    try:
        return solution.inertia.nullity == 0
    except ValueError:  # forced: there is no index, and the verdict alone tells
        return True


def _is_motion(solution: Solution) -> bool:
    """Whether forward integration from the start of a solution does not contradict it."""
    plain = not (solution.problem.through or solution.problem.system.order > 1)
    try:
        agrees = is_motion(solution) if plain else solution.compare().agrees
    except (IntegrationError, ValueError):  # no motion leaves from its start, or none gets far
        return False
    return agrees is None or bool(agrees)


def _closes(c: Winding, solution: Solution) -> bool:
    """Whether the momenta return: where the start gives a coordinate, nothing asks that of its."""
    unit = c.tr.action_unit / c.tr.lengths
    size = np.max(np.abs(solution.momentum(solution.mesh.nodes)), axis=1)
    p0, p1 = solution.momenta
    return bool(
        np.all(
            np.abs(p1 - p0[list(c.problem.closed_places)])
            <= SAME_FIRST * np.maximum(size, 1e-3 * unit)
        )
    )


def raise_defect(error: Exception) -> None:
    """Re-raise errors that indicate a bug rather than an unsolvable problem."""
    verdict = isinstance(error, (SolveError, np.linalg.LinAlgError))
    if not verdict and not str(error).startswith("expected"):
        raise error


def _coarser(path: Path) -> Path:
    """Return the path with polynomials of two thirds their degree."""
    degrees = np.maximum(np.array(path.mesh.degrees) * 2 // 3, 4)
    return path.on(path.mesh.cut(path.mesh.since, degrees))
