"""Members with inequalities: their certificates, from the functions a solver sees alone."""

from types import SimpleNamespace

import numpy as np
import pytest
from helpers import a_quarter
from scipy.linalg import null_space

from actionopt import suite
from actionopt.suite import active_set, known, solvers
from actionopt.suite.interfaces import hessian, jacobian
from actionopt.suite.verdict import examine

NAMES = tuple(suite.find(tags="unilateral contact"))
STATIONARY, ACTIVE = 1e-10, 1e-9


def gap(problem, x):
    """Return the rows that are inequalities, J (all rows) and which rows those are."""
    lower, upper = problem.constraint_bounds
    return problem.constraints(x), jacobian(problem, x).toarray(), lower < upper


@pytest.mark.quick("string_floor", "string_bump")
@pytest.mark.parametrize("name", a_quarter(NAMES))
def test_stars_satisfy_the_conditions_of_karush_kuhn_and_tucker(name):
    problem = suite.get(name)
    x, lam, u = problem.x_star, problem.lam_star, problem.unit
    if "bounds on coordinates" in problem.tags:
        pushed = problem.gradient(x)  # z = - grad f, at lower bounds only
        at = x - problem.bounds[0] <= ACTIVE * u
        assert np.all(pushed[at] >= -STATIONARY) and at.sum() > 20
        assert np.max(np.abs(pushed[~at])) <= STATIONARY
        return
    c, J, unequal = gap(problem, x)
    size = np.abs(J * u * lam[:, None]).max() + problem.transcription.action_unit
    slope = problem.gradient(x) + J.T @ lam
    assert np.max(np.abs(slope * u)) <= STATIONARY * size
    weight = problem.transcription.row_unit
    assert np.min(c[unequal] / weight[unequal]) >= -STATIONARY
    assert np.max(np.abs(c[~unequal] / weight[~unequal]), initial=0.0) <= STATIONARY
    assert np.max(lam[unequal]) <= STATIONARY  # lower bounds hold it
    assert np.max(np.abs(lam * c)[unequal]) <= STATIONARY * size
    assert problem.residual(x) <= STATIONARY
    assert problem.violation(x) <= STATIONARY
    # Astray, one of the conditions fails.
    astray = x + 1e-4 * u * np.cos(np.arange(problem.n))
    assert problem.residual(astray) > 1e-6
    # The Hessian is positive on what the rows in contact allow: a strict minimum.
    H = hessian(problem, x, lam).toarray()
    held = J[(lam < -ACTIVE) | ~unequal] * u
    free = null_space(held) if len(held) else np.eye(problem.n)
    assert np.linalg.eigvalsh(free.T @ (H * u * u[:, None]) @ free).min() > 0
    assert (problem.index_star, problem.kind) == (0, "minimum")


@pytest.mark.quick("string_floor_bounds")
@pytest.mark.parametrize("name", a_quarter(NAMES, 1))
def test_qualifications_hold_or_fail_as_the_tags_say(name):
    problem = suite.get(name)
    if "bounds on coordinates" in problem.tags:
        return
    x, lam = problem.x_star, problem.lam_star
    c, J, unequal = gap(problem, x)
    near = ~unequal | (c / problem.transcription.row_unit <= ACTIVE)
    rows = J[near] * problem.unit
    independent = np.linalg.matrix_rank(rows / np.linalg.norm(rows, axis=1)[:, None]) == len(rows)
    doubled = {"LICQ fails", "MFCQ fails"} & set(problem.tags)
    assert independent == (not doubled)
    if "MFCQ fails" in problem.tags:  # no direction d has J d > 0: rows and their opposites
        assert any(np.allclose(row, -other) for row in rows for other in rows)
    weak = near & unequal & (np.abs(lam) <= ACTIVE)
    if "weak complementarity" in problem.tags:
        assert weak.any()
    elif independent:
        assert not weak.any()


@pytest.mark.long
def test_discrete_optima_tend_to_closed_forms():
    for name in ("string_floor", "string_bump", "string_grazing"):
        coarse, fine = (suite.get(name, elements=N) for N in (12, 96))
        exact = coarse.continuous.action
        assert coarse.continuous.how == "closed form"
        assert abs(fine.f_star - exact) <= abs(coarse.f_star - exact) / 20 + 1e-12
        assert fine.distance(fine.path) < 1e-3
        force = -fine.lam_star[np.abs(fine.lam_star) > ACTIVE]  # lambda(t) itself
        if force.size:
            assert np.median(force) == pytest.approx(coarse.scene.facts["force"], rel=1e-6)


@pytest.mark.slow
def test_other_ways_round_are_known():
    others = suite.get("disc").others
    assert [s.kind for s in others] == ["minimum"]
    assert others[0].f > suite.get("disc").f_star


@pytest.mark.slow
def test_what_a_solver_finds_round_many_pegs_is_a_minimum():
    """Rows that are nearly met by an answer are not all in contact at the minimum it is near."""
    problem = suite.get("pegs", 48, 4, pegs=6)
    answer = solvers.run("ipopt", problem, problem.start("straight"))
    found = examine(problem, answer.x, problem.start("straight"))
    assert found.at == "new" and found.off < 1e-5 and found.index == 0


def test_parameters_of_a_member():
    assert suite.get("string_floor", extra=0.5).scene.facts["end"] == 1.5
    with pytest.raises(ValueError, match="unknown parameter 'g'"):
        suite.get("string_floor", g=1.0)


@pytest.mark.long
def test_what_solvers_came_to_is_known():
    problem = suite.get("chain_floor")
    points = known.points(problem.name, problem)
    assert points
    for x in points:
        there = problem.nearest(x * problem.unit, 1e-3)
        assert there.kind == "minimum"
        assert min(problem.distance(there.x, other.x) for other in problem.others) < 1e-9


def test_an_optimum_is_not_among_the_others():
    assert suite.get("string_floor", elements=2).others == ()


def test_rows_that_come_and_go_by_turns_are_said_not_to_settle(monkeypatch):
    tr = suite.get("string_floor", elements=2).transcription
    calls = []

    def follow(part, z, **options):
        """Below the floor where it is free, and drawn to it where it is held."""
        calls.append(part)
        assert len(calls) < 9
        held = part.problem.on.any()
        Q = np.full((tr.layout.node_count, 1), 0.0 if held else -1.0)
        return SimpleNamespace(converged=True, z=part.pack(Q, np.ones_like(Q)), noise=0.0)

    monkeypatch.setattr(active_set, "follow", follow)
    none = np.zeros((tr.layout.node_count, 1), dtype=bool)
    with pytest.raises(ValueError, match="its active set does not settle"):
        active_set.star(tr, tr.pack(tr.straight()), none)


def test_a_row_that_neither_pushes_nor_is_violated_stays_as_it_was():
    tr = suite.get("string_floor", elements=2).transcription
    Q = np.zeros((tr.layout.node_count, 1))  # along the floor
    for on in (np.zeros(Q.shape, dtype=bool), np.ones(Q.shape, dtype=bool)):
        assert np.array_equal(active_set._next_set(tr, on, tr.pack(Q, 0 * Q)), on)
