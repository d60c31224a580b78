"""Pages that compute: the law, the action and Newton's method in JavaScript, and what is seen."""

import itertools
import json
import math
import shutil
import subprocess
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
import systems
from helpers import a_quarter, at_once, of_one_leg, solved

import actionopt as ao
from actionopt import plot, scenes
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.matrices.factors import kkt_nonzeros
from actionopt.mechanics.laws.expressions import Expressions
from actionopt.plot.live import javascript
from actionopt.plot.live.data import PAGE_MESHES, data
from actionopt.plot.live.drawing import drawing, trace_shapes
from actionopt.plot.live.page import STATIC

NODE = shutil.which("node")
SAME = 1e-12  # of the largest entry: sums of the same terms in another order
# Other paths join their events, and are nearer the straight line.
LED_ELSEWHERE = (
    "double_pendulum",
    "exit_path",
    "figure_eight",
    "four_on_an_eight",
    "hoop_bead",
    "kepler",
    "mirage",
    "vacuum_decay",
)
FOCUSING = ("oscillator", "oscillator_2d", "kepler", "pendulum", "rod_pendulum", "screw")
CONJUGATE = 1e-4  # of the longest duration; measured: 3e-5
KNOWN = 1e-8  # of S: what a page promises
SIZE = 300e3  # bytes of a page


# No page draws paths along an obstacle, or through events.
LIVE = [name for name in of_one_leg() if not scenes.get(name).problem.system.r]


@pytest.fixture(scope="module")
def asked(request):
    """Data of the scenes to be tried, and random paths with random multipliers."""
    rng, found = np.random.default_rng(5), {}
    here = [x for x in request.session.items if x.path == request.path]
    tried = [getattr(x, "callspec", None) for x in here if "computed" in x.fixturenames]
    for name in dict.fromkeys(call.params["name"] for call in tried if call):
        solution = solved(name, tol=1e-10)
        known = data(solution.problem, solution)
        Q = np.reshape(known["answer"], (-1, known["law"]["n"]))
        Q = Q + 0.05 * np.array(known["sizes"]) * rng.normal(size=Q.shape)
        lam = rng.normal(size=(len(Q), known["law"]["m"]))
        found[name] = {
            "name": name,
            "data": known,
            "Q": Q.ravel().tolist(),
            "lam": lam.ravel().tolist(),
        }
    return found


@pytest.fixture(scope="module")
def computed(asked):
    """What JavaScript makes of them, in one process of Node."""
    if NODE is None:
        pytest.skip("no Node found, which runs JavaScript without a browser")
    found = subprocess.run(
        [NODE, Path(__file__).parent / "live.js", STATIC / "action.js", *FOCUSING],
        input=json.dumps(list(asked.values())),
        capture_output=True,
        text=True,
        check=True,
    )
    told = json.loads(found.stdout)
    return dict(zip(asked, told["answers"], strict=True)) | {"erf": told["erf"]}


@pytest.mark.parametrize("name", a_quarter(LIVE, 1))
def test_the_action_in_the_page_is_that_of_the_package(asked, computed, name):
    known, told = asked[name]["data"], computed[name]
    problem = scenes.get(name).problem
    Q = np.reshape(asked[name]["Q"], (-1, problem.system.n))
    lam = np.reshape(asked[name]["lam"], (len(Q), problem.system.m))
    mesh = ao.Mesh.uniform(
        problem.start.t, problem.end.t, known["elements"], len(known["rule"]["nodes"]) - 1
    )
    tr = Transcription(problem, mesh, problem.lengths)
    S, gradient = tr.action_and_gradient(Q)
    assert told["S"] == pytest.approx(S, rel=SAME)
    assert told["g"] == pytest.approx(gradient, abs=SAME * np.max(np.abs(gradient)))
    # Its Hessian lacks the ends, which are given.
    at = tr.with_ends(Q[[0, -1]])
    K, pattern, count = np.zeros(tr.layout.kkt.shape), tr.layout.kkt, tr.layout.unknowns
    K[pattern.row, pattern.col] = kkt_nonzeros(tr.layout, at.kkt(at.pack(Q, lam)))
    H = K[:count, :count] * tr.action_unit / np.outer(tr.x_unit, tr.x_unit)
    free = np.ix_(tr.layout.free, tr.layout.free)
    mine = np.reshape(told["H"], (Q.size, Q.size))[free]
    assert mine == pytest.approx(H, abs=SAME * np.max(np.abs(H)))
    if problem.system.m:
        f = problem.system.constraint(Q.T, mesh.nodes, parameters=problem.parameters)
        assert pytest.approx(f, abs=SAME * np.max(np.abs(Q)) ** 2) == np.transpose(told["f"])


