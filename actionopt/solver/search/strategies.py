"""The ways to a first path, from the straight line or a curved one, and the order of them."""

from __future__ import annotations

import math
from functools import partial

from actionopt.analysis.status import Status
from actionopt.discrete.matrices.blocks import FULL_SIZE
from actionopt.mechanics.question.problem import Problem
from actionopt.solver.refinement.first_mesh import (
    COARSE_DEGREE,
    COARSE_ELEMENTS,
    IPOPT_SIZE,
    MOST_ELEMENTS,
    paced_line,
)
from actionopt.solver.refinement.signals import LEADS_NOWHERE
from actionopt.solver.refinement.workspace import PATIENT, Workspace
from actionopt.solver.search.search import Search, Strategy
from actionopt.tools.immutable import immutable

# Ad hoc, where nothing else is said.
# Beyond which Ipopt takes far longer than a descent; up to it, it keeps nearer to the line, and a
# few hundred motions are many.
DESCENT_COORDINATES = 8
# Up to which other ways are shorter. Measured on pendulums of n links: at 30 the path beside the
# line is found by nothing else, at 50 in half the time; three bodies would take thrice as long.
RESONANT_COORDINATES = 20
# Motions that meet: pairs that are tried, and elements of one that takes too long.
MEETING_PAIRS, MEETING_ELEMENTS = 32, 48
# Paths so found that cannot be refined, after which no others found alike are tried: measured, over
# random systems and pendulums, it is the first that can be, or none.
MEETING_LOST = 3
# Elements, on each of which the inertia varies little, from which on the line's pace matters.
UNEVEN = 4.0


@immutable
class Newton(Strategy):
    """Damped Newton steps: next to no cost, and known at once whether they lead anywhere.

    Those from where the action is `convex` hardly ever fail.
    """

    convex: bool = False
    steep, absolute = True, False

    def applies(self, search: Search) -> bool:
        if self.convex:
            return search.may_be_least and search.ws.can_descend
        return super().applies(search)

    def seek(self, ws: Workspace) -> bool:
        return ws.approach(convex=self.convex)


@immutable
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


@immutable
class Paced(Strategy):
    """Descent from the line at the pace of a body free of forces, where its inertia varies much.

    At an even pace nearly all of the action would be where the inertia is large.
    """

    minimises, absolute, cost = True, False, 100

    def applies(self, search: Search) -> bool:
        ws = search.ws
        able = ws.can_descend and plain(ws.problem) and not (search.curved or search.given)
        return super().applies(search) and able and ws.uneven > UNEVEN

    def attempt(self, search: Search) -> Status:
        ws, status = search.ws, Status.NOT_FOUND
        for elements in self.meshes:
            line = paced_line(ws.problem, elements)
            if line is None:
                break
            ws.restart()
            ws.record.rounds.clear()
            ws.transcribe(line.mesh, line)
            if ws.descend() and (status := search.refine()) is not Status.UNRESOLVED:
                break
        return status


class Least(Strategy):
    """Ipopt minimises: under constraints, and where the descent is lost."""

    minimises, persistent, cost = True, False, 500

    def seek(self, ws: Workspace) -> bool:
        return ws.find("least")


class PatientLeast(Least):
    """`Least` with more iterations, for a minimum down a long curved valley."""

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
    nothing in what it finds. Where inertias are uneven it is the accelerations of the line that are
    removed, on meshes that show how these vary.
    """

    lengthy, reliable, absolute, cost = True, False, False, 1500

    def meshes_for(self, search: Search) -> tuple[int, ...]:
        uneven = search.ws.uneven
        if uneven <= COARSE_ELEMENTS:
            return self.meshes
        few = 2 ** math.ceil(math.log2(min(uneven, MOST_ELEMENTS)))
        return few, 2 * few

    def seek(self, ws: Workspace) -> bool:
        from actionopt.solver.search.homotopy import newton_homotopy

        uneven = ws.uneven > COARSE_ELEMENTS
        return ws.go("continuation", partial(newton_homotopy, uneven=uneven))


class Minimax(Strategy):
    """Least between the ends, greatest in these: above free ends over which the action falls.

    A mesh that may resolve the path at once is worth its cost while matrices are small.
    """

    steep, persistent, reliable, cost = True, False, False, 60

    def degree_for(self, search: Search, elements: int) -> int:
        fine = super().degree_for(search, elements)
        small = search.ws.problem.system.n * elements * fine <= FULL_SIZE
        return fine if small else COARSE_DEGREE

    def applies(self, search: Search) -> bool:
        problem = search.ws.problem
        given = len(problem.start.pinned) + len(problem.end.pinned)
        plain = problem.advance is None and not problem.through and problem.system.m == 0
        loose = problem.system.order == 1 and given < 2 * problem.system.n
        forced = problem.system.structure.forced
        return super().applies(search) and plain and loose and not forced

    def seek(self, ws: Workspace) -> bool:
        from actionopt.solver.search.minimax import climb

        return ws.go("minimax", climb)


class LyapunovSchmidt(Strategy):
    """Newton steps that hold the few of many modes that are near a resonance, and free them later.

    What is found is a saddle as a rule: other modes are beyond their first resonance.
    """

    cost = 200

    def applies(self, search: Search) -> bool:
        system = search.ws.problem.system
        return super().applies(search) and system.n > RESONANT_COORDINATES and system.m == 0

    def seek(self, ws: Workspace) -> bool:
        from actionopt.solver.search.resonances import pass_resonances

        return ws.go("continuation", pass_resonances)


class ComponentNewton(Strategy):
    """Newton steps that are limited place by place, in lattices."""

    cost = 1000

    def applies(self, search: Search) -> bool:
        ws = search.ws
        local = ws.problem.system.n > RESONANT_COORDINATES and ws.sparse
        return super().applies(search) and local and plain(ws.problem)

    def seek(self, ws: Workspace) -> bool:
        from actionopt.solver.refinement.component_newton import settle_by_component

        return ws.go("newton", settle_by_component)


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
        from actionopt.solver.search.two_sided_shooting import curves

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
    Paced("paced", (8, 16)),
    Minimax("minimax", (4, 8)),
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
IPOPT: tuple[Strategy, ...] = (
    Least("least", (8, 16, 32, 64)),
    Root("stationary", (8, 16, 32)),
    PatientLeast("patient least", (8, 16, 32, 64)),
)
QUICK = STRATEGIES[:3]  # what finds most paths at once; curved lines are not tried then
CHEAP = STRATEGIES[:2]  # what takes some hundredths of a second, whatever comes of it
GUESS_ONLY: tuple[Strategy, ...] = ()  # do not search away from the guess
