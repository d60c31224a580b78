"""A planet on an arc of its ellipse.

       . - - .
     .         o        y |
    (          * )        +--- x
     .         .
       ' - - '

The attracting body rests at the origin, the perihelion lies on the x axis.
"""

from __future__ import annotations

import numpy as np

from actionopt.scenes._scene import Facts, Setup, Words, curve
from actionopt.scenes._shapes import body, ground
from actionopt.tools.types import Array

TITLE = "Kepler ellipse, an arc of it"
SOURCE = (
    "Competitive Physics: Mechanics and Waves (2018), section 12.3; Goldstein, Classical "
    "Mechanics (3rd ed. 2002), sections 3.7-3.9; W. B. Gordon, Amer. J. Math. 99 (1977), "
    "p. 961, for the action"
)
WORDS = Words(
    question="A planet is seen at two places. Which way did it go in between, and how fast?",
    answer="Along the ellipse that fits the time: the faster, the nearer to the sun.",
    look="The planet hurries past the sun and dawdles far away from it.",
    captions={
        "motion": (
            "At equal times the places crowd together far from the sun: equal areas in equal times."
        ),
        "path": "The velocity changes fastest at the start, nearest to the sun.",
        "conserved": (
            "The energy is conserved; the momenta are not, for the sun is fixed and pulls."
        ),
    },
    beside=("kepler_polar", "kepler_spherical", "two_body"),
)


def lagrangian(q, v, t, *, mu):
    """L = (x'^2 + y'^2) / 2 + mu / |r|, for unit mass."""
    x, y = q
    vx, vy = v
    return (vx**2 + vy**2) / 2 + mu / np.sqrt(x**2 + y**2)


def scene(*, mu=1.0, a=1.0, eccentricity=0.6, start=0.0, fraction=0.4):
    """Follow an ellipse for a `fraction` of its period, from `start` periods past perihelion.

    mu = G M (m^3/s^2), semi-major axis a (m). The facts have the `period` (s). Raises
    ValueError unless mu and a are positive and 0 <= eccentricity < 1.
    """
    orbit = Ellipse(mu, a, eccentricity, start)
    T = fraction * orbit.period
    E = orbit.anomaly(np.array([0.0, T]))
    return Setup(
        ["x", "y"],
        T,
        draw=lambda q, t: [ground((0.0, 0.0)), body(q)],
        exact=curve(orbit.position),
        facts=Facts(
            velocity=curve(orbit.velocity),
            acceleration=lambda q, v, t: -mu * q / np.hypot(*q) ** 3,
            # L = H + 2 mu / r, and r dE = sqrt(mu a) dt, E the eccentric anomaly.
            action=orbit.energy * T + 2 * np.sqrt(mu * a) * (E[1] - E[0]),
            energy=orbit.energy,
            # All ellipses of one energy return together; for fixed times nothing does before.
            conjugate_times=np.array([orbit.period]),
            morse_index=0 if fraction < 1 else None,
            conserved={
                "energy": lambda q, v, t: (v[0] ** 2 + v[1] ** 2) / 2 - mu / np.hypot(*q),
                "angular momentum": lambda q, v, t: q[0] * v[1] - q[1] * v[0],
                "Laplace vector, x": lambda q, v, t: (
                    v[1] * (q[0] * v[1] - q[1] * v[0]) - mu * q[0] / np.hypot(*q)
                ),
                "Laplace vector, y": lambda q, v, t: (
                    -v[0] * (q[0] * v[1] - q[1] * v[0]) - mu * q[1] / np.hypot(*q)
                ),
            },
            numbers={"period": orbit.period},
        ),
    )


class Ellipse:
    """Motion on a Kepler ellipse around the origin; time 0 is `start` periods past perihelion."""

    def __init__(self, mu: float, a: float, eccentricity: float, start: float) -> None:
        if not (mu > 0 and a > 0 and 0 <= eccentricity < 1):
            raise ValueError(
                "expected mu > 0, a > 0 and 0 <= eccentricity < 1 for an ellipse, found "
                f"mu = {mu}, a = {a}, eccentricity = {eccentricity}"
            )
        self.mu, self.a, self.e, self.start = mu, a, eccentricity, start
        self.b = a * np.sqrt((1 - eccentricity) * (1 + eccentricity))
        self.mean_motion = float(np.sqrt(mu / a**3))
        self.period = float(2 * np.pi / self.mean_motion)
        self.energy = -mu / (2 * a)

    def anomaly(self, t: Array) -> Array:
        """Return the eccentric anomaly E: E - e sin E = mean anomaly, by Newton's method."""
        turns = self.start + t / self.period
        whole = np.round(turns)
        M = 2 * np.pi * (turns - whole)
        E = M + 0.85 * self.e * np.sign(M)  # Danby's start: converges from there for all e < 1
        for _ in range(12):
            E = E - (E - self.e * np.sin(E) - M) / (1 - self.e * np.cos(E))
        return E + 2 * np.pi * whole

    def position(self, t: Array) -> tuple[Array, Array]:
        """Return x, y (m) at the times t (s)."""
        E = self.anomaly(t)
        return self.a * (1 - self.e - 2 * np.sin(E / 2) ** 2), self.b * np.sin(E)

    def velocity(self, t: Array) -> tuple[Array, Array]:
        """Return vx, vy (m/s)."""
        E = self.anomaly(t)
        rate = self.mean_motion / (1 - self.e * np.cos(E))
        return -self.a * np.sin(E) * rate, self.b * np.cos(E) * rate

    def polar(self, t: Array) -> tuple[Array, Array]:
        """Return the distance r (m) and the true anomaly phi (rad), continuous in time."""
        E = self.anomaly(t)
        beta = self.e / (1 + self.b / self.a)
        phi = E + 2 * np.arctan2(beta * np.sin(E), 1 - beta * np.cos(E))
        return self.a * (1 - self.e * np.cos(E)), phi

    def polar_velocity(self, t: Array) -> tuple[Array, Array]:
        """Return r' (m/s) and phi' (rad/s)."""
        E = self.anomaly(t)
        near = 1 - self.e * np.cos(E)
        n = self.mean_motion
        return self.a * self.e * np.sin(E) * n / near, (self.b / self.a) * n / near**2
