"""A path under way: placed, followed, carried, and what is written down of it."""

import numpy as np
import pytest

import actionopt as ao
from actionopt import Event, Mesh, Path, Problem, System, scenes
from actionopt.solver.iterate import NEAR, Walk, sizes


def on_the_way(name="pendulum", elements=4, degree=6):
    """Return a scene and a walk that stands near its exact path."""
    scene = scenes.get(name)
    p = scene.problem
    walk = Walk(p, linear=p.system.structure.linear)
    mesh = Mesh.uniform(p.start.t, p.end.t, elements, degree)
    bent = Path.interpolate(lambda t: 1.001 * scene.exact(t), mesh)
    walk.place(mesh, bent)
    return scene, walk


def error(scene, walk):
    p = scene.problem
    t = np.linspace(p.start.t, p.end.t, 101)
    return np.max(np.abs(walk.path()(t) - scene.exact(t)))


@pytest.mark.parametrize("name", ["pendulum", "oscillator", "rod_pendulum", "damped_oscillator"])
def test_a_path_is_followed_where_it_is_and_carried_to_a_finer_mesh(name):
    scene, walk = on_the_way(name)
    assert walk.follow()
    coarse = error(scene, walk)
    assert 1e-13 < coarse < 1e-3
    p = scene.problem
    assert walk.carry(Mesh.uniform(p.start.t, p.end.t, 6, 12), least=False)
    assert error(scene, walk) < 1e-4 * coarse
    assert error(scene, walk) <= walk.error  # the estimate, by the change from mesh to mesh
    assert [row["elements"] for row in walk.rounds] == [4, 6]
    assert walk.iterations["newton"] >= 2


def test_a_path_that_goes_far_is_not_the_same_path():
    _, walk = on_the_way()
    walk.z = walk.z + 3 * NEAR
    assert not walk.follow(reach=NEAR)
    assert walk.rounds == []


@pytest.mark.parametrize("told", [Walk.amplification, Walk.missed])
def test_errors_are_told_of_the_path_at_hand(told):
    _, walk = on_the_way()
    assert walk.follow()
    polished = told(walk)
    walk.z = walk.z + 0.5
    found = told(walk)
    walk.factors = None
    assert found == told(walk) != polished


def test_units_are_kept_while_sizes_are_alike():
    scene, walk = on_the_way()
    first = walk.tr
    walk.lengths = 2 * walk.lengths
    walk.place(first.mesh, walk.path())
    assert walk.tr.action_unit == first.action_unit
    walk.lengths = 100 * walk.lengths
    walk.place(first.mesh, walk.path())
    assert walk.tr.action_unit != first.action_unit


def test_descending_is_open_to_few_free_coordinates():
    assert on_the_way("pendulum")[1].can_descend
    assert not on_the_way("rod_pendulum")[1].can_descend  # a constraint
    assert not Walk(scenes.get("figure_eight").problem).can_descend  # six coordinates


def test_sizes_are_the_largest_reached_and_never_zero():
    Q = np.array([[0.0, -3.0, 1e-20], [0.0, 2.0, 0.0]])
    assert sizes(Q, np.ones(3)).tolist() == [3.0, 3.0, 3.0]
    assert sizes(np.zeros((2, 3)), np.full(3, 7.0)).tolist() == [7.0, 7.0, 7.0]


def test_the_index_on_a_mesh_counts_conjugate_times():
    oscillator = scenes.get("oscillator").problem.system
    for half_periods in (0.5, 2.5):
        T = half_periods * np.pi
        walk = Walk(Problem(oscillator, Event(0.0, [1.0]), Event(T, [0.3])), linear=True)
        walk.sizes = np.ones(1)
        walk.place(Mesh.uniform(0.0, T, 8, 8), None)
        assert walk.follow()
        assert walk.index() == int(half_periods)


@pytest.mark.parametrize(("part", "kept"), [(0.3, True), (-0.3, True), (3.0, False), (-3.0, False)])
def test_a_path_found_again_elsewhere_is_another_one(part, kept, monkeypatch):
    """They agree at the ends; how far they are apart is told by where they are farthest."""
    scene, walk = on_the_way()
    assert walk.follow()
    p = scene.problem

    def elsewhere(least):
        s = (walk.tr.mesh.nodes - p.start.t) / p.duration
        bump = part * NEAR * walk.lengths * np.sin(np.pi * s)[:, None]
        walk.z = walk.tr.pack(walk.tr.coordinates(walk.z) + bump)
        return True

    monkeypatch.setattr(walk, "follow", lambda reach: False)
    monkeypatch.setattr(walk, "_recover", elsewhere)
    assert walk.carry(Mesh.uniform(p.start.t, p.end.t, 6, 8), least=False) == kept


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_path_is_joined_as_long_as_it_does_not_grow_out_of_its_units(side):
    spring = System(lambda q, v, t: v[0] ** 2 / 2 - q[0] ** 2 / 2 - q[0] ** 4 / 400, ["x"])
    solution = ao.solve(Problem(spring, Event(0.0, [1.0]), Event(1.0, [side])))
    tr, z = solution.discrete.tr, solution.discrete.z
    for factor, near in ((1.5, True), (10.0, False)):
        for a, b in ((factor, factor * side), (-factor, -factor)):
            walk = Walk(Problem(spring, Event(0.0, [a]), Event(1.0, [b])))
            assert walk.join(tr, z) == near
            assert walk.sizes == max(tr.lengths, factor)  # the unit of errors, on either side


def test_what_a_polynomial_leaves_is_rounding_alone():
    """A parabola: nothing is left out on any mesh, so errors are not held to be amplified."""
    p = scenes.get("projectile").problem
    walk = Walk(p, linear=True)
    walk.place(Mesh.uniform(p.start.t, p.end.t, 4, 6), None)
    assert walk.follow()
    assert walk.carry(Mesh.uniform(p.start.t, p.end.t, 6, 6), least=False)
    assert walk.gain == max(1.0, walk._sensitivity())


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_path_through_a_collision_is_torn_and_a_smooth_one_is_not(side):
    """|t - c|^(2/3) on elements that end there: resolved, but for a velocity that is infinite."""
    c = 0.4
    steps = 0.3 * 0.25 ** np.arange(14)
    mesh = Mesh([0.0, *(c - steps), *(c + steps[::-1]), 1.0], 12)
    fall = System(lambda q, v, t: v[0] ** 2 / 2 + 2 / 9 / abs(q[0]), ["x"])

    def torn(curve):
        ends = [Event(t, curve(np.array(t))) for t in (0.0, 1.0)]
        walk = Walk(Problem(fall, *ends))
        walk.place(mesh, Path.interpolate(curve, mesh))
        walk.measure(walk.tr.coordinates(walk.z))
        return walk.torn()

    assert torn(lambda t: [side * (np.abs(t - c) ** (2 / 3) + 1e-12)])
    assert not torn(lambda t: [side * (2 + np.sin(3 * t))])
    assert not torn(lambda t: [side * (2 - np.sin(3 * t))])


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_steep_path_is_not_torn_whichever_way_it_goes(side):
    def curve(t):
        return [2 + side * np.tanh((t - 0.41) / 7e-3)]

    mesh = Mesh([0.0, 0.005, 0.2, 0.3, 0.4, 0.5, 0.6, 1.0], 12)
    free = System(lambda q, v, t: v[0] ** 2 / 2, ["x"])
    walk = Walk(Problem(free, *[Event(t, curve(np.array(t))) for t in (0.0, 1.0)]))
    walk.place(mesh, Path.interpolate(curve, mesh))
    assert not walk.torn()
