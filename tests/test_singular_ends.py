"""Paths from where the mass vanishes, or L is infinite: a centre, a fall from rest."""

import pickle

import numpy as np
import pytest
from helpers import a_quarter
from scipy.optimize import brentq, fsolve
from scipy.special import jn_zeros, jv

import actionopt as ao
from actionopt.analysis.motion.flow import IntegrationError
from actionopt.analysis.quadratic.second_variation import ends_hessian, form
from actionopt.mechanics.question.singular_ends import nonfinite

AREA = {3: 4 * np.pi, 4: 2 * np.pi**2}  # of the unit sphere in D dimensions


def radial(potential, D):
    def lagrangian(q, v, r):
        return AREA[D] * r ** (D - 1) * (v[0] ** 2 / 2 + potential(q[0]))

    return ao.System(lagrangian, ["phi"])


def quartic(x):
    return x**2 / 2 - x**3 / 2 + 0.1 * x**4


def helmholtz(k):
    return ao.System(lambda q, v, r: r**k * (v[0] ** 2 - q[0] ** 2) / 2, ["u"])


def gradient_part(solution, D):
    """Return the action of the gradient alone, by quadrature on the elements."""
    mesh, total = solution.mesh, 0.0
    for g in mesh.groups:
        half = mesh.lengths[g.elements][:, None] / 2
        r = mesh.nodes[g.nodes]
        v = solution.path.values[0][g.nodes] @ g.rule.derivative.T / half
        total += float(np.sum(half * g.rule.weights * AREA[D] * r ** (D - 1) * v**2 / 2))
    return total


@pytest.mark.parametrize(
    "D, S, phi0, wall",
    a_quarter(
        [(3, 94.958199565145, 2.7412091182694, 8.0), (4, 1511.88294432230, 2.8607617764052, 10.0)]
    ),
)
def test_a_bounce(D, S, phi0, wall):
    """Values that two methods share; Derrick's theorem; Coleman: one direction lowers S."""
    problem = ao.Problem(radial(quartic, D), ao.Event(0, [None]), ao.Event(25, [0]))
    bounce = ao.solve(problem, guess=lambda r: 1.4 * (1 - np.tanh((r - wall) / 1.5)), tol=1e-10)
    assert abs(bounce.action - S) < 1e-12 * S
    assert abs(bounce.start.q[0] - phi0) < 1e-9
    assert abs(2 * gradient_part(bounce, D) / D - S) < 1e-11 * S
    assert bounce.morse_index == 1 == len(ao.conjugate_points(bounce))
    assert bounce.compare().agrees


@pytest.mark.slow
def test_the_bounce_is_among_all_paths():
    problem = ao.Problem(radial(quartic, 3), ao.Event(0, [None]), ao.Event(25, [0]))
    found = ao.solve_all(problem, shots=10)
    assert any(abs(path.action - 94.958199565145) < 1e-8 for path in found)


@pytest.mark.quick("2")
@pytest.mark.parametrize("k", [1, 2, 3])
def test_focal_points_are_zeros_of_bessel_functions(k):
    """u'' + k u' / r + u = 0: J0, sin r / r and J1 / r; tables of their zeros."""
    zeros = {
        1: [2.404825557695773, 5.520078110286311],
        2: [np.pi, 2 * np.pi],
        3: [3.831705970207512, 7.015586669815619],
    }[k]
    end = ao.Event(8.0, [1.0])
    solution = ao.solve(ao.Problem(helmholtz(k), ao.Event(0, [None]), end))
    assert [p.t for p in ao.conjugate_points(solution)] == pytest.approx(zeros, abs=1e-9)
    assert solution.morse_index == 2


def test_a_motion_forward_from_the_centre():
    path = ao.integrate(helmholtz(2), ao.State(0, [2.0], [0.0]), 20.0)
    r = np.linspace(0.01, 20, 77)
    assert np.abs(path(r)[0] - 2 * np.sin(r) / r).max() < 1e-11
    assert path(0.0)[0] == 2.0
    assert abs(path.velocity(0.0)[0]) < 1e-11
    before = ao.integrate(helmholtz(2), ao.State(0, [2.0], [0.0]), -20.0)
    assert np.abs(before(-r) - path(r)).max() < 1e-11


