"""Equal bodies that attract each other and follow one another along one curve."""

from __future__ import annotations

import numpy as np

from actionopt.mechanics.question.events import State
from actionopt.scenes._scene import Facts, Setup, curve
from actionopt.scenes._shapes import body
from actionopt.tools.types import Array


def attraction(q: Array, m, G):
    """Return the sum over i < j of G m^2 / |r_i - r_j|, for q = (x1, y1, x2, y2, ...)."""
    x, y, count = q[0::2], q[1::2], len(q) // 2
    pairs = [(i, j) for i in range(count) for j in range(i + 1, count)]
    near = sum(1 / np.sqrt((x[i] - x[j]) ** 2 + (y[i] - y[j]) ** 2) for i, j in pairs)
    return G * m**2 * near


def part(
    r: Array,
    v: Array,
    period: float,
    action: float,
    m,
    G,
    length,
    *,
    index: int | None = None,
    turning: float | None = None,
) -> Setup:
    """Return the part of a choreography until each of N bodies stands where the next one stood.

    Parameters
    ----------
    r, v : (N, 2) array
        Places and velocities at unit masses and G.
    period, action : float
        The period of the whole then, and S over it.
    m, G, length : float
        Mass, constant of gravity and unit of length.
    index : int, optional
        Of the part between its ends.
    turning : float, optional
        The rate at which all turn, at unit masses and G, if they do so as one body.
    """
    count, speed = len(r), np.sqrt(G * m / length)
    q0, q1 = (length * x.ravel() for x in (r, np.roll(r, -1, axis=0)))
    v0, v1 = (speed * x.ravel() for x in (v, np.roll(v, -1, axis=0)))
    T, whole = period / count * length / speed, m * speed * length * action

    def guess(t):
        s = t / T
        a, b = s**2 * (3 - 2 * s), s * (1 - s)
        rows = zip(q0, q1, v0, v1, strict=True)
        return [x + (y - x) * a + T * b * ((1 - s) * p - s * r) for x, y, p, r in rows]

    def turn(row, t):
        a = turning * speed / length * t
        x, y = row.T.reshape(2, -1, *[1] * np.ndim(t))
        x, y = np.cos(a) * x - np.sin(a) * y, np.sin(a) * x + np.cos(a) * y
        return np.stack([x, y], axis=1).reshape(2 * count, *np.shape(t))

    return Setup(
        [f"{c}{i}" for i in range(1, count + 1) for c in "xy"],
        T,
        ends=(q0, q1) if turning is None else None,
        draw=lambda q, t: [body(q[i : i + 2]) for i in range(0, 2 * count, 2)],
        guess=curve(guess) if turning is None else None,
        exact=None if turning is None else curve(lambda t: length * turn(r, t)),
        facts=Facts(
            velocity=None if turning is None else curve(lambda t: speed * turn(v, t)),
            start=State(0.0, q0, v0) if turning is None else None,
            action=whole / count,
            energy=-m * speed**2 * action / (3 * period),  # the virial theorem
            morse_index=index,
            conserved={
                "energy": lambda q, v, t: m * np.sum(v**2, axis=0) / 2 - attraction(q, m, G),
                "momentum, x": lambda q, v, t: m * np.sum(v[0::2], axis=0),
                "momentum, y": lambda q, v, t: m * np.sum(v[1::2], axis=0),
                "angular momentum": lambda q, v, t: (
                    m * np.sum(q[0::2] * v[1::2] - q[1::2] * v[0::2], axis=0)
                ),
            },
            numbers={"period": count * T, "period_action": whole},
        ),
    )
