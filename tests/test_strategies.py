"""How a first path is found: which ways are tried, in which order, and on which meshes."""

from types import SimpleNamespace

import numpy as np
import pytest
import systems
from helpers import applies, integrated
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq
from scipy.special import ellipk

import actionopt as ao
from actionopt import Event, Path, Problem, System, scenes
from actionopt.discrete.action.transcription import Transcription
from actionopt.solver.refinement.workspace import Workspace
from actionopt.solver.search.near_guess import COARSE_GUESS, GUESS_MESHES, _fine_enough
from actionopt.solver.search.search import BUDGET, Search, Strategy
from actionopt.solver.search.strategies import (
    IPOPT,
    MEETING_LOST,
    STRATEGIES,
    PatientLeast,
    TwoSidedShooting,
)
from actionopt.solver.solve import solve_near
from actionopt.tools.watch import Spent, Watch


def search_for(problem, tol=1e-8, principle="auto"):
    return Search(Workspace(problem), tol, principle, None, STRATEGIES)


def test_the_ladder_names_each_way_once():
    names = [strategy.name for strategy in STRATEGIES]
    assert len(set(names)) == len(names)
    assert {strategy.name for strategy in IPOPT} < set(names)


def test_strategies_on_one_mesh_set_out_from_one_transcription(monkeypatch):
    problem = ao.Problem(systems.pendulum(g=9.81), ao.Event(0.0, 0.3), ao.Event(1.0, 0.5))
    search, made = search_for(problem), []
    transcribe = Workspace.transcribe
    monkeypatch.setattr(
        Workspace, "transcribe", lambda ws, *given: made.append(1) or transcribe(ws, *given)
    )
    for degree, known, count in ((6, None, 1), (8, None, 2), (6, None, 2), (6, "path", 3)):
        search._begin_on(4, degree, search.ws.here.path if known else None)
        assert len(made) == count and search.ws.here.mesh.degrees == (degree,) * 4
    search.ws.watch = Watch(None, None)
    search._begin_on(4, 8, None)
    assert len(made) == 3 and search.ws.here.tr.watch is search.ws.watch


@pytest.mark.long
@pytest.mark.parametrize("scene", ["pendulum", "rod_pendulum", "oscillator", "damped_oscillator"])
def test_ipopt_alone_finds_the_same_path(scene):
    scene = scenes.get(scene)
    found, ours = (ao.solve(scene.problem, method=method) for method in ("ipopt", "auto"))
    assert found.stats["iterations"]["ipopt"] > 0 and "ipopt" not in ours.stats["iterations"]
    assert found.action == pytest.approx(ours.action, rel=1e-9)
    t = np.linspace(scene.problem.start.t, scene.problem.end.t, 31)
    assert np.allclose(found(t), scene.exact(t), rtol=0, atol=1e-7 * np.max(np.abs(found(t))))
    near = ao.solve(scene.problem, method="ipopt", guess=lambda t: 1.01 * scene.exact(t))
    assert near.action == pytest.approx(ours.action, rel=1e-9)
    with pytest.raises(ValueError, match="expected method 'auto' or 'ipopt', found 'newton'"):
        ao.solve(scene.problem, method="newton")


def test_steps_place_by_place_are_for_many_coordinates():
    def lagrangian(q, v, t):  # a lattice of quartic springs
        d = [q[0], *(q[j + 1] - q[j] for j in range(14)), -q[14]]
        return v @ v / 2 - sum(s**2 / 2 + s**4 / 4 for s in d)

    lattice = System(lagrangian, [f"q{j}" for j in range(15)])
    problem = ao.Problem(lattice, ao.Event(0.0, np.zeros(15)), ao.Event(1.0, np.ones(15)))
    assert not applies("places", problem)


