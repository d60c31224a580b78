"""The same problem in other words: what is told of it follows by hand from what was told before.

Time reversed, coordinates in another order or in other units, a total derivative added to L, a
further coordinate that takes no part, a mesh cut once more. Each number a user can ask for is
compared, so that one that is taken of the wrong end, row, unit or element shows.
"""

from functools import cache

import numpy as np
import pytest

import actionopt as ao
from actionopt import Event, Problem, System

T0, T1 = 0.5, 2.5
S = np.linspace(T0, T1, 7)
NUMBERS = {"m": 1.7, "g": 9.0}
SAME = 1e-7  # of numbers that follow from a path known to 1e-10
# Their sizes depend on how the problem is put: the order of magnitude is what stays.
ESTIMATES = ("error", "velocity_error", "multiplier_error")


def swing(q, v, t, *, m, g):
    potential = g * (q[0] ** 2 / 2 + q[0] ** 4 / 40) * (1 + 0.1 * t)
    return m * v[0] ** 2 * (1 + q[0] ** 2 / 10) / 2 + 0.7 * v[0] * q[0] * t - potential


def plane(q, v, t, *, m, g):
    x, y = q[0], q[1]
    kinetic = m * (v[0] ** 2 + 2 * v[1] ** 2) / 2 + 0.3 * x * v[1] * (1 + t / 7)
    return kinetic - g * (x**2 / 2 + y**2 / 9 + 0.1 * x * y**2) * (1 + 0.1 * t)


def fall(q, v, t, *, m, g):
    return m * (v @ v) / 2 - m * g * q[1] * (1 + 0.03 * t)


def rim(q, t, *, g):
    return [q @ q - (g / 10 + t / 40) ** 2]


def around(t, angle):
    r = NUMBERS["g"] / 10 + t / 40
    return [r * np.sin(angle), r * np.cos(angle)]


CASES = {
    "swing": (swing, [0.3], [-1.1], None),
    "plane": (plane, [0.3, -0.4], [-0.7, 0.9], None),
    "rim": (fall, around(T0, 0.02), around(T1, 2.9), rim),
}
ALL = pytest.mark.parametrize(
    "name", ["swing", "plane", pytest.param("rim", marks=pytest.mark.slow)]
)


def problem_of(name, *, L=None, order=None, unit=1.0, way=1.0, scale=1.0, own=NUMBERS):
    """Return a case for another L, order of coordinates, units of q and t and of the action.

    `own` are the parameters of the system; those of the problem stay.
    """
    given, start, end, constraint = CASES[name]
    L, n = given if L is None else L, len(start)
    order = list(range(n)) if order is None else order
    back = np.argsort(order)
    unit = np.broadcast_to(unit, (n,))  # of the coordinates as they are given

    def inside(x):
        return np.stack([x[int(back[i])] / unit[i] for i in range(n)])

    def lagrangian(q, v, t, *, m, g):
        return scale * L(inside(q), way * inside(v), t / way, m=m, g=g) / abs(way)

    def rows(q, t, *, g):
        return constraint(inside(q), t / way, g=g)

    names = ["x", "y"][:n]
    system = System(
        lagrangian, [names[i] for i in order], parameters=own,
        constraint=None if constraint is None else rows,
    )  # fmt: skip
    events = [Event(way * t, (unit * q)[order]) for t, q in ((T0, start), (T1, end))]
    return Problem(system, *events[:: 1 if way > 0 else -1], parameters=NUMBERS)


def told(solution, at=S, units=1.0):
    """Return what is told of a path, by name: at the times `at` (K,), the modes in `units`."""
    problem, parameters = solution.problem, solution.problem.parameters
    system, n, T = problem.system, problem.system.n, problem.duration
    assert solution.success
    wave = np.broadcast_to(units, (n,))[:, None]
    t0 = problem.start.t
    varied = ao.variation(solution, lambda t: wave * np.sin(np.pi * (t - t0) / T), unit=units)
    compared, by = solution.compare(), solution.sensitivity()
    motion = ao.integrate(system, solution.start, problem.end.t, parameters=parameters)
    assert compared.agrees
    row = {
        "q": solution(at), "v": solution.velocity(at), "a": solution.acceleration(at),
        "p": solution.momentum(at), "H": solution.energy(at), "S": solution.action,
        "p0": solution.momenta[0], "p1": solution.momenta[1],
        "v0": solution.start.v, "v1": solution.end.v,
        "index": solution.morse_index, "nullity": solution.inertia.nullity,
        "modes": ao.second_variation(solution, 3, units=units).eigenvalues,
        "conjugate": [c.t for c in ao.conjugate_points(solution)],
        "dq0": by.q0, "dq1": by.q1, "dt0": by.t0, "dt1": by.t1,
        "dq0q0": by.q0q0, "dq0q1": by.q0q1, "dq1q1": by.q1q1,
        "dm": by.parameters["m"], "dg": by.parameters["g"],
        "varied": varied([-0.1, 0.2]), "bent": varied.second,
        "motion": motion(at), "speed": motion.velocity(at),
        "error": solution.error, "velocity_error": solution.velocity_error,
    }  # fmt: skip
    if system.m:
        row |= {
            "lam": solution.multipliers(at), "force": solution.constraint_force(at),
            "multiplier_error": solution.multiplier_error,
            "contact": [c.t for c in ao.contact_loss(solution)],
            "lost": [c.lost for c in ao.contact_loss(solution)],
        }  # fmt: skip
    return {name: np.asarray(x, dtype=float) for name, x in row.items()}


