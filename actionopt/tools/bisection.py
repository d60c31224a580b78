"""Bisection of many intervals at once, down to neighbouring floats."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from actionopt.tools.types import Array

BISECTIONS = 60  # between two samples there are no more floats to halve


def bisect(low: Array, high: Array, is_low: Callable[[Array], Array]) -> tuple[Array, Array]:
    """Return the last places from low to high, both (K,), that are as the low, and the next ones.

    `is_low` tells of places (K,), one in each interval, whether they are.
    """
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        below = is_low(middle)
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return low, high
