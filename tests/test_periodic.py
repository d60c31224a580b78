"""Paths that close, against closed forms and against shooting with scipy."""

import numpy as np
import pytest
import systems
from helpers import a_quarter, slow
from scipy.special import ellipk

import actionopt as ao
from actionopt import Periodic, plot, scenes
from actionopt.analysis.quadratic import shooting
from actionopt.analysis.spectra.monodromy import Monodromy
from actionopt.discrete.borders.borders import PhaseCondition

CLOSED = 1e-10  # return of position and momentum


def driven(damping=0.0, stiff=4.0, drive=0.7, w=1.5, cubic=0.0):
    def lagrangian(q, v, t, *, k, a, w, c):
        return v[0] ** 2 / 2 - k * q[0] ** 2 / 2 - c * q[0] ** 4 / 4 + a * np.cos(w * t) * q[0]

    parameters = {"k": stiff, "a": drive, "w": w, "c": cubic}
    if not damping:
        return ao.System(lagrangian, ["x"], parameters=parameters)
    parameters["b"] = damping
    return ao.System(
        lagrangian, ["x"], parameters=parameters, force=lambda q, v, t, *, b: [-b * v[0]]
    )


@pytest.mark.long
@pytest.mark.parametrize(("w", "b"), [(1.5, 0.0), (5.0, 0.0), (1.5, 0.4)])
def test_steady_oscillation(w, b):
    """x = Re a e^(iwt) / (k - w^2 + i b w), the one motion with the period of the drive."""
    T = 2 * np.pi / w
    problem = ao.Problem(driven(damping=b, w=w), ao.Event(0.0, [None]), Periodic(T))
    solution = ao.solve(problem, tol=1e-11)
    t = np.linspace(0, T, 31)
    exact = (0.7 / (4.0 - w**2 + 1j * b * w) * np.exp(1j * w * t)).real
    assert np.max(np.abs(solution(t)[0] - exact)) < CLOSED
    assert closes(solution)


def test_circle_round_a_cone():
    """The azimuth is given and advances by a turn, the distance is free to close: a circle."""
    w = 4.0
    scene = scenes.get("inverted_cone", w=w)
    end = Periodic(2 * np.pi / w, advance=[0.0, 2 * np.pi])
    problem = ao.Problem(
        scene.problem.system,
        ao.Event(0.0, [None, 0.0]),
        end,
        parameters=scene.problem.parameters,
    )
    guess = lambda t: np.stack([0.9 * scene.facts["circle"] + 0 * t, w * t])  # noqa: E731
    solution = ao.solve(problem, tol=1e-11, guess=guess)
    t = np.linspace(0, end.t, 21)
    assert np.max(np.abs(solution(t)[0] - scene.facts["circle"])) < CLOSED
    assert np.max(np.abs(solution(t)[1] - w * t)) < CLOSED
    assert np.max(np.abs(solution.momenta[0] - solution.momenta[1])) < CLOSED
    # the problem may be taken over with other numbers, and still closes
    again = ao.Problem(problem.system, problem.start, problem.end, parameters={"g": 8.0})
    assert isinstance(again.end, Periodic) and again.end.q == (None, 2 * np.pi)


@pytest.mark.long
def test_closed_path_on_a_moving_constraint():
    """A pendulum in Cartesian coordinates, its pivot shaken, against the same in its angle."""
    w, A, l, g = 3.0, 0.2, 1.0, 9.81
    T = 2 * np.pi / w

    def angle(q, v, t):
        x = l * np.cos(q[0]) * v[0] - A * w * np.sin(w * t)
        y = l * np.sin(q[0]) * v[0]
        return (x**2 + y**2) / 2 + g * l * np.cos(q[0])

    rod = systems.thrown(
        g=g, constraint=lambda q, t: (q[0] - A * np.cos(w * t)) ** 2 + q[1] ** 2 - l**2
    )
    free = ao.solve(
        ao.Problem(ao.System(angle, ["a"]), ao.Event(0.0, [None]), Periodic(T)),
        tol=1e-11,
        guess=lambda t: 0 * t,  # the least one stands on its head
    )
    problem = ao.Problem(rod, ao.Event(0.0, [None, None]), Periodic(T))
    held = ao.solve(problem, tol=1e-11, guess=lambda t: np.stack([0 * t, -l + 0 * t]))
    t = np.linspace(0, T, 21)
    a = free(t)[0]
    assert np.ptp(a) > 0.05
    exact = np.stack([A * np.cos(w * t) + l * np.sin(a), -l * np.cos(a)])
    assert np.max(np.abs(held(t) - exact)) < 10 * CLOSED
    assert abs(held.action - free.action) < 10 * CLOSED
    assert abs(held.lam[0, 0] - held.multipliers(0.0)[0]) < 1e-6  # one class less accurate


