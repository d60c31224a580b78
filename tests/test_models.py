"""Systems to model oneself, in a browser: right energies are accepted, wrong ones named."""

import json

import pytest

from actionopt.gallery.builder import common_files
from actionopt.gallery.course.models import ASSIGNMENTS, page
from actionopt.tools.words import language

SAID = {  # system: T, V, and what is to be said of them
    "hanging": [
        ("m x'^2/2", "k/2 x^2 - m g x", "right"),
        ("½ m x\u2019²", "0,5 k x² \u2212 mgx + 17", "right"),  # a constant; as a phone writes it
        ("m x'^2", "k x^2 - 2 m g x", "other"),  # twice L
        ("m x'^2/2 + 3 x x'", "k x^2/2 - m g x", "other"),  # d/dt (3 x^2 / 2) more
        ("m x'^2/2 + t x' + x", "k x^2/2 - m g x", "other"),  # d/dt (t x) more
        ("m x'^2/2", "m g x - k x^2/2", "sign"),
        ("m x'^2", "k x^2/2 - m g x", "kinetic_factor"),
        ("m x'^2/2", "k x^2 - 2 m g x", "potential_factor"),
        ("m x'^2/2", "k x^2 - m g x", "potential"),
        ("m x'^2/2", "k x^2/2 + m g x", "potential"),
        ("m x'^2/2", "", "unread"),
        ("m (x'^2/2", "k x^2/2", "unread"),
        ("m y'^2/2", "k x^2/2", "unknown"),
        ("m x^2/2", "k x^2/2 - m g x", "singular"),
        ("m x'^2/2", "log(-x)", "valueless"),
        ("k x'^2/2 + x'^4", "m g x", "neither"),
    ],
    "pendulum": [
        ("m l^2 theta'^2/2", "m g l (1 - cos theta)", "right"),
        ("m (lθ')²/2", "-mgl cos(θ)", "right"),
        ("l theta'^2/2", "2 g sin^2 (theta/2)", "other"),  # over m l
        ("m (l theta')^2/2", "m g l cos theta", "sign"),
        ("m (l theta')^2", "-m g l cos theta", "kinetic_factor"),
        ("m l theta'^2/2", "-m g l cos theta", "kinetic_factor"),
        ("m (l theta')^2/2", "m g l sin theta", "potential"),
    ],
    "planet": [
        ("m r'^2/2 + m (r phi')^2/2", "-k r^-1", "right"),
        ("m (r'^2 + r^2 phi'^2)/2", "k/r", "sign"),
        ("m (r'^2 + phi'^2)/2", "-k/r", "kinetic"),
        ("m r'^2/2", "-k/r", "singular"),
        ("m (r'^2 + r^2 phi'^2)/2", "-k/r^2", "potential"),
    ],
    "hoop": [
        ("m R^2 theta'^2/2", "-m g R cos theta - m (R w sin theta)^2/2", "right"),
        ("m R^2 (θ'^2 + ω^2 sin²θ)/2", "-m g R cos θ", "right"),
        ("m R^2 theta'^2/2", "-m g R cos theta", "kinetic"),
        ("m R^2 (theta'^2 + w^2)/2", "-m g R cos theta", "kinetic"),
        ("m R^2 (theta'^2 + w^2 sin theta^2)/2", "m g R cos theta", "sign"),
    ],
    "cart": [
        ("M x'^2/2 + m (x'^2 + 2 l x' theta' cos theta + l^2 theta'^2)/2", "m g l (1-cos theta)",
         "right"),
        ("M x'^2/2 + m (l theta')^2/2", "-m g l cos theta", "kinetic"),
        ("(M + m) x'^2/2 + m l x' theta' cos theta/2 + m l^2 theta'^2/2", "-m g l cos theta",
         "kinetic"),
    ],
}  # fmt: skip
CHECK = """(([name, T, V]) => {
  const form = document.getElementById(`model-${name}`);
  form.elements.T.value = T;
  form.elements.V.value = V;
  form.requestSubmit();
  return [form.dataset.said, form.querySelector("output").textContent];
})"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    target = tmp_path_factory.mktemp("models")
    (target / "course").mkdir()
    for name, content in common_files().items():
        (target / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    return target


def written(folder, lang):
    with language(lang):
        text = page("x")
    file = folder / "course" / f"{lang}.html"
    file.write_text(text, encoding="utf-8")
    return file


def said(chromium, *typed):
    return chromium.run(f"{CHECK}({json.dumps(typed)})")


def test_right_energies_are_accepted_and_wrong_ones_named(folder, chromium):
    chromium.errors.clear()
    chromium.open(written(folder, "en"), still=True)
    assert list(SAID) == [model.name for model in ASSIGNMENTS]
    for model in ASSIGNMENTS:
        assert said(chromium, model.name, *model.answer)[0] == "right", model.name
        for T, V, known in SAID[model.name]:
            mark, text = said(chromium, model.name, T, V)
            assert mark == known, (T, V, text)
            assert not any(bad in text for bad in ("{", "undefined", "NaN"))
    assert "2 times" in said(chromium, "pendulum", "m (l theta')^2", "-m g l cos theta")[1]
    assert "y'" in said(chromium, "hanging", "m y'^2/2", "0")[1]
    assert chromium.errors == []


@pytest.mark.slow
@pytest.mark.parametrize("lang", ["de", "fr"])
def test_what_was_typed_is_in_the_address(lang, folder, chromium):
    file = written(folder, lang)
    chromium.errors.clear()
    chromium.open(file, 360, still=True)
    before = said(chromium, "hanging", "m x'^2", "0,5 k x^2 - m g x")
    chromium.until("location.hash.includes('model-hanging')")
    chromium.events.clear()
    chromium.order("Page.reload")
    while "Page.loadEventFired" not in chromium.events:
        chromium.read()
    form = "document.getElementById('model-hanging')"
    assert chromium.run(f"{form}.elements.V.value") == "0,5 k x^2 - m g x"
    assert chromium.run(f"{form}.querySelector('output').textContent") == before[1]
    assert chromium.errors == []
