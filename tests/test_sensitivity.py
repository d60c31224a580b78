"""Derivatives of the action against differences of re-solved problems and closed forms."""

from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np
import pytest
import systems

import actionopt as ao
from actionopt import scenes
from actionopt.analysis.quadratic.sensitivity import _check_contacts
from actionopt.mechanics.question.obstacle import Arc

# A central difference with step h of size 1e-4 (relative) leaves h^2 S''' / 6, removed once by
# Richardson's extrapolation, and 1e-13 / h of rounding.
FIRST_TOLERANCE = 1e-7
SECOND_TOLERANCE = 1e-4


def difference(function, step):
    """Return the derivative at 0 by central differences, extrapolated once."""

    def central(h):
        return (function(h) - function(-h)) / (2 * h)

    return (4 * central(step / 2) - central(step)) / 3


def moved(problem, *, q0=0.0, q1=0.0, t0=0.0, t1=0.0, **parameters):
    values = {k: v + parameters.get(k, 0.0) for k, v in problem.parameters.items()}
    start = ao.Event(problem.start.t + t0, np.array(problem.start.q, dtype=float) + q0)
    end = ao.Event(problem.end.t + t1, np.array(problem.end.q, dtype=float) + q1)
    return ao.Problem(problem.system, start, end, parameters=values)


SMOOTH = [
    *("pendulum", "kepler", "oscillating_wall", "rotating_frame_bound"),
    pytest.param("double_pendulum", marks=pytest.mark.slow),
]


@pytest.fixture(params=SMOOTH)
def solution(request):
    scene = scenes.get(request.param)
    return ao.solve(scene.problem, guess=scene.guess or scene.exact, tol=1e-11)


def action(solution, **change):
    return ao.solve(moved(solution.problem, **change), guess=solution, tol=1e-11).action


def scale(solution):
    return abs(solution.action) + np.max(np.abs(solution.energy(solution.mesh.nodes)))


@pytest.mark.long
def test_ends_against_differences(solution):
    found = solution.sensitivity()
    n = solution.problem.system.n
    size = np.max(np.abs(solution.path.values))
    for key, value in (("q0", found.q0), ("q1", found.q1)):
        for unit, derivative in zip(np.eye(n), value, strict=True):
            expected = difference(
                lambda h, unit=unit, key=key: action(solution, **{key: h * unit}), 1e-3 * size
            )
            assert derivative == pytest.approx(expected, abs=FIRST_TOLERANCE * scale(solution))


@pytest.mark.quick("rotating_frame_bound")
def test_times_against_differences(solution):
    found = solution.sensitivity()
    T = solution.problem.duration
    for key, value in (("t0", found.t0), ("t1", found.t1)):
        expected = difference(lambda h, key=key: action(solution, **{key: h}), 1e-3 * T)
        assert value == pytest.approx(expected, abs=FIRST_TOLERANCE * scale(solution))


@pytest.mark.long
def test_parameters_against_differences(solution):
    found = solution.sensitivity()
    for name, value in solution.problem.parameters.items():
        step = 1e-3 * (abs(float(value)) or 1.0)
        expected = difference(lambda h, name=name: action(solution, **{name: h}), step)
        size = scale(solution) / (abs(float(value)) or 1.0)
        assert found.parameters[name] == pytest.approx(expected, abs=FIRST_TOLERANCE * size)


def test_identities_of_hamilton_and_jacobi(solution):
    found = solution.sensitivity()
    system, parameters = solution.problem.system, solution.problem.parameters
    H = [
        system.energy(s.q, s.v, s.t, parameters=parameters) for s in (solution.start, solution.end)
    ]
    p = [
        system.momentum(s.q, s.v, s.t, parameters=parameters)
        for s in (solution.start, solution.end)
    ]
    size = 1e-9 * scale(solution)
    assert found.t0 == pytest.approx(H[0], abs=size)
    assert found.t1 == pytest.approx(-H[1], abs=size)
    assert found.q0 == pytest.approx(-p[0], abs=100 * size)
    assert found.q1 == pytest.approx(p[1], abs=100 * size)


