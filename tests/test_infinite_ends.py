"""Events at infinite times: paths that come from equilibria and tend to them."""

import math
import pickle
from types import SimpleNamespace

import numpy as np
import pytest
import systems
from helpers import a_quarter, at_once
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

import actionopt as ao
from actionopt.analysis.quadratic import index
from actionopt.families.searches import centres
from actionopt.families.searches.centres import FIRST_DISTANCE, _fates, guesses
from actionopt.mechanics.question.rest import rest
from actionopt.solver.ends.window import explain_short_window, for_search, restrict_guess
from actionopt.solver.kinds import revisions
from actionopt.solver.search.strategies import GUESS_ONLY
from actionopt.solver.solve import solve_near

INF = math.inf


def double_well(q, v, t, *, w):
    return v[0] ** 2 / 2 + w**2 * (q[0] ** 2 - 1) ** 2 / 2


KINK = ao.System(double_well, ["x"], parameters={"w": 1.0})
JOIN = ao.Problem(KINK, ao.Event(-INF, [-1.0]), ao.Event(INF, [1.0]))


def maier_stein(q, v, t, *, beta):
    x, y = q
    b = np.stack([x - x**3 - beta * x * y**2, -(1 + x**2) * y])
    return (v - b) @ (v - b) / 2


def exit_path(beta, **choices):
    system = ao.System(maier_stein, ["x", "y"], parameters={"beta": beta})
    return ao.solve(ao.Problem(system, ao.Event(-INF, [-1, 0]), ao.Event(INF, [0, 0])), **choices)


@pytest.mark.quick("1.0-1e-11", "5.0-1e-08")
@pytest.mark.parametrize("w, tol", [(1.0, 1e-6), (1.0, 1e-11), (5.0, 1e-8)])
def test_a_kink(w, tol):
    """x = tanh(w t), S = 4 w / 3, on all of time."""
    kink = ao.solve(JOIN.replace(parameters={"w": w}), tol=tol)
    t = np.linspace(-40, 40, 333) / w
    wrong = np.abs(kink(t) - np.tanh(w * t)).max()
    assert wrong <= kink.error <= tol
    assert np.abs(kink.velocity(t) - w / np.cosh(w * t) ** 2).max() < 30 * w * tol
    assert abs(kink.action - 4 * w / 3) < tol
    assert kink([-INF, INF]).tolist() == [[-1.0, 1.0]]
    assert kink(1e9).tolist() == [1.0]
    assert (kink.morse_index, kink.kind) == (0, "minimum")
    assert np.abs(kink.energy(t)).max() < 30 * w**2 * tol


def test_what_is_kept_of_a_kink(tmp_path):
    kink = ao.solve(JOIN)
    for copy in (pickle.loads(pickle.dumps(kink)), _saved(kink, tmp_path / "kink.npz")):
        assert copy(7.5) == kink(7.5) and copy(9.9) == kink(9.9)
        assert copy.action == kink.action
    with pytest.raises(ValueError, match="load it with"):
        ao.load(tmp_path / "kink.npz")(50.0)


def _saved(solution, file):
    solution.save(file)
    return ao.load(file, solution.problem.system)


@pytest.mark.long
def test_a_long_dwell_is_said_and_shorter_ones_are_solved():
    """At T = 40 the kink's place in time is known to e^-80; at T = 10, S - 4/3 is 3.3e-8."""
    long = ao.Problem(KINK, ao.Event(-20, [-1.0]), ao.Event(20, [1.0]))
    with pytest.raises(ao.SolveError, match=r"infinite times, Event\(-math\.inf, q\)") as caught:
        ao.solve(long)
    dwelt = caught.value.solution
    assert dwelt.status is ao.Status.DWELLING
    assert abs(dwelt.action - 4 / 3) < 1e-10
    short = ao.solve(ao.Problem(KINK, ao.Event(-5, [-1.0]), ao.Event(5, [1.0])))
    assert abs(short.action - 1.3333333663) < 1e-10


