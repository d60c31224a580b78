"""All the paths against independent searches: Lambert's problem, dense shooting, closed forms."""

from dataclasses import replace
from itertools import islice, product
from types import SimpleNamespace

import numpy as np
import pytest
import systems
from helpers import integrated, slow
from scipy.special import ellipk

import actionopt as ao
from actionopt import scenes
from actionopt.analysis.quadratic.shooting import shoot, velocities
from actionopt.families.searches import searches, velocity_scan
from actionopt.families.searches.all_paths import Paths, detected_angles, solve_all
from actionopt.families.searches.searches import SAME_ACTION, Answers
from actionopt.families.traces.trace import _TraceRun

PENDULUM = systems.pendulum(g=9.81)


# -- one path, two, none ---------------------------------------------------------------------------


def test_projectile_has_one_path():
    found = solve_all(scenes.get("projectile").problem)
    assert len(found) == 1 and found.complete
    assert "no others" in str(found)


@pytest.mark.slow
def test_a_pendulum_in_x_and_y_goes_round_as_one_in_its_angle_does():
    # Aimed one by one, shots found one of these three paths.
    low, high, T = -2.0, 1.0, 1.15
    place = [[np.sin(a), -np.cos(a)] for a in (low, high)]
    bob = ao.System(
        lambda q, v, t: v @ v / 2 - 9.81 * q[1], ["x", "y"], constraint=lambda q, t: q @ q - 1
    )
    limits = {"starts": 0, "continuations": 0}
    in_plane = solve_all(ao.Problem(bob, ao.Event(0, place[0]), ao.Event(T, place[1])), **limits)
    rod = ao.Problem(PENDULUM, ao.Event(0, [low]), ao.Event(T, [high]))
    in_angle = solve_all(rod, **limits)
    actions = [s.action for s in in_plane]
    assert len(in_angle) == 3
    assert all(np.min(np.abs(np.subtract(actions, s.action))) < 1e-6 for s in in_angle)


@pytest.mark.long
@pytest.mark.parametrize(
    ("lam", "actions"),
    [(1.0, [-1.0465167047946651, 16.440013090858122]),
     pytest.param(3.4, [-4.2594654167377802, -4.1830776405135700], marks=pytest.mark.slow),
     pytest.param(3.6, [], marks=pytest.mark.slow)],
)  # fmt: skip
def test_bratu(lam, actions):
    # Two paths up to lam = 3.513830719, none beyond; actions by quadrature of the closed form.
    found = solve_all(systems.bratu(lam), tol=1e-9, starts=2, shots=8, continuations=1)
    assert [s.action for s in found] == pytest.approx(actions, rel=1e-8)
    assert found.indices == (0, 1)[: len(actions)]
    assert not found.complete and "may be others" in str(found)


@pytest.mark.parametrize(
    ("h", "areas"),
    slow((0.5, [5.99179697580228191, 6.84565539431063018]), (0.67, [])),
)
def test_soap_film(h, areas):
    # Catenoids between rings of radius 1 at -+h exist up to h = 0.662743419349.
    found = solve_all(systems.soap_film(h))
    assert [2 * np.pi * s.action for s in found] == pytest.approx(areas, rel=1e-8)
    assert found.indices == (0, 1)[: len(areas)]


# -- windings --------------------------------------------------------------------------------------


def test_angles_are_recognised():
    def angles(name):
        problem = scenes.get(name).problem
        return [problem.system.coordinates[i] for i in detected_angles(problem)]

    assert angles("pendulum") == ["theta"]
    assert len(angles("double_pendulum")) == 2
    assert angles("kepler") == angles("projectile") == angles("oscillator") == []


@pytest.mark.long
def test_a_named_azimuth_winds():
    # A bead on a circle, its mass 1 + t: the Lagrangian does not show that phi is an angle.
    system = ao.System(lambda q, v, t: (1 + t) * v[0] ** 2 / 2, ["phi"])
    problem = ao.Problem(system, ao.Event(0.0, 0.0), ao.Event(1.0, 1.0))
    assert len(solve_all(problem)) == 1
    found = solve_all(problem, angles=["phi"], windings=2)
    exact = sorted(((1 + 2 * np.pi * k) ** 2 / 2 / np.log(2), (k,)) for k in range(-2, 3))
    assert [s.action for s in found] == pytest.approx([S for S, _ in exact])
    assert list(found.windings) == [k for _, k in exact]


