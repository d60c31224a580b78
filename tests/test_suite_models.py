"""Models: derivatives, proofs and answers, recomputed from the functions that a solver sees."""

import argparse
import itertools
import json
from pathlib import Path
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest
from helpers import at_once
from scipy.integrate import solve_ivp
from scipy.linalg import null_space
from scipy.optimize import least_squares

from actionopt import suite
from actionopt.cli import main
from actionopt.suite import nl, solvers
from actionopt.suite.cell import Cell, evaluate
from actionopt.suite.commands import _names, _problem_names
from actionopt.suite.interfaces import (
    Cutest,
    hessian,
    jacobian,
    least_squares_arguments,
    scipy_arguments,
)
from actionopt.suite.models import control, fields, small
from actionopt.suite.models.fits import largest_residual
from actionopt.suite.models.floors import contact_changes
from actionopt.suite.models.model import KnownAnswer, WrittenModel
from actionopt.suite.models.slides import continuous_speeds, least_time
from actionopt.suite.saddle_search import dimer, elastic_band
from actionopt.suite.sequence import compare, in_force, steps
from actionopt.suite.verdict import _finite, verdict
from actionopt.suite.ways import score, ways

INFEASIBLE = [name for name in suite.MODELS if suite.model(name).infeasible]
SMOOTH = [name for name in suite.MODELS if suite.model(name).smooth]
FEASIBLE = [name for name in SMOOTH if name not in INFEASIBLE]
STEP = 1e-6  # of the differences; they leave its square and round-off over it


@at_once("name", SMOOTH)
def test_derivatives_are_those_of_the_functions(name):
    problem = suite.model(name)
    random = np.random.default_rng(5)
    x = problem.start() + 0.01 * problem.unit * random.uniform(-1, 1, problem.n)
    d, lam = problem.unit * random.uniform(-1, 1, problem.n), random.uniform(-1, 1, problem.m)

    def slope(f):
        return (f(x + STEP * d) - f(x - STEP * d)) / (2 * STEP)

    def gradient(x):
        return problem.gradient(x) + jacobian(problem, x).T @ lam

    for found, expected in (
        (problem.gradient(x) @ d, slope(problem.objective)),
        (jacobian(problem, x) @ d, slope(problem.constraints)),
        (hessian(problem, x, lam) @ d, slope(gradient)),
        (problem.hessian_product(x, lam, d), slope(gradient)),
    ):
        np.testing.assert_allclose(
            found, expected, atol=1e-6 * (1 + np.abs(expected).max(initial=0))
        )


@pytest.mark.quick(
    "arm_in_disc", "torsion", "soap_film", "double_integrator", "goddard_rocket", "blocks_by_hand"
)
@pytest.mark.parametrize("name", SMOOTH)
def test_files_have_the_same_functions(name, tmp_path):
    problem = suite.model(name)
    nl.write(problem, tmp_path / "m.nl")
    read = ca.NlpBuilder()
    read.import_nl(str(tmp_path / "m.nl"))
    assert np.array_equal(read.x_init, problem.start())
    both = ca.Function("both", [ca.vertcat(*read.x)], [read.f, ca.vertcat(*read.g)])
    x = problem.start() + 0.01 * problem.unit
    f, g = both(x)
    assert float(f) == pytest.approx(problem.objective(x), rel=1e-13)
    c = problem.constraints(x)
    for found, own in zip((read.g_lb, read.g_ub), problem.constraint_bounds, strict=True):
        room, expected = np.asarray(g).ravel() - np.array(found), c - own
        finite = np.isfinite(own)
        np.testing.assert_allclose(room[finite], expected[finite], rtol=0, atol=1e-13)


@pytest.mark.quick(
    "string_above_floor",
    "brachistochrone",
    "ritz_oscillator",
    "singular_arc",
    "slide_above_floor",
    "beam_on_supports",
    "blocks_by_hand",
    "pendulum_row",
)
@pytest.mark.parametrize("name", FEASIBLE)
def test_answers_satisfy_the_conditions_of_first_and_second_order(name):
    problem = suite.model(name)
    x, lam = problem.x_star, problem.lam_star
    assert problem.violation(x) <= 1e-12 and problem.lowest == problem.f_star
    assert problem.distance(problem.start()) > 1e-2
    J, H = jacobian(problem, x).toarray(), hessian(problem, x, lam).toarray()
    slope = problem.gradient(x) + J.T @ lam
    (lower, upper), (low, high) = problem.bounds, problem.constraint_bounds
    c, size = problem.constraints(x), 1 + np.abs(J * lam[:, None]).max(initial=0)
    at_low, at_high = x - lower <= 1e-12, upper - x <= 1e-12
    assert np.all(slope[at_low] >= -1e-11) and np.all(slope[at_high] <= 1e-11)
    np.testing.assert_allclose(slope[~(at_low | at_high)], 0, atol=1e-11 * size)
    unequal = low < high
    for side, sign in ((low, 1), (high, -1)):
        away = unequal & (np.abs(c - side) > 1e-11)
        assert not np.any(sign * lam[away] < -1e-12)  # only a side that is met presses
    free = null_space(np.vstack([J[~unequal | (lam != 0)], np.eye(problem.n)[slope_is(slope)]]))
    inner = np.linalg.eigvalsh(free.T @ H @ free)
    assert (problem.index_star, problem.kind) == (np.sum(inner < 0), "minimum")


