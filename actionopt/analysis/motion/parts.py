"""The parts of a path, between events and between contacts, each as an answer of its own."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any, Protocol

import numpy as np

from actionopt.analysis.motion.flow import ZERO_SIZE
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.meshes.boundaries import find_boundaries
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.mechanics.question.events import Bounce, Event, State
from actionopt.mechanics.question.held import Held, arcs_of
from actionopt.mechanics.question.obstacle import Arc, put_on_obstacle
from actionopt.mechanics.question.problem import Problem
from actionopt.mechanics.reflection import leave
from actionopt.tools.immutable import immutable
from actionopt.tools.types import Array


@immutable
class Part:
    """What a part of a path has of its own, as the attributes of `Solution`."""

    problem: Problem
    path: Path
    action: float
    lam: Array
    known: DiscretePath | None


class AnsweredLeg(Protocol):
    """A part that tells its states at its ends."""

    @property
    def problem(self) -> Problem:
        """The question, with the system in force."""
        ...

    @property
    def start(self) -> State:
        """The state after the event at its start."""
        ...

    @property
    def end(self) -> State:
        """The state before the event at its end."""
        ...


def legs(at: DiscretePath, pieces: Sequence[Path], lam: Array) -> Iterator[Part]:
    """Yield the legs between events, of which the curves are known, and the multipliers (m, K)."""
    problem, mesh, tr = at.problem.free, at.mesh, at.tr
    nodes, n = tr.joints.tolist(), problem.system.n
    systems = problem.laws or (problem.system,) * len(pieces)
    places = tr.place(at.x).places
    for system, leg, (a, b) in zip(systems, pieces, pairwise(nodes), strict=True):
        times = mesh.nodes[[a, b]]
        ends = [Event(t, q) for t, q in zip(times, leg.values.T[[0, -1]], strict=True)]
        if system.order > 1:
            ends = [Event.of_places(float(mesh.nodes[k]), places[k], n) for k in (a, b)]
        if problem.integral is not None:
            system = system.with_multipliers if problem.laws else problem.system
        given = {k: x for k, x in problem.parameters.items() if k in system.table.shapes}
        part, own = Problem(system, *ends, parameters=given), lam[:, a : b + 1]
        action, known = DiscretePath.of(part, leg).action, None
        if system.order > 1:  # derivatives are not read from values
            held, touching = part, np.isfinite(own[system.m :])
            if touching.any():
                held = Held(part, arcs_of(touching, leg.mesh.boundaries, leg.mesh.offsets))
            tr_of = Transcription(held, leg.mesh, tr.lengths)
            known = DiscretePath(tr_of, tr_of.unknowns_of(places[a : b + 1]))
        yield Part(part, leg if known is None else known.path, action, own, known)


def cut_at_contacts(at: DiscretePath, contacts: tuple[Arc, ...]) -> Iterator[Part]:
    """Yield the parts of a path with accelerations between events, and begins and ends of contact.

    Along an arc the rows of the obstacle that are in force are constraints.
    """
    problem, mesh, tr = at.problem.free, at.mesh, at.tr
    times = [t for arc in contacts for t in (arc.begin, arc.end)]
    events = [e.t for e in problem.joints_found]
    held, n, places = Held(problem, contacts), problem.system.n, tr.place(at.x).places
    for a, b in pairwise(find_boundaries(mesh, np.union1d(times, events)).tolist()):
        first, last = mesh.offsets[[a, b]]
        begin, end = mesh.boundaries[[a, b]].tolist()
        rows = np.flatnonzero(held.active(np.array([(begin + end) / 2]))[:, 0]).tolist()
        law = problem.system.with_obstacle_rows(tuple(rows))
        ends = [
            Event.of_places(t, put_on_obstacle(law, places[k], t, problem.packed), n)
            for k, t in ((first, begin), (last, end))
        ]
        part = Problem(law, *ends, parameters=problem.parameters)
        arcs = tuple(Arc(i, begin, end) for i in range(len(rows)))
        of_part = Transcription(Held(part, arcs) if arcs else part, mesh.part(a, b), tr.lengths)
        known = DiscretePath(of_part, of_part.unknowns_of(places[first : last + 1]))
        lam = np.zeros((len(rows), last - first + 1))
        yield Part(part, known.path, known.action, lam, known)


def law_deviation(problem: Problem, parts: Sequence[AnsweredLeg], sizes: Array) -> float:
    """Return how far the legs are from those that leave events as the law says (`leave`).

    That is at the end of each, to first order, in the coordinates' `sizes` (n,). Events on one
    surface count, anywhere on it and at any time: others may be kicks.
    """
    found = 0.0
    size = np.where(sizes > ZERO_SIZE * sizes.max(), sizes, sizes.max() or 1.0)
    events: Sequence[Any] = problem.original.through
    for event, one, other in zip(events, parts[:-1], parts[1:], strict=True):
        if event.on is None or event.on.count > 1 or event.pinned or event.t is not None:
            continue
        at, (before, after) = one.end, (one.problem, other.problem)
        laws = (before.system, before.packed), (after.system, after.packed)
        if before.system is after.system:
            laws = laws[0], laws[0]
        _, by_q, by_t, _ = event.on.at(at.q, at.t, problem.packed)
        state = at.q[None], at.v[None], np.array([[at.t]])
        # At a surface that is no wall both satisfy the equations.
        ways = (True,) if isinstance(event, Bounce) else (True, False)
        out = [leave(laws, state, (by_q, by_t), bounces=way)[0] for way in ways]
        off = [np.abs((v - other.start.v) / size).max() * after.duration for v in out]
        found = max(found, float(np.nan_to_num(np.nanmin([np.inf, *off]), nan=np.inf)))
    return found
