"""A grid of problems: what varies, over which values, and in which order neighbours follow."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from math import prod

import numpy as np
from numpy.typing import ArrayLike

from actionopt.families.vary import Name, present, with_values
from actionopt.mechanics.question.problem import Problem
from actionopt.tools.checks import numbers
from actionopt.tools.immutable import immutable
from actionopt.tools.types import Array, NDInt


@immutable
class Grid:
    """Members are numbered from 0 as the items of an array of the grid's `shape`."""

    problem: Problem  # what all members have in common
    names: tuple[Name, ...]  # what varies
    # Of each: one axis of the grid or, `zipped`, one number for each member.
    values: tuple[Array, ...]
    zipped: bool

    def __repr__(self) -> str:
        rows = zip(map(label_of, self.names), self.values, strict=True)
        axes = (f"{name}: {row.size} from {row[0]:.6g} to {row[-1]:.6g}" for name, row in rows)
        return f"Grid({'; '.join(axes)}{', zipped' if self.zipped else ''})"

    @classmethod
    def of(cls, problem: Problem, over: Mapping[Name, ArrayLike], zipped: bool) -> Grid:
        """Return the grid. Raises ValueError for a name that names nothing, or for bad values."""
        if not isinstance(over, Mapping) or not over:
            raise ValueError(
                f"expected a mapping of names to values, such as {{'t1': [1.0, 2.0]}}, "
                f"found {over!r}"
            )
        rows = []
        for name, given in over.items():
            present(problem, name)
            row = np.atleast_1d(numbers(given, f"the values of {name!r}"))
            if row.ndim > 1 or not row.size or not np.isfinite(row).all():
                raise ValueError(
                    f"expected a row of finite values of {name!r}, found {np.asarray(given)!r}"
                )
            row.setflags(write=False)
            rows.append(row)
        if zipped and len({row.size for row in rows}) > 1:
            counts = ", ".join(
                f"{row.size} of {name!r}" for name, row in zip(over, rows, strict=True)
            )
            raise ValueError(f"expected as many values of each to zip, found {counts}")
        return cls(problem, tuple(over), tuple(rows), zipped)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the arrays over the grid."""
        return self.values[0].shape if self.zipped else tuple(row.size for row in self.values)

    @property
    def size(self) -> int:
        """Number of members."""
        return prod(self.shape)

    @cached_property
    def order(self) -> NDInt:
        """The members, (size,), so that each is a neighbour of the one before it.

        Along the last axis, back and forth.

        >>> from actionopt import scenes
        >>> over = {"g": [9.0, 10.0], "t1": [1.0, 2.0, 3.0]}
        >>> Grid.of(scenes.get("pendulum").problem, over, False).order.tolist()
        [0, 1, 2, 5, 4, 3]
        """
        order = np.zeros(1, dtype=int)
        for count in reversed(self.shape):
            rows = np.arange(count)[:, None] * order.size + order
            rows[1::2] = rows[1::2, ::-1]
            order = rows.ravel()
        return order

    def columns(self, members: NDInt) -> dict[Name, Array]:
        """Return the values (k,) of everything that varies, of k members."""
        if self.zipped:
            return {name: row[members] for name, row in zip(self.names, self.values, strict=True)}
        where = np.unravel_index(members, self.shape)
        rows = zip(self.names, self.values, where, strict=True)
        return {name: row[at] for name, row, at in rows}

    def member(self, i: int) -> Problem:
        """Return the problem of a member. Raises ValueError as a `Problem` does."""
        return with_values(self.problem, self.at(i))

    def at(self, i: int) -> dict[Name, float]:
        """Return the values of a member."""
        return {name: float(x[0]) for name, x in self.columns(np.array([i])).items()}

    def nearest(self, values: Mapping[Name, float]) -> int:
        """Return the member that is nearest to some values, each in units of its range."""
        found = []
        for name, row in zip(self.names, self.values, strict=True):
            found.append(((row - values[name]) / (np.ptp(row) or 1.0)) ** 2)
        if self.zipped:
            return int(np.argmin(sum(found)))
        return int(np.ravel_multi_index([np.argmin(x) for x in found], self.shape))

    def beside(self, i: int) -> list[int]:
        """Return the members next to one along the axes."""
        at = np.array(np.unravel_index(i, self.shape))
        near = []
        for axis, count in enumerate(self.shape):
            for k in (at[axis] - 1, at[axis] + 1):
                if 0 <= k < count:
                    there = at.copy()
                    there[axis] = k
                    near.append(int(np.ravel_multi_index(there, self.shape)))
        return near

    def text(self, i: int) -> str:
        """Return the values of a member, to be read: "g = 9.81, t1 = 2"."""
        return ", ".join(f"{label_of(name)} = {x:.6g}" for name, x in self.at(i).items())


def label_of(name: Name) -> str:
    """Return the name of what varies as one word: "end.x" for ("end", "x")."""
    return name if isinstance(name, str) else ".".join(map(str, name))
