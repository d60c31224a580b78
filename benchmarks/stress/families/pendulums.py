"""Random double pendulums: the ends of forward motions, and no guess.

Angles uniform in +-2 rad, angular velocities N(0, 2^2) rad/s, m = l = 1, g = 9.81 m/s^2. The
motion is chaotic, and there are many paths between two ends: any motion is an answer.
"""

from __future__ import annotations

import numpy as np

from actionopt import Event, Problem, scenes
from benchmarks.stress.case import Case, Criterion, Question, mine, solved
from benchmarks.stress.forward import miss, motion

TITLE = "Random double pendulums"
DURATIONS = (0.5, 1.0, 2.0, 4.0, 8.0)  # s
COUNT, COMPARED = 100, 20
SEED = 7
NEEDED = {0.5: 100, 1.0: 100, 2.0: 100, 4.0: 100, 8.0: 95}
MOTION = 1e-5  # an element's end is missed by less if the path is a motion; tol is 1e-8


def starts(count: int = COUNT) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return angles and angular velocities at the start."""
    rng = np.random.default_rng(SEED)
    return [(rng.uniform(-2, 2, 2), rng.normal(0, 2, 2)) for _ in range(count)]


def question(q0, v0, T: float) -> Question:
    """Return the question whose ends one motion meets."""
    system = scenes.get("double_pendulum").problem.system  # m = l = 1, g = 9.81
    end = motion(system.acceleration, q0, v0, T, 1e-10)(T)
    return Question(Problem(system, Event(0.0, q0), Event(T, end)), tol=1e-8)


def cases(quick: bool) -> list[Case]:
    """Return them, by duration."""
    count = COUNT // 10 if quick else COUNT
    return [
        Case(
            f"T = {T:g}, {k}",
            lambda q=q, v=v, T=T: question(q, v, T),
            lambda solution: {"miss": miss(solution) if solution.success else None},
            peers=k < (3 if quick else COMPARED),
        )
        for T in DURATIONS
        for k, (q, v) in enumerate(starts(count))
    ]


def criteria(rows) -> list[Criterion]:
    """Return one criterion a duration."""
    out = []
    for T in DURATIONS:
        prefix = f"T = {T:g},"
        own = mine(rows, prefix)
        good = sum(bool(r["success"]) and r["miss"] <= MOTION for r in own)
        need = -(-NEEDED[T] * len(own) // COUNT)
        both = [r for r in rows if r["case"].startswith(prefix)]
        asked = sum(r["solver"] == "solve_bvp" for r in both)
        peers = ", ".join(f"{p} {len(solved(both, p))}" for p in ("solve_bvp", "shooting"))
        out.append(
            Criterion(
                f"T = {T:g} s: a path found, verified forward",
                f">= {need} of {len(own)}",
                f"{good} of {len(own)}; of {asked}: {peers}",
                good >= need,
            )
        )
    return out
