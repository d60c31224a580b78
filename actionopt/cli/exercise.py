"""`actionopt exercise`: write a lesson of the course as notebooks."""

from __future__ import annotations

import argparse

from actionopt.tools.table import print_table
from actionopt.tools.words import SPOKEN, language


def add_to(command: argparse.ArgumentParser) -> None:
    """Add the arguments, and what runs."""
    command.description = (
        "Write a lesson of the course as Jupyter notebooks: NAME.ipynb to work in, and "
        "NAME-answers.ipynb. Without a name, list the lessons."
    )
    command.set_defaults(run=run)
    command.add_argument("--lang", choices=SPOKEN, default="en", help="language of the words (en)")
    command.add_argument("name", nargs="?", metavar="NAME", help="of a lesson")
    command.add_argument("folder", nargs="?", default=".", metavar="FOLDER", help="where to (here)")


def run(options: argparse.Namespace) -> int:
    """Write the notebooks, or list the lessons."""
    from actionopt.gallery.course.lessons import LESSONS

    if options.name is None:
        print_table([("lesson", "what it is"), *((x.name, x.title) for x in LESSONS)])
        return 0
    from actionopt.gallery.course.notebook import exercise

    with language(options.lang):
        files = exercise(options.name, options.folder)
    for file in files:
        print(file)
    return 0
