"""`actionopt suite`: list, run and dump the test problems, and report on runs."""

from __future__ import annotations

import argparse
import sys
from functools import partial
from typing import Any

from actionopt import suite
from actionopt.suite import runner, solvers
from actionopt.suite.cell import Cell
from actionopt.suite.dials import DIALS
from actionopt.suite.member import Member
from actionopt.suite.verdict import SADDLE_QUESTION, VERDICT_MODES, meaning, verdict
from actionopt.tools.progress import Bar
from actionopt.tools.table import print_table

SOLVERS = f"""\
A solver is a plugin of CasADi's nlpsol (ipopt, fatrop, sqpmethod, sqpmethod:osqp, qrsqp, uno,
...), scipy:METHOD, nlopt:ALGORITHM, cyipopt, asl:PATH (a program that reads .nl files), or
FILE.py:FUNCTION of your own. Each runs with its own defaults, every problem in a process of its
own; what --out has already is not run again, unless the solver's file, its version or the
problem's numbers are others, or what was too short is longer now.

  actionopt suite run --solver ipopt --solver sqpmethod --solver scipy:SLSQP
  actionopt suite run --solver mine.py:solve --problem kepler --set eccentricity=0.5 --set decades=4
  actionopt suite run --solver ipopt --solver uno --dial eccentricity
  actionopt suite report --out results.jsonl --to report

The dials are {", ".join(DIALS)}: a parameter of a family from easy to hard.

{solvers.OWN_SOLVER_HELP}
"""


