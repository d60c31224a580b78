"""`actionopt gallery`: write the pages."""

from __future__ import annotations

import argparse
import webbrowser
from pathlib import Path

from actionopt import scenes
from actionopt.gallery.builder import build
from actionopt.tools.progress import Bar
from actionopt.tools.words import SPOKEN


def add_to(parser: argparse.ArgumentParser) -> None:
    """Give the parser of `actionopt gallery` its arguments."""
    parser.description = (
        "Write a page for each scene, with its film, figures and numbers, and an index of them: "
        "static HTML that needs no server. What has not changed since is not made again. A file of "
        "your own has a page on which its path is dragged and solved."
    )
    parser.set_defaults(run=run)
    parser.add_argument("directory", metavar="OUTDIR", help="where to; made if it is not there")
    parser.add_argument(
        "asked", nargs="*", default=[], metavar="SCENE|FILE.py",
        help="only these scenes (all), and Python files that define `problem` or `scene`",
    )  # fmt: skip
    add = parser.add_argument
    add("--lang", choices=SPOKEN, default="en", help="language of the pages (en)")
    add("--jobs", type=int, default=2, metavar="N", help="pages at the same time (2)")
    add("--open", action="store_true", help="show them in the browser")


def run(options: argparse.Namespace) -> int:
    """Write the pages and print where they start."""
    asked = [scenes.from_file(name) if name.endswith(".py") else name for name in options.asked]
    build(options.directory, asked, show=Bar(), jobs=options.jobs, lang=options.lang)
    first = Path(options.directory) / "index.html"
    print(first)
    if options.open:
        webbrowser.open(first.resolve().as_uri())
    return 0
