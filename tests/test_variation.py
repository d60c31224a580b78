"""S(alpha) against closed forms, finite differences and quadrature of the varied path."""

import numpy as np
import pytest
import systems
from helpers import at_once, solved

import actionopt as ao
from actionopt import scenes
from actionopt.analysis.spectra import modes
from actionopt.analysis.spectra.variation import variation

ROUNDING = 1e-13  # of `first`, relative to the terms that cancel in it
CONSERVATIVE = ("oscillator", "kepler", "double_pendulum", "driven_oscillator", "charge_planar")
CONSTRAINED = ("rod_pendulum", "polar_pendulum", "turning_wire", "sliding_off_circle")
SUBSET = ("oscillator", "kepler", "rod_pendulum", "turning_wire")


def bump(problem, k=0):
    """A smooth variation that vanishes at both events, another one for each coordinate."""
    t0, T, n = problem.start.t, problem.duration, problem.system.n

    def eta(t):
        s = (np.asarray(t) - t0) / T
        return np.stack([np.sin((i + 1 + k) * np.pi * s) * np.exp(s * i) for i in range(n)])

    return eta


def varied(name, **parameters):
    solution = solved(name, tol=1e-11, **parameters)
    return solution, variation(solution, bump(solution.problem))


def central(S, order, h):
    """Second derivatives (and first ones) at zero by central differences of order six."""
    weights = {
        1: [(1, 3 / 4), (2, -3 / 20), (3, 1 / 60)],
        2: [(1, 3 / 2), (2, -3 / 20), (3, 1 / 90)],
    }[order]
    if order == 1:
        return sum(w * (S(k * h) - S(-k * h)) for k, w in weights) / h
    return (sum(w * (S(k * h) + S(-k * h)) for k, w in weights) - 49 / 18 * S(0.0)) / h**2


@pytest.mark.quick(
    "oscillator",
    "driven_oscillator",
    "charge_planar",
    "rod_pendulum",
    "turning_wire",
    "sliding_off_circle",
)
@pytest.mark.parametrize("name", CONSERVATIVE + CONSTRAINED)
def test_first_derivative_vanishes_to_rounding(name):
    _, S = varied(name)
    assert abs(S.first) <= ROUNDING * S.cancelling
    assert S.cancelling > 1e-3


@pytest.mark.parametrize("name", SUBSET)
def test_the_check_of_the_first_derivative_sees_a_path_that_is_none(name):
    """The force of constraint alone makes a variation across the surface count."""
    solution, S = varied(name)
    off = S.nodes(1e-6)
    _, gradient = S.form.tr.action_and_gradient(off)
    assert abs(gradient @ S.eta.values.T.ravel()) > 1e3 * ROUNDING * S.cancelling


@at_once("name", CONSERVATIVE + CONSTRAINED)
def test_second_derivative_is_the_second_variation(name):
    _, S = varied(name)
    h = 5e-3  # rounding of S over h^2 and h^6 of the formula balance here
    assert abs(central(S, 2, h) - S.second) <= 1e-8 * max(1.0, abs(S.second), S.cancelling)
    assert abs(central(S, 1, h)) <= 1e-9 * max(1.0, S.cancelling)


def test_action_of_a_varied_oscillator_in_closed_form():
    """With eta = sin(k pi t / T): S = S0 + alpha^2 (m (k pi)^2 / T - K T) / 4, exactly."""
    scene = scenes.get("oscillator")
    problem, T = scene.problem, scene.problem.duration
    m, K = (float(problem.parameters[x]) for x in ("m", "k"))
    solution = ao.solve(problem, tol=1e-11)
    for k in (1, 2, 23):  # the last one the path's own mesh does not resolve
        S = variation(solution, lambda t, k=k: [np.sin(k * np.pi * t / T)])
        second = (m * (k * np.pi) ** 2 / T - K * T) / 2
        assert abs(S.second - second) <= 1e-10 * abs(second)
        alpha = np.array([[-0.3, 0.0], [0.2, 0.7]])
        expected = scene.action + alpha**2 / 2 * second
        assert np.max(np.abs(S(alpha) - expected)) <= 1e-10 * np.max(np.abs(expected))


def test_varied_paths_stay_on_the_surface():
    solution, S = varied("rod_pendulum")
    problem = solution.problem
    path = S.path(0.2)
    t = S.form.tr.mesh.nodes
    q = path(t)
    assert np.max(np.abs(problem.system.constraint(q, t, parameters=problem.parameters))) < 1e-14
    assert np.max(np.abs(q - solution(t))) > 0.05
    # eta is tangent: orthogonal to the rod
    assert np.max(np.abs(np.sum(S.eta.values * S.form.at.Q.T, axis=0))) < 1e-12


