"""Curves over the lowest pass between two places: whether a motion of an energy may take one.

String method: points on a curve descend the potential across it and are spread again (E, Ren and
Vanden-Eijnden, *J. Chem. Phys.* 126 (2007) 164103). Several curves descend at once, the straight
line and others that are bent to either side.
"""

from __future__ import annotations

import numpy as np

from actionopt.mechanics.question.problem import Problem
from actionopt.mechanics.question.scales import diagonal
from actionopt.solver.ends.durations import LINE, barrier, legs_to_rest, potential
from actionopt.tools.types import Array

# A pass is above the energy for sure if by this part of what the straight line is. Measured on 21
# random questions of 2 to 5 coordinates whose paths lead round hills: for none it was above at all.
NO_PASS = 0.25
# Ad hoc.
# Curves are bent by these parts of the way, in directions across it and against them.
BENDS = 0.4, 0.8, 1.6
# The first step of the points on a curve, in the way, what each is of the last, and the most.
FIRST_MOVE, SHORTER, MOVES = 0.15, 0.96, 80
# Steps over which the pass has to sink by this part of what it is too high.
WAITS, SINKS = 12, 0.05


def explain_pass(problem: Problem, line: Array, energy: float) -> str:
    """Return that an energy is below the potential on all curves that were tried, or nothing.

    They are beside a line (K, n) on which it is.
    """
    above = float(np.nan_to_num(potential(problem, line), nan=np.inf).max()) - energy
    curve, height = lowest_pass(problem, line, energy)
    if not height > NO_PASS * above:
        return ""
    curve = np.concatenate([curve, (curve[1:] + curve[:-1]) / 2])
    what = "is on the lowest of the curves between the events that were tried"
    return barrier(problem, problem.system, curve, energy, what)


def explain_leg(problem: Problem) -> str:
    """Return that no motion of the energy of a rest was seen to reach the event beside it.

    Empty if one may, or where a straight one does.
    """
    for a, b, energy in legs_to_rest(problem):
        line = a + np.linspace(0.0, 1.0, LINE)[:, None] * (b - a)
        if problem.system.n > 1 and barrier(problem, problem.system, line, energy):
            found = explain_pass(problem, line, energy)
            if found:
                return found
    return ""


def lowest_pass(problem: Problem, line: Array, energy: float) -> tuple[Array, float]:
    """Return a curve (K, n) over a low pass between the ends of a line, and its height less E.

    Below zero at the first curve that a motion of the energy E may take. The law's energy at rest
    is the potential; ways are measured in the units of its inertia.
    """
    first, packed, n = problem.system.pointwise("first"), problem.packed, line.shape[1]
    s, size = np.linspace(0.0, 1.0, LINE), _units(problem, line)
    ends = line[[0, -1]] / size
    way = ends[1] - ends[0]
    length = float(np.linalg.norm(way))
    aside = np.random.default_rng(0).normal(size=(len(BENDS), n))
    aside -= np.outer(aside @ way, way) / length**2
    aside *= (np.array(BENDS) * length / np.linalg.norm(aside, axis=1))[:, None]
    aside = np.concatenate([np.zeros((1, n)), aside, -aside])
    q = ends[0] + s[:, None] * way + np.sin(np.pi * s)[:, None] * aside[:, None]
    shape, at = q.shape, np.zeros((q.shape[0] * LINE, n))
    best, curve, step, lows = np.inf, line, FIRST_MOVE * length, []
    for _ in range(MOVES):
        with np.errstate(all="ignore"):
            force, _, L = first((q * size).reshape(-1, n), at, at[:, :1], packed)
            V = np.nan_to_num(-L.reshape(shape[:2]), nan=np.inf)
            force = np.nan_to_num((force * size).reshape(shape), posinf=0.0, neginf=0.0)
            high = np.maximum(V.max(axis=1), _highest_between(q, V, force))
        low = int(np.argmin(high))
        if high[low] < best:
            best, curve = float(high[low]), q[low] * size
        lows.append(best - energy)
        before = lows[-WAITS] if len(lows) >= WAITS else np.inf
        if not lows[-1] > 0 or before < (1 + SINKS) * lows[-1]:
            break
        along = q[:, 2:] - q[:, :-2]
        along /= np.maximum(np.linalg.norm(along, axis=2, keepdims=True), 1e-300)
        force = force[:, 1:-1]
        force = force - (force * along).sum(axis=2, keepdims=True) * along
        most = np.linalg.norm(force, axis=2).max(axis=1)[:, None, None]
        q[:, 1:-1] += step * force / np.where(most > 0, most, 1.0)
        step *= SHORTER
        q = _spread(q, s)
    return curve, lows[-1]


def _highest_between(q: Array, V: Array, force: Array) -> Array:
    """Return the largest potential (C,) half way between points (C, K, n), by cubics."""
    way = np.diff(q, axis=1)
    slopes = ((force[:, 1:] - force[:, :-1]) * way).sum(axis=2)
    return ((V[:, 1:] + V[:, :-1]) / 2 + slopes / 8).max(axis=1)


def _units(problem: Problem, line: Array) -> Array:
    """Return units (n,) of equal kinetic energy half way along a line; else the problem's."""
    q = line[len(line) // 2, None]
    second = problem.system.pointwise("second")(q, 0 * q, np.zeros((1, 1)), problem.packed)[2]
    with np.errstate(all="ignore"):
        units = 1 / np.sqrt(diagonal(problem.system, 2, second)[0])
    return units if np.isfinite(units).all() else problem.lengths


def _spread(q: Array, s: Array) -> Array:
    """Return points (C, K, n) on curves at parts `s` of their lengths."""
    steps = np.linalg.norm(np.diff(q, axis=1), axis=2)
    length = np.concatenate([np.zeros((len(q), 1)), np.cumsum(steps, axis=1)], axis=1)
    length /= length[:, -1:]
    k = np.clip((length[:, :, None] <= s).sum(axis=1) - 1, 0, s.size - 2)
    low, high = (np.take_along_axis(length, k + j, axis=1) for j in (0, 1))
    part = ((s - low) / np.where(high > low, high - low, 1.0))[:, :, None]
    a, b = (np.take_along_axis(q, (k + j)[:, :, None], axis=1) for j in (0, 1))
    return a + part * (b - a)
