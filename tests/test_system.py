"""Quantities of Lagrangian mechanics against formulas derived by hand, at seeded random points."""

import math
import warnings

import casadi as ca
import numpy as np
import pytest
from helpers import at_once

import actionopt as ao
from actionopt.mechanics.system import System

K = 7
ROUND_OFF = 1e-13  # a few hundred operations on numbers of order one to ten


def points(n, seed=0):
    """Return q, v of shape (n, K) and K times, all of order one."""
    rng = np.random.default_rng(seed)
    return rng.uniform(0.3, 1.5, (n, K)), rng.uniform(-2, 2, (n, K)), rng.uniform(0, 3, K)


def close(found, expected):
    found, expected = np.asarray(found), np.asarray(expected)
    assert found.shape == expected.shape
    assert np.max(np.abs(found - expected)) <= ROUND_OFF * max(1.0, float(np.max(np.abs(expected))))


# -- systems with known formulas -------------------------------------------------------------


def double_pendulum_lagrangian(q, v, t, *, m1, m2, l1, l2, g):
    a, b = q
    va, vb = v
    kinetic = (m1 + m2) * (l1 * va) ** 2 / 2 + m2 * (l2 * vb) ** 2 / 2
    kinetic += m2 * l1 * l2 * va * vb * np.cos(a - b)
    return kinetic + (m1 + m2) * g * l1 * np.cos(a) + m2 * g * l2 * np.cos(b)


SETS = [
    {"m1": 1.0, "m2": 1.0, "l1": 1.0, "l2": 1.0, "g": 9.81},
    {"m1": 2.5, "m2": 0.4, "l1": 0.7, "l2": 1.3, "g": 1.62},
]
double_pendulum = System(double_pendulum_lagrangian, ("a", "b"), parameters=SETS[0])


def kepler_lagrangian(q, v, t, *, mu):
    return v @ v / 2 + mu / np.sqrt(q @ q)


kepler = System(kepler_lagrangian, ("x", "y"), parameters={"mu": 1.0})


def wall_lagrangian(q, v, t, *, m, k, A, w):
    """A mass on a spring whose other end moves as A cos w t."""
    return m * v[0] ** 2 / 2 - k * (q[0] - A * np.cos(w * t)) ** 2 / 2


wall = System(wall_lagrangian, ["x"], parameters={"m": 2.0, "k": 3.0, "A": 0.5, "w": 1.7})


def rod_lagrangian(q, v, t, *, m, g):
    x, y = q
    return m * (v[0] ** 2 + v[1] ** 2) / 2 - m * g * y


def rod_constraint(q, t, *, l):
    x, y = q
    return x**2 + y**2 - l**2


rod = System(
    rod_lagrangian,
    ("x", "y"),
    parameters={"m": 1.5, "g": 9.81, "l": 0.8},
    constraint=rod_constraint,
)


@pytest.mark.parametrize("p", SETS)
def test_double_pendulum_momentum_energy_mass_and_acceleration(p):
    q, v, t = points(2)
    (a, b), (va, vb) = q, v
    m1, m2, l1, l2, g = p.values()
    c, s = np.cos(a - b), np.sin(a - b)
    M = np.array(
        [[(m1 + m2) * l1**2 + 0 * a, m2 * l1 * l2 * c], [m2 * l1 * l2 * c, m2 * l2**2 + 0 * a]]
    )
    momentum = np.einsum("ijk,jk->ik", M, v)
    potential = -(m1 + m2) * g * l1 * np.cos(a) - m2 * g * l2 * np.cos(b)
    right = np.array(
        [
            -m2 * l1 * l2 * s * vb**2 - (m1 + m2) * g * l1 * np.sin(a),
            m2 * l1 * l2 * s * va**2 - m2 * g * l2 * np.sin(b),
        ]
    )
    close(double_pendulum.mass_matrix(q, v, t, parameters=p), M)
    close(double_pendulum.momentum(q, v, t, parameters=p), momentum)
    close(double_pendulum.energy(q, v, t, parameters=p), (v * momentum).sum(0) / 2 + potential)
    close(double_pendulum.lagrangian(q, v, t, parameters=p), (v * momentum).sum(0) / 2 - potential)
    acceleration = np.linalg.solve(np.moveaxis(M, -1, 0), right.T[..., None])[..., 0].T
    close(double_pendulum.acceleration(q, v, t, parameters=p), acceleration)


