"""First paths to events on surfaces: to points that are found on these, the nearest first."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import islice
from typing import NamedTuple

import numpy as np

from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.borders.borders import over
from actionopt.discrete.borders.surfaces import onto
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.discrete.newton.newton import approach
from actionopt.mechanics.question.events import Event
from actionopt.mechanics.question.problem import Problem
from actionopt.mechanics.question.scales import diagonal
from actionopt.solver.kinds.between import solve_on_the_way
from actionopt.solver.kinds.first_paths import (
    FirstPaths,
    duration_along,
    given_time,
    straight,
    straight_action,
)
from actionopt.solver.kinds.single_shooting import arrivals, meeting_speed
from actionopt.solver.refinement.first_mesh import FIRST_TOL
from actionopt.solver.refinement.workspace import PATIENT
from actionopt.tools.types import Array
from actionopt.tools.watch import Watch

# Ad hoc.
APART = 1e-6  # of the coordinates' sizes: points nearer to one another are one
# Points to which a least path is sought; coordinates whose axes are tried one by one: of more, as
# many directions by chance.
NEAREST_POINTS = 6
WITH_PAINS = 2  # points to which a path is sought in every way, where none was found
AGAIN = 4  # times that the other surface, and one that moves, is asked anew


def paths_to_points(
    problem: Problem, tol: float, watch: Watch | None, pairs: Iterable[Array] | None = None
) -> Iterator[DiscretePath]:
    """Yield paths to `points` on the surfaces, in the order of the actions along straight lines."""
    for k, (fixed, line) in enumerate(points(problem, pairs)):
        if fixed.free_time:
            timed = FirstPaths(fixed, tol, watch).over_durations()
            yield from islice(timed, None if k < WITH_PAINS else 1)
            continue
        line.tr.watch = watch
        found = approach(line.tr, line.z, PATIENT)
        yield line if found is None else DiscretePath(line.tr, found[0])


def paths_between_given_times(problem: Problem, watch: Watch | None) -> Iterator[Path]:
    """Yield paths between given times to the nearest points, for which every way is tried."""
    if problem.free_time:
        return
    for fixed, _ in islice(points(problem), WITH_PAINS):
        found = solve_on_the_way(fixed, FIRST_TOL, watch)
        if found.success:
            yield found.path


def motions(problem: Problem, watch: Watch | None) -> Iterator[Path]:
    """Yield motions from the start, or from points of its surface, that arrive at the end."""
    starts = [fixed for fixed, _ in points(problem)]
    if not starts and problem.free_time and len(problem.start.pinned) == problem.system.n:
        starts = [problem]  # a surface that moves is where no straight line leads
    size = sizes(problem)
    if starts:
        size = np.maximum(size, np.abs(np.diff(straight(starts[0])[[0, -1]], axis=0)[0]))
    yield from arrivals(problem, starts, size, watch)


def between_places(problem: Problem, places: Array) -> Problem:
    """Return the problem between `places` (2, n) where its ends lie on surfaces."""
    given = zip((problem.start, problem.end), places, strict=True)
    ends = [e if e.on is None else Event(e.t, q) for e, q in given]
    energy = problem.energy if problem.free_time else None
    return Problem(problem.system, *ends, parameters=problem.parameters, energy=energy)


def points(
    problem: Problem, pairs: Iterable[Array] | None = None
) -> Iterator[tuple[Problem, DiscretePath]]:
    """Yield problems between points on the surfaces, and straight lines, the least action first.

    The points are those of `pairs` (2, n) if any are given, else those `near` each other.
    """
    size = sizes(problem)
    found = np.array(near(problem, size=size) if pairs is None else list(pairs))
    found = found.reshape(-1, 2, size.size)  # none too
    alike = np.round(found / (APART * size)) + 0.0  # no -0.0
    first = {row.tobytes(): k for k, row in reversed([*enumerate(alike)])}
    lines = _lines(problem, found[sorted(first.values())])
    known = [line for line in lines if np.isfinite(line[0])] or lines
    for _, tr, pair, values, fixed in sorted(known, key=lambda line: line[0]):
        if fixed is None:
            try:
                fixed = between_places(problem, pair)
            except ValueError:
                continue
            tr = Transcription(fixed, tr.mesh, fixed.lengths)
        yield fixed, DiscretePath(tr, tr.pack(values))


def near(
    problem: Problem, directions: Array | None = None, size: Array | None = None
) -> list[Array]:
    """Return points (2, n) of both events, on their surfaces, and near each other.

    They are looked for in `directions` (k, n), in units of the way to the first one; else along the
    axes. `size` (n,) are the `sizes` of the problem, if they are known.
    """
    n, size = problem.system.n, sizes(problem) if size is None else size
    nearest = _pairs(problem, np.zeros((1, n)), size)
    far = float(np.abs((nearest[0, 1] - nearest[0, 0]) / size).max()) if nearest.size else 0.0
    if directions is None:
        directions = np.concatenate([np.eye(n), -np.eye(n)])
        if n > NEAREST_POINTS:
            directions = np.random.default_rng(0).standard_normal((2 * NEAREST_POINTS, n))
    return [*nearest, *_pairs(problem, (far or 1.0) * directions * size, size)]


def sizes(problem: Problem) -> Array:
    """Return the coordinates' sizes (n,), of equal kinetic energy: units on a surface."""
    size = over(problem, 1.0).scales
    ends = problem.start, problem.end
    pairs = zip(ends[0].near, ends[1].near, strict=True)
    q = np.array([[(b or 0.0) if a is None else a for a, b in pairs]])
    t = np.array([[given_time(problem)]])
    second = problem.system.pointwise("second")(q, size[None], t, problem.packed)[2]
    with np.errstate(all="ignore"):
        units = 1 / np.sqrt(diagonal(problem.system, 2, second)[0])
        found = np.max(size / units) * units
    return np.where(np.isfinite(found) & (found > 0), found, size)


