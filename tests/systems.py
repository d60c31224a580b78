"""Systems that many tests ask of, each made anew: unit masses; `names` with spaces between them."""

import numpy as np

from actionopt import System


def particle(names="x", **more):
    """L = v^2 / 2."""
    return System(lambda q, v, t: v @ v / 2, names.split(), **more)


def oscillator(names="x", **more):
    """L = (v^2 - q^2) / 2."""
    return System(lambda q, v, t: (v @ v - q @ q) / 2, names.split(), **more)


def pendulum(names="theta", g=1.0, **more):
    """L = theta'^2 / 2 + g cos theta."""
    return System(lambda q, v, t: v[0] ** 2 / 2 + g * np.cos(q[0]), names.split(), **more)


def kepler(names="x y", **more):
    """L = v^2 / 2 + 1 / r."""
    return System(lambda q, v, t: v @ v / 2 + 1 / np.sqrt(q @ q), names.split(), **more)


def thrown(names="x y", g=9.81, **more):
    """L = v^2 / 2 - g y."""
    return System(lambda q, v, t: v @ v / 2 - g * q[1], names.split(), **more)
