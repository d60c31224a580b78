"""Refinement to a tolerance, and what is said where it cannot be met."""

import numpy as np
import pytest
import systems
from helpers import a_quarter
from scipy.optimize import brentq

import actionopt as ao
from actionopt import Event, Mesh, Problem, Status, scenes
from actionopt.solver.refinement.refine import _finer, refine, solve_on
from actionopt.solver.refinement.workspace import Workspace


def found(problem, elements=4, degree=6):
    """Return a ws at the path found from the straight line on a coarse mesh."""
    ws = Workspace(problem, linear=problem.system.structure.linear)
    ws.transcribe(Mesh.uniform(problem.start.t, problem.end.t, elements, degree), None)
    assert ws.follow() or ws.approach()
    return ws


@pytest.mark.parametrize("tol", [1e-4, 1e-8, 1e-12])
def test_the_tolerance_is_met(tol):
    scene = scenes.get("pendulum")
    ws = found(scene.problem)
    assert refine(ws, tol, least=False) is Status.SOLVED
    t = np.linspace(0.0, 1.0, 101)
    assert np.max(np.abs(ws.here.path(t) - scene.exact(t))) <= tol
    assert ws.here.error <= tol


def test_nothing_is_refined_that_is_good_enough():
    ws = found(scenes.get("projectile").problem)  # a parabola is a polynomial of degree 2
    assert refine(ws, 1e-12, least=False) is Status.SOLVED
    assert len(ws.record.rounds) == 1


def test_ends_that_are_conjugate_are_told():
    oscillator = systems.oscillator()
    ws = found(Problem(oscillator, Event(0.0, [1.0]), Event(3 * np.pi, [-1.0])))
    assert refine(ws, 1e-8, least=False) is Status.DEGENERATE


@pytest.mark.long
@pytest.mark.parametrize("amplitude", [1e-6, 1e-8])
def test_a_small_motion_far_from_zero_between_conjugate_ends(amplitude):
    """Half a period about q = 5: what round-off is amplified to is little beside 5."""
    system = ao.System(lambda q, v, t: v[0] ** 2 / 2 - 9 * (q[0] - 5) ** 2 / 2, ["q"])
    start, end = ao.Event(0.0, [5 + amplitude]), ao.Event(np.pi / 3, [5 - amplitude])
    found = ao.solve(ao.Problem(system, start, end), throw=False)
    assert found.status is ao.Status.DEGENERATE and found.kind == "degenerate"
    end = ao.Event(1.0, [5 - amplitude])
    found = ao.solve(ao.Problem(system, start, end))
    assert found.kind == "minimum"
    t = np.linspace(0.0, 1.0, 11)
    known = 5 + amplitude * np.sin(1.5 - 3 * t) / np.sin(1.5)
    assert found(t)[0] == pytest.approx(known, abs=1e-9 * amplitude + 1e-14)


@pytest.mark.long
def test_no_small_error_is_told_of_what_is_not_resolved():
    """q'' = |t - c|^(-1/2): the sums of the force hold at last, whatever they leave out."""
    system = ao.System(lambda q, v, t: v[0] ** 2 / 2 + q[0] / np.sqrt(abs(t - 0.4321)), ["q"])
    problem = ao.Problem(system, ao.Event(0.0, [0.0]), ao.Event(1.0, [1.0]))
    t = np.linspace(0.0, 1.0, 101)
    own, ends = (4 / 3 * np.abs(x - 0.4321) ** 1.5 for x in (t, np.array([0.0, 1.0])))
    known = own - ends[0] * (1 - t) + (1 - ends[1]) * t
    found = ao.solve(problem, tol=1e-8, throw=False)
    assert found.success == (found.error <= 1e-8)
    assert np.abs(found(t)[0] - known).max() <= found.error


