"""All the paths against independent searches: Lambert's problem, dense shooting, closed forms."""

import signal
from dataclasses import replace

import numpy as np
import pytest
import systems
from helpers import integrated
from scipy.optimize import brentq

import actionopt as ao
from actionopt import scenes
from actionopt.families.all_paths import detected_angles, solve_all
from actionopt.families.searches import Sweep

VELOCITY_TOLERANCE = 1e-6
FILM = ao.System(lambda q, v, t: q[0] * np.sqrt(1 + v[0] ** 2), ["y"])
BRATU = ao.System(
    lambda q, v, t, *, lam: v[0] ** 2 / 2 - lam * np.exp(q[0]), ["u"], parameters={"lam": 1.0}
)
PENDULUM = systems.pendulum(g=9.81)


def kepler(dimensions, mu=1.0):
    def lagrangian(q, v, t, *, mu):
        return sum(u * u for u in v) / 2 + mu / np.sqrt(sum(x * x for x in q))

    return ao.System(lagrangian, list("xyz")[:dimensions], parameters={"mu": mu})


# -- one path, two, none ---------------------------------------------------------------------------


def test_projectile_has_one_path():
    found = solve_all(scenes.get("projectile").problem)
    assert len(found) == 1 and found.complete
    assert "no others" in str(found)


@pytest.mark.parametrize(
    ("lam", "actions"),
    [(1.0, [-1.0465167047946651, 16.440013090858122]),
     pytest.param(3.4, [-4.2594654167377802, -4.1830776405135700], marks=pytest.mark.slow),
     pytest.param(3.6, [], marks=pytest.mark.slow)],
)  # fmt: skip
def test_bratu(lam, actions):
    # Two paths up to lam = 3.513830719, none beyond; actions by quadrature of the closed form.
    problem = ao.Problem(BRATU, ao.Event(0.0, 0.0), ao.Event(1.0, 0.0), parameters={"lam": lam})
    found = solve_all(problem, tol=1e-9, starts=2, shots=8, continuations=1)
    assert [s.action for s in found] == pytest.approx(actions, rel=1e-8)
    assert found.indices == (0, 1)[: len(actions)]
    assert not found.complete and "may be others" in str(found)


@pytest.mark.parametrize(
    ("h", "areas"),
    [
        (0.5, [5.99179697580228191, 6.84565539431063018]),
        pytest.param(0.67, [], marks=pytest.mark.slow),
    ],
)
def test_soap_film(h, areas):
    # Catenoids between rings of radius 1 at -+h exist up to h = 0.662743419349.
    found = solve_all(ao.Problem(FILM, ao.Event(-h, 1.0), ao.Event(h, 1.0)))
    assert [2 * np.pi * s.action for s in found] == pytest.approx(areas, rel=1e-8)
    assert found.indices == (0, 1)[: len(areas)]


# -- windings --------------------------------------------------------------------------------------


