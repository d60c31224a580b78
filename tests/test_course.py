"""The course: short pages, answers that are computed, notebooks that run."""

import json
import re
from base64 import b64decode

import numpy as np
import pytest
from scipy.optimize import brentq

from actionopt import scenes
from actionopt.cli import main
from actionopt.gallery.builder import common_files
from actionopt.gallery.course import pictures, plan
from actionopt.gallery.course.lesson import MINUTES, results
from actionopt.gallery.course.lessons import BY_NAME, LESSONS
from actionopt.gallery.course.notebook import exercise
from actionopt.gallery.course.sheets import solution, worksheet
from actionopt.tools.words import SPOKEN, language

# What each program must find, by formulas of its own: (lesson, exercise): name, value, error.
G = 9.81
LEAST = 5 - G / 2 - G**2 / 24  # the ball's action
BEND = np.pi**2 / 4  # J s/m^2, by which a bend of it raises S
# W of both throws of 20 J to (2.2, 0.5) m: the integral of v^2 dt = v0^2 - 2 g y dt, by hand.
TANGENT = (40 + np.array([-1, 1]) * np.sqrt(1600 - G * (G * 2.2**2 + 40))) / (G * 2.2)
TIME = 2.2 * np.sqrt((1 + TANGENT**2) / 40)
RISE = TANGENT * np.sqrt(40 / (1 + TANGENT**2))  # m/s, at the start
WORK = 40 * TIME - 2 * G * (RISE * TIME**2 / 2 - G * TIME**3 / 6)
KNOWN = {
    ("hunt", 0): {"straight": (5 - G / 2, 1e-12)},
    ("hunt", 1): {"best": (G, 1e-3), "least": (LEAST, 2e-4)},
    ("hunt", 2): {"action": (LEAST, 1e-8), "top": ((0.5 * G + 1) ** 2 / (2 * G), 1e-6)},
    ("first", 0): {
        k: (BEND * e**2, 1e-6) for k, e in (("one", 0.1), ("two", 0.2), ("four", 0.4))
    },
    ("first", 1): {
        k: (BEND * e**2 - 2 * G / np.pi * e, 1e-6) for k, e in (("up", 0.1), ("down", -0.1))
    },
    ("first", 2): {"change": (0.01 / 4 * (np.pi**2 / 4 - 4), 1e-6)},
    ("local", 0): {"after": (1 - G / 100, 1e-12)},
    ("local", 2): {"missing": (G, 1e-12)},
    ("minus", 0): {"below": (G / 8, 1e-8)},
    ("minus", 1): {"kinetic": (0.25, 1e-8), "potential": (0.25, 1e-8), "S": (0.0, 1e-9)},
    ("minus", 2): {"change": (-5.0, 1e-9), "apart": (0.0, 1e-8)},
    ("gauge", 0): {"rise": (3.0, 1e-9)},
    ("gauge", 1): {"change": (1.5, 1e-9), "apart": (0.0, 1e-8)},
    ("light", 0): {"ratio": (1.33, 1e-3)},
    # y'' = b with 2 b c^2 = 1/5 and c^2 = 1.2 / (1 + 4 b^2), and it dips by 2 b
    ("light", 1): {"dip": ((1.2 - np.sqrt(1.44 - 0.16)) / 0.4, 1e-6)},
    ("stones", 0): {"far": (40 / G, 1e-8), "best": (45.0, 1e-3)},
    ("stones", 1): {"more": (WORK[1] - WORK[0], 1e-6)},
    ("least", 0): {"focus": (np.pi / 3, 1e-8)},
    ("least", 1): {"index": (3, 0)},
    ("least", 2): {"index": (1, 0), "focus": (180.0, 1e-8)},
    ("string", 0): {"stiffness": (np.pi**2 - 4, 1e-6)},
    ("string", 1): {"lowest": (np.pi**2 / 16 - 1, 1e-4), "down": (1, 0)},
    ("push", 0): {"pull": (G * (3 - 2 * np.cos(0.7916850338091145)), 1e-6)},
    ("push", 1): {"angle": (np.degrees(np.arccos(2 / 3)), 1e-6)},
    ("push", 2): {"work": (scenes.get("turning_wire_radial"), 1e-8)},
    ("symmetry", 0): {k: (np.sqrt(1 - 0.6**2), 1e-8) for k in ("first", "last")},
    ("symmetry", 1): {"both": (0.0, 1e-8)},
    ("symmetry", 2): {"change": (2 * (3.01**2 - 9) / 3, 1e-9), "p": (4.0, 1e-12)},
    ("slopes", 0): {"work": (18.0, 0), "lagrangian": (4.0, 0), "meets": (-14.0, 0)},
    ("slopes", 1): {"p": (4 / 3, 1e-8), "H": (5 / 3, 1e-8)},
    ("phase", 0): {"apart": (np.sin(1) / 2, 1e-8)},
    ("phase", 1): {"share": (1.0, 1e-5)},  # the sides of the square are small, not nothing
    ("slits", 0): {"bands": (1e3 * 6.62607015e-34 / (9.1093837015e-31 * 1e6 * 1e-6), 1e-9)},
    ("slits", 1): {"ratio": (1.0, 1e-3)},
    ("sum", 0): {"length": (np.sqrt(2 * np.pi), 1e-3), "angle": (45.0, 1e-2)},
    ("sum", 1): {"length": (np.sqrt(2 * np.pi), 1e-3), "angle": (-45.0, 1e-2)},
    ("sum", 2): {"e": (2 * np.sqrt(1.054571817e-34 / np.pi), 1e-9)},
}  # fmt: skip


