"""What is exported is the same problem: expressions, `.nl` files and other solvers' clothes."""

import hashlib
import json
from functools import cache

import casadi as ca
import numpy as np
import pytest

from actionopt import suite
from actionopt.suite import nl
from actionopt.suite.dump import dump
from actionopt.suite.expression import nlp
from actionopt.suite.interfaces import Cutest, Ipopt, scipy_arguments

HARD = {"near collision", "coordinate singularity"}  # nothing is near their paths on few elements
LATER = HARD | {"badly scaled units"}  # and these are others in other numbers
NAMES = [
    pytest.param(name, marks=pytest.mark.slow if LATER & set(family.tags) else ())
    for name, family in suite.FAMILIES.items()
    if name != "chain_long"
]
EXACT = 1e-15  # relative, of what is the same expression read back
ROUNDOFF = 1e-12  # relative to the largest term, of what is summed in another order


@cache
def few(name):
    """Return a member of two elements: as an expression it has all that the larger ones have."""
    return suite.get(name, elements=None if HARD & set(suite.FAMILIES[name].tags) else 2)


def functions(given):
    x, f, g = given["x"], given["f"], given["g"]
    g = g if g.numel() else type(x)(0, 1)
    lam = type(x).sym("lam", g.numel())
    H, gradient = ca.hessian(f + ca.dot(lam, g), x)
    return ca.Function("all", [x, lam], [f, g, gradient, ca.jacobian(g, x), ca.triu(H)])


def somewhere(problem):
    random = np.random.default_rng(3)
    size = 1e-4 if "near collision" in problem.tags else 1e-2
    x = problem.path + size * random.uniform(-1, 1, problem.n) * problem.unit
    scale = problem.transcription.action_unit / np.max(problem.unit) ** 2
    return x, scale * random.uniform(-1, 1, problem.m)


def close(found, expected, tolerance):
    found, expected = np.asarray(found).ravel(), np.asarray(expected).ravel()
    if not expected.size:
        return found.size == 0
    return np.max(np.abs(found - expected)) <= tolerance * np.max(np.abs(expected))


@pytest.mark.parametrize("name", NAMES)
def test_the_expression_is_the_transcription(name):
    problem = few(name)
    x, lam = somewhere(problem)
    f, g, gradient, J, H = functions(nlp(problem))(x, lam)
    u = problem.unit
    action = problem.transcription.action_unit
    assert abs(float(f) - problem.objective(x)) <= ROUNDOFF * max(abs(float(f)), action)
    assert close(g, problem.constraints(x), ROUNDOFF) or problem.m == 0
    rows, cols = problem.jacobian_structure
    pull = np.bincount(cols, problem.jacobian(x) * lam[rows], problem.n) if problem.m else 0.0
    slope = (problem.gradient(x) + pull) * u
    rows, cols = problem.hessian_structure
    ours = problem.hessian(x, lam)
    terms = np.max(np.abs(ours * u[rows] * u[cols]))
    assert np.max(np.abs(np.asarray(gradient).ravel() * u - slope)) <= ROUNDOFF * terms
    # The same entries, but for zeros that one or the other side has found out.
    theirs = np.asarray(H)
    assert np.max(np.abs(theirs[rows, cols] - ours) * u[rows] * u[cols]) <= ROUNDOFF * terms
    assert np.sum(theirs != 0) <= ours.size
    if problem.m:
        rows, cols = problem.jacobian_structure
        assert close(np.asarray(J)[rows, cols], problem.jacobian(x), ROUNDOFF)
        assert np.sum(np.asarray(J) != 0) <= rows.size


def read(file):
    builder = ca.NlpBuilder()
    builder.import_nl(str(file), {"verbose": False})
    x = ca.vertcat(*builder.x)
    return builder, {"x": x, "f": builder.f, "g": ca.vertcat(*builder.g)}


@pytest.mark.parametrize("name", NAMES)
def test_nl_files_read_back(name, tmp_path):
    problem = few(name)
    nl.write(problem, tmp_path / "a.nl")
    builder, back = read(tmp_path / "a.nl")
    x, lam = somewhere(problem)
    mine, theirs = functions(nlp(problem, "SX")), functions(back).expand()
    for a, b in zip(mine(x, lam), theirs(x, lam), strict=True):
        assert close(ca.densify(b), ca.densify(a), EXACT)
    assert mine.sparsity_out(3) == theirs.sparsity_out(3)
    assert mine.sparsity_out(4) == theirs.sparsity_out(4)
    np.testing.assert_array_equal(builder.x_init, problem.start())
    assert len(builder.g_lb) == problem.m
    assert not any(builder.g_lb) and not any(builder.g_ub)


