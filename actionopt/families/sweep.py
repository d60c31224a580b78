"""Solve a problem over a grid of values, in this process or on many machines.

The grid is cut into tasks, runs of neighbours, each of which is solved from the path of its own
first member: a seed. Seeds are solved here, each from the nearest of those before, and a task needs
nothing of other tasks. So neither the cut nor any number depends on who solves what, or when.
"""

from __future__ import annotations

import hashlib
import pickle
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path as FilePath
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from actionopt.analysis.solution import SolveError
from actionopt.discrete.path import Path
from actionopt.families.batch import solve_run
from actionopt.families.grid import Grid, said
from actionopt.families.kept import Kept
from actionopt.families.runs import SAME_PATH, Runs
from actionopt.families.task import Answers, work
from actionopt.families.vary import Name, led, moved
from actionopt.mechanics.problem import Problem
from actionopt.solver.arguments import asked
from actionopt.solver.solve import solve
from actionopt.tools.checks import tolerance
from actionopt.tools.journal import Journal
from actionopt.tools.types import Array, NDInt

if TYPE_CHECKING:
    from concurrent.futures import Executor, Future

SECONDS = 1.0  # of a task, about: what is lost with a worker, and much beside what sending it takes
# Of a member, and of its unknowns times its coordinates. Measured, with 117 to 542 unknowns, to a
# half; those with constraints or forces, which are solved one by one, take some ten times as long.
MEMBER_SECONDS, UNKNOWN_SECONDS, ONE_BY_ONE = 1e-4, 2e-6, 10
MOST_MEMBERS = 4096  # of a task, so that its answers are a megabyte at most; ad hoc
IN_FLIGHT = 1024  # tasks that are sent at once, and so the workers that are kept busy; ad hoc
PILOTS = 8  # members at equal distances of which the first that is solved tells their size; ad hoc
MANY_STEPS = 8, 16, 32  # from a seed to the next, where the grid itself has more; ad hoc
FORMAT = "actionopt sweep 1"
RECORDED = ("index",)

Progress = Callable[[int, int, int], object]


def sweep(
    problem: Problem,
    over: Mapping[Name, ArrayLike],
    *,
    executor: Executor | None = None,
    tol: float = 1e-8,
    record: str | Sequence[str] | None = None,
    keep_paths: bool = False,
    zip: bool = False,
    progress: Progress | None = None,
    resume: str | FilePath | None = None,
) -> Runs:
    """Return the stationary paths of `problem` over a grid of values, as arrays.

    Each member is solved from a neighbour that was solved: a map follows one kind of path as far
    as it goes. Where it does not hang together, as beyond a fold, `branch` of what is returned
    says so. A member that fails is data, not an exception.

    Parameters
    ----------
    problem : Problem
    over : mapping of names to rows of numbers
        What varies, one axis of the grid each: the name of a parameter (one number); "t0" or
        "t1", the time of an event; ("start", name) or ("end", name), a coordinate there.
    executor : concurrent.futures.Executor, optional
        Who solves: processes, threads, or machines (Dask's `client.get_executor()`, mpi4py's
        `MPIPoolExecutor`). The numbers are the same, to the last bit, as in this process alone.
    tol : float
        As for `solve`, for each member.
    record : str or sequence of str, optional
        What is to be found of each besides: "index".
    keep_paths : bool
        Keep the paths, too: some kilobytes each.
    zip : bool
        All rows have one length, and member k has the k-th value of each: one axis.
    progress : callable, optional
        `progress(done, total, failed)`, members, after each task. An interruption
        (KeyboardInterrupt) cancels the tasks that wait, ends the sweep and keeps what is done.
    resume : str or path, optional
        A file that keeps what is finished, task by task, and is written if there is none. The same
        call goes on from there after whatever ended the process.

    Raises
    ------
    ValueError
        For bad arguments, or if the file belongs to another question, before any solver runs; if
        all members make no sense.
    SolveError
        If all members failed.
    """
    asked(problem)
    tolerance(tol)
    grid = Grid.of(problem, over, zip)
    index = "index" in _recorded(record)
    if executor is not None and not hasattr(executor, "submit"):
        raise ValueError(f"expected a concurrent.futures.Executor, found {executor!r}")
    if progress is not None and not callable(progress):
        raise ValueError(f"expected progress(done, total, failed), found {progress!r}")
    journal = None if resume is None else Journal(resume, _question(grid, tol, index, keep_paths))
    run = _Run(grid, Runs.begun(grid, tol, index, keep_paths), executor, progress, journal)
    try:
        run.go(run.begin())
    except KeyboardInterrupt:
        return run.runs
    except Exception as error:
        if journal is not None:
            error.add_note(f"What is finished is in {str(resume)!r}: the same call goes on there.")
        raise
    if not run.runs.success.any():
        _none_solved(run.runs)
    return run.runs


