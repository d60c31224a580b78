"""What tells one sweep from another, as plain data: the first line of the file that keeps it."""

from __future__ import annotations

import hashlib
import sys
from typing import Any

import casadi as ca

from actionopt.families.sweeps.grid import Grid, label_of
from actionopt.mechanics.question.problem import Problem

SWEEP_FORMAT = "actionopt sweep 5"


def question_of(grid: Grid, tol: float, index: bool, keep_paths: bool) -> dict[str, Any]:
    """Return what tells one sweep from another, as plain data."""
    version = sys.modules[__name__.partition(".")[0]].__version__
    problem, over = grid.problem, {}
    for name, row in zip(grid.names, grid.values, strict=True):
        digest = hashlib.sha256(row.tobytes()).hexdigest()[:12]
        over[label_of(name)] = f"{row.size} values from {row[0]:g} to {row[-1]:g} ({digest})"
    return {
        "format": SWEEP_FORMAT,
        "law": f"{problem.name} ({problem.system.digest[:12]})",
        "parameters": {name: x.tolist() for name, x in problem.parameters.items()},
        "start": [problem.start.t, problem.start.q],
        "end": [problem.end.t, problem.end.q],
        "advance": None if problem.advance is None else problem.advance.tolist(),
        "relabel": getattr(problem.end, "relabel", None),
        "energy": problem.energy,
        **({"on": _surfaces(problem)} if problem.on_surface or problem.through else {}),
        **({"through": [repr(e) for e in problem.through]} if problem.through else {}),
        **({} if problem.integral is None else {"integral": problem.integral}),
        "over": over,
        "zip": grid.zipped,
        "tol": tol,
        "record": ["index"] if index else [],
        "keep_paths": keep_paths,
        "made by": f"actionopt {version}, CasADi {ca.CasadiMeta.version()}",
    }


def _surfaces(problem: Problem) -> list[str | None]:
    """Return what tells the surfaces of events from others."""
    laws = [None if e.on is None else e.on.law.serialize() for e in problem.joints_found]
    return [law and hashlib.sha256(law.encode()).hexdigest()[:12] for law in laws]
