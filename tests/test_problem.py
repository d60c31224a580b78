"""Events, states and problems: what they hold, and what they refuse."""

import pickle

import numpy as np
import pytest
import systems
from helpers import at_once

from actionopt import scenes
from actionopt.mechanics.question.events import Event, Periodic, State, _shift
from actionopt.mechanics.question.problem import Problem
from actionopt.mechanics.system import System


def free(q, v, t, *, m):
    return m * (v[0] ** 2 + v[1] ** 2) / 2


plane = System(free, ("x", "y"), parameters={"m": 2.0})
circle = System(
    free,
    ("x", "y"),
    parameters={"m": 2.0, "r": 1.0},
    constraint=lambda q, t, *, r: q[0] ** 2 + q[1] ** 2 - r**2,
)
START, END = Event(0.0, [0.0, 1.0]), Event(2.0, [1.0, 0.0])


def test_events_hold_plain_numbers_and_know_what_is_free():
    event = Event(np.float64(1), np.array([2, 3]))
    assert event.t == 1.0
    assert event.q == (2.0, 3.0)
    assert Event(0.0, [None, 1.0, None]).pinned == (1,)
    assert Event(0.0, 0.5).q == (0.5,)


def test_no_coordinates_leave_all_of_them_free():
    """As many as the system has, also behind a path that closes, and after a move in time."""
    loose = Event(0.5, None)
    assert loose.q is None and loose.pinned == () and loose.shifted([1.0, 2.0]) is loose
    assert Problem(plane, START, loose).end.q == (None, None)
    assert Problem(plane, loose.at(0.0), Periodic(2.0, [0, 1])).end.q == (None, None)
    assert Problem(plane, START, END).replace(start=Event(1.0, None)).start.q == (None, None)
    assert pickle.loads(pickle.dumps(loose)).q is None
    with pytest.raises(ValueError, match=r"2 coordinates \(x, y\) at the end event, found 0"):
        Problem(plane, START, Event(1.0, []))


def test_states_are_read_only_vectors():
    state = State(0.0, [1.0, 2.0], [3.0, 4.0])
    assert state.q.shape == state.v.shape == (2,)
    with pytest.raises(ValueError, match="read-only"):
        state.q[0] = 0.0


def test_a_problem_has_every_parameter_and_derives_nothing():
    problem = Problem(plane, START, END, parameters={"m": 5.0})
    assert problem.parameters == {"m": 5.0}
    assert problem.duration == 2.0
    assert plane.parameters == {"m": 2.0}
    assert plane.derived == ()


def test_parameters_are_copies_that_cannot_be_overwritten():
    M = np.diag([1.0, 2.0])
    system = System(lambda q, v, t, *, M: v @ M @ v / 2, ["x", "y"], parameters={"M": M})
    problem = Problem(system, START, END, parameters={"M": M})
    M[0, 0] = 1e3
    for held in (system.parameters, problem.parameters):
        assert held["M"][0, 0] == 1.0
        with pytest.raises(ValueError, match="read-only"):
            held["M"][0, 0] = 7.0
    assert M.flags.writeable


def test_scales_come_from_the_events_and_are_never_zero():
    assert Problem(plane, Event(0, [0, -3]), Event(1, [0.5, 1])).scales.tolist() == [0.5, 3.0]
    assert Problem(plane, Event(0, [0, -3]), Event(1, [0, None])).scales.tolist() == [3.0, 3.0]
    assert Problem(plane, Event(0, [0, 0]), Event(1, [0, 0])).scales.tolist() == [1.0, 1.0]


def test_rounding_of_one_coordinate_is_no_scale_of_another():
    start = Event(0, [1.0, np.sin(np.pi)])
    for end in ([-1.0, 0.0], [-1.0, 1e-17]):
        assert Problem(plane, start, Event(1, end)).scales.tolist() == [1.0, 1.0]


