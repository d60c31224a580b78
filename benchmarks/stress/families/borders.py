"""Given integrals: ropes of given length, and fences of given area through events to surfaces.

A rope hangs between random nails; its catenary is known but for one number (brentq). A fence is two
arcs of circles of one curvature, as L + kappa (x y' - y x') / 2 has them, made forwards and asked
from its ends: between the arcs it passes a place at a time that is not given, or is reflected off a
line, and it ends at a place, on a line in a given time, or there with a given energy. The guess is
its places, moved at random by a tenth. There may be other fences than the one that was made: the
reference is the two arcs nearest to the answer that meet the conditions (Powell's hybrid method).
`solve_bvp` is asked ten of each with the length or the area as another state, the multiplier and
the durations of the legs as parameters: ropes from a parabola, for which we have no guess, fences
from the same guess.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.integrate import solve_bvp
from scipy.optimize import brentq, root

import actionopt as ao
from benchmarks.stress.case import Case, Criterion, mine, timed
from benchmarks.stress.tally import (
    Outcome,
    asked_too,
    batches,
    found_too,
    judged,
    right_and_solved,
)

TITLE = "Given integrals, alone and with events and surfaces"
TOL, SEED = 1e-9, 2029
BATCH = 25  # questions a row
COUNTS = {"ropes": (200, 10), "mixed": (100, 5)}  # of all, and of a quick run
PEERS = 10  # of each kind, that solve_bvp is asked too
MOST_LOST = 0.05  # of them
SAMPLES = 201
MOVED = 0.1  # of the size of a fence, by which the guess is off
XI, WEIGHTS = np.polynomial.legendre.leggauss(24)


# -- ropes -----------------------------------------------------------------------------------


@cache
def rope() -> ao.System:
    """Return the system of its height over the distance along the floor."""
    return ao.System(
        lambda q, v, t: q[0] * np.sqrt(1 + v[0] ** 2),
        ["y"],
        integral=lambda q, v, t: np.sqrt(1 + v[0] ** 2),
    )


def hung(k: int) -> tuple[float, float, float, Callable]:
    """Return width, rise and length of a rope, and its catenary as a function of x."""
    random = np.random.default_rng([SEED, 0, k])
    d, h = random.uniform(0.5, 3.0), random.uniform(-1.0, 1.0)
    length = np.hypot(d, h) * (1 + 10 ** random.uniform(-2, 0.3))
    size = np.sqrt(length**2 - h**2) / d
    u = float(brentq(lambda u: np.sinh(u) / u - size, 1e-6, 20.0, xtol=1e-16))  # type: ignore[arg-type]
    c = d / (2 * u)
    x0 = d / 2 - c * np.arctanh(h / length)
    return d, h, float(length), lambda x: c * (np.cosh((x - x0) / c) - np.cosh(x0 / c))


def ask_rope(k: int) -> Outcome:
    """Return what came of a rope."""
    d, h, length, exact = hung(k)
    problem = ao.Problem(rope(), ao.Event(0.0, [0.0]), ao.Event(d, [h]), integral=length)
    solution, spent = timed(problem, TOL)
    x = np.linspace(0, d, SAMPLES)

    def error(s: ao.Solution) -> float:
        return float(np.max(np.abs(s(x)[0] - exact(x))) / np.max(np.abs(exact(x))))

    return judged(solution, error, TOL, spent)


def peer_rope(k: int) -> tuple[str, float]:
    """Return how `solve_bvp` fared, from a parabola, and its true error."""
    d, h, length, exact = hung(k)
    x = np.linspace(0, d, 17)
    sag = np.sqrt(3 / 8 * d * (length - np.hypot(d, h)))
    y = h * x / d - 4 * sag * x * (d - x) / d**2
    slope = np.gradient(y, x)

    def flow(x, y, p):
        bend = 1 + y[1] ** 2
        return np.stack([y[1], bend / (y[0] + p[0]), np.sqrt(bend)])

    def ends(a, b, p):
        return np.array([a[0], b[0] - h, a[2], b[2] - length])

    first = np.stack([y, slope, length * x / d])
    found = _collocate(flow, ends, x, first, [1.0 + np.max(np.abs(y))])
    if found is None:
        return "not found", np.inf
    at = np.linspace(0, d, SAMPLES)
    return "SOLVED", float(np.max(np.abs(found.sol(at)[0] - exact(at))) / np.max(np.abs(exact(at))))


def _collocate(flow, ends, x, first, p):
    with np.errstate(all="ignore"):
        try:
            found = solve_bvp(flow, ends, x, first, p=np.array(p), tol=TOL, max_nodes=20_000)
        except (ValueError, np.linalg.LinAlgError):
            return None
    return found if found.success else None


# -- fences ----------------------------------------------------------------------------------


@cache
def field() -> ao.System:
    """Return the system of a fence and the area that it sweeps."""
    return ao.System(
        lambda q, v, t: v @ v / 2,
        ["x", "y"],
        integral=lambda q, v, t: (q[0] * v[1] - q[1] * v[0]) / 2,
    )


def arc(q, angle, speed, kappa, t):
    """Return places and velocities (2, K) of an arc at the times t (K,)."""
    half = kappa * t / 2
    far = speed * t * np.sinc(half / np.pi)
    place = np.array(q)[:, None] + far * np.stack([np.cos(angle - half), np.sin(angle - half)])
    turned = angle - kappa * t
    return place, speed * np.stack([np.cos(turned), np.sin(turned)])


@dataclass(frozen=True, eq=False)
class Fence:
    """What is asked: where it begins, what it passes, how it ends, and the area."""

    start: np.ndarray
    joint: np.ndarray  # where it passes, or a point of the line
    normal: np.ndarray | None  # of the line that reflects it
    end: np.ndarray  # where it ends, or a point of the line
    square: np.ndarray | None  # normal of the line on which it ends
    T: float
    energy: float | None
    area: float

    def problem(self) -> ao.Problem:
        """Return the question."""
        (a, b), n, m = self.joint, self.normal, self.square
        if n is None:
            passed = ao.Event(None, [a, b])
        else:
            passed = ao.Bounce(lambda q, t: n[0] * (q[0] - a) + n[1] * (q[1] - b))
        last = ao.Event(self.T, list(self.end))
        if m is not None:
            (x, y), T = self.end, self.T if self.energy is None else None
            last = ao.Event(T, None, on=lambda q, t: m[0] * (q[0] - x) + m[1] * (q[1] - y))
        first = ao.Event(0.0, list(self.start))
        return ao.Problem(
            field(), first, last, through=[passed], integral=self.area, energy=self.energy
        )

    def legs(self, z):
        """Return the arcs of z = (kappa, speed, angle, T, angle, T) at the ends and nodes."""
        kappa, speed, a, T, b, U = z
        s = np.r_[0.0, (XI + 1) / 2, 1.0]
        one = arc(self.start, a, speed, kappa, T * s)
        return one, arc(one[0][:, -1], b, speed, kappa, U * s)

    def misses(self, z) -> np.ndarray:
        """Return by how much two arcs miss the conditions, (6,)."""
        (q, v), (r, w) = legs = self.legs(z)
        kappa, speed, T, U = z[0], z[1], z[3], z[5]
        swept = sum(
            D / 2 * WEIGHTS @ (x[0] * u[1] - x[1] * u[0])[1:-1] / 2
            for D, (x, u) in zip((T, U), legs, strict=True)
        )
        n, m = self.normal, self.square
        jump = w[:, 0] - v[:, -1]
        off = q[:, -1] - self.joint
        passed = off if n is None else np.array([n @ off, n[0] * jump[1] - n[1] * jump[0]])
        beyond = r[:, -1] - self.end
        if m is not None:
            x, y = r[:, -1]
            p = w[:, -1] + kappa / 2 * np.array([-y, x])
            beyond = np.array([m @ beyond, m[0] * p[1] - m[1] * p[0]])
        last = T + U - self.T if self.energy is None else speed**2 / 2 - self.energy
        return np.r_[passed, beyond, last, swept - self.area]


def fence(k: int) -> tuple[Fence, np.ndarray]:
    """Return a fence to be asked, and rough places at its events, (2, 3)."""
    random = np.random.default_rng([SEED, 1, k])
    while True:
        start = random.uniform(-1, 1, 2)
        kappa, speed = random.uniform(-1.5, 1.5), random.uniform(0.5, 2.0)
        a, turn = random.uniform(-np.pi, np.pi), random.uniform(0.4, 2.4) * random.choice([-1, 1])
        T, U = random.uniform(0.4, 1.2, 2)
        z = np.array([kappa, speed, a, T, a - kappa * T + turn, U])
        nothing = Fence(start, start, None, start, None, 0.0, None, 0.0)
        (q, v), (r, w) = nothing.legs(z)
        joint, end = q[:, -1], r[:, -1]
        n = (w[:, 0] - v[:, -1]) / np.linalg.norm(w[:, 0] - v[:, -1]) if k % 2 else None
        if n is not None and min((n @ (x - joint[:, None]))[s].min() for x, s in (
            (q, slice(0, -1)), (r, slice(1, None)))) <= 0:  # fmt: skip
            continue  # the arcs cross the line
        p = w[:, -1] + kappa / 2 * np.array([-end[1], end[0]])
        kind = k // 2 % 3
        m = p / np.linalg.norm(p) if kind and np.linalg.norm(p) > 0.2 else None
        energy = float(speed**2 / 2) if kind == 2 and m is not None else None
        asked = Fence(start, joint, n, end, m, float(T + U), energy, 0.0)
        area = float(asked.misses(z)[-1])
        made = Fence(start, joint, n, end, m, float(T + U), energy, area)
        rough = np.stack([start, joint, end], axis=1)
        off = MOVED * np.ptp(rough) * random.standard_normal((2, 3))
        off[:, 0] = 0.0
        off[:, 1] *= n is not None
        off[:, 2] *= m is not None
        return made, rough + off


def ask_fence(k: int) -> Outcome:
    """Return what came of a fence."""
    made, rough = fence(k)
    solution, spent = timed(made.problem(), TOL, guess=rough)
    return judged(solution, lambda s: off_fence(made, s), TOL, spent)


def off_fence(made: Fence, s: ao.Solution) -> float:
    """Return how far a solution is from the two arcs near it that are as asked, in their size.

    Infinite where there are none near it.
    """
    U, T = s.problem.through[0].t, s.end.t
    v, w = (s.velocity(np.array([t]))[:, 0] for t in (0.0, U + 1e-9 * T))
    z = [s.integral_multipliers[0], np.linalg.norm(v), np.arctan2(v[1], v[0]), U]
    z += [np.arctan2(w[1], w[0]), T - U]
    found = root(made.misses, z, method="hybr", options={"xtol": 1e-14})
    if np.max(np.abs(made.misses(found.x))) > 1e-10:
        return np.inf
    kappa, speed, a, T1, b, T2 = found.x
    x = np.linspace(0, 1, SAMPLES)
    one, _ = arc(made.start, a, speed, kappa, T1 * x)
    two, _ = arc(one[:, -1], b, speed, kappa, T2 * x)
    known = np.concatenate([one, two], axis=1)
    own = np.concatenate([s(U * x), s(np.minimum(U + (T - U) * x, T))], axis=1)
    return float(np.max(np.abs(own - known)) / np.max(np.abs(known)))


def peer_fence(k: int) -> tuple[str, float]:
    """Return how `solve_bvp` fared; its error is by how much it misses the conditions."""
    made, rough = fence(k)
    s = np.linspace(0, 1, 17)
    T = made.T / 2
    legs = [rough[:, [j]] + np.outer(rough[:, j + 1] - rough[:, j], s) for j in (0, 1)]
    rates = [np.gradient(x, T * s, axis=1) for x in legs]
    first = np.concatenate([legs[0], rates[0], legs[1], rates[1], np.zeros((2, s.size))])

    def flow(s, y, p):
        rows = []
        for j, T in ((0, p[1]), (4, p[2])):
            v = y[j + 2 : j + 4]
            rows += [T * v[0], T * v[1], T * p[0] * v[1], -T * p[0] * v[0]]
        for j, T in ((0, p[1]), (4, p[2])):
            rows.append(T * (y[j] * y[j + 3] - y[j + 1] * y[j + 2]) / 2)
        return np.stack(rows)

    def ends(a, b, p):
        n, m, kappa = made.normal, made.square, p[0]
        jump, off = a[6:8] - b[2:4], b[:2] - made.joint
        passed = off if n is None else np.array([n @ off, n[0] * jump[1] - n[1] * jump[0]])
        beyond = b[4:6] - made.end
        if m is not None:
            P = b[6:8] + kappa / 2 * np.array([-b[5], b[4]])
            beyond = np.array([m @ beyond, m[0] * P[1] - m[1] * P[0]])
        last = p[1] + p[2] - made.T
        if made.energy is not None:
            last = a[2:4] @ a[2:4] / 2 - made.energy
        same = a[6:8] @ a[6:8] - b[2:4] @ b[2:4]
        rest = [a[8], a[9] - b[8], b[9] - made.area, same, last]
        return np.r_[a[:2] - made.start, a[4:6] - b[:2], passed, beyond, rest]

    found = _collocate(flow, ends, s, first, [0.1, T, T])
    if found is None:
        return "not found", np.inf
    y, (kappa, T1, T2) = found.sol(np.array([0.0]))[:, 0], found.p
    if min(T1, T2) <= 0 or (
        made.normal is not None and made.normal @ (y[6:8] - found.y[2:4, -1]) < 1e-6
    ):
        return "another path", np.inf
    z = [kappa, np.hypot(*y[2:4]), np.arctan2(y[3], y[2]), T1, np.arctan2(y[7], y[6]), T2]
    return "SOLVED", float(np.max(np.abs(made.misses(z))))


# -- the family ------------------------------------------------------------------------------

ASK = {"ropes": ask_rope, "mixed": ask_fence}
ASK_PEER = {"ropes": peer_rope, "mixed": peer_fence}


def cases(quick: bool) -> list[Case]:
    """Return them."""
    found = batches(ASK, COUNTS, BATCH, quick)
    for kind, counts in COUNTS.items():
        found.append(asked_too(kind, ASK_PEER[kind], min(PEERS, counts[quick]), TOL))
    return found


def criteria(rows) -> list[Criterion]:
    """Return them."""
    found = []
    for kind in COUNTS:
        found += [*right_and_solved(kind, mine(rows, kind), MOST_LOST), found_too(kind, rows)]
    return found
