"""Forces rougher than the path: seen by another quadrature, and refined for. Traps of symmetry."""

import math

import casadi as ca
import numpy as np
import pytest
from helpers import a_quarter
from scipy.integrate import solve_ivp
from scipy.special import jv

import actionopt as ao
from actionopt.discrete.action.second_quadrature import departure
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.tools.lobatto import lgl


def line(lagrangian, start, end, T=1.0):
    return ao.Problem(ao.System(lagrangian, ["x"]), ao.Event(0.0, [start]), ao.Event(T, [end]))


def relative(solution, exact, count=2001):
    t = np.linspace(solution.problem.start.t, solution.problem.end.t, count)
    return np.max(np.abs(solution(t)[0] - exact(t))) / np.max(np.abs(exact(t)))


@pytest.mark.parametrize("degree", [1, 4, 9, 24])
def test_other_points_integrate_the_same_polynomials(degree):
    rule = lgl(degree)
    rng = np.random.default_rng(degree)
    values = rng.normal(size=degree + 1)
    # int q phi_j and int q' phi_j for all j, by Gauss's rule with points enough.
    x, w = np.polynomial.legendre.leggauss(degree + 2)
    phi = rule.interpolation(x)
    other = rule.other
    assert np.allclose(other.values @ values, rule.interpolation(other.nodes) @ values, atol=1e-13)
    exact = phi.T @ (w * (phi @ rule.derivative @ values))
    assert np.allclose(other.weighted_values @ (other.slopes @ values), exact, atol=1e-11)
    exact = (phi @ rule.derivative).T @ (w * (phi @ values))
    assert np.allclose(other.weighted_slopes @ (other.values @ values), exact, atol=1e-11)
    assert other.nodes.size > rule.nodes.size


@pytest.mark.quick("124.0-0.01", "124.0-1e-06", "124.0-1e-09")
@pytest.mark.parametrize("tol", [1e-2, 1e-4, 1e-6, 1e-9])
@pytest.mark.parametrize("w", a_quarter([124.0, 61.0, 284.0, 300.0]))
def test_a_fast_force_is_not_mistaken_for_a_slow_one(w, tol):
    exact = lambda t: t - np.cos(w * t)  # noqa: E731
    problem = line(
        lambda q, v, t: v[0] ** 2 / 2 + w**2 * np.cos(w * t) * q[0], exact(0.0), exact(1.0)
    )
    assert relative(ao.solve(problem, tol=tol), exact) <= tol


@pytest.mark.long
def test_a_wall_across_a_rail_is_seen_as_without_the_rail():
    """On the line y = 2 x the inertia is five times that of x."""
    wall = lambda x: 10 * x - 0.1 * np.tanh((x - 0.3) / 0.01)  # noqa: E731
    rail = ao.System(
        lambda q, v, t: v @ v / 2 + wall(q[0]), ["x", "y"], constraint=lambda q, t: q[1] - 2 * q[0]
    )
    ends = (ao.Event(t, [t, 2 * t]) for t in (0.0, 1.0))
    alone = line(lambda q, v, t: 5 * v[0] ** 2 / 2 + wall(q[0]), 0.0, 1.0)
    one, other = (ao.solve(p, tol=1e-8) for p in (ao.Problem(rail, *ends), alone))
    assert relative(one, lambda t: other(t)[0]) <= 2e-8


def test_a_jump_at_a_boundary_of_elements_is_seen():
    problem = line(lambda q, v, t: v[0] ** 2 / 2 + q[0] * ca.if_else(t > 1, 1, 0), 0.0, 1.5, T=2.0)
    solution = ao.solve(problem, tol=1e-6)
    exact = lambda t: t / 2 + np.where(t < 1, 0.0, (t - 1) ** 2 / 2)  # noqa: E731
    assert relative(solution, exact) <= min(1e-6, solution.error)


@pytest.mark.quick("10.0-50.0-0.0001", "10.0-50.0-1e-08")
@pytest.mark.parametrize("tol", [1e-4, 1e-8])
@pytest.mark.parametrize(("c", "w"), [(10.0, 50.0), (100.0, 300.0)])
def test_a_total_time_derivative_changes_nothing(c, w, tol):
    problem = line(  # d/dt (c q sin(w t)) beside an oscillator
        lambda q, v, t: (
            (v[0] ** 2 - q[0] ** 2) / 2 + c * (v[0] * np.sin(w * t) + w * q[0] * np.cos(w * t))
        ),
        1.0,
        0.3,
        T=2.0,
    )
    b = (0.3 - np.cos(2.0)) / np.sin(2.0)
    assert relative(ao.solve(problem, tol=tol), lambda t: np.cos(t) + b * np.sin(t)) <= tol


