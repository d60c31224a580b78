"""Accelerations: splines through points, splines through gates at times to be found, and beams.

Splines of least acceleration, jerk or snap pass random points at random times; scipy's splines of
degree 3, 5 and 7 through them are the same curves. Through gates the times are found, and the
reference is the spline near the answer whose energy is continuous at all of them (Powell's hybrid
method). A beam of varying stiffness, on a foundation and with a load along it, bends under a
load at random places, alone or coupled to another one; the reference is Ritz's method with 40
polynomials for each, which also counts how many ways it would buckle: another index than that
counts as wrong. `solve_bvp` is asked ten of the single beams.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.polynomial import legendre
from scipy.integrate import solve_bvp
from scipy.interpolate import make_interp_spline
from scipy.linalg import block_diag, null_space
from scipy.optimize import root

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

TITLE = "Accelerations: splines and beams"
TOL, SEED = 1e-9, 2030
BATCH = 20  # questions a row
COUNTS = {"splines": (80, 8), "gates": (40, 4), "beams": (80, 8)}  # of all, and of a quick run
PEERS = 10  # beams that solve_bvp is asked too
MOST_LOST = 0.05  # of each kind
SAMPLES = 201
RATES = "vaj"  # what events may give beside q


# -- splines ---------------------------------------------------------------------------------


@cache
def bent(order: int, n: int) -> ao.System:
    """Return the system of the least square of a derivative."""
    laws = {
        2: lambda q, v, a, t: (a @ a) / 2,
        3: lambda q, v, a, j, t: (j @ j) / 2,
        4: lambda q, v, a, j, s, t: (s @ s) / 2,
    }
    return ao.System(laws[order], list("xyz"[:n]))


@dataclass(frozen=True, eq=False)
class Points:
    """What a spline passes (K, n), when (K,), and its rates at the ends; none if it is natural."""

    order: int
    times: np.ndarray
    places: np.ndarray
    rates: np.ndarray | None  # (2, order - 1, n)

    @classmethod
    def draw(cls, kind: int, k: int) -> Points:
        """Return those of a question."""
        random = np.random.default_rng([SEED, kind, k])
        order, n = int(random.integers(2, 5)), int(random.integers(1, 4))
        clamped = bool(kind) or random.random() < 0.5
        count = int(random.integers(3, 5) if kind else random.integers(2 if clamped else order, 9))
        places = random.normal(size=(count, n))
        if kind:  # gates that are passed one after the other
            places[:, 0] = np.cumsum(random.uniform(0.5, 1.5, count))
        rates = None
        if clamped:
            rates = (not kind) * random.normal(size=(2, order - 1, n))
        return cls(order, np.cumsum(random.uniform(0.3, 1.0, count)), places, rates)

    def problem(self, *, found: bool) -> ao.Problem:
        """Return the question, the times between the ends given or to be found."""
        given = [{}, {}]
        if self.rates is not None:
            given = [dict(zip(RATES, rows, strict=False)) for rows in self.rates]
        first, last = (ao.Event(self.times[i], self.places[i], **given[i]) for i in (0, -1))
        inner = zip(self.times[1:-1], self.places[1:-1], strict=True)
        through = [ao.Event(None if found else t, q) for t, q in inner]
        system = bent(self.order, self.places.shape[1])
        return ao.Problem(system, first, last, through=through)

    def spline(self, times: np.ndarray) -> Callable:
        """Return the curve through the points at other times."""
        r, n = self.order, self.places.shape[1]
        if self.rates is None:
            ends = [[(k, np.zeros(n)) for k in range(r, 2 * r - 1)]] * 2
        else:
            ends = [list(enumerate(rows, start=1)) for rows in self.rates]
        return make_interp_spline(times, self.places, k=2 * r - 1, bc_type=tuple(ends))

    def steps(self, inner: np.ndarray) -> np.ndarray:
        """Return the steps of the energy at the gates, +- [q^(2 r - 1)] . v."""
        times = np.r_[self.times[0], inner, self.times[-1]]
        curve = self.spline(times)
        top = curve.derivative(2 * self.order - 1)((times[1:] + times[:-1]) / 2)
        return np.sum(np.diff(top, axis=0) * curve(inner, 1), axis=1)


def apart(solution: ao.Solution, known: Callable) -> float:
    """Return the largest distance from a curve t -> (K, n), in the size of each coordinate."""
    t = np.linspace(solution.start.t, solution.end.t, SAMPLES)
    exact = known(t).T
    off = np.abs(solution(t) - exact).max(axis=1)
    return float(np.max(off / np.abs(exact).max(axis=1)))


def ask_spline(k: int) -> Outcome:
    """Return what came of a spline through points."""
    points = Points.draw(0, k)
    solution, spent = timed(points.problem(found=False), TOL)
    return judged(solution, lambda s: apart(s, points.spline(points.times)), TOL, spent)


def ask_gates(k: int) -> Outcome:
    """Return what came of a spline through gates."""
    points = Points.draw(1, k)
    solution, spent = timed(points.problem(found=True), TOL)

    def error(s: ao.Solution) -> float:
        inner = np.array([e.t for e in s.problem.through])
        size = np.abs(points.steps(inner * (1 + 1e-3))).max()
        near = root(points.steps, inner, method="hybr", options={"xtol": 1e-13})
        if not np.abs(near.fun).max() < 1e-9 * size:
            return np.inf
        return apart(s, points.spline(np.r_[points.times[0], near.x, points.times[-1]]))

    return judged(solution, error, TOL, spent)


# -- beams -----------------------------------------------------------------------------------

TERMS = 40  # of Ritz's sum for each beam
MOMENTUM = {"clamped": (True, True), "hinged": (True, False)}
MOMENTUM |= {"guided": (False, True), "free": (False, False)}  # whether q and v are given
SINGULAR = 1e-2  # a smaller eigenvalue of Ritz's matrix: the beam is about to buckle


@dataclass(frozen=True, eq=False)
class Beam:
    """Beams from t = 0 to T: stiffness, load along, foundation, spring between, and the ends."""

    n: int
    T: float
    wave: tuple[float, float, float]  # of stiffness and load: amplitude, two phases
    push: float
    ground: float
    spring: float
    ends: tuple[str, str]
    given: np.ndarray  # (2, 2, n): at both ends q and v

    @classmethod
    def draw(cls, k: int) -> Beam:
        """Return the beam of a question, that is not about to buckle."""
        random = np.random.default_rng([SEED, 2, k])
        while True:
            first = str(random.choice(["clamped", "hinged"]))
            last = ["clamped", "hinged", "guided", "free"][: 4 if first == "clamped" else 2]
            made = cls(
                1 + k % 2,
                float(random.uniform(0.7, 2.0)),
                (float(random.uniform(0, 0.6)), *random.uniform(0, 6, 2).tolist()),
                float(random.choice([0.0, random.uniform(0, 120)])),
                float(random.uniform(0, 20)),
                float(random.uniform(0, 10)),
                (first, str(random.choice(last))),
                random.normal(size=(2, 2, 1 + k % 2)) / 5,
            )
            if np.abs(made.eigenvalues(TERMS)).min() > SINGULAR:
                return made

    def stiffness(self, t):
        """Return the stiffness along it."""
        return 1 + self.wave[0] * np.sin(3 * t + self.wave[1])

    def load(self, t):
        """Return the load on the first beam."""
        return 5 * np.cos(4 * t + self.wave[2])

    def problem(self) -> ao.Problem:
        """Return the question."""

        def law(q, v, a, t):
            bending = self.stiffness(t) * (a @ a) / 2 - self.push * (v @ v) / 2
            between = self.spring * (q[0] - q[1]) ** 2 / 2 if self.n > 1 else 0.0
            return bending + self.ground * (q @ q) / 2 + between - self.load(t) * q[0]

        events = []
        for t, kind, (q, v) in zip((0.0, self.T), self.ends, self.given, strict=True):
            known, held = MOMENTUM[kind]
            events.append(
                ao.Event(t, q if known else [None] * self.n, v=v if held else [None] * self.n)
            )
        return ao.Problem(ao.System(law, list("xy"[: self.n])), *events)

    def form(self, terms: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, Callable]:
        """Return Ritz's matrix and load, the rows of the conditions, and basis(t, derivative).

        Constant, line, and what has Legendre's polynomials as second derivatives.
        """
        T = self.T
        rows = [np.eye(2)[k] for k in (0, 1)]
        rows += [
            legendre.legint(np.eye(k + 1)[k] * np.sqrt(k + 0.5), 2, lbnd=-1)
            for k in range(terms - 2)
        ]

        def basis(t, k=0):
            x = 2 * np.asarray(t) / T - 1
            return (2 / T) ** k * np.stack(
                [legendre.legval(x, legendre.legder(c, k) if k else c) for c in rows], axis=-1
            )

        x, w = legendre.leggauss(2 * terms)
        t, w = T * (x + 1) / 2, w * T / 2
        q, v, a = (basis(t, k) for k in range(3))
        mass = q.T @ (w[:, None] * q)
        one = a.T @ ((w * self.stiffness(t))[:, None] * a) - self.push * v.T @ (w[:, None] * v)
        one = one + self.ground * mass
        matrix: Any = block_diag(*[one] * self.n)
        if self.n > 1:
            matrix = matrix + self.spring * np.kron([[1, -1], [-1, 1]], mass)
        pull = np.zeros(self.n * terms)
        pull[:terms] = q.T @ (w * self.load(t))
        held = [
            basis(s, k)
            for s, kind in zip((0.0, T), self.ends, strict=True)
            for k in (0, 1)
            if MOMENTUM[kind][k]
        ]
        return matrix, pull, np.kron(np.eye(self.n), np.array(held)), basis

    def eigenvalues(self, terms: int) -> np.ndarray:
        """Return those of Ritz's matrix among what the ends allow."""
        matrix, _, rows, _ = self.form(terms)
        free = null_space(rows)
        return np.linalg.eigvalsh(free.T @ matrix @ free)

    def ritz(self, terms: int) -> Callable:
        """Return the curve t -> (K, n) of Ritz's method."""
        matrix, pull, rows, basis = self.form(terms)
        wanted = [
            self.given[i, k]
            for i, kind in enumerate(self.ends)
            for k in (0, 1)
            if MOMENTUM[kind][k]
        ]
        one = np.linalg.lstsq(rows, np.array(wanted).T.ravel(), rcond=None)[0]
        free = null_space(rows)
        c = one + free @ np.linalg.solve(free.T @ matrix @ free, free.T @ (pull - matrix @ one))
        return lambda t: basis(t) @ c.reshape(self.n, -1).T


