"""The same inputs give the same bits: twice in one process, and in two more."""

from __future__ import annotations

import hashlib

from benchmarks.child import run
from benchmarks.stress.case import Case, Criterion, digest, every, measured, mine, timed
from benchmarks.stress.families import bodies, pendulums

TITLE = "Repeats"
QUESTIONS = ("pendulum", "figure-eight", "Kepler")


def question(name: str):
    """Return one of them."""
    if name == "pendulum":
        return pendulums.question(*pendulums.starts()[3], 4.0)
    return bodies.figure_eight() if name == "figure-eight" else bodies.perihelion(0.95)


def fingerprint(name: str) -> str:
    """Solve it and return a fingerprint of all numbers of the answer."""
    asked = question(name)
    solution, _ = timed(asked.problem, asked.tol, guess=asked.guess)
    return hashlib.sha256(digest(solution)).hexdigest()


def measure(name: str) -> list[dict]:
    """Return one row: how many different fingerprints there are."""
    apart = [run(f"{__name__}:fingerprint", name)[0] for _ in range(2)]
    found = [fingerprint(name), fingerprint(name), *apart]
    return [{"status": "SOLVED", "success": True, "different": len(set(found)), "time": None}]


def cases(quick: bool) -> list[Case]:
    """Return them."""
    return [measured(name, measure, name) for name in QUESTIONS]


def criteria(rows) -> list[Criterion]:
    """Return them."""
    own = mine(rows)
    same = sum(r["different"] == 1 for r in own)
    return [every("the same bits twice here and in two fresh processes", same, len(own))]