@pytest.mark.long
def test_motions_faster_than_forces_between_the_events_suggest():
    """q'' = -q^3 from 0 to 0: k half swings, A = 2 k K(1/2) / T, at A^2 / sqrt(2)."""
    quartic = ao.System(lambda q, v, t: v[0] ** 2 / 2 - q[0] ** 4 / 4, ["x"])
    ends = ao.Event(0.0, [0.0]), ao.Event(3.0, [0.0])
    found = solve_all(ao.Problem(quartic, *ends), starts=0, continuations=0)
    a = 2 * ellipk(0.5) * np.array([1, 2, 3, 4])
    exact = np.outer([-1, 0, 1], (a / 3) ** 2 / np.sqrt(2)).ravel()
    v0 = np.sort([path.start.v[0] for path in found])
    np.testing.assert_allclose(v0, np.unique(exact), atol=1e-9)


# -- Lambert's problem ----------------------------------------------------------------------------


@pytest.mark.long
@pytest.mark.parametrize(
    ("T", "revolutions", "options"),
    [
        (3.0, 0, {"starts": 0, "shots": 4, "continuations": 0}),
        pytest.param(10.0, 1, {}, marks=pytest.mark.slow),
        pytest.param(16.0, 2, {}, marks=pytest.mark.slow),
        pytest.param(22.0, 3, {}, marks=pytest.mark.slow),
    ],
)
def test_all_transfers_of_lamberts_problem(T, revolutions, options):
    """Either way round in less than a revolution, and two each for every one more."""
    ends = ao.Event(0.0, [1.0, 0.0]), ao.Event(T, [0.0, 1.2])
    found = solve_all(ao.Problem(systems.kepler(), *ends), **options)
    assert len(found) == 2 + 4 * revolutions
    assert all(path.compare().agrees for path in found)
    angles = [np.unwrap(np.arctan2(*path(np.linspace(0, T, 999))[::-1])) for path in found]
    turns = np.sort([int(abs(angle[-1] - angle[0]) / (2 * np.pi)) for angle in angles])
    assert turns.tolist() == [0, 0, *np.repeat(np.arange(1, revolutions + 1), 4)]
    velocities = np.array([path.start.v for path in found])
    apart = np.linalg.norm(velocities[:, None] - velocities, axis=2) + np.eye(len(found))
    assert apart.min() > 1e-3


def test_shots_that_turn_more_often_than_asked_aim_at_no_end():
    free = systems.particle("angle x")
    problem = ao.Problem(free, ao.Event(0.0, [0.0, 0.0]), ao.Event(1.0, [1.0, 1.0]))
    run = Answers(problem, 1e-8, (0,), 0, 1, None)
    for start in run._aim(np.array([[0.9, 20.0], [1.1, 1.0]])):
        run.answer(start)
    assert run.tried["forward shots"] == 1 and len(run.found) == 1


# -- two angles ------------------------------------------------------------------------------------


# -- ends that do not determine the path -----------------------------------------------------------

OSCILLATOR = systems.oscillator()


def test_oscillations_of_half_a_period_are_a_family():
    """All are at -x0 then, S = 0 for each; and none is anywhere else."""
    found = solve_all(ao.Problem(OSCILLATOR, ao.Event(0.0, 1.0), ao.Event(np.pi, -1.0)))
    assert len(found) == 0 and not found.complete
    (member,) = found.families
    assert abs(member.action) < 1e-8 and member.status is ao.Status.DEGENERATE
    assert "a family" in str(found)
    found = solve_all(ao.Problem(OSCILLATOR, ao.Event(0.0, 1.0), ao.Event(np.pi, 0.5)))
    assert len(found) == len(found.families) == 0 and "family" not in str(found)


def test_what_solve_refuses_is_refused():
    twice = systems.particle("x y", constraint=lambda q, t: [q[0] - q[1], q[1] - q[0]])
    problem = ao.Problem(twice, ao.Event(0.0, [0.0, 0.0]), ao.Event(1.0, [1.0, 1.0]))
    with pytest.raises(ValueError, match="expected independent constraints"):
        solve_all(problem, starts=2)


