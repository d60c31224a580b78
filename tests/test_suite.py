"""Test problems: derivatives against differences, stars against mpmath and dense algebra."""

import dataclasses
import json
import sys
import tracemalloc
from collections import Counter
from types import SimpleNamespace

import mpmath
import numpy as np
import pytest
from helpers import a_quarter, at_once

from actionopt import Mesh, scenes, suite
from actionopt.suite import known, solvers, stars
from actionopt.suite.families import redundant
from actionopt.suite.interfaces import hessian, jacobian
from actionopt.suite.learn import RANDOM_AMPLITUDES, learn, near_paths, random_starts
from actionopt.suite.stars import STATIONARY

NAMES = tuple(suite.FAMILIES)
HELD = {name for name in NAMES if "unilateral contact" in suite.FAMILIES[name].tags}
STEP = 1e-3  # of the sixth-order differences: truncation 1e-18 of the seventh derivative
DIFFERENCE = 1e-7  # what they leave where potentials are steep, relative
ROUND_OFF = 1e-9  # in units of the coordinates: the worst conditioned member leaves 5e-11
EPS = np.finfo(float).eps
DENSE = 700  # unknowns and rows above which dense algebra takes seconds

HARD = {
    "unbounded below",
    "saddle only",
    "conjugate end",
    "redundant constraints",
    "coordinate singularity",
    "several optima",
    "badly scaled units",
    "stiff potential",
    "thin layer",
    "near collision",
}


def point(problem, size=1e-3):
    """Return a point near the optimum, a random direction and random multipliers, in its units."""
    random = np.random.default_rng(7)
    x = problem.x_star + size * random.uniform(-1, 1, problem.n) * problem.unit
    direction = random.uniform(-1, 1, problem.n) * problem.unit
    return x, direction, random.uniform(-1, 1, problem.m)


def sixth_order(function, x, direction, step):
    """Return the derivative of a function along a direction, by central differences."""
    weights = {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}
    return (
        sum(
            w * (function(x + k * step * direction) - function(x - k * step * direction))
            for k, w in weights.items()
        )
        / step
    )


def dense(problem, lam, x):
    return hessian(problem, x, lam).toarray(), jacobian(problem, x).toarray()


def least(problem, x):
    """Return the multipliers that fit best."""
    if not problem.m:
        return None
    J = dense(problem, None, x)[1]
    return np.linalg.lstsq((J * problem.unit).T, -problem.gradient(x) * problem.unit, rcond=None)[0]


def test_there_are_forty_families_and_every_kind_of_trouble():
    assert len(NAMES) >= 40
    assert {tag for family in suite.FAMILIES.values() for tag in family.tags} >= HARD
    assert sum(set(family.tags) <= {"several optima"} for family in suite.FAMILIES.values()) >= 25


@pytest.mark.long
@pytest.mark.parametrize("name", ["hoop_bead", "rod_pendulum"])
def test_units_of_many_sizes_change_the_numbers_and_not_the_optimum(name):
    easy, hard = suite.get(name), suite.get(name, decades=8)
    ratio = hard.x_star / easy.x_star
    np.testing.assert_allclose(ratio[1:] / ratio[:-1], 10 ** (8 / (easy.n - 1)))
    assert ratio[-1] / ratio[0] == pytest.approx(1e8)
    x = easy.start("perturbed")
    assert hard.objective(x * ratio) == pytest.approx(easy.objective(x), rel=1e-12)
    slope = easy.gradient(x)
    np.testing.assert_allclose(
        hard.gradient(x * ratio) * ratio, slope, atol=1e-12 * np.max(np.abs(slope))
    )
    np.testing.assert_allclose(hard.start("coarse"), easy.start("coarse") * ratio)
    assert (hard.f_star, hard.index_star) == (easy.f_star, easy.index_star)
    np.testing.assert_array_equal(hard.lam_star, easy.lam_star)
    assert hard.distance(hard.start("near")) <= 1.001e-3


