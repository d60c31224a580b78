"""Events at infinite time: a window, at whose edges the path lies on a linear manifold.

The manifold is the stable or unstable one of the equilibrium beyond.
Where the window should end is not known before the path is. So it is solved on one, and what the
linear manifold leaves out is measured at its edges: by how much the acceleration there differs from
that of the linear motion, over the square of the slowest rate; and by how much the path moves if
that acts on it for the inverse of the slowest rate. Where it is too much the window grows by as
many e-foldings as are missing, and the path is followed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from actionopt.analysis.solution import Solution
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.matrices.factors import Factors
from actionopt.discrete.meshes.boundaries import with_boundaries
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.mechanics.question.events import Event, Phase, Tail
from actionopt.mechanics.question.obstacle import Arc
from actionopt.mechanics.question.problem import Problem
from actionopt.mechanics.question.rest import Rest, rest
from actionopt.mechanics.question.scales import ends_of
from actionopt.solver.ends.closed import LOOKED_AT
from actionopt.solver.ends.durations import MERGED
from actionopt.solver.input.arguments import checked_curve, waypoints
from actionopt.solver.refinement.descent import descend
from actionopt.solver.refinement.first_mesh import COARSE_DEGREE, COARSE_ELEMENTS
from actionopt.solver.refinement.iterate import ROUNDED, sizes
from actionopt.tools.bisection import bisect
from actionopt.tools.checks import COARSEST
from actionopt.tools.types import Array
from actionopt.tools.watch import Watch

# Ad hoc, where nothing else is said.
CORE = 4.0  # e-foldings of a window besides those of its tail: the path is somewhere, too

SHARE = 0.25  # of the tolerance for what the windows' edges leave out
WINDOW_GROWTH = 3.0  # times as long the next window may be
# Measured on the kinks of phi^4 and sine-Gordon: where elements end that resolve them best, as a
# power of their number; and e-foldings on each of them, with degrees as the strategies have them.
GRADING, FOLDS_EACH = 1.7, 4.0
# of its size, how far a saddle is left along its lowest mode
SADDLE_OFFSETS = 0.1, -0.1, 0.3, -0.3
DOWN_ELEMENTS = 3 * COARSE_ELEMENTS  # of the mesh on which a guess is left
LONGEST_WINDOW = 100.0  # times the first window, in which a guess is looked at
CORE_SIZE = 0.1  # of how far a guess is from rest, beyond which something happens
ELEMENT_CUT = 0.25  # of its shortest element, where a mesh is cut


@dataclass(frozen=True)
class Edge:
    """The part of a path that a window's edge leaves out, relative to q.

    `left` is the truncation error at the edge, `moved` a bound on its effect anywhere on the path;
    `rest` is the equilibrium beyond the time `t`.
    """

    left: float
    moved: float
    rest: Rest
    t: float


@dataclass(frozen=True)
class Window:
    """A problem of finite times in the place of one of infinite ones, and what is guessed of it."""

    problem: Problem
    guess: Any

    def edges(self, solution: Solution, factors: Factors | None) -> list[Edge]:
        """Return the error of each tail; of a path that was not found, at the edges alone.

        An acceleration that is left out for 1 / slow is a momentum at the edge, to which the path
        responds as a whole: near another equilibrium many times as much as at the edge.
        """
        problem, Q = self.problem, solution.path.values.T
        size = sizes(Q, problem.scales)
        found = []
        for k, event, known in zip(
            (0, -1), (problem.start, problem.end), problem.rests, strict=True
        ):
            if known is None:
                continue
            q = Q[k]
            eta = q - known.q
            v = known.rates @ eta
            try:
                a = problem.system.acceleration(q, v, event.t, parameters=problem.parameters)
            except np.linalg.LinAlgError:  # the mass matrix is singular so far from rest
                a = np.full(q.shape, np.inf)
            off = a - known.rates @ v
            left = float((np.abs(off) / known.slow**2 / size).max())
            moved = left
            if factors is not None:
                tr, pull = solution.discrete.tr, np.zeros_like(Q)
                pull[k] = known.mass @ off / known.slow
                right, count = np.zeros(tr.layout.size), tr.layout.unknowns
                right[:count] = tr.free_part(pull.ravel())
                try:
                    away = factors.solve(right)[:count]
                except np.linalg.LinAlgError:  # nothing holds the path
                    away = np.inf
                away = away * tr.x_unit / size[tr.layout.free % size.size]
                moved = max(left, float(np.abs(away).max()))
            found.append(Edge(left, moved, known, event.t))
        return found


def first_window(whole: Problem, guess: Any, tol: float, mesh: Mesh | None) -> Window:
    """Return the first window of a problem with events at infinite times.

    Raises ValueError where there is no equilibrium, or it is no saddle; if the energies of two
    differ; or for a guess of the wrong shape.
    """
    timed = whole.system.structure.depends_on_time
    folds = CORE + (1.0 if timed else 0.5) * -np.log(tol)
    start, end = whole.start, whole.end
    infinite = [np.isinf(e.t) for e in (start, end)]
    curve, own = _curve(whole, guess)
    if mesh is not None:
        t0, t1 = float(mesh.boundaries[0]), float(mesh.boundaries[-1])
    else:
        t0 = _reach(whole, start, end, folds, curve) if infinite[0] else start.t
        t1 = _reach(whole, end, start, folds, curve) if infinite[1] else end.t
    if curve is None and guess is not None:  # waypoints
        points = waypoints(guess, whole.system.n)
        passed = np.linspace(t0, t1, points.shape[1])
        curve = lambda t: np.stack([np.interp(t, passed, row) for row in points])  # noqa: E731
    if curve is not None and own is None and _is_straight(whole, curve, t0, t1):
        curve = None
    phase = None
    if all(infinite) and not timed:
        _check_energies(whole, t0, t1)
        if not whole.through:  # events tell when it passes them
            phase, shift = _phase(whole, curve, t0, t1)
            if curve is not None and shift:
                later, by = curve, shift
                curve = lambda t: later(t + by)  # noqa: E731
                if own is not None:
                    own = own.moved(own.boundaries[0] - by, own.boundaries[-1] - by)
    problem = whole.replace(
        start=Tail(t0, _place(start), -1, phase) if infinite[0] else start,
        end=Tail(t1, _place(end), 1) if infinite[1] else end,
    )
    _ = problem.rests  # raises
    return Window(problem, curve if curve is None or own is None else _extend(curve, own, problem))


def _is_straight(whole: Problem, curve: Callable[[Array], Any], t0: float, t1: float) -> bool:
    """Whether a guess is the straight line over the window: it says nothing."""
    start, end = ends_of(whole)
    t = np.linspace(t0, t1, LOOKED_AT)
    values = curve(t)
    line = start[:, None] + (t - t0) / (t1 - t0) * (end - start)[:, None]
    size = ROUNDED * np.abs(line).max()
    return bool(np.abs(values - line).max() <= size)


def with_window_of(problem: Problem, like: Problem) -> Problem:
    """Return a problem with the window of another one where its events lie at infinite times."""
    ends = [
        Tail(edge.t, e.near, edge.side, edge.phase) if edge.side else e
        for e, edge in ((problem.start, like.start), (problem.end, like.end))
    ]
    return problem.replace(start=ends[0], end=ends[1])


def for_search(whole: Problem, tol: float) -> Problem:
    """Return the problem on a window, to search for paths of infinite time.

    With one event at infinite time the window is longer, and the coordinates at its edge are given,
    as the path is all but at rest there: more ways of searching know such a problem.

    Raises ValueError as `first_window` does, and for paths from an equilibrium back to itself.
    """
    problem = first_window(whole, None, tol, None).problem
    if problem.is_shifted:
        raise ValueError(
            "expected paths between two equilibria, or with a clock, found paths from one back "
            "to itself, which may leave it at any time; use solve with a guess"
        )
    if np.isinf(whole.start.t) and np.isinf(whole.end.t):
        return problem
    ends = [Event(e.t, e.near) if e.side else e for e in (problem.start, problem.end)]
    return problem.replace(start=ends[0], end=ends[1])


def step(problem: Problem) -> Callable[[Array], Array] | None:
    """Return a step (tanh) from one equilibrium to the other on a window; None if they are one.

    Through events, a path straight between them that comes to rest beyond.
    """
    before, after = problem.rests
    if problem.through:
        return _through_events(problem)
    if before is None or after is None:
        return None
    a, b = (np.array(e.near, dtype=float)[:, None] for e in (problem.start, problem.end))
    if (a == b).all():
        return None
    rate = np.sqrt(before.slow * after.slow) / 2
    return lambda t: (a + b) / 2 + (b - a) / 2 * np.tanh(rate * t)


def _through_events(problem: Problem) -> Callable[[Array], Array]:
    """Return the path straight between given coordinates in a time that slows down towards rest."""
    before, after = problem.rests
    first, last = problem.through[0].t, problem.through[-1].t

    def clock(t: Array) -> Array:
        early, late = np.minimum(t - first, 0.0), np.maximum(t - last, 0.0)
        if before is not None:
            early = np.expm1(before.slow * early) / before.slow
        if after is not None:
            late = -np.expm1(-after.slow * late) / after.slow
        return np.clip(t, first, last) + early + late

    events = problem.joints_found
    times = clock(np.array([e.t for e in events]))
    rows = np.array([[np.nan if x is None else x for x in e.near] for e in events]).T
    known = [(times[~np.isnan(row)], row[~np.isnan(row)]) for row in rows]
    return lambda t: np.stack([np.interp(clock(t), *one) for one in known])


def graded_mesh(problem: Problem, elements: int, degree: int) -> Mesh:
    """Return a mesh over a window, of so many elements or more: the longer, the nearer to rest.

    The mesh is graded from where something happens: the event inside the window, else zero.
    Between given events it is uniform.
    """
    start, end = problem.start, problem.end
    core = next((e.t for e in (start, end) if not e.side), 0.0)
    known = [(e.t - core, r.slow) for e, r in zip((start, end), problem.rests, strict=True) if r]
    if not (known and start.t <= core <= end.t):
        return Mesh.uniform(start.t, end.t, elements, degree)
    parts = []
    for way, slow in known:
        count = max(elements // len(known), math.ceil(abs(way) * slow / FOLDS_EACH))
        parts.append(core + way * (np.arange(count + 1) / count) ** GRADING)
    return Mesh(np.unique(np.concatenate(parts)), degree)


def lengthen_window(
    window: Window, solution: Solution, edges: list[Edge], tol: float
) -> Window | None:
    """Return a window whose edges leave out little enough, or None if this one's do."""
    problem = window.problem
    order = 1 if problem.system.structure.depends_on_time else 2
    ends, grown = [problem.start, problem.end], False
    for edge in edges:
        moved, known = edge.moved, edge.rest
        if moved <= SHARE * tol:
            continue
        grown = True
        folds = np.log(2 * moved / (SHARE * tol)) / order if np.isfinite(moved) else CORE
        by = min(folds / known.slow, (WINDOW_GROWTH - 1) * problem.duration)
        k = 0 if known.side < 0 else 1
        event = ends[k]
        ends[k] = event.at(edge.t + known.side * by)
    if not grown:
        return None
    wider = problem.replace(start=ends[0], end=ends[1])
    return Window(wider, _extend(solution, solution.mesh, wider))


