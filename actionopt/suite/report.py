"""A report on runs: verdicts, profiles, classes and evaluations, as one page and its figures."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path, PurePath
from statistics import median
from typing import Any

from actionopt.suite import profile
from actionopt.suite.runner import Limits, tally
from actionopt.suite.verdict import MEANING, VERDICTS

PAGE = """\
<!doctype html>
<html lang="en">
<meta charset="utf-8">
<title>Solvers on stationary-action problems</title>
<style>
body {{ font: 16px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto }}
table {{ border-collapse: collapse; margin: 1rem 0; font-variant-numeric: tabular-nums }}
pre {{ overflow-x: auto }}
th, td {{ padding: 0.2rem 0.7rem; border-bottom: 1px solid #ddd; text-align: right }}
th:first-child, td:first-child {{ text-align: left }}
img {{ max-width: 100% }}
.right {{ color: #007a5a }} .wrong {{ color: #b84a00; font-weight: bold }}
</style>
<h1>Solvers on stationary-action problems</h1>
<p>{cells} runs: {solvers} solvers on {problems} problems. Every solver has its own default
options. Verdicts are judged from the point returned alone: its distance to the known optimum, and
its KKT residual.</p>
<dl>{meanings}</dl>
<h2>Verdicts</h2>
{verdicts}
<h2>Performance profiles</h2>
<p>Fraction of problems solved within so many times the cost of the best solver for each. Solved
means the verdict <em>right</em>, or any stationary point, as each figure says.</p>
{figures}
<h2>By class</h2>
<p>Right answers out of problems. Objective Quadratic or Other; constraints Unconstrained (none),
Linear or Other.</p>
{classes}
<h2>Evaluations</h2>
<p>Median over the right answers, calls of all functions together; per unknown, and seconds.</p>
{evaluations}
<h2>Problem by problem</h2>
{matrix}
<p>Made by</p>
<pre>{commands}</pre>
</html>
"""

ALLOWED = Limits().seconds

RATIO = {"seconds": "time over that of the fastest", "evaluations": "evaluations over the fewest"}
SHARE = "evaluations per unknown"
# File, measure (of a performance profile, or a data profile's), accepted verdicts.
FIGURES = (
    ("performance_time", "seconds", profile.RIGHT),
    ("performance_time_any", "seconds", profile.STATIONARY),
    ("performance_evaluations", "evaluations", profile.RIGHT),
    ("data", SHARE, profile.RIGHT),
    ("data_any", SHARE, profile.STATIONARY),
)


def write(records: Sequence[Mapping[str, Any]], directory: str | Path) -> Path:
    """Write `index.html` and its figures to a directory; return the page.

    Raises ValueError if there are no records.
    """
    from actionopt.plot import profiles as draw  # matplotlib only where something is drawn

    if not records:
        raise ValueError("expected results of at least one run, found none; `actionopt suite run`")
    records = [{**r, "solver": _short(r["solver"])} for r in records]
    folder = Path(directory)
    folder.mkdir(parents=True, exist_ok=True)
    images = []
    ran = [r for r in records if r["verdict"] != "absent"]
    for name, measure, accepted in FIGURES:
        table, title = profile.costs(ran, measure, accepted), RATIO.get(measure, f"{SHARE} and one")
        steps = profile.performance(table) if measure in RATIO else profile.data(table)
        least = 1.0 if measure in RATIO else 0.01
        what = "right" if accepted is profile.RIGHT else "any stationary point"
        ax = draw.profiles(steps, xlabel=f"{title} ({what})", least=least)
        draw.save(ax, folder / f"{name}.svg")
        images.append(f'<p><img src="{name}.svg" alt="{escape(title)}, {what}"></p>')
    page = folder / "index.html"
    page.write_text(
        PAGE.format(
            cells=len(records),
            solvers=len({r["solver"] for r in records}),
            problems=len({r["problem"] for r in records}),
            meanings="".join(f"<dt>{v}</dt><dd>{escape(MEANING[v])}</dd>" for v in VERDICTS),
            verdicts=_verdicts(records),
            figures="\n".join(images),
            classes=_classes(ran),
            evaluations=_evaluations(ran),
            matrix=_matrix(records),
            commands=_commands(records),
        ),
        encoding="utf-8",
    )
    return page


def _short(solver: str) -> str:
    """Return a solver's name without the folders of its file."""
    place, colon, name = solver.rpartition(":")
    return f"{PurePath(place).name}{colon}{name}" if place.endswith(".py") else solver


def _commands(records: Sequence[Mapping[str, Any]]) -> str:
    """Return the commands that make these records, one for each time allowed, and the report."""
    asked: dict[float, list[str]] = {}
    for name, seconds in dict.fromkeys((r["solver"], r.get("allowed", ALLOWED)) for r in records):
        asked.setdefault(seconds, []).append(f"--solver {name}")
    runs = [
        " \\\n  ".join(
            [f"actionopt suite run{'' if s == ALLOWED else f' --seconds {s:g}'}", *names]
        )
        for s, names in asked.items()
    ]
    return escape("\n".join([*runs, "actionopt suite report"]))


def _verdicts(records: Sequence[Mapping[str, Any]]) -> str:
    counts = tally([dict(r) for r in records])
    rows = ([name, *(str(count[v]) for v in VERDICTS)] for name, count in counts.items())
    return _table(["solver", *VERDICTS], rows)


def _classes(records: Sequence[Mapping[str, Any]]) -> str:
    letters = {r["problem"]: r["class"][:2] for r in records if "class" in r}
    classes = sorted(set(letters.values()))
    rows = []
    for solver, mine in _by_solver(records).items():
        kinds = [(letters.get(r["problem"]), r["verdict"] == "right") for r in mine]
        counts = ([right for kind, right in kinds if kind == wanted] for wanted in classes)
        rows.append([solver, *(f"{sum(c)} / {len(c)}" for c in counts)])
    return _table(["solver", *classes], rows)


def _evaluations(records: Sequence[Mapping[str, Any]]) -> str:
    rows = []
    for solver, every in _by_solver(records).items():
        mine = [r for r in every if r["verdict"] == "right"]
        cells = ["", "", ""]
        if mine:
            counts = [profile.evaluations(r) for r in mine]
            share = [c / (r["n"] + 1) for c, r in zip(counts, mine, strict=True)]
            seconds = median(r["seconds"] for r in mine)
            cells = [f"{median(counts):.0f}", f"{median(share):.2g}", f"{seconds:.2g}"]
        rows.append([solver, *cells])
    return _table(["solver", "evaluations", "per unknown", "seconds"], rows)


def _by_solver(records: Sequence[Mapping[str, Any]]) -> dict[str, list[Mapping[str, Any]]]:
    names = dict.fromkeys(r["solver"] for r in records)
    return {name: [r for r in records if r["solver"] == name] for name in names}


def _matrix(records: Sequence[Mapping[str, Any]]) -> str:
    names = list(dict.fromkeys(r["solver"] for r in records))
    found = {(r["problem"], r["solver"]): r["verdict"] for r in records}
    rows = (
        [problem, *(found.get((problem, solver), "") for solver in names)]
        for problem in dict.fromkeys(r["problem"] for r in records)
    )
    return _table(["problem", *names], rows)


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = ["<table>", f"<tr>{''.join(f'<th>{escape(cell)}</th>' for cell in head)}</tr>"]
    for row in rows:
        lines.append(f"<tr>{''.join(map(_cell, row))}</tr>")
    return "\n".join([*lines, "</table>"])


def _cell(text: str) -> str:
    kind = f' class="{text}"' if text in VERDICTS else ""
    return f"<td{kind}>{escape(text)}</td>"
