"""What a solve promises: paths known in closed form or by forward integration, and verdicts."""

import subprocess
import sys
from functools import cache

import mpmath as mp
import numpy as np
import pytest
import systems
from helpers import a_quarter, forward, relative_error, same_bits, solved, times
from scipy.integrate import solve_bvp

import actionopt as ao
from actionopt import Event, Mesh, Problem, SolveError, Status, System, scenes
from actionopt.analysis.quadratic.jacobi import resolve
from actionopt.discrete.action.transcription import Transcription

EPS = np.finfo(float).eps
TOLS = (1e-3, 1e-6, 1e-9, 1e-12)


# -- linear equations of motion -------------------------------------------------------------------


@pytest.mark.parametrize("T", [2.5, 10.0])
@pytest.mark.parametrize("parameters", [{}, {"m": 3.0, "k": 4.1, "start": -2.0, "end": 7.0}])
def test_the_oscillator_takes_one_newton_step_a_mesh(T, parameters):
    scene = scenes.get("oscillator", duration=T, **parameters)
    solution = ao.solve(scene.problem, tol=1e-12)
    t = times(scene.problem)
    assert relative_error(solution, scene.exact, t) <= 1e-12
    assert solution.stats["iterations"] == {"newton": len(solution.stats["rounds"])}
    assert solution.stats["rung"] == "linear"
    assert solution.action == pytest.approx(scene.facts["action"], rel=1e-12)
    # The oracle feels a change in the twelfth digit.
    assert relative_error(lambda t: (1 + 3e-12) * solution(t), scene.exact, t) > 1e-12


@pytest.mark.parametrize("T", [3.3, 10.0])
def test_past_a_conjugate_point_nothing_is_least(T):
    problem = scenes.get("oscillator", duration=T).problem
    assert ao.solve(problem).status is Status.SOLVED
    assert ao.solve(problem, principle="stationary").status is Status.SOLVED
    with pytest.raises(SolveError) as failure:
        ao.solve(problem, principle="least")
    message = str(failure.value)
    assert "unbounded below" in message and "past a conjugate point" in message
    assert "try principle='stationary' or 'auto'" in message
    assert failure.value.solution.status is Status.UNBOUNDED
    assert ao.solve(scenes.get("oscillator", duration=3.0).problem, principle="least").success


@pytest.mark.quick("ends0-1", "ends0-3", "ends1-1", "ends1-3", "ends2-1")
@pytest.mark.parametrize("half_periods", [1, 3])
@pytest.mark.parametrize("ends", [(1.0, 0.5), (0.0, 0.0), (1.0, -1.0)])
def test_an_end_conjugate_to_the_start_is_diagnosed(half_periods, ends):
    system = scenes.get("oscillator").problem.system
    T = half_periods * np.pi
    problem = Problem(system, Event(0, ends[0]), Event(T, ends[1]))
    if ends == (0.0, 0.0) and half_periods == 3:
        pytest.skip("rest is resolved by a mesh too coarse to hold the third half period")
    with pytest.raises(SolveError, match=r"conjugate to the start event.*not determined"):
        ao.solve(problem)
    assert ao.solve(problem, throw=False).status is Status.DEGENERATE


@pytest.mark.long
def test_round_off_that_forbids_the_tolerance_is_said():
    """An end point is amplified by 1 / sin(w T), 1e5 to 1e7, along the path."""
    system = scenes.get("oscillator").problem.system
    mp.mp.dps = 30  # the formula loses as many digits as the path
    wrong = []
    for k in range(10):
        T, end = np.pi + 10 ** (-7 + 0.15 * k), -1.0 + (k + 1) * 1e-9
        problem = Problem(system, Event(0, 1.0), Event(T, end))
        x = [(mp.sin(T - mp.mpf(t)) + end * mp.sin(t)) / mp.sin(T) for t in times(problem, 41)]
        exact = np.array([x], dtype=float)
        for tol in (1e-9, 1e-13):
            solution = ao.solve(problem, tol=tol, throw=False)
            assert solution.status in (Status.FLOOR, Status.DEGENERATE) or tol == 1e-9
            true = relative_error(solution, lambda t, exact=exact: exact, times(problem, 41))
            wrong.append(true > (tol if solution.success else solution.error))
    assert ao.solve(problem, tol=1e-6).success
    assert sum(wrong) <= 1  # 95 % and more are right, as of all estimates: round-off is a sample


