"""Guesses for a path: motions that hit the end, or set out from both events and nearly meet.

The end of a motion over a long time depends steeply on the start, and hardly any of many arrives
near an event. Over half the time the dependence is the square root of that, and N motions from the
start with N from the end, backwards in time, make N^2 pairs. Pairs are chosen by the distance of
their states (q, v) where they should meet: two motions with the same state there are one motion.
What is left of the gap is spread over both, and the curve is a path but for a small force; it has
the oscillations that a path has, which no straight or curved line does.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np

from actionopt.analysis.quadratic.shooting import (
    AIMS,
    GUESS_DEGREE,
    about,
    aim,
    hermite,
    integrate,
    motions,
    speeds,
    velocities,
)
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.meshes.path import Path
from actionopt.mechanics.question.problem import Problem
from actionopt.tools.types import Array, NDInt
from actionopt.tools.watch import Watch

# Ad hoc. Errors of one step, and most steps, to choose pairs by and to draw them.
CHOOSING, DRAWING = (1e-3, 300), (1e-4, 400)
STEPS_PER_ELEMENT = 3  # as in `shooting.motions`
MOST_PAIRS = 2  # in which one motion may take part: its likes in a third fail alike
CANDIDATES = 20_000  # nearest pairs among which to choose
HITS, MOTION = 36, 4  # motions that are aimed; elements in whose time one is integrated, measured


def curves(
    problem: Problem, counts: Sequence[int], most: int, watch: Watch | None
) -> Iterator[Iterator[Path]]:
    """Yield groups of curves between the events: `meetings` of few motions, `hits`, and of more.

    Each of at most `most` meetings; to a `watch` each motion counts as `MOTION` elements.
    """
    look = watch and watch.look
    groups: list[tuple[int, Callable[[], Iterator[Path]]]] = [
        (count, partial(meetings, problem, count, most, seed, look))
        for seed, count in enumerate(counts)
    ]
    aims = HITS * (problem.system.n + 1) * AIMS // 2  # most have hit half way, or are lost
    groups.insert(1, (aims, partial(hits, problem)))
    for count, group in groups:
        if watch is not None:
            watch.evaluated += MOTION * count
        yield group()


def hits(problem: Problem) -> Iterator[Path]:
    """Yield motions from the start that arrive at the end, slow ones first.

    The velocity of each is changed by Newton's method. That finds paths that `meetings` do not, as
    where all motions that meet half way pass a pole of the potential on one side.
    """
    end = np.array(problem.end.q, dtype=float)
    far = end - np.array(problem.start.q, dtype=float)
    try:
        v0 = velocities(problem, far, HITS, np.random.default_rng(0))
    except np.linalg.LinAlgError:  # a singular mass matrix sets nothing in motion
        return
    v0, _ = aim(problem, v0, np.repeat(end[:, None], v0.shape[1], axis=1))
    slow = np.argsort(np.linalg.norm(v0 / problem.lengths[:, None], axis=0), kind="stable")
    yield from (path for path in motions(problem, v0[:, slow]) if path is not None)


def meetings(
    problem: Problem,
    count: int,
    most: int,
    seed: int = 0,
    watch: Callable[[int], None] | None = None,
) -> Iterator[Path]:
    """Yield up to `most` curves between the events of `problem`, the best first.

    `count` motions set out from each event; `watch` is called at each of their steps, with the
    elements of a curve of so many. Both events must give all the coordinates; there must be no
    constraints, whose velocities would have to be drawn from the tangent space.
    """
    rng = np.random.default_rng(seed)
    start, end = (np.array(e.q, dtype=float) for e in (problem.start, problem.end))
    try:
        v0 = np.concatenate([_velocities(problem, count, rng) for _ in range(2)], axis=1)
        scale = np.max(speeds(problem, end - start)[0])
    except np.linalg.LinAlgError:  # a singular mass matrix sets nothing in motion
        return
    first = np.repeat([True, False], count)
    q, v = _halves(problem, v0, first, CHOOSING, watch=watch)
    units = np.maximum(problem.lengths, np.abs(end - start))[:, None]
    # A velocity moves the path by as much in the time in which the forces turn it.
    turning = min(problem.duration / 4, 1 / scale)
    states = np.concatenate([q / units, v * turning / units])
    a, b = nearest(states[:, :count], states[:, count:], most)
    if not a.size:
        return
    chosen, first = np.concatenate([a, count + b]), np.repeat([True, False], a.size)
    track: list[tuple[Array, Array, Array]] = []
    _halves(problem, v0[:, chosen], first, DRAWING, track, watch)
    middle = problem.start.t + problem.duration / 2
    for k in range(a.size):
        forth, back = _leg(track, k), _leg(track, a.size + k)
        if forth[0][-1] > back[0][-1] or not np.isfinite(forth[1][:, -1] - back[1][:, -1]).all():
            continue
        yield join_motions(forth, back, middle)


def _velocities(problem: Problem, count: int, rng: np.random.Generator) -> Array:
    """Return velocities (n, count) in all directions, and about that of the straight line."""
    start, end = (np.array(e.q, dtype=float) for e in (problem.start, problem.end))
    half = count // 2
    return np.concatenate(
        [velocities(problem, end - start, count - half, rng), about(problem, half, rng)], axis=1
    )


def _halves(
    problem: Problem,
    v0: Array,
    first: Array,
    steps: tuple[float, int],
    track: list | None = None,
    watch: Callable[[int], None] | None = None,
) -> tuple[Array, Array]:
    """Return (q, v), (n, K) each, half the time after the start or before the end."""
    ends = [np.array(e.q, dtype=float)[:, None] for e in (problem.start, problem.end)]
    times = np.where(first, problem.start.t, problem.end.t)
    q0 = np.where(first, *ends)
    half = problem.duration / 2 * np.where(first, 1.0, -1.0)
    if track is not None:
        track.append((times, q0, v0))
    accuracy, most = steps
    start = times, q0[:, None], v0[:, None]
    told = watch and (lambda steps: watch(2 * -(-steps // STEPS_PER_ELEMENT)))
    q, v = integrate(problem, start, half, accuracy=accuracy, steps=most, track=track, watch=told)
    return q[:, 0], v[:, 0]


def nearest(a: Array, b: Array, most: int) -> tuple[NDInt, NDInt]:
    """Return which columns of a (k, A) and b (k, B) make the nearest pairs, nearest first.

    Columns that are not finite pair with none, others with `MOST_PAIRS` at most.
    """
    with np.errstate(all="ignore"):
        distance = (a * a).sum(axis=0)[:, None] + (b * b).sum(axis=0) - 2 * (a.T @ b)
    flat = np.where(np.isfinite(distance), distance, np.inf).ravel()
    few = min(CANDIDATES, flat.size) - 1
    order = np.argpartition(flat, few)[: few + 1] if flat.size else np.zeros(0, int)
    order = order[np.argsort(flat[order], kind="stable")]
    used, pairs = (np.zeros(a.shape[1], int), np.zeros(b.shape[1], int)), []
    for i, j in zip(*np.divmod(order, b.shape[1]), strict=True):
        if len(pairs) == most or not np.isfinite(distance[i, j]):
            break
        if used[0][i] < MOST_PAIRS and used[1][j] < MOST_PAIRS:
            used[0][i] += 1
            used[1][j] += 1
            pairs.append((i, j))
    i, j = np.array(pairs, dtype=int).reshape(-1, 2).T
    return i, j


def _leg(track: list[tuple[Array, Array, Array]], k: int) -> tuple[Array, Array, Array]:
    """Return the times (K,) and q, v (n, K) of motion k, step by step."""
    times = np.array([row[0][k] for row in track])
    kept = np.concatenate([[True], np.diff(times) != 0])
    q, v = (np.array([row[i][:, k] for row in track])[kept].T for i in (1, 2))
    return times[kept], q, v


def join_motions(
    forth: tuple[Array, Array, Array], back: tuple[Array, Array, Array], middle: float
) -> Path:
    """Return the curve through two motions, times (K,) and q, v (n, K), that end at `middle`.

    One comes from the start, the other, backwards, from the end. Each is moved by half the gap
    between them where they meet, in proportion to the time; so the ends stay.
    """
    gap = (back[1][:, -1:] - forth[1][:, -1:]) / 2
    times = [np.append(leg[0][:-1], middle) for leg in (forth, back)]  # without their round-off
    before = hermite(times[0], *forth[1:])
    after = hermite(times[1][::-1], back[1][:, ::-1], back[2][:, ::-1])
    t0, t1 = times[0][0], times[1][0]

    def curve(t: Array) -> Array:
        left = before(np.minimum(t, middle)) + gap * ((t - t0) / (middle - t0))
        right = after(np.maximum(t, middle)) - gap * ((t1 - t) / (t1 - middle))
        return np.where(t <= middle, left, right)

    corners = np.unique(np.concatenate([*(t[:-1:STEPS_PER_ELEMENT] for t in times), [middle]]))
    return Path.interpolate(curve, Mesh(corners, GUESS_DEGREE))
