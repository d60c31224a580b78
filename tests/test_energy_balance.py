"""The balance of energy along a path: jumps of L are found however they are written."""

import re

import casadi as ca
import numpy as np
import pytest
from helpers import at_once

import actionopt as ao
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.between_nodes import crossing
from actionopt.discrete.between_nodes.crossing import Jump, find_imbalance
from actionopt.discrete.between_nodes.energy_balance import DRIFT_SAFETY, Balance, plain_drift
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.discrete.stacks import Stack, StackShape


def free(V):
    """Return the Lagrangian of a unit mass in a potential."""
    return lambda q, v, t: v @ v / 2 - V(q)


# Potentials that jump where the first coordinate is zero, and by how much.
JUMPS = {
    "abs(q) / q": (lambda q: abs(q[0]) / q[0], 2.0),
    "q / abs(q)": (lambda q: q[0] / abs(q[0]), 2.0),
    "q / sqrt(q^2)": (lambda q: q[0] / np.sqrt(q[0] ** 2), 2.0),
    "power": (lambda q: (q[0] ** 2) ** 0.5 / q[0], 2.0),
    "cube": (lambda q: 0.01 * q[0] ** 3 / np.sqrt(q[0] ** 6), 0.02),
    "arctan(1 / q)": (lambda q: np.arctan(1 / q[0]), np.pi),
    "arctan(y / x)": (lambda q: np.arctan((q[0] + 2) / q[0]), np.pi),
    "tanh(1 / q)": (lambda q: np.tanh(1 / q[0]), 2.0),
    "logistic": (lambda q: 1 / (1 + np.exp(1 / q[0])), 1.0),
    "arctan(tan q)": (lambda q: np.arctan(np.tan(1.5 * (q[0] + np.pi / 3))), np.pi),
    "arctan2 at its cut": (lambda q: np.arctan2(q[0], -1e-300), np.pi),
    "narrower than floats": (lambda q: np.tanh(q[0] / 1e-17), 2.0),
}


def across(lagrangian, tol=1e-8, **choices):
    problem = ao.Problem(
        ao.System(lagrangian, ["x"]), ao.Event(0.0, [-0.83]), ao.Event(1.0, [1.07])
    )
    return ao.solve(problem, tol=tol, **choices)


@pytest.mark.quick(
    "0.001-abs(q) / q",
    "0.001-power",
    "0.001-arctan(y / x)",
    "0.001-logistic",
    "0.001-narrower than floats",
)
@pytest.mark.parametrize("name", JUMPS)
@pytest.mark.parametrize("tol", [1e-3, pytest.param(1e-10, marks=pytest.mark.slow)])
def test_a_jump_is_named_with_its_height(name, tol):
    V, height = JUMPS[name]
    with pytest.raises(ao.SolveError) as error:
        across(free(V), tol)
    assert error.value.solution.status is ao.Status.JUMP
    told = re.search(r"L jumps by ([\d.]+) at .*, and the energy by ([\d.]+)", str(error.value))
    assert told and [float(x) for x in told.groups()] == pytest.approx([height] * 2, rel=5e-3)


def test_a_jump_of_the_velocity_or_beside_a_moving_wall():
    turning = across(lambda q, v, t: v[0] ** 2 / 2 - 9 * q[0] - v[0] / abs(v[0]), throw=False)
    wall = across(lambda q, v, t: v[0] ** 2 / 2 - np.arctan(1 / (q[0] - 9 * t + 3)), throw=False)
    assert turning.status is wall.status is ao.Status.JUMP


@pytest.mark.long
def test_jumps_all_along_the_path():
    jumps = free(lambda q: 0.3 * np.arctan(np.tan(q[0] / 2)))
    problem = ao.Problem(ao.System(jumps, ["x"]), ao.Event(0.0, [0.1]), ao.Event(1.0, [1900.0]))
    assert ao.solve(problem, throw=False).status is ao.Status.JUMP


@pytest.mark.long
@pytest.mark.parametrize("tol", [1e-10, pytest.param(1e-3, marks=pytest.mark.slow)])
def test_a_corner_of_the_path_has_its_time(tol):
    """L has a kink in v: the momentum is the same before and after at any time, the energy not."""
    system = ao.System(lambda q, v, t: v[0] ** 2 / 2 - 3 * q[0] - 0.3 * abs(v[0]), ["x"])
    for end in (0.1, 4.0):  # from v to -v where v = 0.3; without a corner
        problem = ao.Problem(system, ao.Event(0.0, [0.0]), ao.Event(1.0, [end]))
        path = ao.solve(problem, tol=tol, throw=False)
        assert path.success == (end == 4.0) or path.start.v[0] == pytest.approx(1.88333, rel=tol)


