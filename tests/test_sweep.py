"""A problem over a grid of values: the same numbers whoever solves it, and failures are data."""

import multiprocessing
import os
import pickle
import re
import signal
import subprocess
import sys
import textwrap
import time
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np
import pytest
import systems
from helpers import slow

import actionopt as ao
from actionopt import Event, Periodic, Problem, System, scenes
from actionopt.discrete.matrices.factors import Factors
from actionopt.families import continuation
from actionopt.families.sweeps import batch, budget
from actionopt.families.sweeps import sweep as module
from actionopt.families.sweeps.grid import Grid
from actionopt.families.sweeps.path_store import PackedPaths
from actionopt.families.sweeps.retry import _without, check_sent
from actionopt.families.sweeps.runs import Runs

OVER = {"g": np.linspace(9.0, 10.0, 4), "t1": np.linspace(0.7, 1.2, 6)}
PENDULUM = scenes.get("pendulum").problem
BITS = ("action", "error", "status", "momenta", "ends", "slopes", "index")


def of_five_members(patched):
    patched.setattr(module, "TASK_SECONDS", 5.5)
    patched.setattr(module, "MEMBER_SECONDS", 1.0)
    patched.setattr(module, "UNKNOWN_SECONDS", 0.0)


@pytest.fixture
def short(monkeypatch):
    """Tasks of five members."""
    of_five_members(monkeypatch)


@pytest.fixture(scope="module")
def serial():
    with pytest.MonkeyPatch.context() as patched:
        of_five_members(patched)
        return ao.sweep(PENDULUM, OVER, record="index", keep_paths=True)


def same(a, b):
    return all(
        np.array_equal(getattr(a, x), getattr(b, x), equal_nan=x not in ("status", "index"))
        for x in BITS
    ) and (
        a.kept is None
        or all(
            np.array_equal(getattr(x, y), getattr(z, y))
            for x, z in zip(sorted(a.kept, key=first), sorted(b.kept, key=first), strict=True)
            for y in ("members", "times", "since", "degrees", "values")
        )
    )


def first(kept):
    return kept.members[0]


# -- numbers --------------------------------------------------------------------------------------


@pytest.mark.long
def test_every_member_is_what_solve_finds(serial):
    assert serial.shape == (4, 6) and serial.success.all() and not serial.failed.any()
    assert serial.stats["tasks"] == 5 and not serial.interrupted
    assert (serial.status == "SOLVED").all() and (serial.branch == 0).all()
    assert (serial.index == 0).all() and (serial.error < 1e-8).all()
    for i, j in ((0, 0), (2, 3), (3, 5)):
        problem = PENDULUM.replace(
            end=PENDULUM.end.at(OVER["t1"][j]), parameters={"g": OVER["g"][i]}
        )
        found = ao.solve(problem)
        assert serial.action[i, j] == pytest.approx(found.action, rel=1e-9)
        assert serial.momenta[i, j] == pytest.approx(np.stack(found.momenta), rel=1e-7)
        assert serial.ends[i, j, :, 0] == pytest.approx([problem.start.q[0], problem.end.q[0]])


def test_a_member_is_made_again_to_full_accuracy(serial, short):
    without = ao.sweep(PENDULUM, {name: row[:2] for name, row in OVER.items()})
    for runs in (serial, without):
        found = runs.solution(1, 1)
        assert found.success and found.problem.end.t == OVER["t1"][1]
        assert found.action == pytest.approx(runs.action[1, 1], rel=1e-12)
        assert found.problem.parameters["g"] == OVER["g"][1]
    with pytest.raises(IndexError):
        serial.solution(1, 9)
    with pytest.raises(IndexError, match=r"an array of shape \(4, 6\)"):
        serial.solution(1)
    assert runs.solution(-1, -1).action == found.action


@pytest.mark.long
def test_a_member_that_passes_one_place_several_times_is_made_again():
    system = System(
        lambda q, v, t, *, g: v[0] ** 2 / 2 + g * np.cos(q[0]), ["x"], parameters={"g": 1.0}
    )
    place = Event(None, [-0.9])
    problem = Problem(system, Event(0.0, [-0.19]), Event(3.61, [-0.6]), through=[place] * 3)
    runs = ao.sweep(problem, {"g": [1.0, 1.05, 1.1]})
    rise, slopes = np.diff(runs.action), runs.slopes[:, 0]  # each is passed when its neighbour was
    assert rise == pytest.approx(0.05 * (slopes[1:] + slopes[:-1]) / 2, rel=2e-3)
    for i in range(3):
        assert runs.solution(i).action == pytest.approx(runs.action[i], rel=1e-9)
    plain = ao.solve(runs.solution(0).problem.original, guess=runs.solution(0).path)
    assert plain.action == pytest.approx(runs.action[0], rel=1e-9)


@pytest.mark.long
def test_a_member_on_the_farther_side_of_an_obstacle_is_made_again():
    outside = System(lambda q, v, t: v @ v / 2, ["x", "y"], obstacle=lambda q, t: q @ q - 1)
    problem = Problem(outside, Event(0.0, [-2.0, 0.3]), Event(1.0, [2.0, 0.3]))
    heights = np.array([0.3, 0.0, -0.3])
    runs = ao.sweep(problem, {("start", "y"): heights, ("end", "y"): heights}, zip=True)
    assert (np.diff(runs.action) > 0.9).all()  # all of them go above, where the first one does
    for i in range(3):
        assert runs.solution(i).action == pytest.approx(runs.action[i], rel=1e-9)