@pytest.mark.quick(
    "inverted_cone",
    "rotating_frame_free",
    "rod_pendulum_scaled",
    "wall_past",
    "two_on_a_line_past",
    "oscillator_nearly_conjugate",
    "kepler_planet",
    "polar_pendulum_redundant",
)
@pytest.mark.parametrize("name", a_quarter(NAMES, 2))
def test_derivatives_agree_with_differences(name):
    problem = suite.get(name)
    x, d, lam = point(problem, 1e-4 if "near collision" in problem.tags else 1e-2)
    step = STEP * (0.01 if {"near collision", "coordinate singularity"} & set(problem.tags) else 1)
    lam *= abs(problem.transcription.action_unit) / np.max(problem.unit) ** 2

    def close(found, expected):
        # Slopes that cancel are measured by the terms they are summed from.
        return np.max(np.abs(found - expected)) <= DIFFERENCE * np.max(np.abs(expected))

    terms = np.abs(problem.gradient(x) * d)
    slope = sixth_order(problem.objective, x, d, step)
    assert abs(slope - problem.gradient(x) @ d) <= DIFFERENCE * np.sum(terms)
    rows, cols = problem.jacobian_structure

    def pulled(y):
        values = problem.jacobian(y) * lam[rows] if problem.m else np.zeros(0)
        return problem.gradient(y) + np.bincount(cols, values, problem.n)

    bent = sixth_order(pulled, x, d, step) * problem.unit
    assert close(problem.hessian_product(x, lam, d) * problem.unit, bent)
    H, J = dense(problem, lam, x)
    assert close(H @ d * problem.unit, bent)
    half, _ = dense(problem, lam, x)
    if problem.m:
        assert close(J @ d, sixth_order(problem.constraints, x, d, step))
        bare = problem.hessian(x)
        np.testing.assert_allclose(
            problem.hessian(x, lam, 0.5),
            problem.hessian(x, lam) - 0.5 * bare,
            atol=1e-14 * np.max(np.abs(half)),
        )


@pytest.mark.parametrize("bad", [0.0, np.nan])
def test_multipliers_are_left_alone_where_the_gradient_is_not_known(bad, monkeypatch):
    problem = suite.get("rod_pendulum", 2, 2)
    tr, x = problem.transcription, problem.transcription.pack(problem.transcription.straight())
    x = x[: tr.layout.unknowns] + 0.1
    gradient = tr.gradient(x)
    monkeypatch.setattr(tr, "gradient", lambda x: gradient + bad)
    assert stars.least_multipliers(tr, x).any() == (bad == 0)


@pytest.mark.quick(
    "oscillator",
    "driven_oscillator",
    "sliding_wedge",
    "turning_wire_radial",
    "oscillator_past",
    "oscillator_gauge_past",
    "charge_spatial_past",
    "pendulum_over_the_top",
)
@pytest.mark.parametrize("name", a_quarter(name for name in NAMES if name not in HELD))
def test_stars_satisfy_the_conditions_of_kuhn_and_tucker(name):
    problem = suite.get(name)
    x, lam = problem.x_star, problem.lam_star
    rows, cols = problem.jacobian_structure
    values = problem.jacobian(x) * lam[rows] if problem.m else np.zeros(0)
    gradient = problem.gradient(x)
    H = np.abs(problem.hessian(x, lam)) * np.abs(x)[problem.hessian_structure[1]]
    size = np.max(np.bincount(problem.hessian_structure[0], H, problem.n) * problem.unit)
    slope = (gradient + np.bincount(cols, values, problem.n)) * problem.unit
    assert np.max(np.abs(slope)) <= STATIONARY * size
    assert problem.residual(x) <= ROUND_OFF
    if problem.m:
        weight = problem.transcription.row_unit
        assert np.max(np.abs(problem.constraints(x) / weight)) <= STATIONARY
    astray = x + 1e-6 * problem.unit * np.cos(np.arange(problem.n))
    assert problem.residual(astray) > 1e-7  # the oracle can fail


SIZES = {name: (p := suite.get(name)).n + p.m for name in NAMES}
LARGE = [name for name, size in SIZES.items() if DENSE < size <= 2200]


