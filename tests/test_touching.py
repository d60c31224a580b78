"""Paths with accelerations along obstacles: moments and arcs of contact, impulses, index."""

import pickle
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest
from helpers import at_once
from scipy.integrate import solve_ivp

import actionopt as ao
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.borders.contact_times import (
    ContactEquations,
    contact_edges,
    merge_contacts,
    slips,
    with_contact_times,
)
from actionopt.discrete.borders.stretch import Stretch
from actionopt.discrete.matrices.factors import full
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.mechanics.question.held import Held
from actionopt.mechanics.question.obstacle import Arc

SPLINE = ao.System(lambda q, v, a, t: a[0] ** 2 / 2, ["x"], obstacle=lambda q, t: q[0])
BEAM = ao.System(
    lambda q, v, a, x, *, w: a[0] ** 2 / 2 + w * q[0],
    ["y"],
    parameters={"w": 2000.0},
    obstacle=lambda q, x: q[0],
)
ROUGH = ao.System(
    lambda q, v, a, t: a @ a / 2 + (1 + t) * q[0] * v[1] / 3 + q[0] ** 2 * q[1],
    ["x", "y"],
    obstacle=lambda q, t: [q @ q - 1 + t / 10, q[0] + 2 * q[1] ** 2 + 3 * t * q[1]],
)
DISC = ao.System(lambda q, v, a, t: a @ a / 2, ["x", "y"], obstacle=lambda q, t: q @ q - 1)


def between(system, start, end, T, tol=1e-10, **more):
    """Return the path between (q, v) and (q, v) in the time T."""
    events = ao.Event(0, start[0], v=start[1]), ao.Event(T, end[0], v=end[1])
    return ao.solve(ao.Problem(system, *events, **more), tol=tol)


def dropped(V):
    """From 1 to 1 in the unit time, with velocities -V and V."""
    return between(SPLINE, ([1.0], [-V]), ([1.0], [V]), 1.0)


def lying(w=2000.0, y=(1.0, 1.0)):
    """A beam that is clamped at heights y, its ends level."""
    return between(BEAM, ([y[0]], [0.0]), ([y[1]], [0.0]), 1.0, parameters={"w": w})


def free_length(w, y=1.0):
    """Of a beam that lies on the floor from there on: y = w s^3 (4 l - 3 s) / 72."""
    return (72 * y / w) ** 0.25


def action_of_beam(w):
    """The beam hangs freely, touches in the middle, or lies there."""
    if w < 384:
        return w - w**2 / 1440
    if w < 1152:
        return 96 + w / 2 - w**2 / 23040
    return 2 * w**2 * free_length(w) ** 5 / 135


def test_a_spline_touches_a_floor_at_a_moment():
    found = dropped(5.0)
    # Half of it is the cubic from (1, -V) to (0, 0) in the time h, of the jerk 12 / h^3 - 6 V /
    # h^2, which has the other sign after.
    h, V = 0.5, 5.0
    (arc,) = found.contacts
    assert arc.point and arc.begin == pytest.approx(h, abs=1e-12)
    assert found.action == pytest.approx(56.0, rel=1e-12)
    assert found.contact_impulses == pytest.approx(
        np.array([[2 * (6 * V / h**2 - 12 / h**3), 0]]), rel=1e-10
    )
    assert found.contact_force([0.3, 0.5]) == pytest.approx(0.0)
    assert found.morse_index == 0 and found.inertia.nullity == 0
    before, after = found.momentum([0.25, 0.75])[0]
    assert after - before == pytest.approx(-found.contact_impulses[0, 0], rel=1e-10)


def test_a_faster_one_lies_on_it():
    found, t1 = dropped(7.0), 3 / 7  # (1 - t / t1)^3 on either side
    (arc,) = found.contacts
    assert (arc.begin, arc.end) == pytest.approx((t1, 1 - t1), abs=1e-11)
    assert found.action == pytest.approx(12 / t1**3, rel=1e-11)
    assert found.contact_impulses == pytest.approx(np.full((1, 2), 6 / t1**3), rel=1e-9)
    t = np.linspace(0, t1, 9)
    assert found(t)[0] == pytest.approx((1 - t / t1) ** 3, abs=1e-10)
    assert np.abs(found(np.linspace(t1, 1 - t1, 9))).max() < 1e-12
    assert found.morse_index == 0


def test_a_spline_that_stays_above_touches_nothing():
    found = dropped(3.0)
    assert found.contacts == () and found.action == pytest.approx(18.0, rel=1e-12)
    assert found.contact_impulses.shape == (0, 2)


def test_a_beam_under_tension_that_touches_nothing_is_refined_as_any_other():
    law = lambda q, v, a, t: a[0] ** 2 / 2 + 20 * v[0] ** 2  # noqa: E731
    ends = ([0.43], [-3.5]), ([1.14], [-0.2])
    found = between(ao.System(law, ["x"], obstacle=lambda q, t: q[0]), *ends, 1.0)
    assert found.contacts == ()
    assert found.action == pytest.approx(between(ao.System(law, ["x"]), *ends, 1.0).action)


