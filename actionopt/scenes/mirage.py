r"""A mirage: light that is bent up over a hot road.

        *                          o
          '.                    .'         n^2 = 1 + y / h, least at the hot ground
             '-.            .-'
        --------'-.______.-'-----------    y = 0

The square of the index grows in proportion to height, and so rays are parabolas; two of them join
two points, as two throws do. The one that dips is the mirage: it has passed its caustic, so that
what it shows stands on its head. L is half the square of the optical length per unit of the
parameter.
"""

import numpy as np

from actionopt.scenes._scene import Facts, Measure, Setup, Words, curve
from actionopt.scenes._shapes import body, ground

TITLE = "a mirage over a hot road"
SOURCE = "Evans and Rosenquist, American Journal of Physics 54 (1986) 876-883"
WORDS = Words(
    question="Why does a hot road show the sky, as if it were wet?",
    answer="Light that comes down to the hot air above the road is bent up again, to the eye.",
    look="The ray dips, is lowest above the hot road, and rises as on a parabola.",
    beside=("fish_eye", "throw_at_energy"),
)


def length(q, v, *, h):
    """L = (1 + y / h) (x'^2 + y'^2) / 2, half the square of a length."""
    return np.sqrt((1 + q[1] / h) * (v @ v))


def scene(*, h=0.5, low=0.1, first=-1.5, last=2.0, duration=1.0):
    """See, from x = `last`, light from x = `first` that is lowest at x = 0, at the height `low`.

    The facts have the optical lengths of both rays, `mirage_length` and `direct_length`. Raises
    ValueError unless the ray comes down first, and passes its caustic on the way up, where
    the image is turned.
    """
    g, N = 1 / (2 * h), np.sqrt(1 + low / h)  # d^2 r / ds^2, and dx / ds
    touch = -((N * N / g) ** 2) / first  # there the ray is at a right angle to its start
    if not first < 0 < touch < last:
        raise ValueError(
            f"expected first < 0 and last beyond the caustic, x = {touch:g}, found first = "
            f"{first}, last = {last}"
        )

    def optical(x):
        return N * x + g * g * (x / N) ** 3 / 3

    begin, whole = optical(first), optical(last) - optical(first)

    def x(t):  # the real root of that cubic
        third = np.arcsinh(1.5 * g * (begin + whole * t / duration) / N**3) / 3
        return 2 * N * N / g * np.sinh(third)

    def y(x):
        return low + g * (x / N) ** 2 / 2

    def place(t):
        return [x(t), y(x(t))]

    def velocity(t):
        at = x(t)
        rate = whole / duration / (1 + y(at) / h)  # ds / dt
        return [N * rate, g * at / N * rate]

    def guess(t):
        across = first + (last - first) * t / duration
        return [across, y(across)]

    mean = 1 + (y(first) + y(last)) / (2 * h)
    apart = g * np.hypot(last - first, y(last) - y(first))
    lengths = [((mean + apart) ** 1.5 + sign * (mean - apart) ** 1.5) / (3 * g) for sign in (-1, 1)]
    return Setup(
        ["x", "y"],
        duration,
        measure=Measure("optical length"),
        draw=lambda q, t: [ground((1.2 * first, 0.0), (1.2 * last, 0.0)), body(q)],
        exact=curve(place),
        guess=curve(guess),
        facts=Facts(
            velocity=curve(velocity),
            energy=(whole / duration) ** 2 / 2,
            conserved={"momentum along x": lambda q, v, t: (1 + q[1] / h) * v[0]},
            conjugate_times=np.array([(optical(touch) - begin) / whole * duration]),
            morse_index=1,
            numbers=dict(zip(("direct_length", "mirage_length"), lengths, strict=True)),
        ),
    )
