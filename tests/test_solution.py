"""What a solution says of its path: shapes, ends, momenta, multipliers."""

from copy import deepcopy

import numpy as np
import pytest
import systems
from helpers import solved

import actionopt as ao
from actionopt import Event, Mesh, Problem, plot, scenes
from actionopt.analysis.status import Status
from actionopt.families.sweeps.grid import Grid
from actionopt.families.sweeps.path_store import PackedPaths


@pytest.fixture
def rod():
    return solved("rod_pendulum", m=1.5, l=0.8, tol=1e-12)


@pytest.fixture
def kepler():
    return solved("kepler", tol=1e-12)


# -- shapes ---------------------------------------------------------------------------------------


VECTORS = {"__call__": 2, "velocity": 2, "momentum": 2, "acceleration": 2, "constraint_force": 2}
ROWS = {**VECTORS, "multipliers": 1, "energy": None}


@pytest.mark.parametrize("method", ROWS)
@pytest.mark.parametrize("shape", [(), (1,), (7,), (3, 4)])
def test_shapes_follow_the_times(rod, method, shape):
    t = np.linspace(0.1, 0.9, int(np.prod(shape))).reshape(shape)
    rows = ROWS[method]
    values = getattr(rod, method)(t)
    assert values.shape == (shape if rows is None else (rows, *shape))
    last = getattr(rod, method)(float(t.ravel()[-1]))
    assert values[..., *([-1] * t.ndim)] == pytest.approx(last, rel=1e-12)


@pytest.mark.parametrize("method", ["__call__", "velocity"])
def test_no_times_give_no_columns(rod, method):
    assert getattr(rod, method)([]).shape == (2, 0)


@pytest.mark.parametrize("method", [name for name in ROWS if name not in ("__call__", "velocity")])
def test_no_times_give_no_momenta(rod, method):
    rows = ROWS[method]
    assert getattr(rod, method)([]).shape == ((0,) if rows is None else (rows, 0))


def test_without_constraints_there_are_no_multipliers(kepler):
    assert kepler.multipliers(0.5).shape == (0,)
    assert kepler.multipliers([0.1, 0.2]).shape == (0, 2)
    assert np.array_equal(kepler.constraint_force([0.1, 0.2]), np.zeros((2, 2)))
    assert kepler.lam.shape == (0, kepler.mesh.nodes.size)


@pytest.mark.parametrize("method", [*ROWS])
def test_no_extrapolation(rod, method):
    for t in (-0.1, 1.1, [0.5, 1.01]):
        with pytest.raises(ValueError, match="expected times within"):
            getattr(rod, method)(t)


def test_which_verdicts_are_on_stationary_paths():
    assert {x.name for x in Status if x.success} == {"SOLVED", "ON_MESH"}
    assert {x.name for x in Status if x.stationary} == {"SOLVED", "ON_MESH", "FLOOR"}


# -- what belongs together ------------------------------------------------------------------------


def test_the_ends_are_the_events(rod, kepler):
    for solution in (rod, kepler):
        problem = solution.problem
        for state, event, k in (
            (solution.start, problem.start, 0),
            (solution.end, problem.end, -1),
        ):
            assert state.t == event.t == solution.mesh.boundaries[k]
            assert np.array_equal(state.q, event.q)
            assert np.array_equal(solution(event.t), event.q)
        assert solution.success and solution.status is Status.SOLVED
        assert solution.path.mesh is solution.mesh
        assert solution.path(0.3) == pytest.approx(solution(0.3), rel=1e-15)


def test_pointwise_quantities_are_those_of_the_system(rod):
    system, parameters, t = rod.problem.system, rod.problem.parameters, np.linspace(0, 1, 9)
    q, v = rod(t), rod.velocity(t)
    for name in ("momentum", "energy", "acceleration", "multipliers", "constraint_force"):
        known = getattr(system, name)(q, v, t, parameters=parameters)
        assert np.array_equal(getattr(rod, name)(t), known)
    m, g = (float(parameters[name]) for name in "mg")
    assert rod.momentum(t) == pytest.approx(m * v, rel=1e-14)
    assert rod.energy(t) == pytest.approx(m * np.sum(v**2, axis=0) / 2 + m * g * q[1], rel=1e-12)