def shooting(a, b, T, windings, fastest, steps=200):
    """Find all swings from a to b + 2 pi k by dense shooting: (k, v0, action, index), sorted."""

    def rate(t, y):
        q, v, _, eta, slope = y
        bend = -9.81 * np.cos(q) * eta
        return np.stack([v, -9.81 * np.sin(q), v**2 / 2 + 9.81 * np.cos(q), slope, bend])

    def run(v0):
        return integrated(rate, [a, v0, 0, 0, 1], 0, T, rtol=1e-11)

    grid, h = np.linspace(-fastest, fastest, 8001), T / steps
    y = np.zeros((5, grid.size))
    y[:2] = np.full(grid.size, a), grid
    for _ in range(steps):  # RK4, fixed steps: only brackets are taken from it
        k1 = rate(0, y)
        k2 = rate(0, y + h / 2 * k1)
        k3 = rate(0, y + h / 2 * k2)
        y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + rate(0, y + h * k3))
    result = []
    for k in range(-windings, windings + 1):
        target = b + 2 * np.pi * k
        for i in np.flatnonzero((y[0, :-1] - target) * (y[0, 1:] - target) < 0):
            ends = grid[i], grid[i + 1]
            v0 = brentq(lambda v0, target=target: run(v0)(T)[0] - target, *ends, xtol=1e-12)
            motion = run(v0)
            J = motion(np.linspace(0, T, 4001)[1:])[3]
            result.append((k, v0, motion(T)[2], int(np.sum(J[:-1] * J[1:] < 0))))
    return sorted(result, key=lambda row: row[2])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("a", "b", "T"), [(0.5, -0.3, 2.0), pytest.param(0.0, 1.0, 3.1, marks=pytest.mark.slow)]
)
def test_pendulum_with_windings(a, b, T):
    problem = ao.Problem(PENDULUM, ao.Event(0.0, a), ao.Event(T, b))
    found = solve_all(problem, windings=2, starts=2, continuations=2)
    expected = shooting(a, b, T, 2, 25.0)
    assert {k for k, *_ in expected} == set(range(-2, 3))
    assert found.angles == ("theta",)
    assert [w for (w,) in found.windings] == [k for k, *_ in expected]
    assert [s.action for s in found] == pytest.approx([S for *_, S, _ in expected], abs=1e-7)
    assert [s.start.v[0] for s in found] == pytest.approx([v for _, v, *_ in expected], abs=1e-6)
    assert list(found.indices) == [index for *_, index in expected]


def test_angles_are_recognised():
    def angles(name):
        problem = scenes.get(name).problem
        return [problem.system.coordinates[i] for i in detected_angles(problem)]

    assert angles("pendulum") == ["theta"]
    assert len(angles("double_pendulum")) == 2
    assert angles("kepler") == angles("projectile") == angles("oscillator") == []


def test_a_named_azimuth_winds():
    # A bead on a circle, its mass 1 + t: the Lagrangian does not show that phi is an angle.
    system = ao.System(lambda q, v, t: (1 + t) * v[0] ** 2 / 2, ["phi"])
    problem = ao.Problem(system, ao.Event(0.0, 0.0), ao.Event(1.0, 1.0))
    assert len(solve_all(problem)) == 1
    found = solve_all(problem, angles=["phi"], windings=2)
    exact = sorted(((1 + 2 * np.pi * k) ** 2 / 2 / np.log(2), (k,)) for k in range(-2, 3))
    assert [s.action for s in found] == pytest.approx([S for S, _ in exact])
    assert list(found.windings) == [k for _, k in exact]


# -- Lambert's problem ----------------------------------------------------------------------------


def lambert(r1, r2, T, mu=1.0):
    """Return initial velocities of all elliptic transfers in the plane, with their revolutions.

    D. Izzo, Celest. Mech. Dyn. Astron. 121 (2015), p. 1: x with a = s / (2 (1 - x^2)) solves
    T(x, N) for each number N of revolutions.
    """
    r1, r2 = np.array(r1), np.array(r2)
    R1, R2, c = np.hypot(*r1), np.hypot(*r2), np.hypot(*(r2 - r1))
    s = (R1 + R2 + c) / 2
    ahead = r1[0] * r2[1] - r1[1] * r2[0] > 0
    result = []
    for sense in (1, -1):
        lam = np.sqrt(1 - c / s) * (1 if (sense > 0) == ahead else -1)
        for N in range(8):

            def miss(x, N=N, lam=lam):
                y = np.sqrt(1 - lam**2 * (1 - x * x))
                psi = np.arccos(np.clip(x * y + lam * (1 - x * x), -1, 1))
                tof = ((psi + N * np.pi) / np.sqrt(1 - x * x) - x + lam * y) / (1 - x * x)
                return tof - T * np.sqrt(2 * mu / s**3)

            grid = np.cos(np.linspace(np.pi - 1e-3, 1e-3, 2001))
            f = miss(grid)
            for i in np.flatnonzero(f[:-1] * f[1:] < 0):
                x = brentq(miss, grid[i], grid[i + 1], xtol=1e-15)
                y = np.sqrt(1 - lam**2 * (1 - x * x))
                gamma, rho = np.sqrt(mu * s / 2), (R1 - R2) / c
                radial = gamma * ((lam * y - x) - rho * (lam * y + x)) / R1
                across = gamma * np.sqrt(1 - rho**2) * (y + lam * x) / R1
                out = r1 / R1
                result.append((N, radial * out + across * sense * np.array([-out[1], out[0]])))
    return result


