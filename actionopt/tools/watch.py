"""What watches over a search: the time it may take, and who wants to know how far it is."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass, replace
from inspect import signature
from time import perf_counter

from actionopt.tools.checks import number
from actionopt.tools.types import EPS

# progress(stage, done, total, detail): what is being done, how many steps of it are done and how
# many there are (None where nobody knows), and numbers by name, such as {"elements": 8}.
Progress = Callable[[str, int, int | None, Mapping[str, float]], object]


def check_progress(progress: Progress | None) -> None:
    """Raise ValueError for anything but None or a callable of four arguments."""
    if progress is None:
        return
    try:
        takes = callable(progress)
        with suppress(ValueError):  # of some that are built in nobody knows
            signature(progress).bind("", 0, None, {})
    except TypeError:
        takes = False
    if not takes:
        raise ValueError(f"expected progress(stage, done, total, detail), found {progress!r}")


def positive_seconds(seconds: float) -> float:
    """Return a time limit. Raises ValueError for anything but a positive number."""
    given = number(seconds, "the seconds a search may take")
    if given <= 0 or isinstance(seconds, bool):
        raise ValueError(f"expected a positive number of seconds, found {seconds!r}")
    return given


class TimeUp(KeyboardInterrupt):
    """The time given to a search for many paths is used up: it ends as if it were interrupted."""


@dataclass
class _Clock:
    """When, of `perf_counter`, a search for many paths ends, and when it is to tell next."""

    end: float = math.inf
    due: float = math.inf
    pace: float = math.inf
    tell: Callable[[], object] = lambda: None


_NO_CLOCK = _Clock()
_CLOCK: ContextVar[_Clock] = ContextVar("clock", default=_NO_CLOCK)  # of this thread


@contextmanager
def time_limit(seconds: float | None) -> Iterator[None]:
    """Let `check_time` raise TimeUp in the body, in this thread, after so many seconds.

    Without a limit if None. Raises ValueError as `positive_seconds` does.
    """
    end = math.inf if seconds is None else perf_counter() + positive_seconds(seconds)
    outer = _CLOCK.get()
    token = _CLOCK.set(replace(outer, end=min(outer.end, end)))
    try:
        yield
    finally:
        _CLOCK.reset(token)


@contextmanager
def tell_each(pace: float, tell: Callable[[], object]) -> Iterator[None]:
    """Let `check_time` call `tell` in the body, in this thread, each so many seconds.

    What it raises is raised at the end: what is under way ends as if the time were used up.
    """
    raised: list[BaseException] = []

    def tell_or_end() -> None:
        try:
            tell()
        except BaseException as error:
            raised.append(error)
            raise TimeUp from None

    token = _CLOCK.set(_Clock(_CLOCK.get().end, perf_counter() + pace, pace, tell_or_end))
    try:
        yield
    except TimeUp:
        if raised:
            raise raised[0] from None
        raise
    finally:
        _CLOCK.reset(token)


def check_time(ahead: float = 0.0) -> None:
    """Raise TimeUp if the time given to a search for many paths is over; report progress if due.

    Or if it will be `ahead`, seconds that what is begun now takes and that nothing ends.
    """
    clock = _CLOCK.get()
    now = perf_counter()
    if now + ahead > clock.end:
        raise TimeUp
    if now > clock.due:
        clock.tell()
        clock.due = perf_counter() + clock.pace


def time_left() -> float | None:
    """Return how many seconds are left, at least zero; None without a limit."""
    end = _CLOCK.get().end
    return None if math.isinf(end) else max(end - perf_counter(), 0.0)


class OutOfTime(Exception):
    """The time that was given is used up; never seen outside the solver."""


class Spent(Exception):
    """What a search may cost is used up; never seen outside the solver."""


class Watch:
    """Looked at whenever second derivatives are evaluated, which every iteration does.

    Parameters
    ----------
    seconds : float or None
        After which `OutOfTime` is raised; without a limit if None.
    progress : callable or None
        `progress(how, iterations, None, {"elements": elements})`, called each time.
    outer : Watch, optional
        Of the search that this one is a part of: its time is that of both.

    Raises
    ------
    ValueError
        If the time is no positive number.
    """

    def __init__(
        self, seconds: float | None, progress: Progress | None, outer: Watch | None = None
    ) -> None:
        self.outer = outer
        self.end: float | None = None if outer is None else outer.end
        self.since, self.evaluated = 0.0, 0  # from the first derivatives on
        self.most = math.inf  # elements evaluated, after which `Spent` is raised
        if seconds is not None:
            self.end = perf_counter() + positive_seconds(seconds)
        check_progress(progress)
        self.progress, self.how, self.iterations = progress, "", 0
        self._raised: BaseException | None = None  # by progress: no handler may swallow it

    @property
    def error(self) -> BaseException | None:
        """What `progress` raised."""
        return self._raised if self.outer is None else self.outer.error

    @property
    def has_costs(self) -> bool:
        """Whether ways have a price: those of a search whose time is given have that."""
        return self.end is None or self.outer is not None

    def __call__(self, elements: int) -> None:
        """Count second derivatives on so many elements, and look."""
        if self.evaluated == 0:
            self.since = perf_counter()
        self.evaluated += elements
        self.look(elements)

    def look(self, elements: int) -> None:
        """Raise OutOfTime, or report, when it is time to."""
        if self.outer is not None:
            self.outer.how = self.how
            self.outer.look(elements)
        self.iterations += 1
        if self._raised is not None:
            raise OutOfTime
        if self.progress is not None:
            try:
                self.progress(self.how, self.iterations, None, {"elements": elements})
            except BaseException as error:
                self._raised = error
                raise
        self.check()
        if self.evaluated > self.most:
            raise Spent

    def check(self, ahead: float = 0.0) -> None:
        """Raise OutOfTime if the time is over.

        Or if it will be `ahead`, seconds that what is begun now takes and that nothing ends.
        """
        if self.end is not None and perf_counter() + ahead > self.end:
            raise OutOfTime

    def affords(self, elements: int) -> bool:
        """Whether there is time for derivatives on so many elements, at the pace so far."""
        if self.end is None or self.evaluated == 0:
            return True
        now = perf_counter()
        return elements * (now - self.since) <= self.evaluated * (self.end - now)


@contextmanager
def limit(watch: Watch | None) -> Iterator[None]:
    """Raise OutOfTime of a watch in the body, too, where `check_time` alone looks at the time."""
    end = None if watch is None else watch.end
    try:
        with time_limit(None if end is None else max(end - perf_counter(), EPS)):
            yield
    except TimeUp:
        check_time()  # of a search that this one is a part of
        raise OutOfTime from None
