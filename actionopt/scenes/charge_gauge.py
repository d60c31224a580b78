r"""The charge in uniform fields again, with another vector potential.

    y |   .-.   .-.
      |  (   ) (   )          B out of the plane, E along x
      | ' `o' `-'
      +------------ x

The gauge A = (0, B x) makes y cyclic; it adds d/dt (e B x y / 2) to the Lagrangian.
"""

from dataclasses import replace

from actionopt.scenes import charge_planar
from actionopt.scenes._scene import Words, like

TITLE = "charge in uniform E and B, in Landau's gauge"
SOURCE = (
    "Competitive Physics: Mechanics and Waves (2018), sections 12.3.2 and 12.5, pp. 633 and 642"
)
WORDS = Words(
    question=(
        "A magnetic field can be written by different vector potentials. Does the charge notice?"
    ),
    answer=(
        "No. The path is that of the other gauge; only the action and the momenta are different "
        "numbers."
    ),
    look="Compare the film with that of the symmetric gauge: it is the same motion.",
    captions={
        "motion": (
            "The same arc as in the symmetric gauge, though its Lagrangian has another momentum."
        ),
        "path": (
            "The path agrees with the one of the symmetric gauge to all digits that were asked for."
        ),
        "conserved": (
            "In this gauge y is cyclic, so the momentum of y is conserved; in the symmetric "
            "gauge neither is."
        ),
    },
    beside=("charge_planar", "charge_spatial"),
)


def lagrangian(q, v, t, *, m, e, B, E):
    """L = m (x'^2 + y'^2) / 2 + e B x y' + e E x."""
    x, _ = q
    vx, vy = v
    return m * (vx**2 + vy**2) / 2 + e * B * x * vy + e * E * x


@like(charge_planar)
def scene(twin, *, e, B):
    """Follow the path of the scene `charge_planar`, with the same parameters."""

    def gauge(q, t):
        return e * B * q[0] * q[1] / 2

    return replace(twin, facts=replace(twin.facts, twin="charge_planar", gauge=gauge))
