"""Small reference solvers for saddles of index 1: the dimer method, and a nudged elastic band.

Both take programs without constraints or bounds; variables are taken in the sizes that x0 and the
ends have. They are made to be read, and to compare others with.

    actionopt suite run --saddle --solver actionopt.suite.saddle_search:dimer --problem pendulum_row
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from actionopt.tools.types import Array

DIMER_LENGTH = 1e-4  # half the distance of its ends
DIMER_STEPS = 1000
# Rotations at each point, until what is left of the curvature is so small a part of it. Stiff
# directions hide the softest one: with four rotations and a plane the dimer climbed along a wrong
# one, and went on for ever.
DIMER_ROTATIONS, DIMER_ROTATED = 20, 0.05
DIMER_MEMORY = 100  # steps from which curvature is known: 20 took three times as many steps
DIMER_FARTHEST = 0.2  # of x in one step; ad hoc
FIRE_STEPS = 5000
FORCE_LEFT = 1e-9  # of the force, relative to that at the beginning
# Of FIRE, as published: after so many steps downhill the time step grows.
FIRE_AFTER, FIRE_GROWTH, FIRE_CUT, FIRE_MIX, FIRE_LESS = 5, 1.1, 0.5, 0.1, 0.99
FIRE_FIRST, FIRE_LONGEST, FIRE_FARTHEST = (
    0.05,
    0.5,
    0.2,
)  # time steps, and the most that x moves in one


def relax(force: Callable[[Array], Array], x: Array) -> tuple[Array, bool]:
    """Follow a force to where it vanishes; return x there, and whether it does.

    Source: E. Bitzek et al., Phys. Rev. Lett. 97 (2006), 170201 (FIRE).
    """
    velocity, dt, mix, downhill = np.zeros_like(x), FIRE_FIRST, FIRE_MIX, 0
    least = None
    for _ in range(FIRE_STEPS):
        push = force(x)
        size = float(np.linalg.norm(push))
        least = FORCE_LEFT * max(size, 1.0) if least is None else least
        if size <= least:
            return x, True
        if np.vdot(push, velocity) > 0:
            downhill += 1
            velocity = (1 - mix) * velocity + mix * np.linalg.norm(velocity) / size * push
            if downhill > FIRE_AFTER:
                dt, mix = min(dt * FIRE_GROWTH, FIRE_LONGEST), mix * FIRE_LESS
        else:
            velocity, dt, mix, downhill = np.zeros_like(x), dt * FIRE_CUT, FIRE_MIX, 0
        velocity = velocity + dt * push
        step = dt * velocity
        x = x + step * min(1.0, FIRE_FARTHEST / max(float(np.max(np.abs(step))), 1e-300))
    return x, False


def dimer(problem: Any, x0: Array) -> tuple[Array, None, bool]:
    """Return a saddle that is reached from x0 (n,) by climbing along the softest direction.

    Source: G. Henkelman and H. Jonsson, J. Chem. Phys. 111 (1999), 7010-7022; with the steps of
    J. Kastner and P. Sherwood, J. Chem. Phys. 128 (2008), 014106, by a limited memory.
    """
    _check(problem)
    x, slope = np.array(x0, dtype=float), problem.gradient(x0)
    least = FORCE_LEFT * max(float(np.linalg.norm(slope)), 1.0)
    direction = np.random.default_rng(0).normal(size=x.size)
    direction = direction / np.linalg.norm(direction)
    changes: list[tuple[Array, Array]] = []
    before = None

    def curve(along: Array) -> Array:
        ends = (problem.gradient(x + s * DIMER_LENGTH * along) for s in (1, -1))
        return (next(ends) - next(ends)) / (2 * DIMER_LENGTH)

    for _ in range(DIMER_STEPS):
        direction, curvature = softest(curve, direction)
        if curvature < 0 and np.linalg.norm(slope) <= least:
            return x, None, True
        uphill = float(slope @ direction)
        if curvature < 0:
            force = 2 * uphill * direction - slope
            if before is not None and before[0] @ (before[1] - force) > 0:
                changes = [*changes[1 - DIMER_MEMORY :], (before[0], before[1] - force)]
            step = _limited_memory(force, changes)
            step = step * min(1.0, DIMER_FARTHEST / max(float(np.max(np.abs(step))), 1e-300))
            before = step, force
        else:
            changes, before = [], None
            step = DIMER_FARTHEST * np.copysign(1.0, uphill) * direction
        x = x + step
        slope = problem.gradient(x)
    return x, None, False


def softest(curve: Callable[[Array], Array], direction: Array) -> tuple[Array, float]:
    """Return the direction (n,) of least curvature that rotations come to, and its curvature.

    `curve(along)` is the Hessian times a direction. Each rotation is to the least in the space of
    the direction, what is left there, and the last rotation.

    Source: A. V. Knyazev, SIAM J. Sci. Comput. 23 (2001), 517-541.
    """
    bent, last = curve(direction), []
    for _ in range(DIMER_ROTATIONS):
        curvature = float(bent @ direction)
        aside = bent - curvature * direction
        size = float(np.linalg.norm(aside))
        if size <= DIMER_ROTATED * abs(curvature):
            break
        space = np.stack([direction, aside / size, *last[:1]])
        images = np.stack([bent, curve(space[1]), *last[1:]])
        # Near the softest direction `aside` is round-off: what spans nothing new is left out.
        weight, axes = np.linalg.eigh(space @ space.T)
        axes = (axes / np.sqrt(np.maximum(weight, 1e-300)))[:, weight > 1e-8]
        inner = axes.T @ (space @ images.T) @ axes
        turn = axes @ np.linalg.eigh((inner + inner.T) / 2)[1][:, 0]
        step = np.append(0.0, turn[1:])
        longest = float(np.linalg.norm(step @ space))
        last = [step @ space / longest, step @ images / longest] if longest > 1e-10 else []
        direction, bent = turn @ space, turn @ images
        size = float(np.linalg.norm(direction))
        direction, bent = direction / size, bent / size
    return direction, float(bent @ direction)


def _limited_memory(force: Array, changes: Sequence[tuple[Array, Array]]) -> Array:
    """Return the step of a quasi-Newton method, from steps and the changes of minus the force.

    Source: J. Nocedal and S. J. Wright, *Numerical Optimization* (2006), algorithm 7.4.
    """
    step, parts = force.copy(), []
    for moved, change in reversed(changes):
        parts.append((moved @ step) / (moved @ change))
        step = step - parts[-1] * change
    if changes:
        moved, change = changes[-1]
        step = step * (moved @ change) / (change @ change)
    for (moved, change), part in zip(changes, reversed(parts), strict=True):
        step = step + moved * (part - (change @ step) / (moved @ change))
    return step


def elastic_band(problem: Any, start: Array, end: Array, images: int = 9) -> tuple[Array, bool]:
    """Return points (images, n) along the way of least climb between two minima.

    The highest one climbs to the saddle. The second value is whether the band came to rest.

    Source: G. Henkelman, B. P. Uberuaga and H. Jonsson, J. Chem. Phys. 113 (2000), 9901-9904.
    """
    _check(problem)
    s = np.linspace(0, 1, images + 2)[1:-1, None]

    def force(band: Array) -> Array:
        every = np.vstack([start, band, end])
        f = np.array([problem.objective(x) for x in every])
        slopes = np.stack([problem.gradient(x) for x in band])
        before, after = band - every[:-2], every[2:] - band
        rising, falling = f[2:] > f[1:-1], f[:-2] > f[1:-1]
        # The tangent points to the higher neighbour; at a top, it is the mean.
        uphill = np.where((rising & ~falling)[:, None], after, before + after)
        tangent = np.where((falling & ~rising)[:, None], before, uphill)
        tangent = tangent / np.linalg.norm(tangent, axis=1, keepdims=True)
        along = np.sum(slopes * tangent, axis=1, keepdims=True)
        apart = np.linalg.norm(after, axis=1) - np.linalg.norm(before, axis=1)
        push = along * tangent - slopes + apart[:, None] * tangent
        top = int(np.argmax(f[1:-1]))
        push[top] = 2 * along[top] * tangent[top] - slopes[top]
        return push

    return relax(force, (1 - s) * start + s * end)


def _check(problem: Any) -> None:
    if problem.m or problem.has_bounds:
        raise ValueError("expected a program without constraints and bounds, found one with them")
