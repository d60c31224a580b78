"""Paths between given times, revised: a longer window, a nearer end, a rest to dwell at.

What is found on a window may ask for a longer one, or for a path that the action leads down to.
Where nothing was found, a nearer question may have an answer that can be followed to the one asked;
and between two equilibria the path of infinite time shows where one of finite time dwells.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from time import perf_counter

import numpy as np

from actionopt.analysis.solution import Solution
from actionopt.analysis.status import Status
from actionopt.discrete.meshes.path import Path
from actionopt.mechanics.question.events import Event
from actionopt.mechanics.question.problem import Problem
from actionopt.solver.input.arguments import Guess
from actionopt.solver.kinds.between import Choices, Found, between
from actionopt.solver.refinement.family import LOST, softest_condition
from actionopt.solver.refinement.verdict import message_of, solution_of
from actionopt.solver.refinement.workspace import Workspace
from actionopt.solver.search.search import Search
from actionopt.solver.search.strategies import (
    CHEAP,
    DESCENT_COORDINATES,
    GUESS_ONLY,
    IPOPT,
    QUICK,
    STRATEGIES,
)
from actionopt.tools.checks import FINEST, tolerance
from actionopt.tools.types import EPS
from actionopt.tools.watch import OutOfTime, Watch

# Ad hoc.
# The nearest end that is tried, in parts of the way or of the time; the longest and the shortest
# step, as factors of it; tries in all; how much longer the next step is; and the accuracy on the
# way.
NEAREST, LONGEST_ADVANCE, SHORTEST_ADVANCE, ADVANCES, LONGER, ON_THE_WAY = (
    2.0**-24,
    2.0,
    1.0002,
    120,
    1.5,
    1e-4,
)
MOST_FOLLOWED = 20_000  # iterations times elements on the way; geodesics were found after 640
DWELT = (*LOST, Status.DEGENERATE)  # what DWELLING may look like
# Part of its size by which the acceleration at a window's edge may be off: such a path is nowhere
# near rest, and is followed to a longer window by itself alone. Measured on 40 questions that have
# paths: 5e-2 at most.
AWAY = 1.0
DWELL_STEP = 1e-5  # of the way, that a motion makes at most from node to node at rest


def revise_all(problem: Problem, guess: Guess | None, choices: Choices) -> Found:
    """Return the path between events at given times, and the verdict with its figures."""
    return revise(problem, guess, choices, between(problem, guess, choices))


def revise(problem: Problem, guess: Guess | None, choices: Choices, found: Found) -> Found:
    """Return what was found between events at given times, or what it turns out to be."""
    for revision in REVISIONS:
        found = revision(problem, guess, choices, found)
    return found


# -- events at infinite times --------------------------------------------------------------------


def windows(
    problem: Problem, guess: Guess | None, choices: Choices, reason: str = "", shut: str = ""
) -> Found:
    """Return the path of a problem with events at infinite times, on a window that is long enough.

    A saddle that nothing asked for, or where nothing was found, is left for the path below. Where
    there is a `reason` why no motion is, only what comes of the first window; where no way is seen
    to be open (`shut`), what comes of quick searches.
    """
    from actionopt.solver.ends import window

    tolerance(choices.tol)
    here = window.first_window(problem.whole, guess, choices.tol, choices.mesh)
    inner = replace(choices, tol=max(choices.tol * (1 - window.SHARE), FINEST))
    if reason:
        inner = replace(inner, strategies=CHEAP)
        solution = replace(
            _on_window(here.problem, here.guess, inner)[0], status=Status.NOT_FOUND, error=np.inf
        )
        return solution, message_of(solution, choices.tol, reason=reason)
    if shut:
        inner = replace(inner, strategies=CHEAP)
    if here.guess is None and choices.strategies is GUESS_ONLY:  # the guess was the straight line
        inner = replace(inner, strategies=CHEAP)
    left = np.inf
    while True:
        solution, message = _on_window(here.problem, here.guess, inner)
        factors, below = window.factorize(solution), None
        if solution.status in LOST and (shut or choices.strategies is QUICK):
            return solution, message_of(solution, choices.tol, reason=shut)
        try:
            if solution.status in LOST and problem.system.n <= DESCENT_COORDINATES:
                below = window.descend_from_guess(here, choices.watch)
            elif here.guess is None and factors is not None and inner.principle != "stationary":
                below = window.descend_from_saddle(solution, factors, choices.watch)
        except OutOfTime:
            solution = replace(solution, status=Status.OUT_OF_TIME)
            message = f"{problem.name}: {solution.status.value} (tol = {choices.tol:g})"
        if below is not None:
            solution, message = _on_window(here.problem, below, inner)
            factors = window.factorize(solution)
        edges = here.edges(solution, factors)
        later = window.lengthen_window(here, solution, edges, choices.tol)
        if not solution.success or later is None or choices.mesh is not None:
            break
        left, before = max(edge.left for edge in edges), left
        if left > AWAY or choices.strategies is QUICK:
            inner = replace(inner, strategies=GUESS_ONLY)
        if not left <= before / 2:
            message = window.explain_short_window(choices.tol, max(edge.moved for edge in edges))
            solution = replace(solution, status=Status.UNRESOLVED)
            break
        here = later
    left_out = max(edge.moved for edge in edges)
    solution = replace(solution, error=solution.error + left_out)
    return window.centre(solution, here.problem.start.phase), message


def _on_window(problem: Problem, guess: Guess | None, choices: Choices) -> Found:
    """Return the path on a window; to a surface by way of the points that are near, the least."""
    from actionopt.solver.kinds.nearest_points import points
    from actionopt.solver.kinds.unfixed import solve_free_boundary

    if not problem.on_surface:
        return between(problem, guess, choices)
    if guess is not None:
        return solve_free_boundary(problem, guess, choices)
    found = []
    for fixed, _ in points(problem):
        near = between(fixed, None, replace(choices, mesh=None), verdict=False)[0]
        if near.success:
            found.append(solve_free_boundary(problem, near, choices))
    good = [known for known in found if known[0].success]
    if good:
        return min(good, key=lambda known: known[0].action)
    return found[0] if found else solve_free_boundary(problem, None, choices)


def infinite(problem: Problem, guess: Guess | None, choices: Choices) -> Iterator[Found]:
    """Yield what is found from a guess or from the straight line, and from a step at rest."""
    from actionopt.solver.ends import window
    from actionopt.solver.ends.durations import explain_rest
    from actionopt.solver.ends.lowest_pass import explain_leg

    reason, shut = explain_rest(problem.whole), ""
    if guess is None and not reason:
        shut = explain_leg(problem.whole)
    plain = guess is None and choices.is_plain
    if plain and choices.principle == "auto" and not (reason or shut):
        found = _beside_rest(problem, choices)
        if found is not None:
            yield found
            return
    found = windows(problem, guess, choices, reason, shut)
    yield found
    lost = not found[0].success and found[0].status is not Status.OUT_OF_TIME
    if (
        guess is None
        and lost
        and not (reason or shut)
        and choices.mesh is None
        and choices.principle == "auto"
    ):
        step = window.step(found[0].problem)
        if step is not None:
            yield windows(problem, step, choices)


def _beside_rest(problem: Problem, choices: Choices) -> Found | None:
    """Return the least path beside a rest if it is found quickly, or why there is none.

    None where other ways have to be tried.
    """
    from actionopt.solver.kinds.rest_between import has_other_rests, path_to_rest

    if not has_other_rests(problem.whole):
        return None
    found = windows(problem, None, replace(choices, strategies=QUICK))
    if _may_be_least(found[0]):
        return found
    try:
        path, reason = path_to_rest(problem.whole, choices)
    except OutOfTime:
        return None
    if reason:
        solution = replace(found[0], status=Status.NOT_FOUND, error=np.inf)
        return solution, message_of(solution, choices.tol, reason=reason)
    if path is None:
        return None
    found = windows(problem, path, replace(choices, strategies=GUESS_ONLY))
    return found if _may_be_least(found[0]) else None


def _may_be_least(solution: Solution) -> bool:
    """Whether a path was found whose action no known variation lowers; no descent is tried."""
    if solution.success and solution.stats["rung"] in {way.name for way in CHEAP}:  # these descend
        return True
    with suppress(ValueError):  # where L is not convex in the rates
        return solution.success and not solution.inertia.index
    return False


# -- from a nearer end ---------------------------------------------------------------------------


def follow_outwards(problem: Problem, guess: Guess | None, choices: Choices, found: Found) -> Found:
    """Return a path that is followed from a nearer end where none was found, or how far one goes.

    A geodesic is followed as its end moves away from its start along the straight line, a path of
    one coordinate without a clock over longer and longer times. Where it ends, it has as a rule
    merged with another path, and no path of its kind is there beyond.
    """
    solution, message = found
    plain = guess is None and choices.is_plain
    unsettled = solution.status is Status.UNRESOLVED  # as a path round a sharp turn may be
    unsettled &= problem.system.F is not None or choices.principle == "least"
    lost = unsettled or solution.status is Status.NOT_FOUND
    lost &= solution.stats["rung"] != "none"  # there is none
    if not (plain and lost and choices.principle != "stationary" and _extends(problem)):
        return found
    with suppress(OutOfTime, ValueError):
        far, part = _follow_to_end(problem, choices)
        if far is not None and choices.principle == "least" and far.inertia.index:
            far = replace(far, status=Status.NOT_LEAST)
            return far, message_of(far, choices.tol)
        if far is not None:
            return far, ""
        if part > 0:
            way = f"t = {problem.start.t + part * problem.duration:.4g}"
            if problem.system.F is not None:
                way = f"{part:.4g} of the way"
            message += (
                f"; a path that ends earlier was followed as its end moved on, as far as {way}, "
                "where it was lost, as a rule because it merges with another there and both end"
            )
    return solution, message


def _extends(problem: Problem) -> bool:
    """Whether a nearer question is another one of the kind."""
    system = problem.system
    free = not (system.m or system.r or system.structure.forced or problem.advance is not None)
    whole = len(problem.start.pinned) == system.n == len(problem.end.pinned)
    timed = system.n == 1 and not system.structure.depends_on_time
    return free and whole and system.order == 1 and (system.F is not None or timed)


def _nearer(problem: Problem, part: float) -> Problem:
    """Return the question with its end at a part of the way, for geodesics, or of the time."""
    start, end = problem.start, problem.end
    if problem.system.F is None:
        return problem.replace(end=end.at(start.t + part * problem.duration))
    a, b = (np.array(e.q, dtype=float) for e in (start, end))
    return problem.replace(end=Event(end.t, a + part * (b - a)))


def _follow_to_end(problem: Problem, choices: Choices) -> tuple[Solution | None, float]:
    """Return the path that was followed to the end asked, or None; and how far it was followed."""
    here, part = None, 1.0
    quick = replace(choices, tol=ON_THE_WAY, strategies=CHEAP, principle="auto")
    while here is None and part > NEAREST:
        part /= LONGEST_ADVANCE
        found, _ = between(_nearer(problem, part), None, quick)
        here = found if found.success else None
    if here is None:
        return None, 0.0
    step, spent = LONGEST_ADVANCE, 0
    for _ in range(ADVANCES):
        if spent > MOST_FOLLOWED:
            return None, 0.0  # not lost: it is not known where it leads
        to = min(1.0, part * step)
        there, tol = _nearer(problem, to), choices.tol if to == 1 else ON_THE_WAY
        found = _near_guess(there, stretch_to_end(here, there, to / part), tol, choices.watch)
        spent += found.mesh.elements * sum(found.stats["iterations"].values())
        if found.success and to == 1:
            return found, 1.0
        if found.success:
            here, part, step = found, to, min(step**LONGER, LONGEST_ADVANCE)
        else:
            step = np.sqrt(step)
            if step < SHORTEST_ADVANCE:
                break
    return None, part


def _near_guess(problem: Problem, guess: Path, tol: float, watch: Watch | None) -> Solution:
    """Return the path near a guess, on its own mesh, by Newton's method: most are too far away."""
    ws, started = Workspace(problem, tol=tol, watch=watch), perf_counter()
    search = Search(ws, tol, "auto", None, GUESS_ONLY)
    search.begin("guess")
    ws.transcribe(guess.mesh, guess, like=guess)
    found = ws.follow() or ws.approach()
    return solution_of(ws, search.refine() if found else Status.NOT_FOUND, "guess", started)


