"""First paths of a given energy between two events, for a search for all of them.

The energy leaves a motion from the start nothing but its direction. Motions in all directions are
followed past the end, and from where each is nearest to it a path is sought, over the time that
took; besides those between whose durations the energy of the paths over given ones passes the one
asked.
"""

from __future__ import annotations

from contextlib import suppress
from itertools import chain

import numpy as np

from actionopt.analysis.quadratic.second_variation import tangent
from actionopt.analysis.solution import Solution
from actionopt.discrete.borders.borders import over
from actionopt.discrete.meshes.path import Path
from actionopt.mechanics.question.problem import Problem
from actionopt.solver.ends.closed import LOOKED_AT
from actionopt.solver.ends.durations import rates, return_time, times_along
from actionopt.solver.kinds.first_paths import FirstPaths, straight
from actionopt.solver.kinds.single_shooting import (
    PASSES_EACH,
    THROWN,
    MissUnits,
    cut_off,
    passages,
)
from actionopt.solver.refinement.iterate import sizes
from actionopt.tools.types import Array

# Times the duration along the straight line, or up and back, that motions are followed; ad hoc.
LONGEST_SEARCH = 6.0
MOST_PASSAGES = 40  # passages from which paths are sought, of each class of windings
NEARBY_TARGET = 1e-1  # of the sizes: a sample of a path that may pass the end is no farther
SAME_ORBIT = 1e-6  # of its size and duration: a path closer than that is at its end


def first_paths(
    problem: Problem, tol: float, windings: int, shots: int, seed: int
) -> tuple[list[tuple[Path, str]], ValueError | None]:
    """Return first paths and how each was found, and why none was asked for, if that is so."""
    paths = FirstPaths(problem, tol)
    known = [(at.path, "durations") for at in chain(paths.over_durations(), paths.longer_sought())]
    passing = _passages(problem, known, shots, windings, np.random.default_rng(seed))
    return known + [(path, "forward shots") for path in passing], paths.refused


def _passages(
    problem: Problem,
    known: list[tuple[Path, str]],
    shots: int,
    windings: int,
    rng: np.random.Generator,
) -> list[Path]:
    """Return motions of the energy from the start to where they pass the end, the nearest first."""
    system, start, end = problem.system, problem.start, problem.end
    if len(start.pinned) < system.n or (start.t is None and end.t is not None):
        return []
    if system.structure.depends_on_time:  # the energy is given where the time is free
        return []
    t0, q0 = start.t or 0.0, np.array(start.q, dtype=float)
    line = times_along(problem, straight(problem), t0)
    T = [path.mesh.duration for path, _ in known] + [return_time(problem, q0, t0)]
    T += [] if line is None else [float(line[0][-1])]
    fixed = over(problem, LONGEST_SEARCH * max(T))
    size = fixed.scales
    basis = tangent(problem, q0[None], np.array([[t0]]), size)[0]
    angle = 2 * np.pi * (np.arange(THROWN) + rng.random()) / THROWN
    fan, freedom = np.stack([np.cos(angle), np.sin(angle)], axis=1), basis.shape[1]
    if freedom == 1:
        u = np.array([[1.0], [-1.0]])
    elif freedom == 2:
        u = fan
    else:  # in all directions, and in the plane of the end and of the force: of central ones, all
        chord = straight(problem)[-1] - q0
        force = np.zeros(system.n)
        with suppress(np.linalg.LinAlgError):
            force = system.acceleration(q0, 0 * q0, t0, parameters=problem.parameters)
        ways = np.nan_to_num(np.stack([chord, force], axis=1)) / size[:, None]
        plane, _ = np.linalg.qr(basis.T @ ways)
        u = np.concatenate([rng.standard_normal((max(shots, 1), freedom)), fan @ plane.T])
    u = u @ basis.T * size  # alike in the coordinates' own sizes
    speed, left = rates(problem, np.repeat(q0[None], len(u), axis=0), u, np.full((len(u), 1), t0))
    if not np.all(left > 0):
        raise ValueError(
            f"expected an energy above that of rest at the start, {problem.energy - left[0]:.6g}, "  # type: ignore[operator]
            f"found {problem.energy:.6g}: no motion leaves from there"
        )
    unit = np.maximum(size, np.abs(straight(problem)[-1] - q0))
    q, v = np.repeat(q0[:, None], len(u), axis=1), (speed[:, None] * u).T
    most = 2 + windings if freedom == 1 else PASSES_EACH
    units = MissUnits.of(problem, unit, q, v, t0)
    spans = fixed.duration / 4, fixed.duration
    passed = chain.from_iterable(passages(problem, q, v, spans, units, most=most))
    nearest = sorted(passed, key=lambda item: item[0])[:MOST_PASSAGES]
    return [cut_off(problem, motion, end) for _, motion, end in nearest]


def is_first(solution: Solution, windings: int) -> bool:
    """Whether a path does not pass its end before: it is another one with a period or turn more.

    Of one degree of freedom it turns back, and `windings` says how often it may.
    """
    pinned = list(solution.problem.end.pinned)
    t0, T = solution.start.t, solution.duration
    t = t0 + T * np.linspace(0, 1, LOOKED_AT + 1)
    q, end = solution(t)[pinned], solution.end.q[pinned, None]
    size = sizes(solution(t).T, solution.problem.scales)[pinned, None]
    if len(solution.problem.end.q) == 1:
        away = (q - end)[0, 1:-1]
        return int(np.sum(away[1:] * away[:-1] < 0)) <= windings
    away = np.linalg.norm((q - end) / size, axis=0)
    low = (away[1:-1] <= away[:-2]) & (away[1:-1] < away[2:])
    most = windings if solution.problem.system.degrees_of_freedom == 1 else 0
    return _passes(solution, t[1:-1][low & (away[1:-1] < NEARBY_TARGET)], size) <= most


def _passes(solution: Solution, times: Array, size: Array) -> int:
    """Return how often the path is at its end near those times, before it ends."""
    pinned = list(solution.problem.end.pinned)
    end, passed = solution.end.q[pinned], []
    for t in times:
        for _ in range(8):  # Newton's method for the time of least distance
            away, v = solution(t)[pinned] - end, solution.velocity(t)[pinned]
            step = float((away / size[:, 0]) @ (v / size[:, 0]) / np.sum((v / size[:, 0]) ** 2))
            t = float(np.clip(t - step, solution.start.t, solution.end.t))
        if np.linalg.norm((solution(t)[pinned] - end) / size[:, 0]) < np.sqrt(SAME_ORBIT):
            known = [solution.start.t, solution.end.t, *passed]
            if min(abs(t - other) for other in known) > SAME_ORBIT * solution.duration:
                passed.append(t)
    return len(passed)
