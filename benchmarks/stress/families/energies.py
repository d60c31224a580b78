"""The energy is given, and how long it takes is to be found, with random numbers.

Throws in the plane, low and high; pendulums over the top, by elliptic integrals; ways between two
points of a Kepler ellipse of eccentricity up to 0.99, by Lagrange's theorem; closed orbits in
random quartic wells, by a quadrature; and the radial motion of Kepler ellipses, followed from one
of eccentricity 0.1, by Kepler's third law. Beside them scipy's `solve_bvp` from the same first
path, in the time over its duration, which is an unknown parameter; along the ellipses in 24 steps.
"""

from __future__ import annotations

import time
from contextlib import suppress
from functools import cache

import numpy as np
from scipy.integrate import quad, solve_bvp
from scipy.special import ellipkinc

import actionopt as ao
from actionopt.solver.kinds.first_paths import straight, time_waypoints
from benchmarks.stress.case import Case, Criterion, Row, answer, beside, members, mine, within

TITLE = "Given energies"
TOL, WRONG = 1e-9, 1e-8
COUNTS = {
    "throw": (40, 2),
    "over": (40, 2),
    "transfer": (40, 2),
    "well": (40, 2),
    "ellipse": (10, 1),
}
ROUND, STEPS = 0.1, 24  # the first eccentricity, and continuation by hand
LIMIT = 10.0  # seconds of that
SAMPLES = 101  # of a first path, given to scipy
SEED = 29


@cache
def systems() -> dict[str, ao.System]:
    """Return them, derived once."""

    def well(q, v, t, *, b, c):
        x = q[0]
        return v[0] ** 2 / 2 - x**2 / 2 - b * x**3 / 3 - c * x**4 / 4

    def radial(q, v, t, *, J):
        return v[0] ** 2 / 2 - J**2 / (2 * q[0] ** 2) + 1 / q[0]

    return {
        "throw": ao.System(lambda q, v, t: v @ v / 2 - q[1], ["x", "y"]),
        "over": ao.System(lambda q, v, t: v[0] ** 2 / 2 + np.cos(q[0]), ["phi"]),
        "transfer": ao.System(lambda q, v, t: v @ v / 2 + 1 / np.sqrt(q @ q), ["x", "y"]),
        "well": ao.System(well, ["x"], parameters={"b": 0.0, "c": 1.0}),
        "ellipse": ao.System(radial, ["r"], parameters={"J": 1.0}),
    }


def throw(k: int) -> list[Row]:
    """Return the rows of the low and the high throw to a random place, g = 1."""
    rng = np.random.default_rng([SEED, k])
    x, y = rng.uniform(0.2, 2), rng.uniform(-1, 1)
    E = (np.hypot(x, y) + y) / 2 * (1 + 10 ** rng.uniform(-3, 1))  # over what is needed
    # (g T^2 / 2)^2 + (g y - 2 E) T^2 / g + d^2 = 0, for T^2
    root = np.sqrt((2 * E - y) ** 2 - x * x - y * y)
    known = np.sqrt(2 * (2 * E - y + np.array([-root, root])))
    problem = _asked("throw", [0, 0], [x, y], E)
    clock = time.process_time()
    paths = ao.solve_all(problem, tol=TOL)
    spent = time.process_time() - clock
    found = np.sort([path.duration for path in paths])
    both = found.size == 2
    error = float(np.max(np.abs(found / known - 1))) if both else None
    status = f"{found.size} paths"
    row = {"solver": "actionopt", "status": status, "success": both, "error": error, "time": spent}
    return [row, _between(problem, known)]


def over(k: int) -> list[Row]:
    """Return the rows of a pendulum between two angles, its energy above that of the top."""
    rng = np.random.default_rng([SEED, 100, k])
    a, b = rng.uniform(-3, 0), rng.uniform(0.5, 9)
    m = 2 / (2 + 10 ** rng.uniform(-5, 1))
    T = (ellipkinc(b / 2, m) - ellipkinc(a / 2, m)) * np.sqrt(m)
    problem = _asked("over", [a], [b], 2 / m - 1)
    return [_mine(problem, T), _between(problem, T)]


