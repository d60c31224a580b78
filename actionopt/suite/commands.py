"""`actionopt suite`: list, run and dump the test problems, and report on runs."""

from __future__ import annotations

import argparse
from typing import Any

from actionopt import suite
from actionopt.suite import runner, solvers
from actionopt.suite.cell import Cell
from actionopt.suite.verdict import MEANING, VERDICTS
from actionopt.tools.progress import progress
from actionopt.tools.table import print_table

SOLVERS = """\
A solver is a plugin of CasADi's nlpsol (ipopt, fatrop, sqpmethod, sqpmethod:osqp, qrsqp, uno,
...), scipy:METHOD, or FILE.py:FUNCTION of your own. Each runs with its own defaults, every
problem in a process of its own; what --output has already is not run again.

  actionopt suite run --solver ipopt --solver sqpmethod --solver scipy:SLSQP
  actionopt suite report --output results.jsonl --to docs/suite
"""


def add_to(parser: argparse.ArgumentParser) -> None:
    """Give the parser of `actionopt suite` its commands."""
    parser.description = "Families of test problems for optimisers, with known answers."
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    chosen = argparse.ArgumentParser(add_help=False)
    chosen.add_argument(
        "--problem", action="append", default=[], help="only this one; may be repeated"
    )
    chosen.add_argument(
        "--tag", action="append", default=[], help="only those with this tag; may be repeated"
    )
    chosen.add_argument("--elements", type=_whole, help="elements of the mesh (the problem's own)")
    chosen.add_argument("--degree", type=_whole, help="degree of the elements (the problem's own)")
    output = argparse.ArgumentParser(add_help=False)
    add = output.add_argument
    add("-o", "--output", default="results.jsonl", metavar="FILE", help="results, JSON lines")

    command = commands.add_parser("list", help="name the problems", parents=[chosen])
    command.set_defaults(run=show)
    command = commands.add_parser(
        "run",
        help="run solvers on the problems",
        parents=[chosen, output],
        epilog=SOLVERS,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    command.set_defaults(run=run)
    add = command.add_argument
    add("--solver", action="append", required=True, help="a solver; may be repeated")
    add("--start", help="starting point: guess, straight, perturbed, coarse or near")
    add("--seconds", type=float, default=60.0, help="wall time of one run (60)")
    add("--memory", type=float, default=8.0, help="memory of one run, GiB (8)")
    add("--jobs", type=int, default=1, help="runs at the same time (1)")
    command = commands.add_parser("dump", help="write .nl files and answers", parents=[chosen])
    command.set_defaults(run=dump)
    command.add_argument("directory", metavar="DIRECTORY", help="where to; made if it is not there")
    command = commands.add_parser("report", help="profiles and tables", parents=[output])
    command.set_defaults(run=report)
    command.add_argument("--to", default="docs/suite", metavar="DIRECTORY", help="(docs/suite)")


def _whole(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"expected a whole number of at least 1, found {text!r}")
    return int(text)


def _names(options: argparse.Namespace) -> list[str]:
    found = suite.find(tags=options.tag)
    if not options.problem:
        return found
    for name in options.problem:
        suite.get(name)  # raises for one that does not exist
    return [name for name in options.problem if name in found]


def show(options: argparse.Namespace) -> int:
    """Print a table of the problems."""
    rows, missing = [("problem", "class", "optimum", "what is special")], 0
    for name in _names(options):
        problem = suite.get(name, options.elements, options.degree)
        try:
            kind = problem.kind
        except ValueError:  # the mesh is too coarse for this one
            kind, missing = "none", missing + 1
        rows.append((name, problem.classification, kind, ", ".join(problem.tags)))
    print_table(rows)
    if missing:
        print(f"  none: no optimum near the path on such a mesh ({missing} of {len(rows) - 1})")
    return 0


def run(options: argparse.Namespace) -> int:
    """Run the solvers and print how often each verdict was reached."""
    for solver in options.solver:
        solvers.check(solver)
    cells = [
        Cell(solver, name, options.elements, options.degree, options.start)
        for name in _names(options)
        for solver in options.solver
    ]
    limits = runner.Limits(options.seconds, options.memory)
    records = runner.run(cells, options.output, limits=limits, jobs=options.jobs, show=show_record)
    counts = runner.tally(records)
    print_table(
        [
            ("solver", *VERDICTS),
            *((name, *(str(count[v]) for v in VERDICTS)) for name, count in counts.items()),
        ]
    )
    for verdict in VERDICTS:
        print(f"  {verdict}: {MEANING[verdict]}")
    return 0


def show_record(done: int, total: int, record: dict[str, Any]) -> None:
    """Write a progress bar to the standard error."""
    progress(done, total, f"{record['solver']} {record['problem']}: {record['verdict']}")


def dump(options: argparse.Namespace) -> int:
    """Write the problems to a directory."""
    from actionopt.suite.dump import dump as write

    chosen = (suite.get(name, options.elements, options.degree) for name in _names(options))
    print(write(chosen, options.directory))
    return 0


def report(options: argparse.Namespace) -> int:
    """Write the report on a file of results."""
    from actionopt.suite.report import write

    print(write(runner.load(options.output), options.to))
    return 0