def found(lesson, k):
    """Return what a program leaves."""
    return results(BY_NAME[lesson].exercises[k])[0]


@pytest.mark.slow
def test_every_number_of_an_answer_is_known_otherwise():
    for at in ((x.name, k) for x in LESSONS for k in range(len(x.exercises))):
        (lesson, k), names = at, found(*at)
        answer = BY_NAME[lesson].exercises[k].answer
        shown = set(re.findall(r"\{(\w+)", answer))
        assert shown and shown <= set(names), at
        for name, (value, error) in KNOWN.get(at, {}).items():
            assert name in names
            if isinstance(value, scenes.Scene):  # of the same bead, in another coordinate
                t = np.array([0.0, value.problem.duration])
                q, v = value.exact(t), value.facts.velocity(t)
                value = float(np.diff(value.kinetic(q, v, t))[0])
            assert names[name] == pytest.approx(value, rel=error, abs=error), (at, name)


@pytest.mark.slow
def test_what_the_answers_say_besides_is_so():
    assert found("local", 1)["off"] < 1e-5
    assert 0.5 < found("light", 0)["cross"] < 0.6
    assert found("light", 2)["fast"] < 0.9 * found("light", 2)["straight"]
    speed = np.sqrt(2 * G * (1 - np.cos(0.7916850338091145)))
    assert found("push", 0)["speed"] == pytest.approx(speed, rel=1e-6)
    assert found("push", 0)["parts"] > 1
    one, two = (abs(found("symmetry", 1)[k]) for k in ("one", "two"))
    assert min(one, two) > 0.1


def test_every_lesson_has_its_minutes_on_a_day_of_two_weeks():
    assert all(sum(lesson.minutes) == MINUTES == 45 for lesson in LESSONS)
    days = [plan.day(k) for k in range(len(LESSONS))]
    assert days == sorted(days) and set(days) == set(range(1, 11))
    assert max(map(days.count, days)) == 2


