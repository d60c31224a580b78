"""Many constraints, and one too many.

A hanging chain in Cartesian coordinates, every link a constraint, and a parallelogram linkage:
a coupler on two parallel cranks of equal length. A third crank parallel to them, halfway, says
nothing new: its row is linearly dependent on the others wherever the linkage can go.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from actionopt import Event, Problem, System, scenes
from actionopt.scenes.chain import positions
from benchmarks import child
from benchmarks.stress.case import Case, Criterion, Question, mine, ours
from benchmarks.stress.families._hanging import release
from benchmarks.stress.forward import miss

TITLE = "Constraints"
LINKS = (10, 100)
CRANK, BASE = 0.5, 1.0  # m
MOTION = 1e-5


@cache
def linkage(redundant: bool) -> System:
    """Return the four-bar loop: joints (x1, y1) and (x2, y2), pivots at 0 and (BASE, 0)."""

    def lagrangian(q, v, t):
        return v @ v / 2 - 9.81 * (q[1] + q[3])

    def loop(q, t):
        x, y, u, w = q
        rows = [
            x**2 + y**2 - CRANK**2,
            (u - x) ** 2 + (w - y) ** 2 - BASE**2,
            (u - BASE) ** 2 + w**2 - CRANK**2,
        ]
        third = ((x + u - BASE) / 2) ** 2 + ((y + w) / 2) ** 2 - CRANK**2
        return rows + [third] if redundant else rows

    return System(lagrangian, ["x1", "y1", "x2", "y2"], constraint=loop, name="four-bar")


def four_bar(redundant: bool) -> Question:
    """Return the swing of the cranks from 0.6 to -0.4 rad from straight down, in 0.5 s."""

    def at(angle):
        x, y = CRANK * np.sin(angle), -CRANK * np.cos(angle)
        return [x, y, x + BASE, y]

    return Question(Problem(linkage(redundant), Event(0.0, at(0.6)), Event(0.5, at(-0.4))))


def chain(links: int) -> Question:
    """Return a hanging chain, released and followed while it falls; no guess."""
    first, last, T = release(links)
    system = scenes.get("chain", links=links).problem.system
    ends = (Event(t, positions(1 / links, a)) for t, a in ((0.0, first), (T, last)))
    return Question(Problem(system, *ends, parameters={"l": 1 / links}), tol=1e-6)


def drift(solution) -> dict:
    """Return how well the path keeps to the constraints, and to the equations of motion."""
    problem = solution.problem
    t = np.linspace(problem.start.t, problem.end.t, 201)
    f = problem.system.constraint(solution(t), t, parameters=problem.parameters)
    return {
        "violation": float(np.max(np.abs(f))),
        "miss": miss(solution) if solution.success else None,
    }


def swing(links: int) -> dict:
    """Solve a chain in this process; its row."""
    return ours(chain(links), drift)


def cases(quick: bool) -> list[Case]:
    """Return them."""
    links = LINKS[:1] if quick else LINKS
    return [
        *(
            Case(f"chain of {n} links", measure=lambda n=n: [child.row(f"{__name__}:swing", n)])
            for n in links
        ),
        Case("four-bar loop", lambda: four_bar(False), drift),
        Case("four-bar loop, redundant by one row", lambda: four_bar(True)),
    ]


def criteria(rows) -> list[Criterion]:
    """Return them."""
    *regular, redundant = mine(rows)
    out = [
        Criterion(
            row["case"],
            f"a path, each element verified forward to {MOTION:.0e}",
            f"{row['status']}, missed by {row.get('miss') or np.inf:.0e}, {row['time']:.1f} s",
            bool(row.get("success") and row["miss"] <= MOTION),
        )
        for row in regular
    ]
    said = redundant["status"] == "refused" and "remove one of rows" in redundant["said"]
    return [
        *out,
        Criterion(
            redundant["case"],
            "refused, naming the rows",
            redundant.get("said", redundant["status"]).split(" (")[0],
            said,
        ),
    ]
