"""Write test problems to a directory: each in three formats, what is known of it, and one table.

What is there already stays: a second size or other parameters have files of their own, and the
manifest and the table have all of them. The same problems make the same bytes.
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
import zipfile
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np

from actionopt.suite import mof, nl, standalone
from actionopt.suite.member import Member
from actionopt.suite.problem import TestProblem
from actionopt.tools.files import whole, write

__all__ = ["archive", "dump", "file_name"]
SUITE_MANIFEST, OPTIMA_FILE = "manifest.json", "known_optima.csv"
COLUMNS = (
    "file name class kind unbounded_below elements degree parameters decades start n m "
    "f_star index_star f_lowest_known"
).split()
SIGN = "grad f + J' lam = 0, of f + lam' c; those of AMPL and of MathOptFormat are -lam"
EPOCH = (1980, 1, 1, 0, 0, 0)  # of all files in an archive: the first a zip can tell


def dump(
    problems: Iterable[Member],
    directory: str | Path,
    *,
    skipped: Callable[[Member, ValueError], None] | None = None,
) -> Path:
    """Write each problem as FILE.nl, .row, .col, .mof.json and .py, and what is known as FILE.json.

    Of models there are no .mof.json and .py, and of those without derivatives no .nl. And
    `manifest.json`, with each file's SHA-256, and `known_optima.csv`. Numbers are written so that
    they read back to the last bit. Return the manifest's path.

    A problem without an optimum is left out, and `skipped(problem, error)` called; without that the
    error is raised.
    """
    folder = Path(directory)
    folder.mkdir(parents=True, exist_ok=True)
    manifest = folder / SUITE_MANIFEST
    there = json.loads(manifest.read_text(encoding="utf-8")) if manifest.is_file() else []
    entries = {entry["file"]: entry for entry in there}
    for problem in problems:
        try:
            known = facts(problem)
        except ValueError as error:
            if skipped is None:
                raise
            skipped(problem, error)
            continue
        stem = file_name(problem)
        made = nl.write(problem, folder / f"{stem}.nl") if problem.smooth else []
        if isinstance(problem, TestProblem):
            made.append(mof.write(problem, folder / f"{stem}.mof.json"))
            made.append(standalone.write(problem, folder / f"{stem}.py"))
        made.append(folder / f"{stem}.json")
        write(made[-1], json.dumps(known, indent=1) + "\n")
        digests = {f.name: hashlib.sha256(f.read_bytes()).hexdigest() for f in made}
        optima = {name: known[name] for name in COLUMNS if name in known}
        entries[stem] = {**summary(problem), **optima, "files": digests}
    ordered = [entries[stem] for stem in sorted(entries)]
    write(manifest, json.dumps(ordered, indent=1) + "\n")
    write(folder / OPTIMA_FILE, _table(ordered))
    return manifest


def file_name(problem: Member) -> str:
    """Return the problem's name, with the mesh and parameters if they are not the family's own."""
    parts, settings = [problem.name], dict(sorted(problem.parameters.items()))
    if isinstance(problem, TestProblem):
        family, degree = problem.family, max(problem.mesh.degrees)
        if (problem.mesh.elements, degree) != (family.elements, family.degree):
            parts.append(f"{problem.mesh.elements}x{degree}")
        if problem.decades != family.decades:
            settings["decades"] = problem.decades
    return "-".join([*parts, *(f"{name}={_short(value)}" for name, value in settings.items())])


def _short(value: Any) -> str:
    return f"{value:.17g}" if isinstance(value, float) else str(value)


def _table(entries: Iterable[dict[str, Any]]) -> str:
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(COLUMNS)
    for entry in entries:
        cells = (entry.get(name) for name in COLUMNS)
        rows.writerow([json.dumps(c) if isinstance(c, (dict, float, bool)) else c for c in cells])
    return text.getvalue()


def archive(directory: str | Path, file: str | Path) -> Path:
    """Pack what `dump` wrote into a zip file; the same files make the same bytes."""
    folder = Path(directory)
    entries = json.loads((folder / SUITE_MANIFEST).read_text(encoding="utf-8"))
    names = sorted(
        {SUITE_MANIFEST, OPTIMA_FILE, *(name for entry in entries for name in entry["files"])}
    )
    with whole(file) as part, zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as pack:
        for name in names:
            about = zipfile.ZipInfo(name, EPOCH)
            about.compress_type = zipfile.ZIP_DEFLATED
            about.create_system = 3  # whatever the system
            about.external_attr = 0o644 << 16
            pack.writestr(about, (folder / name).read_bytes(), compresslevel=9)
    return Path(file)


def summary(problem: Member) -> dict[str, Any]:
    """Return name, class and sizes."""
    return {
        "file": file_name(problem),
        "name": problem.name,
        "class": problem.classification,
        "kind": problem.kind,
        "unbounded_below": problem.unbounded,
        "parameters": dict(problem.parameters),
        "start": problem.default_start,
        "tags": list(problem.tags),
        **problem.resolution,
        "n": problem.n,
        "m": problem.m,
        "nnz_jacobian": problem.nnz_jacobian,
        "nnz_hessian": problem.nnz_hessian,
        "sign_of_multipliers": SIGN,
        **problem.origin,
    }


def facts(problem: Member) -> dict[str, Any]:
    """Return what is known of a problem, as plain data; None of a bound that there is not."""
    bounds = zip(
        ("x_lower", "x_upper", "c_lower", "c_upper"),
        (*problem.bounds, *problem.constraint_bounds),
        strict=True,
    )
    lowest, continuous = problem.lowest, {}
    if isinstance(problem, TestProblem):
        continuous["continuous_action"] = problem.continuous.action
    return {
        **summary(problem),
        "variables": problem.variable_names,
        "constraints": problem.constraint_names,
        **{name: [v if np.isfinite(v) else None for v in side.tolist()] for name, side in bounds},
        "starts": {name: problem.start(name).tolist() for name in problem.start_names},
        "x_star": problem.x_star.tolist(),
        "lam_star": problem.lam_star.tolist(),
        "f_star": problem.f_star,
        "index_star": problem.index_star,
        "f_lowest_known": lowest if np.isfinite(lowest) else None,
        "other_stationary_points": [
            {"x": s.x.tolist(), "f": s.f, "index": s.index, "kind": s.kind} for s in problem.others
        ],
        **continuous,
        "known_by": problem.known_by,
    }