# -- the motions of the book ----------------------------------------------------------------------


# -- order, and what is conserved on any mesh -----------------------------------------------------


@pytest.mark.long
@pytest.mark.parametrize("name", ["pendulum", "rod_pendulum"])
@pytest.mark.parametrize(("degree", "counts"), [(1, (32, 128)), (2, (12, 48)), (3, (6, 16))])
def test_order_at_the_element_ends(name, degree, counts):
    scene = scenes.get(name, duration=0.5)
    errors, count = [], np.geomspace(*counts, 4).round().astype(int)
    for N in count:
        mesh = Mesh.uniform(0.0, 0.5, N, degree)
        solution = ao.solve(scene.problem, mesh=mesh)
        ends = mesh.boundaries
        errors.append(np.max(np.abs(solution(ends) - scene.exact(ends))))
    assert errors[-1] > 1e-13  # not yet rounding
    order = -np.polyfit(np.log(count), np.log(errors), 1)[0]
    assert order == pytest.approx(2 * degree, abs=0.1)


# -- nothing is done twice ------------------------------------------------------------------------


@pytest.mark.long
def test_another_solve_derives_nothing(monkeypatch):
    def swing(q, v, t, *, l, g):
        return (l * v[0]) ** 2 / 2 + g * l * np.cos(q[0])

    system = System(swing, ["theta"], parameters={"l": 1.0, "g": 9.81})
    mesh = Mesh.uniform(0.0, 1.0, 5, 8)
    first = ao.solve(Problem(system, Event(0.0, 0.3), Event(1.0, -0.2)), mesh=mesh)
    assert relative_error(first, forward(first), times(first.problem)) <= 1e-8
    derived, layout = system.derived, first.discrete.tr.layout
    assert set(first.stats["derived"]) <= set(derived)

    def forbidden(*args, **kwargs):
        raise AssertionError("symbolic work in another solve")

    for name in ("nlpsol", "hessian", "jacobian", "gradient", "jtimes"):
        monkeypatch.setattr(f"casadi.{name}", forbidden)
    monkeypatch.setattr("casadi.SX.sym", forbidden)
    other = Problem(system, Event(0.0, 0.1), Event(1.0, 0.25), parameters={"g": 1.62, "l": 2.0})
    second = ao.solve(other, mesh=mesh)
    moved = ao.solve(Problem(system, Event(2.0, 0.1), Event(2.7, 0.2)), mesh=mesh.moved(2.0, 2.7))
    assert second.success and moved.success
    assert system.derived == derived
    assert second.discrete.tr.layout is layout and moved.discrete.tr.layout is layout
    t = times(other)
    assert relative_error(second, forward(second), t) <= 1e-8


def test_what_was_done_is_said():
    solution = solved("rod_pendulum")
    stats = solution.stats
    assert {"rung", "unknowns", "rows", "iterations", "evaluations"} <= set(stats)
    assert {"derive", "assemble", "solve", "verify", "total"} <= set(stats["time"])
    assert all(0 <= seconds < 100 for seconds in stats["time"].values())
    last = stats["rounds"][-1]
    assert {"elements", "degrees", "unknowns", "estimate", "time"} <= set(last)
    assert last["elements"] == solution.mesh.elements
    nodes = solution.mesh.nodes.size
    assert (stats["unknowns"], stats["rows"]) == (2 * nodes - 4, nodes - 2)


# -- free ends, forces ----------------------------------------------------------------------------


@pytest.mark.parametrize("w", [0.7, 2.0])
def test_a_free_end_of_an_oscillator_has_no_momentum(w):
    system = System(
        lambda q, v, t, *, w: v[0] ** 2 / 2 - w**2 * q[0] ** 2 / 2, ["x"], parameters={"w": w}
    )
    T = 1.3
    for events, exact in (
        ((Event(0, 2.0), Event(T, [None])), lambda t: np.cos(w * (T - t)) / np.cos(w * T)),
        ((Event(0, [None]), Event(T, 2.0)), lambda t: np.cos(w * t) / np.cos(w * T)),
    ):
        solution = ao.solve(Problem(system, *events), tol=1e-12)
        t = times(solution.problem)
        assert np.max(np.abs(solution(t)[0] - 2 * exact(t))) <= 1e-11
        free = solution.momenta[1 if events[0].q[0] == 2.0 else 0]
        assert abs(free[0]) <= 1e-12


