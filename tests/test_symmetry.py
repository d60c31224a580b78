"""Symmetries against the book's conserved quantities, and against motions integrated by scipy."""

import numpy as np
import pytest
import systems
from helpers import a_quarter, at_once, integrated

import actionopt as ao
from actionopt import scenes
from actionopt.mechanics.conservation.noether import points_of
from actionopt.mechanics.conservation.symmetry import (
    _echelon,
    cyclic,
    find_symmetries,
    is_mechanical,
    noether,
)

FORMULA_TOLERANCE = 1e-12
INTEGRATION_TOLERANCE = 1e-9


def motion(system, parameters=None, seed=0):
    """Return q, v, t along a motion from a state in general position (no constraints)."""
    n = system.n
    y = 0.6 * np.random.default_rng(seed).standard_normal(2 * n)

    def flow(t, y):
        a = system.acceleration(y[:n], y[n:], t, parameters=parameters)
        return np.concatenate([y[n:], a])

    t = np.linspace(0.1, 0.9, 15)
    return *np.split(integrated(flow, y, 0.0, 1.0, rtol=1e-12)(t), 2), t


def spread(quantity, q, v, t, parameters=None):
    values = quantity(q, v, t, parameters=parameters)
    return np.max(np.abs(values - values[0])) / max(1.0, np.max(np.abs(values)))


def free(n):
    return ao.System(lambda q, v, t: v @ v / 2, [f"x{i}" for i in range(n)])


def oscillator_2d(kx=1.0, ky=1.0):
    def lagrangian(q, v, t, *, kx, ky):
        return (v @ v - kx * q[0] ** 2 - ky * q[1] ** 2) / 2

    return ao.System(lagrangian, ["x", "y"], parameters={"kx": kx, "ky": ky})


# -- noether ---------------------------------------------------------------------------------


@pytest.mark.quick(
    "two_on_a_line-<lambda>-0-b p1 - a p2",
    "oscillator_2d-<lambda>-0-angular momentum",
    "screw-<lambda>-0-screw momentum",
    "inverted_cone-generator4-0-angular momentum",
    "pendulum-generator5--1-energy",
    "hoop_bead-generator7--1-energy in the turning frame",
)
@pytest.mark.parametrize(
    ("name", "generator", "time", "fact"),
    [
        ("two_on_a_line", lambda q, t, *, a, b: [b, -a], 0, "b p1 - a p2"),
        ("oscillator_2d", lambda q, t: [-q[1], q[0]], 0, "angular momentum"),
        ("screw", lambda q, t, *, c: [c, 1.0], 0, "screw momentum"),
        ("kepler", lambda q, t: [-q[1], q[0]], 0, "angular momentum"),
        ("inverted_cone", [0, 1], 0, "angular momentum"),
        ("pendulum", [0], -1, "energy"),
        ("rod_pendulum", [0, 0], -1, "energy"),
        ("hoop_bead", [0], -1, "energy in the turning frame"),
    ],
)
def test_conserved_quantities_are_the_book_s(name, generator, time, fact):
    scene = scenes.get(name)
    problem = scene.problem
    known = scene.facts["conserved"][fact]
    found = noether(problem.system, generator, time=time)
    solution = ao.solve(problem, tol=1e-11, guess=scene.guess)
    t = np.linspace(problem.start.t, problem.end.t, 11)
    q, v = solution(t), solution.velocity(t)
    values = found(q, v, t, parameters=problem.parameters)
    assert np.max(np.abs(values - known(q, v, t))) < FORMULA_TOLERANCE * np.max(np.abs(values))
    assert found.drift(solution) < INTEGRATION_TOLERANCE
    assert found(q[:, 0], v[:, 0], t[0], parameters=problem.parameters).shape == ()


