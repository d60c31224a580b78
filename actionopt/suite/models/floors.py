"""A heavy string above a floor that rises: contact, and where it grows, in closed form.

On equal steps second differences of parabolas are exact, and so is all that follows of them.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from actionopt.suite.models.model import KnownAnswer, WrittenModel
from actionopt.tools.types import Array

WEIGHT = 16.0  # of a length of string, over its tension: it would sag by 2 without a floor


def string_above_floor(*, elements: int = 40, floor: float = 0.0) -> WrittenModel:
    """Return a string between two points at height 1, with a floor: bounds of all heights.

    Raises ValueError for an odd number of elements, or a floor that is not below the ends.
    """
    if elements != int(elements) or elements < 4 or elements % 2:
        raise ValueError(f"expected an even number of elements, at least 4, found {elements!r}")
    if not floor < 1:
        raise ValueError(f"expected a floor below the ends, at height 1, found {floor!r}")
    h = 1 / elements
    x = ca.SX.sym("x", elements - 1)
    heights = ca.vertcat(1, x, 1)
    f = ca.sumsqr(heights[1:] - heights[:-1]) / (2 * h) + WEIGHT * h * ca.sum1(x)

    def closed_form() -> KnownAnswer:
        return KnownAnswer(_heights(elements, floor), np.zeros(0), "closed form: parabolas")

    return WrittenModel(
        "string_above_floor",
        x,
        f,
        bounds=(floor, np.inf),
        start=np.maximum(np.ones(elements - 1), floor),
        answer=closed_form,
        tags=("bounds on coordinates",),
    )


def contact_changes(elements: int) -> Array:
    """Return the heights of the floor at which nodes come into contact, from the lowest."""
    pairs = np.arange(elements // 2, 1, -1)  # from the middle, one on either side at a time
    sag = WEIGHT / elements**2 * pairs * (pairs - 1) / 2
    return np.append(1 - WEIGHT / 8, 1 - sag)


def _heights(elements: int, floor: float) -> Array:
    t = np.arange(1, elements) / elements
    if floor <= 1 - WEIGHT / 8:
        return 1 - WEIGHT * t * (1 - t) / 2
    j = np.arange(1, elements // 2 + 1)
    held = j * (j - 1) * WEIGHT / elements**2 / 2 <= 1 - floor
    end = j[held][-1] / elements  # contact begins at the last node whose neighbour is above it
    beside = np.minimum(t, 1 - t)
    free = 1 + (floor - 1) * beside / end - WEIGHT * beside * (end - beside) / 2
    return np.where(beside < end, free, floor)
