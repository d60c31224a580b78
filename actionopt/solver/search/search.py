"""Seek a path by one strategy after the other, on finer and finer meshes, within a budget.

Without a guess the search is for a least path where there may be one, else for a stationary one.
Linear equations of motion need no search: their discrete problem is one linear system. What the
strategies are says `strategies`, what is done with a guess `near_guess`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from actionopt.analysis.status import Status
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.meshes.boundaries import with_boundaries
from actionopt.discrete.meshes.element import with_degrees
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.meshes.resolution import DEGREES
from actionopt.discrete.newton.increments import is_stiff
from actionopt.solver.refinement.first_mesh import (
    COARSE_DEGREE,
    COARSE_ELEMENTS,
    IPOPT_SIZE,
    LINEAR,
    PHASE_PER_ELEMENT,
    fewest_elements,
    plan_layers,
    plan_mesh,
)
from actionopt.solver.refinement.iterate import Iterate
from actionopt.solver.refinement.refine import even_mesh, refine, solve_on
from actionopt.solver.refinement.signals import LEADS_NOWHERE
from actionopt.solver.refinement.workspace import (
    FEW_COORDINATES,
    FOLLOWED_REACH,
    PATIENT,
    ROUGHLY,
    Workspace,
)
from actionopt.tools.immutable import immutable
from actionopt.tools.types import EPS, Array
from actionopt.tools.watch import OutOfTime, Watch

UNSOLVED = (Status.NOT_FOUND, Status.UNRESOLVED, Status.DEGENERATE)
REACHED = (Status.SOLVED, Status.FLOOR)
# Total budget, in evaluations of second derivatives on one element, of the strategies that cost
# EXPENSIVE or more. Half the paths found by a homotopy, by two-sided shooting or by patience take
# less than 3000 (28 of 270 random systems and pendulums of 1 to 20 coordinates, at most 12,000; of
# 650 others of up to 4 coordinates four took from 15,800 to 18,300, and none more of 350 that were
# given 60,000).
BUDGET, EXPENSIVE = 20_000, 500
# How many strategies, in their order, are tried from a curved line, too: those that cost little,
# before others from the straight one, and all to which it means anything.
CURVED_FIRST, CURVED_STRATEGIES = 2, 9
# How far a curved line is from the straight one, in the motion's sizes; ad hoc, flat (`workspace`).
CURVED_HEIGHT = 0.4
# Of that curve, by which a descent from the line begins beside it, where a symmetry would keep it
# from falling: of twice as many steps on 20 masses. It found what a descent from the line finds.
OFF_LINE = 0.125
# Elements by `uneven_elements` from where on the lightest is below the round-off of the heaviest.
BLIND = -math.log(EPS) / PHASE_PER_ELEMENT
FAR_DOWN = 32.0  # sizes from where it is not expected back; ad hoc
# Of a descent that is to end so, sizes from where it is asked whether it does. Measured on 20
# random questions: 8 tell the same a third later.
NEAR_OUT = 2.0
# Elements tried before others where coordinates are many. Measured on chains, bodies and lattices:
# a third less time, at any tolerance.
FIRST_FEW = 2


@immutable
class Strategy:
    """A way to a first path, from the straight line or a curved one."""

    name: str
    meshes: tuple[int, ...]  # numbers of elements of the meshes on which it is tried in turn
    # Whether what it finds is a least path. Such a strategy is tried only as long as there may be
    # one, others only as long as no saddle is in hand.
    minimises: ClassVar[bool] = False
    # Whether a mesh that may resolve the path at once is worth its cost.
    steep: ClassVar[bool] = False
    # Whether it takes hundreds of factorizations: the last resort where each costs much.
    lengthy: ClassVar[bool] = False
    # Whether it may succeed on a finer mesh where it fails on a coarse one.
    persistent: ClassVar[bool] = True
    # Whether curved lines are tried before what costs more, where its path cannot be refined.
    curves: ClassVar[bool] = False
    # Whether a rough path on the last of its meshes is worth refining.
    reliable: ClassVar[bool] = True
    # Whether it compares actions, or forces in one unit: where inertias are uneven, what is light
    # is below their round-off.
    absolute: ClassVar[bool] = True
    # Second derivatives on one element, in the time of which it succeeds as a rule; measured on
    # lattices and pendulums of 1 to 5 coordinates.
    cost: ClassVar[int] = 20

    def meshes_for(self, search: Search) -> tuple[int, ...]:
        """Return the numbers of elements on which it is tried."""
        return self.meshes

    def degree_for(self, search: Search, elements: int) -> int:
        """Return the degree of so many elements on which it is tried."""
        return search.fine_degree() if self.steep else COARSE_DEGREE

    def applies(self, search: Search) -> bool:
        """Whether the way is open to the problem, and worth its time."""
        return search.may_be_least if self.minimises else search.saddle is None

    def seek(self, ws: Workspace) -> bool:
        """Move the iterate at hand to a stationary path of its mesh; False if that fails."""
        raise NotImplementedError

    def attempt(self, search: Search) -> Status:
        """Find a path that can be refined to the tolerance."""
        return search.on_meshes(self)


@dataclass(eq=False)
class Search:
    """A search for a path to `tol` that obeys `principle`, on the mesh `given` if there is one.

    `found_by` says which way it was found in the end, `least` whether by minimising.
    """

    ws: Workspace
    tol: float
    principle: str
    given: Mesh | None
    strategies: tuple[Strategy, ...]
    found_by: str = ""
    least: bool = False
    curved: bool = False  # whether a path is sought from a curved line
    straight: bool = False  # whether it is sought from no other
    may_be_least: bool = False
    around: Search | None = None  # the same from a curved line, once it was begun
    # Whether what could not be refined were sought as least paths, one after the other.
    lost: list[bool] = field(default_factory=list)
    # Where one strategy set out, by elements and degree: others may set out there as well.
    lines: dict[tuple[int, int], Iterate] = field(default_factory=dict)
    saddle: tuple[str, Iterate] | None = None  # found while a least path was sought
    budget: float = math.inf  # elements evaluated after which nothing expensive is tried
    # The verdict where it is plain that there is no path; asked once, before what is expensive.
    rule_out: Callable[[], Status | None] | None = None
    # Whether motions are to be looked for that cross a steep step of L; once, where one is seen.
    may_step: bool = False
    tried: list[str] = field(default_factory=list)

    # -- without a guess -----------------------------------------------------------------------

    def from_nothing(self) -> Status:
        """Find a path with no guess, by the strategies in turn, and refine it.

        A straight line may be a trap: through the centre of a force or of a circle, symmetry keeps
        every path on it that is sought from there. Then a curved one is tried.
        """
        self.may_be_least = self.wants_least
        watch = self.ws.watch
        try:
            status = self.try_each(self.strategies)
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
        if self.curved or self.straight or self.ws.problem.system.n == 1 or self._large:
            return Status.NOT_FOUND
        around, done = self.around, CURVED_FIRST
        if around is None:
            given = self.tol, self.principle, self.given, self.strategies
            around = Search(self.ws.again(), *given, curved=True, lost=self.lost)
            self.around, done = around, 0
            around.may_be_least = self.wants_least
        around.budget, ws = self.budget, around.ws
        try:
            status = around.try_each(self.strategies[done:strategies])
        except OutOfTime:
            self.ws.best = ws.best or self.ws.best
            raise
        if status in REACHED:
            self.take(around)
        else:
            self.ws.unpolished = self.ws.unpolished or ws.unpolished
        return status

    def take(self, other: Search) -> None:
        """Continue with the iterate and the record of another search for the same path."""
        other.ws.record = other.ws.record.after(self.ws.record)
        self.ws, self.found_by, self.least = other.ws, other.found_by, other.least

    @property
    def wants_least(self) -> bool:
        """Whether a least path is wanted, and a force does not rule it out."""
        return self.principle != "stationary" and not self.ws.problem.system.structure.forced

    @property
    def _large(self) -> bool:
        """Whether even the coarsest mesh has many unknowns."""
        return self.ws.problem.system.n * COARSE_DEGREE * COARSE_ELEMENTS > IPOPT_SIZE

    def try_each(self, strategies: tuple[Strategy, ...]) -> Status:
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
                if strategy.minimises and self._is_bottomless:
                    self.may_be_least = False
                    continue
                left.remove(strategy)
                if strategy.cost >= EXPENSIVE:
                    rule_out, self.rule_out = self.rule_out, None
                    shut = None if rule_out is None else rule_out()
                    if shut is not None:
                        self.straight = True  # from a curved line there is none either
                        return shut
                    if self.may_step and (crossed := self._cross_steps()) in REACHED:
                        return crossed
                    self._limit(strategy.cost)
                self.begin(strategy.name, strategy.minimises)
                status = strategy.attempt(self)
            except LEADS_NOWHERE:
                if self._is_exhausted:  # the verdict on what was tried before stands
                    break
                status = Status.NOT_FOUND
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
        return self.try_each(tuple(left)) if status in UNSOLVED else status

    def _limit(self, cost: int) -> None:
        """Limit the cost of what is tried from now on to `BUDGET`, where ways have a cost.

        With a saddle in hand, a strategy may cost no more than it does as a rule.
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
        saddle is in hand by then. Those that see only what is heavy come late where inertias are
        uneven, or not at all.
        """
        watch, again, expensive, strategies = self.ws.watch, [], [], list(strategies)
        others = not all(strategy.absolute for strategy in strategies)
        for strategy in strategies:
            # Where inertias are even this is zero; the first strategy does not ask.
            uneven = self.ws.uneven if strategy.absolute and others else 0.0
            if uneven > BLIND:
                continue
            if uneven > COARSE_ELEMENTS and strategy.cost >= EXPENSIVE:
                again.append(strategy)
            elif watch is not None and not watch.affords(strategy.cost):
                expensive.append(strategy)
            elif strategy.minimises and any(self.lost):
                again.append(strategy)
            else:
                yield strategy
        if self.saddle is None or self.principle != "auto":
            yield from again
        yield from expensive

    @property
    def _is_bottomless(self) -> bool:
        """Whether the action falls on and on from the saddle in hand, and a descent with it.

        It may come to a least path beside the abyss; then others look for that, on finer meshes.
        """
        problem = self.ws.problem
        if self.saddle is None or self.principle != "auto" or problem.system.m or problem.system.r:
            return False
        from actionopt.solver.refinement.descent import descend, loose_constants, way_down

        tr, z = self.saddle[1].tr, self.saddle[1].z
        loose = loose_constants(tr)
        down = way_down(tr, z, loose)
        if down is None:
            return False
        mesh = self.ws.with_boundaries(self.uniform(FIRST_FEW, COARSE_DEGREE))
        coarse = tr
        if mesh.degrees != tr.mesh.degrees or (mesh.since != tr.mesh.since).any():
            coarse, down = Transcription(problem, mesh, tr.lengths, like=tr), None
            coarse.watch = self.ws.watch
        beside = coarse.pack(coarse.straight() + OFF_LINE * self._bend(mesh))
        went = descend(coarse, beside, FAR_DOWN, NEAR_OUT, down)
        # Constants cost no velocities: no shift may serve.
        return went.runaway or bool(loose.any() and not went.found)

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
        meshes = sorted({max(elements, few) for elements in (*first, *strategy.meshes_for(self))})
        for elements in meshes:
            ws.restart()
            self._begin_on(elements, strategy.degree_for(self, elements), known)
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
            status = self.refine()
            if status is not Status.UNRESOLVED:
                break
            if self.may_step and (crossed := self._cross_steps()) in REACHED:
                return crossed
            self.lost.append(self.least)
            if ws.has_kink:  # so it is on finer meshes
                break
        return status

    def _cross_steps(self) -> Status:
        """Seek motions that cross steep steps of L, if the path at hand shows one, or the line.

        A saddle is kept in mind; where nothing is found the path at hand stays.
        """
        from actionopt.solver.search.steps import crossings, shows_step

        ws = self.ws
        if ws.iterate is None:
            return Status.NOT_FOUND
        line = ws.here.tr.pack(ws.here.tr.straight())
        seen = ws.unbalance is not None or shows_step(ws.here, self.tol)
        if not (seen or shows_step(ws.here.moved(line), self.tol)):
            return Status.NOT_FOUND
        self.may_step, way = False, (self.found_by, self.least)
        first = ws.iterate, ws.gain, ws.unbalance, ws.hint, list(ws.record.rounds)
        self.begin("across steps")
        watch, most = ws.watch, math.inf
        if watch is not None:  # it has a price of its own
            most, watch.most = watch.most, math.inf
        for guess in crossings(ws.problem, watch):
            ws.restart()
            ws.record.rounds.clear()
            ws.transcribe(guess.mesh, guess, like=guess)
            status = Status.NOT_FOUND
            with suppress(np.linalg.LinAlgError):
                if ws.follow(FOLLOWED_REACH) or ws.approach(PATIENT):
                    status = self.refine()
            if status in REACHED and not (self.may_be_least and ws.here.index > 0):
                return status
            if status in REACHED:
                self.saddle = self.saddle or (self.found_by, ws.here.bare())
        if watch is not None:
            watch.most = most
        self.found_by, self.least = way
        ws.iterate, ws.gain, ws.unbalance, ws.hint, ws.record.rounds[:] = first
        return Status.NOT_FOUND

    def _begin_on(self, elements: int, degree: int, known: Path | None) -> None:
        """Stand on a mesh: at a path that is known, or at the line from which all set out."""
        ws, key = self.ws, (elements, degree)
        if known is None and key in self.lines:
            ws.here = self.lines[key]
            ws.here.tr.watch = ws.watch
            return
        mesh = self.uniform(elements, degree)
        ws.transcribe(mesh, known or (self._curved_line(mesh) if self.curved else self._step(mesh)))
        if known is None and not self._large:
            self.lines[key] = ws.here

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
            mesh = self.uniform(1 if one else LINEAR, self.fine_degree())
            mesh = curve_of(mesh).mesh if curve_of is not None else mesh
        self.ws.transcribe(mesh, None)
        if planned and free and not steady:
            mesh = plan_layers(self.ws.here.tr, self.ws.here.z)
            if mesh is not None:
                self.ws.transcribe(mesh, None)
        if self.ws.follow():
            return self.refine()
        even = even_mesh(self.ws)
        if even is not None:
            self.ws.transcribe(even, None)
            if self.ws.follow():
                return self.refine()
        stiff = is_stiff(self.ws.here.equations, self.ws.here.z)  # then the matrix tells nothing
        return Status.UNRESOLVED if stiff else Status.DEGENERATE

    def begin(self, name: str, least: bool = False) -> None:
        """Record which way is tried now."""
        self.found_by, self.least = name, least
        self.tried.append(name)
        if self.ws.watch is not None:
            self.ws.watch.how = name

    # -- both ------------------------------------------------------------------------------------

    def uniform(self, elements: int, degree: int) -> Mesh:
        """Return the mesh of so many elements on which a path is sought: uniform, but to rest."""
        problem = self.ws.problem
        if not problem.has_tails:
            return Mesh.uniform(problem.start.t, problem.end.t, elements, degree)
        from actionopt.solver.ends.window import graded_mesh

        return graded_mesh(problem, elements, degree)

    def _curved_line(self, mesh: Mesh) -> Path:
        """Return a line between the events curved to one side in every coordinate."""
        problem = self.ws.problem
        mesh = with_boundaries(with_degrees(mesh, problem.system.order), problem.boundaries)
        Q = Transcription(problem, mesh, problem.lengths).straight()
        return Path(mesh, (Q + self._bend(mesh)).T)

    def _bend(self, mesh: Mesh) -> Array:
        """Return by how much a curved line is beside the straight one, at the nodes, (K, n)."""
        problem, s = self.ws.problem, mesh.nodes_since / mesh.duration
        side = problem.lengths * np.cos(np.arange(1.0, 1.0 + problem.system.n))  # no symmetry's own
        return CURVED_HEIGHT * np.sin(np.pi * s)[:, None] * side

    def _step(self, mesh: Mesh) -> Path | None:
        """Return a step from rest to rest over a window; None elsewhere, for the straight line."""
        if not self.ws.problem.has_tails:
            return None
        from actionopt.solver.ends.window import step

        found = step(self.ws.problem)
        return None if found is None else Path.interpolate(found, mesh)

    def fine_degree(self) -> int:
        """Return a degree with which a few elements of a smooth path may meet the tolerance.

        About one degree a digit. A second mesh costs more where the coordinates are few.
        """
        if self.ws.problem.system.n > FEW_COORDINATES:
            return COARSE_DEGREE
        wanted = max(COARSE_DEGREE, 3 - math.log10(self.tol))
        return int(DEGREES[min(DEGREES.searchsorted(wanted), DEGREES.size - 1)])

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
