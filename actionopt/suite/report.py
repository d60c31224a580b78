"""A report on runs: verdicts in both modes, profiles and evaluations, as a page and its figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path, PurePath
from statistics import median
from typing import Any

from actionopt.suite import FAMILIES, MODELS, dial_report, member, profile
from actionopt.suite.dial_report import on_a_dial
from actionopt.suite.dials import DIALS
from actionopt.suite.page import figure, table
from actionopt.suite.page import write as write_page
from actionopt.suite.runner import Limits, tally
from actionopt.suite.solvers import CHANGED_DEFAULTS, is_counted
from actionopt.suite.verdict import ACCURACIES, UNSCORED, VERDICT_MODES, meaning, verdict

RUNS_PAGE = """\
<p>{cells} runs: {solvers} solvers on {problems} problems, {dates}, {machines}; {packages}. Every
solver has its own default options{changed}. Two questions are put to each answer: whether it is
what a <em>minimiser</em> should say, and whether it is the <em>stationary</em> point that is known,
be it a saddle. It is judged by the point returned; of the solver's word, "unbounded" and
"infeasible" may be right. To claim an optimum that is none, or no bottom where there is one, is
wrong; "infeasible" of what is feasible is a failure, as solvers say it of where they came
to.{models}</p>
{modes}
<h2>Data profiles</h2>
<p>Fraction of problems for which so many evaluations of f, over n + 1, brought f within tau of the
least known, as Mor&eacute; and Wild have it: f(x) - f_L &le; tau |f(x0) - f_L|; with constraints,
at a violation of no more than tau. Only the {bounded} problems that have a least f.</p>
{data}
<h2>Evaluations</h2>
<p>Median over the right answers of minimisers, counted in the functions that the solver is given:
a call that returns f and c is one of each, a product with a Hessian is no Hessian. Seconds are
those of the processor. There are {repeats} solves of each problem, all in one process: the first is
counted, of the others, which carry no counting, the least time is taken (of solves that take a
second there is one). Spread is the largest of their times over the least, the median over answers
of {shortest:g} s or more. Where solves of one problem end at different answers, the worst is its
verdict: the last column says on how many. The functions of SciPy's solvers are called from Python,
and take longer.</p>
{evaluations}
<h2>Solvers</h2>
<p>The time allowed is that of the processor, for one solve; the load is how many programs the
machine had to run at once, and the clock ran so many times as long as the processor was used (the
medians). Who waits is not counted; who shares the processor's caches with others is slower.</p>
{versions}
<h2>Problem by problem</h2>
{matrices}
{unknown}{mistakes}{dials}<p>Made by</p>
<pre>{commands}</pre>
"""

MODELS_TOLD = """
{} of the problems are models, written down as they are, without a mesh: infeasible ones, bounds and
control, fields in the plane, least squares, complementarity, small ones."""

SECTION = """\
<h2>Asked to {verb}</h2>
<dl>{meanings}</dl>
<p>Within {loose:g} of the point, in units of the coordinates; in parentheses, right within
{tight:g}.</p>
{verdicts}
<p>Right by class: objective Linear, Quadratic, a Sum of squares or Other; constraints Unconstrained
(none), Bounds alone, Linear, Quadratic or Other.</p>
{classes}
<p>Performance profiles, as Dolan and Mor&eacute; have them: fraction of problems solved within so
many times the cost of the best solver for each. Of those that a solver takes at all: one that takes
no constraints has fewer. Times of less than {shortest:g} s measure calls of functions, not solvers:
problems that some solver has done sooner are left out where time is drawn.</p>
{figures}
"""
VERBS = {"minimise": "minimise", "stationary": "find the stationary point"}

LIMITS, REPEATS = Limits(), 3
COSTS = {
    "seconds": "processor time over that of the fastest",
    "f": "evaluations of f over the fewest",
}
COUNTED = ("f", "grad", "c", "jac", "hess", "hprod")

Records = Sequence[Mapping[str, Any]]


def write(records: Records, directory: str | Path) -> Path:
    """Write `index.html` and its figures to a directory; return the page.

    Of a cell that was run more than once the last record counts.

    Raises ValueError if there are no records.
    """
    if not records:
        raise ValueError("expected results of at least one run, found none")
    latest = {(profile.question_key(r), r["solver"]): r for r in records}
    records = _in_order([{**r, "solver": _short(r["solver"])} for r in latest.values()])
    folder = Path(directory)
    folder.mkdir(parents=True, exist_ok=True)
    every, records = records, [r for r in records if not on_a_dial(r)] or records
    ran = [r for r in records if r["outcome"] != "absent"]
    models = {profile.question_key(r) for r in records if r["problem"] in MODELS}
    tables = {tau: profile.evaluations_per_unknown(records, tau) for tau in profile.TAUS}
    data = [
        _figure(
            _of_all(profile.data(table), records),
            folder,
            f"data_{tau:.0e}",
            f"evaluations of f / (n + 1), tau = {tau:g}",
        )
        for tau, table in tables.items()
    ]
    body = RUNS_PAGE.format(
        dials=_dials(every, folder),
        cells=len(records),
        solvers=len({r["solver"] for r in records}),
        problems=len({profile.question_key(r) for r in records}),
        models=MODELS_TOLD.format(len(models)) if models else "",
        dates=_span(records, "date"),
        machines=_span(records, "machine"),
        packages=_span(records, "package"),
        changed="".join(
            f" (but {escape(name)}: {escape(how)})"
            for name, how in CHANGED_DEFAULTS.items()
            if any(r["solver"].partition(":")[0] == name for r in records)
        ),
        modes="\n".join(_section(mode, records, folder) for mode in VERDICT_MODES),
        bounded=max(len(row) for row in next(iter(tables.values())).values()) if ran else 0,
        data="\n".join(data),
        repeats=_span(records, "repeats"),
        shortest=profile.LEAST_TIMED,
        evaluations=_evaluations(ran),
        versions=_versions(records),
        matrices="\n".join(
            f"<h3>{VERBS[mode]}</h3>{_matrix(records, mode)}" for mode in VERDICT_MODES
        ),
        unknown=_unknown(records),
        mistakes=_mistakes(records),
        commands=_commands(every),
    )
    return write_page(folder / "index.html", "Solvers on stationary-action problems", body)


def _dials(records: Records, folder: Path) -> str:
    if not any(map(on_a_dial, records)):
        return ""
    page = dial_report.write(records, folder)
    link = f'<a href="{page.name}">along the dials</a>'
    return f"<p>Families from easy to hard, and where solvers differ: {link}.</p>"


def _in_order(records: Records) -> Records:
    """Return the records problem by problem, the solvers with most right minima first."""
    right = tally(records, VERDICT_MODES[0])
    place = {name: k for k, name in enumerate((*FAMILIES, *MODELS))}
    seen = {where: k for k, where in enumerate(dict.fromkeys(map(profile.question_key, records)))}
    return sorted(
        records,
        key=lambda r: (
            place.get(r["problem"], len(place)),
            seen[profile.question_key(r)],
            -right[r["solver"]]["right"],
            r["solver"],
        ),
    )


def _of_all(steps: Mapping[str, Any], records: Records) -> dict[str, Any]:
    """Return them in one order of all solvers, so that each has one colour in all figures."""
    return {solver: steps.get(solver) for solver in _by_solver(records)}


def _section(mode: str, records: Records, folder: Path) -> str:
    images = []
    for measure, title in COSTS.items():
        for accuracy in ACCURACIES:
            steps = profile.performance(profile.costs(records, measure, mode, accuracy))
            steps = _of_all(steps, records)
            name = f"{mode}_{measure}_{accuracy:.0e}"
            images.append(_figure(steps, folder, name, f"{title} (within {accuracy:g})", 1.0))
    loose, tight = ACCURACIES
    return SECTION.format(
        verb=VERBS[mode],
        meanings="".join(f"<dt>{v}</dt><dd>{escape(m)}</dd>" for v, m in meaning(mode).items()),
        loose=loose,
        tight=tight,
        verdicts=_verdicts(records, mode),
        classes=_classes(records, mode),
        shortest=profile.LEAST_TIMED,
        figures="\n".join(images),
    )


def _figure(steps: Mapping, folder: Path, name: str, title: str, least: float = 0.01) -> str:
    from actionopt.plot import profiles as draw  # matplotlib only where something is drawn

    return figure(draw.profiles(steps, xlabel=title, least=least), folder, name, title)


def _short(solver: str) -> str:
    """Return a solver's name without the folders of its file or program."""
    place, colon, name = solver.rpartition(":")
    if place == "asl":
        return f"asl:{PurePath(name).name}"
    return f"{PurePath(place).name}{colon}{name}" if place.endswith(".py") else solver