def stretch_to_end(path: Solution, problem: Problem, factor: float) -> Path:
    """Return a path stretched to another end; of a geodesic what leaves the straight line grows."""
    mesh = path.mesh.moved(problem.start.t, problem.end.t)
    values = path.path.values
    if problem.system.F is None:
        return Path(mesh, values)
    s = mesh.nodes_since / mesh.duration
    a, b = (np.array(e.q, dtype=float)[:, None] for e in (problem.start, problem.end))
    line = values[:, :1] + s * (values[:, -1:] - values[:, :1])
    return Path(mesh, a + s * (b - a) + factor * (values - line))


# -- between two equilibria ----------------------------------------------------------------------


def explain_dwelling(
    problem: Problem, guess: Guess | None, choices: Choices, found: Found
) -> Found:
    """Return what can be said of a path that was not found between two equilibria, or rests there.

    The path of infinite time shows the way, if there is one. A path that was found is asked only
    whether its place in time is determined.
    """
    solution, _ = found
    if (
        choices.mesh is not None
        or choices.strategies not in (STRATEGIES, IPOPT)
        or problem.system.r
        or problem.system.order > 1
    ):
        return found
    if not (solution.status in DWELT or _is_at_rest(solution)):
        return found
    from actionopt.solver.ends import window

    whole = window.infinite_problem(problem)
    if whole is None:
        return found
    softest = _least_bend(solution) if solution.success else 0.0
    if softest == np.inf:
        return found
    if guess is None and not solution.success:
        with suppress(OutOfTime, ValueError):
            known = next((s for s, _ in infinite(whole, None, choices) if s.success), None)
            if known is not None:
                near = between(problem, window.restrict_guess(known, problem), choices)
                # What a symmetry holds in its place shows no round-off.
                softest = _least_bend(near[0]) if near[0].success else 0.0
                if softest == np.inf:
                    return near
                if near[0].success or near[0].status is Status.DEGENERATE:
                    solution = near[0]
    stats = solution.stats
    if solution.success:
        condition = 1 / max(softest, EPS)
        stats = stats | {"condition": max(stats["condition"], condition)}
    solution = replace(solution, status=Status.DWELLING, stats=stats)
    return solution, f"{problem.name}: {Status.DWELLING.value} (tol = {choices.tol:g})"


