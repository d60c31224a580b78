"""Put a test problem to a solver by name, and take its answer as it comes.

A name is one of these:

====================  ==========================================================================
`ipopt`, `fatrop` ...  a plugin of `casadi.nlpsol`; `sqpmethod:osqp` names its QP solver too
`scipy:SLSQP`          a method of `scipy.optimize.minimize`
`nlopt:LD_LBFGS`       an algorithm of NLopt
`cyipopt`              Ipopt by its callbacks
`asl:ipopt`            a program that reads AMPL's `.nl` files: a path, or a name on the search path
`my_solver.py:solve`   a function of yours, in a file or a module: see `OWN_SOLVER_HELP`
====================  ==========================================================================

Solvers run with their own defaults, but for being silent: what their authors chose is compared.
What is not so is in `CHANGED_DEFAULTS`. None is given the answer: a solver sees a `Program`.

Evaluations are counted in the functions that a solver is given, whichever it is: CasADi's plugins
ask for several at once, and a call that returns f and c is one of each. Programs that read a file
evaluate it themselves, and are not counted: `counted`.
"""

from __future__ import annotations

import ast
import hashlib
import importlib
import importlib.util
import runpy
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any

import casadi as ca
import numpy as np

from actionopt.suite import asl, nl
from actionopt.suite.expression import nlp
from actionopt.suite.interfaces import (
    check_method,
    cyipopt_arguments,
    nlopt_problem,
    scipy_arguments,
)
from actionopt.suite.program import Given, Program
from actionopt.suite.words import OUTCOME_WORDS, message
from actionopt.tools.immutable import immutable
from actionopt.tools.process import children_time, count_anew
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
PACKAGES = {"scipy": "scipy", "nlopt": "nlopt", "cyipopt": "cyipopt"}
NLOPT_STOP = 1e-12  # relative change of f at which NLopt's algorithms stop; ad hoc
CHANGED_DEFAULTS = {
    "blocksqp": "linear solver ldl, as its own default is not shipped with CasADi",
    "nlopt": f"ftol_rel {NLOPT_STOP:g}, as it has no stopping criterion of its own",
}
# What each of the plugins' functions evaluates. Gradients of the Lagrangian are one of f and one of
# c; `nlp_grad`, which CasADi asks for itself when all is done, is none of the solver's.
CALLS = {
    "nlp_f": "f",
    "nlp_g": "c",
    "nlp_fg": "f c",
    "nlp_grad_f": "grad",
    "nlp_jac_g": "jac",
    "nlp_jac_fg": "f c grad jac",
    "nlp_gf_jg": "f c grad jac",
    "nlp_grad_l": "grad jac",
    "nlp_grad_L": "grad jac",
    "nlp_psi": "f c",
    "nlp_grad_psi": "f c grad jac",
    "nlp_hess_l": "hess",
    "nlp_hess_L": "hess",
    "nlp_hess_psi": "hess",
    "nlp_hess_L_prod": "hprod",
    "nlp_hess_psi_prod": "hprod",
    "fwd1_nlp_grad_l": "hprod",
    "nlp_grad": "",
}
LONG_SOLVE = 1.0  # seconds of a solve of which one more measures enough; ad hoc

OWN_SOLVER_HELP = """\
A solver of yours is FILE.py:FUNCTION. It is called with a problem and x0 (n,), to minimise f(x)
subject to c(x) = 0, and returns x (n,), or (x, lam, word): lam (m,) or None, word True for success,
False for giving up, or "unbounded". With inequalities, constraint_bounds and bounds are those of
c(x) and of x, lower and upper.

  def solve(problem, x0):
      for _ in range(1000):
          x0 = x0 - 0.1 * problem.gradient(x0)
      return x0, None, False

The problem has n, m, classification, objective(x), gradient(x), constraints(x), jacobian(x),
hessian(x, lam) and hessian_product(x, lam, p): the nonzeros of the last two matrices, flat, their
rows and columns being jacobian_structure and hessian_structure (the upper triangle). All calls are
counted. What is raised is taken for a mistake in the file, shown, and a failure; to give up,
return."""


class Absent(RuntimeError):
    """A solver that is known, and not installed, or not made for such a problem."""


class Mistake(RuntimeError):
    """A mistake in a solver's own file."""


