"""Features far narrower than the elements of a path: seen at any tolerance, and resolved."""

import math

import numpy as np
import pytest
import systems
from helpers import a_quarter, at_once
from scipy.optimize import brentq

import actionopt as ao
from actionopt import scenes
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.tools.lobatto import lgl
from benchmarks.stress.families.pulses import FWHM, closed_form, kicked, places
from benchmarks.stress.families.pulses import systems as systems_of_pulses

CENTRES = places(6)
SYSTEMS = systems_of_pulses()


@pytest.mark.long
@pytest.mark.parametrize(
    ("width", "tol"),
    a_quarter([(0.001, 1e-3), (0.001, 1e-6), (0.0033, 1e-3), (0.001, 1e-10), (0.002, 1e-8)]),
)
def test_a_pulse_of_a_thousandth_is_not_missed(width, tol):
    t = np.linspace(0, 1, 4001)
    for c in CENTRES:
        solution = ao.solve(kicked("free body", c, width / FWHM), tol=tol)
        exact = closed_form(c, width / FWHM)(t)
        assert np.max(np.abs(solution(t) - exact)) / np.max(np.abs(exact)) <= solution.error


@pytest.mark.long
@pytest.mark.parametrize(("width", "tol"), [(1e-4, 1e-9), (1e-6, 1e-3)])
def test_a_pulse_narrower_than_all_samples_is_found_by_its_exponent(width, tol):
    t, c = np.linspace(0, 1, 4001), 0.38197
    solution = ao.solve(kicked("free body", c, width), tol=tol)
    exact = closed_form(c, width)(t)
    assert np.max(np.abs(solution(t) - exact)) / np.max(np.abs(exact)) <= max(tol, solution.error)


W = 1e-5
HIDDEN = {  # forces of the time, and their integrals
    "gaussian": (lambda t: np.exp(-(((t - 0.7) / W) ** 2)) / (W * np.sqrt(np.pi)), 1.0),
    "hyperbolic": (lambda t: 1 / (W * np.cosh((t - 0.7) / W) ** 2), 2.0),
    "tail": (lambda t: (1 + ((t - 0.7) / W) ** 2) ** -1.5 / W, 2.0),
    "flat": (lambda t: np.exp(-(((t - 0.7) / W) ** 4)) / W, 2 * math.gamma(1.25)),
    "power": (lambda t: 2.0 ** -(((t - 0.7) / W) ** 2) / W, np.sqrt(np.pi / np.log(2))),
    "train": (lambda t: np.exp(-((np.sin(3 * np.pi * t) / W) ** 2)) / W, 2 / (3 * np.sqrt(np.pi))),
}


@pytest.mark.quick("power")
@pytest.mark.parametrize("form", HIDDEN)
def test_what_is_hidden_between_samples_changes_the_momentum(form):
    force, impulse = HIDDEN[form]
    system = ao.System(lambda q, v, t: v[0] ** 2 / 2 + force(t) * q[0], ["x"])
    t0, t1 = 0.05, 0.95
    solution = ao.solve(ao.Problem(system, ao.Event(t0, [0.0]), ao.Event(t1, [1.0])), tol=1e-6)
    change = solution.velocity(t1)[0] - solution.velocity(t0)[0]
    assert change == pytest.approx(impulse, rel=1e-4)


@pytest.mark.quick("17.0-5.0")
@pytest.mark.parametrize(("T", "c"), [(7.0, 2.0), (17.0, 5.0), (1.0, 0.0), (1.0, 1.0)])
def test_a_pulse_on_a_sample_or_at_an_end_is_found(T, c):
    """Its slope is zero there; of one at an end half is on the way."""
    width, part = 1e-5, 0.5 if c in (0.0, T) else 1.0
    system = ao.System(
        lambda q, v, t: v[0] ** 2 / 2 + np.exp(-(((t - c) / width) ** 2)) / width * q[0], ["x"]
    )
    problem = ao.Problem(system, ao.Event(0.0, [0.0]), ao.Event(T, [1.0]))
    solution = ao.solve(problem, tol=1e-8)
    impulse = part * np.sqrt(np.pi)
    begun = (1 - impulse * (T - c)) / T  # before it; `after` where it begins with it
    after = begun + (impulse if c == 0 else 0.0)
    before = 0.5 * c if c else 0.01
    wanted = (begun if c else after) * before
    assert solution(before)[0] == pytest.approx(wanted, abs=1e-5)


