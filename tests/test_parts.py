"""Single functions against closed forms: what searches, choices and first guesses are made of."""

import html
import re
from typing import Any

import casadi as ca
import numpy as np
import pytest
import systems
from helpers import at_once, fake
from scipy.special import ellipk

import actionopt as ao
from actionopt import Event, Mesh, Problem, System
from actionopt.analysis.motion import compare
from actionopt.analysis.quadratic import index, shooting
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.between_nodes import crossing, energy_balance
from actionopt.discrete.borders import bordered, borders
from actionopt.discrete.borders.contact_times import merge_contacts
from actionopt.discrete.matrices.factors import full
from actionopt.discrete.meshes import nodal
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.families import vary
from actionopt.families.searches import all_paths, searches, velocity_scan
from actionopt.families.sweeps import budget
from actionopt.families.sweeps.path_store import PackedPaths
from actionopt.families.sweeps.retry import retry_of
from actionopt.mechanics.laws import written as written_laws
from actionopt.mechanics.question.obstacle import Arc, put_on_obstacle
from actionopt.solver.contact import first_contacts, touching
from actionopt.solver.contact.taut_strings import StraightWays, Ways
from actionopt.solver.contact.touching import _part_moments
from actionopt.solver.ends import closed, durations, window
from actionopt.solver.input import arguments, preflight
from actionopt.solver.kinds import (
    closed_contact,
    first_paths,
    free_contact,
    nearest_points,
    passing_times,
    revisions,
    through,
    unfixed,
)
from actionopt.solver.kinds.between import Choices
from actionopt.solver.kinds.first_paths import FirstPaths
from actionopt.solver.kinds.ray_tracing import RAY_SPEEDS, ClosedRayTracer, RayTracer
from actionopt.solver.kinds.rays import BEST_RAYS, RAY_SPREAD, RaySearch, ways_on
from actionopt.solver.kinds.unfixed import Unfixed
from actionopt.solver.refinement import descent, family, ipopt, iterate, refine
from actionopt.solver.refinement.record import Record
from actionopt.solver.refinement.workspace import Workspace
from actionopt.solver.search import near_guess, resonances, two_sided_shooting, waves
from actionopt.solver.search.homotopy import HomotopyCurve
from actionopt.solver.search.search import BUDGET, Search
from actionopt.solver.search.strategies import STRATEGIES
from actionopt.tools import mathml

FREE = systems.particle("x y")
ACROSS = Problem(FREE, Event(1.0, [0.5, 0.0]), Event(3.0, [2.0, -1.0]))


# -- what searches may cost, and in which order things are tried -----------------------------------


def test_in_vain_as_much_may_be_spent_as_on_paths_that_were_found():
    spent = budget.Budget(limited=True, coordinates=2)
    spent.count("", 1, None, {"elements": budget.FREE_BUDGET - 1.0})
    assert spent.allows
    spent.count("", 2, None, {"elements": 1.0})
    assert not spent.allows
    spent.note_found(budget.FREE_BUDGET - 1.0)
    assert (spent.well, spent.vain) == (1.0, budget.FREE_BUDGET - 1.0)
    assert spent.allows
    spent.count("", 3, None, {"elements": 2.0})
    assert not spent.allows
    free = budget.Budget(limited=False, coordinates=2)
    free.count("", 1, None, {"elements": 1e9})
    assert free.allows


def test_beside_known_paths_a_search_ends_with_the_budget_of_the_members_left():
    spent = budget.Budget(limited=True, coordinates=2)
    few = budget.FEW_LEFT + 2.0 * budget.EACH_LEFT
    spent.begin(1000, 1, turned=False)
    assert spent.limit == budget.FREE_BUDGET
    spent.well = 5.0
    spent.begin(2, 1, turned=False)
    assert spent.most == few + 5.0
    spent.count("", 2, None, {"elements": few + 5.0})
    assert not spent.allows
    spent.begin(1000, 1, turned=False)  # now a little for each
    assert spent.limit == few
    spent.count("", 3, None, {"elements": float(budget.BRIEF)})
    with pytest.raises(budget.Exhausted):
        spent.count("", 4, None, {"elements": 1.0})
    spent.note_found(spent.vain - 10.0)
    assert spent.allows and spent.limit == budget.FREE_BUDGET
    spent.vain = 0.0
    spent.begin(2, 1, turned=False)  # there are others
    assert spent.limit == budget.FREE_BUDGET
    free = budget.Budget(limited=False, coordinates=2)
    free.begin(2, 1, turned=True)
    free.count("", 1, None, {"elements": 1e9})
    assert free.allows


def test_past_a_fold_a_search_costs_more_only_where_most_members_are_beyond():
    spent = budget.Budget(limited=True, coordinates=2)
    spent.begin(10, 8, turned=True)
    assert spent.limit == spent.most == budget.PAST_FOLD + 2.0 * budget.EACH_LEFT
    few = budget.Budget(limited=True, coordinates=2)
    few.begin(8, 10, turned=True)
    assert few.limit == budget.PAST_FOLD
    few.note_found(0.0)
    few.begin(8, 10, turned=True)
    assert few.most == budget.FEW_LEFT
    few.begin(8, 10, turned=False)
    assert few.most == np.inf
    alone = budget.Budget(limited=True, coordinates=1)
    alone.begin(8, 10, turned=True)
    assert alone.limit == budget.PAST_FOLD_ALONE < budget.PAST_FOLD


def test_what_takes_longest_is_tried_on_the_first_and_on_the_finest_mesh(monkeypatch):
    meshes, far = [Mesh.uniform(1.0, 3.0, k, 3) for k in (2, 4, 8)], []
    failed = ao.Status.NOT_FOUND
    for name, known in (
        ("_from_few", (failed, False)), ("_fine_enough", meshes), ("_near", False),
        ("_quickly_past", failed),
    ):  # fmt: skip
        monkeypatch.setattr(near_guess, name, lambda *_, known=known, **__: known)
    monkeypatch.setattr(near_guess, "_continue", lambda search, far: tried.append(far))
    tried = far
    search = Search(Workspace(ACROSS, tol=1e-8), 1e-8, "auto", None, STRATEGIES)
    near_guess.follow_guess(
        search, lambda mesh: Path(mesh, np.zeros((2, mesh.nodes.size))), meshes[0]
    )
    assert tried == [True, False, True]


def test_hits_aim_in_the_direction_of_the_end(monkeypatch):
    asked = []

    def velocities(problem, far, count, random):
        asked.append(far)
        raise np.linalg.LinAlgError

    monkeypatch.setattr(two_sided_shooting, "velocities", velocities)
    assert not list(two_sided_shooting.hits(ACROSS))
    assert asked[0] == pytest.approx([1.5, -1.0])


def test_a_nearer_end_is_followed_roughly_and_the_one_asked_to_the_tolerance(monkeypatch):
    asked, path = [], Path(Mesh([1.0, 3.0], [3]), np.zeros((2, 4)))
    spent = {"newton": 1}
    near = fake(success=True, path=path, mesh=path.mesh, stats={"iterations": spent})

    def between(problem, guess, choices):
        asked.append((problem.end.t, choices.tol))
        return fake(success=len(asked) == 3, path=path), ""

    def follow(problem, guess, tol, watch):
        asked.append((problem.end.t, tol))
        return near

    monkeypatch.setattr(revisions, "between", between)
    monkeypatch.setattr(revisions, "_near_guess", follow)
    monkeypatch.setattr(revisions, "stretch_to_end", lambda *_: path)
    question = systems.bratu().replace(start=Event(1.0, [0.0]), end=Event(3.0, [0.0]))
    choices = Choices(1e-9, "auto", STRATEGIES, None, None)
    found, part = revisions._follow_to_end(question, choices)
    assert (found, part) == (near, 1.0)
    rough = revisions.ON_THE_WAY
    assert asked == [(t, rough) for t in (2.0, 1.5, 1.25, 1.5, 2.0)] + [(3.0, 1e-9)]
    asked.clear()
    spent["newton"] = (
        revisions.MOST_FOLLOWED
    )  # it has its price, and nothing is said of the way then
    assert revisions._follow_to_end(question, choices) == (None, 0.0)


def test_a_path_that_a_fold_led_to_is_not_followed_back(monkeypatch):
    followed, one = [], fake(path="one")
    search: Any = object.__new__(searches.Answers)
    search.problem, search.found = ACROSS, [(one, (), None)]
    search.classes = [fake(turns=(), problem=ACROSS)]
    search.tell = lambda *_: None
    search._start = lambda c, path, how: path

    def trace(problem, name, end, *, guess, **options):
        followed.append((guess, end))
        return fake(interrupted=False, returned=guess == "one", paths=[guess + "'"])

    monkeypatch.setattr(searches, "trace", trace)
    monkeypatch.setattr(searches, "_coarser", lambda path: path)
    for beyond in search._folds(2):
        assert beyond == "one'"
        search.last = fake(path=beyond)
        search.found.append((search.last, (), None))
    ends = [1.0 + 2.0 * x for x in (searches.EARLIEST_FOLD, searches.LATEST_FOLD)]
    # Each path beyond is followed in the other direction alone.
    assert followed == [("one", ends[0]), ("one", ends[1]), ("one'", ends[1])]


# -- points and times that first paths go through --------------------------------------------------


@pytest.mark.parametrize("straight", [False, True])
@pytest.mark.parametrize("length", [0.0, 0.7])
def test_a_string_between_free_motions_is_met_at_one_speed(length, straight):
    A, B, x, y = (np.array(z) for z in ([0.0, 0.0], [3.0, 0.0], [1.0, 1.0], [1.5, 0.8]))
    if not length:
        y = x
    t = np.linspace(0.0, 2.0, 2001)[1:-1]
    v = np.tile((B - A) / 2.0, (t.size, 1))
    ways = Ways(t, A + v * t[:, None], v, (0.0, np.zeros(2)), (2.0, np.zeros(2)))
    if straight:
        ways = StraightWays((0.0, A), (2.0, B))
    when, speed = ways.passing_at_one_speed(np.array([x, y]), length)
    first, last = np.linalg.norm(x - A), np.linalg.norm(B - y)
    assert speed == pytest.approx((first + length + last) / 2.0, abs=1e-4)
    assert when == pytest.approx(first / speed, abs=1e-5)
    if not length:
        arrival, departure = (z[0] for z in ways.passing(x[None]))
        np.testing.assert_allclose(arrival, (x - A) / first * speed, atol=1e-4)
        np.testing.assert_allclose(departure, (B - y) / last * speed, atol=1e-4)
        up = np.array([0.0, 1.0])
        first, last = ways.beyond(up[None], x[None])[:, 0]
        assert np.sin(first) == pytest.approx(1 / np.sqrt(2), abs=1e-4)
        assert np.sin(last) == pytest.approx(1 / np.sqrt(5), abs=1e-4)


def test_motions_are_thrown_back_at_surfaces_met_at_times_that_are_found():
    def wall(q, t):
        return q[0] - 1

    passing, timed = Event(None, None, on=wall), Event(2.0, None, on=wall)
    events = [passing, timed, Event(None, [1.0, 0.0]), ao.Bounce(wall), passing]
    problem = Problem(FREE, Event(1.0, [0.0, 0.0]), Event(3.0, [0.0, 1.0]), through=events)
    assert list(ways_on(problem)) == [(), (1,), (5,), (1, 5)]


def begin(*arguments):
    found = through._begin(*arguments)
    assert found is not None
    return found


def test_legs_take_the_time_of_their_length_at_the_energy():
    # At the middle of each leg, in place and time: of mass x + t, against a slope.
    system = System(lambda q, v, t: (q[0] + t) * (v @ v) / 2 - q[1], ["x", "y"])
    points = np.array([[2.0, 0.0], [4.0, 0.0], [4.0, 2.0]])
    inner, last = [Event(None, [4.0, 0.0])], [4.0, 2.0]
    problem = Problem(system, Event(0.0, [2.0, 0.0]), Event(6.0, last), through=inner)
    lengths = np.array([2 * np.sqrt(3 + 1.5), 2 * np.sqrt(4 + 4.5)])
    np.testing.assert_allclose(through._durations(problem, points), lengths)
    still = through._durations(problem, points[[0, 0, 2]])  # a leg of no length takes some time
    assert still[0] == pytest.approx(0.05 * still[1])
    path, times = begin(problem, points, np.ones(2), np.array([1.0, 2.0]))
    np.testing.assert_allclose(times, [0.0, 6 * lengths[0] / (lengths @ [1, 2]), 6.0])
    free = System(lambda q, v, t: q[0] * (v @ v) / 2 - q[1], ["x", "y"])
    ends = Event(0.0, [2.0, 0.0]), Event(None, last)
    problem = Problem(free, *ends, through=inner, energy=5.0)
    expected = [2 * np.sqrt(3.0 / 10.0), 2 * np.sqrt(4.0 / 8.0)]
    np.testing.assert_allclose(through._durations(problem, points), expected)
    path, times = begin(problem, points, np.ones(2), np.ones(2))
    np.testing.assert_allclose(times, np.cumsum([0.0, *expected]))
    np.testing.assert_allclose(path(times), points.T, atol=1e-12)


