"""Ladders of states: paths with int q^2 = 1, by eigenvectors of the action's second variation."""

import numpy as np
import pytest
from helpers import a_quarter
from scipy.linalg import eigvals
from scipy.special import jn_zeros

import actionopt as ao


def states(stiffness, start, end, *, mass=lambda t: 1.0, free=False):
    """Return the problem of -(m u')' + V u = 2 E m u, u = 0 at the end; the start may be free."""
    system = ao.System(
        lambda q, v, t: mass(t) * v[0] ** 2 / 2 + stiffness(t) * q[0] ** 2 / 2,
        ["u"],
        integral=lambda q, v, t: mass(t) * q[0] ** 2,
    )
    first = ao.Event(start, [None if free else 0.0])
    return ao.Problem(system, first, ao.Event(end, [0.0]), integral=1.0)


def chebyshev(stiffness, start, end, nodes=120):
    """Return all E by collocation (Trefethen, *Spectral Methods in MATLAB* (2000), program 15)."""
    k = np.arange(nodes + 1)
    x, c = np.cos(np.pi * k / nodes), np.where(k % nodes, 1.0, 2.0) * (-1.0) ** k
    gap = x[:, None] - x + np.eye(nodes + 1)
    D = c[:, None] / c / gap
    D = (D - np.diag(D.sum(axis=1))) * 2 / (end - start)
    H = (-D @ D + np.diag(stiffness((start + end + (end - start) * x) / 2))) / 2
    return np.sort(eigvals(H[1:-1, 1:-1]).real)


def well(t):
    return 12 * np.cos(2 * t) + 5 * np.sin(3 * t)


@pytest.mark.parametrize(
    "problem, energies",
    a_quarter(
        [
            (states(well, 0, 5), chebyshev(well, 0, 5)[:4]),
            # Griffiths, *Quantum Mechanics*, 4.2: hydrogen, l = 0
            (states(lambda r: -2 / r, 0, 90), [-1 / 2, -1 / 8, -1 / 18, -1 / 32]),
            # a membrane: zeros of Bessel's functions, in a disc and on it with two nodal lines
            (states(lambda t: 0.0, 0, 1, mass=lambda t: t, free=True), jn_zeros(0, 4) ** 2 / 2),
            (states(lambda t: 4 / t, 0, 1, mass=lambda t: t), jn_zeros(2, 4) ** 2 / 2),
        ]
    ),
)
def test_a_ladder_of_states(problem, energies):
    ladder = ao.solve_all(problem, starts=1)
    assert [state.action for state in ladder] == pytest.approx(list(energies), rel=1e-8)
    assert ladder.indices == (0, 1, 2, 3)
    assert all(state.compare().agrees for state in ladder)


def test_the_ground_state_is_the_answer():
    ground = ao.solve(states(lambda t: t**2, -8, 8))
    t = np.linspace(-8, 8, 99)
    assert abs(ground.action - 0.5) < 1e-12 and ground.morse_index == 0
    assert np.abs(ground(t)[0] - np.exp(-(t**2) / 2) / np.pi**0.25).max() < 1e-8


def test_a_state_beside_another():
    """The lowest with int exp(-t^2 / 2) q dt = 0 is the first excited one, a minimum there."""
    system = ao.System(
        lambda q, v, t: (v[0] ** 2 + t**2 * q[0] ** 2) / 2,
        ["u"],
        integral=lambda q, v, t: [q[0] ** 2, np.exp(-(t**2) / 2) * q[0]],
    )
    problem = ao.Problem(system, ao.Event(-8, [0]), ao.Event(8, [0]), integral=[1.0, 0.0])
    excited = ao.solve(problem)
    assert abs(excited.action - 1.5) < 1e-11 and excited.morse_index == 0


def test_a_trace_of_a_state():
    """E = w / 2: along it the second variation is singular but for the integral."""
    system = ao.System(
        lambda q, v, t, *, w: (v[0] ** 2 + w**2 * t**2 * q[0] ** 2) / 2,
        ["u"],
        parameters={"w": 1.0},
        integral=lambda q, v, t: q[0] ** 2,
    )
    ground = ao.Problem(system, ao.Event(-8, [0]), ao.Event(8, [0]), integral=1.0)
    branch = ao.trace(ground, "w", 2.0)
    assert branch.actions == pytest.approx(branch.values / 2, rel=1e-9)
    assert set(branch.indices) == {0}
