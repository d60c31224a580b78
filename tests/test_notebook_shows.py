"""What a notebook shows of objects, and films as pages."""

import xml.etree.ElementTree as ET

import numpy as np
import pytest
from helpers import at_once, solved

import actionopt as ao
from actionopt import plot, scenes
from actionopt.plot._relaxation import frame_count
from actionopt.tools.notebook import PICTURE_WIDTH


def whole(html):
    """Return HTML read as XML."""
    return ET.fromstring(f"<p>{html.replace('&nbsp;', ' ')}</p>")


def words(html):
    return " ".join("".join(whole(html).itertext()).split())


def test_a_system_shows_its_formulas():
    html = scenes.get("pendulum").problem.system._repr_html_()
    said = [m.get("alttext") for m in whole(html).iter("math")]
    assert said == ["L = m l^2 theta'^2 / 2 + m l g cos theta", "l theta'' = -g sin theta"]


def test_a_system_too_long_to_read_shows_its_name():
    def L(q, v, t):
        return v @ v / 2 - np.arctan2(q[0], q[1] + 2)

    system = ao.System(L, ["x", "y"], name="<angle>")
    assert words(system._repr_html_()) == "System(<angle>: x, y)"


def test_a_problem_shows_its_events():
    said = words(scenes.get("projectile").problem._repr_html_())
    assert "x03" in said and "y01" in said and "g9.81" in said


def test_a_solution_shows_numbers_and_path():
    html = solved("rod_pendulum")._repr_html_()
    said = words(html)
    assert "9.648145" in said and "minimum, Morse index 0" in said
    lines = [e for e in whole(html).iter("polyline")]
    assert len(lines) == 2
    points = np.array([p.split(",") for p in lines[1].get("points").split()], dtype=float)
    y = solved("rod_pendulum")(np.linspace(0, 1, len(points)))[1]
    assert np.corrcoef(points[:, 1], y)[0, 1] < -0.9999  # y is drawn downward
    first, last = points[[0, -1], 0]  # in the middle across
    assert first + last == pytest.approx(PICTURE_WIDTH, abs=0.1) and last - first > first
    assert "Morse" not in words(solved("drag_linear")._repr_html_())


def test_all_paths_show_a_row_each():
    problem = scenes.get("oscillator").problem
    html = ao.solve_all(problem)._repr_html_()
    assert len(list(whole(html).iter("tr"))) == 1
    assert "there are no others" in words(html)


def test_an_animation_is_a_player():
    scene = scenes.get("pendulum")
    shown = plot.animation(solved("pendulum"), scene.draw, seconds=0.12)
    assert "<script" in shown._repr_html_()


def test_a_film_is_a_page(chromium, tmp_path):
    file = tmp_path / "top.html"
    plot.film(solved("heavy_top"), scenes.get("heavy_top").draw, file, units=plot.SI)
    text = file.read_text(encoding="utf-8")
    assert len(text) < 400e3 and "http://" not in text.replace("http://www.w3.org", "")
    chromium.open(file, still=True)
    places = "[...document.querySelectorAll('.body')].map(b => b.getAttribute('cx'))"
    here = chromium.run(places)
    chromium.run("document.querySelector('[data-turn]').focus()")
    chromium.key("ArrowRight")
    turned = chromium.run(places)
    chromium.run("document.querySelector('[data-step=\"1\"]').click()")
    assert chromium.run("Number(document.querySelector('[data-film]').dataset.frame)") == 1
    assert len({*here, *turned, *chromium.run(places)}) == 3
    assert chromium.errors == []


@pytest.mark.long
def test_a_relaxation_that_runs_away_lasts():
    """Of an elastic pendulum, which takes six steps."""

    def lagrangian(q, v, t):
        return (
            (v[0] ** 2 + (q[0] * v[1]) ** 2) / 2 - 20 * (q[0] - 1) ** 2 + 9.81 * q[0] * np.cos(q[1])
        )

    problem = ao.Problem(
        ao.System(lagrangian, ["r", "theta"]), ao.Event(0.0, [1.2, 0.5]), ao.Event(3.0, [1.4, -0.3])
    )
    data = plot.relaxation_data(ao.solve(problem))
    assert not data.arrived and data.action.size < 40
    assert frame_count(data, 25) == 75
    there = plot.relaxation_data(solved("oscillator"))
    assert there.arrived and frame_count(there, 25) == there.action.size


@at_once("name", ["φ", "θ_1", "_a", "x2_b", "longName"])
def test_any_name_of_a_coordinate_or_parameter_is_shown(name):
    law = eval(f"lambda q, v, t, *, {name}: v[0] ** 2 / 2 - {name} * q[0] ** 2")
    shown = ao.System(law, [name], parameters={name: 1.0})._repr_html_()
    assert len(list(whole(shown).iter("math"))) == 2


def test_the_multiplier_of_an_integral_is_shown_as_kappa():
    rope = ao.Problem(
        ao.System(lambda q, v, t: v[0] ** 2 / 2, ["y"], integral=lambda q, v, t: q[0] * v[0]),
        ao.Event(0, [0.0]),
        ao.Event(1, [1.0]),
        integral=0.5,
    )
    said = [m.get("alttext") for m in whole(rope.system._repr_html_()).iter("math")]
    assert said[0] == "L = y'^2 / 2 + kappa y y'"
