"""Members of a family solved together, beside `solve` one by one."""

import casadi as ca
import numpy as np
import pytest
import systems
from helpers import at_once, same_bits

import actionopt as ao
from actionopt import scenes
from actionopt.analysis.status import Status
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.matrices.elimination import Inverses
from actionopt.discrete.matrices.factors import Factors
from actionopt.discrete.stacks import Factored, Stack, StackShape
from actionopt.families.sweeps import batch, budget
from actionopt.families.sweeps.batch import member, solve_run
from actionopt.families.sweeps.common_mesh import denser
from actionopt.families.sweeps.members import checked_columns
from actionopt.families.sweeps.scheduling import Front, weights
from actionopt.mechanics.laws.columns import Columns
from actionopt.solver.refinement import stacked_newton
from actionopt.solver.refinement.iterate import sizes

TOL = 1e-9


def random(seed, **ranges):
    """Return random values in ranges, 40 each, by the names of `solve_run`."""
    rng = np.random.default_rng(seed)
    names = {"end": ("end", "theta"), "start": ("start", "theta")}
    return {names.get(k, k): rng.uniform(a, b, 40) for k, (a, b) in ranges.items()}


def test_sizes_of_many_paths_are_those_of_each():
    Q = np.random.default_rng(3).normal(size=(4, 2, 3, 5)) - [[[[3.0]], [[0.5]]]]
    found, regular = stacked_newton._sizes(Q)
    each = [sizes(Q[..., k].transpose(0, 2, 1).reshape(-1, 2), np.ones(2)) for k in range(5)]
    assert np.array_equal(found, np.transpose(each)) and regular.all()


def spring():
    """A pendulum whose pivot is shaken, in a potential with parameters."""

    def lagrangian(q, v, t, *, k, b, a):
        return v[0] ** 2 / 2 - k * q[0] ** 2 / 2 - b * q[0] ** 4 / 4 + a * q[0] * np.cos(3 * t)

    system = ao.System(lagrangian, ["theta"], parameters={"k": 1.0, "b": 0.3, "a": 0.5})
    return ao.Problem(system, ao.Event(0.2, [0.4]), ao.Event(1.2, [1.0]))


FAMILIES = {
    "pendulum": lambda: (
        scenes.get("pendulum").problem,
        random(1, g=(8.0, 10.0), t1=(0.4, 0.9), end=(-0.8, 0.8)),
    ),
    "shaken": lambda: (spring(), random(2, k=(0.5, 1.5), t0=(-0.5, 0.5), a=(0.1, 1.0), b=(0, 0.5))),
    "double pendulum": lambda: _double(),
    "kepler": lambda: (
        scenes.get("kepler").problem,
        {"mu": np.linspace(0.9, 1.1, 40), ("end", "y"): 0.3 + 0.1 * np.sin(np.arange(40.0))},
    ),
    "free end": lambda: _free(),
    "closed": lambda: (
        driven(),
        {"a": np.linspace(0.1, 0.4, 40), "t1": 4 + np.linspace(0, 0.1, 40)},
    ),
    "lattice": lambda: (row(9, 1.0), {"beta": np.linspace(0.1, 0.2, 40)}),
    "long lattice": lambda: (row(9, 3.2), {"beta": np.linspace(0.1, 0.2, 40)}),
}


def driven():
    """A motion in the plane that answers a force: closed, of a period that is given."""

    def lagrangian(q, v, t, *, a):
        kept = 1 - np.cos(q[0]) + q[1] ** 2 + q[0] * q[1] / 3
        return v @ v / 2 - kept + a * (q[0] * np.cos(2 * t) + v[1] * q[0] / 5)

    system = ao.System(lagrangian, ["x", "y"], parameters={"a": 0.3})
    return ao.Problem(system, ao.Event(0.0, None), ao.Periodic(4.0))


