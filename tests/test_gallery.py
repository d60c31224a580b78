"""Pages are whole, true and made once."""

import json
import re
from collections import Counter
from html.parser import HTMLParser
from types import SimpleNamespace

import numpy as np
import pytest
from helpers import a_quarter, at_once, contrast, solved
from matplotlib.colors import to_rgb

from actionopt import Event, Mesh, scenes
from actionopt.cli import main
from actionopt.discrete.action.transcription import Transcription
from actionopt.gallery import build, builder, story
from actionopt.gallery.course.lessons import LESSONS
from actionopt.gallery.course.pages import OTHERS
from actionopt.gallery.facts import facts_of, name_of
from actionopt.gallery.figures import fronts_caption, landscape_reach
from actionopt.gallery.film import _energies, film, relaxing
from actionopt.gallery.index_page import IDEAS, idea
from actionopt.gallery.page import Page, prose
from actionopt.gallery.subject import Subject
from actionopt.gallery.texts import texts
from actionopt.plot import landscape_data
from actionopt.solver.solve import solve
from actionopt.tools.greek import GREEK

NAMES = ["drag_quadratic", "rod_pendulum"]
COUNTED = ["drag_quadratic", "hoop_bead", "oscillator", "projectile"]
VOID = {"meta", "link", "img", "input", "br", "source"}
SAME = 1e-9  # of an action computed twice
CLOSE = 1e-9  # of what is known exactly, for paths good to 1e-10 and their accelerations


@pytest.fixture(scope="module")
def gallery(tmp_path_factory):
    """A gallery of two scenes, without layout, which the tests of figures look at.

    The story counts the least paths and the saddles of a few.
    """
    target = tmp_path_factory.mktemp("gallery")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("actionopt.plot._files.LAYOUTS", 0)
        patch.setattr(story, "scenes", SimpleNamespace(get=scenes.get, SCENES=COUNTED))
        assert build(target, NAMES, jobs=1) == ["least", "course", *NAMES]
        yield target


def files(target):
    return {str(f.relative_to(target)): f.read_bytes() for f in target.rglob("*") if f.is_file()}


def pages(target):
    return sorted(target.rglob("*.html"))


# -- pages -----------------------------------------------------------------------------------


class Checked(HTMLParser):
    """Reads a page and keeps what is asked of it."""

    def __init__(self):
        super().__init__()
        self.open, self.ids, self.links, self.headings = [], [], [], []
        self.pictures, self.language, self.words = [], None, ""

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        if tag not in VOID:
            self.open.append(tag)
        if "id" in given:
            self.ids.append(given["id"])
        self.links += [given[name] for name in ("href", "src", "srcset") if name in given]
        if re.fullmatch("h[1-6]", tag):
            self.headings.append(int(tag[1]))
        if tag == "img":
            self.pictures.append(given)
        if tag == "html":
            self.language = given.get("lang")

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag):
        assert self.open.pop() == tag, self.getpos()

    def handle_data(self, data):
        if self.open and self.open[-1] not in ("script", "style"):
            self.words += data


@pytest.mark.long
def test_pages_are_whole(gallery):
    assert len(pages(gallery)) == 3 + 3 * len(LESSONS) + len(OTHERS) + len(NAMES)
    shown = set()
    for file in pages(gallery):
        page = Checked()
        page.feed(file.read_text(encoding="utf-8"))
        assert not page.open
        assert page.language == "en"
        assert len(set(page.ids)) == len(page.ids)
        assert page.headings[0] == 1 and page.headings.count(1) == 1
        assert max(np.diff(page.headings), default=0) <= 1  # no level is skipped
        for link in page.links:
            if link.startswith("#"):
                assert link[1:] in page.ids
            elif link != "data:,":
                assert not re.match(r"\w+:|//", link), f"{link} leaves the gallery"
                there, _, part = link.partition("?")[0].partition("#")
                assert (file.parent / there).is_file(), f"{file} wants {link}"
                assert not part or f'id="{part}"' in (file.parent / there).read_text("utf-8")
                shown.add((file.parent / there).resolve())
        for picture in page.pictures:
            assert re.search(r"\d", picture["alt"])  # a description, with numbers
        assert "nan" not in page.words.lower().split()
    assert shown >= {picture.resolve() for picture in gallery.rglob("*.svg")}


@pytest.mark.long
def test_pages_of_the_course_are_short_and_say_everything(gallery):
    assert len(LESSONS) == 15
    contents = (gallery / "course.html").read_text(encoding="utf-8")
    for lesson in LESSONS:
        html = (gallery / "course" / f"{lesson.name}.html").read_text(encoding="utf-8")
        words = re.sub(r"<script.*?</script>|<pre.*?</pre>|<[^>]*>", " ", html, flags=re.DOTALL)
        assert 200 < len(words.split()) < 900, lesson.name
        assert html.count("<details") == len(lesson.exercises) >= 2
        assert html.count("<math") == len(lesson.steps)
        assert f'href="{lesson.name}.html?projector"' in html
        assert bool(lesson.explorer) == bool(lesson.attempt)
        assert bool(lesson.figure) == bool(lesson.observe)
        assert lesson.figure or lesson.explorer
        assert "{" not in words
        assert lesson.name in contents
        assert set(lesson.scenes) <= set(scenes.SCENES)


