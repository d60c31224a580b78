"""A test problem under the names and conventions of PyCUTEst's `CUTEstProblem`.

Source: J. Fowkes, L. Roberts and A. Burmen, *PyCUTEst: an open source Python package of
optimization test problems*, J. Open Source Software 7 (2022), 4377, and its documentation.
"""

from __future__ import annotations

from collections import Counter
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from actionopt.suite.member import Member
from actionopt.suite.sparse import whole
from actionopt.tools.types import Array

INFINITE = 1e20  # CUTEst's


class Cutest:
    """A test problem as PyCUTEst has them.

    The Lagrangian is f + v'c, cl <= c(x) <= cu and bl <= x <= bu, bounds that are none being
    -1e20 and 1e20. The methods that begin with s, and `isphess` and `gradsphess`, return
    scipy.sparse.coo_matrix, of shape (1, n) for a vector; the others are dense. `hprod` and `jprod`
    without x use the last Hessian and the last Jacobian that any method computed.

    What is of constraints is None where there are none: v0, cl, cu, is_eq_cons, is_linear_cons,
    nnzj, eq_cons_first, linear_cons_first, and what `cons`, `scons`, `lag` and `jprod` return.

    Parameters
    ----------
    problem : Member
    start : str, optional
        The starting point x0; the problem's own by default.

    Raises
    ------
    RuntimeError
        Of all methods: for x, p or v of another shape, v where there are no constraints, and
        products without x before anything was computed.
    AssertionError
        Of methods with a Hessian of the Lagrangian: for no v where there are constraints; for an
        index of no constraint.
    """

    def __init__(self, problem: Member, start: str | None = None) -> None:
        clock = process_time()
        self.problem = problem
        n, m = problem.n, problem.m
        self.name, self.n, self.m = problem.name, n, m
        self.x0 = problem.start(start)
        self.sifParams: dict[str, Any] | None = dict(problem.parameters) or None
        self.sifOptions: list[str] | None = None
        self.vartype = np.zeros(n, dtype=int)
        self.bl, self.bu = (np.clip(side, -INFINITE, INFINITE) for side in problem.bounds)
        self.nnzh = problem.nnz_hessian
        self.nonlinear_vars_first = True  # none is linear
        self.drop_fixed_vars = True  # and none is fixed
        self.n_full, self.n_free, self.n_fixed = n, n, 0
        self.idx_eq, self.idx_free = np.zeros(0, dtype=int), np.arange(n)
        self.v0: Any = None
        self.cl: Any = None
        self.cu: Any = None
        self.is_eq_cons: Any = None
        self.is_linear_cons: Any = None
        self.nnzj: int | None = None
        self.eq_cons_first: bool | None = None
        self.linear_cons_first: bool | None = None
        if m:
            self.v0 = np.zeros(m)
            self.cl, self.cu = (
                np.clip(side, -INFINITE, INFINITE) for side in problem.constraint_bounds
            )
            self.is_eq_cons = self.cl == self.cu
            self.is_linear_cons = problem.linear_rows
            self.nnzj = problem.nnz_jacobian
            self.eq_cons_first = _first(self.is_eq_cons)
            self.linear_cons_first = _first(self.is_linear_cons)
        self._jacobian: Array | None = None  # nonzeros
        self._hessian: Array | None = None  # nonzeros
        self._counts: Counter[str] = Counter()
        self._setup = process_time() - clock
        self._started = process_time()

    def __str__(self) -> str:
        """Return its name, parameters and sizes."""
        params = f"params {self.sifParams}" if self.sifParams else "default params"
        return (
            f"CUTEst problem {self.name} ({params}) with {self.n} variables and "
            f"{self.m} constraints"
        )

    # -- variables and names -----------------------------------------------------------------

    def all_to_free(self, x: Array) -> Array:
        """Return x without the fixed variables, of which there are none."""
        return x[self.idx_free]

    def free_to_all(self, x: Array, use_zeros: bool = False) -> Array:
        """Return x with the fixed variables, of which there are none."""
        return np.array(x, dtype=float)

    def varnames(self) -> list[str]:
        """Return the names of the variables: coordinate and node."""
        return self.problem.variable_names

    def connames(self) -> list[str]:
        """Return the names of the constraints: function and node."""
        return self.problem.constraint_names

    def check_input_x(self, x: Array) -> None:
        """Raise RuntimeError for a vector of other than n entries."""
        if np.shape(x) != (self.n,):
            raise RuntimeError(f"x has wrong shape (got {np.shape(x)}, expect ({self.n},))")

    def check_input_v(self, v: Array | None) -> None:
        """Raise RuntimeError for other than m multipliers, None where there are no constraints."""
        if not self.m:
            if v is not None:
                raise RuntimeError(
                    "Lagrange multipliers should not be specified for unconstrained problems"
                )
        elif v is None or np.shape(v) != (self.m,):
            found = None if v is None else np.shape(v)
            raise RuntimeError(f"v has wrong shape (got {found}, expect ({self.m},))")

    # -- objective and constraints -----------------------------------------------------------

    def objcons(self, x: Array) -> tuple[float, Array | None]:
        """Return f and c."""
        return self.obj(x), self.cons(x)

    def obj(self, x: Array, gradient: bool = False) -> Any:
        """Return f, and grad f if asked."""
        self.check_input_x(x)
        self._counts["f"] += 1
        f = self.problem.objective(x)
        return (f, self.grad(x)) if gradient else f

    def sobj(self, x: Array, gradient: bool = False):
        """Return f, and the sparse grad f if asked."""
        f = self.obj(x)
        return (f, self.sgrad(x)) if gradient else f

    def grad(self, x: Array, index: int | None = None) -> Array:
        """Return grad f, or the gradient of constraint `index`."""
        self.check_input_x(x)
        if index is not None:
            return self._normal(x, index).toarray().ravel()
        self._counts["g"] += 1
        return self.problem.gradient(x)

    def sgrad(self, x: Array, index: int | None = None):
        """Return the sparse grad f, or that of constraint `index`."""
        return _coo(self.grad(x)) if index is None else self._normal(x, index)

    def cons(self, x: Array, index: int | None = None, gradient: bool = False) -> Any:
        """Return c or one entry of it, and its derivative if asked."""
        found = self.scons(x, index, gradient)
        if not gradient or found is None:
            return found
        c, J = found
        return c, J.toarray() if index is None else J.toarray().ravel()

    def scons(self, x: Array, index: int | None = None, gradient: bool = False) -> Any:
        """Return c or one entry of it, and its sparse derivative if asked."""
        if not self.m:
            return None
        self.check_input_x(x)
        self._check_index(index)
        c = self.problem.constraints(x)
        self._counts["c"] += self.m if index is None else 1
        if index is None:
            return (c, self._J(x)) if gradient else c
        return (c[index], self._normal(x, index)) if gradient else c[index]

    # -- first derivatives of the Lagrangian -------------------------------------------------

    def lag(self, x: Array, v: Array, gradient: bool = False):
        """Return f + v'c, and its gradient if asked."""
        if not self.m:
            return None
        self.check_input_v(v)
        value = self.obj(x) + float(np.dot(v, self.scons(x)))
        return (value, self.slagjac(x, v)[0].toarray().ravel()) if gradient else value

    def lagjac(self, x: Array, v: Array | None = None):
        """Return the gradient of f (of the Lagrangian with v) and the dense Jacobian."""
        g, J = self.slagjac(x, v)
        return g.toarray().ravel(), None if J is None else J.toarray()

    def slagjac(self, x: Array, v: Array | None = None):
        """Return the same, both sparse."""
        if v is not None:
            self.check_input_v(v)
        g = self.grad(x)
        if not self.m:
            return _coo(g), None
        J = self._J(x)
        return _coo(g if v is None else g + J.T @ v), J

    def jprod(self, p: Array, transpose: bool = False, x: Array | None = None) -> Array | None:
        """Return J p, or J' p, of the Jacobian at x, or of the last one that was computed."""
        if not self.m:
            return None
        (self.check_input_v if transpose else self.check_input_x)(p)
        if x is not None:
            self.check_input_x(x)
            self._J(x)
        if self._jacobian is None:
            raise RuntimeError("no Jacobian was computed yet: expected x")
        J = self._of_jacobian(self._jacobian)
        return J.T @ p if transpose else J @ p

    # -- second derivatives ------------------------------------------------------------------

    def hess(self, x: Array, v: Array | None = None) -> Array:
        """Return the dense Hessian of f without constraints, else of the Lagrangian."""
        return self.sphess(x, v).toarray()

    def sphess(self, x: Array, v: Array | None = None):
        """Return the same, sparse."""
        self.check_input_x(x)
        assert (v is not None) == bool(self.m), (
            "v must be specified for constrained problems (for the Hessian of f, ihess or isphess)"
            if self.m
            else "v must be None for unconstrained problems"
        )
        self.check_input_v(v)
        self._H(x, v)
        return self._of_hessian(self._hessian)

    def ihess(self, x: Array, cons_index: int | None = None) -> Array:
        """Return the dense Hessian of f, or of constraint `cons_index`."""
        return self.isphess(x, cons_index).toarray()

    def isphess(self, x: Array, cons_index: int | None = None):
        """Return the same, sparse."""
        self.check_input_x(x)
        self._check_index(cons_index)
        if cons_index is not None:
            self._counts["cH"] += 1
            return self._of_hessian(self.problem.hessian(x, np.eye(self.m)[cons_index], 0.0))
        if not self.m:
            self._H(x, None)
            return self._of_hessian(self._hessian)
        self._counts["H"] += 1
        return self._of_hessian(self.problem.hessian(x))

    def hprod(self, p: Array, x: Array | None = None, v: Array | None = None) -> Array:
        """Return H p, H that of `hess` at x, or the last one that was computed."""
        self.check_input_x(p)
        if x is not None or not self.m:
            self.check_input_v(v)
        if x is not None:
            self.check_input_x(x)
            self._hessian = self.problem.hessian(x, v)
        if self._hessian is None:
            raise RuntimeError("no Hessian was computed yet: expected x")
        self._counts["Hprod"] += 1
        return self._of_hessian(self._hessian) @ p

    def gradhess(self, x: Array, v: Array | None = None, gradient_of_lagrangian: bool = True):
        """Return the gradient, the Jacobian if there is one, and the Hessian, all dense.

        With constraints, the gradient is that of the Lagrangian, or that of f if it is not to be.
        """
        g, *matrices = self.gradsphess(x, v, gradient_of_lagrangian)
        return (g.toarray().ravel(), *(matrix.toarray() for matrix in matrices))

    def gradsphess(self, x: Array, v: Array | None = None, gradient_of_lagrangian: bool = True):
        """Return the same, all sparse."""
        self.check_input_x(x)
        self.check_input_v(v)
        g, J = self.slagjac(x, v if gradient_of_lagrangian else None)
        H = self.sphess(x, v)
        return (g, H) if J is None else (g, J, H)

    # -- counts ------------------------------------------------------------------------------

    def report(self) -> dict[str, float | None]:
        """Return evaluations and processor times.

        f, g, H, Hprod of the objective; c, cg, cH of the constraints, all of them counting as
        one, None where there are none; tsetup and trun, in seconds.
        """
        counts = self._counts
        found: dict[str, float | None] = {name: counts[name] for name in ("f", "g", "H", "Hprod")}
        for name in ("c", "cg", "cH"):
            found[name] = counts[name] / self.m if self.m else None
        return found | {"tsetup": self._setup, "trun": process_time() - self._started}

    # -- what they are made of ---------------------------------------------------------------

    def _check_index(self, index: int | None) -> None:
        assert index is None or 0 <= index <= self.m - 1, (
            f"Invalid constraint index {index} (must be in 0..{self.m - 1})"
        )

    def _J(self, x: Array):
        self._counts["cg"] += self.m
        self._jacobian = self.problem.jacobian(x)
        return self._of_jacobian(self._jacobian)

    def _normal(self, x: Array, index: int):
        self._check_index(index)
        self._counts["cg"] += 1
        return self._of_jacobian(self.problem.jacobian(x)).tocsr()[[index]].tocoo()

    def _H(self, x: Array, v: Array | None) -> None:
        self._counts["H"] += 1
        if self.m:
            self._counts["cH"] += self.m
        self._hessian = self.problem.hessian(x, v)

    def _of_jacobian(self, values: Array):
        from scipy.sparse import coo_matrix

        return coo_matrix((values, self.problem.jacobian_structure), shape=(self.m, self.n))

    def _of_hessian(self, values: Any):
        from scipy.sparse import coo_matrix

        rows, cols, of = whole(self.problem.hessian_structure)
        return coo_matrix((values[of], (rows, cols)), shape=(self.n, self.n))


def _first(flags: NDArray[np.bool_]) -> bool:
    """Whether those that are True come before the others."""
    return bool(np.all(flags[:-1] >= flags[1:]))


def _coo(vector: Array):
    from scipy.sparse import coo_matrix

    return coo_matrix(vector[None])
