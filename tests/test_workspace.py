"""Iterates: placed, followed, carried, what is told of them and what is written down."""

from contextlib import nullcontext
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import systems

import actionopt as ao
from actionopt import Event, Mesh, Path, Problem, System, scenes
from actionopt.solver.refinement import workspace
from actionopt.solver.refinement.iterate import ORDINARY, POLYNOMIAL_ROUNDOFF, Iterate, sizes
from actionopt.solver.refinement.workspace import FOLLOWED_REACH, Workspace


def on_the_way(name="pendulum", elements=4, degree=6):
    """Return a scene and a workspace whose iterate is near its exact path."""
    scene = scenes.get(name)
    p = scene.problem
    ws = Workspace(p, linear=p.system.structure.linear)
    mesh = Mesh.uniform(p.start.t, p.end.t, elements, degree)
    bent = Path.interpolate(lambda t: 1.001 * scene.exact(t), mesh)
    ws.transcribe(mesh, bent)
    return scene, ws


def error(scene, ws):
    p = scene.problem
    t = np.linspace(p.start.t, p.end.t, 101)
    return np.max(np.abs(ws.here.path(t) - scene.exact(t)))


@pytest.mark.parametrize("name", ["pendulum", "oscillator", "rod_pendulum", "damped_oscillator"])
def test_a_path_is_followed_where_it_is_and_carried_to_a_finer_mesh(name):
    scene, ws = on_the_way(name)
    assert ws.follow()
    coarse = error(scene, ws)
    assert 1e-13 < coarse < 1e-3
    p = scene.problem
    assert ws.transfer(Mesh.uniform(p.start.t, p.end.t, 6, 12), least=False)
    assert error(scene, ws) < 1e-4 * coarse
    assert error(scene, ws) <= ws.here.error  # the estimate, by the change from mesh to mesh
    assert [row["elements"] for row in ws.record.rounds] == [4, 6]
    assert ws.record.iterations["newton"] >= 2


def test_a_path_that_goes_far_is_not_the_same_path():
    _, ws = on_the_way()
    ws.here = ws.here.moved(ws.here.z + 3 * FOLLOWED_REACH)
    assert not ws.follow(reach=FOLLOWED_REACH)
    assert ws.record.rounds == []


def test_of_two_samples_of_round_off_the_larger_is_taken():
    """The amplification is 1e6: a sample of no round-off at all would be luck."""
    spring = scenes.get("oscillator").problem.system
    ends = Event(0.0, [1.0]), Event(np.pi + 1e-6, [1e-6 - 1.0])
    ws = Workspace(Problem(spring, *ends), linear=True)
    ws.transcribe(Mesh.uniform(0.0, ends[1].t, 4, 12), None)
    assert ws.follow()
    lucky, unlucky = (replace(ws.here, noise=noise).with_larger_noise() for noise in (0.0, 1.0))
    assert 1e-13 < lucky.noise < 1e-8 and lucky.error > 4 * lucky.noise
    assert unlucky.noise == 1.0


def growth(ws):
    return ws.here.with_probed(False).growth


@pytest.mark.parametrize("told", [growth, Workspace.quadrature_shift])
def test_errors_are_told_of_the_path_at_hand(told):
    _, ws = on_the_way()
    assert ws.follow()
    polished = told(ws)
    ws.here = ws.here.moved(ws.here.z + 0.5)
    found = told(ws)
    ws.here = ws.here.bare()
    assert found == told(ws) != polished


def test_units_are_kept_while_sizes_are_alike():
    scene, ws = on_the_way()
    first, path = ws.here.tr, ws.here.path
    for factor, kept in ((2.0, True), (100.0, False)):
        size = factor * first.lengths / np.max(np.abs(path.values))
        ws.transcribe(first.mesh, path, like=Path(first.mesh, size * path.values))
        assert (ws.here.tr.action_unit == first.action_unit) == kept


def test_descending_is_open_to_few_free_coordinates():
    assert on_the_way("pendulum")[1].can_descend
    assert not on_the_way("rod_pendulum")[1].can_descend  # a constraint
    assert not Workspace(scenes.get("figure_eight").problem).can_descend  # six coordinates


