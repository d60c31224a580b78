"""The index against closed forms, dense eigenvalues and published values."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
import systems
from helpers import a_quarter, at_once, integrated, motion, of_one_leg, slow
from scipy.optimize import brentq

import actionopt as ao
import actionopt.analysis.quadratic.second_variation as second_variation_module
from actionopt import scenes
from actionopt.analysis.quadratic import regular
from actionopt.analysis.quadratic.index import INDEX_RESOLUTION, Inertia, inertia_of
from actionopt.analysis.quadratic.jacobi import finer, resolve
from actionopt.analysis.quadratic.regular import regular_index
from actionopt.analysis.quadratic.second_variation import condense
from actionopt.analysis.spectra.modes import lowest, second_variation
from actionopt.discrete.matrices.factors import kkt_nonzeros

EIGENVALUE_TOLERANCE = 1e-9  # relative; the path and its modes are resolved to better than 1e-8
MASS, STIFFNESS = 2.0, 8.0
W = np.sqrt(STIFFNESS / MASS)


def spring(q, v, t, *, m, k):
    return m * v[0] ** 2 / 2 - k * q[0] ** 2 / 2


OSCILLATOR = ao.System(spring, ["x"], parameters={"m": MASS, "k": STIFFNESS})


def oscillation(half_periods, ends=(1.0, 0.4), **options):
    T = half_periods * np.pi / W
    problem = ao.Problem(OSCILLATOR, ao.Event(0.0, ends[0]), ao.Event(T, ends[1]))
    return ao.solve(problem, **options)


def solved_along(system, q0, v0, T):
    """Solve the boundary-value problem whose answer starts with (q0, v0)."""
    curve = motion(system, q0, v0, 0.0, T)
    problem = ao.Problem(system, ao.Event(0.0, curve(0.0)), ao.Event(T, curve(T)))
    solution = ao.solve(problem, guess=curve, tol=1e-9)
    times = np.linspace(0, T, 50)
    assert np.max(np.abs(solution(times) - curve(times))) < 1e-6  # the same path
    return solution


# -- closed forms ------------------------------------------------------------------------------


@at_once(
    ("half_periods", "index"), [(0.5, 0), (0.95, 0), (1.05, 1), (1.4, 1), (2.6, 2), (10.5, 10)]
)
@at_once("ends", [(1.0, 0.4), (0.0, 0.0)])
def test_oscillator(half_periods, index, ends):
    solution = oscillation(half_periods, ends)
    assert solution.morse_index == index
    assert solution.kind == ("saddle" if index else "minimum")


@pytest.mark.long
@pytest.mark.parametrize("ends", [(0.0, 0.0), (1.0, -1.0)])
def test_end_conjugate_to_start_is_degenerate(ends):
    found = oscillation(1.0, ends, throw=False).inertia
    assert (found.index, found.nullity, found.kind) == (0, 1, "degenerate")
    assert found.smallest is not None and found.smallest < 1e-10


def test_size_of_a_nearly_vanishing_eigenvalue():
    rough = oscillation(1.0 - 5e-7, throw=False)
    found = inertia_of(resolve(rough.discrete, rough.error, INDEX_RESOLUTION), 1e-5)
    # mu = 1 - (w T / pi)^2 = 1e-6
    assert found.nullity == 1 and found.smallest == pytest.approx(1e-6, rel=0.1)


@pytest.mark.parametrize("half_periods", [0.7, 2.6])
@pytest.mark.parametrize("mesh", [(3, 14), (150, 6)])
def test_eigenvalues_of_the_oscillator_on_any_mesh(half_periods, mesh):
    T = half_periods * np.pi / W
    solution = oscillation(half_periods, mesh=ao.Mesh.uniform(0.0, T, *mesh))
    found = second_variation(solution, 5)
    k = np.arange(1, 6)
    exact = MASS * ((k * np.pi / T) ** 2 - W**2)
    assert found.eigenvalues == pytest.approx(exact, rel=EIGENVALUE_TOLERANCE)
    times = np.linspace(0.0, T, 40)
    for j, mode in zip(k, found.modes, strict=True):
        wave = np.sqrt(2 / T) * np.sin(j * np.pi * times / T)
        shape = mode(times)[0]
        assert min(np.max(np.abs(shape - wave)), np.max(np.abs(shape + wave))) < 1e-5


def test_modes_faster_than_the_mesh_of_a_path_are_resolved():
    """As many are asked for as the path's mesh has, and more: it is refined until it tells them."""
    solution = oscillation(0.7)
    T, most = solution.problem.duration, solution.mesh.nodes.size + 5
    exact = MASS * ((np.arange(1, most + 1) * np.pi / T) ** 2 - W**2)
    found = second_variation(solution, most)
    assert found.eigenvalues == pytest.approx(exact, rel=EIGENVALUE_TOLERANCE)


