"""Lambert's problem by lamberthub, for Kepler's problem alone: Izzo's solver, then the ellipse.

The path is Kepler's own, propagated from the start by Newton's method on Kepler's equation; an
arc of more than half a turn is asked for by its sense.
"""

from __future__ import annotations

import numpy as np
from lamberthub import izzo2015  # type: ignore[import-not-found]

from benchmarks.peers._peer import Answer, Peer, Unable
from benchmarks.problems import Case, Ends

TOLERANCES = tuple(10.0**-k for k in (3, 6, 9, 12, 14))


def propagated(q, v, times: np.ndarray) -> np.ndarray:
    """Return the positions (2, K) on the ellipse through the state (q, v), mu = 1."""
    r = np.hypot(*q)
    a = 1 / (2 / r - v @ v)
    sigma, root = q @ v, np.sqrt(a)
    # Change x of the eccentric anomaly: t / a^1.5 = x - (1 - r/a) sin x + sigma/root (1 - cos x)
    M = times / a**1.5
    x = M.copy()
    for _ in range(50):
        f = x - (1 - r / a) * np.sin(x) + sigma / root * (1 - np.cos(x)) - M
        step = f / (1 - (1 - r / a) * np.cos(x) + sigma / root * np.sin(x))
        x = x - np.clip(step, -1.0, 1.0)
        if np.max(np.abs(step)) < 1e-15:
            break
    F = 1 - a / r * (1 - np.cos(x))
    G = times - a**1.5 * (x - np.sin(x))
    return np.outer(q, F) + np.outer(v, G)


def cold(case: Case, ends: Ends, start: str, tol: float) -> Answer:
    """Solve Lambert's problem, counter-clockwise; no guess is needed."""
    if not case.name.startswith("kepler"):
        raise Unable("Kepler's problem only")
    places = [np.append(q, 0.0) for q in (ends.start, ends.end)]
    v, _ = izzo2015(1.0, *places, case.duration, prograde=True, rtol=tol, atol=tol)
    # The path is there when it can be evaluated: the table of positions is part of the work.
    propagated(ends.start, v[:2], np.linspace(0.0, case.duration, 201))
    return Answer(lambda t: propagated(ends.start, v[:2], t))


def again(answer: Answer, case: Case, ends: Ends, tol: float) -> Answer:
    """Solve anew: nothing is reused."""
    return cold(case, ends, "line", tol)


# Compiled by numba at the first call: done on import, and so not counted.
izzo2015(1.0, np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.1, 0.0]), 1.5)

PEER = Peer(("lamberthub",), TOLERANCES, cold, again)