def test_a_beam_lies_on_a_floor(tmp_path):
    found, y = lying(y=(1.0, 0.8)), (1.0, 0.8)
    first, last = (free_length(2000.0, h) for h in y)
    (arc,) = found.contacts
    assert (arc.begin, arc.end) == pytest.approx((first, 1 - last), abs=1e-11)
    assert found.contact_impulses == pytest.approx(
        np.array([[2000 * first / 3, 2000 * last / 3]]), rel=1e-9
    )
    assert found.contact_force([0.2, arc.begin, 0.5, arc.end]) == pytest.approx(
        np.array([[0, 2000, 2000, 2000]]), rel=1e-7
    )
    t = np.array([0.0, 0.1, 0.5, 0.9, 1.0])
    assert found.energy(t) == pytest.approx(0.0, abs=1e-9)  # that of lying at rest
    assert found.compare().agrees
    # S falls apart into that of both ends, 2000^2 l^5 / 135 each: as h^(5 / 4).
    known = found.sensitivity()
    p = 1.25 * 2000**2 * first**5 / 135 / y[0]
    assert found.momenta[0][0] == pytest.approx(-p, rel=1e-10)
    assert known.q0[0] == pytest.approx(p, rel=1e-10)
    assert known.q0q0[0, 0] == pytest.approx(p / 4 / y[0], rel=1e-6)
    assert known.q0q1 == pytest.approx(0.0, abs=1e-6)
    again = pickle.loads(pickle.dumps(found))
    found.save(tmp_path / "lying.npz")
    kept = ao.load(tmp_path / "lying.npz", BEAM)
    for other in (again, kept):
        assert other.contacts == found.contacts and other.morse_index == 0
        assert other.contact_impulses == pytest.approx(found.contact_impulses, rel=1e-12)
        assert other(t) == pytest.approx(found(t), abs=1e-14)


@pytest.mark.long
@pytest.mark.long
@pytest.mark.parametrize("unit", [1e-4, 1e6])
def test_a_beam_lies_on_a_floor_in_any_unit_of_its_height(unit):
    law = lambda q, v, a, t: (a[0] / unit) ** 2 / 2 + 2000 * q[0] / unit  # noqa: E731
    beam = ao.System(law, ["y"], obstacle=lambda q, t: q[0])
    found, first = between(beam, ([unit], [0.0]), ([unit], [0.0]), 1.0), free_length(2000.0)
    (arc,) = found.contacts
    assert (arc.begin, arc.end) == pytest.approx((first, 1 - first), abs=1e-11)
    assert found.action == pytest.approx(action_of_beam(2000.0), rel=1e-12)


@pytest.mark.long
def test_variations_move_the_moment():
    """The lowest mode turns the beam where it touches, held there by nu / f'' as by a spring."""
    found, h, nu, bent = lying(600.0), 0.5, 108.0, 11.5
    assert found.contact_impulses[0, 0] == pytest.approx(nu, rel=1e-10)
    assert found.path.acceleration(0.5)[0] == pytest.approx(bent, rel=1e-9)

    def left(value):
        """Return the moment that a mode of one half lacks in the middle, as that of both."""
        b = value**0.25
        c, s = np.cosh(b * h) - np.cos(b * h), np.sinh(b * h) - np.sin(b * h)
        c1, s1 = np.cosh(b * h) + np.cos(b * h), np.sinh(b * h) + np.sin(b * h)
        a, d = 2 * b**2 * np.array([c1, s1]) + nu / bent * b * np.array([s1, c])
        return c * d - s * a

    values = ao.second_variation(found, 1).eigenvalues
    assert left(values[0] - 1) * left(values[0] + 1) < 0
    assert ao.conjugate_points(found) == ()


@pytest.mark.long
def test_modes_of_a_beam_that_lies_are_those_of_its_ends():
    found = lying(y=(1.0, 0.7))
    both = [(4.730040744862704 / free_length(2000.0, y)) ** 4 for y in (1.0, 0.7)]
    assert ao.second_variation(found, 2).eigenvalues == pytest.approx(both, rel=1e-6)


@pytest.mark.long
def test_a_load_is_traced_from_lying_to_hanging():
    events = ao.Event(0, [1.0], v=[0.0]), ao.Event(1, [1.0], v=[0.0])
    found = ao.trace(ao.Problem(BEAM, *events), "w", 300.0)
    assert found.stopped == "it reached the goal" and not found.indices.any()
    known = [action_of_beam(w) for w in found.values]
    assert found.actions == pytest.approx(known, rel=1e-7)
    kinds = [[arc.point for arc in found.solution(k).contacts] for k in (0, -1)]
    assert kinds == [[False], []]


@pytest.mark.long
def test_loads_are_swept():
    events = ao.Event(0, [1.0], v=[0.0]), ao.Event(1, [1.0], v=[0.0])
    loads = [300.0, 700.0, 1100.0, 1500.0, 9000.0]
    found = ao.sweep(ao.Problem(BEAM, *events), {"w": loads})
    assert found.action == pytest.approx([action_of_beam(w) for w in loads], rel=1e-7)