def test_a_hidden_step_and_a_hidden_kick_of_a_beam():
    """By closed forms: of a body that is pushed from 0.3 on, and of a beam with a force at 0.7."""
    step = ao.System(lambda q, v, t: v[0] ** 2 / 2 + q[0] / (1 + np.exp(-(t - 0.3) / 1e-6)), ["x"])
    ends = ao.Event(0.0, [0.0]), ao.Event(1.0, [1.0])
    solution = ao.solve(ao.Problem(step, *ends), tol=1e-9)
    assert solution.start.v == pytest.approx([1 - 0.7**2 / 2], abs=1e-9)
    low, middle, high = (after for _, after in solution.problem.boundaries)  # it and its feet
    assert middle == pytest.approx(0.3)
    assert 0.3 - low == pytest.approx(high - 0.3) == pytest.approx(8e-6, rel=0.1)
    force, _ = HIDDEN["gaussian"]
    beam = ao.System(lambda q, v, a, t: a[0] ** 2 / 2 + 3 * force(t) * q[0], ["x"])
    solution = ao.solve(ao.Problem(beam, *ends), tol=1e-3)
    slope = 1 - 3 * 0.3 / 6 + 3 * 0.3**3 / 6  # the shear jumps by 3 at 0.7, no moment at the ends
    assert solution.start.v == pytest.approx([slope], abs=1e-3)


@pytest.mark.long
@pytest.mark.parametrize(("c", "kick"), [(0.7690455418668206, 3.0), (0.7755937979243391, 0.3)])
def test_a_kick_of_a_beam_is_summed_to_the_tolerance(c, kick):
    """By the closed form of a point load: its elements are as stiff as 1e15 of the beam.

    Away from the kick all that its width adds is the second moment, pi^2 w^2 / 12.
    """
    w = 1e-5
    beam = ao.System(
        lambda q, v, a, t: a[0] ** 2 / 2 + kick / (2 * w * np.cosh((t - c) / w) ** 2) * q[0], ["x"]
    )
    solution = ao.solve(ao.Problem(beam, ao.Event(0.0, [0.0]), ao.Event(1.0, [1.0])), tol=1e-9)

    def bent(u):
        return np.where(u > 0, u**3 + (np.pi * w) ** 2 / 4 * u, 0.0) * kick / 6

    t = np.linspace(0, 1, 401)
    third = kick * (1 - c) / 6
    exact = (1 - third + bent(1 - c)) * t + third * t**3 - bent(t - c)
    assert np.max(np.abs(solution(t)[0] - exact)) / np.max(np.abs(exact)) < 1e-9


def test_what_is_wide_needs_no_boundary():
    wide = [
        lambda t: np.exp(-((t - 0.3) ** 2) / 0.01**2),
        lambda t: np.exp(-3 * t) + np.tanh(30 * (t - 0.4)),
        lambda t: 1 / (1 + (t - 0.5) ** 2) + np.sqrt(1 + 100 * t**2),
    ]
    for force in wide:
        system = ao.System(lambda q, v, t, force=force: v[0] ** 2 / 2 + force(t) * q[0], ["x"])
        problem = ao.Problem(system, ao.Event(0.0, [0.0]), ao.Event(1.0, [1.0]))
        assert problem.boundaries == ()


@pytest.mark.long
@pytest.mark.parametrize("tol", a_quarter([1e-9, 1e-3]))
def test_a_pulse_on_a_pendulum_changes_its_momentum_by_one(tol):
    w = 0.001 / FWHM
    for c in CENTRES:
        solution = ao.solve(kicked("pendulum", c, w), tol=tol)
        before, after = c - 6 * w, c + 6 * w
        gravity = -9.81 * np.sin(solution(c)[0]) * 12 * w
        change = solution.velocity(after)[0] - solution.velocity(before)[0]
        assert change == pytest.approx(1.0 + gravity, abs=1e-2)


