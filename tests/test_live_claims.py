"""What a live page claims: of every state that its reader makes, in a browser, against `solve`."""

import numpy as np
import pytest
import states
from helpers import of_one_leg, solved

import actionopt as ao
from actionopt import scenes

LIVE = [name for name in of_one_leg() if not scenes.get(name).problem.system.r]
PLACES, PLACES_OF_OWN = 3, 10  # of each slider


def asked(lagrangian, start, end, T, names=("x",), force=None, **parameters):
    system = ao.System(lagrangian, list(names), parameters=parameters, force=force)
    return ao.Problem(system, ao.Event(0.0, start), ao.Event(T, end))


# What a teacher would type, over times in which most of them have motions of index 1 and more.
OWN = {
    "driven double well": asked(
        lambda q, v, t, *, k, f, w: (
            v[0] ** 2 / 2 - k * (q[0] ** 2 - 1) ** 2 / 4 + f * q[0] * np.cos(w * t)
        ),
        *([-0.5], [0.7], 14.0),
        k=1.0,
        f=0.3,
        w=1.2,
    ),
    "bead on a turning hoop": asked(
        lambda q, v, t, *, g, R, w: (
            R**2 * (v[0] ** 2 + w**2 * np.sin(q[0]) ** 2) / 2 + g * R * np.cos(q[0])
        ),
        *([0.5], [1.0], 4.0, ["theta"]),
        g=9.81,
        R=0.5,
        w=6.0,
    ),
    "planet in polar coordinates": asked(
        lambda q, v, t, *, m, k: m * (v[0] ** 2 + q[0] ** 2 * v[1] ** 2) / 2 + k / q[0],
        *([1.0, 0.0], [1.5, 2.0], 2.0, ["r", "phi"]),
        m=1.0,
        k=1.0,
    ),
    "charge in crossed fields": asked(
        lambda q, v, t, *, m, B, E: (
            m * (v @ v) / 2 + B * (q[0] * v[1] - q[1] * v[0]) / 2 + E * q[0]
        ),
        *([0.0, 0.0], [1.0, 0.5], 2.0, ["x", "y"]),
        m=1.0,
        B=1.0,
        E=0.5,
    ),
    "pendulum on a shaken support": asked(
        lambda q, v, t, *, g, a, w: v[0] ** 2 / 2 + (g - a * w**2 * np.cos(w * t)) * np.cos(q[0]),
        *([2.9], [3.3], 4.0, ["theta"]),
        g=1.0,
        a=0.2,
        w=12.0,
    ),
    "two springs that stiffen": asked(
        lambda q, v, t, *, a, b: (
            v @ v / 2 - (q[0] ** 2 + a * q[1] ** 2) / 2 - b * (q[0] * q[1]) ** 2
        ),
        *([1.0, 0.0], [0.0, 1.0], 4.0, ["x", "y"]),
        a=1.5,
        b=0.4,
    ),
    # Over nearly two periods: its frequency grows with its swing, and so it has many motions.
    "quartic spring, pushed": asked(
        lambda q, v, t, *, m, k, f: m * v[0] ** 2 / 2 - k * q[0] ** 4 / 4 + f * q[0],
        *([1.0], [-0.5], 12.0),
        m=1.0,
        k=1.0,
        f=0.1,
    ),
    # Both forces grow with the velocity: one lies across it and is in L, one along it and is not.
    "charge in a quartic trap, with drag": asked(
        lambda q, v, t, *, m, B, k: (
            m * (v @ v) / 2 + B * (q[0] * v[1] - q[1] * v[0]) / 2 - k * (q @ q) ** 2 / 4
        ),
        *([1.0, 0.0], [-0.3, 0.4], 4.0, ["x", "y"]),
        force=lambda q, v, t, *, c: -c * np.sqrt(v @ v + 1e-4) * v,
        m=1.0,
        B=1.5,
        k=1.0,
        c=0.2,
    ),
}


