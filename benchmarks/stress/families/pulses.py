"""Pulses in time and walls in space of about a thousandth of the whole.

A free body and a pendulum get a unit of momentum about t = c, from 0 to 1 in unit time:
L = v^2 / 2 + exp(-((t - c) / w)^2) / (w sqrt(pi)) q, with 9.81 cos(q) for the pendulum; 120 seeded
places c for each width and tolerance, a row. The free body's path is known in closed form; the
pendulum's is found by shooting (DOP853 in four pieces that meet at the pulse) from the first
velocity of the answer. Walls L = v^2 / 2 -+ 0.3 f((x - c) / w) are crossed at the energy for which
the time of flight, an integral over x, is one. An answer is wrong if it is called solved and its
true error exceeds three times its claim and three times the tolerance.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import erf

import actionopt as ao
from actionopt import Event, Problem, System
from benchmarks.stress.case import Case, Criterion, Row, deviation, measured, mine, timed
from benchmarks.stress.tally import Outcome, judged, right_and_solved, row

TITLE = "Pulses and walls"
WIDTHS = (0.001, 0.002, 0.0033, 0.005, 0.0067)  # full widths at half maximum
TOLERANCES = (1e-3, 1e-6, 1e-8, 1e-10)
PLACES, SEED = 120, 13
FWHM = 2 * np.sqrt(np.log(2))  # of exp(-(t / w)^2), in units of w
GRAVITY = 9.81
REACH = 8.0  # w from the middle of a pulse, beyond which it is 1e-28
FRACTIONS = np.linspace(0.0, 1.0, 51)  # of each piece, where paths are compared
SHOT = 1e-11  # accuracy of a motion found by shooting
WALL, HEIGHT, CROSSED = 1e-3, 0.3, 20
WALLS: dict[str, Callable] = {
    "Gaussian": lambda s: np.exp(-(s**2)),
    "Lorentzian": lambda s: 1 / (1 + s**2),
    "step": lambda s: (1 + np.tanh(s)) / 2,
}
WALL_TOLERANCES = (1e-3, 1e-6, 1e-9)


def places(count: int, seed: int = SEED) -> np.ndarray:
    """Return the times, or points, at which it happens."""
    return np.random.default_rng(seed).uniform(0.06, 0.94, count)


@cache
def systems() -> dict[str, System]:
    """Return the kicked ones, derived once."""

    def free(q, v, t, *, c, w):
        return v[0] ** 2 / 2 + np.exp(-(((t - c) / w) ** 2)) / (w * np.sqrt(np.pi)) * q[0]

    def pendulum(q, v, t, *, c, w):
        return free(q, v, t, c=c, w=w) + GRAVITY * np.cos(q[0])

    either = {"free body": free, "pendulum": pendulum}
    parameters = {"c": 0.5, "w": 0.1}
    return {k: System(L, ["x"], parameters=parameters, name=k) for k, L in either.items()}


def kicked(name: str, c: float, w: float) -> Problem:
    """Return the question."""
    ends = Event(0.0, [0.0]), Event(1.0, [1.0])
    return Problem(systems()[name], *ends, parameters={"c": c, "w": w})


def closed_form(c: float, w: float):
    """Return the path of the free body: the pulse integrated twice, and a straight line."""

    def twice(t):
        s = (t - c) / w
        return ((t - c) * (1 + erf(s)) + w / np.sqrt(np.pi) * np.exp(-(s**2))) / 2

    return lambda t: np.atleast_2d(t + twice(t) - twice(0.0) * (1 - t) - twice(1.0) * t)


def motions(c: np.ndarray, w: float, v: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return the motions of K kicked pendulums from x = 0 with velocities v (K,).

    Times and positions (K, M), and dx(1)/dv (K,), by the variational equation.
    """
    edges = np.stack([np.zeros_like(c), c - REACH * w, c, c + REACH * w, np.ones_like(c)])
    y = np.stack([np.zeros_like(c), v, np.zeros_like(c), np.ones_like(c)]).ravel()
    times, positions = [], []
    for a, b in pairwise(edges):
        h = b - a

        def rhs(s, y, a=a, h=h):
            x, rate, dx, change = y.reshape(4, -1)
            pulse = np.exp(-(((a + s * h - c) / w) ** 2)) / (w * np.sqrt(np.pi))
            force = pulse - GRAVITY * np.sin(x)
            return np.concatenate([h * rate, h * force, h * change, -h * GRAVITY * np.cos(x) * dx])

        span = FRACTIONS[[0, -1]]
        run = solve_ivp(
            rhs, span, y, "DOP853", rtol=1e-12, atol=1e-12, max_step=0.1, t_eval=FRACTIONS
        )
        y = run.y[:, -1]
        times.append(a[:, None] + h[:, None] * FRACTIONS)
        positions.append(run.y[: c.size])
    return (
        np.concatenate(times, axis=1),
        np.concatenate(positions, axis=1),
        y[2 * c.size :][: c.size],
    )


