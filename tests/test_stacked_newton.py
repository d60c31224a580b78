"""Events, moving surfaces, given energies and families at once, against the legs' own actions."""

import pickle

import numpy as np
import pytest
import systems
from scipy.optimize import root

import actionopt as ao

A, B, T = np.array([0.0, 1.0]), np.array([1.5, -1.0]), 2.0
SLOW = 1.4  # how much denser the lower medium is


def moving(w):
    """Refraction at a plane that rises at the speed w."""
    upper = systems.particle("x y")
    lower = ao.System(lambda q, v, t: SLOW**2 * (v @ v) / 2, ["x", "y"])
    plane = ao.Event(None, None, on=lambda q, t, *, w: q[1] - w * t)
    ends = ao.Event(0, A), ao.Event(T, B)
    return ao.Problem([upper, lower], *ends, through=[plane], parameters={"w": w})


def refracted(w):
    """The place x and the time t at which S of two straight legs is stationary, and S."""

    def action(x, t):
        q = np.array([x, w * t])
        return (q - A) @ (q - A) / (2 * t) + SLOW**2 * (B - q) @ (B - q) / (2 * (T - t))

    def slopes(z):
        x, t = z
        before, after = (np.array([x, w * t]) - A) / t, (B - np.array([x, w * t])) / (T - t)
        by_x = before[0] - SLOW**2 * after[0]
        by_t = w * (before[1] - SLOW**2 * after[1]) - before @ before / 2
        return [by_x, by_t + SLOW**2 * after @ after / 2]

    x, t = root(slopes, [0.7, 0.8], tol=1e-14).x
    return x, t, action(x, t)


@pytest.mark.quick("-0.25")
@pytest.mark.parametrize("w", [0.3, -0.25])
def test_refraction_at_a_plane_that_moves(w, tmp_path):
    problem = moving(w)
    found = ao.solve(problem, tol=1e-11)
    x, t, S = refracted(w)
    event = found.problem.through[0]
    assert (event.t, *event.q) == pytest.approx((t, x, w * t), abs=1e-9)
    assert found.action == pytest.approx(S, rel=1e-11)
    # p changes along the normal (0, 1) alone, H by what the plane moves.
    assert found.impulses[0, 0] == pytest.approx(0, abs=1e-10)
    assert found.energy_jumps[0] == pytest.approx(w * found.impulses[0, 1], abs=1e-10)
    assert found.compare().agrees
    found.save(tmp_path / "ray.npz")
    again = ao.load(tmp_path / "ray.npz", list(problem.laws))
    assert again.action == pickle.loads(pickle.dumps(found)).action == found.action
    step = 1e-5
    slope = (refracted(w + step)[2] - refracted(w - step)[2]) / (2 * step)
    mu = found.impulses[0, 1]  # p after minus before is mu d on/dq
    assert -mu * t == pytest.approx(slope, rel=1e-7)


@pytest.mark.slow
def test_a_family_of_moving_planes_is_swept_and_traced():
    values = np.linspace(-0.3, 0.5, 5)
    runs = ao.sweep(moving(0.3), {"w": values})
    assert runs.action == pytest.approx([refracted(w)[2] for w in values], rel=1e-9)
    branch = ao.trace(moving(0.3), "w", -0.3)
    assert branch.actions[-1] == pytest.approx(refracted(branch.values[-1])[2], rel=1e-6)


def falling(a, b, t):
    """S of a body that falls from a to b in the time t, g = 1."""
    return (b - a) @ (b - a) / (2 * t) - t * (a[1] + b[1]) / 2 - t**3 / 24


def test_a_bounce_off_a_slope_with_a_free_time_at_a_given_energy():
    E, a, b = 2.0, np.array([0.0, 1.0]), np.array([1.6, 0.9])
    ball = systems.thrown(g=1.0)
    slope = ao.Bounce(lambda q, t: q[1] - 0.2 * q[0] + 0.1)
    ends = ao.Event(0, a), ao.Event(None, b)
    found = ao.solve(ao.Problem(ball, *ends, through=[slope], energy=E), tol=1e-11)
    event = found.problem.through[0]

    def whole(z):
        x, t, u = z
        q = np.array([x, 0.2 * x - 0.1])
        return falling(a, q, t) + falling(q, b, u) + E * (t + u)

    here = np.array([event.q[0], event.t, found.duration - event.t])
    steps = 1e-5 * np.eye(3)
    slopes = [(whole(here + d) - whole(here - d)) / 2e-5 for d in steps]
    assert slopes == pytest.approx([0.0] * 3, abs=1e-8)
    assert found.abbreviated_action == pytest.approx(whole(here), rel=1e-11)
    assert found.energy([0.0, found.duration]) == pytest.approx([E, E], abs=1e-9)
    steps = 1e-3 * np.eye(3)
    bend = [[whole(here + c + d) - whole(here + c - d) - whole(here - c + d) + whole(here - c - d)
             for c in steps] for d in steps]  # fmt: skip
    assert found.morse_index == np.sum(np.linalg.eigvalsh(bend) < 0)
