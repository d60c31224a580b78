"""All ways past discs, each disc on one side or the other: every minimum of them is known.

A taut string has one shortest form for each choice of sides: 2^k minima for k discs, if it goes
round none of them fully. A search for the global minimum can be scored by the part that it found.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable

import numpy as np

from actionopt.solver.solve import solve
from actionopt.suite import active_set
from actionopt.suite.member import Stationary
from actionopt.suite.problem import TestProblem
from actionopt.suite.stars import NO_PATH
from actionopt.tools.types import Array

BESIDE_DISC = 1.3  # from a disc's centre, in its radius: where the guess passes it
WAY_TOL = 1e-8  # of the paths: the optima on the mesh are farther away


def ways(problem: TestProblem) -> dict[tuple[int, ...], Stationary]:
    """Return the minimum for each choice of sides, 1 above a disc and -1 below it, the least first.

    Of a member with discs one behind the other: disc, discs and pegs. Raises ValueError for another
    one, and if the mesh is too coarse.
    """
    discs = centres(problem)
    if not discs:
        raise ValueError(f"expected a member with discs: disc, discs or pegs, found {problem.name}")
    found = {
        sides: _way(problem, np.array(discs), np.array(sides))
        for sides in itertools.product((1, -1), repeat=len(discs))
    }
    return dict(sorted(found.items(), key=lambda way: way[1].f))


def centres(problem: TestProblem) -> list[tuple[float, float]]:
    """Return where the centres of the discs are that are in the way; none of most members."""
    numbers = problem.scene.facts.numbers
    return [(numbers[f"x{i}"], numbers[f"y{i}"]) for i in range(len(numbers)) if f"x{i}" in numbers]


def _way(problem: TestProblem, centres: Array, sides: Array) -> Stationary:
    asked, tr = problem.scene.problem, problem.transcription
    corners = np.vstack([tr.ends[0], centres, tr.ends[-1]])
    corners[1:-1, 1] += BESIDE_DISC * sides
    T = asked.duration

    def guess(t: Array) -> Array:
        x = np.interp(np.asarray(t), (asked.start.t, asked.start.t + T), corners[[0, -1], 0])
        return np.stack([x, np.interp(x, corners[:, 0], corners[:, 1])])

    path = solve(asked, tol=WAY_TOL, guess=guess)
    Q = np.asarray(path(tr.mesh.nodes)).T
    star = active_set.nearest(tr, tr.pack(Q)[: tr.layout.unknowns], NO_PATH)
    if star is None:
        raise ValueError(
            f"expected a mesh that tells the way on the sides {sides.tolist()}, found none near "
            f"it on {tr.mesh.elements} elements; use more"
        )
    x = star.z[: problem.n]
    return Stationary(x * problem.unit, tr.action(x) * tr.action_unit, star.index)


def score(problem: TestProblem, points: Iterable[Array], reach: float = 1e-3) -> float:
    """Return which part of all ways is among the points x (n,): within `reach`, in units of x."""
    known, given = [*ways(problem).values()], list(points)
    met = [any(problem.distance(x, way.x) <= reach for x in given) for way in known]
    return float(np.mean(met))