def descend_from_guess(window: Window, watch: Watch | None) -> Path | None:
    """Return a least path that the action leads down to from the guess, or from the line."""
    problem = window.problem
    if not _has_least(problem):
        return None
    mesh = with_boundaries(
        Mesh.uniform(problem.start.t, problem.end.t, DOWN_ELEMENTS, COARSE_DEGREE),
        problem.boundaries,
    )
    tr = Transcription(problem, mesh, problem.lengths)
    tr.watch = watch
    Q = tr.straight() if window.guess is None else window.guess(mesh.nodes).T
    with suppress(np.linalg.LinAlgError):  # not finite
        found = descend(tr, tr.pack(Q))
        return DiscretePath(tr, found.z).path if found.found else None
    return None


def factorize(solution: Solution) -> Factors | None:
    """Return factors of the matrix at a path that was found, or None."""
    at = solution.discrete
    with suppress(np.linalg.LinAlgError):  # not finite
        return Factors(at.tr.layout, at.tr.kkt(at.z)) if solution.success else None
    return None


def _has_least(problem: Problem) -> bool:
    """Whether the action of paths may be lowered freely."""
    system = problem.system
    return not (system.m or system.structure.forced or problem.on_surface)


def descend_from_saddle(solution: Solution, factors: Factors, watch: Watch | None) -> Path | None:
    """Return a least path that the action leads down to from a saddle, or None.

    A straight line between equilibria may be a trap, where symmetry keeps every path on it.
    """
    from actionopt.analysis.spectra.modes import second_variation

    with suppress(ValueError):
        if not (_has_least(solution.problem) and factors.negative()):
            return None
        at = solution.discrete
        eta = second_variation(solution, 1).modes[0]
        t = at.mesh.nodes
        values, away = solution.path(t), eta(t)
        size = np.max(np.abs(values)) / np.max(np.abs(away))
        tr = at.tr.between(solution.problem)  # a solution's own is not watched
        tr.watch = watch
        for part in SADDLE_OFFSETS:
            found = descend(tr, tr.pack((values + part * size * away).T))
            if found.found:
                return DiscretePath(tr, found.z).path
    return None


