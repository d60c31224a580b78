"""Meshes and the piecewise polynomials on them."""

from types import SimpleNamespace

import numpy as np
import pytest
from helpers import at_once

from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.meshes.path import Path
from actionopt.solver.input.other_curves import read_curve

EPS = np.finfo(float).eps
MIXED = Mesh([0.0, 0.3, 1.0, 1.25, 4.0], [3, 5, 3, 1])  # two elements of one degree, apart


def cubic(t):
    """Two cubics and their derivatives, polynomials that degree 3 holds exactly."""
    return np.stack([t**3 - 2 * t, 1 - t**2])


def cubic_velocity(t):
    return np.stack([3 * t**2 - 2, -2 * t])


def cubic_acceleration(t):
    return np.stack([6 * t, np.full_like(t, -2.0)])


# -- Mesh ------------------------------------------------------------------------------------


def test_nodes_of_mixed_degrees_increase_and_contain_the_boundaries_exactly():
    assert MIXED.elements == 4
    assert MIXED.offsets.tolist() == [0, 3, 8, 11, 12]
    assert MIXED.nodes.size == 13
    assert np.all(np.diff(MIXED.nodes) > 0)
    assert np.array_equal(MIXED.nodes[MIXED.offsets], MIXED.boundaries)


def test_groups_cover_every_element_once():
    seen = np.concatenate([g.elements for g in MIXED.groups])
    assert sorted(seen.tolist()) == [0, 1, 2, 3]
    for g in MIXED.groups:
        assert g.nodes.shape == (g.elements.size, g.rule.degree + 1)
        assert all(MIXED.degrees[e] == g.rule.degree for e in g.elements)


def test_a_moved_mesh_keeps_its_proportions_and_meets_the_end_exactly():
    moved = MIXED.moved(0.1, 0.7)
    assert moved.boundaries[0] == 0.1
    assert moved.boundaries[-1] == 0.7
    assert np.allclose(moved.lengths / 0.6, MIXED.lengths / 4.0, rtol=1e-14)
    assert moved.degrees == MIXED.degrees
    assert MIXED.moved(0.0, 4.0) is MIXED


def test_a_mesh_cannot_be_changed():
    with pytest.raises(ValueError, match="read-only"):
        MIXED.boundaries[0] = 1.0


@at_once(
    ("boundaries", "degrees", "message"),
    [
        ([0.0], 2, "at least two finite element boundaries"),
        ([[0.0, 1.0]], 2, "at least two finite element boundaries"),
        ([0.0, np.nan], 2, "at least two finite element boundaries"),
        ([0.0, 1.0, 1.0], 2, "increase strictly"),
        ([0.0, 1.0, 2.0], [2, 3, 4], "one for each of the 2 elements"),
        ([0.0, 1.0], 0, "integer degrees from 1 to 64"),
        ([0.0, 1.0], 65, "integer degrees from 1 to 64"),
        ([0.0, 1.0], 2.5, "integer degrees from 1 to 64"),
    ],
)
def test_meshes_that_are_none(boundaries, degrees, message):
    with pytest.raises(ValueError, match=message):
        Mesh(boundaries, degrees)


# -- Path ------------------------------------------------------------------------------------


@pytest.mark.parametrize("mesh", [Mesh.uniform(-1.0, 2.0, 5, 3), Mesh([0.0, 0.3, 1.0], [3, 7])])
def test_a_cubic_and_its_derivatives_are_exact_between_the_nodes(mesh):
    path = Path.interpolate(cubic, mesh)
    t = np.linspace(mesh.boundaries[0], mesh.boundaries[-1], 101)
    # Each derivative costs a factor d^2 / h of round-off.
    slope = 2 * max(mesh.degrees) ** 2 / mesh.lengths.min()
    assert np.max(np.abs(path(t) - cubic(t))) <= 32 * EPS
    assert np.max(np.abs(path.velocity(t) - cubic_velocity(t))) <= 32 * EPS * slope
    assert np.max(np.abs(path.acceleration(t) - cubic_acceleration(t))) <= 32 * EPS * slope**2


def test_one_time_gives_one_column_and_many_give_many():
    path = Path.interpolate(cubic, MIXED)
    assert path(0.5).shape == (2,)
    assert path([0.5]).shape == (2, 1)
    assert path(np.full((3, 4), 0.5)).shape == (2, 3, 4)
    assert path([]).shape == (2, 0)
    assert np.array_equal(path([0.5])[:, 0], path(0.5))


def test_a_path_passes_through_its_nodes_and_is_continuous():
    values = np.random.default_rng(1).normal(size=(2, MIXED.nodes.size))
    path = Path(MIXED, values)
    ends = MIXED.offsets
    assert np.array_equal(path(MIXED.boundaries), values[:, ends])  # no round-off at all
    assert np.max(np.abs(path(MIXED.nodes) - values)) <= 64 * EPS
    inner = MIXED.boundaries[1:-1]
    jump = path(inner + 1e-12) - path(inner - 1e-12)
    assert np.max(np.abs(jump)) <= 1e-9


def test_given_velocities_are_used_instead_of_the_derivative():
    mesh = Mesh.uniform(0.0, 1.0, 2, 4)
    path = Path(mesh, np.sin(mesh.nodes), np.cos(mesh.nodes))
    assert np.max(np.abs(path.velocity(mesh.nodes)[0] - np.cos(mesh.nodes))) <= 8 * EPS
    assert abs(path.acceleration(0.3)[0] + np.sin(0.3)) <= 1e-4