def test_a_guess_of_one_element_leads_to_a_closed_path():
    w = 1.5
    driven = ao.System(
        lambda q, v, t: v[0] ** 2 / 2 - 2 * q[0] ** 2 + 0.7 * np.cos(w * t) * q[0], ["x"]
    )
    problem = ao.Problem(driven, ao.Event(0.0, [None]), Periodic(2 * np.pi / w))
    mesh = ao.Mesh([0.0, 2 * np.pi / w], [10])
    guess = ao.Path.interpolate(lambda t: 0.3 * np.cos(w * t), mesh)
    assert ao.solve(problem, guess=guess).start.q[0] == pytest.approx(0.7 / (4 - w**2), rel=1e-8)


def test_what_does_not_fit_is_refused():
    system = driven()
    with pytest.raises(ValueError, match="advance of 1 coordinates, found 2"):
        ao.Problem(system, ao.Event(0, [None]), Periodic(1.0, advance=[0.0, 1.0]))
    with pytest.raises(ValueError, match="finite number for advance 0"):
        Periodic(1.0, advance=[np.nan])
    with pytest.raises(ValueError, match="after the start"):
        ao.Problem(system, ao.Event(0, [None]), Periodic(-1.0))
    problem = ao.Problem(system, ao.Event(0, [None]), Periodic(1.0))
    with pytest.raises(ValueError, match="two elements"):
        ao.solve(problem, mesh=ao.Mesh.uniform(0.0, 1.0, 1, 8))
    with pytest.raises(ValueError, match="conjugate"):
        ao.conjugate_points(ao.solve(problem))


def test_a_closed_path_without_a_clock_begins_anywhere_along_itself():
    pendulum = systems.pendulum()
    for start in (None, 0.5):
        problem = ao.Problem(pendulum, ao.Event(0.0, [start]), ao.Periodic(8.0))
        found = ao.solve(problem, guess=lambda t: [1.2 * np.cos(2 * np.pi * t / 8)], tol=1e-11)
        assert np.max(np.abs(found.momenta[1] - found.momenta[0])) < CLOSED
        assert start is None or abs(found.start.q[0] - start) < CLOSED
        # T = 4 K(sin(a / 2)) with the amplitude a
        a = np.abs(found(np.linspace(0, 8, 4001))[0]).max()
        assert 4 * ellipk(np.sin(a / 2) ** 2) == pytest.approx(8.0, rel=1e-5)


# -- all of them -----------------------------------------------------------------------------------

FREE = ao.Event(0.0, [None])


def closes(solution):
    p0, p1 = solution.momenta
    returned = solution.end.q - solution.start.q - solution.problem.advance
    assert isinstance(solution.problem.end, Periodic)
    assert np.max(np.abs(returned)) < CLOSED and np.max(np.abs(p1 - p0)) < CLOSED
    assert solution.compare().agrees
    return True


def test_all_steady_oscillations_of_a_linear_one():
    """With its clock shifted, so that free ends and closed ones are not the same."""
    system = ao.System(
        lambda q, v, t: v[0] ** 2 / 2 - 2 * q[0] ** 2 + 0.7 * np.cos(1.5 * t + 0.3) * q[0], ["x"]
    )
    found = ao.solve_all(ao.Problem(system, FREE, Periodic(2 * np.pi / 1.5)), tol=1e-11)
    assert len(found) == 1 and found.complete and closes(found[0])
    assert abs(found[0].start.q[0] - 0.4 * np.cos(0.3)) < CLOSED
    assert found.indices == (3,) and "index 3" in str(found)  # a constant, and one turn


