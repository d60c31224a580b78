"""Put a test problem to a solver by name, and take its answer as it comes.

A name is one of these:

====================  ==========================================================================
`ipopt`, `fatrop` ...  a plugin of `casadi.nlpsol`; `sqpmethod:osqp` names its QP solver too
`scipy:SLSQP`          a method of `scipy.optimize.minimize`
`my_solver.py:solve`   a function of yours, in a file or a module: it takes the TestProblem and
                       x0 (n,) and returns x or (x, lam, claimed)
====================  ==========================================================================

Solvers run with their own defaults, but for being silent: what their authors chose is compared.
"""

from __future__ import annotations

import importlib
import runpy
from collections.abc import Mapping
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any

import casadi as ca
import numpy as np

from actionopt.suite.expression import nlp
from actionopt.suite.interfaces import scipy_arguments
from actionopt.suite.problem import TestProblem
from actionopt.tools.types import Array

QUIET = {"print_header": False, "print_iteration": False}
SQP = {**QUIET, "print_status": False}
QP: dict[str, dict[str, Any]] = {
    "qrqp": {"print_iter": False, "print_header": False, "print_info": False},
    "qpoases": {"printLevel": "none"},
    "osqp": {"osqp": {"verbose": False}},
    "daqp": {},
    "highs": {"highs": {"output_flag": False}},
    "proxqp": {},
    "piqp": {},
}
# The plugins of the wheel and what keeps each of them quiet.
PLUGINS: dict[str, dict[str, Any]] = {
    "ipopt": {"ipopt.print_level": 0, "ipopt.sb": "yes"},
    "fatrop": {"fatrop.print_level": 0},
    "sqpmethod": SQP,
    "feasiblesqpmethod": SQP,
    "blocksqp": {**QUIET, "linsol": "ldl"},  # its own default is not shipped
    "qrsqp": QUIET,
    "sleqp": {},
    "alpaqa": {},
    "uno": {},
}
WITH_QP = ("sqpmethod", "feasiblesqpmethod")


class Absent(RuntimeError):
    """A solver that is known, and not installed."""


@dataclass(frozen=True, eq=False)
class Answer:
    """What a solver returned.

    Attributes
    ----------
    x : (n,) array
    claimed : bool
        Whether it says it succeeded; only tells a wrong answer from none.
    word : str
        Its own status.
    seconds : float
        Wall time of the solve alone.
    evaluations : mapping
        Calls of each function.
    lam : (m,) array or None
    """

    x: Array
    claimed: bool
    word: str
    seconds: float
    evaluations: Mapping[str, int] = field(default_factory=dict)
    lam: Array | None = None


def check(name: str) -> None:
    """Raise ValueError if `name` is the name of no solver that could be run."""
    base, _, rest = name.partition(":")
    if base == "scipy":
        return
    if base in PLUGINS:
        if rest and (base not in WITH_QP or rest not in QP):
            raise ValueError(
                f"expected {' or '.join(WITH_QP)} with one of {', '.join(QP)}, found {name!r}"
            )
        return
    if not rest:
        raise ValueError(
            f"expected a solver among {', '.join(PLUGINS)}, scipy:METHOD or FILE.py:FUNCTION, "
            f"found {name!r}"
        )


def run(name: str, problem: TestProblem, x0: Array) -> Answer:
    """Return the answer of the solver `name` from x0 (n,). Raises Absent if it is not installed."""
    check(name)
    base, _, rest = name.partition(":")
    if base == "scipy":
        return _scipy(rest, problem, x0)
    if base in PLUGINS:
        return _plugin(base, rest, problem, x0)
    return _function(base, rest, problem, x0)


def _plugin(plugin: str, qp: str, problem: TestProblem, x0: Array) -> Answer:
    if not ca.has_nlpsol(plugin):
        raise Absent(f"this CasADi has no {plugin}")
    options: dict[str, Any] = {"print_time": False, "calc_lam_p": False, **PLUGINS[plugin]}
    if plugin in WITH_QP:
        qp = qp or "qrqp"
        if not ca.has_conic(qp):
            raise Absent(f"this CasADi has no {qp}")
        options |= {
            "qpsol": qp,
            "qpsol_options": {"error_on_fail": False, "print_time": False, **QP[qp]},
        }
    solver = ca.nlpsol("solver", plugin, nlp(problem), options)
    clock = perf_counter()
    found = solver(x0=x0, lbg=0.0, ubg=0.0) if problem.m else solver(x0=x0)
    seconds = perf_counter() - clock
    stats = solver.stats()
    calls = {
        key.removeprefix("n_call_nlp_"): int(count)
        for key, count in stats.items()
        if key.startswith("n_call_nlp_")
    }
    return Answer(
        np.asarray(found["x"]).ravel(),
        bool(stats.get("success", False)),
        str(stats.get("return_status", "")),
        seconds,
        calls,
        np.asarray(found["lam_g"]).ravel(),
    )


def _scipy(method: str, problem: TestProblem, x0: Array) -> Answer:
    try:
        from scipy.optimize import minimize
    except ImportError:
        raise Absent("SciPy is not installed: pip install 'actionopt[suite]'") from None
    arguments = scipy_arguments(problem, method)
    problem.counts.clear()
    clock = perf_counter()
    found = minimize(x0=x0, **arguments)
    seconds = perf_counter() - clock
    return Answer(
        np.asarray(found.x), bool(found.success), str(found.message), seconds, dict(problem.counts)
    )


def _function(place: str, name: str, problem: TestProblem, x0: Array) -> Answer:
    defined = (
        runpy.run_path(place) if place.endswith(".py") else vars(importlib.import_module(place))
    )
    if not callable(defined.get(name)):
        raise ValueError(f"expected {place} to define the function {name!r}, found none")
    problem.counts.clear()
    clock = perf_counter()
    found = defined[name](problem, x0)
    seconds = perf_counter() - clock
    x, lam, claimed = found if isinstance(found, tuple) else (found, None, True)
    return Answer(np.asarray(x, float), bool(claimed), "", seconds, dict(problem.counts), lam)