@pytest.mark.quick(
    "oscillator_2d",
    "hoop_bead",
    "rotating_frame_bound",
    "pendulum_scaled",
    "oscillator_2d_past",
    "driven_oscillator_past",
    "oscillator_conjugate",
    "oscillator_atomic",
)
@pytest.mark.parametrize(
    "name",
    [
        *a_quarter((name for name, size in SIZES.items() if size <= DENSE), 1),
        *(pytest.param(name, marks=pytest.mark.slow) for name in LARGE),
    ],
)
def test_index_is_the_dense_inertia(name):
    problem = suite.get(name)
    if problem.index_star is None:
        pytest.skip("degenerate")
    unit = problem.unit
    H, J = dense(problem, problem.lam_star, problem.x_star)
    H *= np.outer(unit, unit)
    if problem.m:
        _, sizes, V = np.linalg.svd(J * unit)
        tangent = V[np.sum(sizes > 1e-10 * sizes[0]) :].T
        H = tangent.T @ H @ tangent
    assert np.sum(np.linalg.eigvalsh(H) < 0) == problem.index_star
    if "morse_index" in problem.scene.facts:
        assert problem.index_star == problem.scene.facts["morse_index"]


def test_as_many_digits_of_a_path_are_claimed_as_it_is_known_to():
    found = stars.continuous(scenes.get("double_pendulum"))
    assert found.how == "high precision"
    assert 0.1 < found.path.error * 10.0**found.digits <= 1


def test_the_discrete_optimum_of_the_oscillator_to_thirty_digits():
    # Two elements of degree two are Simpson's rule with velocities of parabolas.
    problem = suite.get("oscillator", elements=2, degree=2, m=2.0, k=2.0, start=1.0, end=-0.4)
    with mpmath.workdps(30):
        h, weights = mpmath.mpf("1.25"), [mpmath.mpf(w) / 3 for w in (1, 4, 1)]
        D = mpmath.matrix([[-1.5, 2, -0.5], [-0.5, 0, 0.5], [0.5, -2, 1.5]])
        K = mpmath.zeros(5)
        for first in (0, 2):
            for k in range(3):
                for i in range(3):
                    for j in range(3):
                        K[first + i, first + j] += weights[k] * 2 * D[k, i] * D[k, j] * 2 / h
                K[first + k, first + k] -= weights[k] * 2 * h / 2
        inner, ends = K[1:4, 1:4], mpmath.matrix([1, mpmath.mpf("-0.4")])
        pull = mpmath.matrix([[K[i, 0], K[i, 4]] for i in (1, 2, 3)]) * ends
        q = mpmath.lu_solve(inner, -pull)
        whole = mpmath.matrix([1, *q, mpmath.mpf("-0.4")])
        action = (whole.T * K * whole)[0] / 2
        np.testing.assert_allclose(problem.x_star, [float(v) for v in q], rtol=1e-14)
    assert problem.f_star == pytest.approx(float(action), rel=1e-14)
    assert problem.continuous.action != pytest.approx(problem.f_star, rel=1e-4)


def test_the_discrete_optimum_tends_to_the_path_at_twice_the_degree():
    gaps = []
    for elements in (4, 8, 16):
        problem = suite.get("pendulum", elements=elements, degree=2)
        gaps.append(abs(problem.f_star - problem.continuous.action))
    orders = np.log2(np.array(gaps[:-1]) / gaps[1:])
    assert np.all(np.abs(orders - 4) < 0.3)


@pytest.mark.long
def test_how_each_answer_is_known():
    assert suite.get("figure_eight").continuous.how == "literature"
    assert suite.get("double_pendulum").continuous.how == "high precision"
    problem = suite.get("rod_pendulum")
    assert problem.continuous.how == "closed form"
    # The multipliers are the rod's tension over 2 l, to the order of the mesh.
    t = problem.mesh.nodes[1:-1]
    q, v = problem.scene.exact(t), problem.scene.facts["velocity"](t)
    tension = problem.scene.facts["multipliers"](q, v, t)[0]
    np.testing.assert_allclose(problem.lam_star, tension, atol=1e-3 * np.max(np.abs(tension)))
    answers = {"x_star", "f_star", "lam_star", "index_star", "f_lowest", "continuous"}
    assert set(problem.known_by) == answers
    searched = "the least of 16 stationary points, from bent lines, solvers and 60 random starts"
    assert suite.get("chain").known_by["f_lowest"] == f"{searched} of Ipopt"
    assert "f is convex" in suite.get("string_floor_bounds").known_by["f_lowest"]
    assert suite.get("oscillator_past").known_by["f_lowest"].endswith("unbounded below")