@pytest.mark.parametrize("error", [ValueError("operands could not be broadcast"), TypeError("no")])
def test_defects_are_not_swallowed(monkeypatch, error):
    def broken(*_, **__):
        raise error

    monkeypatch.setattr("actionopt.families.searches.searches.first_acceptable", broken)
    with pytest.raises(type(error), match=str(error)):
        solve_all(ao.Problem(PENDULUM, ao.Event(0.0, 0.5), ao.Event(2.0, -0.3)))


@pytest.mark.slow
@pytest.mark.parametrize(
    "error", [np.linalg.LinAlgError("Singular matrix"), ValueError("expected")]
)
def test_a_solve_that_fails_is_left_out(monkeypatch, error):
    whole = searches.first_acceptable

    def fails_from_a_guess(problem, guess, choices):
        if guess is not None:
            raise error
        return whole(problem, guess, choices)

    monkeypatch.setattr("actionopt.families.searches.searches.first_acceptable", fails_from_a_guess)
    problem = ao.Problem(PENDULUM, ao.Event(0.0, 0.5), ao.Event(2.0, -0.3))
    found = solve_all(problem, windings=0, starts=2, continuations=0)
    assert set(found.found_by) == {"a straight line"}


# -- free ends -------------------------------------------------------------------------------------


# -- the search itself ---------------------------------------------------------------------------


def test_the_summary_counts_what_was_left_out():
    problem = ao.Problem(systems.particle(), ao.Event(0.0, 0.0), ao.Event(1.0, 2.0))
    found = solve_all(problem)
    assert "left out" not in str(found)
    assert "left out: 3 that forward motion" in str(replace(found, rejected=3))
    assert "left out: 2 that return" in str(replace(found, kinked=2))


@pytest.mark.long
def test_one_degree_of_freedom_is_scanned_without_other_searches():
    # Just before the fold at lam = 3.513830719 two paths are near each other: between samples.
    found = solve_all(systems.bratu(3.51383), starts=0, shots=8, continuations=0)
    assert len(found) == 2 and found[0].action < found[1].action
    # All turns are found by velocities, whether there are paths with so many or not.
    found = solve_all(ao.Problem(PENDULUM, ao.Event(0.0, 0.5), ao.Event(2.0, -0.3)), shots=20)
    assert len(found) == 5 and set(found.searched) == {"straight lines", "forward shots"}
    assert found.searched["straight lines"] == 1


@pytest.mark.long
def test_no_other_way_is_tried_for_what_only_much_faster_motions_leave_open():
    """Those beyond the speeds that forces tell end too close together for their integration."""
    law = lambda q, v, t: (v @ v - q @ q) / 2 - 0.3 * q[0] ** 4 / 4 - np.cos(2 * q[0])  # noqa: E731
    problem = ao.Problem(ao.System(law, ["x"]), ao.Event(0.0, 0.5), ao.Event(4.0, 0.7))
    found = ao.solve_all(problem)
    assert set(found.searched) == {"straight lines", "forward shots"}
    slow = [float(path.start.v[0]) for path in found if abs(path.start.v[0]) < 12.0]
    assert len(slow) == _count_arrivals(problem, 12.0)


