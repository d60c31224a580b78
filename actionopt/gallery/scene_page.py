"""The page of one scene."""

from __future__ import annotations

import io
from collections.abc import Mapping
from contextlib import redirect_stdout, suppress

import numpy as np

from actionopt import scenes
from actionopt.analysis.solution import Solution
from actionopt.gallery import film, units
from actionopt.gallery.facts import facts_of
from actionopt.gallery.figures import IN_CHECK, IN_MOTION, IN_PRINCIPLE, Figure, figures
from actionopt.gallery.page import Page, escape, frame, prose, table, typeset
from actionopt.gallery.subject import Subject
from actionopt.gallery.texts import Texts, texts, texts_of_own
from actionopt.mechanics.laws.tracing import MULTIPLIERS, SWITCHES
from actionopt.mechanics.laws.written import equations
from actionopt.plot._names import units_of
from actionopt.plot.live.page import SCRIPTS, figure
from actionopt.tools.formula import formula
from actionopt.tools.mathml import mathml, symbol
from actionopt.tools.types import EPS
from actionopt.tools.words import number, say

SOLVING = """\
solution = ao.solve(scene.problem, tol=1e-10, guess=scene.guess)

print("action", solution.action, "{unit}error of the path", solution.error)
print("momenta", *solution.momenta)
"""
COMPARED = 'print("forward integration leads elsewhere by", solution.compare().position)\n'
TOUCHED = """\
for part in solution.contacts:
    force = solution.contact_force((part.begin + part.end) / 2)
    print("contact from", part.begin, "to", part.end, "with the force", force[part.row])
"""
_RATE = "<mfrac><mi>d</mi><mrow><mi>d</mi><mi>t</mi></mrow></mfrac>"
_PART = "<mfrac><mrow><mo>&#x2202;</mo>{}</mrow><mrow><mo>&#x2202;</mo>{}</mrow></mfrac>"
_Q_DOT = '<mover accent="true"><mi>q</mi><mo>&#x2D9;</mo></mover>'
_LEFT = _RATE + _PART.format("<mi>L</mi>", _Q_DOT) + "<mo>=</mo>"
_LEFT += _PART.format("<mi>L</mi>", "<mi>q</mi>")
_PRESSED = "<mo>&#x2212;</mo><mi>&#x3BD;</mi>" + _PART.format("<mi>f</mi>", "<mi>q</mi>")
_BENT = (
    "<mo>+</mo><mfrac><msup><mi>d</mi><mn>2</mn></msup><mrow><mi>d</mi><msup><mi>t</mi>"
    "<mn>2</mn></msup></mrow></mfrac>"
    + _PART.format("<mi>L</mi>", _Q_DOT.replace("&#x2D9;", "&#xA8;"))
)
LAWS = {  # as MathML, what each equation of motion is an instance of
    which: f'<math display="block" alttext="{alt}"><mrow>{_LEFT}{more}</mrow></math>'
    for which, alt, more in (
        ("least", "d/dt dL/dq' = dL/dq", ""),
        (
            "held",
            "d/dt dL/dq' = dL/dq + lambda df/dq",
            "<mo>+</mo><mi>&#x3BB;</mi>" + _PART.format("<mi>f</mi>", "<mi>q</mi>"),
        ),
        ("touching", "d/dt dL/dq' = dL/dq - nu df/dq", _PRESSED),
        ("forced", "d/dt dL/dq' = dL/dq + Q", "<mo>+</mo><mi>Q</mi>"),
        (
            "bent",
            "d/dt dL/dq' = dL/dq + d^2/dt^2 dL/dq'' - ...",
            _BENT + "<mo>&#x2212;</mo><mo>&#x2026;</mo>",
        ),
        ("pressed", "d/dt dL/dq' = dL/dq + d^2/dt^2 dL/dq'' - nu df/dq", _BENT + _PRESSED),
    )
}
EQUATIONS_SHOWN = 4  # equations; the others are folded away
LIVE = (
    "Arrow keys move a handle as well, with Shift in small steps. Triangles on the first slider "
    "are ends conjugate to the start, at which the index changes."
)
AT_EVENTS = (
    "What is not given at the events between the ends is varied as well. So the energy function is "
    "the same before and after them, and the momentum changes only along the normal of a surface, "
    "or in coordinates that are given."
)
GIVEN_INTEGRAL = (
    "The integral of G along the path is given. With a multiplier κ, which is found with the path, "
    "S plus κ times that integral is stationary: the Lagrangian is L + κ G in its place."
)
AS_FOUND = (
    "No path can be bent here: this page does not solve for paths through events, with a given "
    "integral, or with accelerations in the Lagrangian. It shows the one that was found."
)
NOT_LIVE = "No path can be bent here: {reason}."
UNWRITTEN = "They are too long to be read, or hold no formula."
VERDICT = 'print("a", solution.kind, "of the action, index", solution.morse_index)\n'


