r"""Light through layers: from air through water into glass.

        *
         \            n = 1
        --\------------------  y = 0
            '.        n in the water
        ------'-.------------  y = -d
                 '-o  n in the glass

Where the ray meets the layers is not given but found. Along them nothing changes, and so the
momentum along x, the sine of the angle times the index, is the same in all of them: Snell's law.
"""

from __future__ import annotations

import numpy as np

from actionopt.mechanics.question.events import Event
from actionopt.scenes._legs import leg_of, rays
from actionopt.scenes._scene import Facts, Measure, Setup, Words
from actionopt.scenes._shapes import body, ground

TITLE = "light through water and glass"
SOURCE = "Feynman, Lectures on Physics, vol. 1 (1963), section 26-3; Born and Wolf, section 3.2"
WORDS = Words(
    question="Why does a ray bend where it goes from air into water, and again into glass?",
    answer="It goes farther where it is fast and less far where it is slow: the least time.",
    look="The denser the medium the steeper is the ray, and the slower the light.",
    captions={"conserved": "The momentum along the layers is the same in all: Snell's law."},
    beside=("heron", "rainbow", "mirage"),
)


def length(q, v, *, n):
    """L = n^2 (x'^2 + y'^2) / 2, half the square of a length, n that of each layer."""
    return n * np.sqrt(v @ v)


def scene(*, n=1.0, water=1.33, glass=1.6, angle=1.0, above=0.8, d=0.5, below=0.6, duration=1.0):
    """Send light down at an `angle` (rad) to the upright, from the height `above` the water (m).

    The indices of refraction are `n`, `water` and `glass`; the water is `d` (m) deep, and the ray
    ends at `below` (m) under its ground. The facts have the sine of the angle times the index, and
    the whole `optical_length`. Raises ValueError where light would be reflected totally.
    """
    indices = np.array([n, water, glass])
    sine = n * np.sin(angle) / indices
    if not (sine < 1).all() or min(above, d, below) <= 0:
        raise ValueError(
            f"expected layers of a depth above 0 and an angle at which light is not reflected "
            f"totally, found {above}, {d}, {below} and sines of the angles {sine}"
        )
    deep = np.array([above, d, below])
    x = np.r_[0.0, np.cumsum(deep * sine / np.sqrt(1 - sine**2))]
    points = np.stack([x, np.r_[above, above - np.cumsum(deep)]], axis=1)
    points[1:3, 1] = 0.0, -d
    exact, facts = rays(points, duration, indices)
    return Setup(
        ["x", "y"],
        duration,
        measure=Measure("optical length"),
        draw=lambda q, t: [ground((0.0, 0.0), (x[3], 0.0)), ground((0.0, -d), (x[3], -d)), body(q)],
        exact=exact,
        media=[{"n": float(index)} for index in indices],
        through=[
            Event(None, None, on=lambda q, t: q[1]),
            Event(None, None, on=lambda q, t: q[1] + d),
        ],
        facts=Facts(
            **facts,
            morse_index=0,  # each distance is convex in the places on the layers
            conserved={
                "momentum along x": lambda q, v, t: (
                    indices[leg_of(facts["event_times"], t)] ** 2 * v[0]
                )
            },
            numbers={
                "index_times_sine": float(n * np.sin(angle)),
                "optical_length": float(np.sqrt(2 * facts["action"] * duration)),
            },
        ),
    )