@pytest.mark.quick("time")
@pytest.mark.parametrize("lost", ["friction", "time"])
def test_the_work_done_is_no_drift_and_hides_none(lost):
    """With friction v' = -3 - c v, else v' = -3 (1 + 0.1 t), and v jumps from 0.3 to -0.3."""
    c = 0.02 if lost == "friction" else 0.0
    force = (lambda q, v, t: [-c * v[0]]) if c else None
    rate = 0.0 if c else 0.1
    corner = ao.System(
        lambda q, v, t: v[0] ** 2 / 2 - 3 * (1 + rate * t) * q[0] - 0.3 * abs(v[0]),
        ["x"],
        force=force,
    )

    def moved(v, first, last):
        """Return how far one moves from one time to another without a corner, and the velocity."""
        h, gone = last - first, -np.expm1(-c * (last - first))
        if c:
            return (v + 3 / c) * gone / c - 3 * h / c, v - (v + 3 / c) * gone
        pull = 3 * (1 + rate * first)
        return v * h - pull * h**2 / 2 - rate * h**3 / 2, v - pull * h - 1.5 * rate * h**2

    for end in (0.1, 4.0):
        problem = ao.Problem(corner, ao.Event(0.0, [0.0]), ao.Event(1.0, [end]))
        path = ao.solve(problem, tol=1e-4, throw=False)
        assert path.success or end == 0.1
        v, t = path.start.v[0], 0.0
        for _ in range(9):  # until the corner
            t += (moved(v, 0.0, t)[1] - 0.3) / 3
        there = moved(v, 0.0, min(t, 1.0))[0] + (moved(-0.3, t, 1.0)[0] if t < 1 else 0.0)
        assert not path.success or there == pytest.approx(end, abs=2e-4)


@pytest.mark.parametrize("timed", [0.0, 0.5])
def test_the_balance_of_stacked_members_is_that_of_each(timed):
    system = ao.System(
        lambda q, v, t: v @ v / 2 - np.tanh(q[0]) * (1 + timed * np.sin(2 * t)), ["x"]
    )
    problem = ao.Problem(system, ao.Event(0.0, [-0.83]), ao.Event(1.0, [1.07]))
    mesh = ao.Mesh.uniform(0.0, 1.0, 3, 5)
    tr = Transcription(problem, mesh, problem.lengths)
    curve = ao.Path.interpolate(lambda t: [1.9 * t - 0.83 + t * (1 - t) * np.cos(9 * t)], mesh)
    stack = Stack(
        StackShape(system, mesh, ((), ()), tr.lengths, tr.action_unit),
        np.array([[0.0, 1.0]]),
        problem.packed,
    )
    Q = stack.shape.local(curve(mesh.nodes).T[None])
    balance = Balance.of(DiscretePath(tr, tr.pack(curve(mesh.nodes).T)))
    found = stack.drift(Q, stack.samples(Q), stack.second(Q))
    assert found == pytest.approx(balance.drift(), rel=1e-3)
    assert balance.drift() > 1e-3


def test_the_work_of_a_constraint_that_moves_is_no_drift():
    """A lift adds y'^2 / 2 to the energy, and its force has done as much."""

    def height(t):
        return 0.5 * np.sin(3 * t)

    def drift(bend):
        """Return that of a free body on the lift, whose path is a motion where it is straight."""
        system = ao.System(
            lambda q, v, t: v @ v / 2 - 0.1 * abs(q[0] - 9),
            ["x", "y"],
            constraint=lambda q, t: q[1] - height(t),
        )

        def along(t):
            return 1.9 * t - 0.83 - 0.05 * t * (1 - t) + bend * t * (1 - t)

        start, end = (ao.Event(t, [along(t), height(t)]) for t in (0.0, 1.0))
        curve = ao.Path.interpolate(lambda t: [along(t), height(t)], ao.Mesh.uniform(0, 1, 3, 9))
        return Balance.of(DiscretePath.of(ao.Problem(system, start, end), curve)).drift()

    assert drift(0.0) < 1e-10 and drift(0.2) > 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("a", [1 / 3, 0.7])