@pytest.mark.parametrize("name", a_quarter(LIVE, 1))
def test_newtons_method_and_the_index_in_the_page(computed, name):
    solution, told = solved(name, tol=1e-10), computed[name]
    scale = max(abs(solution.action), 1.0)
    assert told["known"] == pytest.approx(solution.action, abs=KNOWN * scale)
    if not solution.problem.system.structure.forced:
        assert told["index"] == {"kind": solution.kind, "index": solution.morse_index}
    # From the straight line it leads to a stationary path, to this one where there is no other.
    S, slope = told["solved"]
    assert slope < 1e-7 * (abs(S) + scale)
    if name not in LED_ELSEWHERE:
        assert pytest.approx(solution.action, abs=KNOWN * scale) == S


def test_what_javascript_has_not(computed):
    known = [math.erf(x) for x in (-7, -3, -1, 0, 1e-3, 0.5, 2.4, 2.6, 4)]
    assert computed["erf"] == pytest.approx(known, rel=4e-16, abs=1e-300)


def test_every_operation_is_written_as_casadi_computes_it():
    if NODE is None:
        pytest.skip("no Node found, which runs JavaScript without a browser")
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    one = (
        *(ca.sqrt, ca.sin, ca.cos, ca.tan, ca.asin, ca.acos, ca.atan, ca.sinh, ca.cosh, ca.tanh),
        *(ca.exp, ca.log, ca.asinh, ca.atanh, ca.floor, ca.ceil, ca.sign, ca.fabs, ca.log1p),
        *(ca.expm1, ca.erf, ca.logic_not, lambda z: 1 / z, lambda z: z**2, lambda z: -2 * z),
    )
    two = (
        *(ca.atan2, ca.hypot, ca.fmin, ca.fmax, ca.fmod, ca.copysign, ca.logic_and, ca.logic_or),
        *(lambda a, b: a**b, lambda a, b: a / b, lambda a, b: a - b, lambda a, b: a**1.7),
        *(lambda a, b: a < b, lambda a, b: a <= b, lambda a, b: a == b, lambda a, b: a != b),
        *(lambda a, b: ca.if_else(a < b, a * b, b), lambda a, b: ca.acosh(2 + a * b)),
    )
    f = ca.Function("f", [x, y], [g(x) for g in one] + [g(x, y) for g in two])
    text = javascript.body(f)
    points = [(0.3, 0.7), (0.9, 0.2)]
    script = (
        f"eval({json.dumps((STATIC / 'action.js').read_text())});"
        f"const run = new Function('erf', 'x', 'o', 'w', {json.dumps(text)});"
        f"console.log(JSON.stringify({json.dumps(points)}.map(([a, b]) => {{"
        f"const o = Array.from({{ length: {f.n_out()} }}, () => [0]);"
        f"run(globalThis.actionopt.erf, [[a], [b]], o, new Float64Array({f.sz_w()}));"
        " return o.flat() })))"
    )
    found = subprocess.run([NODE, "-e", script], capture_output=True, text=True, check=True)
    for point, values in zip(points, json.loads(found.stdout), strict=True):
        assert values == pytest.approx([float(v) for v in f(*point)], rel=1e-14)