def test_modes_on_a_sphere_are_tangent_and_of_known_eigenvalues():
    def free(q, v, t):
        return sum(x * x for x in v) / 2

    system = ao.System(free, list("xyz"), constraint=lambda q, t: sum(x * x for x in q) - 1)
    angle = 4.0

    def arc(t):
        return np.stack([np.cos(angle * t), np.sin(angle * t), 0 * t])

    problem = ao.Problem(system, ao.Event(0.0, arc(0.0)), ao.Event(1.0, arc(1.0)))
    found = second_variation(ao.solve(problem, guess=arc), 4)
    # Across the great circle k^2 pi^2 - angle^2, along it k^2 pi^2.
    exact = np.sort([np.pi**2 - angle**2, np.pi**2, 4 * np.pi**2 - angle**2, 4 * np.pi**2])
    assert found.eigenvalues == pytest.approx(exact, rel=1e-8)
    nodes = found.modes[0].mesh.nodes
    for mode in found.modes:
        assert np.max(np.abs(np.sum(mode.values * arc(nodes), axis=0))) < 1e-7


def test_units_of_the_norm():
    solution = oscillation(0.7)
    assert second_variation(solution, 1, units=3.0).eigenvalues == pytest.approx(
        9 * second_variation(solution, 1).eigenvalues, rel=1e-9
    )


def test_free_end_has_its_own_modes():
    T = 1.0
    problem = ao.Problem(OSCILLATOR, ao.Event(0.0, 1.0), ao.Event(T, [None]))
    found = second_variation(ao.solve(problem), 3)
    exact = MASS * (((np.arange(3) + 0.5) * np.pi / T) ** 2 - W**2)
    assert found.eigenvalues == pytest.approx(exact, rel=EIGENVALUE_TOLERANCE)
    assert found.inertia.index == 1  # w T = 2 > pi / 2


# -- total derivatives, and coefficients that the path does not know of ---------------------------


def gauged(q, v, t, *, c, w):
    """Oscillator, and d/dt(c q^2 sin(w t) / 2 + c sin(w q) / w)."""
    own = (v[0] ** 2 - q[0] ** 2) / 2
    time = c * (q[0] * v[0] * np.sin(w * t) + w * q[0] ** 2 * np.cos(w * t) / 2)
    return own + time + c * np.cos(w * q[0]) * v[0]


GAUGED = ao.System(gauged, ["x"], parameters={"c": 1.0, "w": 3.0})


def claimed(problem, path):
    """Return a path as a solution, as if it had been found with an error of 1e-12."""
    lam = np.zeros((0, path.mesh.nodes.size))
    return ao.Solution(problem, path, 0.0, lam, 1e-12, ao.Status.SOLVED, {})


def along_the_motion(system, T, end, **parameters):
    """Return the motion .3 cos t + .5 sin t of the oscillator as a solution."""

    def exact(t):
        return (0.3 * np.cos(t) + 0.5 * np.sin(t))[None]

    mesh = ao.Mesh.uniform(0.0, T, 4, 14)  # resolves the motion to 1e-12, and nothing else
    path = ao.Path.interpolate(exact, mesh)
    end = exact(np.array(T)) if end is None else end
    problem = ao.Problem(system, ao.Event(0.0, [0.3]), ao.Event(T, end), parameters=parameters)
    return claimed(problem, path)


