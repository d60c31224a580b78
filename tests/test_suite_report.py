"""Profiles against hand-made costs, and the report against its records."""

import re
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from helpers import record

from actionopt import suite
from actionopt.plot import profiles
from actionopt.suite import known, profile, report
from actionopt.suite.page import figure
from actionopt.suite.report import write
from actionopt.suite.runner import load

PUBLISHED = Path(__file__).parents[1] / "docs" / "suite"

RECORDS = [
    record("a", "p", seconds=1.0, count=10),
    record("b", "p", seconds=3.0, count=5),
    record("a", "q", None, history=[]),
    record("b", "q", seconds=2.0, count=40),
    record("a", "r", "other", seconds=1.0, count=20, above=True),
    {"solver": "b", "problem": "r", "outcome": "limit", "word": "no answer"},
    record("a", "s", seconds=4.0, count=30, off=1e-4, n=2),
    record("b", "s", None, said="gave up", history=[]),
]


def plain(page):
    """Return a page with spaces that may end a line in place of those that may not."""
    return page.read_text().replace("\N{NO-BREAK SPACE}", " ")


def test_performance_profiles_by_hand():
    def steps(measure, mode, accuracy):
        return profile.performance(profile.costs(RECORDS, measure, mode, accuracy))

    found = steps("seconds", "stationary", 1e-3)
    np.testing.assert_array_equal(found["a"], ([1, 1], [0.25, 0.5]))
    np.testing.assert_array_equal(found["b"], ([1, 3], [0.25, 0.5]))
    found = steps("f", "minimise", 1e-3)
    np.testing.assert_array_equal(found["a"], ([1, 2], [0.25, 0.5]))
    np.testing.assert_array_equal(found["b"], ([1, 1], [0.25, 0.5]))
    found = steps("f", "minimise", 1e-6)  # the answer to s is too far for that
    np.testing.assert_array_equal(found["a"], ([2], [0.25]))


def test_what_is_not_scored_is_not_counted():
    """A solver that is not there, or was not run; a mistake in its file is a failure."""
    unscored = [
        record("c", "p"),
        {"solver": "c", "problem": "q", "outcome": "error", "trace": "here"},
        {"solver": "c", "problem": "r", "outcome": "absent"},
        record("d", "p", seconds=0.5),
    ]
    table = profile.costs([*RECORDS, *unscored], "seconds", "minimise", 1e-3)
    np.testing.assert_array_equal(table["c"], [1, np.inf, np.nan, np.nan])
    np.testing.assert_array_equal(table["d"], [0.5, np.nan, np.nan, np.nan])
    found = profile.performance(table)
    np.testing.assert_array_equal(found["c"], ([2], [0.5]))
    np.testing.assert_array_equal(found["d"], ([1], [1.0]))
    np.testing.assert_array_equal(found["a"], ([1, 2], [0.25, 0.5]))
    data = profile.evaluations_per_unknown([*RECORDS, *unscored], 1e-3)
    np.testing.assert_array_equal(np.isnan(data["c"]), [False, False, True, True])


def test_what_is_done_in_no_time_is_not_in_profiles_of_time():
    records = [
        *(record(s, "p", seconds=t) for s, t in (("a", 0.001), ("b", 1.0))),
        *(record(s, "q", seconds=t) for s, t in (("a", 0.1), ("b", 0.2))),
    ]
    found = profile.costs(records, "seconds", "minimise", 1e-3)
    assert {solver: row.tolist() for solver, row in found.items()} == {"a": [0.1], "b": [0.2]}


def test_a_solver_has_one_colour_in_all_figures():
    line = (np.array([1.0]), np.array([0.5]))
    every, few = (
        {h.get_label(): h.get_color() for h in profiles.profiles(steps).get_lines()}
        for steps in ({"a": line, "b": line, "c": line}, {"a": line, "b": None, "c": line})
    )
    assert few == {name: every[name] for name in "ac"} and every["b"] != every["c"]


