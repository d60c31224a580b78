"""Single functions of the suite: verdicts, profiles, saddles, and what is written of problems."""

import json
from typing import Any

import numpy as np
import pytest
from helpers import fake

from actionopt.suite import (
    active_set,
    dump,
    learn,
    nl,
    nl_lines,
    profile,
    saddle_search,
    sequence,
    stars,
    ways,
)
from actionopt.suite import verdict as suite_verdict
from actionopt.suite.limits import Bounds
from actionopt.suite.member import Member


def test_defined_variables_of_an_evaluation_follow_one_another(monkeypatch):
    monkeypatch.setattr(nl, "_places", lambda listing, here: {"here": here})
    listing: Any = fake(
        moving=[0, 2], lagrangian=fake(common=[1, 1, 1]),
        evaluations=lambda: [fake(columns=np.zeros(3))] * 2,
    )  # fmt: skip
    one, other = nl._evaluations(listing, 7)
    assert one[1:] == (7, {"here": one[0], "v": ["v7", "", "v8"], "s": ["v9", "v10", "v11"]})
    assert other[1:] == (
        12,
        {"here": other[0], "v": ["v12", "", "v13"], "s": ["v14", "v15", "v16"]},
    )


def test_the_facts_of_a_member_are_plain_data(monkeypatch):
    monkeypatch.setattr(dump, "summary", lambda problem: {"name": "a"})
    inf, other = np.inf, fake(x=np.array([2.0]), f=3.0, index=1, kind="saddle")
    member = fake(
        bounds=(np.array([-inf, 1.0]), np.array([2.0, inf])), lowest=-inf, others=[other],
        constraint_bounds=(np.array([-inf]), np.array([5.0])), variable_names=["x", "y"],
        constraint_names=["c"], start_names=["own"], start=lambda name: np.array([7.0]),
        x_star=np.ones(2), lam_star=np.zeros(1), f_star=4.0, index_star=0, known_by={"f": "b"},
    )  # fmt: skip
    found = dump.facts(member)
    sides = [found[k] for k in ("x_lower", "x_upper", "c_lower", "c_upper")]
    assert sides == [[None, 1.0], [2.0, None], [None], [5.0]]
    assert found["other_stationary_points"] == [
        {"x": [2.0], "f": 3.0, "index": 1, "kind": "saddle"}
    ]
    assert (found["f_star"], found["f_lowest_known"], found["starts"]) == (
        4.0,
        None,
        {"own": [7.0]},
    )
    member.lowest = -9.0
    assert dump.facts(member)["f_lowest_known"] == -9.0
    assert (found["name"], found["variables"], found["lam_star"]) == ("a", ["x", "y"], [0.0])


def test_bounds_that_are_met_and_the_steps_of_a_sequence(monkeypatch):
    def member(x, c):
        return fake(
            x_star=np.array(x), lam_star="lam", unit=np.array([1.0, 100.0]), m=2,
            bounds=(np.array([0.0, -np.inf]), np.array([1.0, 5.0])),
            constraints=lambda x: np.array(c),
            constraint_bounds=(np.array([0.0, 2.0]), np.array([0.0, np.inf])),
        )  # fmt: skip

    near = sequence.AT_BOUND / 2
    made = {1.0: member([near, 5.0 - 100 * near], [0.0, 2.0 + near]),
            2.0: member([0.5, 5.0 + near], [0.0, 2.0 + 4 * near]),
            3.0: member([1.0, 4.0], [0.0, 3.0])}  # fmt: skip
    assert sequence.in_force(made[1.0]).tolist() == [True] * 4
    assert sequence.in_force(made[2.0]).tolist() == [False, True, True, False]
    assert sequence.in_force(made[3.0]).tolist() == [True, False, True, False]
    monkeypatch.setattr(sequence.suite, "member", lambda name, elements, degree, *, g: made[g])
    found = list(sequence.steps("a", "g", [1.0, 2.0, 3.0]))
    assert [(s.value, s.problem) for s in found] == [(g, made[g]) for g in (2.0, 3.0)]
    assert [s.changes for s in found] == [2, 2]
    assert found[1].x is made[2.0].x_star


def test_ways_are_scored_and_distances_are_in_units():
    unit, flat = np.array([1.0, 10.0]), np.array([[0.0], [1.0]])
    made = fake(n=2, unit=unit, flat=np.zeros((2, 0)), x_star=np.array([1.0, 20.0]))
    distance = Member.distance
    assert distance(made, np.array([1.5, 10.0])) == pytest.approx(1.0)
    assert distance(made, np.array([1.5, 10.0]), np.array([1.0, 10.0])) == pytest.approx(0.5)
    made.flat = flat
    assert distance(made, np.array([1.5, 10.0])) == pytest.approx(0.5)
    with pytest.raises(ValueError, match="expected 2 numbers as x, found the shape"):
        distance(made, np.zeros(3))


