"""A line of progress on the standard error."""

from __future__ import annotations

import sys

BAR = 24  # characters


def progress(done: int, total: int, what: str) -> None:
    """Write how much is done and what was done last; over itself on a terminal."""
    filled = BAR * done // max(total, 1)
    line = f"[{'#' * filled}{'.' * (BAR - filled)}] {done}/{total} {what}"
    if sys.stderr.isatty():
        end = "\n" if done == total else ""
        print(f"\r\x1b[K{line}", end=end, file=sys.stderr, flush=True)
    else:
        print(line, file=sys.stderr, flush=True)