@pytest.mark.parametrize("c", [*slow(1.0, 10.0), 100.0, *slow(1000.0)])
@pytest.mark.parametrize("w", [3.0, 10.0, 50.0])
@pytest.mark.parametrize(("T", "index"), [(2.5, 0), (5.0, 1)])
def test_total_derivatives_change_no_index(c, w, T, index):
    solution = along_the_motion(GAUGED, T, None, c=c, w=w)
    assert solution.morse_index == index
    lowest = second_variation(solution, 1)  # (pi / T)^2 - 1
    assert lowest.eigenvalues[0] == pytest.approx((np.pi / T) ** 2 - 1, rel=1e-7)


@pytest.mark.parametrize(("w", "index"), [(3.0, 0), (10.0, 1)])
def test_total_derivatives_count_at_a_free_end(w, index):
    # d2S of the extremal field is (cot T + c sin w T) eta(T)^2.
    c, T = 1000.0, 2.5
    assert (1 / np.tan(T) + c * np.sin(w * T) < 0) == index

    def lagrangian(q, v, t, *, c, w):
        turn = q[0] * v[0] * np.sin(w * t) + w * q[0] ** 2 * np.cos(w * t) / 2
        return (v[0] ** 2 - q[0] ** 2) / 2 + c * turn

    system = ao.System(lagrangian, ["x"], parameters={"c": c, "w": w})
    assert along_the_motion(system, T, [None], c=c, w=w).morse_index == index


@pytest.mark.parametrize(("c", "w"), [(0.0, 3.0), (10.0, 3.0), (100.0, 20.0)])
def test_total_derivatives_in_the_hessian_of_the_principal_function(c, w):
    # S(a, b) = ((a^2 + b^2) cos T - 2 a b) / (2 sin T) + F(b, T) - F(a, 0)
    T = 2.5
    solution = along_the_motion(GAUGED, T, None, c=c, w=w)
    form = resolve(solution.discrete, solution.error, 1e-8)
    exact = np.array([[np.cos(T), -1], [-1, np.cos(T)]]) / np.sin(T)
    b = 0.3 * np.cos(T) + 0.5 * np.sin(T)
    exact[0, 0] += c * w * np.sin(w * 0.3)
    exact[1, 1] += c * np.sin(w * T) - c * w * np.sin(w * b)
    assert condense(form).hessian / form.units[0] ** 2 == pytest.approx(exact, rel=1e-9)


def test_a_lagrangian_that_is_singular_at_rest():
    system = ao.System(lambda q, v, t: -(q[0] ** 2) * np.log(v[0]), ["x"])
    problem = ao.Problem(system, ao.Event(0.0, 1.0), ao.Event(1.0, 2.0))
    assert ao.solve(problem, principle="stationary").kind in ("minimum", "saddle")


def valley(width):
    """A straight path in a valley steep on a short way: 2 / w^2 sech^2 u of Poeschl and Teller."""
    system = systems.valley(0.31, parameters={"w": width})
    problem = ao.Problem(system, ao.Event(0.0, [0.0, 0.0]), ao.Event(1.0, [1.0, 0.0]))
    mesh = ao.Mesh.uniform(0.0, 1.0, 2, 4)
    return claimed(problem, ao.Path(mesh, np.stack([mesh.nodes, 0 * mesh.nodes])))


@pytest.mark.quick("1.0-0", "0.3-1")
@pytest.mark.parametrize(("width", "index"), [(1.0, 0), (0.3, 1), (0.03, 1), (0.01, 1), (0.003, 1)])
def test_a_straight_path_through_a_valley(width, index):
    # The field tanh u (u0 tanh u0 - 1) - (u tanh u - 1) tanh u0 vanishes at the start, u0 < 0, and
    # before the end u1 if it has changed its sign there.
    u0, u1 = -0.31 / width, 0.69 / width

    def field(u):
        return np.tanh(u) * (u0 * np.tanh(u0) - 1) - (u * np.tanh(u) - 1) * np.tanh(u0)

    assert (field(u1) * field(u0 + 1e-3) < 0) == index
    assert valley(width).morse_index == index


