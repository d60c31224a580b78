"""Legendre-Gauss-Lobatto (LGL) rules: the nodes on which a path lives and its action is summed.

Everything is on the reference interval [-1, 1]. Nodes are the end points and the roots of P'_d;
they are polished by Newton's method, because a differentiation matrix built from nodes that are
good to 1e-12 is good to 1e-10 only.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from actionopt.tools.blas import by_each
from actionopt.tools.cached import cached_property
from actionopt.tools.immutable import immutable
from actionopt.tools.types import Array

# Degrees more of the other quadrature of a rule, whose points lie between the nodes. Odd, or both
# rules of an even degree would have the middle; which odd number is ad hoc.
EXTRA_DEGREES = 3


@immutable
class Sampling:
    """A quadrature with m + 1 points for the polynomials with given values at d + 1 nodes."""

    # nodes, weights (m + 1,)
    nodes: Array
    weights: Array
    # values, slopes (m + 1, d + 1): map nodal values to values and derivatives at the points.
    values: Array
    slopes: Array
    # weighted_values, weighted_slopes (d + 1, m + 1): their transposes, times the weights.
    weighted_values: Array
    weighted_slopes: Array
    panels: int = 1  # equal parts of [-1, 1] that have the same points

    @cached_property
    def _running(self) -> Array:
        """Integrals over a panel [-1, 1] up to its points, and over the whole of it, by values."""
        count = self.nodes.size // self.panels
        x = self.panels * (self.nodes[:count] + 1) - 1
        P = legendre(count, np.append(x, 1.0))
        # (2 k + 1) P_k is the derivative of P_{k + 1} - P_{k - 1}.
        integrals = np.array([P[k + 1] - (P[k - 1] if k else -1.0) for k in range(count)]) / (
            2 * np.arange(count)[:, None] + 1
        )
        return np.linalg.solve(P[:count, :-1], integrals).T

    @cached_property
    def _rates(self) -> Array:
        """Derivatives at the points of a panel [-1, 1], by values there."""
        count = self.nodes.size // self.panels
        P = legendre(count, self.panels * (self.nodes[:count] + 1) - 1)
        slopes = np.zeros((count, count))
        for k in range(count - 1):
            slopes[k + 1] = (slopes[k - 1] if k else 0.0) + (2 * k + 1) * P[k]
        return np.linalg.solve(P[:count], slopes).T

    @cached_property
    def _increments(self) -> Array:
        """Integrals over a panel [-1, 1] from one of its points to the next, its ends included."""
        whole = np.vstack([np.zeros(self._running.shape[1]), self._running])
        return np.ascontiguousarray(np.diff(whole, axis=0).T) / self.panels

    @cached_property
    def _ends_and_rest(self) -> tuple[Array, Array]:
        """Values at the ends of a panel [-1, 1], and what three quarters of the degrees leave.

        By values at its points, (count, 2) and (count, count / 4).
        """
        count = self.nodes.size // self.panels
        P = legendre(count - 1, self.panels * (self.nodes[:count] + 1) - 1)
        ends = np.linalg.solve(P, legendre(count - 1, np.array([-1.0, 1.0])))
        low = 3 * count // 4
        return ends, np.linalg.qr(P.T)[0][:, low:]

    def rest_and_gaps(self, values: Array, ends: Array) -> tuple[Array, Array]:
        """Return what is not smooth in values (R, m + 1), and where they step between panels.

        Arrays (R, panels count / 4) and (R, panels + 1): what the polynomials through the `count`
        points of a panel have beyond three quarters of the degrees, in an orthonormal basis; and
        from the first of the values at the `ends` (R, 2) over each boundary to the other one, what
        the polynomials on both sides differ by.
        """
        edges, rest = self._ends_and_rest
        rows, count = len(values), len(rest)
        parts = values.reshape(-1, count)
        at = (parts @ edges).reshape(rows, -1, 2)
        gaps = np.empty((rows, self.panels + 1))
        np.subtract(at[:, 1:, 0], at[:, :-1, 1], out=gaps[:, 1:-1])
        np.subtract(at[:, 0, 0], ends[:, 0], out=gaps[:, 0])
        np.subtract(ends[:, 1], at[:, -1, 1], out=gaps[:, -1])
        return (parts @ rest).reshape(rows, -1), gaps

    def increments(self, values: Array) -> Array:
        """Return the integrals of values (E, m + 1) from -1 to the first point, to the next, to 1.

        An array (E, m + 2).
        """
        E, points = values.shape
        count = points // self.panels
        parts = (values.reshape(-1, count) @ self._increments).reshape(E, self.panels, -1)
        found = np.empty((E, points + 1))
        found[:, :-1].reshape(E, self.panels, count)[...] = parts[:, :, :-1]
        found[:, -1] = 0.0
        found[:, count::count] += parts[:, :, -1]
        return found

    def rates(self, values: Array) -> Array:
        """Return the derivatives of values (E, m + 1, n) at the points, panel by panel."""
        E, points, n = values.shape
        rows = values.reshape(E * self.panels, -1, n)
        return self.panels * by_each(self._rates, rows).reshape(values.shape)

    def integrals(self, values: Array) -> tuple[Array, Array]:
        """Return the integrals from -1 to the points of values (E, m + 1, n) there, and to 1.

        Arrays (E, m + 1, n) and (E, n).
        """
        E, points, n = values.shape
        count = points // self.panels
        rows = values.transpose(0, 2, 1).reshape(-1, count)  # one product of all
        parts = (rows @ self._running.T).reshape(E, n, self.panels, -1) / self.panels
        ends = parts[:, :, :, -1].cumsum(axis=2)
        parts[:, :, 1:] += ends[:, :, :-1, None]
        return parts[:, :, :, :-1].reshape(E, n, points).transpose(0, 2, 1), ends[:, :, -1]

    def integrals_in_rows(self, values: Array) -> tuple[Array, Array]:
        """Return what `integrals` does of values (m + 1, ...), (m + 1, ...) and (...)."""
        rows = values.reshape(self.panels, len(values) // self.panels, -1)
        matrix = self._running / self.panels
        found, ends = matrix[:-1] @ rows, (matrix[-1] @ rows).cumsum(axis=0)
        found[1:] += ends[:-1, None]
        return found.reshape(values.shape), ends[-1].reshape(values.shape[1:])


@immutable
class Rule:
    """The LGL rule of one polynomial degree d (d + 1 points, exact to degree 2d - 1)."""

    degree: int  # polynomial degree d >= 1
    nodes: Array  # (d + 1,): xi_k in [-1, 1], increasing, ends included
    weights: Array  # (d + 1,): w_k = 2 / (d (d + 1) P_d(xi_k)^2); they sum to 2
    # (d + 1,): barycentric interpolation weights, scaled to a largest magnitude of one.
    barycentric: Array
    derivative: Array  # (d + 1, d + 1): D[k, j] = l_j'(xi_k) for the Lagrange polynomials l_j
    to_legendre: Array  # (d + 1, d + 1): maps nodal values to the coefficients of P_0 ... P_d
    # Which ends are nodes of the polynomials alone: what is summed is not looked at there
    # (`open_rule`).
    ends: tuple[int, int] = (0, 0)

    @cached_property
    def weighted_derivative(self) -> Array:
        """The matrix w_k D_kj, (d + 1, d + 1)."""
        return self.weights[:, None] * self.derivative

    @cached_property
    def stiffness(self) -> Array:
        """The matrices w_k D_kj D_kl, ((d + 1)^2, d + 1): row (j, l), column k."""
        products = np.einsum("kj,kl->jlk", self.weighted_derivative, self.derivative)
        return products.reshape(-1, self.degree + 1)

    @cached_property
    def same(self) -> Sampling:
        """Sums over the nodes themselves."""
        return self._sample(self.nodes, self.weights)

    @cached_property
    def other(self) -> Sampling:
        """Sums over other points, between the nodes."""
        rule = lgl(self.degree + EXTRA_DEGREES)
        return self._sample(rule.nodes, rule.weights)

    def dense(self, panels: int) -> Sampling:
        """Return sums over Gauss's points, `panel` in each of so many equal parts."""
        if panels not in self._dense:
            x, w = np.polynomial.legendre.leggauss(self.panel)
            middles = (2 * np.arange(panels)[:, None] + 1) / panels - 1
            nodes = (middles + x / panels).ravel()
            self._dense[panels] = self._sample(nodes, np.tile(w / panels, panels), panels)
        return self._dense[panels]

    @property
    def panel(self) -> int:
        """Points in a part of `dense`: exact for products of the polynomials, even in one part."""
        return max(self.degree + 2, 8)

    @cached_property
    def _dense(self) -> dict[int, Sampling]:
        return {}

    def _sample(self, nodes: Array, weights: Array, panels: int = 1) -> Sampling:
        values = self.interpolation(nodes)
        slopes = self.slopes(nodes)
        weighted = values.T * weights, slopes.T * weights
        return Sampling(nodes, weights, values, slopes, *weighted, panels)

    def interpolation(self, xi: Array) -> Array:
        """Return the matrix (K, d + 1) that maps nodal values to values at the K points `xi`."""
        return self._barycentric(xi)

    def slopes(self, xi: Array) -> Array:
        """Return the matrix (K, d + 1) of derivatives there, by nodal values."""
        return self._barycentric(xi) @ self.derivative  # which are of degree d at most

    def _barycentric(self, xi: Array) -> Array:
        gap = xi[:, None] - self.nodes
        hit, node = (gap == 0.0).nonzero()
        gap[hit, node] = 1.0
        terms = self.barycentric / gap
        matrix = terms / np.add.reduce(terms, axis=1, keepdims=True)
        if hit.size:
            matrix[hit] = 0.0
            matrix[hit, node] = 1.0
        return matrix


