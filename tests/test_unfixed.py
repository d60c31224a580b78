"""Paths whose duration is to be found, against closed forms; orbits, and their period."""

from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
import systems
from helpers import a_quarter, integrated, slow
from scipy.special import ellipk, ellipkinc, ellipkm1

import actionopt as ao
from actionopt import scenes
from actionopt.discrete.borders.bordered import Bordered
from actionopt.discrete.matrices.factors import full
from actionopt.families.searches.free_times import _passes
from actionopt.solver.ends.durations import straight_passage
from actionopt.solver.kinds import first_paths
from actionopt.solver.kinds.between import Choices
from actionopt.solver.kinds.first_paths import FirstPaths, guess_path
from actionopt.solver.kinds.unfixed import Unfixed, _by_ipopt
from actionopt.solver.refinement.signals import OutOfTime
from actionopt.solver.search.strategies import STRATEGIES

G = 9.81


def free(T, q):
    return ao.Event(T, q)


def throw(energy, to=(4.0, 1.0)):
    system = ao.System(lambda q, v, t: v @ v / 2 - G * q[1], ["x", "y"])
    return ao.Problem(system, ao.Event(0.0, [0.0, 0.0]), ao.Event(None, to), energy=energy)


def flights(energy, to=(4.0, 1.0)):
    """T^4 g^2 / 4 + T^2 (g y - 2 E) + d^2 = 0."""
    return np.sqrt(np.sort(np.roots([G * G / 4, G * to[1] - 2 * energy, np.dot(to, to)])))


def test_a_throw_far_from_zero():
    """Up by h at speed v: T = (v - sqrt(v^2 - 2 g h)) / g; S is of the flight and of its height."""
    q0, h, v = 1000.0, 0.5, 6.0
    system = ao.System(lambda q, v, t: v[0] ** 2 / 2 - G * q[0], ["y"])
    problem = ao.Problem(
        system, ao.Event(0.0, [q0]), ao.Event(None, [q0 + h]), energy=v**2 / 2 + G * q0
    )
    up = ao.solve(problem)
    T = (v - np.sqrt(v**2 - 2 * G * h)) / G
    t = np.linspace(0, 1, 9) * up.end.t
    assert abs(up.end.t - T) < 1e-11 and np.abs(up(t)[0] - (q0 + v * t - G * t**2 / 2)).max() < 1e-9
    S = v**2 / 2 * T - v * G * T**2 + G**2 * T**3 / 3 - G * q0 * T
    assert abs(up.action - S) < 1e-9


def test_newtons_steps_from_the_line_are_enough_to_begin_with(monkeypatch):
    monkeypatch.delattr(first_paths, "solve_on_the_way")
    known = flights(60.0)[0]
    assert ao.solve(throw(60.0)).duration == pytest.approx(known, abs=1e-8)


@pytest.mark.quick("30.0")
@pytest.mark.parametrize("energy", [30.0, 90.0])
def test_low_and_high_throw(energy):
    problem, (short, long) = throw(energy), flights(energy)
    low = ao.solve(problem, tol=1e-11)
    assert abs(low.duration - short) < 1e-11 * short
    guess = ao.solve(ao.Problem(problem.system, problem.start, ao.Event(1.1 * long, (4.0, 1.0))))
    high = ao.solve(problem, guess=guess, tol=1e-11)
    assert abs(high.duration - long) < 1e-11 * long
    for s in (low, high):
        assert s.energy([0.0, s.duration]) == pytest.approx(energy, abs=1e-9)
        assert s.abbreviated_action == pytest.approx(s.action + energy * s.duration, rel=1e-14)
        v = s.velocity(np.linspace(0, s.duration, 2001))
        along = np.trapezoid(np.sum(v * v, axis=0), dx=s.duration / 2000)
        assert s.abbreviated_action == pytest.approx(along, rel=1e-5)
        assert s.compare().agrees
    # the high throw lies beyond the envelope of safety: it has touched a caustic of its energy
    assert (low.morse_index, high.morse_index) == (0, 1)
    assert (low.between_times.morse_index, high.between_times.morse_index) == (0, 0)


@pytest.mark.long
def test_below_the_energy_that_is_needed_a_sentence():
    least = G * (1 + np.sqrt(17.0)) / 2  # E = g (y + d) / 2
    assert ao.solve(throw(least + 0.01)).success
    with pytest.raises(ao.SolveError, match=f"lowest energy is that over .*, {least:.6g}"):
        ao.solve(throw(least - 0.5))
    with pytest.raises(ao.SolveError, match="two paths merge") as merged:
        ao.solve(throw(least))
    # the two durations are one where g T^2 / 2 is the distance
    assert merged.value.solution.duration == pytest.approx(np.sqrt(2 * np.sqrt(17.0) / G), rel=1e-6)
    with pytest.raises(ao.SolveError, match=r"lowest energy is .*, above the one given by 1e-06"):
        ao.solve(throw(least - 1e-6))


def test_the_path_told_degenerate_is_the_one_that_was_found():
    # Between antipodes of a sphere: half a great circle, of length pi. What is tried after it has
    # been found ends elsewhere.
    sphere = ao.System(
        lambda q, v, t: (v[0] ** 2 + np.sin(q[0]) ** 2 * v[1] ** 2) / 2, ["theta", "phi"]
    )
    theta, phi, energy = 0.9040445, 0.3840642, 0.25189146
    end = ao.Event(None, [np.pi - theta, phi + np.pi])
    problem = ao.Problem(sphere, ao.Event(0.0, [theta, phi]), end, energy=energy)
    found = ao.solve(problem, throw=False)
    assert (found.status, found.stats["nullity"]) == (ao.Status.DEGENERATE, 1)
    assert found.duration == pytest.approx(np.pi / np.sqrt(2 * energy), rel=1e-6)


@pytest.mark.long
def test_the_transfer_of_least_energy_is_returned():
    # Lagrange: the ellipse of least energy has 4 a = r1 + r2 + chord, and t is known to half the
    # digits at most, as two ellipses merge there.
    system = systems.kepler()
    end = 1.407 * np.array([np.cos(1.037), np.sin(1.037)])
    chord = np.hypot(*(end - [1.0, 0.0]))
    half = (2.407 + chord) / 2
    beta = 2 * np.arcsin(np.sqrt((half - chord) / half))
    duration = (half / 2) ** 1.5 * (np.pi - (beta - np.sin(beta)))
    problem = ao.Problem(system, ao.Event(0.0, [1, 0]), ao.Event(None, end), energy=-1 / half)
    found = ao.solve(problem, throw=False)
    assert found.status in (ao.Status.FLOOR, ao.Status.DEGENERATE)
    assert found.duration == pytest.approx(duration, rel=1e-5)


