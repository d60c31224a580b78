"""Events on surfaces: transversality, against closed forms; the index, against focal points."""

import copy
import pickle
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import systems
from helpers import at_once
from scipy.optimize import brentq

import actionopt as ao
from actionopt.analysis.status import Status
from actionopt.discrete.borders.surfaces import onto
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.meshes.path import Path
from actionopt.families.sweeps import task
from actionopt.solver.kinds import nearest_points
from actionopt.solver.kinds.free_contact import _ends
from actionopt.solver.kinds.nearest_points import NEAREST_POINTS
from actionopt.solver.kinds.unfixed import Unfixed
from actionopt.solver.refinement.verdict import solution_of

A, B = 2.0, 1.0  # semi-axes
INSIDE = [0.3, 0.1]  # the evolute: four normals


def plane():
    return systems.particle("x y")


def ellipse(q, t, *, a, b):
    return (q[0] / a) ** 2 + (q[1] / b) ** 2 - 1


def to_ellipse(start=INSIDE, **others):
    values = {"a": A, "b": B, **others}
    events = ao.Event(0.0, start), ao.Event(1.0, None, on=ellipse)
    return ao.Problem(plane(), *events, parameters=values)


def normals(x, y):
    """Feet of the normals from a point, by the angle of the ellipse, and centres of curvature."""

    def off(s):
        return -A * np.sin(s) * (A * np.cos(s) - x) + B * np.cos(s) * (B * np.sin(s) - y)

    s = np.linspace(0.0123, 0.0123 + 2 * np.pi, 400)
    s = [brentq(off, a, b, xtol=1e-15) for a, b in pairwise(s) if off(a) * off(b) < 0]
    c = A * A - B * B
    feet = np.array([A * np.cos(s), B * np.sin(s)]).T
    return feet, np.array([c / A * np.cos(s) ** 3, -c / B * np.sin(s) ** 3]).T


@pytest.mark.long
def test_lines_to_far_points_of_a_surface_may_take_finer_meshes():
    """A body with the energy 1/2 goes straight to the nearest point of a ball, beside a spring."""
    system = ao.System(lambda q, v, t: v @ v / 2 - 50 * q[3] ** 2, list("xyzw"))
    end = ao.Event(None, None, on=lambda q, t: (q[0] - 3) ** 2 + q[1:] @ q[1:] - 4)
    found = ao.solve(ao.Problem(system, ao.Event(0.0, np.zeros(4)), end, energy=0.5))
    assert found.duration == pytest.approx(1.0, abs=1e-9)
    np.testing.assert_allclose(found(found.end.t), [1.0, 0.0, 0.0, 0.0], atol=1e-9)


@pytest.mark.long
def test_the_shortest_way_to_an_ellipse_needs_no_guess():
    feet, _ = normals(*INSIDE)
    lengths = np.linalg.norm(feet - INSIDE, axis=1)
    for principle in ("auto", "least"):
        found = ao.solve(to_ellipse(), tol=1e-11, principle=principle)
        assert found.end.q == pytest.approx(feet[np.argmin(lengths)], abs=1e-10)
        assert found.action == pytest.approx(lengths.min() ** 2 / 2, rel=1e-12)
        assert found.error <= 1e-11 and found.morse_index == 0 and found.compare().agrees
    normal = 2 * found.end.q / np.array([A, B]) ** 2
    assert found.momenta[1] == pytest.approx(-found.surface_multipliers[1] * normal, abs=1e-12)
    assert found.surface_multipliers[0].size == 0


