"""All the motions of one degree of freedom that join two events, by their initial velocities.

Where a motion ends is a function of one number. It is sampled until the samples resolve it; then
each change of sign of the miss is a path, and so are both sides of a maximum that just reaches the
end.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from actionopt.analysis.quadratic.shooting import (
    ARRIVAL_TOL,
    directions,
    on_constraints,
    shoot,
    velocities,
)
from actionopt.mechanics.question.problem import Problem
from actionopt.tools.types import Array, NDInt

# Ad hoc. Motions some octaves faster than forces between the events suggest: beyond, these may be
# stronger, and there may be faster ones without end.
FASTER_OCTAVES = 5
# Samples resolve a curve where second differences are a part of its range over some of them, as of
# an oscillation with nine a period; else there are more between, a few rounds long.
RESOLVED, SAMPLES_BESIDE, SCAN_ROUNDS = 0.25, 8, 4
EXTREMUM_PARTS, EXTREMUM_ROUNDS = 16, 2  # of the samples beside an extremum near an end
VELOCITY_DIVISIONS, VELOCITY_PARTS = 5, 32  # most, 2^25: as good as single precision
FAR_SIDE = 0.1  # of the sizes, by which ends of motions that were bisected miss where none arrives


def scan(problem: Problem, far: Array, goals: Array, count: int) -> tuple[Array, NDInt, int, bool]:
    """Return the velocities (n, K) at which motions arrive at goals (n, G), and at which of them.

    And how many velocities were sampled, and whether the motions with those of them could be
    followed and told apart, `count` at least, that are as fast as `far` (n,) and the forces
    between the events tell.
    """
    v = _grid(problem, far, count)
    faster = (v.shape[1] - count) // 2
    slow = v[:, [faster, -faster - 1]]
    size = np.maximum(problem.lengths, far)[:, None]
    along = np.stack([directions(problem, goal, problem.end.t)[:, 0] for goal in goals.T], axis=1)
    ends = _ends(problem, v)
    for _ in range(SCAN_ROUNDS):
        v, ends, more = _insert(problem, v, ends, _where_coarse(ends), 2)
        if not more:
            break
    for _ in range(EXTREMUM_ROUNDS):
        near = np.zeros(v.shape[1] - 1, dtype=bool)
        for goal, direction in zip(goals.T, along.T, strict=True):
            near |= _turns_near(direction @ (ends - goal[:, None]))
        v, ends, more = _insert(problem, v, ends, near, EXTREMUM_PARTS)
        if not more:
            break
    found, which, sharp = _roots(problem, v, ends, goals, along, size)
    since, until = np.linalg.norm(slow - v[:, :1], axis=0)
    way, there = (np.linalg.norm(a - v[:, :1], axis=0) for a in (v, found))
    known = np.isfinite(ends[:, (since <= way) & (way <= until)]).all()
    unsure = sharp & (since <= there) & (there <= until)
    return found, which, v.shape[1], bool(known and not unsure.any())


def _grid(problem: Problem, far: Array, count: int) -> Array:
    """Return velocities (n, N) in order, from the fastest one way to the fastest the other."""
    slow = velocities(problem, far, count, np.random.default_rng(0))
    octave = np.linspace(1.0, 2.0, count // 4 + 1)[1:]
    faster = np.concatenate([2.0**k * octave for k in range(FASTER_OCTAVES)])
    first, last = (on_constraints(problem, slow[:, [k]] * faster) for k in (0, -1))
    return np.concatenate([first[:, ::-1], slow, last], axis=1)


def _ends(problem: Problem, v: Array) -> Array:
    """Return where motions with velocities v (n, K) end, (n, K), however slowly they get there."""
    return shoot(problem, v[:, None], patient=True)[:, 0]


def _insert(
    problem: Problem, v: Array, ends: Array, where: Array, parts: int
) -> tuple[Array, Array, bool]:
    """Return velocities and ends with others between those of the intervals `where` (K - 1,)."""
    at = np.flatnonzero(where)
    if not at.size:
        return v, ends, False
    inner = np.arange(1, parts) / parts
    new = v[:, at, None] + (v[:, at + 1] - v[:, at])[:, :, None] * inner
    new = new.reshape(len(v), -1)
    places = np.repeat(at + 1, parts - 1)
    v, ends = (np.insert(a, places, b, axis=1) for a, b in ((v, new), (ends, _ends(problem, new))))
    return v, ends, True


def _where_coarse(ends: Array) -> Array:
    """Return in which intervals (K - 1,) of the ends (n, K) there may be more than samples tell."""
    windows = np.lib.stride_tricks.sliding_window_view(
        np.pad(ends, ((0, 0), (SAMPLES_BESIDE, SAMPLES_BESIDE)), mode="edge"),
        2 * SAMPLES_BESIDE + 1,
        axis=1,
    )
    size = np.fmax.reduce(windows, axis=2) - np.fmin.reduce(windows, axis=2)
    with np.errstate(invalid="ignore"):
        bent = np.abs(np.diff(ends, 2, axis=1)) > RESOLVED * size[:, 1:-1]
    bent = np.pad(bent.any(axis=0), 1)
    return bent[:-1] | bent[1:]


def _turns_near(miss: Array) -> Array:
    """Return the intervals (K - 1,) beside which a miss (K,) may turn beyond zero."""
    a, b, c = np.abs([miss[:-2], miss[1:-1], miss[2:]])
    with np.errstate(invalid="ignore"):
        one = (miss[:-2] * miss[1:-1] > 0) & (miss[1:-1] * miss[2:] > 0)
        # A parabola goes on beyond the least of three by an eighth of what the others differ.
        turns = one & (b <= a) & (b <= c) & (b <= np.maximum(a, c) - b)
    turns = np.pad(turns, 1)
    return turns[:-1] | turns[1:]


def _roots(
    problem: Problem, v0: Array, ends: Array, goals: Array, along: Array, size: Array
) -> tuple[Array, NDInt, NDArray[np.bool_]]:
    """Return velocities (n, K) at the changes of sign of the miss, that along the tangent.

    And of which goals, and where it changes at once, so that no motion arrives.
    """
    which, rows = [], []
    for k, (goal, direction) in enumerate(zip(goals.T, along.T, strict=True)):
        miss = direction @ (ends - goal[:, None])
        with np.errstate(invalid="ignore"):
            at = np.flatnonzero(miss[:-1] * miss[1:] <= 0)
        which += [k] * at.size
        rows += [(v0[:, i], v0[:, i + 1], ends[:, i], ends[:, i + 1], goal, direction * miss[i])
                 for i in at]  # fmt: skip
    if not rows:
        return np.empty((len(v0), 0)), np.empty(0, dtype=int), np.empty(0, dtype=bool)
    low, high, *sides_ends, goals, sides = np.array(rows).transpose(1, 2, 0)
    miss = np.stack([np.sum(sides * (q - goals), axis=0) for q in sides_ends])
    linear = ARRIVAL_TOL * np.linalg.norm(sides * size, axis=0)
    inner = np.arange(1, VELOCITY_PARTS) / VELOCITY_PARTS
    for _ in range(VELOCITY_DIVISIONS):  # a hundred motions take hardly longer than one
        wide = np.flatnonzero(~(miss[0] - miss[1] < linear))
        if not wide.size:
            break
        step = (high - low)[:, wide] / VELOCITY_PARTS
        v = low[:, None, wide] + (high - low)[:, None, wide] * inner[:, None]
        q = _ends(problem, v.reshape(len(v), -1)).reshape(v.shape)
        between = np.sum(sides[:, None, wide] * (q - goals[:, None, wide]), axis=0)
        known = np.vstack([miss[0, wide], between, miss[1, wide]])
        part = np.argmin(known[1:] > 0, axis=0)
        miss[:, wide] = known[[part, part + 1], np.arange(wide.size)]
        low[:, wide] += part * step
        high[:, wide] = low[:, wide] + step
    part = miss[0] / np.where(miss[0] > miss[1], miss[0] - miss[1], 1.0)
    v, which = low + (high - low) * np.where(np.isfinite(part), part, 0.5), np.array(which)
    sharp = ~(miss[0] - miss[1] < linear)  # a change of sign that no float resolves
    if problem.system.m:  # the far side of a closed curve changes the sign as well
        near = np.all(np.abs(_ends(problem, v) - goals) < FAR_SIDE * size, axis=0)
        v, which, sharp = v[:, near], which[near], sharp[near]
    return v, which, sharp
