"""Stationary points that solvers came to: kept in a file, so that nothing found stays new.

And from how many random starts they were looked for.

`actionopt.suite.learn` adds to it. A point belongs to one mesh of one family: on a coarse one it
may be no path at all. On any other mesh the others of a problem are those its bends lead to.
"""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from actionopt.suite.action import ActionProgram
from actionopt.tools.texts import read
from actionopt.tools.types import Array

KNOWN_FILE = Path(__file__).with_name("known.json")


def points(name: str, program: ActionProgram) -> list[Array]:
    """Return points x (n,), in sizes of the coordinates, near stationary ones of this problem."""
    entry = table().get(key(name, program))
    return [np.array(x) for x in entry["points"]] if entry else []


def starts(name: str, program: ActionProgram) -> int:
    """Return from how many random starts others were looked for."""
    entry = table().get(key(name, program))
    return entry["starts"] if entry else 0


def paths(name: str, program: ActionProgram) -> int:
    """Return how many paths of the continuous problem `solve_all` found, when it was asked."""
    entry = table().get(key(name, program))
    return entry.get("paths", 0) if entry else 0


def key(name: str, program: ActionProgram) -> str:
    """Return the name and the mesh."""
    return f"{name} {program.mesh.elements} x {max(program.mesh.degrees)}"


@cache
def table() -> dict[str, dict[str, Any]]:
    """Return the points of each problem, and the number of starts."""
    return json.loads(read(KNOWN_FILE))