def test_sizes_are_the_largest_reached_and_never_zero():
    Q = np.array([[0.0, -3.0, 1e-20], [0.0, 2.0, 0.0]])
    assert sizes(Q, np.ones(3)).tolist() == [3.0, 3.0, 3.0]
    assert sizes(np.zeros((2, 3)), np.full(3, 7.0)).tolist() == [7.0, 7.0, 7.0]


def test_the_index_on_a_mesh_counts_conjugate_times():
    oscillator = scenes.get("oscillator").problem.system
    for half_periods in (0.5, 2.5):
        T = half_periods * np.pi
        ws = Workspace(Problem(oscillator, Event(0.0, [1.0]), Event(T, [0.3])), linear=True)
        ws.transcribe(Mesh.uniform(0.0, T, 8, 8), None)
        assert ws.follow()
        assert ws.here.index == int(half_periods)


@pytest.mark.parametrize(("part", "kept"), [(0.3, True), (-0.3, True), (3.0, False), (-3.0, False)])
def test_a_path_found_again_elsewhere_is_another_one(part, kept, monkeypatch):
    """They agree at the ends; how far they are apart is told by where they are farthest."""
    scene, ws = on_the_way()
    assert ws.follow()
    p = scene.problem

    def elsewhere(least):
        here = ws.here
        s = (here.mesh.nodes - p.start.t) / p.duration
        bump = part * FOLLOWED_REACH * here.lengths * np.sin(np.pi * s)[:, None]
        ws.here = here.moved(here.tr.pack(here.Q + bump))
        return True

    monkeypatch.setattr(ws, "follow", lambda reach: False)
    monkeypatch.setattr(ws, "_recover", elsewhere)
    assert ws.transfer(Mesh.uniform(p.start.t, p.end.t, 6, 8), least=False) == kept


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_path_is_joined_as_long_as_it_does_not_grow_out_of_its_units(side):
    spring = systems.spring(stiffening=0.01)
    solution = ao.solve(Problem(spring, Event(0.0, [1.0]), Event(1.0, [side])))
    known = solution.discrete
    for factor, near in ((1.5, True), (10.0, False)):
        for a, b in ((factor, factor * side), (-factor, -factor)):
            ws = Workspace(Problem(spring, Event(0.0, [a]), Event(1.0, [b])))
            assert ws.continue_from(known) == near
            if near:
                # The unit of errors, on either side.
                assert ws.here.sizes == max(known.tr.lengths, factor)


def test_what_a_polynomial_leaves_is_rounding_alone():
    """A parabola: nothing is left out on any mesh, so errors are not held to be amplified."""
    p = scenes.get("projectile").problem
    ws = Workspace(p, linear=True)
    ws.transcribe(Mesh.uniform(p.start.t, p.end.t, 4, 6), None)
    assert ws.follow()
    assert ws.transfer(Mesh.uniform(p.start.t, p.end.t, 6, 6), least=False)
    said = ws.here.noise / (ORDINARY * POLYNOMIAL_ROUNDOFF)
    assert ws.here.gain == pytest.approx(max(1.0, said), rel=1e-12)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_path_through_a_collision_is_torn_and_a_smooth_one_is_not(side):
    """|t - c|^(2/3) on elements that end there: resolved, but for a velocity that is infinite."""
    c = 0.4
    steps = 0.3 * 0.25 ** np.arange(14)
    mesh = Mesh([0.0, *(c - steps), *(c + steps[::-1]), 1.0], 12)
    fall = System(lambda q, v, t: v[0] ** 2 / 2 + 2 / 9 / abs(q[0]), ["x"])

    def singular(curve):
        ends = [Event(t, curve(np.array(t))) for t in (0.0, 1.0)]
        ws = Workspace(Problem(fall, *ends))
        path = Path.interpolate(curve, mesh)
        ws.transcribe(mesh, path, like=path)
        return ws.here.singular

    assert singular(lambda t: [side * (np.abs(t - c) ** (2 / 3) + 1e-12)])
    assert not singular(lambda t: [side * (2 + np.sin(3 * t))])
    assert not singular(lambda t: [side * (2 - np.sin(3 * t))])


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_steep_path_is_not_torn_whichever_way_it_goes(side):
    def curve(t):
        return [2 + side * np.tanh((t - 0.41) / 7e-3)]

    mesh = Mesh([0.0, 0.005, 0.2, 0.3, 0.4, 0.5, 0.6, 1.0], 12)
    free = systems.particle()
    ws = Workspace(Problem(free, *[Event(t, curve(np.array(t))) for t in (0.0, 1.0)]))
    ws.transcribe(mesh, Path.interpolate(curve, mesh))
    assert not ws.here.singular


