"""Newton's method with a step for each coordinate, where each is coupled to few others.

In a lattice, what happens at one place hardly reaches another in the time there is. Where a mode is
beyond its resonance, at a place of a few coordinates, Newton's step runs away or comes and goes
over a fold; damping all of the step by one factor holds up the rest for it, and there are many such
places. So the step of each coordinate is limited by itself. The limits are drawn at random: with
equal ones a place may come and go for ever. One that runs away is put back to where it set out, and
after some steps all of them are, and begin anew a little beside.
"""

from __future__ import annotations

import numpy as np

from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.matrices.factors import Factors
from actionopt.tools.types import Array

# Measured on nine questions to 128 masses of an FPUT lattice: seven are reached in 13 to 410 steps.
# Limits from 0.1 on, or up to 2, or ways that begin anew never or at the same place, reach fewer.
# A lattice of 512 has four times as many places, and a step on it costs four times as much.
COMPONENT_STEPS, MASS_STEPS, RUN, BESIDE = 700, 90_000, 60, 0.1
SMALLEST_LIMIT, LARGEST_LIMIT = 0.3, 1.0  # limits, in units of the coordinates' sizes
PUT_BACK = 3.0  # where a coordinate is put back
SETTLED = 1e-3  # step after which Newton's method contracts


def settle_by_component(tr: Transcription, z: Array) -> tuple[Array | None, int]:
    """Return a point (size,) near a stationary path, or None, and the factorizations used.

    `tr` is without constraints, and all coordinates are given at both of its ends.
    """
    rng, n = np.random.default_rng(0), tr.problem.system.n
    steps = min(COMPONENT_STEPS, MASS_STEPS // n)
    first, at = z.reshape(-1, n), z.reshape(-1, n)
    s = np.arange(1.0, 1.0 + len(first)) / (1 + len(first))
    bump = np.sin(np.pi * s)[:, None]
    with np.errstate(all="ignore"):
        for k in range(steps):
            if k % RUN == 0 and k:
                at = first + BESIDE * rng.normal(size=n) * bump
            x = at.ravel()
            try:
                step = -Factors(tr.layout, tr.kkt(x)).solve(tr.residual(x)).reshape(-1, n)
            except np.linalg.LinAlgError:
                return None, k + 1
            size = np.abs(step).max(axis=0)
            if size.max() < SETTLED:
                return x + step.ravel(), k + 1
            limits = rng.uniform(SMALLEST_LIMIT, LARGEST_LIMIT, n)
            at = at + step * np.minimum(1.0, limits / size)
            away = ~(np.abs(at - first).max(axis=0) < PUT_BACK)
            at[:, away] = first[:, away]
    return None, steps
