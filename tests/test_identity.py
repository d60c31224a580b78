"""Sums that vanish identically, and sums that nearly do."""

import casadi as ca
import numpy as np
import pytest

from actionopt.mechanics.laws.identity import general_states, mismatch, vanishes

X = ca.SX.sym("x")
POINTS = [general_states(1)[0]]  # of all sizes


def row(*terms):
    return ca.horzcat(*[ca.SX(term) for term in terms])


@pytest.mark.parametrize(
    "terms",
    [
        (ca.sin(X) ** 2, ca.cos(X) ** 2, -1),
        (ca.cosh(X / 1e8), -ca.exp(X / 1e8) / 2, -ca.exp(-X / 1e8) / 2),
        ((X + 1) ** 3, -(X**3), -3 * X**2, -3 * X, -1),
        (X, -X),
    ],
)
def test_identities_vanish_and_their_parts_do_not(terms):
    assert vanishes(row(*terms), [X], POINTS)
    assert not vanishes(row(*terms[:-1]), [X], POINTS)
    assert not vanishes(row(*terms[:-1], 1.000001 * terms[-1]), [X], POINTS)


@pytest.mark.parametrize("power", [1, 3])
def test_a_term_that_is_small_at_one_size_is_large_at_another(power):
    assert not vanishes(row(X**2, -(X**2), 1e-12 * X**power), [X], POINTS)


def test_mismatch_is_the_sum_over_the_sizes():
    terms = ca.vertcat(row(X, 2 * X), row(3 * X, -X))
    found = mismatch(terms, [X], [np.array([[1.0], [-2.0]])])
    assert found == pytest.approx(np.array([[1.0, 1.0], [0.5, 0.5]]))
    assert np.isnan(mismatch(row(ca.log(X), 1), [X], [np.array([[-1.0], [2.0]])])[0, 0])


def test_rows_must_vanish_one_by_one():
    assert not vanishes(ca.vertcat(row(X, -X), row(X, X)), [X], POINTS)


def test_where_it_is_finite_counts_and_somewhere_it_must_be():
    assert vanishes(row(2 * ca.log(X), -ca.log(X**2)), [X], POINTS)  # for positive x
    with pytest.raises(ValueError, match="finite at some points in general position, found none"):
        vanishes(row(ca.log(-(X**2)), 1), [X], POINTS)


def test_points_are_the_same_every_time():
    assert np.array_equal(POINTS[0], general_states(1)[0])
