"""Motions from both events that nearly meet half way."""

import numpy as np
import pytest
import systems
from helpers import same_bits

from actionopt import Event, Problem, System
from actionopt.analysis.quadratic.shooting import about, integrate
from actionopt.solver.search.two_sided_shooting import (
    MOST_PAIRS,
    hits,
    join_motions,
    meetings,
    nearest,
)

OSCILLATOR = systems.oscillator("x y")
PENDULUM = systems.pendulum("angle")


@pytest.mark.long
def test_integrating_back_in_time_undoes_integrating_forth():
    problem = Problem(OSCILLATOR, Event(1.0, [1.0, 0.0]), Event(4.0, [0.3, 0.2]))
    q0, v0 = np.array([[1.0, 0.2], [0.0, 0.5]]), np.array([[0.3, -1.0], [1.0, 0.1]])
    spans = np.array([2.0, 0.7])
    q, v = integrate(problem, (np.full(2, 1.0), q0[:, None], v0[:, None]), spans, accuracy=1e-9)
    c, s = np.cos(spans), np.sin(spans)
    np.testing.assert_allclose(q[:, 0], q0 * c + v0 * s, atol=1e-6)
    np.testing.assert_allclose(v[:, 0], v0 * c - q0 * s, atol=1e-6)
    back = integrate(problem, (1.0 + spans, q, v), -spans, accuracy=1e-9)
    np.testing.assert_allclose(back[0][:, 0], q0, atol=1e-6)
    np.testing.assert_allclose(back[1][:, 0], v0, atol=1e-6)


def test_time_runs_backwards_in_the_forces_too():
    # x'' = t: x = x0 + v0 (t - t0) + (t^3 - t0^3) / 6 - t0^2 (t - t0) / 2
    system = System(lambda q, v, t: v[0] ** 2 / 2 + t * q[0], ["x"])
    problem = Problem(system, Event(0.0, [0.0]), Event(3.0, [0.0]))
    start = np.full(1, 3.0), np.array([[[0.5]]]), np.array([[[0.25]]])
    q, v = integrate(problem, start, np.full(1, -2.0))
    assert q.item() == pytest.approx(0.5 - 0.5 + (1 - 27) / 6 + 9, abs=1e-3)
    assert v.item() == pytest.approx(0.25 + (1 - 9) / 2, abs=1e-3)


def test_nearest_pairs_by_trying_all():
    rng = np.random.default_rng(3)
    a, b = rng.standard_normal((4, 30)), rng.standard_normal((4, 20))
    a[1, 5] = np.nan
    b[0, 7] = np.inf
    i, j = nearest(a, b, 12)
    distance = np.linalg.norm(a[:, :, None] - b[:, None], axis=0)
    free, expected = (np.full(30, MOST_PAIRS), np.full(20, MOST_PAIRS)), []
    for k in np.argsort(np.where(np.isfinite(distance), distance, np.inf).ravel()):
        one, other = divmod(int(k), 20)
        if free[0][one] and free[1][other]:
            free[0][one] -= 1
            free[1][other] -= 1
            expected.append((one, other))
    assert list(zip(i, j, strict=True)) == expected[:12]
    assert 5 not in i
    assert 7 not in j


def test_nothing_finite_makes_no_pair():
    assert nearest(np.full((2, 3), np.nan), np.ones((2, 3)), 5)[0].size == 0


def test_two_halves_of_one_motion_are_joined_to_it():
    t = np.linspace(0.0, 2.0, 41)
    back = np.linspace(4.0, 2.0, 38)
    forth, rest = ((s, np.sin(s)[None], np.cos(s)[None]) for s in (t, back))
    curve = join_motions(forth, rest, 2.0)
    assert (curve.mesh.boundaries[0], curve.mesh.boundaries[-1]) == (0.0, 4.0)
    assert 2.0 in curve.mesh.boundaries
    s = np.linspace(0.0, 4.0, 101)
    # Cubic splines through the steps: h^4 / 384 of the fourth derivative.
    assert np.max(np.abs(curve(s)[0] - np.sin(s))) < 2 * (2 / 37) ** 4 / 384


def test_a_gap_is_spread_over_both_halves():
    t, back = np.linspace(0.0, 1.0, 10), np.linspace(3.0, 1.0, 10)
    flat = [(s, np.full((1, 10), x), np.zeros((1, 10))) for s, x in ((t, 0.0), (back, 1.0))]
    curve = join_motions(flat[0], flat[1], 1.0)
    np.testing.assert_allclose(
        curve(np.array([0.0, 0.5, 1.0, 2.0, 3.0]))[0], [0, 0.25, 0.5, 0.75, 1]
    )


def test_the_best_is_nearly_a_motion_and_the_same_each_time():
    # Of a pendulum over 1.5 periods: its energy is conserved along the curve but for the gap.
    problem = Problem(PENDULUM, Event(0.0, [0.4]), Event(9.0, [-0.7]))
    guesses = list(meetings(problem, 128, 6))
    assert 0 < len(guesses) <= 6
    for guess in guesses:
        t = guess.mesh.boundaries
        assert (t[0], t[-1]) == (0.0, 9.0)
        np.testing.assert_allclose(guess(t[[0, -1]])[0], [0.4, -0.7], atol=1e-12)
    inner = np.linspace(0.1, 8.9, 50)
    q, v = guesses[0](inner)[0], guesses[0].velocity(inner)[0]
    energy = v**2 / 2 - np.cos(q)
    assert np.ptp(energy) < 0.1
    again = next(meetings(problem, 128, 6))
    same_bits(again.values, guesses[0].values, because="the seed is fixed")


def test_a_motion_that_nothing_can_start_gives_no_guess():
    frozen = System(lambda q, v, t: v[0] ** 2 / 2 + v[1] * q[0] - q[1] ** 2, ["x", "y"])
    problem = Problem(frozen, Event(0.0, [0.0, 0.0]), Event(1.0, [1.0, 0.0]))
    assert list(meetings(problem, 16, 4)) == [] == list(hits(problem))


@pytest.mark.long
def test_what_hits_the_end_is_a_motion_to_there():
    problem = Problem(PENDULUM, Event(0.0, [0.4]), Event(9.0, [-0.7]))
    found = list(hits(problem))
    speeds = [abs(path.velocity(0.0)[0]) for path in found]
    assert found and speeds == sorted(speeds)
    t = np.linspace(0, 9, 50)
    for path in found:
        assert abs(path(9.0)[0] + 0.7) < 2e-3 and path(0.0)[0] == pytest.approx(0.4, abs=1e-12)
        energy = path.velocity(t)[0] ** 2 / 2 - np.cos(path(t)[0])
        assert np.ptp(energy) < 0.05 * np.ptp(path.velocity(t)[0] ** 2)


def test_velocities_about_the_straight_line_reach_what_the_force_asks_for():
    # A fall by g T^2 / 2 and back: the velocity is that of the line and g T / 2 more.
    g, T = 10.0, 2.0
    fall = systems.thrown(g=g)
    problem = Problem(fall, Event(0.0, [0.0, 0.0]), Event(T, [6.0, 0.0]))
    v = about(problem, 400, np.random.default_rng(0))
    assert v.shape == (2, 400)
    exact = np.array([3.0, g * T / 2])
    assert np.min(np.linalg.norm(v - exact[:, None], axis=0)) < 1.0
    assert abs(np.median(v[0]) - 3.0) < 0.3
