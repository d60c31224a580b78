r"""A charge in uniform electric and magnetic fields, in the plane across the magnetic one.

    y |   .-.   .-.
      |  (   ) (   )          B out of the plane, E along x
      | ' `o' `-'
      +------------ x

The potential energy depends on the velocity, through the symmetric vector potential.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from actionopt.scenes._scene import Facts, Setup, Words, conjugates, curve
from actionopt.scenes._shapes import body, ground

TITLE = "charge in uniform E and B, in the plane"
SOURCE = (
    "Competitive Physics: Mechanics and Waves (2018), section 12.5.1, p. 642; Feynman and "
    "Hibbs, Quantum Mechanics and Path Integrals (1965), problem 3-10"
)
WORDS = Words(
    question=(
        "An electric field pulls a charge along x. Where does a magnetic field make it drift?"
    ),
    answer="Across both fields: it drifts along negative y, at the speed E / B.",
    look="The charge first moves away from where it is going, and turns clockwise all the way.",
    captions={
        "motion": (
            "The charge sets out backwards: the magnetic field bends its way round to the other "
            "event."
        ),
        "path": (
            "Two coordinates, one circle that drifts: the velocity turns at the cyclotron "
            "frequency."
        ),
        "conserved": (
            "Only H is conserved. Neither p is: the symmetric potential depends on both x and y."
        ),
    },
    beside=("charge_gauge", "charge_spatial"),
)


def lagrangian(q, v, t, *, m, e, B, E):
    """L = m (x'^2 + y'^2) / 2 + e B (x y' - y x') / 2 + e E x."""
    x, y = q
    vx, vy = v
    return m * (vx**2 + vy**2) / 2 + e * B * (x * vy - y * vx) / 2 + e * E * x


def scene(*, m=1.0, e=1.0, B=2.0, E=0.3, start=(0.2, -0.1), end=(1.0, 0.5), duration=2.0):
    """Join two points (m) in `duration` (s): charge e (C), B (T), E (V/m) along x.

    The facts have the `cyclotron` frequency w = e B / m (rad/s) and the `drift` velocity E / B
    (m/s) along -y. Raises ValueError if the duration is a multiple of 2 pi / w.
    """
    T, w = duration, e * B / m
    foci = conjugates(abs(w) / 2, T, multiplicity=2)
    exact, velocity = drifting(w, E / B, start, end, T)
    facts = Facts(
        velocity=velocity,
        acceleration=lambda q, v, t: np.stack([e * E / m + w * v[1], -w * v[0]]),
        **foci,
        conserved={
            "energy": lambda q, v, t: m * (v[0] ** 2 + v[1] ** 2) / 2 - e * E * q[0],
            "m x' - e B y - e E t": lambda q, v, t: m * v[0] - e * B * q[1] - e * E * t,
            "m y' + e B x": lambda q, v, t: m * v[1] + e * B * q[0],
        },
        numbers={"cyclotron": w, "drift": E / B},
    )
    return Setup(
        ["x", "y"],
        T,
        ends=(start, end),
        draw=lambda q, t: [ground(start), ground(end), body(q)],
        exact=exact,
        facts=facts,
    )


def drifting(w: float, drift: float, start: Sequence[float], end: Sequence[float], T: float):
    """Return curves q(t), q'(t) of x'' = w drift + w y', y'' = -w x' between two points.

    With z = x + i y: z = z0 - i drift t + u (1 - exp(-i w t)) / (i w), u the velocity at the
    start less the drift.
    """
    z0, z1 = complex(*start), complex(*end)
    u = 1j * w * (z1 - z0 + 1j * drift * T) / (1 - np.exp(-1j * w * T))

    def position(t):
        z = z0 - 1j * drift * t + u * (1 - np.exp(-1j * w * t)) / (1j * w)
        return z.real, z.imag

    def velocity(t):
        z = u * np.exp(-1j * w * t) - 1j * drift
        return z.real, z.imag

    return curve(position), curve(velocity)
