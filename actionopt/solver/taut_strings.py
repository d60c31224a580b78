"""Strings drawn taut round an obstacle, by the points at which its tangent planes touch it.

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
from itertools import pairwise

import numpy as np

from actionopt.discrete.discrete_path import DiscretePath
from actionopt.discrete.mesh import Mesh
from actionopt.discrete.path import Path
from actionopt.mechanics.held import Held, contacts_of, measures
from actionopt.mechanics.obstacle import Arc
from actionopt.solver.first_contacts import ACROSS, rows_along, runs, sample_times, times_between
from actionopt.tools.types import EPS, Array

ANGLE = np.pi / 36  # by which a normal is turned at once; ad hoc
# of Newton's method to a point, and a step that is the last: the next would be its square
SUPPORT_STEPS, LAST_SUPPORT_STEP = 12, 1e-5
# of false position, to where a string comes to a body, and the angle that is zero there
ANGLE_STEPS, LAST_ANGLE = 12, 1e-4
FIRST_STRIDE = 8  # steps across a body at once, at first
SEEN_INSIDE = 3  # places where a path is inside of an obstacle that need not be looked for; ad hoc
PASSES = 5  # over all bodies, where there are several
FINE = 129  # times at which a path is known, to compare speeds along it
LEAST_TURN = 1e-4  # of an angle, that a normal is turned by at least


class Body:
    """One row of an obstacle at one time, in units in which coordinates have the size one."""

    def __init__(self, held: Held, row: int, t: float) -> None:
        system = held.free.system.with_contact
        self.packed, self.row, self.t = held.packed, held.free.system.m + row, np.array([[t]])
        self.sizes = 2.0 ** measures(held.lengths)
        self.areas = np.outer(self.sizes, self.sizes)
        self.first = system.pointwise("constraint_jacobian")
        self.second = system.pointwise("constraint_curvature")
        self.lam = np.eye(system.m)[[self.row]]

    def at(self, x: Array) -> tuple[Array, Array, Array]:
        """Return f (K,) at points (K, n), its gradient (K, n) and second derivatives (K, n, n)."""
        f, G = self._first(x)
        H = self.second(x * self.sizes, self.lam, self.t, self.packed)[0]
        return f, G, self.second.full(0, H, symmetric=True) * self.areas

    def _first(self, x: Array) -> tuple[Array, Array]:
        G, f = self.first(x * self.sizes, self.t, self.packed)
        return f[:, self.row].copy(), self.first.full(0, G)[:, self.row] * self.sizes

    def normals(self, x: Array) -> Array:
        """Return the normals (K, n) at points (K, n)."""
        G = self._first(x)[1]
        return G / np.maximum(np.linalg.norm(G, axis=1), EPS)[:, None]

    def reach(self, x: Array, sides: Array) -> Array:
        """Return how far from x (n,) lines to sides (K, n) are in the body, (K,), or infinity.

        That is just inside of where they leave it first.
        """
        found = np.zeros(len(sides))
        for ahead in (ACROSS[FIRST_STRIDE::FIRST_STRIDE], ACROSS[1:FIRST_STRIDE]):
            line = x + (found + ahead[:, None])[:, :, None] * sides
            f = self.first(line.reshape(-1, x.size) * self.sizes, self.t, self.packed)[1]
            inside = np.logical_and.accumulate(f[:, self.row].reshape(line.shape[:2]) < 0)
            found = found + np.append(0.0, ahead)[inside.sum(axis=0)]
        return np.where(found > ACROSS[-1], np.inf, found)

    def touching_points(self, x: Array, normals: Array) -> Array | None:
        """Return the points near x at which planes of these normals touch, all (K, n); else None.

        None if one of them is not found.
        """
        count, n = x.shape
        K = np.zeros((count, n + 1, n + 1))
        K[:, :n, n], mu = -normals, None
        for _ in range(SUPPORT_STEPS):
            f, G, H = self.at(x)
            mu = np.sum(G * normals, axis=1) if mu is None else mu
            K[:, :n, :n], K[:, n, :n] = H, G
            miss = np.concatenate([mu[:, None] * normals - G, -f[:, None]], axis=1)
            try:
                step = np.linalg.solve(K, miss[:, :, None])[:, :, 0]
            except np.linalg.LinAlgError:
                return None
            x, mu = x + step[:, :n], mu + step[:, n]
            if not (np.isfinite(x).all() and (mu > 0).all()):
                return None
            if np.abs(step[:, :n]).max() < LAST_SUPPORT_STEP:
                return x
        return None

    def arc_over(self, first: Array, last: Array, side: Array) -> tuple[Array, Array] | None:
        """Return normals and points (K, n) of the body along an arc between two, over its `side`.

        The points are near those where rays along the normals leave the body. Where that does not
        lead to an arc of a convex body each is looked for from the last one.
        """
        begin, end = self.normals(np.array([first, last]))
        fan = [begin[None]]
        for a, b in ((begin, side), (side, end)):
            count = max(int(np.ceil(angle_of(a, b) / ANGLE)), 1)
            fan.append(between(a, b, np.arange(1, count + 1) / count))
        normals, middle = np.concatenate(fan), (first + last) / 2
        reach = self.reach(middle, normals)
        if not reach.max() < np.inf:
            return None
        points = self.touching_points(middle + reach[:, None] * normals, normals)
        if points is None or (np.sum(normals[1:] * np.diff(points, axis=0), axis=1) < -EPS).any():
            return self._arc_from(first, [begin, side, end])
        return normals, points

    def _arc_from(self, first: Array, corners: list[Array]) -> tuple[Array, Array] | None:
        """Return the same, point by point, for normals that turn from one to the next corner."""
        found = [(corners[0], first)]
        for a, b in pairwise(corners):
            most = ANGLE / max(angle_of(a, b), EPS)
            done, part = 0.0, min(1.0, most)
            while done < 1.0:
                normal = between(a, b, np.array([min(done + part, 1.0)]))
                point = self.touching_points(found[-1][1][None], normal)
                if point is None:
                    part /= 2
                    if part < LEAST_TURN:
                        return None
                    continue
                done += part
                part = min(2 * part, most)
                found.append((normal[0], point[0]))
        normals, points = zip(*found, strict=True)
        return np.array(normals), np.array(points)

    def taut_string(self, chain: tuple[Array, Array], ways: Ways) -> tuple[Array, Array] | None:
        """Return the times (K,) and points (K, n) at which a taut string lies on the body.

        `chain` are normals and points of support around the body. The string lies on it from where
        a tangent leads to its one end to where a tangent leads to the other; None if nowhere.
        """
        normals, points = chain
        angles = ways.beyond(*chain)
        beyond = angles[0] > 0, angles[1][::-1] > 0
        inner = [int(np.argmax(x)) for x in beyond]
        if not all(inner):  # at an end already, or nowhere
            return None
        last = len(points) - 1
        # The places before and behind, at either end, and the angles there.
        at = np.array([[inner[0] - 1, last - inner[1] + 1], [inner[0], last - inner[1]]])
        low, high = normals[at]
        ends, off = points[at[0]], angles[[0, 1], at]
        for _ in range(ANGLE_STEPS):
            part = off[0] / (off[0] - off[1])
            turned = np.array([between(*x) for x in zip(low, high, part, strict=True)])
            ends = self.touching_points(ends, turned)
            if ends is None:
                return None
            angle = np.diagonal(ways.beyond(turned, ends))
            if np.abs(angle).max() < LAST_ANGLE:
                break
            past = angle > 0
            low, high = (np.where(past[:, None], *x) for x in ((low, turned), (turned, high)))
            off = np.where(past, [off[0] / 2, angle], [angle, off[1] / 2])
        inside = points[inner[0] : last - inner[1] + 1]
        points = np.concatenate([ends[:1], inside, ends[1:]])
        lengths = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
        t, arrival, _ = (x[0] for x in ways.passing(ends[:1], ends[1:], lengths[-1]))
        speed = max(float(np.linalg.norm(arrival)), EPS)
        return t + lengths / speed, points


def angle_of(a: Array, b: Array) -> float:
    """Return the angle between two unit vectors."""
    return float(np.arccos(np.clip(a @ b, -1.0, 1.0)))


def between(a: Array, b: Array, part: Array | float) -> Array:
    """Return unit vectors that are parts (K,) of the way from a to b, unit vectors (n,): (K, n)."""
    angle, part = angle_of(a, b), np.asarray(part)[..., None]
    if angle == 0.0:
        return b + 0 * part
    return (np.sin((1 - part) * angle) * a + np.sin(part * angle) * b) / np.sin(angle)


@dataclass(frozen=True)
class Ways:
    """How a string comes from one point and goes on to another: as a path does, but for a drift.

    All motions of a body that falls freely, or is free of forces, are its path and a drift.

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

    def passing(self, x: Array, y: Array, length: float) -> tuple[Array, Array, Array]:
        """Return when it comes to x so that it leaves y as fast, (C,), and both velocities (C, n).

        From x to y, both (C, n), it goes a `length` at one speed.
        """
        t, q, v, (a, before), (b, behind) = self.times, self.q, self.v, self.before, self.behind
        arrival = v + (x[:, None] - q - before) / (t - a)[:, None]
        speeds = np.linalg.norm(arrival, axis=2)
        ends = t + length / np.maximum(speeds, EPS)
        if length:
            q, v = (np.stack([np.interp(ends, t, row) for row in z.T], axis=2) for z in (q, v))
        departure = v + (behind - (y[:, None] - q)) / np.maximum(b - ends, EPS)[:, :, None]
        slower = speeds - np.linalg.norm(departure, axis=2)
        first, each = np.argmax((slower < 0) | (ends >= b), axis=1), np.arange(len(x))
        last = np.maximum(first - 1, 0)
        off = slower[each, last]
        part = np.clip(off / np.maximum(off - slower[each, first], EPS), 0.0, 1.0)[:, None]
        times = np.broadcast_to(t[:, None], (len(x), t.size, 1))
        when, arrival, departure = (
            z[each, last] + part * (z[each, first] - z[each, last])
            for z in (times, arrival, departure)
        )
        return when[:, 0], arrival, departure

    def beyond(self, normals: Array, x: Array) -> Array:
        """Return angles (2, C), above zero beyond where it comes to the body first, leaves it last.

        They are those of the ways to and from points x with the planes of normals, both (C, n).
        """
        _, arrival, departure = self.passing(x, x, 0.0)
        ways = np.stack([arrival, -departure])
        lengths = np.maximum(np.linalg.norm(ways, axis=2), EPS)
        return np.arcsin(np.clip(np.sum(normals * ways, axis=2) / lengths, -1.0, 1.0))


