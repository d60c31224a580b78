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
from abc import ABC, abstractmethod
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np

from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.meshes.path import Path
from actionopt.mechanics.question.held import Held
from actionopt.mechanics.question.obstacle import Arc
from actionopt.solver.contact.first_contacts import (
    ACROSS,
    SampledPath,
    across,
    cut_part,
    rows_between,
    runs,
    sample_rows,
)
from actionopt.solver.refinement.first_mesh import COARSE_DEGREE, COARSE_ELEMENTS
from actionopt.tools.blas import check_definite, solve_each
from actionopt.tools.cached import cached_property
from actionopt.tools.immutable import immutable
from actionopt.tools.types import EPS, Array, NDInt

ANGLE = np.pi / 36  # by which a normal is turned at once; ad hoc
# of Newton's method to a point, and a step that is the last: the next would be its square
SUPPORT_STEPS, LAST_SUPPORT_STEP = 12, 1e-3
# of false position, to where a string comes to a body, and the angle that is zero there
ANGLE_STEPS, LAST_ANGLE = 12, 1e-4
SPEED_STEPS = 2  # of the secant method, to when a string comes to a body; ad hoc
FIRST_STRIDE = 8  # steps across a body at once, at first
SEEN_INSIDE = 3  # places where a path is inside of an obstacle that need not be looked for; ad hoc
NO_NORMAL = 1e-9  # of the gradient where a path comes in, what may be round-off of it; ad hoc
PASSES = 5  # over all bodies, where there are several
LEAST_TURN = 1e-4  # of an angle, that a normal is turned by at least


