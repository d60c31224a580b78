"""Lagrangians with accelerations: splines, beams, momenta, index, free times, integrals."""

import math
import pickle
from itertools import pairwise

import numpy as np
import pytest
import systems
from helpers import at_once, slow
from scipy.integrate import solve_bvp
from scipy.interpolate import CubicSpline, make_interp_spline
from scipy.optimize import brentq, root

import actionopt as ao
from actionopt.analysis.tables import _by_name
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.borders.bordered import Bordered
from actionopt.discrete.matrices.factors import full
from actionopt.discrete.meshes.element import element
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.solver.refinement import iterate

SPLINE = ao.System(lambda q, v, a, t: a[0] ** 2 / 2, ["x"])
MIXED = ao.System(
    lambda q, v, a, t: (
        (1 + q[0] ** 2 / 10) * a[0] ** 2 / 2
        + v[0] * q[1] ** 2 * a[1]
        + np.sin(q[0] * v[1])
        + (1 + t) * a[1] ** 2 * (1 + v[0] ** 2)
    ),
    ["x", "y"],
)


STIFF = 4.0
RING = ao.System(lambda q, v, a, t: (a @ a) / 2 + STIFF * (v @ v - 1) ** 2 / 4, ["x", "y"])


def between(system, start, end, **more):
    """Return the path between events given as (t, q, v)."""
    events = [ao.Event(t, q, v=v) for t, q, v in (start, end)]
    return ao.solve(ao.Problem(system, *events, **more), tol=1e-11)


@at_once(("degree", "order"), [(3, 2), (8, 2), (5, 3), (14, 3), (9, 4)])
def test_an_element_holds_all_polynomials_and_its_ends(degree, order):
    shape = element(degree, order)
    x = shape.rule.nodes
    for k in range(order):  # what an unknown at an end is called, it is
        for side, first in ((0, 0), (-1, degree + 1 - order)):
            unit = np.zeros(degree + 1)
            unit[first + k] = 1.0
            found = [basis[side] @ unit for basis in shape.basis[:order]]
            np.testing.assert_allclose(found, np.eye(order)[k], atol=1e-12)
    # Any polynomial of the degree is one of theirs, and so are its derivatives.
    rough = np.polynomial.Polynomial(np.cos(np.arange(degree + 1)))
    unknowns = np.linalg.solve(shape.basis[0], rough(x))
    for k, basis in enumerate(shape.basis):
        wanted = rough.deriv(k)(x) if k else rough(x)
        np.testing.assert_allclose(basis @ unknowns, wanted, rtol=1e-9, atol=1e-9)


def test_gradient_and_matrix_are_derivatives_of_the_action():
    problem = ao.Problem(
        MIXED, ao.Event(0.1, [0.2, 0.1], v=[0, None]), ao.Event(1, [1, 0.3], v=[0.3, -1])
    )
    tr = Transcription(problem, Mesh([0.1, 0.4, 0.7, 1], [5, 6, 5]), np.array([1.0, 2.0]))
    z = np.random.default_rng(0).normal(size=tr.layout.size)
    steps = 1e-6 * np.eye(z.size)
    slope = [(tr.action(z + e) - tr.action(z - e)) / 2e-6 for e in steps]
    gradient = tr.gradient(z)
    np.testing.assert_allclose(gradient, slope, atol=1e-8 * np.abs(gradient).max())
    bent = [(tr.gradient(z + e) - tr.gradient(z - e)) / 2e-6 for e in steps]
    matrix = full(tr.layout, tr.kkt(z))
    np.testing.assert_allclose(matrix, bent, atol=1e-8 * np.abs(matrix).max())


def test_cubic_between_two_states():
    path = between(SPLINE, (0, [0], [0]), (1, [1], [0]))
    assert path.action == pytest.approx(6, abs=1e-12)
    np.testing.assert_allclose(path.momenta, [[12, 6], [12, -6]], atol=1e-10)
    t = np.linspace(0, 1, 9)
    np.testing.assert_allclose(path(t)[0], 3 * t**2 - 2 * t**3, atol=1e-13)
    np.testing.assert_allclose(path.velocity(t)[0], 6 * t - 6 * t**2, atol=1e-12)
    np.testing.assert_allclose(path.acceleration(t)[0], 6 - 12 * t, atol=1e-10)
    np.testing.assert_allclose(path.momentum(t), [12 + 0 * t, 6 - 12 * t], atol=1e-10)
    np.testing.assert_allclose(path.energy(t), 18, atol=1e-10)
    assert path.morse_index == 0
    assert path.compare().agrees


@pytest.mark.long
@pytest.mark.parametrize("ends", ["natural", "clamped"])
def test_through_points_it_is_the_spline(ends):
    rng = np.random.default_rng(3)
    t = np.cumsum(rng.uniform(0.2, 1, 7))
    points, rates = rng.normal(size=(7, 2)), rng.normal(size=(2, 2))
    known = rates if ends == "clamped" else [None, None]
    events = [ao.Event(x, q) for x, q in zip(t, points, strict=True)]
    events[0], events[-1] = (
        ao.Event(e.t, e.q, v=v) for e, v in zip((events[0], events[-1]), known, strict=True)
    )
    system = ao.System(lambda q, v, a, t: (a @ a) / 2, ["x", "y"])
    path = ao.solve(ao.Problem(system, events[0], events[-1], through=events[1:-1]), tol=1e-11)
    bc = ((1, rates[0]), (1, rates[1])) if ends == "clamped" else "natural"
    spline = CubicSpline(t, points, bc_type=bc)
    s = np.linspace(t[0], t[-1], 200)
    np.testing.assert_allclose(path(s).T, spline(s), atol=1e-11)
    np.testing.assert_allclose(path.velocity(s).T, spline(s, 1), atol=1e-9)
    jumps = [spline(x - 1e-9, 3) - spline(x + 1e-9, 3) for x in t[1:-1]]  # p_1 = -d(a)/dt
    np.testing.assert_allclose(path.impulses[:, :2], jumps, rtol=1e-7)
    np.testing.assert_allclose(path.impulses[:, 2:], 0, atol=1e-9)
    assert path.morse_index == 0
    assert path.compare().agrees


def test_a_velocity_that_is_given_on_the_way():
    # Two cubics on their own: S = 2 (3 d^2 - 3 d (v0 + v1) h + (v0^2 + v0 v1 + v1^2) h^2) / h^3.
    def action(d, v0, v1, h):
        return 2 * (3 * d**2 - 3 * d * (v0 + v1) * h + (v0**2 + v0 * v1 + v1**2) * h**2) / h**3

    path = between(SPLINE, (0, [0], [1]), (3, [2], [0]), through=[ao.Event(1, [1.5], v=[-0.5])])
    assert path.action == pytest.approx(action(1.5, 1, -0.5, 1) + action(0.5, -0.5, 0, 2))
    assert path.velocity(1.0)[0] == pytest.approx(-0.5, abs=1e-13)
    assert abs(path.impulses[0, 1]) > 1  # a moment holds it