def _count_arrivals(problem, fastest):
    """Count the velocities at which motions of unit mass arrive, by scipy's integrator."""
    scipy = pytest.importorskip("scipy.integrate")
    v0 = np.linspace(-fastest, fastest, 2001)

    def rates(t, y):
        q, v = np.split(y, 2)
        return np.concatenate([v, -q - 0.3 * q**3 + 2 * np.sin(2 * q)])

    y0 = np.concatenate([np.full(v0.size, problem.start.q[0]), v0])
    times = problem.start.t, problem.end.t
    ends = scipy.solve_ivp(rates, times, y0, method="DOP853", rtol=1e-9, atol=1e-9).y[: v0.size, -1]
    miss = ends - problem.end.q[0]
    return int(np.sum(miss[:-1] * miss[1:] < 0))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("law", "ends", "duration", "velocities"),
    [
        # By runs of another integrator over all velocities up to 8: far beyond what ends suggest.
        (lambda q, v, t: v[0] ** 2 / 2 - 0.2 * q[0] ** 4, (0.211, 0.486), 3.5,
         (-3.39, -1.25, 0.17, 0.38, 3.71, 7.58)),
        # The path lingers on the hill: no velocity that a float can tell arrives by itself.
        (lambda q, v, t: v[0] ** 2 / 2 - 5 * np.exp(-(((q[0] - 1) / 0.05) ** 2)), (0.0, 0.9), 2.0,
         (np.sqrt(10),)),
    ],
)  # fmt: skip
def test_a_scan_loses_no_path_that_other_ways_find(law, ends, duration, velocities):
    q0, q1 = ends
    system = ao.System(law, ["x"])
    found = solve_all(ao.Problem(system, ao.Event(0.0, [q0]), ao.Event(duration, [q1])))
    known = np.array([s.start.v[0] for s in found])
    assert max(float(np.abs(known - v).min()) for v in velocities) < 0.01


@pytest.mark.long
def test_progress_and_interruption():
    problem = ao.Problem(PENDULUM, ao.Event(0.0, 0.5), ao.Event(2.0, -0.3))
    told = []

    def progress(stage, done, total, detail):
        told.append((stage, done, total, detail))
        if stage == "deflated starts":
            raise KeyboardInterrupt

    found = solve_all(problem, shots=0, progress=progress)
    assert found.interrupted and len(found) >= 3
    assert {how for how, *_ in told} >= {"straight line", "least starts"}
    assert all(done <= total for _, done, total, _ in told)
    assert "interrupted" in str(found)


def test_only_errors_that_tell_of_no_problem_escape():
    for error in (np.linalg.LinAlgError("Singular"), ValueError("expected a path, found none")):
        searches.raise_defect(error)
    with pytest.raises(ValueError, match="broadcast"):
        searches.raise_defect(ValueError("could not broadcast"))


@pytest.mark.long
def test_a_comparison_that_cannot_tell_contradicts_nothing(monkeypatch):
    undecided = type("Undecided", (), {"agrees": None})()
    monkeypatch.setattr(ao.Solution, "compare", lambda _: undecided)
    problem = ao.Problem(PENDULUM, ao.Event(0.0, 0.0), ao.Event(1.0, 1.0))
    assert len(solve_all(problem, starts=2, shots=0, continuations=0)) >= 3


@pytest.mark.slow
def test_forced_motion():
    system = systems.pendulum(g=9.81, force=lambda q, v, t: [-0.3 * v[0]])
    problem = ao.Problem(system, ao.Event(0.0, 0.5), ao.Event(1.0, -0.3))
    found = solve_all(problem, windings=1, starts=1, shots=8, continuations=1)
    assert sorted(set(found.windings)) == [(-1,), (0,), (1,)]


def test_bad_arguments():
    problem = ao.Problem(PENDULUM, ao.Event(0.0, 0.0), ao.Event(1.0, 1.0))
    for angles in (["phi"], "theta", [0], 3):
        with pytest.raises(ValueError, match="angles among theta"):
            solve_all(problem, angles=angles)
    for count in (-1, 0.5, None, "many"):
        with pytest.raises(ValueError, match=">= 0"):
            solve_all(problem, shots=count)
    for tol in (0, 1.0, None, "1e-8"):
        with pytest.raises(ValueError, match="tol between 1e-14"):
            solve_all(problem, tol=tol)
    for nothing in (None, PENDULUM):
        with pytest.raises(ValueError, match="expected a Problem"):
            solve_all(nothing)


def test_between_two_shots_on_either_side_of_the_end_is_one_that_meets_it(monkeypatch):
    system = systems.pendulum("angle")
    problem = ao.Problem(system, ao.Event(0.0, [0.2]), ao.Event(3.0, [0.5]))
    run, met = Answers(problem, 1e-8, (), 0, 0, None), []
    monkeypatch.setattr(run, "_arrivals", lambda classes, v0: met.extend(v0[0]) or ())
    shot = []
    monkeypatch.setattr(velocity_scan, "shoot", lambda *v, **o: shot.append(1) or shoot(*v, **o))
    assert list(run._scan(4)) == [] and run.scanned
    assert met and len(shot) < 9  # the first, and divisions until the miss is linear between two
    for v in met:
        angle, _ = integrated(lambda t, y: [y[1], -np.sin(y[0])], [0.2, v], 0.0, 3.0)(3.0)
        assert angle == pytest.approx(0.5, abs=1e-4)


