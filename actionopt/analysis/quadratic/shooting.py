"""Shooting: forward motions from one event, for guesses: many at once, none accurate.

All motions are integrated together by the Runge-Kutta pair of Dormand and Prince, each with
steps of its own, and all are aimed at their targets together, by Newton's method on their initial
velocities. What arrives is a guess for a path between the two events.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from actionopt.analysis.quadratic.second_variation import tangent
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.meshes.path import Path
from actionopt.mechanics.laws.evaluation import solve_motion
from actionopt.mechanics.question.problem import Problem
from actionopt.tools.types import Array, NDInt
from actionopt.tools.watch import Watch, check_time

# Ad hoc: what comes of it is a guess, and Newton's method does the rest.
STEP_ERROR = 1e-5  # of one step
MOTION_STEPS = 400  # most, of one motion; what needs more comes too close to a singularity
ENERGY_LOST = 1e3  # errors of a step in which the energy was not kept: a quarter of it is next
JUMP_STEP = 1e-12  # of the time, after which it jumps
AIMS = 12  # Newton steps towards a target
NUDGE = 1e-6  # relative change of a velocity that tells the derivative, to a hundredth
ARRIVAL_TOL = 1e-3  # of the coordinates' sizes: near enough for a guess
GUESS_DEGREE = 6  # of the elements of a guess, of three steps each; what they say, three cubics

# Dormand and Prince, J. Comput. Appl. Math. 6 (1980), p. 19: times, stages, and the difference of
# the two results. The last stage is the result of order five.
DOPRI_TIMES = np.array([0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1, 1])
DOPRI_STAGES = (
    np.array([]),
    np.array([1 / 5]),
    np.array([3 / 40, 9 / 40]),
    np.array([44 / 45, -56 / 15, 32 / 9]),
    np.array([19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729]),
    np.array([9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656]),
    np.array([35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84]),
)
DOPRI_ERROR = np.array([71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40])


def shoot(problem: Problem, v0: Array, *, patient: bool = False, back: bool = False) -> Array:
    """Return where motions from the start event with velocities v0 (n, G, K) end, (n, G, K).

    Or from the end event `back` to the start's time.
    """
    q0 = np.array((problem.end if back else problem.start).q, dtype=float)[:, None, None]
    return fly(problem, np.broadcast_to(q0, v0.shape), v0, patient=patient, back=back)[0]


def fly(
    problem: Problem,
    q0: Array,
    v0: Array,
    watch: Watch | None = None,
    *,
    patient: bool = False,
    back: bool = False,
) -> tuple[Array, Array]:
    """Return coordinates and velocities at the end of motions from q0 and v0, all (n, G, K).

    K motions in groups of G that share their steps, so that differences within a group are
    smooth. NaN where a motion does not stay finite. What takes far longer than half of the others
    is given up, but where `patient`: motions of unlike speeds do. They begin at the start's time,
    or go `back` from the end's.
    """
    begin, T = problem.end if back else problem.start, problem.duration
    t0, T = np.full(v0.shape[2], begin.t), np.full(v0.shape[2], -T if back else T)
    look = watch and watch.look
    return integrate(problem, (t0, q0, v0), T, watch=look, patient=patient)


def integrate(
    problem: Problem,
    start: tuple[Array, Array, Array],
    span: Array,
    *,
    accuracy: float = STEP_ERROR,
    steps: int = MOTION_STEPS,
    track: list | None = None,
    watch: Callable[[int], None] | None = None,
    patient: bool = False,
    arrived: Callable[[NDInt, Array, Array], Array] | None = None,
    kept: float = np.inf,
) -> tuple[Array, Array]:
    """Return (q, v) of motions after the times `span` (K,), back in time where it is negative.

    They start at `start`, times (K,), coordinates and velocities (n, G, K), and make no more than
    `steps` steps; `watch` is called before each, with the steps up to it. They end before where
    `arrived` says so, of the motions that made a step, which they are, where (n, A) and when (A,).
    `track` receives (times (K,), q, v (n, K)) of the first of each group after every step. No step
    changes the energy, where it is to be `kept`, by more than so much of what it is made of: forces
    that a motion meets in a moment are in no stage of a longer step. The rest is as for `fly`.
    """
    begin, q0, v0 = start
    n, group, count = v0.shape
    unit = problem.lengths[:, None, None]
    speed = np.maximum(
        np.max(np.abs(v0), axis=(1, 2)), problem.lengths / np.max(np.abs(span), initial=0.0)
    )[:, None, None]
    q, v, t = q0.copy(), v0.copy(), np.zeros(count)
    h, T, way = np.abs(span) / 50, np.abs(span), np.sign(span)
    live, done, patience = np.arange(count), 0, steps
    with np.errstate(all="ignore"):
        pull = _acceleration(problem, q, v, begin)  # what a step ends with, the next begins with
        known = energies(problem, q, v) if kept < np.inf else None
        while live.size and done < patience:
            done += 1
            check_time()
            if watch is not None:
                watch(done)
            hurried = track is None and not patient
            if hurried and live.size <= count / 2 and patience == steps:
                # What takes far longer than half of them is too close to a singularity.
                patience = min(steps, 3 * done + 20)
            y, forth = np.stack([q[:, :, live], v[:, :, live]]), way[live]
            step = np.minimum(h[live], T[live] - t[live])
            rates = np.empty((len(DOPRI_TIMES), *y.shape))
            rates[0] = forth * y[1], forth * pull[:, :, live]
            for k in range(1, len(DOPRI_TIMES)):
                before = rates[:k].reshape(k, -1)
                here = y + step * (DOPRI_STAGES[k] @ before).reshape(y.shape)
                times = begin[live] + forth * (t[live] + DOPRI_TIMES[k] * step)
                rates[k] = forth * here[1], forth * _acceleration(problem, here[0], here[1], times)
            error = step * (DOPRI_ERROR @ rates.reshape(len(rates), -1)).reshape(y.shape)
            scale = accuracy * np.stack(
                [
                    np.maximum(np.abs(y[0] - q0[:, :, live]), 1e-2 * unit),
                    np.maximum(np.abs(y[1]), 1e-2 * speed),
                ]
            )
            size = np.sqrt(np.mean((error / scale) ** 2, axis=(0, 1, 2)))
            lost = ~np.isfinite(here).all(axis=(0, 1, 2)) & (step < 1e-9 * T[live])
            size = np.where(np.isfinite(size), size, 1e9)
            if known is not None:
                there = energies(problem, *here)
                off = np.abs(there[0] - known[0][:, live]).max(axis=0)
                jumped = ~(off <= kept * np.maximum(there[1], known[1][:, live]).max(axis=0))
                size = np.where(jumped, np.maximum(size, ENERGY_LOST), size)
                lost |= jumped & (step < JUMP_STEP * T[live])
            good = size <= 1
            now = live[good]
            q[:, :, now], v[:, :, now] = here[0][..., good], here[1][..., good]
            pull[:, :, now] = (forth * rates[-1, 1])[..., good]
            t[now] += step[good]
            if known is not None:
                for old, new in zip(known, there, strict=True):
                    old[:, now] = new[:, good]
            h[live] = step * np.clip(0.9 * (size + 1e-12) ** -0.2, 0.1, 5.0)
            if track is not None:
                track.append((begin + way * t, q[:, 0].copy(), v[:, 0].copy()))
            going = ~lost & (t[live] < T[live] * (1 - 1e-12))
            if arrived is not None:
                going[good] &= ~arrived(now, q[:, 0, now], begin[now] + way[now] * t[now])
            live = live[going]
    short = t < T * (1 - 1e-12)
    q[:, :, short] = v[:, :, short] = np.nan
    return q, v


def energies(problem: Problem, q: Array, v: Array) -> tuple[Array, Array]:
    """Return v . L_v - L at q and v (n, ...), and what it is made of, |v . L_v| + |L|, (...).

    Of laws that know no time.
    """
    shape, t = q.shape[1:], np.full((q[0].size, 1), problem.start.t)
    at = q.reshape(len(q), -1).T, v.reshape(len(v), -1).T
    _, p, L = problem.system.pointwise("first")(*at, t, problem.packed)
    moving, L = np.sum(p * at[1], axis=1), L[:, 0]
    return (moving - L).reshape(shape), (np.abs(moving) + np.abs(L)).reshape(shape)


def _acceleration(problem: Problem, q: Array, v: Array, t: Array) -> Array:
    """Return the accelerations (n, G, K) at q and v, each (n, G, K), and times t (K,)."""
    system, shape, n = problem.system, q.shape, len(q)
    times = np.concatenate([t] * (q[0].size // t.size))
    state = q.reshape(n, -1).T, v.reshape(n, -1).T, times[:, None], problem.packed
    if not system.m and system.has_diagonal_mass:
        mass, bias = system.pointwise("even_motion")(*state)
        return np.array((bias / mass).T, dtype=float).reshape(shape)
    if system.has_constrained_motion:
        return np.array(system.pointwise("constrained_motion")(*state)[0].T).reshape(shape)
    try:
        a = solve_motion(*system.pointwise("motion")(*state))[:, :n]
    except np.linalg.LinAlgError:  # one singular motion spoils the batch
        return np.full(shape, np.nan)
    return np.array(a.T, dtype=float).reshape(shape)


def motions(
    problem: Problem, v0: Array, q0: Array | None = None, watch: Watch | None = None
) -> list[Path | None]:
    """Return the motions with velocities v0 (n, K) as paths, on elements of three steps each.

    They leave from q0 (n, K), by default the start event. None stands for one that does not
    stay finite.
    """
    if q0 is None:
        q0 = np.repeat(np.array(problem.start.q, dtype=float)[:, None], v0.shape[1], axis=1)
    (found,) = flights(problem, q0, v0, (problem.duration,), watch)
    t0, t1 = problem.start.t, problem.end.t
    return [each.path(t0, t1) if each.times[-1] == t1 else None for each in found]


class Flight(NamedTuple):
    """A motion as it was integrated: times (K,), coordinates and velocities (n, K) after steps."""

    times: Array
    q: Array
    v: Array

    def path(self, start: float, end: float, steps: int = 3) -> Path:
        """Return the motion up to a time as a path, on elements of so many steps each."""
        inside = self.times - start < (end - start) * (1 - 1e-9)
        since = np.append((self.times[inside] - start)[::steps], end - start)
        return Path.interpolate(hermite(*self), Mesh.over(start, end, since, GUESS_DEGREE))

    def after(self, later: Flight) -> Flight:
        """Return the motion with what comes of it later."""
        return Flight(*(np.concatenate(pair, axis=-1) for pair in zip(self, later, strict=True)))


def flights(
    problem: Problem,
    q0: Array,
    v0: Array,
    spans: Iterable[float],
    watch: Watch | None = None,
    accuracy: float = STEP_ERROR,
    kept: float = np.inf,
) -> Iterator[list[Flight]]:
    """Yield motions from q0 and v0 (n, K) at the start, carried on to each of the times `spans`.

    Times since the start, which increase. A motion ends earlier if it does not stay finite, or if
    it takes more than `MOTION_STEPS` steps from one of these times to the next, as before a
    collision.
    """
    t0 = float(problem.start.t)
    found = [Flight(np.array([t0]), *(x[:, [k]] for x in (q0, v0))) for k in range(v0.shape[1])]
    going = range(len(found))
    for T in spans:
        track: list[tuple[Array, Array, Array]] = []
        if going:
            t, q, v = (np.stack([found[k][i][..., -1] for k in going], -1) for i in range(3))
            state, look = (t, q[:, None], v[:, None]), watch and watch.look
            ends, _ = integrate(
                problem, state, t0 + T - t, accuracy=accuracy, track=track, watch=look, kept=kept
            )
        if track:
            times, q, v = (np.array(rows) for rows in zip(*track, strict=True))
            whole: Array = np.isfinite(ends).min(axis=(0, 1))
            for i, k in enumerate(going):
                new: Array = np.diff(times[:, i], prepend=t[i]) > 0  # no step was refused
                made = times[new, i]
                if whole[i]:
                    made[-1] = t0 + T
                found[k] = found[k].after(Flight(made, q[new, :, i].T, v[new, :, i].T))
            going = [k for i, k in enumerate(going) if whole[i]]
        yield list(found)


def hermite(times: Array, q: Array, v: Array, *, slope: bool = False):
    """Return the cubic spline with the values q and slopes v (n, K) at the times (K,).

    As a function of times, or its `slope`.
    """

    def curve(t: Array) -> Array:
        i = np.clip(np.searchsorted(times, t, side="right") - 1, 0, times.size - 2)
        return _cubic(times, q, v, i, t, slope)

    return curve


def states(flights: Sequence[Flight], times: Sequence[Array]) -> tuple[Array, Array]:
    """Return coordinates and velocities (n, K) of motions at times of each, one after the other.

    As `hermite` does, of motions of two steps and more.
    """
    made, parts = (
        Flight(*(np.concatenate(each, axis=-1) for each in zip(*flights, strict=True))),
        [],
    )
    first = 0
    for flight, t in zip(flights, times, strict=True):
        last = flight.times.size - 2
        parts.append(first + (flight.times.searchsorted(t, "right") - 1).clip(0, last))
        first += last + 2
    i, t = np.concatenate(parts), np.concatenate(times)
    return _cubic(*made, i, t, False), _cubic(*made, i, t, True)


def _cubic(times: Array, q: Array, v: Array, i: NDInt, t: Array, slope: bool) -> Array:
    """Return what the cubics between the times i (K,) and the next ones are at t (K,), (n, K)."""
    h = times[i + 1] - times[i]
    s = (t - times[i]) / h
    rise, forth, back = s * s * (3 - 2 * s), h * s * (1 - s) ** 2, h * s * s * (1 - s)
    if slope:
        rise, forth, back = 6 * s * (1 - s) / h, (1 - s) * (1 - 3 * s), s * (2 - 3 * s)
    a = 0 if slope else q[:, i]
    return a + (q[:, i + 1] - q[:, i]) * rise + forth * v[:, i] - back * v[:, i + 1]


def aim(problem: Problem, v0: Array, targets: Array, *, back: bool = False) -> tuple[Array, NDInt]:
    """Change the velocities v0 (n, K) until the motions end at `targets` (n, K).

    Motions from the start event, or `back` from the end event. Returns the velocities of those that
    arrive and their positions in the list. Each motion takes damped Newton steps of its own, least
    squares where constraints leave fewer velocities than coordinates.
    """
    begin = problem.end if back else problem.start
    q = np.array(begin.q, dtype=float)
    basis = directions(problem, q, float(begin.t))
    apart = np.abs(targets - q[:, None])
    unit = np.maximum(problem.lengths, np.max(apart, axis=1))[:, None, None]

    def gap(v: Array, which: NDInt) -> Array:
        return (shoot(problem, v, back=back) - targets[:, None, which]) / unit

    return newton(v0, basis, gap)


def close(problem: Problem, q0: Array, v0: Array, units: Array) -> tuple[Array, Array, NDInt]:
    """Change motions from q0 and v0 (n, K) until they close; return those that do, and which.

    The coordinates that the start gives stay, and their velocities need not return. `units` (2 n,)
    are those of coordinates and velocities.
    """
    n = len(v0)
    free = np.setdiff1d(np.arange(n), problem.start.pinned)
    asked = np.r_[np.arange(n), n + free]  # what has to return
    order = np.r_[problem.order, n + np.array(problem.order)]
    advance = np.r_[problem.advance, np.zeros(n)][:, None, None]

    def miss(q0: Array, v0: Array, q: Array, v: Array) -> Array:
        gap = np.concatenate([q, v]) - np.concatenate([q0, v0])[order] - advance
        return gap[asked] / units[asked, None, None]

    return arrive(problem, q0, v0, units, miss)


def arrive(
    problem: Problem,
    q0: Array,
    v0: Array,
    units: Array,
    miss: Callable[[Array, Array, Array, Array], Array],
    watch: Watch | None = None,
) -> tuple[Array, Array, NDInt]:
    """Change motions from q0 and v0 (n, K) until they miss nothing; return those, and which.

    The coordinates that the start gives stay. `miss(q0, v0, q, v)`, (n, G, A) each, are rows
    (r, G, A) that vanish for states at the start and the end; `units` (2 n,) are those of
    coordinates and velocities.
    """
    n = len(v0)
    varied = np.r_[np.setdiff1d(np.arange(n), problem.start.pinned), n + np.arange(n)]

    def gap(x: Array, which: NDInt) -> Array:
        y = np.repeat(np.concatenate([q0, v0])[:, None, which], x.shape[1], axis=1)
        y[varied] = x * units[varied, None, None]
        return miss(y[:n], y[n:], *fly(problem, y[:n], y[n:], watch=watch))

    y = np.concatenate([q0, v0])
    x, arrived = newton(y[varied] / units[varied, None], np.eye(varied.size), gap)
    y = y[:, arrived]
    y[varied] = x * units[varied, None]
    return y[:n], y[n:], arrived


def newton(
    x: Array,
    basis: Array,
    gap,
    nudged: float = NUDGE,
    near: float = ARRIVAL_TOL,
    steps: int = AIMS,
) -> tuple[Array, NDInt]:
    """Change x (d, K) along the basis (d, r) until the gaps vanish; each column by itself.

    `gap(x, which)` returns those of x (d, G, A), groups beside the columns `which` (A,). Returns
    the columns whose gaps come below `near`, and which they are.
    """
    count, r = x.shape[1], basis.shape[1]
    nudge = nudged * np.max(np.abs(x), axis=0)
    best, miss, part = x.copy(), np.full(count, np.inf), np.ones(count)
    step, trial, active = np.zeros_like(x), x.copy(), np.arange(count)
    for _ in range(steps):
        h = nudge[active]
        trials = np.stack([trial[:, active]] * (r + 1), axis=1)
        trials[:, 1:] += basis[:, :, None] * h
        gaps = gap(trials, active)
        J = (gaps[:, 1:] - gaps[:, :1]) / h
        size = np.linalg.norm(gaps[:, 0], axis=0)
        good = np.isfinite(size) & (size < miss[active]) & np.isfinite(J).all(axis=(0, 1))
        part[active] = np.where(good, np.minimum(1.0, 2 * part[active]), part[active] / 4)
        k = active[good]
        best[:, k], miss[k] = trial[:, k], size[good]
        inverse = np.linalg.pinv(J[:, :, good].transpose(2, 0, 1), rcond=1e-12)
        change = -basis @ np.einsum("Arm,mA->rA", inverse, gaps[:, 0, good])
        # No farther at once than half the velocity itself: the trials should not collapse.
        long = np.linalg.norm(change, axis=0) / np.maximum(
            np.linalg.norm(best[:, k], axis=0), 1e-300
        )
        step[:, k] = change / np.maximum(1.0, 2 * long)
        trial = best + part * step
        active = np.flatnonzero((miss > near / 10) & (part > 1e-3))
        if not active.size:
            break
    arrived = np.flatnonzero(miss < near)
    return best[:, arrived], arrived


def speeds(problem: Problem, far: Array) -> tuple[Array, Array]:
    """Return speeds (k,) that may matter, relative to the units (n,) of the coordinates.

    They are those for the displacement `far` (n,) in the time there is, for the force to turn
    within the coordinates' own size, and for the force to act over half the time.
    """
    units = np.maximum(problem.lengths, np.abs(far))
    start, end = (np.array(e.q, dtype=float)[:, None] for e in (problem.start, problem.end))
    rng = np.random.default_rng(0)
    q = start + (end - start) * np.linspace(0.05, 0.95, 16)
    q = q + 0.3 * units[:, None] * rng.standard_normal(q.shape)
    times = np.full(q.shape[1], problem.start.t)
    with np.errstate(all="ignore"):
        a = _acceleration(problem, q, 0 * q, times)
    a = np.abs(a) / units[:, None]
    force = float(np.median(a[np.isfinite(a)])) if np.isfinite(a).any() else 0.0
    T = problem.duration
    scales = np.array([np.max(np.abs(far) / units) / T, np.sqrt(force), force * T / 2, 1 / T])
    return scales[scales > 1e-3 * np.max(scales)], units


def velocities(problem: Problem, far: Array, count: int, rng: np.random.Generator) -> Array:
    """Return initial velocities (n, count) in all directions, from slow to fast.

    Of one degree of freedom they are in order, from the fastest one way to the fastest the other.
    """
    scales, units = speeds(problem, far)
    if problem.system.degrees_of_freedom == 1:
        fastest = 2.5 * np.max(scales)
        speed = np.geomspace(np.min(scales) / 4, fastest, count // 4)
        even = np.linspace(-fastest, fastest, count - 2 * speed.size)
        along = directions(problem, np.array(problem.start.q, dtype=float), problem.start.t)
        speed = np.sort(np.concatenate([speed, -speed, even])) * np.max(units)
        return on_constraints(problem, along * speed)
    speed = rng.choice(scales, count) * np.exp(rng.uniform(np.log(0.3), np.log(2.0), count))
    return in_directions(problem, units[:, None] * speed, rng)


def about(problem: Problem, count: int, rng: np.random.Generator) -> Array:
    """Return initial velocities (n, count) about that of the straight line, near and far.

    They differ from it by as much as the forces along that line would change it. The system has no
    constraints.
    """
    start, end = (np.array(e.q, dtype=float)[:, None] for e in (problem.start, problem.end))
    n, T, sample = start.size, problem.duration, 64
    mean = (end - start) / T
    s = rng.uniform(0.0, 1.0, sample)
    q = (
        start
        + (end - start) * s
        + 0.1 * problem.lengths[:, None] * rng.standard_normal((n, sample))
    )
    times = problem.start.t + T * s
    with np.errstate(all="ignore"):
        v = np.repeat(mean, sample, axis=1)
        a = np.abs(_acceleration(problem, q, v, times))
    good = np.isfinite(a).all(axis=0)
    force = np.median(a[:, good], axis=1) if good.any() else np.zeros(n)
    width = force[:, None] * T / 2 + 0.3 * np.abs(mean)
    reach = np.exp(rng.uniform(np.log(0.05), np.log(1.5), count))
    return mean + width * reach * rng.standard_normal((n, count))


def in_directions(problem: Problem, speed: Array, rng: np.random.Generator) -> Array:
    """Return velocities (n, K) of given speeds (n or 1, K) in random directions.

    They are tangent to the constraints, and move with them.
    """
    system = problem.system
    if system.n == 2:  # evenly round the circle, by the golden section
        turn = 2 * np.pi * (rng.random() + np.arange(speed.shape[1]) * 0.6180339887498949)
        v = speed * np.stack([np.cos(turn), np.sin(turn)])
    else:
        direction = rng.standard_normal((system.n, speed.shape[1]))
        v = speed * direction / np.linalg.norm(direction, axis=0)
    return on_constraints(problem, v)


def directions(problem: Problem, q: Array, t: float) -> Array:
    """Return the directions (n, n - m) of motion that the constraints leave at q (n,), t."""
    return tangent(problem, q[None], np.array([[t]]), np.ones(len(q)))[0]


def on_constraints(problem: Problem, v: Array) -> Array:
    """Return velocities v (n, K) at the start, changed so that they move with the constraints."""
    system = problem.system
    if not system.m:
        return v
    q, t = np.array(problem.start.q, dtype=float), problem.start.t
    G = system.constraint_jacobian(q, t, parameters=problem.parameters)
    rate = system.pointwise("constraint_rate")
    drift = rate(q[None], np.array([[t]]), problem.packed)[0][0]
    return v - np.linalg.pinv(G) @ (G @ v + drift[:, None])