@pytest.mark.parametrize("mu", [1.0, 3.98])
def test_kepler_formulas(mu):
    q, v, t = points(2, seed=1)
    r = np.hypot(*q)
    close(kepler.generalized_force(q, v, t, parameters={"mu": mu}), -mu * q / r**3)
    close(kepler.acceleration(q, v, t, parameters={"mu": mu}), -mu * q / r**3)
    close(kepler.energy(q, v, t, parameters={"mu": mu}), (v**2).sum(0) / 2 - mu / r)
    close(kepler.momentum(q, v, t), v)


def test_an_explicit_time_enters_force_and_energy():
    q, v, t = points(1, seed=2)
    m, k, A, w = 2.0, 3.0, 0.5, 1.7
    stretch = q - A * np.cos(w * t)
    close(wall.acceleration(q, v, t), -k / m * stretch)
    close(wall.energy(q, v, t), (m * v**2 / 2 + k * stretch**2 / 2)[0])


def test_a_momentum_that_depends_on_time_and_place_enters_the_acceleration():
    # L = t v^2 / 2 + q v: p = t v + q, so d/dt p = t a + v + v = L_q = v and a = -v / t.
    system = System(lambda q, v, t: t * v[0] ** 2 / 2 + q[0] * v[0], ["x"])
    q, v, t = points(1, seed=3)
    t = t + 1
    close(system.acceleration(q, v, t), -v / t)


def test_rod_tension_and_acceleration():
    m, g, l = 1.5, 9.81, 0.8
    rng = np.random.default_rng(4)
    angle, rate = rng.uniform(-2, 2, K), rng.uniform(-3, 3, K)
    q = l * np.array([np.sin(angle), -np.cos(angle)])
    v = l * rate * np.array([np.cos(angle), np.sin(angle)])
    tension = m * l * rate**2 + m * g * np.cos(angle)
    t = np.zeros(K)
    # G' lambda is the pull of the rod, of size 2 l lambda and towards the support.
    close(rod.constraint_force(q, v, t), -tension * q / l)
    close(rod.multipliers(q, v, t), -tension[None] / (2 * l))
    close(rod.acceleration(q, v, t), np.array([0 * angle, 0 * angle - g]) - tension / m * q / l)
    close(rod.constraint(q, t), np.zeros((1, K)))
    close(rod.constraint_jacobian(q, t), 2 * q[None])


# A bead on a vertical line that moves as x = s t^2 / 2.
bead = System(
    lambda q, v, t: (v[0] ** 2 + v[1] ** 2) / 2 - 9.81 * q[1],
    ("x", "y"),
    parameters={"s": 4.0},
    constraint=lambda q, t, *, s: q[0] - s * t**2 / 2,
)


def test_a_moving_constraint_pushes():
    q, v, t = np.array([0.5, 0.2]), np.array([2.0, -1.0]), 0.5
    close(bead.acceleration(q, v, t), [4.0, -9.81])
    close(bead.constraint_force(q, v, t), [4.0, 0.0])


def test_a_force_enters_the_acceleration_and_nothing_else():
    def drag(q, v, t, *, c):
        return [-c * v[0]]

    free = System(lambda q, v, t, *, m: m * v[0] ** 2 / 2, ["x"], parameters={"m": 2.0})
    dragged = System(
        lambda q, v, t, *, m: m * v[0] ** 2 / 2, ["x"], parameters={"m": 2.0, "c": 0.6}, force=drag
    )
    q, v, t = points(1, seed=5)
    close(dragged.acceleration(q, v, t), -0.3 * v)
    close(dragged.force(q, v, t), -0.6 * v)
    close(free.force(q, v, t), 0 * v)
    close(dragged.momentum(q, v, t), free.momentum(q, v, t))


@pytest.mark.parametrize("system", [double_pendulum, kepler], ids=["double pendulum", "kepler"])
def test_velocity_inverts_momentum(system):
    q, v, _ = points(2, seed=6)
    for k in range(K):
        p = system.momentum(q[:, k], v[:, k], 0.0)
        close(system.velocity(q[:, k], p, 0.0, np.zeros(2)), v[:, k])


def test_velocity_inverts_a_relativistic_momentum():
    system = System(lambda q, v, t: -np.sqrt(1 - v[0] ** 2), ["x"])  # p = v / sqrt(1 - v^2)
    close(system.velocity([0.0], [2.0], 0.0, [0.8]), [2 / math.sqrt(5)])


def test_velocity_ignores_momentum_along_the_constraint_normal():
    q, v = np.array([0.0, -0.8]), np.array([1.2, 0.0])
    p = rod.momentum(q, v, 0.0) + [0.0, 17.0]
    close(rod.velocity(q, p, 0.0, [0.0, 0.0]), v)


