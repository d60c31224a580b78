"""First paths through events on surfaces: motions that are reflected and refracted on their way.

Many motions leave the start at once, in all directions and at many speeds, and meet the surfaces of
the events in their order (`reflection`). What comes near the end, in about the time that is given,
is a guess. About those that come nearest, or that get farthest, more leave, ever closer to them:
after some bounces few of the directions of a fan are left.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from actionopt.analysis.shooting import integrate
from actionopt.discrete.borders import times_of
from actionopt.mechanics.course import sides
from actionopt.mechanics.events import Bounce, Event
from actionopt.mechanics.problem import Problem
from actionopt.mechanics.reflection import leave
from actionopt.tools.types import Array, NDInt

# Ad hoc.
RAYS = 400  # motions of a round
RAY_ROUNDS = 4  # of motions ever closer to those that come nearest
BEST_RAYS = 40  # motions about which more leave
RAY_NEIGHBOURS = 2  # a coordinate, with which a motion is compared
RAY_SPREAD = 0.5  # of the distance of these, of velocities that are nearer
RAY_SPEEDS = 4.0  # times faster and slower than what is expected, of the first motions
RAY_LATE = 4.0  # times the duration: no motion lasts longer
RAY_SLOWER = 0.5  # a factor e of the duration costs as much as that part of the coordinates' sizes
RAY_STEPS = 150  # of a motion between two events, at most
RAY_SAMPLES, STEP_SAMPLES = (
    64,
    4,
)  # along it, and a step, at least, at which surfaces are looked for
ZOOMS, ZOOMED = 4, 8  # refinements of a time, and samples of each
RAY_NEAR = 0.05  # a smaller one, in these sizes, is told at once
EVENT_MISSED = 100.0  # what an event that is not met costs, of the coordinates' sizes


class Ray(NamedTuple):
    """A motion through events.

    Attributes
    ----------
    times : (k + 2,) array
    places : (k + 2, n) array
    legs : list of _Track
        Of it alone.
    """

    times: Array
    places: Array
    legs: list[_Track]

    def values(self, leg: int, parts: Array) -> Array:
        """Return coordinates (K, n) at parts (K,) of the time of a leg."""
        track = self.legs[leg]
        t = self.times[leg] + parts * (self.times[leg + 1] - self.times[leg])
        i = np.searchsorted(track.times[:, 0], t, side="right") - 1
        i = np.clip(i, 0, len(track.times) - 2)
        return track.at(i, np.zeros_like(i), t)[0]


@dataclass(frozen=True, eq=False)
class _Track:
    """Motions as they were integrated: times (S, K), coordinates and velocities (S, K, n)."""

    times: Array
    q: Array
    v: Array

    def at(self, i: NDInt, k: NDInt, t: Array) -> tuple[Array, Array]:
        """Return q and v (..., n) of motions k after step i at times t, all (...,): cubics."""
        t0, t1 = self.times[i, k], self.times[i + 1, k]
        h = np.where(t1 > t0, t1 - t0, 1.0)[..., None]
        s = (t - t0)[..., None] / h
        a, b, va, vb = self.q[i, k], self.q[i + 1, k], self.v[i, k], self.v[i + 1, k]
        rise = s * s * (3 - 2 * s)
        q = a + (b - a) * rise + h * s * ((1 - s) ** 2 * va - s * (1 - s) * vb)
        slope = 6 * s * (1 - s) / h
        v = slope * (b - a) + (1 - s) * (1 - 3 * s) * va - s * (2 - 3 * s) * vb
        return q, v

    def samples(self) -> tuple[NDInt, Array]:
        """Return the step (P,) and the time (P, K) of samples along the motions."""
        steps = len(self.times) - 1
        each = max(-(-RAY_SAMPLES // steps), STEP_SAMPLES)
        i = np.repeat(np.arange(steps), each)
        part = np.tile(np.arange(each) / each, steps)[:, None]
        t = self.times[i] + part * (self.times[i + 1] - self.times[i])
        return np.append(i, steps - 1), np.concatenate([t, self.times[-1:]])


class _Batch(NamedTuple):
    """What came of motions: places (K, k + 2, n) and times (K, k + 2), and what each costs (K,).

    `tracks` are those of the legs, and which motions they are of.
    """

    v: Array
    places: Array
    times: Array
    cost: Array
    tracks: list[tuple[_Track, NDInt]]


def rays(problem: Problem, size: Array, span: float, seed: int) -> Iterator[Ray]:
    """Yield motions through the events of a problem that come near its end, the nearest ones first.

    `size` (n,) is that of the coordinates, `span` about how long it takes. There are none where
    motions do not lead from event to event: coordinates of the start are free, or an event between
    the ends is no surface.
    """
    start, *inner, _ = problem.joints_found
    given = len(start.pinned) == problem.system.n and not problem.system.structure.forced
    if not (inner and given) or any(e.on is None or e.on.count > 1 for e in inner):
        return
    fan = _Fan.of(problem, size, span)
    random = np.random.default_rng(seed)
    found = [fan.follow(fan.all_round(random))]
    if fan.timed:
        found = [fan.follow(fan.in_time(found))]
    told: list[Array] = []
    for k in range(RAY_ROUNDS + 1):
        yield from fan.nearest(found, told, RAY_NEAR if k < RAY_ROUNDS else EVENT_MISSED)
        if k < RAY_ROUNDS:
            found.append(fan.follow(fan.closer(found, random)))


@dataclass(frozen=True, eq=False)
class _Fan:
    """What motions from the start of a problem are to meet.

    Attributes
    ----------
    at : Problem
        The problem at times of its events, any where they are to be found.
    legs : list of Problem
        The law of each leg between given events, wherever they are.
    walls : list of list of int
        Events on the surfaces of which each leg may not come.
    size : (n,) array
    span : float
        How long a motion takes, or about so if that is not given.
    timed : bool
        Whether it is.
    """

    at: Problem
    legs: list[Problem]
    walls: list[list[int]]
    size: Array
    span: float
    timed: bool

    @classmethod
    def of(cls, problem: Problem, size: Array, span: float) -> _Fan:
        """Return that of a problem whose start is given, and whose inner events are surfaces."""
        times = times_of(problem)
        timed = bool(np.isfinite(times[[0, -1]]).all())
        begin = times[0] if np.isfinite(times[0]) else times[-1] - span
        begin = float(begin) if np.isfinite(begin) else 0.0
        filled = begin + np.linspace(0, span, times.size)
        at = problem.found_at(filled)
        q = np.array(problem.joints_found[0].q, dtype=float)
        legs: list[Problem] = []
        for law in problem.laws or (problem.system,) * (times.size - 1):
            if legs and law is legs[-1].system:
                legs.append(legs[-1])
                continue
            values = {k: x for k, x in at.parameters.items() if k in law.table.shapes}
            ends = Event(begin, q), Event(begin + span, q + size)
            legs.append(Problem(law, *ends, parameters=values))
        walls: list[list[int]] = [[] for _ in legs]
        for joint, leg, sign in sides(problem):
            if sign:
                walls[leg].append(joint)
        return cls(at, legs, walls, size, span, timed)

    # -- velocities ------------------------------------------------------------------------------

    def all_round(self, random: np.random.Generator) -> Array:
        """Return velocities (K, n) in all directions, at many speeds."""
        n = self.size.size
        v = random.standard_normal((RAYS, n))
        if n == 2:
            angle = 2 * np.pi * (np.arange(RAYS) + random.random()) / RAYS
            v = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        v /= np.linalg.norm(v, axis=1, keepdims=True)
        speeds = len(self.legs) * RAY_SPEEDS ** random.uniform(-1, 1, (RAYS, 1)) / self.span
        return self._of_energy(v * self.size * speeds)

    def in_time(self, found: list[_Batch]) -> Array:
        """Return the velocities (K, n) of motions, those that come late faster."""
        v = np.concatenate([b.v for b in found])
        if not self.timed:
            return v
        last = np.concatenate([b.times[:, -1] for b in found]) - self.legs[0].start.t
        return v * np.where(np.isfinite(last), last / self.span, 1.0)[:, None]

    def closer(self, found: list[_Batch], random: np.random.Generator) -> Array:
        """Return velocities (K, n) near those that miss less than all their neighbours."""
        v = np.concatenate([b.v for b in found])
        best, apart = self._minima(found)
        if not best.size:
            return self.all_round(random)
        best, apart = best[:BEST_RAYS], apart[:BEST_RAYS]
        chosen = np.resize(np.arange(best.size), RAYS)
        away = random.standard_normal((RAYS, self.size.size)) * self.size
        return self._of_energy(v[best[chosen]] + RAY_SPREAD * apart[chosen, None] * away)

    def _minima(self, found: list[_Batch]) -> tuple[NDInt, Array]:
        """Return motions (M,) that miss less than their neighbours, the best first.

        And how far their velocities are from those of the neighbours, in the sizes.
        """
        v, cost = np.concatenate([b.v for b in found]), np.concatenate([b.cost for b in found])
        u = v / self.size
        square = np.sum(u**2, axis=1)
        distance = np.maximum(square[:, None] + square - 2 * u @ u.T, 0.0)
        distance[~np.isfinite(distance)] = np.inf
        np.fill_diagonal(distance, np.inf)
        count = min(RAY_NEIGHBOURS * self.size.size, len(v) - 1)
        near = np.argpartition(distance, count - 1, axis=1)[:, :count]
        least = (cost[near] >= cost[:, None]).all(axis=1) & np.isfinite(cost)
        best = np.flatnonzero(least)
        best = best[np.argsort(cost[best])]
        return best, np.sqrt(np.take_along_axis(distance, near, axis=1).max(axis=1)[best])

    def _of_energy(self, v: Array) -> Array:
        """Return the velocities (K, n) at the energy that is given, in the same directions."""
        if self.at.energy is None:
            return v
        leg = self.legs[0]
        q, t = self._begin(len(v))
        H = [leg.system.energy(q.T, x.T, t, parameters=leg.parameters) for x in (v, 0 * v)]
        with np.errstate(all="ignore"):
            return v * np.sqrt((self.at.energy - H[1]) / (H[0] - H[1]))[:, None]

    def _begin(self, count: int) -> tuple[Array, Array]:
        """Return the place (K, n) and the time (K,) of the start, as often as there are motions."""
        start = self.legs[0].start
        return np.tile(np.array(start.q, dtype=float), (count, 1)), np.full(count, start.t)

    # -- motions ---------------------------------------------------------------------------------

    def follow(self, v: Array) -> _Batch:
        """Return what comes of motions from the start with velocities v (K, n)."""
        count, joints = len(v), self.at.joints
        places = np.full((count, len(joints), v.shape[1]), np.nan)
        times = np.full((count, len(joints)), np.nan)
        q, t = self._begin(count)
        places[:, 0], times[:, 0] = q, t
        cost, tracks = np.full(count, np.inf), []
        live, u = np.flatnonzero(np.isfinite(v).all(axis=1)), v
        for j, leg in enumerate(self.legs):
            if not live.size:
                break
            state = q[live], u[live], t[live]
            track = self._track(leg, *state)
            tracks.append((track, live))
            left = EVENT_MISSED * (len(self.legs) - 1 - j)
            if j + 1 == len(self.legs):
                cost[live], places[live, -1], times[live, -1] = self._arrive(j, track)
                break
            miss, met = self._meet(j, track)
            cost[live] = left + miss
            steps, at, which = met
            here = live[which]
            if not here.size:
                break
            q_met, v_met = track.at(steps, which, at)
            later = self._leave(j, q_met, v_met, at)
            places[here, j + 1], times[here, j + 1] = q_met, at
            goes = np.isfinite(later).all(axis=1)
            live = here[goes]
            q, u, t = (np.full((count, *x.shape[1:]), np.nan) for x in (q_met, later, at))
            q[live], u[live], t[live] = q_met[goes], later[goes], at[goes]
        return _Batch(v, places, times, cost, tracks)

    def _track(self, leg: Problem, q: Array, v: Array, t: Array) -> _Track:
        """Return motions from states q, v (K, n) and t (K,) until they are too late."""
        track: list[tuple[Array, Array, Array]] = []
        state = t, q.T[:, None], v.T[:, None]
        span = np.maximum(leg.start.t + RAY_LATE * self.span - t, 1e-3 * self.span)
        with np.errstate(all="ignore"):
            integrate(leg, state, span, steps=RAY_STEPS, track=track)
        times = np.array([t, *(x[0] for x in track)])
        return _Track(
            times,
            np.array([q, *(x[1].T for x in track)]),
            np.array([v, *(x[2].T for x in track)]),
        )

    def _on(self, joint: int, q: Array, t: Array) -> Array:
        """Return on of an event (...,) at q (..., n) and t (...,)."""
        on = self.at.joints[joint].on
        return on.values(q.reshape(-1, q.shape[-1]), t.reshape(-1), self.at.packed).reshape(t.shape)

    def _far(self, joint: int, q: Array, t: Array) -> Array:
        """Return how far places q (K, n) at t (K,) are from a surface, in the sizes, (K,)."""
        on, by_q, _ = self.at.joints[joint].on.along(q, t, self.at.packed)
        unit = np.linalg.norm(by_q[:, 0] * self.size, axis=1)
        return np.abs(on[:, 0]) / np.where(unit > 0, unit, 1.0)

    def _meet(self, leg: int, track: _Track) -> tuple[Array, tuple[NDInt, Array, NDInt]]:
        """Return how near motions come to the next event, (K,), and where some of them meet it.

        Of these the step, the time and which they are, (M,) each.
        """
        joint, event = leg + 1, self.at.joints[leg + 1]
        steps, t = track.samples()
        columns = np.arange(t.shape[1])
        q, _ = track.at(steps[:, None], columns[None], t)
        on = self._on(joint, q, t)
        side = np.sign(on[1]) if not isinstance(event, Bounce) else np.ones(columns.size)
        on = np.where(np.isfinite(on), on, -np.inf) * side
        if on.shape[0] < 3:
            return np.full(columns.size, np.inf), (steps[:0], t[0, :0], columns[:0])
        out = on[1:] <= 0
        first = np.argmax(out, axis=0) + 1
        crossed = out.any(axis=0) & (first > 1) & np.isfinite(on[first, columns])
        for other in self.walls[leg]:
            inside = self._on(other, q, t)[1:] > 0
            crossed &= inside.all(axis=0) | (np.argmin(inside, axis=0) + 1 >= first)
        near = np.argmin(np.where(np.isfinite(on), np.abs(on), np.inf)[1:], axis=0) + 1
        miss = self._far(joint, q[near, columns], t[near, columns])
        which = columns[crossed]
        if not which.size:
            return miss, (steps[:0], t[0, :0], which)
        i = steps[first[which] - 1]
        low, high = t[first[which] - 1, which], t[first[which], which]
        for _ in range(ZOOMS):
            at = low + np.linspace(0, 1, ZOOMED + 1)[:, None] * (high - low)
            inner, _ = track.at(i[None], which[None], at)
            here = self._on(joint, inner, at) * side[which] <= 0
            k = np.maximum(np.argmax(here[1:], axis=0), 0)
            low, high = at[k, np.arange(k.size)], at[k + 1, np.arange(k.size)]
        return miss, (i, low, which)

    def _leave(self, leg: int, q: Array, v: Array, t: Array) -> Array:
        """Return velocities (K, n) after the event at the end of a leg; NaN for none."""
        event = self.at.joints[leg + 1]
        _, by_q, by_t = event.on.along(q, t, self.at.packed)
        laws = [(p.system, p.packed) for p in self.legs[leg : leg + 2]]
        if self.legs[leg] is self.legs[leg + 1]:
            laws[1] = laws[0]
        bounces = isinstance(event, Bounce)
        normals = by_q[:, 0], by_t[:, 0]
        return leave((laws[0], laws[1]), (q, v, t[:, None]), normals, bounces=bounces)

    def _arrive(self, leg: int, track: _Track) -> tuple[Array, Array, Array]:
        """Return how far motions miss the end, (K,), and where, (K, n), and when, (K,), they do."""
        steps, t = track.samples()
        columns = np.arange(t.shape[1])
        q, _ = track.at(steps[:, None], columns[None], t)
        cost = self._miss(q, t)
        for other in self.walls[leg]:
            out = np.cumsum(~(self._on(other, q, t)[1:] > 0), axis=0) > 0
            cost[1:][out] = np.inf
        k = np.argmin(cost, axis=0)
        low, high = t[np.maximum(k - 1, 0), columns], t[np.minimum(k + 1, len(t) - 1), columns]
        best = t[k, columns]
        i = steps[k]
        for _ in range(ZOOMS):
            at = low + np.linspace(0, 1, ZOOMED + 1)[:, None] * (high - low)
            i = np.sum(track.times[None] <= at[:, None], axis=1) - 1
            i = np.clip(i, 0, len(track.times) - 2)
            inner, _ = track.at(i, columns[None], at)
            near = self._miss(inner, at)
            k = np.argmin(near, axis=0)
            best = at[k, columns]
            low, high = at[np.maximum(k - 1, 0), columns], at[np.minimum(k + 1, ZOOMED), columns]
        i = np.clip(np.sum(track.times <= best, axis=0) - 1, 0, len(track.times) - 2)
        q, _ = track.at(i, columns, best)
        here = self._miss(q, best)
        return np.where(np.isfinite(cost.min(axis=0)), here, EVENT_MISSED), q, best

    def _miss(self, q: Array, t: Array) -> Array:
        """Return how far places q (..., n) at times t (...,) miss the end, (...,)."""
        end, found = self.at.joints[-1], np.zeros(t.shape)
        for i in end.pinned:
            found += ((q[..., i] - end.q[i]) / self.size[i]) ** 2
        if end.on is not None:
            flat = q.reshape(-1, q.shape[-1]), t.reshape(-1)
            found += self._far(len(self.at.joints) - 1, *flat).reshape(t.shape) ** 2
        if self.timed:
            with np.errstate(all="ignore"):
                late = np.log(np.maximum(t - self.legs[0].start.t, 0) / self.span)
            found += (RAY_SLOWER * late) ** 2
        return np.where(np.isfinite(found), np.sqrt(found), np.inf)

    def nearest(self, found: list[_Batch], told: list[Array], miss: float) -> Iterator[Ray]:
        """Yield motions that miss the end by less than their neighbours, the nearest first.

        And by less than `miss`; `told` are the velocities of those that were yielded before.
        """
        batch = np.repeat(np.arange(len(found)), [len(b.v) for b in found])
        first = np.cumsum([0, *(len(b.v) for b in found)])
        for k, apart in zip(*self._minima(found), strict=True):
            b, i = found[batch[k]], k - first[batch[k]]
            if not b.cost[i] < miss:
                return
            if any(np.linalg.norm((b.v[i] - v) / self.size) < apart for v in told):
                continue
            told.append(b.v[i])
            legs = []
            for track, which in b.tracks:
                j = [int(np.searchsorted(which, i))]
                legs.append(_Track(track.times[:, j], track.q[:, j], track.v[:, j]))
            yield Ray(b.times[i], b.places[i], legs)