def transfer(k: int) -> list[Row]:
    """Return the rows of the ways between two points of an ellipse, of unit energy -1 / 2."""
    rng = np.random.default_rng([SEED, 200, k])
    e = 1 - 10 ** rng.uniform(-2, -0.3)
    u0, u1 = np.sort(rng.uniform(0, 2 * np.pi, 2))  # eccentric anomalies
    places = [np.array([np.cos(u) - e, np.sqrt(1 - e * e) * np.sin(u)]) for u in (u0, u1)]
    r0, r1 = (np.hypot(*q) for q in places)
    chord = np.hypot(*(places[1] - places[0]))
    alpha = 2 * np.arcsin(np.sqrt((r0 + r1 + chord) / 4))
    beta = 2 * np.arcsin(np.sqrt(max((r0 + r1 - chord) / 4, 0)))
    ways = [(x, y) for x in (alpha, 2 * np.pi - alpha) for y in (beta, -beta)]
    known = np.array([x - np.sin(x) - y + np.sin(y) for x, y in ways])
    problem = _asked("transfer", places[0], places[1], -0.5)
    return [_mine(problem, known), _between(problem, known)]


def well(k: int) -> list[Row]:
    """Return the rows of a closed orbit in V = x^2 / 2 + b x^3 / 3 + c x^4 / 4, one well."""
    rng = np.random.default_rng([SEED, 300, k])
    c = rng.uniform(0.2, 2)
    b = rng.uniform(-1, 1) * 1.9 * np.sqrt(c)  # V' has one zero: b^2 < 4 c
    E = 10 ** rng.uniform(-1, 2)
    return _closed("well", {"b": b, "c": c}, E, np.array([c / 4, b / 3, 0.5, 0, -E]))


def ellipse(k: int) -> list[Row]:
    """Return the rows of r(t) along a Kepler ellipse with a = 1, followed from a rounder one."""
    e = 1 - 10 ** np.random.default_rng([SEED, 400, k]).uniform(-2, -0.3)
    known, J2 = 2 * np.pi, 1 - e * e
    a = J2 / (1 - ROUND**2)  # of the ellipse of the same angular momentum
    problem = _orbit("ellipse", {"J": np.sqrt(J2)}, -0.5 / a)
    first = _cosine(a, a * ROUND, 2 * np.pi * a**1.5)
    clock = time.process_time()
    family = ao.trace(problem, "energy", -0.5, guess=first, tol=TOL)
    row = _row(family.solution(-1), known, clock)
    row["success"] &= bool(family.values[-1] == -0.5)
    clock, theirs, found = time.process_time(), {}, first
    for part in np.linspace(0, 1, STEPS + 1):
        e_k = 1 - (1 - ROUND) ** (1 - part) * (1 - e) ** part
        asked = problem.replace(energy=(e_k**2 - 1) / 2 / J2)
        theirs, found = _peer(asked, found, known)
        if time.process_time() - clock > LIMIT and part < 1:
            theirs.update(status="out of time", success=False, error=None)
            break
        if found is None:
            break
    return [row, theirs | {"time": time.process_time() - clock}]


def _closed(kind: str, parameters: dict, E: float, excess: np.ndarray) -> list[Row]:
    """Return the rows of a closed orbit where the polynomial V - E is negative."""
    roots = np.roots(excess)
    low, high = np.sort(roots[np.abs(roots.imag) < 1e-9].real)
    rest = np.polydiv(excess, np.poly([low, high]))[0]
    middle, size = (low + high) / 2, (high - low) / 2

    def rate(angle):  # dt / d angle, with x = middle - size cos(angle)
        return 1 / np.sqrt(2 * np.polyval(rest, middle - size * np.cos(angle)))

    T = 2 * quad(rate, 0, np.pi, epsabs=0, epsrel=1e-13)[0]
    first = _cosine(middle, size, 2 * np.pi * rate(np.pi / 2))  # of the speed half way
    problem = _orbit(kind, parameters, E)
    return [_mine(problem, T, first), _peer(problem, first, T)[0]]