@pytest.mark.long
def test_no_line_ends_between_a_number_and_its_unit(gallery):
    rest = re.compile(r"<(script|style|pre|code)\b.*?</\1>|<[^>]*>", re.DOTALL)
    for file in pages(gallery):
        words = rest.sub("", file.read_text(encoding="utf-8"))
        assert not re.search(r"\d (?:J|N|kg|m|s|rad)\b|[JN] s\b|index \d", words), file


@pytest.mark.quick("kepler_spherical")  # it is seen in space
@pytest.mark.parametrize("name", ["chain", "figure_eight", "kepler_spherical"])
def test_the_names_of_coordinates_stand_in_the_picture_and_apart(name):
    scene = scenes.get(name)
    html = film(Subject(scene, solve(scene.problem, guess=scene.guess)))
    x, y, wide, high = map(float, re.search('viewBox="([^"]*)"', html)[1].split())
    names = re.findall('class="name" x="([^"]*)" y="([^"]*)" font-size="([^"]*)"', html)
    at, size = np.array(names, dtype=float)[:, :2], float(names[0][2])
    assert len(at) == min(8, scene.problem.system.n)
    assert np.all(at - size / 2 >= [x, y]) and np.all(at + size / 2 <= [x + wide, y + high])
    bodies = re.findall('class="body[^>]*cx="([^"]*)" cy="([^"]*)" r="([^"]*)"', html)
    for other in np.array(bodies, dtype=float):
        assert np.min(np.hypot(*(at - other[:2]).T)) > other[2] + 0.3 * size
    apart = np.hypot(*(at[:, None] - at).transpose(2, 0, 1)) + 9 * np.eye(len(at))
    assert np.min(apart) > 0.9 * size


@pytest.mark.long
def test_a_film_says_that_a_path_runs_away_only_where_it_does():
    scene = scenes.get("oscillator", duration=4.4)
    html = relaxing(Subject(scene, solve(scene.problem, guess=scene.guess)))
    assert "runs away" in re.search("<figcaption>(.*)</figcaption>", html)[1]
    kink = scenes.get("kink")  # its way down comes to no end in the steps of a film
    assert not relaxing(Subject(kink, solve(kink.problem, guess=kink.guess)))


@pytest.mark.long
def test_nothing_comes_from_elsewhere(gallery):
    for name, content in files(gallery).items():
        if name.endswith((".woff2", ".txt")):  # a font, and its licence
            continue
        text = content.decode()
        loads = r"""(?:href|src)=["']?(?:https?:)?//|url\(["']?(?:https?:)?//|@import|fetch\("""
        assert not re.search(loads, text), name


@pytest.mark.long
def test_a_film_sums_what_is_asked_for_and_not_the_integral_that_is_given():
    """Of Dido's fence: with the area, times its multiplier, S would be zero."""
    scene = scenes.get("dido")
    subject = Subject(scene, solved("dido"))
    t = np.linspace(0.0, 1.0, 201)
    (graph,) = _energies(subject, t)
    assert graph["rows"][0]["values"] == pytest.approx(np.full(t.size, np.pi), abs=1e-3)
    assert graph["area"] == pytest.approx(np.pi * t, abs=1e-3)
    assert relaxing(subject) == ""  # downhill no path keeps its area
    assert subject.motion.endswith("y = 0 m")


@pytest.mark.long
def test_a_landscape_keeps_from_where_its_action_is_infinite():
    reach = landscape_reach(solved("light_around_star"))
    assert reach < landscape_reach(solved("pendulum")) == 0.5
    rise = landscape_data(solved("light_around_star"), reach, 9).rise
    assert rise.min() >= 0 and rise.max() < 100  # of S = 1275: no path comes to the horizon


@pytest.mark.long
def test_what_a_scene_is_decides_its_figures(gallery):
    drag, rod = (
        {f.stem.removesuffix("-narrow") for f in (gallery / name).glob("*.svg")} for name in NAMES
    )
    assert drag == {"motion", "thumbnail", "path", "conserved", "mesh"}
    assert rod >= drag | {"landscape", "slices", "bundle", "energies", "spectrum"}
    page = (gallery / "drag_quadratic" / "index.html").read_text(encoding="utf-8")
    assert "its motion is not where the action is stationary" in page
    assert "makes the action stationary" not in page and "no functional" not in page
    assert '"arrows"' not in page
    assert '"arrows"' in (gallery / "rod_pendulum" / "index.html").read_text(encoding="utf-8")


@pytest.mark.long
def test_the_numbers_on_a_page_are_those_of_the_scene(gallery):
    page = Checked()
    page.feed((gallery / "rod_pendulum" / "index.html").read_text(encoding="utf-8"))
    scene = scenes.get("rod_pendulum")
    assert page.words.count(f"{scene.action:.10g}\xa0J\xa0s") == 2  # known, and found
    assert f"action {str(scene.action)[:11]}" in page.words  # printed by the program


