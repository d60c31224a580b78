"""A plan for two weeks: the lessons day by day, and a note on each for teachers."""

from __future__ import annotations

from actionopt.gallery.course.concepts import QUESTIONS
from actionopt.gallery.course.lesson import MINUTES, Lesson
from actionopt.gallery.course.lessons import LESSONS
from actionopt.gallery.course.spoken import translate
from actionopt.gallery.page import frame, table
from actionopt.tools.words import say

LESSON_PARTS = ("Predict", "Try", "Explain", "Exercises")
DAYS = 10  # of two weeks of school


def day(k: int) -> int:
    """Return on which day, from 1, the k-th lesson is held: evenly spread."""
    return 1 + k * DAYS // len(LESSONS)


def page(title: str) -> str:
    """Return the plan as a page."""
    rows = [
        (
            f'<a href="{lesson.name}.html">{translate(lesson.title)}</a>',
            str(day(k)),
            *map(str, lesson.minutes),
            _links(lesson),
        )
        for k, lesson in enumerate(LESSONS)
    ]
    head = (say("Lesson"), say("Day"), *map(say, LESSON_PARTS), say("To print"))
    lead = say(
        "{count} lessons of {minutes} minutes on {days} days of school, in this order. What is "
        "left of the exercises is homework.",
        count=len(LESSONS),
        minutes=MINUTES,
        days=DAYS,
    )
    notebooks = say(
        "As notebooks, one to work in and one with answers, they come by the command below."
    )
    notes = "".join(map(_note, LESSONS))
    main = f"""<article><header class="title">
<p class="crumb"><a href="../course.html">{say("The course")}</a></p>
<h1>{say(title)}</h1><p class="lead">{lead}</p></header>
{table(say("Lessons day by day, and minutes of their parts"), head, rows, kind="numbers plan")}
<p>{notebooks}</p>
<pre class="program"><code>actionopt exercise {LESSONS[0].name}</code></pre>
<section class="notes"><h2>{say("Notes for teachers")}</h2>{notes}</section></article>"""
    return frame(say(title), main, root="../", description=lead)


def _links(lesson: Lesson) -> str:
    """Return links to what is printed of a lesson."""
    sheets = (("worksheet", say("Worksheet")), ("solution", say("Solution")))
    return " ".join(f'<a href="{lesson.name}-{name}.html">{text}</a>' for name, text in sheets)


def _note(lesson: Lesson) -> str:
    said = (
        (say("Aim"), lesson.idea),
        (say("What to watch"), lesson.watch),
        (say("Usual wrong answers"), lesson.wrong),
        (say("What to say"), lesson.trap),
    )
    body = "".join(f"<dt>{name}</dt><dd>{translate(text)}</dd>" for name, text in said)
    asked = "".join(
        f'<li><a href="concepts.html#{x.name}">{translate(x.text)}</a></li>'
        for x in QUESTIONS
        if x.lesson == lesson.name
    )
    if asked:
        body += f"<dt>{say('Questions on its idea')}</dt><dd><ul>{asked}</ul></dd>"
    return (
        f'<section id="{lesson.name}"><h3>{translate(lesson.title)}</h3><dl>{body}</dl></section>'
    )
