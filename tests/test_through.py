"""Paths through events: waypoints, surfaces between the ends, reflections and refractions."""

from __future__ import annotations

import pickle
from itertools import pairwise
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import systems
from helpers import at_once
from scipy.optimize import brentq

import actionopt as ao
from actionopt.analysis.spectra.full_form import form_until
from actionopt.discrete.borders.bordered import Bordered
from actionopt.discrete.borders.borders import over
from actionopt.discrete.matrices.factors import full
from actionopt.plot import fan_data, fronts_data, spectrum_data
from actionopt.solver.ends.durations import explain_barrier
from actionopt.solver.kinds import through
from actionopt.solver.kinds.through import _join_answers, relax_legs, starts

FREE = systems.particle("x y")
OSCILLATOR = systems.oscillator()


def oscillation(a, b, T):
    """Return S, p(0) and p(T) of x'' = -x from a to b in the time T."""
    S = ((a * a + b * b) * np.cos(T) - 2 * a * b) / (2 * np.sin(T))
    return S, (b - a * np.cos(T)) / np.sin(T), (b * np.cos(T) - a) / np.sin(T)


@pytest.mark.long
@pytest.mark.parametrize(("a", "b"), [(0.5, -1.0), (-0.2, 0.7)])
def test_waypoints_are_passed_with_impulses(a, b):
    events = [ao.Event(1.0, [a]), ao.Event(2.2, [b])]
    found = ao.solve(ao.Problem(OSCILLATOR, ao.Event(0, [0.0]), ao.Event(3, [1.0]), through=events))
    legs = [oscillation(0.0, a, 1.0), oscillation(a, b, 1.2), oscillation(b, 1.0, 0.8)]
    assert found.action == pytest.approx(sum(leg[0] for leg in legs), abs=1e-10)
    jumps = [legs[1][1] - legs[0][2], legs[2][1] - legs[1][2]]  # p after minus before
    assert found.impulses[:, 0] == pytest.approx(jumps, abs=1e-9)
    assert found([1.0, 2.2])[0] == pytest.approx([a, b], abs=1e-14)
    assert found.morse_index == 0  # no leg is as long as pi
    assert found.compare().agrees
    assert [leg.mesh.boundaries[-1] for leg in found.legs] == [1.0, 2.2, 3.0]
    again = pickle.loads(pickle.dumps(found))
    assert again.impulses == pytest.approx(found.impulses, abs=1e-12)


@pytest.mark.long
def test_the_path_of_an_oscillator_through_waypoints_is_the_only_one():
    events = [ao.Event(1.0, [0.5]), ao.Event(4.2, [-0.3])]
    linear = ao.Problem(OSCILLATOR, ao.Event(0, [0.0]), ao.Event(5, [1.0]), through=events)
    found = ao.solve_all(linear)
    assert len(found) == 1 and found.complete


@pytest.mark.slow
def test_all_paths_through_a_waypoint_are_those_of_the_legs():
    pendulum = systems.pendulum("x")
    events = ao.Event(0, [0.1]), ao.Event(4.5, [-0.2]), ao.Event(5.5, [0.3])
    few: dict[str, Any] = {"windings": 0, "starts": 3, "continuations": 0}
    legs = [ao.solve_all(ao.Problem(pendulum, *ends), **few) for ends in pairwise(events)]
    start, middle, end = events
    found = ao.solve_all(ao.Problem(pendulum, start, end, through=[middle]), **few)
    sums = sorted(a.action + b.action for a in legs[0] for b in legs[1])
    assert len(sums) == 3
    assert [s.action for s in found] == pytest.approx(sums, abs=1e-9)


def test_a_coordinate_that_is_free_at_a_waypoint_is_smooth():
    problem = ao.Problem(
        FREE, ao.Event(0, [0, 0]), ao.Event(2, [1, 3]), through=[ao.Event(1.5, [2, None])]
    )
    found = ao.solve(problem)
    assert found(1.5)[1] == pytest.approx(2.25, abs=1e-12)  # y goes straight on
    assert found.impulses[0] == pytest.approx([-2 - 4 / 3, 0], abs=1e-11)


def test_a_free_time_keeps_the_energy():
    """Thrown back at x = 1.5 at a time that is found: p -> -p, H continuous."""
    problem = ao.Problem(
        OSCILLATOR, ao.Event(0, [0.0]), ao.Event(3, [0.4]), through=[ao.Event(None, [1.5])]
    )
    found = ao.solve(problem, tol=1e-11, guess=[[0.0, 1.5, 0.4]])

    def kept(t):
        return oscillation(0.0, 1.5, t)[2] ** 2 - oscillation(1.5, 0.4, 3 - t)[1] ** 2

    t = brentq(kept, 1.6, 1.66)  # another root is the oscillation itself, which passes smoothly
    assert found.problem.through[0].t == pytest.approx(t, abs=1e-10)
    assert found.energy_jumps == pytest.approx([0], abs=1e-12)
    assert found.morse_index == 1


def test_a_passage_half_way_is_left_for_a_least_one():
    # Half of the time to the event and half of it back is stationary, and the action is largest.
    g, T, x, before = 3.0, 6.0, 0.1, np.linspace(0.01, 3.0, 100_001)
    throw = ao.System(lambda q, v, t: v[0] ** 2 / 2 - g * q[0], ["x"])
    S = sum((x - 1) ** 2 / (2 * h) - g * h * (1 + x) / 2 - (g * h) ** 2 * h / 24
            for h in (before, T - before))  # fmt: skip
    ends = ao.Event(0, [1.0]), ao.Event(T, [1.0])
    found = ao.solve(ao.Problem(throw, *ends, through=[ao.Event(None, [x])]), principle="least")
    assert found.status is ao.Status.SOLVED and found.morse_index == 0
    assert found.action == pytest.approx(S.min(), abs=1e-6)


@pytest.mark.slow
def test_one_curve_that_passes_a_place_twice_is_two_answers():
    """Smoothly going out and coming back, or thrown back: three times of passage."""
    problem = ao.Problem(
        OSCILLATOR, ao.Event(0, [0.0]), ao.Event(3, [0.4]), through=[ao.Event(None, [1.5])]
    )
    late: Any = brentq(
        lambda t: oscillation(0, 1.5, t)[2] + oscillation(1.5, 0.4, 3 - t)[1], 1.6, 1.66
    )
    size = 0.4 / np.sin(3.0)  # the oscillation from 0 to 0.4 in t = 3
    passes = [np.arcsin(1.5 / size), np.pi - np.arcsin(1.5 / size)]
    found = np.sort([cast(float, s.problem.through[0].t) for s in ao.solve_all(problem)])
    assert found == pytest.approx(np.sort([late, *passes]), abs=1e-8)


