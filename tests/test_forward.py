"""Forward integration against motions known in closed form."""

import _thread
import io
import re
import signal
import sys
import threading

import numpy as np
import pytest
import systems
from helpers import a_quarter, at_once
from motions import ellipse, growing, kicked, of_scene, pendulum

from actionopt import Mesh, State, System
from actionopt.analysis.motion import flow, forward
from actionopt.analysis.motion.forward import IntegrationError, integrate
from actionopt.tools.interrupts import _Others

# At the default tol some thousand steps of CVODES make 5e-16 of error each, and the motions here
# amplify errors some thirty times on their way; the polynomials add their tail of 1e-12.
ACCURATE = 3e-11

# Over a hundred periods 3e4 steps of 5e-16 add up, and the phase adds up errors of frequency.
LONG = 2e-9


def kepler_lagrangian(q, v, t, *, m, k):
    return m * (v[0] ** 2 + v[1] ** 2) / 2 + k / np.sqrt(q[0] ** 2 + q[1] ** 2)


KEPLER = System(kepler_lagrangian, ["x", "y"], parameters={"m": 1.0, "k": 1.0})
PERICENTRE = State(0.0, *ellipse(1.0, 0.6, 1.0)(0.0))


def deviation(path, exact):
    """Largest error of q and v at times between the nodes, each relative to its own size."""
    t = np.linspace(*path.mesh.boundaries[[0, -1]], 501)
    worst = []
    for found, known in zip((path(t), path.velocity(t)), exact(t), strict=True):
        size = np.max(np.abs(known), axis=1, keepdims=True)
        worst.append(np.max(np.abs(found - known) / size))
    return max(worst)


# -- closed forms ----------------------------------------------------------------------------


@pytest.mark.long
def test_near_collision_arc():
    # A delay dt is an error of velocity a dt / v ~ dt / (1 - e)^1.5 = 90 dt at pericentre.
    e = 0.95
    exact = ellipse(1.0, e, 1.0)
    path = integrate(KEPLER, State(-2.0, *exact(-2.0)), 2.0)
    assert deviation(path, exact) < 10 * ACCURATE
    lengths = path.mesh.lengths
    assert lengths.max() > 20 * lengths.min()  # elements are where the motion is


@pytest.mark.long
@pytest.mark.parametrize(("w", "t_end"), [(2.0, 9.0), (0.7, -20.0)])
def test_oscillator_forwards_and_backwards(w, t_end):
    system = System(
        lambda q, v, t, *, w: v[0] ** 2 / 2 - (w * q[0]) ** 2 / 2, ["x"], parameters={"w": 1.0}
    )

    def exact(t):
        return np.sin(w * (t - 1))[None] + 2, w * np.cos(w * (t - 1))[None]

    shifted = System(
        lambda q, v, t, *, w: v[0] ** 2 / 2 - (w * (q[0] - 2)) ** 2 / 2, ["x"], parameters={"w": w}
    )
    path = integrate(shifted, State(1.0, [2.0], [w]), t_end)
    assert path.mesh.boundaries[[0, -1]].tolist() == sorted([1.0, t_end])
    assert deviation(path, exact) < ACCURATE
    there = path(t_end), path.velocity(t_end)
    assert path(1.0)[0] == 2.0
    back = integrate(shifted, State(t_end, *there), 1.0)
    assert abs(back(1.0)[0] - 2.0) < ACCURATE
    rest = integrate(system, State(0.0, [0.0], [0.0]), t_end, parameters={"w": w})
    assert np.all(rest.values == 0)


@at_once(
    ("motion", "T"),
    [
        (growing(0.3, 2.0), 6.0),
        (growing(1.0, 3.0), 6.0),
        (of_scene("damped_oscillator"), 8.0),
        (of_scene("driven_oscillator"), 8.0),
        (of_scene("turning_wire"), 2.0),
    ],
)
def test_motions_that_time_forces_and_constraints_drive(motion, T):
    system, exact = motion
    assert deviation(integrate(system, State(0.0, *exact(0.0)), T), exact) < ACCURATE


@pytest.mark.long
@pytest.mark.parametrize("width", a_quarter([0.001, 0.1, 0.03, 0.01]))
@pytest.mark.parametrize("centre", a_quarter([0.31, 0.53, 0.613, 0.8], 2))
@pytest.mark.parametrize("speed", [0.0, 1.0])
def test_a_kick_is_not_stepped_over(width, centre, speed):
    system, exact = kicked(width, centre)
    q, v = exact(np.zeros(1), speed)
    path = integrate(system, State(0.0, q[:, 0], v[:, 0]), 1.0)
    assert deviation(path, lambda t: exact(t, speed)) < ACCURATE
    assert path.mesh.elements < 300


