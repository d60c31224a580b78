"""The course of a path: the events at which its legs meet, and the law of each leg.

A path begins at one event, ends at another one and may pass events between them, the joints of its
legs. q is continuous there; what else is follows from the action,

    W = sum S_leg(q; t_j, t_j+1) + sum mu_j.on_j(q_j, t_j) + E (t_N - t_0),

stationary in everything unknown: the momentum p jumps in the coordinates that are given and along
the normal of a surface, and is continuous in the free ones; the energy H is continuous where the
time is free, up to -mu.on_t (the conditions of Weierstrass and Erdmann; Gelfand and Fomin,
*Calculus of Variations* (1963), section 15). Reflection and refraction are such joints.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np

from actionopt.mechanics.canonical import jet_of, rate_of
from actionopt.mechanics.laws.identity import general_points, vanishes
from actionopt.mechanics.laws.laws import keep
from actionopt.mechanics.laws.tracing import STATE, SWITCHES, Symbols
from actionopt.mechanics.question.events import RATES, Bounce, Event, Periodic
from actionopt.mechanics.question.surface import SURFACE_TOLERANCE, Surface, with_surface
from actionopt.mechanics.system import System
from actionopt.tools.shown import brief
from actionopt.tools.types import Array


def take_turns(systems: Sequence[Any]) -> System:
    """Return the system whose law is that of each leg in turn, by the times `SWITCHES`.

    Its Lagrangian, forces and integrals; constraints and obstacles are the same on all legs.
    Parameters of one name and one default value are one; of others each leg keeps its own value.
    Raises ValueError where the systems differ in coordinates, constraints, obstacles or the number
    of integrals.
    """
    for system in systems:
        if not isinstance(system, System):
            raise ValueError(
                f"expected a System, or a sequence of them, one for each leg, found {system!r}"
            )
        if system.coordinates != systems[0].coordinates:
            raise ValueError(
                "expected systems of the same coordinates on all legs, found "
                f"{', '.join(systems[0].coordinates)} and {', '.join(system.coordinates)}"
            )
        if system.g.numel() != systems[0].g.numel():
            raise ValueError(
                "expected as many integrals on all legs, found "
                f"{systems[0].g.numel()} and {system.g.numel()}: each is one along the whole path; "
                "have one that is zero where nothing counts"
            )
    if len(set(systems)) == 1:
        return systems[0]
    shared: dict[str, Array] = {}
    own: set[str] = set()
    for system in systems:
        for name, value in system.table.defaults.items():
            if name in shared and (
                shared[name].shape != value.shape or (shared[name] != value).any()
            ):
                own.add(name)
            shared.setdefault(name, value)
    kept = {name: value for name, value in shared.items() if name not in own}

    forced = any(system.structure.forced for system in systems)

    def build(s: Symbols, named: dict[str, ca.SX], ends: ca.SX) -> tuple[ca.SX, ...]:
        laws = []
        for system in systems:
            values = [
                named[name] if name in kept else ca.SX(ca.DM(value.reshape(-1)))
                for name, value in system.table.defaults.items()
            ]
            L, f, Q, *others = system.laws_of(s.q, s.v, s.t, ca.vertcat(*values))
            none = forced and not Q.numel()
            laws.append((L, f, ca.SX.zeros(len(system.coordinates)) if none else Q, *others))
        _check_alike([ca.vertcat(law[1], law[3]) for law in laws], s)
        found = laws[-1]
        for k, law in reversed(list(enumerate(laws[:-1]))):
            turns = [ca.if_else(s.t < ends[k], x, y) for x, y in zip(law, found, strict=True)]
            found = turns[0], law[1], turns[2], law[3], turns[4]
        return found

    return System.assemble(systems, build, {**kept, SWITCHES: np.zeros(len(systems) - 1)})


def _check_alike(rows: Sequence[ca.SX], s: Symbols) -> None:
    """Raise ValueError where the rows of constraints and obstacles differ from leg to leg."""
    first, *others = rows
    points = general_points(s.q.numel() + s.t.numel() + s.p.numel())
    parts = np.split(points, np.cumsum([s.q.numel(), 1]), axis=1)
    for other in others:
        alike = other.shape == first.shape
        if alike and first.numel():
            alike = vanishes(ca.horzcat(other, -first), [s.q, s.t, s.p], parts)
        if not alike:
            raise ValueError(
                "expected the same constraints and obstacles on all legs, found others: where legs "
                "meet a path would have to keep both; give all of them the same"
            )


def check_shared(problem: Any, names: Iterable[str]) -> None:
    """Raise ValueError for the name of a parameter of which each leg keeps its own value."""
    for name in names:
        own = [law.table.defaults[name] for law in problem.laws if name in law.table.shapes]
        if own and name not in problem.system.table.shapes:
            raise ValueError(
                f"expected parameters that are the same on all legs, found {name!r}, of which the "
                f"systems have the values {', '.join(map(brief, own))}: each leg keeps its own; "
                "call it by another name in each system to change one"
            )


def check_course(problem: Any) -> tuple[Event, ...]:
    """Return the events between the ends, with their surfaces traced.

    Raises ValueError where they do not fit the rest of the question.
    """
    found: list[Event] = []
    surfaces: dict[int, Surface] = {}  # what is met several times is traced once
    for k, event in enumerate(problem.through):
        on = getattr(event, "on", None)
        known = event._replace(on=surfaces[id(on)]) if id(on) in surfaces else event
        found.append(_check_event(problem, k, known))
        if on is not None:
            surfaces[id(on)] = found[-1].on
    known = [(e.t, i) for i, e in enumerate((problem.start, *found, problem.end))]
    times = [x for x in known if x[0] is not None]
    for (a, _), (b, i) in pairwise(times):
        if not a < b:
            what = "the end event" if i == len(known) - 1 else f"event {i - 1} of through"
            raise ValueError(
                f"expected the events of through in the order of their times, between the start "
                f"and the end, found {what} at t = {b} after one at t = {a}; sort them, or change "
                "a time"
            )
    unknown = any(e.t is None or e.on is not None for e in found)
    _refuse(problem, unknown or problem.has_open_ends)
    _check_sides(problem, found)
    return tuple(found)


def _check_event(problem: Any, k: int, event: Any) -> Event:
    """Return an event between the ends with its surface traced. Raises as `check_course`."""
    system, n = problem.system, problem.system.n
    if isinstance(event, Periodic) or not isinstance(event, Event):
        raise ValueError(f"expected Events or Bounces in through, found {event!r} as number {k}")
    if event.t is not None and not np.isfinite(event.t):
        raise ValueError(f"expected finite times in through, found {event.t}")
    if event.q is None:
        event = event._replace(q=[None] * n)
    if len(event.q) != n:
        raise ValueError(
            f"expected {n} coordinates ({', '.join(system.coordinates)}) at event {k} of "
            f"through, found {len(event.q)}"
        )
    if event.on is None and event.t is None and not event.pinned and not event.rates:
        raise ValueError(
            f"expected a time, a coordinate or a surface at event {k} of through, found "
            "nothing given: the path would not have to do anything there; leave it out"
        )
    check_rates(problem, (event,))
    if event.on is None:
        return event
    event, free = with_surface(event, system), n - len(event.pinned)
    if isinstance(event, Bounce) and event.on.count > 1:
        raise ValueError(
            "expected a Bounce off one surface, found that on returns "
            f"{event.on.count} expressions at event {k} of through: no law says how a "
            "path is reflected where they meet; give one of them"
        )
    if event.on.count > free:
        raise ValueError(
            f"expected on at event {k} of through to return at most {free} expressions, "
            f"one for each free coordinate, found {event.on.count}"
        )
    return event


def _check_sides(problem: Any, found: Sequence[Event]) -> None:
    """Raise ValueError where an end lies behind the surface of the Bounce next to it."""
    ends = (problem.start, found[0], "start"), (problem.end, found[-1], "end")
    for event, bounce, role in ends:
        if not isinstance(bounce, Bounce) or event.t is None or None in event.q:
            continue
        q, t = np.array([event.q], dtype=float), np.array([event.t])
        on, by_q, _ = bounce.on.along(q, t, problem.packed)
        if on[0, 0] < -SURFACE_TOLERANCE * float(np.abs(by_q[0, 0] * q[0]).sum()):
            raise ValueError(
                f"expected the {role} where on > 0, found on = {on[0, 0]:.6g} of the Bounce next "
                f"to it at t = {event.t:g}, q = {event.q}: the path stays where on is positive; "
                "give -on where the other side is meant"
            )


def check_rates(problem: Any, events: Sequence[Event]) -> None:
    """Raise ValueError where events give derivatives that the Lagrangian leaves to the motion.

    And for what does not go with a Lagrangian of higher order.
    """
    system, n = problem.system, problem.system.n
    for event in events:
        unknown, closed = event.t is None or event.on is not None, isinstance(event, Periodic)
        if system.order > 1 and ((system.m and (unknown or closed)) or (system.r and closed)):
            what = "times and places of events" if system.m else "an end that is given"
            beside = "constraints stand" if system.m else "an obstacle stands"
            raise ValueError(
                f"expected {what} where {beside} beside a Lagrangian with accelerations, found "
                f"{event!r}: what they do to a time that is found, or round a closed path, is not "
                "known there; "
                + ("use coordinates that need none" if system.m else "give an end, Event(t, q)")
            )
        if len(event.rates) >= system.order:
            name = RATES[len(event.rates) - 1]
            raise ValueError(
                f"expected an event without {name}=, found one that gives it: the highest "
                f"derivative in the Lagrangian is {STATE[system.order]}, so that the motion "
                f"decides {name}; leave it out"
                + ("; for a motion from initial values see ao.integrate" * (name == "v"))
            )
        for name, row in zip(RATES, event.rates, strict=False):
            if row is not None and len(row) != n:
                raise ValueError(
                    f"expected {n} values of {name} ({', '.join(system.coordinates)}) at an event, "
                    f"found {len(row)}"
                )
        if system.order > 1 and isinstance(event, Bounce):
            raise ValueError(
                "expected no Bounce of a Lagrangian with accelerations, found one: velocities are "
                "continuous along its paths, so that nothing is reflected"
            )
        if system.order > 1 and math.isinf(event.t or 0):
            raise ValueError(
                "expected events at finite times of a Lagrangian with accelerations, found "
                f"{event!r}; give a finite time, long beside those in which paths come to rest"
            )


def rates_of_constraints(system: System) -> list[ca.SX]:
    """Return the constraints and their rates that motions keep of what an event may give."""
    rows = [system.f]
    for _ in range(1, system.order):
        rows.append(rate_of(system, rows[-1]))
    return rows


@keep
def jet_normals(system: System) -> ca.Function:
    """Return by what constraints hold q and its rates below the order: (m r, n r) at (y, t, p)."""
    known = ca.vertcat(*jet_of(system)[: system.order])
    rows = ca.jacobian(ca.vertcat(*rates_of_constraints(system)), known)
    arguments = [known, system.symbols.t, system.symbols.p]
    return ca.Function("jet_normals", arguments, [ca.densify(rows)])


def check_rates_on_constraints(problem: Any) -> None:
    """Raise ValueError where what is given at an event leads off the constraints' surface."""
    system, order = problem.system, problem.system.order
    for k, rows in enumerate(rates_of_constraints(system)):
        known = ca.vertcat(*jet_of(system)[: k + 1])
        size = ca.fabs(ca.jacobian(rows, known)) @ ca.fabs(known)
        arguments = [known, system.symbols.t, system.symbols.p]
        function = ca.Function("rates", arguments, [rows, size])
        for event in problem.joints_found:
            places = event.places(order)[: known.numel()]
            if None in places:
                continue
            found, unit = (np.array(x) for x in function(places, event.t, problem.packed))
            if not (np.abs(found) <= SURFACE_TOLERANCE * (unit + np.abs(unit).max())).all():
                off = float(np.abs(found).max())
                raise ValueError(
                    f"expected events whose {('q', *RATES)[k]} keeps the constraints, found "
                    f"{event!r}: the derivative {k} of one of them is {off:.6g} there; correct it, "
                    "or leave a coordinate of it free (None)"
                )


