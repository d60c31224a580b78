"""Closed paths seen from elsewhere along themselves: before their start, after it, begun anew."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from actionopt.discrete.path import Path
from actionopt.mechanics.problem import Problem
from actionopt.tools.types import Array

# Ad hoc.
PASSED = 400  # times a period at which a closed path is looked for what its start gives
PARTS, CLOSED_IN = 40, 9  # of the time between two of them, in turn: 40^9 is more than 1 / EPS
SLIVER = 0.1  # of an element


def passes(
    path: Path, problem: Problem, pinned: Sequence[int], wanted: Array, unit: Array
) -> list[tuple[float, float]]:
    """Return when a closed path passes coordinates that are wanted, and how far off, in units.

    Less than a period before its start or after it; `wanted` and `unit` are those of `pinned`.
    """
    T = path.mesh.duration

    def away(since: Array) -> tuple[Array, Array]:
        q, v = beyond(path, problem, since)
        return (q[pinned] - wanted[:, None]) / unit[:, None], v[pinned] / unit[:, None]

    t = np.linspace(-T, T, 2 * PASSED + 1)[:-1]
    far = np.linalg.norm(away(t)[0], axis=0)
    nearest = np.flatnonzero((far <= np.roll(far, 1)) & (far <= np.roll(far, -1)))
    times = [_nearest(away, float(t[k]) - T / PASSED, t[k] + T / PASSED, t[k]) for k in nearest]
    return [(s, float(np.abs(away(np.array([s]))[0]).max())) for s in times if abs(s) < T]


def beyond(path: Path, problem: Problem, since: Array) -> tuple[Array, Array]:
    """Return q and v (n, K) of a closed path at times since its start, before and after as well."""
    t0, T = path.mesh.boundaries[0], path.mesh.duration
    order, advance = list(problem.order), problem.advance
    assert advance is not None
    turns = np.clip(np.floor(since / T), -1, 1)
    t = t0 + np.clip(since - turns * T, 0.0, T)
    q, v, back = path(t), path.velocity(t), np.argsort(order)
    earlier = (q - advance[:, None])[back], v[back]
    later = problem.closed_from(q), v[order]
    pairs = zip(earlier, (q, v), later, strict=True)
    q, v = (np.where(turns < 0, a, np.where(turns > 0, c, b)) for a, b, c in pairs)
    return q, v


def rolled(path: Path, shift: float, problem: Problem) -> Path:
    """Return a closed path begun at the time `shift` after its start, or before."""
    mesh = path.mesh
    t0, T = mesh.boundaries[0], mesh.duration
    since, ahead = mesh.since, shift % T
    cut = min(int(np.searchsorted(since, ahead, side="right")) - 1, mesh.elements - 1)
    b = np.concatenate([[0.0], since[cut + 1 :] - ahead, since[1 : cut + 1] + (T - ahead), [T]])
    degrees = np.concatenate([mesh.degrees[cut:], mesh.degrees[: cut + 1]])
    # The element that is cut in two: a sliver of it goes with its neighbour.
    sliver = SLIVER * mesh.lengths[cut]
    keep = np.ones(degrees.size, dtype=bool)
    keep[0], keep[-1] = b[1] > sliver, T - b[-2] > sliver
    inner = b[1:-1][keep[:-1] & np.r_[np.ones(degrees.size - 2, dtype=bool), keep[-1]]]
    b = np.concatenate([[0.0], inner, [T]])
    curve = lambda t: beyond(path, problem, t - t0 + shift)[0]  # noqa: E731
    return Path.interpolate(curve, mesh.cut(b, degrees[keep]))


def _nearest(
    away: Callable[[Array], tuple[Array, Array]], a: float, b: float, middle: float
) -> float:
    """Return where between a and b what `away` returns, with its rate, is least: `middle` if not.

    Where it vanishes, or turns back.
    """
    for _ in range(CLOSED_IN):
        times = np.linspace(a, b, PARTS + 1)
        growing = np.einsum("ik,ik->k", *away(times)) >= 0
        turns = np.flatnonzero(~growing[:-1] & growing[1:])
        if not turns.size:
            break
        a, b = (float(times[turns[0] + k]) for k in (0, 1))
        middle = (a + b) / 2
    return middle
