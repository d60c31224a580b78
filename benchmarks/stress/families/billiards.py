"""Billiards and layered media: made forwards by exact geometry, asked from the ends.

A body flies freely, falls, or is bound by a spring to the middle, inside a random ellipse or
ellipsoid, between the sides of a random convex polygon, or above a floor; its flights are known in
closed form, and where they meet a wall by the roots of that (brentq). From a random place and
velocity it makes one to four bounces, and what is asked is the path between its ends in the time it
took, with as many bounces and no guess. A ray passes up to five layers of other indices between
lines that need not be parallel. There may be other paths than the one that was made: the reference
is the flight with the first velocity of the answer, changed by Newton's method until it arrives.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.optimize import brentq

import actionopt as ao
from benchmarks.stress.case import Case, Criterion, Row, measured, mine, timed
from benchmarks.stress.tally import all_solved, judged, never_wrong, row

TITLE = "Billiards and layered media"
TOL, SEED = 1e-9, 2027
BATCH = 25  # questions a row
COUNTS = {"billiards": (500, 25), "layered media": (200, 10)}  # of all, and of a quick run
FINE = 2000  # samples of a flight among which a wall is looked for
NEXT = 1e-9  # of the longest flight: nothing is hit sooner
STEEP = 0.15  # the least cosine of a reflection that is asked for, and of a refraction
SAMPLES = 60  # of a flight, where paths are compared
NUDGE, AIMS, ARRIVED = 1e-7, 12, 1e-11
MOST_LOST = 25, 4  # not solved: five and two percent, of billiards and of layered media


@dataclass(frozen=True, eq=False)
class Wall:
    """A surface on(q) = 0, positive inside: s - n.q, or s - sum (w q)^2 where it is bent."""

    normal: np.ndarray
    s: float
    bent: bool

    def on(self, q: Any) -> Any:
        """Return on, of numbers (n, K) or of symbols."""
        if self.bent:
            return self.s - sum((w * x) ** 2 for w, x in zip(self.normal, q, strict=True))
        return self.s - sum(w * x for w, x in zip(self.normal, q, strict=True))

    def slope(self, q: np.ndarray) -> np.ndarray:
        """Return its gradient (n,)."""
        return -2 * self.normal**2 * q if self.bent else -self.normal


@dataclass(frozen=True, eq=False)
class World:
    """What a body flies in: its acceleration g - w^2 q, the walls, and the masses of its legs.

    `order` are the walls that are met one after the other; None where it is the next one.
    """

    g: np.ndarray
    w: float
    walls: tuple[Wall, ...]
    order: tuple[int, ...] | None = None
    masses: tuple[float, ...] = ()

    def flight(self, q: np.ndarray, v: np.ndarray) -> Callable[..., tuple]:
        """Return q and v (n, K) of a flight as a function of times (K,)."""
        q, v, g, w = q[:, None], v[:, None], self.g[:, None], self.w

        def at(t):
            if w:
                c, s, rest = np.cos(w * t), np.sin(w * t), g / w**2
                return rest + (q - rest) * c + v / w * s, v * c - (q - rest) * w * s
            return q + v * t + g * t**2 / 2, v + g * t

        return at

    def meet(self, k: int, flight: Callable, longest: float) -> tuple[float, int]:
        """Return when a flight, number k of its motion, first meets a wall, and which."""
        t = np.linspace(NEXT, 1.0, FINE) * longest
        q, best = flight(t)[0], (np.inf, -1)
        for i, wall in enumerate(self.walls):
            if self.masses and self.order is not None and i != self.order[k]:
                continue
            on = wall.on(q)
            inside = on > 0 if not self.masses else np.sign(on) == np.sign(on[0])
            if inside.all() or not inside[0]:
                continue
            j = int(np.argmin(inside))

            def height(s, wall=wall):
                return float(wall.on(flight(np.array([s]))[0])[0])

            root: Any = brentq(height, t[j - 1], t[j], xtol=1e-16)
            best = min(best, (float(root), i))
        return best

    def motion(self, q: np.ndarray, v: np.ndarray, bounces: int, longest: float) -> list[tuple]:
        """Return (time, q, v, wall met) of the start of each flight, up to the last bounce."""
        found, t = [(0.0, q, v, -1)], 0.0
        for k in range(bounces):
            flight = self.flight(q, v)
            since, i = self.meet(k, flight, longest)
            if not np.isfinite(since):
                break
            (q, v), t = (x[:, 0] for x in flight(np.array([since]))), t + since
            slope = self.walls[i].slope(q)
            normal = slope / np.linalg.norm(slope)
            across = float(normal @ v)
            if self.masses:  # m v is kept along the line, and m v^2 across it
                a, b = self.masses[k : k + 2]
                along = a / b * (v - across * normal)
                left = a * (v @ v) / b - along @ along
                v = along + np.sign(across) * np.sqrt(max(left, 0.0)) * normal
            else:
                v = v - 2 * across * normal
            found.append((t, q, v, i))
        return found

    def positions(self, motion: list[tuple], T: float) -> tuple[np.ndarray, np.ndarray]:
        """Return times (K,) and places (n, K) along a motion, up to the time T."""
        ends = [*(state[0] for state in motion[1:]), T]
        times, places = [], []
        for (t, q, v, _), end in zip(motion, ends, strict=True):
            s = np.linspace(0, end - t, SAMPLES)
            times.append(t + s)
            places.append(self.flight(q, v)(s)[0])
        return np.concatenate(times), np.concatenate(places, axis=1)

    def system(self, mass: float = 1.0) -> ao.System:
        """Return the physics."""
        names = ["x", "y", "z"][: self.g.size]

        def lagrangian(q, v, t):
            potential = self.w**2 * (q @ q) / 2 - sum(a * x for a, x in zip(self.g, q, strict=True))
            return mass * (v @ v) / 2 - mass * potential

        return ao.System(lagrangian, names)


def billiard(random: np.random.Generator) -> tuple[World, np.ndarray, float]:
    """Return a world, a place in it, and a speed that is of its size in unit time."""
    shape = random.choice(["ellipse", "polygon", "floor", "ellipsoid"], p=[0.4, 0.3, 0.15, 0.15])
    force = random.choice(["none", "gravity", "spring"])
    n = {"ellipsoid": 3, "floor": int(random.integers(1, 3))}.get(shape, 2)
    g, w = np.zeros(n), 0.0
    if shape == "floor":
        g[-1] = -random.uniform(0.5, 3.0)
        wall = Wall(-np.eye(n)[-1], 0.0, False)
        return World(g, 0.0, (wall,)), random.uniform(0.2, 1.5, n), 1.5
    if force == "gravity":
        g = random.standard_normal(n)
    elif force == "spring":
        w = float(random.uniform(0.5, 2.5))
    if shape == "polygon":
        sides = int(random.integers(3, 7))
        turn = 2 * np.pi * (np.arange(sides) + random.uniform(-0.25, 0.25, sides)) / sides
        normals = np.stack([np.cos(turn), np.sin(turn)], axis=1)
        walls = tuple(Wall(x, float(random.uniform(0.6, 1.4)), False) for x in normals)
        return World(g, w, walls), random.uniform(-0.4, 0.4, 2), 1.5
    axes = random.uniform(0.6, 2.0, n)
    q = random.standard_normal(n)
    q *= axes * random.uniform(0.1, 0.8) / np.linalg.norm(q)
    return World(g, w, (Wall(1 / axes, 1.0, True),)), q, float(axes.mean())


def layers(random: np.random.Generator) -> tuple[World, np.ndarray, float]:
    """Return lines above one another, and a place below them."""
    count = int(random.integers(1, 6))
    heights = np.cumsum(random.uniform(0.3, 0.8, count))
    tilt = random.uniform(-0.15, 0.15, count) * random.integers(0, 2)
    walls = tuple(
        Wall(np.array([-np.sin(a), np.cos(a)]), float(h), False)
        for a, h in zip(tilt, heights, strict=True)
    )
    masses = tuple(random.uniform(1.0, 2.4, count + 1) ** 2)
    place = np.array([random.uniform(-0.3, 0.3), -random.uniform(0.2, 0.8)])
    return World(np.zeros(2), 0.0, walls, tuple(range(count)), masses), place, 1.0


def question(kind: str, k: int) -> tuple[World, ao.Problem, int]:
    """Return a world, what is asked in it, and the number of bounces, which is made forwards."""
    random = np.random.default_rng([SEED, list(COUNTS).index(kind), k])
    while True:
        made = _made(kind, random)
        if made is not None:
            return made


def _made(kind: str, random: np.random.Generator) -> tuple[World, ao.Problem, int] | None:
    """Return a question, or None if the motion grazes a wall, or does not meet enough of them."""
    refracted = kind == "layered media"
    world, q, speed = layers(random) if refracted else billiard(random)
    v = random.standard_normal(q.size)
    if refracted:
        angle = random.uniform(-1.0, 1.0)
        v = np.array([np.sin(angle), np.cos(angle)])
    v *= speed * random.uniform(1.0, 2.0) / np.linalg.norm(v)
    bounces = len(world.walls) if refracted else int(random.integers(1, 5))
    motion = world.motion(q, v, bounces, 20.0)
    if len(motion) <= bounces:
        return None
    for (t0, a, u, _), (t1, b, after, wall) in pairwise(motion):
        before = world.flight(a, u)(np.array([t1 - t0]))[1][:, 0]
        slope = world.walls[wall].slope(b)
        for rate in (before, after):
            if abs(slope @ rate) < STEEP * np.linalg.norm(slope) * np.linalg.norm(rate):
                return None
    last, a, u, _ = motion[-1]
    flight = world.flight(a, u)
    free = 1.0 / speed if refracted else world.meet(bounces, flight, 20.0)[0]
    if not np.isfinite(free):
        return None
    since = float(random.uniform(0.2, 0.9) * free)
    end, T = flight(np.array([since]))[0][:, 0], last + since
    if refracted:
        laws: Any = [world.system(m) for m in world.masses]
        through = [ao.Event(None, None, on=_on(world.walls[i])) for i in world.order or ()]
    else:
        laws = world.system()
        through = [ao.Bounce(_on(world.walls[state[3]])) for state in motion[1:]]
        met = sorted({state[3] for state in motion[1:]})  # no question names the others
        world = replace(world, walls=tuple(world.walls[i] for i in met))
    problem = ao.Problem(laws, ao.Event(0.0, q), ao.Event(T, end), through=through)
    return world, problem, bounces


def _on(wall: Wall) -> Callable:
    return lambda q, t: wall.on(q)


def missed(solution: ao.Solution, world: World, bounces: int) -> float:
    """Return the true error: how far the path is from a flight that arrives; NaN if none is near.

    The flight meets the same walls, as the next ones on its way, in the same order.
    """
    q, T = np.array(solution.start.q), solution.duration
    end, v = np.array(solution.end.q), np.array(solution.start.v)

    def arrive(v):
        motion = world.motion(q, v, bounces, 2 * T)
        if len(motion) <= bounces or motion[-1][0] >= T:
            return motion, np.full(q.size, np.nan)
        t, a, u, _ = motion[-1]
        return motion, world.flight(a, u)(np.array([T - t]))[0][:, 0] - end

    size = max(float(np.abs(solution.path.values).max()), 1e-300)
    for _ in range(AIMS):
        motion, gap = arrive(v)
        if not np.isfinite(gap).all():
            return np.nan
        if np.abs(gap).max() < ARRIVED * size:
            break
        h = NUDGE * np.linalg.norm(v)
        J = np.stack([(arrive(v + h * e)[1] - gap) / h for e in np.eye(v.size)], axis=1)
        if not np.isfinite(J).all():
            return np.nan
        v = v - np.linalg.lstsq(J, gap, rcond=None)[0]
    else:
        return np.nan
    if (
        not world.masses
        and not solution.duration
        <= motion[-1][0] + world.meet(bounces, world.flight(*motion[-1][1:3]), 2 * T)[0]
    ):
        return np.nan  # through a wall in the end
    t, places = world.positions(motion, T)
    return float(np.abs(solution(t) - places).max() / size)


def batch(kind: str, first: int, count: int) -> list[Row]:
    """Return the row of some questions of a kind."""
    outcomes = []
    for k in range(first, first + count):
        world, problem, bounces = question(kind, k)
        solution, spent = timed(problem, TOL)

        def error(s, world=world, bounces=bounces):
            return missed(s, world, bounces)

        outcomes.append(judged(solution, error, TOL, spent, 10 * ARRIVED))
    return [row(outcomes)]


def cases(quick: bool) -> list[Case]:
    """Return them."""
    return [
        measured(f"{kind} {first}", batch, kind, first, min(BATCH, counts[quick] - first))
        for kind, counts in COUNTS.items()
        for first in range(0, counts[quick], BATCH)
    ]


def criteria(rows) -> list[Criterion]:
    """Return them."""
    found = []
    for kind, most in zip(COUNTS, MOST_LOST, strict=True):
        own = mine(rows, kind)
        found += [never_wrong(kind, own), all_solved(kind, own, most)]
    return found