@pytest.mark.slow
def test_rays_far_from_the_line_between_events_above_each_other_are_found():
    """Three rays from (0.05, 6) to (0.1, -4) refracted at y = x^2, by a scan of where they are."""
    upper = ao.System(lambda q, v, t: 1.5**2 * (v @ v) / 2, ["x", "y"])
    bowl = ao.Event(None, None, on=lambda q, t: q[1] - q[0] ** 2)
    ends = ao.Event(0, [0.05, 6.0]), ao.Event(1, [0.1, -4.0])
    found = ao.solve_all(ao.Problem([upper, FREE], *ends, through=[bowl]))
    x = np.linspace(-3, 3, 6001)
    length = 1.5 * np.hypot(x - 0.05, x**2 - 6) + np.hypot(x - 0.1, x**2 + 4)
    slope = np.diff(length)
    stationary = x[1:-1][slope[1:] * slope[:-1] < 0]
    places = np.sort([cast(float, s.problem.through[0].q[0]) for s in found])
    assert places == pytest.approx(stationary, abs=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("long", [1.0, 2.0])
def test_closed_orbits_of_an_ellipse_are_a_family(long):
    """Poncelet: triangles of one length, in the circle the equilateral ones."""
    wall = ao.Bounce(lambda q, t: 1 - q[0] ** 2 / long**2 - q[1] ** 2)
    problem = ao.Problem(FREE, ao.Event(0, [None, 0.0]), ao.Periodic(1.0), through=[wall] * 3)
    with pytest.raises(ao.SolveError) as caught:
        ao.solve(problem)
    found = caught.value.solution
    assert found.status is ao.Status.DEGENERATE and found.inertia.nullity == 1

    def longest(c):  # of triangles with a corner at angle c; along the family it is the same
        s = np.linspace(0, 2 * np.pi, 721)
        q = np.array([long * np.cos(s), np.sin(s)])
        p = np.array([long * np.cos(c), np.sin(c)])
        sides = np.hypot(*(q - p[:, None]))
        return (sides[:, None] + sides + np.hypot(*(q[:, :, None] - q[:, None]))).max()

    lengths = [longest(c) for c in (0.3, 1.1)]
    assert lengths == pytest.approx([np.sqrt(2 * found.action)] * 2, rel=1e-4)


@pytest.mark.long
@pytest.mark.parametrize("x", [0.1 + 0.2 - 0.3, 1e-20])
def test_a_coordinate_that_is_round_off_does_not_spoil_the_index(x, tmp_path):
    """A ball above a flat floor, and above a bowl, the sides of which it could use."""
    ball = systems.thrown(g=1.0)
    ends = ao.Event(0, [x, 1.0]), ao.Event(2, [None, 0.5])
    for steep, index in ((0.0, 0), (1.0, 1)):
        floor = ao.Bounce(lambda q, t, steep=steep: q[1] - steep * q[0] ** 2)
        found = ao.solve(ao.Problem(ball, *ends, through=[floor]))
        assert (found.inertia.index, found.inertia.nullity) == (index, 0)
    found.save(tmp_path / "ball.npz")
    assert ao.load(tmp_path / "ball.npz", ball).morse_index == 1


@pytest.mark.long
def test_first_paths_keep_given_coordinates():
    """A particle through four events with one path that few first paths lead to.

    The reference is Newton's method on one Legendre polynomial a leg, its degree 18, from there;
    the index was counted by dense second derivatives of that.
    """
    system = ao.System(
        lambda q, v, t: (
            (v[0] ** 2 + v[1] ** 2 + v[2] ** 2) / 2
            + 0.13 * (q[0] * v[1] - q[1] * v[0]) / 2
            - 1.69 * (q[0] ** 4 + q[1] ** 4 + q[2] ** 4) / 4
        ),
        ["x", "y", "z"],
    )
    through = [
        ao.Event(1.128, None, on=lambda q, t: q[0] + 0.36 * q[1] - 0.04 * t),
        ao.Event(None, [-0.75, None, None]),
        ao.Event(3.382, [None, 0.23, None]),
    ]
    ends = ao.Event(0.0, [-0.46, -0.92, -0.97]), ao.Event(4.51, [0.63, 0.83, 0.21])
    found = ao.solve(ao.Problem(system, *ends, through=through), tol=1e-10)
    assert found.action == pytest.approx(5.200784998420946, abs=1e-10)
    assert found.legs[2].mesh.boundaries[0] == pytest.approx(1.8000711604686697, abs=1e-9)
    assert found.morse_index == 4


def test_heron_and_snell():
    mirror = ao.Event(None, None, on=lambda q, t: q[1])
    start = ao.Event(0, [0, 1])
    heron = ao.solve(ao.Problem(FREE, start, ao.Event(1, [3, 2]), through=[mirror]), tol=1e-11)
    assert heron.action == pytest.approx((3**2 + 3**2) / 2, abs=1e-10)  # the image at (3, -2)
    assert heron.problem.through[0].q == pytest.approx((1.0, 0.0), abs=1e-10)
    glass = ao.System(lambda q, v, t, *, n: n**2 * (v @ v) / 2, ["x", "y"], parameters={"n": 1.5})
    air = ao.System(lambda q, v, t, *, n: n**2 * (v @ v) / 2, ["x", "y"], parameters={"n": 1.0})
    media: Any = [air, glass]
    problem = ao.Problem(media, start, ao.Event(1, [2, -1]), through=[mirror])
    ray = ao.solve(problem, tol=1e-11)

    def bent(x):
        return x / np.hypot(x, 1) - 1.5 * (2 - x) / np.hypot(2 - x, 1)

    x: Any = brentq(bent, 0, 2)
    assert ray.problem.through[0].q == pytest.approx((x, 0.0), abs=1e-10)
    optical = np.hypot(x, 1) + 1.5 * np.hypot(2 - x, 1)
    assert ray.action == pytest.approx(optical**2 / 2, abs=1e-9)
    assert ray.impulses[0, 0] == pytest.approx(0, abs=1e-11)
    assert ray.energy_jumps == pytest.approx([0], abs=1e-10)
    assert ray.morse_index == 0
    assert ray.compare().agrees


@pytest.mark.long
def test_bounces_stay_inside():
    """Three reflections in an ellipse: Joachimsthal's number is that of each leg."""
    wall = ao.Bounce(lambda q, t: 1 - (q[0] / 2) ** 2 - q[1] ** 2)
    ends = ao.Event(0, [-1, -0.2]), ao.Event(1, [1.2, 0.1])
    points = np.array([[-1.0, -0.2], [-1.2, 0.8], [0.3, -0.98], [1.5, 0.66], [1.2, 0.1]]).T
    found = ao.solve(ao.Problem(FREE, *ends, through=[wall] * 3), guess=points, tol=1e-11)
    numbers = []
    for leg in found.legs:
        q, v = leg.values[:, 0], leg.values[:, -1] - leg.values[:, 0]
        v = v / np.linalg.norm(v)
        numbers.append(v[0] ** 2 / 4 + v[1] ** 2 - (q[0] * v[1] - q[1] * v[0]) ** 2 / 4)
    assert np.ptp(numbers) < 1e-10
    assert found.energy_jumps == pytest.approx(np.zeros(3), abs=1e-10)
    inside = found(np.linspace(0, 1, 500))
    assert (1 - (inside[0] / 2) ** 2 - inside[1] ** 2).min() > -1e-12


def test_a_wall_that_moves_changes_the_energy():
    """A ball on a table that rises: v+ - w' = -(v- - w')."""
    ball = ao.System(lambda q, v, t: v[0] ** 2 / 2 - q[0], ["y"])
    table = ao.Bounce(lambda q, t: q[0] - 0.1 * t)
    problem = ao.Problem(ball, ao.Event(0, [1.0]), ao.Event(3, [0.8]), through=[table])
    found = ao.solve(problem, tol=1e-11)
    t = found.problem.through[0].t
    before, after = (part.end.v[0] for part in found.parts[:1]), found.parts[1].start.v[0]
    before = next(iter(before))
    assert after - 0.1 == pytest.approx(0.1 - before, abs=1e-9)
    # The first leg falls from 1 to 0.1 t in the time t.
    assert before == pytest.approx((0.1 * t - 1) / t - t / 2, abs=1e-9)
    assert found.energy_jumps[0] == pytest.approx((after**2 - before**2) / 2, abs=1e-9)


def test_an_event_on_a_circle_that_grows_is_found():
    """On a circle of radius R = 1 + t / 4 the angle grows as t / R: R^2 times its rate is kept."""
    ring = systems.particle("x y", constraint=lambda q, t: q @ q - (1 + t / 4) ** 2)
    a, b = -1.0, 1.2
    ends = ao.Event(0, [np.cos(a), np.sin(a)]), ao.Event(1, [1.25 * np.cos(b), 1.25 * np.sin(b)])
    crossed = ao.Event(None, None, on=lambda q, t: q[1])
    sol = ao.solve(ao.Problem(ring, *ends, through=[crossed]))
    t = sol.problem.through[0].t
    assert t / (1 + t / 4) == pytest.approx(-a / (b - a) / 1.25, abs=1e-8)
    assert sol.action == pytest.approx((1.25 * (b - a) ** 2 + 1 / 16) / 2, rel=1e-8)


def test_what_passes_through_a_wall_is_no_bounce():
    """The shortest way from a point over a line to another line beyond it."""
    line, beyond = ao.Bounce(lambda q, t: q[1]), ao.Event(1, None, on=lambda q, t: q[1] + 1)
    below = ao.Problem(FREE, ao.Event(0, [0, 1]), beyond, through=[line])
    with pytest.raises(ao.SolveError, match="passes through the surface at event 1"):
        ao.solve(below, guess=[[0, 0.1, 0.1], [1, 0, -1]])


@pytest.mark.long
def test_a_step_that_is_too_high_is_not_passed():
    plain = systems.particle("x y")
    high = ao.System(lambda q, v, t: v @ v / 2 - 1.5, ["x", "y"])
    step = [ao.Event(None, None, on=lambda q, t: q[0])]
    ends = ao.Event(0, [-1, 1]), ao.Event(None, [1, -0.5])
    laws: Any = [plain, high]
    problem = ao.Problem(laws, *ends, through=step, energy=1.0)
    assert not ao.solve(problem, guess=[[-1, 0, 1], [1, 0, -0.5]], throw=False).success
    deep = ao.System(lambda q, v, t: v @ v / 2 + 1.5, ["x", "y"])
    found = ao.solve(
        ao.Problem(cast(Any, [plain, deep]), *ends, through=step, energy=1.0), tol=1e-11
    )
    assert found.problem.through[0].t == pytest.approx(1.0, abs=1e-9)  # at (0, 0), by Snell's law
    assert found.duration == pytest.approx(1.5, abs=1e-9)


@pytest.mark.long
def test_index_counts_places_and_times():
    """A negative direction at two resolutions: the far reflection in a circle is a saddle."""
    wall = ao.Bounce(lambda q, t: 1 - q[0] ** 2 - q[1] ** 2)
    ends = ao.Event(0, [-0.5, 0]), ao.Event(1, [0.5, 0])
    near = ao.solve(ao.Problem(FREE, *ends, through=[wall]), guess=[[-0.5, 0.1, 0.5], [0, 1, 0]])
    angles = np.linspace(0.3, 0.7, 2001) * np.pi  # of the point on the circle

    def length(s):
        q = np.array([np.cos(s), np.sin(s)])
        return np.hypot(*(q.T - [-0.5, 0]).T) + np.hypot(*(q.T - [0.5, 0]).T)

    bend = np.diff(length(angles), 2)[1000]
    assert near.morse_index == int(bend < 0) == 1


@pytest.mark.slow
def test_all_reflections_in_a_circle_are_found():
    """Alhazen's problem has four answers, by a quartic equation."""
    wall = ao.Bounce(lambda q, t: 1 - q[0] ** 2 - q[1] ** 2)
    a, b = np.array([0.5, 0.1]), np.array([-0.3, 0.4])
    problem = ao.Problem(FREE, ao.Event(0, a), ao.Event(1, b), through=[wall])
    angles = np.linspace(0, 2 * np.pi, 4001)
    q = np.array([np.cos(angles), np.sin(angles)])
    lengths = np.hypot(*(q.T - a).T) + np.hypot(*(q.T - b).T)
    slopes: Any = np.diff(np.append(lengths[:-1], lengths[:2]))
    extremal = int(np.sum(slopes[1:] * slopes[:-1] < 0))
    found = ao.solve_all(problem, starts=2)
    assert len(found.solutions) == extremal


def test_a_curve_is_a_guess_of_several_bounces_at_one_wall():
    """A ray followed through three reflections in a circle, and given as a curve over its time."""
    corners: Any = [np.array([0.3, 0.2])]
    v = np.array([np.cos(0.4), np.sin(0.4)])
    for _ in range(3):
        q = corners[-1]
        q = q + v * (-q @ v + np.sqrt((q @ v) ** 2 + 1 - q @ q))  # on the circle
        v = v - 2 * (q @ v) * q
        corners.append(q)
    corners.append(corners[-1] + 0.7 * v)
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
    rough = np.diag([1, 0.97, 0.99, 0.95, 1]) @ np.array(corners)
    wall = ao.Bounce(lambda q, t: 1 - q[0] ** 2 - q[1] ** 2)
    ends = ao.Event(0, corners[0]), ao.Event(way[-1], corners[-1])
    found = ao.solve(
        ao.Problem(FREE, *ends, through=[wall] * 3),
        guess=lambda t: np.stack([np.interp(t, way, c) for c in rough.T]),
    )
    assert [event.t for event in found.problem.through] == pytest.approx(way[1:-1], abs=1e-9)
    assert found.action == pytest.approx(way[-1] / 2, abs=1e-10)


@pytest.mark.parametrize("tol", [1e-6, 1e-10])
def test_the_error_is_below_the_estimate(tol):
    ball = ao.System(lambda q, v, t: v[0] ** 2 / 2 - np.cosh(q[0]), ["y"])
    events = [ao.Event(0.7, [0.5]), ao.Event(1.9, [-0.8])]
    problem = ao.Problem(ball, ao.Event(0, [0.0]), ao.Event(2.5, [0.3]), through=events)
    found, exact = ao.solve(problem, tol=tol), ao.solve(problem, tol=1e-13)
    t = np.linspace(0, 2.5, 400)
    assert np.abs(found(t) - exact(t)).max() / np.abs(exact(t)).max() <= max(found.error, 1e-13)
    assert found.error <= tol


def test_many_waypoints_cost_so_many_times_one():
    t = np.linspace(0, 10, 202)
    q = np.sin(3 * t)
    events = [ao.Event(*pair) for pair in zip(t, q[:, None], strict=True)]
    problem = ao.Problem(OSCILLATOR, events[0], events[-1], through=events[1:-1])
    found = ao.solve(problem)
    legs = [oscillation(a, b, t[1]) for a, b in pairwise(q)]
    assert found.action == pytest.approx(sum(leg[0] for leg in legs), rel=1e-9)


@at_once(
    ("events", "message"),
    [
        ([ao.Event(2, [1, 1])], "order of their times"),
        ([ao.Event(0.5, [1])], "expected 2 coordinates"),
        ([ao.Event(None, None)], "nothing given"),
        ([ao.Periodic(0.5)], "Events or Bounces"),
        ([ao.Event(None, [1, None], on=lambda q, t: [q[0], q[1]])], "at most 1"),
    ],
)
def test_events_that_do_not_fit_are_refused(events, message):
    with pytest.raises(ValueError, match=message):
        ao.Problem(FREE, ao.Event(0, [0, 0]), ao.Event(1, [1, 0]), through=events)


def test_what_is_not_known_of_paths_through_events_is_refused():
    between = [ao.Event(0.5, [1, None])]
    ends = ao.Event(0, [0, 0]), ao.Event(1, [1, 0])
    with pytest.raises(ValueError, match="one for each of 2 legs"):
        ao.Problem(cast(Any, [FREE] * 3), *ends, through=between)
    found = ao.solve(ao.Problem(FREE, *ends, through=between))
    for ask in (
        lambda: spectrum_data(found),
        lambda: fan_data(found),
        lambda: fronts_data(found),
    ):
        with pytest.raises(ValueError, match="without events between its ends"):
            ask()
    assert found.parts[0].sensitivity().q1 == pytest.approx(found.parts[0].momenta[1])


def test_modes_through_an_event_vanish_where_it_pins_them():
    ends = ao.Event(0, [0, 0]), ao.Event(1, [1, 0])
    found = ao.solve(ao.Problem(FREE, *ends, through=[ao.Event(0.5, [1, None])]))
    modes = ao.second_variation(found, 3)  # sin pi t in y; half waves in x, or a whole one
    assert modes.eigenvalues / np.pi**2 == pytest.approx([1, 4, 4], rel=1e-9)
    assert modes.modes[0]([0.25, 0.5])[1] ** 2 == pytest.approx([1, 2], rel=1e-9)


@pytest.mark.parametrize("through", [None, ao.Event(0.5, [0, 0])])
def test_what_is_no_list_of_events_is_refused(through):
    with pytest.raises(ValueError, match="expected a list of Events"):
        ao.Problem(FREE, ao.Event(0, [0, 0]), ao.Event(1, [1, 0]), through=through)


def test_an_end_behind_the_wall_is_refused():
    ends = ao.Event(0, [0.0, 1.0]), ao.Event(1, [1.0, 1.0])
    with pytest.raises(ValueError, match="expected the start where on > 0, found on = -1 of"):
        ao.Problem(FREE, *ends, through=[ao.Bounce(lambda q, t: -q[1])])
    ends = ao.Event(0, [0.0, 0.0]), ao.Event(1, [1.0, -2.0])  # begins on the wall
    with pytest.raises(ValueError, match="expected the end where on > 0, found on = -2 of"):
        ao.Problem(FREE, *ends, through=[ao.Bounce(lambda q, t: q[1])])


@pytest.mark.slow
def test_no_path_to_a_wall_is_said_to_be_the_only_one():
    wall = ao.Bounce(lambda q, t: 1 - q[0])
    ends = ao.Event(0, [0.0, 0.0]), ao.Event(1, [0.0, 1.0])
    every = ao.solve_all(ao.Problem(FREE, *ends, through=[wall]))
    assert len(every) == 1 and not every.complete  # L is quadratic, and the question is not


def test_a_bounce_where_two_surfaces_meet_is_refused():
    corner = ao.Bounce(lambda q, t: [q[0] - 1, q[1] - 1])
    with pytest.raises(ValueError, match="returns 2 expressions at event 0"):
        ao.Problem(FREE, ao.Event(0, [0, 0]), ao.Event(1, [0, 0.3]), through=[corner])


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("rows", [2, 3])
def test_a_curve_that_does_not_fit_is_refused(value, rows):
    wall = ao.Bounce(lambda q, t: 1 - q @ q)
    problem = ao.Problem(FREE, ao.Event(0, [0, 0]), ao.Event(1, [0, 0.3]), through=[wall])
    said = "a guess that is finite at all times" if rows == 2 else r"to return \(2, K\) for K times"
    with pytest.raises(ValueError, match=said):
        ao.solve(problem, guess=lambda t: np.full((rows, t.size), value))


def test_between_given_ends_times_of_events_stay_unknown():
    wall = ao.Bounce(lambda q, t: 1 - q @ q)
    problem = ao.Problem(FREE, ao.Event(0, [0, 0]), ao.Event(1, [0, 0.3]), through=[wall])
    assert over(problem, 2.0) is problem


@pytest.mark.long
def test_rays_from_the_centre_and_back_are_a_family():
    wall = ao.Bounce(lambda q, t: 1 - q @ q)
    problem = ao.Problem(FREE, ao.Event(0, [0, 0]), ao.Event(1, [0, 0]), through=[wall])
    with pytest.raises(ao.SolveError, match="a family of dimension 1") as caught:
        ao.solve(problem)
    found = caught.value.solution
    assert found.status is ao.Status.DEGENERATE
    assert found.action == pytest.approx(2.0, abs=1e-6)


def test_the_matrix_is_the_derivative_of_the_equations():
    """A clock, a moving surface, unknown times: against central differences."""

    def lagrangian(q, v, t):
        return v @ v / 2 * (1 + q[0] ** 2) + np.sin(t) * q[0] * v[1]

    system = ao.System(lagrangian, ["x", "y"])
    moving = ao.Bounce(lambda q, t: q[1] - 0.2 * q[0] ** 2 + np.sin(t) * q[0])
    events = [ao.Event(None, [None, 0.3]), moving, ao.Event(0.8, [0.2, None])]
    ends = ao.Event(0, [0, 1]), ao.Event(None, [2, -1])
    problem = ao.Problem(system, *ends, through=events, energy=1.3)
    random, times = np.random.default_rng(0), np.array([0, 0.2, 0.5, 0.8, 1.0])
    path = ao.Path(ao.Mesh(times, 4), random.standard_normal((2, 17)))
    equations, y = Bordered.around(problem, path, None, np.ones(2), times=times)
    y = y + 0.1 * random.standard_normal(y.size)
    steps = 1e-6 * np.eye(y.size)
    columns = [(equations.residual(y + e) - equations.residual(y - e)) / 2e-6 for e in steps]
    matrix = full(equations.layout, equations.kkt(y))
    assert matrix == pytest.approx(np.stack(columns, axis=1), abs=1e-6)


@pytest.mark.quick("1.3-1.7")
@pytest.mark.parametrize(("a", "b"), [(2.0, 1.0), (1.3, 1.7)])
def test_an_orbit_between_the_vertices_of_an_ellipse(a, b):
    """Two bounces on the axis of y: the trace of the monodromy is 4 (1 - L / R)^2, R = a^2 / b."""
    wall = ao.Bounce(lambda q, t: 1 - (q[0] / a) ** 2 - (q[1] / b) ** 2)
    problem = ao.Problem(FREE, ao.Event(0, [None, 0.0]), ao.Periodic(1.0), through=[wall] * 2)
    guess = [[0.01, 0, 0, 0.01], [0, b, -b, 0]]
    found = ao.solve(problem, guess=guess, tol=1e-11)
    assert found.action == pytest.approx((4 * b) ** 2 / 2, abs=1e-9)
    assert np.ptp(found.momenta, axis=0) == pytest.approx([0, 0], abs=1e-9)
    M = ao.monodromy(found)
    J = np.kron([[0, 1], [-1, 0]], np.eye(2))
    assert np.abs(M.T @ J @ M - J).max() < 1e-8
    g = 1 - 2 * b * b / a**2
    assert np.trace(M) == pytest.approx(4 * g * g, abs=1e-8)
    assert M.stable == (abs(g) < 1)
    assert found.compare().agrees


@pytest.mark.parametrize("x", [0.5, -1.2])
def test_a_closed_path_is_kicked_at_a_waypoint(x):
    """x'' = -w^2 x + cos t with one kick a turn: the steady state, and Green's function."""
    w = 1.3
    driven = ao.System(
        lambda q, v, t: v[0] ** 2 / 2 - w**2 * q[0] ** 2 / 2 + q[0] * np.cos(t), ["x"]
    )
    kick = ao.Event(1.0, [x])
    found = ao.solve(
        ao.Problem(driven, ao.Event(0, [None]), ao.Periodic(2 * np.pi), through=[kick]), tol=1e-11
    )
    steady = np.cos(1.0) / (w**2 - 1)
    assert found.impulses[0, 0] == pytest.approx((x - steady) * 2 * w * np.tan(np.pi * w), rel=1e-9)
    assert found.momenta[0] == pytest.approx(found.momenta[1], abs=1e-9)


@pytest.mark.parametrize(
    ("start", "events", "says"),
    [
        ([None, None], [ao.Bounce(lambda q, t: 1 - q @ q)] * 2, "where a closed path .* begins"),
        ([0, None], [ao.Event(0.5, [1, None])], "return in a kink"),
    ],
)
def test_where_a_closed_path_begins_is_said_once(start, events, says):
    with pytest.raises(ValueError, match=says):
        ao.solve(ao.Problem(FREE, ao.Event(0, start), ao.Periodic(1), through=events))


def test_a_closed_path_that_returns_in_a_kink_is_none():
    """Up from y = 0.4 to the floor and back: y returns, with the momentum reversed."""
    fall = systems.thrown(g=1.0)
    bowl = ao.Bounce(lambda q, t: q[1] - 0.2 * q[0] ** 2)
    problem = ao.Problem(
        fall, ao.Event(0, [None, 0.4]), ao.Periodic(None), through=[bowl], energy=0.5
    )
    with pytest.raises(ao.SolveError, match="returns with another momentum"):
        ao.solve(problem, guess=[[0, 0, 0], [0.4, 0, 0.4]])


def on_sphere(theta, phi):
    return [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)]


