"""Bounds of a test problem: of its coordinates, and of the functions that constrain them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from actionopt.tools.immutable import immutable
from actionopt.tools.types import Array

Bound = float | Callable[[Array], Array]  # of times (K,) where it moves
Sides = tuple[Bound, Bound]
NO_LIMITS: Sides = (-np.inf, np.inf)
EQUAL: Sides = (0.0, 0.0)


@immutable
class Bounds:
    """Lower and upper bounds, in the units of the scene, of as many as are given.

    Of the others, a coordinate has none, and a constraint function f is to vanish.

    Parameters
    ----------
    coordinates, constraints : sequence of (lower, upper)
        Of each coordinate, and of each function f of the constraint; numbers, infinite ones too, or
        functions of the times (K,). Upper bounds of coordinates are larger than the lower ones.
    """

    coordinates: Sequence[Sides] = ()
    constraints: Sequence[Sides] = ()

    def of_coordinates(self, which: Array, times: Array) -> tuple[Array, Array]:
        """Return the bounds of the coordinates `which` (K,) at the times (K,), each (K,).

        Raises ValueError if a lower one is not less than the upper one.
        """
        lower, upper = _sides(self.coordinates, NO_LIMITS, which, times)
        if not np.all(lower < upper):
            k = int(np.argmin(lower < upper))
            raise ValueError(
                f"expected the lower bound of coordinate {which[k]} below the upper one, found "
                f"{lower[k]:.6g} and {upper[k]:.6g} at t = {times[k]:.6g}"
            )
        return lower, upper

    def of_constraints(self, which: Array, times: Array) -> tuple[Array, Array]:
        """Return the bounds of the functions `which` (K,) at the times (K,), each (K,).

        Raises ValueError if a lower one is above the upper one, or both are infinite.
        """
        lower, upper = _sides(self.constraints, EQUAL, which, times)
        fit = (lower <= upper) & (np.isfinite(lower) | np.isfinite(upper))
        if not np.all(fit):
            k = int(np.argmin(fit))
            raise ValueError(
                f"expected the lower bound of constraint {which[k]} not above the upper one, found "
                f"{lower[k]:.6g} and {upper[k]:.6g} at t = {times[k]:.6g}"
            )
        return lower, upper


UNLIMITED = Bounds()


def _sides(
    given: Sequence[Sides], default: Sides, which: Array, times: Array
) -> tuple[Array, Array]:
    found = np.tile(np.array(default), (which.size, 1)).T
    for i, pair in enumerate(given):
        mine = which == i
        for row, bound in zip(found, pair, strict=True):
            row[mine] = bound(times[mine]) if callable(bound) else bound
    return found[0], found[1]
