"""The pages: their links lead somewhere, and their tables are those of the raw numbers kept."""

import json
import re
from pathlib import Path

import pytest

from benchmarks import constants, report, scaling
from benchmarks.results import Results, unpacked
from benchmarks.stress import report as stress

TOP = Path(__file__).parent.parent
DOCS = TOP / "docs"
PAGES = sorted([*TOP.glob("*.md"), *DOCS.rglob("*.md"), *DOCS.rglob("*.html")])


# What the site makes beside its first page; its build fails on links that are dead.
MADE = {"readme.md", "contributing.md", "course.md", "interface.rst", "gallery/index.html"}


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(TOP)))
def test_links_lead_to_files_that_are_there(page):
    text = re.sub(r"```.*?```|`[^`]*`", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    for link in re.findall(r'\]\(([^)\s]+)\)|(?:src|href)="([^"]+)"', text):
        target = "".join(link).partition("#")[0]
        if target and not target.startswith(("http:", "https:", "mailto:", "data:")):
            made = page == DOCS / "index.md" and target in MADE
            assert made or (page.parent / target).exists(), target


def test_no_picture_is_kept_that_no_page_shows():
    shown = " ".join(page.read_text(encoding="utf-8") for page in PAGES)
    for picture in [*DOCS.rglob("*.png"), *DOCS.rglob("*.svg"), *DOCS.rglob("*.gif")]:
        assert picture.name.startswith("quick") or picture.name in shown


def made_again(name):
    file = DOCS / name
    rows = json.loads(file.with_suffix(".json").read_text())
    if name == "stress.md":
        before = json.loads(DOCS.joinpath("stress_before.json").read_text())
        both = ({k: (f["about"], unpacked(f)) for k, f in x.items()} for x in (rows, before))
        return stress.page(*both) + "\n"
    if name == "constants.md":
        return constants.page(rows) + "\n"
    if name == "benchmarks/scaling.md":
        return scaling.page(rows) + "\n"
    return report.page(Results(file, rows))


@pytest.mark.quick("constants.md", "stress.md")
@pytest.mark.parametrize(
    "name", ["constants.md", "stress.md", "benchmarks/scaling.md", "benchmarks/full.md"]
)
def test_the_raw_numbers_kept_give_the_page(name):
    assert made_again(name) == (DOCS / name).read_text()
