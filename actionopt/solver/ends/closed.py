"""Closed paths seen from elsewhere along themselves: before their start, after it, begun anew."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from actionopt.discrete.meshes.path import Path
from actionopt.mechanics.question.problem import Problem
from actionopt.solver.refinement.iterate import ROUNDED
from actionopt.solver.refinement.workspace import PATIENT
from actionopt.tools.types import EPS, Array

# Ad hoc.
LOOKED_AT = 600  # times at which a motion is looked at for where it passes or rests
LAST_PHASE_STEP = EPS**0.5  # of a period, a last step: elsewhere what is left is its square
SURFACE_PASSAGES = 4  # of a surface that are tried
SLIVER = 0.1  # of an element
KEPT_ELEMENTS = 3  # elements that stay as they are


def passage_times(
    path: Path, problem: Problem, pinned: Sequence[int], wanted: Array, unit: Array
) -> list[tuple[float, float]]:
    """Return when a closed path passes coordinates that are wanted, and how far off, in units.

    Less than a period before its start or after it; `wanted` and `unit` are those of `pinned`.
    """
    T = path.mesh.duration

    def away(since: Array) -> tuple[Array, Array]:
        q, v = states_beyond(path, problem, since)
        return (q[pinned] - wanted[:, None]) / unit[:, None], v[pinned] / unit[:, None]

    again = _is_same(problem)  # what is passed in a period was in the one before
    t, step = np.linspace(0.0 if again else -T, T, (2 - again) * LOOKED_AT + 1)[:-1], T / LOOKED_AT
    apart, rates = away(t)
    far = np.sqrt(np.einsum("ik,ik->k", apart, apart))
    nearest = (far <= np.roll(far, 1)) & (far <= np.roll(far, -1))
    reach = 2 * step * math.sqrt(np.einsum("ik,ik->k", rates, rates).max())
    nearest = np.flatnonzero(nearest & (far <= far.min() + reach))  # others are farther
    low, high, at = t[nearest] - step, t[nearest] + step, t[nearest]
    apart, rates = apart[:, nearest], rates[:, nearest]
    # Gauss and Newton's method, between the neighbours: at a turning point steps are halved.
    for _ in range(PATIENT):
        down, square = np.einsum("ik,ik->k", apart, rates), np.einsum("ik,ik->k", rates, rates)
        next_at = np.clip(at - np.divide(down, square, 0 * at, where=square > 0), low, high)
        moved, at = np.abs(next_at - at).max(), next_at
        apart, rates = away(at)
        if moved <= LAST_PHASE_STEP * T:
            break
    off = np.abs(apart).max(axis=0)
    at = np.concatenate([at - T, at]) if again else at
    off = np.concatenate([off, off]) if again else off
    return [(s, x) for s, x in zip(at.tolist(), off.tolist(), strict=True) if abs(s) < T]


def _is_same(problem: Problem) -> bool:
    """Whether the next period of a closed path is the same in all coordinates."""
    assert problem.advance is not None
    return problem.order == tuple(range(len(problem.order))) and not problem.advance.any()


def states_beyond(path: Path, problem: Problem, since: Array) -> tuple[Array, Array]:
    """Return q and v (n, K) of a closed path at times since its start, before and after as well."""
    T = path.mesh.duration
    order, advance = list(problem.order), problem.advance
    assert advance is not None
    turns = np.floor(since / T).clip(-1, 1)
    q, v = path.carried_on((since - turns * T).clip(0.0, T), 1.0)
    if _is_same(problem):
        return q, v
    back = np.argsort(order)
    earlier = (q - advance[:, None])[back], v[back]
    later = problem.closed_from(q), v[order]
    pairs = zip(earlier, (q, v), later, strict=True)
    q, v = (np.where(turns < 0, a, np.where(turns > 0, c, b)) for a, b, c in pairs)
    return q, v


def begin_on_surface(path: Path, problem: Problem) -> list[Path]:
    """Return a path, if it closes without a clock one for each time at which it meets its surface.

    That is where the start is to be; those that come nearest first.
    """
    on = problem.start.on
    if on is None or not problem.may_be_shifted:
        return [path]
    since = np.linspace(0.0, path.mesh.duration, LOOKED_AT + 1)[:-1]
    t = path.mesh.boundaries[0] + since
    off = np.linalg.norm(on.values(path(t).T, t, problem.packed), axis=1)
    nearest = np.flatnonzero((off <= np.roll(off, 1)) & (off <= np.roll(off, -1)))
    nearest = nearest[np.argsort(off[nearest], kind="stable")][:SURFACE_PASSAGES]
    return [begin_later(path, float(shift), problem) for shift in since[nearest]]


def begin_later(path: Path, shift: float, problem: Problem) -> Path:
    """Return a closed path begun at the time `shift` after its start, or before."""
    mesh = path.mesh
    t0, T = mesh.boundaries[0], mesh.duration
    since, ahead = mesh.since, shift % T
    cut = min(int(np.searchsorted(since, ahead, side="right")) - 1, mesh.elements - 1)
    b = np.concatenate([[0.0], since[cut + 1 :] - ahead, since[1 : cut + 1] + (T - ahead), [T]])
    degrees = np.concatenate([mesh.degrees[cut:], mesh.degrees[: cut + 1]])
    # Where it began before, two elements become one again, no longer than one beside them.
    seam, lengths = mesh.elements - cut, np.diff(b)
    beside = max(lengths[seam - 2], lengths[(seam + 1) % lengths.size])
    if mesh.elements > KEPT_ELEMENTS and b[seam + 1] - b[seam - 1] <= (1 + ROUNDED) * beside:
        degrees[seam - 1] = degrees[seam - 1 : seam + 1].max()
        b, degrees = np.delete(b, seam), np.delete(degrees, seam)
    # The element that is cut in two: a sliver of it goes with its neighbour.
    sliver = SLIVER * mesh.lengths[cut]
    keep = np.ones(degrees.size, dtype=bool)
    keep[0], keep[-1] = b[1] > sliver, T - b[-2] > sliver
    inner = b[1:-1][keep[:-1] & np.r_[np.ones(degrees.size - 2, dtype=bool), keep[-1]]]
    b = np.concatenate([[0.0], inner, [T]])
    curve = lambda t: states_beyond(path, problem, t - t0 + shift)[0]  # noqa: E731
    return Path.interpolate(curve, mesh.cut(b, degrees[keep]))
