r"""Constraints given in differential form, a(q) . q' = 0, and when they are holonomic.

Rows of coefficients a_i(q) leave at each q the motions Z with A Z = 0. They are conditions on the
coordinates in disguise if and only if going round a small loop of such motions leads back,

    z . (d a_i) w = 0 for all z, w in Z,    (d a_i)_jk = d a_ij / d q_k - d a_ik / d q_j

(Frobenius). Then the configurations that can be reached form a surface f(q) = 0, and f is an
integral. Otherwise more configurations can be reached than there are motions at any instant, no
f exists, and the system is non-holonomic.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from actionopt.mechanics.laws.expressions import Expressions
from actionopt.mechanics.laws.identity import CANCELLED, general_points
from actionopt.mechanics.laws.tracing import ParameterTable, call, column, parameter_names
from actionopt.tools.checks import numbers
from actionopt.tools.lobatto import lgl
from actionopt.tools.types import RANK, Array

Rows = Callable[..., Any]

# Ad hoc, all of them; what a leaf's error comes to is checked (`_defect`).
LINE_POINTS = 24  # Gauss-Legendre points of a line integral: exact for coefficients up to q^47
LEAF_PANELS = (1, 2, 4)  # of the integration of a leaf: as many as it takes
LEAF_DEGREE, PICARD_SWEEPS = 10, 12  # on each panel: a sweep gains an order, and two to be sure
LEAF_ACCURACY = 1e-12  # of the leaf's slope, at a distance `reach`


@dataclass(frozen=True)
class Frobenius:
    """The result of the test of integrability."""

    exact: bool  # whether each row is a differential by itself, d a_i = 0
    integrable: bool  # whether all rows together are holonomic
    row: int | None  # the first row that is not
    # Largest z . (d a_i) w, relative to the derivatives of the rows; 0 if integrable.
    defect: float


def frobenius(
    rows: Rows, n: int, *, parameters: Mapping[str, ArrayLike] | None = None
) -> Frobenius:
    """Test the differential constraints `rows(q, *, ...)` on n coordinates for integrability.

    The derivatives are symbolic; that they vanish is seen at points in general position.
    Arguments and errors are as for `integrate_pfaffian`.

    References
    ----------
    Frankel, *The Geometry of Physics* (3rd ed. 2012), section 6.1.

    Examples
    --------
    >>> frobenius(lambda q: [-q[1], q[0]], 2).integrable  # any one row in two coordinates
    True
    >>> frobenius(lambda q: [-q[1], q[0], 1.0], 3).integrable  # a screw dislocation
    False
    """
    q, p, A, packed = _symbols(rows, n, parameters)
    slopes = ca.vertcat(*[ca.jacobian(A[i, :], q) for i in range(A.shape[0])])
    evaluate = ca.Function("frobenius", [q, p], [ca.densify(A), ca.densify(slopes)])
    m = A.shape[0]
    exact, defects = True, np.full(m, -1.0)
    for point in general_points(n):
        a, J = (np.asarray(x) for x in evaluate(point, packed))
        if not (np.isfinite(a).all() and np.isfinite(J).all()):
            continue
        _, values, right = np.linalg.svd(a)
        if m > n or values[-1] <= RANK * values[0]:
            raise ValueError(
                f"expected {m} independent rows of coefficients, found that they are dependent "
                f"at q = {point.tolist()}; leave out what the others say already"
            )
        Z = right[m:].T
        for i in range(m):
            slope = J[i * n : (i + 1) * n]
            curl, size = slope - slope.T, float(np.max(np.abs(slope))) or 1.0
            exact = exact and bool(np.max(np.abs(curl)) <= CANCELLED * size)
            around = np.max(np.abs(Z.T @ curl @ Z), initial=0.0) / size
            defects[i] = max(defects[i], float(around))
    worst = float(np.max(defects))
    if worst < 0:
        raise ValueError(
            "expected coefficients that are finite at some coordinates of size one, found none; "
            "give the rows in units in which they are"
        )
    if worst <= CANCELLED:
        return Frobenius(exact, True, None, 0.0)
    return Frobenius(False, False, int(np.flatnonzero(defects > CANCELLED)[0]), worst)


def integrate_pfaffian(
    rows: Rows,
    through: ArrayLike,
    *,
    parameters: Mapping[str, ArrayLike] | None = None,
) -> Callable[..., Any]:
    """Return the holonomic constraint f(q, t) = 0 that rows a(q) . q' = 0 amount to.

    Parameters
    ----------
    rows : callable
        `rows(q, *, ...)` returns the n coefficients of one condition, or a sequence of m such
        rows. It names the parameters it uses.
    through : (n,) array
        A configuration that the system passes through, such as its start: velocities alone do
        not say where it is.
    parameters : mapping, optional
        Values of the parameters, for the test of integrability.

    Returns
    -------
    callable
        f(q, t, *, ...) for `System(..., constraint=f)`. Where each row is a differential, f_i is
        its line integral, G = A, and the multipliers are those of the rows. Otherwise f = y -
        Y(x) for some m of the coordinates y, with G = A_y^-1 A on the surface, integrated
        numerically along straight lines in x: accurate to 1e-12 as far as one from `through`, and
        a long expression.

    Raises
    ------
    ValueError
        If the rows cannot be integrated: the system is non-holonomic; if they are dependent, do
        not fit the coordinates, or an integral cannot be followed.

    References
    ----------
    *Competitive Physics: Mechanics and Waves* (2018), section 12.4, p. 634.

    Examples
    --------
    >>> from actionopt import System
    >>> rolling = integrate_pfaffian(lambda q, *, R: [1.0, -R], [0.0, 0.0], parameters={"R": 0.2})
    >>> cylinder = System(
    ...     lambda q, v, t: v @ v / 2, ["x", "phi"], parameters={"R": 0.2}, constraint=rolling
    ... )
    >>> cylinder.degrees_of_freedom
    1
    """
    if not callable(rows):
        raise ValueError(
            f"expected integrate_pfaffian(rows, through), rows a callable rows(q), found {rows!r}"
        )
    start = np.atleast_1d(numbers(through, "through, a configuration"))
    if start.ndim != 1 or not np.isfinite(start).all():
        raise ValueError(f"expected finite coordinates of shape (n,) as through, found {through!r}")
    n = start.size
    found = frobenius(rows, n, parameters=parameters)
    if not found.integrable:
        m = _symbols(rows, n, parameters)[2].shape[0]
        raise ValueError(
            "expected velocity conditions that are conditions on the coordinates in disguise, "
            f"found that row {found.row} is not: going round a small loop of allowed motions "
            f"leads elsewhere (by {found.defect:.2g} of its coefficients' slope, Frobenius). Only "
            f"{n - m} velocities are free at any instant, and yet more than {n - m} coordinates "
            "are needed to say where it is, as for a sphere rolling on a plane: the system is "
            "non-holonomic, and f(q, t) = 0 with multipliers does not describe it. Restrict the "
            "motion (rolling along one line), or leave the condition out"
        )
    if found.exact:
        return _constraint(rows, n, lambda matrix, q: _line_integral(matrix, start, q))
    dependent = _pivots(_numbers(rows, start, parameters))
    for panels in LEAF_PANELS:
        constraint = _constraint(
            rows, n, lambda matrix, q, k=panels: _leaf(matrix, start, dependent, q, k)
        )
        defect = _defect(constraint, rows, start, dependent, parameters)
        if defect <= LEAF_ACCURACY:
            return constraint
    raise ValueError(
        f"expected an integral of the rows as far as 1 from {start.tolist()}, found that it can "
        f"be followed only to {defect:.1e} of its slope; give coordinates in larger units, or the "
        "constraint as f(q, t) = 0 if it is known"
    )


def _constraint(rows: Rows, n: int, make: Callable[..., ca.SX]) -> Callable[..., Any]:
    """Return `make(A as a function of q, q)` with the signature of a constraint."""

    def constraint(q, t, **values):
        f = make(lambda at: _matrix(rows, at, values), column(q, "coordinates", n))
        return [f[i] for i in range(f.numel())]

    names = [k for k in parameter_names(rows, "pfaffian", ["q"]) if k != "**"]
    plain, named = inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY
    taken = [inspect.Parameter(k, plain) for k in ("q", "t")]
    taken += [inspect.Parameter(k, named) for k in names]
    constraint.__signature__ = inspect.Signature(taken)  # type: ignore[attr-defined]
    return constraint


def _symbols(rows: Rows, n: int, parameters) -> tuple[ca.SX, ca.SX, ca.SX, Array]:
    """Return q, the packed parameters, A(q) as (m, n) and the parameters' values."""
    table = ParameterTable(parameters)
    p = table.symbols()
    named = table.by_name(p)
    q = ca.SX.sym("q", n)
    return q, p, _matrix(rows, q, named), table.pack(table.values())


