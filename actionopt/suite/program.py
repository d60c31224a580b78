"""What a solver is given: the functions of a nonlinear program, counted, and nothing of its answer.

    minimise f(x) subject to c(x) = 0,      grad f(x) + J(x)' lam = 0 at a stationary point

or to c_lower <= c(x) <= c_upper and x_lower <= x <= x_upper, where a member has inequalities: then
grad f + J' lam + z = 0, lam and z being >= 0 at an upper bound, <= 0 at a lower one, else 0.
"""

from __future__ import annotations

import copy
import os
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from actionopt.tools.types import Array, NDInt

GIVEN_FUNCTIONS = (
    *("objective", "gradient", "constraints"),
    *("jacobian", "hessian", "hessian_product"),
)


class Program(ABC):
    """A nonlinear program: functions of x (n,), all counted.

    `objective`, `gradient`, `constraints`, and the nonzeros `jacobian` and `hessian`, flat, in the
    order of `jacobian_structure` and `hessian_structure`.

    Attributes
    ----------
    counts : Counter
        Evaluations by name: f, grad, c, jac, hess, hprod; r and rjac of residuals.
    visited : list of (n,) arrays, or None
        Where f was evaluated, in this order, if it is to be kept: set it to [].
    """

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self.visited: list[Array] | None = None

    @abstractmethod
    def view(self) -> Program:
        """Return the same functions with counts of their own, and no answer anywhere near."""

    def forget(self) -> None:  # noqa: B027
        """Forget what is kept of the problems that were made before."""

    # -- what it is --------------------------------------------------------------------------

    @property
    @abstractmethod
    def name(self) -> str:
        """What it is called."""

    @property
    @abstractmethod
    def n(self) -> int:
        """Number of unknowns."""

    @property
    @abstractmethod
    def m(self) -> int:
        """Number of constraint rows."""

    @property
    @abstractmethod
    def variable_names(self) -> list[str]:
        """A name of each unknown."""

    @property
    @abstractmethod
    def constraint_names(self) -> list[str]:
        """A name of each row."""

    @property
    @abstractmethod
    def classification(self) -> str:
        """The class in the manner of CUTEst, as "QUR2-MN-31-0".

        Objective Linear, Quadratic, a Sum of squares or Other; constraints Unconstrained (none),
        Bounds alone, Linear, Quadratic or Other; Regular, with second derivatives; a Model; No
        internal variables; n, m.
        """

    @property
    @abstractmethod
    def unit(self) -> Array:
        """Size of each unknown, (n,)."""

    @property
    @abstractmethod
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds of x, each (n,); infinite where there are none."""

    @property
    @abstractmethod
    def constraint_bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds of c, each (m,): the same where the row is an equation."""

    @property
    @abstractmethod
    def linear_rows(self) -> NDArray[np.bool_]:
        """Which rows of c are linear in x, (m,)."""

    @property
    @abstractmethod
    def jacobian_structure(self) -> tuple[NDInt, NDInt]:
        """Rows and columns of the nonzeros of the Jacobian, by columns."""

    @property
    @abstractmethod
    def hessian_structure(self) -> tuple[NDInt, NDInt]:
        """Rows and columns of the nonzeros of the Hessian's upper triangle, by columns."""

    @abstractmethod
    def expression(self) -> tuple[Any, Any, Any]:
        """Return x, f and c as expressions of CasADi's."""

    @property
    def functions(self) -> tuple[str, ...]:
        """Names of the functions that a solver is given."""
        return GIVEN_FUNCTIONS

    @property
    def smooth(self) -> bool:
        """Whether there are derivatives."""
        return True

    @property
    def nnz_jacobian(self) -> int:
        """Structural nonzeros of the Jacobian."""
        return self.jacobian_structure[0].size

    @property
    def nnz_hessian(self) -> int:
        """Structural nonzeros of the upper triangle of the Hessian of the Lagrangian."""
        return self.hessian_structure[0].size

    @property
    def has_bounds(self) -> bool:
        """Whether x has bounds."""
        return bool(np.isfinite(self.bounds).any())

    @property
    def inequalities(self) -> bool:
        """Whether anything may hold strictly: a bound of x, or a row that is no equation."""
        lower, upper = self.constraint_bounds
        return self.has_bounds or bool(np.any(lower < upper))

    # -- functions ---------------------------------------------------------------------------

    def objective(self, x: Array) -> float:
        """Return f(x)."""
        self.counts["f"] += 1
        self.note(x)
        return self._objective(x)

    def note(self, x: Array) -> None:
        """Keep x among the points visited, if they are kept."""
        if self.visited is not None:
            self.visited.append(np.array(x, dtype=float).ravel())

    def gradient(self, x: Array) -> Array:
        """Return grad f(x), (n,)."""
        self.counts["grad"] += 1
        return self._gradient(x)

    def constraints(self, x: Array) -> Array:
        """Return c(x), (m,)."""
        self.counts["c"] += 1
        return self._constraints(x) if self.m else np.zeros(0)

    def jacobian(self, x: Array) -> Array:
        """Return the nonzeros of dc/dx, flat, in the order of `jacobian_structure`."""
        self.counts["jac"] += 1
        return self._jacobian(x) if self.m else np.zeros(0)

    def hessian(self, x: Array, lam: Array | None = None, factor: float = 1.0) -> Array:
        """Return the nonzeros, flat, of the upper triangle of factor * f'' + sum lam c''."""
        self.counts["hess"] += 1
        return self._hessian(x, lam, factor)

    def hessian_product(
        self, x: Array, lam: Array | None, direction: Array, factor: float = 1.0
    ) -> Array:
        """Return the Hessian of the Lagrangian times a direction, (n,)."""
        self.counts["hprod"] += 1
        rows, cols = self.hessian_structure
        values = self._hessian(x, lam, factor)
        product = np.bincount(rows, values * direction[cols], self.n)
        off = rows != cols
        return product + np.bincount(cols[off], values[off] * direction[rows[off]], self.n)

    # What is not counted.
    # fmt: off
    @abstractmethod
    def _objective(self, x: Array, /) -> float: ...
    @abstractmethod
    def _gradient(self, x: Array, /) -> Array: ...
    @abstractmethod
    def _constraints(self, x: Array, /) -> Array: ...
    @abstractmethod
    def _jacobian(self, x: Array, /) -> Array: ...
    @abstractmethod
    def _hessian(self, x: Array, lam: Array | None, factor: float, /) -> Array: ...
    # fmt: on


GIVEN = (
    "n m classification has_bounds inequalities bounds constraint_bounds linear_rows nnz_jacobian "
    "nnz_hessian jacobian_structure hessian_structure"
).split()


class Given:
    """The numbers and functions of a program: nothing of its counts, nor of where it is from.

    Those of `Program`, by the same names; arrays are copies. The functions raise RuntimeError in
    another process than this one, such as a fork of it: they would be counted there, and lost.
    """

    def __init__(self, program: Program) -> None:
        for name in GIVEN:
            setattr(self, name, copy.deepcopy(getattr(program, name)))
        for name in program.functions:
            setattr(self, name, _alone(getattr(program, name)))


def _alone(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that is no method: nothing that it belongs to is at hand."""
    home = os.getpid()

    def alone(*arguments: Any, **named: Any) -> Any:
        if os.getpid() != home:
            raise RuntimeError("expected calls in the process of the solver, found another process")
        return function(*arguments, **named)

    return alone
