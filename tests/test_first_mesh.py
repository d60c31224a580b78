"""The first mesh of linear equations, against their closed forms."""

import numpy as np
import pytest
import systems
from helpers import at_once

import actionopt as ao
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.meshes.resolution import DEGREES
from actionopt.solver.refinement.first_mesh import PHASE_PER_ELEMENT, plan_layers, plan_mesh


def linear(square, T=1.0, start=0.0):
    """Return x'' = square x between 1 and 0.3."""
    system = ao.System(lambda q, v, t: v[0] ** 2 / 2 + square * q[0] ** 2 / 2, ["x"])
    return ao.Problem(system, ao.Event(start, [1.0]), ao.Event(start + T, [0.3]))


def first_mesh(problem):
    mesh = Mesh.uniform(problem.start.t, problem.end.t, 4, 12)
    tr = Transcription(problem, mesh, problem.scales)
    return plan_layers(tr, tr.pack(tr.straight()))


def rounds(tol):
    """Return how many meshes a tolerance may take: below 1e-11 round-off may ask for another."""
    return 1 if tol > 1e-11 else 2


@pytest.mark.parametrize("square", [-9.0, 0.0, 9.0])
def test_four_elements_show_slow_motions(square):
    assert first_mesh(linear(square)) is None


@pytest.mark.parametrize("turns", [11.0, 37.0, 150.0])
def test_turns_are_shared_out_evenly(turns):
    mesh = first_mesh(linear(-(turns**2)))
    assert np.ptp(mesh.lengths) <= 1e-12
    assert turns * mesh.lengths[0] <= PHASE_PER_ELEMENT < turns / (mesh.elements - 1)


@at_once("start", [0.0, -3.0, 1e4])
@at_once("folds", [20.0, 1e3, 1e6])
def test_layers_are_shown_at_both_ends(folds, start):
    mesh = first_mesh(linear(folds**2, start=start))
    assert mesh.boundaries[0] == start and mesh.boundaries[-1] == start + 1.0
    ends = folds * mesh.lengths[[0, -1]]
    assert ends == pytest.approx(PHASE_PER_ELEMENT, rel=1e-2)  # 1e4 costs digits
    assert np.allclose(mesh.lengths, mesh.lengths[::-1], rtol=1e-2)
    assert mesh.elements <= 18


def test_layers_thinner_than_the_times_can_say_are_left():
    assert first_mesh(linear(1e28, start=1e4)) is None


def test_the_highest_degree_is_planned_where_none_is_high_enough():
    assert set(plan_mesh(linear(-9.0), 1e-40, 4).degrees) == {DEGREES.max()}


def test_rates_are_those_of_the_units():
    """Twice the time at half the rate, or another unit of length and mass: the same mesh."""
    system = ao.System(
        lambda q, v, t: 3.0 * (v[0] ** 2 - 25.0 * q[0] ** 2 + v[1] ** 2 - 1e3 * q[1] ** 2),
        ["x", "y"],
    )
    problem = ao.Problem(system, ao.Event(0.0, [1e-5, 1e5]), ao.Event(2.0, [0.0, 2e5]))
    assert first_mesh(problem).elements == first_mesh(linear(-4e3)).elements


@at_once("tol", [1e-6, 1e-9, 1e-12])
@at_once("folds", [20.0, 100.0, 1e3, 1e6])
def test_layers_are_solved_on_the_first_mesh(folds, tol):
    solution = ao.solve(linear(folds**2), tol=tol)
    near = np.linspace(0.0, min(1.0, 20.0 / folds), 201)
    t = np.concatenate([near, 1.0 - near])
    gone = np.exp(-2 * folds)
    left = np.exp(-folds * t) - np.exp(-folds * (2 - t))
    right = np.exp(-folds * (1 - t)) - np.exp(-folds * (1 + t))
    exact = (left + 0.3 * right) / (1 - gone)
    assert np.max(np.abs(solution(t)[0] - exact)) <= tol
    assert len(solution.stats["rounds"]) <= rounds(tol)


@at_once("tol", [1e-3, 1e-6, 1e-9, 1e-12])
@at_once("square", [0.0, -1.0, -16.0, 4.0])
def test_equations_with_constant_rates_are_solved_on_the_first_mesh(square, tol):
    T, w = 2.3, np.sqrt(abs(square))
    solution = ao.solve(linear(square, T), tol=tol)
    t = np.linspace(0.0, T, 301)
    if square == 0:
        exact = 1.0 - 0.7 * t / T
    elif square < 0:
        exact = (np.sin(w * (T - t)) + 0.3 * np.sin(w * t)) / np.sin(w * T)
    else:
        exact = (np.sinh(w * (T - t)) + 0.3 * np.sinh(w * t)) / np.sinh(w * T)
    assert np.max(np.abs(solution(t)[0] - exact)) <= tol * np.max(np.abs(exact))
    assert len(solution.stats["rounds"]) <= rounds(tol)
    assert max(solution.mesh.degrees) <= (4 if square == 0 else 17)


@pytest.mark.parametrize("friction", [1.0, 30.0, 1e4])
def test_friction_leaves_a_layer(friction):
    system = systems.particle(force=lambda q, v, t: [-friction * v[0]])
    solution = ao.solve(ao.Problem(system, ao.Event(0.0, [0.0]), ao.Event(1.0, [1.0])), tol=1e-9)
    t = np.linspace(0.0, min(1.0, 30 / friction), 301)
    exact = np.expm1(-friction * t) / np.expm1(-friction)
    assert np.max(np.abs(solution(t)[0] - exact)) <= 1e-9
    assert len(solution.stats["rounds"]) == 1
