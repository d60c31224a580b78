"""A path as a table with names: an xarray.Dataset, a pandas.DataFrame."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from actionopt.mechanics.laws.tracing import STATE
from actionopt.tools.checks import numbers
from actionopt.tools.types import Array


def dataset(solution: Any, t: ArrayLike | None) -> Any:
    """Return what `Solution.to_xarray` says."""
    try:
        import xarray  # pyright: ignore[reportMissingImports]
    except ImportError as error:
        raise ImportError(
            "expected xarray to be installed, found none: pip install 'actionopt[xarray]'"
        ) from error

    times, problem = _times(solution, t), solution.problem
    system, along = problem.system, ["coordinate", "t"]
    found: dict[str, Any] = {"q": (along, solution(times))}
    found |= {name: (along, rows) for name, rows in _by_name(solution, times).items()}
    found["energy"] = "t", solution.energy(times)
    if system.m:
        found["multipliers"] = ["row", "t"], solution.multipliers(times)
    if system.r:
        found["contact_force"] = ["obstacle_row", "t"], solution.contact_force(times)
    about = {
        "system": problem.name,
        "action": solution.action,
        "error": solution.error,
        "status": solution.status.name,
        **{f"parameter {name}": x.ravel() for name, x in problem.parameters.items()},
    }
    return xarray.Dataset(found, {"t": times, "coordinate": list(system.coordinates)}, about)


def frame(solution: Any, t: ArrayLike | None) -> Any:
    """Return what `Solution.to_dataframe` says."""
    try:
        import pandas  # pyright: ignore[reportMissingImports]
    except ImportError as error:
        raise ImportError(
            "expected pandas to be installed, found none; install it by pip"
        ) from error

    times, names = _times(solution, t), solution.problem.system.coordinates
    columns = list(zip(names, solution(times), strict=True))
    for name, rows in _by_name(solution, times).items():
        columns += [(f"{name}_{x}", row) for x, row in zip(names, rows, strict=True)]
    columns.append(("energy", solution.energy(times)))
    if twice := [name for name, many in Counter(name for name, _ in columns).items() if many > 1]:
        raise ValueError(
            f"expected coordinates of other names than the columns beside them, found {twice[0]!r} "
            "for both; name it otherwise, or take to_xarray(), where they lie apart"
        )
    return pandas.DataFrame(dict(columns), index=pandas.Index(times, name="t"))


def _by_name(solution: Any, times: Array) -> dict[str, Array]:
    """Return velocities and momenta, (n, K) each, by the names that they have in tables.

    Where L contains accelerations, derivatives up to the highest in it, and momenta of q, v, ...
    """
    system = solution.problem.system
    if system.order == 1:
        return {"v": solution.velocity(times), "p": solution.momentum(times)}
    rates = solution.derivatives(times)[1 : system.order + 1]
    found = dict(zip(STATE[1:], rates, strict=False))
    momenta = solution.momentum(times).reshape(rates.shape)
    names = ["p", *(f"p_{name}" for name in STATE[1:])]
    return found | dict(zip(names, momenta, strict=False))


def _times(solution: Any, t: ArrayLike | None) -> Array:
    """Return times in a row (K,), those of the nodes where none are given."""
    times = solution.mesh.nodes if t is None else np.atleast_1d(numbers(t, "the times"))
    if times.ndim > 1:
        raise ValueError(f"expected times in one row, found an array of shape {times.shape}")
    return times
