"""Fans of forward motions from one event, for guesses: many at once, none accurate.

All motions are integrated together by the Runge-Kutta pair of Dormand and Prince, each with
steps of its own, and all are aimed at their targets together, by Newton's method on their initial
velocities. What arrives is a guess for a path between the two events.
"""

from __future__ import annotations

import numpy as np

from actionopt.path import Mesh, NDInt, Path
from actionopt.problem import Problem
from actionopt.quadratic_form import tangent
from actionopt.quadrature import Array

ACCURACY = 1e-5  # of one step
STEPS = 400  # most steps of one motion; what needs more comes too close to a singularity
AIMS = 12
NUDGE = 1e-6  # relative change of a velocity that tells the derivative
ARRIVED = 1e-3  # of the coordinates' sizes: near enough for a guess
DEGREE = 6  # of the elements of a guess; each spans three steps

# Dormand and Prince, J. Comput. Appl. Math. 6 (1980), p. 19: times, stages, and the difference of
# the two results. The last stage is the result of order five.
TIMES = np.array([0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1, 1])
STAGES = (
    np.array([]),
    np.array([1 / 5]),
    np.array([3 / 40, 9 / 40]),
    np.array([44 / 45, -56 / 15, 32 / 9]),
    np.array([19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729]),
    np.array([9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656]),
    np.array([35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84]),
)
ERROR = np.array([71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40])


def shoot(problem: Problem, v0: Array, track: list | None = None) -> Array:
    """Return where motions from the start event with velocities v0 (n, G, K) end, (n, G, K).

    K motions in groups of G that share their steps, so that differences within a group are
    smooth. NaN where a motion does not stay finite. `track` receives (times (K,), q, v (n, K))
    of the first of each group after every step.
    """
    n, group, count = v0.shape
    t0, T = problem.start.t, problem.duration
    unit = problem.scales[:, None, None]
    speed = np.maximum(np.max(np.abs(v0), axis=(1, 2)), problem.scales / T)[:, None, None]
    q = np.broadcast_to(np.array(problem.start.q, dtype=float)[:, None, None], v0.shape).copy()
    v, t, h = v0.copy(), np.zeros(count), np.full(count, T / 50)
    live, steps, patience = np.arange(count), 0, STEPS
    with np.errstate(all="ignore"):
        while live.size and steps < patience:
            steps += 1
            if track is None and live.size <= count / 2 and patience == STEPS:
                # What takes far longer than half of them is too close to a singularity.
                patience = min(STEPS, 3 * steps + 20)
            y, step = np.stack([q[:, :, live], v[:, :, live]]), np.minimum(h[live], T - t[live])
            rates = []
            for at, row in zip(TIMES, STAGES, strict=True):
                here = y + step * np.tensordot(row, np.array(rates), 1) if rates else y
                times = t0 + t[live] + at * step
                rates.append(np.stack([here[1], _acceleration(problem, here, times)]))
            error = step * np.tensordot(ERROR, np.array(rates), 1)
            scale = ACCURACY * np.stack(
                [np.maximum(np.abs(y[0]), 1e-2 * unit), np.maximum(np.abs(y[1]), 1e-2 * speed)]
            )
            size = np.sqrt(np.mean((error / scale) ** 2, axis=(0, 1, 2)))
            lost = ~np.isfinite(here).all(axis=(0, 1, 2)) & (step < 1e-9 * T)
            size = np.where(np.isfinite(size), size, 1e9)
            good = size <= 1
            done = live[good]
            q[:, :, done], v[:, :, done] = here[0][..., good], here[1][..., good]
            t[done] += step[good]
            h[live] = step * np.clip(0.9 * (size + 1e-12) ** -0.2, 0.1, 5.0)
            if track is not None:
                track.append((t0 + t, q[:, 0].copy(), v[:, 0].copy()))
            live = live[~lost & (t[live] < T * (1 - 1e-12))]
    q[:, :, t < T * (1 - 1e-12)] = np.nan
    return q


def _acceleration(problem: Problem, y: Array, t: Array) -> Array:
    """Return the accelerations (n, G, K) at y = (q, v), each (n, G, K), and times t (K,)."""
    system, n = problem.system, y.shape[1]
    times = np.broadcast_to(t, y.shape[2:]).reshape(-1)
    q, v = y[0].reshape(n, -1), y[1].reshape(n, -1)
    try:
        if system.m:
            a = system.acceleration(q, v, times, parameters=problem.parameters)
        else:
            motion = system.pointwise("motion")
            M, bias = motion(q.T, v.T, times[:, None], problem.packed)[:2]
            a = bias.T / M.T if n == 1 else np.linalg.solve(M.reshape(-1, n, n), bias[..., None])
            a = a if n == 1 else a[..., 0].T
    except np.linalg.LinAlgError:  # one singular motion spoils the batch
        return np.full(y.shape[1:], np.nan)
    return np.asarray(a, dtype=float).reshape(y.shape[1:])


def motions(problem: Problem, v0: Array) -> list[Path | None]:
    """Return the motions with velocities v0 (n, K) as paths, on elements of three steps each.

    None stands for one that does not stay finite.
    """
    q0 = np.array(problem.start.q, dtype=float)[:, None]
    start = np.full(v0.shape[1], problem.start.t), np.repeat(q0, v0.shape[1], axis=1), v0
    track: list[tuple[Array, Array, Array]] = [start]
    ends: Array = shoot(problem, v0[:, None], track)[:, 0]
    finite = np.isfinite(ends).min(axis=0)
    result: list[Path | None] = []
    for k in range(v0.shape[1]):
        if not bool(finite[k]):
            result.append(None)
            continue
        times = np.array([row[0][k] for row in track])
        keep = np.r_[True, np.diff(times) > 0]
        times = times[keep]
        q = np.array([row[1][:, k] for row in track])[keep].T
        v = np.array([row[2][:, k] for row in track])[keep].T
        times[-1] = problem.end.t
        corners = times[np.unique(np.r_[0 : times.size - 1 : 3, times.size - 1])]
        result.append(Path.interpolate(_hermite(times, q, v), Mesh(corners, DEGREE)))
    return result