def test_a_bent_line_is_half_a_wave_beside_the_straight_one():
    tr: Any = fake(problem=fake(start=fake(t=1.0), duration=2.0),
                   straight=lambda: np.array([[0.0, 5.0], [1.0, 5.0], [4.0, 7.0]]))  # fmt: skip
    found = stars.bent_line(tr, (0.5, -1.0))(np.array([1.0, 1.5, 2.0, 3.0]))
    half = np.sqrt(0.5)
    np.testing.assert_allclose(
        found, [[0.0, 1 + half / 2, 2.5, 4.0], [5.0, 5.5 - half, 5.0, 7.0]], atol=1e-12
    )


def test_other_optima_are_those_that_differ(monkeypatch):
    def star(*z):
        return fake(z=np.array(z))

    def solve(problem, tol, guess):
        if guess == "lost":
            raise ValueError("none")
        return guess

    monkeypatch.setattr(active_set, "solve", solve)
    monkeypatch.setattr(active_set, "bent_line", lambda tr, bend: bend)
    monkeypatch.setattr(active_set, "from_path", lambda tr, path: path)
    monkeypatch.setattr(active_set, "nearest", lambda tr, point, reach: point)
    tr, known, one = fake(layout=fake(unknowns=2)), star(0.0, 1.0, 5.0), star(0.0, 2.0, 5.0)
    again, other = star(0.0, 1.0, 9.0), star(3.0, 2.0, 5.0)
    bends: Any = ("lost", one, other)
    scene: Any = fake(problem=None)
    points: Any = [None, again, one]
    found = active_set.others(tr, scene, bends, points, known)
    assert [s is t for s, t in zip(found, (one, other), strict=True)] == [True, True]


def test_verdicts_on_records():
    def judged(mode, **known):
        record = {"outcome": "answered", "said": "solved", "unbounded": False} | known
        return suite_verdict.verdict(record, mode, known.pop("accuracy", 1e-3))

    minimise, point, saddle = "minimise", "stationary", suite_verdict.SADDLE_QUESTION
    assert judged(minimise, outcome="crashed") == "crashed"
    for mode in (minimise, point, saddle):
        assert judged(mode, said="infeasible", infeasible=True, least=True) == "right"
        assert judged(mode, said="infeasible", infeasible=True) == "failed"
        assert judged(mode, said="infeasible") == "failed"
        assert judged(mode, said="gave up", off=1.0) == "failed"
        assert judged(mode, off=2e-3, at="optimum") == "wrong"
    assert judged(minimise, said="unbounded") == "wrong"
    assert judged(minimise, said="unbounded", unbounded=True, far_below=True) == "right"
    assert judged(minimise, said="unbounded", unbounded=True) == "wrong"
    assert judged(point, said="unbounded", unbounded=True, far_below=True) == "failed"
    near = {"off": 1e-3, "said": "gave up"}
    for index, above, found in ((0, False, "right"), (0, True, "other"), (2, True, "saddle")):
        assert judged(minimise, at="new", index=index, above=above, **near) == found
    for at, found in (("optimum", "right"), ("other", "other"), ("new", "new")):
        assert judged(point, at=at, **near) == found
    assert [judged(saddle, at="new", index=k, **near) for k in (0, 1, 2)] == [
        "other", "right", "other"
    ]  # fmt: skip
    worst = judged(point, at="optimum", differing=[{"said": "solved"}], **near)
    assert (worst, judged(point, at="optimum", differing=[], **near)) == ("wrong", "right")


def test_evidence_of_an_answer():
    optimum, other = fake(f=1.0, index=0), fake(f=3.0, index=1, x=np.array([2.0]))
    new = fake(f=1.0 + 1e-12, index=0, x=np.array([5.0]))
    member: Any = fake(
        n=1, infeasible=False, unit=np.ones(1), optimum=optimum, others=[other], f_star=1.0,
        f_unit=1e-3, violation=lambda x: 1e-9 if x[0] > -9 else 1.0, residual=lambda x: 1e-5,
        distance=lambda x, star=0.0: float(np.abs(x - star).max()),
        objective=lambda x: 10.0 if x[0] > -8 else -1e12, least_violation=0.5,
        nearest=lambda x, reach: new if x[0] > 4 else None,
    )  # fmt: skip
    start = np.ones(1)

    def seen(x):
        return suite_verdict.examine(member, np.array([x]), start)

    at = {x: (seen(x).at, seen(x).index, seen(x).above) for x in (0.0, 2.0, 5.0, 3.0)}
    assert at == {0.0: ("optimum", 0, False), 2.0: ("other", 1, True), 5.0: ("new", 0, False),
                  3.0: (None, None, False)}  # fmt: skip
    assert (seen(2.0).f_there, seen(2.0).off, seen(2.0).distance) == (3.0, 0.0, 2.0)
    assert [seen(x).far_below for x in (3.0, -8.5, -9.5)] == [False, True, False]
    nothing = suite_verdict.Evidence()
    assert suite_verdict.examine(member, np.zeros(2), start) == nothing
    assert seen(np.nan) == nothing
    member.infeasible = True
    assert [seen(x).least for x in (0.0, -9.5)] == [True, True]
    member.least_violation = 0.4
    assert [seen(x).least for x in (0.0, -9.5)] == [True, False]


