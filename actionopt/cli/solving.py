"""`actionopt solve`: solve a question, and compare the path with forward integration."""

from __future__ import annotations

import argparse
import json
import math
from contextlib import suppress
from time import perf_counter
from typing import TYPE_CHECKING, Any

from actionopt.cli.question import add_question, question, seconds
from actionopt.tools.table import print_table

if TYPE_CHECKING:
    from actionopt.analysis.solution import Solution

FILE_HELP = """\
A file of your own is plain Python that defines `problem` or `scene`: a Problem, a Scene, or a
function of keyword parameters that returns one. Of both names `scene` is taken. --set overrides
physical parameters of the first two and passes keywords to the last.

  actionopt solve pendulum --set g=1.62 --plot pendulum.png
  actionopt solve kepler --tol 1e-12 --json
  actionopt solve my_scene.py --set "masses=[1, 2]" --out path.npz
"""
COMPARISON_KEYS = (  # of a comparison, as --json has it
    *("agrees", "position", "velocity", "arrival", "local", "allowed"),
    *("energy_drift", "reference_error", "reason"),
)
LISTED = 6  # events; --json has all


def add_to(command: argparse.ArgumentParser) -> None:
    """Add the arguments, and what runs."""
    command.description = "Solve a scene or a file, and compare the path with forward integration."
    command.epilog, command.formatter_class = FILE_HELP, argparse.RawDescriptionHelpFormatter
    command.set_defaults(run=run)
    add = command.add_argument
    add_question(command)
    add("--tol", type=float, default=1e-8, help="bound on the relative error of the path (1e-8)")
    what = "what to ask of the action: least, only stationary, or least if it can be (auto)"
    add("--principle", choices=("auto", "least", "stationary"), default="auto", help=what)
    add("--plot", metavar="FILE", help="draw the path and the deviation (png, pdf, svg, ...)")
    add("--out", "--save", metavar="FILE.npz", help="write the solution")
    add("--json", action="store_true", help="print JSON instead of a table")
    add("--no-compare", action="store_false", dest="compare", help="no forward integration")
    add("--seconds", type=float, help="time it may take; then the best attempt is reported")


def run(options: argparse.Namespace) -> int:
    """Solve, print and write what is asked for."""
    from actionopt.solver.solve import solve
    from actionopt.tools.progress import waiting

    problem, guess = question(options)
    if options.out:
        from actionopt.analysis.saved import solution_file

        solution_file(options.out)
    if options.plot:
        from actionopt.plot._files import picture

        picture(options.plot)
    with waiting() as progress:
        asked = {name: getattr(options, name) for name in ("tol", "principle", "seconds")}
        solution = solve(problem, guess=guess, progress=progress, **asked)
    found = report(solution, compare=options.compare)
    if options.out:
        solution.save(options.out)
    if options.plot:
        from actionopt import plot

        plot.save(solution, options.plot, compare=options.compare)
    if options.json:
        print(json.dumps(_plain(found), indent=2, allow_nan=False))
    else:
        _print_report(found)
    if "forward" in found and found["forward"]["agrees"] is False:
        raise RuntimeError(_contradiction(found["forward"]))
    return 0


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
    is_compared = compare and not (solution.contacts and question.system.order == 1)
    found: dict[str, Any] = {
        "name": question.system.name,
        "verdict": solution.status.value,
        "action": solution.action,
        "error": solution.error,
        **({"duration": solution.duration} if question.original.free_time else {}),
        **({"events": events} if (events := _events_found(solution)) else {}),
        **({"impulses": solution.impulses} if question.through else {}),
        **({} if question.integral is None else {"kappa": solution.integral_multipliers}),
        "mesh": {"elements": solution.mesh.elements, "degrees": solution.mesh.degrees},
        **solution.stats,
    }
    if compare:
        found["kind"] = found["morse_index"] = None
        with suppress(ValueError):
            found["kind"], found["morse_index"] = solution.kind, solution.morse_index
    if is_compared:
        clock = perf_counter()
        comparison = solution.compare()
        found["forward"] = {name: getattr(comparison, name) for name in COMPARISON_KEYS}
        found["time"] = found["time"] | {"compare": perf_counter() - clock}
    if solution.contacts:
        found["contacts"] = [vars(arc) for arc in solution.contacts]
    return found


def _events_found(solution: Solution) -> list[dict[str, Any]]:
    """Return time and place of the events that were to be found; of ends, where the place was."""
    problem, events = solution.problem, []
    last = len(problem.joints) - 1
    for k, (asked, found) in enumerate(zip(problem.joints, problem.joints_found, strict=True)):
        is_open = None in asked.q or (asked.t is None and 0 < k < last)
        if is_open and not (problem.closes and k == last):
            name = {0: "start", last: "end"}.get(k, f"event {k}")
            place = dict(zip(problem.system.coordinates, solution(found.t), strict=True))
            events.append({"event": name, "t": found.t, **place})
    return events


def _print_report(found: dict[str, Any]) -> None:
    rows = [("action", f"{found['action']:.12g}"), ("error estimate", f"{found['error']:.1e}")]
    if "duration" in found:
        rows.insert(1, ("duration found", f"{found['duration']:.12g}"))
    for event in found.get("events", ())[:LISTED]:
        place = (f"{name} = {x:.8g}" for name, x in event.items() if name != "event")
        rows.append((f"{event['event']} found", ", ".join(place)))
    for k, impulse in enumerate(found.get("impulses", ())[:LISTED], 1):
        rows.append((f"impulse at event {k}", ", ".join(f"{x:.6g}" for x in impulse)))
    if "kappa" in found:
        multipliers = ", ".join(f"{x:.10g}" for x in found["kappa"])
        rows.append(("multipliers of integrals", multipliers))
    if "kind" in found:
        kind = "no index: the path is forced, or its neighbours are not determined"
        if found["kind"] is not None:
            kind = f"{found['kind']}, index {found['morse_index']}"
        rows.append(("the action is", kind))
    if "forward" in found:
        forward = found["forward"]
        rows += [
            ("forward deviation", _verdict(forward)),
            ("energy drift", f"{forward['energy_drift']:.1e}"),
        ]
    for arc in found.get("contacts", ()):
        rows.append(("contact", f"row {arc['row']}, from {arc['begin']:.6g} to {arc['end']:.6g}"))
    degrees = found["mesh"]["degrees"]
    span = f"{min(degrees)} to {max(degrees)}" if min(degrees) < max(degrees) else f"{degrees[0]}"
    iterations = (f"{count} {who}" for who, count in found["iterations"].items())
    times = (f"{what} {seconds(t)}" for what, t in found["time"].items() if what != "total")
    constrained = f", {found['rows']} rows of constraints" if found["rows"] else ""
    rows += [
        ("unknowns", f"{found['unknowns']}{constrained}"),
        ("mesh", f"{found['mesh']['elements']} elements of degree {span}"),
        ("iterations", ", ".join(iterations)),
        ("time", ", ".join(times)),
    ]
    print(f"{found['name'] or 'problem'}: {found['verdict']}")
    print_table(rows)


def _verdict(forward: dict[str, Any]) -> str:
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


def _plain(value: Any) -> Any:
    """Return `value` as JSON has it: no numpy types, null for what is not finite."""
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    return None if isinstance(value, float) and not math.isfinite(value) else value
