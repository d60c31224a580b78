"""One task of a sweep: a run of neighbours is solved, somewhere, and arrays come back."""

from __future__ import annotations

import pickle
from collections.abc import Mapping

import numpy as np

from actionopt.analysis.status import Status
from actionopt.discrete.path import Path
from actionopt.families.batch import solve_run
from actionopt.families.kept import Kept
from actionopt.families.vary import Name
from actionopt.mechanics.problem import Problem
from actionopt.solver.solve import Guess
from actionopt.tools.types import Array, NDInt

Answers = dict[str, Array]
REFUSED = "REFUSED"  # beside the names of `Status`: the problem makes no sense


def work(
    question: bytes,
    members: NDInt,
    columns: Mapping[Name, Array],
    guess: Path | None,
    options: tuple[float, bool, bool],
) -> Answers:
    """Solve members of a grid one after the other: what an executor is given.

    Parameters
    ----------
    question : bytes
        The pickled problem, which makes its system once in a process.
    members : (k,) array of int
        Their numbers, in an order of neighbours.
    columns : mapping of name to (k,) array
    guess : Path or None
        Near the path of the first.
    options : tuple
        `tol`, and whether to count indices and to keep paths.
    """
    return solved(pickle.loads(question), members, columns, guess, options)


def solved(
    problem: Problem,
    members: NDInt,
    columns: Mapping[Name, Array],
    guess: Guess | None,
    options: tuple[float, bool, bool],
) -> Answers:
    """Return the same of a problem that is here."""
    tol, index, keep_paths = options
    found = solve_run(problem, columns, tol, index=index, guess=guess)
    good = np.flatnonzero(found.success)
    status = np.array(
        [s.name for s in found.status], dtype=f"<U{max(map(len, Status.__members__))}"
    )
    status[list(found.messages)] = REFUSED
    action, momenta, ends = (
        np.full(x.shape, np.nan) for x in (found.action, found.momenta, found.momenta)
    )
    action[good], momenta[good] = found.action[good], found.momenta[good]
    for k in good:
        ends[k] = found.values[k][:, [0, -1]].T
    answers = {
        "members": members,
        "status": status,
        "action": action,
        "error": found.error,
        "momenta": momenta,
        "ends": ends,
        "refused": members[list(found.messages)],
        "messages": np.array(list(found.messages.values()), dtype=str),
        "iterations": found.iterations.sum(),
        "alone": found.alone.sum(),
    }
    if index:
        answers["index"] = np.where(found.success, found.index, -1)
    if keep_paths:
        answers |= Kept.of(members[good], [found.path(k) for k in good.tolist()]).packed("kept")
    return answers