def test_higher_orders():
    t, points = np.array([0, 0.4, 1.0]), np.array([0, 0.7, 1.0])
    jerk = ao.System(lambda q, v, a, j, t: j[0] ** 2 / 2, ["x"])
    events = [ao.Event(x, [y]) for x, y in zip(t, points, strict=True)]
    events[0], events[2] = (ao.Event(e.t, e.q, v=[0], a=[0]) for e in (events[0], events[2]))
    path = ao.solve(ao.Problem(jerk, events[0], events[2], through=events[1:2]), tol=1e-11)
    rest = [(1, 0.0), (2, 0.0)]
    spline = make_interp_spline(t, points, k=5, bc_type=(rest, rest))
    s = np.linspace(0, 1, 50)
    np.testing.assert_allclose(path(s)[0], spline(s), atol=1e-12)
    snap = ao.System(lambda q, v, a, j, s, t: s[0] ** 2 / 2, ["x"])
    ends = (ao.Event(x, [x], v=[0], a=[0], j=[0]) for x in (0, 1))
    path = ao.solve(ao.Problem(snap, *ends), tol=1e-11)
    assert path(0.3)[0] == pytest.approx(35 * 0.3**4 - 84 * 0.3**5 + 70 * 0.3**6 - 20 * 0.3**7)
    assert path.momenta[0].shape == (4,)


@pytest.mark.long
def test_a_right_path_agrees_with_motion_in_any_order():
    law = lambda q, v, j: j @ j / 2 + v @ v / 4 - 0.3 * np.cos(q[0])  # noqa: E731
    system = ao.System(lambda q, v, a, j, t: law(q, v, j), ["x", "y"])
    through = [ao.Event(0.7, [0.6, 0.2], v=[0.5, None])]
    path = ao.solve(ao.Problem(system, ao.Event(0, [0, 0]), ao.Event(2, [1.5, 1]), through=through))
    found = path.compare()
    assert found.agrees
    assert found.position < 1e-8


@pytest.mark.long
def test_nonlinear_beam_against_collocation():
    # Extended Fisher and Kolmogorov's equation with a load: g q'''' = q'' + q - q^3 + cos t.
    g = 0.3
    system = ao.System(
        lambda q, v, a, t: (
            g * a[0] ** 2 / 2 + v[0] ** 2 / 2 + (q[0] ** 2 - 1) ** 2 / 4 - np.cos(t) * q[0]
        ),
        ["x"],
    )
    path = between(system, (0, [0.2], [0.5]), (3, [-0.4], [None]))

    def rates(t, y):
        return np.array([y[1], y[2], y[3], (y[2] + y[0] - y[0] ** 3 + np.cos(t)) / g])

    def ends(a, b):
        return np.array([a[0] - 0.2, a[1] - 0.5, b[0] + 0.4, b[2]])

    t = np.linspace(0, 3, 60)
    first = np.zeros((4, 60))
    first[0] = 0.2 - 0.2 * t
    known = solve_bvp(rates, ends, t, first, tol=1e-10, max_nodes=20_000)
    assert known.success
    y = known.sol(t)
    np.testing.assert_allclose(path(t), y[:1], atol=1e-9)
    np.testing.assert_allclose(path.velocity(t), y[1:2], atol=1e-8)
    np.testing.assert_allclose(path.acceleration(t), y[2:3], atol=1e-7)
    np.testing.assert_allclose(path.momentum(t), [y[1] - g * y[3], g * y[2]], atol=1e-7)
    np.testing.assert_allclose(path.momenta[1][1], 0, atol=1e-10)
    assert path.compare().agrees


@at_once("load", [30.0, 60.0, 100.0, 170.0, 250.0])
def test_index_counts_the_buckling_loads_below(load):
    # Clamped at both ends these are (2 k pi)^2, and (2 x)^2 of the roots x of tan x = x.
    roots = [4.493409457909064, 7.725251836937707]
    critical = sorted([(2 * k * math.pi) ** 2 for k in (1, 2)] + [(2 * x) ** 2 for x in roots])
    system = ao.System(lambda q, v, a, t: a[0] ** 2 / 2 - load * v[0] ** 2 / 2, ["x"])
    path = between(system, (0, [0.1], [0]), (1, [0], [0.3]))
    assert path.morse_index == sum(x < load for x in critical)


def test_time_that_is_found():
    # T + 6 / T^3 is least at T^4 = 18.
    system = ao.System(lambda q, v, a, t: a[0] ** 2 / 2 + 1, ["x"])
    ends = ao.Event(0, [0], v=[0]), ao.Event(None, [1], v=[0])
    path = ao.solve(ao.Problem(system, *ends, energy=0), tol=1e-11)
    assert path.duration == pytest.approx(18**0.25, abs=1e-11)
    np.testing.assert_allclose(path.energy([0, 1, 2]), 0, atol=1e-10)
    assert path.morse_index == 0


@pytest.mark.long
def test_time_that_is_found_of_a_beam_under_tension():
    # L = (a^2 + v^2) / 2 + 1 between rests a way 1 apart: S = 1 / (2 (T - 2 tanh(T / 2))) + T.
    system = ao.System(lambda q, v, a, t: (a[0] ** 2 + v[0] ** 2) / 2 + 1, ["x"])
    ends = ao.Event(0, [0], v=[0]), ao.Event(None, [1], v=[0])
    path = ao.solve(ao.Problem(system, *ends, energy=0), tol=1e-10)
    T = path.duration
    assert (T - 2 * math.tanh(T / 2)) ** 2 == pytest.approx(math.tanh(T / 2) ** 2 / 2)
    assert path.action == pytest.approx(1 / (2 * (T - 2 * math.tanh(T / 2))) + T)


def test_waypoint_at_a_time_that_is_found_keeps_the_energy():
    system = ao.System(lambda q, v, a, t: (a @ a) / 2, ["x", "y"])
    problem = ao.Problem(
        system,
        ao.Event(0, [0, 0], v=[0, 0]),
        ao.Event(2, [2, 0], v=[0, 0]),
        through=[ao.Event(None, [1, 1])],
    )
    path = ao.solve(problem, tol=1e-11)
    assert path.problem.through[0].t == pytest.approx(1, abs=1e-9)
    np.testing.assert_allclose(path.energy_jumps, 0, atol=1e-7)
    later = ao.Event(path.problem.through[0].t + 0.05, [1, 1])
    assert ao.solve(problem.replace(through=[later])).action > path.action