def test_velocity_goes_with_a_moving_constraint():
    close(bead.velocity([0.5, 0.2], [17.0, -1.0], 0.5, [0.0, 0.0]), [2.0, -1.0])


# -- how callables may be written ------------------------------------------------------------

SAME = {
    "numpy": lambda q, v, t: np.dot(v, v) / 2 - np.exp(-np.sum(q**2)) * np.cos(t),
    "casadi": lambda q, v, t: ca.dot(v, v) / 2 - ca.exp(-ca.sumsqr(q)) * ca.cos(t),
    "unpacked": lambda q, v, t: (
        (v[0] ** 2 + v[1] ** 2) / 2 - np.exp(-(q[0] ** 2) - q[1] ** 2) * np.cos(t)
    ),
    "matrix": lambda q, v, t: v @ np.eye(2) @ v / 2 - np.exp(-(q @ q)) * np.cos(t),
    "norm": lambda q, v, t: (
        np.linalg.norm(v) ** 2 / 2 - np.exp(-(np.hypot(q[0], q[1]) ** 2)) * np.cos(t)
    ),
    "stacked": lambda q, v, t: (
        np.sum(np.stack([v[0], v[1]]) ** 2) / 2 - np.exp(-np.dot(q, q)) * np.cos(t)
    ),
}


@at_once("how", SAME)
def test_numpy_and_casadi_functions_give_the_same_physics_without_a_warning(how):
    q, v, t = points(2, seed=7)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        system = System(SAME[how], ("x", "y"))
        L = (v**2).sum(0) / 2 - np.exp(-(q**2).sum(0)) * np.cos(t)
        force = 2 * q * np.exp(-(q**2).sum(0)) * np.cos(t)
        close(system.lagrangian(q, v, t), L)
        close(system.generalized_force(q, v, t), force)


def test_array_parameters_keep_their_shape():
    M = np.array([[2.0, 0.3], [0.3, 1.0]])
    system = System(
        lambda q, v, t, *, M, w: v @ M @ v / 2 - np.sum(w * q**2),
        ("x", "y"),
        parameters={"M": M, "w": [1.0, 2.0]},
    )
    q, v, t = points(2, seed=8)
    close(system.mass_matrix(q, v, t)[:, :, 0], M)
    close(system.generalized_force(q, v, t), -2 * np.array([[1.0], [2.0]]) * q)


def test_a_callable_may_take_every_parameter_or_keep_a_default_of_its_own():
    def lagrangian(q, v, t, **p):
        return p["m"] * v[0] ** 2 / 2

    def force(q, v, t, *, c=3.0):
        return [-c * v[0]]

    system = System(lagrangian, ["x"], parameters={"m": 2.0}, force=force)
    close(system.acceleration([0.0], [1.0], 0.0), [-1.5])


def test_a_callable_may_take_its_arguments_in_a_row():
    system = System(lambda q, *rest: rest[0][0] ** 2 - rest[1] * q[0], ["x"])
    close(system.acceleration([0.0], [1.0], 4.0), [-2.0])


def test_what_is_derived_once_is_documented():
    assert "sparsity" in System.structure.__doc__


def test_one_time_gives_vectors_and_many_give_columns():
    q, v, t = points(2, seed=9)
    assert kepler.momentum(q[:, 0], v[:, 0], 0.0).shape == (2,)
    assert kepler.energy(q[:, 0], v[:, 0], 0.0).shape == ()
    assert kepler.mass_matrix(q[:, 0], v[:, 0], 0.0).shape == (2, 2)
    assert kepler.mass_matrix(q, v, t).shape == (2, 2, K)
    assert rod.constraint_jacobian(q[:, 0], 0.0).shape == (1, 2)
    assert rod.constraint_jacobian(q, t).shape == (1, 2, K)
    close(kepler.energy(q, v, t)[3], kepler.energy(q[:, 3], v[:, 3], t[3]))


def test_results_do_not_share_memory_with_the_next_call():
    q, v, t = points(2, seed=10)
    first = kepler.generalized_force(q, v, t)
    kept = first.copy()
    kepler.generalized_force(q + 1, v, t)
    assert np.array_equal(first, kept)


# -- structure -------------------------------------------------------------------------------


def test_structure_of_a_time_dependent_linear_system():
    s = wall.structure
    assert s.depends_on_time
    assert s.linear
    assert s.constant_mass and s.constant_coupling and s.constant_stiffness
    assert not s.forced
    assert s.constraints == 0
    assert s.cyclic == ()