@pytest.mark.long
def test_searches_from_a_neighbour_end_soon(monkeypatch):
    p = np.random.default_rng(1007).uniform(-1, 1, 8)

    def law(q, v, a, t, *, g):
        inertia = 1 + p[2] * q[0] ** 2 / (1 + q[0] ** 2)
        kinetic = a[0] ** 2 / 2 * inertia + 10 * p[0] * v[0] ** 2
        return kinetic - g * q[0] ** 4 + 5 * p[1] * np.sin(2 * t) * q[0]

    ends = Event(0, [p[3]], v=[p[4]]), Event(2, [p[5]], v=[p[6]])
    problem = Problem(System(law, ["x"], parameters={"g": 1.0}), *ends)
    calls = []
    monkeypatch.setattr(Factors, "__init__", counted(Factors.__init__, calls))
    values = np.linspace(-5.0, 10.0, 12)
    runs = ao.sweep(problem, {"g": values})
    together = len(calls)
    alone = [ao.solve(problem.replace(parameters={"g": g}), throw=False) for g in values]
    assert runs.success.all() and all(found.success for found in alone)
    assert together < 0.75 * (len(calls) - together)  # measured .58; .92 where they do not


def counted(function, calls):
    def wrapper(*given, **named):
        calls.append(1)
        return function(*given, **named)

    return wrapper


@pytest.mark.long
def test_a_member_without_mass_is_refused_without_a_warning(capfd):
    system = System(
        lambda q, v, t, *, m: m * (v @ v) / 2 - q[1],
        ["x", "y"],
        parameters={"m": 1.0},
        constraint=lambda q, t: q @ q - 1,
    )
    problem = Problem(system, Event(0.0, [0.0, -1.0]), Event(1.0, [1.0, 0.0]))
    runs = ao.sweep(problem, {"m": np.linspace(0, 1, 5)})
    assert runs.status.tolist() == ["REFUSED"] + ["SOLVED"] * 4
    assert "found it singular in the direction of" in runs.messages[0]
    near = runs.solution(1)
    with pytest.raises(ValueError, match="a regular mass matrix"):
        ao.solve(near.problem.replace(parameters={"m": 0.0}), guess=near)
    assert "WARNING" not in "".join(capfd.readouterr())


def test_values_may_be_zipped():
    points = np.array([[1.0, 0.2], [0.9, 0.3], [0.8, 0.1]]).T
    problem = Problem(systems.particle("x y"), Event(0.0, [0.0, 0.0]), Event(1.0, [1.0, 0]))
    over = {("end", "x"): points[0], ("end", "y"): points[1], "t0": [0.0, -1.0, 0.5]}
    runs = ao.sweep(problem, over, zip=True)
    T = 1 - np.array([0.0, -1.0, 0.5])
    assert runs.action == pytest.approx((points**2).sum(axis=0) / 2 / T)
    with pytest.raises(ValueError, match="as many values of each to zip, found 2 of 't1', 3 of"):
        ao.sweep(problem, {"t1": [1.0, 2.0], ("end", "x"): [1, 2, 3]}, zip=True)


@pytest.mark.long
def test_free_coordinates_are_kept_at_the_ends():
    system = System(
        lambda q, v, t, *, k: (v[0] ** 2 - k * q[0] ** 2) / 2, ["x"], parameters={"k": 1}
    )
    problem = Problem(system, Event(0.0, [1.0]), Event(1.0, [None]))
    runs = ao.sweep(problem, {"k": [0.5, 1.0, 1.5]})
    k = np.sqrt([0.5, 1.0, 1.5])
    assert runs.ends[:, 1, 0] == pytest.approx(1 / np.cos(k))
    assert runs.momenta[:, 1, 0] == pytest.approx(0, abs=1e-9)
    assert runs.solution(2).action == pytest.approx(runs.action[2])


def test_slopes_are_those_of_the_action():
    """S = ((x0^2 + x1^2) cos wT - 2 x0 x1) w / (2 sin wT), of an oscillator that is pushed."""
    system = System(
        lambda q, v, t, *, a, w: (v[0] ** 2 - w**2 * q[0] ** 2) / 2 + a * t,
        ["x"],
        parameters={"a": 1.0, "w": 1.3},
    )
    problem = Problem(system, Event(0.2, [0.4]), Event(1.0, [1.0]))
    over = {"t0": [0.1, 0.3], "t1": [1.1, 1.5], "w": [1.1, 1.6], "a": [-1.0, 2.0]}
    over |= {("start", "x"): [0.3, 0.7], ("end", "x"): [-0.4, 0.8]}
    runs = ao.sweep(problem, over)
    t = [ca.SX.sym(f"x{i}") for i in range(6)]
    t0, t1, w, a, x, y = t
    T = w * (t1 - t0)
    S = ((x**2 + y**2) * ca.cos(T) - 2 * x * y) * w / (2 * ca.sin(T)) + a * (t1**2 - t0**2) / 2
    exact = ca.Function("S", [ca.vertcat(*t)], [S, ca.gradient(S, ca.vertcat(*t))])
    for at in np.ndindex(runs.shape):
        S, slopes = exact([row[i] for row, i in zip(runs.grid.values, at, strict=True)])
        assert runs.action[at] == pytest.approx(float(S), rel=1e-8)
        assert runs.slopes[at] == pytest.approx(slopes.full().ravel(), rel=1e-7, abs=1e-8)
    assert not runs.branch.any()


