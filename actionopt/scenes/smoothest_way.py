r"""The smoothest way through gates.

        o  .-'|'-.
        | /       \         from rest to rest, through two gates
        *          \   o
                    '._|

Of all ways through the gates at the given times the one has the least square of the acceleration,
on the whole, that is a cubic between them: the acceleration is continuous, and its rate jumps at
the gates. It is the curve that a thin lath takes between pins, the cubic spline.
"""

from __future__ import annotations

import numpy as np

from actionopt.mechanics.question.events import Event
from actionopt.scenes._legs import leg_of
from actionopt.scenes._scene import Facts, Measure, Setup, Words, curve
from actionopt.scenes._shapes import body, ground

TITLE = "the smoothest way through two gates"
SOURCE = "de Boor, A Practical Guide to Splines (1978), chapter V; Holladay (1957)"
WORDS = Words(
    question="Which way through two gates asks for the least acceleration?",
    answer="The cubic spline: a cubic between the gates, with a continuous acceleration.",
    look="It swings wide of straight lines; its acceleration has corners at the gates, no jumps.",
    captions={
        "conserved": "At the gates the momenta of the places jump, those of the velocities do not."
    },
    beside=("reaching_hand", "clamped_beam"),
)


def lagrangian(q, v, a, t):
    """L = (x''^2 + y''^2) / 2, for unit mass."""
    return (a @ a) / 2


def scene(*, apart=1.0, high=0.8, low=0.6, first=0.9, second=1.9, duration=3.0):
    """Pass gates `apart` (m), at the times `first` and `second` (s), `high` above and `low` below.

    The way begins and ends at rest. Raises ValueError for times that do not increase.
    """
    if not 0 < first < second < duration:
        raise ValueError(f"expected 0 < first < second < {duration}, found {first} and {second}")
    times = np.array([0.0, first, second, duration])
    points = np.array([[0, 0], [apart, high], [2 * apart, -low], [3 * apart, 0]], dtype=float)
    h, way = np.diff(times), np.diff(points, axis=0)
    # The acceleration is continuous: a linear equation for the velocity at each gate.
    slopes = 3 * way / h[:, None] ** 2
    table = np.diag(2 / h[:-1] + 2 / h[1:]) + np.diag([1 / h[1]], 1) + np.diag([1 / h[1]], -1)
    rates = np.concatenate(
        [np.zeros((1, 2)), np.linalg.solve(table, slopes[:-1] + slopes[1:]), np.zeros((1, 2))]
    )
    # On each leg q = q0 + v0 s + b s^2 + c s^3.
    b = (3 * way / h[:, None] - 2 * rates[:-1] - rates[1:]) / h[:, None]
    c = (way / h[:, None] - rates[:-1] - b * h[:, None]) / h[:, None] ** 2

    def on_leg(t):
        leg = leg_of(times[1:-1], t)
        return (t - times[leg])[..., None], points[leg], rates[leg], b[leg], c[leg]

    def place(t):
        s, q, v, b, c = on_leg(t)
        return np.moveaxis(q + s * (v + s * (b + s * c)), -1, 0)

    def velocity(t):
        s, _, v, b, c = on_leg(t)
        return np.moveaxis(v + s * (2 * b + 3 * s * c), -1, 0)

    rest = np.zeros(2)
    long = h[:, None]
    return Setup(
        ["x", "y"],
        duration,
        measure=Measure(""),
        draw=lambda q, t: [
            *(ground((x, y + 0.3), (x, y + 0.08)) for x, y in points[1:-1]),
            *(ground((x, y - 0.08), (x, y - 0.3)) for x, y in points[1:-1]),
            body((q[0], q[1])),
        ],
        exact=curve(place),
        ends=(points[0], points[-1]),
        rates=((rest,), (rest,)),
        through=[Event(t, q) for t, q in zip(times[1:-1], points[1:-1], strict=True)],
        facts=Facts(
            velocity=curve(velocity),
            action=float(np.sum(2 * long * (b**2 + 3 * b * c * long + 3 * (c * long) ** 2))),
            event_times=times[1:-1].tolist(),
            morse_index=0,
        ),
    )
