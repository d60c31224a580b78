"""The report: figures, tables and one page of text, from the results alone."""

from __future__ import annotations

import numpy as np

from actionopt.tools.files import write as write_file
from benchmarks import analysis as an
from benchmarks import figures, problems
from benchmarks.results import DOCS, Results, table

TARGETS = [f"{t:.0e}" for t in an.TARGETS]
FOLDER = DOCS / "benchmarks"


def write(results: Results) -> None:
    """Write figures and page beside the results."""
    rows, titles = _shown(results)
    if not rows:
        return
    folder, name = results.file.parent, results.file.stem
    for kind in an.KINDS:
        figures.work_precision(rows, titles, kind, folder / f"{name}_{kind}")
    figures.profiles(rows, folder / f"{name}_profile")
    write_file(folder / f"{name}.md", page(results))


def page(results: Results) -> str:
    """Return the page."""
    rows, titles = _shown(results)
    head = _head(results, results.file.stem)
    return "\n".join([*head, *_summary(rows), *_ahead(rows, titles), *_tables(rows, titles)])


def _shown(results: Results) -> tuple[an.Rows, dict[str, str]]:
    """Return the rows in the order of the problems, and their titles."""
    titles = {case: c.title for case, c in problems.load().items()}
    return {case: results.rows[case] for case in titles if case in results.rows}, titles


def _head(results: Results, name: str) -> list[str]:
    machine, versions = results.about["machine"], results.about["versions"]
    return [
        "# Run time against error",
        "",
        "Made by `python -m benchmarks.work_precision"
        + (" --quick" if name == "quick" else "")
        + f"`; raw numbers in `{name}.json`.",
        "",
        "- *cold*: from the user's definition to the path, after imports; *again*: the same",
        "  problem with other end points, from the last answer.",
        "- error: maximum over 201 uniform times (and 100 more in either layer, where there are",
        "  layers) of |q - exact|, relative to the largest |q|.",
        "- first guess: the straight line; where a peer does not come to the reference from it, a",
        "  polyline through five points of the reference, rounded to a tenth of the largest |q|.",
        "  Another stationary path than the reference counts as not reached. A duration that is",
        "  to be found is given to one digit to those who need one, and its error counts.",
        "- time at an error: the fastest of the peer's settings that came to it, so everyone is",
        "  given its best setting in hindsight; medians of repetitions, interleaved, one thread,",
        "  in seconds of the processor.",
        "- machine: " + ", ".join(f"{k} {v}" for k, v in machine.items()),
        "- versions: " + ", ".join(f"{k} {v}" for k, v in sorted(versions.items())),
        "",
        *[f"![{kind}]({name}_{kind}.png)\n" for kind in an.KINDS],
        f"![performance profiles]({name}_profile.png)",
        "",
    ]


def _summary(rows: an.Rows) -> list[str]:
    names = sorted({p for by_peer in rows.values() for p in by_peer} - {an.OURS})
    groups = [("fastest peer", set(names)), ("fastest general peer", {*names} - {*an.SPECIAL})]
    groups += [(figures.label(p), {p}) for p in names]
    return [
        "## Against the fastest peer of each problem",
        "",
        "Ratio of its time to actionopt's, above 1 where actionopt is faster; geometric",
        "mean over the problems that both solve.",
        "",
        *table(
            ["", *TARGETS],
            [
                [f"{kind}, {name}", *(_ratios(rows, kind, t, peers) for t in an.TARGETS)]
                for kind in an.KINDS
                for name, peers in groups
            ],
        ),
        "",
        "In brackets the number of problems; +k: solved by actionopt alone; -k: by the",
        "peer alone.",
        "",
    ]


def _ratios(rows: an.Rows, kind: str, target: float, peers: set[str]) -> str:
    ratios = an.against(rows, kind, target, peers)
    both = [r for r in ratios if 0 < r < np.inf]
    only, lost = ratios.count(np.inf), ratios.count(0.0)
    cell = f"{an.geometric_mean(both):.2f} ({len(both)})" if both else "-"
    return cell + (f", +{only}" if only else "") + (f", -{lost}" if lost else "")


WHY = """\
Why: what a peer is given ready, actionopt does within its time. `solve_bvp`, shooting and Lambert's
solvers start from equations of motion, Jacobians or formulas derived by hand; actionopt is given
the Lagrangian, and traces, derives and compiles it, checks the question, chooses units, and
estimates its error: a millisecond or so on one or two coordinates, where a peer needs no more in
all (`floor.md` tells what of it CasADi takes). Lambert's solvers know Kepler's problem alone, in
closed form but for one unknown. The reference of the 10-link chain in x and y is a saddle of index
38. Without a guess actionopt prefers another path, of less action, to which the polyline leads as
well; the straight line as a guess leads to the reference.
"""


def _ahead(rows: an.Rows, titles: dict[str, str]) -> list[str]:
    found = [
        [f"{kind}, {titles[case]}", *(_faster(rows, kind, t, case) for t in an.TARGETS)]
        for kind in an.KINDS
        for case in rows
    ]
    return [
        "## Where a peer is ahead",
        "",
        "Ratio of actionopt's time to the peer's.",
        "",
        *table(["", *TARGETS], [row for row in found if any(row[1:])]),
        "",
        *WHY.splitlines(),
        "",
    ]


def _faster(rows: an.Rows, kind: str, target: float, case: str) -> str:
    times = an.table(rows, kind, target)[case]
    ours = times.get(an.OURS, np.inf)
    ahead = [(ours / t, p) for p, t in times.items() if t < ours and p != an.OURS]
    return ", ".join(
        f"{figures.label(p)} {r:.1f}" if np.isfinite(r) else f"{figures.label(p)} alone"
        for r, p in sorted(ahead, reverse=True)
    )


def _tables(rows: an.Rows, titles: dict[str, str]) -> list[str]:
    lines = []
    names = sorted({p for by_peer in rows.values() for p in by_peer}, key=figures.rank)
    head = ["problem", *map(figures.label, names)]
    for kind in an.KINDS:
        for target in an.TARGETS:
            cells = [
                [titles[case], *(_cell(times.get(p, np.inf), min(times.values())) for p in names)]
                for case, times in an.table(rows, kind, target).items()
            ]
            lines += [f"## Time in ms to an error of {target:.0e}, {kind}", ""]
            lines += [*table(head, cells, right=range(1, len(head))), ""]
    cells = [
        [titles[case], *(an.outcome(by_peer[p]) if p in by_peer else "not run" for p in names)]
        for case, by_peer in rows.items()
    ]
    times = an.costs(rows, "cold", 1e-6)  # of those that can express any
    solved = [np.isfinite(times.get(p, [])).sum() for p in names]
    return [
        *lines,
        "## How they fared (cold, to 1e-6)",
        "",
        "Empty: solved from the straight line. Otherwise what it took, or what it said.",
        "",
        *table(head, [*cells, ["**solved**", *(f"{s} of {len(rows)}" for s in solved)]]),
        "",
    ]


def _cell(seconds: float, best: float) -> str:
    if not np.isfinite(seconds):
        return "-"
    text = f"{seconds * 1e3:.3g}" if seconds < 1 else f"{seconds * 1e3:.0f}"
    return f"**{text}**" if seconds == best else text