@pytest.mark.parametrize(
    ("height", "half"), [(-0.9, 0.8), pytest.param(0.3, 1.1, marks=pytest.mark.slow)]
)
def test_reflections_on_a_sphere(height, half):
    sphere = ao.System(
        lambda q, v, t: v @ v / 2, "x y z".split(), constraint=lambda q, t: q @ q - 1
    )
    theta = np.arccos(height) - 0.5
    a, b = on_sphere(theta, -half), on_sphere(theta, half)
    wall = ao.Bounce(lambda q, t: q[2] - height)
    problem = ao.Problem(sphere, ao.Event(0, a), ao.Event(2, b), through=[wall])
    found = ao.solve(problem, tol=1e-11)
    middle = on_sphere(np.arccos(height), 0.0)  # by the mirror symmetry of both ends
    way = 2 * np.arccos(np.dot(a, middle))
    assert found(found.problem.through[0].t) == pytest.approx(middle, abs=1e-9)
    assert found.action == pytest.approx(way**2 / 4, rel=1e-11)
    tangent = [0.0, 1.0, 0.0]
    assert found.impulses[0] @ tangent == pytest.approx(0, abs=1e-9)
    assert found.compare().agrees
    points = sum(point.multiplicity for point in ao.conjugate_points(found))
    assert found.morse_index == points