@pytest.mark.long
def test_a_beam_under_tension_turns_back_at_a_line_at_a_time_that_is_found():
    w, line, T, ends = 0.9, 0.32, 0.89, (-0.51, 0.3)
    system = ao.System(lambda q, v, a, t: (a[0] ** 2 + w**2 * v[0] ** 2) / 2, ["x"])
    on = ao.Event(None, None, on=lambda q, t: q[0] - line)
    start, end = ao.Event(0, ends[:1]), ao.Event(T, ends[1:])
    found = ao.solve(ao.Problem(system, start, end, through=[on]), tol=1e-10)

    def bend(y, length):  # q = line + A (cosh ws - 1 - (sinh ws - ws) coth wl), at rest at 0
        return (y - line) / (w * length / np.tanh(w * length) - 1)

    t = brentq(lambda t: bend(ends[0], t) - bend(ends[1], T - t), 0.1, 0.88)
    legs = list(zip(ends, (t, T - t), strict=True))
    S = sum(w**3 * bend(*leg) / np.tanh(w * leg[1]) * (leg[0] - line) / 2 for leg in legs)
    assert found.problem.through[0].t == pytest.approx(t, abs=1e-10)
    assert found.action == pytest.approx(S, abs=1e-10)


@pytest.mark.long
def test_least_jerk_through_gates_whose_times_are_found():
    places = np.array([[0, 0], [1, 1], [2, -0.5], [3, 0]])
    rest = dict(v=[0, 0], a=[0, 0])
    system = ao.System(lambda q, v, a, j, t: (j @ j) / 2, ["x", "y"])
    ends = ao.Event(0, places[0], **rest), ao.Event(3, places[3], **rest)
    gates = [ao.Event(None, q) for q in places[1:3]]
    path = ao.solve(ao.Problem(system, *ends, through=gates), tol=1e-11)

    def spline(times):
        still = [(k, np.zeros(2)) for k in (1, 2)]
        return make_interp_spline([0, *times, 3], places, k=5, bc_type=(still, still))

    def action(times):
        jerk, b = spline(times).derivative(3), [0, *times, 3]
        x, w = np.polynomial.legendre.leggauss(3)
        at = [((c - a) / 2, (a + c) / 2 + (c - a) / 2 * x) for a, c in pairwise(b)]
        return sum(h * w @ np.sum(jerk(t) ** 2, axis=1) for h, t in at) / 2

    times = np.array([e.t for e in path.problem.through])
    assert path.action == pytest.approx(action(times), rel=1e-12)
    for step in 1e-3 * np.array([[1, 0], [-1, 0], [0, 1], [0, -1], [1, 1], [1, -1]]):
        assert action(times + step) > path.action  # no other times are better
    s = np.linspace(0, 3, 50)
    np.testing.assert_allclose(path(s).T, spline(times)(s), atol=1e-10)
    assert np.ptp(path.energy(s)) < 1e-10 * path.action  # on the later legs, too


@pytest.mark.long
def test_least_snap_through_gates_that_are_near_one_another():
    """Times and path at once have a small neighbourhood there; where energies balance is known."""
    system = ao.System(lambda q, v, a, j, s, t: s @ s / 2, ["x"])
    ends = [ao.Event(t, [x], v=[0], a=[0], j=[0]) for t, x in ((0.452, 0.526), (3.014, 3.675))]
    path = ao.solve(ao.Problem(system, *ends, through=[ao.Event(None, [x]) for x in (1.791, 2.4)]))
    places, rest = [0.526, 1.791, 2.4, 3.675], [(k, 0.0) for k in (1, 2, 3)]

    def steps(inner):
        times = np.array([0.452, *inner, 3.014])
        curve = make_interp_spline(times, places, k=7, bc_type=(rest, rest))
        top = curve.derivative(7)((times[1:] + times[:-1]) / 2)
        return np.diff(top) * curve(inner, 1)

    found = [event.t for event in path.problem.through]
    assert np.abs(root(steps, found, options={"xtol": 1e-13}).x - found).max() < 1e-8


def test_the_matrix_with_gates_is_the_derivative_of_the_equations():
    """Unknown times of gates under accelerations, against central differences."""
    gates = [ao.Event(None, [0.3, None]), ao.Event(None, [1.0, 0.5])]
    ends = ao.Event(0, [0, 0]), ao.Event(1, [1, 1])
    times = np.array([0, 0.3, 0.7, 1.0])
    values = np.random.default_rng(2).standard_normal((2, 16))
    path = ao.Path(Mesh(times, 5), values)
    problem = ao.Problem(MIXED, *ends, through=gates)
    equations, y = Bordered.around(problem, path, None, np.ones(2), times=times)
    steps = 1e-6 * np.eye(y.size)
    columns = [(equations.residual(y + e) - equations.residual(y - e)) / 2e-6 for e in steps]
    matrix = full(equations.layout, equations.kkt(y))
    assert np.abs(matrix - np.transpose(columns)).max() < 1e-7 * np.abs(matrix).max()


@pytest.mark.long
def test_snap_with_a_waypoint_at_a_given_energy():
    system = ao.System(lambda q, v, a, j, s, t: s[0] ** 2 / 2 + 1, ["x"])
    rest = dict(v=[0], a=[0], j=[0])
    problem = ao.Problem(
        system,
        ao.Event(0, [0], **rest),
        ao.Event(None, [2], **rest),
        energy=0,
        through=[ao.Event(None, [1])],
    )
    path = ao.solve(problem, tol=1e-9)
    # Halfway at half the time nothing holds it: S = 50400 (2 / T^3.5)^2 + T.
    assert path.duration == pytest.approx((7 * 201600) ** (1 / 8))
    assert path.problem.through[0].t == pytest.approx(path.duration / 2)


def test_sensitivity_where_a_beam_ends_on_a_line():
    system = ao.System(
        lambda q, v, a, t, *, c: (a @ a) / 2 + 0 * c, ["x", "y"], parameters={"c": 2.0}
    )
    start = ao.Event(0, [0, 0], v=[1, 0])
    end = ao.Event(1, [None, None], on=lambda q, t, *, c: q[0] + q[1] - c)
    found = ao.solve(ao.Problem(system, start, end)).sensitivity()
    # S = 3 d^2 / 2 with d = (c - 1) / sqrt(2).
    assert found.parameters["c"] == pytest.approx(1.5)
    assert found.q0[2] == pytest.approx(-1.5)  # by the velocity across: dc = -dv


