"""Sizes of coordinates and of motions as far as the events tell: the units of the solver."""

from __future__ import annotations

from typing import Any

import numpy as np

from actionopt.mechanics.system import System
from actionopt.tools.types import Array

# What the solver measures coordinates in. Ad hoc: a unit need not be right but in its order of
# magnitude. `NEARBY`, `SHORT_MOTION`, `AMPLITUDES` and `ACCIDENTAL` a third or three times as
# large change no iteration on any scene.
NEARBY = 1e-2  # of their coordinates' size: events closer together lie far from zero
SHORT_MOTION = 0.02  # of a coordinate's size, a motion that is better measured by itself
MOTIONLESS = 1e-13  # of a coordinate's size, a motion of which the straight line tells nothing
ALONG = np.array([0.1, 0.3, 0.5, 0.7, 0.9])  # of the straight line, where it is asked
AMPLITUDES = 10.0  # |force / stiffness|, the distance to rest, that a motion may extend
ACCIDENTAL = 0.05  # of the largest coordinate, one whose size at the events may be an accident
NEGLIGIBLE = 1e-12  # a coordinate this much smaller than another is zero up to rounding


def scales_of(problem: Any) -> Array:
    """Return the size of each coordinate as far as events tell, shape (n,): always positive.

    A coordinate that is zero or free at both events is given the size of the largest; so is
    one that may be rounding of another, small beside it in whatever they are measured.
    """
    known = [[abs(x) if x is not None else 0.0 for x in e.near] for e in problem.joints_found]
    size = np.array(known).max(axis=0)
    largest = float(size.max())
    if not largest > 0:
        return np.ones(size.shape)
    nothing = size <= NEGLIGIBLE * largest
    if not nothing.any():
        return size
    if np.any(size[nothing]):  # small, or of another unit: an angle beside a distance
        natural = size * np.sqrt(_inertias(problem))
        nothing &= ~(natural > NEGLIGIBLE * np.max(natural))
    return np.where(nothing, largest, size)


def motion_of(problem: Any) -> tuple[Array, Array | None]:
    """Return `lengths` and `origin` of a problem."""
    scales = problem.scales
    if problem.system.r:  # it leads paths as far away as it is large, wherever the events lie
        scales = np.fmax(scales, _alike(scales, _inertias(problem), ACCIDENTAL))
    if problem.through or problem.system.order > 1:
        return scales, None
    pairs = list(zip(problem.start.near, problem.end.near, strict=True))
    near = [_close(a, b) for a, b in pairs]
    if not any(near) and (len(near) == 1 or scales.min() >= ACCIDENTAL * scales.max()):
        return scales, None
    close = np.array(near)
    inertia = _inertias(problem)
    with np.errstate(all="ignore"):
        size = np.where(close, _extents(problem, pairs, inertia), scales)
    size = np.fmax(size, _alike(size, inertia, np.where(close, 1.0, ACCIDENTAL)))
    far = close & (size < SHORT_MOTION * scales) & (size > MOTIONLESS * scales)
    lengths = np.where(far | ~close, size, scales)
    if not far.any():
        return lengths, None
    ends = np.array([[a or 0.0, b or 0.0] for a, b in pairs])
    return lengths, np.where(far, ends.mean(axis=1), 0.0)


def _alike(sizes: Array, inertia: Array, part: Array | float) -> Array:
    """Return parts of the sizes (n,) with as much kinetic energy as the largest; 0 if unknown."""
    with np.errstate(all="ignore"):
        units = 1 / np.sqrt(inertia)
        natural = sizes / units
        found = part * np.max(natural[np.isfinite(natural)], initial=0.0) * units
    return np.where(np.isfinite(found), found, 0.0)


def _extents(problem: Any, pairs: list[tuple[float | None, float | None]], inertia: Array) -> Array:
    """Return how far a motion near the straight line extends, (n,), as far as L tells."""
    ends = np.array([[a or 0.0, b or 0.0] for a, b in pairs])
    apart, system = ends[:, 1] - ends[:, 0], problem.system
    one = not apart.any() and not system.structure.depends_on_time  # place, as where it closes
    along = ALONG[:1] if one else ALONG
    q = ends[:, 0] + along[:, None] * apart
    v = np.repeat(apart[None] / problem.duration, along.size, axis=0)
    at = q, v, problem.start.t + along[:, None] * problem.duration, problem.packed
    force = np.abs(system.pointwise("first")(*at)[0])
    stiffness = diagonal(system, 0, system.pointwise("second")(*at)[0])
    rest = AMPLITUDES * force.max(axis=0) / stiffness.max(axis=0)
    deflection = np.fmin((force / inertia).max(axis=0) * problem.duration**2 / 8, rest)
    return np.fmax(np.abs(apart), deflection)


def _inertias(problem: Any) -> Array:
    """Return the magnitude of the diagonal of d2L/dv2 at the start, shape (n,)."""
    q = np.array([[0.0 if x is None else x for x in e.near] for e in (problem.start, problem.end)])
    second = problem.system.pointwise("second")
    v = (q[1:] - q[:1]) * (0.0 if problem.free_time else 1 / problem.duration)
    state = first_state(problem.system, q[:1], v)
    values = second(*state, np.array([[problem.start.t or 0.0]]), problem.packed)[2][0]
    return diagonal(problem.system, 2, values[None])[0]


def first_state(system: System, q: Array, v: Array) -> tuple[Array, Array]:
    """Return the arguments that a system's functions take for q and v (K, n), at constant rates."""
    if system.order == 1:
        return q, v
    rest = np.zeros((len(q), (system.order - 2) * system.n))
    return np.concatenate([q, v, rest], axis=1), np.zeros_like(v)


def diagonal(system: System, output: int, values: Array) -> Array:
    """Return the magnitudes (K, n) on the diagonal of L_qq (0) or L_vv (2) with these nonzeros."""
    rows, cols = system.pointwise("second").sparsity(output)
    found, on = np.zeros((len(values), system.n)), (rows == cols) & (rows < system.n)
    found[:, rows[on]] = np.abs(values[:, on])
    return found


def ends_of(problem: Any) -> Array:
    """Return coordinates (2, n) at both ends: a free one keeps the other's, or is zero."""
    pairs = zip(problem.start.near, problem.end.near, strict=True)
    known = [(b if a is None else a, a if b is None else b) for a, b in pairs]
    return np.array([[x or 0.0 for x in pair] for pair in known]).T


def _close(a: float | None, b: float | None) -> bool:
    """Whether two values lie together and far from zero."""
    return a is not None and b is not None and abs(b - a) < NEARBY * max(abs(a), abs(b))
