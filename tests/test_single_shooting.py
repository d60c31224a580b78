"""Paths that motions from the start lead to, where no path over given times near by does."""

import numpy as np
import pytest
import systems

import actionopt as ao
from actionopt.analysis.quadratic import shooting
from actionopt.analysis.quadratic.shooting import integrate
from actionopt.solver.kinds.single_shooting import SPANS, MissUnits, _aim, arrivals, misses

SPRING = systems.oscillator()


def test_a_motion_of_the_energy_that_returns_is_found_where_paths_over_durations_rest():
    # Over any duration but a half period the path from 0 to 0 is at rest.
    solution = ao.solve(
        ao.Problem(SPRING, ao.Event(0.0, [0.0]), ao.Event(None, [0.0]), energy=0.5), tol=1e-8
    )
    assert solution.duration == pytest.approx(np.pi, rel=1e-8)
    assert abs(solution.velocity(0.0)[0]) == pytest.approx(1.0, rel=1e-8)


@pytest.mark.long
def test_a_longer_transfer_of_given_energy_is_found_as_a_motion():
    def potential(q):
        return (q[0] ** 2 + 1.7 * q[1] ** 2 + q[0] ** 2 * q[1]) / 2

    system = ao.System(lambda q, v, t: v @ v / 2 - potential(q), ["x", "y"])
    first = ao.State(0.0, np.array([0.5, -0.3]), np.array([1.0, 0.6]))
    end = ao.integrate(system, first, 4.0)(4.0)
    energy = 0.68 + potential(np.array(first.q))
    problem = ao.Problem(system, ao.Event(0.0, first.q), ao.Event(None, end), energy=energy)
    solution = ao.solve(problem, tol=1e-6)
    start = ao.State(0.0, solution.start.q, solution.start.v)
    again = ao.integrate(system, start, solution.duration)(solution.duration)
    np.testing.assert_allclose(again, end, atol=1e-4)
    assert start.v @ start.v / 2 + potential(start.q) == pytest.approx(energy, rel=1e-6)


@pytest.mark.long
def test_motions_that_a_potential_turns_back_are_given_up(monkeypatch):
    spans = []

    def integrated(problem, start, span, **options):
        spans.append(float(span.max()))
        return integrate(problem, start, span, **options)

    monkeypatch.setattr(shooting, "integrate", integrated)
    system = ao.System(lambda q, v, t: v @ v / 2 - 2 * np.exp(-10 * q[0] ** 2), ["x", "y"])
    problem = ao.Problem(system, ao.Event(0.0, [-1.0, 0.0]), ao.Event(None, [1.0, 0.3]), energy=1.0)
    assert not list(arrivals(problem, [problem], np.ones(2), None))
    assert len(spans) == 2 < len(SPANS)


def test_a_motion_that_is_carried_on_is_the_same_as_at_once():
    problem = ao.Problem(SPRING, ao.Event(0.0, [0.5]), ao.Event(6.0, [0.0]))
    q0, v0 = np.array([[0.5, 0.5]]), np.array([[1.0, -0.3]])
    last = 0.0
    for T, found in zip((2.0, 6.0), shooting.flights(problem, q0, v0, (2.0, 6.0)), strict=True):
        for flight, v in zip(found, v0[0], strict=True):
            assert flight.times[0] == 0.0 and flight.times[-1] == T > last
            assert np.all(np.diff(flight.times) > 0)
            t = np.linspace(last, T, 31)
            exact = np.stack([0.5 * np.cos(t) + v * np.sin(t), v * np.cos(t) - 0.5 * np.sin(t)])
            q, slope = (shooting.hermite(*flight, slope=s)(t)[0] for s in (False, True))
            np.testing.assert_allclose(q, exact[0], atol=2e-3)
            np.testing.assert_allclose(slope, exact[1], atol=2e-2)
        last = T


@pytest.mark.slow
def test_a_motion_that_runs_into_a_singularity_is_known_until_then():
    falling = ao.System(lambda q, v, t: v[0] ** 2 / 2 + 1 / q[0] ** 2, ["r"])
    problem = ao.Problem(falling, ao.Event(0.0, [1.0]), ao.Event(2.0, [1.0]))
    # From rest at r = 1, r^2 = 1 - 2 t^2: at the centre at 1 / sqrt(2).
    first, last = shooting.flights(problem, np.array([[1.0]]), np.array([[0.0]]), (0.5, 2.0))
    assert last[0].times[-1] == pytest.approx(np.sqrt(0.5), abs=1e-3)
    np.testing.assert_allclose(last[0].q[0, 1:9] ** 2, 1 - 2 * last[0].times[1:9] ** 2, atol=1e-3)
    assert first[0].times[-1] == 0.5


