"""Newton's method near a path: one step where equations are linear, quadratic elsewhere."""

from types import SimpleNamespace

import numpy as np
import pytest
import systems
from helpers import at_once, motion, transcribed

from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.matrices.factors import Factors
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.newton.newton import CONTRACTION, _residual_change, _steps, follow
from actionopt.mechanics.question.problem import Event, Problem
from actionopt.mechanics.system import System
from actionopt.solver.solve import solve

ROUNDING = 1e-12  # of a path of order one after a solve with a condition of some thousands


PENDULUM = systems.pendulum(g=9.81)


def swing(T=0.8, rate=2.0):
    """Return a transcription of the pendulum and its motion at the nodes, (K, 1)."""
    run = motion(PENDULUM, [0.2], [rate], 0.0, T)
    tr = transcribed(PENDULUM, ([0.2], run(T)), T, 4, 14)
    return tr, run(tr.mesh.nodes).T


LINEAR = {
    "oscillator": (System(lambda q, v, t: v[0] ** 2 / 2 - 2 * q[0] ** 2, ["x"]), ([1], [2])),
    "drag": (
        systems.particle(force=lambda q, v, t: [-3 * v[0] - q[0]]),
        ([1], [2]),
    ),
    "slope": (
        System(
            lambda q, v, t: (v[0] ** 2 + v[1] ** 2) / 2 - q[1] * np.cos(t),
            ["x", "y"],
            constraint=lambda q, t: q[0] - 2 * q[1] + np.sin(t) * 0,
        ),
        ([0, 0], [2, 1]),
    ),
}


@at_once("elements", [2, 30])
@at_once("name", LINEAR)
def test_linear_systems_take_one_step_from_anywhere(name, elements):
    system, ends = LINEAR[name]
    tr = transcribed(system, ends, 1.3, elements, 8)
    start = np.random.default_rng(0).normal(size=tr.layout.size)
    far, near = follow(tr, 100 * start, linear=True), follow(tr, 0 * start, linear=True)
    for result in (far, near):
        assert result.converged and result.iterations == 1
        assert np.max(np.abs(tr.residual(result.z))) <= ROUNDING * 100
        assert result.noise <= ROUNDING
    assert follow(tr, start, linear=True, target=0.0).iterations == 1  # what is left is rounding
    cut = tr.layout.unknowns
    assert np.max(np.abs(far.z - near.z)[:cut]) <= 100 * ROUNDING
    assert far.travelled == pytest.approx(np.max(np.abs(far.z - 100 * start)[:cut]), rel=1e-12)


def test_factors_of_a_matrix_near_serve_to_follow_a_path():
    tr, exact = swing()
    own = follow(tr, tr.pack(exact))
    bump = 1e-6 * np.sin(np.pi * tr.mesh.nodes / 0.8)[:, None]
    z = tr.pack(exact + bump)
    found = follow(tr, z, near=(Factors(tr.layout, tr.kkt(z)), 0.0))
    assert found.converged and found.iterations == 0
    assert np.abs(found.z - own.z).max() <= ROUNDING
    assert found.since == pytest.approx(np.abs(found.z - z).max())
    far = follow(tr, z, near=(Factors(tr.layout, -tr.kkt(z)), 0.0))  # which lead away
    assert far.converged and far.iterations > 0
    assert np.abs(far.z - own.z).max() <= ROUNDING


def test_newton_contracts_quadratically():
    tr, exact = swing()
    errors = []
    for size in (0.2, 0.1, 0.05):
        bump = size * np.sin(np.pi * tr.mesh.nodes / 0.8)[:, None]
        z = follow(tr, tr.pack(exact + bump), steps=1).z
        errors.append(np.max(np.abs(tr.coordinates(z) - exact)))
    # One factorization used twice leaves the cube of the distance.
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(orders > 2.7)


@pytest.mark.long
def test_a_start_with_no_path_near_is_refused():
    tr, exact = swing(T=6.0)
    for size in (3, 10):
        wild = size * np.cos(7 * tr.mesh.nodes)[:, None]
        result = follow(tr, tr.pack(exact + wild))
        assert not result.converged
        assert result.iterations <= 3  # it notices at once
        assert np.all(np.isfinite(result.z))


def test_a_singular_matrix_is_no_path():
    # A coordinate without inertia or potential: L does not contain it.
    system = System(lambda q, v, t: v[0] ** 2 / 2 + np.cos(q[0]) + 0 * q[1], ["x", "y"])
    for elements in (2, 30):
        tr = transcribed(system, ([0, 0], [1, 1]), 1.0, elements, 4)
        result = follow(tr, tr.pack(tr.straight()))
        assert not result.converged


def test_values_that_are_not_finite_are_no_path():
    # Straight through the centre of attraction.
    system = systems.kepler()
    tr = transcribed(system, ([-1, 0], [1, 0]), 1.0, 2, 4)
    assert not follow(tr, tr.pack(tr.straight())).converged


def test_the_noise_tells_the_accuracy_of_a_badly_conditioned_path():
    # The end is nearly conjugate: the end point determines the path to 1 / (w T - pi) only.
    gap = 1e-7
    system = systems.oscillator()
    T = np.pi + gap
    tr = transcribed(system, ([1.0], [-1.0]), T, 6, 12)
    t = tr.mesh.nodes
    exact = (np.sin(T - t) - np.sin(t)) / np.sin(T)
    result = follow(tr, tr.pack(tr.straight()), linear=True)
    error = np.max(np.abs(tr.coordinates(result.z)[:, 0] - exact))
    assert 1e-13 < error < 1e-6
    assert error / 100 <= result.noise <= 1e-6