def _recorded(record: str | Sequence[str] | None) -> tuple[str, ...]:
    """Return the names of what is to be recorded. Raises ValueError for an unknown one."""
    names = (record,) if isinstance(record, str) else tuple(record or ())
    for name in names:
        if name not in RECORDED:
            raise ValueError(
                f"expected something to record out of {', '.join(RECORDED)}, found {name!r}"
            )
    return names


def _question(grid: Grid, tol: float, index: bool, keep_paths: bool) -> dict[str, Any]:
    """Return what tells one sweep from another, as plain data."""
    from importlib.metadata import version  # slow to import

    problem, over = grid.problem, {}
    for name, row in zip(grid.names, grid.values, strict=True):
        digest = hashlib.sha256(row.tobytes()).hexdigest()[:12]
        over[said(name)] = f"{row.size} values from {row[0]:g} to {row[-1]:g} ({digest})"
    return {
        "format": FORMAT,
        "law": f"{problem.name} ({problem.system.digest[:12]})",
        "parameters": {name: x.tolist() for name, x in problem.parameters.items()},
        "start": [problem.start.t, problem.start.q],
        "end": [problem.end.t, problem.end.q],
        "advance": None if problem.advance is None else problem.advance.tolist(),
        "over": over,
        "zip": grid.zipped,
        "tol": tol,
        "record": ["index"] if index else [],
        "keep_paths": keep_paths,
        "made by": f"actionopt {version('actionopt')}, CasADi {ca.CasadiMeta.version()}",
    }


def _none_solved(runs: Runs) -> None:
    """Raise what the first member raises, and say that the others are no better."""
    first = solve(runs.grid.member(0), tol=runs.tol, throw=False)
    names, counts = np.unique(runs.status, return_counts=True)
    found = ", ".join(f"{count} {name}" for name, count in zip(names, counts, strict=True))
    raise SolveError(
        f"expected members that can be solved, found {found} of {runs.grid.size}; the first, "
        f"{runs.grid.text(0)}: {first.status.value}",
        first,
    )