def set_phase(problem: Problem, path: Path, contacts: tuple[Arc, ...]) -> Problem:
    """Return a problem whose phase is set where a path moves free of contact, if it has a phase.

    The phase holds a node at its time, and no contact can begin or end there.
    """
    if problem.start.phase is None or not contacts:
        return problem
    t = np.linspace(problem.start.t, problem.end.t, LOOKED_AT)
    metric, v = _metric(problem.rests), path.velocity(t)
    squares = np.einsum("nk,nm,mk->k", v, metric, v)
    away = np.min([np.maximum(arc.begin - t, t - arc.end) for arc in contacts], axis=0)
    k = int(np.argmax(np.where(away > 0, squares * np.minimum(away, problem.duration / 4), 0.0)))
    slow = min(known.slow for known in problem.rests if known is not None)
    phase = _plane(metric, path(t[k]), v[:, k] / slow)._replace(t=float(t[k]))
    start = Tail(problem.start.t, problem.start.near, -1, phase)
    return problem.replace(start=start)


def centre(solution: Solution, asked: Phase | None) -> Solution:
    """Return a path shifted in time to where it is asked for, if any time will do.

    From rest back to the same, its farthest point is at t = 0; else it passes the plane of the
    phase that was `asked` at its time.
    """
    problem = solution.problem
    (before, after), phase = problem.rests, problem.start.phase
    if phase is None or asked is None:
        return solution
    assert before is not None and after is not None
    t = np.linspace(problem.start.t, problem.end.t, LOOKED_AT)
    if _same(before.q, after.q):
        metric = -after.slope

        def left(t: Array) -> Array:
            eta = solution.path(t) - after.q[:, None]
            return np.einsum("nk,nm,mk->k", eta, metric, solution.path.velocity(t))

        eta = solution.path(t) - after.q[:, None]
        k = int(np.argmax(np.einsum("nk,nm,mk->k", eta, metric, eta)))
        origin = 0.0
    elif phase == asked:
        return solution
    else:
        normal, center = np.array(asked.normal), np.array(asked.center)

        def left(t: Array) -> Array:
            return normal @ (center[:, None] - solution.path(t))

        k, origin = int(np.argmax(left(t) < 0)), asked.t
    near = t[[max(k - 1, 0)]], t[[min(k + 1, t.size - 1)]]
    low, high = bisect(*near, lambda t: left(t) > 0)
    by = origin - float(low[0] + high[0]) / 2
    mesh = solution.mesh.moved(problem.start.t + by, problem.end.t + by)
    phase = phase._replace(t=phase.t + by)
    start, end = Tail(problem.start.t + by, problem.start.near, -1, phase), problem.end
    moved = problem.replace(start=start, end=end.at(end.t + by))
    return replace(solution, problem=moved, path=Path(mesh, solution.path.values), known=None)


