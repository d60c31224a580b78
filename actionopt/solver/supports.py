"""Strings drawn tight round an obstacle, by the points at which its tangent planes touch it.

The normal of a convex body determines the point at which it touches the plane with that normal:

    grad f(q) = mu N,  f(q) = 0.

From where a straight line enters the body, N is turned towards a side and on to where the line
leaves it, and the point goes over the body's edge, however sharp that is. The string leaves the
line at the point whose tangent plane contains the line's start, and comes back at that with its
end. This is the least path of a free body; of others it tells the parts in contact, about.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np

from actionopt.discrete.discrete_path import DiscretePath
from actionopt.discrete.mesh import Mesh
from actionopt.discrete.path import Path
from actionopt.mechanics.held import Held, contacts_of, measures
from actionopt.mechanics.obstacle import Arc
from actionopt.solver.touching import rows_along, runs, sample_times
from actionopt.tools.types import EPS, Array

ANGLE = np.pi / 24  # by which a normal is turned at once; ad hoc
# of Newton's method to a point, and a step that is the last
SUPPORT_STEPS, LAST_SUPPORT_STEP = 12, 1e-10
ANGLE_HALVINGS = 12  # of such an angle, to where a string comes to a body
PASSES = 5  # over all bodies, where there are several
FINE = 129  # times at which a path is known, to compare speeds along it
LEAST_TURN = 1e-4  # of an angle, that a normal is turned by at least


class Body:
    """One row of an obstacle at one time, in units in which coordinates have the size one."""

    def __init__(self, held: Held, row: int, t: float) -> None:
        system = held.free.system.with_contact
        self.packed, self.row, self.t = held.packed, held.free.system.m + row, np.array([[t]])
        self.sizes = 2.0 ** measures(held.lengths)
        self.first = system.pointwise("constraint_jacobian")
        self.second = system.pointwise("constraint_curvature")
        self.lam = np.eye(system.m)[[self.row]]

    def at(self, x: Array) -> tuple[float, Array, Array]:
        """Return f, its gradient (n,) and its second derivatives (n, n)."""
        q = (x * self.sizes)[None]
        G, f = self.first(q, self.t, self.packed)
        G = self.first.full(0, G)[0, self.row] * self.sizes
        H = self.second.full(0, self.second(q, self.lam, self.t, self.packed)[0], symmetric=True)[0]
        return float(f[0, self.row]), G, H * np.outer(self.sizes, self.sizes)

    def normal(self, x: Array) -> Array:
        """Return the normal (n,) at a point."""
        G = self.at(x)[1]
        return G / max(float(np.linalg.norm(G)), EPS)

    def touching_point(self, x: Array, normal: Array) -> Array | None:
        """Return the point near x (n,) at which a plane of this normal (n,) touches; else None."""
        n = x.size
        mu = float(self.at(x)[1] @ normal)
        K = np.zeros((n + 1, n + 1))
        for _ in range(SUPPORT_STEPS):
            f, G, H = self.at(x)
            K[:n, :n], K[:n, n], K[n, :n] = H, -normal, G
            try:
                step = np.linalg.solve(K, np.append(mu * normal - G, -f))
            except np.linalg.LinAlgError:
                return None
            x, mu = x + step[:n], mu + step[n]
            if not np.isfinite(x).all() or mu <= 0:
                return None
            if np.abs(step[:n]).max() < LAST_SUPPORT_STEP:
                return x
        return None

    def arc_over(self, first: Array, last: Array, side: Array) -> list[tuple[Array, Array]] | None:
        """Return normals and points of the body along an arc between two, over its `side`."""
        normals = [self.normal(first), side, self.normal(last)]
        found = [(normals[0], first)]
        for a, b in pairwise(normals):
            done, part = 0.0, min(1.0, ANGLE / max(angle_of(a, b), EPS))
            while done < 1.0:
                normal = between(a, b, min(done + part, 1.0))
                point = self.touching_point(found[-1][1], normal)
                if point is None:
                    part /= 2
                    if part < LEAST_TURN:
                        return None
                    continue
                done += part
                part = min(2 * part, ANGLE / angle_of(a, b))
                found.append((normal, point))
        return found

    def taut_string(
        self, chain: list[tuple[Array, Array]], ways: Ways
    ) -> tuple[Array, Array] | None:
        """Return the times (K,) and points (K, n) at which a taut string lies on the body.

        `chain` are normals and points of support around the body. The string lies on it from where
        a tangent leads to its one end to where a tangent leads to the other; None if nowhere.
        """
        found = []
        for way, first in ((chain, True), (chain[::-1], False)):
            off = partial(ways.beyond, first=first)
            k = next((k for k, (normal, x) in enumerate(way) if off(normal, x)), 0)
            if k == 0:
                return None
            (low, x), high = way[k - 1], way[k][0]
            for _ in range(ANGLE_HALVINGS):
                normal = between(low, high, 0.5)
                point = self.touching_point(x, normal)
                if point is None:
                    return None
                if off(normal, point):
                    high = normal
                else:
                    low, x = normal, point
            found.append((k, x))
        (k, begin), (l, end) = found
        points = np.array([begin, *(x for _, x in chain[k : len(chain) - l]), end])
        lengths = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
        t, arrival, _ = ways.passing(begin, end, lengths[-1])
        speed = max(float(np.linalg.norm(arrival)), EPS)
        return t + lengths / speed, points


def angle_of(a: Array, b: Array) -> float:
    """Return the angle between two unit vectors."""
    return float(np.arccos(np.clip(a @ b, -1.0, 1.0)))


def between(a: Array, b: Array, part: float) -> Array:
    """Return the unit vector that is a part of the way from a to b, both unit vectors (n,)."""
    angle = angle_of(a, b)
    if angle < LAST_SUPPORT_STEP:
        return b
    return (np.sin((1 - part) * angle) * a + np.sin(part * angle) * b) / np.sin(angle)


@dataclass(frozen=True)
class Ways:
    """How a string comes from one point and goes on to another: as a path does, but for a drift.

    Of a body that falls freely, or is free of forces, all motions are its path and a drift.

    Attributes
    ----------
    times, q, v : (K,), (K, n) and (K, n) arrays
        Times since the start between the two, and the path's coordinates and velocities then.
    before, behind : (float, (n,) array)
        Times since the start, and how far from the path it is then.
    """

    times: Array
    q: Array
    v: Array
    before: tuple[float, Array]
    behind: tuple[float, Array]

    def passing(self, x: Array, y: Array, length: float) -> tuple[float, Array, Array]:
        """Return when it comes to x so that it leaves y as fast, and both velocities (n,).

        From x to y, both (n,), it goes a `length` at one speed.
        """
        t, q, v, (a, before), (b, behind) = self.times, self.q, self.v, self.before, self.behind
        arrival = v + (x - q - before) / (t - a)[:, None]
        speeds = np.linalg.norm(arrival, axis=1)
        ends = t + length / np.maximum(speeds, EPS)
        if length:
            q, v = (np.array([np.interp(ends, t, row) for row in z.T]).T for z in (q, v))
        departure = v + (behind - (y - q)) / np.maximum(b - ends, EPS)[:, None]
        slower = speeds - np.linalg.norm(departure, axis=1)
        k = int(np.argmax((slower < 0) | (ends >= b)))
        if k == 0:
            return t[0], arrival[0], departure[0]
        part = np.clip(slower[k - 1] / max(slower[k - 1] - slower[k], EPS), 0.0, 1.0)
        return tuple(z[k - 1] + part * (z[k] - z[k - 1]) for z in (t, arrival, departure))

    def beyond(self, normal: Array, x: Array, first: bool) -> bool:
        """Return whether it is beyond where it comes to the body first, or leaves it last."""
        _, arrival, departure = self.passing(x, x, 0.0)
        return float(normal @ (arrival if first else -departure)) > 0


def tight_string(
    found: DiscretePath, side: Callable[[float], Array]
) -> tuple[Path, tuple[Arc, ...]] | None:
    """Return a path tight round what a path passes through, and its parts in contact.

    None if it passes through nothing, or through what has no edge to that side, such as a plane.
    The `side` is a direction (n,) at a time, coordinates in units of their `measures`.
    """
    held, t = contacts_of(found.problem), sample_times(found)
    sizes, inside = 2.0 ** measures(held.lengths), rows_along(found, t) < 0
    start, duration, none = held.start.t, held.duration, np.zeros((1, held.system.n))
    fine = np.linspace(0.0, duration, FINE)
    path, velocity = (
        (lambda s, z=z: z(start + s).T / sizes) for z in (found.path, found.path.velocity)
    )
    passed = sorted((k, l, i) for i, row in enumerate(inside) for k, l in runs(row))
    # What is known of contacts so far: when, and how far from the path; first where it enters.
    bodies, chains, known = [], [], [(np.zeros(1), none)]
    for k, l, i in passed:
        middle = (t[k] + t[l]) / 2
        bodies.append(Body(held, i, middle))
        first, last = path(t[[k, l]] - start)
        chains.append(bodies[-1].arc_over(first, last, side(middle)))
        known.append((np.array([middle - start]), none))
    known.append((np.array([duration]), none))
    if not bodies or any(chain is None for chain in chains):
        return None
    for _ in range(PASSES if len(bodies) > 1 else 1):
        for j, (body, chain) in enumerate(zip(bodies, chains, strict=True)):
            before, behind = ((known[k][0][e], known[k][1][e]) for k, e in ((j, -1), (j + 2, 0)))
            inner = fine[(before[0] < fine) & (fine < behind[0])]
            if not inner.size or chain is None:
                return None
            ways = Ways(inner, path(inner), velocity(inner), before, behind)
            contact = body.taut_string(chain, ways)
            if contact is None or contact[0][-1] >= behind[0]:
                return None
            known[j + 1] = contact[0], contact[1] - path(contact[0])
    times = np.concatenate([since for since, _ in known])
    if np.diff(times).min() <= 0:
        return None
    parts = [since[[0, -1]] for since, _ in known[1:-1]]
    free = [s for s in fine if all(s < a or b < s for a, b in parts)]
    since, drift = np.union1d(free, times), np.concatenate([away for _, away in known])
    away = np.array([np.interp(since, times, d) for d in drift.T]).T
    mesh = Mesh.over(start, held.end.t, since, 1)
    joints = mesh.boundaries[np.searchsorted(since, parts)].tolist()
    arcs = (Arc(i, *ends) for (_, _, i), ends in zip(passed, joints, strict=True))
    return Path(mesh, ((path(since) + away) * sizes).T), tuple(arcs)