def test_an_angle_beside_a_great_distance_is_a_scale():
    # A planet in metres: r is 1e13 times phi, and r^2 phi'^2 is as good as r'^2.
    planet = System(lambda q, v, t: (v[0] ** 2 + q[0] ** 2 * v[1] ** 2) / 2, ["r", "phi"])
    problem = Problem(planet, Event(0, [4.5e12, 0.0]), Event(6e8, [4.5e12, 0.2]))
    assert problem.scales.tolist() == [4.5e12, 0.2]


def test_events_on_the_surface_pass_in_any_unit():
    for r in (1e-10, 1.0, 1e11):
        Problem(circle, Event(0, [0, r]), Event(1, [r * 0.6, -r * 0.8]), parameters={"r": r})


def test_a_free_coordinate_leaves_the_constraint_to_decide():
    Problem(circle, START, Event(1, [0.6, None]))


@pytest.mark.parametrize(
    "row", [lambda q, t: 0 * q[0], lambda q, t: t - t, lambda q, t: t * (t - 2), lambda q, t: 0.0]
)
def test_a_constraint_without_coordinates_is_refused(row):
    alone = systems.particle("x y", constraint=row)
    second = systems.particle("x y", constraint=lambda q, t: [q[0] + q[1] - 1, row(q, t)])
    for i, system in enumerate((alone, second)):
        with pytest.raises(ValueError, match=f"row {i} does not depend on any of them"):
            Problem(system, START, END)


@pytest.mark.parametrize("r", [1e-10, 1.0, 1e11])
def test_events_off_the_surface_are_refused_in_any_unit(r):
    with pytest.raises(ValueError, match=r"end event on the constraint surface.*constraint row 0"):
        Problem(circle, Event(0, [0, r]), Event(1, [r * 0.6, -r * 0.801]), parameters={"r": r})


@at_once(
    ("build", "message"),
    [
        (lambda: Event("noon", [0]), "expected a number for the time of an event, found 'noon'"),
        (lambda: Event(np.nan, [0]), "finite number for the time of an event"),
        (lambda: Event(np.inf, [0, None]), "all coordinates of the equilibrium at infinite time"),
        (lambda: Event(np.inf, None), "equilibrium at infinite time, found None; give the numbers"),
        (lambda: Event(0, [0, np.nan]), "finite number for coordinate 1 of an event"),
        (lambda: Event(0, [[0, 1]]), "number for coordinate 0 of an event"),
        (lambda: Event("1.0", [0]), "a number for the time of an event, found '1.0'"),
        (lambda: Event(0, "up"), "number for coordinate 0 of an event, found 'up'"),
        (lambda: Event(0, [0, 1j]), "number for coordinate 1 of an event"),
        (lambda: Event(0, np.array([0, 1j])), "number for coordinate 0 of an event"),
        (lambda: Event(0, {"x": 1.0}), "order of the coordinates .*found {'x': 1.0}, which has no"),
        (
            lambda: Event(0, {1.0, 2.0}),
            "order of the coordinates .*, which has no such order; give",
        ),
        (lambda: Event(0, {0: 1}), "coordinates of an event in the order .* give a list"),
        (lambda: Periodic(1, {0: 1}), "advance of a periodic end in the order"),
        (lambda: Event(0, [[0], [1, 2]]), "number for coordinate 0 of an event"),
        (lambda: Event(0, np.ones((2, 1))), "number for coordinate 0 of an event"),
        (lambda: Periodic(1, "a turn"), "number for advance 0 of a periodic end"),
        (lambda: Periodic(1, [0, np.inf]), "finite number for advance 1"),
        (lambda: State(0, [1j], [0]), "numbers for q of a state"),
        (lambda: State(0, [0], "fast"), "numbers for v of a state, found 'fast'"),
        (lambda: State(0, [[0], [1, 2]], [0]), "numbers for q of a state"),
        (lambda: State(0, None, [0]), r"finite q of shape \(n,\)|numbers for q"),
        (lambda: State(0j, [0], [0]), "number for the time of a state"),
        (lambda: Problem(None, START, END), r"expected a System\(lagrangian, .*found None"),
        (lambda: Problem(free, START, END), r"expected a System\(lagrangian, .*by System"),
        (lambda: Problem(plane, START, END, parameters=[1]), r"parameters by name, .*found \[1\]"),
        (lambda: Problem(plane, START, END, parameters=2.0), "parameters by name"),
        (lambda: Problem(plane, START, END, parameters={"m": 1j}), "numbers for parameter 'm'"),
        (lambda: State(0, [0, 1], [0]), "q and v of one shape"),
        (lambda: State(0, [np.nan], [0]), r"finite q of shape \(n,\)"),
        (lambda: Problem(plane, Event(0, [0]), END), r"2 coordinates \(x, y\) at the start"),
        (lambda: Problem(plane, START, Event(1, [0, 0, 0])), r"2 coordinates \(x, y\) at the end"),
        (lambda: Problem(plane, START, (1, [0, 0])), r"expected an Event\(t, q\) as the end"),
        (lambda: Problem(plane, END, START), "end event after the start event"),
        (lambda: Problem(plane, START, Event(0, [1, 1])), "end event after the start event"),
        (
            lambda: Problem(plane, START, Event(1e300, [1, 0])),
            r"1e-100 to 1e\+100, .*found 1e\+300",
        ),
        (
            lambda: Problem(plane, START, Event(5e-324, [1, 0])),
            "found 4.94066e-324; .* another unit",
        ),
        (lambda: Problem(plane, Event(-1e308, [0, 1]), Event(1e308, [1, 0])), "found inf; measure"),
        (lambda: Problem(plane, START, END, parameters={"n": 1}), "unknown parameter 'n'"),
        (lambda: Problem(plane, START, END, parameters={"mm": 1}), "did you mean 'm'"),
        (lambda: Problem(plane, START, END, parameters={"m": np.nan}), "finite parameter 'm'"),
    ],
)
def test_bad_input_says_what_is_wrong(build, message):
    with pytest.raises(ValueError, match=message):
        build()


