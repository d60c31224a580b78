r"""Two particles on a line, coupled through one combination of their places.

    ----[ m ]------------[ m ]-----
         q1               q2

U depends on a q1 + b q2 only, so (q1, q2) -> (q1 + b d, q2 - a d) changes nothing.
"""

import numpy as np

from actionopt.scenes._scene import Facts, Setup, Words, conjugates, curve
from actionopt.scenes._shapes import body, ground

TITLE = "two particles on a line, coupled"
SOURCE = "Competitive Physics: Mechanics and Waves (2018), section 12.5, p. 644"
WORDS = Words(
    question=(
        "Two particles are coupled through one combination of their places. What moves freely?"
    ),
    answer="The other combination: it moves evenly, as if nothing were coupled.",
    look="Both particles drift the same way, and one of them hurries when the other dawdles.",
    captions={
        "motion": "Two particles on one line: the distance between them changes and comes back.",
        "path": "Each path is a straight line with a sine on it, of opposite effect on the two.",
        "conserved": "Neither momentum is conserved; that of the free combination is.",
    },
    beside=("oscillator",),
)


def lagrangian(q, v, t, *, m, k, a, b):
    """L = m (q1'^2 + q2'^2) / 2 + U, with U = -k (a q1 + b q2)^2 / 2."""
    q1, q2 = q
    u1, u2 = v
    return m * (u1**2 + u2**2) / 2 - k * (a * q1 + b * q2) ** 2 / 2


def scene(*, m=1.0, k=1.0, a=1.0, b=-0.5, start=(0.3, 1.0), end=(0.8, 1.6), duration=2.0):
    """Join two pairs (q1, q2) (m) in `duration` (s); a and b are pure numbers.

    a q1 + b q2 oscillates at sqrt(k (a^2 + b^2) / m), b q1 - a q2 moves uniformly. Raises
    ValueError if the duration is a multiple of half the period.
    """
    T, c = duration, a**2 + b**2
    w = float(np.sqrt(k * c / m))
    foci = conjugates(w, T)
    s = np.sin(w * T)
    (u0, w0), (u1, w1) = ((a * x + b * y, b * x - a * y) for x, y in (start, end))

    def pair(u, x):
        return (a * u + b * x) / c, (b * u - a * x) / c

    def position(t):
        return pair((u0 * np.sin(w * (T - t)) + u1 * np.sin(w * t)) / s, w0 + (w1 - w0) * t / T)

    def velocity(t):
        u = w * (u1 * np.cos(w * t) - u0 * np.cos(w * (T - t))) / s
        return pair(u, (w1 - w0) / T + 0 * t)

    def energy(q, v, t):
        return m * (v[0] ** 2 + v[1] ** 2) / 2 + k * (a * q[0] + b * q[1]) ** 2 / 2

    reach = 1.3 * max(np.max(np.abs(start)), np.max(np.abs(end)))
    return Setup(
        ["q1", "q2"],
        T,
        ends=(start, end),
        draw=lambda q, t: [
            ground((-reach, 0.0), (reach, 0.0)),
            body((q[0], 0.0)),
            body((q[1], 0.0)),
        ],
        exact=curve(position),
        facts=Facts(
            velocity=curve(velocity),
            **foci,
            conserved={
                "energy": energy,
                "b p1 - a p2": lambda q, v, t: m * (b * v[0] - a * v[1]),
            },
        ),
    )
