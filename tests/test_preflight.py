"""What is wrong with a question is said before any solver runs, each thing in its own words."""

import numpy as np
import pytest
import systems
from helpers import at_once

import actionopt as ao
from actionopt import Event, Mesh, Problem, System
from actionopt.discrete.action.projection import project
from actionopt.discrete.action.transcription import Transcription
from actionopt.solver.input.preflight import check
from actionopt.solver.refinement.verdict import _events_off_constraints


def kinetic(v):
    return sum(x**2 for x in v) / 2


def line(n, t=1.0, start=None, end=None):
    return (
        Event(0.0, np.zeros(n) if start is None else start),
        Event(t, np.ones(n) if end is None else end),
    )


def refused(system, *events, match, **options):
    """Assert that the problem is refused by a ValueError, and that no solver was built."""
    problem = Problem(system, *(events or line(system.n)))
    with pytest.raises(ValueError, match=match):
        ao.solve(problem, **options)
    tr = Transcription(problem, Mesh.uniform(problem.start.t, problem.end.t, 4, 6), problem.scales)
    assert not tr.layout.solvers


# -- mass matrices --------------------------------------------------------------------------------


SINGULAR = {
    "no velocity at all": (lambda q, v, t: v[0] ** 2 / 2 - q[1] ** 2, "xy", "y"),
    "linear in a velocity": (lambda q, v, t: v[0] ** 2 / 2 + q[0] * v[1], "xy", "y"),
    "only a sum of velocities": (lambda q, v, t: (v[0] + v[1]) ** 2 / 2 - q[0] ** 2, "xy", "x, y"),
    "no kinetic energy": (lambda q, v, t: -(q[0] ** 2), "x", "x"),
    "the length of a curve": (lambda q, v, t: np.sqrt(v[0] ** 2 + v[1] ** 2), "xy", "x, y"),
    "far between others": (
        lambda q, v, t: (v[0] ** 2 + v[2] ** 2) / 2 - q[1] ** 2 * q[0],
        "abc",
        "b",
    ),
}


@at_once("case", SINGULAR)
def test_a_singular_mass_matrix_names_the_coordinate(case):
    lagrangian, names, guilty = SINGULAR[case]
    refused(
        System(lagrangian, list(names)),
        match=f"regular mass matrix .* in the direction of {guilty}: .*eliminate .*legitimate|"
        f"regular mass matrix .* in the direction of {guilty}: .*legitimate .*eliminate",
    )


@at_once(
    ("m", "other", "x", "principle"),
    [
        (1e-12, 1e-12, 1.0, "auto"),
        (1e12, 1e12, 1.0, "auto"),
        (1.0, 1e-18, 1e-9, "auto"),  # a length in nanometres and an angle
        (1.0, 1e-24, 1.0, "auto"),
        (-1.0, -1e-24, 1.0, "stationary"),  # which knows nothing of the sign of L
    ],
)
def test_masses_of_any_size_and_units_are_no_singularity(m, other, x, principle):
    system = System(lambda q, v, t: (m * v[0] ** 2 + other * v[1] ** 2) / 2, ["x", "y"])
    problem, t = Problem(system, *line(2, end=[x, 1.0])), np.linspace(0, 1, 5)
    solution = ao.solve(problem, principle=principle)
    assert np.max(np.abs(solution(t) / np.array([[x], [1.0]]) - t)) <= 1e-8


@at_once("small", [1e-3, 1e-6, 1e-9, 1e-11, 1e-15])
def test_a_small_extent_is_no_missing_mass(small):
    # Isotropic and uncoupled: each coordinate is a sine of its own.
    system = System(lambda q, v, t: kinetic(v) - (q[0] ** 2 + 2 * q[1] ** 2) / 2, ["x", "y"])
    problem = Problem(system, Event(0, [0, 0]), Event(1, [1, small]))
    solution, t = ao.solve(problem), np.linspace(0, 1, 11)
    x, y = np.sin(t) / np.sin(1), small * np.sin(np.sqrt(2) * t) / np.sin(np.sqrt(2))
    assert np.max(np.abs(solution(t)[0] - x)) <= 1e-10
    assert np.max(np.abs(solution(t)[1] - y)) <= 1e-10 * small


