"""Quantities of a problem by their names, and the same problem with other values of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from actionopt.analysis.quadratic.sensitivity import slopes
from actionopt.analysis.solution import Solution
from actionopt.discrete.borders.borders import times_over
from actionopt.discrete.meshes.path import Path
from actionopt.mechanics.laws.tracing import MULTIPLIERS, SWITCHES
from actionopt.mechanics.question.course import check_shared
from actionopt.mechanics.question.events import Event, Tail
from actionopt.mechanics.question.problem import Problem
from actionopt.mechanics.system import System
from actionopt.tools.types import Array

Name = str | tuple[Any, ...]  # ("start", coordinate), ("through", k, coordinate), ...


def present(problem: Problem, name: Name) -> float:
    """Return the value that a quantity has: a parameter of one number, a time or a coordinate.

    Names are those of parameters, "t0", "t1" and "energy", ("start", coordinate) and ("end",
    coordinate), ("through", k, coordinate) and ("through", k, "t") of event k between the ends,
    and ("integral", i), the value of integral i.

    Raises
    ------
    ValueError
        If there is no such quantity, or the events leave it open.
    """
    if not isinstance(name, (str, tuple)):
        raise ValueError(f'expected a name, or a tuple such as ("end", coordinate), found {name!r}')
    problem = problem.original
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
        if np.isinf(event.t) or event.side:
            raise ValueError(
                f"expected a finite time to vary, found the event at infinity as {name!r}"
            )
        return event.t
    if isinstance(name, tuple) and name and name[0] in ("start", "end", "through", "integral"):
        return _of_events(problem, name)
    known = {k: x for k, x in problem.parameters.items() if k not in (SWITCHES, MULTIPLIERS)}
    if isinstance(name, str) and name in known and np.ndim(known[name]) == 0:
        return float(known[name])
    if isinstance(name, str):
        check_shared(problem, [name])
    raise ValueError(
        "expected the name of a parameter that is one number, 't0', 't1', 'energy' where a time is "
        "free, ('start', coordinate), ('end', coordinate), ('through', number, coordinate or 't') "
        f"or ('integral', number), found {name!r}; the parameters are {', '.join(known) or 'none'}"
    )


def _of_events(problem: Problem, name: tuple) -> float:
    """Return what an event gives, or the value of an integral. Raises ValueError if none does."""
    kind, *which = name
    if kind in ("start", "end") and len(which) == 1:
        if kind == "end" and problem.advance is not None:
            raise ValueError("expected an end of its own to vary: this one closes on the start")
        return _value_at(problem, problem.start if kind == "start" else problem.end, which[0])
    values = np.atleast_1d([] if problem.integral is None else np.array(problem.integral))
    many, parts = (values.size, 1) if kind == "integral" else (len(problem.through), 2)
    if kind in ("start", "end") or len(which) != parts or which[0] not in range(many):
        raise ValueError(
            "expected ('start', coordinate), ('end', coordinate), ('through', k, coordinate or "
            "'t') or ('integral', i), numbers that begin at 0, found "
            f"{name!r} with {len(problem.through)} events between the ends and {values.size} given "
            "integrals"
        )
    if kind == "integral":
        return float(values[which[0]])
    return _value_at(problem, problem.through[which[0]], which[1])


def _value_at(problem: Problem, event: Event, what: str) -> float:
    """Return a coordinate that an event gives, or its time, "t"; raise ValueError otherwise."""
    coordinates = problem.system.coordinates
    value = event.near[coordinates.index(what)] if what in coordinates else None
    inner = event not in (problem.start, problem.end)
    value = event.t if inner and what == "t" and what not in coordinates else value
    if value is None:
        given = [c for c, x in zip(coordinates, event.near, strict=True) if x is not None]
        given += ["t"] if inner and event.t is not None else []
        known = f"one of {', '.join(given)}" if given else "but the event gives none"
        raise ValueError(f"expected a coordinate that the event gives, {known}, found {what!r}")
    return value


def with_values(problem: Problem, values: Mapping[Name, float]) -> Problem:
    """Return the problem with other values of quantities, all at once.

    Raises ValueError as a `Problem` does.

    Examples
    --------
    >>> from actionopt import scenes
    >>> pendulum = scenes.get("pendulum").problem
    >>> later = with_values(pendulum, {"g": 1.62, "t1": 2.0, ("end", "theta"): 0.5})
    >>> later.end.t, later.end.q, float(later.parameters["g"])
    (2.0, (0.5,), 1.62)
    """
    problem = problem.original
    events = {"start": list(problem.start.near), "end": list(problem.end.near)}
    moments, parameters = {"t0": problem.start.t, "t1": problem.end.t}, {}
    through = [{"t": e.t, "q": list(e.q)} for e in problem.through]
    integral = None if problem.integral is None else list(np.array(problem.integral))
    coordinates = problem.system.coordinates
    values = dict(values)
    energy = None if "energy" in problem.parameters else values.pop("energy", None)
    for name, value in values.items():
        if isinstance(name, tuple) and name[0] == "integral":
            integral[name[1]] = value  # type: ignore[index]
        elif isinstance(name, tuple) and name[0] == "through":
            if name[2] in coordinates:
                through[name[1]]["q"][coordinates.index(name[2])] = value
            else:
                through[name[1]]["t"] = value
        elif isinstance(name, tuple):
            events[name[0]][coordinates.index(name[1])] = value
        else:
            (moments if name in moments else parameters)[name] = value
    return problem.replace(
        start=_event(problem.start, moments["t0"], events["start"]),
        end=_event(problem.end, moments["t1"], events["end"]),
        parameters=parameters,
        energy=energy,
        through=[e._replace(**new) for e, new in zip(problem.through, through, strict=True)],
        integral=integral,
    )


def position_in_parameters(system: System, name: str) -> int:
    """Return where a parameter of one number stands in the packed row of all."""
    shapes = system.table.shapes
    before = list(shapes)[: list(shapes).index(name)]
    return sum(int(np.prod(shapes[other])) for other in before)


def slope(problem: Problem, known: Mapping[str, Array], name: Name) -> Array:
    """Return dS by a quantity, from those by all events and parameters, named as by `slopes`."""
    system = problem.system
    if not isinstance(name, tuple):
        return (
            known[name]
            if name in ("t0", "t1")
            else known["parameters"][..., position_in_parameters(system, name)]
        )
    if name[0] == "integral":
        return known["integral"][..., name[1]]
    if name[0] == "through" and name[2] not in system.coordinates:
        return known["times"][..., 1 + name[1]]
    if name[0] == "through":
        return known["through_q"][..., name[1], system.coordinates.index(name[2])]
    i = system.coordinates.index(name[1])
    if problem.advance is not None:  # it moves along
        return known["q0"][..., i] + known["q1"][..., i]
    return known["q0" if name[0] == "start" else "q1"][..., i]


def slope_along(solution: Solution, names: Iterable[Name]) -> list[float]:
    """Return the derivatives of S by quantities, NaN where S is no function of these alone.

    So it is with forces that are not conservative, in contact, or where a duration is found.
    """
    problem, names = solution.problem, list(names)
    forced, free_time = problem.system.structure.forced, problem.original.free_time
    if forced or problem.system.r or free_time or not solution.success:
        return [np.nan] * len(names)
    timed = any(name in ("t0", "t1") or name[0] == "through" for name in names)
    times = solution.time_slopes if timed else np.full(2 + len(problem.through), np.nan)
    known = slopes(solution.discrete, solution.momenta, solution.impulses, times)
    known |= {"t0": known["times"][0], "t1": known["times"][-1]}
    return [float(slope(problem, known, name)) for name in names]


def _event(old: Event, t: float, q: list[float | None]) -> Event:
    """Return an event of the same kind at another time and place."""
    if old.advance is not None:
        return old.at(t)
    if t == old.t and q == list(old.q):
        return old
    if old.side:
        return Tail(t, np.array(q, dtype=float), old.side, old.phase)
    return old._replace(t=t, q=q)


def lead_to(path: Path, problem: Problem) -> Path:
    """Return the path stretched over the times of a problem, and sheared to begin and end there.

    As it is where these are infinite.
    """
    if problem.is_infinite or problem.has_tails:
        return path
    values, last = path.values, path.values[:, -1:]
    mesh = path.mesh.moved(*times_over(problem, path.mesh.duration))
    s = mesh.nodes_since / mesh.duration
    for event, weight, known in ((problem.start, 1 - s, values[:, :1]), (problem.end, s, last)):
        given = [[a if b is None else b] for a, b in zip(known[:, 0], event.q, strict=True)]
        values = values + (np.array(given) - known) * weight
    first, longer = path.mesh.boundaries[0], mesh.duration / path.mesh.duration
    passed = tuple(float(mesh.boundaries[0] + longer * (t - first)) for t in path.passed)
    return Path(mesh, values, passed=passed)
