"""Events at infinite time: a window, at whose edges the path lies on a linear manifold.

It is that of the equilibrium beyond.
Where the window should end is not known before the path is. So it is solved on one, and what the
linear manifold leaves out is measured at its edges: by how much the acceleration there differs from
that of the linear motion, over the square of the slowest rate. Where that is too much the window
grows by as many e-foldings as are missing, and the path is followed.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from actionopt.analysis.modes import second_variation
from actionopt.analysis.solution import Solution
from actionopt.discrete.discrete_path import DiscretePath
from actionopt.discrete.mesh import Mesh
from actionopt.discrete.path import Path
from actionopt.mechanics.problem import Event, Phase, Problem, Tail
from actionopt.mechanics.rest import Rest, rest
from actionopt.solver.descent import descend
from actionopt.solver.iterate import sizes
from actionopt.tools.checks import numbers
from actionopt.tools.types import Array

# Ad hoc, where nothing else is said.
CORE = 4.0  # e-foldings of a window besides those of its tail: the path is somewhere, too
WINDOWS = 10  # that are tried
SHARE = 0.25  # of the tolerance for what the windows' edges leave out
WINDOW_GROWTH = 3.0  # times as long the next window may be
ASIDE = (0.1, -0.1, 0.3, -0.3)  # of its size, how far a saddle is left along its lowest mode
GUESS_SAMPLES = 512  # of a guess, where its phase is sought
SAME_ENERGY = 1e-8  # of what moving between two equilibria takes
SAME_PLACE = 1e-9  # of the coordinates' size, within which two equilibria are one


@dataclass(frozen=True)
class Window:
    """A problem of finite times in the place of one of infinite ones, and what is guessed of it."""

    problem: Problem
    guess: Callable[[Array], Array] | None

    def edges(self, solution: Solution) -> list[tuple[float, Rest, float]]:
        """Return what each tail leaves out, relative to q; its equilibrium, and the time."""
        problem = self.problem
        Q = solution.path.values.T
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
            a = problem.system.acceleration(q, v, event.t, parameters=problem.parameters)
            left = np.abs(a - known.rates @ v) / known.slow**2
            found.append((float((left / size).max()), known, event.t))
        return found


def first(whole: Problem, guess: Any, tol: float, mesh: Mesh | None) -> Window:
    """Return the first window of a problem with events at infinite times.

    Raises ValueError where there is no equilibrium, or it is no saddle; if the energies of two
    differ; or for a guess of the wrong shape.
    """
    timed = whole.system.structure.depends_on_time
    folds = CORE + (1.0 if timed else 0.5) * -np.log(tol)
    start, end = whole.start, whole.end
    infinite = [np.isinf(e.t) for e in (start, end)]
    if mesh is not None:
        t0, t1 = float(mesh.boundaries[0]), float(mesh.boundaries[-1])
    else:
        t0 = _reach(whole, start, end, folds) if infinite[0] else start.t
        t1 = _reach(whole, end, start, folds) if infinite[1] else end.t
    curve = _extended(whole, guess, t0, t1)
    if not all(infinite) or timed:
        phase = None
    else:
        phase, shift = _phase(whole, curve, t0, t1)
        if curve is not None and shift:
            inner = curve
            curve = lambda t: inner(t + shift)  # noqa: E731
    ends = (
        Tail(t0, _place(start), -1, phase) if infinite[0] else start,
        Tail(t1, _place(end), 1) if infinite[1] else end,
    )
    problem = Problem(whole.system, *ends, parameters=whole.parameters)
    _ = problem.rests  # raises
    return Window(problem, curve)


def longer(window: Window, solution: Solution, tol: float) -> Window | None:
    """Return a window whose edges leave out little enough, or None if this one's do."""
    problem = window.problem
    order = 1 if problem.system.structure.depends_on_time else 2
    ends, grown = [problem.start, problem.end], False
    for left, known, t in window.edges(solution):
        if left <= SHARE * tol:
            continue
        grown = True
        folds = np.log(2 * left / (SHARE * tol)) / order if np.isfinite(left) else CORE
        by = min(folds / known.slow, (WINDOW_GROWTH - 1) * problem.duration)
        k = 0 if known.side < 0 else 1
        event = ends[k]
        ends[k] = event.at(t + known.side * by)
    if not grown:
        return None
    return Window(Problem(problem.system, *ends, parameters=problem.parameters), solution)


def lower(solution: Solution) -> Path | None:
    """Return a least path that the action leads down to from a saddle, or None.

    A straight line between equilibria may be a trap, where symmetry keeps every path on it.
    """
    with suppress(ValueError):
        if not solution.morse_index:
            return None
        eta = second_variation(solution, 1).modes[0]
        at = solution.discrete
        t = at.mesh.nodes
        values, away = solution.path(t), eta(t)
        size = np.max(np.abs(values)) / np.max(np.abs(away))
        for part in ASIDE:
            found = descend(at.tr, at.tr.pack((values + part * size * away).T))
            if found.found:
                return DiscretePath(at.tr, found.z).path
    return None


