"""Whether a path crosses a jump of the Lagrangian: then it is no path.

A jump in q or v is an infinite force, which no derivative shows. One in t alone is none: there q
and p are continuous, and the path is resolved.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from actionopt.discrete.path import Path
from actionopt.mechanics.problem import Problem
from actionopt.mechanics.switches import Switches
from actionopt.mechanics.tracing import SAMPLES
from actionopt.tools.types import Array

BISECTIONS = 60  # between two samples there are no more floats to halve
LONGEST_TEXT = 60  # of a surface that is told; ad hoc
CONTINUOUS = 1e-9  # of the largest |L| along the path: branches this close meet; ad hoc


@dataclass(frozen=True, eq=False)
class Jump:
    """Where a path crosses a jump of L: the time, q and v (n,), and by how much L jumps there."""

    t: float
    q: Array
    v: Array
    height: float
    inevitable: bool  # whether the two ends of the path lie on different sides
    surface: str  # the comparison that changes there

    def __str__(self) -> str:
        """Say where."""
        q = ", ".join(f"{x:.6g}" for x in self.q)
        where = f", where {self.surface} changes" if len(self.surface) < LONGEST_TEXT else ""
        return f"L jumps by {self.height:.3g} at t = {self.t:.6g}, q = [{q}]{where}"


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
    heights = L(high, after) - L(high, before)
    jumps = np.flatnonzero(~(np.abs(heights) <= CONTINUOUS * size))
    if not jumps.size:
        return None
    k = jumps[0]
    q, v, t = state(high[k : k + 1])
    inevitable = bool((c[0] != c[-1]).any())
    changed = " and ".join(found.texts[i] for i in np.flatnonzero(before[k] != after[k]))
    return Jump(float(t[0, 0]), q[0], v[0], float(abs(heights[k])), inevitable, changed)
