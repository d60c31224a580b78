"""Find stationary points that are not known, and keep them; a module to be run.

Those of a file of results, or what Ipopt comes to from random starts on the members named, and all
ways past discs, where these are in the way:

    python -m actionopt.suite.learn results.jsonl
    python -m actionopt.suite.learn kepler chain

With `--paths` before them, those on the mesh near the paths that `solve_all` finds, in place of
random starts.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from actionopt import suite
from actionopt.families.searches.all_paths import solve_all
from actionopt.suite import known, solvers
from actionopt.suite.member import Stationary
from actionopt.suite.problem import SEED, TestProblem
from actionopt.suite.runner import load
from actionopt.suite.verdict import NEAR, SAME_POINT, SAME_VALUE
from actionopt.suite.ways import centres, ways
from actionopt.tools.files import rounded, write
from actionopt.tools.types import Array

KNOWN_DIGITS = 5  # Newton's method finds the others
RANDOM_STARTS = 60
RANDOM_WAVES, RANDOM_AMPLITUDES = (
    4,
    (0.3, 1.0, 3.0),
)  # of random starts, in the coordinates' sizes; ad hoc
MOST_KEPT = 16  # points that random starts come to: the lowest minima first
MOST_NUMBERS = 7000  # in all points of one member: the file is a part of the package


def learn(records: Iterable[Mapping[str, Any]], file: Path = known.KNOWN_FILE) -> int:
    """Add the points of records that were not known, each once; return how many there were."""
    table = {name: {**entry, "points": [*entry["points"]]} for name, entry in known.table().items()}
    count = 0
    for record in records:
        if "point" not in record or record.get("parameters"):
            continue
        problem = suite.get(record["problem"], record["elements"], record["degree"])
        found = problem.nearest(np.array(record["point"]) * problem.unit, SAME_POINT)
        if found is None:
            continue
        entry = table.setdefault(known.key(problem.name, problem), {"starts": 0, "points": []})
        entry["starts"] = max(entry["starts"], record.get("starts", 0))
        if "paths" in record:
            entry["paths"] = record["paths"]
        others = [problem.x_star, *(np.array(k) * problem.unit for k in entry["points"])]
        if is_new(problem, found.x, others):
            point = (found.x / problem.unit).tolist()
            entry["points"].append(rounded(point, KNOWN_DIGITS))
            count += 1
    lines = (f"{json.dumps(name)}: {json.dumps(table[name])}" for name in sorted(table))
    write(file, "{\n" + ",\n".join(lines) + "\n}\n")
    return count


def is_new(problem: TestProblem, x: Array, others: Iterable[Array]) -> bool:
    """Whether x is none of the others, which are known to `KNOWN_DIGITS`."""
    return all(problem.distance(x, other) > 10.0 ** (2 - KNOWN_DIGITS) for other in others)


def search(problem: TestProblem, starts: int = RANDOM_STARTS) -> Iterator[dict[str, Any]]:
    """Yield what Ipopt comes to from random starts, the optimum and all ways, for `learn`."""
    found: list[Stationary] = [*ways(problem).values()] if centres(problem) else []
    for x in random_starts(problem, starts):
        end = solvers.run("ipopt", problem, x).x
        near = problem.nearest(end, SAME_POINT) if np.all(np.isfinite(end)) else None
        if near and near.index is not None and is_new(problem, near.x, [s.x for s in found]):
            found.append(near)
    found.sort(key=lambda s: (s.index, s.f))
    for point in (problem.optimum, *found[: min(MOST_KEPT, MOST_NUMBERS // problem.n)]):
        yield {**_record(problem, point), "starts": starts}


def near_paths(problem: TestProblem) -> Iterator[dict[str, Any]]:
    """Yield the optimum, and what is stationary near the paths that `solve_all` finds, for `learn`.

    On the mesh: a path that it does not resolve, and one that ends a turn farther, has none. Where
    `MOST_NUMBERS` are kept already, only a minimum that is lower than all.
    """
    every = solve_all(problem.scene.problem)
    found = [problem.optimum]
    most = MOST_NUMBERS // problem.n - len(problem.others)
    for solution in every:
        near = problem.nearest(problem.at_nodes(solution), NEAR)
        kept = [s.x for s in (*found, *problem.others)]
        if near is None or near.index is None or not is_new(problem, near.x, kept):
            continue
        lower = problem.lowest - SAME_VALUE * problem.f_unit
        if len(found) <= most or (near.index == 0 and near.f < lower):
            found.append(near)
    for point in found:
        yield {**_record(problem, point), "paths": len(every)}


def _record(problem: TestProblem, point: Stationary) -> dict[str, Any]:
    return {
        "problem": problem.name,
        "elements": problem.mesh.elements,
        "degree": max(problem.mesh.degrees),
        "point": point.x / problem.unit,
    }


def random_starts(problem: TestProblem, count: int) -> Iterator[Array]:
    """Yield starting points (n,): the member's own, with sine waves of random amplitudes."""
    random, tr = np.random.default_rng(SEED), problem.transcription
    s, k = np.linspace(0, 1, tr.layout.node_count), np.arange(1, RANDOM_WAVES + 1)
    waves = np.sin(np.pi * np.outer(s, k)) / k
    for i in range(count):
        Q = waves @ random.normal(size=(RANDOM_WAVES, tr.layout.system.n))
        bend = RANDOM_AMPLITUDES[i % len(RANDOM_AMPLITUDES)] * Q.ravel()[tr.layout.free]
        yield problem.start() + bend * problem.unit


if __name__ == "__main__":
    look = near_paths if "--paths" in sys.argv else search
    for word in sys.argv[1:]:
        if word != "--paths":
            print(word, learn(load(word) if word.endswith(".jsonl") else look(suite.get(word))))
            known.table.cache_clear()