@pytest.mark.slow
def test_rotations_of_a_driven_pendulum_wind():
    """Its windings are advances; the whole path a turn farther is no other path."""
    a, w = 0.8, 2.0
    T = 2 * np.pi / w
    system = ao.System(lambda q, v, t: v[0] ** 2 / 2 + np.cos(q[0] - a * np.cos(w * t)), ["theta"])
    found = ao.solve_all(ao.Problem(system, FREE, Periodic(T)), starts=1, shots=12, continuations=0)
    assert found.angles == ("theta",) and set(found.windings) == {(-1,), (0,), (1,)}
    for s, (k,) in zip(found, found.windings, strict=True):
        assert closes(s) and s.problem.advance == pytest.approx([2 * np.pi * k])
    places = [(k, np.exp(1j * s.start.q[0]), s.start.v[0])
              for s, k in zip(found, found.windings, strict=True)]  # fmt: skip
    for i, (k, q, v) in enumerate(places):
        assert all(k != l or abs(q - p) + abs(v - u) > 1e-5 for l, p, u in places[:i])


@pytest.mark.slow
def test_what_comes_back_with_a_kink_is_left_out():
    """Of the paths that return to x = 1 after 4 only those that close; and none that does not."""
    problem = ao.Problem(systems.spring(), ao.Event(0.0, [1.0]), Periodic(4.0))
    found = ao.solve_all(problem, starts=2, shots=20, continuations=0)
    assert len(found) >= 2 and all(closes(s) for s in found)
    # both ways through x = 1 on the one orbit of that period
    assert sorted(round(float(s.start.v[0]), 6) for s in found)[0] < 0
    H = [float(s.energy(0.0)) for s in found]
    orbits = [h for h in H if abs(h - min(H)) < 1e-7]
    assert len(orbits) == 2
    # Under a clock no orbit may be begun elsewhere to pass the start: what returns has a kink.
    pushed = systems.spring(push=lambda t: 0.3 * np.cos(np.pi * t / 2))
    problem = ao.Problem(pushed, problem.start, Periodic(4.0))
    found = ao.solve_all(problem, starts=2, shots=20, continuations=0)
    assert all(closes(s) for s in found)
    assert found.kinked >= 1 and "in a kink" in str(found)


def test_closed_paths_without_a_clock_come_in_families():
    pendulum = systems.pendulum()
    with pytest.raises(ValueError, match="give one coordinate at the start"):
        ao.solve_all(ao.Problem(pendulum, FREE, Periodic(8.0)))
    linear = systems.oscillator()
    (rest,) = ao.solve_all(ao.Problem(linear, FREE, Periodic(3.0)))
    assert np.max(np.abs(rest.path.values)) < CLOSED


def test_no_motion_is_shot_off_a_surface_to_close():
    rod = ao.System(
        lambda q, v, t: v @ v / 2 - q[1] + 0.1 * np.cos(3 * t) * q[0],
        ["x", "y"],
        constraint=lambda q, t: (q[0] - 2) ** 2 + q[1] ** 2 - 1,
    )
    problem = ao.Problem(rod, ao.Event(0.0, [None, None]), Periodic(2 * np.pi / 3))
    found = ao.solve_all(problem, starts=0, shots=8, continuations=0)
    assert len(found) and "forward shots" not in found.searched


@pytest.fixture(scope="module")
def steady():
    return ao.solve(ao.Problem(driven(), FREE, Periodic(2 * np.pi / 1.5)), tol=1e-10)


@pytest.mark.long
def test_an_orbit_without_a_clock_is_followed_by_its_period():
    """A pendulum of the amplitude 2 swings in T = 4 K(sin^2 1), with the energy -cos 2."""
    asked = ao.Problem(systems.pendulum(), ao.Event(0.0, [0.0]), Periodic(8.0))
    T = 4 * ellipk(np.sin(1.0) ** 2)
    family = ao.trace(asked, "t1", T, guess=lambda t: [1.9 * np.sin(np.pi * t / 4)], count=False)
    assert family.values[-1] == T
    assert family.solution(-1).energy(0.0) == pytest.approx(-np.cos(2.0), abs=1e-8)


@pytest.mark.long
def test_a_closed_path_stays_closed_along_a_family(steady):
    for vary, to in (("k", 6.0), ("t1", 3.9), ("t0", 0.2)):
        family = ao.trace(steady.problem, vary, to, count=False)
        last = family.solution(-1)
        assert family.values[-1] == to and closes(last)
    held = steady.problem.replace(start=ao.Event(0.0, [0.3]))
    family = ao.trace(held, ("start", "x"), 0.5, count=False)
    assert family.solution(-1).problem.end.q == (0.5,)
    with pytest.raises(ValueError, match="closes on the start"):
        ao.trace(held, ("end", "x"), 0.5, count=False)


