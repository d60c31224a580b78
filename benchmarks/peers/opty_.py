"""opty: direct collocation of sympy's equations of motion, compiled with Cython, and Ipopt.

Its midpoint rule is of second order; its settings are numbers of nodes.
"""

from __future__ import annotations

import numpy as np
import opty  # type: ignore[import-not-found]
import sympy as sm
from scipy.interpolate import CubicHermiteSpline
from sympy.physics import mechanics as me

from benchmarks.arithmetic import elementwise
from benchmarks.peers._peer import Answer, Failed, Peer, Unable, waypoints
from benchmarks.problems import Case, Ends

NODES = (201, 1001)


def build(case: Case, ends: Ends, nodes: int):
    """Write the equations down and compile the program."""
    n, t = case.n, me.dynamicsymbols._t
    q, v = (np.array([me.dynamicsymbols(f"{x}{k}") for k in range(n)], dtype=object) for x in "qv")
    a = case.acceleration(q, v, t, elementwise(sm))
    first = [x.diff(t) - y for x, y in zip(q, v, strict=True)]
    second = [y.diff(t) - z for y, z in zip(v, a, strict=True)]
    T = case.duration
    conditions = [x.func(0.0) - float(z) for x, z in zip(q, ends.start, strict=True)]
    conditions += [x.func(T) - float(z) for x, z in zip(q, ends.end, strict=True)]
    problem = opty.Problem(
        lambda free: 0.0,
        lambda free: np.zeros_like(free),
        sm.Matrix([*first, *second]),
        [*q, *v],
        nodes,
        T / (nodes - 1),
        instance_constraints=conditions,
        time_symbol=t,
        integration_method="midpoint",
    )
    problem.add_option("print_level", 0)
    problem.add_option("tol", 1e-10)
    return problem


def _solve(problem, case: Case, guess) -> Answer:
    free, info = problem.solve(guess)
    if info["status"] not in (0, 1):
        raise Failed(info["status_msg"].decode())
    n = case.n
    rows = free.reshape(2 * n, -1)
    times = np.linspace(0.0, case.duration, rows.shape[1])
    return Answer(CubicHermiteSpline(times, rows[:n], rows[n:], axis=1), free)


def cold(case: Case, ends: Ends, start: str, nodes: int) -> Answer:
    """Build, compile and solve."""
    if case.size == "large":
        raise Unable("compiling the expanded equations takes minutes")
    problem = build(case, ends, nodes)
    q, v = waypoints(case, ends, start, np.linspace(0.0, case.duration, nodes))
    return _solve(problem, case, np.concatenate([q.ravel(), v.ravel()]))


def again(answer: Answer, case: Case, ends: Ends, nodes: int) -> Answer:
    """Build anew, as end points are compiled in, and start from the last solution."""
    return _solve(build(case, ends, nodes), case, answer.state)


PEER = Peer(("opty", "cyipopt", "sympy"), NODES, cold, again)