def test_first_points_are_put_on_moving_surfaces_twice_and_copied():
    wall = Event(None, None, on=lambda q, t: q[1] - t)
    problem = Problem(FREE, Event(0.0, [0.0, 0.0]), Event(2.0, [4.0, 0.0]), through=[wall])
    points = np.array([[0.0, 0.0], [1.0, 0.0], [4.0, 0.0]])
    path, times = begin(problem, points, np.ones(2), np.ones(2))
    assert points[1].tolist() == [1.0, 0.0]
    share = [np.hypot(1, y) / (np.hypot(1, y) + np.hypot(3, y)) for y in (1.0, path(times[1])[1])]
    assert path(times[1]) == pytest.approx([1.0, 2 * share[0]], abs=1e-9)
    assert times[1] == pytest.approx(2 * share[1])


def test_a_curve_passes_inner_events_in_their_order_where_it_is_nearest():
    t = np.linspace(1.0, 3.0, 201)
    q = np.array([np.sin(np.pi * (t - 1)), t / 2])
    wall, edge = (Event(None, None, on=lambda q, t, c=c: c * (q[1] - 1.0)) for c in (1.0, 1e-3))
    for inner, expected in (
        ([Event(None, [None, 0.75]), wall], [1.5, 2.0]),
        ([Event(None, [None, 0.75]), edge], [1.5, 2.0]),
        ([Event(None, [0.0, None])], [2.0]),
        ([Event(1.3, [0.0, None])], [1.3]),
        ([Event(None, [1.0, None]), Event(None, [-1.0, None])], [1.5, 2.5]),
        ([], []),
    ):
        problem = Problem(FREE, Event(1.0, [0.0, 0.5]), Event(3.0, [0.0, 1.5]), through=inner)
        assert through._pass_times(problem, t, q) == pytest.approx(expected, abs=1e-9)


def test_polygons_go_ever_farther_from_the_first_and_keep_what_is_given():
    inner = [Event(None, [1.0, None])]
    problem = Problem(FREE, Event(0.0, [0.0, 0.0]), Event(2.0, [2.0, 0.0]), through=inner)
    base, rng = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]), np.random.default_rng(0)
    far = []
    for few in ((0, 8), (90, 98)):
        for k, found in enumerate(through._polygons(problem, base, np.ones(2), rng, *few), few[0]):
            assert found is not None
            path, times = found
            corners = path(times).T
            np.testing.assert_allclose(corners[:, 0], [0.0, 1.0, 2.0], atol=1e-12)
            np.testing.assert_allclose(corners[[0, 2], 1], 0.0, atol=1e-12)
            lengths = np.linalg.norm(np.diff(corners, axis=0), axis=1)
            assert (times[1] / 2 == pytest.approx(lengths[0] / lengths.sum())) == (k < 2)
            far.append(abs(corners[1, 1]))
    assert far[0] == 0.0 < far[1]
    assert np.mean(far[8:]) > 3 * np.mean(far[1:8])


def test_the_duration_of_an_energy_is_between_two_that_are_tried(monkeypatch):
    problem = Problem(FREE, Event(0.0, [0.0, 0.0]), Event(None, [3.0, 0.0]), energy=2.0)
    tried = []

    def solve(asked, tol, watch):
        T = asked.duration
        tried.append(T)
        energy = (3.0 / T) ** 2 / 2
        return fake(success=True, end=asked.end, energy=lambda t: energy, T=T)

    monkeypatch.setattr(free_contact, "solve_on_the_way", solve)
    for first in (0.2, 1.5, 9.0):
        tried.clear()
        found: Any = free_contact._near_energy(problem, first, None)
        assert abs(found.T / 1.5 - 1) < free_contact.NEAR_DURATION
        assert tried[0] == first
        assert len(tried) <= free_contact.BISECTED
    monkeypatch.setattr(free_contact, "solve_on_the_way", lambda *_: fake(success=False))
    assert free_contact._near_energy(problem, 1.0, None) is None


# -- parts of forces, rates and places -------------------------------------------------------------


def test_a_rate_that_overflows_is_that_of_a_flat_function():
    rate = np.array([1.0, np.inf, np.nan, -2.0])
    assert energy_balance._flat(rate).tolist() == [1.0, 0.0, 0.0, -2.0]


def test_what_lies_on_an_obstacle_is_put_there_with_its_velocity():
    system = System(
        lambda q, v, a, t: a @ a / 2, ["x", "y"], obstacle=lambda q, t: q @ q - (1 + t) ** 2
    )
    a = 0.3
    on = np.array([2 * np.cos(a), 2 * np.sin(a), np.cos(a) - np.sin(a), np.sin(a) + np.cos(a)])
    off = on + 1e-6 * np.array([1.0, 2.0, -3.0, 1.0])
    found = put_on_obstacle(system, off, 1.0, np.empty((1, 0)))
    q, v = found[:2], found[2:]
    assert np.linalg.norm(q) == pytest.approx(2.0, abs=1e-11)
    assert v @ q / np.linalg.norm(q) == pytest.approx(1.0, abs=1e-10)
    assert np.abs(found - off).max() < 1e-5
    assert put_on_obstacle(FREE, off, 1.0, np.empty((1, 0))) is off


CHAIN = System(
    lambda q, v, t: q[0] * np.sqrt(1 + v[0] ** 2), ["y"],
    integral=lambda q, v, t: np.sqrt(1 + v[0] ** 2),
)  # fmt: skip


@pytest.mark.parametrize("height", [0.7, -9.0])
def test_the_multiplier_of_a_chain_is_the_height_of_its_directrix(height):
    # y = height + cosh t is stationary for the weight (y - height) dl.
    t = 1.3
    problem = Problem(
        CHAIN, *(Event(s * t, [height + np.cosh(t)]) for s in (-1, 1)), integral=2 * np.sinh(t)
    )
    mesh = Mesh.uniform(-t, t, 6, 8)
    tr = Transcription(problem, mesh, np.ones(1))
    at = DiscretePath(tr, tr.pack(height + np.cosh(mesh.nodes)[:, None]))
    kappa = bordered._balance(tr, at)
    assert kappa == pytest.approx([-height], abs=1e-8)
    np.testing.assert_array_equal(bordered._make_definite(tr, at, kappa), kappa)
    # L_vv = (y + kappa) / (1 + v^2)^(3/2) is of both signs for these.
    low, high = -height - np.cosh(t), -height - 1.0
    out = bordered.DEFINITE * (high - low)
    for inside, nearest in ((high - 0.1, high + out), (low + 0.1, low - out)):
        found = bordered._make_definite(tr, at, np.array([inside]))
        assert found == pytest.approx([nearest], abs=1e-2)


# -- the duration of an energy, and contacts -------------------------------------------------------


def over_known_energies(monkeypatch, energy):
    """Return first paths where the path over T has the energy 1 + 0.3 ln(T / 3)^2."""
    found: Any = object.__new__(FirstPaths)
    problem = Problem(FREE, Event(0.0, [0.0, 0.0]), Event(None, [1.0, 0.0]), energy=energy)
    vars(found).update(problem=problem, tol=1e-8, hint="", blocked="", merged=None)

    def over(self, T, near=None):
        return fake(mesh=fake(duration=T)) if 0.2 < T < 40.0 else None

    monkeypatch.setattr(FirstPaths, "_over", over)
    monkeypatch.setattr(FirstPaths, "_sharp", lambda self, at: at)
    monkeypatch.setattr(
        FirstPaths, "excess", lambda _, at: energy - 1 - 0.3 * np.log(at.mesh.duration / 3) ** 2
    )
    return found


def test_energies_are_passed_on_either_side_of_a_duration(monkeypatch):
    scan = over_known_energies(monkeypatch, 1.5)
    for T in (3.3, 0.5, 12.0):
        found = [at.mesh.duration for at in scan._scan(T, scan._over(T))]
        sides = 3 * np.exp(np.array([-1, 1]) * np.sqrt(0.5 / 0.3))
        np.testing.assert_allclose(sorted(found), sides, rtol=0.02)
    assert not scan.hint


def test_the_lowest_energy_is_told_and_a_duration_beside_it_tried(monkeypatch):
    scan = over_known_energies(monkeypatch, 0.9)
    (aside,) = scan._scan(4.0, None)
    assert aside.mesh.duration == pytest.approx(first_paths.BELOW_LOWEST * 3.0, rel=1e-3)
    assert "the lowest energy is that over 3, 1, above the one given by 0.1" in scan.hint
    assert scan.merged is None
    scan = over_known_energies(monkeypatch, 1.0)
    list(scan._scan(4.0, None))
    assert scan.merged.mesh.duration == pytest.approx(3.0, rel=1e-3)
    assert "two paths merge" in scan.hint


@at_once(
    ("arcs", "a", "b", "fixed", "moments", "expected"),
    [
        ([(0, 1, 2), (0, 3, 4), (1, 1, 5)], 2, 3, (), False, [(0, 1, 4), (1, 1, 5)]),
        ([(0, 3, 4), (0, 1, 2)], 2, 3, (3,), False, [(0, 1, 4)]),
        ([(0, 1, 2), (0, 3, 4)], 1, 2, (), False, [(0, 3, 4)]),
        ([(0, 1, 2), (0, 3, 4)], 1, 2, (), True, [(0, 1.5, 1.5), (0, 3, 4)]),
        ([(0, 1, 2), (0, 3, 4)], 1, 2, (2,), False, [(0, 2, 2), (0, 3, 4)]),
        ([(0, 1, 2), (1, 2.5, 4)], 2, 2.5, (2, 2.5), True, [(0, 1, 2), (1, 2, 4)]),
        ([(0, 1, 1), (0, 2, 2)], 1, 2, (), True, [(0, 1.5, 1.5)]),
    ],
)  # fmt: skip
def test_what_is_between_two_times_of_contact_vanishes(arcs, a, b, fixed, moments, expected):
    held = fake(arcs=tuple(Arc(*arc) for arc in arcs), fixed_times=fixed)
    assert merge_contacts(held, a, b, moments=moments) == tuple(Arc(*arc) for arc in expected)


def test_a_moment_between_two_runs_inside_becomes_two():
    t = np.linspace(0.0, 1.0, 11)
    point, other, deep = Arc(0, 0.5, 0.5), Arc(1, 0.5, 0.5), [(3, 4, 0.41), (6, 7, 0.62)]
    arcs, left = _part_moments([point, other], 0, t, [*deep, (9, 10, 0.95)])
    assert (arcs, left) == ([other, Arc(0, 0.41, 0.41), Arc(0, 0.62, 0.62)], [(9, 10, 0.95)])
    for few in (deep[:1], deep[1:], [(3, 7, 0.5)], [(1, 2, 0.15), deep[1]]):
        assert _part_moments([point], 0, t, few) == ([point], few)
    arc = Arc(0, 0.5, 0.55)
    assert _part_moments([arc], 0, t, deep) == ([arc], deep)


# -- counts of eigenvalues, directions and classes of paths ----------------------------------------


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ([-2.0, -0.5, 1.0], (2, 0)),
        ([-2.0, 3e-12, -1e-12, 1.0], (1, 2, 1e-12)),
        ([3e-12, 1e-30, 1.0], (0, 2, 2.9e-17)),
    ],
)
def test_the_smallest_eigenvalue_is_told_where_some_vanish(monkeypatch, values, expected):
    monkeypatch.setattr(index, "_below", lambda form, mu: int(np.sum(np.array(values) < mu)))
    monkeypatch.setattr(index, "check_legendre", lambda form: None)
    found = index.inertia_of(fake(freedom=3), 1e-9)
    assert (found.index, found.nullity, found.tolerance) == (*expected[:2], 1e-9)
    if len(expected) == 2:
        assert found.smallest is None
    else:
        assert expected[2] <= found.smallest <= 1.1 * expected[2]
    assert index.inertia_of(fake(freedom=0)).index == 0


