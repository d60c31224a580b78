"""Is a path a motion? Integrate it forward again, all elements at once, and see where it ends."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

import actionopt as ao

RTOL = 1e-12


def miss(solution: ao.Solution) -> float:
    """Return how far motions that set out along the path leave it within an element.

    From the path's position and velocity at the start of every element the equations of motion
    are integrated to its end; the largest distance from the path there, in units of the largest
    |q|. Small everywhere, it says that the path is a motion, however chaotic the whole is.
    """
    problem, mesh = solution.problem, solution.mesh
    system, n = problem.system, problem.system.n
    a, h = mesh.boundaries[:-1], np.diff(mesh.boundaries)
    inside = 1e-10 * h  # the velocity jumps a little from element to element

    def rhs(s, y):
        q, v = y.reshape(2, n, -1)
        acceleration = system.acceleration(q, v, a + s * h, parameters=problem.parameters)
        return np.concatenate([h * v, h * acceleration]).ravel()

    first = np.concatenate([solution(a), solution.velocity(a + inside)])
    run = solve_ivp(rhs, (0.0, 1.0), first.ravel(), "DOP853", rtol=RTOL, atol=RTOL)
    if not run.success:
        return np.inf
    end = run.y[:, -1].reshape(2, n, -1)[0]
    return float(np.max(np.abs(end - solution(a + h))) / np.max(np.abs(solution.path.values)))
