r"""The oscillator with a total time derivative added to its Lagrangian.

    |
    |/\/\/\/\/[ m ]            k
    |           |--> x

L changes by dF/dt with F = c t x^2 / 2: the path does not, S by the end values of F.
"""

from dataclasses import replace

from actionopt.scenes import oscillator
from actionopt.scenes._scene import Words, like

TITLE = "oscillator, with a total time derivative in L"
SOURCE = "Competitive Physics: Mechanics and Waves (2018), section 12.3.2, p. 633"
WORDS = Words(
    question="What happens to the motion if d/dt of something is added to L?",
    answer=(
        "Nothing. The action changes by a number that the ends alone decide, for all paths the "
        "same."
    ),
    look="The film is the oscillator's own.",
    captions={
        "motion": "The same motion as the oscillator's, from another Lagrangian.",
        "path": "The path does not know about the added derivative; the action does.",
        "conserved": (
            "With the derivative added, H is no longer conserved: it is not the energy here."
        ),
    },
    beside=("oscillator",),
)


def lagrangian(q, v, t, *, m, k, c):
    """L = m x'^2 / 2 - k x^2 / 2 + d/dt (c t x^2 / 2)."""
    return m * v[0] ** 2 / 2 - k * q[0] ** 2 / 2 + c * q[0] ** 2 / 2 + c * t * q[0] * v[0]


@like(oscillator)
def scene(twin, *, m, k, c=0.6):
    """Follow the path of the scene `oscillator`; c is in kg/s^2."""
    return replace(
        twin,
        facts=replace(
            twin.facts,
            action=None,
            energy=None,
            twin="oscillator",
            gauge=lambda q, t: c * t * q[0] ** 2 / 2,
            conserved={"energy of the twin": lambda q, v, t: m * v[0] ** 2 / 2 + k * q[0] ** 2 / 2},
        ),
    )
