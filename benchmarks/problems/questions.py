"""Given energies, a closed orbit, ends at infinite times, and a geodesic: closed forms known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.special import ellipj, ellipk, ellipkinc

from benchmarks.problems._case import Case, Ends, along, no_partials, sample_times

DIGIT = 1  # of a duration that is to be found, where a peer needs a first one


def _found(exact, T: float, nominal: float, end: float) -> Ends:
    """Return the ends of a path of duration T, at equal parts of it."""
    q = exact(sample_times(nominal) * (T / nominal))[None]
    return Ends(q[:, 0].copy(), np.array([end]), q, duration=T)


def _over_the_top(E: float = 1.1) -> Case:
    """Return a pendulum that passes between two angles with more energy than at its top."""
    m = 2 / (1 + E)
    clock = lambda angle: ellipkinc(angle / 2, m) * np.sqrt(m)  # noqa: E731
    pairs = ((0.0, 4.0), (-0.5, 5.0))
    nominal = round(float(clock(4.0)), DIGIT - 1)

    def ends(a: float, b: float) -> Ends:
        exact = lambda t: 2 * ellipj((t + clock(a)) / np.sqrt(m), m)[3]  # noqa: E731
        return _found(exact, clock(b) - clock(a), nominal, b)

    return Case(
        name="pendulum_energy",
        title="pendulum, given energy",
        lagrangian=lambda q, v, t: v[0] ** 2 / 2 + np.cos(q[0]),
        coordinates=("phi",),
        parameters={},
        acceleration=lambda q, v, t, x: -x.sin(q),
        partials=lambda q, v, t: (-np.cos(q)[None], no_partials(q)),
        duration=nominal,
        ends=lambda: (ends(*pairs[0]), ends(*pairs[1])),
        asks="energy",
        energy=E,
    )


def _orbit(E: float = 2.0) -> Case:
    """Return a closed orbit of x'' = -x - x^3, x = A cn: Byrd and Friedman, 1971, number 130."""
    A2 = np.sqrt(1 + 4 * E) - 1
    m, rate = A2 / 2 / (1 + A2), np.sqrt(1 + A2)
    T = 4 * ellipk(m) / rate
    nominal = round(float(T), DIGIT - 1)

    def ends(x: float) -> Ends:
        u = -ellipkinc(np.arccos(x / np.sqrt(A2)), m)  # it rises
        found = _found(lambda t: np.sqrt(A2) * ellipj(u + rate * t, m)[1], T, nominal, x)
        return replace(found, start=found.end)  # exactly: peers measure misses by the ends

    return Case(
        name="orbit",
        title="closed orbit, given energy",
        lagrangian=lambda q, v, t: v[0] ** 2 / 2 - q[0] ** 2 / 2 - q[0] ** 4 / 4,
        coordinates=("x",),
        parameters={},
        acceleration=lambda q, v, t, x: -q - q**3,
        partials=lambda q, v, t: ((-1 - 3 * q**2)[None], no_partials(q)),
        duration=nominal,
        ends=lambda: (ends(0.0), ends(0.5)),
        starts=("bent",),
        asks="orbit",
        energy=E,
    )


def _kink(window: float = 8.0) -> Case:
    """Return the kink of x'' = 2 x (x^2 - 1), tanh t, and the way back."""
    times = sample_times(window)

    def ends(sign: float) -> Ends:
        q = sign * np.tanh(times - window / 2)[None]
        return Ends(np.array([-sign]), np.array([sign]), q)

    return Case(
        name="kink",
        title="kink between two wells",
        lagrangian=lambda q, v, t: v[0] ** 2 / 2 + (q[0] ** 2 - 1) ** 2 / 2,
        coordinates=("x",),
        parameters={},
        acceleration=lambda q, v, t, x: 2 * q * (q**2 - 1),
        partials=lambda q, v, t: ((6 * q**2 - 2)[None], no_partials(q)),
        duration=window,
        ends=lambda: (ends(1.0), ends(-1.0)),
        starts=("line",),
        asks="infinity",
    )


def _fish_eye() -> Case:
    """Return a ray in Maxwell's fish-eye, n = 2 / (1 + r^2): a great circle seen from its pole."""

    def sphere(q):
        return np.array([2 * q[0], 2 * q[1], q @ q - 1]) / (1 + q @ q)

    def ends(p, q) -> Ends:
        a, b = sphere(np.array(p)), sphere(np.array(q))
        angle = np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)

        def exact(t):
            way = np.outer(a, np.sin((1 - t) * angle)) + np.outer(b, np.sin(t * angle))
            way /= np.sin(angle)
            return way[:2] / (1 - way[2])

        return along(exact, sample_times(1.0))

    def length(q, v):
        return 2 * np.sqrt(v @ v) / (1 + q @ q)

    def acceleration(q, v, t, x):
        n = 2 / (1 + sum(q * q))
        return 2 * n * sum(q * v) * v - n * sum(v * v) * q

    def partials(q, v, t):
        n, qv, vv = 2 / (1 + sum(q * q)), sum(q * v), sum(v * v)
        eye = np.eye(2)[:, :, None]
        outer = lambda a, b: a[:, None] * b[None]  # noqa: E731
        by_q = 2 * n * outer(v, v) - n * vv * eye - n**2 * outer(2 * qv * v - vv * q, q)
        return by_q, 2 * n * (outer(v, q) + qv * eye - outer(q, v))

    return Case(
        name="fish_eye",
        title="ray in a fish-eye",
        lagrangian=lambda q, v, t: 2 * (v @ v) / (1 + q @ q) ** 2,
        coordinates=("x", "y"),
        parameters={},
        acceleration=acceleration,
        partials=partials,
        duration=1.0,
        ends=lambda: (ends((0.5, 0.0), (-0.2, 0.8)), ends((0.6, 0.1), (-0.1, 0.9))),
        length=length,
    )


def cases() -> list[Case]:
    """Return the cases of this file."""
    return [_over_the_top(), _orbit(), _kink(), _fish_eye()]