def test_a_digit_less_is_noticed(tmp_path, monkeypatch):
    monkeypatch.setattr(nl, "_number", lambda value: f"{value:.13g}")
    problem = suite.get("pendulum")
    nl.write(problem, tmp_path / "a.nl")
    x, lam = somewhere(problem)
    mine, theirs = functions(nlp(problem, "SX")), functions(read(tmp_path / "a.nl")[1])
    assert not close(theirs(x, lam)[2], mine(x, lam)[2], EXACT)


def test_an_nl_file_is_solved_to_the_same_optimum(tmp_path):
    problem = suite.get("rod_pendulum")
    nl.write(problem, tmp_path / "a.nl")
    builder, back = read(tmp_path / "a.nl")
    quiet = {"print_time": 0, "ipopt.print_level": 0, "ipopt.sb": "yes", "ipopt.tol": 1e-12}
    solver = ca.nlpsol("s", "ipopt", back, quiet)
    answer = solver(x0=builder.x_init, lbg=builder.g_lb, ubg=builder.g_ub)
    assert problem.distance(np.asarray(answer["x"]).ravel()) < 1e-9
    np.testing.assert_allclose(np.asarray(answer["lam_g"]).ravel(), problem.lam_star, atol=1e-8)


def test_scipy_finds_the_optimum():
    optimize = pytest.importorskip("scipy.optimize")
    for name, method in (
        ("pendulum", "trust-constr"),
        ("rod_pendulum", "trust-constr"),
        ("rod_pendulum", "SLSQP"),
        ("pendulum", "Newton-CG"),
        ("pendulum", "trust-exact"),
        ("pendulum", "L-BFGS-B"),
    ):
        problem = suite.get(name)
        arguments = scipy_arguments(problem, method)
        answer = optimize.minimize(x0=problem.start("near"), **arguments)
        assert problem.distance(answer.x) < 1e-3, (name, method)
    with pytest.raises(ValueError, match="takes constraints"):
        scipy_arguments(problem=suite.get("rod_pendulum"), method="BFGS")


def test_the_object_for_cyipopt_has_the_lower_triangle():
    problem = suite.get("rod_pendulum")
    x, lam = somewhere(problem)
    thing = Ipopt(problem)
    rows, cols = thing.hessianstructure()
    assert np.all(rows >= cols)
    H = np.zeros((problem.n, problem.n))
    H[rows, cols] = H[cols, rows] = thing.hessian(x, lam, 0.5)
    expected = Cutest(problem).hess(x, lam) - 0.5 * Cutest(problem).hess(x)
    np.testing.assert_allclose(H, expected, atol=1e-12)
    assert thing.jacobian(x).size == thing.jacobianstructure()[0].size
    assert thing.objective(x) == problem.objective(x)


def test_the_names_of_pycutest():
    problem = suite.get("rod_pendulum")
    x, v = somewhere(problem)
    p = np.cos(np.arange(problem.n))
    c = Cutest(problem)
    f, gradient = c.obj(x, gradient=True)
    values, J = c.cons(x, gradient=True)
    assert c.lag(x, v) == pytest.approx(f + v @ values, rel=1e-15)
    np.testing.assert_allclose(c.lag(x, v, gradient=True)[1], gradient + J.T @ v, atol=1e-13)
    np.testing.assert_allclose(c.hprod(p, x, v), c.hess(x, v) @ p, atol=1e-11)
    np.testing.assert_allclose(c.jprod(p, x=x), J @ p, atol=1e-13)
    np.testing.assert_array_equal(c.grad(x, 3), J[3])
    np.testing.assert_array_equal(c.scons(x)[1].toarray(), J)
    split = c.ihess(x) + sum(v[i] * c.ihess(x, i) for i in range(c.m))
    np.testing.assert_allclose(c.hess(x, v), split, atol=1e-11)
    assert len(c.gradhess(x, v)) == 3
    assert c.report()["f"] >= 2


def test_a_dump_can_be_checked_against_its_manifest(tmp_path):
    chosen = [suite.get(name) for name in ("oscillator", "kepler_two_ways")]
    manifest = dump(chosen, tmp_path / "all")
    entries = json.loads(manifest.read_text())
    assert [entry["name"] for entry in entries] == ["oscillator", "kepler_two_ways"]
    for entry, problem in zip(entries, chosen, strict=True):
        for file, digest in entry["files"].items():
            assert hashlib.sha256((tmp_path / "all" / file).read_bytes()).hexdigest() == digest
        known = json.loads((tmp_path / "all" / f"{problem.name}.json").read_text())
        np.testing.assert_array_equal(known["x_star"], problem.x_star)
        assert known["f_star"] == problem.f_star
        assert known["f_lowest_known"] == min(
            problem.f_star, *(o.f for o in problem.others), np.inf
        )
        assert known["sign_of_multipliers"] == "grad f + J' lam = 0"
        for told, other in zip(known["other_stationary_points"], problem.others, strict=True):
            np.testing.assert_array_equal(told["x"], other.x)
            assert (told["f"], told["index"], told["kind"]) == (other.f, other.index, other.kind)