@pytest.mark.parametrize("height", [0.1, 1.0])
def test_across_a_cusp_no_error_is_above_its_estimate(a, height):
    """The time to a point is the integral of 1 / v, by a power of the distance from the cusp."""
    power, solved = 4.0 / a, 0
    lagrangian = free(lambda q: height * np.sign(q[0] - 0.1) * abs(q[0] - 0.1) ** a)
    u = np.linspace(0.0, 1.0, 20001)

    def since_start(x, energy):
        """Return the time from the start to x."""
        times = []
        for y in (-0.83, x):
            depth = u * abs(y - 0.1) ** (1 / power)
            v = np.sqrt(2 * (energy - np.sign(y - 0.1) * height * depth**4))
            times.append(np.sign(y - 0.1) * np.trapezoid(power * depth ** (power - 1) / v, depth))
        return times[1] - times[0]

    low, high = height + 0.01, 50.0
    for _ in range(60):
        energy = (low + high) / 2
        low, high = (energy, high) if since_start(1.07, energy) > 1 else (low, energy)
    points = np.linspace(-0.7, 1.0, 18)
    known = np.array([since_start(x, high) for x in points])
    for tol in (1e-2, 1e-3, 1e-4, 1e-6):  # the steepest is solved to the first alone
        path = across(lagrangian, tol, throw=False)
        solved += path.success
        off = np.abs(path(known)[0] - points).max() / 1.07
        assert not path.success or off <= path.error + 1e-7, (tol, off)
    assert solved


@pytest.mark.long
def test_questions_of_every_kind():
    system = ao.System(free(lambda q: 0.1 * q[0] / abs(q[0])), ["x"])
    start, across = ao.Event(0.0, [-0.83]), ao.Event(None, [1.07])
    given = ao.solve(ao.Problem(system, start, across, energy=2.0), throw=False)
    assert given.status is ao.Status.JUMP
    mesh = ao.Mesh.uniform(0.0, 1.0, 4, 6)
    fixed = ao.Problem(system, start, ao.Event(1.0, [1.07]))
    assert ao.solve(fixed, mesh=mesh, throw=False).status is ao.Status.JUMP
    plane = ao.System(free(lambda q: 0.1 * q[0] / abs(q[0])), ["x", "y"])
    circle = ao.Event(1.0, None, on=lambda q, t: (q[0] - 2) ** 2 + q[1] ** 2 - 1)
    on_surface = ao.solve(ao.Problem(plane, ao.Event(0.0, [-0.83, 0.1]), circle), throw=False)
    assert not on_surface.success


@pytest.mark.quick("end0")
@pytest.mark.parametrize("end", [(0.6, 0.8), (0.8, 0.6)])
def test_on_a_constraint_where_no_path_is_found(end):
    system = ao.System(
        free(lambda q: 0.1 * q[0] / abs(q[0])), ["x", "y"], constraint=lambda q, t: q @ q - 1
    )
    problem = ao.Problem(system, ao.Event(0.0, [-0.6, 0.8]), ao.Event(1.0, end))
    assert ao.solve(problem, throw=False).status is ao.Status.JUMP


@pytest.mark.slow
@pytest.mark.parametrize("start", [-1.0, -0.83])
def test_a_geodesic_across_an_edge_of_the_index(start):
    length = ao.System.geodesic(
        lambda q, v: (1.25 - 0.25 * abs(q[0]) / q[0]) * np.sqrt(v @ v), ["x", "y"]
    )
    problem = ao.Problem(length, ao.Event(0.0, [start, 0.0]), ao.Event(1.0, [1.0, 1.0]))
    assert ao.solve(problem, throw=False).status is ao.Status.JUMP


@pytest.mark.slow
def test_members_of_a_sweep():
    system = ao.System(free(lambda q: 0.1 * q[0] / abs(q[0])), ["x"])
    fixed = ao.Problem(system, ao.Event(0.0, [-0.83]), ao.Event(1.0, [1.07]))
    ends = np.linspace(-0.5, 0.5, 12)  # followed together, but for what may jump
    members = ao.sweep(fixed, {("end", "x"): ends})
    solved = np.array([str(status) == "SOLVED" for status in members.status])
    assert solved[ends < 0].any() and not solved[ends > 0].any()


def test_opposite_jumps_in_members_of_a_sweep():
    """On an element their changes of L cancel: they are seen between its samples."""
    system = ao.System(
        free(lambda q: 0.3 * (abs(q[0] - 0.1) / (q[0] - 0.1) - abs(q[0] - 0.25) / (q[0] - 0.25))),
        ["x"],
    )
    fixed = ao.Problem(system, ao.Event(0.0, [-1.0]), ao.Event(1.0, [1.0]))
    members = ao.sweep(fixed, {("end", "x"): [0.0, 0.5, 0.9, 1.0]})
    assert members.success.tolist() == [True, False, False, False]


@pytest.mark.parametrize(("start", "end"), [(-1e-6, 1.0), (1.0, -1e-4)])
def test_a_jump_beside_an_end_of_the_path(start, end):
    """It lies between the end and the first of the samples."""
    system = ao.System(free(lambda q: 0.2 * abs(q[0]) / q[0]), ["x"])
    problem = ao.Problem(system, ao.Event(0.0, [start]), ao.Event(1.0, [end]))
    assert ao.solve(problem, throw=False).status is ao.Status.JUMP


