"""A solution at equal times: curves, energies, what is conserved."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from actionopt.analysis.solution import Solution
from actionopt.tools.types import Array

COUNT = 600  # times at which a curve is drawn: more than a picture has columns for
FLAT = 1e-6  # change relative to the size of what is drawn that is no change


def times(solution: Solution, count: int = COUNT) -> Array:
    """Return equal times over the solution, both events' included."""
    return np.linspace(solution.problem.start.t, solution.problem.end.t, count)


@dataclass(frozen=True, eq=False)
class Curves:
    """What the pictures show, at K times.

    Attributes
    ----------
    t : (K,) array
        Times, both events' included.
    q, forward : (n, K) arrays
        The solution, and the forward integration from its start; NaN where that cannot be followed.
    deviation : (K,) array
        Largest |forward - q| of all coordinates, each in units of the largest |q| it reaches.
    """

    t: Array
    q: Array
    forward: Array
    deviation: Array


def curves(solution: Solution, count: int = COUNT) -> Curves:
    """Return the arrays behind the pictures at `count` equal times; the comparison is made."""
    t = times(solution, count)
    q, forward = solution(t), followed(solution, t)
    size = np.max(np.abs(q), axis=1, keepdims=True)
    size[size <= 1e-12 * np.max(size)] = np.max(size) or 1.0  # zero but for round-off
    return Curves(t, q, forward, np.max(np.abs(forward - q) / size, axis=0))


def followed(solution: Solution, t: Array) -> Array:
    """Return the forward integration at the times t (K,), NaN beyond where it ends: (n, K)."""
    path = solution.compare().path
    result = np.full((solution.problem.system.n, t.size), np.nan)
    if path is not None:
        there = t <= path.mesh.boundaries[-1]
        result[:, there] = path(t[there])
    return result


@dataclass(frozen=True, eq=False)
class Energies:
    """Kinetic and potential energy at K times, (K,): T is even in the velocities, V = T - L.

    T vanishes at rest. In a magnetic field or moving coordinates, where L is partly odd in the
    velocities, V is the potential that depends on velocity (Goldstein, 3rd ed., section 1.5).
    """

    t: Array
    kinetic: Array
    potential: Array


def energies_data(solution: Solution, count: int = COUNT) -> Energies:
    """Return T and V along the path, each (count,), at equal times."""
    t, problem = times(solution, count), solution.problem
    q, v = solution(t), solution.velocity(t)
    L, back, rest = (
        problem.system.lagrangian(q, sign * v, t, parameters=problem.parameters)
        for sign in (1, -1, 0)
    )
    T = (L + back) / 2 - rest
    return Energies(t, T, T - L)


@dataclass(frozen=True, eq=False)
class Conserved:
    """Energy function and momenta at K times.

    Attributes
    ----------
    t, energy : (K,) arrays
    momentum : (n, K) array
    flat : tuple of bool
        Whether H, and each momentum, stays the same.
    """

    t: Array
    energy: Array
    momentum: Array
    flat: tuple[bool, ...]


def conserved_data(solution: Solution, count: int = COUNT) -> Conserved:
    """Return H and p along the path at equal times, and which of them are constant."""
    t = times(solution, count)
    H, p, v = solution.energy(t), solution.momentum(t), solution.velocity(t)
    work = np.max(np.abs(p * v))  # v . p is the part of H that momenta make up
    speeds = np.maximum(np.max(np.abs(v), axis=1), 1e-300)
    sizes = [max(work, np.max(np.abs(H))), *np.maximum(work / speeds, np.max(np.abs(p), axis=1))]
    rows = [H, *p]
    flat = [bool(np.ptp(x) <= FLAT * size) for x, size in zip(rows, sizes, strict=True)]
    return Conserved(t, H, p, tuple(flat))


def family_data(solutions: Iterable[Solution], count: int = COUNT) -> tuple[Array, Array, Array]:
    """Return times (K,), paths (P, n, K) and actions (P,) of several solutions."""
    found = list(solutions)
    if not found:
        raise ValueError("expected at least one solution, found none")
    t = times(found[0], count)
    return t, np.array([s(t) for s in found]), np.array([s.action for s in found])


def mesh_data(solution: Solution) -> tuple[Array, Array]:
    """Return the element boundaries (N + 1,) and degrees (N,) of the adaptive mesh."""
    return np.array(solution.mesh.boundaries), np.array(solution.mesh.degrees)
