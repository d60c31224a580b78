"""Members of a sweep that failed, tried again: tasks of neighbours, on any executor.

What is solved beside them goes along, as momenta and ends or as paths, and leads to them.
"""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from actionopt.analysis.solution import Solution
from actionopt.discrete.meshes.path import Path
from actionopt.families.sweeps.path_store import PackedPaths
from actionopt.families.sweeps.remake import SAME_MOMENTA, remake
from actionopt.families.sweeps.task import PER_MEMBER, Answers, one_by_one, solve_members
from actionopt.families.vary import Name, with_values
from actionopt.mechanics.question.problem import Problem
from actionopt.solver.solve import Guess, solve_near
from actionopt.tools.interrupts import leave_interruptions
from actionopt.tools.memory import keep_memory
from actionopt.tools.types import Array, NDInt

RETRY_FORMAT = "actionopt retry 1"


class SolvedNeighbours(NamedTuple):
    """Which members of a task are solved already, and what is known of them.

    Coordinates and momenta at the ends of all, (k, 2, n), or paths.
    """

    solved: NDInt
    ends: Array
    momenta: Array
    paths: PackedPaths | None


def work(
    question: bytes,
    members: NDInt,
    columns: Mapping[Name, Array],
    beside: SolvedNeighbours,
    guess: Guess | None,
    options: tuple[float, bool, bool],
) -> Answers:
    """Solve members that failed, from those beside them: what an executor is given."""
    keep_memory()
    leave_interruptions()
    problem = pickle.loads(question)
    if guess is not None:
        return one_by_one(problem, members, columns, guess, options, lead=False)
    if problem.has_open_ends or problem.is_infinite:
        assert beside.paths is not None  # they are always kept
        numbers = enumerate(members.tolist())
        paths = {j: path for j, i in numbers if (path := beside.paths.path(i)) is not None}
        answers = one_by_one(problem, members, columns, None, options, given=paths)
    else:
        given = {}
        for j in np.flatnonzero(beside.solved).tolist():
            near = _again(problem, int(members[j]), j, columns, beside, options[0])
            if near is not None:
                given[j] = near
        answers = solve_members(
            problem, members, columns, None, options, given=given, limited=False
        )
    return _without(answers, members[beside.solved])


def _again(
    problem: Problem,
    i: int,
    j: int,
    columns: Mapping[Name, Array],
    beside: SolvedNeighbours,
    tol: float,
) -> Solution | None:
    """Return the path of a member that was solved, the j-th of the task; None if it is lost."""
    problem = with_values(problem, {name: float(row[j]) for name, row in columns.items()})
    if beside.paths is not None:
        guess = beside.paths.path(i)
    else:
        guess = remake(problem, beside.ends[j], beside.momenta[j])
    if guess is None:
        return None
    found, momenta = solve_near(problem, guess, tol), beside.momenta[j]
    off = np.nanmax(np.abs(np.stack(found.momenta) - momenta))
    same = off <= SAME_MOMENTA * (np.nanmax(np.abs(momenta)) or 1.0)
    return found if found.success and same else None


def _without(answers: Answers, known: NDInt) -> Answers:
    """Return the answers without those of members that were known before."""
    mine = ~np.isin(answers["members"], known)
    left = {name: answers[name][mine] for name in PER_MEMBER if name in answers}
    if "kept_members" in answers:
        kept = PackedPaths.unpack(answers, "kept")
        numbers = answers["members"][mine].tolist()
        paths = {i: path for i in numbers if (path := kept.path(i)) is not None}
        left |= PackedPaths.of(np.array(list(paths), dtype=int), list(paths.values())).pack("kept")
    return answers | left


def check_sent(guess: Guess | None) -> None:
    """Raise ValueError for a guess that no other process can be given."""
    try:
        pickle.dumps(guess)
    except Exception as error:
        raise ValueError(
            "expected a guess that can be pickled, for an executor or a file: a Path, a solution, "
            f"an array or a function of a module, found {guess!r}"
        ) from error


def retry_of(question: dict[str, Any], known: bytes, guess: Guess | None) -> dict[str, Any]:
    """Return what tells one retry from another, as plain data.

    From what tells the sweep, what was `known` of its members, and the guess.
    """
    if isinstance(guess, Path):
        guess = np.concatenate([guess.mesh.boundaries, guess.mesh.degrees, guess.values.ravel()])
    digests = {"known": known, "guess": pickle.dumps(guess)}
    found = {name: hashlib.sha256(data).hexdigest()[:12] for name, data in digests.items()}
    return question | {"format": RETRY_FORMAT} | found