@pytest.mark.long
def test_no_lowest_energy_is_claimed_where_lower_ones_were_lost():
    # Half an ellipse of Kepler's of least energy, -1/3; the first path found passes its centre.
    system = systems.kepler()
    problem = ao.Problem(system, ao.Event(0.0, [1, 0]), ao.Event(None, [-2, 0]), energy=-1 / 3)
    first = FirstPaths(problem, 1e-8)
    assert list(first.over_durations())
    assert "lowest energy" not in first.hint


def test_behind_a_wall_the_sentence_says_so():
    wells = ao.System(lambda q, v, t: v[0] ** 2 / 2 - (q[0] ** 2 - 1) ** 2, ["x"])
    why = "no stationary path was found: the energy 0.5 is below the potential, 1, at x = 0, "
    for energy, ask in ((1.2, None), (0.5, why)):
        problem = ao.Problem(wells, ao.Event(0.0, [-1.0]), ao.Event(None, [1.0]), energy=energy)
        if ask:
            with pytest.raises(ao.SolveError, match=ask):
                ao.solve(problem)
        else:
            assert ao.solve(problem).success


TOPS = {  # L whose potential has its top, 1, at 0, and its mass
    "wells": (lambda q, v, t: v[0] ** 2 / 2 - (q[0] ** 2 - 1) ** 2, lambda x: 1.0),
    "mass and gauge": (
        lambda q, v, t: (
            (2 + np.sin(q[0])) * v[0] ** 2 / 2 - (q[0] ** 2 - 1) ** 2 + q[0] ** 2 * v[0]
        ),
        lambda x: 2 + np.sin(x),
    ),
}


@pytest.mark.quick("1e-06-wells")
@pytest.mark.parametrize("name", TOPS)
@pytest.mark.parametrize("above", [1e-6, 1e-9])
def test_just_above_a_barrier(name, above):
    L, mass = TOPS[name]
    problem = ao.Problem(
        ao.System(L, ["x"]), ao.Event(0.0, [-1.2]), ao.Event(None, [0.9]), energy=1 + above
    )
    found = ao.solve(problem, throw=False)
    top = np.sqrt(above)

    def slowness(u):  # dt/du where x = top sinh(u): E - V = above + x^2 (2 - x^2)
        x = top * np.sinh(u)
        return top * np.cosh(u) * np.sqrt(mass(x) / 2 / (above + x * x * (2 - x * x)))

    u, w = np.polynomial.legendre.leggauss(200)
    a, b = np.arcsinh(np.array([-1.2, 0.9]) / top)
    T = (b - a) / 2 * w @ slowness((a + b) / 2 + (b - a) / 2 * u)
    assert found.status in (ao.Status.SOLVED, ao.Status.FLOOR)
    assert abs(found.duration / T - 1) < min(found.error, 1e-14 / above)


@pytest.mark.slow
def test_a_path_that_is_not_reached_is_not_called_one_of_a_family():
    """Near the top of a barrier Newton's method arrives nowhere, and its matrix tells nothing."""
    wells = ao.System(TOPS["wells"][0], ["x"])
    start, end = ao.Event(0.0, [-1.3]), ao.Event(None, [0.9])
    found = ao.solve(ao.Problem(wells, start, end, energy=1 + 1e-10), throw=False)
    assert found.status is not ao.Status.DEGENERATE


def test_an_energy_below_the_potential_at_an_end_is_no_search():
    bowl = ao.System(lambda q, v, t: v @ v / 2 - q @ q / 2 + q[0] * v[1], ["x", "y"])
    problem = ao.Problem(bowl, ao.Event(0.0, [0.1, 0.0]), ao.Event(None, [1.0, 1.0]), energy=0.9)
    found = ao.solve(problem, throw=False)
    assert found.status is ao.Status.NOT_FOUND and not sum(found.stats["iterations"].values())
    with pytest.raises(ao.SolveError, match="potential, 1, at x = 1, y = 1"):
        ao.solve(problem)
    assert ao.solve(problem.replace(energy=1.5)).success


def test_a_coordinate_of_round_off_needs_no_duration_to_be_told_from_one_of_another_unit():
    """Once round a great circle ends at sin(2 pi), -2.4e-16, and takes 2 pi / sqrt(2 E)."""
    sphere = systems.particle("x y z", constraint=lambda q, t: q @ q - 1)
    end = ao.Event(None, [np.cos(2 * np.pi), np.sin(2 * np.pi), 1e-16])
    problem = ao.Problem(sphere, ao.Event(0, [1.0, 0.0, 0.0]), end, energy=2.0)
    assert problem.scales == pytest.approx([1, 1, 1])


def test_a_start_whose_time_is_free():
    oscillator = systems.oscillator()
    problem = ao.Problem(oscillator, free(None, [0.3]), ao.Event(2.0, [0.8]), energy=0.5)
    s = ao.solve(problem, tol=1e-12)
    assert abs(s.start.t - (2.0 - np.arcsin(0.8) + np.arcsin(0.3))) < 1e-12
    both = ao.solve(problem.replace(end=free(None, [0.8])))
    assert both.start.t == 0.0 and both.duration == pytest.approx(s.duration, abs=1e-8)


def test_up_and_back():
    system = ao.System(lambda q, v, t: v[0] ** 2 / 2 - G * q[0], ["z"])
    s = ao.solve(ao.Problem(system, free(0.0, [0.0]), free(None, [0.0]), energy=8.0))
    assert s.duration == pytest.approx(8 / G, abs=1e-8)


def test_all_paths_to_a_free_end_of_a_clock():
    # x'' = t from (0, 0) to x = 1 at T, where H = v^2 / 2 - t x = 0.
    system = ao.System(lambda q, v, t: v[0] ** 2 / 2 + t * q[0], ["x"])
    paths = ao.solve_all(
        ao.Problem(system, ao.Event(0.0, [0.0]), ao.Event(None, [1.0]), energy=0.0)
    )
    Tv = np.polynomial.Polynomial([1.0, 0.0, 0.0, 1 / 3])  # of v there
    roots = (Tv**2 / 2 - np.polynomial.Polynomial([0.0, 0.0, 0.0, 1.0])).roots()
    roots = np.sort(roots[(abs(roots.imag) < 1e-9) & (roots.real > 0)].real)
    assert sorted(path.duration for path in paths) == pytest.approx(roots, abs=1e-8)