def test_two_coupled_fields_from_the_centre():
    """A rotation of u = sin r / r and w = sin(2 r) / r."""

    def lagrangian(q, v, r):
        a, b = 0.6 * q[0] + 0.8 * q[1], -0.8 * q[0] + 0.6 * q[1]
        return r**2 * (v @ v - a**2 - 4 * b**2) / 2

    path = ao.integrate(ao.System(lagrangian, ["x", "y"]), ao.State(0, [0.6, 0.8], [0, 0]), 9.0)
    r = np.linspace(0.1, 9, 33)
    assert np.abs(path(r) - np.array([[0.6], [0.8]]) * np.sin(r) / r).max() < 1e-11


def test_what_does_not_begin_at_the_centre():
    with pytest.raises(ValueError, match="the equations of motion decide it"):
        ao.integrate(helmholtz(2), ao.State(0, [2.0], [1.0]), 1.0)
    steep = ao.System(lambda q, v, r: r**2 * (v[0] ** 2 / 2 - abs(r - 1e-9) * q[0]), ["u"])
    assert ao.integrate(steep, ao.State(0, [1.0], [0.0]), 1.0) is not None
    with pytest.raises(IntegrationError, match="singular point"):
        rough = ao.System(lambda q, v, r: r**2 * v[0] ** 2 / 2 - np.sqrt(r) * q[0], ["u"])
        ao.integrate(rough, ao.State(0, [1.0], [0.0]), 1.0)


def test_a_bounce_that_comes_to_rest_as_a_power_of_the_radius():
    """phi = (r^2 + 1)^-3 in four dimensions, S = 3 pi^2 / 35, a core in three hundred of its sizes.

    The generalized Fubini potential of n = 3 (Athron et al., *Comput. Phys. Commun.* 244, 2019).
    """
    potential = lambda x: 72 / 7 * x ** (7 / 3) - 18 * x ** (8 / 3)  # noqa: E731
    profile = lambda r: (r**2 + 1.0) ** -3  # noqa: E731
    decay = ao.Problem(radial(potential, 4), ao.Event(0.0, [None]), ao.Event(300.0, [0.0]))
    bounce = ao.solve(decay, guess=lambda r: [1.05 * profile(r)])
    assert abs(bounce.action - 3 * np.pi**2 / 35) < 1e-11
    assert abs(bounce.start.q[0] - 1) < 1e-9
    assert bounce.morse_index == 1
    with pytest.raises(ValueError, match="a late finite time"):
        ao.solve(decay.replace(end=ao.Event(np.inf, [0.0])), guess=bounce)


# -- where L is infinite at an end, and not along the path ---------------------------------------


BRACHISTOCHRONE = ao.System(lambda q, v, t: (v[0] ** 2 + v[1] ** 2) / (4 * q[1]), ["x", "depth"])
REST = ao.Event(0, [0, 0])


def roll(x, depth):
    """Return the radius and the angle of the wheel that draws a cycloid from a cusp to a point."""
    angle = brentq(lambda u: (u - np.sin(u)) * depth - (1 - np.cos(u)) * x, 1e-3, 2 * np.pi - 1e-3)
    return depth / (1 - np.cos(angle)), angle


def radial_equation(k):
    """Return Schroedinger's equation of hydrogen for angular momentum k, in atomic units."""
    return ao.System(
        lambda q, v, r: v[0] ** 2 / 2 + k * (k + 1) / 2 * (q[0] / r) ** 2 - q[0] ** 2 / r,
        ["u"],
        integral=lambda q, v, r: q[0] ** 2,
    )


@pytest.mark.quick("1e-10-1.0-0.7")
@pytest.mark.parametrize("x, depth", [(1.0, 0.7), (2.0, 0.4)])
@pytest.mark.parametrize("tol", [1e-6, 1e-10])
def test_a_fall_from_rest_is_a_cycloid(x, depth, tol):
    R, angle = roll(x, depth)
    fall = ao.solve(ao.Problem(BRACHISTOCHRONE, REST, ao.Event(1, [x, depth])), tol=tol)
    u = angle * np.linspace(0, 1, 41)
    exact = R * np.array([u - np.sin(u), 1 - np.cos(u)])
    assert np.abs(fall(u / angle) - exact).max() < tol * max(x, depth)
    assert abs(fall.action - R * angle**2 / 2) < 10 * tol
    assert fall.morse_index == 0 and np.abs(fall.velocity(0.0)).max() < 1e-9
    assert fall.compare().agrees


