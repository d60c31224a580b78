"""Find a path by a sequence of fallback strategies, from the straight line or from a guess.

Without a guess the search is for a least path where there may be one, else for a stationary one;
with a guess, for the stationary path near it. Linear equations of motion need no search: their
discrete problem is one linear system.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from actionopt.analysis.solution import Solution
from actionopt.analysis.status import Status
from actionopt.discrete.boundaries import with_boundaries
from actionopt.discrete.element import with_degrees
from actionopt.discrete.mesh import Mesh
from actionopt.discrete.path import Path
from actionopt.discrete.resolution import DEGREES, Resolution, cheapest_mesh, resolution
from actionopt.discrete.transcription import Transcription
from actionopt.mechanics.problem import Problem
from actionopt.solver.first_mesh import (
    COARSE_DEGREE,
    COARSE_ELEMENTS,
    LINEAR,
    fewest_elements,
    plan_layers,
    plan_mesh,
)
from actionopt.solver.ipopt import IPOPT_SIZE
from actionopt.solver.iterate import Iterate, sizes
from actionopt.solver.refine import refine, solve_on
from actionopt.solver.signals import LEADS_NOWHERE
from actionopt.solver.two_sided_shooting import curves
from actionopt.solver.window import graded_mesh, step
from actionopt.solver.workspace import FEW_COORDINATES, FOLLOWED_REACH, ROUGHLY, Workspace
from actionopt.tools.watch import OutOfTime, Watch

UNSOLVED = (Status.NOT_FOUND, Status.UNRESOLVED, Status.DEGENERATE)
REACHED = (Status.SOLVED, Status.FLOOR)
# Total budget, in evaluations of second derivatives on one element, of the strategies that cost
# EXPENSIVE or more. Half the paths found by a homotopy, by two-sided shooting or by patience take
# less than 3000 (28 of 270 random systems and pendulums of 1 to 20 coordinates, at most 12,000; of
# 650 others of up to 4 coordinates four took from 15,800 to 18,300, and none more of 350 that were
# given 60,000).
BUDGET, EXPENSIVE = 20_000, 500
# Ad hoc, where nothing else is said.
# Beyond which Ipopt takes far longer than a descent; up to it, it keeps nearer to the line, and a
# few hundred motions are many.
DESCENT_COORDINATES = 8
# Up to which other ways are shorter. Measured on pendulums of n links: at 30 the path beside the
# line is found by nothing else, at 50 in half the time; three bodies would take thrice as long.
RESONANT_COORDINATES = 20
# Of a curved line, in the motion's sizes ("flat" here is as in `workspace`: this is).
CURVED_HEIGHT = 0.4
LOST_ALIKE = 1e-3  # of a path's size, what leads to the same meshes again
# Motions that meet: pairs that are tried, and elements of one that takes too long.
MEETING_PAIRS, MEETING_ELEMENTS = 32, 48
# Paths so found that cannot be refined, after which no others found alike are tried: measured, over
# random systems and pendulums, it is the first that can be, or none.
MEETING_LOST = 3
PATIENT = 30  # damped steps towards a path near a guess: whatever else there is costs more
GUESS_MESHES = (16, 32, 64)  # elements: a guess has features that coarser meshes would miss
# Elements tried before, of a guess, and of Newton's method where coordinates are many.
# Measured on chains, bodies and lattices: half the time and a third of it less, at any tolerance.
COARSE_GUESS, FIRST_FEW = (4, 8), 2
# Unknowns and rows from which a rough path settles on its surface before Newton's method is tried,
# which takes three factorizations to fail; ad hoc: from there one takes a seventh of a second.
SETTLED_FIRST = 20_000
# Omitted coefficients of a guess that a mesh resolves, flat; refinements of one that does not.
GUESS_RESOLUTION, GUESS_ROUNDS = 1e-3, 4


@dataclass(frozen=True)
class Strategy:
    """A way to a first path, from the straight line or a curved one.

    Attributes
    ----------
    name : str
    meshes : tuple of int
        Numbers of elements of the meshes on which it is tried in turn.
    minimises : bool
        Whether what it finds is a least path. Such a strategy is tried only as long as there may be
        one, others only as long as no saddle is in hand.
    steep : bool
        Whether a mesh that may resolve the path at once is worth its cost.
    lengthy : bool
        Whether it takes hundreds of factorizations: the last resort where each costs much.
    persistent : bool
        Whether it may succeed on a finer mesh where it fails on a coarse one.
    curves : bool
        Whether curved lines are tried before what costs more, where its path cannot be refined.
    reliable : bool
        Whether a rough path on the last of its meshes is worth refining.
    cost : int
        Second derivatives on one element, in the time of which it succeeds as a rule; measured on
        lattices and pendulums of 1 to 5 coordinates.
    """

    name: str
    meshes: tuple[int, ...]
    minimises: ClassVar[bool] = False
    steep: ClassVar[bool] = False
    lengthy: ClassVar[bool] = False
    persistent: ClassVar[bool] = True
    curves: ClassVar[bool] = False
    reliable: ClassVar[bool] = True
    cost: ClassVar[int] = 20

    def applies(self, search: Search) -> bool:
        """Whether the way is open to the problem, and worth its time."""
        return search.may_be_least if self.minimises else search.saddle is None

    def seek(self, ws: Workspace) -> bool:
        """Move the iterate at hand to a stationary path of its mesh; False if that fails."""
        raise NotImplementedError

    def attempt(self, search: Search) -> Status:
        """Find a path that can be refined to the tolerance."""
        return search.on_meshes(self)


@dataclass(frozen=True)
class Newton(Strategy):
    """Damped Newton steps: next to no cost, and known at once whether they lead anywhere.

    Those from where the action is `convex` hardly ever fail.
    """

    convex: bool = False
    steep = True

    def applies(self, search: Search) -> bool:
        if self.convex:
            return search.may_be_least and search.ws.can_descend
        return super().applies(search)

    def seek(self, ws: Workspace) -> bool:
        return ws.approach(convex=self.convex)


@dataclass(frozen=True)
class Descent(Strategy):
    """Descent in the kinetic metric: robust and quick, and sees where S is not bounded below.

    With `many` coordinates a step costs more than Newton's method from the line, which may come
    first then.
    """

    many: bool = False
    minimises, persistent, curves, cost = True, False, True, 100

    def applies(self, search: Search) -> bool:
        ws, n = search.ws, search.ws.problem.system.n
        fits = n > DESCENT_COORDINATES if self.many else ws.can_descend
        return super().applies(search) and ws.problem.system.m == 0 and fits

    def seek(self, ws: Workspace) -> bool:
        return ws.descend()


class Least(Strategy):
    """Ipopt minimises: under constraints, and where the descent is lost."""

    minimises, persistent, cost = True, False, 500

    def seek(self, ws: Workspace) -> bool:
        return ws.find("least")


class PatientLeast(Least):
    """The same for a minimum down a long curved valley."""

    persistent, cost = True, 4000

    def applies(self, search: Search) -> bool:
        # With a saddle in hand a long search on a large system is not worth it.
        small = search.saddle is None or search.saddle[0] == "meeting" or not search.ws.large
        return super().applies(search) and small and search.ws.has_mass

    def seek(self, ws: Workspace) -> bool:
        return ws.find("patient least")


class Homotopy(Strategy):
    """Newton homotopy from the straight line: gets to a saddle slowly but surely.

    On one mesh: on finer ones it took long and found no path that no other strategy did. It comes
    before motions that meet, which may be quicker, because small changes of the question change
    nothing in what it finds.
    """

    lengthy, reliable, cost = True, False, 1500

    def seek(self, ws: Workspace) -> bool:
        return ws.homotopy()


class LyapunovSchmidt(Strategy):
    """Newton steps that hold the few of many modes that are near a resonance, and free them later.

    What is found is a saddle as a rule: other modes are beyond their first resonance.
    """

    cost = 200

    def applies(self, search: Search) -> bool:
        system = search.ws.problem.system
        return super().applies(search) and system.n > RESONANT_COORDINATES and system.m == 0

    def seek(self, ws: Workspace) -> bool:
        return ws.pass_resonances()


class ComponentNewton(Strategy):
    """Newton steps that are limited place by place, in lattices."""

    cost = 1000

    def applies(self, search: Search) -> bool:
        ws = search.ws
        local = ws.problem.system.n > RESONANT_COORDINATES and ws.sparse
        return super().applies(search) and local and plain(ws.problem)

    def seek(self, ws: Workspace) -> bool:
        return ws.settle_places()


class TwoSidedShooting(Strategy):
    """Motions that hit the end, and some from both that nearly meet half way; so many as `meshes`.

    They are near a path however far that is from the line, and in less time than a homotopy takes
    on fine meshes.
    """

    cost = 3000

    def applies(self, search: Search) -> bool:
        problem = search.ws.problem
        few = problem.system.n <= DESCENT_COORDINATES
        return super().applies(search) and few and plain(problem) and not search.curved

    def attempt(self, search: Search) -> Status:
        ws = search.ws
        first = ws.iterate
        try:
            status = self._refine_first(search)
        except LEADS_NOWHERE:
            ws.iterate = first
            raise
        if status is Status.NOT_FOUND:  # motions drawn at random are nothing to go on from
            ws.iterate = first
        return status

    def _refine_first(self, search: Search) -> Status:
        """Refine the first of the curves that Newton's method takes to a path."""
        ws = search.ws
        for guesses in curves(ws.problem, self.meshes, MEETING_PAIRS, ws.watch):
            left, elements, lost = MEETING_PAIRS * IPOPT_SIZE, [], 0
            for guess in guesses:
                ws.restart()
                ws.record.rounds.clear()
                ws.transcribe(guess.mesh, guess, like=guess)
                elements.append(guess.mesh.elements)
                left -= max(ws.here.tr.layout.size, IPOPT_SIZE)
                if ws.approach(PATIENT):
                    saddle = search.may_be_least and ws.here.index > 0
                    status = search.refine()
                    if status.success or status is Status.FLOOR:
                        if not saddle:
                            return status
                        search.saddle = self.name, ws.here.bare()
                        return Status.NOT_FOUND
                    if ws.unbalance:
                        return status
                    lost += 1
                if left < 0 or lost == MEETING_LOST:
                    break
            if min(elements, default=0) > MEETING_ELEMENTS:
                break  # more of these would take too long
        return Status.NOT_FOUND