@pytest.mark.long
@pytest.mark.parametrize("c", a_quarter([0.45, 0.25]))
def test_a_pole_of_the_force_in_time_leaves_no_family_of_paths(c):
    """A free body that is pushed has one path between any ends, however the push is rounded."""
    pushed = systems.particle(force=lambda q, v, t: abs(t - c) ** -0.7)
    problem = Problem(pushed, Event(0.0, [0.0]), Event(1.0, [1.0]))
    assert ao.solve(problem, tol=1e-6, throw=False).status is Status.UNRESOLVED


@pytest.mark.long
def test_a_tolerance_below_amplified_rounding_is_told_at_once():
    """Swings that end a hair beyond the conjugate time: no mesh makes up for rounding."""
    pendulum = systems.pendulum()
    late = 1e-5
    end = 1e-3 * (0.3 * late - 1)
    problem = Problem(pendulum, Event(0.0, [1e-3]), Event(np.pi + late, [end]))
    for tol in (1e-13, 1e-14):
        solution = ao.solve(problem, tol=tol, throw=False)
        assert solution.status is Status.FLOOR
        assert len(solution.stats["rounds"]) <= 4


def test_on_a_mesh_given_the_estimate_comes_from_a_finer_one():
    scene = scenes.get("pendulum")
    mesh = Mesh.uniform(0.0, 1.0, 3, 5)
    ws = found(scene.problem)
    assert solve_on(ws, mesh, least=False) is Status.ON_MESH
    assert ws.here.tr.mesh is mesh
    t = np.linspace(0.0, 1.0, 101)
    error = np.max(np.abs(ws.here.path(t) - scene.exact(t))) / np.max(np.abs(scene.exact(t)))
    assert error / 3 < ws.here.error < 10 * error


def test_a_finer_mesh_has_more_degrees_or_halves_where_there_are_no_more():
    finer = _finer(Mesh([0.0, 1.0, 3.0, 4.0], [4, 63, 62]))
    assert finer.degrees == (6, 64, 64, 64)
    assert finer.boundaries.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]


@pytest.mark.quick("2.0-2-5", "9.29-2-1", "40.0-2-3")
@pytest.mark.parametrize("degree", [1, 2, 3, 5])
@pytest.mark.parametrize("elements", a_quarter([2, 1, 4, 8]))
@pytest.mark.parametrize("T", [2.0, 9.29, 40.0])
def test_errors_on_a_given_mesh_are_not_below_the_truth(T, elements, degree):
    system = systems.oscillator()
    problem = Problem(system, Event(0.0, [0.3]), Event(T, [0.2]))
    solution = ao.solve(problem, mesh=Mesh.uniform(0.0, T, elements, degree))
    t = np.linspace(0.0, T, 801)
    exact = 0.3 * np.cos(t) + (0.2 - 0.3 * np.cos(T)) / np.sin(T) * np.sin(t)
    assert np.max(np.abs(solution(t)[0] - exact)) <= solution.error * np.max(np.abs(exact))


@pytest.mark.long
def test_a_kink_at_a_node_makes_no_family():
    """Second derivatives of arccos(cos(w q)) are none at its kinks; motions are two parabolas."""
    q0, q1, w = 0.48106614156157, -0.7633431982704673, 2.421292497240636
    T, k = 1.0291868565187763, 1.0

    def end(v):
        a = -k * w * np.sign(q0)  # to the kink, at q = 0; the opposite from there on
        at_kink = -np.copysign(np.sqrt(v**2 - 2 * a * q0), q0)
        rest = T - (at_kink - v) / a
        return at_kink * rest - a * rest**2 / 2

    system = ao.System(lambda q, v, t: v[0] ** 2 / 2 - k * np.arccos(np.cos(w * q[0])), ["q"])
    found = ao.solve(Problem(system, Event(0, [q0]), Event(T, [q1])), throw=False)
    v = brentq(lambda v: end(v) - q1, -2, 2)
    assert (end(v + 1e-6) - end(v - 1e-6)) / 2e-6 > 0.4  # no other path near this one
    assert found.status is not Status.DEGENERATE
    assert not found.success or abs(found.velocity(0.0)[0] - v) < 1e-4