def _reach(whole: Problem, event: Event, other: Event, folds: float, curve: Any) -> float:
    """Return a time for the window's edge, so many e-foldings from where something happens.

    That is the other event, or 0, or where a guess is last away from rest.
    """
    side = 1 if event.t > 0 else -1
    origin = 0.0 if np.isinf(other.t) else other.t
    if whole.through:  # the last event before the rest
        origin = whole.through[-1 if side > 0 else 0].t
    t, q = origin + side, _place(event)
    for _ in range(3 if whole.system.structure.depends_on_time else 1):  # rates may, a little
        known = rest(whole.system, whole.packed, q, t, side)
        t = origin + side * folds / known.slow
    if curve is None:
        return t
    seen = np.append(
        origin,
        origin + (t - origin) * np.geomspace(1 / LONGEST_WINDOW, LONGEST_WINDOW, LOOKED_AT),
    )
    with np.errstate(all="ignore"):  # so late a guess may be anything
        away = np.abs(curve(seen) - q[:, None])
    away = np.where(np.isfinite(away), away, 0.0)
    last = np.flatnonzero((away > CORE_SIZE * away.max(axis=1, keepdims=True)).any(axis=0))
    far = seen[last[-1]] if last.size and last[-1] < seen.size - 1 else origin
    return float(far + side * folds / known.slow) if side * (far - origin) > 0 else t


