"""Solutions in files: numbers and plain text in an .npz, no pickled objects.

A file holds the path, the ends, the parameters and the verdict. Physics is code and stays out:
to evaluate momenta or energies again, the system (or the name of its scene) is supplied on
loading.
"""

from __future__ import annotations

import json
from pathlib import Path as FilePath
from typing import Any, cast

import numpy as np

from actionopt import scenes
from actionopt.path import Mesh, Path
from actionopt.problem import Event, Periodic, Problem, State
from actionopt.solution import Solution
from actionopt.status import Status
from actionopt.system import System
from actionopt.transcription import Transcription
from actionopt.writing import whole

SAME = 1e-9  # relative difference of two evaluations of the action of one path
ARRAYS = (
    "boundaries",
    "degrees",
    "values",
    "lam",
    "action",
    "error",
    "velocities",
    "momenta",
)
FORMAT = "actionopt solution 1"


def save(solution: Solution, file: str | FilePath) -> None:
    """Write `solution` to `file` (.npz), whole or not at all.

    Raises
    ------
    ValueError
        If the name does not end in .npz.
    OSError
        If the file cannot be written; an older file of that name is then unchanged.
    """
    target = FilePath(file)
    if target.suffix != ".npz":
        raise ValueError(f"expected a file name that ends in .npz, found {target.name!r}")
    problem = solution.problem
    parameters = problem.system.table.values(problem.parameters)
    about = {
        "format": FORMAT,
        "system": problem.system.name,
        "coordinates": problem.system.coordinates,
        "parameters": {name: value.tolist() for name, value in parameters.items()},
        "events": [[e.t, list(e.q)] for e in (problem.start, problem.end)],
        "advance": None if problem.advance is None else list(problem.advance),
        "status": solution.status.name,
        "stats": solution.stats,
    }
    arrays = {
        "boundaries": solution.mesh.boundaries,
        "degrees": np.array(solution.mesh.degrees),
        "values": solution.path.values,
        "lam": solution.lam,
        "action": np.array(solution.action),
        "error": np.array(solution.error),
        "velocities": np.stack([solution.start.v, solution.end.v]),
        "momenta": np.stack(solution.momenta),
        "about": np.array(json.dumps(about)),
    }
    with whole(target) as part:
        np.savez(part, allow_pickle=False, **arrays)


def load(file: str | FilePath, system: System | str | None = None) -> Solution:
    """Read a solution that `save` wrote.

    Parameters
    ----------
    file : str or path
    system : System or str, optional
        The system, or the name of the scene it belongs to. Without it a scene is looked up by
        the name in the file; if there is none, the path, the ends and the verdict are there
        but quantities that need the Lagrangian raise ValueError.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If it is unreadable or was not written by `save`, or the system's coordinates or
        parameters are not those in the file.
    """
    import zipfile  # slow to import, and needed here only

    try:
        # Opened here, so that it is closed as well when numpy gives up half way.
        with open(file, "rb") as stream, np.load(stream, allow_pickle=False) as arrays:
            data = {name: arrays[name] for name in (*ARRAYS, "about")}
        about = json.loads(str(data["about"]))
        known = about["format"]
    except FileNotFoundError:
        raise
    except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile) as error:
        raise ValueError(
            f"expected an .npz file written by Solution.save, found {str(file)!r}, which "
            f"cannot be read as one ({type(error).__name__}: {error})"
        ) from error
    if known != FORMAT:
        raise ValueError(f"expected a file of format {FORMAT!r}, found {known!r}")
    mesh = Mesh(data["boundaries"], data["degrees"])
    path = Path(mesh, data["values"])
    problem = _problem(about, system, path, float(data["action"]))
    solution = Solution(
        problem,
        path,
        float(data["action"]),
        data["lam"],
        float(data["error"]),
        Status[about["status"]],
        about["stats"],
    )
    ends = [
        State(float(mesh.boundaries[-k]), path.values[:, -k], data["velocities"][k]) for k in (0, 1)
    ]
    # What a solution would derive from its system is in the file as well.
    solution.__dict__.update(start=ends[0], end=ends[1], momenta=tuple(data["momenta"]))
    return solution


class Detached:
    """Stands for the problem of a solution loaded without its system: events and parameters."""

    def __init__(self, about: dict[str, Any]) -> None:
        self.start, self.end = (Event(t, q) for t, q in about["events"])
        self.parameters = {k: np.asarray(v, dtype=float) for k, v in about["parameters"].items()}
        self._coordinates = ", ".join(about["coordinates"])

    @property
    def duration(self) -> float:
        """Time between the events."""
        return self.end.t - self.start.t

    @property
    def system(self) -> System:
        """Raise ValueError: there is no system."""
        raise ValueError(
            "this solution was loaded without its system, and a file holds no physics; load it "
            f"with load(file, system=...), a System of the coordinates {self._coordinates} or "
            "the name of a scene"
        )


def _problem(about: dict[str, Any], system: System | str | None, path: Path, S: float) -> Problem:
    """Return the problem of a file whose system is given, or is the scene of the same name."""
    guessed = system is None
    if guessed:
        system = about["system"] if about["system"] in scenes.SCENES else None
    if isinstance(system, str):
        system = scenes.get(system).problem.system
    if system is None:
        return cast(Problem, Detached(about))
    start, end = (Event(t, q) for t, q in about["events"])
    if about["advance"] is not None:
        end = Periodic(end.t, about["advance"])
    try:
        if system.coordinates != tuple(about["coordinates"]):
            raise ValueError(
                f"expected a system of the coordinates {', '.join(about['coordinates'])} in the "
                f"file, found {', '.join(system.coordinates)}"
            )
        problem = Problem(system, start, end, parameters=about["parameters"])
        tr = Transcription(problem, path.mesh, problem.scales)
        action = tr.action_and_gradient(path.values.T)[0]
        if not abs(action - S) <= SAME * max(abs(S), tr.action_unit):
            raise ValueError(
                f"expected the system of the file, whose action on its path is {S}, found "
                f"a system that gives {action}"
            )
    except ValueError:
        if guessed:  # another system of that name
            return cast(Problem, Detached(about))
        raise
    return problem
