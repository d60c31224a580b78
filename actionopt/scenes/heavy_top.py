r"""A heavy symmetric top with its tip fixed.

        z |  / axis          phi: azimuth of the axis
          | /-               theta: its angle from the vertical
          |/ theta           psi: spin about it
          *                  gravity g downward

Neither phi nor psi appears in L: their momenta are constant.
"""

import numpy as np

from actionopt.scenes._scene import Facts, Setup, Words, curve
from actionopt.scenes._shapes import body, ground, rod

TITLE = "heavy symmetric top in steady precession"
SOURCE = (
    "Competitive Physics: Mechanics and Waves (2018), section 12.5, p. 642; Goldstein, "
    "Classical Mechanics (3rd ed. 2002), section 5.7"
)
WORDS = Words(
    question="Why does a spinning top not fall over?",
    answer=(
        "Its axis does fall, sideways: gravity turns the angular momentum round, and the tilt "
        "stays."
    ),
    look=(
        "The tilt of the axis stays the same; the axis goes round slowly and the disc spins fast."
    ),
    captions={
        "motion": (
            "The axis precesses by one radian while the disc turns more than five times about it."
        ),
        "path": "Two angles grow evenly, the third, the tilt, does not change.",
        "conserved": (
            "The momenta of both cyclic angles are conserved; that of the tilt is constant in "
            "this steady motion only."
        ),
    },
    beside=("pendulum", "screw"),
)
DISC = 0.4  # radius of the disc drawn, in parts of l


def lagrangian(q, v, t, *, I1, I3, m, l, g):
    """L = T - V of a symmetric top in Euler's angles.

    L = I1 (theta'^2 + sin(theta)^2 phi'^2) / 2 + I3 (psi' + phi' cos theta)^2 / 2
    - m g l cos theta.
    """
    _, theta, _ = q
    u, w, z = v
    tilt = I1 * (w**2 + (u * np.sin(theta)) ** 2) / 2
    return tilt + I3 * (z + u * np.cos(theta)) ** 2 / 2 - m * g * l * np.cos(theta)


def scene(*, I1=0.005, I3=0.002, m=0.5, l=0.08, g=9.81, theta=1.0, precession=2.5, duration=0.4):
    """Precess at the rate `precession` (rad/s) with the axis at `theta` (rad).

    Moments of inertia about the tip in kg m^2, l from the tip to the centre of mass. The facts
    have the `spin` psi' (rad/s) that this takes, with the rate phi' of precession:
    (m g l / phi' + (I1 - I3) phi' cos theta) / I3.
    """
    sine, cosine = np.sin(theta), np.cos(theta)
    spin = m * g * l / (I3 * precession) + (I1 - I3) / I3 * precession * cosine

    def spin_momentum(q, v, t):
        return I3 * (v[2] + v[0] * np.cos(q[1]))

    def vertical(q, v, t):
        return I1 * v[0] * np.sin(q[1]) ** 2 + spin_momentum(q, v, t) * np.cos(q[1])

    def energy(q, v, t):
        tilt = I1 * (v[1] ** 2 + (v[0] * np.sin(q[1])) ** 2) / 2
        return tilt + spin_momentum(q, v, t) ** 2 / (2 * I3) + m * g * l * np.cos(q[1])

    def draw(q, t):  # a disc with a mark that shows its spin
        (phi, tilt, psi), turn = q, np.linspace(0, 2 * np.pi, 41)
        axis = np.stack([np.sin(tilt) * np.cos(phi), np.sin(tilt) * np.sin(phi), np.cos(tilt)])
        down = np.stack([np.cos(tilt) * np.cos(phi), np.cos(tilt) * np.sin(phi), -np.sin(tilt)])
        level = np.stack([-np.sin(phi), np.cos(phi), 0.0])

        def place(angle):
            return l * (axis + DISC * (np.cos(angle) * down + np.sin(angle) * level))

        head = l * axis
        vertical = ground((0.0, 0.0, 0.0), (0.0, 0.0, 1.3 * l))
        return [
            vertical,
            rod((0.0, 0.0, 0.0), head),
            rod(*(place(angle) for angle in turn)),
            rod(head, place(psi)),
            body(head),
        ]

    total = spin + precession * cosine
    kinetic = I1 * (precession * sine) ** 2 / 2 + I3 * total**2 / 2
    return Setup(
        ["phi", "theta", "psi"],
        duration,
        draw=draw,
        exact=curve(lambda t: (precession * t, theta + 0 * t, spin * t)),
        facts=Facts(
            velocity=curve(lambda t: (precession + 0 * t, 0 * t, spin + 0 * t)),
            action=(kinetic - m * g * l * cosine) * duration,
            energy=kinetic + m * g * l * cosine,
            conserved={
                "energy": energy,
                "momentum about the axis": spin_momentum,
                "momentum about the vertical": vertical,
            },
            numbers={"spin": spin},
        ),
    )