@pytest.mark.long
def test_slopes_of_members_that_are_solved_alone(monkeypatch):
    over = {"t1": np.linspace(0.7, 0.8, 4), "g": [9.0, 10.0], ("end", "theta"): [0.0, 0.1]}
    together = ao.sweep(PENDULUM, over)
    monkeypatch.setattr("actionopt.families.sweeps.batch._can_be_stacked", lambda *_: False)
    alone = ao.sweep(PENDULUM, over)
    assert (alone.stats["alone"], together.stats["alone"]) == (16, 1)
    assert alone.slopes == pytest.approx(together.slopes, rel=1e-7)
    dragged = scenes.get("damped_oscillator").problem
    assert np.isnan(ao.sweep(dragged, {"t1": [dragged.end.t]}).slopes).all()


@pytest.mark.long
@pytest.mark.parametrize("zipped", [False, True])
def test_it_begins_from_the_problem_itself_where_its_first_member_is_not_found(zipped, monkeypatch):
    """A top that spins fast: `solve` seeks for minutes what a motion nearby leads to."""
    top = scenes.get("heavy_top").problem
    asked, solve = [], module.solve

    def little(problem, **options):
        asked.append(problem.end.t)
        if problem.end.t != top.end.t:
            raise ValueError("found after minutes")
        return solve(problem, **options)

    monkeypatch.setattr(module, "solve", little)
    over = {"t1": top.end.t + np.linspace(-1e-3, 0.9e-3, 4)}
    runs = ao.sweep(top, over, zip=zipped)
    assert runs.success.all()
    assert asked == [over["t1"][0], top.end.t]


# -- the same bits --------------------------------------------------------------------------------


def spawned(workers):
    return ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn"))


@pytest.mark.long
@pytest.mark.parametrize("workers", [3])
def test_threads_find_the_same_bits(serial, short, workers):
    with ThreadPoolExecutor(workers) as pool:
        assert same(
            ao.sweep(PENDULUM, OVER, executor=pool, record="index", keep_paths=True), serial
        )


