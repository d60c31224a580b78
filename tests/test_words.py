"""Languages: complete tables, the same values in braces, numbers and formulas left alone."""

import ast
import json
import re
from pathlib import Path

import numpy as np
import pytest
from helpers import a_quarter
from matplotlib.backends.backend_svg import RendererSVG
from matplotlib.figure import Figure
from matplotlib.text import Text

import actionopt
from actionopt import plot, scenes, solve
from actionopt.gallery import figures, scene_page
from actionopt.gallery.course import concepts, glossary, models, pages, plan
from actionopt.gallery.course.demonstrations import DEMONSTRATIONS
from actionopt.gallery.course.lessons import LESSONS
from actionopt.gallery.course.notebook import ON_PAGE
from actionopt.gallery.index_page import IDEAS
from actionopt.gallery.page import SITE
from actionopt.gallery.story import PARAGRAPH, TEMPLATE
from actionopt.gallery.texts import texts
from actionopt.plot._relaxation import VERDICTS
from actionopt.plot._runs import QUANTITIES
from actionopt.plot.live import as_found, film
from actionopt.plot.live.page import STATIC
from actionopt.plot.live.words import PAGE_WORDS
from actionopt.tools.document import document
from actionopt.tools.words import SPOKEN, TABLES, language, number, say, table

NOT_IN_PAGES = ("_explore.py", "_explore_parts.py")
OTHERS = [name for name in SPOKEN if name != "en"]


def said():
    """Return what pages say: the arguments of `say`, and the tables whose entries it is given."""
    found = {title for title, *_ in figures.FIGURE_KINDS}
    found |= {why for _, _, unless, _ in figures.FIGURE_KINDS for _, why in unless if why}
    found |= {
        *film.CONTROL_WORDS.values(),
        *film.SPEEDS.values(),
        *plan.LESSON_PARTS,
        *pages.MARKS.values(),
        pages.UNREAD,
        scene_page.LIVE,
        scene_page.NOT_LIVE,
        scene_page.UNWRITTEN,
        *QUANTITIES.values(),
    }
    found |= {text for *texts, _ in IDEAS for text in texts}
    found |= {text for _, text in (*as_found.ENDS_KEPT, *as_found.ALONE)}
    found |= {as_found.SHOWN_ALONE, as_found.LOST_ALONE}
    found |= {*figures._FRONTS.values(), *(text for _, text in SITE)}
    found |= {*PAGE_WORDS.values(), *(text for said in VERDICTS.values() for text in said)}
    found |= {text for _, word, _, means in glossary.WORDS for text in (word, means)}
    found |= {x.text for x in concepts.QUESTIONS}
    found |= {text for x in concepts.QUESTIONS for answer in x.answers for text in answer}
    found |= {model.text for model in models.ASSIGNMENTS} | {*models.SAID.values()}
    story = PARAGRAPH.finditer(TEMPLATE.read_text(encoding="utf-8"))
    found |= {" ".join(paragraph[3].split()) for paragraph in story}
    found |= {title for title, _ in pages.OTHERS.values()}
    for lesson in LESSONS:
        found |= {lesson.title, lesson.idea, lesson.watch, lesson.wrong, lesson.trap}
        found |= {*lesson.predict, *lesson.attempt, *lesson.observe, *lesson.explain}
        found |= {words for words, _ in lesson.steps}
        found |= {text for e in lesson.exercises for text in (e.question, e.answer, e.label)}
    found |= {text for x in DEMONSTRATIONS.values() for text in x.words.values()} | {ON_PAGE}
    for name in scenes.SCENES:
        words, own = texts(name), scenes.get(name).words
        found |= {
            name.replace("_", " "),
            scenes.title(name),
            own.question,
            own.answer,
            own.look,
            *own.captions.values(),
        }
        facts = scenes.get(name).facts
        found |= {number.replace("_", " ") for number in facts.numbers}
        found |= {fact for fact in facts.conserved or () if not re.search("['^+]| - ", fact)}
        rest = (words.statement, words.remarks, *(f.remark for f in words.formulas))
        found |= {" ".join(text.split()) for text in rest}
    package = Path(actionopt.__file__).parent
    drawn = {*(package / "plot").glob("_*.py")} - {package / "plot" / x for x in NOT_IN_PAGES}
    live = (package / "plot" / "live").glob("*.py")
    for file in [*(package / "gallery").rglob("*.py"), *live, *drawn]:
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") in ("say", "label"):
                found |= {
                    c.value
                    for c in ast.walk(node.args[0])
                    if isinstance(c, ast.Constant) and isinstance(c.value, str)
                }
    return {text for text in found if re.search("[A-Za-z]{2}", text)} - {"along", "askew", "time"}


@pytest.mark.long
@pytest.mark.parametrize("name", OTHERS)
def test_tables_are_complete(name):
    missing = {text for text in said() if text not in table(name)}
    assert not missing


def test_every_table_is_spoken():
    assert sorted(file.stem for file in TABLES.glob("*.json")) == OTHERS


@pytest.mark.parametrize("name", OTHERS)
def test_tables_have_a_line_for_each_entry_in_order(name):
    lines = json.dumps(dict(sorted(table(name).items())), indent=0, ensure_ascii=False) + "\n"
    assert (TABLES / f"{name}.json").read_text(encoding="utf-8") == lines