def test_a_floor_that_moves():
    """The cubics before and after meet it with its velocity; their accelerations are the same."""
    floor, rate = lambda t: 0.3 * np.sin(np.pi * t), lambda t: 0.3 * np.pi * np.cos(np.pi * t)
    system = ao.System(
        lambda q, v, a, t: a[0] ** 2 / 2, ["x"], obstacle=lambda q, t: q[0] - floor(t)
    )
    found = between(system, ([1.0], [-6.0]), ([1.0], [4.0]), 1.0)

    def apart(t):
        d, v, h = 1 - floor(t), rate(t), 1 - t
        return (6 * d / t**2 + (4 * v - 12) / t) - (6 * d / h**2 - (4 * v + 8) / h)

    low, high = 0.3, 0.6
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if apart(low) * apart(middle) > 0 else (low, middle)
    (arc,) = found.contacts
    assert arc.point and arc.begin == pytest.approx(low, abs=1e-10)
    assert found.contact_impulses[0, 0] > 0 and found.compare().agrees


def newton(function, x):
    """Return the root of a function (c,) near x, derivatives by differences."""
    for _ in range(12):
        steps = 1e-6 * np.eye(x.size)
        J = np.array([(function(x + e) - function(x - e)) / 2e-6 for e in steps]).T
        x = x - np.linalg.solve(J, function(x))
    return x


def clamped_spline(t, q, v0, v1):
    """Return velocities (k, n) at t (k,), accelerations after these times, jerks and the action."""
    h, q = np.diff(t), np.array(q, dtype=float)
    M, right = np.eye(len(t)), np.zeros(q.shape)
    right[0], right[-1] = v0, v1
    for i in range(1, len(t) - 1):
        M[i, i - 1 : i + 2] = 1 / h[i - 1], 2 / h[i - 1] + 2 / h[i], 1 / h[i]
        right[i] = 3 * ((q[i] - q[i - 1]) / h[i - 1] ** 2 + (q[i + 1] - q[i]) / h[i] ** 2)
    v, h, d = np.linalg.solve(M, right), h[:, None], np.diff(q, axis=0)
    a = (6 * d / h - 4 * v[:-1] - 2 * v[1:]) / h
    j = (6 * (v[:-1] + v[1:]) - 12 * d / h) / h**2
    return v, a, j, float(np.sum(a * a * h + a * j * h**2 + j * j * h**3 / 3) / 2)


@pytest.mark.long
def test_a_spline_touches_a_disc_twice():
    """Splines through two points of it: along it in both, the jerk jumps along its normal."""
    ends = ([-2.0, -0.1], [1.0, 0.0]), ([2.0, 0.4], [1.2, 0.2])
    found = between(DISC, *ends, 3.0)

    def through(x):
        n, along = (np.stack(f, 1) for f in _frame(x[:2]))
        knots = [ends[0][0], *n, ends[1][0]]
        return n, along, clamped_spline([0, *x[2:], 3], knots, ends[0][1], ends[1][1])

    def missed(x):
        n, along, (v, _, j, _) = through(x)
        return np.r_[np.sum(n * v[1:-1], 1), np.sum(np.diff(j, axis=0) * along, 1)]

    x = newton(missed, np.array([1.78, 1.58, 1.47, 1.61]))
    n, _, (_, _, j, action) = through(x)
    assert [arc.begin for arc in found.contacts] == pytest.approx(x[2:], abs=1e-9)
    assert found.action == pytest.approx(action, rel=1e-11)
    assert found.contact_impulses[:, 0] == pytest.approx(
        np.sum(np.diff(j, axis=0) * n, 1) / 2, rel=1e-7
    )
    assert found.morse_index == 0 and found.compare().agrees


def _frame(phi):
    """Return the normal and the direction along a unit circle."""
    return (np.cos(phi), np.sin(phi)), (-np.sin(phi), np.cos(phi))


@pytest.mark.long
def test_a_spline_runs_along_a_disc():
    """On it theta'''' = 6 theta'^2 theta'', by symmetry up to the middle, where theta'' = 0."""
    q0, v0 = np.array([-1.2, -1.0]), np.array([0.0, 2.0])
    found = between(DISC, (q0, v0), ([1.2, -1.0], [0.0, -2.0]), 2.0, tol=1e-9)

    def law(y):
        _, w, a, j, _ = y
        return np.array([w, a, j, 6 * w**2 * a, (a**2 + w**4) / 2])

    def to_middle(x):
        phi, w, h = x
        n, along = map(np.array, _frame(phi))
        a = (6 * (n - q0) / h - 4 * v0 - 2 * w * along) / h
        j = (6 * (v0 + w * along) - 12 * (n - q0) / h) / h**2
        y = np.array([phi, w, (a + j * h) @ along, w**3 + j @ along, 0.0])
        action, dt = (a @ a * h + a @ j * h**2 + j @ j * h**3 / 3) / 2, (1 - h) / 100
        for _ in range(100):  # Runge and Kutta's method
            k = [law(y)]
            for part in (0.5, 0.5, 1.0):
                k.append(law(y + part * dt * k[-1]))
            y = y + dt / 6 * (k[0] + 2 * k[1] + 2 * k[2] + k[3])
        return np.array([(a + j * h) @ n + w**2, y[0] + np.pi / 2, y[2]]), 2 * (action + y[4])

    x = newton(lambda x: to_middle(x)[0], np.array([-1.69, 1.82, 0.935]))
    (arc,) = found.contacts
    assert (arc.begin, arc.end) == pytest.approx((x[2], 2 - x[2]), abs=1e-8)
    assert found.action == pytest.approx(to_middle(x)[1], rel=1e-9)
    t = np.linspace(0, 2, 401)
    assert DISC.obstacle(found(t), t).min() > -1e-9
    assert found.contact_force(np.linspace(arc.begin, arc.end, 9)).min() > 1
    assert found.contact_impulses.min() > 6 and found.morse_index == 0
    assert found.compare().agrees
    H = found.energy(np.linspace(0, 2, 9))
    assert pytest.approx(H[0], rel=1e-7) == H