@pytest.mark.long
def test_a_given_mesh_limits_the_steps():
    """A kick that two hundred steps would pass over, on elements that are as short."""
    system, exact = kicked(2e-5, 0.61803)
    at_rest = State(0.0, [0.0], [0.0])
    given = Mesh(np.r_[0.0, 0.61803 + 1e-4 * np.array([-2, -1, 1, 2]), 1.0], 12)
    path = integrate(system, at_rest, 1.0, mesh=given)
    assert deviation(path, exact) < 10 * ACCURATE  # an ulp of time is 5e-12 of the width


@pytest.mark.long
def test_twelve_masses_on_springs_with_a_full_mass_matrix():
    """The second mode, in coordinates u_i = x_i - x_(i-1): frequency 2 sin(pi / 13)."""
    n = 12

    def lagrangian(q, v, t):
        x, rate = np.cumsum(np.stack([*q, 0.0])[:n]), np.cumsum(np.stack([*v, 0.0])[:n])
        return (np.sum(rate**2) - np.sum(q**2) - x[n - 1] ** 2) / 2

    shape = np.diff(np.sin(2 * np.pi * np.arange(n + 1) / (n + 1)))
    w = 2 * np.sin(np.pi / (n + 1))

    def exact(t):
        return shape[:, None] * np.cos(w * t), -w * shape[:, None] * np.sin(w * t)

    system = System(lagrangian, [f"u{i}" for i in range(n)])
    assert deviation(integrate(system, State(0.0, shape, 0 * shape), 30.0), exact) < ACCURATE


# -- constraints -----------------------------------------------------------------------------


@pytest.mark.long
@pytest.mark.parametrize(("theta", "l", "g"), [(1.0, 1.0, 9.81), (3.0, 0.4, 1.6)])
def test_cartesian_pendulum_against_its_angle_and_tension(theta, l, g):
    system, exact = pendulum(theta, l, g)
    path = integrate(system, State(0.0, *exact(0.0)), 4.0)
    assert deviation(path, exact) < ACCURATE
    t = path.mesh.nodes
    force = system.constraint_force(path(t), path.velocity(t), t)
    tension = -g * (3 * exact(t)[0][1] / l + 2 * np.cos(theta))
    inward = -np.sum(force * path(t), axis=0) / l
    assert np.allclose(inward, tension, rtol=0, atol=10 * ACCURATE * g)


@pytest.mark.long
def test_drift_off_the_surface_stays_at_round_off():
    system = System(
        lambda q, v, t, *, g: np.dot(v, v) / 2 - g * (q[1] + q[3]),
        ["x1", "y1", "x2", "y2"],
        parameters={"g": 9.81},
        constraint=lambda q, t: [
            q[0] ** 2 + q[1] ** 2 - 1,
            (q[2] - q[0]) ** 2 + (q[3] - q[1]) ** 2 - 1,
        ],
    )
    path = integrate(system, State(0.0, [1.0, 0.0, 2.0, 0.0], np.zeros(4)), 20.0)
    t = np.linspace(0, 20, 2001)
    assert np.max(np.abs(system.constraint(path(t), t))) < 1e-11


# -- units, tolerance, cost ------------------------------------------------------------------


@pytest.mark.long
@pytest.mark.parametrize(
    ("length", "time", "mass"), [(1.0, 1.0, 1.0), (1e-10, 1e-15, 1e-27), (1.5e11, 3e7, 2e30)]
)
def test_atoms_and_planets_are_followed_equally_well(length, time, mass):
    e, mu = 0.6, length**3 / time**2
    given = {"m": mass, "k": mass * mu}
    orbit = ellipse(length, e, mu)
    q, v = orbit(0.0)
    path = integrate(KEPLER, State(0.0, q, v), 5 * time, parameters=given)
    assert deviation(path, orbit) < ACCURATE

    polar = System(
        lambda q, v, t, *, m, k: m * (v[0] ** 2 + (q[0] * v[1]) ** 2) / 2 + k / q[0],
        ["r", "phi"],
        parameters=given,
    )
    here = State(0.0, [q[0], 0.0], [0.0, v[1] / q[0]])  # lengths and angles in one state
    path = integrate(polar, here, 5 * time)

    def exact(t):
        (x, y), (vx, vy) = orbit(t)
        r = np.hypot(x, y)
        return (
            np.stack([r, np.unwrap(np.arctan2(y, x))]),
            np.stack([(x * vx + y * vy) / r, (x * vy - y * vx) / r**2]),
        )

    assert deviation(path, exact) < ACCURATE


