"""Whether some motion from the start comes to the end, in one or two coordinates.

The place where a motion ends depends continuously on its initial velocity. The ends of motions of
one coordinate, from the fastest one way to the fastest the other way, are a curve; those of two
coordinates are a surface over the plane of velocities. If the end event can be reached, then on a
fine enough net of velocities it lies on the image of an edge or of a triangle, or near that of a
node, from which Newton's method leads to it. A motion that runs away sooner ends nowhere. A net
that is too coarse tells nothing, as beside a motion into a centre, nor do motions that step over
narrow forces: these gain or lose energy there, which is checked. A gap that motions from afar miss
is wide for those that begin beside it: both events are to be out of the other's reach.
"""

from __future__ import annotations

import numpy as np

from actionopt.analysis.quadratic.shooting import aim, energies, integrate, speeds
from actionopt.mechanics.question.problem import Problem
from actionopt.tools.types import Array, NDInt
from actionopt.tools.watch import Watch

# Ad hoc.
# The net: directions round the plane, speeds up to the fastest that `shooting.velocities` takes,
# in its even and in its geometric part, and beyond. Measured on 2,500 random questions of which a
# motion is known: none is ruled out, but 6 of 180 whose motion leads through a hole in a wall that
# is as narrow as between two directions.
DIRECTIONS, NET_SPEEDS, NET_FASTEST, NET_BEYOND = 24, 12, 2.5, (2.0, 4.0, 8.0)
NET_STEPS = 150  # of a motion; those that do not end in as many are lost
LOST_FAR = 1e3  # sizes from the end where a lost motion does not come back
LOST_NEAR = 3.0  # sizes from the end where it may have been about to come there
MOST_LOST = 1 / 16  # of the motions
AIMED = 3  # motions that are aimed at the end
ENERGY_KEPT = 1e-2  # of what it is made of


def is_out_of_reach(problem: Problem, watch: Watch | None) -> bool:
    """Return whether it is plain that no motion from the start comes to the end at its time.

    Both events give all coordinates, and there is nothing else that the path must obey.
    """
    return all(_is_unreached(problem, watch, back=back) for back in (False, True))


def _is_unreached(problem: Problem, watch: Watch | None, *, back: bool) -> bool:
    """Return whether no motion is seen that leads to the end, or `back` to the start in time."""
    events = (problem.end, problem.start) if back else (problem.start, problem.end)
    start, end = (np.array(e.q, dtype=float)[:, None] for e in events)
    n, unit, t0 = len(start), problem.lengths[:, None], float(events[0].t)
    look = watch and (lambda _: watch.check())  # it is no search that has a price
    try:
        v, simplices = _net(problem, end - start)
    except np.linalg.LinAlgError:  # a singular mass matrix sets nothing in motion
        return False
    count = v.shape[1]
    track: list[tuple[Array, Array, Array]] = []
    q0 = np.repeat(start, count, axis=1)
    given = np.full(count, t0), q0[:, None], v[:, None]
    span = np.full(count, -problem.duration if back else problem.duration)
    q, w = (
        x[:, 0] for x in integrate(problem, given, span, steps=NET_STEPS, track=track, watch=look)
    )
    ended = np.isfinite(q).all(axis=0)
    lost, at = ~ended, np.where(ended, q, track[-1][1])
    with np.errstate(all="ignore"):
        miss = (at - end) / unit
        far = np.linalg.norm(miss, axis=0)
        if (far[lost] < LOST_NEAR).any():  # beside what falls into a centre motions come anywhere
            return False
        if n == 1:  # on a line, what runs away passes by nothing
            lost &= ~(far > LOST_FAR)
        if lost.sum() > MOST_LOST * count or not _keeps_energy(problem, (q0, v), (q, w)):
            return False
        miss[:, lost], far[lost] = np.nan, np.inf
        if _covers(miss[:, simplices]).any():
            return False
        unsure = _bends(miss) > far
    least, most = np.full(count, np.inf), np.zeros(count)  # beside
    for i, j in np.argwhere(~np.eye(n + 1, dtype=bool)):
        np.minimum.at(least, simplices[:, i], far[simplices[:, j]])
        np.maximum.at(most, simplices[:, i], far[simplices[:, j]])
    low = np.flatnonzero((far <= least) & ended)
    fastest = np.bincount(simplices.ravel()) <= n * (n + 1) / 2  # what is beside them is slower
    if unsure.sum() > AIMED or fastest[np.argmin(far)]:
        return False
    unsure |= fastest & (far <= least)
    low = low[most[low] > 2 * far[low]]  # else the end is not between it and those beside
    aimed = np.union1d(low[np.argsort(far[low])][:AIMED], np.flatnonzero(unsure & ended))
    if not aimed.size:
        return True
    return not aim(problem, v[:, aimed], np.repeat(end, aimed.size, axis=1), back=back)[1].size