def test_a_given_area_presses_a_spline_on_the_floor():
    """The multiplier of the area is a load: that which leaves l = 3 / 8 free on either side."""
    system = ao.System(
        lambda q, v, a, t: a[0] ** 2 / 2,
        ["x"],
        obstacle=lambda q, t: q[0],
        integral=lambda q, v, t: q[0],
    )
    found = between(system, ([1.0], [0.0]), ([1.0], [0.0]), 1.0, integral=0.3)
    load = 72 / 0.375**4
    assert found.integral_multipliers[0] == pytest.approx(load, rel=1e-9)
    (arc,) = found.contacts
    assert (arc.begin, arc.end) == pytest.approx((0.375, 0.625), abs=1e-9)
    assert found.contact_force(0.5) == pytest.approx(load, rel=1e-7)
    assert found.action == pytest.approx(2 * load**2 * 0.375**5 * (8 / 1080 - 1 / 180), rel=1e-9)


def test_a_path_through_an_event_touches_before_it():
    events = ao.Event(0, [1.0], v=[-5.0]), ao.Event(2, [1.0], v=[2.0])
    found = ao.solve(ao.Problem(SPLINE, *events, through=[ao.Event(1.2, [0.5])]), tol=1e-10)
    (arc,) = found.contacts

    def missed(t):
        v, *_ = clamped_spline([0, *t, 1.2, 2], [[1.0], [0.0], [0.5], [1.0]], -5.0, 2.0)
        return v[1]

    t = newton(missed, np.array([0.5]))
    _, _, j, action = clamped_spline([0, *t, 1.2, 2], [[1.0], [0.0], [0.5], [1.0]], -5.0, 2.0)
    assert arc.begin == pytest.approx(t[0], abs=1e-10)
    assert found.action == pytest.approx(action, rel=1e-10)
    assert found.contact_impulses[0, 0] == pytest.approx(j[1, 0] - j[0, 0], rel=1e-9)
    assert found.impulses[0, 0] == pytest.approx(j[1, 0] - j[2, 0], rel=1e-9)
    assert [part.contacts for part in found.parts] == [found.contacts, ()]


def test_a_spline_touches_a_ceiling_and_a_floor():
    box = ao.System(
        lambda q, v, a, t: a[0] ** 2 / 2, ["x"], obstacle=lambda q, t: [q[0], 1.2 - q[0]]
    )
    found = between(box, ([1.0], [3.0]), ([0.1], [2.0]), 1.0)
    t = np.linspace(0, 1, 1001)
    assert [arc.row for arc in found.contacts] == [1, 0]
    assert box.obstacle(found(t), t).min() > -1e-10 and found.contact_impulses[:, 0].min() > 0

    def missed(times):
        v, *_ = clamped_spline([0, *times, 1], [[1.0], [1.2], [0.0], [0.1]], 3.0, 2.0)
        return v[1:-1, 0]

    times = newton(missed, np.array([0.2, 0.9]))
    assert [arc.begin for arc in found.contacts] == pytest.approx(times, abs=1e-9)


def test_a_beam_whose_end_is_free_lies_to_its_end():
    ends = ao.Event(0, [1.0], v=[0.0]), ao.Event(1, [None])
    found = ao.solve(ao.Problem(BEAM, *ends), tol=1e-10)
    (arc,) = found.contacts
    assert (arc.begin, arc.end) == pytest.approx((free_length(2000.0), 1.0), abs=1e-10)
    assert found.action == pytest.approx(action_of_beam(2000.0) / 2, rel=1e-10)


def test_derivatives_of_the_equations_of_contact():
    """By all unknowns and the times of contact, against differences, at no path."""
    ends = ao.Event(0, [-2, 1.3], v=[1, 0]), ao.Event(2, [2, 1.3])
    held = Held(ao.Problem(ROUGH, *ends), (Arc(0, 0.5, 1.1), Arc(1, 1.5, 1.5)))
    mesh = Mesh.over(0, 2, np.array([0, 0.5, 0.8, 1.1, 1.5, 2]), 6)
    tr = Transcription(held, mesh, np.array([2.0, 1.5]))
    z, h = np.random.default_rng(1).normal(size=tr.layout.size), 1e-6
    times, steps = held.contact_times, h * np.eye(z.size)
    by_z = [(tr.residual(z + e) - tr.residual(z - e)) / (2 * h) for e in steps]
    np.testing.assert_allclose(full(tr.layout, tr.kkt(z)), np.array(by_z).T, rtol=1e-6, atol=1e-4)
    columns, rows, corner, now = contact_edges(tr, z)
    values = lambda tr, z: slips(DiscretePath(tr, z)).values  # noqa: E731
    by_z = [(values(tr, z + e) - values(tr, z - e)) / (2 * h) for e in steps]
    np.testing.assert_allclose(rows, np.array(by_z).T, atol=1e-7)
    np.testing.assert_allclose(now, values(tr, z))
    for j, move in enumerate(h * np.eye(times.size)):
        a, b = (with_contact_times(tr, sign * move) for sign in (1, -1))
        change = (a.residual(z) - b.residual(z)) / (2 * h)
        np.testing.assert_allclose(columns[:, j], change, rtol=1e-6, atol=1e-4)
        np.testing.assert_allclose(corner[:, j], (values(a, z) - values(b, z)) / (2 * h), atol=1e-7)


