"""What switches by the clock: found to neighbouring numbers, and no error of a path."""

import casadi as ca
import numpy as np
import pytest
from helpers import a_quarter

import actionopt as ao
from actionopt import scenes
from actionopt.discrete.meshes.boundaries import carry_boundaries, sides, with_boundaries
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.mechanics.laws.compiled import Pointwise

C = 0.3718


def free(v):
    return v[0] ** 2 / 2


def problem(lagrangian, t0=0.0, t1=1.0, end=1.0, parameters=None, force=None):
    system = ao.System(lagrangian, ["x"], parameters=parameters, force=force)
    return ao.Problem(system, ao.Event(t0, [0.0]), ao.Event(t1, [end]))


def instants(factor, t0=0.0, t1=1.0):
    """Return the middles of the instants of a force `factor(t)`, and how far apart the sides."""
    found = np.array(problem(lambda q, v, t: free(v) + factor(t) * q[0], t0, t1).instants)
    return found.reshape(-1, 2).mean(axis=1), np.ptp(found.reshape(-1, 2), axis=1)


@pytest.mark.quick(
    "<lambda>-expected0",
    "<lambda>-expected6",
    "<lambda>-expected8",
    "<lambda>-expected9",
    "<lambda>-expected11",
    "<lambda>-expected12",
    "<lambda>-expected14",
    "<lambda>-expected15",
)
@pytest.mark.parametrize(
    ("factor", "expected"),
    [
        (lambda t: np.where(t > C, 5.0, 0.0), [C]),
        (lambda t: np.where(abs(t - C) < 1e-7, 5.0, 0.0), [C - 1e-7, C, C + 1e-7]),
        (lambda t: np.where((t - C) ** 2 < 1e-14, 5.0, 0.0), [C - 1e-7, C + 1e-7]),
        (lambda t: ca.if_else(ca.logic_and(t > C, t < C + 1e-9), 5, 0), [C, C + 1e-9]),
        (lambda t: np.fmax(t - C, 0.0), [C]),
        (lambda t: np.sign(t - C) + np.copysign(2.0, t - C), [C]),
        (lambda t: abs(t - C) / (t - C), [C]),
        (lambda t: np.arctan(1 / (t - C)), [C]),
        (lambda t: np.arctan2(t - C, -1.0), [C]),
        (lambda t: np.floor(4 * t), [0.25, 0.5, 0.75, 1.0]),
        (lambda t: np.ceil(4 * t), [0.0, 0.25, 0.5, 0.75]),
        (lambda t: np.fmod(t, 0.3), [0.3, 0.6, 0.9]),
        (lambda t: ca.remainder(t, 0.4), [0.2, 0.6]),
        (lambda t: np.sign(np.sin(300 * t)), np.pi / 300 * np.arange(96)),
        (lambda t: np.exp(-(((t - C) / 1e-3) ** 2)), []),
        (lambda t: 1 / (1.01 + np.cos(t)), []),
    ],
)
def test_where_a_factor_switches(factor, expected):
    for shift, slack in ((0.0, 1e-13), (1e4, 1e-9)):
        if shift and np.size(expected) > 3:  # what is at the end may lie beyond
            continue
        found, apart = instants(lambda t, s=shift: factor(t - s), shift, shift + 1)
        assert found - shift == pytest.approx(expected, abs=slack)
        assert np.all(apart <= 4 * np.spacing(shift + 1))


def test_what_does_not_switch_by_the_clock():
    for name in ("pendulum", "driven_oscillator", "kepler", "moving_pivot"):
        assert scenes.get(name).problem.system.clock is None
    walls = (
        lambda q, v, t: free(v) - np.fmax(q[0] - t, 0.0) ** 2,  # the path's
        lambda q, v, t: free(v) - np.fmod(q[0], 1 + t),
        lambda q, v, t, *, a: free(v) + np.where(a > 1, 3.0, 2.0) * q[0] * t,  # of no time
    )
    assert problem(walls[0]).system.clock is None
    assert problem(walls[1]).system.clock is None
    assert problem(walls[2], parameters={"a": 2.0}).system.clock is None
    noise = problem(lambda q, v, t: free(v) + (np.sin(t) ** 2 + np.cos(t) ** 2 > 1) * q[0])
    assert noise.instants == ()  # round-off


def closed(force, twice, t):
    """Return x(t) from 0 to 1 for a force integrated twice."""
    return t + twice(t) - twice(0.0) * (1 - t) - twice(1.0) * t