# -- the page --------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("pages")


DOUBLE_WELL = ao.System(
    lambda q, v, t, *, a: v[0] ** 2 / 2 - (q[0] ** 2 - a) ** 2 / 4,
    ["x"],
    parameters={"a": 1.0},
    name="double_well",
)


def opened(chromium, folder, question, width=1280, height=900, still=True, **how):
    """Open the page of a question, and return its file."""
    name = question.name
    file = folder / f"{name}.html"
    if not file.exists():
        plot.page(question, file, **how)
    chromium.open(file, width, height, still=still)
    return file


def told(chromium, key):
    return float(chromium.run(f"document.querySelector('.live').dataset.{key}"))


def press(chromium, name):
    chromium.run(f"document.querySelector('.live [data-do={name}]').click()")


def middle(chromium, handle):
    """Return where a handle is in the window."""
    return chromium.run(
        f"(() => {{ const b = document.querySelector('.live [data-handle=\"{handle}\"] .knob')"
        ".getBoundingClientRect(); return [b.x + b.width / 2, b.y + b.height / 2] })()"
    )


def test_a_problem_of_ones_own_has_a_page_that_needs_nothing_else(folder, chromium):
    problem = ao.Problem(DOUBLE_WELL, ao.Event(0, [-1.0]), ao.Event(3.0, [1.0]))
    file = opened(chromium, folder, problem, still=False)
    assert file.stat().st_size < SIZE
    assert chromium.requests == [file.as_uri()] and chromium.errors == []
    x, y = middle(chromium, 4)
    chromium.drag(x, y, x, y + 50)
    assert middle(chromium, 4) == pytest.approx((x, y + 50), abs=0.6)
    press(chromium, "solve")
    chromium.until("document.querySelector('.live [data-do=solve]').textContent === 'Solve'")
    solution = ao.solve(problem, tol=1e-10)
    assert told(chromium, "action") == pytest.approx(solution.action, rel=KNOWN)
    chromium.order("Page.navigate", url=f"{file.as_uri()}?embed")
    chromium.until("document.querySelector('.embed .live .action span') !== null")
    seen = "[...document.querySelectorAll('h1, footer')].some(e => e.getClientRects().length)"
    assert not chromium.run(seen)


def test_the_picture_is_that_of_the_path_that_is_bent(folder, chromium):
    opened(chromium, folder, scenes.get("pendulum"))
    chromium.run(
        "(() => { const s = document.querySelector('.picture input'); s.value = 0.5;"
        " s.dispatchEvent(new Event('input')) })()"
    )
    bob = (
        "(() => { const [a, b] = ['.ground', '.body'].map(k => document.querySelector('.picture '"
        " + k)); const d = n => b.getAttribute(n) - a.getAttribute(n);"
        " return Math.atan2(d('cx'), d('cy')) })()"
    )
    theta = "document.querySelector('.live').live.trial()[24]"  # half way along 8 times 6 steps
    assert chromium.run(bob) == pytest.approx(chromium.run(theta), abs=1e-6)
    x, y = middle(chromium, 4)
    chromium.drag(x, y, x, y - 30)
    assert abs(chromium.run(theta)) > 0.1
    assert chromium.run(bob) == pytest.approx(chromium.run(theta), abs=1e-6)


@at_once("name", scenes.SCENES)
def test_how_a_scene_looks_is_known_of_any_path(name):
    scene, rng = scenes.get(name), np.random.default_rng(3)
    shapes, function = trace_shapes(scene.problem.system.n, scene.draw)
    q, t = rng.normal(size=scene.problem.system.n), 0.7
    found, at = np.array(function(q, t)).ravel(), 0
    for shape, other in zip(scene.draw(q, t), shapes, strict=True):
        points = other.points
        if isinstance(points, Expressions):
            points = found[at : at + 2 * shape.points.shape[1]].reshape(-1, 2).T
            at += points.size
        assert shape.kind == other.kind
        seen = scenes.project(shape.points)
        assert seen == pytest.approx(scenes.project(points), abs=1e-12)


