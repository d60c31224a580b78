"""Whether a path crosses a jump of the Lagrangian: then it is no path.

A jump in q or v is an infinite force, which no derivative shows. A jump in t alone is harmless:
there q and p are continuous, and the path is resolved. Jumps that are written as comparisons are
found where these change, all others where the balance of energy does not hold (`energy_balance`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import ClassVar, Literal

import numpy as np

from actionopt.discrete.between_nodes.energy_balance import (
    DRIFT_SAFETY,
    INNER_PARTS,
    Balance,
    Imbalance,
    narrowest_intervals,
    plain_drift,
    round_off_time,
    rounding,
)
from actionopt.discrete.between_nodes.unsampled import unsampled_steps
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.mechanics.laws.switches import Switches
from actionopt.mechanics.laws.tracing import SAMPLES
from actionopt.mechanics.question.problem import Problem
from actionopt.tools.bisection import bisect
from actionopt.tools.immutable import immutable
from actionopt.tools.types import EPS, Array

LONGEST_TEXT = 60  # of a surface that is told; ad hoc
CONTINUOUS = 1e-9  # of the largest |L| along the path: branches this close meet; ad hoc
# A step, in L, that may be arccos's of a rounded cosine: half of the digits. Derived.
HALF_OF_DIGITS = 4 * math.sqrt(EPS)
# How far from a step L is continued, in the duration: ten digits of arccos are left. Derived.
FARTHER = 64 * math.sqrt(EPS)
# Distances from a jump to either side, in units of the shortest, at which L is compared. A jump is
# the same at all of them; of a cusp |x|^a the upper quartile is 500^a times the lower one.
WIDER = 4.0 ** np.arange(10)


@immutable
class Jump:
    """Where a path crosses a jump of L: the time, q and v (n,), and by how much L jumps there."""

    t: float
    q: Array
    v: Array
    height: float
    energy: float  # by how much v . L_v - L jumps there
    is_jump: ClassVar[Literal[True]] = True
    inevitable: bool = False  # whether the two ends of the path lie on different sides of a surface
    surface: str = ""  # the comparison that changes there

    def __str__(self) -> str:
        """Return a phrase that says where it is."""
        q = ", ".join(f"{x:.6g}" for x in self.q)
        told = 0 < len(self.surface) < LONGEST_TEXT
        where = f", where {self.surface} changes" if told else ""
        jumps = f"L jumps by {self.height:.3g} at t = {self.t:.6g}, q = [{q}]{where}"
        return f"{jumps}, and the energy by {self.energy:.3g}"


def first_crossing(found: Switches, problem: Problem, path: Path) -> Jump | None:
    """Return the first jump of L that `path` crosses, or None.

    Between samples of the path the values of the steps in L change; bisection finds when. It is a
    jump where L differs with the values before and after, at one state.
    """

    def state(since: Array) -> tuple[Array, Array, Array]:
        t = problem.start.t + since
        if problem.system.order > 1:
            q, v = path.carried_on(since, 1.0, problem.system.order)
            return q.T, v.T, t[:, None]
        inside = np.clip(t, *path.mesh.boundaries[[0, -1]])
        return path(inside).T, path.velocity(inside).T, t[:, None]

    def steps(since: Array) -> Array:
        return found.values(*state(since), problem.packed)[0].copy()

    def L(since: Array, c: Array) -> Array:
        return found.held(*state(since), problem.packed, c)[0][:, 0].copy()

    times = np.unique(np.append(np.linspace(0, problem.duration, SAMPLES), path.mesh.nodes_since))
    c = steps(times)
    changes = np.flatnonzero((c[1:] != c[:-1]).any(axis=1))
    if not changes.size:
        return None
    size = np.abs(L(times, c))
    size = size[np.isfinite(size)].max(initial=0.0)
    before = c[changes]
    is_low = lambda t: (steps(t) == before).all(axis=1)  # noqa: E731
    low, high = bisect(times[changes], times[changes + 1], is_low)
    after = steps(high)
    heights = np.abs(L(high, after) - L(high, before))
    apart = np.flatnonzero(~(heights <= CONTINUOUS * size))
    first = _first_jump(problem, path, low[apart], high[apart])
    if first is None:
        return None
    jump, k = first[0], apart[first[1]]
    changed = " and ".join(found.texts[i] for i in np.flatnonzero(before[k] != after[k]))
    # Between events at which highest rates are not given, they may be on either side.
    inevitable = problem.system.order == 1 and bool((c[0] != c[-1]).any())
    return replace(jump, inevitable=inevitable, surface=changed)


def find_imbalance(
    at: DiscretePath,
    error: float,
    tol: float = np.inf,
    growth: Callable[[], float] = lambda: 1.0,
) -> tuple[Jump | Imbalance | None, float]:
    """Return where the balance of energy does not hold, a jump of L if there is one; None if not.

    And the error of the path as far as its energy tells: beyond `tol`, that may come of steps
    closer than samples.

    Parameters
    ----------
    at : DiscretePath
    error, tol : float
        The path's, and to what it is wanted, in its own size.
    growth : callable
        Returns how much farther an impulse moves the path than a free body, at least one.
    """
    structure = at.problem.system.structure
    off, told = (None, error) if structure.jumpless else _between_samples(at, error, tol, growth)
    hidden = unsampled_steps(at) if off is None else None
    if hidden is not None and hidden[1] > 0:
        told = max(told, DRIFT_SAFETY * growth() * hidden[1])
        off = hidden[0] if told > max(tol, error) else None
    return off, told


def _between_samples(
    at: DiscretePath, error: float, tol: float, growth: Callable[[], float]
) -> tuple[Jump | Imbalance | None, float]:
    """Return what `find_imbalance` does, as far as energies from sample to sample tell."""
    drift = plain_drift(at)
    if drift is not None and DRIFT_SAFETY * drift <= max(tol, error):
        return None, max(error, DRIFT_SAFETY * drift)
    balance = Balance.of(at)
    off = jump_or(at, balance.beyond(error, 1.0 if balance.holds else growth()))
    told = max(error, DRIFT_SAFETY * balance.drift())
    if off is None and told > max(tol, error):
        known = rounding(at.problem, at.path)
        told = max(error, DRIFT_SAFETY * balance.drift(known, stepped=True))
        off = balance.largest() if told > tol else None
    return off, told


def jump_or(at: DiscretePath, found: Imbalance | None) -> Jump | Imbalance | None:
    """Return a jump of L behind an imbalance of energy, or the imbalance if there is none."""
    if found is None:
        return None
    found = narrowest_intervals(at.problem, at.path, found)
    if found is None:
        return None
    close = found.high - found.low <= INNER_PARTS * round_off_time(at.problem)
    first = _first_jump(at.problem, at.path, found.low[close], found.high[close])
    if first is not None:
        return first[0]
    return None if close.all() else found  # what is no jump so close is a cusp, or round-off


def _first_jump(problem: Problem, path: Path, low: Array, high: Array) -> tuple[Jump, int] | None:
    """Return the first jump of L between close times since the start, (K,), and which, or None.

    On either side of a jump L has a value of its own: half the samples there agree much better than
    those of the two sides do. (Nearest to it round-off may put them on the wrong side.)
    """
    if not low.size:
        return None
    apart = np.maximum(high - low, round_off_time(problem))[:, None]
    since = np.hstack([low[:, None] - apart * WIDER, high[:, None] + apart * WIDER])
    since = np.clip(since, 0.0, problem.duration)
    q, v = (part.T for part in path.carried_on(since.ravel(), 1.0, problem.system.order))
    t = problem.start.t + (low + high) / 2  # a jump in t alone is harmless
    t = np.repeat(t, since.shape[1])[:, None]
    first = problem.system.pointwise("first")
    _, p, L = (part.copy() for part in first(q, v, t, problem.packed))
    energy = np.einsum("kn,kn->k", p, v) - L[:, 0]
    # L changes with a velocity that jumps, whether it jumps itself or not.
    kept = v.reshape(*since.shape, -1).copy()
    jumps = _heights(kept.transpose(0, 2, 1)).any(axis=1)
    kept[jumps] = kept[jumps, :1]
    L = first(q, kept.reshape(v.shape), t, problem.packed)[2]
    heights = _heights(L.reshape(since.shape))
    rounded = (heights > 0) & (heights <= HALF_OF_DIGITS * np.nanmax(np.abs(L), initial=0.0))
    if rounded.any():
        heights[rounded & ~jumps & _meet_nearby(problem, path, low, high)] = 0.0
    if not heights.any():
        return None
    k = int(np.argmax(heights > 0))
    before, after = (np.nanmedian(side) for side in np.split(energy.reshape(since.shape)[k], 2))
    q, v = (part[:, 0] for part in path.carried_on(high[k : k + 1], 1.0))
    height, change = float(heights[k]), float(abs(after - before))
    return Jump(float(problem.start.t + high[k]), q, v, height, change), k


def _meet_nearby(problem: Problem, path: Path, low: Array, high: Array) -> Array:
    """Return (K,) whether L meets in a kink near a place, continued from farther on either side.

    Next to one that is written as arccos(cos(q)) it is known to half of the digits, and steps.
    """
    apart = FARTHER * problem.duration * np.array([1.0, 2.0])
    since = np.stack([low[:, None] - apart, high[:, None] + apart])
    since = np.clip(since, 0.0, problem.duration)
    q = path.carried_on(since.ravel(), 1.0, problem.system.order)[0].T
    middle = np.broadcast_to((low + high)[:, None] / 2, since.shape).ravel()
    v = path.carried_on(middle, 1.0, problem.system.order)[1].T  # an element rounds its kink off
    t = problem.start.t + middle[:, None]
    L = problem.system.pointwise("first")(q, v, t, problem.packed)[2]
    near, far = np.moveaxis(L.reshape(since.shape), -1, 0)
    left, right = 2 * near - far
    kink = (far - near).sum(axis=0)  # what its slope changes by, times the distance
    return np.abs(right - left) < np.abs(kink) / 2


def _heights(values: Array) -> Array:
    """Return by how much the halves of values (..., K) differ, those of two sides; zero if no jump.

    Half the samples of each side agree much better than those of the two do.
    """
    sides = np.stack(np.split(values, 2, axis=-1))
    sides = np.sort(np.where(np.isfinite(sides), sides, np.nan), axis=-1)  # those last
    last = np.isfinite(sides).sum(axis=-1, keepdims=True) - 1
    at = np.maximum(last, 0) * np.array([0.25, 0.5, 0.75])
    below = at.astype(int)
    lower = np.take_along_axis(sides, below, -1)
    upper = np.take_along_axis(sides, np.minimum(below + 1, np.maximum(last, 0)), -1)
    quartiles = lower + (at - below) * (upper - lower)
    height = np.abs(quartiles[1, ..., 1] - quartiles[0, ..., 1])
    spread = (quartiles[..., 2] - quartiles[..., 0]).sum(axis=0)
    return np.where(spread <= height / 2, height, 0.0)  # neither if a side is not known