def test_rounded_velocities_of_short_elements_between_switches_are_no_drift():
    """The energy jumps by 450 and more there, and so by what velocities are rounded."""
    pushed = ao.System(
        lambda q, v, t: v[0] ** 2 / 2 + np.where(abs(t - 0.3) < 1e-4, 5e3, 0) * q[0], ["x"]
    )
    problem = ao.Problem(pushed, ao.Event(0.0, [0.0]), ao.Event(1.0, [1.0]))
    found = ao.solve(problem, tol=1e-12)
    assert found.mesh.elements < 100
    assert found.velocity([0.2, 0.4])[0] == pytest.approx([0.3, 1.3], abs=1e-12)


@pytest.mark.long
def test_a_jump_beside_a_switch_of_the_clock():
    """L jumps in the time there; on either side of it L is compared with itself."""

    def solved(V):
        system = ao.System(
            lambda q, v, t: np.where(t > 0.5, 2.0, 1.0) * v[0] ** 2 / 2 - 0.2 * V(q[0]), ["x"]
        )
        problem = ao.Problem(system, ao.Event(0.0, [-2.0]), ao.Event(1.0, [1.0]))
        return ao.solve(problem, throw=False).status

    assert solved(lambda x: abs(x) / x) is ao.Status.JUMP
    assert solved(abs) is ao.Status.SOLVED


@pytest.mark.quick("19.5--0.9-0.8-6e-10--4e-05-1e-05")
@pytest.mark.parametrize(
    ("duration", "a", "b", "height", "place", "tol"),
    [
        (20.0, -1.0, 1.0, 1e-8, 0.0, 1e-6),
        (10.2, -0.7, 1.1, -6e-7, 0.0, 1e-4),
        (19.5, -0.9, 0.8, 6e-10, -4e-5, 1e-5),
    ],
)
def test_a_low_step_matters_where_the_path_is_slow(duration, a, b, height, place, tol):
    """Past an unstable rest, q'' = q: of both parts the energy differs by the step."""

    def velocities(x, y, time):
        return (y - x * np.cosh(time)) / np.sinh(time), (y * np.cosh(time) - x) / np.sinh(time)

    def surplus(time):
        before, after = velocities(a, place, time)[1], velocities(place, b, duration - time)[0]
        return before**2 / 2 - after**2 / 2 - height

    low, high = 0.02 * duration, 0.98 * duration
    for _ in range(60):  # the sooner there, the faster before and the slower after
        time = (low + high) / 2
        low, high = (time, high) if surplus(time) > 0 else (low, time)
    system = ao.System(
        lambda q, v, t: v[0] ** 2 / 2 + q[0] ** 2 / 2 - height / 2 * np.tanh((q[0] - place) / 1e-9),
        ["x"],
    )
    problem = ao.Problem(system, ao.Event(0.0, [a]), ao.Event(duration, [b]))
    path = ao.solve(problem, tol=tol, throw=False)
    t = np.linspace(0.0, duration, 301)
    left, right = np.sinh(np.minimum(t, time)), np.sinh(np.maximum(t - time, 0.0))
    before = (a * np.sinh(np.maximum(time - t, 0.0)) + place * left) / np.sinh(time)
    rest = np.minimum(duration - t, duration - time)
    after = (place * np.sinh(rest) + b * right) / np.sinh(duration - time)
    off = np.abs(path(t)[0] - np.where(t < time, before, after)).max()
    assert not path.success or off <= path.error * max(-a, b) + 1e-8
    assert path.success or path.error > tol


def test_members_of_a_stack_may_step_where_each_path_does():
    """A motion across a step of 1e-8 that no node meets, in both senses, and without."""
    system = ao.System(
        lambda q, v, t, *, h: v[0] ** 2 / 2 - np.tanh(q[0]) - h * np.tanh((q[0] - 0.1) / 1e-10),
        ["x"],
        parameters={"h": 0.0},
    )
    ends = ao.Event(0.0, [-0.83]), ao.Event(1.0, [1.07])
    smooth = ao.solve(ao.Problem(system, *ends), tol=1e-10)
    mesh = smooth.mesh.cut(smooth.mesh.since, 16)
    curve, heights = smooth.path.on(mesh), [0.0, 1e-8, -1e-8]
    shape = StackShape(system, mesh.moved(0.0, 1.0), ((), ()), np.ones(1), 1.0)
    times, packed = np.tile([0.0, 1.0], (3, 1)), np.array(heights)[:, None]
    stack = Stack(shape, times, packed)
    Q = shape.local(np.tile(curve.values.T, (3, 1, 1)))
    drift = stack.drift(Q, stack.samples(Q), stack.second(Q))
    assert np.isnan(drift).tolist() == [False, True, True] and drift[0] < 1e-12
    for h, expected in zip(heights, drift, strict=True):
        at = DiscretePath.of(ao.Problem(system, *ends, parameters={"h": h}), curve)
        assert (plain_drift(at) is None) == np.isnan(expected)
        assert (find_imbalance(at, 1e-9)[0] is None) == (h == 0.0)


