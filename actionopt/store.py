"""Solutions in files: numbers and plain text in an .npz, no pickled objects.

A file holds the path, the ends, the parameters and the verdict. Physics is code and stays out:
to evaluate momenta or energies again, the system (or the name of its scene) is supplied on
loading.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Any, cast

import numpy as np

from actionopt import scenes
from actionopt.path import Mesh, Path
from actionopt.problem import Event, Periodic, Problem, State
from actionopt.quadrature import Array
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
    # A solution that was loaded without its system knows what the file said of it.
    known = problem if isinstance(problem, Detached) else problem.system
    about = {
        "format": FORMAT,
        "system": problem.name,
        "coordinates": known.coordinates,
        "parameters": {name: value.tolist() for name, value in problem.parameters.items()},
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
        If it is damaged or was not written by `save`, or the system's coordinates or
        parameters are not those in the file.
    """
    if not (system is None or isinstance(system, (System, str))):
        raise ValueError(f"expected a System or the name of a scene, found {system!r}")
    try:
        found = _read(FilePath(file))
    except FileNotFoundError:
        raise
    except Exception as error:  # there is no end to the ways in which a file can be damaged
        why = str(error) if str(error).startswith("expected") else type(error).__name__
        raise ValueError(
            f"expected an .npz file written by Solution.save, found {str(file)!r}, which is "
            f"damaged or something else ({why}); solve and save again"
        ) from error
    problem = _problem(found, system)
    if problem is None:
        return found
    loaded = replace(found, problem=problem)
    return _with_ends(loaded, (found.start.v, found.end.v), found.momenta)


class Detached:
    """Stands for the problem of a solution loaded without its system: events and parameters."""

    def __init__(self, about: dict[str, Any]) -> None:
        self.name, self.coordinates = about["system"] or "problem", tuple(about["coordinates"])
        (t0, q0), (t1, q1) = about["events"]
        self.start, self.end = Event(t0, q0), Event(t1, q1)
        if about["advance"] is not None:
            self.end = Periodic(t1, about["advance"]).after(self.start)
        self.parameters = {k: np.asarray(v, dtype=float) for k, v in about["parameters"].items()}

    @property
    def advance(self) -> Array | None:
        """q(t1) - q(t0) where the end is `Periodic`, (n,), else None."""
        return np.array(self.end.advance) if isinstance(self.end, Periodic) else None

    @property
    def duration(self) -> float:
        """Time between the events."""
        return self.end.t - self.start.t

    @property
    def system(self) -> System:
        """Raise ValueError: there is no system."""
        raise ValueError(
            "this solution was loaded without its system, and a file holds no physics; load it "
            "with load(file, system=...), a System of the coordinates "
            f"{', '.join(self.coordinates)} or the name of a scene"
        )


def _read(file: FilePath) -> Solution:
    """Return the solution in a file, its problem `Detached`; raise anything if there is none."""
    with open(file, "rb") as stream:
        if stream.read(2) != b"PK":  # numpy would advise to load it in another, unsafe way
            raise ValueError("expected a zip archive")
        stream.seek(0)
        with np.load(stream, allow_pickle=False) as arrays:
            data = {name: arrays[name] for name in (*ARRAYS, "about")}
    about = json.loads(str(data["about"]))
    if about["format"] != FORMAT:
        raise ValueError(f"expected the format {FORMAT!r}, found {about['format']!r}")
    problem = Detached(about)
    mesh = Mesh(data["boundaries"], data["degrees"])
    path = Path(mesh, data["values"])
    n, nodes = len(problem.coordinates), mesh.nodes.size
    shapes = [len(problem.start.q), len(problem.end.q), path.values.shape[0]]
    if shapes != [n, n, n] or data["momenta"].shape != (2, n) or data["lam"].shape[1:] != (nodes,):
        raise ValueError("expected arrays of shapes that belong together")
    solution = Solution(
        cast(Problem, problem),
        path,
        float(data["action"][()]),
        data["lam"],
        float(data["error"][()]),
        Status[about["status"]],
        dict(about["stats"]),
    )
    return _with_ends(solution, data["velocities"], data["momenta"])


def _with_ends(solution: Solution, velocities: Any, momenta: Any) -> Solution:
    """Return the solution with what it would derive from its system: that is in the file as well.

    Raises ValueError if the velocities are not two finite rows (n,).
    """
    b, values = solution.mesh.boundaries, solution.path.values
    start, end = (
        State(t, q, v) for t, q, v in zip(b[[0, -1]], values.T[[0, -1]], velocities, strict=True)
    )
    p0, p1 = (np.array(p, dtype=float) for p in momenta)
    for p in (p0, p1):
        p.setflags(write=False)
    solution.__dict__.update(start=start, end=end, momenta=(p0, p1))
    return solution


def _problem(found: Solution, system: System | str | None) -> Problem | None:
    """Return the problem of a solution whose system is given, or is the scene of the same name.

    None where there is no such scene. Raises ValueError for the wrong system.
    """
    known = cast(Detached, found.problem)
    guessed = system is None
    if guessed:
        system = known.name if known.name in scenes.SCENES else None
    if isinstance(system, str):
        system = scenes.get(system).problem.system
    if system is None:
        return None
    try:
        if system.coordinates != known.coordinates:
            raise ValueError(
                f"expected a system of the coordinates {', '.join(known.coordinates)} in the "
                f"file, found {', '.join(system.coordinates)}"
            )
        problem = Problem(system, known.start, known.end, parameters=known.parameters)
        tr = Transcription(problem, found.mesh, problem.scales)
        action, S = tr.action_and_gradient(found.path.values.T)[0], found.action
        if not abs(action - S) <= SAME * max(abs(S), tr.action_unit):
            raise ValueError(
                f"expected the system of the file, whose action on its path is {S}, found "
                f"a system that gives {action}"
            )
    except ValueError:
        if guessed:  # another system of that name
            return None
        raise
    return problem
