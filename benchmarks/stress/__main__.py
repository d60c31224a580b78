"""The command: run families, keep their rows, write the page."""

from __future__ import annotations

import argparse
import datetime
import importlib.metadata
import json
import os
import platform
from pathlib import Path

from benchmarks.runner import Progress
from benchmarks.stress import report
from benchmarks.stress.families import FAMILIES

DOCS = Path(__file__).parents[2] / "docs"
PACKAGES = ("casadi", "numpy", "scipy")


def main(arguments: list[str] | None = None) -> None:
    """Run the command."""
    options = _options(arguments)
    file = DOCS / ("stress_quick.json" if options.quick else "stress.json")
    data = json.loads(file.read_text()) if file.exists() else {"families": {}}
    for name in options.family or FAMILIES:
        rows = measure(name, options.quick, options.limit)
        data["families"][name] = {
            "date": datetime.date.today().isoformat(),
            "versions": versions(),
            "rows": rows,
        }
        write(file, json.dumps(data, indent=1))
        print(report.table(name, rows))
    if not options.quick:
        write(file.with_suffix(".md"), report.page(data["families"]))


def measure(name: str, quick: bool, limit: float) -> list[dict]:
    """Return the rows of all cases of a family."""
    todo = {case.name: case for case in FAMILIES[name].cases(quick)}
    rows = []
    for case in Progress(list(todo)):
        rows += todo[case].rows(limit)
    return rows


def versions() -> dict[str, str]:
    """Return the versions of what was used."""
    import actionopt

    found = {name: importlib.metadata.version(name) for name in PACKAGES}
    return {"actionopt": actionopt.__version__, "python": platform.python_version(), **found}


def write(file: Path, text: str) -> None:
    """Write the file through a temporary one: whole or not at all."""
    new = file.with_suffix(file.suffix + ".part")
    new.write_text(text + "\n")
    os.replace(new, file)


def _options(arguments):
    parser = argparse.ArgumentParser(prog="python -m benchmarks.stress", description=__doc__)
    parser.add_argument("--family", nargs="+", choices=list(FAMILIES), help="only these")
    parser.add_argument("--quick", action="store_true", help="fewer and smaller cases; no page")
    parser.add_argument("--limit", type=float, default=3.0, help="seconds for a peer's solve")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    main()