def along_elastica(x, k, N, spans):
    """Return theta, theta', x, y and S at the ends of `spans` of the arclength, an array each.

    From theta = 0 at x = (x, y) with the curvature k: theta'' = N sin theta - V cos theta, V given
    with each span. By Dormand and Prince's method.
    """
    found, y, a = [], np.array([0.0, k, *x, 0.0]), 0.0
    for V, b in spans:
        y = solve_ivp(_bend, (a, b), y, "DOP853", rtol=1e-11, atol=1e-12, args=(N, V)).y[:, -1]
        found.append(y)
        a = b
    return found


def _bend(s, y, N, V):
    theta, k = y[:2]
    c, d = np.cos(theta), np.sin(theta)
    return [k, N * d - V * c, c, d, k * k / 2]


def _bending_elements(length, height, k, n):
    """Return W's derivatives by the angles of a chain of n bars and by three multipliers.

    Its energy of bending, its end at (1, 0), and its highest point, by the parabola through node k
    and its neighbours, at a height: (gradient, Hessian, energy) as a function.
    """
    h, angles, lam = length / n, ca.SX.sym("theta", n - 1), ca.SX.sym("lam", 3)
    theta = ca.vertcat(0, angles, 0)
    middle, energy = (theta[1:] + theta[:-1]) / 2, ca.sumsqr(theta[1:] - theta[:-1]) / (2 * h)
    y = ca.vertcat(0, ca.cumsum(h * ca.sin(middle)))
    top = y[k] - (y[k + 1] - y[k - 1]) ** 2 / (8 * (y[k + 1] - 2 * y[k] + y[k - 1]))
    W = energy + ca.dot(lam, ca.vertcat(h * ca.sum1(ca.cos(middle)) - 1, y[n], top - height))
    z = ca.vertcat(angles, lam)
    gradient = ca.gradient(W, z)
    return ca.Function("W", [z], [gradient, ca.jacobian(gradient, z), energy])


@pytest.mark.long
@pytest.mark.parametrize(
    ("length", "near"),
    [
        (1.1, [-68.0, -18.0, 18.0, 2.4, 0.55]),
        (1.14, [-80.0, -25.0, 25.0, 2.4, 0.45]),  # where it is pressed aside
    ],
)
def test_an_elastica_of_given_length_is_pressed_on_a_ceiling(length, near):
    """Against shooting along the arclength, with another shear force V behind the contact."""
    system = ao.System(
        lambda q, v, a, x: a[0] ** 2 / (2 * (1 + v[0] ** 2) ** 2.5),
        ["y"],
        integral=lambda q, v, x: np.sqrt(1 + v[0] ** 2),
        obstacle=lambda q, x: 0.2 - q[0],
    )
    ends = ao.Event(0, [0.0], v=[0.0]), ao.Event(1, [0.0], v=[0.0])
    question = ao.Problem(system, *ends, integral=length)
    found = ao.solve(question, guess=lambda x: [0.2 * np.sin(np.pi * x) ** 2], tol=1e-9)

    def shot(x):
        N, before, behind, k, s = x
        return along_elastica((0, 0), k, N, [(before, s), (behind, length)])

    def missed(x):
        top, end = shot(x)
        return np.r_[top[[0, 3]] - [0, 0.2], end[[0, 2, 3]] - [0, 1, 0]]

    x = newton(missed, np.array(near))
    top, end = shot(x)
    (arc,) = found.contacts
    assert arc.point and arc.begin == pytest.approx(top[2], abs=1e-10)
    assert found.action == pytest.approx(end[4], rel=1e-10)
    assert found.contact_impulses[0, 0] == pytest.approx(x[2] - x[1], rel=1e-8)
    # What a longer beam costs is its energy over the length.
    assert found.integral_multipliers[0] == pytest.approx(x[0] + x[3] ** 2 / 2, rel=1e-8)
    along, theta = np.linspace(0, 1, 2001), []
    slope = found.velocity(along)[0]
    speed = np.sqrt(1 + slope**2)
    s = np.r_[0, np.cumsum((speed[1:] + speed[:-1]) / 2 * np.diff(along))]
    for n in (40, 80):
        W = _bending_elements(length, 0.2, round(x[4] / length * n), n)
        theta = np.interp(np.linspace(0, length, n + 1), s, np.arctan(slope))[1:-1]
        z = np.r_[theta, -x[0], x[1], x[2] - x[1]]
        for _ in range(12):
            z = z - np.linalg.solve(*(f.full() for f in W(z)[1::-1])).ravel()
        assert float(W(z)[2]) == pytest.approx(found.action, rel=20 / n**2)
        assert np.sum(np.linalg.eigvalsh(W(z)[1].full()) < 0) == 3 + found.morse_index