@pytest.mark.parametrize("unit", [1e-9, 1e9])
def test_a_singular_mass_matrix_of_any_units_is_one(unit):
    system = System(lambda q, v, t: (v[0] + unit * v[1]) ** 2 / 2 - q[0] ** 2, ["x", "y"])
    events = Event(0, [0, 0]), Event(1, [1, 1 / unit])
    refused(system, *events, match="singular in the direction of x, y")


def test_a_mass_that_vanishes_at_rest_only_is_accepted():
    system = System(lambda q, v, t: v[0] ** 4 / 12, ["x"])
    solution = ao.solve(Problem(system, Event(0, [0]), Event(1, [2])), guess=lambda t: 2 * t)
    assert np.max(np.abs(solution([0.25, 0.5])[0] - [0.5, 1.0])) <= 1e-8


def test_a_massless_coordinate_that_a_constraint_fixes_is_accepted():
    # y = x^2 has no mass of its own; x moves freely.
    system = System(
        lambda q, v, t: v[0] ** 2 / 2, ["x", "y"], constraint=lambda q, t: q[1] - q[0] ** 2
    )
    solution = ao.solve(Problem(system, Event(0, [0, 0]), Event(1, [2, 4])))
    t = np.linspace(0, 1, 11)
    assert np.max(np.abs(solution(t) - [2 * t, 4 * t**2])) <= 1e-8


def test_no_mass_is_needed_where_constraints_leave_no_motion():
    rail = System(
        lambda q, v, t: v[0] ** 2 / 2 - q[1],
        ["x", "y"],
        constraint=lambda q, t: [q[0] - t, q[1] - t * t],
    )
    solution = ao.solve(Problem(rail, Event(0.0, [0.0, 0.0]), Event(1.0, [1.0, 1.0])))
    t = np.linspace(0, 1, 5)
    assert np.max(np.abs(solution(t) - [t, t * t])) <= 1e-12


def test_a_massless_coordinate_beside_a_constraint_is_not():
    refused(
        System(
            lambda q, v, t: (v[0] ** 2 + v[1] ** 2) / 2 - q[2] ** 2,
            list("xyz"),
            constraint=lambda q, t: q[0] - q[1],
        ),
        match="singular in the direction of z",
    )


# -- constraints ----------------------------------------------------------------------------------


def constrained(constraint, n=3):
    return System(lambda q, v, t: kinetic(v), [f"x{i}" for i in range(n)], constraint=constraint)


REDUNDANT = {
    "the same row twice": (lambda q, t: [q[0] - q[1], q[0] - q[1]], r"rows \[0, 1\] say the same"),
    "a multiple of it": (lambda q, t: [q[0] - q[1], 7 * (q[1] - q[0])], r"rows \[0, 1\] say"),
    "a small one": (lambda q, t: [1e-9 * (q[0] - q[1]), q[1] - q[0]], r"rows \[0, 1\] say"),
    "a large one": (lambda q, t: [1e9 * (q[0] - q[1]), q[1] - q[0]], r"rows \[0, 1\] say"),
    "the sum of two others": (
        lambda q, t: [q[0] - q[1], q[1] - q[2], q[0] - q[2]],
        r"rows \[0, 1, 2\] say the same",
    ),
    "a free row among redundant ones": (
        lambda q, t: [q[0] - q[1], q[2] - t, 2 * q[0] - 2 * q[1]],
        r"rows \[0, 2\] say the same",
    ),
    "the square of another": (
        lambda q, t: [q[0] ** 2 - q[1] ** 2 + q[0] - q[1], q[0] - q[1]],
        r"rows \[0, 1\] say the same",
    ),
    "a row that is flat there": (lambda q, t: [q[0] - q[1], (q[0] - q[2]) ** 2], "row 1 does not"),
    "nothing but such a row": (lambda q, t: (q[0] - q[2]) ** 2, "row 0 does not depend"),
}


@at_once("case", REDUNDANT)
def test_redundant_rows_are_named(case):
    constraint, match = REDUNDANT[case]
    refused(constrained(constraint), match=match)


@pytest.mark.parametrize("scale", [1e-9, 1.0])
def test_rows_that_contradict_each_other_are_named(scale):
    # Both hold at the events, t = 0 and 1, and not between.
    refused(
        constrained(lambda q, t: [q[0] - q[1], scale * (q[0] - q[1] - t * (1 - t))]),
        match=r"rows \[0, 1\] contradict each other",
    )