def plain(problem: Problem) -> bool:
    """Whether all coordinates are given at both events, and nothing constrains them."""
    n, first_order = problem.system.n, problem.system.order == 1
    given = len(problem.start.pinned) == n == len(problem.end.pinned)
    return given and problem.system.m == 0 and first_order


class Root(Strategy):
    """Ipopt solves the stationarity conditions: no path need be near.

    No other strategy solves seven of 23 random problems on a Toda lattice of 15 masses, and some
    problems with forces or with kinetic energies of both signs, where no path is least.
    """

    cost = 500

    def seek(self, ws: Workspace) -> bool:
        return ws.root()


# How a first path is sought from the straight line. Newton's method comes first where the action
# is convex there; elsewhere descent, where the action may be bounded below. The elements, measured
# alike: half as many everywhere take 7 % more iterations, and lose an extreme case; twice as many
# 2 % less, in more time. Half or twice the motions that meet change nothing.
STRATEGIES: tuple[Strategy, ...] = (
    Newton("convex newton", (4,), convex=True),
    Descent("descent", (COARSE_ELEMENTS, 16, 32, 64)),
    Newton("newton", (4,)),
    LyapunovSchmidt("resonance", (4,)),
    Descent("descent of many", (4, 8, 16, 32, 64), many=True),
    ComponentNewton("places", (4,)),
    Least("least", (8, 16, 32, 64)),
    Homotopy("continuation", (8,)),
    Root("stationary", (8, 16)),
    TwoSidedShooting("meeting", (256, 768)),
    PatientLeast("patient least", (8, 16, 32, 64)),
)
# Strategies that are tried from a curved line: those before what costs more, and all of them.
CURVED_FIRST, CURVED_STRATEGIES = (
    1 + [strategy.name for strategy in STRATEGIES].index(last) for last in ("descent", "least")
)
# By Ipopt alone: what can be had without methods of our own.
IPOPT: tuple[Strategy, ...] = (
    Least("least", (8, 16, 32, 64)),
    Root("stationary", (8, 16, 32)),
    PatientLeast("patient least", (8, 16, 32, 64)),
)
CHEAP = STRATEGIES[:2]  # what takes some hundredths of a second, whatever comes of it
GUESS_ONLY: tuple[Strategy, ...] = ()  # do not search away from the guess


