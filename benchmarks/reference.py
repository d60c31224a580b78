"""References where no closed form is known: integration at thirty digits, stored once.

`python -m benchmarks.reference` makes `reference.npz` anew (with `--others` only the paths of
`others.json`). The hand-derived accelerations are
integrated from the release by Gragg's extrapolated midpoint rule in mpmath's
numbers; the end points of the benchmark are the integrated path's, rounded, and so the
reference is as good as rounding lets.

Hairer, Norsett, Wanner, *Solving Ordinary Differential Equations I* (2nd ed. 1993), section
II.9, equations 9.10 and 9.13.
"""

from __future__ import annotations

import sys

import numpy as np

from benchmarks import problems
from benchmarks.arithmetic import elementwise
from benchmarks.others import known
from benchmarks.peers._peer import tangent
from benchmarks.peers.dop853 import end_and_slope
from benchmarks.problems._case import sample_times
from benchmarks.problems._stored import FILE, table

DIGITS = 34
COLUMNS = 8  # of the extrapolation table: order 16
TOLERANCE = "1e-22"  # of the last correction in each step, relative


def extrapolate(rhs, t, y, h):
    """Return y after a step h from t, and the size of the last correction."""
    first = rhs(t, y)
    above: list = []
    for j in range(1, COLUMNS + 1):
        # 2 j midpoint steps: their error is a series in even powers of 1 / j.
        small = h / (2 * j)
        before, now = y, y + small * first
        for i in range(1, 2 * j):
            before, now = now, before + 2 * small * rhs(t + i * small, now)
        row = [now]
        for k in range(1, j):
            ratio = h * j / (h * (j - k))
            row.append(row[-1] + (row[-1] - above[k - 1]) / (ratio**2 - 1))
        above = row
    return above[-1], max(abs(above[-1] - above[-2]))


class Integrator:
    """The equations of motion of a problem in multiple precision.

    Parameters
    ----------
    acceleration : callable
        As in `Case`.
    duration : float
    label : str
        For the progress line.
    """

    def __init__(self, acceleration, duration: float, label: str) -> None:
        import mpmath

        mpmath.mp.dps = DIGITS
        self.x, self.number = elementwise(mpmath), mpmath.mpf
        self.tolerance = mpmath.mpf(TOLERANCE)
        self.acceleration, self.duration, self.label = acceleration, duration, label

    def rhs(self, t, y):
        """Return d(q, v)/dt."""
        n = len(y) // 2
        return np.concatenate([y[n:], self.acceleration(y[:n], y[n:], t, self.x)])

    def advance(self, t, y, h):
        """Return y after h, in as many steps as the last correction asks for."""
        after, last = extrapolate(self.rhs, t, y, h)
        if last <= self.tolerance * max(abs(after)):
            return after
        return self.advance(t + h / 2, self.advance(t, y, h / 2), h / 2)

    def path(self, q, v, times) -> np.ndarray:
        """Return q at the times (K,), in multiple precision, (n, K)."""
        y = np.array([self.number(value) for value in (*q, *v)], dtype=object)
        n = len(q)
        rows = [y[:n]]
        grid = [self.number(float(t)) for t in times]
        for k in range(1, len(grid)):
            y = self.advance(grid[k - 1], y, grid[k] - grid[k - 1])
            rows.append(y[:n])
            print(f"\r{self.label}: {k / (len(grid) - 1):4.0%}", end="", file=sys.stderr)
        print(file=sys.stderr)
        return np.array(rows).T


def polished(case, ends, v) -> np.ndarray:
    """Return the path of first velocity near v that meets the end, (n, K), rounded.

    Newton's method in multiple precision with the derivatives of double precision gains some
    nine digits a step.
    """
    run = Integrator(case.acceleration, case.duration, f"{case.name}, another path")
    Z = tangent(case, ends)
    slope = end_and_slope(case, ends, np.asarray(v, dtype=float), Z, 1e-11)[2]
    assert slope is not None
    v = np.array([run.number(float(x)) for x in v], dtype=object)
    for _ in range(3):
        path = run.path(ends.start, v, case.times)
        miss = path[:, -1] - np.array([run.number(x) for x in ends.end])
        size = float(max(abs(miss)))
        if size < 1e-18:
            break
        # Scaled, so that a tiny miss is not lost in double precision.
        direction = Z @ np.linalg.lstsq(slope, (miss / size).astype(float), rcond=None)[0]
        v = v - size * direction
    return path.astype(float)


def main() -> None:
    """Integrate every problem that has no closed form, and the other paths; write the file."""
    fresh = "--others" not in sys.argv
    paths = {} if fresh else {k: v for k, v in table().items() if "/" not in k}
    for module in problems.INTEGRATED if fresh else ():
        run = Integrator(module.acceleration, module.DURATION, module.NAME)
        times = sample_times(module.DURATION)
        paths[module.NAME] = np.array(
            [run.path(q, v, times).astype(float) for q, v in module.RELEASES]
        )
    np.savez_compressed(FILE, allow_pickle=False, **paths)
    table.cache_clear()
    for name, found in known().items():
        case = problems.load()[name]
        for k, (ends, velocities) in enumerate(zip(case.ends(), found, strict=True)):
            if velocities:
                paths[f"{name}/{k}"] = np.array([polished(case, ends, v) for v in velocities])
        np.savez_compressed(FILE, allow_pickle=False, **paths)


if __name__ == "__main__":
    main()
