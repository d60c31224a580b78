"""Paths along obstacles, f(q, t) >= 0, against closed forms and elementary geometry."""

import pickle
from copy import deepcopy
from itertools import pairwise
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest
import systems
from helpers import a_quarter, at_once, slow

import actionopt as ao
from actionopt import plot
from actionopt.analysis.status import Status
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.borders.borders import times_of
from actionopt.discrete.borders.contact_times import with_contact_times
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.families.searches.obstacle_search import curves
from actionopt.mechanics.laws.switches import minimum_parts
from actionopt.mechanics.question.held import Held
from actionopt.mechanics.question.obstacle import Arc
from actionopt.solver.contact import first_contacts, least_along, obstacle, taut_strings
from actionopt.solver.contact.first_contacts import _where_zero, other_sides, rows_between
from actionopt.solver.contact.obstacle import Along
from actionopt.solver.contact.taut_strings import WayOut, parts_at_zero
from actionopt.solver.kinds import free_contact
from actionopt.solver.refinement.first_mesh import is_free, straight_line
from actionopt.tools.watch import OutOfTime

FREE = "expected a system without an obstacle"


def string():
    """Return a string of unit tension and weight g per length over x, kept above a floor."""
    return ao.System(
        lambda q, v, t, *, g: v[0] ** 2 / 2 + g * q[0],
        ["height"],
        parameters={"g": 2.0},
        obstacle=lambda q, t: q[0],
    )


def body(*rows, names="xy", mass=1.0):
    """Return free motion outside of obstacles."""
    return ao.System(
        lambda q, v, t: mass * (v @ v) / 2, list(names), obstacle=lambda q, t: rows_of(rows, q)
    )


def rows_of(rows, q):
    return [row(q) for row in rows]


def disc(x=0.0, y=0.0, radius=1.0):
    return lambda q: (q[0] - x) ** 2 + (q[1] - y) ** 2 - radius**2


def around(A, B, duration=1.0):
    """Return the shortest path round the unit circle, S, and the times of contact."""
    A, B = np.array(A), np.array(B)
    ra, rb = np.hypot(*A), np.hypot(*B)
    before, behind = np.sqrt(ra**2 - 1), np.sqrt(rb**2 - 1)
    turn = A[0] * B[1] - A[1] * B[0]
    side = np.sign(turn)
    angle = np.arctan2(abs(turn), A @ B) - np.arctan(before) - np.arctan(behind)
    length = before + angle + behind
    first = np.arctan2(A[1], A[0]) + side * np.arctan(before)

    def path(t):
        s = np.asarray(t) / duration * length - before
        th = first + side * np.clip(s, 0, angle)
        beyond = np.where(s < 0, s, np.maximum(s - angle, 0))
        point, along = (
            np.array([np.cos(th), np.sin(th)]),
            side * np.array([-np.sin(th), np.cos(th)]),
        )
        return point + along * beyond

    times = before / length * duration, (before + angle) / length * duration
    return path, length**2 / (2 * duration), times


def apart(t, *ends):
    """Return the times of t that are not ends of contact, which are known to round-off only."""
    return t[np.abs(np.subtract.outer(ends, t)).min(axis=0) > 1e-9]


@pytest.mark.long
@pytest.mark.parametrize(
    ("ends", "tol"),
    a_quarter(
        [
            (((-2, 0.3), (2, 0)), 1e-10),
            (((-2, 0.3), (2, 0)), 1e-3),
            (((-1.2, 0.3), (1.02, -0.3)), 1e-8),
        ]
    ),
)
def test_shortest_way_round_a_circle(ends, tol):
    A, B = ends
    sol = ao.solve(ao.Problem(body(disc()), ao.Event(0, A), ao.Event(1, B)), tol=tol)
    path, S, times = around(A, B)
    t = np.linspace(0, 1, 400)
    true = np.max(np.abs(sol(t) - path(t)).max(axis=1) / np.abs(path(t)).max(axis=1))
    assert true <= sol.error <= tol
    assert sol.action == pytest.approx(S, rel=1e-13)
    (arc,) = sol.contacts
    assert (arc.begin, arc.end) == pytest.approx(times, abs=max(1e-12, tol / 10))
    assert (sol.kind, sol.morse_index) == ("minimum", 0)
    # The centripetal force 2 nu r of the speed L: nu = L^2 / 2.
    middle, away = sum(times) / 2, times[0] / 2
    assert sol.contact_force([away, middle]) == pytest.approx(np.array([[0, S]]), abs=1e-6 * S)
    assert sol.contact_force(middle).shape == (1,)


@pytest.mark.long
def test_a_string_above_a_floor():
    """Parabolas of the curvature g end on the floor, tangentially."""
    for g, h in ((2.0, 1.0), (5.0, 0.3)):
        problem = ao.Problem(string(), ao.Event(0, [h]), ao.Event(4, [h / 2]), parameters={"g": g})
        sol = ao.solve(problem, tol=1e-10)
        begin, end = np.sqrt(2 * h / g), 4 - np.sqrt(h / g)
        assert [(arc.begin, arc.end) for arc in sol.contacts] == [pytest.approx((begin, end))]
        t = np.linspace(0, 4, 101)
        exact = g / 2 * (np.maximum(begin - t, 0) ** 2 + np.maximum(t - end, 0) ** 2)
        assert np.abs(sol(t)[0] - exact).max() <= sol.error * h
        t = apart(t, begin, end)
        force = np.where((begin < t) & (t < end), g, 0)
        assert sol.contact_force(t)[0] == pytest.approx(force, abs=1e-9)
        assert np.abs(sol.contact_force(t) * sol(t)).max() < 1e-10  # complementary
        assert sol.acceleration(2.0) == pytest.approx([0], abs=1e-12)
        assert sol.start.v == pytest.approx([-g * begin])


@pytest.mark.long
@pytest.mark.parametrize(
    ("p", "A", "B"),
    [
        (6, (-4.0, 0.2), (4.0, -0.2)),
        (8, (-4.0, 0.2), (4.0, -0.2)),
        (12, (-1.24, 0.14), (1.53, 0.546)),
    ],
)
def test_a_string_round_flat_sides(p, A, B):
    """Where a side is hardly curved steps of the times of contact contract slowly."""
    A, B, angle = np.array(A), np.array(B), np.linspace(np.pi, 0, 200_001)
    edge = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    edge /= np.sum(edge**p, axis=1)[:, None] ** (1 / p)
    i, j = (np.argmax((edge - X)[:, 1] / np.abs((edge - X)[:, 0])) for X in (A, B))
    before, behind = np.linalg.norm(edge[i] - A), np.linalg.norm(edge[j] - B)
    along = np.sum(np.linalg.norm(np.diff(edge[i : j + 1], axis=0), axis=1))
    length = before + along + behind
    system = body(lambda q: q[0] ** p + q[1] ** p - 1)
    found = ao.solve(ao.Problem(system, ao.Event(0.0, A), ao.Event(1.0, B)))
    assert found.action == pytest.approx(length**2 / 2, rel=1e-8)
    free = found.contacts[0].begin, 1 - found.contacts[-1].end  # either way is as long
    assert sorted(free) == pytest.approx(sorted([before / length, behind / length]), abs=1e-5)


@pytest.mark.long
@pytest.mark.parametrize("far", [1.0, 2.0])
def test_ways_round_a_ball_between_opposite_sides_are_a_family(far):
    A, R = np.array([-1.0, 0.0, 0.1]), 0.5
    B = -far * A
    system = body(lambda q: q @ q - R**2, names="xyz")
    found = ao.solve(ao.Problem(system, ao.Event(0, A), ao.Event(1, B)), tol=1e-6, throw=False)
    assert (found.status, found.inertia.nullity) == (Status.DEGENERATE, 1)
    a, b = np.linalg.norm(A), np.linalg.norm(B)
    lines = np.sqrt(a**2 - R**2), np.sqrt(b**2 - R**2)
    length = sum(lines) + R * (np.pi - np.arccos(R / a) - np.arccos(R / b))
    assert found.action == pytest.approx(length**2 / 2, rel=1e-9)
    (arc,) = found.contacts
    known = lines[0] / length, 1 - lines[1] / length
    assert (arc.begin, arc.end) == pytest.approx(known, abs=1e-7)


@pytest.mark.long
def test_no_number_overflows_where_a_point_of_a_flat_side_is_sought():
    system = body(lambda q: np.sum(q**8) - 1, names="xyz")
    problem = ao.Problem(system, ao.Event(0, (-2, 0.2, 0.1)), ao.Event(1, (2, 0, -0.1)))
    assert ao.solve(problem, tol=1e-6).success  # and without a warning


def test_a_string_drawn_round_a_disc_meets_it_when_the_shortest_way_does():
    A, B = (-2, 0.3), (2, 0)
    held = Held(ao.Problem(body(disc()), ao.Event(0, A), ao.Event(1, B)), ())
    line = Path(Mesh.uniform(0.0, 1.0, 1, 1), np.array([A, B], dtype=float).T)
    out = WayOut.of(held, line.on(Mesh.uniform(0.0, 1.0, 16, 4)))
    assert out is not None
    _, (arc,) = out.strings.draw(lambda _: out.normal)
    # Angles of 1e-4 are zero to it: the square of that, and of what its curve leaves out.
    assert (arc.begin, arc.end) == pytest.approx(around(A, B)[2], abs=2e-6)


def test_a_path_round_a_disc_begins_on_few_elements_with_its_own_multipliers():
    problem = ao.Problem(body(disc()), ao.Event(0, (-2, 0.3)), ao.Event(1, (2, 0)))
    sol = ao.solve(problem, tol=1e-6)
    (arc,), b = sol.contacts, sol.mesh.boundaries
    assert np.count_nonzero(b < arc.begin) == np.count_nonzero(b > arc.end) == 1  # straight lines
    ws = Along(Held(problem, sol.contacts), tol=1e-6)
    on, first = np.isfinite(sol.lam), ws._contact_multipliers(sol.path).T
    # Where contact begins and ends, half of the row or less is in contact.
    assert first[on] == pytest.approx(sol.lam[on], rel=1e-4)
    # Long elements are looked at as often as short ones.
    held, ends = Held(problem, ()), np.array([problem.start.q, problem.end.q], dtype=float).T
    line = Path(Mesh.uniform(0.0, 1.0, 1, 1), ends)
    apart = [np.diff(rows_between(held, line.on(Mesh.uniform(0.0, 1.0, k, 6))).t) for k in (1, 8)]
    assert apart[0].max() <= apart[1].max() * (1 + 1e-9)
    assert apart[0].min() > 1e-6


# -- what is known of convex bodies, and of bodies free of forces ----------------------------------


def ellipsoid(n):
    """Return an ellipsoid in n coordinates, turned and off the origin, as f(q)."""
    rng = np.random.default_rng(n)
    turn, centre = np.linalg.qr(rng.standard_normal((n, n)))[0], rng.normal(0, 0.1, n)
    axes = rng.uniform(0.4, 0.9, n)
    return lambda q: np.sum((turn @ (q - centre) / axes) ** 2) - 1


