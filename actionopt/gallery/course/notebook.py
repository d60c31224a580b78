"""Lessons as Jupyter notebooks, one to work in and one with answers."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from actionopt.gallery.course.experiments import EXPERIMENTS
from actionopt.gallery.course.lesson import Lesson, results
from actionopt.gallery.course.lessons import BY_NAME
from actionopt.mechanics.laws.tracing import suggestion
from actionopt.tools.files import write
from actionopt.tools.words import current, numerals, say

ON_PAGE = (
    "The figure of this lesson stands on its page, which the command `actionopt gallery` writes."
)
EXPLORER = """\
{source}

with plot.language("{lang}"):
    window = plot.explore({question})
window
"""


def exercise(name: str, folder: str | Path = ".") -> tuple[Path, Path]:
    """Write the notebook of a lesson, and the one with its answers; return where they are.

    Raises
    ------
    ValueError
        If there is no such lesson; the nearest name is suggested.
    OSError
        If they cannot be written.
    """
    if name not in BY_NAME:
        raise ValueError(
            f"unknown lesson {name!r}{suggestion(name, tuple(BY_NAME))}; the lessons are "
            f"{', '.join(BY_NAME)}"
        )
    files = Path(folder) / f"{name}.ipynb", Path(folder) / f"{name}-answers.ipynb"
    for file, answers in zip(files, (False, True), strict=True):
        write(file, json.dumps(notebook(BY_NAME[name], answers), indent=1) + "\n")
    return files


def notebook(lesson: Lesson, answers: bool) -> dict[str, Any]:
    """Return a lesson's notebook as nbformat 4.5 has it."""
    cells = [_words(f"# {say(lesson.title)}\n\n{say(lesson.idea)}")]
    first, *rest = lesson.explain
    steps = (f"{say(words)} `{text}`" for words, text in lesson.steps)
    explain = (first, *steps, *rest)
    attempt = lesson.attempt or (say(ON_PAGE), *lesson.observe)
    parts = (("Predict", lesson.predict), ("Try", attempt), ("Explain", explain))
    for title, paragraphs in parts:
        cells.append(_words(f"## {say(title)}\n\n" + "\n\n".join(map(say, paragraphs))))
        if title == "Try" and lesson.explorer:
            cells.append(_program(_explorer(lesson.explorer)))
    for k, given in enumerate(lesson.exercises, 1):
        cells.append(_words(f"## {say('Exercise {k}', k=k)}\n\n{say(given.question)}"))
        if answers:
            found, _ = results(given)
            cells += [_program(given.program), _words(say(given.answer).format(**found))]
        else:
            cells.append(_program("import numpy as np\n\nimport actionopt as ao\n"))
    for k, cell in enumerate(cells):
        cell["id"] = f"{lesson.name}-{k}"
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    return {"cells": cells, "metadata": {"kernelspec": kernel}, "nbformat": 4, "nbformat_minor": 5}


def _explorer(name: str) -> str:
    """Return the program that shows the path to be bent."""
    source, question = "from actionopt import plot, scenes", f'scenes.get("{name}")'
    if name in EXPERIMENTS:
        source = "from actionopt import plot\n"
        source += f"from actionopt.gallery.course.experiments import {name}"
        question = f"{name}()"
    return EXPLORER.format(source=source, question=question, lang=current())


def _words(text: str) -> dict[str, Any]:
    return {"cell_type": "markdown", "metadata": {}, "source": numerals(text)}


def _program(text: str) -> dict[str, Any]:
    return {
        "cell_type": "code",
        "metadata": {},
        "source": text.rstrip(),
        "execution_count": None,
        "outputs": [],
    }
