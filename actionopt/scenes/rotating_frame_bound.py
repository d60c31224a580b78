r"""A two-dimensional oscillator seen from a turning table.

    Y \   o      / X        the axes X, Y turn anticlockwise at w
       \    .  /
        \  ./  wt
         *------------ x    spring k to the centre

The Coriolis and centrifugal forces follow from writing T in the turning coordinates.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from actionopt.scenes._scene import Facts, Setup, Words, conjugates, curve, unit_sine
from actionopt.scenes._shapes import body, ground, spring

TITLE = "oscillator in a rotating frame"
SOURCE = "Competitive Physics: Mechanics and Waves (2018), section 12.3.1, pp. 631-633"
WORDS = Words(
    question="Seen from a turning table, what does a spring's motion look like?",
    answer=(
        "Bent by two forces more, Coriolis and centrifugal: they are in L once T is written in "
        "the turning coordinates."
    ),
    look=(
        "The table turns under the particle; where it was at the start is not where that mark "
        "is at the end."
    ),
    captions={
        "motion": (
            "Seen from outside the particle follows a part of an ellipse; the table's axes turn "
            "below it."
        ),
        "path": "In the turning coordinates the ellipse of the spring becomes another curve.",
        "conserved": (
            "H is conserved in the turning frame; it is the energy less w times the angular "
            "momentum."
        ),
    },
    beside=("oscillator_2d", "rotating_frame_free"),
)


def lagrangian(q, v, t, *, m, k, w):
    """L = m (X'^2 + Y'^2 + 2 w (X Y' - X' Y) + w^2 (X^2 + Y^2)) / 2 - k (X^2 + Y^2) / 2."""
    X, Y = q
    U, V = v
    kinetic = m * (U**2 + V**2 + 2 * w * (X * V - U * Y) + w**2 * (X**2 + Y**2)) / 2
    return kinetic - k * (X**2 + Y**2) / 2


def scene(*, m=1.0, k=2.0, w=0.8, start=(1.0, 0.0), end=(0.2, 0.7), duration=1.5):
    """Join two points (X, Y) (m) of a frame turning at w (rad/s) in `duration` (s).

    Raises ValueError if the duration is a multiple of pi / sqrt(k / m).
    """
    w0 = float(np.sqrt(k / m))
    foci = conjugates(w0, duration, multiplicity=2)
    exact, velocity = turned_curves(w0, w, start, end, duration)

    def acceleration(q, v, t):  # m a_rot = F - 2 m w x v_rot - m w x (w x r)
        coriolis = 2 * w * np.stack([v[1], -v[0]])
        return coriolis + (w**2 - k / m) * q

    def mechanical(q, v, t):
        (X, Y), (U, V) = q, v
        return m * ((U - w * Y) ** 2 + (V + w * X) ** 2) / 2 + k * (X**2 + Y**2) / 2

    return Setup(
        ["X", "Y"],
        duration,
        ends=(start, end),
        draw=lambda q, t: [
            *axes(w * t, 1.2 * float(np.linalg.norm(start))),
            spring((0.0, 0.0), rotate(q, w * t)),
            body(rotate(q, w * t)),
        ],
        kinetic=lambda q, v, t: m * ((v[0] - w * q[1]) ** 2 + (v[1] + w * q[0]) ** 2) / 2,
        exact=exact,
        facts=Facts(
            velocity=velocity,
            acceleration=acceleration,
            **foci,
            conserved={
                "energy in the frame at rest": mechanical,
                "angular momentum": lambda q, v, t: (
                    m * (q[0] * v[1] - q[1] * v[0] + w * (q[0] ** 2 + q[1] ** 2))
                ),
            },
        ),
    )


def turned_curves(w0: float, w: float, start: Sequence[float], end: Sequence[float], T: float):
    """Return curves q(t), q'(t), seen from a frame turning at w, of r'' = -w0^2 r at rest.

    With z = x + i y at rest and Z = z exp(-i w t) in the frame; w0 may be zero.
    """
    z0, z1 = complex(*start), complex(*end) * np.exp(1j * w * T)
    s = unit_sine(w0, T)

    def position(t):
        z = (z0 * unit_sine(w0, T - t) + z1 * unit_sine(w0, t)) / s
        Z = z * np.exp(-1j * w * t)
        return Z.real, Z.imag

    def velocity(t):
        z = (z0 * unit_sine(w0, T - t) + z1 * unit_sine(w0, t)) / s
        rate = (z1 * np.cos(w0 * t) - z0 * np.cos(w0 * (T - t))) / s
        Z = (rate - 1j * w * z) * np.exp(-1j * w * t)
        return Z.real, Z.imag

    return curve(position), curve(velocity)


def rotate(q, angle: float) -> np.ndarray:
    """Turn the plane vector q anticlockwise."""
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * q[0] - s * q[1], s * q[0] + c * q[1]])


def axes(angle: float, length: float):
    """Draw the axes of a frame turned by `angle`."""
    return [
        ground((0.0, 0.0), rotate((length, 0.0), angle)),
        ground((0.0, 0.0), rotate((0.0, length), angle)),
    ]