def scene_page(name: str) -> Page:
    """Return the page of the scene `name`."""
    return page_of(scenes.get(name), texts(name), f"{name}/")


def own_page(scene: scenes.Scene) -> Page:
    """Return the page of a scene of one's own, whose files have no folder yet.

    Raises ValueError for a Lagrangian that contains accelerations, SolveError if there is no path.
    """
    scene.problem.system.check_order("a page with its film and figures")
    return page_of(scene, texts_of_own(scene), "")


def page_of(scene: scenes.Scene, words: Texts, folder: str) -> Page:
    """Return the page of a scene, its files in a folder ("" or "name/")."""
    program, output, solution = run(scene, words)
    s = Subject(scene, solution)
    drawn, without = figures(s)
    title = translate(scene.title)[0].upper() + translate(scene.title)[1:]
    main = f"""<article class="scene">
<header class="title">
<p class="crumb"><a href="../index.html">{say("All scenes")}</a></p>
<h1>{typeset(title)}</h1>
<p class="tags">{"".join(f"<span>{escape(tag)}</span>" for tag in tags(s))}</p>
</header>
<section class="opening" aria-label="{say("The question")}">
<div>
{_opening(scene, words)}
</div>
{film.film(s)}
</section>
{_live(s)}<div data-tabs="{say("Parts of the page")}">
<section><h2 data-tab="{say("Equations")}">{say("The principle, and the equation of motion")}</h2>
{_principle(s, words)}
<div class="columns">
{_parameters(s, words.units)}
{_events(s)}
</div>
</section>
{_section("Is it stationary? Is it least?", "Least?", _relaxing(s), drawn[IN_PRINCIPLE])}
{_section("The motion", "Motion", "", drawn[IN_MOTION], _without(without))}
<section><h2 data-tab="{say("Numbers")}">{say("How well is it known?")}</h2>
<div class="columns even">{_known_part(s)}
{_result_part(s)}</div>
</section>
{_section("The check, and the mesh", "Check", "", drawn[IN_CHECK])}
<section class="printless"><h2 data-tab="{say("Program")}">{
        say("The program that found it, and what it printed")
    }</h2>
{_code("Program", program)}
{_code("Output", output)}
{_system(scene, words)}</section>
</div>
{_beside(s)}
</article>"""
    html = frame(
        title,
        main,
        root="../",
        description=translate(scene.title),
        scripts=["film.js", *SCRIPTS, "tabs.js"],
    )
    files = {f"{folder}index.html": html, f"{folder}thumbnail.svg": film.thumbnail(s)}
    for picture in (picture for part in drawn.values() for picture in part):
        files |= picture.files(folder)
    return Page(files, tags(s), s.motion, title)


def _opening(scene: scenes.Scene, words: Texts) -> str:
    """Return what there is of question, answer, what to look at, statement and source."""
    own, parts = scene.words, []
    if own.question:
        parts.append(f'<p class="question">{typeset(translate(own.question))}</p>')
    if own.answer:
        think = say("Think first; then look here")
        parts.append(
            f'<details class="answer"><summary>{think}</summary>\n'
            f"<p>{typeset(translate(own.answer))}</p></details>"
        )
    if own.look:
        parts.append(f'<h2 class="small">{say("What to look at")}</h2>')
        parts.append(f"<p>{typeset(translate(own.look))}</p>")
    statement = f"{typeset(translate(words.statement))} {typeset(translate(words.remarks))}"
    if words.statement:
        parts.append(f'<p class="statement">{statement}</p>')
    if scene.source:
        parts.append(f'<p class="source" lang="en">{escape(scene.source)}</p>')
    return "\n".join(parts)


def _system(scene: scenes.Scene, words: Texts) -> str:
    """Return the source of a scene's law, and how to have it with other numbers, if known."""
    if not words.source:
        return ""
    other = f'<code>scenes.get("{scene.name}", &hellip;)</code>'
    return f"""<p>{say("The system it solves:")}</p>
{_code("System", words.source)}
<div class="usage"><p>{say("With other numbers:")} {other}</p>
<div lang="en">{prose(words.usage)}</div></div>
"""