def test_profiles_of_a_table():
    table = {"a": np.array([1.0, 4.0, np.inf, np.nan]), "b": np.array([2.0, 2.0, np.inf, 3.0])}
    tau, share = profile.performance(table)["a"]
    assert (tau.tolist(), share.tolist()) == ([1.0, 2.0], [1 / 3, 2 / 3])
    tau, share = profile.data(table)["b"]
    assert (tau.tolist(), share.tolist()) == ([2.0, 2.0, 3.0], [0.25, 0.5, 0.75])
    history = [(1, 9.0, 0.0), (2, 1.5, 1e-1), (3, 1.5, 1e-4), (4, 1.0, 0.0)]
    record = {"outcome": "answered", "f_start": 11.0, "history": history}
    assert [profile._evaluations_to(record, 1.0, tau) for tau in (0.9, 0.05, 1e-3, 1e-9)] == [
        1.0, 3.0, 4.0, 4.0
    ]  # fmt: skip
    assert profile._evaluations_to(record, 0.5, 1e-9) == np.inf
    assert profile._evaluations_to({"outcome": "crashed"}, 1.0, 0.1) == np.inf


def test_the_least_of_a_problem_is_of_all_records():
    def record(**known):
        return {"outcome": "answered", "unbounded": False, "problem": "a", "elements": 3} | known

    key = profile.question_key(record())
    least = profile._least
    assert least([record(f_lowest=2.0), record(at="new", f_there=1.0, index=0)]) == {key: 1.0}
    assert least([record(f_lowest=2.0), record(at="new", f_there=1.0, index=1)]) == {key: 2.0}
    assert least([record(at="new", f_there=4.0)]) == {key: 4.0}
    for known in ({"outcome": "crashed"}, {"unbounded": True}, {"infeasible": True}):
        assert not least([record(f_lowest=2.0, **known)])
    assert not least([record(f_there=1.0)])


def test_a_step_of_limited_memory_is_that_of_bfgs():
    rng = np.random.default_rng(0)
    A = np.diag([1.0, 3.0, 9.0])
    changes = [(s, A @ s) for s in rng.standard_normal((3, 3))]
    s, y = changes[-1]
    H = np.eye(3) * (s @ y) / (y @ y)
    for s, y in changes:
        P = np.eye(3) - np.outer(s, y) / (s @ y)
        H = P @ H @ P.T + np.outer(s, s) / (s @ y)
    force = rng.standard_normal(3)
    np.testing.assert_allclose(saddle_search.limited_memory(force, changes), H @ force)
    assert saddle_search.limited_memory(force, []).tolist() == force.tolist()
    x, rests = saddle_search.relax(lambda x: (-A @ (x - 1.0), True), np.zeros(3))
    assert rests
    assert x == pytest.approx(np.ones(3), abs=1e-8)
    first = []
    saddle_search.relax(lambda x: first.append(x) or (np.array([5.0]), len(first) > 3), np.zeros(1))
    steps = np.diff(np.ravel(first)[:5])
    assert steps == pytest.approx(saddle_search.LONGEST_CLIMB)
    B = np.diag([4.0, 1.0, -2.0])
    along, bend = saddle_search.softest(lambda v: B @ v, np.ones(3) / np.sqrt(3))
    assert bend == pytest.approx(-2.0, abs=0.05)
    assert abs(along[2]) == pytest.approx(1.0, abs=0.02)


def test_a_dimer_and_a_band_come_to_the_saddle():
    # f = (x^2 - 1)^2 / 4 + y^2: minima at -+1, a saddle at 0
    program = fake(
        m=0, has_bounds=False, objective=lambda x: (x[0] ** 2 - 1) ** 2 / 4 + x[1] ** 2,
        gradient=lambda x: np.array([x[0] ** 3 - x[0], 2 * x[1]]),
    )  # fmt: skip
    x, _, rests = saddle_search.dimer(program, np.array([0.7, 0.1]))
    assert rests
    assert x == pytest.approx([0.0, 0.0], abs=1e-6)
    band, rests = saddle_search.elastic_band(
        program, np.array([-1.0, 0.0]), np.array([1.0, 0.02]), images=4
    )
    assert rests
    assert np.abs(band).min(axis=0) == pytest.approx([0.0, 0.0], abs=1e-6)
    program.m = 1
    with pytest.raises(ValueError, match="without constraints and bounds"):
        saddle_search.dimer(program, np.zeros(2))