def test_structure_of_nonlinear_systems():
    assert not double_pendulum.structure.constant_mass
    assert not double_pendulum.structure.depends_on_time
    assert kepler.structure.constant_mass and not kepler.structure.constant_stiffness
    assert not kepler.structure.linear
    assert rod.structure.constraints == 1
    assert not rod.structure.affine_constraint
    assert rod.degrees_of_freedom == 1


def test_structure_of_constraints_and_forces():
    def plain(q, v, t):
        return (v[0] ** 2 + v[1] ** 2) / 2

    plane = System(plain, ("x", "y"), constraint=lambda q, t: q[0] - 2 * q[1] - np.sin(t))
    assert plane.structure.affine_constraint and plane.structure.linear
    assert plane.structure.depends_on_time
    linear = System(plain, ("x", "y"), force=lambda q, v, t: [-v[0], 0])
    assert linear.structure.forced and linear.structure.affine_force and linear.structure.linear
    quadratic = System(plain, ("x", "y"), force=lambda q, v, t: [-v[0] * abs(v[0]), 0])
    assert not quadratic.structure.affine_force and not quadratic.structure.linear


def test_cyclic_coordinates_are_named():
    def polar(q, v, t):
        return (v[0] ** 2 + (q[0] * v[1]) ** 2) / 2 + 1 / q[0]

    assert System(polar, ("r", "phi")).structure.cyclic == ("phi",)


def test_derivation_happens_once():
    system = System(kepler_lagrangian, ("x", "y"), parameters={"mu": 1.0})
    assert system.derived == ()
    q, v, t = points(2)
    system.momentum(q, v, t)
    system.momentum(q + 1, v, t, parameters={"mu": 2.0})
    system.generalized_force(q, v, t)
    assert system.derived == ("first",)


# -- bad input -------------------------------------------------------------------------------


def simple(q, v, t, *, m):
    return m * v[0] ** 2 / 2


def branching(q, v, t):
    return v[0] ** 2 if q[0] > 0 else 2 * v[0] ** 2


def unpacked(q):
    x, y = q
    return x, y


