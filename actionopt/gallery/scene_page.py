"""The page of one scene."""

from __future__ import annotations

import io
from contextlib import redirect_stdout, suppress

import numpy as np

from actionopt import scenes
from actionopt.analysis.solution import Solution
from actionopt.gallery import film, units
from actionopt.gallery.facts import known
from actionopt.gallery.figures import figures
from actionopt.gallery.page import Page, escape, frame, number, prose, table, typeset
from actionopt.gallery.subject import Subject
from actionopt.gallery.texts import Texts, texts
from actionopt.plot import SI
from actionopt.plot.live.page import SCRIPTS, figure
from actionopt.tools.mathml import mathml, symbol

PROGRAM = """\
import actionopt as ao
from actionopt import scenes

scene = scenes.get("{name}")
solution = ao.solve(scene.problem, tol=1e-10, guess=scene.guess)

print("action", solution.action, "J s, error of the path", solution.error)
print("momenta", *solution.momenta)
print("forward integration leads elsewhere by", solution.compare().position)
"""
LIVE = (
    "Arrow keys move a handle as well, with Shift in small steps. Triangles on the duration are "
    "times conjugate to the start, at which the index changes."
)
VERDICT = 'print("a", solution.kind, "of the action, index", solution.morse_index)\n'


def scene_page(name: str) -> Page:
    """Return the page of the scene `name`."""
    scene, words = scenes.get(name), texts(name)
    program, output, solution = run(name, scene.problem.system.structure.forced)
    s = Subject(scene, solution)
    drawn, without = figures(s)
    pictures = "".join(f"<figure><h3>{f.title}</h3>\n{f.html()}\n" for f in drawn)
    title = scene.title[0].upper() + scene.title[1:]
    main = f"""<article class="scene">
<header class="title">
<p class="crumb"><a href="../index.html">All scenes</a></p>
<h1>{typeset(title)}</h1>
<p class="tags">{"".join(f"<span>{escape(tag)}</span>" for tag in tags(s))}</p>
</header>
<section class="opening" aria-label="Statement">
<div>
<p class="statement">{typeset(words.statement)}</p>
{_formulas(s, words)}
<pre class="sketch" tabindex="0" role="img" aria-label="Sketch: {escape(words.statement)}">
{escape(words.sketch)}
</pre>
{prose(words.remarks)}
<p class="source">{escape(scene.source)}</p>
</div>
{film.film(s)}
</section>
<section><h2>The path under your hand</h2>
{figure(solution.problem, solution, units=SI, draw=scene.draw, caption=LIVE)}
</section>
<section><h2>The question</h2>
<div class="columns">
{_parameters(s)}
{_events(s)}
</div>
<div class="usage"><p>With other numbers, <code>scenes.get("{name}", &hellip;)</code>:</p>
{prose(words.usage)}</div>
</section>
<section><h2>What is known, and what was found</h2>
{_known(s)}
{_found(s)}
</section>
<section><h2>Figures</h2>
<div class="figures">
{pictures}
{_relaxing(s)}
</div>
{_without(without)}
</section>
<section><h2>The program</h2>
<p>This program was run for this page; below it is what it printed.</p>
{_code("Program", program)}
{_code("Output", output)}
<p>The system it solves:</p>
{_code("System", words.source)}
</section>
</article>"""
    html = frame(
        f"{title} - actionopt",
        main,
        root="../",
        description=scene.title,
        scripts=["film.js", *SCRIPTS],
    )
    files = {f"{name}/{figure.name}.svg": figure.svg for figure in drawn}
    files[f"{name}/thumbnail.svg"] = film.thumbnail(s)
    return Page({f"{name}/index.html": html, **files}, tags(s), s.motion)


def run(name: str, forced: bool) -> tuple[str, str, Solution]:
    """Run the program of a scene; return it, what it printed, and its solution."""
    program = PROGRAM.format(name=name) + ("" if forced else VERDICT)
    output, names = io.StringIO(), {}
    with redirect_stdout(output):
        exec(compile(program, f"<{name}>", "exec"), names)
    return program, output.getvalue(), names["solution"]


def tags(s: Subject) -> tuple[str, ...]:
    """Return words for what a scene is: coordinates, constraints, verdict."""
    system = s.solution.problem.system
    found = ["1 coordinate" if system.n == 1 else f"{system.n} coordinates"]
    if system.m:
        found.append("1 constraint" if system.m == 1 else f"{system.m} constraints")
    if system.structure.depends_on_time:
        found.append("depends on time")
    return (*found, "drag" if s.forced else s.verdict)


