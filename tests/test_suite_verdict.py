"""Verdicts: what is right, and at which distance that ends."""

from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from actionopt import suite
from actionopt.suite import solvers
from actionopt.suite.cell import Cell, evaluate
from actionopt.suite.interfaces import hessian
from actionopt.suite.verdict import ACCURACIES, SAME_POINT, VERDICT_MODES, examine, verdict

PLANTED = str(Path(__file__).with_name("planted.py"))
SAMPLE = ("pendulum", "rod_pendulum", "oscillator_conjugate", "disc", "string_floor_bounds")
LONG_TO_MAKE = "goddard_rocket"
FEASIBLE_MODELS = [name for name in suite.MODELS if not suite.model(name).infeasible]


def planted(name, problem="pendulum"):
    return Cell(f"{PLANTED}:{name}", problem)


def answered(problem, x, said="solved"):
    evidence = asdict(examine(problem, x, problem.start()))
    record = {"outcome": "answered", "said": said, "unbounded": problem.unbounded, **evidence}
    return {k: v for k, v in record.items() if v is not None}


def judge(problem, x, said="solved", mode="stationary", accuracy=SAME_POINT):
    return verdict(answered(problem, x, said), mode, accuracy)


def test_unbounded_is_right_where_it_is_and_is_shown():
    names = ("oscillator_past", "pendulum")
    found = [evaluate(planted("falls_far", name)) for name in names]
    assert [r["unbounded"] for r in found] == [True, False]
    assert [r["far_below"] for r in found] == [True, False]
    assert [verdict(r, "minimise") for r in found] == ["right", "wrong"]
    assert [verdict(r, "stationary") for r in found] == ["failed", "failed"]
    found = [evaluate(planted("falls", name)) for name in names]  # it says so, and stays
    assert [verdict(r, "minimise") for r in found] == ["wrong", "wrong"]
    problem = suite.get("pendulum")
    assert judge(problem, problem.x_star, "unbounded", "minimise") == "wrong"
    assert judge(problem, problem.x_star, "unbounded") == "right"  # as a stationary point
    problem = suite.get("oscillator_past")
    assert judge(problem, problem.x_star, "unbounded", "minimise") == "saddle"


def test_of_solves_that_differ_the_worst_counts():
    record = evaluate(replace(planted("wavers"), repeats=3))
    assert [len(record[k]) for k in ("times", "differing")] == [3, 2]
    assert record["at"] == "optimum" and "at" not in record["differing"][0]
    assert [verdict(record, mode) for mode in VERDICT_MODES] == ["wrong", "wrong"]
    del record["differing"]
    assert [verdict(record, mode) for mode in VERDICT_MODES] == ["right", "right"]


def test_a_higher_minimum_is_another_and_a_lower_one_right():
    problem = suite.get("hoop_bead")  # the known optimum is a saddle; minima on both sides of it
    assert [(o.kind, o.f < problem.f_star) for o in problem.others] == [("minimum", True)] * 2
    for other in problem.others:
        record = answered(problem, other.x)
        assert verdict(record, "minimise") == "right"
        assert verdict(record, "stationary") == "other"
    assert verdict(answered(problem, problem.x_star), "minimise") == "saddle"
    problem = suite.get("pendulum")
    assert verdict(answered(problem, problem.x_star) | {"above": True}, "minimise") == "other"


@pytest.mark.long
def test_judged_by_the_point_and_not_by_the_word():
    problem = suite.get("pendulum_long")
    assert judge(problem, problem.x_star, "gave up") == "right"
    assert judge(problem, problem.x_star + 1e-2) == "wrong"
    assert judge(problem, problem.x_star + 1e-2, "gave up") == "failed"
    assert judge(problem, problem.others[0].x) == "other"
    assert judge(problem, np.zeros(3)) == "wrong"
    forgotten, problem.others = problem.others[0].x, ()
    assert judge(problem, forgotten) == "new"
    assert judge(problem, forgotten, mode="minimise") == "right"
    assert judge(problem, forgotten + 1e-2) == "wrong"


def test_two_accuracies():
    problem = suite.get("pendulum")
    x = problem.x_star + 1e-4 * problem.unit * np.sin(np.linspace(0, np.pi, problem.n))
    assert [judge(problem, x, accuracy=a) for a in ACCURACIES] == ["right", "wrong"]
    assert judge(problem, problem.x_star + 1e-7 * problem.unit, accuracy=1e-6) == "right"


@pytest.mark.quick("oscillator")
@pytest.mark.parametrize("name", ["oscillator", "figure_eight", "rod_pendulum"])
def test_three_digits_of_the_path_are_enough(name):
    """Along the softest direction, where next to no residual tells."""
    problem = suite.get(name)
    H = hessian(problem, problem.x_star, problem.lam_star).toarray()
    values, vectors = np.linalg.eigh(H * problem.unit[:, None] * problem.unit)
    soft = vectors[:, np.argmin(np.abs(values))] * problem.unit
    soft /= problem.distance(problem.x_star + soft)
    for distance, expected in ((5e-4, "right"), (2e-3, "wrong")):
        for side in (1, -1):
            found = answered(problem, problem.x_star + side * distance * soft)
            assert verdict(found, "stationary") == expected
            assert found["residual"] == pytest.approx(distance, rel=0.02)


def test_success_in_tiny_units_is_no_success():
    """Absolute tolerances are met at once where the action is 1e-36 J s."""
    problem = suite.get("oscillator_atomic")
    answer = solvers.run("ipopt", problem, problem.start())
    assert answer.said == "solved"
    assert judge(problem, answer.x, answer.said) == "wrong"


@pytest.mark.quick("pendulum", "oscillator_conjugate", "string_floor_bounds", "beam_on_supports")
@pytest.mark.parametrize(
    "name",
    [
        *SAMPLE,
        *(n for n in FEASIBLE_MODELS if n != LONG_TO_MAKE),
        pytest.param(LONG_TO_MAKE, marks=pytest.mark.slow),
        *(pytest.param(n, marks=pytest.mark.slow) for n in suite.FAMILIES if n not in SAMPLE),
    ],
)
def test_one_noise_flips_the_verdict_of_every_member(name):
    """Whatever there is of constraints, contacts, units, stiffness, and of models."""
    problem = suite.member(name)
    noise = np.random.default_rng(5).uniform(-1, 1, problem.n)
    noise -= problem.flat @ (problem.flat.T @ noise)
    noise *= problem.unit / np.max(np.abs(noise))
    for accuracy in ACCURACIES:
        found = {
            eps: judge(problem, problem.x_star + eps * accuracy * noise, accuracy=accuracy)
            for eps in (0.3, 3.0)
        }
        assert found == {0.3: "right", 3.0: "wrong"}
        # Near enough to it, what Newton's method says is the distance.
        x = problem.x_star + 1e-7 * noise
        assert problem.residual(x) == pytest.approx(problem.distance(x), rel=0.5)


def test_a_degenerate_point_is_told_though_newtons_method_has_no_step_there():
    row = suite.model("pendulum_row", pendulums=8, coupling=0.5)  # 4 c sin^2(pi/4) = 1
    point = row.others[0]
    assert point.index is None and np.abs(row.gradient(point.x)).max() < 1e-12
    found = examine(row, point.x, row.start())
    assert (found.at, found.index, found.off) == ("other", None, 0.0)