def test_convex_with_bounds_is_convex():
    assert suite.get("string_floor_bounds").convex and suite.get("string_floor").convex


@pytest.mark.long
def test_degenerate_members_say_so():
    assert len(suite.find(tags="LICQ fails")) == 4 and len(suite.find(tags="MFCQ fails")) == 3
    for name in suite.find(tags="LICQ fails"):
        problem = suite.get(name)
        lower, upper = problem.constraint_bounds
        c = problem.constraints(problem.x_star) / problem.transcription.row_unit
        J = dense(problem, None, problem.x_star)[1][(lower == upper) | (c <= 1e-9)]
        assert np.linalg.matrix_rank(J * problem.unit) < len(J)


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_several_optima_are_tagged(name):
    problem = suite.get(name)
    minima = [s for s in (problem.optimum, *problem.others) if s.kind == "minimum"]
    assert (len(minima) > 1) == ("several optima" in problem.tags)


@pytest.mark.long
def test_the_lower_minimum_of_the_figure_of_eight_is_known():
    problem = suite.get("figure_eight")
    assert problem.lowest == pytest.approx(7.67938, abs=1e-5) and problem.lowest < problem.f_star


@pytest.mark.slow
def test_random_starts_of_the_long_chain_lead_lower_than_others():
    problem = suite.get("chain_long")
    assert problem.lowest == pytest.approx(291.48017, abs=1e-5)
    lowest = min(problem.others, key=lambda s: s.f)
    assert problem.residual(lowest.x) < ROUND_OFF and problem.violation(lowest.x) < ROUND_OFF
    assert problem.known_by["f_lowest"].endswith("and 60 random starts of Ipopt")


@pytest.mark.slow
@pytest.mark.parametrize("name", [n for n, family in suite.FAMILIES.items() if family.why])
def test_what_is_said_to_be_hard_for_ipopt_is(name):
    problem = suite.get(name)
    answer = solvers.run("ipopt", problem, problem.start())
    right = problem.residual(answer.x) < 1e-4 and answer.said == "solved"
    assert not right or answer.evaluations["hess"] > 50, answer.word


def test_ten_families_are_hard_for_ipopt_and_say_why():
    assert sum(bool(family.why) for family in suite.FAMILIES.values()) >= 10


def test_copies_of_a_constraint_leave_the_optimum_alone():
    plain, twice = suite.get("rod_pendulum"), suite.get("rod_pendulum_redundant")
    np.testing.assert_array_equal(plain.x_star, twice.x_star)
    assert twice.m == 2 * plain.m
    assert np.linalg.matrix_rank(dense(twice, None, twice.x_star)[1]) == plain.m
    assert redundant(plain.scene).problem.system is twice.scene.problem.system


def test_at_the_conjugate_end_the_optimum_is_one_of_many():
    problem = suite.get("oscillator_conjugate")
    x = problem.x_star + 3.0 * problem.flat[:, 0] * problem.unit
    assert problem.residual(x) < 1e-13
    assert problem.distance(x) < 1e-14
    assert problem.objective(x) == pytest.approx(problem.f_star, abs=1e-12)
    assert problem.index_star is None
    assert problem.kind == "degenerate"