def test_drift_sees_parameters_that_break_the_symmetry():
    momentum = noether(oscillator_2d(), lambda q, t: [-q[1], q[0]])
    ends = ao.Event(0, [0.3, -0.5]), ao.Event(1, [0.7, 0.4])
    for ky, low, high in ((1.0, 0.0, 1e-11), (1.3, 1e-3, 1.0)):
        system = momentum.system
        solution = ao.solve(ao.Problem(system, *ends, parameters={"ky": ky}), tol=1e-12)
        assert low <= momentum.drift(solution) <= high


@pytest.mark.quick(
    "<lambda>-0-no total derivative0",
    "<lambda>-<lambda>-no total derivative",
    "<lambda>-0-return 2 values, found 1",
    "<lambda>-<lambda>-expected time\\\\(t",
)
@pytest.mark.parametrize(
    ("generator", "time", "words"),
    [
        (lambda q, t: [1.0, 0.0], 0, "no total derivative"),
        (lambda q, t: [q[1], q[0]], 0, "no total derivative"),
        (lambda q, t: [0.0, 0.0], lambda t: t, "no total derivative"),
        (lambda q, t: [0.0], 0, "return 2 values, found 1"),
        (lambda q, t: [-q[1], q[0]], lambda q, t: t, r"expected time\(t"),
    ],
)
def test_what_is_no_symmetry_is_refused(generator, time, words):
    with pytest.raises(ValueError, match=words):
        noether(oscillator_2d(), generator, time=time)


def test_symmetries_are_those_of_a_system():
    problem = scenes.get("kepler").problem
    for asked in (find_symmetries, lambda law: noether(law, [0, 0])):
        with pytest.raises(ValueError, match=r"expected a System.*a problem has one"):
            asked(problem)  # type: ignore[arg-type]


def test_a_symmetry_of_some_parameters_is_checked_for_those():
    system = oscillator_2d(ky=2.0)
    with pytest.raises(ValueError, match="parameters"):
        noether(system, lambda q, t: [-q[1], q[0]])
    noether(system, lambda q, t: [-q[1], q[0]], parameters={"ky": 1.0})


@pytest.mark.long
def test_symmetries_up_to_a_total_derivative():
    """Boost: I = p t - m x. Falling: I = p_y + m g t. Oscillator: phase and amplitude."""
    boost = noether(free(1), lambda q, t: [t])
    assert abs(boost([0.3], [2.0], 0.7) - (2.0 * 0.7 - 0.3)) < FORMULA_TOLERANCE
    projectile = scenes.get("projectile")
    fall = noether(projectile.problem.system, [0, 1])
    solution = ao.solve(projectile.problem, tol=1e-12)
    assert fall.drift(solution) < FORMULA_TOLERANCE

    def lagrangian(q, v, t, *, w):
        return (v[0] ** 2 - (w * q[0]) ** 2) / 2

    system = ao.System(lagrangian, ["x"], parameters={"w": 3.0})
    phase = noether(system, lambda q, t, *, w: [np.cos(w * t)])
    x, v, t = 0.4, -0.9, 1.3  # x' cos wt + w x sin wt: the velocity at t = 0
    expected = v * np.cos(3 * t) + 3 * x * np.sin(3 * t)
    assert abs(phase([x], [v], t) - expected) < FORMULA_TOLERANCE


def test_a_gauge_may_be_given():
    def lagrangian(q, v, t):
        return v[0] ** 2 / 2 - 9.81 * q[0] / (1 + t**2)

    system = ao.System(lagrangian, ["x"])
    found = noether(system, [1.0], gauge=lambda q, t: -9.81 * np.arctan(t))
    assert abs(found([0.2], [1.5], 0.4) - (1.5 + 9.81 * np.arctan(0.4))) < FORMULA_TOLERANCE
    with pytest.raises(ValueError, match="no total derivative"):
        noether(system, [1.0], gauge=lambda q, t: 9.81 * np.arctan(t))


