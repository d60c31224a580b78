"""One task of a sweep: a run of neighbours is solved, somewhere, and arrays come back."""

from __future__ import annotations

import pickle
from collections.abc import Mapping
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from actionopt.analysis.solution import Solution
from actionopt.analysis.status import Status
from actionopt.discrete.meshes.path import Path
from actionopt.families.continuation import continue_path
from actionopt.families.sweeps.batch import solve_run
from actionopt.families.sweeps.budget import Exhausted
from actionopt.families.sweeps.members import refusal
from actionopt.families.sweeps.path_store import PackedPaths
from actionopt.families.vary import Name, lead_to, slope_along, with_values
from actionopt.families.walk import walk
from actionopt.mechanics.question.problem import Problem
from actionopt.solver.solve import Guess, refuse_rest, solve, solve_near
from actionopt.tools.interrupts import leave_interruptions, ordinary_errors
from actionopt.tools.memory import keep_memory
from actionopt.tools.types import Array, NDInt

Answers = dict[str, Array]
# Beside the names of `Status`: the problem makes no sense; the solver ended unexpectedly.
REFUSED, ERROR = "REFUSED", "ERROR"
# What a search near a neighbour's path may cost, in second derivatives on one element; beyond it,
# one from nothing is better. Measured on sweeps of Lagrangians with accelerations: 22 searches that
# found a path where Newton's method did not took 427 to 3,628, eight in vain 16,800 to 35,800.
NEAR_BUDGET = 6_000


# Names of answers that are rows with an item for each member.
PER_MEMBER = (
    "members", "status", "action", "error", "momenta", "ends", "slopes", "index", "unsought"
)  # fmt: skip


class Seed(NamedTuple):
    """A path to begin from, and the values of its member.

    And which of the members of a task is the nearest to it, and how many steps of the grid away.
    """

    path: Path
    values: dict[Name, float]
    first: int
    distance: int


def work(
    question: bytes,
    members: NDInt,
    columns: Mapping[Name, Array],
    seed: Seed | None,
    options: tuple[float, bool, bool],
) -> Answers:
    """Solve members of a grid, neighbours one after the other: what an executor is given.

    Parameters
    ----------
    question : bytes
        The pickled problem, which makes its system once in a process.
    members : (k,) array of int
        Their numbers.
    columns : mapping of name to (k,) array
    seed : Seed or None
        From where the first is reached.
    options : tuple
        `tol`, and whether to count indices and to keep paths.
    """
    keep_memory()
    leave_interruptions()
    problem = pickle.loads(question)
    if seed is None:
        return solve_members(problem, members, columns, None, options)
    path, values, first, distance = seed
    nearest = {name: float(row[first]) for name, row in columns.items()}
    path = walk(problem, path, values, nearest, distance, options[0]) or path
    return solve_members(problem, members, columns, path, options, first)


def solve_members(
    problem: Problem,
    members: NDInt,
    columns: Mapping[Name, Array],
    guess: Guess | None,
    options: tuple[float, bool, bool],
    first: int = 0,
    given: Mapping[int, Solution] | None = None,
    limited: bool = True,
) -> Answers:
    """Return what comes of members of a problem that is here, the `first` of them near `guess`.

    Or near those that are `given`. Searches that find nothing have a budget if `limited`.
    """
    (tol, index, keep_paths), k = options, len(members)
    if has_more_than_path(problem):
        return one_by_one(problem, members, columns, guess, options, first)
    t0, t1 = columns.get("t0", problem.start.t), columns.get("t1", problem.end.t)
    late = np.broadcast_to(np.less(t0, t1), k)
    answers = _no_answers(members, problem, len(columns), alone=0)
    if index:
        answers["index"] = np.full(k, -1)
    messages, paths = {i: _refusal(problem, columns, i) for i in np.flatnonzero(~late).tolist()}, {}
    if late.any():
        tried = np.flatnonzero(late)
        rows = {name: row[tried] for name, row in columns.items()}
        first = int(np.argmin(np.abs(tried - first)))
        known = {int(np.searchsorted(tried, j)): near for j, near in (given or {}).items()}
        found = solve_run(
            problem, rows, tol, index=index, guess=guess, first=first, given=known, limited=limited
        )
        said = found.messages | found.errors
        messages |= {int(tried[j]): message for j, message in said.items()}
        answers["status"][tried] = [
            REFUSED if j in found.messages else ERROR if j in found.errors else status.name
            for j, status in enumerate(found.status)
        ]
        answers["error"][tried], answers["unsought"][tried] = found.error, found.unsought
        good = found.success
        for name in ("action", "momenta", "slopes", *(("index",) if index else ())):
            answers[name][tried[good]] = getattr(found, name)[good]
        for j in np.flatnonzero(good).tolist():
            answers["ends"][tried[j]] = found.values[j][:, [0, -1]].T
            if keep_paths:
                paths[int(tried[j])] = found.path(j)
        answers["iterations"], answers["alone"] = found.iterations.sum(), found.alone.sum()
    answers["refused"] = members[list(messages)]
    answers["messages"] = np.array(list(messages.values()), dtype=str)
    if keep_paths:
        answers |= PackedPaths.of(members[list(paths)], list(paths.values())).pack("kept")
    return answers