@pytest.mark.slow
def test_members_of_a_sweep_and_points_of_a_trace_are_asked_what_solves_are():
    """Past an unstable rest a step of 1e-8 moves paths by 7e-5: one law, many ends beyond it."""
    system = ao.System(
        lambda q, v, t: v[0] ** 2 / 2 + q[0] ** 2 / 2 - 5e-9 * np.tanh((q[0] - 1e-4) / 1e-10), ["x"]
    )
    problem = ao.Problem(system, ao.Event(0.0, [-1.0]), ao.Event(20.0, [-0.4]))
    ends = np.linspace(-0.5, -0.1, 8)
    members = ao.sweep(problem, {("end", "x"): np.append(ends, [0.1, 0.3])}, tol=1e-6)
    assert members.success.tolist() == [True] * 8 + [False] * 2
    trace = ao.trace(problem, ("end", "x"), to=0.4, tol=1e-6)
    assert trace.values[-1] < 0.1 and "energy" in trace.stopped


@pytest.mark.long
def test_a_low_step_matters_next_to_a_turning_point():
    """A ball that is thrown up is slow where it turns, and loses momentum to a step twice."""
    duration, place, height = 1.9954601680180326, 0.49773266026831936, 0.0009347920570877994
    system = ao.System(
        lambda q, v, t: (
            v[0] ** 2 / 2 - q[0] - height / 2 * np.tanh((q[0] - place) / 7.764481725098049e-12)
        ),
        ["x"],
    )
    problem = ao.Problem(system, ao.Event(0.0, [0.0]), ao.Event(duration, [0.0]))
    path = ao.solve(problem, tol=1e-7, throw=False)
    assert not path.success  # on the parabola, which is a path without the step


def test_a_pulse_that_turns_the_path_is_no_step():
    """Where elements meet next to the turning point the velocity jumps by its error."""
    w, c = 1e-3, 0.5945512033131063
    pulse = ao.System(
        lambda q, v, t: (
            v[0] ** 2 / 2 + 3 * np.exp(-(((t - c) / w) ** 2)) / (np.sqrt(np.pi) * w) * q[0]
        ),
        ["x"],
    )
    problem = ao.Problem(pulse, ao.Event(0.0, [0.0]), ao.Event(1.0, [1.0]))
    path = ao.solve(problem, tol=1e-3)
    assert (
        np.abs(path([0.5, c + 5 * w]) - [(3 * c - 2) / 2, 1 - (3 * c + 1) * (1 - c - 5 * w)]).max()
        < 1e-5
    )


@pytest.mark.slow
def test_a_step_that_no_node_meets():
    """It is solved where it bends the path little or motions cross it, else said to be narrow."""
    low = across(free(lambda q: 5e-5 * np.tanh((q[0] - 0.0123) / 3e-5)), tol=1e-9)
    before, after = low.energy([0.0, 1.0])
    assert before == pytest.approx(after, abs=1e-9)
    high = across(free(lambda q: np.tanh((q[0] - 0.0123) / 1e-6)), tol=1e-8)
    before, after = high.energy([0.0, 1.0])
    assert before == pytest.approx(after, abs=1e-7)
    high = across(free(lambda q: np.tanh((q[0] - 0.0123) / 1e-9)), throw=False)
    assert high.status is ao.Status.UNRESOLVED and high.error == np.inf


CONTINUOUS = {
    "kink": lambda q, v, t: v @ v / 2 - abs(q[0]),
    "cusp": lambda q, v, t: v @ v / 2 - 0.1 * np.sign(q[0] - 0.1) * abs(q[0] - 0.1) ** (1 / 3),
    "hidden switch of a force": lambda q, v, t: v @ v / 2 - np.arctan(1 / (t - 0.3711)) * q[0],
    "steep switch": lambda q, v, t: v @ v / 2 - np.tanh((t - 0.3711) / 1e-6) * q[0],
    "hidden switch of a mass": lambda q, v, t: (2 + np.arctan(1 / (t - 0.3711))) * v @ v / 2,
    "pulse": lambda q, v, t: v @ v / 2 + 100 * np.exp(-(((t - 0.4) / 1e-3) ** 2)) * q[0],
    "wall of some width": lambda q, v, t: v @ v / 2 - np.tanh((q[0] - 0.0123) / 1e-2) / 9,
    "large constant": lambda q, v, t: v @ v / 2 - np.tanh(q[0]) + 1e9,
    "difference of large numbers": lambda q, v, t: (
        v @ v / 2 + (1e9 + np.tanh(q[0])) - 1e9 - np.tanh(q[0]) / 2
    ),
    "surface not crossed": lambda q, v, t: v @ v / 2 - np.arctan(1 / (q[0] + 0.9)),
}