@pytest.mark.parametrize("degree", [4, 5])  # with and without a node in the centre
def test_a_path_through_a_singularity(degree):
    system = systems.kepler()
    problem = ao.Problem(system, ao.Event(-1.0, [-1.0, 0.0]), ao.Event(1.0, [1.0, 0.0]))
    near = 2.0 ** np.arange(-46.0, 1.0)
    mesh = ao.Mesh(np.r_[-near[::-1], near], degree)
    x = np.cbrt(mesh.nodes) ** 2 * np.sign(mesh.nodes)
    path = ao.Path(mesh, np.stack([x, 0 * x]))
    with pytest.raises(ValueError, match="singularity"):
        _ = claimed(problem, path).morse_index


def test_elements_that_cannot_be_split_any_more():
    mesh = ao.Mesh([0.0, 0.5, np.nextafter(0.5, 1.0), 1.0], 4)
    jump = np.where(mesh.nodes > 0.5, 1.0, 0.0)[:, None]
    with pytest.raises(ValueError, match=r"singularity.*or is not smooth"):
        finer(mesh, 1e-10, Q=jump)


# -- the same matrix, dense ----------------------------------------------------------------------


UNFORCED = [name for name in of_one_leg() if not scenes.get(name).problem.system.structure.forced]


@pytest.mark.quick("kepler_at_energy", "light_around_star", "double_pendulum", "turning_wire")
@pytest.mark.parametrize("name", a_quarter(UNFORCED))
def test_pivots_agree_with_dense_eigenvalues_on_every_scene(name):
    scene = scenes.get(name)
    solution = ao.solve(scene.problem, guess=scene.guess, tol=1e-7)
    tr, z = solution.discrete.tr, solution.discrete.z
    pattern = tr.layout.kkt
    matrix = np.zeros(pattern.shape)
    matrix[pattern.row, pattern.col] = kkt_nonzeros(tr.layout, tr.kkt(z))
    # A KKT matrix has one negative eigenvalue a row, and those of the reduced Hessian.
    negative = np.sum(np.linalg.eigvalsh(matrix) < 0) - tr.layout.rows
    found = solution.inertia
    assert found.nullity == 0
    assert found.index == negative
    known = scene.facts.get("morse_index")
    assert known is None or known == negative


def test_nodes_conjugate_to_the_start_are_no_bad_pivots():
    # Every element boundary is conjugate to the start.
    T = 8 * np.pi / W + 0.3
    boundaries = np.r_[np.arange(9) * np.pi / W, T]
    problem = ao.Problem(OSCILLATOR, ao.Event(0.0, 1.0), ao.Event(T, 0.2))
    solution = ao.solve(problem, mesh=ao.Mesh(boundaries, 14))
    form = resolve(solution.discrete, solution.error, 1.0)
    values, _ = lowest(form, 30)
    found = condense(form)
    assert found.negative == np.sum(values < 0) == 8
    # S(a, b) = m w ((a^2 + b^2) cos w T - 2 a b) / (2 sin w T)
    s, c = np.sin(W * T), np.cos(W * T)
    exact = MASS * W / s * np.array([[c, -1], [-1, c]])
    assert found.hessian / np.outer(form.units, form.units) == pytest.approx(exact, rel=1e-8)


def test_pivots_of_very_different_sizes(monkeypatch):
    """By Sylvester's law the units of the nodes change no index; nor do they make fronts grow."""
    solution = oscillation(8.3)
    form = resolve(solution.discrete, solution.error, 1e-12)
    sizes, eliminate = [], second_variation_module._eliminate

    def noted(M, *rest, **options):
        sizes.append(len(M))
        return eliminate(M, *rest, **options)

    monkeypatch.setattr(second_variation_module, "_eliminate", noted)
    index = condense(form).negative
    front, elements = max(sizes), []
    for E in form.elements:
        unit = np.ones(len(E))
        unit[1:-1:2] = 1e-6
        elements.append(E * unit * unit[:, None])
    sizes.clear()
    assert condense(form, elements).negative == index == 8
    assert max(sizes) < 2 * front


