"""Run something in a fresh process, within a time limit, and learn how much memory it took."""

from __future__ import annotations

import multiprocessing
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any


def run(work: Callable[..., Any], *arguments: Any, limit: float = 60.0) -> tuple[Any, int]:
    """Return what `work(*arguments)` returns, and the bytes by which memory peaked meanwhile.

    Raises TimeoutError if that takes longer than `limit` seconds.
    """
    spawn = multiprocessing.get_context("spawn")
    mine, theirs = spawn.Pipe(duplex=False)
    process = spawn.Process(target=_measured, args=(theirs, work, arguments))
    process.start()
    theirs.close()
    try:
        if not mine.poll(limit):
            raise TimeoutError(f"no answer in {limit:g} s")
        return mine.recv()
    finally:
        process.kill()
        process.join()


def _measured(pipe, work, arguments) -> None:
    before = _peak()
    value = work(*arguments)
    pipe.send((value, _peak() - before))


def _peak() -> int:
    """Return the largest resident memory of this process so far, in bytes."""
    status = Path("/proc/self/status")
    if status.exists():  # the other way counts the parent's memory too
        line = next(x for x in status.read_text().splitlines() if x.startswith("VmHWM"))
        return int(line.split()[1]) * 1024
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024
