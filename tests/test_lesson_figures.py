"""Figures of lessons, in a browser: what each says was measured, and agrees with formulas here."""

import json
from urllib.parse import quote

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

from actionopt import scenes
from actionopt.gallery.builder import common_files
from actionopt.gallery.course.demonstrations import DEMONSTRATIONS, FIGURE_SCRIPTS
from actionopt.gallery.page import frame
from actionopt.tools.words import language

G = 9.81
SET_EVERYTHING = """[...document.querySelectorAll("[data-figure]")].map((figure) => {
  const all = (look) => [...figure.querySelectorAll(look)], texts = [];
  const take = () => texts.push(figure.innerText, ...all("svg text").map((x) => x.textContent));
  for (const chosen of [null, ...all("input[type=radio], input[type=checkbox]")]) {
    chosen?.click();
    take();
    for (const input of all("input[type=range]"))
      for (const share of [0, 1, 0.5]) {
        input.value = Number(input.min) + share * (input.max - input.min);
        input.dispatchEvent(new Event("input"));
        take();
      }
  }
  return [figure.dataset.figure, texts.join(" ")];
})"""
MECHANISM = ("action.js", "address.js", "sentences.js", "panel.js", *FIGURE_SCRIPTS)


def written(folder, lang="en"):
    """Write a page with all figures."""
    for name, content in common_files().items():
        (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    with language(lang):
        figures = "".join(figure.html(name) for name, figure in DEMONSTRATIONS.items())
        page = frame("x", f"<h1>x</h1>{figures}", root="", description="x", scripts=MECHANISM)
    (folder / "all.html").write_text(page, encoding="utf-8")
    return folder / "all.html"


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    return written(tmp_path_factory.mktemp("figures"))


@pytest.fixture
def figure(page, chromium):
    """A figure, its state changed: what it measured, and which sentence it says."""
    chromium.errors.clear()
    if not chromium.run("location.href").startswith(page.as_uri()):
        chromium.open(page, still=True)

    def change(name, **state):
        made = f"document.querySelector('[data-figure={name}]')"
        told = "{...f.measured, said: f.dataset.said}"
        return chromium.run(f"(f => {{f.change({json.dumps(state)}); return {told}}})({made})")

    yield change
    assert chromium.errors == []


def test_two_arrows_cancel_where_newton_puts_the_middle_place(figure):
    for h, last in ((0.3, 1.0), (0.15, -0.4)):
        fall = last / 2 + G * h**2 / 2
        there = figure("three", h=h, last=last, x=fall)
        assert there["said"] == "level" and there["over"] == pytest.approx(G * h**2 / 2)
        assert there["bend"] == pytest.approx(-there["weight"]) == pytest.approx(G * h)
        for off, said in ((0.2, "lower"), (-0.3, "higher")):
            here = figure("three", x=fall + off)
            assert here["said"] == said
            assert here["slope"] == pytest.approx(2 * off / h)  # of (x - x1)^2 / h and a line


def test_what_a_shift_adds_to_the_action(figure):
    ball = figure("noether", system="ball", middle=False, e=0.4, c=0.0)
    assert ball["said"] == "symmetric" and abs(ball["rise"]) < 1e-12
    assert ball["start"] == ball["end"] == pytest.approx(3)  # m times 3 m in 1 s
    risen = figure("noether", c=0.5)
    assert risen["said"] == "broken"
    assert risen["rise"] == pytest.approx(-G * 0.5 * 0.4)  # m g times how much higher, for 1 s
    assert risen["drift"] == pytest.approx(-G * 0.5)
    assert figure("noether", middle=True)["said"] == "pushed"
    stepped = figure("noether", c=0.0)
    assert stepped["said"] == "steps"
    assert stepped["first"] == pytest.approx([3 * 0.4, 0, -3 * 0.4])
    assert figure("noether", e=0)["said"] == "unmoved"


@pytest.mark.parametrize(
    ("name", "system", "flat"), [("screw", "screw", 1.5), ("planet", "kepler_polar", 0.0)]
)
def test_one_share_of_a_shift_is_conserved_and_no_other(figure, name, system, flat):
    even = figure("noether", system=name, middle=False, e=0.3, c=flat)
    assert even["said"] == "symmetric" and even["spread"] < 1e-8
    if name == "planet":
        assert even["start"] == pytest.approx(0.8)  # sqrt(mu a (1 - e^2))
    scene = scenes.get(system)
    law, T = scene.problem.system.lagrangian, scene.problem.duration
    x, w = np.polynomial.legendre.leggauss(60)
    t = T * (1 + x) / 2
    q, v = scene.exact(t), scene.facts.velocity(t)
    for c in (flat + 0.4, flat - 0.7):
        uneven = figure("noether", system=name, c=c)
        moved = np.array([c, 1.0])[:, None] * 0.3
        known = T / 2 * w @ (law(q + moved, v, t) - law(q, v, t))
        assert uneven["said"] == "broken"
        assert uneven["rise"] == pytest.approx(known, rel=1e-6)


@pytest.mark.parametrize(("added", "share"), [("linear", 1), ("square", 1 / 2), ("clock", 1)])
def test_a_time_derivative_raises_the_landscape_rigidly(figure, added, share):
    for c, a in ((4, 0.6), (-3, -1.1)):
        found = figure("gauge", added=added, c=c, a=a)
        assert found["said"] == "rigid"
        assert found["rise"] == pytest.approx(share * c)  # F of 1 m at 1 s, less F of 0
        assert found["spread"] < 1e-12 and abs(found["moved"]) < 1e-12


def test_what_is_no_time_derivative_moves_the_motion(figure):
    found = figure("gauge", added="none", c=3, a=0.2)
    assert found["said"] == "moves"
    # S = pi^2 a^2 / 4 + 2 c a / pi + ..., for the bend a sin(pi t)
    assert found["moved"] == pytest.approx(-4 * 3 / np.pi**3)
    assert figure("gauge", c=0)["said"] == "nothing"


def test_momentum_and_energy_are_read_from_a_tangent(figure):
    slow = figure("legendre", kind="slow", v=1.5)
    assert slow["said"] == "twice"
    assert [slow[k] for k in ("p", "H", "intercept")] == pytest.approx([1.5, 1.525, -1.525])
    fast = figure("legendre", kind="fast", v=0.8)
    assert fast["said"] == "more"
    assert [fast[k] for k in ("p", "H", "intercept")] == pytest.approx([4 / 3, 5 / 3, -5 / 3])
    assert figure("legendre", v=0)["said"] == "level"


def test_a_focus_is_where_the_line_of_starts_stands_upright(figure):
    for t, said in ((0, "begin"), (1, "ahead"), (np.pi, "upright"), (4, "behind")):
        found = figure("phase", system="spring", t=t)
        assert found["said"] == said
        assert found["lean"] == pytest.approx(np.sin(t), abs=1e-4)  # read between two steps
        assert found["passed"] == (t > 3.2)
    assert found["foci"] == pytest.approx([np.pi, 2 * np.pi], abs=1e-6)

    def neighbours(t, y):
        q, p, dq, dp = y
        return [p, -np.sin(q), dp, -np.cos(q) * dq]

    known = solve_ivp(
        neighbours, (0, 9), [0.4, 1.2, 0, 1], rtol=1e-10, atol=1e-12, dense_output=True
    ).sol
    found = figure("phase", system="pendulum", t=3)
    assert [found[k] for k in ("q", "p", "lean", "turn")] == pytest.approx(known(3.0), abs=1e-6)
    first = brentq(lambda t: known(t)[2], 2, 5)
    assert found["foci"][0] == pytest.approx(first, abs=1e-4)
    assert found["foci"][0] > np.pi + 0.1  # a wide swing is slower


@pytest.mark.parametrize(("E", "x", "y"), [(20, 2.2, 0.5), (24, 3.0, 0.2), (15, 1.4, 0.9)])
def test_rays_go_where_stones_fly(figure, E, x, y):
    found = figure("optics", E=E, x=x, y=y, h=0.4, pieces=40)
    assert found["said"] == "two"
    height = np.array([np.sqrt(4 * E**2 - G * (G * x**2 + 4 * E * y)) * s for s in (-1, 1)])
    tangents = (2 * E + height) / (G * x)
    rises = G * x**2 * (1 + tangents**2) / (16 * E)  # over the chord, halfway
    assert found["level"] == pytest.approx(rises, abs=1e-6)
    few = figure("optics", pieces=10)
    assert found["gap"] < few["gap"] / 8  # of second order

    def summed(s):
        f, slope = y / x * s + 1.6 * s / x * (1 - s / x), y / x + 1.6 / x * (1 - 2 * s / x)
        return np.sqrt(2 * (E - G * f)) * np.hypot(1, slope)

    assert found["W"] == pytest.approx(quad(summed, 0, x)[0], rel=1e-8)


def test_beyond_the_safety_parabola_no_arc_is_level(figure):
    E, x = 20, 3.4
    edge = E / G - G * x**2 / (4 * E)
    assert figure("optics", E=E, x=x, y=edge)["said"] == "edge"
    beyond = figure("optics", y=edge + 0.3)
    assert beyond["said"] == "none" and beyond["level"] == []
    assert figure("optics", y=edge - 0.2)["said"] == "two"


@pytest.mark.long
@pytest.mark.parametrize("e", [-0.2, 0.28])
def test_the_slope_of_the_action_with_a_rod_is_its_pull(figure, e):
    found, l, T = figure("rod", e=e), 1 + e, 0.9
    assert found["said"] == "same" and found["l"] == pytest.approx(l)

    def swing(rate, error=1e-11):
        return solve_ivp(
            lambda t, y: [y[1], -G / l * np.sin(y[0]), l**2 * y[1] ** 2 / 2 + G * l * np.cos(y[0]),
                          l * y[1] ** 2 + G * np.cos(y[0])],
            (0, T), [-1.2, rate, 0, 0], rtol=error, atol=error,
        ).y[:, -1]  # fmt: skip

    # From a scan of first rates: short rods have several motions, of which the page has one.
    rates = np.linspace(-6, 6, 25)
    missed = [swing(rate, 1e-5)[0] - 0.9 for rate in rates]
    roots = [
        brentq(lambda rate: swing(rate)[0] - 0.9, *rates[k : k + 2], xtol=1e-12)
        for k in range(24)
        if missed[k] * missed[k + 1] < 0
    ]
    motions = [swing(rate)[2:] for rate in roots]
    action, area = min(motions, key=lambda motion: abs(motion[0] - found["S"]))
    assert found["S"] == pytest.approx(action, rel=1e-8)
    assert found["area"] == pytest.approx(area, rel=1e-8)
    assert found["slope"] == pytest.approx(area, rel=1e-5)


@pytest.mark.parametrize(
    ("T", "said", "turn"), [(2.4, "up", 90), (4.0, "pass", 0), (8.0, "down", -90)]
)
def test_the_sum_over_two_bends_turns_with_the_index(figure, T, said, turn):
    found = figure("bends", T=T, hbar=0.05)
    assert found["said"] == said
    assert found["S2"] == pytest.approx([T / 2 * ((k * np.pi / T) ** 2 - 1) for k in (1, 2)])
    assert found["turn"] == pytest.approx(found["product"], abs=1e-6)
    assert found["turn"] == pytest.approx(turn, abs=2)  # for small hbar, of arrows without an end
    assert figure("bends", T=np.pi)["said"] == "focus"


def place_of_slits(d, w, parts=2000):
    """Return places in the middle of small parts of two slits, (2, parts)."""
    return np.array([[-d / 2], [d / 2]]) + w * ((np.arange(parts) + 0.5) / parts - 0.5)


def test_arrows_of_two_slits_agree_and_cancel(figure):
    d, hbar, w = 0.4, 0.02, 0.04
    bands = 2 * np.pi * hbar / d  # m = T = 1
    for place, said in ((0, "bright"), (bands, "bright"), (bands / 2, "dark"), (bands / 4, "grey")):
        found = figure("slits", wall="two", d=d, hbar=hbar, w=w, y=place)
        assert found["said"] == said
        assert found["spacing"] == pytest.approx(bands)
        s = place_of_slits(d, w)
        total = np.sum(np.exp(1j * (s**2 + (place - s) ** 2) / (2 * hbar))) * (s[0, 1] - s[0, 0])
        assert found["here"] == pytest.approx(abs(total) ** 2 / (np.pi * hbar), abs=1e-3)
    alone = figure("slits", wall="one", y=bands / 2)
    assert alone["said"] == "alone" and alone["here"] > 10 * figure("slits", wall="two")["here"]
    for y in (0, 0.3, -0.7):
        free = figure("slits", wall="open", y=y)
        assert free["said"] == "free" and free["here"] == pytest.approx(1, abs=5e-3)


def test_a_string_goes_soft_at_each_focus(figure):
    for k, T, said in (
        (1, 2.0, "stiff"),
        (1, np.pi, "soft"),
        (2, 4.0, "stiff"),
        (2, 7.0, "gives"),
        (3, 9.5, "gives"),
    ):
        found = figure("string", mode=str(k), T=T, a=0.7)
        stiffness = (k * np.pi / T) ** 2 - 1
        assert found["said"] == said
        assert found["stiffness"] == pytest.approx(stiffness, abs=1e-9)
        assert found["rise"] == pytest.approx(T / 4 * stiffness * 0.49, abs=1e-9)
        assert found["down"] == int(T / np.pi - 1e-9)


def test_a_hand_a_key_and_a_link_set_the_same(figure, page, chromium):
    of = "document.querySelector('[data-figure=legendre]')"
    figure("legendre", kind="slow", v=1)
    chromium.run(f"{of}.scrollIntoView({{block: 'center'}})")

    def knob():
        box = f"{of}.querySelector('.knob').getBoundingClientRect()"
        return chromium.run(f"(b => [b.x + b.width / 2, b.y + b.height / 2])({box})")

    v = f"{of}.state.v"
    x, y = knob()
    chromium.drag(x, y, x - 60, y + 5)
    dragged = chromium.run(v)
    assert dragged < 0.95 and knob()[0] == pytest.approx(x - 60, abs=0.6)
    chromium.key("ArrowRight")
    assert dragged < chromium.run(v) < dragged + 0.2
    chromium.touch(*knob(), 40, 0)
    touched = chromium.run(v)
    assert touched > dragged + 0.2
    chromium.until(f"decodeURIComponent(location.hash).includes(Number({v}.toPrecision(7)))")
    link = chromium.run("location.hash")
    for end, known in (
        (link, touched),
        ("#f-legendre=%5B%22fat%22%2C1%5D", 1.0),
        ("#f-legendre=%5B", 1.0),
    ):
        chromium.run(f"location.hash = '{end}'")
        chromium.events.clear()
        chromium.order("Page.reload")
        while "Page.loadEventFired" not in chromium.events:
            chromium.read()
        assert chromium.run(v) == pytest.approx(known, rel=1e-6)


def reload(chromium, end):
    chromium.run(f"location.hash = {json.dumps(end)}")
    chromium.events.clear()
    chromium.order("Page.reload")
    while "Page.loadEventFired" not in chromium.events:
        chromium.read()


@pytest.mark.slow
def test_a_link_sets_no_number_that_a_hand_cannot(page, chromium):
    chromium.errors.clear()
    chromium.open(page, still=True)
    first = chromium.run(
        "Object.fromEntries([...document.querySelectorAll('[data-figure]')]"
        ".map(f => [f.dataset.figure, Object.values(f.state)]))"
    )
    states = "[...document.querySelectorAll('[data-figure]')].map(f => Object.values(f.state))"
    link = "&".join(f"f-{name}={quote(json.dumps(values))}" for name, values in first.items())
    reload(chromium, link)
    for before, after in zip(first.values(), chromium.run(states), strict=True):
        assert after == pytest.approx(before, abs=1e-9) or after == before
    for far in (1e3, -1e3):
        wild = {
            name: [x if isinstance(x, (bool, str)) else far for x in values]
            for name, values in first.items()
        }
        link = "&".join(f"f-{name}={quote(json.dumps(values))}" for name, values in wild.items())
        reload(chromium, link)
        held = dict(zip(first, chromium.run(states), strict=True))
        assert all(far not in values for values in held.values()), held
        assert "NaN" not in chromium.run("document.body.innerHTML")
        E, _, x, y, _ = held["optics"]
        assert 8 <= E <= 40 and 0.6 <= x <= 4.2 and 0 <= y <= 2 and y < E / G
    assert chromium.errors == []


def test_sentences_have_words(figure, chromium):
    figure("string", mode="1")
    sentences = chromium.run(
        "Object.entries(actionopt.sentences.SENTENCES).map(([k, x]) => [k, Object.keys(x)])"
    )
    found = {name: set(group) for name, group in sentences if name in DEMONSTRATIONS}
    assert set(found) == set(DEMONSTRATIONS)
    for name, group in found.items():
        assert group <= set(DEMONSTRATIONS[name].words), name


@pytest.mark.slow
@pytest.mark.parametrize("lang", ["en", "de", "fr"])
def test_every_figure_says_words_whatever_is_set(lang, chromium, tmp_path):
    chromium.errors.clear()
    chromium.open(written(tmp_path, lang), 360, still=True)
    said = chromium.run(SET_EVERYTHING)
    assert [name for name, _ in said] == list(DEMONSTRATIONS)
    for name, text in said:
        assert not any(bad in text for bad in ("undefined", "NaN", "{", "\N{EM DASH}")), name
    assert chromium.run("document.documentElement.scrollWidth <= innerWidth")
    assert chromium.errors == []
