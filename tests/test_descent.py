"""Descending to a least path: S falls at every step, and what there is at the end is told."""

from itertools import count

import numpy as np
import pytest
import systems
from helpers import at_once, transcribed

from actionopt import Event, Periodic, Problem, System, solve
from actionopt.discrete.matrices.factors import Factors
from actionopt.discrete.newton.newton import follow
from actionopt.solver.refinement import descent
from actionopt.solver.refinement.descent import RUNAWAY, descend, loose_constants, way_down

SPRING = systems.spring(stiffening=0.01)
PENDULUM = systems.pendulum(g=9.81)


def test_a_start_that_is_the_minimum_already_is_found():
    tr = transcribed(PENDULUM, ([0.3], [-0.2]), 0.6)
    least = follow(tr, tr.pack(tr.straight())).z
    result = descend(tr, least)
    assert result.found and not result.runaway
    assert result.iterations == 1
    assert np.max(np.abs(result.z - least)) <= 1e-12


def test_a_start_that_is_a_saddle_is_not_found():
    """Past the conjugate time the path at rest is stationary, and no minimum."""
    tr = transcribed(PENDULUM, ([0.0], [0.0]), 1.3)
    result = descend(tr, tr.pack(tr.straight()))
    assert not result.found and not result.runaway


@at_once("T", [0.6, 0.9])
@at_once("size", [0.5, 3.0, 20.0])
def test_the_minimum_is_found_from_afar(T, size):
    """Before the conjugate time, pi / sqrt(9.81) = 1.003, the pendulum's action is convex."""
    tr = transcribed(PENDULUM, ([0.3], [-0.2]), T)
    least = follow(tr, tr.pack(tr.straight()))
    assert least.converged
    bump = size * np.sin(np.pi * tr.mesh.nodes / T)[:, None]
    for side in (1, -1):
        start = tr.pack(tr.straight() + side * bump)
        result = descend(tr, start)
        assert result.found and not result.runaway
        assert tr.action(result.z) < tr.action(start)
        found = follow(tr, result.z)  # Newton's method contracts there
        assert found.converged
        assert np.max(np.abs(found.z - least.z)) <= 1e-11


@pytest.mark.long
def test_stiff_variations_do_not_slow_down_the_others():
    """Swings of twelve links ask for a mu of ten: steps without the factor 1 + mu are 17."""
    first = np.linspace(0.05, 0.15, 12)
    tr = transcribed(systems.links(12), (first, -first / 2), 0.5)
    result = descend(tr, tr.pack(tr.straight()))
    assert result.found and result.iterations <= 14


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_an_action_without_a_lowest_value_runs_away(side):
    """Past the conjugate time a stiffening spring's S falls with the fourth power of its size."""
    tr = transcribed(SPRING, ([0.1 * side], [0.2 * side]), 7.5)
    result = descend(tr, tr.pack(tr.straight()))
    assert not result.found and result.runaway
    assert np.max(np.abs(result.z)) < RUNAWAY  # S falls from there on, which takes no descent
    way = tr.pack(tr.straight()) + np.outer([0, 1, 8, 64], result.z - tr.pack(tr.straight()))
    assert (np.diff([tr.action(z) for z in way]) < 0).all()


def test_shifts_below_the_curvature_along_the_last_step_are_not_factorized(monkeypatch):
    """Down an abyss two shifts a step fail and one serves: the first tells the other."""
    tr, tried = transcribed(SPRING, ([0.1], [0.2]), 7.5), []

    def definite(self):
        tried.append(known(self))
        return tried[-1]

    known = Factors.definite
    monkeypatch.setattr(Factors, "definite", definite)
    monkeypatch.setattr(descent, "_falls", lambda *_: False)  # it goes all the way down
    assert descend(tr, tr.pack(tr.straight())).runaway
    assert len(tried) <= 2.8 * sum(tried)