@pytest.mark.parametrize(
    ("T", "revolutions", "options"),
    [
        (3.0, 0, {"starts": 0, "shots": 4, "continuations": 0}),
        pytest.param(10.0, 1, {}, marks=pytest.mark.slow),
        pytest.param(16.0, 2, {}, marks=pytest.mark.slow),
        pytest.param(22.0, 3, {}, marks=pytest.mark.slow),
    ],
)
def test_all_transfers_of_lamberts_problem(T, revolutions, options):
    r1, r2 = [1.0, 0.0], [0.0, 1.2]
    expected = lambert(r1, r2, T)
    assert max(N for N, _ in expected) == revolutions
    assert len(expected) == 2 + 4 * revolutions
    problem = ao.Problem(kepler(2), ao.Event(0.0, r1), ao.Event(T, r2))
    found = solve_all(problem, **options)
    for _, v in expected:
        assert min(np.max(np.abs(s.start.v - v)) for s in found) < VELOCITY_TOLERANCE
    assert len(found) == len(expected)


DER = {  # G. J. Der, Astrodynamics 102, example I, with more digits; km and s
    "events": ((2249.171260, 1898.007100, 5639.599193), (1744.495443, -4601.556054, 4043.864391)),
    "T": 1618.50,
    "paths": (
        ((1.9431218229230976, -4.3530001542555229, 4.5463043915155272), 111999.9244592963, 0),
        ((-2.0957280967613590, 3.9260219686343706, -4.9451681044701130), 297319.7184203919, 1),
    ),
}


@pytest.mark.slow
def test_both_ways_in_space():
    (r1, r2), T = DER["events"], DER["T"]
    problem = ao.Problem(kepler(3, 398600.4418), ao.Event(0.0, r1), ao.Event(T, r2))
    found = solve_all(problem, starts=2, shots=16, continuations=0)
    assert len(found) == 2
    for solution, (v, S, index) in zip(found, DER["paths"], strict=True):
        assert solution.start.v == pytest.approx(v, abs=1e-6)
        assert solution.action == pytest.approx(S, rel=1e-9)
        assert solution.morse_index == index


def test_shots_that_turn_more_often_than_asked_aim_at_no_end():
    free = systems.particle("angle x")
    problem = ao.Problem(free, ao.Event(0.0, [0.0, 0.0]), ao.Event(1.0, [1.0, 1.0]))
    run = Sweep(problem, 1e-8, (0,), 0, 1, None)
    run.begin()
    run._aim(np.array([[0.9, 20.0], [1.1, 1.0]]))
    assert run.tried["forward shots"] == 1 and len(run.found) == 1


# -- two angles ------------------------------------------------------------------------------------


def double_pendulum(y):
    """Rates of unit double pendulums (theta1, theta2, w1, w2), y (4, K), g = 9.81."""
    a, b, u, w = y
    g, s, c = 9.81, np.sin(a - b), np.cos(a - b)
    D = 2 - c * c
    du = (-s * c * u * u - s * w * w - 2 * g * np.sin(a) + g * np.sin(b) * c) / D
    dw = (2 * s * u * u + s * c * w * w + 2 * g * np.sin(a) * c - 2 * g * np.sin(b)) / D
    return np.stack([u, w, du, dw])


