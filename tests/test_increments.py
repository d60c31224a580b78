"""Short elements of paths with accelerations, whose round-off would hold them as springs do."""

import numpy as np
import pytest

import actionopt as ao
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.borders.bordered import Bordered
from actionopt.discrete.matrices.factors import full
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.newton.increments import Increments

FORCED = [False, True]


@pytest.mark.parametrize("forced", FORCED)
def test_solutions_and_signs_are_those_of_the_matrix(forced):
    """With places that are given or free at either end and on the way, against LAPACK."""
    force = {"force": lambda q, v, t: [0.3 * q[1] * v[0], -v[1]]} if forced else {}
    system = ao.System(
        lambda q, v, a, t: (
            (1 + q[0] ** 2 / 10) * a[0] ** 2 / 2
            + v[0] * q[1] ** 2 * a[1]
            + np.sin(q[0] * v[1])
            - (1 + t) * a[1] ** 2
        ),
        ["x", "y"],
        **force,
    )
    gate = ao.Event(0.4, [0.3, None])
    ends = ao.Event(0.1, [0.2, 0.1], v=[0, None]), ao.Event(1, [1, None], v=[None, -1])
    problem = ao.Problem(system, *ends, through=[gate])
    tr = Transcription(problem, Mesh([0.1, 0.4, 0.7, 1], [5, 3, 6]), np.array([1.0, 2.0]))
    random = np.random.default_rng(0)
    z, right = random.normal(size=(2, tr.layout.size))
    nonzeros = tr.kkt(z) - 0.2 * tr.kinetic(z)
    matrix, factors = full(tr.layout, nonzeros), Increments(tr, z, nonzeros, 0.2)
    np.testing.assert_allclose(factors.solve(right), np.linalg.solve(matrix, right), rtol=1e-9)
    if not forced:
        assert factors.negative() == (np.linalg.eigvalsh(matrix) < 0).sum()


def test_so_they_are_beside_times_that_are_to_be_found():
    system = ao.System(lambda q, v, a, t: (1 + t**2) * a[0] ** 2 / 2 - v[0] ** 2, ["x"])
    times = np.array([0, 0.3, 0.7, 1.0])
    gates = [ao.Event(None, [0.3]), ao.Event(0.7, [1.0])]
    problem = ao.Problem(system, ao.Event(0, [0]), ao.Event(1, [1]), through=gates)
    random = np.random.default_rng(2)
    path = ao.Path(Mesh(times, 5), random.standard_normal((1, 16)))
    equations, y = Bordered.around(problem, path, None, np.ones(1), times=times)
    nonzeros, right = equations.symmetric_kkt(y), random.normal(size=y.size)
    matrix, factors = full(equations.layout, nonzeros), Increments(equations, y, nonzeros)
    np.testing.assert_allclose(factors.solve(right), np.linalg.solve(matrix, right), rtol=1e-9)
    assert factors.negative() == (np.linalg.eigvalsh(matrix) < 0).sum()


@pytest.mark.parametrize(("w", "tol"), [(1e-6, 1e-9), (1e-7, 1e-9), (1e-7, 1e-3)])
def test_a_kicked_column_and_its_index(w, tol):
    """q'''' + P q'' = -kick delta(t - c), and the index counts buckling loads (k pi)^2 below P."""
    c, kick, P = 0.38197, 2.3, 55.0
    column = ao.System(
        lambda q, v, a, t: (
            a[0] ** 2 / 2
            - P * v[0] ** 2 / 2
            + kick * np.exp(-(((t - c) / w) ** 2)) / (w * np.sqrt(np.pi)) * q[0]
        ),
        ["x"],
    )
    solution = ao.solve(ao.Problem(column, ao.Event(0.0, [0.0]), ao.Event(1.0, [0.5])), tol=tol)
    k, t = np.sqrt(P), np.linspace(0, 1, 401)

    def bent(u):
        return np.where(u > 0, np.sin(k * u) - k * u, 0.0) * kick / k**3

    wave = -kick / k**3 * np.sin(k * (1 - c)) / np.sin(k)
    exact = (0.5 - wave * np.sin(k) - bent(1 - c)) * t + wave * np.sin(k * t) + bent(t - c)
    assert np.max(np.abs(solution(t)[0] - exact)) / np.max(np.abs(exact)) < tol
    assert solution.morse_index == 2
