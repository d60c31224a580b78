"""From rows to a table of criteria, a table of solvers and one of cases."""

from __future__ import annotations

from collections import Counter

import numpy as np

from benchmarks.results import table
from benchmarks.stress.families import FAMILIES

MANY = 20  # cases of a family above which they are not listed one by one
COUNTS = ("unknowns", "iterations", "rounds")
SENTENCE = 60  # characters of what a solver said


def told(name: str, rows: list[dict]) -> str:
    """Return the criteria and how the solvers fared, for the terminal."""
    lines = ["", FAMILIES[name].TITLE]
    for c in FAMILIES[name].criteria(rows):
        lines.append(f"  {'met    ' if c.met else 'NOT MET'} {c.what}: {c.expected} | {c.found}")
    lines += [
        f"  {solver:10} {solved} of {count}, median {median}, longest {longest}; {how}"
        for solver, count, solved, median, longest, how in _solvers(rows)
    ]
    return "\n".join(lines)


def page(families: dict, before: dict) -> str:
    """Return the whole page; `before` has the families as they once were, some of them."""
    known = [name for name in FAMILIES if name in families]
    earlier = {
        (name, c.what, c.expected): c.found
        for name, (_, rows) in before.items()
        for c in FAMILIES[name].criteria(rows)
    }
    lines = [
        "# Hard problems, and what came of them",
        "",
        "Made by `python -m benchmarks.stress`; all rows are in `stress.json`. scipy's",
        "`solve_bvp` and shooting (DOP853 and Powell's method) start from the same first path,",
        "with the same accelerations, and have 3 s for each case; they difference for Jacobians,",
        "so that not their times but their successes are to be compared. Times are of the",
        "processor, but of threads by the clock; those since 2026-11-27 are longer than the",
        "machine's own, as it was busy with other work. Errors are the largest over time of",
        "|q - exact|, each coordinate in units of the largest |q| it reaches. A path is *verified",
        "forward* by integrating the equations of motion over each element from the path's own",
        "position and velocity at its start. Where a row stands for many solves, the largest",
        "errors of those called solved are given in units of what was asked and of what was",
        "claimed; one is *wrong* that exceeds three times both. *Before* is what the same",
        "questions gave once, in `stress_before.json`, where that was measured",
        f"({'; '.join({about for about, _ in before.values()})}).",
        "",
        *table(
            ["family", "what", "expected", "before", "found", "met"],
            [
                [
                    FAMILIES[name].TITLE,
                    c.what,
                    c.expected,
                    earlier.get((name, c.what, c.expected), ""),
                    c.found,
                    "yes" if c.met else "**no**",
                ]
                for name in known
                for c in FAMILIES[name].criteria(families[name][1])
            ],
        ),
        "",
        "What found the paths that are called solved, as far as it was kept:",
        "",
        *table(["found by", "paths", "families"], _rungs(families)),
    ]
    for name in known:
        lines += ["", *_section(name, *families[name])]
    return "\n".join(lines)


def _rungs(families: dict) -> list[list[str]]:
    """Return how many paths each rung or start found, and in which families."""
    found: dict[str, Counter] = {}
    for name, (_, rows) in families.items():
        for r in rows:
            rungs = r.get("rungs") or ({r["rung"]: 1} if r.get("rung") and r["success"] else {})
            for rung, count in rungs.items():
                found.setdefault(rung, Counter())[name] += count
    ordered = sorted(found.items(), key=lambda item: -item[1].total())
    return [
        [rung, str(c.total()), ", ".join(name for name, _ in c.most_common())]
        for rung, c in ordered
    ]


def _section(name: str, about: str, rows: list[dict]) -> list[str]:
    module = FAMILIES[name]
    lines = [f"## {module.TITLE}", "", *(module.__doc__ or "").strip().split("\n"), "", about, ""]
    fared = [[name, f"{solved} of {n}", *rest] for name, n, solved, *rest in _solvers(rows)]
    lines += table(["solver", "solved", "median time", "longest", "how it ended"], fared)
    if any("count" in r for r in rows):
        return lines + ["", *_tallies([r for r in rows if "count" in r])]
    own = [r for r in rows if r["solver"] == "actionopt"]
    if len(own) > MANY:
        return lines
    cells = []
    for r in own:
        verdict = r["status"] + (f", {r['rung']}" if "rung" in r else "")
        numbers = [_power(r.get("error")), _power(r.get("estimate"))]
        counts = [str(r.get(k, "")) for k in COUNTS]
        cells.append([r["case"], verdict, *numbers, *counts, _time(r)])
    return [*lines, "", *table(["case", "verdict", "error", "estimate", *COUNTS, "time"], cells)]


def _tallies(rows: list[dict]) -> list[str]:
    """Return the table of rows that stand for many solves each."""
    cells = []
    for r in rows:
        errors = [f"{r[k]:.2g}" if k in r else "" for k in ("of_tol", "of_estimate")]
        counts = [f"{r['solved']} of {r['count']}", str(r.get("wrong", ""))]
        times = [_time(r), _time({"time": r["longest"]})]
        cells.append([r["case"], r["solver"], *counts, *errors, *times])
    head = "case | solver | solved | wrong | error / tol | error / estimate | median time | longest"
    return table(head.split(" | "), cells)


def _solvers(rows: list[dict]):
    """Yield (solver, cases, solved, median time, longest time, how it ended)."""
    for solver in dict.fromkeys(r["solver"] for r in rows):
        own = [r for r in rows if r["solver"] == solver]
        timed = [r for r in own if "time" in r]
        median = {"time": float(np.median([r["time"] for r in timed]))} if timed else {}
        longest = {"time": max(r.get("longest", r["time"]) for r in timed)} if timed else {}
        how: Counter = Counter()
        for r in own:
            how.update(r.get("endings") or {r["status"][:SENTENCE]: 1})
        endings = ", ".join(f"{k} {n}" for k, n in how.most_common(4))
        count = sum(r.get("count", 1) for r in own)
        solved = sum(r.get("solved", bool(r.get("success"))) for r in own)
        yield solver, count, solved, _time(median), _time(longest), endings


def _power(value: float | None) -> str:
    return "" if value is None else f"{value:.1e}"


def _time(row: dict) -> str:
    seconds = row.get("time")
    if seconds is None:
        return ""
    return f"{seconds:.2g} s" if seconds >= 1 else f"{1e3 * seconds:.3g} ms"
