"""scipy's collocation and forward shooting, from the same first path, within a time limit.

Both use the accelerations that the package derives and difference them for Jacobians: what is
compared here is who finds a path. Run times are the matter of `benchmarks.work_precision`.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.integrate import solve_bvp, solve_ivp
from scipy.optimize import root

FIRST_MESH = 17
MAX_NODES = 20_000


class Failed(Exception):
    """No path; the message is the solver's own."""


def line(question) -> Callable[[np.ndarray], np.ndarray]:
    """Return the first path: the guess, or the straight line (zero where an end is free)."""
    problem, guess = question.problem, question.guess
    t0, t1 = problem.start.t, problem.end.t
    if callable(guess):
        return lambda t: np.asarray(guess(t))
    if guess is None:
        guess = np.array([problem.start.q, problem.end.q], dtype=float).T
    knots = np.linspace(t0, t1, guess.shape[1])
    return lambda t: np.stack([np.interp(t, knots, row) for row in guess])


def flow(question, deadline: float) -> Callable[[Any, np.ndarray], np.ndarray]:
    """Return d(q, v)/dt of (2 n,) or (2 n, K) states; it fails when time is over."""
    system, parameters = question.problem.system, question.problem.parameters
    n = system.n

    def rhs(t, y):
        if time.process_time() > deadline:
            raise Failed("out of time")
        try:
            a = system.acceleration(y[:n], y[n:], t, parameters=parameters)
        except (ValueError, np.linalg.LinAlgError) as error:
            raise Failed("left where the equations hold") from error
        return np.concatenate([y[n:], a])

    return rhs


def collocation(question, deadline: float):
    """Return the path of `solve_bvp`."""
    problem = question.problem
    n, q0, q1 = problem.system.n, problem.start.q, problem.end.q
    t = np.linspace(problem.start.t, problem.end.t, FIRST_MESH)
    first = line(question)(t)
    y = np.concatenate([first, np.gradient(first, t, axis=1)])
    with np.errstate(all="ignore"):
        try:
            found = solve_bvp(
                flow(question, deadline),
                lambda a, b: np.concatenate([a[:n] - q0, b[:n] - q1]),
                t,
                y,
                tol=question.tol,
                max_nodes=MAX_NODES,
            )
        except (ValueError, np.linalg.LinAlgError) as error:
            raise Failed("not a number on the way") from error
    if not found.success:
        raise Failed(found.message.split(".")[0].lower())
    return lambda t: found.sol(t)[:n]


def shooting(question, deadline: float):
    """Return the path of DOP853 with the first velocity that Powell's hybrid method finds."""
    problem = question.problem
    n, span = problem.system.n, (problem.start.t, problem.end.t)
    q0, q1 = (np.asarray(e.q, dtype=float) for e in (problem.start, problem.end))
    rhs = flow(question, deadline)
    limits = {"rtol": max(question.tol / 10, 3e-14), "atol": question.tol / 100}

    def run(v, dense=False):
        out = solve_ivp(rhs, span, np.concatenate([q0, v]), "DOP853", dense_output=dense, **limits)
        if not out.success:
            raise Failed("a trial motion ends in a singularity")
        return out

    h = 1e-3 * problem.duration
    v = (line(question)(np.array([span[0] + h]))[:, 0] - q0) / h
    with np.errstate(all="ignore"):
        try:
            found = root(lambda v: run(v).y[:n, -1] - q1, v, tol=question.tol)
            out = run(found.x, dense=True)
        except (ValueError, np.linalg.LinAlgError) as error:
            raise Failed("not a number on the way") from error
    size = max(np.max(np.abs([q0, q1])), np.max(np.abs(out.y[:n])))
    if not np.max(np.abs(out.y[:n, -1] - q1)) <= 10 * question.tol * size:
        raise Failed("no first velocity found")
    return lambda t: out.sol(t)[:n]


SOLVERS = {"solve_bvp": collocation, "shooting": shooting}