@dataclass(eq=False)
class Search:
    """What is sought: a path to `tol` that obeys `principle`, on the mesh `given` if there is one.

    `found_by` says which way it was found in the end, `least` whether by minimising.
    """

    ws: Workspace
    tol: float
    principle: str
    given: Mesh | None
    strategies: tuple[Strategy, ...] = STRATEGIES
    found_by: str = ""
    least: bool = False
    curved: bool = False  # whether a path is sought from a curved line
    may_be_least: bool = False
    around: Search | None = None  # the same from a curved line, once it was begun
    lost: list[tuple[bool, Iterate]] = field(default_factory=list)  # what could not be refined
    saddle: tuple[str, Iterate] | None = None  # found while a least path was sought
    budget: float = math.inf  # elements evaluated after which nothing expensive is tried
    settle: Path | None = None  # what became of a guess on a mesh that may be too coarse
    tried: list[str] = field(default_factory=list)

    # -- without a guess -----------------------------------------------------------------------

    def from_nothing(self) -> Status:
        """Find a path with no guess, by the strategies in turn, and refine it.

        A straight line may be a trap: through the centre of a force or of a circle, symmetry keeps
        every path on it that is sought from there. Then a curved one is tried.
        """
        self.may_be_least = self._may_be_least
        watch = self.ws.watch
        try:
            status = self._try(self.strategies)
            self.ws.ensure_iterate()
            if status in UNSOLVED:
                again = self._from_curve(CURVED_STRATEGIES)
                return again if again in REACHED else status
            return status
        finally:
            if watch is not None:
                watch.most = math.inf  # other searches may follow

    def _from_curve(self, strategies: int) -> Status:
        """Try so many strategies from a curved line, those that were tried left out.

        What fails leaves nothing but a path that was near.
        """
        if self.curved or self.ws.problem.system.n == 1 or self._large:
            return Status.NOT_FOUND
        around, done = self.around, CURVED_FIRST
        if around is None:
            given = self.tol, self.principle, self.given, self.strategies
            around = Search(self.ws.again(), *given, curved=True, lost=self.lost)
            self.around, done = around, 0
            around.may_be_least = self._may_be_least
        around.budget, ws = self.budget, around.ws
        try:
            status = around._try(self.strategies[done:strategies])
        except OutOfTime:
            self.ws.best = ws.best or self.ws.best
            raise
        if status in REACHED:
            self._take(around)
        else:
            self.ws.unpolished = self.ws.unpolished or ws.unpolished
        return status

    def _take(self, other: Search) -> None:
        """Go on with what another search for the same path has found."""
        other.ws.record = other.ws.record.after(self.ws.record)
        self.ws, self.found_by, self.least = other.ws, other.found_by, other.least

    @property
    def _may_be_least(self) -> bool:
        """Whether a least path is wanted, and a force does not rule it out."""
        return self.principle != "stationary" and not self.ws.problem.system.structure.forced

    @property
    def _large(self) -> bool:
        """Whether even the coarsest mesh has many unknowns."""
        return self.ws.problem.system.n * COARSE_DEGREE * COARSE_ELEMENTS > IPOPT_SIZE

    def _try(self, strategies: tuple[Strategy, ...]) -> Status:
        """Try the strategies in turn until one leads to a path that can be refined.

        Where that is a saddle, and it cannot, those are tried that it made needless.
        """
        status, large, left = Status.NOT_FOUND, self._large, list(strategies)
        for strategy in self._in_order(
            sorted(strategies, key=lambda strategy: large and strategy.lengthy)
        ):
            try:
                if not strategy.applies(self):  # which may take second derivatives
                    continue
                left.remove(strategy)
                if strategy.cost >= EXPENSIVE:
                    self._limit(strategy.cost)
                self.begin(strategy.name, strategy.minimises)
                status = strategy.attempt(self)
            except LEADS_NOWHERE:
                status = Status.NOT_FOUND
                if self._is_exhausted:
                    break
            if strategy.curves and status is Status.UNRESOLVED:
                around = self._from_curve(CURVED_FIRST)  # before what costs more
                status = around if around in REACHED else status
            if status is Status.UNBOUNDED:
                if self.principle == "least":
                    return status
                self.may_be_least = False
                status = self._refine_saddle()
            elif self.saddle is not None and self.principle == "auto" and large:
                # A least path is not worth many times the saddle in hand.
                status = self._refine_saddle()
            if status not in (Status.NOT_FOUND, Status.UNRESOLVED) or self.ws.unbalance:
                return status
        if self.saddle is None or self.principle != "auto":
            return status
        status = self._refine_saddle()
        return self._try(tuple(left)) if status in UNSOLVED else status

    def _limit(self, cost: int) -> None:
        """Let what is tried from now on cost no more than `BUDGET`, where ways have a cost.

        With a saddle in hand no more than the cost of the way.
        """
        watch = self.ws.watch = self.ws.watch or Watch(None, None)
        if not watch.has_costs or self.curved:
            return
        if self.budget == math.inf:
            self.budget = watch.evaluated + BUDGET
        watch.most = self.budget
        if self.saddle is not None and self.principle == "auto":
            watch.most = min(self.budget, watch.evaluated + cost)

    @property
    def _is_exhausted(self) -> bool:
        """Whether nothing is left, and not only what one way may cost."""
        watch = self.ws.watch
        if watch is None:
            return False
        spent = watch.evaluated > self.budget
        watch.most = math.inf if spent else self.budget
        return spent

    def _in_order(self, strategies: Iterable[Strategy]) -> Iterator[Strategy]:
        """Yield the strategies in turn, last those that the time left does not allow for.

        Before these others that minimise once a least path was lost, as it will be again, unless a
        saddle is in hand by then.
        """
        watch, again, expensive = self.ws.watch, [], []
        for strategy in strategies:
            if watch is not None and not watch.affords(strategy.cost):
                expensive.append(strategy)
            elif strategy.minimises and any(least for least, _ in self.lost):
                again.append(strategy)
            else:
                yield strategy
        if self.saddle is None or self.principle != "auto":
            yield from again
        yield from expensive

    def _refine_saddle(self) -> Status:
        """Refine the saddle that was found while a least path was sought, if there is one."""
        if self.saddle is None:
            return Status.NOT_FOUND
        (name, found), self.saddle = self.saddle, None
        self.begin(name)
        if self.ws.watch is not None:
            self.ws.watch.most = math.inf
        if self.ws.here.z is not found.z:
            self.ws.record.rounds.clear()
            self.ws.here = found
            if not self.ws.follow():
                return Status.NOT_FOUND
        return self.refine()

    def on_meshes(self, strategy: Strategy) -> Status:
        """Seek a path on finer and finer meshes until one resolves it roughly, and refine it.

        A mesh too coarse for the motion has stationary points of its own that are no paths, or
        holds a path where it should not be: such a path is lost under refinement. A
        least path on a mesh twice as fine starts from it, others from the straight line.
        """
        ws, status, known = self.ws, Status.NOT_FOUND, None
        ws.record.rounds.clear()
        # Motions of many coordinates may be too fast for the coarsest meshes.
        many = ws.many_coordinates and not ws.problem.system.m
        few, first = (
            fewest_elements(ws.problem) if many else 0,
            (FIRST_FEW,) if many and strategy.steep else (),
        )
        meshes = sorted({max(elements, few) for elements in (*first, *strategy.meshes)})
        for elements in meshes:
            ws.restart()
            mesh = self._uniform(elements, self._fine_degree() if strategy.steep else COARSE_DEGREE)
            ws.transcribe(
                mesh, known or (self._curved_line(mesh) if self.curved else self._step(mesh))
            )
            if not strategy.seek(ws):
                if (
                    strategy.minimises and ws.unbounded and ws.problem.system.F is None
                ):  # F^2 is not
                    return Status.UNBOUNDED
                if not strategy.persistent:
                    return Status.NOT_FOUND
                known = None
                continue
            if ws.here.rough > ROUGHLY and (elements != meshes[-1] or not strategy.reliable):
                known = ws.here.path if strategy.minimises else None
                continue
            if not strategy.minimises and self.may_be_least and ws.here.index > 0:
                # There may be a least path yet; this one is kept in case there is not.
                self.saddle = self.saddle or (strategy.name, ws.here.bare())
                return Status.NOT_FOUND
            if self._lost_before():
                status = Status.UNRESOLVED
                continue
            found = ws.here.bare()
            status = self.refine()
            if status is not Status.UNRESOLVED:
                break
            self.lost.append((self.least, found))
            if ws.has_kink:  # so it is on finer meshes
                break
        return status

    def _lost_before(self) -> bool:
        """Whether the path at hand is one of those that could not be refined, by the same means."""
        here = self.ws.here
        return any(
            (least or not self.least)
            and here.x.shape == lost.x.shape
            and here.mesh.since.tobytes() == lost.mesh.since.tobytes()
            and np.abs(here.x - lost.x).max() < LOST_ALIKE
            for least, lost in self.lost
        )

    # -- from a guess --------------------------------------------------------------------------

    def from_neighbour(self, neighbour: Solution) -> Status:
        """Follow a path of the system as its ends move to these, where nothing else differs."""
        ws, problem, old = self.ws, self.ws.problem, neighbour.problem
        same = (
            (old.start.t, old.end.t) == (problem.start.t, problem.end.t)
            and (old.start.pinned, old.end.pinned) == (problem.start.pinned, problem.end.pinned)
            and old.advance is None is problem.advance
            and self.given in (None, neighbour.mesh)
        )
        self.begin("linear" if ws.linear else "guess")
        if not same or not ws.continue_from(neighbour.discrete):
            return Status.NOT_FOUND
        near = (not ws.astray and ws.follow()) or ws.approach(PATIENT)
        return self.refine() if near else Status.NOT_FOUND

    def from_guess(self, curve_of: Callable[[Mesh], Path], seen: Mesh | None = None) -> Status:
        """Follow the guess, or find the stationary path near it, or continue from it.

        Of the guess only the nodes of `seen` are known, if it is given.
        """
        self.begin("guess")
        status = self._from_few(curve_of)
        if status not in (Status.NOT_FOUND, Status.UNRESOLVED):
            return status
        meshes = self._fine_enough(curve_of)
        for coarse in meshes:
            curve = self.settle or curve_of(coarse)
            own = curve.mesh is not coarse and coarse.elements == GUESS_MESHES[0]
            mesh = self.given or (curve.mesh if own else coarse)
            self.ws.transcribe(mesh, curve, like=curve)
            near = self._near()
            if not near and coarse is meshes[0]:
                found = self._quickly_past(curve_of(seen or coarse))
                if found in REACHED:
                    return found
            near = near or self._continue(far=coarse in (meshes[0], meshes[-1]))
            if near:
                status = self.refine()
                if status is not Status.UNRESOLVED:
                    break
        return status

    def _quickly_past(self, seen: Path) -> Status:
        """Seek a path by quick ways from nothing, if it passes near the nodes of the guess `seen`.

        A guess of few points that misses the turns of a motion leads nowhere by itself.
        """
        if self.strategies in (IPOPT, GUESS_ONLY) or self.given is not None:
            return Status.NOT_FOUND
        other = Search(self.ws.again(), self.tol, self.principle, None, CHEAP)
        other.may_be_least = self._may_be_least
        status = other._try(CHEAP)
        if status in REACHED:
            here = other.ws.here
            away = np.abs(here.path(seen.mesh.nodes) - seen.values).max(axis=1)
            if np.any(away > FOLLOWED_REACH * here.sizes):
                return Status.NOT_FOUND
            self._take(other)
        return status

    def _from_few(self, curve_of: Callable[[Mesh], Path]) -> Status:
        """Follow the guess on few elements that show all of it."""
        ws = self.ws
        if self.given is not None or self.strategies is IPOPT:
            return Status.NOT_FOUND
        fine = self._uniform(GUESS_MESHES[0], COARSE_DEGREE)
        curve = curve_of(fine)
        if curve.mesh is not fine:
            return Status.NOT_FOUND
        hidden = GUESS_RESOLUTION * sizes(curve.values.T, ws.problem.scales)[:, None]
        for elements in COARSE_GUESS:
            few = curve_of(self._uniform(elements, self._fine_degree()))
            if np.all(np.abs(few.on(fine).values - curve.values) <= hidden):
                ws.transcribe(few.mesh, few, like=few)
                near = self._settles() and ws.here.rough < ROUGHLY
                return self.refine() if near else Status.NOT_FOUND
        return Status.NOT_FOUND

    def _near(self) -> bool:
        """Move the iterate at hand to the stationary path near it."""
        ws, first = self.ws, self.ws.here
        if self.strategies is IPOPT:
            return ws.root()
        if self._settles():
            return True
        settled, self.settle = ws.here, ws.here.path
        if ws.problem.system.m:  # damped steps may leave the surface, and come to another path
            for here in (settled, first):
                ws.here = here
                if ws.approach(PATIENT):
                    return True
            ws.here = settled
        return False

    def _continue(self, *, far: bool) -> bool:
        """Continue from the iterate at hand; `far` by what takes longest, too.

        That is worth it on the first mesh, and on the one that shows most of the guess.
        """
        ws = self.ws
        if self.strategies in (IPOPT, GUESS_ONLY):
            return False
        return ws.root() or (far and not ws.large and ws.homotopy())

    def _settles(self) -> bool:
        """Move the iterate at hand to the stationary path next to it, as far as that is quick."""
        ws = self.ws
        if ws.problem.system.m == 0:
            return ws.follow() or ws.approach(PATIENT) or ws.settle()
        if ws.here.tr.layout.size < SETTLED_FIRST:
            return ws.follow() or ws.settle()
        first = ws.here  # its multipliers lead astray, as a rule
        if ws.settle():
            return True
        settled, ws.here = ws.here, first
        if ws.follow():
            return True
        ws.here = settled
        return False

    def _fine_enough(self, curve_of: Callable[[Mesh], Path]) -> list[Mesh]:
        """Return the meshes to try: uniform ones that resolve the guess, or else one made for it.

        A motion of many turns is lost on a mesh that misses them; a kink is resolved by none.
        """
        meshes = [self._uniform(elements, COARSE_DEGREE) for elements in GUESS_MESHES]
        for k, mesh in enumerate(meshes):
            curve = curve_of(mesh)
            shown = self._resolution_of(curve)
            if curve.mesh is not mesh or shown.worst < GUESS_RESOLUTION:
                return meshes[k:]
        for _ in range(GUESS_ROUNDS):  # a core may be far shorter than the way
            mesh = cheapest_mesh(shown, GUESS_RESOLUTION / 2)
            if mesh.nodes.size > meshes[-1].nodes.size:
                break
            shown = self._resolution_of(curve_of(mesh))
            if shown.worst < GUESS_RESOLUTION:
                return [mesh, *meshes]
        return meshes

    def _resolution_of(self, curve: Path) -> Resolution:
        """Return what the mesh of a curve resolves of it."""
        values = curve.values.T
        return resolution(curve.mesh, values, sizes(values, self.ws.problem.scales))

    # -- linear equations ------------------------------------------------------------------------

    def solve_linear(self, curve_of: Callable[[Mesh], Path] | None) -> Status:
        """Solve linear equations; of a guess only the mesh is of use."""
        self.begin("linear")
        mesh, free = self.given, self.given is None and curve_of is None
        steady = self.ws.problem.system.structure.steady
        planned = self.ws.problem.system.order == 1  # from rates at which motions turn and decay
        if planned and free and steady:
            mesh = plan_mesh(self.ws.problem, self.tol, LINEAR)
        elif mesh is None:
            one = not planned and self.ws.problem.advance is None  # is the whole of a cubic
            mesh = self._uniform(1 if one else LINEAR, self._fine_degree())
            mesh = curve_of(mesh).mesh if curve_of is not None else mesh
        self.ws.transcribe(mesh, None)
        if planned and free and not steady:
            mesh = plan_layers(self.ws.here.tr, self.ws.here.z)
            if mesh is not None:
                self.ws.transcribe(mesh, None)
        return self.refine() if self.ws.follow() else Status.DEGENERATE

    def begin(self, name: str, least: bool = False) -> None:
        """Say which way is tried now."""
        self.found_by, self.least = name, least
        self.tried.append(name)
        if self.ws.watch is not None:
            self.ws.watch.how = name

    # -- both ------------------------------------------------------------------------------------

    def _uniform(self, elements: int, degree: int) -> Mesh:
        problem = self.ws.problem
        if problem.has_tails:
            return graded_mesh(problem, elements, degree)
        return Mesh.uniform(problem.start.t, problem.end.t, elements, degree)

    def _curved_line(self, mesh: Mesh) -> Path:
        """Return a line between the events curved to one side in every coordinate."""
        problem = self.ws.problem
        mesh = with_boundaries(with_degrees(mesh, problem.system.order), problem.boundaries)
        Q = Transcription(problem, mesh, problem.lengths).straight()
        s = mesh.nodes_since / mesh.duration
        side = problem.lengths * np.cos(np.arange(1.0, 1.0 + problem.system.n))  # no symmetry's own
        return Path(mesh, (Q + CURVED_HEIGHT * np.sin(np.pi * s)[:, None] * side).T)

    def _step(self, mesh: Mesh) -> Path | None:
        """Return a step from rest to rest over a window; None elsewhere, for the straight line."""
        found = step(self.ws.problem) if self.ws.problem.has_tails else None
        return None if found is None else Path.interpolate(found, mesh)

    def _fine_degree(self) -> int:
        """Return a degree with which a few elements of a smooth path may meet the tolerance.

        About one degree a digit. A second mesh costs more where the coordinates are few.
        """
        if self.ws.problem.system.n > FEW_COORDINATES:
            return COARSE_DEGREE
        wanted = max(COARSE_DEGREE, -np.log10(self.tol) + 3)
        return int(DEGREES[min(np.searchsorted(DEGREES, wanted), DEGREES.size - 1)])

    def refine(self) -> Status:
        """Refine the path at hand to the tolerance, or judge it on the mesh that was given."""
        watch = self.ws.watch
        if watch is None:
            return self._refine()
        most, watch.most = watch.most, math.inf  # a path in hand is not given up
        status = self._refine()
        watch.most = most
        return status

    def _refine(self) -> Status:
        if self.given is not None:
            return solve_on(self.ws, self.given, least=self.least)
        return refine(self.ws, self.tol, least=self.least)
