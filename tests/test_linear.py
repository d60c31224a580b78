"""Factors of the KKT matrix, by whichever of the three ways, against dense linear algebra."""

import numpy as np
import pytest

from actionopt.path import Mesh
from actionopt.problem import Event, Problem
from actionopt.system import System
from actionopt.transcription import Factors, Transcription, negative_eigenvalues

# A backward stable solve is wrong by the condition of the matrix times rounding, some 1e2 of it.
ROUNDING = 100 * np.finfo(float).eps


def springs(q, v, t):
    x, y, z = q
    return (v[0] ** 2 + v[1] ** 2 + v[2] ** 2 - x**2 * y**2 - (y - z) ** 4) / 2


SYSTEMS = {
    "plain": System(springs, list("xyz")),
    "sphere": System(
        springs, list("xyz"), constraint=lambda q, t: q[0] ** 2 + q[1] ** 2 - 2 * q[2]
    ),
    "drag": System(springs, list("xyz"), force=lambda q, v, t: [-x * (1 + q[0] ** 2) for x in v]),
}


def matrix_of(kind, elements, duration=2.0):
    """Return layout, nonzeros and dense matrix at a generic point."""
    problem = Problem(SYSTEMS[kind], Event(0, [0, 0, 0]), Event(duration, [1, 1, 1]))
    tr = Transcription(problem, Mesh.uniform(0, duration, elements, 4), np.ones(3))
    z = np.random.default_rng(elements).uniform(-1, 1, tr.layout.size)
    nonzeros, pattern = tr.kkt(z), tr.layout.kkt
    dense = np.zeros(pattern.shape)
    dense[pattern.row, pattern.col] = nonzeros
    return tr.layout, nonzeros, dense


# Inverse, L D L' (or QR where forces make the matrix unsymmetric), and the same with more of it.
SIZES = (3, 12, 40)


@pytest.mark.parametrize("elements", SIZES)
@pytest.mark.parametrize("kind", SYSTEMS)
def test_solutions_are_those_of_a_dense_solver(kind, elements):
    layout, nonzeros, dense = matrix_of(kind, elements)
    factors = Factors(layout, nonzeros)
    rng = np.random.default_rng(1)
    for right in rng.normal(size=(3, layout.size)):
        known = np.linalg.solve(dense, right)
        found = factors.solve(right)
        tolerance = ROUNDING * np.linalg.cond(dense) * np.max(np.abs(known))
        assert tolerance < 1e-6 * np.max(np.abs(known))  # the comparison says something
        assert np.max(np.abs(found - known)) <= tolerance
        residual = np.max(np.abs(dense @ found - right))
        size = np.max(np.abs(right)) + np.linalg.norm(dense, np.inf) * np.max(np.abs(found))
        assert residual <= 1e-13 * size
    assert not np.allclose(dense @ (found * (1 + 1e-6)), right, rtol=1e-10, atol=1e-10)


def test_a_right_hand_side_of_zero_has_the_solution_zero():
    for elements in SIZES:
        layout, nonzeros, _ = matrix_of("sphere", elements)
        assert np.all(Factors(layout, nonzeros).solve(np.zeros(layout.size)) == 0)


@pytest.mark.parametrize("elements", SIZES)
@pytest.mark.parametrize("kind", ["plain", "sphere"])
@pytest.mark.parametrize("duration", [2.0, 9.0])
def test_inertia_is_that_of_the_dense_eigenvalues(kind, elements, duration):
    layout, nonzeros, dense = matrix_of(kind, elements, duration)
    values = np.linalg.eigvalsh(dense)
    assert np.min(np.abs(values)) > 1e-6 * np.max(np.abs(values))  # the count is determined
    assert negative_eigenvalues(layout, nonzeros) == np.sum(values < 0)


def test_inertia_of_many_signs():
    # Past k conjugate times of x'' = -x the Hessian has k negative eigenvalues.
    oscillator = System(lambda q, v, t: v[0] ** 2 / 2 - q[0] ** 2 / 2, ["x"])
    for half_periods in (0.5, 3.5, 20.5):
        T = half_periods * np.pi
        problem = Problem(oscillator, Event(0, 0), Event(T, 1))
        tr = Transcription(problem, Mesh.uniform(0, T, 50, 8), np.ones(1))
        nonzeros = tr.kkt(np.zeros(tr.layout.size))
        assert negative_eigenvalues(tr.layout, nonzeros) == int(half_periods)


@pytest.mark.parametrize("elements", SIZES)
@pytest.mark.parametrize("kind", SYSTEMS)
def test_singular_matrices_are_refused(kind, elements):
    layout, nonzeros, _ = matrix_of(kind, elements)
    empty = nonzeros.copy()
    empty[(layout.kkt.row == 0) | (layout.kkt.col == 0)] = 0.0
    with pytest.raises(np.linalg.LinAlgError):
        Factors(layout, empty).solve(np.ones(layout.size))


@pytest.mark.parametrize("elements", SIZES)
def test_matrices_that_are_not_finite_are_refused(elements):
    layout, nonzeros, _ = matrix_of("plain", elements)
    for bad in (np.nan, np.inf):
        broken = nonzeros.copy()
        broken[3] = bad
        with pytest.raises(np.linalg.LinAlgError, match="not finite"):
            Factors(layout, broken)


def test_a_factorization_outlives_the_next_one_of_its_layout():
    for kind in SYSTEMS:
        layout, nonzeros, dense = matrix_of(kind, 12)
        first = Factors(layout, nonzeros)
        Factors(layout, 2 * nonzeros).solve(np.ones(layout.size))
        known = np.linalg.solve(dense, np.ones(layout.size))
        assert np.allclose(first.solve(np.ones(layout.size)), known, rtol=1e-8), kind
