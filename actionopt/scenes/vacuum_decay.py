r"""The bounce by which a false vacuum decays.

        x|__
         |  '.
         |    '-.____          x tends to the false vacuum 0
         *----------------> t  t is the distance from the centre of the bubble

The radial action in four Euclidean dimensions, for a potential with a logarithm, whose bounce is a
Gaussian. It is stationary and not least: one direction lowers the action, along which the bubble
grows (Coleman).
"""

import numpy as np

from actionopt.scenes._scene import Facts, Measure, Setup, Words, curve
from actionopt.scenes._shapes import body, ground

TITLE = "bounce of a false vacuum"
SOURCE = (
    "Coleman, Aspects of Symmetry (1985), chapter 7, section 6.2; Athron et al., BubbleProfiler, "
    "Comput. Phys. Commun. 244 (2019) 448, its logarithmic test potential"
)
WORDS = Words(
    question="Is the bubble through which a false vacuum decays a least path of its action?",
    answer="No: exactly one direction lowers the action, and along it the bubble grows.",
    look="The field falls from its value at the centre to the false vacuum, like a Gaussian.",
    beside=("kink", "exit_path"),
)


def lagrangian(q, v, t, *, m, k, a, b):
    """L = (w t + b)^3 (m x'^2 / 2 + k x^2 (1 - log(x^2 / a^2)) / 2), with w = sqrt(k / m)."""
    x, w = q[0], np.sqrt(k / m)
    return (w * t + b) ** 3 * (m * v[0] ** 2 / 2 + k * x**2 * (1 - np.log(x**2 / a**2)) / 2)


def scene(*, m=1.0, k=1.0, a=0.1, b=0.2, duration=4.0):
    """Follow x = a exp(2 - (w t + b)^2 / 2) from near the centre, at the distance b / w."""
    w = np.sqrt(k / m)

    def x(t):
        return a * np.exp(2 - (w * t + b) ** 2 / 2)

    knots = np.linspace(0.0, duration, 9)

    return Setup(
        ["x"],
        duration,
        measure=Measure(""),
        draw=lambda q, t: [ground((0.0, 0.0), (duration, 0.0)), body((t, q[0]))],
        exact=curve(lambda t: [x(t)]),
        facts=Facts(velocity=curve(lambda t: [-w * (w * t + b) * x(t)]), morse_index=1),
        guess=curve(lambda t: [np.interp(t, knots, x(knots))]),  # else x hardly leaves 0
    )
