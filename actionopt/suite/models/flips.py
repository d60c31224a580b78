"""Barriers between minima: a row of pendulums that turns over, at once or one after the other."""

from __future__ import annotations

import casadi as ca
import numpy as np

from actionopt.suite.member import Stationary
from actionopt.suite.models.model import KnownAnswer, WrittenModel

DEGENERATE = 1e-12  # of the largest, an eigenvalue that is round-off


def pendulum_row(*, pendulums: int = 8, coupling: float = 8.0) -> WrittenModel:
    """Return the potential of pendulums beside each other, bound by torsion springs.

    All hang, or all have turned once: two minima. All standing is between them, twice the number
    of pendulums higher. Its Hessian has the eigenvalues 4 c sin^2(pi j / 2 N) - 1: its index is 1
    where springs are stiff, else they turn one after the other, over barriers that are lower.
    """
    if pendulums != int(pendulums) or pendulums < 2:
        raise ValueError(f"expected a whole number of pendulums, at least 2, found {pendulums!r}")
    if not coupling > 0:
        raise ValueError(f"expected a positive coupling, found {coupling!r}")
    count = int(pendulums)
    x = ca.SX.sym("angle", count)
    f = ca.sum1(1 - ca.cos(x)) + coupling * ca.sumsqr(x[1:] - x[:-1]) / 2

    def hanging() -> KnownAnswer:
        modes = 4 * coupling * np.sin(np.pi * np.arange(count) / (2 * count)) ** 2 - 1
        level, zero = np.ones(count), np.zeros(count)
        degenerate = np.any(np.abs(modes) < DEGENERATE * (1 + 4 * coupling))
        index = None if degenerate else int(np.sum(modes < 0))
        standing = Stationary(np.pi * level, 2.0 * count, index)
        turned = Stationary(2 * np.pi * level, 0.0, 0)
        return KnownAnswer(zero, np.zeros(0), "closed form", others=(standing, turned))

    return WrittenModel(
        "pendulum_row",
        x,
        f,
        start=0.5 + 0.1 * np.cos(np.arange(count)),
        answer=hanging,
        tags=("several optima", "barrier"),
    )
