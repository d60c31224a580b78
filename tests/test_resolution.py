"""What the Legendre coefficients of known functions say, and the meshes made from them."""

import numpy as np
import pytest
from helpers import at_once, same_bits

from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.meshes.resolution import Resolution, cheapest_mesh, resolution
from actionopt.tools.lobatto import lgl

ONE = np.ones(1)


def resolved(f, mesh, sizes=ONE):
    return resolution(mesh, np.atleast_2d(f(mesh.nodes)).T, sizes)


def pole(distance):
    """Return 1 / (t - a) for a pole a at `distance` right of the element [-1, 1]."""
    return lambda t: 1 / (1 + distance - t)


def log_rho(distance):
    """Return log rho of Bernstein's ellipse through 1 + distance."""
    return np.arccosh(1 + distance)


def error(f, mesh, count=2001):
    """Largest difference between f and its interpolant, sampled on every element."""
    b, xi = mesh.boundaries, np.linspace(0, 1, max(21, count // mesh.elements))
    t = (b[:-1, None] + mesh.lengths[:, None] * xi).ravel()
    t = np.clip(t, b[0], b[-1])
    return np.max(np.abs(Path.interpolate(f, mesh)(t) - f(t)))


def meet(f, mesh, target, sizes=ONE, rounds=12):
    """Refine until no coefficient above `target` is left out; return mesh and rounds taken."""
    for k in range(rounds):
        found = resolved(f, mesh, sizes)
        if found.worst <= target:
            return mesh, k
        mesh = cheapest_mesh(found, target)
    raise AssertionError(f"{rounds} rounds did not reach {target}, still {found.worst}")


@at_once("distance", [0.1, 0.5, 2.0])
@at_once("degree", [8, 14])
def test_the_rate_is_that_of_the_nearest_singularity(distance, degree):
    found = resolved(pole(distance), Mesh([-1, 1], degree))
    # Coefficients like k^(1/2) exp(-k log rho), the last ones with what is beyond them folded in.
    assert 0.5 * log_rho(distance) <= found.rate[0] <= 1.1 * log_rho(distance)


@at_once("distance", [0.3, 1.0])
@at_once("degree", [6, 10, 16])
def test_the_coefficient_left_out_is_of_the_size_of_the_next_one(distance, degree):
    f = pole(distance)
    found = resolved(f, Mesh([-1, 1], degree))
    rule = lgl(40)
    exact = np.abs(rule.to_legendre @ f(rule.nodes))
    assert 0.2 < found.omitted[0] / exact[degree + 1] < 5
    # It is the error of the interpolant up to the sum of a geometric series.
    assert 0.1 < error(f, Mesh([-1, 1], degree)) / found.worst < 20


def test_parity_does_not_mislead():
    for f, degree in ((np.cos, 7), (np.cos, 8), (np.sin, 7), (np.sin, 8)):
        mesh = Mesh([-1, 1], degree)
        assert error(f, mesh) / 20 <= resolved(f, mesh).worst <= 100 * error(f, mesh)


def test_it_is_relative_to_the_sizes_and_the_worst_coordinate_counts():
    mesh = Mesh.uniform(0, 1, 3, 6)
    both = np.stack([np.exp(mesh.nodes), 1e6 * np.exp(3 * mesh.nodes)], axis=1)
    fast = resolution(mesh, both[:, 1:], np.array([1e6]))
    assert resolution(mesh, both, np.array([1.0, 1e6])).worst == pytest.approx(fast.worst)
    assert resolution(mesh, both, np.ones(2)).worst == pytest.approx(1e6 * fast.worst)


def test_elements_of_mixed_degrees_are_kept_apart():
    mesh = Mesh([-2.0, -1.0, 1.0, 1.5], [9, 5, 9])
    together = resolved(np.exp, mesh)
    for e in range(3):
        alone = resolved(np.exp, Mesh(mesh.boundaries[e : e + 2], mesh.degrees[e]))
        assert together.omitted[e] == pytest.approx(alone.omitted[0], rel=1e-6)
        assert together.rate[e] == pytest.approx(alone.rate[0], rel=1e-6)
        assert np.allclose(together.steep()[:, e], alone.steep()[:, 0], equal_nan=True)


def test_the_steepest_place_is_where_the_step_is():
    found = resolved(lambda t: np.tanh((t - 0.3) / 1e-4), Mesh.uniform(0, 1, 2, 10))
    left, right = found.steep()[:, 0]
    assert left <= 0.3 <= right


@at_once("target", [1e-4, 1e-8, 1e-12])
@at_once("distance", [1e-3, 0.1, 1.0])
def test_refined_meshes_resolve_a_pole(distance, target):
    f = pole(distance)
    size = 1 / distance
    mesh, rounds = meet(lambda t: f(t) / size, Mesh.uniform(-1, 1, 4, 6), target)
    assert error(lambda t: f(t) / size, mesh) <= 20 * target + 1e-13
    assert rounds <= 8
    assert max(mesh.degrees) <= 24


def test_one_round_is_enough_for_an_entire_function():
    mesh, rounds = meet(lambda t: np.sin(5 * t), Mesh.uniform(0, 1, 2, 8), 1e-10)
    assert rounds == 1
    # An element that is finer than needed gets a lower degree.
    coarser = cheapest_mesh(resolved(lambda t: np.sin(5 * t), mesh), 1e-3)
    assert sum(coarser.degrees) < sum(mesh.degrees)


@pytest.mark.parametrize("where", [0.0, 0.37])
def test_layers_take_few_elements(where):
    sums = []
    for width in (1e-2, 1e-4, 1e-6):
        mesh, _ = meet(
            lambda t, e=width: np.tanh((t - where) / e), Mesh.uniform(0, 1, 4, 6), 1e-9, rounds=20
        )
        inside = np.abs(mesh.boundaries - where) < 30 * width
        assert inside.sum() >= 2  # the layer has elements of its own
        sums.append(sum(mesh.degrees))
    # Unknowns grow like log(1 / width): by about the same number for every factor of 100.
    assert sums[2] <= 3 * sums[0]
    assert sums[2] < 1500


def test_sparse_factors_take_higher_degrees_and_fewer_nodes():
    found = resolved(lambda t: np.sin(40 * t), Mesh.uniform(-1.0, 1.0, 8, 6))
    full, sparse = cheapest_mesh(found, 1e-9), cheapest_mesh(found, 1e-9, sparse=True)
    assert max(sparse.degrees) > max(full.degrees)
    assert sum(sparse.degrees) < sum(full.degrees)
    for mesh in (full, sparse):
        assert resolved(lambda t: np.sin(40 * t), mesh).worst < 1e-8


def test_a_layer_is_cut_out_alike_in_every_element():
    boundaries = []
    for k in range(3):
        found = resolved(lambda t, k=k: np.tanh((t - k - 0.3) / 1e-6), Mesh.uniform(0, 3, 3, 10))
        boundaries.append(cheapest_mesh(found, 1e-12).boundaries - k)
    inner = [b[(b >= 0) & (b <= 1)] for b in boundaries]
    assert inner[0].size > 3
    assert np.allclose(inner[1], inner[0], rtol=0, atol=1e-12)
    assert np.allclose(inner[2], inner[0], rtol=0, atol=1e-12)


def test_an_element_of_degree_one_or_two_is_refined_as_well():
    for degree in (1, 2):
        mesh, _ = meet(np.exp, Mesh.uniform(0, 1, 3, degree), 1e-9)
        assert error(np.exp, mesh) <= 2e-8


def test_a_refined_mesh_covers_the_same_times_exactly():
    mesh = Mesh([0.1, 0.30000000000000004, 0.7], [5, 9])
    finer = cheapest_mesh(resolved(lambda t: np.abs(t - 0.4) ** 1.5, mesh), 1e-8)
    assert finer.boundaries[0] == 0.1 and finer.boundaries[-1] == 0.7
    assert finer.elements > 2
    assert set(mesh.boundaries) <= set(finer.boundaries)


def test_the_same_mesh_comes_out_twice():
    mesh = Mesh.uniform(0, 1, 5, 7)
    found = resolved(pole(0.01), mesh)
    first, second = (cheapest_mesh(found, 1e-9) for _ in range(2))
    same_bits(first.boundaries, second.boundaries, because="it is the same computation")
    assert first.degrees == second.degrees


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("place", [0.3137, 1.6181])
def test_a_step_is_seen_up_or_down(side, place):
    mesh = Mesh([0.0, 1.0, 2.0], [12, 9])
    found = resolved(lambda t: side * np.tanh(1e4 * (t - place)), mesh)
    low, high = found.steep()
    at = int(place > 1)
    assert low[at] < place < high[at]
    nodes = mesh.nodes_since
    assert np.searchsorted(nodes, high[at]) == np.searchsorted(nodes, low[at]) + 1  # neighbours
    assert np.isnan(low[1 - at]) and np.isnan(high[1 - at])


@pytest.mark.parametrize("size", [np.inf, np.nan])
def test_an_element_on_which_a_path_overflowed_is_cut(size):
    mesh = Mesh.uniform(0.0, 1.0, 2, 6)
    scaled = np.sin(mesh.nodes)[:, None]
    omitted, rate = np.array([1e-12, size]), np.ones(2)
    finer = cheapest_mesh(Resolution(mesh, scaled, omitted, rate), 1e-9)
    assert np.sum(finer.boundaries > 0.5) > 1