@pytest.mark.long
def test_an_elastica_of_given_length_goes_round_a_disc():
    """In the plane, where the speed is even by itself; up to the middle by shooting.

    Where it meets the disc it is as bent as that. From the guess Ipopt goes astray with the length
    as a constraint.
    """
    length, start = 4.36, (-2.0, 0.2)
    system = ao.System(
        lambda q, v, a, t: a @ a / (2 * np.sqrt(v @ v) ** 3),
        ["x", "y"],
        integral=lambda q, v, t: np.sqrt(v @ v),
        obstacle=lambda q, t: q @ q - 1,
    )
    ends = ao.Event(0, start, v=[length, 0]), ao.Event(1, [2.0, 0.2], v=[length, 0])
    found = ao.solve(
        ao.Problem(system, *ends, integral=length),
        guess=lambda t: [-2 + 4 * t, 0.2 + 1.3 * np.sin(np.pi * t)],
        tol=1e-9,
    )

    def missed(x):
        N, V, k, s, phi = x
        (there,) = along_elastica(start, k, N, [(V, s)])
        disc = phi - np.pi / 2, -1, np.cos(phi), np.sin(phi)
        return np.r_[there[:4] - disc, phi - np.pi / 2 - (length / 2 - s)]

    x = newton(missed, np.array([3.92, 3.02, 1.41, 1.994, 1.757]))
    (there,) = along_elastica(start, x[2], x[0], [(x[1], x[3])])
    (arc,) = found.contacts
    assert (arc.begin, arc.end) == pytest.approx((x[3] / length, 1 - x[3] / length), abs=1e-8)
    assert found.action == pytest.approx(2 * there[4] + length / 2 - x[3], rel=1e-8)
    speed = np.linalg.norm(found.velocity(np.linspace(0, 1, 21)), axis=0)
    assert speed == pytest.approx(length, rel=1e-7)
    assert found.contact_impulses.min() > 0 and found.morse_index == 0


def test_derivatives_by_times_of_what_rows_do():
    """First and second ones of S + mu.c, with c = 0, as events and times of contact move."""
    ends = ao.Event(0, [-2, 1.3], v=[1, 0]), ao.Event(2, [2, 1.3])
    boundaries, h = np.array([0, 0.5, 0.8, 1.1, 1.5, 2]), 1e-5
    rates = np.array([[0, 1, 0.6, 0.2, 0.1, 0], [0, 0, 0.3, 0.7, 1, 1]])

    def at(move, like=None):
        b = boundaries + np.array(move) @ rates
        ask = ao.Problem(ROUGH, ends[0], ao.Event(b[-1], [2, 1.3]))
        arcs = Arc(0, b[1], b[3]), Arc(1, b[4], b[4])
        mesh = Mesh.over(0, b[-1], b, 6)
        return Transcription(Held(ask, arcs), mesh, np.array([2.0, 1.5]), like=like)

    tr = at([0, 0])
    z = np.random.default_rng(3).normal(size=tr.layout.size)
    x, mu = z[: tr.layout.unknowns], z[tr.layout.unknowns :]
    J = full(tr.layout, tr.kkt(z))[x.size :, : x.size]
    for _ in range(9):
        J = full(tr.layout, tr.kkt(np.r_[x, mu]))[x.size :, : x.size]
        x = x - np.linalg.pinv(J) @ tr.constraint(x)
    z, steps = np.r_[x, mu], h * np.eye(2)

    def W(move):
        there = at(move, tr)
        return tr.action_unit * (there.action(x) + mu @ there.constraint(x))

    slopes = lambda move: Stretch(DiscretePath(at(move, tr), z), rates).slopes()  # noqa: E731
    by_times = [(W(e) - W(-e)) / (2 * h) for e in steps]
    np.testing.assert_allclose(slopes([0, 0]), by_times, rtol=1e-6, atol=1e-5)
    twice = np.array([(slopes(e) - slopes(-e)) / (2 * h) for e in steps])
    found = Stretch(DiscretePath(tr, z), rates).twice()
    np.testing.assert_allclose(found, twice, rtol=1e-6, atol=1e-4)


@pytest.mark.long
def test_a_duration_is_found_that_has_an_energy():
    """Down to the floor at a moment: S = 4 (3 - 3 V h + V^2 h^2) / h^3, h half of the duration."""
    V, E, h = 5.0, 8.0, 0.5
    assert -18 / h**4 + 12 * V / h**3 - 2 * V**2 / h**2 == pytest.approx(-E)  # dS/dT = -H
    ends = ao.Event(0, [1.0], v=[-V]), ao.Event(None, [1.0], v=[V])
    found = ao.solve(ao.Problem(SPLINE, *ends, energy=E), tol=1e-10)
    assert found.duration == pytest.approx(2 * h, abs=1e-11)
    assert found.contacts[0].begin == pytest.approx(h, abs=1e-11)
    assert found.action == pytest.approx(56.0, rel=1e-11)
    assert found.energy([0.2, 0.8]) == pytest.approx(E, rel=1e-9)
    assert found.morse_index == 0


