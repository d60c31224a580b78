"""Solve a problem over a grid of values, in this process or on many machines.

The grid is cut into tasks, runs of neighbours. Some members far apart are solved here, as seeds,
while tasks before them are on their way; each begins with a walk from the nearest seed to the
member nearest to it, and needs nothing of other tasks. So neither the cut nor any number depends
on who solves what, or when.
"""

from __future__ import annotations

import pickle
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path as FilePath
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from actionopt.analysis.solution import SolveError
from actionopt.discrete.matrices.elimination import couplings
from actionopt.discrete.meshes.path import Path
from actionopt.families.sweeps.dispatch import Intake, check_executor, dispatch
from actionopt.families.sweeps.grid import Grid
from actionopt.families.sweeps.path_store import PackedPaths
from actionopt.families.sweeps.question import question_of
from actionopt.families.sweeps.runs import Runs
from actionopt.families.sweeps.task import Answers, Seed, has_more_than_path, work
from actionopt.families.vary import Name, present
from actionopt.families.walk import WALK_STEPS, walk
from actionopt.mechanics.question.problem import Problem
from actionopt.solver.input.arguments import check_problem
from actionopt.solver.solve import refuse_rest, solve
from actionopt.tools.checks import among, flag, tolerance
from actionopt.tools.interrupts import ordinary_errors
from actionopt.tools.journal import Journal
from actionopt.tools.types import NDInt
from actionopt.tools.watch import Progress, check_progress, time_limit

if TYPE_CHECKING:
    from concurrent.futures import Executor

# of a task, about: what is lost with a worker, and much beside what sending it takes
TASK_SECONDS = 1.0
# Members from where on the walk to the first of a task, which takes as long as three to four of
# them, is a small part; and the longest that a task becomes for it.
WORTH_A_WALK, LONG_TASK_SECONDS = 24, 4.0
# What a member takes, and each of its unknowns times coordinates with which one is coupled.
# Measured, with 117 to 542 unknowns, to a factor of two.
MEMBER_SECONDS, UNKNOWN_SECONDS = 1e-4, 8e-7
# The same for one with constraints or forces, solved near another one. Measured, with 30 to 7,340
# unknowns of 1 to 40 coordinates, to a factor of two.
ALONE_SECONDS, ALONE_UNKNOWN_SECONDS = 1e-3, 1e-5
# What one takes with more to be found than a path, and one along an obstacle, which is sought anew.
# Measured on seven and on five questions, to a factor of two.
MORE_SECONDS, CONTACT_SECONDS = 6e-3, 5e-2
MOST_MEMBERS = 4096  # of a task, so that its answers are a megabyte at most; ad hoc
PILOTS = 8  # members at equal distances of which the first that is solved tells their size; ad hoc
SEEDS = 8  # paths from which tasks are reached: they are found here, one by one; ad hoc
RECORDED = ("index",)