# -- published values ----------------------------------------------------------------------------


@pytest.mark.long
@pytest.mark.parametrize(
    ("part", "index"), a_quarter([(1, 2), (1 / 12, 0), (1 / 3, 0), (1 / 2, 0)])
)
def test_figure_eight(part, index):
    # Fukuda, Fujiwara, Ozaki, arXiv:1710.04834; Chenciner and Montgomery, Ann. Math. 152 (2000).
    scene = scenes.get("figure_eight")
    start = scene.facts["start"]
    solution = solved_along(scene.problem.system, start.q, start.v, part * scene.facts["period"])
    assert solution.morse_index == index


def test_plain_solve_counts_nothing(monkeypatch):
    def asked(*arguments, **options):
        raise AssertionError("nobody asked for the second variation")

    for name in (
        "actionopt.analysis.quadratic.index.regular_index",
        "actionopt.analysis.quadratic.jacobi.resolve",
        "actionopt.analysis.quadratic.jacobi.fields",
    ):
        monkeypatch.setattr(name, asked)
    solution = oscillation(2.6)
    with pytest.raises(AssertionError, match="nobody asked"):
        _ = solution.morse_index


# -- refusals -------------------------------------------------------------------------------------


def test_forced_systems_have_no_index():
    system = systems.particle(force=lambda q, v, t: [-v[0]])
    solution = ao.solve(ao.Problem(system, ao.Event(0.0, 0.0), ao.Event(1.0, 1.0)))
    with pytest.raises(ValueError, match="non-conservative"):
        _ = solution.morse_index


def test_legendre_condition():
    system = ao.System(lambda q, v, t: v[0] ** 2 / 2 - v[1] ** 2 / 2, ["x", "y"])
    events = ao.Event(0.0, [0.0, 0.0]), ao.Event(1.0, [1.0, 1.0])
    solution = ao.solve(ao.Problem(system, *events), principle="stationary")
    with pytest.raises(ValueError, match="positive definite"):
        _ = solution.morse_index


def test_units_in_which_round_off_hides_the_signs_are_refused_at_once():
    """Nothing is cut in vain, and in the units of the motion nothing is hidden."""
    size = np.array([2.0**40, 2.0**-20])

    def lagrangian(q, v, t):
        x, y, rate = q[0] / size[0], q[1] / size[1], [v[i] / size[i] for i in (0, 1)]
        return (rate[0] ** 2 + rate[1] ** 2) / 2 - 9 * x - 2 * (y - x**2) ** 2

    system = ao.System(lagrangian, ["x", "y"])
    events = ao.Event(0.0, size * [0.5, 1.0]), ao.Event(1.0, size * [2.0, 3.0])
    solution = ao.solve(ao.Problem(system, *events))
    with pytest.raises(ValueError, match="round-off hides"):
        second_variation(solution, 3)
    found = second_variation(solution, 3, units=size).eigenvalues
    assert np.sum(found < 0) == solution.morse_index == 1


@pytest.mark.parametrize("size", [1.0, 1e-3, 1e-6, 1e-9])
def test_the_index_does_not_depend_on_how_far_a_coordinate_goes(size):
    """Two equal oscillators past their first conjugate time: both count."""
    system = systems.oscillator("x y")
    problem = ao.Problem(system, ao.Event(0.0, [0.0, 0.0]), ao.Event(4.0, [1.0, size]))
    assert ao.solve(problem, tol=1e-9).morse_index == 2


@at_once(
    "choices",
    [
        {"count": 2.5},
        {"count": "two"},
        {"count": 0},
        {"units": -1.0},
        {"units": "metres"},
        {"units": [1.0, 2.0, 3.0]},
        {"units": [[1.0]]},
        {"units": np.nan},
    ],
)
def test_choices_that_make_no_sense_are_one_sentence(choices):
    system = systems.oscillator()
    solution = ao.solve(ao.Problem(system, ao.Event(0, [1.0]), ao.Event(1, [0.5])))
    with pytest.raises(ValueError, match=r"whole count|the units|positive units"):
        second_variation(solution, **choices)