@pytest.mark.quick("<lambda>-start1-end1", "<lambda>-start2-end2")
@pytest.mark.parametrize(
    "L, start, end",
    [
        (lambda q, v, t: v[0] ** 2 / 2 + 1 / q[0], [1.0], [0.0]),  # a fall onto the pole
        (lambda q, v, t: v[0] ** 2 / 2 + 1 / q[0], [0.0], [1.0]),
        (lambda q, v, t: v[0] ** 2 / 2 - q @ q / 2, [1.0, 0.0], [0.0, 1.0]),  # without mass
    ],
)
def test_what_is_no_question_between_given_times_is_none_of_a_given_energy(L, start, end):
    system = ao.System(L, ["x", "y"][: len(start)])
    with pytest.raises(ValueError, match="expected a") as raised:
        ao.solve(ao.Problem(system, ao.Event(0.0, start), ao.Event(1.1, end)))
    timed = ao.Problem(system, ao.Event(0.0, start), ao.Event(None, end), energy=2.0)
    line = np.linspace(start, end, 3).T
    for ask in (ao.solve, partial(ao.solve, guess=line), ao.solve_all):
        with pytest.raises(ValueError, match="expected a") as again:
            ask(timed)
        assert str(again.value) == str(raised.value)


def test_the_round_off_of_late_times_counts_where_one_is_free():
    system = ao.System(lambda q, v, t: v[0] ** 2 / 2 + 0.3 * q[0] * np.cos(30 * t), ["x"])

    def moved(t0):
        problem = ao.Problem(system, ao.Event(t0, [1.0]), ao.Event(None, [0.5]), energy=0.7)
        run = Unfixed(problem, tol=1e-8)
        mesh = ao.Mesh.uniform(t0, t0 + 0.4, 4, 10)
        run.transcribe(mesh, ao.Path(mesh, np.linspace([1.0], [0.5], 41).T))
        return run.here.misread()

    assert moved(0.0) == 0.0
    assert 1e-13 < moved(1e6) < 1e-7  # eps t is 1e-10


def test_what_does_not_fit_is_refused():
    system, q = throw(30.0).system, [0.0, 0.0]
    timed = ao.System(lambda q, v, t: v[0] ** 2 / 2 + np.cos(t) * q[0], ["x"])
    dragged = systems.particle(force=lambda q, v, t: [-v[0]])
    for ask, what in (
        (lambda: ao.Problem(system, free(0.0, q), free(1.0, q), energy=1.0), "time of an event is"),
        (lambda: ao.Problem(timed, free(0.0, [None]), ao.Periodic(None)), "without a clock"),
        (lambda: ao.Problem(timed, free(None, [0]), free(None, [1])), "one time that is given"),
        (lambda: ao.Problem(dragged, free(0, [0]), free(None, [1])), "non-conservative"),
        (lambda: throw(30.0).duration, "to be found"),
        (lambda: ao.solve(throw(30.0), guess=lambda t: [t, t]), "says its duration"),
        (lambda: ao.Problem(system, free(0, q), free(None, q), energy=np.nan), "the energy"),
    ):
        with pytest.raises(ValueError, match=what):
            ask()


def test_a_straight_line_has_the_energy_over_one_duration():
    """E = d^2 / (2 T^2) + g h / 2; the durations that are tried are a factor 1.8 apart."""
    (T,) = FirstPaths(throw(40.0), 1e-8)._durations_of_energy()
    assert pytest.approx(np.sqrt(17.0 / (80.0 - G)), rel=0.1) == T


# -- all of them -----------------------------------------------------------------------------------


class Turns:
    """Two turns of a circle, from t = 2 pi on."""

    start, end = SimpleNamespace(t=2 * np.pi), SimpleNamespace(t=6 * np.pi, q=np.array([1.0, 0.0]))
    problem, duration = SimpleNamespace(end=SimpleNamespace(pinned=(0, 1))), 4 * np.pi

    def __call__(self, t):
        return np.array([np.cos(t), np.sin(t)])

    def velocity(self, t):
        return np.array([-np.sin(t), np.cos(t)])


@pytest.mark.parametrize(
    ("turns", "passes"), [(1.01, False), (1.5, False), (1.98, True), (2.99, False)]
)
def test_a_path_passes_its_end_between_its_events(turns, passes):
    assert _passes(Turns(), [2 * np.pi * turns], np.ones((2, 1))) == passes


def lambert(energy, r1, r2):
    """The four flights of one ellipse or the other, either way round (Battin, section 6.6)."""
    a, c = -1 / (2 * energy), np.linalg.norm(np.subtract(r1, r2))
    s = (np.linalg.norm(r1) + np.linalg.norm(r2) + c) / 2
    alpha, beta = 2 * np.arcsin(np.sqrt(s / (2 * a))), 2 * np.arcsin(np.sqrt((s - c) / (2 * a)))
    return sorted(
        a**1.5 * (x - np.sin(x) - way * (beta - np.sin(beta)))
        for x in (alpha, 2 * np.pi - alpha)
        for way in (1, -1)
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("energy", "end"),
    [(-0.4, (0.3, 0.9)), (-0.3, (-0.8, 0.9)), (-1 / 2.2, (0.0, 1.2, 0.0))],  # in space found once
)
def test_all_four_transfers_of_given_energy(energy, end):
    system, start = systems.kepler("x y z"[: 2 * len(end)]), [1.0, 0.0, 0.0][: len(end)]
    problem = ao.Problem(system, free(0.0, start), free(None, end), energy=energy)
    found = ao.solve_all(problem, shots=4 * len(end))
    exact = lambert(energy, start, end)
    assert sorted(s.duration for s in found) == pytest.approx(exact, rel=1e-7)
    # The long way of each round passes a caustic; in space, flights of more than half a turn pass
    # the line through the start and the centre, about which their planes may be turned.
    in_space = [0, 1, 1, 2]
    assert sorted(s.morse_index for s in found) == (in_space if len(end) == 3 else [0, 0, 1, 1])
    assert all(s.compare().agrees for s in found)


# -- orbits ----------------------------------------------------------------------------------------


def quartic_period(energy):
    """Of v^2/2 + x^2/2 + x^4/4: T = 4 K(m) / (1 + A^2)^(1/2), with m = A^2 / (2 + 2 A^2)."""
    square = np.sqrt(1 + 4 * energy) - 1
    return 4 * ellipk(square / (2 + 2 * square)) / np.sqrt(1 + square)


