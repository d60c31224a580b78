"""The time a solve may take, and what it tells on the way."""

import io
import sys
from collections import Counter

import numpy as np
import pytest
from helpers import a_quarter, at_once, same_bits

import actionopt as ao
from actionopt import scenes
from actionopt.discrete.matrices.factors import negative_signs
from actionopt.mechanics.conservation.symmetry import find_symmetries
from actionopt.tools.progress import Bar, steps, waiting
from actionopt.tools.watch import OutOfTime, TimeUp, Watch, time_limit

LATTICE = ao.System(
    lambda q, v, t: v @ v / 2 - np.sum((q[1:] - q[:-1]) ** 4) / 4 - q[0] ** 2 - q[-1] ** 2,
    [f"q{k}" for k in range(8)],
)


def hard():
    """Return a problem whose search takes seconds, and finds nothing."""
    ends = np.random.default_rng(0).normal(0, 0.3, (2, 8))
    return ao.Problem(LATTICE, ao.Event(0.0, ends[0]), ao.Event(60.0, ends[1]))


def test_a_solve_ends_in_time_with_its_best_attempt():
    solution = ao.solve(hard(), seconds=0.05, throw=False)
    assert solution.status is ao.Status.OUT_OF_TIME
    assert not solution.success
    with pytest.raises(ao.SolveError, match="the time that was given ran out") as found:
        ao.solve(hard(), seconds=1e-9)
    assert found.value.solution(0.0) == pytest.approx(hard().start.q)


@pytest.mark.long
def test_enough_time_changes_nothing():
    problem = scenes.get("double_pendulum").problem
    free, limited = ao.solve(problem), ao.solve(problem, seconds=1e3)
    same_bits(free.path.values, limited.path.values, because="a clock is only read")


def bratu(count=1):
    """Return a problem without a path: q'' = -6 e^q has none over this time (Bratu: 3.51)."""

    def lagrangian(q, v, t):
        return v @ v / 2 - 6 * np.sum(np.exp(q)) - np.sum((q[1:] - q[:-1]) ** 2) / 2

    system = ao.System(lagrangian, [f"x{k}" for k in range(count)])
    return ao.Problem(system, ao.Event(0.0, [0.0] * count), ao.Event(1.0, [0.01] * count))


@pytest.mark.long
@pytest.mark.parametrize(("count", "most"), a_quarter([(3, 650), (1, 550), (10, 350)]))
def test_where_there_is_no_path_the_search_gives_up_soon_and_says_nothing(count, most, capfd):
    """Counted: 450, 548 and 292; once they were 1125, 844 and 424."""
    solution = ao.solve(bratu(count), throw=False)
    assert solution.status is ao.Status.NOT_FOUND
    assert solution.stats["evaluations"]["second"] < most
    assert capfd.readouterr() == ("", "")


def spent(problem, **options):
    """Return the ways that are tried in turn, and the elements that each evaluates."""
    ways = Counter()

    def tell(stage, done, total, detail):
        ways[stage] += detail["elements"]

    ao.solve(problem, throw=False, progress=tell, **options)
    return ways


@pytest.fixture
def to_the_end(monkeypatch):
    """Let a search go on where it is seen that no motion comes to the end."""
    monkeypatch.setattr("actionopt.solver.search.out_of_reach.is_out_of_reach", lambda *_: False)


@pytest.mark.usefixtures("to_the_end")
def test_a_search_ends_when_it_has_cost_its_price(monkeypatch):
    monkeypatch.setattr("actionopt.solver.search.search.BUDGET", 500)
    limited = spent(bratu())
    assert limited["continuation"] == pytest.approx(500, abs=10)
    assert not limited["meeting"]


@pytest.mark.long
@pytest.mark.usefixtures("to_the_end")
def test_a_search_that_is_given_time_may_cost_more(monkeypatch):
    monkeypatch.setattr("actionopt.solver.search.search.BUDGET", 500)
    timed = spent(bratu(), seconds=1e3)
    assert timed["continuation"] > 600
    assert timed["meeting"] > 600


@pytest.mark.long
@pytest.mark.usefixtures("to_the_end")
def test_ways_that_time_does_not_allow_for_come_last(monkeypatch):
    now = [0.0]
    monkeypatch.setattr("actionopt.tools.watch.perf_counter", lambda: now[0])

    def tell(stage, done, total, detail):
        now[0] += 1e-3 * detail["elements"]  # a millisecond an element

    with pytest.raises(ao.SolveError, match=r"tried: convex newton, descent, newton, stationary$"):
        ao.solve(bratu(), seconds=1.2, progress=tell)
    assert now[0] == pytest.approx(1.2, abs=0.1)
    now[0] = 0.0  # in 3.4 s all ends by itself
    with pytest.raises(ao.SolveError, match=r"descent, newton, continuation, stationary$"):
        ao.solve(bratu(), seconds=2.2, progress=tell)


