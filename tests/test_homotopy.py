"""Releasing the force that holds a curve: the path at the other end, and its absence."""

import numpy as np
import pytest
import systems
from helpers import applies, integrated, transcribed

import actionopt as ao
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.newton.newton import approach, follow
from actionopt.mechanics.system import System
from actionopt.solver.search.homotopy import Inertias, newton_homotopy
from actionopt.solver.search.resonances import Resonances, _Held

PENDULUM = systems.pendulum(g=9.81)


def is_motion(tr, z, flow, tolerance):
    """Integrate from the discrete start momentum (unit masses), and compare at the end."""
    T, state = tr.problem.duration, np.concatenate([tr.coordinates(z)[0], tr.momenta(z)[0]])
    end = integrated(flow, state, 0.0, T)(T)[: tr.problem.system.n]
    return np.max(np.abs(end - tr.coordinates(z)[-1])) <= tolerance


def pendulum_flow(t, y):
    return [y[1], -9.81 * np.sin(y[0])]


# On the last way the force grows again before it vanishes: there are folds.
@pytest.mark.quick("0.5-0.5", "2.5-1.5")
@pytest.mark.parametrize(("end", "T"), [(0.5, 0.5), (2.5, 1.5), (-1.0, 5.0)])
def test_from_the_straight_line_to_a_motion(end, T):
    tr = transcribed(PENDULUM, ([1.0], [end]), T, 16)
    z = tr.pack(tr.straight())
    found, count = newton_homotopy(tr, z)
    assert count > 1
    polished = follow(tr, found)
    assert polished.converged
    assert polished.travelled <= 1e-3  # the homotopy came near already
    assert is_motion(tr, polished.z, pendulum_flow, 1e-4)
    assert not is_motion(tr, z, pendulum_flow, 1e-2)  # the straight line is not a motion


def test_steps_are_predicted_by_how_the_direction_changes():
    tr = transcribed(PENDULUM, ([1.0], [2.5]), 1.5, 16)
    assert newton_homotopy(tr, tr.pack(tr.straight()))[1] <= 25


def test_with_a_constraint_on_the_way():
    rod = systems.thrown(constraint=lambda q, t: q[0] ** 2 + q[1] ** 2 - 1)
    a, b, T = 0.5, -0.7, 0.6
    tr = transcribed(rod, [[np.sin(x), -np.cos(x)] for x in (a, b)], T, 8)
    angle = np.linspace(a, b, tr.layout.node_count)
    z = tr.pack(np.stack([np.sin(angle), -np.cos(angle)], axis=1))
    found, _ = newton_homotopy(tr, z)
    twin = transcribed(PENDULUM, ([a], [b]), T, 8, 12)
    there, _ = newton_homotopy(twin, twin.pack(twin.straight()))
    theta = twin.coordinates(follow(twin, there).z)[:, 0]
    x, y = tr.coordinates(follow(tr, found).z).T
    ends = tr.mesh.offsets
    assert np.max(np.abs(np.hypot(x, y) - 1)) <= 1e-12
    assert np.max(np.abs(np.arctan2(x, -y)[ends] - theta[twin.mesh.offsets])) <= 1e-7


def test_accelerations_are_removed_where_inertias_are_uneven():
    """The path is y = eps ln cosh((t - 0.6) / eps)."""
    eps = 0.1
    system = System(lambda q, v, t: np.exp(2 * q[0] / eps) * (v[0] ** 2 + 1) / 2, ["y"])
    u = np.cosh((np.linspace(0, 1, 41) - 0.6) / eps)
    tr = transcribed(system, ([eps * np.log(u[0])], [eps * np.log(u[-1])]), 1.0, 8, 5)
    z = tr.pack(tr.straight())
    found, count = newton_homotopy(tr, z, uneven=True)
    exact = eps * np.log(np.cosh((tr.mesh.nodes - 0.6) / eps))
    assert tr.coordinates(found)[:, 0] == pytest.approx(exact, abs=1e-3)
    assert count < 100


