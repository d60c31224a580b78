"""Conjugate points against closed forms, independent Jacobi fields, and the index theorem."""

import numpy as np
import pytest
import systems
from helpers import a_quarter, integrated, of_one_leg
from scipy.optimize import brentq

import actionopt as ao
from actionopt import scenes
from actionopt.analysis.spectra import conjugate
from actionopt.analysis.spectra.conjugate import Phases, conjugate_points
from actionopt.analysis.spectra.full_form import _at
from actionopt.discrete.action.transcription import Transcription

TIME_TOLERANCE = 1e-8  # relative to the duration: what conjugate points are promised to


def times_of(solution):
    return [p.t for p in conjugate_points(solution) for _ in range(p.multiplicity)]


def free(q, v, t):
    return sum(x * x for x in v) / 2


def test_many_phases_that_turn_together_are_told_apart(monkeypatch):
    """Phases that turn by what they are apart between nodes looked as if none had turned.

    And they are followed once: a root takes some phases more.
    """
    asked, some = [], Phases._some
    monkeypatch.setattr(Phases, "_some", lambda self, t: asked.append(t.size) or some(self, t))
    n, T = 12, 5.0
    K = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    springs = ao.System(lambda q, v, t: v @ v / 2 - q @ (K @ q) / 2, [f"q{i}" for i in range(n)])
    problem = ao.Problem(springs, ao.Event(0.0, np.zeros(n)), ao.Event(T, np.zeros(n)))
    speeds = 2 * np.sin(np.arange(1, n + 1) * np.pi / (2 * n + 2))
    exact = np.sort([k * np.pi / w for w in speeds for k in range(1, 9) if k * np.pi / w < T])
    np.testing.assert_allclose(times_of(ao.solve(problem)), exact, atol=TIME_TOLERANCE * T)
    assert sum(asked) < 5 * exact.size


def test_zeros_of_single_fields_are_all_roots(monkeypatch):
    """Those of one phase thrice, and of others near it, with an inertia that is not diagonal."""
    monkeypatch.setattr(conjugate, "MANY_FIELDS", 1)
    passes, left = conjugate._passes, []
    monkeypatch.setattr(
        conjugate, "_passes", lambda f, t, *x: left.append(t.size) or passes(f, t, *x)
    )
    w, T = np.array([1.0, 1.0, 1.0, 1.001, 2.0]), 7.0
    A = np.linalg.qr(np.vander(w + np.arange(5)))[0] * [1, 2, 1, 3, 1]
    L = lambda q, v, t: ((A.T @ v) @ (A.T @ v) - (w * (A.T @ q)) @ (w * (A.T @ q))) / 2  # noqa: E731
    swings = ao.System(L, [f"q{k}" for k in range(5)])
    problem = ao.Problem(swings, ao.Event(0.0, np.zeros(5)), ao.Event(T, np.zeros(5)))
    exact = np.sort([k * np.pi / x for x in w for k in range(1, 5) if k * np.pi / x < T])
    np.testing.assert_allclose(times_of(ao.solve(problem)), exact, atol=TIME_TOLERANCE * T)
    assert left == [0]  # by phases


@pytest.mark.long
@pytest.mark.parametrize("free", [False, True])
def test_swift_and_slow_turns_of_one_path(free):
    """A phase that rests and turns by pi all at once, between two times, looks as if it had not."""
    w, T = np.array([0.5, 200.0]), 3.0
    springs = ao.System(lambda q, v, t: (v @ v - (w * q) @ (w * q)) / 2, ["x", "y"])
    start, end = ao.Event(0.0, [None if free else 0.0, 0.0]), ao.Event(T, [0.0, 0.0])
    turns = np.arange(1, 200)
    exact = np.sort(np.concatenate([(turns - free / 2) * np.pi / w[0], turns * np.pi / w[1]]))
    found = times_of(ao.solve(ao.Problem(springs, start, end)))
    np.testing.assert_allclose(found, exact[exact < T], atol=TIME_TOLERANCE * T)


def test_a_path_without_neighbours_has_no_conjugate_points():
    rail = ao.System(free, ["x", "y"], constraint=lambda q, t: [q[0] - t, q[1] - t * t])
    problem = ao.Problem(rail, ao.Event(0.0, [0.0, 0.0]), ao.Event(9.0, [9.0, 81.0]))
    assert conjugate_points(ao.solve(problem)) == ()


