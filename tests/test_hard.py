"""Problems that are hard in one way each, the questions of the stress study: known values."""

from functools import partial

import numpy as np
import pytest
from helpers import applies, relative_error

import actionopt as ao
from actionopt import Event, Problem, Status, System
from benchmarks.stress.families import bodies, conjugate, kink, layers, pendulums, turning
from benchmarks.stress.forward import miss

TOL = 1e-9
QUESTIONS = {
    "figure-eight without a guess": bodies.figure_eight,
    **{f"perihelion, e = {e}": partial(bodies.perihelion, e) for e in (0.95, 0.99)},
    **{f"P15, eps = {eps:g}": partial(turning.p15, eps) for eps in (1e-2, 3e-3, 1e-4)},
    **{f"P20, eps = {eps:g}": partial(turning.p20, eps) for eps in (0.5, 0.1, 0.06)},
    **{f"Bratu, {which}": partial(turning.bratu, which) for which in turning.BRATU},
    "thirty conjugate points": conjugate.far,
}
FACTS = {  # action and index, in extended precision
    "P15, eps = 0.01": (0.069176411961076670514, 2),
    "P15, eps = 0.003": (0.094245714089070988499, 4),
    "P20, eps = 0.5": (1.3781014771680450573, 0),
    "Bratu, lower": (-1.0465167047946651444, 0),
    "Bratu, upper": (16.440013090858122401, 1),
}


def error(solution, exact):
    """Largest error on and between the nodes."""
    nodes = solution.mesh.nodes
    return relative_error(solution, exact, np.concatenate([nodes, (nodes[1:] + nodes[:-1]) / 2]))


@pytest.mark.quick(
    "perihelion, e = 0.99",
    "P15, eps = 0.0001",
    "P20, eps = 0.06",
    "Bratu, upper",
    "thirty conjugate points",
)
@pytest.mark.parametrize("name", QUESTIONS)
def test_hard_paths_are_found_to_the_tolerance(name):
    question = QUESTIONS[name]()
    solution = ao.solve(question.problem, tol=question.tol, guess=question.guess)
    assert error(solution, question.exact) < question.tol
    assert solution.stats["unknowns"] < 1000
    if name in FACTS:
        action, index = FACTS[name]
        assert solution.action == pytest.approx(action, rel=1e-8)
        assert solution.morse_index == index
    assert name != "thirty conjugate points" or solution.morse_index == 30


@pytest.mark.long
@pytest.mark.parametrize(
    ("T", "count"), [(4.0, 4), *(pytest.param(T, 100, marks=pytest.mark.slow) for T in (1.0, 4.0))]
)
def test_random_double_pendulums_find_a_motion(T, count):
    for k, start in enumerate(pendulums.starts(count)):
        solution = ao.solve(pendulums.question(*start, T).problem)
        assert miss(solution) < pendulums.MOTION, k


def test_layers_cost_like_the_logarithm_of_their_width():
    widths, unknowns = (1e-2, 1e-4, 1e-6), []
    for eps in widths:
        question = layers.layer(eps)
        solution = ao.solve(question.problem, tol=TOL)
        assert error(solution, question.exact) < TOL
        unknowns.append(solution.stats["unknowns"])
    assert unknowns[-1] / unknowns[0] < np.log(widths[-1]) / np.log(widths[0])


def test_troesch():
    """The velocities at both ends, from the elliptic closed form."""
    solution = ao.solve(turning.troesch(20).problem, tol=TOL)
    found = solution.start.v[0], solution.end.v[0]
    assert found == pytest.approx(turning.TROESCH[20], rel=1e-6)


@pytest.mark.long
@pytest.mark.parametrize("eps", [0.02, pytest.param(0.01, marks=pytest.mark.slow)])
def test_inertias_that_differ_by_more_than_all_digits(eps):
    """They do by exp(74) and exp(149): the action tells nothing of the lightest part."""
    question = turning.p20(eps)
    solution = ao.solve(question.problem, tol=TOL)
    assert applies("continuation", question.problem)
    assert error(solution, question.exact) < TOL


def test_what_is_light_is_no_feature_that_was_missed():
    """Round-off of the heaviest momentum is no velocity of what is lightest."""
    question = turning.p20(0.02)
    solution = ao.solve(question.problem, tol=TOL, guess=question.exact)
    assert error(solution, question.exact) < TOL


@pytest.mark.slow
def test_a_wide_kink_is_placed():
    """Round-off, amplified a million times, is near the tolerance: the verdict may say so."""
    question = kink.kink(0.1)
    solution = ao.solve(question.problem, tol=TOL, throw=False)
    assert solution.status in (Status.SOLVED, Status.FLOOR)
    said = TOL if solution.status is Status.SOLVED else solution.error
    assert error(solution, question.exact) < said
    assert solution.error < 100 * TOL


@pytest.mark.slow
def test_a_narrow_kink_is_said_not_to_be():
    with pytest.raises(ao.SolveError, match=r"condition about|hardly determined") as caught:
        ao.solve(kink.kink(0.02).problem, tol=TOL)
    assert caught.value.solution.status in (Status.DWELLING, Status.DEGENERATE, Status.FLOOR)


# -- far from the straight line -------------------------------------------------------------------


def kinetic(x, y):
    return (-0.77 * x - 0.62 * y) ** 2 + (-1.23 * x + 1.53 * y) ** 2


def three_walls(x, y):
    return (
        0.87 * (0.86 * x - 0.8 * y + 0.19) ** 4 / 24
        - 0.24 * (0.39 * x + 0.13 * y - 1.64) ** 3 / 6
        + 3.37 * (-1.1 * x - 0.17 * y + 2.2) ** 4 / 24
        - 0.19 * (-0.73 * x + 1.38 * y + 2.9) ** 2 / 2
        + (-0.82 * x + 0.11 * y - 1.09) ** 4 / 24
    )


@pytest.mark.long
def test_a_motion_far_from_the_straight_line_is_found():
    """Walls send it to and fro, far from the line; the action is unbounded below."""
    system = System(lambda q, v, t: kinetic(*v) / 2 - three_walls(*q), ["x", "y"])
    solution = ao.solve(Problem(system, Event(0.0, [0.9, -1.17]), Event(8.83, [1.5, 4.7])))
    assert applies("meeting", solution.problem)
    assert solution.compare().agrees
    assert miss(solution) < pendulums.MOTION


@pytest.mark.long
def test_a_light_coordinate_does_not_make_a_feature_of_another():
    """The second coordinate's inertia varies by exp(16); both move apart but for a small bump."""
    law = ao.System(
        lambda q, v, t: (
            (v[0] ** 2 + np.exp(16 * q[1]) * v[1] ** 2) / 2
            - 0.05 * np.exp(-(((q[0] - 0.37) / 0.05) ** 2))
        ),
        ["x", "y"],
    )
    found = ao.solve(ao.Problem(law, ao.Event(0.0, [0.0, 0.0]), ao.Event(1.0, [1.0, 1.0])))
    # y alone: the path on which exp(8 y) grows evenly.
    assert found.action == pytest.approx(((np.exp(8) - 1) / 8) ** 2 / 2 + 0.5, rel=1e-6)
