"""Run many solvers on many problems, each in its own process; a crash or a hang costs one cell.

Results go to a file of JSON lines as they come. What the file has already is not run again, so
that an interrupted run is resumed by starting it anew.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

from actionopt.suite.cell import Cell

HOME = str(Path(__file__).parents[2])


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
    asked = asdict(cell) | asdict(limits)
    environment = {
        **os.environ,
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
        # This very package, wherever it was found.
        "PYTHONPATH": os.pathsep.join(filter(None, [HOME, os.environ.get("PYTHONPATH")])),
    }
    with tempfile.TemporaryDirectory() as folder:
        result = Path(folder, "result.json")
        command = [sys.executable, "-m", "actionopt.suite.cell", json.dumps(asked), str(result)]
        clock = perf_counter()
        process = subprocess.Popen(
            command,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            start_new_session=True,  # so that children of its own die with it
        )
        try:
            _, said = process.communicate(timeout=limits.seconds)
            outcome = _outcome(process.returncode, said.decode(errors="replace"), result)
        except subprocess.TimeoutExpired:
            outcome = {"verdict": "limit", "word": f"no answer in {limits.seconds:g} s"}
        finally:
            _end(process)
    return asdict(cell) | outcome | {"wall": perf_counter() - clock, "allowed": limits.seconds}


def _outcome(code: int, said: str, result: Path) -> dict[str, Any]:
    if result.is_file():
        return json.loads(result.read_text(encoding="utf-8"))
    if "MemoryError" in said or "bad_alloc" in said:
        return {"verdict": "limit", "word": "out of memory"}
    how = f"signal {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
    last = said.strip().splitlines()[-1:] or [""]
    return {"verdict": "failed", "word": f"the process died with {how}; {last[0]}"[:300]}


def _end(process: subprocess.Popen) -> None:
    """End the process and its children, and wait for it."""
    if process.poll() is None:
        if hasattr(os, "killpg"):
            os.killpg(process.pid, signal.SIGKILL)
        else:
            process.kill()
        process.communicate()


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