def translate(text: str) -> str:
    """Return a scene's own words in the language of the page; nothing for none."""
    return say(" ".join(text.split())) if text else ""


def _live(s: Subject) -> str:
    """Return the path to be drawn by hand; nothing along an obstacle, which that does not know."""
    if s.touches:
        return ""
    problem, title = s.solution.problem, f"<h2>{say('The path under your hand')}</h2>"
    if s.between or problem.integral is not None or problem.system.order > 1:
        return f'<section>{title}\n<p class="section-note">{say(AS_FOUND)}</p></section>\n'
    try:
        drawn = figure(
            problem,
            s.solution,
            units=s.units,
            draw=s.scene.draw,
            measure=s.scene.measure,
        )
    except ValueError as error:  # a law or an end of one's own that a page cannot compute
        reason = escape(say(NOT_LIVE, reason=error))
        return f'<section>{title}\n<p class="section-note">{reason}</p></section>\n'
    return f"""<section>{title}
<p class="section-note">{say(LIVE)}</p>
{drawn}
</section>
"""


def _section(title: str, tab: str, before: str, drawn: list[Figure], after: str = "") -> str:
    if not drawn and not before:
        return after
    heading = f'<h2 data-tab="{say(tab)}">{say(title)}</h2>'
    return f"<section>{heading}\n{_pictures(drawn, before)}{after}</section>"


def _pictures(drawn: list[Figure], before: str = "") -> str:
    pictures = "".join(f"<figure><h3>{f.title}</h3>\n{f.html()}\n" for f in drawn)
    return f'<div class="figures">\n{before}{pictures}</div>'


def _principle(s: Subject, words: Texts) -> str:
    """Return the Lagrangian, and the equations of motion that follow from it."""
    system = s.solution.problem.system
    text = {
        "least": "Of all paths between the two events the motion makes the action stationary: a "
        "small bend of the path changes it to second order only. So for each coordinate",
        "held": "Of all paths between the two events that keep the constraint the motion makes the "
        "action stationary. With a multiplier for the constraint, whose gradient is the direction "
        "of its force, for each coordinate",
        "touching": "Of all paths between the two events that keep outside of the obstacle this "
        "one makes the action least. Where it touches, f = 0, the obstacle presses with a force "
        "that is not negative, along the gradient of f; elsewhere there is none. For each "
        "coordinate",
        "forced": "A force Q, which is not in the Lagrangian, stands beside it in the equations of "
        "Lagrange and d'Alembert. For each coordinate",
        "bent": "Of all paths between the two events with the derivatives that are given there, if "
        "any, this one makes the integral of L, in which accelerations count, stationary. For each "
        "coordinate, by Euler and Poisson",
        "pressed": "Of all paths between the two events that keep outside of the obstacle this one "
        "makes the integral of L, in which accelerations count, least. Where it lies on it, f = 0, "
        "the obstacle presses with a force that is not negative, along the gradient of f, and with "
        "impulses where contact begins and ends. For each coordinate, by Euler and Poisson",
    }
    which = (
        "forced" if s.has_forces else "held" if system.m else "touching" if s.touches else "least"
    )
    if system.order > 1:
        which = {"least": "bent", "touching": "pressed"}.get(which, which)
    more = ""
    if any(e.t is None for e in s.solution.problem.joints[1:-1]):
        more += f"<p>{say(AT_EVENTS)}</p>"
    if s.solution.problem.integral is not None:
        more += f"<p>{say(GIVEN_INTEGRAL)}</p>"
    follow = say("From this follow the equations of motion.")
    if s.touches:
        follow = say("From this follow the equations of motion, where nothing is touched.")
    law = s.laws[0]
    try:
        rows = equations(law, law.table)
    except ValueError:
        rows, follow = [], f"{follow} {say(UNWRITTEN)}"
    scalars = {*system.coordinates, *law.parameters, "G"}
    written = [
        f'<div class="formula scroll" tabindex="0" role="region" aria-label="'
        f'{say("Equation of motion")} {k}">{mathml(formula(row), scalars)}</div>'
        for k, row in enumerate(rows, 1)
    ]
    if len(rows) > EQUATIONS_SHOWN:
        rest = "".join(written[EQUATIONS_SHOWN:])
        others = say("The other {count} equations", count=len(rows) - EQUATIONS_SHOWN)
        written[EQUATIONS_SHOWN:] = [f"<details><summary>{others}</summary>{rest}</details>"]
    return (
        f'<div class="columns principle"><div>{_formulas(s, words)}<p>{say(text[which])}</p>'
        f'<div class="formula">{LAWS[which]}</div>'
        f"{more}<p>{follow}</p></div>"
        f'<div class="motions">{"".join(written)}</div></div>'
    )