DUMP = """\
Each problem is FILE.nl for AMPL's solvers (with names in .row and .col), FILE.mof.json for JuMP and
NLPModels, FILE.py that needs numpy alone, and FILE.json with all that is known of it. Other sizes
and parameters go into the same folder: what is there stays.

  actionopt suite dump problems --elements 8
  actionopt suite dump problems --elements 32
  actionopt suite dump problems --problem kepler --set eccentricity=0.6 --zip problems.zip
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
        "--models", action="store_true", help="the models, instead of the discrete actions"
    )
    chosen.add_argument(
        "--tag", action="append", default=[], help="only those with this tag; may be repeated"
    )
    chosen.add_argument("--elements", type=_whole, help="elements of the mesh (the problem's own)")
    chosen.add_argument("--degree", type=_whole, help="degree of the elements (the problem's own)")
    chosen.add_argument(
        "--set",
        action="append",
        default=[],
        type=_setting,
        metavar="NAME=NUMBER",
        help="a parameter of the scene, or decades of units; may be repeated",
    )
    output = argparse.ArgumentParser(add_help=False)
    add = output.add_argument
    add(
        "-o",
        "--out",
        "--output",
        dest="output",
        default="results.jsonl",
        metavar="FILE",
        help="results, JSON lines (results.jsonl)",
    )

    command = commands.add_parser("list", help="name the problems", parents=[chosen])
    command.set_defaults(run=show)
    command.add_argument("problem", nargs="*", action="extend", help="only these, as --problem")
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
    add("--dial", action="append", default=[], choices=DIALS, help="the members of a dial instead")
    add(
        "--start",
        help="starting point: guess, straight, perturbed, coarse or near (the problem's own)",
    )
    add(
        "--seconds",
        type=float,
        default=runner.Limits().seconds,
        help="processor time of one solve (5)",
    )
    add("--memory", type=float, default=8.0, help="memory of one run, GiB (8)")
    add("--saddle", action="store_true", help="ask for any saddle of index 1, instead")
    add("--repeats", type=_whole, default=3, help="solves; the first is counted (3)")
    add("--again", action="store_true", help="run what the file has already, too")
    add("--jobs", type=int, default=1, metavar="N", help="runs at the same time (1)")
    command = commands.add_parser(
        "dump",
        help="write .nl, .mof.json and .py files, and answers",
        parents=[chosen],
        epilog=DUMP,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    command.set_defaults(run=dump)
    command.add_argument("--zip", metavar="FILE", help="pack all that is there into one file, too")
    command.add_argument("directory", metavar="DIRECTORY", help="where to; made if it is not there")
    command = commands.add_parser(
        "report", help="write a page of profiles and tables", parents=[output]
    )
    command.set_defaults(run=report)
    command.add_argument(
        "--to",
        required=True,
        metavar="DIRECTORY",
        help="where its index.html goes; made if it is not there",
    )


def _whole(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"expected a whole number of at least 1, found {text!r}")
    return int(text)


def _setting(text: str) -> tuple[str, float]:
    name, equals, value = text.partition("=")
    try:
        number = float(value)
    except ValueError:
        equals = ""
    if not (name and equals):
        raise argparse.ArgumentTypeError(f"expected NAME=NUMBER, found {text!r}")
    return name, int(number) if number.is_integer() and "." not in value else number


def _names(options: argparse.Namespace) -> list[str]:
    for name in options.problem:
        suite.member(name)  # raises for one that does not exist
    if options.models:
        names = options.problem or list(suite.MODELS)
        return [name for name in names if set(options.tag) <= set(suite.member(name).tags)]
    found = suite.find(tags=options.tag)
    named = found if options.tag else [*found, *suite.MODELS]
    return [name for name in options.problem if name in named] if options.problem else found


def show(options: argparse.Namespace) -> int:
    """Print a table of the problems."""
    rows, missing = [("problem", "class", "optimum", "what is special")], 0
    for name in _names(options):
        problem = _get(name, options)
        try:
            kind = problem.kind
        except ValueError:  # the mesh is too coarse for this one
            kind, missing = "none", missing + 1
        rows.append((name, problem.classification, kind, ", ".join(problem.tags)))
    print_table(rows)
    if missing:
        print(f"  none: no optimum near the path on such a mesh ({missing} of {len(rows) - 1})")
    return 0


def _get(name: str, options: argparse.Namespace) -> Member:
    return suite.member(name, options.elements, options.degree, **dict(options.set))


def _problem_names(options: argparse.Namespace) -> list[str]:
    """Return the names of the problems there are; say which meshes and starts are refused."""
    names = _names(options)
    if not (options.elements or options.degree or options.set or options.start):
        return names
    found = []
    for name in names:
        try:
            problem = _get(name, options)
            problem.start(options.start)
            assert problem.kind
        except ValueError as error:
            if options.problem:
                raise
            print(f"  left out: {name}: {error}", file=sys.stderr)
        else:
            found.append(name)
    return found


def run(options: argparse.Namespace) -> int:
    """Run the solvers and print how often each verdict was reached.

    Returns 1 if a solver's own file has a mistake.
    """
    for solver in options.solver:
        solvers.check(solver)
    cells = _on_dials(options) or [
        Cell(
            solver,
            name,
            options.elements,
            options.degree,
            options.start,
            dict(options.set),
            options.repeats,
        )
        for name in _problem_names(options)
        for solver in options.solver
    ]
    records = runner.run(
        cells,
        options.output,
        limits=runner.Limits(options.seconds, options.memory),
        jobs=options.jobs,
        again=options.again,
        show=partial(show_record, Bar()),
    )
    for mode in (SADDLE_QUESTION,) if options.saddle else VERDICT_MODES:
        counts, names = runner.tally(records, mode), meaning(mode)
        print(f"{mode}:")
        print_table(
            [
                ("solver", *names),
                *((name, *(str(count[v]) for v in names)) for name, count in counts.items()),
            ]
        )
        for name, said in names.items():
            print(f"  {name}: {said}")
    mistakes = {r["solver"]: r["trace"] for r in records if r["outcome"] == "error"}
    for solver, trace in mistakes.items():
        print(f"{solver} has a mistake:\n{trace}", file=sys.stderr)
    return 1 if mistakes else 0


def _on_dials(options: argparse.Namespace) -> list[Cell]:
    """Return the cells of the dials that were asked for."""
    return [
        Cell(
            solver,
            dial.family,
            dial.elements,
            dial.degree,
            dial.start,
            {dial.parameter: value},
            options.repeats,
        )
        for dial in map(DIALS.__getitem__, options.dial)
        for value in dial.values
        for solver in options.solver
    ]


def show_record(bar: Bar, done: int, total: int, record: dict[str, Any]) -> None:
    """Write a progress bar to the standard error."""
    bar(done, total, f"{record['solver']} {record['problem']}: {verdict(record, VERDICT_MODES[0])}")


def dump(options: argparse.Namespace) -> int:
    """Write the problems to a directory."""
    from actionopt.suite.dump import archive
    from actionopt.suite.dump import dump as write

    def skip(problem: Member, error: ValueError) -> None:
        if options.problem:
            raise error
        print(f"  left out: {problem.name}: {error}", file=sys.stderr)

    chosen = []
    for name in _names(options):
        try:
            chosen.append(_get(name, options))
        except ValueError as error:  # the scene has no such parameter
            if options.problem:
                raise
            print(f"  left out: {name}: {error}", file=sys.stderr)
    print(write(chosen, options.directory, skipped=skip))
    if options.zip:
        print(archive(options.directory, options.zip))
    return 0


def report(options: argparse.Namespace) -> int:
    """Write the report on a file of results."""
    from actionopt.suite.report import write

    records = runner.load(options.output)
    if not records:
        raise ValueError(
            f"expected results of at least one run in {options.output}, found none; "
            "`actionopt suite run --solver NAME` writes them, and --out says where"
        )
    print(write(records, options.to))
    return 0
