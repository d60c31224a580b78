"""A page of what solvers do along the dials, and of where they do not agree."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from actionopt.suite import FAMILIES, profile
from actionopt.suite.dials import DIALS, Dial
from actionopt.suite.page import figure, table
from actionopt.suite.page import write as write_page
from actionopt.suite.solvers import is_counted
from actionopt.suite.verdict import UNSCORED, verdict

Records = Sequence[Mapping[str, Any]]
HARD_HESSIANS = 50  # Hessians that make a problem hard
FALLS = "f is unbounded below, and Ipopt does not stop before x is beyond 1e20"
DIAL_PAGE = """\
<p>One parameter of a family is turned from easy to hard; mesh and starting point stay. Counted are
the gradients that a solver evaluates, which are about its iterations; filled where it is right as a
minimiser (a local minimum no higher than the known optimum, or "unbounded" where f is), hollow
where it is not. The tables have the verdicts, too.</p>
{dials}
<h2>Where they do not agree</h2>
<p>The {solvers} solvers that were run along the dials come to different verdicts on {apart} of
{members} members; to run out of time is not counted as a verdict.</p>
{names}
<h2>What is hard for Ipopt</h2>
<p>With its defaults Ipopt takes more than {many} Hessians on {count} families, or fails.</p>
{hard}
"""


def on_a_dial(record: Mapping[str, Any]) -> bool:
    """Whether a record is of a member that is there for a dial alone."""
    return any(dial.value(record) is not None for dial in DIALS.values())


def write(records: Records, folder: Path) -> Path:
    """Write `dials.html` and its figures on the last records of each cell; return the page."""
    rows = hard(records)
    body = DIAL_PAGE.format(
        dials="\n".join(filter(None, (_dial(dial, records, folder) for dial in DIALS.values()))),
        hard=table(["family", "Hessians", "verdict", "why"], rows),
        many=HARD_HESSIANS,
        count=len(rows),
        **_disagreement(records),
    )
    return write_page(folder / "dials.html", "Solvers along the dials", body)


def _dial(dial: Dial, records: Records, folder: Path) -> str:
    mine = [r for r in records if dial.value(r) is not None and r["outcome"] not in UNSCORED]
    if not mine:
        return ""
    solvers = list(dict.fromkeys(r["solver"] for r in mine))
    curves: dict[str, Any] = dict.fromkeys(dict.fromkeys(r["solver"] for r in records))
    sloped = any(r.get("evaluations", {}).get("grad") for r in mine)  # else nothing is drawn
    for solver in filter(is_counted, solvers if sloped else ()):
        own = [r for r in mine if r["solver"] == solver and r["outcome"] == "answered"]
        own.sort(key=lambda r: dial.values.index(dial.value(r)))
        if own:
            curves[solver] = (
                np.array([dial.value(r) for r in own], dtype=float),
                np.array([max(r["evaluations"].get("grad", 0), 1) for r in own], dtype=float),
                np.array([verdict(r, "minimise") == "right" for r in own], dtype=bool),
            )
    found = {(dial.value(r), r["solver"]): _cell(r) for r in mine}
    rows = [[f"{v:g}", *(found.get((v, s), "") for s in solvers)] for v in dial.values]
    mesh = f"{dial.elements} elements of degree {dial.degree}, " if dial.elements else ""
    return "\n".join(
        [
            f"<h2>{escape(dial.name.capitalize())}</h2>",
            f"<p>{escape(dial.family)}, {mesh}from {dial.start!r}: {escape(dial.parameter)} sets "
            f"{escape(dial.shows)}.</p>",
            _figure(curves, folder, dial) if any(curves.values()) else "",
            table([dial.parameter, *solvers], rows),
        ]
    )


def _figure(curves: Mapping[str, Any], folder: Path, dial: Dial) -> str:
    from actionopt.plot import profiles as draw  # matplotlib only where something is drawn

    ax = draw.dial(curves, xlabel=dial.parameter)
    if dial.values[0] > 0 and dial.values[-1] > 50 * dial.values[0]:
        ax.set_xscale("log")
    return figure(ax, folder, f"dial_{dial.name.replace(' ', '_')}", dial.name)


def _cell(record: Mapping[str, Any]) -> str:
    said = verdict(record, "minimise")
    count = record.get("evaluations", {}).get("grad")
    return f"{count} {said}" if count else said


def disagreeing(records: Records) -> tuple[list[tuple], int]:
    """Return the members on which solvers come to different verdicts as minimisers, of how many.

    Those on which two solvers at least are scored. To run out of time is no verdict here, but the
    machine's.
    """
    found: dict[tuple, list[str]] = {}
    for r in records:
        if r["outcome"] not in (*UNSCORED, "limit"):
            found.setdefault(profile.question_key(r), []).append(verdict(r, "minimise"))
    several = {member: said for member, said in found.items() if len(said) > 1}
    return [member for member, said in several.items() if len(set(said)) > 1], len(several)


def _disagreement(records: Records) -> dict[str, Any]:
    solvers = dict.fromkeys(r["solver"] for r in records if on_a_dial(r))
    apart, members = disagreeing([r for r in records if r["solver"] in solvers])
    names = (name + "".join(f", {k} = {v:g}" for k, v in rest) for name, _, _, _, *rest in apart)
    return {
        "apart": len(apart),
        "members": members,
        "solvers": escape(", ".join(solvers)),
        "names": f"<p>{escape('; '.join(names))}.</p>" if apart else "",
    }


def hard(records: Records) -> list[list[str]]:
    """Return the families that are hard for Ipopt and say why: Hessians, verdict, and why."""
    rows = []
    for r in records:
        family = FAMILIES.get(r["problem"])
        if family is None or r["solver"] != "ipopt" or r.get("parameters"):
            continue
        why = family.why or FALLS * ("unbounded below" in family.tags)
        count, said = r.get("evaluations", {}).get("hess", 0), verdict(r, "minimise")
        if why and (count > HARD_HESSIANS or said in ("wrong", "failed")):
            rows.append([family.name, str(count or ""), said, why])
    return rows