def _span(records: Records, name: str) -> str:
    """Return all values of an entry there are."""
    values = sorted({str(r[name]) for r in records if name in r})
    return escape(
        f"{values[0]} to {values[-1]}" if name == "date" and values[1:] else "; ".join(values)
    )


def _commands(records: Records) -> str:
    """Return the commands that make these records, and the report."""
    groups: dict[tuple[str, ...], dict[str, list[str]]] = {}
    for r in records:
        dial = next((d.name for d in DIALS.values() if d.value(r) is not None), "")
        family = FAMILIES.get(r["problem"])
        options = [
            f"--{name} {r[name]}"
            for name in ("elements", "degree")
            if name in r and (family is None or r[name] != getattr(family, name))
        ]
        if "start" in r and r["start"] != r.get("own_start", r["start"]):
            options.append(f"--start {r['start']}")
        options += [f"--set {k}={v}" for k, v in r.get("parameters", {}).items()]
        if dial:
            options = [f"--dial '{dial}'"]
        elif r["problem"] in MODELS:
            options.insert(0, "--models")
        for name, value, usual in (
            ("repeats", r.get("repeats", REPEATS), REPEATS),
            ("seconds", r.get("allowed", LIMITS.seconds), LIMITS.seconds),
            ("memory", r.get("memory", LIMITS.memory), LIMITS.memory),
        ):
            if value != usual:
                options.append(f"--{name} {value:g}")
        groups.setdefault(tuple(options), {}).setdefault(r["solver"], []).append(r["problem"])
    lines = []
    for options, by_solver in groups.items():
        alike: dict[tuple[str, ...], list[str]] = {}
        for solver, problems in by_solver.items():
            alike.setdefault(tuple(sorted(set(problems))), []).append(solver)
        for problems, names in alike.items():
            every = set(problems) == set(MODELS if "--models" in options else FAMILIES)
            dialled = any(option.startswith("--dial") for option in options)
            chosen = [] if every or dialled else [f"--problem {name}" for name in problems]
            words = [*(f"--solver {name}" for name in names), *options, *chosen]
            lines.append(" \\\n  ".join(["actionopt suite run", *words]))
    return escape("\n".join([*lines, "actionopt suite report --to DIRECTORY"]))


