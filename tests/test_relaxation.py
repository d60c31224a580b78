"""Relaxation of a path, against eigenvalues known in closed form."""

from functools import cache

import helpers
import numpy as np
import pytest
from helpers import at_once, same_bits

import actionopt as ao
from actionopt import plot
from actionopt.plot import _relaxation as figures
from actionopt.plot import relaxation_data
from actionopt.plot.data.relaxation import FIRST_SHARE, MEMORY

T = {"minimum": 2.5, "saddle": 4.0}  # the first focus of the oscillator is at pi


def solved(name):
    if name in T:
        return helpers.solved("oscillator", duration=T[name], tol=1e-11)
    return helpers.solved(name)


@cache
def relaxed(name, method="descent"):
    return relaxation_data(solved(name), method=method)


def bent(solution, wave, size=0.7):
    """Return the path with a sine of so many half waves on it."""
    duration = solution.problem.duration
    return lambda t: solution(t) + size * np.sin(np.pi * wave * t / duration)


@at_once("kind", T)
@at_once("wave", [1, 2, 5])
def test_a_sine_shrinks_or_grows_as_its_eigenvalue_says(kind, wave):
    """S on eta = sin: int (eta'^2 - eta^2); the metric's: int (eta'^2 + eta^2 / tau^2)."""
    solution, duration = solved(kind), T[kind]
    k = np.pi * wave / duration
    left = {
        "descent": 1 - FIRST_SHARE * (k**2 - 1) / (k**2 + (MEMORY * duration) ** -2),
        "newton": 1 - FIRST_SHARE,
    }
    for method, expected in left.items():
        data = relaxation_data(solution, bent(solution, wave), method=method, steps=1)
        first, second = data.paths - data.target
        assert np.max(np.abs(first - 0.7 * np.sin(k * data.t))) < 1e-9
        assert np.max(np.abs(second - expected * first)) < 1e-9
        assert data.residual == pytest.approx([1, abs(expected)], abs=1e-6)
        assert data.distance[1] == pytest.approx(expected * data.distance[0])
    assert (left["descent"] > 1) == (kind == "saddle" and wave == 1)


def test_the_action_and_its_parts_along_a_known_path():
    """x = x0 (1 - s) + x1 s + a sin(pi s), s = t / T: T and V by hand."""
    solution, duration, a = solved("minimum"), T["minimum"], 0.4
    x0, x1 = (float(e.q[0]) for e in (solution.problem.start, solution.problem.end))

    def start(t):
        s = t / duration
        return x0 * (1 - s) + x1 * s + a * np.sin(np.pi * s)

    data = relaxation_data(solution, start, steps=3)
    kinetic = ((x1 - x0) ** 2 + a**2 * np.pi**2 / 2) / duration / 2
    line = (x0**2 + x0 * x1 + x1**2) / 3
    potential = duration / 2 * (line + 2 * a * (x0 + x1) / np.pi + a**2 / 2)
    assert data.kinetic[0] == pytest.approx(kinetic, rel=1e-10)
    assert data.potential[0] == pytest.approx(potential, rel=1e-10)
    assert data.action == pytest.approx(data.kinetic - data.potential, rel=1e-12)
    assert data.target_action == pytest.approx(solution.action, rel=1e-9)


@pytest.mark.long
@pytest.mark.parametrize(
    "name", ["minimum", pytest.param("projectile", marks=pytest.mark.slow), "pendulum"]
)
def test_descent_reaches_a_minimum(name):
    solution, data = solved(name), relaxed(name)
    assert data.arrived
    assert np.all(np.diff(data.action) < 0)
    assert data.action[-1] == pytest.approx(solution.action, abs=1e-6)
    assert data.residual[0] == 1 and data.residual[-1] < 1e-4
    assert np.max(np.abs(data.paths[:, :, [0, -1]] - data.target[:, [0, -1]])) < 1e-12
    assert np.max(np.abs(data.target - solution(data.t))) < 1e-7


@pytest.mark.long
def test_descent_leaves_a_saddle_below_and_newton_does_not():
    solution = solved("saddle")
    assert solution.kind == "saddle"
    down = relaxed("saddle")
    assert np.all(np.diff(down.action) < 0)
    assert down.action[0] > solution.action > down.action[-1] + 1
    assert not down.arrived and down.distance[-1] > 3
    assert figures.verdict(down, "saddle") == "descent leaves the saddle below"
    assert len(down.action) < 60  # and it is not followed for ever
    there = relaxed("saddle", "newton")
    assert there.arrived and there.residual[-1] < 1e-6
    assert there.action[-1] == pytest.approx(solution.action, abs=1e-8)


