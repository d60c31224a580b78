"""The median of what was sampled at uneven distances."""

from __future__ import annotations

import numpy as np

from actionopt.tools.types import Array


def median(values: Array, weights: Array) -> Array:
    """Return the lower median of values (K, ...) with weights (K,), the last axes each by itself.

    NaN counts as the largest.
    """
    order = np.argsort(values, axis=0)
    half = np.cumsum(weights[order], axis=0) >= weights.sum() / 2
    first = np.expand_dims(half.argmax(axis=0), 0)
    return np.take_along_axis(values, np.take_along_axis(order, first, 0), 0)[0]