def test_more_rows_than_coordinates():
    refused(
        constrained(lambda q, t: [q[0] - q[1], q[0] - t, q[1] - t], n=2),
        match="at most 2 constraints on 2 coordinates, found 3",
    )


def test_rows_that_depend_on_each_other_at_one_time_pass():
    """The first one looked at, a quarter on the way, where both gradients are the same."""
    system = constrained(lambda q, t: [q[0] - q[1], q[0] - q[1] + (t - 0.25) * (q[2] - t)])
    problem = Problem(system, *line(3))
    tr = Transcription(problem, Mesh.uniform(0.0, 1.0, 4, 4), problem.lengths)
    assert tr.mesh.nodes[4] == 0.25
    check(tr, tr.straight())


def test_as_many_rows_as_coordinates_leave_one_path():
    system = constrained(lambda q, t: [q[0] - np.sin(t), q[1] - t**2], n=2)
    events = [Event(t, [np.sin(t), t**2]) for t in (0.0, 1.0)]
    solution = ao.solve(Problem(system, *events), tol=1e-10)
    t = np.linspace(0, 1, 7)
    assert np.max(np.abs(solution(t) - [np.sin(t), t**2])) <= 1e-10


def test_a_closed_four_bar_loop_is_redundant_by_one_row():
    # Pivots at (0, 0) and (2, 0), cranks of length 1 and a coupler of length 2: a parallelogram,
    # whose coupler stays horizontal by itself.
    def loop(q, t):
        x, y, z, w = q
        cranks = [x**2 + y**2 - 1, (z - 2) ** 2 + w**2 - 1]
        return [*cranks, (z - x) ** 2 + (w - y) ** 2 - 4, w - y]

    def at(angle):
        x, y = np.sin(angle), -np.cos(angle)
        return [x, y, x + 2, y]

    ends = Event(0, at(0.1)), Event(1, at(0.9))
    refused(constrained(loop, 4), *ends, match=r"rows \[0, 1, 2, 3\] say the same thing")
    problem = Problem(constrained(lambda q, t: loop(q, t)[:3], 4), *ends)
    solution = ao.solve(problem)
    angle = 0.1 + 0.8 * np.linspace(0, 1, 9)  # no gravity: the angle grows uniformly
    assert np.max(np.abs(solution(np.linspace(0, 1, 9)) - at(angle))) <= 1e-7


# -- values that are not finite --------------------------------------------------------------------


def test_a_singularity_all_along_the_straight_line():
    system = System(lambda q, v, t: kinetic(v) + np.log(q[1]) * v[0] ** 2, ["x", "y"])
    refused(
        system,
        Event(0, [0, -1]),
        Event(1, [1, -2]),
        match="finite along the first path, found NaN or infinity at .*give a guess",
    )


@pytest.mark.parametrize(
    "potential", [lambda q, t: np.log(q[0]), lambda q, t: np.log(t - 5), lambda q, t: np.inf]
)
def test_a_lagrangian_without_values(potential):
    """Its derivatives may be finite: the equations of motion would have a solution."""
    system = System(lambda q, v, t: v[0] ** 2 / 2 - potential(q, t), ["x"])
    refused(system, Event(0, [-1]), Event(1, [-2]), match="finite along the first path")


def test_an_action_that_is_not_finite_is_none():
    system = System(lambda q, v, t: v[0] ** 2 / 2 + q[0] / (t - 0.5), ["x"])
    solution = ao.solve(Problem(system, Event(0, [1]), Event(1, [2])), throw=False)
    assert not solution.success and solution.action == solution.error == np.inf


def slide(q, v, x):
    return np.sqrt((1 + v[0] ** 2) / q[0])


def orbit(q, v, t):
    return (v[0] ** 2 + (q[0] * v[1]) ** 2) / 2 + 1 / q[0]


