"""The study of constants: what it changes, and what it calls another answer."""

import json
import re
from pathlib import Path

import pytest

import actionopt as ao
from actionopt.solver.refinement import refine
from actionopt.solver.search import two_sided_shooting
from benchmarks import constants


@pytest.mark.long
def test_a_constant_is_changed_wherever_it_was_imported_to_and_put_back():
    named = {c.name: c for c in constants.constants(("solver",))}
    rounds = named["ROUNDS"]
    assert rounds.value == refine.ROUNDS and rounds.readers
    assert (rounds.changed(True), rounds.changed(False)) == (2 * rounds.value, rounds.value // 2)
    before = two_sided_shooting.MOST_PAIRS
    with named["MOST_PAIRS"].set(7):
        assert two_sided_shooting.MOST_PAIRS == 7
    assert before == two_sided_shooting.MOST_PAIRS


def test_constants_that_the_page_names_are_in_the_code():
    """Else `python -m benchmarks.constants --report-only` takes them off the page."""
    known = json.loads(constants.ROWS.read_text())
    core, texts = Path(ao.__file__).parent, {}
    for room, module, name, *_ in known["rows"]:
        (file,) = (core / room).rglob(f"{module}.py")
        text = texts.setdefault(file, file.read_text())
        assert re.search(rf"^{name}\b[^=\n]* = ", text, re.MULTILINE), f"{module}.{name}"


def test_an_answer_is_another_if_status_index_or_action_is():
    answer = ("SOLVED", 1.0, 0)
    assert constants._alike(answer, ("SOLVED", 1.0 + 1e-8, 0))
    for other in (("FLOOR", 1.0, 0), ("SOLVED", 1.001, 0), ("SOLVED", 1.0, 1), (answer, answer)):
        assert not constants._alike(answer, other)


def test_what_a_child_is_killed_for_or_raises_is_an_answer():
    def fail():
        raise ZeroDivisionError

    assert constants._in_child(fail)[0][0] == "ZeroDivisionError"
    assert constants._in_child(lambda: ("SOLVED", 0.0, 0))[0] == ("SOLVED", 0.0, 0)