def test_a_curve_goes_on_in_the_direction_it_came_from():
    way = HomotopyCurve(fake(layout=fake(unknowns=2)), np.zeros(3), np.zeros(3))
    slope = np.array([3.0, 4.0, 7.0])
    norm = np.sqrt(12.5 + 1)
    way._keep_direction(slope)
    assert way.direction == pytest.approx(slope / norm)
    assert way.ds == pytest.approx(1 / norm)
    for sign in (-1.0, -1.0, 1.0):  # through a fold, and on, and through another one
        way._keep_direction(sign * slope)
        assert np.sign(way.ds) == sign
        assert way.direction == pytest.approx(slope / norm)


def test_a_scan_finds_all_velocities_at_which_motions_arrive(monkeypatch):
    problem: Any = fake(system=fake(m=0), lengths=np.ones(1), end=fake(t=1.0))
    monkeypatch.setattr(velocity_scan, "directions", lambda problem, q, t: np.eye(1))
    even = np.linspace(-3.05, 3.0, 21)[None]
    monkeypatch.setattr(velocity_scan, "_grid", lambda problem, far, count: even)
    monkeypatch.setattr(velocity_scan, "_ends", lambda problem, v: v**2 - 1)
    goals = np.array([[0.0, 3.0, -1 + 1e-4, -1.01]])  # the third nearly at the least end
    v, which, sampled, known = velocity_scan.scan(problem, np.ones(1), goals, 21)
    assert which.tolist() == [0, 0, 1, 1, 2, 2] and known
    np.testing.assert_allclose(v[0] ** 2 - 1, goals[0, which], atol=4e-3)
    assert np.sign(v[0]).tolist() == [-1, 1] * 3
    assert 21 < sampled < 21 + 2 * 2 * 32
    fast = lambda problem, v: np.where(np.abs(v) > 1.5, np.nan, np.sin(12 * v))  # noqa: E731
    monkeypatch.setattr(velocity_scan, "_ends", fast)
    v, _, _, known = velocity_scan.scan(problem, np.ones(1), np.zeros((1, 1)), 21)
    assert not known  # some of them cannot be followed
    assert np.diff(v[0]) == pytest.approx(np.pi / 12, abs=1e-3)  # none is passed over


def test_an_end_is_of_the_class_of_its_turns():
    search: Any = object.__new__(searches.Answers)
    search.problem, search.turning = Problem(FREE, Event(0.0, [0, 0]), Event(1.0, [0.5, 1.0])), (1,)
    search.classes = [fake(turns=(k,)) for k in (-1, 0, 2)]
    for angle, turns in ((1.0, 0), (-3.0, -1), (3.0, 0), (1 + 4 * np.pi, 2), (1 + 2 * np.pi, None)):
        found = search._nearest(np.array([7.0, angle]))
        assert found is None if turns is None else found.turns == (turns,)


# -- motions that are traced from surface to surface -----------------------------------------------


def tracer(energy=None):
    fall = System(lambda q, v, t: v @ v / 2 - 2 * q[1], ["x", "y"])
    wall = Event(None, None, on=lambda q, t: q[0] - 1)
    last = Event(None if energy else 3.0, [3.0, 0.0])
    problem = Problem(fall, Event(1.0, [0.0, 0.5]), last, through=[wall], energy=energy)
    return RayTracer.of(problem, np.array([1.0, 2.0]), 2.0)


def test_first_rays_go_in_all_directions_at_many_speeds():
    found = tracer()
    assert found._thrown_speed() == pytest.approx(2 / 2 * 2.0 / 2)
    v = found.all_round(np.random.default_rng(0)) / found.size
    angles = np.sort(np.arctan2(v[:, 1], v[:, 0]))
    np.testing.assert_allclose(np.diff(angles), 2 * np.pi / len(v), atol=1e-9)
    speeds = np.linalg.norm(v, axis=1)
    slowest, fastest = 1 / RAY_SPEEDS, RAY_SPEEDS + 1
    assert slowest <= speeds.min() < 1.3 * slowest
    assert fastest / 1.3 < speeds.max() <= fastest
    assert np.median(speeds) == pytest.approx(np.sqrt(slowest * fastest), rel=0.3)


def test_rays_are_given_the_energy_and_those_that_come_late_are_thrown_faster():
    found = tracer(energy=5.0)
    u = found.of_energy(np.array([[1.0, 0.0], [3.0, 4.0]]))
    np.testing.assert_allclose(u, np.sqrt(8.0) * np.array([[1.0, 0.0], [0.6, 0.8]]))
    times = np.array([[1.0, 5.0], [1.0, np.nan], [1.0, 2.0]])
    u = np.array([[1.0, 2.0], [3.0, 4.0], [4.0, 6.0]])
    later = tracer().in_time(fake(times=times, u=u))
    np.testing.assert_allclose(later, [[2.0, 4.0], [3.0, 4.0], [2.0, 3.0]])
    assert u[0, 0] == 1.0
    assert tracer().of_energy(u) is u


def test_closed_rays_begin_anywhere_inside_of_walls():
    wall = ao.Bounce(lambda q, t: q[0] + 0.5)
    problem = Problem(
        FREE, Event(0.0, [None, 0.2]), ao.Periodic(2.0), through=[wall, wall]
    )  # fmt: skip
    found: Any = ClosedRayTracer.of(problem, np.array([1.0, 2.0]), 2.0)
    np.testing.assert_allclose(found.unit, [1.0, 1.5, 3.0])
    u = found.all_round(np.random.default_rng(0))
    q, v, t = found.begin(u)
    assert (q[:, 0] > -0.5).all()
    assert (q[:, 0] < 1).all()
    assert (q[:, 1] == 0.2).all()
    assert (t == 0).all()
    np.testing.assert_array_equal(u, np.column_stack([q[:, 0], v]))
    speeds = np.linalg.norm(v / [1.5, 3.0], axis=1)
    assert 1 / RAY_SPEEDS <= speeds.min() < 1.0 < speeds.max() <= RAY_SPEEDS
    first = np.array([[0.1, 0.2]]), np.array([[1.0, -1.0]])
    away = found._return(np.array([[1.1, 0.2]]), np.array([[1.0, 2.0]]), first)
    np.testing.assert_allclose(away, [[1.0, 0.0, 0.0, 1.0]])


def test_the_search_knows_the_nearest_rays_and_the_best():
    rng = np.random.default_rng(1)
    made = fake(size=np.ones(2), unit=np.array([1.0, 2.0]), at=fake(joints=[0, 1]), span=2.0)
    search = RaySearch(made)
    for count in (30, 17):
        u = rng.standard_normal((count, 2))
        cost = np.where(rng.uniform(size=count) < 0.2, np.inf, (u[:, 0] - 0.3) ** 2 + u[:, 1] ** 2)
        places, times = u[:, None] * [[0.0], [1.0]], np.tile([1.0, 3.0], (count, 1))
        search.add(fake(u=u, cost=cost, places=places, times=times, tracks=[]))
    apart = np.linalg.norm((search.u[:, None] - search.u) / made.unit, axis=2)
    np.fill_diagonal(apart, np.inf)
    np.testing.assert_allclose(
        np.sort(search.apart, axis=1), np.sort(apart, axis=1)[:, : search.count]
    )
    np.testing.assert_allclose(search.apart, np.take_along_axis(apart, search.near, axis=1))
    best = [
        k for k in range(47)
        if np.isfinite(search.cost[k]) and search.cost[k] <= search.cost[search.near[k]].min()
    ]  # fmt: skip
    assert sorted(search.minima()) == best
    assert (np.diff(search.cost[search.minima()]) >= 0).all()
    assert search.minima()[0] == np.argmin(search.cost)
    few = search.closer(rng, 2 * len(best))
    for row, k in zip(few, np.resize(search.minima()[:BEST_RAYS], len(few)), strict=True):
        assert (
            np.linalg.norm((row - search.u[k]) / made.unit) < 5 * RAY_SPREAD * search.apart[k].max()
        )
    told = [ray.times.tolist() for ray in search.nearest(np.inf)]
    assert told == [[1.0, 3.0]] * len(told)
    assert np.array(search.told)[0] == pytest.approx(search.u[np.argmin(search.cost)])
    assert not list(search.nearest(np.inf))
    search.told.clear()
    assert not list(search.nearest(search.cost.min()))


def test_rays_are_added_where_neighbours_part():
    search: Any = object.__new__(RaySearch)
    u = np.array([[1.0], [2.0], [3.0], [5.0]])
    where = np.array([0.0, 0.1, 2.0, np.nan])[:, None, None] * np.ones((1, 1, 2))
    near = np.array([[1, 2], [0, 2], [1, 3], [2, 1]])
    apart = np.abs(u[near][..., 0] - u)
    vars(search).update(tracer=fake(unit=np.ones(1)), u=u, where=where, near=near, apart=apart)
    # 0 and 2, 1 and 2 come to places apart; of 2 and 3 one does not come.
    found = search.between(9)
    assert sorted(found[:, 0]) == [2.0, 2.5, 4.0]
    assert len(search.between(2)) == 2


# -- what becomes of starts ------------------------------------------------------------------------


def test_motions_that_are_known_are_not_sought_again(monkeypatch):
    search: Any = object.__new__(searches.Answers)
    one, other = (fake(turns=(k,), name=k) for k in (0, 1))
    known = fake(start=fake(v=np.array([1.0, 0.0])))
    mesh = Mesh([1.0, 3.0], [1])
    end = Event(3.0, [2.0, 1.0])
    one.problem = other.problem = ACROSS.replace(end=end)
    vars(search).update(problem=ACROSS, classes=[one, other], found=[(known, (0,), "")])
    search.tell, search._start = lambda *_: None, lambda c, path, how: (c.name, path.values)
    v0 = np.array([[1.0, 1.0, 2.0, 2.0, -1.0], [0.0, 0.0, 1.0, 1.0, 1.0]])
    tried = []

    def motions(problem, v):
        tried.append(v)
        paths = [Path(mesh, np.array([[0.5, 1.5], [0.0, 0.5]])) for _ in v.T]
        return [*paths[:-1], None]

    monkeypatch.setattr(searches, "motions", motions)
    found = list(search._arrivals([one, other, one, one, other], v0))
    # The first is known, of the same class; the fourth is the third.
    np.testing.assert_array_equal(tried[0], v0[:, [1, 2, 4]])
    assert [name for name, _ in found] == [1, 0]
    for _, values in found:  # what is missed at the end is spread over the way
        np.testing.assert_allclose(values, [[0.5, 2.0], [0.0, 1.0]])
    assert not list(search._arrivals([one], v0[:, :1]))


def test_modes_are_let_go_in_turn(monkeypatch):
    held = resonances._Held(
        np.array([7.0]), np.eye(3)[:, :2], np.array([4.0, 6.0]), np.array([-2.0, 3.0])
    )
    assert held.root == 2.0
    turned = held.next()
    assert (turned.forces.tolist(), turned.slopes.tolist()) == ([6.0, 4.0], [3.0, -2.0])
    np.testing.assert_array_equal(turned.modes, np.eye(3)[:, [1, 0]])
    free, asked = resonances._Held(np.array([9.0]), np.eye(3)[:, :0], *2 * (np.zeros(0),)), []
    search = resonances.Resonances(fake())

    def settle(self, z, modes, steps, *, hold, grown=0.0):
        asked.append(hold)
        return next(settled)

    def release(self, at):
        asked.append(at.forces.tolist())
        return next(released)

    monkeypatch.setattr(resonances.Resonances, "_settle", settle)
    monkeypatch.setattr(resonances.Resonances, "_release", release)
    settled, released = iter([free]), iter([])
    assert search.path(np.zeros(1)) is free.z
    assert asked == [False]
    asked.clear()
    settled, released = iter([None, held, free]), iter([None, (np.zeros(1), np.eye(3)[:, :1])])
    assert search.path(np.zeros(1)) is free.z
    assert asked == [False, True, [4.0, 6.0], [6.0, 4.0], True]
    settled, released = iter([None, held]), iter([None, None])
    assert search.path(np.zeros(1)) is None


def test_legs_are_compared_by_the_worst_of_them(monkeypatch):
    names = ("position", "velocity", "arrival", "local", "energy_drift", "reference_error",
             "allowed", "amplified")  # fmt: skip
    known = {name: float(k) for k, name in enumerate(names)}
    turned = {name: 7.0 - k for name, k in known.items()}
    monkeypatch.setattr(compare, "_join_paths", lambda paths: paths)
    legs: Any = [fake(**known, path="a", reason=""), fake(**turned, path=None, reason="far")]
    found = compare.join(legs, 6.0)
    assert (found.path, found.reason) == (["a"], "far")
    assert [getattr(found, name) for name in names] == [7, 6, 5, 6, 4, 5, 6, 7]