@pytest.mark.long
def test_four_normals_and_their_indices():
    """The index of a normal is the number of centres of curvature on it; Morse's theorem."""
    feet, centres = normals(*INSIDE)
    assert len(feet) == 4
    indices = []
    for foot, centre in zip(feet, centres, strict=True):
        guess = np.array([INSIDE, foot + 0.02]).T
        way = ao.solve(to_ellipse(), guess=guess, tol=1e-10)
        assert way.end.q == pytest.approx(foot, abs=1e-9)
        at = np.dot(centre - foot, INSIDE - foot) / np.sum((INSIDE - foot) ** 2)
        indices.append(int(0 < at < 1))
        assert way.morse_index == indices[-1]
        assert way.between_times.morse_index == 0  # a straight line between points
        back = way.problem.asked.replace(
            start=ao.Event(0.0, None, on=ellipse), end=ao.Event(1.0, INSIDE)
        )
        focal = ao.conjugate_points(ao.solve(back, guess=guess[:, ::-1], tol=1e-10))
        assert [p.t for p in focal] == pytest.approx([at] * indices[-1], abs=1e-9)
    assert sorted(indices) == [0, 0, 1, 1]


@pytest.mark.long
def test_derivatives_of_the_action():
    def action(**change):
        start = [INSIDE[0] + change.pop("x", 0.0), INSIDE[1] + change.pop("y", 0.0)]
        return ao.solve(to_ellipse(start, **change), guess=way, tol=1e-12).action

    way = ao.solve(to_ellipse(), tol=1e-12)
    found, h = way.sensitivity(), 1e-4
    for name, value in (("a", A), ("b", B)):
        slope = (action(**{name: value + h}) - action(**{name: value - h})) / (2 * h)
        assert found.parameters[name] == pytest.approx(slope, rel=1e-6)
    second = (action(x=h) - 2 * way.action + action(x=-h)) / h**2
    assert found.q0q0[0, 0] == pytest.approx(second, rel=1e-6)
    assert not found.q1.any() and not found.q1q1.any()
    # one coordinate given, the other on the curve: it moves along
    start, part = ao.Event(0.0, INSIDE), lambda x: ao.Event(1.0, [x, None], on=ellipse)
    values = {"a": A, "b": B}
    there = [ao.Problem(plane(), start, part(1.2 + x), parameters=values) for x in (-h, 0.0, h)]
    ends = [ao.solve(p, guess=[[0.3, 1.2], [0.1, 0.8]], tol=1e-12) for p in there]
    assert ends[1].end.q == pytest.approx([1.2, 0.8], abs=1e-12)
    S = [s.action for s in ends]
    found = ends[1].sensitivity()
    assert found.q1[0] == pytest.approx((S[2] - S[0]) / (2 * h), rel=1e-6)
    assert found.q1q1[0, 0] == pytest.approx((S[2] - 2 * S[1] + S[0]) / h**2, rel=1e-5)


@pytest.mark.long
def test_between_two_circles():
    def first(q, t):
        return q @ q - 1

    def second(q, t):
        return (q[0] - 4) ** 2 + (q[1] - 3) ** 2 - 4

    events = ao.Event(0.0, None, on=first), ao.Event(1.0, None, on=second)
    way = ao.solve(ao.Problem(plane(), *events))
    assert np.sqrt(2 * way.action) == pytest.approx(5 - 1 - 2, rel=1e-9)
    assert way.morse_index == 0 and way.kind == "minimum"
    far = ao.solve(way.problem.asked, guess=[[-0.8, 5.6], [-0.6, 4.2]])
    assert np.sqrt(2 * far.action) == pytest.approx(8, rel=1e-9)
    assert far.morse_index == 2


@pytest.mark.long
def test_a_free_particle_to_a_moving_wall():
    """p u = p^2 / 2 - E where the wall moves at u: p = u + sqrt(u^2 + 2 E)."""
    E, u, wall = 1.3, 0.4, 2.0
    on = lambda q, t: q[0] - wall - u * t  # noqa: E731
    events = ao.Event(0.0, [0.0, 0.0]), ao.Event(None, None, on=on)
    for tol in (1e-6, 1e-11):
        found = ao.solve(ao.Problem(plane(), *events, energy=E), tol=tol)
        p = u + np.sqrt(u * u + 2 * E)
        assert found.duration == pytest.approx(wall / (p - u), rel=tol)
        assert found.start.v == pytest.approx([p, 0.0], abs=10 * tol)
    assert found.sensitivity().t1 == pytest.approx(-E, rel=1e-9)
    back = ao.Problem(plane(), ao.Event(None, None, on=on), ao.Event(3.0, [9.0, 0.0]), energy=E)
    found = ao.solve(back)  # leaves the wall at t0
    p = u + np.sqrt(u * u + 2 * E)
    assert 9.0 - wall - u * found.start.t == pytest.approx(p * found.duration, rel=1e-9)
    given = ao.solve(ao.Problem(plane(), events[0], ao.Event(1.5, None, on=on)))
    assert given.end.q == pytest.approx([wall + u * 1.5, 0.0], abs=1e-9)


