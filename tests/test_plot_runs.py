"""Maps of a sweep: what is drawn is what the arrays say."""

import numpy as np
import pytest

import actionopt as ao
from actionopt import Event, Problem, System, plot

SPRING = System(lambda q, v, t, *, k: (v[0] ** 2 - k * q[0] ** 2) / 2, ["x"], parameters={"k": 1.0})
PROBLEM = Problem(SPRING, Event(0.0, [0.0]), Event(1.0, [1.0]))
T = np.linspace(-0.3, 5.0, 25)
X = np.linspace(0.5, 1.5, 8)


@pytest.fixture(scope="module")
def line():
    return ao.sweep(PROBLEM, {"t1": T}, record="index")


@pytest.fixture(scope="module")
def area():
    return ao.sweep(PROBLEM, {"t1": T, ("end", "x"): X}, record="index")


def test_one_axis_is_a_line_for_each_branch(line):
    ax = plot.runs(line, units=plot.SI)
    drawn = [(row.get_label(), np.array(row.get_ydata())) for row in ax.get_lines()]
    for label, y in drawn[:2]:
        index = int(label.removeprefix("index "))
        known = (np.floor(T / np.pi) == index) & (T > 0)
        assert np.array_equal(np.isfinite(y), known)
        assert y[known] == pytest.approx(0.5 / np.tan(T[known]), rel=1e-6)
    assert [label for label, _ in drawn] == ["index 0", "index 1", "failed"]
    assert drawn[-1][1].size == (T <= 0).sum()
    assert ax.get_xlabel() == "end time $t_{1}$ (s)" and ax.get_ylabel() == "action $S$ (J s)"
    assert ax.get_title() == "problem: action $S$, 25 paths, 2 of them failed"


@pytest.mark.long
def test_without_indices_areas_are_branches_and_other_quantities_can_be_drawn(area):
    bare = ao.sweep(PROBLEM, {"t1": [1.0, 1.5, 2.0], "k": [0.5, 1.0, 1.5]})
    assert plot.runs(bare).get_legend_handles_labels()[1] == ["branch 0"]
    for quantity in ("error", "index", "branch"):
        plot.runs(area, quantity)
    with pytest.raises(ValueError, match="one of action, error, branch to draw, found 'index'"):
        plot.runs(bare, "index")
    with pytest.raises(ValueError, match="found 'colour'"):
        plot.runs(bare, "colour")


def test_more_axes_cannot_be_drawn():
    over = {"t1": [1.0], "k": [1.0], ("end", "x"): [1.0]}
    for zipped, said in ((False, "found 3 quantities; draw"), (True, "3 quantities zipped")):
        with pytest.raises(ValueError, match=said):
            plot.runs(ao.sweep(PROBLEM, over, zip=zipped))


@pytest.mark.long
def test_it_is_written_to_a_file(area, tmp_path):
    plot.save_runs(area, tmp_path / "map.svg")
    assert (tmp_path / "map.svg").read_text().startswith("<?xml")
    with pytest.raises(ValueError, match="expected a file that ends in"):
        plot.save_runs(area, tmp_path / "map.txt")
