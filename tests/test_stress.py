"""The stress families' judgement: an answer that is a little off is counted as wrong."""

from dataclasses import replace

import numpy as np
import pytest

import actionopt as ao
from benchmarks.stress import report
from benchmarks.stress.case import timed
from benchmarks.stress.families import (
    FAMILIES,
    borders,
    clocks,
    energies,
    forwards,
    origins,
    pulses,
    random_systems,
    threads,
)
from benchmarks.stress.tally import all_solved, judged, never_wrong, row

WIDTH = 0.002 / pulses.FWHM


@pytest.mark.quick(
    "threads", "random_systems", "sweeps", "closed", "billiards", "borders", "normals", "barriers"
)
@pytest.mark.parametrize("name", FAMILIES)
def test_the_questions_of_a_family_can_be_asked(name):
    questions = [case.build for case in FAMILIES[name].cases(quick=True) if case.build]
    assert all(build().problem.duration > 0 for build in questions[:: max(1, len(questions) // 5)])


def moved(solution, by):
    """The solution with its path off by `by` half-way, and what it claims left as it is."""
    path, (t0, t1) = solution.path, solution.mesh.boundaries[[0, -1]]
    s = (path.mesh.nodes - t0) / (t1 - t0)
    return replace(solution, path=replace(path, values=path.values + by * 4 * s * (1 - s)))


def missing_the_pulse(c):
    """A path that never saw the pulse at c, called solved."""
    coarse = ao.solve(pulses.kicked("free body", c, WIDTH), mesh=ao.Mesh([0.0, 1.0], [4]))
    return replace(coarse, status=ao.Status.SOLVED, error=1e-9)


@pytest.mark.long
def test_a_pulse_that_is_missed_is_counted():
    c, tol = 0.613, 1e-6
    exact = pulses.closed_form(c, WIDTH)
    good, spent = timed(pulses.kicked("free body", c, WIDTH), tol)
    answers = [good, moved(good, 5 * tol), moved(good, 0.5 * tol), missing_the_pulse(c)]
    found = [judged(s, lambda s: pulses.missed(s, exact), tol, spent, 1e-15) for s in answers]
    assert [o.wrong for o in found] == [False, True, False, True]
    counted = row(found)
    assert (counted["count"], counted["solved"], counted["wrong"]) == (4, 4, 2)
    assert not never_wrong("any", [counted]).met
    assert never_wrong("any", [row(found[:1])]).met


@pytest.mark.long
@pytest.mark.parametrize("k", [0, 3])
def test_a_fence_that_is_off_is_counted(k):
    made, rough = borders.fence(k)
    solution = ao.solve(made.problem(), guess=rough, tol=1e-9)
    assert borders.off_fence(made, solution) < 1e-9
    assert borders.off_fence(made, moved(solution, 1e-6)) > 1e-7
    t, h = np.array([0.3]), 1e-5
    q, v = borders.arc((0.2, 0.1), 0.7, 1.3, 0.9, t)
    ahead, behind = (borders.arc((0.2, 0.1), 0.7, 1.3, 0.9, t + x) for x in (h, -h))
    a = (ahead[1] - behind[1]) / (2 * h)
    assert (ahead[0] - behind[0]) / (2 * h) == pytest.approx(v, abs=1e-9)
    assert a == pytest.approx(0.9 * np.array([v[1], -v[0]]), abs=1e-9)  # of L + kappa g


@pytest.mark.long
def test_an_answer_with_no_motion_near_it_is_wrong():
    solution, spent = timed(pulses.kicked("pendulum", 0.613, WIDTH), 1e-6)
    outcome = judged(solution, lambda s: np.nan, 1e-6, spent)
    assert outcome.wrong
    assert row([outcome])["of_tol"] == np.inf


@pytest.mark.long
@pytest.mark.parametrize("name", pulses.WALLS)
def test_the_time_of_flight_across_a_wall(name):
    x, t = pulses.flight(pulses.WALLS[name], -0.3, 0.4)
    problem = ao.Problem(
        pulses.wall(name),
        ao.Event(0.0, [0.0]),
        ao.Event(1.0, [1.0]),
        parameters={"c": 0.4, "height": -0.3},
    )
    good = ao.solve(problem, tol=1e-9)
    for solution, wrong in ((good, False), (moved(good, 1e-6), True)):
        outcome = judged(solution, lambda s: np.max(np.abs(s(t)[0] - x)), 1e-9, 0.0, 1e-13)
        assert outcome.wrong is wrong


def test_what_is_not_called_solved_is_not_wrong_but_counted():
    c = 0.613
    good, spent = timed(pulses.kicked("free body", c, WIDTH), 1e-6)
    gave_up = replace(good, status=ao.Status.UNRESOLVED)
    counted = row([judged(s, lambda s: 0.0, 1e-6, spent) for s in (good, gave_up)])
    assert (counted["solved"], counted["wrong"]) == (1, 0)
    assert not all_solved("any", [counted]).met
    assert all_solved("any", [counted], most=1).met


def test_many_solves_in_a_row_are_told_as_many():
    good, spent = timed(pulses.kicked("free body", 0.613, WIDTH), 1e-6)
    outcome = judged(good, lambda s: 0.0, 1e-6, spent)
    counted = {"case": "free body", "solver": "actionopt", **row([outcome] * 7)}
    assert "| free body | actionopt | 7 of 7 | 0 |" in report.page(
        {"pulses": ("today", [counted])}, {}
    )


@pytest.mark.quick("pendulum of many turns")
@pytest.mark.parametrize("name", origins.places())
def test_a_shifted_path_that_is_off_is_wrong(name):
    place, tol = origins.places()[name], 1e-9
    ends = np.array(place.ends(np.random.default_rng(1)))
    about_zero = ao.solve(place.problem(ends, 0.0), tol=1e-12)
    X = place.shift(1e2)
    there, by = ao.solve(place.problem(ends, X), tol=tol), X * place.moved
    answers = [there, moved(there, 10 * tol * X), moved(there, 0.5)]
    found = [judged(s, lambda s: origins.off(s, about_zero, by), tol, 0.0) for s in answers]
    assert [o.wrong for o in found] == [False, True, True]
    assert found[2].error == np.inf  # another motion, however large |q| is


@pytest.mark.parametrize("forced", [True, False])
def test_a_path_beside_the_forced_motion_is_wrong(forced):
    t0, T, tol = 1e3, 4.0, 1e-8
    problem = ao.Problem(clocks.system(forced), ao.Event(t0, [0.3]), ao.Event(t0 + T, [0.5]))
    exact = clocks.motion(t0, t0 + T, 0.3, 0.5, clocks.AMPLITUDE * forced)
    solution, explained, spent = clocks.asked(problem, tol)
    assert explained
    late = clocks.motion(t0 + 1e-5, t0 + T, 0.3, 0.5, clocks.AMPLITUDE * forced)
    for answer, curve, wrong in (
        (solution, exact, False),
        (moved(solution, 50 * tol), exact, True),
        (solution, late, True),
    ):
        outcome = judged(answer, lambda s, e=curve: clocks.off(s, e), tol, spent, clocks.ACCURACY)
        assert outcome.wrong is wrong


def test_one_different_bit_in_one_thread_is_counted():
    solution = ao.solve(threads.problems("rod", 1)[0])
    bits, other = threads.digest(solution), threads.digest(moved(solution, 1e-15))
    assert threads.compared([bits, bits], [[bits, bits], [bits, other]]) == 1


@pytest.mark.long
def test_few_threads_find_the_same_bits():
    counted = threads.solving("rod", 3, threads=2)[0]
    assert (counted["count"], counted["solved"], counted["wrong"]) == (6, 6, 0)
    assert threads.reading("rod", 5)[0]["wrong"] == 0


def systems_of(count):
    """The first random systems of each range of durations up to 3.2."""
    return [pair for which in range(3) for pair in random_systems.draws(which, count)]


@pytest.mark.slow
def test_the_equations_by_hand_are_those_of_the_lagrangian():
    random = np.random.default_rng(2)
    for case, problem in systems_of(12):
        q, v = random.normal(size=(2, case.n, 5))
        t = random.normal(size=5)
        known = problem.system.acceleration(q, v, t)
        assert case.acceleration(q, v, t) == pytest.approx(known, rel=1e-11, abs=1e-11)


@pytest.mark.long
def test_an_answer_beside_the_motion_of_a_random_system_is_wrong():
    tol = random_systems.TOL
    for case, problem in systems_of(2):
        good, _ = timed(problem, tol)
        size = np.max(np.abs(good.path.values))
        for by, wrong in ((0.0, False), (10 * tol * size, True)):
            answer = moved(good, by)
            # What is off at the starts of elements is told to its full amount.
            s = (good.mesh.boundaries - good.mesh.boundaries[0]) / problem.duration
            outcome = judged(answer, lambda s, c=case: random_systems.off(s, c), tol, 0.0)
            assert outcome.wrong is wrong
            if by:
                assert outcome.error == pytest.approx(by / size * np.max(4 * s * (1 - s)), rel=1e-2)


@pytest.mark.long
@pytest.mark.parametrize("kind", ["throw", "over", "transfer", "well"])
def test_a_duration_that_is_off_is_counted(kind):
    rows = [{"case": f"{kind} 0", **row} for row in energies.KINDS[kind](0)]
    assert {row["solver"] for row in rows} == {"actionopt", "solve_bvp"}
    met = lambda rows: energies.of_kind(rows, kind)[0].met  # noqa: E731
    assert met(rows)
    off = [row | {"error": 2 * energies.WRONG} for row in rows]
    assert not met(off) and not met([row | {"success": False} for row in rows])


@pytest.mark.slow
def test_an_answer_of_another_energy_or_beside_the_normal_is_counted():
    case, q1, v1 = forwards.draws(0, 1)[0]
    for kind, question in forwards.KINDS.items():
        problem, missed = question(case, q1, v1)
        found = ao.solve(problem, tol=1e-8)
        assert missed(found) < 1e-9
        if kind == "transfers":
            energy = forwards.energy(case, found.start.q, found.start.v)
            beside = problem.replace(energy=energy * (1 + 1e-5))
        else:
            along = np.linalg.svd(forwards.momentum(case, found.end.q, found.end.v)[None])[2][-1]
            beside = ao.Problem(
                case.system,
                ao.Event(0.0, case.q0),
                ao.Event(case.T, found.end.q + 1e-4 * along),
            )
        assert missed(ao.solve(beside, tol=1e-8, guess=found)) > 1e-6