def test_what_cannot_be_traced_is_shown_on_the_motion():
    scene, solution = scenes.get("pendulum"), solved("pendulum", tol=1e-10)
    blind = drawing(solution, lambda q, t: scene.draw(np.asarray(q, dtype=float), t))
    assert [shape["kind"] for shape in blind["frames"]] == ["ground", "rod", "body"]


def test_bad_questions_are_refused(folder):
    closed = ao.Problem(DOUBLE_WELL, ao.Event(0, [None]), ao.Periodic(6.0))
    with pytest.raises(ValueError, match=r"ends in \.html"):
        plot.page(closed, folder / "closed.pdf")
    assert not list(folder.glob("closed*"))


HILLS = ao.System(lambda q, v, t: v[0] ** 2 / 2 + (1 - q[0] ** 2) ** 2 / 4, ["x"])
FREE = systems.particle("x y")
FOUND = {  # questions whose ends are to be found, and what is said of that
    "closes": (
        ao.Problem(DOUBLE_WELL, ao.Event(0, [None]), ao.Periodic(8.0)),
        "The path closes",
    ),
    "window": (
        ao.Problem(HILLS, ao.Event(-math.inf, [-1.0]), ao.Event(0.0, [0.0])),
        "infinite time",
    ),
    "time": (
        ao.Problem(DOUBLE_WELL, ao.Event(0, [-1.0]), ao.Event(None, [1.0]), energy=1.0),
        "The time was to be found",
    ),
    "cart": (scenes.get("throw_at_cart").problem, "The time was to be found"),
    "surface": (
        ao.Problem(
            FREE, ao.Event(0.0, [0.0, 0.0]), ao.Event(1.0, [None, None], on=lambda q, t: q[0] - 1)
        ),
        "meets a surface",
    ),
}


@pytest.mark.parametrize("kind", a_quarter(FOUND))
def test_ends_that_were_found_are_kept(folder, chromium, kind):
    question, said = FOUND[kind]
    known = ao.solve(question, tol=1e-10)
    file = folder / f"{kind}.html"
    plot.page(question, file)
    chromium.open(file, still=True)
    assert said in chromium.run("document.querySelector('.section-note').textContent")
    press(chromium, "solve")
    t = known.path.mesh.boundaries
    assert told(chromium, "duration") == pytest.approx(t[-1] - t[0])
    at = np.linspace(t[0], t[-1], 20001)
    L = question.system.lagrangian(
        known.path(at), known.path.velocity(at), at, parameters=question.parameters
    )
    simpson = np.r_[1, np.tile([4, 2], 9999), 4, 1] * (at[1] - at[0]) / 3
    assert told(chromium, "action") == pytest.approx(float(L @ simpson), rel=1e-6)
    assert chromium.errors == []


def test_what_a_page_cannot_solve_again_is_shown_as_found(folder, chromium):
    round_post = scenes.get("rope_round_post").problem
    file = folder / "post.html"
    plot.page(round_post, file)
    chromium.open(file, still=True)
    words = chromium.run("document.querySelector('figcaption').textContent")
    assert "a question with an obstacle again" in words
    assert "It shows the path that was found" in words
    assert chromium.run("document.querySelectorAll('.live').length") == 0
    assert chromium.run("document.querySelector('.found svg').clientWidth") > 300
    assert chromium.errors == []


@pytest.mark.parametrize("name", ["oscillator", "rod_pendulum", "kepler", "heavy_top"])
def test_a_path_dragged_is_solved(folder, chromium, name):
    file = opened(chromium, folder, scenes.get(name))
    assert file.stat().st_size < SIZE
    x, y = middle(chromium, 4)
    before = told(chromium, "action")
    chromium.drag(x, y, x, y - 12)
    assert told(chromium, "action") != before
    press(chromium, "solve")
    assert told(chromium, "action") == pytest.approx(solved(name, tol=1e-10).action, rel=KNOWN)
    assert told(chromium, "slope") < 1e-8 * abs(before)
    assert chromium.errors == []