def test_the_first_shift_is_sought_from_the_curvature_along_the_steepest_descent(monkeypatch):
    """A long swing asks for a mu of one; shifts from a hundredth on, each times three, fail."""
    tr, tried = transcribed(systems.pendulum(g=98.1), ([1.0], [2.0]), 1.5), []

    def definite(self):
        tried.append(known(self))
        return tried[-1]

    known = Factors.definite
    monkeypatch.setattr(Factors, "definite", definite)
    descend(tr, tr.pack(tr.straight()))
    assert tried[:2] == [False, True] and tried.index(True, 2) <= 3  # the second is K alone


@pytest.mark.parametrize("T", [0.6, 0.9])
def test_after_a_whole_step_newtons_own_is_tried(T):
    """Round the sun shifts fall from ten, and eight steps would be taken with one after another."""
    tr = transcribed(systems.kepler(), ([1.0, 0.0], [-0.9, 0.1]), T)
    result = descend(tr, tr.pack(tr.straight()))
    assert result.found and result.iterations <= 6


def test_a_mass_that_is_not_positive_has_no_lowest_action():
    light = System(lambda q, v, t: -(v[0] ** 2) / 2 - q[0] ** 2 / 2, ["x"])
    tr = transcribed(light, ([1.0], [0.5]), 1.0)
    result = descend(tr, tr.pack(tr.straight()))
    assert not result.found and not result.runaway and result.iterations == 0


def test_values_that_are_not_finite_end_it():
    kepler = systems.kepler()
    tr = transcribed(kepler, ([-1.0, 0.0], [1.0, 0.0]), 1.0)
    result = descend(tr, tr.pack(tr.straight()))  # through the centre
    assert not result.found and not result.runaway and result.iterations == 0


class Told:
    """A transcription whose action at the first trial fell by `share` of what the slope promises.

    The gradient is asked for at steps that were taken: at the first it is `left` of what it was.
    """

    def __init__(self, tr, share=None, left=None):
        self.tr, self.share, self.left, self.trials, self.taken = tr, share, left, [], []

    def __getattr__(self, name):
        return getattr(self.tr, name)

    def gradient(self, z):
        self.taken.append(z)
        if len(self.taken) != 2 or self.left is None:
            return self.tr.gradient(z)
        return self.left * self.tr.gradient(self.taken[0])

    def action(self, z):
        self.trials.append(z)
        if len(self.trials) != 2 or self.share is None:
            return self.tr.action(z)
        start = self.trials[0]
        return self.tr.action(start) + self.share * float(self.tr.gradient(start) @ (z - start))


@pytest.mark.parametrize(("share", "enough"), [(-0.005, False), (0.005, False), (0.02, True)])
def test_a_step_must_bring_a_hundredth_of_what_the_slope_promises(share, enough):
    tr = transcribed(PENDULUM, ([0.3], [-0.2]), 0.6)
    bump = 0.3 * np.sin(np.pi * tr.mesh.nodes / 0.6)[:, None]
    told = Told(tr, share)
    descend(told, tr.pack(tr.straight() + bump))
    assert np.array_equal(told.taken[1], told.trials[1]) == enough


@pytest.mark.parametrize(("left", "near"), [(0.45, True), (0.55, False), (-0.55, False)])
def test_a_path_is_near_where_the_next_step_is_less_than_half_as_long(left, near):
    """With the same Hessian a gradient of `left` of what it was leads on by `left` of the step."""
    tr = transcribed(PENDULUM, ([0.3], [-0.2]), 0.6)
    bump = 0.3 * np.sin(np.pi * tr.mesh.nodes / 0.6)[:, None]
    result = descend(Told(tr, left=left), tr.pack(tr.straight() + bump))
    assert (result.found and result.iterations == 1) == near


def test_an_action_that_never_falls_is_no_runaway():
    tr = transcribed(PENDULUM, ([0.3], [-0.2]), 0.6)
    told, heights = Told(tr), count()
    told.action = lambda z: float(next(heights))
    bump = 0.3 * np.sin(np.pi * tr.mesh.nodes / 0.6)[:, None]
    result = descend(told, tr.pack(tr.straight() + bump))
    assert not result.found and not result.runaway and len(told.taken) == 1