def _verdicts(records: Records, mode: str) -> str:
    names, rows = list(meaning(mode)), []
    loose, tight = ACCURACIES
    for solver, mine in _by_solver(records).items():
        found = [verdict(r, mode, loose) for r in mine]
        exact = sum(verdict(r, mode, tight) == "right" for r in mine)
        counts = [str(found.count(name)) for name in names]
        rows.append([solver, f"{counts[0]} ({exact})", *counts[1:]])
    return table(["solver", *names], rows)


def _classes(records: Records, mode: str) -> str:
    classes = sorted({r["class"][:2] for r in records if "class" in r})
    letters = {profile.question_key(r): r["class"][:2] for r in records if "class" in r}
    rows = []
    for solver, mine in _by_solver(records).items():
        scored = [r for r in mine if r["outcome"] not in UNSCORED]
        kinds = [
            (letters.get(profile.question_key(r)), verdict(r, mode) == "right") for r in scored
        ]
        counts = ([right for kind, right in kinds if kind == wanted] for wanted in classes)
        rows.append([solver, *(f"{sum(c)} / {len(c)}" for c in counts)])
    return table(["solver", *classes], rows)


def _evaluations(records: Records) -> str:
    rows = []
    for solver, every in _by_solver(records).items():
        mine = [r for r in every if verdict(r, "minimise") == "right"]
        cells = [""] * (len(COUNTED) + 2)
        if mine:
            counts = (median(r["evaluations"].get(name, 0) for r in mine) for name in COUNTED)
            shown = [f"{c:.0f}" for c in counts] if is_counted(solver) else [""] * len(COUNTED)
            bare = [r.get("times", ())[1:] for r in mine if r["seconds"] >= profile.LEAST_TIMED]
            spread = [max(times) / min(times) for times in bare if len(times) > 1]
            seconds = f"{median(r['seconds'] for r in mine):.2g}"
            cells = [*shown, seconds, f"{median(spread):.2f}" if spread else ""]
        differ = sum("differing" in r for r in every)
        rows.append([solver, *cells, str(differ or "")])
    return table(["solver", *COUNTED, "seconds", "spread", "differ"], rows)


