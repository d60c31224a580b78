"""Profiles against hand-made costs, and the report against its records."""

import re

import numpy as np
import pytest

from actionopt.suite import profile
from actionopt.suite.report import write


def record(solver, problem, verdict, seconds, count, n=9):
    return {
        "solver": solver,
        "problem": problem,
        "verdict": verdict,
        "class": f"QUR2-MN-{n}-0",
        "n": n,
        "seconds": seconds,
        "evaluations": {"f": count},
    }


RECORDS = [
    record("a", "p", "right", 1.0, 10),
    record("b", "p", "right", 3.0, 5),
    record("a", "q", "wrong", 0.1, 1),
    record("b", "q", "right", 2.0, 40),
    record("a", "r", "other", 1.0, 20),
    {"solver": "b", "problem": "r", "verdict": "limit", "word": "no answer"},
    record("a", "s", "right", 4.0, 30, n=2),
    record("b", "s", "failed", 1.0, 1, n=2),
]


def test_performance_profiles_by_hand():
    steps = profile.performance(profile.costs(RECORDS, "seconds", profile.RIGHT))
    np.testing.assert_array_equal(steps["a"], ([1, 1], [0.25, 0.5]))
    np.testing.assert_array_equal(steps["b"], ([1, 3], [0.25, 0.5]))
    steps = profile.performance(profile.costs(RECORDS, "evaluations", profile.STATIONARY))
    np.testing.assert_array_equal(steps["a"], ([1, 1, 2], [0.25, 0.5, 0.75]))
    np.testing.assert_array_equal(steps["b"], ([1, 1], [0.25, 0.5]))


def test_data_profiles_by_hand():
    table = profile.costs(RECORDS, "evaluations per unknown", profile.RIGHT)
    steps = profile.data(table)
    np.testing.assert_array_equal(steps["a"], ([1, 10], [0.25, 0.5]))
    np.testing.assert_array_equal(steps["b"], ([0.5, 4], [0.25, 0.5]))


def test_the_report_says_what_the_records_say(tmp_path):
    records = [*RECORDS, record("/far/away/mine.py:solve", "p", "right", 1.0, 1)]
    page = write(records, tmp_path)
    text = page.read_text()
    assert "9 runs: 3 solvers on 4 problems" in text
    assert re.search(r"<td>a</td><td>2</td><td>1</td><td>0</td><td>1</td><td>0</td>", text)
    assert "<td>a</td><td>2 / 4</td>" in text
    assert "mine.py:solve" in text
    assert "/far" not in text
    assert "actionopt suite run \\\n  --solver a \\\n  --solver b" in text
    figures = re.findall(r'src="([^"]+)"', text)
    assert len(figures) >= 4
    for name in figures:
        assert (tmp_path / name).read_text().rstrip().endswith("</svg>")
    absent = {"solver": "c", "problem": "p", "verdict": "absent", "word": "not here", "allowed": 9}
    more = write([*records, absent], tmp_path / "more")
    assert more.read_text().count("<td>c</td>") == 1  # among the verdicts alone
    assert "actionopt suite run --seconds 9 \\\n  --solver c\n" in more.read_text()
    assert (tmp_path / "more" / "data.svg").read_bytes() == (tmp_path / "data.svg").read_bytes()
    with pytest.raises(ValueError, match="at least one run"):
        write([], tmp_path)


def test_profiles_are_drawn_as_they_are(tmp_path):
    from actionopt.plot.profiles import profiles, save

    ax = profiles({"a": (np.array([1.0, 3.0]), np.array([0.5, 1.0])), "b": (np.empty(0),) * 2})
    x, y = ax.lines[0].get_data()
    np.testing.assert_array_equal(x, [1, 1, 3, 3])
    np.testing.assert_array_equal(y, [0, 0.5, 1, 1])
    np.testing.assert_array_equal(ax.lines[1].get_ydata(), [0, 0])
    save(ax, tmp_path / "profiles.svg")
    assert "<svg" in (tmp_path / "profiles.svg").read_text()