def _beside(s: Subject) -> str:
    """Return links to what is like it, to the story, and to the course."""
    links = [
        f'<li><a href="../{name}/index.html">{typeset(translate(scenes.title(name)))}</a></li>'
        for name in s.scene.words.beside
    ]
    if s.has_forces:
        story = say("Where there is an action, when is it least?")
    elif s.solution.morse_index:
        story = say("Why this action is a saddle, and not least")
    else:
        story = say("Why this action is least, and when it would not be")
    links.append(f'<li><a href="../least.html">{story}</a></li>')
    links.append(f'<li><a href="../course.html">{say("The course, from the beginning")}</a></li>')
    return (
        f'<nav class="beside" aria-label="{say("Beside it")}"><h2>{say("Beside it")}</h2>'
        "<ul>" + "".join(links) + "</ul></nav>"
    )


def run(scene: scenes.Scene, words: Texts) -> tuple[str, str, Solution]:
    """Run the program of a scene; return it, what it printed, and its solution."""
    system = scene.problem.system
    unit = units_of(scene).action
    solving = SOLVING.replace("{unit}", f"{unit}, " if unit else "")
    program = f"{words.program}{solving}{TOUCHED if system.r else COMPARED}"
    program += "" if system.structure.forced else VERDICT
    output, names = io.StringIO(), {"scene": scene}
    with redirect_stdout(output):
        exec(compile(program, f"<{scene.name}>", "exec"), names)
    return program, output.getvalue(), names["solution"]  # type: ignore[return-value]


def tags(s: Subject) -> tuple[str, ...]:
    """Return words for what a scene is: coordinates, constraints, verdict."""
    system = s.solution.problem.system
    found = [_count(system.n, "1 coordinate", "{count} coordinates")]
    if system.m:
        found.append(_count(system.m, "1 constraint", "{count} constraints"))
    if s.between:
        found.append(_count(s.between, "1 event between", "{count} events between"))
    if s.solution.problem.integral is not None:
        found.append(say("a given integral"))
    if s.laws[0].structure.depends_on_time:
        found.append(say("depends on time"))
    if s.touches:
        found.append(say("touches an obstacle"))
    return (*found, say("drag") if s.dissipates else s.verdict)


def _count(count: int, one: str, many: str) -> str:
    return say(one) if count == 1 else say(many, count=count)


def _formulas(s: Subject, words: Texts) -> str:
    system = s.solution.problem.system
    scalars = {*system.coordinates, *s.laws[0].parameters, "G"}
    if system.n == 1:
        scalars.add("Q")
    rows = []
    for k, given in enumerate(words.formulas, 1):
        remark = f'<span class="remark">{typeset(translate(given.remark))}</span>' * bool(
            given.remark
        )
        rows.append(
            f'<div class="formula scroll" tabindex="0" role="region" aria-label="'
            f'{say("Formula")} {k}">'
            f"{mathml(given, scalars)}{remark}</div>"
        )
    return "\n".join(rows)


def _parameters(s: Subject, known: Mapping[str, str]) -> str:
    problem = s.solution.problem
    values = {
        key: [x] for key, x in problem.parameters.items() if key not in (SWITCHES, MULTIPLIERS)
    }
    for key in s.laws[0].parameters:  # of its own in each leg
        if key not in (*values, MULTIPLIERS):
            values[key] = list(dict.fromkeys(float(law.parameters[key]) for law in s.laws))
    rows = [
        (
            symbol(key),
            ", ".join(number(float(x), 8) for x in row),
            units.html(known.get(key, "")),
        )
        for key, row in values.items()
    ]
    return table(say("Parameters"), ("", say("value"), say("unit")), rows) if rows else ""


def _events(s: Subject) -> str:
    names, digits = s.scene.problem.system.coordinates, 4 if s.between else 8
    t = [event.t for event in s.solution.problem.joints_found]
    places = np.array([s.solution.start.q, *s.solution(np.array(t[1:-1])).T, s.solution.end.q])
    places[np.abs(places) <= 8 * EPS * np.max(np.abs(places))] = 0.0  # rounding of sines, surfaces
    rows = [
        (
            symbol(name),
            *(number(float(q[k]), digits) for q in places),
            units.html(s.units.coordinate(name)),
        )
        for k, name in enumerate(names)
    ]
    for order in range(1, s.solution.problem.system.order):
        rates = [e.rates[order - 1 : order] for e in s.solution.problem.joints]
        for k, name in enumerate(names):
            known = [r[0][k] if r and r[0] else None for r in rates]
            if any(x is not None for x in known):
                shown = ("" if x is None else number(x, digits) for x in known)
                rows.append((symbol(name + order * "'"), *shown, ""))  # of scenes without units
    at = [say("at {t} s" if s.units.time else "at t = {t}", t=number(x, digits)) for x in t]
    title = say("The events") if s.between else say("The two events")
    return table(title, ("", *at, say("unit")), rows)