def _matrix(rows: Rows, q: ca.SX, values: Mapping[str, Any]) -> ca.SX:
    n = q.numel()
    given, _ = call(rows, "pfaffian", {"q": Expressions(q, 1)}, values)
    nested = isinstance(given, (list, tuple)) and isinstance(given[0], (list, tuple, np.ndarray))
    lists = given if nested else [given]
    return ca.vertcat(*[column(row, "pfaffian", n).T for row in lists])


def _line_integral(matrix: Callable[[ca.SX], ca.SX], start: Array, q: ca.SX) -> ca.SX:
    """Return f_i = int a_i . dq along the straight line from `start` to q."""
    x, w = np.polynomial.legendre.leggauss(LINE_POINTS)
    step = q - start
    at = zip((x + 1) / 2, w / 2, strict=True)
    return sum((weight * (matrix(start + s * step) @ step) for s, weight in at), ca.SX(0))


def _leaf(
    matrix: Callable[[ca.SX], ca.SX], start: Array, dependent: list[int], q: ca.SX, panels: int
) -> ca.SX:
    """Return f = y - Y(x), where dY = -A_y^-1 A_x dx along the straight line in x.

    On each panel the collocation equations at Lobatto nodes are solved by Picard's iteration,
    whose k-th sweep leaves (L h)^k / k! for a Lipschitz constant L. It is an expression in q,
    which Newton's method would not be.
    """
    n = start.size
    independent = [i for i in range(n) if i not in dependent]
    rule = lgl(LEAF_DEGREE)
    integrate = np.linalg.inv(2 * panels * rule.derivative[1:, 1:])
    step = q[independent] - start[independent]
    y = ca.SX(start[dependent])
    for panel in range(panels):
        nodes = (panel + (rule.nodes[1:] + 1) / 2) / panels
        values = [y] * LEAF_DEGREE
        for _ in range(PICARD_SWEEPS):
            slopes = []
            for s, value in zip(nodes, values, strict=True):
                at = ca.SX(n, 1)
                at[independent], at[dependent] = start[independent] + s * step, value
                A = matrix(at)
                slopes.append(-ca.solve(A[:, dependent], A[:, independent] @ step))
            values = [
                y + sum((c * F for c, F in zip(row, slopes, strict=True)), ca.SX(0))
                for row in integrate
            ]
        y = values[-1]
    return q[dependent] - y


