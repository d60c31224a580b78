"""What callables receive behaves as numpy's arrays do: the same code on numbers is the oracle."""

import casadi as ca
import numpy as np
import pytest
from helpers import at_once

import actionopt as ao
from actionopt.mechanics.laws.expressions import Expressions
from actionopt.mechanics.laws.tracing import column

W = np.arange(9.0).reshape(3, 3) + 1

# Functions of q, v (3,), t and M (2, 3).
DIRECT = {
    "unpacking": lambda q, v, t, M: (lambda a, b, c: a * b - c / 2)(*q),
    "unpacking in parts": lambda q, v, t, M: (lambda a, *b: a * b[0])(*q),
    "reflected": lambda q, v, t, M: 2 / q + 3 - q - (4 - v) * 5,
    "powers": lambda q, v, t, M: q**3 + 2**q + q**-0.5 + q**v + 2.0**t,
    "numbers of numpy": lambda q, v, t, M: np.float64(2) * q + np.int64(3) * v - v * np.int64(2),
    "signs": lambda q, v, t, M: -q + abs(v - q) + +v,
    "a scalar and a vector": lambda q, v, t, M: t * q + v / t - (q - t) + (t - v),
    "functions": lambda q, v, t, M: np.sqrt(v) + np.exp(t) + np.log(q) + np.tan(v) + np.square(q),
    "inverse functions": lambda q, v, t, M: np.arcsin(q) + np.arccos(v) + np.arctan(t),
    "hyperbolic": lambda q, v, t, M: np.sinh(q) + np.cosh(v) + np.tanh(q) + np.arctan2(q, v),
    "ufuncs by name": lambda q, v, t, M: np.add(q, v) - np.subtract(q, 2) + np.negative(v),
    "comparisons": lambda q, v, t, M: (
        (q == v) * 1.0 + (q <= v) * 2 + (q != v) + (q >= v) * 4 + (q < 0.5) * 8 + (v > 0.5)
    ),
    "indices": lambda q, v, t, M: q[-1] * v[0] + q[1],
    "slices": lambda q, v, t, M: q[1:] * v[:-1] + q[::2],
    "an empty slice": lambda q, v, t, M: np.sum(q[3:]) + t,
    "lengths": lambda q, v, t, M: len(q) * q[0] + len(M),
    "sums": lambda q, v, t, M: np.sum(q**2) + (q * v).sum() + sum(x * x for x in q),
    "dot": lambda q, v, t, M: np.dot(q, v) + q @ v,
    "matrix and vector": lambda q, v, t, M: M @ q,
    "vector and matrix": lambda q, v, t, M: v @ M.T,
    "matrices": lambda q, v, t, M: M @ M.T,
}
HANDED_OVER = {
    "arrays of numbers": lambda q, v, t, M: np.arange(3.0) * q - v * np.arange(3) + np.ones(3) @ q,
    "matrices of numbers": lambda q, v, t, M: W @ q + v @ W + q @ W @ v,
    "an array and a scalar": lambda q, v, t, M: np.arange(3.0) * t,
    "broadcasting": lambda q, v, t, M: q.reshape(3, 1) - v.reshape(1, 3),
    "a matrix and a vector": lambda q, v, t, M: M * q + M * t,
    "lists of indices": lambda q, v, t, M: q[[0, 2]] * M[1, 2] + M[0][:2],
    "sums along axes": lambda q, v, t, M: np.concatenate([M.sum(axis=0), M.sum(axis=1)]),
    "sum of all": lambda q, v, t, M: M.sum() + np.sum(M) + q.mean() + np.prod(v),
    "stacked": lambda q, v, t, M: np.stack([q[0], v[1], q[2] * t]),
    "joined": lambda q, v, t, M: np.concatenate([[0.0], q[:2], v]),
    "differences": lambda q, v, t, M: np.concatenate([np.diff(q), np.cumsum(v), np.roll(q, 1)]),
    "vectors": lambda q, v, t, M: np.cross(q, v) + np.linalg.norm(q - v) + np.hypot(q[0], v[1]),
    "products of vectors": lambda q, v, t, M: (
        np.linalg.cross(q, v) + np.cross([0, 0, 1], q) + np.cross(v, np.array([1.0, 0, 0]))
    ),
    "choices": lambda q, v, t, M: np.where(q > v, q, v * 2) + np.maximum(q, v) - np.minimum(q, 0.5),
    "other functions": lambda q, v, t, M: np.log1p(q) + np.expm1(v) + np.arcsinh(q) + np.sign(v),
    "remainders": lambda q, v, t, M: q % 0.3 + np.floor(v * 3),
    "rows": lambda q, v, t, M: sum(row @ q for row in M),
    "linear algebra": lambda q, v, t, M: np.linalg.solve(M @ M.T, q[:2]) + np.trace(M @ M.T),
    "shapes": lambda q, v, t, M: q.shape[0] * q[0] + q.size + M.shape[1] + q.ndim + M.ndim,
}
SYMBOLS = ca.SX.sym("q", 3), ca.SX.sym("v", 3), ca.SX.sym("t"), ca.SX.sym("M", 6)


