"""First paths by single shooting: motions that set out from the start and arrive as the end asks.

Paths that are followed from one over a given duration, or from the nearest point of a surface, are
one family of many; motions in all directions belong to all of them. Where a time is free, each is
cut off where it misses least of what the end asks; between given times, all are changed until they
miss nothing, by Newton's method on their initial states.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from actionopt.analysis.quadratic.shooting import (
    Flight,
    arrive,
    flights,
    in_directions,
    motions,
    states,
    velocities,
)
from actionopt.discrete.borders.borders import over
from actionopt.discrete.meshes.path import Path
from actionopt.mechanics.question.problem import Problem
from actionopt.solver.ends.closed import LOOKED_AT
from actionopt.solver.ends.durations import rates, return_time, times_along
from actionopt.solver.kinds.first_paths import given_time, straight, stretch_guess
from actionopt.solver.search.two_sided_shooting import HITS
from actionopt.tools.types import Array
from actionopt.tools.watch import Watch

# Ad hoc, where nothing else is said.
# How far motions are followed, in the durations along the straight line, or up and back.
SPANS = (1.5, 6.0, 24.0)
# After the second of these, motions are given up of which none has passed near the end: a potential
# is in the way. Measured: of 25 paths so found at random, over systems of 2 and 3 coordinates, none
# had been missed by all motions until then.
TURNED_BACK = SPANS[1]
PASSING_ERROR = 1e-4  # of a step of such motions
PASSED_BY = 0.5  # of the units: motions that miss more lead nowhere
PASSAGES, PASSES_EACH = 16, 3  # passages from which paths are sought; of one motion
THROWN = 2 * HITS  # motions that set out
# Their speeds between given times, in those that the forces and the way to the nearest point
# suggest. Measured on 14 random systems of 2 and 3 coordinates, at one speed: 1 leads to paths of 5
# of them, 3 of 11, 5 of 13, 8 of 14.
SLOWER, FASTER = 1.0, 8.0
# Speeds of motions whose energy is not that which is given, in u + sqrt(u^2 + v^2): v is that of
# the energy, and a free body meets a surface that moves with u as it should if its speed is this.
SLOWEST, FASTEST = 0.2, 2.0


class MissUnits(NamedTuple):
    """Units of what motions miss: coordinates (n,), momenta times these, and the energy."""

    q: Array
    action: float
    energy: float

    @classmethod
    def of(cls, problem: Problem, size: Array, q: Array, v: Array, t: float) -> MissUnits:
        """Return the units for motions from q and v (n, K)."""
        at = q.T, v.T, np.full((q.shape[1], 1), t), problem.packed
        p = problem.system.pointwise("first")(*at)[1]
        action = float(np.median(np.linalg.norm(p * size, axis=1)))
        energy = float(np.median(np.abs(np.sum(p * v.T, axis=1))))
        return cls(size, action or 1.0, energy or 1.0)


def misses(problem: Problem, k: int, state: tuple[Array, Array, Array], unit: MissUnits) -> Array:
    """Return by how much states miss the start (k = 0) or the end (k = 1), (rows, K).

    States are coordinates and velocities (n, K) at times (K,). The rows are the coordinates that
    the event gives, its surface, the momentum along that, and the energy if motions do not keep it;
    NaN where a state is not finite.
    """
    q, v, t = state
    event, system = (problem.start, problem.end)[k], problem.system
    given = list(event.pinned)
    free = np.setdiff1d(np.arange(system.n), given)
    lost = ~np.isfinite(q + v).all(axis=0)
    q, v, later = np.where(lost, 0.0, q), np.where(lost, 0.0, v), 0.0
    with np.errstate(all="ignore"):
        target = np.array([event.q[i] for i in given], dtype=float)[:, None]
        rows = [(q[given] - target) / unit.q[given, None]]
        any_energy = event.t is not None or _keeps_energy(problem)
        if any_energy and event.on is None and not free.size:  # nothing is asked of velocities
            return np.where(lost, np.nan, rows[0])
        at = q.T, v.T, t[:, None], problem.packed
        _, p, L = (x.copy() for x in system.pointwise("first")(*at))
        pull = p[:, free] * unit.q[free]
        if event.on is not None:
            on, by_q, by_t = event.on.along(q.T, t, problem.packed)
            by_q = np.nan_to_num(by_q[:, :, free] * unit.q[free])
            rows.append((on / np.abs(by_q).max(axis=2)).T)
            # p = mu on_q + what is left along the surface, H - E = -mu on_t
            mu = np.linalg.pinv(by_q @ by_q.transpose(0, 2, 1)) @ (by_q @ pull[..., None])
            pull = pull - (mu.transpose(0, 2, 1) @ by_q)[:, 0]
            later = (mu[..., 0] * by_t).sum(axis=1)
        rows.append(pull.T / unit.action)
        if not any_energy:
            H = np.sum(p * v.T, axis=1) - L[:, 0]
            rows.append((H + later - problem.energy)[None] / unit.energy)
    return np.where(lost, np.nan, np.concatenate(rows))


def can_depart(problem: Problem) -> bool:
    """Whether motions can set out from the start of a problem, to be looked at.

    Not where there are constraints, whose velocities would have to be drawn from the tangent space,
    nor where motions depend on a time at which they start that is to be found.
    """
    clocked = problem.system.structure.depends_on_time or problem.has_moving_surface
    return not (problem.system.m or problem.closes or (problem.start.t is None and clocked))


def arrivals(
    problem: Problem, starts: Sequence[Problem], size: Array, watch: Watch | None
) -> Iterator[Path]:
    """Yield motions that end nearly as a problem asks.

    They set out from the events of `starts`: its own, or points of its surface.
    """
    if starts and can_depart(problem):
        way = _passing if problem.free_time else _aim
        yield from way(problem, starts, size, watch)


def _keeps_energy(problem: Problem) -> bool:
    """Whether motions that set out with the energy asked for arrive with it."""
    structure = problem.system.structure
    return not (structure.forced or structure.depends_on_time or problem.has_moving_surface)


def _aim(
    problem: Problem, starts: Sequence[Problem], size: Array, watch: Watch | None
) -> Iterator[Path]:
    """Yield motions between given times, changed until they miss nothing, slow ones first."""
    rng, t0, t1 = np.random.default_rng(0), problem.start.t, problem.end.t
    q, v = [], []
    for fixed in starts:
        ends, count = straight(fixed)[[0, -1]], -(-THROWN // len(starts))
        known = velocities(fixed, ends[1] - ends[0], count, rng)
        v.append(known * np.exp(rng.uniform(np.log(SLOWER), np.log(FASTER), known.shape[1])))
        q.append(np.repeat(ends[0][:, None], known.shape[1], axis=1))
    q0, v0 = np.concatenate(q, axis=1), np.concatenate(v, axis=1)
    unit = MissUnits.of(problem, size, q0, v0, t0)

    def miss(q0: Array, v0: Array, q: Array, v: Array) -> Array:
        ends = []
        for k, t, x, rate in ((0, t0, q0, v0), (1, t1, q, v)):
            flat = x.reshape(len(x), -1), rate.reshape(len(x), -1), np.full(x[0].size, t)
            ends.append(misses(problem, k, flat, unit).reshape(-1, *x.shape[1:]))
        return np.concatenate(ends)

    units = np.concatenate([size, np.abs(v0).max(axis=1)])
    q0, v0, _ = arrive(problem, q0, v0, units, miss, watch)
    slow = np.argsort(np.linalg.norm(v0 / size[:, None], axis=0))
    found = motions(problem, v0[:, slow], q0[:, slow], watch) if slow.size else []
    yield from (path for path in found if path is not None)


def _passing(
    problem: Problem, starts: Sequence[Problem], size: Array, watch: Watch | None
) -> Iterator[Path]:
    """Yield motions of the energy, cut off where they miss least, those of short ones first."""
    rng, n = np.random.default_rng(0), problem.system.n
    t = given_time(problem)
    conserved = _keeps_energy(problem)
    q, v, longest = [], [], 0.0
    for fixed in starts:
        line, count = straight(fixed), -(-THROWN // len(starts))
        u = in_directions(fixed, np.repeat(size[:, None], count, axis=1), rng)
        u = np.array([size, -size]).T if n == 1 and conserved else u
        q0 = np.repeat(line[:1], u.shape[1], axis=0)
        rate, left = rates(fixed, q0, u.T, np.full((len(q0), 1), t))
        if conserved and not left[0] > 0:
            continue
        if not conserved:
            fastest = np.sqrt(np.abs(left)) if not left[0] > 0 else rate
            rate = meeting_speed(problem, line[[0, -1]], size, t, fastest)
            rate = rate * rng.uniform(SLOWEST, FASTEST, len(q0))
        known = times_along(fixed, line, t)
        last = 0.0 if known is None else float(known[0][-1])
        longest = max(longest, last, return_time(fixed, line[0], t))
        q.append(q0.T)
        v.append(rate * u)
    if not q:
        return
    q0, v0 = np.concatenate(q, axis=1), np.concatenate(v, axis=1)
    unit = MissUnits.of(problem, size, q0, v0, t)
    spans, near = [span * longest for span in SPANS], False
    for span, passed in zip(
        SPANS, passages(problem, q0, v0, spans, unit, watch=watch), strict=True
    ):
        near = near or bool(passed)
        yield from (cut_off(problem, motion, end) for _, motion, end in passed[:PASSAGES])
        if span == TURNED_BACK and not near:
            return


def meeting_speed(problem: Problem, q: Array, size: Array, t: float, speed: ArrayLike) -> Array:
    """Return u + sqrt(u^2 + v^2) for a `speed` v and that of surfaces, u, in sizes over time.

    So fast a free body of the energy v^2 / 2 meets a surface that runs away from it, p along its
    normal and H - E its speed times that. `q` (2, n) are points near the surfaces of both events.
    """
    moving = 0.0
    for event, at in zip((problem.start, problem.end), q, strict=True):
        if event.on is not None:
            _, by_q, by_t = event.on.along(at[None], np.full(1, t), problem.packed)
            slope = np.linalg.norm(by_q[0] * size, axis=1)
            moving += max((abs(by_t[0]) / slope)[slope > 0].tolist(), default=0.0)
    return moving + np.hypot(moving, speed)


def passages(
    problem: Problem,
    q0: Array,
    v0: Array,
    spans: Sequence[float],
    unit: MissUnits,
    *,
    most: int = PASSES_EACH,
    watch: Watch | None = None,
) -> Iterator[list[tuple[float, Flight, float]]]:
    """Yield by how much motions from q0 and v0 (n, K) miss the end, which, and when that is least.

    They are carried on to each of the times `spans`, with up to `most` passages between; the
    nearest come first.
    """
    long, since = over(problem, spans[-1]), 0.0
    t0 = long.start.t
    for span, going in zip(spans, flights(long, q0, v0, spans, watch, PASSING_ERROR), strict=True):
        found, step = [], (span - since) / LOOKED_AT
        looked_at = t0 + np.arange(since and since - 2 * step, span + step / 2, step)
        looked_at[-1], since = t0 + span, span
        going, times = [flight for flight in going if flight.times[-1] > looked_at[0]], []
        for flight in going:
            # Besides at the motion's own steps: a long span may hold hundreds of its oscillations.
            own = flight.times[flight.times > looked_at[0]]
            times.append(np.sort(np.concatenate([looked_at[looked_at <= own[-1]], own])))
        if not going:
            yield []
            continue
        state = *states(going, times), np.concatenate(times)
        away = np.linalg.norm(misses(problem, 1, state, unit), axis=0)
        parts = np.split(away, np.cumsum([t.size for t in times[:-1]]))
        for flight, t, away in zip(going, times, parts, strict=True):
            low = (away[1:-1] <= away[:-2]) & (away[1:-1] < away[2:]) & (away[1:-1] < PASSED_BY)
            found += [(float(away[i]), flight, t[i]) for i in 1 + np.flatnonzero(low)[:most]]
        yield sorted(found, key=lambda item: item[0])


def cut_off(problem: Problem, motion: Flight, end: float) -> Path:
    """Return a motion up to a time, moved to the coordinates that the events give."""
    return stretch_guess(problem, motion.path(float(motion.times[0]), end))