def shot(c: np.ndarray, w: float, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return times and positions (K, M) of the pendulums' motions to x = 1 nearest to v (K,).

    Positions are not numbers where Newton's iteration finds none.
    """
    for _ in range(12):
        t, x, slope = motions(c, w, v)
        missed = x[:, -1] - 1
        if np.all(np.abs(missed) < SHOT / 10):
            break
        v = v - missed / slope
    return t, np.where(np.abs(missed)[:, None] < SHOT, x, np.nan)


def free_bodies(centres: np.ndarray, width: float, tol: float) -> list[Row]:
    """Return the row of a width and a tolerance."""
    outcomes = []
    for c in centres:
        problem, exact = kicked("free body", c, width / FWHM), closed_form(c, width / FWHM)
        solution, spent = timed(problem, tol)
        outcomes.append(judged(solution, lambda s, e=exact: missed(s, e), tol, spent, 1e-15))
    return [row(outcomes)]


def missed(solution: ao.Solution, exact) -> float:
    """Return the true error, at many times and at all nodes."""
    return deviation(solution, exact, solution.problem, solution.mesh.nodes) or 0.0


def pendulums(centres: np.ndarray, width: float, tol: float) -> list[Row]:
    """Return the row of a width and a tolerance."""
    found = [timed(kicked("pendulum", c, width / FWHM), tol) for c in centres]
    return [row(beside_motions(found, centres, width / FWHM, tol))]


def beside_motions(found, centres: np.ndarray, w: float, tol: float) -> list[Outcome]:
    """Return the outcomes of pairs (solution, time), each beside the motion next to it."""
    t, x = shot(centres, w, np.array([s.start.v[0] for s, _ in found]))

    def error(k):
        return lambda s: np.max(np.abs(s(t[k])[0] - x[k])) / np.max(np.abs(x[k]))

    return [judged(s, error(k), tol, spent, SHOT) for k, (s, spent) in enumerate(found)]


@cache
def wall(name: str) -> System:
    """Return a body that crosses a wall, derived once."""
    profile = WALLS[name]
    return System(
        lambda q, v, t, *, c, height: v[0] ** 2 / 2 - height * profile((q[0] - c) / WALL),
        ["x"],
        parameters={"c": 0.5, "height": HEIGHT},
        name=name,
    )


def flight(profile, height: float, c: float) -> tuple[np.ndarray, np.ndarray]:
    """Return points from 0 to 1, and the times at which they are passed: Gauss-Legendre panels.

    The panels double away from the wall; each is crossed with an error far below rounding.
    """
    far = WALL * np.concatenate([np.arange(0.0, 8.0, 0.5), 8.0 * 1.3 ** np.arange(40)])
    near = np.concatenate([c - far, c + far])
    x = np.unique(np.concatenate([near[(near > 0) & (near < 1)], np.linspace(0, 1, 21)]))
    nodes, weights = np.polynomial.legendre.leggauss(20)
    h = np.diff(x)[:, None] / 2
    U = height * profile((x[:-1, None] + h * (1 + nodes) - c) / WALL)

    def times(energy):
        return np.concatenate([[0.0], np.cumsum((h / np.sqrt(2 * (energy - U))) @ weights)])

    off = lambda e: times(e)[-1] - 1  # noqa: E731
    energy = brentq(off, U.max() + 1e-6, 50.0, xtol=1e-15, rtol=np.float64(1e-15))
    return x, np.minimum(times(energy), 1.0)


def crossings(name: str, count: int, tol: float) -> list[Row]:
    """Return the row of a wall and a tolerance, hills and wells."""
    profile, outcomes = WALLS[name], []
    for height in (HEIGHT, -HEIGHT):
        for c in places(count):
            ends = Event(0.0, [0.0]), Event(1.0, [1.0])
            problem = Problem(wall(name), *ends, parameters={"c": c, "height": height})
            solution, spent = timed(problem, tol)
            x, t = flight(profile, height, c)
            outcomes.append(
                judged(solution, lambda s, x=x, t=t: np.max(np.abs(s(t)[0] - x)), tol, spent, 1e-13)
            )
    return [row(outcomes)]


def cases(quick: bool) -> list[Case]:
    """Return them."""
    centres = places(PLACES // 20 if quick else PLACES)
    kicks = [
        measured(f"{name}, width {w:g}, tol {tol:.0e}", m, centres, w, tol)
        for name, m in (("free body", free_bodies), ("pendulum", pendulums))
        for w in WIDTHS
        for tol in TOLERANCES
    ]
    count = CROSSED // 10 if quick else CROSSED
    walls = [
        measured(f"{name}, tol {tol:.0e}", crossings, name, count, tol)
        for name in WALLS
        for tol in WALL_TOLERANCES
    ]
    return kicks + walls


def criteria(rows) -> list[Criterion]:
    """Return them."""
    out = []
    for what, prefixes in (
        ("kicked free body", ("free body",)),
        ("kicked pendulum", ("pendulum",)),
        ("walls", tuple(WALLS)),
    ):
        out += right_and_solved(what, [r for p in prefixes for r in mine(rows, p)])
    return out
