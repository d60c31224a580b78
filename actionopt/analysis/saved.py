"""What is kept of a solution: numbers and plain text in an .npz file, no pickled objects."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from actionopt.discrete.meshes.path import Path
from actionopt.discrete.newton.discrete_path import Unknowns
from actionopt.mechanics.laws.tracing import ParameterTable
from actionopt.mechanics.question.events import RATES, Bounce, Event, Periodic, Phase, Tail
from actionopt.mechanics.question.problem import BetweenEvents, Problem
from actionopt.mechanics.question.rest import Rest
from actionopt.mechanics.system import System
from actionopt.tools.files import ready, whole
from actionopt.tools.types import Array

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
# And of every path, but in files that are older: finer times where zero is far.
SINCE = "since"
# And of a path whose Lagrangian contains accelerations: velocities at the nodes, and the unknowns.
HIGHER = "rates", "unknowns"
SOLUTION_FORMAT = "actionopt solution 1"


def save(
    file: str | FilePath,
    problem: Problem | Detached,
    path: Path,
    unknowns: Unknowns | None,
    found: Mapping[str, Any],
    **arrays: Array | float,
) -> None:
    """Write a path, other `arrays` of `ARRAYS`, and what was `found`, whole or not at all.

    Raises
    ------
    ValueError
        If the name does not end in .npz.
    OSError
        If the file cannot be written; an older file of that name is then unchanged.
    """
    target = solution_file(file)
    # A solution that was loaded without its system knows what the file said of it.
    known = problem if isinstance(problem, Detached) else problem.system
    # Beyond these ends the path comes from rest, or tends to it.
    ends = problem.start, problem.end
    tails = [[e.near, e.side, e.phase] if e.side else None for e in ends]
    about = {
        "format": SOLUTION_FORMAT,
        "system": problem.name,
        "coordinates": known.coordinates,
        "parameters": {name: value.tolist() for name, value in problem.parameters.items()},
        "events": [[e.t, list(e.q), *e.rates] for e in problem.joints_found],
        "integral": problem.integral,
        "advance": None if problem.advance is None else list(problem.advance),
        "relabel": getattr(problem.end, "relabel", None),
        **({} if problem.asked is None else {"asked": asked_of(problem)}),
        "tails": tails if any(tails) else None,
        **({"singular": path.mesh.singular_ends} if any(path.mesh.singular_ends) else {}),
        **found,
    }
    arrays |= {"boundaries": path.mesh.boundaries, "degrees": np.array(path.mesh.degrees)}
    arrays |= {SINCE: path.mesh.since, "values": path.values}
    if unknowns is not None and path.velocities is not None:
        arrays |= zip(HIGHER, (path.velocities, unknowns.z), strict=True)
        units = {"lengths": unknowns.lengths, **unknowns.units._asdict()}
        about["units"] = {
            k: None if x is None else np.asarray(x).tolist() for k, x in units.items()
        }
    with whole(target) as part:
        np.savez(part, allow_pickle=False, about=np.array(json.dumps(about)), **arrays)


def asked_of(problem: Problem | Detached) -> dict[str, Any]:
    """Return which times were to be found, at which energy, and which events lay on surfaces.

    An event on a surface is kept as its law, what it gives, and whether it is a reflection.
    """
    asked = problem.asked
    if isinstance(asked, dict):
        return asked
    assert asked is not None
    joints = asked.joints_found
    found = {"free": [e.t is None for e in joints], "energy": asked.energy}
    if any(e.on is not None for e in joints):
        found["on"] = [
            None if e.on is None else [e.on.law.serialize(), e.q, isinstance(e, Bounce)]
            for e in joints
        ]
    return found


def solution_file(file: str | FilePath) -> FilePath:
    """Return where a solution goes. Raises as `save`, and before anything is written."""
    target = ready(file)
    if target.suffix != ".npz":
        raise ValueError(f"expected a file name that ends in .npz, found {target.name!r}")
    return target


def _edge(t: float, rest: list[float], side: int, phase: list[Any] | None) -> Tail:
    """Return an end beyond which the path comes from rest or tends to it."""
    if phase is None:
        return Tail(t, rest, side)
    at, normal, center, weight = phase
    return Tail(t, rest, side, Phase(at, tuple(normal), tuple(center), weight))


def _event(t: float, q: list[Any], *rates: Any) -> Event:
    """Return an event of a file, with what is given of its derivatives."""
    return Event(t, q, **dict(zip(RATES, rates, strict=False)))


class Detached(BetweenEvents):
    """Stands for the problem of a solution loaded without its system: events and parameters."""

    def __init__(self, about: dict[str, Any]) -> None:
        self.name, self.coordinates = about["system"] or "problem", tuple(about["coordinates"])
        self.start, *between, self.end = (_event(*e) for e in about["events"])
        self.through = tuple(between)
        self.integral: tuple[float, ...] | None = about.get("integral")  # an older file has none
        if about.get("tails") is not None:  # an older file has none
            ends = [
                e if tail is None else _edge(e.t, *tail)
                for e, tail in zip((self.start, self.end), about["tails"], strict=True)
            ]
            self.start, self.end = ends
        if about["advance"] is not None:
            t1, q1 = self.end.t, self.end.q
            end = Periodic(t1, about["advance"], relabel=about.get("relabel"))
            self.end = end.after(self.start)
            if self.end.q != q1:
                raise ValueError(
                    f"expected an end of a closed path after its advance, {self.end.q}, found {q1}"
                )
        self.parameters = ParameterTable(about["parameters"]).defaults
        self.asked: dict[str, Any] | None = about.get("asked")
        energy = None if self.asked is None else self.asked["energy"]
        self.energy: float | None = None if energy is None else float(energy)

    closes = False  # it has no system that would say whether there is a clock

    @property
    def rests(self) -> tuple[Rest | None, Rest | None]:
        """Raise ValueError: there is no system."""
        _ = self.system  # raises
        return None, None

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
