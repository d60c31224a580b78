"""References where no closed form is known, from the file that `benchmarks.reference` makes."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

from benchmarks.problems._case import Ends

FILE = Path(__file__).parents[1] / "reference.npz"


@cache
def table() -> dict[str, np.ndarray]:
    """Return all that is in the file, by name."""
    return dict(np.load(FILE)) if FILE.exists() else {}


def stored(name: str) -> tuple[Ends, Ends]:
    """Return the two `Ends` of a problem."""
    first, other = (Ends(q[:, 0].copy(), q[:, -1].copy(), q.copy()) for q in table()[name])
    return first, other


def others(name: str) -> tuple:
    """Return the other paths that are known, for either pair of ends: arrays (P, n, K)."""
    return tuple(table().get(f"{name}/{k}", ()) for k in (0, 1))