@pytest.mark.long
@pytest.mark.parametrize("name", ["kepler", "rod_pendulum", "turning_wire", "oscillating_wall"])
def test_velocities_at_the_ends_are_superconvergent(name):
    scene = scenes.get(name)
    t0, t1 = scene.problem.start.t, scene.problem.end.t
    exact = [scene.facts["velocity"](t) for t in (t0, t1)]
    size = np.max(np.abs(exact))

    def misses(elements, degree=3):
        mesh = Mesh.uniform(t0, t1, elements, degree)
        solution = ao.solve(scene.problem, mesh=mesh, guess=scene.exact)
        pairs = zip((solution.start, solution.end), exact, strict=True)
        momenta = [np.max(np.abs(state.v - v)) for state, v in pairs]
        slopes = [
            np.max(np.abs(solution.path.velocity(t) - v))
            for t, v in zip((t0, t1), exact, strict=True)
        ]
        return np.array([max(momenta), max(slopes)]) / size

    coarse, fine = misses(8), misses(16)
    orders = np.log2(coarse / fine)
    assert orders[0] > 5.3  # 2d = 6
    assert orders[1] < 4.2  # the derivative of the polynomial has order d = 3
    assert fine[0] < fine[1] / 30


@pytest.mark.long
def test_momenta_are_derivatives_of_the_action():
    # p0 = -dS/dq0, p1 = dS/dq1 and dS/dt1 = -H(t1), by differences of solved problems.
    scene = scenes.get("kepler")
    system, h = scene.problem.system, 1e-3
    q0, q1, T = np.array(scene.problem.start.q), np.array(scene.problem.end.q), 2.0
    q1 = scene.exact(T)

    def S(q0, q1, T):
        return ao.solve(Problem(system, Event(0, q0), Event(T, q1)), tol=1e-12).action

    solution = ao.solve(Problem(system, Event(0, q0), Event(T, q1)), tol=1e-12)

    def slope(f):  # sixth order: error h^6 and rounding 1e-13 / h
        return (45 * (f(h) - f(-h)) - 9 * (f(2 * h) - f(-2 * h)) + f(3 * h) - f(-3 * h)) / (60 * h)

    for i, e in enumerate(np.eye(2)):
        p0 = -slope(lambda s, e=e: S(q0 + s * e, q1, T))
        p1 = slope(lambda s, e=e: S(q0, q1 + s * e, T))
        assert solution.momenta[0][i] == pytest.approx(p0, abs=1e-9)
        assert solution.momenta[1][i] == pytest.approx(p1, abs=1e-9)
    assert -solution.energy(T) == pytest.approx(slope(lambda s: S(q0, q1, T + s)), abs=1e-9)


def test_momenta_of_constrained_motions_are_tangent(rod):
    m = float(rod.problem.parameters["m"])
    for state, p in zip((rod.start, rod.end), rod.momenta, strict=True):
        assert p == pytest.approx(m * state.v, rel=1e-12)
        assert abs(p @ state.q) <= 1e-12 * np.linalg.norm(p)


# -- multipliers ----------------------------------------------------------------------------------


def test_multipliers_of_the_nodes_are_those_of_the_equations(rod):
    nodes, m = rod.mesh.nodes, 1
    assert rod.lam.shape == (m, nodes.size)
    assert np.isnan(rod.lam[:, [0, -1]]).all()
    inner = slice(1, -1)
    difference = rod.lam[:, inner] - rod.multipliers(nodes[inner])
    assert np.max(np.abs(difference)) <= 1e-5 * np.max(np.abs(rod.lam[:, inner]))


def has_known_multipliers(name):
    scene = scenes.get(name)
    return scene.exact is not None and "multipliers" in scene.facts


