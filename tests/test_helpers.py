"""Variants that are run as one test: each of them, and what is said of those that fail."""

from typing import Any

import pytest
from helpers import at_once


def test_of_variants_at_once_all_are_run_and_those_that_fail_are_named():
    run = []

    @at_once("a", [1, 2, 3])
    @at_once(("b", "c"), [(0, 1), (5, 6)])
    def each(a, b, c):
        run.append((a, b, c))
        with pytest.raises(ZeroDivisionError):
            assert a < 3 or b < 5
            if a != 2:
                raise ZeroDivisionError

    all_of_them: Any = each
    with pytest.raises(BaseExceptionGroup) as failed:
        all_of_them()
    assert len(run) == 6
    group: Any = failed.value
    several, one = group.exceptions
    assert [x.__notes__ for x in several.exceptions] == [["{'b': 0, 'c': 1}"], ["{'b': 5, 'c': 6}"]]
    assert several.__notes__ == ["{'a': 2}"]
    assert one.__notes__ == ["{'b': 5, 'c': 6}", "{'a': 3}"]
