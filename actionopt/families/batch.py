"""Many problems of one system: members that differ in parameters, end coordinates or end times."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from actionopt.analysis.solution import Solution
from actionopt.analysis.status import Status
from actionopt.discrete.mesh import Mesh
from actionopt.discrete.path import Path
from actionopt.mechanics.problem import Event, Periodic, Problem
from actionopt.solver.solve import Guess, solve
from actionopt.tools.types import Array, NDInt

Name = str | tuple[str, str]


@dataclass(frozen=True, eq=False)
class Members:
    """What came of k members, in the order in which they were given.

    Attributes
    ----------
    status : tuple of Status
    action, error : (k,) arrays
        NaN and infinite for a member that was refused.
    index : (k,) array of int
        Morse indices, -1 where none was asked for or could be counted.
    momenta : (k, 2, n) array
        At the start and at the end.
    times : (k, 2) array
        Of the two events.
    iterations : (k,) array of int
        Factorizations.
    alone : (k,) array of bool
        Which were left to `solve`.
    neighbour : (k,) array of int
        The member from which each was reached; -1 for one that had none.
    moved : (k,) array
        How far the path is from where its neighbours led to expect it, in its own size; NaN
        where it was not followed.
    meshes : tuple of Mesh
        Over the times [0, 1].
    mesh : (k,) array of int
        Which of them is each member's.
    values : tuple of (n, K) arrays
        Coordinates at the nodes.
    messages : dict of int to str
        What `solve` says of members that it refused.
    """

    status: tuple[Status, ...]
    action: Array
    error: Array
    index: NDInt
    momenta: Array
    times: Array
    iterations: NDInt
    alone: NDInt
    neighbour: NDInt
    moved: Array
    meshes: tuple[Mesh, ...]
    mesh: NDInt
    values: tuple[Array, ...]
    messages: dict[int, str]

    @property
    def success(self) -> NDInt:
        """Which paths can be used as they are, (k,) of bool."""
        return np.array([s.success for s in self.status], dtype=bool)

    def path(self, i: int) -> Path:
        """Return the path of a member; the guess with which `solve` gives it to full accuracy."""
        return Path(self.meshes[self.mesh[i]].moved(*self.times[i].tolist()), self.values[i])


def member(problem: Problem, columns: Mapping[Name, ArrayLike], i: int) -> Problem:
    """Return the problem of member i. Raises ValueError as a `Problem` does."""
    parameters, times = {}, [problem.start.t, problem.end.t]
    ends = [list(problem.start.q), list(problem.end.q)]
    for name, values in columns.items():
        value = float(np.asarray(values)[i])
        if isinstance(name, tuple):
            ends[name[0] == "end"][problem.system.coordinates.index(name[1])] = value
        elif name in ("t0", "t1"):
            times[name == "t1"] = value
        else:
            parameters[name] = value
    end = problem.end
    end = end.at(times[1]) if isinstance(end, Periodic) else Event(times[1], ends[1])
    return problem.replace(start=Event(times[0], ends[0]), end=end, parameters=parameters)


def solve_run(
    problem: Problem,
    columns: Mapping[Name, ArrayLike],
    tol: float = 1e-8,
    *,
    index: bool = False,
    guess: Guess | None = None,
) -> Members:
    """Return the paths of members of a family, each found from its neighbours.

    Parameters
    ----------
    problem : Problem
        What all members have in common.
    columns : mapping of name to (k,) values
        What differs, in the order of neighbours: names of parameters (of one number), "t0", "t1",
        ("start", coordinate) and ("end", coordinate).
    tol : float
        As for `solve`.
    index : bool
        Whether to count Morse indices.
    guess : Path, Solution, callable or array, optional
        As for `solve`, for the first member.
    """
    count = len(np.asarray(next(iter(columns.values()))))
    run = _Run(problem.system.n, count)
    known: Solution | None = None
    for i in range(count):
        start = guess if known is None else known
        try:
            asked = member(problem, columns, i)
            found = solve(asked, tol=tol, guess=start, throw=False)
        except ValueError as error:
            run.messages[i] = str(error)
            continue
        run.keep(i, found, index)
        if found.success:
            known = found
    return run.members()


class _Run:
    """The members as they are found."""

    def __init__(self, n: int, k: int) -> None:
        self.status = [Status.NOT_FOUND] * k
        self.action, self.error, self.moved = np.full((3, k), np.nan)
        self.error[:] = np.inf
        self.index, self.neighbour, self.mesh = np.full((3, k), -1)
        self.iterations = np.zeros(k, dtype=int)
        self.momenta, self.times = np.full((k, 2, n), np.nan), np.full((k, 2), np.nan)
        self.alone = np.ones(k, dtype=bool)
        self.values = [np.zeros((n, 0))] * k
        self.meshes: list[Mesh] = []
        self.messages: dict[int, str] = {}

    def keep(self, i: int, found: Solution, index: bool) -> None:
        """Keep what `solve` found."""
        self.status[i], self.action[i], self.error[i] = found.status, found.action, found.error
        self.iterations[i] = sum(found.stats["iterations"].values())
        self.times[i] = found.problem.start.t, found.problem.end.t
        self.momenta[i] = found.momenta
        if index and found.success:
            with suppress(ValueError):  # there is none
                self.index[i] = found.morse_index
        self.mesh[i], self.values[i] = len(self.meshes), found.path.values
        self.meshes.append(found.mesh.moved(0.0, 1.0))

    def members(self) -> Members:
        """Return them all."""
        return Members(
            tuple(self.status), self.action, self.error, self.index, self.momenta, self.times,
            self.iterations, self.alone, self.neighbour, self.moved, tuple(self.meshes),
            self.mesh, tuple(self.values), self.messages,
        )  # fmt: skip