def _known_part(s: Subject) -> str:
    rows = [
        (
            say(r.what),
            say(r.expected),
            say(r.found) if r.found else "",
            "" if r.difference is None else number(r.difference, 2),
        )
        for r in facts_of(s)
    ]
    if not rows:
        return f"<p>{say('No closed form is known; forward integration is the check.')}</p>"
    head = ("", say("known exactly"), say("found"), say("relative difference"))
    return table(say("Known and found"), head, rows, kind="numbers")


def _result_part(s: Subject) -> str:
    solution = s.solution
    (p0, p1), names = solution.momenta, solution.problem.system.coordinates
    named = [name + "'" * k for k in range(solution.problem.system.order) for name in names]
    H = solution.energy(s.t)
    rows = [
        *_measure_row(s),
        (say("action S"), f"{number(solution.action, 12)} {s.units.action}"),
        (say("estimated error of the path, relative"), number(solution.error, 2)),
        *([] if s.touches else [_deviation(solution)]),
        (say("energy function H at the start and the end"), _pair(H[0], H[-1], s.units.energy)),
        *(
            (
                say("momentum of {name} at the start and the end", name=symbol(name)),
                _pair(a, b, "" if name.endswith("'") else s.units.momentum(name)),
            )
            for name, a, b in zip(named, p0, p1, strict=True)
        ),
        *([] if s.has_forces else [(say("the action is"), escape(s.verdict))]),
        (
            say("mesh"),
            say(
                "1 element, {nodes} nodes"
                if solution.mesh.elements == 1
                else "{elements} elements, {nodes} nodes",
                elements=solution.mesh.elements, nodes=solution.mesh.nodes.size,
            ),
        ),
    ]  # fmt: skip
    return table(say("Found from the path"), ("", say("value")), rows, kind="numbers")


def _measure_row(s: Subject) -> list[tuple[str, str]]:
    """Return what a scene that is no mechanics measures: the number that its reader wants."""
    known = s.scene.measure
    if known is None or not known.name:
        return []
    value = number(known.of(s.solution.action, s.duration), 12)
    return [(say(known.name), f"{value} {units.html(known.unit)}")]


def _deviation(solution: Solution) -> tuple[str, str]:
    comparison = solution.compare()
    what = say("deviation of forward integration, relative")
    reason = f'<span class="words">{escape(comparison.reason)}</span>'
    return what, reason if comparison.reason else number(comparison.position, 2)


def _pair(a: float, b: float, unit: str) -> str:
    a, b = (0.0 if abs(x) <= 1e-12 * max(abs(a), abs(b), 1.0) else x for x in (a, b))
    if np.isclose(a, b, rtol=1e-8, atol=1e-10):
        return say("{x} {unit}, the same", x=number(float(b), 10), unit=units.html(unit))
    return say(
        "{a} and {b} {unit}",
        a=number(float(a), 10), b=number(float(b), 10), unit=units.html(unit),
    )  # fmt: skip


def _relaxing(s: Subject) -> str:
    """Return the film of a relaxation, where one plane shows it and there is one."""
    with suppress(ValueError):
        if s.plane:
            made = film.relaxing(s)
            return f"<div><h3>{say('Downhill in action')}</h3>{made}</div>" if made else ""
    return ""


def _without(reasons: list[tuple[str, str]]) -> str:
    """Return the figures left out, those with the same reason together."""
    if not reasons:
        return ""
    titles: dict[str, list[str]] = {}
    for title, reason in reasons:
        titles.setdefault(reason, []).append(title)
    said = say("Figures left out, and why")
    rows = "".join(
        f"<dt>{'; '.join(named)}</dt><dd>{escape(reason)}</dd>" for reason, named in titles.items()
    )
    return f"<details><summary>{said}</summary><dl>{rows}</dl></details>"


def _code(label: str, text: str) -> str:
    return (
        f'<pre class="{label.lower()}" tabindex="0" role="region" aria-label="{say(label)}">'
        f"<code>{escape(text)}</code></pre>"
    )
