"""Sections 12.1 to 12.3: the action, its variation, equations of motion, forces."""

import numpy as np

from actionopt.analysis.spectra.variation import variation
from actionopt.chapter._row import (
    RATE_OFF,
    ROUND_OFF,
    Line,
    path,
    row,
    solve_scene,
    states,
    times,
    worst,
)
from actionopt.mechanics.question.problem import Event, Problem
from actionopt.mechanics.system import System
from actionopt.solver.solve import solve


@row("12.2", "varied path q + alpha eta of an oscillator, eta = sin(pi t / T)")
def varied_path():
    scene, solution = solve_scene("oscillator")
    T = scene.problem.duration
    m, k = (float(scene.problem.parameters[x]) for x in "mk")
    S = variation(solution, lambda t: [np.sin(np.pi * t / T)])
    yield Line("dS/dalpha at 0", 0.0, S.first, ROUND_OFF)
    second = (m * np.pi**2 / T - k * T) / 2
    yield Line("d2S/dalpha2: second variation", second, S.second)
    yield Line("S(0.3)", solution.action + 0.3**2 / 2 * second, float(S(0.3)))


@row("12.2", "varied path of a pendulum on a rod, on the constraint surface")
def varied_on_surface():
    _, solution = solve_scene("rod_pendulum")
    T, h = solution.problem.duration, 5e-3
    S = variation(solution, lambda t: np.stack([t * (T - t), t**2 * (T - t)]))
    yield Line("dS/dalpha at 0", 0.0, S.first, ROUND_OFF)
    w = ((1, 3 / 2), (2, -3 / 20), (3, 1 / 90))  # central differences of order six
    second = sum(c * (S(k * h) + S(-k * h)) for k, c in w) - 49 / 18 * S(0.0)
    yield Line("d2S/dalpha2 by differences", S.second, float(second) / h**2, RATE_OFF)


@row(
    "12.3",
    "particle in a potential, Cartesian coordinates in 1 to 3 dimensions",
    *("oscillator", "projectile", "kepler"),
)
def cartesian():
    def lagrangian(q, v, t, *, m):
        x, y, z = q
        return m * (v @ v) / 2 - (x**2 * y + np.cos(z) * x + np.exp(y * z))

    system = System(lagrangian, ["x", "y", "z"], parameters={"m": 1.7})
    ends = Event(0.0, [0.1, 0.4, -0.3]), Event(1.0, [0.6, -0.2, 0.5])
    solution = solve(Problem(system, *ends), tol=1e-11)
    q, v, t = states(solution)
    x, y, z = q
    force = -np.stack([
        2 * x * y + np.cos(z), x**2 + z * np.exp(y * z), y * np.exp(y * z) - x * np.sin(z)
    ])  # fmt: skip
    yield worst("3-D: m r'' = -dV/dr", force, 1.7 * solution.path.acceleration(t), 1e3 * RATE_OFF)
    yield worst("3-D: momentum m v", 1.7 * v, solution.momentum(t), ROUND_OFF)
    yield worst(
        "3-D: generalized force -dV/dr", force, system.generalized_force(q, v, t), ROUND_OFF
    )


@row("12.3", "non-conservative forces: linear and quadratic drag")
def drag():
    for name in ("drag_linear", "drag_quadratic", "damped_oscillator"):
        yield from path(name)
        _, solution = solve_scene(name)
        xi, w = np.polynomial.legendre.leggauss(60)
        T = solution.problem.duration
        t = solution.problem.start.t + T * (xi + 1) / 2
        q, v = solution(t), solution.velocity(t)
        system, values = solution.problem.system, solution.problem.parameters
        work = T / 2 * w @ np.sum(system.force(q, v, t, parameters=values) * v, axis=0)
        ends = times(solution, 2)
        gained = np.diff(solution.energy(ends))[0]
        yield Line(f"{name}: energy gained = work", work, gained, RATE_OFF)
