"""The documentation as a site that needs no server and no network.

    python docs/build.py site              all of it
    python docs/build.py site --scenes 2   with a gallery of so few scenes, to try it

Pages are Markdown, the interface is made of the docstrings; the gallery is the package's own. Any
warning is an error, and so is a link within the site that leads nowhere. It needs
`pip install -e '.[docs]'`.
"""

import argparse
import re
import shutil
import sys
import tempfile
import zipfile
from collections.abc import Sequence
from html import escape, unescape
from pathlib import Path
from urllib.parse import unquote

import notebooks
from conf import EXAMPLES
from sphinx.cmd.build import build_main

import actionopt as ao
from actionopt import gallery, plot, scenes, suite
from actionopt.gallery.course.lessons import BY_NAME
from actionopt.suite import dials, dump, interfaces

DOCS = Path(__file__).resolve().parent
TOP = DOCS.parent
ROOMS = {
    "actionopt": (ao, "Questions, answers, and all that follows from them."),
    "actionopt.plot": (plot, "Pictures and films of a solution, and the arrays that they show."),
    "actionopt.scenes": (scenes, "Examples with what is known exactly about them, and shapes."),
    "actionopt.suite": (suite, "Test problems for optimisers."),
    "actionopt.suite.interfaces": (interfaces, "Test problems as other packages take them."),
    "actionopt.suite.dump": (dump, "Test problems as files."),
    "actionopt.suite.dials": (dials, "Test problems from easy to hard."),
    "actionopt.gallery": (gallery, "Scenes as web pages."),
}
FRONT = (  # scenes on the first page
    "double_pendulum kepler brachistochrone rainbow billiard_ellipse figure_eight catenoid screw"
).split()
CARD = """<a href="gallery/{name}/index.html" title="{title}"
><img src="gallery/{name}/thumbnail.svg" alt="{title}" width="150"></a>"""
LINK = re.compile(r'(?:href|src)="([^"#?]+)[^"]*"')


def interface(folder: Path) -> None:
    """Write a page for each room: its public names, each with a page of its own."""
    pages = []
    for name, (room, about) in ROOMS.items():
        kinds = {True: "Functions", False: "Classes"}
        lines = [name, "=" * len(name), "", about, "", f".. currentmodule:: {name}", ""]
        public = [x for x in room.__all__ if callable(getattr(room, x))]
        for lower, title in kinds.items():
            names = [x for x in public if x[0].islower() == lower]
            if names:
                lines += ["", title, "-" * len(title), "", ".. autosummary::"]
                lines += ["   :toctree: interface", "", *(f"   {x}" for x in names)]
        values = [x for x in room.__all__ if not callable(getattr(room, x))]
        lines += ["", "Values", "------"] if values else []
        for x in values:
            lines += ["", f".. data:: {x}", ""]
            example = EXAMPLES.get(f"{name}.{x}", ())
            lines += ["   .. code-block:: python", ""] if example else []
            lines += ["      " + line for line in example]
        (folder / f"{name}.rst").write_text("\n".join([*lines, ""]))
        pages.append(name)
    listed = "\n".join(f"   {name}" for name in pages)
    title = (
        "Interface\n=========\n\nEvery public name: shapes, what is raised, sources, an example.\n"
    )
    (folder / "interface.rst").write_text(f"{title}\n.. toctree::\n   :maxdepth: 2\n\n{listed}\n")


def examples(folder: Path) -> None:
    """Write a page with the examples, which are a course."""
    text = "# Course\n\nEach is a script: `python examples/01_hello_action.py`.\n"
    for file in sorted((TOP / "examples").glob("*.py")):
        said, _, code = file.read_text(encoding="utf-8")[3:].partition('"""')
        title, _, rest = said.partition("\n")
        text += f"\n## {title.rstrip('.')}\n{rest}\n```python\n{code.strip()}\n```\n"
        if file.stem != notebooks.WRITES_PAGES:
            text += f'\n<a href="notebooks/{file.stem}.ipynb">As a notebook, with its figures</a>\n'
    lessons = ", ".join(f'<a href="notebooks/{name}.ipynb">{name}</a>' for name in BY_NAME)
    text += (
        f"\n## Lessons\n\nThose of the gallery's course as notebooks, with answers: {lessons}.\n"
    )
    (folder / "course.md").write_text(text)


def sources(folder: Path, shown: Sequence[str] = ()) -> None:
    """Put all pages into a folder: those of `docs`, of the repository, and those that are made.

    The first page has small pictures of the scenes `shown`.
    """
    shutil.copytree(DOCS, folder, ignore=shutil.ignore_patterns("*.py", "*.json*", "__pycache__"))
    cards = "\n".join(CARD.format(name=name, title=escape(scenes.title(name))) for name in shown)
    first = folder / "index.md"
    first.write_text(first.read_text().replace("<!-- scenes -->", f"<p>{cards}</p>"))
    theory = folder / "theory.md"
    theory.write_text(theory.read_text().replace("](../CONTRIBUTING.md)", "](contributing.md)"))
    for name in ("README", "CONTRIBUTING", "CHANGELOG"):
        text = (TOP / f"{name}.md").read_text(encoding="utf-8").replace("](docs/", "](")
        text = text.replace("](CONTRIBUTING.md)", "](contributing.md)")
        text = text.replace("](CHANGELOG.md)", "](changelog.md)")
        text = re.sub(r"\[([^\]]*)\]\(CITATION.cff\)", r"`\1`", text)
        (folder / f"{name.lower()}.md").write_text(text)
    interface(folder)
    examples(folder)


def pack(file: Path) -> None:
    """Write the package to a zip file, for `browser.md` to run."""
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as packed:
        for part in sorted((TOP / "actionopt").rglob("*")):
            if part.is_file() and "__pycache__" not in part.parts:
                packed.write(part, part.relative_to(TOP))


def dead_links(site: Path) -> list[str]:
    """Return the links within the site that lead nowhere, "page: link"."""
    dead = []
    for page in site.rglob("*.html"):
        for found in LINK.findall(page.read_text(encoding="utf-8")):
            link = unquote(unescape(found))
            outside = re.match(r"[a-z]+:", link) or "${" in link
            if not outside and not (page.parent / link).exists():
                dead.append(f"{page.relative_to(site)}: {link}")
    return sorted(set(dead))


def main() -> int:
    """Build the site; return 0 if nothing was wrong."""
    parser = argparse.ArgumentParser(description="Build the documentation.")
    parser.add_argument("site", type=Path, help="the folder to write to")
    parser.add_argument("--scenes", type=int, help="so many scenes in the gallery")
    parser.add_argument("--jobs", default="auto", help="processes of Sphinx")
    asked = parser.parse_args()
    if asked.site.exists() and any(asked.site.iterdir()):
        parser.error(f"expected a new or an empty folder, found {asked.site} with files in it")
    built = scenes.SCENES[: asked.scenes]
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made) / "pages"
        sources(folder, [name for name in FRONT if name in built])
        options = ["-q", "-W", "--keep-going", "-j", asked.jobs, "-c", str(DOCS)]
        wrong = build_main([*options, "-d", f"{made}/trees", str(folder), str(asked.site)])
    pack(asked.site / "actionopt.zip")
    notebooks.write(asked.site / "notebooks")
    gallery.build(asked.site / "gallery", list(built))
    dead = dead_links(asked.site)
    print("\n".join(f"leads nowhere: {link}" for link in dead))
    return wrong or bool(dead)


if __name__ == "__main__":
    sys.exit(main())