SINGULAR_EVENTS = {
    "rest": (slide, ["depth"], [0.0], [0.65], "start event, .* L is not, where depth = 0,"),
    "rest at the end": (slide, ["depth"], [0.3], [0.0], "end event, .* where depth = 0,"),
    "centre": (orbit, ["r", "phi"], [0.0, 0.0], [1.0, 1.0], "start event, .* where r = 0,"),
    "centre of a plane": (
        lambda q, v, t: v @ v / 2 + 1 / np.sqrt(q @ q),
        ["x", "y"],
        [1.0, 1.0],
        [0.0, 0.0],
        "end event, .* where x = 0 and y = 0,",
    ),
    "force": (
        lambda q, v, t: v[0] ** 2 / 2 + np.sqrt(q[0]),
        ["x"],
        [0.0],
        [1.0],
        "start event, .* dL/dq is not, where x = 0,",
    ),
    "time": (
        lambda q, v, t: v[0] ** 2 / 2 + q[0] / t,
        ["x"],
        [1.0],
        [2.0],
        "start event, .* where t = 0,",
    ),
}


@at_once("guessed", [False, True])
@at_once("name", SINGULAR_EVENTS)
def test_an_event_where_l_is_infinite_is_named(name, guessed):
    lagrangian, names, first, last, match = SINGULAR_EVENTS[name]
    guess = np.array([first, np.add(first, last) / 2 + 0.1, last]).T if guessed else None
    problem = Problem(System(lagrangian, names), Event(0, first), Event(1, last))
    with pytest.raises(ValueError, match=match):
        ao.solve(problem, guess=guess)


def test_a_lagrangian_that_is_finite_for_slow_motions_only_is_no_singular_event():
    system = System(lambda q, v, t: -np.sqrt(1 - v[0] ** 2) - q[0] ** 2 / 2, ["x"])
    solution = ao.solve(Problem(system, Event(0, [0.0]), Event(2, [1.9])), throw=False)
    assert solution.success and solution.compare().agrees
    assert np.max(np.abs(solution.velocity(np.linspace(0, 2, 50)))) < 1


# -- arguments of solve ---------------------------------------------------------------------------


PLANE = System(lambda q, v, t: kinetic(v), ["x", "y"])
DRAG = System(lambda q, v, t: kinetic(v), ["x", "y"], force=lambda q, v, t: [-v[0], -v[1]])

ARGUMENTS = {
    "tol too small": (dict(tol=1e-15), "tol between 1e-14 .* and 0.1, found 1e-15"),
    "tol too large": (dict(tol=0.5), "tol between"),
    "tol zero": (dict(tol=0), "tol between"),
    "tol negative": (dict(tol=-1e-8), "tol between"),
    "tol NaN": (dict(tol=np.nan), "tol between"),
    "tol of text": (dict(tol="1e-8"), "number for tol between .*, found '1e-8'"),
    "no tol": (dict(tol=None), "number for tol"),
    "a list of tol": (dict(tol=[1e-8]), "number for tol"),
    "a tol for each coordinate": (dict(tol=np.array([1e-8, 1e-8])), "number for tol"),
    "a complex tol": (dict(tol=1e-8 + 0j), "number for tol"),
    "unknown principle": (
        dict(principle="lest"),
        "principle 'auto', 'least' or 'stationary', found 'lest'",
    ),
    "no mesh": (dict(mesh=40), r"expected a Mesh\(boundaries, degrees\), found 40"),
    "mesh of other times": (dict(mesh=Mesh.uniform(0, 2, 3, 4)), "expected a mesh from 0.0 to 1.0"),
    "waypoints of too many rows": (
        dict(guess=np.zeros((3, 5))),
        r"waypoints of shape \(2, K\) with K >= 2, found \(3, 5\)",
    ),
    "one waypoint": (dict(guess=np.zeros((2, 1))), "waypoints of shape"),
    "NaN waypoints": (dict(guess=[[0, np.nan, 1], [0, 1, 1]]), "finite waypoints"),
    "complex waypoints": (dict(guess=[[0, 1j], [0, 1]]), "array of numbers for the guess"),
    "a mapping": (dict(guess={"x": [0, 1]}), "numbers for the guess, a callable or waypoints"),
    "waypoints of different number": (dict(guess=[[0, 1, 2], [0, 1]]), "numbers for the guess"),
    "a complex callable": (dict(guess=lambda t: np.stack([t, 1j * t])), "numbers for the guess"),
    "a callable of text": (dict(guess=lambda t: "up"), "numbers for the guess at times t"),
    "a callable of nothing": (dict(guess=lambda t: None), "one column a node|numbers|shape"),
    "a callable of another shape": (
        dict(guess=lambda t: np.stack([t, t, t])),
        r"guess to return \(2, K\)",
    ),
    "a callable of one value": (dict(guess=lambda t: 1.0), "shape"),
    "a callable of NaN": (dict(guess=lambda t: np.stack([t, t / 0 * 0])), "finite"),
    "a path of another system": (
        dict(guess=ao.Path(Mesh.uniform(0, 1, 1, 1), [[0.0, 1.0]])),
        "guess of 2 coordinates, found 1",
    ),
}