@at_once("gap", [1e-2, 1e-5, 1e-7])
@at_once("m", [1.0, 1e6])
@at_once("elements", [6, 30])
def test_a_path_of_zeros_is_as_uncertain_as_one_beside_it(gap, m, elements):
    """Its residual is exactly zero, and says nothing; what moves the other moves it as well."""
    system = System(lambda q, v, t: m * (v[0] ** 2 - q[0] ** 2) / 2, ["x"])
    noise = []
    for end in (0.0, 1.0):
        problem = Problem(system, Event(0.0, [end]), Event(np.pi + gap, [-end]))
        mesh = Mesh.uniform(0.0, np.pi + gap, elements, 12)
        tr = Transcription(problem, mesh, np.ones(1))
        result = follow(tr, tr.pack(tr.straight()), linear=True)
        assert result.converged
        noise.append(result.noise)
    # The one has round-off of any sign in each row, the other as much as there may be.
    assert noise[1] <= noise[0] <= 1e5 * noise[1]


@at_once("size", [-2.0, 0.0, 1.5])
@at_once("side", [1.0, -1.0])
def test_any_path_of_a_family_is_one_that_hardly_is_determined(side, size):
    """Between conjugate ends: cos t + B sin t for every B. The matrix is singular to rounding."""
    system = systems.oscillator()
    tr = transcribed(system, ([side], [-side]), np.pi, 6, 14)
    t = tr.mesh.nodes[:, None]
    member = side * (np.cos(t) + size * np.sin(t))
    result = follow(tr, tr.pack(member))
    assert result.converged
    assert result.noise > 1e-6  # hardly determined


def test_a_second_simplified_step_that_grows_asks_for_another_matrix():
    """Near a singular matrix that of the last iterate moves a path too far; Newton's own does not.

    Taken for round-off, it made the mesh of a chain of 100 links twice as large.
    """
    lengths = iter([1e-4, 1e-8, 1e-6])
    factors = SimpleNamespace(cheap=True, solve=lambda right: np.array([next(lengths)]))
    tr = SimpleNamespace(residual=lambda z: z, relative_step=lambda step: abs(step[0]))
    z = np.ones(1)
    _, rest, ratio, converged, first = _steps(tr, factors, z, z, False, 1e-14, None)
    assert not converged and rest == 1e-6 and ratio == CONTRACTION and first == 1e-4


def test_the_matrix_of_a_steady_linear_system_is_factorized_once_for_all_ends():
    """Not where its parameters or times are others."""
    system = System(
        lambda q, v, t, *, k: v[0] ** 2 / 2 - k * q[0] ** 2 / 2, ["x"], parameters={"k": 1.0}
    )

    def exact(problem):
        (a,), (b,), T = problem.start.q, problem.end.q, problem.duration
        w = np.sqrt(problem.parameters["k"])
        return lambda t: (a * np.sin(w * (T - t)) + b * np.sin(w * t)) / np.sin(w * T)

    first = solve(Problem(system, Event(0.0, [1.0]), Event(2.5, [0.5])))
    known = first.discrete.tr.layout.solvers["steady"]
    for T, end, k in ((2.5, 0.7, 1.0), (2.6, 0.7, 1.0), (2.6, 0.7, 2.0), (2.5, 0.5, 1.0)):
        problem = Problem(system, Event(0.0, [1.0]), Event(T, [end]), parameters={"k": k})
        found = solve(problem, guess=first)
        kept = found.discrete.tr.layout.solvers["steady"] is known
        assert kept == (T == 2.5 and end == 0.7)
        times = found.mesh.nodes
        assert found(times)[0] == pytest.approx(exact(problem)(times), abs=1e-11)


@pytest.mark.parametrize("elements", [1, 5])
@pytest.mark.parametrize("kind", ["forced", "constrained"])
def test_the_pull_of_moving_ends_is_that_of_finite_differences(kind, elements):
    more = {
        "forced": {"force": lambda q, v, t: [v[1] * q[0], -v[0] - q[1]]},
        "constrained": {"constraint": lambda q, t: q[0] ** 2 + q[1] ** 3 - 1},
    }[kind]
    system = System(
        lambda q, v, t: (1 + q[1] ** 2) * v[0] ** 2 + v[1] ** 2 + v[0] * q[1] * t - q[0] ** 4,
        ["x", "y"],
        **more,
    )
    problem = Problem(system, Event(0, [1.0, 0.0]), Event(1.3, [0.8, 0.36 ** (1 / 3)]))
    mesh = Mesh.uniform(0.0, 1.3, elements, [4, 5, 4, 5, 5][:elements])
    tr = Transcription(problem, mesh, np.array([2.0, 0.7]))
    z = np.random.default_rng(elements).uniform(-1, 1, tr.layout.size)
    ends, h = tr.ends[[0, -1]], 1e-5
    change = np.array([[0.3, -0.2], [0.1, 0.4]])
    assert tr.layout.storage == "blocks"
    found = _residual_change(tr, z, tr.with_ends(ends + change), Factors(tr.layout, tr.kkt(z)))
    after, before = (tr.with_ends(ends + s * h * change).residual(z) for s in (1, -1))
    assert found == pytest.approx((after - before) / (2 * h), abs=1e-8 * np.abs(found).max())