def _net(problem: Problem, far: Array) -> tuple[Array, NDInt]:
    """Return initial velocities (n, K), and which of them are neighbours (S, n + 1)."""
    scales, units = speeds(problem, far[:, 0])
    fastest = NET_FASTEST * np.max(scales)
    even, beyond = np.linspace(0, fastest, NET_SPEEDS + 1)[1:], fastest * np.array(NET_BEYOND)
    if len(far) == 1:
        slow = np.geomspace(np.min(scales) / 4, fastest, NET_SPEEDS)
        speed = np.unique(np.concatenate([slow, even, beyond]))
        each = np.arange(2 * speed.size)
        line = np.concatenate([-speed[::-1], [0.0], speed])[None]
        return line * units, np.stack([each, each + 1], axis=1)
    turns = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    speed = np.concatenate([even, beyond[:-1]])
    v = speed[:, None] * np.stack([np.cos(turns), np.sin(turns)])[:, None]
    inner = 1 + np.arange((speed.size - 1) * DIRECTIONS)
    first, turned = np.zeros(DIRECTIONS, int), inner + 1 - DIRECTIONS * (inner % DIRECTIONS == 0)
    triangles = (
        (first, inner[:DIRECTIONS], turned[:DIRECTIONS]),
        (inner, inner + DIRECTIONS, turned + DIRECTIONS),
        (inner, turned, turned + DIRECTIONS),
    )
    v = np.concatenate([np.zeros((2, 1)), v.reshape(2, -1)], axis=1)
    return v * units[:, None], np.concatenate([np.stack(nodes, axis=1) for nodes in triangles])


def _covers(miss: Array) -> Array:
    """Return which images of edges or triangles, (n, S, n + 1), contain zero, (S,)."""
    if len(miss) == 1:
        return miss[0, :, 0] * miss[0, :, 1] <= 0
    after = np.roll(miss, -1, axis=2)
    turns = miss[0] * after[1] - miss[1] * after[0]
    return (turns >= 0).all(axis=1) | (turns <= 0).all(axis=1)


def _bends(miss: Array) -> Array:
    """Return how far the ends of motions are from the middle of their neighbours', (K,)."""
    bend = np.zeros(miss.shape[1])
    if len(miss) == 1:  # there is no way round a point of a line
        return bend
    even = miss[:, 1:].reshape(2, -1, DIRECTIONS)
    round_it = (np.roll(even, 1, axis=2) + np.roll(even, -1, axis=2)) / 2 - even
    found = np.linalg.norm(round_it, axis=0)
    along = (even[:, 2:NET_SPEEDS] + even[:, : NET_SPEEDS - 2]) / 2 - even[:, 1 : NET_SPEEDS - 1]
    found[1 : NET_SPEEDS - 1] = np.fmax(found[1 : NET_SPEEDS - 1], np.linalg.norm(along, axis=0))
    bend[1:] = found.ravel()
    return np.where(np.isfinite(bend), bend, 0.0)


def _keeps_energy(
    problem: Problem, before: tuple[Array, Array], after: tuple[Array, Array]
) -> bool:
    """Return whether motions that come to their end keep their energy, where it is kept."""
    structure = problem.system.structure
    if structure.forced or structure.depends_on_time:
        return True
    there = np.isfinite(after[0]).all(axis=0)
    (first, large), (last, larger) = (
        energies(problem, q[:, there], v[:, there]) for q, v in (before, after)
    )
    return bool((np.abs(last - first) <= ENERGY_KEPT * np.maximum(large, larger)).all())