# -- signs that the path's error leaves open, families of paths, spurious paths -------------


@pytest.mark.parametrize("miss", [3e-4, 3e-3])
@pytest.mark.parametrize("side", [1, -1])
def test_kind_does_not_depend_on_the_tolerance(miss, side):
    # mu = 1 - (w T / pi)^2 is smaller than what an error of 1e-3 leaves open
    fine = oscillation(1.0 + side * miss, tol=1e-10)
    near = ao.Path(fine.mesh, fine.path.values * (1 + 1e-4 * np.sin(np.pi * fine.mesh.nodes)))
    coarse = dataclasses.replace(fine, path=near, error=1e-3)
    for solution in (fine, coarse, oscillation(1.0 + side * miss, tol=1e-3)):
        assert solution.morse_index == (side > 0)
        assert solution.kind == ("saddle" if side > 0 else "minimum")


@pytest.mark.quick("0")
@pytest.mark.parametrize("seed", a_quarter(range(8)))
def test_index_at_a_loose_tolerance(seed):
    system = systems.henon_heiles()
    random = np.random.default_rng(seed)
    a, b, T = 0.2 * random.normal(size=2), 0.2 * random.normal(size=2), random.uniform(3, 9)
    problem = ao.Problem(system, ao.Event(0.0, a), ao.Event(T, b))
    fine = ao.solve(problem, tol=1e-10, throw=False)
    if not fine.success:
        pytest.skip("no path")
    coarse = ao.solve(problem, guess=fine, tol=1e-3)
    rough = dataclasses.replace(coarse, error=1e-3)
    for solution in (coarse, rough):
        assert (solution.morse_index, solution.kind) == (fine.morse_index, fine.kind)


SPHERE = ao.System(lambda q, v, t: v @ v / 2, list("xyz"), constraint=lambda q, t: q @ q - 1)


@pytest.mark.slow
def test_a_family_of_paths_given_roughly():
    def arc(t):
        return np.stack([np.cos(np.pi * t), np.sin(np.pi * t), 0 * t])

    problem = ao.Problem(SPHERE, ao.Event(0.0, [1, 0, 0]), ao.Event(1.0, [-1, 0, 0]))
    mesh = ao.Mesh.uniform(0.0, 1.0, 8, 4)
    shift = 1e-4 * np.sin(np.pi * mesh.nodes) * np.sin(3 * mesh.nodes)
    path = ao.Path(mesh, arc(mesh.nodes) + np.stack([0 * shift, shift, shift]))
    lam = np.full((1, mesh.nodes.size), -(np.pi**2) / 2)
    rough = ao.Solution(problem, path, 0.0, lam, 1e-3, ao.Status.UNRESOLVED, {})
    found = rough.inertia
    assert (found.index, found.nullity, found.tolerance) == (0, 1, 1e-8)


def test_a_path_through_the_centre_of_a_sphere_has_no_index():
    problem = ao.Problem(SPHERE, ao.Event(0.0, [1, 0, 0]), ao.Event(1.0, [-1, 0, 0]))
    mesh = ao.Mesh.uniform(0.0, 1.0, 2, 8)
    line = ao.Path(mesh, np.stack([1 - 2 * mesh.nodes, 0 * mesh.nodes, 0 * mesh.nodes]))
    lam = np.full((1, mesh.nodes.size), np.nan)
    lost = ao.Solution(problem, line, 0.0, lam, np.inf, ao.Status.NOT_FOUND, {})
    asked = (
        lambda: lost.kind,
        lambda: second_variation(lost),
        lambda: ao.conjugate_points(lost),
        lost.sensitivity,
        lambda: lost.multiplier_error,
    )
    for ask in asked:
        with pytest.raises(ValueError, match="independent constraints"):
            ask()