def _curve(whole: Problem, guess: Any) -> tuple[Any, Mesh | None]:
    """Return a guess as a function of any times, and its mesh if it has one; None for waypoints.

    Outside its mesh the guess is extended by its end values.
    """
    if isinstance(guess, Solution) and guess.problem.has_tails:
        (low, *_, high), old = guess.mesh.boundaries, guess.problem
        low, high = -np.inf if old.start.side else low, np.inf if old.end.side else high
        return (lambda t: guess(np.clip(t, low, high))), guess.mesh
    path = guess.path if isinstance(guess, Solution) else guess
    if isinstance(path, Path):
        if path.values.shape[0] != whole.system.n:
            raise ValueError(
                f"expected a guess of {whole.system.n} coordinates, found {path.values.shape[0]}"
            )
        b = path.mesh.boundaries
        return (lambda t: path(np.clip(t, b[0], b[-1]))), path.mesh
    if not callable(path):
        return None, None
    return checked_curve(path, whole.system.n), None


def _extend(curve: Callable[[Array], Array], own: Mesh, problem: Problem) -> Path:
    """Return a curve on its own elements over another window, with more where that is longer."""
    t0, t1 = problem.start.t, problem.end.t
    b, degrees = own.boundaries, np.array(own.degrees)
    shortest = ELEMENT_CUT * own.lengths.min()
    inner = (b > t0 + shortest) & (b < t1 - shortest)
    inside = b[inner]
    if not inside.size:
        return Path.interpolate(curve, Mesh.uniform(t0, t1, DOWN_ELEMENTS, COARSE_DEGREE))
    longest = own.lengths.max()
    before = np.linspace(t0, inside[0], 1 + max(1, int(np.ceil((inside[0] - t0) / longest))))
    after = np.linspace(inside[-1], t1, 1 + max(1, int(np.ceil((t1 - inside[-1]) / longest))))
    between = degrees[np.flatnonzero(inner)[:-1]]
    mesh = Mesh(
        np.concatenate([before, inside[1:], after[1:]]),
        np.concatenate(
            [np.full(before.size - 1, degrees[0]), between, np.full(after.size - 1, degrees[-1])]
        ),
    )
    return Path.interpolate(curve, mesh)


def _phase(whole: Problem, curve: Any, t0: float, t1: float) -> tuple[Phase | None, float]:
    """Return the condition that fixes the origin of time, and how much later a guess passes there.

    Half way between two equilibria; of one, half way to where a guess is farthest from it.
    """
    rests = _rests(whole, t0, t1)
    metric = _metric(rests)
    apart = rests[1].q - rests[0].q
    t, values = np.linspace(t0, t1, LOOKED_AT), None
    if curve is not None:
        values = curve(t)
    if _same(rests[0].q, rests[1].q):
        if values is None:
            return None, 0.0  # rest itself
        eta = values - rests[0].q[:, None]
        apart = eta[:, int(np.argmax(np.einsum("nk,nm,mk->k", eta, metric, eta)))]
        if not np.any(apart):
            return None, 0.0
    phase = _plane(metric, rests[0].q + apart / 2, apart)
    shift = 0.0
    if values is not None:
        normal, center = np.array(phase.normal), np.array(phase.center)
        passed = np.flatnonzero(normal @ (values - center[:, None]) > 0)
        k = passed[0] if passed.size else 0
        shift = float(t[k])
    return phase, shift