def slope_is(slope):
    """Return which bounds press."""
    return np.flatnonzero(np.abs(slope) > 1e-9)


@pytest.mark.quick("blocks_by_hand", "beam_on_supports")
@pytest.mark.parametrize("name", FEASIBLE)
def test_what_is_met_has_independent_gradients_unless_the_tags_say_otherwise(name):
    problem = suite.model(name)
    x, u = problem.x_star, problem.unit
    J, met = jacobian(problem, x).toarray() * u, np.zeros(problem.m, dtype=bool)
    for side in problem.constraint_bounds:
        met |= np.abs(problem.constraints(x) - side) <= 1e-9
    at = np.min(np.abs(x - problem.bounds), axis=0) <= 1e-9 * u
    rows = np.vstack([J[met] / np.linalg.norm(J[met], axis=1)[:, None], np.eye(problem.n)[at]])
    independent = not rows.size or np.linalg.matrix_rank(rows, tol=1e-8) == len(rows)
    assert independent == ("LICQ fails" not in problem.tags)
    assert not {"MFCQ fails"} & set(problem.tags) or not independent


@pytest.mark.slow
def test_models_are_run_and_written_by_the_command(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    asked = ["--problem", "shooting", "--problem", "arm_in_disc"]
    assert main(["suite", "run", "--solver", "scipy:COBYQA", "--repeats", "1", *asked]) == 0
    records = [json.loads(line) for line in Path("results.jsonl").read_text().splitlines()]
    assert {r["problem"]: verdict(r, "minimise") for r in records} == {
        "shooting": "right",
        "arm_in_disc": "failed",
    }
    assert main(["suite", "report", "--to", "report"]) == 0
    assert main(["suite", "dump", "problems", "--models"]) == 0
    names = {path.name for path in Path("problems").iterdir()}
    assert {f"{name}.json" for name in suite.MODELS} <= names
    assert {f"{name}.nl" for name in SMOOTH} <= names and "shooting.nl" not in names
    assert main(["suite", "list", "--models", "--tag", "infeasible"]) == 0
    assert "pendulum_row" not in capsys.readouterr().out.split("arm_in_disc")[-1]


# -- infeasible ------------------------------------------------------------------------------


def least_of_combination(problem, y):
    """Return the least value of y'c(x), by what makes it convex in each model."""
    zero = np.zeros(problem.n)
    J, c0 = jacobian(problem, zero).toarray(), problem.constraints(zero)
    if problem.linear_rows.all():
        assert np.abs(y @ J).max() < 1e-15  # no x enters
        return y @ c0
    H = hessian(problem, zero, y, 0.0).toarray()
    if problem.name == "chain_too_short":  # quadratic, and convex
        assert np.linalg.eigvalsh(H).min() > 0
        x = np.linalg.solve(H, -(y @ J))
        return y @ problem.constraints(x)
    links = problem.n
    length = np.sqrt(c0[0]) / links
    for x in np.random.default_rng(1).uniform(-4, 4, (20, links)):
        # (N l)^2 less the square of the hand's distance is a sum of what is not negative.
        apart = 2 * np.sin((x[:, None] - x) / 2) ** 2 * length**2
        assert problem.constraints(x)[0] == pytest.approx((links * length) ** 2 - apart.sum())
    return -((links * length) ** 2)


@at_once("missing", [0.02, 0.1, 0.5])
@at_once("name", INFEASIBLE)
def test_multipliers_prove_that_nothing_is_feasible(name, missing):
    problem = suite.model(name, missing=missing)
    y, (lower, upper) = problem.lam_star, problem.constraint_bounds
    allowed = sum(
        v * (up if v > 0 else low) for v, low, up in zip(y, lower, upper, strict=True) if v
    )
    margin = least_of_combination(problem, y) - allowed
    assert margin > 0
    assert problem.margin == pytest.approx(margin)
    # No x violates less than that over |y|_1, and x* does not violate more.
    assert problem.violation(problem.x_star) == pytest.approx(margin / np.abs(y).sum())
    assert problem.least_violation == pytest.approx(margin / np.abs(y).sum())


def test_what_is_feasible_is_refused():
    with pytest.raises(ValueError, match="expected missing between 0 and 1, found 0"):
        suite.model("arm_in_disc", missing=0)
    for links in (1, 2.5):
        with pytest.raises(ValueError, match="expected a whole number of links"):
            suite.model("arm_in_disc", links=links)
    with pytest.raises(ValueError, match="unknown parameter 'mising' of arm_in_disc; did you"):
        suite.model("arm_in_disc", mising=0.1)
    with pytest.raises(ValueError, match="unknown model 'arm'"):
        suite.model("arm")


def test_infeasible_is_right_with_evidence_and_wrong_words_are_wrong(tmp_path):
    ends = {"nearly": "p_star, None, 'infeasible'", "unseen": "x0, None, 'infeasible'"}
    ends |= {"solved": "p_star, None, True", "up": "x0, None, False"}
    x = suite.model("arm_in_disc").x_star.tolist()
    mine = tmp_path / "mine.py"
    mine.write_text(
        "\n".join(f"def {n}(p, x0):\n    p_star = {x}\n    return {e}" for n, e in ends.items())
    )
    found = {n: evaluate(Cell(f"{mine}:{n}", "arm_in_disc")) for n in ends}
    for mode in ("minimise", "stationary"):
        said = {n: verdict(record, mode) for n, record in found.items()}
        assert said == {"nearly": "right", "unseen": "failed", "solved": "wrong", "up": "failed"}
    # Said of what is feasible, it is none.
    assert verdict(evaluate(Cell(f"{mine}:unseen", "oscillator")), "minimise") == "failed"


def test_a_model_in_other_clothes():
    problem = suite.model("bump_too_high")
    assert problem.kind == "infeasible"
    assert problem.classification[:2] == "QL"
    assert suite.model("arm_in_disc").classification[1] == "O"
    other = Cutest(problem)
    assert other.is_linear_cons.all() and not other.is_eq_cons.any()
    assert {"bounds"} & set(scipy_arguments(problem, "SLSQP")) == set()
    assert solvers.run("ipopt", problem, problem.start()).said == "infeasible"


# -- sequences -------------------------------------------------------------------------------


def test_contact_of_a_rising_floor_grows_where_it_is_said():
    heights = contact_changes(20)
    assert np.all(np.diff(heights) > 0)
    counts = []
    for floor in heights:
        below, above = (
            in_force(suite.model("string_above_floor", elements=20, floor=floor + e)).sum()
            for e in (-1e-6, 1e-6)
        )
        counts.append((below, above))
    # First the node in the middle, then one on either side of what is in contact.
    assert counts == [(0, 1), *((2 * k - 1, 2 * k + 1) for k in range(1, 10))]


def test_steps_carry_the_answer_before_and_say_what_changes():
    sequence = list(steps("string_above_floor", "floor", (-0.9, -0.85, 0.0), 20))
    first, second = (suite.model("string_above_floor", elements=20, floor=f) for f in (-0.9, -0.85))
    assert np.array_equal(sequence[0].x, first.x_star)
    assert np.array_equal(sequence[1].x, second.x_star)
    assert [s.changes for s in sequence] == [0, 2 * sum(contact_changes(20)[1:] < 0)]
    ((value, changes, cold, warm),) = compare("scipy:L-BFGS-B", iter(sequence[:1]))
    assert (value, changes) == (-0.85, 0) and warm < cold


@pytest.mark.slow
def test_steps_of_discrete_actions():
    waves = list(steps("string_waves", "waves", (2.9, 3.0)))
    assert waves[0].lam.size == waves[0].problem.m and waves[0].changes > 0
    with pytest.raises(ValueError, match="expected the optimum of pendulum_long at 3"):
        compare("ipopt", steps("pendulum_long", "duration", (2.9, 3.0)))


# -- least squares ---------------------------------------------------------------------------


@pytest.mark.parametrize("modes, residual", [(1, 0.1), (2, 1.0), (1, 20.0), (1, 50.0)])
def test_residuals_are_orthogonal_to_their_derivatives(modes, residual):
    problem = suite.model("decaying_oscillations", modes=modes, residual=residual)
    x = problem.x_star
    r, J = problem.residuals(x), problem.residual_jacobian(x)
    assert problem.objective(x) == pytest.approx(r @ r / 2)
    assert np.linalg.norm(r) == pytest.approx(residual)
    assert np.abs(J.T @ r).max() <= 1e-13 * residual
    t = np.linspace(0, 6, 60)  # the derivatives written out
    a, g, w, p = x[:4]
    motion = a * np.exp(-g * t)
    first = [motion * np.cos(w * t + p) / a, -t * motion * np.cos(w * t + p)]
    first += [-t * motion * np.sin(w * t + p), -motion * np.sin(w * t + p)]
    np.testing.assert_allclose(J[:, :4], np.array(first).T, atol=1e-14)
    lowest = np.linalg.eigvalsh(hessian(problem, x).toarray())
    assert problem.index_star == np.sum(lowest < 0) == (residual > largest_residual(problem))


def test_a_fit_in_scipys_clothes():
    problem = suite.model("decaying_oscillations", residual=0.5)
    found = least_squares(x0=problem.start(), **least_squares_arguments(problem), xtol=1e-12)
    assert problem.distance(found.x) < 1e-6
    assert problem.classification.startswith("SU")
    with pytest.raises(ValueError, match="expected a sum of squares"):
        least_squares_arguments(suite.model("bump_too_high"))
    with pytest.raises(ValueError, match="which has no residuals"):
        suite.model("brachistochrone").residuals(np.zeros(6))


# -- small -----------------------------------------------------------------------------------


def test_layers_of_a_brachistochrone_tend_to_the_cycloid():
    angle = 2.6  # (angle - sin) / (1 - cos) is the width, at depth 1; the time angle sqrt(radius)
    width = (angle - np.sin(angle)) / (1 - np.cos(angle))
    least = angle / np.sqrt(1 - np.cos(angle))
    times = [suite.model("brachistochrone", points=k, width=width).f_star for k in (5, 10, 20)]
    assert times[0] > times[1] > times[2] > least
    assert times[2] == pytest.approx(least, rel=2e-2)


def test_amplitudes_of_an_oscillator_tend_to_its_action():
    T = 3.0
    exact = ((1 + 0.25) * np.cos(T) - 2 * 0.5) / (2 * np.sin(T))
    few, many = (suite.model("ritz_oscillator", amplitudes=k).f_star for k in (5, 20))
    assert few > many > exact and many == pytest.approx(exact, abs=1e-3)
    with pytest.raises(ValueError, match="expected a duration below pi"):
        suite.model("ritz_oscillator", duration=4.0)


def test_throws_of_masses_hit_where_another_integrator_has_them():
    problem = suite.model("shooting", masses=3, tolerance=1e-10)
    springs = [[2, -1, 0], [-1, 2, -1], [0, -1, 2]]
    end = solve_ivp(
        lambda t, y: [*y[3:], *(-np.array(springs) @ y[:3])],
        (0, 1),
        [0, 0, 0, *problem.x_star],
        rtol=1e-11,
        atol=1e-11,
    ).y[:3, -1]
    np.testing.assert_allclose(end, np.cos([0, 1, 2]), atol=1e-8)
    assert problem.objective(problem.x_star) < 1e-14


@pytest.mark.long
def test_tolerance_is_the_noise_of_a_throw():
    x = suite.model("shooting").x_star + 0.01
    smooth = suite.model("shooting", tolerance=1e-11).objective(x)
    noise = [abs(suite.model("shooting", tolerance=e).objective(x) - smooth) for e in (1e-9, 1e-3)]
    assert 0 < noise[0] < 1e-9 < 1e-6 < noise[1] < 1e-3


@pytest.mark.long
def test_values_alone_are_given_where_there_are_no_derivatives(tmp_path):
    mine = tmp_path / "mine.py"
    mine.write_text("def solve(p, x0):\n    assert not hasattr(p, 'gradient')\n    return x0")
    found = {
        name: evaluate(Cell(name, "shooting"))
        for name in (f"{mine}:solve", "ipopt", "scipy:BFGS", "scipy:COBYQA")
    }
    assert [r["outcome"] for r in found.values()] == ["answered", "absent", "absent", "answered"]
    assert verdict(found["scipy:COBYQA"], "minimise") == "right"
    with pytest.raises(ValueError, match="shooting has no derivatives"):
        suite.model("shooting").gradient(np.zeros(4))


# -- fields ----------------------------------------------------------------------------------


@pytest.mark.long
def test_a_twisted_bar_has_the_stiffness_that_is_known_and_yields_beyond_its_twist():
    # -Laplace u = 2 twist in the unit square: f* = - twist^2 J / 2, where J = 0.140577014955.
    fine, coarse = (suite.model("torsion", cells=k, twist=0.5).f_star for k in (24, 12))
    exact = -0.125 * 0.140577014955
    assert abs(fine - exact) < abs(coarse - exact) / 3.8 < 2e-4
    assert (4 * fine - coarse) / 3 == pytest.approx(exact, rel=1e-4)
    yields = [in_force(suite.model("torsion", cells=24, twist=t)).sum() for t in (1.4, 1.6, 4.0)]
    assert yields[0] == 0 and 0 < yields[1] < yields[2]


def test_a_membrane_rests_on_its_hill_alone():
    problem = suite.model("membrane", cells=16)
    rests = in_force(problem).reshape(15, 15)
    assert rests[7, 7] and not rests[0].any() and np.array_equal(rests, rests.T)
    laplace = hessian(problem, problem.x_star) @ problem.x_star  # of its heights: it pulls down
    np.testing.assert_allclose(laplace[~rests.ravel()], 0, atol=1e-12)
    assert np.all(laplace[rests.ravel()] > 0)


@pytest.mark.long
def test_a_soap_film_tends_to_scherks_surface():
    errors = []
    for cells in (12, 24):
        problem = suite.model("soap_film", cells=cells)
        at = np.linspace(-1.2, 1.2, cells + 1)[1:-1]
        surface = np.log(np.cos(at[:, None]) / np.cos(at))
        found = problem.x_star.reshape(cells - 1, cells - 1)
        errors.append(min(abs(found - surface).max(), abs(found - surface.T).max()))
    assert errors[1] < errors[0] / 3 and errors[1] < 1e-3


# -- control ---------------------------------------------------------------------------------


def test_effort_between_bounds_is_that_of_the_continuous_control():
    for most in (4.2, 5.0):
        # u = b clip((1/2 - t) / a): a^2 = 3 (b/4 - 1) / b, and the effort b^2 (1/2 - 2 a / 3).
        a = np.sqrt(3 * (most / 4 - 1) / most)
        effort = most**2 * (0.5 - 2 * a / 3)
        found = suite.model("double_integrator", elements=200, most=most).f_star
        assert found == pytest.approx(effort, rel=1e-4)
    assert suite.model("double_integrator", elements=200, most=9.0).f_star == pytest.approx(6, 1e-4)
    with pytest.raises(ValueError, match="expected a bound of more than 4"):
        suite.model("double_integrator", most=4.0)


def test_no_bound_is_in_force_on_a_singular_arc():
    problem = suite.model("singular_arc", elements=20, distance=0.525)
    u, lam = problem.x_star[20:], problem.lam_star
    np.testing.assert_allclose(u, [-1.0] * 10 + [-0.5] + [0.0] * 9, atol=1e-12)
    assert np.all(lam[:10] < 0) and np.all(lam[10:] == 0)


def time_down(x, depth):
    """Return the time of a slide of straight pieces under gravity 1: lengths by mean speeds."""
    speed = np.sqrt(2 * depth)
    return float(np.sum(np.hypot(np.diff(x), np.diff(depth)) * 2 / (speed[1:] + speed[:-1])))


@pytest.mark.parametrize("width, floor", [(4.0, 1.4), (6.0, 1.0)])
def test_a_slide_above_a_floor_is_two_cycloids_and_the_floor(width, floor):
    exact, late = least_time(width, floor), []
    for elements in (40, 80):
        problem = suite.model("slide_above_floor", elements=elements, width=width, floor=floor)
        x = np.linspace(0, width, elements + 1)
        depth = np.concatenate([[0], problem.x_star**2 / 2, [1]])
        assert time_down(x, depth) == pytest.approx(problem.f_star, rel=1e-13)
        late.append(problem.f_star - exact)  # it is a slide, too: none is quicker
        assert problem.violation(problem.x_star) == 0
        lies = np.abs(depth - floor) < 1e-12
        quickest = continuous_speeds(width, floor)(x)
        assert lies.any() and np.all(np.abs(quickest[lies] ** 2 / 2 - floor) < 0.02)
        np.testing.assert_allclose(problem.x_star, quickest[1:-1], atol=0.05)
    assert 0 < late[1] < late[0] / 2 < 0.01
    end = np.arccos(1 - 2 / floor)  # corners on the curve itself; the second wheel turns back
    turn = np.append(np.linspace(0, np.pi, 2001), np.linspace(np.pi, end, 2001))
    x, depth = floor / 2 * np.array([turn - np.sin(turn), 1 - np.cos(turn)])
    x[2001:] = width + x[-1] - x[2001:]
    assert time_down(x, depth) == pytest.approx(exact, rel=1e-6)


def test_a_slide_that_does_not_touch_its_floor_is_refused():
    with pytest.raises(ValueError, match="expected a slide that touches its floor"):
        suite.model("slide_above_floor", width=1.0)
    with pytest.raises(ValueError, match="a floor at a depth of at least 1"):
        suite.model("slide_above_floor", floor=0.9)


# -- min-max ---------------------------------------------------------------------------------


def contact_forces(a, b, load):
    """Return those of supports at -a, 0 and b, by beam elements, which are exact at their nodes."""
    at = np.unique([-1.0, -a, 0.0, b, 1.0])
    K, pull = np.zeros((2 * at.size, 2 * at.size)), np.zeros(2 * at.size)
    for k, h in enumerate(np.diff(at)):  # deflection and slope at both ends
        here = slice(2 * k, 2 * k + 4)
        K[here, here] += (
            np.array(
                [
                    [12, 6 * h, -12, 6 * h],
                    [6 * h, 4 * h**2, -6 * h, 2 * h**2],
                    [-12, -6 * h, 12, -6 * h],
                    [6 * h, 2 * h**2, -6 * h, 4 * h**2],
                ]
            )
            / h**3
        )
        pull[here] += [h / 2, h**2 / 12, h / 2, -(h**2) / 12]
    held = 2 * np.searchsorted(at, [-a, 0.0, b])
    pull[held[1]] += load
    free = np.setdiff1d(np.arange(pull.size), held)
    bent = np.zeros(pull.size)
    bent[free] = np.linalg.solve(K[np.ix_(free, free)], pull[free])
    return (pull - K @ bent)[held]


@pytest.mark.long
@pytest.mark.parametrize("load", [0.0, 1.0, 4.0])
def test_no_places_of_supports_have_a_smaller_largest_force(load):
    problem = suite.model("beam_on_supports", load=load)
    a, b, *forces, most = problem.x_star
    np.testing.assert_allclose(contact_forces(a, b, load), forces, rtol=1e-12)
    grid = np.linspace(0.12, 0.98, 24)
    largest = [(max(contact_forces(p, q, load)), p, q) for p in grid for q in grid]
    least, p, q = min(largest)
    assert most <= least < 1.1 * most and max(abs(p - a), abs(q - b)) < 0.04
    p, q = 0.4, 0.7  # rows are those of the elements elsewhere, too
    elsewhere = np.array([p, q, *contact_forces(p, q, load), 9.0])
    np.testing.assert_allclose(problem.constraints(elsewhere)[:3], 0, atol=1e-12)
    with pytest.raises(ValueError, match="expected a load of 0 to 10"):
        suite.model("beam_on_supports", load=-1.0)


# -- complementarity -------------------------------------------------------------------------


@pytest.mark.parametrize("resisting", [0.0, 0.7, 3.0, 40.0])
def test_minima_of_blocks_are_those_of_the_hand(resisting):
    problem = suite.model("blocks_by_hand", blocks=3, effort=0.4, resisting=resisting)
    d = np.array([2, 4, -resisting or 6])
    hands = np.linspace(0, 12, 120001)
    slips = np.maximum(hands[:, None] - np.arange(1, 4), 0)
    f = ((slips - d) ** 2).sum(axis=1) / 2 + 0.2 * hands**2
    ends = np.concatenate([[np.inf], f, [np.inf]])
    low = np.flatnonzero((f < ends[:-2]) & (f < ends[2:]))
    found = sorted(s.x[0] for s in (problem.optimum, *problem.others))
    np.testing.assert_allclose(found, hands[low], atol=1e-4)
    assert problem.f_star == pytest.approx(f.min(), abs=1e-7)
    x, c = problem.x_star, problem.constraints(problem.x_star)
    assert [min(x[i], c[row]) for i, row in problem.pairs] == [0, 0, 0]
    biactive = [max(x[i], c[row]) == 0 for i, row in problem.pairs]
    assert any(biactive) == (resisting >= 3.0)  # from 1.8 on


@pytest.mark.parametrize("resisting", [3.0, 40.0])
def test_a_biactive_pair_has_multipliers_of_the_right_sign(resisting):
    problem = suite.model("blocks_by_hand", blocks=3, effort=0.4, resisting=resisting)
    x, lam = problem.x_star, problem.lam_star
    slope = problem.gradient(x) + jacobian(problem, x).T @ lam
    assert np.all(slope >= -1e-12) and np.all(np.abs(slope * x) <= 1e-12)
    assert np.all(lam[:3] <= 0) and np.all(lam[3:] >= 0) and lam[2] < -1


def test_pairs_are_written_as_complements(tmp_path):
    problem = suite.model("blocks_by_hand", blocks=3)
    nl.write(problem.as_complementarity(), tmp_path / "m.nl", problem.start())
    text = (tmp_path / "m.nl").read_text().splitlines()
    assert text[1].split()[:2] == ["4", "3"] and text[2].split()[:6] == [
        "3",
        "1",
        "0",
        "3",
        "0",
        "0",
    ]
    # Row r is the complement of the lower bound of an unknown, which is counted from 1.
    at = text.index("r")
    assert [line.split() for line in text[at + 1 : at + 4]] == [
        ["5", "1", str(i)] for i in (2, 3, 4)
    ]
    # Without these lines it reads as what it is made of.
    text[at + 1 : at + 4] = ["2 0"] * 3
    text[2] = " 3 1"
    (tmp_path / "plain.nl").write_text("\n".join(text) + "\n")
    read = ca.NlpBuilder()
    read.import_nl(str(tmp_path / "plain.nl"))
    both = ca.Function("both", [ca.vertcat(*read.x)], [read.f, ca.vertcat(*read.g)])
    f, g = both(problem.start())
    assert float(f) == pytest.approx(problem.objective(problem.start()))
    np.testing.assert_allclose(np.asarray(g).ravel(), problem.constraints(problem.start())[:3])


# -- saddles ---------------------------------------------------------------------------------


@pytest.mark.parametrize("coupling", [2.0, 5.0, 8.0])
def test_the_index_of_standing_pendulums_follows_from_the_coupling(coupling):
    problem = suite.model("pendulum_row", pendulums=8, coupling=coupling)
    standing, turned = problem.others
    for point in (standing, turned):
        assert np.abs(problem.gradient(point.x)).max() < 1e-12
        values = np.linalg.eigvalsh(hessian(problem, point.x).toarray())
        assert point.index == np.sum(values < 0)
        assert point.f == pytest.approx(problem.objective(point.x), abs=1e-12)
    assert (standing.index == 1) == (4 * coupling * np.sin(np.pi / 16) ** 2 > 1)


def test_a_dimer_climbs_to_a_saddle_known_or_not():
    for coupling, known in ((8.0, True), (2.0, False), (0.25, False)):
        problem = suite.model("pendulum_row", coupling=coupling)
        x, _, rests = dimer(problem, problem.start())
        values = np.linalg.eigvalsh(hessian(problem, x).toarray())
        assert rests and np.sum(values < 0) == 1 and np.abs(problem.gradient(x)).max() < 1e-8
        assert (problem.distance(x, problem.others[0].x) < 1e-6) == known
        found = problem.nearest(x, 1e-3)
        assert found.index == 1 and found.f == pytest.approx(problem.objective(x))
        assert (found.f == problem.others[0].f) == known


@pytest.mark.long
def test_a_dimer_climbs_to_a_saddle_of_an_action():
    bead = suite.get("hoop_bead")  # its motion is a saddle between two others
    x, _, rests = dimer(bead, bead.start())
    assert rests and bead.index_star == 1 and bead.distance(x) < 1e-6


def test_a_band_finds_the_barrier():
    problem = suite.model("pendulum_row", pendulums=4, coupling=8.0)
    ends = problem.x_star, problem.others[1].x
    band, rests = elastic_band(problem, *ends, images=5)
    assert rests and max(map(problem.objective, band)) == pytest.approx(8.0)
    with pytest.raises(ValueError, match="expected a program without constraints"):
        elastic_band(suite.model("singular_arc"), *ends)


def test_any_saddle_of_index_one_is_right_where_one_is_asked_for(tmp_path):
    mine = tmp_path / "mine.py"
    mine.write_text(
        "import numpy as np\n"
        "def low(p, x0):\n    return 0 * x0\n"
        "def high(p, x0):\n    return np.pi + 0 * x0\n"
        "def off(p, x0):\n    return x0\n"
        "def up(p, x0):\n    return x0, None, False\n"
    )
    asked = {name: Cell(f"{mine}:{name}", "pendulum_row") for name in ("low", "high", "off", "up")}
    asked["dimer"] = Cell(
        "actionopt.suite.saddle_search:dimer", "pendulum_row", parameters={"coupling": 2.0}
    )
    asked["many"] = Cell(f"{mine}:high", "pendulum_row", parameters={"coupling": 1.0})
    found = {name: verdict(evaluate(cell), "saddle") for name, cell in asked.items()}
    assert found == {
        "low": "other",
        "high": "right",
        "off": "wrong",
        "up": "failed",
        "dimer": "right",
        "many": "other",
    }


def test_what_is_stationary_among_rows_and_bounds_need_not_be_listed():
    x, y = ca.SX.sym("x"), ca.SX.sym("y")

    def problem(f, c, **more):
        told = KnownAnswer(np.array([-1.0, 0.0]), np.zeros(c.numel()), "told")
        more |= {"start": np.array([0.3, 0.3]), "answer": lambda: told}
        return WrittenModel("mine", ca.vertcat(x, y), f, c, **more)

    def found(asked, *at):
        near = asked.nearest(np.array(at) + 1e-4, 1e-3)
        return None if near is None else (near.index, *np.round(near.x, 12) + 0.0)

    # On a circle x + y^2 is greatest at (1/2, sqrt(3)/2), and has a second minimum at (1, 0).
    circle = problem(x + y**2, x**2 + y**2 - 1)
    assert found(circle, 1.0, 0.0) == (0, 1, 0)
    top = circle.nearest(np.array([0.5, 0.75**0.5]) + 1e-4, 1e-3)
    assert top.index == 1 and top.x == pytest.approx([0.5, 0.75**0.5], abs=1e-12)
    assert found(circle, 0.0, 1.0) is None and circle.residual(np.array([0.0, 1.0])) > 0.1
    assert circle.residual(top.x + 1e-4) < 2e-4
    # The corner presses on both sides; on the edge x = 1/2 a saddle, and at (1/2, 0) y is pulled.
    corner = problem(-(x**2) - y**2, ca.SX(0, 1), bounds=(-1.0, [0.5, 0.75]))
    assert found(corner, 0.5, 0.75) == (0, 0.5, 0.75)
    assert found(corner, 0.5, 0.0) == (1, 0.5, 0)
    assert found(corner, 0.0, 0.0) == (2, 0, 0)
    assert found(corner, 0.5, 0.3) is None
    pulled = problem(x**2 + y**2, ca.SX(0, 1), bounds=(-1.0, [0.5, 0.75]))
    assert found(pulled, 0.5, 0.0) is None and found(pulled, 0.0, 0.0) == (0, 0, 0)


# -- all minima ------------------------------------------------------------------------------


def length_of_string(centres, sides, ends):
    """Return the length of a taut string round those discs of radius 1, on these sides.

    Round some of them it is closed: tangents and arcs. It is the longest of those that pull.
    """
    longest = 0.0
    for touched in itertools.product((False, True), repeat=len(sides)):
        where = [ends[0], *(c for c, on in zip(centres, touched, strict=True) if on), ends[1]]
        s = [0, *(side for side, on in zip(sides, touched, strict=True) if on), 0]
        length, angles = 0.0, []
        for (a, b), (sa, sb) in zip(itertools.pairwise(where), itertools.pairwise(s), strict=True):
            x, y = np.subtract(b, a)
            lean = np.arcsin((sa - sb) / np.hypot(x, y))
            angles.append(np.arctan2(y, x) - lean)
            length += np.hypot(x, y) * np.cos(lean)
        arcs = [
            side * (i - o) for side, (i, o) in zip(s[1:-1], itertools.pairwise(angles), strict=True)
        ]
        if all(arc >= 0 for arc in arcs):
            longest = max(longest, length + sum(arcs))
    return longest


def test_two_links_are_a_chain_and_one_is_none():
    assert suite.model("chain_too_short", links=2).n > 0
    with pytest.raises(ValueError, match="number of links, at least 2, found 1"):
        suite.model("chain_too_short", links=1)


def test_sides_are_above_and_below(monkeypatch):
    lengths = {(1,): 2.0, (-1,): 1.0}
    monkeypatch.setattr(
        "actionopt.suite.ways._way", lambda *x: SimpleNamespace(f=lengths[tuple(x[2])])
    )
    assert list(ways(suite.get("disc"))) == [(-1,), (1,)]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["disc", "discs", "pegs"])
