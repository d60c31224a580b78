"""All normals from a point to an ellipse or an ellipsoid.

A free body goes in unit time from a random point to a random surface x_i^2 / a_i^2 = 1, where it
arrives along the normal: `solve_all` is to find each of them, two to four on an ellipse and two to
six on an ellipsoid. Their feet are a_i^2 p_i / (a_i^2 + u), u the real roots of a polynomial; and
the index of each is that of 1 + u / a_i^2 on the tangents. One that is found and is none of these,
or of another index, is wrong.
"""

from __future__ import annotations

from functools import cache
from time import process_time

import numpy as np
from numpy.polynomial import polynomial

import actionopt as ao
from benchmarks.stress.case import Case, Criterion, Row, measured, mine
from benchmarks.stress.tally import Outcome, right_and_solved, row

TITLE = "All normals to a surface"
COUNTS = {"ellipses": (60, 4), "ellipsoids": (24, 2)}  # points, all and quick
BATCH, SEED, TOL = 12, 53, 1e-8
REAL = 1e-9  # imaginary part of a root that is real
APART = 1e-2  # of roots, as parts of the smallest a^2, that are no fold


@cache
def body(n: int) -> ao.System:
    """Return the free body in n dimensions."""
    return ao.System(lambda q, v, t: v @ v / 2, list("xyz"[:n]))


def normals(a: np.ndarray, p: np.ndarray) -> list[tuple[np.ndarray, int]] | None:
    """Return foot and index of each normal from p to x_i^2 / a_i^2 = 1; None near a fold."""
    square = a**2
    others = [np.delete(square, i) for i in range(a.size)]
    whole = -polynomial.polyfromroots(-np.repeat(square, 2))
    for s, x, rest in zip(square, p, others, strict=True):
        part = s * x**2 * polynomial.polyfromroots(-np.repeat(rest, 2))
        whole = polynomial.polyadd(whole, part)
    roots = polynomial.polyroots(whole)
    near = np.abs(roots[:, None] - roots)[np.triu_indices(roots.size, 1)]
    if near.min() < APART * square.min():
        return None
    found = []
    for u in roots[np.abs(roots.imag) < REAL * square.max()].real:
        foot = square * p / (square + u)
        tangents = np.linalg.svd((foot / square)[None])[2][1:]
        bent = tangents @ np.diag(1 + u / square) @ tangents.T
        found.append((foot, int(np.sum(np.linalg.eigvalsh(bent) < 0))))
    return found


def ask(n: int, k: int) -> list[Outcome]:
    """Return an outcome for each normal from a point, and for each path that is none."""
    random = np.random.default_rng([SEED, n, k])
    known = None
    while known is None:
        a, p = 10 ** random.uniform(-0.4, 0.4, n), random.normal(0, 1.5, n)
        known = normals(a, p)

    def on(q, t):
        return sum((q[i] / a[i]) ** 2 for i in range(n)) - 1

    problem = ao.Problem(body(n), ao.Event(0.0, p), ao.Event(1.0, None, on=on))
    clock = process_time()
    paths = list(ao.solve_all(problem, tol=TOL))
    spent = (process_time() - clock) / len(known)
    size = np.max(np.abs([foot for foot, _ in known])) + np.max(np.abs(p))
    found = np.array([path.end.q for path in paths]).reshape(-1, n)
    own = [int(np.argmin([np.linalg.norm(q - foot) for foot, _ in known])) for q in found]
    outcomes = []
    for q, path, j in zip(found, paths, own, strict=True):
        foot, index = known[j]
        off = float(np.linalg.norm(q - foot) / size) if path.morse_index == index else np.inf
        estimate, rung = float(path.error), path.stats["rung"]
        outcomes.append(Outcome("SOLVED", True, off, estimate, TOL, spent, rung=rung))
    lost = len(set(range(len(known))) - set(own))
    return outcomes + [Outcome("NOT_FOUND", False, np.nan, np.inf, TOL, spent)] * lost


def measure(n: int, first: int, count: int) -> list[Row]:
    """Return the row of some points: what is counted are normals."""
    return [row([o for k in range(first, first + count) for o in ask(n, k)])]


def cases(quick: bool) -> list[Case]:
    """Return them."""
    return [
        measured(f"{kind} {first}", measure, n, first, min(BATCH, counts[quick] - first))
        for n, (kind, counts) in enumerate(COUNTS.items(), 2)
        for first in range(0, counts[quick], BATCH)
    ]


def criteria(rows) -> list[Criterion]:
    """Return them."""
    found = []
    for kind in COUNTS:
        found += right_and_solved(f"normals of {kind}", mine(rows, f"{kind} "))
    return found
