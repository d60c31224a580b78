"""Laws from tables, and functions of CasADi's that laws call."""

from __future__ import annotations

import pickle

import casadi as ca
import numpy as np
import pytest
from helpers import at_once
from scipy.integrate import solve_ivp

import actionopt as ao
from actionopt.discrete.meshes.boundaries import carry_boundaries
from actionopt.mechanics.laws.compiled import Pointwise
from actionopt.mechanics.laws.expressions import Expressions
from actionopt.mechanics.laws.lookups import Looked
from actionopt.mechanics.laws.tables import interp, knots
from actionopt.tools.tape import Tape

RANDOM = np.random.default_rng(2)


@at_once("count", [1, 5, 40])
@at_once(
    "named", [{}, {"left": 7.0}, {"left": 1.0, "right": -2.0}, {"period": 7.3}, {"period": 2.1}]
)
def test_a_table_of_an_expression_is_that_of_numbers(count, named):
    points, values = np.sort(RANDOM.uniform(-3, 3, count)), RANDOM.normal(size=count)
    at = np.r_[RANDOM.uniform(-5, 5, 40), points]
    x, y = ca.SX.sym("x"), ca.SX.sym("y", count)
    for given in (values, Expressions(y, 1)):
        found = np.interp(Expressions(x, 0), points, given, **named)
        function = ca.Function("f", [x, y], [found.sx]).map(at.size)
        there = function(at[None], np.tile(values[:, None], at.size))
        exact = np.interp(at, points, values, **named)
        assert np.allclose(np.array(there).ravel(), exact, rtol=0, atol=1e-13)


@pytest.mark.parametrize(
    "points, values",
    [([0, 1, 1], [0, 1, 2]), ([0, 1], [0, 1, 2]), ([], []), ([0, np.inf], [0, 1])],
)
def test_points_of_a_table_increase_and_are_as_many_as_its_values(points, values):
    with pytest.raises(ValueError, match=r"np\.interp failed on expressions \(expected"):
        ao.System(lambda q, v, t: v[0] ** 2 / 2 - np.interp(q[0], points, values), ["x"])


@pytest.mark.long
def test_elements_end_where_a_table_in_the_time_has_its_kinks():
    times, force = np.linspace(-0.1, 1.05, 20), RANDOM.normal(size=20)
    system = ao.System(
        lambda q, v, t, *, f: v[0] ** 2 / 2 - q[0] ** 2 / 2 + np.interp(t, times, f) * q[0],
        ["x"],
        parameters={"f": force},
    )
    solution = ao.solve(ao.Problem(system, ao.Event(0, [0.0]), ao.Event(1, [0.7])), tol=1e-10)
    inner = times[(times > 0) & (times < 1)]
    assert np.allclose(solution.mesh.boundaries[1:-1], inner, atol=1e-15)
    state = [0.0, solution.start.v[0]]

    def rate(t, y):
        return [y[1], np.interp(t, times, force) - y[0]]

    for a, b in zip(solution.mesh.boundaries, solution.mesh.boundaries[1:], strict=False):
        state = solve_ivp(rate, (a, b), state, rtol=1e-8, atol=1e-9).y[:, -1]
    assert abs(state[0] - 0.7) < 1e-6
    # dS/df_k is the integral of the path times the hat over its time.
    t = np.linspace(0, 1, 20001)
    hats = np.array([np.interp(t, times, row) for row in np.eye(20)])
    slopes = np.trapezoid(hats * solution(t)[0], t, axis=1)
    assert np.allclose(solution.sensitivity().parameters["f"], slopes, atol=1e-6)


@pytest.mark.parametrize("kind", ["linear", "bspline"])
def test_steps_behind_a_function_that_is_called_are_found(kind):
    times = np.linspace(-0.1, 1.1, 25)
    table = ca.interpolant("f", kind, [times], np.sin(3 * times))
    system = ao.System(
        lambda q, v, t: v[0] ** 2 / 2 + ca.if_else(table(t) < 0.4, 1, 0) * q[0], ["x"]
    )
    solution = ao.solve(ao.Problem(system, ao.Event(0, [0.0]), ao.Event(1, [0.5])), tol=1e-10)
    assert solution.mesh.elements < 2 * (5 if kind == "bspline" else 25)
    assert solution.compare().position < 1e-12


