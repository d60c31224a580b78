"""Texts of lessons as HTML, in the language spoken now."""

from __future__ import annotations

from actionopt.gallery.course.lesson import Exercise, Lesson, results
from actionopt.gallery.page import typeset
from actionopt.tools.formula import formula
from actionopt.tools.mathml import mathml
from actionopt.tools.words import say

NO_VECTORS = ("r", "v", "v1", "v2", "Q")  # names of formulas that are no vectors here


def translate(text: str) -> str:
    """Return a text in the language spoken now, typeset."""
    return typeset(say(text))


def paragraphs(texts: tuple[str, ...]) -> str:
    """Return texts as paragraphs."""
    return "".join(f"<p>{translate(text)}</p>" for text in texts)


def explanation(lesson: Lesson) -> str:
    """Return what explains: its first paragraph, the derivation if there is one, and the rest."""
    first, *rest = lesson.explain
    lines = "".join(
        f"<li><span>{translate(words)}</span>"
        f'<div class="formula" tabindex="0">{mathml(formula(text), NO_VECTORS)}</div></li>'
        for words, text in lesson.steps
    )
    steps = f'<ol class="steps">{lines}</ol>' if lines else ""
    return paragraphs((first,)) + steps + paragraphs(tuple(rest))


def answer(exercise: Exercise) -> str:
    """Return the answer with the numbers that the exercise's program finds."""
    return typeset(say(exercise.answer).format(**results(exercise)[0]))
