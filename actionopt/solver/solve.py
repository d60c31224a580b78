"""Ask for a path: the arguments of `solve` checked, and the first acceptable answer returned."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal, Never

import numpy as np

from actionopt.analysis.solution import Solution, SolveError
from actionopt.analysis.status import Status
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.mechanics.question.problem import Problem
from actionopt.solver.input.arguments import Guess, check_problem
from actionopt.solver.kinds.between import Choices
from actionopt.solver.pursue import first_acceptable, is_moving
from actionopt.solver.search.strategies import CHEAP, GUESS_ONLY, IPOPT, STRATEGIES
from actionopt.tools.blas import one_thread
from actionopt.tools.checks import among, flag
from actionopt.tools.watch import Progress, Watch

BY_METHOD = {"auto": STRATEGIES, "ipopt": IPOPT}  # by method


@one_thread
def solve(
    problem: Problem,
    *others: Never,
    tol: float = 1e-8,
    guess: Guess | None = None,
    principle: Literal["auto", "least", "stationary"] = "auto",
    method: Literal["auto", "ipopt"] = "auto",
    mesh: Mesh | None = None,
    seconds: float | None = None,
    progress: Progress | None = None,
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
    method : {"auto", "ipopt"}
        Which ways lead to a first path: "auto" tries our own (Newton's method, Levenberg and
        Marquardt's, a descent, an ascent in free ends, a homotopy, motions that meet) and Ipopt,
        each where it is best; "ipopt" asks Ipopt alone, between given events also where others
        are to be found. It is followed from mesh to mesh by Newton's method.
    mesh : Mesh, optional
        Solve on this mesh and do not refine. It is stretched over times that are to be found, and
        cut where contact with an obstacle begins and ends.
    seconds : float, optional
        The time it may take, a little more where one evaluation takes long; then the best attempt
        is what there is. Ways that take longer, at the pace so far, are tried after the others.
        Without it, a search that finds nothing ends at a cost that is counted, in evaluations of
        second derivatives.
    progress : callable, optional
        `progress(stage, done, total, detail)` at every iteration: the strategy that is being
        tried, the iterations so far, None (nobody knows how many there will be), and
        {"elements": those of the mesh at hand}. What it raises ends the solve.
    throw : bool
        Raise on failure; otherwise return the best attempt with its `status`.

    Raises
    ------
    ValueError
        For bad input, before any solver runs.
    TypeError
        For more than the problem without a name.
    SolveError
        If no path was found or the tolerance was not met; it carries the best attempt.
    KeyboardInterrupt
        If interrupted, also from within Ipopt; so for whatever else a signal handler raises.

    References
    ----------
    *Competitive Physics: Mechanics and Waves* (2018), sections 12.1-12.4; Marsden and West,
    *Discrete mechanics and variational integrators*, Acta Numerica 10 (2001), sections 1.2
    and 2.2.
    """
    if others:
        check_problem(problem, others)
    check_problem(problem)
    if not among(method, BY_METHOD):
        raise ValueError(f"expected method 'auto' or 'ipopt', found {method!r}")
    if method == "ipopt":
        from actionopt.solver.refinement.ipopt import ABSENT, is_there

        problem.system.check_order("method 'ipopt'")
        if not is_there():
            raise ValueError(f"expected another method than 'ipopt': {ABSENT}")
    flag(throw, "throw")
    watch = None if seconds is progress is None else Watch(seconds, progress)
    choices = Choices(tol, principle, BY_METHOD[method], mesh, watch)
    solution, message = first_acceptable(problem, guess, choices)
    if throw and not solution.success:
        raise SolveError(message, solution)
    return solution


@one_thread
def solve_near(problem: Problem, guess: Guess | None, tol: float) -> Solution:
    """Return the path near a guess, or the best attempt, as `solve` does.

    Only Newton's and Levenberg and Marquardt's methods are tried, or without a guess the descent
    from the straight line: where there is no path near, that takes a hundredth of the time.
    """
    check_problem(problem)
    strategies = CHEAP if guess is None else GUESS_ONLY
    return first_acceptable(problem, guess, Choices(tol, "auto", strategies, None, None))[0]


def refuse_rest(solution: Solution) -> Solution:
    """Return a solution, NOT_FOUND if it is at rest where a motion is sought.

    A motion is sought where a path closes anywhere along itself, or tends to rest.
    """
    problem = solution.problem
    sought = problem.closes or problem.leads_to_rest
    if not sought or not solution.success or is_moving(solution):
        return solution
    return replace(solution, status=Status.NOT_FOUND, error=np.inf)
