"""The window of `explore`, moved by simulated mice."""

import re
from itertools import pairwise

import matplotlib
import numpy as np
import pytest
from matplotlib import pyplot
from matplotlib.backend_bases import MouseEvent

from actionopt import plot, scenes
from actionopt.cli import main
from actionopt.plot.data.trial import knots


def mouse(window, kind, at, button=1):
    canvas = window.figure.canvas
    event = MouseEvent(f"{kind}_event", canvas, *at, button=button)
    canvas.callbacks.process(event.name, event)


def drag(window, panel, node, to, button=1):
    """Drag the node of the trial shown in a panel to a place there, in steps, and let go.

    Return the place: a mouse stands on a whole pixel.
    """
    trial, ax = window.now.trial, panel.ax
    here = np.array(panel.project(trial.tr.mesh.nodes, trial.Q.T))[:, node]
    a, b = ax.transData.transform(here), np.floor(ax.transData.transform(to))
    place = ax.transData.inverted().transform(b)
    mouse(window, "button_press", a, button)
    for part in (0.3, 0.7, 1.0):
        mouse(window, "motion_notify", a + part * (b - a), button)
    mouse(window, "button_release", b, button)
    return place


def click(window, button):
    box = button.ax.get_window_extent()
    at = (box.x0 + box.x1) / 2, (box.y0 + box.y1) / 2
    mouse(window, "button_press", at)
    mouse(window, "button_release", at)


def number(text):
    return float(re.search(r"= (\S+)", text.get_text())[1].replace("\N{MINUS SIGN}", "-"))


@pytest.mark.long
def test_dragging_a_point_shows_the_action_of_the_bent_path():
    window = plot.explore(scenes.get("oscillator"))
    (panel,) = window.panels
    trial = window.now.trial
    before = number(window.words.action)
    node = knots(trial)[4]
    t = trial.tr.mesh.nodes[node]
    _, place = drag(window, panel, node, (t, 0.9))
    path = window.now.trial.path
    assert place == pytest.approx(0.9, abs=5e-3)
    assert path(t)[0] == pytest.approx(place, abs=1e-12)
    # S = int (v^2 - x^2) / 2 dt, by Gauss and Legendre's rule between the knots.
    xi, w = np.polynomial.legendre.leggauss(20)
    times = trial.tr.mesh.nodes[knots(trial)]
    S = 0.0
    for a, b in pairwise(times):
        s = a + (b - a) * (xi + 1) / 2
        S += (b - a) / 4 * w @ (path.velocity(s)[0] ** 2 - path(s)[0] ** 2)
    assert abs(S - before) > 1e-2
    assert number(window.words.action) == pytest.approx(S, abs=1e-6)
    drawn = np.array(panel.trial.get_data())
    assert np.array_equal(drawn, [path.mesh.nodes, path.values[0]])
    assert panel.points.get_ydata()[3] == pytest.approx(place)  # the ends are no points


@pytest.mark.slow
def test_the_buttons_solve_and_start_over():
    scene = scenes.get("oscillator")
    window = plot.explore(scene, units=plot.SI)
    first = window.now.trial
    assert "press Solve" in window.words.rise.get_text()
    click(window, window.solve)
    assert number(window.words.action) == pytest.approx(scene.action, abs=1e-6)
    assert number(window.words.rise) == 0.0
    assert float(window.words.slope.get_text().replace("\N{MINUS SIGN}", "-").split()[0]) < 1e-9
    assert window.words.slope.get_text().endswith("J s")
    assert np.nanmax(np.abs(window.missing.lines[0].get_ydata())) < 1e-7
    assert window.words.kind.get_text() == "minimum, index 0"
    click(window, window.again)
    assert np.array_equal(window.now.trial.Q, first.Q)
    assert number(window.words.rise) == pytest.approx(first.action - scene.action, abs=1e-4)


@pytest.mark.slow
def test_sliding_the_end_time_through_pi_changes_the_index():
    window = plot.explore(scenes.get("oscillator"))
    shown = []
    for t in (3.0, 3.15, 3.3):
        window.slider.set_val(t)
        shown.append(window.words.kind.get_text())
    assert shown == ["minimum, index 0", "degenerate, index 0", "saddle, index 1"]
    assert window.slider.val == 3.3 == window.now.trial.tr.problem.end.t
    assert window.words.passed.get_text().endswith("$t$ = 3.142 s")
    assert window.words.message.get_text() == ""
    window.slider.set_val(3.15)  # near enough to pi to be pi
    assert window.slider.val == pytest.approx(np.pi, abs=1e-9)
    assert "conjugate to the start" in window.words.message.get_text()
    assert window.marks.get_xdata() == pytest.approx([np.pi, 2 * np.pi], abs=1e-9)


def test_a_backend_that_cannot_be_loaded_says_so(monkeypatch):
    def broken(*size, layout):
        raise ImportError("Cannot load backend 'QtAgg'")

    monkeypatch.setattr("actionopt.plot._style.new_figure", broken)
    with pytest.raises(RuntimeError, match=r"no window can be opened: Cannot load backend 'QtAgg'"):
        plot.explore(scenes.get("oscillator"))


@pytest.mark.long
def test_a_window_opens_where_there_is_a_display(monkeypatch):
    shown = []
    monkeypatch.setattr(matplotlib, "get_backend", lambda: "tkagg")
    monkeypatch.setattr(pyplot, "show", lambda: shown.append(pyplot.get_fignums()))
    assert main(["explore", "pendulum"]) == 0
    assert len(shown) == 1 and len(shown[0]) == 1


@pytest.mark.long
def test_where_figures_are_pictures_it_is_the_live_page():
    with plot.language("de"):
        window = plot.explore(scenes.get("oscillator"))
    shown = window._repr_html_()
    assert (
        shown.startswith("<iframe srcdoc=") and "data-live=" in shown and "lang=&quot;de" in shown
    )
    window.figure.canvas.required_interactive_framework = "qt"  # a window, which is shown itself
    assert window._repr_html_() is None
