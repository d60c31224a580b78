r"""The quickest descent to a wall.

        *---------|--> x
        |\        |
        | '.      |
        y   '-.___o        depth y, speed sqrt(2 g y)
                  |

Only the wall is given, not where on it the body arrives: that makes the time of descent least. It
arrives at a right angle, as light does on a wave front.
"""

import numpy as np

from actionopt.scenes._scene import Facts, Measure, Setup, Words
from actionopt.scenes._shapes import body, ground
from actionopt.scenes.brachistochrone import length
from actionopt.scenes.brachistochrone import scene as cycloid

__all__ = ["SOURCE", "TITLE", "WORDS", "length", "on", "scene"]

TITLE = "the quickest descent to a wall"
SOURCE = "Gelfand and Fomin, Calculus of Variations (1963), section 14"
WORDS = Words(
    question="Along which curve does a body slide to a wall in the shortest time, and to where?",
    answer="Along the cycloid that meets the wall at a right angle.",
    look="It sets out steeply and gets flatter and flatter, as far as the wall leans.",
    beside=("brachistochrone", "great_ellipse"),
)


def on(q, t, *, R, lean):
    """Vanish on the wall, at a right angle to the cycloid where the wheel has turned by s."""
    s = np.pi - 2 * lean
    x, y = q[0] - R * (s - np.sin(s)), q[1] - R * (1 - np.cos(s))
    return x * np.cos(lean) + y * np.sin(lean)


def scene(*, h=1.0, R=0.5, g=9.81, first=1.0, lean=0.2, duration=1.0):
    """Roll a wheel of radius `R` from the angle `first` to where its point meets the wall squarely.

    The wall leans by `lean` (rad) from the upright. The cycloid goes along (sin s/2, cos s/2) when
    the wheel has turned by s, and is normal to it at s = pi - 2 lean. The facts have the
    `fall_time`: that of a body that started at rest from y = 0. Raises ValueError unless the wheel
    turns forwards, and not beyond 2 pi.
    """
    last = np.pi - 2 * lean
    found = cycloid(h=h, R=R, g=g, first=first, last=last, duration=duration)
    x, y = R * (last - np.sin(last)), R * (1 - np.cos(last))
    reach = R * np.array([-np.sin(lean), np.cos(lean)])
    wall = [(x + k * reach[0], -(y + k * reach[1])) for k in (-1.5, 1.0)]
    return Setup(
        found.coordinates,
        duration,
        measure=Measure("time of descent", "s", 1 / np.sqrt(2 * g * h)),
        draw=lambda q, t: [
            ground((0.0, 0.0), (x, 0.0)),
            ground(*wall),
            body((q[0], -q[1])),
        ],
        exact=found.exact,
        facts=Facts(
            velocity=found.facts.velocity,
            energy=found.facts.energy,
            morse_index=0,
            conserved=found.facts.conserved,
            numbers=found.facts.numbers,
        ),
    )
