"""Motions traced from event to event: reflected and refracted at the surfaces that they meet.

Many motions leave the start at once and meet the surfaces of the events in their order
(`reflection`); each is told by how far it misses what the end asks, at the time at which it comes
nearest. For closed paths the place of the start is to be found as well: motions leave from
anywhere, and those that nearly return are brought back by Newton's method on the map from start to
return.
"""

from __future__ import annotations

from contextlib import suppress
from typing import NamedTuple

import numpy as np

from actionopt.analysis.quadratic.shooting import integrate
from actionopt.discrete.borders.borders import times_of
from actionopt.mechanics.question.course import sides
from actionopt.mechanics.question.events import Bounce, Event
from actionopt.mechanics.question.problem import Problem
from actionopt.mechanics.reflection import leave
from actionopt.tools.immutable import immutable
from actionopt.tools.types import Array, NDInt

# Ad hoc.
RAYS = 400  # motions of a round
RAY_SPEEDS = 4.0  # times faster and slower than what is expected, of the first motions
RAY_LATE = 4.0  # times the duration: no motion lasts longer
# Of the sizes, and of how far a motion would come without forces: what is carried farther is lost.
RAY_FAR = 1e3
RAY_SLOWER = 0.5  # a factor e of the duration costs as much as that part of the coordinates' sizes
RAY_STEPS = 150  # of a motion between two events, at most
# Along it, and a step, at least, at which surfaces are looked for.
RAY_SAMPLES, STEP_SAMPLES = 64, 4
ZOOMS, ZOOMED = 4, 8  # refinements of a time, and samples of each
STATES_TRIED = (
    8  # as many states as leave, of which those leave that are on the right side of walls
)
RETURN_STEPS = 6  # of Newton's method on the map from start to return
RETURN_STEP = 0.3  # the longest one, in the sizes
RETURN_SHIFT = 1e-5  # of the sizes, for differences
EVENT_MISSED = 100.0  # what an event that is not met costs, of the coordinates' sizes


