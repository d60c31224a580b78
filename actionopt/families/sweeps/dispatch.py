"""Tasks that are done in this process or given to an executor, and what an interruption does."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from queue import Empty, SimpleQueue
from threading import Event
from time import perf_counter
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from actionopt.families.sweeps.task import Answers
from actionopt.tools.journal import Journal
from actionopt.tools.progress import LOG_PACE
from actionopt.tools.watch import (
    Progress,
    TimeUp,
    check_time,
    tell_each,
    time_left,
    time_limit,
)

if TYPE_CHECKING:
    from concurrent.futures import Executor, Future

IN_FLIGHT = 1024  # tasks that are sent at once, and so the workers that are kept busy; ad hoc


def check_executor(executor: Executor | None) -> None:
    """Raise ValueError for anything but an executor or None."""
    if executor is not None and (isinstance(executor, type) or not hasattr(executor, "submit")):
        raise ValueError(f"expected a concurrent.futures.Executor that is made, found {executor!r}")


class Entered(Protocol):
    """Something in which answers are entered: the arrays of a run."""

    def put(self, answers: Answers) -> None:
        """Enter what came of a task."""


@dataclass(eq=False)
class Intake:
    """Enters answers of tasks in `runs`, each once, keeps them in a journal, and reports."""

    stage: str  # what `progress` is told of them
    runs: Entered
    total: int  # members of all tasks
    journal: Journal | None
    progress: Progress | None
    done: int = 0  # members
    failed: int = 0
    entered: set[int] = field(default_factory=set)  # tasks

    def __call__(self, task: int, answers: Answers, kept: bool = False) -> None:
        """Enter a task, which may be `kept` already."""
        if task in self.entered:  # an interruption came behind that
            return
        if self.journal is not None and not kept:
            self.journal.append({"task": np.array(task), **answers})
        self.runs.put(answers)
        self.entered.add(task)
        self.done += answers["members"].size
        self.failed += int(np.isnan(answers["action"]).sum())
        self.report()

    def report(self) -> None:
        """Tell `progress` how far it is."""
        if self.progress is not None:
            self.progress(self.stage, self.done, self.total, {"failed": self.failed})

    def note(self, error: Exception) -> None:
        """Add to an error where what is finished is."""
        error.add_note(
            "What is finished is lost: `resume=FILE` keeps it, task by task."
            if self.journal is None
            else f"What is finished is in {str(self.journal.file)!r}: the same call goes on there."
        )


def dispatch(
    work: Callable[..., Any],
    tasks: Iterable[tuple[int, tuple]],
    executor: Executor | None,
    done: Callable[[int, Any], None],
    waits: Callable[[], None] = lambda: None,
) -> None:
    """Have `work(*given)` done for each (task, given), and call `done(task, answers)`.

    While a task is under way `waits` is called each ten seconds.

    An interruption (KeyboardInterrupt) sends no more to an executor; tasks that have begun are
    waited for and entered, which a line on the standard error says. Another one leaves them at
    once, and ends the executor's processes. Without an executor the task at hand is left at once.
    So are all tasks when the time given is used up.
    """
    if executor is None:
        with tell_each(LOG_PACE, waits):
            for task, given in tasks:
                done(task, work(*given))
        return
    flying: dict[int, Future] = {}
    arrived: SimpleQueue[int] = SimpleQueue()

    told = perf_counter()

    def tell() -> None:
        nonlocal told
        if perf_counter() - told >= LOG_PACE:
            told = perf_counter()
            waits()

    def next_one() -> int:
        while True:
            left = time_left()
            with suppress(Empty):
                return arrived.get(timeout=LOG_PACE if left is None else min(left, LOG_PACE))
            if time_left() == 0:
                raise TimeUp
            tell()

    def enter() -> None:
        task = next_one()
        done(task, flying[task].result())
        del flying[task]

    try:
        for task, given in tasks:
            check_time()
            tell()  # some seconds may go by until a task is ready
            flying[task] = executor.submit(_within, time_left(), work, *given)
            flying[task].add_done_callback(lambda _, task=task: arrived.put(task))
            while len(flying) >= IN_FLIGHT or not arrived.empty():
                enter()
        while flying:
            enter()
    except BaseException as error:
        begun = {task: future for task, future in flying.items() if not future.cancel()}
        if isinstance(error, KeyboardInterrupt) and not isinstance(error, TimeUp):
            _wait(begun, executor, done)
        raise


def _within(seconds: float | None, work: Callable[..., Any], *given: Any) -> Any:
    """Do a task, which leaves the executor when the time is used up: nobody waits for it then."""
    if seconds == 0:
        raise TimeUp
    with time_limit(seconds):
        return work(*given)


def _wait(begun: dict[int, Future], executor: Executor, done: Callable[[int, Any], None]) -> None:
    """Enter what comes of tasks that have begun; leave them at another interruption."""
    waiting = sum(not future.done() for future in begun.values())
    try:
        if waiting:
            tasks = "a task that has" if waiting == 1 else f"{waiting} tasks that have"
            print(
                f"interrupted: waiting for {tasks} begun; interrupt again to leave",
                file=sys.stderr,
                flush=True,
            )
        for task, future in begun.items():
            if future.exception() is None:
                done(task, future.result())
    except KeyboardInterrupt:
        running = sum(future.running() for future in begun.values())
        processes = dict(getattr(executor, "_processes", None) or {})
        if processes:
            # The executor's thread fails on cancelled tasks when its processes end (until Python
            # 3.12). It drops them when it cancels: in the order of submission, so this one last.
            dropped = Event()
            with suppress(RuntimeError):  # the processes have ended already
                executor.submit(int).add_done_callback(lambda _: dropped.set())
                executor.shutdown(wait=False, cancel_futures=True)
                dropped.wait(1.0)
        elif running:
            print(
                f"interrupted: left {running} of them, which no thread can be made to end: the "
                "executor waits for it when it is shut down",
                file=sys.stderr,
                flush=True,
            )
        for process in processes.values():
            process.terminate()