@pytest.mark.long
@pytest.mark.parametrize("u", [-2.14, -3.0])
def test_a_wall_that_runs_away_faster_than_motions_of_the_energy(u):
    """There H - E = u p; in a well, where H is that at the start."""
    E, q0, wall = 0.5, 0.66, 0.1
    well = systems.oscillator()
    events = ao.Event(0.0, [q0]), ao.Event(None, None, on=lambda q, t: q[0] - wall - u * t)
    found = ao.solve(ao.Problem(well, *events, energy=E), tol=1e-9)
    v0, T = found.start.v[0], found.duration
    q, v = q0 * np.cos(T) + v0 * np.sin(T), v0 * np.cos(T) - q0 * np.sin(T)
    assert q == pytest.approx(wall + u * T, abs=1e-7)
    assert (v0**2 + q0**2) / 2 - E == pytest.approx(u * v, abs=1e-7)


def test_the_action_changes_with_the_time_at_which_a_moving_wall_is_left():
    """S = (X - w - u t0)^2 / (2 (T - t0)) from a wall at w + u t."""
    w, u, t0, X, T = 1.0, 0.4, 0.5, 9.0, 3.0
    wall = ao.Event(t0, None, on=lambda q, t: q[0] - w - u * t)
    found = ao.solve(ao.Problem(plane(), wall, ao.Event(T, [X, 0.0]))).sensitivity()
    way, time = X - w - u * t0, T - t0
    assert found.t0 == pytest.approx(way**2 / (2 * time**2) - u * way / time, rel=1e-9)
    assert found.t1 == pytest.approx(-(way**2) / (2 * time**2), rel=1e-9)


def test_from_a_point_of_the_sphere_to_a_parallel():
    """Meridians meet it at right angles, and each other at the poles."""
    sphere = systems.particle("x y z", constraint=lambda q, t: (q @ q - 1) / 2)
    low, high = 0.3, 1.1  # latitudes
    start = ao.Event(0.0, [np.cos(low), 0.0, np.sin(low)])
    end = ao.Event(1.0, None, on=lambda q, t: q[2] - np.sin(high))
    near = ao.solve(ao.Problem(sphere, start, end), tol=1e-10)
    assert np.sqrt(2 * near.action) == pytest.approx(high - low, rel=1e-10)
    assert near.morse_index == 0 and near.compare().agrees
    over = lambda t: np.array([np.cos(low + 1.7 * t), 0 * t, np.sin(low + 1.7 * t)])  # noqa: E731
    far = ao.solve(ao.Problem(sphere, start, end), guess=over, tol=1e-10)
    assert np.sqrt(2 * far.action) == pytest.approx(np.pi - high - low, rel=1e-10)
    assert far.morse_index == 1  # the pole is on the way


def test_with_forces_the_momentum_is_normal():
    system = systems.particle("x y", force=lambda q, v, t: [-v[0], -v[1]])
    end = ao.Event(1.0, None, on=lambda q, t: q[0] + q[1] - 2)
    found = ao.solve(ao.Problem(system, ao.Event(0.0, [0.0, 0.0]), end))
    assert found.start.v == pytest.approx(np.ones(2) / (1 - np.exp(-1.0)), rel=1e-8)
    with pytest.raises(ValueError, match="non-conservative"):
        _ = found.morse_index


