"""`actionopt gallery`: write the pages."""

from __future__ import annotations

import argparse
from pathlib import Path

from actionopt.gallery.builder import build
from actionopt.tools.progress import progress


def add_to(parser: argparse.ArgumentParser) -> None:
    """Give the parser of `actionopt gallery` its arguments."""
    parser.description = (
        "Write a page for each scene, with its film, figures and numbers, and an index of them: "
        "static HTML that needs no server. What has not changed since is not made again."
    )
    parser.set_defaults(run=run)
    parser.add_argument("directory", metavar="OUTDIR", help="where to; made if it is not there")
    parser.add_argument("scenes", nargs="*", default=[], metavar="SCENE", help="only these (all)")


def run(options: argparse.Namespace) -> int:
    """Write the pages and print where they start."""
    build(options.directory, options.scenes, show=progress)
    print(Path(options.directory) / "index.html")
    return 0
