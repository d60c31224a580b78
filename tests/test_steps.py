"""Steep steps of L that a path crosses: found by motions in steps that keep the energy."""

import numpy as np
import pytest
from scipy.optimize import brentq

import actionopt as ao
from actionopt.analysis.quadratic.shooting import integrate

FORMS = {
    "tanh": lambda x: np.tanh(x) / 2,
    "root": lambda x: x / np.sqrt(1 + x**2) / 2,
}


def stepped(width: float, form: str = "tanh") -> ao.System:
    """Return a body that climbs a step of height one at x = 0.1, in the plane or on a line."""
    return ao.System(lambda q, v, t: v @ v / 2 - FORMS[form]((q[0] - 0.1) / width), ["x", "y"])


@pytest.mark.parametrize(
    ("form", "width"),
    [("tanh", 1e-5), pytest.param("tanh", 1e-6, marks=pytest.mark.slow),
     pytest.param("root", 1e-5, marks=pytest.mark.slow)],
)  # fmt: skip
def test_a_motion_is_refracted_by_a_steep_step(form, width):
    """The time before the step and after it are those of the energy, and p_y is kept."""
    start, end = ao.Event(0.0, [-0.7, 0.0]), ao.Event(1.0, [0.9, 0.5])
    found = ao.solve(ao.Problem(stepped(width, form), start, end), tol=1e-7)
    late = lambda u: 0.8 / u + 0.8 / np.sqrt(u**2 - 2) - 1  # noqa: E731
    u = brentq(late, 1.5, 20.0)
    assert isinstance(u, float)
    v = found.velocity([0.0, 1.0])
    assert v == pytest.approx(np.array([[u, np.sqrt(u**2 - 2)], [0.5, 0.5]]), abs=30 * width)
    assert np.ptp(found.energy([0.0, 1.0])) < 1e-5
    assert found.morse_index == 0


def test_a_motion_does_not_pass_a_step_unseen_where_the_energy_is_kept():
    problem = ao.Problem(stepped(1e-7), ao.Event(0.0, [-0.7, 0.0]), ao.Event(1.0, [0.9, 0.5]))
    start = np.zeros(1), np.array([-0.7, 0.0])[:, None, None], np.array([2.0, 0.5])[:, None, None]
    ends = {kept: integrate(problem, start, np.ones(1), kept=kept) for kept in (np.inf, 1e-4)}
    speeds = {kept: v[0, 0, 0] for kept, (_, v) in ends.items()}
    assert speeds[np.inf] == 2.0
    assert speeds[1e-4] == pytest.approx(np.sqrt(2.0), abs=1e-3)
