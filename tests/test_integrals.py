"""Paths along which the values of integrals are given: ropes, areas, eigenvalues."""

# scipy's roots and **given have no types that say what they are here.
# pyright: reportOperatorIssue=false, reportArgumentType=false, reportAssignmentType=false
from __future__ import annotations

import math
import pickle
import re
from fractions import Fraction

import numpy as np
import pytest
import systems
from helpers import at_once
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq, fsolve
from scipy.special import ellipe, ellipk, mathieu_a, mathieu_b

import actionopt as ao
from actionopt.mechanics.question.consistency import check_integrals
from actionopt.mechanics.question.course import check_free
from actionopt.solver.search.waves import first_waves
from actionopt.tools.types import EPS

STRAIGHT = systems.particle(integral=lambda q, v, t: q[0])
ROPE = ao.System(
    lambda q, v, t: q[0] * np.sqrt(1 + v[0] ** 2),
    ["y"],
    integral=lambda q, v, t: np.sqrt(1 + v[0] ** 2),
)


def states():
    """A bound particle: stationary int (y'^2 + x^2 y^2) / 2 at int y^2 = 1, S = k + 1/2."""
    system = ao.System(
        lambda q, v, t: (v[0] ** 2 + t**2 * q[0] ** 2) / 2,
        ["y"],
        integral=lambda q, v, t: q[0] ** 2,
    )
    return ao.Problem(system, ao.Event(-8, [0]), ao.Event(8, [0]), integral=1)


@pytest.mark.quick("3.0")
@pytest.mark.parametrize("length", [2.1, 3.0, 6.0])
def test_a_rope_hangs_as_a_catenary(length):
    problem = ao.Problem(ROPE, ao.Event(0, [0]), ao.Event(2, [0]), integral=length)
    found = ao.solve(problem, tol=1e-10)
    a = brentq(lambda a: 2 * a * np.sinh(1 / a) - length, 0.1, 10)
    t = np.linspace(0, 2, 50)
    assert found(t)[0] == pytest.approx(a * (np.cosh((t - 1) / a) - np.cosh(1 / a)), abs=1e-9)
    assert found.integral_multipliers == pytest.approx([a * np.cosh(1 / a)], abs=1e-9)
    known = quad(lambda s: a * (np.cosh(s / a) - np.cosh(1 / a)) * np.cosh(s / a), -1, 1)[0]
    assert found.action == pytest.approx(known, abs=1e-9)
    assert found.morse_index == 0
    assert found.compare().agrees


@pytest.mark.long
@pytest.mark.parametrize("volume", [2.6, 3.0])
def test_a_soap_film_between_unequal_rings(volume):
    """Its volume is near that of a cone: the path near the straight line is found."""
    film = ao.System(
        lambda q, v, t: 2 * np.pi * q[0] * np.sqrt(1 + v[0] ** 2),
        ["r"],
        integral=lambda q, v, t: np.pi * q[0] ** 2,
    )
    question = ao.Problem(film, ao.Event(0, [1.0]), ao.Event(1.2, [0.7]), integral=volume)

    def rates(t, state, kappa):  # radius, slope, volume, area
        r, v = state[:2]
        w = np.sqrt(1 + v**2)
        return v, w**2 / r + kappa * w**3, np.pi * r**2, 2 * np.pi * r * w

    def at_end(v, kappa):
        start = [1.0, v, 0.0, 0.0]
        return solve_ivp(rates, (0, 1.2), start, args=(kappa,), rtol=1e-12, atol=1e-12).y[:, -1]

    slope, kappa = fsolve(lambda x: at_end(*x)[[0, 2]] - [0.7, volume], [0.0, -1.2], xtol=1e-13)
    found = ao.solve(question, tol=1e-10)
    assert found.action == pytest.approx(at_end(slope, kappa)[3], abs=1e-9)
    assert found.integral_multipliers == pytest.approx([kappa], abs=1e-9)
    assert found.morse_index == 0


def test_dido_ends_at_right_angles_to_the_shore():
    """The largest area between a line and a string: as S = length^2 / 2 at the area one."""
    string = systems.particle("x y", integral=lambda q, v, t: (q[1] * v[0] - q[0] * v[1]) / 2)
    shore = ao.Event(1, None, on=lambda q, t: q[1])
    found = ao.solve(ao.Problem(string, ao.Event(0, [0, 0]), shore, integral=1.0), tol=1e-10)
    assert found.action == pytest.approx(np.pi, abs=1e-9)  # half a circle of radius sqrt(2 / pi)
    assert abs(found.end.v[0]) < 1e-8
    again = pickle.loads(pickle.dumps(found))
    assert again.integral_multipliers == pytest.approx(found.integral_multipliers, abs=1e-14)
    with pytest.raises(
        ValueError, match=r"expected a system as it was defined .*problem\.question"
    ):
        ao.Problem(found.problem.system, found.problem.start, shore, integral=1.0)
    assert ao.Problem(found.problem.question, found.problem.start, shore, integral=1.0)
    assert again.action == found.action