def test_data_profiles_by_hand():
    """f(x) <= f_L + tau (f(x_0) - f_L), counted in evaluations of f over n + 1."""
    history = [(1, 11.0, 0.0), (20, 2.0, 0.0), (40, 1.005, 0.0), (70, 1.0, 0.0)]
    records = [
        record("a", "p", history=history),
        record("b", "p", "other", f_there=0.0, history=[(1, 11.0, 0.0), (30, 0.0, 0.0)], index=0),
        record("a", "q", history=[(1, 11.0, 0.0), (10, 0.5, 1e-2), (50, 1.0, 1e-7)]),
        record("b", "q", None, history=[(1, 11.0, 0.0), (30, 1.9, 0.0)]),
        record("a", "u", None, unbounded=True, history=[(1, 1.0, 0.0)]),
    ]
    # Of p, b found less: f_L is 0, and a comes no nearer than 1/11 of the way.
    tables = {tau: profile.evaluations_per_unknown(records, tau) for tau in (0.2, 1e-2, 1e-3)}
    np.testing.assert_array_equal(tables[0.2]["a"], [2, 1])
    np.testing.assert_array_equal(tables[0.2]["b"], [3, 3])
    np.testing.assert_array_equal(tables[1e-2]["a"], [np.inf, 1])
    np.testing.assert_array_equal(tables[1e-3]["a"], [np.inf, 5])  # feasible by then
    np.testing.assert_array_equal(tables[1e-3]["b"], [3, np.inf])
    np.testing.assert_array_equal(profile.data(tables[0.2])["a"], ([1, 2], [0.5, 1.0]))
    records[1]["index"] = 1  # nobody minimises to a saddle
    table = profile.evaluations_per_unknown(records, 1e-3)
    np.testing.assert_array_equal(table["a"], [4, 5])
    near = profile.evaluations_per_unknown(records[:1], 1e-2)
    np.testing.assert_array_equal(near["a"], [4])  # 1 + 10 tau = 1.1 is reached at 40 of 10


@pytest.mark.long
def test_the_report_says_what_the_records_say(tmp_path, monkeypatch):
    drawn, real = [], profiles.save

    def save(ax, file):  # the figures differ in curves and words alone: one stands for all
        if not drawn:
            real(ax, file)
        drawn.append(file)
        file.write_bytes(drawn[0].read_bytes())

    monkeypatch.setattr(profiles, "save", save)
    records = [*RECORDS, record("/far/away/mine.py:solve", "p")]
    page = write(records, tmp_path)
    text = plain(page)
    assert "9 runs: 3 solvers on 4 problems" in text
    minimise, stationary = text.split("Asked to find the stationary point")
    row = r"<td>a</td><td>2 \(1\)</td><td>1</td><td>0</td><td>1</td><td>0</td>"
    assert re.search(row, minimise)
    assert re.search(row, stationary)
    assert "<td>a</td><td>2 / 4</td>" in text
    assert "mine.py:solve" in text
    assert "/far" not in text and "None" not in text
    assert "actionopt suite run \\\n  --solver a \\\n  --solver b" in text
    assert "overflow-x" in text
    figures = re.findall(r'src="([^"]+)"', text)
    assert len(figures) == 10
    for name in figures:
        assert (tmp_path / name).read_text().rstrip().endswith("</svg>")
    assert "Mistakes" not in text and "not known" not in text.split("Problem by problem")[1]
    with pytest.raises(ValueError, match="at least one run"):
        write([], tmp_path)