def test_a_pulse_is_cut_out_at_once():
    """The parts are about as wide as what hides in them, not halves of halves."""
    w = 0.001 / FWHM
    problem = kicked("free body", 0.613, w)
    tr = Transcription(problem, Mesh.uniform(0.0, 1.0, 4, 12), problem.lengths)
    cuts = tr.cuts(tr.pack(tr.straight()))
    assert [part.size for part in cuts] == [0, 0, 2, 0]
    assert 0.61 - 0.02 < cuts[2][0] < 0.613 - w
    assert 0.613 + w < cuts[2][1] < 0.613 + 0.02


@pytest.mark.long
def test_a_step_inside_an_element_takes_the_momentum_that_it_must():
    """The sums over a coarse element agree by chance with those of a path that loses too little."""
    c, w, height, tol = 0.7760217882743019, 1e-3, 0.3, 1e-3
    system = ao.System(
        lambda q, v, t: v[0] ** 2 / 2 - height * (1 + np.tanh((q[0] - c) / w)) / 2, ["x"]
    )
    solution = ao.solve(ao.Problem(system, ao.Event(0.0, [0.0]), ao.Event(1.0, [1.0])), tol=tol)
    # Uniform but for the step, whose place is known to a part of w.
    before = brentq(lambda v: c / v + (1 - c) / math.sqrt(v**2 - 2 * height) - 1, 1.0, 2.0)
    t = np.linspace(0, 0.7, 501)
    assert np.max(np.abs(solution(t)[0] - before * t)) < tol


def test_a_given_mesh_that_misses_a_pulse_has_the_error_of_it():
    w = 0.001 / FWHM
    solution = ao.solve(kicked("free body", 0.613, w), mesh=Mesh.uniform(0.0, 1.0, 4, 8))
    t = np.linspace(0, 1, 4001)
    exact = closed_form(0.613, w)(t)
    true = np.max(np.abs(solution(t) - exact)) / np.max(np.abs(exact))
    assert true > 0.1
    assert solution.error >= true


@pytest.mark.long
def test_what_a_lagrangian_may_hide_is_read_off_it():
    samples = {name: scenes.get(name).problem.system.structure.samples for name in scenes.SCENES}
    assert samples["pendulum"] == samples["double_pendulum"] == samples["rod_pendulum"] == 0
    assert samples["kepler"] == samples["driven_oscillator"] == 400
    assert {system.structure.samples for system in SYSTEMS.values()} == {2500}
    kinked = ao.System(lambda q, v, t: v[0] ** 2 / 2 - np.where(q[0] > 0, q[0], 0.0), ["x"])
    assert kinked.structure.samples == 2500
    divided = ao.System(lambda q, v, t: v[0] ** 2 / 2 + q[0] / (1.01 + np.cos(t)), ["x"])
    assert divided.structure.samples == 2500


@at_once("degree", [1, 6, 24])
@at_once("panels", [2, 3, 64])
def test_dense_points_integrate_and_leave_no_gap(degree, panels):
    rule = lgl(degree)
    dense = rule.dense(panels)
    values = np.random.default_rng(degree).normal(size=degree + 1)
    x, w = np.polynomial.legendre.leggauss(degree + 2)
    phi = rule.interpolation(x)
    exact = phi.T @ (w * (phi @ rule.derivative @ values))
    assert np.allclose(dense.weighted_values @ (dense.slopes @ values), exact, atol=1e-9)
    gaps = np.diff(np.r_[-1.0, dense.nodes, 1.0])
    assert gaps.max() <= 2 / panels * (np.pi / 2) / rule.panel


@pytest.mark.parametrize("rule", [lgl(5).other, lgl(5).same, lgl(6).dense(3)])
def test_integrals_up_to_each_point(rule):
    powers = np.stack([rule.nodes**k for k in (0, 1, 4)], axis=1)
    k = np.array([1, 2, 5])
    inside, whole = rule.integrals(np.stack([powers, 2 * powers]))
    exact = (rule.nodes[:, None] ** k - (-1.0) ** k) / k
    assert np.allclose(inside, [exact, 2 * exact], atol=1e-14)
    assert np.allclose(whole, [(1 - (-1.0) ** k) / k, 2 * (1 - (-1.0) ** k) / k], atol=1e-14)


def window(t, c, w):
    """Return a window of unit area about t = c, of width w."""
    return np.where((t > c - w / 2) & (t < c + w / 2), 1.0, 0.0) / w