class Body:
    """One row of an obstacle at one time, in units in which coordinates have the size one."""

    def __init__(self, held: Held, row: int, t: float) -> None:
        system, sizes = held.free.system.with_contact, held.measures
        self.packed, self.row, self.t = held.packed, held.free.system.m + row, np.array([[t]])
        self.sizes, self.lam = sizes, np.zeros((1, system.m))
        self.lam[0, self.row], self.quadratic = 1.0, system.quadratic_constraint
        self.first = system.pointwise("constraint_jacobian")
        self.second = system.pointwise("constraint_curvature")
        index, there = self.first.entries(0)
        self._slopes = index[self.row], there[self.row] * sizes
        index, there = self.second.entries(0, symmetric=True)
        self._bends = index, there * (sizes[:, None] * sizes)

    def at(self, x: Array) -> tuple[Array, Array, Array]:
        """Return f (K,) at points (K, n), its gradient (K, n) and second derivatives (K, n, n)."""
        f, G = self._first(x)
        H, (index, units) = (
            self.second(x * self.sizes, self.lam, self.t, self.packed)[0],
            self._bends,
        )
        return f, G, H[:, index] * units if H.shape[1] else np.zeros((len(x), *index.shape))

    def _first(self, x: Array) -> tuple[Array, Array]:
        (G, f), (index, units) = self.first(x * self.sizes, self.t, self.packed), self._slopes
        return f[:, self.row].copy(), G[:, index] * units

    def gradients(self, x: Array) -> Array:
        """Return the gradients (K, n) at points (K, n)."""
        return self._first(x)[1]

    def normals(self, x: Array) -> Array:
        """Return the normals (K, n) at points (K, n)."""
        G = self.gradients(x)
        return G / np.maximum(size(G), EPS)[:, None]

    def reach(self, x: Array, sides: Array) -> Array:
        """Return how far from x (n,) lines to sides (K, n) are in the body, (K,), or infinity.

        That is just inside of where they leave it first.
        """
        found = np.zeros(len(sides))
        for ahead in (ACROSS[::FIRST_STRIDE], ACROSS[:FIRST_STRIDE]):
            line = x + (found + ahead[1:, None])[:, :, None] * sides
            f = self.first(line.reshape(-1, x.size) * self.sizes, self.t, self.packed)[1]
            inside = np.logical_and.accumulate(f[:, self.row].reshape(line.shape[:2]) < 0)
            found = found + ahead[np.add.reduce(inside)]
        return np.where(found > ACROSS[-1], np.inf, found)

    @cached_property
    def ellipsoid(self) -> tuple[Array, Array, float] | None:
        """What the body is if f is quadratic: (x - c).H (x - c) < k, as H^-1, c and k; else None.

        None also if it is none, such as what is outside of one.
        """
        if not self.quadratic:
            return None
        f, G, H = (x[0] for x in self.at(np.zeros((1, self.sizes.size))))
        try:
            check_definite(H)
        except np.linalg.LinAlgError:
            return None
        inverse = np.linalg.inv(H)
        centre = -inverse @ G
        depth = -2 * float(f + centre @ G / 2)
        return (inverse, centre, depth) if depth > 0 else None

    def touching_points(self, x: Array, normals: Array) -> Array | None:
        """Return the points near x at which planes of these normals touch, all (K, n); else None.

        None if one of them is not found.
        """
        if self.ellipsoid is not None:
            return self._of_ellipsoid(normals)
        count, n = x.shape
        K, mu = np.zeros((count, n + 1, n + 1)), None
        K[:, :n, n] = -normals
        with np.errstate(over="ignore", invalid="ignore"):  # where steps lead far away
            for _ in range(SUPPORT_STEPS):
                f, G, K[:, :n, :n] = self.at(x)
                K[:, n, :n], mu = G, dot(G, normals) if mu is None else mu
                miss = np.concatenate([mu[:, None] * normals - G, -f[:, None]], axis=1)
                try:
                    step = solve_each(K, miss)
                except np.linalg.LinAlgError:
                    return None
                x, mu = x + step[:, :n], mu + step[:, n]
                change = np.maximum.reduce(np.abs(step[:, :n]), axis=None)
                if not (change < np.inf and np.minimum.reduce(mu) > 0):
                    return None
                if change < LAST_SUPPORT_STEP:
                    return x
        return None

    def _of_ellipsoid(self, normals: Array) -> Array | None:
        """Return the points at which planes of these normals touch an ellipsoid, all (K, n).

        None if one of the normals is zero.
        """
        assert self.ellipsoid is not None
        inverse, centre, depth = self.ellipsoid
        ways = normals @ inverse
        squares = dot(normals, ways)
        if not np.minimum.reduce(squares) > 0:
            return None
        return centre + ways * np.sqrt(depth / squares)[:, None]

    def arc_over(self, first: Array, last: Array, side: Array) -> tuple[Array, Array] | None:
        """Return normals and points (K, n) of the body along an arc between two, over its `side`.

        The points are near those where rays along the normals leave the body. Where that does not
        lead to an arc of a convex body each is looked for from the last one.
        """
        begin, end = self.normals(np.array([first, last]))
        fan = [begin[None]]
        for a, b in ((begin, side), (side, end)):
            count = max(math.ceil(angle_of(a, b) / ANGLE), 1)
            fan.append(between(a, b, np.arange(1, count + 1) / count))
        normals, middle = np.concatenate(fan), (first + last) / 2
        near = normals  # of an ellipsoid the points are known
        if self.ellipsoid is None:
            reach = self.reach(middle, normals)
            if not reach.max() < np.inf:
                return None
            near = middle + reach[:, None] * normals
        points = self.touching_points(near, normals)
        if points is None or (dot(normals[1:], points[1:] - points[:-1]) < -EPS).any():
            return self._arc_from(first, [begin, side, end])
        return normals, points

    def _arc_from(self, first: Array, corners: list[Array]) -> tuple[Array, Array] | None:
        """Return an arc found point by point, with normals that turn from corner to corner."""
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

    def taut_string(self, chain: tuple[Array, Array], ways: Meeting) -> StringPart | None:
        """Return where a taut string lies on the body; None if nowhere.

        `chain` are normals and points of support around the body. The string lies on it from where
        a tangent leads to its one end to where a tangent leads to the other.
        """
        normals, points = chain
        angles = ways.beyond(*chain)
        angles[1] = angles[1][::-1]
        inner = (angles > 0).argmax(axis=1)
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
            turned = between(low, high, part)
            ends = self.touching_points(ends, turned)
            if ends is None:
                return None
            angle = ways.beyond(turned, ends)[[0, 1], [0, 1]]
            if max(abs(x) for x in angle.tolist()) < LAST_ANGLE:
                break
            past = angle > 0
            low, high = (np.where(past[:, None], *x) for x in ((low, turned), (turned, high)))
            off = np.where(past, [off[0] / 2, angle], [angle, off[1] / 2])
            part = off[0] / (off[0] - off[1])
        inside = slice(inner[0], last - inner[1] + 1)
        points = np.concatenate([ends[:1], points[inside], ends[1:]])
        normals = np.concatenate([turned[:1], normals[inside], turned[1:]])
        ahead, lengths = along_surface(points, normals)
        t, speed = ways.passing_at_one_speed(ends, float(lengths[-1]))
        return StringPart(t + lengths / max(speed, EPS), points, normals, ahead, lengths)


