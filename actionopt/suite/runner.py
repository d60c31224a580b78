"""Run many solvers on many problems, each in its own process; a crash or a hang costs one cell.

Results go to a file of JSON lines as they come. What the file has already is not run again, so
that an interrupted run is resumed by starting it anew.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

from actionopt.suite.cell import Cell
from actionopt.tools import process
from actionopt.tools.files import rounded

DIGITS = 4  # of what is kept: times differ in the second


@dataclass(frozen=True)
class Limits:
    """Wall time (s) and memory (GiB) of one cell, its process's start included."""

    seconds: float = 60.0
    memory: float = 8.0


def run(
    cells: Iterable[Cell],
    file: str | Path,
    *,
    limits: Limits | None = None,
    jobs: int = 1,
    show: Callable[[int, int, dict[str, Any]], None] | None = None,
) -> list[dict[str, Any]]:
    """Run the cells that `file` does not have yet, and return the results of all of them.

    `show(done, total, record)` is called after each, from one thread.
    """
    wanted, known = list(dict.fromkeys(cells)), {key(r): r for r in load(file)}
    ahead = [cell for cell in wanted if key(asdict(cell)) not in known]
    bounds = limits or Limits()
    done = len(wanted) - len(ahead)
    with open(file, "a", encoding="utf-8") as out, ThreadPoolExecutor(jobs) as pool:
        if out.tell() and not Path(file).read_bytes().endswith(b"\n"):
            out.write("\n")  # after a line that an interruption tore off
        waiting = [pool.submit(run_one, cell, bounds) for cell in ahead]
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
    return [known[key(asdict(cell))] for cell in wanted]


def run_one(cell: Cell, limits: Limits) -> dict[str, Any]:
    """Run one cell in a process of its own; return its record, whatever becomes of it."""
    clock = perf_counter()
    try:
        arguments = asdict(cell), limits.memory, limits.seconds
        outcome = process.run("actionopt.suite.cell:bounded", *arguments, limit=limits.seconds)
    except TimeoutError as error:
        outcome = {"verdict": "limit", "word": str(error)}
    except process.Died as error:
        outcome = {"verdict": "failed", "word": str(error)[:300]}
        if "MemoryError" in error.said or "bad_alloc" in error.said:
            outcome = {"verdict": "limit", "word": "out of memory"}
    wall = perf_counter() - clock
    record = asdict(cell) | outcome | {"wall": wall, "allowed": limits.seconds}
    return rounded({k: v for k, v in record.items() if v not in (None, "")}, DIGITS)


def key(record: dict[str, Any]) -> tuple:
    """Return what tells a record's cell from others."""
    return tuple(record.get(name) for name in Cell.__dataclass_fields__)


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


def tally(records: Sequence[dict[str, Any]]) -> dict[str, Counter[str]]:
    """Return the verdicts of each solver."""
    counts: dict[str, Counter[str]] = {}
    for record in records:
        counts.setdefault(record["solver"], Counter())[record["verdict"]] += 1
    return counts