# -- other events, other parameters ----------------------------------------------------------------


def test_replacing_keeps_the_rest():
    problem = scenes.get("double_pendulum", m1=2.0).problem
    problem = problem.replace(start=Event(0.0, [0.1, None]), end=Periodic(2.0, [0.0, 7.0]))
    assert float(problem.parameters["m1"]) == 2.0
    later = problem.replace(end=problem.end.at(3.0), parameters={"m2": 4.0})
    assert later.start is problem.start and later.system is problem.system
    assert isinstance(later.end, Periodic)
    assert (later.end.t, later.end.q, later.end.advance) == (3.0, (0.1, None), (0.0, 7.0))
    assert (float(later.parameters["m1"]), float(later.parameters["m2"])) == (2.0, 4.0)
    moved = problem.replace(start=Event(-1.0, [0.3, None]))
    assert isinstance(moved.end, Periodic) and moved.end.q == (0.3, None)
    with pytest.raises(ValueError, match="unknown parameter 'm3'"):
        problem.replace(parameters={"m3": 1.0})


def test_events_move():
    event = Event(1.0, [2.0, None])
    assert (event.at(3.0).t, event.at(3.0).q) == (3.0, (2.0, None))
    assert event.shifted([1.0, 5.0]).q == (3.0, None)
    turned = Periodic(1.0).shifted([0.0, 6.0]).shifted([1.0, 0.5])
    assert isinstance(turned, Periodic) and turned.advance == (1.0, 6.5)


@pytest.mark.parametrize(
    ("build", "found"),
    [
        (lambda: Event(0, [1.0], p=[0.0]), r"p=\[0.0\]"),
        (lambda: Event(0, [1.0], [0.0]), r"also \[0.0\]"),
    ],
)
def test_a_velocity_in_an_event_is_pointed_to_what_takes_one(build, found):
    with pytest.raises(TypeError, match=found + r"; None leaves .*actionopt.integrate\(system"):
        build()


