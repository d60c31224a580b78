"""The guide and the pages beside it: each piece of code runs, in order, and each value that
a comment states is found.
"""

import ast
import re
from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest
from matplotlib import pyplot

import actionopt as ao
from actionopt import gallery, plot, scenes, suite
from actionopt.solver.solve import BY_METHOD

DOCS = Path(__file__).parent.parent / "docs"
PAGES = "guide.md", "test_problems.md", "others.md", "names.md", "first_change.md"
GUIDE, SUITE, OTHERS, NAMES, FIRST = (DOCS / name for name in PAGES)
ROOMS = {room.__name__: room for room in (ao, plot, scenes, suite, gallery)}
DECIMAL = re.compile(r"-?\d+\.\d+")
# Values at least: comments that are not taken for values would go unseen.
STATED = {GUIDE: 50, SUITE: 12, OTHERS: 9, NAMES: 60, FIRST: 5}


def stated(block):
    """Yield each top-level statement of a block and the comment behind it, if it is a value."""
    lines = block.splitlines()
    for statement in ast.parse(block).body:
        last = lines[statement.end_lineno - 1]
        comment = last[statement.end_col_offset :].strip().lstrip("# ")
        shown = isinstance(statement, ast.Expr) and not ast.unparse(statement).startswith("print")
        yield statement, comment if shown else ""


def flat(value):
    """Return the items of nested sequences and arrays in order, with the brackets."""
    value = value.tolist() if isinstance(value, np.ndarray | np.generic) else value
    if isinstance(value, list | tuple):
        return ["(", *(leaf for item in value for leaf in flat(item)), ")"]
    return [value]


def same(found, wanted):
    """Whether they are equal, to half a unit of the last digit where that is a decimal."""
    if isinstance(wanted, Decimal):
        unit = 10.0 ** wanted.as_tuple().exponent
        return isinstance(found, float) and abs(found - float(wanted)) <= 0.501 * unit
    return type(found) is type(wanted) and found == wanted


def agree(found, comment):
    """Whether a value is the one a comment states before its first semicolon."""
    text = DECIMAL.sub(r"Decimal('\g<0>')", comment.split(";")[0])
    here, there = flat(found), flat(eval(text, {"Decimal": Decimal}))
    return len(here) == len(there) and all(map(same, here, there))


def test_the_comparison_can_fail():
    assert agree(np.array([[1.23449, -2.0]]), "[[1.2345, -2.0]]; words")
    assert not agree(np.array([[1.2347, -2.0]]), "[[1.2345, -2.0]]")
    assert not agree(np.array([1.0, -2.0]), "[[1.0, -2.0]]")
    assert not agree(2.3, "2.31")
    assert not agree(True, "False")
    assert not agree(1, "True")
    assert not agree("saddle", "'minimum'")


def run(text, folder):
    """Run a page in a folder; return its names, what it states and does not find, and how much."""
    names, wrong, count = {}, [], 0
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for block in re.findall(r"```python\n(.*?)```", text, re.DOTALL):
            for statement, comment in stated(block):
                code = ast.unparse(statement)
                if not comment:
                    exec(code, names)
                    continue
                count += 1
                found = eval(code, names)
                if not agree(found, comment):
                    wrong.append(f"{code} is {found}, not {comment}")
            pyplot.close("all")
    return names, wrong, count


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """Run the guide once."""
    for package in ("pandas", "scipy", "sympy", "xarray"):
        pytest.importorskip(package)
    folder = tmp_path_factory.mktemp("guide")
    return *run(GUIDE.read_text(), folder), folder


@pytest.mark.long
def test_what_the_page_states_is_found(page):
    _, wrong, count, _ = page
    assert not wrong, "\n".join(wrong)
    assert count >= STATED[GUIDE]


@pytest.mark.long
def test_what_the_page_of_test_problems_states_is_found(tmp_path):
    _, wrong, count = run(SUITE.read_text(), tmp_path)
    assert not wrong, "\n".join(wrong)
    assert count >= STATED[SUITE]
    assert not list(tmp_path.iterdir())


@pytest.mark.long
def test_what_the_page_of_other_tools_states_is_found(tmp_path):
    pytest.importorskip("sympy")
    _, wrong, count = run(OTHERS.read_text(), tmp_path)
    assert not wrong, "\n".join(wrong)
    assert count >= STATED[OTHERS]


def test_a_first_change_does_what_its_page_says(tmp_path):
    _, wrong, count = run(FIRST.read_text(), tmp_path)
    assert not wrong, "\n".join(wrong)
    assert count >= STATED[FIRST]
    assert "bent" not in BY_METHOD


def test_every_public_name_has_an_example_on_the_page_of_names():
    text = NAMES.read_text()
    for part in text.split("\n## ")[1:]:
        name, *pieces = re.split(r"\n+### ", part)
        room = ROOMS.pop(name)
        assert {piece.split("\n")[0] for piece in pieces} == {*room.__all__}, name
        for piece in pieces:
            title, code = piece.split("\n\n", 1)
            assert re.match(r"```python\n(.*\n)+?```", code), title
    assert not ROOMS


@pytest.mark.slow
def test_what_the_page_of_names_states_is_found(tmp_path, monkeypatch):
    monkeypatch.setattr(gallery, "build", lambda *_: None)  # a minute; it has tests of its own
    _, wrong, count = run(NAMES.read_text(), tmp_path)
    assert not wrong, "\n".join(wrong)
    assert count >= STATED[NAMES]


@pytest.mark.long
def test_forced_paths_have_no_index_and_closed_ones_no_conjugate_points(page):
    with pytest.raises(ValueError, match="index"):
        _ = page[0]["dragged"].kind
    for name in ("orbit", "steady"):
        with pytest.raises(ValueError, match="conjugate"):
            page[0]["ao"].conjugate_points(page[0][name])


@pytest.mark.long
def test_the_files_of_the_page_are_there(page):
    files = {file.name for file in page[3].iterdir()}
    pictures = {"graphs.png", "motion.png", "motion.gif", "arrows.png", "slide.png", "paper.png"}
    assert files == {"pendulum.npz", "pendulum.html", *pictures}


@pytest.mark.parametrize("file", [GUIDE, SUITE], ids=["guide", "test_problems"])
def test_the_contents_name_the_sections(file):
    text = file.read_text()
    sections = re.findall(r"^## (.+)$", text, re.MULTILINE)
    assert re.findall(r"^\[(.+?)\]\(#", text, re.MULTILINE) == sections
    anchors = [section.lower().replace(" ", "-") for section in sections]
    assert re.findall(r"\]\(#(.+?)\)", text) == anchors
