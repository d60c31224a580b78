"""One system, several threads: the same numbers, to the last bit, as one thread finds."""

from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import numpy as np
import pytest
from helpers import a_quarter

import actionopt as ao
from actionopt.analysis.compare import compare
from actionopt.discrete.factors import negative_eigenvalues
from actionopt.discrete.mesh import Mesh
from actionopt.discrete.transcription import Transcription
from actionopt.mechanics.problem import Event, Problem
from actionopt.mechanics.system import System
from actionopt.solver.ipopt import find

THREADS = 3


def at_once(function, inputs, threads=THREADS):
    """Return the results of `function(k, x)` for all inputs, each in every thread, in its order.

    The threads begin together, each at another input.
    """
    begin = Barrier(threads)

    def run(thread):
        results = {}
        begin.wait()
        for k in range(len(inputs)):
            which = (k + thread) % len(inputs)
            results[which] = function(inputs[which])
        return [results[k] for k in range(len(inputs))]

    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(run, range(threads)))


def rod():
    """Return a pendulum in the plane: constraint, multipliers, force that depends on time."""
    return System(
        lambda q, v, t, *, g: (v @ v) / 2 - g * q[1],
        ["x", "y"],
        parameters={"g": 9.81},
        constraint=lambda q, t: q @ q - 1,
    )


def double():
    """Return a double pendulum of equal parts: two angles, and paths that Ipopt has to find."""
    return System(
        lambda q, v, t, *, g: (
            v[0] ** 2 + v[1] ** 2 / 2 + v[0] * v[1] * np.cos(q[0] - q[1])
            + g * (2 * np.cos(q[0]) + np.cos(q[1]))
        ),
        ["a", "b"],
        parameters={"g": 9.81},
    )  # fmt: skip


def driven():
    """Return an oscillator whose energy changes with time."""
    return System(lambda q, v, t: (v[0] ** 2 - q[0] ** 4) / 2 + np.sin(2 * t) * q[0], ["x"])


def on_the_circle(a):
    return [np.sin(a), -np.cos(a)]


def problems(make):
    """Return four problems of one new system."""
    system, random = make(), np.random.default_rng(3)
    result = []
    for _ in range(4):
        ends = random.uniform(-1.2, 1.2, (2, system.n))
        T = random.uniform(0.4, 1.6)
        if make is rod:
            ends = [on_the_circle(a) for a in ends[:, 0]]
        result.append(Problem(system, Event(0.0, ends[0]), Event(T, ends[1])))
    return result


def bits(*values):
    return tuple(np.asarray(x, dtype=float).tobytes() for x in values)


def answer(problem):
    solution = ao.solve(problem, throw=False)
    return (*bits(solution.path.values, solution.action, solution.error), solution.status)


@pytest.mark.parametrize("make", a_quarter([rod, double, driven]))
def test_solving_problems_of_a_new_system(make):
    alone = [answer(problem) for problem in problems(make)]
    for found in at_once(answer, problems(make)):  # each derivation, too, is asked for at once
        assert found == alone


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
@pytest.mark.parametrize("make", [rod, driven])
def test_reading_solutions_of_one_system(make):
    alone = [numbers(ao.solve(problem)) for problem in problems(make)[:3]]
    solutions = [ao.solve(problem) for problem in problems(make)[:3]]
    for found in at_once(numbers, solutions):
        assert found == alone


def test_one_neighbour_serves_several_threads():
    near, random = problems(double)[0], np.random.default_rng(4)
    solution = ao.solve(near)
    ends = np.array(near.end.q) + random.uniform(-0.1, 0.1, (5, 2))
    moved = [Problem(near.system, near.start, Event(near.end.t, q)) for q in ends]

    def follow(problem):
        return bits(ao.solve(problem, guess=solution, throw=False).path.values)

    alone = [follow(problem) for problem in moved]
    for found in at_once(follow, moved):
        assert found == alone


def test_one_transcription_at_several_points():
    problem = problems(rod)[0]
    tr = Transcription(problem, Mesh.uniform(0.0, problem.end.t, 4, 5), np.ones(2))
    random = np.random.default_rng(5)
    points = [tr.pack(tr.straight()) + random.normal(size=tr.layout.size) for _ in range(4)]

    def read(z):
        x = z[: tr.layout.unknowns]
        many = [bits(tr.action(x), tr.residual(z), tr.jacobian(x), tr.kkt(z)) for _ in range(50)]
        return set(many)

    alone = [read(z) for z in points]
    for found in at_once(read, points):
        assert found == alone


@pytest.mark.parametrize("principle", ["least", "stationary"])
def test_ipopt_in_several_threads(principle):
    """Problems of one shape share a layout, and each thread has its own solver for it."""

    def seek(problem):
        mesh = Mesh.uniform(0.0, problem.end.t, 6, 6)
        tr = Transcription(problem, mesh, np.ones(2))
        attempt = find(tr, tr.pack(tr.straight()), principle)
        return (*bits(attempt.z), attempt.status, attempt.iterations)

    for make in (double, rod):
        alone = [seek(problem) for problem in problems(make)]
        for found in at_once(seek, problems(make)):
            assert found == alone


@pytest.mark.slow
def test_sparse_factors_in_several_threads():
    """A closed path's matrix is stored sparse: factorizations by CasADi, inertia included."""
    system = driven()
    closed = [Problem(system, Event(0.0, [None]), ao.Periodic(np.pi * k)) for k in (1, 2, 3)]

    def look(problem):
        tr = Transcription(problem, Mesh.uniform(0.0, problem.end.t, 40, 5), np.ones(1))
        K = tr.kkt(np.full(tr.layout.size, 0.1))
        return (*bits(K), negative_eigenvalues(tr.layout, K), *answer(problem))

    alone = [look(problem) for problem in closed]
    for found in at_once(look, closed):
        assert found == alone