def line_through(n, f):
    """Return the question past an obstacle from -2 to 2 along the first coordinate, and a line."""
    ends = np.zeros((2, n))
    ends[:, 0], ends[:, 1] = (-2.0, 2.0), (0.1, 0.2)
    problem = ao.Problem(body(f, names=[f"x{k}" for k in range(n)]), *map(ao.Event, (0, 1), ends))
    return problem, straight_line(problem, Mesh.uniform(0.0, 1.0, 16, 4))


@pytest.mark.parametrize("n", [2, 5])
def test_tangent_planes_touch_an_ellipsoid_where_newtons_method_finds_them(n):
    problem, line = line_through(n, ellipsoid(n))
    out = WayOut.of(Held(problem, ()), line)
    assert out is not None
    assert out.body.ellipsoid is not None
    rng = np.random.default_rng(0)
    normals = rng.standard_normal((20, n))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    points = out.body.touching_points(normals, normals)
    f, G, _ = out.body.at(points)
    np.testing.assert_allclose(f, 0.0, atol=1e-12)
    np.testing.assert_allclose(G / np.linalg.norm(G, axis=1)[:, None], normals, atol=1e-12)
    out.body.ellipsoid = None
    near = points + 1e-2 * rng.standard_normal(points.shape)
    np.testing.assert_allclose(out.body.touching_points(near, normals), points, atol=1e-5)


@pytest.mark.parametrize(
    "f",
    [lambda q: 5 - q @ q, lambda q: q @ q + 1, lambda q: q[0] + 3, lambda q: q @ q * (q[0] + 3)],
)
def test_what_is_no_ellipsoid_is_not_taken_for_one(f):
    problem, _ = line_through(2, f)
    assert taut_strings.Body(Held(problem, ()), 0, 0.0).ellipsoid is None


@pytest.mark.parametrize("n", [2, 5])
def test_a_string_of_straight_lines_is_the_one_between_free_motions(n):
    problem, line = line_through(n, ellipsoid(n))
    strings = [WayOut.of(Held(problem, ()), line, straight=x).strings for x in (False, True)]
    for way in np.eye(n)[1:]:
        (sampled, (arc,)), (known, (other,)) = (x.draw(lambda _, way=way: way) for x in strings)
        assert (other.begin, other.end) == pytest.approx((arc.begin, arc.end), abs=1e-5)
        np.testing.assert_allclose(known.values, sampled.on(known.mesh).values, atol=1e-4)


def test_forces_and_open_ends_are_seen_where_straight_lines_are_asked_for():
    problem, _ = line_through(2, disc(radius=0.5))
    assert is_free(problem)
    assert not is_free(problem.replace(end=ao.Event(1.0, [2.0, None])))
    for L in (
        lambda q, v, t: v @ v / 2 - q[1],  # falls
        lambda q, v, t: v @ v / 2 - q @ q,  # swings
        lambda q, v, t: v @ v / 2 + q[0] * v[1],  # turns
        lambda q, v, t: v @ v / 2 * (1 + t),  # of an inertia that grows
        lambda q, v, t: (v[0] ** 2 - v[1] ** 2) / 2,  # whose action is unbounded
    ):
        system = ao.System(L, ["x", "y"], obstacle=lambda q, t: q @ q - 0.25)
        assert not is_free(ao.Problem(system, problem.start, problem.end)), L


@pytest.mark.parametrize("n", [2, 3])
def test_a_convex_body_is_pressed_and_not_entered_as_a_look_between_the_nodes_says(n):
    problem, _ = line_through(n, ellipsoid(n))
    sol = ao.solve(problem, tol=1e-8)
    held = Held(sol.problem, sol.contacts)
    at = DiscretePath.of(held, sol.path, sol.lam.T)
    _, on, depth, push, unit = obstacle.contact_conditions(at, problem.scales)
    assert depth.max() < 1e-8
    assert (push[on] > obstacle.PULLING * unit.max()).all()
    ws = Along(held, tol=1e-8)
    ws.transcribe(at.mesh, at.path, sol.lam.T)
    ws.convex = True
    assert ws._presses()
    assert ws.next_contacts(1e-8) is None
    ws.here = ws.here.moved(np.where(np.arange(at.z.size) < at.x.size, at.z, 0.0))
    assert not ws._presses()  # then it is looked at


def test_an_action_on_moved_elements_is_that_of_a_new_one():
    problem, _ = line_through(2, ellipsoid(2))
    sol = ao.solve(problem, tol=1e-8)
    held = Held(problem, sol.contacts)
    tr = Transcription(held, sol.mesh, np.array([2.0, 0.5]))
    z = np.random.default_rng(0).standard_normal(tr.layout.size)
    before = tr.residual(z), tr.kkt(z)
    moved = with_contact_times(tr, np.array([0.01, -0.02]))
    new = Transcription(moved.problem, moved.mesh, tr.lengths, like=tr)
    assert moved.problem.contact_times == pytest.approx(held.contact_times + [0.01, -0.02])
    for found, known in (
        ((moved.residual(z), moved.kkt(z)), (new.residual(z), new.kkt(z))),
        ((tr.residual(z), tr.kkt(z)), before),  # the first one is as it was
    ):
        for x, y in zip(found, known, strict=True):
            np.testing.assert_array_equal(x, y)


@pytest.mark.parametrize("n", [2, 3])
def test_a_line_through_the_middle_of_a_ball_turns_aside_across_it(n):
    ends = np.zeros((2, n))
    ends[:, 0], ends[:, -1] = (-1.0, 1.0), (0.1, -0.1)
    names = [f"x{k}" for k in range(n)]
    problem = ao.Problem(
        body(lambda q: q @ q - 0.25, names=names), *map(ao.Event, (0.0, 1.0), ends)
    )
    line = straight_line(problem, Mesh.uniform(0.0, 1.0, 16, 4))
    out = WayOut.of(Held(problem, ()), line, straight=True)
    assert out is not None
    assert abs(out.normal * problem.measures @ (ends[1] - ends[0])) < 1e-9 or n > 2
    assert abs(out.normal @ (ends[1] - ends[0]) / problem.measures.max()) < 0.5
    assert np.linalg.norm(out.normal) == pytest.approx(1.0)
    _, (arc,) = out.strings.draw(lambda _: out.normal)
    length = 2 * np.sqrt(1.01 - 0.25) + (np.pi - 2 * np.arccos(0.5 / np.sqrt(1.01))) / 2
    assert arc.begin == pytest.approx(np.sqrt(0.76) / length, abs=1e-5)


def test_a_path_is_told_between_what_is_least_only_where_it_is_inside():
    problem, line = line_through(2, disc(y=-0.8))
    outside, _ = line_through(2, disc(y=-0.8, radius=0.9))
    held = Held(problem, ())
    seen, told = rows_between(held, line), first_contacts.sample_rows(held, line)
    assert told.t.size > seen.t.size
    assert (np.diff(told.t) > 0).all()
    np.testing.assert_allclose(told.q, line(told.t).T, atol=1e-12)
    np.testing.assert_allclose(told.v, line.velocity(told.t).T, atol=1e-9)
    same = first_contacts.sample_rows(Held(outside, ()), line)
    assert same.t.size == seen.t.size


@pytest.mark.parametrize("f", [[-1.0, -1.0, 1.0, 2.0], [-2.0, -1.0, 1.0, 1.0]])
def test_a_zero_between_values_of_which_two_are_equal(f):
    assert parts_at_zero(np.array([f]), np.array([2])) == pytest.approx(0.5)


@pytest.mark.long
def test_both_ends_of_an_arc_belong_to_it():
    """And the numbers next to them do not: at the ends are the limits from within."""
    sol = ao.solve(ao.Problem(string(), ao.Event(0, [1.0]), ao.Event(4, [0.5])), tol=1e-10)
    (arc,) = sol.contacts
    ends, beyond = np.array([arc.begin, arc.end]), np.nextafter([arc.begin, arc.end], [0, 4])
    assert sol.contact_force(ends) == pytest.approx(np.array([[2, 2]]))
    assert sol.acceleration(ends) == pytest.approx(np.array([[0, 0]]), abs=1e-12)
    assert not sol.contact_force(beyond).any()
    assert sol.acceleration(beyond) == pytest.approx(np.array([[2, 2]]))


@pytest.mark.long
def test_a_catenary_above_a_floor():
    rope = ao.System(  # its tension at the floor is c
        lambda q, v, x, *, c: (q[0] + c) * np.sqrt(1 + v[0] ** 2),
        ["y"],
        parameters={"c": 0.5},
        obstacle=lambda q, x: q[0],
    )
    sol = ao.solve(ao.Problem(rope, ao.Event(0, [1.0]), ao.Event(3, [0.7])), tol=1e-9)
    c = 0.5
    begin, end = c * np.arccosh(1 + 1 / c), 3 - c * np.arccosh(1 + 0.7 / c)
    assert (sol.contacts[0].begin, sol.contacts[0].end) == pytest.approx((begin, end), abs=1e-12)
    t = np.linspace(0, 3, 300)
    gap = np.maximum(begin - t, 0) + np.maximum(t - end, 0)
    assert np.abs(sol(t)[0] - c * (np.cosh(gap / c) - 1)).max() <= sol.error


@pytest.mark.long
@pytest.mark.parametrize("h", [1.0, 0.4])
def test_a_moving_wall(h):
    """Straight world lines touch the wall x = h (1 - 8 (t - 1/2)^2) where they are tangents."""
    wall = systems.particle(
        obstacle=lambda q, t, *, h: q[0] - h * (1 - 8 * (t - 0.5) ** 2), parameters={"h": h}
    )
    sol = ao.solve(ao.Problem(wall, ao.Event(0, [0.0]), ao.Event(1, [0.0])))
    begin = 1 / np.sqrt(8)
    assert (sol.contacts[0].begin, sol.contacts[0].end) == pytest.approx((begin, 1 - begin))
    assert sol(0.25) == pytest.approx([16 * h * (0.5 - begin) * 0.25])
    assert sol.contact_force(0.5) == pytest.approx([16 * h])


@pytest.mark.long
def test_both_ways_round_a_circle():
    A, B = (-2, 0.3), (2, 0)
    problem = ao.Problem(body(disc()), ao.Event(0, A), ao.Event(1, B))
    paths = ao.solve_all(problem, starts=2)
    # The longer way turns by the rest of the circle.
    _, S, times = around(A, B)
    length = np.sqrt(2 * S)
    turned = np.arctan2(0.3 * 2, -4)
    longer = length + 2 * (np.pi - abs(turned))
    assert [path.action for path in paths] == pytest.approx([S, longer**2 / 2], rel=1e-12)
    assert paths[0].contact_force(sum(times) / 2) > 0
    with pytest.raises(ValueError, match="expected no angles"):
        ao.solve_all(problem, angles=["x"])


@pytest.mark.parametrize(
    "through", [[], pytest.param([ao.Event(0.25, [-2.0, 0.01])], marks=pytest.mark.long)]
)
def test_ends_that_nearly_lie_on_an_axis_of_a_disc(through):
    """How far the path goes to a side its events do not tell."""
    A, B = (-4.0, 0.01), (4.0, 0.01)
    sol = ao.solve(ao.Problem(body(disc()), ao.Event(0, A), ao.Event(1, B), through=through))
    begin = through[0].q if through else A
    leg = 0.75 if through else 1.0
    before = 8.0 if through else 0.0  # 2 in a quarter of the time
    assert sol.action == pytest.approx(before + around(begin, B, leg)[1], rel=1e-12)