@pytest.mark.parametrize("name", OTHERS)
def test_translations_have_the_same_values(name):
    for text, other in table(name).items():
        braces = [sorted(re.findall(r"\{.*?\}", x)) for x in (text, other)]
        assert braces[0] == braces[1], text
        numbers = [sorted(re.findall(r"(?<![\w.])\d+\.\d+", x)) for x in (text, other)]
        assert numbers[0] == numbers[1], text
        assert other.strip() == other or text.strip() != text


def test_french_has_one_kind_of_apostrophe_and_keeps_signs_with_their_words():
    for text in table("fr").values():
        assert not re.search(r"[^\W\d_]'[^\W\d_]| [:;?!»](\s|$)", text), text


def test_numbers_of_pages_have_the_mark_of_their_language():
    body = '<p>0.5 m, 1e-13</p><img alt="9.81"><code>0.5</code><p lang="en">section 4.4</p> 0.1.0'
    with language("fr"):
        shown = document("", "", body)
    assert (
        "0,5\N{NO-BREAK SPACE}m, 1\N{MULTIPLICATION SIGN}10⁻¹³" in shown and 'alt="9,81"' in shown
    )
    assert all(kept in shown for kept in ("<code>0.5</code>", "section 4.4", " 0.1.0"))
    assert "0.5\N{NO-BREAK SPACE}m" in document("", "", body)


@pytest.mark.long
def test_numbers_in_pictures_have_the_mark_of_their_language(monkeypatch):
    seen = []
    drawn = RendererSVG.draw_text
    monkeypatch.setattr(
        RendererSVG, "draw_text", lambda *a, **k: (seen.append(a[4]), drawn(*a, **k))
    )
    with language("de"):
        plot.svg(lambda f: f.subplots().plot([0.25, 1.75], [1.5e13, 2.5e13]))
    assert any("," in text for text in seen) and not any("." in text for text in seen)


@pytest.mark.slow
@pytest.mark.parametrize("name", a_quarter(OTHERS))
def test_figures_speak_one_language(name):
    solution = solve(scenes.get("oscillator").problem)
    drawings = {
        lambda f: plot.overview(solution, f.subplots(2)),
        lambda f: plot.mesh(solution, f.subplots(2)),
        lambda f: plot.energies(solution, f.subplots()),
        lambda f: plot.conserved(solution, f.subplots(2)),
        lambda f: plot.bundle(solution, f.subplots()),
        lambda f: plot.slices(solution, f.subplots()),
        lambda f: plot.relaxation(solution, axes=f.subplots(4)),
    }
    for draw in drawings:
        shown = []
        for spoken in ("en", name):
            figure = Figure()
            with language(spoken):
                draw(figure)
            words = {text.get_text() for text in figure.findobj(Text)}
            words = {re.sub(r"\$.*?\$", "", text) for text in words}
            shown.append({text for text in words if re.search("[A-Za-z]{2}", text)})
        assert not shown[0] & shown[1] - {"action ", "part sans "}


def test_languages_are_spoken_meanwhile():
    with language("de"):
        assert say("Course") == "Kurs"
        with language("fr"):
            assert say("at {t} s", t=2) == "à 2 s"
        assert say("what no table has") == "what no table has"
    assert say("Course") == "Course"
    with (
        pytest.raises(ValueError, match="expected a language of en, de, fr, found 'eo'"),
        language("eo"),
    ):
        pass


def test_the_script_of_the_live_figure_fills_its_words():
    script = (STATIC / "live.js").read_text(encoding="utf-8")
    said = (STATIC / "sentences.js").read_text(encoding="utf-8")
    used = set(re.findall(r"\bW\.(\w+)", script)) | set(re.findall(r"(\w+): \(m?\) =>", said))
    buttons = {"solve", "relax", "hunt", "bend", "wave", "half", "restart"}  # W[name]
    assert used | buttons == set(PAGE_WORDS)
    for key, values in re.findall(r"filled\(W\.(\w+), \{(.*?)\}\)", script):
        given = {part.split(":")[0].strip() for part in re.split(r", (?=\w+:)", values)}
        assert given == set(re.findall(r"\{(\w+)\}", PAGE_WORDS[key])), key


@pytest.mark.quick("de")
@pytest.mark.parametrize("name", OTHERS)
def test_a_live_page_speaks_one_language(name, tmp_path):
    plot.page(scenes.get("oscillator"), tmp_path / "page.html", lang=name)
    html = (tmp_path / "page.html").read_text(encoding="utf-8")
    shown = json.loads(re.findall(r'(?s)<script type="application/json">(.*?)</script>', html)[0])
    assert shown["words"]["solve"] == {"de": "Lösen", "fr": "Résoudre"}[name]
    assert f'<html lang="{name}">' in html
    text = re.sub(r"(?s)<script.*?</script>|<style.*?</style>|<[^>]*>", " ", html)
    assert not re.search(r"\b(the|from|which|path|motion)\b", text, re.I)


def test_a_number_that_is_none_is_a_dash():
    assert number(np.nan) == number(-np.inf) == "\N{EM DASH}" and number(-0.0) == "0"