def swing(q0, v0, T, steps=400):
    y, h = np.concatenate([np.repeat(q0[:, None], v0.shape[1], axis=1), v0]), T / steps
    for _ in range(steps):
        k1 = double_pendulum(y)
        k2 = double_pendulum(y + h / 2 * k1)
        k3 = double_pendulum(y + h / 2 * k2)
        y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + double_pendulum(y + h * k3))
    return y[:2]


def random_shots(q0, q1, T, fastest, count, rng):
    """Return the distinct initial velocities that lead to q1, from `count` random shots."""
    v0 = rng.uniform(-fastest, fastest, (2, count))
    v = v0[:, np.max(np.abs(swing(q0, v0, T) - q1[:, None]), axis=0) < 0.5]
    for _ in range(12):  # Newton's method on all that came near
        h = 1e-6
        F = swing(q0, v, T) - q1[:, None]
        J = np.stack(
            [(swing(q0, v + h * e[:, None], T) - q1[:, None] - F) / h for e in np.eye(2)], axis=1
        )
        step = np.linalg.solve(np.moveaxis(J, 2, 0), F.T[..., None])[..., 0].T
        v = v - step / np.maximum(1, np.max(np.abs(step), axis=0))
    hit = np.max(np.abs(swing(q0, v, T) - q1[:, None]), axis=0) < 1e-7
    distinct = []
    for x in v[:, hit & (np.max(np.abs(v), axis=0) < fastest)].T:
        if all(np.max(np.abs(x - y)) > 1e-3 for y in distinct):
            distinct.append(x)
    return distinct


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_double_pendulum_against_ten_thousand_random_shots(seed):
    rng = np.random.default_rng(seed)
    scene = scenes.get("double_pendulum", m1=1.0, m2=1.0, l1=1.0, l2=1.0, g=9.81)
    q0, q1, T = rng.uniform(-1, 1, 2), rng.uniform(-1, 1, 2), rng.uniform(0.5, 1.2)
    shots = random_shots(q0, q1, T, 15.0, 10_000, rng)
    problem = ao.Problem(scene.problem.system, ao.Event(0.0, q0), ao.Event(T, q1))
    found = solve_all(problem, windings=0)
    assert len(found) >= len(shots)
    for v in shots:
        assert min(np.max(np.abs(s.start.v - v)) for s in found) < 1e-4


# -- ends that do not determine the path -----------------------------------------------------------

OSCILLATOR = systems.oscillator()
SPHERE = systems.particle("x y z", constraint=lambda q, t: (q @ q - 1) / 2)
POLAR = ao.System(lambda q, v, t: (v[0] ** 2 + np.sin(q[0]) ** 2 * v[1] ** 2) / 2, ["theta", "phi"])


def test_oscillations_of_half_a_period_are_a_family():
    """All are at -x0 then, S = 0 for each; and none is anywhere else."""
    found = solve_all(ao.Problem(OSCILLATOR, ao.Event(0.0, 1.0), ao.Event(np.pi, -1.0)))
    assert len(found) == 0 and not found.complete
    (member,) = found.families
    assert abs(member.action) < 1e-8 and member.status is ao.Status.DEGENERATE
    assert "a family" in str(found)
    found = solve_all(ao.Problem(OSCILLATOR, ao.Event(0.0, 1.0), ao.Event(np.pi, 0.5)))
    assert len(found) == len(found.families) == 0 and "family" not in str(found)


@pytest.mark.parametrize(
    ("system", "start", "end"),
    [
        (SPHERE, [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]),
        (POLAR, [np.pi / 2, 0.0], [np.pi / 2, np.pi]),
    ],
)
@pytest.mark.slow
def test_great_circles_between_antipodes_are_a_family(system, start, end):
    problem = ao.Problem(system, ao.Event(0.0, start), ao.Event(1.0, end))
    found = solve_all(problem, windings=0, starts=3, shots=4, continuations=1)
    assert len(found) == 0
    assert [s.action for s in found.families] == pytest.approx([np.pi**2 / 2])
    assert "a family" in str(found)