@pytest.mark.long
def test_a_duration_is_found_over_a_floor_that_moves():
    """Two durations have the energy; at the longer one, near a guess, H grows: S + E T falls."""
    w, E, v0, v1 = 3.0, -4.582097151979738, [-6.0], [4.0]
    floor = lambda t: 0.3 * np.sin(w * t)  # noqa: E731
    system = ao.System(
        lambda q, v, a, t: a[0] ** 2 / 2, ["x"], obstacle=lambda q, t: q[0] - floor(t)
    )

    def spline(t, T):
        v, a, j, action = clamped_spline([0, t, T], [[1.0], [floor(t)], [1.0]], v0, v1)
        end = a[-1, 0] + j[-1, 0] * (T - t)
        H = end**2 / 2 - j[-1, 0] * v1[0]
        return np.array([v[1, 0] - 0.3 * w * np.cos(w * t), H - E]), action

    def ask(T, **more):
        return ao.Problem(system, ao.Event(0, [1.0], v=v0), ao.Event(T, [1.0], v=v1), **more)

    t, T = newton(lambda x: spline(*x)[0], np.array([0.37, 0.77]))
    found = ao.solve(ask(None, energy=E), tol=1e-10)
    assert (found.contacts[0].begin, found.duration) == pytest.approx((t, T), abs=1e-10)
    assert found.action == pytest.approx(spline(t, T)[1], rel=1e-10) and found.morse_index == 0
    longer = newton(lambda x: spline(*x)[0], np.array([0.43, 1.0]))
    other = ao.solve(ask(None, energy=E), guess=ao.solve(ask(longer[1])), throw=False)
    assert other.duration == pytest.approx(longer[1], abs=1e-7)
    assert other.status is ao.Status.NOT_LEAST


@pytest.mark.long
def test_the_end_of_a_spline_slides_along_a_line():
    """Where neither its height nor its velocity is given: no force there, and no moment."""
    start = [-2.0, 0.2], [1.0, 0.0]
    events = ao.Event(0, start[0], v=start[1]), ao.Event(3, None, on=lambda q, t: q[0] - 2)
    found = ao.solve(ao.Problem(DISC, *events), tol=1e-10)

    def through(x):
        n, along = map(np.array, _frame(x[0]))
        return n, along, clamped_spline([0, x[1], 3], [start[0], n, [2, x[2]]], start[1], x[3:])

    def missed(x):
        n, along, (v, a, j, _) = through(x)
        end = a[-1] + j[-1] * (3 - x[1])
        return np.r_[n @ v[1], (j[1] - j[0]) @ along, end, j[-1, 1]]

    x = newton(missed, np.array([1.7, 1.35, 2.1, 1.4, 0.9]))
    assert found.contacts[0].begin == pytest.approx(x[1], abs=1e-9)
    assert found(3.0) == pytest.approx(np.array([2, x[2]]), abs=1e-9)
    assert found.velocity(3.0) == pytest.approx(x[3:], abs=1e-8)
    assert found.action == pytest.approx(through(x)[2][3], rel=1e-10)
    assert found.morse_index == 0


@pytest.mark.long
def test_the_time_of_an_event_is_found_before_a_spline_touches():
    """There the jerk jumps across the velocity alone: the energy does not."""
    ends = ([-2.0, 0.2], [1.0, 0.0]), ([2.0, 0.2], [1.0, 0.0])
    question = ao.Problem(
        DISC,
        ao.Event(0, ends[0][0], v=ends[0][1]),
        ao.Event(3, ends[1][0], v=ends[1][1]),
        through=[ao.Event(None, [-0.9, 0.9])],
    )
    found = ao.solve(question, tol=1e-10)

    def through(x):
        n, along = map(np.array, _frame(x[0]))
        knots = [ends[0][0], [-0.9, 0.9], n, ends[1][0]]
        return n, along, clamped_spline([0, *x[1:], 3], knots, ends[0][1], ends[1][1])

    def missed(x):
        n, along, (v, _, j, _) = through(x)
        return np.array([n @ v[2], (j[2] - j[1]) @ along, (j[1] - j[0]) @ v[1]])

    x = newton(missed, np.array([1.4, 0.95, 1.75]))
    assert found.problem.through[0].t == pytest.approx(x[1], abs=1e-9)
    assert found.contacts[0].begin == pytest.approx(x[2], abs=1e-9)
    assert found.action == pytest.approx(through(x)[2][3], rel=1e-10)
    assert np.ptp(found.energy([0.1, 0.9, 1.2, 2.5])) < 1e-8


