"""One solver on one problem, as it runs in a process of its own."""

from __future__ import annotations

import signal
from dataclasses import asdict, dataclass
from typing import Any

from actionopt import suite
from actionopt.suite import solvers
from actionopt.suite.verdict import judge


@dataclass(frozen=True)
class Cell:
    """A solver, a problem, a mesh and a starting point (defaults where None)."""

    solver: str
    problem: str
    elements: int | None = None
    degree: int | None = None
    start: str | None = None


def evaluate(cell: Cell) -> dict[str, Any]:
    """Run the solver and judge its answer; return the result as plain data."""
    problem = suite.get(cell.problem, cell.elements, cell.degree)
    about = {"class": problem.classification, "n": problem.n}
    try:
        answer = solvers.run(cell.solver, problem, problem.start(cell.start))
    except solvers.Absent as error:
        return about | {"verdict": "absent", "word": str(error)}
    except MemoryError:
        return about | {"verdict": "limit", "word": "out of memory"}
    except Exception as error:
        last = (str(error).strip().splitlines() or [""])[-1].strip()
        return about | {"verdict": "failed", "word": f"{type(error).__name__}: {last}"[:300]}
    # A problem of its own: a solver could have left its mark on the other.
    fresh = suite.get(cell.problem, cell.elements, cell.degree)
    return {
        **about,
        **asdict(judge(fresh, answer.x, answer.claimed)),
        "word": answer.word,
        "seconds": answer.seconds,
        "evaluations": {k: count for k, count in answer.evaluations.items() if count},
    }


def limit(memory: float, seconds: float) -> None:
    """Bound this process's address space (GiB) and time (s), where that is possible.

    Not the processor time: with a bound on that, sleqp does not converge.
    """
    try:
        import resource
    except ImportError:  # not on this system
        return
    amount = int(memory * 2**30)
    resource.setrlimit(resource.RLIMIT_AS, (amount, amount))
    signal.alarm(int(seconds) + 5)  # should whoever started it be gone by then


def bounded(asked: dict[str, Any], memory: float, seconds: float) -> dict[str, Any]:
    """Evaluate a cell, given as plain data, within these bounds."""
    limit(memory, seconds)
    return evaluate(Cell(**asked))
