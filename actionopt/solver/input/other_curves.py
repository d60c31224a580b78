"""Curves that other packages say, as paths: what they are is told by what they have."""

from __future__ import annotations

from typing import Any

import numpy as np

from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.meshes.splines import is_piecewise, read_pieces
from actionopt.tools.checks import numbers

STEP_DEGREE = 7  # of what scipy's methods, of order 8 at most, say between two of their steps


def read_curve(guess: Any, names: tuple[str, ...]) -> Path | None:
    """Return what another package says of a curve of coordinates as a path; else None.

    That is piecewise polynomials of scipy's, of either order of axes; what `solve_bvp` and
    `solve_ivp` return, and the `sol` of these; and a DataFrame with columns of those names, whose
    index, or a column "t", are times. Where there are 2 n rows, the first n are coordinates, the
    others velocities or momenta.

    Raises ValueError if it is one of them and does not say a curve of these coordinates.
    """
    if hasattr(guess, "iloc") and hasattr(guess, "columns"):
        missing = [name for name in names if name not in guess.columns]
        if missing:
            raise ValueError(
                f"expected a table with columns {', '.join(names)}, found none called "
                f"{missing[0]!r} among {', '.join(map(str, guess.columns))}"
            )
        t = guess["t"] if "t" in guess.columns and "t" not in names else guess.index
        return _polygon(t, [guess[name] for name in names])
    if hasattr(guess, "sol") and hasattr(guess, "y"):  # of solve_bvp or of solve_ivp
        if guess.sol is None:
            return _of_states(_polygon(guess.t, guess.y), names)
        guess = guess.sol
    if hasattr(guess, "ts") and hasattr(guess, "interpolants"):  # of solve_ivp, dense
        return _of_states(Path.interpolate(guess, Mesh(np.unique(guess.ts), STEP_DEGREE)), names)
    if is_piecewise(guess):
        return _of_states(Path(*read_pieces(guess)), names)
    return None


def _polygon(t: Any, rows: Any) -> Path:
    """Return the polygon through points (n, K) at times (K,)."""
    values = numbers([np.asarray(row) for row in rows], "the guess")
    return Path(Mesh(numbers(np.asarray(t), "the times of the guess"), 1), values)


def _of_states(path: Path, names: tuple[str, ...]) -> Path:
    """Return the coordinates of a path that may be one of states, (q, v) or (q, p)."""
    n, found = len(names), len(path.values)
    if found not in (n, 2 * n):
        raise ValueError(
            f"expected a guess of {n} coordinates, or of so many and their velocities, found "
            f"{found} rows"
        )
    return Path(path.mesh, path.values[:n])
