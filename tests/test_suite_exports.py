"""What is exported is the same problem: expressions, `.nl` files and other solvers' clothes."""

import hashlib
import json
import sys
from functools import cache
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest
from helpers import a_quarter

from actionopt import suite
from actionopt.suite import mof, nl, nl_lines, optiprofiler, standalone
from actionopt.suite.dump import archive, dump
from actionopt.suite.expression import nlp
from actionopt.suite.families import Family
from actionopt.suite.interfaces import (
    Ipopt,
    actionopt_load,
    actionopt_select,
    cyipopt_arguments,
    hessian,
    jacobian,
    nlopt_problem,
    scipy_arguments,
)
from actionopt.suite.limits import Bounds
from actionopt.suite.listing import first_multipliers
from actionopt.suite.optiprofiler import arguments

HARD = {"near collision", "coordinate singularity"}  # nothing is near their paths on few elements
LATER = HARD | {"badly scaled units"}  # and these are others in other numbers
NAMES = [
    name
    for name, family in suite.FAMILIES.items()
    if name != "chain_long" and not LATER & set(family.tags)
]
OTHERS = [
    pytest.param(name, marks=pytest.mark.slow)
    for name in suite.FAMILIES
    if name not in [*NAMES, "chain_long"]
]
FEW = "pendulum rod_pendulum rod_pendulum_scaled kepler heavy_top turning_wire moving_pivot".split()
SOME = [  # all operations, a constraint that is linear and one that is not, units
    pytest.param(name, marks=() if name in FEW else pytest.mark.slow)
    for name in suite.FAMILIES
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


@pytest.mark.quick(
    "oscillator_2d",
    "two_on_a_line",
    "rotating_frame_bound",
    "oscillator_past",
    "oscillator_gauge_past",
    "charge_spatial_past",
    "charge_strong",
    "wall_both_sides",
)
@pytest.mark.parametrize("name", [*a_quarter(NAMES, 1), *OTHERS])
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


@pytest.mark.quick("driven_oscillator", "rod_pendulum_redundant", "string_grazing", "wall_straight")
@pytest.mark.parametrize("name", [*a_quarter(NAMES), *OTHERS])
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
    for module in (nl, nl_lines):
        monkeypatch.setattr(module, "number", lambda value: f"{value:.13g}")
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


# -- MathOptFormat ---------------------------------------------------------------------------

MOF = {
    "+": lambda *a: sum(a[1:], a[0]),
    "-": lambda *a: a[0] - a[1] if a[1:] else -a[0],
    "*": lambda a, b: a * b,
    "/": lambda a, b: a / b,
    "^": lambda a, b: a**b,
}


def read_mof(file):
    """Return the expressions of a file, bounds and starting points: only what the schema has."""
    model = json.loads(file.read_text())
    assert model["version"] == {"major": 1, "minor": 2}
    x = {v["name"]: ca.SX.sym(v["name"]) for v in model["variables"]}
    assert len(x) == len(model["variables"])

    def term(node, before):
        if node["type"] in ("real", "variable"):
            return node["value"] if node["type"] == "real" else x[node["name"]]
        if node["type"] == "node":
            return before[node["index"] - 1]
        call = MOF.get(node["type"]) or getattr(ca, {"abs": "fabs"}.get(node["type"], node["type"]))
        return call(*(term(arg, before) for arg in node["args"]))

    def function(given):
        if given["type"] == "ScalarAffineFunction":
            terms = (t["coefficient"] * x[t["variable"]] for t in given["terms"])
            return given["constant"] + sum(terms)
        before = []
        for node in given["node_list"]:
            before.append(term(node, before))
        return term(given["root"], before)

    rows = [c for c in model["constraints"] if c["function"]["type"] != "Variable"]
    sides = [c for c in model["constraints"] if c["function"]["type"] == "Variable"]
    back = {
        "x": ca.vertcat(*x.values()),
        "f": function(model["objective"]["function"]),
        "g": ca.vertcat(*(function(c["function"]) for c in rows)),
    }
    return model, back, rows, sides


@pytest.mark.quick(
    "pendulum", "rod_pendulum", "moving_pivot", "turning_wire", "rod_pendulum_scaled"
)
@pytest.mark.parametrize("name", SOME)
def test_files_for_jump_read_back(name, tmp_path):
    problem = few(name)
    model, back, rows, sides = read_mof(mof.write(problem, tmp_path / "a.mof.json"))
    assert model["objective"]["sense"] == "min"
    assert bool(sides) == bool(problem.limits.coordinates)
    assert [v["name"] for v in model["variables"]] == problem.variable_names
    assert [v["primal_start"] for v in model["variables"]] == problem.start().tolist()
    assert [c["name"] for c in rows] == problem.constraint_names
    if problem.m:
        found = [
            [c["set"].get(side, c["set"].get("value", free)) for c in rows]
            for side, free in (("lower", -np.inf), ("upper", np.inf))
        ]
        asked = problem.constraint_bounds
        # Where all is linear constants are in the bounds.
        side = np.where(np.isfinite(asked[0]), 0, 1), np.arange(problem.m)
        shift = np.array(asked)[side] - np.array(found)[side]
        np.testing.assert_allclose(np.array(found) + shift, asked, atol=1e-14)
        back["g"] = back["g"] + ca.DM(shift)
        lam = -np.array([c["dual_start"] for c in rows if "dual_start" in c])
        np.testing.assert_array_equal(lam, first_multipliers(problem, problem.start()))
    f, c, gradient, J, H = off(problem, back, *somewhere(problem))
    assert max(f, c, gradient, J, H) <= SUMMED


def test_bounds_of_files_for_jump(tmp_path):
    both = Bounds(coordinates=[(-1.0, np.inf), (-2.0, 2.0)], constraints=[(-np.inf, 0.5)])
    problem = suite.TestProblem(Family("both", "rod_pendulum", 1, 2, limits=both))
    _, _, rows, sides = read_mof(mof.write(problem, tmp_path / "a.mof.json"))
    assert [side["set"] for side in sides] == [
        {"type": "GreaterThan", "lower": -1.0},
        {"type": "Interval", "lower": -2.0, "upper": 2.0},
    ]
    assert rows[0]["set"] == {"type": "LessThan", "upper": problem.constraint_bounds[1][0]}
    assert "dual_start" not in rows[0]  # which of them hold is not known
    linear = suite.get("polar_pendulum", elements=2)  # whose rows have constants
    _, _, rows, _ = read_mof(mof.write(linear, tmp_path / "linear.mof.json"))
    assert {row["set"]["type"] for row in rows} == {"EqualTo"}


# -- a file that needs numpy alone -----------------------------------------------------------


@pytest.mark.parametrize("name", SOME)
def test_files_of_python_are_the_same_problem(name, tmp_path):
    problem = suite.get(name) if name in ("pendulum", "rod_pendulum") else few(name)
    with pytest.MonkeyPatch.context() as patch:
        if name not in ("pendulum", "rod_pendulum"):  # on two elements nothing is near the path
            for known in ("x_star", "lam_star"):
                size = problem.n if known == "x_star" else problem.m
                patch.setattr(suite.TestProblem, known, np.zeros(size))
            for known in ("f_star", "index_star", "kind", "unbounded"):
                patch.setattr(suite.TestProblem, known, 0.0)
        text = standalone.text(problem)
    imports = [line for line in text.splitlines() if line.startswith(("import", "from"))]
    assert imports == ["import numpy as np"]
    made = {}
    exec(compile(text, name, "exec"), made)
    x, lam = somewhere(problem)
    u = problem.unit
    H, theirs = hessian(problem, x, lam).toarray(), made["hessian"](x, lam)
    term = np.max(np.abs(H * np.outer(u, u)))
    assert np.max(np.abs((theirs - H) * np.outer(u, u))) <= SUMMED * term
    assert np.max(np.abs((made["gradient"](x) - problem.gradient(x)) * u)) <= SUMMED * term
    action = max(abs(problem.objective(x)), problem.transcription.action_unit)
    assert abs(made["objective"](x) - problem.objective(x)) <= ROUNDOFF * action
    np.testing.assert_array_equal(made["X0"], problem.start())
    if problem.m:
        J = jacobian(problem, x).toarray()
        np.testing.assert_allclose(made["jacobian"](x), J, atol=EXACT * np.max(np.abs(J)))
        size = SUMMED * np.max(np.abs(J * u)) * max(1.0, np.max(np.abs(x / u)))
        np.testing.assert_allclose(made["constraints"](x), problem.constraints(x), atol=size)
    if name == "rod_pendulum":
        np.testing.assert_array_equal(made["X_STAR"], problem.x_star)
        np.testing.assert_array_equal(made["LAM_STAR"], problem.lam_star)
        residual = made["gradient"](made["X_STAR"]) + (
            made["jacobian"](made["X_STAR"]).T @ made["LAM_STAR"]
        )
        assert np.max(np.abs(residual)) <= 1e-13 * np.max(np.abs(made["gradient"](made["X0"])))
        assert made["F_STAR"] == problem.f_star and made["INDEX"] == 0
        assert "grad f + J' lam = 0" in text


# -- OptiProfiler ----------------------------------------------------------------------------


def test_the_library_for_optiprofiler(monkeypatch):
    module = SimpleNamespace(Problem=lambda **given: SimpleNamespace(**given))
    monkeypatch.setitem(sys.modules, "optiprofiler", SimpleNamespace(opclasses=module))
    monkeypatch.setitem(sys.modules, "optiprofiler.opclasses", module)
    p = actionopt_load("kepler(eccentricity=0.5, elements=4)")
    mine = suite.get("kepler", elements=4, eccentricity=0.5)
    assert p.name == "kepler(eccentricity=0.5, elements=4)"
    np.testing.assert_array_equal(p.x0, mine.start())
    assert p.fun(p.x0) == mine.objective(p.x0)
    bent, straight = actionopt_load("rod_pendulum"), actionopt_load("turning_wire")
    x, lam = somewhere(suite.get("rod_pendulum"))
    assert bent.ceq(x).shape == lam.shape and bent.jceq(x).shape == (lam.size, x.size)
    assert len(bent.hceq(x)) == lam.size and not hasattr(bent, "cub")
    x = suite.get("turning_wire").start()
    c = suite.get("turning_wire").constraints(x)
    np.testing.assert_allclose(straight.aeq @ x - straight.beq, c, atol=1e-14)
    assert straight.aub.shape == (0, x.size)
    sides = Bounds(constraints=[(-1.0, 2.0)])
    both = suite.TestProblem(Family("both", "rod_pendulum", 2, limits=sides))
    given = arguments(both)
    x = both.start()
    low, high = both.constraint_bounds
    c = both.constraints(x)
    np.testing.assert_allclose(given["cub"](x), np.concatenate([low - c, c - high]))
    J = jacobian(both, x).toarray()
    np.testing.assert_array_equal(given["jcub"](x), np.vstack([-J, J]))
    H = [h.toarray() for h in (hessian(both, x, e, 0.0) for e in np.eye(both.m))]
    np.testing.assert_array_equal(given["hcub"](x), [-h for h in H] + H)


@pytest.mark.slow
def test_problems_selected_for_optiprofiler():
    assert "pendulum" in actionopt_select({"ptype": "u", "maxdim": 50})
    assert set(actionopt_select({"ptype": "l"})) == {
        name for name in suite.FAMILIES if suite.get(name).classification[1] == "L"
    }
    assert "rod_pendulum" in actionopt_select({"minnlcon": 1, "maxcon": 40})
    assert actionopt_select({"minb": 1}) == ["string_floor_bounds"]
    assert "chain" not in actionopt_select({"excludelist": ["chain"]})


# -- a folder of them ------------------------------------------------------------------------


@pytest.mark.long
def test_a_dump_can_be_checked_against_its_manifest(tmp_path):
    chosen = [suite.get(name) for name in ("oscillator", "kepler_two_ways")]
    manifest = dump(chosen, tmp_path / "all")
    entries = json.loads(manifest.read_text())
    assert [entry["name"] for entry in entries] == ["kepler_two_ways", "oscillator"]
    for entry, problem in zip(entries, reversed(chosen), strict=True):
        for file, digest in entry["files"].items():
            assert hashlib.sha256((tmp_path / "all" / file).read_bytes()).hexdigest() == digest
        known = json.loads((tmp_path / "all" / f"{problem.name}.json").read_text())
        np.testing.assert_array_equal(known["x_star"], problem.x_star)
        assert known["f_star"] == problem.f_star
        assert known["f_lowest_known"] == min(
            problem.f_star, *(o.f for o in problem.others), np.inf
        )
        assert known["sign_of_multipliers"].startswith("grad f + J' lam = 0")
        for told, other in zip(known["other_stationary_points"], problem.others, strict=True):
            np.testing.assert_array_equal(told["x"], other.x)
            assert (told["f"], told["index"], told["kind"]) == (other.f, other.index, other.kind)


def test_a_folder_takes_more_sizes_and_packs_to_the_same_bytes(tmp_path):
    folder = tmp_path / "all"
    dump([suite.get("oscillator"), suite.get("kepler")], folder)
    before = {f.name: f.read_bytes() for f in folder.iterdir()}
    again = [
        suite.get("oscillator", elements=4),
        suite.get("kepler", eccentricity=0.5),
        suite.get("oscillator", decades=2),
        suite.get("oscillator"),
    ]
    manifest = dump(again, folder)
    entries = json.loads(manifest.read_text())
    stems = ["kepler", "kepler-eccentricity=0.5", "oscillator", "oscillator-4x4"]
    assert [entry["file"] for entry in entries] == [*stems, "oscillator-decades=2"]
    for name, content in before.items():
        if name not in ("manifest.json", "known_optima.csv"):
            assert (folder / name).read_bytes() == content, name
    table = [line.split(",") for line in (folder / "known_optima.csv").read_text().splitlines()]
    assert len(table) == 6 and table[0][:2] == ["file", "name"]
    column = table[0].index("f_star") - len(table[0])  # names of parameters hold no comma here
    assert [float(row[column]) for row in table[1:]] == [entry["f_star"] for entry in entries]
    first = archive(folder, tmp_path / "a.zip").read_bytes()
    (folder / "kepler.nl").touch()
    assert archive(folder, tmp_path / "b.zip").read_bytes() == first
    with pytest.raises(ValueError, match="near the path"):
        dump([suite.get("oscillator_stiff", 20, 5)], folder)
    told = []
    dump([suite.get("oscillator_stiff", 20, 5)], folder, skipped=lambda p, e: told.append(p.name))
    assert told == ["oscillator_stiff"]
    assert len(json.loads(manifest.read_text())) == 5


def test_the_header_counts_the_defined_variables():
    problem = suite.get("rod_pendulum", elements=2)
    text = "".join(nl.lines(problem, problem.start())).splitlines()
    defined = sum(line.startswith("V") for line in text)
    assert sum(int(x) for x in text[9].split("#")[0].split()) == defined > 0


def test_whole_numbers_in_a_row_are_written_in_short():
    assert standalone._span(np.arange(3, 7)) == "np.arange(3, 7)"
    assert standalone._span(np.array([3, 5, 6])) == "np.array([3, 5, 6])"


class Nlopt:
    """What NLopt's optimizer is told."""

    LD_SLSQP, opt = 7, None

    def __init__(self, code, n):
        self.code, self.n, self.rows = code, n, []

    def set_min_objective(self, f):
        self.objective = f

    def set_lower_bounds(self, x):
        self.lower = x

    def set_upper_bounds(self, x):
        self.upper = x

    def add_equality_mconstraint(self, c, tol):
        self.rows.append((0, c, tol.size))

    def add_inequality_mconstraint(self, c, tol):
        if self.code != self.LD_SLSQP:
            raise RuntimeError("no constraints")
        self.rows.append((1, c, tol.size))


def test_what_nlopt_and_cyipopt_are_given(monkeypatch):
    """Rows as NLopt has them: equations c = 0, and c <= 0 for both kinds of bounds."""
    module = SimpleNamespace(opt=Nlopt, LD_SLSQP=Nlopt.LD_SLSQP, LD_LBFGS=8, version="2")
    monkeypatch.setitem(sys.modules, "nlopt", module)
    problem = suite.get("rod_pendulum", elements=2)
    made, x, slope = nlopt_problem(problem, "LD_SLSQP"), problem.start(), np.zeros(problem.n)
    assert (made.n, made.objective(x, slope)) == (problem.n, problem.objective(x))
    np.testing.assert_array_equal(slope, problem.gradient(x))
    ((kind, row, size),) = made.rows
    value, slopes = np.zeros(size), np.zeros((size, problem.n))
    row(value, x, slopes)
    assert (kind, size) == (0, problem.m)
    np.testing.assert_array_equal(value, -problem.constraints(x))
    np.testing.assert_array_equal(slopes, -jacobian(problem, x).toarray())
    given = cyipopt_arguments(problem)
    assert (given["n"], given["m"]) == (problem.n, problem.m)
    bounds = [*problem.bounds, *problem.constraint_bounds]
    np.testing.assert_equal([given[name] for name in ("lb", "ub", "cl", "cu")], bounds)
    with pytest.raises(ValueError, match="found 'LD_NONE'"):
        nlopt_problem(problem, "LD_NONE")
    discs = suite.get("disc", elements=4)
    made = nlopt_problem(discs, "LD_SLSQP")
    x = discs.start()
    for kind, row, size in made.rows:
        value = np.zeros(size)
        row(value, x, np.zeros(0))
        assert kind == 1
        np.testing.assert_allclose(value, discs.constraint_bounds[0] - discs.constraints(x))
    with pytest.raises(ValueError, match="with constraints, found LD_LBFGS"):
        nlopt_problem(discs, "LD_LBFGS")


def test_few_problems_are_selected_for_optiprofiler(monkeypatch):
    names = ("pendulum", "rod_pendulum", "string_floor_bounds")
    monkeypatch.setattr(suite, "FAMILIES", {name: suite.FAMILIES[name] for name in names})
    n, rows = suite.get("pendulum").n, suite.get("rod_pendulum").m
    assert optiprofiler.actionopt_select({}) == list(names)
    assert optiprofiler.actionopt_select({"ptype": "u"}) == ["pendulum"]
    assert optiprofiler.actionopt_select({"minb": 1}) == ["string_floor_bounds"]
    assert optiprofiler.actionopt_select({"minnlcon": 1, "maxcon": rows}) == ["rod_pendulum"]
    assert optiprofiler.actionopt_select({"mincon": rows + 1}) == []
    assert "pendulum" not in optiprofiler.actionopt_select({"excludelist": ["pendulum"]})
    assert "pendulum" in optiprofiler.actionopt_select({"maxdim": n})
    assert "pendulum" not in optiprofiler.actionopt_select({"maxdim": n - 1})
    sides = SimpleNamespace(constraint_bounds=np.array([[0, 0, -np.inf, 1], [0, 2, 3, np.inf]]))
    assert optiprofiler._rows(sides) == 5  # an equation, four sides