@pytest.mark.quick("rod_pendulum", "rolling_cylinder", "sliding_off_circle", "turning_wire")
@pytest.mark.parametrize("name", list(filter(has_known_multipliers, scenes.SCENES)))
def test_multipliers_are_those_of_the_book(name):
    scene = scenes.get(name)
    known = scene.facts["multipliers"]
    solution = ao.solve(scene.problem, tol=1e-12, guess=scene.guess)
    t = np.linspace(scene.problem.start.t, scene.problem.end.t, 101)
    lam = known(scene.exact(t), scene.facts["velocity"](t), t)
    assert np.max(np.abs(solution.multipliers(t) - lam)) <= 1e-8 * np.max(np.abs(lam))
    assert np.max(np.abs(1.00001 * solution.multipliers(t) - lam)) > 1e-8 * np.max(np.abs(lam))


# -- what is computed when asked ------------------------------------------------------------------


def test_costly_things_are_made_once_and_on_demand():
    system = systems.pendulum("x")
    solution = ao.solve(Problem(system, Event(0, 0.2), Event(1, 0.5)))
    assert "inertia" not in vars(solution) and "_comparison" not in vars(solution)
    assert solution.morse_index == 0 and solution.kind == "minimum"
    assert solution.compare() is solution.compare()
    assert solution.compare().position <= 1e-7


def test_numbers_cannot_be_overwritten(rod, kepler):
    for array in (kepler.path.values, kepler.start.q, kepler.start.v, kepler.mesh.boundaries):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0
    for array in (*kepler.momenta, *rod.momenta):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0
    with pytest.raises(AttributeError):
        kepler.action = 0.0


@pytest.mark.long
def test_a_deep_copy_says_the_same_and_shares_only_the_system(rod, kepler):
    for solution in (rod, kepler):
        assert solution.momenta and solution.compare().agrees  # kept, and so copied
        other = deepcopy(solution)
        assert other.problem.system is solution.problem.system
        assert other.path.values is not solution.path.values
        assert np.array_equal(other([0.1, 0.5]), solution([0.1, 0.5]))
        assert np.array_equal(other.energy([0.1, 0.5]), solution.energy([0.1, 0.5]))
        assert np.array_equal(other.momenta, solution.momenta)
        assert (other.action, other.morse_index) == (solution.action, solution.morse_index)
        other.stats["rung"] = "changed"
        assert solution.stats["rung"] != "changed"
        again = ao.solve(solution.problem, guess=other, tol=1e-12)
        assert again.action == pytest.approx(solution.action, rel=1e-12)


def test_what_is_no_solution_is_refused(rod):
    asks = ao.conjugate_points, ao.second_variation, ao.monodromy, ao.contact_loss
    for ask in (*asks, lambda x: ao.variation(x, lambda t: [t]), lambda x: plot.save(x, "x.png")):
        with pytest.raises(ValueError, match=r"expected a Solution.*solve it first"):
            ask(rod.problem)
    with pytest.raises(ValueError, match="give its `problem`"):
        plot.page(rod, "page.html")


@pytest.mark.parametrize("ask", ["momentum", "energy", "acceleration", "multipliers", "velocity"])
def test_times_are_plain_numbers(rod, ask):
    with pytest.raises(ValueError, match="expected a number or an array of numbers for the times"):
        getattr(rod, ask)("noon")


def test_what_is_printed_is_short_and_says_what_matters(rod):
    unknowns = rod.discrete.tr.layout.unknowns
    assert (
        str(rod)
        == repr(rod)
        == (
            f"Solution(rod_pendulum: SOLVED, S = {rod.action:.8g}, error {rod.error:.1e}, "
            f"elements {rod.mesh.elements}, unknowns {unknowns})"
        )
    )
    assert str(rod.status) == f"{rod.status}" == rod.status.value
    system = systems.particle()
    bare = ao.solve(Problem(system, Event(0, 0.0), Event(1, 1.0)))
    assert repr(bare).startswith("Solution(problem: SOLVED, S = 0.5, ")
    shown = [rod.path, rod.mesh, rod.compare(), ao.trace(scenes.get("pendulum").problem, "g", 9.0),
             ao.variation(bare, lambda t: t * (1 - t))]  # fmt: skip
    for symmetry in ao.find_symmetries(system):
        shown += [symmetry, symmetry.conserved]
    assert len(shown) > 6
    for thing in shown:
        assert "array(" not in repr(thing) and "SX" not in repr(thing) and len(repr(thing)) < 350


