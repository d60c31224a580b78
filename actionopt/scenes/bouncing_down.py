r"""A ball that bounces down a slope.

        *
        :   .-.
        : .'   '.
        '.       \   .-'''-.
          '-.     \ /       o       x, y from where it would first touch the slope uphill
             '-.   '
                '-.

Across the slope it bounces as on a level floor under a weaker gravity, always to the same height
and in equal times; along the slope it gains speed evenly, whatever the bounces do. When and where
it touches is not given but found.
"""

from __future__ import annotations

import numpy as np

from actionopt.mechanics.question.events import Bounce
from actionopt.scenes._legs import flight, rough
from actionopt.scenes._scene import Facts, Setup, Words
from actionopt.scenes._shapes import body, ground
from actionopt.scenes.projectile import lagrangian

__all__ = ["SOURCE", "TITLE", "WORDS", "lagrangian", "scene"]

TITLE = "a ball that bounces down a slope"
SOURCE = "Galperin, Chaos 12 (2002), on billiards in a field; Jia, Mason and Erdmann (1996)"
WORDS = Words(
    question="A ball falls on a slope and bounces. Is the time from bounce to bounce ever longer?",
    answer="No, it is always the same: only the way along the slope grows.",
    look="The leaps get longer and longer, and each takes as long as the one before.",
    captions={
        "energies": "What it has lost in height it has gained in speed; no bounce takes any."
    },
    beside=("projectile", "throw_at_cart", "billiard_circle"),
)


def scene(*, m=1.0, g=9.81, lean=0.3, height=0.5, bounces=3, last=0.4):
    """Drop a mass m (kg) from the `height` (m), square to it, over a slope that falls by `lean`.

    It bounces so many times; the path ends after the part `last` of one more leap. The facts have
    the time from one bounce to the next, `leap` (s). Raises ValueError unless the slope is less
    steep than a wall.
    """
    if not (abs(lean) < np.pi / 2 and height > 0 and 0 < last < 1):
        raise ValueError(
            f"expected |lean| < pi / 2, height > 0 and 0 < last < 1, found {lean}, {height}, {last}"
        )
    along = np.array([np.cos(lean), -np.sin(lean)])
    across = np.array([np.sin(lean), np.cos(lean)])
    push, weight = g * np.sin(lean), g * np.cos(lean)
    fall = np.sqrt(2 * height / weight)
    times = np.r_[0.0, fall * (1 + 2 * np.arange(bounces))]
    T = times[-1] + 2 * last * fall
    up = np.r_[0.0, np.full(bounces, weight * fall)]  # speeds across the slope, behind a bounce
    points = np.outer(push * times**2 / 2, along)
    points[0] = height * across
    velocities = np.outer(push * times, along) + np.outer(up, across)
    place, velocity = flight(times, points, velocities, (0.0, -g))
    # The integral of v^2: along the slope, and across it in leaps of which the last is cut short.
    rest = weight * fall * (1 - 2 * last)
    squares = push**2 * T**3 / 3
    squares += ((weight * fall) ** 3 * (2 * bounces) - rest**3) / (3 * weight)
    energy = m * g * height * across[1]
    return Setup(
        ["x", "y"],
        T,
        draw=lambda q, t: [ground((0.0, 0.0), 1.1 * (place(T) @ along) * along), body(q)],
        exact=place,
        guess=rough([*points, place(T)]),
        through=[Bounce(lambda q, t: across[0] * q[0] + across[1] * q[1])] * bounces,
        facts=Facts(
            velocity=velocity,
            action=float(m * squares - energy * T),
            energy=float(energy),
            event_times=times[1:].tolist(),
            conserved={"energy": lambda q, v, t: m * (v[0] ** 2 + v[1] ** 2) / 2 + m * g * q[1]},
            numbers={"leap": float(2 * fall)},
        ),
    )
