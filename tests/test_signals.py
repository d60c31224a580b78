"""What ends a search from within is a verdict: prices paid, time used up, singular matrices."""

import multiprocessing
import signal
from itertools import islice
from time import sleep

import numpy as np
import pytest
import systems

import actionopt as ao
from actionopt import scenes
from actionopt.analysis.quadratic import index
from actionopt.discrete.matrices.factors import Factors
from actionopt.solver.kinds import through
from actionopt.solver.refinement.signals import status_of
from actionopt.solver.refinement.workspace import PATIENT
from actionopt.solver.search import strategies
from actionopt.solver.search.search import EXPENSIVE, Strategy
from actionopt.solver.solve import BY_METHOD, solve_near
from actionopt.tools.interrupts import leave_interruptions
from actionopt.tools.watch import OutOfTime, Spent, Watch, check_time

PENDULUM = systems.pendulum(g=9.81)
KEPLER = systems.kepler()
BEAD = systems.thrown(constraint=lambda q, t: (q @ q - 1) / 2)
DISC = systems.particle("x y", obstacle=lambda q, t: q @ q - 1)
KINK = ao.System(lambda q, v, t: v[0] ** 2 / 2 + (q[0] ** 2 - 1) ** 2 / 4, ["phi"])
CENTRE = ao.System(lambda q, v, t: v[0] ** 2 / 2 + 1 / np.sqrt(abs(q[0])), ["x"])
LEAP = ao.System.geodesic(
    lambda q, v: (1.25 - 0.25 * abs(q[0]) / q[0]) * np.sqrt(v @ v), ["x", "y"]
)


def circle(q, t):
    return q @ q - 4


QUESTIONS = {
    "events": ao.Problem(PENDULUM, ao.Event(0, [0.3]), ao.Event(3, [2.0])),
    "constraint": ao.Problem(BEAD, ao.Event(0, [0, -1]), ao.Event(1, [1, 0])),
    "obstacle": ao.Problem(DISC, ao.Event(0, [-2, 0.1]), ao.Event(1, [2, 0.2])),
    "energy": ao.Problem(KEPLER, ao.Event(0, [1, 0]), ao.Event(None, [-0.5, 0.8]), energy=-0.3),
    "closed": ao.Problem(PENDULUM, ao.Event(0, [None]), ao.Periodic(None), energy=-5.0),
    "surface": ao.Problem(KEPLER, ao.Event(0, [1, 0.0]), ao.Event(3, None, on=circle)),
    "surface, energy": ao.Problem(
        KEPLER, ao.Event(0, [1, 0.0]), ao.Event(None, None, on=circle), energy=0.2
    ),
    "infinite": ao.Problem(KINK, ao.Event(-np.inf, [-1]), ao.Event(np.inf, [1])),
    "half": ao.Problem(KINK, ao.Event(0, [0.2]), ao.Event(np.inf, [1])),
}
QUICK = ("events", "infinite")
ALL = pytest.mark.parametrize(
    "name", [pytest.param(x, marks=[] if x in QUICK else [pytest.mark.slow]) for x in QUESTIONS]
)


class Dead(Strategy):
    """A way that ends in a signal: where it is asked whether it applies, or where it is tried."""

    signal: Exception
    applying = False

    def applies(self, search):
        if self.applying:
            raise self.signal
        return True

    def seek(self, ws):
        raise self.signal


@pytest.mark.parametrize("applying", [True, False])
@pytest.mark.parametrize("signal", [Spent(), np.linalg.LinAlgError()])
def test_a_way_that_leads_nowhere_is_followed_by_the_next(monkeypatch, signal, applying):
    monkeypatch.setattr(Dead, "signal", signal, raising=False)
    monkeypatch.setattr(Dead, "applying", applying)
    monkeypatch.setitem(BY_METHOD, "auto", (Dead("dead", (4,)), *strategies.STRATEGIES))
    assert ao.solve(QUESTIONS["events"]).success
    monkeypatch.setitem(BY_METHOD, "auto", (Dead("dead", (4,)),))
    assert ao.solve(QUESTIONS["events"], throw=False).status is ao.Status.NOT_FOUND


@pytest.mark.slow
@pytest.mark.parametrize(
    "problem",
    [
        ao.Problem(CENTRE, ao.Event(0, [-1.0]), ao.Event(1, [1.0])),
        ao.Problem(LEAP, ao.Event(0, [-1, 0]), ao.Event(1, [1, 0])),
    ],
)
def test_whether_a_way_applies_takes_derivatives(problem):
    """Which may be more than their price, or not finite."""
    with pytest.raises(ao.SolveError):
        ao.solve(problem)


class NearAndSpent(Strategy):
    """A way that comes near a path, is lost there, and has used up what it may cost."""

    cost = EXPENSIVE

    def seek(self, ws):
        assert ws.approach(PATIENT)
        ws._note_unpolished(ws.here)
        assert ws.unpolished is not None
        ws.transcribe(ws.here.mesh, None)  # goes on elsewhere
        ws.watch.most = -1.0
        return False


def test_a_verdict_on_families_is_not_left_half_done(monkeypatch):
    """Near a path that was lost it is counted whether that is one of a family, at any cost."""
    monkeypatch.setitem(BY_METHOD, "auto", (NearAndSpent("near", (4,)),))
    found = ao.solve(QUESTIONS["events"], throw=False)
    assert found.status is ao.Status.NOT_FOUND