def test_a_ray_pulled_down_is_led_to_the_one_that_dips(folder, chromium):
    """Newton's method alone goes astray from there."""
    opened(chromium, folder, scenes.get("mirage"))
    x, y = middle(chromium, 4)
    chromium.drag(x, y, x, y + 80)
    press(chromium, "solve")
    assert told(chromium, "action") == pytest.approx(solved("mirage", tol=1e-10).action, rel=KNOWN)
    assert told(chromium, "index") == 1
    words = chromium.run("document.querySelector('.live .message').textContent")
    assert words.startswith("The force that is missing on your path was taken away in ")
    press(chromium, "restart")
    press(chromium, "solve")
    assert told(chromium, "index") == 0  # the other one, from the straight line
    assert chromium.errors == []


@pytest.mark.parametrize("name", ["oscillator", "charge_planar", "pendulum"])
def test_the_index_flips_at_each_conjugate_time(folder, chromium, name):
    opened(chromium, folder, scenes.get(name))
    press(chromium, "solve")
    known = json.loads(chromium.run("document.querySelector('.live script').textContent"))
    assert known["conjugate"] and known["conjugate"] == sorted(known["conjugate"])
    for t in sorted(set(known["conjugate"])):
        for side in (-1, 1):
            T = t * (1 + 0.02 * side)
            if known["longest"] > T:
                chromium.run(f"document.querySelector('.live').live.setDuration({T})")
                assert told(chromium, "duration") == pytest.approx(T)
                assert told(chromium, "index") == sum(c < T for c in known["conjugate"])
        chromium.run(f"document.querySelector('.live').live.setDuration({t})")
        assert chromium.run("document.querySelector('.live').dataset.kind") == "degenerate"


def test_half_the_bend_is_a_quarter_of_the_rise_and_scales_stay_under_the_hand(folder, chromium):
    opened(chromium, folder, scenes.get("oscillator"))
    press(chromium, "solve")
    x, y = middle(chromium, 3)
    chromium.mouse("Pressed", x, y)
    scales, bent = set(), []
    for k in range(1, 6):
        chromium.mouse("Moved", x, y - 16 * k)
        scales.add((told(chromium, "pixels"), told(chromium, "area")))
        bent.append(told(chromium, "rise"))
    area = chromium.run(
        "(() => { const live = document.querySelector('.live'); let sum = 0;"
        " for (const look of ['adds', 'takes']) {"
        " const d = live.querySelector('.' + look).getAttribute('d');"
        " const p = d.match(/-?[\\d.]+/g).map(Number);"
        " let a = 0; for (let i = 0; i < p.length; i += 2) { const j = (i + 2) % p.length;"
        " a += p[i] * p[j + 1] - p[j] * p[i + 1] } sum += a / 2 } return sum })()"
    )
    assert len(scales) == 1
    assert area / scales.pop()[0] == pytest.approx(told(chromium, "action"), rel=0.01)
    chromium.mouse("Released", x, y - 80)
    assert bent[3] / bent[1] == pytest.approx(4, rel=1e-6)  # L is quadratic
    rise = told(chromium, "rise")
    press(chromium, "half")
    assert told(chromium, "rise") == pytest.approx(rise / 4, rel=1e-6)
    # The bend of a handle is none two handles away.
    away = chromium.run(
        "(() => { const { A, trial, motion } = document.querySelector('.live').live;"
        " return A.shares.map((s, k) => [s, Math.abs(trial()[k] - motion()[k])]) })()"
    )
    assert (
        max(d for s, d in away if s >= 5 / 8 or s <= 1 / 8 - 1e-9) < 1e-12 < max(d for _, d in away)
    )