def test_a_beam_ends_on_a_line():
    system = ao.System(lambda q, v, a, t: (a @ a) / 2, ["x", "y"])
    start = ao.Event(0, [0, 0], v=[1, 0])
    end = ao.Event(1, [None, None], on=lambda q, t: q[0] + q[1] - 2)
    path = ao.solve(ao.Problem(system, start, end), tol=1e-11)
    # It bends towards the line by what is missing, 1, along its normal: S = 3 d^2 / 2, d^2 = 1/2.
    assert path.action == pytest.approx(0.75)
    np.testing.assert_allclose(path(1.0), [1.5, 0.5], atol=1e-11)


@pytest.mark.long
def test_buckling_modes_by_an_integral():
    system = ao.System(lambda q, v, a, t: a[0] ** 2 / 2, ["x"], integral=lambda q, v, t: v[0] ** 2)
    ends = (ao.Event(t, [0], v=[0]) for t in (0, 1))
    path = ao.solve(ao.Problem(system, *ends, integral=1.0), tol=1e-10)
    assert -2 * path.integral_multipliers[0] == pytest.approx(4 * math.pi**2)
    assert path.morse_index == 0


@pytest.mark.long
def test_sensitivity_against_differences():
    system = ao.System(
        lambda q, v, a, t, *, k: (
            k * a[0] ** 2 / 2 + q[0] ** 4 / 4 - np.cos(t) * q[0] + v[0] * a[0] ** 2 / 5
        ),
        ["x"],
        parameters={"k": 1.0},
    )

    def solve(z):
        return between(system, (z[0], z[2:3], z[3:4]), (z[1], z[4:5], z[5:6]))

    z, h = np.array([0.1, 1.3, 0.2, 0.3, 1.0, -0.5]), 1e-4
    found = solve(z).sensitivity()
    both = [[solve(z + sign * h * e) for e in np.eye(6)] for sign in (1, -1)]
    slopes = [(a.action - b.action) / (2 * h) for a, b in zip(*both, strict=True)]
    known = [found.t0, found.t1, *found.q0, *found.q1]
    np.testing.assert_allclose(known, slopes, rtol=1e-6)
    p = [[np.r_[-x.momenta[0], x.momenta[1]] for x in side[2:]] for side in both]
    second = np.block([[found.q0q0, found.q0q1], [found.q0q1.T, found.q1q1]])
    np.testing.assert_allclose(second, (np.array(p[0]) - p[1]) / (2 * h), rtol=1e-5, atol=1e-5)


def test_forces_and_laws_of_legs():
    pushed = ao.System(
        lambda q, v, a, t: a[0] ** 2 / 2, ["x"], force=lambda q, v, t: [q[0] - 3 * v[0]]
    )
    path = between(pushed, (0, [1], [0]), (1, [1], [2]))
    # q'''' + q - 3 q' = 0
    roots = np.roots([1, 0, 0, -3, 1])
    table = [roots**0, roots, np.exp(roots), roots * np.exp(roots)]
    c = np.linalg.solve(np.array(table), [1, 0, 1, 2])
    assert path(0.4)[0] == pytest.approx(float(np.real(np.exp(0.4 * roots) @ c)), abs=1e-11)
    stiff = ao.System(lambda q, v, a, t: 2 * a[0] ** 2, ["x"])
    ends = ao.Event(0, [0], v=[0]), ao.Event(2, [0], v=[0])
    path = ao.solve(ao.Problem([stiff, SPLINE], *ends, through=[ao.Event(1, [1])]), tol=1e-11)
    # Given v at the joint S = 4 (6 - 6 v + 2 v^2) + (6 + 6 v + 2 v^2): v = 18 / 20.
    assert path.velocity(1.0)[0] == pytest.approx(0.9, abs=1e-11)
    assert path.compare().agrees


def bend_less(step):
    """Return a beam whose L steps, as `step` of x does at zero."""
    return lambda on: ao.System(lambda q, v, a, t: a[0] ** 2 / 2 - 5 * step(on(q, v, a)), ["x"])


COMPARED = bend_less(lambda x: np.where(x > 0, 1.0, 0.0))
DIVIDED = bend_less(lambda x: x / np.sqrt(x**2))  # no comparison is seen in it


@pytest.mark.quick("<lambda>1-<lambda>0")
@pytest.mark.parametrize("steps", [COMPARED, DIVIDED])
@pytest.mark.parametrize(
    "on", [lambda q, v, a: q[0] - 0.512, lambda q, v, a: v[0] - 0.5, lambda q, v, a: a[0] - 0.5]
)
def test_no_path_crosses_a_jump(steps, on):
    ends = ao.Event(0, [0], v=[0]), ao.Event(1, [1])
    found = ao.solve(ao.Problem(steps(on), *ends), throw=False)
    assert found.status is ao.Status.JUMP
    short = ao.solve(ao.Problem(steps(on), ends[0], ao.Event(1, [0.1])))  # of x below zero
    assert short.velocity(1.0)[0] == pytest.approx(0.15)


@pytest.mark.slow
def test_a_step_too_narrow_to_be_resolved_is_told():
    for width in (1e-5, 1e-9):
        system = bend_less(lambda x, width=width: np.tanh(x / width))(lambda q, v, a: q[0] - 0.512)
        problem = ao.Problem(system, ao.Event(0, [0], v=[0]), ao.Event(1, [1]))
        assert not ao.solve(problem, throw=False).success


@pytest.mark.long
def test_a_step_of_two_coordinates_is_resolved():
    # A load that changes its direction within 1e-3 of t = 0.3.
    system = ao.System(
        lambda q, v, a, t: a @ a / 2 - q[1] * np.tanh((t - 0.3) / 1e-3) / 2, ["x", "y"]
    )
    ends = (ao.Event(t, [t, 0], v=[0, 0]) for t in (0, 1))
    path = ao.solve(ao.Problem(system, *ends))
    assert path(0.5)[0] == pytest.approx(0.5)
    assert path.compare().agrees


def test_it_travels():
    path = between(SPLINE, (0, [0], [0]), (1, [1], [None]))
    other = pickle.loads(pickle.dumps(path))
    assert (other.path.values == path.path.values).all()
    assert other.problem.start.rates == ((0.0,),)
    assert other.morse_index == 0


