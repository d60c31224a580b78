"""Keep the stationary points of a file of results that were not known; a module to be run.

python -m actionopt.suite.learn results.jsonl
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from actionopt import suite
from actionopt.suite import known
from actionopt.suite.runner import load
from actionopt.suite.verdict import SAME_POINT
from actionopt.tools.files import rounded, write

KNOWN_DIGITS = 5  # Newton's method finds the others


def learn(records: Iterable[Mapping[str, Any]], file: Path = known.KNOWN_FILE) -> int:
    """Add the points of records that were not known, each once; return how many there were."""
    table = {name: list(points) for name, points in known.table().items()}
    count = 0
    for record in records:
        if "point" not in record or record.get("parameters"):
            continue
        problem = suite.get(record["problem"], record["elements"], record["degree"])
        found = problem.nearest(np.array(record["point"]) * problem.unit, SAME_POINT)
        if found is None:
            continue
        x = found.x
        mine = table.setdefault(known.key(problem.name, problem), [])
        others = [problem.x_star, *(np.array(k) * problem.unit for k in mine)]
        if all(problem.distance(x, other) > 10.0 ** (2 - KNOWN_DIGITS) for other in others):
            mine.append(rounded(list(map(float, x / problem.unit)), KNOWN_DIGITS))
            count += 1
    lines = (f"{json.dumps(name)}: {json.dumps(table[name])}" for name in sorted(table))
    write(file, "{\n" + ",\n".join(lines) + "\n}\n")
    return count


if __name__ == "__main__":
    print(learn(load(sys.argv[1])))