def test_under_constraints_turns_say_how_fast_motions_are_tried(monkeypatch):
    bob = systems.particle("x y z", constraint=lambda q, t: q @ q - 1)
    ends = ao.Event(0.0, [1.0, 0.0, 0.0]), ao.Event(2.0, [0.0, 1.0, 0.0])

    def fastest(windings):
        run, tried = Answers(ao.Problem(bob, *ends), 1e-8, (), windings, 0, None), []
        known = (SimpleNamespace(start=SimpleNamespace(v=[v])) for v in (1.0, 100.0))
        run.found = [(path, (), "") for path in known]
        monkeypatch.setattr(run, "_aim", lambda v0: tried.append(v0) or ())
        assert list(run._forward_shots(20)) == []
        return np.linalg.norm(np.concatenate(tried, axis=1), axis=0).max()

    assert 2 * np.pi / 2.0 < fastest(1) < fastest(2) < 50


@pytest.mark.slow
def test_a_search_on_a_sphere_ends_and_keeps_the_slow_paths():
    """Great circles through two points, either way round: pi / 3, 5 pi / 3, and 2 pi k more."""
    bob = systems.particle("x y z", constraint=lambda q, t: q @ q - 1)
    places = [1.0, 0.0, 0.0], [0.5, np.sqrt(0.75), 0.0]
    problem = ao.Problem(bob, *(ao.Event(float(t), q) for t, q in enumerate(places)))
    found = solve_all(problem, starts=0, continuations=0)
    ways = np.sqrt(2 * np.array([s.action for s in found]))
    exact = np.pi / 3 * np.array([1, 5, 7])
    np.testing.assert_allclose(ways[:3], exact, atol=1e-7)
    assert len(found) < 8


@pytest.mark.long
def test_every_passage_of_an_oscillator_through_a_point():
    """x = +-sin t: at 1/2 twice a turn, either way round."""
    problem = ao.Problem(OSCILLATOR, ao.Event(0.0, [0.0]), ao.Event(None, [0.5]), energy=0.5)
    found = solve_all(problem, windings=4)
    times = 6 / np.pi * np.sort([s.duration for s in found])  # in twelfths of a turn
    assert times[:9] == pytest.approx([1, 5, 7, 11, 13, 17, 19, 23, 25])


@pytest.mark.long
@pytest.mark.parametrize("unit", [1.0, pytest.param(1e3, marks=pytest.mark.slow)])
def test_a_pendulum_of_an_energy_swings_in_x_and_y_as_in_its_angle(unit):
    """Straight there, first to one side or the other, and to both."""
    low, high = 0.3, -0.2
    place = [[unit * np.sin(a), -np.cos(a)] for a in (low, high)]
    bob = ao.System(
        lambda q, v, t: ((v[0] / unit) ** 2 + v[1] ** 2) / 2 - 9.81 * q[1],
        ["x", "y"],
        constraint=lambda q, t: (q[0] / unit) ** 2 + q[1] ** 2 - 1,
    )
    found = [
        solve_all(ao.Problem(system, ao.Event(0.0, a), ao.Event(None, b), energy=-5.0))
        for system, (a, b) in ((bob, place), (PENDULUM, ([low], [high])))
    ]
    actions = [[s.action for s in paths] for paths in found]
    assert len(actions[1]) == 4 and actions[0] == pytest.approx(actions[1], rel=1e-6)


def test_turns_come_in_order_of_their_sum_however_many_there_are():
    every = sorted(product(range(-2, 3), repeat=3), key=lambda k: sum(map(abs, k)))
    assert list(searches.whole_turns(3, 2)) == every
    first = list(islice(searches.whole_turns(30, 1), 61))
    assert first[0] == (0,) * 30 and {sum(map(abs, k)) for k in first[1:]} == {1}