def test_what_is_refused_is_told():
    first = systems.particle()
    with pytest.raises(ValueError, match="the motion decides v; leave it out"):
        ao.Problem(first, ao.Event(0, [0], v=[1]), ao.Event(1, [0]))
    with pytest.raises(ValueError, match="expected 1 values of v"):
        ao.Problem(SPLINE, ao.Event(0, [0], v=[1, 2]), ao.Event(1, [0]))
    with pytest.raises(ValueError, match="nothing is reflected"):
        ends = ao.Event(0, [0]), ao.Event(2, [0])
        ao.Problem(SPLINE, *ends, through=[ao.Bounce(lambda q, t: q[0])])
    with pytest.raises(ValueError, match="gives no derivatives"):
        ao.solve(ao.Problem(RING, ao.Event(0, [1, None], v=[0, 1]), ao.Periodic(5.0)))
    with pytest.raises(ValueError, match="put a \\* before the parameters"):
        ao.System(lambda q, v, t, m: m * v[0] ** 2, ["x"], parameters={"m": 1.0})
    with pytest.raises(ValueError, match="its arguments in this order"):
        ao.System(lambda q, a, v, t: a[0] ** 2, ["x"])
    path = between(SPLINE, (0, [0], [0]), (1, [1], [0]))
    with pytest.raises(ValueError, match="elements of degree 3 at least"):
        ao.solve(path.problem, mesh=ao.Mesh.uniform(0, 1, 4, 2))


def test_what_knows_the_first_order_alone_says_so():
    path = between(SPLINE, (0, [0], [0]), (1, [1], [0]))
    for ask in (path.opti, path.action_function, lambda: ao.integrate(SPLINE, path.start, 1.0)):
        with pytest.raises(ValueError, match="found one that contains accelerations"):
            ask()


def test_closed_spline_through_points():
    rng = np.random.default_rng(1)
    t, points = np.array([0, 0.7, 1.5, 2.6, 3]), rng.normal(size=(5, 2))
    points[-1] = points[0]
    system = ao.System(lambda q, v, a, t: (a @ a) / 2, ["x", "y"])
    gates = [ao.Event(*each) for each in zip(t[1:-1], points[1:-1], strict=True)]
    problem = ao.Problem(system, ao.Event(0, points[0]), ao.Periodic(3.0), through=gates)
    path, s = ao.solve(problem, tol=1e-11), np.linspace(0, 3, 60)
    np.testing.assert_allclose(path(s).T, CubicSpline(t, points, bc_type="periodic")(s), atol=1e-12)
    assert path.morse_index == 0


def test_closed_path_of_a_beam_that_is_driven():
    driven = ao.System(lambda q, v, a, t: a[0] ** 2 / 2 + q[0] ** 2 / 2 - q[0] * np.cos(t), ["x"])
    problem = ao.Problem(driven, ao.Event(0, [None]), ao.Periodic(2 * math.pi))
    path, t = ao.solve(problem, tol=1e-10), np.linspace(0, 2 * math.pi, 50)
    np.testing.assert_allclose(path(t)[0], np.cos(t) / 2, atol=1e-12)  # q'''' + q = cos t
    np.testing.assert_allclose(path.momenta, [[0, -0.5]] * 2, atol=1e-10)


def circle(rate):
    """Return the radius of the circle that is run through at a rate, and its energy."""
    squared = 1 - rate**2 / STIFF
    return math.sqrt(squared) / rate, rate**2 / 2 - 3 * rate**4 / (4 * STIFF)


def count_in_waves(rate, highest=4):
    """Return how many directions lower S of the circle, and how many leave it, among waves."""
    T, (radius, _) = 2 * math.pi / rate, circle(rate)
    t = np.arange(48) * T / 48
    k = rate * np.arange(1, highest + 1)[:, None]
    zero, cos, sin = np.zeros((1, 48)), np.cos(k * t), np.sin(k * t)
    slope, bend = np.concatenate([zero, -sin / k, cos / k]), np.concatenate([zero, -cos, -sin])

    def gradient(c):
        v, a = (c.reshape(2, -1) @ rows for rows in (slope, bend))
        force = STIFF * v * (np.sum(v * v, axis=0) - 1)
        found = a @ bend.T + force @ slope.T
        return found.ravel() * T / 48

    at, step = np.zeros((2, len(slope))), 1e-5
    at[0, 1] = at[1, 1 + highest] = radius * rate**2
    rows = step * np.eye(at.size)
    bent = np.array([gradient(at.ravel() + e) - gradient(at.ravel() - e) for e in rows])
    found = np.linalg.eigvalsh((bent + bent.T) / (4 * step))
    return int((found < -1e-6).sum()), int((np.abs(found) <= 1e-6).sum())


@pytest.mark.long
@pytest.mark.parametrize("rate", [1.2, 0.7])
def test_closed_path_that_may_begin_anywhere(rate):
    radius, energy = circle(rate)
    T = 2 * math.pi / rate

    def near(t):
        return 1.05 * radius * np.array([np.cos(rate * t), np.sin(rate * t)])

    problem = ao.Problem(RING, ao.Event(0, [None, None]), ao.Periodic(T))
    path, t = ao.solve(problem, guess=near, tol=1e-10), np.linspace(0, T, 41)
    middle = path(t[:-1]).mean(axis=1)
    np.testing.assert_allclose(np.hypot(*(path(t) - middle[:, None])), radius, rtol=1e-9)
    np.testing.assert_allclose(path.energy(t), energy, rtol=1e-9)
    index, nullity = count_in_waves(rate)
    assert (path.inertia.index, path.inertia.nullity) == (index, nullity)
    assert path.inertia.moves == 3  # along itself, and in two directions
    # Its period follows from the energy: S + E T bends by -dE/dT.
    known = ao.Problem(RING, ao.Event(0, [None, None]), ao.Periodic(None), energy=energy)
    free = ao.solve(known, guess=ao.Path(path.mesh, 1.002 * path.path.values), tol=1e-10)
    assert free.duration == pytest.approx(T, rel=1e-9)
    assert free.morse_index == index + (circle(rate * 0.999)[1] > energy)


@pytest.mark.long
def test_symmetries_conserve_what_they_do_in_any_order():
    events = ao.Event(0, [0, 0], v=[1, 0.3]), ao.Event(2, [1, 0.5], v=[0, 1])
    path, t = ao.solve(ao.Problem(RING, *events), tol=1e-11), np.linspace(0, 2, 7)
    found = ao.find_symmetries(RING)
    assert sorted(map(str, found)) == ["t: 1", "x: -y, y: x", "x: 1", "y: 1"]
    for symmetry in found:
        assert symmetry.conserved.drift(path) < 1e-10
    turn = ao.noether(RING, lambda q, t: [-q[1], q[0]])
    (x, y), (u, w), p = path(t), path.velocity(t), path.momentum(t)
    known = x * p[1] - y * p[0] + u * p[3] - w * p[2]
    assert path.derivatives([]).shape == (*path.derivatives(0.5).shape, 0)
    q, v, *higher = path.derivatives(t)
    np.testing.assert_allclose(turn(q, v, t, higher=higher), known, atol=1e-9)
    np.testing.assert_allclose(higher[0], path.acceleration(t), atol=1e-7)
    with pytest.raises(ValueError, match="2 higher derivatives"):
        turn(q, v, t)
    with pytest.raises(ValueError, match="expected a symmetry"):
        ao.noether(RING, lambda q, t: [q[1], q[0]])
    jerk = ao.System(lambda q, v, a, j, t: j[0] ** 2 / 2, ["x"])
    assert "x: x, t: 0.4 t" in map(str, ao.find_symmetries(jerk))  # S goes as x^2 / t^5


