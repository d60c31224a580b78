"""A solution at equal times: curves, energies, what is conserved."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from actionopt.analysis.solution import Solution, question
from actionopt.mechanics.conservation.symmetry import noether
from actionopt.mechanics.question.problem import Problem
from actionopt.plot.data.arguments import check_arguments
from actionopt.plot.data.latest import latest
from actionopt.tools.checks import numbers
from actionopt.tools.immutable import immutable
from actionopt.tools.shown import one_line
from actionopt.tools.types import Array

CURVE_TIMES = 600  # times at which a curve is drawn: more than a picture has columns for
Kinetic = Callable[[Array, Array, Array], Array]  # T of q, v (n, K) and t
FLAT_CHANGE = 1e-6  # relative to the size of what is drawn: a smaller change is not one


def times(solution: Solution, count: int = CURVE_TIMES) -> Array:
    """Return equal times over the solution, both events' included."""
    return np.linspace(solution.problem.start.t, solution.problem.end.t, count)


@immutable
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

    __repr__ = one_line


@check_arguments
def curves(solution: Solution, count: int = CURVE_TIMES) -> Curves:
    """Return the arrays behind the pictures at `count` equal times; the comparison is made."""
    t = times(solution, count)
    q, forward = solution(t), forward_values(solution, t)
    size = np.max(np.abs(q), axis=1, keepdims=True)
    size[size <= 1e-12 * np.max(size)] = np.max(size) or 1.0  # zero but for round-off
    return Curves(t, q, forward, np.max(np.abs(forward - q) / size, axis=0))


def forward_values(solution: Solution, t: Array) -> Array:
    """Return the forward integration at the times t (K,), NaN beyond where it ends: (n, K)."""
    path = solution.compare().path
    result = np.full((solution.problem.system.n, t.size), np.nan)
    if path is not None:
        there = t <= path.mesh.boundaries[-1]
        result[:, there] = path(t[there])
    return result


@immutable
class Energies:
    """Kinetic and potential energy at K times, (K,), V = T - L.

    Attributes
    ----------
    t, kinetic, potential : (K,) arrays
    told : bool
        Whether T was given. L alone does not tell it: what moving coordinates leave of T at rest
        looks like a potential. T is then the part of L that is even in the velocities and
        vanishes at rest, and V the effective potential.
    quadratic : bool
        Whether T, of the path's velocities, is.
    moving : bool
        Whether V depends on the velocities, as in a magnetic field (Goldstein, 3rd ed.,
        section 1.5).
    """

    t: Array
    kinetic: Array
    potential: Array
    told: bool
    quadratic: bool
    moving: bool

    __repr__ = one_line


@check_arguments
def energies_data(
    solution: Solution, count: int = CURVE_TIMES, *, kinetic: Kinetic | None = None
) -> Energies:
    """Return T and V along the path, each (count,), at equal times.

    `kinetic(q, v, t)` is T in a frame at rest, (K,) for q and v of shape (n, K), as a scene's
    `kinetic` is.
    """
    t, problem = times(solution, count), solution.problem
    q, v = solution(t), solution.velocity(t)
    system = problem.plain or problem.system  # S is the integral of L alone
    parameters = {name: problem.parameters[name] for name in system.table.shapes}

    def lagrangian(v: Array) -> Array:
        return system.lagrangian(q, v, t, parameters=parameters)

    def even(q: Array, v: Array, t: Array) -> Array:
        return (lagrangian(v) + lagrangian(-v)) / 2 - lagrangian(0 * v)

    if not (kinetic is None or callable(kinetic)):
        raise ValueError(f"expected kinetic(q, v, t), the kinetic energy, found {kinetic!r}")
    T = kinetic or even
    what = "kinetic(q, v, t), T at K times"
    here, rest, twice = (numbers(T(q, factor * v, t), what) for factor in (1, 0, 2))
    if not here.shape == rest.shape == twice.shape == t.shape:
        raise ValueError(f"expected {what}, found the shape {here.shape} at {t.size} times")
    V, V_rest = here - lagrangian(v), rest - lagrangian(0 * v)
    size = FLAT_CHANGE * max(np.max(np.abs(here)), np.max(np.abs(V)))
    return Energies(
        t,
        here,
        V,
        told=kinetic is not None,
        quadratic=bool(np.all(np.abs(twice - 4 * here) <= size)),
        moving=bool(np.any(np.abs(V - V_rest) > size)),
    )