@cache
def base(name):
    solution = ao.solve(problem_of(name), tol=1e-10)
    return solution, told(solution)


def compare(found, expected, rel=SAME, skip=(), roundoff=0.0):
    assert found.keys() == expected.keys()
    for name, wanted in expected.items():
        if name in skip:
            continue
        got, wanted = found[name], np.asarray(wanted)
        assert got.shape == wanted.shape, name
        if name in ESTIMATES:
            low, high = np.minimum(got, wanted), np.maximum(got, wanted)
            assert high <= np.maximum(5 * low, roundoff), name
            continue
        size = np.max(np.abs(wanted), initial=0.0)
        assert np.max(np.abs(got - wanted), initial=0.0) <= rel * size, (name, got, wanted)


@pytest.mark.long
@ALL
def test_what_is_told_is_not_trivial(name):
    """Else nothing would follow from its being the same."""
    _, known = base(name)
    assert known["index"] == (0 if name == "rim" else 1)
    assert len(known["conjugate"]) == known["index"]
    assert name != "rim" or list(known["lost"]) == [True]


@pytest.mark.long
@ALL
def test_backwards_in_time(name):
    """L(q, -v, -t) between the ends exchanged: S(q0, t0, q1, t1) becomes S(q1, -t1, q0, -t0)."""
    _, known = base(name)
    found = told(ao.solve(problem_of(name, way=-1.0), tol=1e-10), -S)
    wanted = known | {key: -known[key] for key in ("v", "p", "speed")}
    for one, other, sign in (
        *(("p0", "p1", -1), ("v0", "v1", -1), ("dq0", "dq1", 1), ("dt0", "dt1", -1)),
        ("dq0q0", "dq1q1", 1),
    ):
        wanted |= {one: sign * known[other], other: sign * known[one]}
    wanted["dq0q1"] = known["dq0q1"].T
    if name == "rim":
        wanted |= {"contact": -known["contact"], "lost": 1 - known["lost"]}
    # A point conjugate to the other end is another point, but there are as many.
    assert found["conjugate"].shape == known["conjugate"].shape
    compare(found, wanted, skip=("conjugate",))


@pytest.mark.long
@ALL
def test_parameters_of_the_problem_instead_of_the_systems_own(name):
    """Where one is not handed on, the system's own value is taken."""
    compare(told(ao.solve(problem_of(name, own={"m": 1.0, "g": 4.0}), tol=1e-10)), base(name)[1])


@pytest.mark.long
@pytest.mark.parametrize("name", ["plane", "rim"])
def test_in_the_other_order_of_the_coordinates(name):
    solution, known = base(name)
    other = ao.solve(problem_of(name, order=[1, 0]), tol=1e-10)
    assert other.mesh.degrees == solution.mesh.degrees
    vectors = ("q", "v", "a", "p", "p0", "p1", "v0", "v1", "dq0", "dq1", "motion", "speed", "force")
    wanted = known | {key: known[key][::-1] for key in vectors if key in known}
    wanted |= {key: known[key][::-1, ::-1] for key in ("dq0q0", "dq0q1", "dq1q1")}
    compare(told(other), wanted)


@pytest.mark.long
@pytest.mark.parametrize(
    ("unit", "way", "scale"),
    [((1e3, 0.02), 60.0, 3e-5), pytest.param((1e-2, 40.0), 1e-3, 7e4, marks=pytest.mark.slow)],
)
@ALL
def test_in_other_units(name, unit, way, scale):
    """Of coordinates, time and action, that are no powers of two."""
    _, known = base(name)
    n = len(CASES[name][1])
    unit = np.full(n, unit[0]) if name == "rim" else np.array(unit[:n])
    problem = problem_of(name, unit=unit, way=way, scale=scale)
    found = told(ao.solve(problem, tol=1e-10), way * S, unit)
    u, time = unit, way
    units = {
        "q": u, "v": u / time, "a": u / time**2, "motion": u, "speed": u / time,
        "v0": u / time, "v1": u / time,
        **dict.fromkeys(("p", "p0", "p1", "dq0", "dq1"), scale / u),
        **dict.fromkeys(("S", "dm", "dg", "varied", "bent"), scale),
        **dict.fromkeys(("H", "dt0", "dt1", "modes"), scale / time),
        **dict.fromkeys(("dq0q0", "dq0q1", "dq1q1"), scale / np.outer(u, u)),
        "conjugate": time, "contact": time,
        "lam": scale / time, "force": scale / u / time,
    }  # fmt: skip
    wanted = dict(known)
    for key in wanted.keys() & units.keys():
        factor = np.asarray(units[key])
        if known[key].ndim == 2 and factor.ndim == 1:
            factor = factor[:, None]
        wanted[key] = known[key] * factor
    compare(found, wanted, 10 * SAME)


