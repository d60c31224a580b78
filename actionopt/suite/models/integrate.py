"""An integrator with a tolerance, for objectives that are not smooth below it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from actionopt.tools.types import Array

STEP_SAFETY, LEAST_FACTOR, MOST_FACTOR = 0.9, 0.2, 5.0  # of a step's length; as usual


def integrate(rate: Callable[[Array], Array], y: Array, duration: float, tolerance: float) -> Array:
    """Return y (k,) after `duration`, from y' = rate(y), the error of each step below `tolerance`.

    Source: P. Bogacki and L. F. Shampine, Appl. Math. Lett. 2 (1989), 321-325.
    """
    t, h, k1 = 0.0, min(duration, tolerance ** (1 / 3)), rate(y)
    while t < duration:
        h = min(h, duration - t)
        k2 = rate(y + h / 2 * k1)
        k3 = rate(y + 3 * h / 4 * k2)
        new = y + h / 9 * (2 * k1 + 3 * k2 + 4 * k3)
        k4 = rate(new)
        error = h * np.max(np.abs(-5 / 72 * k1 + k2 / 12 + k3 / 9 - k4 / 8))
        if error <= tolerance:
            t, y, k1 = t + h, new, k4
        ratio = (tolerance / max(error, 1e-300)) ** (1 / 3)
        h *= min(max(STEP_SAFETY * ratio, LEAST_FACTOR), MOST_FACTOR)
    return y
