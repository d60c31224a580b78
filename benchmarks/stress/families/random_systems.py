"""Random Lagrangians of one to four coordinates: the ends of forward motions, and no guess.

L = v . M(q, t) v / 2 + A(q, t) . v - U(q, t), where M, A and U are sums of ridge functions
g(w . q + phi + Omega t), and sometimes a friction: 40 seeded systems for each range of durations,
at tol 1e-8, 30 s each. Forward motions by the equations derived by hand give the end events. A
path is an answer if a motion with those ends is next to it: from its own positions and velocities
at the starts of all elements the same equations are integrated over each element, and from
what is missed there one step of multiple shooting gives the distance to the motion. scipy's
`solve_bvp` starts from the straight line and has 3 s, for the first systems of each range.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from time import process_time

import numpy as np
from scipy.integrate import solve_ivp

import actionopt as ao
from actionopt import Event, Problem, System
from benchmarks.stress import peers
from benchmarks.stress.case import Case, Criterion, Question, Row, measured, mine, timed
from benchmarks.stress.forward import distance
from benchmarks.stress.tally import counted, judged, never_wrong, row

TITLE = "Random systems"
BINS = {
    "T = 0.1 to 0.4": (0.1, 0.4),
    "T = 0.8 to 1.6": (0.8, 1.6),
    "T = 3.2": (3.2, 3.2),
    "T = 6.4": (6.4, 6.4),
    "T = 12.8": (12.8, 12.8),
}
COUNT, COMPARED, SEED = 40, 12, 29
TOL, SECONDS, PEER = 1e-8, 30.0, 3.0
ACCURACY = 1e-9  # of the distance to the motion
FAR = 100.0  # a motion that leads farther is not asked for

# Profiles g(s), and g'(s) derived by hand; all positive, so that they can be masses.
PROFILES = {
    "wave": (lambda s: 1 + 0.8 * np.sin(s), lambda s: 0.8 * np.cos(s)),
    "bump": (lambda s: np.exp(-(s**2) / 2), lambda s: -s * np.exp(-(s**2) / 2)),
    "hill": (lambda s: 1 / (1 + s**2), lambda s: -2 * s / (1 + s**2) ** 2),
    "step": (lambda s: 1 + np.tanh(s), lambda s: 1 / np.cosh(s) ** 2),
}


@dataclass(frozen=True)
class Ridges:
    """A sum over k of size_k g_k(w_k . q + phi_k + Omega_k t), each along a direction.

    Attributes
    ----------
    profiles : tuple of pairs
        g and g'.
    size, phi, omega : (k,) arrays
    w, along : (k, n) arrays
    """

    profiles: tuple
    size: np.ndarray
    w: np.ndarray
    phi: np.ndarray
    omega: np.ndarray
    along: np.ndarray

    def terms(self, q, t) -> list:
        """Return size_k g_k at symbols or numbers."""
        return [
            c * g[0](sum(x * y for x, y in zip(w, q, strict=True)) + phi + omega * t)
            for g, c, w, phi, omega in zip(
                self.profiles, self.size, self.w, self.phi, self.omega, strict=True
            )
        ]

    def slopes(self, q: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return size_k g_k and size_k g_k', (k, K) each, at q (n, K) and t (K,)."""
        s = self.w @ q + self.phi[:, None] + self.omega[:, None] * t
        values = np.empty((2, *s.shape))
        for k, (g, derivative) in enumerate(self.profiles):
            values[0, k], values[1, k] = g(s[k]), derivative(s[k])
        return tuple(values * self.size[:, None])

    def rates(self, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return ds_k/dt and the velocities along_k . v, (k, K) each, at v (n, K)."""
        return self.w @ v + self.omega[:, None], self.along @ v


def ridges(random, count: int, n: int, size, clock: bool, names=tuple(PROFILES)) -> Ridges:
    """Return that many random ones."""
    return Ridges(
        tuple(PROFILES[str(random.choice(names))] for _ in range(count)),
        np.asarray(size, dtype=float),
        random.normal(0, 0.8, (count, n)),
        random.uniform(-3, 3, count),
        random.normal(0, 1.0, count) * (clock & (random.random(count) < 0.5)),
        random.normal(0, 1.0, (count, n)),
    )


class Random:
    """One random system, and a motion of it from `q0` with `v0` for `T`, all from a seed."""

    def __init__(self, seed, shortest: float, longest: float) -> None:
        random = np.random.default_rng(seed)
        self.n = n = int(random.integers(1, 5))
        clock = random.random() < 0.3
        self.inertia = np.eye(n) + 0.1 * np.ones((n, n))
        curved = int(random.integers(1, 4)) if random.random() < 0.5 else 0
        self.masses = ridges(random, curved, n, random.uniform(0.2, 0.8, curved), clock)
        turning = int(random.integers(1, 3)) if random.random() < 0.3 else 0
        self.vectors = ridges(random, turning, n, random.normal(0, 1.0, turning), clock)
        k = int(random.integers(1, 4))
        potential = ridges(random, k, n, random.normal(0, 2.0, k), clock)
        self.potential = potential
        self.springs = np.abs(random.normal(0, 0.5, n)) * (random.random() < 0.6)
        self.friction = 0.2 * random.random(n) * (random.random() < 0.15)
        self.T = float(random.uniform(shortest, longest))
        self.q0, self.v0 = random.normal(0, 1.0, (2, n))

    @cached_property
    def system(self) -> System:
        """The package's view."""

        def lagrangian(q, v, t):
            L = v @ (self.inertia @ v) / 2 - sum(self.springs * q**2) / 2
            for m, c in zip(self.masses.terms(q, t), self.masses.along, strict=True):
                L = L + m * (c @ v) ** 2 / 2
            for a, b in zip(self.vectors.terms(q, t), self.vectors.along, strict=True):
                L = L + a * (b @ v)
            return L - sum(self.potential.terms(q, t))

        def force(q, v, t):
            return -self.friction * v

        names = [f"q{k}" for k in range(self.n)]
        return System(lagrangian, names, force=force if np.any(self.friction) else None)

    def acceleration(self, q: np.ndarray, v: np.ndarray, t: np.ndarray) -> np.ndarray:
        """Return q'' (n, K) at q, v (n, K) and t (K,), by the equations of motion by hand.

        (M q'')_i = dL/dq_i - (d/dt of dL/dv_i at q'' = 0), term by term.
        """
        t = np.broadcast_to(t, q.shape[1:])
        f = -self.springs[:, None] * q - self.friction[:, None] * v
        M = np.broadcast_to(self.inertia[..., None], (self.n, self.n, q.shape[1]))
        T = self.masses
        m, dm = T.slopes(q, t)
        rate, along = T.rates(v)
        M = M + np.einsum("ki,kj,kK->ijK", T.along, T.along, m)
        f = f + T.w.T @ (dm * along**2) / 2 - T.along.T @ (dm * rate * along)
        A = self.vectors
        _, da = A.slopes(q, t)
        rate, along = A.rates(v)
        f = f + A.w.T @ (da * along) - A.along.T @ (da * rate)
        f = f - self.potential.w.T @ self.potential.slopes(q, t)[1]
        return np.linalg.solve(np.moveaxis(M, 2, 0), f.T[..., None])[..., 0].T

    def end(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Return the state of the motion at T, if it stays near."""
        n = self.n

        def rhs(t, y):
            return np.concatenate([y[n:], self.acceleration(y[:n, None], y[n:, None], t)[:, 0]])

        first = np.concatenate([self.q0, self.v0])
        run = solve_ivp(rhs, (0, self.T), first, "DOP853", rtol=1e-10, atol=1e-10)
        if not run.success or not np.max(np.abs(run.y[:n])) < FAR:
            return None
        return run.y[:n, -1], run.y[n:, -1]

    def problem(self) -> Problem | None:
        """Return the question, if the motion stays near."""
        end = self.end()
        return end and Problem(self.system, Event(0.0, self.q0), Event(self.T, end[0]))


def draws(which: int, count: int) -> list[tuple[Random, Problem]]:
    """Return the systems of a range of durations, and the questions."""
    shortest, longest = list(BINS.values())[which]
    out, seed = [], 0
    while len(out) < count:
        case = Random((SEED, which, seed), shortest, longest)
        problem, seed = case.problem(), seed + 1
        if problem is not None:
            out.append((case, problem))
    return out


def off(solution: ao.Solution, case: Random) -> float:
    """Return how far the nearest motion with the same ends is, in units of the largest |q|."""
    return distance(solution, case.acceleration)


def measure(which: int, count: int, compared: int) -> list[Row]:
    """Return the rows of a range of durations: ours, and that of collocation."""
    outcomes, others, times = [], [], []
    for k, (case, problem) in enumerate(draws(which, count)):
        solution, spent = timed(problem, TOL, seconds=SECONDS)
        outcomes.append(judged(solution, lambda s, c=case: off(s, c), TOL, spent, ACCURACY))
        if k < compared:
            clock = process_time()
            try:
                peers.collocation(Question(problem, tol=TOL), clock + PEER)
                others.append("SOLVED")
            except peers.Failed as failure:
                others.append(str(failure))
            times.append(process_time() - clock)
    return [row(outcomes), {"solver": "solve_bvp", **counted(others, times)}]


def cases(quick: bool) -> list[Case]:
    """Return them."""
    count, compared = (4, 1) if quick else (COUNT, COMPARED)
    return [measured(name, measure, k, count, compared) for k, name in enumerate(BINS)]


def criteria(rows) -> list[Criterion]:
    """Return them."""
    return [never_wrong(name, mine(rows, name)) for name in BINS]
