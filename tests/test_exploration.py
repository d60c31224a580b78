"""A trial path and what can be done with it, against splines and integrals of others."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import actionopt as ao
from actionopt import scenes
from actionopt.plot.data.exploration import (
    CONJUGATE,
    _why,
    begin,
    bend,
    lasting,
    restart,
    to_solution,
)
from actionopt.plot.data.trial import KNOT_SPANS, knots, move_node, straight

T, W = 2.5, 1.3  # the oscillator's duration, and its frequency


@pytest.fixture(scope="module")
def spring():
    """An oscillator from 1 to 0.5 with k = W^2 and m = 1."""
    return scenes.get("oscillator", k=W**2, duration=T).problem


def quadrature(q, v, breaks, lagrangian):
    """Return the integral of L by Gauss and Legendre's rule between the breaks."""
    xi, w = np.polynomial.legendre.leggauss(24)
    S = 0.0
    for a, b in pairwise(breaks):
        t = a + (b - a) * (xi + 1) / 2
        S += (b - a) / 2 * w @ lagrangian(q(t), v(t), t)
    return S


# -- the trial -------------------------------------------------------------------------------


def test_a_knot_bends_the_path_along_a_natural_spline(spring):
    first = straight(spring)
    node = knots(first)[3]
    trial = move_node(first, node, {0: 1.7})
    times = np.linspace(0.0, T, KNOT_SPANS + 1)
    rise = np.zeros(KNOT_SPANS + 1)
    rise[3] = 1.7 - first.Q[node, 0]
    bend = CubicSpline(times, rise, bc_type="natural")

    def x(t):
        return 1 - 0.5 * t / T + bend(t)

    def v(t):
        return -0.5 / T + bend(t, 1)

    t = np.linspace(0.0, T, 301)
    assert np.max(np.abs(trial.path(t)[0] - x(t))) <= 1e-13
    S = quadrature(x, v, times, lambda x, v, t: v**2 / 2 - W**2 * x**2 / 2)
    assert trial.action == pytest.approx(S, rel=1e-12)
    # The force that is missing to m x'' = -k x.
    inner = trial.tr.mesh.nodes[1:-1]
    force = bend(inner, 2) + W**2 * x(inner)
    assert np.max(np.abs(trial.missing[0, 1:-1] - force)) <= 1e-9 * np.max(np.abs(force))


def test_the_slope_is_the_missing_force_in_the_mean(spring):
    # Along the straight line F = k x: T times the root mean square of k x, and sizes of one.
    x0, x1 = 1.0, 0.5
    expected = T * W**2 * np.sqrt((x0**2 + x0 * x1 + x1**2) / 3)
    assert straight(spring).slope == pytest.approx(expected, rel=1e-3)


def test_no_variation_changes_the_action_faster_than_the_slope_says():
    scene = scenes.get("kepler")
    trial = move_node(straight(scene.problem), 123, {0: -0.3, 1: 0.7})
    tr, rng, eps = trial.tr, np.random.default_rng(3), 1e-6
    t = tr.mesh.nodes / scene.problem.duration
    fastest = 0.0
    for _ in range(40):
        waves = rng.standard_normal((2, 6)) / np.arange(1, 7)
        eta = tr.lengths[:, None] * (waves @ np.sin(np.pi * np.arange(1, 7)[:, None] * t))
        size = np.sqrt(np.mean(np.sum((waves**2), axis=0)) * 6 / 2)  # sines are orthogonal
        lower, upper = (tr.action_and_gradient(trial.Q + s * eps * eta.T)[0] for s in (-1, 1))
        fastest = max(fastest, abs(upper - lower) / (2 * eps) / size)
    assert 0.2 * trial.slope < fastest <= trial.slope


def test_held_elsewhere_the_path_bends_as_a_whole(spring):
    first = straight(spring)
    trial = move_node(first, 100, {0: 2.0})
    t = first.tr.mesh.nodes
    u = t[100]
    rise = (2.0 - first.Q[100, 0]) * t * (T - t) / (u * (T - u))
    assert np.max(np.abs((trial.Q - first.Q)[:, 0] - rise)) <= 1e-13