@pytest.mark.long
@pytest.mark.parametrize("T", [4.0, pytest.param(3.7, marks=pytest.mark.slow)])
def test_a_pendulum_in_x_and_y_passes_what_the_angle_does(T):
    def place(angle):
        return [np.sin(angle), -np.cos(angle)]

    swing = ao.System(lambda q, v, t: v @ v / 2 + np.cos(q[0]), ["angle"])
    rod = systems.thrown(g=1.0, constraint=lambda q, t: q @ q - 1)
    moving = ao.Event(None, None, on=lambda q, t: q[0] - 1 - 0.1 * t)
    same = ao.Event(
        None,
        None,
        on=lambda q, t: q[0] * np.cos(1 + 0.1 * t) + q[1] * np.sin(1 + 0.1 * t),
    )
    events = (ao.Event(None, [1.1]), ao.Event(None, place(1.1))), (moving, same)
    for one, other in events:
        by_angle = ao.Problem(swing, ao.Event(0, [0.3]), ao.Event(T, [0.2]), through=[one])
        known = ao.solve(by_angle, tol=1e-10)
        ends = ao.Event(0, place(0.3)), ao.Event(T, place(0.2))
        problem = ao.Problem(rod, *ends, through=[other])
        found = ao.solve(problem, tol=1e-10)
        assert found.action == pytest.approx(known.action, abs=1e-10)
        assert found.energy_jumps == pytest.approx(known.energy_jumps, abs=1e-8)
        assert found.morse_index == known.morse_index == len(ao.conjugate_points(found))


