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
    """The answers of k members, in the order in which they were given."""

    status: tuple[Status, ...]
    # action, error (k,): NaN and infinite for a member that was refused.
    action: Array
    error: Array
    index: NDInt  # (k,): Morse indices, -1 where none was asked for or could be counted
    momenta: Array  # (k, 2, n): at the start and at the end
    times: Array  # (k, 2): of the two events
    iterations: NDInt  # (k,): factorizations
    alone: NDInt  # (k,): which were left to `solve`
    # (k,): the nearest member of those from which each was reached; -1 for one that had none.
    neighbour: NDInt
    # (k,): how far the path is from where its neighbours led to expect it, in its own size; NaN
    # where they did not.
    moved: Array
    # (k, columns): dS by each quantity that differs; NaN where S is no function of them alone, as
    # with forces that are not conservative.
    slopes: Array
    # (k,): the same for members that were reached from each other without a leap; -1 for others.
    sheet: NDInt
    meshes: tuple[Mesh, ...]  # over the times [0, 1]
    mesh: NDInt  # (k,): which of them is each member's
    values: tuple[Array, ...]  # (n, K): coordinates at the nodes
    messages: dict[int, str]  # what `solve` says of members that it refused
    errors: dict[int, str]  # what ended the solve of members unexpectedly
    # (k,): members that failed and were not searched for as `solve` would, to save time.
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