@pytest.mark.long
def test_only_coordinates_that_no_event_pins_move():
    system = scenes.get("pendulum").problem.system
    problem = ao.Problem(system, ao.Event(0.0, [0.3]), ao.Event(0.5, [None]))
    first = straight(problem)
    assert move_node(first, 0, {0: 9.0}).Q[0, 0] == 0.3
    last = knots(first)[-1]
    assert move_node(first, last, {0: 0.7}).Q[-1, 0] == pytest.approx(0.7, abs=1e-15)
    assert to_solution(begin(problem)).trial.slope <= 1e-8 * first.slope  # p = 0 at the end as well
    behind = straight(ao.Problem(system, ao.Event(0.0, [None]), ao.Event(0.5, [0.3])))
    assert move_node(behind, 0, {0: 0.7}).Q[0, 0] == pytest.approx(0.7, abs=1e-15)


def test_with_constraints_the_path_stays_on_their_surface():
    now = begin(scenes.get("rod_pendulum").problem)
    assert np.max(np.abs(np.hypot(*now.trial.Q.T) - 1)) <= 1e-12
    node = knots(now.trial)[4]
    there = bend(now, now.trial, node, {0: 0.5, 1: -0.6})
    assert np.max(np.abs(np.hypot(*there.trial.Q.T) - 1)) <= 1e-12
    assert not np.allclose(there.trial.Q[node], now.trial.Q[node])
    # Along the rod nothing is missing, across it m l theta'' + m g sin theta.
    x, y = there.trial.Q.T
    theta = ao.Path(now.trial.tr.mesh, np.arctan2(x, -y)[None])
    t = theta.mesh.nodes
    force = (theta.acceleration(t)[0] + 9.81 * np.sin(theta(t)[0])) * np.stack([-y, x])
    inner = slice(1, -1)
    miss = np.abs(there.trial.missing - force)[:, inner]
    assert np.max(miss) <= 1e-3 * np.max(np.abs(force))


def test_where_no_surface_is_near_the_path_stays_and_the_reason_is_said():
    now = begin(scenes.get("rod_pendulum").problem)
    there = bend(now, now.trial, 3, {0: 30.0, 1: 0.0})
    assert there.trial is now.trial
    assert "constraint surface" in there.message


def test_a_path_that_closes_is_refused():
    system = scenes.get("pendulum").problem.system
    with pytest.raises(ValueError, match="a path that closes"):
        begin(ao.Problem(system, ao.Event(0.0, [None]), ao.Periodic(2.0)))


# -- solving ---------------------------------------------------------------------------------


@pytest.mark.quick("damped_oscillator")
@pytest.mark.parametrize("name", ["oscillator", "kepler", "rod_pendulum", "damped_oscillator"])
def test_solving_from_a_bent_path_brings_the_slope_to_zero(name):
    scene = scenes.get(name)
    now = begin(scene.problem, scene.guess)
    node = knots(now.trial)[4]
    now = bend(now, now.trial, node, {0: now.trial.Q[node, 0] + 0.1})
    there = to_solution(now)
    assert there.message == ""
    assert there.trial.slope <= 1e-8 * now.trial.slope
    assert there.trial.action == pytest.approx(scene.action, rel=1e-9)
    t = there.trial.tr.mesh.nodes
    assert np.max(np.abs(there.trial.Q.T - scene.exact(t))) <= 1e-8


@pytest.mark.long
def test_a_trial_near_another_path_leads_to_that_one():
    now = begin(scenes.get("kepler").problem)
    middle = len(now.trial.Q) // 2 + 3
    above, below = (to_solution(bend(now, now.trial, middle, {1: y})) for y in (0.6, -0.6))
    assert above.trial.Q[middle, 1] > 0.7 and below.trial.Q[middle, 1] < -0.3
    assert above.solution.compare().agrees and below.solution.compare().agrees


