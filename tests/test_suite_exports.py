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
from actionopt.suite.interfaces import Ipopt, hessian, jacobian, scipy_arguments

HARD = {"near collision", "coordinate singularity"}  # nothing is near their paths on few elements
LATER = HARD | {"badly scaled units"}  # and these are others in other numbers
NAMES = [
    pytest.param(name, marks=pytest.mark.slow if LATER & set(family.tags) else ())
    for name, family in suite.FAMILIES.items()
    if name != "chain_long"
]
EXACT = 1e-15  # relative, of numbers read back
SUMMED = 3e-15  # relative to the largest term: a velocity is the same sum in another order
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


def off(problem, back, x, lam):
    """Return how far f, c, gradient, Jacobian and Hessian of a file are, by the largest term."""
    mine, theirs = functions(nlp(problem, "SX")), functions(back).expand()
    ours, read_back = ([np.asarray(ca.densify(part)) for part in f(x, lam)] for f in (mine, theirs))
    u, H = problem.unit, ours[4]
    term = np.max(np.abs(H * np.outer(u, u)))
    action = problem.transcription.action_unit
    rows = np.max(np.abs(ours[3] * u)) * max(1.0, np.max(np.abs(x / u))) if problem.m else 1.0
    scale = (
        max(abs(ours[0].item()), action),
        rows,
        term / u[:, None],
        np.maximum(np.abs(ours[3]), 1e-300),
        term / np.outer(u, u),
    )
    assert mine.sparsity_out(3) == theirs.sparsity_out(3)
    assert mine.sparsity_out(4) == theirs.sparsity_out(4)
    pairs = zip(ours, read_back, scale, strict=True)
    return [np.max(np.abs(a - b) / size, initial=0.0) for a, b, size in pairs]


@pytest.mark.parametrize("name", NAMES)
def test_nl_files_read_back(name, tmp_path):
    problem = few(name)
    nl.write(problem, tmp_path / "a.nl")
    builder, back = read(tmp_path / "a.nl")
    # Where all is linear constants are in the bounds of c.
    lower, upper = np.array(builder.g_lb), np.array(builder.g_ub)
    equal = np.equal(*problem.constraint_bounds)
    assert np.array_equal(lower[equal], upper[equal])
    assert np.all(np.isinf(upper[~equal]))
    back["g"] = back["g"] - ca.DM(builder.g_lb) if problem.m else back["g"]
    x, lam = somewhere(problem)
    f, c, gradient, J, H = off(problem, back, x, lam)
    assert max(f, gradient, H) <= SUMMED
    assert max(c, J) <= EXACT
    np.testing.assert_array_equal(builder.x_init, problem.start())
    assert len(builder.g_lb) == problem.m


def test_a_digit_less_is_noticed(tmp_path, monkeypatch):
    monkeypatch.setattr(nl, "_number", lambda value: f"{value:.13g}")
    problem = suite.get("pendulum")
    nl.write(problem, tmp_path / "a.nl")
    gaps = off(problem, read(tmp_path / "a.nl")[1], *somewhere(problem))
    assert gaps[4] > SUMMED


def test_an_nl_file_names_its_rows_and_columns_and_starts_its_multipliers(tmp_path):
    problem = suite.get("rod_pendulum", elements=2)
    made = nl.write(problem, tmp_path / "a.nl")
    assert [file.name for file in made] == ["a.nl", "a.row", "a.col"]
    assert (tmp_path / "a.col").read_text().split() == problem.variable_names
    assert (tmp_path / "a.row").read_text().split() == [*problem.constraint_names, "action"]
    lines = (tmp_path / "a.nl").read_text().splitlines()
    assert "multipliers of AMPL are minus those of f + lam'c" in lines[0]
    assert lines[8].split()[:2] == ["6", "4"]  # the longest names: action, x[7]
    at = lines.index(f"d{problem.m}")
    dual = np.array([float(line.split()[1]) for line in lines[at + 1 : at + 1 + problem.m]])
    x = problem.start()
    J = jacobian(problem, x).toarray()
    u = problem.unit  # in these the fit is made
    fitted = np.linalg.lstsq((J * u).T, -problem.gradient(x) * u, rcond=None)[0]
    np.testing.assert_allclose(-dual, fitted, rtol=1e-6)
    # f = x^2 + y^2 - l^2 has nothing linear, that of a wire has nothing else.
    wire = suite.get("turning_wire", elements=2)
    nl.write(wire, tmp_path / "b.nl")
    lines = (tmp_path / "b.nl").read_text().splitlines()
    assert lines[2].split()[:2] == ["0", "1"]  # of its constraints none is nonlinear
    J = jacobian(wire, wire.start()).toarray()
    for r in range(wire.m):
        assert lines[lines.index(f"C{r}") + 1] == "n0"
        at = lines.index(f"J{r} 2")
        for line in lines[at + 1 : at + 3]:
            j, value = line.split()
            assert float(value) == pytest.approx(J[r, int(j)], rel=1e-15)
    assert f"J0 2\n{'0 0'}" in "\n".join((tmp_path / "a.nl").read_text().splitlines())


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
    expected = (hessian(problem, x, lam) - 0.5 * hessian(problem, x)).toarray()
    np.testing.assert_allclose(H, expected, atol=1e-12)
    assert thing.jacobian(x).size == thing.jacobianstructure()[0].size
    assert thing.objective(x) == problem.objective(x)


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
