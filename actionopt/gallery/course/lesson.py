"""What a lesson is."""

from __future__ import annotations

import io
from contextlib import redirect_stdout
from dataclasses import dataclass
from functools import cache
from typing import Any


@dataclass(frozen=True)
class Exercise:
    """A question, a program that finds the answer, and the answer with what the program found.

    Attributes
    ----------
    question, answer : str
        Text as `typeset` takes it; the answer has names of the program in braces.
    program : str
        Python, to be run by itself.
    asked : str
        The name in the program of the number that a reader types in first.
    unit : str
        Of that number, as text; none if empty.
    label : str
        Which of several numbers it is.
    """

    question: str
    program: str
    answer: str
    asked: str
    unit: str = ""
    label: str = "Your number"


@cache
def results(exercise: Exercise) -> tuple[dict[str, Any], str]:
    """Return the names that the program of an exercise leaves, and what it prints."""
    names: dict[str, Any] = {}
    with redirect_stdout(io.StringIO()) as output:
        exec(compile(exercise.program, "<exercise>", "exec"), names)
    return names, output.getvalue()


MINUTES = 45  # of a lesson at school


@dataclass(frozen=True)
class Lesson:
    """One idea, on one page.

    Attributes
    ----------
    name, title, idea : str
    minutes : (int, int, int, int)
        For predicting, trying, explaining and the exercises: MINUTES together.
    predict, explain : tuple of str
        Paragraphs.
    steps : tuple of (str, str)
        A derivation, a line a step: words, and a formula as docstrings write it.
    explorer : str
        Scene, or one of `experiments`, of the path that can be dragged in the page, if there is
        one.
    parts : tuple of str
        Its buttons and panels that are not folded away.
    figure : str
        One of `demonstrations`, if there is one.
    attempt, observe : tuple of str
        Paragraphs on what to try with the path, and with the figure.
    scenes : tuple of str
        Pages to open.
    watch, wrong, trap : str
        For the teacher: what to watch, usual wrong answers to the prediction, what to say.
    exercises : tuple of Exercise
    """

    name: str
    title: str
    minutes: tuple[int, int, int, int]
    idea: str
    predict: tuple[str, ...]
    explain: tuple[str, ...]
    watch: str
    wrong: str
    trap: str
    exercises: tuple[Exercise, ...]
    attempt: tuple[str, ...] = ()
    observe: tuple[str, ...] = ()
    steps: tuple[tuple[str, str], ...] = ()
    scenes: tuple[str, ...] = ()
    explorer: str = ""
    parts: tuple[str, ...] = ()
    figure: str = ""
