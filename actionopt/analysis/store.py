"""Solutions read from files, and not believed before their numbers agree with one another.

A file holds the path, the ends, the parameters and the verdict. Physics is code and stays out:
to evaluate momenta or energies again, the system (or the name of its scene) is supplied on
loading.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Any, cast

import casadi as ca
import numpy as np

from actionopt import scenes
from actionopt.analysis.saved import ARRAYS, HIGHER, SINCE, SOLUTION_FORMAT, Detached
from actionopt.analysis.solution import Ends, Solution
from actionopt.analysis.status import Status
from actionopt.discrete.action.action import ActionUnits
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.meshes.boundaries import find_boundaries, split
from actionopt.discrete.meshes.mesh import Mesh, restore_mesh, with_singular_ends
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.newton.discrete_path import DiscretePath, Unknowns
from actionopt.mechanics.laws.tracing import MULTIPLIERS, SWITCHES
from actionopt.mechanics.question.events import Bounce, Event, State
from actionopt.mechanics.question.held import Held, arcs_of
from actionopt.mechanics.question.problem import Problem
from actionopt.mechanics.question.scales import NEGLIGIBLE
from actionopt.mechanics.question.surface import Surface
from actionopt.mechanics.system import System
from actionopt.tools.types import Array

# What a file must say twice, relative to its size. Ad hoc: far above the round-off of another
# machine's, far below what another problem would say; for velocities a small mass amplifies it.
SAME_EVALUATION, SAME_ENDS = 1e-9, 1e-6
# How far velocities at the ends may be from the polynomial's, in units of the largest velocity:
# 0.008 where L has a kink at an event; and this many times `velocity_error`, 0.42 on coarse meshes.
SLOPE_ERROR, SLOPE_SAFETY = 0.1, 10.0


def load(file: str | FilePath, system: System | Sequence[System] | str | None = None) -> Solution:
    """Read a solution that `save` wrote.

    Parameters
    ----------
    file : str or path
    system : System, sequence of System, or str, optional
        The system, those of the legs, or the name of the scene it belongs to. Without it a scene is
        looked up by the name in the file; if there is none, the path, the ends and the verdict are
        there but quantities that need the Lagrangian raise ValueError.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If it is damaged or was not written by `save`, its numbers contradict one another, or the
        system's coordinates or parameters are not those in the file.
    """
    several = isinstance(system, Sequence) and all(isinstance(x, System) for x in system)
    if not (system is None or isinstance(system, (System, str)) or several):
        raise ValueError(f"expected a System or the name of a scene, found {system!r}")
    try:
        found = _read(FilePath(file))
    except FileNotFoundError as error:
        raise FileNotFoundError(
            f"expected a file of a solution, found none at {str(file)!r}; `solution.save` writes "
            "one"
        ) from error
    except Exception as error:  # there is no end to the ways in which a file can be damaged
        raise _file_error(file, error) from error
    loaded = _answer(found, system)
    if loaded is None:
        return found
    try:
        _check_physics(replace(loaded, ends=None), found)
    except ValueError as error:
        raise _file_error(file, error) from error
    return loaded


def _file_error(file: str | FilePath, error: Exception) -> ValueError:
    """Return what to raise for a file that is not one of these, or was cut short."""
    why = str(error) if str(error).startswith("expected") else type(error).__name__
    return ValueError(
        f"expected an .npz file written by Solution.save, found {str(file)!r}, which is "
        f"damaged or something else ({why}); solve and save again"
    )


def _read(file: FilePath) -> Solution:
    """Return the solution in a file, its problem `Detached`; raise anything if there is none."""
    with open(file, "rb") as stream:
        if stream.read(2) != b"PK":  # numpy would advise to load it in another, unsafe way
            raise ValueError("expected a zip archive")
        stream.seek(0)
        with np.load(stream, allow_pickle=False) as arrays:
            about = json.loads(str(arrays["about"]))
            names = ARRAYS if about.get("units") is None else (*ARRAYS, *HIGHER)
            names = (*names, SINCE) if SINCE in arrays else names
            data = {name: arrays[name] for name in names}
    if about["format"] != SOLUTION_FORMAT:
        raise ValueError(f"expected the format {SOLUTION_FORMAT!r}, found {about['format']!r}")
    for name in names:
        if data[name].dtype.kind not in "fiu":
            raise ValueError(f"expected real numbers as {name}, found {data[name].dtype}")
    if about["status"] not in Status.__members__:
        raise ValueError(
            f"expected one of the statuses {', '.join(Status.__members__)}, found "
            f"{about['status']!r}"
        )
    problem = Detached(about)
    mesh = _mesh(data)
    start, end = about.get("singular", mesh.singular_ends)  # no file of a regular path has them
    mesh = with_singular_ends(mesh, (int(start), int(end)))
    passed = tuple(event.t for event in problem.through)
    path, unknowns = Path(mesh, data["values"], data.get("rates"), passed), None
    n, nodes = len(problem.coordinates), mesh.nodes.size
    shapes = [len(problem.start.q), len(problem.end.q), path.values.shape[0]]
    p, v = data["momenta"].shape, data["velocities"].shape
    ends = v in ((2, n), (2 * len(problem.through) + 2, n)) and p == (2, p[-1]) and p[-1] % n == 0
    if about.get("units") is not None:
        unknowns = _unknowns(data["unknowns"], about["units"])
        ends &= p[-1] > n and path.values.shape == data["rates"].shape
        ends &= unknowns.lengths.shape == (n,) and unknowns.z.ndim == 1
    else:
        ends &= p[-1] == n
    single = data["action"].shape == data["error"].shape == ()
    if shapes != [n, n, n] or not ends or not single or data["lam"].shape[1:] != (nodes,):
        raise ValueError("expected arrays of shapes that belong together")
    found = Solution(
        cast(Problem, problem),
        path,
        float(data["action"]),
        data["lam"],
        float(data["error"]),
        Status[about["status"]],
        dict(about["stats"]),
        _ends(path, problem, data["velocities"], data["momenta"], unknowns),
    )
    _check_ends(found)
    if found.success:
        _check_numbers(found)
    return found


def _mesh(data: dict[str, Array]) -> Mesh:
    """Return the mesh of a file. Raises ValueError if its times contradict one another."""
    boundaries, degrees, since = data["boundaries"], data["degrees"], data.get(SINCE)
    if since is None:
        return Mesh(boundaries, degrees)
    if since.shape != boundaries.shape:
        raise ValueError("expected as many times from the start as boundaries")
    slack = SAME_EVALUATION * since[-1] + 2 * np.spacing(np.abs(boundaries[[0, -1]]).max())
    if since[0] != 0 or not np.all(np.abs(boundaries[0] + since - boundaries) <= slack):
        raise ValueError("expected boundaries that are the start and the times from it")
    return restore_mesh(boundaries, since, degrees)


def _unknowns(z: Array, units: dict[str, Any]) -> Unknowns:
    """Return the unknowns that `save` kept of a path whose Lagrangian contains accelerations.

    Raises ValueError for numbers that are not finite, and units that are not positive.
    """
    known = {k: np.array(x, dtype=float) for k, x in units.items() if x is not None}
    positive = ("lengths", "action_unit", "row_units", "rate")
    if not (np.isfinite(z).all() and all(np.all(known[k] > 0) for k in positive)):
        raise ValueError("expected finite unknowns, and units that are positive")
    lengths, origin = known.pop("lengths"), known.pop("origin", None)
    S, rate = float(known.pop("action_unit")), float(known.pop("rate"))
    return Unknowns(z, lengths, ActionUnits(origin, action_unit=S, rate=rate, **known))


def _check_ends(solution: Solution) -> None:
    """Raise ValueError if a path does not begin and end at its events, or close as it should."""
    problem, mesh, values = solution.problem, solution.mesh, solution.path.values
    times = np.array([problem.start.t, problem.end.t])
    joints = problem.joints_found
    inner = find_boundaries(mesh, np.array([e.t for e in joints[1:-1]]))
    if not np.all(np.abs(mesh.boundaries[[0, -1]] - times) <= SAME_EVALUATION * problem.duration):
        raise ValueError(
            f"expected a path from t = {times[0]} to {times[1]}, the times of its events, found "
            f"one from {mesh.boundaries[0]} to {mesh.boundaries[-1]}"
        )
    n, rates = len(values), solution.path.velocities
    table = values if rates is None else np.concatenate([values, rates])
    off = SAME_EVALUATION * np.max(np.abs(table), axis=1)
    for k, event in zip(mesh.offsets[[0, *inner, -1]], joints, strict=True):
        for i, given in enumerate(event.places(len(table) // n)):
            if given is not None and not abs(table[i, k] - given) <= off[i]:
                name = f"coordinate {i}" if i < n else f"the velocity of coordinate {i - n}"
                raise ValueError(
                    f"expected a path through its events, found {name} = {table[i, k]} "
                    f"where the event has {given}"
                )
    if problem.advance is not None:
        turned = values[:, -1] - values[list(problem.order), 0]
        if not np.all(np.abs(turned - problem.advance) <= off[:n]):
            raise ValueError(
                f"expected a path that closes with the advance {problem.advance}, found {turned}"
            )


def _check_numbers(found: Solution) -> None:
    """Raise ValueError if the numbers of a successful solution cannot be true."""
    if not (np.isfinite(found.action) and found.error >= 0):
        raise ValueError(
            "expected a finite action and an error estimate that is not negative, found "
            f"{found.action} and {found.error}"
        )
    momenta = zip(found.momenta, found.mesh.singular_ends, strict=True)
    if not all(np.isfinite(p).all() or (end and not np.isinf(p).any()) for p, end in momenta):
        raise ValueError(f"expected finite momenta, found {found.momenta}")
    rows = found.stats.get("rows")
    given = np.isfinite(found.lam).sum()
    if found.path.velocities is not None:  # multipliers are functions as paths are
        rows = given if rows else found.lam.size
    if np.any(np.isinf(found.lam)) or rows not in (None, given):
        raise ValueError(f"expected multipliers of {rows} rows of constraints, found {given}")
    if not isinstance(found.stats.get("gain", 1.0), (int, float)):
        raise ValueError(f"expected a number as the gain, found {found.stats['gain']!r}")
    ends = found.mesh.boundaries[[0, -1]]
    slopes = found.path.velocity(ends).T
    allowed = SLOPE_ERROR + SLOPE_SAFETY * found.velocity_error
    velocities = np.array([found.start.v, found.end.v])
    if np.any(np.abs(velocities - slopes) > allowed * _speeds(found)):
        raise ValueError(
            f"expected velocities at the ends near those of the path, {slopes.tolist()}, found "
            f"{velocities.tolist()}"
        )


def _speeds(solution: Solution) -> Array:
    """Return the largest velocity of each coordinate, (n,), or its size over the duration."""
    values, nodes = solution.path.values, solution.mesh.nodes
    sizes = np.max(np.abs(values), axis=1)
    sizes = np.maximum(sizes, NEGLIGIBLE * np.max(sizes)) / solution.problem.duration
    speeds = np.maximum(np.max(np.abs(solution.path.velocity(nodes)), axis=1), sizes)
    return np.where(speeds > 0, speeds, 1 / solution.problem.duration)


def _check_physics(fresh: Solution, found: Solution) -> None:
    """Raise ValueError if path, multipliers, momenta and velocities are not those of the system.

    `fresh` has nothing but the path, or its unknowns, and its system, and derives the rest.
    """
    for name in ("values", "velocities"):
        a, b = getattr(fresh.path, name), getattr(found.path, name)
        if a is not b and not np.all(np.abs(a - b) <= SAME_EVALUATION * np.max(np.abs(a))):
            raise ValueError(f"expected the {name} of the path that its unknowns tell")
    m = fresh.problem.system.m + fresh.problem.system.r
    if found.lam.shape[0] != m:
        raise ValueError(f"expected multipliers of {m} constraints, found {found.lam.shape[0]}")
    if not found.success:
        return
    p = np.abs(fresh.momentum(fresh.mesh.nodes))
    p = np.where(np.isfinite(p), p, 0.0)  # infinite ones say nothing of the others' sizes
    tr = fresh.discrete.tr
    units = np.maximum(np.max(p, axis=1), tr.action_unit / tr.place_units)
    speeds = _speeds(fresh)
    for role, a, b, unit in (
        ("momenta", fresh.momenta, found.momenta, units),
        ("velocities", (fresh.start.v, fresh.end.v), (found.start.v, found.end.v), speeds),
    ):
        off = np.subtract(np.nan_to_num(a), np.nan_to_num(b))  # NaN where L is infinite at an end
        if not np.all(np.abs(off) <= SAME_ENDS * unit):
            raise ValueError(
                f"expected the {role} of the system at the ends of the path, "
                f"{np.array(a).tolist()}, found {np.array(b).tolist()}"
            )


def _ends(
    path: Path, problem: Detached, velocities: Array, momenta: Array, unknowns: Unknowns | None
) -> Ends:
    """Return states and momenta at the ends from the file: a solution derives them from its system.

    Raises ValueError if the velocities at the ends of legs are not finite rows (n,).
    """
    b, values = path.mesh.boundaries, path.values
    whole = zip(b[[0, -1]], values.T[[0, -1]], velocities[[0, -1]], strict=True)
    start, end = (State(t, q, v) for t, q, v in whole)
    if not np.isfinite(velocities).all():
        raise ValueError(f"expected finite velocities, found {velocities.tolist()}")
    if problem.through and len(velocities) == 2:  # an older file
        legs = split(path, [e.t for e in problem.through])
        known = np.array([leg.velocity(leg.mesh.boundaries[[0, -1]]).T for leg in legs])
        known[0, 0], known[-1, 1] = velocities
        velocities = known
    p0, p1 = (np.array(p, dtype=float) for p in momenta)
    for p in (p0, p1):
        p.setflags(write=False)
    return Ends((start, end), (p0, p1), velocities.reshape(-1, 2, len(values)), unknowns)


def _question(known: Detached, system: System | Sequence[System]) -> Problem:
    """Return the problem of a file, its system given, with what was found in it."""
    found, asked = known.joints_found, known.asked
    if isinstance(system, System) and SWITCHES in set(known.parameters) - set(system.table.shapes):
        raise ValueError(
            f"expected the systems of {len(found) - 1} legs, found one system; give them in the "
            "order of the legs, load(file, [one, other])"
        )
    given = {k: x for k, x in known.parameters.items() if k not in (SWITCHES, MULTIPLIERS)}
    events = list(found)
    if asked is not None:
        surfaces = asked.get("on", [None] * len(found))  # an older file has none
        events = [_event_asked(known, *x) for x in zip(found, asked["free"], surfaces, strict=True)]
    question = Problem(
        system,  # type: ignore[arg-type]
        events[0],
        events[-1],
        parameters=given,
        energy=known.energy,
        through=events[1:-1],
        integral=known.integral,
    )
    if asked is None:
        return question
    kappa = known.parameters.get(MULTIPLIERS)
    return question.found_at([e.t for e in found], [e.q for e in found], kappa)


def _event_asked(known: Detached, event: Event, free: bool, on: list[Any] | None) -> Event:
    """Return an event as it was asked for, from the one that was found.

    Raises ValueError for a surface that was written with another CasADi, which this cannot read.
    """
    t = None if free else event.t
    if on is None:
        return event.at(t)
    law, q, *bounces = on  # an older file has no reflections
    shapes = {name: np.shape(x) for name, x in known.parameters.items()}
    try:
        surface = Surface(ca.Function.deserialize(law), shapes)
        return Bounce(surface, t, q) if any(bounces) else event._replace(t=t, q=q, on=surface)
    except RuntimeError as error:
        raise ValueError(
            f"expected the surface of an event that CasADi {ca.CasadiMeta.version()} can read, "
            "found one of another version; solve and save again"
        ) from error


def _discrete(found: Solution, problem: Problem) -> DiscretePath:
    """Return the path on its mesh, as it was found where L contains accelerations.

    Raises ValueError for a system of which these are not the unknowns.
    """
    assert found.ends is not None
    unknowns = found.ends.unknowns
    if unknowns is None:
        return DiscretePath.of(problem, found.path, lengths=problem.lengths)
    asked: Problem = problem
    if problem.system.r:
        rows = np.isfinite(found.lam[problem.system.m :])
        asked = Held(problem, arcs_of(rows, found.mesh.boundaries, found.mesh.offsets))
    tr = Transcription(asked, found.mesh, unknowns.lengths)
    shapes = [
        [None if x is None else np.shape(x) for x in units] for units in (tr.units, unknowns.units)
    ]
    if shapes[0] != shapes[1] or unknowns.z.size != tr.layout.size:
        raise ValueError(
            f"expected a system of {unknowns.z.size} unknowns on the mesh of the file, in units of "
            f"shapes {shapes[1]}, found {tr.layout.size}, {shapes[0]}"
        )
    return DiscretePath.restore(asked, found.mesh, unknowns)


def _answer(found: Solution, system: System | Sequence[System] | str | None) -> Solution | None:
    """Return a solution whose system is given, or is the scene of the same name.

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
        for one in [system] if isinstance(system, System) else system:
            if one.coordinates != known.coordinates:
                raise ValueError(
                    f"expected a system of the coordinates {', '.join(known.coordinates)} in the "
                    f"file, found {', '.join(one.coordinates)}"
                )
            order = found.momenta[0].size // one.n
            if one.order != order:
                raise ValueError(
                    f"expected a system of order {order}, that of the highest derivative in the "
                    f"Lagrangian of the file, found one of order {one.order}"
                )
        problem = _question(known, system)
        at = _discrete(found, problem)
        action, S = at.action, found.action
        # A failed attempt may have an infinite one, or none.
        alike = action == S or (np.isnan(action) and np.isnan(S))
        if not (alike or abs(action - S) <= SAME_EVALUATION * max(abs(S), at.tr.action_unit)):
            raise ValueError(
                f"expected the system of the file, whose action on its path is {S}, found "
                f"a system that gives {action}"
            )
    except ValueError:
        if guessed:  # another system of that name
            return None
        raise
    if problem.system.order == 1:
        return replace(found, problem=problem)
    return replace(found, problem=problem, path=at.path, known=at)