@pytest.mark.slow
def test_what_is_singular_on_the_way_ends_no_search():
    """At the pole the azimuth has no inertia; on the way to -x Kepler's force is infinite."""
    polar = ao.Problem(POLAR, ao.Event(0.0, [0.0, 0.0]), ao.Event(1.0, [1.0, 0.5]))
    kepler_line = ao.Problem(
        kepler(3), ao.Event(0.0, [1.0, 0.0, 0.0]), ao.Event(3.0, [-1.0, 0.0, 0.0])
    )
    for problem in (polar, kepler_line):
        str(solve_all(problem, windings=0, starts=2, shots=4, continuations=1))


def test_what_solve_refuses_is_refused():
    twice = systems.particle("x y", constraint=lambda q, t: [q[0] - q[1], q[1] - q[0]])
    problem = ao.Problem(twice, ao.Event(0.0, [0.0, 0.0]), ao.Event(1.0, [1.0, 1.0]))
    with pytest.raises(ValueError, match="expected independent constraints"):
        solve_all(problem, starts=2)


@pytest.mark.parametrize("error", [ValueError("operands could not be broadcast"), TypeError("no")])
def test_defects_are_not_swallowed(monkeypatch, error):
    def broken(*_, **__):
        raise error

    monkeypatch.setattr("actionopt.families.searches.solve", broken)
    with pytest.raises(type(error), match=str(error)):
        solve_all(ao.Problem(PENDULUM, ao.Event(0.0, 0.5), ao.Event(2.0, -0.3)))


@pytest.mark.slow
@pytest.mark.parametrize(
    "error", [np.linalg.LinAlgError("Singular matrix"), ValueError("expected")]
)
def test_a_solve_that_fails_is_left_out(monkeypatch, error):
    whole = ao.solve

    def fails_from_a_guess(problem, guess=None, **options):
        if guess is not None:
            raise error
        return whole(problem, **options)

    monkeypatch.setattr("actionopt.families.searches.solve", fails_from_a_guess)
    problem = ao.Problem(PENDULUM, ao.Event(0.0, 0.5), ao.Event(2.0, -0.3))
    found = solve_all(problem, windings=0, starts=2, continuations=0)
    assert set(found.found_by) == {"a straight line"}


# -- free ends -------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_path_a_turn_farther_is_the_same_where_an_end_is_free():
    start, end = ao.Event(0.0, [None]), ao.Event(0.3, [0.1])
    found = solve_all(ao.Problem(PENDULUM, start, end), starts=1, continuations=1)
    assert len(found) == 1 and found.angles == ()
    found = solve_all(ao.Problem(PENDULUM, start, start.at(0.3)), starts=2, continuations=1)
    assert [s.action for s in found] == pytest.approx([-0.3 * 9.81, 0.3 * 9.81])


# -- the search itself ---------------------------------------------------------------------------


def test_the_summary_counts_what_was_left_out():
    problem = ao.Problem(systems.particle(), ao.Event(0.0, 0.0), ao.Event(1.0, 2.0))
    found = solve_all(problem)
    assert "left out" not in str(found)
    assert "left out: 3 that forward motion" in str(replace(found, rejected=3))
    assert "left out: 2 that return" in str(replace(found, kinked=2))


