"""A measurement in a fresh process: what it returns, and how much memory it took."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from actionopt.tools import process

LIMIT = 60.0  # s


def run(target: str, *arguments: Any, limit: float = LIMIT) -> tuple[Any, int]:
    """Return what "module:function" returns, and the bytes by which memory peaked meanwhile.

    Raises TimeoutError or `process.Died`.
    """
    return process.run("benchmarks.child:measured", target, *arguments, limit=limit)


def row(target: str, *arguments: Any, limit: float = LIMIT) -> dict:
    """Return the row that "module:function" returns, with its memory, or the row of a failure."""
    try:
        found, memory = run(target, *arguments, limit=limit)
    except (TimeoutError, process.Died) as failure:
        return {"status": str(failure), "success": False, "time": limit}
    return {**found, "memory": memory}


def measured(target: str, *arguments: Any) -> tuple[Any, int]:
    """Call the function in this process."""
    work = process.function(target)
    before = peak()
    value = work(*arguments)
    return value, peak() - before


def peak() -> int:
    """Return the largest resident memory of this process so far, in bytes."""
    status = Path("/proc/self/status")
    if status.exists():  # the other way counts the parent's memory too
        line = next(x for x in status.read_text().splitlines() if x.startswith("VmHWM"))
        return int(line.split()[1]) * 1024
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024