def _refuse(problem: Any, unknown: bool) -> None:
    """Raise ValueError for what does not go with events between the ends."""
    system = problem.system
    if problem.leads_to_rest and unknown:
        raise ValueError(
            "expected events between the ends at given times and places where an end lies at "
            "infinite time, found a time or place that is to be found: a path may come from rest "
            "at any time; give times and coordinates, or finite times"
        )
    if problem.leads_to_rest and problem.laws:
        raise ValueError(
            "expected one system where an end lies at infinite time, found several laws: where a "
            "path rests is sought with one law for all times; give finite times"
        )
    if system.r and any(isinstance(event, Bounce) for event in problem.through):
        raise ValueError(
            "expected no Bounce for a path along an obstacle, found one: what an obstacle holds is "
            "a least path, and a path that is reflected could be shortened; leave out one of both"
        )
    if unknown and system.structure.forced:
        raise ValueError(
            "expected a system without non-conservative forces where times or places of events are "
            "to be found, found one that has some: a time or a place is found where the "
            "action is stationary in it, and with such forces none is; give both, or ask for the "
            "motion forward (`ao.integrate`)"
        )
    if unknown and system.clock is not None and not problem.laws:
        raise ValueError(
            "expected a Lagrangian without branches in the time where times or places of events "
            "are to be found, found one that has some; give one system for each leg instead"
        )