def test_a_waypoint_off_the_constraints_is_refused():
    rod = systems.particle("x y", constraint=lambda q, t: q @ q - 1)
    ends = ao.Event(0, [1, 0]), ao.Event(1, [0, 1])
    with pytest.raises(ValueError, match="expected event 0 of through on the constraint"):
        ao.Problem(rod, *ends, through=[ao.Event(None, [0.5, 0.5])])


@pytest.mark.long
def test_a_wall_of_several_curves_is_said_to_be_one_function():
    right, left = (
        ao.Bounce(lambda q, t, x=x: 1 - (q[0] - x) ** 2 - q[1] ** 2) for x in (1.0, -1.0)
    )
    ends = ao.Event(0, [0.3, -0.2]), ao.Event(1, [-0.9, 0.5])
    guess = np.array([[0.3, 1.6, -1.8, -0.9], [-0.2, 0.8, -0.6, 0.5]])
    with pytest.raises(
        ao.SolveError, match=r"event 2 is sought behind .* event 1, .* one function"
    ):
        ao.solve(ao.Problem(FREE, *ends, through=[right, left]), guess=guess)
    whole = ao.Bounce(lambda q, t: 1 - q[1] ** 2 - ((abs(q[0] - 1) + abs(q[0] + 1)) / 2 - 1) ** 2)
    stadium = ao.Problem(FREE, *ends, through=[whole] * 2)
    assert ao.solve(stadium, guess=guess).status is ao.Status.SOLVED