@pytest.mark.parametrize("name", a_quarter(scenes.SCENES, 2))
def test_what_was_found_is_what_is_known(name):
    scene = scenes.get(name)
    subject = Subject(scene, solve(scene.problem, tol=1e-10, guess=scene.guess))
    rows = facts_of(subject)
    assert rows or scene.exact is None
    assert all(row.difference < CLOSE for row in rows if row.difference is not None)
    assert all(row.expected == row.found for row in rows if row.what == "Morse index")
    if "conserved" in scene.facts:
        assert {row.what for row in rows} >= {
            name_of(subject, what) for what in scene.facts["conserved"]
        }


@at_once("name", scenes.SCENES)
def test_every_scene_has_its_words(name):
    words = texts(name)
    assert words.statement and words.sketch and words.usage and words.formulas


def test_scenes_stand_under_what_they_ask():
    found = Counter(idea(scenes.get(name)) for name in scenes.SCENES)
    assert len(found) == len(IDEAS) and min(found.values()) >= 3
    of = {"snell": "Ways, times, areas", "kepler": "Orbits, and what is conserved"}
    assert all(idea(scenes.get(name)) == title for name, title in of.items())


@at_once("name", scenes.SCENES)
def test_students_read_mathematics_and_no_program(name):
    """Neither ASCII for a formula nor what a function raises; names in code are the program's."""
    words, title = texts(name), scenes.title(name)
    remarks = " ".join(formula.remark for formula in words.formulas)
    html = prose("\n\n".join([title, words.statement, words.remarks, words.usage, remarks]))
    html = re.sub(r"<code>.*?</code>", "", html)
    assert not re.search(r"Raises|\^|\b\w\d?'|sqrt|&gt;|&lt;=", html), html
    assert not re.search(rf"\b({'|'.join(filter(str.isalpha, GREEK))})\d?\b", html), html
    assert not re.search(r"\b[A-Za-z]\d\b|ς", html), html


@at_once("name", scenes.SCENES)
def test_what_is_called_a_momentum_is_made_of_momenta(name):
    """It vanishes where all momenta do: with L_v = 0, whatever the place and the time."""
    scene = scenes.get(name)
    system, parameters = scene.problem.system, scene.problem.parameters
    rng = np.random.default_rng(1)
    for what, quantity in scene.facts.get("conserved", {}).items():
        if "momentum" not in what:
            continue
        q, t = rng.normal(size=system.n), 0.7
        at_rest = system.momentum(q, np.zeros(system.n), t, parameters=parameters)
        mass = [system.momentum(q, e, t, parameters=parameters) - at_rest for e in np.eye(system.n)]
        v = np.linalg.solve(np.transpose(mass), -at_rest)
        size = np.max(np.abs(quantity(q[:, None], np.ones((system.n, 1)), t)))
        assert np.abs(quantity(q[:, None], v[:, None], t)) == pytest.approx(0, abs=1e-12 * size)


def test_fronts_are_said_to_be_crossed_where_paths_cross_them():
    """Along p; which is the velocity's direction in no magnetic field, and over time is none."""
    said = {}
    for name in ("oscillator", "projectile", "charge_planar"):
        scene = scenes.get(name)
        said[name] = fronts_caption(Subject(scene, solve(scene.problem, guess=scene.guess)))
    assert ["rays" in text for text in said.values()] == [False, True, False]
    assert "H dt" in said["oscillator"] and "velocity does not" in said["charge_planar"]


# -- building --------------------------------------------------------------------------------


@pytest.fixture
def quick(monkeypatch):
    """Pages made without solving anything; the list of those made."""
    made = []

    def make(name):
        made.append(name)
        return Page({f"{name}/index.html": name, f"{name}/{len(made)}.svg": ""}, ("tag",))

    monkeypatch.setattr(builder, "make", make)
    return made


@pytest.mark.long
def test_what_stands_is_not_made_again(gallery, quick):
    before = files(gallery)
    assert build(gallery, NAMES) == []
    assert files(gallery) == before and quick == []


def test_what_is_missing_is_made_again_and_what_is_left_over_goes(tmp_path, quick):
    first = build(tmp_path, ["projectile"], jobs=1)
    assert first == quick == ["least", "course", "projectile"]
    before = files(tmp_path)
    assert {"least/1.svg", "projectile/3.svg", "index.html", "style.css"} <= set(before)
    (tmp_path / "projectile" / "index.html").unlink()
    assert build(tmp_path, ["pendulum", "projectile"], jobs=1) == ["pendulum", "projectile"]
    after = files(tmp_path)
    assert "projectile/5.svg" in after and "projectile/3.svg" not in after
    assert build(tmp_path, ["pendulum"], jobs=1) == []
    assert files(tmp_path) == after  # the index still has both
    index = after["index.html"].decode()
    assert "projectile/index.html" in index and "pendulum/index.html" in index


def test_an_interrupted_build_goes_on(tmp_path, quick):
    def stop(done, total, name):
        assert total == 4
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        build(tmp_path, NAMES, show=stop, jobs=1)
    assert not list(tmp_path.rglob("*.part*"))
    seen = []
    left = build(tmp_path, NAMES, show=lambda *now: seen.append(now), jobs=1)
    assert left == ["rod_pendulum"] and seen == [(4, 4, "rod_pendulum")]
    assert quick == ["least", "course", *NAMES]