def test_what_else_there_is_of_a_closed_path(steady, tmp_path):
    """It closes there, too, or a sentence says that it cannot be asked."""
    steady.save(tmp_path / "steady.npz")
    for again in (ao.load(tmp_path / "steady.npz"), ao.load(tmp_path / "steady.npz", driven())):
        assert isinstance(again.problem.end, Periodic) and again.problem.advance == [0.0]
    newton = plot.relaxation_data(steady, method="newton")
    assert newton.arrived and np.allclose(newton.paths[:, :, 0], newton.paths[:, :, -1])
    h, problem = 1e-4, steady.problem
    S = [ao.solve(problem.replace(end=problem.end.at(problem.end.t + d))).action for d in (-h, h)]
    assert steady.sensitivity().t1 == pytest.approx((S[1] - S[0]) / (2 * h), rel=1e-5)
    refused = (
        lambda: ao.conjugate_points(steady),
        lambda: ao.variation(steady, lambda t: [t]),
        lambda: plot.fan_data(steady),
        lambda: plot.fronts_data(steady),
    )
    for ask in refused:
        with pytest.raises(ValueError, match=r"closed path|closes"):
            ask()
    with pytest.raises(ValueError, match="found one that does not"):
        plot.spectrum_data(steady)
    with pytest.raises(ValueError, match="a path that closes"):
        plot.explore(steady.problem)


# -- the index: variations that close ------------------------------------------------------------


def driven_oscillator(w, c, T, start=None):
    def lagrangian(q, v, t, *, w, c, W):
        return v[0] ** 2 / 2 - (w * q[0]) ** 2 / 2 + c * np.cos(W * t) * q[0]

    system = ao.System(lagrangian, ["x"], parameters={"w": w, "c": c, "W": 2 * np.pi / T})
    return ao.Problem(system, ao.Event(0.0, [start]), Periodic(T))


@pytest.mark.quick("0.7-2.9--1.1", "3.5-1.3-0.7", "3.5-2.9--1.1")
@pytest.mark.parametrize(("w", "c"), [(1.3, 0.7), (2.9, -1.1)])
@pytest.mark.parametrize("T", [0.7, 3.5, 14.0, *slow(2.0, 5.5, 9.0)])
def test_index_and_modes_of_a_driven_oscillator(w, c, T):
    # eta = 1, cos, sin of 2 pi k t / T, with eigenvalues (2 pi k / T)^2 - w^2
    solution = ao.solve(driven_oscillator(w, c, T))
    assert solution.morse_index == 1 + 2 * int(w * T / (2 * np.pi))
    assert solution.kind == "saddle"
    found = ao.second_variation(solution, 5)
    exact = (2 * np.pi * np.array([0, 1, 1, 2, 2]) / T) ** 2 - w**2
    assert found.eigenvalues == pytest.approx(exact, rel=1e-9, abs=1e-9)
    assert found.modes[0](T / 3) == pytest.approx(found.modes[0](0.0), abs=1e-7)  # a constant
    for mode in found.modes:
        assert mode.values[:, -1] == pytest.approx(mode.values[:, 0], abs=1e-14)
        assert mode.velocity(T) == pytest.approx(mode.velocity(0.0), abs=1e-4)
        times = np.linspace(0.0, T, 2001)[:-1]
        assert np.mean(mode(times) ** 2) * T == pytest.approx(1.0, rel=1e-7)


@pytest.mark.quick("1.3-2.0", "1.3-5.5")
@pytest.mark.parametrize(("w", "T"), [(1.3, 2.0), (1.3, 5.5), (2.9, 9.0)])
def test_a_coordinate_given_at_the_start_is_pinned_at_both_ends(w, T):
    solution = ao.solve(driven_oscillator(w, 0.7, T, start=0.4))
    assert solution.morse_index == int(w * T / np.pi)
    exact = (np.pi * np.arange(1, 4) / T) ** 2 - w**2
    assert ao.second_variation(solution, 3).eigenvalues == pytest.approx(exact, rel=1e-9)


