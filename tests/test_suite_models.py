"""Models: derivatives, proofs and answers, recomputed from the functions that a solver sees."""

import casadi as ca
import numpy as np
import pytest

from actionopt import suite
from actionopt.suite import nl, solvers
from actionopt.suite.cell import Cell, evaluate
from actionopt.suite.interfaces import Cutest, hessian, jacobian, scipy_arguments
from actionopt.suite.verdict import verdict

INFEASIBLE = [name for name in suite.MODELS if suite.model(name).infeasible]
STEP = 1e-6  # of the differences; they leave its square and round-off over it


@pytest.mark.parametrize("name", suite.MODELS)
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


@pytest.mark.parametrize("name", suite.MODELS)
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


@pytest.mark.parametrize("missing", [0.02, 0.1, 0.5])
@pytest.mark.parametrize("name", INFEASIBLE)
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
    with pytest.raises(ValueError, match="expected a whole number of links"):
        suite.model("arm_in_disc", links=1.5)
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
    other = Cutest(problem)
    assert other.is_linear_cons.all() and not other.is_eq_cons.any()
    assert {"bounds"} & set(scipy_arguments(problem, "SLSQP")) == set()
    assert solvers.run("ipopt", problem, problem.start()).said == "infeasible"