@pytest.mark.parametrize("x, depth", [(2.63, 0.27), (8.1, 0.44)])
def test_a_fall_that_rises_again(x, depth):
    """It is far from the line to its end, and S is lower beyond y = 0 than anywhere above."""
    R, angle = roll(x, depth)
    fall = ao.solve(ao.Problem(BRACHISTOCHRONE, REST, ao.Event(1, [x, depth])), tol=1e-9)
    assert abs(fall.action - R * angle**2 / 2) < 1e-11 * x and fall.morse_index == 0
    start = 0.001
    low = ao.Problem(BRACHISTOCHRONE, ao.Event(0, [0, start]), ao.Event(1, [x, depth]))
    assert ao.solve(low, tol=1e-9).action < fall.action


def test_a_fall_that_rises_again_in_a_field_that_weakens():
    """By Snell's law, sin^2 phi = U / U_m: T = int sqrt(2 U_m) / U' dphi of U = y / (1 + y)."""
    Um, last = 0.5, 2.6
    phi, w = np.polynomial.legendre.leggauss(60)
    phi, w = last * (1 + phi) / 2, last * w / 2
    slope = lambda phi: (1 - Um * np.sin(phi) ** 2) ** 2  # noqa: E731
    end = w @ (2 * Um * np.sin(phi) ** 2 / slope(phi)), 1 / np.sqrt(slope(last)) - 1
    T = w @ (np.sqrt(2 * Um) / slope(phi))
    light = ao.System(lambda q, v, t: (v @ v) * (1 + q[1]) / (4 * q[1]), ["x", "depth"])
    for ends in (REST, ao.Event(1, end)), (ao.Event(0, end), ao.Event(1, [0, 0])):
        assert abs(ao.solve(ao.Problem(light, *ends), tol=1e-9).action - T**2 / 2) < 1e-11


@pytest.mark.long
def test_a_fall_that_is_run_backwards_is_the_same():
    R, angle = roll(1.0, 0.7)
    up = ao.solve(ao.Problem(BRACHISTOCHRONE, ao.Event(0, [1, 0.7]), ao.Event(1, [0, 0])), tol=1e-9)
    assert abs(up.action - R * angle**2 / 2) < 1e-12 and up.morse_index == 0


def test_a_fall_to_a_wall_meets_it_at_right_angles():
    end = ao.Event(1, [None, None], on=lambda q, t: q[0] - 1)
    fall = ao.solve(ao.Problem(BRACHISTOCHRONE, REST, end), tol=1e-10)
    assert abs(fall.action - np.pi / 2) < 1e-12 and fall.morse_index == 0
    assert np.abs(fall.end.q - [1, 2 / np.pi]).max() < 1e-10


@pytest.mark.long
def test_there_is_no_other_fall_to_a_wall():
    end = ao.Event(1, [None, None], on=lambda q, t: q[0] - 1)
    (found,) = ao.solve_all(ao.Problem(BRACHISTOCHRONE, REST, end), starts=1)
    assert abs(found.action - np.pi / 2) < 1e-8


def test_a_fall_through_a_point_is_two_cycloids():
    """The times of both legs are as their optical lengths, sqrt(2 S) each, whose sum is least."""
    gate, end = (0.5, 0.6), (1.7, 0.3)
    fall = ao.solve(
        ao.Problem(BRACHISTOCHRONE, REST, ao.Event(1, end), through=[ao.Event(None, gate)]),
        tol=1e-10,
    )
    R, angle = roll(*gate)

    def places(p):  # of a cycloid x0 + R (u - sin u), R (1 - cos u), from u0 to u1
        x0, r, u0, u1 = p
        return [
            x0 + r * (u0 - np.sin(u0)) - gate[0],
            r * (1 - np.cos(u0)) - gate[1],
            x0 + r * (u1 - np.sin(u1)) - end[0],
            r * (1 - np.cos(u1)) - end[1],
        ]

    _, r, u0, u1 = fsolve(places, [0.0, 0.4, 2.0, 5.0], xtol=1e-14)
    both = np.sqrt(R) * angle + np.sqrt(r) * (u1 - u0)
    assert abs(fall.action - both**2 / 2) < 1e-10
    assert np.abs(fall.legs[0](0.0)).max() < 1e-15


