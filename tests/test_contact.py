"""Where bodies leave surfaces, against closed forms."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

import actionopt as ao
from actionopt import scenes
from actionopt.analysis.contact import contact_loss

ROOT_TOLERANCE = 1e-9


@pytest.mark.parametrize("numbers", [{}, {"R": 2.3, "m": 0.7, "g": 3.7, "duration": 1.9}])
def test_mass_leaves_a_circle_at_two_thirds(numbers):
    scene = scenes.get("sliding_off_circle", **numbers)
    solution = ao.solve(scene.problem, tol=1e-11)
    [contact] = contact_loss(solution)
    assert contact.lost and contact.row == 0
    assert abs(np.cos(contact.state.q[1]) - 2 / 3) < ROOT_TOLERANCE
    assert abs(contact.t - scene.facts["contact_time"]) < ROOT_TOLERANCE
    # theta'^2 = (2 g / R)(1 - cos theta) = 2 g / 3 R
    R, g = (float(scene.problem.parameters[x]) for x in "Rg")
    assert abs(contact.state.v[1] - np.sqrt(2 * g / (3 * R))) < ROOT_TOLERANCE


def test_a_mass_that_stops_before_leaves_nowhere():
    assert contact_loss(ao.solve(scenes.get("sliding_off_circle", duration=0.4).problem)) == ()


def bowl(q, t):
    return q[0] ** 2 + q[1] ** 2 - 1


def test_ball_in_a_loop_lets_go_and_would_be_caught_again():
    """With v^2 = v0^2 - 2 g (1 + c) at cos c from the top, lambda = 0 where v^2 = g c.

    That is before the top and, in the same height, after it.
    """
    g, v0 = 1.0, np.sqrt(4.2)  # just enough to pass the top

    def lagrangian(q, v, t):
        return v @ v / 2 - g * q[1]

    def time_to(angle):  # from the bottom: dt = da / v(a)
        return quad(lambda a: (v0**2 - 2 * g * (1 - np.cos(a))) ** -0.5, 0, angle, epsabs=1e-13)[0]

    ends = (0.2, 2 * np.pi - 0.2)
    t0, t1 = (time_to(a) for a in ends)
    system = ao.System(lagrangian, ["x", "y"], constraint=bowl)
    start, end = (ao.Event(t, [np.sin(a), -np.cos(a)]) for t, a in ((t0, ends[0]), (t1, ends[1])))
    angle = np.linspace(*ends, 40)
    knots = np.array([time_to(a) for a in angle])

    def guess(t):
        a = np.interp(t, knots, angle)
        return np.stack([np.sin(a), -np.cos(a)])

    solution = ao.solve(ao.Problem(system, start, end), tol=1e-11, guess=guess)
    c = (v0**2 - 2 * g) / (3 * g)
    lost = np.pi - np.arccos(c)  # from the bottom
    first, second = contact_loss(solution)
    assert abs(first.t - time_to(lost)) < ROOT_TOLERANCE
    assert abs(second.t - time_to(2 * np.pi - lost)) < ROOT_TOLERANCE
    assert (first.lost, second.lost) == (False, True)  # f <= 0 inside: lambda < 0 pushes inwards
    assert abs(first.state.q[1] - c) < ROOT_TOLERANCE


@pytest.mark.long
def test_two_surfaces_are_told_apart():
    """A mass on a table that moves as -3 cos t, drawn against a wall by 1 - t."""
    system = ao.System(
        lambda q, v, t: v @ v / 2 - 2.0 * q[1] - (1 - t) * q[0],
        ["x", "y", "z"],
        constraint=lambda q, t: [q[0], q[1] + 3.0 * np.cos(t)],
    )
    ends = [ao.Event(t, [0.0, -3.0 * np.cos(t), t]) for t in (0.0, 3.0)]
    found = contact_loss(ao.solve(ao.Problem(system, *ends), tol=1e-11))
    # wall: lambda = 1 - t; table: y'' + 2 = 3 cos t + 2
    root = brentq(lambda t: 3 * np.cos(t) + 2, 2, 3, xtol=1e-14)
    assert [(c.row, c.lost) for c in found] == [(0, True), (1, True)]
    assert np.allclose([c.t for c in found], [1.0, root], rtol=0, atol=ROOT_TOLERANCE)


def test_a_system_without_constraints_is_refused():
    with pytest.raises(ValueError, match="give the surface"):
        contact_loss(ao.solve(scenes.get("pendulum").problem))