def check_phase(problem: Any) -> None:
    """Raise ValueError where not one thing tells where a closed path begins."""
    if problem.closes:
        if problem.start.rates:
            raise ValueError(
                "expected a start of a closed path that gives no derivatives, found "
                f"{problem.start!r}: begun anywhere along itself it may have any of these; give a "
                "coordinate that it has at its start, or nothing"
            )
        return
    timed = any(e.t is not None for e in problem.through)
    if not (problem.start.pinned or timed):
        raise ValueError(
            "expected something that tells where a closed path through events begins, found no "
            "coordinate at the start, no time of an event and no clock; give a coordinate that the "
            "path has at its start, such as Event(0, [0, None])"
        )
    # With accelerations in L the start is then as one more waypoint: no velocity jumps there.
    if problem.start.pinned and timed and problem.system.order == 1:
        raise ValueError(
            "expected a start that gives no coordinate of a closed path whose events have given "
            "times, found one that does: they tell where it begins, and it would return in a "
            "kink; leave the coordinates of the start free, or the times"
        )


def check_free(problem: Any, what: str) -> None:
    """Raise ValueError for a path of given integrals, or of a Lagrangian with accelerations.

    Where `what` is not known of one.
    """
    problem.system.check_order(what)
    if problem.integral is not None:
        raise ValueError(
            f"expected a path of which no integral is given, found one: {what} is not known with "
            "multipliers that change; by a value S changes by -solution.integral_multipliers"
        )