def attracted(q, v, t):
    return (v[0] ** 2 + v[1] ** 2) / 2 + 1 / np.sqrt(q[0] ** 2 + q[1] ** 2 + 0.1)


def dragged(c):
    """Return a system, its rates by hand, ends, and what misses them."""
    system = System(
        lambda q, v, t: v[0] ** 2 / 2 + 4 * np.cos(q[0]),
        ["x"],
        force=lambda q, v, t: [-c * v[0] * np.sqrt(1 + v[0] ** 2)],
    )

    def flow(t, y):
        return np.stack([y[1], -4 * np.sin(y[0]) - c * y[1] * np.sqrt(1 + y[1] ** 2)])

    return system, flow, [0.2], [1.0], lambda a, b: np.array([a[0] - 0.2, b[0] - 1.0])


def with_a_free_end():
    """Return the same, for a path that ends anywhere on the line x = -0.4."""

    def flow(t, y):
        r3 = (y[0] ** 2 + y[1] ** 2 + 0.1) ** 1.5
        return np.stack([y[2], y[3], -y[0] / r3, -y[1] / r3])

    def ends(a, b):
        return np.array([a[0] - 1.0, a[1] - 0.3, b[0] + 0.4, b[3]])

    return System(attracted, ["x", "y"]), flow, [1.0, 0.3], [-0.4, None], ends


@pytest.mark.long
@pytest.mark.parametrize("case", [dragged(0.3), dragged(2.0), with_a_free_end()])
def test_against_another_solver(case):
    system, flow, start, end, ends = case
    solution = ao.solve(Problem(system, Event(0, start), Event(1.3, end)), tol=1e-10)
    t = np.linspace(0, 1.3, 41)
    near = np.vstack([solution(t), solution.velocity(t)]) * 1.01  # and not there
    other = solve_bvp(flow, ends, t, near, tol=1e-10, max_nodes=20000)
    assert other.success
    assert np.max(np.abs(other.sol(t)[: system.n] - solution(t))) <= 1e-8
    if None in end:
        assert abs(solution.momenta[1][1]) <= 1e-10


def test_both_ends_free_leave_the_equilibrium():
    system = System(lambda q, v, t: v[0] ** 2 / 2 + (q[0] - 3.0) ** 2 / 2, ["x"])
    solution = ao.solve(Problem(system, Event(0, [None]), Event(1, [None])))
    assert np.max(np.abs(solution(times(solution.problem)) - 3.0)) <= 1e-8


# -- guesses --------------------------------------------------------------------------------------


def long_way(t):
    """Circle of radius one, clockwise from (1, 0) by 280 degrees in the time 3."""
    angle = -np.deg2rad(280) * np.asarray(t) / 3
    return np.stack([np.cos(angle), np.sin(angle)])


@cache
def orbit():
    system = scenes.get("kepler").problem.system
    return Problem(system, Event(0, long_way(0.0)), Event(3, long_way(3.0)), parameters={"mu": 1.0})


GUESSES = {
    "callable": long_way,
    "waypoints": long_way(np.linspace(0, 3, 9)),
    "path": ao.Path.interpolate(long_way, Mesh.uniform(0, 3, 5, 4)),
    "path of other times": ao.Path(
        Mesh.uniform(7, 8, 5, 4), long_way(Mesh.uniform(0, 3, 5, 4).nodes)
    ),
}


