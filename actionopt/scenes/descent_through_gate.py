r"""The quickest descent through a gate.

        *-----------------> x
        |\
        | '.
        y   '-|             a cycloid to the gate, and another one from there
               \
                '-.__o

When the gate is passed is not given, but found: the energy function is the same before and after,
and the momentum jumps. Without the gate the quickest way is one cycloid.
"""

from __future__ import annotations

import numpy as np

from actionopt.mechanics.question.events import Event
from actionopt.scenes._legs import leg_of
from actionopt.scenes._scene import Facts, Measure, Setup, Words, curve
from actionopt.scenes._shapes import body, ground
from actionopt.scenes.brachistochrone import length

__all__ = ["SOURCE", "TITLE", "WORDS", "length", "scene"]

TITLE = "the quickest descent through a gate"
SOURCE = "Gelfand and Fomin, Calculus of Variations (1963), section 15"
WORDS = Words(
    question="What is the quickest slide that has to pass a gate on its way?",
    answer="Two cycloids, one to the gate and one from there, with a corner in between.",
    look="It turns sharply at the gate, as fast after it as before.",
    captions={"conserved": "At the gate the momentum jumps, and H does not."},
    beside=("brachistochrone", "descent_to_wall"),
)


def scene(*, h=1.0, R=0.5, g=9.81, first=0.5, gate=1.6, wide=0.9, last=2.0, duration=1.0):
    """Roll a wheel of radius `R` from `first` to `gate`, then one of radius `wide` to `last` (rad).

    At the gate both points are at the same depth. The facts have the `fall_time` (s) from where a
    body would have started at rest, at y = 0. Raises ValueError unless both wheels turn forwards.
    """
    depth = R * (1 - np.cos(gate))
    if not (0 < first < gate < 2 * np.pi and depth < 2 * wide):
        raise ValueError(
            f"expected 0 < first < gate < 2 pi and a second wheel that reaches up to the gate, "
            f"found first = {first}, gate = {gate}, wide = {wide}"
        )
    begin = np.arccos(1 - depth / wide)
    if not begin < last < 2 * np.pi:
        raise ValueError(f"expected {begin:.6g} < last < 2 pi, found last = {last}")
    radius, starts = np.array([R, wide]), np.array([first, begin])
    turns = np.array([gate - first, last - begin])
    long = np.sqrt(2 * radius * h) * turns  # of light
    w = turns * long.sum() / (long * duration)
    times = [0.0, duration * float(long[0] / long.sum())]
    aside = R * (gate - np.sin(gate)) - wide * (begin - np.sin(begin))

    def wheel(t):
        leg = leg_of(times[1:], t)
        return leg, radius[leg], starts[leg] + w[leg] * (t - np.array(times)[leg])

    def place(t):
        leg, r, s = wheel(t)
        return [r * (s - np.sin(s)) + aside * leg, r * (1 - np.cos(s))]

    def velocity(t):
        leg, r, s = wheel(t)
        return [r * w[leg] * (1 - np.cos(s)), r * w[leg] * np.sin(s)]

    exact = curve(place)
    x, y = exact(times[1])
    return Setup(
        ["x", "y"],
        duration,
        measure=Measure("time of descent", "s", 1 / np.sqrt(2 * g * h)),
        draw=lambda q, t: [
            ground((0.0, 0.0), (2 * x, 0.0)),
            ground((x, 0.15 - y), (x, 0.03 - y)),
            ground((x, -0.03 - y), (x, -0.15 - y)),
            body((q[0], -q[1])),
        ],
        exact=exact,
        through=[Event(None, [float(x), float(y)])],
        facts=Facts(
            velocity=curve(velocity),
            action=float(long.sum() ** 2 / (2 * duration)),
            energy=float((long.sum() / duration) ** 2 / 2),
            event_times=times[1:],
            conserved={"energy": lambda q, v, t: h * (v[0] ** 2 + v[1] ** 2) / (2 * q[1])},
            numbers={"fall_time": float(np.sqrt(radius / g) @ turns)},
        ),
    )
