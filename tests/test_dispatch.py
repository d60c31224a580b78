"""Tasks given to an executor, and what is kept of them when they are interrupted."""

from concurrent.futures import Future, ThreadPoolExecutor
from threading import Timer
from time import perf_counter, sleep
from types import SimpleNamespace

import pytest

from actionopt.families.sweeps.dispatch import _wait, dispatch
from actionopt.tools.watch import TimeUp, check_time, time_limit


class Begun(Future):
    """A task that is done as soon as it is waited for: no clock decides when."""

    def exception(self, timeout=None):
        if not self.done():
            self.finish()
        return super().exception(timeout)


class Pool:
    """An executor: the first task is done, two more when waited for, the others never."""

    def __init__(self):
        self.said = []
        self._processes = {7: SimpleNamespace(terminate=lambda: self.said.append("terminated"))}
        self.futures = []

    def submit(self, work, *given):
        future = Begun() if len(self.futures) in (1, 2) else Future()
        self.futures.append(future)
        if len(self.futures) <= 3:
            future.set_running_or_notify_cancel()
            future.finish = lambda: self.finish(future, work, *given)
        if len(self.futures) == 1:
            Timer(0.03, future.finish).start()
        return future

    def finish(self, future, work, *given):
        try:
            future.set_result(work(*given))
        except ArithmeticError as error:
            future.set_exception(error)

    def shutdown(self, **given):
        self.said.append(given)
        self.futures[-1].cancel()


def double(number):
    return 2 * number


TASKS = [(k, (10 + k,)) for k in range(5)]


@pytest.mark.parametrize("threads", [0, 1, 2])
def test_each_task_is_done_once(threads):
    done = []
    pool = ThreadPoolExecutor(threads) if threads else None
    dispatch(double, TASKS, pool, lambda *answer: done.append(answer))
    assert sorted(done) == [(k, 20 + 2 * k) for k in range(5)]


@pytest.mark.parametrize("times", [1, 2])
def test_what_has_begun_is_waited_for_unless_it_is_interrupted_again(times, capsys):
    pool, done = Pool(), []

    def enter(task, answers):
        if len(done) < times and done.count("no") < times:
            done.append("no")
            raise KeyboardInterrupt
        done.append((task, answers))

    with pytest.raises(KeyboardInterrupt):
        dispatch(double, TASKS, pool, enter)
    assert "interrupted: waiting for 2 tasks that have begun" in capsys.readouterr().err
    assert all(future.cancelled() for future in pool.futures[3:])
    if times == 1:  # the answer at hand arrives once more
        assert done == ["no", (0, 20), (1, 22), (2, 24)] and not pool.said
    else:
        assert done == ["no", "no"]
        assert pool.said == [{"wait": False, "cancel_futures": True}, "terminated"]


def test_it_is_said_that_threads_which_are_left_are_waited_for(capsys):
    class Running(Future):
        def running(self):
            return True

        def exception(self, timeout=None):
            raise KeyboardInterrupt

    with ThreadPoolExecutor(1) as pool:
        _wait({0: Running()}, pool, lambda *_: None)
    assert "left 1 of them, which no thread can be made to end" in capsys.readouterr().err


def test_an_error_of_a_task_ends_the_others():
    pool = Pool()
    with pytest.raises(ZeroDivisionError):
        dispatch(lambda k: 1 // (10 - k), TASKS, pool, lambda *_: None)
    assert all(future.cancelled() for future in pool.futures[3:]) and not pool.said


def test_tasks_end_with_the_time_that_is_given():
    def endless():
        for _ in range(2000):  # ten seconds
            sleep(0.005)
            check_time()

    began = perf_counter()
    with ThreadPoolExecutor(1) as pool, pytest.raises(TimeUp), time_limit(0.05):
        dispatch(endless, [(0, ())], pool, lambda *_: None)
    assert perf_counter() - began < 5


def test_while_an_executor_works_it_is_said_that_one_waits(monkeypatch):
    monkeypatch.setattr("actionopt.families.sweeps.dispatch.LOG_PACE", 0.004)
    done = []
    dispatch(
        double, TASKS[:1], Pool(), lambda *answer: done.append(answer), lambda: done.append("waits")
    )
    assert done.count("waits") >= 2 and done[-1] == (0, 20)


def look(times):
    for _ in range(times):
        check_time()
        sleep(0.001)
    return times


def test_while_this_process_works_it_is_said_as_well(monkeypatch):
    """Each so often, also where a task has a time limit of its own."""
    monkeypatch.setattr("actionopt.families.sweeps.dispatch.LOG_PACE", 0.004)
    done = []
    with time_limit(60):
        dispatch(look, [(0, (30,))], None, lambda *x: done.append(x), lambda: done.append("waits"))
    assert done.count("waits") >= 2 and done[-1] == (0, 30)
    check_time()
    assert done[-1] == (0, 30)  # nothing is told afterwards


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_what_is_raised_where_it_is_said_ends_the_task(monkeypatch, error):
    monkeypatch.setattr("actionopt.families.sweeps.dispatch.LOG_PACE", 0.0)

    def waits():
        raise error("mine")

    def work():
        try:
            look(30)
        except Exception:  # such as one of a member, which is no reason to end the others
            return None

    with pytest.raises(error, match="mine"):
        dispatch(work, [(0, ())], None, lambda *_: None, waits)