def test_that_a_kink_dwells_is_told_by_its_shift_in_time(monkeypatch):
    """Near the ends v = 8 e^-12 cosh 2 s: int ds / v^2 is e^24 / 128, and int a^2 is 16/15."""
    counted = []
    monkeypatch.setattr(index, "inertia", lambda *_, **__: counted.append(1))
    dwelt = ao.solve(ao.Problem(KINK, ao.Event(-6, [-1.0]), ao.Event(6, [1.0])), throw=False)
    assert dwelt.status is ao.Status.DWELLING and not counted
    assert dwelt.stats["condition"] == pytest.approx(np.exp(24) / 240, rel=1e-3)


def test_half_a_kink_has_its_own_clock():
    half = ao.solve(ao.Problem(KINK, ao.Event(2.0, [0.5]), ao.Event(INF, [1.0])))
    t = np.linspace(2, 60, 99)
    assert np.abs(half(t) - np.tanh(t - 2 + np.arctanh(0.5))).max() <= half.error <= 1e-8
    assert abs(half.action - (2 / 3 - (0.5 - 0.125 / 3))) < 1e-10
    back = ao.solve(ao.Problem(KINK, ao.Event(-INF, [1.0]), ao.Event(2.0, [0.5])))
    assert np.abs(back(4 - t) - half(t)).max() < 1e-8


def sine_gordon(q, v, t):
    return v[0] ** 2 / 2 + 1 - np.cos(q[0])


@pytest.mark.long
@pytest.mark.parametrize(
    "away, tol",
    a_quarter([(0.01, 1e-3), (0.1, 1e-2), (0.01, 1e-2), (0.01, 1e-6)]),
)
def test_what_a_window_leaves_out_is_amplified_near_another_equilibrium(away, tol):
    """x = 4 arctan e^(t - s): the path dwells near 0 before it goes to 2 pi."""
    system = ao.System(sine_gordon, ["x"])
    path = ao.solve(ao.Problem(system, ao.Event(0, [away]), ao.Event(INF, [2 * np.pi])), tol=tol)
    t = np.linspace(0, 50, 999)
    true = 4 * np.arctan(np.tan(away / 4) * np.exp(t))
    assert np.abs(path(t) - true).max() <= 2 * np.pi * path.error <= 2 * np.pi * tol
    back = ao.Problem(system, ao.Event(-INF, [2 * np.pi]), ao.Event(0, [away]))
    assert np.abs(ao.solve(back, tol=tol)(-t) - true).max() <= 2 * np.pi * tol


@pytest.mark.long
@pytest.mark.parametrize("away", [1e-3, pytest.param(1e-5, marks=pytest.mark.slow)])
def test_what_dwells_longer_is_solved_or_said_not_to_be(away):
    """x = tanh(t - s), from as near to -1."""
    problem = ao.Problem(KINK, ao.Event(0, [away - 1]), ao.Event(INF, [1.0]))
    path = ao.solve(problem, tol=1e-3, throw=False)
    t = np.linspace(0, 50, 999)
    wrong = np.abs(path(t) - np.tanh(t + np.arctanh(away - 1))).max()
    assert wrong <= 1e-3 or not path.success


def test_a_separatrix_is_measured_from_rest():
    """L = v^2/2 + cos x: x = 4 arctan e^t - pi, and S = 8 above rest, where L = -1."""
    pendulum = ao.System(lambda q, v, t: v[0] ** 2 / 2 + np.cos(q[0]) + 0.3 * v[0], ["x"])
    over = ao.solve(
        ao.Problem(pendulum, ao.Event(-INF, [-np.pi]), ao.Event(INF, [np.pi])), tol=1e-10
    )
    t = np.linspace(-30, 30, 99)
    assert np.abs(over(t) - (4 * np.arctan(np.exp(t)) - np.pi)).max() < 1e-9
    assert abs(over.action - 8 - 0.6 * np.pi) < 1e-9


def test_a_homoclinic_path_has_its_farthest_point_at_zero():
    """x = (3/2) / cosh(t / 2)^2, S = 6/5; one direction lowers S."""
    system = ao.System(lambda q, v, t: v[0] ** 2 / 2 + q[0] ** 2 / 2 - q[0] ** 3 / 3, ["x"])
    problem = ao.Problem(system, ao.Event(-INF, [0.0]), ao.Event(INF, [0.0]))
    bump = ao.solve(problem, guess=lambda t: 1.3 / np.cosh(t / 2 + 1) ** 2)
    t = np.linspace(-50, 50, 333)
    assert np.abs(bump(t) - 1.5 / np.cosh(t / 2) ** 2).max() <= 1.5 * bump.error <= 1.5e-8
    assert abs(bump.action - 1.2) < 1e-10
    assert bump.morse_index == 1
    assert ao.solve(problem).action == 0  # rest