def test_nothing_is_evaluated_where_nothing_can_be_missed(monkeypatch):
    """Linear equations with constant coefficients have forces as smooth as the path."""
    asked = []
    missed = Transcription.quadrature_defect

    def counted(tr, z, **options):
        asked.append(1)
        return missed(tr, z, **options)

    monkeypatch.setattr(Transcription, "quadrature_defect", counted)
    ao.solve(line(lambda q, v, t: (v[0] ** 2 - q[0] ** 2) / 2, 1.0, 0.3))
    assert not asked
    ao.solve(line(lambda q, v, t: (v[0] ** 2 - q[0] ** 2 * (1 + 1e-9 * t)) / 2, 1.0, 0.3))
    assert asked


def test_what_is_missed_is_that_of_the_elements():
    w = 80.0

    def pushed(push, mesh):
        def lagrangian(q, v, t):
            return v[0] ** 2 / 2 + push * np.exp(-((w * (t - 0.6)) ** 2)) * q[0]

        problem = line(lagrangian, 0.0, 1.0)
        tr = Transcription(problem, mesh, problem.scales)
        return tr, tr.pack(tr.straight())

    tr, z = pushed(1.0, Mesh.uniform(0.0, 1.0, 5, 6))
    assert np.max(np.abs(tr.quadrature_defect(z)[0])) > 1e-3
    shares = tr.uneven(z)  # the pulse is between the third and the fourth element
    assert np.min(shares[2:4]) > 1e3 * np.max(np.abs(shares[[0, 1, 4]]))
    assert shares[2] == pytest.approx(shares[3], rel=1e-6)  # and symmetric about the node
    other, z = pushed(-1.0, tr.mesh)
    assert other.uneven(z) == pytest.approx(shares, rel=1e-9, abs=1e-15)
    fine, z = pushed(1.0, Mesh.uniform(0.0, 1.0, 200, 6))
    assert np.max(np.abs(fine.quadrature_defect(z)[0])) < 1e-9


@pytest.mark.parametrize("push", [1.0, -1.0])
@pytest.mark.parametrize("what", ["force", "momentum"])
def test_elements_are_cut_around_what_hides_in_them(push, what):
    """A pulse of a two-thousandth between two nodes, in the force or as a vector potential."""
    c, w = 0.643, 1 / 2000

    def lagrangian(q, v, t):
        pulse = push * np.exp(-(((t - c) / w) ** 2))
        return v[0] ** 2 / 2 + pulse * (50 * q[0] if what == "force" else v[0])

    problem = line(lagrangian, 0.0, 1.0)
    tr = Transcription(problem, Mesh.uniform(0.0, 1.0, 5, 6), problem.scales)
    found = tr.cuts(tr.pack(tr.straight()))
    assert [part.size > 0 for part in found] == [False, False, False, True, False]
    inner = found[3]
    assert inner.min() < c < inner.max()
    assert np.ptp(inner) <= 30 * w  # of an element of 400 w
    assert np.all((inner > 0.6) & (inner < 0.8))


# -- lines that symmetry makes a trap -------------------------------------------------------------


def test_under_a_constraint_a_motion_is_followed_along_it():
    """A bead on a circle is kicked within an element: it gains J / m along the wire alone."""
    rule, half, m, rate, kick, width = lgl(6).dense(48), 0.1, 2.0, 0.5, 0.3, 3e-3
    t = half * rule.nodes
    along = np.stack([-np.sin(rate * t), np.cos(rate * t)], axis=-1)[None]
    across = np.stack([np.cos(rate * t), np.sin(rate * t)], axis=-1)[None]
    pulse = kick / (width * np.sqrt(np.pi)) * np.exp(-((t / width) ** 2))[None, :, None]
    force = pulse * (along + 3 * across) - m * rate**2 * across
    tangent = along[..., None] * along[..., None, :]
    inverse = np.eye(2)[None] / m
    q, v = departure(rule, np.array([[[half]]]), force, m * rate * along, inverse, tangent)
    gained = kick / m * np.array([math.erf(x) for x in t / width]) / 2
    turn = rate * half
    assert np.sum(v * along, axis=2)[0] == pytest.approx(gained, abs=turn**2 * kick / m)
    assert np.abs(np.sum(v * across, axis=2)).max() < turn * kick / m
    assert np.abs(np.sum(q * along, axis=2)[0, [0, -1]]).max() < 1e-4


ALONE = {
    "oscillating": (lambda t: np.cos(300 * t), math.sin(300) / 300),
    "narrow": (lambda t: 1 / (1 + 1e4 * (t - 0.45) ** 2), (math.atan(55) + math.atan(45)) / 100),
}


@pytest.mark.parametrize("name", ALONE)
def test_terms_of_the_time_alone_count_in_the_action(name):
    """No equation tells of them: S of a free fall, 47/24, and their integral."""
    f, integral = ALONE[name]
    solution = ao.solve(line(lambda q, v, t: v @ v / 2 + f(t) + q[0], 1.0, 2.0), tol=1e-9)
    assert solution.action == pytest.approx(47 / 24 + integral, rel=1e-9)