@pytest.mark.long
def test_two_discs_have_four_ways_round_them():
    """Two of one length, as one is the other turned about: on either side of each."""
    discs, A, B = body(disc(x=-2), disc(x=2)), (-4.0, 0.1), (4.0, 0.1)
    paths = ao.solve_all(ao.Problem(discs, ao.Event(0, A), ao.Event(1, B)), starts=0)
    sides = [tuple(path([0.25, 0.75])[1] > 0) for path in paths]
    assert sorted(sides) == [(False, False), (False, True), (True, False), (True, True)]
    lengths, straight = [], np.sqrt(2**2 + 0.1**2 - 1)
    for first, last in ((0.1, 0.1), (-0.1, -0.1), (0.1, -0.1)):  # above the side it passes
        turns = [np.pi - np.arctan2(y, 2) - np.arctan(straight) for y in (first, last)]
        leaves, between = (np.pi / 2, 4.0) if first == last else (np.pi / 3, np.sqrt(12))
        lengths.append(2 * straight + between + sum(turns) - 2 * leaves)
    expected = np.array([*lengths, lengths[-1]])
    assert [path.action for path in paths] == pytest.approx(expected**2 / 2, rel=1e-12)


@pytest.mark.slow
def test_both_ways_round_discs_that_overlap():
    """Above the upper one, and below the lower one: each is the longer way round one disc."""
    discs = body(disc(y=0.9), disc(y=-0.9))
    A, B = np.array([-3, 0.3]), np.array([3, 0])
    paths = ao.solve_all(ao.Problem(discs, ao.Event(0, A), ao.Event(1, B)), starts=1)
    expected = []
    for centre in ([0, 0.9], [0, -0.9]):
        a, b = A - centre, B - centre
        turned = np.arctan2(abs(a[0] * b[1] - a[1] * b[0]), a @ b)
        expected.append((np.sqrt(2 * around(a, b)[1]) + 2 * (np.pi - turned)) ** 2 / 2)
    assert [path.action for path in paths] == pytest.approx(sorted(expected), rel=1e-9)


@pytest.mark.long
@pytest.mark.parametrize(
    ("g", "discs", "ends", "T"),
    [
        pytest.param(
            0.0,
            [(-1, -0.046, 0.228), (0, 0.165, 0.168), (1, -0.265, 0.253)],
            ([-1.957, -0.146], [2.071, 0.066]),
            0.657,
            marks=pytest.mark.slow,
        ),
        (-1.991, [(0.124, -0.091, 0.397)], ([-1.999, 0.168], [2.054, -0.37]), 0.912),
    ],
)
def test_no_way_on_other_sides_is_shorter(g, discs, ends, T):
    """Polygons past each disc on either side, as guesses; the first found was 3 and 7 % longer."""
    rows = [disc(*each) for each in discs]
    system = ao.System(
        lambda q, v, t: v @ v / 2 + g * q[1], ["x", "y"], obstacle=lambda q, t: rows_of(rows, q)
    )
    problem = ao.Problem(system, ao.Event(0, ends[0]), ao.Event(T, ends[1]))
    sol = ao.solve(problem)
    for sides in np.ndindex(*[2] * len(discs)):
        past = [(x, y + (2 * up - 1) * R) for (x, y, R), up in zip(discs, sides, strict=True)]
        x, y = np.array([ends[0], *past, ends[1]]).T

        def polygon(t, x=x, y=y):
            at = x[0] + (x[-1] - x[0]) * np.asarray(t) / T
            return np.array([at, np.interp(at, x, y)])

        other = ao.solve(problem, guess=polygon, tol=1e-4, throw=False)
        assert not other.success or other.action > sol.action * (1 - 1e-6)


@pytest.mark.long
def test_geodesic_round_a_sphere():
    ball = body(lambda q: q @ q - 1, names="xyz")
    A, B = np.array([-2, 0.3, 0.1]), np.array([1.5, 0.2, -0.4])
    sol = ao.solve(ao.Problem(ball, ao.Event(0, A), ao.Event(1, B)))
    ra, rb = np.linalg.norm(A), np.linalg.norm(B)
    angle = np.arccos(A @ B / ra / rb) - np.arccos(1 / ra) - np.arccos(1 / rb)
    length = np.sqrt(ra**2 - 1) + np.sqrt(rb**2 - 1) + angle
    assert sol.action == pytest.approx(length**2 / 2, rel=1e-12)
    assert np.cross(A, B) @ sol(0.5) == pytest.approx(0, abs=1e-9)  # in the plane of the centre


@pytest.mark.long
def test_the_fastest_path_round_a_disc():
    """At a given energy: the shortest one, at the speed sqrt(2 E)."""
    A, B, energy = (-2, 0.3), (2, 0), 0.8
    problem = ao.Problem(body(disc()), ao.Event(0, A), ao.Event(None, B), energy=energy)
    sol = ao.solve(problem, tol=1e-10)
    length = np.sqrt(2 * around(A, B)[1])
    assert sol.duration == pytest.approx(length / np.sqrt(2 * energy), rel=1e-12)
    path, _, times = around(A, B, sol.duration)
    t = np.linspace(0, sol.duration, 50)
    assert np.abs(sol(t) - path(t)).max() <= 2 * max(sol.error, 1e-14)
    (arc,) = sol.contacts
    assert (arc.begin, arc.end) == pytest.approx(times, abs=1e-12)
    assert (sol.kind, sol.morse_index) == ("minimum", 0)
    later = ao.Problem(body(disc()), ao.Event(None, A), ao.Event(5, B), energy=energy)
    assert ao.solve(later).duration == pytest.approx(sol.duration, rel=1e-12)


@pytest.mark.parametrize("end", [*slow(1.0), None])
def test_a_string_over_a_disc_and_on_to_a_line(end):
    """From the top of the disc it goes straight across the line x = 2."""
    A, energy = (-2, 0.3), 2.0
    length = np.sqrt(3.09) + np.arctan2(0.3, -2) - np.arctan(np.sqrt(3.09)) - np.pi / 2 + 2
    E = {} if end is not None else {"energy": energy}
    goal = ao.Event(end, None, on=lambda q, t: q[0] - 2)
    sol = ao.solve(ao.Problem(body(disc()), ao.Event(0, A), goal, **E), tol=1e-10)
    T = length / np.sqrt(2 * energy) if end is None else end
    assert sol.duration == pytest.approx(T, rel=1e-12)
    assert sol.action == pytest.approx(length**2 / T / 2, rel=1e-12)
    assert sol.end.q == pytest.approx([2, 1], abs=1e-12)
    assert sol.momenta[1] == pytest.approx([length / T, 0], abs=1e-9)
    assert sol.contacts[0].end == pytest.approx(T * (1 - 2 / length), abs=1e-12)
    assert sol.morse_index == 0
    outside = sol(np.linspace(0, T, 60))
    assert np.hypot(*outside).min() >= 1 - 1e-9


@pytest.mark.slow
def test_two_discs_in_order():
    """The shorter of four ways is below one and above the other, or on one side of both."""
    discs = body(disc(-1.5, 0.3), disc(1.5, -0.2))
    sol = ao.solve(ao.Problem(discs, ao.Event(0, [-3.5, 0]), ao.Event(1, [3.5, 0])))
    assert [arc.row for arc in sol.contacts] == [0, 1]
    first, second = sol.contacts
    assert 0 < first.begin < first.end < second.begin < second.end < 1
    t = np.linspace(0, 1, 300)
    outside = discs.obstacle(sol(t), t)
    assert outside.min() > -1e-8
    speeds = np.linalg.norm(sol.velocity(t), axis=0)
    assert speeds == pytest.approx(speeds[0])
    assert sol.contact_force(t).min() >= 0


@pytest.mark.long
@pytest.mark.parametrize("more", [-1e-3, 0, 1e-6, 1e-3])
def test_grazing_contact(more):
    """Two parabolas meet on the floor after 1 + sqrt(1/2); from there on they part."""
    T = 1 + np.sqrt(0.5) + more
    sol = ao.solve(ao.Problem(string(), ao.Event(0, [1.0]), ao.Event(T, [0.5])))
    t = np.linspace(0, T, 300)
    assert sol(t).min() >= -1e-8
    if more > 0:
        assert (sol.contacts[0].begin, sol.contacts[0].end) == pytest.approx(
            (1, 1 + more), abs=1e-9
        )
    else:
        assert sol.contacts == ()
        assert sol.compare().agrees


@pytest.mark.long
@pytest.mark.parametrize("rows", [lambda f, g: [f, g], lambda f, g: np.fmin(f, g) / 2])
def test_at_rest_in_a_corner(rows):
    """A heavy string in a trough comes along one plane, lies in the corner, leaves on the other."""
    g, slopes, lengths, rest = 3.0, np.array([0.7, 0.4]), np.array([0.5, 0.8]), 0.6
    normals = np.array([[np.sin(slopes[0]), np.cos(slopes[0])], [-np.sin(slopes[1]), 0]])
    normals[1, 1] = np.cos(slopes[1])
    trough = ao.System(
        lambda q, v, t: v @ v / 2 + g * q[1],
        ["x", "y"],
        obstacle=lambda q, t: rows(*(float(a) * q[0] + float(b) * q[1] for a, b in normals)),
    )
    first, last = np.sqrt(2 * lengths / (g * np.sin(slopes)))  # l = g sin(slope) t^2 / 2
    A, B = (
        length * np.array([side * np.cos(slope), np.sin(slope)])
        for side, length, slope in zip((-1, 1), lengths, slopes, strict=True)
    )
    T = first + rest + last
    sol = ao.solve(ao.Problem(trough, ao.Event(0, A), ao.Event(T, B)))
    assert sol.action == pytest.approx(
        np.sum(2 / 3 * np.sqrt(2 * g * np.sin(slopes)) * lengths**1.5), rel=1e-12
    )
    assert [(arc.row, arc.begin, arc.end) for arc in sol.contacts] == [
        pytest.approx((0, 0, first + rest)),
        pytest.approx((1, first, T)),
    ]
    size = 1 if isinstance(rows(1, 1), list) else 2  # half of a row is pressed twice as much
    force = sol.contact_force(first + rest / 2)
    assert normals.T @ force == pytest.approx([0, size * g])  # its weight, of both
    assert sol.contact_force(first / 2) == pytest.approx([size * g * np.cos(slopes[0]), 0])


