"""A hanging chain released from rest: unit masses on n links, 1 m together, g = 9.81 m/s^2."""

from __future__ import annotations

from functools import cache

import numpy as np

from actionopt.scenes.chain import slowest
from benchmarks.stress.forward import motion

GRAVITY = 9.81
AMPLITUDE, FRACTION = 0.4, 0.2  # of the last link (rad); of the slowest small oscillation's period


@cache
def release(links: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Return the links' angles from straight down at the start and at the end, and the time.

    The shape at the start is the slowest small oscillation's. Equations of motion: with
    c_ij = n - max(i, j) and i = 0 ... n - 1, sum_j c_ij (cos(a_i - a_j) a_j'' +
    sin(a_i - a_j) a_j'^2) = -(n - i) n g sin a_i.
    """
    w, shape = slowest(links)
    w *= np.sqrt(GRAVITY * links)
    i = np.arange(links)
    carried = links - np.maximum.outer(i, i)

    def acceleration(a, rate, t):
        between = np.subtract.outer(a, a)
        pull = (carried * np.sin(between)) @ rate**2
        weight = (links - i) * links * GRAVITY * np.sin(a)
        return np.linalg.solve(carried * np.cos(between), -pull - weight)

    T, first = float(FRACTION * 2 * np.pi / w), AMPLITUDE * shape
    return first, motion(acceleration, first, 0 * shape, T, 1e-10)(T), T
