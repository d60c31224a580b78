"""Functions at many times at once: memory that is kept, and memory that is not."""

from copy import deepcopy

import casadi as ca
import numpy as np
import pytest
from helpers import at_once, same_bits

from actionopt.mechanics.laws import columns, compiled
from actionopt.mechanics.laws.compiled import PART_OPERATIONS, PARTED, Pointwise
from actionopt.mechanics.system import System


def lagrangian(q, v, t, *, k):
    return (v @ v) / 2 - k * np.cos(q[0] * q[1]) + np.sin(t) * q[1] * v[0]


def new():
    return System(lagrangian, ["x", "y"], parameters={"k": 2.0})


def kept(function):
    """Return the numbers in the memory that this thread keeps."""
    entries = function._memory.ready.values()
    return sum(x.size for inputs, outputs, *_ in entries for x in (*inputs, *outputs))


def states(count):
    random = np.random.default_rng(count)
    return random.normal(size=(2, count)), random.normal(size=(2, count)), random.normal(size=count)


@pytest.mark.quick("energy")
@pytest.mark.parametrize("name", ["first", "energy", "second"])
def test_memory_of_many_numbers_of_times_is_bounded(monkeypatch, name):
    monkeypatch.setattr(compiled, "KEPT", 40_000)
    system = new()
    function, p = system.pointwise(name), system.table.pack(system.parameters)
    asked = 0
    for count in range(1, 200):
        q, v, t = states(count)
        values = function(q.T, v.T, t[:, None], p)
        asked += q.size + v.size + t.size + sum(x.size for x in values)
        assert kept(function) <= compiled.KEPT
        assert len(function._memory.ready) <= compiled.KEPT // compiled.OVERHEAD
        assert count in function._memory.ready  # the latest is there to be used again
    assert asked > 2 * compiled.KEPT


@pytest.mark.long
def test_parts_give_what_the_whole_gives(monkeypatch):
    q, v, t = states(1000)
    arguments = q.T, v.T, t[:, None], np.array([[2.0]])
    names = ("value", "first", "second", "energy")
    whole = {name: new().pointwise(name)(*arguments) for name in names}
    for size in (1, 17, 120):
        monkeypatch.setattr(compiled, "AT_ONCE", size)
        system = new()
        for name in names:
            function = system.pointwise(name)
            for part, all_at_once in zip(function(*arguments), whole[name], strict=True):
                same_bits(part, all_at_once, because="each time is evaluated by itself")
            numbers = sum(x.shape[1] for x in arguments) + sum(x.shape[1] for x in whole[name])
            assert list(function._memory.ready) == [max(size // numbers, 1)]

    function = system.pointwise("first")
    once = function(q.T, v.T, t[:1, None], arguments[3])[0].copy()  # one time for all
    (repeated, *_) = function(q.T, v.T, t[:1, None].repeat(1000, 0), arguments[3])
    same_bits(once, repeated, because="each time is evaluated by itself")


def test_calls_for_some_times_give_what_one_for_all_gives(monkeypatch):
    q, v, t = states(23)
    arguments = q.T, v.T, t[:, None], np.array([[2.0]])
    whole = [x.copy() for x in new().pointwise("second")(*arguments)]
    function = new().pointwise("second")
    monkeypatch.setattr(compiled, "MAP_NUMBERS", 5 * function._sizes[3])
    for part, all_at_once in zip(function(*arguments), whole, strict=True):
        same_bits(part, all_at_once, because="each time is evaluated by itself")
    *_, mapped = function._memory.ready[23]
    assert mapped.size_in(0) == (2, 5)  # not 23: its sparsity takes as much memory as the numbers


def test_very_many_times_give_what_few_give():
    q, v, t = states(compiled.AT_ONCE // 4)
    arguments = [q.T, v.T, t[:, None]], np.array([[2.0]])
    few = slice(-1000, None)
    for name in ("value", "slopes", "first", "second"):
        function = new().pointwise(name)
        many = function(*arguments[0], arguments[1])
        assert not function._memory.ready  # not CasADi's
        alone = function(*(x[few] for x in arguments[0]), arguments[1])
        for part, whole in zip(alone, many, strict=True):
            np.testing.assert_allclose(whole[few], part, rtol=1e-13, atol=1e-13)


def test_what_numpy_does_not_know_is_left_to_casadi(monkeypatch):
    def unknown(function):
        raise ValueError

    monkeypatch.setattr(columns, "Columns", unknown)
    q, v, t = states(compiled.AT_ONCE // 4)
    function = new().pointwise("value")
    assert function(q.T, v.T, t[:, None], np.array([[2.0]]))[0].shape == (len(t), 1)
    assert function._memory.ready


def test_a_copy_has_memory_of_its_own():
    function, (q, v, t) = new().pointwise("first"), states(5)
    arguments = q.T, v.T, t[:, None], np.array([[2.0]])
    values = function(*arguments)
    copied = deepcopy(function)(*arguments)
    for x, y in zip(values, copied, strict=True):
        assert np.array_equal(x, y) and not np.shares_memory(x, y)


def test_no_times():
    system = new()
    assert system.momentum(np.zeros((2, 0)), np.zeros((2, 0)), 0.0).shape == (2, 0)


@at_once("count", [1, PARTED - 1, PARTED, PARTED + 1, 1000])
def test_operations_written_out_for_some_times_are_the_same_to_the_last_bit(count):
    q, p = ca.SX.sym("q", 2), ca.SX.sym("p")
    f = ca.Function("f", [q, p], [ca.jacobian(ca.sin(p * q[0]) / q[1] + q[1] ** 3, q)])
    points = np.random.default_rng(0).random((count, 2)) + 0.1
    (found,) = Pointwise(f)(points, np.array([[0.7]]))
    alone = Pointwise(f)  # at one time at once, which writes nothing out
    one_by_one = [alone(x[None], np.array([[0.7]]))[0][0].copy() for x in points]
    same_bits(one_by_one, found, because="the operations are the same, those of numpy as well")
    assert found.shape == (count, 2)


def test_what_is_evaluated_often_is_written_out_with_the_same_bits(monkeypatch):
    q, v, t = states(50)
    arguments = q.T, v.T, t[:, None], np.array([[2.0]])
    monkeypatch.setattr(compiled, "OFTEN", 99)
    function = new().pointwise("first")
    first = [x.copy() for x in function(*arguments)]
    assert "_part" not in vars(function)
    for part, before in zip(function(*arguments), first, strict=True):  # the hundredth evaluation
        same_bits(part, before, because="the operations are the same")
    assert "_part" in vars(function)


def test_long_lists_of_operations_are_not_made_longer():
    x = ca.SX.sym("x")
    y = x
    for _ in range(PART_OPERATIONS):
        y = ca.sin(y) + x
    function, times = Pointwise(ca.Function("f", [x], [y]))._part
    assert times == 1 and function.n_instructions() > PART_OPERATIONS