def row(n, T):
    """Masses in a row, each pulled and turned by its neighbours alone."""

    def lagrangian(q, v, t, *, beta):
        d = q[1:] - q[:-1]
        turned = np.sum(q[1:] * v[:-1]) - np.sum(v[1:] * q[:-1])
        kept = d @ d / 2 + beta * np.sum(d**4) / 4 + q @ q
        return v @ v / 2 + v[1:] @ v[:-1] / 8 + turned / 4 - kept

    system = ao.System(lagrangian, [f"u{j}" for j in range(n)], parameters={"beta": 1.0})
    place = 0.3 * np.sin(np.arange(1.0, n + 1))
    return ao.Problem(system, ao.Event(0.0, place), ao.Event(T, -0.5 * place))


def _double():
    problem = scenes.get("double_pendulum").problem
    first, second = problem.system.coordinates
    rng = np.random.default_rng(3)
    columns = {("end", first): rng.uniform(-0.4, 0.0, 40), "t1": rng.uniform(0.5, 0.9, 40)}
    columns["start", second] = rng.uniform(0.2, 0.6, 40)
    return problem.replace(end=problem.end.at(0.8)), columns


def _free():
    def lagrangian(q, v, t, *, k):
        return (v[0] ** 2 + v[1] ** 2 + v[0] * v[1] * np.cos(q[0])) / 2 - k * np.cosh(q[1] - q[0])

    system = ao.System(lagrangian, ["x", "y"], parameters={"k": 1.0})
    problem = ao.Problem(system, ao.Event(0.0, [0.5, None]), ao.Event(1.0, [1.0, 0.3]))
    rng = np.random.default_rng(4)
    return problem, {"k": rng.uniform(0.5, 2, 40), ("start", "x"): rng.uniform(0.2, 0.8, 40)}


def apart(path, other):
    """Return the largest distance of two paths, in the coordinates' sizes."""
    t = np.linspace(*other.mesh.boundaries[[0, -1]], 200)
    size = np.abs(other(t)).max(axis=1, keepdims=True)
    return float((np.abs(path(t) - other(t)) / size).max())


@pytest.mark.quick("shaken")
@pytest.mark.parametrize("name", FAMILIES)
def test_members_are_what_solve_finds(name):
    problem, columns = FAMILIES[name]()
    found = solve_run(problem, columns, TOL, index=True)
    assert found.alone.sum() <= 5
    for i in range(0, 40, 4):
        alone = ao.solve(member(problem, columns, i), tol=1e-2 * TOL, guess=found.path(i))
        assert found.status[i] is Status.SOLVED
        assert apart(found.path(i), alone.path) <= found.error[i] + alone.error
        assert found.error[i] <= TOL
        assert found.action[i] == pytest.approx(alone.action, rel=1e-11, abs=1e-11)
        assert np.abs(found.momenta[i] - alone.momenta).max() < 1e-8
        assert found.index[i] == alone.morse_index


@pytest.mark.long
def test_the_same_bits_again():
    problem, columns = FAMILIES["pendulum"]()
    one, other = (solve_run(problem, columns, TOL) for _ in range(2))
    for a, b in zip((one.action, *one.values), (other.action, *other.values), strict=True):
        same_bits(a, b, because="the same operations are done again, in the same order")