def test_links_lead_to_pages_that_are_there(tmp_path, monkeypatch):
    def make(name):
        links = "".join(f'<a href="../{x}/index.html">{x}</a>' for x in ("kepler", "pendulum"))
        return Page({f"{name}/index.html": links})

    monkeypatch.setattr(builder, "make", make)
    build(tmp_path, ["kepler"], jobs=1)
    page = tmp_path / "kepler" / "index.html"
    assert page.read_text() == '<a href="../kepler/index.html">kepler</a>pendulum'
    assert build(tmp_path, ["pendulum"], jobs=1) == ["least", "course", "pendulum"]
    assert build(tmp_path, ["kepler"], jobs=1) == ["kepler"]
    assert 'href="../pendulum/index.html"' in page.read_text()


def test_a_page_that_cannot_be_written_leaves_the_old_one(tmp_path, quick, monkeypatch):
    build(tmp_path, ["projectile"], jobs=1)
    before = files(tmp_path)
    monkeypatch.setattr(builder, "sources", lambda: "new")
    monkeypatch.setattr(builder.os, "replace", lambda a, b: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        build(tmp_path, ["projectile"], jobs=1)
    assert files(tmp_path) == before


def test_other_files_are_left_alone(tmp_path, quick):
    (tmp_path / "index.html").write_text("mine")
    with pytest.raises(ValueError, match="found other files"):
        build(tmp_path, ["projectile"], jobs=1)
    assert files(tmp_path) == {"index.html": b"mine"} and quick == []


OWN = """
import actionopt as ao

free = ao.System(lambda q, v, t, *, m: m * v[0] ** 2 / 2, ["x"], parameters={"m": 2.0}, name="free")
problem = ao.Problem(free, ao.Event(0, [0.0]), ao.Event(1.0, [1.0]))
"""


def test_problems_of_ones_own_have_pages(tmp_path, quick, capsys):
    file, target = tmp_path / "mine.py", tmp_path / "pages"
    file.write_text(OWN)
    build(target, ["projectile"], jobs=1)
    assert main(["gallery", str(target), str(file), "projectile"]) == 0
    assert quick == ["least", "course", "projectile"]
    page = (target / "free" / "index.html").read_text(encoding="utf-8")
    assert page.count("<h1>Free</h1>") == 1 and "../index.html" in page
    index = (target / "index.html").read_text(encoding="utf-8")
    assert "free/index.html" in index and "projectile/index.html" in index
    again = scenes.from_file(file), scenes.get("projectile", g=1.62).problem
    assert build(target, again, jobs=1) == ["free", "projectile_2"]
    assert (target / "projectile_2" / "index.html").is_file()
    assert main(["gallery", str(target), str(tmp_path / "none.py")]) == 1
    assert "found no file" in capsys.readouterr().err
    with pytest.raises(ValueError, match="put it in"):
        build(target, again[0])  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="scenes or problems, found 3"):
        build(target, [3])  # type: ignore[list-item]


@pytest.mark.slow
def test_the_same_page_comes_out_the_same_of_another_process(gallery):
    name, before = NAMES[0], files(gallery)
    page = gallery / name / "index.html"
    page.unlink()
    made = page.parent.stat().st_mtime_ns
    assert build(gallery, NAMES) == [name]
    assert page.parent.stat().st_mtime_ns > made
    assert files(gallery) == before


def test_the_command(tmp_path, quick, capsys, monkeypatch):
    opened = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    build(tmp_path, NAMES, jobs=1)
    assert main(["gallery", str(tmp_path), *NAMES, "--open"]) == 0
    assert capsys.readouterr().out.strip() == str(tmp_path / "index.html")
    assert opened == [(tmp_path / "index.html").as_uri()]
    assert main(["gallery", str(tmp_path), "pendulm"]) == 1
    assert "pendulum" in capsys.readouterr().err


def test_pages_follow_their_sources(tmp_path):
    digests = []
    for name, text in (("a.py", "1"), ("a.py", "2"), ("b.html", "2"), ("notes.txt", "1")):
        (tmp_path / name).write_text(text)
        digests.append(builder.sources(tmp_path))
    assert len(set(digests)) == 3 and digests[2] == digests[3]


def test_pages_made_from_other_sources_are_made_again(tmp_path, quick, monkeypatch):
    build(tmp_path, ["projectile"], jobs=1)
    monkeypatch.setattr(builder, "sources", lambda: "new")
    assert build(tmp_path, ["projectile"], jobs=1) == ["least", "course", "projectile"]


def test_a_scene_that_is_not_there(tmp_path):
    with pytest.raises(ValueError, match="pendulum"):
        build(tmp_path / "new", ["pendulm"])
    assert not (tmp_path / "new").exists()


# -- films ------------------------------------------------------------------------------------


@pytest.mark.long
def test_one_path_relaxes_to_the_motion_and_the_other_runs_away_on_one_clock(gallery):
    page = (gallery / "least.html").read_text(encoding="utf-8")
    found = map(json.loads, re.findall(r'<script type="application/json">(.*?)</script>', page))
    (film,) = (data for data in found if "shapes" in data)
    kinds = ("motion", "trial", "dot")
    truth, trial, dots = (
        [np.array(s["points"]) for s in film["shapes"] if s["kind"] == kind] for kind in kinds
    )
    away = [path[-1] - still[0] for path, still in zip(trial, truth, strict=True)]
    assert len(trial[0]) == len(trial[1]) == len(dots[0]) == len(film["labels"])  # one clock
    assert np.ptp(dots[0][-5:], axis=0) == pytest.approx(0, abs=1e-3)  # at rest on the map
    assert np.max(np.abs(away[0])) < 0.01 < 0.3 < np.max(np.abs(away[1]))


