r"""A charge in uniform electric and magnetic fields, in space.

    z |    )
      |   (  helix          B along z
      |    `o               E in the xz plane
      *--------- x

Along the magnetic field the charge falls freely in the electric one.
"""

import numpy as np

from actionopt.scenes._scene import Facts, Setup, Words, conjugates, curve
from actionopt.scenes._shapes import body, ground
from actionopt.scenes.charge_planar import drifting

TITLE = "charge in uniform E and B, in space"
SOURCE = "Competitive Physics: Mechanics and Waves (2018), section 12.5.1, p. 642"
WORDS = Words(
    question=(
        "A charge spirals along a magnetic field. Does the field change how fast it moves along?"
    ),
    answer=("No. Along the field only the electric force acts, and the charge falls freely there."),
    look="The charge circles across the field while it slows down evenly along it.",
    captions={
        "motion": (
            "A piece of a helix whose turns come closer: along z the charge is slowed down."
        ),
        "path": (
            "The coordinate along the field is a parabola in time; the other two turn at the "
            "cyclotron frequency."
        ),
        "conserved": (
            "No momentum is conserved by itself: what is, has the place or the time in it, as "
            "the table of what is known says."
        ),
    },
    beside=("charge_planar", "charge_gauge"),
)


def lagrangian(q, v, t, *, m, e, B, Ex, Ez):
    """L = m v^2 / 2 + e B (x y' - y x') / 2 + e (Ex x + Ez z)."""
    x, y, z = q
    vx, vy, vz = v
    magnetic = e * B * (x * vy - y * vx) / 2
    return m * (vx**2 + vy**2 + vz**2) / 2 + magnetic + e * (Ex * x + Ez * z)


def scene(
    *,
    m=1.0,
    e=1.0,
    B=2.0,
    Ex=0.3,
    Ez=-0.2,
    start=(0.2, -0.1, 0.0),
    end=(1.0, 0.5, 1.5),
    duration=2.0,
):
    """Join two points (m) in `duration` (s): charge e (C), B (T) along z, Ex and Ez (V/m).

    Raises ValueError if the duration is a multiple of 2 pi m / (e B).
    """
    T, w, a = duration, e * B / m, e * Ez / m
    (*flat0, z0), (*flat1, z1) = start, end
    foci = conjugates(abs(w) / 2, T, multiplicity=2)
    across, rate = drifting(w, Ex / B, flat0, flat1, T)
    u = (z1 - z0) / T - a * T / 2
    return Setup(
        ["x", "y", "z"],
        T,
        ends=(start, end),
        draw=lambda q, t: [ground(start), ground(end), body(q)],
        exact=curve(lambda t: (*across(t), z0 + u * t + a * t**2 / 2)),
        facts=Facts(
            velocity=curve(lambda t: (*rate(t), u + a * t)),
            acceleration=lambda q, v, t: np.stack([e * Ex / m + w * v[1], -w * v[0], a + 0 * v[2]]),
            **foci,
            conserved={
                "energy": lambda q, v, t: (
                    m * np.sum(v**2, axis=0) / 2 - e * (Ex * q[0] + Ez * q[2])
                ),
                "m y' + e B x": lambda q, v, t: m * v[1] + e * B * q[0],
                "m z' - e Ez t": lambda q, v, t: m * v[2] - e * Ez * t,
            },
            numbers={"cyclotron": w, "drift": Ex / B},
        ),
    )