SPRING = systems.spring()


def test_both_throws_of_one_energy_in_space_are_found():
    """|r|^2 = (v T)^2 - g z T^2 - g^2 T^4 / 4, where the speed at the start is v."""
    end, g, E = np.array([3.0, 4.0, 1.0]), 9.81, 60.0
    thrown = ao.System(lambda q, v, t: v @ v / 2 - g * q[2], ["x", "y", "z"])
    problem = ao.Problem(thrown, ao.Event(0.0, [0.0] * 3), ao.Event(None, end), energy=E)
    paths = ao.solve_all(problem, starts=0, shots=1, continuations=0)
    squares = np.roots([g**2 / 4, g * end[2] - 2 * E, end @ end])
    assert sorted(path.duration for path in paths) == pytest.approx(sorted(np.sqrt(squares)))
    assert paths.indices == (1, 0)
    assert [path.abbreviated_action - path.action for path in paths] == pytest.approx(
        [E * path.duration for path in paths]
    )


@pytest.mark.long
def test_an_oscillator_that_sets_out_near_its_rest_passes_a_place_four_times():
    """Up and back under the force at the start would last 1000 periods."""
    q, end = 1e-3, 0.5
    ends = ao.Event(0.0, [q]), ao.Event(None, [end])
    paths = ao.solve_all(ao.Problem(systems.oscillator(), *ends, energy=0.5))
    up, down = np.arcsin(q), np.pi - np.arcsin(q)
    exact = [
        (at - phase) % (2 * np.pi) for at in (np.pi / 6, 5 * np.pi / 6) for phase in (up, down)
    ]
    assert sorted(path.duration for path in paths) == pytest.approx(sorted(exact))


@pytest.mark.quick("0.9-0.7")
@pytest.mark.parametrize("start", [None, 0.7, *slow(0.0)])
@pytest.mark.parametrize("energy", [0.9, *slow(4.0)])
def test_period_of_a_quartic_oscillator(start, energy):
    guess = ao.Path.interpolate(lambda t: 1.4 * np.sin([t]), ao.Mesh.uniform(0, 2 * np.pi, 3, 10))
    problem = ao.Problem(SPRING, free(0.0, [start]), ao.Periodic(None), energy=energy)
    s = ao.solve(problem, guess=guess, tol=1e-11)
    assert abs(s.duration - quartic_period(energy)) < 1e-10
    assert start is None or abs(s.start.q[0] - start) < 1e-10
    assert np.max(np.abs(s.momenta[1] - s.momenta[0])) < 1e-10
    M = ao.monodromy(s)
    h = 1e-4
    slope = (quartic_period(energy + h) - quartic_period(energy - h)) / (2 * h)
    # the flow over a period: 1 - (dT/dE) X dH, with X the rates (q', p')
    x, v = s.start.q[0], s.start.v[0]
    rates, dH = np.array([v, -x - x**3]), np.array([x + x**3, v])
    assert np.asarray(M) == pytest.approx(np.eye(2) - slope * np.outer(rates, dH), abs=1e-6)
    assert abs(np.linalg.det(M) - 1) < 1e-12 and M.stable and M.trivial == 1
    assert s.kind == "saddle" and s.morse_index == s.between_times.morse_index == 2


@pytest.mark.long
@pytest.mark.parametrize("start", a_quarter([None, 0.3, -0.2]))
def test_one_coordinate_in_a_well_needs_no_guess(start):
    """T of a quartic spring, and of Morse's potential D (1 - e^-x)^2: 2 pi / (2 (D - E))^(1/2)."""
    depth = 2.0
    morse = ao.System(lambda q, v, t: v[0] ** 2 / 2 - depth * (1 - np.exp(-q[0])) ** 2, ["x"])
    for system, period, energies in (
        (SPRING, quartic_period, (0.06, 4.0, 1e4)),
        (morse, lambda E: 2 * np.pi / np.sqrt(2 * (depth - E)), (0.25, 1.5, 1.9)),
    ):
        for energy in energies:
            problem = ao.Problem(system, free(0.0, [start]), ao.Periodic(None), energy=energy)
            s = ao.solve(problem, tol=1e-9)
            assert abs(s.duration / period(energy) - 1) < 1e-9
            assert start is None or abs(s.start.q[0] - start) < 1e-9
    if start is None:
        runs = ao.sweep(problem, {"energy": [0.5, 1.0, 1.5]})
        times = [runs.solution(k).duration for k in range(3)]
        assert times == pytest.approx(period(np.array([0.5, 1.0, 1.5])), rel=1e-6)
    for energy in (2.5, -1.0):  # it escapes; there is no motion
        with pytest.raises(ValueError, match="bound at that energy"):
            ao.solve(problem.replace(energy=energy))


def test_one_coordinate_that_no_wall_turns_back_closes_nowhere():
    hollow = ao.System(lambda q, v, t: v[0] ** 2 / 2 + np.exp(-(q[0] ** 2)), ["x"])
    with pytest.raises(ValueError, match=r"bound at that energy, 0\.5"):
        ao.solve(ao.Problem(hollow, free(0.0, [None]), ao.Periodic(None), energy=0.5))


@pytest.mark.quick("1")
@pytest.mark.parametrize("sign", [1, -1])
def test_one_coordinate_that_turns_needs_no_guess(sign):
    """T = 2 k K(k), k^2 = 2 / (E + 1): a pendulum over the top, g = l = 1."""
    pendulum = systems.pendulum()
    end = ao.Periodic(None, advance=[sign * 2 * np.pi])
    for energy in (1.01, 3.0):
        s = ao.solve(ao.Problem(pendulum, free(0.0, [0.4]), end, energy=energy), tol=1e-10)
        squared, (a, b) = 2 / (energy + 1), (1.0, np.sqrt(1 - 2 / (energy + 1)))
        for _ in range(8):  # the arithmetic-geometric mean
            a, b = (a + b) / 2, np.sqrt(a * b)
        assert abs(s.duration - np.sqrt(squared) * np.pi / a) < 1e-9
        assert s.start.v[0] * sign > 0
    with pytest.raises(ValueError, match=r"bound at that energy, 0.5, .* or turns"):
        ao.solve(ao.Problem(pendulum, free(0.0, [0.4]), end, energy=0.5))