SLOW = ("cusp", "steep switch")


@pytest.mark.quick(
    "kink",
    "hidden switch of a force",
    "hidden switch of a mass",
    "large constant",
    "difference of large numbers",
    "surface not crossed",
)
@pytest.mark.parametrize(
    "name",
    [pytest.param(x, marks=pytest.mark.slow) if x in SLOW else x for x in CONTINUOUS],
)
def test_what_does_not_jump_is_solved(name):
    tol = 1e-3 if name == "cusp" else 1e-4
    assert across(CONTINUOUS[name], tol=tol).status is ao.Status.SOLVED


def test_the_balance_holds_along_any_curve_and_shows_the_slightest_jump():
    """No motion is asked for: the error of the path drops out."""
    mesh = ao.Mesh.uniform(0.0, 1.0, 3, 9)
    problem = ao.Problem(
        ao.System(free(lambda q: np.exp(q[0]) * q[1]), ["x", "y"]),
        ao.Event(0.0, [-1.0, 0.0]),
        ao.Event(1.0, [1.0, 0.5]),
    )
    curve = ao.Path.interpolate(lambda t: [2 * t - 1, t**2 * np.cos(t) / np.cos(1.0) / 2], mesh)

    def at(V):
        other = ao.Problem(ao.System(free(V), ["x", "y"]), problem.start, problem.end)
        return DiscretePath.of(other, curve)

    smooth = at(lambda q: np.exp(q[0]) * q[1])
    assert find_imbalance(smooth, 1e-13)[0] is None
    stepped = at(lambda q: np.exp(q[0]) * q[1] + 1e-11 * (q[1] - 0.2) / np.sqrt((q[1] - 0.2) ** 2))
    assert find_imbalance(stepped, 1e-9)[0] is None
    stepped = at(lambda q: np.exp(q[0]) * q[1] + 1e-6 * (q[0] - 0.2) / np.sqrt((q[0] - 0.2) ** 2))
    jump, _ = find_imbalance(stepped, 1e-9)
    assert isinstance(jump, Jump)
    assert jump.height == pytest.approx(2e-6, rel=1e-3)
    assert jump.q[0] == pytest.approx(0.2, abs=1e-12) and jump.t == pytest.approx(0.6, abs=1e-12)


@at_once(
    ("V", "plain"),
    [
        (lambda q: 1 / np.sqrt(q @ q), True),
        (lambda q: (q @ q) ** -1.5 + q[0] ** 2, True),
        (lambda q: q[1] * np.sqrt(1 + q[0] ** 2), True),
        (lambda q: np.log(q[0]) * np.cos(q[1]), True),
        (lambda q: q[0] / np.sqrt(q @ q), False),
        (lambda q: q[0] * (q @ q) ** -0.5, False),
        (lambda q: 1 / np.sqrt(q[0] ** 2) - 1 / q[0], False),
        (lambda q: np.sqrt(1e9 * q[0] ** 2) - np.sqrt(1e9 * (q[0] - 1e-9) ** 2), False),
        (lambda q: np.sqrt(q[0] ** 2) / (1e-9 + np.sqrt(q[0] ** 2)), False),
        (lambda q: np.cos(1 / q[0]), False),
        (lambda q: 1 / np.sqrt(q @ q) + 2 * ((q - 1) @ (q - 1)) ** -0.5, True),
        (lambda q: -1 / np.sqrt(q @ q) + 1 / np.sqrt(q @ q + q[0] ** 3), False),
        (lambda q: (q @ q) ** 0.1, False),
        (lambda q: abs(q[0]), False),
        (lambda q: np.tan(q[0]), False),
    ],
)
def test_what_plainly_cannot_jump_is_not_asked(V, plain):
    assert ao.System(free(V), ["x", "y"]).structure.jumpless is plain