@at_once(
    ("ask", "says"),
    [
        (
            lambda: ao.System(lambda q, v, a, j, t: j @ j, ["x"], obstacle=lambda q, t: q[0]),
            "derivatives above accelerations",
        ),
        (
            lambda: ao.System(
                lambda q, v, a, t: a @ a,
                ["x", "y"],
                obstacle=lambda q, t: q[0],
                constraint=lambda q, t: q[1],
            ),
            "an obstacle alone",
        ),
        (
            lambda: ao.Problem(SPLINE, ao.Event(0, [None]), ao.Periodic(1)),
            "an end that is given where an obstacle",
        ),
        (
            lambda: ao.Problem(
                SPLINE, ao.Event(0, [1]), ao.Event(2, [1]), through=[ao.Event(1, [0])]
            ),
            "the velocity at event 0 of through",
        ),
        (
            lambda: ao.Problem(SPLINE, ao.Event(0, [0], v=[-1]), ao.Event(1, [1])),
            "does not lead into the obstacle",
        ),
    ],
)
def test_what_is_refused_is_said(ask, says):
    with pytest.raises(ValueError, match=says):
        ask()


@pytest.mark.long
@pytest.mark.parametrize(
    ("load", "floor", "start", "end", "kinds"),
    [
        # Its end is pulled off, and touches once more: the floor bends there the other way.
        (0.0, (0.1853, 2.0, 1.5423), (0.466, -3.0912), (0.2375, 5.1691), [False, True]),
        # The arc is so short that the first mesh sees a moment.
        (1257.8, (0.2306, 4.0, 5.0831), (0.7907, 4.8505), (0.4511, -2.1197), [False]),
    ],
)
def test_contacts_are_revised(load, floor, start, end, kinds):
    """Between arcs and moments, until the floor presses everywhere: nu = y'''' + load on an arc."""
    A, w, phase = floor
    system = ao.System(
        lambda q, v, a, t: a[0] ** 2 / 2 + load * q[0],
        ["x"],
        obstacle=lambda q, t: q[0] - A * np.sin(w * t + phase),
    )
    found = between(system, *[([q], [v]) for q, v in (start, end)], 1.0)
    assert [arc.point for arc in found.contacts] == kinds
    t = np.linspace(0, 1, 2001)
    assert system.obstacle(found(t), t).min() > -1e-9 and found.contact_impulses.min() >= 0
    arc = found.contacts[0]
    t = np.linspace(arc.begin, arc.end, 9)
    nu = A * w**4 * np.sin(w * t + phase) + load
    assert nu.min() > 0 and found.contact_force(t)[0] == pytest.approx(nu, rel=1e-4, abs=1e-3)
    assert found.morse_index == 0 and found.compare().agrees


def test_parts_in_contact_become_one_where_what_is_between_them_vanishes():
    def merged(a, b, *arcs, fixed=()):
        held = SimpleNamespace(fixed_times=fixed, arcs=arcs)
        return merge_contacts(held, a, b, moments=True)

    arcs = Arc(0, 1.0, 2.0), Arc(0, 2.5, 3.0), Arc(1, 2.1, 4.0)
    assert merged(2.0, 2.5, *arcs) == (Arc(0, 1.0, 3.0), arcs[2])
    assert merged(1.0, 2.0, arcs[0]) == (Arc(0, 1.5, 1.5),)
    assert merged(1.0, 2.0, arcs[0], fixed=(2.0,)) == (Arc(0, 2.0, 2.0),)
    assert merged(2.5, 3.0, *arcs[:2], fixed=(2.5,)) == (arcs[0], Arc(0, 2.5, 2.5))


def test_equations_of_times_of_contact_have_their_derivative_and_follow_the_events():
    """A straight line to a disc, along it and off again; in twice the time, at twice the times."""
    disc = ao.System(lambda q, v, t: v @ v / 2, ["x", "y"], obstacle=lambda q, t: q @ q - 1)

    def problem(T):
        return ao.Problem(disc, ao.Event(0.0, [-2.0, 0.1]), ao.Event(T, [2.0, 0.1]))

    at = ao.solve(problem(1.0)).discrete
    equations = ContactEquations(at.tr)
    y = np.r_[at.z, np.zeros(2)]
    assert equations.layout.size == y.size and np.abs(equations.residual(y)).max() < 1e-6
    step = 1e-6 * np.random.default_rng(0).standard_normal(y.size)
    change = (equations.residual(y + step) - equations.residual(y - step)) / 2
    found = full(equations.layout, equations.kkt(y)) @ step
    np.testing.assert_allclose(found, change, atol=1e-6 * np.abs(change).max())
    np.testing.assert_allclose(equations.of(problem(2.0)).times, 2 * equations.times)
    gone = np.r_[at.z, 1.0, 0.0]  # the arc begins after its end
    assert np.isnan(equations.residual(gone)).all()


def test_parts_with_nothing_between_become_one_and_moments_are_let_go():
    def merged(a, b, *arcs, fixed=()):
        held = SimpleNamespace(fixed_times=fixed, arcs=arcs)
        return merge_contacts(held, a, b, moments=False)

    arcs = Arc(0, 1.0, 2.0), Arc(0, 2.5, 3.0), Arc(1, 2.1, 4.0)
    assert merged(2.0, 2.5, *arcs) == (Arc(0, 1.0, 3.0), arcs[2])
    assert merged(1.0, 2.0, *arcs[:2]) == arcs[1:2]
    assert merged(1.0, 2.0, arcs[0], fixed=(2.0,)) == (Arc(0, 2.0, 2.0),)
    assert merged(2.5, 3.0, *arcs[:2], fixed=(2.5,)) == (arcs[0], Arc(0, 2.5, 2.5))
