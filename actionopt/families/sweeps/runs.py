"""The answers of a sweep: arrays over its grid."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Mapping
from copy import copy
from dataclasses import field, replace
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from actionopt.analysis.solution import Solution
from actionopt.analysis.status import Status
from actionopt.discrete.meshes.path import Path
from actionopt.families.sweeps.dispatch import Intake, check_executor, dispatch
from actionopt.families.sweeps.grid import Grid, label_of
from actionopt.families.sweeps.path_store import PackedPaths, find
from actionopt.families.sweeps.question import question_of
from actionopt.families.sweeps.remake import SAME_MOMENTA, remake
from actionopt.families.sweeps.retry import SolvedNeighbours, check_sent, retry_of, work
from actionopt.families.sweeps.sheets import leaps, sheets
from actionopt.families.sweeps.task import REFUSED, Answers, has_more_than_path
from actionopt.mechanics.question.problem import Problem
from actionopt.solver.solve import Guess, solve
from actionopt.tools.checks import by_name, flat_index
from actionopt.tools.files import ready, whole
from actionopt.tools.immutable import immutable
from actionopt.tools.journal import Journal
from actionopt.tools.types import Array, NDInt
from actionopt.tools.watch import Progress, check_progress, positive_seconds, time_limit

if TYPE_CHECKING:
    from concurrent.futures import Executor

RETRY_MEMBERS = 16  # members of a task of `retry`, of a tenth to half a second each; ad hoc
UNREACHED_NAME = "UNREACHED"  # beside the names of `Status`, and REFUSED
OVER_GRID = ("action", "error", "status", "momenta", "ends", "slopes", "index")
LONG_NAMES = {
    "action": "action along the stationary path",
    "error": "estimated error of the path, in units of the coordinates' largest values",
    "status": "verdict",
    "momenta": "canonical momenta at the events",
    "ends": "coordinates at the events",
    "slopes": "derivatives of the action by what varies",
    "index": "Morse index",
    "branch": "label of the members that hang together",
}
# Names in files and datasets, that a parameter of the same name leaves to them.
TAKEN = *LONG_NAMES, "event", "coordinate", "quantity", "member", "file", "allow_pickle"


@immutable
class Runs:
    """The members of a grid: arrays of its shape, some with further axes behind.

    Attributes
    ----------
    grid : Grid
        What varies, and over which values: `grid.names`, `grid.values`.
    tol : float
        As it was asked for.
    action : array
        S; NaN where a member failed.
    error : array
        Estimated errors, as `Solution.error`; of a member that failed that of the best attempt,
        infinite if there was none.
    status : array of str
        The name of a `Status`; "REFUSED" where the problem makes no sense (`messages` say why),
        "ERROR" where the solver ended unexpectedly (`messages` say how), "UNREACHED" where the
        sweep was interrupted before.
    momenta, ends : (..., 2, n) arrays
        Momenta and coordinates at the two events; NaN where a member failed. Where L contains
        accelerations, momenta (..., 2, 2 n) as `Solution.momentum` has them, and so on.
    slopes : (..., k) array
        Derivatives of S by each of the k quantities that vary (Hamilton and Jacobi: momenta, minus
        the energy, ...); NaN where a member failed, or S is no function of them alone: with forces
        that are not conservative, contact, or durations that are found.
    index : array of int or None
        Morse indices, if they were asked for; -1 where there is none.
    messages : dict of int to str
        Why members were refused, or how the solver ended unexpectedly, by their numbers in the
        order of the grid.
    kept : list of PackedPaths or None
        The paths, if they were to be kept.
    stats : dict of str to int
        Iterations, members that were solved alone, and tasks.
    unsought : array of bool
        Members that failed and were not searched for as `solve` would, because searches before
        them found nothing: `retry` does.
    retried : str
        Whether `retry` tried again what had failed: "no", "partly" if it was interrupted or the
        sweep before it was, "fully".
    """

    grid: Grid
    tol: float
    action: Array
    error: Array
    status: Array
    momenta: Array
    ends: Array
    slopes: Array
    index: NDInt | None
    messages: dict[int, str]
    kept: list[PackedPaths] | None = field(repr=False)
    stats: dict[str, int]
    unsought: NDInt
    retried: Literal["no", "partly", "fully"] = "no"

    @classmethod
    def begin(cls, grid: Grid, tol: float, index: bool, keep_paths: bool) -> Runs:
        """Return the arrays before any member is tried."""
        shape, n = grid.shape, grid.problem.system.n
        width = grid.problem.system.order * n
        longest = max(map(len, (*Status.__members__, UNREACHED_NAME)))
        return cls(
            grid=grid,
            tol=tol,
            action=np.full(shape, np.nan),
            error=np.full(shape, np.inf),
            status=np.full(shape, UNREACHED_NAME, dtype=f"<U{longest}"),
            momenta=np.full((*shape, 2, width), np.nan),
            ends=np.full((*shape, 2, n), np.nan),
            slopes=np.full((*shape, len(grid.names)), np.nan),
            index=np.full(shape, -1) if index else None,
            messages={},
            kept=[] if keep_paths else None,
            stats={"iterations": 0, "alone": 0, "tasks": 0},
            unsought=np.zeros(shape, dtype=bool),
        )

    @classmethod
    def read(cls, file: str | FilePath, grid: Grid, tol: float, index: bool) -> Runs:
        """Return the members of a grid from an .npz file that `save` wrote; paths are not in it.

        Raises
        ------
        ValueError
            If the file holds other values or no sweep, or paths do not follow from its arrays:
            where a time is free, an event is at infinity or on a surface, or there are some
            between the ends.
        OSError
            If it cannot be read.
        """
        problem, runs = grid.problem, cls.begin(grid, tol, index, False)
        if has_more_than_path(problem):
            raise ValueError(
                "expected given times and coordinates at two events, found more to be found: "
                "only the paths say it; keep them by resume="
            )
        if not FilePath(file).exists():
            raise FileNotFoundError(
                f"expected a file of a sweep, found none at {str(file)!r}; `runs.save`, or "
                "`actionopt sweep --out FILE.npz`, writes one"
            )
        with np.load(file, allow_pickle=False) as data:
            axes = dict(zip(runs._names, grid.values, strict=True))
            arrays = {name: getattr(runs, name) for name in OVER_GRID}
            wanted = axes | {name: x for name, x in arrays.items() if x is not None}
            for name, x in wanted.items():
                if name not in data or data[name].shape != x.shape:
                    raise ValueError(
                        f"expected a file of this sweep, with {name!r} of shape {x.shape}, found "
                        f"{str(file)!r} without"
                    )
                if name in axes and (data[name] != x).any():
                    raise ValueError(f"expected the values of {name!r} asked for, found others")
                if name not in axes:
                    x[...] = data[name]
        return runs

    def put(self, answers: Answers) -> None:
        """Enter what came of a task."""
        for i in answers["members"].tolist():
            self.messages.pop(i, None)
        for name in (*OVER_GRID, "unsought"):
            whole = getattr(self, name)
            if whole is not None:
                rows = whole.reshape(self.grid.size, *whole.shape[len(self.shape) :])
                rows[answers["members"]] = answers[name]
        self.messages.update(
            zip(answers["refused"].tolist(), answers["messages"].tolist(), strict=True)
        )
        if self.kept is not None:
            self.kept.append(PackedPaths.unpack(answers, "kept"))
        for name in ("iterations", "alone"):
            self.stats[name] += int(answers[name])
        self.stats["tasks"] += 1

    def __repr__(self) -> str:
        """Show what varies and how many were solved, not the arrays."""
        over = ", ".join(map(label_of, self.grid.names))
        sheets = int(self.branch.max(initial=-1)) + 1
        solved = f"{int(self.success.sum())} of {self.grid.size} solved"
        failed = f"; {self.failures}" if self.failures else ""
        failed += ": runs.retry()" if failed and self.retried != "fully" else ""
        if refused := int((self.status == REFUSED).sum()):
            failed += f"; {refused} refused: runs.messages"
        ended = "; interrupted" if self.interrupted else ""
        if remainder := self.remainder:
            ended += (
                f", {remainder} not reached: sweep with resume=FILE; the same call then goes on"
            )
        return f"Runs({self.problem.name} over {over}: {solved}, branches {sheets}{failed}{ended})"

    @property
    def failures(self) -> str:
        """How many members were tried in vain, "" for none."""
        missed = self.failed & (self.status != REFUSED)
        unsought = int((missed & self.unsought).sum())
        part = f", {unsought} of them not searched for at length" if unsought else ""
        return f"{int(missed.sum())} not found{part}" if missed.any() else ""

    @property
    def remainder(self) -> int:
        """How many members an interrupted sweep did not come to."""
        return int((self.status == UNREACHED_NAME).sum())

    @property
    def problem(self) -> Problem:
        """The problem of which all members are variants."""
        return self.grid.problem

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the grid."""
        return self.grid.shape

    @property
    def _names(self) -> list[str]:
        """Names of what varies, in files and datasets."""
        names = map(label_of, self.grid.names)
        return [f"parameter {name}" if name in TAKEN else name for name in names]

    @property
    def success(self) -> NDInt:
        """Which members can be used as they are: an array of bool."""
        return np.isin(self.status, [status.name for status in Status if status.success])

    @property
    def failed(self) -> NDInt:
        """Which members were tried in vain: an array of bool."""
        return ~self.success & (self.status != UNREACHED_NAME)

    @property
    def interrupted(self) -> bool:
        """Whether the user, or the time given, ended it before all members were tried."""
        return self.retried == "partly" or self.remainder > 0

    @property
    def branch(self) -> NDInt:
        """Labels from 0 of what hangs together, -1 where a member failed: an array of int.

        Neighbours are told apart where the index changes between them, or the action otherwise than
        `slopes` say, or the momenta at the ends (and coordinates that are free there) several times
        as much as around: eight times where `slopes` agree, four times where they tell nothing.
        """
        told = []
        for k, event in enumerate((self.problem.start, self.problem.end)):
            if event.t is None or np.isfinite(event.t):  # else they are those of a window's edge
                told.append(np.nan_to_num(self.momenta[..., k, :]))
            free = [i for i, x in enumerate(event.q) if x is None]
            told.append(self.ends[..., k, free])
        S, breaks = np.where(self.success, self.action, np.nan), []
        for axis, row in enumerate(self.grid.values if not self.grid.zipped else ()):
            breaks.append(leaps(S, self.slopes[..., axis], row, axis))
        return sheets(self.success, self.index, np.concatenate(told, axis=-1), breaks)

    def solution(self, *at: int) -> Solution:
        """Return the member at a place in the grid as a full solution.

        It is made again: near its path if that was kept, else near the motions that set out from
        both ends with their momenta.

        Raises
        ------
        IndexError
            If there is no such place.
        ValueError
            If the member failed, or the path is lost on the way (then sweep with
            `keep_paths=True`).
        """
        return self._solution(flat_index(at, self.shape))

    def _solution(self, i: int) -> Solution:
        """Solve member i again. Raises ValueError as `solution` does."""
        if not self.success.flat[i]:
            why = self.messages.get(i)
            raise ValueError(
                f"expected a member that was solved, found {self.grid.text(i)} of the status "
                f"{self.status.flat[i]}{'; `retry` tries it again' if why is None else f': {why}'}"
            )
        problem = self.grid.member(i)
        found = solve(problem, guess=self._near(problem, i), tol=self.tol, throw=False)
        S, known = self.action.flat[i], self.momenta.reshape(-1, *self.momenta.shape[-2:])[i]
        off = np.nanmax(np.abs(np.stack(found.momenta) - known)) / (np.nanmax(np.abs(known)) or 1.0)
        off = 0.0 if problem.is_infinite else off  # they are those of the window's edges
        unit = max(abs(S), float(np.ptp(self.action[self.success]))) or 1.0
        if not (found.success and max(off, abs(found.action - S) / unit) <= SAME_MOMENTA):
            raise ValueError(
                f"expected the path of {self.grid.text(i)}, whose action is {S:.9g}, found one of "
                f"{found.action:.9g} ({found.status.name}): motions are too sensitive to what they "
                "set out with; sweep with keep_paths=True"
            )
        return found

    def _near(self, problem: Problem, i: int) -> Path | Callable[[Array], Array] | None:
        """Return a curve near the path of a member that was solved."""
        if self.kept is not None:
            return find(self.kept, i)
        n = problem.system.n
        return remake(problem, *(x.reshape(-1, 2, n)[i] for x in (self.ends, self.momenta)))

    def retry(
        self,
        guess: Guess | None = None,
        *,
        executor: Executor | None = None,
        seconds: float | None = None,
        progress: Progress | None = None,
        resume: str | FilePath | None = None,
    ) -> Runs:
        """Return the runs with the members that failed tried again, each as long as `solve` takes.

        Near neighbours that are solved, then from nothing as `solve` does; or near `guess`, then
        from nothing. Members that an interrupted sweep did not come to are not tried: the same
        `sweep` with `resume` does that.

        Parameters
        ----------
        guess : Path, Solution, callable or array, optional
            As for `solve`, for each member. With an executor or a file one that can be pickled.
        executor : concurrent.futures.Executor, optional
            As for `sweep`: the numbers are the same, to the last bit.
        seconds : float, optional
            The time it may take; then it ends as if it were interrupted.
        progress : callable, optional
            As for `sweep`, of the members that are tried again, the stage "retry". An interruption
            (KeyboardInterrupt) ends it as it ends a sweep, and keeps what is found.
        resume : str or path, optional
            A file, not that of the sweep, that keeps what is finished, as for `sweep`.

        Raises
        ------
        ValueError
            For bad arguments, or if the file belongs to another question.
        """
        check_executor(executor)
        check_progress(progress)
        if seconds is not None:
            positive_seconds(seconds)
        guess = guess.path if isinstance(guess, Solution) else guess
        if executor is not None or resume is not None:
            check_sent(guess)
        journal, again, grid = None, self._copy(), self.grid
        if resume is not None:
            about = question_of(grid, self.tol, self.index is not None, self.kept is not None)
            known = self.status.tobytes() + self.momenta.tobytes()
            journal = Journal(resume, retry_of(about, known, guess))
        retried: Literal["partly", "fully"] = "partly" if self.remainder else "fully"
        failed = grid.order[self.failed.ravel()[grid.order]]
        tasks = [failed[k : k + RETRY_MEMBERS] for k in range(0, failed.size, RETRY_MEMBERS)]
        intake = Intake("retry", again, failed.size, journal, progress)
        position = np.argsort(grid.order)
        question = pickle.dumps(self.problem)
        try:
            for record in [] if journal is None else journal.records:
                intake(int(record["task"]), record, kept=True)
            left = (k for k in range(len(tasks)) if k not in intake.entered)
            given = ((k, (question, *self._retry_task(tasks[k], position, guess))) for k in left)
            with time_limit(seconds):
                dispatch(work, given, executor, intake, intake.report)
        except KeyboardInterrupt:
            retried = "partly"
        except Exception as error:
            intake.note(error)
            raise
        return replace(again, retried=retried)

    def _retry_task(self, members: NDInt, position: NDInt, guess: Guess | None) -> tuple:
        """Return what `work` is given to try members again, with those that are solved beside.

        `position` is that of each member in the order of the grid.
        """
        success, near = self.success.ravel(), set[int]()
        if guess is None:
            near.update(*(self.grid.beside(i) for i in members.tolist()))
        beside = np.array([j for j in near if success[j]], dtype=int)
        members = np.concatenate([members, beside])
        members = members[np.argsort(position[members])]
        ends, momenta = (x.reshape(-1, *x.shape[-2:])[members] for x in (self.ends, self.momenta))
        paths = None
        if self.kept is not None:
            kept = {j: path for j in beside.tolist() if (path := find(self.kept, j)) is not None}
            paths = PackedPaths.of(np.array(list(kept), dtype=int), list(kept.values()))
        options = self.tol, self.index is not None, self.kept is not None
        known = SolvedNeighbours(success[members], ends, momenta, paths)
        return members, self.grid.columns(members), known, guess, options

    def _copy(self) -> Runs:
        """Return a copy with arrays of its own."""
        made = {name: copy(value) for name, value in vars(self).items()}
        return Runs(**made)

    def save(self, file: str | FilePath) -> None:
        """Write the arrays to an .npz file or, by xarray, to netCDF (.nc), whole or not at all.

        Values are under the names of what varies: "end.x" for a coordinate of the end. A parameter
        that is called as an array is ("index") is "parameter index" there.
        """
        target = ready(file, ".npz", ".nc")
        with whole(target) as part:
            if target.suffix == ".nc":
                self.to_xarray().to_netcdf(part)
                return
            arrays = {name: getattr(self, name) for name in OVER_GRID}
            if self.index is None:
                del arrays["index"]
            along = dict(zip(self._names, self.grid.values, strict=True))
            np.savez(part, allow_pickle=False, branch=self.branch, **arrays, **along)

    def to_xarray(self, units: Mapping[str, str] | None = None) -> Any:
        """Return the arrays as an xarray.Dataset, whose `to_netcdf` and `to_zarr` write them.

        Dimensions are named after what varies ("end.x" for a coordinate of the end), "member" where
        values were zipped, and behind them "event" and "coordinate", or "quantity".

        Parameters
        ----------
        units : mapping of str to str, optional
            Of variables and of what varies, by name: the package knows none.

        Raises
        ------
        ImportError
            If xarray is not installed: `pip install 'actionopt[xarray]'`.
        ValueError
            For the unit of something that is not there.
        """
        try:
            import xarray  # pyright: ignore[reportMissingImports]
        except ImportError as error:
            raise ImportError(
                "expected xarray to be installed, found none: pip install 'actionopt[xarray]'; "
                "`save` writes an .npz file without it"
            ) from error

        grid, system = self.grid, self.problem.system
        names = self._names
        dims = ["member"] if grid.zipped else names
        at_events = ["event", "coordinate"]
        of_each = at_events if system.order == 1 else ["event", "momentum"]
        behind = {"momenta": of_each, "ends": at_events, "slopes": ["quantity"]}
        found: dict[str, Any] = {
            name: (dims + behind.get(name, []), getattr(self, name))
            for name in OVER_GRID
            if getattr(self, name) is not None
        }
        found["branch"] = dims, self.branch
        rows = zip(names, grid.values, strict=True)
        along = {name: ("member" if grid.zipped else name, row) for name, row in rows}
        coordinates = {
            "event": ["start", "end"], "coordinate": list(system.coordinates), "quantity": names
        }  # fmt: skip
        known = self.problem.parameters.items()
        given = {f"parameter {name}": x.ravel() for name, x in known if name not in grid.names}
        about = {"system": self.problem.name, "law": system.source, "tol": self.tol, **self.stats}
        data = xarray.Dataset(found, {**along, **coordinates}, {**about, **given})
        for name, text in LONG_NAMES.items():
            if name in data:
                data[name].attrs["long_name"] = text
        plain = {name: "1" for name in ("error", "index", "branch") if name in found}
        for name, unit in (plain | dict(by_name(units, "units"))).items():
            if name not in data.variables:
                known = ", ".join(map(str, data.variables))
                raise ValueError(f"expected units of some of {known}, found one of {name!r}")
            data[name].attrs["units"] = unit
        return data
