"""Paths with many bounces are found without a guess."""

from itertools import islice, pairwise, product
from types import SimpleNamespace

import numpy as np
import pytest
import systems

import actionopt as ao
from actionopt.solver.kinds.ray_tracing import (
    EVENT_MISSED,
    RAY_SLOWER,
    RAYS,
    ClosedRayTracer,
    RayTracer,
)
from actionopt.solver.kinds.rays import BEST_RAYS, RaySearch
from actionopt.solver.kinds.through import starts

FREE = systems.particle("x y")
ELLIPSE = ao.Bounce(lambda q, t: 1 - (q[0] / 2) ** 2 - q[1] ** 2)


def reflected(points, normal):
    """By how much directions along a polygon (k + 2, 2) are not reflected at its inner corners."""
    along = np.diff(points, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    misses = []
    for q, (a, b) in zip(points[1:-1], pairwise(along), strict=True):
        m = normal(q) / np.linalg.norm(normal(q))
        misses.append(np.abs(a - 2 * (m @ a) * m - b).max())
    return max(misses)


@pytest.mark.long
@pytest.mark.parametrize("bounces", [3, pytest.param(6, marks=pytest.mark.slow)])
def test_many_bounces_in_an_ellipse(bounces):
    ends = ao.Event(0, [1.2, 0.1]), ao.Event(1, [0.4, -0.5])
    found = ao.solve(ao.Problem(FREE, *ends, through=[ELLIPSE] * bounces), tol=1e-11)
    points = np.array([found(e.t) for e in (found.start, *found.problem.through, found.end)])
    assert reflected(points, lambda q: np.array([q[0] / 4, q[1]])) < 1e-10
    assert np.ptp(np.linalg.norm(np.diff(points, axis=0), axis=1) / np.diff([
        0.0, *(e.t for e in found.problem.through), 1.0
    ])) < 1e-8  # fmt: skip


def oscillations(bounces):
    """A body on a spring between ends beside its middle, and a wall from which it springs back."""
    spring = ao.System(lambda q, v, t: (v @ v - q @ q) / 2, ["x", "y"])
    wall = ao.Bounce(lambda q, t: 1 - q[0])
    T = 2 * np.pi * bounces - 2
    ends = ao.Event(0, [0, 0.01]), ao.Event(T, [0.1, 0.02])
    return ao.Problem(spring, *ends, through=[wall] * bounces)


def test_a_motion_returns_to_its_wall_though_its_first_step_is_taken_again():
    problem = oscillations(2)
    tracer = RayTracer.of(problem, np.ones(2), problem.end.t)
    angle = np.linspace(-1.2, 1.2, 16)
    traced = tracer.follow(30 * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    track, _ = traced.tracks[1]
    assert (track.times[1] > track.times[0]).all()  # the step that was refused is not among them
    _, (_, _, which) = tracer._meet(1, track)
    assert which.size == angle.size


@pytest.mark.long
def test_motions_too_slow_to_reach_the_wall_are_made_faster():
    found = ao.solve(oscillations(3), tol=1e-10)
    width = abs(found.start.v[0])
    times = [e.t for e in found.problem.through]
    assert np.diff(times) == pytest.approx(2 * np.pi - 2 * np.arccos(1 / width), abs=1e-8)


ORBIT = ao.Event(0, [None, 0.1]), ao.Periodic(1)


@pytest.mark.slow
def test_a_chord_of_a_billiard_without_a_guess():
    """The longest one of a quartic, there and back."""
    quartic = ao.Bounce(lambda q, t: 1 - q[0] ** 4 / 4 - q[1] ** 4)
    chord = ao.solve(ao.Problem(FREE, *ORBIT, through=[quartic] * 2))
    assert chord.action == pytest.approx(8 * np.sqrt(5), rel=1e-9)


@pytest.mark.long
def test_a_family_of_closed_paths_without_a_guess():
    """Poncelet's triangles."""
    triangle = ao.solve(ao.Problem(FREE, *ORBIT, through=[ELLIPSE] * 3), throw=False)
    d = np.sqrt(16 - 4 + 1)  # all perimeters are the same (Garcia, Amer. Math. Monthly 126 (2019))
    length = 2 * (d + 5) * np.sqrt(2 * d - 5) / 3
    assert triangle.status is ao.Status.DEGENERATE
    assert triangle.action == pytest.approx(length**2 / 2, rel=1e-9)


@pytest.mark.slow
def test_a_ball_bounces_twice_in_all_ways():
    """The places of the bounces do not tell these apart, their times do."""
    ball = ao.System(lambda q, v, t: v[0] ** 2 / 2 - q[0], ["y"])
    floor = ao.Bounce(lambda q, t: q[0])
    paths = ao.solve_all(
        ao.Problem(ball, ao.Event(0, [1.0]), ao.Event(5, [0.5]), through=[floor] * 2), starts=1
    )

    def misses(v):  # from 1 with velocity v, to the floor twice, and on to 0.5 at t = 5
        speed = np.sqrt(v**2 + 2)
        since = 5 - (v + speed) - 2 * speed
        return np.where((since > 0) & (since < 2 * speed), speed * since - since**2 / 2 - 0.5, 9.0)

    m = misses(np.linspace(-3, 3, 20001))
    assert len(paths) == np.count_nonzero((m[1:] * m[:-1] < 0) & (np.abs(np.diff(m)) < 0.1))
    assert all(abs(misses(s.start.v[0])) < 1e-8 for s in paths)


@pytest.mark.long
def test_a_ball_is_thrown_up_for_all_the_time_that_there_is():
    """From the height 1 to .5 with one bounce, g = 1: three ways, two of which leave fast."""
    ball = ao.System(lambda q, v, t: v @ v / 2 - q[0], ["x"])
    ends, floor = (ao.Event(0, 1.0), ao.Event(5, 0.5)), ao.Bounce(lambda q, t: q[0])
    paths = ao.solve_all(ao.Problem(ball, *ends, through=[floor]))
    v = np.linspace(-5, 5, 20001)
    hit = v + np.sqrt(v**2 + 2)
    m = (hit - v) * (5 - hit) - (5 - hit) ** 2 / 2 - 0.5
    roots = v[1:][m[1:] * m[:-1] < 0]
    assert roots.size == 3
    np.testing.assert_allclose(sorted(s.start.v[0] for s in paths), roots, atol=1e-3)


@pytest.mark.long
def test_a_body_is_thrown_against_the_strongest_force_that_it_meets():
    """The potential is .56 x where x > 0, -1.91 x beyond: three ways across, one of them fast."""
    near = ao.System(lambda q, v, t: v @ v / 2 - 0.56 * q[0], ["x"])
    far = ao.System(lambda q, v, t: v @ v / 2 + 1.91 * q[0], ["x"])
    ends, kink = (
        (ao.Event(0, 0.57), ao.Event(3.67, -0.29)),
        ao.Event(None, None, on=lambda q, t: q[0]),
    )
    paths = ao.solve_all(ao.Problem([near, far], *ends, through=[kink]))
    v = np.linspace(-5, 5, 20001)
    hit = np.sqrt(v**2 + 2 * 0.56 * 0.57)
    left = 3.67 - (v + hit) / 0.56
    m = np.where(left > 0, -hit * left + 1.91 * left**2 / 2 + 0.29, np.nan)
    roots = v[1:][m[1:] * m[:-1] < 0]
    assert roots.size == 3
    np.testing.assert_allclose(sorted(s.start.v[0] for s in paths), roots, atol=1e-3)


@pytest.mark.slow
def test_the_first_motions_nearly_arrive():
    """What is yielded first, obeys the law of reflection on its way, before Newton's method."""
    spring = ao.System(lambda q, v, t: v @ v / 2 - q @ q / 2, ["x", "y"])
    disc = ao.Bounce(lambda q, t: 1 - q @ q)
    ends = ao.Event(0, [0.5, 0.1]), ao.Event(2.4, [-0.2, 0.6])
    problem = ao.Problem(spring, *ends, through=[disc] * 2)
    path, times = next(islice(starts(problem, None, 3), 2, None))
    assert np.abs(1 - np.sum(path(times[1:3]) ** 2, axis=0)).max() < 1e-2
    energies = [
        spring.energy(path(t), path.velocity(t), t)
        for t in np.concatenate([np.linspace(a, b, 5)[1:-1] for a, b in pairwise(times)])
    ]
    assert np.ptp(energies) < 0.1 * np.mean(energies)


def test_closer_motions_are_sought_about_those_that_cost_least():
    everywhere = np.full((5, 2), 7.0)
    tracer = SimpleNamespace(
        size=np.ones(1), unit=np.ones(2), at=SimpleNamespace(joints=[0, 1]), span=1.0,
        all_round=lambda random: everywhere,
    )  # fmt: skip
    search, random = RaySearch(tracer), np.random.default_rng(3)
    np.testing.assert_array_equal(search.closer(random, 3), everywhere[:3])  # nothing is known
    u = random.standard_normal((40, 2))
    cost = np.linalg.norm(u - u[11], axis=1)
    search.add(SimpleNamespace(u=u, cost=cost, places=u[:, :, None], times=0 * u))
    best = search.minima()
    found = search.closer(random, 200)
    assert best[0] == 11 and found.shape == (200, 2)
    away = np.linalg.norm(found - u[np.resize(best[:BEST_RAYS], 200)], axis=1)
    assert 0 < np.median(away) < search.apart[best].max()


@pytest.mark.long
@pytest.mark.parametrize(("E", "aside", "bounces"), [(3.0, -0.6, 3), (2.0, 1.0, 2)])
def test_a_throw_of_given_energy_bounces_for_longer_than_a_straight_way_takes(E, aside, bounces):
    """Nearly straight up or down: a ball of g = 1 from the height .5 to .5, `aside` of it."""
    ball = ao.System(lambda q, v, t: v @ v / 2 - q[1], ["x", "y"])
    floor = ao.Bounce(lambda q, t: q[1])
    ends = ao.Event(0, [0.0, 0.5]), ao.Event(None, [aside, 0.5])
    found = ao.solve(ao.Problem(ball, *ends, through=[floor] * bounces, energy=E))

    def duration(u, first, last):
        up, hit = np.sqrt(2 * E - 1 - u**2), np.sqrt(2 * E - u**2)
        return hit + first * up + 2 * (bounces - 1) * hit + hit + last * up

    closed = []
    for first, last in product((1, -1), repeat=2):
        u = np.sign(aside) * np.linspace(1e-9, 0.999 * np.sqrt(2 * E - 1), 200_001)
        off = u * duration(u, first, last) - aside
        closed += duration(u[:-1], first, last)[off[1:] * off[:-1] <= 0].tolist()
    assert np.abs(np.array(closed) - found.duration).min() < 1e-3
    assert found.energy(found.duration / 3) == pytest.approx(E, abs=1e-9)


@pytest.mark.parametrize("scale", [1.0, 50.0])
def test_motions_of_a_free_particle_are_straight_and_turn_at_a_wall(scale):
    """Times, places and costs in closed form, however the surfaces are scaled."""
    wall = ao.Bounce(lambda q, t: scale * (1 - q[0]))
    end = ao.Event(2.0, [None, None], on=lambda q, t: scale * (q[1] - 0.4))
    problem = ao.Problem(systems.particle("x y"), ao.Event(0.0, [0.0, 0.0]), end, through=[wall])
    v = np.array([[1.0, 0.2], [2.0, 0.05], [0.5, 0.1], [-1.0, 0.3]])
    traced = RayTracer.of(problem, np.array([2.0, 4.0]), 2.0).follow(v)
    assert traced.through.tolist() == [True, True, True, False]  # the last one moves away from it
    (vx, vy), hit, t = v[:3].T, traced.times[:3, 1], traced.times[:3, 2]
    np.testing.assert_allclose(hit, 1 / vx)
    np.testing.assert_allclose(traced.places[:3, 1].T, [np.ones(3), vy / vx])
    np.testing.assert_allclose(traced.places[:3, 2].T, [2 - vx * t, vy * t])
    late = RAY_SLOWER * np.log(t / 2)
    np.testing.assert_allclose(traced.cost[:3], np.hypot(late, (vy * t - 0.4) / 4))
    # It never comes nearer: told is how far it is at its last sample, t = 8, in sizes (2).
    np.testing.assert_allclose(traced.cost[3], EVENT_MISSED + 9 / 2)


def test_states_are_sought_between_neighbours_that_part():
    """Motions of u > 0 come to the event, the others do not: the next ones begin at u = 0."""
    tracer = SimpleNamespace(
        size=np.ones(1), unit=np.ones(1), at=SimpleNamespace(joints=[0, 1]), span=1.0
    )
    search, u = RaySearch(tracer), np.linspace(-1.0, 1.0, 40)[:, None]
    places = np.where(u > 0, u, np.nan)[:, :, None] * np.ones((1, 2, 1))
    search.add(SimpleNamespace(u=u, cost=u[:, 0] ** 2, places=places, times=0 * places[..., 0]))
    np.testing.assert_allclose(search.between(100), [[0.0]], atol=1e-12)


@pytest.mark.long
def test_closed_rays_of_a_spring_and_a_wall():
    """x'' = -x and a wall at 1: a period of 4 has v = 1 / sin((4 - pi) / 2) at 0."""
    wall, v = ao.Bounce(lambda q, t: 3 * (1 - q[0])), 1 / np.sin((4 - np.pi) / 2)
    spring, start = systems.oscillator(), ao.Event(0.0, [None])
    problem = ao.Problem(spring, start, ao.Periodic(4.0), through=[wall])
    tracer = ClosedRayTracer.of(problem, np.array([2.0]), 4.0)
    u = np.array([[0.0, v], [0.0, 1.02 * v], [0.0, 0.5]])
    traced = tracer.follow(u)
    assert traced.cost[0] < 1e-3 < traced.cost[1] and traced.cost[2] > 50
    np.testing.assert_allclose(tracer.unit, [2.0, 1.0])
    near = tracer.bring_back(u[1:])
    again = tracer.follow(near)
    assert again.cost.max() < 1e-4 and len(near) == 1
    begun = tracer.all_round(np.random.default_rng(0))
    assert begun[:, 0].max() < 1.0 and begun.shape[1] == 2
    energetic = ao.Problem(spring, start, ao.Periodic(None), through=[wall], energy=2.0)
    tracer = ClosedRayTracer.of(energetic, np.array([2.0]), 4.0)
    u = tracer.of_energy(np.array([[0.5, 0.1], [-0.5, -3.0]]))
    np.testing.assert_allclose((u**2).sum(axis=1) / 2, [2.0, 2.0])
    assert np.sign(u[:, 1]).tolist() == [1.0, -1.0]


def test_first_motions_are_up_to_four_times_faster_and_slower():
    ends = ao.Event(0.0, [0.0, 0.0]), ao.Event(2.0, [1.0, 1.0])
    problem = ao.Problem(systems.particle("x y"), *ends)
    tracer = RayTracer.of(problem, np.array([2.0, 4.0]), 2.0)
    v = tracer.all_round(np.random.default_rng(0)) / [2.0, 4.0]
    speeds = 2.0 * np.linalg.norm(v, axis=1)
    assert 0.25 <= speeds.min() < 0.3 and 3.5 < speeds.max() <= 4.0
    angles = np.sort(np.arctan2(v[:, 1], v[:, 0]))
    np.testing.assert_allclose(np.diff(angles), 2 * np.pi / RAYS)
