"""Near collisions: the figure-eight without a guess, and Kepler arcs through perihelion."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

from actionopt import Event, Problem, scenes
from benchmarks.stress.case import Case, Criterion, Question, mine, within

TITLE = "Bodies"
ECCENTRICITIES = (0.6, 0.95, 0.99)
ANOMALY = np.radians(150.0)
HORIZON = 2.0  # of the figure-eight's period of 6.3259


def figure_eight() -> Question:
    """Return the figure-eight over two time units, its end from the published start."""
    scene = scenes.get("figure_eight")
    system, start = scene.problem.system, scene.facts["start"]

    def flow(t, y):
        return np.concatenate([y[6:], system.acceleration(y[:6], y[6:], t)])

    first = np.concatenate([start.q, start.v])
    run = solve_ivp(flow, (0, HORIZON), first, "DOP853", rtol=3e-14, atol=1e-14, dense_output=True)
    problem = Problem(system, Event(0.0, start.q), Event(HORIZON, run.y[:6, -1]))
    return Question(problem, lambda t: run.sol(t)[:6])


def perihelion(e: float, guided: bool = True) -> Question:
    """Return the arc from -150 to 150 degrees of true anomaly, with a guess of three points."""
    E = 2 * np.arctan(np.sqrt((1 - e) / (1 + e)) * np.tan(ANOMALY / 2))
    half = (E - e * np.sin(E)) / (2 * np.pi)  # of the arc, in periods: Kepler's equation
    scene = scenes.get("kepler", eccentricity=e, start=-half, fraction=2 * half)
    if not guided:
        return Question(scene.problem)
    return Question(scene.problem, scene.exact, scene.exact(_three(scene.problem)))


def _three(problem: Problem) -> np.ndarray:
    return np.linspace(problem.start.t, problem.end.t, 3)


def cases(quick: bool) -> list[Case]:
    """Return them."""
    arcs = [Case(f"Kepler, e = {e}", lambda e=e: perihelion(e)) for e in ECCENTRICITIES]
    unguided = [
        Case(f"unguided Kepler, e = {e}", lambda e=e: perihelion(e, False), peers=False)
        for e in ECCENTRICITIES
    ]
    return [Case("figure-eight", figure_eight), *arcs, *unguided]


def criteria(rows) -> list[Criterion]:
    """Return them."""
    arcs = mine(rows, "Kepler")
    count = [r["unknowns"] for r in arcs]
    growth = count[-1] / count[0]
    allowed = np.log(1 - ECCENTRICITIES[-1]) / np.log(1 - ECCENTRICITIES[0])
    free = mine(rows, "unguided")
    found = sum(r["success"] for r in free)
    return [
        Criterion("figure-eight, no guess", *_rest(within(mine(rows, "figure"), 1e-9))),
        Criterion("Kepler through perihelion", *_rest(within(arcs, 1e-9))),
        Criterion(
            "growth of unknowns, e = 0.6 to 0.99",
            f"<= {allowed:.1f}, that of log(1 / (1 - e))",
            f"{growth:.2f} ({', '.join(map(str, count))})",
            growth <= allowed,
        ),
        Criterion("no guess: any path", f"{len(free)}", f"{found}", found == len(free)),
    ]


def _rest(c: Criterion):
    return c.expected, c.found, c.met