@pytest.mark.long
def test_paths_of_some_turns_left_out_are_not_said_to_be_all(monkeypatch):
    rotor = systems.particle("a")
    problem = ao.Problem(rotor, ao.Event(0.0, [0.0]), ao.Event(1.0, [0.3]))
    every = ao.solve_all(problem, angles=["a"])
    assert len(every) == 3 and every.complete
    monkeypatch.setattr(searches, "MOST_CLASSES", 2)
    some = ao.solve_all(problem, angles=["a"])
    assert len(some) == 2 and not some.complete


@pytest.mark.long
def test_how_often_a_closed_path_runs_round_a_shorter_one_is_told():
    # x'' = -x^3 of amplitude 1 has the period 4 K(1/2) = 7.4163, and others in inverse proportion.
    T = 2 * 7.416298709205487
    quartic = ao.System(lambda q, v, t: v[0] ** 2 / 2 - q[0] ** 4 / 4, ["x"])
    closed = ao.Problem(quartic, ao.Event(0, [0.0]), ao.Periodic(T))
    orbits = tuple(
        ao.solve(closed, guess=lambda t, k=k: [k / 2 * np.sin(2 * np.pi * k * np.asarray(t) / T)])
        for k in (1, 2)
    )
    none = ((),) * 2
    paths = Paths(orbits, none, ("a guess",) * 2, (), {}, 0, False, False)
    assert paths.rounds == (1, 2)
    assert str(paths).count("2 times round a closed path of duration 7.4163") == 1
    assert np.max(orbits[1](np.linspace(0, T, 200))) == pytest.approx(1.0, abs=1e-3)


def test_an_angle_is_one_on_all_legs():
    def wire(law):
        return ao.System(law, ["x", "y"], constraint=lambda q, t: q[1] - np.sin(q[0]))

    well = wire(lambda q, v, t: v @ v / 2 - q[0] ** 2)
    hills = wire(lambda q, v, t: v @ v / 2 + np.cos(q[0]))
    ends = ao.Event(0, [0, 0]), ao.Event(1, [1, None])
    step = ao.Event(None, None, on=lambda q, t: q[0] - 0.5)
    for laws, angles in ([hills, hills], (0,)), ([well, hills], ()), ([hills, well], ()):
        assert detected_angles(ao.Problem(laws, *ends, through=[step])) == angles


def test_velocities_that_are_tried_along_one_coordinate_go_both_ways():
    far, random = np.array([1.0]), np.random.default_rng(0)
    problem = ao.Problem(PENDULUM, ao.Event(0.0, 0.0), ao.Event(1.0, 1.0))
    (tried,) = velocities(problem, far, 20, random)
    assert tried == pytest.approx(-tried[::-1])
    assert np.all(np.diff(tried) >= 0)


def test_paths_of_one_family_have_the_same_action_but_under_forces():
    def search(forced):
        structure = SimpleNamespace(forced=forced)
        return SimpleNamespace(problem=SimpleNamespace(system=SimpleNamespace(structure=structure)))

    def path(action):
        discrete = SimpleNamespace(tr=SimpleNamespace(action_unit=1.0))
        return SimpleNamespace(action=action, discrete=discrete)

    same = Answers._same_action
    assert same(search(False), path(3.0), path(3.0 + SAME_ACTION))
    assert not same(search(False), path(3.0), path(3.0 + 4 * SAME_ACTION))
    assert same(search(True), path(3.0), path(5.0))


def test_paths_are_numbered_and_told_in_a_line():
    ends = ao.Event(0.0, [0.1]), ao.Event(1.0, [0.2])
    search = {"starts": 1, "shots": 1, "continuations": 0}
    found = ao.solve_all(ao.Problem(systems.pendulum(), *ends), **search)
    actions = ", ".join(f"{s.action:.6g}" for s in found)
    assert repr(found) == f"Paths({len(found)}: S = {actions})" and found[0] is found.solutions[0]
    with pytest.raises(IndexError, match=f"expected one of {len(found)} paths, found number 9"):
        found[9]

    def family(x):
        return ao.Problem(systems.pendulum(), ends[0], ao.Event(1.0, [x]))

    run = SimpleNamespace(family=family, tol=1e-8)
    assert _TraceRun._is_solved(run, SimpleNamespace(s=0.3, path=found[0].path))
