"""A test problem in the clothes that other solvers expect."""

from __future__ import annotations

from typing import Any

import numpy as np

from actionopt.suite.cutest import Cutest
from actionopt.suite.models.expressions import WrittenProgram
from actionopt.suite.optiprofiler import actionopt_load, actionopt_select
from actionopt.suite.program import Program
from actionopt.suite.sparse import hessian, jacobian
from actionopt.tools.types import Array, NDInt

__all__ = [
    "Cutest",
    "Ipopt",
    "actionopt_load",
    "actionopt_select",
    "cyipopt_arguments",
    "hessian",
    "jacobian",
    "least_squares_arguments",
    "nlopt_problem",
    "scipy_arguments",
]

# SciPy's methods: those that use no derivatives, and those that take bounds.
DERIVATIVE_FREE = ("Nelder-Mead", "Powell", "COBYLA", "COBYQA")
BOUNDED = (*DERIVATIVE_FREE, "L-BFGS-B", "TNC", "SLSQP", "trust-constr")
PRODUCTS = ("Newton-CG", "trust-ncg", "trust-krylov")  # of the Hessian with a vector
DENSE = ("trust-exact", "dogleg")  # the Hessian itself
SCIPY_METHODS = (*BOUNDED, "CG", "BFGS", *PRODUCTS, *DENSE)
NLOPT_ROW_TOL = 1e-8  # NLopt's tolerance of a row; ad hoc


def scipy_arguments(problem: Program, method: str) -> dict[str, Any]:
    """Return keywords for `scipy.optimize.minimize`, but for x0: what the method can use.

    Raises ValueError for an unknown method, or one that takes no constraints or bounds where
    there are some.
    """
    check_method(method)
    if not problem.smooth and method not in DERIVATIVE_FREE:
        raise ValueError(f"expected a method that uses no derivatives, found {method!r}")
    given: dict[str, Any] = {"method": method, "fun": problem.objective}
    if method not in DERIVATIVE_FREE:
        given["jac"] = problem.gradient
    if method == "trust-constr":
        given["hess"] = lambda x: hessian(problem, x)
    elif method in PRODUCTS:
        given["hessp"] = lambda x, p: problem.hessian_product(x, None, p)
    elif method in DENSE:
        given["hess"] = lambda x: hessian(problem, x).toarray()
    if problem.has_bounds:
        if method not in BOUNDED:
            raise ValueError(f"expected a method that takes bounds, found {method!r}")
        given["bounds"] = np.stack(problem.bounds, axis=1)
    if problem.m:
        given["constraints"] = _scipy_constraints(problem, method)
    return given


def least_squares_arguments(problem: WrittenProgram) -> dict[str, Any]:
    """Return keywords for `scipy.optimize.least_squares`, but for x0.

    Raises ValueError where f is no sum of squares, and where there are constraints.
    """
    if problem.r is None or problem.m:
        raise ValueError(f"expected a sum of squares without constraints, found {problem.name}")
    functions = {"fun": problem.residuals, "jac": problem.residual_jacobian}
    return {**functions, "bounds": problem.bounds}


def check_method(method: str) -> None:
    """Raise ValueError unless `method` is one of `scipy.optimize.minimize`, in its spelling."""
    if method not in SCIPY_METHODS:
        raise ValueError(
            f"expected a method of scipy.optimize.minimize, one of {', '.join(SCIPY_METHODS)}, "
            f"found {method!r}"
        )


def _scipy_constraints(problem: Program, method: str) -> Any:
    lower, upper = problem.constraint_bounds
    if method in ("trust-constr", "COBYLA", "COBYQA"):
        from scipy import optimize

        build: Any = optimize.NonlinearConstraint  # its types know no functions
        derivatives = {
            "jac": lambda x: jacobian(problem, x),
            "hess": lambda x, lam: hessian(problem, x, lam, 0.0),
        }
        return build(
            problem.constraints, lower, upper, **({} if method in DERIVATIVE_FREE else derivatives)
        )
    if method != "SLSQP":
        raise ValueError(f"expected a method that takes constraints, found {method!r}")
    sides = _sides(lower, upper)
    return [
        {
            "type": kind,
            "fun": lambda x, r=rows, s=sign, b=bound: s * (problem.constraints(x)[r] - b),
            "jac": lambda x, r=rows, s=sign: s * jacobian(problem, x).toarray()[r],
        }
        for kind, rows, sign, bound in sides
    ]


def _sides(lower: Array, upper: Array) -> list[tuple[str, NDInt, float, Array]]:
    """Return equations, lower and upper bounds, as far as there are any: sign (c - bound) >= 0."""
    apart = lower < upper
    found = [
        ("eq", np.flatnonzero(~apart), 1.0, lower),
        ("ineq", np.flatnonzero(apart & np.isfinite(lower)), 1.0, lower),
        ("ineq", np.flatnonzero(apart & np.isfinite(upper)), -1.0, upper),
    ]
    return [(kind, rows, sign, side[rows]) for kind, rows, sign, side in found if rows.size]


def nlopt_problem(problem: Program, algorithm: str):
    """Return the `nlopt.opt` of an algorithm such as "LD_SLSQP"; criteria to stop are not set.

    Raises ValueError for an unknown algorithm, or one that takes no such constraints.
    """
    import nlopt  # pyright: ignore[reportMissingImports]

    code = getattr(nlopt, algorithm, None)
    if not isinstance(code, int):
        raise ValueError(f"expected an algorithm of NLopt's, such as LD_SLSQP, found {algorithm!r}")

    def objective(x: Array, slope: Array) -> float:
        if slope.size:
            slope[:] = problem.gradient(x)
        return problem.objective(x)

    optimizer = nlopt.opt(code, problem.n)
    optimizer.set_min_objective(objective)
    if problem.has_bounds:
        lower, upper = problem.bounds
        optimizer.set_lower_bounds(lower)
        optimizer.set_upper_bounds(upper)
    for kind, rows, sign, bound in _sides(*problem.constraint_bounds):

        def constraint(value: Array, x: Array, slope: Array, r=rows, s=sign, b=bound) -> None:
            if slope.size:
                slope[:] = -s * jacobian(problem, x).toarray()[r]
            value[:] = -s * (problem.constraints(x)[r] - b)

        add = (
            optimizer.add_equality_mconstraint
            if kind == "eq"
            else optimizer.add_inequality_mconstraint
        )
        try:
            add(constraint, np.full(rows.size, NLOPT_ROW_TOL))
        except Exception as error:  # its own; ValueError before NLopt 2.10
            raise ValueError(
                f"expected an algorithm with constraints, found {algorithm}"
            ) from error
    return optimizer


def cyipopt_arguments(problem: Program) -> dict[str, Any]:
    """Return keywords for `cyipopt.Problem`."""
    lower, upper = problem.bounds
    below, above = problem.constraint_bounds
    return {
        "n": problem.n,
        "m": problem.m,
        "problem_obj": Ipopt(problem),
        "lb": lower,
        "ub": upper,
        "cl": below,
        "cu": above,
    }


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