@pytest.mark.long
def test_constraints_must_be_kept():
    """A body on a tilted circular hoop: turning about its axis is a symmetry, about z not."""
    axis = np.array([0.0, 0.6, 0.8])

    def constraint(q, t):
        return [ao_dot(q, q) - 1, ao_dot(axis, q)]

    def ao_dot(a, b):
        return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]

    def turning(d):
        return lambda q, t: [
            d[1] * q[2] - d[2] * q[1],
            d[2] * q[0] - d[0] * q[2],
            d[0] * q[1] - d[1] * q[0],
        ]

    system = systems.particle("x y z", constraint=constraint)
    found = noether(system, turning(axis))
    q, v = np.array([0.0, 0.8, -0.6]), np.array([2.0, 0.0, 0.0])
    assert abs(found(q, v, 0.0) - axis @ np.cross(q, v)) < FORMULA_TOLERANCE
    with pytest.raises(ValueError, match="off their surface"):
        noether(system, turning([0.0, 0.0, 1.0]))


def test_forces_take_part():
    """With drag -b x' the momentum p + b x is constant, not p; H of a driven body is not."""
    system = ao.System(
        lambda q, v, t, *, m: m * v[0] ** 2 / 2,
        ["x"],
        parameters={"m": 2.0, "b": 0.5},
        force=lambda q, v, t, *, b: [-b * v[0]],
    )
    found = noether(system, [1.0])
    assert abs(found([0.7], [3.0], 0.0) - (2.0 * 3.0 + 0.5 * 0.7)) < FORMULA_TOLERANCE
    with pytest.raises(ValueError, match="no total derivative"):
        noether(system, [0.0], time=1)
    # x is not in L or Q, but its momentum is not constant either
    assert system.structure.cyclic == ("x",) and cyclic(system) == {}


# -- cyclic coordinates and energy -------------------------------------------------------------


@pytest.mark.quick("pendulum-coordinates2")
@pytest.mark.parametrize(
    ("name", "coordinates"),
    [
        pytest.param("kepler_spherical", ["phi"], marks=pytest.mark.slow),
        ("heavy_top", ["phi", "psi"]),
        ("pendulum", []),
    ],
)
def test_cyclic_coordinates_are_found(name, coordinates):
    system = scenes.get(name).problem.system
    momenta = cyclic(system)
    assert list(momenta) == coordinates
    if momenta:
        q, v, t = motion(system, seed=1)
        for c, momentum in momenta.items():
            k = system.coordinates.index(c)
            assert spread(momentum, q, v, t) < INTEGRATION_TOLERANCE
            difference = momentum(q, v, t) - system.momentum(q, v, t)[k]
            assert np.max(np.abs(difference)) < FORMULA_TOLERANCE


@at_once(
    ("name", "mechanical"),
    [
        ("pendulum", True),
        ("double_pendulum", True),
        ("kepler_spherical", True),
        ("turning_wire", True),  # in coordinates at rest, though energy is not conserved
        ("damped_oscillator", True),
        ("oscillating_wall", False),
        ("rotating_frame_free", False),
        ("charge_planar", False),
        ("oscillator_gauge", False),
    ],
)
def test_energy_is_mechanical(name, mechanical):
    assert scenes.get(name).problem.system.energy_is_mechanical is mechanical


def test_kinetic_energy_of_moving_coordinates_is_not_homogeneous():
    def still(q, v, t, *, m, R):
        return m * (R * v[0]) ** 2 / 2

    def turning(q, v, t, *, m, R, w):
        return m * R**2 * (v[0] ** 2 + (w * np.sin(q[0])) ** 2) / 2

    hoop = scenes.get("hoop_bead").problem.system
    assert hoop.energy_is_mechanical  # L alone does not tell
    assert not is_mechanical(hoop, turning)
    pendulum = scenes.get("pendulum").problem.system
    assert is_mechanical(pendulum, lambda q, v, t, *, m, l: m * (l * v[0]) ** 2 / 2)
    quartic = ao.System(lambda q, v, t: v[0] ** 4, ["x"])
    assert not quartic.energy_is_mechanical


# -- find_symmetries ---------------------------------------------------------------------------


