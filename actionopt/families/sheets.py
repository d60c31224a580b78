"""Which members of a grid hang together: a map may have several sheets, or run over a fold.

The momenta at both ends, and the coordinates that are free there, say which path a member has. From
neighbour to neighbour they change as they do around; where they change far more, or the index
changes, the members do not hang together.
"""

from __future__ import annotations

import numpy as np

from actionopt.tools.types import Array, NDInt

# Of a change, in units of the changes between the two neighbours on either side: more is a break.
# Ad hoc: beside a fold, where paths differ by the square root of the distance, it is 2.7.
BREAK = 4.0
UNSEEN = 1e-6  # of the range over the grid: smaller changes tell nothing; ad hoc, above their error
AROUND = (-2, -1, 1, 2)


def sheets(solved: NDInt, index: NDInt | None, told: Array) -> NDInt:
    """Return a label for every member, in the grid's shape: equal ones hang together.

    Parameters
    ----------
    solved : array of bool
        Others have the label -1.
    index : array of int or None
        Morse indices, -1 where there is none.
    told : (..., k) array
        k numbers of each member that say which path it has.

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
    units = np.where(spread > 0, spread, np.inf)
    told = np.where(solved[..., None], bounded, np.nan)
    numbers = np.arange(solved.size).reshape(solved.shape)
    pairs = []
    for axis in range(solved.ndim):
        first, second = _halves(numbers, axis)
        here, there = _halves(solved, axis)
        joined = here & there
        if index is not None:
            a, b = _halves(index, axis)
            joined = joined & ((a == b) | (a < 0) | (b < 0))
        a, b = _halves(told, axis)
        joined = joined & ~_breaks(np.max(np.abs(b - a) / units, axis=-1, initial=0.0), axis)
        pairs.append(np.stack([first[joined], second[joined]]))
    labels = _components(solved.size, np.hstack(pairs))
    labels[~solved.ravel()] = -1
    _, names = np.unique(labels[labels >= 0], return_inverse=True)
    labels[labels >= 0] = names
    return labels.reshape(solved.shape)


def _halves(values: Array, axis: int) -> tuple[Array, Array]:
    """Return the values on either side of every step along an axis."""
    count = values.shape[axis]
    return values.take(range(count - 1), axis), values.take(range(1, count), axis)


def _breaks(changes: Array, axis: int) -> NDInt:
    """Return which changes along an axis are far larger than those around, as far as known."""
    rows = np.moveaxis(changes, axis, -1)
    count = rows.shape[-1]
    around = np.full((len(AROUND), *rows.shape), np.nan)
    for k, step in enumerate(AROUND):
        here = slice(max(-step, 0), count - max(step, 0))
        there = slice(max(step, 0), count - max(-step, 0))
        around[k][..., here] = rows[..., there]
    around.sort(axis=0)  # NaN comes last
    known = np.isfinite(around).sum(axis=0)
    middle = np.maximum(known - 1, 0) // 2, np.minimum(known // 2, len(AROUND) - 1)
    low, high = (np.take_along_axis(around, i[None], 0)[0] for i in middle)
    with np.errstate(invalid="ignore"):
        found = (known >= 2) & (rows > UNSEEN) & (rows > BREAK * (low + high) / 2)  # the median
    return np.moveaxis(found, -1, axis)


def _components(count: int, pairs: NDInt) -> NDInt:
    """Return for each of `count` members the least that it is connected with by pairs (2, K)."""
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
