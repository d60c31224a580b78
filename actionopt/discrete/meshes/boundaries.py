"""Meshes with boundaries at the instants at which laws switch by the clock."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from actionopt.discrete.meshes.mesh import Mesh, with_singular_ends
from actionopt.discrete.meshes.path import Path
from actionopt.mechanics.laws.instants import Instant
from actionopt.tools.types import EPS, Array, NDInt

SNAPPED = 0.25  # of an element: a boundary that is nearer to an instant is moved there; ad hoc


def carry_boundaries(
    mesh: Mesh,
    old: tuple[Instant, ...],
    new: tuple[Instant, ...],
    start: float,
    end: float,
    events: tuple[Array, Array] = (np.zeros(0), np.zeros(0)),
) -> Mesh:
    """Return the mesh on [start, end]; boundaries at the `old` instants move to the `new` ones.

    So do those at `events`, times (k,) before and after, past whatever instants they move. Times
    are mapped affinely between instants; where the numbers of these differ on a leg, between those
    that stay.
    """
    if not (old or new or events[0].size):
        return mesh.moved(start, end)
    b, reach = mesh.since, _slack(mesh)
    at, to = (
        _inside(old, mesh.boundaries[0], mesh.duration, reach),
        _inside(new, start, end - start, reach),
    )
    ends = np.r_[0, find_boundaries(mesh, events[0]), b.size - 1]
    legs = np.r_[0.0, events[1] - start, end - start]
    known, times = [ends], [legs]
    for k in range(ends.size - 1):
        here = at[(at > b[ends[k]] + 2 * reach) & (at < b[ends[k + 1]] - 2 * reach)]
        there = to[(to > legs[k] + 2 * reach) & (to < legs[k + 1] - 2 * reach)]
        own = np.minimum(np.searchsorted(b, here - reach), b.size - 1)
        if here.size != there.size:  # an end passes some: the others stay
            apart = (here + mesh.boundaries[0])[:, None] - (there + start)
            first, second = (np.abs(apart) <= reach).nonzero()
            here, own, there = here[first], own[first], there[second]
        if np.all(np.abs(b[own] - here) <= reach):
            known.append(own)
            times.append(there)
    which = np.concatenate(known)
    if which.size == 2:
        return mesh.moved(start, end)
    order = np.argsort(which)
    since = np.interp(b, b[which[order]], np.concatenate(times)[order])
    return Mesh.over(start, end, since, mesh.degrees, mesh.singular_ends)


def with_boundaries(mesh: Mesh, known: tuple[Instant, ...]) -> Mesh:
    """Return the mesh with boundaries at the instants; one that is close is moved there."""
    if not known:
        return mesh
    b, slack = mesh.since, _slack(mesh)
    at = _inside(known, mesh.boundaries[0], mesh.duration, slack)
    apart = np.abs(at[:, None] - b)
    new = at[apart.min(axis=1, initial=np.inf) > slack]
    if not new.size:
        return mesh
    reach = SNAPPED * np.minimum(mesh.lengths[:-1], mesh.lengths[1:])
    inner = np.abs(new[:, None] - b[1:-1]).min(axis=0) > reach
    inner |= apart[:, 1:-1].min(axis=0) <= slack  # those at other instants stay
    since = np.sort(np.concatenate([b[:1], b[1:-1][inner], new, b[-1:]]))
    return mesh.cut(since)


def boundaries_at(mesh: Mesh, known: tuple[Instant, ...]) -> NDInt:
    """Return the inner boundaries of the mesh at instants, those of which it has."""
    slack = _slack(mesh)
    at = _inside(known, mesh.boundaries[0], mesh.duration, slack)
    apart = np.abs(at[:, None] - mesh.since)
    return apart.argmin(axis=1)[apart.min(axis=1, initial=np.inf) <= slack]


def find_boundaries(mesh: Mesh, times: Array) -> NDInt:
    """Return the boundaries (k,) of elements at times (k,). Raises ValueError if there is none."""
    b, slack = mesh.boundaries, 2 * _slack(mesh)
    k = np.clip(np.searchsorted(b, times - slack), 0, b.size - 1)
    off = np.abs(b[k] - times) > slack
    if off.any():
        raise ValueError(
            "expected a mesh whose elements end where the path passes an event, found none that "
            f"ends at t = {times[np.argmax(off)]:.6g}; put a boundary there"
        )
    return k


def sides(mesh: Mesh, known: tuple[Instant, ...]) -> tuple[Array, Array]:
    """Return the first and the last time on each element's own side of the instants, both (N,)."""
    b, slack = mesh.boundaries, _slack(mesh)
    before, after = np.array(known).T
    k = np.minimum(np.searchsorted(after, b - slack), after.size - 1)
    at = (before[k] <= b + slack) & (after[k] >= b - slack)
    low = np.where(at, np.maximum(after[k], b), b)[:-1]
    high = np.where(at, np.minimum(before[k], b), b)[1:]
    return low, high


def _inside(known: tuple[Instant, ...], start: float, duration: float, slack: float) -> Array:
    """Return the times of the instants since the start, (K,), but for those at either end."""
    since = np.array([after for _, after in known]) - start
    return since[(since > slack) & (since < duration - slack)]


def _slack(mesh: Mesh) -> float:
    """Return how far apart round-off may put two times of the same boundary."""
    return 4 * EPS * max(abs(mesh.boundaries[0]), abs(mesh.boundaries[-1]), mesh.duration)


def split(path: Path, times: Sequence[float]) -> tuple[Path, ...]:
    """Return the parts of a path between events at times (k,), k + 1. Raises as that does."""
    mesh = path.mesh
    inner = find_boundaries(mesh, np.array(times))
    found = []
    for a, b in pairwise([0, *inner.tolist(), mesh.elements]):
        start, end = mesh.singular_ends
        part = with_singular_ends(mesh.part(a, b), (start * (a == 0), end * (b == mesh.elements)))
        nodes = slice(mesh.offsets[a], mesh.offsets[b] + 1)
        rates = None if path.velocities is None else path.velocities[:, nodes]
        found.append(Path(part, path.values[:, nodes], rates))
    return tuple(found)