BAD_SYSTEMS = [
    (lambda: System(3.0, ["x"]), "expected a callable lagrangian"),
    (lambda: System(lambda q, v: v[0], ["x"]), r"expected lagrangian\(q, v, t"),
    (lambda: System(lambda q, v, t, m: m * v[0], ["x"]), r"put a \* before the parameters \(m\)"),
    (lambda: System(simple, "x"), "sequence of coordinate names"),
    (lambda: System(simple, [""]), r"sequence of coordinate names, such as .*found \[''\]"),
    (lambda: System(simple, None), "sequence of coordinate names, such as .*found None"),
    (lambda: System(simple, 3), "sequence of coordinate names, such as .*found 3"),
    (lambda: System(simple, [0, 1]), r"sequence of coordinate names, such as .*found \[0, 1\]"),
    (
        lambda: System(simple, ["x"], parameters=[1.0]),
        r"expected parameters by name, such as .*, found \[1.0\]; put each value",
    ),
    (lambda: System(simple, ["x"], parameters={1: 1.0}), "expected parameters by name"),
    (lambda: System(simple, ["x"], parameters={"leg_times": 1.0}), "a problem puts the times at"),
    (
        lambda: System(simple, ["x"], parameters={"integral_multipliers": 1.0}),
        "a problem puts the multipliers of integrals there; choose another name",
    ),
    (lambda: System(simple, ["x"], parameters={"m": 1j}), "numbers for parameter 'm', found 1j"),
    (lambda: System(simple, ["x"], name=3), "name .* as text"),
    (lambda: System(simple, []), "at least one coordinate"),
    (lambda: System(simple, ["x", "x"]), "distinct names"),
    (lambda: System(simple, ["x"]), "needs the parameter 'm', which is missing"),
    (
        lambda: System(lambda q, v, t, *, mass: mass * v[0] ** 2, ["x"], parameters={"mas": 1}),
        "missing .*did you mean 'mas'",
    ),
    (
        lambda: System(simple, ["x"], parameters={"m": 1.0, "k": 2.0}),
        "parameter 'k' is used by none of the callables",
    ),
    (lambda: System(simple, ["x"], parameters={"m": np.nan}), "expected a finite parameter 'm'"),
    (
        lambda: System(simple, ["x"], parameters={"m": "heavy"}),
        "number or an array of numbers for parameter 'm'",
    ),
    (lambda: System(simple, ["x"], parameters={"m": np.ones((1, 1, 1))}), "at most two axes"),
    (lambda: System(lambda q, v, t: v**2, ["x", "y"]), "lagrangian to return a scalar, found 2"),
    (
        lambda: System(lambda q, v, t: v, ["x"]),
        r"lagrangian to return a scalar, found 1 in an array of shape \(1,\); return one",
    ),
    (
        lambda: System(lambda q, v, t: [v[0] ** 2], ["x"]),
        "lagrangian to return a scalar, found 1 in a list",
    ),
    (
        lambda: System(lambda q, v, t: v[0] ** 2 + q[1], ["x"]),
        r"lagrangian could not be traced: 1 coordinate, q\[1\] asked for; indices begin at 0$",
    ),
    (lambda: System(lambda q, v, t: v[2] ** 2, ["x", "y"]), r"2 coordinates, v\[2\] asked for"),
    (
        lambda: System(lambda q, v, t, *, m: m[3] * v[0] ** 2, ["x"], parameters={"m": [1, 2, 3]}),
        r"parameter 'm' of length 3, m\[3\] asked for",
    ),
    (
        lambda: System(
            lambda q, v, t, *, m: m[0, 2] * v[0] ** 2, ["x"], parameters={"m": np.eye(2)}
        ),
        r"m of shape \(2, 2\), m\[0, 2\] asked for",
    ),
    (
        lambda: System(lambda q, v, t: v[0] ** 2 + q[1:][0], ["x"]),
        r"an array of shape \(0,\), \[0\] of it asked for",
    ),
    (
        lambda: System(lambda q, v, t: (lambda x, y: x)(*unpacked(q)), ["x"]),
        r"expected 2, got 1\); q and v have one entry for each coordinate, and there are 1",
    ),
    (
        lambda: System(lambda q, v, t: np.einsum("i,i", v, v), ["x", "y"]),
        r"traced: np.einsum does not take expressions; write the sum with @, np.sum and indices$",
    ),
    (
        lambda: System(lambda q, v, t: v @ v + np.spacing(q[0]), ["x"]),
        "traced: np.spacing does not take expressions; use arithmetic",
    ),
    (
        lambda: System(lambda q, v, t: np.cross(q, v), ["x", "y"]),
        r"traced: np.cross failed on expressions \(.*1x2.*\); .* it is a\[0\] \* b\[1\] - a\[1\]",
    ),
    (
        lambda: System(lambda q, v, t: np.cross([*q, 0], [*v, 0])[2], ["x", "y"]),
        "traced: np.cross was given a list of expressions; make it an array by np.stack first$",
    ),
    (
        lambda: System(lambda q, v, t: "T - V", ["x"]),
        "lagrangian to return numbers or expressions, found str",
    ),
    (lambda: System(branching, ["x"]), "could not be traced .*no branches"),
    (lambda: System(lambda q, v, t: q[3], ["x"]), "could not be traced"),
    (
        lambda: System(simple, ["x"], parameters={"m": 1}, constraint=lambda q, v, t: v[0]),
        "holonomic constraint .* restricts positions, not velocities",
    ),
    (
        lambda: System(simple, ["x"], parameters={"m": 1}, force=lambda q, v, t: [0, 0]),
        "force to return .*, found 2",
    ),
]


@at_once(("build", "message"), BAD_SYSTEMS)
def test_bad_systems_say_what_is_wrong(build, message):
    with pytest.raises(ValueError, match=message) as error:
        build()
    assert "casadi/" not in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize("function", [math.cos, math.sqrt, float])
def test_functions_that_turn_symbols_into_nan_are_refused(function):
    with pytest.raises(ValueError, match="math module"):
        System(lambda q, v, t: v[0] ** 2 / 2 + function(q[0]), ["x"])


