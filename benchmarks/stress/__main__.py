"""The command: run families, keep their rows, write the page."""

from __future__ import annotations

import argparse
import json

from actionopt.tools.files import write
from actionopt.tools.progress import steps
from benchmarks.results import DOCS, packed, stamp, text, unpacked
from benchmarks.stress import report
from benchmarks.stress.families import FAMILIES

PACKAGES = ("actionopt", "python", "casadi", "numpy", "scipy")


def main(arguments: list[str] | None = None) -> None:
    """Run the command."""
    options = _options(arguments)
    file = DOCS / f"stress{'_quick' * options.quick or '_before' * options.before}.json"
    families = json.loads(file.read_text()) if file.exists() else {}
    for name in () if options.report_only else options.family or FAMILIES:
        rows = packed(measure(name, options.quick, options.limit))
        families[name] = {"about": stamp(*PACKAGES), **rows}
        write(file, text(families, 3) + "\n")
        print(report.told(name, unpacked(rows)))
    if not options.quick:
        write(DOCS / "stress.md", report.page(_read(""), _read("_before")) + "\n")


def measure(name: str, quick: bool, limit: float) -> list[dict]:
    """Return the rows of all cases of a family."""
    todo = {case.name: case for case in FAMILIES[name].cases(quick)}
    rows = []
    for case in steps(list(todo)):
        rows += todo[case].rows(limit)
    return rows


def _read(which: str) -> dict[str, tuple[str, list[dict]]]:
    """Return what was measured of each family: about what, and the rows."""
    file = DOCS / f"stress{which}.json"
    families = json.loads(file.read_text()) if file.exists() else {}
    return {name: (f["about"], unpacked(f)) for name, f in families.items()}


def _options(arguments):
    parser = argparse.ArgumentParser(prog="python -m benchmarks.stress", description=__doc__)
    parser.add_argument("--family", nargs="+", choices=list(FAMILIES), help="only these")
    parser.add_argument("--quick", action="store_true", help="fewer and smaller cases; no page")
    parser.add_argument(
        "--before",
        action="store_true",
        help="keep it as what to compare with: of another checkout, with this folder in it",
    )
    parser.add_argument("--report-only", action="store_true", help="measure nothing")
    parser.add_argument("--limit", type=float, default=3.0, help="seconds for a peer's solve")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    main()
