"""What came of many members of a family, in the order in which they were given."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.linalg import LinAlgError
from numpy.typing import ArrayLike

from actionopt.analysis.status import Status
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.meshes.path import Path
from actionopt.families.vary import Name, with_values
from actionopt.mechanics.question.problem import Problem
from actionopt.tools.immutable import immutable
from actionopt.tools.types import Array, NDInt


@immutable
class Members:
    """The answers of k members, in the order in which they were given.

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
    errors : dict of int to str
        What ended the solve of members unexpectedly.
    unsought : (k,) array of bool
        Members that failed and were not searched for as `solve` would, to save time.
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
    errors: dict[int, str]
    unsought: NDInt

    @property
    def success(self) -> NDInt:
        """Which paths can be used as they are, (k,) of bool."""
        return np.array([s.success for s in self.status], dtype=bool)

    def path(self, i: int) -> Path:
        """Return the path of a member; the guess with which `solve` gives it to full accuracy."""
        return Path(self.meshes[self.mesh[i]].moved(*self.times[i].tolist()), self.values[i])


def refusal(error: Exception) -> tuple[str, bool]:
    """Return what is said of a member whose solve raised, and whether it was refused.

    Anything but a refusal is unexpected; the other members are not to be lost with it.
    """
    if isinstance(error, ValueError) and not isinstance(error, LinAlgError):
        return str(error), True
    return f"{type(error).__name__}: {error}", False


def member(problem: Problem, columns: Mapping[Any, ArrayLike], i: int) -> Problem:
    """Return the problem of member i. Raises ValueError as a `Problem` does."""
    return with_values(problem, {name: float(np.asarray(row)[i]) for name, row in columns.items()})


def checked_columns(problem: Problem, columns: Mapping[Any, ArrayLike]) -> dict[Name, Array]:
    """Return the columns as arrays. Raises ValueError as `solve_run` does."""
    found: dict[Name, Array] = {}
    system = problem.system
    scalars = [name for name, shape in system.table.shapes.items() if shape == ()]
    for name, values in columns.items():
        column = np.array(values, dtype=float)
        if column.ndim != 1 or not column.size or not np.isfinite(column).all():
            raise ValueError(f"expected a row of finite values of {name!r}, found {values!r}")
        if found and column.size != next(iter(found.values())).size:
            raise ValueError(
                f"expected as many values of {name!r} as of others, found {column.size}"
            )
        known = name in ("t0", "t1") or name in scalars
        if isinstance(name, tuple) and len(name) == 2 and name[0] in ("start", "end"):
            event = problem.start if name[0] == "start" else problem.end
            closed = name[0] == "end" and event.advance is not None
            known = not closed and name[1] in system.coordinates
            known = known and event.q[system.coordinates.index(name[1])] is not None
        if not known:
            raise ValueError(
                "expected the name of a parameter that is one number, 't0', 't1', or 'start' or "
                "'end' with a coordinate that the event gives, found "
                f"{name!r}; the parameters are {', '.join(scalars) or 'none'}, the coordinates "
                f"{', '.join(system.coordinates)}"
            )
        found[name] = column
    if not found:
        raise ValueError("expected at least one quantity that differs, found none")
    return found