# What several at once may change, threads and another order of the tasks change too.
@pytest.mark.long
@pytest.mark.parametrize("workers", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_processes_find_the_same_bits(serial, short, workers):
    with spawned(workers) as pool:
        assert same(
            ao.sweep(PENDULUM, OVER, executor=pool, record="index", keep_paths=True), serial
        )


class Backwards:
    """An executor that does what it was given in reverse, and only when it has it all."""

    def __init__(self):
        self.given = []

    def submit(self, *call):
        self.given.append((Future(), call))
        if len(self.given) == 5:
            for future, (function, *arguments) in reversed(self.given):
                future.set_result(function(*pickle.loads(pickle.dumps(arguments))))
        return self.given[-1][0]


@pytest.mark.long
def test_the_order_in_which_tasks_finish_changes_nothing(serial, short):
    found = ao.sweep(PENDULUM, OVER, executor=Backwards(), record=["index"], keep_paths=True)
    assert same(found, serial)


@pytest.mark.long
def test_tasks_are_on_their_way_before_all_seeds_are_found(serial, short, monkeypatch):
    walk, events = module.walk, []
    monkeypatch.setattr(module, "walk", lambda *given: events.append("walk") or walk(*given))

    class Telling(ThreadPoolExecutor):
        def submit(self, *call):
            events.append("task")
            return super().submit(*call)

    with Telling(1) as pool:
        ao.sweep(PENDULUM, OVER, executor=pool)
    assert events == ["task", *["walk", "task"] * 4]


# -- failures -------------------------------------------------------------------------------------


def test_a_member_that_fails_is_data():
    told = []
    runs = ao.sweep(PENDULUM, {"t1": [-1.0, 0.5, 1.0]}, progress=lambda *said: told.append(said))
    assert runs.status.tolist() == ["REFUSED", "SOLVED", "SOLVED"]
    assert runs.failed.tolist() == [True, False, False] and runs.branch.tolist() == [-1, 0, 0]
    assert (
        np.isnan(runs.action[0])
        and np.isinf(runs.error[0])
        and told == [("sweep", 3, 3, {"failed": 1})]
    )
    assert "the end event after the start event" in runs.messages[0]
    with pytest.raises(ValueError, match=r"found t1 = -1 of the status REFUSED: .* t1 = -1"):
        runs.solution(0)
    assert repr(runs).endswith("branches 1; 1 refused: runs.messages)")


@pytest.mark.long
def test_paths_that_do_not_exist_cost_little_wherever_the_grid_begins(monkeypatch):
    """Bratu's problem has a fold at 3.5138307: the first half of the values has no path."""
    problem = systems.bratu()
    over, tried = {"lam": np.linspace(4.6, 2.6, 24)}, []
    missing = over["lam"] > 3.5138307

    near = ao.solve(problem)
    nothing = replace(near, status=ao.Status.NOT_FOUND)

    def counted(problem, tol=1e-8, guess=None, throw=False, progress=None):
        if problem.parameters["lam"] < 3.52:
            return ao.solve(problem, tol=tol, guess=guess, throw=throw)
        if progress is not None:  # what takes a tenth of a second or more to find out
            tried.append(float(problem.parameters["lam"]))
            progress("patient least", 1, None, {"elements": budget.BUDGET})
        return nothing

    monkeypatch.setattr(module, "solve", counted)
    monkeypatch.setattr(batch, "solve", counted)
    monkeypatch.setattr(batch, "solve_near", lambda p, guess, tol: counted(p, tol, guess))
    runs = ao.sweep(problem, over)
    assert np.array_equal(runs.failed, missing)
    # Beside the fold, where the branch turns back, up to what a search that succeeds takes.
    assert tried == [over["lam"][missing][-1]]
    assert np.array_equal(runs.unsought, missing)
    counts = f"{missing.sum()} not found, {missing.sum()} of them not searched for at length"
    assert f"; {counts}: runs.retry())" in repr(runs)


@pytest.mark.parametrize(
    ("over", "more"),
    [
        ({}, {}),
        ({"g": [5.0]}, {}),
        pytest.param({}, {"through": [Event(None, [0.1])]}, marks=pytest.mark.long),
    ],
    ids=["one by one", "together", "with a time to be found"],
)
def test_a_map_stays_with_its_kind_of_path_past_half_a_period(over, more):
    """There the path that goes on moves ever faster, and Newton's method leads to a saddle."""
    problem = PENDULUM.replace(parameters={"g": 5.0}, **more)
    runs = ao.sweep(problem, {**over, "t1": np.linspace(0.4, 2.2, 7)}, record="index")
    assert (runs.index == 0).all() and not runs.branch.any()
    assert (np.diff(runs.momenta[..., 0, 0]) > 0).all()


def test_a_sweep_of_a_law_with_accelerations():
    spline = System(lambda q, v, a, t, *, k: k * a[0] ** 2 / 2, ["x"], parameters={"k": 1.0})
    problem = Problem(spline, Event(0, [0], v=[0]), Event(1, [1], v=[0]))
    assert ao.sweep(problem, {"k": [1.0, 2.0]}).action == pytest.approx([6.0, 12.0])


def test_a_parameter_may_be_called_as_an_array_is(tmp_path):
    law = System(
        lambda q, v, t, *, index, file: index * v[0] ** 2 / 2 - file * q[0],
        ["x"],
        parameters={"index": 1.0, "file": 1.0},
    )
    problem = Problem(law, Event(0.0, [0.0]), Event(1.0, [1.0]))
    runs = ao.sweep(problem, {"index": [1.0, 1.1], "file": [0.0, 1.0, 2.0]})
    runs.save(tmp_path / "map.npz")
    found = np.load(tmp_path / "map.npz")
    assert found["parameter index"].tolist() == [1.0, 1.1] and found["action"].shape == (2, 3)
    assert found["parameter file"].size == 3


def test_who_dies_says_what_would_have_kept_the_rest(short, tmp_path):
    class Dies:
        def submit(self, *_):
            future = Future()
            future.set_exception(OSError("the machine is gone"))
            return future

    for file, what in ((None, "What is finished is lost: `resume=FILE`"), ("it", "the same call")):
        with pytest.raises(OSError, match="the machine is gone") as error:
            ao.sweep(PENDULUM, {"t1": [0.9]}, executor=Dies(), resume=file and tmp_path / file)
        assert what in error.value.__notes__[0]


def test_nothing_but_failures_is_an_error():
    free = System(lambda q, v, t: v[0] ** 2 / 2 - q[0] ** 2 * 0, ["x"])
    problem = Problem(free, Event(0.0, [0.0]), Event(1.0, [1.0]))
    with pytest.raises(ValueError, match="end event after the start"):
        ao.sweep(problem, {"t1": [-1.0, 0.0]})
    spring = systems.oscillator()
    between = Problem(spring, Event(0.0, [0.0]), Event(np.pi, [1.0]))
    with pytest.raises(
        ao.SolveError, match=r"found 2 DEGENERATE of 2; the first, end.x = 1: "
    ) as error:
        ao.sweep(between, {("end", "x"): [1.0, 2.0]})
    assert error.value.solution.status.name == "DEGENERATE"


def test_failures_are_tried_again_near_a_guess_or_a_neighbour():
    runs = ao.sweep(PENDULUM, {"t1": [1.2, 1.25, 1.3, 1.35]})
    whole = runs.action.copy()
    for k in (1, 2):
        runs.status[k], runs.action[k] = "NOT_FOUND", np.nan
    again = runs.retry()
    assert again.success.all() and again.action == pytest.approx(whole, rel=1e-9)
    assert runs.failed.sum() == 2 and np.isnan(runs.action[1])
    far = runs.retry(guess=lambda t: -3.0 * np.sin(np.pi * t / t[-1])[None])
    assert far.success.all() and (np.abs(far.action[1:3] - whole[1:3]) > 0.5).all()


def test_a_retry_sets_out_from_solved_neighbours(monkeypatch):
    runs = ao.sweep(PENDULUM, {"t1": [1.2, 1.25, 1.3]})
    whole = runs.action.copy()
    runs.status[1], runs.action[1] = "NOT_FOUND", np.nan
    monkeypatch.setattr(batch, "solve", lambda p, **_: replace(ao.solve(p), status=LOST))
    assert runs.retry().action == pytest.approx(whole, rel=1e-9)


def anharmonic():
    law = System(
        lambda q, v, t, *, w: v[0] ** 2 / 2 - w**2 * q[0] ** 2 / 2 - 0.2 * q[0] ** 4,
        ["x"],
        parameters={"w": 1.0},
    )
    return Problem(law, Event(0.0, [1.0]), Event(1.0, [0.5]))


@pytest.mark.long
def test_what_no_neighbour_leads_to_is_searched_for_as_solve_would():
    problem = anharmonic().replace(end=Event(3.0, [0.5]))
    runs = ao.sweep(problem, {("end", "x"): np.linspace(-3.0, 3.0, 13)})
    assert runs.success.all() and len(np.unique(runs.branch)) > 1
    assert "retry" not in repr(runs)


@pytest.mark.long
def test_what_lies_behind_a_degenerate_member_is_solved():
    law = System(
        lambda q, v, t, *, w: v[0] ** 2 / 2 - w**2 * q[0] ** 2 / 2, ["x"], parameters={"w": 0.9}
    )
    problem = Problem(law, Event(0.0, [0.3]), Event(np.pi, [1.0]))
    runs = ao.sweep(problem, {"w": [0.9, 1.0, 1.1]})
    assert runs.status.tolist() == ["SOLVED", "DEGENERATE", "SOLVED"]
    assert "1 not found: runs.retry()" in repr(runs)


@pytest.mark.quick("solve_near")
@pytest.mark.parametrize("name", ["solve", "solve_near"])
def test_an_unexpected_exception_loses_one_member_alone(name, monkeypatch):
    whole, find = ao.sweep(PENDULUM, {"t1": [1.2, 1.25, 1.3]}), getattr(batch, name)

    def fails(problem, *given, **named):
        if problem.end.t == 1.25:
            raise AssertionError("no iterate")
        return find(problem, *given, **named)

    monkeypatch.setattr(batch, name, fails)
    monkeypatch.setattr(batch, "_can_be_stacked", lambda *_: False)
    if name == "solve":  # which is asked last
        for room in (batch, continuation):
            monkeypatch.setattr(room, "solve_near", lambda p, *_: replace(ao.solve(p), status=LOST))
    runs = ao.sweep(PENDULUM, {"t1": [1.2, 1.25, 1.3]})
    assert runs.status.tolist() == ["SOLVED", "ERROR", "SOLVED"]
    assert runs.messages == {1: "AssertionError: no iterate"}
    assert runs.action[[0, 2]] == pytest.approx(whole.action[[0, 2]], rel=1e-9)


LOST = ao.Status.NOT_FOUND


@pytest.fixture(scope="module")
def holes():
    """A map that nothing was searched for in, kept with its paths or not."""
    over = {"t1": [1.0, 1.5], ("end", "x"): np.linspace(-3.0, 3.0, 12)}
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(budget, "FREE_BUDGET", 0)
        patched.setattr(budget.Budget, "note_found", lambda *_: None)
        runs = ao.sweep(anharmonic(), over)
        kept = ao.sweep(anharmonic(), over, keep_paths=True)
    for made in (runs, kept):
        for k in (2, 9):  # holes that have solved neighbours
            made.status.flat[k], made.action.flat[k] = "NOT_FOUND", np.nan
    assert runs.failed.sum() >= 2
    return runs, kept


@pytest.mark.long
@pytest.mark.parametrize(
    "pool", [ThreadPoolExecutor, pytest.param(spawned, marks=pytest.mark.slow)]
)
def test_a_retry_finds_the_same_bits_on_any_executor(holes, pool):
    for runs in holes:
        again = runs.retry()
        assert again.success.all() and not again.unsought.any()
        before = runs.success
        assert np.array_equal(again.action[before], runs.action[before])
        with pool(2) as workers:
            assert same(runs.retry(executor=workers), again)


@pytest.mark.long
def test_an_interrupted_retry_goes_on(holes, tmp_path, monkeypatch):
    from actionopt.families.sweeps import runs as module

    monkeypatch.setattr(module, "RETRY_MEMBERS", 1)
    runs, _ = holes
    whole, told = runs.retry(), []
    part = runs.retry(resume=tmp_path / "it", progress=Stop(1))
    assert part.failed.sum() == runs.failed.sum() - 1
    again = runs.retry(resume=tmp_path / "it", progress=lambda *x: told.append(x))
    assert same(again, whole) and told[-1][1:] == (
        runs.failed.sum(),
        runs.failed.sum(),
        {"failed": 0},
    )
    worked = []
    monkeypatch.setattr(module, "work", lambda *given: worked.append(given))
    assert same(runs.retry(resume=tmp_path / "it"), whole) and not worked
    with pytest.raises(ValueError, match="whose known is"):
        whole.retry(resume=tmp_path / "it")
    with pytest.raises(ValueError, match="a guess that can be pickled"):
        runs.retry(guess=lambda t: t, resume=tmp_path / "other")


# -- interruptions, files -------------------------------------------------------------------------


class Stop:
    """Interrupts after some tasks."""

    def __init__(self, tasks, error=KeyboardInterrupt):
        self.left, self.error = tasks, error

    def __call__(self, stage, done, total, detail):
        self.left -= 1
        if self.left == 0:
            raise self.error


@pytest.mark.long
@pytest.mark.parametrize("pool", [None, *slow(ThreadPoolExecutor)])
def test_an_interruption_keeps_what_is_done(serial, short, pool, tmp_path):
    pool = pool and pool(1)
    given = {"executor": pool, "record": "index", "resume": tmp_path / "it"}
    runs = ao.sweep(PENDULUM, OVER, progress=Stop(2), **given)
    assert runs.interrupted
    done = runs.status != "UNREACHED"
    assert done.sum() >= 10 and np.array_equal(runs.action[done], serial.action[done])
    assert not runs.failed.any() and (runs.branch[~done] == -1).all()
    assert runs.stats["tasks"] == -(-done.sum() // 5)
    found = ao.sweep(PENDULUM, OVER, **given)
    assert np.array_equal(found.action, serial.action)
    if pool:
        pool.shutdown()


@pytest.mark.long
def test_what_is_finished_is_not_solved_again(serial, short, tmp_path, monkeypatch):
    given = {"record": "index", "keep_paths": True, "resume": tmp_path / "it"}
    with pytest.raises(ZeroDivisionError) as error:
        ao.sweep(PENDULUM, OVER, progress=Stop(2, ZeroDivisionError), **given)
    assert "the same call goes on" in error.value.__notes__[0]
    worked, work = [], module.work
    monkeypatch.setattr(module, "work", lambda *given: worked.append(given[1]) or work(*given))
    told = []
    runs = ao.sweep(PENDULUM, OVER, progress=lambda *x: told.append(x), **given)
    assert same(runs, serial) and len(worked) == 3 and told[-1] == ("sweep", 24, 24, {"failed": 0})
    monkeypatch.setattr(module, "solve", None)
    monkeypatch.setattr(module, "walk", None)
    assert same(ao.sweep(PENDULUM, OVER, **given), serial) and len(worked) == 3


@pytest.mark.slow
def test_tasks_that_are_missing_in_the_middle_are_found_alike(serial, short, tmp_path):
    """What is finished behind them must not be where their seeds come from."""
    given = {"record": "index", "keep_paths": True}
    ao.sweep(PENDULUM, OVER, resume=tmp_path / "all", **given)
    question = module.question_of(module.Grid.of(PENDULUM, OVER, False), 1e-8, True, True)
    records = module.Journal(tmp_path / "all", question).records
    some = module.Journal(tmp_path / "some", question)
    tasks = [record for record in records if "task" in record]
    for record in (records[0], tasks[3], tasks[1]):
        some.append(record)
    assert same(ao.sweep(PENDULUM, OVER, resume=tmp_path / "some", **given), serial)


def test_a_file_of_another_question_is_refused(short, tmp_path):
    file = tmp_path / "it"
    ao.sweep(PENDULUM, {"t1": [1.0, 1.1]}, resume=file)
    for changed, what in (
        ({"tol": 1e-6}, "tol is 1e-08, not 1e-06"),
        ({"over": {"t1": [1.0, 1.2]}}, "over is"),
        ({"over": {"g": [1.0, 1.1]}}, "over is"),
        ({"record": "index"}, "record is"),
        ({"keep_paths": True}, "keep_paths is false, not true"),
        ({"problem": PENDULUM.replace(parameters={"l": 2.0})}, "parameters is"),
        ({"problem": PENDULUM.replace(start=PENDULUM.start.shifted([0.1]))}, "start is"),
        ({"problem": scenes.get("oscillator").problem}, "law is"),
    ):
        given = {"problem": PENDULUM, "over": {"t1": [1.0, 1.1]}} | changed
        with pytest.raises(ValueError, match=f"whose {what}.*; give another file"):
            ao.sweep(**given, resume=file)


WAITS = """
    import sys
    import time
    import numpy as np
    import actionopt as ao
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context
    from actionopt.families.sweeps import sweep as module
    from actionopt.scenes import get

    def slow(*given):
        time.sleep(3.0)
        return WORK(*given)

    WORK = module.work
    module.TASK_SECONDS, module.MEMBER_SECONDS, module.UNKNOWN_SECONDS = 5.5, 1.0, 0.0
    if __name__ == "__main__":
        module.work = slow
        over = {"g": np.linspace(9.0, 10.0, 12), "t1": np.linspace(0.7, 1.2, 6)}
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
            tell = lambda *said: print(said[1:3], flush=True)
            runs = ao.sweep(get("pendulum").problem, over, executor=pool, progress=tell)
        print(runs.interrupted, runs.success.sum(), runs.failed.sum(), flush=True)
"""


@pytest.mark.slow
@pytest.mark.parametrize("times", [1, 2])
def test_ctrl_c_keeps_the_tasks_that_have_begun_or_leaves_them(times, tmp_path):
    (tmp_path / "it.py").write_text(textwrap.dedent(WAITS))
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    given = {"start_new_session": True, "cwd": tmp_path, **pipes}
    given["env"] = os.environ | {"PYTHONPATH": str(Path(ao.__file__).parents[1])}
    with subprocess.Popen([sys.executable, "it.py"], **given) as process:
        assert process.stdout.readline() == "(5, 72)\n"  # the next ones have begun
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does
        said = process.stderr.readline()  # the pool fetches more tasks than it has processes
        assert re.match(r"interrupted: waiting for (a task|\d tasks) that ha(s|ve) begun;", said)
        since = time.monotonic()
        for _ in range(times - 1):
            os.killpg(process.pid, signal.SIGINT)
        out, err = process.communicate(timeout=60)
    waited = time.monotonic() - since
    assert process.returncode == 0 and "Traceback" not in err
    interrupted, kept, failed = out.splitlines()[-1].split()
    assert (interrupted, failed) == ("True", "0")
    if times == 1:
        assert 5 < int(kept) < 72 and waited > 1.0
    else:
        assert kept == "5" and waited < 2.0


@pytest.mark.parametrize("place", ["seed", "together", "alone", "retry"])
def test_what_the_handler_of_a_signal_raises_is_no_failure_of_a_member(place, monkeypatch):
    def late(number, frame):
        raise TimeoutError("late")

    def ring(*given, **named):
        signal.raise_signal(signal.SIGTERM)

    over = {"t1": np.linspace(0.5, 1.0, 24)}
    runs = ao.sweep(PENDULUM, over) if place == "retry" else None
    if place == "seed":
        monkeypatch.setattr(module, "solve", ring)
    else:
        alone = place == "alone"  # since it fails together
        together = (lambda *_: 1 / 0) if alone else ring
        monkeypatch.setattr(batch._Members, "_solve_together", together)
        monkeypatch.setattr(batch, "member", ring if alone else batch.member)
    before = signal.signal(signal.SIGTERM, late)
    try:
        with pytest.raises(TimeoutError, match="late"):
            if runs is None:
                ao.sweep(PENDULUM, over)
            else:
                runs.status[3:19] = "NOT_FOUND"
                runs.retry()
    finally:
        signal.signal(signal.SIGTERM, before)


# -- what is asked --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"over": {}}, "expected a mapping of names to values"),
        ({"over": ["t1"]}, "expected a mapping of names to values"),
        ({"over": {"h": [1.0]}}, "the name of a parameter that is one number"),
        ({"over": {("end", "phi"): [1.0]}}, "a coordinate that the event gives"),
        ({"over": {"t1": []}}, "a row of finite values of 't1'"),
        ({"over": {"t1": [1.0, np.nan]}}, "a row of finite values of 't1'"),
        ({"over": {"t1": np.ones((2, 2))}}, "a row of finite values of 't1'"),
        ({"over": {"t1": ["one"]}}, "for the values of 't1'"),
        ({"tol": 1.0}, "expected tol between"),
        ({"record": "kind"}, "to record out of index, found 'kind'"),
        ({"record": 3}, "to record out of index, found 3"),
        ({"executor": 2}, "expected a concurrent.futures.Executor that is made, found 2"),
        ({"executor": ThreadPoolExecutor}, "expected a concurrent.futures.Executor that is made"),
        ({"resume": "."}, "expected the name of a file, found the folder '.'"),
        ({"resume": 3}, "expected the name of a file, found 3"),
        ({"progress": 2}, r"expected progress\(stage, done, total, detail\)"),
        ({"problem": PENDULUM.system}, r"expected a Problem\("),
    ],
)
def test_what_makes_no_sense_is_refused_before_anything_is_solved(changed, message, monkeypatch):
    monkeypatch.setattr(module, "solve", None)
    with pytest.raises(ValueError, match=message):
        ao.sweep(**{"problem": PENDULUM, "over": {"t1": [1.0]}} | changed)


