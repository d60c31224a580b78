"""From a question to its answers: where to begin, how a path is reached from there, what to revise.

A question is asked from one start after the other, the cheapest first (`starts`). From each a path
is sought between given times (`between`, by the moves of `strategies`), or with what is to be found
beside it (`unfixed`); then it is asked whether the structure of the question was right, and which
other one answers it if not (`revisions`). `solve` takes the first acceptable answer, a search for
all paths all that are distinct.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from itertools import islice

import numpy as np

from actionopt.analysis.solution import Solution
from actionopt.analysis.status import Status
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.mechanics.question.events import Event
from actionopt.mechanics.question.problem import Problem
from actionopt.solver.input.arguments import Guess, check_arguments, curve, read_guess
from actionopt.solver.kinds.between import Choices, Found, between
from actionopt.solver.kinds.revisions import infinite, revise_all
from actionopt.solver.refinement.first_mesh import COARSE_DEGREE, LINEAR
from actionopt.solver.refinement.iterate import AT_REST, ROUNDED
from actionopt.solver.refinement.verdict import message_of
from actionopt.solver.search.strategies import IPOPT
from actionopt.tools.watch import OutOfTime

SHRUNK = "the closed path shrank to a point: give a guess that goes round an obstacle"


def first_acceptable(problem: Problem, guess: Guess | None, choices: Choices) -> Found:
    """Return the first acceptable answer; else the one of the least index, or the first attempt."""
    guess = read_guess(problem, guess)
    best, least = None, np.inf
    for found in pursue(problem, guess, choices):
        rank = np.inf
        if found[0].success:
            several = problem.on_surface and not problem.is_joined  # of those one comes
            several &= guess is None and choices.principle != "stationary"
            rank = _index(found[0]) if several else 0
        ended = least == np.inf and found[0].status is Status.OUT_OF_TIME  # not sought to the end
        if best is None or rank < least or ended:
            best, least = found, rank
        if rank == 0:
            break
    assert best is not None
    solution, message = best
    if problem.system.F is not None and solution.success:
        try:
            _ = solution.length
        except ValueError as error:  # a negative length is no geodesic's
            message = f"{problem.name}: {Status.NOT_FOUND.value}; {error}"
            solution = replace(solution, status=Status.NOT_FOUND, error=np.inf)
    return solution, message


def pursue(problem: Problem, guess: Guess | None, choices: Choices) -> Iterator[Found]:
    """Yield what is found of a question of any kind from each start, and the verdict on it.

    A path is best where it is least, of those to the nearest points of a surface; from other starts
    one is enough.
    """
    if problem.leads_to_rest:
        yield from infinite(problem, guess, choices)
        return
    if not problem.has_free_boundary:
        if choices.is_plain and problem.may_cross_kinks:
            from actionopt.solver.kinds.kinks import cross_kinks

            yield cross_kinks(problem, guess, choices)
            return
        yield revise_all(problem, guess, choices)
        return
    from actionopt.solver.kinds.free_contact import free_contact

    if problem.original.is_joined and problem.system.r:
        yield _along(problem.original, guess, choices)
        return
    if problem.original.is_joined:
        yield _through(problem.original, guess, choices)
        return
    if problem.asked is not None:
        if callable(guess) and not isinstance(guess, (Path, Solution)):
            b = problem.start.t, problem.end.t  # a curve over the times that are known
            guess = curve(problem, guess)(Mesh.uniform(*b, 4 * LINEAR, COARSE_DEGREE))
        problem = problem.asked
    check_arguments(problem, choices.tol, None, choices.principle, choices.mesh)
    given = not problem.has_open_ends  # a closed path of a given period
    if problem.system.r and not given:
        yield free_contact(problem, guess, choices)
    elif given and (problem.system.r or guess is None or choices.mesh):
        yield _of_given_period(problem, guess, choices)
    else:
        yield from _from_starts(problem, guess, choices)


def _of_given_period(problem: Problem, guess: Guess | None, choices: Choices) -> Found:
    """Return a closed path of a given period, and the verdict."""
    from actionopt.solver.kinds.unfixed import solve_free_boundary

    found = between(problem, guess, choices)
    if problem.system.r and not is_moving(found[0]):
        path = replace(found[0], status=Status.NOT_FOUND, error=np.inf)
        return path, message_of(path, choices.tol, SHRUNK)
    if choices.mesh is None and not problem.system.r:  # a kink at the start? one of many?
        return solve_free_boundary(problem, found[0], choices)
    return found


def _from_starts(problem: Problem, guess: Guess | None, choices: Choices) -> Iterator[Found]:
    """Yield paths whose duration is to be found, or that close, from one start after the other."""
    from actionopt.solver.kinds.unfixed import solve_free_boundary

    led = False
    last = None
    try:
        for k, group in enumerate(starts(problem, guess, choices)):
            for start in group:
                keep = guess is not None and problem.closes
                last = solve_free_boundary(problem, start, choices, keep=keep)
                if problem.on_surface and guess is None:
                    last = replace(last[0], stats=last[0].stats | {"rung": "surface"}), last[1]
                yield last
                led = led or last[0].success
                if led and k:
                    return
            if led:
                return
    except OutOfTime:  # on the way to a start
        if not led:
            path, _ = last or solve_free_boundary(problem, None, choices)
            path = replace(path, status=Status.OUT_OF_TIME)
            yield path, message_of(path, choices.tol)
        return
    if last is None:
        yield solve_free_boundary(problem, None, choices)


def _along(problem: Problem, guess: Guess | None, choices: Choices) -> Found:
    """Return a path along an obstacle beside which more is to be found, and the verdict.

    A closed one that begins on a surface is found from a free start, and begun there.
    """
    from actionopt.solver.kinds.closed_contact import begin_at_surface
    from actionopt.solver.kinds.free_contact import free_contact

    if problem.advance is None or problem.start.on is None:
        given = not (problem.has_open_ends or problem.has_open_events)
        check_arguments(problem, choices.tol, None, choices.principle, choices.mesh)
        if problem.has_open_events:
            _check_no_mesh(choices)
        return (between if given else free_contact)(problem, guess, choices)
    free = problem.replace(start=Event(problem.start.t, [None] * problem.system.n))
    found = first_acceptable(free, guess, choices)
    return begin_at_surface(problem, found[0], choices) if found[0].success else found


def _check_no_mesh(choices: Choices) -> None:
    """Raise ValueError for choices that do not go with events that are to be found."""
    if choices.mesh is not None or choices.strategies is IPOPT:
        raise ValueError(
            "expected neither a mesh nor method 'ipopt' where times or places of events, or "
            "multipliers of integrals, are to be found: both know what is given; leave them out, "
            "and give tol"
        )


def _through(problem: Problem, guess: Guess | None, choices: Choices) -> Found:
    """Return the path through events whose times or places are to be found, and the verdict."""
    from actionopt.solver.ends.durations import explain_barrier
    from actionopt.solver.kinds.through import solve_through

    check_arguments(problem, choices.tol, None, choices.principle, None)
    _check_no_mesh(choices)
    known = choices.tol, guess, choices.principle, choices.watch
    solution, hint = solve_through(problem, *known)
    reason = explain_barrier(problem) if solution.status is Status.NOT_FOUND else ""
    return solution, message_of(solution, choices.tol, hint, reason)


def starts(
    problem: Problem, guess: Guess | None, choices: Choices
) -> Iterable[Iterable[Guess | DiscretePath | None]]:
    """Return groups of guesses; one is asked for only if none before led to a path."""
    from actionopt.solver.ends.durations import between_turning_points
    from actionopt.solver.kinds.nearest_points import (
        NEAREST_POINTS,
        motions,
        paths_between_given_times,
        paths_to_points,
    )

    if guess is not None:
        return ([guess],)
    if problem.on_surface:
        watch = choices.watch
        quick = islice(paths_to_points(problem, choices.tol, watch), NEAREST_POINTS)
        return quick, paths_between_given_times(problem, watch), motions(problem, watch)
    if not problem.closes:
        return ([None],)
    path = between_turning_points(problem)
    return (_oscillations(problem) if path is None else [path],)


def _oscillations(problem: Problem) -> list[Path]:
    """Return small oscillations about the equilibrium near the start. Raises ValueError if none."""
    from actionopt.solver.ends.durations import oscillations

    found = oscillations(problem)
    if not found:
        raise ValueError(
            "expected a guess for a closed path whose period is to be found: a Path or a "
            "solution near it, or waypoints round it; none is needed for one coordinate that "
            f"is bound at that energy, {problem.energy:.15g}, near where it starts, or turns "
            "with the advance that is given, nor where a stable equilibrium is near the start"
        )
    return found


def _index(solution: Solution) -> int:
    """Return the index of a path between surfaces; 0 where there is none to count.

    Its own matrix counts those that vanish but for round-off besides.
    """
    if not solution.stats.get("index", 1):
        return 0
    from actionopt.analysis.quadratic.index import inertia_through

    with suppress(ValueError, np.linalg.LinAlgError):
        return inertia_through(solution.discrete, solution.error).index
    return 0


def is_moving(solution: Solution) -> bool:
    """Whether the path moves at all."""
    speed = np.abs(solution.path.velocity(solution.mesh.nodes)).max(axis=1)
    size = np.abs(solution.path.values).max(axis=1)
    size = np.maximum(size, ROUNDED * solution.problem.scales)
    return bool((speed * solution.duration > AT_REST * size).any())
