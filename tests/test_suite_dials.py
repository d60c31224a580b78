"""Dials: their members, their runs, and the page that is made of these."""

from pathlib import Path
from types import SimpleNamespace

import helpers
import numpy as np
import pytest

from actionopt import suite
from actionopt.cli import main
from actionopt.suite import dial_report, profile, runner
from actionopt.suite.commands import _on_dials
from actionopt.suite.dials import DIALS, Dial

ECCENTRICITY = DIALS["eccentricity"]


def record(solver, problem, parameters=None, *, right=True, **more):
    """Return a record as the runner writes it; of a dial's member unless told otherwise."""
    mesh = {name: getattr(ECCENTRICITY, name) for name in ("elements", "degree", "start")}
    counts = {"f": 30, "grad": 20, "hess": 60}
    mine = mesh | {
        "parameters": parameters or {},
        "off": 0.0 if right else 1.0,
        "evaluations": counts,
    }
    return helpers.record(solver, problem, **(mine | more))


@pytest.mark.long
@pytest.mark.parametrize(
    "dial",
    helpers.a_quarter([*DIALS.values()][:9], 1)
    + [pytest.param(DIALS["pegs"], marks=pytest.mark.slow)],
    ids=list(DIALS)[:10],
)
def test_members_of_a_dial_have_optima_and_grow_harder(dial):
    assert len(dial.values) >= 6 and list(dial.values) == sorted(dial.values)
    ends = dial.values[0], dial.values[-1]
    easy, hard = (p for value, p in dial.members() if value in ends)
    for problem in (easy, hard):
        assert dial.start in problem.start_names
        assert np.isfinite(problem.f_star)
    assert easy.index_star == 0
    if dial.name not in ("eccentricity", "layer", "units", "contacts", "pegs"):
        assert hard.index_star > 0
    if dial.name == "negative curvature":
        indices = [p.index_star for _, p in dial.members()]
        assert indices == [int(T / np.pi) for T in dial.values]  # conjugate times are k pi


def test_what_is_asked_for_in_parts_are_the_dials_of_the_issue():
    wanted = {"eccentricity", "links", "duration", "stiffness", "negative curvature"}
    assert wanted <= set(DIALS)
    assert sum(len(dial.values) for dial in DIALS.values()) + len(suite.FAMILIES) >= 100


def test_records_are_found_on_their_dial():
    at = record("a", "kepler", {"eccentricity": 0.4})
    assert ECCENTRICITY.value(at) == 0.4 and dial_report.on_a_dial(at)
    for other in (
        at | {"elements": 8},
        at | {"start": "straight"},
        at | {"parameters": {"eccentricity": 0.41}},
        at | {"parameters": {"eccentricity": 0.4, "decades": 2}},
        at | {"problem": "kepler_polar"},
    ):
        assert ECCENTRICITY.value(other) is None and not dial_report.on_a_dial(other)


def test_where_solvers_do_not_agree_is_counted_by_hand():
    records = [
        record("a", "kepler", {"eccentricity": 0.2}),
        record("b", "kepler", {"eccentricity": 0.2}),
        record("a", "kepler", {"eccentricity": 0.4}),
        record("b", "kepler", {"eccentricity": 0.4}, right=False),
        record("a", "heavy_top"),
        record("b", "heavy_top", outcome="failed"),
        record("a", "pendulum"),
        record("b", "chain", outcome="limit"),  # a machine's verdict, not the solver's
        record("a", "chain"),
        record("b", "pendulum", outcome="absent"),  # not scored: not all have answered
    ]
    apart, members = dial_report.disagreeing(records)
    assert members == 3
    assert apart == [profile.question_key(records[2]), profile.question_key(records[4])]


@pytest.mark.long
def test_the_published_runs_are_apart_and_hard():
    """Counted in what the page is made of: where six solvers differ, and what is hard for Ipopt."""
    records = runner.load(Path(__file__).parents[1] / "docs" / "suite" / "results.jsonl")
    dials = [r for r in records if dial_report.on_a_dial(r)]
    if not dials:
        pytest.skip("published before there were dials")
    solvers = {r["solver"] for r in dials}
    assert len(solvers) >= 6
    apart, members = dial_report.disagreeing([r for r in records if r["solver"] in solvers])
    assert len(apart) >= 60 and members >= 100
    assert len(dial_report.hard(records)) >= 10


def test_easy_families_are_not_called_hard():
    rows = [record("ipopt", name) for name in ("heavy_top", "oscillator_past", "pendulum")]
    assert [row[0] for row in dial_report.hard(rows)] == ["heavy_top", "oscillator_past"]
    few = [r | {"evaluations": {"hess": 50}} for r in rows]
    assert dial_report.hard(few) == []
    assert len(dial_report.hard([few[0] | {"outcome": "failed"}])) == 1


def test_a_dial_is_asked_for_by_its_name():
    options = SimpleNamespace(dial=["units"], solver=["ipopt", "uno"], repeats=1)
    cells = _on_dials(options)
    assert len(cells) == 2 * len(DIALS["units"].values)
    found = []
    for cell in cells[::2]:
        problem = cell.make()
        mesh = {"elements": problem.mesh.elements, "degree": max(problem.mesh.degrees)}
        found.append(DIALS["units"].value({**vars(cell), **mesh}))
    assert found == list(DIALS["units"].values)
    with pytest.raises(SystemExit):
        main(["suite", "run", "--solver", "ipopt", "--dial", "colour"])


def test_the_tables_of_dials_have_the_members_on_these(tmp_path, monkeypatch):
    monkeypatch.setattr(dial_report, "_figure", lambda *_: "")
    records = [record("a", "kepler", {"eccentricity": e}) for e in (0.2, 0.8)]
    text = dial_report.write(records, tmp_path).read_text()
    assert "<h2>Eccentricity</h2>" in text and "<h2>Links</h2>" not in text


@pytest.mark.parametrize(("values", "scales"), [((1.0, 40.0), []), ((1.0, 60.0), ["log"])])
def test_values_over_more_than_a_decade_and_a_half_are_drawn_by_their_logarithms(
    monkeypatch, values, scales
):
    found = []
    axes = SimpleNamespace(set_xscale=found.append)
    monkeypatch.setattr("actionopt.plot.profiles.dial", lambda curves, xlabel: axes)
    monkeypatch.setattr(dial_report, "figure", lambda *_: "")
    dial = SimpleNamespace(values=values, parameter="k", name="k")
    dial_report._figure({}, Path(), dial)
    assert found == scales


def test_a_dial_yields_its_members():
    dial = Dial("far", "pendulum", "duration", (1.0, 2.0), 2, 3, "straight", "time")
    (a, one), (b, two) = dial.members()
    assert (a, b) == (1.0, 2.0)
    assert (one.transcription.mesh.duration, two.transcription.mesh.duration) == (1.0, 2.0)
    assert one.transcription.mesh.elements == 2