@pytest.mark.slow
def test_long_motion_is_measured_in_its_own_size():
    """From rest for a hundred periods, where a T^2 says nothing of the amplitude."""
    system = systems.oscillator()
    path = integrate(system, State(0.0, [1.0], [0.0]), 628.0)
    assert deviation(path, lambda t: (np.cos(t)[None], -np.sin(t)[None])) < LONG


@pytest.mark.long
def test_error_follows_tol():
    errors = []
    for tol in (1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12):
        path = integrate(KEPLER, PERICENTRE, 6.0, tol=tol)
        errors.append(deviation(path, ellipse(1.0, 0.6, 1.0)) / tol)
    # A tail of one tol can stand for a few at points between, and pericentre amplifies ten times.
    assert max(errors) < 30
    assert errors[0] > 1e-5  # it is not simply always exact


def test_a_second_integration_derives_nothing(monkeypatch):
    system, _ = pendulum(1.0, 1.0, 9.81)
    state = State(0.0, [0.6, -0.8], [0.0, 0.0])
    integrate(system, state, 1.0)
    derived = system.derived
    monkeypatch.delattr(flow, "scaled_motion")
    integrate(system, state, 2.0, parameters={"g": 1.6}, tol=1e-6)
    assert system.derived == derived


def test_a_given_mesh_is_kept_where_it_resolves_the_motion():
    system = systems.oscillator()
    given = Mesh([0.0, 0.2, 0.5, 5.0, 6.0], [4, 12, 12, 20])
    path = integrate(system, State(0.0, [1.0], [0.0]), 6.0, mesh=given)
    assert set(given.boundaries) < set(path.mesh.boundaries.tolist())
    assert path.mesh.degrees[:2] == (12, 12)
    assert path.mesh.degrees[-1] == 20
    assert deviation(path, lambda t: (np.cos(t)[None], -np.sin(t)[None])) < ACCURATE
    back = integrate(system, State(6.0, path(6.0), path.velocity(6.0)), 0.0, mesh=given)
    assert np.allclose(back.mesh.boundaries, path.mesh.boundaries, rtol=0, atol=1e-14)
    with pytest.raises(ValueError, match="a mesh over the times"):
        integrate(system, State(0.0, [1.0], [0.0]), 7.0, mesh=given)


# -- what is refused -------------------------------------------------------------------------


START = State(0.0, [1.0, 0.0], [0.0, 1.0])


@at_once(
    ("system", "state", "t_end", "others", "match"),
    [
        *(
            (KEPLER, START, 1.0, {"tol": tol}, "tol between")
            for tol in (0.0, -1e-9, 1e-15, 0.2, np.nan, None, "1e-9", [1e-9])
        ),
        *((KEPLER, START, t, {}, "t_end") for t in (0.0, np.nan, None, "noon", [1.0, 2.0], 1j)),
        (KEPLER, State(0.0, [1.0], [0.0]), 1.0, {}, r"2 coordinates \(x, y\), found 1"),
        (KEPLER, ([1.0, 0.0], [0.0, 1.0]), 1.0, {}, "expected a State"),
        (None, START, 1.0, {}, "expected a System"),
        (lambda q, v, t: v @ v / 2, START, 1.0, {}, "expected a System"),
        (KEPLER, START, 1.0, {"mesh": 40}, "expected a Mesh"),
        (KEPLER, START, 1.0, {"parameters": [1.0]}, "parameters by name"),
    ],
)
def test_arguments_that_do_not_fit(system, state, t_end, others, match):
    with pytest.raises(ValueError, match=match):
        integrate(system, state, t_end, **others)


def test_state_off_the_surface_or_leaving_it():
    system, _ = pendulum(1.0, 1.0, 9.81)
    with pytest.raises(ValueError, match=r"f = 0\.0001.* row 0"):
        integrate(system, State(0.0, [0.0, -1.00005], [1.0, 0.0]), 1.0)
    with pytest.raises(ValueError, match=r"df/dt = -0\.02 in constraint row 0"):
        integrate(system, State(0.0, [0.0, -1.0], [1.0, 0.01]), 1.0)


