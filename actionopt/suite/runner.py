"""Run many solvers on many problems, each in its own process; a crash or a hang costs one cell.

Results go to a file of JSON lines as they come. What the file has already is not run again, so
that an interrupted run is resumed by starting it anew: the same solver (its file or its version),
on the same numbers, on this machine. What ran out of its time or memory is run again with more, and
what the clock ended before it had used its time is run again.
"""

from __future__ import annotations

import datetime
import hashlib
import json
import os
import platform
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import asdict, dataclass, replace
from functools import cache, lru_cache
from pathlib import Path
from threading import Lock
from time import perf_counter
from typing import Any

import numpy as np

from actionopt.suite import solvers
from actionopt.suite.cell import Cell, with_verdict
from actionopt.suite.member import Member
from actionopt.suite.verdict import verdict
from actionopt.tools import process
from actionopt.tools.checks import check_jobs
from actionopt.tools.files import ready, rounded
from actionopt.tools.watch import positive_seconds

RECORD_DIGITS = 4  # of times and distances: they differ in the second
ROUNDED_COLUMNS = (
    *("distance", "residual", "violation", "off"),
    *("seconds", "times", "wall", "processor", "load"),
)
CLOCK_FACTOR = 10.0  # seconds of the clock for one of the processor, on a machine with much to do
STARTUP = 1.0  # second of the processor that a process takes to start; ad hoc
ONE_AT_A_TIME = Lock()
# What the process of a solver says; the rest is found out here.
REPORTED = (
    *("outcome", "said", "word", "trace", "x", "differing"),
    *("seconds", "times", "processor", "evaluations", "history"),
)
KEY = ("solver", "problem", "elements", "degree", "start", "parameters", "repeats")
CONTENT = ("content", "numbers", "package", "machine")  # what makes answers differ beside these


@dataclass(frozen=True)
class Limits:
    """Processor time (s) of one solve, and memory (GiB) of its process.

    The clock may run `CLOCK_FACTOR` times as long for a process that uses less, and all its solves.
    """

    seconds: float = 5.0
    memory: float = 8.0


def run(
    cells: Iterable[Cell],
    file: str | Path,
    *,
    limits: Limits | None = None,
    jobs: int = 1,
    again: bool = False,
    show: Callable[[int, int, dict[str, Any]], None] | None = None,
) -> list[dict[str, Any]]:
    """Run the cells that `file` does not have yet, and return the results of all of them.

    All of them are run if it is to be done `again`. `show(done, total, record)` is called after
    each, from one thread.
    """
    bounds = limits or Limits()
    check_jobs(jobs)
    positive_seconds(bounds.seconds)
    file = ready(file)
    numbered: dict[str, dict[str, Any]] = {}
    wanted: dict[str, tuple[Cell, dict[str, Any]]] = {}
    for cell in cells:
        about = identity(cell, numbered)
        wanted[key(about)] = cell, about
    known = {key(r): r for r in load(file)}
    ahead = [w for k, w in wanted.items() if again or not _holds(known.get(k), bounds)]
    done = len(wanted) - len(ahead)
    with open(file, "a", encoding="utf-8") as out, ThreadPoolExecutor(jobs) as pool:
        if out.tell() and not Path(file).read_bytes().endswith(b"\n"):
            out.write("\n")  # after a line that an interruption tore off
        waiting = [pool.submit(run_one, cell, about, bounds) for cell, about in ahead]
        try:
            for future in as_completed(waiting):
                record = future.result()
                known[key(record)] = record
                out.write(json.dumps(record) + "\n")
                out.flush()
                done += 1
                if show is not None:
                    show(done, len(wanted), record)
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    return [known[k] for k in wanted]


def identity(cell: Cell, numbered: dict[str, dict[str, Any]] | None = None) -> dict[str, Any]:
    """Return what tells a cell from others: what was asked, and what the answer depends on.

    `numbered` keeps what is found of each problem, which has to be made for it.
    """
    from actionopt import __version__

    numbered = {} if numbered is None else numbered
    asked = json.dumps(asdict(replace(cell, solver="", repeats=1)))
    if asked not in numbered:
        numbered[asked] = _numbers(cell)
    return {
        **asdict(cell),
        **numbered[asked],
        "content": solvers.content(cell.solver),
        "package": f"actionopt {__version__}",
        "machine": machine(),
    }