def test_terms_of_the_time_alone_count_in_the_actions_of_a_family():
    def lagrangian(q, v, t, *, w):
        return v @ v / 2 + np.cos(w * t) / 2 + q[0]

    system = ao.System(lagrangian, ["x"], parameters={"w": 1.0})
    problem = ao.Problem(system, ao.Event(0.0, [1.0]), ao.Event(1.0, [2.0]))
    speeds = np.array([1.0, 50.0, 300.0])
    found = ao.sweep(problem, {"w": speeds}, tol=1e-9)
    np.testing.assert_allclose(found.action, 47 / 24 + np.sin(speeds) / (2 * speeds), rtol=1e-9)


@pytest.mark.long
def test_a_term_of_the_time_alone_whose_integral_is_infinite_is_not_solved():
    fall = line(lambda q, v, t: v @ v / 2 + 1 / (t - 0.45) ** 2 + q[0], 1.0, 2.0)
    assert not ao.solve(fall, throw=False).success


def test_terms_of_the_time_alone_are_told_from_others():
    t_alone = [
        lambda q, v, t, *, w: v @ v / 2 + np.cos(w * t),
        lambda q, v, t, *, w: 2 * (v @ v - (t**2 - q[0]) / w),
    ]
    none = [
        lambda q, v, t, *, w: v @ v / 2 + np.cos(w * t + q[0]),
        lambda q, v, t, *, w: (v @ v / 2 + w - q[0]) * np.exp(-t),
    ]
    for expected, group in ((True, t_alone), (False, none)):
        for lagrangian in group:
            system = ao.System(lagrangian, ["x"], parameters={"w": 1.0})
            assert system.structure.adds_time is expected


@pytest.mark.long
@pytest.mark.parametrize("tol", [1e-6, 1e-8])
def test_what_is_light_beside_a_heavy_part_of_the_path_keeps_its_digits(tol):
    """(t^7 q')' + t^7 q = 0: J3(t) / t^3, whose inertia is 1e-20 of the largest near t = 0."""
    law = ao.System(lambda q, v, t: t**7 * (v[0] ** 2 - q[0] ** 2) / 2, ["q"])
    found = ao.solve(ao.Problem(law, ao.Event(0, [None]), ao.Event(1, [1])), tol=tol)
    t = np.linspace(0.1, 1, 10)
    assert np.abs(found(t)[0] - jv(3, t) / t**3 / jv(3, 1)).max() < tol
    assert found(0.0)[0] == pytest.approx(1 / 48 / jv(3, 1), abs=tol)


@pytest.mark.long
def test_elements_are_cut_along_which_the_inertia_varies():
    """q'' + 200 q' + q = 0, whose inertia varies by e^200."""
    found = ao.solve(line(lambda q, v, t: np.exp(200 * t) * (v @ v - q @ q) / 2, 0.0, 1.0))
    rate = np.sqrt(200**2 - 4)
    slow, fast = -2 / (200 + rate), -(200 + rate) / 2

    def exact(t):
        return (np.exp(slow * t) - np.exp(fast * t)) / (np.exp(slow) - np.exp(fast))

    assert relative(found, exact) < 1e-8


@pytest.mark.long
def test_elements_are_cut_along_which_the_inertia_falls():
    """q'' - 150 q' + q = 0, where the path is lost on the mesh of the rising one."""
    found = ao.solve(line(lambda q, v, t: np.exp(-150 * t) * (v @ v - q @ q) / 2, 2.0, 1.0))
    rate = np.sqrt(150**2 - 4)
    slow, fast = 2 / (150 + rate), (150 + rate) / 2
    a, b = np.linalg.solve([[1.0, np.exp(-fast)], [np.exp(slow), 1.0]], [2.0, 1.0])
    assert relative(found, lambda t: a * np.exp(slow * t) + b * np.exp(fast * (t - 1))) < 1e-8


@pytest.mark.long
def test_elements_beside_one_that_begins_without_inertia_are_cut():
    """q'' + (2 / t + 200) q' + q = 0, regular at t = 0, where elements of one degree begin."""
    law = ao.System(lambda q, v, t: t**2 * np.exp(200 * t) * (v[0] ** 2 - q[0] ** 2) / 2, ["q"])
    found = ao.solve(ao.Problem(law, ao.Event(0, [None]), ao.Event(1, [1])))

    def rates(t, y):
        return [y[1], -(2 / t + 200) * y[1] - y[0]]

    span, given = (1e-9, 1), {"method": "Radau", "rtol": 1e-10, "atol": 1e-13}
    t = np.linspace(0.01, 1, 20)
    exact = solve_ivp(rates, span, [1.0, -1e-9 / 3], t_eval=t, **given).y[0]
    assert np.abs(found(t)[0] - exact / exact[-1]).max() < 1e-8
