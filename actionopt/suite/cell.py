"""One solver on one problem, as it runs in a process of its own."""

from __future__ import annotations

import signal
import traceback
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from actionopt import suite
from actionopt.suite import solvers
from actionopt.suite.member import Member
from actionopt.suite.verdict import examine
from actionopt.tools.process import processor_time


@dataclass(frozen=True)
class Cell:
    """A solver, a problem, a mesh and a starting point (the problem's own where None).

    `parameters` are those of `suite.get`: the scene's, and `decades`. There are `repeats` solves,
    of which the first is counted and the others are timed.
    """

    solver: str
    problem: str
    elements: int | None = None
    degree: int | None = None
    start: str | None = None
    parameters: Mapping[str, Any] = field(default_factory=dict)
    repeats: int = 1

    def make(self) -> Member:
        """Return the problem."""
        return suite.member(self.problem, self.elements, self.degree, **self.parameters)


def attempt(cell: Cell) -> dict[str, Any]:
    """Run the solver; return what it answers and how, as plain data."""
    problem = cell.make()
    x0, program = problem.start(cell.start), problem.view()
    # A start may have taken the answer: it is not left to be read where a solver can look.
    del problem
    program.forget()
    try:
        answer = solvers.run(cell.solver, program, x0, cell.repeats)
    except solvers.Absent as error:
        return {"outcome": "absent", "word": str(error)}
    except MemoryError:
        return {"outcome": "limit", "word": "out of memory"}
    except solvers.Mistake as error:
        cause = error.__cause__ or error
        return {"outcome": "error", "word": _last(cause), "trace": _trace(cause)}
    except Exception as error:
        return {"outcome": "failed", "word": _last(error)}
    return {
        "outcome": "answered",
        "said": answer.said,
        "word": answer.word,
        "seconds": answer.seconds,
        "times": list(answer.times),
        "evaluations": answer.evaluations,
        # A problem of its own counts them: a solver could have left its mark on the other.
        "history": cell.make().history(answer.program.visited or []),
        "x": np.asarray(answer.x, dtype=float).ravel().tolist(),
        "differing": [
            {"said": said, "word": word, "x": np.asarray(x, dtype=float).ravel().tolist()}
            for x, _, said, word in answer.differing
        ],
    }


def with_verdict(
    found: dict[str, Any], problem: Member, start: str | None = None
) -> dict[str, Any]:
    """Return what was found with what there is to know of it; a point only if it is a new one."""
    about = {"class": problem.classification, "n": problem.n, "m": problem.m}
    if found["outcome"] != "answered":
        return about | found
    x0 = problem.start(start)
    known = {
        "unbounded": problem.unbounded,
        "infeasible": problem.infeasible or None,
        "f_start": problem.objective(x0),
    }
    if not problem.infeasible:
        lowest = problem.lowest
        known["f_star"], known["f_lowest"] = (
            problem.f_star,
            lowest if np.isfinite(lowest) else None,
        )

    def with_evidence(answer: dict[str, Any]) -> dict[str, Any]:
        x = np.array(answer.pop("x", []))
        evidence = examine(problem, x, x0)
        point = (x / problem.unit).tolist() if evidence.at == "new" else None
        return _without_none(answer | asdict(evidence) | {"point": point})

    differing = [with_evidence(dict(answer)) for answer in found.pop("differing", ())]
    return (
        _without_none(about | known)
        | with_evidence(dict(found))
        | _without_none({"differing": differing or None})
    )


def _without_none(entries: dict[str, Any]) -> dict[str, Any]:
    """Return the entries that say something."""
    return {k: v for k, v in entries.items() if v is not None}


def evaluate(cell: Cell) -> dict[str, Any]:
    """Run the solver and judge its answer, here and now."""
    return with_verdict(attempt(cell), cell.make(), cell.start)


def _last(error: BaseException) -> str:
    last = (str(error).strip().splitlines() or [""])[-1].strip()
    return f"{type(error).__name__}: {last}"[:300]


def _trace(error: BaseException) -> str:
    """Return the end of the traceback."""
    return "".join(traceback.format_exception(error, chain=False))[-2000:]


def limit(memory: float, seconds: float) -> None:
    """Bound this process's address space (GiB) and time (s), where that is possible.

    Not the processor time, which is watched from outside: with a bound on that, sleqp does not
    converge.
    """
    try:
        import resource
    except ImportError:  # not on this system
        return
    amount = int(memory * 2**30)
    resource.setrlimit(resource.RLIMIT_AS, (amount, amount))
    signal.alarm(int(seconds) + 5)  # should whoever started it be gone by then


def run_within(asked: dict[str, Any], memory: float, seconds: float) -> dict[str, Any]:
    """Run a cell's solver, the cell given as plain data, within these bounds."""
    limit(memory, seconds)
    return attempt(Cell(**asked)) | {"processor": processor_time()}
