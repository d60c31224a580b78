"""Check what was derived by hand: accelerations against the Lagrangian, partials by differences.

python -m benchmarks.check
"""

from __future__ import annotations

import numpy as np

import actionopt as ao
from benchmarks import problems
from benchmarks.arithmetic import NUMPY

STEP = 1e-6
ACCURATE, DIFFERENCED = 1e-9, 1e-5  # relative; central differences with STEP are good to 1e-8


def states(case: problems.Case, ends: problems.Ends):
    """Return times, coordinates and rough velocities on the path, off its symmetric points."""
    at = np.array([37, 83, 140])
    q = ends.exact
    slope = (q[:, at + 1] - q[:, at - 1]) / (case.times[at + 1] - case.times[at - 1])
    return case.times[at], q[:, at], slope


def deviations(case: problems.Case) -> tuple[float, float]:
    """Return relative deviations of the acceleration and of its partials."""
    system = ao.System(
        case.lagrangian,
        case.coordinates,
        parameters=case.parameters,
        constraint=case.constraint,
    )
    t, q, v = states(case, case.ends()[0])
    mine = case.acceleration(q, v, t, NUMPY)
    theirs = system.acceleration(q, v, t)
    partials = np.concatenate(case.partials(q, v, t), axis=1)
    worst = 0.0
    for k in range(2 * case.n):
        dq, dv = np.zeros_like(q), np.zeros_like(v)
        (dq if k < case.n else dv)[k % case.n] = STEP
        ahead = case.acceleration(q + dq, v + dv, t, NUMPY)
        behind = case.acceleration(q - dq, v - dv, t, NUMPY)
        worst = max(worst, np.max(np.abs((ahead - behind) / (2 * STEP) - partials[:, k])))
    return (
        float(np.max(np.abs(mine - theirs)) / np.max(np.abs(theirs))),
        float(worst / max(np.max(np.abs(partials)), 1.0)),
    )


def main() -> None:
    """Check every problem; raise SystemExit if one deviates."""
    bad = []
    for name, case in problems.load().items():
        acceleration, partials = deviations(case)
        print(f"{name:18s} acceleration {acceleration:.1e}   partials {partials:.1e}")
        if not (acceleration < ACCURATE and partials < DIFFERENCED):
            bad.append(name)
    if bad:
        raise SystemExit(f"derived wrongly: {', '.join(bad)}")


if __name__ == "__main__":
    main()
