"""The pages of the course: the list of lessons, each lesson, and the teacher's sheet."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence

from actionopt import scenes
from actionopt.gallery.course import (
    concepts,
    demonstrations,
    glossary,
    models,
    plan,
    sheets,
)
from actionopt.gallery.course.experiments import EXPERIMENTS
from actionopt.gallery.course.lesson import Exercise, Lesson, results
from actionopt.gallery.course.lessons import LESSONS
from actionopt.gallery.course.pictures import pictures
from actionopt.gallery.course.spoken import answer, explanation, paragraphs, translate
from actionopt.gallery.figures import Figure
from actionopt.gallery.page import Page, escape, frame, typeset
from actionopt.plot import SI
from actionopt.plot._names import units_of
from actionopt.plot.live.page import SCRIPTS, figure
from actionopt.solver.solve import solve
from actionopt.tools.words import number, say

SCENE_NAMED = re.compile(rf"((?:scene|Szene|sc\u00e8ne) )({'|'.join(scenes.SCENES)})\b")
OTHERS = {  # pages beside the lessons: titles, and what makes them
    "plan": ("Two weeks: plan and notes for teachers", plan.page),
    "concepts": ("Twenty questions on ideas", concepts.page),
    "glossary": ("Words of the course", glossary.page),
    "models": ("Five systems to model", models.page),
}


def course() -> Page:
    """Return all pages of the course as the files of one."""
    files = {"course.html": _contents()}
    files |= {f"course/{name}.html": page(title) for name, (title, page) in OTHERS.items()}
    for k, lesson in enumerate(LESSONS):
        files[f"course/{lesson.name}-worksheet.html"] = sheets.worksheet(k)
        files[f"course/{lesson.name}-solution.html"] = sheets.solution(k)
        drawn = pictures(lesson.name)
        files[f"course/{lesson.name}.html"] = _lesson(k, drawn)
        for figure_ in drawn:
            files |= figure_.files("course/")
    return Page(files)


def _contents() -> str:
    rows = "".join(
        f'<li><a href="course/{lesson.name}.html">{translate(lesson.title)}</a>'
        f"<p>{translate(lesson.idea)}</p></li>"
        for lesson in LESSONS
    )
    others = "".join(
        f'<li><a href="course/{name}.html">{say(title)}</a></li>'
        for name, (title, _) in OTHERS.items()
    )
    lead = say(
        "{count} short lessons on the principle of stationary action, for those who know Newton's "
        "laws and a little calculus. Each has one idea: predict, try, explain, and exercises with "
        "answers.",
        count=len(LESSONS),
    )
    main = f"""<article><header class="title"><h1>{say("A course")}</h1>
<p class="lead">{typeset(lead)}</p></header>
<ul class="others">{others}</ul>
<ol class="lessons">{rows}</ol>
</article>"""
    return frame(say("A course"), main, root="", description=lead)


def _lesson(k: int, drawn: Sequence[Figure]) -> str:
    """Return the page of the k-th lesson, with its figures."""
    lesson = LESSONS[k]
    exercises = "".join(_exercise(i, given) for i, given in enumerate(lesson.exercises, 1))
    widget = _live(lesson) if lesson.explorer else ""
    own = demonstrations.DEMONSTRATIONS.get(lesson.figure)
    if own is not None:
        widget += paragraphs(lesson.observe) + own.html(lesson.figure)
    shown = "".join(f"<figure>{x.html()}" for x in drawn)
    count = say("Lesson {k} of {count}", k=k + 1, count=len(LESSONS))
    alone = say("For the projector: the figure alone")
    minutes = say("{m} minutes", m=sum(lesson.minutes))
    main = f"""<article class="lesson">
<header class="title"><p class="crumb"><a href="../course.html">{say("The course")}</a> &middot;
{count} &middot; {minutes}</p>
<h1>{translate(lesson.title)}</h1>
<p class="lead">{translate(lesson.idea)}</p>{glossary.links(lesson)}</header>
<section><h2>{say("Predict")}</h2>{paragraphs(lesson.predict)}</section>
<section><h2>{say("Try")}</h2>{paragraphs(lesson.attempt)}{widget}
<p class="printless"><a href="{lesson.name}.html?projector">{alone}</a></p>
{_links(lesson)}</section>
<section><h2>{say("Explain")}</h2>{explanation(lesson)}{shown}</section>
<section><h2>{say("Exercises")}</h2>{exercises}
<p>{_sheets(lesson)}</p></section>
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
    found, output = results(exercise)
    shown = "".join(
        f'<pre class="{kind}" tabindex="0" role="region" aria-label="{say(label)} {k}">'
        f"<code>{escape(text.rstrip())}</code></pre>"
        for kind, label, text in (
            ("program", "Program", exercise.program),
            ("output", "Output", output),
        )
    )
    return (
        f'<div class="exercise"><p><b>{k}.</b> {_link_scenes(translate(exercise.question))}</p>'
        f"{_guess(k, exercise, float(found[exercise.asked]))}"
        f'<details class="answer"><summary>{say("Answer")}</summary>'
        f"<p>{answer(exercise)}</p>{shown}"
        "</details></div>"
    )


def _link_scenes(words: str) -> str:
    """Return words in which a scene that is named leads to its page.

    >>> _link_scenes("a wire of the scene screw")
    'a wire of the scene <a href="../screw/index.html">screw</a>'
    """
    return SCENE_NAMED.sub(r'\1<a href="../\2/index.html">\2</a>', words)


def _links(lesson: Lesson) -> str:
    rows = [
        f'<li><a href="../{name}/index.html">{translate(scenes.title(name))}</a></li>'
        for name in lesson.scenes
    ]
    if lesson.name in ("least", "sum"):
        rows.append(f'<li><a href="../least.html">{say("Is it really least?")}</a></li>')
    return f"<p>{say('Pages to open:')}</p><ul>{''.join(rows)}</ul>" if rows else ""


def _sheets(lesson: Lesson) -> str:
    """Return links to what is printed of a lesson, and to its note for teachers."""
    links = (
        (f"{lesson.name}-worksheet.html", say("Worksheet")),
        (f"{lesson.name}-solution.html", say("Solution")),
        (f"plan.html#{lesson.name}", say("Note for teachers")),
    )
    return " &middot; ".join(f'<a href="{href}">{text}</a>' for href, text in links)


def _turn(k: int) -> str:
    """Return links to the lessons before and after."""
    links = []
    for at, name in ((k - 1, "Before: {title}"), (k + 1, "Next: {title}")):
        if 0 <= at < len(LESSONS):
            text = say(name, title=translate(LESSONS[at].title))
            links.append(f'<a href="{LESSONS[at].name}.html">{text}</a>')
    return f'<nav class="turn" aria-label="{say("Lessons")}">{"".join(links)}</nav>'