def test_each_choice_of_sides_has_its_minimum(name):
    problem = suite.get(name)
    found, numbers = ways(problem), problem.scene.facts.numbers
    count = len(numbers) // 2
    centres = [(numbers[f"x{i}"], numbers[f"y{i}"]) for i in range(count)]
    ends = problem.transcription.ends[[0, -1]]
    assert len(found) == 2**count and min(w.f for w in found.values()) == problem.f_star
    for sides, way in found.items():
        exact = length_of_string(centres, sides, ends) ** 2 / 2  # in a time of 1
        assert way.f == pytest.approx(exact, rel=1e-3) and way.index == 0
        assert problem.residual(way.x) < 1e-9
    points = [way.x for way in found.values()]
    assert score(problem, [s.x for s in (problem.optimum, *problem.others)]) == 1.0
    assert score(problem, points[:1]) == 1 / len(found)
    assert score(problem, points) == 1.0
    with pytest.raises(ValueError, match="expected a member with discs"):
        ways(suite.get("pendulum"))


def test_inside_of_its_bounds_nothing_is_violated():
    model = suite.model("string_above_floor")
    x = model.start()
    assert np.min(x - model.bounds[0]) > 0.5 and model.violation(x) == 0.0


def test_what_a_model_is_by_itself():
    model = suite.model("arm_in_disc")
    assert repr(model) == f"{type(model).__name__}({model.name}, {model.classification})"
    assert (model.default_start, model.start_names) == ("own", ("own",))
    np.testing.assert_array_equal(model.start("own"), model.start())
    with pytest.raises(ValueError, match="'own', found 'straight'"):
        model.start("straight")
    assert model.known_by == dict.fromkeys(
        ("x_star", "f_star", "lam_star", "index_star"), model.answer.how
    )
    assert (model.origin, model.resolution, model.lowest) == ({}, {}, np.inf)
    assert model.least_violation == pytest.approx(1 - 0.9**2)  # the arm is too short by 0.1
    box = suite.model("shooting")
    assert box.variable_names == [f"x[{k}]" for k in range(box.n)] and box.constraint_names == []
    assert (box.least_violation, box.lowest < np.inf) == (0.0, True)