@dataclass(frozen=True)
class WayOut:
    """The place where a path is deepest inside of an obstacle, and the nearest way out.

    Attributes
    ----------
    found : DiscretePath
        The path.
    t : float
        When it is there.
    body : Body
        The row that it is inside of.
    normal : (n,) array
        The body's normal there, coordinates in units of their `measures`.
    looked_at : (K,) and (r, K) arrays
        What `look_along` returns of the path.
    """

    found: DiscretePath
    t: float
    body: Body
    normal: Array
    looked_at: tuple[Array, Array]

    @classmethod
    def of(cls, found: DiscretePath) -> WayOut | None:
        """Return the way out from where a path is deepest inside; None where it is outside."""
        t = times_between(found.mesh)
        rows = rows_along(found, t)
        if np.count_nonzero(rows < 0) < SEEN_INSIDE:
            t, rows = look_along(found)
        i, k = np.unravel_index(np.argmin(rows), rows.shape)
        if not rows[i, k] < 0:
            return None
        deepest = t[[k]]
        if 0 < k < t.size - 1:  # where the parabola through three points is lowest
            slope = np.diff(rows[i, k - 1 : k + 2]) / np.diff(t[k - 1 : k + 2])
            bend = (slope[1] - slope[0]) / (t[k + 1] - t[k - 1])
            lowest = (t[k - 1] + t[k] - slope[0] / max(bend, EPS)) / 2
            deepest = np.clip([lowest], t[k - 1], t[k + 1])
        body = Body(contacts_of(found.problem), int(i), float(deepest[0]))
        normal = body.normals(found.path(deepest).T / body.sizes)[0]
        return cls(found, float(deepest[0]), body, normal, (t, rows))

    def within(self, sides: Array) -> Path | None:
        """Return a path that is just inside of the body's nearest edge straight to `sides` (k, n).

        Paths past all of those edges are longer. None if there is no edge.
        """
        found, sizes = self.found, self.body.sizes
        held, since = contacts_of(found.problem), np.linspace(0.0, found.problem.duration, FINE)
        t, here = since + held.start.t, found.path(self.t) / sizes
        reach = self.body.reach(here, sides)
        nearest = int(np.argmin(reach))
        if not reach[nearest] < np.inf:
            return None
        drift = reach[nearest] * sides[nearest]
        q, v = (z(t).T / sizes for z in (found.path, found.path.velocity))
        ends = [(s, np.zeros(sizes.size)) for s in since[[0, -1]]]
        ways = Ways(since[1:-1], q[1:-1], v[1:-1], *ends)
        there = (here + drift)[None]
        when = ways.passing(there, there, 0.0)[0][0]
        drift = here + drift - found.path(when + held.start.t) / sizes
        part = np.interp(since, [0.0, when, since[-1]], [0.0, 1.0, 0.0])[:, None]
        return Path(Mesh.over(held.start.t, held.end.t, since, 1), ((q + part * drift) * sizes).T)

    def other_sides(self, first: Array) -> Array:
        """Return directions (k, n) across the path: the farther way, and to `first` and beyond."""
        n, sizes = self.normal.size, self.body.sizes
        ahead = self.found.path.velocity(self.t) / sizes
        axes = np.linalg.qr(np.column_stack([ahead, self.normal, first, np.eye(n)]))[0][:, 2:].T
        return np.concatenate([[-self.normal], axes, -axes])