@immutable
class SolverResult:
    """What a solver returned.

    Attributes
    ----------
    x : (n,) array
    said : {"solved", "unbounded", "infeasible", "gave up"}
        What it says of it.
    word : str
        Its own status.
    times : tuple of float
        Seconds of the processor for each solve alone; of the first, with the counting.
    program : Program
        What it was given: with the evaluations of the first solve, and where they were.
    lam : (m,) array or None
    differing : tuple of (x, lam, said, word)
        What later solves returned that was not the same.
    """

    x: Array
    said: str
    word: str
    times: tuple[float, ...]
    program: Program
    lam: Array | None = None
    differing: tuple[Outcome, ...] = ()

    @property
    def seconds(self) -> float:
        """The least of the times without counting; the one with it, where there is no other."""
        return min(self.times[1:] or self.times)

    @property
    def evaluations(self) -> dict[str, int]:
        """Calls of each function."""
        return {k: count for k, count in self.program.counts.items() if count}


# x, lam, what is said, the status: what one solve returns.
Outcome = tuple[Array, Array | None, str, str]
Prepare = Callable[[Program, Array], Callable[[Array], Outcome]]  # what no clock measures


def is_counted(name: str) -> bool:
    """Whether what a solver of this name evaluates is counted."""
    return not name.startswith("asl:")


def check(name: str) -> None:
    """Raise ValueError if `name` is the name of no solver that could be run."""
    base, _, rest = name.partition(":")
    if base in PACKAGES:
        if bool(rest) == (base == "cyipopt"):
            raise ValueError(f"expected scipy:METHOD, nlopt:ALGORITHM or cyipopt, found {name!r}")
        if base == "scipy":
            check_method(rest)
        return
    if base == "asl":
        asl.find(rest)
        return
    if base in PLUGINS:
        if rest and (base not in WITH_QP or rest not in QP):
            raise ValueError(
                f"expected {' or '.join(WITH_QP)} with one of {', '.join(QP)}, found {name!r}"
            )
        return
    place, _, function = name.rpartition(":")
    if not place:
        raise ValueError(
            f"expected a solver among {', '.join(PLUGINS)}, cyipopt, scipy:METHOD, "
            f"nlopt:ALGORITHM, asl:PATH or FILE.py:FUNCTION, found {name!r}"
        )
    if place.endswith(".py"):
        _check_file(Path(place), function)


def _check_file(file: Path, function: str) -> None:
    if not file.is_file():
        raise ValueError(f"expected a file with a solver, found no {str(file)!r}")
    try:
        tree = ast.parse(file.read_text(encoding="utf-8"), str(file))
    except SyntaxError as error:
        raise ValueError(
            f"expected Python, found in {file}, line {error.lineno}: {error}"
        ) from error
    names = {
        name
        for node in ast.walk(tree)
        for name in (
            [node.name]
            if isinstance(node, (ast.FunctionDef, ast.ClassDef))
            else [node.id]
            if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)
            else [(a.asname or a.name) for a in node.names]
            if isinstance(node, (ast.Import, ast.ImportFrom))
            else []
        )
    }
    if function not in names and "*" not in names:
        raise ValueError(f"expected {file} to define {function!r}, found no such name in it")


def content(name: str) -> str:
    """Return what a solver's answers depend on beside its name: versions, or its file's digest."""
    base = name.partition(":")[0]
    place = name.rpartition(":")[0]
    if base in PLUGINS:
        return f"casadi {ca.CasadiMeta.version()}"
    if base in PACKAGES:
        try:
            return f"{base} {metadata.version(base)}, numpy {np.__version__}"
        except metadata.PackageNotFoundError:
            return "absent"
    file = asl.find(name.partition(":")[2]) if base == "asl" else Path(place)
    if base != "asl" and not place.endswith(".py"):
        found = importlib.util.find_spec(place)
        if found is None or found.origin is None:
            return "absent"
        file = Path(found.origin)
    return f"sha256 {hashlib.sha256(file.read_bytes()).hexdigest()[:12]}"