class Page:
    """The page of a problem of one's own, under its reader's hand."""

    def __init__(self, chromium, folder, problem):
        self.chromium, self.problem = chromium, problem
        states.write(problem, ao.solve(problem, tol=1e-10), folder / "own.html")
        chromium.open(folder / "own.html", still=True)

    def press(self, *names):
        for name in names:
            self.chromium.run(f"document.querySelector('.live [data-do={name}]').click()")

    def slide(self, which, value):
        self.chromium.run(
            f"(() => {{ const input = document.querySelector('.live input[{which}]');"
            f" input.value = {value}; for (const kind of ['input', 'change'])"
            " input.dispatchEvent(new Event(kind)) })()"
        )

    def text(self, look):
        return self.chromium.run(f"document.querySelector('.live .{look}').textContent")

    def told(self, key):
        return self.chromium.run(f"document.querySelector('.live').dataset.{key}")

    def number(self, key):
        return float(self.told(key))


@pytest.fixture
def own(chromium, tmp_path):
    return lambda *question, **more: Page(chromium, tmp_path, asked(*question, **more))


@pytest.mark.slow
@pytest.mark.parametrize("name", [*LIVE, *OWN])
def test_every_claim_of_a_state_is_that_of_solve(name, chromium, tmp_path):
    solution = ao.solve(OWN[name], tol=1e-10) if name in OWN else solved(name, tol=1e-10)
    if solution.problem.asked is not None:
        solution = solution.between_times
    states.write(solution.problem, solution, tmp_path / "live.html")
    count = PLACES_OF_OWN if name in OWN else PLACES
    found = states.states(chromium, tmp_path / "live.html", count)
    judged = [(s["slider"], s["value"], states.judge(solution.problem, s)) for s in found]
    assert not [said for said in judged if said[2] not in ("agrees", "unknown")]
    assert sum(said[2] == "agrees" for said in judged) >= len(judged) / 2
    assert chromium.errors == []


def test_a_step_is_resolved_however_steep(own):
    step = own(
        lambda q, v, t, *, w: v[0] ** 2 / 2 - (1 + np.tanh((q[0] - 0.5) / w)) / 2,
        [0.0],
        [1.0],
        1.0,
        w=0.2,
    )
    step.slide("data-parameter=w", 0.02)
    step.press("solve")
    # By shooting with scipy, and a scan of first velocities: the one motion, without foci.
    assert step.number("action") == pytest.approx(-0.1023872, abs=5e-8)
    assert step.told("kind") == "minimum"
    assert "green" in step.chromium.run("document.querySelector('.live .light').className")


@pytest.mark.slow
def test_a_motion_is_found_where_newton_ends_at_none(chromium, tmp_path):
    top = Page(chromium, tmp_path, scenes.get("heavy_top").problem)
    # By shooting with scipy from 150 and 300 starts: one motion, and none.
    for inertia, known in ((0.00428, "true"), (0.00476, "false")):
        top.press("restart")
        top.slide("data-parameter=I\u2083", inertia)
        top.press("solve")
        assert top.told("known") == known, inertia
        if known == "true":
            assert top.number("action") == pytest.approx(5.6624737, abs=5e-7)