def test_calls_of_several_results_are_read_from_a_tape():
    a, m = ca.SX.sym("a", 2), ca.SX.sym("m", 2, 2)
    results = [ca.vertcat(a[0] ** 2, a[1], 3 + m[0, 1]), a[0] * a[1]]
    called = ca.Function("called", [a, m], results, {"never_inline": True})
    y = ca.SX.sym("y", 2)
    first, second = called(y, ca.vertcat(y.T, 3 * y.T))
    wanted = [ca.vertcat(first[2] + second * first[0], ca.sin(y[0])), first[0] * 3]
    tape = Tape([y], wanted)

    def again(node, operands):
        if node.kind == "operation":
            return node.of(operands)
        return y[node.entry[1]] if node.kind == "input" else ca.SX(node.value)

    made = tape.fold(again)
    found = [ca.vertcat(*[made[k] for k in row]) for row in tape.results]
    both = [ca.Function("f", [y], [ca.vertcat(*x)])([0.3, 0.7]).full() for x in (wanted, found)]
    assert np.array_equal(*both)


@pytest.mark.parametrize("kind", ["linear", "bspline"])
def test_tables_without_derivatives_by_their_values_are_refused(kind):
    table = ca.interpolant("V", kind, [np.arange(6.0).tolist()], 1)
    system = ao.System(
        lambda q, v, t, *, c: v[0] ** 2 / 2 - table(q[0], c), ["x"], parameters={"c": np.ones(6)}
    )
    with pytest.raises(ValueError, match="derivatives by their values"):
        ao.solve(ao.Problem(system, ao.Event(0, [1.0]), ao.Event(1, [2.0])))


def test_tables_whose_values_are_parameters_are_looked_up():
    """Where CasADi evaluates them it copies all parameters at each time."""
    times, other = np.linspace(0, 1, 9) ** 2, np.linspace(-1, 2, 5)

    def law(q, v, t, *, f, c, g):
        steps = c[1] * np.interp(2 * t + c[0], other, g) + np.interp(t, times, f)
        return v[0] ** 2 / 2 + steps * q[0] + np.interp(t, other, other)

    values = {"f": RANDOM.normal(size=9), "c": [0.1, 0.7], "g": RANDOM.normal(size=5)}
    system = ao.System(law, ["x"], parameters=values)
    t = np.r_[times, other, np.nextafter(times, 2), RANDOM.uniform(-2, 3, 30)][:, None]
    q, v = RANDOM.normal(size=(2, t.size, 1))
    packed = RANDOM.normal(size=(t.size, 16))
    for name in ("value", "first", "balance", "second"):
        function = system.pointwise(name)
        again = pickle.loads(pickle.dumps(function))
        for p in (packed, packed[:1]):
            known = [y.copy() for y in Pointwise(function.function)(q, v, t, p)]
            for one in (function, again):
                assert type(one) is Looked
                for y, wanted in zip(one(q, v, t, p), known, strict=True):
                    np.testing.assert_allclose(y, wanted, atol=1e-13)
    assert system.clock is not None and isinstance(system.clock.steps, Looked)


def test_tables_of_other_values_than_parameters_are_evaluated_by_casadi():
    times = np.linspace(0, 1, 9)
    system = ao.System(
        lambda q, v, t, *, f: v[0] ** 2 / 2 + np.interp(t, times, f**2) * q[0],
        ["x"],
        parameters={"f": np.arange(9.0)},
    )
    assert type(system.pointwise("first")) is Pointwise
    solution = ao.solve(ao.Problem(system, ao.Event(0, [0.0]), ao.Event(1, [1.0])))
    assert solution.compare().agrees


@pytest.mark.long
def test_the_cost_of_a_table_in_the_time_is_linear_in_its_points():
    times = np.linspace(0, 1, 3000)  # more than are sampled
    force = np.sin(7 * times)
    system = ao.System(lambda q, v, t: v[0] ** 2 / 2 + np.interp(t, times, force) * q[0], ["x"])
    solution = ao.solve(ao.Problem(system, ao.Event(0, [0.0]), ao.Event(1, [1.0])))
    assert solution.mesh.elements == 2999