@pytest.mark.long
def test_searches_beyond_a_fold_have_a_budget(monkeypatch):
    # One takes some hundred: motions show soon that none comes to the end.
    monkeypatch.setattr(budget, "FREE_BUDGET", budget.BUDGET // 100)
    c = np.linspace(3.0, 4.1, 24)
    found = solve_run(systems.bratu(), {"lam": c}, TOL)
    exists = c < 3.5138307
    assert found.success.tolist() == exists.tolist()
    # Of those that have none a few are searched for, at the price of many, the others not.
    assert np.array_equal(found.alone | found.unsought, ~exists | found.alone)
    assert 1 <= (found.alone & ~exists).sum() <= 2  # what is left of the budget ends the last one
    for i in np.flatnonzero(exists):
        middle = found.path(i)(0.5)[0]
        # The first integral at the middle, where the velocity is zero, closes the path in time 1.
        theta = np.arccosh(np.exp(middle / 2))
        assert 2 * np.arcsinh(np.sinh(theta)) == pytest.approx(
            np.sqrt(c[i] / 2) * np.exp(middle / 2), rel=1e-7
        )


@pytest.mark.long
def test_a_path_that_no_neighbour_leads_to_is_found_from_the_straight_line():
    """A double pendulum whose ends are all over the circle: `solve` finds each."""
    problem, angles = scenes.get("double_pendulum").problem, np.linspace(-np.pi, np.pi, 8)
    ends = np.array(np.meshgrid(angles[5:], angles)).reshape(2, -1)
    found = solve_run(problem, {("end", "theta1"): ends[0], ("end", "theta2"): ends[1]})
    assert found.success.all()


@pytest.mark.slow
def test_pulses_between_nodes_are_seen():
    def lagrangian(q, v, t, *, at, width):
        return v[0] ** 2 / 2 - q[0] ** 2 / 2 + 5 * q[0] * np.exp(-(((t - at) / width) ** 2))

    system = ao.System(lagrangian, ["x"], parameters={"at": 0.5, "width": 0.01})
    problem = ao.Problem(system, ao.Event(0.0, [1.0]), ao.Event(1.0, [0.5]))
    columns = {"at": np.linspace(-0.3, 0.8, 12)}
    found = solve_run(problem, columns, 1e-7)
    for i in range(12):
        alone = ao.solve(member(problem, columns, i), tol=1e-8)
        assert found.status[i] is Status.SOLVED
        assert apart(found.path(i), alone.path) < 2e-7


@pytest.mark.long
def test_members_that_want_a_finer_mesh_get_it():
    problem = scenes.get("kepler").problem
    columns = {("end", "x"): np.linspace(-1.5, -0.2, 30)}
    found = solve_run(problem, columns, TOL)
    assert len({found.mesh[i] for i in range(30)}) > 1
    assert found.success.all()
    for i in range(0, 30, 5):
        alone = ao.solve(member(problem, columns, i), tol=1e-11, guess=found.path(i))
        assert apart(found.path(i), alone.path) <= found.error[i] + alone.error


@pytest.mark.parametrize(
    ("degree", "elements", "degrees"), [(8, 3, {12}), (16, 3, {20}), (18, 6, {18})]
)
def test_a_denser_mesh_has_four_degrees_more_or_elements_of_half_the_length(
    degree, elements, degrees
):
    mesh = denser(ao.Mesh.uniform(0.5, 2.0, 3, degree))
    assert (mesh.elements, set(mesh.degrees)) == (elements, degrees)
    assert np.allclose(mesh.lengths, 1.5 / elements) and mesh.boundaries[0] == 0.5


@pytest.mark.long
def test_members_may_be_one_and_the_same():
    problem = scenes.get("pendulum").problem
    one = solve_run(problem, {"g": [9.0]})
    same = solve_run(problem, {"g": [9.0] * 5, "t1": [0.7] * 5})
    assert one.success.all() and same.success.all()
    assert np.ptp(same.action) < 1e-12


def test_who_is_refused_is_data():
    def lagrangian(q, v, t, *, m):
        return m * v[0] ** 2 / 2 - np.cos(q[0])

    system = ao.System(lagrangian, ["x"], parameters={"m": 1.0})
    problem = ao.Problem(system, ao.Event(0.0, [0.0]), ao.Event(1.0, [1.0]))
    found = solve_run(problem, {"m": [1.0, 0.5, 0.0, 0.8]})
    assert found.success.tolist() == [True, True, False, True]
    assert np.isnan(found.action[2]) or not found.status[2].success


def test_other_problems_are_solved_one_by_one():
    problem = scenes.get("drag_linear").problem
    name = next(iter(problem.parameters))
    value = float(problem.parameters[name])
    found = solve_run(problem, {name: value * np.array([1.0, 1.1, 1.2])})
    assert found.success.all() and found.alone.all()
    again = ao.solve(member(problem, {name: value * np.array([1.2])}, 0))
    assert found.action[2] == pytest.approx(again.action, rel=1e-9)


def test_members_with_constraints_take_a_factorization_from_where_those_before_lead():
    system = ao.System(
        lambda q, v, t, *, g: v @ v / 2 - g * q[1],
        ["x", "y"],
        parameters={"g": 9.0},
        constraint=lambda q, t: q @ q - 1,
    )
    problem = ao.Problem(system, ao.Event(0.0, [0.6, -0.8]), ao.Event(0.5, [0.0, -1.0]))
    found = solve_run(problem, {"g": np.linspace(9.0, 10.0, 8)})
    assert found.alone.all() and (found.iterations[3:] == 1).all()
    assert found.action[7] == pytest.approx(ao.solve(member(problem, {"g": [10.0]}, 0)).action)


@pytest.mark.long
def test_blocks_are_neighbours(monkeypatch):
    problem, columns = FAMILIES["pendulum"]()
    whole = solve_run(problem, columns, TOL)
    monkeypatch.setattr(batch, "BLOCK", 16)
    parts = solve_run(problem, columns, TOL)
    assert parts.success.all() and parts.alone.sum() <= 5
    assert np.allclose(parts.action, whole.action, rtol=1e-12)
    outwards = solve_run(problem, columns, TOL, first=20)
    assert outwards.success.all() and outwards.alone.sum() <= 5 and outwards.alone[20]
    assert np.allclose(outwards.action, whole.action, rtol=1e-12)


@at_once("counted", [True, False])  # row by row, and by inverses
@at_once("elements", [1, 3])
@at_once(
    "name",
    ["pendulum", "double_pendulum", "charge_gauge", "moving_pivot", "kepler_polar", "row"],
)
def test_stacks_are_the_transcription(name, elements, counted):
    problem = row(5, 2.0) if name == "row" else scenes.get(name).problem
    mesh = ao.Mesh.uniform(problem.start.t, problem.end.t, elements, 7)
    tr = Transcription(problem, mesh, problem.lengths)
    rng = np.random.default_rng(0)
    shape = StackShape(problem.system, mesh.moved(0.0, 1.0), ((), ()), tr.lengths, tr.action_unit)
    z = [tr.pack(tr.straight()) + 0.1 * rng.standard_normal(tr.layout.size) for _ in range(4)]
    times = np.tile([problem.start.t, problem.end.t], (4, 1))
    stack = Stack(shape, times, np.tile(problem.packed, (4, 1)))
    Q = shape.local(np.array([tr.coordinates(x) for x in z]))
    S, part, second = stack.action(Q), stack.gradient(Q), stack.second(Q)
    between = stack.samples(Q)
    factored = Factored(shape, stack.coefficients(second), counted=counted)
    steps, missed, followed = (
        shape.whole(stack.step(factored.solve(stack.rows(right))))
        for right in (
            part,
            stack.quadrature_defect(between, part, second, np.zeros(elements, dtype=bool)),
            stack.quadrature_defect(between, part, second, np.ones(elements, dtype=bool)),
        )
    )
    for i, x in enumerate(z):
        factors = Factors(tr.layout, tr.kkt(x))
        assert S[i] == pytest.approx(tr.action(x) * tr.action_unit, rel=1e-13)
        assert not counted or factored.negative[i] == factors.negative()
        for mine, right in (
            (steps, tr.residual(x)),
            (missed, tr.quadrature_defect(x, followed=False)[0]),
            *([(followed, tr.quadrature_defect(x)[0])] if problem.system.structure.samples else []),
        ):
            want = factors.solve(right)
            assert tr.pack(mine[i]) - tr.pack(0 * mine[i]) == pytest.approx(
                want, rel=1e-8, abs=1e-9 * np.abs(want).max() + 1e-12
            )


def test_of_singular_matrices_nothing_is_known():
    inside = Inverses(np.zeros((3, 3, 2)), 1)
    right = np.ones((3, 2))
    inside.forward(right)
    assert np.isnan(right).all()


def test_columns_know_what_casadi_does():
    x, y = ca.SX.sym("x", 2), ca.SX.sym("y")
    a, b = x[0], x[1]
    known = [
        *(f(a) for f in (ca.sin, ca.cos, ca.tan, ca.exp, ca.log, ca.sqrt, ca.tanh, ca.sinh)),
        *(f(b) for f in (ca.asin, ca.acos, ca.atan, ca.fabs, ca.sign, ca.floor, ca.ceil)),
        *(f(b) for f in (ca.cosh, ca.asinh, ca.atanh, ca.log1p, ca.expm1)),
        *(f(a, b) for f in (ca.fmin, ca.fmax, ca.atan2, ca.fmod, ca.hypot, ca.copysign)),
        *(a**2.5, a**b, 1 / a, -a, 2 * a, a**2, a / b, a - b, ca.if_else(b > y, a, y)),
        *(ca.logic_and(a > y, b < a), ca.logic_or(a > y, b != a), ca.logic_not(a <= y)),
        ca.acosh(2 + a),
    ]
    f = ca.Function("f", [x, y], [ca.vertcat(*known), ca.SX(3, 1) + 1])
    rng = np.random.default_rng(0)
    values, others = rng.uniform(0.1, 0.9, (5, 2, 7)), rng.uniform(0.1, 0.9, (1, 1, 7))
    found, ones = Columns(f)(5, 7, (values, others))
    for i in range(5):
        for j in range(7):
            want = np.array(f(values[i, :, j], others[0, :, j])[0]).ravel()
            assert found[i, :, j] == pytest.approx(want, rel=1e-14, abs=1e-15)
    assert (ones == 1).all()
    with pytest.raises(ValueError, match="instructions that numpy knows"):
        Columns(ca.Function("f", [x], [ca.erf(x)]))


@pytest.mark.parametrize("columns", [1, 2, 3])
def test_weights_are_of_an_interpolation(columns):
    rng = np.random.default_rng(columns)
    x = rng.uniform(-1, 1, (5, 12, columns))
    w = weights(x)
    assert w.sum(axis=1) == pytest.approx(1.0)
    slope = rng.standard_normal(columns)
    assert (w * (3 + x @ slope)).sum(axis=1) == pytest.approx(3.0, abs=1e-5)
    smooth = np.cos(0.5 * x @ slope)
    assert np.abs((w * smooth).sum(axis=1) - 1).max() < np.abs(smooth - 1).max() / 20
    assert weights(x[:, :1]) == pytest.approx(1.0)


def test_the_front_comes_to_everyone_and_goes_no_farther_than_it_is_let():
    rng = np.random.default_rng(0)
    at = rng.uniform(0, 1, (200, 2))
    known = np.zeros(200, dtype=bool)
    known[0] = True
    front, waves = Front(at), 0
    front.learn(np.array([0]), at[:1], ~known)
    while not known.all():
        chosen = front.wave(~known, known)
        assert chosen.size and not known[chosen].any()
        helped = chosen[front.near[chosen] < 0.2]  # from farther nobody is solved
        known[helped] = True
        assert front.near[helped] == pytest.approx(
            [np.linalg.norm(at[i] - at[front.nearest[i]]) for i in helped]
        )
        front.note_solved(chosen.size, helped.size)
        front.learn(helped, at[helped], ~known)
        waves += 1
    assert waves < 40
    lost = Front(at)
    lost.learn(np.array([0]), at[:1], np.arange(200) > 0)
    tried = 0
    while (chosen := lost.wave(np.arange(200) > 0, np.arange(200) < 1)).size:
        tried += chosen.size
        lost.note_solved(chosen.size, 0)
    assert tried <= 4 * 199


@at_once(
    ("columns", "words"),
    [
        ({}, "at least one quantity that differs, found none"),
        ({"t1": 1.0}, "expected a row of finite values of 't1', found 1.0"),
        ({"t1": [1.0, np.inf]}, "a row of finite values"),
        ({"t1": [1.0, 2.0], "t0": [0.0]}, "as many values of 't0' as of others, found 1"),
        ({"mass": [1.0]}, "found 'mass'; the parameters are none, the coordinates x"),
        ({("end", "y"): [1.0]}, "found .'end', 'y'."),
        ({("start", "x"): [1.0]}, "found .'start', 'x'."),
    ],
)
def test_columns_that_name_nothing_are_refused(columns, words):
    problem = ao.Problem(systems.particle(), ao.Event(0.0, [None]), ao.Event(1.0, [1.0]))
    with pytest.raises(ValueError, match=words):
        checked_columns(problem, columns)
    found = checked_columns(problem, {("end", "x"): [1, 2], "t1": [1.0, 2.0]})
    assert [x.tolist() for x in found.values()] == [[1.0, 2.0]] * 2
