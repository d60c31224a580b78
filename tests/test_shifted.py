"""A neighbour's path taken ahead in time: fast passages keep their form."""

import numpy as np
import pytest
import systems
from helpers import a_quarter, motion

import actionopt as ao
from actionopt.discrete.action.shifted import shift_path
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.meshes.mesh import Mesh

KEPLER = ao.System(
    lambda q, v, t: (v[0] ** 2 + v[1] ** 2) / 2 + 1 / np.sqrt(q[0] ** 2 + q[1] ** 2), ["x", "y"]
)
FREE = systems.particle("x y")


def step(t):
    """A quick way between two places at t = 1, (2, K)."""
    return np.array([np.tanh(9 * (t - 1.0)), 3 * np.tanh(9 * (t - 1.0)) ** 2])


@pytest.mark.parametrize("units", [[1.0, 1.0], [0.2, 5.0]])
def test_a_displacement_along_a_fast_passage_is_a_shift_of_time(units):
    mesh = Mesh([0.0, 0.5, 0.85, 0.95, 1.05, 1.15, 1.5, 2.0], [6, 6, 8, 6, 8, 6, 6])
    Q = step(mesh.nodes).T
    problem = ao.Problem(FREE, ao.Event(0.0, Q[0]), ao.Event(2.0, Q[-1]))
    tr = Transcription(problem, mesh, np.array(units))
    tau, z = 0.04, tr.pack(Q)
    v = np.empty_like(Q)
    v[tr.layout.node_of] = tr.place(z).v
    moved = shift_path(tr, z, Q - tau * v)
    assert moved is not None
    found, values = moved
    inside = slice(2, -2)
    assert found.since[inside] - mesh.since[inside] == pytest.approx(tau, rel=0.05)
    assert (found.since[[0, -1]] == mesh.since[[0, -1]]).all()
    middle = (found.nodes > 0.9) & (found.nodes < 1.18)
    assert pytest.approx(step(found.nodes[middle] - tau), abs=0.01) == values[middle].T
    away = Q - tau * v - step(mesh.nodes - tau).T  # what it is without
    assert np.abs(away).max() > 0.1
    assert shift_path(tr, z, Q - 10 * tau * v) is None


@pytest.mark.parametrize("tol", a_quarter([1e-9, 1e-3]))
def test_the_next_passage_of_a_pericentre_takes_newton_steps_alone(tol):
    """At eccentricity 0.9, by the motion itself; the path is not asked for where it was.

    From the path as it was, Newton's method fails, and so do Marquardt's and a homotopy.
    """
    run = motion(KEPLER, [1.9, 0.0], [0.0, np.sqrt(0.1 / 1.9)], 0.0, 6.5)

    def between(start):
        return ao.Problem(KEPLER, ao.Event(0.0, run(start)), ao.Event(5.0, run(start + 5.0)))

    def guess(start):
        return lambda t: run(start + t)

    first = ao.solve(between(0.9), tol=tol, guess=guess(0.9))
    other = ao.solve(between(0.92), tol=tol, guess=first)
    assert set(other.stats["iterations"]) == {"newton"}
    assert not np.array_equal(other.mesh.since, first.mesh.since)
    t = np.linspace(0.0, 5.0, 301)
    assert np.abs(other(t) - run(0.92 + t)).max() < 2 * tol