@pytest.mark.long
def test_states_are_saddles():
    ground = ao.solve(states(), tol=1e-10)
    assert ground.action == pytest.approx(0.5, abs=1e-10)
    assert ground.integral_multipliers == pytest.approx([-0.5], abs=1e-9)
    assert ground.morse_index == 0


@pytest.mark.slow
def test_all_states_of_an_oscillator():
    found = ao.solve_all(states(), tol=1e-10)
    levels = {round(path.action - 0.5): path for path in found}
    assert {0, 1, 2, 3} <= set(levels)
    for k, path in levels.items():
        assert path.action == pytest.approx(k + 0.5, abs=1e-8)
        assert path.morse_index == k


@pytest.mark.long
def test_the_action_changes_with_the_value_by_the_multiplier():
    at = [
        ao.solve(
            ao.Problem(ROPE, ao.Event(0, [0]), ao.Event(2, [0.4]), integral=2.6 + h), tol=1e-11
        )
        for h in (-1e-4, 0.0, 1e-4)
    ]
    slope = (at[2].action - at[0].action) / 2e-4
    assert slope == pytest.approx(-at[1].integral_multipliers[0], rel=1e-6)


@pytest.mark.quick("3")
@pytest.mark.parametrize("seed", range(4))
def test_several_integrals_and_a_waypoint(seed):
    """x'' = kappa.(1, cos 2t) on both legs: linear equations."""
    random = np.random.default_rng(seed)
    ends, middle, values = random.normal(size=2), random.normal(), random.normal(size=2)
    system = systems.particle(integral=lambda q, v, t: [q[0], q[0] * np.cos(2 * t)])
    problem = ao.Problem(
        system,
        ao.Event(0, [ends[0]]),
        ao.Event(2, [ends[1]]),
        through=[ao.Event(0.7, [middle])],
        integral=values,
    )
    found = ao.solve(problem, tol=1e-11)

    def curve(x, t):
        a, b, c, d, k0, k1 = x
        forced = k0 * t**2 / 2 - k1 * np.cos(2 * t) / 4
        return forced + np.where(t < 0.7, a + b * t, c + d * t)

    def equations(x):
        left, right = np.array([0.0, 0.7 - 1e-15]), np.array([0.7, 2.0])
        rows = [*(curve(x, left) - [ends[0], middle]), *(curve(x, right) - [middle, ends[1]])]
        for weight, value in zip((lambda t: 1.0, lambda t: np.cos(2 * t)), values, strict=True):
            rows.append(quad(lambda t, w=weight: curve(x, t) * w(t), 0, 2, points=[0.7])[0] - value)
        return rows

    rest = np.array(equations(np.zeros(6)))
    matrix = np.transpose([np.array(equations(unit)) - rest for unit in np.eye(6)])
    x = np.linalg.solve(matrix, -rest)
    t = np.linspace(0, 1.99, 40)
    assert found(t)[0] == pytest.approx(curve(x, t), abs=1e-8)
    assert found.integral_multipliers == pytest.approx(x[4:], abs=1e-8)
    jump = x[3] - x[1]
    assert found.impulses == pytest.approx(np.array([[jump]]), abs=1e-8)
    assert found.morse_index == 0


def test_a_free_time_with_an_integral():
    """x'' = kappa; H of L + kappa x is the energy at the end."""
    problem = ao.Problem(STRAIGHT, ao.Event(0, [0]), ao.Event(None, [1]), energy=2.0, integral=0.6)
    found = ao.solve(problem, tol=1e-11)

    def equations(x):
        b, kappa, T = x
        end, area = b * T + kappa * T**2 / 2, b * T**2 / 2 + kappa * T**3 / 6
        return end - 1, area - 0.6, (b + kappa * T) ** 2 / 2 - kappa - 2.0

    x = fsolve(equations, [1.0, 0.5, found.duration], xtol=1e-14)
    assert found.duration == pytest.approx(x[2], abs=1e-9)
    assert found.integral_multipliers == pytest.approx([x[1]], abs=1e-8)


@pytest.mark.long
@pytest.mark.parametrize("end", [1e-17, 1.1e-16])
def test_events_that_differ_by_round_off_say_no_size(end):
    """A parabola: x'' is constant, and S = 6 A^2 / T^3. A rope: that between equal heights."""
    given = {"start": ao.Event(0, [0]), "end": ao.Event(2, [end])}
    found = ao.solve(ao.Problem(STRAIGHT, **given, integral=0.6), tol=1e-10)
    assert found.action == pytest.approx(6 * 0.6**2 / 2**3, rel=1e-12)
    rope = ao.solve(ao.Problem(ROPE, **given, integral=2.5), tol=1e-10)
    # Half of it hangs by c sinh(1 / c) = 1.25, at y = c (cosh((t - 1) / c) - cosh(1 / c)).
    c = brentq(lambda c: c * np.sinh(1 / c) - 1.25, 0.1, 10)
    assert rope(1.0)[0] == pytest.approx(c * (1 - np.cosh(1 / c)), rel=1e-9)