@pytest.mark.long
def test_ten_to_twenty_coordinates_have_a_root_search():
    """A Toda lattice: too few masses for steps place by place, too many for motions that meet."""

    def tension(q):
        return np.exp(-np.diff(q, prepend=0.0, append=0.0)) - 1

    def lagrangian(q, v, t):
        d = [q[0], *(q[j + 1] - q[j] for j in range(n - 1)), -q[-1]]
        return v @ v / 2 - sum(np.exp(-s) + s for s in d)

    def flow(t, y):
        return np.concatenate([y[n:], -np.diff(tension(y[:n]))])

    n = 15
    q, v = np.random.default_rng(20).normal(0.0, [[0.3], [0.5]], (2, n))
    end = integrated(flow, np.concatenate([q, v]), 0.0, 2.5)(2.5)[:n]
    system = System(lagrangian, [f"q{j}" for j in range(n)])
    problem = Problem(system, Event(0.0, q), Event(2.5, end))
    assert applies("stationary", problem, "stationary")
    assert not applies("places", problem) and not applies("meeting", problem)
    for method in ("auto", "ipopt"):  # by itself: of Ipopt's strategies it is the first
        solution = ao.solve(problem, tol=1e-6, principle="stationary", method=method)
        first = np.concatenate([q, solution.start.v])
        assert np.abs(integrated(flow, first, 0.0, 2.5)(2.5)[:n] - end).max() < 1e-5


def test_a_curved_attempt_that_fails_leaves_no_trace(monkeypatch):
    """What the straight line led to is told, and nothing of the iterations from the curved one."""
    kepler = scenes.get("kepler").problem.system
    problem = Problem(kepler, Event(0.0, [1.0, 0.0]), Event(0.3, [-1.0, 0.0]))
    tried = []
    monkeypatch.setattr(
        Search, "try_each", lambda self, strategies: tried.append(self) or found(self)
    )

    def found(search):
        mesh = search.uniform(4, 6)
        search.ws.transcribe(mesh, None)
        search.ws.record.iterations["newton"] += 7 if search.curved else 1
        search.ws.record.round(search.ws.here.tr, 0.0)
        return ao.Status.NOT_FOUND

    solution = ao.solve(problem, throw=False)
    assert [search.curved for search in tried] == [False, True]
    assert solution.stats["iterations"] == {"newton": 1} and len(solution.stats["rounds"]) == 1


@pytest.mark.quick("0.01-6", "1e-05-8", "1e-09-12")
@pytest.mark.parametrize(("tol", "degree"), [(1e-2, 6), (1e-5, 8), (1e-9, 12), (1e-13, 17)])
def test_the_first_mesh_has_about_a_degree_for_each_digit(tol, degree):
    def first(name):
        return ao.solve(scenes.get(name).problem, tol=tol, throw=False).stats["rounds"][0]

    assert set(first("pendulum")["degrees"]) == {degree}
    # Many coordinates: a higher degree costs more than a second mesh.
    assert set(first("two_body")["degrees"]) == {6}


def test_a_guess_is_tried_on_meshes_that_show_it():
    kepler = scenes.get("kepler").problem
    problem = Problem(kepler.system, Event(0.0, kepler.start.q), Event(100.0, kepler.end.q))

    def turning(turns):
        w = 2 * np.pi * turns / 100.0
        curve = lambda t: np.array([np.cos(w * t), np.sin(w * t)])  # noqa: E731
        return lambda mesh: Path.interpolate(curve, mesh)

    search = search_for(problem)

    def tried(curve_of):
        return tuple(mesh.elements for mesh in _fine_enough(search, curve_of))

    assert tried(turning(1)) == GUESS_MESHES
    assert tried(turning(10)) == GUESS_MESHES[1:]
    assert tried(turning(20)) == GUESS_MESHES[2:]
    # A turn far shorter than the way has meshes of its own, which show it roughly and well.
    turn = lambda t: np.array([np.tanh(9 * (t - 50.3))] * 2)  # noqa: E731
    rough, fine, *others = _fine_enough(search, lambda mesh: Path.interpolate(turn, mesh))
    assert tuple(mesh.elements for mesh in others) == GUESS_MESHES
    assert rough.nodes.size < fine.nodes.size <= 4 * others[-1].nodes.size
    # What no mesh shows, kinks inside elements, is tried on all of them.
    kinks = lambda t: np.abs((np.array([t, t]) * 0.37) % 2 - 1)  # noqa: E731
    assert tried(lambda mesh: Path.interpolate(kinks, mesh)) == GUESS_MESHES