def test_coordinate_without_kinetic_energy():
    system = System(lambda q, v, t: v[0] ** 2 / 2 + q[0] * q[1], ["x", "y"])
    with pytest.raises(ValueError, match="singular mass matrix"):
        integrate(system, State(0.0, [1.0, 1.0], [0.0, 0.0]), 1.0)


NO_ACCELERATIONS = {
    "one mass for two": System(lambda q, v, t: (v[0] + v[1]) ** 2 / 2 - q @ q, ["x", "y"]),
    "rows alike but for rounding": System(
        lambda q, v, t: v @ v / 2 - q[0] ** 2 / 2,
        ["x", "y", "z"],
        constraint=lambda q, t: [q[0] - q[1] + q[2], 3 * (q[0] - q[1] + q[2]) / 7],
    ),
}


@pytest.mark.parametrize("name", NO_ACCELERATIONS)
def test_equations_that_give_no_accelerations_are_refused(name):
    system = NO_ACCELERATIONS[name]
    with pytest.raises(ValueError, match=r"singular mass matrix \(or dependent constraints\)"):
        integrate(system, State(0.0, [0.0] * system.n, [1.0, 1.0, 0.0][: system.n]), 1.0)


def test_start_outside_the_domain():
    with pytest.raises(ValueError, match="finite accelerations"):
        integrate(KEPLER, State(0.0, [0.0, 0.0], [0.0, 1.0]), 1.0)


@pytest.mark.slow
def test_collision_is_reported_with_its_time_and_without_noise(capfd):
    fall = np.pi / np.sqrt(8)  # from rest at distance one into the centre
    with pytest.raises(IntegrationError) as caught:
        integrate(KEPLER, State(0.0, [1.0, 0.0], [0.0, 0.0]), 2.0)
    found = re.search(r"between t = (\S+) and t = (\S+):", str(caught.value))
    assert found is not None
    assert float(found[1]) < fall < float(found[2])
    assert capfd.readouterr() == ("", "")
    path = integrate(KEPLER, State(0.0, [1.0, 0.0], [0.0, 0.0]), 1.0)  # before it all is well
    assert path(1.0)[0] < 0.4


def test_a_force_that_is_not_smooth_ends_soon():
    system = System(lambda q, v, t: v[0] ** 2 / 2 - np.abs(q[0]), ["x"])
    with pytest.raises(IntegrationError, match="not smooth"):
        integrate(system, State(0.0, [-0.5], [1.2]), 2.0)


@pytest.mark.long
def test_what_does_not_fit_into_memory_is_refused(monkeypatch):
    monkeypatch.setattr(forward, "MAX_NUMBERS", 1000)
    with pytest.raises(IntegrationError, match="not resolved by"):
        integrate(KEPLER, PERICENTRE, 100.0)


@pytest.mark.parametrize("backwards", [False, True])
def test_a_mass_that_jumps_keeps_the_momentum(backwards):
    c = 0.3141592
    system = System(lambda q, v, t: np.where(t > c, 3.0, 1.0) * v[0] ** 2 / 2, ["x"])
    ends = State(0.0, [0.2], [1.5]), State(1.0, [0.2 + 1.5 * c + 0.5 * (1 - c)], [0.5])
    path = integrate(system, ends[backwards], ends[1 - backwards].t)
    t = np.array([0.0, 0.1, c - 1e-9, c + 1e-9, 0.7, 1.0])
    v = np.where(t > c, 0.5, 1.5)
    q = 0.2 + 1.5 * np.minimum(t, c) + 0.5 * np.maximum(t - c, 0.0)
    np.testing.assert_allclose(path(t)[0], q, rtol=0, atol=1e-14)
    np.testing.assert_allclose(path.velocity(t)[0], v, rtol=0, atol=1e-14)
    assert path.mesh.boundaries[0] == 0.0 and path.mesh.boundaries[-1] == 1.0


@pytest.mark.quick("1.0")
@pytest.mark.parametrize("c", [0.0, 1.0])
def test_a_jump_at_an_end(c):
    """At the first time it is crossed, beyond the last it is not."""
    system = System(lambda q, v, t: np.where(t > c, 3.0, 1.0) * v[0] ** 2 / 2, ["x"])
    path = integrate(system, State(0.0, [0.0], [1.5]), 1.0)
    assert path(1.0) == pytest.approx(1.5 if c else 0.5, rel=1e-14)
    assert path.mesh.boundaries[0] == 0.0 and path.mesh.boundaries[-1] == 1.0


