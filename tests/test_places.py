"""Newton steps that are limited place by place: motions of lattices far from the straight line."""

import numpy as np
from helpers import applies, integrated

import actionopt as ao
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.newton.newton import approach
from actionopt.solver.refinement.component_newton import settle_by_component


def force(q):
    d = np.diff(q)
    tension = np.concatenate([[2 * q[0]], d + d**3, [-2 * q[-1]]])
    return np.diff(tension)


def lattice(masses, seed):
    """Return a question to a row of masses on stiffening springs, as `force` has them by hand."""

    def lagrangian(q, v, t):
        d = q[1:] - q[:-1]
        return v @ v / 2 - np.sum(d**2) / 2 - np.sum(d**4) / 4 - q[0] ** 2 - q[-1] ** 2

    q, v = np.random.default_rng((masses, seed)).normal(0.0, 0.6, (2, masses))
    end = integrated(flow, np.concatenate([q, v]), 0.0, 1.0)(1.0)[:masses]
    system = ao.System(lagrangian, [f"q{j}" for j in range(masses)])
    return ao.Problem(system, ao.Event(0.0, q), ao.Event(1.0, end))


def flow(t, y):
    q, v = np.split(y, 2)
    return np.concatenate([v, force(q)])


def test_a_motion_far_from_the_line_is_reached_where_one_damping_factor_fails():
    problem = lattice(128, 1)
    tr = Transcription(problem, Mesh.uniform(0.0, 1.0, 4, 6), problem.lengths)
    z = tr.pack(tr.straight())
    assert approach(tr, z, 30) is None
    found, _ = settle_by_component(tr, z)
    assert found is not None
    assert np.abs(tr.residual(found)).max() < 1e-3 * np.abs(tr.residual(z)).max()


def test_it_is_found_without_a_guess_and_moves_as_the_equations_by_hand_say():
    problem = lattice(128, 1)
    assert applies("places", problem) and not applies("meeting", problem)
    solution = ao.solve(problem)
    first = np.concatenate([problem.start.q, solution.start.v])
    end = integrated(flow, first, 0.0, 1.0, rtol=1e-9)(1.0)[:128]
    assert np.abs(end - problem.end.q).max() < 1e-6


def test_where_there_is_none_it_ends():
    def lagrangian(q, v, t):  # of each q'' = -6 e^q there is none (Bratu)
        return v @ v / 2 - 6 * np.sum(np.exp(q))

    system = ao.System(lagrangian, [f"q{j}" for j in range(4)])
    problem = ao.Problem(system, ao.Event(0.0, [0.0] * 4), ao.Event(1.0, [0.0] * 4))
    tr = Transcription(problem, Mesh.uniform(0.0, 1.0, 4, 6), problem.lengths)
    found, count = settle_by_component(tr, tr.pack(tr.straight()))
    assert found is None and count > 100
