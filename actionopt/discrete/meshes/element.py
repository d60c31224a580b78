"""What the unknowns of an element are: its polynomial by what its ends are, and by what is between.

A Lagrangian with derivatives up to that of an order r asks for paths whose first r - 1 derivatives
are continuous. On an element of degree d its polynomial is the one of degree 2 r - 1 that has given
derivatives q, q', ... at both ends (Hermite's), which neighbours share, and a sum of d + 1 - 2 r
polynomials whose first r derivatives vanish there: r-fold integrals of Legendre's, whose own
derivatives of order r do not lose digits to one another (B. Szabo and I. Babuska, *Finite Element
Analysis* (1991), section 6.1). Where r = 1 nodal values do as well, and are used.

In the time xi in [-1, 1] of an element of length h derivatives are (h / 2)^k q^(k).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache, cached_property

import numpy as np

from actionopt.discrete.meshes.mesh import Mesh
from actionopt.tools.blas import by_each
from actionopt.tools.immutable import immutable
from actionopt.tools.lobatto import Rule, lgl
from actionopt.tools.types import Array, NDInt


@immutable
class Element:
    """The polynomials of one degree d, for paths of an order r."""

    rule: Rule
    order: int  # r
    # node, derivative (d + 1,): where each of the unknowns is kept: at which node, and as which
    # derivative. Those of the first and the last node are what they are called; others are
    # coefficients.
    node: NDInt
    derivative: NDInt
    # (d + 1, d + 1): the polynomial and its derivatives by xi up to that of order r, at the nodes,
    # by the unknowns.
    basis: tuple[Array, ...]

    @property
    def ends(self) -> NDInt:
        """Which of the unknowns belong to the ends."""
        return np.r_[: self.order, self.node.size - self.order : self.node.size]

    @cached_property
    def stiffness(self) -> list[list[Array]]:
        """The matrices w_k B_i,ka B_j,kb of derivatives i, j, ((d + 1)^2, d + 1): row (a, b)."""
        return self._weigh(self.basis)

    @cached_property
    def by_increments(self) -> list[list[Array]]:
        """Stiffness where the ends' values are differences from the `taylor` series there."""
        bases, (rows, _) = [basis.copy() for basis in self.basis], self.taylor
        for basis in bases:
            basis[:, : self.order] = 0.0
        for basis, row in zip(bases, rows, strict=False):
            basis[:, : self.order] = row
        return self._weigh(bases)

    def _weigh(self, bases: Sequence[Array]) -> list[list[Array]]:
        w, count = self.rule.weights, self.rule.degree + 1
        return [
            [np.einsum("k,ka,kb->abk", w, x, y).reshape(count * count, -1) for y in bases]
            for x in bases
        ]

    @cached_property
    def taylor(self) -> tuple[list[Array], Array]:
        """Matrices from derivatives at the start to those at the nodes, and at the end, (r, r).

        By (xi + 1)^k / k!, k < r: for each derivative a matrix (d + 1, r), and their last rows.
        """
        powers = np.arange(self.order)
        factorial = np.array([math.factorial(k) for k in powers])
        monomials = (self.rule.nodes[:, None] + 1) ** powers / factorial
        rows = [np.roll(monomials, k, axis=1) * (powers >= k) for k in powers]
        return rows, np.stack([row[-1] for row in rows])

    @cached_property
    def contact(self) -> tuple[Array, NDInt]:
        """What holds a function at zero, by its values at the nodes, and its powers of h / 2.

        A row for each unknown (d + 1, d + 1): derivatives at the ends, and between its integrals
        times Legendre's polynomials. (Both ends may be held alone, or what is between: the forces
        that do so are impulses at the ends, and functions between that need not vanish there.)
        """
        x, w, r = self.rule.nodes, self.rule.weights, self.order
        rows = np.zeros((x.size, x.size))
        for k in range(r):
            power = np.linalg.matrix_power(self.rule.derivative, k)
            rows[k], rows[k - r] = power[0], power[-1]
        inner = x.size - 2 * r
        rows[r : r + inner] = w * np.polynomial.legendre.legvander(x, inner)[:, :inner].T
        return rows, np.where(np.isin(np.arange(x.size), self.ends), -self.derivative, 1)

    def derivatives(self, local: Array) -> list[Array]:
        """Return the derivatives by xi at the nodes, up to that of order r, (E, d + 1, n) each.

        The unknowns (E, d + 1, n) are in the time xi. What the start alone makes of the polynomial,
        which has no derivative of order r, is taken out first: on short elements its round-off
        would hold the path as springs do, to whatever `basis` happens to be rounded to.
        """
        r, (rows, ends) = self.order, self.taylor
        start, rest = local[:, :r], local.copy()
        rest[:, :r] = 0.0
        for k in range(r):  # the largest first: the difference of neighbours is exact
            for j in range(k, r):
                rest[:, k - r] -= ends[k, j] * start[:, j]
        found = [by_each(basis, rest) for basis in self.basis]
        for part, row in zip(found, rows, strict=False):
            part += by_each(row, start)
        return found

    @cached_property
    def fit(self) -> tuple[Array, Array]:
        """The matrix from values between the ends (d - 1) to coefficients; and values of the ends.

        Coefficients (d + 1 - 2 r,) of values less those that the ends make: least squares.
        """
        inner, r = self.basis[0][1:-1], self.order
        return np.linalg.pinv(inner[:, r:-r]), inner[:, self.ends]

    def scale(self, half: Array) -> Array:
        """Return the factors of derivatives by the time, (E, d + 1), for half the lengths (E,)."""
        return half[:, None] ** self.derivative