def test_what_is_made_of_a_solution(tmp_path):
    way = ao.solve(to_ellipse())
    way.save(tmp_path / "way.npz")
    loaded = ao.load(tmp_path / "way.npz", system=plane())
    for other in (pickle.loads(pickle.dumps(way)), copy.deepcopy(way), loaded):
        assert other.morse_index == 0 and other.end.q == pytest.approx(way.end.q, abs=1e-15)
        assert other.problem.asked.end.q == (None, None)
        assert other.surface_multipliers[1] == pytest.approx(way.surface_multipliers[1], rel=1e-9)
        again = ao.solve(other.problem, guess=other)
        assert again.end.q == pytest.approx(way.end.q, abs=1e-8)
    assert ao.load(tmp_path / "way.npz").end.q == pytest.approx(way.end.q, abs=1e-15)
    runs = ao.sweep(to_ellipse(), {"b": [0.8, 1.0, 1.2]}, record="index")
    assert runs.action[1] == pytest.approx(way.action, rel=1e-9)
    assert runs.solution(2).problem.parameters["b"] == 1.2
    assert runs.index.tolist() == [0, 0, 0]


def on_axis(q, t):
    return q[1]


@at_once(
    ("make", "say"),
    [
        (lambda: ao.Event(1.0, [0.0, 1.0], on=on_axis), "a coordinate that is free"),
        (lambda: ao.Event(1.0, None, on=3.0), "on as a callable"),
        (lambda: ao.Event(np.inf, [0.0, 1.0], on=on_axis), "at infinite time"),
        (lambda: to(ao.Event(1.0, [None, 0.0], on=on_axis)), "contain a coordinate that is"),
        (lambda: to(ao.Event(1.0, None, on=lambda q, t: t - 1)), "contain a coordinate that is"),
        (lambda: to(ao.Event(1.0, None, on=lambda q, t: [])), "found \\[\\]"),
        (lambda: to(ao.Event(1.0, None, on=lambda q, t: [q[0], q[1], q @ q])), "at most as many"),
        (lambda: to(ao.Event(1.0, None, on=lambda q: q[0])), "on\\(q, t"),
        (lambda: to(ao.Event(1.0, None, on=lambda q, v, t: q[0])), "leave out v"),
        (lambda: to(ao.Event(1.0, None, on=lambda q, t, *, r: q[0] - r)), "parameter 'r'"),
        (
            lambda: to(ao.Event(1.0, None, on=lambda q, t: [q[0], q[1] == 1])),
            "comparison .* number 1",
        ),
        (lambda: to(ao.Event(1.0, None, on=lambda q, t: q[2])), "2 coordinates, q\\[2\\]"),
    ],
)
def test_what_has_no_meaning_is_refused(make, say):
    with pytest.raises(ValueError, match=say):
        make()


def to(end):
    on = on_axis if end.on is None else None
    start = ao.Event(0.0, [0.0, None], on=on) if on else ao.Event(0.0, [0.0, 0.0])
    return ao.Problem(plane(), start, end)


def test_a_surface_without_points_is_said_and_nothing_of_free_times():
    with pytest.raises(ao.SolveError, match="no point was found on the surface") as raised:
        ao.solve(to(ao.Event(1.0, None, on=lambda q, t: q @ q + 1)))
    assert "comes to rest" not in str(raised.value)


def test_a_path_that_ran_away_is_no_fault_of_the_events():
    circle = systems.particle("x y", constraint=lambda q, t: q @ q - 1)
    end = ao.Event(None, None, on=lambda q, t: q[0] - q[1])
    run = Unfixed(ao.Problem(circle, ao.Event(0.0, [1.0, 0.0]), end, energy=0.5), tol=1e-8)
    far = Path(Mesh.uniform(0.0, 1.0, 2, 4), np.full((2, 9), 1e24))
    run.transcribe(far.mesh, far)
    run.here = replace(run.here, error=1e37)
    # No word of the end, which is off the circle.
    solution = solution_of(run, Status.DEGENERATE, "guess", 0.0)
    assert solution.status is Status.DEGENERATE