def test_a_path_runs_away_that_falls_and_is_far_from_the_first(monkeypatch):
    monkeypatch.setattr(descent, "_falls", lambda tr, first, step: step.tolist() == [2.0, -0.5])
    first = np.array([1.0, 1.0])
    tr: Any = None
    assert descent._runs_away(tr, first, np.array([3.0, 0.5]))
    assert not descent._runs_away(tr, first, np.array([-1.0, 0.5]))
    assert not descent._runs_away(tr, first, first + [1.0, -0.5])


def test_one_retry_is_told_from_another():
    def told(known, guess):
        return retry_of({"tol": 1e-8}, known, guess)

    path = Path(Mesh([0.0, 1.0], [1]), np.array([[0.0, 1.0]]))
    moved = Path(Mesh([0.0, 2.0], [1]), np.array([[0.0, 1.0]]))
    seen = [told(b"a", None), told(b"b", None), told(b"a", path), told(b"a", moved),
            told(b"a", [1.0])]  # fmt: skip
    assert len({tuple(x.items()) for x in seen}) == len(seen)
    assert all(x["tol"] == 1e-8 for x in seen)
    assert told(b"a", path) == told(b"a", Path(path.mesh, path.values.copy()))


def test_what_ipopt_finds_at_a_bound_has_its_multiplier():
    x = ca.MX.sym("x", 2)
    found, mu, rows = ipopt.minimize(x, ca.sumsqr(x - 2), x[0] + x[1], np.zeros(2), np.ones(1))
    np.testing.assert_allclose(found.z, [0.5, 0.5], atol=1e-5)
    np.testing.assert_allclose(mu, [3.0], atol=1e-4)
    np.testing.assert_allclose(rows, [1.0], atol=1e-5)


def test_a_push_is_lessened_until_none_is_left(monkeypatch):
    found, done, here = ao.Status.SOLVED, [], fake(push_force=8.0)
    monkeypatch.setattr(unfixed, "refine", lambda run, tol, least: done.append("refine") or found)

    def lessen():
        done.append(here.push_force)
        here.push_force /= 4
        return here.push_force > least

    run = fake(here=here, tol=1e-8, _lessen_push=lessen, _hold=lambda: "held")
    run._is_pushed = lambda at: at.push_force > 0.1
    least = 0.01
    assert Unfixed._refine(run) is found
    assert done == [8.0, 2.0, "refine", 0.5, "refine", 0.125, "refine"]
    here.push_force, least = 8.0, 1.0
    assert Unfixed._refine(run) == "held"


# -- which way a search goes on --------------------------------------------------------------------


@pytest.mark.parametrize(
    ("known", "of_line", "tried", "blocked"),
    [
        (([0.0, 5.0], 1.0), None, [5.0], ""),
        (([0.0, 5.0], -1.0), [2.0, 3.0], [2.0, 3.0, 5.0], "the energy is below"),
        (([0.0, 5.0], 0.0), [], [5.0], ""),
        (None, [2.0], [2.0], ""),
        (None, [], [7.0], ""),
    ],
)
def test_durations_are_those_of_motions_or_of_the_line(monkeypatch, known, of_line, tried, blocked):
    found: Any = object.__new__(FirstPaths)
    vars(found).update(problem=ACROSS, blocked="", lost=[])
    monkeypatch.setattr(first_paths, "times_along", lambda *_: known)
    monkeypatch.setattr(first_paths, "return_time", lambda *_: 7.0)
    found._durations_of_energy = lambda: list(of_line)
    found._over = lambda T: None if T == 2.0 else T
    found._scan = lambda T, first: iter([("beside", T, first)])
    over = [T for T in tried if T != 2.0]
    beside = ("beside", tried[-1], None if tried[-1] == 2.0 else tried[-1])
    assert list(found.over_durations()) == [*over, beside]
    assert found.lost == [T for T in tried if T == 2.0]
    assert found.blocked.startswith(blocked)
    assert bool(found.blocked) == bool(blocked)


def test_forward_motions_are_tried_where_ends_are_given(monkeypatch):
    def search(closed=False, n=2, pinned=2, freedom=2, found=()):
        whole = fake(pinned=tuple(range(pinned)))
        system = fake(n=n, m=0, degrees_of_freedom=freedom)
        problem = fake(system=system, start=whole, end=fake(pinned=tuple(range(n))))
        made = fake(problem=problem, closed=closed, seed=0, far=None, found=list(found))
        made._close = lambda shots: iter(["close"])
        made._aim = lambda v: iter([("aim", v)])
        return made

    speeds = []
    monkeypatch.setattr(searches, "velocities", lambda p, far, count, rng: np.full((1, count), 3.0))
    monkeypatch.setattr(
        searches, "in_directions", lambda p, speed, rng: speeds.append(speed[0]) or "round"
    )
    shots: Any = searches.Answers._forward_shots
    assert list(shots(search(closed=True), 4)) == ["close"]
    for nothing in (search(pinned=1), search(freedom=0), search(n=1, pinned=1, freedom=1)):
        assert not list(shots(nothing, 9))
    assert not list(shots(search(), 3))
    known = [(fake(start=fake(v=np.array([3.0, 4.0]))), (), "")]
    made = search(found=known)
    tried = list(shots(made, 5))
    assert len(tried) == 3  # two batches that find nothing end it
    assert speeds[0].min() >= 4.0
    assert [x.size for x in speeds] == [5, searches.LAST_SHOTS * 5]
    assert np.ptp(speeds[0]) == pytest.approx(2.0)
    speeds.clear()
    made = search()
    made._aim = lambda v: made.found.append(known[0]) or iter([v])
    assert len(list(shots(made, 5))) == 1 + searches.SHOT_BATCHES


def test_paths_to_surfaces_are_sought_from_points_and_motions(monkeypatch):
    run = fake(problem=ACROSS, tol=1e-8, seed=3, classes=["class"], tell=lambda *_: None)
    monkeypatch.setattr(searches, "points", lambda problem, starts, seed: [(starts, seed)] * 2)
    reached = lambda p, tol, watch, pairs: [fake(path=pair) for pair in pairs]  # noqa: E731
    monkeypatch.setattr(searches, "paths_to_points", reached)
    monkeypatch.setattr(searches, "motions_to_surfaces", lambda problem, watch: ["motion"])
    found = [(s.guess, s.how) for s in searches.Answers._on_surfaces(run, 5, 1)]
    at = ((5, 3), "a point on a surface")
    assert found == [(None, "as `solve` does"), at, at, ("motion", "a forward shot")]
    assert len(list(searches.Answers._on_surfaces(run, 5, 0))) == 3


def test_a_window_to_a_surface_keeps_the_least_path(monkeypatch):
    mesh, nowhere = Mesh([0.0, 1.0], [3]), fake(success=False)
    choices = Choices(1e-9, "auto", STRATEGIES, mesh, None)

    def free(problem, near, choices):
        return fake(
            success=near is not None and near.action < 9, action=getattr(near, "action", 0)
        ), near

    def between(problem, guess, choices, verdict=True):
        return (problem if choices.mesh is None else ("between", problem)), ""

    monkeypatch.setattr(nearest_points, "points", lambda problem: [(p, None) for p in known])
    monkeypatch.setattr(unfixed, "solve_free_boundary", free)
    monkeypatch.setattr(revisions, "between", between)
    to, plain = fake(on_surface=True), fake(on_surface=False)
    assert revisions._on_window(plain, None, choices)[0] == ("between", plain)
    assert revisions._on_window(to, fake(action=3), choices)[0].action == 3
    known = [nowhere, *(fake(success=True, action=a) for a in (9.0, 5.0, 2.0, 4.0))]
    assert revisions._on_window(to, None, choices)[0].action == 2.0
    known = [nowhere, fake(success=True, action=9.5), fake(success=True, action=9.0)]
    assert revisions._on_window(to, None, choices)[0].action == 9.5
    known = [nowhere]
    assert revisions._on_window(to, None, choices)[1] is None


def test_what_a_search_may_cost_is_limited_once():
    def search(**known):
        found: Any = object.__new__(Search)
        vars(found).update(dict(curved=False, budget=np.inf, saddle=None, principle="auto") | known)
        return found

    plain = search(ws=fake(watch=None))
    assert not plain._is_exhausted
    plain._limit(10)
    watch = plain.ws.watch
    assert watch.most == plain.budget == BUDGET
    watch.evaluated = 100
    plain._limit(10)
    assert (watch.most, plain.budget) == (BUDGET, BUDGET)
    saddle = search(ws=plain.ws, saddle=object(), budget=BUDGET)
    saddle._limit(10)
    assert watch.most == 110
    assert not saddle._is_exhausted
    assert watch.most == BUDGET
    saddle.principle = "stationary"
    saddle._limit(10)
    assert watch.most == BUDGET
    watch.evaluated = BUDGET + 1
    assert saddle._is_exhausted
    assert watch.most == np.inf
    curved = search(ws=fake(watch=fake(has_costs=True)), curved=True)
    curved._limit(10)
    assert curved.budget == np.inf
    timed = search(ws=fake(watch=fake(has_costs=False)))
    timed._limit(10)
    assert timed.budget == np.inf
    watch.most, plain._refine = 7.0, lambda: watch.most
    assert (plain.refine(), watch.most) == (np.inf, 7.0)  # a path in hand is not given up


def test_amplitudes_are_changed_until_the_integral_is_that_given(monkeypatch):
    # |z|^2 for z = origin + a . variations
    monkeypatch.setattr(waves, "DiscretePath", lambda tr, z: z)
    monkeypatch.setattr(waves, "integrals", lambda z: (np.array([z @ z]), 2 * z[None, :3]))
    origin, variations = np.array([1.0, 0.0, 0.0]), np.array([[0.0, 2.0, 0.0], [0.0, 0.0, 1.0]])
    tr: Any = None
    off, step = waves._correct(tr, origin, variations, np.array([1.0, 0.0]), np.array([3.0]))
    np.testing.assert_allclose(off, [2.0])
    np.testing.assert_allclose(step, [-0.25, 0.0])
    for size, square in ((1e3, 5.0), (0.1, 5.0), (3.0, 101.0)):
        a = size * np.array([1.0, 0.5])
        found = waves._project(tr, origin, variations, a, np.array([square]))
        assert found is not None
        assert found @ found == pytest.approx(square, rel=1e-6)
        assert found[0] == 1.0
    assert waves._project(tr, origin, variations, np.ones(2), np.array([0.5])) is None
    assert waves._project(tr, origin, variations, np.full(2, np.nan), np.array([5.0])) is None


@at_once(
    ("values", "height"),
    [
        ([0, 1, 2, 3, 6, 7, 8, 9], 6.0),
        ([3, 1, 2, 0, 9, 6, 8, 7], 6.0),
        ([0, 1, 2, 3, 5.99, 6.99, 7.99, 8.99], 0.0),
        ([9, 9, 9, 9, 2, 2, 2, 2], 7.0),
        ([9, 9, np.inf, 9, 2, np.nan, 2, 2], 7.0),
        ([0, 1, 2, np.nan, 6, 7, 8, np.inf], 6.0),
        ([np.nan, np.nan, np.nan, np.nan, 2, 2, 2, 2], 0.0),
        ([5, 5, 5, 5, 5, 5, 5, 5], 0.0),
    ],
)
def test_the_height_of_a_jump_is_that_of_the_medians(values, height):
    found = crossing._heights(np.array([values, 2 * np.array(values, dtype=float)]))
    assert found == pytest.approx([height, 2 * height])


def test_paths_are_packed_and_found_again():
    rng = np.random.default_rng(0)
    meshes = [Mesh([0.0, 1.0, 1.5], [3, 2]), Mesh([2.0, 5.0], [4]), Mesh([-1.0, 0.0, 3.0], [1, 5])]
    paths = [Path(mesh, rng.standard_normal((2, mesh.nodes.size))) for mesh in meshes]
    packed = PackedPaths.of(np.array([4, 9, 7]), paths)
    for member, path in zip((4, 9, 7), paths, strict=True):
        found = packed.path(member)
        assert found is not None
        np.testing.assert_array_equal(found.values, path.values)
        np.testing.assert_array_equal(found.mesh.boundaries, path.mesh.boundaries)
        assert found.mesh.degrees == path.mesh.degrees
    assert packed.path(5) is None


# -- times and places that an energy gives ---------------------------------------------------------

RAMP = System(lambda q, v, t: 1.5 * v[0] ** 2 - 6 * q[0], ["x"])  # a mass of 3, pulled by 6


def up_the_ramp(energy, start=0.0, end=1.0):
    return Problem(RAMP, Event(0.0, [start]), Event(None, [end]), energy=energy)