def bent_ring(load):
    """Return a beam on a circle in x and y, under a load, and the same in the angle alone."""
    plane = ao.System(
        lambda q, v, a, t: (a @ a) / 2 - load * (v @ v) / 2 + q[1],
        ["x", "y"],
        constraint=lambda q, t: (q @ q - 1) / 2,
    )
    angle = ao.System(
        lambda q, v, a, t: (a[0] ** 2 + v[0] ** 4) / 2 - load * v[0] ** 2 / 2 + np.sin(q[0]),
        ["theta"],
    )
    return plane, angle


def on_ring(t, theta, rate=None):
    along = [-math.sin(theta), math.cos(theta)]
    v = None if rate is None else [rate * x for x in along]
    return ao.Event(t, [math.cos(theta), math.sin(theta)], v=v)


@pytest.mark.quick("0.0-0.9")
@pytest.mark.parametrize(("load", "inner"), [(0.0, 0.9), *slow((60.0, None)), (150.0, None)])
def test_a_beam_under_a_constraint_is_the_one_of_coordinates_that_need_none(load, inner):
    plane, angle = bent_ring(load)
    gates = [] if inner is None else [(0.6, inner)]
    known = ao.solve(
        ao.Problem(
            angle, ao.Event(0, [0.1], v=[0.3]), ao.Event(1, [1.4], v=[-0.2]),
            through=[ao.Event(t, [x]) for t, x in gates],
        ),
        tol=1e-11,
    )  # fmt: skip
    ends = on_ring(0, 0.1, 0.3), on_ring(1, 1.4, -0.2)
    through = [on_ring(*gate) for gate in gates]
    path = ao.solve(
        ao.Problem(plane, *ends, through=through),
        guess=lambda t: np.array([np.cos(known(t)[0]), np.sin(known(t)[0])]),
        tol=1e-9,
    )
    t = np.array([0.0, 0.2, 0.55, 0.7, 1.0])
    (theta,), (rate,) = known(t), known.velocity(t)
    outward, along = (
        np.array([np.cos(theta), np.sin(theta)]),
        np.array([-np.sin(theta), np.cos(theta)]),
    )
    np.testing.assert_allclose(path(t), outward, atol=1e-9)
    assert path.action == pytest.approx(known.action, abs=1e-8)
    assert path.morse_index == known.morse_index
    np.testing.assert_allclose(path.energy(t), known.energy(t), rtol=1e-5, atol=1e-4)
    p = path.momentum(t)
    turned = np.sum(along * p[:2], axis=0) - rate * np.sum(outward * p[2:], axis=0)
    np.testing.assert_allclose(turned, known.momentum(t)[0], rtol=1e-5, atol=1e-4)
    _, _, a, j = known.derivatives(t)[:, 0]
    # q'''' + load q'' + (0, 1) + lam q = 0, along q.
    fourth = rate**4 - 3 * a**2 - 4 * rate * j
    held = -(fourth - load * rate**2 + outward[1])
    np.testing.assert_allclose(path.multipliers(t)[0], held, rtol=1e-4, atol=1e-2)
    assert path.compare().agrees
    if gates:
        jump = path.impulses[0, :2] @ [-math.sin(inner), math.cos(inner)]
        assert jump == pytest.approx(known.impulses[0, 0], rel=1e-5)


def test_what_leaves_a_constraint_is_refused():
    plane, _ = bent_ring(0.0)
    end = on_ring(1, 1.4)
    with pytest.raises(ValueError, match="whose v keeps the constraints"):
        ao.Problem(plane, ao.Event(0, [1, 0], v=[1, 0]), end)
    with pytest.raises(ValueError, match="whose q keeps the constraints"):
        ao.Problem(plane, on_ring(0, 0.1), end, through=[ao.Event(0.5, [1, 1])])
    with pytest.raises(ValueError, match="times and places of events where constraints"):
        ao.Problem(plane, on_ring(0, 0.1), end.at(None), energy=0)


@pytest.mark.long
def test_equations_of_motion_in_sympy():
    beam = ao.System(
        lambda q, v, a, t, *, P: a[0] ** 2 / 2 - P * v[0] ** 2 / 2 + q[0],
        ["w"],
        parameters={"P": 12.0},
    )
    written = beam.to_sympy()
    w, P = written.q[0], written.parameters["P"]
    expected = -w.diff(written.t, 4) - P * w.diff(written.t, 2) - 1  # Euler and Poisson
    assert (written.equations[0].lhs - expected).simplify() == 0


@pytest.mark.long
def test_trace_tells_where_a_beam_buckles():
    beam = ao.System(
        lambda q, v, a, t, *, P: a[0] ** 2 / 2 - P * v[0] ** 2 / 2 + v[0] ** 4 / 4,
        ["w"],
        parameters={"P": 5.0},
    )
    found = ao.trace(ao.Problem(beam, ao.Event(0, [0]), ao.Event(1, [0])), "P", 12.0)
    (mark,) = found.marks  # hinged: at pi^2
    assert (mark.kind, mark.value) == ("index", pytest.approx(math.pi**2, rel=1e-6))


def test_tables_name_derivatives_and_momenta_of_a_spline():
    ends = ao.Event(0, [0], v=[0]), ao.Event(1, [1], v=[0])
    found = _by_name(ao.solve(ao.Problem(SPLINE, *ends)), np.array([0.25]))  # 3 t^2 - 2 t^3
    assert {name: float(x[0, 0]) for name, x in found.items()} == pytest.approx(
        {"v": 1.125, "a": 3.0, "p": 12.0, "p_v": 3.0}
    )


def test_sweep_over_the_time_of_a_waypoint():
    ends = ao.Event(0, [0], v=[0]), ao.Event(1, [1], v=[0])
    problem = ao.Problem(SPLINE, *ends, through=[ao.Event(0.4, [0.2])])
    over = np.linspace(0.3, 0.5, 3)
    found = ao.sweep(problem, {("through", 0, "t"): over})
    bc = ((1, 0.0), (1, 0.0))
    splines = [CubicSpline([0, t, 1], [0, 0.2, 1], bc_type=bc) for t in over]
    known = np.array([[[-s(0, 3), s(0, 2)], [-s(1, 3), s(1, 2)]] for s in splines])
    np.testing.assert_allclose(found.momenta, known, rtol=1e-10)


