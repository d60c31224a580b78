"""The second variation as one sparse matrix: modes, signs and derivatives against closed forms."""

from dataclasses import dataclass

import casadi as ca
import numpy as np
import pytest
from helpers import at_once

import actionopt as ao
from actionopt import scenes
from actionopt.analysis.quadratic import assembled, sensitivity
from actionopt.analysis.quadratic.assembled import AssembledForm, assemble, is_convex
from actionopt.analysis.quadratic.jacobi import decay, refine_where, resolve
from actionopt.analysis.spectra import modes
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.tools.lobatto import lgl

N, T = 30, 2.0
MODES = np.sin(np.pi * np.outer(np.arange(1, N + 1), np.arange(1, N + 1)) / (N + 1))
MODES /= np.linalg.norm(MODES, axis=0)
SPEEDS = 2 * np.sin(np.pi * np.arange(1, N + 1) / (2 * N + 2))  # omega of each


def lattice(q, v, t):
    """L = v^2 / 2 - V of masses in a row, between walls, with springs of one."""
    ends = q[0] ** 2 + q[-1] ** 2
    return v @ v / 2 - (ends + (q[1:] - q[:-1]) @ (q[1:] - q[:-1])) / 2


@pytest.fixture(scope="module")
def solution():
    """A motion of the lattice."""
    system = ao.System(lattice, [f"u{j}" for j in range(N)])
    ends = MODES @ np.linspace(0.3, 0.1, N), MODES @ np.linspace(-0.1, 0.2, N)
    return ao.solve(ao.Problem(system, ao.Event(0.0, ends[0]), ao.Event(T, ends[1])), tol=1e-10)


@pytest.mark.long
def test_modes_of_a_lattice(solution):
    assert modes.assemble_if_large(solution.discrete, solution.error, 1e-8) is not None
    found = ao.second_variation(solution, 5)
    k = np.arange(1, 4)[:, None]
    exact = np.sort(((k * np.pi / T) ** 2 - SPEEDS**2).ravel())
    np.testing.assert_allclose(found.eigenvalues, exact[:5], rtol=1e-8)
    t, weights = np.polynomial.legendre.leggauss(40)
    eta = np.array([mode((t + 1) * T / 2) for mode in found.modes])
    overlap = np.einsum("ant,bnt,t->ab", eta, eta, weights * T / 2)
    np.testing.assert_allclose(overlap, np.eye(5), atol=1e-8)


def test_second_derivatives_of_a_lattice(solution, monkeypatch):
    assert assemble(solution.discrete, solution.error, 1e-8) is not None
    monkeypatch.setattr(assembled, "SOLVED_AT_ONCE", 1)  # some columns at once, not all
    found = solution.sensitivity()
    own = MODES @ np.diag(SPEEDS / np.tan(SPEEDS * T)) @ MODES.T
    across = MODES @ np.diag(-SPEEDS / np.sin(SPEEDS * T)) @ MODES.T
    for matrix, exact in ((found.q0q0, own), (found.q1q1, own), (found.q0q1, across)):
        np.testing.assert_allclose(matrix, exact, atol=1e-9 * np.abs(across).max())


def test_lowest_modes_take_one_factorization_just_below_them(solution, monkeypatch):
    """Shifts were tried from near zero down, each with factors, where no eigenvalue was known."""
    form = assemble(solution.discrete, solution.error, 1e-8)
    assert form is not None
    least = (np.pi / T) ** 2 - SPEEDS.max() ** 2
    assert 0 < least - form.bound(np.ones(N)) - 1e-4 * (np.pi / T) ** 2 < 0.02
    solver, shifts = modes._Assembled.solver, []
    monkeypatch.setattr(modes._Assembled, "solver", lambda x, s: shifts.append(s) or solver(x, s))
    assert modes._Assembled(form, np.ones(N)).lowest(2, 1)[0][0] == pytest.approx(least)
    assert shifts == [form.bound(np.ones(N))]


def test_a_mesh_that_is_known_to_be_too_coarse_is_not_tried_again(solution, monkeypatch):
    """Index, modes and derivatives of one path begin on its mesh, with the same random fields."""
    assert assemble(solution.discrete, solution.error, 1e-4) is not None
    monkeypatch.setattr(AssembledForm, "fields", lambda form: pytest.fail("fields again"))
    form = assemble(solution.discrete, solution.error, 1e-4)
    assert form is not None and form.at.mesh is solution.mesh


