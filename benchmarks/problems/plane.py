"""Two coordinates and closed forms: Kepler's ellipse, and the pendulum's rod in x and y."""

from __future__ import annotations

import numpy as np

from actionopt.scenes import kepler, rod_pendulum
from benchmarks.problems._case import Case, no_partials
from benchmarks.problems.single import of_scene


def _kepler_partials(q, v, t):
    x, y = q
    r2 = x**2 + y**2
    r5 = r2**2.5
    Aq = np.array([[3 * x * x - r2, 3 * x * y], [3 * x * y, 3 * y * y - r2]]) / r5
    return Aq, no_partials(q)


def _kepler(name: str, title: str, first: dict, other: dict, **rest) -> Case:
    return of_scene(
        kepler,
        first,
        other,
        name=name,
        title=title,
        acceleration=lambda q, v, t, x: -q / x.sqrt(q[0] ** 2 + q[1] ** 2) ** 3,
        partials=_kepler_partials,
        **rest,
    )


def past_perihelion(eccentricity: float, anomaly: float) -> float:
    """Return the time from perihelion to a true anomaly (degrees), in periods."""
    half = np.tan(np.radians(anomaly) / 2)
    E = 2 * np.arctan(np.sqrt((1 - eccentricity) / (1 + eccentricity)) * half)
    return float(E - eccentricity * np.sin(E)) / (2 * np.pi)


def _collision() -> Case:
    """Through perihelion, from -150 to +150 degrees; the short way round is another path."""
    e = 0.95
    since = past_perihelion(e, 150.0)
    arc = {"eccentricity": e, "start": -since, "fraction": 2 * since}
    other = {**arc, "start": -1.02 * since}
    return _kepler("kepler_collision", "Kepler, e = 0.95", arc, other, starts=("bent",))


# The index-1 form on the rod: (x, y)'' = mu (x, y) - (0, g) with x x'' + y y'' + v^2 = 0.


def _rod_acceleration(q, v, t, x):
    mu = (9.81 * q[1] - v[0] ** 2 - v[1] ** 2) / (q[0] ** 2 + q[1] ** 2)
    return np.stack([mu * q[0], mu * q[1] - 9.81])


def _rod_partials(q, v, t):
    r2 = q[0] ** 2 + q[1] ** 2
    mu = (9.81 * q[1] - v[0] ** 2 - v[1] ** 2) / r2
    mu_q = -2 * mu * q / r2
    mu_q[1] += 9.81 / r2
    mu_v = -2 * v / r2
    Aq = q[:, None] * mu_q[None]
    Aq[[0, 1], [0, 1]] += mu
    return Aq, q[:, None] * mu_v[None]


def _rod() -> Case:
    return of_scene(
        rod_pendulum,
        {},
        {"amplitude": 1.1, "since": 0.2},
        title="rod pendulum, x and y",
        acceleration=_rod_acceleration,
        partials=_rod_partials,
        normals=lambda q: 2 * q[None],
    )


def cases() -> list[Case]:
    """Return the cases of this file."""
    arc = {"eccentricity": 0.6, "fraction": 0.4}
    other = {"eccentricity": 0.57, "fraction": 0.4}
    return [_kepler("kepler", "Kepler, e = 0.6", arc, other), _collision(), _rod()]
