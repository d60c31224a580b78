r"""A charge in uniform electric and magnetic fields, in the plane across the magnetic one.

    y |   .-.   .-.
      |  (   ) (   )          B out of the plane, E along x
      | ' `o' `-'
      +------------ x

The potential energy depends on the velocity, through the symmetric vector potential.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np

from actionopt.mechanics.problem import Event, Problem
from actionopt.mechanics.system import System
from actionopt.scenes._scene import Scene, curve, defaults
from actionopt.scenes._shapes import body, ground

TITLE = "charge in uniform E and B, in the plane"
SOURCE = (
    "Competitive Physics: Mechanics and Waves (2018), section 12.5.1, p. 642; Feynman and "
    "Hibbs, Quantum Mechanics and Path Integrals (1965), problem 3-10"
)


def lagrangian(q, v, t, *, m, e, B, E):
    """L = m (x'^2 + y'^2) / 2 + e B (x y' - y x') / 2 + e E x."""
    x, y = q
    vx, vy = v
    return m * (vx**2 + vy**2) / 2 + e * B * (x * vy - y * vx) / 2 + e * E * x


@cache
def system() -> System:
    """Return the system, derived once."""
    return System(
        lagrangian,
        ["x", "y"],
        parameters=defaults(scene, "m", "e", "B", "E"),
        name="charge_planar",
    )


def scene(
    *,
    m: float = 1.0,
    e: float = 1.0,
    B: float = 2.0,
    E: float = 0.3,
    start: Sequence[float] = (0.2, -0.1),
    end: Sequence[float] = (1.0, 0.5),
    duration: float = 2.0,
) -> Scene:
    """Join two points (m) in `duration` (s): charge e (C), B (T), E (V/m) along x.

    The facts have the `cyclotron` frequency w = e B / m (rad/s) and the `drift` velocity E / B
    (m/s) along -y. Raises ValueError if the duration is a multiple of 2 pi / w.
    """
    T, w = duration, e * B / m
    exact, velocity = drifting(w, E / B, start, end, T)
    times = np.repeat(2 * np.pi / abs(w) * np.arange(1, 4 + int(abs(w) * T / (2 * np.pi))), 2)
    facts = {
        "velocity": velocity,
        "acceleration": lambda q, v, t: np.stack([e * E / m + w * v[1], -w * v[0]]),
        "conjugate_times": times,
        "morse_index": int(np.sum(times < T)),
        "cyclotron": w,
        "drift": E / B,
        "conserved": {
            "energy": lambda q, v, t: m * (v[0] ** 2 + v[1] ** 2) / 2 - e * E * q[0],
            "momentum of translations along x": lambda q, v, t: m * v[0] - e * B * q[1] - e * E * t,
            "momentum of translations along y": lambda q, v, t: m * v[1] + e * B * q[0],
        },
    }
    return Scene(
        Problem(
            system(),
            Event(0.0, start),
            Event(T, end),
            parameters={"m": m, "e": e, "B": B, "E": E},
        ),
        TITLE,
        SOURCE,
        draw=lambda q, t: [ground(start), ground(end), body(q)],
        exact=exact,
        facts=facts,
    )


def drifting(w: float, drift: float, start: Sequence[float], end: Sequence[float], T: float):
    """Return curves q(t), q'(t) of x'' = w drift + w y', y'' = -w x' between two points.

    With z = x + i y: z = z0 - i drift t + u (1 - exp(-i w t)) / (i w), u the velocity at the
    start less the drift. Raises ValueError at conjugate ends.
    """
    z0, z1 = complex(*start), complex(*end)
    whole = 1 - np.exp(-1j * w * T)
    if abs(whole) < 1e-12:
        raise ValueError(
            f"expected a duration that is no multiple of 2 pi / {w}, found {T}: there every "
            "orbit has closed; choose a slightly different duration"
        )
    u = 1j * w * (z1 - z0 + 1j * drift * T) / whole

    def position(t):
        z = z0 - 1j * drift * t + u * (1 - np.exp(-1j * w * t)) / (1j * w)
        return z.real, z.imag

    def velocity(t):
        z = u * np.exp(-1j * w * t) - 1j * drift
        return z.real, z.imag

    return curve(position), curve(velocity)
