"""First paths through events on surfaces: motions that come near the end, of many that are traced.

Motions leave the start in all directions and at many speeds (`ray_tracing`). What comes near the
end, in about the time that is given, is a guess. About those that come nearest, or get farthest,
more leave, ever closer to them, and between neighbours whose ways part: after some bounces few of
the first directions are left.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import chain, combinations, islice
from typing import NamedTuple

import numpy as np

from actionopt.mechanics.question.events import Bounce
from actionopt.mechanics.question.problem import Problem
from actionopt.solver.kinds.ray_tracing import (
    EVENT_MISSED,
    RAYS,
    ClosedRayTracer,
    RayTracer,
    TracedRays,
    Track,
)
from actionopt.tools.types import Array, NDInt

# Ad hoc.
RAY_ROUNDS = 4  # of motions ever closer to those that come nearest
BEST_RAYS = 40  # motions about which more leave, and that are brought back to where they began
RAY_NEIGHBOURS = 2  # a coordinate, with which a motion is compared
RAY_APART = 0.3  # of the sizes: places of events that are farther from a neighbour's
RAY_SPREAD = 0.5  # of the distance of these, of velocities that are nearer
# Durations that are tried where the energy is given, each so many times the last, as long as more
# motions meet all events.
LONGER_SPANS, SPAN_FACTOR = 3, 4.0
FASTER_RAYS = 3  # times that factor faster, at most, where no motion meets the first event
RAY_NEAR = 0.05  # a smaller one, in these sizes, is told at once
MOST_WAYS_ON = 8  # all choices of three events


class Ray(NamedTuple):
    """A motion through events."""

    times: Array  # (k + 2,)
    places: Array  # (k + 2, n)
    legs: list[Track]  # of it alone

    def values(self, leg: int, parts: Array) -> Array:
        """Return coordinates (K, n) at parts (K,) of the time of a leg."""
        track = self.legs[leg]
        t = self.times[leg] + parts * (self.times[leg + 1] - self.times[leg])
        i = np.searchsorted(track.times[:, 0], t, side="right") - 1
        i = np.clip(i, 0, len(track.times) - 2)
        return track.at(i, np.zeros_like(i), t)[0]


def ways_on(problem: Problem) -> Iterator[tuple[int, ...]]:
    """Yield the events at which motions are thrown back: none first, then few choices of them.

    Where a surface is met at a time that is found and the law does not change, the motion that
    passes and the one that is thrown back are both stationary.
    """
    laws = problem.laws or (problem.system,) * (len(problem.through) + 1)
    either = [
        k
        for k, event in enumerate(problem.through, start=1)
        if not isinstance(event, Bounce)
        and event.on is not None
        and event.t is None
        and laws[k - 1] is laws[k]
    ]
    choices = (combinations(either, count) for count in range(len(either) + 1))
    yield from islice(chain.from_iterable(choices), MOST_WAYS_ON)


def rays(
    problem: Problem,
    size: Array,
    span: float,
    random: np.random.Generator,
    rounds: int,
    thrown: tuple[int, ...] = (),
) -> Iterator[Ray]:
    """Yield motions through the events of a problem that come near its end, the nearest ones first.

    `size` (n,) is that of the coordinates, `span` about how long it takes; motions are `thrown`
    back at these events (`ways_on`). There are none where motions do not lead from event to event:
    coordinates of the start are free and the path does not close, or an event between the ends is
    no surface. Nor under constraints, whose impulses no law of reflection here has, nor where L
    contains accelerations: more is to be chosen at the start.
    """
    if not _leads_on(problem):
        return
    tracer = ClosedRayTracer if problem.advance is not None else RayTracer
    tracer = replace(tracer.of(problem, size, span), thrown=thrown)
    tracer, batch = _all_round(tracer, random, longer=problem.energy is not None)
    found = RaySearch(tracer)
    for k in range(rounds + 1):
        found.add(batch)
        back = tracer.bring_back(found.u[found.minima()[:BEST_RAYS]])
        if back.size:
            found.add(tracer.follow(back))
        yield from found.nearest(RAY_NEAR if k < rounds else EVENT_MISSED)
        if k < rounds:
            u = np.concatenate([found.closer(random, RAYS // 2), found.between(RAYS // 2)])
            batch = tracer.follow(tracer.of_energy(u))


def _leads_on(problem: Problem) -> bool:
    """Whether motions from the start lead from event to event."""
    start, *inner, _ = problem.joints_found
    system, closed = problem.system, problem.advance is not None
    given = len(start.pinned) == system.n or (closed and start.on is None)
    free = system.order == 1 and not (system.structure.forced or system.m)
    surfaces = all(e.on is not None and e.on.count == 1 for e in inner)
    return bool(inner) and given and free and surfaces


def _all_round(
    tracer: RayTracer, random: np.random.Generator, *, longer: bool
) -> tuple[RayTracer, TracedRays]:
    """Return motions that leave to all sides, and the tracer of those that come through the events.

    Over a duration of its own, `longer` if more come through then.
    """
    first = tracer.all_round(random)
    batch = tracer.follow(first)
    if tracer.timed:
        for _ in range(FASTER_RAYS):
            if np.isfinite(batch.times[:, 1]).any():
                break
            first[:, -tracer.size.size :] *= SPAN_FACTOR  # a force carries all of them back
            batch = tracer.follow(first)
        u = tracer.in_time(batch)
        return tracer, batch if u is batch.u else tracer.follow(u)
    # What straight lines take says little of how long motions take that return to a surface.
    other = tracer
    for _ in range(LONGER_SPANS if longer else 0):
        other = replace(other, span=SPAN_FACTOR * other.span)
        found = other.follow(other.all_round(random))
        if np.count_nonzero(found.through) > np.count_nonzero(batch.through):
            tracer, batch = other, found
        elif batch.through.any():
            break
    return tracer, batch


class RaySearch:
    """All motions that were followed: their states and those nearest to each, what each costs.

    With the states u (K, M) and the costs (K,) go `where` (K, k + 2, n + 1) their events are, in
    units of the sizes and of the duration, and `near` and `apart` (K, M), the motions of the
    nearest states and how far these are, in the sizes.
    """

    def __init__(self, tracer: RayTracer) -> None:
        self.tracer, self.batches, self.told = tracer, [], []
        n, events = tracer.size.size, len(tracer.at.joints)
        self.count = RAY_NEIGHBOURS * tracer.unit.size
        self.u, self.cost = np.zeros((0, tracer.unit.size)), np.zeros(0)
        self.where = np.zeros((0, events, n + 1))
        self.near, self.apart = np.zeros((0, self.count), dtype=int), np.zeros((0, self.count))

    def add(self, batch: TracedRays) -> None:
        """Add motions."""
        self.batches.append(batch)
        size, old = self.tracer.size, len(self.u)
        self.u = np.concatenate([self.u, batch.u])
        self.cost = np.concatenate([self.cost, batch.cost])
        times = (batch.times - batch.times[:, :1]) / self.tracer.span
        where = np.concatenate([batch.places / size, times[..., None]], axis=2)
        self.where = np.concatenate([self.where, where])
        u, new = self.u / self.tracer.unit, np.arange(old, len(self.u))
        apart = np.linalg.norm(u[:, None] - u[None, old:], axis=2)
        apart[~np.isfinite(apart)] = np.inf
        apart[new, np.arange(new.size)] = np.inf
        later = np.broadcast_to(new, (old, new.size))
        near = np.concatenate([self.near, later], axis=1)
        known = self._least(near, np.concatenate([self.apart, apart[:old]], axis=1))
        every = np.broadcast_to(np.arange(len(self.u)), (new.size, len(self.u)))
        rest = self._least(every, apart.T)
        self.near, self.apart = (np.concatenate(pair) for pair in zip(known, rest, strict=True))

    def _least(self, near: NDInt, apart: Array) -> tuple[NDInt, Array]:
        """Return which of the motions (K, P) are nearest, and how far they are, (K, M)."""
        if not len(near):
            return near[:, : self.count], apart[:, : self.count]
        k = np.argpartition(apart, self.count - 1, axis=1)[:, : self.count]
        return np.take_along_axis(near, k, axis=1), np.take_along_axis(apart, k, axis=1)

    def minima(self) -> NDInt:
        """Return the motions that cost less than their neighbours, (M,), the best first."""
        least = (self.cost[self.near] >= self.cost[:, None]).all(axis=1)
        best = np.flatnonzero(least & np.isfinite(self.cost))
        return best[np.argsort(self.cost[best])]

    def closer(self, random: np.random.Generator, count: int) -> Array:
        """Return states (count, M) near those that cost least."""
        best = self.minima()[:BEST_RAYS]
        if not best.size:
            return self.tracer.all_round(random)[:count]
        chosen = np.resize(best, count)
        away = random.standard_normal((count, self.tracer.unit.size)) * self.tracer.unit
        return self.u[chosen] + RAY_SPREAD * self.apart[chosen].max(axis=1)[:, None] * away

    def between(self, count: int) -> Array:
        """Return states (count, M), or fewer, between neighbours whose ways part.

        Those first that are farthest from one another.
        """
        with np.errstate(all="ignore"):
            gap = np.abs(self.where[self.near] - self.where[:, None])
        met = np.isfinite(self.where[..., 0])
        lost = met[self.near] != met[:, None]  # one meets the event, the other one does not
        part = (lost | (gap.max(axis=3) > RAY_APART)).any(axis=2) & np.isfinite(self.apart)
        i, j = np.nonzero(part)
        once = i < self.near[i, j]
        i, j = i[once], j[once]
        k = np.argsort(-self.apart[i, j] / np.linalg.norm(self.u[i] / self.tracer.unit, axis=1))
        i, j = i[k[:count]], j[k[:count]]
        return (self.u[i] + self.u[self.near[i, j]]) / 2

    def nearest(self, miss: float) -> Iterator[Ray]:
        """Yield motions that miss the end by less than their neighbours, and less than `miss`."""
        first = np.cumsum([0, *(len(b.u) for b in self.batches)])
        for k in self.minima().tolist():
            if not self.cost[k] < miss:
                return
            apart = self.apart[k].max()
            if any(np.linalg.norm((self.u[k] - u) / self.tracer.unit) < apart for u in self.told):
                continue
            self.told.append(self.u[k])
            batch = int(np.searchsorted(first, k, side="right")) - 1
            b, i = self.batches[batch], k - int(first[batch])
            legs = []
            for track, which in b.tracks:
                j = [int(np.searchsorted(which, i))]
                legs.append(Track(track.times[:, j], track.q[:, j], track.v[:, j]))
            yield Ray(b.times[i], b.places[i], legs)