@pytest.mark.long
@pytest.mark.parametrize("n", a_quarter([2, 1, 3]))
def test_free_particle_has_the_galilean_group_and_scaling(n):
    """n translations, n boosts, n (n - 1) / 2 rotations, time, and x -> x d / 2, t -> t d."""
    found = find_symmetries(free(n))
    assert len(found) == 2 * n + n * (n - 1) // 2 + 2
    [scaling] = [s for s in found if s.rate]
    assert np.allclose(scaling.A * 2, np.eye(n) * scaling.rate, atol=1e-12)


@pytest.mark.quick(
    "oscillator_2d-expected1",
    "kepler-expected2",
    "turning_wire-expected6",
    "oscillating_wall-expected7",
)
@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("two_on_a_line", {"q1: 1, q2: 2", "t: 1", "q1: t, q2: 2 t"}),
        ("oscillator_2d", {"t: 1", "x: -y, y: x"}),
        ("kepler", {"t: 1", "x: -y, y: x"}),
        ("screw", {"phi: 1, z: 0.666667", "t: 1", "phi: t, z: 0.666667 t"}),
        ("heavy_top", {"phi: 1", "psi: 1", "t: 1"}),
        ("double_pendulum", {"t: 1"}),
        ("turning_wire", {"x: -1.5 y, y: 1.5 x, t: 1"}),
        ("oscillating_wall", set()),
    ],
)
def test_symmetries_are_found(name, expected):
    scene = scenes.get(name)
    found = find_symmetries(scene.problem.system)
    assert {str(s) for s in found} == expected
    solution = ao.solve(scene.problem, tol=1e-11, guess=scene.guess)
    for symmetry in found:
        assert symmetry.conserved.drift(solution) < INTEGRATION_TOLERANCE


def test_symmetries_depend_on_the_numbers():
    system = oscillator_2d(ky=2.0)
    assert len(find_symmetries(system)) == 1
    both = find_symmetries(system, parameters={"ky": 1.0})
    assert [str(s) for s in both] == ["t: 1", "x: -y, y: x"]
    assert np.allclose(both[1]([2.0, 3.0], 0.0), [-3.0, 2.0])


@pytest.mark.long
@pytest.mark.parametrize(("mu", "m"), [(3.986e14, 1e3), (253.0, 9.1e-31), (1e-20, 1.0)])
def test_units_make_no_symmetries(mu, m):
    """A satellite, an electron: what is small beside the rest of L counts as well."""

    def lagrangian(q, v, t, *, mu, m):
        return m * (v @ v) / 2 + m * mu / np.sqrt(q @ q)

    system = ao.System(lagrangian, ["x", "y"], parameters={"mu": mu, "m": m})
    assert [str(s) for s in find_symmetries(system)] == ["t: 1", "x: -y, y: x"]
    for generator, time in ((lambda q, t: [q[0], q[1]], lambda t: 2 * t), (lambda q, t: [t, 0], 0)):
        with pytest.raises(ValueError, match="no total derivative"):
            noether(system, generator, time=time)
    magnetic = ao.System(
        lambda q, v, t, *, mu, m: lagrangian(q, v, t, mu=mu, m=m) + 1e-3 * m * q[0] * v[1],
        ["x", "y"],
        parameters={"mu": mu, "m": m},
    )
    assert system.energy_is_mechanical and not magnetic.energy_is_mechanical


def test_gauge_that_is_no_polynomial():
    """A pendulum on an accelerated pivot: L_t = d/dt (m a (l sin theta + a t^2 / 2))."""
    scene = scenes.get("moving_pivot")
    found = noether(scene.problem.system, [0.0], time=-1.0)
    solution = ao.solve(scene.problem, tol=1e-11)
    assert found.drift(solution) < INTEGRATION_TOLERANCE
    assert np.ptp(solution.energy(np.linspace(0, 0.9, 9))) > 1.0