def test_speeds_of_the_energy():
    q, u = np.array([[0.0], [0.5], [3.0]]), np.array([[2.0], [-0.1], [1.0]])
    found, left = durations.rates(up_the_ramp(9.0), q, u, np.zeros((3, 1)))
    assert left == pytest.approx([9.0, 6.0, -9.0])
    assert found[:2] * np.abs(u[:2, 0]) == pytest.approx([np.sqrt(6.0), 2.0])
    assert np.isnan(found[2])
    fast = System(lambda q, v, t: -np.sqrt(1 - v[0] ** 2), ["x"])  # the energy is 1 / sqrt(1 - v^2)
    problem = Problem(fast, Event(0.0, [0.0]), Event(None, [1.0]), energy=1.25)
    found, left = durations.rates(problem, q, 0.5 * u, np.zeros((3, 1)))
    assert found * u[:, 0] / 2 == pytest.approx([0.6, -0.6, 0.6])
    assert left == pytest.approx([0.25] * 3)
    stiff = System(lambda q, v, t: v[0] ** 4 / 4, ["x"])  # the energy is 3/4 v^4
    problem = Problem(stiff, Event(0.0, [0.0]), Event(None, [1.0]), energy=12.0)
    found, _ = durations.rates(problem, q, u, np.zeros((3, 1)))
    assert found * u[:, 0] == pytest.approx([2.0, -2.0, 2.0])


@pytest.mark.parametrize("energy", [6.0, 13.5])
def test_the_time_up_a_ramp(energy):
    # v falls by 2 per time: t = (v(0) - v(x)) / 2 with v(x)^2 = 2 (E - 6 x) / 3
    q = np.linspace(0.0, 1.0, 7)
    v = np.sqrt(2 * (energy - 6 * q) / 3)
    found = durations.times_along(up_the_ramp(energy), q[:, None], 0.0)
    assert found is not None
    assert found[0] == pytest.approx((v[0] - v) / 2)
    assert found[1] == pytest.approx(energy - 6)
    passage = durations.straight_passage(up_the_ramp(energy))
    assert passage is not None
    t, x, speed = passage
    assert t == pytest.approx((v[0] - speed) / 2)
    assert speed == pytest.approx(np.sqrt(2 * (energy - 6 * x) / 3))
    back = durations.straight_passage(up_the_ramp(energy, 1.0, 0.0))
    assert back is not None
    assert back[0][-1] == pytest.approx(t[-1])
    assert back[2][-1] == pytest.approx(-v[0])
    assert durations.return_time(up_the_ramp(energy), np.zeros(1), 0.0) == pytest.approx(v[0])


def test_where_no_motion_goes_there_is_no_time():
    assert durations.straight_passage(up_the_ramp(5.0)) is None
    assert durations.straight_passage(up_the_ramp(5.0, 0.5, 0.5)) is None
    nowhere = durations.times_along(up_the_ramp(-1.0), np.linspace(0, 1, 5)[:, None], 0.0)
    assert nowhere is None
    assert durations.times_along(up_the_ramp(9.0), np.ones((5, 1)), 0.0) is None
    assert durations.return_time(Problem(FREE, Event(0, [0, 0]), Event(None, [1, 1]), energy=1.0),
                                 np.zeros(2), 0.0) == 1.0  # fmt: skip
    through_ramp = durations.times_along(up_the_ramp(3.0), np.linspace(0, 1, 5)[:, None], 0.0)
    assert through_ramp is not None
    assert (np.diff(through_ramp[0]) > 0).all()
    assert through_ramp[1] == pytest.approx(-3.0)


def test_a_barrier_is_told_where_the_energy_is_below_it():
    words = "the energy 5 is below the potential, 6, at x = 1, which every motion has to pass"
    assert durations.explain_barrier(up_the_ramp(5.0)).startswith(words)
    assert not durations.explain_barrier(up_the_ramp(6.0))
    hill = System(lambda q, v, t: v[0] ** 2 / 2 - 4 * q[0] * (1 - q[0]), ["x"])
    ends = Event(0.0, [0.0]), Event(None, [1.0])
    assert "potential, 1, at x = 0.5" in durations.explain_barrier(Problem(hill, *ends, energy=0.9))
    other = System(lambda q, v, t: v[0] ** 4 - 6 * q[0], ["x"])  # not quadratic in v
    assert not durations.explain_barrier(Problem(other, *ends, energy=5.0))
    negative = System(lambda q, v, t: -(v[0] ** 2) - 6 * q[0], ["x"])
    assert not durations.explain_barrier(Problem(negative, *ends, energy=5.0))
    beam = System(lambda q, v, a, t: a[0] ** 2 / 2, ["x"])  # H = p v + a^2 / 2 is of any size
    ends = Event(0.0, [0.0], v=[1.0]), Event(None, [1.0], v=[1.0])
    assert not durations.explain_barrier(Problem(beam, *ends, energy=-0.3))


def test_a_closed_motion_goes_between_its_turning_points():
    well = System(lambda q, v, t: v[0] ** 2 / 2 - (q[0] - 1) ** 2, ["x"])
    closed = Problem(well, Event(0.0, [None]), ao.Periodic(None), energy=0.25)
    found = durations.between_turning_points(closed)
    assert isinstance(found, ao.Path)
    q = found.values[0]
    assert (q.min(), q.max()) == pytest.approx((0.5, 1.5))
    assert q[0] == q[-1] == q.min()
    assert found.mesh.duration == pytest.approx(2 * np.pi / np.sqrt(2), rel=1e-5)
    assert durations.between_turning_points(closed.replace(energy=-0.1)) is None
    free = Problem(systems.particle("x"), Event(0.0, [None]), ao.Periodic(None), energy=1.0)
    assert durations.between_turning_points(free) is None
    round_ = Problem(
        systems.pendulum(), Event(0.0, [0.5]), ao.Periodic(None, [2 * np.pi]), energy=2.0
    )
    on = durations.between_turning_points(round_)
    assert isinstance(on, ao.Path)
    assert on.values[0, [0, -1]] == pytest.approx([0.5, 0.5 + 2 * np.pi])
    assert on.mesh.duration == pytest.approx(4 / np.sqrt(6) * ellipk(2 / 3), rel=1e-5)
    assert durations.between_turning_points(round_.replace(energy=0.5)) is None


def test_motions_are_timed_and_turned_in_any_units():
    """An oscillator between -2 and 2, of period 2 pi, in units of time and of length."""
    well = System(
        lambda q, v, t, *, s, m: ((v[0] * s) ** 2 - q[0] ** 2) / m**2 / 2,
        ["x"],
        parameters={"s": 1.0, "m": 1.0},
    )
    for s, m in ((1e-14, 1.0), (1e14, 1.0), (1.0, 1e-14), (1.0, 1e14)):
        known = {"parameters": {"s": s, "m": m}, "energy": 2.0}
        found = durations.between_turning_points(
            Problem(well, Event(0.0, [0.0]), ao.Periodic(None), **known)
        )
        assert isinstance(found, ao.Path)
        assert found.mesh.duration == pytest.approx(2 * np.pi * s, rel=1e-5)
        assert np.abs(found.values).max() == pytest.approx(2 * m)
        passage = durations.straight_passage(
            Problem(well, Event(0.0, [-m]), Event(None, [m]), **known)
        )
        assert passage is not None
        assert passage[0][-1] == pytest.approx(np.pi / 3 * s)


def test_a_motion_without_kinetic_energy_has_no_unit_of_time():
    still = Problem(
        System(lambda q, v, t: -q[0], ["x"]), Event(0.0, [0.0]), Event(None, [1.0]), energy=2.0
    )
    found = durations.times_along(still, np.linspace(0.0, 1.0, 5)[:, None], 0.0)
    assert found is not None
    assert found[0][-1] == pytest.approx(1.0)


def test_legs_of_accelerations_last_longer_by_the_unit_of_time():
    for second in (1e-9, 1e9):
        beam = System(lambda q, v, a, t: (a[0] * second**2) ** 2 / 2, ["x"])  # noqa: B023
        ends = Event(0.0, [0.0], v=[0.0]), Event(None, [18.0], v=[0.0])
        found = through._durations(Problem(beam, *ends, energy=2.0), np.array([[0.0], [18.0]]))
        assert found == pytest.approx(3 * second)  # 18 / T^2 has the energy


def test_times_change_where_the_action_bends_down_most():
    # The part of the times, of the inverse, is that of diag(2, -3, -1) in turned axes.
    turn = np.linalg.qr(np.random.default_rng(0).standard_normal((3, 3)))[0]
    whole = np.eye(5)
    whole[1:4, 1:4] = turn @ np.diag([2.0, -3.0, -1.0]) @ turn.T
    step = passing_times._downwards(
        fake(solve=lambda row: np.linalg.inv(whole) @ row), slice(1, 4), 5
    )
    assert step is not None
    assert np.abs(step) == pytest.approx(np.abs(turn[:, 1]) / np.abs(turn[:, 1]).max())
    assert passing_times._downwards(fake(solve=lambda row: row), slice(1, 4), 5) is None


# -- first lines, and where a descent may go -------------------------------------------------------


def test_first_lines_pass_a_disc_on_either_side():
    disc = System(
        lambda q, v, t: v @ v / 2, ["x", "y"], obstacle=lambda q, t: q[0] ** 2 + q[1] ** 2 - 1
    )
    problem = Problem(disc, Event(0.0, [-2.0, 0.0]), Event(2.0, [2.0, 0.0]))
    line = Path(Mesh.uniform(0.0, 2.0, 2, 1), np.array([[-2.0, 0.5, 2.0], [0.0, 3.0, 0.0]]))
    assert first_contacts.sideways(problem, line)[0] == pytest.approx(0.0, abs=1e-12)
    found: Any = first_contacts.lines(problem, Mesh.uniform(0.0, 2.0, 6, 4))
    straight, *bent = found
    assert straight is None
    for path in bent:
        assert (np.linalg.norm(path.values, axis=0) >= 1).all()
        np.testing.assert_allclose(path.values[:, [0, -1]], [[-2.0, 2.0], [0.0, 0.0]], atol=1e-12)
        np.testing.assert_allclose(path.values[1], path.values[1, ::-1], atol=1e-9)
    assert bent[0](1.0)[1] == pytest.approx(-bent[1](1.0)[1])
    one = Problem(System(lambda q, v, t: v[0] ** 2 / 2, ["x"], obstacle=lambda q, t: q[0]),
                  Event(0.0, [1.0]), Event(1.0, [1.0]))  # fmt: skip
    assert first_contacts.lines(one, Mesh.uniform(0.0, 1.0, 2, 2)) == [None]
    assert first_contacts.across(np.zeros(2)).any()


def test_how_far_a_matrix_has_to_be_shifted(monkeypatch):
    monkeypatch.setattr(descent, "product", lambda layout, A, step: A @ step)
    H, K, step = np.diag([-6.0, 1.0]), np.diag([2.0, 0.0]), np.array([3.0, 1.0])

    def least_mu(H, step):
        tr: Any = fake(
            layout=None, keep_second=lambda z: None, kkt=lambda z: H, kinetic=lambda z: K
        )
        return descent._Curvature(tr, step).least_mu(step)

    least = least_mu(H, step)
    assert 0 < 53 / 18 - least < 1e-5
    assert least_mu(H, np.zeros(2)) == 0.0
    assert least_mu(-H, np.array([0.0, 1.0])) == np.inf
    assert least_mu(H, np.array([0.0, 1.0])) == 0.0


def test_coordinates_given_nowhere_may_move_by_a_constant():
    def moves(start, end, advance=None):
        problem: Any = fake(start=fake(pinned=start), end=fake(pinned=end), advance=advance,
                            system=fake(n=2))  # fmt: skip
        layout = fake(size=7, unknowns=5, free=np.array([1, 2, 3, 4, 5]), width=2)
        return descent.loose_constants(fake(problem=problem, layout=layout)).tolist()

    assert moves((0,), ()) == [1, 0, 1, 0, 1, 0, 0]
    assert moves((), (1,)) == [0, 1, 0, 1, 0, 0, 0]
    assert moves((), (1,), advance=0) == [1, 1, 1, 1, 1, 0, 0]
    assert moves((0,), (1,)) == [0] * 7