def test_a_ball_held_at_a_moving_inclined_ceiling():
    """Its distance is one of fall in the frame of the wall, along which it goes evenly."""
    g, a, th, h, T = 2.0, 0.4, 0.3, np.array([0.5, 0.2]), 3.0
    n, along = np.array([np.sin(th), np.cos(th)]), np.array([np.cos(th), -np.sin(th)])
    s, c = float(n[0]), float(n[1])

    def wall(t):
        return 0.2 * t - a * t * t / 2

    ceiling = ao.System(
        lambda q, v, t: v @ v / 2 - g * (s * q[0] + c * q[1]),
        ["x", "y"],
        obstacle=lambda q, t: wall(t) - s * q[0] - c * q[1],
    )
    begin, end = np.sqrt(2 * h / (g - a)) * [1, -1] + [0, T]

    def path(t):
        gap = (g - a) / 2 * (np.maximum(begin - t, 0) ** 2 + np.maximum(t - end, 0) ** 2)
        return np.outer(n, wall(t) - gap) + np.outer(along, 1 - t)

    t = np.linspace(0, T, 100)
    ends = path(t)[:, [0, -1]].T
    sol = ao.solve(ao.Problem(ceiling, ao.Event(0, ends[0]), ao.Event(T, ends[1])))
    assert [(arc.begin, arc.end) for arc in sol.contacts] == [pytest.approx((begin, end))]
    assert sol(t) == pytest.approx(path(t), abs=1e-7)
    t = apart(t, begin, end)
    force = np.where((begin < t) & (t < end), g - a, 0)
    assert sol.contact_force(t)[0] == pytest.approx(force, abs=1e-7)


@pytest.mark.slow
def test_links_above_a_floor():
    """A bob on a rod in Cartesian coordinates goes as the angle does."""
    common = {"obstacle": lambda q, t: q[1] + 0.5, "constraint": lambda q, t: (q @ q - 1) / 2}
    rod = ao.System(lambda q, v, t: v @ v / 2 + 3 * q[1], ["x", "y"], **common)
    angle = ao.System(
        lambda q, v, t: v[0] ** 2 / 2 - 3 * np.cos(q[0]),
        ["theta"],
        obstacle=lambda q, t: 0.5 - np.cos(q[0]),
    )
    ends = [(0, 1.6), (3, 2.5)]
    a = ao.solve(ao.Problem(rod, *[ao.Event(t, [np.sin(th), -np.cos(th)]) for t, th in ends]))
    b = ao.solve(ao.Problem(angle, *[ao.Event(t, [th]) for t, th in ends]))
    assert a.action == pytest.approx(b.action, rel=1e-12)
    for one, other in zip(a.contacts, b.contacts, strict=True):
        assert (one.begin, one.end) == pytest.approx((other.begin, other.end))
    assert a.contact_force(1.2) == pytest.approx(b.contact_force(1.2))
    assert a.multipliers(0.3) == pytest.approx(-(a.velocity(0.3) @ a.velocity(0.3)) - 3 * a(0.3)[1])
    assert a.morse_index == b.morse_index == 0


@pytest.mark.long
def test_free_ends_on_the_floor():
    for T, contact in ((0.9, []), (1.5, [(1.0, 1.5)])):
        sol = ao.solve(ao.Problem(string(), ao.Event(0, [1.0]), ao.Event(T, [None])))
        assert [(arc.begin, arc.end) for arc in sol.contacts] == [pytest.approx(x) for x in contact]
        assert sol.momenta[1] == pytest.approx([0], abs=1e-9)
    drawn = ao.System(lambda q, v, t: v[0] ** 2 / 2 + v[0], ["x"], obstacle=lambda q, t: q[0])
    sol = ao.solve(ao.Problem(drawn, ao.Event(0, [0.5]), ao.Event(1, [None])))
    assert [(arc.begin, arc.end) for arc in sol.contacts] == [(1, 1)]
    assert sol.momenta[1] == pytest.approx([0.5])  # the impulse


def test_at_rest_on_the_floor():
    sol = ao.solve(ao.Problem(string(), ao.Event(0, [0.0]), ao.Event(1, [0.0])))
    assert [(arc.begin, arc.end) for arc in sol.contacts] == [(0, 1)]
    assert sol.contact_force(0.5) == pytest.approx([2])
    assert not sol(np.linspace(0, 1, 9)).any()


@pytest.mark.long
def test_it_travels():
    problem = ao.Problem(string(), ao.Event(0, [1.0]), ao.Event(4, [0.5]))
    sol = ao.solve(problem)
    for other in (pickle.loads(pickle.dumps(sol)), deepcopy(sol)):
        assert other.contacts == sol.contacts
        assert other.kind == "minimum"
        assert other.contact_force(2.0) == pytest.approx([2])


@pytest.mark.long
def test_it_is_saved(tmp_path):
    sol = ao.solve(ao.Problem(string(), ao.Event(0, [1.0]), ao.Event(4, [0.5])))
    sol.save(tmp_path / "string.npz")
    again = ao.load(tmp_path / "string.npz", string())
    assert again.contacts == sol.contacts
    assert again.kind == "minimum"
    with pytest.raises(ValueError, match="without its system"):
        _ = ao.load(tmp_path / "string.npz").contacts


@pytest.mark.long
def test_a_grid_of_strings():
    problem = ao.Problem(string(), ao.Event(0, [1.0]), ao.Event(4, [0.5]))
    runs = ao.sweep(problem, {"g": [0.1, 1.0, 3.0]})
    assert runs.success.all()
    assert [len(runs.solution(i).contacts) for i in range(3)] == [0, 1, 1]


def test_both_ends_on_opposite_sides_of_a_disc():
    half = ao.solve(ao.Problem(body(disc()), ao.Event(0, [-1, 0]), ao.Event(1, [1, 0])))
    assert np.sqrt(2 * half.action) == pytest.approx(np.pi, abs=1e-9)


def test_bad_questions():
    problem = ao.Problem(string(), ao.Event(0, [1.0]), ao.Event(4, [0.5]))
    with pytest.raises(ValueError, match="start event outside of the obstacle"):
        problem.replace(start=ao.Event(0, [-0.1]))
    with pytest.raises(ValueError, match="found 'stationary'"):
        ao.solve(problem, principle="stationary")
    with pytest.raises(ValueError, match="found both"):
        systems.particle(force=lambda q, v, t: [-v[0]], obstacle=lambda q, t: q[0])
    with pytest.raises(ValueError, match="row 1 contains none"):
        ao.Problem(body(disc(), lambda q: 1.0), ao.Event(0, [2, 2]), ao.Event(1, [2, 3]))
    with pytest.raises(ValueError, match="comes to it in a finite time"):
        ao.Problem(string(), ao.Event(0, [1.0]), ao.Event(np.inf, [0.0]))
    with pytest.raises(ValueError, match="start event outside of the obstacle"):
        ao.Problem(string(), ao.Event(0, [-1.0]), ao.Event(None, [0.5]))
    rising = systems.particle("h", obstacle=lambda q, t: q[0] - t)
    with pytest.raises(ValueError, match="start event outside of the obstacle"):
        ao.Problem(rising, ao.Event(0, [-1.0]), ao.Event(None, [9.0]), energy=1.0)
    with pytest.raises(ValueError, match=r"event 0 of through .* = -0\.1 at q = \("):
        problem.replace(through=[ao.Event(None, [-0.1])])
    plain = systems.particle()
    with pytest.raises(ValueError, match="expected a system with an obstacle"):
        ao.solve(ao.Problem(plain, ao.Event(0, [0]), ao.Event(1, [1]))).contact_force(0.5)


@pytest.mark.long
def test_the_action_changes_with_ends_of_a_path_in_contact():
    """Over a floor S = sqrt(8 g) (a^(3/2) + b^(3/2)) / 3: each end sees its own parabola."""
    (a, b), g = (1.0, 0.5), 2.0
    sol = ao.solve(ao.Problem(string(), ao.Event(0, [a]), ao.Event(4, [b])))
    found = sol.sensitivity()
    assert [found.q0[0], found.q1[0]] == pytest.approx([np.sqrt(2 * g * a), np.sqrt(2 * g * b)])
    assert [found.t0, found.t1] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert found.parameters["g"] == pytest.approx(sol.action / (2 * g))
    second = [found.q0q0[0, 0], found.q0q1[0, 0], found.q1q1[0, 0]]
    known = [np.sqrt(g / (2 * a)), 0.0, np.sqrt(g / (2 * b))]
    assert second == pytest.approx(known, abs=1e-9)
    ending = ao.solve(ao.Problem(string(), ao.Event(0, [a]), ao.Event(4, [0])))
    with pytest.raises(ValueError, match="free of the obstacle at its ends"):
        ending.sensitivity()


def beside_a_disc(radius):
    """Return a free body in the plane, outside of a disc of the radius r."""
    return systems.particle(
        "x y", parameters={"r": radius}, obstacle=lambda q, t, *, r: q @ q - r**2
    )


def test_the_shortest_way_changes_with_the_radius_of_a_disc():
    """By the angle of the arc that is in contact."""
    system = beside_a_disc(1.0)
    A, B = (-2, 0.3), (2, 0.1)
    found = ao.solve(ao.Problem(system, ao.Event(0, A), ao.Event(1, B))).sensitivity()
    length = np.sqrt(2 * around(A, B)[1])
    angle = length - np.sqrt(np.dot(A, A) - 1) - np.sqrt(np.dot(B, B) - 1)
    assert found.parameters["r"] == pytest.approx(length * angle)


def rope():
    """Return a rope of unit weight per length over x, kept above a floor."""
    return ao.System(
        lambda q, v, x: q[0] * np.sqrt(1 + v[0] ** 2),
        ["y"],
        obstacle=lambda q, x: q[0],
        integral=lambda q, v, x: np.sqrt(1 + v[0] ** 2),
    )


def on_floor(c, a, b, D):
    """Return a rope of the tension c on the floor, from heights a and b at a distance D.

    Where it leaves the floor, its length, its weight's potential and its height.
    """
    heights = np.array([a, b])
    wide, rise = c * np.arccosh(1 + heights / c), np.sqrt(heights * (heights + 2 * c))
    low, high = wide[0], D - wide[1]
    length = rise.sum() + high - low
    # y + c = c cosh: the integral of (y + c) ds, less that of c ds.
    weight = np.sum(c * wide / 2 + (heights + c) * rise / 2) - c * rise.sum()

    def height(x):
        return c * (np.cosh(np.maximum(np.maximum(low - x, x - high), 0) / c) - 1)

    return (low, high), length, weight, height