@pytest.mark.quick(
    "ends0-0.5",
    "ends0-0.95",
    "ends0-1.05",
    "ends1-0.5",
    "ends1-0.95",
    "ends1-1.0",
    "ends1-1.05",
    "ends1-1.4",
)
@pytest.mark.parametrize("half_periods", [0.5, 0.95, 1.0, 1.05, 1.4, 2.6, 10.5])
@pytest.mark.parametrize("ends", [(1.0, 0.4), (0.0, 0.0)])
def test_oscillator(half_periods, ends):
    w = 2.0
    system = ao.System(lambda q, v, t, *, w: (v[0] ** 2 - (w * q[0]) ** 2) / 2, ["x"],
                       parameters={"w": w})  # fmt: skip
    T = half_periods * np.pi / w
    problem = ao.Problem(system, ao.Event(0.0, ends[0]), ao.Event(T, ends[1]))
    found = times_of(ao.solve(problem, throw=False))
    exact = np.arange(1, np.floor(half_periods) + 1) * np.pi / w
    assert len(found) == exact.size
    assert found == pytest.approx(exact, abs=TIME_TOLERANCE * T)


@pytest.mark.long
@pytest.mark.parametrize("w", [1e-8, 1e8])
def test_the_unit_of_time_does_not_matter(w):
    system = ao.System(lambda q, v, t: (v[0] ** 2 - (w * q[0]) ** 2) / 2, ["x"])
    T = 2.6 * np.pi / w
    solution = ao.solve(ao.Problem(system, ao.Event(0.0, 1.0), ao.Event(T, 0.4)))
    assert times_of(solution) == pytest.approx([np.pi / w, 2 * np.pi / w], rel=1e-8)
    assert solution.inertia.index == 2


@pytest.mark.parametrize("start", [0.0, -2.0])
def test_roots_together_are_one_wherever_time_begins(start):
    """Frequencies that differ by 1e-10: too little to tell two times apart."""
    beside = ao.System(
        lambda q, v, t: (v @ v - q[0] ** 2 - (1 + 2e-10) * q[1] ** 2) / 2, ["x", "y"]
    )
    events = ao.Event(start, [1.0, 0.3]), ao.Event(start + 4.0, [0.2, -0.4])
    (point,) = conjugate_points(ao.solve(ao.Problem(beside, *events)))
    assert point.multiplicity == 2
    assert point.t == pytest.approx(start + np.pi, abs=1e-8)


@pytest.mark.quick("2.5-2")
@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("angle", [2.5, 4.0, 7.0])
def test_antipodes_of_a_sphere(dimension, angle):
    # Geodesics of the unit sphere: all fields across vanish at the antipode, dimension - 1 of them.
    names = list("xyzw")[: dimension + 1]
    system = ao.System(free, names, constraint=lambda q, t: sum(x * x for x in q) - 1)

    def arc(t):
        return np.stack([np.cos(angle * t), np.sin(angle * t)] + [0 * t] * (dimension - 1))

    problem = ao.Problem(system, ao.Event(0.0, arc(0.0)), ao.Event(1.0, arc(1.0)))
    solution = ao.solve(problem, guess=arc)
    found = conjugate_points(solution)
    exact = np.arange(1, np.floor(angle / np.pi) + 1) * np.pi / angle
    assert [p.t for p in found] == pytest.approx(exact, abs=TIME_TOLERANCE)
    assert [p.multiplicity for p in found] == [dimension - 1] * exact.size
    assert solution.inertia.index == (dimension - 1) * exact.size


FORCES = {  # V, V', V''
    "quartic": (lambda x: x**4 / 4, lambda x: x**3, lambda x: 3 * x**2),
    "pendulum": (lambda x: -9.81 * np.cos(x), lambda x: 9.81 * np.sin(x),
                 lambda x: 9.81 * np.cos(x)),
}  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize("name", FORCES)
@pytest.mark.parametrize("start", [0.3])
def test_kinetic_foci_against_a_jacobi_field_integrated_alone(name, start):
    V, force, stiffness = FORCES[name]
    amplitude = np.pi / 2
    speed = np.sqrt(2 * (V(amplitude) - V(start)))

    def rate(t, y):
        return [y[1], -force(y[0]), y[3], -stiffness(y[0]) * y[2]]

    T = 6.0 if name == "pendulum" else 14.0
    run = integrated(rate, [start, speed, 0, 1], 0, T)
    grid = np.linspace(0, T, 2001)[1:]
    J = run(grid)[2]
    change = np.flatnonzero(J[1:] * J[:-1] < 0)
    exact = [brentq(lambda t: run(t)[2], grid[i], grid[i + 1], xtol=1e-14) for i in change]
    assert len(exact) >= 3

    system = ao.System(lambda q, v, t: v[0] ** 2 / 2 - V(q[0]), ["x"])
    curve = lambda t: run(t)[:1]  # noqa: E731
    problem = ao.Problem(system, ao.Event(0.0, curve(0.0)), ao.Event(T, curve(T)))
    found = times_of(ao.solve(problem, guess=curve))
    assert found == pytest.approx(exact, abs=TIME_TOLERANCE * T)


