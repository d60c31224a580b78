"""References where no closed form is known: integration at thirty digits, stored once.

`python -m benchmarks.reference` makes `reference.npz` anew. The hand-derived accelerations are
integrated from the release by Gragg's extrapolated midpoint rule in mpmath's
numbers; the end points of the benchmark are the integrated path's, rounded, and so the
reference is as good as rounding lets.

Hairer, Norsett, Wanner, *Solving Ordinary Differential Equations I* (2nd ed. 1993), section
II.9, equations 9.10 and 9.13.
"""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path

import numpy as np

FILE = Path(__file__).with_name("reference.npz")
DIGITS = 34
COLUMNS = 8  # of the extrapolation table: order 16
TOLERANCE = "1e-22"  # of the last correction in each step, relative


@cache
def _table():
    return np.load(FILE)


def stored(name: str):
    """Return the two `Ends` of a problem from the file."""
    from benchmarks.problems._case import Ends

    paths = _table()[name]
    return tuple(Ends(q[:, 0].copy(), q[:, -1].copy(), q.copy()) for q in paths)


def extrapolate(rhs, y, h):
    """Return y after a step h, an mpf, and the size of the last correction."""
    first = rhs(y)
    above: list = []
    for j in range(1, COLUMNS + 1):
        # 2 j midpoint steps: their error is a series in even powers of 1 / j.
        small = h / (2 * j)
        before, now = y, y + small * first
        for _ in range(2 * j - 1):
            before, now = now, before + 2 * small * rhs(now)
        row = [now]
        for k in range(1, j):
            ratio = h * j / (h * (j - k))
            row.append(row[-1] + (row[-1] - above[k - 1]) / (ratio**2 - 1))
        above = row
    return above[-1], max(abs(above[-1] - above[-2]))


def integrate(module, release, progress) -> np.ndarray:
    """Return the path of a release at 201 uniform times, (n, 201), rounded."""
    import mpmath

    from benchmarks.arithmetic import elementwise
    from benchmarks.problems._case import SAMPLES

    mpmath.mp.dps = DIGITS
    x = elementwise(mpmath)
    n = len(release[0])

    def rhs(y):
        return np.concatenate([y[n:], module.acceleration(y[:n], y[n:], 0, x)])

    y = np.array([mpmath.mpf(float(value)) for side in release for value in side], dtype=object)
    h = mpmath.mpf(module.DURATION) / (SAMPLES - 1)
    rows, worst = [y[:n]], mpmath.mpf(0)
    for k in range(1, SAMPLES):
        y, last = extrapolate(rhs, y, h)
        worst = max(worst, last / max(abs(y)))
        rows.append(y[:n])
        progress(k / (SAMPLES - 1), float(worst))
    if worst > mpmath.mpf(TOLERANCE):
        raise ArithmeticError(f"{module.NAME}: last corrections of {float(worst):.1e}")
    return np.array(rows, dtype=float).T


def main() -> None:
    """Integrate every problem that has no closed form, and write the file."""
    from benchmarks.problems import INTEGRATED

    paths = {}
    for module in INTEGRATED:

        def progress(done: float, worst: float, name: str = module.NAME) -> None:
            print(f"\r{name}: {done:4.0%}, last correction {worst:.0e}", end="", file=sys.stderr)

        paths[module.NAME] = np.stack(
            [integrate(module, release, progress) for release in module.RELEASES]
        )
        print(file=sys.stderr)
    np.savez_compressed(FILE, **paths)


if __name__ == "__main__":
    main()