def closed_eigenvalues(A, B, C, T, n, order=40, samples=320):
    """Return the eigenvalues of int (eta.A eta + 2 eta.B eta' + eta'.C eta') on Fourier sums."""
    t = np.arange(samples) * T / samples
    k = np.arange(1, order + 1) * 2 * np.pi / T
    waves = [np.full((1, samples), np.sqrt(1 / T))]
    rates = [np.zeros((1, samples))]
    for f, df in ((np.cos, lambda x: -np.sin(x)), (np.sin, np.cos)):
        waves.append(np.sqrt(2 / T) * f(np.outer(k, t)))
        rates.append(np.sqrt(2 / T) * k[:, None] * df(np.outer(k, t)))
    f, g = np.concatenate(waves), np.concatenate(rates)
    a, b, c = (np.stack([X(s) for s in t]) for X in (A, B, C))
    H = np.einsum("it,tab,jt->iajb", f, a, f, optimize=True)
    mixed = np.einsum("it,tab,jt->iajb", f, b, g, optimize=True)
    H += mixed + mixed.transpose(2, 3, 0, 1)
    H += np.einsum("it,tab,jt->iajb", g, c, g, optimize=True)
    return np.linalg.eigvalsh(H.reshape(len(f) * n, -1) * T / samples)


@pytest.mark.long
@pytest.mark.parametrize(
    ("T", "B", "F"),
    a_quarter([(11.0, 1.1, 2.0), (3.0, 0.5, 1.0), (6.0, 1.1, 2.0), (7.0, 0.5, 1.0)]),
)
def test_index_of_a_nonlinear_closed_path_against_fourier_sums(T, B, F):
    def lagrangian(q, v, t, *, W, B, F):
        drive = F * (np.cos(W * t) * q[0] + 0.4 * np.sin(W * t) * q[1])
        return (
            v @ v / 2
            + B * q[0] * v[1]
            - (q[0] ** 2 + 1.7 * q[1] ** 2 + 0.6 * (q @ q) ** 2) / 2
            + drive
        )

    names = {"W": 2 * np.pi / T, "B": B, "F": F}
    system = ao.System(lagrangian, ["x", "y"], parameters=names)
    solution = ao.solve(ao.Problem(system, ao.Event(0.0, [None, None]), Periodic(T)))

    def stiffness(t):
        q = solution(t)
        return -np.diag([1, 1.7]) - 0.3 * (4 * (q @ q) * np.eye(2) + 8 * np.outer(q, q))

    exact = closed_eigenvalues(
        stiffness, lambda t: np.array([[0, B], [0, 0]]), lambda t: np.eye(2), T, 2
    )
    assert np.min(np.abs(exact)) > 5e-6  # one is -6e-6
    assert solution.morse_index == np.sum(exact < 0)
    found = ao.second_variation(solution, 6).eigenvalues
    assert found == pytest.approx(exact[:6], rel=1e-5, abs=1e-5)


def test_an_orbit_without_a_clock_is_moved_along_itself():
    spring = systems.spring()
    pinned = ao.solve(
        ao.Problem(spring, ao.Event(0.0, [0.0]), Periodic(4.0)),
        guess=lambda t: [1.4 * np.sin(np.pi * t / 2)],
    )
    assert pinned.inertia.nullity == 0
    loose = ao.Problem(spring, ao.Event(0.0, [None]), Periodic(4.0))
    found = ao.solve(loose, guess=pinned, throw=False).inertia
    stiffness = lambda t: np.array([[-1 - 3 * pinned(t)[0] ** 2]])  # noqa: E731
    exact = closed_eigenvalues(stiffness, lambda t: np.zeros((1, 1)), lambda t: np.eye(1), 4.0, 1)
    assert (found.index, found.nullity) == (np.sum(exact < -1e-6), np.sum(np.abs(exact) < 1e-6))
    assert found.nullity == 1
    turning = systems.pendulum("a")
    once = Periodic(4.0, advance=[2 * np.pi])
    pinned = ao.solve(ao.Problem(turning, ao.Event(0.0, [0.0]), once))
    loose = ao.Problem(turning, ao.Event(0.0, [None]), once)
    assert ao.solve(loose, guess=pinned, throw=False).inertia.nullity == 1