@pytest.mark.long
def test_a_guess_in_many_coordinates_is_followed_on_few_elements_that_show_it():
    def lagrangian(q, v, t):
        d = q[1:] - q[:-1]
        return (v @ v - d @ d) / 2 - q[0] ** 4

    start, end = 0.1 * np.cos(np.arange(6))[:, None], 0.1 * np.sin(np.arange(6))[:, None]
    row = System(lagrangian, list("abcdef"))
    problem = Problem(row, Event(0.0, start.ravel()), Event(1.0, end.ravel()))

    def elements(bump, tol):
        """Return those of the first mesh, for a guess with a bump between the nodes of few."""

        def guess(t):
            return (
                start * (1 - t) + end * t + bump * t * (1 - t) * np.exp(-(((t - 0.4) / 0.02) ** 2))
            )

        solution = ao.solve(problem, tol=tol, guess=guess)
        assert solution.compare().agrees and solution.error < tol
        return solution.stats["rounds"][0]["elements"]

    assert elements(0.0, 1e-3) == elements(0.0, 1e-9) == COARSE_GUESS[0]
    assert elements(0.02, 1e-3) > COARSE_GUESS[-1]


@pytest.mark.long
@pytest.mark.parametrize("points", [None, 9])
def test_a_motion_given_as_the_guess_is_followed_on_no_finer_mesh_than_without_one(points):
    problem = scenes.get("pendulum").problem
    for tol in (1e-3, 1e-9, 1e-12):
        alone = ao.solve(problem, tol=tol)
        times = np.linspace(problem.start.t, problem.end.t, points or 2)
        guess = alone(times) if points else alone.path.__call__
        near = ao.solve(problem, tol=tol, guess=guess)
        assert near.mesh.nodes.size <= alone.mesh.nodes.size
        assert near.stats["rung"] == "guess" and abs(near.action - alone.action) < tol


def test_a_motion_given_as_a_function_is_asked_for_twice_to_be_followed():
    """At three times, for what it returns, and at those that show whether few elements show it."""
    problem, asked = scenes.get("pendulum", duration=0.5).problem, []
    alone = ao.solve(problem, tol=1e-6)

    def guess(t):
        asked.append(t.size)
        return alone(t)

    near = ao.solve(problem, tol=1e-6, guess=guess)
    assert near.stats["rung"] == "guess" and len(asked) == 2 and asked[0] == 3
    assert near.stats["evaluations"]["first"] < alone.stats["evaluations"]["first"]


@pytest.mark.long
def test_waypoints_that_miss_the_turns_lead_to_the_path_through_them():
    """Nine points of ten swings ended unresolved, after three meshes and a homotopy on each."""
    problem = scenes.get("pendulum", duration=20.0).problem
    alone = ao.solve(problem, tol=1e-6)
    guess = alone(np.linspace(problem.start.t, problem.end.t, 9))
    near = ao.solve(problem, tol=1e-6, guess=guess)
    assert abs(near.action - alone.action) < 1e-6
    assert "ipopt" not in near.stats["iterations"]
    taken, without = (s.stats["evaluations"]["second"] for s in (near, alone))
    # A guess costs no more than none, but for the look at it: three times as many did.
    assert taken <= without + 1
    # A path that misses a waypoint is none of those near the guess.
    guess[0, 4] += 1.0
    far = ao.solve(problem, tol=1e-6, guess=guess, throw=False)
    assert not far.success or abs(far.action - alone.action) > 1.0


def test_with_a_saddle_in_hand_each_way_has_its_own_price():
    """The least path of a chain was no longer looked for when the way before had cost its own."""
    search = search_for(scenes.get("pendulum").problem)
    search.saddle = "newton", None
    search._limit(500)
    watch = search.ws.watch
    watch.evaluated = 501
    with pytest.raises(Spent):
        watch.look(8)
    assert not search._is_exhausted
    search._limit(4000)
    assert watch.most == 4501
    watch.evaluated = BUDGET + 1
    assert search._is_exhausted