def _least_bend(solution: Solution) -> float:
    """Return the least |mu| of the second variation if it has no sign, else infinity."""
    from actionopt.analysis.quadratic.index import INDEX_TOLERANCE

    if solution.problem.system.n == 1:
        bound = _bend_of_shift(solution)
        if bound < INDEX_TOLERANCE:
            return bound
    found = solution.inertia
    return 1 / softest_condition(found) if found.nullity else np.inf


def _bend_of_shift(solution: Solution) -> float:
    """Return a bound on the least eigenvalue mu of a path of one coordinate that never turns.

    Without a clock v solves Jacobi's equation. It does not vanish inside, so that all mu are
    positive, and no more than Rayleigh's quotient of f v for any f that vanishes at the ends:

        d2S[f v] = int f'^2 v.L_vv v dt,

    least with f' as 1 / (v.L_vv v), from either end to where that is largest. Infinite if it turns.
    """
    from actionopt.analysis.quadratic.second_variation import second_derivatives

    tr = solution.discrete.tr
    place = tr.place(solution.discrete.x)
    v, weight = place.v[:, 0], tr.weight[:, 0]
    known = solution.velocity_error * np.abs(v).max()  # at rest no sign is
    if min(-v.min(), v.max()) > known:
        return np.inf
    mass = second_derivatives(solution.problem, place.at, place.v, tr.times)[2][:, 0, 0]
    moment = mass * np.maximum(np.abs(v), known) ** 2
    t = tr.times[:, 0]
    before = t <= t[np.argmax(moment)]
    share = weight / moment
    stretched = 1 / share[before].sum() + 1 / share[~before].sum()
    return float(stretched / np.sum(weight * mass * solution.acceleration(t)[0] ** 2))


def _is_at_rest(solution: Solution) -> bool:
    """Whether a path that moves hardly leaves its first node, nor comes to its last."""
    values = solution.path.values
    first, last = values[:, 1] - values[:, 0], values[:, -1] - values[:, -2]
    ends = max(np.abs(first).max(), np.abs(last).max())
    return bool(ends < DWELL_STEP * (values.max(axis=1) - values.min(axis=1)).max())


Revision = Callable[[Problem, Guess | None, Choices, Found], Found]
REVISIONS: tuple[Revision, ...] = (
    follow_outwards,
    explain_dwelling,
)  # what is asked of an answer, in turn