def test_score_is_the_part_of_ways_that_are_found(monkeypatch):
    known = {(k,): SimpleNamespace(x=np.array([float(k)])) for k in range(4)}
    monkeypatch.setattr("actionopt.suite.ways.ways", lambda problem: known)
    problem = SimpleNamespace(distance=lambda x, y: abs(float(x[0] - y[0])))
    assert score(problem, [np.array([1.0005]), np.array([2.5]), np.array([3.0])]) == 0.5
    assert score(problem, [np.array([2.5])], reach=0.5) == 0.5


@at_once(
    ("check", "value", "words"),
    [
        (lambda x: small._whole(x, "links"), 1, "expected 2 to 20 links, found 1"),
        (lambda x: small._whole(x, "links"), 21, "found 21"),
        (lambda x: small._whole(x, "links"), 2.5, "found 2.5"),
        (fields._cells, 2, "at least 3, found 2"),
        (fields._cells, 3.5, "found 3.5"),
        (control.check_elements, 1, "at least 2, found 1"),
        (control.check_elements, 2.5, "found 2.5"),
        (suite.get, "pendulums", "unknown test problem 'pendulums'.*pendulum"),
    ],
)
def test_sizes_of_models_are_refused(check, value, words):
    with pytest.raises(ValueError, match=words):
        check(value)


def test_sizes_of_models_pass():
    assert (small._whole(2, "links"), small._whole(20.0, "links")) == (2, 20)
    assert (fields._cells(3.0), control.check_elements(2)) == (3, 2)
    assert (_finite(1.0), _finite(np.nan)) == (1.0, None)


def test_names_that_a_command_is_about():
    def names(call, **given):
        known = {
            "problem": [],
            "models": False,
            "tag": [],
            "degree": None,
            "set": [],
            "start": None,
        }
        return call(argparse.Namespace(**known | {"elements": None} | given))

    assert names(_names, problem=["pendulum", "shooting"]) == ["pendulum", "shooting"]
    assert names(_names, problem=["shooting"], models=True) == ["shooting"]
    assert names(_names, problem=["shooting"], models=True, tag=["infeasible"]) == []
    with pytest.raises(ValueError, match="nothing"):
        names(_names, problem=["nothing"])
    assert names(_problem_names, problem=["pendulum"], elements=4) == ["pendulum"]
    with pytest.raises(ValueError, match="found 'bent'"):
        names(_problem_names, problem=["pendulum"], start="bent")