@pytest.mark.long
@ALL
def test_a_total_derivative_added(name):
    """L + dF/dt, F = sum (i + 2) q_i^2 t / 3 + sin(3 t): S + F(1) - F(0), p + F_q, H - F_t."""
    solution, known = base(name)
    L, n = CASES[name][0], len(CASES[name][1])
    w = np.arange(n) + 2.0

    def gauged(q, v, t, **numbers):
        terms = [w[i] / 3 * (q[i] ** 2 + 2 * q[i] * v[i] * t) for i in range(n)]
        return L(q, v, t, **numbers) + sum(terms) + 3 * np.cos(3 * t)

    def F(q, t):
        square = w @ q**2 / 3
        return square * t + np.sin(3 * t), 2 / 3 * w * q * t, square + 3 * np.cos(3 * t)

    found = told(ao.solve(problem_of(name, L=gauged), tol=1e-10))
    q0, q1 = solution.start.q, solution.end.q
    (F0, p0, h0), (F1, p1, h1) = F(q0, T0), F(q1, T1)
    rise = F1 - F0
    wanted = known | {
        "S": known["S"] + rise, "varied": known["varied"] + rise,
        "p": known["p"] + 2 / 3 * w[:, None] * known["q"] * S,
        "H": known["H"] - (w @ known["q"] ** 2 / 3 + 3 * np.cos(3 * S)),
        "p0": known["p0"] + p0, "p1": known["p1"] + p1,
        "dq0": known["dq0"] - p0, "dq1": known["dq1"] + p1,
        "dt0": known["dt0"] - h0, "dt1": known["dt1"] + h1,
    }  # fmt: skip
    for key, q, t, sign in (("dq0q0", q0, T0, -1), ("dq1q1", q1, T1, 1)):
        # Along the circle only, as far as these are concerned.
        along = np.eye(n) - (np.outer(q, q) / (q @ q) if name == "rim" else 0.0)
        wanted[key] = known[key] + sign * t * along @ np.diag(2 / 3 * w) @ along
    compare(found, wanted)


@pytest.mark.long
@pytest.mark.parametrize("name", ["swing", "plane"])
def test_a_further_coordinate_that_takes_no_part(name):
    """An oscillator beside it, and the index, the times and the derivatives of both together."""
    solution, known = base(name)
    L, n = CASES[name][0], len(CASES[name][1])
    w, a, b = 1.9, -0.2, 0.35  # 2 w = 3.8: one conjugate point
    system = System(
        lambda q, v, t, *, m, g: L(q[:n], v[:n], t, m=m, g=g) + (v[n] ** 2 - w**2 * q[n] ** 2) / 2,
        ["x", "y", "z"][: n + 1],
        parameters=NUMBERS,
    )
    events = [Event(t, [*q, c]) for t, q, c in ((T0, CASES[name][1], a), (T1, CASES[name][2], b))]
    other = ao.solve(Problem(system, *events), tol=1e-10)
    found, T = told(other), T1 - T0
    sin, cos = np.sin(w * T), np.cos(w * T)
    z = (a * np.sin(w * (T1 - S)) + b * np.sin(w * (S - T0))) / sin
    rate = w * (-a * np.cos(w * (T1 - S)) + b * np.cos(w * (S - T0))) / sin
    own = w / (2 * sin) * ((a**2 + b**2) * cos - 2 * a * b)
    wave = np.pi / T
    beside = {
        "q": [z], "v": [rate], "a": [-(w**2) * z], "p": [rate], "motion": [z], "speed": [rate],
        "p0": [rate[0]], "p1": [rate[-1]], "v0": [rate[0]], "v1": [rate[-1]],
        "dq0": [-rate[0]], "dq1": [rate[-1]],
    }  # fmt: skip
    wanted = known | {key: np.concatenate([known[key], row]) for key, row in beside.items()}
    energy = rate[0] ** 2 / 2 + w**2 * a**2 / 2
    wanted |= {
        "S": known["S"] + own, "H": known["H"] + energy,
        "dt0": known["dt0"] + energy, "dt1": known["dt1"] - energy,
        "index": known["index"] + 1,
        "conjugate": np.sort([*known["conjugate"], T0 + np.pi / w]),
        "bent": known["bent"] + T / 2 * (wave**2 - w**2),
    }  # fmt: skip
    # S(alpha): what is linear in alpha vanishes along a path.
    wanted["varied"] = known["varied"] + own + np.array([0.01, 0.04]) * T / 4 * (wave**2 - w**2)
    of_it = [(k * wave) ** 2 - w**2 for k in (1, 2, 3)]
    wanted["modes"] = np.sort([*known["modes"], *of_it])[:3]
    for key, x in (("dq0q0", w * cos / sin), ("dq0q1", -w / sin), ("dq1q1", w * cos / sin)):
        wanted[key] = np.block([[known[key], np.zeros((n, 1))], [np.zeros((1, n)), x]])
    # On a mesh of its own, where estimates that small are round-off.
    compare(found, wanted, roundoff=1e-11)