@immutable
class Track:
    """Motions as they were integrated: times (S, K), coordinates and velocities (S, K, n)."""

    times: Array
    q: Array
    v: Array

    def at(self, i: NDInt, k: NDInt, t: Array) -> tuple[Array, Array]:
        """Return q and v (..., n) of motions k after step i at times t, all (...,): cubics."""
        h = (self.times[i + 1, k] - self.times[i, k])[..., None]
        s = (t - self.times[i, k])[..., None] / np.where(h > 0, h, 1.0)
        return _cubic(s, h, (self.q[i, k], self.q[i + 1, k]), (self.v[i, k], self.v[i + 1, k]))

    def step(self, t: Array) -> NDInt:
        """Return the step in which each of the motions is at times t (..., K)."""
        i = np.sum(self.times <= t[..., None, :], axis=-2) - 1
        return np.clip(i, 0, len(self.times) - 2)

    def samples(self) -> tuple[NDInt, Array, Array, Array]:
        """Return samples along motions: steps (P,), times (P, K), q and v (P, K, n) there."""
        steps = len(self.times) - 1
        each = max(-(-RAY_SAMPLES // steps), STEP_SAMPLES)
        s = (np.arange(each) / each)[:, None, None]
        h = np.diff(self.times, axis=0)[:, None, :, None]
        ends = self.q[:-1], self.q[1:], self.v[:-1], self.v[1:]
        a, b, va, vb = (x[:, None] for x in ends)
        within = (self.times[:-1, None, :, None] + s * h)[..., 0], *_cubic(s, h, (a, b), (va, vb))
        last = self.times[-1], self.q[-1], self.v[-1]
        t, q, v = (
            np.concatenate([x.reshape(steps * each, *y.shape), y[None]])
            for x, y in zip(within, last, strict=True)
        )
        return np.append(np.repeat(np.arange(steps), each), steps - 1), t, q, v


def _cubic(
    s: Array, h: Array, ends: tuple[Array, Array], rates: tuple[Array, Array]
) -> tuple[Array, Array]:
    """Return q and v at parts s of steps of the length h, which may vanish, from those at ends."""
    (a, b), (va, vb) = ends, rates
    q = a + (b - a) * (s * s * (3 - 2 * s)) + h * s * ((1 - s) ** 2 * va - s * (1 - s) * vb)
    slope = 6 * s * (1 - s) / np.where(h > 0, h, 1.0)
    return q, slope * (b - a) + (1 - s) * (1 - 3 * s) * va - s * (2 - 3 * s) * vb


class TracedRays(NamedTuple):
    """Motions that were traced: places (K, k + 2, n), times (K, k + 2), and what each costs (K,).

    `u` (K, M) are the states in which they begin, `tracks` those of the legs, and which motions
    they are of.
    """

    u: Array
    places: Array
    times: Array
    cost: Array
    tracks: list[tuple[Track, NDInt]]

    @property
    def through(self) -> Array:
        """Whether motions meet all events between the ends, (K,)."""
        return np.isfinite(self.times[:, -2])


@immutable
class RayTracer:
    """Traces motions from the start of a problem from event to event."""

    at: Problem  # the problem at times of its events, any where they are to be found
    legs: list[Problem]  # the law of each leg between given events, wherever they are
    walls: list[list[int]]  # of each leg: events on the surfaces of which it may not come
    size: Array  # (n,)
    span: float  # how long a motion takes, or about so if that is not given
    timed: bool  # whether it is given
    # events at which motions are thrown back: without a change of law, both ways are stationary
    thrown: tuple[int, ...] = ()

    @classmethod
    def of(cls, problem: Problem, size: Array, span: float) -> RayTracer:
        """Return that of a problem whose start is given, and whose inner events are surfaces."""
        times = times_of(problem)
        timed = bool(np.isfinite(times[[0, -1]]).all())
        begin = times[0] if np.isfinite(times[0]) else times[-1] - span
        begin = float(begin) if np.isfinite(begin) else 0.0
        filled = begin + np.linspace(0, span, times.size)
        at = problem.found_at(filled)
        q = np.nan_to_num(np.array(problem.joints_found[0].q, dtype=float))
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
            if sign and all(at.joints[k].on is not at.joints[joint].on for k in walls[leg]):
                walls[leg].append(joint)
        return cls(at, legs, walls, size, span, timed)

    @property
    def unit(self) -> Array:
        """The units of the states (M,) in which motions begin: here, of velocities."""
        return self.size

    # -- where motions begin -----------------------------------------------------------------------

    def all_round(self, random: np.random.Generator) -> Array:
        """Return states (K, M) in all directions, at many speeds."""
        n = self.size.size
        v = random.standard_normal((RAYS, n))
        if n == 2:
            angle = 2 * np.pi * (np.arange(RAYS) + random.random()) / RAYS
            v = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        v /= np.linalg.norm(v, axis=1, keepdims=True)
        expected = len(self.legs) / self.span
        slowest, fastest = expected / RAY_SPEEDS, expected * RAY_SPEEDS + self._thrown_speed()
        speeds = slowest * (fastest / slowest) ** random.uniform(0, 1, (RAYS, 1))
        return self.of_energy(v * self.size * speeds)

    def _thrown_speed(self) -> float:
        """Return the speed, in the sizes, from which forces turn back in time: any leg's there."""
        q, speeds = np.array(self.legs[0].start.q, dtype=float), [0.0]
        for leg in self.legs:
            with np.errstate(all="ignore"), suppress(np.linalg.LinAlgError):
                force = leg.system.acceleration(q, 0 * q, leg.start.t, parameters=leg.parameters)
                speeds.append(float(np.abs(force / self.size).max() * self.span / 2))
        return max(filter(np.isfinite, speeds))

    def in_time(self, batch: TracedRays) -> Array:
        """Return the states (K, M) of motions, those that come late faster."""
        last, u = batch.times[:, -1] - self.legs[0].start.t, batch.u.copy()
        u[:, -self.size.size :] *= np.where(np.isfinite(last), last / self.span, 1.0)[:, None]
        return u

    def of_energy(self, u: Array) -> Array:
        """Return states (K, M) at the energy that is given, in the same directions."""
        if self.at.energy is None:
            return u
        leg, u = self.legs[0], u.copy()
        q, v, t = self.begin(u)
        H = [leg.system.energy(q.T, x.T, t, parameters=leg.parameters) for x in (v, 0 * v)]
        with np.errstate(all="ignore"):
            u[:, -v.shape[1] :] = v * np.sqrt((self.at.energy - H[1]) / (H[0] - H[1]))[:, None]
        return u

    def begin(self, u: Array) -> tuple[Array, Array, Array]:
        """Return the place (K, n), the velocity (K, n) and the time (K,) of states (K, M)."""
        start = self.legs[0].start
        q = np.tile(np.array(start.q, dtype=float), (len(u), 1))
        return q, u, np.full(len(u), start.t)

    # -- motions ---------------------------------------------------------------------------------

    def follow(self, u: Array) -> TracedRays:
        """Return the motions that set out from states u (K, M), traced from event to event."""
        count, joints = len(u), self.at.joints
        places = np.full((count, len(joints), self.size.size), np.nan)
        times = np.full((count, len(joints)), np.nan)
        q, v, t = begun = self.begin(u)
        places[:, 0], times[:, 0] = q, t
        cost, tracks = np.full(count, np.inf), []
        live = np.flatnonzero(np.isfinite(u).all(axis=1))
        for j in range(len(self.legs)):
            if not live.size:
                break
            state = q[live], v[live], t[live]
            track = self._track(j, *state)
            tracks.append((track, live))
            left = EVENT_MISSED * (len(self.legs) - 1 - j)
            if j + 1 == len(self.legs):
                first = begun[0][live], begun[1][live]
                cost[live], places[live, -1], times[live, -1] = self._arrive(j, track, first)
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
            q, v, t = (np.full((count, *x.shape[1:]), np.nan) for x in (q_met, later, at))
            q[live], v[live], t[live] = q_met[goes], later[goes], at[goes]
        return TracedRays(u, places, times, cost, tracks)

    def _track(self, leg: int, q: Array, v: Array, t: Array) -> Track:
        """Return motions of a leg from states q, v (K, n) and t (K,), until they are too late.

        Or until a step ends behind a wall or the next event: it is known then whether that is met.
        Or until forces have carried them far away, as to infinity.
        """
        last, walls = leg + 1 == len(self.legs), list(self.walls[leg])
        passed = None if last or isinstance(self.at.joints[leg + 1], Bounce) else leg + 1
        side, begun = np.zeros(t.size), q
        far = RAY_FAR * (1 + np.abs(v / self.size).max(axis=1) * RAY_LATE * self.span)

        def arrived(which: NDInt, q: Array, t: Array) -> Array:
            done = np.abs((q.T - begun[which]) / self.size).max(axis=1) > far[which]
            for joint in walls:
                done |= ~(self._on(joint, q.T, t) > 0)
            if passed is not None:
                here = np.sign(self._on(passed, q.T, t))
                done |= here * side[which] < 0
                side[which] = here
            return done

        law = self.legs[leg]
        track: list[tuple[Array, Array, Array]] = []
        state = t, q.T[:, None], v.T[:, None]
        span = np.maximum(law.start.t + RAY_LATE * self.span - t, 1e-3 * self.span)
        with np.errstate(all="ignore"):
            integrate(law, state, span, steps=RAY_STEPS, track=track, arrived=arrived)
        times = np.array([t, *(x[0] for x in track)])
        places = np.array([q, *(x[1].T for x in track)])
        rates = np.array([v, *(x[2].T for x in track)])
        # Steps that were refused go to the end: at the first one, on a surface that a motion just
        # left, round-off would tell that it is behind it.
        refused = np.diff(times, axis=0, prepend=-np.inf) == 0
        order = np.where(refused, len(times) - 1, np.arange(len(times))[:, None])
        order.sort(axis=0)
        columns = np.arange(t.size)
        return Track(times[order, columns], places[order, columns], rates[order, columns])

    def _on(self, joint: int, q: Array, t: Array) -> Array:
        """Return on of an event (...,) at q (..., n) and t (...,)."""
        on = self.at.joints[joint].on
        return on.values(q.reshape(-1, q.shape[-1]), t.reshape(-1), self.at.packed).reshape(t.shape)

    def _far(self, joint: int, q: Array, t: Array) -> Array:
        """Return how far places q (K, n) at t (K,) are from a surface, in the sizes, (K,)."""
        on, by_q, _ = self.at.joints[joint].on.along(q, t, self.at.packed)
        unit = np.linalg.norm(by_q[:, 0] * self.size, axis=1)
        return np.abs(on[:, 0]) / np.where(unit > 0, unit, 1.0)

    def _meet(self, leg: int, track: Track) -> tuple[Array, tuple[NDInt, Array, NDInt]]:
        """Return how near motions come to the next event, (K,), and where some of them meet it.

        Those that meet it are told by the step, the time and their numbers, (M,) each.
        """
        joint, event = leg + 1, self.at.joints[leg + 1]
        steps, t, q, _ = track.samples()
        columns = np.arange(t.shape[1])
        on = self._on(joint, q, t)
        side = np.ones(columns.size) if isinstance(event, Bounce) else np.sign(on[1])
        on = np.where(np.isfinite(on), on, -np.inf) * side
        if on.shape[0] < 3:
            return np.full(columns.size, np.inf), (steps[:0], t[0, :0], columns[:0])
        out = on[1:] <= 0
        first = np.argmax(out, axis=0) + 1
        crossed = out.any(axis=0) & (first > 1) & np.isfinite(on[first, columns])
        asked = np.isfinite(on[1:])
        for other in self.walls[leg]:
            own = self.at.joints[other].on is event.on
            inside = on[1:] > 0 if own else self._on(other, q, t)[1:] > 0
            crossed &= inside.all(axis=0) | (np.argmin(inside, axis=0) + 1 >= first)
            asked &= np.logical_and.accumulate(inside, axis=0)
        # Where it comes nearer: what leaves a surface to return to it is next to it first.
        nears = asked & np.logical_or.accumulate(np.diff(on, axis=0) < 0, axis=0)
        last = len(asked) - np.argmax(asked[::-1], axis=0)
        near = np.argmin(np.where(nears, np.abs(on[1:]), np.inf), axis=0) + 1
        near = np.where(nears.any(axis=0), near, last)
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
        at = np.stack([low, high])
        before, after = self._on(joint, track.at(i[None], which[None], at)[0], at)
        with np.errstate(all="ignore"):  # straight between the two
            part = before / (before - after)
        part = np.where((part >= 0) & (part <= 1), part, 0.0)
        return miss, (i, low + part * (high - low), which)

    def _leave(self, leg: int, q: Array, v: Array, t: Array) -> Array:
        """Return velocities (K, n) after the event at the end of a leg; NaN for none."""
        event = self.at.joints[leg + 1]
        _, by_q, by_t = event.on.along(q, t, self.at.packed)
        laws = [(p.system, p.packed) for p in self.legs[leg : leg + 2]]
        if self.legs[leg] is self.legs[leg + 1]:
            laws[1] = laws[0]
        bounces = isinstance(event, Bounce) or leg + 1 in self.thrown
        normals = by_q[:, 0], by_t[:, 0]
        return leave((laws[0], laws[1]), (q, v, t[:, None]), normals, bounces=bounces)

    def _arrive(
        self, leg: int, track: Track, first: tuple[Array, Array]
    ) -> tuple[Array, Array, Array]:
        """Return how far motions miss the end, (K,), and where, (K, n), and when, (K,), they do.

        They began at places and with velocities `first`, (K, n) each.
        """
        _, t, q, v = track.samples()
        columns = np.arange(t.shape[1])
        cost = self._miss(q, v, t, first)
        for other in self.walls[leg]:
            inside = np.logical_and.accumulate(self._on(other, q, t)[1:] > 0, axis=0)
            cost[1:][~inside] = np.inf
        k = np.argmin(cost, axis=0)
        low, high = t[np.maximum(k - 1, 0), columns], t[np.minimum(k + 1, len(t) - 1), columns]
        best = t[k, columns]
        for _ in range(ZOOMS):
            at = low + np.linspace(0, 1, ZOOMED + 1)[:, None] * (high - low)
            near = self._miss(*track.at(track.step(at), columns[None], at), at, first)
            k = np.argmin(near, axis=0)
            best = at[k, columns]
            low, high = at[np.maximum(k - 1, 0), columns], at[np.minimum(k + 1, ZOOMED), columns]
        q, v = track.at(track.step(best), columns, best)
        here = self._miss(q, v, best, first)
        return np.where(np.isfinite(cost.min(axis=0)), here, EVENT_MISSED), q, best

    def _miss(self, q: Array, v: Array, t: Array, first: tuple[Array, Array]) -> Array:
        """Return how far q and v (..., n) at times t (...,) miss the end, (...,), in the sizes."""
        end, found = self.at.joints[-1], np.zeros(t.shape)
        for i in end.pinned:
            found += ((q[..., i] - end.q[i]) / self.size[i]) ** 2
        if end.on is not None:
            flat = q.reshape(-1, q.shape[-1]), t.reshape(-1)
            found += self._far(len(self.at.joints) - 1, *flat).reshape(t.shape) ** 2
        if self.timed:
            with np.errstate(all="ignore"):
                late = np.log(np.maximum(t - self.legs[0].start.t, 0) / self.span)
            found = found + (RAY_SLOWER * late) ** 2
        return np.where(np.isfinite(found), np.sqrt(found), np.inf)

    def bring_back(self, u: Array) -> Array:
        """Return states (K, M) that end more nearly where they should; none that are known here."""
        return u[:0]


class ClosedRayTracer(RayTracer):
    """Traces motions that are to close: they begin anywhere, and are to return there.

    States are the free coordinates of the start, and the velocities.
    """

    @property
    def _free(self) -> NDInt:
        """The coordinates of the start that are not given."""
        return np.setdiff1d(np.arange(self.size.size), self.at.joints_found[0].pinned)

    @property
    def unit(self) -> Array:
        """The units of states (M,)."""
        return np.concatenate([self.size[self._free], self._speed])

    @property
    def _speed(self) -> Array:
        """The unit of velocities, (n,)."""
        return self.size * len(self.legs) / self.span

    def all_round(self, random: np.random.Generator) -> Array:
        """Return states (K, M) in all directions, at many speeds, on the right side of walls."""
        free, n = self._free, self.size.size
        speeds = RAY_SPEEDS ** random.uniform(-1, 1, (STATES_TRIED * RAYS, 1))
        v = random.standard_normal((STATES_TRIED * RAYS, n))
        v *= speeds * self._speed / np.linalg.norm(v, axis=1, keepdims=True)
        u = np.concatenate(
            [random.uniform(-1, 1, (len(v), free.size)) * self.size[free], v], axis=1
        )
        q, _, t = self.begin(u)
        inside = np.isfinite(u).all(axis=1)
        for joint in self.walls[0]:
            inside &= self._on(joint, q, t) > 0
        return self.of_energy(u[inside][:RAYS] if inside.any() else u[:RAYS])

    def begin(self, u: Array) -> tuple[Array, Array, Array]:
        """Return the place (K, n), the velocity (K, n) and the time (K,) of states (K, M)."""
        q, _, t = super().begin(u)
        q[:, self._free] = u[:, : self._free.size]
        return q, u[:, self._free.size :], t

    def in_time(self, batch: TracedRays) -> Array:
        """Return the states themselves: they are followed for the time that is given."""
        return batch.u

    def _return(self, q: Array, v: Array, first: tuple[Array, Array]) -> Array:
        """Return how far q and v (..., K, n) are from where they began, in units, (..., K, 2 n)."""
        q0, v0 = self.at.closed_from(first[0].T).T, first[1][:, list(self.at.order)]
        return np.concatenate([(q - q0) / self.size, (v - v0) / self._speed], axis=-1)

    def _miss(self, q: Array, v: Array, t: Array, first: tuple[Array, Array]) -> Array:
        """Return how far q and v (..., n) at times t (...,) are from where they began, (...,)."""
        found = np.linalg.norm(self._return(q, v, first), axis=-1)
        return np.where(np.isfinite(found), found, np.inf)

    def _arrive(
        self, leg: int, track: Track, first: tuple[Array, Array]
    ) -> tuple[Array, Array, Array]:
        """Return arrivals as for given ends: at the time that is given, if one is."""
        if not self.timed:
            return super()._arrive(leg, track, first)
        at = np.full(len(first[0]), self.legs[0].start.t + self.span)
        _, t, between, _ = track.samples()
        columns = np.arange(at.size)
        q, v = track.at(track.step(at), columns, at)
        cost = np.where(track.times[0] < at, self._miss(q, v, at, first), EVENT_MISSED)
        for other in self.walls[leg]:
            out = (~(self._on(other, between, t)[1:] > 0) & (t[1:] <= at)).any(axis=0)
            cost[out] = EVENT_MISSED
        return cost, q, at

    def bring_back(self, u: Array) -> Array:
        """Return states (K, M) that return more nearly, by Newton's method on the map.

        Steps are of least length where they are not unique, as along a family or a motion.
        """
        unit = self.unit
        for _ in range(RETURN_STEPS):
            away = RETURN_SHIFT * unit * np.eye(unit.size)
            around = np.concatenate([u[None], u + away[:, None]]).reshape(-1, unit.size)
            missed = self._gap(self.follow(self.of_energy(around))).reshape(
                len(away) + 1, len(u), -1
            )
            slope = np.moveaxis((missed[1:] - missed[0]) / RETURN_SHIFT, 0, -1)
            good = np.isfinite(slope).all(axis=(1, 2)) & np.isfinite(missed[0]).all(axis=1)
            u, slope, miss = u[good], slope[good], missed[0][good]
            if not len(u):
                break
            step = -(np.linalg.pinv(slope, rcond=1e-3) @ miss[..., None])[..., 0]
            largest = np.abs(step).max(axis=1, keepdims=True)
            u = u + step * np.minimum(1.0, RETURN_STEP / np.maximum(largest, 1e-300)) * unit
        return self.of_energy(u)

    def _gap(self, batch: TracedRays) -> Array:
        """Return how far motions are from where they began, (K, 2 n); NaN where they get lost."""
        found = np.full((len(batch.u), 2 * self.size.size), np.nan)
        if len(batch.tracks) == len(self.legs):
            track, live = batch.tracks[-1]
            at = batch.times[live, -1]
            q, v = track.at(track.step(at), np.arange(live.size), at)
            found[live] = self._return(q, v, self.begin(batch.u[live])[:2])
        return found