def check_whole(problem: Any, what: str) -> None:
    """Raise ValueError for a path through events, and as `check_free`."""
    if problem.through:
        raise ValueError(
            f"expected a path without events between its ends, found one through "
            f"{len(problem.through)}: {what} is known of its parts alone; ask each of them, "
            "solution.parts, or a problem between two of the events"
        )
    check_free(problem, what)


def sides(problem: Any) -> list[tuple[int, int, int]]:
    """Return triples to check: joint, leg, and the sign that `on` has along it.

    A path that bounces stays where on > 0, on all legs of one law around the joint. Where laws of
    legs take turns at a surface it is crossed: the sign after is that before, reversed (a sign of
    zero says that: the one before is whatever it is).
    """
    found = []
    laws = problem.laws or (problem.system,) * (len(problem.through) + 1)
    for j, event in enumerate(problem.joints[1:-1]):
        if isinstance(event, Bounce):
            low, high = j, j + 1
            while low and laws[low - 1] is laws[j]:
                low -= 1
            while high + 1 < len(laws) and laws[high + 1] is laws[j + 1]:
                high += 1
            found += [(j + 1, leg, 1) for leg in range(low, high + 1)]
        elif event.on is not None and laws[j] is not laws[j + 1]:
            found += [(j + 1, j, 0), (j + 1, j + 1, 0)]
    return found
