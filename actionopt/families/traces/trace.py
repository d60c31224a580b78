"""Follow a path as its question changes: an end point, an end time or a parameter moves.

The branch of paths is followed by its arclength, through folds where it turns back. On
the way the index is counted at every point; where it changes, or the branch turns, the point
itself is located. At a fold two paths merge, and one is of index one more than the other.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from actionopt.analysis.quadratic.assembled import assemble
from actionopt.analysis.quadratic.index import (
    inertia_beside,
    inertia_of,
    inertia_through,
    tolerance_of,
)
from actionopt.analysis.quadratic.jacobi import finer, resolve
from actionopt.analysis.quadratic.regular import index_on_mesh, regular_index
from actionopt.analysis.solution import Solution, SolveError
from actionopt.analysis.spectra.monodromy import transport_matrix
from actionopt.analysis.status import Status
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.between_nodes.crossing import Jump, find_imbalance, first_crossing
from actionopt.discrete.between_nodes.energy_balance import Imbalance
from actionopt.discrete.borders.arclength import STRAIGHT_STEP, Branch, BranchPoint, Discrete
from actionopt.discrete.borders.bordered import Bordered
from actionopt.discrete.matrices.factors import Factors
from actionopt.discrete.matrices.layout import forget
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.families.traces.branch import INTERRUPTED, Trace
from actionopt.families.traces.branch_points import Miss, branch_points
from actionopt.families.traces.marks import Mark, Step, locate
from actionopt.families.vary import Name, present, with_values
from actionopt.mechanics.question.held import Held, contacts_of
from actionopt.mechanics.question.problem import Problem
from actionopt.solver.contact.obstacle import INSIDE, contact_conditions, is_pulled
from actionopt.solver.contact.touching import depths, pressing_parts
from actionopt.solver.ends.window import Window, factorize, with_window_of
from actionopt.solver.input.arguments import check_problem
from actionopt.solver.kinds.through import objection
from actionopt.solver.refinement.refine import ROUNDS, split
from actionopt.solver.solve import Guess, solve
from actionopt.tools.blas import one_thread
from actionopt.tools.checks import flag, number, whole
from actionopt.tools.memory import give_back
from actionopt.tools.types import EPS, Array
from actionopt.tools.watch import Progress, TimeUp, check_progress, check_time, time_limit

Vary = Name | Callable[[float], Problem]
Finer = tuple[Mesh, Array]  # elements, and units of the coordinates

# Ad hoc, where nothing else is said. Steps are of arclength, the range of values as the unit.
CONTACT_STEP, CONTACT_CHANGE = 0.01, 0.1  # over a change of contact, and of a path there
SHORTEST_CONTACT = 1e-3  # a step that is halved no more where contact may change
FIRST_STEP, LONGEST_STEP, SHORTEST_STEP = 0.05, 0.25, 1e-7
# What the mesh leaves out of Jacobi fields; derived: eigenvalues converge twice as fast, and only
# their signs are asked for.
TRACE_RESOLUTION = 1e-5
# Times tol, amplitude times arclength of branches that miss each other, hyperbolas, and are taken
# for ones that cross. Measured: ones that do have up to .35, and imperfections of an end 2.2 times
# their size.
BRANCH_GAP = 3.0
# How far ahead of where branches miss each other a step is to end, in parts of how much they do.
# Derived: the hyperbola a x = apart^2 has turned by 6 degrees at x = 3 apart. The next step is as
# long as they miss each other: by twice that a chain of 16 links came to another branch.
SHORT_OF_TURN = 3.0
# What a mesh leaves out once it is refined, in parts of `tol`: the next points are resolved, too.
# Measured on chains of 15 to 25 links: of 10 to 12 meshes 6 are left, at 1e-2 4.
SPARE_TAILS = 0.1
# Points in a row at which only the signs on the path's own mesh are counted, as long as they stay
# what they were where the mesh was found to resolve the neighbours of a path, too. Ad hoc.
COUNTED_ON_MESH = 7
SHORTEST_TOLD = 1e-4  # a step that is halved no more to tell what changes within it
# How far what a function gives at the start may be from the problem given: round-off; ad hoc.
SAME_START = 1e-9
# The numbers of a question by what they are; None becomes NaN.
QUESTION_NUMBERS: dict[str, Callable[[Problem], Any]] = {
    "times of events": lambda problem: [event.t for event in problem.joints_found],
    "coordinates at events": lambda problem: [
        event.places(problem.system.order) for event in problem.joints_found
    ],
    "parameters": lambda problem: problem.packed,
    "energy": lambda problem: problem.energy,
    "values of integrals": lambda problem: problem.integral,
}
GROWN_UNITS = 2.0  # times the units of the coordinates: then these grow along, and steps with them
# A branch is infinite at a value where it has grown so many times, nearer to it than this part of
# the range. Where equations are not linear it grows from tol to tol^(1/3), too, at a pitchfork with
# an imperfection of tol.
POLE_SIZE, POLE_DISTANCE = 100.0, 1e-3


@one_thread
def trace(
    problem: Problem,
    vary: Vary,
    to: float,
    *,
    start: float | None = None,
    guess: Guess | None = None,
    tol: float = 1e-8,
    steps: int = 300,
    count: bool = True,
    seconds: float | None = None,
    progress: Progress | None = None,
) -> Trace:
    """Follow the path of `problem` as one quantity moves to the value `to`.

    The branch may turn back on the way. It is followed until the quantity reaches `to`, or its
    own first value again, or the paths grow without bound, as towards an end that is conjugate to
    the start; `stopped` of what is returned says which.

    Parameters
    ----------
    problem : Problem
    vary : str, tuple, or callable
        What moves: the name of a parameter (one number); "t0" or "t1", the time of an event;
        "energy", where a time is free;
        ("start", name) or ("end", name), a coordinate there; ("through", k, name) or ("through",
        k, "t"), a coordinate or the time of event k between the ends; ("integral", i), the value
        of integral i; or a function from a number to a Problem with the same system and kind of
        events.
    to : float
        Where it goes.
    start : float, optional
        The number that stands for `problem` itself, where `vary` is a function.
    guess, tol
        As for `solve`, for the first path; `tol` bounds the Legendre tails on the way, too.
    steps : int
        Most points to compute.
    count : bool
        Count the index at every point. Without, the trace is faster; its folds are found all
        the same.
    seconds : float, optional
        The time it may take, the first path included, as for `solve`; then the trace ends and
        keeps what it has.
    progress : callable, optional
        `progress(stage, done, total, detail)` after each point: "trace", the points so far,
        `steps`, and {"value": ..., "action": ..., "index": ...} of the point. An interruption
        (KeyboardInterrupt) ends the trace and keeps what it has.

    Raises
    ------
    ValueError
        If `vary` names nothing or, at `start`, is not the problem, `to` is the present value, or
        the first path has no index that could be counted.
    SolveError
        If there is no first path.
    """
    check_problem(problem)
    check_progress(progress)
    family, value = _family(problem.original, vary, start)
    if problem.is_infinite:
        problem.system.check_free("`trace` follows contact between finite times, `sweep` any")
    to, steps = number(to, "the value to go to"), whole(steps, "the most points to compute", 1)
    if to == value:
        raise ValueError(f"expected a value to go to other than the present {value}, found {to}")
    started = perf_counter()
    first = solve(family(value), guess=guess, tol=tol, seconds=seconds)
    left = None if seconds is None else max(started + seconds - perf_counter(), EPS)
    counting = flag(count, "count") and not problem.system.structure.forced
    run = _TraceRun(family, value, to, tol, counting)
    try:
        with time_limit(left):
            run.begin(first)
            run.go(steps, progress)
    except TimeUp:
        if not run.points:
            message = f"expected more than {seconds} seconds for a trace, found no time to begin it"
            raise SolveError(message, first) from None
        run.end("its time was used up; give more (seconds=), or trace on from there")
    except KeyboardInterrupt:
        run.stopped = INTERRUPTED
    except _Uncounted as error:
        if not run.points:
            raise ValueError(str(error)) from None
        run.end(str(error))
    return run.result()


class _Passed(NamedTuple):
    """What is kept of a point: beside it equations, their layouts and matrices take megabytes."""

    s: float
    action: float
    index: int
    path: Path


class _Uncounted(Exception):
    """There is no index to count at a point, with the reason and what to try."""


def _family(
    problem: Problem, vary: Vary, start: float | None
) -> tuple[Callable[[float], Problem], float]:
    """Return the problem as a function of the varied quantity, and the quantity's present value."""
    if not callable(vary):
        if start is not None:
            raise ValueError(
                f"expected start only where vary is a function, found {start!r} for {vary!r}, "
                "which begins at the value that the problem has"
            )
        return partial(_with, problem, vary), present(problem, vary)  # which pickles
    if start is None:
        raise ValueError("expected start, the number that stands for the problem given")
    value = number(start, "start, the number that stands for the problem given")
    begun = vary(value)
    check_problem(begun)
    if other := _difference(begun.original, problem):
        raise ValueError(
            f"expected a function whose value at the start, {value:g}, is the problem given, found "
            f"one with {other}; give that one, or the start at which it is the problem given"
        )
    return vary, value