def legendre(degree: int, x: Array) -> Array:
    """Return P_0(x) ... P_degree(x) as an array (degree + 1, K) by the three-term recurrence."""
    values = np.empty((degree + 1, x.size))
    values[0] = 1.0
    if degree:
        values[1] = x
    for k in range(1, degree):
        values[k + 1] = ((2 * k + 1) * x * values[k] - k * values[k - 1]) / (k + 1)
    return values


@cache
def lgl(degree: int) -> Rule:
    """Return the LGL rule with `degree + 1` points.

    Raises
    ------
    ValueError
        If `degree` is not an integer >= 1.

    References
    ----------
    Canuto, Hussaini, Quarteroni, Zang, *Spectral Methods: Fundamentals in Single Domains* (2006),
    section 2.3.1; Berrut and Trefethen, *Barycentric Lagrange Interpolation*, SIAM Review 46
    (2004), equations 4.2 and 9.4.
    """
    if int(degree) != degree or degree < 1:
        raise ValueError(f"expected a polynomial degree >= 1, found {degree!r}")
    d = int(degree)
    x = -np.cos(np.pi * np.arange(d + 1) / d)
    # Newton on (1 - x^2) P_d'(x) = d (P_{d-1} - x P_d), whose derivative is -d (d + 1) P_d.
    for _ in range(50):  # five do; the last one's step is round-off, or as good as that
        p = legendre(d, x)
        step = (x * p[d] - p[d - 1]) / ((d + 1) * p[d])
        x = x - step
        if np.max(np.abs(step)) < 1e-16:
            break
    x = (x - x[::-1]) / 2  # exactly antisymmetric
    x[0], x[-1] = -1.0, 1.0
    p = legendre(d, x)
    w = 2.0 / (d * (d + 1) * p[d] ** 2)
    # For LGL points the barycentric weight is proportional to 1 / P_d(xi).
    b = 1.0 / p[d]
    b /= np.max(np.abs(b))
    D = _differentiation(x, b)
    # Discrete orthogonality: sum_k w_k P_i P_j = 2/(2i + 1), except 2/d for i = j = d.
    norm = 2.0 / (2 * np.arange(d + 1) + 1)
    norm[d] = 2.0 / d
    return Rule(d, x, w, b, D, p * w / norm[:, None])


