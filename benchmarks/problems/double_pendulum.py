"""The double pendulum, released from rest: no closed form, a stored reference."""

from __future__ import annotations

import numpy as np

from actionopt.scenes import double_pendulum
from benchmarks.problems._case import Case
from benchmarks.problems._stored import stored

NAME = "double_pendulum"
DURATION = 2.0
RELEASES = (((1.0, 0.5), (0.0, 0.0)), ((1.0, 0.5), (0.1, -0.1)))  # q and v at time 0
G = 9.81

# Unit masses and lengths, a and b the angles, u and w their rates, c and s of a - b:
#   2 u' + c w' = -2 g sin a - s w^2
#   c u' +   w' =   -g sin b + s u^2


def acceleration(q, v, t, x):
    """Solve the two equations by Cramer's rule."""
    (a, b), (u, w) = q, v
    c, s = x.cos(a - b), x.sin(a - b)
    first = -2 * G * x.sin(a) - s * w**2
    second = -G * x.sin(b) + s * u**2
    det = 2 - c**2
    return np.stack([(first - c * second) / det, (2 * second - c * first) / det])


def partials(q, v, t):
    """Differentiate M acc = f: M dacc = df - dM acc."""
    (a, b), (u, w) = q, v
    c, s = np.cos(a - b), np.sin(a - b)
    du, dw = acceleration(q, v, t, np)
    zero = np.zeros_like(a)
    # d(a - b) is +1 for a and -1 for b; dM = -s [[0, 1], [1, 0]].
    twist = np.array([-c * w**2 + s * dw, c * u**2 + s * du])
    Fq = np.array([[twist[0], -twist[0]], [twist[1], -twist[1]]])
    Fq[0, 0] -= 2 * G * np.cos(a)
    Fq[1, 1] -= G * np.cos(b)
    Fv = np.array([[zero, -2 * s * w], [2 * s * u, zero]])
    inverse = np.array([[zero + 1, -c], [-c, zero + 2]]) / (2 - c**2)
    return np.einsum("ijk,jlk->ilk", inverse, Fq), np.einsum("ijk,jlk->ilk", inverse, Fv)


def cases() -> list[Case]:
    """Return the case of this file."""
    values = {"m1": 1.0, "m2": 1.0, "l1": 1.0, "l2": 1.0, "g": G}
    return [
        Case(
            name=NAME,
            title="double pendulum",
            lagrangian=double_pendulum.lagrangian,
            coordinates=("theta1", "theta2"),
            parameters=values,
            acceleration=acceleration,
            partials=partials,
            duration=DURATION,
            ends=lambda: stored(NAME),
        )
    ]
