"""Scenes that are no mechanics: what their S stands for, and the units they are shown in."""

import re

import numpy as np
import pytest
from helpers import solved

from actionopt import scenes
from actionopt.gallery import film, scene_page
from actionopt.gallery.subject import Subject
from actionopt.gallery.texts import texts
from actionopt.plot._names import units_of
from actionopt.plot.live.page import figure

MEASURED = [name for name in scenes.SCENES if scenes.get(name).measure]


def test_a_measure_is_the_number_that_is_known_otherwise():
    """The fall of a cycloid, the area of a catenoid, and New York to London by geodesics."""
    known = {"brachistochrone": "fall_time", "catenoid": "area", "soap_bridge": "area"}
    for name, fact in known.items():
        for more in ({}, {"duration": 2.5}):
            scene = scenes.get(name, **more)
            found = scene.measure.of(scene.action, scene.problem.duration)
            assert found == pytest.approx(scene.facts[fact], rel=1e-9)
    # The length of the geodesic on WGS 84, Karney's GeographicLib: 5549.682 km
    ellipse = scenes.get("great_ellipse")
    length = ellipse.measure.of(solved("great_ellipse").action, ellipse.problem.duration)
    assert length == pytest.approx(5549.682e3, abs=1.0)


def test_a_mechanical_scene_has_no_measure():
    assert {"projectile", "kepler", "kink", "pendulum"}.isdisjoint(MEASURED)
    assert {"heron", "great_ellipse", "mirage"} <= set(MEASURED)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["catenoid", "zermelo", "exit_path"])
def test_no_joule_stands_beside_what_is_no_energy(name):
    s = Subject(scenes.get(name), solved(name))
    units = units_of(s.scene)
    text = film.film(s) + scene_page._result_part(s) + scene_page._events(s)
    text += figure(s.solution.problem, s.solution, units=units, measure=s.scene.measure)
    shown = re.sub(r"<script.*?</script>", "", text, flags=re.S)
    assert not re.search(r"[\d\xa0 ](J|N)( s| m|\xa0s)?\b", shown)
    assert '"action":"J' not in text and '"energy":"J' not in text
    assert "J s" not in scene_page.run(s.scene, texts(name))[0]


@pytest.mark.slow
def test_the_page_sums_what_is_measured(chromium, tmp_path):
    from actionopt import plot

    scene = scenes.get("catenoid")
    plot.page(scene, tmp_path / "film.html")
    chromium.open(tmp_path / "film.html", still=True)
    chromium.run("document.querySelector('[data-do=solve]').click()")
    words = chromium.run("document.querySelector('.live .action').textContent")
    area = float(re.match(r"area = ([\d.]+)\xa0m\u00b2", words)[1])
    assert area == pytest.approx(scene.facts["area"], abs=1e-3)
    assert np.isfinite(area)
