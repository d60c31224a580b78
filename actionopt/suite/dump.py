"""Write test problems to a directory: `.nl`, what is known of each, and a manifest."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from actionopt.suite import nl
from actionopt.suite.problem import TestProblem
from actionopt.tools.files import write


def dump(problems: Iterable[TestProblem], directory: str | Path) -> Path:
    """Write NAME.nl and NAME.json for each problem, and manifest.json; return its path.

    Numbers are written so that they read back to the last bit. The manifest has each file's
    SHA-256.
    """
    folder = Path(directory)
    folder.mkdir(parents=True, exist_ok=True)
    entries = []
    for problem in problems:
        model, answers = folder / f"{problem.name}.nl", folder / f"{problem.name}.json"
        nl.write(problem, model)
        write(answers, json.dumps(facts(problem), indent=1) + "\n")
        entries.append(
            {
                **summary(problem),
                "files": {
                    f.name: hashlib.sha256(f.read_bytes()).hexdigest() for f in (model, answers)
                },
            }
        )
    manifest = folder / "manifest.json"
    write(manifest, json.dumps(entries, indent=1) + "\n")
    return manifest


def summary(problem: TestProblem) -> dict[str, Any]:
    """Return name, class and sizes."""
    return {
        "name": problem.name,
        "class": problem.classification,
        "kind": problem.kind,
        "unbounded_below": problem.unbounded,
        "decades": problem.decades,
        "parameters": problem.parameters,
        "start": problem.default_start,
        "tags": list(problem.tags),
        "elements": problem.mesh.elements,
        "degree": max(problem.mesh.degrees),
        "n": problem.n,
        "m": problem.m,
        "nnz_jacobian": problem.nnz_jacobian,
        "nnz_hessian": problem.nnz_hessian,
        "source": problem.scene.source,
    }


def facts(problem: TestProblem) -> dict[str, Any]:
    """Return what is known of a problem, as plain data."""
    return {
        **summary(problem),
        "starts": {name: problem.start(name).tolist() for name in problem.start_names},
        "x_star": problem.x_star.tolist(),
        "sign_of_multipliers": "grad f + J' lam = 0",
        "lam_star": problem.lam_star.tolist(),
        "f_star": problem.f_star,
        "index_star": problem.index_star,
        "f_lowest_known": problem.lowest if np.isfinite(problem.lowest) else None,
        "other_stationary_points": [
            {"x": s.x.tolist(), "f": s.f, "index": s.index, "kind": s.kind} for s in problem.others
        ],
        "continuous_action": problem.continuous.action,
        "known_by": problem.known_by,
    }
