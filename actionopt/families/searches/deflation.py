"""Newton's method that keeps away from paths already found.

Deflation (Farrell, Birkisson and Funke, *SIAM J. Sci. Comput.* 37 (2015), p. A2026) multiplies the
residual by M(x) = prod_i (1 + 1 / |x - x_i|^2), which has the same roots but those known. Its
Newton step is the plain one times the number 1 / (1 - (grad M . step) / M).
"""

from __future__ import annotations

import numpy as np

from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.matrices.factors import Factors
from actionopt.tools.types import Array

# Ad hoc; lengths in units of the coordinates' sizes.
DEFLATED_STEPS, DEFLATED_REACH, DEFLATED_TOL = 60, 1.0, 1e-7


def deflate(tr: Transcription, z: Array, known: list[Array]) -> Array | None:
    """Return a stationary path other than those `known` (as vectors z), from z; None if lost."""
    cut = tr.layout.unknowns
    with np.errstate(all="ignore"):
        for _ in range(DEFLATED_STEPS):
            try:
                step = -Factors(tr.layout, tr.kkt(z)).solve(tr.residual(z))
            except np.linalg.LinAlgError:
                return None
            size = float(np.max(np.abs(step[:cut])))
            if not np.isfinite(size):
                return None
            if size < DEFLATED_TOL:
                return z + step
            slope = 0.0  # (grad M . step) / M
            for other in known:
                gap = (z - other)[:cut]
                square = float(gap @ gap) / cut
                slope -= 2 * float(gap @ step[:cut]) / cut / (square * (1 + square) + 1e-300)
            factor = 1 / (1 - slope) if slope != 1 else 1e3
            z = z + factor * min(1.0, DEFLATED_REACH / (abs(factor) * size)) * step
    return None