@pytest.mark.long
@pytest.mark.parametrize("kind", a_quarter(GUESSES, 1))
def test_the_path_near_the_guess_is_found(kind):
    t = times(orbit())
    solution = ao.solve(orbit(), guess=GUESSES[kind], tol=1e-9)
    assert relative_error(solution, forward(solution), t) <= 1e-7
    swept = np.unwrap(np.arctan2(*solution(t)[::-1]))
    assert np.rad2deg(swept[-1]) == pytest.approx(-280)
    # Without a guess another path is found, the short way round.
    short = ao.solve(orbit(), tol=1e-9)
    assert np.rad2deg(np.unwrap(np.arctan2(*short(t)[::-1]))[-1]) == pytest.approx(80)
    # A solution is a guess as well, for other end points too.
    again = ao.solve(orbit(), guess=solution, tol=1e-9)
    assert relative_error(again, solution, t) <= 2e-9
    nearby = Problem(orbit().system, Event(0, [1.0, 0.02]), orbit().end)
    turned = ao.solve(nearby, guess=solution)
    assert np.unwrap(np.arctan2(*turned(t)[::-1]))[-1] < -4


# -- the same answer, always ----------------------------------------------------------------------


FINGERPRINT = """
import hashlib, actionopt as ao
from actionopt import scenes
for name in ("double_pendulum", "rod_pendulum", "drag_quadratic", "kepler", "oscillator"):
    scene = scenes.get(name)
    s = ao.solve(scene.problem, guess=scene.guess, tol=1e-9)
    parts = [s.path.values, s.mesh.boundaries, s.start.v, s.end.v, s.lam, s.momenta[0]]
    text = b"".join(x.tobytes() for x in parts) + repr((s.action, s.error)).encode()
    print(name, hashlib.sha256(text).hexdigest(), s.stats["iterations"])
"""


@pytest.mark.long
def test_bit_identical_across_processes(capsys):
    command = [sys.executable, "-c", FINGERPRINT]
    other = subprocess.run(command, capture_output=True, text=True, check=True)
    exec(FINGERPRINT, {})
    assert capsys.readouterr().out == other.stdout
    assert len(other.stdout.splitlines()) == 5


def numbers(s):
    return s.path.values, s.mesh.boundaries, s.lam, s.start.v, np.array([s.action, s.error])


@pytest.mark.quick("drag_quadratic")
@pytest.mark.parametrize("name", ["double_pendulum", "rod_pendulum", "drag_quadratic", "kepler"])
def test_bit_identical_within_a_process(name):
    scene = scenes.get(name)
    a, b = (ao.solve(scene.problem, guess=scene.guess, tol=1e-9) for _ in range(2))
    for one, other in zip(numbers(a), numbers(b), strict=True):
        same_bits(one, other, because="nothing is drawn at random, and nothing kept that matters")
    assert a.stats["iterations"] == b.stats["iterations"]


def in_units(name, length, time, mass):
    """Return a problem with its lengths, times and masses multiplied."""
    if name == "kepler":
        return scenes.get("kepler", a=length, mu=length**3 / time**2)
    gravity = 9.81 * length / time**2
    return scenes.get(name, m=mass, l=length, g=gravity, since=0.125 * time, duration=time)


@pytest.mark.long
@pytest.mark.parametrize("base", [10.0**12, 2.0**40], ids=["decimal", "binary"])
@pytest.mark.parametrize("name", a_quarter(["rod_pendulum", "kepler", "pendulum"]))
def test_units_do_not_matter(name, base):
    units = [(1.0, 1.0, 1.0)]
    for factor in (base, 1 / base):
        units += [tuple(np.where(np.arange(3) == i, factor, 1.0)) for i in range(3)]
    units += [(1e-10, 1e-15, 1e-26), (1e11, 1e7, 1e24)]  # atoms and planets
    counts = []
    for length, time, mass in units:
        scene = in_units(name, float(length), float(time), float(mass))
        solution = ao.solve(scene.problem, tol=1e-9)
        counts.append((sum(solution.stats["iterations"].values()), solution.mesh.elements))
        assert relative_error(solution, scene.exact, times(scene.problem)) <= 1e-9
    # Units that are no powers of two round otherwise: that decides a step, and no more.
    assert np.ptp(counts, axis=0).max() <= 1, counts