@pytest.mark.parametrize(("c", "count"), [(0.848337938094979, 0), (0.23509499023453274, 1)])
def test_soap_film(c, count):
    # Catenoids y = c cosh(x / c) between rings of radius 1 at x = -+0.5 (Lindeloef): the field
    # that vanishes at a is tangent to the family y(x; c, b) through it, and vanishes where the
    # tangents of the profile at a and t meet on the axis.
    h = 0.5

    def contact(x):
        return x - c / np.tanh(x / c)  # where the tangent at x cuts the axis

    exact = [brentq(lambda x: contact(x) - contact(-h), 1e-6, 5.0)] if count else []
    system = ao.System(lambda q, v, t: q[0] * np.sqrt(1 + v[0] ** 2), ["y"])
    problem = ao.Problem(system, ao.Event(-h, 1.0), ao.Event(h, 1.0))
    solution = ao.solve(problem, guess=lambda x: c * np.cosh(x / c)[None], tol=1e-9)
    assert times_of(solution) == pytest.approx(exact, abs=TIME_TOLERANCE)
    assert solution.inertia.index == count
    if count:
        assert exact[0] == pytest.approx(0.15291143859845605, rel=1e-12)


@pytest.mark.long
@pytest.mark.parametrize("c", [0.0, 2.0, 100.0])
def test_focal_points_of_a_free_start_with_a_total_derivative(c):
    # L + d/dt(c q^2 cos(30 t) / 2): a free start has v = -c q, and so have the neighbours.
    def lagrangian(q, v, t, *, c):
        turn = q[0] * v[0] * np.cos(30 * t) - 15 * q[0] ** 2 * np.sin(30 * t)
        return (v[0] ** 2 - 4 * q[0] ** 2) / 2 + c * turn

    system = ao.System(lagrangian, ["x"], parameters={"c": c})
    problem = ao.Problem(system, ao.Event(0.0, [None]), ao.Event(3.0, 1.0))
    first = np.arctan2(1.0, c / 2) / 2  # cos 2t = c / 2 sin 2t
    exact = [first, first + np.pi / 2]
    assert times_of(ao.solve(problem)) == pytest.approx(exact, abs=3e-8)


# Along an obstacle there are no conjugate points.
SYSTEMS = {name: scenes.get(name).problem.system for name in of_one_leg()}
UNFORCED = [name for name, x in SYSTEMS.items() if not (x.structure.forced or x.r)]


@pytest.mark.quick(
    "catenoid",
    "charge_spatial",
    "great_ellipse",
    "inverted_cone",
    "oscillator_2d",
    "rotating_frame_bound",
    "sliding_wedge",
    "turning_wire",
)
@pytest.mark.parametrize("name", a_quarter(UNFORCED, 1))
def test_index_theorem_on_every_scene(name):
    scene = scenes.get(name)
    solution = ao.solve(scene.problem, guess=scene.guess)
    found = times_of(solution)
    end = scene.problem.end.t
    assert solution.inertia.index == sum(t < end for t in found)
    known = scene.facts.get("conjugate_times")
    if known is not None and len(known):
        before = [t for t in known if t <= end]
        assert found == pytest.approx(before, abs=TIME_TOLERANCE * scene.problem.duration)


@pytest.mark.long
def test_no_conjugate_point_of_many_coordinates_is_told_by_the_index(monkeypatch):
    """A row of springs of which the fastest swings at almost two: its first one is after pi / 2."""

    def springs(q, v, t):
        stretched = np.concatenate([q[:1], q[1:] - q[:-1], q[-1:]])
        return v @ v / 2 - stretched @ stretched / 2

    system = ao.System(springs, [f"u{k}" for k in range(24)])
    frequencies = 2 * np.sin(np.pi * np.arange(24, 0, -1) / 50)
    fastest = frequencies[0]
    times = []
    for part in (0.98, 1.02):
        T = part * np.pi / fastest
        found = ao.solve(ao.Problem(system, ao.Event(0.0, np.zeros(24)), ao.Event(T, np.ones(24))))
        times.append([c.t for c in ao.conjugate_points(found)])
    assert times[0] == []
    exact = np.pi / frequencies
    assert times[1] == pytest.approx(exact[exact < T], abs=1e-8)
    monkeypatch.setattr("actionopt.analysis.spectra.conjugate.regular_index", lambda *given: None)
    assert ao.conjugate_points(found)[0].t == times[1][0]