@immutable
class StringPart:
    """Where a string lies on a body, on a curve that is cubic between points of support."""

    times: Array  # (K,): since the start
    points: Array  # (K, n): where it is then
    normals: Array  # (K, n): the body's normals there
    ahead: Array  # (K, n): which way it goes on, unit vectors
    lengths: Array  # (K,): along it

    @cached_property
    def angles(self) -> Array:
        """By what angle the normals have turned, (K,)."""
        return sums(np.arccos(clip(dot(self.normals[1:], self.normals[:-1]), -1.0, 1.0)))

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
    at = clip(k - 2, 0, f.shape[1] - width)[:, None] + np.arange(width)
    values, same = f[each[:, None], at], np.arange(width)[:, None] == np.arange(width)
    apart = np.where(same, 1.0, values[:, None] - values[:, :, None])
    distinct = apart.all(axis=(1, 2))
    apart[~distinct] = 1.0
    weights = np.where(same, 1.0, values[:, None] / apart).prod(axis=2)
    part = dot(weights, at) - (k - 1)
    line = f[each, k - 1] / (f[each, k - 1] - f[each, k])
    return np.where(distinct & (part > 0) & (part < 1), part, line)


def along_surface(points: Array, normals: Array) -> tuple[Array, Array]:
    """Return which way a curve on a surface goes, (K, n), and lengths along it, (K,).

    It goes through points (K, n) of the surface with these normals (K, n).
    """
    ways = points[1:] - points[:-1]
    ahead = np.concatenate([ways[:1], ways[1:] + ways[:-1], ways[-1:]])
    ahead -= dot(ahead, normals)[:, None] * normals
    ahead /= np.maximum(size(ahead), EPS)[:, None]
    turned = ahead[1:] - ahead[:-1]
    # An arc is longer than its chord by the square of the angle, over 24.
    return ahead, sums(size(ways) * (1 + dot(turned, turned) / 24))


def sums(parts: Array) -> Array:
    """Return the sums of the first 0, 1, ... K of the parts (K,), (K + 1,)."""
    found = np.zeros(parts.size + 1)
    np.add.accumulate(parts, out=found[1:])
    return found


def clip(x: Array, low: Any, high: Any) -> Array:
    """Return what `np.clip` returns; of few numbers it takes a fourth of the time."""
    return np.minimum(np.maximum(x, low), high)


def dot(x: Array, y: Array) -> Array:
    """Return scalar products along the last axis: `einsum` takes longer for few."""
    return np.add.reduce(x * y, axis=-1)


def size(x: Array) -> Array:
    """Return the lengths of vectors along the last axis."""
    return np.sqrt(np.add.reduce(x * x, axis=-1))


def angle_of(a: Array, b: Array) -> float:
    """Return the angle between two unit vectors."""
    return math.acos(min(max(float(a @ b), -1.0), 1.0))


def between(a: Array, b: Array, part: Array | float) -> Array:
    """Return unit vectors that are parts of the way from a to b, unit vectors.

    For parts (K,) between two, (n,), or one of each way between (K, n): (K, n).
    """
    part = np.asarray(part)[..., None]
    angle = np.arccos(clip(dot(a, b), -1.0, 1.0))[..., None]
    whole = np.where(angle > 0, np.sin(angle), 1.0)
    turned = (np.sin((1 - part) * angle) * a + np.sin(part * angle) * b) / whole
    return np.where(angle > 0, turned, b)


class Meeting(ABC):
    """How a string comes from one point to a body, and goes on to another point."""

    @abstractmethod
    def passing(self, x: Array) -> tuple[Array, Array]:
        """Return with which velocities it comes to points x and leaves them as fast, (C, n) each.

        To each of x (C, n) when that is so.
        """

    @abstractmethod
    def passing_at_one_speed(self, ends: Array, length: float) -> tuple[float, float]:
        """Return when it comes to the first of two `ends` (2, n), and the speed there.

        It goes a `length` from there to the other at that speed, and leaves it as fast.
        """

    def beyond(self, normals: Array, x: Array) -> Array:
        """Return angles (2, C), above zero beyond where it comes to the body first, leaves it last.

        They are those of the ways to and from points x with the planes of normals, both (C, n).
        """
        arrival, departure = self.passing(x)
        ways = np.array([arrival, -departure])
        return np.arcsin(clip(dot(normals, ways) / np.maximum(size(ways), EPS), -1.0, 1.0))