def test_a_path_relaxes_or_runs_away_and_the_machine_hunts(folder, chromium):
    opened(chromium, folder, scenes.get("oscillator"))
    press(chromium, "bend")
    press(chromium, "relax")
    S = solved("oscillator", tol=1e-10).action
    assert told(chromium, "action") == pytest.approx(S, abs=1e-6)
    press(chromium, "restart")
    press(chromium, "hunt")
    assert S < told(chromium, "best") < S + 0.01
    press(chromium, "solve")
    chromium.run("document.querySelector('.live').live.setDuration(4)")
    press(chromium, "bend")
    press(chromium, "relax")
    assert "left the picture" in chromium.run(
        "document.querySelector('.live .message').textContent"
    )


def test_a_hunt_that_is_watched_ends_in_words(folder, chromium):
    opened(chromium, folder, scenes.get("projectile"), still=False)
    press(chromium, "hunt")
    chromium.until("document.querySelector('.live .message').textContent.includes(' trials')")
    S = solved("projectile", tol=1e-10).action
    assert S < told(chromium, "best") < S + 0.01


def test_arrows_end_to_end(folder, chromium):
    """Their sum is sqrt(2 pi i hbar / S''), a quarter turn less past the focus."""
    opened(chromium, folder, scenes.get("oscillator"))
    press(chromium, "solve")
    slider = "document.querySelector('.sum input')"
    chromium.run(  # at once, before what the fold holds is laid out
        f"document.querySelector('.sum').open = true; {slider}.dispatchEvent(new Event('input'))"
    )
    chromium.run("new Promise(requestAnimationFrame)")
    assert chromium.errors == []
    # All but the one motion found, of which there is nothing to choose.
    which = ".live button:not(.met *, .extra, .extra *), .live summary"
    seen = f"[...document.querySelectorAll('{which}')]"
    assert chromium.run(f"{seen}.every(e => e.offsetParent !== null)")  # the way back
    for T, turned in ((2.5, 45), (4.0, -45)):
        chromium.run(f"document.querySelector('.live').live.setDuration({T})")
        for power in (-2.5, -1.5, -0.5):
            chromium.run(
                f"(() => {{ const s = document.querySelector('.sum input'); s.value = {power};"
                " s.dispatchEvent(new Event('input')) })()"
            )
            assert told(chromium, "turned") == pytest.approx(turned, abs=0.2)
            assert told(chromium, "length") == pytest.approx(told(chromium, "limit"), rel=0.02)


def test_with_a_force_nothing_is_said_of_slopes(folder, chromium):
    opened(chromium, folder, scenes.get("damped_oscillator"))
    words = chromium.run("document.querySelector('.live').innerText")
    assert "equations" in words and "slope" not in words and "best" not in words
    press(chromium, "solve")
    assert told(chromium, "action") == pytest.approx(solved("damped_oscillator").action, rel=KNOWN)
    assert told(chromium, "slope") < 1e-9
    assert chromium.run("document.querySelector('.live .badge').textContent").startswith("a force")


def test_parameters_slide_and_the_motion_follows(folder, chromium):
    opened(chromium, folder, scenes.get("pendulum"))
    press(chromium, "solve")
    slide(chromium, "g", 3.7)
    problem = scenes.get("pendulum").problem.replace(parameters={"g": 3.7})
    solution = ao.solve(problem, tol=1e-10)
    assert told(chromium, "action") == pytest.approx(solution.action, rel=KNOWN)
    # So do the times conjugate to its start, which are marked beside the duration.
    found = chromium.run("document.querySelector('.live').live.foci()")
    known = data(problem, solution)["conjugate"]
    assert known and found == pytest.approx(known, rel=1e-4)
    assert chromium.run("document.querySelectorAll('.live .foci i').length") == len(known)
    rods = data(scenes.get("rod_pendulum").problem, solved("rod_pendulum"))["parameters"]
    assert {p["name"] for p in rods} == {"m", "g"}  # the events lie on a circle of radius l