def test_a_closed_path_has_no_end_of_its_own():
    problem = PENDULUM.replace(start=Event(0.0, [None]), end=Periodic(1.0))
    with pytest.raises(ValueError, match="this one closes on the start"):
        ao.sweep(problem, {("end", "theta"): [0.0]})


def test_answers_are_shown_and_pickled(serial):
    assert repr(serial) == "Runs(pendulum over g, t1: 24 of 24 solved, branches 1)"
    again = pickle.loads(pickle.dumps(serial))
    assert same(again, serial) and again.solution(0, 0).action == serial.solution(0, 0).action


# -- sheets, datasets -----------------------------------------------------------------------------


@pytest.mark.slow
def test_a_change_of_index_is_a_branch_of_its_own():
    """An oscillator past half a period: the action is no longer least."""
    spring = systems.oscillator()
    problem = Problem(spring, Event(0.0, [0.0]), Event(1.0, [1.0]))
    t1 = np.linspace(0.5, 8.0, 40)
    runs = ao.sweep(problem, {"t1": t1}, record="index")
    assert runs.success.all()
    assert np.array_equal(runs.index, np.floor(t1 / np.pi))
    assert np.array_equal(runs.branch, runs.index)
    assert runs.action == pytest.approx(0.5 / np.tan(t1), rel=1e-6)