@pytest.mark.long
@pytest.mark.parametrize(("duration", "least"), [(1.0, True), (2.5, True), (7.5, False)])
def test_least_first_and_a_saddle_where_there_is_none(duration, least):
    # A stiffening spring: past the first conjugate time the action is unbounded below.
    spring = systems.spring(stiffening=0.01)
    problem = Problem(spring, Event(0.0, [0.1]), Event(duration, [0.2]))
    solution = ao.solve(problem)
    assert solution.compare().agrees
    assert (solution.morse_index == 0) == least
    if not least:
        with pytest.raises(ao.SolveError, match="unbounded below"):
            ao.solve(problem, principle="least")


def halves(q_from, amplitude):
    """Return time, and int theta'^2 dt, from an angle up to a pendulum's amplitude (l = 1)."""
    top = np.sqrt(amplitude - q_from)  # theta = amplitude - u^2: no singularity at the top

    def speed(u):
        return np.sqrt(2 * 9.81 * (np.cos(amplitude - u * u) - np.cos(amplitude)))

    return [quad(f, 0, top)[0] for f in (lambda u: 2 * u / speed(u), lambda u: 2 * u * speed(u))]


@pytest.mark.long
@pytest.mark.parametrize("principle", ["auto", "least"])
def test_a_saddle_that_newton_finds_gives_way_to_a_least_path(principle):
    """Up beyond the horizontal and back to the same angle: S from the pendulum's quadratures."""
    angle, T = 0.1, 1.5
    amplitude = brentq(lambda a: halves(angle, a)[0] - T / 2, 0.2, 3.1)
    least = 2 * halves(angle, amplitude)[1] + 9.81 * np.cos(amplitude) * T
    rod = scenes.get("rod_pendulum", m=1.0, l=1.0, g=9.81).problem.system
    at = [np.sin(angle), -np.cos(angle)]
    solution = ao.solve(Problem(rod, Event(0.0, at), Event(T, at)), principle=principle)
    assert solution.action == pytest.approx(least, rel=1e-7)
    assert solution.morse_index == 0


def test_a_curved_line_stays_within_the_size_of_the_motion():
    problem = scenes.get("kepler").problem
    search = search_for(problem)
    mesh = search.uniform(8, 6)
    straight = Transcription(problem, mesh, problem.lengths).straight().T
    bend = (search._curved_line(mesh).values - straight) / problem.lengths[:, None]
    assert np.max(np.abs(bend[:, [0, -1]])) < 1e-15
    assert 0.1 < np.max(np.abs(bend)) < 1.0


def test_few_motions_that_meet_are_refined_where_none_can_be(monkeypatch):
    scene = scenes.get("pendulum")
    search, refined = search_for(scene.problem, principle="stationary"), []

    def unresolved(search):
        refined.append(search)
        return ao.Status.UNRESOLVED

    mesh = ao.Mesh.uniform(scene.problem.start.t, scene.problem.end.t, 4, 8)
    guess = Path.interpolate(scene.exact, mesh)
    groups = [iter([guess] * 9), iter([guess] * 2)]
    monkeypatch.setattr(
        "actionopt.solver.search.two_sided_shooting.curves", lambda *_: iter(groups)
    )
    monkeypatch.setattr(Search, "refine", unresolved)
    assert TwoSidedShooting("meeting", (8, 16)).attempt(search) is ao.Status.NOT_FOUND
    assert len(refined) == MEETING_LOST + 2


class Told(Strategy):
    """A way that comes to what it is told: a least path that is lost, a saddle, or nothing."""

    def __init__(self, name, found=None, least=False):
        super().__init__(name, ())
        vars(self).update(found=found, minimises=least)

    def attempt(self, search):
        if self.found == "saddle":
            search.saddle = self.name, None
        if self.found == "lost":
            search.lost.append(True)
            return ao.Status.UNRESOLVED
        return ao.Status.NOT_FOUND


def told(*ways, monkeypatch):
    """Return the names of the ways in the order in which they are tried."""
    search = search_for(scenes.get("pendulum").problem)
    search.may_be_least = True

    def lose(search):
        search.tried.append("refine")
        search.saddle = None
        return ao.Status.UNRESOLVED

    monkeypatch.setattr(Search, "_refine_saddle", lose)
    assert not search.try_each(tuple(Told(*way) for way in ways)).success
    return search.tried