def traced():
    q, v, t, M = SYMBOLS
    return (
        Expressions(q, 1),
        Expressions(v, 1),
        Expressions(t, 0),
        Expressions(M.reshape((3, 2)).T, 2),
    )


def numbers():
    rng = np.random.default_rng(0)
    return rng.uniform(0.1, 0.9, 3), rng.uniform(0.1, 0.9, 3), 0.4, rng.uniform(0.1, 0.9, (2, 3))


def evaluate(expression):
    """Return the expression at the numbers, flat as CasADi stores it: column by column."""
    q, v, t, M = numbers()
    return ca.Function("f", SYMBOLS, [expression])(q, v, t, M.ravel()).full().ravel()


@at_once("name", [*DIRECT, *HANDED_OVER])
def test_the_same_code_gives_the_same_numbers(name):
    function = (DIRECT | HANDED_OVER)[name]
    known = np.asarray(function(*numbers()), dtype=float)
    found = evaluate(column(function(*traced()), "lagrangian"))
    assert np.allclose(found, known.ravel(order="F"), rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("name", DIRECT)
def test_what_lagrangians_are_made_of_is_done_directly(name, monkeypatch):
    asked = []  # of CasADi's view, which swallows exceptions where it looks for something
    monkeypatch.setattr("actionopt.mechanics.laws.expressions._to_casadi", asked.append)
    column(DIRECT[name](*traced()), "lagrangian")
    assert not asked


def test_functions_of_casadi_take_them():
    q, v, t, _ = traced()
    given = ca.dot(q, v) * t + ca.sumsqr(v) + ca.if_else(q[0] > v[0], q[1], v[1])
    a, b, c, _ = numbers()
    known = a @ b * c + b @ b + (a[1] if a[0] > b[0] else b[1])
    assert np.allclose(evaluate(column(given, "lagrangian")), known, rtol=1e-13)


def test_a_part_can_be_replaced_without_the_symbols():
    q, *_ = traced()
    q[1] = 2 * q[0]
    a = numbers()[0]
    assert np.allclose(evaluate(column(q, "force")), [a[0], 2 * a[0], a[2]])
    assert str(SYMBOLS[0][1]) == "q_1"


@at_once(
    ("wrong", "error"),
    [
        (lambda q, v, t: q[3], IndexError),
        (lambda q, v, t: len(t), TypeError),
        (lambda q, v, t: np.array([q[0], 1.0]), TypeError),
        (lambda q, v, t: q + v[:2], Exception),
        (lambda q, v, t: q @ v[:1], Exception),
        (lambda q, v, t: np.einsum("i,i", q, v), TypeError),
        (lambda q, v, t: q[1:][2], IndexError),
        (lambda q, v, t: q[0, 1], IndexError),
        (lambda q, v, t: v if q[0] > 0 else q, Exception),
        (lambda q, v, t: q.nothing, AttributeError),
    ],
)
def test_what_has_no_meaning_is_refused(wrong, error):
    with pytest.raises(error):
        wrong(*traced()[:3])


def test_comparisons_can_be_joined():
    system = ao.System(
        lambda q, v, t: v[0] ** 2 / 2 + np.where((t > 0.3) & ~((t > 0.5) | (t < 0.1)), q[0], 0.0),
        ["x"],
    )
    t = np.array([0.05, 0.2, 0.4, 0.6])
    found = system.lagrangian(np.ones((1, 4)), np.zeros((1, 4)), t)
    assert found.tolist() == [0.0, 0.0, 1.0, 0.0]


def test_what_a_lagrangian_prints_are_its_symbols():
    seen = []

    def lagrangian(q, v, t):
        seen.append(f"{q} {v[0]!r} {t}")
        return v @ v / 2

    ao.System(lagrangian, ["x", "y"])
    assert seen[0] == "[q_0, q_1] v_0 t"


def test_a_list_of_numbers_times_expressions():
    system = ao.System(lambda q, v, t: [1.0, 2.0] @ v + v @ v / 2, ["x", "y"])
    assert system.momentum([0.0, 0.0], [0.0, 0.0], 0.0).tolist() == [1.0, 2.0]


def test_a_transpose_of_a_row_is_the_row():
    assert Expressions(ca.SX.sym("a", 2, 3), 2).T.shape == (3, 2)
    row = Expressions(ca.SX.sym("a", 3), 1)
    assert row.T is row