@pytest.mark.long
@pytest.mark.parametrize("n", [1, 2])
def test_an_atom_begins_where_its_potential_is_infinite(n):
    """Griffiths, *Quantum Mechanics*, 4.2: 2 r exp(-r), and r (1 - r / 2) exp(-r / 2) / sqrt 2."""
    exact = [
        lambda r: 2 * r * np.exp(-r),
        lambda r: r * (1 - r / 2) * np.exp(-r / 2) / np.sqrt(2),
    ][n - 1]
    problem = ao.Problem(radial_equation(0), ao.Event(0, [0]), ao.Event(60, [0]), integral=1.0)
    state = ao.solve(problem, guess=lambda r: exact(1.02 * r)[None], tol=1e-10)
    assert abs(state.action + 1 / (2 * n**2)) < 1e-12 and state.morse_index == n - 1
    r = np.linspace(0, 40, 200)  # at 60, where it is to vanish, the second has still 1e-10
    assert np.abs(np.abs(state(r)[0]) - np.abs(exact(r))).max() < 1e-10
    assert abs(abs(state.velocity(0.0)[0]) - [2, np.sqrt(0.5)][n - 1]) < 1e-9


def test_where_inertia_vanishes_and_a_force_is_infinite():
    """Bessel's equation: (t q')' = q / t - t q, q = J_1."""
    system = ao.System(lambda q, v, t: t * (v[0] ** 2 - q[0] ** 2) / 2 + q[0] ** 2 / (2 * t), ["q"])
    found = ao.solve(ao.Problem(system, ao.Event(0, [0]), ao.Event(1.5, [jv(1, 1.5)])), tol=1e-10)
    t = np.linspace(0, 1.5, 30)
    assert np.abs(found(t)[0] - jv(1, t)).max() < 1e-11


@pytest.mark.long
def test_conjugate_points_of_paths_from_singular_ends():
    """u'' = -2 u / r, u = sqrt(r) J_1(sqrt(8 r)); infinite inertia has none, and a sentence."""
    radial = ao.System(lambda q, v, r: v[0] ** 2 / 2 - q[0] ** 2 / r, ["u"])
    found = ao.solve(ao.Problem(radial, ao.Event(0, [0]), ao.Event(9, [1])))
    times = [point.t for point in ao.conjugate_points(found)]
    assert times == pytest.approx(jn_zeros(1, 2) ** 2 / 8, rel=1e-6)
    fall = ao.System(lambda q, v, t: v[0] ** 2 / q[0] / 2 - q[0] / 2, ["y"])
    with pytest.raises(ValueError, match="expected a path whose inertia is finite at its ends"):
        ao.conjugate_points(ao.solve(ao.Problem(fall, ao.Event(0, [0]), ao.Event(1, [1]))))


def test_derivatives_at_a_singular_end_are_nan_where_there_are_none():
    """S of a fall is R u^2 / 2; it does not change where both ends are moved along x."""

    def action(x, y):
        R, angle = roll(x, y)
        return R * angle**2 / 2

    fall = ao.solve(ao.Problem(BRACHISTOCHRONE, REST, ao.Event(1, [1, 0.7])), tol=1e-10)
    h, found = 1e-4, fall.sensitivity()
    p = (action(1 + h, 0.7) - action(1 - h, 0.7)) / (2 * h)
    S_xx = (action(1 + h, 0.7) - 2 * action(1, 0.7) + action(1 - h, 0.7)) / h**2
    assert fall.momenta[0][0] == pytest.approx(p, rel=1e-7) and np.isnan(fall.momenta[0][1])
    assert fall.momenta[1] == pytest.approx(found.q1) and np.isfinite(found.q1q1).all()
    assert found.q0q0[0, 0] == pytest.approx(S_xx, rel=1e-6)
    assert found.q0q0[0, 0] == pytest.approx(found.q1q1[0, 0], rel=1e-10)  # moved as one
    assert found.q0q1[0] == pytest.approx(-found.q1q1[0], rel=1e-6)
    assert np.isnan(found.q0q0[1]).all() and np.isnan(found.q0q1[1]).all()
    back = ao.solve(
        ao.Problem(BRACHISTOCHRONE, ao.Event(0, [1, 0.7]), ao.Event(1, [0, 0])), tol=1e-10
    )
    returned = back.sensitivity()
    assert returned.q1q1[0, 0] == pytest.approx(found.q1q1[0, 0], rel=1e-10)
    assert returned.q0q0 == pytest.approx(found.q1q1, rel=1e-10)
    atom = ao.System(lambda q, v, r: v[0] ** 2 / 2 - q[0] ** 2 / r, ["u"])
    radial = ao.solve(ao.Problem(atom, ao.Event(0, [0]), ao.Event(3, [1])))
    assert radial.momenta[0] == pytest.approx(radial.velocity(0.0), rel=1e-6)
    assert np.isnan(radial.sensitivity().q0q0).all()