def test_errors_of_velocities_are_relative_to_the_largest():
    """x = cos t over three turns is fast where it passes zero and at rest where it turns."""
    system = systems.oscillator()
    T = 6 * np.pi + 0.5
    problem = Problem(system, Event(0.0, [1.0]), Event(T, [np.cos(T)]))
    solution = ao.solve(problem, mesh=Mesh.uniform(0.0, T, 12, 8))
    t = np.linspace(0.0, T, 400)
    true = np.max(np.abs(solution.velocity(t)[0] + np.sin(t)))
    assert true <= solution.velocity_error <= 100 * true


def test_velocities_at_events_are_those_of_the_momenta():
    """An oscillator is kicked at an event; its polynomials' slopes are off by more than 1e-6."""
    spring = ao.System(lambda q, v, t: v @ v / 2 - q @ q / 2, ["x"])
    times, places = np.array([0.0, 1.4, 3.1]), np.array([0.3, 1.0, -0.5])
    first, kicked, last = (Event(t, x) for t, x in zip(times, places, strict=True))
    found = ao.solve(Problem(spring, first, last, through=[kicked]), tol=1e-3)
    c, s = np.cos(np.diff(times)), np.sin(np.diff(times))
    leave, arrive = (places[1:] - places[:-1] * c) / s, (places[1:] * c - places[:-1]) / s
    for k, leg in enumerate(found.legs):
        ends = [leave[k], arrive[k]]
        np.testing.assert_allclose(leg.velocity(times[k : k + 2])[0], ends, atol=1e-9)
    after = np.array([*leave, arrive[-1]])
    np.testing.assert_allclose(found.velocity(times)[0], after, atol=1e-9)
    assert found.velocity(1.4) == pytest.approx(leave[1:], abs=1e-9)
    np.testing.assert_allclose(found.energy(times), (after**2 + places**2) / 2, atol=1e-9)
    assert np.abs(found.path.velocity(times)[0] - after).max() > 1e-6


@pytest.fixture(scope="module")
def swing():
    return ao.solve(ao.Problem(systems.pendulum(), ao.Event(0.0, [0.5]), ao.Event(2.0, [-0.3])))


def test_the_abbreviated_action_is_that_at_the_energy(swing):
    E = swing.energy(0.0)
    assert swing.abbreviated_action == pytest.approx(swing.action + E * 2.0, rel=1e-7)


def test_what_is_inside_is_printed_in_a_line(swing):
    size = swing.discrete.tr.layout.size
    assert repr(swing.discrete) == f"DiscretePath({swing.mesh!r}, {size} unknowns and multipliers)"
    grid = Grid.of(swing.problem, {"t1": [1.5, 2.0]}, False)
    assert repr(grid) == "Grid(t1: 2 from 1.5 to 2)"
    assert repr(PackedPaths.of(np.arange(2), [swing.path] * 2)) == "PackedPaths(2 paths)"


def test_the_program_of_a_path_under_a_constraint():
    rod = systems.particle("x y", constraint=lambda q, t: q @ q - 1)
    s = ao.solve(ao.Problem(rod, ao.Event(0.0, [1.0, 0.0]), ao.Event(1.0, [0.0, 1.0])))
    program, Q = s.opti()
    program.solver("ipopt", {"print_time": 0, "ipopt.print_level": 0, "ipopt.sb": "yes"})
    found = program.solve()
    assert float(found.value(program.f)) == pytest.approx((np.pi / 2) ** 2 / 2, rel=1e-6)
    np.testing.assert_allclose(found.value(Q), s(s.mesh.nodes), atol=1e-6)
