"""Quantities of a problem by their names, and the same problem with other values of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from actionopt.analysis.sensitivity import slopes
from actionopt.analysis.solution import Solution
from actionopt.discrete.borders import over
from actionopt.discrete.path import Path
from actionopt.mechanics.problem import Event, Periodic, Problem, Tail
from actionopt.mechanics.system import System
from actionopt.tools.types import Array

Name = str | tuple[str, str]


def present(problem: Problem, name: Name) -> float:
    """Return the value that a quantity has: a parameter of one number, a time or a coordinate.

    Names are those of parameters, "t0", "t1" and "energy", ("start", coordinate) and ("end",
    coordinate).

    Raises
    ------
    ValueError
        If there is no such quantity, or the events leave it open.
    """
    problem = problem.asked or problem
    if name == "energy" and name not in problem.parameters:
        if problem.energy is None:
            raise ValueError(
                "expected an energy that is given, as where a time is free, found both times "
                "given; make one of them None"
            )
        return problem.energy
    if name in ("t0", "t1"):
        event = problem.start if name == "t0" else problem.end
        if event.t is None:
            raise ValueError(f"expected a time that is given, found {name!r}, which is free")
        if np.isinf(event.t) or isinstance(event, Tail):
            raise ValueError(
                f"expected a finite time to vary, found the event at infinity as {name!r}"
            )
        return event.t
    if isinstance(name, tuple) and len(name) == 2 and name[0] in ("start", "end"):
        if name[0] == "end" and isinstance(problem.end, Periodic):
            raise ValueError("expected an end of its own to vary: this one closes on the start")
        event = problem.start if name[0] == "start" else problem.end
        coordinates = problem.system.coordinates
        value = event.near[coordinates.index(name[1])] if name[1] in coordinates else None
        if value is None:
            given = [c for c, x in zip(coordinates, event.near, strict=True) if x is not None]
            known = f"one of {', '.join(given)}" if given else "but the event gives none"
            raise ValueError(
                f"expected a coordinate that the event gives, {known}, found {name[1]!r}"
            )
        return value
    known = problem.parameters
    if isinstance(name, str) and name in known and np.ndim(known[name]) == 0:
        return float(known[name])
    raise ValueError(
        "expected the name of a parameter that is one number, 't0', 't1', 'energy' where a time is "
        f"free, ('start', coordinate) or ('end', coordinate), found {name!r}; the parameters are "
        f"{', '.join(known) or 'none'}"
    )


def moved(problem: Problem, values: Mapping[Name, float]) -> Problem:
    """Return the problem with other values of quantities, all at once.

    Raises ValueError as a `Problem` does.

    Examples
    --------
    >>> from actionopt import scenes
    >>> later = moved(scenes.get("pendulum").problem, {"g": 1.62, "t1": 2.0, ("end", "theta"): 0.5})
    >>> later.end.t, later.end.q, float(later.parameters["g"])
    (2.0, (0.5,), 1.62)
    """
    problem = problem.asked or problem
    events = {"start": list(problem.start.near), "end": list(problem.end.near)}
    times, parameters = {"t0": problem.start.t, "t1": problem.end.t}, {}
    values = dict(values)
    energy = None if "energy" in problem.parameters else values.pop("energy", None)
    for name, value in values.items():
        if isinstance(name, tuple):
            events[name[0]][problem.system.coordinates.index(name[1])] = value
        else:
            (times if name in times else parameters)[name] = value
    return problem.replace(
        start=_event(problem.start, times["t0"], events["start"]),
        end=_event(problem.end, times["t1"], events["end"]),
        parameters=parameters,
        energy=energy,
    )


def place(system: System, name: str) -> int:
    """Return where a parameter of one number stands in the packed row of all."""
    shapes = system.table.shapes
    before = list(shapes)[: list(shapes).index(name)]
    return sum(int(np.prod(shapes[other])) for other in before)


def slope(problem: Problem, known: Mapping[str, Array], name: Name) -> Array:
    """Return dS by a quantity, from those by all events and parameters, named as by `slopes`."""
    system = problem.system
    if not isinstance(name, tuple):
        return (
            known[name] if name in ("t0", "t1") else known["parameters"][..., place(system, name)]
        )
    i = system.coordinates.index(name[1])
    if isinstance(problem.end, Periodic):  # it moves along
        return known["q0"][..., i] + known["q1"][..., i]
    return known["q0" if name[0] == "start" else "q1"][..., i]


def along(solution: Solution, names: Iterable[Name]) -> list[float]:
    """Return dS by quantities; NaN where S is no function of them alone.

    With forces that are not conservative, contact, or durations that are found.
    """
    problem, names = solution.problem, list(names)
    forced, free_time = problem.system.structure.forced, (problem.asked or problem).free_time
    if forced or problem.system.r or free_time or not solution.success:
        return [np.nan] * len(names)
    known = slopes(solution.discrete, solution.momenta, solution.jumps)
    known |= {"t0": known["times"][0], "t1": known["times"][-1]}
    return [float(slope(problem, known, name)) for name in names]


def _event(old: Event, t: float, q: list[float | None]) -> Event:
    """Return an event of the same kind at another time and place."""
    if isinstance(old, Periodic):
        return old.at(t)
    if isinstance(old, Tail):
        return Tail(t, np.array(q, dtype=float), old.side, old.phase)
    return Event(t, q, on=old.on)


def lead_to(path: Path, problem: Problem) -> Path:
    """Return the path stretched over the times of a problem, and sheared to begin and end there."""
    problem = over(problem, path.mesh.duration)
    values, last = path.values, path.values[:, -1:]
    mesh = path.mesh.moved(problem.start.t, problem.end.t)
    s = mesh.nodes_since / mesh.duration
    for event, weight, known in ((problem.start, 1 - s, values[:, :1]), (problem.end, s, last)):
        given = [[a if b is None else b] for a, b in zip(known[:, 0], event.q, strict=True)]
        values = values + (np.array(given) - known) * weight
    return Path(mesh, values)