def _difference(one: Problem, other: Problem) -> str:
    """Return what tells a question from another, but for round-off; empty if they are the same."""
    if one.system is not other.system and one.system.digest != other.system.digest:
        return "another system"
    for what, numbers_of in QUESTION_NUMBERS.items():
        a, b = (np.array(numbers_of(problem), dtype=float).ravel() for problem in (one, other))
        both = np.concatenate([a, b])
        size = np.abs(both[np.isfinite(both)]).max(initial=0.0)
        if a.shape != b.shape or not np.allclose(a, b, SAME_START, SAME_START * size, True):
            return f"other {what}"
    return ""


def _with(problem: Problem, name: Name, value: float) -> Problem:
    return with_values(problem, {name: value})


def _within(family: Callable[[float], Problem], like: Problem, value: float) -> Problem:
    """Return a problem of the family in the window of another one."""
    return with_window_of(family(value), like)


@dataclass(eq=False)
class _TraceRun:
    """A trace under way; the problems `asked` may have infinite times, those of `family` none."""

    asked: Callable[[float], Problem]
    origin: float
    goal: float
    tol: float
    counting: bool
    family: Callable[[float], Problem] = field(init=False)
    branch: Branch = field(init=False)
    here: BranchPoint = field(init=False)  # the last point
    points: list[_Passed] = field(default_factory=list)
    marks: list[Mark] = field(default_factory=list)
    sizes: Array = field(init=False)
    pole_size: float = field(init=False)
    stopped: str = ""
    drifts: tuple[DiscretePath | None, bool] = (None, False)  # of which path it is known, and what
    refused: str = ""  # what is wrong with the question a step ahead
    # Points since the index was counted with all that tells it, and what the mesh told there; None
    # where it told another one.
    counted: tuple[int, int] | None = None
    # The length of a step from the last point that ends short of where it turns, as another branch
    # is near, and that of the next one.
    turn: tuple[float, float] | None = None
    meshes: int = 1
    solves: int = 0

    def begin(self, solution: Solution) -> None:
        """Start from a solution."""
        problem = solution.problem
        self._keep_window(problem)
        self.sizes = solution.discrete.tr.lengths
        linear = problem.system.structure.linear
        self.pole_size = POLE_SIZE if linear else max(POLE_SIZE, self.tol ** (-2 / 3))
        self._set(solution.discrete, self.origin, self.goal - self.origin)

    def _keep_window(self, like: Problem) -> None:
        """Have the window of a problem in all of the family, if it has one."""
        self.family = partial(_within, self.asked, like) if like.has_tails else self.asked

    def _set(self, at: DiscretePath, s: float, way: float, finer: Finer | None = None) -> None:
        """Begin a branch at a path at s, on which s goes the `way` of this sign.

        Or go on with that of the last point, on a finer mesh and in other units of the coordinates.
        """
        path, rows, lengths = at.path, at.rows, at.tr.lengths
        if finer is not None:
            mesh, lengths = finer
            path, rows = path.on(mesh), at.rows_on(mesh)
            if self.meshes > 2 and mesh is not at.mesh:  # who asked may ask for the first one again
                forget(at.tr.layout)
            give_back()
        ahead = s, self.goal - self.origin, float(np.sign(way))
        self.branch, first = Branch.begin(self.family, at.problem, path, rows, lengths, ahead)
        if finer is None:
            self.counted = None
            self._append(first, self._index(first))
        else:
            self._append(first, self.points.pop().index)

    def _append(self, point: BranchPoint, index: int) -> None:
        self.here = point.without_factors()
        self.points.append(_Passed(point.s, point.at.action, index, point.path))

    def end(self, why: str) -> None:
        """Say why it ended at the last point, short of the goal."""
        self.stopped = f"it stopped at {self.points[-1].s:.9g}, short of {self.goal:g}: {why}"

    def go(self, steps: int, progress: Progress | None) -> None:
        """Step along the branch until it leaves the interval."""

        def report() -> None:
            if progress is not None:
                s, action, index, _ = self.points[-1]
                at = {"value": s, "action": action, "index": index}
                progress("trace", len(self.points), steps, at)

        length = FIRST_STEP
        while len(self.points) < steps and not self.stopped:
            check_time()
            length = self._advance(length, report)
        if not self.stopped:
            self.end(f"the {steps} steps were used up; give more (steps=), or trace on from there")

    def _advance(self, length: float, report: Callable[[], None]) -> float:
        """Take a step of about this length, or end the trace; return the length of the next one."""
        here = self.here
        taken = self._try(here, length)
        if taken is None:
            if length / 2 < SHORTEST_CONTACT and self._resume(here, here.s + self._ahead(here)):
                return FIRST_STEP
            why = self.refused or "the paths end or run away"
            return self._halve(length, SHORTEST_STEP, f"no step, however short, led on: {why}")
        (there, factorized), taken = taken, None  # lest it keeps factors
        beyond = self._beyond(there.s)
        if beyond is not None:
            last = self.branch.to(there, beyond) or self.branch.to(here, beyond)
            if last is None:
                why = "the last step to the end of the interval failed"
                return self._halve(length, SHORTEST_STEP, why)
            there = last
        why = self._objection(there)
        if why:
            return self._halve(length, SHORTEST_TOLD, why)
        if self._changes_contact(there):
            if not self._resume(there, there.s):  # it may be near where contact changes
                why = "contact changes there, and no least path with the next one is near"
                return self._halve(length, SHORTEST_CONTACT, why)
            if beyond is not None:
                self.stopped = f"it reached {self._names()[beyond]}"
            return length
        counted = self.counted
        index = self._index(there, last=beyond is not None)
        marks = self._marks(here, there, index)
        if marks is None:
            self.counted = counted
            return length / 2 if self.turn is None else self.turn[0]
        self.marks += marks
        self._append(there, index)
        there = self.here
        report()
        if beyond is not None:
            if self._misses(there) or self._drifts(there) or self._is_cut_off(there):
                self._refine()
            self.stopped = self.stopped or f"it reached {self._names()[beyond]}"
            return length
        pole = self._pole(here, there)
        if pole is not None:
            self.end(
                f"the paths grow without bound as it approaches {pole:.6g}, as where the end "
                "is conjugate to the start, or a closed path in resonance; trace on from a "
                "problem on the other side"
            )
            return length
        self._refine()
        turn, self.turn = self.turn, None
        if turn is not None and turn[0] == length:
            return turn[1]
        return min(1.5 * length, LONGEST_STEP) if factorized <= 1 else length

    def _halve(self, length: float, shortest: float, why: str) -> float:
        """Return half a length; end the trace, and say `why`, where that is below `shortest`."""
        if length / 2 < shortest:
            self.end(why)
        return length / 2

    def _names(self) -> dict[float, str]:
        return {self.goal: "the goal", self.origin: "the first value again"}

    def _size(self, point: BranchPoint) -> float:
        """Return how many times larger a path is than the first one."""
        return float(np.max(np.abs(point.path.values).max(axis=1) / self.sizes))

    def _pole(self, here: BranchPoint, there: BranchPoint) -> float | None:
        """Return the value close ahead at which the branch is infinite, or None.

        Near a conjugate point the size grows like 1 / (pole - s), whose inverse is a line.
        """
        before, now = self._size(here), self._size(there)
        if now < self.pole_size or now <= before:
            return None
        left = (there.s - here.s) / (now / before - 1)
        ahead = self.goal if left * (self.goal - self.origin) > 0 else self.origin
        near = abs(left) < POLE_DISTANCE * abs(self.goal - self.origin)
        return there.s + left if near and abs(ahead - there.s) > 2 * abs(left) else None

    def _try(self, here: BranchPoint, length: float) -> tuple[BranchPoint, int] | None:
        """Return the point a step ahead and the factorizations; None if it was too long."""
        self.refused = ""
        try:
            taken = self.branch.step(here, length)
        except ValueError as error:  # no question there, such as of an end inside an obstacle
            self.refused = str(error)
            last = self._beyond(here.s + length * here.direction[-1])
            taken = None if last is None else self._last(here, last)
        if taken is None or self.branch.angle(here, taken[0]) < STRAIGHT_STEP:
            return None
        return taken

    def _last(self, here: BranchPoint, s: float) -> tuple[BranchPoint, int] | None:
        """Return the point at an end of the interval, where what is beyond is no question."""
        try:
            found = self.branch.to(here, s)
        except ValueError:
            return None
        return None if found is None else (found, 0)

    def _beyond(self, s: float) -> float | None:
        """Return the end of the interval that s has passed, if any."""
        way = np.sign(self.goal - self.origin)
        if way * (s - self.goal) >= 0:
            return self.goal
        return self.origin if way * (s - self.origin) < 0 else None

    # -- what there is at a point ---------------------------------------------------------------

    def _index(self, point: BranchPoint, *, last: bool = False) -> int:
        """Return the index; -1 where none is wanted. Raises _Uncounted where there is none.

        It changes where an eigenvalue passes zero. While none does on the mesh, which resolved the
        neighbours of a path before, it is not counted anew at each point, but at the `last` one.
        """
        if not self.counting:
            return -1
        try:
            if point.at.problem.is_course:
                return inertia_through(point.at, 0.0).index
            if isinstance(point.tr, Bordered):
                return inertia_beside(resolve(point.at, self.tol, TRACE_RESOLUTION)).index
            told, known = index_on_mesh(point.at, self.tol, point.factors), self.counted
            if known and known[1] == told and known[0] < COUNTED_ON_MESH and not last:
                self.counted = known[0] + 1, known[1]
                return known[1]
            index = regular_index(point.at, self.tol, tolerance_of(self.tol))
            self.counted = None if index is None or index != told else (0, index)
            if index is None:
                index = inertia_of(resolve(point.at, self.tol, TRACE_RESOLUTION)).index
            return index
        except ValueError as error:
            raise _Uncounted(_without(error)) from None

    def _objection(self, point: BranchPoint) -> str:
        """Return why a stationary path is no answer, a sentence; empty if it is one."""
        jump, problem = self._jump(point), point.at.problem
        if isinstance(jump, Jump):
            return f"the path at {point.s:.6g} crosses a surface, on which {jump}"
        if jump is not None and not self._is_solved(point):
            return f"the path at {point.s:.6g} is not resolved: {jump}"
        if not problem.through:
            return ""
        at = point.at
        path = Solution(problem, at.path, at.action, at.rows.T, self.tol, Status.SOLVED, {})
        why = objection(path)
        return why and f"at {point.s:.6g} {why}"

    def _is_solved(self, point: BranchPoint) -> bool:
        """Whether there is a path on a mesh of its own: here it is on that of the last point."""
        return solve(self.family(point.s), guess=point.path, tol=self.tol, throw=False).success

    # -- contact with an obstacle -----------------------------------------------------------------

    def _changes_contact(self, point: BranchPoint) -> bool:
        """Return whether the path is inside of the obstacle, or would have to be pulled."""
        at = point.at
        if not (self.branch.arcs or at.problem.system.r):
            return False
        if not self.branch.arcs:
            at = DiscretePath.of(Held(at.problem.free, ()), at.path)
        if at.tr.order > 1:
            pulled = pressing_parts(at) != contacts_of(at.problem).arcs
            return pulled or bool((depths(at, self.sizes)[1] > INSIDE * self.tol).any())
        _, on, depth, push, unit = contact_conditions(at, self.sizes)
        return bool((depth > INSIDE * self.tol).any() or (on & is_pulled(push, unit)).any())

    def _ahead(self, here: BranchPoint) -> float:
        """Return the step in s over a change of contact; 0 where the branch turns."""
        along = self.goal - self.origin, here.direction[-1]
        step = float(np.sign(along[1]) * CONTACT_STEP * abs(along[0]))
        return step if self._beyond(here.s + step) is None else 0.0

    def _resume(self, here: BranchPoint, s: float) -> bool:
        """Go on at s with the least path near this one, what is in contact found anew."""
        if not (self.branch.arcs or here.at.problem.system.r):
            return False
        found = self._solution_near(here, s)
        if found is None:
            return False
        self.solves += self.branch.solves
        self._set(found.discrete, s, here.direction[-1])
        return True

    def _solution_near(self, near: BranchPoint, s: float | None = None) -> Solution | None:
        """Return what `solve` finds at s, or at a point's own, from its path; None if not near."""
        try:
            problem = self.family(near.s if s is None else s)
        except ValueError:
            return None
        found = solve(problem, guess=near.path, tol=self.tol, throw=False)
        apart = np.abs(found(near.path.mesh.nodes) - near.path.values).max(axis=1)
        is_near = found.success and (apart <= CONTACT_CHANGE * self.sizes).all()
        return found if is_near else None

    def _jump(self, point: BranchPoint) -> Jump | Imbalance | None:
        """Return a jump of L that the path crosses, or a narrow step that no mesh resolves.

        What changes gradually shows how fine the mesh is, and so does what `solve` resolves.
        """
        problem, system = point.at.problem, point.at.problem.system
        if system.switches is not None:
            found = first_crossing(system.switches, problem, point.path)
            if found is not None:
                return found
        if system.structure.jumpless:
            return None
        off, told = find_imbalance(point.at, self.tol)
        self.drifts = point.at, told > self.tol
        if isinstance(off, Imbalance) and not (off.sudden and self._solution_near(point) is None):
            return None
        return off

    def _refine(self) -> None:
        """Go on with a finer mesh, or larger units, where the last point asks for it."""
        for _ in range(ROUNDS):
            if not self._refine_once():
                return

    def _refine_once(self) -> bool:
        """Whether the last point asked for a finer mesh or larger units, and has them."""
        point = self.here
        if self._is_cut_off(point):
            return self._widen_window(point)
        tr, Q = point.at.tr, point.at.Q
        sizes = np.max(np.abs(Q), axis=0)
        resolved = partial(finer, tr.mesh, Q=Q / np.maximum(sizes, tr.lengths))
        mesh = resolved(self.tol) and resolved(self.tol * SPARE_TAILS)
        if mesh is None and self._misses(point):
            mesh = split(tr, point.at.z)
        if mesh is None and self._drifts(point):
            found = self._solution_near(point)
            if found is None:
                del self.points[-1]
                self.end(f"the path at {point.s:.6g} is not resolved, as its energy tells")
                return False
            mesh = found.mesh
        if mesh is None and not np.any(sizes > GROWN_UNITS * tr.lengths):
            return False
        self.meshes += mesh is not None
        self.solves += self.branch.solves
        lengths = np.where(sizes > 1e-12 * np.max(sizes), sizes, tr.lengths)
        self._set(point.at, point.s, point.direction[-1], (mesh or tr.mesh, lengths))
        return mesh is not None

    def _is_cut_off(self, point: BranchPoint) -> bool:
        """Whether what the edges of a window leave out moves the path by more than `tol`."""
        at = point.at
        if not at.problem.has_tails:
            return False
        path = Solution(
            at.problem, at.path, at.action, at.rows.T, self.tol, Status.SOLVED, {}, known=at
        )
        edges = Window(at.problem, None).edges(path, factorize(path))
        return any(edge.moved > self.tol for edge in edges)

    def _widen_window(self, point: BranchPoint) -> bool:
        """Go on in the window of what `solve` finds there; end the trace where it finds nothing."""
        found = self._solution_near(point)
        del self.points[-1]
        if found is None:
            self.end(f"no path leads on to rest at {point.s:.6g}")
            return False
        self.solves += self.branch.solves
        self._keep_window(found.problem)
        self._set(found.discrete, point.s, point.direction[-1])
        return True

    def _misses(self, point: BranchPoint) -> bool:
        """Whether what may be narrow, summed at other points, moves the path or changes S.

        What the energy shows `_drifts` tells.
        """
        structure, at = point.at.problem.system.structure, point.at
        if not (structure.samples and (structure.depends_on_time or structure.forced)):
            return False
        if at.tr.missed_action(at.z) > self.tol:
            return True
        # The matrix of a path alone is singular along a state that an integral fixes.
        tr, z = (point.tr, point.z) if isinstance(point.tr, Bordered) else (at.tr, at.z)
        step = Factors(tr.layout, tr.kkt(z)).solve(tr.quadrature_defect(z)[0])
        return tr.relative_step(step) > self.tol

    def _drifts(self, point: BranchPoint) -> bool:
        """Whether the path is off by more than `tol` as its energy tells: see `find_imbalance`."""
        if point.at.problem.system.structure.jumpless or point.at.problem.through:
            return False
        known, drifts = self.drifts
        if known is not point.at:
            drifts = find_imbalance(point.at, self.tol)[1] > self.tol
            self.drifts = point.at, drifts
        return drifts

    # -- what changes on the way ----------------------------------------------------------------

    def _marks(self, here: BranchPoint, there: BranchPoint, after: int) -> list[Mark] | None:
        """Return what changes between two points; None if a shorter step is to tell."""
        before, step = self.points[-1].index, Step.between(self.branch, here, there)
        short, changes = step.length < SHORTEST_TOLD, abs(after - before)
        if not short and (step.hides_folds or (self.counting and step.turns and changes != 1)):
            return None
        marks: list[Mark] = []
        if step.turns:
            found = locate(self.branch, here, there, lambda p: p.direction[-1])
            along = None if found is None else Step.between(self.branch, here, found).length
            if not short and (along is None or not step.turns_at(along)):
                return None
            marks.append(self._mark("fold", found or there, before, after))
        elif after != before:
            found = self._branch_points(here, there, after - before)
            if isinstance(found, Miss):
                ahead, again = found.along - SHORT_OF_TURN * found.apart, self.turn is not None
                leads = found.apart < ahead < step.length and not again
                self.turn = (ahead, found.apart) if leads else None
                found = None
            if found is None and not short:
                return None
            way = 1 if after > before else -1
            for k, low in enumerate(range(before, after, way)):
                marks.append(self._mark("index", found[k] if found else there, low, low + way))

        problem = there.at.problem
        has_multipliers = self.counting and problem.closes and not problem.system.m
        if has_multipliers and self._doubling(here) * self._doubling(there) < 0:
            found = locate(self.branch, here, there, self._doubling)
            if found is None and not short:
                return None
            marks.append(self._mark("period doubling", found or there, before, after))
        return marks

    def _mark(self, kind, point: BranchPoint, before: int, after: int) -> Mark:
        sides = (before, after) if self.counting else (None, None)
        return Mark(kind, point.s, point.path, *sides, len(self.points) - 1)

    def _doubling(self, point: BranchPoint) -> float:
        """Return det(M + 1) of the monodromy matrix M, zero where a multiplier is -1."""
        M = transport_matrix(resolve(point.at, self.tol, TRACE_RESOLUTION))
        return float(np.linalg.det(M + np.eye(len(M))))

    def _branch_points(
        self, here: BranchPoint, there: BranchPoint, change: int
    ) -> list[BranchPoint] | Miss | None:
        """Return the points between two ones at which the index changes; see `branch_points`."""
        branch, low, high = self.branch, here.z, there.z
        if not (isinstance(there.tr, Bordered) or branch.arcs or there.at.problem.is_course):
            form = assemble(there.at, self.tol, TRACE_RESOLUTION)
            mesh = (form or resolve(there.at, self.tol, TRACE_RESOLUTION)).at.mesh
            if mesh is not there.at.mesh:
                branch = replace(branch, shape=mesh, like=None, last=None, solves=0)
                low, high = (self._on(branch.at(p.s), p) for p in (here, there))
        gap = BRANCH_GAP * self.tol
        return branch_points(branch, (low, here.s), (high, there.s), change, gap)

    @staticmethod
    def _on(tr: Discrete, point: BranchPoint) -> Array:
        """Return the unknowns (size,) of the path of a point on another mesh over its times."""
        assert isinstance(tr, Transcription)
        return tr.pack(point.path.on(tr.mesh).values.T, point.at.rows_on(tr.mesh))

    def result(self) -> Trace:
        """Return what is known so far."""
        values, actions, indices, paths = zip(*self.points, strict=True)
        return Trace(
            np.array(values),
            np.array(actions),
            np.array(indices),
            paths,
            tuple(self.marks),
            self.stopped,
            self.family,
            self.tol,
            {
                "points": len(self.points),
                "factorizations": self.solves + self.branch.solves,
                "meshes": self.meshes,
            },
        )


def _without(error: ValueError) -> str:
    """Return why no index is counted, and what to do about it."""
    return f"{error}; count=False follows the paths without their index"
