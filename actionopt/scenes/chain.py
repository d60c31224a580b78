r"""Point masses on a string of rigid links, one end held at the origin.

        -----+-----
              \
               o
                \
                 o
                 |
                 o

All links have the length l and all masses are m.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from actionopt.scenes._scene import Facts, Setup, Words
from actionopt.scenes._shapes import body, ground, rod
from actionopt.tools.types import Array

TITLE = "hanging chain of point masses, every link a constraint"
SOURCE = "Routh, Dynamics of a System of Rigid Bodies, Advanced Part (6th ed. 1905), chapter 13"
WORDS = Words(
    question="A chain hangs from one end and swings. Which of its links has to carry the most?",
    answer=(
        "The top one: it carries all the masses below it, and each multiplier is larger in size "
        "than the next one down."
    ),
    look="Watch the free end: it moves farther and faster than any link above it.",
    captions={
        "motion": (
            "The links keep their length while the shape of the chain bends: the lower half "
            "moves most."
        ),
        "path": (
            "The lowest point swings widest; the ten coordinates start together on the shape of "
            "the slowest oscillation."
        ),
        "conserved": (
            "Only the energy function is conserved: the support holds the chain, and takes "
            "momentum from it."
        ),
    },
    beside=("double_pendulum", "rod_pendulum"),
)


def lagrangian(q, v, t, *, m, g):
    """L = sum over i of (m (x_i'^2 + y_i'^2) / 2 - m g y_i)."""
    y = q[1::2]
    return m * (v @ v) / 2 - m * g * np.sum(y)


def constraint(q, t, *, l):
    """Hold f_i = |r_i - r_(i-1)|^2 - l^2 = 0, one for each link, with r_0 = 0."""
    x, y = q[0::2], q[1::2]
    dx, dy = (np.concatenate([z[:1], z[1:] - z[:-1]]) for z in (x, y))
    return dx**2 + dy**2 - l**2


def scene(*, links=5, m=1.0, l=0.2, g=9.81, amplitude=0.4, fraction=0.24, start=None, end=None):
    """Swing a chain of `links` links for a `fraction` of its slowest period (`period`, s).

    Coordinates are x1, y1, x2, y2, ... from the origin, y up; m in kg, l in m. `start` and
    `end` are the links' angles from straight down (rad, one a link). By default they belong to
    the slowest small oscillation, the last link at `amplitude` (rad) at the start and on its
    way down; the default `fraction` keeps off the conjugate times of small oscillations for
    up to a dozen links. The guess turns every link evenly.

    Raises ValueError if `links` is not a positive integer or the angles do not fit it.
    """
    if links != int(links) or links < 1:
        raise ValueError(f"expected a positive number of links, found {links!r}")
    w, shape = slowest(int(links))
    w = w * np.sqrt(g / l)
    T = float(fraction * 2 * np.pi / w)
    first = amplitude * shape if start is None else _angles("start", start, links)
    last = amplitude * np.cos(w * T) * shape if end is None else _angles("end", end, links)

    def guess(t):
        s = np.asarray(t, dtype=float) / T
        angles = np.multiply.outer(first, 1 - s) + np.multiply.outer(last, s)
        return positions(l, angles)

    def energy(q, v, t):
        return m * np.sum(v**2, axis=0) / 2 + m * g * np.sum(q[1::2], axis=0)

    def draw(q, t):
        points = q.reshape(-1, 2)
        string = rod((0.0, 0.0), *points)
        return [ground((0.0, 0.0)), string, *(body(point) for point in points)]

    return Setup(
        [f"{axis}{i}" for i in range(1, int(links) + 1) for axis in "xy"],
        T,
        ends=(positions(l, first), positions(l, last)),
        draw=draw,
        guess=guess,
        facts=Facts(conserved={"energy": energy}, numbers={"period": float(2 * np.pi / w)}),
    )


def positions(l: float, angles: Array) -> Array:
    """Return x1, y1, x2, y2, ... for the links' angles (N,) or (N, K): (2 N,) or (2 N, K)."""
    steps = l * np.stack([np.sin(angles), -np.cos(angles)], axis=1)
    return np.cumsum(steps, axis=0).reshape(-1, *np.shape(angles)[1:])


def slowest(links: int) -> tuple[float, Array]:
    """Return frequency / sqrt(g / l) and shape, last link 1, of the slowest small oscillation.

    Masses below a joint carry it: M_ij = N - max(i, j), K = diag(N - i), i, j = 0 ... N - 1.
    """
    i = np.arange(links)
    root = np.sqrt(links - i)
    inverse = (links - np.maximum.outer(i, i)) / np.outer(root, root)  # K^-1/2 M K^-1/2
    values, vectors = np.linalg.eigh(inverse)
    shape = vectors[:, -1] / root
    return float(values[-1] ** -0.5), shape / shape[-1]


def _angles(role: str, given: Sequence[float], links: int) -> Array:
    angles = np.asarray(given, dtype=float)
    if angles.shape != (links,):
        raise ValueError(
            f"expected {links} link angles as the {role}, one a link, found shape {angles.shape}"
        )
    return angles
