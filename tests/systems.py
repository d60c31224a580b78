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


def spring(stiffening=1.0, push=lambda t: 0.0):
    """L = (x'^2 - x^2) / 2 - stiffening x^4 / 4 + push(t) x."""

    def lagrangian(q, v, t):
        return (v[0] ** 2 - q[0] ** 2) / 2 - stiffening * q[0] ** 4 / 4 + push(t) * q[0]

    return System(lagrangian, ["x"])


def links(count, g=9.81):
    """Return a pendulum of so many links, unit masses and lengths, in angles from straight down."""

    def lagrangian(q, v, t):
        x, y = np.cumsum(np.cos(q) * v), np.cumsum(np.sin(q) * v)
        return (x @ x + y @ y) / 2 + g * np.sum(np.cumsum(np.cos(q)))

    return System(lagrangian, [f"a{k}" for k in range(count)])


def valley(at, **more):
    """Return Poeschl and Teller's valley along x, steep where x is within w of `at`."""

    def lagrangian(q, v, t, *, w):
        steep = 2 / w**2 / np.cosh((q[0] - at) / w) ** 2
        return (v[0] ** 2 + v[1] ** 2) / 2 - steep * q[1] ** 2 / 2

    return System(lagrangian, ["x", "y"], **more)