# -- colours ---------------------------------------------------------------------------------


@pytest.mark.long
@pytest.mark.parametrize("dark", [False, True])
def test_colours_can_be_told_apart(gallery, dark):
    sheet = (gallery / "style.css").read_text(encoding="utf-8")
    light, night = re.findall(r":root \{(.*?)\}", sheet, re.DOTALL)
    colours = dict(re.findall(r"--(\w+): (#\w{6})", light))
    if dark:
        colours |= dict(re.findall(r"--(\w+): (#\w{6})", night))
    text = [("ink", "soft", "accent", "force"), ("paper", "card", "wash", "code"), 4.5]
    lines = [("body", "rod", "ground", "force"), ("card",), 3.0]
    for inks, papers, least in (text, lines):
        for ink in inks:
            for paper in papers:
                assert contrast(*map(to_rgb, (colours[ink], colours[paper]))) >= least, (ink, paper)


# -- in a browser ----------------------------------------------------------------------------


SIZES = (360, 740), (1920, 1080)  # of a phone, and of a projector
SMALL = """(() => {
  const found = [], walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let x; x = walk.nextNode();) {
    const e = x.parentElement, not = ["SCRIPT", "STYLE", "NOSCRIPT", "OPTION", "TITLE"];
    if (!x.data.trim() || not.includes(e.tagName) || !e.getBoundingClientRect().width) continue;
    const m = e.ownerSVGElement && e.getScreenCTM();
    const px = parseFloat(getComputedStyle(e).fontSize) * (m ? Math.hypot(m.a, m.b) : 1);
    if (px < 11) found.push([e.tagName, px, x.data.trim()]);
  }
  return found;
})()"""


def load_images(chromium):
    chromium.run("document.querySelectorAll('img').forEach(i => { i.loading = 'eager' })")
    chromium.until("[...document.images].every(i => i.complete)")


def visit(visited, chromium):
    """Open each page at each size: it is whole, comes from here alone, fits and can be read."""
    for file in visited:
        chromium.open(file, *SIZES[0], still=True)
        assert chromium.run(SMALL) == [], file
        for size in SIZES:
            chromium.resize(*size)
            chromium.until(f"innerWidth == {size[0]}")
            assert chromium.run("document.documentElement.scrollWidth <= innerWidth"), file
            load_images(chromium)
            assert chromium.run("[...document.images].every(i => i.naturalWidth > 0)"), file
    assert chromium.errors == []
    assert all(url.startswith(("file:", "data:")) for url in chromium.requests)
    assert any(url.endswith("film.js") for url in chromium.requests)


def test_pages_load_whole_and_fit_from_phone_to_projector(gallery, chromium):
    one = ("hunt-worksheet", "light-solution")  # as all others are
    visit([x for x in pages(gallery) if "-" not in x.stem or x.stem in one], chromium)


def test_a_film_plays_pauses_and_leaves_those_alone_who_want_no_motion(gallery, chromium):
    file = gallery / "rod_pendulum" / "index.html"
    frame = "Number(document.querySelector('[data-film]').dataset.frame)"
    press = "document.querySelector('[data-film] button').click()"
    chromium.open(file)
    chromium.until(f"{frame} > 1")
    places = "[...document.querySelectorAll('[data-film] .body')].map(b => b.getAttribute('cx'))"
    chromium.run(press)
    here = chromium.run(places)
    there = chromium.run(
        "(() => { const s = document.querySelector('[data-film] input'); s.value = 60;"
        f" s.dispatchEvent(new Event('input')); return {places} }})()"
    )
    assert here != there and chromium.run(frame) == 60
    chromium.open(file, still=True)
    chromium.run("new Promise(r => setTimeout(r, 300))")
    assert chromium.run(frame) == 0
    chromium.run(press)
    chromium.until(f"{frame} > 0")
    assert chromium.errors == []


def shown(chromium, name):
    """Return S in the page, S computed here for the path that the page shows, and its rise."""
    figure = f"document.querySelector('[data-live={name}]')"
    T, S, rise = (
        float(chromium.run(f"{figure}.dataset.{key}")) for key in ("duration", "action", "rise")
    )
    problem = scenes.get(name).problem
    degree, count, Q = chromium.run(
        f"(() => {{ const {{ A, trial }} = {figure}.live;"
        " return [A.degree, A.elements, [...trial()]] })()"
    )
    Q = np.reshape(Q, (-1, problem.system.n))
    longer = problem.replace(end=Event(T, Q[-1]))
    tr = Transcription(longer, Mesh.uniform(0.0, T, count, degree), problem.lengths)
    return S, tr.action_and_gradient(Q)[0], rise