def slide(chromium, name, value):
    """Move the slider of a parameter, and let it go."""
    slider = f"document.querySelector('.live [data-parameter={name}]')"
    chromium.run(f"{slider}.value = {value}")
    for event in ("input", "change"):
        chromium.run(f"{slider}.dispatchEvent(new Event('{event}'))")


@pytest.mark.parametrize("name", FOCUSING)
def test_conjugate_times_in_the_page(asked, computed, name):
    known = asked[name]["data"]
    assert computed[name]["conjugate"] == pytest.approx(
        known["conjugate"], abs=CONJUGATE * known["longest"]
    )


def knobs(chromium):
    """Return where the handles are that are not put away, (k, 2)."""
    return chromium.run(
        "[...document.querySelectorAll('.live .knob')].map(k => k.getBoundingClientRect())"
        ".filter(b => b.width).map(b => [b.x, b.y])"
    )


def apart(chromium):
    """Return the least distance between two handles, in pixels."""
    return min(np.hypot(*np.subtract(a, b)) for a, b in itertools.combinations(knobs(chromium), 2))


# The straight lines of three bodies cross; a pendulum comes back along its arc; five small arcs.
@pytest.mark.parametrize(
    ("name", "least"), [("figure_eight", 3), ("rod_pendulum", 3), ("chain", 5)]
)
def test_fingers_tell_handles_apart_on_a_phone(folder, chromium, name, least):
    opened(chromium, folder, scenes.get(name), 360, 740)
    assert len(knobs(chromium)) >= least and apart(chromium) >= 24
    press(chromium, "solve")
    assert len(knobs(chromium)) >= least and apart(chromium) >= 24


def test_the_coordinate_shown_first_is_one_that_a_handle_moves(folder, chromium):
    opened(chromium, folder, scenes.get("polar_pendulum"))
    chosen = "[...document.querySelectorAll('.live .panel .chips label')]"
    chosen += ".filter(x => x.firstChild.checked).map(x => x.textContent)"
    assert chromium.run(chosen) == ["\u03b8"]  # r is held


def test_a_path_goes_down_where_its_picture_does(folder, chromium):
    opened(chromium, folder, scenes.get("brachistochrone"))
    high = "document.querySelector('.live .event{}').cy.baseVal.value"
    assert chromium.run(high.format(".first")) < chromium.run(high.format(":not(.first)"))
    handle = "document.querySelector('.live [data-handle=\"4\"]')"
    above = f"{handle}.getBoundingClientRect().y"
    before, y = chromium.run(above), float(chromium.run(f"{handle}.ariaValueNow"))
    chromium.run(f"{handle}.focus()")
    chromium.key("ArrowUp")
    assert chromium.run(above) < before
    assert float(chromium.run(f"{handle}.ariaValueNow")) < y  # the depth


def test_all_of_it_by_keyboard_and_on_a_phone(folder, chromium):
    opened(chromium, folder, scenes.get("kepler"), 360, 740)
    assert chromium.run("document.documentElement.scrollWidth <= innerWidth")
    words = "[...document.querySelectorAll('text, p, span, label, summary')]"
    sizes = f"{words}.map(e => parseFloat(getComputedStyle(e).fontSize))"
    assert chromium.run(f"Math.min(...{sizes})") >= 11
    reach = "[...document.querySelectorAll('button, input, summary, .handle')]"
    assert chromium.run(f"{reach}.every(e => e.tabIndex >= 0)")
    assert len(knobs(chromium)) >= 3 and apart(chromium) >= 24  # fingers tell them apart
    before = told(chromium, "action")
    chromium.run("document.querySelector('.live [data-handle=\"4\"]').focus()")
    chromium.key("ArrowUp")
    assert told(chromium, "action") != before
    assert len(PAGE_MESHES) > 1
