"""A program that is written down: f and c as expressions of its unknowns.

Derivatives are made when they are first asked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from actionopt.suite.program import Program
from actionopt.tools.types import Array, NDInt

Sides = tuple[float | Array, float | Array]  # a lower and an upper bound, of one number or all


class WrittenProgram(Program):
    """A nonlinear program of CasADi's expressions.

    Parameters
    ----------
    name : str
    x : casadi.SX
        The unknowns, (n, 1).
    f : casadi.SX
    c : casadi.SX, optional
        The rows, (m, 1).
    bounds, rows : (lower, upper), optional
        Of x: none by default. Of c: zeros.
    unit : float or (n,) array
        Size of the unknowns.
    names : sequence of str, optional
        Of the unknowns; "x[0]" ... by default.
    residuals : casadi.SX, optional
        Of a sum of squares, f = r'r / 2: (k, 1).
    complements : sequence of (i, r), optional
        Unknowns x_i >= 0 and rows c_r >= 0 of which one is zero; no function says so.
    """

    def __init__(
        self,
        name: str,
        x: ca.SX,
        f: ca.SX,
        c: ca.SX | None = None,
        *,
        bounds: Sides = (-np.inf, np.inf),
        rows: Sides = (0.0, 0.0),
        unit: float | Array = 1.0,
        names: Sequence[str] = (),
        residuals: ca.SX | None = None,
        complements: Sequence[tuple[int, int]] = (),
    ) -> None:
        Program.__init__(self)
        self.complements = tuple(complements)
        self.x, self.f, self.r = x, f, residuals
        self.c = ca.densify(c) if c is not None else ca.SX(0, 1)
        self._name, self._names = name, names
        self._bounds = _spread(bounds, x.numel())
        self._rows = _spread(rows, self.c.numel())
        self._unit = np.broadcast_to(np.asarray(unit, dtype=float), (x.numel(),))

    def view(self) -> Program:
        """Return the same functions with counts of their own, and no answer anywhere near."""
        return WrittenProgram(
            self._name,
            self.x,
            self.f,
            self.c,
            bounds=self._bounds,
            rows=self._rows,
            unit=self._unit,
            names=self._names,
            residuals=self.r,
            complements=self.complements,
        )

    # -- what it is --------------------------------------------------------------------------

    @property
    def name(self) -> str:
        """Its name."""
        return self._name

    @property
    def n(self) -> int:
        """Number of unknowns."""
        return self.x.numel()

    @property
    def m(self) -> int:
        """Number of constraint rows."""
        return self.c.numel()

    @property
    def variable_names(self) -> list[str]:
        """Those given, else "x[0]" and so on."""
        return list(self._names) or [f"x[{k}]" for k in range(self.n)]

    @property
    def constraint_names(self) -> list[str]:
        """Names "c[0]" and so on."""
        return [f"c[{k}]" for k in range(self.m)]

    @property
    def classification(self) -> str:
        """The class in the manner of CUTEst, as "QLR2-MN-31-0"."""
        slopes = self._slopes
        objective = "L" if not ca.depends_on(slopes, self.x) else "O"
        if objective == "O" and not ca.depends_on(ca.jacobian(slopes, self.x), self.x):
            objective = "Q"
        objective = objective if self.r is None else "S"
        kind = "B" if self.has_bounds else "U"
        if self.m:
            rows = ca.jacobian(self.c, self.x).nz[:]
            kind = "L" if self.linear_rows.all() else "O"
            if kind == "O" and not ca.depends_on(ca.jacobian(rows, self.x), self.x):
                kind = "Q"
        return f"{objective}{kind}R2-MN-{self.n}-{self.m}"

    @property
    def unit(self) -> Array:
        """Size of each unknown, (n,)."""
        return self._unit

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds of x, each (n,); infinite where there are none."""
        return self._bounds

    @property
    def constraint_bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds of c, each (m,): the same where the row is an equation."""
        return self._rows

    @cached_property
    def linear_rows(self) -> NDArray[np.bool_]:
        """Which rows of c are linear in x, (m,)."""
        rows = self.jacobian_structure[0]
        curved = ca.which_depends(ca.jacobian(self.c, self.x).nz[:], self.x, 1, True)
        found = np.ones(self.m, dtype=bool)
        found[rows[np.array(curved, dtype=bool)]] = False
        return found

    @property
    def jacobian_structure(self) -> tuple[NDInt, NDInt]:
        """Rows and columns of the nonzeros of the Jacobian, by columns."""
        return _places(self._jacobian_function.sparsity_out(0))

    @property
    def hessian_structure(self) -> tuple[NDInt, NDInt]:
        """Rows and columns of the nonzeros of the Hessian's upper triangle, by columns."""
        return _places(self._hessian_function.sparsity_out(0))

    @property
    def functions(self) -> tuple[str, ...]:
        """Names of the functions that a solver is given."""
        return super().functions + (() if self.r is None else ("residuals", "residual_jacobian"))

    def expression(self) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Return x, f and c."""
        return self.x, self.f, self.c

    # -- functions ---------------------------------------------------------------------------

    def residuals(self, x: Array) -> Array:
        """Return r(x), (k,), where f = r'r / 2."""
        self.counts["r"] += 1
        return np.array(self._residual_functions[0](x)).ravel()

    def residual_jacobian(self, x: Array) -> Array:
        """Return dr/dx, (k, n)."""
        self.counts["rjac"] += 1
        return np.array(ca.densify(self._residual_functions[1](x)))

    @cached_property
    def _residual_functions(self) -> tuple[ca.Function, ca.Function]:
        if self.r is None:
            raise ValueError(
                f"expected a sum of squares, found {self.name}, which has no residuals"
            )
        slopes = ca.jacobian(self.r, self.x)
        return ca.Function("r", [self.x], [self.r]), ca.Function("slopes", [self.x], [slopes])

    def slope_and_curvature(self, x: Array) -> tuple[ca.DM, ca.DM]:
        """Return the gradient of f, (n, 1), and its Hessian, sparse (n, n); neither is counted."""
        curved = self._hessian_function(x, np.zeros(self.m), 1.0)
        return self._gradient_function(x), ca.triu2symm(curved)

    @cached_property
    def _slopes(self) -> ca.SX:
        return ca.gradient(self.f, self.x)

    @cached_property
    def _value_function(self) -> ca.Function:
        return ca.Function("f", [self.x], [self.f])

    @cached_property
    def _gradient_function(self) -> ca.Function:
        return ca.Function("gradient", [self.x], [ca.densify(self._slopes)])

    @cached_property
    def _row_function(self) -> ca.Function:
        return ca.Function("c", [self.x], [self.c])

    @cached_property
    def _jacobian_function(self) -> ca.Function:
        return ca.Function("slopes", [self.x], [ca.jacobian(self.c, self.x)])

    @cached_property
    def _hessian_function(self) -> ca.Function:
        lam, factor = ca.SX.sym("lam", self.m), ca.SX.sym("factor")
        slope = factor * self._slopes + ca.jtimes(self.c, self.x, lam, True)
        whole = ca.jacobian(slope, self.x, {"symmetric": True})
        return ca.Function("curvature", [self.x, lam, factor], [ca.triu(whole)])

    def _objective(self, x: Array) -> float:
        return float(self._value_function(x))

    def _gradient(self, x: Array) -> Array:
        return np.array(self._gradient_function(x)).ravel()

    def _constraints(self, x: Array) -> Array:
        return np.array(self._row_function(x)).ravel()

    def _jacobian(self, x: Array) -> Array:
        return np.array(self._jacobian_function(x).nonzeros())

    def _hessian(self, x: Array, lam: Array | None, factor: float) -> Array:
        lam = np.zeros(self.m) if lam is None else lam
        return np.array(self._hessian_function(x, lam, factor).nonzeros())


def _places(sparsity: ca.Sparsity) -> tuple[NDInt, NDInt]:
    rows, cols = sparsity.get_triplet()
    return np.array(rows, dtype=np.intp), np.array(cols, dtype=np.intp)


def _spread(sides: Sides, count: int) -> tuple[Array, Array]:
    lower, upper = (np.broadcast_to(np.asarray(s, dtype=float), (count,)) for s in sides)
    return np.array(lower), np.array(upper)