def test_a_varied_path_that_cannot_stay_on_the_surface_is_refused():
    solution = ao.solve(scenes.get("turning_wire").problem, guess=scenes.get("turning_wire").guess)
    wire = variation(solution, bump(solution.problem))
    wire(100.0)  # the wire is straight: there is no end to it
    circle = varied("rod_pendulum")[1]
    with pytest.raises(ValueError, match="smaller alpha"):
        circle(10.0)


def test_free_ends_may_vary():
    def lagrangian(q, v, t):
        return v[0] ** 2 / 2 - q[0] ** 2 / 2

    system = ao.System(lagrangian, ["x"])
    solution = ao.solve(ao.Problem(system, ao.Event(0, [1.0]), ao.Event(1, [None])), tol=1e-11)
    S = variation(solution, lambda t: [t])
    assert abs(S.first) <= ROUNDING * S.cancelling
    assert abs(S.second - (1 - 1 / 3)) < 1e-12


def test_what_is_no_variation_is_refused():
    solution = ao.solve(scenes.get("kepler").problem)
    with pytest.raises(ValueError, match="= 0 in x, which the event pins"):
        variation(solution, lambda t: np.stack([1 + 0 * t, 0 * t]))
    with pytest.raises(ValueError, match="2 coordinates, found 1"):
        variation(solution, lambda t: [0 * t])
    forced = ao.solve(scenes.get("damped_oscillator").problem)
    with pytest.raises(ValueError, match="non-conservative"):
        variation(forced, bump(forced.problem))


@pytest.mark.parametrize("torn", [0, 1])
def test_every_coordinate_of_a_closed_path_has_to_close(torn):
    system = ao.System(lambda q, v, t: (v @ v - 2 * q @ q) / 2 + np.cos(t) * q[0], ["x", "y"])
    problem = ao.Problem(system, ao.Event(0.0, [None, None]), ao.Periodic(2 * np.pi))
    solution = ao.solve(problem)
    with pytest.raises(ValueError, match=f"found that {'xy'[torn]} differs by"):
        variation(solution, lambda t: np.stack([np.cos(t) + (k == torn) * t / 3 for k in (0, 1)]))
    S = variation(solution, lambda t: np.stack([np.cos(t), np.sin(t)]))  # which closes
    assert S(0.3) == pytest.approx(solution.action - np.pi * 0.3**2, rel=1e-9)


def test_a_varied_path_ends_on_its_surface():
    plane = systems.particle("x y")
    circle = ao.Event(1.0, None, on=lambda q, t: q @ q - 1)
    way = ao.solve(ao.Problem(plane, ao.Event(0.0, [3.0, 0.0]), circle))
    S = variation(way, lambda t: np.stack([0 * t, t]))  # tangent where it ends
    assert np.linalg.norm(S.path(0.3)(1.0)) == pytest.approx(1.0, abs=1e-12)


def test_a_variation_vanishes_at_events_on_the_way():
    oscillator = systems.oscillator()
    events = ao.Event(0.0, [1.0]), ao.Event(3.0, [0.5])
    path = ao.solve(ao.Problem(oscillator, *events, through=[ao.Event(1.0, [-0.4])]))

    def arches(t):
        return [np.where(t < 1, np.sin(np.pi * t), np.sin(np.pi * (t - 1) / 2))]

    S = variation(path, arches)  # the integral of eta'^2 - eta^2 on each leg
    assert S.second == pytest.approx(sum(np.pi**2 / 2 / T - T / 2 for T in (1, 2)), rel=1e-9)
    assert abs(S.first) <= ROUNDING * S.cancelling
    with pytest.raises(ValueError, match=r"expected eta\(1.0\) = 0 in x"):
        variation(path, lambda t: [np.sin(np.pi * t / 3)])
    free = ao.solve(
        ao.Problem(
            systems.particle("x y"),
            ao.Event(0.0, [0.0, 0.0]),
            ao.Event(1.0, [1.0, 0.0]),
            through=[ao.Event(None, [0.5, 0.3])],
        )
    )
    with pytest.raises(ValueError, match="one through 1"):
        variation(free, lambda t: np.zeros((2, len(t))))


def test_many_modes_are_sought_on_few_meshes(monkeypatch):
    """They were on five, of which three had too few nodes to resolve them."""
    tried, on_mesh = [], modes._on_mesh
    monkeypatch.setattr(modes, "_on_mesh", lambda *asked: tried.append(asked) or on_mesh(*asked))
    spring = ao.System(lambda q, v, t: (v @ v - q @ q) / 2, ["x"])
    found = ao.solve(ao.Problem(spring, ao.Event(0.0, [0.0]), ao.Event(1.0, [1.0])))
    values = ao.second_variation(found, 50).eigenvalues
    np.testing.assert_allclose(values, (np.arange(1, 51) * np.pi) ** 2 - 1, rtol=1e-9)
    assert len(tried) <= 3