@pytest.mark.quick("3.0-2-0")
@pytest.mark.parametrize(
    ("T", "index", "nullity"), [(2 * np.pi, 6, 4), (4 * np.pi, 14, 4), (3.0, 2, 0)]
)
def test_rests_that_oscillations_pass_are_degenerate(T, index, nullity):
    """One of k waves lowers S where k < T / pi; elements are as long as half of one."""
    plane = ao.System(lambda q, v, t: (v @ v - 4 * q @ q) / 2, ["x", "y"])
    problem = ao.Problem(plane, ao.Event(0.0, [None, None]), Periodic(T))
    found = ao.solve(problem, throw=False)
    assert found.status.name == ("DEGENERATE" if nullity else "SOLVED")
    assert (found.morse_index, found.inertia.nullity) == (index, nullity)


@pytest.mark.slow
def test_where_nothing_holds_a_free_body_it_may_be_moved():
    body = systems.particle("x y")
    for start, end in ((None, Periodic(3.0)), (None, ao.Event(3.0, [None, None]))):
        problem = ao.Problem(body, ao.Event(0.0, [start, start]), end)
        found = ao.solve(problem, throw=False).inertia
        assert (found.index, found.nullity) == (0, 2)


def test_sensitivity_of_a_closed_path_against_differences():
    T, h = 5.0, 1e-4
    problem = driven_oscillator(1.3, 0.7, T)
    drive = problem.parameters["W"]

    def action(t1=T, c=0.7):
        names = {**problem.parameters, "c": c, "W": drive}
        moved = ao.Problem(problem.system, problem.start, Periodic(t1), parameters=names)
        return ao.solve(moved, tol=1e-11).action

    slope = ao.solve(problem).sensitivity()
    assert slope.t1 == pytest.approx((action(T + h) - action(T - h)) / (2 * h), rel=1e-6)
    rate = (action(c=0.7 + h) - action(c=0.7 - h)) / (2 * h)
    assert slope.parameters["c"] == pytest.approx(rate, rel=1e-6)
    assert slope.q0 == slope.q1 == 0.0


def test_a_varied_closed_path_closes():
    T = 5.5
    solution = ao.solve(driven_oscillator(1.3, 0.7, T))
    moved = ao.variation(solution, lambda t: [1 + 0 * t])
    assert abs(moved.first) < 1e-10
    assert moved.second == pytest.approx(-(1.3**2) * T)
    with pytest.raises(ValueError, match="closes, found that x differs"):
        ao.variation(solution, lambda t: [t])


def test_a_closed_path_that_shrinks_to_a_rest_is_given_up_at_once():
    # all periods are below 2 pi / sqrt(0.6) = 8.1; the guess has a longer one, and hardly moves
    spring = ao.System(lambda q, v, t: v[0] ** 2 / 2 - 0.3 * q[0] ** 2 - 0.325 * q[0] ** 4, ["x"])
    problem = ao.Problem(spring, ao.Event(0.0, [0.0]), Periodic(12.3))
    found = ao.solve(problem, guess=lambda t: [0.24 * np.sin(2 * np.pi * t / 12.3)], throw=False)
    # How small it gets before that is noticed, round-off decides.
    assert found.status in (ao.Status.NOT_FOUND, ao.Status.UNRESOLVED)
    assert all(part["unknowns"] < 1000 for part in found.stats["rounds"])  # 300 000 otherwise


@pytest.mark.long
def test_a_rougher_neighbour_is_not_resolved_to_its_errors():
    spring = systems.spring()
    rough = ao.solve(ao.Problem(spring, ao.Event(0.0, [0.0]), Periodic(None), energy=5.0), tol=1e-3)
    near = ao.Problem(spring, ao.Event(0.0, [None]), Periodic(1.02 * rough.duration))
    fine = ao.solve(near, guess=rough, tol=1e-12)
    assert fine.mesh.elements < 50  # 278 of some 1e-9 otherwise
    assert fine.morse_index == 2


@pytest.mark.long
def test_what_moves_a_closed_path_is_no_direction_down_on_very_short_elements():
    spring = systems.spring()
    orbit = ao.solve(
        ao.Problem(spring, ao.Event(0.0, [None]), Periodic(None), energy=0.3), tol=1e-11
    )
    T = orbit.duration
    b = np.sort(np.concatenate([np.linspace(0, T, 9), 3 * T / 8 + 1e-8 * np.arange(1, 5)]))
    again = ao.solve(
        ao.Problem(spring, orbit.problem.start, Periodic(T)),
        guess=orbit,
        mesh=ao.Mesh(b, [16] * 12),
    )
    assert again.morse_index == orbit.morse_index == 2  # 3 by round-off otherwise
    assert again.inertia.moves == 1