@pytest.mark.long
@pytest.mark.parametrize("timed", [0.0, 0.3])
def test_a_smooth_lagrangian_needs_no_balance(monkeypatch, timed):
    def refuse(at):
        raise AssertionError

    monkeypatch.setattr(Balance, "of", refuse)
    for V in (
        lambda q, t: np.tanh(q[0] - timed * t),
        lambda q, t: np.exp(-(q @ q)) * np.cos(timed * t),
        lambda q, t: q[1] / (1 + q @ q + timed * t**2),
    ):
        system = ao.System(lambda q, v, t, V=V: v @ v / 2 - V(q, t), ["x", "y"])
        assert not system.structure.jumpless
        ao.solve(ao.Problem(system, ao.Event(0.0, [-1.0, 0.3]), ao.Event(1.0, [1.0, 0.4])))


@pytest.mark.quick("-0.993-0.0", "0.0-0.3", "1e-06-0.0")
@pytest.mark.parametrize("timed", [0.0, 0.3])
@pytest.mark.parametrize("place", [-1 + 1e-7, -0.993, -0.5, 0.0, 1e-6, 0.3, 0.77, 1 - 1e-7])
def test_no_step_is_plain_wherever_it_is(place, timed):
    """Of a straight motion, on whose samples, nodes and ends the step may be."""
    for height, plain in ((0.0, True), (1e-10, False), (1e-3, False), (1e9, False)):

        def lagrangian(q, v, t, height=height):
            step = (q[0] - place) / np.sqrt((q[0] - place) ** 2)
            return v[0] ** 2 / 2 + timed * np.tanh(t) - (height * step if height else 0.0)

        assert is_plain(straight(lagrangian), 1e-12) is plain


@pytest.mark.parametrize("unit", [1e-5, 1.0, 1e5])
def test_what_is_plain_does_not_depend_on_units(unit):
    def lagrangian(q, v, t):
        return v[0] ** 2 / 2 - unit**2 * np.tanh(3 * q[0] / unit)

    problem = ao.Problem(
        ao.System(lagrangian, ["x"]), ao.Event(0.0, [-unit]), ao.Event(1.0, [unit])
    )
    found = ao.solve(problem, tol=1e-3)
    assert is_plain(found.discrete, found.error)
    assert not is_plain(found.discrete, 1e-4 * found.error)


@pytest.mark.parametrize("width", [1e-9, 1e-13, 1e-17])
def test_stairs_closer_than_samples_are_not_plain(width):
    """A mean force that no derivative shows: the straight motion is stationary to all sums."""

    def lagrangian(q, v, t):
        return v[0] ** 2 / 2 + width * np.arctan(np.tan(q[0] / width)) - q[0]

    assert not is_plain(straight(lagrangian), 1e-12)


def is_plain(at, error):
    """Whether no balance is asked of a path whose error is known so well."""
    drift = plain_drift(at)
    return drift is not None and DRIFT_SAFETY * drift <= error


def straight(lagrangian):
    """Return the straight motion from -1 to 1 on a mesh."""
    mesh = ao.Mesh.uniform(0.0, 1.0, 4, 12)
    problem = ao.Problem(ao.System(lagrangian, ["x"]), ao.Event(0.0, [-1.0]), ao.Event(1.0, [1.0]))
    return DiscretePath.of(problem, ao.Path.interpolate(lambda t: [2 * t - 1], mesh))


@pytest.mark.long
def test_a_table_ends_with_a_step():
    """Beyond its ends it is zero: there the path jumps in energy, and within it does not."""
    at = np.linspace(-2, 2, 41)
    table = ca.interpolant("V", "bspline", [at], np.cos(3 * at))
    system = ao.System(lambda q, v, t: v[0] ** 2 / 2 - table(q[0]), ["x"])
    inside, beyond = (
        ao.solve(ao.Problem(system, ao.Event(0, [0.0]), ao.Event(1, [x])), throw=False).status
        for x in (1.9, 3.0)
    )
    assert inside is ao.Status.SOLVED and beyond is ao.Status.JUMP


@pytest.mark.parametrize("tol", [1e-6, 1e-8])
def test_what_sums_across_a_knot_miss_moves_no_path(monkeypatch, tol):
    """The third derivative of a spline jumps: from sample to sample (1) is off, and back again."""

    def refuse(problem, path, found):
        raise AssertionError

    monkeypatch.setattr(crossing, "narrowest_intervals", refuse)
    at = np.linspace(-2, 2, 41)
    table = ca.interpolant("V", "bspline", [at], np.cos(3 * at))
    system = ao.System(lambda q, v, t: v[0] ** 2 / 2 - table(q[0]), ["x"])
    problem = ao.Problem(system, ao.Event(0.0, [0.0]), ao.Event(1.0, [1.2]))
    path = ao.solve(problem, tol=tol)
    energy = path.energy(np.linspace(0, 1, 41))
    assert np.ptp(energy) < 100 * tol