@pytest.mark.slow
def test_no_motion_is_claimed_where_there_is_none(own):
    free = own(lambda q, v, t: (v[0] ** 2 - q[0] ** 2) / 2, [1.0], [None], 2.5)
    free.press("solve")
    assert (free.told("kind"), free.number("index")) == ("saddle", 1)
    # x = cos t + tan T sin t, but at pi/2 and 3 pi/2, where the index changes.
    marked = free.chromium.run("document.querySelector('.live').live.foci()")
    assert marked == pytest.approx([np.pi / 2, 3 * np.pi / 2], abs=0.05)
    free.slide("data-duration", np.pi / 2)
    free.press("solve")
    assert free.told("known") == "false"
    assert free.text("badge") == "no motion was found here"
    assert "zero in every direction" not in free.text("message")
    free.slide("data-duration", 4.8)
    assert (free.told("kind"), free.number("index")) == ("saddle", 2)
    assert abs(free.number("slope")) > 1  # the path is bent, the motion is not
    free.press("solve")
    assert free.number("action") == pytest.approx(-np.tan(4.8) / 2, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(("power", "sentence"), [(3, "An eighth"), (4, "A sixteenth")])
def test_what_half_a_bend_shows_at_a_focus(own, power, sentence):
    held = own(
        lambda q, v, t: (v[0] ** 2 - q[0] ** 2) / 2 - q[0] ** power / power, [0.0], [0.0], 2.0
    )
    held.press("solve", "bend", "half", "half", "half")
    assert "A quarter" in held.text("message")
    held.press("restart", "solve")
    held.slide("data-duration", np.pi)
    assert held.told("kind") == "degenerate"
    held.press("bend", "half", "half")
    assert sentence in held.text("message")


@pytest.mark.slow
def test_far_downhill_nothing_is_said_of_the_motion(own):
    held = own(
        lambda q, v, t, *, R: v[0] ** 2 / 2 + R**2 * np.cos(q[0] / R), [0.3], [0.1], 4.0, R=30.0
    )
    held.press("solve", "bend", "relax")  # S is at least -3600: it does not fall without end
    assert held.text("message") == "The path has left the picture, and S was still falling."


@pytest.mark.slow
def test_a_force_may_have_a_potential(own):
    pulled = own(
        lambda q, v, t: v[0] ** 2 / 2, [1.0], [0.5], 1.0, force=lambda q, v, t: [-4 * q[0]]
    )
    pulled.press("solve")
    assert pulled.text("badge").startswith("a force stands beside L")
    assert "zero in every direction" not in pulled.text("message")


@pytest.mark.slow
@pytest.mark.parametrize("constant", [0.0, 1e9, 1e17])
def test_a_constant_beside_the_lagrangian_is_no_part_of_what_is_said(own, constant):
    fall = own(lambda q, v, t: v[0] ** 2 / 2 - 9.81 * q[0] + constant, [0.0], [1.0], 2.0)
    # The straight line: the slope is g T / sqrt(T) by the norm of `slope`.
    assert fall.text("order") == "first order: the steepest slope of S is 20 here"
    fall.press("solve", "bend", "half")
    words = fall.text("message")
    assert "0.250 of it. A quarter" in words
    more = fall.chromium.run("document.querySelector('.live .more').textContent")
    assert more.startswith("1.58")
    assert "slope 3.2 on your path, 0 on the motion" in fall.text("order")
    assert fall.chromium.errors == []


@pytest.mark.slow
def test_numbers_of_any_size_are_written(own):
    ion = own(
        lambda q, v, t: 1.67e-27 * (v[0] ** 2 - 1e26 * q[0] ** 2) / 2, [1e-10], [-5e-11], 2e-13
    )
    ion.press("solve", "bend")
    assert "4.817\u00d710\u207b\u00b3\u2075 more" in ion.text("action")


@pytest.mark.slow
def test_motions_that_were_met_are_seen_again(own):
    swing = own(lambda q, v, t: v[0] ** 2 / 2 + np.cos(q[0]), [0.3], [0.1], 8.0, names=["theta"])
    swing.press("solve")
    assert (swing.told("kind"), swing.number("index")) == ("saddle", 2)
    swing.press("bend", "relax")
    assert "Downhill as far as it goes" in swing.text("message")
    assert "than on the motion shown" in swing.text("action")
    swing.press("solve")
    assert swing.told("kind") == "minimum"
    chips = "document.querySelectorAll('.live .met button')"
    assert swing.chromium.run(f"{chips}.length") == 2
    swing.chromium.run(f"{chips}[0].click()")
    assert (swing.told("kind"), swing.number("index")) == ("saddle", 2)