@dataclass(eq=False)
class _Run:
    """A sweep under way."""

    grid: Grid
    runs: Runs
    executor: Executor | None
    progress: Progress | None
    journal: Journal | None
    length: int = 0  # of a task, in members
    question: bytes = b""
    pilot: int = 0  # place in the order of the first member that was solved
    seeds: dict[int, Path] = field(default_factory=dict)  # by the member's place in the order
    done: int = 0  # members
    failed: int = 0

    # -- before the tasks --------------------------------------------------------------------------

    def begin(self) -> dict[int, Answers]:
        """Find a first path, or read what a file has; return the tasks that are finished."""
        records = [] if self.journal is None else self.journal.records
        if records:
            self.length, self.pilot = int(records[0]["length"]), int(records[0]["pilot"])
        else:
            unknowns, system = self._pilot(), self.grid.problem.system
            seconds = MEMBER_SECONDS + UNKNOWN_SECONDS * unknowns * system.n
            seconds *= ONE_BY_ONE if system.m or system.structure.forced else 1
            self.length = int(np.clip(SECONDS / seconds, 1, MOST_MEMBERS))
            if self.journal is not None:
                about = {"length": self.length, "pilot": self.pilot}
                self.journal.append(about | self._packed(self.pilot))
        for record in records:
            path = Kept.unpacked(record, "seed").path(0)
            if path is not None:
                self.seeds[
                    int(record["task"]) * self.length if "task" in record else self.pilot
                ] = path
        self.question = pickle.dumps(self.grid.problem)
        return {int(record["task"]): record for record in records[1:]}

    def _pilot(self) -> int:
        """Solve the first of some members that can be; return how many unknowns it has."""
        unknowns = 0
        for place in np.unique(np.linspace(0, self.grid.size - 1, PILOTS).astype(int)).tolist():
            with suppress(ValueError):
                problem = self.grid.member(int(self.grid.order[place]))
                found = solve(problem, tol=self.runs.tol, throw=False)
                unknowns = found.stats["unknowns"]
                if found.success:
                    self.pilot, self.seeds[place] = place, found.path
                    break
        return unknowns

    def _packed(self, place: int) -> dict[str, Array]:
        """Return a seed, if there is one, as arrays."""
        paths = [self.seeds[place]] if place in self.seeds else []
        return Kept.of(np.zeros(len(paths), dtype=int), paths).packed("seed")

    @property
    def tasks(self) -> int:
        """How many there are."""
        return -(-self.grid.size // self.length)

    def members(self, task: int) -> NDInt:
        """Return the members of a task, in their order."""
        return self.grid.order[task * self.length : (task + 1) * self.length]

    # -- seeds -------------------------------------------------------------------------------------

    def seed(self, task: int) -> Path | None:
        """Return the path of the first member of a task or, where it fails, the nearest one."""
        place = task * self.length
        if place in self.seeds:
            return self.seeds[place]
        nearest = self._nearest(place)
        found = None if nearest is None else self._step(place, nearest)
        if found is None:
            found = self._alone(place)
        if found is not None:
            self.seeds[place] = found
        return found if found is not None or nearest is None else self.seeds[nearest]

    def _nearest(self, place: int) -> int | None:
        """Return the place of the nearest seed: of those before, and the pilot, no others."""
        places = [p for p in self.seeds if p < place or p == self.pilot]
        if not places:
            return None
        at = np.unravel_index(self.grid.order[[place, *places]], self.grid.shape)
        rows = np.array(at).T / np.array(self.grid.shape)
        return places[int(np.argmin(((rows[1:] - rows[0]) ** 2).sum(axis=1)))]

    def _step(self, place: int, nearest: int) -> Path | None:
        """Return the path of a member from that of another: by steps as long as the grid's own.

        Where these are too many, by so many that twice as many lead to the same.
        """
        grid, members = self.grid, self.grid.order[[nearest, place]]
        distance = int(np.max(np.abs(np.diff(np.unravel_index(members, grid.shape)))))
        path, before = None, None
        for count in MANY_STEPS if distance > MANY_STEPS[-1] else (distance,):
            rows = {
                name: np.linspace(a, b, count + 1)[1:]
                for name, (a, b) in grid.columns(members).items()
            }
            try:
                first = moved(grid.problem, {name: row[0] for name, row in rows.items()})
                guess = led(self.seeds[nearest], first)
                found = solve_run(grid.problem, rows, self.runs.tol, guess=guess)
            except ValueError:
                return path
            if not found.success.all():
                continue
            path, momenta = found.path(count - 1), found.momenta[-1]
            size = np.max(np.abs(momenta))
            if before is not None and np.max(np.abs(momenta - before)) <= SAME_PATH * size:
                break
            before = momenta
        return path

    def _alone(self, place: int) -> Path | None:
        """Return the path of a member found from nothing."""
        with suppress(ValueError):
            problem = self.grid.member(int(self.grid.order[place]))
            found = solve(problem, tol=self.runs.tol, throw=False)
            return found.path if found.success else None
        return None

    # -- tasks -------------------------------------------------------------------------------------

    def go(self, finished: dict[int, Answers]) -> None:
        """Have all other tasks done, and enter what came of them."""
        for answers in finished.values():
            self._enter(answers)
        waiting = deque(task for task in range(self.tasks) if task not in finished)
        if self.executor is None:
            for task in waiting:
                self._done(task, work(*self._given(task)))
            return
        flying: dict[int, Future] = {}
        arrived: SimpleQueue[int] = SimpleQueue()
        try:
            while waiting or flying:
                if waiting and len(flying) < IN_FLIGHT:
                    task = waiting.popleft()
                    flying[task] = self.executor.submit(work, *self._given(task))
                    flying[task].add_done_callback(lambda _, task=task: arrived.put(task))
                    if arrived.empty():
                        continue
                task = arrived.get()
                self._done(task, flying[task].result())
                del flying[task]
        except BaseException as error:
            for future in flying.values():
                future.cancel()
            if isinstance(error, KeyboardInterrupt):
                for task, future in flying.items():
                    if future.done() and not future.cancelled() and future.exception() is None:
                        self._done(task, future.result())
            raise

    def _given(self, task: int) -> tuple:
        """Return the arguments of `work`."""
        members, runs = self.members(task), self.runs
        options = runs.tol, runs.index is not None, runs.kept is not None
        return self.question, members, self.grid.columns(members), self.seed(task), options

    def _done(self, task: int, answers: Answers) -> None:
        """Keep what came of a task, and enter it."""
        if self.journal is not None:
            seed = self._packed(task * self.length)
            self.journal.append({"task": np.array(task), **answers, **seed})
        self._enter(answers)

    def _enter(self, answers: Answers) -> None:
        """Enter what came of a task, and tell."""
        self.runs.put(answers)
        self.done += answers["members"].size
        self.failed += int(np.isnan(answers["action"]).sum())
        if self.progress is not None:
            self.progress(self.done, self.grid.size, self.failed)