def test_records_of_two_searches_add_up():
    one, other = Record(), Record()
    one.iterations["newton"], other.iterations["newton"], other.iterations["ipopt"] = 3, 4, 5
    one.time["solve"], other.time["solve"], other.time["verify"] = 1.0, 2.0, 4.0
    one.rounds, other.rounds = [{"elements": 1}], [{"elements": 2}]
    one.evaluations["action"] = 7
    both = other.after(one)
    assert both.iterations == {"newton": 7, "ipopt": 5}
    assert both.time == {"solve": 3.0, "verify": 4.0}
    assert (both.rounds, both.evaluations) == ([{"elements": 2}], {"action": 7})
    assert one.time == {"solve": 1.0}
    both.round(fake(mesh=fake(degrees=(3, 7, 5), elements=3), layout=fake(size=9)), 2.0)
    assert both.rounds[1] == {
        "elements": 3, "degrees": [3, 7], "unknowns": 9, "estimate": None, "time": 2.0
    }  # fmt: skip


# -- closed paths, and steps from rest to rest -----------------------------------------------------


def closed_path(relabel=None, advance=None):
    """Return x = cos 2 pi t, y = sin 2 pi t over [1, 2] and its problem."""
    system = systems.particle("x y")
    problem = Problem(system, Event(1.0, [None, None]), ao.Periodic(2.0, advance, relabel=relabel))
    mesh = Mesh(1.0 + np.array([0.0, 0.2, 0.5, 0.7, 1.0]), [16, 18, 20, 22])

    def curve(t):
        return np.array([np.cos(2 * np.pi * t), np.sin(2 * np.pi * t)])

    return Path.interpolate(curve, mesh), problem, curve


def test_a_closed_path_goes_on_before_and_after():
    path, problem, curve = closed_path()
    since = np.array([-0.9, -0.1, 0.0, 0.3, 1.2, 1.95])
    q, v = closed.states_beyond(path, problem, since)
    np.testing.assert_allclose(q, curve(1 + since), atol=1e-9)
    np.testing.assert_allclose(v, 2 * np.pi * np.array([-1, 1])[:, None] * curve(1 + since)[::-1],
                               atol=1e-6)  # fmt: skip
    # After a period x is what y was, and moved by 3; y is what x was, and moved by 5.
    path, problem, curve = closed_path(relabel=[1, 0], advance=[3.0, 5.0])
    q, v = closed.states_beyond(path, problem, np.array([0.25, 1.25, -0.75]))
    x, y = curve(1.25)
    expected = np.array([[x, y], [y + 3, x + 5], [y - 5, x - 3]]).T
    np.testing.assert_allclose(q, expected, atol=1e-9)
    np.testing.assert_allclose(v[:, 1], v[::-1, 0], atol=1e-9)
    np.testing.assert_allclose(v[:, 2], v[::-1, 0], atol=1e-9)


@at_once("shift", [0.1, 0.2, 0.55, -0.3, 1.0 - 1e-9])
def test_a_closed_path_is_begun_later(shift):
    path, problem, curve = closed_path()
    found = closed.begin_later(path, shift, problem)
    assert found.mesh.boundaries[[0, -1]].tolist() == [1.0, 2.0]
    t = np.linspace(1.0, 2.0, 23)
    np.testing.assert_allclose(found(t), curve(t + shift), atol=1e-7)
    assert found.mesh.lengths.min() > 1e-3


def test_when_a_closed_path_passes_what_is_wanted():
    path, problem, _ = closed_path()
    found = closed.passage_times(path, problem, [0], np.array([0.5]), np.array([2.0]))
    times = np.array([-5 / 6, -1 / 6, 1 / 6, 5 / 6])
    assert sorted(t for t, _ in found) == pytest.approx(times)
    assert max(off for _, off in found) < 1e-8
    found = closed.passage_times(path, problem, [0, 1], np.array([0.0, 1.5]), np.ones(2))
    best = min(found, key=lambda known: (known[1], known[0]))
    assert best[1] == pytest.approx(0.5)
    assert best[0] % 1.0 == pytest.approx(0.25)


def test_a_closed_path_begins_where_it_meets_its_surface():
    path, problem, curve = closed_path()
    on = Event(1.0, [None, None], on=lambda q, t: q[0] - 0.5)
    asked = problem.replace(start=on)
    found = [x(1.0)[0] for x in closed.begin_on_surface(path, asked)]
    assert found[:2] == pytest.approx([0.5, 0.5], abs=0.05)
    assert closed.begin_on_surface(path, problem) == [path]
    free = fake(path=path, problem=problem)
    assert closed_contact._first_passage(asked, free) == pytest.approx(1 / 6)
    beyond = problem.replace(start=Event(1.0, [None, None], on=lambda q, t: q[0] - 1.5))
    assert closed_contact._first_passage(beyond, free) is None


def test_a_step_from_rest_to_rest():
    slow = fake(slow=2.0, slope=np.diag([5.0, 3.0])), fake(slow=8.0, slope=np.diag([1.0, 1.0]))
    ends = {"start": fake(near=(0.0, 1.0)), "end": fake(near=(4.0, 1.0))}
    found = window.step(fake(rests=slow, through=(), **ends))
    assert found is not None
    t = np.array([-9.0, 0.0, 0.5])
    np.testing.assert_allclose(
        found(t), [[0.0, 2.0, 2 + 2 * np.tanh(1.0)], [1.0, 1.0, 1.0]], atol=1e-7
    )
    assert window.step(fake(rests=(slow[0], None), through=(), **ends)) is None
    assert window.step(fake(rests=slow, through=(), **ends | {"end": ends["start"]})) is None
    np.testing.assert_allclose(window._metric(slow), np.diag([2.0, 1.0]))
    np.testing.assert_allclose(window._metric(slow[::-1]), np.diag([2.0, 1.0]))
    phase = window._plane(np.diag([2.0, 1.0]), np.array([7.0, 8.0]), np.array([1.0, 2.0]))
    assert (phase.t, phase[2], phase[3]) == (0.0, (7.0, 8.0), 6.0)
    assert phase[1] == pytest.approx((1 / 3, 1 / 3))
    seen: Any = lambda times: times  # noqa: E731
    seen.problem = fake(rests=slow)
    guess = window.restrict_guess(seen, fake(start=fake(t=1.0), duration=10.0))
    assert guess(np.array([9.0, 10.0])).tolist() == [0.0, 1.0]  # 8 of 10 at the slow one


@at_once(
    ("known", "expected"),
    [
        ({"forced": True}, False),
        ({"unbalance": 1}, False),
        ({"status": "DEGENERATE"}, True),
        ({"status": "DEGENERATE", "linear": True}, False),
        ({"status": "UNRESOLVED"}, True),
        ({"status": "NOT_FOUND"}, False),
        ({"status": "NOT_FOUND", "unpolished": 1}, True),
        ({"status": "UNBOUNDED", "unpolished": 1}, False),
        ({"one": False}, False),
        ({"one": False, "noise": 1.0}, False),
        ({"growth": 10.0}, False),
        ({"growth": 1e30}, True),
        ({"growth": 0.0}, True),
        ({"status": "FLOOR", "growth": 1e30}, True),
        ({"growth": 1e30, "since": 1e30, "fresh": 1.0}, True),
        ({"growth": 9e3, "since": 1e30, "fresh": 1e30}, True),
        ({"growth": 9e3, "since": 1e30, "fresh": 1e30, "linear": True}, False),
        ({"closes": True, "one": False}, False),
        ({"closes": True, "growth": 1e30}, True),
        ({"closes": True, "growth": 1e30, "free_time": True}, False),
        ({"closes": True, "status": "UNRESOLVED", "free_time": True}, False),
    ],
)
def test_what_may_be_one_of_a_family(known, expected):
    told = {
        "forced": False,
        "unbalance": None,
        "status": "SOLVED",
        "linear": False,
        "since": 0.0,
        "unpolished": None,
        "one": True,
        "noise": 0.0,
        "growth": 1.0,
        "closes": False,
        "free_time": False,
    } | known

    here = fake(can_be_one_of_many=told["one"], noise=0.0, sizes=np.ones(1), lengths=np.ones(1),
                growth=told["growth"], since=told["since"], tr=fake(lengths=np.ones(1)),
                Q=np.array([[0.0], [1.0]]))  # fmt: skip
    here.with_probed = lambda many: here
    here.with_fresh_factors = lambda: vars(here).update(growth=told["fresh"]) or here
    if told["noise"]:
        here.can_be_one_of_many = False
    system = fake(structure=fake(forced=told["forced"]), n=1, order=1)
    problem = fake(system=system, closes=told["closes"], free_time=told["free_time"])
    ws = fake(problem=problem, here=here, many=None, **{
        k: told[k] for k in ("unbalance", "linear", "unpolished")})  # fmt: skip
    assert family.may_be_family(ws, ao.Status[told["status"]]) is expected


def test_a_least_path_is_judged_by_its_directions(monkeypatch):
    solution = ao.solve(Problem(systems.oscillator(), Event(0.0, [0.0]), Event(4.0, [1.0])))
    for principle in ("auto", "stationary"):
        assert through._judge_least(solution, principle) is solution
    assert through._judge_least(solution, "least").status is ao.Status.NOT_LEAST
    monkeypatch.setattr(through, "_is_minimum", lambda known: True)
    assert through._judge_least(solution, "least") is solution
    monkeypatch.setattr(through, "may_be_family", lambda run, status: status)
    one = fake(inertia=fake(nullity=3), status=True)
    run: Any = None
    assert through._family(run, one) == 3
    one.status = False
    assert through._family(run, one) == 0


def test_nearest_points_of_a_circle_and_a_line():
    circle = Event(0.0, [None, None], on=lambda q, t: q @ q - 1)
    line = Event(1.0, [None, None], on=lambda q, t: q[0] + q[1] - 4)
    found = nearest_points.near(Problem(FREE, circle, Event(1.0, [3.0, 4.0])))
    for pair in found:
        assert np.linalg.norm(pair[0]) == pytest.approx(1.0)
        assert pair[1] == pytest.approx([3.0, 4.0])
    np.testing.assert_allclose(found[0][0], [0.6, 0.8], atol=1e-6)
    found = nearest_points.near(Problem(FREE, Event(0.0, [0.0, 0.0]), line))
    np.testing.assert_allclose(found[0], [[0.0, 0.0], [2.0, 2.0]], atol=1e-9)
    T = nearest_points._passage(
        Problem(FREE, Event(0.0, [0.0, 0.0]), Event(None, [3.0, 4.0]), energy=2.0),
        np.array([[0.0, 0.0], [3.0, 4.0]]), np.ones(2),
    )  # fmt: skip
    assert pytest.approx(2.5) == T


# -- what stands at single nodes -------------------------------------------------------------------


def test_a_term_of_a_node_has_the_slope_of_its_value():
    matrix = np.array([[2.0, 1.0], [1.0, 5.0]])
    term = nodal.Term(3, 1, np.array([1.0, -1.0]), np.array([0.5, 2.0]), matrix)
    q = np.array([1.5, 1.0])
    assert term.value(q) == pytest.approx(0.25 + 4.0 + (2 * 0.25 + 2 * 1.0 + 5 * 4) / 2)
    slopes = [(term.value(q + h) - term.value(q - h)) / 2e-4 for h in 1e-4 * np.eye(2)]
    assert term.gradient(q) == pytest.approx(slopes)
    other = nodal.Term(3, 1, term.center, term.linear, matrix, action=(2 * term.linear, 0 * matrix))
    assert other.value(q) == pytest.approx(8.5)
    assert other.gradient(q) == pytest.approx(slopes)


def test_there_are_terms_at_rests_and_where_the_phase_is_set():
    mesh = Mesh([-2.0, -0.5, 0.0, 3.0], [2, 3, 2])
    rest = [fake(side=side, p=np.array([side]), slope=np.eye(1) * 2, q=np.zeros(1), action=None)
            for side in (-1, 1)]  # fmt: skip
    phase = fake(t=0.1, normal=(2.0,), center=(7.0,), weight=3.0)
    problem: Any = fake(rests=rest, start=fake(phase=phase))
    first, last, set_ = nodal.terms(problem, mesh)
    assert [(x.node, x.linear.tolist(), x.matrix.tolist()) for x in (first, last, set_)] == [
        (0, [-1.0], [[2.0]]), (7, [-1.0], [[-2.0]]), (5, [0.0], [[12.0]])
    ]  # fmt: skip
    assert (set_.center.tolist(), set_.phase, first.phase) == ([7.0], True, False)
    problem.rests, problem.start.phase = (None, rest[1]), None
    (only,) = nodal.terms(problem, mesh)
    assert only.node == 7