@pytest.mark.long
def test_a_dataset_has_names_units_and_what_was_asked(serial):
    pytest.importorskip("xarray")
    data = serial.to_xarray({"t1": "s", "action": "J s"})
    assert data.action.dims == ("g", "t1") and data.momenta.dims == (
        "g",
        "t1",
        "event",
        "coordinate",
    )
    assert data.action.sel(g=9.0, t1=0.7).item() == serial.action[0, 0]
    assert data.momenta.sel(event="end", coordinate="theta").shape == (4, 6)
    assert data.action.attrs["units"] == "J s" and data.t1.attrs["units"] == "s"
    assert data.error.attrs["units"] == "1" and data.index.attrs["long_name"] == "Morse index"
    assert data.attrs["system"] == "pendulum" and data.attrs["parameter l"] == 1.0
    assert "parameter g" not in data.attrs
    with pytest.raises(ValueError, match=r"expected units of some of action, .* one of 'nothing'"):
        serial.to_xarray({"nothing": "m"})


def test_a_sweep_out_of_time_says_how_to_go_on():
    spring = System(
        lambda q, v, t, *, k: v[0] ** 2 / 2 - k * q[0] ** 2 / 2, ["x"], parameters={"k": 1.0}
    )
    problem = Problem(spring, Event(0.0, [0.0]), Event(1.0, [1.0]))
    runs = ao.sweep(problem, {"k": np.linspace(0.1, 5.0, 9000)}, seconds=1e-3)
    assert runs.remainder == int(np.isnan(runs.action).sum()) > 0
    assert "interrupted" in repr(runs) and "resume=" in repr(runs)
    assert runs.retry().retried == "partly"