def _formulas(s: Subject, words: Texts) -> str:
    system = s.solution.problem.system
    scalars = {*system.coordinates, *system.parameters}
    if system.n == 1:
        scalars.add("Q")
    rows = []
    for formula in words.formulas:
        remark = f'<span class="remark">{typeset(formula.remark)}</span>' if formula.remark else ""
        rows.append(
            f'<div class="formula scroll" tabindex="0" role="region" aria-label="Formula">'
            f"{mathml(formula, scalars)}{remark}</div>"
        )
    return "\n".join(rows)


def _parameters(s: Subject) -> str:
    name, problem = s.scene.name, s.solution.problem
    values = problem.system.table.values(problem.parameters)
    rows = [
        (symbol(key), number(float(value), 8), units.html(units.unit(name, key)))
        for key, value in values.items()
    ]
    return table("Parameters", ("", "value", "unit"), rows)


def _events(s: Subject) -> str:
    names, start, end = s.solution.problem.system.coordinates, s.solution.start, s.solution.end
    rows = [
        (symbol(name), number(a, 8), number(b, 8), units.html(SI.coordinate(name)))
        for name, a, b in zip(names, start.q, end.q, strict=True)
    ]
    head = ("", f"at {number(start.t, 8)} s", f"at {number(end.t, 8)} s", "unit")
    return table("The two events", head, rows)


def _known(s: Subject) -> str:
    rows = [
        (r.what, r.expected, r.found, "" if r.difference is None else number(r.difference, 2))
        for r in known(s)
    ]
    if not rows:
        return "<p>No closed form is known; forward integration is the check.</p>"
    head = ("", "known exactly", "found", "relative difference")
    return table("Known and found", head, rows, kind="numbers")


def _found(s: Subject) -> str:
    solution = s.solution
    names, (p0, p1) = solution.problem.system.coordinates, solution.momenta
    comparison = solution.compare()
    H = solution.energy(s.t)
    rows = [
        ("action S", f"{number(solution.action, 12)} J s"),
        ("estimated error of the path, relative", number(solution.error, 2)),
        (
            "deviation of forward integration, relative",
            escape(comparison.reason) or number(comparison.position, 2),
        ),
        ("energy function H at the start and the end", _pair(H[0], H[-1], "J")),
        *(
            (f"momentum of {symbol(name)} at the start and the end", _pair(a, b, SI.momentum(name)))
            for name, a, b in zip(names, p0, p1, strict=True)
        ),
        *([] if s.forced else [("the action is", escape(s.verdict))]),
        ("mesh", f"{solution.mesh.elements} elements, {solution.mesh.nodes.size} nodes"),
    ]
    return table("Found from the path", ("", "value"), rows, kind="numbers")


def _pair(a: float, b: float, unit: str) -> str:
    a, b = (0.0 if abs(x) <= 1e-12 * max(abs(a), abs(b), 1.0) else x for x in (a, b))
    if np.isclose(a, b, rtol=1e-8, atol=1e-10):
        return f"{number(float(b), 10)} {units.html(unit)}, the same"
    return f"{number(float(a), 10)} and {number(float(b), 10)} {units.html(unit)}"


def _relaxing(s: Subject) -> str:
    """Return the film of a relaxation, where one plane shows it and there is one."""
    with suppress(ValueError):
        if s.plane:
            return f"<div><h3>Downhill in action</h3>{film.relaxing(s)}</div>"
    return ""


def _without(reasons: list[tuple[str, str]]) -> str:
    """Return the figures left out, those with the same reason together."""
    if not reasons:
        return ""
    titles: dict[str, list[str]] = {}
    for title, reason in reasons:
        titles.setdefault(reason, []).append(title)
    rows = "".join(
        f"<dt>{'; '.join(named)}</dt><dd>{escape(reason)}</dd>" for reason, named in titles.items()
    )
    return f"<details><summary>Figures left out, and why</summary><dl>{rows}</dl></details>"


def _code(label: str, text: str) -> str:
    return (
        f'<pre class="{label.lower()}" tabindex="0" role="region" aria-label="{label}">'
        f"<code>{escape(text)}</code></pre>"
    )