class _Line(NamedTuple):
    """A straight line between points (2, n), its values on a mesh, and the action along it.

    The action is S + E T where the time is free, and infinite where a mass is below zero; `fixed`
    is the problem between the points, if it was made and `tr` is of that.
    """

    action: float
    tr: Transcription
    pair: Array
    values: Array
    fixed: Problem | None


def _lines(problem: Problem, pairs: Array) -> list[_Line]:
    """Return the straight lines between points (K, 2, n)."""
    ends, system = (problem.start, problem.end), problem.system
    loose = [[e.on is None and x is None for x in e.near] for e in ends]  # keep the other's
    ways = np.where(loose, pairs[:, ::-1], pairs)
    lines, states = [], []
    for k, pair in enumerate(pairs):
        try:
            fixed = between_places(problem, pair)
            tr = straight_action(fixed)
        except ValueError:
            continue
        # Over given times all share a mesh, and states are affine in the points.
        here = slice(k, k + 1 if problem.free_time else None)
        first, way = ways[here, 0], ways[here, 1] - ways[here, 0]
        part = tr.mesh.nodes_since[:, None] / tr.mesh.duration
        at, v = tr.state_of(part.repeat(system.n, axis=1))
        state = at.reshape(len(v), -1, system.n) * way[:, None, None]
        state[:, :, 0] += first[:, None]
        rates, times = (v * way[:, None]).reshape(-1, system.n), np.tile(tr.times, (len(way), 1))
        states.append((state.reshape(len(rates), -1), rates, times))
        values = first[:, None] + part * way[:, None]
        known = [fixed] + [None] * (len(way) - 1)
        lines += [(tr, *line) for line in zip(pairs[here], values, known, strict=True)]
        if not problem.free_time:
            break
    if not lines:
        return []
    state = *(np.concatenate(x) for x in zip(*states, strict=True)), problem.packed
    with np.errstate(all="ignore"):
        L = system.pointwise("value")(*state)[0][:, 0].copy()
        if not system.structure.constant_mass:  # constant ones are taken to be at least zero
            row, col = system.pointwise("second").sparsity(2)
            mass = system.pointwise("second")(*state)[2][:, row == col]
            L[(mass < 0).any(axis=1)] = np.inf
        energy, found = (problem.energy or 0.0) if problem.free_time else 0.0, []
        first = 0
        for line in lines:
            tr, last = line[0], first + line[0].weight.size  # they may take different meshes
            S = float(tr.weight[:, 0] @ L[first:last]) + energy * tr.mesh.duration
            found.append(_Line(S if np.isfinite(S) else np.inf, *line))
            first = last
        return found


def _pairs(problem: Problem, away: Array, size: Array) -> Array:
    """Return coordinates (k, 2, n) of both events, on their surfaces near each other.

    And `away` (K, n), where there are some.
    """
    ends = problem.start, problem.end
    on = [k for k in (1, 0) if ends[k].on is not None]
    known = [[0.0 if x is None else x for x in e.near] for e in ends]
    for k in reversed(on):  # near the other one
        given = zip(ends[k].q, known[1 - k], strict=True)
        known[k] = [b if a is None else a for a, b in given]
    q, t = np.tile(known, (len(away), 1, 1)), given_time(problem)
    q[:, on] += away[:, None]
    both, timed = len(on) == 2, problem.has_moving_surface and problem.free_time
    for again in range(AGAIN if both or timed else 1):
        for k in on:
            event = ends[k]
            at = np.full(len(q), t if event.t is None else event.t)
            if again and both:
                q[:, k] = q[:, 1 - k]
            if again and event.t is None:
                at += [_passage(problem, pair, size) * (1 if k else -1) for pair in q]
            q[:, k] = onto(problem, event, q[:, k], at, size)
            q = q[np.isfinite(q[:, k]).all(axis=1)]
    return q


def _passage(problem: Problem, q: Array, size: Array) -> float:
    """Return how long a motion of the energy takes between points q (2, n), to meet a surface."""
    T = duration_along(problem, q[0] + np.linspace(0, 1, 11)[:, None] * (q[1] - q[0]))
    way = float(np.linalg.norm((q[1] - q[0]) / size))
    if problem.has_moving_surface and way > 0:  # it may run away faster than motions of the energy
        T = way / float(meeting_speed(problem, q, size, given_time(problem), way / T))
    return T
