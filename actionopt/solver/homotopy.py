"""Reach a path from one that is none, by taking away the force that would make it one.

Any curve is the true motion under some applied force: the negative of its Euler-Lagrange residual
R(z0). Scaling that force down, R(z) = (1 - s) R(z0), leads from the curve at s = 0 to a path
of the problem itself at s = 1 (Newton homotopy; Allgower and Georg, *Numerical Continuation
Methods* (1990), section 11.3). The solutions (z, s) form a curve that may turn back in s, so it
is followed by its arclength (Keller's bordered system, ibid. chapter 10).
"""

from __future__ import annotations

import numpy as np

from actionopt.discrete.arclength import FAR
from actionopt.discrete.factors import Factors
from actionopt.discrete.transcription import Transcription
from actionopt.tools.types import Array

# Steps at most, and for any number of unknowns; all are taken up to some unknowns, above fewer in
# proportion. Measured on 100 lattices and pendulums of 1 to 10 coordinates: what is found takes 18
# to 215 steps, with up to 4 coordinates (190 unknowns); with more, 400 steps find nothing.
HOMOTOPY_STEPS, FEWEST_STEPS, ALL_STEPS_SIZE = 240, 20, 200
# Ad hoc.
# Of arclength in s and the root mean square of the coordinates; halved where the corrector fails.
FIRST_ARC, LONGEST_ARC, SHORTEST_ARC = 0.05, 0.5, 1e-6
CORRECTOR_STEPS = 5
CORRECTOR_TOL = 1e-6  # correction, in units of the coordinates' sizes, that ends a corrector


def newton_homotopy(tr: Transcription, z: Array) -> tuple[Array, int] | None:
    """Return a point (size,) near a stationary path and the factorizations used, or None.

    `z` is the curve at which the applied force starts.
    """
    cut = tr.layout.unknowns
    force = tr.residual(z)
    steps = min(HOMOTOPY_STEPS, HOMOTOPY_STEPS * ALL_STEPS_SIZE // tr.layout.size + FEWEST_STEPS)
    s, direction, ds, length, count = 0.0, None, 1.0, FIRST_ARC, 0
    for _ in range(steps):
        try:
            slope = -Factors(tr.layout, tr.kkt(z), many=True).solve(force)  # dz/ds
        except np.linalg.LinAlgError:
            return None
        count += 1
        norm = np.sqrt(np.mean(slope[:cut] ** 2) + 1.0)
        # Keep going the same way along the curve, through a fold in s as well.
        forward = 1.0 if direction is None else np.mean(slope[:cut] * direction[:cut]) + ds
        sign = 1.0 if forward >= 0 else -1.0
        direction, ds = sign * slope / norm, sign / norm
        while True:
            step = min(length, (1.0 - s) / ds) if ds > 0 and s + length * ds > 1.0 else length
            trial = _correct(tr, z + step * direction, s + step * ds, force, direction, ds)
            count += 1 if trial is None else trial[2]
            if trial is not None:
                break
            length /= 2
            if length < SHORTEST_ARC:
                return None
        z, s = trial[0], trial[1]
        if not np.max(np.abs(z[:cut])) < FAR:
            return None
        if s >= 1.0 - 1e-9:
            return z, count
        if trial[2] <= 2:
            length = min(2 * length, LONGEST_ARC)
    return None


def _correct(tr, z, s, force, direction, ds) -> tuple[Array, float, int] | None:
    """Return (z, s, factorizations) on the curve, on the plane across `direction`; or None."""
    cut = tr.layout.unknowns
    last = np.inf
    with np.errstate(all="ignore"):
        for k in range(1, CORRECTOR_STEPS + 1):
            try:
                factors = Factors(tr.layout, tr.kkt(z), many=True)
                miss = factors.solve(tr.residual(z) - (1.0 - s) * force)
                slope = -factors.solve(force)
            except np.linalg.LinAlgError:
                return None
            # Bordered system: the correction is orthogonal to the direction.
            along = np.mean(miss[:cut] * direction[:cut])
            change = along / (np.mean(slope[:cut] * direction[:cut]) + ds)
            step = -miss + slope * change
            size = float(np.max(np.abs(step[:cut])))
            if not np.isfinite(size) or size > 2 * last:
                return None
            z, s, last = z + step, s + change, size
            if size < CORRECTOR_TOL:
                return z, s, k
    return None
