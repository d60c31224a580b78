"""Is a path a motion? Integrate it forward again, all elements at once, and see where it ends."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import scipy.sparse as sp
from scipy.integrate import solve_ivp
from scipy.sparse.linalg import splu

import actionopt as ao

RTOL = 1e-12
STEP = 1e-6  # of q and v, by which motions are differenced


def motion(acceleration: Callable, q0, v0, T: float, tol: float) -> Callable:
    """Return q(t), (n,) or (n, K), of the motion from q0 (n,) with v0 (n,) up to T.

    `acceleration(q, v, t)` is (n,). Raises ValueError where the motion ends before.
    """
    n = len(q0)

    def rhs(t, y):
        return np.concatenate([y[n:], acceleration(y[:n], y[n:], t)])

    first = np.concatenate([q0, v0])
    run = solve_ivp(rhs, (0.0, T), first, "DOP853", rtol=tol, atol=tol, dense_output=True)
    if not run.success:
        raise ValueError(run.message)
    return lambda t: run.sol(t)[:n]


def _starts(solution: ao.Solution) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return times and lengths of the elements, (N,), and the path's states there, (2 n, N)."""
    a, h = solution.mesh.boundaries[:-1], np.diff(solution.mesh.boundaries)
    inside = 1e-10 * h  # the velocity jumps a little from element to element
    return a, h, np.concatenate([solution(a), solution.velocity(a + inside)])


def _flown(acceleration: Callable, first: np.ndarray, t: np.ndarray, h: np.ndarray):
    """Return the states (2 n, N) that motions come to from `first` at t (N,) after h (N,)."""
    n = len(first) // 2

    def rhs(s, y):
        q, v = y.reshape(2, n, -1)
        return np.concatenate([h * v, h * acceleration(q, v, t + s * h)]).ravel()

    run = solve_ivp(rhs, (0.0, 1.0), first.ravel(), "DOP853", rtol=RTOL, atol=RTOL, t_eval=[1.0])
    return run.y[:, -1].reshape(2 * n, -1) if run.success else None


def miss(solution: ao.Solution) -> float:
    """Return how far motions that set out along the path leave it within an element.

    From the path's position and velocity at the start of every element the equations of motion
    are integrated to its end; the largest distance from the path there, in units of the largest
    |q|. Small everywhere, it says that the path is a motion, however chaotic the whole is.
    """
    system, n = solution.problem.system, solution.problem.system.n
    a, h, first = _starts(solution)
    acceleration = partial(system.acceleration, parameters=solution.problem.parameters)
    end = _flown(acceleration, first, a, h)
    if end is None:
        return np.inf
    end = end[:n]
    return float(np.max(np.abs(end - solution(a + h))) / np.max(np.abs(solution.path.values)))


def distance(solution: ao.Solution, acceleration: Callable) -> float:
    """Return how far the nearest motion with the same ends is, in units of the largest |q|.

    One Newton step of multiple shooting from the path's positions and velocities at the starts of
    all elements; `acceleration(q, v, t)` is (n, K) of (n, K), (n, K) and (K,). Where the step is
    small its square, by which it is wrong, is nothing.
    """
    mesh, n = solution.mesh, solution.problem.system.n
    a, h, states = _starts(solution)
    count = a.size
    size = np.max(np.abs(solution.path.values))
    steps = STEP * np.concatenate([np.full(n, size), np.maximum(np.abs(states[n:]).max(1), size)])
    off = np.concatenate([np.zeros((2 * n, 1)), np.diag(steps)], axis=1)  # the path, and beside
    first = (states[:, None, :] + off[:, :, None]).reshape(2 * n, -1)  # (2 n, (1 + 2 n) N)
    end = _flown(acceleration, first, np.tile(a, 2 * n + 1), np.tile(h, 2 * n + 1))
    if end is None:
        return np.inf
    end = end.reshape(2 * n, 2 * n + 1, count)
    slope = (end[:, 1:] - end[:, :1]) / steps[:, None]  # (2 n, 2 n, N)
    # Unknown: changes of q and v at all starts, and of v at the last end; q is kept at both.
    goal = np.concatenate(
        [states[:, 1:], np.r_[solution(mesh.boundaries[-1]), end[n:, 0, -1]][:, None]], axis=1
    )
    missed = (goal - end[:, 0]).T.ravel()
    flow = sp.hstack(
        [sp.block_diag(list(np.moveaxis(slope, 2, 0))), sp.csc_matrix((2 * n * count, 2 * n))]
    )
    carry = sp.hstack([sp.csc_matrix((2 * n * count, 2 * n)), sp.identity(2 * n * count)])
    free = np.setdiff1d(
        np.arange(2 * n * (count + 1)), np.r_[:n, 2 * n * count : 2 * n * count + n]
    )
    step = np.zeros(2 * n * (count + 1))
    step[free] = splu(sp.csc_matrix(flow - carry)[:, free]).solve(missed)
    return float(np.max(np.abs(step.reshape(-1, 2 * n)[:, :n])) / size)