@at_once(
    ("call", "message"),
    [
        (lambda: kepler.momentum([1.0], [1.0], 0.0), r"expected q of shape \(2,\) or \(2, K\)"),
        (lambda: kepler.momentum(np.ones((2, 3)), np.ones((2, 4)), 0.0), "q and v of one shape"),
        (lambda: kepler.momentum(np.ones(2), np.ones((2, 1)), 0.0), "q and v of one shape"),
        (
            lambda: kepler.energy(np.ones((2, 3)), np.ones((2, 3)), [0.0, 1.0]),
            "one time or 3 times",
        ),
        (lambda: kepler.momentum([1j, 0], [0, 1], 0.0), "expected a number or .* for q, found"),
        (lambda: kepler.momentum([1, 0], [0, 1], 1j), "numbers for t, found 1j"),
        (lambda: kepler.velocity([1, 0], "p", 0.0, [0, 1]), "numbers for p, found 'p'"),
        (lambda: kepler.momentum([1, 0], "fast", 0.0), "numbers for v, found 'fast'"),
        (lambda: kepler.energy([1, 0], [0, 1], 0, parameters={"nu": 1}), "unknown parameter 'nu'"),
        (lambda: kepler.energy([1, 0], [0, 1], 0, parameters={"mu": [1, 2]}), "'mu' of shape"),
    ],
)
def test_bad_arguments_say_what_is_wrong(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_no_velocity_with_a_momentum_that_cannot_be():
    bounded = System(lambda q, v, t: np.sin(v[0]), ["x"])  # |p| = |cos v| <= 1
    with pytest.raises(ValueError, match="expected a velocity with the momentum"):
        bounded.velocity([0.0], [3.0], 0.0, [0.5])


NOT_FINITE = {
    "momentum": (lambda q, v, t: v[0] ** 2 / 2, [0.5], [np.inf], [0.5]),
    "place": (lambda q, v, t: q[0] * v[0] ** 2 / 2, [np.nan], [1.0], [0.5]),
    "guess": (lambda q, v, t: -np.sqrt(1 - v[0] ** 2), [0.5], [1.0], [1.5]),
    "Lagrangian": (lambda q, v, t: v[0] ** 2 / 2 + v[0] / q[0], [0.0], [1.0], [0.5]),
}


@pytest.mark.parametrize("what", NOT_FINITE)
def test_velocity_ends_where_something_is_not_finite(what):
    lagrangian, q, p, guess = NOT_FINITE[what]
    with pytest.raises(ValueError, match=r"finite|no velocity"):
        System(lagrangian, ["x"]).velocity(q, p, 0.0, guess)


def nested(count):
    """L of count operations, each of the last one's result."""

    def lagrangian(q, v, t):
        y = q[0]
        for _ in range(count):
            y = np.sin(y) + 1e-4 * q[0]
        return v[0] ** 2 / 2 - y**2 / 2

    return lagrangian


@pytest.mark.long
def test_ten_thousand_operations_in_a_loop():
    # CasADi's own printing of them, by recursion, ends the process.
    system = System(nested(10_000), ["x"])
    y = 1.0
    for _ in range(10_000):
        y = np.sin(y) + 1e-4
    assert system.lagrangian([1.0], [2.0], 0.0) == pytest.approx(2.0 - y**2 / 2, rel=1e-12)


class Cosine(ca.Callback):
    def __init__(self, **options):
        ca.Callback.__init__(self)
        self.construct("Cosine", options)

    def eval(self, arg):
        return [math.cos(float(arg[0]))]


def test_functions_that_casadi_calls_are_refused_without_derivatives():
    unknown, known = Cosine(), Cosine(enable_fd=True)
    system = System(lambda q, v, t: v[0] ** 2 / 2 + unknown(q[0]), ["x"])
    with pytest.raises(ValueError, match=r"cannot be calculated for Cosine; give .*enable_fd"):
        system.momentum([1.0], [2.0], 0.0)
    pushed = System(lambda q, v, t: v[0] ** 2 / 2, ["x"], force=lambda q, v, t: [unknown(q[0])])
    for other in (ao.Event(1.0, [0.0]), ao.Event(1.0, None, on=lambda q, t: unknown(q[0]))):
        with pytest.raises(ValueError, match=r"cannot be calculated for Cosine; give "):
            ao.solve(ao.Problem(pushed, ao.Event(0.0, [1.0]), other))
    system = System(lambda q, v, t: v[0] ** 2 / 2 + known(q[0]), ["x"])
    assert system.acceleration([1.0], [2.0], 0.0) == pytest.approx([-math.sin(1.0)], abs=1e-6)


@pytest.mark.parametrize("law", ["lagrangian", "force", "constraint"])
def test_a_symbol_that_is_no_argument_is_refused(law):
    k = ca.SX.sym("k")
    given = {"force": lambda q, v, t: [k * v[0]], "constraint": lambda q, t: q[0] - k}
    with pytest.raises(ValueError, match="found 'k' in the la"):
        System(
            lambda q, v, t: v[0] ** 2 / 2 - (k if law == "lagrangian" else 1) * q[0],
            ["x"],
            **{law: given[law]} if law in given else {},
        )
