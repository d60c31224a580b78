"""A case: a question that is built when its turn comes, and how it fared, as one row a solver."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

import actionopt as ao
from actionopt.scenes import Known
from actionopt.tools.immutable import immutable
from benchmarks.stress import peers

Curve = Callable[[np.ndarray], np.ndarray]
Row = dict[str, Any]
More = Callable[[ao.Solution], Row]
SAMPLES = 2001
LARGE = 40  # coordinates above which the peers' dense matrices take too long to be tried


@immutable
class Question(Known):
    """What is asked, and how accurately; the peers start from its `guess`, too."""

    tol: float = 1e-9


@dataclass(frozen=True, eq=False)
class Case:
    """One question of a family.

    Attributes
    ----------
    name : str
    build : callable
        Returns the `Question`.
    more : callable
        More entries of our row, from the `Solution`.
    peers : bool
        Whether the other solvers are asked as well.
    measure : callable, optional
        Returns the rows itself, in place of all this.
    """

    name: str
    build: Callable[[], Question] | None = None
    more: More | None = None
    peers: bool = True
    measure: Callable[[], list[Row]] | None = None

    def rows(self, limit: float) -> list[Row]:
        """Return one row for each solver; the others have `limit` seconds each."""
        if self.measure is not None:
            return [{"case": self.name, "solver": "actionopt", **r} for r in self.measure()]
        assert self.build is not None
        question = self.build()
        rows = [ours(question, self.more)]
        system = question.problem.system
        if self.peers and not system.m and system.n <= LARGE:
            rows += [other(question, name, limit) for name in peers.SOLVERS]
        return [{"case": self.name, **row} for row in rows]


def measured(name: str, measure: Callable[..., list[Row]], *arguments: Any) -> Case:
    """Return the case whose rows are `measure(*arguments)`."""
    return Case(name, measure=partial(measure, *arguments))


def members(kinds: dict[str, Callable], counts: dict[str, tuple], quick: bool) -> list[Case]:
    """Return the first cases of each kind: as many as its counts say, of all and of a quick run."""
    return [
        measured(f"{kind} {k}", kinds[kind], k)
        for kind in counts
        for k in range(counts[kind][quick])
    ]


def ours(question: Question, more: More | None = None) -> Row:
    """Solve with this package."""
    clock = time.process_time()
    try:
        solution, spent = timed(question.problem, question.tol, guess=question.guess)
    except ValueError as error:
        spent = time.process_time() - clock
        return {"solver": "actionopt", "status": "refused", "said": str(error), "time": spent}
    return {**told(question, solution, spent), **(more(solution) if more else {})}


def timed(problem: ao.Problem, tol: float, **options: Any) -> tuple[ao.Solution, float]:
    """Return the solution, and how long finding it took."""
    problem.system.pointwise("second")  # deriving a system belongs to the system
    clock = time.process_time()
    solution = ao.solve(problem, tol=tol, throw=False, **options)
    return solution, time.process_time() - clock


def answer(solution: ao.Solution, spent: float, error: float | None = None) -> Row:
    """Return the row of a solution whose true error is `error`, as far as it is known."""
    return {
        "solver": "actionopt",
        "status": solution.status.name,
        "rung": solution.stats["rung"],
        "success": solution.success,
        "error": error,
        "estimate": float(solution.error),
        "time": spent,
    }


def told(question: Question, solution: ao.Solution, spent: float) -> Row:
    """Return the row of a solution, and how it was found."""
    stats = solution.stats
    error = deviation(solution, question.exact, question.problem, solution.mesh.nodes)
    return {
        **answer(solution, spent, error),
        "iterations": sum(stats["iterations"].values()),
        "rounds": len(stats["rounds"]),
        "unknowns": stats["unknowns"],
    }


def digest(solution: ao.Solution) -> bytes:
    """Return all bits of the answer."""
    numbers = [solution.path.values.ravel(), solution.mesh.boundaries]
    numbers.append([solution.action, solution.error])
    return np.concatenate(numbers).tobytes()


def condition(solution: ao.Solution) -> Row:
    """Return the entry of the condition number."""
    return {"condition": solution.stats["condition"]}


def other(question: Question, name: str, limit: float) -> Row:
    """Solve with another solver."""
    clock = time.process_time()
    try:
        curve, status = peers.SOLVERS[name](question, clock + limit), "SOLVED"
    except peers.Failed as failure:
        curve, status = None, str(failure)
    spent = time.process_time() - clock
    problem = question.problem
    error = None if curve is None else deviation(curve, question.exact, problem)
    return {
        "solver": name,
        "status": status,
        "success": curve is not None,
        "error": error,
        "time": spent,
    }


def deviation(curve: Curve, exact: Curve | None, problem: ao.Problem, nodes=()) -> float | None:
    """Return max |q_h - q| over many times, each coordinate in units of the largest |q|."""
    if exact is None:
        return None
    nodes = np.asarray(nodes)
    uniform = np.linspace(problem.start.t, problem.end.t, SAMPLES)
    t = np.unique(np.concatenate([uniform, nodes, (nodes[1:] + nodes[:-1]) / 2]))
    known = exact(t)
    size = np.max(np.abs(known), axis=1)
    size = np.where(size > 1e-12 * size.max(), size, size.max())
    return float(np.max(np.max(np.abs(curve(t) - known), axis=1) / size))


@dataclass(frozen=True)
class Criterion:
    """What a family must show, and what was found."""

    what: str
    expected: str
    found: str
    met: bool


def solved(rows: list[Row], solver: str = "actionopt") -> list[Row]:
    """Return the rows of a solver that say that they succeeded."""
    return [r for r in rows if r["solver"] == solver and r.get("success")]


def mine(rows: list[Row], prefix: str = "") -> list[Row]:
    """Return this package's rows of the cases whose names begin with `prefix`."""
    return [r for r in rows if r["solver"] == "actionopt" and r["case"].startswith(prefix)]


def every(what: str, good: int, count: int) -> Criterion:
    """Return the criterion that all are good."""
    return Criterion(what, f"{count} of {count}", f"{good} of {count}", good == count)


def beside(rows: list[Row], solver: str, wrong: float, what: str = "right") -> Criterion:
    """Return how often another solver's answer is right, which is told and not asked for."""
    own = [r for r in rows if r["solver"] == solver]
    right = sum(r["error"] <= wrong for r in solved(own, solver))
    return Criterion(f"{solver}: {what}", "told, not asked", f"{right} of {len(own)}", True)


def within(rows: list[Row], tol: float, what: str = "true error") -> Criterion:
    """Return the criterion that all rows succeed with a true error of at most `tol`."""
    worst = max((r.get("error") or 0.0) if r.get("success") else np.inf for r in rows)
    good = sum(bool(r.get("success")) and r["error"] <= tol for r in rows)
    names = ", ".join(r["case"] for r in rows if not (r.get("success") and r["error"] <= tol))
    found = f"{good} of {len(rows)}, worst {worst:.1e}" + (f"; not: {names}" if names else "")
    return Criterion(what, f"{len(rows)} of {len(rows)} within {tol:.0e}", found, not names)