@pytest.mark.long
def test_binary_units_do_not_change_a_bit():
    def duffing(length, time, mass):
        return Problem(
            hard,
            Event(0, length),
            Event(2.2 * time, -0.3 * length),
            parameters=dict(m=mass, k=mass / time**2, a=length),
        )

    hard = System(
        lambda q, v, t, *, m, k, a: m * v[0] ** 2 / 2 - k * q[0] ** 2 / 2 * (1 + (q[0] / a) ** 2),
        ["x"],
        parameters={"m": 1.0, "k": 1.0, "a": 1.0},
    )
    plain = ao.solve(duffing(1.0, 1.0, 1.0))
    for length, time, mass in ((2.0**40, 2.0**-40, 2.0**20), (2.0**-40, 2.0**40, 2.0**-90)):
        other = ao.solve(duffing(length, time, mass))
        back = np.array([time / mass / length**2, 1.0])
        units = 1 / length, 1 / time, 1.0, time / length, back
        for one, other_s, unit in zip(numbers(plain), numbers(other), units, strict=True):
            same_bits(one, unit * other_s, because="powers of two round nothing")
        assert other.stats["iterations"] == plain.stats["iterations"]


# -- the tolerance is kept ------------------------------------------------------------------------


KNOWN = [name for name in scenes.SCENES if scenes.get(name).exact is not None]


@cache
def measured(name):
    """Return (tol, true error, estimate, status) for each tolerance."""
    scene = scenes.get(name)
    guess = scene.guess
    if guess is None and ao.solve(scene.problem).action < scene.action - 1e-6 * abs(scene.action):
        guess = scene.exact  # a path of less action is a right answer too: ask for the known one
    rows = []
    for tol in TOLS:
        solution = ao.solve(scene.problem, tol=tol, guess=guess)
        error = relative_error(solution, scene.exact, times(solution.problem))
        rows.append((tol, error, solution.error, solution.status))
    return rows


@pytest.mark.quick(
    "driven_oscillator",
    "oscillator_gauge",
    "projectile",
    "rolling_cylinder",
    "rotating_frame_bound",
    "sliding_wedge",
)
@pytest.mark.parametrize("name", a_quarter(KNOWN, 2))
def test_every_known_path_is_met_to_every_tolerance(name):
    for tol, error, estimate, status in measured(name):
        assert status is Status.SOLVED
        assert error <= tol
        assert estimate <= tol


@pytest.mark.long
@pytest.mark.parametrize("every", [4, pytest.param(1, marks=pytest.mark.slow)])
def test_the_estimate_is_calibrated(every):
    rows = [row for name in KNOWN[2 % every :: every] for row in measured(name)]  # as above
    held = [error <= estimate for _, error, estimate, _ in rows]
    assert np.mean(held) >= 0.95
    assert np.median([estimate / max(error, EPS) for _, error, estimate, _ in rows]) <= 100


# -- a mesh of one's own --------------------------------------------------------------------------


def test_a_given_mesh_is_kept():
    scene = scenes.get("pendulum")
    T = scene.problem.end.t
    for mesh in (Mesh([0, 0.1 * T, T], [5, 8]), Mesh.uniform(0, T, 7, 2)):
        solution = ao.solve(scene.problem, mesh=mesh)
        assert solution.mesh is mesh
        assert solution.status is Status.ON_MESH and solution.success
        error = relative_error(solution, scene.exact, times(scene.problem))
        assert error / 2 <= solution.error <= 100 * error


# -- failures -------------------------------------------------------------------------------------


def impossible():
    """Bratu beyond its fold: there is no motion between these events."""
    return systems.bratu(5.0)


@pytest.mark.long
def test_no_path_is_said_and_the_best_attempt_comes_along():
    with pytest.raises(SolveError, match="no stationary path was found") as f:
        ao.solve(impossible())
    assert "try another guess" in str(f.value)
    attempt = f.value.solution
    assert isinstance(f.value, RuntimeError)
    assert isinstance(attempt, ao.Solution) and not attempt.success
    assert attempt.status is Status.NOT_FOUND
    assert attempt(0.5).shape == (1,)
    assert np.isfinite(attempt(times(impossible()))).all()
    assert attempt.stats["rounds"] == [] or attempt.stats["rung"]


@pytest.mark.long
def test_a_saddle_is_not_least():
    # The hoop's bead has a least path, and another one that is only stationary.
    scene = scenes.get("hoop_bead")
    assert ao.solve(scene.problem, guess=scene.exact).success
    with pytest.raises(SolveError, match="stationary but not least"):
        ao.solve(scene.problem, guess=scene.exact, principle="least")
    least = ao.solve(scene.problem, principle="least")
    assert least.action < scene.action
    assert relative_error(least, forward(least), times(scene.problem)) <= 1e-7