def test_elements_end_where_a_law_is_switched_by_the_clock():
    system = ao.System(lambda q, v, t: v[0] ** 2 / 2 - np.where(t < 0.37, 0.0, 8.0) * q[0], ["x"])
    end = ao.Event(1.0, None, on=lambda q, t: q[0] + 0.5)
    solution = ao.solve(ao.Problem(system, ao.Event(0.0, [1.0]), end))
    assert np.abs(solution.mesh.boundaries - 0.37).min() < 1e-12
    t, fall = np.linspace(0.0, 1.0, 21), 4 * np.maximum(np.linspace(0.0, 1.0, 21) - 0.37, 0.0) ** 2
    v0 = fall[-1] - 1.5
    assert solution(t)[0] == pytest.approx(1.0 + v0 * t - fall, abs=solution.error + 1e-14)


def test_more_that_is_refused():
    start, end = ao.Event(0.0, [0.0, 0.0]), ao.Event(1.0, None, on=lambda q, t: q[0] - 1)
    moving = lambda q, t: q[0] - t  # noqa: E731
    with pytest.raises(ValueError, match="one time that is given"):
        ao.Problem(plane(), ao.Event(None, [0.0, 0.0]), ao.Event(None, None, on=moving), energy=1.0)
    other = systems.particle("x y z")
    known = ao.Problem(plane(), start, end).end
    with pytest.raises(ValueError):
        ao.Problem(other, ao.Event(0.0, [0.0, 0.0, 0.0]), known)
    with pytest.raises(ao.SolveError, match=r"inf\); no point was found"):
        ao.solve(ao.Problem(plane(), start, ao.Event(1.0, None, on=lambda q, t: q @ q + 1)))
    with pytest.raises(ValueError, match="principle"):
        ao.solve(to_ellipse(), principle="most")


@pytest.mark.slow
def test_all_the_normals_and_a_family():
    feet, _ = normals(*INSIDE)
    lengths = np.sort(np.linalg.norm(feet - INSIDE, axis=1))
    found = ao.solve_all(to_ellipse(), starts=1)
    assert [np.sqrt(2 * s.action) for s in found] == pytest.approx(lengths, rel=1e-9)
    assert [s.morse_index for s in found] == [0, 0, 1, 1]
    circle = ao.Event(1.0, None, on=lambda q, t: q @ q - 1)
    centre = ao.Problem(plane(), ao.Event(0.0, [0.0, 0.0]), circle)
    assert ao.solve(centre, throw=False).status is ao.Status.DEGENERATE


@pytest.mark.quick("0.0001")
@pytest.mark.parametrize("size", [1.0, 1e-4])
def test_normals_from_a_point_close_to_an_ellipse_and_to_a_small_one(size):
    """One is short, the other leads across: the nearest point tells nothing of how far it is."""
    problem = to_ellipse([0.9 * (1 + (size < 1)), 0.9], a=size, b=1.6 * size)
    found = ao.solve_all(problem, starts=1)
    assert found.indices == (0, 1)
    assert found[1].end.q[1] < 0 < found[0].end.q[1]