@pytest.mark.filterwarnings("ignore:(invalid|divide)")
@pytest.mark.parametrize("case", ARGUMENTS)
def test_bad_arguments_say_what_was_expected(case):
    options, match = ARGUMENTS[case]
    refused(PLANE, match=match, **options)


def test_no_problem_is_no_problem():
    with pytest.raises(ValueError, match=r"expected a Problem\(system, start, end\), found"):
        ao.solve(PLANE)


def test_forces_have_no_least_principle():
    refused(DRAG, principle="least", match="virtual work, and no functional is minimised")


# -- projection -----------------------------------------------------------------------------------


def test_points_without_a_nearest_one_stay_finite():
    system = System(
        lambda q, v, t: kinetic(v), ["x", "y"], constraint=lambda q, t: q[0] ** 2 + q[1] ** 2 - 1
    )
    problem = Problem(system, Event(0, [1, 0]), Event(1, [-1, 0]))  # straight through the centre
    tr = Transcription(problem, Mesh.uniform(0, 1, 2, 4), np.ones(2))
    assert np.all(np.isfinite(project(tr, tr.straight())))


def test_the_event_that_gives_a_coordinate_is_the_one_that_is_named():
    system = System(lambda q, v, t: v[0] ** 2 / 2 - 1 / q[0], ["x"])
    with pytest.raises(ValueError, match=r"at the end event, .* where x = 0"):
        ao.solve(Problem(system, Event(0, [None]), Event(1, [0.0])))


@pytest.mark.parametrize(
    ("force", "where"),
    [
        (lambda q, v, t: [1 / q[0]], "start event, .* the force is not, where x = 0,"),
        (lambda q, v, t: [1 / (q[0] - 1)], "end event, .* the force is not, where x = 1,"),
        (lambda q, v, t: [-q[0] / t], "start event, .* the force is not, where t = 0,"),
    ],
)
def test_an_event_where_a_force_is_infinite_is_named(force, where):
    refused(systems.particle(force=force), match=where)


@pytest.mark.long
def test_derivatives_that_overflow_where_the_lagrangian_does_not():
    """That of 1 / cosh is sinh / cosh^2; written with exp(-|x|), it is solved: a wall to cross."""
    ends, width, height = (Event(0.0, [-1.0]), Event(1.0, [1.0])), 1e-3, 0.05
    wall = System(lambda q, v, t: kinetic(v) - height / np.cosh(q[0] / width), ["x"])
    with pytest.raises(
        ValueError, match=r"at the start event, .* dL/dq is not at and near .* cosh"
    ):
        ao.solve(Problem(wall, *ends))

    def flat(q, v, t):
        e = np.exp(-abs(q[0] / width))
        return kinetic(v) - 2 * height * e / (1 + e**2)

    solution = ao.solve(Problem(System(flat, ["x"]), *ends), tol=1e-6)
    # 2 = v T + int (1 / sqrt(v^2 - 2 V) - 1 / v) v dx, the width of the wall beside it
    assert solution.start.v[0] == pytest.approx(2.0, abs=1e-3)
    inside = solution.velocity(0.5)[0]
    assert inside**2 / 2 + height == pytest.approx(solution.start.v[0] ** 2 / 2, abs=1e-3)
    corners = System(
        lambda q, v, t: kinetic(v) - np.sqrt(q[0] ** 2) - np.sqrt(q[1] ** 2), ["x", "y"]
    )
    assert ao.solve(Problem(corners, *line(2)), throw=False).status.stationary


def test_coordinates_with_which_an_event_keeps_no_constraint_are_named():
    circle = ao.System(lambda q, v, t: v @ v / 2, ["x", "y"], constraint=lambda q, t: q @ q - 1)
    ends = ao.Event(0, [2, None]), ao.Event(1, [None, 0.9])
    (said,) = _events_off_constraints(ao.Problem(circle, *ends))
    assert said.startswith("no y was found with which the start event keeps the constraints")
