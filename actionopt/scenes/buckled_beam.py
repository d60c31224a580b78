r"""A beam that buckles under its load: Euler's elastica.

              .--''''--.
            .'          '.
     P --> o              o <-- P     its height y over the length t along it

Hinged at both ends and pressed together it bends aside, where the load is above that of Euler. The
shape is that of a pendulum's motion, its angle over the length in place of the time. The parameter
is no time: it runs along the beam, which keeps its length.
"""

from __future__ import annotations

import numpy as np

from actionopt.scenes._elliptic import complete, jacobi
from actionopt.scenes._scene import Facts, Measure, Setup, Words, curve
from actionopt.scenes._shapes import body, ground, rod

TITLE = "a beam that buckles"
SOURCE = "Love, Mathematical Theory of Elasticity (4th ed. 1927), sections 262-263"
WORDS = Words(
    question="Which way does a beam go that is pressed too hard?",
    answer="Aside, as far as it must for its stiffness to balance the load: an elastica.",
    look="It is bent most in the middle, and straight at the hinges.",
    beside=("clamped_beam", "pendulum"),
)


def lagrangian(q, v, a, t, *, B, P):
    """L = B y''^2 / (2 (1 - y'^2)) + P sqrt(1 - y'^2)."""
    level = 1 - v[0] ** 2
    return B * a[0] ** 2 / (2 * level) + P * np.sqrt(level)


def scene(*, B=2.0, P=5.2, duration=2.0):
    """Press a beam of stiffness `B` (N m^2) and length `duration` (m) with the load `P` (N).

    The facts have the `euler_load` (N), where buckling begins, the `lean` (rad) at the hinges and
    the `shortening` (m). Raises ValueError for a load that is not above Euler's, and for one by
    which the beam leans over at its hinges: y is then no function that tells its shape.
    """
    long, euler = duration, B * (np.pi / duration) ** 2
    w = np.sqrt(P / B)  # the pendulum's frequency
    if not 1 < P / euler < (2 * complete(np.sqrt(0.5)) / np.pi) ** 2:
        raise ValueError(
            f"expected a load above Euler's, {euler:.6g}, and below 1.39 times that, found {P}"
        )
    low, high = 1e-9, np.sqrt(0.5)
    for _ in range(80):  # halved until they are neighbours: K = w long / 2 grows with k
        k = (low + high) / 2
        low, high = (low, k) if complete(k) > w * long / 2 else (k, high)
    K = w * long / 2
    E = float(jacobi(K, k)[3])

    def place(t):
        return [2 * k / w * jacobi(K - w * t, k)[1]]

    def velocity(t):
        sn, _, dn, _ = jacobi(K - w * t, k)
        return [2 * k * sn * dn]

    grid = np.linspace(0.0, long, 25)
    along = 2 / w * (E - jacobi(K - w * grid, k)[3]) - grid  # how far it reaches at its length t
    reach = np.polynomial.Polynomial.fit(grid, along, 12).convert().coef.tolist()
    shape = [*zip(along.tolist(), place(grid)[0].tolist(), strict=True)]
    return Setup(
        ["y"],
        duration,
        measure=Measure(""),
        draw=lambda q, t: [
            *(ground((x, 0.05 * long), (x, -0.05 * long)) for x in (0.0, shape[-1][0])),
            rod(*shape),
            body((sum(c * t**k for k, c in enumerate(reach)), q[0])),  # as live pages can draw it
        ],
        exact=curve(place),
        ends=([0.0], [0.0]),
        guess=curve(lambda t: [2 * k / w * np.sin(np.pi * t / long)]),
        facts=Facts(
            velocity=curve(velocity),
            action=float(P * (8 * E / w + (2 * k**2 - 3) * long)),
            energy=float(2 * P * k**2 - P),
            morse_index=0,
            numbers={
                "euler_load": float(euler),
                "lean": float(2 * np.arcsin(k)),
                "shortening": float(2 * long - 4 * E / w),
            },
        ),
    )
