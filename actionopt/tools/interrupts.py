"""What signal handlers raise while compiled code runs, which no exception can cross.

Ctrl-C is one of them, a time limit by signal.alarm another. The compiled code asks Python for
signals now and then, and takes whatever a handler raises for Ctrl-C, or loses it.
"""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

# The functions that `signal` wraps: its conversions to enumerations take twenty times as long.
try:
    from _signal import getsignal as _get  # type: ignore
    from _signal import signal as _set  # type: ignore
except ImportError:
    _get, _set = signal.getsignal, signal.signal

_NO_HANDLERS = None, signal.SIG_DFL, signal.SIG_IGN
_SIGNALS = tuple(int(number) for number in signal.valid_signals())


@contextmanager
def raised_later(raised: list[BaseException], *, stop: bool) -> Iterator[None]:
    """Keep what signal handlers raise in the body, and raise the first of it at the end.

    Parameters
    ----------
    raised : list
        To which it is appended; what else is found there at the end is raised as well. It is
        empty afterwards.
    stop : bool
        Whether a handler's exception goes on into the compiled code, which ends with an error of
        its own. Else whoever is called back looks at `raised`.
    """
    # Python runs its handlers in one thread only, and lets no other set them.
    mine = threading.current_thread() is threading.main_thread()
    found = zip(_SIGNALS, map(_get, _SIGNALS), strict=True) if mine else ()
    handlers: list[Any] = [pair for pair in found if pair[1] not in _NO_HANDLERS]
    stderr, silent = sys.stderr, _Others(sys.stderr)
    ended = False
    raised.clear()

    def keep(handler: Callable[[int, Any], Any]) -> Callable[[int, Any], None]:
        def run(number: int, frame: Any) -> None:
            if ended:  # another handler has raised while they were set back
                return handler(number, frame)
            try:
                handler(number, frame)
            except BaseException as error:
                raised.append(error)
                if stop:
                    sys.stderr = silent  # it is told there, too
                    raise

        return run

    changed = [(number, handler, keep(handler)) for number, handler in handlers]
    first = None
    try:
        for number, _, handler in changed:
            _set(number, handler)
        yield
    except Exception:
        if not raised:
            raise
    finally:
        if sys.stderr is silent:  # another thread that ends here leaves it
            sys.stderr = stderr
        try:
            for number, before, handler in changed:
                if _get(number) is handler:  # and not one that a handler has set
                    _set(number, before)
        finally:
            ended = True
        if raised:
            first = raised[0]
            raised.clear()
    if first is not None:
        try:
            raise first
        finally:
            del first  # or it would refer to itself


def ordinary_errors() -> type[Exception] | tuple[()]:
    """Return what an except clause is to catch: nothing if the handler of a signal raised it.

    For one that takes whatever its body raises for a failure of what that tried: `except
    ordinary_errors():`, which is evaluated when there is an error.
    """
    error = sys.exc_info()[1]
    return () if error is not None and _is_from_handler(error) else Exception


def _is_from_handler(error: BaseException) -> bool:
    """Return whether the handler of a signal, as `signal` knows it now, raised an error."""
    functions = (getattr(_get(number), "__func__", _get(number)) for number in _SIGNALS)
    codes = {code for f in functions if (code := getattr(f, "__code__", None)) is not None}
    trace = error.__traceback__
    while trace is not None:
        if trace.tb_frame.f_code in codes:
            return True
        trace = trace.tb_next
    return False


def leave_interruptions() -> None:
    """Let Ctrl-C in a terminal, which all its processes are told of, be for who gives out tasks.

    In a process that another one started, for good: one that waits for a task would end by it.
    """
    import multiprocessing

    if (
        multiprocessing.parent_process() is not None
        and threading.current_thread() is threading.main_thread()
    ):
        signal.signal(signal.SIGINT, signal.SIG_IGN)


class _Others:
    """Standard error for the other threads alone."""

    def __init__(self, stream: Any) -> None:
        self.stream, self.thread = stream, threading.get_ident()

    def write(self, text: str) -> int:
        if threading.get_ident() == self.thread:
            return len(text)
        return self.stream.write(text)

    def flush(self) -> None:
        self.stream.flush()