def four_bars(N, T):
    """Return N parallel four-bar linkages in a row that fall flat on their way, and when."""
    g = 9.81

    def lagrangian(q, v, t):
        y, u, w = q[1::2], v[::2], v[1::2]
        cranks = sum(u[i] ** 2 + w[i] ** 2 for i in range(N + 1)) / 6
        rods = (
            sum(s[i] ** 2 + s[i + 1] ** 2 + s[i] * s[i + 1] for s in (u, w) for i in range(N)) / 6
        )
        height = sum(y[i] for i in range(N + 1)) / 2 + sum(y[i] + y[i + 1] for i in range(N)) / 2
        return cranks + rods - g * height

    def rods(q, t):
        x, y = q[::2], q[1::2]
        cranks = [(x[i] - i) ** 2 + y[i] ** 2 - 1 for i in range(N + 1)]
        return cranks + [(x[i + 1] - x[i]) ** 2 + (y[i + 1] - y[i]) ** 2 - 1 for i in range(N)]

    M, G = (N + 1) / 3 + N, g * ((N + 1) / 2 + N)
    run = integrated(lambda t, y: [y[1], -G / M * np.cos(y[0])], [np.pi / 2, -1.0], 0.0, T)

    def curve(t):
        angle = run(t)[0]
        return np.concatenate([np.stack([i + np.cos(angle), np.sin(angle)]) for i in range(N + 1)])

    names = [f"{a}{i}" for i in range(N + 1) for a in "xy"]
    system = ao.System(lagrangian, names, constraint=rods)
    problem = ao.Problem(system, ao.Event(0.0, curve(0.0)), ao.Event(T, curve(T)))
    flat = brentq(lambda t: run(t)[0], 0.1, T, xtol=1e-15) if run(T)[0] < 0 else None
    return problem, curve, flat


@pytest.mark.long
@pytest.mark.parametrize("N", [1, pytest.param(5, marks=pytest.mark.slow)])
def test_a_mechanism_that_passes_a_flat_position(N):
    # One freedom, d2S = int M eta'^2 + G sin(theta) eta^2 dt, positive up to T = 1.
    problem, curve, flat = four_bars(N, 1.0)
    solution = ao.solve(problem, guess=curve)
    assert solution.morse_index == 0 and solution.kind == "minimum"
    # A node just there: nothing is known of its neighbours.
    half = 1.0 - flat
    parts = np.linspace(0, 1, 10)
    mesh = ao.Mesh(np.r_[flat * parts, flat + half * parts[1:]], 8)
    there = ao.solve(problem, guess=curve, mesh=mesh)
    for ask in (
        lambda: there.kind,
        lambda: second_variation(there),
        lambda: ao.conjugate_points(there),
        there.sensitivity,
    ):
        with pytest.raises(ValueError, match=f"independent constraints.*t = {flat:.6g}"):
            ask()


def test_the_error_of_multipliers_is_relative_to_the_largest():
    """With one row its unit cancels: eight times how far they are off, over the largest."""
    system = ao.System(
        lambda q, v, t: v @ v / 2 - 981.0 * q[1],
        ["x", "y"],
        constraint=lambda q, t: q[0] ** 2 + q[1] ** 2 - 1,
    )
    ends = [[np.sin(a), -np.cos(a)] for a in (0.3, -0.2)]
    problem = ao.Problem(system, ao.Event(0.0, ends[0]), ao.Event(0.1, ends[1]))
    solution = ao.solve(problem, mesh=ao.Mesh.uniform(0.0, 0.1, 2, 5))
    exact = solution.discrete.multipliers(solution.mesh.nodes).T
    off = np.nanmax(np.abs(solution.lam - exact)) / np.max(np.abs(exact))
    assert off > 1e-9
    assert solution.multiplier_error == pytest.approx(8 * off, rel=1e-6)


# -- from one factorization -----------------------------------------------------------------------


def springs(q, v, t):
    stretched = np.concatenate([q[:1], q[1:] - q[:-1], q[-1:]])
    return v @ v / 2 - stretched @ stretched / 2


