"""Whether a path crosses a jump of the Lagrangian: then it is no path.

A jump in q or v is an infinite force, which no derivative shows. One in t alone is none: there q
and p are continuous, and the path is resolved. Jumps that are written as comparisons are found
where these change, all others where the balance of energy does not hold (`energy_balance`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from actionopt.discrete.discrete_path import DiscretePath
from actionopt.discrete.energy_balance import (
    INNER_PARTS,
    Imbalance,
    imbalance,
    narrowed,
    rounded,
)
from actionopt.discrete.path import Path
from actionopt.mechanics.problem import Problem
from actionopt.mechanics.switches import Switches
from actionopt.mechanics.tracing import SAMPLES
from actionopt.tools.types import Array

BISECTIONS = 60  # between two samples there are no more floats to halve
LONGEST_TEXT = 60  # of a surface that is told; ad hoc
CONTINUOUS = 1e-9  # of the largest |L| along the path: branches this close meet; ad hoc
# Distances from a jump to either side, in units of the shortest, at which L is compared. A jump is
# the same at all of them; of a cusp |x|^a the upper quartile is 500^a times the lower one.
WIDER = 4.0 ** np.arange(10)


@dataclass(frozen=True, eq=False)
class Jump:
    """Where a path crosses a jump of L: the time, q and v (n,), and by how much L jumps there."""

    t: float
    q: Array
    v: Array
    height: float
    energy: float  # by how much v . L_v - L jumps there
    inevitable: bool = False  # whether the two ends of the path lie on different sides of a surface
    surface: str = ""  # the comparison that changes there

    def __str__(self) -> str:
        """Say where."""
        q = ", ".join(f"{x:.6g}" for x in self.q)
        told = 0 < len(self.surface) < LONGEST_TEXT
        where = f", where {self.surface} changes" if told else ""
        jumps = f"L jumps by {self.height:.3g} at t = {self.t:.6g}, q = [{q}]{where}"
        return f"{jumps}, and the energy by {self.energy:.3g}"


def crossed(found: Switches, problem: Problem, path: Path) -> Jump | None:
    """Return the first jump of L that `path` crosses, or None."""

    def state(since: Array) -> tuple[Array, Array, Array]:
        t = problem.start.t + since
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
    low, high, before, after = times[changes], times[changes + 1], c[changes], c[changes + 1]
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        there = steps(middle)
        same = (there == before).all(axis=1)
        low, high = np.where(same, middle, low), np.where(same, high, middle)
        after = np.where(same[:, None], after, there)
    heights = np.abs(L(high, after) - L(high, before))
    for k in np.flatnonzero(~(heights <= CONTINUOUS * size)):
        jump = _jump(problem, path, low[k], high[k])
        if jump is not None:
            inevitable = bool((c[0] != c[-1]).any())
            changed = " and ".join(found.texts[i] for i in np.flatnonzero(before[k] != after[k]))
            return replace(jump, inevitable=inevitable, surface=changed)
    return None


def unbalanced(at: DiscretePath, error: float) -> Jump | Imbalance | None:
    """Return a jump of L behind an imbalance of energy, or where there is one without, or None.

    `error` is that of the path, in its own size.
    """
    return jump_or(at, imbalance(at.tr, at.x, error))


def jump_or(at: DiscretePath, found: Imbalance | None) -> Jump | Imbalance | None:
    """Return a jump of L behind an imbalance of energy, or the imbalance if there is none."""
    if found is None:
        return None
    found = narrowed(at.problem, at.path, found)
    if found is None:
        return None
    close = found.high - found.low <= INNER_PARTS * rounded(at.problem)
    for low, high in zip(found.low[close], found.high[close], strict=True):
        jump = _jump(at.problem, at.path, low, high)
        if jump is not None:
            return jump
    return None if close.all() else found  # what is no jump so close is a cusp, or round-off


def _jump(problem: Problem, path: Path, low: float, high: float) -> Jump | None:
    """Return the jump of L between two close times since the start, or None if it is none.

    On either side of a jump L has a value of its own: half the samples there agree much better than
    those of the two sides do. (Nearest to it round-off may put them on the wrong side.)
    """
    apart = max(high - low, rounded(problem))
    since = np.concatenate([low - apart * WIDER, high + apart * WIDER])
    since = np.clip(since, 0.0, problem.duration)
    q, v = (part.T for part in path.carried_on(since, 1.0))
    t = np.full((since.size, 1), problem.start.t + (low + high) / 2)  # a jump in t alone is none
    first = problem.system.pointwise("first")
    _, p, L = (part.copy() for part in first(q, v, t, problem.packed))
    energy = np.einsum("kn,kn->k", p, v) - L[:, 0]
    if any(_height(component) for component in v.T):  # with which L changes, jump or not
        L = first(q, np.broadcast_to(v[0], v.shape), t, problem.packed)[2]
    height = _height(L[:, 0])
    if not height:
        return None
    before, after = (np.nanmedian(side) for side in np.split(energy, 2))
    q, v = (part[:, 0] for part in path.carried_on(np.array([high]), 1.0))
    return Jump(float(problem.start.t + high), q, v, height, float(abs(after - before)))


def _height(values: Array) -> float:
    """Return by how much the halves of values (K,) differ, those of two sides; zero if no jump.

    Half the samples of each side agree much better than those of the two do.
    """
    sides = np.split(np.where(np.isfinite(values), values, np.nan), 2)
    if any(np.isnan(side).all() for side in sides):
        return 0.0
    (l0, l1, l2), (r0, r1, r2) = (np.nanquantile(side, (0.25, 0.5, 0.75)) for side in sides)
    height = float(abs(r1 - l1))
    return height if (l2 - l0) + (r2 - r0) <= height / 2 else 0.0