@pytest.mark.long
def test_an_exit_path_leaves_the_axis_without_a_guess():
    """Maier and Stein, PRE 48, 931 (1993): 1/2 below beta = 4; two methods agree on the other."""
    assert abs(exit_path(3.0).action - 0.5) < 1e-10
    off = exit_path(10.0)
    assert abs(off.action - 0.340041403) < 1.5e-9
    assert off.kind == "minimum"
    assert np.abs(off(0.0)[1]) > 0.1


@pytest.mark.long
def test_a_bounce_from_the_centre_to_infinity():
    """As in test_singular_ends.py, where the end is far and finite."""

    def radial(q, v, r):
        return 4 * np.pi * r**2 * (v[0] ** 2 / 2 + q[0] ** 2 / 2 - q[0] ** 3 / 2 + q[0] ** 4 / 10)

    problem = ao.Problem(ao.System(radial, ["phi"]), ao.Event(0, [None]), ao.Event(INF, [0.0]))
    bounce = ao.solve(problem, guess=lambda r: 1.4 * (1 - np.tanh((r - 8) / 1.5)), tol=1e-10)
    assert abs(bounce.action - 94.958199565145) < 1e-11
    assert abs(bounce.start.q[0] - 2.7412091182694) < 1e-10
    assert bounce.morse_index == 1
    assert np.abs(bounce(np.array([40.0, 200.0]))).max() < 1e-10


def bounces(D):
    def radial(q, v, r):
        return r ** (D - 1) * (v[0] ** 2 / 2 + q[0] ** 2 / 2 - q[0] ** 3 / 2 + q[0] ** 4 / 10)

    return ao.Problem(ao.System(radial, ["phi"]), ao.Event(0, [None]), ao.Event(INF, [0.0]))


def test_near_the_straight_line_there_is_rest():
    for D in (3, 5):
        rest = solve_near(bounces(D), lambda r: 0 * r[None], 1e-8)
        assert rest.success and rest.action == 0 and rest.morse_index == 0