def middle(chromium, name, handle):
    """Return where a handle is in the window."""
    knob = f"document.querySelectorAll('[data-live={name}] .handle')[{handle}]"
    return chromium.run(
        f"(() => {{ const b = {knob}.querySelector('.knob').getBoundingClientRect();"
        " return [b.x + b.width / 2, b.y + b.height / 2] })()"
    )


@pytest.mark.parametrize("name", ["projectile", "oscillator"])
def test_a_handle_dragged_changes_the_action_to_the_one_computed_here(gallery, chromium, name):
    chromium.open(gallery / "least.html")
    chromium.run(f"document.querySelector('[data-live={name}]').scrollIntoView()")
    before = shown(chromium, name)
    assert before[0] == pytest.approx(before[1], abs=SAME)
    x, y = middle(chromium, name, 2)
    chromium.drag(x, y, x + 15, y + 40)
    now = middle(chromium, name, 2)
    assert now == pytest.approx((x + 15 * (name == "projectile"), y + 40), abs=0.6)
    after = shown(chromium, name)
    assert after[0] == pytest.approx(after[1], abs=SAME)
    assert abs(after[0] - before[0]) > 1e-2
    chromium.key("ArrowUp")  # the handle dragged has the focus
    raised = shown(chromium, name)
    assert raised[0] == pytest.approx(raised[1], abs=SAME)
    assert abs(raised[0] - after[0]) > 1e-4
    chromium.touch(*middle(chromium, name, 1), 0, -30)
    touched = shown(chromium, name)
    assert touched[0] == pytest.approx(touched[1], abs=SAME)
    assert abs(touched[0] - raised[0]) > 1e-4


def test_the_keyboard_reaches_everything(gallery, chromium):
    chromium.open(gallery / "rod_pendulum" / "index.html", still=True)
    chromium.key("Tab")
    assert chromium.run("document.activeElement.className") == "skip"
    inner = "document.querySelectorAll('a, button:not([role=tab]), input, summary, [tabindex]')"
    assert chromium.run(f"[...{inner}].every(e => e.tabIndex >= 0 || e.matches('[role=tab]'))")
    chosen = "document.querySelector('[role=tab][aria-selected=true]')"
    chromium.run(f"{chosen}.focus()")
    chromium.key("ArrowRight")
    assert chromium.run(f"document.activeElement === {chosen} && {chosen}.textContent") == "Least?"
    assert chromium.run(
        f"document.getElementById({chosen}.getAttribute('aria-controls')).offsetTop"
    )
    chromium.until("location.hash.startsWith('#part=')")
    chromium.run("document.querySelector('[data-film] input').focus()")
    chromium.key("ArrowRight")
    chromium.until("Number(document.querySelector('[data-film]').dataset.frame) > 0")


@pytest.mark.slow
def test_the_whole_gallery(chromium, tmp_path):
    assert len(build(tmp_path, jobs=2)) == 2 + len(scenes.SCENES)
    assert sum(map(len, files(tmp_path).values())) < 25e6
    said = Counter(
        caption
        for file in pages(tmp_path)
        for caption in set(re.findall("<figcaption>(.*?)</figcaption>", file.read_text("utf-8")))
        if 'class="scene"' in file.read_text("utf-8")
    )
    assert {text: count for text, count in said.items() if count > 5} == {}
    visit(pages(tmp_path), chromium)
    for name in scenes.SCENES:
        chromium.open(tmp_path / name / "index.html", still=True)
        tall = chromium.run(
            "[...document.querySelectorAll('[role=tab]')].map((tab) =>"
            " (tab.click(), document.documentElement.scrollHeight))"
        )
        assert max(tall) < 3000, name


def test_the_index_is_searched_and_told_by_tags(gallery, chromium):
    chromium.open(gallery / "index.html", still=True)
    seen = "[...document.querySelectorAll('.card')].filter(c => c.offsetParent).length"
    field = "document.querySelector('.finder input')"
    assert chromium.run(seen) == len(NAMES)
    for typed, count in (("rod", 1), ("pendulum RoD", 1), ("stone falls", 1), ("nowhere", 0)):
        chromium.run(f"{field}.value = '{typed}'; {field}.dispatchEvent(new Event('input'))")
        assert chromium.run(seen) == count, typed
    assert chromium.run("document.querySelector('.finder [role=status]').textContent")
    assert chromium.errors == []


def test_an_exercise_takes_a_number_before_it_answers(gallery, chromium):
    chromium.open(gallery / "course" / "hunt.html", still=True)
    form = "document.querySelector('form.guess')"
    answer = f"{form}.nextElementSibling"
    assert chromium.run(f"{answer}.hidden")
    # S of the straight line: 5 - 4.905, by hand
    marks = {"?!": "unread", "0,095": "right", "0.1": "near", "5": "wrong", "-0.095": "sign"}
    marks["9,5 \u00b7 10\u207b\u00b2"] = "right"  # as pages write it
    for typed, mark in marks.items():
        chromium.run(f"{form}.querySelector('input').value = '{typed}'; {form}.requestSubmit()")
        assert chromium.run(f"{form}.dataset.mark") == mark, typed
        assert chromium.run(f"{answer}.hidden") == (mark == "unread")
    # A number of 1e-17 m is no zero, and one that is zero has no round-off.
    for lesson, k, mark in (("sum", 3, "wrong"), ("minus", 2, "right")):
        chromium.open(gallery / "course" / f"{lesson}.html", still=True)
        form = f"document.querySelector('#guess-{k}')"
        chromium.run(f"{form}.querySelector('input').value = '0'; {form}.requestSubmit()")
        assert chromium.run(f"{form}.dataset.mark") == mark, lesson
        assert "\u207b" not in chromium.run(f"{form}.dataset.words") or mark == "wrong"


