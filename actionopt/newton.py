"""Plain Newton's method on the KKT system: it follows a path that is near already.

It has no globalisation, so it watches itself. Every factorization is used twice: for the Newton
step and for a simplified second step, whose ratio to the first measures how fast the iteration
contracts (Deuflhard, *Newton Methods for Nonlinear Problems* (2011), section 2.1). Where it does
not contract, the caller hands the problem to a method that finds paths.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from actionopt.quadrature import Array
from actionopt.transcription import Factors, Transcription

CONTRACTION = 0.5  # a larger ratio of successive steps is not the neighbourhood of a path
ROUNDOFF_STEP = 1e-9  # steps that stop contracting below this size are round-off
TARGET = 1e-14  # in units of the coordinates' sizes; one step past it costs next to nothing


@dataclass(frozen=True, eq=False)
class Followed:
    """Where Newton's method arrived.

    Attributes
    ----------
    z : (size,) array
        The last iterate.
    converged : bool
        Whether the steps contracted down to round-off.
    noise : float
        Size of the correction that the remaining residual still asks for, in units of the
        coordinates' sizes: round-off amplified by the problem's own conditioning.
    iterations : int
        Factorizations used.
    travelled : float
        Distance from the first iterate, in the same units.
    """

    z: Array
    converged: bool
    noise: float
    iterations: int
    travelled: float


def follow(tr: Transcription, z: Array, *, linear: bool = False, steps: int = 12) -> Followed:
    """Follow the stationary path near z in at most `steps` steps; one where it is `linear`."""
    cut = tr.layout.unknowns
    first = z
    with np.errstate(all="ignore"):
        residual = tr.residual(z)
        for k in range(1, steps + 1):
            try:
                factors = Factors(tr.layout, tr.kkt(z))
            except np.linalg.LinAlgError:
                return Followed(z, False, np.inf, k, np.inf)
            step = factors.solve(residual)
            nearer = z - step
            second = factors.solve(tr.residual(nearer))
            size, rest = _size(step[:cut]), _size(second[:cut])
            if not np.isfinite(rest):
                return Followed(z, False, np.inf, k, np.inf)
            z = nearer - second
            residual = tr.residual(z)
            ratio = rest / size if size else 0.0
            if linear or rest * ratio <= TARGET or (ratio > CONTRACTION and rest < ROUNDOFF_STEP):
                noise = _size(factors.solve(residual)[:cut])
                return Followed(z, True, noise, k, _size((z - first)[:cut]))
            if ratio > CONTRACTION:
                return Followed(z, False, rest, k, _size((z - first)[:cut]))
    return Followed(z, False, rest, steps, _size((z - first)[:cut]))


def _size(step: Array) -> float:
    return float(np.max(np.abs(step))) if step.size else 0.0