def has_more_than_path(problem: Problem) -> bool:
    """Whether more than a path is found of each member: a duration, a window, places, multipliers.

    Or legs, or L contains accelerations, or is infinite at an end. Then paths tell what was found,
    and members are solved one by one.
    """
    found = problem.has_open_ends or problem.is_infinite
    found = found or problem.system.order > 1 or any(problem.singular_ends)
    return bool(found or problem.through) or problem.integral is not None


def _no_answers(members: NDInt, problem: Problem, columns: int, alone: int) -> Answers:
    """Return the answers of members of which none is solved yet."""
    k, n, width = len(members), problem.system.n, max(map(len, [REFUSED, *Status.__members__]))
    return {
        "members": members,
        "status": np.full(k, REFUSED, dtype=f"<U{width}"),
        "action": np.full(k, np.nan),
        "error": np.full(k, np.inf),
        "momenta": np.full((k, 2, problem.system.order * n), np.nan),
        "ends": np.full((k, 2, n), np.nan),
        "slopes": np.full((k, columns), np.nan),
        "unsought": np.zeros(k, dtype=bool),
        "iterations": np.array(0),
        "alone": np.array(alone),
    }


def one_by_one(
    problem: Problem,
    members: NDInt,
    columns: Mapping[Name, Array],
    guess: Guess | None,
    options: tuple[float, bool, bool],
    first: int = 0,
    given: Mapping[int, Path] | None = None,
    lead: bool = True,
) -> Answers:
    """Return the answers of members with more than a path to be found, each near the last one.

    Those that are `given` are not solved again. All are sought near `guess` unless they `lead`.
    """
    tol, index, _ = options
    k = len(members)
    answers = _no_answers(members, problem, len(columns), alone=k)
    if index:
        answers["index"] = np.full(k, -1)
    messages, paths, begun = {}, {}, guess
    rows = [{name: float(row[j]) for name, row in columns.items()} for j in range(k)]
    last, at_first = None, None  # the member that was solved last, and its path
    for j in (*range(first, k), *range(first - 1, -1, -1)):
        if j == first - 1:  # the other way
            guess, last = paths.get(int(members[first]), begun), at_first
        if given and j in given:
            guess, last = given[j], None
            continue
        try:
            mine = with_values(problem, rows[j])
            if last is None:
                found = refuse_rest(solve(mine, guess=guess, tol=tol, throw=False))
            else:
                found = refuse_rest(_from_neighbour(mine, guess, tol))
            if last is not None and not mine.system.r:
                ends, near = (rows[last[0]], rows[j]), last[1]
                found = continue_path(near, ends, found, lead_to(near.path, mine), tol).found
            if not found.success and guess is not None:
                found = refuse_rest(solve(mine, tol=tol, throw=False))
            slopes, number = slope_along(found, columns), -1
            if index and found.success:
                with suppress(ValueError):  # there is none
                    number = found.morse_index
        except ordinary_errors() as error:
            text, refused = refusal(error)
            messages[int(members[j])] = text
            answers["status"][j] = REFUSED if refused else ERROR
            continue
        answers["status"][j] = found.status.name
        answers["iterations"] += sum(found.stats["iterations"].values())
        if not found.success:
            continue
        paths[int(members[j])] = found.path
        if lead:
            guess, last = found.path, (j, found)
            at_first = last if j == first else at_first
        answers["action"][j], answers["error"][j] = found.action, found.error
        answers["momenta"][j] = np.stack(found.momenta)
        answers["slopes"][j] = slopes
        answers["ends"][j] = found.path.values[:, [0, -1]].T
        if index:
            answers["index"][j] = number
    answers["refused"] = np.array(list(messages), dtype=int)
    answers["messages"] = np.array(list(messages.values()), dtype=str)
    return answers | PackedPaths.of(np.array(list(paths), dtype=int), list(paths.values())).pack(
        "kept"
    )


def _from_neighbour(problem: Problem, guess: Guess | None, tol: float) -> Solution:
    """Return what `solve` finds near a neighbour's path, as far as it finds that soon."""
    spent = 0.0

    def count(stage: str, done: int, total: int | None, detail: Mapping[str, float]) -> None:
        nonlocal spent
        spent += detail["elements"]
        if spent > NEAR_BUDGET:
            raise Exhausted

    try:
        return solve(problem, guess=guess, tol=tol, throw=False, progress=count)
    except Exhausted:
        return solve_near(problem, guess, tol)


def _refusal(problem: Problem, columns: Mapping[Name, Array], i: int) -> str:
    """Return the message for a member whose values make no valid problem."""
    try:
        with_values(problem, {name: float(row[i]) for name, row in columns.items()})
    except ValueError as error:
        return str(error)
    raise AssertionError("a path that ends before it starts is not a problem")
