"""From a problem to a solution: find a path on a coarse mesh, then follow it to the tolerance.

Finding (`search`) and following (`settle`) are different work, on the same path under way (`walk`).
*Finding* starts from the straight line, or from a guess. *Following* is Newton's: each refinement
round carries the path to a better mesh and polishes it there, always the same path.
"""

from __future__ import annotations

from time import perf_counter
from typing import Any, Literal

import numpy as np

from actionopt.arguments import Guess, checked
from actionopt.path import Mesh
from actionopt.problem import Problem
from actionopt.search import Search
from actionopt.solution import Solution
from actionopt.status import SolveError, Status
from actionopt.walk import ROUNDOFF, Walk


def solve(
    problem: Problem,
    *,
    tol: float = 1e-8,
    guess: Guess | None = None,
    principle: Literal["auto", "least", "stationary"] = "auto",
    mesh: Mesh | None = None,
    throw: bool = True,
) -> Solution:
    """Return the path between the events of `problem` that makes its action stationary.

    Parameters
    ----------
    problem : Problem
        The system and the two events.
    tol : float
        Bound on the maximum over time of |q_h(t) - q(t)|, each coordinate in units of the
        largest |q| it reaches; between 1e-14 and 0.1.
    guess : Path, Solution, callable or array, optional
        A curve near the path wanted: a callable of (K,) times returning (n, K), or waypoints
        (n, K) at equal times. With a guess the stationary path near it is returned; without
        one, a least path if there is one, else a stationary one.
    principle : {"auto", "least", "stationary"}
        What to ask of the action.
    mesh : Mesh, optional
        Solve on this mesh and do not refine.
    throw : bool
        Raise on failure; otherwise return the best attempt with its `status`.

    Raises
    ------
    ValueError
        For bad input, before any solver runs.
    SolveError
        If no path was found or the tolerance was not met; it carries the best attempt.
    KeyboardInterrupt
        If interrupted, also from within Ipopt.

    References
    ----------
    *Competitive Physics: Mechanics and Waves* (2018), sections 12.1-12.4; Marsden and West,
    *Discrete mechanics and variational integrators*, Acta Numerica 10 (2001), sections 1.2
    and 2.2.
    """
    started = perf_counter()
    curve_of = checked(problem, tol, guess, principle, mesh)
    system = problem.system
    walk = Walk(problem, system.structure.linear, tol, refines=mesh is None)
    for name in ("first", "second"):
        system.pointwise(name)
    walk.time["derive"] += perf_counter() - started
    search = Search(walk, tol, principle, mesh)
    status = Status.NOT_FOUND
    if isinstance(guess, Solution) and isinstance(guess.problem, Problem) and guess.success:
        walk.gain = guess.stats["gain"]  # a neighbour is as sensitive
        if guess.problem.system is system:
            walk.many = mesh is None or mesh is guess.mesh
            if np.array_equal(problem.packed, guess.problem.packed):
                walk.units, walk.checked = guess.discrete[0], True
                status = search.from_neighbour(guess)
    if status not in (Status.NOT_FOUND, Status.UNRESOLVED):
        pass
    elif walk.linear:
        status = search.solve_linear(curve_of)
    elif curve_of is not None:
        status = search.from_guess(curve_of)
    else:
        status = search.from_nothing()
    if principle == "least" and status.success and walk.index() > 0:
        status = Status.UNBOUNDED if walk.linear else Status.NOT_LEAST
    solution = _solution(walk, status, search.rung, started)
    if throw and not solution.success:
        raise SolveError(_message(walk, status, tol), solution)
    return solution


def _message(walk: Walk, status: Status, tol: float) -> str:
    name = walk.problem.name
    figures = f"tol = {tol:g}, error estimate {walk.error:.2g}"
    if status in (Status.FLOOR, Status.DEGENERATE):
        figures += f", condition about {walk.noise / ROUNDOFF:.1g}"
    hint = ""
    if walk.problem.advance is not None and not walk.problem.start.pinned:
        hint = "; a closed path may start anywhere along itself: give one coordinate at the start"
    return f"{name}: {status.value} ({figures}){hint}"


def _solution(walk: Walk, status: Status, rung: str, started: float) -> Solution:
    tr, z, layout = walk.tr, walk.z, walk.tr.layout
    clock = perf_counter()
    path = walk.path()
    action = tr.action(z[: layout.unknowns]) * tr.action_unit
    if status.success and not np.isfinite(action):
        status = Status.UNRESOLVED
    tr.forget()  # many solutions may be kept
    walk.time["verify"] += perf_counter() - clock
    walk.time["total"] = perf_counter() - started
    stats: dict[str, Any] = {
        "rung": rung,
        "unknowns": layout.unknowns,
        "rows": layout.rows,
        "iterations": dict(walk.iterations),
        "evaluations": dict(walk.evaluations),
        "rounds": walk.rounds,
        "gain": walk.gain,
        "noise": walk.noise,
        "condition": max(walk.noise / ROUNDOFF, 1.0),
        "derived": walk.problem.system.derived,
        "time": dict(walk.time),
    }
    solution = Solution(walk.problem, path, action, tr.unpack(z)[1].T, walk.error, status, stats)
    solution.__dict__["discrete"] = (tr, z)  # at hand already: nothing to rebuild
    return solution