def test_degrees_are_raised_by_two_where_that_surely_is_enough():
    """Fields that leave out 1e-4 were resolved to 1e-10, and matrices were as much larger."""
    mesh = ao.Mesh([0.0, 1.0, 2.0, 3.0], [6, 6, 6])
    t = lgl(6).nodes
    table = np.stack([np.cos(t / 2), np.abs(t), np.exp(t / 50)])[:, :, None]
    tail, expected = decay(mesh, [table])
    assert expected[0] < 1e-2 * tail[0] and expected[1] > 0.1 * tail[1]
    finer = refine_where(mesh, tail, tail[0] / 2, expected)
    assert finer is not None and (finer.degrees, finer.elements) == ((8, 6, 6, 6), 4)
    finer = refine_where(mesh, tail, tail[0] / 2)
    assert finer is not None and finer.degrees == (10, 6, 6, 6)
    unsure = refine_where(mesh, tail, tail[0] / 2, tail)
    assert unsure is not None and unsure.degrees == (10, 6, 6, 6)


def test_fields_that_are_asked_for_as_curves_have_more_digits_than_values_need(solution):
    """Modes of a lattice were off by 2e-8, their eigenvalues by 1e-13."""
    values, curves = (
        assemble(solution.discrete, solution.error, 1e-11, curves=asked) for asked in (False, True)
    )
    assert values is not None and curves is not None
    assert sum(curves.at.mesh.degrees) > sum(values.at.mesh.degrees)


MASSES = 90