def look_along(found: DiscretePath) -> tuple[Array, Array]:
    """Return times (K,) along a path, and the rows of the obstacle (r, K) then."""
    t = sample_times(found)
    return t, rows_along(found, t)


def taut_string_round(
    found: DiscretePath, looked_at: tuple[Array, Array], side: Callable[[float], Array]
) -> tuple[Path, tuple[Arc, ...]] | None:
    """Return a path taut round what a path, looked along, passes through, and its contacts.

    None if it passes through nothing, or through what has no edge to that side, such as a plane.
    The `side` is a direction (n,) at a time, coordinates in units of their `measures`.
    """
    held, (t, rows) = contacts_of(found.problem), looked_at
    sizes, inside = 2.0 ** measures(held.lengths), rows < 0
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
    begin, end = np.transpose(parts)
    free = fine[((fine < begin[:, None]) | (end[:, None] < fine)).all(axis=0)]
    since, drift = np.union1d(free, times), np.concatenate([away for _, away in known])
    away = np.array([np.interp(since, times, d) for d in drift.T]).T
    mesh = Mesh.over(start, held.end.t, since, 1)
    joints = mesh.boundaries[np.searchsorted(since, parts)].tolist()
    arcs = (Arc(i, *ends) for (_, _, i), ends in zip(passed, joints, strict=True))
    return Path(mesh, ((path(since) + away) * sizes).T), tuple(arcs)