# -- interrupts -----------------------------------------------------------------------------------


@pytest.mark.quick("_action_and_gradient-stationary", "second-stationary", "place-stationary")
@pytest.mark.parametrize("principle", ["least", "stationary"])
@pytest.mark.parametrize("method", ["_action_and_gradient", "second", "place"])
def test_an_interrupt_ends_the_solve(monkeypatch, principle, method):
    real, calls = getattr(Transcription, method), []

    def interrupted(self, *args):
        calls.append(method)
        if len(calls) == 4:
            raise KeyboardInterrupt
        return real(self, *args)

    problem = scenes.get("double_pendulum").problem
    with monkeypatch.context() as patch:
        patch.setattr(Transcription, method, interrupted)
        with pytest.raises(KeyboardInterrupt):
            ao.solve(problem, principle=principle)
    assert len(calls) == 4  # nothing was computed after it
    assert ao.solve(problem, principle=principle).success


OSCILLATOR = systems.oscillator()

# -- what was once wrong --------------------------------------------------------------------------


@pytest.mark.quick("1.0")
@pytest.mark.parametrize(
    "T", [1.0, 10.0, *(pytest.param(T, marks=pytest.mark.slow) for T in (3.0, 6.0))]
)
def test_a_mass_matrix_need_not_be_positive(T):
    # Two oscillators of opposite sign, coupled by a quartic: L_vv = diag(1, -1).
    def lagrangian(q, v, t):
        return (v[0] ** 2 - v[1] ** 2) / 2 - (q[0] ** 2 - q[1] ** 2) / 2 - q[0] ** 4 / 40

    system = System(lagrangian, ["x", "y"])
    solution = ao.solve(Problem(system, Event(0, [0.1, 0.2]), Event(T, [0.3, -0.1])), tol=1e-9)
    assert solution.compare().agrees


@pytest.mark.long
def test_a_mesh_of_the_highest_degree_is_compared_with_one_in_halves():
    problem = Problem(OSCILLATOR, Event(0, [1.0]), Event(40.0, [0.5]))
    solution = ao.solve(problem, mesh=ao.Mesh([0.0, 40.0], 64))
    exact = [np.cos, lambda t: (0.5 - np.cos(40.0)) / np.sin(40.0) * np.sin(t)]
    t = np.linspace(0, 40, 501)
    error = np.max(np.abs(solution(t)[0] - sum(f(t) for f in exact))) / np.max(np.abs(solution(t)))
    assert 0.1 * error < solution.error < 100 * max(error, 1e-12)


def test_a_failed_neighbour_does_not_tell_how_sensitive_a_problem_is():
    degenerate = ao.solve(Problem(OSCILLATOR, Event(0, [0.0]), Event(np.pi, [0.0])), throw=False)
    assert not degenerate.success
    near = ao.solve(
        Problem(OSCILLATOR, Event(0, [0.0]), Event(np.pi + 0.1, [0.3])), guess=degenerate
    )
    assert near.velocity(0.0)[0] == pytest.approx(0.3 / np.sin(np.pi + 0.1), rel=1e-8)


def test_kinks_are_not_linear_equations():
    # x'' = 4 sign(x), through the kink at x = 0: two parabolas.
    system = System(lambda q, v, t: v[0] ** 2 / 2 + 4 * np.abs(q[0]), ["x"])
    assert not system.structure.linear
    smooth = System(lambda q, v, t: v[0] ** 2 / 2 + 4 * q[0], ["x"])
    assert smooth.structure.linear
    solution = ao.solve(Problem(system, Event(0, [0.5]), Event(0.5, [1.5])), tol=1e-6)
    assert solution.velocity(0.0)[0] == pytest.approx((1.5 - 0.5 - 2 * 0.5**2) / 0.5, rel=1e-6)


def test_one_element_with_nothing_free_and_a_constraint():
    system = systems.thrown(g=1.0, constraint=lambda q, t: q[1] - q[0])
    problem = Problem(system, Event(0, [0, 0]), Event(1, [1, 1]))
    solution = ao.solve(problem, mesh=ao.Mesh([0.0, 1.0], 1), throw=False)
    assert np.array_equal(solution.path.values, [[0, 1], [0, 1]])