@cache
def element(degree: int, order: int) -> Element:
    """Return the polynomials of a degree for paths of an order.

    Raises ValueError for a degree below 2 order - 1, which has fewer unknowns than its ends ask.
    """
    if degree < 2 * order - 1:
        raise ValueError(
            f"expected elements of degree {2 * order - 1} at least for a Lagrangian with "
            f"derivatives of order {order}, found degree {degree}: its path has {order - 1} "
            "continuous derivatives"
        )
    rule, ends, legendre = lgl(degree), np.arange(order), np.polynomial.legendre
    inner = np.arange(order, degree - order + 1)
    node = np.r_[0 * ends, inner, 0 * ends + degree]
    derivative = np.r_[ends, 0 * inner, ends]
    rows = [_hermite(side, k, order) for side in (-1, 1) for k in range(order)]
    rows[order:order] = [_bubble(degree_of, order) for degree_of in range(2 * order, degree + 1)]
    basis = tuple(
        np.stack([legendre.legval(rule.nodes, legendre.legder(c, i)) for c in rows], axis=1)
        for i in range(order + 1)
    )
    for i in range(order):  # what they are at the ends is known without round-off
        for side, first in ((0, 0), (-1, degree + 1 - order)):
            basis[i][side] = 0.0
            basis[i][side, first + i] = 1.0
    return Element(rule, order, node, derivative, basis)


def _hermite(side: int, derivative: int, order: int) -> Array:
    """Return the Legendre coefficients of the polynomial with one derivative one at one end."""
    count, legendre = 2 * order, np.polynomial.legendre
    table = [
        [legendre.legval(x, legendre.legder(row, k)) for row in np.eye(count)]
        for x in (-1.0, 1.0)
        for k in range(order)
    ]
    wanted = np.zeros(count)
    wanted[(side > 0) * order + derivative] = 1.0
    return np.linalg.solve(table, wanted)


def _bubble(degree: int, order: int) -> Array:
    """Return coefficients of the r-fold integral of a normalized Legendre polynomial.

    So Newton's matrix is of one size in all of them.
    """
    k = degree - order
    return np.polynomial.legendre.legint(np.eye(k + 1)[-1] * np.sqrt(k + 0.5), order, lbnd=-1)


def with_degrees(mesh: Mesh, order: int) -> Mesh:
    """Return a mesh whose elements have the degrees that paths of an order need."""
    least = 2 * order - 1
    if min(mesh.degrees) >= least:
        return mesh
    return mesh.cut(mesh.since, np.maximum(mesh.degrees, least))
