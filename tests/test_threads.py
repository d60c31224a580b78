"""One system, several threads: the same numbers, to the last bit, as one thread finds."""

import numpy as np
import pytest
import systems

import actionopt as ao
from actionopt.analysis.motion.compare import compare
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.matrices.factors import negative_eigenvalues
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.mechanics.question.problem import Event, Problem
from actionopt.solver.refinement.ipopt import find
from benchmarks.stress.families import threads as family

THREADS = 3


def problems(name):
    """Return four problems of one new system."""
    return family.problems(name, 4)


def same_in_all_threads(work, inputs, alone):
    """Assert that each of several threads finds what one has found alone."""
    assert all(found == alone for found in family.at_once(work, inputs, THREADS))


def bits(*values):
    return tuple(np.asarray(x, dtype=float).tobytes() for x in values)


def answer(problem):
    solution = ao.solve(problem, throw=False)
    return (*bits(solution.path.values, solution.action, solution.error), solution.status)


@pytest.mark.long
@pytest.mark.parametrize("name", family.SYSTEMS)
def test_solving_problems_of_a_new_system(name):
    alone = [answer(problem) for problem in problems(name)]
    same_in_all_threads(answer, problems(name), alone)  # each derivation, too, is asked for at once


def numbers(solution):
    """Return what a solution tells, all of it computed now."""
    t = np.linspace(0, solution.problem.duration, 40)
    forced = [solution.multipliers(t), solution.constraint_force(t)] if solution.lam.size else []
    tr, z = solution.discrete.tr, solution.discrete.z
    compared = compare(solution)
    steep = ao.second_variation(solution, 2)
    derived = solution.sensitivity()
    return bits(
        solution.energy(t), solution.momentum(t), solution.acceleration(t), *forced,
        tr.residual(z), tr.kkt(z), *tr.momenta(z), *solution.momenta, solution.morse_index,
        steep.eigenvalues, derived.q0q1, derived.t1, compared.position, compared.local,
        compared.energy_drift, compared.path.values,
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", family.SYSTEMS)
def test_reading_solutions_of_one_system(name):
    alone = [numbers(ao.solve(problem)) for problem in problems(name)[:3]]
    solutions = [ao.solve(problem) for problem in problems(name)[:3]]
    same_in_all_threads(numbers, solutions, alone)


@pytest.mark.long
def test_one_neighbour_serves_several_threads():
    near, random = problems("driven pendulum")[0], np.random.default_rng(4)
    solution = ao.solve(near)
    ends = np.array(near.end.q) + random.uniform(-0.1, 0.1, (5, 2))
    moved = [Problem(near.system, near.start, Event(near.end.t, q)) for q in ends]

    def follow(problem):
        return bits(ao.solve(problem, guess=solution, throw=False).path.values)

    alone = [follow(problem) for problem in moved]
    same_in_all_threads(follow, moved, alone)


@pytest.mark.long
def test_one_transcription_at_several_points():
    problem = problems("rod")[0]
    tr = Transcription(problem, Mesh.uniform(0.0, problem.end.t, 4, 5), np.ones(2))
    random = np.random.default_rng(5)
    points = [tr.pack(tr.straight()) + random.normal(size=tr.layout.size) for _ in range(4)]

    def read(z):
        x = z[: tr.layout.unknowns]
        many = [bits(tr.action(x), tr.residual(z), tr.jacobian(x), tr.kkt(z)) for _ in range(50)]
        return set(many)

    alone = [read(z) for z in points]
    same_in_all_threads(read, points, alone)


@pytest.mark.long
@pytest.mark.parametrize(
    ("principle", "name"), list(zip(["least", "stationary"], family.SYSTEMS, strict=True))
)
def test_ipopt_in_several_threads(principle, name):
    """Problems of one shape share a layout, and each thread has its own solver for it."""

    def seek(problem):
        mesh = Mesh.uniform(0.0, problem.end.t, 6, 6)
        tr = Transcription(problem, mesh, np.ones(2))
        attempt = find(tr, tr.pack(tr.straight()), principle)
        return (*bits(attempt.z), attempt.status, attempt.iterations)

    alone = [seek(problem) for problem in problems(name)]
    same_in_all_threads(seek, problems(name), alone)


@pytest.mark.slow
def test_sparse_factors_in_several_threads():
    """A closed path's matrix is stored sparse: factorizations by CasADi, inertia included."""
    system = systems.spring(push=lambda t: np.sin(2 * t))
    closed = [Problem(system, Event(0.0, [None]), ao.Periodic(np.pi * k)) for k in (1, 2, 3)]

    def look(problem):
        tr = Transcription(problem, Mesh.uniform(0.0, problem.end.t, 40, 5), np.ones(1))
        K = tr.kkt(np.full(tr.layout.size, 0.1))
        return (*bits(K), negative_eigenvalues(tr.layout, K), *answer(problem))

    alone = [look(problem) for problem in closed]
    same_in_all_threads(look, closed, alone)
