"""A hundred masses in a row on springs that stiffen (Fermi, Pasta, Ulam, Tsingou 1955)."""

from __future__ import annotations

import numpy as np

from benchmarks.problems._case import Case, no_partials
from benchmarks.problems._stored import stored

NAME = "lattice"
MASSES, BETA = 100, 1.0
DURATION = 5.0
_K = np.arange(1, MASSES + 1)
_FIRST, _SECOND = (np.sin(np.pi * s * _K / (MASSES + 1)) for s in (1, 2))
RELEASES = (
    (2.0 * _FIRST, 0.3 * _SECOND),
    (2.0 * _FIRST, 0.4 * _SECOND),
)


def lagrangian(q, v, t, *, beta):
    """L = sum of v^2 / 2 - (d^2 / 2 + beta d^4 / 4), d the stretch of each spring, walls fixed."""
    inner = q[1:] - q[:-1]
    d2 = inner**2
    energy = np.sum(d2) / 2 + beta * np.sum(d2**2) / 4
    for edge in (q[0], q[-1]):
        energy = energy + edge**2 / 2 + beta * edge**4 / 4
    return (v @ v) / 2 - energy


def _stretch(q):
    return np.concatenate([q[:1], q[1:] - q[:-1], -q[-1:]])


def acceleration(q, v, t, x):
    """Return the difference of the tensions on either side."""
    d = _stretch(q)
    tension = d + BETA * d * d * d
    return tension[1:] - tension[:-1]


def partials(q, v, t):
    """Return the tridiagonal stiffness."""
    d = _stretch(q)
    k = 1 + 3 * BETA * d**2
    A, i = no_partials(q), np.arange(MASSES)
    A[i, i] = -(k[1:] + k[:-1])
    A[i[1:], i[:-1]] = A[i[:-1], i[1:]] = k[1:-1]
    return A, no_partials(q)


def cases() -> list[Case]:
    """Return the case of this file."""
    return [
        Case(
            name=NAME,
            title="lattice of 100 masses",
            lagrangian=lagrangian,
            coordinates=[f"u{k}" for k in range(MASSES)],
            parameters={"beta": BETA},
            acceleration=acceleration,
            partials=partials,
            duration=DURATION,
            ends=lambda: stored(NAME),
            size="large",
        )
    ]