@pytest.mark.parametrize("above", [1e-5, 1e-7])
def test_one_coordinate_turns_just_above_its_top(above):
    """T = 2 k K(k), 1 - k^2 = above / (2 + above): most of the time is spent near the top."""
    end = ao.Periodic(None, advance=[2 * np.pi])
    problem = ao.Problem(systems.pendulum(), free(0.0, [None]), end, energy=1 + above)
    s = ao.solve(problem, tol=1e-8)
    left = (1 + above - 1) / (2 + above)
    exact = 2 * np.sqrt(1 - left) * ellipkm1(left)
    assert abs(s.duration / exact - 1) < 1e-8
    assert s.mesh.nodes.size < 500


def test_no_path_closes_near_the_guess():  # but rest, and what a force along it would close
    system = systems.spring()
    problem = ao.Problem(system, ao.Event(0.0, [None]), ao.Periodic(7.0))  # too long for once round
    found = ao.solve(problem, guess=lambda t: [np.cos(t)], throw=False)
    assert not found.success or np.abs(found(np.linspace(0.0, 7.0, 50))).max() == 0.0


@pytest.mark.slow
def test_period_doublings_of_henon_and_heiles():
    """Along x = 0 the field across has the equation of Hill, xi'' = -(1 + 2 y) xi."""
    energy, ends = 0.1, ao.Event(0.0, [None, None])
    system = systems.henon_heiles()
    guess = ao.integrate(system, ao.State(0.0, [0.0, 0.0], [0.0, np.sqrt(2 * energy)]), 7.1)
    problem = ao.Problem(system, ends, ao.Periodic(None), energy=energy)
    family = ao.trace(problem, "energy", 0.145, guess=guess)
    (mark,) = family.marks
    assert mark.kind == "period doubling"
    T, start, rate = mark.path.mesh.duration, mark.path(0.0)[1], mark.path.velocity(0.0)[1]
    columns = []
    for xi in ([1.0, 0.0], [0.0, 1.0]):

        def flow(t, z):
            return [z[1], -z[0] + z[0] ** 2, z[3], -(1 + 2 * z[0]) * z[2]]

        columns.append(integrated(flow, [start, rate, *xi], 0.0, T, rtol=1e-12)(T)[2:])
    assert np.trace(np.transpose(columns)) == pytest.approx(-2.0, abs=1e-6)


def test_an_order_that_is_none_is_refused():
    heavy = ao.System(lambda q, v, t: v[0] ** 2 + v[1] ** 2 / 2 - (q[0] - q[1]) ** 2, ["a", "b"])
    spring = systems.oscillator("a b", force=lambda q, v, t: [-v[0], -v[1]])
    for system, order, what in (
        (heavy, ["b", "a"], "leaves L as it is"),
        (heavy, ["a", "a"], "each of a, b once"),
        (heavy, [0, 2], "each of a, b once"),
        (heavy, ["a"], "each of a, b once"),
        (heavy, [0.0, 1.0], "each of a, b once"),
        (spring, ["b", "a"], "without constraints and non-conservative"),
    ):
        with pytest.raises(ValueError, match=what):
            ao.Problem(system, free(0.0, None), ao.Periodic(1.0, relabel=order))


@pytest.mark.quick("True-1e-07")
@pytest.mark.parametrize("below", a_quarter([1e-7, 0.0, 1e-4, 1e-12]))
@pytest.mark.parametrize("timed", [True, False])
def test_a_start_where_the_path_turns_back(below, timed):
    top = 1.4
    energy = top**2 / 2 + top**4 / 4
    T = quartic_period(energy)
    mesh = ao.Mesh.uniform(0.0, T, 3, 10)
    for turn in (0.0, 0.3):  # of the guess, from the start
        guess = ao.Path.interpolate(lambda t, s=turn: [1.2 * np.cos(2 * np.pi * (t - s) / T)], mesh)
        end, given = (ao.Periodic(T), None) if timed else (ao.Periodic(None), energy)
        problem = ao.Problem(SPRING, free(0.0, [top - below]), end, energy=given)
        s = ao.solve(problem, guess=guess, tol=1e-10)
        assert abs(s.duration - T) < 1e-11 and s.start.q[0] == top - below
        assert abs(np.abs(s.start.v[0]) - np.sqrt(2 * below * (top + top**3))) < 1e-5
        off = s.momenta[1] - s.momenta[0]
        assert np.abs(off).max() < 1e-8
    problem = problem.replace(start=free(0.0, [top + 1e-5]))
    with pytest.raises(ao.SolveError, match="does not pass what the start gives"):
        ao.solve(problem, guess=guess, tol=1e-10)


KEPLER = systems.kepler()


@pytest.mark.long
@pytest.mark.parametrize("e", a_quarter([0.8, 0.1, 0.95]))
@pytest.mark.parametrize(
    ("timed", "start", "many"),
    a_quarter(
        (timed, *start)
        for start in [((None, 0.0), 2), (None, 2), ("pericentre", 1)]
        for timed in (True, False)
    ),
)
def test_closed_paths_that_are_many(e, timed, start, many):
    """Ellipses of one energy: one period, one action, any orientation and eccentricity."""
    a = 1.3
    T, S, near = 2 * np.pi * a**1.5, 3 * np.pi * np.sqrt(a), a * (1 - e)
    start = (near, 0.0) if start == "pericentre" else start
    end, energy = (ao.Periodic(T), None) if timed else (ao.Periodic(None), -0.5 / a)
    problem = ao.Problem(KEPLER, free(0.0, start), end, energy=energy)
    state = ao.State(0.0, [near, 0.0], [0.0, np.sqrt((1 + e) / near)])
    guess = ao.integrate(KEPLER, state, 1.001 * T, tol=1e-6)
    with pytest.raises(ao.SolveError, match=f"are a family of dimension {many}") as raised:
        ao.solve(problem, guess=guess, tol=1e-10)
    s = raised.value.solution
    assert s.status.name == "DEGENERATE" and s.error < 1e-10
    assert s.duration == pytest.approx(T, rel=1e-12) and s.action == pytest.approx(S, rel=1e-12)
    assert np.abs(s.momenta[1] - s.momenta[0]).max() < 1e-9
    given = [i for i, x in enumerate(start or ()) if x is not None]
    assert np.allclose(s.start.q[given], [start[i] for i in given], rtol=0, atol=1e-9)


def test_closed_paths_that_are_many_near_a_rough_guess():
    for start in (None, [0.3, None]):
        problem = ao.Problem(KEPLER, free(0.0, start), ao.Periodic(2 * np.pi))
        found = ao.solve(
            problem, guess=lambda t: np.stack([np.cos(t) - 0.1, 0.9 * np.sin(t)]), throw=False
        )
        assert found.status.name == "DEGENERATE" and abs(found.action - 3 * np.pi) < 1e-9


