"""The window of `explore`, moved by simulated mice."""

import re
from itertools import pairwise

import matplotlib
import numpy as np
import pytest
from matplotlib import pyplot
from matplotlib.backend_bases import KeyEvent, MouseEvent

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
def test_orbits_are_dragged_in_the_plane():
    window = plot.explore(scenes.get("kepler"))
    (panel,) = window.panels
    node = knots(window.now.trial)[2]
    place = drag(window, panel, node, (-0.5, 0.45))
    assert window.now.trial.Q[node] == pytest.approx(place, abs=1e-12)
    assert panel.ax.get_aspect() == 1.0


@pytest.mark.slow
def test_the_line_bends_as_a_whole():
    window = plot.explore(scenes.get("oscillator"))
    first = window.now.trial.Q
    node = len(first) // 2 + 20
    t = window.now.trial.tr.mesh.nodes[node]
    _, place = drag(window, window.panels[0], node, (t, 1.0))
    change = (window.now.trial.Q - first)[1:-1, 0]
    assert np.all(change > 0) and window.now.trial.Q[node, 0] == pytest.approx(place, abs=1e-12)


@pytest.mark.slow
def test_other_buttons_and_empty_places_move_nothing():
    window = plot.explore(scenes.get("oscillator"))
    first, node = window.now.trial, knots(window.now.trial)[4]
    drag(window, window.panels[0], node, (1.25, 0.9), button=3)
    mouse(window, "button_press", window.panels[0].ax.transData.transform((0.2, 0.6)))
    mouse(window, "motion_notify", window.panels[0].ax.transData.transform((0.2, 0.7)))
    assert window.now.trial is first


@pytest.mark.slow
def test_while_a_point_is_held_the_picture_is_as_if_drawn_anew():
    window = plot.explore(scenes.get("double_pendulum"))
    panel, trial, canvas = window.panels[1], window.now.trial, window.figure.canvas
    node = knots(trial)[3]
    here = panel.ax.transData.transform((trial.tr.mesh.nodes[node], trial.Q[node, 1]))
    mouse(window, "button_press", here)
    before = np.array(canvas.buffer_rgba(), dtype=int)
    mouse(window, "motion_notify", here + [3, 25])
    held = np.array(canvas.buffer_rgba(), dtype=int)
    assert np.mean(np.abs(held - before) > 50) > 1e-3  # the path and its numbers moved
    for artist in window._moving():
        artist.set_animated(False)
    canvas.draw()
    anew = np.array(canvas.buffer_rgba(), dtype=int)
    assert np.mean(np.abs(held - anew) > 50) < 1e-4  # but for what crosses an axis
    mouse(window, "button_release", here + [3, 25])
    assert window.behind is None and window.held is None


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
def test_with_a_force_no_slope_of_the_action_is_claimed():
    """S changes to first order on the motion; what vanishes is the missing force."""
    window = plot.explore(scenes.get("damped_oscillator"), units=plot.SI)
    click(window, window.solve)
    solution = window.now.solution
    T = solution.problem.duration
    t = np.linspace(0.0, T, 20001)
    bend, rate = 0.01 * np.sin(np.pi * t / T), 0.01 * np.pi / T * np.cos(np.pi * t / T)
    x, v = solution(t)[0], solution.velocity(t)[0]
    change = np.trapezoid(((v + rate) ** 2 - (x + bend) ** 2 - v**2 + x**2) / 2, t)
    assert abs(change) > 1e-3
    shown = " ".join(text.get_text() for text in window.figure.texts)
    labels = [t.get_text() for t in window.figure.legends[0].get_texts()]
    assert window.words.slope.get_text().startswith("$") is False
    assert float(window.words.slope.get_text().split()[0].replace("\N{MINUS SIGN}", "-")) < 1e-9
    assert "slope" not in shown and "S^*" not in shown and "DISTANCE FROM STATIONARY" not in shown
    assert "STATIONARY PATH" not in shown and "stationary path" not in labels
    assert "LAGRANGE" in shown and "motion" in labels
    window.figure.draw_without_rendering()
    for text in window.figure.texts:
        assert text.get_window_extent().x1 <= window.figure.bbox.x1, text.get_text()


@pytest.mark.slow
def test_keys_do_the_same():
    window = plot.explore(scenes.get("pendulum"))
    canvas, first = window.figure.canvas, window.now.trial
    for key, solved in (("x", False), ("enter", True), ("0", False)):
        event = KeyEvent("key_press_event", canvas, key)
        canvas.callbacks.process(event.name, event)
        assert np.array_equal(window.now.trial.Q, first.Q) != solved


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


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "panels"), [("kepler_polar", 2), pytest.param("heavy_top", 3, marks=pytest.mark.slow)]
)
def test_systems_of_many_coordinates_have_panels(name, panels):
    window = plot.explore(scenes.get(name))
    click(window, window.solve)
    window.figure.canvas.draw()
    assert len(window.panels) == panels
    assert len(window.missing.lines) == scenes.get(name).problem.system.n


@pytest.mark.slow
def test_a_singular_trial_is_shown_as_it_is_and_solved_from_elsewhere():
    # At rest in the centre of attraction.
    scene = scenes.get("kepler")
    window = plot.explore(scene, guess=lambda t: np.zeros((2, t.size)))
    window.figure.canvas.draw()
    assert not np.isfinite(number(window.words.action))
    click(window, window.solve)
    window.figure.canvas.draw()
    assert number(window.words.action) == pytest.approx(scene.action, abs=1e-5)
    assert "elsewhere" in window.words.message.get_text()


@pytest.mark.slow
def test_nothing_is_shown_where_there_is_no_window(capsys):
    with pytest.raises(RuntimeError, match=r"no window can be opened.*'[aA]gg'.*PyQt6.*ipympl"):
        plot.explore(scenes.get("oscillator")).show()
    assert main(["explore", "oscillator", "--set", "k=2"]) == 1
    out, err = capsys.readouterr()
    assert out == "" and err.startswith("actionopt: no window can be opened")
    assert main(["explore", "oscilator"]) == 1
    assert "did you mean 'oscillator'" in capsys.readouterr().err


def test_a_backend_that_cannot_be_loaded_says_so(monkeypatch):
    def broken(**options):
        raise ImportError("Cannot load backend 'QtAgg'")

    monkeypatch.setattr("actionopt.plot._style.new_figure", broken)
    with pytest.raises(RuntimeError, match=r"no window can be opened: Cannot load backend 'QtAgg'"):
        plot.explore(scenes.get("oscillator"))


def test_a_window_opens_where_there_is_a_display(monkeypatch):
    shown = []
    monkeypatch.setattr(matplotlib, "get_backend", lambda: "tkagg")
    monkeypatch.setattr(pyplot, "show", lambda: shown.append(pyplot.get_fignums()))
    assert main(["explore", "pendulum"]) == 0
    assert len(shown) == 1 and len(shown[0]) == 1
