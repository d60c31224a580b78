"""A planet from one place to another with a given energy.

       . - - .
     .         o        y |
    (          * )        +--- x
     .         .
       ' - - '

The attracting body rests at the origin. The energy gives the length of the ellipse, 2 a, but
neither its shape nor the time.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from actionopt.scenes import kepler
from actionopt.scenes._scene import Setup, Words, like
from actionopt.scenes.kepler import lagrangian

__all__ = ["SOURCE", "TITLE", "WORDS", "lagrangian", "scene"]

TITLE = "Kepler ellipse with a given energy"
SOURCE = (
    "Battin, An Introduction to the Mathematics and Methods of Astrodynamics (revised ed. 1999), "
    "section 6.6, for Lambert's theorem; Goldstein, Classical Mechanics (3rd ed. 2002), section 8.6"
)
WORDS = Words(
    question="A planet of known energy goes from one place to another. How long does that take?",
    answer=(
        "Two ellipses of that energy pass through both places, and on one of them it takes longer."
    ),
    look="This is the quicker way; the planet is fastest at its start, nearest to the sun.",
    beside=("kepler", "throw_at_energy"),
)


@like(kepler)
def scene(twin: Setup, *, mu, a, fraction):
    """Move as the scene "kepler" does, between its events, by the energy -mu / (2 a).

    The facts have the `period` (s) and by Lambert's theorem `other_duration` (s), that on the
    other ellipse of this energy. Raises ValueError unless 0 < fraction < 1.
    """
    if not 0 < fraction < 1:
        raise ValueError(f"expected a fraction of the period between 0 and 1, found {fraction}")
    T = twin.duration
    start, end = twin.exact(np.array([0.0, T])).T  # type: ignore[misc]
    sides = np.hypot(*start) + np.hypot(*end)
    chord = np.hypot(*(end - start))
    alpha, beta = (2 * np.arcsin(np.sqrt((sides + c) / (4 * a))) for c in (chord, -chord))
    if start[0] * end[1] < start[1] * end[0]:
        beta = -beta
    both = np.array([alpha - np.sin(alpha), 2 * np.pi - alpha + np.sin(alpha)])
    both = np.sqrt(a**3 / mu) * (both - beta + np.sin(beta))
    other = float(both[np.argmax(np.abs(both - T))])
    facts = replace(
        twin.facts,
        # Conjugate times are those between given times; the longer arc has passed its envelope.
        conjugate_times=None,
        morse_index=int(other < T),
        numbers={**twin.facts.numbers, "other_duration": other},
    )
    return replace(twin, energy=facts.energy, facts=facts)
