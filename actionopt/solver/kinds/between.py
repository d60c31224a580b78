"""Paths between events at given times: find one on a coarse mesh, then follow it to the tolerance.

Finding (`search`) and following (`refine`) are different work, on the same path (`iterate`).
*Finding* starts from the straight line, or from a guess. *Following* is Newton's: each refinement
round interpolates the path on a better mesh and polishes it there, always the same path.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from time import perf_counter
from typing import TYPE_CHECKING, Literal

import numpy as np

from actionopt.analysis.solution import Solution
from actionopt.analysis.status import Status
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.meshes.boundaries import with_boundaries
from actionopt.discrete.meshes.element import with_degrees
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.mechanics.question.problem import Problem
from actionopt.solver.input.arguments import Guess, check_arguments
from actionopt.solver.refinement.family import judge_family, may_be_family
from actionopt.solver.refinement.first_mesh import COARSE_DEGREE, LINEAR
from actionopt.solver.refinement.refine import settle_on
from actionopt.solver.refinement.signals import SIGNALS, status_of
from actionopt.solver.refinement.verdict import message_of, solution_of
from actionopt.solver.refinement.workspace import Workspace
from actionopt.solver.search.search import CURVED_STRATEGIES, Search, Strategy
from actionopt.solver.search.strategies import IPOPT, QUICK, STRATEGIES, plain
from actionopt.tools.checks import COARSEST
from actionopt.tools.immutable import immutable
from actionopt.tools.watch import OutOfTime, Watch

if TYPE_CHECKING:
    from actionopt.discrete.between_nodes.crossing import Jump

Found = tuple[Solution, str]  # a path, or the best attempt, and the verdict with its figures
# strategies tried where the first path crosses a jump: seconds are lost there; ad hoc
BEFORE_A_JUMP = 3
MOST_SEEN = 2  # coordinates of which all motions from the start are seen
MOST_AIMED = 4  # of which some are aimed across a step of L; ad hoc
OUT_OF_REACH = "no motion from the start comes to the end event, of many tried, slow and fast"


@immutable
class Choices:
    """How a problem is solved: the arguments of `solve`, its method as strategies."""

    tol: float
    principle: Literal["auto", "least", "stationary"]
    strategies: tuple[Strategy, ...]
    mesh: Mesh | None
    watch: Watch | None

    @property
    def is_plain(self) -> bool:
        """Whether all ways are open: nothing is asked of the mesh or the strategies."""
        return self.mesh is None and self.strategies is STRATEGIES


def between(
    problem: Problem, guess: Guess | None, choices: Choices, *, verdict: bool = True
) -> Found:
    """Return the path of a problem of finite times, and the verdict with its figures.

    Without `verdict`, whether it is one of a family is not asked.
    """
    started = perf_counter()
    tol, principle, mesh, watch = choices.tol, choices.principle, choices.mesh, choices.watch
    curve_of = check_arguments(problem, tol, guess, principle, mesh)
    system = problem.system
    # Far from zero a path to `tol` may miss the motion, which is to be resolved as well.
    tol = min(tol, COARSEST * float((problem.lengths / problem.scales).min()))
    if system.r and system.order > 1:
        from actionopt.mechanics.question.held import Held
        from actionopt.solver.contact.touching import Touching

        ws = along = Touching(Held(problem, ()), tol=tol, watch=watch)
    elif system.r:
        from actionopt.mechanics.question.held import Held
        from actionopt.solver.contact.obstacle import Along

        ws = along = Along(Held(problem), tol=tol, watch=watch)
    else:
        along = None
        ws = Workspace(problem, system.structure.linear, tol, refines=mesh is None, watch=watch)
    for name in ("first", "second"):
        system.pointwise(name)
    ws.record.time["derive"] += perf_counter() - started
    straight = choices.strategies is QUICK
    search = Search(ws, tol, principle, mesh, choices.strategies, straight=straight)
    try:
        if along is not None:
            from actionopt.solver.contact.least_along import find_least_along
            from actionopt.solver.contact.touching import Touching, find_touching

            search.begin("obstacle", least=True)
            if isinstance(along, Touching):
                search.ws, status = find_touching(along, tol, curve_of)
            else:
                search.ws, status = find_least_along(along, tol, curve_of)
            status = settle_on(search.ws, status, mesh, least=True)
        else:
            status = _find_smooth(search, guess, curve_of)
        search.ws.here.tr.watch = None  # a verdict is not left half done
        if (principle == "least" or system.r) and status.success and search.ws.here.index > 0:
            status = Status.UNBOUNDED if search.ws.linear else Status.NOT_LEAST
    except SIGNALS as signal:
        search.ws.stop()
        search.ws.hint = f"tried: {', '.join(dict.fromkeys(search.tried))}"
        status = status_of(signal)
    ws = search.ws
    if watch is not None and watch.error is not None and not isinstance(watch.error, OutOfTime):
        raise watch.error
    solution = solution_of(ws, status, search.found_by, started)
    verdict = verdict and (status.success or not straight)  # else others are sought yet
    if verdict and may_be_family(ws, status):
        solution = judge_family(ws, solution)
    return solution, "" if solution.success else message_of(solution, tol, ws.hint)


def solve_on_the_way(
    problem: Problem,
    tol: float,
    outer: Watch | None,
    guess: Guess | None = None,
    *,
    brief: bool = False,
    verdict: bool = False,
) -> Solution:
    """Return a path, or an attempt, in the time that is left for a search that needs it on its way.

    Only with `verdict` is it asked whether the path is one of a family. With `brief` no costly
    strategies are tried. Raises OutOfTime if no time is left.
    """
    watch = None if outer is None else Watch(None, None, outer)
    strategies = STRATEGIES[:CURVED_STRATEGIES] if brief else STRATEGIES
    choices = Choices(tol, "auto", strategies, None, watch)
    found, _ = between(problem, guess, choices, verdict=verdict)
    if found.status is Status.OUT_OF_TIME:
        raise OutOfTime
    return found


def _find_smooth(
    search: Search, guess: Guess | None, curve_of: Callable[[Mesh], Path] | None
) -> Status:
    """Find a path that crosses no jump of L."""
    ws, problem = search.ws, search.ws.problem
    steps, jump = problem.system.switches, None
    joins = problem.advance is None and bool(problem.start.pinned and problem.end.pinned)
    may_jump = not (steps is None and problem.system.structure.jumpless)
    if steps is None and search.strategies is not IPOPT and plain(problem):
        search.rule_out = partial(_rule_out, search)
        plainly = search.strategies is STRATEGIES and search.given is None and guess is None
        search.may_step = plainly and _may_step(problem)
    if not may_jump:
        return _search(search, guess, curve_of)
    from actionopt.discrete.between_nodes.crossing import find_imbalance, first_crossing

    def find_jump(*paths: DiscretePath | None) -> Jump | None:
        """Return the first jump of L that the energies of some paths show, or None."""
        found = (find_imbalance(at, search.ws.tol)[0] for at in paths if at is not None)
        return next((off for off in found if off is not None and off.is_jump is True), None)

    def rule_out() -> Status | None:
        """Return whether the straight line crosses a jump: then so does each path of one x."""
        nonlocal jump
        jump = find_jump(_first(problem, None))
        return _rule_out(search) if jump is None else Status.JUMP

    if steps is not None:
        first = _first(problem, curve_of)
        jump = first_crossing(steps, problem, first.path)
    elif joins and problem.system.n == 1 and not problem.system.structure.depends_on_time:
        search.rule_out = rule_out
    if jump is not None and jump.inevitable:
        ws.transcribe(first.mesh, first.path)
        search.found_by = "none"
    else:
        if jump is not None:
            search.strategies = search.strategies[:BEFORE_A_JUMP]
        status = _search(search, guess, curve_of)
        # What was lost on the way may have been lost at a jump that the first path crosses.
        lost = status in (Status.NOT_FOUND, Status.UNRESOLVED)
        if steps is not None:
            before = None if status.success else jump
            jump = first_crossing(steps, problem, search.ws.here.path) or before
        if jump is None and lost and not problem.system.structure.jumpless:
            jump = find_jump(search.ws.iterate, _first(problem, curve_of))
        if jump is None:
            return status
    ws = search.ws
    ws.hint, ws.here = str(jump), replace(ws.here, error=np.inf)
    return Status.JUMP


def _may_step(problem: Problem) -> bool:
    """Return whether L may step steeply where motions keep their energy, which tells."""
    law = problem.system.structure
    keeps = not (law.forced or law.depends_on_time)
    return law.narrow > 0 and keeps and problem.system.n <= MOST_AIMED


def _rule_out(search: Search) -> Status | None:
    """Return the verdict where no motion from the start comes to the end."""
    problem = search.ws.problem
    if problem.system.n > MOST_SEEN:
        return None
    from actionopt.solver.search.out_of_reach import is_out_of_reach

    if not is_out_of_reach(problem, search.ws.watch):
        return None
    search.ws.hint, search.found_by = OUT_OF_REACH, "none"
    return Status.NOT_FOUND


def _first(problem: Problem, curve_of: Callable[[Mesh], Path] | None) -> DiscretePath:
    """Return the straight line between the events, or the guess."""
    mesh = Mesh.uniform(problem.start.t, problem.end.t, LINEAR, COARSE_DEGREE)
    mesh = with_boundaries(with_degrees(mesh, problem.system.order), problem.boundaries)
    tr = Transcription(problem, mesh, problem.lengths)
    path = Path(mesh, tr.straight().T) if curve_of is None else curve_of(mesh)
    return DiscretePath.of(problem, path)


def _search(search: Search, guess: Guess | None, curve_of: Callable[[Mesh], Path] | None) -> Status:
    """Find a path, from a neighbour that is solved, from another guess, or from nothing."""
    ws, problem, status = search.ws, search.ws.problem, Status.NOT_FOUND
    if isinstance(guess, Solution) and isinstance(guess.problem, Problem) and guess.success:
        ws.gain = guess.stats.get("gain", ws.gain)  # a neighbour is as sensitive
        if guess.problem.system is problem.system:
            ws.many = search.given is None or search.given is guess.mesh
            if (neighbour := guess.neighbour) is not None:
                from actionopt.solver.search.near_guess import follow_expected

                assert curve_of is not None
                ws.units = neighbour.tr
                status = follow_expected(search, guess, curve_of)
            elif (problem.packed == guess.problem.packed).all():
                from actionopt.solver.search.near_guess import follow_neighbour

                ws.units, ws.checked = guess.discrete.tr, True
                status = follow_neighbour(search, guess)
    if status not in (Status.NOT_FOUND, Status.UNRESOLVED):
        return status
    if ws.linear and search.strategies is not IPOPT:
        return search.solve_linear(curve_of)
    if guess is None or curve_of is None:
        return search.from_nothing()
    from actionopt.solver.search.near_guess import follow_guess

    seen = None
    if not callable(guess):  # waypoints
        seen = Mesh.uniform(problem.start.t, problem.end.t, np.shape(guess)[-1] - 1, 1)
    return follow_guess(search, curve_of, seen)