def _check_energies(whole: Problem, t0: float, t1: float) -> None:
    """Raise ValueError where no path leads from rest to rest, as L does not contain t.

    Where forces change the energy, or two equilibria differ in it.
    """
    if whole.system.structure.forced and not whole.through:
        raise ValueError(
            "expected a clock, or one event of finite time, with non-conservative forces, "
            "found both at infinite times: these change the energy on the way, and a path "
            "leads from rest to rest at single values of a parameter only"
        )
    before, after = _rests(whole, t0, t1)
    apart = after.q - before.q
    need = float(apart @ _metric((before, after)) @ apart) * max(before.slow, after.slow)
    if abs(before.lagrangian - after.lagrangian) > MERGED * need and not _same(before.q, after.q):
        raise ValueError(
            "expected two equilibria of one energy, as L does not contain t, found "
            f"{-before.lagrangian:.10g} and {-after.lagrangian:.10g}: no path leads from "
            "rest at one to rest at the other; change the potential, or an event"
        )


def _rests(whole: Problem, t0: float, t1: float) -> tuple[Rest, Rest]:
    """Return the equilibria at both ends of a window."""
    system, packed = whole.system, whole.packed
    return (
        rest(system, packed, _place(whole.start), t0, -1),
        rest(system, packed, _place(whole.end), t1, 1),
    )


def _metric(rests: Sequence[Rest | None]) -> Array:
    """Return how the action grows away from two equilibria: positive, (n, n)."""
    before, after = rests
    assert before is not None and after is not None
    metric = (before.slope - after.slope) / 2
    if not np.all(np.linalg.eigvalsh(metric) > 0):
        metric = np.diag(np.abs(np.diagonal(metric)).clip(1e-300))
    return metric


def _plane(metric: Array, center: Array, apart: Array) -> Phase:
    """Return the phase at t = 0 on the plane through a point, across the way `apart` (n,)."""
    weight = float(apart @ metric @ apart)
    return Phase(0.0, tuple((metric @ apart / weight).tolist()), tuple(center.tolist()), weight)


def _place(event: Event) -> Array:
    """Return the coordinates of an equilibrium, (n,)."""
    return np.array(event.q, dtype=float)


def _same(a: Array, b: Array) -> bool:
    """Whether two equilibria are one."""
    size = max(np.abs(a).max(), np.abs(b).max())
    return bool(np.abs(a - b).max() <= ROUNDED * size)


def infinite_problem(problem: Problem) -> Problem | None:
    """Return the problem with its events at infinite times, if both are equilibria it may join.

    A path between them would dwell at either; None if they are not, or it has a clock.
    """
    system, n = problem.system, problem.system.n
    bound = system.m or system.r or system.structure.forced or problem.through
    plain = not (bound or system.structure.depends_on_time)
    ends = problem.start, problem.end
    if not plain or any(len(e.pinned) < n for e in ends) or problem.advance is not None:
        return None
    whole = problem.replace(start=Event(-np.inf, problem.start.q), end=Event(np.inf, problem.end.q))
    try:
        first_window(whole, None, COARSEST, None)
    except ValueError:
        return None
    return whole


def restrict_guess(solution: Solution, problem: Problem) -> Callable[[Array], Array]:
    """Return a path of infinite time as a guess for a path of finite time between the same places.

    Placed so that it dwells at either end for as many e-foldings.
    """
    before, after = solution.problem.rests
    assert before is not None and after is not None
    t = problem.start.t + problem.duration * after.slow / (before.slow + after.slow)
    return lambda times: solution(times - t)


def explain_short_window(tol: float, moved: float) -> str:
    """Return the hint where no window is long enough."""
    return (
        "beyond the last window the path is not on the linear manifold of the equilibrium, which "
        f"may move it by {moved:.2g}, more than tol = {tol:g}: it comes to rest more slowly than "
        "its rates say, or not there"
    )
