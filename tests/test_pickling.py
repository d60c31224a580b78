"""Systems, problems and solutions carried to other processes, where nothing is derived again."""

import copy
import pickle
import subprocess
import sys
import textwrap

import numpy as np
import pytest
from helpers import a_quarter, solved

import actionopt as ao
from actionopt import Event, Problem, System, scenes
from actionopt.mechanics.laws import pickling
from actionopt.mechanics.laws.laws import Laws

DERIVED = ("first", "second", "value", "energy", "motion")


@pytest.fixture
def elsewhere(monkeypatch):
    """Return a function that loads as another process does: nothing is known there."""

    def load(data):
        with monkeypatch.context() as patched:
            patched.setattr(pickling, "_KNOWN", {})
            return pickle.loads(data)

    return load


@pytest.mark.parametrize("name", a_quarter(scenes.SCENES, 3))
def test_what_is_derived_of_a_loaded_law_is_the_same_to_the_last_operation(name, elsewhere):
    own = scenes.get(name).problem.system
    system = System.__new__(System)
    system._set(own.symbols, (own.L, own.f, own.Q), own.coordinates, own.table, own.name, "")
    loaded = elsewhere(pickle.dumps(system))  # nothing is derived as yet
    assert loaded is not system and not loaded.derived
    assert loaded.digest == system.digest
    assert vars(loaded.structure) == vars(system.structure) and loaded.r == system.r
    functions = [x for x in DERIVED if system.order == 1 or x in ("value", "first", "second")]
    if system.m:
        functions += ["constraint", "constraint_jacobian", "constraint_rate"]
        functions += ["constraint_curvature"]
    if system.Q.numel():
        functions += ["force", "force_jacobian"]
    for function in functions:
        ours, theirs = (x.pointwise(function).function for x in (system, loaded))
        assert ours.serialize() == theirs.serialize(), function


def test_it_is_made_once_in_a_process_and_derives_nothing_again(elsewhere, monkeypatch):
    own = System(lambda q, v, t, *, k: (v[0] ** 2 - k * abs(q[0])) / 2, ["x"], parameters={"k": 2})
    first = pickle.dumps(own)
    assert pickle.loads(first) is own
    problem = Problem(own, Event(0.0, [1.0]), Event(0.5, [0.8]))
    solution = ao.solve(problem)
    assert solution.morse_index == 0
    later = pickle.dumps(problem)
    loaded = elsewhere(later).system
    assert loaded is not own and set(loaded.derived) == set(own.derived)
    for name in (x for x in dir(Laws) if x.startswith("_build")):
        monkeypatch.delattr(Laws, name)
    again = ao.solve(Problem(loaded, problem.start, problem.end))
    assert again.action == solution.action and again.morse_index == 0
    # What another pickle of the same law has derived is added to the one that is there.
    monkeypatch.setattr(pickling, "_KNOWN", {})
    early = pickle.loads(first)
    assert not early.derived
    assert pickle.loads(later).system is early and set(early.derived) == set(own.derived)


def test_a_loaded_system_says_where_its_law_came_from(elsewhere):
    system = System(lambda q, v, t: v[0] ** 2 / 2, ["x"], name="free")
    assert repr(system) == "System(free: x)"
    said = repr(elsewhere(pickle.dumps(system)))
    assert said.startswith("System(free: x; loaded, its law from ") and "<lambda>" in said
    assert f"{__file__}, line " in said
    assert repr(elsewhere(pickle.dumps(elsewhere(pickle.dumps(system))))) == said

    class Law:
        def __call__(self, q, v, t):
            return v[0] ** 2

    assert "an object of the type" in System(Law(), ["x"]).source


@pytest.mark.long
def test_families_travel():
    problem = scenes.get("oscillator", duration=1.0).problem
    for copied in (
        pickle.loads(pickle.dumps(ao.trace(problem, "t1", 1.2))).solution(-1),
        pickle.loads(pickle.dumps(ao.sweep(problem, {"t1": [1.0, 1.2]}))).solution(-1),
    ):
        assert copied.problem.end.t == 1.2 and copied.success