def test_a_sweep_of_falls():
    x = np.linspace(0.3, 2.0, 4)
    falls = ao.Problem(BRACHISTOCHRONE, REST, ao.Event(1, [1, 0.7]))
    runs = ao.sweep(falls, {("end", "x"): x})
    wheels = np.array([roll(k, 0.7) for k in x])
    assert abs(runs.solution(2).action - runs.action[2]) < 1e-9
    assert np.abs(runs.action - wheels[:, 0] * wheels[:, 1] ** 2 / 2).max() < 1e-9


@pytest.mark.long
def test_a_path_from_a_singular_place_is_kept_in_files(tmp_path):
    fall = ao.solve(ao.Problem(BRACHISTOCHRONE, REST, ao.Event(1, [1, 0.7])))
    fall.save(tmp_path / "fall.npz")
    again = ao.load(tmp_path / "fall.npz", BRACHISTOCHRONE)
    t = np.linspace(0, 1, 23)
    assert (again(t) == fall(t)).all() and again.mesh.singular_ends == fall.mesh.singular_ends
    assert (pickle.loads(pickle.dumps(fall))(t) == fall(t)).all()


def test_a_lagrangian_is_asked_at_velocities_below_its_limit_too():
    light = ao.System(lambda q, v, t: -np.sqrt(1 - v[0] ** 2), ["x"])
    problem = ao.Problem(light, ao.Event(0.0, [0.0]), ao.Event(1.0, [0.5]))
    assert not nonfinite(problem, np.zeros(1), 0.0, np.array([3.0]))


@pytest.mark.quick("False-0.0015-1.0", "True-0.05-2.4", "False--0.95-2.4", "True--0.9-1.7")
@pytest.mark.parametrize(
    ("power", "T"), [(0.0015, 1.0), (0.05, 2.4), (-0.1, 1.7), (-0.9, 1.7), (-0.95, 2.4)]
)
@pytest.mark.parametrize("back", [False, True])
def test_derivatives_where_inertia_vanishes_slowly_or_is_infinite(power, T, back):
    """S = (1 - a) (q1 - q0)^2 / (2 T^(1 - a)) of L = t^a v^2 / 2, and of the motion run back."""
    system = ao.System(lambda q, v, t: (T - t if back else t) ** power * v[0] ** 2 / 2, ["x"])
    path = ao.solve(ao.Problem(system, ao.Event(0, [0.3]), ao.Event(T, [-0.4])))
    found, exact = path.sensitivity(), (1 - power) / T ** (1 - power)
    for value in (found.q0q0, -found.q0q1, found.q1q1):
        assert value[0, 0] == pytest.approx(exact, rel=1e-10)
    assert np.array(path.momenta) == pytest.approx(-0.7 * exact, rel=1e-9)


def boundary_layers(k):
    """Return the path from 1 to 1 / 2 in a unit of time of L = (v^2 + k^2 q^2) / 2."""
    system = ao.System(lambda q, v, t: (v[0] ** 2 + k**2 * q[0] ** 2) / 2, ["x"])
    return ao.solve(ao.Problem(system, ao.Event(0, [1.0]), ao.Event(1, [0.5])))


def test_ends_along_lines_would_cancel_beside_boundary_layers_of_a_millionth():
    """S_00 = k coth(k T), and S_01 = -k / sinh(k T) vanishes."""
    k = 1e7
    path = boundary_layers(k)
    found = ends_hessian(form(path.discrete))
    assert found == pytest.approx(k * np.eye(2), rel=1e-12, abs=1e-60)
    assert np.ravel(path.momenta) == pytest.approx([-k, k / 2], rel=1e-13)


@pytest.mark.long
def test_second_derivatives_beside_boundary_layers_of_a_millionth():
    """S_00 = k coth(k T); Jacobi fields that grow so fast are resolved by many elements."""
    k = 1e7
    found = boundary_layers(k).sensitivity()
    assert found.q0q0[0, 0] == pytest.approx(k, rel=1e-12)
    assert found.q1q1[0, 0] == pytest.approx(k, rel=1e-12)