# What an end of a rule may be: one that is summed, one that is not, and one at rest besides.
CLOSED, OPEN, RESTING = range(3)


@immutable
class OpenRule(Rule):
    """A rule that looks at nothing at an open end, and whose polynomials may begin at rest there.

    These are of a degree more for each end at rest: q = sum_k q_k (l_k - sum_e l_k'(e) B_e), where
    B_e vanishes at all nodes, and has the slope one at e and none at the other end at rest.
    """

    def interpolation(self, xi: Array) -> Array:
        """Return what `Rule.interpolation` does."""
        return super().interpolation(xi) - self._bubbles(xi)[0] @ self._end_slopes

    def slopes(self, xi: Array) -> Array:
        """Return what `Rule.slopes` does."""
        plain = self._barycentric(xi) @ _differentiation(self.nodes, self.barycentric)
        return plain - self._bubbles(xi)[1] @ self._end_slopes

    @cached_property
    def other(self) -> Sampling:
        """Sums over other points, none of them at an end."""
        return self._sample(*np.polynomial.legendre.leggauss(self.degree + EXTRA_DEGREES))

    @cached_property
    def _at_rest(self) -> list[int]:
        return [k for k, end in zip((0, -1), self.ends, strict=True) if end == RESTING]

    @cached_property
    def _end_slopes(self) -> Array:
        """The slopes l_k'(e) at the ends at rest, (r, d + 1)."""
        return _differentiation(self.nodes, self.barycentric)[self._at_rest]

    def _bubbles(self, xi: Array) -> tuple[Array, Array]:
        """Return B_e and its slope at the points, (K, r) each."""
        values, slopes = np.empty((2, xi.size, len(self._at_rest)))
        gap = xi[:, None] - self.nodes
        product = gap.prod(axis=1)
        rate = sum(np.delete(gap, k, axis=1).prod(axis=1) for k in range(self.nodes.size))
        for i, k in enumerate(self._at_rest):
            size = np.prod(np.delete(self.nodes[k] - self.nodes, k))
            line, tilt = np.ones(xi.size), 0.0
            if len(self._at_rest) > 1:
                line, tilt = (1 + xi * self.nodes[k]) / 2, self.nodes[k] / 2
            values[:, i] = product * line / size
            slopes[:, i] = (rate * line + product * tilt) / size
        return values, slopes