def test_the_digest_tells_laws_apart():
    def made(c=1.0, name="x", power=2):
        return System(lambda q, v, t, *, c: c * v[0] ** power, [name], parameters={"c": c}).digest

    found = [made(), made(c=1.0 + 2e-16), made(name="y"), made(power=3)]
    assert made() == found[0] and len(set(found)) == 4


@pytest.mark.long
@pytest.mark.parametrize("name", ["pendulum", "rod_pendulum", "figure_eight", "turning_wire"])
def test_a_solution_is_the_same_elsewhere(name, elsewhere):
    solution = solved(name)
    assert solution.compare().agrees  # what that derives goes along, or is derived again
    loaded = elsewhere(pickle.dumps(solution))
    assert loaded.problem.system is not solution.problem.system
    assert loaded.status is solution.status and loaded.stats == solution.stats
    for attribute in ("action", "error", "morse_index", "velocity_error"):
        assert getattr(loaded, attribute) == getattr(solution, attribute), attribute
    for a, b in (
        (loaded.path.values, solution.path.values),
        (loaded.mesh.boundaries, solution.mesh.boundaries),
        (loaded.momenta, solution.momenta),
        (loaded.start.v, solution.start.v),
        (loaded.lam, solution.lam),
        (loaded.problem.packed, solution.problem.packed),
    ):
        assert np.array_equal(a, b, equal_nan=True)
    assert not loaded.path.values.flags.writeable and not loaded.mesh.since.flags.writeable
    assert loaded.discrete.path is loaded.path


def test_ends_and_failures_travel(elsewhere, tmp_path):
    with pytest.raises(ao.SolveError) as failed:
        ao.solve(solved("pendulum").problem, tol=1e-8, seconds=1e-9)
    error = elsewhere(pickle.dumps(failed.value))
    assert str(error) == str(failed.value)
    assert error.solution.status is failed.value.solution.status
    start, end = Event(0.0, [0.1]), ao.Periodic(2.0, [6.5])
    periodic = solved("pendulum").problem.replace(start=start, end=end)
    end = elsewhere(pickle.dumps(periodic)).end
    assert end.q == periodic.end.q == (6.6,) and end.advance == periodic.end.advance
    state = elsewhere(pickle.dumps(ao.State(0.0, [1.0], [2.0])))
    assert state.v == 2.0 and not state.v.flags.writeable
    solved("pendulum").save(tmp_path / "it.npz")
    detached = pickle.loads(pickle.dumps(ao.load(tmp_path / "it.npz")))
    assert detached.action == solved("pendulum").action
    assert np.array_equal(detached.momenta, solved("pendulum").momenta)
    assert copy.deepcopy(periodic).system is copy.copy(periodic.system) is periodic.system


NOTEBOOK = """
    import multiprocessing, pickle
    from concurrent.futures import ProcessPoolExecutor
    import actionopt as ao

    k = 2.0
    spring = ao.System(lambda q, v, t: (v[0] ** 2 - k * q[0] ** 2) / 2, ["x"], name="spring")
    problem = ao.Problem(spring, ao.Event(0.0, [1.0]), ao.Event(1.0, [0.5]))
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=spawn) as pool:
        there = pool.submit(ao.solve, problem).result()
    here = ao.solve(problem)
    assert there.action == here.action and there.momenta[0] == here.momenta[0]
    assert there.problem.system is spring
    assert "cloudpickle" not in str(pickle.dumps(problem))
    print("as here")
"""


@pytest.mark.long
def test_a_lambda_of_a_notebook_reaches_a_process_that_is_spawned():
    """A process that runs a cell has no file that another one could import."""
    command = [sys.executable, "-c", textwrap.dedent(NOTEBOOK)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.stdout == "as here\n", done.stderr


def test_a_conserved_quantity_travels():
    plane = System(lambda q, v, t: v @ v / 2, ["x", "y"])
    turning = pickle.loads(pickle.dumps(ao.noether(plane, lambda q, t: [q[1], -q[0]])))
    assert turning(np.array([1.0, 2.0]), np.array([3.0, -1.0]), 0.0) == 2.0 * 3.0 - 1.0 * -1.0
