"""One thread for the linear algebra of small matrices, and as many as before afterwards."""

from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import numpy as np
import pytest
import systems
from helpers import at_once

import actionopt as ao
from actionopt.tools.blas import (
    by_each,
    check_definite,
    cholesky,
    count_negative,
    invert_each,
    lu,
    one_thread,
    solve_each,
    thread_count,
)

OSCILLATOR = systems.oscillator()
PROBLEM = ao.Problem(OSCILLATOR, ao.Event(0.0, [1.0]), ao.Event(1.0, [0.5]))


@pytest.fixture
def two():
    """Two threads, of whatever there were."""
    if thread_count() is None:
        pytest.skip("numpy calls another library than OpenBLAS")
    get, put = thread_count()
    before = get()
    put(2)
    if get() != 2:
        put(before)
        pytest.skip("there are no threads")
    yield get
    put(before)


def test_a_solve_uses_one_thread(two):
    seen = []

    def guess(t):
        seen.append(two())
        return [1 - t / 2]

    solution = ao.solve(PROBLEM, guess=guess)
    assert set(seen) == {1} and two() == 2
    assert solution.morse_index == 0 and two() == 2


def test_what_fails_leaves_the_threads_alone(two):
    with pytest.raises(ZeroDivisionError), one_thread:
        assert two() == 1
        with one_thread:
            assert two() == 1
        assert two() == 1
        _ = 1 / 0
    assert two() == 2


def test_the_last_to_leave_restores_them(two):
    inside = Barrier(2)

    def work(first):
        with one_thread:
            inside.wait()
            if first:
                inside.wait()  # until the other one has left
        if not first:
            seen = two()
            inside.wait()
            return seen
        return two()

    with ThreadPoolExecutor(2) as pool:
        first, other = pool.submit(work, True), pool.submit(work, False)
        assert (other.result(), first.result()) == (1, 2)


@pytest.mark.parametrize("known", [True, False])
def test_positive_definite_matrices_are_solved_from_their_factor(monkeypatch, known):
    if not known:
        monkeypatch.setattr("actionopt.tools.blas._library", lambda: None)
    rng = np.random.default_rng(5)
    for rows in (1, 7, 60):
        A = rng.normal(size=(rows, rows))
        A = A @ A.T + np.eye(rows)
        given = A.copy()
        solve = cholesky(A)
        for _ in range(2):
            x = rng.normal(size=rows)
            assert solve(given @ x) == pytest.approx(x, abs=1e-10)
        assert np.array_equal(A, given)
        A[-1, -1] -= 1 / np.linalg.inv(A)[-1, -1] * (1 + 1e-6)  # which makes it just indefinite
        with pytest.raises(np.linalg.LinAlgError):
            cholesky(A)


@pytest.mark.parametrize("known", [True, False])
def test_regular_matrices_are_solved_from_their_factors_as_numpy_does(monkeypatch, known):
    if not known:
        monkeypatch.setattr("actionopt.tools.blas._library", lambda: None)
    rng = np.random.default_rng(6)
    for rows in (1, 7, 60):
        A, b = rng.normal(size=(rows, rows)), rng.normal(size=(rows, 3))
        given = A.copy(), b.copy()
        solve = lu(A)
        for right in (b[:, 0], b):
            assert np.array_equal(solve(right), np.linalg.solve(A, right))  # by the same routines
        assert np.array_equal(A, given[0]) and np.array_equal(b, given[1])
        with pytest.raises(np.linalg.LinAlgError):
            lu(0 * A)(b)
    assert lu(np.zeros((0, 0)))(np.zeros(0)).shape == (0,)


def test_a_matrix_times_each_of_a_stack():
    random = np.random.default_rng(0)
    for count in (2, 400):
        matrix, stack = random.standard_normal((3, 4)), random.standard_normal((count, 4, 2))
        np.testing.assert_allclose(by_each(matrix, stack), matrix @ stack, atol=1e-14)


def test_stacks_of_matrices_are_solved_as_numpy_does_or_are_singular():
    random = np.random.default_rng(3)
    matrices, right = random.normal(size=(5, 3, 3)), random.normal(size=(5, 3))
    x = solve_each(matrices, right)
    np.testing.assert_allclose((matrices @ x[:, :, None])[:, :, 0], right, rtol=1e-12)
    np.testing.assert_allclose(invert_each(matrices), np.linalg.inv(matrices), rtol=1e-12)
    definite = matrices @ matrices.transpose(0, 2, 1)
    check_definite(definite)
    matrices[2, 1] = 0.0
    for singular in (lambda: solve_each(matrices, right), lambda: invert_each(matrices)):
        with pytest.raises(np.linalg.LinAlgError):
            singular()
    with pytest.raises(np.linalg.LinAlgError):
        check_definite(np.array([np.eye(2), np.diag([1.0, -1.0])]))


@at_once("n", [0, 1, 2, 3, 30])
def test_negative_eigenvalues_are_counted_without_them(n):
    random = np.random.default_rng(n)
    for shift in (-9.0, -1.0, 0.0, 1.0, 9.0):
        half = random.normal(size=(n, n))
        for matrix in (half + half.T + shift * np.eye(n), np.eye(n)[::-1], -half @ half.T):
            assert count_negative(matrix) == np.sum(np.linalg.eigvalsh(matrix) < 0)