def ask_beam(k: int) -> Outcome:
    """Return what came of a beam: as wrong as its curve is, and wholly where its index is."""
    beam = Beam.draw(k)
    solution, spent = timed(beam.problem(), TOL)
    known, finer = beam.ritz(TERMS), beam.ritz(TERMS + 8)
    t = np.linspace(0, beam.T, SAMPLES)
    off, size = np.abs(known(t) - finer(t)).max(axis=0), np.abs(known(t)).max(axis=0)
    accuracy = float(np.max(off / size))

    def error(s: ao.Solution) -> float:
        same = s.morse_index == np.sum(beam.eigenvalues(TERMS) < 0)
        return apart(s, known) if same else np.inf

    return judged(solution, error, TOL, spent, accuracy)


def peer_beam(k: int) -> tuple[str, float]:
    """Return how `solve_bvp` fared on a single beam, from the line, and its true error."""
    beam = Beam.draw(2 * k)

    def flow(t, y):  # of q, v, the moment and what is transverse to it
        bend = y[2] / beam.stiffness(t)
        return np.stack([y[1], bend, y[3] - beam.push * y[1], beam.load(t) - beam.ground * y[0]])

    def ends(a, b):
        found = []
        for y, kind, (q, v) in zip((a, b), beam.ends, beam.given[:, :, 0], strict=True):
            known, held = MOMENTUM[kind]
            found += [y[0] - q if known else y[3], y[1] - v if held else y[2]]
        return np.array(found)

    t = np.linspace(0, beam.T, 17)
    found = solve_bvp(flow, ends, t, np.zeros((4, t.size)), tol=TOL, max_nodes=20_000)
    if not found.success:
        return "not found", np.inf
    at = np.linspace(0, beam.T, SAMPLES)
    exact = beam.ritz(TERMS)(at)[:, 0]
    return "SOLVED", float(np.max(np.abs(found.sol(at)[0] - exact)) / np.max(np.abs(exact)))


# -- the family ------------------------------------------------------------------------------

ASK = {"splines": ask_spline, "gates": ask_gates, "beams": ask_beam}


def cases(quick: bool) -> list[Case]:
    """Return them."""
    peer = asked_too("beams", peer_beam, min(PEERS, COUNTS["beams"][quick]), TOL)
    return [*batches(ASK, COUNTS, BATCH, quick), peer]


def criteria(rows) -> list[Criterion]:
    """Return them."""
    found = [x for kind in COUNTS for x in right_and_solved(kind, mine(rows, kind), MOST_LOST)]
    return [*found, found_too("beams", rows)]