def test_domains_that_are_not_everything():
    """Defined for positive coordinates only; and for |v| < 1: a free relativistic particle."""
    logs = ao.System(lambda q, v, t: v @ v / 2 + np.log(q[0]) * np.log(q[1]), ["x", "y"])
    assert [str(s) for s in find_symmetries(logs)] == ["t: 1"]
    fast = ao.System(lambda q, v, t: -np.sqrt(1 - v @ v), ["x", "y", "z"])
    momentum = noether(fast, [0.0, 1.0, 0.0])
    assert abs(momentum(np.zeros(3), np.array([0.0, 0.6, 0.0]), 0.0) - 0.75) < FORMULA_TOLERANCE
    assert not fast.energy_is_mechanical
    never = ao.System(lambda q, v, t: v[0] ** 2 / 2 + np.sqrt(-1 - q[0] ** 2), ["x"])
    with pytest.raises(ValueError, match="finite at some points"):
        noether(never, [1.0])


def test_scaling_of_an_inverse_square_potential():
    system = ao.System(lambda q, v, t: v @ v / 2 - 1 / (q @ q), ["x", "y"])
    assert [str(s) for s in find_symmetries(system)] == [
        "t: 1",
        "x: x, y: y, t: 2 t",
        "x: -y, y: x",
    ]


def test_a_force_along_one_coordinate_leaves_the_momentum_of_another():
    system = systems.particle("x y", force=lambda q, v, t: [0 * v[0], -v[1]])
    assert system.structure.cyclic == ("x", "y")
    momenta = cyclic(system)
    assert list(momenta) == ["x"]
    assert float(momenta["x"]([0.3, 0.7], [2.0, 5.0], 0.0)) == 2.0


@pytest.mark.long
def test_a_gauge_that_the_rule_cannot_integrate_is_refused_or_right():
    """Moving x changes L by y' / (1 + 400 y^2), the rate of atan(20 y) / 20: steep near zero."""
    system = ao.System(lambda q, v, t: v @ v / 2 + q[0] * v[1] / (1 + 400 * q[1] ** 2), ["x", "y"])
    given = noether(system, [1.0, 0.0], gauge=lambda q, t: np.arctan(20 * q[1]) / 20)
    q, v, t = motion(system, seed=1)
    assert np.ptp(20 * q[1]) > 10  # from steep to flat
    assert spread(given, q, v, t) < INTEGRATION_TOLERANCE
    try:
        found = noether(system, [1.0, 0.0])
    except ValueError as error:
        assert "no total derivative" in str(error)
    else:
        assert spread(found, q, v, t) < INTEGRATION_TOLERANCE


@pytest.mark.long
@pytest.mark.parametrize(("slope", "whole"), [(1 + 1e-8, False), (1 + 1e-10, True)])
def test_only_what_is_a_whole_number_up_to_rounding_becomes_one(slope, whole):
    """L depends on y - slope x: moving x by one and y by the slope changes nothing."""
    system = ao.System(lambda q, v, t: v @ v / 2 - (q[1] - slope * q[0]) ** 2, ["x", "y"])
    moves = [s for s in find_symmetries(system) if s.b.any() and not s.c.any() and not s.A.any()]
    [move] = moves
    assert (move.b[1] == move.b[0]) == whole
    assert move.b[1] / move.b[0] == pytest.approx(slope, rel=2e-10)


# -- linear algebra ------------------------------------------------------------------------------


@at_once("seed", range(6))
def test_the_echelon_form_depends_on_the_space_alone(seed):
    """Rows [1 0 a; 0 1 b] and the like, mixed by any regular matrix, come back."""
    rng = np.random.default_rng(seed)
    known = np.zeros((3, 6))
    columns = np.sort(rng.choice(6, 3, replace=False))
    for i, k in enumerate(columns):
        known[i, k:] = rng.uniform(-2.0, 2.0, 6 - k)
        known[: i + 1, k] = np.arange(i + 1) == i
    for i in range(3):
        known[i, columns] = np.arange(3) == i
    for mix in (np.eye(3), -np.eye(3), rng.normal(size=(3, 3)), -np.abs(rng.normal(size=(3, 3)))):
        assert np.allclose(_echelon(mix @ known), known, rtol=0, atol=1e-9)


