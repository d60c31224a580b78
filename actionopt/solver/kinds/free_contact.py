"""Paths along an obstacle whose duration is to be found, or which end on surfaces.

A path between given events comes first, at a duration and to points that are near: it tells what is
in contact. From there the times of contact, the duration and the multipliers of the surfaces are
unknowns beside the path, and found at once.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from itertools import islice
from time import perf_counter
from typing import Any

import numpy as np

from actionopt.analysis.solution import Solution
from actionopt.analysis.status import Status
from actionopt.discrete.borders.borders import over, times_of, times_over
from actionopt.discrete.borders.surfaces import onto
from actionopt.discrete.meshes.path import Path
from actionopt.mechanics.question.held import Held
from actionopt.mechanics.question.problem import Problem
from actionopt.solver.contact.least_along import release_contacts
from actionopt.solver.contact.obstacle import Along
from actionopt.solver.contact.touching import Touching
from actionopt.solver.ends.closed import LOOKED_AT
from actionopt.solver.ends.durations import NEAR_DURATION
from actionopt.solver.input.arguments import Guess
from actionopt.solver.kinds.between import Choices, Found, solve_on_the_way
from actionopt.solver.kinds.first_paths import (
    REPRESENTED,
    duration_along,
    guess_path,
    straight,
)
from actionopt.solver.kinds.nearest_points import points, sizes
from actionopt.solver.refinement.first_mesh import FIRST_TOL
from actionopt.solver.refinement.refine import settle_on
from actionopt.solver.refinement.signals import SIGNALS, status_of
from actionopt.solver.refinement.verdict import message_of, solution_of
from actionopt.tools.types import Array
from actionopt.tools.watch import OutOfTime, Watch

# Ad hoc.
TRIED = 3  # pairs of points on surfaces, or ways through events
MOST_WAYS = 8  # of these, some of which may pass events inside of the obstacle
DURATIONS = 4  # durations tried, until one is near that of the energy
BISECTED, DURATION_FACTOR = 12, 1.5  # durations that are tried for an energy, and by what they grow
NOWHERE = "no path between given events near these was found"


def free_contact(problem: Problem, guess: Guess | None, choices: Choices) -> Found:
    """Return the least path along an obstacle, near a guess if there is one, and a verdict.

    Its duration is to be found, or its events lie on surfaces.
    """
    tol, watch = choices.tol, choices.watch
    started, best, hint = perf_counter(), None, NOWHERE
    kind = Along if problem.system.order == 1 else Touching
    try:
        for near in _between_given(problem, guess, watch):
            if not near.success:
                continue
            ws = kind(Held(_at(problem, near)), tol=tol, watch=watch)
            try:
                status = release_contacts(ws, tol, near)
                status = settle_on(ws, status, choices.mesh, least=True)
            except SIGNALS as signal:
                status = status_of(signal)
                ws.stop()
            found = solution_of(ws, status, "obstacle", started)
            with suppress(ValueError):  # where the signs are not known
                if status.success and found.morse_index:
                    found = replace(found, status=Status.NOT_LEAST)
            if best is None or _rank(found) < _rank(best):
                best, hint = found, ws.hint
            if best.success and kind is Touching:
                break
    except OutOfTime:  # on the way to a path between given events
        hint = ""
    if best is None:
        nothing = None if problem.system.order == 1 else ()
        ws = kind(Held(_at_first(problem), nothing), tol=tol, checked=True)
        ws.ensure_iterate()
        status = Status.NOT_FOUND if hint else Status.OUT_OF_TIME
        best = solution_of(ws, status, "obstacle", started)
    return best, "" if best.success else message_of(best, tol, hint)


def _rank(solution: Solution) -> tuple[bool, float]:
    """Return a key that is less for a better path: whether it failed, and S + E T."""
    E = solution.problem.energy
    return not solution.success, solution.action + (E or 0.0) * solution.duration


def _between_given(
    problem: Problem, guess: Guess | None, watch: Watch | None
) -> Iterator[Solution]:
    """Yield paths along the obstacle between given events, near those that are to be found.

    Between points near each other on the surfaces of the ends, and over the duration that the
    energy takes along each path: the path and its duration are found in turn.
    """
    if problem.through or problem.system.order > 1:
        yield from _through_given(problem, guess, watch)
        return
    path = None if guess is None else guess_path(problem, guess, REPRESENTED[0])
    asked = [problem]
    if problem.on_surface:
        pairs = None if path is None else [_ends(problem, path)]
        asked = [fixed for fixed, _ in islice(points(problem, pairs), TRIED)]
    for fixed in asked:
        near = path
        T = duration_along(fixed, straight(fixed)) if path is None else path.mesh.duration
        for _ in range(DURATIONS):
            there = over(fixed, T)
            given = fixed.replace(start=there.start, end=there.end)
            found = solve_on_the_way(given, FIRST_TOL, watch, near)
            if not found.success:
                break
            last, T = T, duration_along(fixed, found.path.values.T)
            if abs(T / last - 1) < NEAR_DURATION:
                break
            near = found
        yield found


def _at_first(problem: Problem) -> Problem:
    """Return the question at arbitrary times: what a verdict speaks of where no path was found."""
    from actionopt.solver.kinds.through import fill_times

    if not problem.is_joined:
        return over(problem, 1.0)
    given = times_of(problem)
    return problem.found_at(fill_times(given, np.ones(given.size - 1)))


def _at(problem: Problem, near: Solution) -> Problem:
    """Return the question at the times, and with the multipliers, of a path of given events."""
    if not problem.is_joined:
        return over(problem, near.duration)
    kappa = near.problem.kappa if problem.integral is not None else None
    return problem.found_at(times_of(near.problem), kappa=kappa)


def _through_given(
    problem: Problem, guess: Guess | None, watch: Watch | None
) -> Iterator[Solution]:
    """Yield paths through events that are given, where and when paths with nothing in the way pass.

    Raises ValueError as the search for those does.
    """
    from actionopt.solver.kinds.through import attempts, read_guess, starts

    def ways() -> Iterator[tuple[Path, Array]]:
        """Yield a guess; paths with nothing in the way, and first ones to these."""
        if guess is not None:
            yield read_guess(problem, guess)
            return
        passing = _passing_anyway(problem, given, watch)
        if passing is not None:  # no other has less action
            yield passing
            return
        tries = islice(attempts(plain, FIRST_TOL, None, watch), MOST_WAYS)
        free = None
        for solution, _ in tries:  # a saddle, if there is no other
            if solution.success and (free is None or not solution.inertia.index):
                free = solution
                if not free.inertia.index:
                    break
        if free is not None:
            yield free.path, times_of(free.problem)
        yield from starts(plain, None)

    events = problem.start, problem.end
    given = {"parameters": problem._given_parameters, "integral": problem.integral}
    known = given | {"through": problem.through, "energy": problem.energy}
    laws = tuple(law.without_obstacle for law in problem.laws)
    question = laws or (problem.plain or problem.system).without_obstacle
    plain = Problem(question, *events, **known)
    tried, order = 0, problem.system.order
    for path, times in islice(ways(), MOST_WAYS):
        places, asked = path(times).T, problem.found_at(times)
        for k, event in enumerate(asked.joints_found):
            if len(event.pinned) < problem.system.n:  # there it may be outside of the obstacle
                at = places[[k]], np.array([event.t])
                out = onto(asked, event, *at, asked.scales, outside=True)[0]
                places[k] = out if np.isfinite(out).all() else places[k]
        pairs = zip(asked.joints_found, places.tolist(), strict=True)
        start, *through, end = (
            e._replace(q=[y if x is None else x for x, y in zip(e.q, q, strict=True)], on=None)
            for e, q in pairs
        )
        with suppress(ValueError):  # one of the places is inside of the obstacle
            fixed = Problem(problem.question, start, end, through=through, **given)
            yield solve_on_the_way(fixed, FIRST_TOL, watch, None if guess is None else path)
            tried += 1
        if order > 1 and guess is None and problem.free_time and not problem.has_open_events:
            near = _near_energy(problem, path.mesh.duration, watch)
            if near is not None:
                yield near
        if tried == TRIED:
            return


def _near_energy(problem: Problem, T: float, watch: Watch | None) -> Solution | None:
    """Return a path over a given duration at which its energy is about that asked, near T.

    Where S + E T is least the energy falls as the duration grows: it is between two durations,
    the one half way between them in the logarithm. What is in contact may be another at another
    duration, and Newton's method does not see that. None if there is no path.
    """
    near: Solution | None = None
    short, long = 0.0, np.inf
    for _ in range(BISECTED):
        times = times_over(problem, T)
        asked = problem.replace(start=problem.start.at(times[0]), end=problem.end.at(times[1]))
        found = solve_on_the_way(asked, FIRST_TOL, watch)
        if not found.success:
            break
        near = found
        if found.energy(found.end.t) > (problem.energy or 0.0):
            short = T
        else:
            long = T
        if long < (1 + NEAR_DURATION) * short:
            break
        if not short:
            T = long / DURATION_FACTOR
        else:
            T = min(DURATION_FACTOR * short, float(np.sqrt(short * long)))
    return near


def _passing_anyway(
    problem: Problem, given: dict[str, Any], watch: Watch | None
) -> tuple[Path, Array] | None:
    """Return a path between the ends that passes the events without being asked to, and when."""
    if problem.has_open_ends or isinstance(problem.question, tuple):
        return None
    if any(e.on is not None for e in problem.through):
        return None
    plain = Problem(problem.question, problem.start, problem.end, **given)
    found = solve_on_the_way(plain, FIRST_TOL, watch)
    if not found.success:
        return None
    known = [e.t for e in problem.through if e.t is not None]
    t = np.union1d(np.linspace(problem.start.t, problem.end.t, LOOKED_AT), known)
    q, last, when = found(t) / problem.scales[:, None], 0, []
    far = np.abs(np.diff(q)).max()
    for e in problem.through:
        pinned = list(e.pinned)
        place = np.array([e.q[i] for i in pinned], dtype=float) / problem.scales[pinned]
        off = np.abs(q[pinned] - place[:, None]).max(axis=0, initial=0.0)
        passed = (off <= far) & (off <= np.roll(off, 1)) & (off <= np.roll(off, -1))
        passed &= (t == e.t) if e.t is not None else (t > t[last]) & (t < t[-1])
        if not passed.any():
            return None
        last = int(np.argmax(passed))  # the first time
        when.append(t[last])
    return found.path, np.array([t[0], *when, t[-1]])


def _ends(problem: Problem, path: Path) -> Array:
    """Return the ends (2, n) of a guess, on the surfaces."""
    size, found = sizes(problem), path.values.T[[0, -1]].copy()
    for k, event in enumerate((problem.start, problem.end)):
        if event.on is not None:
            point = onto(problem, event, found[[k]], path.mesh.boundaries[[-k]], size)[0]
            found[k] = point if np.isfinite(point).all() else found[k]
    return found