def hill(stiff, force, start, end):
    """Return the path of x'' = stiff x - force cos 1.5 t, always a minimum."""
    system = ao.System(
        lambda q, v, t: v[0] ** 2 / 2 + stiff * q[0] ** 2 / 2 - force * q[0] * np.cos(1.5 * t),
        ["x"],
    )
    return ao.solve(ao.Problem(system, start, end), tol=1e-11)


@pytest.mark.long
@pytest.mark.parametrize("wave", [0, 2])
def test_a_path_that_closes(wave):
    """x = cos(wt) / (1 + w^2), and on it waves of whole periods, each an eigenfunction."""
    period = 2 * np.pi / 1.5
    solution = hill(1.0, 1.0, ao.Event(0.0, [None]), ao.Periodic(period))
    k = 1.5 * wave
    data = relaxation_data(solution, lambda t: solution(t) + 0.3 * np.cos(k * t))
    assert data.arrived
    assert np.max(np.abs(data.target[0] - np.cos(1.5 * data.t) / 3.25)) < 1e-9
    left = 1 - FIRST_SHARE * (k**2 + 1) / (k**2 + (MEMORY * period) ** -2)
    first, second = (data.paths - data.target)[:2, 0]
    assert np.max(np.abs(second - left * first)) < 1e-9
    assert data.residual[1] == pytest.approx(left, abs=1e-6)


@pytest.mark.long
def test_descent_goes_down_where_whole_steps_would_not():
    """Of a steep hill's second variation, 12 times the metric, a step may take a sixth."""
    data = relaxation_data(hill(100.0, 0.0, ao.Event(0.0, [1.0]), ao.Event(2.0, [0.5])))
    assert data.arrived
    assert np.all(np.diff(data.action) < 0)


@pytest.mark.long
def test_the_start_is_the_same_always():
    first, again = (relaxation_data(solved("projectile"), steps=1) for _ in range(2))
    same_bits(first.paths, again.paths, because="the seed is fixed")
    assert first.distance[0] > 0.5


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("oscillator", {"method": "ipopt"}, "expected a method of descent, newton"),
        ("oscillator", {"start": lambda t: 5 + 0 * t}, "misses them by"),
        ("rod_pendulum", {}, "found constraints"),
        ("damped_oscillator", {}, "found non-conservative forces"),
    ],
)
def test_what_cannot_be_relaxed(name, options, message):
    with pytest.raises(ValueError, match=message):
        relaxation_data(solved(name), **options)


# -- pictures --------------------------------------------------------------------------------


def drawn(ax, color):
    return [np.array(x.get_data()) for x in ax.lines if x.get_color() == color]


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "method", "words"),
    [
        ("minimum", "descent", "oscillator: descent reaches the minimum"),
        pytest.param(
            *("saddle", "descent", "oscillator: descent leaves the saddle below"),
            marks=pytest.mark.slow,
        ),
        ("saddle", "newton", "oscillator: Newton's method reaches the saddle"),
        pytest.param(
            *("projectile", "descent", "projectile: descent reaches the minimum"),
            marks=pytest.mark.slow,
        ),
    ],
)
def test_the_picture_says_what_is_seen(name, method, words, monkeypatch):
    solution, data = solved(name), relaxed(name, method)
    monkeypatch.setattr(
        figures, "relaxation_data", lambda _, start, *, method: relaxed(name, method)
    )
    panels = plot.relaxation(solution, method=method, units=plot.SI)
    assert panels.paths.get_title() == words
    legend = panels.paths.get_legend()
    assert legend is not None
    assert {x.get_text() for x in legend.get_texts()} == {"last path", "start", "true path"}
    steps = np.arange(len(data.action))
    for ax, values in ((panels.action, [data.action]), (panels.residual, [data.residual])):
        assert np.array_equal(drawn(ax, "black"), [[steps, y] for y in values])
    parts = [np.array(line.get_ydata()) for line in panels.parts.lines]
    assert np.array_equal(parts, [data.kinetic, data.potential])
    assert panels.residual.get_yscale() == "log"
    assert panels.action.get_ylabel() == "$S$ (J s)"
    low, high = panels.paths.get_ylim()
    row = 1 if name == "projectile" else 0
    assert low < data.paths[:, row].min() and data.paths[:, row].max() < high
    panels.paths.figure.draw_without_rendering()


@pytest.mark.long
def test_a_path_relaxes_between_the_events_it_passes():
    free = ao.System(lambda q, v, t: v @ v / 2, ["x", "y"])
    floor = ao.Bounce(lambda q, t: q[1])
    ends = ao.Event(0.0, [0.0, 1.0]), ao.Event(1.0, [2.0, 1.0])
    found = relaxation_data(ao.solve(ao.Problem(free, *ends, through=[floor])))
    at = np.argmin(np.abs(found.t - 0.5))
    assert found.arrived and found.action[0] > found.action[-1]
    assert np.ptp(found.paths[:, :, at], axis=0) == pytest.approx([0.0, 0.0], abs=1e-9)
