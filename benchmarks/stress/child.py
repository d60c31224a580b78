"""Run something in a fresh process, and learn how much memory it took."""

from __future__ import annotations

import multiprocessing
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any


def run(work: Callable[..., Any], *arguments: Any) -> tuple[Any, int]:
    """Return what `work(*arguments)` returns, and the bytes by which memory peaked meanwhile."""
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=spawn) as pool:
        return pool.submit(_measured, work, arguments).result()


def _measured(work, arguments):
    before = _peak()
    value = work(*arguments)
    return value, _peak() - before


def _peak() -> int:
    """Return the largest resident memory of this process so far, in bytes."""
    status = Path("/proc/self/status")
    if status.exists():  # the other way counts the parent's memory too
        line = next(x for x in status.read_text().splitlines() if x.startswith("VmHWM"))
        return int(line.split()[1]) * 1024
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024
