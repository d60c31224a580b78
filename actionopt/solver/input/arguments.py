"""The arguments of a solve: checked before any solver runs, the guess made a curve."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from actionopt.analysis.solution import Solution
from actionopt.discrete.meshes.boundaries import carry_boundaries
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.meshes.path import Path
from actionopt.mechanics.question.consistency import check_integrals
from actionopt.mechanics.question.course import check_phase
from actionopt.mechanics.question.problem import Problem
from actionopt.mechanics.system import System
from actionopt.tools.checks import among, numbers, tolerance
from actionopt.tools.immutable import immutable
from actionopt.tools.types import Array

Guess = Path | Solution | Callable[[Array], ArrayLike] | ArrayLike


@immutable
class Sampled:
    """A guess that is known at all times and has no mesh, as a function of the one to use."""

    at: Callable[[Array], Array]  # of times (K,): new arrays (n, K)

    def __call__(self, mesh: Mesh) -> Path:
        """Return the path through the guess at the nodes. Raises ValueError if it is not finite."""
        return Path.through(mesh, self.at(mesh.nodes))


def check_arguments(
    problem: Problem,
    tol: float,
    guess: Guess | None,
    principle: str,
    mesh: Mesh | None,
) -> Callable[[Mesh], Path] | None:
    """Raise ValueError for bad arguments; return the guess as a function of a default mesh."""
    check_problem(problem)
    tolerance(tol)
    if not among(principle, ("auto", "least", "stationary")):
        raise ValueError(f"expected principle 'auto', 'least' or 'stationary', found {principle!r}")
    if principle == "least" and problem.system.structure.forced:
        raise ValueError(
            "expected principle 'stationary' or 'auto' for a system with non-conservative "
            "forces, found 'least': they enter as virtual work, and no functional is minimised"
        )
    if problem.system.r and principle == "stationary":
        raise ValueError(
            "expected principle 'least' or 'auto' for a system with an obstacle, found "
            "'stationary': what an obstacle holds is a least path, and others have to be "
            "pulled as well; leave the obstacle out for stationary paths"
        )
    if mesh is not None:
        if not isinstance(mesh, Mesh):
            raise ValueError(f"expected a Mesh(boundaries, degrees), found {mesh!r}")
        times = problem.start.t, problem.end.t
        if None not in times and times != (mesh.boundaries[0], mesh.boundaries[-1]):
            raise ValueError(
                f"expected a mesh from {problem.start.t} to {problem.end.t}, the times of the "
                f"events, found {mesh.boundaries[0]} to {mesh.boundaries[-1]}; "
                "use mesh.moved(start, end)"
            )
    if problem.integral is not None:
        check_integrals(problem)
    return None if guess is None else curve(problem, guess)


def check_problem(problem: Problem, others: Sequence[Any] = ()) -> None:
    """Raise ValueError if there is no problem, TypeError for `others` given without their names.

    And ValueError where nothing tells where a closed path begins.
    """
    if not isinstance(problem, Problem):
        hint = "; make one of the system and the events" if isinstance(problem, System) else ""
        if isinstance(problem, Solution):
            hint = "; give its problem, and the solution as the guess"
        raise ValueError(f"expected a Problem(system, start, end), found {problem!r}{hint}")
    if others:
        raise TypeError(
            "expected the problem, and whatever else by its name, such as tol=1e-8, found also "
            f"{', '.join(map(repr, others))}"
        )
    asked = problem.original
    if (asked.through and asked.may_be_shifted) or asked.closes:
        check_phase(asked)


def read_guess(problem: Problem, guess: Any) -> Guess | None:
    """Return a guess, also of another package's (`read_curve`), as one of `Guess`.

    A curve of another package is stretched over the times of the events, if these are given.
    Raises ValueError for a table without the coordinates, or a curve of other ones.
    """
    if guess is None or isinstance(guess, Solution | Path):
        return guess
    from actionopt.solver.input.other_curves import read_curve

    path = read_curve(guess, problem.system.coordinates)
    if path is None or problem.free_time:
        return guess if path is None else path
    known, (t0, t1) = path, (problem.start.t, problem.end.t)
    first, last = known.mesh.boundaries[[0, -1]]
    rate = (last - first) / (t1 - t0) if np.isfinite(t1 - t0) else 1.0
    since = t0 if np.isfinite(t0) else first
    return lambda t: known(np.clip(first + rate * (t - since), first, last))


def curve(problem: Problem, guess: Guess) -> Callable[[Mesh], Path]:
    """Return the guess as a path, a function of the mesh to use where it has none of its own.

    Raises ValueError if its shape does not fit the problem, or it is not finite.
    """
    t0, t1, n = problem.start.t, problem.end.t, problem.system.n
    old = new = ()
    if isinstance(guess, Solution):
        if isinstance(guess.problem, Problem):
            old, new = guess.problem.instants, problem.instants
        guess = guess.path
    if isinstance(guess, Path):
        known = guess
        if known.values.shape[0] != n:
            raise ValueError(f"expected a guess of {n} coordinates, found {known.values.shape[0]}")
        if problem.advance is not None and known.mesh.elements == 1:  # no path on one closes
            since, degrees = known.mesh.since, np.repeat(known.mesh.degrees, 2)
            halves = np.array([0.0, since[-1] / 2, since[-1]])
            known = known.on(Mesh.over(*known.mesh.boundaries.tolist(), halves, degrees))
        return lambda mesh: Path(carry_boundaries(known.mesh, old, new, t0, t1), known.values)
    if callable(guess):
        known_at = checked_curve(guess, n)
        known_at(np.array([t0, (t0 + t1) / 2, t1]))  # raises
        return Sampled(known_at)
    points = waypoints(guess, n)
    from actionopt.analysis.quadratic.shooting import hermite

    times = np.linspace(t0, t1, points.shape[1])
    return Sampled(hermite(times, points, _rates(problem, times, points)))


def checked_curve(guess: Callable[[Array], Any], n: int) -> Callable[[Array], Array]:
    """Return a callable guess, which raises ValueError where it does not return (n, K)."""

    def values_at(t: Array) -> Array:
        values, K = numbers(guess(t), "the guess at times t"), t.size
        if values.shape != (n, K) and not (n == 1 and values.shape == (K,)):
            raise ValueError(
                f"expected the guess to return ({n}, K) for K times, one column a time, found "
                f"shape {values.shape} for {K} times; a constant is c + 0 * t"
            )
        return values.reshape(n, K)

    return values_at


def waypoints(guess: Any, n: int) -> Array:
    """Return waypoints (n, K). Raises ValueError for another shape, or if they are not finite."""
    points = np.atleast_2d(numbers(guess, "the guess, a callable or waypoints"))
    if points.ndim != 2 or points.shape[0] != n or points.shape[1] < 2:
        raise ValueError(f"expected waypoints of shape ({n}, K) with K >= 2, found {points.shape}")
    if not np.all(np.isfinite(points)):
        raise ValueError("expected finite waypoints, found NaN or infinity")
    return points


def _rates(problem: Problem, times: Array, points: Array) -> Array:
    """Return the rates (n, K) with which a path passes waypoints (n, K), also where it closes."""
    rates = np.gradient(points, times, axis=1, edge_order=min(points.shape[1] - 1, 2))
    if problem.advance is not None:
        order, before = list(problem.order), np.empty(len(points))
        before[order] = points[:, -2] - problem.advance
        rates[:, 0] = (points[:, 1] - before) / (2 * (times[1] - times[0]))
        rates[:, -1] = rates[order, 0]
    return rates
