"""Which members of a grid hang together: a map may have several sheets, or run over a fold.

The momenta at both ends, and the coordinates that are free there, say which path a member has. From
neighbour to neighbour they change as they do around; where they change far more, or the index
changes, the members do not hang together.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np

from actionopt.tools.types import Array, NDInt

# A change that is more, in units of those between the two neighbours on either side, is a break.
# Ad hoc: beside a fold, where paths differ by the square root of the distance, it is 2.7.
BREAK = 4.0
# The same, where actions change as their slopes tell, or inside what hangs together otherwise. Ad
# hoc: of two sheets whose actions cross within a step the momenta alone tell. Measured on 724 rows
# of one sheet and 5,502 of two: 14 are parted, 55 with `BREAK`, and all leaps are told.
TORN = 8.0
TEARS = 16  # that are followed in one map; ad hoc
# Changes smaller than this part of the range over the grid tell nothing, nor does a range so small
# beside a quantity's own size; ad hoc, above their error.
SMALLEST_CHANGE = 1e-6
CELL_OFFSETS = (-2, -1, 1, 2)


def sheets(solved: NDInt, index: NDInt | None, told: Array, leaps: Sequence[Array] = ()) -> NDInt:
    """Return which sheet each member is on: labels in the shape of the grid, equal on one sheet.

    Parameters
    ----------
    solved : array of bool
        Others have the label -1.
    index : array of int or None
        Morse indices, -1 where there is none.
    told : (..., k) array
        k numbers of each member that say which path it has.
    leaps : sequence of arrays, optional
        Along each axis, what the function of this name returns.

    Returns
    -------
    array of int
        From 0, in the order of the members.
    """
    known = told[solved]
    if not len(known):
        return np.full(solved.shape, -1)
    usual = np.median(np.abs(known), axis=0)
    usual = np.where(usual > 0, usual, np.max(np.abs(known), axis=0))
    # Towards a pole, as at a conjugate point, numbers grow without bound; these do not.
    bounded = told / np.where(usual > 0, np.abs(told) + usual, 1.0)
    spread = np.ptp(bounded[solved], axis=0)
    units = np.where(spread > SMALLEST_CHANGE, spread, np.inf)  # they are of order one
    told = np.where(solved[..., None], bounded, np.nan)
    numbers = np.arange(solved.size).reshape(solved.shape)
    pairs, tears, torn = [], [], []
    for axis in range(solved.ndim):
        first, second = _halves(numbers, axis)
        here, there = _halves(solved, axis)
        joined = here & there
        if index is not None:
            a, b = _halves(index, axis)
            joined = joined & ((a == b) | (a < 0) | (b < 0))
        a, b = _halves(told, axis)
        changes = np.max(np.abs(b - a) / units, axis=-1, initial=0.0)
        times, most = _times(changes, axis), BREAK
        if leaps:
            times = np.where(leaps[axis] > 1, np.inf, times)
            most = np.where(leaps[axis] <= 1, TORN, BREAK)
        wide, joined = joined & (times > TORN), joined & ~(times > most)
        for found, at in ((pairs, joined), (tears, wide)):
            found.append(np.stack([first[at], second[at]]))
        torn.append(changes[wide])
    labels = _connected_components(solved.size, np.hstack(pairs))
    if tears:
        order = np.argsort(-np.hstack(torn), kind="stable")
        _part(labels, np.hstack(pairs), np.hstack(tears)[:, order])
    labels[~solved.ravel()] = -1
    _, names = np.unique(labels[labels >= 0], return_inverse=True)
    labels[labels >= 0] = names
    return labels.reshape(solved.shape)


def leaps(action: Array, slopes: Array, values: Array, axis: int) -> Array:
    """Return how far actions change along an axis of these `values`, in parts of what may be.

    Beyond one there is a leap; NaN where nothing tells. `slopes` are its derivatives by them.
    Between two members the action changes by the integral of the slope, which lies between the
    slopes of both. Where the slope has an extreme between them it may lie beside, by about as much
    as the slope changes in the steps around.
    """
    S, p = (np.moveaxis(x, axis, -1) for x in (action, slopes))
    h = np.diff(values)
    turn = np.abs(np.diff(p))
    around = _around(turn)
    beside = np.fmax(np.sqrt(around[1] * around[2]), _trend(around)) / 2
    known = S[np.isfinite(S)]
    size, spread = (np.abs(known).max(), np.ptp(known)) if known.size else (0.0, 0.0)
    rounded = SMALLEST_CHANGE * max(spread, SMALLEST_CHANGE * size)
    allowed = np.abs(h) * (turn / 2 + beside) + rounded  # NaN: few members tell nothing
    off = np.abs(np.diff(S) - h * (p[..., 1:] + p[..., :-1]) / 2)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.moveaxis(off / allowed, -1, axis)


def _halves(values: Array, axis: int) -> tuple[Array, Array]:
    """Return the values on either side of every step along an axis."""
    count = values.shape[axis]
    return values.take(range(count - 1), axis), values.take(range(1, count), axis)


def _times(changes: Array, axis: int) -> Array:
    """Return how many times as large as those around changes along an axis are.

    The median of those around, as far as they are known; zero where there are fewer than two.
    At the edge of what is known, where changes may grow from one to the next, they may go on so.
    """
    rows = np.moveaxis(changes, axis, -1)
    around = _around(rows)
    trend = _trend(around)
    around.sort(axis=0)  # NaN comes last
    known = np.isfinite(around).sum(axis=0)
    middle = np.maximum(known - 1, 0) // 2, np.minimum(known // 2, len(CELL_OFFSETS) - 1)
    low, high = (np.take_along_axis(around, i[None], 0)[0] for i in middle)
    with np.errstate(invalid="ignore", divide="ignore"):
        found = rows / np.fmax((low + high) / 2, trend)
        found = np.where((known >= 2) & (rows > SMALLEST_CHANGE), found, 0.0)
    return np.moveaxis(found, -1, axis)


def _around(rows: Array) -> Array:
    """Return the changes (4, ...) at `CELL_OFFSETS` along the last axis; NaN beyond the ends."""
    count = rows.shape[-1]
    around = np.full((len(CELL_OFFSETS), *rows.shape), np.nan)
    for k, step in enumerate(CELL_OFFSETS):
        here = slice(max(-step, 0), count - max(step, 0))
        there = slice(max(step, 0), count - max(-step, 0))
        around[k][..., here] = rows[..., there]
    return around


def _trend(around: Array) -> Array:
    """Return the change expected beside an edge of what is known, (...); NaN elsewhere.

    Where no change is known on one side, it is that of the other side, grown as it grows there.
    """
    found = []
    for before, after, beyond in (around[[1, 2, 3]], around[[2, 1, 0]]):
        with np.errstate(invalid="ignore", divide="ignore"):
            grown = after * np.clip(after / beyond, 1.0, BREAK)
        found.append(np.where(np.isnan(before), grown, np.nan))
    return np.fmax(*found)


def _connected_components(count: int, pairs: NDInt) -> NDInt:
    """Return the least member of each one's connected component, (count,), for edges (2, K)."""
    least = np.arange(count)
    while True:
        ends = least[pairs]
        low = ends.min(axis=0)
        if (ends == low).all():
            return least
        for end in ends:
            np.minimum.at(least, end, low)
        while (least[least] != least).any():
            least = least[least]


def _part(labels: NDInt, pairs: NDInt, tears: NDInt) -> None:
    """Give the two sides of each tear labels of their own, in place.

    Parameters
    ----------
    labels : (count,) array of int
    pairs : (2, K) array of int
        Members that hang together.
    tears : (2, T) array of int
        Members that do not, the largest change first.
    """
    near: list[list[int]] = []
    for _ in range(TEARS):
        tears = tears[:, labels[tears[0]] == labels[tears[1]]]
        if not tears.size:
            return
        if not near:
            near = [[] for _ in labels]
            for i, j in pairs.T.tolist():
                near[i].append(j)
                near[j].append(i)
        one, other = tears[:, 0].tolist()
        own, new = int(labels[one]), int(labels.max()) + 1
        way, done = deque([(one, own), (other, new)]), {one, other}
        while way:  # from both sides at once
            i, side = way.popleft()
            beyond = [j for j in near[i] if j not in done and labels[j] == own]
            labels[i] = side
            done.update(beyond)
            way.extend((j, side) for j in beyond)
