"""Who is next among the members of a family, and where the solved ones lead to expect their paths.

Members are points: what differs between them, each quantity in units of its range. They are tried
in waves, first outwards from those that are known, each wave twice as far as the last one, then in
between, in cells of half the size each time. Where few succeed the next wave stays nearer.
"""

from __future__ import annotations

import numpy as np

from actionopt.tools.types import Array, NDInt

# Ad hoc, where nothing else is said.
FIRST_REACH = 0.5  # of the ranges, into which the first wave goes
RETRY_DISTANCE = 0.75  # of its distance from a neighbour, at which a member is tried again
MEMBER_TRIES = 4  # of a member, before it is left alone
# Of a path's size, from where members between known ones were expected, at which all others are
# tried together: Newton's method takes one factorization, and two steps with it.
SURELY_EXPECTED = 1e-4
STRICTLY = 1 - 1e-9  # less than a square: rounding
DISTANCE_BATCH = 64  # points whose distances from all others are taken at once
# How `weights` are found: neighbours for so many quantities, the kernel's width in units of the
# farthest one's distance, and what is added to its diagonal, so that it can be inverted: in the
# rows of the kernel, of the constant, which comes first where neighbours are few, and of the linear
# terms.
NEIGHBOURS, KERNEL_WIDTH, NUGGETS = (1, 6, 10, 16, 22), 1.5, (1e-11, -1e-12, -1e-7)


class Front:
    """The members that are known, and those that are to be tried next.

    Parameters
    ----------
    at : (k, columns) array
        The members.

    Attributes
    ----------
    near : (k,) array
        Distances to the nearest members that are known.
    nearest : (k,) array of int
        Which those are.
    """

    def __init__(self, at: Array) -> None:
        self.at = at
        self._towards = at.copy()  # the points of those nearest ones
        self._lost = at[:0]  # who was given up
        self.near, self.nearest = np.full(len(at), np.inf), np.full(len(at), -1)
        self._tried = np.full(len(at), np.inf)  # what `near` was when it did not help
        self._tries = np.zeros(len(at), dtype=int)
        self._reach, self._growing, self._progress = FIRST_REACH, True, False
        self._sure = False
        self._smallest = 0.5 / len(at)  # cells that hold one member each, in a row

    def learn(self, which: NDInt, points: Array, left: NDInt) -> None:
        """Take note of members that are known, numbered `which`, at points (.., columns).

        For those who are `left`, (k,) of bool: nobody else asks who is near.
        """
        to = np.flatnonzero(left)
        for first in range(0, which.size if to.size else 0, DISTANCE_BATCH):
            some = slice(first, first + DISTANCE_BATCH)
            apart = squares(self.at[to], points[some])
            closest = np.argmin(apart, axis=1)
            least = np.sqrt(apart[np.arange(len(apart)), closest])
            nearer = least < self.near[to]
            here, closest = to[nearer], closest[nearer]
            self.near[here], self.nearest[here] = least[nearer], which[some][closest]
            self._towards[here] = points[some][closest]

    def note_lost(self, points: Array) -> None:
        """Take note of members that were given up, at points (.., columns)."""
        self._lost = np.concatenate([self._lost, points])

    def next_alone(self, left: NDInt, behind: bool) -> int | None:
        """Return the number of the member to be solved next by itself, of those `left`, (k,) bool.

        The nearest to known ones that does not lie behind a member that was given up; if none does
        and `behind` asks for it, the one farthest from all that were given up. Else None.
        """
        here = np.flatnonzero(left & ~self._behind)
        if here.size:
            return int(here[np.argmin(self.near[here])])
        here = np.flatnonzero(left)
        if not behind or not here.size:
            return None
        return int(here[np.argmax(squares(self.at[here], self._lost).min(axis=1))])

    @property
    def _behind(self) -> NDInt:
        """Which members have one that was given up between them and the nearest known, (k,).

        It is nearer to both than they are to each other.
        """
        apart, limit = squares(self.at, self._lost), STRICTLY * self.near[:, None] ** 2
        between = (apart < limit) & (squares(self._towards, self._lost) < limit)
        return np.any(between, axis=1)

    def wave(self, left: NDInt, known: NDInt) -> NDInt:
        """Return who is to be tried next, or nobody if that would be of no use.

        It is chosen among those who are `left`; `known` are the members that are, both (k,) of
        bool.
        """
        near, reach = self.near, self._reach
        may = np.flatnonzero(
            left & (near < RETRY_DISTANCE * self._tried) & (self._tries < MEMBER_TRIES)
        )
        while may.size:
            if self._sure:
                chosen = may
            elif reach < self._smallest:  # everyone that is left, the nearest first
                chosen = may[near[may] <= self._around * near[may].min()]
            else:
                chosen = may[near[may] <= (reach if self._growing else self._around * reach)]
                chosen = self._sparse(chosen, known, reach / 2 if self._growing else reach)
            if chosen.size:
                self._reach = reach
                self._tried[chosen] = near[chosen]
                self._tries[chosen] += 1
                return chosen
            if self._growing and near[may].max() > reach:
                reach *= 2
            elif reach >= self._smallest:
                reach, self._growing = reach / 2, False
            elif self._progress:
                reach, self._growing, self._progress = 2 * self._smallest, True, False
            else:
                break
        self._reach = reach
        return may[:0]

    def note_solved(self, tried: int, solved: int, moved: float = np.inf) -> None:
        """Take note of how many were solved of how many that were tried, and how far they moved."""
        self._progress |= solved > 0
        # Nearer neighbours would tell no more of those in between.
        self._sure = solved == tried and not self._growing and moved < SURELY_EXPECTED
        enough = 2 * solved >= tried
        self._reach *= 2 if enough and self._growing else 0.5
        self._growing &= enough

    def again(self) -> None:
        """Start again with the nearest neighbours: a member has been solved to begin from."""
        self._reach, self._growing = 2 * self._smallest, True

    @property
    def _around(self) -> float:
        """Distance of a member from one in the next cell but one, in units of the cell."""
        return 2 * self.at.shape[1] ** 0.5

    def _sparse(self, some: NDInt, known: NDInt, cell: float) -> NDInt:
        """Return one of them for each cell in which nobody is known."""
        cells = np.floor(self.at / cell).astype(np.int64)
        key = cells @ (np.int64(1_000_003) ** np.arange(cells.shape[1], dtype=np.int64))
        _, first = np.unique(key[some], return_index=True)
        return some[first][~np.isin(key[some[first]], key[known])]


