"""Lagrangians with branches: one that jumps in q or v where the path crosses is said to."""

import casadi as ca
import numpy as np
import pytest

import actionopt as ao
from actionopt.discrete.between_nodes.crossing import _first_jump, first_crossing
from actionopt.solver.search.search import Search

JUMPS = {
    "where": lambda q, v, t: np.where(q[0] > 0, 1.4, 1.0) * np.sqrt(1 + v[0] ** 2),
    "if_else": lambda q, v, t: ca.if_else(q[0] > 0, 1.4, 1.0) * np.sqrt(1 + v[0] ** 2),
    "comparison": lambda q, v, t: (1 + 0.4 * (q[0] > 0)) * np.sqrt(1 + v[0] ** 2),
    "sign": lambda q, v, t: (1.2 + 0.2 * np.sign(q[0])) * np.sqrt(1 + v[0] ** 2),
    "copysign": lambda q, v, t: (1.2 + np.copysign(0.2, q[0])) * np.sqrt(1 + v[0] ** 2),
    "arctan2": lambda q, v, t: (3 + 0.1 * np.arctan2(q[0], -1.0)) * np.sqrt(1 + v[0] ** 2),
    "floor": lambda q, v, t: v[0] ** 2 / 2 - np.floor(q[0]),
    "remainder": lambda q, v, t: v[0] ** 2 / 2 - np.fmod(q[0], 0.7),
    "moving wall": lambda q, v, t: v[0] ** 2 / 2 - np.where(q[0] > t - 1, 0.5, 0.0),
    "in the velocity": lambda q, v, t: v[0] ** 2 / 2 - q[0] * 3 + np.where(v[0] > 1, 0.5, 0.0),
}
MEETING = {
    "arctan2": lambda q, v, t: (3 + 0.1 * np.arctan2(q[0], 1.0)) * np.sqrt(1 + v[0] ** 2),
    "arctan2 in a cosine": lambda q, v, t: (
        (3 + 0.1 * np.cos(np.arctan2(q[0], -1.0))) * np.sqrt(1 + v[0] ** 2)
    ),
    "abs": lambda q, v, t: v[0] ** 2 / 2 - abs(q[0]) / 4,
    "where": lambda q, v, t: v[0] ** 2 / 2 - np.where(q[0] > 0, q[0], -q[0]) / 4,
    "fmax": lambda q, v, t: v[0] ** 2 / 2 - np.fmax(q[0], 0.0) ** 2,
    "in time": lambda q, v, t: v[0] ** 2 / 2 + np.where(t > 0.37, 5.0, 0.0) * q[0],
    "mass in time": lambda q, v, t: np.where(t > 0.37, 5.0, 1.0) * v[0] ** 2 / 2,
}


def across(lagrangian, **choices):
    system = ao.System(lagrangian, ["y"])
    problem = ao.Problem(system, ao.Event(0.0, [-1.0]), ao.Event(2.0, [1.0]))
    return ao.solve(problem, throw=False, **choices)


@pytest.mark.long
@pytest.mark.parametrize("name", JUMPS)
def test_a_jump_that_is_crossed_is_named(name):
    solution = across(JUMPS[name])
    assert solution.status is ao.Status.JUMP
    assert not solution.success
    if name not in ("arctan2", "moving wall"):  # one is not resolved, and one lies along the wall
        assert solution.compare().agrees is False  # forces are those of the path, not the energy
    # At once: no strategies is climbed for a path that has to cross.
    assert sum(solution.stats["iterations"].values()) < 100


@pytest.mark.long
def test_the_message_says_where_and_by_how_much():
    problem = ao.Problem(
        ao.System(JUMPS["where"], ["y"]), ao.Event(0.0, [-1.0]), ao.Event(2.0, [1.0])
    )
    with pytest.raises(ao.SolveError, match=r"L jumps by 0.566 at t = 1, q = \[.*\]"):
        ao.solve(problem)
    with pytest.raises(ao.SolveError, match="L jumps by"):
        ao.solve(problem, guess=[[-1.0, -0.5, 1.0]])


@pytest.mark.long
@pytest.mark.parametrize("name", MEETING)
def test_branches_that_meet_or_part_in_time_are_solved(name):
    solution = across(MEETING[name])
    assert solution.status is ao.Status.SOLVED
    assert solution.compare().agrees is not False


def test_a_surface_that_is_not_crossed_does_no_harm():
    system = ao.System(JUMPS["where"], ["y"])
    solution = ao.solve(ao.Problem(system, ao.Event(0.0, [1.0]), ao.Event(2.0, [0.5])))
    assert solution.action == pytest.approx(1.4 * np.sqrt(4.25), rel=1e-12)  # a straight line