def run(name: str, problem: Program, x0: Array, repeats: int = 1) -> SolverResult:
    """Return the answer of the solver `name` from x0 (n,).

    What it evaluates is counted in the first of `repeats` solves, and where. The others are bare:
    nothing of Python's is between a plugin and its functions. There is one of them if the first
    took a second. Raises Absent if the solver is not installed or
    takes no such problem, Mistake if a user's solver file fails.
    """
    check(name)
    base, _, rest = name.partition(":")
    if not problem.smooth and (base in ("asl", "cyipopt", *PLUGINS) or rest[:3] == "LD_"):
        raise Absent(f"{problem.name} has no derivatives, which {name} needs")
    if base == "asl":
        with TemporaryDirectory() as folder:
            return _repeat(_asl(rest, Path(folder)), problem, x0, repeats)
    if base in PACKAGES:
        prepare = {"scipy": _scipy, "nlopt": _nlopt, "cyipopt": _cyipopt}[base](rest)
    elif base in PLUGINS:
        prepare = _plugin(base, rest)
    else:
        prepare = _function(name.rpartition(":")[0], name.rpartition(":")[2])
    return _repeat(prepare, problem, x0, repeats)


def _repeat(prepare: Prepare, problem: Program, x0: Array, repeats: int) -> SolverResult:
    program = problem.view()
    program.visited = []
    first, taken = _time(prepare(program, x0), x0)
    times, differing = [taken], []
    for _ in range(min(repeats, 2 if taken >= LONG_SOLVE else repeats) - 1):
        found, taken = _time(prepare(problem.view(), x0), x0)
        times.append(taken)
        if found[2] != first[2] or found[0].tobytes() != first[0].tobytes():
            differing.append(found)
    x, lam, said, word = first
    return SolverResult(x, said, word, tuple(times), program, lam, tuple(differing))


def _time(solve: Callable[[Array], Outcome], x0: Array) -> tuple[Outcome, float]:
    count_anew()  # what may be used is that of one solve
    children, clock = children_time(), process_time()
    x, lam, said, word = solve(x0.copy())
    taken = process_time() - clock  # its children's is read before and after: that takes time, too
    taken += children_time() - children
    return (np.asarray(x, dtype=float), lam, said, word), taken


class Counted(ca.Callback):
    """A function of a plugin, which counts its calls in a program, and so do its derivatives."""

    def __init__(self, inner: ca.Function, program: Program) -> None:
        super().__init__()
        self.inner, self.program = inner, program
        kinds = CALLS.get(inner.name(), inner.name()).split()
        self.kinds = [kind for kind in kinds if program.m or kind not in ("c", "jac")]
        self.kept: list[Counted] = []  # CasADi keeps no reference to what it is given here
        self.construct(inner.name(), {})

    # CasADi's protocol of a callback.
    # fmt: off
    def get_n_in(self): return self.inner.n_in()  # noqa: D102
    def get_n_out(self): return self.inner.n_out()  # noqa: D102
    def get_name_in(self, i): return self.inner.name_in(i)  # noqa: D102
    def get_name_out(self, i): return self.inner.name_out(i)  # noqa: D102
    def get_sparsity_in(self, i): return self.inner.sparsity_in(i)  # noqa: D102
    def get_sparsity_out(self, i): return self.inner.sparsity_out(i)  # noqa: D102
    def has_forward(self, nfwd): return True  # noqa: D102
    # fmt: on

    def get_forward(self, nfwd, name, inames, onames, opts):
        """Return the derivative along `nfwd` directions, counted as well."""
        self.kept.append(Counted(self.inner.forward(nfwd), self.program))
        return self.kept[-1]

    def eval(self, arg):
        """Evaluate."""
        for kind in self.kinds:
            self.program.counts[kind] += 1
        if "f" in self.kinds:
            self.program.note(arg[0])
        return self.inner.call(arg)


def _plugin(plugin: str, qp: str) -> Prepare:
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

    def prepare(program: Program, x0: Array) -> Callable[[Array], Outcome]:
        expression = nlp(program)
        solver = ca.nlpsol("solver", plugin, expression, options)
        counted: dict[str, Counted] = {}
        if program.visited is not None:
            counted = {
                name: Counted(solver.get_function(name), program)
                for name in solver.get_function()
                if not name.startswith("fwd")  # those are made by the function they belong to
            }
            solver = ca.nlpsol("solver", plugin, expression, options | {"cache": counted})

        bounds: dict[str, Any] = {}
        bounds |= zip(("lbg", "ubg"), program.constraint_bounds, strict=True)
        if program.has_bounds:
            bounds |= zip(("lbx", "ubx"), program.bounds, strict=True)

        def solve(x0: Array, _alive: Any = counted) -> Outcome:  # CasADi keeps no reference
            found = solver(x0=x0, **bounds)
            stats = solver.stats()
            status = str(stats.get("return_status", ""))
            word = message(plugin, status, bool(stats.get("success", False)))
            return np.asarray(found["x"]).ravel(), np.asarray(found["lam_g"]).ravel(), word, status

        return solve

    return prepare


