"""From one member of a family to another without leaving the kind of path."""

from types import SimpleNamespace

import numpy as np
import pytest

import actionopt as ao
from actionopt import scenes
from actionopt.families import walk as module
from actionopt.families.vary import lead_to, with_values
from actionopt.families.walk import walk

PENDULUM = scenes.get("pendulum").problem
START, END = {"t1": 0.4, ("end", "theta"): -2.0}, {"t1": 1.94, ("end", "theta"): -1.2}


def one_by_one(count):
    """Return the path at the end by very many steps."""
    path = ao.solve(with_values(PENDULUM, START)).path
    for part in np.linspace(0, 1, count + 1)[1:]:
        problem = with_values(PENDULUM, {x: (1 - part) * START[x] + part * END[x] for x in END})
        found = ao.solve(problem, guess=lead_to(path, problem))
        path = found.path
    return found


@pytest.mark.slow
def test_it_stays_with_its_kind_of_path():
    """Half a period further on, one step leads to another: a saddle."""
    first, far = ao.solve(with_values(PENDULUM, START)).path, one_by_one(60)
    assert far.morse_index == 0
    t = np.linspace(0, 1.94, 50)
    for distance in (12, 51):
        path = walk(PENDULUM, first, START, END, distance, 1e-8)
        assert path(t) == pytest.approx(far(t), abs=1e-6)
    assert not np.allclose(walk(PENDULUM, first, START, END, 1, 1e-8)(t), far(t), atol=0.1)
    assert walk(PENDULUM, first, START, START, 0, 1e-8) is first


def test_where_there_is_no_way_there_is_no_path(monkeypatch):
    first = ao.solve(PENDULUM).path
    assert walk(PENDULUM, first, {"t1": 1.0}, {"t1": -1.0}, 3, 1e-8) is None
    monkeypatch.setattr(module, "_alike", lambda a, b: False)
    assert walk(PENDULUM, first, {"t1": 1.0}, {"t1": 1.1}, 99, 1e-8) is not None  # the last of them


def test_twice_as_many_steps_come_to_the_same(monkeypatch):
    speeds = {2: 0.0, 4: 1.0, 8: 2.0, 16: 2.0 + 1e-4, 32: 3.0}

    def steps(problem, path, start, end, count, tol):
        return SimpleNamespace(path=count, momenta=([speeds[count]], [-1.0])), count == straight

    monkeypatch.setattr(module, "_steps", steps)
    first, straight = ao.solve(PENDULUM).path, None
    assert walk(PENDULUM, first, START, END, 99, 1e-8) == 8
    straight = 4  # each of its steps goes on as the last
    assert walk(PENDULUM, first, START, END, 99, 1e-8) == 4


def test_a_path_is_led_to_other_ends():
    problem = with_values(PENDULUM, {"t1": 2.0, ("start", "theta"): 1.0, ("end", "theta"): -3.0})
    first = ao.solve(PENDULUM).path
    path = lead_to(first, problem)
    assert path.mesh.boundaries[-1] == 2.0
    assert path([0.0, 2.0])[0] == pytest.approx([1.0, -3.0])
    shear = path(np.array([0.6])) - first(np.array([0.3]))
    assert shear[0, 0] == pytest.approx(0.7 * (1.0 - first(0.0)[0]) + 0.3 * (-3.0 - first(1.0)[0]))


def test_a_walk_of_no_step_stays_and_one_of_a_step_arrives():
    spring = ao.System(lambda q, v, t, *, k: (v @ v - k * q @ q) / 2, ["x"], parameters={"k": 1.0})
    problem = ao.Problem(spring, ao.Event(0.0, [0.0]), ao.Event(1.0, [1.0]))
    path = ao.solve(problem).path
    assert walk(problem, path, {"k": 1.0}, {"k": 1.0}, 0, 1e-8) is path
    there = walk(problem, path, {"k": 1.0}, {"k": 4.0}, 1, 1e-8)
    assert there(0.5)[0] == pytest.approx(np.sin(1.0) / np.sin(2.0), abs=1e-8)