def test_where_there_is_no_path_the_reason_is_said():
    # x(0) = 0 and x(pi) = 1: sin t, which all motions from 0 are, vanishes at pi.
    system = scenes.get("oscillator").problem.system
    now = begin(ao.Problem(system, ao.Event(0.0, [0.0]), ao.Event(np.pi, [1.0])))
    for there in (to_solution(now), lasting(now, 3.0)):
        assert there.trial is now.trial and there.motion is None and there.verdict is None
        assert there.message == CONJUGATE


# -- the end time ----------------------------------------------------------------------------


@pytest.mark.long
def test_sliding_the_end_through_a_conjugate_point_counts_it(spring):
    now = to_solution(begin(spring))
    focus = np.pi / W
    assert now.motion.times == pytest.approx([focus, 2 * focus, 3 * focus], abs=1e-8)
    for t, verdict in (
        (0.99 * focus, ("minimum", 0)),
        (focus, ("degenerate", 0)),
        (1.01 * focus, ("saddle", 1)),
        (2.5 * focus, ("saddle", 2)),
    ):
        there = lasting(now, t)
        assert there.verdict == verdict
        assert there.message == (CONJUGATE if verdict[0] == "degenerate" else "")
        # The end stays on the motion, and so does the path.
        nodes = there.trial.tr.mesh.nodes
        exact = scenes.get("oscillator", k=W**2, duration=T).exact(nodes)
        assert nodes[-1] == t
        assert np.max(np.abs(there.trial.Q.T - exact)) <= 1e-8


@pytest.mark.long
def test_one_variation_raises_the_action_before_and_lowers_it_after(spring):
    # S of x + 4 A u (1 - u), u = t / T, is larger by 8 A^2 (1 / (3 T) - W^2 T / 30).
    now = to_solution(begin(spring))
    K = len(now.trial.Q)
    middle = K // 2 - 1  # no knot: the path bends as a whole
    u = now.trial.tr.mesh.nodes[middle] / T
    rise = 0.3
    now = bend(now, now.trial, middle, {0: now.trial.Q[middle, 0] + rise})
    A = rise / (4 * u * (1 - u))
    for t in (1.0, 2.3, 2.5, 4.0):
        there = lasting(now, t)
        expected = 8 * A**2 * (1 / (3 * t) - W**2 * t / 30)
        change = there.trial.action - there.stationary.action
        assert change == pytest.approx(expected, rel=1e-7)
    assert change < 0


def test_the_end_slides_as_far_as_the_motion_goes(spring):
    now = to_solution(begin(spring))
    assert now.motion.end == pytest.approx(3 * T)
    there = lasting(now, 100.0)
    assert there.trial.tr.problem.end.t == now.motion.end


def test_the_nearest_conjugate_time_attracts(spring):
    motion = to_solution(begin(spring)).motion
    focus = np.pi / W
    assert motion.near(focus + 0.01, 0.02) == pytest.approx(focus, abs=1e-8)
    away = focus + 0.03
    assert motion.near(away, 0.02) == away
    assert len(motion.before(focus)) == 0 and len(motion.before(focus + 1e-4)) == 1


@pytest.mark.long
def test_a_moving_constraint_takes_the_end_with_it():
    scene = scenes.get("turning_wire")
    there = lasting(to_solution(begin(scene.problem, scene.guess)), 1.4)
    assert there.message == ""
    assert there.trial.slope <= 1e-7


def test_with_forces_that_have_no_potential_there_is_no_index():
    now = lasting(begin(scenes.get("damped_oscillator").problem), 3.0)
    assert now.verdict is None and now.motion.times == []
    assert now.stationary.slope <= 1e-8


def test_it_begins_again_with_the_straight_line():
    spring = ao.System(lambda q, v, t: (v @ v - q @ q) / 2, ["x"])
    now = begin(ao.Problem(spring, ao.Event(0.0, [0.0]), ao.Event(1.0, [1.0])))
    solved = to_solution(now)
    assert np.abs(solved.trial.Q - now.trial.Q).max() > 0.01
    np.testing.assert_array_equal(restart(solved).trial.Q, now.trial.Q)


def test_why_there_is_no_path_is_said():
    assert _why(ao.Status.DEGENERATE) == CONJUGATE
    assert _why(ao.Status.NOT_FOUND) == ao.Status.NOT_FOUND.value
