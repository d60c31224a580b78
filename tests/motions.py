"""Motions in closed form: functions of the time that return q and v, (n,) or (n, K)."""

import numpy as np
from scipy.special import ellipj, ellipk, ndtr

from actionopt import System, scenes


def ellipse(a, e, mu):
    """Kepler's motion, from pericentre at t = 0: his equation by Newton's method."""
    n = np.sqrt(mu / a**3)

    def exact(t):
        mean = n * np.asarray(t, dtype=float)
        E = mean + e * np.sin(mean)
        for _ in range(100):
            E = E - (E - e * np.sin(E) - mean) / (1 - e * np.cos(E))
        b, rate = np.sqrt(1 - e * e), n / (1 - e * np.cos(E))
        q = a * np.stack([np.cos(E) - e, b * np.sin(E)])
        return q, a * rate * np.stack([-np.sin(E), b * np.cos(E)])

    return exact


def kicked(width, centre):
    """A free body that gets the momentum one at `centre`, within a time `width`; its motion."""
    system = System(
        lambda q, v, t, *, d, c: (
            v[0] ** 2 / 2 + q[0] * np.exp(-(((t - c) / d) ** 2) / 2) / (d * np.sqrt(2 * np.pi))
        ),
        ["x"],
        parameters={"d": width, "c": centre},
    )

    def exact(t, speed=0.0):
        u = (np.asarray(t) - centre) / width
        passed = ndtr(u)
        bell = np.exp(-(u**2) / 2) / np.sqrt(2 * np.pi)
        return (speed * t + width * (u * passed + bell))[None, ...], (speed + passed)[None, ...]

    return system, exact


def oscillation(w):
    return lambda t: (np.cos(w * t)[None, ...], -w * np.sin(w * t)[None, ...])


def pendulum(theta, l, g):
    """Cartesian pendulum on a rod, let go at the angle `theta`: system and motion."""
    system = System(
        lambda q, v, t, *, g: (v[0] ** 2 + v[1] ** 2) / 2 - g * q[1],
        ["x", "y"],
        parameters={"g": g},
        constraint=lambda q, t: q[0] ** 2 + q[1] ** 2 - l**2,
    )
    k, w = np.sin(theta / 2), np.sqrt(g / l)

    def exact(t):
        sn, cn, _, _ = ellipj(w * t + ellipk(k**2), k**2)
        a, rate = 2 * np.arcsin(k * sn), 2 * k * w * cn
        along = np.stack([np.cos(a), np.sin(a)])
        return l * np.stack([np.sin(a), -np.cos(a)]), l * rate * along

    return system, exact


def of_scene(name):
    """The system of a scene, and its motion."""
    scene = scenes.get(name)
    return scene.problem.system, lambda t: (scene.exact(t), scene.facts.velocity(t))


def growing(gamma, w):
    """L = exp(gamma t)(v^2 - w^2 x^2)/2: H is not conserved, though no force acts."""
    system = System(
        lambda q, v, t, *, gamma, w: np.exp(gamma * t) * (v[0] ** 2 - (w * q[0]) ** 2) / 2,
        ["x"],
        parameters={"gamma": gamma, "w": w},
    )
    root = -gamma / 2 + 1j * np.sqrt(w**2 - gamma**2 / 4)

    def exact(t):
        z = np.exp(root * t)
        return z.real[None, ...], (root * z).real[None, ...]

    return system, exact