def far_apart(weak):
    """Return a form of a motion of many masses; springs beside that in the middle are weak."""
    springs = np.ones(MASSES - 1)
    springs[MASSES // 2 - 1 : MASSES // 2 + 1] = weak

    def lagrangian(q, v, t):
        d = q[1:] - q[:-1]
        return (v @ v - springs @ d**2 - springs @ d**4 / 2) / 2

    system = ao.System(lagrangian, [f"u{j}" for j in range(MASSES)])
    ends = np.sin(np.arange(MASSES)), np.cos(np.arange(MASSES))
    known = ao.solve(ao.Problem(system, ao.Event(0.0, ends[0]), ao.Event(0.5, ends[1])))
    form = assemble(known.discrete, known.error, 1e-5)
    assert form is not None
    return form


@pytest.mark.long
def test_columns_of_moves_that_are_felt_by_neighbours_alone_are_found_as_one(monkeypatch):
    form, moved = far_apart(1.0), [np.eye(MASSES)] * 2
    exact, asked, along = sensitivity._along(form, moved, moved), [], sensitivity._along
    assert exact is not None

    def counted(form, moved, by):
        asked.append(moved[0].shape[1])
        return along(form, moved, by)

    monkeypatch.setattr(sensitivity, "_along", counted)
    found = sensitivity._by_groups(form, moved)
    np.testing.assert_allclose(found, exact, atol=1e-14 * np.abs(exact).max())
    assert sum(asked) < MASSES / 2


def test_columns_are_not_grouped_where_moves_are_felt_farther_than_that_in_the_middle():
    form, moved = far_apart(1e-8), [np.eye(MASSES)] * 2
    assert sensitivity._by_groups(form, moved) is None


@pytest.mark.long
def test_lowest_modes_of_a_chain_are_bounded_by_its_tensions():
    known = scenes.get("chain", links=5)
    found = ao.solve(known.problem, guess=known.guess)
    form = assemble(found.discrete, found.error, 1e-4)
    assert form is not None
    assert 1 < form.bound(np.ones(10)) / ao.second_variation(found, 1).eigenvalues[0] < 2


def test_forces_of_a_moved_end_are_those_of_its_variation():
    def coupled(q, v, t):
        return (1 + q[0] ** 2) * v @ v / 2 + v[0] * v[1] / 3 + q[1] * v[0] ** 2 - q[0] * q[1]

    path = ao.Path.interpolate(lambda t: np.stack([t, t**2]), ao.Mesh([0, 0.4, 1], [3, 5]))
    ends = (ao.Event(x, path(x)) for x in (0.0, 1.0))
    at = DiscretePath.of(ao.Problem(ao.System(coupled, ["x", "y"]), *ends), path)
    form = AssembledForm(at, at.tr.kkt(at.z))
    for k in (0, -1):
        eta, whole = np.zeros((2, *at.Q.shape, 2))
        eta[k] = np.diag(1 / at.tr.lengths)
        found = form.coupling(k).times(np.eye(2), at.Q.size)
        for g in at.tr.layout.groups:
            forces = form.forces(g, eta[g.nodes]) / at.tr.lengths[:, None]
            np.add.at(whole, g.nodes, forces)
        np.testing.assert_allclose(found, whole.reshape(-1, 2), atol=1e-12)


@dataclass(frozen=True, eq=False)
class Full:
    """A full symmetric matrix, as an operator whose lowest eigenvalues are sought."""

    matrix: np.ndarray

    @property
    def size(self):
        return len(self.matrix)

    def times(self, block):
        return self.matrix @ block

    def solver(self, shift):
        shifted = self.matrix - shift * np.eye(self.size)
        return (
            None if np.linalg.eigvalsh(shifted)[0] <= 0 else lambda b: np.linalg.solve(shifted, b)
        )


@at_once("seed", range(12))
def test_lowest_eigenvalues_are_those_of_a_full_matrix_equal_ones_too(seed):
    """Inverse iteration stopped at values a tenth off, where those sought were far below others."""
    rng = np.random.default_rng(seed)
    size, count = int(rng.integers(8, 60)), int(rng.integers(1, 8))
    values = np.sort(rng.standard_normal(size) * 10.0 ** rng.uniform(-2, 4, size))
    values[: count // 2] = values[0]
    turn, _ = np.linalg.qr(rng.standard_normal((size, size)))
    matrix = (turn * values) @ turn.T
    matrix = (matrix + matrix.T) / 2
    found, vectors = modes._subspace(Full(matrix), -(10.0 ** rng.uniform(-4, 2)), count)
    scale = np.abs(values).max()
    assert np.max(np.abs(found - values[:count])) < 1e-9 * scale
    assert np.max(np.abs(matrix @ vectors - vectors * found)) < 1e-6 * scale


def test_a_sparse_matrix_solves_above_its_lowest_eigenvalue_only():
    matrix = np.diag([2.0, 3.0, 4.0]) + np.diag([0.5, 0.5], 1) + np.diag([0.5, 0.5], -1)
    sparse, block = modes._Matrix(ca.sparsify(ca.DM(matrix))), np.arange(6.0).reshape(3, 2)
    assert sparse.size == 3
    np.testing.assert_allclose(sparse.times(block), matrix @ block)
    solve = sparse.solver(1.0)
    assert solve is not None
    np.testing.assert_allclose((matrix - np.eye(3)) @ solve(block), block, atol=1e-12)
    assert sparse.solver(2.0) is None


def test_a_form_less_a_mass_is_that_of_a_stiffer_spring():
    """d2S of w^2 = 1 less a mass of 3 is d2S of w^2 = 4, on each element."""
    path = ao.Path.interpolate(lambda t: t[None], ao.Mesh.uniform(0, 1, 2, 6))
    ends, forms = (ao.Event(0.0, [0.0]), ao.Event(1.0, [1.0])), []
    for k in (1.0, 4.0):
        spring = ao.System(lambda q, v, t, k=k: (v @ v - k * q @ q) / 2, ["x"])
        at = DiscretePath.of(ao.Problem(spring, *ends), path)
        forms.append(resolve(at, 1e-8, 1e-8))
    one, four = forms
    for found, mass, exact in zip(one.elements, one.masses, four.elements, strict=True):
        np.testing.assert_allclose(found - np.diag(3.0 * mass), exact, atol=1e-9)
    less = zip(one.shifted(0.5), one.elements, one.kinetic, strict=True)
    assert all(np.array_equal(found, whole - part / 2) for found, whole, part in less)


@at_once(
    ("kinetic", "known"),
    [
        (lambda v, q: v @ v / 2, True),
        (lambda v, q: v[0] ** 2 / 2 - v[1] ** 2 / 2, False),
        (lambda v, q: v @ v / 2 + v[0] * v[1] / 2, True),
        (lambda v, q: v @ v / 2 + 2 * v[0] * v[1], False),
        (lambda v, q: v[0] ** 2 / 2 + v[1], False),
        (lambda v, q: v @ v / 2 * np.sqrt(q[0] - 1.5), False),  # not finite at first
    ],
)
def test_a_lagrangian_is_seen_to_be_convex(kinetic, known):
    system = ao.System(lambda q, v, t: kinetic(v, q), ["x", "y"])
    path = ao.Path.interpolate(lambda t: np.stack([t + 1, t + 1]), ao.Mesh.uniform(0, 1, 2, 4))
    problem = ao.Problem(system, ao.Event(0.0, path(0.0)), ao.Event(1.0, path(1.0)))
    assert bool(is_convex(DiscretePath.of(problem, path))) is known
