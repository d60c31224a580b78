"""A line of progress on the standard error."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from time import perf_counter
from typing import TypeVar

from actionopt.tools.watch import Progress

T = TypeVar("T")
BAR_WIDTH = 24  # characters: a third of a narrow terminal
PATIENCE, PACE = 1.0, 0.1  # seconds before anything is said, and between two lines: ad hoc
LOG_PACE = 10.0  # seconds between two lines where there is no terminal, as in a log file; ad hoc


class Bar:
    """A bar on the terminal; elsewhere a line each ten seconds, and one at the end of those."""

    def __init__(self) -> None:
        self.shown, self.lines = perf_counter(), 0

    def __call__(self, done: int, total: int, what: str) -> None:
        """Write how much is done and what was done last; over itself on a terminal."""
        filled = BAR_WIDTH * done // max(total, 1)
        line = f"[{'#' * filled}{'.' * (BAR_WIDTH - filled)}] {done}/{total} {what}"
        if sys.stderr.isatty():
            end = "\n" if done == total else ""
            print(f"\r\x1b[K{line}", end=end, file=sys.stderr, flush=True)
        elif perf_counter() - self.shown >= LOG_PACE or (self.lines and done == total):
            self.shown, self.lines = perf_counter(), self.lines + 1
            print(line, file=sys.stderr, flush=True)


def steps(items: Sequence[T]) -> Iterator[T]:
    """Yield the items, and show how many are done and which one is under way."""
    bar = Bar()
    for k, item in enumerate(items):
        bar(k, len(items), str(item))
        yield item
    bar(len(items), len(items), "")


@contextmanager
def waiting() -> Iterator[Progress | None]:
    """Yield the `progress` of a solve that shows it on a terminal, after a second.

    The line is gone afterwards. Yields None where the standard error is no terminal.
    """
    if not sys.stderr.isatty():
        yield None
        return
    started = perf_counter()
    shown = started + PATIENCE - PACE

    def show(stage: str, done: int, total: int | None, detail: Mapping[str, float]) -> None:
        nonlocal shown
        now = perf_counter()
        if now - shown < PACE:
            return
        shown = now
        filled = int((now - started) / PACE) % (BAR_WIDTH + 1)  # how long it will take is not known
        bar = "#" * filled + "." * (BAR_WIDTH - filled)
        what = f"{stage}, {detail['elements']} elements, {done} iterations"
        line = f"[{bar}] {now - started:.0f} s: {what}"
        print(f"\r\x1b[K{line}", end="", file=sys.stderr, flush=True)

    try:
        yield show
    finally:
        if shown > started + PATIENCE - PACE:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)