def test_a_finer_mesh_holds_the_same_curve():
    path = Path.interpolate(cubic, Mesh.uniform(0.0, 1.0, 1, 3))
    finer = path.on(Mesh.uniform(0.0, 1.0, 3, 4))
    t = np.linspace(0, 1, 50)
    assert np.max(np.abs(finer(t) - path(t))) <= 16 * EPS


def test_legendre_coefficients_of_a_cubic():
    # On [-1, 1]: t^3 - 2t = (2/5) P_3 - (7/5) P_1 and 1 - t^2 = (2/3) P_0 - (2/3) P_2.
    path = Path.interpolate(cubic, Mesh([-1.0, 1.0], 4))
    (coefficients,) = path.legendre()
    exact = [[0, -7 / 5, 0, 2 / 5, 0], [2 / 3, 0, -2 / 3, 0, 0]]
    assert np.max(np.abs(coefficients - exact)) <= 8 * EPS


@pytest.mark.parametrize("t", [-1e-6, 4.000001, [0.5, 5.0], np.nan])
def test_a_path_is_not_extrapolated(t):
    path = Path.interpolate(cubic, MIXED)
    with pytest.raises(ValueError, match="not extrapolated"):
        path(t)


def test_round_off_beyond_the_end_is_not_extrapolation():
    path = Path.interpolate(cubic, MIXED)
    assert np.array_equal(path(np.nextafter(4.0, 5.0)), path(4.0))


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (np.zeros((2, 5)), r"expected values of shape \(n, 13\)"),
        (np.zeros((1, 2, 13)), r"expected values of shape \(n, 13\)"),
        (np.full((2, 13), np.inf), "expected finite values"),
    ],
)
def test_values_that_do_not_fit_the_mesh(values, message):
    with pytest.raises(ValueError, match=message):
        Path(MIXED, values)


def test_boundaries_nearer_to_zero_than_the_first_may_be_next_to_each_other():
    """Measured from -3 the two would be one."""
    a = 1.305
    mesh = Mesh([-3.0, np.nextafter(a, 0.0), a, 4.0], 2)
    assert np.all(np.diff(mesh.since) > 0)
    assert mesh.boundaries[1] < mesh.boundaries[2] == a


def test_a_mesh_shows_its_lowest_and_highest_degree():
    assert "degree 4," in repr(Mesh([0.0, 1.0, 2.0], [4, 4]))
    assert "degrees 3 to 5," in repr(Mesh([0.0, 1.0, 2.0, 3.0], [4, 5, 3]))


def test_tables_of_a_path_are_read_only_and_its_own():
    mesh, given = Mesh([0.0, 1.0], 2), np.array([[0.0, 1.0, 2.0]])
    path = Path(mesh, given, velocities=2 * given)
    given[0, 1] = 5.0
    assert path.values[0, 1] == 1.0
    for table in (path.values, path.velocities):
        with pytest.raises(ValueError, match="read-only"):
            table[0, 0] = 1.0


class Table:
    """As pandas has it."""

    iloc = None

    def __init__(self, index, **columns):
        self.index, self.columns, self.data = np.array(index), list(columns), columns

    def __getitem__(self, name):
        return np.array(self.data[name])


def test_curves_of_others_are_read_or_refused():
    of_columns = read_curve(Table([0.0, 1.0], x=[1.0, 2.0], y=[3.0, 5.0]), ("y", "x"))
    assert of_columns(0.5).tolist() == [4.0, 1.5]
    timed = read_curve(Table([7, 8], t=[0.0, 2.0], x=[1.0, 2.0]), ("x",))
    assert timed(1.0).tolist() == [1.5]
    named = read_curve(Table([0.0, 2.0], t=[1.0, 2.0]), ("t",))
    assert named(1.0).tolist() == [1.5]
    with pytest.raises(ValueError, match="columns x, z, found none called 'z' among x, y"):
        read_curve(Table([0.0, 1.0], x=[1.0, 2.0], y=[3.0, 5.0]), ("x", "z"))
    rows = SimpleNamespace(t=[0.0, 1.0], y=[[1.0, 3.0], [9.0, 9.0]], sol=None)
    assert read_curve(rows, ("x",))(0.5).tolist() == [2.0]
    with pytest.raises(ValueError, match=r"of 3 coordinates, or of so many and their .* found 2"):
        read_curve(rows, ("x", "y", "z"))
    assert read_curve(3.0, ("x",)) is None


def test_elements_are_divided_taken_apart_and_cut_anew_with_their_own_degrees():
    mesh = Mesh([1.0, 2.0, 4.0], [3, 5])
    divided = mesh.divide([1, 4])
    assert divided.boundaries.tolist() == [1, 2, 2.5, 3, 3.5, 4]
    assert divided.degrees == (3, 5, 5, 5, 5)
    assert mesh.divide([2, 1], [7, 9]).degrees == (7, 7, 9)
    part = divided.part(1, 3)
    assert part.boundaries.tolist() == [2, 2.5, 3] and part.degrees == (5, 5)
    assert mesh.cut(np.array([0.0, 0.5, 1.5, 3.0])).degrees == (3, 3, 5)