def test_a_path_may_go_round_what_the_straight_line_crosses():
    hill = ao.System(
        lambda q, v, t: v @ v / 2 - q @ q / 2 - np.where(q @ q < 0.01, 3.0, 0.0), ["x", "y"]
    )
    problem = ao.Problem(hill, ao.Event(0.0, [1.0, 0.0]), ao.Event(2.5, [np.cos(2.5), 1.0]))
    solution = ao.solve(problem, guess=lambda t: np.stack([np.cos(t), np.sin(t) / np.sin(2.5)]))
    assert np.min(np.linalg.norm(solution(np.linspace(0, 2.5, 500)), axis=0)) > 0.1
    assert solution.status is ao.Status.SOLVED


@pytest.mark.slow
def test_snell_leg_by_leg():
    """What the verdict tells to do: an event on the surface where the momentum is continuous."""
    optics = [ao.System(lambda q, v, t, n=n: n * np.sqrt(1 + v[0] ** 2), ["y"]) for n in (1.0, 1.4)]

    def legs(x):
        first = ao.Problem(optics[0], ao.Event(0.0, [-1.0]), ao.Event(x, [0.0]))
        second = ao.Problem(optics[1], ao.Event(x, [0.0]), ao.Event(2.0, [1.0]))
        return ao.solve(first), ao.solve(second)

    low, high = 0.5, 1.9  # the time along the surface is x, its momentum -H
    for _ in range(40):
        x = (low + high) / 2
        one, two = legs(x)
        low, high = (x, high) if -one.energy(x) < -two.energy(x) else (low, x)
    one, two = legs(x)
    sines = [1 / np.sqrt(1 + leg.start.v[0] ** 2) for leg in (one, two)]
    assert sines[0] == pytest.approx(1.4 * sines[1], rel=1e-8)
    assert one.action + two.action == pytest.approx(3.349, abs=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("sign", "level"), [(1.0, 10.0), (-1.0, -10.0)])
@pytest.mark.parametrize("name", MEETING)
def test_branches_meet_whatever_the_size_and_sign_of_the_lagrangian(name, sign, level):
    """Rounding of a large L is no jump; and one that is negative throughout has a size."""
    solution = across(lambda q, v, t: sign * MEETING[name](q, v, t) + level)
    assert solution.status is ao.Status.SOLVED


@pytest.mark.long
@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize("step", [0.4, -0.4])
def test_a_jump_has_its_height_from_either_side(way, step):
    system = ao.System(lambda q, v, t: v[0] ** 2 / 2 + np.where(q[0] > 0.2, step, 0.0), ["y"])
    problem = ao.Problem(system, ao.Event(0.0, [-way]), ao.Event(2.0, [way]))
    mesh = ao.Mesh.uniform(0.0, 2.0, 4, 4)
    found = first_crossing(
        system.switches, problem, ao.Path.interpolate(lambda t: [way * (t - 1)], mesh)
    )
    assert found.height == pytest.approx(0.4, rel=1e-12)
    assert found.t == pytest.approx(1 + 0.2 * way, abs=1e-12)
    assert found.q == pytest.approx([0.2], abs=1e-12) and found.v == pytest.approx([way])
    assert found.inevitable
    back = first_crossing(
        system.switches,
        problem,
        ao.Path.interpolate(lambda t: [1 - 0.9 * np.sin(np.pi * t / 2)], mesh),
    )
    assert back is not None and not back.inevitable  # it comes back to the first side


@pytest.mark.long
@pytest.mark.parametrize(("power", "jumps"), [(0, True), (1 / 3, False), (1.0, False)])
def test_a_cusp_is_no_jump_however_near_it_is_seen(power, jumps):
    system = ao.System(
        lambda q, v, t: v[0] ** 2 / 2 - 2 * np.sign(q[0] - 0.1) * abs(q[0] - 0.1) ** power, ["y"]
    )
    problem = ao.Problem(system, ao.Event(0.0, [-1.0]), ao.Event(2.0, [1.0]))
    mesh = ao.Mesh.uniform(0.0, 2.0, 4, 4)
    found = first_crossing(system.switches, problem, ao.Path.interpolate(lambda t: [t - 1], mesh))
    assert (found is not None) is jumps