def test_a_pivot_is_the_entry_that_is_largest_in_magnitude():
    rows = np.array([[1e-8, 1.0, 0.0], [-1.0, 0.5, 3.0]])
    found = _echelon(rows)
    assert found == pytest.approx(
        np.array([[1.0, 0.0, -3.0 + 1.5e-8], [0.0, 1.0, 3e-8]]), abs=1e-12
    )


@pytest.mark.long
@pytest.mark.parametrize(
    ("constraint", "n"),
    [
        (lambda q, t: [q[0] ** 2 + q[1] ** 2 + q[2] ** 2 - 4.0], 3),
        (lambda q, t: [q[0] ** 2 / 9 + q[1] ** 2 - 1 - t**2 / 5], 2),
        (lambda q, t: [q[0] * q[1] - 3.0, q[2] - np.sin(q[0])], 3),
        (lambda q, t: [np.exp(q[0]) + np.exp(-q[1]) - 0.05 - q[2] ** 2], 3),
    ],
)
def test_points_in_general_position_are_on_the_surface_and_move_along_it(constraint, n):
    system = ao.System(lambda q, v, t: v @ v / 2, list("xyz")[:n], constraint=constraint)
    q, v, t = points_of(system, system.table.pack(system.parameters))
    assert len(q) >= 20  # hardly one of them is lost
    f = system.constraint(q.T, t[:, 0])
    assert np.max(np.abs(f)) <= 1e-11
    slow = np.max(np.abs(v), axis=1) < 10  # others are of all sizes
    q, v, t, h = q[slow], v[slow], t[slow], 1e-6
    assert len(q) >= 20
    ahead, behind = (system.constraint((q + s * h * v).T, t[:, 0] + s * h) for s in (1, -1))
    # A third derivative times h^2 / 6, and rounding over h.
    assert np.max(np.abs(ahead - behind)) / (2 * h) <= 1e-7
    assert np.linalg.matrix_rank(q) == n  # in general position still


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_drift_is_relative_to_the_size_of_the_terms(side):
    """Along x'' = f the momentum p changes by f T, and is all there is of it."""
    system = ao.System(lambda q, v, t, *, f: v[0] ** 2 / 2 + f * q[0], ["x"], parameters={"f": 0.0})
    momentum = noether(system, [1.0])
    events = ao.Event(0.0, [0.0]), ao.Event(1.0, [side])
    solution = ao.solve(ao.Problem(system, *events, parameters={"f": 1e-3 * side}))
    assert momentum.drift(solution) == pytest.approx(1e-3 / (1 + 5e-4), rel=1e-6)
    solution = ao.solve(ao.Problem(system, *events, parameters={"f": -1e-3 * side}))
    assert momentum.drift(solution) == pytest.approx(1e-3 / (1 + 5e-4), rel=1e-6)


@pytest.mark.long
@pytest.mark.parametrize("side", a_quarter([-1.0, 1.0]))
def test_points_that_do_not_get_onto_a_surface_are_left_out(side):
    """From beyond its top Newton's steps on x / (1 + x^2) lead away for ever."""
    system = systems.particle("x y", constraint=lambda q, t: [side * q[0] / (1 + q[0] ** 2) - 0.1])
    q, _, t = points_of(system, system.table.pack(system.parameters))
    assert 0 < len(q) < 40
    assert np.max(np.abs(system.constraint(q.T, t[:, 0]))) <= 1e-12


def test_only_a_solution_shows_a_drift():
    turning = ao.noether(systems.particle("x y"), lambda q, t: [q[1], -q[0]])
    with pytest.raises(ValueError, match="expected a Solution along which to look, found 3"):
        turning.drift(3)