def _hermite(times: Array, q: Array, v: Array):
    """Return the cubic spline with the values q and slopes v (n, K) at the times (K,)."""

    def curve(t: Array) -> Array:
        i = np.clip(np.searchsorted(times, t, side="right") - 1, 0, times.size - 2)
        h = times[i + 1] - times[i]
        s = (t - times[i]) / h
        a, b = q[:, i], q[:, i + 1]
        rise = s * s * (3 - 2 * s)
        return a + (b - a) * rise + h * s * (1 - s) * ((1 - s) * v[:, i] - s * v[:, i + 1])

    return curve


def aim(problem: Problem, v0: Array, targets: Array) -> tuple[Array, NDInt]:
    """Change the velocities v0 (n, K) until the motions end at `targets` (n, K).

    Returns the velocities of those that arrive and their positions in the list. Each motion
    takes damped Newton steps of its own, least squares where constraints leave fewer velocities
    than coordinates.
    """
    n, count = v0.shape
    q = np.array([problem.start.q], dtype=float)
    basis = tangent(problem, q, np.array([[problem.start.t]]), np.ones(n))[0]
    r = basis.shape[1]
    unit = np.maximum(problem.scales, np.max(np.abs(targets), axis=1))[:, None]
    nudge = NUDGE * np.max(np.abs(v0), axis=0)
    best, miss, part = v0.copy(), np.full(count, np.inf), np.ones(count)
    step, trial, active = np.zeros_like(v0), v0.copy(), np.arange(count)
    for _ in range(AIMS):
        h = nudge[active]
        fan = np.stack([trial[:, active]] * (r + 1), axis=1)
        fan[:, 1:] += basis[:, :, None] * h
        end = shoot(problem, fan)
        gap = (end[:, 0] - targets[:, active]) / unit
        J = (end[:, 1:] - end[:, :1]) / unit[:, None] / h
        size = np.linalg.norm(gap, axis=0)
        good = np.isfinite(size) & (size < miss[active]) & np.isfinite(J).all(axis=(0, 1))
        part[active] = np.where(good, np.minimum(1.0, 2 * part[active]), part[active] / 4)
        for i in np.flatnonzero(good):
            k = active[i]
            best[:, k], miss[k] = trial[:, k], size[i]
            change = -basis @ np.linalg.lstsq(J[:, :, i], gap[:, i], rcond=1e-12)[0]
            # No farther at once than half the velocity itself: the fan should not collapse.
            long = np.linalg.norm(change) / max(float(np.linalg.norm(best[:, k])), 1e-300)
            step[:, k] = change / max(1.0, 2 * long)
        trial = best + part * step
        active = np.flatnonzero((miss > ARRIVED / 10) & (part > 1e-3))
        if not active.size:
            break
    arrived = np.flatnonzero(miss < ARRIVED)
    return best[:, arrived], arrived


def speeds(problem: Problem, far: Array) -> tuple[Array, Array]:
    """Return speeds (k,) that may matter, relative to the units (n,) of the coordinates.

    They are those for the displacement `far` (n,) in the time there is, for the force to turn
    within the coordinates' own size, and for the force to act over half the time.
    """
    units = np.maximum(problem.scales, np.abs(far))
    start, end = (np.array(e.q, dtype=float)[:, None] for e in (problem.start, problem.end))
    rng = np.random.default_rng(0)
    q = start + (end - start) * np.linspace(0.05, 0.95, 16)
    q = q + 0.3 * units[:, None] * rng.standard_normal(q.shape)
    with np.errstate(all="ignore"):
        a = problem.system.acceleration(
            q, np.zeros_like(q), problem.start.t, parameters=problem.parameters
        )
    a = np.abs(a) / units[:, None]
    force = float(np.median(a[np.isfinite(a)])) if np.isfinite(a).any() else 0.0
    T = problem.duration
    scales = np.array([np.max(np.abs(far) / units) / T, np.sqrt(force), force * T / 2, 1 / T])
    return scales[scales > 1e-3 * np.max(scales)], units


def velocities(problem: Problem, far: Array, count: int, rng: np.random.Generator) -> Array:
    """Return initial velocities (n, count) in all directions, from slow to fast."""
    scales, units = speeds(problem, far)
    if problem.system.n == 1:
        fastest = 2.5 * np.max(scales)
        speed = np.geomspace(np.min(scales) / 4, fastest, count // 4)
        even = np.linspace(-fastest, fastest, count - 2 * speed.size)
        return np.sort(np.concatenate([speed, -speed, even]))[None, :] * units[0]
    speed = rng.choice(scales, count) * np.exp(rng.uniform(np.log(0.3), np.log(2.0), count))
    return directed(problem, units[:, None] * speed, rng)


def directed(problem: Problem, speed: Array, rng: np.random.Generator) -> Array:
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
    if system.m:
        q, t = np.array(problem.start.q, dtype=float), problem.start.t
        G = system.constraint_jacobian(q, t, parameters=problem.parameters)
        rate = system.pointwise("constraint_rate")
        drift = rate(q[None], np.array([[t]]), problem.packed)[0][0]
        v = v - np.linalg.pinv(G) @ (G @ v + drift[:, None])
    return v
