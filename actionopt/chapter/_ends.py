"""End conditions that the chapter's problems need: fixed, partly free, periodic."""

import numpy as np

from actionopt.chapter._row import TOL, Line, row, times, worst
from actionopt.mechanics.question.problem import Event, Periodic, Problem
from actionopt.mechanics.system import System
from actionopt.solver.solve import solve


def _driven_oscillator() -> System:
    """Return x'' + w0^2 x = B cos wt, with w0 = 2, B = 0.7, w = 1.5."""

    def lagrangian(q, v, t, *, w0, B, w):
        return (v[0] ** 2 - (w0 * q[0]) ** 2) / 2 + B * np.cos(w * t) * q[0]

    return System(lagrangian, ["x"], parameters={"w0": 2.0, "B": 0.7, "w": 1.5})


@row("12.2", "ends partly free: the natural condition p = 0")
def natural():
    system = System(lambda q, v, t: (v[0] ** 2 + v[1] ** 2) / 2 - 9.81 * q[1], ["x", "y"])
    solution = solve(Problem(system, Event(0, [0, 0]), Event(1.2, [3, None])), tol=TOL)
    yield Line("p_y at the free end", 0.0, float(solution.momenta[1][1]))
    t = times(solution)
    exact = [3 * t / 1.2, 9.81 * (1.2 * t - t**2 / 2)]
    yield worst("path to the highest point", exact, solution(t))


@row("12.2", "periodic ends: q and p return")
def periodic():
    T = 2 * np.pi / 1.5
    solution = solve(Problem(_driven_oscillator(), Event(0.0, [None]), Periodic(T)), tol=TOL)
    t = times(solution)
    exact = 0.7 * np.cos(1.5 * t) / (2.0**2 - 1.5**2)
    yield worst("steady oscillation B cos wt / (w0^2 - w^2)", exact, solution(t)[0])
    p0, p1 = (float(p[0]) for p in solution.momenta)
    yield Line("momentum returns", p0, p1)
