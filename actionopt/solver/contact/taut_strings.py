"""Strings drawn taut round an obstacle, by the points at which its tangent planes touch it.

The normal of a convex body determines the point at which it touches the plane with that normal:

    grad f(q) = mu N,  f(q) = 0.

From where a straight line enters the body, N is turned towards a side and on to where the line
leaves it, and the point goes over the body's edge, however sharp that is. The string leaves the
line at the point whose tangent plane contains the line's start, and comes back at that with its
end. This is the least path of a free body; of others it tells the parts in contact, about.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.mechanics.question.held import Held, contacts_of
from actionopt.mechanics.question.obstacle import Arc
from actionopt.solver.contact.first_contacts import (
    ACROSS,
    cut_part,
    rows_between,
    runs,
    sample_rows,
)
from actionopt.solver.refinement.first_mesh import COARSE_DEGREE
from actionopt.tools.types import EPS, Array, NDInt

ANGLE = np.pi / 36  # by which a normal is turned at once; ad hoc
# of Newton's method to a point, and a step that is the last: the next would be its square
SUPPORT_STEPS, LAST_SUPPORT_STEP = 12, 1e-3
# of false position, to where a string comes to a body, and the angle that is zero there
ANGLE_STEPS, LAST_ANGLE = 12, 1e-4
SPEED_STEPS = 2  # of the secant method, to when a string comes to a body; ad hoc
FIRST_STRIDE = 8  # steps across a body at once, at first
SEEN_INSIDE = 3  # places where a path is inside of an obstacle that need not be looked for; ad hoc
PASSES = 5  # over all bodies, where there are several
LEAST_TURN = 1e-4  # of an angle, that a normal is turned by at least


class Body:
    """One row of an obstacle at one time, in units in which coordinates have the size one."""

    def __init__(self, held: Held, row: int, t: float) -> None:
        system = held.free.system.with_contact
        self.packed, self.row, self.t = held.packed, held.free.system.m + row, np.array([[t]])
        self.sizes = held.measures
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
        return G / np.maximum(size(G), EPS)[:, None]

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
            with np.errstate(over="ignore", invalid="ignore"):  # where steps lead far away
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

    def taut_string(self, chain: tuple[Array, Array], ways: Ways) -> StringPart | None:
        """Return where a taut string lies on the body; None if nowhere.

        `chain` are normals and points of support around the body. The string lies on it from where
        a tangent leads to its one end to where a tangent leads to the other.
        """
        normals, points = chain
        angles = ways.beyond(*chain)
        angles[1] = angles[1][::-1]
        inner = np.argmax(angles > 0, axis=1)
        if not inner.all():  # at an end already, or nowhere
            return None
        last = len(points) - 1
        # The places before and behind, at either end, and the angles there.
        at = np.array([[inner[0] - 1, last - inner[1] + 1], [inner[0], last - inner[1]]])
        low, high = normals[at]
        off = np.array([angles[[0, 1], inner - 1], angles[[0, 1], inner]])
        part = parts_at_zero(angles, inner)
        ends = points[at[0]] + part[:, None] * (points[at[1]] - points[at[0]])
        for _ in range(ANGLE_STEPS):
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
            part = off[0] / (off[0] - off[1])
        inside = slice(inner[0], last - inner[1] + 1)
        points = np.concatenate([ends[:1], points[inside], ends[1:]])
        normals = np.concatenate([turned[:1], normals[inside], turned[1:]])
        ahead, lengths = along_surface(points, normals)
        t, arrival, _ = (x[0] for x in ways.passing(ends[:1], ends[1:], lengths[-1]))
        speed = max(float(np.linalg.norm(arrival)), EPS)
        return StringPart(t + lengths / speed, points, normals, ahead, lengths)


@dataclass(frozen=True)
class StringPart:
    """Where a string lies on a body, on a curve that is cubic between points of support.

    Attributes
    ----------
    times, points, normals : (K,), (K, n) and (K, n) arrays
        When it is at which points since the start, and the body's normals there.
    ahead, lengths : (K, n) and (K,) arrays
        Which way it goes on, unit vectors, and the lengths along it.
    """

    times: Array
    points: Array
    normals: Array
    ahead: Array
    lengths: Array

    @cached_property
    def angles(self) -> Array:
        """By what angle the normals have turned, (K,)."""
        cosines = np.sum(self.normals[1:] * self.normals[:-1], axis=1)
        return np.append(0.0, np.cumsum(np.arccos(clip(cosines, -1.0, 1.0))))

    def at(self, t: Array) -> Array:
        """Return the points (C, n) at times t (C,) since the start."""
        k = clip(self.times.searchsorted(t, side="right") - 1, 0, self.times.size - 2)
        s = ((t - self.times[k]) / (self.times[k + 1] - self.times[k]))[:, None]
        way = self.points[k + 1] - self.points[k]
        length = (self.lengths[k + 1] - self.lengths[k])[:, None]
        first, last = (length * x - way for x in (self.ahead[k], self.ahead[k + 1]))
        return self.points[k] + s * way + s * (1 - s) * ((1 - s) * first - s * last)


def parts_at_zero(f: Array, k: NDInt) -> Array:
    """Return the parts (C,) of the ways from f[k - 1] <= 0 to f[k] > 0 where f (C, K) is zero.

    By the cubic through the four around; where that lies outside, or two values are equal, by the
    line through the two.
    """
    each, width = np.arange(k.size), min(f.shape[1], 4)
    at = np.clip(k - 2, 0, f.shape[1] - width)[:, None] + np.arange(width)
    values, same = f[each[:, None], at], np.eye(width, dtype=bool)
    apart = np.where(same, 1.0, values[:, None] - values[:, :, None])
    distinct = apart.all(axis=(1, 2))
    apart[~distinct] = 1.0
    weights = np.where(same, 1.0, values[:, None] / apart).prod(axis=2)
    part = np.sum(weights * at, axis=1) - (k - 1)
    line = f[each, k - 1] / (f[each, k - 1] - f[each, k])
    return np.where(distinct & (part > 0) & (part < 1), part, line)


def along_surface(points: Array, normals: Array) -> tuple[Array, Array]:
    """Return which way a curve on a surface goes, (K, n), and lengths along it, (K,).

    It goes through points (K, n) of the surface with these normals (K, n).
    """
    ways = np.diff(points, axis=0)
    ahead = np.concatenate([ways[:1], ways[1:] + ways[:-1], ways[-1:]])
    ahead -= np.sum(ahead * normals, axis=1)[:, None] * normals
    ahead /= np.maximum(size(ahead), EPS)[:, None]
    turned = np.diff(ahead, axis=0)
    # An arc is longer than its chord by the square of the angle, over 24.
    lengths = size(ways) * (1 + np.sum(turned**2, axis=1) / 24)
    return ahead, np.append(0.0, np.cumsum(lengths))


def clip(x: Array, low: Any, high: Any) -> Array:
    """Return what `np.clip` does of few numbers, in a fourth of the time."""
    return np.minimum(np.maximum(x, low), high)


def size(x: Array) -> Array:
    """Return the lengths of vectors along the last axis."""
    return np.sqrt(np.einsum("...n,...n->...", x, x))


def angle_of(a: Array, b: Array) -> float:
    """Return the angle between two unit vectors."""
    return math.acos(min(max(float(a @ b), -1.0), 1.0))


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
        t, each = self.times, np.arange(len(x))
        arrival, departure, ends = self._velocities(t[None], (self.q, self.v), x, y, length)
        slower = _excess(arrival, departure)
        first = np.argmax((slower < 0) | (ends >= self.behind[0]), axis=1)
        last = np.maximum(first - 1, 0)
        off, before = slower[each, last], t[last]
        part = clip(off / np.maximum(off - slower[each, first], EPS), 0.0, 1.0)
        when = before + part * (t[first] - before)
        for _ in range(SPEED_STEPS if length else 0):
            state = self._at(when[:, None])
            arrival, departure, _ = self._velocities(when[:, None], state, x, y, length)
            slower = _excess(arrival, departure)[:, 0]
            change, step = off - slower, slower * (when - before)
            before, off = when, slower
            when = when + np.divide(step, change, out=0 * step, where=change != 0)
            when = clip(when, t[last], t[first])
        if length:
            return when, arrival[:, 0], departure[:, 0]
        arrival, departure = (
            z[each, last] + part[:, None] * (z[each, first] - z[each, last])
            for z in (arrival, departure)
        )
        return when, arrival, departure

    def _velocities(
        self, t: Array, state: tuple[Array, Array], x: Array, y: Array, length: float
    ) -> tuple[Array, Array, Array]:
        """Return the velocities with which it comes to x and leaves y, (C, K, n), and when that is.

        It comes at times t (C, K) or (1, K), at which q and v of the path are a `state`.
        """
        (a, before), (b, behind), (q, v) = self.before, self.behind, state
        arrival, ends = v + (x[:, None] - q - before) / (t - a)[:, :, None], t
        if length:
            ends = t + length / np.maximum(size(arrival), EPS)
            q, v = self._at(ends)
        departure = v + (behind - (y[:, None] - q)) / np.maximum(b - ends, EPS)[:, :, None]
        return arrival, departure, ends

    def _at(self, t: Array) -> tuple[Array, Array]:
        """Return the path's coordinates and velocities at other times, (C, K, n) each."""
        times = self.times
        k = clip(times.searchsorted(t) - 1, 0, times.size - 2)
        part = clip((t - times[k]) / (times[k + 1] - times[k]), 0.0, 1.0)[:, :, None]
        q, v = (z[k] + part * (z[k + 1] - z[k]) for z in (self.q, self.v))
        return q, v

    def beyond(self, normals: Array, x: Array) -> Array:
        """Return angles (2, C), above zero beyond where it comes to the body first, leaves it last.

        They are those of the ways to and from points x with the planes of normals, both (C, n).
        """
        _, arrival, departure = self.passing(x, x, 0.0)
        ways = np.stack([arrival, -departure])
        lengths = np.maximum(size(ways), EPS)
        return np.arcsin(clip(np.sum(normals * ways, axis=2) / lengths, -1.0, 1.0))