@pytest.mark.long
def test_a_verdict_on_families_ends_with_the_time(monkeypatch):
    def endless(*given):
        for _ in range(1000):  # five seconds
            sleep(0.005)
            check_time()

    monkeypatch.setattr(index, "condense", endless)
    isotropic = ao.System(lambda q, v, t: (v @ v - q @ q) / 2 - 1e-30 * (q @ q) ** 2, ["x", "y"])
    problem = ao.Problem(isotropic, ao.Event(0, [1.0, 0.5]), ao.Event(np.pi, [-1.0, -0.5]))
    found = ao.solve(problem, seconds=0.8, throw=False)
    assert found.status is ao.Status.OUT_OF_TIME and found.error == np.inf


def counting(monkeypatch, number, at):
    """Call `at` before each factorization from the one with that number on; return their count."""
    count, real = [0], Factors.__init__

    def init(self, *given, **named):
        count[0] += 1
        if count[0] >= number:
            at()
        real(self, *given, **named)

    monkeypatch.setattr(Factors, "__init__", init)
    return count


def singular():
    raise np.linalg.LinAlgError("the matrix is not finite")


@pytest.mark.quick("2-infinite")
@ALL
@pytest.mark.parametrize("first", [2, pytest.param(1, marks=pytest.mark.slow)])
def test_singular_matrices_end_in_a_verdict(monkeypatch, name, first):
    problem = QUESTIONS[name]
    monkeypatch.setattr("actionopt.solver.search.search.BUDGET", 1000)
    with monkeypatch.context() as broken:
        counting(broken, first, singular)
        found = ao.solve(problem, throw=False)
        near = solve_near(problem, found, 1e-8)
    assert isinstance(found.status, ao.Status)
    assert isinstance(near.status, ao.Status)


def late_factorizations(monkeypatch, problem, last, **options):
    """Return how many there are after the time, which is up at number `last`; and the solution."""
    now = [0.0]
    count = counting(monkeypatch, last, lambda: now.__setitem__(0, 1e9))
    monkeypatch.setattr("actionopt.tools.watch.perf_counter", lambda: now[0])
    found = ao.solve(problem, seconds=1.0, throw=False, **options)
    return count[0] - last, found


@ALL
@pytest.mark.parametrize("last", [1, 3])
def test_nothing_is_sought_once_the_time_is_up(monkeypatch, name, last):
    """First paths included: they are solutions of other problems, in the same time.

    A descent tries a few damped matrices of one second derivative, and a verdict takes another.
    """
    late, found = late_factorizations(monkeypatch, QUESTIONS[name], last)
    assert late <= 10
    assert found.success or found.status is ao.Status.OUT_OF_TIME


@pytest.mark.long
def test_first_paths_through_events_are_sought_in_the_time_that_is_left(monkeypatch):
    first = through.starts

    def endless(*arguments):
        yield from islice(first(*arguments), 1)
        for _ in range(3000):
            sleep(1e-3)
            check_time()
        raise AssertionError

    monkeypatch.setattr(through, "starts", endless)
    monkeypatch.setattr(through, "_is_minimum", lambda solution: False)
    bounce = ao.Bounce(lambda q, t: 1 - q[0])
    asked = ao.Problem(systems.particle("x y"), ao.Event(0, [0, 0]), ao.Event(1, [0, 1]))
    found = ao.solve(asked.replace(through=[bounce]), seconds=1.0)
    assert np.isclose(found.action, 5 / 2)


@pytest.mark.long
def test_factors_that_take_longer_than_what_is_left_are_not_begun(monkeypatch):
    scene = scenes.get("chain", links=40, l=1.0 / 40, amplitude=0.1)
    monkeypatch.setattr("actionopt.discrete.matrices.factors.STEP_SECONDS", 1.0)
    found = ao.solve(scene.problem, guess=scene.guess, seconds=60.0, throw=False)
    assert found.status is ao.Status.OUT_OF_TIME


@pytest.mark.long
def test_a_guess_is_worth_no_search_of_its_own(monkeypatch):
    """Where nothing is near a guess, no other first path to the surface is made."""
    spring = systems.oscillator()
    end = ao.Event(np.pi, None, on=lambda q, t: q[0] - 1)  # conjugate to the start
    monkeypatch.setattr("actionopt.solver.kinds.nearest_points.points", None)
    found = ao.solve(ao.Problem(spring, ao.Event(0, [0]), end), guess=[[0, 1]], throw=False)
    assert not found.success


def test_parts_of_a_search_have_a_price_of_their_own_and_its_time():
    told = []
    outer = Watch(100.0, lambda how, *_: told.append(how))
    inner = Watch(None, None, outer)
    inner.how = "newton"
    inner(8)
    assert inner.has_costs and not outer.has_costs
    assert (inner.evaluated, outer.evaluated, inner.end, told) == (8, 0, outer.end, ["newton"])
    outer.end = 0.0
    with pytest.raises(OutOfTime):
        inner(8)


def test_ctrl_c_is_left_to_the_process_that_began_this_one(monkeypatch):
    told = []
    monkeypatch.setattr(signal, "signal", lambda *given: told.append(given))
    leave_interruptions()
    assert not told  # nobody began this one
    monkeypatch.setattr(multiprocessing, "parent_process", lambda: 1)
    leave_interruptions()
    assert told == [(signal.SIGINT, signal.SIG_IGN)]


def test_a_signal_says_which_verdict_it_is():
    assert status_of(OutOfTime()) is ao.Status.OUT_OF_TIME
    assert status_of(RuntimeError()) is ao.Status.UNRESOLVED
