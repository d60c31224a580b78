"""Ends at infinity, at centres, and paths without a clock, with random numbers.

Kinks between random wells, whose path and action are quadratures; bounces in random potentials,
held against Derrick's theorem, S = 2 T / D with T the gradient's part; light that winds around a
black hole by random angles, whose time is a quadrature. Beside them scipy's `solve_bvp`, with its
singular term for the centre and the linear decay at the far end.
"""

from __future__ import annotations

import math
import time
from functools import cache
from typing import Any

import numpy as np
from scipy.integrate import quad, solve_bvp, solve_ivp
from scipy.optimize import brentq

import actionopt as ao
from benchmarks.stress.case import Case, Criterion, Row, answer, beside, members, mine, within

TITLE = "Ends at infinity and at centres, rays"
TOL = 1e-9
COUNTS = {"well": (40, 2), "bounce": (20, 1), "winding": (40, 2)}  # all, and quick
WRONG = 100 * TOL  # of an identity between actions; Derrick's takes two digits
SEED = 19


@cache
def systems() -> dict[str, ao.System]:
    """Return them, derived once."""

    def well(q, v, t, *, a, b, c, d):
        x = q[0]
        return v[0] ** 2 / 2 + (x - a) ** 2 * (b - x) ** 2 * (1 + c * x + d * x**2) ** 2 / 2

    def radial(q, v, r, *, c, d):
        x = q[0]
        return r**2 * (v[0] ** 2 / 2 + x**2 / 2 - c * x**3 + d * x**4)

    def light(q, v, *, M):
        f = 1 - 2 * M / q[0]
        return np.sqrt((v[0] / f) ** 2 + (q[0] * v[1]) ** 2 / f)

    return {
        "well": ao.System(well, ["x"], parameters={"a": -1.0, "b": 1.0, "c": 0.0, "d": 0.0}),
        "bounce": ao.System(radial, ["x"], parameters={"c": 0.5, "d": 0.1}),
        "winding": ao.System.geodesic(light, ["r", "phi"], parameters={"M": 1.0}),
    }


def well(k: int) -> list[Row]:
    """Return the row of a kink from a to b, where x' = (x - a) (b - x) g(x)."""
    rng = np.random.default_rng([SEED, k])
    a, b = -rng.uniform(0.5, 2), rng.uniform(0.5, 2)
    c, d = rng.uniform(-0.3, 0.3), rng.uniform(0.1, 1)  # g > 0: c^2 < 4 d
    speed = lambda x: (x - a) * (b - x) * (1 + c * x + d * x**2)  # noqa: E731
    S = quad(speed, a, b, epsabs=0, epsrel=1e-13)[0]
    problem = ao.Problem(
        systems()["well"],
        ao.Event(-math.inf, [a]),
        ao.Event(math.inf, [b]),
        parameters={"a": a, "b": b, "c": c, "d": d},
    )
    row, solution = _mine(problem, None)
    half = (a + b) / 2
    error = abs(solution.action - S) / S
    for end in (-5.0, 5.0):
        run = solve_ivp(
            lambda t, x: speed(x),
            (0, end),
            [half],
            "DOP853",
            rtol=1e-12,
            atol=1e-14,
            dense_output=True,
        )
        t = np.linspace(0, end, 201)
        error = max(error, np.abs(run.sol(t)[0] - solution(t)[0]).max() / max(-a, b))
    row["error"] = float(error)
    clock = time.process_time()
    T = 20 / min(abs((b - a) * (1 + c * a + d * a**2)), abs((b - a) * (1 + c * b + d * b**2)))
    t = np.linspace(-T, T, 101)

    def rates(t, y):
        x = y[0]
        force = np.polyval(np.polyder(_squared(a, b, c, d)), x) / 2
        return np.stack([y[1], force])

    guess = np.stack([half + (b - a) / 2 * np.tanh(t), (b - a) / 2 / np.cosh(t) ** 2])
    found = solve_bvp(
        rates, lambda ya, yb: np.array([ya[0] - a, yb[0] - b]), t, guess, tol=TOL, max_nodes=20000
    )
    return [row, _peer(found, _action(found, lambda t, y: y[1] ** 2), S, clock)]


def _squared(a: float, b: float, c: float, d: float) -> np.ndarray:
    """Return the coefficients of ((x - a) (b - x) (1 + c x + d x^2))^2."""
    root = np.polymul(np.polymul([1, -a], [-1, b]), [d, c, 1])
    return np.polymul(root, root)