def _scipy(method: str) -> Prepare:
    try:
        from scipy.optimize import minimize
    except ImportError:
        raise Absent("SciPy is not installed: pip install 'actionopt[suite]'") from None

    def prepare(program: Program, x0: Array) -> Callable[[Array], Outcome]:
        try:
            arguments = scipy_arguments(program, method)
        except ValueError as error:
            raise Absent(str(error)) from None

        def solve(x0: Array) -> Outcome:
            found = minimize(x0=x0, **arguments)
            status = str(found.message)
            return np.asarray(found.x), None, message("scipy", status, bool(found.success)), status

        return solve

    return prepare


def _nlopt(algorithm: str) -> Prepare:
    try:
        import nlopt  # noqa: F401  # pyright: ignore[reportMissingImports]
    except ImportError as error:
        raise Absent(f"NLopt is not installed, pip install nlopt ({error})") from None

    def prepare(program: Program, x0: Array) -> Callable[[Array], Outcome]:
        try:
            optimizer = nlopt_problem(program, algorithm)
        except ValueError as error:
            raise Absent(str(error)) from None
        optimizer.set_ftol_rel(NLOPT_STOP)

        def solve(x0: Array) -> Outcome:
            lower, upper = program.bounds
            try:
                x = optimizer.optimize(np.clip(x0, lower, upper))
            except MemoryError:
                raise
            except Exception as error:  # its own kinds of giving up; the last point is lost
                return x0, None, "gave up", f"{type(error).__name__} {error}"
            status = str(optimizer.last_optimize_result())
            return x, None, message("nlopt", status, False), status

        return solve

    return prepare


def _cyipopt(_: str) -> Prepare:
    try:
        cyipopt: Any = importlib.import_module("cyipopt")
    except ImportError as error:
        raise Absent(f"cyipopt is not installed, pip install cyipopt ({error})") from None

    def prepare(program: Program, x0: Array) -> Callable[[Array], Outcome]:
        def solve(x0: Array) -> Outcome:
            problem = cyipopt.Problem(**cyipopt_arguments(program))
            problem.add_option("print_level", 0)
            problem.add_option("sb", "yes")
            x, info = problem.solve(x0)
            status = str(info["status"])
            return x, info["mult_g"], message("cyipopt", status, False), status

        return solve

    return prepare


def _asl(binary: str, folder: Path) -> Prepare:
    found = asl.find(binary)

    def prepare(program: Program, x0: Array) -> Callable[[Array], Outcome]:
        stub = folder / "problem"
        nl.write(program, stub.with_suffix(".nl"), x0, names=False)

        def solve(_: Array) -> Outcome:
            answer = asl.run(found, stub)
            if answer.x.shape != (program.n,):  # it gave up, and has none
                return np.full(program.n, np.nan), None, "gave up", answer.message
            return answer.x, answer.lam, answer.meaning, answer.message

        return solve

    return prepare


def _function(place: str, name: str) -> Prepare:
    try:
        if place.endswith(".py"):
            function = runpy.run_path(place)[name]
        else:
            function = getattr(importlib.import_module(place), name)
    except Exception as error:
        raise Mistake(f"{place} could not be loaded") from error

    def prepare(program: Program, x0: Array) -> Callable[[Array], Outcome]:
        given = Given(program)

        def solve(x0: Array) -> Outcome:
            try:
                found = function(given, x0)
                x, lam, word = found if isinstance(found, tuple) else (found, None, True)
                if not isinstance(word, str):
                    word = "solved" if word else "gave up"
                x = np.asarray(x, dtype=float)
                if x.shape != (program.n,) or word not in OUTCOME_WORDS:
                    raise ValueError(
                        f"expected x of shape ({program.n},) and one of True, False, "
                        f"{', '.join(map(repr, OUTCOME_WORDS))}, found shape {x.shape} and {word!r}"
                    )
            except MemoryError:
                raise
            except Exception as error:
                raise Mistake(f"{name} of {place}") from error
            return x, lam, word, ""

        return solve

    return prepare