@pytest.mark.parametrize(("signs", "harmless"), [((1, -1), True), ((1, 1, 1, 1, 1), False)])
def test_low_steps_are_asked_what_they_move_together(signs, harmless):
    """One that the next one undoes moves a path little, several on one side of it add up."""
    mesh = ao.Mesh.uniform(0.0, 1.0, 4, 12)

    def lagrangian(q, v, t):
        steps = [s * np.tanh((q[0] + 0.0321 - 0.06 * k) / 1e-13) for k, s in enumerate(signs)]
        return v[0] ** 2 / 2 - 1.5e-8 * sum(steps)

    problem = ao.Problem(ao.System(lagrangian, ["x"]), ao.Event(0.0, [-1.0]), ao.Event(1.0, [1.0]))
    at = DiscretePath.of(problem, ao.Path.interpolate(lambda t: [2 * t - 1], mesh))
    assert (Balance.of(at).beyond(1e-8) is None) is harmless


def passing_time(V, low, high, energy, edges):
    """Return how long a unit mass takes in a potential from `low` to `high`, by Gauss's sums."""
    x, w = np.polynomial.legendre.leggauss(40)
    a, b = np.array([low, *edges]), np.array([*edges, high])
    q = (a + b)[:, None] / 2 + (b - a)[:, None] / 2 * x
    return float(((b - a) / 2) @ (1 / np.sqrt(2 * (energy - V(q))) @ w))


@pytest.mark.quick("-0.3")
@pytest.mark.parametrize("height", [0.3, -0.3])
def test_a_wall_between_two_samples_is_crossed_as_a_motion_does(height):
    """A thousandth of what the samples see: the motion is late behind it, or ahead."""
    middle, width = 0.3, 2e-6

    def V(q):
        return height * np.exp(-(((q - middle) / width) ** 2))

    found = across(free(lambda q: V(q[0])), tol=1e-8)
    edges = middle + width * np.linspace(-8, 8, 33)
    energy = found.velocity(0.0)[0] ** 2 / 2
    assert passing_time(V, -0.83, 1.07, energy, edges) == pytest.approx(1.0, abs=3e-8)


@pytest.mark.long
def test_a_well_between_two_steps_is_told():
    """Both are between two samples, and behind them the energy is as before."""
    edges, width, depth = np.array([0.3, 0.3 + 2e-5]), 1e-12, 0.05

    def V(q):
        x = (q[0] - edges) / width
        return -depth * (x / np.sqrt(1 + x**2) @ np.array([0.5, -0.5]))

    late = 2e-5 * (1 - 1 / np.sqrt(1 + 2 * depth / 1.9**2)) / 1.07
    assert late < across(free(V), tol=1e-6).error < 3 * late
    assert across(free(V), tol=1e-8, throw=False).status is ao.Status.UNRESOLVED
    problem = ao.Problem(ao.System(free(V), ["x"]), ao.Event(0.0, [-0.83]), ao.Event(1.0, [1.07]))
    ends = ao.sweep(problem, {("end", "x"): np.linspace(1.0, 1.1, 3)}, tol=1e-6)
    assert ends.success.all() and (ends.error > late / 2).all()


@pytest.mark.long
def test_windows_narrower_than_samples_are_jumps():
    wall = across(free(lambda q: np.where(abs(q[0] - 0.3) < 1e-5, 0.1, 0.0)), throw=False)
    assert wall.status is ao.Status.JUMP


def two_speeds(k):
    """L = v^3 / 6 + v^2 / 2 - k q^2 / 2: velocities v and -2 - v have one momentum."""
    law = lambda q, v, t: v[0] ** 3 / 6 + v[0] ** 2 / 2 - k * q[0] ** 2 / 2  # noqa: E731
    return ao.System(law, ["q"])


@pytest.mark.parametrize(
    ("k", "ends", "T"), [(2.2834, (2.6584, 0.1806), 1.7919), (1.4627, (-0.5344, -0.8441), 2.8907)]
)
def test_a_path_that_turns_a_corner_is_no_motion(k, ends, T):
    """It was called one: momenta agree on both sides of it, and energies do not."""
    start, end = ends
    problem = ao.Problem(two_speeds(k), ao.Event(0.0, start), ao.Event(T, end))
    found = ao.solve(problem, throw=False)
    t = np.linspace(0.0, T, 2001)
    assert not found.success or np.ptp(found.energy(t)) < 1e-6


def test_a_path_beside_those_that_turn_corners_is_found():
    problem = ao.Problem(two_speeds(2.0), ao.Event(0.0, 0.3), ao.Event(1.0, 0.9))
    found = ao.solve(problem, tol=1e-10)
    assert np.ptp(found.energy(np.linspace(0.0, 1.0, 101))) < 1e-8
    assert found.compare().agrees
