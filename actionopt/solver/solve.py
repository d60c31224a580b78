"""From a problem to a solution: find a path on a coarse mesh, then follow it to the tolerance.

Finding (`ladder`) and following (`refine`) are different work, on the same path (`iterate`).
*Finding* starts from the straight line, or from a guess. *Following* is Newton's: each refinement
round interpolates the path on a better mesh and polishes it there, always the same path.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from time import perf_counter
from typing import Literal, Never

import numpy as np

from actionopt.analysis.solution import Solution, SolveError
from actionopt.analysis.status import Status
from actionopt.discrete.crossing import Jump, crossed, unbalanced
from actionopt.discrete.discrete_path import DiscretePath
from actionopt.discrete.mesh import Mesh
from actionopt.discrete.path import Path
from actionopt.discrete.transcription import Transcription
from actionopt.mechanics.held import Held
from actionopt.mechanics.problem import Problem
from actionopt.solver import nearer, window
from actionopt.solver.arguments import Guess, asked, checked, curve
from actionopt.solver.durations import oscillations, well
from actionopt.solver.family import LOST, conditioned, judged, suspected
from actionopt.solver.ladder import (
    BRIEF,
    COARSE_DEGREE,
    CURVED_RUNGS,
    IPOPT,
    LADDER,
    LINEAR,
    NEAR,
    Rung,
    Search,
)
from actionopt.solver.least_along import along
from actionopt.solver.obstacle import Along
from actionopt.solver.on_surface import solve_on_surface
from actionopt.solver.signals import SIGNALS, status_of
from actionopt.solver.unfixed import solve_unfixed
from actionopt.solver.verdict import message_of, solution_of
from actionopt.solver.workspace import Workspace
from actionopt.tools.blas import one_thread
from actionopt.tools.checks import COARSEST, FINEST, among, tolerance
from actionopt.tools.watch import OutOfTime, Progress, Watch

LADDERS = {"auto": LADDER, "ipopt": IPOPT}  # by method
AT_REST = 1e-6  # displacement / size below which a closed path is an equilibrium; ad hoc
ROUNDED = 1e-9  # of the size told by the events, below which a path may be zero; ad hoc
BEFORE_A_JUMP = 3  # rungs tried where the first path crosses a jump: seconds are lost there; ad hoc
# By principle, after what a path is followed from a nearer end: a least one was not settled.
MISSED = {"auto": (Status.NOT_FOUND,), "least": (Status.NOT_FOUND, Status.UNRESOLVED)}
DWELT = (Status.NOT_FOUND, Status.UNRESOLVED, Status.DEGENERATE)  # what DWELLING may look like
DWELL_STEP = 1e-5  # of the way, that a motion makes at most from node to node at rest; ad hoc


@one_thread
def solve(
    problem: Problem,
    *others: Never,
    tol: float = 1e-8,
    guess: Guess | None = None,
    principle: Literal["auto", "least", "stationary"] = "auto",
    method: Literal["auto", "ipopt"] = "auto",
    mesh: Mesh | None = None,
    seconds: float | None = None,
    progress: Progress | None = None,
    throw: bool = True,
) -> Solution:
    """Return the path between the events of `problem` that makes its action stationary.

    Parameters
    ----------
    problem : Problem
        The system and the two events.
    tol : float
        Bound on the maximum over time of |q_h(t) - q(t)|, each coordinate in units of the
        largest |q| it reaches; between 1e-14 and 0.1.
    guess : Path, Solution, callable or array, optional
        A curve near the path wanted: a callable of (K,) times returning (n, K), or waypoints
        (n, K) at equal times. With a guess the stationary path near it is returned; without
        one, a least path if there is one, else a stationary one.
    principle : {"auto", "least", "stationary"}
        What to ask of the action.
    method : {"auto", "ipopt"}
        Which ways lead to a first path: "auto" tries our own (Newton's method, Levenberg and
        Marquardt's, a descent, a homotopy, motions that meet) and Ipopt, each where it is best;
        "ipopt" asks Ipopt alone. It is followed from mesh to mesh by Newton's method.
    mesh : Mesh, optional
        Solve on this mesh and do not refine.
    seconds : float, optional
        The time it may take, a little more where one evaluation takes long; then the best attempt
        is what there is. Ways that take longer, at the pace so far, are tried after the others.
        Without it, a search that finds nothing ends at a cost that is counted, in evaluations of
        second derivatives.
    progress : callable, optional
        `progress(stage, done, total, detail)` at every iteration: the strategy that is being
        tried, the iterations so far, None (nobody knows how many there will be), and
        {"elements": those of the mesh at hand}. What it raises ends the solve.
    throw : bool
        Raise on failure; otherwise return the best attempt with its `status`.

    Raises
    ------
    ValueError
        For bad input, before any solver runs.
    TypeError
        For more than the problem without a name.
    SolveError
        If no path was found or the tolerance was not met; it carries the best attempt.
    KeyboardInterrupt
        If interrupted, also from within Ipopt; so for whatever else a signal handler raises.

    References
    ----------
    *Competitive Physics: Mechanics and Waves* (2018), sections 12.1-12.4; Marsden and West,
    *Discrete mechanics and variational integrators*, Acta Numerica 10 (2001), sections 1.2
    and 2.2.
    """
    if others:
        asked(problem, others)
    asked(problem)
    if not among(method, LADDERS):
        raise ValueError(f"expected method 'auto' or 'ipopt', found {method!r}")
    if not isinstance(throw, (bool, np.bool_)):
        raise ValueError(f"expected throw=True or throw=False, found {throw!r}")
    watch = None if seconds is progress is None else Watch(seconds, progress)
    choices = Choices(tol, principle, LADDERS[method], mesh, watch)
    solution, message = _answered(problem, guess, choices)
    if throw and not solution.success:
        raise SolveError(message, solution)
    return solution


@one_thread
def solve_near(problem: Problem, guess: Guess | None, tol: float) -> Solution:
    """Return the path near a guess, or the best attempt, as `solve` does.

    By Newton's and by Levenberg and Marquardt's methods alone: where there is no path near, that
    takes a hundredth of the time. Without a guess by descent from the straight line.
    """
    asked(problem)
    ladder = BRIEF if guess is None else NEAR
    return _asked(problem, guess, Choices(tol, "auto", ladder, None, None))[0]


@dataclass(frozen=True)
class Choices:
    """How a problem is solved: the arguments of `solve`, its method as a ladder."""

    tol: float
    principle: Literal["auto", "least", "stationary"]
    ladder: tuple[Rung, ...]
    mesh: Mesh | None
    watch: Watch | None


def _answered(problem: Problem, guess: Guess | None, choices: Choices) -> tuple[Solution, str]:
    """Return the path, and the verdict with its figures; of a path that dwells, that it does."""
    solution, message = _asked(problem, guess, choices)
    fixed = choices.mesh is not None or problem.system.r > 0
    timed = not (fixed or problem.unfixed or solution.problem.has_tails)
    if timed and (solution.status in DWELT or _is_at_rest(solution)):
        return _dwelling(problem, guess, choices, solution, message)
    return solution, message


def solve_on_the_way(
    outer: Watch | None,
    problem: Problem,
    *,
    tol: float,
    guess: Guess | None = None,
    brief: bool = False,
) -> Solution:
    """Return a path, or an attempt, in the time that is left for a search that needs it on its way.

    Whether it is one of a family is not asked. With `brief` no long ways are tried. Raises
    OutOfTime if no time is left.
    """
    watch = None if outer is None else Watch(None, None, outer)
    ladder = LADDER[:CURVED_RUNGS] if brief else LADDER
    found, _ = _solved(problem, guess, Choices(tol, "auto", ladder, None, watch), verdict=False)
    if found.status is Status.OUT_OF_TIME:
        raise OutOfTime
    return found


def _asked(problem: Problem, guess: Guess | None, choices: Choices) -> tuple[Solution, str]:
    """Return the path, and the verdict with its figures: a negative length is no geodesic's."""
    solution, message = _of_its_kind(problem, guess, choices)
    if problem.system.F is not None and solution.success:
        try:
            _ = solution.length
        except ValueError as error:
            message = f"{problem.name}: {Status.NOT_FOUND.value}; {error}"
            solution = replace(solution, status=Status.NOT_FOUND, error=np.inf)
    return solution, message


def _of_its_kind(problem: Problem, guess: Guess | None, choices: Choices) -> tuple[Solution, str]:
    """Return the path of a question of any kind, and the verdict with its figures."""
    if problem.unfixed:
        timed = problem.asked is not None
        if timed and callable(guess) and not isinstance(guess, (Path, Solution)):
            b = problem.start.t, problem.end.t  # a curve over the times that are known
            guess = curve(problem, guess)(Mesh.uniform(*b, 4 * LINEAR, COARSE_DEGREE))
        found = _unfixed(problem.asked or problem, guess, choices)
        if found is None:
            found = _solved(problem, guess, choices)
            if choices.mesh is None and moves(found[0]):  # it may be kinked at the start
                found = _unfixed(problem, found[0], choices) or found
        return found
    if problem.is_infinite or problem.has_tails:
        return _in_windows(problem.whole, guess, choices)
    solution, message = _solved(problem, guess, choices)
    plain = guess is None and choices.mesh is None and choices.ladder is LADDER
    lost = plain and solution.status in MISSED.get(choices.principle, ())
    if lost and nearer.applies(problem):
        return _outwards(problem, choices, solution, message)
    return solution, message


def _outwards(
    problem: Problem, choices: Choices, solution: Solution, message: str
) -> tuple[Solution, str]:
    """Return a path that is followed from a nearer end, or how far one goes."""

    def near(there: Problem, guess: Path | None, tol: float) -> Solution:
        if guess is None:
            return _solved(there, None, replace(choices, tol=tol, ladder=BRIEF, principle="auto"))[
                0
            ]
        # On the guess's own mesh alone, and by Newton's method: most steps are too long.
        ws, started = Workspace(there, tol=tol, watch=choices.watch), perf_counter()
        search = Search(ws, tol, "auto", None, NEAR)
        search.begin("guess")
        ws.transcribe(guess.mesh, guess, like=guess)
        found = ws.follow() or ws.approach()
        return solution_of(ws, search.refine() if found else Status.NOT_FOUND, "guess", started)

    with suppress(OutOfTime, ValueError):
        found, part = nearer.outwards(problem, near, choices.tol)
        if found is not None and choices.principle == "least" and found.inertia.index:
            found = replace(found, status=Status.NOT_LEAST)
            return found, message_of(found, choices.tol)
        if found is not None:
            return found, ""
        if part > 0:
            way = f"t = {problem.start.t + part * problem.duration:.4g}"
            if problem.system.F is not None:
                way = f"{part:.4g} of the way"
            message += (
                f"; a path that ends earlier was followed as its end moved on, as far as {way}, "
                "where it was lost, as a rule because it merges with another there and both end"
            )
    return solution, message


def _solved(
    problem: Problem, guess: Guess | None, choices: Choices, *, verdict: bool = True
) -> tuple[Solution, str]:
    """Return the path of a problem of finite times, and the verdict with its figures.

    Without `verdict`, whether it is one of a family is not asked.
    """
    started = perf_counter()
    tol, principle, mesh, watch = choices.tol, choices.principle, choices.mesh, choices.watch
    curve_of = checked(problem, tol, guess, principle, mesh)
    system = problem.system
    # Far from zero a path to `tol` may be none: its motion is to be resolved as well.
    tol = min(tol, COARSEST * float((problem.lengths / problem.scales).min()))
    if system.r:
        ws: Workspace = Along(Held(problem), tol=tol, watch=watch)
    else:
        ws = Workspace(problem, system.structure.linear, tol, refines=mesh is None, watch=watch)
    for name in ("first", "second"):
        system.pointwise(name)
    ws.record.time["derive"] += perf_counter() - started
    search = Search(ws, tol, principle, mesh, choices.ladder)
    try:
        if isinstance(ws, Along):
            search.begin("obstacle", least=True)
            search.ws, status = along(ws, tol, curve_of)
        else:
            status = _found(search, guess, curve_of)
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
    if verdict and suspected(ws, status):
        solution = judged(ws, solution)
    return solution, "" if solution.success else message_of(solution, tol, ws.hint)


def _dwelling(
    problem: Problem, guess: Guess | None, choices: Choices, solution: Solution, message: str
) -> tuple[Solution, str]:
    """Return what can be said of a path that was not found between two equilibria, and a verdict.

    That of infinite time shows the way, if there is one. Of a path that was found, only whether its
    place in time is determined.
    """
    whole = window.between(problem)
    if whole is None or (solution.success and not solution.inertia.nullity):
        return solution, message
    if guess is None:
        with suppress(OutOfTime, ValueError):
            known, _ = _in_windows(whole, None, choices)
            if known.success:
                near = _solved(problem, window.within(known, problem), choices)
                # What a symmetry holds in its place shows no round-off.
                if near[0].success and not near[0].inertia.nullity:
                    return near
                if near[0].success or near[0].status is Status.DEGENERATE:
                    solution = near[0]
    stats = solution.stats
    if solution.success:
        stats = stats | {"condition": max(stats["condition"], conditioned(solution.inertia))}
    solution = replace(solution, status=Status.DWELLING, stats=stats)
    return solution, f"{problem.name}: {Status.DWELLING.value} (tol = {choices.tol:g})"


def _is_at_rest(solution: Solution) -> bool:
    """Whether a path that moves hardly leaves its first node, nor comes to its last."""
    values = solution.path.values
    first, last = values[:, 1] - values[:, 0], values[:, -1] - values[:, -2]
    ends = max(np.abs(first).max(), np.abs(last).max())
    return bool(ends < DWELL_STEP * (values.max(axis=1) - values.min(axis=1)).max())


def moving(solution: Solution) -> Solution:
    """Return a solution, as none if it is at rest where a motion is looked for.

    That is where a path closes anywhere along itself, or tends to rest.
    """
    problem = solution.problem
    sought = problem.closes or problem.is_infinite or problem.has_tails
    if not sought or not solution.success or moves(solution):
        return solution
    return replace(solution, status=Status.NOT_FOUND, error=np.inf)


def _in_windows(problem: Problem, guess: Guess | None, choices: Choices) -> tuple[Solution, str]:
    """Return the path of a problem with events at infinite times, and the verdict."""
    tolerance(choices.tol)
    here = window.first(problem, guess, choices.tol, choices.mesh)
    inner = replace(choices, tol=max(choices.tol * (1 - window.SHARE), FINEST))
    if here.guess is None and choices.ladder is NEAR:  # the guess was the straight line
        inner = replace(inner, ladder=BRIEF)
    left = np.inf
    while True:
        solution, message = _solved(here.problem, here.guess, inner)
        factors, below = window.factored(solution), None
        try:
            if solution.status in LOST and problem.system.n <= window.FEW:
                below = window.down(here, choices.watch)
            elif here.guess is None and factors is not None and inner.principle != "stationary":
                below = window.lower(solution, factors, choices.watch)
        except OutOfTime:
            solution = replace(solution, status=Status.OUT_OF_TIME)
            message = f"{problem.name}: {solution.status.value} (tol = {choices.tol:g})"
        if below is not None:
            solution, message = _solved(here.problem, below, inner)
            factors = window.factored(solution)
        edges = here.edges(solution, factors)
        later = window.longer(here, solution, edges, choices.tol)
        if not solution.success or later is None or choices.mesh is not None:
            break
        left, before = max(edge.left for edge in edges), left
        if not left <= before / 2:
            message = window.unmet(choices.tol, max(edge.moved for edge in edges))
            solution = replace(solution, status=Status.UNRESOLVED)
            break
        here = later
    lost = not solution.success and solution.status is not Status.OUT_OF_TIME
    if guess is None and lost and choices.mesh is None and choices.principle == "auto":
        step = window.step(here.problem)
        if step is not None:
            again, told = _in_windows(problem, step, choices)
            if again.success:
                return again, told
    solution = window.judged(solution, edges)
    return window.centred(solution), message


def moves(solution: Solution) -> bool:
    """Whether the path moves at all."""
    speed = np.abs(solution.velocity(solution.mesh.nodes)).max(axis=1)
    size = np.abs(solution.path.values).max(axis=1)
    size = np.maximum(size, ROUNDED * solution.problem.scales)
    return bool((speed * solution.duration > AT_REST * size).any())


def _unfixed(
    problem: Problem, guess: Guess | None, choices: Choices
) -> tuple[Solution, str] | None:
    """Return the path whose duration is free or that closes anywhere, and the verdict.

    None where there is nothing of the kind to be found: a closed path that is not said to move.
    """
    tolerance(choices.tol)
    if choices.ladder is IPOPT:
        raise ValueError(
            "expected method 'auto' where a time is free, an event lies on a surface, or a path "
            "closes that may begin anywhere along itself, found 'ipopt': it knows given events"
        )
    if problem.on_surface:
        checked(problem, choices.tol, None, choices.principle, None)
        if choices.mesh is not None:
            raise ValueError(
                "expected no mesh where an event lies on a surface, found one: where it ends is "
                "found on meshes of their own; leave it out, and give tol"
            )
    elif problem.free_time:
        if choices.mesh is not None:
            raise ValueError(
                "expected no mesh where a time is free, found one: it would be over given times"
            )
        if problem.closes and guess is None:
            guess = well(problem)
        if problem.closes and guess is None:
            return _oscillating(problem, choices)
    elif guess is None or choices.mesh is not None:
        return None
    tol, principle, watch = choices.tol, choices.principle, choices.watch
    thorough = choices.ladder is not NEAR
    way = solve_on_surface if problem.on_surface else solve_unfixed
    first = partial(solve_on_the_way, watch)
    solution, hint = way(problem, first, tol, guess, principle, watch, thorough=thorough)
    return solution, message_of(solution, tol, hint)


def _oscillating(problem: Problem, choices: Choices) -> tuple[Solution, str]:
    """Return a closed path near a small oscillation about the equilibrium near its start."""
    found = None
    for guess in oscillations(problem):
        found = _unfixed(problem, guess, choices)
        if found is not None and found[0].success:
            break
    if found is None:
        raise ValueError(
            "expected a guess for a closed path whose period is to be found: a Path or a "
            "solution near it, or waypoints round it; none is needed for one coordinate that "
            f"is bound at that energy, {problem.energy:g}, near where it starts, or turns "
            "with the advance that is given, nor where a stable equilibrium is near the start"
        )
    return found


def _found(search: Search, guess: Guess | None, curve_of: Callable[[Mesh], Path] | None) -> Status:
    """Find a path that crosses no jump of L."""
    ws, problem = search.ws, search.ws.problem
    steps, jump = problem.system.switches, None
    if steps is not None:
        first = _first(problem, curve_of)
        jump = crossed(steps, problem, first.path)
    if jump is not None and jump.inevitable:
        ws.transcribe(first.mesh, first.path)
        search.found_by = "none"
    else:
        if jump is not None:
            search.ladder = search.ladder[:BEFORE_A_JUMP]
        status = _sought(search, guess, curve_of)
        # What was lost on the way may have been lost at a jump that the first path crosses.
        lost = status in (Status.NOT_FOUND, Status.UNRESOLVED)
        if steps is not None:
            before = None if status.success else jump
            jump = crossed(steps, problem, search.ws.here.path) or before
        if jump is None and lost and not problem.system.structure.jumpless:
            tried = filter(None, (search.ws.iterate, _first(problem, curve_of)))
            found = (unbalanced(at, search.ws.tol) for at in tried)
            jump = next((off for off in found if isinstance(off, Jump)), None)
        if jump is None:
            return status
    ws = search.ws
    ws.hint, ws.here = str(jump), replace(ws.here, error=np.inf)
    return Status.JUMP


def _first(problem: Problem, curve_of: Callable[[Mesh], Path] | None) -> DiscretePath:
    """Return the straight line between the events, or the guess."""
    mesh = Mesh.uniform(problem.start.t, problem.end.t, LINEAR, COARSE_DEGREE)
    tr = Transcription(problem, mesh, problem.lengths)
    path = Path(mesh, tr.straight().T) if curve_of is None else curve_of(mesh)
    return DiscretePath.of(problem, path)


def _sought(search: Search, guess: Guess | None, curve_of: Callable[[Mesh], Path] | None) -> Status:
    """Find a path, from a neighbour that is solved, from another guess, or from nothing."""
    ws, problem, status = search.ws, search.ws.problem, Status.NOT_FOUND
    if isinstance(guess, Solution) and isinstance(guess.problem, Problem) and guess.success:
        ws.gain = guess.stats.get("gain", ws.gain)  # a neighbour is as sensitive
        if guess.problem.system is problem.system:
            ws.many = search.given is None or search.given is guess.mesh
            if (problem.packed == guess.problem.packed).all():
                ws.units, ws.checked = guess.discrete.tr, True
                status = search.from_neighbour(guess)
    if status not in (Status.NOT_FOUND, Status.UNRESOLVED):
        return status
    if ws.linear and search.ladder is not IPOPT:
        return search.solve_linear(curve_of)
    return search.from_nothing() if curve_of is None else search.from_guess(curve_of)
