"""What every peer offers, so that all are measured by the same loop."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import BarycentricInterpolator

from benchmarks.problems import Case, Ends

TOLERANCES = tuple(10.0**-k for k in (2, 3, 4, 6, 7, 8, 9, 10, 11, 12, 13))


# Ipopt without a word, as it is given to all who use it.
IPOPT = {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": False, "ipopt.tol": 1e-10}
# Of shooting; a miss, relative to the end points' size, beyond which a step is halved.
ITERATIONS, HALVINGS, RUNAWAY = 25, 8, 10.0


class Unable(Exception):
    """The peer cannot express this problem; the message says why."""


class Failed(Exception):
    """The peer says that it did not find a path; the message is its own."""


@dataclass(frozen=True, eq=False)
class Answer:
    """A path: `curve` maps (K,) times to (n, K); `state` is what solving again starts from.

    `duration` is there where it was to be found.
    """

    curve: Callable[[np.ndarray], Any]
    state: Any = None
    duration: float | None = None


@dataclass(frozen=True)
class Peer:
    """One way to solve the problems.

    Attributes
    ----------
    packages : sequence of str
        Distributions whose versions are reported.
    settings : sequence
        The ladder from rough to fine: tolerances or meshes.
    cold : callable
        `cold(case, ends, start, setting) -> Answer`, from the user's definition to the path;
        `start` names the first guess.
    again : callable
        `again(answer, case, ends, setting) -> Answer`: the same problem, other end points.
    answers : sequence of str
        The kinds of questions it can be asked, `Case.asks`.
    """

    packages: Sequence[str]
    settings: Sequence[Any]
    cold: Callable[[Case, Ends, str, Any], Answer]
    again: Callable[[Answer, Case, Ends, Any], Answer]
    answers: Sequence[str] = ("ends",)


def waypoints(case: Case, ends: Ends, start: str, times: np.ndarray):
    """Return the first guess at `times` (K,): coordinates and velocities, each (n, K)."""
    knots, points = case.guess(ends, start)
    q = np.stack([np.interp(times, knots, row) for row in points])
    slopes = np.diff(points, axis=1) / np.diff(knots)
    piece = np.clip(np.searchsorted(knots, times, side="right") - 1, 0, len(knots) - 2)
    return q, slopes[:, piece]


def tangent(case: Case, ends: Ends) -> np.ndarray:
    """Return an orthonormal basis of the velocities allowed at the start, (n, n - m)."""
    if case.normals is None:
        return np.eye(case.n)
    G = case.normals(ends.start)
    return np.linalg.svd(G)[2][len(G) :].T


def first_velocity(case: Case, ends: Ends, start: str) -> np.ndarray:
    """Return the first guess's velocity at the start, along the constraints, (n,)."""
    v = waypoints(case, ends, start, np.zeros(1))[1][:, 0]
    Z = tangent(case, ends)
    return Z @ (Z.T @ v)


def meeting(fly: Callable, v: np.ndarray, Z: np.ndarray, tol: float, roundoff: float):
    """Return the first velocity near v (n,) that meets the end, by damped Newton steps along Z.

    `fly(v)` returns the largest miss relative to the end points' size, infinite if the integration
    fails, the miss (n,) and its derivatives along the columns of Z.
    """
    size, miss, slope = fly(v)
    for _ in range(ITERATIONS):
        if not np.isfinite(size):
            raise Failed("the first trajectory cannot be integrated")
        step = Z @ np.linalg.lstsq(slope, miss, rcond=None)[0]
        for halving in range(HALVINGS):
            tried = v - step / 2**halving
            new, miss, slope = fly(tried)
            if new < max(RUNAWAY, size):
                break
        else:
            raise Failed("shooting: no step brings the end nearer")
        v, size = tried, new
        small = np.max(np.abs(step)) < tol * np.max(np.abs(v))
        if size < max(tol, roundoff) or (small and halving == 0):
            return v
    raise Failed(f"no convergence in {ITERATIONS} iterations, the end missed by {size:.0e}")


def succeeded(status: str) -> None:
    """Raise Failed unless Ipopt says that it has a point."""
    if status not in ("Solve_Succeeded", "Solved_To_Acceptable_Level"):
        raise Failed(status)


def piecewise(nodes: np.ndarray, q: np.ndarray, degree: int, times: np.ndarray) -> np.ndarray:
    """Return the curve of polynomials through every `degree` + 1 nodes in turn, (n, K).

    `nodes` (E degree + 1,) increase and neighbours share one; q has shape (n, E degree + 1).
    """
    count = (nodes.size - 1) // degree
    which = np.clip(np.searchsorted(nodes[::degree], times, side="right") - 1, 0, count - 1)
    out = np.empty((q.shape[0], times.size))
    for e in np.unique(which):
        mine = which == e
        local = slice(e * degree, (e + 1) * degree + 1)
        out[:, mine] = BarycentricInterpolator(nodes[local], q[:, local].T)(times[mine]).T
    return out