def test_ipopt_is_asked_between_the_ends_of_the_path_at_hand():
    wall = ao.Event(1.0, None, on=lambda q, t: q[0] - 1)
    problem = ao.Problem(systems.oscillator("x y"), ao.Event(0.0, [0.0, 0.0]), wall)
    path = ao.Path(ao.Mesh.uniform(0.0, 1.0, 2, 2), np.outer([1.0, 0.7], np.linspace(0, 1, 5)))
    found = _by_ipopt(problem, path, Choices(1e-8, "auto", STRATEGIES, None, None))
    assert found([0.0, 1.0]) == pytest.approx(np.array([[0.0, 1.0], [0.0, 0.7]]), abs=1e-12)


@pytest.mark.parametrize("start", [None, pytest.param(0.0, marks=pytest.mark.long)])
def test_rest_is_no_closed_path_of_a_sweep(start):
    problem = ao.Problem(SPRING, free(0.0, [start]), ao.Periodic(5.0))
    assert ao.solve(problem).success
    with pytest.raises(ao.SolveError, match=r"2 NOT_FOUND of 2.*for a closed path that moves"):
        ao.sweep(problem, {"t1": [4.0, 5.0]})


def test_ipopt_and_a_mesh_find_the_period_of_a_closed_path():
    """The pendulum of amplitude 1: 4 K(sin^2(1/2))."""
    turning = ao.Problem(systems.pendulum(), free(0.0, [0.0]), ao.Periodic(None), energy=-np.cos(1))
    for choice in ({"method": "ipopt"}, {"mesh": ao.Mesh.uniform(0, 1, 8, 8)}):
        found = ao.solve(turning, **choice)
        assert abs(found.duration - 4 * ellipk(np.sin(0.5) ** 2)) < 1e-8


@pytest.mark.parametrize(
    ("below", "tol"),
    [(1e-4, 1e-8), *(pytest.param(1e-6, tol, marks=pytest.mark.long) for tol in (1e-8, 1e-6))],
)
def test_a_pendulum_that_nearly_comes_to_the_top(below, tol):
    """It dwells there: its period is 4 K(1 - below / 2)."""
    problem = ao.Problem(systems.pendulum(), free(0.0, [0.0]), ao.Periodic(None), energy=1 - below)
    turn = ao.solve(problem, tol=tol)
    assert turn.duration == pytest.approx(4 * ellipkm1(below / 2), rel=tol)


@pytest.mark.long
def test_closed_paths_at_a_saddle_are_known_to_round_off_and_no_family():
    """The period changes by 2 / (1 - E) with the energy."""
    ends = free(0.0, [0.0]), ao.Periodic(None)
    turn = ao.solve(ao.Problem(systems.pendulum(), *ends, energy=1 - 1e-8), throw=False)
    assert turn.status is ao.Status.FLOOR and turn.error < 1e-6
    assert turn.duration == pytest.approx(4 * ellipkm1(5e-9), rel=1e-8)


def test_an_energy_beside_a_top_is_told_with_its_digits():
    over = ao.Problem(systems.pendulum(), free(0.0, [0.0]), ao.Periodic(None), energy=1 + 1e-8)
    with pytest.raises(ValueError, match=r"at that energy, 1\.00000001, near"):
        ao.solve(over)


def restricted(q, v, t, mu=0.012277471):
    """Of the Moon's mass and the Earth's, in coordinates that turn with both."""
    x, y = q
    near = (1 - mu) / np.sqrt((x + mu) ** 2 + y**2) + mu / np.sqrt((x - 1 + mu) ** 2 + y**2)
    return ((v[0] - y) ** 2 + (v[1] + x) ** 2) / 2 + near


EIGHT = scenes.get("four_on_an_eight")
THREE = scenes.get("figure_eight")
ORBITS = {  # system, start, period, action; references beside them
    # Hairer, Norsett and Wanner, Solving ODEs I, pages 130 and 186; their actions from long doubles
    "Arenstorf, four loops": (
        ao.System(restricted, ["x", "y"]), [0.994, 0.0], [0.0, -2.00158510637908252240537862224],
        17.0652165601579625588917206249, 31.76341700087625706,
    ),
    "Arenstorf, three loops": (
        ao.System(restricted, ["x", "y"]), [0.994, 0.0], [0.0, -2.0317326295573368357302057924],
        11.124340337266085134999734047, 22.72533444164689695,
    ),
    "four on an eight": (  # its own source
        EIGHT.problem.system, EIGHT.facts.start.q, EIGHT.facts.start.v,
        EIGHT.facts["period"], EIGHT.facts["period_action"],
    ),
    "figure-eight": (  # a third of it
        THREE.problem.system, THREE.facts.start.q, THREE.facts.start.v,
        THREE.facts["period"], 3 * THREE.action,
    ),
}  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize("name", a_quarter(ORBITS, len(ORBITS) - 1))
def test_orbits_of_the_literature_close_with_the_period_of_their_energy(name):
    system, q, v, T, S = ORBITS[name]
    energy, guess = system.energy(q, v, 0.0), ao.integrate(system, ao.State(0.0, q, v), T)
    ends = free(0.0, [None] * system.n), ao.Periodic(None)
    s = ao.solve(ao.Problem(system, *ends, energy=float(energy)), guess=guess, tol=1e-10)
    assert abs(s.duration / T - 1) < 1e-12
    assert abs(s.action / S - 1) < 1e-12
    assert np.max(np.abs(s.end.q - s.start.q)) < 1e-12
    assert np.max(np.abs(s.momenta[1] - s.momenta[0])) < 1e-10
    M = ao.monodromy(s)
    J = np.kron([[0, 1], [-1, 0]], np.eye(system.n))
    assert np.max(np.abs(M.T @ J @ M - J)) < 1e-13 * np.max(np.abs(M)) ** 2  # symplectic
    z, raw = M.eigenvalues, np.linalg.eigvals(np.asarray(M))
    assert np.max(np.abs(z[::2] * z[1::2] - 1)) < 1e-8
    # Those that are single are eigenvalues of the matrix itself.
    single = [x for x in z if np.sort(np.abs(z - x))[1] > 1e-2]
    assert len(single) >= 2 and 2 * M.trivial + len(single) <= z.size
    for x in single:
        assert np.min(np.abs(raw - x)) < 1e-8 * max(abs(x), 1.0)
    if name == "figure-eight":  # Fukuda, Fujiwara and Ozaki, arXiv:1710.04834
        assert s.between_times.morse_index == 2 and s.kind == "saddle"
        assert M.stable and M.trivial == 4