def test_answers_are_joined_until_no_further_one_comes():
    answers = [np.zeros((4, 2)), np.ones((4, 2))]
    drawn = []
    for q in _join_answers(answers, 20, np.random.default_rng(0)):
        drawn.append(q)
        if len(drawn) == 3:
            answers.append(2 * np.ones((4, 2)))
    assert any((q[0] == 2).all() or (q[-1] == 2).all() for q in drawn)
    assert all((np.diff(q, axis=0) != 0).any(axis=1).sum() == 1 for q in drawn)  # one change
    assert len({q.tobytes() for q in drawn}) == len(drawn) <= 12
    assert list(_join_answers(answers[:1], 20, np.random.default_rng(0))) == []


def test_what_does_not_belong_at_an_end_is_refused():
    wall = ao.Bounce(lambda q, t: 1 - q[0])
    free = systems.particle()
    for ends, where in (
        ((ao.Event(0, [0.0]), wall), "through="),
        ((wall, ao.Event(1, [0.0])), "through="),
        ((ao.Periodic(1.0), ao.Event(1, [0.0])), "the end of a path"),
    ):
        with pytest.raises(ValueError, match=f"expected an Event at the .*{where}"):
            ao.Problem(free, *ends)


def test_a_least_reflection_is_preferred():
    free = ao.System(lambda q, v, t: v @ v / 2, ["x", "y"])
    wall = ao.Bounce(lambda q, t: 1 - (q[0] / 2) ** 2 - q[1] ** 2)
    a, b = np.array([0.369, -0.083]), np.array([0.882, 0.159])  # Newton's method meets a saddle
    problem = ao.Problem(free, ao.Event(0, a), ao.Event(1, b), through=[wall])
    s = np.linspace(0, 2 * np.pi, 20001)
    on = np.array([2 * np.cos(s), np.sin(s)])
    ways = sum(np.linalg.norm(on - p[:, None], axis=0) for p in (a, b))
    least = ways[1:-1][(ways[1:-1] < ways[:-2]) & (ways[1:-1] < ways[2:])] ** 2 / 2
    found = ao.solve(problem)
    assert found.morse_index == 0 and np.isclose(least, found.action, rtol=1e-6).any()