@immutable
class Ways(Meeting):
    """How a string comes from one point and goes on to another: as a path does, but for a drift.

    All motions of a body that falls freely, or is free of forces, are its path and a drift.
    """

    times: Array  # (K,): since the start, between the two
    q: Array  # (K, n): the path's coordinates then
    v: Array  # (K, n): its velocities
    # the time since the start, and how far (n,) from the path it is then
    before: tuple[float, Array]
    behind: tuple[float, Array]  # the same at the other end

    def passing(self, x: Array) -> tuple[Array, Array]:
        """Return these velocities."""
        t, each = self.times, np.arange(len(x))
        (a, before), (b, behind) = self.before, self.behind
        off = x[:, None] - self.q
        arrival = self.v + (off - before) / (t - a)[:, None]
        departure = self.v + (behind - off) / (b - t)[:, None]
        slower = size(arrival) - size(departure)
        first, last, part = _first_below(slower, np.zeros(slower.shape, dtype=bool))
        part = part[:, None]
        arrival, departure = (
            z[each, last] + part * (z[each, first] - z[each, last]) for z in (arrival, departure)
        )
        return arrival, departure

    def passing_at_one_speed(self, ends: Array, length: float) -> tuple[float, float]:
        """Return that time and speed."""
        t = self.times
        state = self.q, self.v
        slower, speeds, behind = self._excess(t, state, ends, length)
        (first,), (last,), part = _first_below(slower[None], behind[None])
        off, before, low, high, speed = slower[last], t[last], t[last], t[first], speeds[last]
        when = before + part[0] * (high - low)
        for _ in range(SPEED_STEPS):
            at = np.array([when])
            (slower,), (speed,), _ = self._excess(at, self._at(at), ends, length)
            change, step = off - slower, slower * (when - before)
            before, off = when, slower
            when = min(max(when + (step / change if change else 0.0), low), high)
        return float(when), float(speed)

    def _excess(
        self, t: Array, state: tuple[Array, Array], ends: Array, length: float
    ) -> tuple[Array, Array, Array]:
        """Return by how much faster it comes to one end than it leaves the other, (K,).

        Its speed then, and whether it comes to the other too late. It comes at times t (K,), at
        which q and v of the path are a `state`, (K, n) each.
        """
        (a, before), (b, behind), (q, v) = self.before, self.behind, state
        arrival = size(v + (ends[0] - q - before) / (t - a)[:, None])
        later = t + length / np.maximum(arrival, EPS)
        q, v = self._at(later)
        left = np.maximum(b - later, EPS)[:, None]
        return arrival - size(v + (behind - (ends[1] - q)) / left), arrival, later >= b

    def _at(self, t: Array) -> tuple[Array, Array]:
        """Return the path's coordinates and velocities at other times (K,), (K, n) each."""
        times = self.times
        k = clip(times.searchsorted(t) - 1, 0, times.size - 2)
        part = clip((t - times[k]) / (times[k + 1] - times[k]), 0.0, 1.0)[:, None]
        q, v = self.q, self.v
        return q[k] + part * (q[k + 1] - q[k]), v[k] + part * (v[k + 1] - v[k])


@immutable
class StraightWays(Meeting):
    """The same of a body that is free of forces: straight lines, each at one velocity."""

    begin: tuple[float, Array]  # when, since the start, and where (n,)
    end: tuple[float, Array]

    def passing(self, x: Array) -> tuple[Array, Array]:
        """Return the velocities of the way to points x, and on from there at the same speed."""
        (a, first), (b, last) = self.begin, self.end
        arrival, departure = x - first, last - x
        before, behind = size(arrival), size(departure)
        speed = (before + behind) / (b - a)
        arrival *= (speed / np.maximum(before, EPS))[:, None]
        departure *= (speed / np.maximum(behind, EPS))[:, None]
        return arrival, departure

    def passing_at_one_speed(self, ends: Array, length: float) -> tuple[float, float]:
        """Return when the way comes to the first of two `ends`, and the speed on all of it."""
        (a, first), (b, last) = self.begin, self.end
        before, behind = size(ends[0] - first), size(last - ends[1])
        speed = (before + length + behind) / (b - a)
        return float(a + before / max(speed, EPS)), float(speed)