@pytest.mark.parametrize(("height", "jumps"), [(0.0, False), (1e-8, True)])
def test_a_kink_that_rounds_to_steps_is_no_jump(height, jumps):
    """The cosine of 1e-8 is one or its neighbour: arccos of it is zero or 1.5e-8."""

    def lagrangian(q, v, t):
        kink = np.arccos(np.cos(q[0])) if not jumps else height * q[0] / np.sqrt(q[0] ** 2)
        return v[0] ** 2 / 2 - 0.9 * kink

    problem = ao.Problem(ao.System(lagrangian, ["x"]), ao.Event(0.0, [-1.0]), ao.Event(2.0, [1.0]))
    mesh = ao.Mesh([0.0, 0.3, 2.0], [3, 3])
    path = ao.Path.interpolate(lambda t: [t - 1], mesh)

    def rounds_to_zero(x):
        return np.arccos(np.cos(x)) == 0.0

    low, high = 0.0, 1e-7
    while not jumps and high - low > 1e-15:  # where it begins to differ from zero
        middle = (low + high) / 2
        low, high = (middle, high) if rounds_to_zero(middle) else (low, middle)
    at = np.array([1.0 + low]), np.array([1.0 + max(high, 1e-15)])
    found = _first_jump(problem, path, *at)
    assert (found is not None) is jumps


@pytest.mark.quick("-0.7")
@pytest.mark.parametrize("c", [0.7, -0.7])
def test_a_lagrangian_with_its_steps_held_is_itself(c):
    """The steps' own values put in give L again, everywhere; others give another branch."""
    laws = {
        **JUMPS,
        **{k: f for k, f in MEETING.items() if k in ("where",)},
        "a negative magnitude": lambda q, v, t: np.copysign(c * (1 + v[0] ** 2), q[0] - c),
        "two at once": lambda q, v, t: np.sign(q[0]) * np.floor(3 * v[0]) + np.fmod(v[0], c),
        "remainder of a step": lambda q, v, t: np.fmod(np.floor(4 * q[0]) * v[0], c),
        "not and or": lambda q, v, t: ca.if_else(
            ca.logic_or(ca.logic_not(q[0] > c), v[0] < 0), q[0], 2 + v[0]
        ),
    }
    rng = np.random.default_rng(2)
    q, v, t = (rng.uniform(-2, 2, (200, 1)) for _ in range(3))
    for name, lagrangian in laws.items():
        system = ao.System(lagrangian, ["y"])
        found, p = system.switches, np.zeros((1, 0))
        steps = found.values(q, v, t, p)[0].copy()
        held = found.held(q, v, t, p, steps)[0][:, 0]
        known = system.lagrangian(q.T, v.T, t[:, 0])
        assert np.max(np.abs(held - known)) <= 1e-12, name
        assert len({tuple(row) for row in steps.tolist()}) >= 2, name


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_branches_that_meet_steeply_are_told_from_jumps_by_the_size_of_l(sign):
    """At the last time before 1.0123 the two branches of 1e6 |q| differ by rounding of time."""
    system = ao.System(
        lambda q, v, t: sign * (1 + v[0] ** 2 + 1e6 * np.where(q[0] > 0, q[0], -q[0])), ["y"]
    )
    problem = ao.Problem(system, ao.Event(0.0, [-1.0123]), ao.Event(2.0, [0.9877]))
    mesh = ao.Mesh.uniform(0.0, 2.0, 4, 4)
    path = ao.Path.interpolate(lambda t: [t - 1.0123], mesh)
    assert first_crossing(system.switches, problem, path) is None


def test_a_jump_between_the_ends_is_told_before_costly_ways_are_tried(monkeypatch):
    """Every path of one coordinate crosses it, however L is written."""

    def lagrangian(q, v, t):
        step = 1 / (1 + np.exp(1 / (q[0] - 0.21141669)))
        return v[0] ** 2 / 2 + 0.19660169765 * step - 0.983474720138 * q[0] ** 2 / 2

    start, end = ao.Event(0, [-0.27545721]), ao.Event(1, [0.84820386])
    problem = ao.Problem(ao.System(lagrangian, ["x"]), start, end)
    costly = []
    monkeypatch.setattr(Search, "_limit", lambda search, cost: costly.append(cost))
    assert ao.solve(problem, tol=1e-3, throw=False).status is ao.Status.JUMP
    assert not costly


def test_a_jump_beyond_an_event_on_the_way_is_told():
    system = ao.System(lambda q, v, t: v[0] ** 2 / 2 - np.where(q[0] > 0.5, 1.0, 0.0), ["x"])
    gate = ao.Event(0.4, [0.3])
    problem = ao.Problem(system, ao.Event(0, [0]), ao.Event(1, [1]), through=[gate])
    assert ao.solve(problem, throw=False).status is ao.Status.JUMP
    path = ao.solve(problem.replace(end=ao.Event(1, [0.45])))
    np.testing.assert_allclose(path.velocity([0.2, 0.8])[0], [0.75, 0.25])
