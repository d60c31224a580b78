"""The same problems in units from 1e-12 to 1e12: nothing but the numbers may change."""

from __future__ import annotations

from functools import cache

import numpy as np

from actionopt import Event, Problem, System, scenes
from benchmarks.stress.case import Case, Criterion, Question, mine

TITLE = "Units"
UNITS = (  # of length, time and mass
    (1.0, 1.0, 1.0),
    (1e-12, 1e-12, 1e-12),
    (1e12, 1e12, 1e12),
    (1e-12, 1e12, 1.0),
    (1e12, 1e-12, 1.0),
    (1e-10, 1e-15, 1e-27),
    (1e12, 1e7, 1e24),
)


@cache
def well() -> System:
    """Return a double well, a saddle point of the potential between the ends."""
    return System(
        lambda q, v, t, *, m, k, a: m * v[0] ** 2 / 2 + k * q[0] ** 2 / 2 - a * q[0] ** 4 / 4,
        ["x"],
        parameters={"m": 1.0, "k": 1.0, "a": 1.0},
        name="well",
    )


def in_well(L: float, T: float, M: float) -> Question:
    """Return the crossing of the well in these units."""
    ends = Event(0.0, [0.5 * L]), Event(2 * T, [1.2 * L])
    return Question(
        Problem(well(), *ends, parameters={"m": M, "k": M / T**2, "a": M / T**2 / L**2})
    )


def on_rod(L: float, T: float, M: float) -> Question:
    """Return a swing of the pendulum in these units."""
    a, b = ([L * np.sin(x), -L * np.cos(x)] for x in (0.5, -0.9))
    system = scenes.get("rod_pendulum").problem.system
    parameters = {"m": M, "g": 9.81 * L / T**2, "l": L}
    ends = Event(0.0, a), Event(0.8 * T, b)
    return Question(Problem(system, *ends, parameters=parameters))


def cases(quick: bool) -> list[Case]:
    """Return them."""
    return [
        Case(
            f"{name} in {L:g}, {T:g}, {M:g}",
            lambda build=build, L=L, T=T, M=M: build(L, T, M),
            lambda solution: {"detail": solution.stats["iterations"]},
            peers=False,
        )
        for name, build in (("well", in_well), ("rod", on_rod))
        for L, T, M in UNITS
    ]


def criteria(rows) -> list[Criterion]:
    """Return them."""
    out = []
    for name in ("well", "rod"):
        own = mine(rows, name)
        kinds = {str((r["status"], r["unknowns"], sorted(r["detail"].items()))) for r in own}
        good = sum(r["success"] for r in own)
        found = f"{good} solved, in {len(kinds)} way{'s' if len(kinds) > 1 else ''}"
        alike = good == len(own) and len(kinds) == 1
        what = f"{name}: one iteration count in all units"
        out.append(Criterion(what, f"{len(own)} solved alike", found, alike))
    return out
