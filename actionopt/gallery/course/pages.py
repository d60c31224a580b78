"""The pages of the course: the list of lessons, each lesson, and the teacher's sheet."""

from __future__ import annotations

import io
import json
from collections.abc import Sequence
from contextlib import redirect_stdout

from actionopt import scenes
from actionopt.gallery.course import demonstrations
from actionopt.gallery.course.experiments import EXPERIMENTS
from actionopt.gallery.course.lesson import Exercise, Lesson
from actionopt.gallery.course.lessons import LESSONS
from actionopt.gallery.course.pictures import pictures
from actionopt.gallery.figures import Figure
from actionopt.gallery.page import Page, escape, frame, table, typeset
from actionopt.plot import SI
from actionopt.plot._names import units_of
from actionopt.plot.live.page import SCRIPTS, figure
from actionopt.solver.solve import solve
from actionopt.tools.formula import formula
from actionopt.tools.mathml import mathml
from actionopt.tools.words import number, say

LESSON_PARTS = ("Predict", "Try", "Explain", "Exercises")


def course() -> Page:
    """Return all pages of the course as the files of one."""
    files = {"course.html": _contents()}
    for k, lesson in enumerate(LESSONS):
        drawn = pictures(lesson.name)
        files[f"course/{lesson.name}.html"] = _lesson(k, drawn)
        for figure_ in drawn:
            files |= figure_.files("course/")
    return Page(files)


def _contents() -> str:
    rows = "".join(
        f'<li><a href="course/{lesson.name}.html">{_translate(lesson.title)}</a>'
        f"<p>{_translate(lesson.idea)}</p></li>"
        for lesson in LESSONS
    )
    lead = say(
        "{count} short lessons on the principle of stationary action, for those who know Newton's "
        "laws and a little calculus. Each has one idea: predict, try, explain, and exercises with "
        "answers.",
        count=len(LESSONS),
    )
    notebooks = say(
        "As notebooks, one to work in and one with answers, they come by the command below."
    )
    main = f"""<article><header class="title"><h1>{say("A course")}</h1>
<p class="lead">{typeset(lead)}</p></header>
<ol class="lessons">{rows}</ol>
<section><h2>{say("For teachers")}</h2>
<p>{notebooks}</p>
<pre class="program"><code>actionopt exercise {LESSONS[0].name}</code></pre>
{_minutes()}
{_traps()}
</section></article>"""
    return frame(say("A course"), main, root="", description=lead)


def _minutes() -> str:
    """Return the teacher's sheet: the minutes of each part."""
    rows = [
        (
            f'<a href="course/{lesson.name}.html">{_translate(lesson.title)}</a>',
            *map(str, lesson.minutes),
            str(sum(lesson.minutes)),
        )
        for lesson in LESSONS
    ]
    head = ("", *map(say, LESSON_PARTS), say("together"))
    return table(say("Minutes"), head, rows, kind="numbers")


def _traps() -> str:
    rows = [(_translate(lesson.title), _translate(lesson.trap)) for lesson in LESSONS]
    title = say("What is often thought wrongly, and what to say")
    body = "".join(f"<dt>{name}</dt><dd>{trap}</dd>" for name, trap in rows)
    return f"<h3>{title}</h3><dl>{body}</dl>"


def _lesson(k: int, drawn: Sequence[Figure]) -> str:
    """Return the page of the k-th lesson, with its figures."""
    lesson = LESSONS[k]
    exercises = "".join(_exercise(i, given) for i, given in enumerate(lesson.exercises, 1))
    widget = _live(lesson) if lesson.explorer else ""
    own = demonstrations.DEMONSTRATIONS.get(lesson.figure)
    if own is not None:
        widget += _prose(lesson.observe) + own.html(lesson.figure)
    shown = "".join(f"<figure>{x.html()}" for x in drawn)
    count = say("Lesson {k} of {count}", k=k + 1, count=len(LESSONS))
    minutes = say("{m} minutes", m=sum(lesson.minutes))
    main = f"""<article class="lesson">
<header class="title"><p class="crumb"><a href="../course.html">{say("The course")}</a> &middot;
{count} &middot; {minutes}</p>
<h1>{_translate(lesson.title)}</h1>
<p class="lead">{_translate(lesson.idea)}</p></header>
<section><h2>{say("Predict")}</h2>{_prose(lesson.predict)}</section>
<section><h2>{say("Try")}</h2>{_prose(lesson.attempt)}{widget}{_links(lesson)}</section>
<section><h2>{say("Explain")}</h2>{_explanation(lesson)}{shown}</section>
<section><h2>{say("Exercises")}</h2>{exercises}
<pre class="program"><code>actionopt exercise {lesson.name}</code></pre></section>
{_turn(k)}
</article>"""
    scripts = ["film.js", *SCRIPTS, *demonstrations.FIGURE_SCRIPTS, "guess.js"]
    description = say(lesson.idea)
    return frame(say(lesson.title), main, root="../", description=description, scripts=scripts)