def _first_below(f: Array, behind: Array) -> tuple[NDInt, NDInt, Array]:
    """Return the first places where f (C, K) is below zero or `behind`, those before, and parts.

    The parts (C,) are those of the way between at which f is zero.
    """
    first, each = ((f < 0) | behind).argmax(axis=1), np.arange(len(f))
    last = np.maximum(first - 1, 0)
    off = f[each, last]
    return first, last, clip(off / np.maximum(off - f[each, first], EPS), 0.0, 1.0)


@immutable
class Strings:
    """Strings drawn taut round what a path passes through."""

    held: Held  # the question
    path: Path
    seen: SampledPath  # along the path
    straight: bool = False  # whether ways that touch nothing are known to be straight lines

    @classmethod
    def round(
        cls, held: Held, path: Path, *, seen: bool = False, straight: bool = False
    ) -> Strings:
        """Return those round what a path passes through; what is `seen` is not looked for."""
        known = rows_between(held, path)
        if not seen or np.count_nonzero(known.rows < 0) < SEEN_INSIDE:
            known = sample_rows(held, path)
        return cls(held, path, known, straight)

    @cached_property
    def motion(self) -> tuple[Array, Array, Array]:
        """Times since the start at the nodes, (K,), coordinates and velocities (K, n) there."""
        path, sizes = self.path, self.held.measures
        return path.mesh.nodes_since, path.values.T / sizes, path.node_velocities().T / sizes

    def at(self, since: Array) -> Array:
        """Return the path's coordinates (n, K) at times (K,) since the start."""
        if not self.straight:
            return self.path.at(since)
        first, last = self.path.values[:, :1], self.path.values[:, -1:]
        return first + since / self.path.mesh.duration * (last - first)

    @cached_property
    def _bodies(self) -> dict[int, Body]:
        return {}

    def body(self, row: int, t: float) -> Body:
        """Return a row at a time; the same at all times where nothing depends on them."""
        if self.held.system.structure.depends_on_time:
            return Body(self.held, row, t)
        if row not in self._bodies:
            self._bodies[row] = Body(self.held, row, t)
        return self._bodies[row]

    def ways(self, before: tuple[float, Array], behind: tuple[float, Array]) -> Meeting | None:
        """Return the ways between two places; None where the path has not two nodes between."""
        if self.straight:
            times = before[0], behind[0]
            first, last = self.at(np.array(times)).T / self.held.measures
            return StraightWays((times[0], first + before[1]), (times[1], last + behind[1]))
        since, q, v = self.motion
        at = (before[0] < since) & (since < behind[0])
        return Ways(since[at], q[at], v[at], before, behind) if np.count_nonzero(at) > 1 else None

    def draw(
        self,
        side: Callable[[float], Array],
        degree: int = COARSE_DEGREE,
        free: float = COARSE_ELEMENTS,
    ) -> tuple[Path, tuple[Arc, ...]] | None:
        """Return the path along a taut string on elements of a degree, and its contacts.

        A `free` path would have so many elements. None if the path passes through nothing, or
        through what has no edge to that side, such as a plane. The `side` is a direction (n,) at a
        time, coordinates in units of their `measures`.
        """
        held, seen = self.held, self.seen
        start, duration, none = held.start.t, held.duration, np.zeros(held.system.n)
        sizes = held.measures
        passed = sorted([(k, l, i) for i, row in enumerate(seen.rows < 0) for k, l in runs(row)])
        # What is known of contacts so far: when they begin and end, and how far from the path; at
        # first when the path is inside.
        bodies, chains, known = [], [], [[(0.0, none)]]
        for k, l, i in passed:
            middle = float(seen.t[k] + seen.t[l]) / 2
            bodies.append(self.body(i, middle))
            chains.append(bodies[-1].arc_over(*seen.q[[k, l]] / sizes, side(middle)))
            known.append([(middle - start, none)])
        known.append([(duration, none)])
        if not bodies:
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
                drift = contact.points[[0, -1]] - self.at(ends).T / sizes
                known[j + 1] = list(zip(ends.tolist(), drift, strict=True))
        times, drift = zip(*[x for each in known for x in each], strict=True)
        if any([b <= a for a, b in pairwise(times)]):
            return None
        since = [np.zeros(1)]
        for k, (a, b) in enumerate(pairwise(times)):  # every second part is in contact
            turns = (contacts[k // 2].times, contacts[k // 2].angles) if k % 2 else ()
            since.append(cut_part(a, b, duration, free, *turns))
        mesh = Mesh.over(start, held.end.t, np.concatenate(since), degree)
        s = mesh.nodes_since
        part = np.interp(s, times, np.arange(len(times)))
        k = np.minimum(part.astype(int), len(times) - 2)
        away = np.array(drift) * sizes
        values = self.at(s) + (away[k] + (part - k)[:, None] * (away[k + 1] - away[k])).T
        for contact in contacts.values():
            at = (contact.times[0] <= s) & (s <= contact.times[-1])
            values[:, at] = contact.at(s[at]).T * sizes[:, None]
        joints = mesh.boundaries[mesh.since.searchsorted(times[1:-1])].reshape(-1, 2).tolist()
        arcs = [Arc(i, *ends) for (_, _, i), ends in zip(passed, joints, strict=True)]
        return Path.through(mesh, values), tuple(arcs)


@immutable
class WayOut:
    """The place where a path is deepest inside of an obstacle, and the nearest way out."""

    strings: Strings  # round what the path passes through
    t: float  # when it is there
    q: Array  # (n,): where, in units of the coordinates' `measures`
    body: Body  # the row that it is inside of
    # (n,): the body's normal there, in the same units; any one across the path where it has none,
    # as in the middle of a ball
    normal: Array

    @classmethod
    def of(cls, held: Held, path: Path, *, straight: bool = False) -> WayOut | None:
        """Return the way out from where a path is deepest inside; None where it is outside."""
        strings = Strings.round(held, path, seen=True, straight=straight)
        t, q, v, rows = strings.seen
        i, k = divmod(int(rows.argmin()), t.size)
        if not rows[i, k] < 0:
            return None
        deepest, place = float(t[k]), q[k]
        if 0 < k < t.size - 1:  # where the parabola through three points is lowest
            (a, b, c), f = t[k - 1 : k + 2].tolist(), rows[i, k - 1 : k + 2].tolist()
            slopes = (f[1] - f[0]) / (b - a), (f[2] - f[1]) / (c - b)
            bend = (slopes[1] - slopes[0]) / (c - a)
            deepest = min(max((a + b - slopes[0] / max(bend, EPS)) / 2, a), c)
            before, at, after = deepest - a, deepest - b, deepest - c
            place = (
                at * after / ((b - a) * (c - a)) * q[k - 1]
                - before * after / ((b - a) * (c - b)) * q[k]
                + before * at / ((c - a) * (c - b)) * q[k + 1]
            )
        body = strings.body(i, deepest)
        place = place / body.sizes
        enters = q[max(int((rows[i] < 0).argmax()) - 1, 0)] / body.sizes
        slope, usual = body.gradients(np.array([place, enters]))
        if size(slope) < NO_NORMAL * size(usual):
            slope = across(v[k] / body.sizes)
        return cls(strings, deepest, place, body, slope / max(float(size(slope)), EPS))

    def beside(self, sides: Array) -> tuple[Array, Array] | None:
        """Return a path just inside of the body's nearest edge straight to `sides` (k, n).

        Its coordinates (K, n) at times since the start, (K,). Paths past all of those edges are
        longer. None if there is no edge.
        """
        reach = self.body.reach(self.q, sides)
        nearest = int(reach.argmin())
        if not reach[nearest] < np.inf:
            return None
        there = self.q + reach[nearest] * sides[nearest]
        if self.strings.straight:
            duration, ends = self.strings.path.mesh.duration, self.strings.path.values[:, [0, -1]].T
            first, last = ends / self.body.sizes
            before, behind = size(there - first), size(last - there)
            since = np.array([0.0, duration * before / (before + behind), duration])
            return since, np.array([first, there, last]) * self.body.sizes
        since, q, _ = self.strings.motion
        # A free body would turn aside there when its way is the shortest.
        away, left = (there - q)[1:-1], since[-1] - since[1:-1]
        k = 1 + (dot(away, away) * (1 / since[1:-1] + 1 / left)).argmin()
        part = np.interp(since, since[[0, k, -1]], [0.0, 1.0, 0.0])
        return since, (q + part[:, None] * (there - q[k])) * self.body.sizes

    def other_sides(self, first: Array) -> Array:
        """Return directions (k, n) across the path: the farther way, and to `first` and beyond."""
        n = self.normal.size
        if n == 2:
            return -self.normal[None]
        since, _, v = self.strings.motion
        ahead = v[since.searchsorted(self.t - self.strings.held.start.t) - 1]
        axes = np.linalg.qr(np.vstack([ahead, self.normal, first, np.eye(n)]).T)[0][:, 2:].T
        return np.concatenate([[-self.normal], axes, -axes])