@pytest.mark.long
def test_second_derivatives_against_differences_of_momenta(solution):
    found = solution.sensitivity()
    n = solution.problem.system.n
    size = 1e-3 * np.max(np.abs(solution.path.values))

    def momenta(**change):
        again = ao.solve(moved(solution.problem, **change), guess=solution, tol=1e-11)
        return np.concatenate([-again.momenta[0], again.momenta[1]])

    whole = np.block([[found.q0q0, found.q0q1], [found.q0q1.T, found.q1q1]])
    for i in range(2 * n):
        key, unit = ("q0", "q1")[i // n], np.eye(n)[i % n]
        expected = difference(lambda h, key=key, unit=unit: momenta(**{key: h * unit}), size)
        assert whole[:, i] == pytest.approx(expected, abs=SECOND_TOLERANCE * np.max(np.abs(whole)))


@pytest.mark.parametrize(("m", "w", "T"), [(1.0, 1.0, 2.0), (3.0, 0.7, 11.0)])
def test_oscillator(m, w, T):
    # S = m w ((a^2 + b^2) cos wT - 2 a b) / (2 sin wT), Feynman and Hibbs, problem 2-2.
    a, b = 0.8, -0.3

    def lagrangian(q, v, t, *, m, w):
        return m * (v[0] ** 2 - (w * q[0]) ** 2) / 2

    system = ao.System(lagrangian, ["x"], parameters={"m": m, "w": w})
    solution = ao.solve(ao.Problem(system, ao.Event(1.0, a), ao.Event(1.0 + T, b)), tol=1e-11)
    found = solution.sensitivity()
    s, c = np.sin(w * T), np.cos(w * T)
    S = m * w * ((a * a + b * b) * c - 2 * a * b) / (2 * s)
    by_wT = -m * w * (a * a + b * b - 2 * a * b * c) / (2 * s * s)
    assert solution.action == pytest.approx(S, rel=1e-10)
    assert found.q0[0] == pytest.approx(m * w * (a * c - b) / s, rel=1e-10)
    assert found.q1[0] == pytest.approx(m * w * (b * c - a) / s, rel=1e-10)
    assert found.t1 == pytest.approx(w * by_wT, rel=1e-10)
    assert found.t0 == pytest.approx(-w * by_wT, rel=1e-10)
    assert found.parameters["m"] == pytest.approx(S / m, rel=1e-10)
    assert found.parameters["w"] == pytest.approx(S / w + T * by_wT, rel=1e-10)
    assert found.q0q0[0, 0] == pytest.approx(m * w * c / s, rel=1e-10)
    assert found.q1q1[0, 0] == pytest.approx(m * w * c / s, rel=1e-10)
    assert found.van_vleck == pytest.approx(m * w / s, rel=1e-10)


@pytest.mark.long
def test_free_coordinates_have_no_derivative():
    system = ao.System(lambda q, v, t: (v[0] ** 2 + v[1] ** 2) / 2 - q[0] * q[1] / 4, ["x", "y"])
    problem = ao.Problem(system, ao.Event(0.0, [0.0, None]), ao.Event(1.0, [1.0, 2.0]))
    found = ao.solve(problem, tol=1e-11).sensitivity()
    assert found.q0[1] == 0 and not found.q0q1[1].any() and not found.q0q0[:, 1].any()
    h = 1e-3

    def action(x):
        start = ao.Event(0.0, [x, None])
        return ao.solve(ao.Problem(system, start, problem.end), tol=1e-11).action

    assert found.q0[0] == pytest.approx(difference(action, h), rel=1e-7)
    second = (action(h) - 2 * action(0.0) + action(-h)) / h**2
    assert found.q0q0[0, 0] == pytest.approx(second, rel=1e-5)


@pytest.mark.long
def test_each_entry_of_a_matrix_has_its_own_derivative():
    def lagrangian(q, v, t, *, M):
        coupled = M[0, 1] * q[0] + M[1, 0] * q[1] + M[0, 2] * q[0] * q[1] + M[1, 2] * v[0] * q[1]
        return (v[0] ** 2 + v[1] ** 2) / 2 + coupled - M[0, 0] * q[0] ** 2 - M[1, 1] * q[1] ** 2

    M = np.array([[0.3, 1.0, -0.5], [0.2, 0.7, 0.4]])
    system = ao.System(lagrangian, ["x", "y"], parameters={"M": M})
    ends = ao.Event(0.0, [0.0, 0.4]), ao.Event(1.0, [1.0, -0.2])

    def action(i, j, h):
        moved = M.copy()
        moved[i, j] += h
        return ao.solve(ao.Problem(system, *ends, parameters={"M": moved}), tol=1e-12).action

    found = ao.solve(ao.Problem(system, *ends), tol=1e-12).sensitivity().parameters["M"]
    assert found.shape == M.shape
    for i, j in np.ndindex(M.shape):
        expected = difference(lambda h, i=i, j=j: action(i, j, h), 1e-2)
        assert found[i, j] == pytest.approx(expected, rel=1e-7, abs=1e-9), (i, j)


def test_forced_systems_are_refused():
    system = systems.particle(force=lambda q, v, t: [-v[0]])
    solution = ao.solve(ao.Problem(system, ao.Event(0.0, 0.0), ao.Event(1.0, 1.0)))
    with pytest.raises(ValueError, match="non-conservative"):
        solution.sensitivity()


# -- events between the ends, and integrals --------------------------------------------------------


def _waypoints(x, y, t, a, y1):
    """Three legs of a motion with a clock; one coordinate is free at the first waypoint."""

    def lagrangian(q, v, t, *, a):
        return v @ v / 2 - a * q[0] ** 2 * np.cos(t) / 2 + 0.3 * q[0] * q[1] - np.cosh(q[1])

    system = ao.System(lagrangian, ["x", "y"], parameters={"a": a})
    between = [ao.Event(0.8 + t, [0.9 + x, None]), ao.Event(1.4, [0.2, 0.1 + y])]
    ends = ao.Event(0, [0.1, 0.2]), ao.Event(2, [0.7, y1])
    found = ao.solve(ao.Problem(system, *ends, through=between), tol=1e-12)
    s = found.sensitivity()
    return found, [s.through_q[0, 0], s.through_q[1, 1], s.through_t[0], s.parameters["a"], s.q1[1]]


def _bounce(t0, b, g, x1, y0):
    """A ball off a curved floor that moves."""
    ball = ao.System(
        lambda q, v, t, *, g: v @ v / 2 - g * q[1] * (1 + 0.1 * np.sin(t)),
        ["x", "y"],
        parameters={"g": g},
    )
    floor = ao.Bounce(lambda q, t, *, b: q[1] - 0.1 * b * q[0] ** 2 - 0.1 * t * q[0])
    ends = ao.Event(t0, [0, y0]), ao.Event(2, [x1, 0.7])
    problem = ao.Problem(ball, *ends, through=[floor], parameters={"b": b})
    found = ao.solve(problem, tol=1e-12, guess=[[0, 0.5, 1], [1, 0.1, 0.7]])
    s = found.sensitivity()
    return found, [s.t0, s.parameters["b"], s.parameters["g"], s.q1[0], s.q0[1]]


def _refraction(t1, y0):
    media: Any = [
        ao.System(lambda q, v, t, *, n: n**2 * (v @ v) / 2, ["x", "y"], parameters={"n": n})
        for n in (1.0, 1.5)
    ]
    surface = ao.Event(None, None, on=lambda q, t: q[1] - 0.1 * np.sin(q[0]) - 0.2 * t)
    ends = ao.Event(0, [0, y0]), ao.Event(t1, [2, -1])
    found = ao.solve(ao.Problem(media, *ends, through=[surface]), tol=1e-12)
    s = found.sensitivity()
    assert "leg_times" not in s.parameters
    return found, [s.t1, s.q0[1]]


def _rope(length, y0):
    def ds(q, v, t):
        return np.sqrt(1 + v[0] ** 2)

    rope = ao.System(lambda q, v, t: q[0] * ds(q, v, t), ["y"], integral=ds)
    problem = ao.Problem(rope, ao.Event(0, [y0]), ao.Event(2, [0.4]), integral=length)
    found = ao.solve(problem, tol=1e-12)
    s = found.sensitivity()
    assert s.integral == pytest.approx(-found.integral_multipliers)
    assert not s.parameters
    return found, [s.integral[0], s.q0[0]]


def _switch(t0, t, when):
    """L switches by the clock where no event is, and a waypoint follows."""

    def lagrangian(q, v, t, *, when):
        return v[0] ** 2 / 2 - ca.if_else(t < when, 1.0, 3.0) * q[0] ** 2 / 2

    system = ao.System(lagrangian, ["x"], parameters={"when": when})
    ends = ao.Event(t0, [0.3]), ao.Event(2, [0.9])
    found = ao.solve(ao.Problem(system, *ends, through=[ao.Event(t, [0.7])]), tol=1e-12)
    s = found.sensitivity()
    return found, [s.t0, s.through_t[0], s.parameters["when"]]


@pytest.mark.long
@pytest.mark.parametrize(
    ("question", "values", "end"),
    [
        (_waypoints, (0.0, 0.0, 0.0, 1.3, 0.5), "q1"),
        pytest.param(_bounce, (0.0, 1.0, 1.0, 1.0, 1.0), "q0", marks=pytest.mark.slow),
        pytest.param(_refraction, (1.0, 1.0), "q0", marks=pytest.mark.slow),
        (_rope, (2.6, 0.0), "q0"),
        (_switch, (0.0, 1.0, 0.5), None),
    ],
)
def test_derivatives_by_events_between_the_ends_are_those_of_the_action(question, values, end):
    """First derivatives are those of S; the second ones, by the last value, those of the first."""
    first, slopes = question(*values)
    h, sides = 1e-4, []
    for slope, unit in zip(slopes, np.eye(len(values)), strict=True):
        sides = [question(*(np.array(values) + sign * h * unit))[0] for sign in (-1, 1)]
        assert slope == pytest.approx((sides[1].action - sides[0].action) / (2 * h), abs=2e-7)
    if end is not None:
        before, after = (x.sensitivity() for x in sides)
        found = getattr(first.sensitivity(), f"{end}{end}")[-1]
        change = getattr(after, end) - getattr(before, end)
        assert change / (2 * h) == pytest.approx(found, abs=1e-6)


@pytest.mark.long
def test_a_waypoint_on_a_constraint_moves_along_it():
    """On a circle that grows: the impulse has no part along its normal."""
    system = systems.thrown(g=1.0, constraint=lambda q, t: q @ q - 1 - 0.1 * t)

    def point(t, angle):
        return np.sqrt(1 + 0.1 * t) * np.array([np.sin(angle), -np.cos(angle)])

    def solution(angle=0.2, t=0.9, first=-0.5):
        events = [ao.Event(t, point(t, x)) for t, x in ((0.0, first), (t, angle), (2.0, 0.9))]
        problem = ao.Problem(system, events[0], events[2], through=[events[1]])
        return ao.solve(problem, tol=1e-12)

    found, h = solution(), 1e-4
    s = found.sensitivity()
    normal, along = point(0.9, 0.2), np.array([np.cos(0.2), np.sin(0.2)])
    assert found.impulses[0] @ normal == pytest.approx(0, abs=1e-12)
    slope = (solution(0.2 + h).action - solution(0.2 - h).action) / (2 * h)
    assert s.through_q[0] @ along * np.sqrt(1.09) == pytest.approx(slope, abs=1e-8)
    slope = (solution(t=0.9 + h).action - solution(t=0.9 - h).action) / (2 * h)
    moving = 0.05 * normal / 1.09
    assert s.through_t[0] + s.through_q[0] @ moving == pytest.approx(slope, abs=1e-7)
    h = 1e-3
    actions = [solution(first=-0.5 + x).action for x in (-h, 0, h)]
    along = np.array([np.cos(0.5), -np.sin(0.5)])
    bend = along @ s.q0q0 @ along - s.q0 @ point(0, -0.5)
    assert bend == pytest.approx((actions[0] - 2 * actions[1] + actions[2]) / h**2, abs=1e-6)


@pytest.mark.parametrize("where", ["end", "surface", "event"])
def test_what_an_event_leaves_free_follows_the_constraint(where):
    """On z = c (x + t) from x = 0 to b = u T lines: S = T (u^2 + c^2 (u + 1)^2) / 2."""
    system = systems.particle(
        "x y z", parameters={"c": 0.7}, constraint=lambda q, t, *, c: q[2] - c * (q[0] + t)
    )
    b, T, c = 1.1, 1.3, 0.7
    u = b / T
    by_b, by_T, by_c = u + c**2 * (u + 1), (c**2 - u**2 * (1 + c**2)) / 2, T * c * (u + 1) ** 2
    start, place = ao.Event(0, [0, 0, None]), ao.Event(T, [b, None, None])
    if where == "event":  # the other leg is from b to 0 in 0.7
        problem = ao.Problem(system, start, ao.Event(2, [0, None, None]), through=[place])
        w = -b / 0.7
        found = ao.solve(problem).sensitivity()
        by_b -= w + c**2 * (w + 1)
        by_T -= (c**2 - w**2 * (1 + c**2)) / 2
        by_c += 0.7 * c * (w + 1) ** 2
        at = found.through_q[0], found.through_t[0]
    elif where == "end":
        found = ao.solve(ao.Problem(system, start, place)).sensitivity()
        at = found.q1, found.t1
    else:
        line = ao.Event(T, None, on=lambda q, t, *, g: q[0] - g * t)
        found = ao.solve(ao.Problem(system, start, line, parameters={"g": u})).sensitivity()
        assert found.parameters["g"] == pytest.approx(by_b * T, rel=1e-9)
        by_b, by_T = 0.0, by_T + u * by_b
        at = found.q1, found.t1
    assert at[0] == pytest.approx([by_b, 0, 0], abs=1e-9)
    assert at[1] == pytest.approx(by_T, rel=1e-9)
    assert found.parameters["c"] == pytest.approx(by_c, rel=1e-9)


@pytest.mark.parametrize(
    ("more", "constraint", "exact"),
    [
        (lambda q, v, a: 0.0, None, 4.0),  # S = 4 a^3 / 3
        (lambda q, v, a: 3 * a * q[0] ** 2 * v[0], None, 12.0),  # and 2 a^4, of d(a q^3)/dt
        # S = 4 a^3 sqrt(1 + a^2) / 3
        (lambda q, v, a: v[1] ** 2 / 2, lambda q, t, *, a: q[1] - a * q[0], 14 * np.sqrt(2) / 3),
    ],
)
def test_a_parameter_that_moves_an_equilibrium_at_infinite_time(more, constraint, exact):
    rows = {} if constraint is None else {"constraint": constraint}
    kink = ao.System(
        lambda q, v, t, *, a: v[0] ** 2 / 2 + (q[0] ** 2 - a**2) ** 2 / 2 + more(q, v, a),
        ["x", "y"][: 1 + len(rows)],
        parameters={"a": 1.0},
        **rows,
    )
    ends = ao.Event(-np.inf, [-1.0] * kink.n), ao.Event(np.inf, [1.0] * kink.n)
    slope = ao.solve(ao.Problem(kink, *ends)).sensitivity().parameters["a"]
    assert slope == pytest.approx(exact, abs=1e-8)


def test_second_derivatives_along_a_circle_are_those_of_the_angles():
    """S = (b - a)^2 / (2 T) of a free motion: only moves along the circle count."""
    a, b, T = 0.3, 1.7, 2.0
    free = systems.particle("x y", constraint=lambda q, t: q @ q - 1)
    ends = [ao.Event(t, [np.cos(x), np.sin(x)]) for t, x in ((0.0, a), (T, b))]
    found = ao.solve(ao.Problem(free, *ends), tol=1e-10).sensitivity()
    along = [np.array([-np.sin(x), np.cos(x)]) for x in (a, b)]
    np.testing.assert_allclose(found.q0q0, np.outer(along[0], along[0]) / T, atol=1e-8)
    np.testing.assert_allclose(found.q0q1, -np.outer(along[0], along[1]) / T, atol=1e-8)
    np.testing.assert_allclose(found.q1q1, np.outer(along[1], along[1]) / T, atol=1e-8)


def test_an_end_in_contact_has_no_second_derivative():
    event = ao.Event(1.0, [0.0])

    def held(arcs, asked=event):
        original = SimpleNamespace(start=asked, end=asked)
        end = ao.Event(2.0, [0.0])
        return SimpleNamespace(start=event, end=end, arcs=arcs, original=original)

    for t, arc in ((1, Arc(0, 1.0, 1.5)), (2, Arc(0, 1.5, 2.0))):
        with pytest.raises(ValueError, match=f"found contact at t = {t}: an end moves"):
            _check_contacts(held((arc,)))
    _check_contacts(held((Arc(0, 1.2, 1.5),)))
    _check_contacts(held((Arc(0, 1.0, 1.5),), ao.Event(1.0, [None])))  # it is not given
    _check_contacts(held(None))


X, WEIGHTS = np.polynomial.legendre.leggauss(60)


@pytest.mark.parametrize(
    ("law", "start", "T", "rate"),
    [
        (
            lambda q, v, t, *, k: t**k * (v[0] ** 2 + q[0] ** 2) / 2,
            None,
            3.0,
            lambda q, v, t: t**3 * np.log(t) * (v**2 + q**2) / 2,
        ),
        (
            lambda q, v, t, *, k: v[0] ** 2 / 2 - 0.4 * abs(q[0]) ** k,
            0.0,
            1.0,
            lambda q, v, t: -0.4 * q**3 * np.log(q),
        ),
    ],
    ids=["power_of_t", "power_of_q"],
)
def test_derivatives_by_the_exponent_of_what_is_zero_at_an_end(law, start, T, rate):
    """That of x^k is x^k log x: nothing times minus infinity at x = 0."""
    problem = ao.Problem(
        ao.System(law, ["x"], parameters={"k": 3.0}), ao.Event(0.0, [start]), ao.Event(T, [1.0])
    )
    solution = ao.solve(problem, tol=1e-10)
    t = (X + 1) * T / 2
    q, v = solution(t)[0], solution.velocity(t)[0]
    slope = WEIGHTS @ rate(q, v, t) * T / 2
    assert solution.sensitivity().parameters["k"] == pytest.approx(slope, rel=1e-7)
    runs = ao.sweep(problem, {"k": [3.0], "t1": [T]})
    assert runs.slopes[0, 0] == pytest.approx([slope, -solution.energy(T)], rel=1e-7)


@pytest.mark.long
def test_an_infinite_rate_of_l_at_a_centre_counts_only_where_the_centre_moves():
    system = ao.System(lambda q, v, t: t**0.5 * (v[0] ** 2 + q[0] ** 2) / 2, ["x"])
    problem = ao.Problem(system, ao.Event(0.0, [None]), ao.Event(3.0, [1.0]))
    solution = ao.solve(problem)
    assert solution.sensitivity().t1 == pytest.approx(-solution.energy(3.0), rel=1e-7)
    slope = ao.sweep(problem, {"t1": [3.0]}).slopes[0, 0]
    assert slope == pytest.approx(-solution.energy(3.0), rel=1e-7)


def test_the_derivative_by_an_exponent_beside_a_smooth_table():
    angles = np.linspace(-2.0, 2.0, 41)
    table = ca.interpolant("V", "bspline", [angles], -np.cos(angles))

    def action(k):
        law = ao.System(
            lambda q, v, t, *, k: v[0] ** 2 / 2 - table(q[0]) - 0.1 * (1 + q[0] ** 2) ** k,
            ["x"],
            parameters={"k": k},
        )
        return ao.solve(ao.Problem(law, ao.Event(0.0, [0.0]), ao.Event(1.0, [1.0])), tol=1e-10)

    slope = (action(1.301).action - action(1.299).action) / 0.002
    assert action(1.3).sensitivity().parameters["k"] == pytest.approx(slope, rel=1e-5)
