"""Least between free ends and greatest in these: saddles beyond a quarter of an oscillation."""

import numpy as np
import pytest
import systems
from helpers import applies

import actionopt as ao
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.newton.newton import follow
from actionopt.solver.search.minimax import climb, free_ends

# x'' = -x^3 has x = A cn(A t), m = 1/2, with the quarter period K / A and cn(K / 2) as below.
K, HALF = 1.8540746773013719, (1 + 2**0.5) ** -0.5
QUARTIC = ao.System(lambda q, v, t: (v @ v) / 2 - (q @ (q * q * q)) / 4, ["x"])


def quartic(T):
    """Return the question which motion from x = 1 rests after T, its three quarters of K."""
    A = 1.5 * K / T
    return ao.Problem(QUARTIC, ao.Event(0.0, HALF * A), ao.Event(T, None)), -A


@pytest.mark.parametrize("T", [1.0, 1.3])
def test_a_free_end_beyond_the_first_focal_point(T):
    problem, end = quartic(T)
    found = ao.solve(problem, tol=1e-10)
    assert found.stats["rung"] == "minimax" and "continuation" not in found.stats["iterations"]
    assert found.end.q[0] == pytest.approx(end, rel=1e-9)
    assert found.morse_index == 1


def test_the_action_between_the_ends_is_greatest_there():
    """Two masses on stiffening springs: S falls to all sides of the free ends."""
    problem = ao.Problem(
        ao.System(systems_of_two, ["a", "b"]), ao.Event(0.0, [0.87, 0.87]), ao.Event(1.0, None)
    )
    found = ao.solve(problem)
    assert found.stats["rung"] == "minimax" and found.morse_index == 2
    for angle in np.linspace(0, 2 * np.pi, 5)[:-1]:
        aside = found.end.q + 0.05 * np.array([np.cos(angle), np.sin(angle)])
        given = ao.solve(problem.replace(end=ao.Event(1.0, aside)), guess=found.path)
        assert given.morse_index == 0 and given.action < found.action


def systems_of_two(q, v, t):
    d = q[0], q[1] - q[0], q[1]
    return (v @ v) / 2 - sum(x**2 / 2 + x**4 / 4 for x in d)


def test_nothing_is_climbed_where_the_path_between_the_ends_is_not_least():
    problem, _ = quartic(1.0)
    for T, reached in ((1.0, True), (4.0, False)):
        asked = problem.replace(end=ao.Event(T, None))
        tr = Transcription(asked, Mesh.uniform(0.0, T, 4, 8), asked.lengths)
        assert free_ends(tr).tolist() == [tr.layout.unknowns - 1]
        z, count = climb(tr, tr.pack(tr.straight()))
        assert (z is not None) == reached and (reached or count == 1)
        if z is not None:
            assert follow(tr, z).travelled <= 1e-2


@pytest.mark.parametrize(("tol", "degree"), [(1e-6, 10), (1e-12, 6)])
def test_it_is_climbed_on_a_mesh_that_may_resolve_the_path_while_matrices_are_small(tol, degree):
    problem = ao.Problem(
        ao.System(systems_of_two, ["a", "b"]), ao.Event(0.0, [0.87, 0.87]), ao.Event(1.0, None)
    )
    found = ao.solve(problem, tol=tol)
    first, end = found.stats["rounds"][0], ao.solve(problem, tol=1e-8).end.q
    assert first["elements"] == 4 and first["unknowns"] == 2 * 4 * degree
    np.testing.assert_allclose(found.end.q, end, atol=1e-6)


def test_where_it_is_climbed():
    pendulum = systems.pendulum(g=9.81)
    start, end = ao.Event(0.0, 0.3), ao.Event(1.0, 0.5)
    assert applies("minimax", ao.Problem(pendulum, start, ao.Event(1.0, None)))
    assert applies("minimax", ao.Problem(pendulum, ao.Event(0.0, None), end))
    assert not applies("minimax", ao.Problem(pendulum, start, end))