def test_the_lesson_on_light_shows_both_rays_and_a_way_that_has_no_length(gallery, chromium):
    chromium.open(gallery / "course" / "light.html", still=True)
    live = "document.querySelector('.live')"
    chromium.run(f"{live}.querySelector('input[type=checkbox]').click()")
    chromium.run(f"{live}.querySelector('[data-do=solve]').click()")
    chips = chromium.run(f"[...{live}.querySelectorAll('.met button')].map(b => b.textContent)")
    assert [text.rpartition(", ")[2] for text in chips] == ["index 1", "minimum"]
    chromium.run(f"{live}.querySelector('[data-handle=\"4\"]').scrollIntoView({{block: 'center'}})")
    x, y = middle(chromium, "light", 3)
    chromium.drag(x, y, x, y + 120)  # below the road, where n^2 is negative
    assert "\u2014" in chromium.run(f"{live}.querySelector('.action').textContent")
    assert chromium.errors == []


def test_arrows_at_handles_are_slopes_of_the_action(gallery, chromium):
    chromium.open(gallery / "course" / "local.html", still=True)
    seen = "(d => [d.slopes, d.action])(document.querySelector('.live').dataset)"
    slopes, before = chromium.run(seen)
    slopes = [float(x) for x in slopes.split()]
    assert len(slopes) == 7  # the ends are held
    live = "document.querySelector('.live').live"
    place = f"(A => A.shares.indexOf(0.5) * 2 + 1)({live}.A)"  # y of the middle
    at = chromium.run(f"{live}.trial()[{place}]")
    chromium.run("document.querySelector('.live .handle[data-handle=\"4\"]').focus()")
    chromium.key("ArrowUp")
    by = chromium.run(f"{live}.trial()[{place}]") - at
    after = float(chromium.run(seen)[1])
    # S is a parabola in y, whose second derivative is a few m / T: the first order counts here.
    assert (after - float(before)) / by == pytest.approx(-slopes[3], rel=0.25)
    chromium.run("document.querySelector('.live [data-do=solve]').click()")
    assert max(float(x) for x in chromium.run(seen)[0].split()) < 1e-9 * max(slopes)
    assert chromium.errors == []


def test_on_a_phone_too_the_motion_is_where_no_arrow_is_left(gallery, chromium):
    """Every second handle is put away there, and those that are left bend all of the path."""
    chromium.open(gallery / "course" / "local.html", 360, 740, still=True)
    live = "document.querySelector('.live')"
    pulled = f"""(j => {{ const g = {live}.querySelector(`[data-handle="${{j}}"]`);
      g.scrollIntoView({{ block: "center" }});
      const knob = g.lastChild.getBoundingClientRect(), d = g.querySelector(".pull");
      const [x, y] = d.getAttribute("d").match(/-?[\\d.]+/g)?.slice(2, 4).map(Number) ?? [0, 0];
      return [knob.x + knob.width / 2, knob.y + knob.height / 2, x / 2, y / 2]; }})"""
    shown = f"[...{live}.querySelectorAll('.handle:not(.away)')].map(g => g.dataset.handle)"
    assert chromium.run(shown) == ["2", "4", "6"]
    for _ in range(5):
        for j in (2, 4, 6):
            x, y, right, down = chromium.run(f"{pulled}({j})")
            chromium.drag(x, y, x + right, y + down)
    S = solved("projectile", tol=1e-10).action  # 4 below the straight line's
    assert S < float(chromium.run(f"{live}.dataset.action")) < S + 0.5
    assert chromium.errors == []


def test_an_address_brings_back_the_path_and_what_was_typed(gallery, chromium):
    file = gallery / "course" / "minus.html"
    chromium.open(file, still=True)
    chromium.run("document.querySelector('.live [data-do=solve]').click()")
    chromium.run("document.querySelector('.live').live.setParameter(0, 0.75)")
    chromium.run("document.querySelector('.live .handle[data-handle=\"4\"]').focus()")
    chromium.key("ArrowUp")
    chromium.run(
        "document.querySelector('form.guess input').value = '1';"
        "document.querySelector('form.guess').requestSubmit()"
    )
    chromium.until("location.hash.includes('guess-1')")
    seen = "(d => [d.action, d.kind, d.duration])(document.querySelector('.live').dataset)"
    S, *before = chromium.run(seen)
    address = chromium.run("location.hash")
    chromium.open(gallery / "index.html")
    chromium.events.clear()
    chromium.order("Page.navigate", url=file.as_uri() + address)
    while "Page.loadEventFired" not in chromium.events:
        chromium.read()
    again, *after = chromium.run(seen)
    assert after == before and before[0] == "minimum"
    assert abs(float(again) - float(S)) < 1e-6 * abs(float(S))  # seven digits of the path
    assert chromium.run("document.querySelector('form.guess').dataset.mark") == "near"
    assert chromium.run("document.querySelector('.live').live.A.p[0]") == 0.75
    assert chromium.errors == []