@pytest.mark.long
def test_values_that_no_path_has_are_refused():
    short = ao.Problem(ROPE, ao.Event(0, [1]), ao.Event(1, [3]), integral=2.0)
    with pytest.raises(ValueError, match=r"no such path: the least is 2.23606798"):
        ao.solve(short)
    with pytest.raises(ValueError, match="found 2, the least, which the straight line has alone"):
        ao.solve(ao.Problem(ROPE, ao.Event(0, [1]), ao.Event(2, [1]), integral=2.0))
    area = systems.particle("x y", integral=lambda q, v, t: -np.sqrt(1 + v @ v))
    ends = ao.Event(0, [0, 0]), ao.Event(1, [3, 4])
    with pytest.raises(ValueError, match=r"found -2 and no such path: the largest is -5.0990"):
        ao.solve(ao.Problem(area, *ends, integral=-2))


def hang(length):
    """Return a rope of this length over a span of 2, and the sag of its catenary.

    That is c (cosh(1 / c) - 1) = 2 sinh(u / 2)^2 / u with u = 1 / c and sinh(u) / u = length / 2.
    """
    excess = float(Fraction(length) / 2 - 1)
    u = brentq(
        lambda u: sum(u ** (2 * k) / math.factorial(2 * k + 1) for k in range(1, 80)) - excess,
        1e-6,
        20,
        xtol=1e-300,
        rtol=1e-15,
    )
    found = ao.solve(
        ao.Problem(ROPE, ao.Event(0, [0]), ao.Event(2, [0]), integral=length), throw=False
    )
    return found, 2 * np.sinh(u / 2) ** 2 / u


@pytest.mark.parametrize("excess", [pytest.param(1e-3, marks=pytest.mark.long), 1e-7])
def test_a_rope_that_is_hardly_longer_than_the_line_hangs(excess):
    """At y = 0, where the length of the straight line does not change with it to first order.

    The round-off of its length moves it by EPS / (2 excess), which the error tells.
    """
    found, sag = hang(2 + 2 * excess)
    assert found.status.name == "SOLVED" and found.morse_index == 0
    off = abs(-found(1.0)[0] / sag - 1)
    assert off < 4 * EPS / excess and off < found.error + 1e-15


@pytest.mark.long
def test_velocities_of_a_steep_rope_are_rounded_as_the_error_tells():
    """Its length depends on the rounding of its slopes; heights by 40 digits of its catenary."""
    ends = ao.Event(0.0, [1.0]), ao.Event(2.0, [3.0])
    found = ao.solve(ao.Problem(ROPE, *ends, integral=2.8284274075889027))
    exact = [1.49941912751539633, 1.99922540337325016, 2.49941897751543154]
    assert np.abs(found([0.5, 1.0, 1.5])[0] - exact).max() / 3 < found.error < 1e-11


@pytest.mark.long
def test_a_rope_of_which_round_off_leaves_too_little_is_said_to_be_so():
    found, sag = hang(2 + 2e-9)
    assert found.status.name == "FLOOR"
    assert abs(abs(found(1.0)[0]) / sag - 1) < found.error < 1e-5
    with pytest.raises(ao.SolveError, match="16 digits only, which alone moves the path by"):
        ao.solve(found.problem)


@pytest.mark.long
@pytest.mark.parametrize("length", [50.0, 200.0])
def test_a_rope_far_longer_than_its_span_hangs(length):
    """Its tension changes by its length: round-off of the momentum is no departure."""
    found, sag = hang(length)
    assert found.status.name == "SOLVED" and found.morse_index == 0
    assert abs(-found(1.0)[0] / sag - 1) < found.error
    assert found.mesh.elements < 100


@pytest.mark.long
@pytest.mark.parametrize(
    ("ends", "width", "length"),
    [((1.14, -0.82), 1.562, 4.558), ((-0.529, -1.561), 1.452, 1.876), ((1.88, 0.064), 0.905, 2.1)],
)
def test_a_rope_hangs_between_unequal_heights(ends, width, length):
    """Newton's method was lost where weights along the first paths were of both signs."""
    (a, b), h = ends, ends[1] - ends[0]
    found = ao.solve(
        ao.Problem(ROPE, ao.Event(0, a), ao.Event(width, b), integral=length), tol=1e-9
    )
    reach = np.sqrt(length**2 - h**2)
    c = brentq(lambda c: 2 * c * np.sinh(width / 2 / c) - reach, width / 100, 100.0)
    lowest = width / 2 - c * np.arctanh(h / length)
    x = np.linspace(0, width, 9)
    hangs = a + c * (np.cosh((x - lowest) / c) - np.cosh(lowest / c))
    np.testing.assert_allclose(found(x)[0], hangs, atol=1e-8)
    assert found.morse_index == 0


