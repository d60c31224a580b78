r"""The ray of the rainbow: into a drop, reflected once, and out again.

        *------.--.
             /     '.        x, y from the middle of the drop
            |        |
          .' \      /        42 degrees between the ray that leaves
        o      '--'          and where the sun's come from

Refraction, reflection, refraction: at the drop the momentum changes along its radius alone, and so
the angular momentum is the same in air and in water. Rays nearer to the middle or to the rim come
back closer to the sun's; about the one between them many leave in nearly one direction: there is
the bow (Descartes).
"""

from __future__ import annotations

import numpy as np

from actionopt.mechanics.question.events import Bounce, Event
from actionopt.scenes._legs import about, leg_of, rays, rough
from actionopt.scenes._scene import Facts, Measure, Setup, Words
from actionopt.scenes._shapes import body, circle

TITLE = "the ray of the rainbow in a drop"
SOURCE = "Walker, American Journal of Physics 44 (1976) 421-433; Born and Wolf, section 4.8"
WORDS = Words(
    question="Why do we see the rainbow 42 degrees from the shadow of our own head?",
    answer="No ray that is reflected once in a drop comes back farther from the sun's than that.",
    look="It is bent towards the middle, reflected at the back, and bent once more as it leaves.",
    captions={"conserved": "In a drop that is round only the angular momentum is kept."},
    beside=("snell", "billiard_circle"),
)


def length(q, v, *, n):
    """L = n^2 (x'^2 + y'^2) / 2, half the square of a length, n is one outside of the drop."""
    return n * np.sqrt(v @ v)


def rainbow_ray(n: float) -> float:
    """Return how far from the middle, over the radius, the ray is that is turned by least."""
    return float(np.sqrt((4 - n**2) / 3))


def turn(n: float, b) -> float:
    """Return by how much a ray at the distance b from the middle, over the radius, is turned."""
    return np.pi + 2 * np.arcsin(b) - 4 * np.arcsin(b / n)


def scene(*, n=1.333, R=1.0, b=0.0, far=1.5, duration=1.0):
    """Send sunlight into a drop of the radius `R` (m) and the index `n`, from `far` away (m).

    `b` is the ray's distance from the middle, over R; 0 stands for that of the rainbow,
    sqrt((4 - n^2) / 3). The facts have it as `impact`, by how much the ray is turned, `turning`,
    and `bow`, the angle between it and the sun's rays (rad). Raises ValueError unless
    1 < n < 2 and b < 1.
    """
    impact = b or rainbow_ray(n)
    if not (1 < n < 2 and 0 < impact < 1):
        raise ValueError(f"expected 1 < n < 2 and 0 < b < 1, found n = {n} and b = {b}")
    into, inside = np.arcsin(impact), np.arcsin(impact / n)
    at = np.pi - into - np.arange(3) * (np.pi - 2 * inside)
    on = R * np.stack([np.cos(at), np.sin(at)], axis=1)
    out = -turn(n, impact)
    points = [on[0] - (far, 0.0), *on, on[2] + far * np.array([np.cos(out), np.sin(out)])]
    indices = np.array([1.0, n, n, 1.0])
    exact, facts = rays(points, duration, indices)
    moment = about()

    def wall(q, t):
        return 1 - q @ q / R**2

    return Setup(
        ["x", "y"],
        duration,
        measure=Measure("optical length"),
        draw=lambda q, t: [circle(R), body(q)],
        exact=exact,
        guess=rough(points),
        media=[{"n": float(index)} for index in indices],
        through=[Event(None, None, on=wall), Bounce(wall), Event(None, None, on=wall)],
        facts=Facts(
            **facts,
            conserved={
                "angular momentum": lambda q, v, t: (
                    indices[leg_of(facts["event_times"], t)] ** 2 * moment(q, v, t)
                )
            },
            numbers={"impact": impact, "turning": -out, "bow": np.pi + out},
        ),
    )