@pytest.mark.long
def test_time_that_runs_out_while_refining_leaves_the_path_that_was_found():
    """Told by the evaluations, not by the clock: the watch is stopped at the last but one."""
    problem = scenes.get("double_pendulum").problem
    calls = []
    ao.solve(problem, tol=1e-10, progress=lambda *told: calls.append(told))
    count = 0

    def stop(stage, done, total, detail):
        nonlocal count
        count += 1
        if count == len(calls) - 1:
            raise OutOfTime

    solution = ao.solve(problem, tol=1e-10, progress=stop, throw=False)
    assert solution.status is ao.Status.OUT_OF_TIME
    exact = ao.solve(problem, tol=1e-10)
    t = np.linspace(problem.start.t, problem.end.t, 50)
    apart = np.max(np.abs(solution(t) - exact(t)) / np.max(np.abs(exact(t)), axis=1)[:, None])
    assert apart <= solution.error < 0.1


@pytest.mark.long
def test_progress_names_the_way_the_elements_and_the_iterations():
    calls = []

    def told(*call):
        calls.append(call)
        if len({stage for stage, *_ in calls}) == 3:
            raise OutOfTime

    ao.solve(hard(), throw=False, progress=told)
    ways, iterations, totals, details = zip(*calls, strict=True)
    assert len(set(ways)) > 1 and set(ways) <= {w for w in ways if isinstance(w, str) and w}
    assert min(detail["elements"] for detail in details) >= 1 and {*totals} == {None}
    assert list(iterations) == list(range(1, len(calls) + 1))


def test_what_progress_raises_ends_the_solve():
    class Enough(Exception):
        pass

    def tell(stage, done, total, detail):
        if stage == "least" or done > 60:
            raise Enough

    with pytest.raises(Enough):
        ao.solve(hard(), progress=tell)


@at_once("seconds", [0, -1.0, np.nan, "1", True])
def test_seconds_that_make_no_sense(seconds):
    with pytest.raises(ValueError, match=r"seconds"):
        ao.solve(hard(), seconds=seconds)


def test_progress_that_cannot_be_called():
    with pytest.raises(ValueError, match=r"progress\(stage, done, total, detail\)"):
        Watch(None, "bar")


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_a_line_is_shown_on_a_terminal_after_a_while_and_goes_away(monkeypatch):
    screen, now = Terminal(), [0.0]
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setattr("actionopt.tools.progress.perf_counter", lambda: now[0])
    with waiting() as told:
        told("newton", 1, None, {"elements": 4})
        assert screen.getvalue() == ""
        now[0] = 1.5
        told("least", 20, None, {"elements": 8})
        assert "2 s: least, 8 elements, 20 iterations" in screen.getvalue()
        now[0] = 1.51
        told("least", 21, None, {"elements": 8})
        assert "21 iterations" not in screen.getvalue()
    assert screen.getvalue().endswith("\r\x1b[K")


def test_nothing_is_told_where_nobody_looks(monkeypatch):
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    with waiting() as told:
        assert told is None


@pytest.mark.parametrize("error", [np.linalg.LinAlgError, ValueError, KeyboardInterrupt])
def test_nothing_on_the_way_takes_what_progress_raises(error):
    def tell(stage, done, total, detail):
        raise error("mine")

    with pytest.raises(error, match="mine"):
        ao.solve(scenes.get("kepler").problem, progress=tell)


def test_without_a_terminal_there_is_a_line_each_ten_seconds(monkeypatch):
    now, log = [0.0], io.StringIO()
    monkeypatch.setattr(sys, "stderr", log)
    monkeypatch.setattr("actionopt.tools.progress.perf_counter", lambda: now[0])
    bar = Bar()
    for done in range(1, 26):
        now[0] += 1.0
        bar(done, 25, "")
    assert [line.split()[1] for line in log.getvalue().splitlines()] == ["10/25", "20/25", "25/25"]
    short = Bar()
    short(3, 3, "")
    assert log.getvalue().count("\n") == 3


def test_what_takes_longer_than_the_time_left_is_not_begun(monkeypatch):
    """All moves of thirty coordinates, and all eigenvalues of a matrix."""
    monkeypatch.setattr("actionopt.mechanics.conservation.symmetry._null_space", None)
    monkeypatch.setattr("actionopt.discrete.matrices.factors.np.linalg.eigvalsh", None)
    names = [f"x{i}" for i in range(30)]
    chain = ao.System(lambda q, v, t: v @ v / 2 + np.sum(np.cos(q)), names)
    with time_limit(0.5):
        with pytest.raises(TimeUp):
            find_symmetries(chain)
        with pytest.raises(TimeUp):
            negative_signs(np.zeros((1800, 1800)))
    turning = np.linspace(0.0, 2 * np.pi, 9) + np.arange(30)[:, None]
    closed = ao.Problem(chain, ao.Event(0.0, None), ao.Periodic(5.0))
    found = ao.solve(closed, guess=np.cos(turning), seconds=0.5, throw=False)
    assert found.status is ao.Status.OUT_OF_TIME


def test_what_is_done_is_shown_over_itself_on_a_terminal(monkeypatch, capsys):
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    assert list(steps("ab")) == ["a", "b"]
    first, second, last = capsys.readouterr().err.split("\r\x1b[K")[1:]
    parts = [line.partition("] ")[2] for line in (first, second, last)]
    assert parts == ["0/2 a", "1/2 b", "2/2 \n"]
    assert second.count("#") == second.count(".") > 0 and "." not in last.partition("]")[0]
