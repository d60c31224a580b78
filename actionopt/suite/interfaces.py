"""A test problem in the clothes that other solvers expect."""

from __future__ import annotations

from typing import Any

import numpy as np

from actionopt.suite.problem import TestProblem
from actionopt.suite.program import Program
from actionopt.tools.types import Array, NDInt


def _matrix(values: Array, structure: tuple[NDInt, NDInt], shape: tuple[int, int]):
    from scipy.sparse import csc_array

    return csc_array((values, structure), shape=shape)


def jacobian(problem: Program, x: Array):
    """Return dc/dx as a scipy.sparse array, (m, n)."""
    return _matrix(problem.jacobian(x), problem.jacobian_structure, (problem.m, problem.n))


def hessian(problem: Program, x: Array, lam: Array | None = None, factor: float = 1.0):
    """Return the whole Hessian of the Lagrangian as a scipy.sparse array, (n, n)."""
    rows, cols = problem.hessian_structure
    values = problem.hessian(x, lam, factor)
    off = rows != cols
    both = np.concatenate([rows, cols[off]]), np.concatenate([cols, rows[off]])
    return _matrix(np.concatenate([values, values[off]]), both, (problem.n, problem.n))


def scipy_arguments(problem: Program, method: str) -> dict[str, Any]:
    """Return keywords for `scipy.optimize.minimize`, but for x0: what the method can use.

    Raises ValueError for a method that takes no constraints, where there are some.
    """
    given: dict[str, Any] = {
        "method": method,
        "fun": problem.objective,
        "jac": problem.gradient,
    }
    if method == "trust-constr":
        given["hess"] = lambda x: hessian(problem, x)
    elif method in ("Newton-CG", "trust-ncg", "trust-krylov"):
        given["hessp"] = lambda x, p: problem.hessian_product(x, None, p)
    elif method in ("trust-exact", "dogleg"):
        given["hess"] = lambda x: hessian(problem, x).toarray()
    if not problem.m:
        return given
    if method == "trust-constr":
        from scipy import optimize

        build: Any = optimize.NonlinearConstraint  # its types know no functions
        given["constraints"] = build(
            problem.constraints,
            *problem.constraint_bounds,
            jac=lambda x: jacobian(problem, x),
            hess=lambda x, lam: hessian(problem, x, lam, 0.0),
        )
    elif method == "SLSQP":
        given["constraints"] = {
            "type": "eq",
            "fun": problem.constraints,
            "jac": lambda x: jacobian(problem, x).toarray(),
        }
    else:
        raise ValueError(f"expected a method that takes constraints, found {method!r}")
    return given


class Ipopt:
    """The object `cyipopt.Problem(n, m, problem_obj=..., lb, ub, cl, cu)` asks for."""

    def __init__(self, problem: Program) -> None:
        self.problem = problem
        self.objective, self.gradient = problem.objective, problem.gradient
        self.constraints, self.jacobian = problem.constraints, problem.jacobian

    def jacobianstructure(self) -> tuple[NDInt, NDInt]:
        """Return rows and columns of the Jacobian's nonzeros."""
        return self.problem.jacobian_structure

    def hessianstructure(self) -> tuple[NDInt, NDInt]:
        """Return rows and columns of the Hessian's nonzeros: the lower triangle."""
        rows, cols = self.problem.hessian_structure
        return cols, rows

    def hessian(self, x: Array, lagrange: Array, obj_factor: float) -> Array:
        """Return the nonzeros of obj_factor * f'' + sum lagrange c''."""
        return self.problem.hessian(x, lagrange, obj_factor)


class Cutest:
    """A test problem under the names of PyCUTEst's `CUTEstProblem`.

    The Lagrangian is f + v'c, as there. Matrices are dense where PyCUTEst's are, and sparse in
    the methods that begin with s.
    """

    def __init__(self, problem: TestProblem) -> None:
        self.problem = problem
        self.name, self.n, self.m = problem.name, problem.n, problem.m
        self.x0, self.v0 = problem.start(), np.zeros(problem.m)
        self.bl, self.bu = problem.bounds
        self.cl, self.cu = problem.constraint_bounds
        self.nnzj, self.nnzh = problem.nnz_jacobian, problem.nnz_hessian
        self.is_eq_cons = np.ones(problem.m, dtype=bool)
        self.is_linear_cons = np.full(problem.m, problem.classification[1] == "L")

    def obj(self, x: Array, gradient: bool = False):
        """Return f, and grad f if asked."""
        f = self.problem.objective(x)
        return (f, self.problem.gradient(x)) if gradient else f

    def grad(self, x: Array, index: int | None = None) -> Array:
        """Return grad f, or the gradient of constraint `index`."""
        if index is None:
            return self.problem.gradient(x)
        return self.sjac(x)[[index]].toarray().ravel()

    def cons(self, x: Array, index: int | None = None, gradient: bool = False):
        """Return c or one entry of it, and its derivative if asked."""
        c, J = self.problem.constraints(x), None
        if gradient:
            J = self.sjac(x).toarray()
        if index is not None:
            c, J = c[index], None if J is None else J[index]
        return c if J is None else (c, J)

    def lag(self, x: Array, v: Array, gradient: bool = False):
        """Return f + v'c, and its gradient if asked."""
        value = self.problem.objective(x) + float(np.dot(v, self.problem.constraints(x)))
        return (value, self.lagjac(x, v)[0]) if gradient else value

    def sjac(self, x: Array):
        """Return the sparse Jacobian."""
        return jacobian(self.problem, x).tocsr()

    def lagjac(self, x: Array, v: Array | None = None):
        """Return the gradient of f (of the Lagrangian with v) and the dense Jacobian."""
        J = self.sjac(x)
        gradient = self.problem.gradient(x)
        return (gradient if v is None else gradient + J.T @ v), J.toarray()

    def slagjac(self, x: Array, v: Array | None = None):
        """Return the same with a sparse Jacobian."""
        J = self.sjac(x)
        gradient = self.problem.gradient(x)
        return (gradient if v is None else gradient + J.T @ v), J

    def scons(self, x: Array):
        """Return c and the sparse Jacobian."""
        return self.problem.constraints(x), self.sjac(x)

    def jprod(self, p: Array, transpose: bool = False, x: Array | None = None) -> Array:
        """Return J p, or J' p."""
        J = self.sjac(self.x0 if x is None else x)
        return J.T @ p if transpose else J @ p

    def hess(self, x: Array, v: Array | None = None) -> Array:
        """Return the dense Hessian of the Lagrangian."""
        return self.sphess(x, v).toarray()

    def sphess(self, x: Array, v: Array | None = None):
        """Return the sparse Hessian of the Lagrangian."""
        return hessian(self.problem, x, v)

    def ihess(self, x: Array, cons_index: int | None = None) -> Array:
        """Return the dense Hessian of f, or of constraint `cons_index`."""
        if cons_index is None:
            return self.hess(x)
        return hessian(self.problem, x, np.eye(self.m)[cons_index], 0.0).toarray()

    def hprod(self, p: Array, x: Array | None = None, v: Array | None = None) -> Array:
        """Return the Hessian of the Lagrangian times p."""
        return self.problem.hessian_product(self.x0 if x is None else x, v, p)

    def gradhess(self, x: Array, v: Array | None = None):
        """Return the gradient, the Jacobian if there is one, and the Hessian, all dense."""
        gradient, J = self.lagjac(x, v)
        H = self.hess(x, v)
        return (gradient, J, H) if self.m else (gradient, H)

    def report(self) -> dict[str, int]:
        """Return the evaluations so far."""
        return dict(self.problem.counts)