# Of each part of a page, the images with their widths.
EVERY_IMAGE = """(tabs => (tabs.length ? tabs : [document.body]).flatMap(tab => {
  tab.click();
  return [...document.images].filter(i => i.offsetParent).map(i => [i.currentSrc, i.width]);
}))([...document.querySelectorAll('[role=tab]')])"""


def test_no_words_of_a_picture_are_too_small_on_a_phone(gallery, chromium):
    for file, folder in (("rod_pendulum/index.html", "rod_pendulum"), ("least.html", "least")):
        chromium.open(gallery / file, 360, 740, still=True)
        load_images(chromium)
        shown = chromium.run(EVERY_IMAGE)
        assert shown
        for source, width in shown:  # letters of 8.9 points or more, in a picture of so many
            assert source.endswith("-narrow.svg") or folder != "least"
            name = source.rsplit("/", 1)[1]
            picture = (gallery / folder / name).read_text(encoding="utf-8")
            points = float(re.search(r'width="([\d.]+)pt"', picture)[1])
            assert 8.9 * width / points >= 11


@pytest.mark.parametrize("width", [360, 1280])
def test_an_index_is_smaller_than_its_letter(gallery, chromium, width):
    sizes = []
    for file in (gallery / "course" / "local.html", gallery / "course" / "slits.html"):
        chromium.open(file, width, still=True)
        sizes += chromium.run(
            "[...document.querySelectorAll('math[display] :is(msub, msup)')].map((script) =>"
            " [...script.children].map((x) => parseFloat(getComputedStyle(x).fontSize)))"
        )
    assert len(sizes) > 20
    assert all(11 <= index < 0.8 * letter for letter, index in sizes)


@pytest.mark.long
def test_without_scripts_the_first_frame_is_there(gallery):
    page = (gallery / "rod_pendulum" / "index.html").read_text(encoding="utf-8")
    stage = re.search(r'<svg role="img" class="stage".*?</svg>', page, re.DOTALL)[0]
    assert stage.count("<circle") >= 2 and stage.count("<polyline") >= 2
    assert re.findall(r'<text class="name".*?>(.*?)</text>', stage) == ["x", "y"]


def test_film_and_graphs_have_one_clock(gallery, chromium):
    chromium.open(gallery / "rod_pendulum" / "index.html", still=True)
    film = "document.querySelector('.opening [data-film]')"
    go = f"(v => {{ const s = {film}.querySelector('input'); s.value = v;"
    go += " s.dispatchEvent(new Event('input')) })"
    chromium.run(f"{go}(120)")
    cursors = chromium.run(
        f"[...{film}.querySelectorAll('.cursor')].map(c => +c.getAttribute('x1'))"
    )
    assert len(cursors) == 2 and cursors[0] == pytest.approx(cursors[1], abs=1e-6)
    said = chromium.run(f"{film}.querySelector('.sum').textContent")
    action = scenes.get("rod_pendulum").action
    assert float(re.search(r"[\d.]+", said)[0]) == pytest.approx(action, rel=5e-3)
    chromium.run(f"{film}.querySelector('[data-step=\"-1\"]').click()")
    assert chromium.run(f"Number({film}.dataset.frame)") == 119
    chromium.run(
        f"(s => {{ s.value = '0.1'; s.dispatchEvent(new Event('change')) }})"
        f"({film}.querySelector('select'))"
    )
    assert "10 times slower" in chromium.run(f"{film}.dataset.pace")


def test_slides_are_a_section_a_screen(gallery, chromium):
    file = gallery / "rod_pendulum" / "index.html"
    chromium.open(file, 1280, 720, still=True)
    assert chromium.run("document.documentElement.className") == ""
    chromium.order("Page.navigate", url=file.as_uri() + "?slides")
    chromium.until("document.readyState == 'complete' && document.documentElement.className")
    heights = "[...document.querySelectorAll('article > section')].map(s => s.offsetHeight)"
    assert min(chromium.run(heights)) >= 720


@pytest.mark.parametrize(
    ("page", "mode"), [("rod_pendulum/index.html", "embed"), ("course/local.html", "projector")]
)
def test_embedded_a_page_is_its_live_figure_alone(gallery, chromium, page, mode):
    file = gallery / page
    chromium.open(file, 1280, 720, still=True)
    type_size = "(b => b.height)(document.querySelector('.live svg text').getBoundingClientRect())"
    before = chromium.run(type_size)
    chromium.order("Page.navigate", url=f"{file.as_uri()}?{mode}")
    chromium.until("document.readyState == 'complete' && document.documentElement.className")
    seen = "[...document.querySelectorAll('main *')].filter(e => e.offsetHeight)"
    apart = f"{seen}.filter(e => !e.closest('.live') && !e.querySelector('.live')).length"
    assert chromium.run(f"{seen}.length") > 20 and chromium.run(apart) == 0
    larger = 1.6 if mode == "projector" else 1
    assert chromium.run(type_size) == pytest.approx(larger * before, rel=0.05)