@pytest.mark.long
@pytest.mark.parametrize("seed", [1, *slow(*range(2, 32))])
def test_a_rope_of_given_length_lies_on_a_floor(seed):
    """Two catenaries of one tension, -kappa's; c is drawn, and the length follows from it."""
    random = np.random.default_rng(seed)
    a, b = np.exp(random.uniform(-1.5, 1.0, 2))
    c = np.exp(random.uniform(-3.0, 1.0))
    free = c * (np.arccosh(1 + a / c) + np.arccosh(1 + b / c))
    D = free * random.uniform(1.02, 2.0)
    ends, length, weight, height = on_floor(c, a, b, D)
    sol = ao.solve(ao.Problem(rope(), ao.Event(0, [a]), ao.Event(D, [b]), integral=length))
    x = np.linspace(0, D, 200)
    assert sol(x)[0] == pytest.approx(height(x), abs=1e-8 * max(a, b))
    assert [(arc.begin, arc.end) for arc in sol.contacts] == [pytest.approx(ends)]
    assert sol.action == pytest.approx(weight) and sol.morse_index == 0
    assert sol.integral_multipliers == pytest.approx([c])
    assert sol.contact_force(sum(ends) / 2) == pytest.approx([1.0])
    found = sol.sensitivity()
    assert found.integral == pytest.approx([-c])
    slopes = np.sqrt(np.array([a, b]) * (np.array([a, b]) + 2 * c))
    assert [found.q0[0], found.q1[0]] == pytest.approx(slopes, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("c", [5e-3, 2e-2])
def test_ropes_that_hang_nearly_straight_down_lie_on_a_floor(c):
    """Along the rope itself, L = y ds, heights from a line 0.5 below the floor."""
    floor, a, b = 0.5, 1.5, 1.2
    D = c * (np.arccosh(1 + a / c) + np.arccosh(1 + b / c)) + 0.4
    _, length, weight, _ = on_floor(c, a, b, D)
    system = ao.System.geodesic(
        lambda q, v: q[1] * np.sqrt(v @ v),
        ["x", "y"],
        obstacle=lambda q, t: q[1] - floor,
        integral=lambda q, v, t: np.sqrt(v @ v),
    )
    ends = ao.Event(0, [0, floor + a]), ao.Event(1, [D, floor + b])
    sol = ao.solve(ao.Problem(system, *ends, integral=length))
    whole = weight + floor * length
    assert sol.action == pytest.approx(whole**2 / 2, rel=1e-9) and sol.morse_index == 0
    # kappa is of F^2 / 2, and kappa / speed of F itself: the tension c at the level of the floor.
    assert sol.integral_multipliers == pytest.approx([-whole * (floor - c)])


@pytest.mark.long
def test_the_first_ropes_have_the_length_that_is_given():
    problem = ao.Problem(rope(), ao.Event(0, [1.0]), ao.Event(2.0, [0.8]), integral=2.9)
    for path in first_contacts.lines(problem, ao.Mesh.uniform(0.0, 2.0, 8, 4)):
        t = np.linspace(0.0, 2.0, 2001)
        slopes = np.sqrt(1 + path.velocity(t)[0] ** 2)
        assert np.trapezoid(slopes, t) == pytest.approx(2.9, rel=1e-3)


@pytest.mark.long
def test_ropes_that_grow_come_to_lie_on_the_floor():
    """They hang free until the catenary of the tension c touches it."""
    c, (a, b) = 0.6, (1.0, 0.8)
    D = c * (np.arccosh(1 + a / c) + np.arccosh(1 + b / c))
    touching = on_floor(c, a, b, D)[1]
    lengths = [touching - 0.05, touching + 0.05]
    problem = ao.Problem(rope(), ao.Event(0, [a]), ao.Event(D, [b]), integral=lengths[0])
    found = ao.sweep(problem, {("integral", 0): lengths})
    assert [len(found.solution(k).contacts) for k in (0, 1)] == [0, 1]
    short = np.hypot(D, a - b) - 0.1
    with pytest.raises(ValueError, match=r"no such path: the least is .*, along the straight line"):
        ao.solve(problem.replace(integral=short))
    too_short = ao.sweep(problem, {("integral", 0): [lengths[0], short]})
    assert too_short.status.tolist() == ["SOLVED", "REFUSED"]


@pytest.mark.long
def test_a_loop_round_a_given_area_may_be_shifted_along_a_strip():
    """Two half circles and the walls between them; where along these tells nothing."""
    h, area = 0.4, 1.0
    strip = systems.particle(
        "x y",
        obstacle=lambda q, t: [h - q[1], h + q[1]],
        integral=lambda q, v, t: (q[0] * v[1] - q[1] * v[0]) / 2,
    )
    problem = ao.Problem(strip, ao.Event(0, [None, None]), ao.Periodic(1.0), integral=area)
    turn = 2 * np.pi
    sol = ao.solve(problem, guess=lambda t: [0.9 * np.cos(turn * t), 0.39 * np.sin(turn * t)])
    around = 2 * (area - np.pi * h**2) / (2 * h) + 2 * np.pi * h
    assert sol.action == pytest.approx(around**2 / 2, rel=1e-10)
    assert (sol.morse_index, sol.inertia.moves, len(sol.contacts)) == (0, 2, 2)


@pytest.mark.long
def test_a_branch_of_free_duration_follows_contact():
    """At the energy E it takes the length over sqrt(2 E), and S = E T."""
    system = beside_a_disc(0.6)
    A, B = [-2.0, 0.3], [1.5, 0.3]
    problem = ao.Problem(system, ao.Event(0, A), ao.Event(None, B), energy=0.5)
    found = ao.trace(problem, "r", 1.0)
    assert "reached the goal" in found.stopped and not found.indices.any()
    T = np.sqrt(2 * around(A, B)[1])
    assert [found.durations[-1], found.actions[-1]] == pytest.approx([T, T / 2], abs=1e-10)


@pytest.mark.slow
def test_branches_along_an_obstacle_of_what_is_found_beside_the_path():
    """Ropes of a length, and strings through an event whose time is found; contact may begin."""
    a, b, c = 1.0, 0.8, 0.6
    D = c * (np.arccosh(1 + a / c) + np.arccosh(1 + b / c))
    touching = on_floor(c, a, b, D)[1]
    problem = ao.Problem(rope(), ao.Event(0, [a]), ao.Event(D, [b]), integral=touching - 0.05)
    c = 0.45
    left, right = c * np.arccosh(1 + a / c), c * np.arccosh(1 + b / c)
    _, length, weight, _ = on_floor(c, a, b, D)
    assert left + right < D
    found = ao.trace(problem, ("integral", 0), length)
    assert "reached the goal" in found.stopped and not found.indices.any()
    assert found.actions[-1] == pytest.approx(weight)
    A, B, C = [-2.0, 0.3], [0.5, 1.6], [1.8, 0.1]
    through = ao.Problem(body(disc()), ao.Event(0, A), ao.Event(3, C), through=[ao.Event(None, B)])
    found = ao.trace(through, ("through", 0, "y"), 1.2)
    both = sum(shortest(*pair)[0] for pair in ((A, [0.5, 1.2]), ([0.5, 1.2], C)))
    assert found.actions[-1] == pytest.approx(both**2 / 6, abs=1e-10)


def shortest(A, B):
    """Return the length of the shortest way outside of the unit disc, and if it touches."""
    A, B = np.array(A), np.array(B)
    d = B - A
    nearest = A + np.clip(-(A @ d) / (d @ d), 0, 1) * d
    if np.hypot(*nearest) >= 1:
        return np.hypot(*d), False
    return np.sqrt(2 * around(A, B)[1]), True


def points_outside(random, count):
    found = []
    while len(found) < count:
        point = random.uniform(-3, 3, 2)
        if np.hypot(*point) > 1.1:
            found.append(point.tolist())
    return found


@pytest.mark.long
@pytest.mark.parametrize("seed", [0, *slow(*range(1, 31))])
def test_a_string_round_a_disc_through_points_at_given_times(seed):
    """Taut on each leg, and free of the others."""
    random = np.random.default_rng(seed)
    points = points_outside(random, random.integers(3, 7))
    times = random.uniform(-2, 2) + np.cumsum(random.uniform(0.4, 1.5, len(points)))
    start, *through, end = (ao.Event(t, q) for t, q in zip(times.tolist(), points, strict=True))
    sol = ao.solve(ao.Problem(body(disc()), start, end, through=through))
    legs = [shortest(*ends) for ends in pairwise(points)]
    speeds = np.array([length for length, _ in legs]) / np.diff(times)
    assert sol.action == pytest.approx(speeds**2 @ np.diff(times) / 2, rel=1e-10)
    assert len(sol.contacts) == sum(touched for _, touched in legs) and sol.morse_index == 0
    H = speeds**2 / 2
    assert sol.energy_jumps == pytest.approx(np.diff(H), abs=1e-8)


@pytest.mark.parametrize("seed", [0, *slow(*range(1, 31))])
@pytest.mark.parametrize("energy", [None, *slow(1.5)])
def test_a_string_round_a_disc_through_points_at_times_that_are_found(seed, energy):
    """At one speed, also at the points."""
    random = np.random.default_rng(seed)
    A, *points, B = points_outside(random, random.integers(3, 5))
    through = [ao.Event(None, q) for q in points]
    end = ao.Event(1.5 if energy is None else None, B)
    sol = ao.solve(ao.Problem(body(disc()), ao.Event(0, A), end, through=through, energy=energy))
    legs = pairwise([A, *points, B])
    lengths, touched = np.transpose([shortest(*leg) for leg in legs])
    speed = lengths.sum() / 1.5 if energy is None else np.sqrt(2 * energy)
    assert sol.action == pytest.approx(speed * lengths.sum() / 2, rel=1e-10)
    times = [event.t for event in sol.problem.joints_found]
    assert np.diff(times) == pytest.approx(lengths / speed, rel=1e-7)
    assert len(sol.contacts) == touched.sum() and sol.morse_index == 0


@pytest.mark.long
def test_a_string_round_a_disc_to_a_line_and_back():
    """As if the way went on behind the line, as in a mirror."""
    line = ao.Event(None, None, on=lambda q, t: q[1] - 2)
    A, B = (-1.5, -1), (2, 0.5)
    sol = ao.solve(ao.Problem(body(disc()), ao.Event(0, A), ao.Event(1, B), through=[line]))
    places = np.linspace(-2, 2, 401)  # the length is least at one of them, to second order
    lengths = [shortest(A, (x, 2))[0] + shortest((x, 2), B)[0] for x in places]
    assert sol.action == pytest.approx(min(lengths) ** 2 / 2, rel=1e-5)
    assert len(sol.contacts) == 1 and sol.impulses[0] == pytest.approx([0, sol.impulses[0][1]])


@pytest.mark.long
@pytest.mark.parametrize(("t", "y", "x"), [(0.55, 0.3, 0.5), *slow((None, 0.3, 0.5), (None, 0, 0))])
def test_a_string_round_a_disc_through_a_line_that_meets_the_disc(t, y, x):
    """Straight to it the line is met inside of the disc; no impulse holds the string there."""
    line = ao.Event(t, None, on=lambda q, t: q[0] - x)
    A, B = (-2, y), (2, 0)
    sol = ao.solve(ao.Problem(body(disc()), ao.Event(0, A), ao.Event(1, B), through=[line]))
    places = np.linspace(np.sqrt(1 - x**2) + 1e-9, 1, 1001)
    lengths = np.array([[shortest(A, (x, h))[0], shortest((x, h), B)[0]] for h in places]).T
    parts = lengths / lengths.sum(axis=0) if t is None else np.array([[t], [1 - t]])
    assert sol.action == pytest.approx((lengths**2 / parts).sum(axis=0).min() / 2, rel=1e-6)
    assert sol.impulses[0][1] == pytest.approx(0, abs=1e-7)


@pytest.mark.long
def test_a_string_held_on_a_disc():
    """It lies on the disc before the point and after it, and the speed jumps there."""
    ends, top = (ao.Event(0, [-2, 0.3]), ao.Event(2, [2, 0.3])), ao.Event(1.2, [0, 1])
    sol = ao.solve(ao.Problem(body(disc()), *ends, through=[top]))
    length = np.sqrt(3.09) + np.arccos(0.3 / np.sqrt(4.09)) - np.arctan(np.sqrt(3.09))
    assert sol.action == pytest.approx(length**2 / 2 * (1 / 1.2 + 1 / 0.8))
    arc = length - np.sqrt(3.09)
    ends = 1.2 - 1.2 * arc / length, 1.2 + 0.8 * arc / length
    assert [(x.begin, x.end) for x in sol.contacts] == [pytest.approx(ends)]
    assert sol.impulses[0] == pytest.approx([length / 0.8 - length / 1.2, 0], abs=1e-7)


@pytest.mark.long
def test_a_curve_round_a_given_area_in_a_box():
    """A square whose corners are rounded by quarters of circles."""
    box = systems.particle(
        "x y",
        obstacle=lambda q, t: [1 - q[0], 1 + q[0], 1 - q[1], 1 + q[1]],
        integral=lambda q, v, t: (q[0] * v[1] - q[1] * v[0]) / 2,
    )
    r = 0.75
    area, length = 4 - (4 - np.pi) * r**2, 8 - (8 - 2 * np.pi) * r
    problem = ao.Problem(box, ao.Event(0, [None, None]), ao.Periodic(1.0), integral=area)
    sol = ao.solve(problem, guess=lambda t: [np.cos(2 * np.pi * t), np.sin(2 * np.pi * t)])
    assert sol.action == pytest.approx(length**2 / 2)
    assert sol.integral_multipliers == pytest.approx([-length / r])
    assert {arc.row for arc in sol.contacts} == {0, 1, 2, 3}


def test_a_path_along_an_obstacle_does_not_bounce():
    with pytest.raises(ValueError, match="expected no Bounce"):
        ao.Problem(
            body(disc()),
            ao.Event(0, [2, 0]),
            ao.Event(1, [2, 1]),
            through=[ao.Bounce(lambda q, t: 3 - q[0])],
        )


def test_events_along_an_obstacle_that_do_not_fit_are_refused():
    ends = ao.Event(0, [-2, 0.3]), ao.Event(2, [2, 0.3])
    with pytest.raises(ValueError, match="expected event 0 of through outside"):
        ao.Problem(body(disc()), *ends, through=[ao.Event(1, [0, 0.5])])
    problem = ao.Problem(body(disc()), *ends, through=[ao.Event(None, [-1, 1.5])])
    with pytest.raises(ValueError, match="expected neither a mesh"):
        ao.solve(problem, mesh=ao.Mesh.uniform(0, 2, 8, 8))
    with pytest.raises(ValueError, match="expected principle 'least'"):
        ao.solve(problem, principle="stationary")


def test_what_does_not_know_contact_says_so():
    problem = ao.Problem(string(), ao.Event(0, [1.0]), ao.Event(4, [0.5]))
    sol = ao.solve(problem)
    for ask in (
        lambda: ao.integrate(problem.system, sol.start, 1.0),
        lambda: ao.find_symmetries(problem.system),
        lambda: ao.noether(problem.system, [1.0]),
    ):
        with pytest.raises(ValueError, match=FREE):
            ask()
    for ask in (
        sol.compare,
        lambda: ao.conjugate_points(sol),
        lambda: ao.monodromy(sol),
    ):
        with pytest.raises(ValueError, match="touches no obstacle"):
            ask()


@pytest.mark.long
def test_shortest_way_in_a_length():
    """A geodesic system with an obstacle has its length, whatever runs it through."""
    flat = ao.System.geodesic(
        lambda q, v: np.sqrt(v @ v), ["x", "y"], obstacle=lambda q, t: q @ q - 1
    )
    A, B = (-2, 0.3), (2, 0)
    sol = ao.solve(ao.Problem(flat, ao.Event(0, A), ao.Event(1, B)))
    assert sol.length == pytest.approx(np.sqrt(2 * around(A, B)[1]), rel=1e-12)
    loaded = pickle.loads(pickle.dumps(sol))
    assert loaded.length == sol.length
    assert loaded.contacts == sol.contacts


def test_a_wall_with_a_kink_gives_an_impulse():
    wall = systems.particle(obstacle=lambda q, t: q[0] - 2 + 4 * abs(t - 0.4))
    sol = ao.solve(ao.Problem(wall, ao.Event(0, [1.0]), ao.Event(1, [1.0])))
    assert [(arc.begin, arc.end) for arc in sol.contacts] == [pytest.approx((0.4, 0.4))]
    assert sol.velocity([0.2, 0.7])[0] == pytest.approx([1 / 0.4, -1 / 0.6])


def test_a_path_along_a_wall_that_does_not_press():
    """Straight along the wall: f = 0 all the way, and no force (complementarity is not strict)."""
    wall = systems.particle("x y", obstacle=lambda q, t: q[1])
    sol = ao.solve(ao.Problem(wall, ao.Event(0, [0, 0]), ao.Event(1, [1, 0])))
    t = np.linspace(0, 1, 50)
    assert np.abs(sol(t)[1]).max() < 1e-8
    assert np.abs(sol.contact_force(t)).max() < 1e-6
    assert sol.action == pytest.approx(0.5)


@pytest.mark.slow
def test_round_a_small_peg():
    for R in (0.2, 0.03):
        A, B = np.array([-1.3, 0.4]) / R, np.array([1.6, -0.47]) / R
        peg = body(disc(radius=R))
        sol = ao.solve(ao.Problem(peg, ao.Event(0, A * R), ao.Event(1, B * R)))
        assert sol.action == pytest.approx(around(A, B)[1] * R**2, rel=1e-11)


def distance(R):
    return lambda q: np.sqrt(q @ q) - R


@pytest.mark.long
@pytest.mark.parametrize("R", a_quarter([1e-3, 1e-2]))
@pytest.mark.parametrize("form", [distance, lambda R: disc(radius=R)])
def test_round_a_peg_that_is_hardly_there(R, form):
    """In both forms alike; on the shorter side, which no first mesh tells."""
    A, B = np.array([-1.3, 0.4]) / R, np.array([1.6, -0.4923 - 0.2 * R]) / R
    sol = ao.solve(ao.Problem(body(form(R)), ao.Event(0, A * R), ao.Event(1, B * R)))
    assert sol.action == pytest.approx(around(A, B)[1] * R**2, rel=1e-12)
    arc = sol.contacts[0]
    # The force is the given row's: nu f' is the centripetal one, L^2 / R.
    pull = sol.contact_force((arc.begin + arc.end) / 2)[0] * (1 if form is distance else 2 * R)
    assert pull == pytest.approx(2 * sol.action / R, rel=1e-4)


@pytest.mark.long
def test_no_path_goes_through_a_peg_unseen():
    """Its distance is least in a tip, where parabolas do not lead."""
    peg = ao.Problem(body(distance(1e-4)), ao.Event(0, [-1.3, 0.4]), ao.Event(1, [1.5, -0.4616]))
    sol = ao.solve(peg, seconds=0.5, throw=False)
    assert not sol.success or sol.contacts


@pytest.mark.long
def test_from_a_point_on_a_small_disc():
    """Between this point, where f is zero, and the next sample the straight line is inside."""
    radius, end = 0.01, np.array([3.8, -3.79])
    system = systems.particle("x y", obstacle=lambda q, t: q @ q - 1e-4)
    path = ao.solve(ao.Problem(system, ao.Event(0.0, end), ao.Event(1.0, [0.0, radius])))
    turn = np.arctan2(*end) - np.arccos(radius / np.hypot(*end))  # on the disc, to the top
    length = np.sqrt(end @ end - radius**2) + radius * turn
    assert path.action == pytest.approx(length**2 / 2, rel=1e-9)


def test_a_path_that_was_found_in_time_is_kept(monkeypatch):
    found = [SimpleNamespace(action=action) for action in (1.0, 0.5)]
    ws = SimpleNamespace(restart=lambda: None, take_up=lambda path: setattr(ws, "here", path))

    def refined(ws, tol, arcs):
        if ws.here is not found[0]:
            raise OutOfTime
        return Status.SOLVED

    monkeypatch.setattr(least_along, "refine_contact", refined)
    monkeypatch.setattr(least_along, "_another", lambda *_: True)
    monkeypatch.setattr(least_along, "contact_parts", lambda _: ())
    best, status, _ = least_along._least(ws, 1e-8, found)
    assert (best.here, status) == (found[0], Status.SOLVED)
    with pytest.raises(OutOfTime):
        least_along._least(ws, 1e-8, found[1:])


@pytest.mark.long
def test_why_there_is_no_path():
    walls = systems.particle(obstacle=lambda q, t: [q[0] - 3 * np.sin(np.pi * t), 2 - q[0]])
    with pytest.raises(ao.SolveError, match="may contradict each other"):
        ao.solve(ao.Problem(walls, ao.Event(0, [1.0]), ao.Event(1, [1.0])))
    twice = body(disc(), lambda q: 2 * disc()(q))
    with pytest.raises(ao.SolveError, match="give each surface once"):
        ao.solve(ao.Problem(twice, ao.Event(0, [-2, 0.3]), ao.Event(1, [2, 0])), tol=1e-6)


@pytest.mark.quick("<lambda>-gradient is not zero on its surface")
@pytest.mark.parametrize(
    "row, why",
    [
        (lambda q: (q @ q - 1) ** 3, "gradient is not zero on its surface"),
        (lambda q: (q @ q - 1) * np.abs(q @ q - 1), "a kink or a corner"),
    ],
)
def test_a_surface_without_a_normal_is_named(row, why):
    with pytest.raises(ao.SolveError, match=why):
        ao.solve(ao.Problem(body(row), ao.Event(0, [-2.5, 0.1]), ao.Event(1, [2.5, -0.2])))


@at_once(
    "row, parts",
    [
        (lambda q: np.fmin(q[0] - 1, 2 * q[1] ** 2), lambda x, y: [x - 1, 2 * y**2]),
        (lambda q: 1 - abs(q[0]), lambda x, y: [1 - x, 1 + x]),
        (
            lambda q: 3 - 2 * np.fmax(abs(q[0] - 1), q[1]) - q[0] ** 2,
            lambda x, y: [3 - 2 * z - x**2 for z in (x - 1, 1 - x, y)],
        ),
        (
            lambda q: 1 - abs(q[0]) - abs(q[1]) * 3,
            lambda x, y: [1 + a * x + 3 * b * y for a in (-1, 1) for b in (-1, 1)],
        ),
        (lambda q: q[1] - abs(np.fmin(q[0], 0)), lambda x, y: [y - abs(min(x, 0))]),
        (lambda q: np.fmax(abs(q[0]), abs(q[1])) - 1, lambda x, y: [max(abs(x), abs(y)) - 1]),
        (lambda q: np.fmin(q @ q - 1, 2.0), lambda x, y: [min(x**2 + y**2 - 1, 2.0)]),
        (lambda q: sum(-abs(q[0] - k) for k in range(5)), None),  # too many
    ],
)
def test_a_minimum_is_several_rows(row, parts):
    for place in ([0.3, -0.7], [-1.9, 0.2], [1.3, 2.1]):
        found = body(row).obstacle(place, 0.0)
        assert found.min() == pytest.approx(row(np.array(place)))
        assert parts is None or sorted(found) == pytest.approx(sorted(parts(*place)))
    assert parts is not None or found.size == 1


@pytest.mark.long
def test_what_goes_round_a_corner():
    """What is said where a string turns on corners, such as a square's, leads round it."""
    ends = ao.Event(0, [-3, 0.2]), ao.Event(1, [3, -0.1])
    corners = [[-1.0, 1.0], [1.0, 1.0]]
    through = [ao.Event(None, corner) for corner in corners]
    sharp = ao.solve(ao.Problem(body(), *ends, through=through))
    points = np.array([ends[0].q, *corners, ends[1].q], dtype=float)
    length = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    assert np.sqrt(2 * sharp.action) == pytest.approx(length, rel=1e-12)

    def rounded(f, g):
        return (f + g + np.sqrt((f - g) ** 2 + 0.1**2)) / 2

    smooth = body(lambda q: rounded(rounded(q[0], -q[0]), rounded(q[1], -q[1])) - 1)
    assert np.sqrt(2 * ao.solve(ao.Problem(smooth, *ends)).action) == pytest.approx(
        length, rel=1e-2
    )


def thin(width, angle=0.0):
    """Return the outside of an ellipse of the semi-axes `width` and 1, turned by an angle."""
    c, s = float(np.cos(angle)), float(np.sin(angle))
    return lambda q: ((c * q[0] + s * q[1]) / width) ** 2 + (c * q[1] - s * q[0]) ** 2 - 1


def round_ellipse(A, B, width, angle):
    """Return the lengths of strings round it on either side: two tangents and the arc between."""
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    A, B = ((turn @ x) for x in (np.array(A), np.array(B)))
    touching = []
    for x, sign in ((A, 1), (B, -1)):  # eccentric angles of the points where tangents touch
        u = np.arctan2(x[1], x[0] / width)
        reach = np.arccos(1 / np.hypot(x[0] / width, x[1]))
        touching.append((u + sign * reach, u - sign * reach))
    nodes, weights = np.polynomial.legendre.leggauss(400)
    found = []
    for (a, b), way in zip(zip(*touching, strict=True), (1, -1), strict=True):
        span = way * (b - a) % (2 * np.pi)
        u = a + way * span * (nodes + 1) / 2
        arc = span / 2 * weights @ np.hypot(width * np.sin(u), np.cos(u))
        ends = (np.array([width * np.cos(u), np.sin(u)]) for u in (a, b))
        lines = (np.hypot(*(x - end)) for x, end in zip((A, B), ends, strict=True))
        found.append(arc + sum(lines))
    return found


def round_thin_wall(width, angle, A=(-2.5, 0.1), B=(2.5, -0.2), tol=1e-6):
    """Return the length of the string found, and those on either side, the shorter first."""
    sol = ao.solve(ao.Problem(body(thin(width, angle)), ao.Event(0, A), ao.Event(1, B)), tol=tol)
    return np.sqrt(2 * sol.action), sorted(round_ellipse(A, B, width, angle))


@pytest.mark.long
@pytest.mark.parametrize(
    ("width", "angle"), a_quarter([(0.015, -0.7), (0.1, 0.0), (0.03, 1.2), (0.01, -1.2)])
)
def test_a_string_round_the_edge_of_a_thin_wall(width, angle):
    length, known = round_thin_wall(width, angle)
    assert length == pytest.approx(known[0], rel=1e-9)


@pytest.mark.long
@pytest.mark.parametrize(
    ("angle", "A", "B"),
    [
        (0.3, (-2.5, 0.1), (2.5, -0.2)),  # one side or the other was lost, as rounding decided
        pytest.param(-0.632, (-0.863, -0.057), (1.556, 0.134), marks=pytest.mark.slow),
    ],
)
def test_a_string_round_a_wall_of_a_hundredth_is_on_the_shorter_side(angle, A, B):
    length, known = round_thin_wall(0.01, angle, A, B, 1e-8)
    assert length == pytest.approx(known[0], rel=1e-9)


@pytest.mark.slow
def test_a_fall_over_the_edge_of_a_thin_wall():
    """Two parabolas to the edge and from it, at the time at which they take least action."""
    A, B, edge, g, T = np.array([-1.0, 0.2]), np.array([1.2, 0.0]), np.array([0.0, 1.0]), 3.0, 1.0
    wall = thin(0.01)
    system = systems.thrown(g=g, obstacle=lambda q, t: wall(q))
    sol = ao.solve(ao.Problem(system, ao.Event(0, A), ao.Event(T, B)))

    def parabola(a, b, t):
        return (b - a) @ (b - a) / (2 * t) - g * t * (a[1] + b[1]) / 2 - g**2 * t**3 / 24

    t = np.linspace(0.2, 0.8, 6001)
    least = min(parabola(A, edge, t) + parabola(edge, B, T - t) for t in t)
    assert sol.action == pytest.approx(least, rel=2e-4)  # the edge has the radius 1e-4
    (arc,) = sol.contacts
    assert arc.end - arc.begin < 1e-3


def test_pictures():
    sol = ao.solve(ao.Problem(body(disc()), ao.Event(0, [-2, 0.3]), ao.Event(1, [2, 0])))
    above, below = plot.overview(sol)
    assert len(above.collections) == 2  # the disc and its edge
    t, force = below.lines[0].get_data()
    assert force.max() == pytest.approx(sol.action)
    (arc,) = sol.contacts
    assert np.all((force > 0) == ((arc.begin <= t) & (t <= arc.end)))
    with pytest.raises(ValueError, match=FREE):
        plot.relaxation_data(sol)


def majorant(t, y):
    """Return S of the least concave majorant of points: a string of unit tension over them."""
    hull: list[int] = []
    for i in range(t.size):
        while len(hull) > 1 and (y[hull[-1]] - y[hull[-2]]) * (t[i] - t[hull[-2]]) <= (
            y[i] - y[hull[-2]]
        ) * (t[hull[-1]] - t[hull[-2]]):
            hull.pop()
        hull.append(i)
    return np.sum(np.diff(y[hull]) ** 2 / np.diff(t[hull])) / 2


@pytest.mark.long
@pytest.mark.parametrize("seed", a_quarter(range(4)))
def test_a_string_over_random_hills_is_the_least_concave_majorant(seed):
    rng = np.random.default_rng(seed)
    size, phase = rng.uniform(0.1, 0.5, 3), rng.uniform(0, 6, 3)

    def hills(t):
        return sum(size[i] * np.sin(3 * (i + 2) * t + phase[i]) for i in range(3))

    ends = [(t, hills(t) + rng.uniform(0.01, 0.5)) for t in (0.0, 1.0)]
    string = systems.particle("y", obstacle=lambda q, t: q[0] - hills(t))
    sol = ao.solve(ao.Problem(string, *(ao.Event(t, [y]) for t, y in ends)))
    t = np.linspace(0, 1, 20001)
    y = hills(t)
    y[0], y[-1] = (height for _, height in ends)
    # Between points h apart hills are up to h^2 |f''| / 8 higher, which nu = -f'' presses there.
    steep = np.abs(np.diff(hills(t), n=2)).max() / (t[1] - t[0]) ** 2
    miss = steep * steep * (t[1] - t[0]) ** 2 / 8
    assert 0 <= sol.action - majorant(t, y) + 1e-12 < miss < 1e-5
    assert sol.contact_force(t).min() > -1e-6 and (sol(t)[0] - y).min() > -1e-6


def test_the_other_side_of_a_disc():
    sol = ao.solve(
        ao.Problem(body(disc()), ao.Event(0, (-2, 0.3)), ao.Event(1, (2, 0.1))), tol=1e-4
    )
    (curve,) = other_sides(sol.discrete, sol.contacts)
    above, below = sol(0.5)[1], curve(0.5)[1]
    assert above > 0.9 and below < -0.9
    assert curve([0.0, 1.0]) == pytest.approx(sol([0.0, 1.0]))


def turn(radius):
    """Return a guess once round the origin."""
    return lambda t: radius * np.stack([np.sin(2 * np.pi * t), np.cos(2 * np.pi * t)])


@pytest.mark.long
def test_a_belt_begins_on_a_surface():
    """Round discs of the radii R and r, d apart: tangents, and the angles in contact."""
    R, r, d = 1.0, 0.5, 3.0
    tilt = np.arcsin((R - r) / d)
    length = 2 * np.sqrt(d**2 - (R - r) ** 2) + R * (np.pi + 2 * tilt) + r * (np.pi - 2 * tilt)
    start = ao.Event(0.0, None, on=lambda q, t: q[0] - 1.3)
    problem = ao.Problem(body(disc(), disc(d, 0.0, r)), start, ao.Periodic(1.0))
    sol = ao.solve(problem, guess=lambda t: np.array([[1.5], [0]]) + 3 * turn(1.0)(t))
    assert sol.action == pytest.approx(length**2 / 2, rel=1e-8)
    assert sol.start.q[0] == pytest.approx(1.3, abs=1e-8)
    assert sol.momenta[1] == pytest.approx(sol.momenta[0], rel=1e-8)
    assert sol.problem.original.start.on is not None and sol.morse_index == 0


@pytest.mark.quick("0.6")
@pytest.mark.parametrize("x", [0.0, 0.6])
def test_a_belt_begins_in_contact(x):
    start = ao.Event(0.0, None, on=lambda q, t: q[0] - x)
    problem = ao.Problem(body(disc()), start, ao.Periodic(1.0))
    sol = ao.solve(problem, guess=turn(1.4), throw=False)
    assert sol.success and sol.action == pytest.approx(2 * np.pi**2, rel=1e-8)
    assert np.abs(sol.start.q) == pytest.approx([x, np.sqrt(1 - x**2)], abs=1e-8)


@pytest.mark.parametrize("x, guess, why", [(9.0, 1.4, "not meet it"), (0.0, 0.1, "to a point")])
def test_a_belt_that_cannot_begin_on_its_surface(x, guess, why):
    start = ao.Event(0.0, None, on=lambda q, t: q[0] - x)
    problem = ao.Problem(body(disc(0.0), disc(5.0)), start, ao.Periodic(1.0))
    away = np.array([[0.0], [0.0 if guess > 1 else 3.0]])
    with pytest.raises(ao.SolveError, match=why):
        ao.solve(problem, guess=lambda t: away + turn(guess)(t))


def test_closed_paths_from_surfaces_along_obstacles_are_refused_in_words():
    moving = systems.particle("x y", obstacle=lambda q, t: q @ q - 1 - t)
    with pytest.raises(ValueError, match="to have no clock"):
        ao.Problem(moving, ao.Event(0.0, None, on=lambda q, t: q[0]), ao.Periodic(1.0))
    for q, on in (([0.0, None], lambda q, t: q[1] - 1), (None, lambda q, t: [q[0], q[1] - 1])):
        with pytest.raises(ValueError, match="expected one condition"):
            ao.Problem(body(disc()), ao.Event(0.0, q, on=on), ao.Periodic(1.0))


def test_a_closed_path_round_one_disc_without_a_guess_is_not_found():
    """Nothing tells which way it should go: it shrinks to a point."""
    system = systems.particle("x y", obstacle=lambda q, t: q @ q - 1)
    problem = ao.Problem(system, ao.Event(0.0, None), ao.Periodic(1.0))
    assert not ao.solve(problem, throw=False).success


@pytest.mark.quick("-0.1")
@pytest.mark.parametrize("y", [0.1, -0.1])
def test_round_one_disc_ipopt_is_not_asked(y):
    A, B = (-2.0, y), (2.0, y)
    sol = ao.solve(ao.Problem(body(disc()), ao.Event(0.0, A), ao.Event(1.0, B)))
    assert sol.morse_index == 0 and "ipopt" not in sol.stats["iterations"]
    ra = np.hypot(*A)
    angle = np.pi - 2 * np.arctan2(abs(y), 2.0) - 2 * np.arccos(1 / ra)
    assert sol.action == pytest.approx((2 * np.sqrt(ra**2 - 1) + angle) ** 2 / 2, rel=1e-9)
    assert np.sign(sol(0.5)[1]) == np.sign(y)  # the nearer side


@pytest.mark.parametrize("V, action", [(-3, 8 * np.sqrt(1.5) / 3), (3, -11.025)])
def test_a_place_that_the_least_path_passes_anyway_or_at_another_time(V, action):
    """The floor is passed at sqrt(2 / 3), before at 0.1; the leg of a throw has a time that is."""
    system = ao.System(lambda q, v, t: v @ v / 2 - V * q[0], ["y"], obstacle=lambda q, t: q[0])
    ends = ao.Event(0, [1.0]), ao.Event(3, [1.0])
    found = ao.solve(ao.Problem(system, *ends, through=[ao.Event(None, [0.1])]))
    assert found.action == pytest.approx(action, abs=1e-9) and found.kind == "minimum"


def test_a_power_as_an_obstacle_is_named():
    system = ao.System(lambda q, v, t: v @ v / 2 + 3 * q[0], ["y"], obstacle=lambda q, t: q[0] ** 3)
    with pytest.raises(ao.SolveError, match="found a power of the distance"):
        ao.solve(ao.Problem(system, ao.Event(0, [1.0]), ao.Event(3, [1.0])))


@pytest.mark.long
def test_a_string_whose_weight_changes_half_way_goes_round_a_disc_in_its_middle():
    """Of the length l in all, a of it with the mass 1: a^2 + 4 (l - a)^2 is least, 4 l^2 / 5."""
    length = 2 * np.sqrt(3) + np.pi / 3
    laws = [body(disc()), body(disc(), mass=4.0)]
    ends = ao.Event(0, [-2.0, 0.0]), ao.Event(1, [2.0, 0.0])
    found = ao.solve(ao.Problem(laws, *ends, through=[ao.Event(0.5, None)]))
    assert found.action == pytest.approx(0.8 * length**2, rel=1e-9)


@pytest.mark.parametrize("energy", [None, 2.0])
def test_of_two_paths_along_an_obstacle_the_one_of_less_action_is_better(energy):
    """Given energy it is S + E T that is less."""

    def found(action, duration):
        asked = SimpleNamespace(energy=energy)
        answer = {"problem": asked, "success": True, "action": action, "duration": duration}
        return free_contact._rank(SimpleNamespace(**answer))

    assert found(1.0, 1.0) < found(1.5, 1.0)
    assert (found(1.0, 2.0) < found(1.5, 1.0)) is (energy is None)


def test_the_action_of_a_polygon_is_that_along_its_sides():
    fall = ao.System(lambda q, v, t: v @ v / 2 - (9.81 + t) * q[1], ["x", "y"])
    problem = ao.Problem(fall, ao.Event(0, [0, 0]), ao.Event(3, [2, 1]))
    polygon = ao.Path(ao.Mesh([0.0, 1.0, 3.0], 1), np.array([[0.0, 1.0, 2.0], [0.0, 4.0, 1.0]]))
    exact = (1 + 16) / 2 + (1 + 9) / 4 - 10.31 * 2 - 2 * 11.81 * 2.5  # by its middles
    found = least_along._action_of(problem, polygon.mesh.nodes_since, polygon.values.T)
    assert found == pytest.approx(exact, rel=1e-14)


def test_of_linear_forces_no_momentum_is_missed_beside_an_obstacle():
    """Of a long coordinate its round-off, in units of short ones, was: 512 elements at 1e-12."""
    names = [f"x{k}" for k in range(20)]
    driven = lambda q, v, t: v @ v / 2 + q[1] * np.cos(3 * t) / 2  # noqa: E731
    system = ao.System(driven, names, obstacle=lambda q, t: q @ q - 1e-4)
    first = np.where(np.arange(20) == 0, -1.0, 0.05)
    problem = Held(ao.Problem(system, ao.Event(0, first), ao.Event(2, -first)), ())
    tr = Transcription(problem, ao.Mesh.uniform(0, 2, 8, 12), problem.lengths)
    assert tr.quadrature_defect(tr.pack(tr.straight()))[1] == 0.0


def test_first_curves_round_an_obstacle_go_to_all_sides():
    disc = systems.particle("x y", obstacle=lambda q, t: q @ q - 1)
    problem = ao.Problem(disc, ao.Event(0.0, [-2.0, 0.1]), ao.Event(1.0, [2.0, 0.1]))
    found = curves(problem, 2, 0)
    assert found[0] is None
    drawn, t = found[-4:], np.linspace(0, 1, 9)
    chord = np.array([-2.0, 0.1])[:, None] + np.array([4.0, 0.0])[:, None] * t
    for one, other in zip(drawn[::2], drawn[1::2], strict=True):
        np.testing.assert_allclose((one(t) + other(t)) / 2, chord, atol=1e-12)
        np.testing.assert_allclose(one([0.0, 1.0]), chord[:, [0, -1]], atol=1e-12)
    past = sorted(f(0.5)[1] for f in found[1:3])
    assert past[0] < -1.0 and past[1] > 1.0


PLACE = ca.SX.sym("q", 2)
X, Y = ca.vertsplit(PLACE)


@at_once(
    ("row", "count"),
    [
        (ca.fmin(X, Y), 2),
        (2 * ca.fmin(X, Y) + ca.fmin(X - 1, 3 * Y), 4),
        (-ca.fmax(X, -Y), 2),
        (Y - ca.fabs(X), 2),
        (Y - ca.fmax(X, ca.fmin(2 * X, -X)) / 2, 2),
        (ca.fmin(X, Y) * -2, 1),
        (ca.fmax(X, Y), 1),
        (ca.fmin(X, 1.0), 1),
        (1 - ca.sumsqr(PLACE), 1),
    ],
)
def test_a_row_is_the_minimum_of_its_parts(row, count):
    s = SimpleNamespace(q=PLACE, t=ca.SX.sym("t"), p=ca.SX.sym("p", 0))
    parts = minimum_parts(row, s)
    both = ca.Function("both", [PLACE], [row, ca.mmin(ca.vertcat(*parts))])
    known, found = both.map(50)(np.random.default_rng(0).standard_normal((2, 50)))
    np.testing.assert_allclose(found, known, atol=1e-14)
    assert len(parts) == count


def test_parts_in_contact_travel():
    disc = systems.particle("x y", obstacle=lambda q, t: q @ q - 1)
    problem = ao.Problem(disc, ao.Event(0.0, [-2.0, 0.1]), ao.Event(1.0, [2.0, 0.1]))
    held = Held(problem, (Arc(0, 0.4, 0.6),))
    make, given = held.__reduce__()
    made = make(*given)
    assert (made.arcs, made.free, made.sought) == (held.arcs, problem, held.sought)


def test_a_question_without_times_is_asked_over_one():
    ends = ao.Event(0.0, [0.0]), ao.Event(None, [1.0])
    problem = ao.Problem(systems.particle(), *ends, energy=1.0)
    assert free_contact._at_first(problem).duration == 1.0
    joined = problem.replace(through=[ao.Event(None, [0.5])])
    assert times_of(free_contact._at_first(joined)).tolist() == [0.0, 1.0, 2.0]


def string_round_disc(y, side=1):
    """Return the length of a taut string from (-2, .1) to (2, y), past the unit disc on a side."""
    ends = np.array([-2.0, 0.1]), np.array([2.0, y])
    radii = [np.linalg.norm(x) for x in ends]
    angles = [np.arctan2(side * x[1], x[0]) for x in ends]
    turned = angles[0] % (2 * np.pi) - angles[1] - sum(np.arccos(1 / r) for r in radii)
    if turned < 0:
        return np.linalg.norm(ends[1] - ends[0])
    return sum(np.sqrt(r**2 - 1) for r in radii) + turned


def past_disc(T=1.0, **more):
    disc = systems.particle("x y", obstacle=lambda q, t: q @ q - 1)
    return ao.Problem(disc, ao.Event(0.0, [-2.0, 0.1]), ao.Event(T, [2.0, 0.1]), **more)


def test_ways_on_both_sides_of_a_disc():
    found = ao.solve_all(past_disc(), starts=1)
    lengths = [string_round_disc(0.1, side) for side in (1, -1)]
    np.testing.assert_allclose([s.action for s in found], np.square(lengths) / 2, rtol=1e-7)


@pytest.mark.long
def test_a_trace_leaves_a_disc():
    found = ao.trace(past_disc(), ("end", "y"), 2.9)
    exact = [string_round_disc(y) ** 2 / 2 for y in found.values]
    np.testing.assert_allclose(found.actions, exact, rtol=1e-6)
    assert found.values[-1] == 2.9 and exact[-1] == (16 + 2.8**2) / 2


def test_a_string_of_given_energy_takes_its_length_as_time():
    """sqrt(2 E) times the length is S + E T."""
    s = ao.solve(past_disc(None, energy=2.0))
    assert s.action + 2.0 * s.duration == pytest.approx(2.0 * string_round_disc(0.1), rel=1e-7)
    assert s.duration == pytest.approx(string_round_disc(0.1) / 2, rel=1e-6)


def test_an_obstacle_leaves_the_forces_of_a_constraint_to_it():
    """A bead at speed 2 on a circle of radius 1: its constraint pulls it inwards with 4."""
    laws = {"constraint": lambda q, t: q @ q - 1, "obstacle": lambda q, t: q[1] + 2}
    ends = ao.Event(0.0, [1.0, 0.0]), ao.Event(1.0, [0.0, 1.0])
    held = Held(ao.Problem(systems.particle("x y", **laws), *ends), ())
    force = held.constraint_force(np.array([1.0, 0.0]), np.array([0.0, 2.0]), 0.0)
    np.testing.assert_allclose(force, [-4.0, 0.0], atol=1e-12)


@at_once(
    ("t", "distance", "zero"),
    [
        ([0.3], [1.0], 0.3),
        ([0.3, 0.5], [1.0, 2.0], 0.4),
        ([0.3, 0.5, 0.7], [0.5, 1.5, 2.5], 0.98 * 0.3 + 0.02 * 0.4),  # the line is zero before
        ([0.3, 0.5, 0.7], [0.1, 0.2, 0.6], 0.98 * 0.4 + 0.02 * 0.4),  # it is at 0.4
        ([0.3, 0.5, 0.7], [0.5, 1.5, 1.5], 0.98 * 0.3 + 0.02 * 0.4),  # it is nowhere
    ],
)
def test_contact_begins_where_distances_are_zero(t, distance, zero):
    assert _where_zero(np.array(t), np.array(distance)) == pytest.approx(zero)