def _cosine(middle: float, size: float, T: float) -> ao.Path:
    wave = lambda t: middle - size * np.cos(2 * np.pi * t[None] / T)  # noqa: E731
    return ao.Path.interpolate(wave, ao.Mesh.uniform(0.0, T, 4, 12))


def _orbit(kind: str, parameters: dict, E: float) -> ao.Problem:
    start, end = ao.Event(0.0, [None]), ao.Periodic(None)
    return ao.Problem(systems()[kind], start, end, parameters=parameters, energy=E)


def _asked(kind: str, start, end, E: float) -> ao.Problem:
    return ao.Problem(systems()[kind], ao.Event(0.0, start), ao.Event(None, end), energy=E)


def _between(problem: ao.Problem, known) -> Row:
    """Return scipy's row from the straight line, passed at the speed that the energy gives."""
    return _peer(problem, time_waypoints(problem, straight(problem).T), known)[0]


def _mine(problem: ao.Problem, known, guess: ao.Path | None = None) -> Row:
    clock = time.process_time()
    return _row(ao.solve(problem, guess=guess, tol=TOL, throw=False), known, clock)


def _row(solution: ao.Solution, known, clock: float) -> Row:
    error = float(np.min(np.abs(solution.duration / known - 1)))
    return answer(solution, time.process_time() - clock, error)


def _peer(problem: ao.Problem, first: ao.Path, known) -> tuple[Row, ao.Path | None]:
    """Return scipy's row, and its path: y = (q, v) over s = t / T, with T unknown, and one energy.

    A closed orbit of one coordinate begins and ends where it turns.
    """
    clock = time.process_time()
    system, values, n = problem.system, problem.parameters, problem.system.n
    s, found = np.linspace(0, 1, SAMPLES), None

    def rates(s, y, p):
        a = system.acceleration(y[:n], y[n:], 0 * s, parameters=values)
        return p[0] * np.concatenate([y[n:], a])

    def conditions(a, b, p):
        off = system.energy(a[:n], a[n:], 0.0, parameters=values) - problem.energy
        if problem.closes:
            return np.array([a[1], b[1], off])
        return np.concatenate([a[:n] - problem.start.q, b[:n] - problem.end.q, [off]])

    T = first.mesh.duration
    t = first.mesh.boundaries[0] + s * T
    with np.errstate(all="ignore"), suppress(ValueError, np.linalg.LinAlgError):
        y = np.concatenate([first(t), first.velocity(t)])
        found = solve_bvp(rates, conditions, s, y, p=[T], tol=TOL, max_nodes=20000)
    row: Row = {"solver": "solve_bvp", "time": time.process_time() - clock}
    if found is None or not found.success:
        said = "not a number on the way" if found is None else found.message.split(".")[0].lower()
        return row | {"status": said, "success": False, "error": None}, None
    T = found.p[0]
    mesh = ao.Mesh.uniform(0.0, abs(T), 32, 12)
    path = ao.Path.interpolate(lambda t: found.sol(t / abs(T))[:n], mesh)
    error = float(np.min(np.abs(T / known - 1)))
    return row | {"status": "SOLVED", "success": True, "error": error}, path


KINDS = {"throw": throw, "over": over, "transfer": transfer, "well": well, "ellipse": ellipse}


def cases(quick: bool) -> list[Case]:
    """Return them."""
    return members(KINDS, COUNTS, quick)


def of_kind(rows, kind: str) -> list[Criterion]:
    """Return the criteria of one kind: ours, and how scipy fared."""
    own = [r for r in rows if r["case"].startswith(kind)]
    return [
        within(mine(own), WRONG, f"{kind}: true error of the duration"),
        beside(own, "solve_bvp", WRONG, f"{kind} right"),
    ]


def criteria(rows) -> list[Criterion]:
    """Return them."""
    return [criterion for kind in KINDS for criterion in of_kind(rows, kind)]