def _pivots(A: Array) -> list[int]:
    """Return m columns of A (m, n) that are independent, by elimination with full pivoting."""
    remainder, chosen = A.copy(), []
    for _ in range(len(A)):
        i, j = np.unravel_index(np.argmax(np.abs(remainder)), remainder.shape)
        if not abs(remainder[i, j]) > RANK * np.max(np.abs(A)):
            raise ValueError(
                "expected independent rows at the configuration `through`, found that they are "
                "dependent or zero there; choose another one that the motion passes"
            )
        chosen.append(int(j))
        remainder = remainder - np.outer(remainder[:, j], remainder[i] / remainder[i, j])
        remainder[i] = 0.0
    return sorted(chosen)


def _numbers(rows: Rows, at: Array, parameters) -> Array:
    """Return A at one configuration, (m, n)."""
    q, p, A, packed = _symbols(rows, at.size, parameters)
    return np.asarray(ca.Function("rows", [q, p], [ca.densify(A)])(at, packed))


def _defect(constraint, rows: Rows, start: Array, dependent: list[int], parameters) -> float:
    """Return the slope of f along allowed motions, relative to its largest, at distance one."""
    q, t = ca.SX.sym("q", start.size), ca.SX.sym("t")
    table = ParameterTable(parameters)
    values = {
        k: x for k, x in table.values().items() if k in parameter_names(constraint, "", ["q", "t"])
    }
    f = ca.vertcat(*constraint(q, t, **values))
    evaluate = ca.Function("leaf", [q], [f, ca.densify(ca.jacobian(f, q))])
    worst = 0.0
    for shift in general_points(start.size, 6):
        at = start + shift / np.linalg.norm(shift)
        at[dependent] -= np.asarray(evaluate(at)[0]).ravel()  # onto the leaf: f = y - Y(x)
        G, A = np.asarray(evaluate(at)[1]), _numbers(rows, at, parameters)
        if not (np.isfinite(A).all() and np.isfinite(G).all()):
            return np.inf
        along = np.linalg.svd(A)[2][len(A) :].T
        worst = max(worst, float(np.max(np.abs(G @ along), initial=0.0) / np.max(np.abs(G))))
    return worst
