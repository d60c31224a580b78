"""Paths that close, against closed forms and against shooting with scipy."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve

import actionopt as ao
from actionopt import Periodic, scenes

CLOSED = 1e-10  # return of position and momentum


def driven(damping=0.0, stiff=4.0, drive=0.7, w=1.5, cubic=0.0):
    def lagrangian(q, v, t, *, k, a, w, c):
        return v[0] ** 2 / 2 - k * q[0] ** 2 / 2 - c * q[0] ** 4 / 4 + a * np.cos(w * t) * q[0]

    parameters = {"k": stiff, "a": drive, "w": w, "c": cubic}
    if not damping:
        return ao.System(lagrangian, ["x"], parameters=parameters)
    parameters["b"] = damping
    return ao.System(
        lagrangian, ["x"], parameters=parameters, force=lambda q, v, t, *, b: [-b * v[0]]
    )


@pytest.mark.parametrize("w", [1.5, 5.0])
def test_steady_oscillation(w):
    """x = a cos wt / (k - w^2), the one motion with the period of the drive."""
    T = 2 * np.pi / w
    problem = ao.Problem(driven(w=w), ao.Event(0.0, [None]), Periodic(T))
    solution = ao.solve(problem, tol=1e-11)
    t = np.linspace(0, T, 31)
    assert np.max(np.abs(solution(t) - 0.7 * np.cos(w * t) / (4.0 - w**2))) < CLOSED
    assert np.max(np.abs(solution.momenta[0] - solution.momenta[1])) < CLOSED
    assert solution.compare().agrees


def test_steady_oscillation_with_drag():
    w, b = 1.5, 0.4
    T = 2 * np.pi / w
    solution = ao.solve(
        ao.Problem(driven(damping=b, w=w), ao.Event(0.0, [None]), Periodic(T)), tol=1e-11
    )
    t = np.linspace(0, T, 31)
    exact = (0.7 / (4.0 - w**2 + 1j * b * w) * np.exp(1j * w * t)).real
    assert np.max(np.abs(solution(t)[0] - exact)) < CLOSED


def test_nonlinear_oscillation_against_shooting():
    system, T = driven(cubic=1.0, drive=2.0), 2 * np.pi / 1.5
    start = ao.Event(0.0, [None])
    solution = ao.solve(ao.Problem(system, start, Periodic(T)), tol=1e-11)

    def miss(y):
        def flow(t, y):
            return [y[1], system.acceleration(y[:1], y[1:], t)[0]]

        return solve_ivp(flow, (0, T), y, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1] - y

    root = fsolve(miss, [*solution.start.q, *solution.start.v], xtol=1e-13)
    assert np.max(np.abs(root - [*solution.start.q, *solution.start.v])) < 10 * CLOSED
    assert np.max(np.abs(miss([*solution.start.q + 0.1, *solution.start.v]))) > 1e-3


def test_circle_round_a_cone():
    """The azimuth is given and advances by a turn, the distance is free to close: a circle."""
    w = 4.0
    scene = scenes.get("inverted_cone", w=w)
    end = Periodic(2 * np.pi / w, advance=[0.0, 2 * np.pi])
    problem = ao.Problem(
        scene.problem.system,
        ao.Event(0.0, [None, 0.0]),
        end,
        parameters=scene.problem.parameters,
    )
    guess = lambda t: np.stack([0.9 * scene.facts["circle"] + 0 * t, w * t])  # noqa: E731
    solution = ao.solve(problem, tol=1e-11, guess=guess)
    t = np.linspace(0, end.t, 21)
    assert np.max(np.abs(solution(t)[0] - scene.facts["circle"])) < CLOSED
    assert np.max(np.abs(solution(t)[1] - w * t)) < CLOSED
    assert np.max(np.abs(solution.momenta[0] - solution.momenta[1])) < CLOSED
    # the problem may be taken over with other numbers, and still closes
    again = ao.Problem(problem.system, problem.start, problem.end, parameters={"g": 8.0})
    assert isinstance(again.end, Periodic) and again.end.q == (None, 2 * np.pi)


def test_closed_path_on_a_moving_constraint():
    """A pendulum in Cartesian coordinates, its pivot shaken, against the same in its angle."""
    w, A, l, g = 3.0, 0.2, 1.0, 9.81
    T = 2 * np.pi / w

    def angle(q, v, t):
        x = l * np.cos(q[0]) * v[0] - A * w * np.sin(w * t)
        y = l * np.sin(q[0]) * v[0]
        return (x**2 + y**2) / 2 + g * l * np.cos(q[0])

    rod = ao.System(
        lambda q, v, t: v @ v / 2 - g * q[1],
        ["x", "y"],
        constraint=lambda q, t: (q[0] - A * np.cos(w * t)) ** 2 + q[1] ** 2 - l**2,
    )
    free = ao.solve(
        ao.Problem(ao.System(angle, ["a"]), ao.Event(0.0, [None]), Periodic(T)),
        tol=1e-11,
        guess=lambda t: 0 * t,  # the least one stands on its head
    )
    problem = ao.Problem(rod, ao.Event(0.0, [None, None]), Periodic(T))
    held = ao.solve(problem, tol=1e-11, guess=lambda t: np.stack([0 * t, -l + 0 * t]))
    t = np.linspace(0, T, 21)
    a = free(t)[0]
    assert np.ptp(a) > 0.05
    exact = np.stack([A * np.cos(w * t) + l * np.sin(a), -l * np.cos(a)])
    assert np.max(np.abs(held(t) - exact)) < 10 * CLOSED
    assert abs(held.action - free.action) < 10 * CLOSED
    assert abs(held.lam[0, 0] - held.multipliers(0.0)[0]) < 1e-6  # one class less accurate


def test_what_does_not_fit_is_refused():
    system = driven()
    with pytest.raises(ValueError, match="advance of 1 coordinates, found 2"):
        ao.Problem(system, ao.Event(0, [None]), Periodic(1.0, advance=[0.0, 1.0]))
    with pytest.raises(ValueError, match="finite number for advance 0"):
        Periodic(1.0, advance=[np.nan])
    with pytest.raises(ValueError, match="after the start"):
        ao.Problem(system, ao.Event(0, [None]), Periodic(-1.0))
    problem = ao.Problem(system, ao.Event(0, [None]), Periodic(1.0))
    with pytest.raises(ValueError, match="two elements"):
        ao.solve(problem, mesh=ao.Mesh.uniform(0.0, 1.0, 1, 8))
    with pytest.raises(ValueError, match="path that closes"):
        _ = ao.solve(problem).morse_index


def test_a_closed_path_without_a_clock_is_told_to_have_one():
    pendulum = ao.System(lambda q, v, t: v[0] ** 2 / 2 + np.cos(q[0]), ["theta"])
    problem = ao.Problem(pendulum, ao.Event(0.0, [None]), ao.Periodic(8.0))
    with pytest.raises(ao.SolveError, match="give one coordinate at the start"):
        ao.solve(problem, guess=lambda t: [1.2 * np.cos(2 * np.pi * t / 8)])