def test_all_kinks():
    system = ao.System(lambda q, v, t: v[0] ** 2 / 2 + (q[0] ** 2 - 1) ** 2 / 2, ["x"])
    problem = ao.Problem(system, ao.Event(-INF, [-1.0]), ao.Event(INF, [1.0]))
    (kink,) = ao.solve_all(problem, starts=0, shots=0, continuations=0)
    assert kink.action == pytest.approx(4 / 3, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("D", [4, 5])
def test_all_bounces(D):
    """Rest, and one whose action is 2 / D of its kinetic part: Derrick's theorem."""
    found = ao.solve_all(bounces(D))
    rest, bounce = found
    assert (rest.action, found.indices) == (0, (0, 1))
    r = np.linspace(0, 60, 60001)
    kinetic = np.trapezoid(r ** (D - 1) * bounce.velocity(r)[0] ** 2 / 2, r)
    assert bounce.action == pytest.approx(2 / D * kinetic, rel=1e-6)


@at_once(
    "lagrangian, start, end, said",
    [
        (
            lambda q, v, t: v[0] ** 2 / 2 - q[0] ** 2 / 2,
            -INF,
            0.0,
            "saddle of the equations of mot",
        ),
        (lambda q, v, t: v[0] ** 2 / 2 + q[0], -INF, 0.0, "expected an equilibrium .* forces .1.0"),
        (lambda q, v, t: v[0] ** 2 / 2, -INF, 0.0, "saddle of the equations of motion"),
        (lambda q, v, t: v[0] ** 2 / 2 + np.log(q[0]), -INF, 0.0, "finite, with its derivatives"),
        (
            lambda q, v, t: v[0] ** 2 / 2 + q[0] ** 2,
            INF,
            0.0,
            "expected the end event after the start",
        ),
        (
            lambda q, v, t: v[0] ** 2 / 2 + (q[0] ** 2 - 1) ** 2 / 2 + (q[0] + 1) ** 2 * q[0] ** 3,
            -INF,
            -1.0,
            None,
        ),
    ],
)
def test_what_does_not_begin_at_rest(lagrangian, start, end, said):
    def solved():
        q = [0.0] if end == 0 else [-1.0]
        problem = ao.Problem(
            ao.System(lagrangian, ["x"]), ao.Event(start, q), ao.Event(0.0, [-0.8])
        )
        return ao.solve(problem)

    if said is None:
        assert solved().success
        return
    with pytest.raises(ValueError, match=said):
        solved()


def test_equilibria_of_two_energies_are_not_joined():
    tilted = ao.System(
        lambda q, v, t: v[0] ** 2 / 2 + (q[0] ** 2 - 1) ** 2 / 2 + 0.1 * (q[0] ** 3 - 3 * q[0]),
        ["x"],
    )
    problem = ao.Problem(tilted, ao.Event(-INF, [-1.0]), ao.Event(INF, [1.0]))
    with pytest.raises(ValueError, match=r"two equilibria of one energy.* found -0.2 and 0.2"):
        ao.solve(problem)
    bound = systems.particle("x y", constraint=lambda q, t: q @ q - 1)
    with pytest.raises(ValueError, match="grow or decay at the rates 0, 0"):
        ao.solve(ao.Problem(bound, ao.Event(-INF, [1, 0]), ao.Event(0, [0, 1])))


@pytest.mark.long
def test_a_grid_of_kinks():
    w = np.array([0.5, 1.0, 3.0])
    runs = ao.sweep(JOIN, {"w": w}, record="index")
    assert runs.success.all() and not runs.index.any()
    assert runs.action == pytest.approx(4 * w / 3, abs=1e-9)
    assert abs(runs.solution(2)(0.2)[0] - np.tanh(0.6)) < 1e-7


def test_a_kink_between_wells_of_unlike_rates():
    """S is the integral of (1 - x^2)(x + 1.3), 4/3 * 1.3."""
    system = ao.System(
        lambda q, v, t: v[0] ** 2 / 2 + ((1 - q[0] ** 2) * (q[0] + 1.3)) ** 2 / 2, ["x"]
    )
    kink = ao.solve(ao.Problem(system, ao.Event(-INF, [-1.0]), ao.Event(INF, [1.0])))
    assert kink.action == pytest.approx(4 / 3 * 1.3, abs=1e-9)


@pytest.mark.parametrize(
    ("unit", "zero"),
    [
        pytest.param(1e-3, 0.0, marks=pytest.mark.slow),
        pytest.param(1e-3, 1.0, marks=pytest.mark.long),
    ],
)
def test_a_bounce_that_begins_next_to_another_equilibrium_is_guessed(unit, zero):
    """Also where the rest is at zero, which is no size."""
    rest = min(np.roots([2, 0, -2, -0.27]).real)

    def thin(q, v, r):  # (x^2 - 1)^2 / 2 - 0.27 (x - rest), but for a constant, by y = x - rest
        y = q[0] / unit - (1 - zero) * rest
        return r**3 * (
            (v[0] / unit) ** 2 / 2 + (3 * rest**2 - 1) * y**2 + 2 * rest * y**3 + y**4 / 2
        )

    there = unit * rest * (1 - zero)
    end = ao.Event(INF, [there])
    whole = ao.Problem(ao.System(thin, ["phi"]), ao.Event(0.0, [None]), end)
    begin = next(guesses(for_search(whole, 1e-8), there))(np.zeros(1))[0, 0]
    assert begin / unit + zero * rest == pytest.approx(1.06165, abs=1e-4)  # the other is at 1.06172


@pytest.mark.long
def test_from_rest_to_rest_round_a_disc():
    """Of no energy: from either rest to a tangent of the disc, and along it, by integration."""
    k, r, x, y = 0.58, 0.22, -0.08, -0.16
    system = ao.System(
        lambda q, v, t: (v @ v + (q[0] ** 2 - 1) ** 2 + k * q[1] ** 2) / 2,
        ["x", "y"],
        obstacle=lambda q, t: (q[0] - x) ** 2 + (q[1] - y) ** 2 - r**2,
    )
    sol = ao.solve(ao.Problem(system, ao.Event(-INF, [-1.0, 0.0]), ao.Event(INF, [1.0, 0.0])))

    def leave(b, side):  # on the unstable manifold, (side + a exp 2t, b exp sqrt(k) t), to the disc
        a = -side * 1e-4
        begin = [side + a, b, 2 * a, np.sqrt(k) * b, a**2 + np.sqrt(k) * b**2 / 2]

        def rates(t, z):
            return [z[2], z[3], 2 * z[0] * (z[0] ** 2 - 1), k * z[1], z[2] ** 2 + z[3] ** 2]

        def nearest(t, z):
            return (z[0] - x) * z[2] + (z[1] - y) * z[3]

        nearest.terminal, nearest.direction = True, 1
        return solve_ivp(rates, (0, 30), begin, events=nearest, rtol=1e-10, atol=1e-13).y[:, -1]

    def miss(b, side):
        end = leave(b, side)
        return np.hypot(end[0] - x, end[1] - y) - r

    ends = [leave(brentq(miss, 1e-6, 0.1, (side,)), side) for side in (-1, 1)]
    first, last = (np.arctan2(end[1] - y, end[0] - x) for end in ends)

    def along(angle):
        u, w = x + r * np.cos(angle), y + r * np.sin(angle)
        return r * np.sqrt((u**2 - 1) ** 2 + k * w**2)

    action = ends[0][4] + ends[1][4] + quad(along, last, first)[0]
    assert sol.action == pytest.approx(action, rel=1e-6) and sol.morse_index == 0
    (arc,) = sol.contacts
    assert sol(arc.begin) == pytest.approx(ends[0][:2], abs=1e-5)
    assert sol(arc.end) == pytest.approx(ends[1][:2], abs=1e-5)
    assert sol(0.0)[0] == pytest.approx(0.0, abs=1e-9)  # the middle, at the time that it has else


def test_a_rest_at_zero_may_have_the_force_of_round_off():
    """A force of 6e-16 is the round-off of pi; one of 1e-10 is none."""
    ends = ao.Event(0.0, [1.0]), ao.Event(math.inf, [0.0])
    hung = ao.System(lambda q, v, t: v[0] ** 2 / 2 + 5 * (1 + np.cos(q[0] + np.pi)), ["a"])
    found = ao.solve(ao.Problem(hung, *ends))
    assert found.action == pytest.approx(4 * np.sqrt(5) * (1 - np.cos(0.5)), rel=1e-7)
    pushed = ao.System(lambda q, v, t: v[0] ** 2 / 2 + q[0] ** 2 / 2 + 1e-10 * q[0], ["x"])
    with pytest.raises(ValueError, match=r"expected an equilibrium.*one is near \[-1e-10\]"):
        ao.solve(ao.Problem(pushed, *ends))


@pytest.mark.parametrize("hung", [math.pi, 3.1415926])
def test_a_rest_at_zero_may_be_off_as_a_coupled_coordinate_is(hung):
    """L = |v|^2 / 2 + |grad W|^2 / 2: the action of a path that climbs W from its minimum is W."""

    def law(q, v, t):
        up = -np.sin(q[0]) + q[1] * np.cos(q[0]) / 2, np.sin(q[0]) / 2 + q[1]
        return (v @ v + up[0] ** 2 + up[1] ** 2) / 2

    asked = ao.Problem(
        ao.System(law, ["a", "y"]), ao.Event(-INF, [hung, 0.0]), ao.Event(0.0, [2.0, 0.3])
    )
    found = ao.solve(asked, tol=1e-6)
    assert found.action == pytest.approx(np.cos(2) + 0.15 * np.sin(2) + 0.045 + 1, rel=1e-6)
    wrong = ao.Problem(asked.system, ao.Event(-INF, [hung, 1e-5]), asked.end)
    with pytest.raises(ValueError, match=r"expected an equilibrium.*one is near \[3\.14159265"):
        ao.solve(wrong)


def test_a_pendulum_may_rest_upright_in_axes_that_are_turned():
    """The axis has cos(pi / 2) = 6e-17 across; S = 8 sqrt(g) sin^2(phi / 4) for the angle phi."""
    across = np.cos(np.pi / 2)
    law = ao.System(
        lambda q, v, t: v @ v / 2 - 9.81 * (across * q[0] + q[1]),
        ["x", "y"],
        constraint=lambda q, t: [q @ q - 1],
    )
    found = ao.solve(
        ao.Problem(law, ao.Event(-INF, [0.0, 1.0]), ao.Event(0.0, [0.6, 0.8])), tol=1e-6
    )
    expected = 8 * np.sqrt(9.81) * np.sin(np.arcsin(0.6) / 4) ** 2
    assert found.action == pytest.approx(expected, rel=1e-6)


def test_near_a_rest_a_path_decays_by_its_rates():
    hill = ao.System(lambda q, v, t: (v[0] ** 2 + 4 * q[0] ** 2) / 2, ["x"])
    near = rest(hill, np.zeros((1, 0)), np.zeros(1), 0.0, 1)
    since = np.array([0.0, 0.7, INF])
    assert near.beyond(np.array([0.3]), since)[0] == pytest.approx(0.3 * np.exp(-2 * since))
    assert near.beyond(np.array([0.3]), since[:1])[0] == pytest.approx([0.3])


@pytest.mark.long
def test_events_far_from_rest_are_passed_on_a_long_window():
    """The action by the midpoint rule in 480 and 720 intervals over (-12, 12), extrapolated."""

    def law(q, v, t):
        well = (1 - q[0] ** 2) ** 2 / 2 + (q[1] + 0.06 * (1 - q[0] ** 2)) ** 2 / 2
        return (v @ v) / 2 + well * (1 + 0.3 * np.exp(-(t**2)))

    stops = [(-0.8, [None, 0.4]), (-0.24, [0.75, -0.22]), (0.75, [0.05, -0.18])]
    ends = ao.Event(-np.inf, [-1.0, 0.0]), ao.Event(np.inf, [-1.0, 0.0])
    through = [ao.Event(t, q) for t, q in stops]
    sol = ao.solve(ao.Problem(ao.System(law, ["x", "y"]), *ends, through=through))
    assert sol.action == pytest.approx(3.195175, abs=1e-5)


@pytest.mark.long
def test_a_trace_lengthens_its_window():
    """S = 4 w / 3; at w = 0.3 the path comes to rest in three times the time and more."""
    found = ao.trace(JOIN, "w", 0.3)
    assert found.actions == pytest.approx(4 / 3 * found.values, rel=1e-8)


@pytest.mark.long
def test_a_trace_ends_where_no_path_comes_to_rest():
    """From beyond the other equilibrium, at -1, no motion of that energy comes to 1."""
    half = ao.Problem(KINK, ao.Event(0.0, [0.2]), ao.Event(INF, [1.0]))
    found = ao.trace(half, ("start", "x"), -1.3, steps=60)
    x = found.values
    assert x.min() > -1
    assert found.actions == pytest.approx(2 / 3 - x + x**3 / 3, rel=1e-8)


@pytest.mark.parametrize(("sign", "passes"), [(-1.0, True), (1.0, False)])
def test_motions_from_rest_pass_a_point_or_run_away_from_it(sign, passes):
    """x = a cos t passes 0 within 2 s, a cosh t never does."""
    system = ao.System(lambda q, v, t: v @ v / 2 + sign * q @ q / 2, ["x"])
    problem = ao.Problem(system, ao.Event(0.0, [None]), ao.Event(2.0, [0.0]))
    fate, (t, q) = _fates(problem, np.array([1.0, -0.5]), 0.0)
    assert fate.tolist() == [passes, passes]
    if passes:
        begin = FIRST_DISTANCE * problem.duration
        np.testing.assert_allclose(q[1:], np.cos(t[1:] - begin), atol=1e-9)
        assert (t[0], q[0]) == (0.0, 1.0) and 0 <= np.pi / 2 + begin - t[-1] < 0.01


def test_guesses_of_a_bounce_lie_between_motions_that_pass_and_that_turn(monkeypatch):
    """Of x'' = x - x^3 - x' / 2 those from beyond some height pass 0, on either side."""
    monkeypatch.setattr(centres, "RUNGE_STEPS", 80)
    monkeypatch.setattr(centres, "STARTS", 16)
    system = ao.System(
        lambda q, v, t: np.exp(t / 2) * (v @ v / 2 + q @ q / 2 - (q @ q) ** 2 / 4), ["x"]
    )
    problem = ao.Problem(system, ao.Event(0.0, [None]), ao.Event(12.0, [0.0]))
    found = [guess(np.array([0.0, 100.0]))[0] for guess in guesses(problem, 0.0)]
    low, high = min(found, key=lambda q: q[0]), max(found, key=lambda q: q[0])
    assert all(q[1] == 0.0 for q in found) and low[0] == pytest.approx(-high[0])

    def force(t, y):
        return y[1], -(y[0] ** 3) + y[0] - y[1] / 2

    least = [
        solve_ivp(force, (0, 12), [part * high[0], 0.0], rtol=1e-8).y[0].min()
        for part in (0.99, 1.01)
    ]
    assert least[0] > 0.0 > least[1]


def test_a_path_of_infinite_time_dwells_at_both_ends_of_a_window():
    rests = SimpleNamespace(slow=1.0), SimpleNamespace(slow=3.0)

    class Solution:
        problem = SimpleNamespace(rests=rests)

        def __call__(self, t):
            return 10.0 * t

    problem = ao.Problem(systems.particle(), ao.Event(1.0, [0.0]), ao.Event(9.0, [1.0]))
    assert restrict_guess(Solution(), problem)(7.5) == 5.0  # the middle is at 1 + 8 * 3 / 4
    assert "may move it by 0.012, more than tol = 1e-08" in explain_short_window(1e-8, 0.0123)


def test_a_search_has_a_longer_window_with_given_ends():
    system = ao.System(lambda q, v, t: v[0] ** 2 / 2 + (q[0] ** 2 - 1) ** 2 / 2, ["x"])
    whole = ao.Problem(system, ao.Event(0.0, [0.0]), ao.Event(np.inf, [1.0]))
    found = for_search(whole, 1e-8)
    assert (found.start.q, found.end.q) == ((0.0,), (1.0,)) and 5 < found.end.t < 10
    back = ao.System(lambda q, v, t: v[0] ** 2 / 2 + q[0] ** 2 / 2 - q[0] ** 4 / 4, ["x"])
    with pytest.raises(ValueError, match="from one back to itself"):
        for_search(ao.Problem(back, ao.Event(-np.inf, [0.0]), ao.Event(np.inf, [0.0])), 1e-8)


@pytest.mark.long
def test_a_path_nowhere_near_rest_is_followed_by_itself_alone(monkeypatch):
    """Over a wall that is open far aside, to where nothing comes to rest."""
    asked, inner = [], revisions._on_window
    monkeypatch.setattr(
        revisions,
        "_on_window",
        lambda *given: asked.append(given[1:]) or inner(*given),
    )

    def L(q, v, t):
        return v @ v / 2 + (1 - q[0] ** 2) ** 2 / 2 + q[1] ** 2 / 2 - 3 * np.exp(-20 * q[0] ** 2)

    ends = ao.Event(0.0, [-0.9, 0.1]), ao.Event(np.inf, [1.0, 0.0])
    found = ao.solve(ao.Problem(ao.System(L, ["x", "y"]), *ends), throw=False)
    assert not found.success
    followed = [choices.strategies == GUESS_ONLY for _, choices in asked]
    assert followed == [guess is not None for guess, _ in asked]
    assert not followed[0] and any(followed)


def test_a_path_from_a_later_time_is_a_guess():
    ask = lambda t: ao.Problem(KINK, ao.Event(t, [0.2]), ao.Event(INF, [1.0]))  # noqa: E731
    known = ao.solve(ask(0.0))
    assert ao.solve(ask(-0.5), guess=known).action == pytest.approx(known.action, rel=1e-9)


@pytest.mark.parametrize("zero", [1e-300, np.cos(np.pi / 2), 2e-15])
def test_a_zero_of_a_rest_may_be_round_off(zero):
    law = lambda q, v, t: v @ v / 2 + (q[1] ** 2 - 1) ** 2 / 2 + q[0] ** 2 / 2  # noqa: E731
    ends = ao.Event(-INF, [zero, -1.0]), ao.Event(INF, [0.0, 1.0])
    found = ao.solve(ao.Problem(ao.System(law, ["x", "y"]), *ends))
    assert found.action == pytest.approx(4 / 3, rel=1e-9)
