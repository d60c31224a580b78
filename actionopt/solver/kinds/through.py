"""Paths through events whose times or places are to be found: first paths, and which are answers.

A first path is straight between points on the surfaces of the events, or a motion that is reflected
and refracted there (`rays`). Newton's method takes it to a stationary one, times and multipliers
included; from there it is followed from mesh to mesh. Many of them are no answers: at a surface
reflection and transmission satisfy the same equations, and a leg may cross what it is to be
reflected from.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import islice
from time import perf_counter
from typing import Literal

import numpy as np

from actionopt.analysis.solution import Solution
from actionopt.analysis.status import Status
from actionopt.discrete.borders.borders import times_of
from actionopt.discrete.borders.integrals import are_dependent
from actionopt.discrete.borders.surfaces import onto
from actionopt.discrete.meshes.boundaries import split
from actionopt.discrete.meshes.element import with_degrees
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.discrete.newton.newton import approach
from actionopt.mechanics.laws.tracing import SWITCHES
from actionopt.mechanics.question.course import sides
from actionopt.mechanics.question.events import Bounce, Event
from actionopt.mechanics.question.problem import Problem
from actionopt.mechanics.question.scales import diagonal, first_state
from actionopt.solver.ends.closed import LOOKED_AT, begin_on_surface
from actionopt.solver.input.arguments import Guess, checked_curve
from actionopt.solver.kinds.passing_times import lower
from actionopt.solver.kinds.rays import RAY_ROUNDS, Ray, rays, ways_on
from actionopt.solver.kinds.unfixed import Unfixed
from actionopt.solver.refinement.family import judge_family, may_be_family
from actionopt.solver.refinement.first_mesh import COARSE_DEGREE, COARSE_ELEMENTS
from actionopt.solver.refinement.iterate import AT_REST, ROUNDED
from actionopt.solver.refinement.signals import SIGNALS, status_of
from actionopt.solver.refinement.verdict import solution_of
from actionopt.solver.refinement.workspace import PATIENT
from actionopt.solver.search.waves import first_guessed, first_waves, wave_mesh
from actionopt.tools.checks import numbers
from actionopt.tools.types import Array
from actionopt.tools.watch import OutOfTime, Watch, limit

# Ad hoc.
LEG_ELEMENTS = 2  # of a leg of a first path
FIRST_POLYGONS = 24  # first paths that are tried, straight between events, and as many motions
BEFORE_RAYS = 2  # of them, before motions are
ALL_ROUNDS = 10  # of motions, to find all answers
# Two paths on their first mesh are one if they differ by less, in the sizes and in the duration. A
# closed path has a kink where its momenta change by more, in their own sizes.
SAME_FIRST = 1e-4
SMALLEST_SIZE = 0.3  # of a coordinate, of the largest one's
PLACE_SPREAD = 0.5  # of points on surfaces, in the coordinates' sizes, and of logarithms of times
NEXT_TO_EVENT = 1e-3  # of a leg: nearer to its ends its side of a surface is not asked
FAMILY_TRIES = FIRST_POLYGONS // 2  # from which a family is sought, if nothing else was found
AFTER_FAMILY = FIRST_POLYGONS // 4  # more of them, to find a path that is alone
# Paths with given integrals of which the least is taken, if none is a minimum, and such paths
# through few events. Measured in an ellipse: of the first ten paths with one reflection one is a
# minimum for 24 of 25 pairs of ends, mostly of the first three, with two for 18, with three for 1.
SEVERAL, SEVERAL_THROUGH, FEW_EVENTS = FIRST_POLYGONS // 3, 10, 2


def solve_through(
    problem: Problem,
    tol: float,
    guess: Guess | None,
    principle: Literal["auto", "least", "stationary"],
    watch: Watch | None,
) -> tuple[Solution, str]:
    """Return a path through events of which times or places are to be found, and a hint."""
    hint, best, others, left = "", None, 0, AFTER_FAMILY
    several = _several(problem, principle) if guess is None else 1
    for solution, why in attempts(problem, tol, guess, watch):
        if solution.success and several > 1:
            # One of many, as states above the lowest one or ropes that stand: a least is preferred.
            others += 1
            is_least = _is_minimum(solution)
            if best is None or not best.success or is_least or solution.action < best.action:
                best, hint = solution, why
            if others < several and not is_least:
                continue
            solution = best
        elif solution.status is Status.OUT_OF_TIME and best is not None and best.success:
            solution = best
        if solution.success or solution.status is Status.OUT_OF_TIME:
            return _judge_least(solution, principle), why
        if best is None or (
            not _is_stationary(best) and (_is_stationary(solution) or (why and not hint))
        ):
            best, hint = solution, why
        if best.status is Status.DEGENERATE:
            if not left:
                break
            left -= 1
    if best is None and problem.integral is not None:
        raise ValueError(
            f"expected values of the integrals that a first path between the events reaches, found "
            f"{problem.integral} and no such path, which there may be; give a guess, or change them"
        )
    if best is None:
        raise ValueError(
            "expected surfaces on which points are found near the events, found none; give a "
            "guess, waypoints of shape (n, k + 2): places at all events"
        )
    if not _is_stationary(best):
        hint = "; ".join(filter(None, (hint, _wall_behind_another(problem))))
    return _judge_least(best, principle), hint


def _judge_least(solution: Solution, principle: Literal["auto", "least", "stationary"]) -> Solution:
    """Return the solution, NOT_LEAST if a least one was asked for and this is none."""
    if principle != "least" or not solution.success or _is_minimum(solution):
        return solution
    return replace(solution, status=Status.NOT_LEAST)


def _several(problem: Problem, principle: Literal["auto", "least", "stationary"]) -> int:
    """Return of how many paths the least is taken, if none of them is a minimum."""
    if problem.integral is not None:
        return SEVERAL
    few = 0 < len(problem.through) <= FEW_EVENTS and problem.advance is None
    return SEVERAL_THROUGH if few and principle == "auto" else 1


def _wall_behind_another(problem: Problem) -> str:
    """Return the sentence that an event lies behind what a path next to it bounces off, or none."""
    base = _points(problem)
    size = _sizes(problem, base)
    first = _begin(problem, base, size, np.ones(len(base) - 1))
    if first is None:
        return ""
    path, times = first
    q, packed = path(times).T, problem.found_at(times).packed
    for wall, leg, sign in sides(problem):
        on, by_q, _ = problem.joints_found[wall].on.along(q, times, packed)
        behind = on[:, 0] < -NEXT_TO_EVENT * np.linalg.norm(by_q[:, 0] * size, axis=1)
        for k in (leg, leg + 1):
            if sign and behind[k]:
                return (
                    f"event {k} is sought behind the surface of the bounce at event {wall}, where "
                    "the path would have to cross that; of a wall made of several curves `on` is "
                    "one function, positive between all of them"
                )
    return ""


def _is_stationary(solution: Solution) -> bool:
    """Return whether a path is stationary, as one of a family is."""
    return solution.status.stationary or solution.status is Status.DEGENERATE


def _is_minimum(solution: Solution) -> bool:
    """Return whether no variation lowers the action; not where L is not convex in the rates."""
    try:
        return solution.morse_index == 0
    except ValueError:
        return False


def attempts(
    problem: Problem,
    tol: float,
    guess: Guess | None,
    watch: Watch | None,
    count: int | None = None,
    seed: int = 0,
) -> Iterator[tuple[Solution, str]]:
    """Yield what came of each first path, and why it is no answer.

    With a `count`, which a search for all answers gives, so many first paths of each kind are
    tried, and each answer comes once; so it does where integrals are given, as many first paths
    lead to one. What is found again on its first mesh is not refined again. Until a closed path
    came of any, the first of them are tried twice: Newton's method is lost in a family.
    """
    seen: list[tuple[Array, Array]] = []
    outcomes: list[tuple[Solution, str]] = []  # of those
    answers: list[Array] = []  # the places of their events
    known, once = False, count is not None or problem.integral is not None
    late = False

    def tries() -> Iterator[tuple[Path, Array, bool]]:
        nonlocal late
        left = FAMILY_TRIES if problem.advance is not None else 0
        firsts = starts(problem, guess, count, seed, answers)
        first = next(firsts, None)
        while first is not None:
            yield *first, False
            if left and not known:
                left -= 1
                yield *first, True
            try:
                with limit(watch):
                    first = next(firsts, None)
            except OutOfTime:
                late, first = True, None

    solution = None
    for path, times, of_family in tries():
        started = perf_counter()
        run = Unfixed(problem, tol=tol, watch=watch, times=times)
        status, reached = Status.NOT_FOUND, False
        try:
            if run.reach_family(path) if of_family else run.reach(path, None, damped=True):
                again = None if of_family else _seen_before(run, seen)
                if again is not None:
                    if not once:
                        yield outcomes[again]
                    continue
                reached = not of_family
                status = run.verdict()
        except SIGNALS as signal:
            status = status_of(signal)
            run.stop()
        if watch is not None and watch.error is not None:
            if not isinstance(watch.error, OutOfTime):
                raise watch.error
            status = Status.OUT_OF_TIME
        run.here.tr.watch = run.here.bordered.first.watch = None
        if not status.stationary:
            run.here = replace(run.here, error=np.inf)
        solution = solution_of(run, status, "guess" if guess is not None else "surface", started)
        why = objection(solution) if solution.success else ""
        if why:
            solution = replace(solution, status=Status.NOT_FOUND, error=np.inf)
        elif solution.success and run.along:
            solution = judge_family(run, solution)
        elif solution.success and (dimension := _family(run, solution)):
            why = (
                f"to second order, the paths between the ends are a family of dimension {dimension}"
            )
            solution = replace(solution, status=Status.DEGENERATE)
        elif solution.success and problem.integral is not None and are_dependent(solution.discrete):
            why = (
                "near this path the integrals depend on one another, or on the constraints, so "
                "that their multipliers are not determined: leave those out that others tell"
            )
            solution = replace(solution, status=Status.DEGENERATE)
        elif status is Status.UNRESOLVED and may_be_family(run, status):
            solution = judge_family(run, solution)  # a first path may be one of a family already
        known = known or _is_stationary(solution)
        if solution.success:
            answers.append(solution(times_of(solution.problem)).T)
        if reached:
            outcomes.append((solution, why or run.hint))
        yield solution, why or run.hint
        if status is Status.OUT_OF_TIME:
            return
    if late and solution is not None:
        yield replace(solution, status=Status.OUT_OF_TIME, error=np.inf), ""


def _seen_before(run: Unfixed, seen: list[tuple[Array, Array]]) -> int | None:
    """Return which path of those seen before a path on its first mesh is; None if it is new."""
    Q, times = run.here.Q, times_of(run.here.problem)
    unit, span = np.abs(Q).max(axis=0) + run.here.tr.lengths, np.ptp(times)
    for k, (other, at) in enumerate(seen):
        same = other.shape == Q.shape and np.abs(at - times).max() < SAME_FIRST * span
        if same and (np.abs(other - Q) < SAME_FIRST * unit).all():
            return k
    seen.append((Q.copy(), times))
    return None


def _family(run: Unfixed, solution: Solution) -> int:
    """Return the dimension of the family that a path is one of; 0 where none is known."""
    try:
        return solution.inertia.nullity if may_be_family(run, solution.status) else 0
    except (ValueError, np.linalg.LinAlgError):  # as where L is not convex in the rates
        return 0


def objection(solution: Solution) -> str:
    """Return why a stationary path is no answer, in a sentence; empty if it is one."""
    problem = solution.problem
    joints, packed = problem.joints, problem.packed
    legs = split(solution.path, [e.t for e in problem.through])
    if problem.may_be_shifted:
        (p0, p1), tr = solution.momenta, solution.discrete.tr
        rest = ROUNDED * tr.action_unit / tr.place_units  # where nothing moves
        apart = np.abs(p1 - p0[list(problem.closed_places)])
        if (apart > np.maximum(SAME_FIRST * np.abs(p0).max(), rest)).any():
            return "the path found returns with another momentum, in a kink"
    for k, event in enumerate(joints):
        if not isinstance(event, Bounce):
            continue
        q, t = solution(event_time(problem, k)), event_time(problem, k)
        _, by_q, by_t, _ = event.on.at(q, t, packed)
        before, after = legs[k - 1].velocity(t), legs[k].velocity(t)
        into, out = float(by_q[0] @ before + by_t[0]), float(by_q[0] @ after + by_t[0])
        speed = float(np.linalg.norm(by_q[0]) * max(np.linalg.norm(before), np.linalg.norm(after)))
        if max(abs(into), abs(out)) <= AT_REST * speed:
            return f"the path found grazes the surface at event {k}, and is not reflected there"
        if into > 0 or out < 0:
            return f"the path found passes through the surface at event {k}, where it should bounce"
    signs: dict[int, list[float]] = {}
    for k, leg, sign in sides(problem):
        t = _inside(legs[leg], problem.joints[k] in (joints[leg], joints[leg + 1]))
        on = joints[k].on.along(legs[leg](t).T, t, packed)[0]
        size = np.abs(on).max(axis=0)
        for i in range(on.shape[1] if not sign else 1):
            if sign and not (on[:, i] > -(NEXT_TO_EVENT**2) * size[i]).all():
                return f"the path found crosses the surface of the bounce at event {k} elsewhere"
            if not sign:
                one = np.sign(on[np.argmax(np.abs(on[:, i])), i])
                if not (one * on[:, i] > -(NEXT_TO_EVENT**2) * size[i]).all():
                    return f"the path found crosses the surface of event {k} elsewhere"
                signs.setdefault(k, []).append(one)
    for k, found in signs.items():
        half = len(found) // 2
        if any(a == b for a, b in zip(found[:half], found[half:], strict=True)):
            return (
                f"the path found is reflected at event {k}, where it should pass from one law to "
                "the next, as beyond the angle of total reflection or below a step of potential"
            )
    return ""


def event_time(problem: Problem, k: int) -> float:
    """Return the time of event k, the start being 0."""
    return float(times_of(problem)[k])


def _inside(leg: Path, ends_there: bool) -> Array:
    """Return times along a leg, but for those next to its ends if the surface is met there."""
    b, s = leg.mesh.boundaries, np.linspace(0, 1, LOOKED_AT)
    if ends_there:
        s = s[(s > NEXT_TO_EVENT) & (s < 1 - NEXT_TO_EVENT)]
    return b[0] + s * (b[-1] - b[0])


# -- where to begin -------------------------------------------------------------------------------


def starts(
    problem: Problem,
    guess: Guess | None,
    count: int | None = None,
    seed: int = 0,
    answers: Sequence[Array] = (),
) -> Iterator[tuple[Path, Array]]:
    """Yield first paths and the times of the events on them.

    `count` of each kind to find all answers, or a few of them to find one. `answers` are the places
    (k + 2, n) at the events of those that came of the paths before.
    """
    if guess is not None:
        path, times = read_guess(problem, guess)
        for begun in begin_on_surface(path, problem):
            if problem.integral is not None:
                yield from first_guessed(problem, begun, times)
                continue
            yield begun, times
            yield relax_legs(problem, begun, times), times
        return
    random = np.random.default_rng(seed)
    base = _points(problem)
    size = _sizes(problem, base)
    if problem.integral is not None:
        first = _begin(problem, base, size, np.ones(len(base) - 1))
        if first is not None:
            yield from first_waves(problem, *first, size, count or FIRST_POLYGONS, random)
        if any(event.t is None or event.on is not None for event in problem.through):
            for found in _polygons(problem, base, size, random, 1, count or SEVERAL):
                if found is not None:
                    relaxed = relax_legs(problem, *found)
                    yield from first_guessed(problem, relaxed, found[1])
        return
    if _are_only_passed(problem):
        times = times_of(problem)[[0, -1]]
        line = polygon(base[[0, -1]], times)
        yield read_guess(problem, relax_legs(problem.replace(through=()), line, times))
    straight = _begin(problem, base, size, np.ones(len(base) - 1))
    least = None if straight is None else lower(problem, *straight)
    if least is not None:
        yield least
    for found in _first_legs(problem, base, size, count, random, answers):
        if found is not None:
            yield relax_legs(problem, *found), found[1]


def _are_only_passed(problem: Problem) -> bool:
    """Return whether a motion between the ends that meets the surfaces of all events is an answer.

    A surface that is passed from one law to the same, at a time to be found, changes no momentum.
    """
    ends = (problem.start, problem.end)
    if problem.advance is not None or not all(e.pinned and e.t is not None for e in ends):
        return False
    if not problem.through or problem.system.order > 1 or isinstance(problem.question, tuple):
        return False
    return not any(
        isinstance(e, Bounce) or e.on is None or e.pinned or e.t is not None
        for e in problem.through
    )


def _first_legs(
    problem: Problem,
    base: Array,
    size: Array,
    count: int | None,
    random: np.random.Generator,
    answers: Sequence[Array],
) -> Iterator[tuple[Path, Array] | None]:
    """Yield first paths near points `base` (k + 2, n), and the times of the events on them.

    A few straight ones; motions; ways that begin as one answer and end as another; straight ones
    again.
    """
    yield from _polygons(problem, base, size, random, 0, BEFORE_RAYS)
    span = float(np.diff(times_of(problem)[[0, -1]])[0])
    if not np.isfinite(span):
        span = float(_durations(problem, base).sum())
    rounds = ALL_ROUNDS if count else RAY_ROUNDS
    for thrown in ways_on(problem):
        found = rays(problem, size, span, random, rounds, thrown)
        for ray in islice(found, count or FIRST_POLYGONS):
            yield along_ray(problem, ray)
    if count and len(base) > 3:
        yield from (
            _begin(problem, q, size, np.ones(len(q) - 1))
            for q in _join_answers(answers, count, random)
        )
    last = FIRST_POLYGONS if answers or not count else count
    yield from _polygons(problem, base, size, random, BEFORE_RAYS, last)


def _polygons(
    problem: Problem, base: Array, size: Array, random: np.random.Generator, first: int, last: int
) -> Iterator[tuple[Path, Array] | None]:
    """Yield paths straight between points ever farther from `base`, of numbers `first` to `last`.

    The first is between those points themselves; so are the times of the first two.
    """
    given = np.array([[x is not None for x in event.q] for event in problem.joints_found])
    for k in range(first, last):
        away = PLACE_SPREAD * (1 + k // 10) * size * random.standard_normal(base.shape)
        away[given] = 0.0
        shift = PLACE_SPREAD * random.standard_normal(len(base) - 1)
        q = base if not k else base + away
        yield _begin(problem, q, size, np.ones(shift.size) if k < 2 else np.exp(shift))


def _join_answers(
    answers: Sequence[Array], count: int, random: np.random.Generator
) -> Iterator[Array]:
    """Yield places (k + 2, n) that are those of one answer first, and those of another one then.

    Until `count` pairs that were drawn in a row have led to no further answer: where there are many
    answers these differ from one another by parts of the way (of the twenty with six bounces in an
    ellipse, motions led to fourteen).
    """
    known, left, drawn = len(answers), count, set()
    while left and known > 1:
        one, other = random.choice(known, 2, replace=False).tolist()
        k, left = int(random.integers(1, len(answers[0]) - 1)), left - 1
        if (one, other, k) not in drawn:
            drawn.add((one, other, k))
            yield np.concatenate([answers[one][:k], answers[other][k:]])
        if len(answers) > known:
            known, left = len(answers), count


def relax_legs(problem: Problem, path: Path, times: Array) -> Path:
    """Return the path of stationary legs between the places at the events, if it is near this one.

    Then only the conditions at the events are not met: Newton's method on these contracts from
    farther away than on legs and events at once.
    """
    places = path(times).T
    at = problem.found_at(times)
    if at.system.m:  # constraints may move, and times were chosen after places
        size = _sizes(problem, places)
        for k, event in enumerate(problem.joints_found):
            places[k] = onto(problem, event, places[[k]], times[[k]], size)[0]
        if not np.isfinite(places).all():
            return path
    known = zip(at.joints_found, places, strict=True)
    start, *through, end = (Event(e.t, q)._with_rates_of(e) for e, q in known)
    laws = at.question if isinstance(at.question, tuple) else (at.question,)
    # The legs do not know parameters of surfaces alone, nor multipliers of integrals.
    own = {name for law in laws for name in law.table.shapes} - {SWITCHES}
    given = {name: x for name, x in at.parameters.items() if name in own}
    fixed = Problem(at.question, start, end, parameters=given, through=through)  # type: ignore[arg-type]
    first = DiscretePath.of(fixed, path.on(with_degrees(path.mesh, fixed.system.order)))
    found = approach(first.tr, first.z, PATIENT)
    return path if found is None else DiscretePath(first.tr, found[0]).polish().path


def _points(problem: Problem) -> Array:
    """Return coordinates at the events, (k + 2, n): given ones, and interpolated between them."""
    rows = np.array([[np.nan if x is None else x for x in e.near] for e in problem.joints_found])
    k = np.arange(len(rows))
    for i, column in enumerate(rows.T):
        known = np.isfinite(column)
        rows[:, i] = np.interp(k, k[known], column[known]) if known.any() else 0.0
    return rows


def _sizes(problem: Problem, points: Array) -> Array:
    """Return how far coordinates may be from what is interpolated, (n,).

    As far as the largest, in the metric of the kinetic energy, or not much less: events nearly
    above each other do not say that the path between them stays there.
    """
    size = np.maximum(np.ptp(points, axis=0), np.abs(points).max(axis=0))
    if problem.advance is not None:  # what a closed path meets tells more than where it begins
        size = np.maximum(size, _extent(problem, points, size))
    way = np.where(size > 0, size, size.max() or 1.0)[None]
    middle = points.mean(axis=0, keepdims=True)
    times = fill_times(times_of(problem), np.ones(len(points) - 1))
    unit = np.sqrt(_inertia(problem, middle, way, times.mean(keepdims=True))[0])
    if not (np.isfinite(unit).all() and (unit > 0).all()):
        unit = np.ones(size.size)
    largest = (size * unit).max()
    return np.maximum(size, SMALLEST_SIZE * largest / unit) if largest > 0 else np.ones(size.size)


def _extent(problem: Problem, points: Array, size: Array) -> Array:
    """Return how far points on the surfaces of events are from the origin, (n,): of a few."""
    times = fill_times(times_of(problem), np.ones(len(points) - 1))
    scale, found = size.max() or 1.0, [np.zeros(size.size)]
    for event, t in zip(problem.joints_found, times.tolist(), strict=True):
        if event.on is not None:
            away = scale * np.concatenate([np.eye(size.size), -np.eye(size.size)])
            point = onto(problem, event, away, np.full(len(away), t), np.full(size.size, scale))
            found += list(np.abs(point[np.isfinite(point).all(axis=1)]))
    return np.max(found, axis=0)


def _inertia(problem: Problem, q: Array, v: Array, t: Array) -> Array:
    """Return the diagonal of the mass matrix (K, n) at q, v (K, n) and t (K,)."""
    at = problem.found_at(fill_times(times_of(problem), np.ones(len(problem.joints_found) - 1)))
    with np.errstate(all="ignore"):
        second = at.system.pointwise("second")(*first_state(at.system, q, v), t[:, None], at.packed)
    return diagonal(at.system, 2, second[2])


def _begin(problem: Problem, q: Array, size: Array, share: Array) -> tuple[Path, Array] | None:
    """Return the path straight between points near q (k + 2, n), on the surfaces; None if none is.

    The legs take times in proportion to their lengths, in the metric of the kinetic energy, times
    `share` (k + 1,).
    """
    q = q.copy()
    times = fill_times(times_of(problem), np.ones(len(q) - 1))
    for _ in range(2):  # surfaces may move, and times depend on places
        for k, event in enumerate(problem.joints_found):
            if event.on is not None or problem.system.m:
                q[k] = onto(problem, event, q[[k]], times[[k]], size)[0]
                if not np.isfinite(q[k]).all():
                    return None
        if problem.advance is not None:
            q[-1] = problem.closed_from(q[0])
        times = fill_times(times_of(problem), share * _durations(problem, q))
    if not (np.isfinite(times).all() and (np.diff(times) > 0).all()):
        return None
    return polygon(q, times), times


def polygon(q: Array, times: Array) -> Path:
    """Return the path straight between points q (k + 2, n) at times (k + 2,)."""
    b = np.interp(
        np.arange(LEG_ELEMENTS * (len(times) - 1) + 1) / LEG_ELEMENTS, np.arange(len(times)), times
    )
    b[::LEG_ELEMENTS] = times
    mesh = Mesh(b, COARSE_DEGREE)
    return Path(mesh, np.stack([np.interp(mesh.nodes, times, row) for row in q.T]))


def along_ray(problem: Problem, ray: Ray) -> tuple[Path, Array] | None:
    """Return a motion, as a path through the given coordinates at the given times."""
    times = fill_times(times_of(problem), np.diff(ray.times))
    if not (np.diff(times) > 0).all():
        return None
    miss = np.array(
        [
            [0.0 if x is None else x - y for x, y in zip(e.q, q, strict=True)]
            for e, q in zip(problem.joints_found, ray.places, strict=True)
        ]
    )
    mesh = polygon(np.zeros_like(ray.places), times).mesh
    q = np.empty((mesh.nodes.size, len(ray.places[0])))
    for k in range(len(times) - 1):
        part = (mesh.nodes - times[k]) / (times[k + 1] - times[k])
        inside = (part >= 0) & (part <= 1)
        s = part[inside, None]
        q[inside] = ray.values(k, part[inside]) + miss[k] + s * (miss[k + 1] - miss[k])
    return Path(mesh, q.T), times


def _durations(problem: Problem, q: Array) -> Array:
    """Return how long legs between points q (k + 2, n) take at the energy, or in proportion."""
    way, middle = np.diff(q, axis=0), (q[1:] + q[:-1]) / 2
    at = problem.found_at(fill_times(times_of(problem), np.ones(len(way))))
    t = np.array(
        [(a.t + b.t) / 2 for a, b in zip(at.joints_found[:-1], at.joints_found[1:], strict=True)]
    )
    with np.errstate(all="ignore"):
        length = np.sqrt(np.sum(_inertia(problem, middle, way, t) * way**2, axis=1))
        speed = np.ones(length.size)
        if problem.energy is not None:
            rest = first_state(at.system, middle, 0 * way)
            still = at.system.pointwise("value")(*rest, t[:, None], at.packed)[0][:, 0]
            speed = np.sqrt(2 * np.abs(problem.energy + still))
        found = length / speed
        if problem.energy is not None:  # of order k as (length / T^k)^2
            found = found ** (1 / at.system.order)
    typical = found[np.isfinite(found) & (found > 0)]
    least = 0.05 * typical.mean() if typical.size else 1.0
    return np.where(np.isfinite(found), np.maximum(found, least), least)


def fill_times(given: Array, durations: Array) -> Array:
    """Return times (k + 2,) with those that are NaN in proportion to durations (k + 1,)."""
    since = np.concatenate([[0.0], np.cumsum(durations)])
    known = np.flatnonzero(np.isfinite(given))
    if not known.size:
        return since
    found = np.interp(since, since[known], given[known])
    for end in (slice(0, known[0]), slice(known[-1] + 1, None)):
        k = known[0] if end.start == 0 else known[-1]
        found[end] = given[k] + since[end] - since[k]
    return found


def read_guess(problem: Problem, guess: Guess) -> tuple[Path, Array]:
    """Return the first path that a guess says, and the times of the events on it.

    Waypoints (n, k + 2) are places at the events. On a curve these are passed at the times at which
    it is nearest to what they ask, one after the other; a path through as many events knows when.

    Raises ValueError if its shape does not fit the problem, or it is not finite.
    """
    n, given = problem.system.n, times_of(problem)
    if isinstance(guess, Solution):
        guess = guess.path
    if not isinstance(guess, Path) and not callable(guess):
        points = np.atleast_2d(numbers(guess, "the guess, a callable or waypoints"))
        if points.shape != (n, len(given)) or not np.isfinite(points).all():
            raise ValueError(
                f"expected finite waypoints of shape ({n}, {len(given)}), one column for each "
                f"event, found shape {points.shape}"
            )
        q = points.T
        times = fill_times(given, _durations(problem, q))
        return polygon(q, times), times
    curve = guess
    b = curve.mesh.boundaries[[0, -1]] if isinstance(curve, Path) else given[[0, -1]]
    if not np.isfinite(b).all():
        raise ValueError(
            "expected a Path, or waypoints at the events, as the guess where a time of an end is "
            "to be found, found a callable: over which times it goes is not known"
        )
    t = np.linspace(b[0], b[1], LOOKED_AT)
    q = checked_curve(curve, n)(t)
    if not np.isfinite(q).all():
        raise ValueError("expected a guess that is finite at all times, found NaN or infinity")
    passed = np.array(curve.passed if isinstance(curve, Path) else ())
    if passed.size != len(problem.through):
        passed = _pass_times(problem, t, q)
    on_curve = np.concatenate([b[:1], passed, b[1:]])
    times = np.where(np.isfinite(given), given, on_curve)
    if not np.isfinite(given).any():
        times = on_curve
    elif not np.isfinite(given[[0, -1]]).all() or not (np.diff(times) > 0).all():
        times = fill_times(given, np.diff(on_curve))
    mesh = polygon(np.zeros((len(times), n)), times).mesh
    whole = problem.advance is not None and not problem.through  # a closed path is one leg
    if whole or problem.integral is not None:
        # On half as many elements a rod that winds once is lost.
        mesh = wave_mesh(times, problem.system.order, 2 * COARSE_ELEMENTS)
    s = np.interp(mesh.nodes, times, on_curve)
    return Path(mesh, np.asarray(curve(s), dtype=float).reshape(n, -1)), times


def _pass_times(problem: Problem, t: Array, q: Array) -> Array:
    """Return when a curve q (n, K) over t (K,) is nearest to the inner events, in their order."""
    if not problem.through:
        return np.zeros(0)
    size = np.ptp(q, axis=1)
    size = np.where(size > 0, size, size.max() or 1.0)[:, None]
    packed = problem.found_at(
        fill_times(times_of(problem), np.ones(len(problem.joints_found) - 1))
    ).packed
    costs = []
    for event in problem.through:
        off = np.zeros(t.size)
        for i in event.pinned:
            off += ((q[i] - event.q[i]) / size[i, 0]) ** 2
        if event.on is not None:
            on, by_q, _ = event.on.along(q.T, t, packed)
            slope = np.linalg.norm(by_q * size[:, 0], axis=2)
            steepest = slope.max(axis=0)
            floor = np.where(steepest > 0, 1e-3 * steepest, 1.0)
            off += np.sum((on / np.maximum(slope, floor)) ** 2, axis=1)
        if event.t is not None:
            off += 1e6 * ((t - event.t) / (t[-1] - t[0])) ** 2
        # Where it comes nearest, lest two events on one surface are passed at one touch of it.
        least = np.r_[False, (off[1:-1] <= off[:-2]) & (off[1:-1] < off[2:]), False]
        costs.append(np.where(least, off, off + off.max()))
    total, choice = np.full(t.size, np.inf), []
    total[0] = 0.0
    for off in costs:  # the least sum, at times that increase
        best = np.minimum.accumulate(total)
        from_where = np.array([int(np.argmin(total[: k + 1])) for k in range(t.size)])
        choice.append(np.concatenate([[0], from_where[:-1]]))
        total = np.concatenate([[np.inf], best[:-1]]) + off
    k = int(np.argmin(total[:-1]))
    found = [k]
    for back in reversed(choice[1:]):
        k = int(back[k])
        found.append(k)
    return t[found[::-1]]
