"""Three equal masses on an arc of the figure eight: no closed form, a stored reference."""

from __future__ import annotations

import numpy as np

from benchmarks.problems._case import Case, no_partials
from benchmarks.problems._stored import stored

NAME = "three_bodies"
DURATION = 2.0  # of the period 6.3259
# X. Li and S. Liao, Science China Physics 60 (2017) 129511, table I.A, orbit (ic) 1.
V1, V2 = 0.3471168881, 0.5327249454
_Q = (-1.0, 0.0, 1.0, 0.0, 0.0, 0.0)
_V = (V1, V2, V1, V2, -2 * V1, -2 * V2)
RELEASES = ((_Q, _V), (_Q, tuple(1.01 * v for v in _V)))
PAIRS = ((0, 1), (0, 2), (1, 2))


def lagrangian(q, v, t):
    """L = sum of v^2 / 2 + sum over pairs of 1 / distance; q = x1, y1, x2, y2, x3, y3."""
    potential = 0
    for i, j in PAIRS:
        dx, dy = q[2 * i] - q[2 * j], q[2 * i + 1] - q[2 * j + 1]
        potential = potential + 1 / np.sqrt(dx**2 + dy**2)
    return (v @ v) / 2 + potential


def acceleration(q, v, t, x):
    """Return the sum over the other bodies of (their place - mine) / distance^3."""
    a = [0] * 6
    for i, j in PAIRS:
        dx, dy = q[2 * j] - q[2 * i], q[2 * j + 1] - q[2 * i + 1]
        r2 = dx**2 + dy**2
        cube = r2 * x.sqrt(r2)
        for k, d in enumerate((dx, dy)):
            pull = d / cube
            a[2 * i + k] = a[2 * i + k] + pull
            a[2 * j + k] = a[2 * j + k] - pull
    return np.stack(a)


def partials(q, v, t):
    """Return the derivatives of the attraction, blocks (1 - 3 d d' / r^2) / r^3."""
    A = no_partials(q)
    eye = np.eye(2)[:, :, None]
    for i, j in PAIRS:
        d = q[2 * j : 2 * j + 2] - q[2 * i : 2 * i + 2]
        r2 = d[0] ** 2 + d[1] ** 2
        block = (eye - 3 * d[:, None] * d[None] / r2) / r2**1.5
        I, J = slice(2 * i, 2 * i + 2), slice(2 * j, 2 * j + 2)
        A[I, J] += block
        A[J, I] += block
        A[I, I] -= block
        A[J, J] -= block
    return A, no_partials(q)


def cases() -> list[Case]:
    """Return the case of this file."""
    return [
        Case(
            name=NAME,
            title="three bodies, figure eight",
            lagrangian=lagrangian,
            coordinates=("x1", "y1", "x2", "y2", "x3", "y3"),
            parameters={},
            acceleration=acceleration,
            partials=partials,
            duration=DURATION,
            ends=lambda: stored(NAME),
        )
    ]