def _versions(records: Records) -> str:
    rows = []
    for solver, mine in _by_solver(records).items():
        least = min((r["allowed"] for r in mine if "allowed" in r), default=LIMITS.seconds)
        loads = [r["load"] for r in mine if "load" in r]
        waits = [r["wall"] / r["processor"] for r in mine if r.get("processor")]
        shown = [f"{median(values):.1f}" if values else "" for values in (loads, waits)]
        versions = "; ".join(sorted({r.get("content", "") for r in mine}))
        rows.append([solver, versions, f"{least:g} s", *shown])
    return table(["solver", "version", "time allowed", "load", "clock / processor"], rows)


def _by_solver(records: Records) -> dict[str, list[Mapping[str, Any]]]:
    names = dict.fromkeys(r["solver"] for r in records)
    return {name: [r for r in records if r["solver"] == name] for name in names}


def _matrix(records: Records, mode: str) -> str:
    names = list(dict.fromkeys(r["solver"] for r in records))
    found = {(profile.question_key(r), r["solver"]): verdict(r, mode) for r in records}
    about: dict[tuple, Mapping[str, Any]] = {}
    for r in records:
        if "class" in r:
            about.setdefault(profile.question_key(r), r)
    rows = []
    for where in dict.fromkeys(profile.question_key(r) for r in records):
        r = about.get(where, {})
        tags = FAMILIES[where[0]].tags if where[0] in FAMILIES else ()
        if where[0] in MODELS:
            tags = member(where[0]).tags
        mesh = "" if where[1] is None else f"{where[1]} x {where[2]}"
        f = f"{r['f_star']:.6g}" if "f_star" in r else "infeasible" * bool(r.get("infeasible"))
        settings = ", ".join(f"{k} = {v}" for k, v in where[4:])
        name = f"{where[0]} ({settings})" if settings else where[0]
        facts = [
            r.get("class", ""),
            mesh,
            where[3] or "",
            f,
            ", ".join(tags),
        ]
        rows.append([name, *facts, *(found.get((where, solver), "") for solver in names)])
    return table(["problem", "class", "mesh", "start", "f*", "", *names], rows)


def _unknown(records: Records) -> str:
    """Return what was found and not known: `actionopt.suite.learn` keeps it."""
    found = [r for r in records if r.get("at") == "new"]
    if not found:
        return ""
    rows = (
        [
            r["problem"],
            r["solver"],
            f"{r['f_there']:.8g}",
            f"{r['f_star']:.8g}",
            str(r.get("index")),
        ]
        for r in found
    )
    shown = table(["problem", "solver", "f", "f*", "index"], rows)
    return f"<h2>Stationary points that were not known</h2>{shown}"


def _mistakes(records: Records) -> str:
    found = {r["solver"]: r.get("trace", "") for r in records if r["outcome"] == "error"}
    if not found:
        return ""
    texts = (f"<p>{escape(name)}</p><pre>{escape(trace)}</pre>" for name, trace in found.items())
    return f"<h2>Mistakes in solvers' files</h2>{''.join(texts)}"