def test_inertias_and_their_slopes():
    system = System(lambda q, v, t: np.exp(q[0] + 2 * q[1]) * (v @ v) / 2, ["x", "y"])
    tr = transcribed(system, ([0.0, 0.0], [0.1, 0.2]), 1.0, 2, 3)
    z = tr.pack(tr.straight())
    inertias, Q = Inertias(tr, z), tr.coordinates(z)[1:-1]
    assert inertias.at(z) == pytest.approx(np.ones(z.size))
    assert inertias.at(tr.pack(tr.straight() + 0.1)) == pytest.approx(np.full(z.size, np.exp(0.3)))
    slopes = inertias.slopes(z).reshape(Q.shape)
    assert slopes == pytest.approx(np.tile([1, 2] * tr.lengths, (len(Q), 1)), rel=1e-5)


@pytest.mark.long
def test_no_path_is_said():
    # Bratu beyond its fold, 3.51: there is no solution.
    bratu = System(lambda q, v, t: v[0] ** 2 / 2 - 5.0 * np.exp(q[0]), ["x"])
    tr = transcribed(bratu, ([0.0], [0.0]), 1.0, 4, lengths=[1.0])
    assert newton_homotopy(tr, tr.pack(tr.straight()))[0] is None


def test_a_curve_that_comes_back_to_where_it_began_ends_there():
    # Round once in some 190 factorizations; 240 steps would take 560.
    soft = System(lambda q, v, t: v[0] ** 2 / 2 + q[0] ** 2 / 2 - q[0] ** 4 / 4, ["x"])
    tr = transcribed(soft, ([0.5], [2.0]), 10.0, 8)
    found, count = newton_homotopy(tr, tr.pack(tr.straight()))
    assert found is None
    assert count < 300


@pytest.mark.long
@pytest.mark.parametrize("links", [30, pytest.param(70, marks=pytest.mark.slow)])
def test_a_small_swing_of_many_links_near_a_resonance(links):
    """Damped steps end where the matrix is singular. Of 70 links a mode makes 1.005 half turns."""
    below = links - np.maximum.outer(np.arange(links), np.arange(links))  # masses that both carry

    def flow(t, y):
        q, v = y[:links], y[links:]
        sines, cosines = np.sin(np.subtract.outer(q, q)), np.cos(np.subtract.outer(q, q))
        force = -(below * sines) @ v**2 - 9.81 * np.diag(below) * np.sin(q)
        return np.concatenate([v, np.linalg.solve(below * cosines, force)])

    first = np.linspace(0.05, 0.15, links)
    problem = ao.Problem(systems.links(links), ao.Event(0.0, first), ao.Event(0.5, -first / 2))
    tr = Transcription(
        problem, ao.Mesh.uniform(0.0, 0.5, 4 if links < 60 else 8, 6), problem.lengths
    )
    z = tr.pack(tr.straight())
    assert approach(tr, z, 12) is None
    found = Resonances(tr).path(z)
    assert found is not None
    assert follow(tr, found).travelled < 1e-3

    solution = ao.solve(problem, tol=1e-6, principle="stationary")
    assert applies("resonance", problem, "stationary")
    assert np.abs(solution.path.values).max() < 0.2  # beside the line: the least path goes to 0.6
    state = np.concatenate([solution(0.0), solution.velocity(0.0)])
    end = integrated(flow, state, 0.0, 0.5, rtol=1e-8)(0.5)
    assert np.max(np.abs(end[:links] + first / 2)) < 1e-4


def test_modes_take_turns():
    held = _Held(np.zeros(2), *(np.array(x) for x in ([[1, 2, 3]], [4, 5, 6], [2, 5, 3])))
    turned = held.next()
    assert (held.root, turned.root, turned.next().root) == (-2.0, -1.0, -2.0)
    assert turned.modes.tolist() == [[2.0, 3.0, 1.0]] and turned.z is held.z