def test_the_report_tells_meshes_starts_and_parameters_apart(tmp_path, monkeypatch):
    monkeypatch.setattr("actionopt.suite.report._figure", lambda *arguments: "")
    ipopt = {"elements": 8, "degree": 4, "start": "straight", "own_start": "straight"}
    ipopt |= {"repeats": 3, "content": "casadi 3", "machine": "one core", "date": "2020-01-01"}
    records = [
        record("ipopt", "pendulum", **ipopt),
        record("ipopt", "pendulum", None, **(ipopt | {"elements": 9, "start": "perturbed"})),
        record("ipopt", "pendulum", **(ipopt | {"parameters": {"decades": 2}, "allowed": 9})),
        record("ipopt", "pendulum", None, said="gave up", **ipopt),  # run again: the last counts
        record("new", "pendulum", "new", f_there=0.5, **(ipopt | {"date": "2020-02-01"})),
        {"solver": "my.py:f", "problem": "pendulum", "outcome": "error", "trace": "line 7"} | ipopt,
    ]
    text = plain(write(records, tmp_path))
    assert "5 runs: 3 solvers on 3 problems, 2020-01-01 to 2020-02-01, one core" in text
    matrix = text.split("Problem by problem")[1].split("<h3>")[1]
    rows = re.findall(r"<tr><td>(pendulum[^<]*)</td>.*?<td>(\d+ x \d+)</td>(.*)</tr>", matrix)
    assert [(name, mesh) for name, mesh, _ in rows] == [
        ("pendulum", "8 x 4"),
        ("pendulum", "9 x 4"),
        ("pendulum (decades = 2)", "8 x 4"),
    ]
    assert [re.findall(">(failed|wrong|right)<", row) for _, _, row in rows] == [
        ["failed", "right"],
        ["wrong"],
        ["right"],
    ]
    assert matrix.count("<td>QUR2-MN-9-0</td>") == 3
    assert "<td>straight</td>" in rows[0][2] and "<td>perturbed</td>" in rows[1][2]
    commands = re.findall(r"actionopt suite run[^a]*(?:a(?!ctionopt)[^a]*)*", text)
    words = [" ".join(c.replace("\\", "").split()) for c in commands]
    assert words[:3] == [
        "actionopt suite run --solver ipopt --solver new --solver my.py:f --problem pendulum",
        "actionopt suite run --solver ipopt --elements 9 --start perturbed --problem pendulum",
        "actionopt suite run --solver ipopt --set decades=2 --seconds 9 --problem pendulum",
    ]
    assert "that were not known" in text and "<td>0.5</td>" in text
    assert "<pre>line 7</pre>" in text
    assert "casadi 3" in text


def test_models_are_among_the_problems(tmp_path, monkeypatch):
    monkeypatch.setattr("actionopt.suite.report._figure", lambda *arguments: "")
    known = record("a", "pendulum_row", start="own", own_start="own")
    none = record("a", "arm_in_disc", said="infeasible", infeasible=True, least=True)
    del none["f_star"]
    text = plain(write([known, none, record("a", "p")], tmp_path))
    assert "2 of the problems are models" in " ".join(text.split())
    assert "<td>several optima, barrier</td>" in text and "<td>infeasible</td>" in text
    words = " ".join(text.replace("\\", "").split())
    assert "--solver a --models --problem arm_in_disc --problem pendulum_row" in words


@pytest.mark.slow
def test_what_is_published_is_what_the_records_say(tmp_path, monkeypatch):
    monkeypatch.setattr(profiles, "save", lambda ax, file: None)
    records = load(PUBLISHED / "results.jsonl")
    write(records, tmp_path)
    for page in ("index.html", "dials.html"):
        assert (tmp_path / page).read_text() == (PUBLISHED / page).read_text()
    searched = {name.split()[0] for name in known.table()}
    for r in records:
        if r["problem"] in searched and not r["parameters"] and "f_lowest" in r:
            least = lowest(r["problem"], r["elements"], r["degree"])
            assert r["f_lowest"] == pytest.approx(least, rel=1e-9), r["problem"]
    late = [r for r in records if r["outcome"] == "limit" and r["word"] != "out of memory"]
    assert late and all(r["processor"] >= r["allowed"] for r in late)


@cache
def lowest(name, elements, degree):
    """Return the least f known of a minimum."""
    return suite.get(name, elements, degree).lowest


def test_a_figure_stands_beside_its_page(tmp_path, monkeypatch):
    saved = []
    monkeypatch.setattr("actionopt.plot.profiles.save", lambda ax, file: saved.append((ax, file)))
    assert figure(3, tmp_path, "a", "b & c") == '<p><img src="a.svg" alt="b &amp; c"></p>'
    assert saved == [(3, tmp_path / "a.svg")]
    steps = {"s": SimpleNamespace()}
    drawn = "actionopt.plot.profiles.profiles"
    monkeypatch.setattr(drawn, lambda given, xlabel, least: (given, xlabel, least))
    shown = report._figure(steps, tmp_path, "d", "time", 0.1)
    assert shown.startswith('<p><img src="d.svg" alt="time"')
    assert saved[-1] == ((steps, "time", 0.1), tmp_path / "d.svg")


def test_a_page_of_dials_is_linked_where_one_was_turned(tmp_path, monkeypatch):
    monkeypatch.setattr(report.dial_report, "write", lambda records, folder: folder / "dials.html")
    monkeypatch.setattr(report, "on_a_dial", lambda record: record == "turned")
    assert report._dials(["left"], tmp_path) == ""
    assert '<a href="dials.html">along the dials</a>' in report._dials(["left", "turned"], tmp_path)
