"""Systems that many tests ask of, each made anew: unit masses; `names` with spaces between them."""

import numpy as np

from actionopt import Event, Problem, System


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


def bratu(lam=1.0):
    """Return u'' + lam e^u = 0 between zeros: two paths below lam = 3.5138307, then none."""
    system = System(
        lambda q, v, t, *, lam: v[0] ** 2 / 2 - lam * np.exp(q[0]), ["u"], parameters={"lam": lam}
    )
    return Problem(system, Event(0.0, [0.0]), Event(1.0, [0.0]))


def soap_film(half_distance):
    """Return the film between rings of radius one at -+half_distance: S is its area / 2 pi."""
    film = System(lambda q, v, t: q[0] * np.sqrt(1 + v[0] ** 2), ["y"])
    return Problem(film, Event(-half_distance, 1.0), Event(half_distance, 1.0))


def henon_heiles():
    """L = v^2 / 2 - q^2 / 2 - x^2 y + y^3 / 3."""
    return System(
        lambda q, v, t: v @ v / 2 - q @ q / 2 - q[0] ** 2 * q[1] + q[1] ** 3 / 3, ["x", "y"]
    )