@pytest.mark.quick("apart")
@pytest.mark.parametrize(
    ("n", "status"), [(8, ao.Status.FLOOR), (7, ao.Status.DEGENERATE)], ids=["apart", "resonant"]
)
def test_coordinates_that_hardly_move_make_no_family(n, status):
    """A chain driven at its first, of which each moves a thirtieth of the one before.

    Modes of twice the frequency have -0.2 cos(k pi / (n + 1)) in place of zero: none of an even n.
    """

    def lagrangian(q, v, t):
        neighbours = sum(q[i] * q[i + 1] for i in range(n - 1))
        return (v @ v) / 2 - 2 * (q @ q) + 0.1 * neighbours + q[0] * np.cos(t)

    chain = ao.System(lagrangian, [f"x{i}" for i in range(n)])
    problem = ao.Problem(chain, ao.Event(0, [None] * n), Periodic(2 * np.pi))
    solution = ao.solve(problem, tol=1e-8, throw=False)
    assert solution.status is status
    if n == 8:
        matrix = 3 * np.eye(n) - 0.1 * (np.eye(n, k=1) + np.eye(n, k=-1))
        exact = np.linalg.inv(matrix)[0]
        assert np.max(np.abs(solution(0.0) - exact)) < 1e-13
        assert np.max(np.abs(solution(0.0) - exact) / exact) < solution.error


KEPLER_TILT = np.array([[0.8, -0.6], [0.6, 0.8]])


def _ellipse(t):
    """Return a Kepler ellipse of eccentricity 0.3 and semi-axis one, tilted, at times t."""
    e = 0.3
    E = t = np.asarray(t, dtype=float)
    for _ in range(20):
        E = E - (E - e * np.sin(E) - t) / (1 - e * np.cos(E))
    return KEPLER_TILT @ np.array([np.cos(E) - e, np.sqrt(1 - e**2) * np.sin(E)])


MEMBERS = {
    "oscillator": (
        ao.System(lambda q, v, t: v[0] ** 2 / 2 - 0.72 * q[0] ** 2, ["x"]),
        lambda t: [0.7 * np.cos(1.2 * t) - 0.4 * np.sin(1.2 * t)],
        2 * np.pi / 1.2,
    ),
    "isotropic": (
        systems.oscillator("x y"),
        lambda t: [0.7 * np.cos(t) - 0.4 * np.sin(t), 0.2 * np.cos(t + 1)],
        2 * np.pi,
    ),
    "two to one": (
        ao.System(lambda q, v, t: (v @ v - q[0] ** 2 - 4 * q[1] ** 2) / 2, ["x", "y"]),
        lambda t: [0.8 * np.cos(t + 0.3), 0.6 * np.cos(2 * t + 1)],
        2 * np.pi,
    ),
    "Kepler": (
        systems.kepler(),
        lambda t: list(_ellipse(t)),
        2 * np.pi,
    ),
}


@pytest.mark.long
@pytest.mark.parametrize("name", MEMBERS)
def test_a_guess_that_is_a_member_of_a_family_is_kept(name):
    system, member, T = MEMBERS[name]
    problem = ao.Problem(system, ao.Event(0, [None] * system.n), Periodic(T))
    solution = ao.solve(problem, guess=member, tol=1e-9, throw=False)
    assert solution.status is ao.Status.DEGENERATE
    for t in np.linspace(0, T, 17):
        assert np.max(np.abs(solution(t) - member(t))) < 1e-9


@pytest.mark.parametrize("z", [3.0, -3.0])
def test_the_larger_of_a_pair_of_multipliers_comes_first(z):
    pair = np.diag([1 / z, z]).view(Monodromy).eigenvalues
    assert pair == pytest.approx([z, 1 / z], rel=1e-14)


def test_the_phase_of_another_member_begins_where_its_start_says():
    B, C = np.arange(6.0).reshape(3, 2), np.arange(6.0, 12.0).reshape(2, 3)
    phase = PhaseCondition(B, C, np.array([0.5, 7.0]), (1,))
    problem = ao.Problem(systems.particle("x y"), ao.Event(0, [None, 3.0]), ao.Periodic(1.0))
    other = phase.of(problem, np.array([1.0, 2.0]))
    assert (other.B is B, other.C is C, other.given) == (True, True, (1,))
    np.testing.assert_array_equal(other.c, [1.5, 7.0])


