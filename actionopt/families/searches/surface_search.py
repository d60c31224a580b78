"""Points all over the surfaces of events, to which paths are sought."""

from __future__ import annotations

import numpy as np

from actionopt.discrete.borders.surfaces import onto
from actionopt.mechanics.question.problem import Event, Problem
from actionopt.solver.kinds.first_paths import given_time
from actionopt.solver.kinds.nearest_points import near, sizes
from actionopt.tools.types import Array

# Ad hoc.
SURFACE_SPREAD = np.array([0.3, 1.0, 3.0])  # of the way to a surface, from where it is looked for
EACH = 6  # points a start
# How far a surface reaches is told by so many points on it, looked for from ever farther; it is
# bounded if it reaches no farther than this part of where they were looked for.
REACH_POINTS, REACH_GROWTH, REACH_ROUNDS, BOUNDED_WITHIN = 12, 4.0, 8, 0.4
LEAST_EXTENT = 0.1  # of the largest one, in the units of the coordinates


def points(problem: Problem, starts: int, seed: int) -> list[Array]:
    """Return pairs (2, n) of points near each other and, so many a start, all over the surfaces."""
    n, count = problem.system.n, EACH * starts
    random = np.random.default_rng(seed)
    axes = np.concatenate([np.zeros((1, n)), np.eye(n), -np.eye(n)])
    away = random.standard_normal((count, n)) * np.resize(SURFACE_SPREAD, count)[:, None]
    pairs = near(problem, axes)
    return pairs + (_all_over(problem, pairs, count, random) or near(problem, away))


def _all_over(
    problem: Problem, pairs: list[Array], count: int, random: np.random.Generator
) -> list[Array]:
    """Return pairs (2, n) of points all over the surfaces; none if these have no bounds."""
    if not pairs:
        return []
    over = np.tile(pairs[0], (count, 1, 1))
    for k, event in enumerate(problem.surfaces):
        if event is not None:
            feet = _feet(problem, event, pairs[0], k, count, random)
            if not feet.size:
                return []
            over[:, k] = np.resize(feet, (count, feet.shape[1]))
    return list(over)


def _feet(
    problem: Problem, event: Event, pair: Array, k: int, count: int, random: np.random.Generator
) -> Array:
    """Return points (K, n) all over the surface of an event; none if it has no bounds.

    They are looked for from `pair` (2, n), points of both events near each other.
    """
    size, t = sizes(problem), given_time(problem) if event.t is None else event.t

    def look(centre: Array, reach: Array, count: int) -> Array:
        starts = centre + reach * random.standard_normal((count, centre.size))
        feet = onto(problem, event, starts, np.full(count, t), size)
        return feet[np.isfinite(feet).all(axis=1)]

    reach = max(1.0, np.abs((pair[1] - pair[0]) / size).max())
    for _ in range(REACH_ROUNDS):
        feet = np.vstack([pair[k], look(pair[k], reach * size, REACH_POINTS)])
        low, high = feet.min(axis=0), feet.max(axis=0)
        extent = (high - low) / 2 / size
        if extent.max() < BOUNDED_WITHIN * reach:
            extent = np.maximum(extent, LEAST_EXTENT * extent.max())
            return look((low + high) / 2, extent * size, count)
        reach = REACH_GROWTH * reach
    return np.empty((0, size.size))