def _excess(v: Array, w: Array) -> Array:
    """Return by how much one velocity is faster than another, (C, K), both (C, K, n)."""
    return size(v) - size(w)


@dataclass(frozen=True)
class Strings:
    """Strings drawn taut round what a path passes through.

    Attributes
    ----------
    found : DiscretePath
        The path.
    t, rows : (K,) and (r, K) arrays
        Times along it, and the rows of the obstacle then.
    """

    found: DiscretePath
    t: Array
    rows: Array

    @classmethod
    def round(cls, found: DiscretePath, *, seen: bool = False) -> Strings:
        """Return those round what a path passes through; what is `seen` is not looked for."""
        t, rows = rows_between(found) if seen else sample_rows(found)
        if seen and np.count_nonzero(rows < 0) < SEEN_INSIDE:
            return cls.round(found)
        return cls(found, t, rows)

    @cached_property
    def motion(self) -> tuple[Array, Array, Array]:
        """Times since the start at the nodes, (K,), coordinates and velocities (K, n) there."""
        found, sizes = self.found, self.found.problem.measures
        v = found.path.velocity(found.mesh.nodes).T
        return found.mesh.nodes_since, found.Q / sizes, v / sizes

    def ways(self, before: tuple[float, Array], behind: tuple[float, Array]) -> Ways | None:
        """Return the `Ways` between two places; None where the path has not two nodes between."""
        since, q, v = self.motion
        at = (before[0] < since) & (since < behind[0])
        return Ways(since[at], q[at], v[at], before, behind) if np.count_nonzero(at) > 1 else None

    def draw(
        self, side: Callable[[float], Array], degree: int = COARSE_DEGREE
    ) -> tuple[Path, tuple[Arc, ...]] | None:
        """Return the path along a taut string on elements of a degree, and its contacts.

        None if the path passes through nothing, or through what has no edge to that side, such as a
        plane. The `side` is a direction (n,) at a time, coordinates in units of their `measures`.
        """
        found, held = self.found, contacts_of(self.found.problem)
        start, duration, none = held.start.t, held.duration, np.zeros(held.system.n)
        sizes = held.measures
        passed = sorted((k, l, i) for i, row in enumerate(self.rows < 0) for k, l in runs(row))
        # What is known of contacts so far: when they begin and end, and how far from the path; at
        # first when the path is inside.
        bodies, chains, known = [], [], [[(0.0, none)]]
        for k, l, i in passed:
            middle = float(self.t[k] + self.t[l]) / 2
            bodies.append(Body(held, i, middle))
            first, last = found.path(self.t[[k, l]]).T / sizes
            chains.append(bodies[-1].arc_over(first, last, side(middle)))
            known.append([(middle - start, none)])
        known.append([(duration, none)])
        if not bodies or any(chain is None for chain in chains):
            return None
        contacts: dict[int, StringPart] = {}
        for _ in range(PASSES if len(bodies) > 1 else 1):
            for j, (body, chain) in enumerate(zip(bodies, chains, strict=True)):
                before, behind = known[j][-1], known[j + 2][0]
                ways = self.ways(before, behind)
                if ways is None or chain is None:
                    return None
                contact = body.taut_string(chain, ways)
                if contact is None or contact.times[-1] >= behind[0]:
                    return None
                contacts[j], ends = contact, contact.times[[0, -1]]
                drift = contact.points[[0, -1]] - found.path(start + ends).T / sizes
                known[j + 1] = list(zip(ends.tolist(), drift, strict=True))
        times, drift = zip(*(x for each in known for x in each), strict=True)
        if np.diff(times).min() <= 0:
            return None
        since = [np.zeros(1)]
        for k, (a, b) in enumerate(pairwise(times)):  # every second part is in contact
            turns = (contacts[k // 2].times, contacts[k // 2].angles) if k % 2 else ()
            since.append(cut_part(a, b, duration, *turns))
        mesh = Mesh.over(start, held.end.t, np.concatenate(since), degree)
        s = mesh.nodes_since
        away = np.array([np.interp(s, times, d) for d in np.transpose(drift)])
        values = found.path(mesh.nodes) + away * sizes[:, None]
        for contact in contacts.values():
            at = (contact.times[0] <= s) & (s <= contact.times[-1])
            values[:, at] = contact.at(s[at]).T * sizes[:, None]
        joints = mesh.boundaries[np.searchsorted(mesh.since, times[1:-1])].reshape(-1, 2).tolist()
        arcs = (Arc(i, *ends) for (_, _, i), ends in zip(passed, joints, strict=True))
        return Path(mesh, values), tuple(arcs)


@dataclass(frozen=True)
class WayOut:
    """The place where a path is deepest inside of an obstacle, and the nearest way out.

    Attributes
    ----------
    strings : Strings
        Those round what the path passes through.
    t, q : float and (n,) array
        When and where it is there, coordinates in units of their `measures`.
    body : Body
        The row that it is inside of.
    normal : (n,) array
        The body's normal there, in the same units.
    """

    strings: Strings
    t: float
    q: Array
    body: Body
    normal: Array

    @classmethod
    def of(cls, found: DiscretePath) -> WayOut | None:
        """Return the way out from where a path is deepest inside; None where it is outside."""
        strings = Strings.round(found, seen=True)
        t, rows = strings.t, strings.rows
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
        q = found.path(deepest).T / body.sizes
        return cls(strings, body.t.item(), q[0], body, body.normals(q)[0])

    def within(self, sides: Array) -> Path | None:
        """Return a path that is just inside of the body's nearest edge straight to `sides` (k, n).

        Paths past all of those edges are longer. None if there is no edge.
        """
        found, sizes = self.strings.found, self.body.sizes
        reach = self.body.reach(self.q, sides)
        nearest = int(np.argmin(reach))
        if not reach[nearest] < np.inf:
            return None
        there, (since, q, _) = self.q + reach[nearest] * sides[nearest], self.strings.motion
        # A free body would turn aside there when its way is the shortest.
        away, left = (there - q)[1:-1], since[-1] - since[1:-1]
        k = 1 + np.argmin(np.sum(away**2, axis=1) * (1 / since[1:-1] + 1 / left))
        part = np.interp(since, since[[0, k, -1]], [0.0, 1.0, 0.0])
        return Path(found.mesh, (q + part[:, None] * (there - q[k])).T * sizes[:, None])

    def other_sides(self, first: Array) -> Array:
        """Return directions (k, n) across the path: the farther way, and to `first` and beyond."""
        n, sizes = self.normal.size, self.body.sizes
        if n == 2:
            return -self.normal[None]
        ahead = self.strings.found.path.velocity(self.t) / sizes
        axes = np.linalg.qr(np.column_stack([ahead, self.normal, first, np.eye(n)]))[0][:, 2:].T
        return np.concatenate([[-self.normal], axes, -axes])