@pytest.mark.parametrize("duration", [1e-100, 1e-30, 1e30, 1e100])
def test_durations_far_from_the_limits_of_numbers_are_solved(duration):
    from actionopt import solve

    problem = Problem(plane, START, Event(duration, [1.0, 0.0]))
    assert solve(problem).action == pytest.approx(2 / duration)  # m |q1 - q0|^2 / 2T


@pytest.mark.parametrize("u", [2.0, -2.0])
@pytest.mark.parametrize("off", [1e-6, -1e-6])
def test_events_on_a_surface_that_moves_pass_up_to_rounding(u, off):
    """x = u t: at t = 0 what x should be is zero, and only the motion gives a scale."""
    wall = systems.particle("x y", constraint=lambda q, t: q[0] - u * t)
    for rounding in (0.0, 1e-17, -1e-17):
        Problem(wall, Event(0, [rounding, 0.0]), Event(1.5, [1.5 * u, 0.0]))
        Problem(wall, Event(0, [rounding, 1e-20]), Event(1e-3, [1e-3 * u, 0.0]))
    with pytest.raises(ValueError, match="start event on the constraint surface"):
        Problem(wall, Event(0, [off, 0.0]), Event(1.5, [1.5 * u, 0.0]))
    with pytest.raises(ValueError, match="end event on the constraint surface"):
        Problem(wall, Event(0, [0.0, 0.0]), Event(1.5, [1.5 * u + off, 0.0]))


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_size_of_a_motion_far_from_zero_is_told_by_forces(side):
    """Events 1e6 away and 0.2 apart; free fall leads |a| T^2 / 8 from the straight line."""
    for a, T, size in ((0.0, 2.0, 0.2), (side * 9.81, 2.0, 9.81 / 2), (side * 1e-3, 2.0, 0.2)):
        falling = System(lambda q, v, t, a=a: 3.0 * (v[0] ** 2 / 2 + a * q[0]), ("x",))
        here = side * 1e6
        problem = Problem(falling, Event(0.0, [here]), Event(T, [here - side * 0.2]))
        assert problem.lengths == pytest.approx([size], rel=1e-9)
        assert problem.origin == pytest.approx([here - side * 0.1], rel=1e-12)
        assert problem.scales.tolist() == [1e6]


def test_a_stiff_coordinate_says_nothing_of_how_far_another_goes():
    """A soft spring, 3e-4 from its rest, with or without a stiff one beside it that is at rest."""

    def soft(q, v, t):
        return v @ v / 2 - 1e4 * (q[0] - 1e6) ** 2 / 2 + 3 * q[0]

    def springs(q, v, t):
        return soft(q, v, t) - 1e8 * (q[1] - 1e6) ** 2 / 2

    alone, beside = (
        Problem(System(lagrangian, names), Event(0.0, q), Event(2.0, q))
        for lagrangian, names, q in ((soft, ["x"], [1e6]), (springs, ["x", "y"], [1e6, 1e6]))
    )
    assert alone.lengths == pytest.approx([3e-3])  # ten times the distance to rest
    assert beside.lengths[0] == alone.lengths[0]


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_events_that_are_not_close_are_measured_from_zero(side):
    for x0, x1 in ((1.0, 1.02), (1.0, -1.0), (0.0, 1e6), (5.0, None), (1e6, 2e6)):
        ends = [Event(t, [None if x is None else side * x]) for t, x in ((0, x0), (1, x1))]
        problem = Problem(systems.particle(), *ends)
        assert problem.origin is None
        assert problem.lengths == problem.scales == [max(abs(x0), abs(x1 or 0.0))]


def test_an_event_at_a_time_is_its_own_limit_and_no_obstacle_holds_nothing():
    event, plain = Event(1.0, [0.0]), systems.particle()
    assert event.limit is event and plain.with_contact is plain


def test_a_shift_is_of_all_coordinates():
    assert _shift([1, 2], 2).tolist() == [1.0, 2.0] and _shift([1], None).tolist() == [1.0]
    with pytest.raises(ValueError, match="a shift of 2 coordinates, found"):
        _shift([1.0], 2)
    with pytest.raises(ValueError, match="a shift of all coordinates, found"):
        _shift([[1.0]], None)
