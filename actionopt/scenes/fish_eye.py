r"""Light in Maxwell's fish-eye.

         .-'''-.
       .'   |   '.
      /     o     \       n = 2 / (1 + r^2 / a^2), largest at the centre
     * - - -|- - - *      all rays from one point meet at the point opposite
      \           /

L is half the square of the optical length per unit of the parameter. The rays are the great circles
of a sphere of radius a, seen in a stereographic projection.
"""

import numpy as np

from actionopt.scenes._scene import Facts, Measure, Setup, Words, conjugates, curve
from actionopt.scenes._shapes import body, circle, ground

TITLE = "light in Maxwell's fish-eye"
SOURCE = "Born and Wolf, Principles of Optics (7th ed. 1999), section 4.2.2, p. 157"
WORDS = Words(
    question="In which medium do all rays from any one point meet again in another?",
    answer="In this one: its rays are arcs of circles, images of a sphere's great circles.",
    look="The ray runs on a circle, slowly near the centre, where the index is largest.",
    beside=("great_ellipse", "light_around_star"),
)


def length(q, v, *, a):
    """L = 2 (x'^2 + y'^2) / (1 + (x^2 + y^2) / a^2)^2, half the square of a length."""
    return 2 * np.sqrt(v @ v) / (1 + q @ q / a**2)


def scene(*, a=1.0, tilt=0.5, angle=2.5, duration=1.0):
    """Leave the rim and turn by `angle` (rad) on the sphere, on a great circle tilted by `tilt`.

    Raises ValueError for an angle that is a multiple of pi, where all rays meet.
    """
    w, c, s = angle / duration, np.cos(tilt), np.sin(tilt)

    def place(t):
        below = 1 + np.sin(w * t) * s
        return [a * np.cos(w * t) / below, a * np.sin(w * t) * c / below]

    def velocity(t):
        below = (1 + np.sin(w * t) * s) ** 2
        return [-a * w * (np.sin(w * t) + s) / below, a * w * np.cos(w * t) * c / below]

    return Setup(
        ["x", "y"],
        duration,
        measure=Measure("optical length"),
        draw=lambda q, t: [circle(a), ground((0.0, 0.0)), body(q)],
        exact=curve(place),
        facts=Facts(
            velocity=curve(velocity),
            energy=(a * w) ** 2 / 2,
            conserved={
                "angular momentum": lambda q, v, t: (
                    4 * (q[0] * v[1] - q[1] * v[0]) / (1 + (q**2).sum(axis=0) / a**2) ** 2
                ),
            },
            **conjugates(w, duration),
        ),
    )