@pytest.mark.long
def test_a_sweep_moves_waypoints_and_the_law_of_a_leg():
    """Slopes are those of the action, and members solutions of their own."""
    air = systems.particle("x y")
    glass = System(lambda q, v, t, *, n: n**2 * (v @ v) / 2, ["x", "y"], parameters={"n": 1.5})
    surface = Event(None, [None, 0.0])
    media: Any = [air, glass]
    ray = Problem(media, Event(0, [0, 1]), Event(1, [2, -1]), through=[surface])
    h = 1e-3
    runs = ao.sweep(ray, {"n": [1.5 - h, 1.5, 1.5 + h], ("end", "x"): [1.0, 2.0]}, record="index")
    assert runs.success.all() and not runs.index.any() and runs.branch.max() == 0
    S = runs.action
    assert runs.slopes[1, :, 0] == pytest.approx((S[2] - S[0]) / (2 * h), abs=1e-5)
    assert runs.slopes[1, 1, 1] == pytest.approx(runs.momenta[1, 1, 1, 0])
    found = runs.solution(1, 1)
    assert found.action == pytest.approx(ao.solve(ray).action, abs=1e-9)
    steps = System(
        lambda q, v, t: v[0] ** 2 / 2 - np.cosh(q[0]), ["x"], integral=lambda q, v, t: q[0]
    )
    ends = Event(0, [0]), Event(2, [1])
    problem = Problem(steps, *ends, through=[Event(0.8, [0.4])], integral=0.9)
    grid = {("through", 0, "t"): [0.7, 0.8], ("integral", 0): [0.9 - h, 0.9, 0.9 + h]}
    runs = ao.sweep(problem, grid)
    assert runs.success.all()
    slope = (runs.action[1, 2] - runs.action[1, 0]) / (2 * h)
    assert runs.slopes[1, 1, 1] == pytest.approx(slope, abs=1e-5)
    assert runs.slopes[1, 1, 1] == pytest.approx(-ao.solve(problem).integral_multipliers[0])