@pytest.mark.parametrize(
    ("multipliers", "words"),
    [
        ((1.0, 1.0), "linearly stable: all multipliers are on the unit circle"),
        ((3.0, 1 / 3), "unstable: 1 multiplier outside the unit circle, the largest of modulus 3"),
    ],
)
def test_multipliers_say_whether_neighbours_stay_near(multipliers, words):
    M = np.diag(multipliers).view(Monodromy)
    assert M.stability == words and repr(M) == f"Monodromy(2 x 2, {words})"
    assert repr(M[0]).startswith("Monodromy([")  # a part of it has none


@pytest.mark.quick("0.9")
@pytest.mark.parametrize("given", [None, 0.9])
def test_motions_are_changed_until_they_close(given):
    """Of x'' = -x - x^3, to the accuracy of guesses; what the start gives stays."""
    duffing = systems.spring()
    problem = ao.Problem(duffing, ao.Event(0.0, [given]), ao.Periodic(5.0))
    q0, v0, which = shooting.close(
        problem, np.full((1, 2), 0.9), np.array([[0.2, 0.1]]), np.ones(2)
    )
    assert which.size and (given is None or (q0 == given).all())
    q, v = shooting.fly(problem, q0[:, None], v0[:, None])
    np.testing.assert_allclose(q[:, 0], q0, atol=1e-4)
    if given is None:
        np.testing.assert_allclose(v[:, 0], v0, atol=1e-4)


def test_multipliers_need_independent_coordinates_and_no_places_on_the_way():
    rod = systems.particle("x y", constraint=lambda q, t: q @ q - 1)
    s = ao.solve(ao.Problem(rod, ao.Event(0.0, [1.0, 0.0]), ao.Event(1.0, [0.0, 1.0])))
    with pytest.raises(ValueError, match="without constraints"):
        ao.monodromy(s)
    start, way, end = (ao.Event(t, [x]) for t, x in ((0.0, 0.0), (1.0, 1.0), (2.0, 0.0)))
    s = ao.solve(ao.Problem(systems.particle(), start, end, through=[way]))
    with pytest.raises(ValueError, match="events between the ends that leave the path"):
        ao.monodromy(s)


def test_multipliers_need_finite_times():
    well = ao.System(lambda q, v, t: v[0] ** 2 / 2 + (q[0] ** 2 - 1) ** 2 / 2, ["x"])
    ends = ao.Event(-np.inf, [-1.0]), ao.Event(np.inf, [1.0])
    with pytest.raises(ValueError, match="between finite times"):
        ao.monodromy(ao.solve(ao.Problem(well, *ends)))


def test_paths_that_close_on_a_clock_are_all_motions():
    problem = ao.Problem(
        driven(stiff=1.0, cubic=1.0, drive=0.3), ao.Event(0.0, [None]), ao.Periodic(2 * np.pi / 1.5)
    )
    found = ao.solve_all(problem, starts=1, shots=4, continuations=0, seed=1)
    assert len(found) >= 1
    for s in found:
        assert s.compare().position < 1e-6
        np.testing.assert_allclose(s.start.v, s.end.v, atol=1e-8)


def test_a_rough_guess_of_one_turn_leads_to_one_turn():
    """T = 2 int dx / sqrt(2 (E - V)) along x alone; damped steps led three times round."""
    a, energy = 0.2845629674, 0.3916189347

    def law(q, v, t):
        x, y = q
        quartic = a * x**4 + 0.27813946 * y**4 + a * x**2 * y**2
        return (v @ v - x**2 - 2.3 * y**2) / 2 - quartic

    turn = np.linspace(0, 2 * np.pi, 33)
    guess = np.stack([0.9 * np.sqrt(2 * energy) * np.cos(turn), 0 * turn])
    system = ao.System(law, ["x", "y"])
    problem = ao.Problem(system, ao.Event(0.0, None), ao.Periodic(None), energy=energy)
    found = ao.solve(problem, guess=guess)
    top = np.sqrt((np.sqrt(0.25 + 4 * a * energy) - 0.5) / (2 * a))
    b = 2 * a * top**2  # with x = top sin s the roots of E - V at both ends cancel
    assert abs(found.duration - 4 * ellipk(-b / (1 + b)) / np.sqrt(1 + b)) < 1e-7
