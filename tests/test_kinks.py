"""Paths that cross kinks of L in q, against motions in closed form."""

import numpy as np
import pytest

import actionopt as ao

WEDGE = ao.System(
    lambda q, v, t, *, slope: v[0] ** 2 / 2 - slope * abs(q[0]), ["x"], parameters={"slope": 2.0}
)


@pytest.mark.long
def test_a_path_that_is_lost_at_a_kink_crosses_it_as_an_event():
    """From 1 to -1 in T = 3 / sqrt(2) on slopes of 2: v0 = +-1/2 sqrt(2), met from either side."""
    asked = ao.Problem(WEDGE, ao.Event(0.0, [1.0]), ao.Event(3 / np.sqrt(2), [-1.0]))
    found = ao.solve(asked, tol=1e-8)
    assert abs(float(found.start.v[0])) == pytest.approx(np.sqrt(0.5), abs=1e-8)
    (crossed,) = found.problem.through
    assert crossed.t is not None and abs(float(found(crossed.t)[0])) < 1e-9
    assert found.morse_index == 0


@pytest.mark.long
@pytest.mark.parametrize("points", [25, pytest.param(201, marks=pytest.mark.slow)])
def test_a_path_through_a_table_is_one_of_several_laws(points):
    """The force is constant between its points: motions from one to the next in closed form."""
    x = np.linspace(-2.0, 2.0, points)
    V = -np.cos(x)
    table = ao.System(lambda q, v, t: v[0] ** 2 / 2 - np.interp(q[0], x, V), ["x"])
    found = ao.solve(ao.Problem(table, ao.Event(0.0, [-1.02]), ao.Event(2.5, [1.31])), tol=1e-8)
    energy = float(found.start.v[0]) ** 2 / 2 + np.interp(-1.02, x, V)
    edges = np.r_[-1.02, x[(x > -1.02) & (x < 1.31)], 1.31]
    speeds = np.sqrt(2 * (energy - np.interp(edges, x, V)))
    assert np.sum(2 * np.diff(edges) / (speeds[1:] + speeds[:-1])) == pytest.approx(2.5, abs=1e-7)
    assert len(found.problem.through) == edges.size - 2


def test_a_jump_is_not_crossed_as_a_kink():
    step = ao.System(lambda q, v, t: v[0] ** 2 / 2 - np.where(q[0] > 0, 0.3, 0) - abs(q[0]), ["x"])
    asked = ao.Problem(step, ao.Event(0.0, [1.0]), ao.Event(3.0, [-1.0]))
    assert ao.solve(asked, throw=False).status is ao.Status.JUMP


@pytest.mark.long
def test_a_mesh_that_is_given_holds_for_tables_too():
    x = np.linspace(-2, 2, 25)
    table = ao.System(lambda q, v, t: v[0] ** 2 / 2 - np.interp(q[0], x, -np.cos(x)), ["x"])
    ends = ao.Event(0.0, [-1.02]), ao.Event(2.5, [1.31])
    found = ao.solve(ao.Problem(table, *ends), mesh=ao.Mesh.uniform(0, 2.5, 10, 6), throw=False)
    assert (found.mesh.elements, found.problem.through) == (10, ())
