"""The method as a reader holds it: against closed forms, and the package against it."""

import numpy as np
import pytest
from helpers import a_quarter

import actionopt as ao
from actionopt import simple

EPS = np.finfo(float).eps
EXACT = 1e-11  # degree 12 on eight elements leaves rounding alone
SAME = 1e-13  # two solutions of one system of equations


def twice(t, degree):
    """Round-off of second derivatives, as multipliers are: the largest of D is d (d + 1) / 4."""
    h = t[degree] - t[0]
    return 16 * EPS * (degree * (degree + 1) / (2 * h)) ** 2


# -- closed forms ------------------------------------------------------------------------------


def spring(w, mass=1.0):
    return lambda q, v, t: mass * (v[0] ** 2 - w**2 * q[0] ** 2) / 2


def near(found, known):
    return np.max(np.abs(found - known)) <= EXACT * max(1.0, np.max(np.abs(known)))


@pytest.mark.long
@pytest.mark.parametrize(("w", "mass", "T"), [(1.0, 1.0, 2.0), (2.3, 0.4, 4.5)])
def test_oscillator(w, mass, T):
    a, b = 1.0, -0.4
    path = simple.solve(spring(w, mass), (0.5, [a]), (0.5 + T, [b]), degree=12)
    s = path.t - 0.5
    assert near(path.q[0], (a * np.sin(w * (T - s)) + b * np.sin(w * s)) / np.sin(w * T))
    action = mass * w * ((a**2 + b**2) * np.cos(w * T) - 2 * a * b) / (2 * np.sin(w * T))
    assert near(path.S, action)
    assert path.index == int(w * T / np.pi)  # one for each half period
    assert path.lam.shape == (0, path.t.size)


def test_order_is_twice_the_degree_where_elements_meet():
    d, errors = 3, []
    for N in (4, 8):
        path = simple.solve(spring(1.0), (0.0, [0.0]), (2.0, [1.0]), elements=N, degree=d)
        errors.append(np.max(np.abs(path.q[0] - np.sin(path.t) / np.sin(2.0))[::d]))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2 * d, abs=0.2)


def bratu(T):
    """q'' = -exp(q) from 0 to 0: there is a path for T^2 < 3.5138 only (Bratu's problem)."""
    return simple.solve(lambda q, v, t: v[0] ** 2 / 2 - np.exp(q[0]), (0.0, [0.0]), (T, [0.0]))


@pytest.mark.long
def test_what_has_no_answer():
    with pytest.raises(np.linalg.LinAlgError):  # where it starts does not matter
        simple.solve(lambda q, v, t: v[0] ** 2, (0.0, [None]), (1.0, [None]), elements=1, degree=1)
    with pytest.raises(RuntimeError, match="found no path in 50 steps"):
        bratu(1.9)
    assert bratu(1.85).index == 0


# -- the package on the same mesh --------------------------------------------------------------


def pendulum(q, v, t):
    return v[0] ** 2 / 2 + 9.81 * np.cos(q[0])


def double_pendulum(q, v, t):
    (x, y), (u, w) = q, v
    return u**2 + w**2 / 2 + u * w * np.cos(x - y) + 9.81 * (2 * np.cos(x) + np.cos(y))


def kepler(q, v, t):
    return v @ v / 2 + 1 / np.sqrt(q @ q)


def polar(q, v, t):  # the angle is cyclic
    return (v[0] ** 2 + (q[0] * v[1]) ** 2) / 2 + 1 / q[0]


def falling(q, v, t):
    return v @ v / 2 - 9.81 * q[1]


def driven(q, v, t):
    return (1 + t / 3) * v[0] ** 2 / 2 - 2 * q[0] ** 2 - q[0] ** 4 / 4 + q[0] * np.cos(3 * t)


def rod(q, t):
    return [(q @ q - 1) / 2]


def lifted(q, t):
    return [q[0] ** 2 + (q[1] - 0.1 * t**2) ** 2 - 1]


def friction(q, v, t):
    return [-0.4 * v[0] * np.sqrt(1 + v[0] ** 2)]


def arc(t):
    return np.array([np.sin(0.4 - 0.9 * t), -np.cos(0.4 - 0.9 * t)])


CASES = {
    "pendulum": (pendulum, [0.3], [-0.2], {}),
    "pendulum, a saddle": (pendulum, [0.3], [-0.2], {"T": 2.5}),
    "double pendulum": (double_pendulum, [0.4, -0.3], [-0.2, 0.5], {"T": 0.8}),
    "Kepler": (kepler, [1.0, 0.0], [0.0, 1.1], {"guess": lambda t: np.array([1 - t / 2, t])}),
    "a cyclic coordinate": (polar, [1.0, 0.0], [1.2, 1.4], {}),
    "its change not given": (polar, [1.0, 0.0], [1.2, None], {}),
    "a rod": (falling, arc(0.0), arc(1.0), {"constraint": rod, "guess": arc}),
    "a rod of free end": (
        falling,
        arc(0.0),
        [None, None],
        {"constraint": rod, "guess": arc, "T": 0.4},
    ),
    "a rod that is lifted": (
        falling,
        arc(0.0),
        [arc(1.0)[0], arc(1.0)[1] + 0.1],
        {"constraint": lifted, "guess": lambda t: arc(t) + [0 * t, 0.1 * t**2]},
    ),
    "friction": (pendulum, [0.3], [0.9], {"force": friction}),
    "a force at a free end": (pendulum, [None], [0.9], {"force": friction, "T": 0.3}),
    "time and a free end": (driven, [0.3], [None], {}),
}


@pytest.mark.quick("a rod that is lifted")
@pytest.mark.parametrize("case", a_quarter(CASES))
def test_the_package_agrees_to_rounding_on_the_same_mesh(case):
    lagrangian, q0, q1, given = CASES[case]
    guess, T = given.get("guess"), given.get("T", 1.0)
    laws = {key: given[key] for key in ("constraint", "force") if key in given}
    mine = simple.solve(lagrangian, (0.0, q0), (T, q1), degree=7, guess=guess, **laws)

    names = [f"x{i}" for i in range(len(q0))]
    problem = ao.Problem(ao.System(lagrangian, names, **laws), ao.Event(0.0, q0), ao.Event(T, q1))
    mesh = ao.Mesh.uniform(0.0, T, 8, 7)
    path = ao.solve(problem, guess=guess, mesh=mesh, principle="stationary")
    assert np.allclose(mesh.nodes, mine.t, rtol=0, atol=4 * EPS)
    assert np.max(np.abs(path.path.values - mine.q)) <= SAME
    assert np.array_equal(np.isnan(path.lam), np.isnan(mine.lam))
    assert np.nanmax(np.abs(path.lam - mine.lam), initial=0.0) <= twice(mine.t, 7)
    assert path.action == pytest.approx(mine.S, rel=SAME)
    if "force" not in laws:
        assert path.morse_index == mine.index