def test_runs_of_times_and_their_first_unknowns():
    def times(*given):
        legs = np.ones(len(given) - 1) * 2.0
        made: Any = object.__new__(borders.Times)
        vars(made).update(given=np.array(given, dtype=float), first=legs)
        return made

    nan = np.nan
    assert times(nan, nan, nan).runs == [(slice(0, 2), None)]
    made = times(nan, 1.0, nan, nan, 7.0, 8.0, nan)
    assert made.runs == [(slice(0, 1), None), (slice(1, 4), 6.0), (slice(5, 6), None)]
    since = np.array([0.0, 2.0, 4.0, 8.0, 16.0, 17.0, 18.0])
    at = fake(mesh=fake(nodes_since=since), tr=fake(joints=np.arange(7)))
    ratio = np.log([1.0, 1.0, 2.0, 4.0, 0.5, 0.5])
    expected = [ratio[0], ratio[1] - ratio[3], ratio[2] - ratio[3], ratio[5]]
    assert made.begin(at) == pytest.approx(expected)


# -- velocities to begin with, and the energy along a motion ---------------------------------------


def test_speeds_are_those_of_the_way_and_of_the_force():
    pulled = System(lambda q, v, t: v @ v / 2 + 6 * q[1], ["x", "y"])
    problem = Problem(pulled, Event(1.0, [0.0, 0.0]), Event(3.0, [4.0, 1.0]))
    found, units = shooting.speeds(problem, np.array([4.0, 1.0]))
    assert units == pytest.approx(np.maximum(problem.lengths, [4.0, 1.0]))
    force = np.median([0.0, 6 / units[1]])
    scales = np.array([np.max([4.0, 1.0] / units) / 2, np.sqrt(force), force, 0.5])
    assert found == pytest.approx(scales)
    found, _ = shooting.speeds(ACROSS, np.array([1.5, -1.0]))
    assert len(found) == 2  # no force gives none


def test_first_velocities_of_one_coordinate_are_on_either_side():
    problem = Problem(systems.particle("x"), Event(0.0, [0.0]), Event(2.0, [1.0]))
    scales, units = shooting.speeds(problem, np.ones(1))
    (found,) = shooting.velocities(problem, np.ones(1), 40, np.random.default_rng(0)) / units
    assert found.size == 40
    assert (np.diff(found) >= 0).all()
    np.testing.assert_allclose(found, -found[::-1], atol=1e-12)
    assert found[-1] == pytest.approx(2.5 * scales.max())
    assert np.abs(found).min() <= scales.min() / 4


def test_aims_are_changed_along_a_basis_until_gaps_vanish():
    goals = np.array([2.0, 3.0, np.nan])

    def gap(x, which):
        return np.stack([x[0] ** 2 - goals[which] ** 2, x[1] - 2 * x[0]])

    x = np.array([[1.0, 9.0, 1.0], [1.0, -5.0, 0.0]])
    found, which = shooting.newton(x, np.eye(2), gap)
    assert which.tolist() == [0, 1]
    np.testing.assert_allclose(found, [[2.0, 3.0], [4.0, 6.0]], rtol=1e-3)
    found, which = shooting.newton(x[:, :2], np.array([[1.0], [2.0]]) / np.sqrt(5), gap)
    assert which.size < 2  # what is off across the basis stays


def energy_drift_of(system, curve, rate):
    problem = Problem(system, Event(1.0, curve(1.0)), Event(2.5, curve(2.5)))
    mesh = Mesh.uniform(1.0, 2.5, 3, 8)
    t = mesh.nodes
    q, v = (np.array([f(x) for x in t]).T for f in (curve, rate))
    known = Path(mesh, q)
    smooth = np.ones(t.size, dtype=bool)
    return compare._energy_drift(problem, known, q, v, smooth, np.ones(len(q)))


def test_the_energy_changes_by_the_work():
    # x'' = 6 t under the force 6 t: by an L that depends on time, and by a force of its own
    driven = System(lambda q, v, t: v[0] ** 2 / 2 + 6 * t * q[0], ["x"])
    pushed = System(lambda q, v, t: v[0] ** 2 / 2, ["x"], force=lambda q, v, t: [6 * t])
    for system in (driven, pushed):
        assert energy_drift_of(system, lambda t: [t**3], lambda t: [3 * t**2]) < 1e-12
        off = energy_drift_of(system, lambda t: [t**3], lambda t: [3 * t**2 + 0.1 * (t - 1)])
        assert off > 1e-3
    free = systems.particle("x")
    drift = energy_drift_of(free, lambda t: [t], lambda t: [1.0 if t < 2 else 2.0])
    assert drift == pytest.approx(1.5 / 4.0)
    rest = energy_drift_of(System(lambda q, v, t: v[0] ** 2 / 2 - t, ["x"]), lambda t: [0.0],
                           lambda t: [0.0])  # fmt: skip
    assert rest < 1e-12


def test_motions_that_have_to_stop_are_not_integrated():
    asked = []
    flow = fake(
        several=lambda pairs, *_: asked.extend(pairs) or [("motion", s.t) for s, _ in pairs]
    )
    made = fake(stops=[(2.0, 3.0)], flow=flow, units=None, tolerance=None, _longest=None)
    states = [fake(t=t) for t in (0.0, 2.5, 0.0, 4.0, 2.0)]
    found = compare._Parts.several(made, states, [1.0, 9.0, 9.0, 5.0, 3.0])
    assert found == [("motion", 0.0), ("motion", 2.5), None, ("motion", 4.0), ("motion", 2.0)]
    assert [end for _, end in asked] == [1.0, 9.0, 5.0, 3.0]


def test_the_matrix_of_a_beam_on_a_surface_is_the_derivative_of_its_equations():
    beam = System(
        lambda q, v, a, t: a @ a / 2 + q[0] * v[1] ** 2 + np.sin(q[1]) * a[0] * v[0],
        ["x", "y"], constraint=lambda q, t: q[0] ** 2 * q[1] + q[1] ** 2 + t,
        force=lambda q, v, t: [v[1] * q[0], q[1] ** 2],
    )  # fmt: skip
    ends = [Event(t, [0.5 * t, None], v=[None, 1.0]) for t in (0.0, 1.0)]
    problem = Problem(beam, *ends)
    tr = Transcription(problem, Mesh([0.0, 0.4, 1.0], [5, 6]), np.array([0.7, 2.0]))
    rng = np.random.default_rng(0)
    z, way = 0.4 * rng.standard_normal((2, tr.layout.size))
    residuals = [tr.residual(z + s * way) for s in (1e-5, -1e-5)]
    slope = (residuals[0] - residuals[1]) / 2e-5
    found = full(tr.layout, tr.kkt(z)) @ way
    np.testing.assert_allclose(found, slope, atol=1e-6 * np.abs(slope).max())


def test_nodal_terms_are_a_part_of_the_action():
    made = fake(state_of=lambda Q: (Q, 2 * Q), _sum=lambda at, v: at + v, _beyond=lambda Q: 0.5)
    value: Any = Transcription.value
    made.nodal = ()
    assert value(made, 1.0) == 3.0
    made.nodal = ("term",)
    assert value(made, 1.0) == 3.5


# -- sizes, meshes and orders ----------------------------------------------------------------------


def test_where_contact_begins_is_extrapolated():
    t = np.array([1.0, 2.0, 4.0, 9.0])
    for zero in (1.4, 1.9):
        expected = 0.98 * zero + 0.02 * 1.5
        assert first_contacts._where_zero(t, np.abs(t - zero)) == pytest.approx(expected)
        back = first_contacts._where_zero(-t, np.abs(t - zero))
        assert back == pytest.approx(-expected)
    for zero, at in ((0.5, 1.0), (2.5, 2.0)):  # no farther than the neighbours
        found = first_contacts._where_zero(t, np.array([9.0, 2 - zero, 4 - zero, 9.0]))
        assert found == pytest.approx(0.98 * at + 0.02 * 1.5)
    assert first_contacts._where_zero(t, np.ones(4)) == pytest.approx(0.98 * 1.0 + 0.02 * 1.5)
    assert first_contacts._where_zero(t[:2], t[:2]) == 1.5
    assert first_contacts._where_zero(t[:1], t[:1]) == 1.0


def test_rates_of_waypoints():
    t = np.array([0.0, 1.0, 2.0, 3.0])
    plain = fake(advance=None)
    assert arguments._rates(plain, t, t[None] ** 2) == pytest.approx(2 * t[None])
    assert arguments._rates(plain, t[:2], np.array([[1.0, 4.0]])) == pytest.approx(3.0)
    closes = fake(advance=np.array([1.0, 5.0]), order=(1, 0))
    points = np.array([[0.0, 2.0, 7.0, 10.0 + 1.0], [10.0, 4.0, 3.0, 0.0 + 5.0]])
    rates = arguments._rates(closes, t, points)
    # Before the start x was what y is before the end, less its advance, and y what x was.
    assert rates[:, 0] == pytest.approx([(2 - (3 - 5)) / 2, (4 - (7 - 1)) / 2])
    assert rates[:, -1] == pytest.approx(rates[::-1, 0])
    assert rates[:, 1] == pytest.approx([3.5, -3.5])


def test_strategies_that_cost_too_much_come_last():
    plain, least, dear = (
        fake(cost=c, minimises=m, absolute=c > 1) for c, m in ((1, False), (1, True), (900, False))
    )
    watch = fake(affords=lambda cost: cost < 5)

    def order(watch=watch, lost=(True,), saddle=None, principle="auto", uneven=0.0):
        ws = fake(watch=watch, uneven=uneven)
        search: Any = fake(ws=ws, lost=lost, saddle=saddle, principle=principle)
        names = {id(plain): "plain", id(least): "least", id(dear): "dear"}
        return [names[id(x)] for x in Search._in_order(search, [dear, least, plain])]

    assert order(watch=None, uneven=10.0) == ["plain", "dear", "least"]
    assert order(watch=None, uneven=15.0) == ["plain", "least"]

    assert order() == ["plain", "least", "dear"]
    assert order(watch=None) == ["dear", "plain", "least"]
    assert order(lost=(False,)) == ["least", "plain", "dear"]
    assert order(saddle=1) == ["plain", "dear"]
    assert order(saddle=1, principle="least") == ["plain", "least", "dear"]


