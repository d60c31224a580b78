"""Motions of one coordinate that leave a centre from rest and nearly reach another rest: guesses.

From where the mass vanishes one motion sets out for each q(0). Some pass the equilibrium that is
wanted at the end, others turn back before it; between the two lies one that tends to it.

References: Coleman, *Phys. Rev. D* 15 (1977) 2929, section III, overshoot and undershoot.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from actionopt.mechanics.question.problem import Problem
from actionopt.tools.types import Array

# Ad hoc.
# of distances from the equilibrium, either side of one; and how many
DISTANCE_DECADES, STARTS = 4.0, 240
BESIDE_REST = np.geomspace(1e-12, 0.5, 40)  # of the distance to another equilibrium, beside it
# of Runge and Kutta's method, and where it begins, in the window
RUNGE_STEPS, FIRST_DISTANCE = 600, 1e-3
BRACKET_ROUNDS, BRACKET_PARTS = 6, 24  # in each of which a bracket is cut in so many parts
LOST_BEYOND = 1e3  # times the first distance


def guesses(problem: Problem, rest: float) -> Iterator[Callable[[Array], Array]]:
    """Yield curves from the start of the problem, whose coordinate is free there, to `rest`."""
    size = abs(rest) or 1.0
    away = size * np.geomspace(10**-DISTANCE_DECADES, 10**DISTANCE_DECADES, STARTS)
    starts = np.unique(np.concatenate([rest - away, rest + away]))
    force = _acceleration(problem, starts, 0 * starts, FIRST_DISTANCE)
    turns = np.flatnonzero(np.sign(force[1:]) != np.sign(force[:-1]))
    extra = []
    for k in turns:
        low, high = starts[k], starts[k + 1]
        for _ in range(60):
            middle = (low + high) / 2
            same = np.sign(
                _acceleration(problem, np.array([middle]), np.zeros(1), FIRST_DISTANCE)[0]
            )
            low, high = (middle, high) if same == np.sign(force[k]) else (low, middle)
        if abs(low - rest) > 1e-6 * size:
            extra += [low + sign * BESIDE_REST * abs(low - rest) for sign in (-1, 1)]
    starts = np.unique(np.concatenate([starts, *extra]))
    starts = starts[np.abs(starts - rest) > 0]
    passed, _ = _fates(problem, starts, rest)
    for k in np.flatnonzero(passed[1:] != passed[:-1]):
        low, high = starts[k], starts[k + 1]
        if (low - rest) * (high - rest) < 0:
            continue
        for _ in range(BRACKET_ROUNDS):
            inner = np.linspace(low, high, BRACKET_PARTS + 1)
            fate, _ = _fates(problem, inner, rest)
            j = int(np.flatnonzero(fate[1:] != fate[:-1])[0])
            low, high = inner[j], inner[j + 1]
        t, q = _fates(problem, np.array([low]), rest)[1]
        nearest = int(np.argmin(np.abs(q - rest)))
        t, q = t[: nearest + 1], q[: nearest + 1]
        far = np.append(t, t[-1] + (t[-1] - t[0]) / RUNGE_STEPS)
        yield lambda at, far=far, q=q: np.interp(at, far, np.append(q, rest))[None]


def _fates(problem: Problem, starts: Array, rest: float) -> tuple[Array, tuple[Array, Array]]:
    """Return whether motions from rest at the centre pass `rest`, (K,), and the first one's curve.

    The others turn back, or run away.
    """
    t0, T = problem.start.t, problem.duration
    h = (1 - FIRST_DISTANCE) * T / RUNGE_STEPS
    q, v, t = starts.copy(), 0 * starts, FIRST_DISTANCE * T
    side, passed = np.sign(starts - rest), np.zeros(starts.size, dtype=bool)
    over = passed.copy()
    times, curve = [t0], [starts[0]]
    with np.errstate(all="ignore"):
        for _ in range(RUNGE_STEPS):
            parts = []
            for c, last in ((0.0, None), (0.5, 0), (0.5, 1), (1.0, 2)):
                dq, dv = (0.0, 0.0) if last is None else parts[last]
                here, rate = q + c * h * dq, v + c * h * dv
                parts.append((rate, _acceleration(problem, here, rate, (t + c * h) / T)))
            (q1, v1), (q2, v2), (q3, v3), (q4, v4) = parts
            q = np.where(over, q, q + h / 6 * (q1 + 2 * q2 + 2 * q3 + q4))
            v = np.where(over, v, v + h / 6 * (v1 + 2 * v2 + 2 * v3 + v4))
            t += h
            passed |= ~over & (side * (q - rest) < 0)
            over |= passed | (side * v > 0) & (np.abs(v) * T > 1e-9 * np.abs(starts - rest))
            over |= ~(np.abs(q - rest) < LOST_BEYOND * np.abs(starts - rest))
            if not over[0]:
                times.append(t0 + t)
                curve.append(q[0])
            if over.all():
                break
    return passed, (np.array(times), np.array(curve))


def _acceleration(problem: Problem, q: Array, v: Array, part: float) -> Array:
    """Return the accelerations (K,) of one coordinate at a part of the window."""
    t = problem.start.t + part * problem.duration
    return problem.system.acceleration(
        q[None], v[None], np.full(q.size, t), parameters=problem.parameters
    )[0]