@pytest.mark.slow
def test_a_path_to_a_surface_is_found_far_from_its_nearest_point():
    system = ao.System(
        lambda q, v, t: v @ v / 2 - q @ q / 2 + 0.8 * np.cos(1.5 * q[0] - q[1]), ["x", "y"]
    )
    ridge = ao.Event(3.0, None, on=lambda q, t: q[1] - q[0] / 2 + np.sin(3 * q[1]) / 2 + 2)
    solution = ao.solve(ao.Problem(system, ao.Event(0.0, [-0.6, -0.3]), ridge), tol=1e-6)
    x, y = solution.end.q
    assert y - x / 2 + np.sin(3 * y) / 2 == pytest.approx(-2.0, abs=1e-5)
    p, along = solution.momentum(3.0), [1 + 1.5 * np.cos(3 * y), 0.5]
    assert abs(p @ along) < 1e-4 * np.linalg.norm(p)


@pytest.mark.slow
def test_a_motion_meets_a_wall_that_moves():
    # H - E = u p at the wall x = h + u t.
    system = ao.System(lambda q, v, t: v[0] ** 2 / 2 - q[0] ** 2 / 2 + np.cos(2 * q[0]) / 2, ["x"])
    wall = ao.Event(None, None, on=lambda q, t: q[0] - 0.4 + 0.3 * t)
    solution = ao.solve(ao.Problem(system, ao.Event(0.0, [-0.8]), wall, energy=0.3))
    T, x, v = solution.duration, solution.end.q[0], solution.end.v[0]
    np.testing.assert_allclose(x, 0.4 - 0.3 * T, atol=1e-6)
    H = v**2 / 2 + x**2 / 2 - np.cos(2 * x) / 2
    np.testing.assert_allclose(H - 0.3, -0.3 * v, atol=1e-6)


@pytest.mark.parametrize("k", [0, 1])
def test_a_path_misses_nothing_at_a_surface_that_moves_where_its_time_is_free(k):
    # p = mu on_q and H - E = -mu on_t, at either event.
    t, q, v, u = 0.7, np.array([0.3, -0.5]), np.array([0.8, 1.1]), 0.4
    system = systems.particle("x y")

    def on(q, t):
        return v @ (q - np.array([0.3, -0.5])) - u * (t - 0.7)

    events = [ao.Event(None, None, on=on), ao.Event(1.0, [0.0, 0.0])]
    if k:
        events = [ao.Event(0.0, [0.0, 0.0]), events[0]]
    problem = ao.Problem(system, *events, energy=float(v @ v) / 2 - u)
    state = q[:, None], v[:, None], np.array([t])
    unit = MissUnits(np.ones(2), 1.0, 1.0)
    np.testing.assert_allclose(misses(problem, k, state, unit), 0.0, atol=1e-14)
    turned = q[:, None], -v[:, None], np.array([t])
    assert np.abs(misses(problem, k, turned, unit)).max() > 0.1


@pytest.mark.slow
def test_a_motion_that_collides_takes_no_steps_from_the_others():
    kepler = systems.kepler()
    problem = ao.Problem(kepler, ao.Event(0.0, [0.4, 0.0]), ao.Event(9.0, [0.0, 1.0]))
    v0 = np.array([[-2.0, 0.0, 1.2], [0.0, 2.0, 1.6]])
    q0 = np.array([[0.4] * 3, [0.0] * 3])
    _, last = shooting.flights(problem, q0, v0, (2.0, 9.0))
    assert last[0].times[-1] < 0.2 and [f.times[-1] for f in last[1:]] == [9.0, 9.0]


@pytest.mark.parametrize("n", [2, 3])
def test_random_velocities_keep_the_constraints(n):
    system = systems.particle("x y z"[: 2 * n - 1], constraint=lambda q, t: q @ q - (1 + t) ** 2)
    q = np.eye(n)[0]
    problem = ao.Problem(system, ao.Event(0.0, q), ao.Event(1.0, -2 * q))
    v = shooting.in_directions(problem, np.full((1, 5), 3.0), np.random.default_rng(0))
    np.testing.assert_allclose(q @ v, np.ones(5))  # q.v = (1 + t) of a sphere that grows
    free = ao.Problem(systems.particle("x y z"[: 2 * n - 1]), ao.Event(0.0, q), ao.Event(1.0, -q))
    speeds = np.array([[1.0, 2.0, 3.0]])
    v = shooting.in_directions(free, speeds, np.random.default_rng(0))
    np.testing.assert_allclose(np.linalg.norm(v, axis=0), speeds[0])
    assert np.ptp(v / speeds, axis=1).min() > 0.1


def test_motions_are_aimed_at_an_end_from_a_free_start():
    problem = ao.Problem(systems.oscillator(), ao.Event(0.0, [None]), ao.Event(1.0, [1.0]))
    fixed = ao.Problem(systems.oscillator(), ao.Event(0.0, [1.0]), ao.Event(1.0, [1.0]))
    path = next(_aim(problem, [fixed], np.ones(1), None))
    np.testing.assert_allclose(path([0.0, 1.0])[0], [1 / np.cos(1), 1.0], atol=1e-4)
