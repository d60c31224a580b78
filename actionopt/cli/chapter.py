"""`actionopt chapter`: what a textbook chapter says, beside what is found."""

from __future__ import annotations

import argparse
from time import perf_counter
from typing import TYPE_CHECKING

from actionopt.cli.question import seconds
from actionopt.tools.table import print_table

if TYPE_CHECKING:
    from actionopt.chapter import Line


def add_to(command: argparse.ArgumentParser) -> None:
    """Add the arguments, and what runs."""
    command.description = (
        "Solve every system of chapter 12, Lagrangian mechanics, of Competitive Physics: Mechanics "
        "and Waves (2018), and compare what comes out with what it says."
    )
    command.set_defaults(run=run)
    command.add_argument("section", nargs="?", help="only this section, as in 12.4")


def run(options: argparse.Namespace) -> int:
    """Print the comparisons; 1 if any of them is missed."""
    from actionopt.chapter import ROWS

    asked = options.section
    chosen = [row for row in ROWS if asked is None or (asked and row.section.startswith(asked))]
    if not chosen:
        sections = sorted({row.section for row in ROWS})
        raise ValueError(f"expected one of the sections {', '.join(sections)}, found {asked!r}")
    clock, count, missed = perf_counter(), 0, 0
    for row in chosen:
        lines = list(row.check())
        count += len(lines)
        missed += sum(not line.agrees for line in lines)
        print(f"\n{row.section}  {row.system}")
        print_table([("", "expected", "found", "error"), *map(_comparison, lines)])
    print(f"\n{count} comparisons, {missed} missed, {seconds(perf_counter() - clock)}")
    return 1 if missed else 0


def _comparison(line: Line) -> tuple[str, str, str, str]:
    found = (line.expected, line.found)
    expected, got = (f"{x:.12g}" if isinstance(x, float) else str(x) for x in found)
    error = "" if line.error is None else f"{line.error:.1e}"
    verdict = error if line.agrees else f"{error}  MISSED".lstrip()
    return f"  {line.quantity}", expected, got, verdict
