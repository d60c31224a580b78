r"""A throw at a cart that rolls away.

    y |      .  '  .
      |   .          .
      | .             .
      *            [___o]->  u
      +---------------o-o-- x

Neither when nor where it is hit is given: where the cart is when the ball arrives, the action
decides, and the momentum times the cart's velocity is by how much the energy function differs from
what was given. Seen from the cart it is a throw with a given energy at a mark at rest.
"""

import numpy as np

from actionopt.scenes import throw_at_energy
from actionopt.scenes._scene import Facts, Setup, Words, curve
from actionopt.scenes._shapes import body, ground
from actionopt.scenes.projectile import lagrangian

__all__ = ["SOURCE", "TITLE", "WORDS", "lagrangian", "on", "scene"]

TITLE = "a throw at a cart that rolls away"
SOURCE = "Gelfand and Fomin, Calculus of Variations (1963), sections 14 and 15"
WORDS = Words(
    question="Thrown at a cart that rolls away: which throw of a given energy hits it?",
    answer="The one that, seen from the cart, hits a mark at rest.",
    look="It is thrown at where the cart will be, not at where it is.",
    captions={"conserved": "The momentum along x is kept: no force acts that way."},
    beside=("throw_at_energy", "projectile", "bouncing_down"),
)


def on(q, t, *, u, far, high):
    """Vanish where the cart is."""
    return [q[0] - far - u * t, q[1] - high]


def scene(*, m=1.0, g=9.81, u=1.5, far=3.0, high=0.5, spare=2.0):
    """Throw a mass m (kg) low from the origin at a cart that leaves x = `far` with the speed u.

    It is `high` (m) over the origin, and `spare` (J) the energy, seen from the cart, above the
    least that reaches it. The facts have the `cart_energy` (J), that seen from the cart. Raises
    ValueError unless `spare` is above 0.
    """
    seen = throw_at_energy.scene(m=m, g=g, start=(0.0, 0.0), end=(far, high), spare=spare)
    assert seen.exact is not None and seen.facts.velocity is not None and seen.energy is not None
    place, rate, T = seen.exact, seen.facts.velocity, seen.duration
    vx, vy = rate(0.0) + (u, 0.0)
    return Setup(
        ["x", "y"],
        T,
        draw=lambda q, t: [
            ground((0.0, high), (far + u * T + 0.3, high)),
            ground((far + u * t, high), (far + u * t, high + 0.2)),
            body(q),
        ],
        exact=curve(lambda t: [place(t)[0] + u * t, place(t)[1]]),
        energy=seen.energy - m * u**2 / 2,
        facts=Facts(
            velocity=curve(lambda t: [rate(t)[0] + u, rate(t)[1]]),
            acceleration=lambda q, v, t: np.stack([0 * v[0], 0 * v[1] - g]),
            energy=float(m * (vx**2 + vy**2) / 2),
            morse_index=0,
            conserved=seen.facts.conserved,
            numbers={"cart_energy": float(seen.energy)},
        ),
    )
