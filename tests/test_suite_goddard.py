"""Goddard's rocket against its maximum principle, by equations and an integrator of its own."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, lsq_linear

from actionopt import suite
from actionopt.suite.models import goddard
from actionopt.suite.models.goddard import greatest_height

MOST, EXHAUST, DRY = 3.5, 0.5, 0.6


def rates(t, y, thrust):
    """Return the rates of h, v, m and of the costates, from the Hamiltonian."""
    h, v, m, ph, pv, _ = y
    u = thrust(y)
    drag = 310 * v * abs(v) * np.exp(-500 * (h - 1))
    return [
        v,
        (u - drag) / m - h**-2,
        -u / EXHAUST,
        -pv * (500 * drag / m + 2 * h**-3),
        -ph + pv * 620 * abs(v) * np.exp(-500 * (h - 1)) / m,
        pv * (u - drag) / m**2,
    ]


def hamiltonian(y, u):
    return y[3:] @ np.array(rates(0, y, lambda y: u))[:3]


def switching(y):
    return y[4] / y[2] - y[5] / EXHAUST


def along(y, thrust, end, event=None):
    found = solve_ivp(
        rates, (0, end), y, "DOP853", args=(thrust,), events=event, rtol=1e-12, atol=1e-14
    )
    return found.y


def test_three_arcs_obey_the_maximum_principle_and_reach_that_height():
    """Costates from the top backwards; times of the arcs by 22 digits of another integrator."""
    ignition, burnout, height = 0.0235096840, 0.0726707434, 1.0128369183

    # Up to burnout without costates, as they do not act on the motion.
    full = along([1, 0, 1, 0, 0, 0], lambda y: MOST, ignition)[:, -1]

    def on_the_arc(y):
        h, v, m = y[:3]
        drag, g = 310 * v**2 * np.exp(-500 * (h - 1)), h**-2
        slope = np.array(
            [
                -500 * drag * (1 + v / EXHAUST) + 2 * m * h**-3,
                drag * (2 / v + 3 / EXHAUST),
                -g,
            ]
        )
        rest = slope @ np.array(rates(0, y, lambda y: 0.0))[:3]
        one = slope @ np.array(rates(0, y, lambda y: 1.0))[:3]
        return rest / (rest - one)

    burnt = along(full, on_the_arc, burnout - ignition)[:, -1]
    assert burnt[2] == pytest.approx(DRY, abs=1e-8)

    def rests(t, y, thrust):
        return y[1]

    rests.terminal, rests.direction = True, -1
    top = along(burnt, lambda y: 0.0, 1.0, rests)[:, -1]
    assert top[0] == pytest.approx(height, abs=1e-9)
    assert greatest_height() == pytest.approx(top[0], abs=1e-9)
    # Costates at the top: of h it is 1, of v 0; of m so that the thrust ends at burnout.
    coast = along([*top[:3], 1, 0, 0], lambda y: 0.0, -0.1261855187)
    gap = switching(coast[:, -1]) * EXHAUST
    coast[5] += gap
    assert all(switching(y) < 0 for y in coast.T[:-1])
    assert abs(hamiltonian(coast[:, -1], 0.0)) < 1e-8
    arc = along(coast[:, -1], on_the_arc, ignition - burnout)
    assert max(abs(switching(y)) for y in arc.T) < 1e-6
    begin = along(arc[:, -1], lambda y: MOST, -ignition)
    assert begin[:3, -1] == pytest.approx([1, 0, 1], abs=1e-7)
    assert all(switching(y) > 0 for y in begin.T[1:])


@pytest.mark.long
def test_steps_have_the_three_arcs_and_their_height_tends_to_the_best():
    errors = []
    for count in (25, 50):
        rocket = suite.model("goddard_rocket", elements=count)
        u = rocket.x_star[3 * count : 4 * count]
        order = np.where(u == MOST, 0, np.where(u > 0, 1, 2))
        assert np.all(np.diff(order) >= 0) and np.all(np.bincount(order) > 1)
        errors.append(-rocket.f_star - greatest_height())
    assert 1.8 < errors[0] / errors[1] < 2.2 and errors[1] < 2e-4


def first_order(problem, x):
    """Return what multipliers of the right signs leave of grad f, relative, in units of x."""
    (lower, upper), J = problem.bounds, np.zeros((problem.m, problem.n))
    J[problem.jacobian_structure] = problem.jacobian(x)
    pushes = np.vstack([J, -np.eye(problem.n)[x <= lower], np.eye(problem.n)[x >= upper]])
    least = np.where(np.arange(len(pushes)) < problem.m, -np.inf, 0)
    slope = problem.gradient(x) * problem.unit
    found = lsq_linear((pushes * problem.unit).T, -slope, (least, np.inf), tol=1e-14)
    return np.abs(found.fun).max() / np.abs(slope).max()


def test_the_optimum_of_a_few_steps_is_stationary():
    rocket = suite.model("goddard_rocket", elements=6)
    assert first_order(rocket, rocket.x_star) < 1e-9


@pytest.mark.long
@pytest.mark.parametrize("thrust", [0.0, 1.0, MOST])
def test_the_shortest_flight_is_not_stationary_whatever_the_thrust(thrust):
    """The ground in no time would be, with any thrust."""
    rocket = suite.model("goddard_rocket", elements=10)
    time, (h, v, m), states = rocket.bounds[0][-1], (1.0, 0.0, 1.0), []
    for _ in range(10):
        drag = 310 * v**2 * np.exp(-500 * (h - 1))
        v = v + time / 10 * ((thrust - drag) / m - h**-2)
        h, m = h + time / 10 * v, max(m - time / 10 * thrust / EXHAUST, DRY)
        states.append((h, v, m))
    x = np.concatenate([np.transpose(states).ravel(), np.full(10, thrust), [time]])
    assert rocket.violation(x) < 1e-12
    assert first_order(rocket, rocket.x_star) < 1e-9
    assert first_order(rocket, x) > 0.01


@pytest.mark.quick("2.0", "0.5", "-1", "inf", "nan")
@pytest.mark.parametrize("most", [3.0, 2.0, 0.5, -1, np.inf, np.nan])
def test_a_thrust_without_a_singular_arc_is_refused(most):
    with pytest.raises(ValueError, match="so much thrust that a singular arc is flown"):
        suite.model("goddard_rocket", most=most)


def test_the_thrust_on_the_singular_arc_stays_on_it():
    h, m = 1.005, 0.8
    v = brentq(lambda v: goddard._beyond(np.array([h, v, m, 0.0])), 0.01, 1.0)
    y = np.array([h, v, m, 0.0])
    step = 1e-6 * goddard._rate(y, goddard._thrust(y))
    assert (goddard._beyond(y + step) - goddard._beyond(y - step)) / 2e-6 == pytest.approx(
        0, abs=1e-6
    )
