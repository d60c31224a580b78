"""Near collisions: the figure-eight without a guess, and Kepler arcs through perihelion."""

from __future__ import annotations

import numpy as np

from actionopt import Event, Problem, scenes
from benchmarks.problems.plane import past_perihelion
from benchmarks.stress.case import Case, Criterion, Question, every, mine, within
from benchmarks.stress.forward import motion

TITLE = "Bodies"
ECCENTRICITIES = (0.6, 0.95, 0.99)
ANOMALY = 150.0  # degrees
HORIZON = 2.0  # of the figure-eight's period of 6.3259


def figure_eight() -> Question:
    """Return the figure-eight over two time units, its end from the published start."""
    scene = scenes.get("figure_eight")
    system, start = scene.problem.system, scene.facts["start"]
    exact = motion(system.acceleration, start.q, start.v, HORIZON, 3e-14)
    problem = Problem(system, Event(0.0, start.q), Event(HORIZON, exact(HORIZON)))
    return Question(problem, exact)


def perihelion(e: float, guided: bool = True) -> Question:
    """Return the arc from -150 to 150 degrees of true anomaly, with a guess of three points."""
    half = past_perihelion(e, ANOMALY)  # of the arc, in periods
    scene = scenes.get("kepler", eccentricity=e, start=-half, fraction=2 * half)
    if not guided:
        return Question(scene.problem)
    assert scene.exact is not None
    three = np.linspace(scene.problem.start.t, scene.problem.end.t, 3)
    return Question(scene.problem, scene.exact, scene.exact(three))


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
        within(mine(rows, "figure"), 1e-9, "figure-eight, no guess"),
        within(arcs, 1e-9, "Kepler through perihelion"),
        Criterion(
            "growth of unknowns, e = 0.6 to 0.99",
            f"<= {allowed:.1f}, that of log(1 / (1 - e))",
            f"{growth:.2f} ({', '.join(map(str, count))})",
            growth <= allowed,
        ),
        every("no guess: any path", found, len(free)),
    ]