@pytest.mark.parametrize("n", [1, 2])
def test_from_a_neighbour_with_other_velocities_at_its_ends(n):
    system = ao.System(
        lambda q, v, a, t: (1 + q[0] ** 2) * (a @ a) / 2 + v[0] ** 4 / 4 + np.cos(q[0] * q[-1]),
        list("xy"[:n]),
    )

    def problem(x, v):
        return ao.Problem(
            system, ao.Event(0, [0.1] * n, v=[0.3] * n), ao.Event(1, [x] * n, v=[v] * n)
        )

    neighbour = ao.solve(problem(0.4, 0.1))
    path = ao.solve(problem(0.5, 0.3), guess=neighbour)
    assert path.stats["iterations"] == {"newton": 1}  # along the tangent of the family
    assert path.action == pytest.approx(ao.solve(problem(0.5, 0.3)).action, rel=1e-12)


@pytest.mark.slow
def test_all_paths_of_a_beam_on_a_circle():
    plane, angle = bent_ring(70.0)
    known = ao.solve_all(ao.Problem(angle, ao.Event(0, [0.1], v=[0]), ao.Event(1, [1.4], v=[0])))
    found = ao.solve_all(ao.Problem(plane, on_ring(0, 0.1, 0), on_ring(1, 1.4, 0)), continuations=0)
    assert len(found) >= 2
    for path in found:  # each is one of the angle's
        nearest = min(known, key=lambda x, path=path: abs(x.action - path.action))
        assert path.action == pytest.approx(nearest.action, abs=1e-5)
        assert path.morse_index == nearest.morse_index


@pytest.mark.slow
def test_all_shapes_of_a_buckled_beam():
    # Hinged, beyond P = pi^2: the straight shape, and one to each side.
    beam = ao.System(lambda q, v, a, t: a[0] ** 2 / 2 - 15 * v[0] ** 2 / 2 + v[0] ** 4 / 4, ["w"])
    shapes = ao.solve_all(ao.Problem(beam, ao.Event(0, [0.0]), ao.Event(1, [0.0])), continuations=0)
    assert sorted(shapes.indices) == [0, 0, 1]
    left, right = (shape(0.5)[0] for shape in list(shapes)[:2])
    assert left == pytest.approx(-right, abs=1e-7)


def column(w, v0, **more):
    """Return a path of a column under the load w^2, L = (a^2 - w^2 v^2) / 2, over a time of 7."""
    system = ao.System(lambda q, v, a, t: (a[0] ** 2 - (w * v[0]) ** 2) / 2, ["x"])
    ends = ao.Event(0, [0.0], v=v0), ao.Event(7, [1.0], v=[0.0])
    return ao.solve(ao.Problem(system, *ends, **more), tol=1e-11)


def roots(function, T=7.0):
    """Return where a function changes its sign in (0.3, T)."""
    t = np.linspace(0.3, T, 5000)
    changes = np.flatnonzero(np.diff(np.sign(function(t))))
    return [brentq(function, t[k], t[k + 1], xtol=1e-14) for k in changes]


@pytest.mark.quick("v00")
@pytest.mark.parametrize("v0", [[0.3], None])
def test_conjugate_points_of_a_column(v0):
    """Neighbours are sums of 1, t, cos wt and sin wt; held or hinged where they start."""
    w = 2.0
    path = column(w, v0)
    if v0 is None:  # t and sin wt
        known = roots(lambda t: np.sin(w * t) - w * t * np.cos(w * t))
    else:
        known = roots(lambda t: 2 * (1 - np.cos(w * t)) - w * t * np.sin(w * t))
    points = ao.conjugate_points(path)
    assert [point.t for point in points] == pytest.approx(known, abs=1e-9)
    assert sum(point.multiplicity for point in points) == path.morse_index == len(known)


def test_conjugate_points_of_a_column_that_is_held_on_the_way():
    """At the time 2 neighbours vanish, with a kink in their shear force."""
    w = 2.0
    path = column(w, [0.3], through=[ao.Event(2.0, [0.4])])

    def left(t):
        """Return what is left of 1 - cos, wt - sin and, after the event, of wt' - sin wt'."""
        rows = [
            [1 - np.cos(w * t), w * np.sin(w * t)],
            [w * t - np.sin(w * t), w * (1 - np.cos(w * t))],
        ]
        s = np.maximum(t - 2.0, 0.0)
        rows.append([w * s - np.sin(w * s), w * (1 - np.cos(w * s))])
        held = [1 - np.cos(w * 2.0), w * 2.0 - np.sin(w * 2.0)]
        at = held[1] * np.array(rows[0]) - held[0] * np.array(rows[1])
        return at[0] * rows[2][1] - at[1] * rows[2][0]

    free = roots(lambda t: 2 * (1 - np.cos(w * t)) - w * t * np.sin(w * t), 2.0)
    known = free + [t for t in roots(left) if t > 2.001]
    points = ao.conjugate_points(path)
    assert [point.t for point in points] == pytest.approx(known, abs=1e-9)
    assert len(points) == path.morse_index


@pytest.mark.slow
def test_conjugate_points_of_a_beam_on_a_circle_are_those_of_its_angle():
    """L = (theta''^2 - w^2 theta'^2) / 2: a column again."""
    w = 7.0
    plane = ao.System(
        lambda q, v, a, t: (a @ a - (v @ v) ** 2 - w**2 * (v @ v)) / 2,
        ["x", "y"],
        constraint=lambda q, t: (q @ q - 1) / 2,
    )
    known = roots(lambda t: 2 * (1 - np.cos(w * t)) - w * t * np.sin(w * t), 1.0)
    turn = lambda t: np.array([np.cos(0.1 + 0.2 * t), np.sin(0.1 + 0.2 * t)])  # noqa: E731
    path = ao.solve(ao.Problem(plane, on_ring(0, 0.1, 0.3), on_ring(1, 0.3, -0.2)), guess=turn)
    points = ao.conjugate_points(path)
    assert [point.t for point in points] == pytest.approx(known, abs=1e-6)
    assert len(points) == path.morse_index == 1


