"""The test problems as a problem library of OptiProfiler's.

OptiProfiler looks for `actionopt_tools.py`, with `actionopt_load` and `actionopt_select`, in a
folder `actionopt` of `custom_problem_libs_path`. That file is one line:

    from actionopt.suite.optiprofiler import actionopt_load, actionopt_select

Source: OptiProfiler, *Using custom problem libraries*; C. Huang, T. M. Ragonneau and Z. Zhang,
www.optprof.com.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from actionopt import suite
from actionopt.suite.program import Program
from actionopt.suite.sparse import hessian, jacobian
from actionopt.tools.types import Array

TYPES = {"U": "u", "B": "b", "L": "l", "Q": "n", "O": "n"}  # by CUTEst's letter of constraints
SIZES = (("dim", 1), ("b", 0), ("lcon", 0), ("nlcon", 0), ("con", 0))  # and their least


def actionopt_load(problem_name: str):
    """Return the `optiprofiler.Problem` of a name, "kepler" or "kepler(eccentricity=0.5)".

    Parameters are those of `suite.get`. Raises ValueError for an unknown name.
    """
    from optiprofiler.opclasses import Problem  # pyright: ignore[reportMissingImports]

    name, _, settings = problem_name.partition("(")
    problem = suite.get(name, **_settings(settings))
    return Problem(x0=problem.start(), name=problem_name, **arguments(problem))


def _settings(text: str) -> dict[str, Any]:
    if not text:
        return {}
    call = ast.parse(f"f({text}", mode="eval").body
    assert isinstance(call, ast.Call)
    return {str(word.arg): ast.literal_eval(word.value) for word in call.keywords}


def arguments(problem: Program) -> dict[str, Any]:
    """Return what OptiProfiler's `Problem` is made of, but for its name and x0.

    Linear rows are matrices aub x <= bub and aeq x = beq; others are cub(x) <= 0 and ceq(x) = 0,
    with dense derivatives.
    """
    lower, upper = problem.bounds
    given: dict[str, Any] = {
        "fun": problem.objective,
        "grad": problem.gradient,
        "hess": lambda x: hessian(problem, x).toarray(),
        "xl": lower,
        "xu": upper,
    }
    if not problem.m:
        return given
    low, high = problem.constraint_bounds
    equal = low == high
    # Rows of equations, of lower bounds (the sign is turned) and of upper ones.
    parts = {
        "eq": [(1.0, np.flatnonzero(equal), high)],
        "ub": [
            (-1.0, np.flatnonzero(~equal & np.isfinite(low)), low),
            (1.0, np.flatnonzero(~equal & np.isfinite(high)), high),
        ],
    }
    if problem.classification[1] == "L":
        zero = np.zeros(problem.n)
        J, c = jacobian(problem, zero).toarray(), problem.constraints(zero)
        for kind, found in parts.items():
            given[f"a{kind}"] = np.vstack([s * J[r] for s, r, _ in found])
            given[f"b{kind}"] = np.concatenate([s * (b - c)[r] for s, r, b in found])
        return given
    for kind, found in parts.items():
        if not any(rows.size for _, rows, _ in found):
            continue

        def values(x: Array, found=found) -> Array:
            c = problem.constraints(x)
            return np.concatenate([s * (c - b)[r] for s, r, b in found])

        def slopes(x: Array, found=found) -> Array:
            J = jacobian(problem, x).toarray()
            return np.vstack([s * J[r] for s, r, _ in found])

        def bends(x: Array, found=found) -> list[Array]:
            rows = [(s, int(i)) for s, r, _ in found for i in r]
            return [s * hessian(problem, x, np.eye(problem.m)[i], 0.0).toarray() for s, i in rows]

        given |= {f"c{kind}": values, f"jc{kind}": slopes, f"hc{kind}": bends}
    return given


def actionopt_select(options: Mapping[str, Any]) -> list[str]:
    """Return the names of the families whose default members fit.

    `ptype`, a string of "u", "b", "l" and "n" for problems without constraints, with bounds, with
    linear and with nonlinear constraints; `mindim`, `maxdim`, and the same of b (bounds), lcon,
    nlcon and con; `excludelist`, names.
    """
    found = []
    for name in suite.FAMILIES:
        problem = suite.get(name)
        kind = TYPES[problem.classification[1]]
        rows = _rows(problem)
        counts = {
            "dim": problem.n,
            "b": sum(int(np.sum(np.isfinite(side))) for side in problem.bounds),
            "lcon": rows * (kind == "l"),
            "nlcon": rows * (kind == "n"),
            "con": rows,
        }
        fits = kind in options.get("ptype", "ubln") and name not in options.get("excludelist", [])
        for what, least in SIZES:
            low, high = options.get(f"min{what}", least), options.get(f"max{what}", math.inf)
            fits = fits and low <= counts[what] <= high
        if fits:
            found.append(name)
    return found


def _rows(problem: Program) -> int:
    """Return how many equations and one-sided inequalities there are."""
    low, high = problem.constraint_bounds
    equal = low == high
    return int(
        np.sum(equal) + np.sum(~equal & np.isfinite(low)) + np.sum(~equal & np.isfinite(high))
    )