def sweep(
    problem: Problem,
    over: Mapping[Name, ArrayLike],
    *,
    executor: Executor | None = None,
    tol: float = 1e-8,
    record: str | Sequence[str] | None = None,
    keep_paths: bool = False,
    zip: bool = False,
    seconds: float | None = None,
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
        "t1", the time of an event; ("start", name) or ("end", name), a coordinate there; "energy",
        where a time is free; ("through", k, name), ("through", k, "t") and ("integral", i), of
        event k between the ends and of integral i.
    executor : concurrent.futures.Executor, optional
        Who solves: processes, threads, or machines (Dask's `client.get_executor()`, mpi4py's
        `MPIPoolExecutor`). The numbers are the same, to the last bit, as in this process alone.
    tol : float
        As for `solve`, for each member.
    record : str or sequence of str, optional
        What is to be found of each besides: "index".
    keep_paths : bool
        Keep the paths, too: some kilobytes each. They are kept in any case where momenta at the
        ends do not tell them: along an obstacle, and where more than a path is found.
    zip : bool
        All rows have one length, and member k has the k-th value of each: one axis.
    seconds : float, optional
        The time it may take; then it ends as if it were interrupted, and leaves tasks that have
        begun.
    progress : callable, optional
        `progress(stage, done, total, detail)` after each task: "sweep", the members that are done,
        all members, and {"failed": how many of those done failed}; and each ten seconds. An
        interruption (KeyboardInterrupt) ends the sweep and keeps what is done: at once in this
        process, but for the task at hand; tasks that an executor has begun are waited for, which a
        line on the standard error says, unless it is interrupted again.
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
    check_problem(problem)
    tolerance(tol)
    problem = problem.original
    if problem.free_time and problem.closes and problem.system.n > 1:
        raise ValueError(
            "expected events, or a period that is given, to sweep over, found closed paths of a "
            "given energy, which need a guess; follow one by `trace`"
        )
    keep_paths = flag(keep_paths, "keep_paths") or has_more_than_path(problem)
    keep_paths = keep_paths or bool(problem.system.r)  # momenta do not tell a path in contact
    grid = Grid.of(problem, over, flag(zip, "zip"))
    index = "index" in _names_to_record(record)
    check_executor(executor)
    check_progress(progress)
    about = question_of(grid, tol, index, keep_paths)
    journal = None if resume is None else Journal(resume, about)
    runs = Runs.begin(grid, tol, index, keep_paths)
    run = _SweepRun(grid, runs, executor, Intake("sweep", runs, grid.size, journal, progress))
    try:
        with time_limit(seconds):
            run.go(run.begin())
    except KeyboardInterrupt:
        return runs
    except Exception as error:
        run.intake.note(error)
        raise
    if not runs.success.any():
        _none_solved(runs)
    return runs


def _names_to_record(record: str | Sequence[str] | None) -> tuple[str, ...]:
    """Return the names of what is to be recorded. Raises ValueError for an unknown one."""
    names = (record,) if isinstance(record, str) else () if record is None else record
    for name in names if isinstance(names, Sequence) else (names,):
        if not among(name, RECORDED):
            raise ValueError(
                f"expected something to record out of {', '.join(RECORDED)}, found {name!r}; the "
                "action, errors, momenta, coordinates at the ends and slopes always are"
            )
    return tuple(names)


def _alone_seconds(problem: Problem) -> float:
    """Return about how long a member takes that is solved alone; zero where they are not."""
    system = problem.system
    if system.r:
        return CONTACT_SECONDS
    if has_more_than_path(problem):
        return MORE_SECONDS
    return ALONE_SECONDS if system.m or system.structure.forced else 0.0


def _none_solved(runs: Runs) -> None:
    """Raise what the first member raises, and say that the others are no better."""
    first = refuse_rest(solve(runs.grid.member(0), tol=runs.tol, throw=False))
    names, counts = np.unique(runs.status, return_counts=True)
    resting = (
        "; for a closed path that moves give `trace` a guess" if runs.grid.problem.closes else ""
    )
    found = ", ".join(f"{count} {name}" for name, count in zip(names, counts, strict=True))
    raise SolveError(
        f"expected members that can be solved, found {found} of {runs.grid.size}; the first, "
        f"{runs.grid.text(0)}: {first.status.value}{resting}",
        first,
    )


@dataclass(eq=False)
class _SweepRun:
    """A sweep under way."""

    grid: Grid
    runs: Runs
    executor: Executor | None
    intake: Intake
    length: int = 0  # of a task, in members
    question: bytes = b""
    seeds: dict[int, Path] = field(default_factory=dict)  # paths by the number of the member
    walked: dict[int, Path | None] = field(default_factory=dict)  # what came of each search
    sown: int = 0  # how many were sought after the first

    @property
    def tasks(self) -> int:
        """How many there are."""
        return -(-self.grid.size // self.length)

    def members(self, task: int) -> NDInt:
        """Return the members of a task, in their order."""
        return self.grid.order[task * self.length : (task + 1) * self.length]

    # -- seeds -------------------------------------------------------------------------------------

    def begin(self) -> dict[int, Answers]:
        """Find a first seed and cut the grid, or read that; return the tasks that are finished."""
        records = [] if self.intake.journal is None else self.intake.journal.records
        if records:
            self.length = int(records[0]["length"])
            for record in records:
                if "seed" in record:
                    i = int(record["seed"])
                    self.walked[i] = PackedPaths.unpack(record, "seed").path(i)
            first = int(records[0]["seed"])
            self.seeds = {first: path} if (path := self.walked[first]) else {}
        else:
            problem, unknowns = self.grid.problem, self._pilot()
            early, last = couplings(problem.system)
            beside = np.mean(np.subtract(last, early)) + 1
            seconds = MEMBER_SECONDS + UNKNOWN_SECONDS * unknowns * float(beside)
            if alone := _alone_seconds(problem):
                seconds = alone + ALONE_UNKNOWN_SECONDS * unknowns
            longer = max(min(WORTH_A_WALK * seconds, LONG_TASK_SECONDS), TASK_SECONDS)
            self.length = int(np.clip(longer / seconds, 1, MOST_MEMBERS))
            first, path = next(iter(self.seeds.items()), (-1, None))
            self._keep(first, path, length=self.length)
        self.question = pickle.dumps(self.grid.problem)
        return {int(record["task"]): record for record in records if "task" in record}

    def _keep(self, i: int, path: Path | None, **more: int) -> None:
        """Keep what came of the search for a seed."""
        self.walked[i] = path
        if self.intake.journal is not None:
            kept = PackedPaths.of(np.array([i] if path else [], dtype=int), [path] if path else [])
            self.intake.journal.append({"seed": i, **more, **kept.pack("seed")})

    def _pilot(self) -> int:
        """Find a first seed, a member that can be solved; return how many unknowns it has.

        The first member in order is tried; then the problem as it was given, from whose own values
        a walk leads to the member nearest to them; then others, evenly chosen.
        """
        grid, tol, unknowns = self.grid, self.runs.tol, 0
        places = np.linspace(0, grid.size - 1, PILOTS).astype(int)
        first, *others = dict.fromkeys(grid.order[places].tolist())
        for i in (first, None, *others):
            try:
                problem = grid.problem if i is None else grid.member(i)
                found = refuse_rest(solve(problem, tol=tol, throw=False))
                unknowns = found.stats["unknowns"]
                path: Path | None = found.path if found.success else None
                if i is None and path is not None:
                    own = {name: present(grid.problem, name) for name in grid.names}
                    i = grid.nearest(own)
                    path = walk(grid.problem, path, own, grid.at(i), WALK_STEPS[-1], tol)
                if i is not None and path is not None:
                    self.seeds[i] = path
                    break
            except ordinary_errors():  # another may do
                continue
        return unknowns

    def _sow(self, task: int) -> None:
        """Find the seeds up to a task that are not found yet, each by a walk from the nearest one.

        Tasks are asked for in their order: those before are on their way meanwhile.
        """
        fields = np.linspace(0, self.tasks - 1, min(SEEDS, self.tasks)).astype(int)
        for i in self.grid.order[fields[fields <= task] * self.length].tolist()[self.sown :]:
            self.sown += 1
            seed = self._nearest(np.array([i]))
            if seed is None or not seed.distance:
                continue
            if i not in self.walked:
                given = seed.path, seed.values, self.grid.at(i), seed.distance
                self._keep(i, walk(self.grid.problem, *given, self.runs.tol))
            if path := self.walked[i]:
                self.seeds[i] = path

    def _nearest(self, members: NDInt) -> Seed | None:
        """Return the seed that is nearest to one of some members, in parts of the axes."""
        if not self.seeds:
            return None
        known, shape = list(self.seeds), np.array(self.grid.shape)
        there, here = (np.array(np.unravel_index(i, shape)).T for i in (known, members))
        steps = np.abs(there[:, None] - here)
        apart = ((steps / shape) ** 2).sum(axis=2)
        k, first = np.unravel_index(np.argmin(apart), apart.shape)
        values = self.grid.at(known[k])
        return Seed(self.seeds[known[k]], values, int(first), int(steps[k, first].max()))

    # -- tasks -------------------------------------------------------------------------------------

    def go(self, finished: dict[int, Answers]) -> None:
        """Run all tasks that are not finished, and enter the answers of all."""
        for task, answers in finished.items():
            self.intake(task, answers, kept=True)
        tasks = ((k, self._arguments(k)) for k in range(self.tasks) if k not in finished)
        dispatch(work, tasks, self.executor, self.intake, self.intake.report)

    def _arguments(self, task: int) -> tuple:
        """Return the arguments of `work`."""
        self._sow(task)
        members, runs = self.members(task), self.runs
        options = runs.tol, runs.index is not None, runs.kept is not None
        return (
            self.question,
            members,
            self.grid.columns(members),
            self._nearest(members),
            options,
        )