@pytest.mark.long
def test_a_least_reflection_is_preferred_to_a_saddle_that_is_met_six_times():
    """A ball may meet the floor at three times t and then be at the height 0.8 in time."""
    wall = ao.Bounce(lambda q, t: q[1])
    ends = ao.Event(0, [0, 1]), ao.Event(1.2, [2, 0.8])
    found = ao.solve(ao.Problem(systems.thrown(), *ends, through=[wall]))
    t, T, g = found.problem.through[0].t, 1.2, 9.81
    up = 1 / t + g * t / 2  # after the floor
    assert found.morse_index == 0 and up * (T - t) - g * (T - t) ** 2 / 2 == pytest.approx(0.8)


def test_what_several_laws_do_not_share_is_named(tmp_path):
    def law(n):
        return ao.System(lambda q, v, t, *, n: n**2 * (v @ v) / 2, ["x", "y"], parameters={"n": n})

    media, step = [law(1.0), law(1.5)], ao.Event(None, None, on=lambda q, t: q[1])
    problem = ao.Problem(media, ao.Event(0, [0, 1]), ao.Event(1, [2, -1]), through=[step])
    assert "leg_times" not in repr(problem)
    with pytest.raises(ValueError, match=r"'n', of which the systems have the values 1, 1\.5"):
        problem.replace(parameters={"n": 2.0})
    with pytest.raises(ValueError, match="found 'n', of which the systems have the values"):
        ao.sweep(problem, {"n": [1.0, 2.0]})
    with pytest.raises(ValueError, match=r"unknown parameter 'm'; there are none$"):
        problem.replace(parameters={"m": 2.0})
    ao.solve(problem).save(tmp_path / "ray.npz")
    with pytest.raises(ValueError, match="expected the systems of 2 legs, found one system"):
        ao.load(tmp_path / "ray.npz", media[0])


def test_a_guess_that_passes_no_event_is_read():
    wall = ao.Bounce(lambda q, t: 1 - (q[0] / 2) ** 2 - q[1] ** 2)  # of no slope at the middle
    shot = ao.Problem(FREE, ao.Event(0, [-1, -0.2]), ao.Event(1, [1.2, 0.1]), through=[wall])
    found = ao.solve(shot, guess=lambda t: np.zeros((2, t.size)), throw=False)
    assert not found.success


def test_a_step_of_potential_above_the_energy_is_named():
    laws = [ao.System(lambda q, v, t, V=V: v @ v / 2 - V, ["x", "y"]) for V in (0.0, 1.0)]
    ends, step = (
        (ao.Event(0, [-1, 0]), ao.Event(None, [1, 1])),
        ao.Event(None, None, on=lambda q, t: q[0]),
    )
    low, high = (ao.Problem(laws, *ends, energy=E, through=[step]) for E in (0.5, 2.0))
    assert explain_barrier(low).startswith("the energy 0.5 is below the potential, 1, at x = 1")
    assert not explain_barrier(high)


@pytest.mark.long
def test_modes_of_a_bead_whose_mass_changes_are_those_in_its_angle():
    """Its multiplier jumps with the mass."""

    def bead(m):
        return ao.System(
            lambda q, v, t: m * (v @ v / 2 - 9 * q[1]),
            ["x", "y"],
            constraint=lambda q, t: q @ q - 1,
        )

    def pendulum(m):
        return ao.System(lambda q, v, t: m * (v[0] ** 2 / 2 + 9 * np.cos(q[0])), ["theta"])

    half, y = [ao.Event(1.0, None)], -np.sqrt(0.99)
    ends = ao.Event(0, [0, -1]), ao.Event(2.5, [0.1, y])
    held = ao.solve(ao.Problem([bead(1), bead(2)], *ends, through=half))
    ends = ao.Event(0, [0.0]), ao.Event(2.5, [np.arctan2(0.1, -y)])
    guess = ao.Path(held.mesh, np.unwrap(np.arctan2(held.path.values[:1], -held.path.values[1:])))
    free = ao.solve(ao.Problem([pendulum(1), pendulum(2)], *ends, through=half), guess=guess)
    modes = [ao.second_variation(s, 2).eigenvalues for s in (held, free)]
    assert modes[0] == pytest.approx(modes[1], rel=1e-7)


def test_modes_of_a_bead_on_a_sphere_that_passes_a_height_have_settled():
    """Its multiplier jumps with the momentum, which is free along the circle at that height."""
    bead = ao.System(
        lambda q, v, t: v @ v / 2 - 9 * q[2], ["x", "y", "z"], constraint=lambda q, t: q @ q - 1
    )
    ends, height = (ao.Event(0, [1, 0, 0]), ao.Event(1, [0, 1, 0])), [None, None, -0.6]
    found = ao.solve(ao.Problem(bead, *ends, through=[ao.Event(0.4, height)]))
    first, finer = (form_until(found, None, k).lowest(np.ones(3))[0][:3] for k in (0, 1))
    assert first == pytest.approx(finer, rel=1e-8)


def test_a_solution_that_crosses_its_surface_elsewhere_is_found_again_from_itself():
    line = ao.Event(None, None, on=lambda q, t: q[0] - 1 - 0.3 * t)
    problem = ao.Problem(OSCILLATOR, ao.Event(0, [-0.1]), ao.Event(5.8, [0.2]), through=[line])
    path = ao.solve(problem, principle="stationary")
    again = ao.solve(problem, guess=path)
    assert again.action == pytest.approx(path.action, rel=1e-9)
    assert again.problem.through[0].t == pytest.approx(path.problem.through[0].t, rel=1e-7)


