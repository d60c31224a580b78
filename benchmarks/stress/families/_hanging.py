"""A hanging chain released from rest: unit masses on n links, 1 m together, g = 9.81 m/s^2."""

from __future__ import annotations

from functools import cache

import numpy as np

from actionopt.scenes.chain import slowest
from benchmarks.arithmetic import NUMPY
from benchmarks.problems.chain import G, acceleration
from benchmarks.stress.forward import motion

AMPLITUDE, FRACTION = 0.4, 0.2  # of the last link (rad); of the slowest small oscillation's period


@cache
def release(links: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Return the links' angles from straight down at the start and at the end, and the time.

    The shape at the start is the slowest small oscillation's.
    """
    w, shape = slowest(links)
    T, first = float(FRACTION * 2 * np.pi / (w * np.sqrt(G * links))), AMPLITUDE * shape
    fall = motion(lambda q, v, t: acceleration(q, v, t, NUMPY), first, 0 * shape, T, 1e-10)
    return first, fall(T), T
