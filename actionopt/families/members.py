"""What came of many members of a family, in the order in which they were given."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from actionopt.analysis.status import Status
from actionopt.discrete.mesh import Mesh
from actionopt.discrete.path import Path
from actionopt.families.vary import moved
from actionopt.mechanics.problem import Problem
from actionopt.tools.types import Array, NDInt


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
        The nearest member of those from which each was reached; -1 for one that had none.
    moved : (k,) array
        How far the path is from where its neighbours led to expect it, in its own size; NaN
        where they did not.
    slopes : (k, columns) array
        dS by each quantity that differs; NaN where S is no function of them alone, as with forces
        that are not conservative.
    sheet : (k,) array of int
        The same for members that were reached from each other without a leap; -1 for others.
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
    slopes: Array
    sheet: NDInt
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


def member(problem: Problem, columns: Mapping[Any, ArrayLike], i: int) -> Problem:
    """Return the problem of member i. Raises ValueError as a `Problem` does."""
    return moved(problem, {name: float(np.asarray(row)[i]) for name, row in columns.items()})
