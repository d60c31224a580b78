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
# Rotations at each point, until what is left of the curvature is so small a part of it. Stiff
# directions hide the softest one: with four rotations and a plane the dimer climbed along a wrong
# one, and went on for ever.
DIMER_ROTATIONS, DIMER_ROTATED = 20, 0.05
CLIMBING_STEPS = 1000
CHANGES_KEPT = 100  # steps from which curvature is known: 20 took three times as many steps
LONGEST_CLIMB = 0.2  # of x in one step; ad hoc
FORCE_LEFT = 1e-9  # of the force, relative to that at the beginning


def relax(force: Callable[[Array], tuple[Array, bool]], x: Array) -> tuple[Array, bool]:
    """Follow a force to where it vanishes; return x there, and whether it does.

    `force(x)` returns it, and whether it can vanish near x; if not, it is followed a fixed way.
    """
    x, changes, before, least = np.array(x, dtype=float), [], None, None
    for _ in range(CLIMBING_STEPS):
        push, ends = force(x)
        push, size = push.ravel(), float(np.linalg.norm(push))
        least = FORCE_LEFT * max(size, 1.0) if least is None else least
        if ends and size <= least:
            return x, True
        if ends and before is not None and before[0] @ (before[1] - push) > 0:
            changes = [*changes[1 - CHANGES_KEPT :], (before[0], before[1] - push)]
        step = limited_memory(push, changes)
        if not (ends and step @ push > 0):
            changes, step = [], push
        longest = float(np.max(np.abs(step)))
        if longest > LONGEST_CLIMB or not ends:
            step = step * LONGEST_CLIMB / max(longest, 1e-300)
        before = (step, push) if ends else None
        x = x + step.reshape(x.shape)
    return x, False


def limited_memory(force: Array, changes: Sequence[tuple[Array, Array]]) -> Array:
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


def dimer(problem: Any, x0: Array) -> tuple[Array, None, bool]:
    """Return a saddle that is reached from x0 (n,) by climbing along the softest direction.

    Source: G. Henkelman and H. Jonsson, J. Chem. Phys. 111 (1999), 7010-7022; with the steps of
    J. Kastner and P. Sherwood, J. Chem. Phys. 128 (2008), 014106, by a limited memory.
    """
    _check(problem)
    direction = np.random.default_rng(0).normal(size=x0.size)
    direction = direction / np.linalg.norm(direction)

    def force(x: Array) -> tuple[Array, bool]:
        nonlocal direction

        def curve(along: Array) -> Array:
            ends = (problem.gradient(x + s * DIMER_LENGTH * along) for s in (1, -1))
            return (next(ends) - next(ends)) / (2 * DIMER_LENGTH)

        direction, curvature = softest(curve, direction)
        slope = problem.gradient(x)
        uphill = float(slope @ direction)
        if curvature < 0:
            return 2 * uphill * direction - slope, True
        return np.copysign(1.0, uphill) * direction, False

    x, rests = relax(force, x0)
    return x, None, rests


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


def elastic_band(problem: Any, start: Array, end: Array, images: int = 9) -> tuple[Array, bool]:
    """Return points (images, n) along the way of least climb between two minima.

    The highest one climbs to the saddle. The second value is whether the band came to rest.

    Source: G. Henkelman, B. P. Uberuaga and H. Jonsson, J. Chem. Phys. 113 (2000), 9901-9904; with
    the steps of D. Sheppard, R. Terrell and G. Henkelman, J. Chem. Phys. 128 (2008), 134106.
    """
    _check(problem)
    s = np.linspace(0, 1, images + 2)[1:-1, None]

    def force(band: Array) -> tuple[Array, bool]:
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
        return push, True

    return relax(force, (1 - s) * start + s * end)


def _check(problem: Any) -> None:
    if problem.m or problem.has_bounds:
        raise ValueError(
            "expected a program without constraints and bounds, found one that has some"
        )