@pytest.mark.slow
@pytest.mark.parametrize("lang", SPOKEN)
def test_worksheets_and_solutions_are_a_side_of_a4_each(lang, chromium, tmp_path):
    (tmp_path / "course").mkdir()
    for name, content in common_files().items():
        (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    with language(lang):
        written = [make(k) for k in range(len(LESSONS)) for make in (worksheet, solution)]
    for text in written:
        file = tmp_path / "course" / "sheet.html"
        file.write_text(text, encoding="utf-8")
        chromium.open(file)
        pdf = b64decode(chromium.order("Page.printToPDF", preferCSSPageSize=True)["data"])
        boxes = re.findall(rb"/MediaBox\s*\[0 0 (\S+) (\S+)\]", pdf)
        assert len(boxes) == len(re.findall(rb"/Type\s*/Page\b", pdf)) == 1, text[:300]
        assert [*map(float, boxes[0])] == pytest.approx((595.3, 841.9), abs=0.5)  # points


def test_the_fastest_slide_is_a_cycloid():
    """y = a (1 - cos s), x = a (s - sin s): through both ends of exercise 3 of light, its time."""
    from scipy.optimize import fsolve

    first = 1 / (2 * G)

    def missed(p):
        a, s0, s1 = p
        y0, y1 = a * (1 - np.cos(s0)) - first, a * (1 - np.cos(s1)) - first - 1
        return y0, y1, a * (s1 - np.sin(s1) - s0 + np.sin(s0)) - 2

    a, s0, s1 = fsolve(missed, (0.7, 0.4, 2.6), xtol=1e-13)
    assert found("light", 2)["fast"] == pytest.approx(np.sqrt(a / G) * (s1 - s0), rel=1e-7)


def test_the_command_writes_both_notebooks(tmp_path, capsys):
    assert main(["exercise"]) == 0
    listed = capsys.readouterr().out
    assert all(lesson.name in listed for lesson in LESSONS)
    assert main(["exercise", "first", str(tmp_path)]) == 0
    plain, answers = (tmp_path / name for name in ("first.ipynb", "first-answers.ipynb"))
    assert capsys.readouterr().out.split() == [str(plain), str(answers)]
    cells = json.loads(answers.read_text())["cells"]
    live, *programs = [c["source"] for c in cells if c["cell_type"] == "code"]
    assert 'plot.explore(scenes.get("projectile"))' in live  # the path of "Try", to be dragged
    assert programs == [e.program.rstrip() for e in BY_NAME["first"].exercises]
    assert not any(p in plain.read_text() for p in programs)
    assert main(["exercise", "first", str(tmp_path), "--lang", "de"]) == 0
    assert "Vorhersagen" in plain.read_text() and '(\\"de\\")' in plain.read_text()
    assert main(["exercise", "minsu"]) == 1
    assert "minus" in capsys.readouterr().err


@pytest.mark.slow  # a kernel is started each time
def test_a_notebook_runs(tmp_path):
    nbclient, nbformat = pytest.importorskip("nbclient"), pytest.importorskip("nbformat")
    pytest.importorskip("ipykernel")
    for file in exercise("minus", tmp_path):
        book = nbformat.read(file, as_version=4)
        nbformat.validate(book)
        nbclient.NotebookClient(book, timeout=120).execute()


def test_the_figure_of_the_mirage_obeys_snell():
    x = np.linspace(0, pictures.CAR_DISTANCE, 301)
    lowest = []
    for height in pictures.CAR:
        straight, dips = pictures.rays(height)
        y, slope = dips(x)[0], dips.velocity(x)[0]
        kept = pictures.index(y) / np.sqrt(1 + slope**2)  # the index where the ray is level
        assert np.ptp(kept) < 1e-10
        assert (straight.morse_index, dips.morse_index) == (0, 1)
        assert straight.action < dips.action
        lowest.append(y.min())
    # From a higher point it dips deeper, and seems to come from below.
    assert 0 < lowest[1] < lowest[0] < 0.5


def test_the_figure_of_the_films_has_two_catenaries():
    u = np.array([brentq(lambda u: 2 * u / np.cosh(u) - 1, *at) for at in ((0.1, 1.1), (1.3, 4))])
    films = pictures.films()
    assert [film.action for film in films] == pytest.approx(pictures.areas(u)[1], rel=1e-8)
    assert [film.morse_index for film in films] == [0, 1]
    assert films[0].action == pytest.approx(scenes.get("catenoid").facts.numbers["area"], rel=1e-8)
    last = brentq(lambda u: u * np.tanh(u) - 1, 1, 2)
    assert pictures.areas(np.array(last))[0] == pytest.approx(pictures.LAST, abs=5e-5)
    discs = brentq(lambda u: pictures.areas(u)[1] - 2 * np.pi, 0.3, 1.1)
    assert pictures.areas(np.array(discs))[0] == pytest.approx(pictures.GOLDSCHMIDT, abs=5e-5)