@pytest.mark.parametrize("angle", [0.0, 0.4])
def test_rays_meet_again_behind_a_mirror(angle):
    # The tangential focus of a mirror of radius 1: 1/s + 1/s' = 2/cos(angle).
    plane, way, on = ao.System(free, ["x", "y"]), 0.8, 2.5
    a, b = ([1 - s * np.cos(angle), y * s * np.sin(angle)] for s, y in ((way, 1), (on, -1)))
    mirror = ao.Bounce(lambda q, t: 1 - q[1] ** 2 / 2 - q[0])
    problem = ao.Problem(plane, ao.Event(0, a), ao.Event(1, b), through=[mirror])
    found = ao.solve(problem, guess=np.transpose([a, [1, 0], b]), tol=1e-10)
    focus = 1 / (2 / np.cos(angle) - 1 / way)
    assert times_of(found) == pytest.approx([(way + focus) / (way + on)], abs=TIME_TOLERANCE)
    assert found.morse_index == 1


def test_neighbours_through_waypoints_begin_anew():
    oscillator = systems.oscillator("x y")
    given = [ao.Event(1.0, [0.3, None]), ao.Event(5.0, [0.1, 0.4])]
    problem = ao.Problem(oscillator, ao.Event(0, [0, 0]), ao.Event(9.0, [0.2, 0.1]), through=given)
    found = ao.solve(problem, tol=1e-10)
    # x after it was given at 1, y since the start; both after they were given at 5.
    expected = [np.pi, 1 + np.pi, 5 + np.pi, 5 + np.pi]
    assert times_of(found) == pytest.approx(expected, abs=1e-7)
    assert found.morse_index == len(expected)


@pytest.mark.quick("2")
@pytest.mark.parametrize(
    "k", [0, 2, 3, 5, *(pytest.param(k, marks=pytest.mark.slow) for k in (1, 4))]
)
def test_conjugate_points_number_the_index_of_a_path_through_events(k):
    rng = np.random.default_rng(k)
    a, b, w = *rng.uniform(-0.6, 0.6, (2, 2)), rng.uniform(-0.05, 0.05)
    fall = ao.System(lambda q, v, t: (v @ v - q @ q * (k % 2)) / 2 - q[1], ["x", "y"])
    wall = ao.Bounce(lambda q, t: 1 + w * t - q[0] ** 2 / 1.4**2 - q[1] ** 2)
    between = [wall] * (1 + k % 3) if k < 4 else [ao.Event(None, [0.5, -0.2])]
    problem = ao.Problem(fall, ao.Event(0, a), ao.Event(4, b), through=between)
    found = ao.solve(problem, tol=1e-9)
    assert len(times_of(found)) == found.morse_index


def test_an_event_keeps_its_time_or_gets_the_one_found():
    assert _at(ao.Event(1.0, [0.0]), 2.0).t == 1.0
    assert _at(ao.Event(None, [0.0]), 2.0).t == 2.0


@pytest.mark.parametrize("slope", [1.0, None])
def test_zeros_are_found_whether_their_slope_is_known_or_not(slope):
    exact, asked = np.array([0.3, 1.7, 2.0]), []

    def miss(which, t):
        asked.append(t)
        x = t - exact[which]
        return np.sin(2 * x) / 2 + x**2 / 9

    every = np.arange(3)
    low, high = exact - [0.3, 0.6, 0.1], exact + [0.5, 0.2, 0.6]
    ends = low, miss(every, low), high, miss(every, high)
    assert conjugate._passes(miss, *ends, slope) == pytest.approx(exact, abs=1e-12)
    assert len(asked) < 10


def test_conjugate_points_take_three_second_derivatives_of_the_action(monkeypatch):
    """One on the path's own mesh, one on a finer one, one along the better path there."""
    system = ao.System(lambda q, v, t: v @ v / 2 - (q @ q + (q[1] - q[0]) ** 2) / 2, ["x", "y"])
    ends = ao.Event(0.0, [0.0, 0.0]), ao.Event(5.0, [0.3, 0.1])
    found = ao.solve(ao.Problem(system, *ends), tol=1e-4)
    kkt, taken = Transcription.kkt, []
    monkeypatch.setattr(Transcription, "kkt", lambda tr, z: taken.append(z) or kkt(tr, z))
    times = [point.t for point in ao.conjugate_points(found)]
    assert times == pytest.approx([np.pi / 3**0.5, np.pi, 2 * np.pi / 3**0.5])
    assert len(taken) == 3
