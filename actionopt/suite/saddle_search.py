"""Small reference solvers for saddles of index 1: the dimer method, and a nudged elastic band.

Both take programs without constraints or bounds; variables are taken in the sizes that x0 and the
ends have. They are made to be read, and to compare others with.

    actionopt suite run --saddle --solver actionopt.suite.saddle_search:dimer --problem pendulum_row
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from actionopt.tools.types import Array

DIMER_LENGTH = 1e-4  # half the distance of its ends
DIMER_ROTATIONS = 4  # at each point
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

    Source: G. Henkelman and H. Jonsson, J. Chem. Phys. 111 (1999), 7010-7022.
    """
    _check(problem)
    direction = np.random.default_rng(0).normal(size=x0.size)
    direction = direction / np.linalg.norm(direction)

    def curve(x: Array, along: Array) -> Array:
        ends = (problem.gradient(x + s * DIMER_LENGTH * along) for s in (1, -1))
        return (next(ends) - next(ends)) / (2 * DIMER_LENGTH)

    def force(x: Array) -> Array:
        nonlocal direction
        bent = curve(x, direction)
        for _ in range(DIMER_ROTATIONS):
            aside = bent - (bent @ direction) * direction
            size = np.linalg.norm(aside)
            if size <= 1e-8 * max(np.linalg.norm(bent), 1e-300):
                break
            plane = np.stack([direction, aside / size])
            images = np.stack([bent, curve(x, plane[1])])
            inner = plane @ images.T
            turn = np.linalg.eigh((inner + inner.T) / 2)[1][:, 0]
            turned = turn @ plane
            # Near the softest direction `aside` is round-off, and not quite at right angles.
            longer = np.linalg.norm(turned)
            direction, bent = turned / longer, turn @ images / longer
        slope = problem.gradient(x)
        uphill = (slope @ direction) * direction
        return 2 * uphill - slope if bent @ direction < 0 else uphill

    x, rests = relax(force, x0)
    return x, None, rests


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
