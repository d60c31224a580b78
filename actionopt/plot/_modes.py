"""Directions in which to vary a path: the lowest modes of d2S, in the path's own size."""

from __future__ import annotations

import numpy as np

from actionopt.analysis.modes import second_variation
from actionopt.analysis.solution import Solution
from actionopt.discrete.path import Path
from actionopt.tools.types import Array


def sizes(solution: Solution) -> Array:
    """Return how far each coordinate ranges along the path, (n,): units to vary it by."""
    t = np.linspace(solution.problem.start.t, solution.problem.end.t, 201)
    q = solution(t)
    span, size = np.ptp(q, axis=1), np.max(np.abs(q), axis=1)
    span = np.where(span > 1e-6 * np.max(size, initial=0.0), span, size)
    # What is zero but for round-off has the size of its events.
    return np.where(span > 1e-12 * np.max(size), span, solution.problem.scales)


def directions(solution: Solution, count: int = 2) -> tuple[Array, list[Path]]:
    """Return the lowest eigenvalues of d2S, (count,), and modes that reach 1 in units of `sizes`.

    Each mode's sign makes its largest displacement positive. Raises ValueError as
    `index.second_variation` does.
    """
    units = sizes(solution)
    found = second_variation(solution, count, units=units)
    modes = []
    for mode in found.modes:
        shares = mode.values / units[:, None]
        largest = shares.ravel()[np.argmax(np.abs(shares))]
        modes.append(Path(mode.mesh, mode.values / largest))
    return found.eigenvalues, modes


def both_ways(eigenvalues: Array) -> list[int]:
    """Return which two modes tell most: the lowest, and the first that raises S if one lowers it.

    >>> both_ways(np.array([-2.0, -1.0, 3.0])), both_ways(np.array([1.0, 2.0]))
    ([0, 2], [0, 1])
    """
    up = np.flatnonzero(eigenvalues > 0)
    first = int(up[0]) if up.size and up[0] > 0 else min(1, eigenvalues.size - 1)
    return [0, first] if first else [0]