def test_once_a_least_path_is_lost_others_that_minimise_come_last(monkeypatch):
    ways = ("a", "lost", True), ("b", None, True), ("c", None)
    assert told(*ways, monkeypatch=monkeypatch) == ["a", "c", "b"]
    ways = ("a", None, True), ("b", None, True), ("c", None)
    assert told(*ways, monkeypatch=monkeypatch) == ["a", "b", "c"]


def test_a_saddle_that_cannot_be_refined_keeps_no_way_from_being_tried(monkeypatch):
    ways = ("a", "lost", True), ("b", "saddle"), ("c", None, True), ("d", None)
    assert told(*ways, monkeypatch=monkeypatch) == ["a", "b", "refine", "d", "c"]


def test_where_no_way_applies_the_verdict_is_said_of_the_straight_line():
    friction = systems.pendulum("x", force=lambda q, v, t: -0.02 * v)
    found = solve_near(Problem(friction, Event(0.0, 0.0), Event(15.0, 0.2128)), None, 1e-8)
    assert found.status is ao.Status.NOT_FOUND and found.error == np.inf
    t = np.linspace(0, 15, 7)
    assert found(t)[0] == pytest.approx(0.2128 * t / 15)


@pytest.mark.slow
def test_the_motion_itself_leads_to_itself_over_many_periods():
    """On the first meshes it is not to be seen; by scipy's integration."""
    T = 25.3 * 4 * ellipk(np.sin(1.0) ** 2) / np.sqrt(9.81)

    def rates(t, y):
        return [y[1], -9.81 * np.sin(y[0])]

    options = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-12, "dense_output": True}
    known = solve_ivp(rates, (0, T), [2.0, 0.0], **options)
    problem = ao.Problem(
        systems.pendulum(g=9.81), ao.Event(0.0, [2.0]), ao.Event(T, known.sol(T)[:1])
    )
    solution = ao.solve(problem, guess=lambda t: known.sol(t)[:1])
    t = np.linspace(0.0, T, 999)
    assert np.abs(solution(t) - known.sol(t)[:1]).max() < 1e-8


@pytest.mark.parametrize(
    ("saddle", "large", "open_"),
    [(None, True, True), ("meeting", True, True), ("newton", False, True), ("newton", True, False)],
)
def test_with_a_saddle_in_hand_no_long_search_goes_on_in_a_large_system(saddle, large, open_):
    search = SimpleNamespace(
        saddle=saddle and (saddle, None),
        may_be_least=True,
        ws=SimpleNamespace(large=large, has_mass=True),
    )
    assert PatientLeast("patient", (8,)).applies(search) is open_


@pytest.mark.parametrize("rate", [-50.0, -30.0, 10.0, 16.0])
def test_a_free_body_whose_inertia_varies_much_sets_out_at_its_own_pace(rate):
    """L = exp(c q) v^2 / 2 is u'^2 / 2 of u = 2 exp(c q / 2) / c."""
    system = ao.System(lambda q, v, t: np.exp(rate * q[0]) * v[0] ** 2 / 2, ["q"])
    ends = (0.0, 1.0) if rate < 0 else (1.0, -1.5)
    first, last = 2 * np.exp(rate * np.array(ends) / 2) / rate
    path = ao.solve(ao.Problem(system, ao.Event(0.0, [ends[0]]), ao.Event(1.0, [ends[1]])))
    assert path.action == pytest.approx((last - first) ** 2 / 2, rel=1e-10)
    assert path.morse_index == 0
    t = np.linspace(0.0, 0.9, 10)
    u = first + t * (last - first)
    assert np.abs(path(t)[0] - 2 / rate * np.log(rate * u / 2)).max() < 1e-8


@pytest.mark.slow
@pytest.mark.parametrize(("a", "b", "T"), [(1.3188, -0.2418, 1.9), (0.7441, -1.6328, 1.98)])
def test_what_the_budget_cuts_short_keeps_the_verdict_before(a, b, T):
    # The speed of the only path is infinite at q = 0, where the inertia vanishes.
    system = ao.System(lambda q, v, t: q[0] ** 2 * v[0] ** 2 / 2, ["q"])
    found = ao.solve(ao.Problem(system, ao.Event(0.0, [a]), ao.Event(T, [b])), throw=False)

    assert found.status is ao.Status.UNRESOLVED
