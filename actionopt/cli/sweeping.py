"""`actionopt sweep`: solve a question over a grid of values."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib.util import find_spec
from time import perf_counter
from typing import TYPE_CHECKING, Any

from actionopt.cli.question import add_question, question, seconds
from actionopt.tools.interrupts import leave_interruptions
from actionopt.tools.table import print_table

if TYPE_CHECKING:
    from actionopt.families.sweeps.runs import Runs
    from actionopt.tools.watch import Progress


def add_to(command: argparse.ArgumentParser) -> None:
    """Add the arguments, and what runs."""
    command.description = (
        "Solve a scene or a file over a grid of values, each path from its neighbours. What varies "
        "is a parameter, t0 or t1, energy where a time is free, or a coordinate at an event: "
        "start.NAME or end.NAME."
    )
    command.set_defaults(run=run)
    add, one_of = command.add_argument, command.add_mutually_exclusive_group().add_argument
    add_question(command)
    look: Any = {
        "metavar": "NAME=FROM:TO:COUNT",
        "help": "COUNT values at equal steps, both ends included; once for each axis of the grid",
    }
    add("--over", type=_over, action="append", required=True, **look)
    add("--tol", type=float, default=1e-8, help="bound on the relative error of each path (1e-8)")
    add("--index", action="store_true", help="count the Morse index of each path")
    one_of("--jobs", type=int, metavar="N", help="processes (1)")
    one_of("--dask", metavar="ADDRESS", help="of the scheduler of a Dask cluster")
    what = (
        "then try again each member that was not found, as long as `solve` takes; with a file, "
        "the members of the sweep over the same --over that --out wrote there"
    )
    add("--retry", nargs="?", const=True, type=_file_of_runs, metavar="FILE.npz", help=what)
    add("--seconds", type=float, help="time it may take; then it ends as if it were interrupted")
    add("--resume", metavar="FILE", help="keep what is finished there, and go on from it")
    add("--out", metavar="FILE", help="write the arrays (.npz, or .nc by xarray)")
    add("--plot", metavar="FILE", help="draw the action (png, pdf, svg, ...)")


def _over(text: str) -> tuple[str | tuple[Any, ...], Any]:
    name, equals, row = text.partition("=")
    try:
        first, last, count = row.split(":")
        if not (equals and name and int(count) > 0):
            raise ValueError
        parts = tuple(int(x) if x.isdigit() else x for x in name.split("."))
        return parts if "." in name else name, (float(first), float(last), int(count))
    except ValueError as error:
        raise argparse.ArgumentTypeError(
            f"expected NAME=FROM:TO:COUNT, such as g=9:10:50, end.x=0:1:20 or through.0.t=1:2:9, "
            f"found {text!r}"
        ) from error


def _file_of_runs(text: str) -> str:
    if not text.endswith(".npz"):
        raise argparse.ArgumentTypeError(
            f"expected FILE.npz or nothing, found {text!r}; write the scene or the file first: "
            f"actionopt sweep {text} --retry"
        )
    return text


def run(options: argparse.Namespace) -> int:
    """Solve, print what came of it, and write what is asked for; 130 if interrupted."""
    import numpy as np

    from actionopt.families.sweeps.grid import Grid
    from actionopt.families.sweeps.runs import Runs
    from actionopt.families.sweeps.sweep import sweep
    from actionopt.tools.checks import check_jobs, tolerance
    from actionopt.tools.files import ready
    from actionopt.tools.watch import time_limit

    problem, _ = question(options)
    tol = tolerance(options.tol)
    over = {name: np.linspace(*row) for name, row in options.over}
    if len(over) < len(options.over):
        raise ValueError("expected each name once after --over; an axis has one row of values")
    check_jobs(1 if options.jobs is None else options.jobs)
    if (
        options.out
        and ready(options.out, ".npz", ".nc").suffix == ".nc"
        and not find_spec("xarray")
    ):
        raise ValueError(
            "expected xarray to be installed to write .nc, found none: pip install "
            "'actionopt[xarray]', or write an .npz file"
        )
    if options.plot:
        from actionopt.plot._files import picture

        picture(options.plot)
        if len(over) > 2:
            raise ValueError(
                f"expected one or two axes to draw, found {len(over)}; leave --plot out"
            )
    clock = perf_counter()
    with _executor(options) as executor, time_limit(options.seconds):
        if isinstance(options.retry, str):
            runs = Runs.read(options.retry, Grid.of(problem, over, False), tol, options.index)
        else:
            runs = sweep(
                problem, over, executor=executor, tol=tol, resume=options.resume,
                record="index" if options.index else None,
                progress=_bar(),
            )  # fmt: skip
        if options.retry and not runs.interrupted and runs.failed.any():
            file = None if options.resume is None else f"{options.resume}.retry"
            runs = runs.retry(executor=executor, progress=_bar(), resume=file)
    _print_runs(runs, perf_counter() - clock)
    if options.out:
        runs.save(options.out)
    if options.plot:
        from actionopt import plot

        plot.save_runs(runs, options.plot)
    return 130 if runs.interrupted else 0


@contextmanager
def _executor(options: argparse.Namespace) -> Iterator[Any]:
    """Yield who solves: processes, the workers of a Dask cluster, or None for this process."""
    if options.dask:
        try:
            import distributed  # pyright: ignore[reportMissingImports]
        except ImportError as error:
            raise ValueError(
                "expected Dask to be installed for --dask, found none: pip install "
                "'actionopt[dask]'"
            ) from error
        with distributed.Client(options.dask) as client:
            yield client.get_executor()
    elif (options.jobs or 1) > 1:
        from concurrent.futures import ProcessPoolExecutor
        from multiprocessing import get_context

        context = get_context("spawn")
        with ProcessPoolExecutor(options.jobs, context, leave_interruptions) as pool:
            yield pool
    else:
        yield None


def _bar() -> Progress:
    """Return the `progress` of a sweep: a bar, the rate, and how many members failed."""
    from actionopt.tools.progress import Bar

    bar, started = Bar(), perf_counter()

    def show(stage: str, done: int, total: int | None, detail: Mapping[str, float]) -> None:
        rate, failed = done / (perf_counter() - started), detail["failed"]
        bar(done, total or 0, f"{rate:.0f}/s" + (f", {failed} failed" if failed else ""))

    return show


def _print_runs(runs: Runs, time: float) -> None:
    """Print what came of a sweep."""
    import numpy as np

    def count(values: Any) -> str:
        found = zip(*np.unique(values, return_counts=True), strict=True)
        return ", ".join(f"{count} {value}" for value, count in found)

    solved = runs.action[runs.success]
    remedy = "" if runs.retried == "fully" else ": --retry"
    rows = [
        ("status", count(runs.status)),
        ("action", f"{solved.min():.9g} to {solved.max():.9g}" if solved.size else "none"),
        ("largest error", f"{runs.error[runs.success].max(initial=0.0):.1e}"),
    ]
    if runs.index is not None:
        found = np.unique(runs.index[runs.success], return_counts=True)
        rows.append(("index", ", ".join(f"{k} of {n}" for k, n in zip(*found, strict=True))))
    rows += [
        *([("failed", runs.failures + remedy)] if runs.failures else []),
        *((runs.grid.text(i), runs.messages[i]) for i in sorted(runs.messages)[:1]),
        *(
            [("not reached", f"{runs.remainder}: --resume FILE; the same call then goes on")]
            if runs.remainder
            else []
        ),
        ("branches", str(runs.branch.max(initial=-1) + 1)),
        ("time", f"{seconds(time)}, {_count(runs.stats['tasks'], 'task')}"),
    ]
    print(
        f"{runs.problem.name}: {_count(runs.grid.size, 'path')}{', interrupted' * runs.interrupted}"
    )
    print_table(rows)


def _count(number: int, what: str) -> str:
    """Return so many of them, in words."""
    return f"{number} {what}{'s' * (number != 1)}"