def test_kinks_in_time_are_no_drift_of_the_energy():
    times, force = np.linspace(0, 1, 20), 30 * RANDOM.normal(size=20)
    system = ao.System(lambda q, v, t: v[0] ** 2 / 2 + np.interp(t, times, force) * q[0], ["x"])
    compared = ao.solve(ao.Problem(system, ao.Event(0, [0.5]), ao.Event(1, [1.0]))).compare()
    assert compared.agrees
    assert compared.energy_drift < 1e-10


def test_boundaries_stay_at_kinks_while_the_end_passes_others():
    kink, next_kink = (0.7, np.nextafter(0.7, 1)), (1.3, np.nextafter(1.3, 2))
    mesh = ao.Mesh([0.0, 0.7, 1.0, 1.2], 4)
    there = carry_boundaries(mesh, (kink,), (kink, next_kink), 0.0, 1.5)
    assert there.boundaries == pytest.approx([0.0, 0.7, 1.18, 1.5], abs=1e-15)


@pytest.mark.long
@pytest.mark.parametrize("kind", ["numpy", "casadi", "casadi, many points"])
def test_a_spike_between_two_points_of_a_table_in_q_is_not_passed_unseen(kind):
    width, where = 3e-4, 0.2
    points = np.r_[np.linspace(-3, where - width, 20), where, np.linspace(where + width, 3, 20)]
    if kind == "casadi, many points":
        points = np.r_[-3:where:width, where:3:width]
    values = np.where(points == where, -0.03 / width, 0.0)
    table = ca.interpolant("V", "linear", [points], values)
    system = ao.System(
        lambda q, v, t: (
            v[0] ** 2 / 2 - (np.interp(q[0], points, values) if kind == "numpy" else table(q[0]))
        ),
        ["x"],
    )
    problem = ao.Problem(system, ao.Event(0, [-1.0]), ao.Event(0.4, [1.0]))
    assert not ao.solve(problem, throw=False).success


def test_bends_of_tables_of_casadi_are_read():
    few, many, thirds = np.array([0.0, 1 / 3, 2.0]), np.linspace(0, 1, 300), np.arange(300) / 3
    spike = np.where(np.arange(300) == 7, 1.0, np.sin(many))
    for points, values, known in (
        (few, few[::-1], few),
        (few, np.arange(6.0), few),
        (many, spike, many[6:9]),
        (many, np.sin(many), []),
        (thirds, np.sin(9 * many), []),
    ):
        assert np.array_equal(knots(ca.interpolant("V", "linear", [points], values)), known)
    grid = ca.interpolant("V", "linear", [few, few], np.arange(9.0))
    assert not knots(grid).size
    assert not knots(ca.interpolant("V", "bspline", [many], many)).size


def test_symmetries_of_a_law_that_calls_a_function():
    table = ca.interpolant("V", "bspline", [np.linspace(0.0, 9.0, 20)], np.linspace(0, 3, 20) ** 3)
    system = ao.System(lambda q, v, t: v @ v / 2 - table(q @ q), ["x", "y"])
    assert [str(x) for x in ao.find_symmetries(system)] == ["t: 1", "x: -y, y: x"]


def test_periods_of_tables_are_those_of_numpy_where_ends_agree():
    x, y = np.linspace(0.0, 0.3, 20), np.r_[np.arange(19.0), 0.0]
    at, t = ca.SX.sym("t"), np.linspace(-0.4, 0.9, 50)
    for period in (0.3, -0.3):
        table = ca.Function("f", [at], [interp(at, x, y, period=period)])
        np.testing.assert_allclose(
            table(t[None]).full()[0], np.interp(t, x, y, period=0.3), atol=1e-12
        )
    for period, values, sentence in ((0.0, y, "not zero"), (0.3, np.arange(20.0), "apart")):
        with pytest.raises(ValueError, match=sentence):
            interp(at, x, values, period=period)