@pytest.mark.long
def test_a_path_through_two_surfaces_and_three_laws_with_an_integral():
    """Times, places and the multiplier by legs in closed form, and Newton's method on these."""
    m, w, T, G = (2.3, 3.9, 0.8), (3.7, 1.1, 5.8), 1.0, 0.51
    laws = [
        ao.System(
            lambda q, v, t, m=m, w=w: (
                m * (v @ v) / 2 - w * (q[0] ** 2 / 2 + q[1] ** 2) - 0.3 * q[0] * t
            ),
            ["x", "y"],
            integral=lambda q, v, t: q[1],
        )
        for m, w in zip(m, w, strict=True)
    ]
    surfaces = [
        ao.Event(None, None, on=lambda q, t, y=y: q[1] - y + 0.1 * q[0]) for y in (-0.15, 0.15)
    ]
    ends = ao.Event(0, [-0.67, -0.7]), ao.Event(T, [0.85, 0.99])
    found = ao.solve(ao.Problem(laws, *ends, through=surfaces, integral=G))
    passed = found.problem.through
    assert [e.t for e in passed] == pytest.approx([0.25060913, 0.38776453], abs=1e-7)
    assert [e.q[0] for e in passed] == pytest.approx([-0.4692134, -0.38743354], abs=1e-7)
    assert found.integral_multipliers == pytest.approx([2.15822115], abs=1e-6)


def test_a_value_below_that_of_a_line_is_not_refused_where_the_integrand_bends_back_near_zero():
    """Of (v^2 - c)^2 at rest c^2, and c^2 - c A^2 + 3 A^4 / 8 of v = A cos(pi t)."""
    wells = ao.System(
        lambda q, v, t: v[0] ** 2, ["x"], integral=lambda q, v, t: (v @ v - 1e-3) ** 2
    )
    check_integrals(ao.Problem(wells, ao.Event(0, [0]), ao.Event(1, [0]), integral=8e-7))


@pytest.mark.parametrize(
    ("system", "more", "message"),
    [
        (systems.particle(), {"integral": 1}, "integral=g"),
        (STRAIGHT, {"integral": [1, 2]}, "as many finite values"),
        (STRAIGHT, {"integral": np.nan}, "as many finite values"),
        (STRAIGHT, {"integral": "long"}, "values of the integrals"),
    ],
)
def test_what_does_not_fit_is_refused(system, more, message):
    with pytest.raises((ValueError, TypeError), match=message):
        ao.Problem(system, ao.Event(0, [0]), ao.Event(1, [1]), **more)


def test_what_integrals_do_not_go_with_is_refused():
    with pytest.raises(ValueError, match="between finite events"):
        ao.Problem(STRAIGHT, ao.Event(0, [0]), ao.Event(np.inf, [0]), integral=1)
    problem = ao.Problem(STRAIGHT, ao.Event(0, [0]), ao.Event(1, [1]), integral=1)
    with pytest.raises(ValueError, match=r"integral|ipopt"):
        ao.solve(problem, method="ipopt")


@pytest.mark.long
@pytest.mark.parametrize(
    ("kappa", "p", "action", "index"),
    [
        ((-573.455506581106, -345.649592078397), -0.708894177508575, 221.450878351367, 1),
        ((-572.828562746666, -347.408046662638), 0.479536646755838, 221.456073556869, 2),
    ],
)
def test_a_rod_that_winds_once_is_found_from_its_shape(kappa, p, action, index):
    """Two shapes of an elastica between clamps, all but the same, from motions made otherwise."""
    rod = systems.particle("angle", integral=lambda q, v, t: [np.cos(q[0]), np.sin(q[0])])
    problem = ao.Problem(rod, ao.Event(0, [0.5]), ao.Event(1, [-1]), integral=[0.6, 0.3])

    def bend(t, y):
        return [y[1], kappa[1] * np.cos(y[0]) - kappa[0] * np.sin(y[0])]

    shape = solve_ivp(bend, (0, 1), [0.5, p], rtol=1e-9, atol=1e-9, dense_output=True).sol
    found = ao.solve(problem, guess=lambda t: shape(t)[:1], tol=1e-10)
    assert found.action == pytest.approx(action, abs=1e-9)
    assert found.integral_multipliers == pytest.approx(np.array(kappa), rel=1e-9)
    assert found.morse_index == index


@pytest.mark.long
def test_a_soap_film_that_is_a_cylinder():
    """A coordinate that does not change: longer than 2 pi it is a saddle (Plateau, Rayleigh)."""
    film = ao.System(
        lambda q, v, t: 2 * np.pi * q[0] * np.sqrt(1 + v[0] ** 2),
        ["r"],
        integral=lambda q, v, t: np.pi * q[0] ** 2,
    )
    ends = ao.Event(0, [1.0]), ao.Event(7, [1.0])
    found = ao.solve(ao.Problem(film, *ends, integral=7 * np.pi))
    assert found.action == pytest.approx(14 * np.pi)
    assert found.morse_index == 1