def test_a_sweep_is_read_back_from_its_file(tmp_path):
    problem = ao.Problem(systems.oscillator(), ao.Event(0.0, [0.0]), ao.Event(1.0, [1.0]))
    over, file = {"t1": [1.0, 2.0], ("end", "x"): [0.5, 1.0, 1.5]}, tmp_path / "runs.npz"
    runs = ao.sweep(problem, over, tol=1e-6)
    runs.save(file)
    again = Runs.read(file, Grid.of(problem, over, False), 1e-6, False)
    np.testing.assert_array_equal(again.action, runs.action)
    np.testing.assert_array_equal(again.status, runs.status)
    with pytest.raises(FileNotFoundError, match="found none at"):
        Runs.read(tmp_path / "none.npz", runs.grid, 1e-6, False)
    with pytest.raises(ValueError, match="found others"):
        Runs.read(file, Grid.of(problem, over | {"t1": [1.0, 2.5]}, False), 1e-6, False)
    with pytest.raises(ValueError, match=r"of shape \(3,\)"):
        Runs.read(file, Grid.of(problem, over | {"t1": [1.0, 2.0, 2.5]}, False), 1e-6, False)
    with pytest.raises(ValueError, match="with 'index'"):
        Runs.read(file, runs.grid, 1e-6, True)
    ends = ao.Event(0.0, [0.0]), ao.Event(None, [1.0])
    loose = ao.Problem(systems.oscillator(), *ends, energy=1.0)
    with pytest.raises(ValueError, match="found more to be found"):
        Runs.read(file, Grid.of(loose, {("end", "x"): [0.5]}, False), 1e-6, False)


def test_a_guess_that_no_process_can_be_sent_is_refused():
    check_sent(np.cos)
    with pytest.raises(ValueError, match="expected a guess that can be pickled"):
        check_sent(lambda t: t)


def test_every_seed_is_sown_once():
    asked, fields = [], np.linspace(0, 8, min(module.SEEDS, 9)).astype(int)
    grid = SimpleNamespace(order=np.arange(40)[::-1])
    run = SimpleNamespace(tasks=9, grid=grid, length=4, sown=0)
    run._nearest = lambda member: asked.append(int(member[0]))
    for task in range(9):
        module._SweepRun._sow(run, task)
    assert asked == (39 - 4 * fields).tolist() and run.sown == fields.size


def test_answers_of_members_that_are_known_are_left_out():
    path = ao.Path.interpolate(lambda t: t[None], ao.Mesh.uniform(0, 1, 2, 3))
    members = np.array([3, 5, 8])
    answers = {"members": members, "action": np.array([1.0, 2.0, 3.0])}
    answers |= PackedPaths.of(members[1:], [path, path]).pack("kept")
    found = _without(answers, np.array([5]))
    assert (found["members"].tolist(), found["action"].tolist()) == ([3, 8], [1.0, 3.0])
    assert PackedPaths.unpack(found, "kept").members.tolist() == [8]