def _live(lesson: Lesson) -> str:
    """Return the path of a lesson to be bent, its motion not shown; its sum over paths is."""
    words = say("Drag a handle, or use the arrow keys. The page's address holds what you did.")
    if lesson.explorer in EXPERIMENTS:
        problem = EXPERIMENTS[lesson.explorer]()
        return figure(
            problem, solve(problem), units=SI, caption=words, name=lesson.name, parts=lesson.parts
        )
    scene = scenes.get(lesson.explorer)
    return figure(
        scene.problem,
        solve(scene.problem, tol=1e-10, guess=scene.guess),
        units=units_of(scene),
        draw=scene.draw if "picture" in lesson.parts else None,
        caption="" if lesson.name == "sum" else words,
        name=lesson.name,
        arrows=lesson.name == "sum",
        measure=scene.measure,
        parts=lesson.parts,
    )


MARKS = {  # what is said of a number that was typed in
    "right": "Right: it is {x}.",
    "near": "Near: it is {x}.",
    "sign": "The size is about right, the sign is not: it is {x}.",
    "wrong": "No: it is {x}. Compare how you found yours.",
    "given": "It is {x}.",
}
UNREAD = "Type a number, such as {x}."
NO_VECTORS = ("r", "v", "v1", "v2", "Q")  # names of formulas that are no vectors here
EXAMPLE = 0.25  # of a number that can be typed


def _guess(k: int, exercise: Exercise, value: float) -> str:
    """Return the field in which a number is typed before the answer is seen; it needs guess.js."""
    unit = say("degrees") if exercise.unit == "degrees" else exercise.unit
    shown = f"{number(value, 3)} {unit}".strip().replace("^2", "\N{SUPERSCRIPT TWO}")
    words = {mark: say(text, x=shown) for mark, text in MARKS.items()}
    words["unread"] = say(UNREAD, x=number(EXAMPLE))
    return f"""<form class="guess" id="guess-{k}" data-value="{value!r}"
data-words="{escape(json.dumps(words))}" hidden><label>{typeset(say(exercise.label))}
<input type="text" inputmode="decimal" autocomplete="off"> {typeset(unit)}</label>
<button>{say("Compare")}</button>
<button type="button" class="quiet" data-give>{say("I have none")}</button>
<output></output></form>"""


def _exercise(k: int, exercise: Exercise) -> str:
    with redirect_stdout(io.StringIO()) as output:
        found = exercise.run()
    answer = typeset(say(exercise.answer).format(**found))
    shown = "".join(
        f'<pre class="{kind}" tabindex="0" role="region" aria-label="{say(label)} {k}">'
        f"<code>{escape(text.rstrip())}</code></pre>"
        for kind, label, text in (
            ("program", "Program", exercise.program),
            ("output", "Output", output.getvalue()),
        )
    )
    return (
        f'<div class="exercise"><p><b>{k}.</b> {_translate(exercise.question)}</p>'
        f"{_guess(k, exercise, float(found[exercise.asked]))}"
        f'<details class="answer"><summary>{say("Answer")}</summary><p>{answer}</p>{shown}'
        "</details></div>"
    )


def _explanation(lesson: Lesson) -> str:
    """Return what explains: its first paragraph, the derivation if there is one, and the rest."""
    first, *rest = lesson.explain
    lines = "".join(
        f"<li><span>{_translate(words)}</span>"
        f'<div class="formula" tabindex="0">{mathml(formula(text), NO_VECTORS)}</div></li>'
        for words, text in lesson.steps
    )
    steps = f'<ol class="steps">{lines}</ol>' if lines else ""
    return _prose((first,)) + steps + _prose(tuple(rest))


def _links(lesson: Lesson) -> str:
    rows = [
        f'<li><a href="../{name}/index.html">{_translate(scenes.title(name))}</a></li>'
        for name in lesson.scenes
    ]
    if lesson.name in ("least", "sum"):
        rows.append(f'<li><a href="../least.html">{say("Is it really least?")}</a></li>')
    return f"<p>{say('Pages to open:')}</p><ul>{''.join(rows)}</ul>" if rows else ""


def _turn(k: int) -> str:
    """Return links to the lessons before and after."""
    links = []
    for at, name in ((k - 1, "Before: {title}"), (k + 1, "Next: {title}")):
        if 0 <= at < len(LESSONS):
            text = say(name, title=_translate(LESSONS[at].title))
            links.append(f'<a href="{LESSONS[at].name}.html">{text}</a>')
    return f'<nav class="turn" aria-label="{say("Lessons")}">{"".join(links)}</nav>'


def _translate(text: str) -> str:
    return typeset(say(text))


def _prose(paragraphs: tuple[str, ...]) -> str:
    return "".join(f"<p>{_translate(text)}</p>" for text in paragraphs)