def test_a_singular_mass_is_named():
    names, turned = ("x", "y", "z"), np.array([[1.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [0, 0, 1e-8]])
    singular = np.diag([2.0, 1e-30, 1.0])
    preflight._check_mass(names, np.stack([singular, np.diag([2.0, 1e-6, 1.0])]), None)
    with pytest.raises(ValueError, match="in the direction of x, y:"):
        preflight._check_mass(names, turned[None], None)
    flat = np.diag([2.0, 0.0, 1.0])
    with pytest.raises(ValueError, match="in the direction of y:"):
        preflight._check_mass(names, np.stack([flat, flat]), None)
    preflight._check_mass(names, flat[None], np.array([[[0.0, 1.0, 0.0]]]))
    with pytest.raises(ValueError, match="in the direction of y:"):
        preflight._check_mass(names, flat[None], np.array([[[1.0, 0.0, 0.0]]]))
    preflight._check_mass(names, 0 * turned[None], np.eye(3)[None])


def test_sizes_are_those_on_the_way():
    own = np.array([3.0, 5.0])
    Q = np.array([[0.0, -4.0], [2.0, 1.0]])
    assert iterate.sizes(Q, own).tolist() == [2.0, 4.0]
    assert iterate.sizes(0 * Q, own).tolist() == [3.0, 5.0]
    assert iterate.sizes(Q * [0.0, 1.0], own).tolist() == [4.0, 4.0]
    tiny = iterate.NEGLIGIBLE / 2
    assert iterate.sizes(Q * [tiny, 1.0], own).tolist() == [4.0, 4.0]
    assert iterate.sizes(Q * [tiny, 1.0], tiny * own).tolist() == [2 * tiny, 4.0]
    problem: Any = fake(scales=own, lengths=own / 2, origin=None)
    assert [x.tolist() for x in iterate.coordinate_scales(problem, None)] == [[3, 5], [1.5, 2.5]]
    assert [x.tolist() for x in iterate.coordinate_scales(problem, Q)] == [[2, 4], [2, 4]]
    problem.origin = np.array([1.0, -1.0])
    assert [x.tolist() for x in iterate.coordinate_scales(problem, Q)] == [[2, 4], [1, 3]]


def test_a_finer_mesh_has_higher_degrees_or_more_elements():
    most = refine.MAX_DEGREE
    found = refine._finer(Mesh([1.0, 2.0, 4.0, 5.0], [3, most - 1, most - 2]))
    assert found.boundaries.tolist() == [1.0, 2.0, 3.0, 4.0, 5.0]
    assert list(found.degrees) == [5, most, most, most]


def test_a_motion_is_drawn_as_far_as_it_goes(monkeypatch):
    tried = []

    def follow(flow, start, end, *, tol, mesh, kinks):
        tried.append((end, mesh.boundaries.tolist(), list(mesh.degrees)))
        if end > 4.5:
            raise ao.IntegrationError("lost", end)
        return fake(path=end)

    monkeypatch.setattr(compare, "follow", follow)
    monkeypatch.setattr(compare, "NEARLY", (0.9, 0.5, 0.25))
    mesh, flow, start = Mesh([1.0, 2.0, 3.0, 9.0], [3, 4, 5]), fake(), fake(t=1.0)
    assert compare._as_far(flow, start, mesh, 9.0) == 3.0
    assert tried[-1] == (3.0, [1.0, 2.0, 3.0], [3, 4])
    assert [end for end, *_ in tried] == pytest.approx([8.2, 5.0, 3.0])
    assert tried[1][1:] == ([1.0, 2.0, 3.0, 5.0], [3, 4, 5])
    monkeypatch.setattr(compare, "NEARLY", (0.9,))
    assert compare._as_far(flow, start, mesh, 9.0) is None


def test_what_varies_is_read_from_the_problem():
    surface = ao.Event(None, None, on=lambda q, t: q[0])
    system = System(lambda q, v, t: v @ v / 2, ["x", "y"], integral=lambda q, v, t: q[1])
    problem = Problem(system, Event(1.0, [2.0, 3.0]), Event(9.0, [4.0, 5.0]), integral=7.0,
                      through=[Event(6.0, [8.0, None]), surface])  # fmt: skip
    for name, value in (
        (("start", "x"), 2.0), (("end", "y"), 5.0), (("integral", 0), 7.0),
        (("through", 0, "x"), 8.0), (("through", 0, "t"), 6.0),
    ):  # fmt: skip
        assert vary._of_events(problem, name) == value
    wrong = [("start",), ("integral", 1), ("through", 2, "x"), ("through", 0), ("start", 0, "x")]
    for name in [*wrong, ("integral", 0, "x")]:
        with pytest.raises(ValueError, match=r"expected \('start', coordinate\)"):
            vary._of_events(problem, name)
    closed_one = Problem(FREE, Event(0.0, [None, 0.0]), ao.Periodic(2.0))
    with pytest.raises(ValueError, match="expected an end of its own to vary"):
        vary._of_events(closed_one, ("end", "y"))


# -- what presses, and paths that are added to those known -----------------------------------------


@pytest.mark.parametrize(
    ("arcs", "impulses", "density", "expected"),
    [
        ([(0.0, 2.0)], [1, 0, 2, 0, 0], [5] * 8, [(0.0, 2.0)]),
        ([(1.0, 1.0), (3.0, 3.0)], [0, 2, 0, -1, 0], [0] * 8, [(1.0, 1.0)]),
        # In the middle it pulls: what presses is left, as arcs and as moments at the ends.
        ([(0.0, 4.0)], [0, 0, 0, 0, 0], [5, 5, 5, -5, -5, 5, 5, 5], [(0.2, 1.2), (2.8, 3.8)]),
        ([(0.0, 4.0)], [3, 0, 0, 0, 2], [-5, 0, 0, 0, 0, 5, 5, -5], [(0.0, 0.0), (4.0, 4.0),
                                                                     (2.8, 3.2)]),
        # An impulse that pulls: what is left is a moment in the middle of what presses.
        ([(1.0, 3.0)], [0, -2, 0, 1, 0], [0, 0, 5, 5, 5, 5, 0, 0], [(7 / 3, 7 / 3)]),
        ([(1.0, 3.0)], [0, -9, 0, 0, 0], [0, 0, -2, -2, -2, -2, 0, 0], []),
    ],
)  # fmt: skip
def test_what_would_have_to_pull_is_let_go(monkeypatch, arcs, impulses, density, expected):
    b = np.arange(5.0)
    times = (b[:-1, None] + [0.2, 0.8]).ravel()[:, None]
    held = fake(system=fake(m=1), arcs=tuple(Arc(0, *arc) for arc in arcs))
    monkeypatch.setattr(touching, "contacts_of", lambda problem: held)
    nodes = np.array([0, 3, 6, 9, 12])
    multipliers = np.zeros((13, 1))
    multipliers[nodes, 0] = -np.array(impulses)
    tr = fake(
        row_multipliers=lambda z: multipliers, times=times, weight=np.full((8, 1), 0.5),
        contact_density=lambda found: -np.array(density, dtype=float)[:, None], action_unit=1e-3,
        layout=fake(offsets=nodes, element_of=np.repeat(np.arange(4), 2)), row_units=np.ones(1),
    )  # fmt: skip
    found = touching.pressing_parts(fake(problem=None, tr=tr, mesh=fake(boundaries=b), z=None))
    assert [(arc.begin, arc.end) for arc in found] == [pytest.approx(arc) for arc in expected]


def test_paths_of_infinite_times_are_those_that_stay_as_they_were(monkeypatch):
    nodes = np.linspace(0.0, 1.0, 5)

    def path(height):
        def curve(t):
            return np.stack([height * t, 1.0 + 0 * t])

        found: Any = curve
        found.mesh, found.path, found.success = fake(nodes=nodes), fake(values=curve(nodes)), True
        return found

    whole = fake(system=fake(n=1), start=fake(pinned=()), end=fake(t=np.inf, near=(3.0,)))
    near = [path(x) for x in (1.0, 2.0, 2.0, 3.0, 4.0)]
    # The second is the first one found; the third moved; the fourth is lost.
    answers = dict(
        zip(map(id, near), [path(1.0), path(2.0), path(2.5), path(3.0), path(4.0)], strict=True)
    )
    answers[id(near[3])].success = False
    centre = path(7.0)
    monkeypatch.setattr(all_paths, "guesses", lambda problem, rest: [("guess", rest)])
    monkeypatch.setattr(
        all_paths, "solve_near", lambda whole, guess, tol: answers.get(id(guess), centre)
    )
    known = path(1.0)
    run: Any = fake(found=[(known, (), "known")], problem=None, tol=1e-8, turning=(),
                    tried={"motions from the centre": 0})  # fmt: skip
    all_paths._add_without_end(run, whole, [(x, (), "window") for x in near])
    assert [how for *_, how in run.found] == [
        "known",
        "window",
        "window",
        "a motion from the centre",
    ]
    assert [p(np.ones(1))[0, 0] for p, *_ in run.found] == [1.0, 2.0, 4.0, 7.0]
    assert run.tried == {"motions from the centre": 1}
    for other in ({"n": 2}, {"pinned": (0,)}, {"t": 5.0}):
        given = {"n": 1, "pinned": (), "t": np.inf} | other
        whole = fake(system=fake(n=given["n"]), start=fake(pinned=given["pinned"]),
                     end=fake(t=given["t"], near=(3.0,)))  # fmt: skip
        all_paths._add_without_end(run, whole, [])
    assert run.tried == {"motions from the centre": 1}


def test_places_at_events_are_tried_for_each_of_a_few(monkeypatch):
    monkeypatch.setattr(
        searches, "attempts", lambda problem, tol, a, b, count, seed: [((count, seed), "")]
    )
    for events, times in ((0, 1), (1, 1), (2, 2), (99, searches.MOST_EVENTS)):
        run = fake(problem=fake(through=(None,) * events), tol=1e-8, seed=4, classes=["class"],
                   tell=lambda *_: None)  # fmt: skip
        (start,) = searches.Answers._through_events(run, 3)
        assert start.solution == (searches.FOR_EACH_EVENT * 3 * times, 4)
        assert (start.winding, start.guess, start.how) == ("class", None, "places at events")


def test_newtons_method_is_led_away_until_nothing_is_new(monkeypatch):
    away = iter([1.0, 2.0, None, 3.0, 4.0, 5.0, 6.0, 7.0])
    monkeypatch.setattr(searches, "deflate", lambda tr, z, seen: next(away))
    c = fake(tr=None, seen=None)
    run = fake(classes=[c], tell=lambda *_: None, _curves=lambda starts: [(c, 0.0)] * starts)
    run._unseen = lambda c, z: None if z == 2.0 else z
    run._start = lambda c, path, how: path
    assert list(searches.Answers._deflate(run, 3)) == [1.0, 3.0, 4.0, 5.0, 6.0]


def test_the_best_of_paths_along_an_obstacle_is_kept(monkeypatch):
    statuses = {"a": ao.Status.NOT_FOUND, "b": ao.Status.SOLVED, "c": ao.Status.SOLVED}
    monkeypatch.setattr(free_contact, "Along", lambda held, **_: fake(name=held, hint=held))
    monkeypatch.setattr(free_contact, "Held", lambda known: known)
    monkeypatch.setattr(free_contact, "_at", lambda problem, near: near.name)
    monkeypatch.setattr(free_contact, "release_contacts", lambda ws, tol, near: statuses[ws.name])
    monkeypatch.setattr(free_contact, "settle_on", lambda ws, status, mesh, least: status)
    rank = {"a": 9, "b": 5, "c": 3}
    monkeypatch.setattr(free_contact, "_rank", lambda found: rank[found.name])
    monkeypatch.setattr(free_contact, "message_of", lambda best, tol, hint: hint)
    problem: Any = fake(system=fake(order=1))
    choices = Choices(1e-8, "auto", STRATEGIES, None, None)

    def best(names, **lost) -> Any:
        near = [fake(name=x, success=x not in lost) for x in names]
        monkeypatch.setattr(free_contact, "_between_given", lambda *_: near)
        monkeypatch.setattr(free_contact, "solution_of", lambda ws, status, how, started: fake(
            name=ws.name, status=status, success=status.success, morse_index=0))  # fmt: skip
        return free_contact.free_contact(problem, None, choices)

    assert best("abc")[0].name == "c"
    assert best("cba") == (best("c")[0], "")
    assert best("abc", c=True)[0].name == "b"
    found, message = best("a")
    assert (found.name, message) == ("a", "a")


# -- formulas, and what is tried from a guess ------------------------------------------------------


MINUS = html.unescape("&#x2212;")


def test_sums_and_roots_are_written_with_their_signs():
    written = re.sub(r"<[^>]*>", "", html.unescape(mathml.inline("a - b + c - 2*d", "abcd")))
    assert re.sub(r"\W", "", written.replace(MINUS, "m").replace("+", "p")) == "ambpcm2d"
    negative = re.sub(r"<[^>]*>", "", html.unescape(mathml.inline("-a + b", "ab")))
    assert re.sub(r"\s", "", negative) == MINUS + "a+b"
    system = System(lambda q, v, t: v[0] ** 2 / 2 - np.sqrt(1 + q[0] ** 2) + 1 / (2 + q[0]), ["x"])
    law = "L = x'^2 / 2 + 1 / (x + 2) - sqrt(x^2 + 1)"
    assert written_laws.lagrangian(system, system.table) == law


def test_a_root_is_kept_and_a_failure_undone():
    here, moved = fake(moved=lambda z: moved if z.tolist() == [1, 2, 0] else None), object()
    here.x, here.z = np.array([1.0, 2.0]), np.array([1.0, 2.0, 9.0])

    def asked(answer, large=False):
        ws: Any = fake(here=here, large=large, find=lambda how: answer and how == "stationary")
        return Workspace.root(ws), ws.here

    assert asked(True) == (True, moved)
    assert asked(False) == (False, here)
    assert asked(True, large=True) == (False, here)


def test_a_path_is_followed_from_a_neighbour_on_its_own_mesh():
    problem = systems.bratu()
    mesh = Mesh.uniform(0.0, 1.0, 3, 6)
    guess = Path(mesh, (mesh.nodes * (1 - mesh.nodes) / 2)[None])
    found = revisions._near_guess(problem, guess, 1e-6, None)
    assert found.success
    assert found(0.5)[0] == pytest.approx(
        0.14053921440, abs=1e-6
    )  # 2 ln cosh(theta / 4) at the top


def test_a_least_path_is_sought_down_from_the_guess():
    hill = System(lambda q, v, t: v[0] ** 2 / 2 + (q[0] ** 2 - 1) ** 2, ["x"])
    problem = Problem(hill, Event(0.0, [1.0]), Event(6.0, [1.0]))
    sought = fake(problem=problem, guess=lambda t: 1 + 0.1 * np.sin(np.pi * t / 6)[None])
    found: Any = window.descend_from_guess(sought, None)
    np.testing.assert_allclose(found.values, 1.0, atol=5e-3)
    pushed = systems.oscillator("x", force=lambda q, v, t: [-v[0]])
    forced = Problem(pushed, problem.start, problem.end)
    assert window.descend_from_guess(fake(problem=forced, guess=None), None) is None
