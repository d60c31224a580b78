"""The rules against references computed here with forty digits."""

import mpmath
import numpy as np
import pytest
from helpers import at_once
from numpy.polynomial.legendre import legder, legval

from actionopt.tools.lobatto import CLOSED, legendre, lgl, open_rule

EPS = np.finfo(float).eps
DEGREES = [1, 2, 3, 4, 8, 16, 33, 64]


def reference(degree):
    """Return nodes, weights and derivative matrix of the LGL rule, as mpmath numbers."""
    with mpmath.workdps(40):
        d = degree
        x = [mpmath.mpf(s) for s in lgl(d).nodes]  # only a start: three Newton steps follow
        for _ in range(3):
            for k in range(1, d):
                p, below = mpmath.legendre(d, x[k]), mpmath.legendre(d - 1, x[k])
                x[k] -= (x[k] * p - below) / ((d + 1) * p)
        p = [mpmath.legendre(d, s) for s in x]
        w = [2 / (d * (d + 1) * s**2) for s in p]
        # Canuto et al. (2006), equation (2.3.28): entries off the diagonal, and its two ends.
        D = [
            [p[k] / p[j] / (x[k] - x[j]) if j != k else 0 for j in range(d + 1)]
            for k in range(d + 1)
        ]
        D[0][0], D[d][d] = -mpmath.mpf(d * (d + 1)) / 4, mpmath.mpf(d * (d + 1)) / 4
        return x, w, D


@pytest.mark.quick("1", "2", "3", "4", "8", "16")
@pytest.mark.parametrize("d", DEGREES)
def test_nodes_and_weights_agree_with_forty_digits(d):
    x, w, _ = reference(d)
    rule = lgl(d)
    assert max(abs(float(a - b)) for a, b in zip(x, rule.nodes, strict=True)) <= EPS
    assert max(abs(float(a - b)) for a, b in zip(w, rule.weights, strict=True)) <= 1e-15
    # A weight has the square of P_d in it, and each step of the recurrence one rounding error.
    bound = (8 + 2 * d) * EPS
    assert max(abs(float(a / b - 1)) for a, b in zip(w, rule.weights, strict=True)) <= bound


@pytest.mark.quick("1", "2", "3", "4", "8", "16")
@pytest.mark.parametrize("d", DEGREES)
def test_derivative_agrees_with_forty_digits(d):
    _, _, D = reference(d)
    exact = np.array([[float(value) for value in row] for row in D])
    # Next to the ends the nodes are 4 / d^2 apart, and an error of eps / 2 in each of them is a
    # relative error of about eps d^2 / 4 in the entry.
    bound = EPS * max(4.0, d**2 / 4) * np.max(np.abs(exact))
    assert np.max(np.abs(lgl(d).derivative - exact)) <= bound


@at_once("d", DEGREES)
def test_quadrature_is_exact_to_degree_2d_minus_1_and_no_further(d):
    rule = lgl(d)
    sums = legendre(2 * d, rule.nodes) @ rule.weights  # the integral of P_k is 2 for k = 0, else 0
    assert sums[0] == pytest.approx(2.0, abs=8 * EPS)
    assert np.max(np.abs(sums[1:-1])) <= 8 * EPS
    # The first polynomial it misses: sum w P_2d > 0 = the integral.
    assert sums[-1] > 1e-3 / d


@at_once("d", DEGREES)
def test_polynomials_of_degree_d_are_interpolated_and_differentiated_exactly(d):
    rule = lgl(d)
    xi = np.linspace(-1, 1, 41)
    at_nodes, exact = legendre(d, rule.nodes), legendre(d, xi)
    assert np.max(np.abs(rule.interpolation(xi) @ at_nodes.T - exact.T)) <= 50 * EPS
    coefficients = np.eye(d + 1)
    assert np.max(np.abs(rule.to_legendre @ at_nodes.T - coefficients)) <= 50 * EPS
    slopes = np.polynomial.legendre.legval(rule.nodes, np.polynomial.legendre.legder(coefficients))
    assert np.max(np.abs(rule.derivative @ at_nodes.T - slopes.T)) <= 4 * EPS * d**4


def test_interpolation_at_the_nodes_is_the_identity():
    rule = lgl(7)
    assert np.array_equal(rule.interpolation(rule.nodes), np.eye(8))


def test_constants_have_no_velocity():
    for d in DEGREES:
        D = lgl(d).derivative
        assert np.max(np.abs(D.sum(axis=1))) <= 4 * EPS * np.max(np.abs(D))


@pytest.mark.parametrize("d", [0, -1, 2.5])
def test_degrees_that_are_none(d):
    with pytest.raises(ValueError, match="polynomial degree >= 1"):
        lgl(d)


@at_once("ends", [(1, 0), (0, 1), (1, 1), (2, 0), (2, 1), (2, 2)])
@at_once("degree", [2, 5, 12])
def test_open_rules_sum_polynomials_and_never_look_at_open_ends(degree, ends):
    rule = open_rule(degree, ends)
    exact = 2 * degree - (2 if 0 in ends else 3)
    for k in range(exact + 1):
        assert abs(rule.weights @ rule.nodes**k - (1 + (-1) ** k) / (k + 1)) < 1e-14
    out = np.array(ends) > 0
    assert ((rule.weights[[0, -1]] == 0) == out).all() and (rule.weights[1:-1] > 0).all()
    x, at_rest = np.linspace(-1, 1, 7), (ends[0] == 2) + (ends[1] == 2)
    series = np.zeros(degree + 1 + at_rest)
    series[-1] = 1.0
    if at_rest:  # whose slope vanishes at -1
        series[1] -= legval(-1.0, legder(series))
    if at_rest == 2:  # and at 1
        series[2] -= (legval(1.0, legder(series)) - legval(-1.0, legder(series))) / 6
        series[1] -= legval(-1.0, legder(series))
    series /= np.abs(legval(rule.nodes, series)).max()
    values, slope = legval(rule.nodes, series), legder(series)
    assert np.abs(rule.interpolation(x) @ values - legval(x, series)).max() < 1e-13
    assert np.abs(rule.slopes(x) @ values - legval(x, slope)).max() < 1e-13 * degree**2
    assert np.abs(rule.derivative @ values - legval(rule.nodes, slope)).max() < 1e-13 * degree**2


def test_a_rule_between_two_open_ends_has_two_nodes():
    with pytest.raises(ValueError, match="a degree of 2 at least between two open ends, found 1"):
        open_rule(1, (CLOSED + 1, CLOSED + 1))