def bounce(k: int) -> list[Row]:
    """Return the rows of a bounce in three dimensions, V = x^2 / 2 - c x^3 + d x^4."""
    rng = np.random.default_rng([SEED, 100, k])
    c = 0.5
    d = rng.uniform(0.02, 0.1)  # a true vacuum below zero: d < c^2 / 2
    problem = ao.Problem(
        systems()["bounce"],
        ao.Event(0, [None]),
        ao.Event(math.inf, [0.0]),
        parameters={"c": c, "d": d},
    )
    found = [s for s in ao.solve_all(problem, tol=TOL) if s.action > 0]
    if not found:
        return [{"solver": "actionopt", "status": "NOT_FOUND", "success": False, "error": None}]
    row, solution = _mine(problem, found[0])
    mesh, total = solution.mesh, 0.0
    for g in mesh.groups:
        half = mesh.lengths[g.elements][:, None] / 2
        v = solution.path.values[0][g.nodes] @ g.rule.derivative.T / half
        total += float(np.sum(half * g.rule.weights * mesh.nodes[g.nodes] ** 2 * v**2 / 2))
    row["error"] = abs(2 * total / 3 - solution.action) / solution.action
    row["index"] = solution.morse_index
    clock, R = time.process_time(), solution.mesh.boundaries[-1]
    t = np.linspace(0, R, 101)

    def rates(r, y):
        x = y[0]
        return np.stack([y[1], x - 3 * c * x**2 + 4 * d * x**3])

    guess = np.stack([solution(t)[0] * 1.05, solution.velocity(t)[0]])
    peer = solve_bvp(
        rates,
        lambda ya, yb: np.array([ya[1], yb[1] + (1 + 1 / R) * yb[0]]),
        t,
        guess,
        S=np.array([[0.0, 0.0], [0.0, -2.0]]),
        tol=TOL,
        max_nodes=20000,
    )
    S = _action(peer, lambda r, y: r**2 * y[1] ** 2 / 3)
    return [row, _peer(peer, S, solution.action, clock)]


def winding(k: int) -> list[Row]:
    """Return the rows of light from r = 20 to r = 20 around M = 1, by an angle up to 9.5."""
    angle = float(np.random.default_rng([SEED, 200, k]).uniform(3.2, 9.5))
    first = 1 / 20

    def swept(u0: float, weight=lambda u: 1.0) -> float:
        """Return 2 int weight du / sqrt(u0^2 (1 - 2 u0) - u^2 (1 - 2 u)), with u = u0 - s^2."""

        def integrand(s):
            u = u0 - s * s
            # The difference of the two cubics over u0 - u = s^2.
            return 2 * weight(u) / np.sqrt((u0 + u) - 2 * (u0**2 + u0 * u + u**2))

        return 2 * quad(integrand, 0, np.sqrt(u0 - first), epsabs=0, epsrel=1e-12, limit=400)[0]

    u0: Any = brentq(lambda u: swept(u) - angle, first * 1.0001, 1 / 3 - 1e-9, xtol=1e-15)
    b = 1 / np.sqrt(u0**2 * (1 - 2 * u0))
    T = swept(u0, lambda u: 1 / (b * u**2 * (1 - 2 * u)))
    problem = ao.Problem(systems()["winding"], ao.Event(0, [20, 0]), ao.Event(1, [20, angle]))
    row, solution = _mine(problem, None)
    row["error"] = abs(solution.length - T) / T
    clock = time.process_time()
    phi = np.linspace(0, angle, 101)
    y = np.stack(
        [
            first + 0.2 * np.sin(np.pi * phi / angle),
            0.2 * np.pi / angle * np.cos(np.pi * phi / angle),
        ]
    )
    found = solve_bvp(
        lambda phi, y: np.stack([y[1], 3 * y[0] ** 2 - y[0]]),
        lambda ya, yb: np.array([ya[0] - first, yb[0] - first]),
        phi,
        y,
        tol=TOL,
        max_nodes=20000,
    )

    def rate(phi, y):
        u, f = y[0], 1 - 2 * y[0]
        return np.sqrt((y[1] / (u**2 * f)) ** 2 + 1 / (u**2 * f))

    return [row, _peer(found, _action(found, rate), T, clock)]


def _mine(problem: ao.Problem, guess: ao.Solution | None) -> tuple[Row, ao.Solution]:
    clock = time.process_time()
    solution = ao.solve(problem, guess=guess, tol=TOL, throw=False)
    return answer(solution, time.process_time() - clock), solution


def _action(found, rate) -> float:
    """Return the integral of rate(t, y) along what `solve_bvp` found."""
    xi, w = np.polynomial.legendre.leggauss(6)
    h = np.diff(found.x)[:, None] / 2
    t = found.x[:-1, None] + h * (1 + xi)
    with np.errstate(all="ignore"):
        values = rate(t.ravel(), found.sol(t.ravel())).reshape(t.shape)
    return float(np.sum(h * w * values))


def _peer(found, value: float, known: float, clock: float) -> Row:
    """Return the row of scipy's, its action beside the one that is known."""
    return {
        "solver": "solve_bvp",
        "status": "SOLVED" if found.success else found.message.split(".")[0].lower(),
        "success": bool(found.success),
        "error": abs(value - known) / abs(known),
        "time": time.process_time() - clock,
    }


KINDS = {"well": well, "bounce": bounce, "winding": winding}


def cases(quick: bool) -> list[Case]:
    """Return them."""
    return members(KINDS, COUNTS, quick)


def criteria(rows) -> list[Criterion]:
    """Return them."""
    found = [within(mine(rows, kind), WRONG, f"{kind}: true error") for kind in KINDS]
    bounces = mine(rows, "bounce")
    one = sum(r.get("index") == 1 for r in bounces)
    found.append(
        Criterion("bounces of index one", f"{len(bounces)}", f"{one}", one == len(bounces))
    )
    return [*found, beside(rows, "solve_bvp", WRONG, "right, from a guess")]
