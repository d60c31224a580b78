"""Paths beside an infinite time that come to rest on their way: the least way leads there.

A path of a finite time to the rest itself has given ends, and is found where a path to the manifold
beside the rest is not. It is near the one asked for; or it comes near another rest of the same
energy, the nearer the more time it has. Then the least way leads over that rest, and a motion that
comes there never leaves it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from actionopt.analysis.solution import Solution
from actionopt.discrete.meshes.path import Path
from actionopt.mechanics.question.problem import Problem
from actionopt.solver.ends.closed import LOOKED_AT
from actionopt.solver.ends.durations import MERGED, equilibrium, legs_to_rest, name_place, potential
from actionopt.solver.ends.window import for_search
from actionopt.solver.kinds.between import Choices, between, solve_on_the_way
from actionopt.solver.search.strategies import DESCENT_COORDINATES, GUESS_ONLY
from actionopt.tools.types import Array

# Ad hoc. The tolerance of paths, and what their windows leave out: in shorter ones they stay less,
# and are found more easily.
TO_REST_TOL, TO_REST_LEFT = 1e-4, 1e-2
SLOW_NEAR_REST = 0.25  # of the largest speed: where a path may come to rest it is slower
# E-foldings away from another rest that a path is given besides, and its distance from there, of
# what it was: exp(-1/2) if it spends them there, and one if it passes by. Measured on 8 that come
# to rest: 0.54 to 0.64.
MORE, NEARER = 1.0, 0.8


def has_other_rests(whole: Problem) -> bool:
    """Whether rests of which the question tells nothing may be between a rest and an event."""
    few = 1 < whole.system.n <= DESCENT_COORDINATES and not whole.through
    return few and len(list(legs_to_rest(whole))) == 1


def path_to_rest(whole: Problem, choices: Choices) -> tuple[Path | None, str]:
    """Return a path of a finite time to the rest itself, and why no motion takes its way.

    None where none is found; the sentence is empty where one may. Raises OutOfTime.
    """
    known = for_search(whole, TO_REST_LEFT)
    found = solve_on_the_way(known, TO_REST_TOL, choices.watch, brief=True)
    if not found.success:
        return None, ""
    away = np.array([-1.0 * np.isinf(whole.start.t), np.isinf(whole.end.t)])
    near_guess = replace(choices, tol=TO_REST_TOL, strategies=GUESS_ONLY)
    for other, slow in _rests(whole, found):
        t = found.mesh.boundaries[[0, -1]] + MORE / slow * away
        longer = known.replace(start=known.start.at(float(t[0])), end=known.end.at(float(t[1])))
        guess = Path(found.mesh.moved(*t), found.path.values)
        later = between(longer, guess, near_guess, verdict=False)[0]
        if later.success and _distance(later, other) < NEARER * _distance(found, other):
            place = name_place(whole.system, other)
            return None, (
                f"the least way found leads over {place}, where a motion of that energy rests, and "
                "stays"
            )
    return found.path, ""


def _rests(whole: Problem, path: Solution) -> Iterator[tuple[Array, float]]:
    """Yield rests (n,) on the way of a path, as high as that it leads to, and their least rates."""
    a, b, energy = next(legs_to_rest(whole))
    t = np.linspace(path.start.t, path.end.t, LOOKED_AT)
    q, unit = path(t), path.problem.lengths[:, None]
    speed = np.linalg.norm(path.velocity(t) / unit, axis=0)
    most = float(np.abs(potential(whole, q.T) - energy).max())
    slower = np.diff(speed) < 0
    for k in 1 + np.flatnonzero(slower[:-1] & ~slower[1:]):
        if speed[k] > SLOW_NEAR_REST * speed.max():
            continue
        found = equilibrium(whole, q[:, k])
        if found is None or not abs(potential(whole, found[0][None])[0] - energy) <= MERGED * most:
            continue
        other, rates = found[0], np.abs(np.real(found[2]))
        places = np.stack([q[:, k], a, b], axis=1)
        here, *ends = np.linalg.norm((places - other[:, None]) / unit, axis=0)
        if here < min(ends) and rates.min() > MERGED * rates.max():
            yield other, float(rates.min())


def _distance(path: Solution, q: Array) -> float:
    """Return how near a path comes to a place, in the units of its motion."""
    t = np.linspace(path.start.t, path.end.t, LOOKED_AT)
    away = (path(t) - q[:, None]) / path.problem.lengths[:, None]
    return float(np.linalg.norm(away, axis=0).min())