def test_modes_are_those_of_a_clamped_beam():
    path = between(SPLINE, (0, [0], [0]), (2, [1], [0]))
    found = ao.second_variation(path, 3)
    other = ao.second_variation(path, 3, units=2.0)  # int |eta / 2|^2 dt = 1
    np.testing.assert_allclose(other.eigenvalues, 4 * found.eigenvalues, rtol=1e-9)
    known = roots(lambda b: np.cos(b) - 1 / np.cosh(b), 12.0)  # cos b cosh b = 1
    assert found.eigenvalues == pytest.approx((np.array(known) / 2) ** 4, rel=1e-7)
    t, weight = np.polynomial.legendre.leggauss(60)
    first, second = (mode(t + 1)[0] for mode in found.modes[:2])
    assert [first**2 @ weight, second**2 @ weight] == pytest.approx([1, 1], abs=1e-8)
    assert first * second @ weight == pytest.approx(0, abs=1e-8)
    gated = ao.solve(
        ao.Problem(SPLINE, ao.Event(0, [0]), ao.Event(2, [1]), through=[ao.Event(1, [2])])
    )
    lowest = ao.second_variation(gated, 1)  # hinged at 0, 1, 2: a whole wave
    assert lowest.eigenvalues == pytest.approx([math.pi**4], rel=1e-7)
    assert lowest.modes[0](1.0) == pytest.approx(0, abs=1e-9)


@pytest.mark.long
def test_tables_have_the_momenta_of_each_derivative():
    pytest.importorskip("pandas"), pytest.importorskip("xarray")
    path = between(SPLINE, (0, [0], [0]), (1, [1], [0]))
    t = np.array([0.0, 0.3, 1.0])
    table, found = path.to_dataframe(t), path.to_xarray(t)
    assert list(table) == ["x", "v_x", "a_x", "p_x", "p_v_x", "energy"]
    for name, known in (("v", 6 * t - 6 * t**2), ("a", 6 - 12 * t), ("p", 12), ("p_v", 6 - 12 * t)):
        np.testing.assert_allclose(table[f"{name}_x"], known + 0 * t, atol=1e-9)
        np.testing.assert_allclose(found[name][0], known + 0 * t, atol=1e-9)
    assert ao.solve(path.problem, guess=table).action == pytest.approx(6)


@pytest.mark.long
def test_derivatives_of_the_action_of_a_beam_on_a_circle():
    """S by the times and the places of its ends, against differences of S in the angle."""
    circle = ao.System(lambda q, v, a, t: a @ a / 2, ["x", "y"], constraint=lambda q, t: q @ q - 1)

    def on_circle(t, angle, speed):
        c, s = np.cos(angle), np.sin(angle)
        return ao.Event(t, [c, s], v=[-speed * s, speed * c])

    def solved(x, end=1.0):
        problem = ao.Problem(circle, on_circle(0.0, x[0], 0.3), on_circle(end, 1 + x[1], 0.5))
        return ao.solve(problem, tol=1e-10)

    h, start, end = 1e-3, np.array([1.0, 0.0]), np.array([0.0, 1.0])
    found = solved((0.0, 0.0)).sensitivity()
    by_time = (solved((0, 0), 1 + h).action - solved((0, 0), 1 - h).action) / (2 * h)
    assert found.t1 == pytest.approx(by_time, rel=1e-4)
    ends = h * (start + end), h * (start - end)
    across = sum(
        k * solved(s * x).action for k, x in zip((1, -1), ends, strict=True) for s in (1, -1)
    )
    tangent = [np.array([-np.sin(a), np.cos(a), -w * np.cos(a), -w * np.sin(a)])
               for a, w in ((0.0, 0.3), (1.0, 0.5))]  # fmt: skip
    assert tangent[0] @ found.q0q1 @ tangent[1] == pytest.approx(across / (4 * h * h), rel=1e-4)
    assert np.abs(found.q0q0).max() < 100


def test_a_beam_comes_to_lie_on_a_floor_at_one_point():
    """Clamped at both ends: beside c the load alone bends it, and y, y' are zero at c."""
    w, heights = 40.0, (0.06, 0.05)
    beam = ao.System(lambda q, v, a, x, *, w: a[0] ** 2 / 2 + w * q[0], ["y"], parameters={"w": w})
    ends = (ao.Event(x, [h], v=[0]) for x, h in zip((0, 1), heights, strict=True))
    sol = ao.solve(ao.Problem(beam, *ends, through=[ao.Event(None, [0], v=[0])]))

    def bent(h, L):
        """Return two derivatives at c of -w x^4 / 24 + A x^3 + B x^2 + h, x from the clamp."""
        rows = [[L**3, L**2], [3 * L**2, 2 * L]]
        A, B = np.linalg.solve(rows, [w * L**4 / 24 - h, w * L**3 / 6])
        return -w * L**2 / 2 + 6 * A * L + 2 * B, 6 * A - w * L

    c = brentq(lambda c: bent(heights[0], c)[0] - bent(heights[1], 1 - c)[0], 0.3, 0.7)
    force = -bent(heights[0], c)[1] - bent(heights[1], 1 - c)[1]
    assert sol.problem.through[0].t == pytest.approx(c, abs=1e-10) and sol.morse_index == 0
    assert sol.impulses[0] == pytest.approx([-force, 0], abs=1e-8)
    assert force > 0 and sol(np.linspace(0, 1, 101)).min() > -1e-9


def test_where_no_inertia_is_found_along_an_obstacle_a_beam_is_no_minimum(monkeypatch):
    def refuse(at, error):
        raise ValueError("L is not convex in the accelerations")

    monkeypatch.setattr("actionopt.analysis.quadratic.index.inertia_through", refuse)
    assert iterate._index_in_contact(None) == 1


@pytest.mark.parametrize(
    ("before", "now", "action"),
    [((0, 0), (None, None), 0), ((None, None), (0, 0), 6), ((0, 0), (0, None), 1.5)],
)
def test_a_solution_that_gives_other_velocities_is_a_guess(before, now, action):
    spline = ao.System(lambda q, v, a, t: a[0] ** 2 / 2, ["x"])

    def ask(v0, v1):
        return ao.Problem(spline, ao.Event(0, [0], v=[v0]), ao.Event(1, [1], v=[v1]))

    found = ao.solve(ask(*now), guess=ao.solve(ask(*before)))
    assert found.action == pytest.approx(action, abs=1e-12)


def test_a_coordinate_that_meets_its_own_acceleration_in_l_has_a_path_of_given_energy():
    """By parts, q a is -v^2 and what the ends tell, where these give q and v."""
    coupled, plain = (
        ao.System(law, ["x"])
        for law in (
            lambda q, v, a, t: a[0] ** 2 / 2 + 0.3 * q[0] * a[0],
            lambda q, v, a, t: a[0] ** 2 / 2 - 0.3 * v[0] ** 2,
        )
    )
    ends = ao.Event(0.0, [0.0], v=[1.0]), ao.Event(None, [1.0], v=[0.5])
    one, other = (ao.solve(ao.Problem(s, *ends, energy=-0.3)) for s in (coupled, plain))
    assert one.duration == pytest.approx(other.duration, rel=1e-6)
    assert one.action - other.action == pytest.approx(0.3 * 0.5, abs=1e-6)  # [q v]