@immutable
class ConservedCurves:
    """Energy function and momenta at K times.

    Attributes
    ----------
    t, energy : (K,) arrays
    momentum : (n, K) array
    flat : tuple of bool
        Whether H, and each momentum, stays the same.
    kept : tuple of bool
        Whether a symmetry has it stay the same along every motion: H if nothing depends on time,
        the momentum of a cyclic coordinate.
    angular : (K,) array or None
        The angular momentum in the planes of x and y, if turning them changes nothing and it stays
        the same.
    """

    t: Array
    energy: Array
    momentum: Array
    flat: tuple[bool, ...]
    kept: tuple[bool, ...]
    angular: Array | None = None

    __repr__ = one_line


@check_arguments
@latest
def conserved_data(solution: Solution, count: int = CURVE_TIMES) -> ConservedCurves:
    """Return H and p along the path at equal times, which of them are constant, and which must."""
    t = times(solution, count)
    H, p, order = solution.energy(t), solution.momentum(t), solution.problem.system.order
    v = np.concatenate(solution.derivatives(t)[1 : order + 1])  # of each momentum's coordinate
    work = np.max(np.abs(p * v))  # v . p is the part of H that momenta make up
    speeds = np.maximum(np.max(np.abs(v), axis=1), 1e-300)
    sizes = [max(work, np.max(np.abs(H))), *np.maximum(work / speeds, np.max(np.abs(p), axis=1))]
    rows = [H, *p]
    flat = [bool(np.ptp(x) <= FLAT_CHANGE * size) for x, size in zip(rows, sizes, strict=True)]
    shifts = np.eye(1 + solution.problem.system.n)  # in time, and of each coordinate
    kept = [
        same and _symmetric(solution.problem, list(map(float, xi)), float(time))
        for same, (time, *xi) in zip(flat, shifts, strict=False)
    ]
    kept += [False] * (len(rows) - len(kept))  # no velocity is shifted alone
    angular = _angular_momentum(solution, t, p) if order == 1 else None
    return ConservedCurves(t, H, p, tuple(flat), tuple(kept), angular)


def _angular_momentum(solution: Solution, t: Array, p: Array) -> Array | None:
    """Return sum (x p_y - y p_x), (K,), if all planes of x and y may be turned by one angle.

    What stands at events between the ends may still hold the path: then it is not the same in all.
    """
    problem, names = solution.problem, list(solution.problem.system.coordinates)
    pairs = [
        (names.index(name), names.index(f"y{name[1:]}"))
        for name in names
        if name[:1] == "x" and f"y{name[1:]}" in names
    ]

    def turn(q: Any, t: Any) -> list[Any]:
        rates = [0.0 * q[0]] * len(names)
        for i, j in pairs:
            rates[i], rates[j] = -q[j], q[i]
        return rates

    if not pairs or not _symmetric(problem, turn):
        return None
    q = solution(t)
    found = np.sum([q[i] * p[j] - q[j] * p[i] for i, j in pairs], axis=0)
    size = np.max(np.abs(q)) * np.max(np.abs(p))
    return found if np.ptp(found) <= FLAT_CHANGE * size else None


def _symmetric(problem: Problem, rates: Any, time: float = 0.0) -> bool:
    """Return whether nothing changes by these rates of the coordinates and of the time."""
    try:
        noether(
            problem.system, rates, time=time, gauge=lambda q, t: 0.0, parameters=problem.parameters
        )
    except ValueError:
        return False
    return True


@check_arguments
def family_data(
    solutions: Iterable[Solution], count: int = CURVE_TIMES
) -> tuple[Array, Array, Array]:
    """Return times (K,), paths (P, n, K) and actions (P,) of several solutions."""
    found = list(solutions)
    if not found:
        raise ValueError("expected at least one solution, found none")
    for solution in found:
        question(solution)
    t = times(found[0], count)
    return t, np.array([s(t) for s in found]), np.array([s.action for s in found])


@check_arguments
def mesh_data(solution: Solution) -> tuple[Array, Array]:
    """Return the element boundaries (N + 1,) and degrees (N,) of the adaptive mesh."""
    return np.array(solution.mesh.boundaries), np.array(solution.mesh.degrees)
