"""Paths moved onto surfaces for which the nearest point is a formula."""

import numpy as np
import pytest
import systems

import actionopt as ao
from actionopt.discrete.action.projection import project, project_on
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.mechanics.question.problem import Event, Problem

CLOSE = 1e-9  # of the surface; a step below 1e-8 is the last
NORMAL, LENGTHS = np.array([1.0, 2.0]), np.array([0.5, 3.0])


def on(constraint, start, end, lengths=LENGTHS):
    system = systems.particle("x y", constraint=constraint)
    problem = Problem(system, Event(0.0, start), Event(1.0, end))
    return Transcription(problem, Mesh.uniform(0.0, 1.0, 2, 3), lengths)


def path(tr, seed=0):
    return np.random.default_rng(seed).uniform(-1, 1, (tr.layout.node_count, 2))


@pytest.mark.parametrize("rate", [0.0, 0.7])
def test_a_line_is_reached_the_shortest_way_in_units_of_the_sizes(rate):
    tr = on(lambda q, t: [NORMAL @ q - 1 - rate * t], [None, None], [None, None])
    Q, t = path(tr), tr.mesh.nodes
    way = LENGTHS**2 * NORMAL / (NORMAL @ (LENGTHS**2 * NORMAL))
    known = Q - np.outer(Q @ NORMAL - 1 - rate * t, way)
    assert np.max(np.abs(project(tr, Q) - known)) <= CLOSE


def test_a_circle_is_reached_along_its_radii():
    tr = on(lambda q, t: [q @ q - 1], [None, None], [None, None], np.ones(2))
    Q = path(tr)
    known = Q / np.linalg.norm(Q, axis=1, keepdims=True)
    assert np.max(np.abs(project(tr, Q) - known)) <= CLOSE
    Q[2] = 0.0  # its centre: no way is shorter than another
    known[2] = 0.0
    assert np.max(np.abs(project(tr, Q) - known)) <= CLOSE


def test_what_is_given_stays():
    tr = on(lambda q, t: [NORMAL @ q - 1], [-1.0, 1.0], [0.4, None])
    Q = path(tr)
    Q[0], Q[-1, 0] = [-1.0, 1.0], 0.4
    moved = project(tr, Q)
    assert np.array_equal(moved[0], [-1.0, 1.0])
    assert moved[-1] == pytest.approx([0.4, 0.3], abs=CLOSE)


def test_without_constraints_nothing_moves():
    tr = on(None, [0.0, 0.0], [1.0, 1.0])
    Q = path(tr)
    assert project(tr, Q) is Q


def test_a_node_where_the_surface_is_not_defined_stays():
    tr = on(lambda q, t: [np.log(q[0])], [None, None], [None, None])
    Q = path(tr)
    Q[:, 0] = np.linspace(-0.5, 1.2, len(Q))
    known = np.where(Q[:, 0] > 0, 1.0, Q[:, 0])
    assert np.max(np.abs(project(tr, Q)[:, 0] - known)) <= CLOSE


def four_bar(first, last):
    """Return a crank of length 1, which turns round, a coupler of 2 and a rocker of 1.5, 2 apart.

    Given is the crank alone; for each of its angles there are two of the others, and no motion
    leads from one to the other.
    """

    def closed(q, t):
        a, b, c = q
        x = np.cos(a) + 2 * np.cos(b) - 2 - 1.5 * np.cos(c)
        return [x, np.sin(a) + 2 * np.sin(b) - 1.5 * np.sin(c)]

    system = systems.particle("a b c", constraint=closed)
    ends = Event(0.0, [first, None, None]), Event(1.0, [last, None, None])
    return Problem(system, *ends), lambda Q: np.array(closed(Q, 0.0))


def test_nodes_of_a_mechanism_hang_together():
    problem, closed = four_bar(0.5, 2.0)
    tr = Transcription(problem, Mesh.uniform(0.0, 1.0, 4, 6), np.full(3, 2.0))
    alone, beside = project(tr, tr.straight()), project_on(tr, tr.straight())
    assert np.max(np.abs(closed(beside.T))) <= CLOSE
    assert beside[[0, -1], 0].tolist() == [0.5, 2.0]
    assert np.max(np.abs(np.diff(alone, axis=0))) > 2.0  # from one of two to the other
    assert np.max(np.abs(np.diff(beside, axis=0))) < 0.3


@pytest.mark.long
@pytest.mark.parametrize(("first", "last"), [(0.5, 2.0), (2.66, 0.07), (2.06, -2.49)])
def test_a_mechanism_of_which_the_crank_is_given_moves(first, last):
    problem, closed = four_bar(first, last)
    Q = ao.solve(problem, tol=1e-8).path.values
    assert np.max(np.abs(closed(Q))) < 1e-7
    side = np.sin(Q[1] - Q[2])  # of the coupler to the rocker: it would vanish on the way
    assert np.all(side * side[0] > 0)


@pytest.mark.long
def test_constraints_choose_what_an_event_leaves_open_where_no_step_leads_to_it():
    """From the middle of a circle, x given, y may be of either sign: the straight line has none."""
    circle = ao.System(lambda q, v, a, t: a @ a / 2, ["x", "y"], constraint=lambda q, t: q @ q - 1)
    start = ao.Event(0, [1, 0], v=[0, 0])
    y = np.sqrt(0.75)
    one, both = (
        ao.solve(ao.Problem(circle, start, ao.Event(1, q))) for q in ([0.5, None], [0.5, y])
    )
    assert abs(one(1.0)[1]) == pytest.approx(y)
    assert one.action == pytest.approx(both.action, rel=1e-7)