# With no boundary at the window two sums across it agree by chance for c = 0.7 and 1e-6.
@pytest.mark.long
@pytest.mark.parametrize("tol", [1e-3, 1e-6, 1e-9])
@pytest.mark.parametrize("c", [0.5154, 0.7])
def test_a_window_is_a_kick_in_a_force_as_in_a_lagrangian(c, tol):
    w, kick = 0.003, 2.0
    forced = systems.particle(force=lambda q, v, t: [kick * window(t, c, w)])
    lagrangian = ao.System(lambda q, v, t: v[0] ** 2 / 2 + kick * window(t, c, w) * q[0], ["x"])
    t = np.linspace(0, 1, 4001)

    def twice(t):  # the window integrated twice
        inside = np.clip(t, c - w / 2, c + w / 2) - (c - w / 2)
        return kick * (inside**2 / (2 * w) + np.maximum(t - c - w / 2, 0.0))

    exact = t + twice(t) - twice(1.0) * t
    for system in (forced, lagrangian):
        problem = ao.Problem(system, ao.Event(0.0, [0.0]), ao.Event(1.0, [1.0]))
        solution = ao.solve(problem, tol=tol)
        assert solution.stats["rung"] == "linear"  # a branch in t alone leaves it so
        error = np.max(np.abs(solution(t)[0] - exact)) / np.max(np.abs(exact))
        assert error <= min(tol, solution.error + 1e-13)  # the round-off of the formula
        assert solution.mesh.elements <= 7


def test_a_kick_may_move_a_forced_path_far_when_it_is_seen():
    c, w, kick = 0.5154, 0.003, 2.0
    system = systems.pendulum("x", g=9.81, force=lambda q, v, t: [kick * window(t, c, w)])
    solution = ao.solve(ao.Problem(system, ao.Event(0.0, [0.0]), ao.Event(1.0, [1.0])), tol=1e-8)
    before, after = c - w, c + w
    change = solution.velocity(after)[0] - solution.velocity(before)[0]
    gravity = -9.81 * np.sin(solution(c)[0]) * 2 * w
    assert change == pytest.approx(kick + gravity, abs=1e-3)


@pytest.mark.long
def test_members_of_a_sweep_whose_pulse_gets_narrower_see_it():
    """Of the first member the pulse is wide, and no element has to end there."""
    c, widths = 0.4123, np.geomspace(1e-1, 1e-6, 6)[1:]
    system = ao.System(
        lambda q, v, t, *, w: (
            v[0] ** 2 / 2 - q[0] ** 2 / 2 + q[0] * 0.3 / w * np.exp(-(((t - c) / w) ** 2))
        ),
        ["x"],
        parameters={"w": 0.1},
    )
    problem = ao.Problem(system, ao.Event(0.0, [0.0]), ao.Event(1.0, [0.5]))
    runs = ao.sweep(problem, {"w": widths})
    assert not runs.failed.any()
    # x = p sin t + the convolution of the pulse with sin, whose Fourier transform is a Gaussian
    kick = 0.3 * np.sqrt(np.pi) * np.exp(-(widths**2) / 4)
    exact = (0.5 - kick * np.sin(1 - c)) / np.sin(1)
    assert np.max(np.abs(runs.momenta[:, 0, 0] - exact)) < 1e-8


@pytest.mark.long
@pytest.mark.parametrize(
    ("centre", "width", "size"), [(0.7, 3e-4, 1.0), (0.70008991, 1.09e-5, 6.1)]
)
def test_a_pulse_beside_an_event_whose_time_is_to_be_found(centre, width, size):
    """A free body bends at a gate half way: S is that of two straight lines, and the pulse's."""

    def lagrangian(q, v, t):
        return v @ v / 2 + size * np.exp(-(((t - centre) / width) ** 2))

    lengths = np.hypot(0.3, 0.4) + np.hypot(0.7, 0.4)
    problem = ao.Problem(
        ao.System(lagrangian, ["x", "y"]),
        ao.Event(0.0, [0.0, 0.0]),
        ao.Event(1.4, [1.0, 0.0]),
        through=[ao.Event(None, [0.3, 0.4])],
    )
    solution = ao.solve(problem)
    exact = lengths**2 / (2 * 1.4) + size * width * np.sqrt(np.pi)
    assert solution.action == pytest.approx(exact, rel=1e-8)
