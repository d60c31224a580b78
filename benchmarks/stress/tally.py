"""Many solves of one kind as one row: how many were solved, and how many of those are wrong."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

import actionopt as ao
from benchmarks.stress.case import Case, Criterion, Row, measured

FAR = 3.0  # times the claim, and times the tolerance: from there on an answer is wrong


@dataclass(frozen=True)
class Outcome:
    """One solve.

    Attributes
    ----------
    status : str
    success : bool
        Whether it called itself solved.
    error : float
        The true error; infinite or not a number where the path is near no motion at all.
    estimate : float
        The error claimed.
    tol, time : float
    accuracy : float
        Error of the reference: a smaller one is not counted.
    rung : str
        What found it.
    """

    status: str
    success: bool
    error: float
    estimate: float
    tol: float
    time: float
    accuracy: float = 0.0
    rung: str = ""

    @property
    def wrong(self) -> bool:
        """Whether it is called solved, and is not."""
        return self.success and not self.error <= FAR * max(self.estimate, self.tol) + self.accuracy

    @property
    def beyond(self) -> float:
        """The true error, less what the reference may have of it; infinite if there is none."""
        return max(self.error - self.accuracy, 0.0) if self.error == self.error else np.inf


def judged(
    solution: ao.Solution,
    error: Callable[[ao.Solution], float],
    tol: float,
    time: float,
    accuracy: float = 0.0,
) -> Outcome:
    """Return the outcome; `error` gives the true error of what is called solved."""
    true = float(error(solution)) if solution.success else np.nan
    claimed = float(solution.error)
    status, rung = solution.status.name, solution.stats["rung"]
    return Outcome(status, solution.success, true, claimed, tol, time, accuracy, rung)


def row(outcomes: Sequence[Outcome]) -> Row:
    """Return the row; errors are the worst of those called solved, and `rungs` what found them."""
    solved = [o for o in outcomes if o.success]
    return {
        **counted([o.status for o in outcomes], [o.time for o in outcomes]),
        "rungs": dict(Counter(o.rung for o in solved)),
        "wrong": sum(o.wrong for o in outcomes),
        "of_tol": max((o.beyond / o.tol for o in solved), default=None),
        "of_estimate": max((o.beyond / o.estimate for o in solved), default=None),
    }


def counted(endings: Sequence[str], times: Sequence[float]) -> Row:
    """Return the row of solves of which only the verdicts and times are known."""
    count, solved = len(endings), endings.count("SOLVED")
    return {
        "status": "SOLVED" if solved == count else "not all solved",
        "endings": dict(Counter(endings)),
        "success": solved == count,
        "count": count,
        "solved": solved,
        "time": float(np.median(times)),
        "longest": max(times),
    }


def batches(
    kinds: dict[str, Callable[[int], Outcome]], counts: dict[str, tuple], size: int, quick: bool
) -> list[Case]:
    """Return the cases of the first questions of each kind, at most `size` of them a row.

    As many as its counts say, of all and of a quick run; `kinds` tell the outcome of one.
    """

    def rows(ask: Callable[[int], Outcome], first: int, count: int) -> list[Row]:
        return [row([ask(k) for k in range(first, first + count)])]

    found = []
    for kind, asked in counts.items():
        step = min(size, asked[quick])
        for k in range(0, asked[quick], step):
            found.append(measured(f"{kind} {k} to {k + step - 1}", rows, kinds[kind], k, step))
    return found


def asked_too(name: str, ask: Callable[[int], tuple[str, float]], count: int, tol: float) -> Case:
    """Return the case of `solve_bvp` on the first questions: `ask` tells how it ended, and error.

    The error is infinite where it found nothing.
    """

    def rows() -> list[Row]:
        endings, times, errors = [], [], []
        for k in range(count):
            clock = time.process_time()
            ending, error = ask(k)
            endings.append(ending)
            times.append(time.process_time() - clock)
            errors.append(error)
        good = [e for e in errors if np.isfinite(e)]
        found = {"of_tol": max(good) / tol} if good else {}
        return [{"solver": "solve_bvp", **counted(endings, times), **found}]

    return measured(f"{name}, solve_bvp", rows)


def found_too(name: str, rows: Sequence[Row]) -> Criterion:
    """Return how many `solve_bvp` found, which is told and not asked for."""
    own = [r for r in rows if r["case"] == f"{name}, solve_bvp"]
    solved, count = (sum(r[k] for r in own) for k in ("solved", "count"))
    what = f"{name}: found by solve_bvp"
    return Criterion(what, "told, not asked", f"{solved} of {count}", True)


def never_wrong(what: str, rows: Sequence[Row]) -> Criterion:
    """Return the criterion that no answer called solved is wrong."""
    count, solved, wrong = (sum(r[k] for r in rows) for k in ("count", "solved", "wrong"))
    what = f"{what}: wrong answers called solved"
    return Criterion(what, f"0 of {count}", f"{wrong}; solved {solved}", wrong == 0)


def all_solved(what: str, rows: Sequence[Row], most: int = 0) -> Criterion:
    """Return the criterion that at most so many are not solved."""
    count, solved = (sum(r[k] for r in rows) for k in ("count", "solved"))
    others: Counter = Counter()
    for r in rows:
        others.update({k: n for k, n in r["endings"].items() if k != "SOLVED"})
    found = f"{count - solved}" + "".join(f", {k} {n}" for k, n in others.items())
    return Criterion(f"{what}: not solved", f"<= {most} of {count}", found, count - solved <= most)


def right_and_solved(what: str, rows: Sequence[Row], lost: float = 0.0) -> list[Criterion]:
    """Return both criteria, of which at most the part `lost` is not solved."""
    return [
        never_wrong(what, rows),
        all_solved(what, rows, int(lost * sum(r["count"] for r in rows))),
    ]
