"""The command `actionopt`: list the scenes, solve one of them or a problem of the user's own."""

from __future__ import annotations

import argparse
import ast
import json
import math
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

from actionopt import __version__
from actionopt.tools.table import print_table

if TYPE_CHECKING:
    from actionopt.analysis.solution import Solution
    from actionopt.chapter import Line
    from actionopt.families.runs import Runs
    from actionopt.mechanics.problem import Problem

ABOUT = "A Lagrangian and two events in, the path of stationary action between them out."
FILE_HELP = """\
A file of your own is plain Python that defines `problem` (or `scene`): a Problem, a Scene, or a
function of keyword parameters that returns one. --set overrides physical parameters of the first
two and passes keywords to the last.

  actionopt solve pendulum --set g=1.62 --plot pendulum.png
  actionopt solve kepler --tol 1e-12 --json
  actionopt solve my_scene.py --set "masses=[1, 2]" --save path.npz
"""


FORWARD = (  # of a comparison, as --json has it
    *("agrees", "position", "velocity", "arrival", "local", "allowed"),
    *("energy_drift", "reference_error", "reason"),
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command with `arguments` (by default those of the process); return its exit code.

    0 for success, 1 for a failure, whose message goes to the standard error, 2 for arguments
    that make no sense, 130 if interrupted, 141 if the output is read no further.
    """
    given = sys.argv[1:] if arguments is None else list(arguments)
    parser = _parser(given[:1])
    options, rest = parser.parse_known_args(given)
    if rest:
        bare = [text for text in rest if "=" in text and not text.startswith("-")]
        hint = f"; write --set before each setting: --set {' --set '.join(bare)}" if bare else ""
        parser.error(f"unrecognized arguments: {' '.join(rest)}{hint}")
    try:
        code = options.run(options)
        sys.stdout.flush()
        return code
    except BrokenPipeError:  # whoever read the output has seen enough
        # What is still to be written when the process ends goes nowhere, without a word.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130
    except (ValueError, RuntimeError, OSError, ArithmeticError) as error:
        print(f"actionopt: {error}", file=sys.stderr)
        return 1


def _parser(asked: Sequence[str] = ()) -> argparse.ArgumentParser:
    """Return the parser; what belongs to a room that takes long to enter, only if it is `asked`."""
    parser = argparse.ArgumentParser(prog="actionopt", description=ABOUT)
    parser.add_argument("--version", action="version", version=f"actionopt {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    for name, (text, add_to) in COMMANDS.items():
        command = commands.add_parser(name, help=text)
        if add_to is not None:
            add_to(command)
        elif name in asked:
            import_module(f"actionopt.{name}.commands").add_to(command)
    return parser


def _add_list(command: argparse.ArgumentParser) -> None:
    command.description = "Name the scenes; with the name of one, tell of it."
    command.set_defaults(run=_list)
    command.add_argument("scene", nargs="?", help="its parameters, its source, what is known")


def _add_solve(command: argparse.ArgumentParser) -> None:
    command.description = "Solve a scene or a file, and compare the path with forward integration."
    command.epilog, command.formatter_class = FILE_HELP, argparse.RawDescriptionHelpFormatter
    command.set_defaults(run=_solve)
    add = command.add_argument
    add("scene", metavar="SCENE|FILE.py", help="name of a scene, or a Python file")
    add("--tol", type=float, default=1e-8, help="bound on the relative error of the path (1e-8)")
    _add_set(command)
    what = "what to ask of the action: least, only stationary, or least if it can be (auto)"
    add("--principle", choices=("auto", "least", "stationary"), default="auto", help=what)
    add("--plot", metavar="FILE", help="draw the path and the deviation (png, pdf, svg, ...)")
    add("--save", metavar="FILE.npz", help="write the solution")
    add("--json", action="store_true", help="print JSON instead of a table")
    add("--no-compare", action="store_false", dest="compare", help="no forward integration")
    add("--seconds", type=float, help="time it may take; then the best attempt is reported")


def _add_sweep(command: argparse.ArgumentParser) -> None:
    command.description = (
        "Solve a scene or a file over a grid of values, each path from its neighbours. What varies "
        "is a parameter, t0 or t1, energy where a time is free, or a coordinate at an event: "
        "start.NAME or end.NAME."
    )
    command.set_defaults(run=_sweep)
    add, one_of = command.add_argument, command.add_mutually_exclusive_group().add_argument
    add("scene", metavar="SCENE|FILE.py", help="name of a scene, or a Python file")
    look: Any = {
        "metavar": "NAME=FROM:TO:COUNT",
        "help": "values at equal steps; one for each axis",
    }
    add("--over", type=_over, action="append", required=True, **look)
    add("--tol", type=float, default=1e-8, help="bound on the relative error of each path (1e-8)")
    _add_set(command)
    add("--index", action="store_true", help="count the index of each path")
    one_of("--workers", type=int, metavar="N", help="processes (1)")
    one_of("--dask", metavar="ADDRESS", help="of the scheduler of a Dask cluster")
    add("--resume", metavar="FILE", help="keep what is finished there, and go on from it")
    add("--out", metavar="FILE", help="write the arrays (.npz, or .nc by xarray)")
    add("--plot", metavar="FILE", help="draw the action (png, pdf, svg, ...)")


def _add_explore(command: argparse.ArgumentParser) -> None:
    command.description = (
        "Open a window on a trial path of a scene or a file: drag its points, see the action and "
        "the missing force change, solve, and slide the end time through conjugate points."
    )
    command.set_defaults(run=_explore)
    command.add_argument("scene", metavar="SCENE|FILE.py", help="name of a scene, or a Python file")
    _add_set(command)


def _add_chapter(command: argparse.ArgumentParser) -> None:
    command.description = (
        "Solve every system of chapter 12, Lagrangian mechanics, of Competitive Physics: Mechanics "
        "and Waves (2018), and compare what comes out with what it says."
    )
    command.set_defaults(run=_chapter)
    command.add_argument("section", nargs="?", default="", help="only this section, as in 12.4")


def _add_exercise(command: argparse.ArgumentParser) -> None:
    command.description = (
        "Write a lesson of the course as Jupyter notebooks: NAME.ipynb to work in, and "
        "NAME-answers.ipynb. Without a name, list the lessons."
    )
    command.set_defaults(run=_exercise)
    command.add_argument("name", nargs="?", metavar="NAME", help="of a lesson")
    command.add_argument("folder", nargs="?", default=".", metavar="FOLDER", help="where to (here)")


COMMANDS: dict[str, tuple[str, Callable[[argparse.ArgumentParser], None] | None]] = {
    "list": ("name the scenes, or tell of one", _add_list),
    "solve": ("solve a scene or a file", _add_solve),
    "sweep": ("solve a scene or a file over a grid of values", _add_sweep),
    "explore": ("open a window: drag a path, see its action, slide the end time", _add_explore),
    "chapter": ("run the chapter on Lagrangian mechanics", _add_chapter),
    "exercise": ("write a lesson of the course as notebooks", _add_exercise),
    "suite": ("test problems for optimisers", None),
    "gallery": ("write the scenes as web pages", None),
}


def _add_set(command: argparse.ArgumentParser) -> None:
    what = "a parameter by name; may be repeated (`actionopt list SCENE` names them)"
    look: Any = {"metavar": "NAME=VALUE", "dest": "settings", "help": what}
    command.add_argument("--set", type=_setting, action="append", default=[], **look)


def _setting(text: str) -> tuple[str, Any]:
    name, equals, value = text.partition("=")
    try:
        if not (equals and name.isidentifier()):
            raise ValueError
        return name, ast.literal_eval(value.strip())
    except (ValueError, SyntaxError) as error:
        raise argparse.ArgumentTypeError(
            f"expected NAME=VALUE with a number, a list or None as the value, found {text!r}"
        ) from error


def _over(text: str) -> tuple[str | tuple[str, str], Any]:
    name, equals, row = text.partition("=")
    try:
        first, last, count = row.split(":")
        if not (equals and name and int(count) > 0):
            raise ValueError
        event, dot, coordinate = name.partition(".")
        return (event, coordinate) if dot else name, (float(first), float(last), int(count))
    except ValueError as error:
        raise argparse.ArgumentTypeError(
            f"expected NAME=FROM:TO:COUNT, such as g=9:10:50 or end.x=0:1:20, found {text!r}"
        ) from error


# -- list ------------------------------------------------------------------------------------


def _list(options: argparse.Namespace) -> int:
    from actionopt import scenes

    if options.scene is not None:
        return _tell(options.scene)
    rows = []
    for name in scenes.SCENES:
        scene = scenes.get(name)
        system = scene.problem.system
        rows.append((name, _some(system.coordinates), str(system.m or ""), scene.title))
    print_table([("scene", "coordinates", "constraints", "what it is"), *rows])
    return 0


def _tell(name: str) -> int:
    """Print what there is to know of a scene before it is solved."""
    from actionopt import scenes

    scene = scenes.get(name)
    known = (["the path"] if scene.exact is not None else []) + sorted(scene.facts)
    settings = [f"{key}={value!r}" for key, value in scenes.parameters(name).items()]
    print(f"{name}: {scene.title}")
    print_table(
        [
            ("source", scene.source),
            ("coordinates", ", ".join(scene.problem.system.coordinates)),
            ("known exactly", ", ".join(known).replace("_", " ")),
            ("parameters", "for --set, with what they are by default"),
            *(("", setting) for setting in settings),
        ]
    )
    return 0


def _some(names: Sequence[str]) -> str:
    """Return the names, those in the middle of a long row left out."""
    shown = names if len(names) <= 4 else (*names[:3], "...", names[-1])
    return ", ".join(shown)


def _exercise(options: argparse.Namespace) -> int:
    from actionopt.gallery.course.lessons import LESSONS

    if options.name is None:
        print_table([("lesson", "what it is"), *((x.name, x.title) for x in LESSONS)])
        return 0
    from actionopt.gallery.course.notebook import exercise

    for file in exercise(options.name, options.folder):
        print(file)
    return 0


# -- chapter ---------------------------------------------------------------------------------


def _chapter(options: argparse.Namespace) -> int:
    from actionopt.chapter import ROWS

    chosen = [row for row in ROWS if row.section.startswith(options.section)]
    if not chosen:
        sections = sorted({row.section for row in ROWS})
        raise ValueError(
            f"expected one of the sections {', '.join(sections)}, found {options.section!r}"
        )
    clock, count, missed = perf_counter(), 0, 0
    for row in chosen:
        lines = list(row.check())
        count += len(lines)
        missed += sum(not line.agrees for line in lines)
        print(f"\n{row.section}  {row.system}")
        print_table([("", "expected", "found", "error"), *map(_compared, lines)])
    print(f"\n{count} comparisons, {missed} missed, {_seconds(perf_counter() - clock)}")
    return 1 if missed else 0


def _compared(line: Line) -> tuple[str, str, str, str]:
    found = (line.expected, line.found)
    expected, got = (f"{x:.12g}" if isinstance(x, float) else str(x) for x in found)
    error = "" if line.error is None else f"{line.error:.1e}"
    verdict = error if line.agrees else f"{error}  MISSED".lstrip()
    return f"  {line.quantity}", expected, got, verdict


# -- solve -----------------------------------------------------------------------------------


def _solve(options: argparse.Namespace) -> int:
    from actionopt.solver.solve import solve
    from actionopt.tools.progress import waiting

    problem, guess = _question(options.scene, dict(options.settings))
    if options.save:
        from actionopt.analysis.saved import solution_file

        solution_file(options.save)
    if options.plot:
        from actionopt.plot._files import picture

        picture(options.plot)
    with waiting() as progress:
        asked = {name: getattr(options, name) for name in ("tol", "principle", "seconds")}
        solution = solve(problem, guess=guess, progress=progress, **asked)
    found = report(solution, compare=options.compare)
    if options.save:
        solution.save(options.save)
    if options.plot:
        from actionopt import plot

        plot.save(solution, options.plot, compare=options.compare)
    if options.json:
        print(json.dumps(_plain(found), indent=2, allow_nan=False))
    else:
        _print_report(found)
    if options.compare and not solution.contacts and solution.compare().agrees is False:
        raise RuntimeError(_contradiction(found["forward"]))
    return 0


def _sweep(options: argparse.Namespace) -> int:
    from importlib.util import find_spec

    import numpy as np

    from actionopt.families.sweep import sweep
    from actionopt.tools.files import ready

    problem, _ = _question(options.scene, dict(options.settings))
    over = {name: np.linspace(*row) for name, row in options.over}
    if len(over) < len(options.over):
        raise ValueError("expected each name once after --over; an axis has one row of values")
    if options.workers is not None and options.workers < 1:
        raise ValueError(f"expected one worker or more, found {options.workers}")
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
    with _executor(options) as executor:
        runs = sweep(
            problem, over, executor=executor, tol=options.tol, resume=options.resume,
            record="index" if options.index else None,
            progress=_bar(clock) if sys.stderr.isatty() else None,
        )  # fmt: skip
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
    elif (options.workers or 1) > 1:
        from concurrent.futures import ProcessPoolExecutor
        from multiprocessing import get_context

        with ProcessPoolExecutor(options.workers, mp_context=get_context("spawn")) as pool:
            yield pool
    else:
        yield None


def _bar(started: float) -> Callable[[int, int, int], None]:
    """Return what tells of a sweep on a terminal: a bar, the rate, and what failed."""
    from actionopt.tools.progress import progress

    def told(done: int, total: int, failed: int) -> None:
        rate = done / (perf_counter() - started)
        progress(done, total, f"{rate:.0f}/s" + (f", {failed} failed" if failed else ""))

    return told


def _print_runs(runs: Runs, seconds: float) -> None:
    """Print what came of a sweep."""
    import numpy as np

    def counted(values: Any) -> str:
        found = zip(*np.unique(values, return_counts=True), strict=True)
        return ", ".join(f"{count} {value}" for value, count in found)

    solved = runs.action[runs.success]
    rows = [
        ("status", counted(runs.status)),
        ("action", f"{solved.min():.9g} to {solved.max():.9g}" if solved.size else "none"),
        ("largest error", f"{runs.error[runs.success].max(initial=0.0):.1e}"),
    ]
    if runs.index is not None:
        found = np.unique(runs.index[runs.success], return_counts=True)
        rows.append(("index", ", ".join(f"{k} of {n}" for k, n in zip(*found, strict=True))))
    rows += [
        ("branches", str(runs.branch.max(initial=-1) + 1)),
        ("time", f"{_seconds(seconds)}, {runs.stats['tasks']} tasks"),
    ]
    print(f"{runs.problem.name}: {runs.grid.size} paths{', interrupted' * runs.interrupted}")
    print_table(rows)


def _explore(options: argparse.Namespace) -> int:
    problem, guess = _question(options.scene, dict(options.settings))
    from actionopt import plot

    units = plot.Units() if options.scene.endswith(".py") else plot.SI  # as all scenes are
    plot.explore(problem, guess=guess, units=units).show()
    return 0


def _question(name: str, settings: dict[str, Any]) -> tuple[Problem, Any]:
    """Return the problem of a scene or of a user's file, and a guess if it has one."""
    from actionopt import scenes

    own = name.endswith(".py")
    found = scenes.from_file(Path(name), settings) if own else scenes.get(name, **settings)
    return (found.problem, found.guess) if isinstance(found, scenes.Scene) else (found, None)


def _contradiction(forward: dict[str, Any]) -> str:
    whole = "" if math.isnan(forward["position"]) else f"{forward['position']:.1e}, and by "
    return (
        "expected a motion that forward integration repeats, found that it leaves the path by "
        f"{whole}{forward['local']:.1e} from piece to piece, where "
        f"{forward['allowed']:.1e} is compatible with the error estimate: the path is no motion; "
        "try a smaller --tol, or a problem with a guess nearer the motion"
    )


def report(solution: Solution, *, compare: bool = True) -> dict[str, Any]:
    """Return what is worth knowing of a solution as plain data; `--json` prints it.

    What the action is there, the forward deviation and the energy drift take longer than small
    solves, and are left out if `compare` is False. A path without an index, as a
    forced one is, has null there.
    """
    question = solution.problem
    found: dict[str, Any] = {
        "name": question.system.name,
        "verdict": solution.status.value,
        "action": solution.action,
        "error": solution.error,
        **({"duration": solution.duration} if (question.asked or question).free_time else {}),
        "mesh": {"elements": solution.mesh.elements, "degrees": solution.mesh.degrees},
        **solution.stats,
    }
    if compare:
        found["kind"] = found["morse_index"] = None
        with suppress(ValueError):
            found["kind"], found["morse_index"] = solution.kind, solution.morse_index
    if compare and not solution.contacts:
        clock = perf_counter()
        comparison = solution.compare()
        found["forward"] = {name: getattr(comparison, name) for name in FORWARD}
        found["time"] = found["time"] | {"compare": perf_counter() - clock}
    if solution.contacts:
        found["contacts"] = [vars(arc) for arc in solution.contacts]
    return found


def _print_report(found: dict[str, Any]) -> None:
    rows = [("action", f"{found['action']:.12g}"), ("error estimate", f"{found['error']:.1e}")]
    if "duration" in found:
        rows.insert(1, ("duration found", f"{found['duration']:.12g}"))
    if "kind" in found:
        kind = "no index: the path is forced, or its neighbours are not determined"
        if found["kind"] is not None:
            kind = f"{found['kind']}, index {found['morse_index']}"
        rows.append(("the action is", kind))
    if "forward" in found:
        forward = found["forward"]
        rows += [
            ("forward deviation", _judged(forward)),
            ("energy drift", f"{forward['energy_drift']:.1e}"),
        ]
    for arc in found.get("contacts", ()):
        rows.append(("contact", f"row {arc['row']}, from {arc['begin']:.6g} to {arc['end']:.6g}"))
    degrees = found["mesh"]["degrees"]
    span = f"{min(degrees)} to {max(degrees)}" if min(degrees) < max(degrees) else f"{degrees[0]}"
    iterations = (f"{count} {who}" for who, count in found["iterations"].items())
    times = (f"{what} {_seconds(t)}" for what, t in found["time"].items() if what != "total")
    constrained = f", {found['rows']} rows of constraints" if found["rows"] else ""
    rows += [
        ("unknowns", f"{found['unknowns']}{constrained}"),
        ("mesh", f"{found['mesh']['elements']} elements of degree {span}"),
        ("iterations", ", ".join(iterations)),
        ("time", ", ".join(times)),
    ]
    print(f"{found['name'] or 'problem'}: {found['verdict']}")
    print_table(rows)


def _judged(forward: dict[str, Any]) -> str:
    """Return what the forward integration says of the path."""
    verdict = {True: "agrees", False: "contradicts the path", None: "cannot tell"}
    found = (
        f"{forward['local']:.1e} from piece to piece, cannot be followed to the end"
        if math.isnan(forward["position"])
        else f"{forward['position']:.1e}, the integration itself uncertain by "
        f"{forward['reference_error']:.1e}"
    )
    because = f": {forward['reason']}" if forward["reason"] else ""
    return f"{found}: {verdict[forward['agrees']]}{because}"


def _seconds(time: float) -> str:
    return f"{time:.3g} s" if time >= 1 else f"{1e3 * time:.3g} ms"


def _plain(value: Any) -> Any:
    """Return `value` as JSON has it: no numpy types, null for what is not finite."""
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    return None if isinstance(value, float) and not math.isfinite(value) else value
