"""Scenes of one's own have the page of a scene, whatever they ask."""

import numpy as np
import pytest

import actionopt as ao
from actionopt import scenes
from actionopt.cli import main
from actionopt.gallery import builder
from actionopt.gallery.page import Page
from actionopt.gallery.scene_page import own_page

PEARL = """
import numpy as np
import actionopt as ao
from actionopt import scenes

def L(q, v, t, *, l, g):
    return (l * v[0]) ** 2 / 2 + g * l * np.cos(q[0])

def draw(q, t):
    return [scenes.body([np.sin(q[0]), -np.cos(q[0])])]

system = ao.System(L, ["theta"], parameters={"l": 1.0, "g": 9.81}, name="pearl")
problem = ao.Problem(system, ao.Event(0, [0.3]), ao.Event(1, [-0.2]))  # of both, `scene` is taken
scene = scenes.Scene(
    problem, title="the pearl", source="Lecture 7", draw=draw, facts=scenes.Facts(morse_index=0),
    words=scenes.Words("Where does it go?", "Up there.", "The height.", {"motion": "Equal times."}),
)
"""


@pytest.mark.slow
def test_a_scene_of_ones_own_has_the_page_of_a_scene(tmp_path, monkeypatch):
    monkeypatch.setattr(builder, "make", lambda name: Page({f"{name}.html": ""}))
    file, target = tmp_path / "mine.py", tmp_path / "pages"
    file.write_text(PEARL)
    assert main(["gallery", str(target), str(file)]) == 0
    html = (target / "pearl" / "index.html").read_text(encoding="utf-8")
    for said in (
        *("The pearl", "Where does it go?", "Up there.", "The height.", "Lecture 7"),
        *("Equal times.", "The path under your hand", "Downhill in action", "Morse index"),
    ):
        assert said in html, said
    assert "l theta&#x27;&#x27; = -g sin theta" in html  # derived, typeset
    assert "data-film" in html and "data-live" in html and html.count(".svg") > 8
    assert (target / "pearl" / "motion.svg").is_file()
    assert 'src="pearl/thumbnail.svg"' in (target / "index.html").read_text(encoding="utf-8")


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["closed", "written", "accelerations", "integral"])
def test_scenes_of_ones_own_of_every_kind_have_pages(kind):
    def body(q, t):
        return [scenes.body([q[0], 0.0])]

    ends = ao.Event(0, [0.3]), ao.Event(1, [0.4])
    if kind == "closed":
        drive = ao.System(lambda q, v, t: v[0] ** 2 / 2 - q[0] ** 2 + np.cos(t) * q[0], ["x"])
        problem = ao.Problem(drive, ao.Event(0, [None]), ao.Periodic(2 * np.pi))
    elif kind == "written":
        law = ao.System(lambda q, v, t: v[0] ** 2 / 2 - np.sqrt(1 + abs(np.cos(q[0]))), ["x"])
        problem = ao.Problem(law, *ends)
    elif kind == "integral":
        rope = ao.System(lambda q, v, t: v[0] ** 2 / 2, ["x"], integral=lambda q, v, t: q[0])
        problem = ao.Problem(rope, *ends, integral=0.5)
    else:
        problem = ao.Problem(ao.System(lambda q, v, a, t: a[0] ** 2, ["x"]), *ends)
    scene = scenes.Scene(problem, title="a question", draw=body)
    if kind == "accelerations":
        with pytest.raises(ValueError, match="accelerations: a page"):
            own_page(scene)
        return
    html = own_page(scene).files["index.html"]
    assert "<h1>A question</h1>" in html
    assert ("No path can be bent here" in html) is (kind in ("closed", "integral"))
    assert "Think first" not in html and "What to look at" not in html