@pytest.mark.long
@pytest.mark.parametrize("seed", a_quarter(range(12)))
def test_a_window_at_any_place_of_any_width_to_any_tolerance(seed):
    rng = np.random.default_rng(seed)
    c, w, tol = rng.uniform(0.05, 0.95), 10 ** rng.uniform(-3, -0.5), 10 ** rng.uniform(-11, -3)
    kick, t = 2 / w, np.linspace(0, 1, 4001)

    def on(t):
        return np.where(abs(t - c) < w / 2, kick, 0.0)

    def twice(t):
        a, b = np.clip([c - w / 2, c + w / 2], 0, 1)
        inside = np.clip(t, a, b) - a
        return kick * (inside**2 / 2 + (b - a) * np.maximum(t - b, 0))

    exact = closed(on, twice, t)
    for given in (
        problem(lambda q, v, t: free(v) + on(t) * q[0]),
        problem(lambda q, v, t: free(v), force=lambda q, v, t: [on(t)]),
    ):
        solution = ao.solve(given, tol=tol)
        error = np.abs(solution(t)[0] - exact).max() / np.abs(exact).max()
        assert error <= min(tol, solution.error + 1e-13)
        assert solution.mesh.elements <= 8


@pytest.mark.quick("-1.0-0.0001")
@pytest.mark.parametrize("tol", [1e-4, 1e-8, 1e-11])
@pytest.mark.parametrize("t0", a_quarter([-1.0, 0.0, 1e3, 1e6]))
def test_a_mass_that_changes(t0, tol):
    """The momentum is the same on both sides, the velocity is not."""
    c = t0 + 1 / 3 if t0 >= 0 else -1e-3 * np.pi
    given = problem(lambda q, v, t: np.where(t > c, 5.0, 1.0) * free(v), t0, t0 + 1)
    solution = ao.solve(given, tol=tol)
    t, p = np.linspace(0, 1, 1001), 1 / ((c - t0) + (1 - (c - t0)) / 5)
    exact = p * (np.minimum(t, c - t0) + np.maximum(t - (c - t0), 0) / 5)
    assert np.abs(solution(t0 + t)[0] - exact).max() < max(tol, 1e-15 * t0, 1e-13)
    assert solution.compare().agrees


def test_boundaries_at_instants():
    mesh = Mesh([0.0, 0.25, 0.5, 0.75, 1.0], [4, 5, 6, 7])
    found = with_boundaries(mesh, ((0.25, 0.25), (0.3, 0.3), (0.6, 0.6), (0.98, 0.98)))
    assert found.boundaries.tolist() == [0, 0.25, 0.3, 0.5, 0.6, 0.75, 0.98, 1.0]
    assert found.degrees == (4, 5, 5, 6, 6, 7, 7)
    assert with_boundaries(found, ((0.3, 0.3), (1.0, 1.0))) is found
    assert with_boundaries(mesh, ((0.52, 0.52),)).boundaries.tolist() == [0, 0.25, 0.52, 0.75, 1.0]
    assert with_boundaries(mesh, ()) is mesh


def test_each_element_is_on_its_own_side():
    mesh, c = Mesh([0.0, 0.3, 1.0], 4), 0.3
    low, high = sides(mesh, ((c, np.nextafter(c, 1)),))
    assert low.tolist() == [0.0, np.nextafter(c, 1)]
    assert high.tolist() == [c, 1.0]
    low, high = sides(mesh, ((0.5, 0.5),))
    assert low.tolist() == [0.0, 0.3]
    assert high.tolist() == [0.3, 1.0]


def test_a_mesh_moves_with_its_instants():
    mesh = Mesh([0.0, 0.1, 0.2, 0.6, 1.0], 4)
    found = carry_boundaries(mesh, ((0.2, 0.2),), ((2.5, 2.5),), 2.0, 4.0)
    assert found.boundaries == pytest.approx([2.0, 2.25, 2.5, 3.25, 4.0])
    # Others, not of this mesh, or at an end of it.
    others = (), ((0.2, 0.2), (0.6, 0.6)), ((0.3, 0.3),), ((0.0, 0.0),), ((1.0, 1.0),)
    for old in others:
        found = carry_boundaries(mesh, old, ((2.5, 2.5),), 2.0, 4.0)
        assert found.boundaries == pytest.approx([2.0, 2.2, 2.4, 3.2, 4.0])


def test_the_action_of_a_switch_without_parameters_has_its_derivatives():
    """A push of a free body from t = 0.4 on: S(T) by differences, and no parameter to move it."""

    def solution(T):
        pushed = problem(lambda q, v, t: free(v) + np.where(t > 0.4, 2.0, 0.0) * q[0], t1=T)
        return ao.solve(pushed, tol=1e-11)

    h = 1e-4
    slope = (solution(1 + h).action - solution(1 - h).action) / (2 * h)
    found = solution(1.0).sensitivity()
    assert found.t1 == pytest.approx(slope, rel=1e-6) and found.parameters == {}


def test_a_switch_at_time_zero_is_found_to_round_off_of_the_duration(monkeypatch):
    asked, call = [], Pointwise.__call__
    monkeypatch.setattr(Pointwise, "__call__", lambda *a: asked.append(0) or call(*a))
    [(before, after)] = problem(lambda q, v, t: free(v) - abs(t) * q[0], -0.5).instants
    assert before <= 0 < after < before + 1e-28
    assert len(asked) < 120  # the smallest number beside zero is a thousand bisections away