@pytest.mark.long
def test_motions_are_thrown_back_where_they_may_pass():
    a, b, c, T = 0.5, 0.3, 0.9, 3.9  # an oscillator's path meets q = c when it passes or turns back
    line = ao.Event(None, None, on=lambda q, t: q[0] - c)
    ends = ao.Event(0, [a]), ao.Event(T, [b])
    found = ao.solve_all(ao.Problem(OSCILLATOR, *ends, through=[line]), starts=1)

    def turns(t):
        return oscillation(a, c, t)[2] + oscillation(c, b, T - t)[1]

    times = [brentq(turns, *between) for between in ((0.1, 0.7), (0.8, 3.1), (3.2, 3.85))]
    exact = [oscillation(a, c, t)[0] + oscillation(c, b, T - t)[0] for t in times]
    assert sorted(path.action for path in found) == pytest.approx(sorted(exact), abs=1e-9)


def test_a_family_of_unknown_dimension_counts_as_none(monkeypatch):
    class Unknown:
        status = ao.Status.SOLVED

        @property
        def inertia(self):
            raise ValueError("L is not convex in the rates")

    known = SimpleNamespace(status=ao.Status.SOLVED, inertia=SimpleNamespace(nullity=2))
    for may_be, dimension in ((True, 2), (False, 0)):
        monkeypatch.setattr(through, "may_be_family", lambda run, status, may=may_be: may)
        assert (through._family(None, known), through._family(None, Unknown())) == (dimension, 0)


def test_legs_of_a_first_path_are_relaxed_where_an_integral_is_given():
    """They are of the law alone: multipliers are found with the path."""
    system = systems.oscillator(integral=lambda q, v, t: np.sin(q[0]))
    ends, gate = (ao.Event(0, [0.2]), ao.Event(2, [0.5])), ao.Event(None, [-0.7])
    problem = ao.Problem(system, *ends, through=[gate], integral=0.3)
    path, times = next(starts(problem, None))
    t, tau = times[1] / 3, times[1]
    exact = (0.2 * np.sin(tau - t) - 0.7 * np.sin(t)) / np.sin(tau)
    assert relax_legs(problem, path, times)(t)[0] == pytest.approx(exact, abs=1e-5)


@pytest.mark.parametrize(
    ("before", "now"),
    [
        ([ao.Event(0.4, [1.0])], []),
        ([], [ao.Event(0.5, [2.0])]),  # where an element of the guess ends
        ([ao.Event(0.4, [1.0])], [ao.Event(0.5, [1.0])]),
        ([ao.Event(0.4, [1.0]), ao.Event(0.8, [0.0])], [ao.Event(0.4, [1.0])]),
    ],
)
def test_a_solution_through_other_events_is_a_guess(before, now):
    ends = (ao.Event(0, [0.0]), ao.Event(1, [1.0]))
    system = ao.System(lambda q, v, t: v[0] ** 2 / 2, ["x"])
    near = ao.solve(ao.Problem(system, *ends, through=before))
    found = ao.solve(ao.Problem(system, *ends, through=now), guess=near)
    t, x = np.array([[e.t, e.q[0]] for e in (ends[0], *now, ends[1])]).T
    assert found.action == pytest.approx(np.sum(np.diff(x) ** 2 / np.diff(t)) / 2, rel=1e-12)
    np.testing.assert_allclose(found(t)[0], x, atol=1e-12)


def test_a_solution_that_gives_other_coordinates_of_an_event_is_a_guess():
    ends = (ao.Event(0, [0, 0]), ao.Event(1, [1, 1]))
    near = ao.solve(ao.Problem(FREE, *ends, through=[ao.Event(0.5, [1, None])]))
    other = ao.Problem(FREE, *ends, through=[ao.Event(0.5, [None, 1])])
    np.testing.assert_allclose(ao.solve(other, guess=near)(0.5), [0.5, 1], atol=1e-12)


def test_parameters_of_a_problem_may_be_given_to_another():
    """Those of several laws hold the times of legs, those of given integrals kappa."""
    one, other = (
        ao.System(lambda q, v, t, *, n: n**2 * (v @ v) / 2, ["x", "y"], parameters={"n": n})
        for n in (1.0, 1.0)
    )
    ends = ao.Event(0.0, [0.0, 1.0]), ao.Event(1.0, [2.0, -1.0])
    line = [ao.Event(None, None, on=lambda q, t: q[1])]
    two = ao.Problem([one, other], *ends, through=line)
    again = two.replace(parameters={**two.parameters, "n": 1.1})
    assert again.parameters["n"] == 1.1
    assert ao.Problem(one, *ends, parameters=again.parameters).parameters == {"n": 1.1}
    rope = ao.System(
        lambda q, v, t: v[0] ** 2, ["y"], integral=lambda q, v, t: np.sqrt(1 + v[0] ** 2)
    )
    ends = ao.Event(0.0, [0.0]), ao.Event(1.0, [1.0])
    given = ao.Problem(rope, *ends, integral=2.0).parameters
    assert ao.Problem(rope, *ends, parameters=given).parameters == {}


def test_a_motion_that_only_passes_surfaces_is_the_first_path():
    """y'' = -4 y is zero each pi/2, whatever its amplitude: a leg between is one of a family."""
    system = ao.System(lambda q, v, t: (v @ v - q[0] ** 2 - 4 * q[1] ** 2) / 2, ["x", "y"])
    line = ao.Event(None, None, on=lambda q, t: q[1])
    ends = (ao.Event(0, [0, 0.5]), ao.Event(3, [1, 0.5]))
    problem = ao.Problem(system, *ends, through=[line, line])
    path, times = next(starts(problem, None))
    np.testing.assert_allclose(np.diff(times)[1], np.pi / 2, rtol=0.02)
    x, v = np.sin(times) / np.sin(3), (0.5 - 0.5 * np.cos(6)) / np.sin(6)
    y = 0.5 * np.cos(2 * times) + v * np.sin(2 * times)
    np.testing.assert_allclose(path(times), [x, y], atol=0.02)
    found = ao.solve(problem, guess=path)
    S = oscillation(0.0, 1.0, 3.0)[0] + 2 * oscillation(0.5, 0.5, 6.0)[0]
    assert found.action == pytest.approx(S, rel=1e-9)