@cache
def open_rule(degree: int, ends: tuple[int, int]) -> OpenRule:
    """Return the rule with d + 1 nodes that sums over those alone that are at no open end.

    The others are Radau's points, or Gauss's where both ends are open: what is infinite at an end
    of an element has weight zero there, and is never asked for. Exact to degree 2 d - 2, or
    2 d - 3. Where the inertia is infinite at an end, momenta grow as 1 / t, and p dq vanishes there
    for variations at rest alone: so are all polynomials, RESTING.

    References
    ----------
    Canuto, Hussaini, Quarteroni, Zang (2006), section 2.3.1; Garg et al., *Automatica* 46 (2010)
    1843, whose unknowns are these.
    """
    out = [end != CLOSED for end in ends]
    inner = degree + 1 - sum(out)
    if inner < 1:
        raise ValueError(f"expected a degree of 2 at least between two open ends, found {degree}")
    if all(out):
        x, _ = np.polynomial.legendre.leggauss(inner)
    else:  # P_d - P_(d - 1) vanishes at Radau's points with the end 1, P_d + P_(d - 1) with -1
        series = np.append(np.zeros(inner - 1), [1.0 if out[1] else -1.0, 1.0])
        x = np.sort(np.polynomial.legendre.legroots(series).real)
        slope = np.polynomial.legendre.legder(series)
        for _ in range(5):
            x -= np.polynomial.legendre.legval(x, series) / np.polynomial.legendre.legval(x, slope)
        x[0 if out[1] else -1] = -1.0 if out[1] else 1.0
    w = np.linalg.solve(legendre(inner - 1, x), 2.0 * np.eye(inner)[0])
    x, w = np.pad(x, np.array(out, dtype=int)), np.pad(w, np.array(out, dtype=int))
    x[0], x[-1] = -1.0, 1.0
    gap = x[:, None] - x
    np.fill_diagonal(gap, 1.0)
    b = 1.0 / gap.prod(axis=1)
    b /= np.max(np.abs(b))
    rest = np.array([-1.0, 1.0])[[end == RESTING for end in ends]]
    P = np.eye(degree + 1 + rest.size)
    slopes = np.polynomial.legendre.legval(rest, np.polynomial.legendre.legder(P.T))
    rows = np.concatenate([legendre(len(P) - 1, x), slopes], axis=1)
    to_legendre = np.linalg.inv(rows.T)[:, : degree + 1]
    rule = OpenRule(degree, x, w, b, np.empty((0, 0)), to_legendre, ends)
    return replace(rule, derivative=rule.slopes(x))


def _differentiation(x: Array, b: Array) -> Array:
    """Return the slopes l_j'(x_k) of Lagrange's polynomials of nodes with barycentric weights."""
    gap = x[:, None] - x
    np.fill_diagonal(gap, 1.0)
    D = (b / b[:, None]) / gap
    np.fill_diagonal(D, 0.0)
    np.fill_diagonal(D, -D.sum(axis=1))  # rows sum to zero: constants have no velocity
    return D