OSCILLATOR = systems.oscillator()


def test_an_end_free_in_place_and_time_is_where_the_motion_stops():
    s = ao.solve(ao.Problem(OSCILLATOR, free(0.0, [0.3]), free(None, [None]), energy=0.5))
    assert abs(s.duration - np.arccos(0.3)) < 1e-9 and abs(s.end.q[0] - 1) < 1e-9


@pytest.mark.long
def test_a_free_body_never_comes_to_rest():
    flight = systems.particle()
    with pytest.raises(ao.SolveError, match="comes to rest"):
        ao.solve(ao.Problem(flight, free(0.0, [0.3]), free(None, [None]), energy=0.5))


def test_a_dwell_at_the_top_and_a_guess_between_other_angles():
    system = systems.pendulum("a")
    for excess, end in ((1e-4, 6.0), (0.1, 4.0)):
        m = 2 / (2 + excess)
        problem = ao.Problem(system, free(0.0, [0.0]), free(None, [end]), energy=1 + excess)
        s = ao.solve(problem)
        assert abs(s.duration - ellipkinc(end / 2, m) * np.sqrt(m)) < 1e-9
    other = problem.replace(start=free(0.0, [-0.5]), end=free(None, [5.0]))
    T = (ellipkinc(2.5, m) + ellipkinc(0.25, m)) * np.sqrt(m)
    longer = ao.solve(other, guess=s)
    assert abs(longer.duration - T) < 1e-9
    back = ao.solve(problem, guess=longer)  # parts of one motion
    assert abs(back.duration - s.duration) < 1e-9
    assert max(sum(x.stats["iterations"].values()) for x in (longer, back)) <= 4


def growing_ring():
    """A charge on a ring that grows, pushed by a force that does, to where the ring meets y = x."""
    system = ao.System(
        lambda q, v, t: v @ v / 2 + q[0] * t**2,
        ["x", "y"],
        constraint=lambda q, t: q @ q - (1 + t) ** 3,
    )
    end = ao.Event(None, [None, None], on=lambda q, t: q[0] - q[1])
    guess = ao.Path.interpolate(
        lambda t: (1 + t) ** 1.5 * np.stack([np.cos(t), np.sin(t)]), ao.Mesh.uniform(0, 0.9, 3, 6)
    )
    return ao.Problem(system, ao.Event(0, [1, 0]), end), guess


@pytest.mark.quick("throw_at_energy", "pendulum_over_top", "growing_ring")
@pytest.mark.parametrize(
    "name", ["throw_at_energy", "kepler_at_energy", "pendulum_over_top", growing_ring]
)
def test_the_matrix_with_a_duration_is_the_derivative_of_the_equations(name):
    problem, path = name() if callable(name) else (scenes.get(name).problem, None)
    path = path or ao.solve(problem, guess=scenes.get(name).guess, tol=1e-3).path
    bordered, y = Bordered.around(problem, path, None, np.abs(path.values).max(axis=1))
    y = y + 0.01 * np.cos(np.arange(y.size))  # the duration as well
    step = 1e-6 * np.eye(y.size)
    columns = [(bordered.residual(y + h) - bordered.residual(y - h)) / 2e-6 for h in step]
    matrix = full(bordered.layout, bordered.kkt(y))
    assert np.abs(matrix - np.transpose(columns)).max() < 1e-9 * np.abs(matrix).max()


@pytest.mark.parametrize("energy", [0.1, 3.0])
def test_the_fastest_oscillation_needs_no_guess(energy):
    """Along y, where x is at rest, it stays harmonic: T = 2 pi / sqrt(2.6) at any energy."""
    bound = ao.System(
        lambda q, v, t: v @ v / 2 - q[0] ** 2 / 2 - 1.3 * q[1] ** 2 - (q[0] * q[1]) ** 2 / 2,
        ["x", "y"],
    )
    orbit = ao.solve(ao.Problem(bound, ao.Event(0, None), ao.Periodic(None), energy=energy))
    assert abs(orbit.duration - 2 * np.pi / np.sqrt(2.6)) < 1e-9
    assert abs(np.ptp(orbit.path.values[1]) - 2 * np.sqrt(2 * energy / 2.6)) < 1e-2 * energy**0.5


def test_an_orbit_about_the_equilibrium_between_two_bodies_needs_no_guess():
    """A saddle in one plane of phase space, a centre in the other: only that one turns."""
    bodies = ao.System(partial(restricted, mu=0.1), ["x", "y"])
    start, E = ao.Event(0, [None, 0.0]), -1.7884766149399474
    orbit = ao.solve(ao.Problem(bodies, start, ao.Periodic(None), energy=E))
    assert np.abs(orbit.energy(np.linspace(0, orbit.duration, 9)) - E).max() < 1e-6
    assert np.abs(orbit.end.q - orbit.start.q).max() < 1e-9
    assert orbit.compare().agrees and np.ptp(orbit.path.values[1]) > 0.1
    with pytest.raises(ValueError, match="nor where a stable equilibrium is near"):
        ao.solve(ao.Problem(bodies, start, ao.Periodic(None), energy=-5.0))


@pytest.mark.quick("1e-06")
@pytest.mark.parametrize("tol", [1e-3, 1e-6])
def test_a_circle_is_closed_whose_turn_is_its_motion(tol):
    """Time and the turn of the plane move a circle alike: r^2 + 3 r^4 / 4 = E, w^2 = 1 + r^2."""
    system = ao.System(lambda q, v, t: v @ v / 2 - (q @ q) / 2 - (q @ q) ** 2 / 4, ["x", "y"])
    T = 2 * np.pi / np.sqrt(1 + (np.sqrt(7) - 1) / 1.5)

    def rough(t):
        a = 2 * np.pi * t / 4.5
        return 0.9 * np.stack([np.cos(a + 0.5), np.sin(a + 0.5)]) + 0.1 * np.stack(
            [np.cos(2 * a), np.sin(2 * a)]
        )

    guess = ao.Path.interpolate(rough, ao.Mesh.uniform(0, 4.5, 8, 5))
    anywhere = ao.Problem(system, free(0.0, [None, None]), ao.Periodic(None), energy=2.0)
    s = ao.solve(anywhere, guess=guess, tol=tol)
    assert abs(s.duration / T - 1) < tol
    radius = np.sqrt((np.sqrt(7) - 1) / 1.5)
    r = np.linalg.norm(s(np.linspace(0, s.duration, 101)), axis=0)
    assert np.abs(r / radius - 1).max() < tol


