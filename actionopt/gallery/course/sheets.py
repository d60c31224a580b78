"""A worksheet of each lesson and its solution, a side of A4 each when printed."""

from __future__ import annotations

from actionopt.gallery.course.lesson import Exercise, Lesson
from actionopt.gallery.course.lessons import LESSONS
from actionopt.gallery.course.spoken import answer, explanation, paragraphs, translate
from actionopt.gallery.page import frame, typeset
from actionopt.tools.words import say

WRITING_ROOM = '<div class="room"></div>'  # to write in


def worksheet(k: int) -> str:
    """Return the page of the k-th lesson's questions, with room to write."""
    lesson = LESSONS[k]
    asked = "".join(
        f'<div class="asked">{_question(i, exercise)}{WRITING_ROOM}<p>{_blank(exercise)}</p></div>'
        for i, exercise in enumerate(lesson.exercises, 1)
    )
    body = f"""<p class="blanks"><span>{say("Name")}</span> <span>{say("Date")}</span></p>
<section><h2>{say("Predict")}</h2>{paragraphs(lesson.predict)}{WRITING_ROOM}</section>
<section><h2>{say("Try")}</h2>{paragraphs(lesson.attempt + lesson.observe)}
<p>{say("What I saw:")}</p>{WRITING_ROOM}</section>
<section class="questions"><h2>{say("Exercises")}</h2>{asked}</section>"""
    return _sheet(k, say("Worksheet"), body)


def solution(k: int) -> str:
    """Return the page of the k-th lesson's answers."""
    lesson = LESSONS[k]
    answered = "".join(
        f"{_question(i, exercise)}<p><b>{answer(exercise)}</b></p>"
        for i, exercise in enumerate(lesson.exercises, 1)
    )
    body = f"""<section><h2>{say("Predict")}</h2>
<p><b>{translate(lesson.idea)}</b></p></section>
<section><h2>{say("Explain")}</h2>{explanation(lesson)}</section>
<section><h2>{say("Exercises")}</h2>{answered}</section>"""
    return _sheet(k, say("Solution"), body)


def _question(i: int, exercise: Exercise) -> str:
    return f"<p>{i}. {translate(exercise.question)}</p>"


def _blank(exercise: Exercise) -> str:
    """Return the line on which the number that was asked for is written."""
    unit = say("degrees") if exercise.unit == "degrees" else exercise.unit
    return f'{translate(exercise.label)}: <span class="blank"></span> {typeset(unit)}'


def _sheet(k: int, kind: str, body: str) -> str:
    lesson: Lesson = LESSONS[k]
    count = say("Lesson {k} of {count}", k=k + 1, count=len(LESSONS))
    main = f"""<article class="sheet"><header>
<p class="crumb"><a href="{lesson.name}.html">{count}</a> &middot; {kind}</p>
<h1>{translate(lesson.title)}</h1></header>
{body}</article>"""
    title = f"{kind}: {say(lesson.title)}"
    return frame(title, main, root="../", description=title)