@pytest.mark.slow
def test_several_optima_are_all_stationary():
    for name in suite.find(tags="several optima", size=(1, DENSE)):
        problem = suite.get(name)
        assert problem.others, name
        for other in problem.others:
            assert problem.distance(other.x) > 1e-2
            assert problem.objective(other.x) == pytest.approx(other.f, rel=1e-14)
            H, J = dense(problem, least(problem, other.x), other.x)
            tangent = np.eye(problem.n)
            if problem.m:
                tangent = np.linalg.svd(J * problem.unit)[2][problem.m :].T
            curvature = tangent.T @ (H * np.outer(problem.unit, problem.unit)) @ tangent
            values = np.linalg.eigvalsh(curvature)
            assert np.sum(values < 0) == other.index
            steep = np.max(np.abs(values), initial=0.0)
            flat = np.min(np.abs(values), initial=np.inf)
            # Round-off of a gradient by the flattest direction: two of moving_pivot_turns are so.
            assert problem.residual(other.x) <= max(ROUND_OFF, EPS * steep / flat)
            assert other.kind == ("saddle" if other.index else "minimum")


def test_the_index_is_told_on_the_mesh_of_the_family_or_a_finer_one():
    own = suite.FAMILIES["pendulum"].elements
    meshes = [suite.get("pendulum", n)._finer for n in (own // 2, own, 2 * own)]
    assert [None if p is None else p.mesh.elements for p in meshes] == [own, None, None]
    assert suite.get("pendulum", own, duration=1.0)._finer.mesh.elements == 2 * own


@pytest.mark.long
def test_find_by_what_is_asked():
    assert "oscillator" in suite.find(kind="minimum", constrained=False, convex=True)
    assert suite.find(index=3, size=(1, 100)) == ["oscillator_past"]
    assert set(suite.find(tags=("unbounded below", "stiff potential"))) == {
        "oscillator_stiff",
        "charge_strong",
    }
    for name in suite.find(constrained=True, size=(100, 1000)):
        assert suite.get(name).m and 100 <= suite.get(name).n <= 1000
    assert suite.find(kind="degenerate", size=(1, 100)) == ["oscillator_conjugate"]
    with pytest.raises(ValueError, match="the tags are"):
        suite.find(tags="easy")
    with pytest.raises(ValueError, match=r"size=\(least, most\)"):
        suite.find(size=())
    with pytest.raises(ValueError, match="kind of minimum"):
        suite.find(kind="sadle")
    with pytest.raises(ValueError, match="did you mean 'pendulum'"):
        suite.get("pendulun")
    with pytest.raises(ValueError, match="no parameter"):
        suite.get("pendulum", mass=1.0)


def test_of_what_is_not_in_the_table_nothing_is_known():
    program = SimpleNamespace(mesh=Mesh.uniform(0.0, 1.0, 3, 4))
    assert known.starts("nothing", program) == known.paths("nothing", program) == 0


def test_sizes_are_asked_of_what_has_the_tags():
    tags, least = ("unbounded below", "stiff potential"), suite.get("charge_strong").n
    assert suite.get("oscillator_stiff").n > least
    assert suite.find(tags=tags, size=(1, least)) == ["charge_strong"]
    assert suite.find(tags=tags, size=(least + 1, 9999)) == ["oscillator_stiff"]


@pytest.mark.parametrize("count", [0, 1.5])
@pytest.mark.parametrize("name, what", [("chain_floor", "links"), ("pegs", "pegs")])
def test_counts_are_whole_and_positive(name, what, count):
    with pytest.raises(ValueError, match=f"a positive number of {what}"):
        suite.get(name, **{what: count})


def test_every_evaluation_is_counted():
    problem = suite.get("rod_pendulum")
    x, d, lam = point(problem)
    problem.counts.clear()
    problem.objective(x)
    problem.gradient(x)
    problem.constraints(x)
    problem.jacobian(x)
    problem.hessian(x, lam, 0.5)
    problem.hessian_product(x, lam, d)
    problem.hessian_product(x, lam, d)
    assert problem.counts == {"f": 1, "grad": 1, "c": 1, "jac": 1, "hess": 1, "hprod": 2}


def test_a_history_has_what_was_better_than_all_before():
    problem = suite.get("rod_pendulum")
    x, off = problem.x_star, problem.start() - problem.x_star
    visited = [x + s * off for s in (1.0, 2.0, 0.5, 0.49, 0.7, np.nan, 0.0, 0.0)]
    f = [problem.objective(y) for y in visited]
    violation = [problem.violation(y) for y in visited]
    history = problem.history(visited)
    kept = [k - 1 for k, _, _ in history]
    assert kept[0] == 0 and {5, 7}.isdisjoint(kept) and 6 in kept  # no number; no better
    assert 3 not in kept  # a fiftieth better than the one before
    for k, there, v in history:
        assert there == pytest.approx(f[k - 1], rel=1e-14)
        assert v == pytest.approx(violation[k - 1], rel=1e-2, abs=1e-15)
        before = [j for j in range(k - 1) if np.isfinite(f[j])]
        assert all(f[j] > there or violation[j] > v for j in before)
    assert problem.history([]) == []


def test_starting_points_are_what_they_say():
    problem = suite.get("pendulum")
    ends = problem.scene.problem.start.q[0], problem.scene.problem.end.q[0]
    s = problem.mesh.nodes[1:-1] / problem.mesh.nodes[-1]
    np.testing.assert_allclose(problem.start("straight"), ends[0] + s * (ends[1] - ends[0]))
    np.testing.assert_array_equal(problem.start("perturbed"), problem.start("perturbed"))
    assert 0.05 < problem.distance(problem.start("perturbed"), problem.start()) <= 0.1
    assert 5e-4 < problem.distance(problem.start("near")) <= 1e-3
    straight, coarse = (problem.distance(problem.start(k)) for k in ("straight", "coarse"))
    assert coarse < straight / 2
    assert suite.get("chain").default_start == "guess"
    with pytest.raises(ValueError, match="expected a starting point"):
        problem.start("far")


@pytest.mark.long
def test_near_collisions_are_met_and_are_not_the_lowest():
    """From the default start, a Newton step in the wrong direction apart."""
    for name in ("kepler_near_collision", "two_body_near_collision"):
        problem = suite.get(name)
        assert problem.default_start == "coarse"
        assert problem.kind == "minimum" and problem.lowest < problem.f_star
        away = [problem.distance(problem.start(), s.x) for s in (problem.optimum, *problem.others)]
        assert away[0] == min(away)


def test_random_starts_are_other_starts_each_time_farther_off():
    problem = suite.get("pendulum")
    starts = list(random_starts(problem, 2 * len(RANDOM_AMPLITUDES)))
    off = [np.abs(x - problem.start()).max() / np.max(problem.unit) for x in starts]
    assert min(off) > 0 and max(off) < 4 * max(RANDOM_AMPLITUDES)
    assert len(set(off)) == len(off)
    np.testing.assert_array_equal(list(random_starts(problem, 2)), starts[:2])


def test_a_lower_minimum_is_kept_where_there_is_no_room_for_others(monkeypatch):
    problem = suite.get("hoop_bead")
    lower, tr = problem.others[0], problem.transcription
    # Paths are asked for at the nodes.
    paths = [lambda _, x=s.x: tr.coordinates(x / problem.unit).T for s in problem.others]
    monkeypatch.setattr("actionopt.suite.learn.solve_all", lambda _: paths)
    monkeypatch.setattr("actionopt.suite.learn.MOST_NUMBERS", 0)
    assert len(list(near_paths(problem))) == 1  # the optimum: both are known
    problem.others = ()
    found = [r["point"] * problem.unit for r in near_paths(problem)]
    assert min(problem.distance(x, lower.x) for x in found) < 1e-9
    problem.others = (lower,)
    assert len(list(near_paths(problem))) == 1  # the other side is no lower


@pytest.mark.slow
def test_points_that_solvers_came_to_are_learnt(tmp_path, monkeypatch):
    problem = suite.get("hoop_bead_fast")
    names = [s.kind for s in problem.others]
    point = (problem.others[-1].x / problem.unit).tolist()
    monkeypatch.setattr(known, "table", dict)
    family = dataclasses.replace(suite.FAMILIES["hoop_bead_fast"], bends=())
    monkeypatch.setitem(suite.FAMILIES, "hoop_bead_fast", family)
    monkeypatch.setattr(stars, "find", lambda *_: SimpleNamespace(converged=False))
    fewer = suite.get("hoop_bead_fast")
    assert len(fewer.others) < len(names)
    record = {"problem": fewer.name, "elements": 16, "degree": 8, "point": point}
    file = tmp_path / "known.json"
    astray = record | {"point": [0.3] * problem.n}
    assert learn([record, record, astray, {"problem": "pendulum"}], file) == 1
    monkeypatch.setattr(known, "table", lambda: json.loads(file.read_text()))
    again = suite.get("hoop_bead_fast").others
    assert len(again) == len(fewer.others) + 1
    assert again[-1].f == pytest.approx(problem.others[-1].f, rel=1e-12)
    assert suite.get("hoop_bead_fast", elements=20).x_star.size  # another mesh has none of them


@pytest.mark.parametrize(
    ("name", "mesh", "found"),
    [
        ("oscillator_stiff", (40, 5), "away on 40 elements"),
        ("oscillator_stiff", (20, 5), "away on 20 elements"),
        ("kepler", (1, 2), "away on 1 elements|leaves it on 1"),
        ("two_body_near_collision", (48, 6), "its index, 1, is 0 on 64 of degree 10"),
        ("two_body_near_collision", (60, 5), "its index, 1, is 0 on 64 of degree 10"),
    ],
)
def test_a_mesh_on_which_the_optimum_is_no_path_is_refused(name, mesh, found):
    problem = suite.get(name, *mesh)
    with pytest.raises(ValueError, match=f"near the path of .*{found}.*use more elements"):
        assert problem.x_star.size
    assert np.isfinite(problem.objective(problem.start("straight")))  # it is a problem still


def test_parameters_too_are_checked_on_a_finer_mesh():
    assert suite.get("oscillator", duration=5.0).index_star == 1
    with pytest.raises(ValueError, match=r"on 16 of degree 4|away|leaves"):
        assert suite.get("oscillator", duration=40.0).star


def test_class_and_sizes():
    problem = suite.get("rod_pendulum", elements=4, degree=3)
    assert problem.classification == "QQR2-MN-22-11"
    assert (problem.n, problem.m, problem.nnz_jacobian) == (22, 11, 22)
    assert problem.nnz_hessian == problem.hessian(problem.x_star, problem.lam_star).size
    assert np.all(np.isinf(problem.bounds[0]))


@pytest.mark.long
def test_size_costs_no_more_than_its_share():
    """Counted, not timed: calls of functions do not grow with the size, memory grows as it does."""

    def cost(elements):
        calls = Counter()
        tracemalloc.start()
        sys.setprofile(lambda frame, event, _: calls.update([event]))
        try:
            problem = suite.get("oscillator", elements=elements)
            x = problem.start()
            problem.gradient(x)
            problem.hessian(x)
        finally:
            sys.setprofile(None)
            _, peak = tracemalloc.get_traced_memory()
            tracemalloc.stop()
        return calls["call"] + calls["c_call"], peak

    cost(900)  # what is made once is at hand from here on
    small, large = cost(1_000), cost(8_000)  # no size twice: numberings are kept
    # Many times are evaluated by thousands; a collection of garbage may add some calls.
    assert large[0] <= 1.1 * small[0] + 0.02 * 5 * 7_000
    assert large[1] <= 8.5 * small[1]


@at_once(
    ("mesh", "message"),
    [
        ({"elements": 0}, "whole number of elements, at least 1, found 0"),
        ({"elements": -5}, "whole number of elements, at least 1, found -5"),
        ({"elements": 2.5}, "whole number of elements, at least 1, found 2.5"),
        ({"degree": 0}, "integer degrees from 1 to 64, found 0"),
        ({"degree": 65}, "integer degrees from 1 to 64, found 65"),
        ({"elements": 1, "degree": 1}, "nodes between the ends, found 1 element of degree 1"),
    ],
)
def test_meshes_that_are_none_are_refused(mesh, message):
    with pytest.raises(ValueError, match=message):
        suite.get("oscillator", **mesh)
