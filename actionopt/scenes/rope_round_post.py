r"""A rope pulled tight round a post.

              .---.
         .-'''     '''-.
        *    (  R  )    '-.       x, y from the middle of the post
              '---'        o

Free of the post it is straight, on it an arc, and both meet as tangent and circle do. The post
presses on the rope and cannot pull: an obstacle. L is half the square of the length per unit of the
parameter, as of a body that keeps outside.
"""

from __future__ import annotations

import numpy as np

from actionopt.scenes._scene import Curve, Facts, Setup, Words, curve
from actionopt.scenes._shapes import body, circle, ground

TITLE = "a rope pulled tight round a post"
SOURCE = (
    "Bryson and Ho, Applied Optimal Control (1975), section 3.11; Hilbert and Cohn-Vossen, "
    "Geometry and the Imagination (1952), section 1"
)
WORDS = Words(
    question="Which is the shortest way from one side of a post to the other?",
    answer="Along a tangent to the post, round it, and along another tangent.",
    look="The bend is on the post alone; the post presses evenly, and nowhere else.",
    captions={"contact": "The force is there on the arc alone: it begins and ends at once."},
    beside=("way_round_ball", "chain_on_floor"),
)


def length(q, v):
    """L = (x'^2 + y'^2) / 2, half the square of a length."""
    return np.sqrt(v @ v)


def obstacle(q, t, *, R):
    """Keep f = sqrt(x^2 + y^2) - R: at least zero."""
    return np.sqrt(q @ q) - R


def scene(*, R=1.0, start=(-2.0, 0.3), end=(2.0, 0.0), duration=1.0):
    """Pull a rope tight from `start` to `end` (m) round a post of radius `R` (m).

    The facts have the times at which contact begins and ends, and the post's force. Raises
    ValueError if the straight line between the ends does not meet the post.
    """
    exact, facts = tangents(start, end, R, duration)
    return Setup(
        ["x", "y"],
        duration,
        draw=lambda q, t: [circle(R), ground(start), ground(end), body(q)],
        ends=(start, end),
        exact=exact,
        facts=Facts(
            **facts,
            conserved={"angular momentum": lambda q, v, t: q[0] * v[1] - q[1] * v[0]},
        ),
    )


def tangents(start, end, R: float, duration: float) -> tuple[Curve, dict]:
    """Return the shortest way round a disc or a ball at the origin, and its facts.

    It lies in the plane of its ends and the middle.
    """
    A, B = np.array(start, dtype=float), np.array(end, dtype=float)
    far, near = np.linalg.norm(A), np.linalg.norm(B)
    if not min(far, near) > R > 0:
        raise ValueError(f"expected both ends outside of the radius R > 0, found R = {R}")
    out = A / far
    across = B - (B @ out) * out
    across = across / np.linalg.norm(across)
    before, behind = np.sqrt(far**2 - R**2), np.sqrt(near**2 - R**2)
    first = np.arctan2(before, R)
    arc = np.arctan2(B @ across, B @ out) - first - np.arctan2(behind, R)
    if not arc > 0:
        raise ValueError(
            f"expected ends between which the straight line meets the radius {R}, found {start} "
            f"and {end}: move them, or take a larger R"
        )
    total = before + R * arc + behind
    speed = total / duration

    def way(t):
        """Return angle, and length beyond the tangents' ends."""
        s = speed * t - before
        return first + np.clip(s / R, 0, arc), s - np.clip(s, 0, R * arc)

    def place(t):
        angle, beyond = way(t)
        c, s = np.cos(angle), np.sin(angle)
        return [R * (c * a + s * b) + beyond * (c * b - s * a) for a, b in pairs]

    def velocity(t):
        angle, _ = way(t)
        return [speed * (np.cos(angle) * b - np.sin(angle) * a) for a, b in pairs]

    pairs = list(zip(out, across, strict=True))
    numbers = {
        "contact_begin": float(before / speed),
        "contact_end": float((before + R * arc) / speed),
        "contact_force": float(speed**2 / R),
    }
    return curve(place), {
        "velocity": curve(velocity),
        "action": total**2 / (2 * duration),
        "energy": speed**2 / 2,
        "morse_index": 0,
        "numbers": numbers,
    }