@pytest.mark.parametrize("elements, asked", [(8, True), (400, False)])
def test_ipopt_is_not_asked_again_for_a_least_path_of_thousands_of_unknowns(
    elements, asked, monkeypatch
):
    _, ws = on_the_way(elements=elements)
    calls = []
    monkeypatch.setattr(ws, "descend", lambda: False)
    monkeypatch.setattr(ws, "find", lambda principle: calls.append(principle))
    assert not ws._recover(least=True)
    assert calls == ["patient least"] * asked


@pytest.mark.parametrize(
    "recovered, elements, kinked", [(True, 0.5e-6, True), (True, 1e-5, False), (False, 1e-9, False)]
)
def test_what_is_lost_on_tiny_elements_has_a_kink(recovered, elements, kinked):
    _, ws = on_the_way()
    p = ws.problem
    t = p.start.t + p.duration * np.array([0.0, 0.5, 0.5 + elements, 1.0])
    ws.transcribe(Mesh(t, [6, 6, 6]), None)
    ws.recovered = recovered
    assert ws.has_kink == kinked


def test_no_path_is_said_to_move_less_than_a_free_body():
    held = SimpleNamespace(growth=0.3)
    assert Iterate.impulse_gain(SimpleNamespace(with_probed=lambda many: held), False) == (1, held)


@pytest.mark.parametrize(("reached", "rows", "calls"), [(True, 1, 1), (False, 0, 1), (False, 1, 2)])
def test_no_multipliers_are_a_second_way(reached, rows, calls, monkeypatch):
    """It is gone where there are some, and the first way leads nowhere."""
    told = []

    def approach(equations, z, steps, **more):
        told.append(z)
        return (z, 1) if reached else None

    monkeypatch.setattr(workspace, "approach", approach)
    monkeypatch.setattr(workspace, "_without_multipliers", lambda here: "free")
    here = SimpleNamespace(equations=SimpleNamespace(layout=SimpleNamespace(rows=rows)), z="z")
    at = SimpleNamespace(here=here, many=False, _polish=lambda name, near: near)
    at.record = SimpleNamespace(clock=lambda name: nullcontext())
    found = workspace.Workspace.approach(at)
    assert told == ["z", "free"][:calls] and found == (("z", 1) if reached else None)


@pytest.mark.long
def test_a_path_that_is_lost_on_a_large_mesh_is_found_again():
    """Past a near collision, from the motion itself: its first mesh is a hundredth off."""
    scene = scenes.get("kepler", eccentricity=0.99, start=-0.45, fraction=0.9)
    found = ao.solve(scene.problem, tol=1e-9, guess=scene.exact)
    t = np.linspace(found.start.t, found.end.t, 101)
    assert np.abs(found(t) - scene.exact(t)).max() <= 1e-9
    assert "ipopt" not in found.stats["iterations"]


@pytest.mark.long
@pytest.mark.parametrize("close, away", [(0.0055, 0.0), (0.0055, 0.01), (0.0015, 0.0)])
def test_the_path_near_a_guess_is_not_another_one(close, away):
    """Past a near collision, where the first mesh of the guess tells the turn by a tenth of it."""
    scene = scenes.get("kepler", eccentricity=1 - close, start=-0.137, fraction=0.178)
    found = ao.solve(
        scene.problem, tol=1e-8, guess=lambda t: scene.exact(t) * (1 + away * np.sin(5 * t))
    )
    t = np.linspace(found.start.t, found.end.t, 101)
    assert np.abs(found(t) - scene.exact(t)).max() <= 1e-8