def centred(solution: Solution) -> Solution:
    """Return a path from rest back to the same with its farthest point at t = 0."""
    problem = solution.problem
    (before, after), start, end = problem.rests, problem.start, problem.end
    if not isinstance(start, Tail) or start.phase is None:
        return solution
    assert before is not None and after is not None
    if not _same(before.q, after.q):
        return solution
    metric = -after.slope
    t = np.linspace(start.t, end.t, GUESS_SAMPLES)

    def rate(t: Array) -> Array:
        eta = solution.path(t) - after.q[:, None]
        return np.einsum("nk,nm,mk->k", eta, metric, solution.path.velocity(t))

    eta = solution.path(t) - after.q[:, None]
    k = int(np.argmax(np.einsum("nk,nm,mk->k", eta, metric, eta)))
    low, high = t[max(k - 1, 0)], t[min(k + 1, t.size - 1)]
    for _ in range(60):  # bisection
        middle = (low + high) / 2
        low, high = (middle, high) if rate(np.array([middle]))[0] > 0 else (low, middle)
    by = -(low + high) / 2
    mesh = solution.mesh.moved(start.t + by, end.t + by)
    phase = start.phase._replace(t=start.phase.t + by)
    moved = Problem(
        problem.system,
        Tail(start.t + by, start.rest, -1, phase),
        end.at(end.t + by),
        parameters=problem.parameters,
    )
    return replace(solution, problem=moved, path=Path(mesh, solution.path.values), known=None)


def judged(window: Window, solution: Solution) -> Solution:
    """Return the solution with what the edges leave out in its error."""
    left = max((x[0] for x in window.edges(solution)), default=0.0)
    return replace(solution, error=solution.error + left)


def _reach(whole: Problem, event: Event, other: Event, folds: float) -> float:
    """Return a time for the window's edge: so many e-foldings from the other event or from 0."""
    side = 1 if event.t > 0 else -1
    origin = 0.0 if np.isinf(other.t) else other.t
    t = origin + side
    for _ in range(3):  # the rates may depend on the time a little
        known = rest(whole.system, whole.packed, _place(event), t, side)
        t = origin + side * folds / known.slow
    return t


def _extended(whole: Problem, guess: Any, t0: float, t1: float) -> Any:
    """Return a guess as a function of any times; what is no path is left as it is."""
    if isinstance(guess, Solution) and isinstance(guess.problem, Problem):
        return guess
    path = guess.path if isinstance(guess, Solution) else guess
    if isinstance(path, Path):
        b = path.mesh.boundaries
        return lambda t: path(np.clip(t, b[0], b[-1]))
    if guess is None or callable(guess):
        return guess
    points = np.atleast_2d(numbers(guess, "the guess, a callable or waypoints"))
    if points.ndim != 2 or points.shape[0] != whole.system.n or points.shape[1] < 2:
        return guess  # refused later
    times = np.linspace(t0, t1, points.shape[1])
    return lambda t: np.stack([np.interp(t, times, row) for row in points])


def _phase(whole: Problem, curve: Any, t0: float, t1: float) -> tuple[Phase | None, float]:
    """Return what chooses the origin of time, and how much later a guess passes there.

    Half way between two equilibria; of one, half way to where a guess is farthest from it.
    """
    system, packed = whole.system, whole.packed
    rests = [
        rest(system, packed, _place(e), t, side)
        for e, t, side in ((whole.start, t0, -1), (whole.end, t1, 1))
    ]
    metric = (rests[0].slope - rests[1].slope) / 2
    if not np.all(np.linalg.eigvalsh(metric) > 0):
        metric = np.diag(np.abs(np.diagonal(metric)).clip(1e-300))
    apart = rests[1].q - rests[0].q
    t, values = np.linspace(t0, t1, GUESS_SAMPLES), None
    if curve is not None:
        values = np.atleast_2d(numbers(curve(t), "the guess at times t"))
        if values.shape != (system.n, t.size):
            return None, 0.0  # refused later
    if _same(rests[0].q, rests[1].q):
        if values is None:
            return None, 0.0  # rest itself
        eta = values - rests[0].q[:, None]
        apart = eta[:, int(np.argmax(np.einsum("nk,nm,mk->k", eta, metric, eta)))]
        if not np.any(apart):
            return None, 0.0
    else:
        need = float(apart @ metric @ apart) * max(rests[0].slow, rests[1].slow)
        if abs(rests[0].lagrangian - rests[1].lagrangian) > SAME_ENERGY * need:
            raise ValueError(
                "expected two equilibria of one energy, as L does not contain t, found "
                f"{-rests[0].lagrangian:.10g} and {-rests[1].lagrangian:.10g}: no path leads from "
                "rest at one to rest at the other; change the potential, or an event"
            )
    weight = float(apart @ metric @ apart)
    normal, center = metric @ apart / weight, rests[0].q + apart / 2
    shift = 0.0
    if values is not None:
        passed = np.flatnonzero(normal @ (values - center[:, None]) > 0)
        k = passed[0] if passed.size else 0
        shift = float(t[k])
    phase = Phase(0.0, tuple(normal.tolist()), tuple(center.tolist()), weight)
    return phase, shift


def _place(event: Event) -> Array:
    """Return the coordinates of an equilibrium, (n,)."""
    return np.array(event.q, dtype=float)


def _same(a: Array, b: Array) -> bool:
    """Whether two equilibria are one."""
    size = max(np.abs(a).max(), np.abs(b).max())
    return bool(np.abs(a - b).max() <= SAME_PLACE * size)


def unmet(tol: float, left: float) -> str:
    """Return what to say where no window is long enough."""
    return (
        f"beyond the last window the path is {left:.2g} from the linear manifold of the "
        f"equilibrium, more than tol = {tol:g}: it comes to rest more slowly than its rates say, "
        "or not there"
    )