@pytest.mark.long
def test_a_small_circle_far_away():
    centre, p = np.array([446.0, 959.0]), np.array([1.3, 0.7])
    end = ao.Event(1.0, None, on=lambda q, t: ((q - centre) / 0.126) @ ((q - centre) / 0.126) - 1)
    found = ao.solve_all(ao.Problem(plane(), ao.Event(0.0, p), end), starts=1)
    lengths = np.linalg.norm(centre - p) + np.array([-0.126, 0.126])
    assert [np.sqrt(2 * s.action) for s in found] == pytest.approx(lengths, rel=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_all_normals_of_random_ellipses_and_ellipsoids(seed):
    """x_i = a_i^2 p_i / (a_i^2 + m), where m makes it a point of the surface."""
    rng = np.random.default_rng(seed)
    n = 2 + seed % 2
    axes, p = rng.uniform(0.4, 2.5, n), rng.normal(0, 1.5, n)
    poles = np.sort(-(axes**2))

    def off(m):
        return np.sum((axes * p / (axes**2 + m)) ** 2) - 1

    count = 0
    edges = [poles[0] - 100, *poles, poles[-1] + 100]
    for low, high in pairwise(edges):
        m = low + (high - low) * np.linspace(1e-9, 1 - 1e-9, 20001)
        count += np.count_nonzero(np.diff(np.sign([off(x) for x in m])))
    free = ao.System(lambda q, v, t: v @ v / 2, ["x", "y", "z"][:n])
    on = lambda q, t: sum((q[i] / axes[i]) ** 2 for i in range(n)) - 1  # noqa: E731
    found = ao.solve_all(ao.Problem(free, ao.Event(0.0, p), ao.Event(1.0, None, on=on)))
    assert len(found) == count
    assert sum((-1) ** k for k in found.indices) == (0 if n == 2 else 2)  # Euler's characteristic


@pytest.mark.quick("0.2")
@pytest.mark.parametrize("lean", [0.0, 0.2, -0.3])
def test_the_quickest_descent_meets_the_wall_squarely(lean):
    scene = ao.scenes.get("descent_to_wall", lean=lean)
    found = ao.solve(scene.problem, tol=1e-10)  # no guess
    t = np.linspace(0.0, 1.0, 11)
    assert found(t) == pytest.approx(scene.exact(t), abs=1e-9)
    along = found.end.v / np.linalg.norm(found.end.v)
    assert along == pytest.approx([np.cos(lean), np.sin(lean)], abs=1e-8)
    assert found.length / np.sqrt(2 * 9.81) == pytest.approx(scene.facts["fall_time"], rel=1e-9)
    assert found.morse_index == 0


@pytest.mark.long
def test_from_the_pole_to_a_parallel_is_a_family():
    sphere = systems.particle("x y z", constraint=lambda q, t: (q @ q - 1) / 2)
    end = ao.Event(1.0, None, on=lambda q, t: q[2] - 0.5)
    found = ao.solve(ao.Problem(sphere, ao.Event(0.0, [0.0, 0.0, 1.0]), end), throw=False)
    assert found.status is ao.Status.DEGENERATE


@pytest.mark.long
def test_a_clock_and_a_moving_surface():
    """p = -mu on_q and H - E = mu on_t at the end, with H by forward integration."""
    E = 1.5
    system = ao.System(lambda q, v, t: v @ v / 2 - np.sin(t) * q[0], ["x", "y"])
    end = ao.Event(None, None, on=lambda q, t: q[0] + 0.3 * q[1] - 2 - 0.2 * t)
    found = ao.solve(ao.Problem(system, ao.Event(0.0, [0.0, 0.0]), end, energy=E), tol=1e-11)
    T, (vx, vy) = found.end.t, found.start.v
    p = np.array([vx + np.cos(T) - 1, vy])  # x'' = -sin t
    q = np.array([vx * T + np.sin(T) - T, vy * T])
    (mu,) = found.surface_multipliers[1]
    assert q[0] + 0.3 * q[1] == pytest.approx(2 + 0.2 * T, rel=1e-10)
    assert p == pytest.approx([-mu, -0.3 * mu], rel=1e-9)
    assert p @ p / 2 + np.sin(T) * q[0] - E == pytest.approx(-0.2 * mu, rel=1e-9)
    runs = ao.sweep(found.problem, {"energy": [1.0, 1.5]})
    assert runs.action[1] == pytest.approx(found.action, rel=1e-7)


@pytest.mark.long
def test_a_member_that_its_neighbour_does_not_lead_to_is_solved_without_it(monkeypatch):
    def solve(problem, *, guess=None, **options):
        found = ao.solve(problem, guess=guess, **options)
        return replace(found, status=ao.Status.NOT_FOUND) if guess is not None else found

    monkeypatch.setattr(task, "solve", solve)
    runs = ao.sweep(to_ellipse(), {"b": [0.8, 1.0, 1.2]})
    assert (runs.status == "SOLVED").all()


def test_points_of_many_coordinates_are_the_nearest_and_others_in_random_directions():
    n = NEAREST_POINTS + 1
    free = ao.System(lambda q, v, t: v @ v / 2, [f"x{k}" for k in range(n)])
    sphere = ao.Event(1.0, None, on=lambda q, t: q @ q - 1)
    pairs = nearest_points.near(ao.Problem(free, ao.Event(0.0, 2 * np.eye(n)[0]), sphere))
    assert len(pairs) == 1 + 2 * NEAREST_POINTS
    assert pairs[0][1] == pytest.approx(np.eye(n)[0])
    for start, end in pairs:
        assert start == pytest.approx(2 * np.eye(n)[0])
        assert end @ end == pytest.approx(1)


def test_points_on_a_surface_are_found_all_at_once_and_those_that_are_lost_are_left_out():
    system = ao.System(lambda q, v, t: v @ v / 2, ["x", "y"])
    circle = ao.Event(1.0, None, on=lambda q, t: q @ q - t**2)
    problem = ao.Problem(system, ao.Event(0.0, (3.0, 0.0)), circle)
    q, t = np.array([[3.0, 0.0], [0.0, 0.0], [0.0, -2.0]]), np.array([1.0, 1.0, 0.5])
    found = onto(problem, problem.end, q, t, np.ones(2))
    assert np.isnan(found[1]).all()  # the centre has no slope
    np.testing.assert_allclose(found[[0, 2]], [[1.0, 0.0], [0.0, -0.5]], atol=1e-15)
    assert q[0, 0] == 3.0  # what is given stays


@pytest.mark.long
def test_a_throw_meets_a_sinking_plane_on_its_way_up_and_down():
    """S + E T = x^2 / 2T - T x / 2 - T^3 / 24 + 2 T, x = 1 - T / 2, is stationary twice."""
    ball = ao.System(lambda q, v, t: v @ v / 2 - q[0], ["x"])
    end = ao.Event(None, None, on=lambda q, t: q[0] - 1 + t / 2)
    found = ao.solve_all(ao.Problem(ball, ao.Event(0, 0.0), end, energy=2.0))
    T = np.linspace(0.1, 10, 20001)
    x = 1 - T / 2
    slope = np.diff(x**2 / 2 / T - T * x / 2 - T**3 / 24 + 2 * T)
    roots = T[1:-1][slope[1:] * slope[:-1] < 0]
    assert roots.size == 2
    np.testing.assert_allclose(sorted(s.end.t for s in found), roots, atol=2e-3)
    assert len(ao.solve_all(ao.Problem(ball, ao.Event(0, 0.0), end, energy=2.0), shots=0)) == 1


def test_ends_of_a_guess_are_put_on_their_surfaces():
    circle = ao.Event(1.0, [None, None], on=lambda q, t: q @ q - 1)
    problem = ao.Problem(systems.particle("x y"), ao.Event(0.0, [0.0, 0.0]), circle)
    path = ao.Path.interpolate(lambda t: np.stack([3 * t, 4 * t]), ao.Mesh.uniform(0, 1, 2, 3))
    np.testing.assert_allclose(_ends(problem, path), [[0, 0], [0.6, 0.8]], atol=1e-9)


def test_points_that_are_given_twice_are_one():
    circle = ao.Event(1.0, [None, None], on=lambda q, t: q @ q - 1)
    problem = ao.Problem(systems.particle("x y"), ao.Event(0.0, [0.0, 0.0]), circle)
    pair = np.array([[0.0, 0.0], [0.6, 0.8]])
    pairs = [pair, pair + 1e-12, pair * [1, -1]]
    found = [at.path.values[:, -1] for _, at in nearest_points.points(problem, pairs)]
    assert sorted(x[1] for x in found) == [-0.8, 0.8]
