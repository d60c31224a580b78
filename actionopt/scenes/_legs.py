"""Paths of several legs: straight or under a constant force, with corners between them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from actionopt.scenes._scene import Along, Curve, curve
from actionopt.tools.types import Array

Normal = Callable[[Array], Array]


def rays(points, duration: float, indices: ArrayLike = 1.0) -> tuple[Curve, dict]:
    """Return the broken line through points (k + 2, n), and its facts as those of light.

    `indices` are those of refraction n, one a leg. With L = n^2 v^2 / 2 light goes on at a constant
    n |v|, the optical length a unit of time, and p = n^2 v changes at the points alone.
    """
    points = np.array(points, dtype=float)
    steps = np.diff(points, axis=0)
    lengths = np.asarray(indices, dtype=float) * np.linalg.norm(steps, axis=1)
    whole = lengths.sum()
    times = duration * np.r_[0.0, np.cumsum(lengths) / whole]
    place, velocity = flight(times, points[:-1], steps / np.diff(times)[:, None])
    return place, {
        "velocity": velocity,
        "action": float(whole**2 / (2 * duration)),
        "energy": float((whole / duration) ** 2 / 2),
        "event_times": times[1:-1].tolist(),
    }


def flight(times, points, velocities, pull: ArrayLike = 0.0) -> tuple[Curve, Curve]:
    """Return place and velocity on legs (k + 1) that begin at `times`, each with a constant `pull`.

    `times` may have the end's behind them; points and velocities (k + 1, n), the acceleration (n,).
    """
    points, velocities = np.array(points, dtype=float), np.array(velocities, dtype=float)
    a = np.broadcast_to(pull, points.shape[1])[:, None]

    def at(t):
        leg = leg_of(times[1 : len(points)], t.ravel())
        return points[leg].T, velocities[leg].T, t.ravel() - np.array(times)[leg]

    def place(t):
        P, V, s = at(t)
        return (P + V * s + a * s**2 / 2).reshape(-1, *t.shape)

    def velocity(t):
        _, V, s = at(t)
        return (V + a * s).reshape(-1, *t.shape)

    return curve(place), curve(velocity)


def leg_of(joints, t) -> Array:
    """Return the number of the leg at the times t, that after a joint at the joint."""
    return np.searchsorted(joints, t, side="right")


def reflect(d: Array, normal: Array) -> Array:
    """Return a direction (n,) after an elastic reflection off a surface with this normal."""
    return d - 2 * (d @ normal) / (normal @ normal) * normal


def billiard(start, angle: float, last: float, count: int, hit: Callable, normal: Normal) -> Array:
    """Return the points (count + 2, 2) of a billiard's path, made forwards.

    It sets out from `start` at an angle, is reflected `count` times, and ends a distance `last`
    behind the last reflection. `hit(p, d)` is how far it is from p along d to the wall.
    """
    d = np.array([np.cos(angle), np.sin(angle)])
    points = [np.array(start, dtype=float)]
    for _ in range(count):
        points.append(points[-1] + hit(points[-1], d) * d)
        d = reflect(d, normal(points[-1]))
    return np.array([*points, points[-1] + last * d])


def to_conic(axes) -> tuple[Callable, Normal]:
    """Return `hit` and `normal`, as of `billiard`, of an ellipse about 0 with these half axes."""
    M = 1 / np.array(axes, dtype=float) ** 2

    def hit(p, d):
        a, b, c = d @ (M * d), p @ (M * d), 1 - p @ (M * p)
        return (np.sqrt(b * b + a * c) - b) / a

    return hit, lambda p: M * p


def rough(points) -> Array:
    """Return the points (n, k + 2), those between the ends rounded to tenths: a guess."""
    points = np.array(points, dtype=float)
    return np.vstack([points[:1], np.round(points[1:-1], 1), points[-1:]]).T


def about(center=(0.0, 0.0)) -> Along:
    """Return r x v of (q, v, t) in the plane, the angular momentum of unit mass about a point."""
    x, y = center
    return lambda q, v, t: (q[0] - x) * v[1] - (q[1] - y) * v[0]