def weights(x: Array) -> Array:
    """Return the weights (C, N) of values at points x (C, N, columns) that give that at zero.

    Linear functions are reproduced, others interpolated by a Gaussian kernel.
    """
    count, near, columns = x.shape
    size = near + 1 + columns
    apart = ((x[:, :, None] - x[:, None]) ** 2).sum(axis=3)
    K = np.zeros((count, size, size))
    K[:, :near, :near] = np.exp(-apart / (2 * KERNEL_WIDTH**2))
    K[:, :near, near] = K[:, near, :near] = 1.0
    K[:, :near, near + 1 :] = x
    K[:, near + 1 :, :near] = x.swapaxes(1, 2)
    at = np.arange(size)
    K[:, at, at] += np.repeat(NUGGETS, [near, 1, columns])
    right = np.zeros((count, size, 1))
    right[:, :near, 0] = np.exp(-(x**2).sum(axis=2) / (2 * KERNEL_WIDTH**2))
    right[:, near] = 1.0
    found = np.linalg.solve(K, right)[:, :near, 0]
    return found / found.sum(axis=1, keepdims=True)


def squares(a: Array, b: Array) -> Array:
    """Return the squared distances of points a (A, columns) from points b (B, columns), (A, B).

    Good to some spacings of their own squares, of order one.
    """
    found = (a**2).sum(axis=1)[:, None] - 2 * (a @ b.T)
    found += (b**2).sum(axis=1)
    return np.maximum(found, 0.0, out=found)
