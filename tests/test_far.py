"""Far from zero: times and coordinates whose origin has nothing to do with the motion."""

import numpy as np
import pytest
import systems
from helpers import a_quarter

import actionopt as ao


def forced(q, v, t):
    return (v[0] ** 2 - q[0] ** 2) / 2 + 5 * np.cos(3 * t) * q[0]


def forced_motion(t0, T, a, b):
    """Return x(t) of x'' = -x + 5 cos(3 t) through (t0, a) and (t0 + T, b), in 64-bit mantissas."""

    def particular(t):
        return -5 / 8 * np.cos(3 * np.asarray(t, dtype=np.longdouble))

    c = a - particular(t0)
    s = (b - particular(t0 + T) - c * np.cos(T)) / np.sin(T)
    return lambda t: c * np.cos(t - t0) + s * np.sin(t - t0) + particular(t)


@pytest.mark.quick("1000.0-1e-08", "1000000.0-1e-08")
@pytest.mark.parametrize(
    ("t0", "tol"), [(1e3, 1e-8), (1e6, 1e-8), (1e9, 1e-6), (1.7e9, 1e-5), (-1.7e9, 1e-5)]
)
def test_a_clock_far_from_zero(t0, tol):
    T = 100.0
    problem = ao.Problem(ao.System(forced, ["x"]), ao.Event(t0, [0.3]), ao.Event(t0 + T, [0.5]))
    solution = ao.solve(problem, tol=tol)
    t = np.linspace(t0, t0 + T, 2001)
    exact = forced_motion(t0, T, 0.3, 0.5)(t)
    assert np.max(np.abs(solution(t)[0] - exact)) / np.max(np.abs(exact)) <= solution.error
    assert solution.stats["unknowns"] < 50_000


def test_the_resolution_of_time_is_said_where_it_forbids_the_tolerance():
    problem = ao.Problem(
        ao.System(forced, ["x"]), ao.Event(1.7e9, [0.3]), ao.Event(1.7e9 + 100, [0.5])
    )
    with pytest.raises(
        ao.SolveError, match=r"times near 1.7e\+09 are known to 2e-07 only"
    ) as found:
        ao.solve(problem, tol=1e-10)
    assert found.value.solution.status is ao.Status.FLOOR
    t = np.linspace(1.7e9, 1.7e9 + 100, 2001)
    exact = forced_motion(1.7e9, 100.0, 0.3, 0.5)(t)
    true = np.max(np.abs(found.value.solution(t)[0] - exact)) / np.max(np.abs(exact))
    assert true <= found.value.solution.error


@pytest.mark.parametrize(("t0", "T"), [(1e9, None), (1e12, 2.0), (1e15, 4.0), (-1e15, 4.0)])
def test_events_that_can_be_told_apart_can_be_joined(t0, T):
    """T is None: t1 is the float next to t0. The motion is that from zero, for a steady L."""
    t1 = np.nextafter(t0, np.inf) if T is None else t0 + T
    system = systems.oscillator()
    there = ao.solve(ao.Problem(system, ao.Event(t0, [0.3]), ao.Event(t1, [0.5])))
    here = ao.solve(ao.Problem(system, ao.Event(0.0, [0.3]), ao.Event(t1 - t0, [0.5])))
    assert there.action == pytest.approx(here.action, rel=1e-12)
    assert np.array_equal(there.mesh.since, here.mesh.since)
    assert there(t1) == pytest.approx([0.5])


def henon_heiles(q, v, t, *, X):
    x, y = q[0] - X, q[1] - X
    return v @ v / 2 - (x**2 + y**2) / 2 - x**2 * y + y**3 / 3


@pytest.mark.long
@pytest.mark.parametrize("X", a_quarter([1e6, 1e2, 1e4, 1e5, 1e7]))
def test_a_shifted_origin_changes_nothing(X):
    system = ao.System(henon_heiles, ["x", "y"], parameters={"X": 0.0})

    def solved(shift):
        ends = np.array([[0.1, 0.2], [0.3, -0.2]]) + shift
        events = ao.Event(0.0, ends[0]), ao.Event(6.0, ends[1])
        return ao.solve(ao.Problem(system, *events, parameters={"X": shift}), tol=1e-9)

    t = np.linspace(0, 6, 200)
    there, here = solved(X), solved(0.0)
    # What tol allows is of |q|; and the motion itself is to be resolved.
    allowed = min(2e-9 * X, 0.1)
    assert np.max(np.abs(there(t) - X - here(t))) <= allowed
    assert there.morse_index == here.morse_index


def test_the_origin_of_a_plain_problem_is_zero():
    system = systems.oscillator("x y")
    problem = ao.Problem(system, ao.Event(0.0, [1.0, 0.0]), ao.Event(1.0, [0.5, -2.0]))
    assert problem.origin is None
    assert problem.lengths is problem.scales
    moved = ao.Problem(system, ao.Event(0.0, [100.0, 0.0]), ao.Event(5.0, [100.5, -2.0]))
    assert moved.origin is None  # the force there leads as far as the coordinate is large


def test_a_coordinate_that_is_small_at_the_events_alone():
    """Nearly opposite points of a sphere: x is 1e-3 at the end, and 1 on the way."""
    sphere = systems.particle("x y z", constraint=lambda q, t: (q @ q - 1) / 2)
    angle = np.pi - 1e-3
    end = ao.Event(1.0, [np.sin(angle), 0.0, np.cos(angle)])
    solution = ao.solve(ao.Problem(sphere, ao.Event(0.0, [0.0, 0.0, 1.0]), end))
    assert solution.action == pytest.approx(angle**2 / 2, rel=1e-9)