def test_rest_at_a_saddle_point_stays():
    """Its velocities are round-off, and are not resolved."""
    system = System(lambda q, v, t: v[0] ** 2 / 2 + np.cos(q[0] - 1 / 3), ["angle"])
    path = integrate(system, State(0.0, [np.pi + 1 / 3], [0.0]), 5.0)
    assert abs(path(5.0)[0] - np.pi - 1 / 3) < 1e-15 * np.exp(5.0)


def test_legs_are_of_elements_alike_in_length():
    b = np.array([0.0, 0.5, 0.6, 0.601, 0.602, 0.7, 1.0])
    mesh = Mesh(b, [4, 5, 20, 7, 8, 9])
    legs = forward._legs(mesh, [(0.3, np.nextafter(0.3, 1.0))], False)
    assert [times.tolist() for times, _ in legs] == [
        [0.0, 0.3],
        [np.nextafter(0.3, 1.0), 0.5, 0.6],
        [0.6, 0.601, 0.602],
        [0.602, 0.7, 1.0],
    ]
    assert [degrees.tolist() for _, degrees in legs] == [[12], [12, 12], [20, 12], [12, 12]]
    back = forward._legs(mesh, [(0.3, np.nextafter(0.3, 1.0))], True)
    assert [times.tolist() for times, _ in back] == [
        times[::-1].tolist() for times, _ in legs[::-1]
    ]


def test_round_off_is_what_the_last_digits_do():
    """a = -w^2 x + cos(t): one digit of x, or of t, each at most times."""
    system = System(lambda q, v, t: (v[0] ** 2 - 1e4 * q[0] ** 2) / 2 + np.cos(t) * q[0], ["x"])
    motion = flow.Flow(system)
    t, one = np.linspace(0.0, 1.0, 65), np.ones((1, 65))
    eps = np.spacing(1.0)
    assert motion.round_off(one, one, t) == pytest.approx(1e4 * eps, rel=0.5)
    far = motion.round_off(0 * one, one, t + 1e9)
    assert far == pytest.approx(np.spacing(1e9), rel=0.2)  # sin is nearly one for a tenth of them


@pytest.fixture
def keyboard():
    """Let the signal from the keyboard arrive, also where the parent process ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("keyboard")
def test_other_threads_keep_standard_error(capfd):
    """Integrations in several threads, one interrupted: each may write, and all is as before."""
    stderr, stop = sys.stderr, threading.Event()

    def others():
        while not stop.is_set():
            integrate(KEPLER, PERICENTRE, 1.0)

    threads = [threading.Thread(target=others) for _ in range(3)]
    for thread in threads:
        thread.start()
    timer = threading.Timer(0.3, _thread.interrupt_main)
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        integrate(KEPLER, PERICENTRE, 1e5)
    stop.set()
    for thread in (*threads, timer):
        thread.join()
    assert sys.stderr is stderr
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("constraint", "q", "v"),
    [
        # y is zero, and 1e-17 off what it should be: that is measured by x.
        (lambda q, t: q[1] + 1e-17, [1.0, 0.0], [1.0, 0.0]),
        # All coordinates are rounding: what the surface moves by over the time is the measure.
        (lambda q, t: q[0] - 2.0 * t, [1e-17, 0.0], [2.0, 0.0]),
    ],
    ids=["a coordinate is zero", "the surface moves"],
)
def test_a_state_off_the_surface_by_rounding_is_on_it(constraint, q, v):
    system = systems.particle("x y", constraint=constraint)
    path = integrate(system, State(0.0, q, v), 1.5)
    t = np.linspace(0.0, 1.5, 31)
    assert np.max(np.abs(path(t) - (np.array(q)[:, None] + np.outer(v, t)))) < ACCURATE
    with pytest.raises(ValueError, match="on the constraint surface"):
        integrate(system, State(0.0, np.add(q, 1e-6), v), 1.5)


def test_others_write_to_standard_error():
    stream = io.StringIO()
    others = _Others(stream)
    assert others.write("mine") == 4
    thread = threading.Thread(target=others.write, args=("theirs",))
    thread.start()
    thread.join()
    others.flush()
    assert stream.getvalue() == "theirs"
