"""The comparison with forward integration: it must agree with motions and contradict the rest.

The curves compared are closed forms, wrapped so that they look like solutions; no solver is run
except in the last test.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest
from scipy.special import ellipj, ellipk, ndtr

from actionopt import Event, Mesh, Path, Problem, State, System
from actionopt.compare import compare
from actionopt.forward import IntegrationError, integrate

ACCURATE = 3e-11  # what forward integration makes of these motions, as its own tests say


@dataclass
class Curve:
    """A curve `exact(t) -> (q, v)` that looks like a solution of error `error`."""

    problem: Problem
    exact: Callable
    mesh: Mesh = field(init=False)
    error: float = 1e-12
    elements: int = 8
    degree: int = 12

    def __post_init__(self):
        ends = self.problem.start.t, self.problem.end.t
        self.mesh = Mesh.uniform(*ends, self.elements, self.degree)

    def __call__(self, t):
        return self.exact(np.asarray(t))[0]

    def velocity(self, t):
        return self.exact(np.asarray(t))[1]

    @property
    def start(self):
        t0 = self.problem.start.t
        return State(t0, self(t0), self.velocity(t0))


def between(system, exact, t0, t1, **options):
    """Return the curve `exact` as a solution of the problem between two of its own points."""
    events = [Event(t, exact(np.array(t))[0]) for t in (t0, t1)]
    return Curve(Problem(system, *events), exact, **options)


OSCILLATOR = System(lambda q, v, t: v[0] ** 2 / 2 - 2 * q[0] ** 2, ["x"])
FREE = System(lambda q, v, t: (v[0] ** 2 + v[1] ** 2) / 2, ["x", "y"])
ORBIT = System(lambda q, v, t: (v[0] ** 2 + v[1] ** 2) / 2 + 1 / np.hypot(q[0], q[1]), ["x", "y"])
DOUBLE = System(
    lambda q, v, t: (
        v[0] ** 2
        + v[1] ** 2 / 2
        + v[0] * v[1] * np.cos(q[0] - q[1])
        + 2 * np.cos(q[0])
        + np.cos(q[1])
    ),
    ["a", "b"],
)


def oscillation(w):
    return lambda t: (np.cos(w * t)[None, ...], -w * np.sin(w * t)[None, ...])


def pendulum(theta, l, g):
    """Cartesian pendulum on a rod, let go at the angle `theta`: system and motion."""
    system = System(
        lambda q, v, t, *, g: (v[0] ** 2 + v[1] ** 2) / 2 - g * q[1],
        ["x", "y"],
        parameters={"g": g},
        constraint=lambda q, t: q[0] ** 2 + q[1] ** 2 - l**2,
    )
    k, w = np.sin(theta / 2), np.sqrt(g / l)

    def exact(t):
        sn, cn, _, _ = ellipj(w * t + ellipk(k**2), k**2)
        a, rate = 2 * np.arcsin(k * sn), 2 * k * w * cn
        along = np.stack([np.cos(a), np.sin(a)])
        return l * np.stack([np.sin(a), -np.cos(a)]), l * rate * along

    return system, exact


def turning_wire(w):
    system = System(
        lambda q, v, t, *, w: (v[0] ** 2 + v[1] ** 2) / 2,
        ["x", "y"],
        parameters={"w": w},
        constraint=lambda q, t, *, w: q[0] * np.sin(w * t) - q[1] * np.cos(w * t),
    )

    def exact(t):
        along = np.stack([np.cos(w * t), np.sin(w * t)])
        across = np.stack([-np.sin(w * t), np.cos(w * t)])
        return np.cosh(w * t) * along, w * (np.sinh(w * t) * along + np.cosh(w * t) * across)

    return system, exact


def damped(c, drive):
    """Oscillator of frequency 2 with friction -c v and a drive cos(drive t)."""
    system = System(
        lambda q, v, t: v[0] ** 2 / 2 - 2 * q[0] ** 2,
        ["x"],
        parameters={"c": c, "drive": drive},
        force=lambda q, v, t, *, c, drive: [np.cos(drive * t) - c * v[0]],
    )
    root = -c / 2 + 1j * np.sqrt(4 - c**2 / 4)
    steady = 1 / (4 - drive**2 + 1j * c * drive)

    def exact(t):
        own, forced = 0.5 * np.exp(root * t), steady * np.exp(1j * drive * t)
        x, rate = own + forced, root * own + 1j * drive * forced
        return x.real[None, ...], rate.real[None, ...]

    return system, exact


def growing(gamma, w):
    """L = exp(gamma t)(v^2 - w^2 x^2)/2: H is not conserved, though no force acts."""
    system = System(
        lambda q, v, t, *, gamma, w: np.exp(gamma * t) * (v[0] ** 2 - (w * q[0]) ** 2) / 2,
        ["x"],
        parameters={"gamma": gamma, "w": w},
    )
    root = -gamma / 2 + 1j * np.sqrt(w**2 - gamma**2 / 4)

    def exact(t):
        z = np.exp(root * t)
        return z.real[None, ...], (root * z).real[None, ...]

    return system, exact


MOTIONS = {
    "oscillator": (OSCILLATOR, oscillation(2.0)),
    "pendulum": pendulum(2.0, 1.3, 9.81),
    "turning wire": turning_wire(0.8),
    "damped and driven": damped(0.5, 1.7),
    "growing": growing(0.4, 2.0),
}


# -- motions ---------------------------------------------------------------------------------


@pytest.mark.parametrize("name", MOTIONS)
@pytest.mark.parametrize("t1", [1.0, 3.0])
def test_motions_agree_and_their_energy_balances(name, t1):
    found = compare(between(*MOTIONS[name], 0.0, t1))
    assert found.agrees
    for number in (found.position, found.velocity, found.arrival, found.local):
        assert number < ACCURATE
    # From the motions themselves, not from forward integration: round-off, and the quadrature
    # of the work on elements that resolve the motion to 1e-12.
    assert found.energy_drift < 1e-11
    assert found.arrival <= found.position


@pytest.mark.parametrize("name", ["turning wire", "damped and driven", "growing"])
def test_work_is_done_where_the_energy_balance_says_so(name):
    system, exact = MOTIONS[name]
    t = np.array([0.0, 3.0])
    before, after = system.energy(*exact(t), t)
    assert abs(after - before) > 0.1  # or the balance would hold whatever the work


@pytest.mark.parametrize("name", ["damped and driven", "growing"])
def test_energy_balance_sees_work_that_is_wrong(name):
    """The same curve under parameters a hundredth larger."""
    system, exact = MOTIONS[name]
    curve = between(system, exact, 0.0, 2.0)
    changed = {key: 1.01 * value for key, value in system.parameters.items()}
    curve.problem = Problem(system, curve.problem.start, curve.problem.end, parameters=changed)
    assert compare(curve).energy_drift > 1e-4


def test_unstable_motion_agrees_piece_by_piece():
    """A double pendulum amplifies an error of 1e-7 so that at the end nothing is left of it."""
    start = State(0.0, [2.5, 1.0], [0.0, 0.0])
    rough = integrate(DOUBLE, start, 60.0, tol=1e-7)

    def exact(t):
        return rough(t), rough.velocity(t)

    curve = between(DOUBLE, exact, 0.0, 60.0, error=1e-7, elements=200)
    found = compare(curve)
    assert found.position > 1e3 * found.allowed
    assert found.local < found.allowed
    assert found.agrees
    assert found.reference_error > 1e-9  # amplified as well, and said


def test_motion_whose_every_element_is_unstable():
    """The pendulum from its upper rest round to it: errors grow by e^20 in an element."""
    system = System(lambda q, v, t: v[0] ** 2 / 2 + np.cos(q[0]), ["angle"])

    def exact(t):
        return 4 * np.arctan(np.exp(t))[None, ...] - np.pi, 2 / np.cosh(t)[None, ...]

    found = compare(between(system, exact, -40.0, 40.0, elements=4))
    assert found.position > 1 and found.amplified > 1  # the whole tells nothing
    assert found.agrees

    def late(t):  # the energy is wrong by 1e-6 of the kinetic energy
        q, v = exact(t)
        return q, (1 + 5e-7) * v

    assert not compare(between(system, late, -40.0, 40.0, elements=4)).agrees


@pytest.mark.parametrize(("length", "time"), [(1.0, 1.0), (1e-10, 1e-15), (1.5e11, 3e7)])
def test_deviations_have_no_units(length, time):
    """A circular orbit whose radius is wrong by 1e-6, on any scale."""
    mu = length**3 / time**2
    system = System(
        lambda q, v, t, *, mu: (v[0] ** 2 + v[1] ** 2) / 2 + mu / np.hypot(q[0], q[1]),
        ["x", "y"],
        parameters={"mu": mu},
    )

    def exact(t):
        a, r = t / time, length * (1 + 1e-6)
        along, across = np.stack([np.cos(a), np.sin(a)]), np.stack([-np.sin(a), np.cos(a)])
        return r * along, r / time * across

    found = compare(between(system, exact, 0.0, 3 * time))
    # Radius r (1 + d) at the rate 1: the speed is 1.5 d above that of the circle, so that in
    # linear theory the motion moves out by 3 d (1 - cos t) and stays behind by 6 d (t - sin t).
    out, behind = 3 * (1 - np.cos(3)), 6 * (3 - np.sin(3))
    off = out * np.sin(3) - behind * np.cos(3)  # in y, whose size is r
    assert found.position == pytest.approx(off * 1e-6, rel=1e-3)
    assert not found.agrees


def test_coordinate_that_stays_zero_is_measured_by_the_others():
    def exact(t):
        return np.stack([1 + t, 1e-13 * np.cos(t)]), np.stack([1 + 0 * t, -1e-13 * np.sin(t)])

    found = compare(between(FREE, exact, 0.0, 1.0))
    assert found.position < 1e-12
    assert found.velocity < 1e-12


def test_reference_error_covers_what_forward_integration_does_wrong():
    e, rate = 0.8, 1.0

    def exact(t):
        E = np.asarray(rate * t, dtype=float)
        mean = E
        for _ in range(60):
            E = E - (E - e * np.sin(E) - mean) / (1 - e * np.cos(E))
        b, speed = np.sqrt(1 - e * e), 1 / (1 - e * np.cos(E))
        return (
            np.stack([np.cos(E) - e, b * np.sin(E)]),
            speed * np.stack([-np.sin(E), b * np.cos(E)]),
        )

    for tol in (1e-3, 1e-6, 1e-9):
        found = compare(between(ORBIT, exact, 0.0, 7.0), tol=tol)
        assert found.position < 3 * found.reference_error
        assert found.reference_error < 1e3 * found.position


# -- what is no motion -----------------------------------------------------------------------


def test_wrong_start_velocity():
    system, exact = MOTIONS["pendulum"]

    def faster(t):
        q, v = exact(t)
        return q, 1.001 * v

    found = compare(between(system, faster, 0.3, 1.5))
    assert found.position > 1e-4
    assert found.local > 1e-5
    assert found.arrival > 1e-5
    assert not found.agrees


def test_start_that_is_not_the_curve_s_own():
    """The state at the start is a claim of its own, and so is compared with the curve."""

    class Claim(Curve):
        @property
        def start(self):
            return State(0.0, [1.0], [0.01])

    ends = Event(0.0, [1.0]), Event(3.0, [np.cos(6.0)])
    found = compare(Claim(Problem(OSCILLATOR, *ends), oscillation(2.0)))
    assert found.local > 1e-4
    assert not found.agrees


def test_other_lagrangian():
    found = compare(between(OSCILLATOR, oscillation(2.02), 0.0, 3.0))
    assert found.position > 1e-2
    assert found.local > 1e-4
    assert found.energy_drift > 1e-3
    assert not found.agrees


def test_small_errors_that_add_up_on_a_stable_motion():
    """Each piece is right to 1e-7, the whole is not, and no instability excuses it."""
    found = compare(
        between(OSCILLATOR, oscillation(2 + 2e-8), 0.0, 200.0, error=1e-9, elements=200)
    )
    assert found.local < found.allowed
    assert found.position == pytest.approx(200 * 2e-8, rel=0.2)
    assert found.amplified < 10 * found.allowed
    assert not found.agrees


@pytest.mark.parametrize("width", [1e-2, 1e-3])
def test_a_kick_that_the_curve_knows_or_not(width):
    system = System(
        lambda q, v, t, *, d: (
            v[0] ** 2 / 2 + q[0] * np.exp(-(((t - 0.613) / d) ** 2) / 2) / (d * np.sqrt(2 * np.pi))
        ),
        ["x"],
        parameters={"d": width},
    )

    def exact(t):
        u = (np.asarray(t) - 0.613) / width
        bell = np.exp(-(u**2) / 2) / np.sqrt(2 * np.pi)
        return width * (u * ndtr(u) + bell)[None, ...], ndtr(u)[None, ...]

    found = compare(between(system, exact, 0.0, 1.0))
    assert found.agrees
    assert max(found.position, found.local) < ACCURATE
    assert found.reference_error < ACCURATE

    def straight(t):
        return 0.1 * np.asarray(t)[None, ...], 0.1 + 0 * np.asarray(t)[None, ...]

    found = compare(between(system, straight, 0.0, 1.0))
    assert found.position > 1
    assert not found.agrees


def test_kink_between_two_motions_shows_locally():
    """Free motion that turns at t = 1, where elements meet: each piece alone is a motion."""

    def bent(t):
        side = np.where(np.asarray(t) < 1, -1.0, 1.0)
        return np.stack([side * (t - 1), 1 + 0 * t]), np.stack([side, 0 * side])

    found = compare(between(FREE, bent, 0.0, 2.0, elements=4))
    # Halfway from the middle of an element, 0.25 before the kink, the motion goes on straight.
    assert found.local == pytest.approx(0.5)
    assert found.position == pytest.approx(2.0)
    assert found.energy_drift < 1e-12  # the energy alone would not have told
    assert not found.agrees


def test_smooth_curve_between_the_right_events():
    def parabola(t):
        return (1 - t**2)[None, ...], (-2 * t)[None, ...]

    found = compare(between(OSCILLATOR, parabola, 0.0, 1.0))
    assert not found.agrees
    assert found.local > 1e-3


def test_no_claimed_error_excuses_a_curve_that_is_no_motion():
    found = compare(between(OSCILLATOR, oscillation(2.5), 0.0, 3.0, error=1.0))
    assert not found.agrees


def test_collision_on_the_way_of_the_motion():
    def through(t):  # straight through the centre
        return np.stack([1 - t, 1e-30 + 0 * t]), np.stack([-1 + 0 * t, 0 * t])

    with pytest.raises(IntegrationError, match="singularity"):
        compare(between(ORBIT, through, 0.0, 1.5))


# -- a solution ------------------------------------------------------------------------------


@pytest.mark.parametrize("end", [0.47, 0.470001, 1.2])
def test_a_solution_with_a_kick(end):
    from actionopt import solve

    system = System(
        lambda q, v, t: v[0] ** 2 / 2 + q[0] * np.exp(-(((t - 0.53) / 0.03) ** 2) / 2) / 0.0752,
        ["x"],
    )
    solution = solve(Problem(system, Event(0.0, [0.0]), Event(1.0, [end])), tol=1e-6)
    found = solution.compare()
    assert found.agrees
    assert found.path.mesh.elements < 100


def test_solution_compares_itself():
    from actionopt import solve

    start = State(0.0, [1.0, 0.3], [0.0, 0.0])
    end = integrate(DOUBLE, start, 2.0)(2.0)
    solution = solve(Problem(DOUBLE, Event(0.0, start.q), Event(2.0, end)), tol=1e-9)
    found = solution.compare()
    assert isinstance(found.path, Path)
    assert found.agrees
    assert found.position < 1e-9
    assert solution.compare() is found