def _numbers(cell: Cell) -> dict[str, Any]:
    """Return mesh and start, and a digest of the problem's numbers there."""
    problem = cell.make()
    start = cell.start or problem.default_start
    x0 = problem.start(start)
    slopes = problem.gradient(x0) if problem.smooth else []
    values = [problem.objective(x0), *slopes, *problem.constraints(x0), *x0]
    if problem.inequalities:
        values += np.concatenate([*problem.bounds, *problem.constraint_bounds]).tolist()
    said = " ".join(f"{value:.9g}" for value in (*values, *problem.unit))
    return {
        **problem.resolution,
        "start": start,
        "own_start": problem.default_start,
        "numbers": hashlib.sha256(said.encode()).hexdigest()[:12],
    }


def key(record: Mapping[str, Any]) -> str:
    """Return what tells a record from others."""
    return json.dumps([record.get(name) for name in (*KEY, *CONTENT)], sort_keys=True)


def _holds(record: Mapping[str, Any] | None, bounds: Limits) -> bool:
    """Whether a record answers the question: within these bounds it would come to the same."""
    if record is None:
        return False
    if record.get("clock"):  # the machine may have less to do now
        return False
    short = bounds.seconds > record["allowed"] or bounds.memory > record["memory"]
    return not (record["outcome"] == "limit" and short)


def run_one(cell: Cell, about: Mapping[str, Any], limits: Limits) -> dict[str, Any]:
    """Run one cell in a process of its own; return its record, whatever becomes of it."""
    return judge(cell, about, attempt(cell, limits))


def attempt(cell: Cell, limits: Limits) -> dict[str, Any]:
    """Run one cell in a process of its own; return what came of it, the answer not judged."""
    clock, wall = perf_counter(), CLOCK_FACTOR * (STARTUP + limits.seconds)
    try:
        told = process.run(
            "actionopt.suite.cell:run_within",
            *(asdict(cell), limits.memory, wall),
            limit=wall,
            processor=limits.seconds,
        )
        outcome = {name: told[name] for name in REPORTED if name in told}
    except process.Overrun as error:
        # Who sleeps has used less than is allowed, and is not out of time.
        short = error.used is not None and error.used < limits.seconds
        outcome = {
            "outcome": "failed" if short else "limit",
            "word": str(error),
            "processor": error.used,
            "clock": short or None,
        }
    except process.Died as error:
        outcome = {"outcome": "failed", "word": str(error)[:300]}
        if "MemoryError" in error.said or "bad_alloc" in error.said:
            outcome = {"outcome": "limit", "word": "out of memory"}
    return {
        **outcome,
        "wall": perf_counter() - clock,
        "load": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
        "allowed": limits.seconds,
        "memory": limits.memory,
        "date": datetime.date.today().isoformat(),
    }


def judge(cell: Cell, about: Mapping[str, Any], outcome: dict[str, Any]) -> dict[str, Any]:
    """Return the record of what came of a cell."""
    with ONE_AT_A_TIME:  # what is known of a problem is found once, and takes no solver's time
        problem = _problem(json.dumps(asdict(replace(cell, solver=""))))
        outcome = with_verdict(outcome, problem, cell.start)
    record = {**about, **outcome}
    short = rounded({k: record[k] for k in ROUNDED_COLUMNS if k in record}, RECORD_DIGITS)
    return {k: v for k, v in (record | short).items() if v not in (None, "")}


@lru_cache(maxsize=4)  # solvers take turns on a problem
def _problem(asked: str) -> Member:
    return Cell(**json.loads(asked)).make()


@cache
def machine() -> str:
    """Return the processor, how many of its cores there are, and the system."""
    name = platform.processor() or platform.machine()
    if sys.platform == "linux":
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                name = line.split(":")[1].strip()
                break
    python = platform.python_version()
    return f"{name}, {os.cpu_count()} cores, {platform.system()}, Python {python}"


def load(file: str | Path) -> list[dict[str, Any]]:
    """Return the records of a file, none if there is no such file; a torn last line is left out."""
    if not Path(file).is_file():
        return []
    records = []
    for line in Path(file).read_text(encoding="utf-8").splitlines():
        try:
            records.append(json.loads(line))
        except json.JSONDecodeError:
            continue
    return records


def tally(records: Sequence[Mapping[str, Any]], mode: str) -> dict[str, Counter[str]]:
    """Return the verdicts of each solver."""
    counts: dict[str, Counter[str]] = {}
    for record in records:
        counts.setdefault(record["solver"], Counter())[verdict(record, mode)] += 1
    return counts