@pytest.mark.parametrize(("masses", "T"), [(3, 3.0), (24, 2.0), (24, 9.7)])
def test_many_coordinates_against_the_modes_of_a_row_of_springs(masses, T):
    """Each mode of frequency w has passed w T / pi conjugate times; in blocks, and sparsely."""
    system = ao.System(springs, [f"u{k}" for k in range(masses)])
    shape = np.sin(np.arange(masses) ** 2.0)
    problem = ao.Problem(system, ao.Event(0.0, shape), ao.Event(T, shape[::-1]))
    solution = ao.solve(problem)
    frequencies = 2 * np.sin(np.pi * np.arange(1, masses + 1) / (2 * masses + 2))
    assert solution.discrete.tr.layout.storage == ("blocks" if masses == 3 else "sparse")
    assert regular_index(solution.discrete, 1e-9, 1e-5) == np.sum(frequencies * T // np.pi)


def test_an_eigenvalue_near_zero_is_left_to_the_count_that_tells():
    T = 3 * np.pi / W
    for part, told in ((1 - 1e-3, 2), (1 - 1e-5, None), (1.0, None), (1 + 1e-5, None), (1.001, 3)):
        problem = ao.Problem(OSCILLATOR, ao.Event(0.0, 0.0), ao.Event(part * T, 0.0))
        at = ao.solve(problem, throw=False).discrete
        assert regular_index(at, 1e-12, 1e-5) == told


@pytest.mark.long
def test_chain_against_all_pivots():
    scene = scenes.get("chain", links=8)
    solution = ao.solve(scene.problem, guess=scene.guess)
    at = solution.discrete
    assert at.tr.layout.storage == "sparse"
    expected = inertia_of(resolve(at, solution.error, 1e-6)).index
    assert regular_index(at, solution.error, 1e-5) == expected > 0


def test_signs_that_are_round_off_are_no_index():
    for index, nullity in ((-1, 0), (0, -2)):
        with pytest.raises(ValueError, match="round-off"):
            Inertia(index, nullity, None, 1e-8)


def bent(tol):
    """A beam at the load at which it buckles; what it rests on, of b q^4, holds it."""
    L = lambda q, v, a, t: a[0] ** 2 / 2 - 2 * (np.pi * v[0]) ** 2 + 4e-3 * q[0] ** 4 + 3e-4 * q[0]  # noqa: E731
    ends = (ao.Event(t, [0.0], v=[0.0]) for t in (0.0, 1.0))
    return ao.solve(ao.Problem(ao.System(L, ["w"]), *ends), tol=tol)


def past_the_antipode(tol):
    """Through the antipode of an oscillator that is nearly isochronous."""
    system = ao.System(lambda q, v, t: (v @ v - q @ q) / 2 - 3e-4 * (q @ q) ** 2, ["x", "y"])
    ends = ao.Event(0, [0.7, -0.4]), ao.Event(np.pi + 1, [0.2, 0.9])
    antipode = ao.Event(np.pi, [-0.7, 0.4])
    return ao.solve(ao.Problem(system, *ends, through=[antipode]), tol=tol)


@pytest.mark.quick("bent")
@pytest.mark.parametrize("question", [bent, past_the_antipode])
def test_degenerate_is_said_of_no_loose_tolerance(question):
    loose, fine = question(1e-3), question(1e-9)
    assert loose.kind == fine.kind != "degenerate"
    assert loose.morse_index == fine.morse_index


def test_a_regular_index_is_one_that_is_clear(monkeypatch):
    def told(clear, negative=3, rows=1):
        at = SimpleNamespace(tr=SimpleNamespace(layout=SimpleNamespace(rows=rows)))
        form = SimpleNamespace(factors=SimpleNamespace(negative=lambda: negative), at=at)
        monkeypatch.setattr(regular, "assemble", lambda *given: form)
        monkeypatch.setattr(regular, "_is_clear", clear)
        return regular.regular_index(None, 0.0, 1e-5)

    def singular(*given):
        raise np.linalg.LinAlgError

    assert told(lambda *given: True) == 2
    assert told(lambda *given: True, negative=0) is None  # it is round-off
    assert told(lambda *given: False) is None and told(singular) is None