@pytest.mark.long
@pytest.mark.parametrize("degree", [1, 2])
def test_the_index_on_a_mesh_of_low_degree_takes_no_more_than_raising_it(degree):
    # Fields on elements of degree 1 have no coefficients that could decay.
    mesh = ao.Mesh.uniform(0.0, 4.0, 20, degree)
    solution = ao.solve(Problem(OSCILLATOR, Event(0, [1.0]), Event(4.0, [0.5])), mesh=mesh)
    assert solution.morse_index == 1
    assert resolve(solution.discrete, solution.error, 1e-8).tr.mesh.elements == 20


def test_a_solution_from_a_file_is_a_guess_without_its_system(tmp_path):
    problem = scenes.get("pendulum").problem
    first = ao.solve(problem)
    first.save(tmp_path / "first.npz")
    again = ao.solve(problem, guess=ao.load(tmp_path / "first.npz"))
    assert np.max(np.abs(again.path.values - first.path.values)) < 1e-9


def test_a_changed_parameter_is_checked_anew():
    system = System(
        lambda q, v, t, *, m: m * v[0] ** 2 / 2 - q[0] ** 4, ["x"], parameters={"m": 1.0}
    )
    ends = Event(0, [0.1]), Event(1, [0.2])
    neighbour = ao.solve(Problem(system, *ends))
    with pytest.raises(ValueError, match="regular mass matrix"):
        ao.solve(Problem(system, *ends, parameters={"m": 0.0}), guess=neighbour)


def test_a_re_solve_from_the_tangent_takes_fewer_steps_and_arrives_at_the_same_path():
    scene = scenes.get("pendulum")
    first = ao.solve(scene.problem, tol=1e-9)
    p = scene.problem
    moved = Problem(
        p.system, Event(p.start.t, [0.62]), Event(p.end.t, [-0.03]), parameters=p.parameters
    )
    again = ao.solve(moved, tol=1e-9, guess=first)
    kinked = ao.solve(moved, tol=1e-9, guess=first.path)
    t = np.linspace(p.start.t, p.end.t, 50)
    assert np.max(np.abs(again(t) - kinked(t))) < 1e-9
    assert again.stats["iterations"]["newton"] < kinked.stats["iterations"]["newton"]


def test_what_is_given_without_its_name_is_refused():
    system = systems.particle()
    start, end = ao.Event(0.0, [0.0]), ao.Event(1.0, [1.0])
    with pytest.raises(ValueError, match=r"Problem\(system, start, end\), found System.*make one"):
        ao.solve(system, start, end)
    with pytest.raises(TypeError, match="by its name, such as tol=1e-8, found also 1e-06"):
        ao.solve(ao.Problem(system, start, end), 1e-6)


@pytest.mark.long
def test_a_pendulum_of_many_links_has_a_least_path():
    """Past conjugate times of its small swings; the motion itself is the oracle."""
    first = np.linspace(0.05, 0.15, 12)
    found = ao.solve(ao.Problem(systems.links(12), ao.Event(0.0, first), ao.Event(0.5, -first / 2)))
    assert found.morse_index == 0 and found.compare().agrees


@pytest.mark.slow
def test_a_family_of_many_coordinates_is_told():
    """Between opposite points of a Kepler motion in four dimensions any plane will do."""
    system = ao.System(lambda q, v, t: v @ v / 2 + 1 / np.sqrt(q @ q), list("xyzu"))
    ends = ao.Event(0.0, [1.0, 0.0, 0.0, 0.0]), ao.Event(3.0, [-1.0, 0.0, 0.0, 0.0])

    def guess(t):
        s = np.pi * t / 3
        return np.stack([np.cos(s), 0.8 * np.sin(s), 0.6 * np.sin(s), 0 * s])

    found = ao.solve(ao.Problem(system, *ends), guess=guess, throw=False)
    assert found.status is ao.Status.DEGENERATE and found.stats["nullity"] == 2


def test_linear_equations_between_conjugate_events_have_no_path():
    half = Problem(systems.oscillator(), Event(0.0, [0.0]), Event(np.pi, [1.0]))
    assert ao.solve(half, throw=False).status is Status.DEGENERATE