def test_an_action_that_falls_faster_than_any_metric_holds_runs_away():
    system = System(lambda q, v, t: v @ v / 2 - 100 * (q @ q) ** 2, ["x"])
    tr = transcribed(system, ([1.0], [1.0]), 1.0)
    result = descend(tr, tr.pack(tr.straight()))
    assert not result.found and result.runaway
    away = np.max(np.abs(result.z))
    assert away < RUNAWAY  # it is told from farther away than the descent went


def test_it_is_seen_from_a_saddle_whether_the_action_is_bounded_below():
    """S of a stiffening spring is unbounded below; that of a pendulum is at least -9.81 T."""
    for system, unbounded in ((SPRING, True), (PENDULUM, False)):
        tr = transcribed(system, ([0.0], [0.0]), 4.0)
        saddle = tr.pack(tr.straight())
        assert np.abs(tr.gradient(saddle)).max() == 0.0
        assert not Factors(tr.layout, tr.kkt(saddle)).definite()
        assert (way_down(tr, saddle, loose_constants(tr)) is not None) == unbounded


def test_a_variation_along_which_the_action_bends_down_spares_shifts(monkeypatch):
    """The same steps, with the same shifts: those are left out that would not have served."""
    tr = transcribed(SPRING, ([0.0], [0.0]), 4.0)
    saddle = tr.pack(tr.straight())
    down = way_down(tr, saddle, loose_constants(tr))
    assert down is not None
    aside = 0.3 * np.sin(2 * np.pi * tr.mesh.nodes / 4.0)[:, None]  # which the gradient keeps to
    asked, definite = [0], Factors.definite
    monkeypatch.setattr(Factors, "definite", lambda f: asked.append(1) or definite(f))
    ends, counts = [], []
    for along in (None, down):
        asked.clear()
        ends.append(descend(tr, tr.pack(tr.straight() + aside), 32.0, 2.0, along))
        counts.append(len(asked))
    assert ends[0].runaway and ends[1].runaway and ends[0].iterations == ends[1].iterations
    assert np.array_equal(ends[0].z, ends[1].z) and counts[1] < counts[0]


def test_closed_paths_that_are_saddles_are_found_without_a_search_for_least_ones():
    """The answer of a stiff spring to a small swift force: near -a cos(w t) / (w^2 - 1)."""
    spring = systems.spring(stiffening=1.0, push=lambda t: 0.01 * np.cos(7 * t))
    end = Periodic(2 * np.pi / 7)
    solution = solve(Problem(spring, Event(0.0, [None]), end))
    assert "ipopt" not in solution.stats["iterations"]
    assert solution.morse_index == 1
    t = np.linspace(0.0, 0.8, 9)
    assert np.abs(solution(t)[0] + 0.01 * np.cos(7 * t) / 48).max() < 1e-9


def test_a_least_path_beside_an_abyss_is_not_passed_over():
    """From a saddle S falls without bound towards a charge; near a hill of V a path is least."""
    charge, hill = np.array([-0.2, 0.1, -1.2, -1.5]), np.array([-0.3, 0.9, 0.4, 1.1])

    def lagrangian(q, v, t):
        away, off = q - charge, q - hill
        V = np.array([1.2, 1.8, 3.6, 3.7]) @ q**2 / 2 + 10.8 * np.exp(-(off @ off) / 2)
        return v @ v / 2 - V - 2.8 / np.sqrt(away @ away + 1e-6)

    ends = Event(0.0, [0.1, -0.2, -0.5, 0.5]), Event(1.9, [0.7, 0.0, 0.4, 0.0])
    found = solve(Problem(System(lagrangian, ["w", "x", "y", "z"]), *ends), tol=1e-6)
    assert found.morse_index == 0 and found.compare().agrees