def test_bounds_are_those_of_each_coordinate_and_time():
    bounds = Bounds([(0.0, lambda t: 1 + t)], [(lambda t: -t, 2.0), (1.0, np.inf)])
    which, t = np.array([0, 1, 0]), np.array([1.0, 2.0, 3.0])
    low, high = bounds.of_coordinates(which, t)
    assert (low.tolist(), high.tolist()) == ([0.0, -np.inf, 0.0], [2.0, np.inf, 4.0])
    low, high = bounds.of_constraints(np.array([0, 1, 2]), t)
    assert (low.tolist(), high.tolist()) == ([-1.0, 1.0, 0.0], [2.0, np.inf, 0.0])
    words = "coordinate 0 below the upper one, found 0 and -1 at t = -2"
    with pytest.raises(ValueError, match=words):
        bounds.of_coordinates(which, np.array([1.0, 2.0, -2.0]))
    with pytest.raises(ValueError, match="constraint 0 not above the upper one, found 3 and 2"):
        bounds.of_constraints(which, np.array([1.0, 1.0, -3.0]))


def test_lines_of_an_nl_file():
    inf = np.inf
    for low, high, line in (
        (2.5, 2.5, "4 2.5"),
        (-inf, inf, "3"),
        (-inf, 1, "1 1"),
        (0.5, inf, "2 0.5"),
        (-1, 0.2, "0 -1 0.20000000000000001"),
    ):
        assert nl_lines.bound(low, high) == line + "\n"
    assert list(nl_lines.entries(np.array([3.0, -0.5]))) == ["0 3\n", "1 -0.5\n"]
    program: Any = fake(n=3, m=2, jacobian_structure=(np.array([1, 0, 1]), np.array([0, 2, 2])))
    found = "".join(nl_lines.derivatives(program, np.array([5.0, 6.0, 0.0])))
    assert found.split("\n")[:-1] == [
        "k2", "1", "1", "J0 1", "2 6", "J1 2", "0 5", "2 0", "G0 3", "0 0", "1 0", "2 0"
    ]  # fmt: skip


def test_points_are_learned_once(monkeypatch, tmp_path):
    member = fake(
        name="a", mesh=fake(elements=3, degrees=(5, 4)), unit=np.array([2.0]), x_star=np.zeros(1),
        nearest=lambda x, reach: None if x[0] > 90 else fake(x=np.round(x)),
    )  # fmt: skip
    monkeypatch.setattr(learn.suite, "get", lambda name, elements, degree: member)
    monkeypatch.setattr(
        learn, "is_new", lambda problem, x, others: all(abs(x - y)[0] > 0.5 for y in others)
    )
    table = {"a 3 x 5": {"starts": 7, "points": [[2.0]]}}
    monkeypatch.setattr(learn.known, "table", lambda: table)
    file = tmp_path / "known.json"
    record = {"problem": "a", "elements": 3, "degree": 5}
    points = [3.0, 2.0, 3.0, 0.1, 60.0]
    records = [record | {"point": [x], "starts": 4} for x in points]
    records += [record, record | {"point": [9.0], "parameters": {"g": 1}}]
    records += [record | {"point": [4.0], "starts": 60, "paths": 5}]
    assert learn.learn(records, file) == 2
    found = json.loads(file.read_text())
    assert found == {"a 3 x 5": {"starts": 60, "points": [[2.0], [3.0], [4.0]], "paths": 5}}
    assert table["a 3 x 5"]["points"] == [[2.0]]


def test_ways_are_all_choices_of_sides_the_least_first(monkeypatch):
    cost = {(1, 1): 3.0, (1, -1): 1.0, (-1, 1): 2.0, (-1, -1): 4.0}
    monkeypatch.setattr(ways, "centres", lambda problem: [(0.0, 0.0), (1.0, 0.0)])
    monkeypatch.setattr(
        ways, "_way", lambda problem, discs, sides: fake(x=sides, f=cost[tuple(sides.tolist())])
    )
    member: Any = fake(name="a", distance=lambda x, y: np.abs(x - y).max())
    assert list(ways.ways(member)) == [(1, -1), (-1, 1), (1, 1), (-1, -1)]
    near = np.array([1.0, -1.0]) + 9e-4
    assert ways.score(member, [near, near, np.array([-1.0, 1.2])]) == 0.25
    assert ways.score(member, [near, np.array([-1.0, 1.2])], reach=0.3) == 0.5
    monkeypatch.setattr(ways, "centres", lambda problem: [])
    with pytest.raises(ValueError, match="expected a member with discs"):
        ways.ways(member)