def test_a_neighbour_that_passes_the_new_end_nowhere_is_a_guess_as_well():
    """Motions under no force: T = d / sqrt(2 E); one coordinate stays zero, others end far off."""
    system = systems.particle("x y")
    problem = ao.Problem(system, free(0.0, [0.0, 0.0]), free(None, [1.0, 0.0]), energy=0.5)
    s = ao.solve(problem)
    for end in ([3.0, 0.0], [0.1, 0.0], [0.5, 2.0], [-1.0, 0.0], [-0.3, 0.4]):
        near = ao.solve(problem.replace(end=free(None, end)), guess=s)
        assert abs(near.duration - np.linalg.norm(end)) < 1e-9


def sphere(start, energy=0.5):
    """Return from where to the opposite point of a unit sphere."""
    system = systems.particle("x y z", constraint=lambda q, t: q @ q - 1)
    return ao.Problem(system, free(0.0, start), free(None, -np.array(start)), energy=energy)


def is_half_of_any_great_circle(path):
    assert path.status is ao.Status.DEGENERATE
    assert path.stats["nullity"] == 1
    assert path.duration == pytest.approx(np.pi, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(
    "start",
    [
        [1.0, 0.0, 0.0],
        # The way that is found there is almost normal to the first axis.
        [0.0030339274, 0.7367971117, -0.6761071076],
    ],
)
def test_one_of_the_ways_to_the_opposite_point_is_found(start):
    start = np.array(start) / np.linalg.norm(start)
    is_half_of_any_great_circle(ao.solve(sphere(start), throw=False))


def test_a_passage_straight_to_the_end_is_of_one_energy_and_between_two_places():
    drag = ao.System(lambda q, v, t: np.exp(0.1 * t) * (v @ v - q @ q) / 2, ["x"])
    for system, end in ((systems.oscillator(), 0.3), (drag, 0.8)):
        problem = ao.Problem(system, ao.Event(0.0, [0.3]), ao.Event(None, [end]), energy=1.0)
        assert straight_passage(problem) is None
    problem = ao.Problem(systems.oscillator(), problem.start, ao.Event(None, [0.8]), energy=1.0)
    times, *_ = straight_passage(problem)  # x = sqrt(2) sin t
    assert times[-1] == pytest.approx(np.arcsin(0.8 / 2**0.5) - np.arcsin(0.3 / 2**0.5), rel=1e-4)


def test_time_that_is_up_before_there_is_a_start_is_told(monkeypatch):
    def starts(*_):
        raise OutOfTime
        yield

    monkeypatch.setattr("actionopt.solver.pursue.starts", starts)
    problem = ao.Problem(
        systems.oscillator(), ao.Event(0.0, [0.3]), ao.Event(None, [0.8]), energy=1.0
    )
    found = ao.solve(problem, throw=False)
    assert found.status is ao.Status.OUT_OF_TIME


@pytest.mark.long
def test_a_guess_is_not_resolved_on_meshes_that_are_too_large_to_be_kept():
    """Corners at tol 1e-11 take thousands of elements, and the time that was given."""
    system = ao.System(lambda q, v, t: v @ v / 2 - q @ q / 2, ["x", "y"])
    problem = ao.Problem(system, ao.Event(0.0, None), ao.Periodic(6.3))
    jagged = [np.cos(np.arange(400)), np.sin(7.0 * np.arange(400))]
    small = guess_path(problem, jagged, 1e-11, most=60)
    assert 60 < small.mesh.offsets[-1] < 2000 < guess_path(problem, jagged, 1e-11).mesh.offsets[-1]


def verdict(*judged, held=()):
    """Return the verdict, where paths are held along a family or not, in turn."""
    answers, holds = iter(judged), iter(held)
    at = SimpleNamespace(here="first", along=("x",), settle=lambda: None)
    at.judge = lambda settled: next(answers)
    at._hold_along = lambda: next(holds)
    return Unfixed.verdict(at), at.along


def test_a_path_of_a_family_is_held_where_that_helps():
    S = ao.Status
    assert verdict(S.SOLVED, held=[True]) == (S.SOLVED, ("x",))
    assert verdict(S.NOT_FOUND, S.SOLVED, held=[True]) == (S.SOLVED, ())
    assert verdict(S.SOLVED, held=[False, False]) == (S.SOLVED, ("x",))
    assert verdict(S.NOT_FOUND, S.SOLVED, held=[False, True]) == (S.SOLVED, ("x",))
    assert verdict(S.UNRESOLVED, S.NOT_FOUND, held=[False, True]) == (S.UNRESOLVED, ())


def test_what_newtons_method_brings_to_zero_has_a_unit():
    """The index is in units of the path: those of a leftover of 1e-11 made it 83."""
    sphere = ao.System(
        lambda q, v, t: v @ v / 2, ["x", "y", "z"], constraint=lambda q, t: (q @ q - 1) / 2
    )
    ends = ao.Event(0, [1.0, 0, 0]), ao.Event(None, [0, 1.0, 0])
    mesh = ao.Mesh.uniform(0, 3 * np.pi / 2, 8, 8)
    t = mesh.nodes
    z = 0.3 * np.sin(2 * t / 3) * (1 + 0.3 * np.sin(2 * t))
    near = np.stack([np.cos(t) * np.sqrt(1 - z**2), -np.sin(t) * np.sqrt(1 - z**2), z])
    found = ao.solve(ao.Problem(sphere, *ends, energy=0.5), guess=ao.Path(mesh, near))
    assert found.action == pytest.approx(3 * np.pi / 4) and found.morse_index == 1
    np.testing.assert_allclose(found.discrete.tr.lengths, 1)


@pytest.mark.long
def test_a_force_of_nearly_nothing_turns_no_motion():
    """A thin wall with a gap: its force at the start is 1e-220, which asked for times of 1e223."""

    def law(q, v, t):
        gap = 1.27 * np.exp(-(((q[1] - 0.6025) / 0.25) ** 2))
        return v @ v / 2 - (1.4736 - gap) * np.exp(-((q[0] / 0.04398) ** 2))

    ends = ao.Event(0, [-1.0, 0.0]), ao.Event(None, [1.0, 0.2])
    problem = ao.Problem(ao.System(law, ["x", "y"]), *ends, energy=0.9997)
    assert ao.solve(problem, throw=False).status in ao.Status  # it is not found, in words