@pytest.mark.long
@pytest.mark.parametrize("k", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_conjugate_points_and_modes_of_a_state(k):
    """Neighbours of sin wt: A sin wt + B t cos wt, of which int eta sin wt dt = 0."""
    w = k * np.pi
    string = systems.particle("y", integral=lambda q, v, t: q[0] ** 2)
    problem = ao.Problem(string, ao.Event(0, [0.0]), ao.Event(1, [0.0]), integral=1)
    path = ao.solve(problem, guess=lambda t: [np.sqrt(2) * np.sin(w * t)], tol=1e-11)

    def left(t):
        c, s = np.cos(w * t), np.sin(w * t)
        squares, crossed = t / 2 - s * c / (2 * w), s * c / (4 * w**2) + t * (s**2 - c**2) / (4 * w)
        return s * crossed - t * c * squares

    t = np.linspace(0.1, 1, 3000)
    known = [
        brentq(left, t[i], t[i + 1], xtol=1e-14) for i in np.flatnonzero(np.diff(np.sign(left(t))))
    ]
    points = ao.conjugate_points(path)
    assert [p.t for p in points] == pytest.approx(known, abs=1e-8)
    assert len(points) == path.morse_index == k - 1
    others = np.array([j for j in range(1, 5) if j != k])  # the norm keeps it as it is
    modes = ao.second_variation(path, 3)
    assert modes.eigenvalues == pytest.approx(np.pi**2 * (others**2 - k**2), rel=1e-8)


# -- closed paths, constraints, forces -------------------------------------------------------------


@pytest.mark.long
def test_states_on_a_ring():
    """Mathieu's equation y'' + (a - 2 q cos 2 x) y = 0, of period 2 pi: S = a / 2."""
    ring = ao.System(
        lambda y, v, x, *, q: v[0] ** 2 / 2 + q * np.cos(2 * x) * y[0] ** 2,
        ["y"],
        parameters={"q": 1.5},
        integral=lambda y, v, x: y[0] ** 2,
    )
    problem = ao.Problem(ring, ao.Event(0, [None]), ao.Periodic(2 * np.pi), integral=1)
    ground = ao.solve(problem, tol=1e-10)
    assert ground.action == pytest.approx(mathieu_a(0, 1.5) / 2, rel=1e-12)
    assert ground.integral_multipliers[0] == pytest.approx(-mathieu_a(0, 1.5) / 2, rel=1e-12)
    assert ground.morse_index == 0
    for k, known in enumerate((mathieu_b(1, 1.5), mathieu_a(1, 1.5)), 1):
        wave = (np.sin, np.cos)[k - 1]
        state = ao.solve(problem, guess=lambda x, wave=wave: [wave(x) / np.sqrt(np.pi)])
        assert state.action == pytest.approx(known / 2, rel=1e-9) and state.morse_index == k


@pytest.mark.long
def test_the_closed_curve_round_a_given_area():
    """A circle, anywhere in the plane: int v^2 / 2 = 2 pi area in the time 1."""
    system = systems.particle("x y", integral=lambda q, v, t: (q[0] * v[1] - q[1] * v[0]) / 2)
    problem = ao.Problem(system, ao.Event(0, [0.0, 0.0]), ao.Periodic(1.0), integral=1.5)
    path = ao.solve(problem)
    assert path.action == pytest.approx(3 * np.pi, rel=1e-12)
    assert path.integral_multipliers == pytest.approx([-2 * np.pi])
    assert path.start.q == pytest.approx([0, 0], abs=1e-12)
    # It may be turned about its start; more may it be moved, where that is free.
    assert (path.inertia.index, path.inertia.nullity, path.inertia.moves) == (0, 1, 1)
    loose = ao.solve(problem.replace(start=ao.Event(0, [None, None])))
    assert (loose.inertia.index, loose.inertia.nullity, loose.inertia.moves) == (0, 3, 3)
    twice = lambda t: [np.cos(4 * np.pi * t) / 2, np.sin(4 * np.pi * t) / 2]  # noqa: E731
    saddle = ao.solve(loose.problem, guess=twice)
    assert saddle.action == pytest.approx(6 * np.pi) and saddle.morse_index == 2


def test_a_closed_rod_is_a_circle_and_turns_freely():
    rod = ao.System(
        lambda q, v, s: v[0] ** 2 / 2,
        ["angle"],
        integral=lambda q, v, s: [np.cos(q[0]), np.sin(q[0])],
    )
    once = ao.Periodic(1.0, advance=[2 * np.pi])
    path = ao.solve(ao.Problem(rod, ao.Event(0, [None]), once, integral=[0, 0]))
    assert path.action == pytest.approx(2 * np.pi**2, rel=1e-12)
    # A figure of eight, 2 asin(k sn 4 K s) with 2 E = K, may be turned: a family.
    eight = ao.Problem(rod, ao.Event(0, [None]), ao.Periodic(1.0), integral=[0, 0])
    found = ao.solve(eight, guess=lambda s: [2.2 * np.sin(2 * np.pi * s)], throw=False)
    m = brentq(lambda m: 2 * ellipe(m) - ellipk(m), 0.5, 0.99)
    assert found.status.name == "DEGENERATE"
    assert found.action == pytest.approx(32 * ellipk(m) * (ellipe(m) - (1 - m) * ellipk(m)))


def test_a_period_that_is_found_with_an_integral():
    """x = A sin wt, with A^2 w^2 / 2 = E and int x^2 dt = pi A^2 / w: w^3 = 2 pi E / J."""
    system = systems.oscillator(integral=lambda q, v, t: q[0] ** 2)
    problem = ao.Problem(system, ao.Event(0, [0.0]), ao.Periodic(None), energy=0.8, integral=2.5)
    turn = ao.Path.interpolate(lambda t: [np.sin(t)], ao.Mesh.uniform(0, 2 * np.pi, 4, 8))
    path = ao.solve(problem, guess=turn)
    assert path.duration == pytest.approx(2 * np.pi / np.cbrt(1.6 * np.pi / 2.5), rel=1e-10)


@pytest.mark.long
@pytest.mark.parametrize("mean", [0.6, -0.3])
def test_an_integral_on_a_circle_is_that_of_its_angle(mean):
    angle = ao.System(
        lambda q, v, t: v[0] ** 2 / 2 - np.sin(q[0]), ["a"], integral=lambda q, v, t: np.cos(q[0])
    )
    plane = systems.thrown(
        g=1.0, constraint=lambda q, t: (q @ q - 1) / 2, integral=lambda q, v, t: q[0]
    )
    T, ends = 2.5, (-1.2, 0.4)
    known = ao.solve(
        ao.Problem(angle, *(ao.Event(t, [a]) for t, a in zip((0, T), ends, strict=True)),
                   integral=mean * T), tol=1e-10)  # fmt: skip
    asked = ao.Problem(
        plane,
        *(ao.Event(t, [np.cos(a), np.sin(a)]) for t, a in zip((0, T), ends, strict=True)),
        integral=mean * T,
    )
    near = lambda t: np.array([1.1 * np.cos(known(t)[0]), np.sin(known(t)[0])])  # noqa: E731
    path = ao.solve(asked, guess=near, tol=1e-10)
    assert path.action == pytest.approx(known.action, rel=1e-10)
    assert path.integral_multipliers == pytest.approx(known.integral_multipliers, rel=1e-9)
    assert path.morse_index == known.morse_index and path.compare().agrees
    assert path.sensitivity().integral == pytest.approx(-known.integral_multipliers, rel=1e-9)


@pytest.mark.long
def test_an_integral_of_a_dragged_path():
    """x'' + x' = kappa: x = kappa t + c (1 - exp -t)."""
    system = systems.particle(force=lambda q, v, t: -v, integral=lambda q, v, t: q[0])
    path = ao.solve(
        ao.Problem(system, ao.Event(0, [0.0]), ao.Event(2, [1.0]), integral=3.0), tol=1e-11
    )
    lag = 1 - np.exp(-2)
    kappa, c = np.linalg.solve([[2, lag], [2, 2 - lag]], [1, 3])
    t = np.linspace(0, 2, 9)
    np.testing.assert_allclose(path(t)[0], kappa * t + c * (1 - np.exp(-t)), atol=1e-11)
    assert path.integral_multipliers == pytest.approx([kappa], rel=1e-11)
    assert path.compare().agrees
    for ask in (path.sensitivity, lambda: path.morse_index):
        with pytest.raises(ValueError, match="without non-conservative forces"):
            ask()


@pytest.mark.quick("1")
@pytest.mark.parametrize("k", [1, 2])
def test_waves_on_a_closed_beam(k):
    """Of int x^2 = 1 on a ring: k^4 / 2, above a constant and the lower waves."""
    beam = ao.System(lambda q, v, a, t: a[0] ** 2 / 2, ["x"], integral=lambda q, v, t: q[0] ** 2)
    problem = ao.Problem(beam, ao.Event(0, [0.0]), ao.Periodic(2 * np.pi), integral=1)
    path = ao.solve(problem, guess=lambda t: [0.6 * np.sin(k * t)], tol=1e-10)
    assert path.action == pytest.approx(k**4 / 2, rel=1e-12)
    assert (path.inertia.index, path.inertia.nullity) == (2 * k - 1, 0)


def test_an_integral_of_a_beam_on_a_circle():
    angle = ao.System(
        lambda q, v, a, t: (a[0] ** 2 + v[0] ** 4) / 2, ["a"], integral=lambda q, v, t: np.cos(q[0])
    )
    plane = ao.System(
        lambda q, v, a, t: a @ a / 2,
        ["x", "y"],
        constraint=lambda q, t: (q @ q - 1) / 2,
        integral=lambda q, v, t: q[0],
    )

    def on_ring(t, a, w):
        return ao.Event(t, [np.cos(a), np.sin(a)], v=[-w * np.sin(a), w * np.cos(a)])

    ends = ao.Event(0, [0.1], v=[0.0]), ao.Event(1, [1.0], v=[0.5])
    known = ao.solve(ao.Problem(angle, *ends, integral=0.7), tol=1e-10)
    turn = lambda t: np.array([np.cos(known(t)[0]), np.sin(known(t)[0])])  # noqa: E731
    asked = ao.Problem(plane, on_ring(0, 0.1, 0.0), on_ring(1, 1.0, 0.5), integral=0.7)
    path = ao.solve(asked, guess=turn)
    assert path.action == pytest.approx(known.action, rel=1e-9)
    assert path.integral_multipliers == pytest.approx(known.integral_multipliers, rel=1e-7)
    assert path.morse_index == known.morse_index == 0


@pytest.mark.long
def test_first_waves_have_the_integral_that_is_given():
    """One sine each, and then sums of them: all of the length asked for, between the ends."""
    problem = ao.Problem(ROPE, ao.Event(0, [0]), ao.Event(2, [0.4]), integral=2.6)
    straight = ao.Path(ao.Mesh([0.0, 2.0], 1), np.array([[0.0, 0.4]]))
    given = problem, straight, np.array([0.0, 2.0]), np.ones(1)
    found = [path for path, _ in first_waves(*given, 12, np.random.default_rng(1))]
    x, weights = np.polynomial.legendre.leggauss(400)
    assert len(found) > 8
    for path in found:
        assert path(np.array([0.0, 2.0])) == pytest.approx(np.array([[0.0, 0.4]]), abs=1e-12)
        assert weights @ np.hypot(1, path.velocity(x + 1)[0]) == pytest.approx(2.6, rel=1e-2)


def test_first_waves_have_heights_of_any_unit():
    """Between equal heights of zero, which do not tell how large a rope's are."""
    rope = ao.System(
        lambda q, v, t: q[0], ["y"], integral=lambda q, v, t: np.sqrt(1 + (v[0] / 1e-9) ** 2)
    )
    problem = ao.Problem(rope, ao.Event(0, [0]), ao.Event(2, [0]), integral=2.6)
    straight = ao.Path(ao.Mesh([0.0, 2.0], 1), np.zeros((1, 2)))
    given = problem, straight, np.array([0.0, 2.0]), np.ones(1)
    found = [path for path, _ in first_waves(*given, 2, np.random.default_rng(1))]
    x, weights = np.polynomial.legendre.leggauss(400)
    assert len(found) == 2
    for path in found:
        assert weights @ np.hypot(1, path.velocity(x + 1)[0] / 1e-9) == pytest.approx(2.6, rel=1e-2)


def length(q, v, t):
    return np.sqrt(v @ v)


def line(integral, value, **more):
    system = ao.System(lambda q, v, t: v @ v / 2, ["x", "y"], integral=integral)
    return ao.Problem(system, ao.Event(0.0, [0.0, 0.0]), ao.Event(2.0, [3.0, 4.0]), integral=value)


@pytest.mark.parametrize(
    ("integral", "value", "words"),
    [
        (lambda q, v, t: np.sqrt(v @ v), 4.9, "found 4.9 and no such path: the least is 5, along"),
        (
            lambda q, v, t: -np.sqrt(v @ v),
            -4.9,
            "the largest is -5, along the straight line, and none has",
        ),
        (lambda q, v, t: v @ v, 12.5, "found 12.5, the least, which the straight line has alone"),
    ],
)
def test_integrals_that_no_path_has_are_refused(integral, value, words):
    with pytest.raises(ValueError, match=words):
        check_integrals(line(integral, value))


def test_integrals_that_paths_have_pass():
    check_integrals(line(length, 5.1))
    check_integrals(line(lambda q, v, t: v[0] ** 3, 1.0))  # neither convex nor concave
    check_integrals(line(lambda q, v, t: q @ q, 0.1))  # of places


def test_values_in_any_units_are_refused_where_no_path_has_them_alone():
    """A rope whose heights are told in a unit of their own, from 0 to 2; and |v| along a line."""
    rope = ao.System(
        lambda q, v, t, *, unit: q[0],
        ["y"],
        parameters={"unit": 1.0},
        integral=lambda q, v, t, *, unit: np.sqrt(1 + (v[0] * unit) ** 2),
    )
    ends = ao.Event(0, [0]), ao.Event(2, [0])
    for unit in (1.0, 1e-18, 1e18):
        check_integrals(ao.Problem(rope, *ends, parameters={"unit": unit}, integral=3))
        with pytest.raises(ValueError, match="the least is 2, along the straight line"):
            check_integrals(ao.Problem(rope, *ends, parameters={"unit": unit}, integral=1.5))
    to_and_fro = ao.System(lambda q, v, t: v[0] ** 2, ["x"], integral=lambda q, v, t: np.fabs(v[0]))
    check_integrals(ao.Problem(to_and_fro, ao.Event(0, [0]), ao.Event(1, [1]), integral=3))


def test_what_is_not_known_with_multipliers_that_change_is_refused():
    system = ao.System(lambda q, v, t: v @ v / 2, ["x"], integral=lambda q, v, t: q[0])
    problem = ao.Problem(system, ao.Event(0, [0.0]), ao.Event(1, [0.0]), integral=1.0)
    with pytest.raises(ValueError, match="found one: a fan is not known with multipliers"):
        check_free(problem, "a fan")
    check_free(ao.Problem(systems.particle(), ao.Event(0, [0.0]), ao.Event(1, [0.0])), "a fan")


def test_what_a_rope_conserves_is_that_of_its_problem():
    rope = ao.solve(ao.Problem(ROPE, ao.Event(0, [0]), ao.Event(2, [0.3]), integral=3.0))
    with pytest.raises(ValueError, match=r"solution\.problem\.system"):
        ao.noether(ROPE, [0.0], time=1).drift(rope)


@pytest.mark.parametrize(
    "law",
    [
        lambda q, v, t: 1 + 0 * t,
        lambda q, v, t: 2 * q[0] * v[0],
        lambda q, v, t: [q[0] ** 2, np.sin(q[0]) + t * np.cos(q[0]) * v[0]],
    ],
)
def test_integrals_that_the_events_tell_are_refused(law):
    system = ao.System(lambda q, v, t: v @ v / 2, ["x"], integral=law)
    count = system.g.numel()
    problem = ao.Problem(system, ao.Event(0, [0]), ao.Event(1, [1]), integral=[1.0] * count)
    with pytest.raises(ValueError, match=f"that of expression {count - 1}, which is a constant or"):
        ao.solve(problem)
    check_integrals(problem.replace(end=ao.Event(1, [None])))  # there its value tells the end


@at_once(
    ("law", "told"),
    [
        (lambda q, v, t: [q[0], 2 * q[0]], "[0, 1]"),
        (lambda q, v, t: [q[0], t * q[0], 1e6 * q[0] + v[0]], "[0, 2]"),
        (lambda q, v, t: [q[0] ** 2, v[0] ** 2, t * q[0] * v[0]], "[0, 2]"),
        (lambda q, v, t: [q[0], t * q[0]], ""),
        (lambda q, v, t: [q[0], q[0] + np.where(t < 0.5, 1, 0) * v[0]], ""),
        (lambda q, v, t: [q[0], q[0] + np.exp(-((1e3 * q[0] - 370) ** 2))], ""),
    ],
)
def test_integrals_that_tell_one_another_are_refused(law, told):
    """int (v + q) dt differs from int q dt by what the events tell, int t q q' dt by int q^2/2."""
    system = ao.System(lambda q, v, t: v @ v / 2, ["x"], integral=law)
    values = np.linspace(1, 2, system.g.numel())
    problem = ao.Problem(system, ao.Event(0, [0]), ao.Event(1, [1]), integral=values)
    if told:
        with pytest.raises(ValueError, match=re.escape(f"of expressions {told} do")):
            check_integrals(problem)
    else:
        check_integrals(problem)
    check_integrals(problem.replace(end=ao.Event(1, [None])))  # there v tells the end


@pytest.mark.long
def test_multipliers_of_integrals_that_depend_on_one_another_are_not_determined():
    laws = lambda q, v, t: np.stack([q[0], 2 * q[0]])  # noqa: E731
    system = ao.System(lambda q, v, t: v @ v / 2, ["x"], integral=laws)
    problem = ao.Problem(system, ao.Event(0, [0]), ao.Event(1, [None]), integral=(1.0, 2.0))
    found = ao.solve(problem, throw=False)
    assert found.status is ao.Status.DEGENERATE
    with pytest.raises(ValueError, match="integrals that are independent"):
        _ = found.morse_index


@pytest.mark.parametrize(
    "step", [lambda t: np.where(t < 0.5, 1, 0), lambda t: np.tanh((t - 0.5) / 1e-4)]
)
def test_an_integral_that_steps_in_a_moment_is_not_the_same_for_all_paths(step):
    """Its Euler-Lagrange equations vanish wherever they are asked for, but in that moment."""
    free = ao.System(lambda q, v, t: v[0] ** 2 / 2, ["x"], integral=lambda q, v, t: step(t) * v[0])
    given = (0.8, 0.8) if step(-9.0) == 1 else (0.1, 0.45)  # 1 - 2 x(.5) of the second
    problem = ao.Problem(free, ao.Event(0.0, [0.0]), ao.Event(1.0, [1.0]), integral=given[0])
    assert ao.solve(problem)(0.5)[0] == pytest.approx(given[1], abs=1e-4)


@pytest.mark.long
@pytest.mark.parametrize(
    ("g", "value"), [(lambda q, v, t: q @ q, 1.0), (lambda q, v, t: q**2, [0.4, 0.6])]
)
def test_integrals_that_a_constraint_tells_have_no_multipliers(g, value):
    """On a circle q . q is one: what was found for its multiplier was -2952, and SOLVED."""
    circle = ao.System(
        lambda q, v, t: v @ v / 2, ["x", "y"], constraint=lambda q, t: q @ q - 1, integral=g
    )
    ends = ao.Event(0, [1.0, 0.0]), ao.Event(1, [0.0, 1.0])
    found = ao.solve(ao.Problem(circle, *ends, integral=value), throw=False)
    assert found.status is ao.Status.DEGENERATE