def test_progress_and_interruption():
    problem = ao.Problem(PENDULUM, ao.Event(0.0, 0.5), ao.Event(2.0, -0.3))
    told = []

    def progress(stage, done, total, detail):
        told.append((stage, done, total, detail))
        if stage == "deflated starts":
            raise KeyboardInterrupt

    found = solve_all(problem, progress=progress)
    assert found.interrupted and len(found) >= 3
    assert {how for how, *_ in told} >= {"straight line", "least starts", "shots"}
    assert all(done <= total for _, done, total, _ in told)
    assert "interrupted" in str(found)


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no timers that send signals")
@pytest.mark.parametrize("after", [0.02, 0.3])
def test_an_interruption_ends_the_search_and_keeps_what_it_has(after):
    """Wherever it comes, the signal is no failure of what it interrupts."""
    problem = ao.Problem(PENDULUM, ao.Event(0.0, 0.5), ao.Event(14.0, -0.3))
    first = []

    def progress(stage, done, total, detail):
        if detail["found"] and not first:
            first.append(detail["found"])
            signal.setitimer(signal.ITIMER_REAL, after)

    before = signal.signal(signal.SIGALRM, signal.default_int_handler)
    try:
        found = solve_all(problem, progress=progress)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    assert found.interrupted and len(found) >= first[0]


@pytest.mark.slow
def test_each_path_agrees_with_forward_motion():
    problem = ao.Problem(PENDULUM, ao.Event(0.0, 0.0), ao.Event(1.0, 1.0))
    for solution in solve_all(problem, starts=2, continuations=0):
        assert solution.compare().agrees


def test_a_comparison_that_cannot_tell_contradicts_nothing(monkeypatch):
    undecided = type("Undecided", (), {"agrees": None})()
    monkeypatch.setattr(ao.Solution, "compare", lambda _: undecided)
    problem = ao.Problem(PENDULUM, ao.Event(0.0, 0.0), ao.Event(1.0, 1.0))
    assert len(solve_all(problem, starts=2, shots=0, continuations=0)) >= 3


@pytest.mark.slow
def test_forced_motion():
    system = systems.pendulum(g=9.81, force=lambda q, v, t: [-0.3 * v[0]])
    problem = ao.Problem(system, ao.Event(0.0, 0.5), ao.Event(1.0, -0.3))
    found = solve_all(problem, windings=1, starts=1, shots=8, continuations=1)
    assert sorted(set(found.windings)) == [(-1,), (0,), (1,)]


def test_bad_arguments():
    problem = ao.Problem(PENDULUM, ao.Event(0.0, 0.0), ao.Event(1.0, 1.0))
    for angles in (["phi"], "theta", [0], 3):
        with pytest.raises(ValueError, match="angles among theta"):
            solve_all(problem, angles=angles)
    for count in (-1, 0.5, None, "many"):
        with pytest.raises(ValueError, match=">= 0"):
            solve_all(problem, shots=count)
    for tol in (0, 1.0, None, "1e-8"):
        with pytest.raises(ValueError, match="tol between 1e-14"):
            solve_all(problem, tol=tol)
    for nothing in (None, PENDULUM):
        with pytest.raises(ValueError, match="expected a Problem"):
            solve_all(nothing)


def test_between_two_shots_on_either_side_of_the_end_is_one_that_meets_it(monkeypatch):
    system = systems.pendulum("angle")
    problem = ao.Problem(system, ao.Event(0.0, [0.2]), ao.Event(3.0, [0.5]))
    sweep, met = Sweep(problem, 1e-8, (), 0, 0, None), []
    sweep.begin()
    monkeypatch.setattr(sweep, "_take_arrivals", lambda classes, v0: met.extend(v0[0]))
    sweep._bracket(np.linspace(-3.0, 3.0, 7))
    assert met
    for v in met:
        angle, _ = integrated(lambda t, y: [y[1], -np.sin(y[0])], [0.2, v], 0.0, 3.0)(3.0)
        assert angle == pytest.approx(0.5, abs=0.02)


def test_every_passage_of_an_oscillator_through_a_point():
    """x = +-sin t: at 1/2 twice a turn, either way round."""
    problem = ao.Problem(OSCILLATOR, ao.Event(0.0, [0.0]), ao.Event(None, [0.5]), energy=0.5)
    found = solve_all(problem, windings=4)
    times = 6 / np.pi * np.sort([s.duration for s in found])  # in twelfths of a turn
    assert times[:9] == pytest.approx([1, 5, 7, 11, 13, 17, 19, 23, 25])
