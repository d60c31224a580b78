"""Factors of the KKT matrix, however it is stored, against dense linear algebra."""

import casadi as ca
import numpy as np
import pytest
import systems
from helpers import same_bits
from scipy.linalg import null_space

from actionopt import solve
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.matrices.blocks import Condensed
from actionopt.discrete.matrices.factors import (
    Factors,
    SparseFactors,
    diagonal,
    full,
    kkt_nonzeros,
    negative_eigenvalues,
    negative_signs,
    product,
    solve_inside,
)
from actionopt.discrete.matrices.layout import border_matrix
from actionopt.discrete.matrices.matrices import Matrices
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.mechanics.question.held import Held
from actionopt.mechanics.question.obstacle import Arc
from actionopt.mechanics.question.problem import Event, Periodic, Problem
from actionopt.mechanics.system import System

# A backward stable solve is wrong by the condition of the matrix times rounding, some 1e2 of it.
ROUNDING = 100 * np.finfo(float).eps


def springs(q, v, t):
    x, y, z = q
    return (v[0] ** 2 + v[1] ** 2 + v[2] ** 2 - x**2 * y**2 - (y - z) ** 4) / 2


def sphere(q, t):
    return q[0] ** 2 + q[1] ** 2 - 2 * q[2]


def drag(q, v, t):
    return [-x * (1 + q[0] ** 2) for x in v]


KINDS = {"plain": {}, "sphere": {"constraint": sphere}, "drag": {"force": drag}}
# Elements, and rows within one up to which it is a block: made full, in blocks, condensed once more
# and once more, node by node, sparse (L D L', or QR where forces make the matrix unsymmetric), and
# with factors that are kept.
STORED = {
    "small": (2, None),
    "blocks": (12, None),
    "reduced": (41, None),
    "reduced twice": (80, None),
    "in parts": (12, None),
    "sparse": (12, 0),
    "kept": (12, 0),
}


@pytest.fixture(params=STORED)
def stored(request, monkeypatch):
    elements, inner = STORED[request.param]
    if inner is not None:
        monkeypatch.setattr("actionopt.discrete.matrices.layout.BLOCK_SIZE", inner)
        monkeypatch.setattr("actionopt.discrete.matrices.layout.FILLED", 1.0)
    if request.param == "in parts":
        monkeypatch.setattr("actionopt.discrete.matrices.blocks.PLACES_AT_ONCE", 1)
        monkeypatch.setattr("actionopt.discrete.matrices.blocks.AT_HAND", 1)
    if request.param == "kept":
        monkeypatch.setattr("actionopt.discrete.matrices.layout.KEPT_SIZE", 0)
    return request.param, elements


def matrix_of(kind, stored, duration=2.0):
    """Return layout, nonzeros and dense matrix at a generic point."""
    name, elements = stored
    system = System(springs, list("xyz"), **KINDS[kind])
    problem = Problem(system, Event(0, [0, 0, 0]), Event(duration, [1, 1, 1]))
    tr = Transcription(problem, Mesh.uniform(0, duration, elements, 4), np.ones(3))
    assert tr.layout.storage == ("sparse" if name in ("sparse", "kept") else "blocks")
    assert tr.layout.keeps_factors == (name == "kept" and kind == "sphere")
    assert tr.layout.small == (name == "small")
    z = np.random.default_rng(elements).uniform(-1, 1, tr.layout.size)
    nonzeros, pattern = tr.kkt(z), tr.layout.kkt
    dense = np.zeros(pattern.shape)
    dense[pattern.row, pattern.col] = kkt_nonzeros(tr.layout, nonzeros)
    return tr.layout, nonzeros, dense


# A way of storing matrices with each kind of question.
ONE_OF_EACH = pytest.mark.quick(
    "small-plain",
    "blocks-sphere",
    "reduced-drag",
    "reduced twice-plain",
    "in parts-sphere",
    "sparse-drag",
    "kept-plain",
)


@pytest.mark.quick(
    "small-plain",
    "small-drag",
    "in parts-plain",
    "in parts-drag",
    "sparse-plain",
    "kept-plain",
    "kept-sphere",
    "kept-drag",
)
@pytest.mark.parametrize("kind", KINDS)
def test_solutions_are_those_of_a_dense_solver(kind, stored):
    layout, nonzeros, dense = matrix_of(kind, stored)
    some = [Factors(layout, nonzeros, many=many) for many in (False, True)]
    rights = np.random.default_rng(1).normal(size=(3, layout.size))
    solutions, condition = np.linalg.solve(dense, rights.T).T, np.linalg.cond(dense, np.inf)
    cases = zip(rights, solutions, strict=True)
    for factors, right, known in ((one, *case) for case in cases for one in some):
        found = factors.solve(right)
        tolerance = ROUNDING * condition * np.max(np.abs(known))
        assert tolerance < 1e-6 * np.max(np.abs(known))  # the comparison says something
        assert np.max(np.abs(found - known)) <= tolerance
        residual = np.max(np.abs(dense @ found - right))
        size = np.max(np.abs(right)) + np.linalg.norm(dense, np.inf) * np.max(np.abs(found))
        assert residual <= 1e-13 * size
    assert not np.allclose(dense @ (found * (1 + 1e-6)), right, rtol=1e-10, atol=1e-10)


@pytest.mark.quick("2-plain", "12-sphere", "41-drag")
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("elements", [1, 2, 3, 12, 41, 80])
def test_condensation_alone_solves_to_rounding(monkeypatch, kind, elements):
    monkeypatch.setattr("actionopt.discrete.matrices.layout.FULL_SIZE", 0)
    layout, nonzeros, dense = matrix_of(kind, ("blocks", elements))
    right = np.random.default_rng(3).normal(size=layout.size)
    found = Condensed(layout.blocks, nonzeros).solve(right)
    assert np.max(np.abs(dense @ found - right)) <= 1e-9 * np.max(np.abs(dense))


@pytest.mark.quick("small", "blocks", "in parts", "sparse", "kept")
def test_solutions_with_a_matrix_near_another_are_its_own(stored):
    layout, nonzeros, dense = matrix_of("sphere", stored)
    known = Factors(layout, nonzeros)
    known.solve(np.ones(layout.size))
    right = np.random.default_rng(4).normal(size=layout.size)
    # So far in the first matrix's units that refinement settles in a few steps, and does not.
    least = np.abs(np.linalg.eigvalsh(dense)).min()
    for far in (1e-3 * least, 3.0):
        shift = np.full(layout.size, far)
        factors = known.near(nonzeros + diagonal(layout, shift))
        found, other = factors.solve(right), dense + np.diag(shift)
        assert np.allclose(found, np.linalg.solve(other, right), rtol=1e-8, atol=1e-9)
        refactored = "_direct" in vars(factors)
        assert layout.small or refactored == (far == 3.0)


@pytest.mark.quick("blocks", "kept")
def test_signs_are_told_by_a_matrix_near_another_only_if_none_is_between(stored):
    layout, nonzeros, dense = matrix_of("sphere", stored)
    known, cut = Factors(layout, nonzeros), layout.unknowns
    allowed = null_space(dense[cut:, :cut])
    least = np.linalg.eigvalsh(allowed.T @ dense[:cut, :cut] @ allowed)[0]
    assert least > 0
    for part in (0.01, 1.01):
        shift = np.r_[np.full(cut, -part * least), np.zeros(layout.size - cut)]
        factors = known.near(nonzeros + diagonal(layout, shift))
        assert factors.negative_pivots() == layout.rows + (part > 1)
        if layout.keeps_factors:
            assert ("_regular" in vars(factors)) == (part > 1)


@ONE_OF_EACH
@pytest.mark.parametrize("kind", KINDS)
def test_products_are_those_of_the_dense_matrix(kind, stored):
    layout, nonzeros, dense = matrix_of(kind, stored)
    z = np.random.default_rng(2).normal(size=layout.size)
    assert np.allclose(product(layout, nonzeros, z), dense @ z, rtol=1e-13, atol=1e-12)


@pytest.mark.quick(
    "small--3.0",
    "small-0.0",
    "small-30.0",
    "blocks-30.0",
    "in parts--3.0",
    "kept--3.0",
    "kept-0.0",
    "kept-30.0",
)
@pytest.mark.parametrize("mu", [-3.0, 0.0, 30.0])
def test_definite_matrices_have_no_negative_eigenvalue(stored, mu):
    layout, nonzeros, dense = matrix_of("plain", stored, duration=9.0)
    shift = mu * np.max(np.abs(dense))
    moved = nonzeros + diagonal(layout, np.full(layout.size, shift))
    lowest = np.linalg.eigvalsh(dense)[0] + shift
    assert Factors(layout, moved).definite() == (lowest > 0)
    assert (negative_eigenvalues(layout, moved) == 0) == (lowest > 0)


@pytest.mark.quick(
    "small-2.0-plain",
    "small-9.0-plain",
    "blocks-9.0-plain",
    "sparse-2.0-plain",
    "sparse-9.0-plain",
    "kept-2.0-plain",
    "kept-2.0-sphere",
    "kept-9.0-plain",
)
@pytest.mark.parametrize("kind", ["plain", "sphere"])
@pytest.mark.parametrize("duration", [2.0, 9.0])
def test_inertia_is_that_of_the_dense_eigenvalues(kind, stored, duration):
    layout, nonzeros, dense = matrix_of(kind, stored, duration)
    values = np.linalg.eigvalsh(dense)
    assert np.min(np.abs(values)) > 1e-8 * np.max(np.abs(values))  # the count is determined
    assert negative_eigenvalues(layout, nonzeros) == np.sum(values < 0)


@ONE_OF_EACH
@pytest.mark.parametrize("kind", KINDS)
def test_singular_matrices_are_refused(kind, stored):
    layout, nonzeros, _ = matrix_of(kind, stored)
    row, col = (
        layout.blocks.targets if layout.storage == "blocks" else (layout.kkt.row, layout.kkt.col)
    )
    empty = np.where((row == 0) | (col == 0), 0.0, nonzeros)
    with pytest.raises(np.linalg.LinAlgError):
        Factors(layout, empty).solve(np.ones(layout.size))


def test_matrices_that_are_not_finite_are_refused(stored):
    layout, nonzeros, _ = matrix_of("plain", stored)
    for bad in (np.nan, np.inf):
        broken = nonzeros.copy()
        broken[3] = bad
        with pytest.raises(np.linalg.LinAlgError, match="not finite"):
            Factors(layout, broken)


@pytest.mark.quick(
    "small-plain",
    "blocks-plain",
    "in parts-plain",
    "sparse-plain",
    "sparse-sphere",
    "sparse-drag",
    "kept-plain",
    "kept-drag",
)
@pytest.mark.parametrize("kind", KINDS)
def test_a_factorization_outlives_the_next_one_of_its_layout(kind, stored):
    layout, nonzeros, dense = matrix_of(kind, stored)
    first = Factors(layout, nonzeros)
    Factors(layout, 2 * nonzeros).solve(np.ones(layout.size))
    known = np.linalg.solve(dense, np.ones(layout.size))
    assert np.allclose(first.solve(np.ones(layout.size)), known, rtol=1e-8)


def test_blocks_that_are_singular_do_not_make_the_matrix_so():
    # x'' = -x on one element of half a period: its own ends are conjugate, the whole path's not.
    oscillator = systems.oscillator()
    mesh = Mesh(np.r_[0.0, np.pi, np.pi + np.linspace(0.2, 1.0, 5)], 24)
    problem = Problem(oscillator, Event(0, 1), Event(np.pi + 1, 0.3))
    tr = Transcription(problem, mesh, np.ones(1))
    assert tr.layout.storage == "blocks"
    z = np.zeros(tr.layout.size)
    factors = Factors(tr.layout, tr.kkt(z))
    step = factors.solve(tr.residual(z))
    # The motion with q(0) = 1 and q(pi + 1) = 0.3: q(pi) = -1 whatever its velocity.
    amplitude = (0.3 - np.cos(np.pi + 1)) / np.sin(np.pi + 1)
    q = np.cos(mesh.nodes) + amplitude * np.sin(mesh.nodes)
    assert np.max(np.abs(tr.coordinates(z - step)[:, 0] - q)) < 1e-9


@ONE_OF_EACH
@pytest.mark.parametrize("kind", KINDS)
def test_a_solution_has_the_sign_of_its_right_hand_side(kind, stored):
    """And its size: how often it is refined, and whether it is, does not depend on either."""
    layout, nonzeros, _ = matrix_of(kind, stored)
    right = np.abs(np.random.default_rng(5).normal(size=layout.size))
    found = [Factors(layout, nonzeros).solve(c * right) for c in (1.0, -1.0, 2.0**40)]
    same_bits(found[0], -found[1], because="rounding knows no sign")
    same_bits(found[0], found[2] / 2.0**40, because="powers of two round nothing")


# -- closed paths, rows that are not in force, and borders -------------------------------------


def alike(q, v, t):
    x, y, z = q
    forces = (x - y) ** 4 + (x - z) ** 4 + (y - z) ** 4 - np.cos(np.pi * t) * (x + y + z)
    return ((1 + (x * y * z) ** 2) * (v[0] ** 2 + v[1] ** 2 + v[2] ** 2) - forces) / 2


def contact(kind, mesh):
    """Return the question of a path that is in contact with one surface longer than another."""
    system = System(alike, list("xyz"), obstacle=lambda q, t: [sphere(q, t), q[1] - q[2]])
    problem = Problem(system, Event(0, [0, 0, -1]), Event(2, [1, 1, 0.5]))
    b = mesh.boundaries
    return Held(problem, (Arc(0, b[2], b[-2]), Arc(1, b[1], b[-1])))


def closing(kind, **arguments):
    system = System(alike, list("xyz"), **KINDS[kind])
    start = arguments.pop("start", [None] * 3)
    return Problem(system, Event(0, start), Periodic(2, **arguments))


SHAPES = {
    "open": lambda kind, mesh: Problem(
        System(alike, list("xyz"), **KINDS[kind]), Event(0, [0, None, 0]), Event(2, [1, 1, 1])
    ),
    "closed": lambda kind, mesh: closing(kind, advance=[0.3, 0, 0]),
    "begun": lambda kind, mesh: closing(kind, start=[None, 0.5, None]),
    "relabelled": lambda kind, mesh: closing(kind, relabel=list("yzx")),
    "contact": contact,
}


def matrix_with(monkeypatch, shape, kind, lengths=(0.7, 1.3, 2.0), border=(), elements=12):
    """Return layout, nonzeros and the dense matrix, from parts stored in the other way."""
    mesh = Mesh(np.linspace(0, 2, elements + 1), 1 + np.arange(elements) % 3)
    problem, sides = SHAPES[shape](kind, mesh), []
    for inner in (0, 60):
        monkeypatch.setattr("actionopt.discrete.matrices.layout.BLOCK_SIZE", inner)
        problem.system.layouts.clear()
        tr = Transcription(problem, mesh, np.array(lengths))
        z = np.random.default_rng(elements).uniform(-1, 1, tr.layout.size)
        sides.append((tr.layout, tr.kkt(z)))
    (sparse, entries), (layout, nonzeros) = sides
    assert sparse.storage == "sparse" and layout.storage == "blocks"
    dense = full(sparse, entries)
    for k in border:  # one beside the other
        edges = np.random.default_rng(7).normal(size=(2, len(dense), k))
        B, C, D = edges[0], edges[0].T if kind != "drag" else edges[1].T, np.eye(k)
        layout, nonzeros = border_matrix(layout, nonzeros, B, C, D)
        dense = np.block([[dense, B], [C, D]])
    return layout, nonzeros, dense


@pytest.fixture
def in_blocks(monkeypatch):
    """Store all matrices in blocks that may be, and make none of them full."""
    for name, value in (("layout.FILLED", 1.0), ("layout.SLIM", 0), ("layout.FULL_SIZE", 0)):
        monkeypatch.setattr(f"actionopt.discrete.matrices.{name}", value)
    monkeypatch.setattr("actionopt.discrete.matrices.blocks.PLACES_AT_ONCE", 4)
    monkeypatch.setattr("actionopt.discrete.matrices.blocks.FULL_SIZE", 12)
    return monkeypatch


CASES = [(shape, "plain") for shape in SHAPES]
CASES += [(shape, kind) for shape in ("open", "closed", "begun") for kind in ("sphere", "drag")]


@pytest.mark.quick("begun-plain", "relabelled-plain")
@pytest.mark.parametrize(("shape", "kind"), CASES)
def test_blocks_of_any_path_with_a_border(in_blocks, shape, kind):
    """Nonzeros, products, solutions and inertia, against a matrix put together sparsely."""
    for elements, border in ((2, ()), (6, (1, 2)), (9, (2,))):
        layout, nonzeros, dense = matrix_with(
            in_blocks, shape, kind, border=border, elements=elements
        )
        size = np.max(np.abs(dense))
        z = np.random.default_rng(2).normal(size=layout.size)
        assert np.max(np.abs(product(layout, nonzeros, z) - dense @ z)) <= 1e-12 * size
        assert np.max(np.abs(full(layout, nonzeros) - dense)) <= 1e-13 * size
        factors = Factors(layout, nonzeros)
        assert np.max(np.abs(dense @ factors._condensed_blocks.solve(z) - z)) <= 1e-8
        if kind != "drag":
            assert np.max(np.abs(dense - dense.T)) <= 1e-13 * size
            assert factors.negative() == np.sum(np.linalg.eigvalsh(dense) < 0)


LARGE = [("open", "plain"), ("open", "sphere"), ("open", "drag"), ("contact", "plain")]


@pytest.mark.quick("open-sphere", "open-drag")
@pytest.mark.parametrize(("shape", "kind"), LARGE)
def test_large_elements_keep_what_couples_two_nodes_by_itself(in_blocks, shape, kind):
    in_blocks.setattr("actionopt.discrete.matrices.blocks.AT_HAND", 1)
    found = []
    for few in (0.0, 2.0):
        in_blocks.setattr("actionopt.discrete.matrices.layout.FEW_ACROSS", few)
        layout, nonzeros, _ = matrix_with(in_blocks, shape, kind, elements=6)
        assert (layout.blocks.across is not None) == (few > 0)
        test_blocks_of_any_path_with_a_border(in_blocks, shape, kind)
        by = np.random.default_rng(3).uniform(0.5, 2.0, layout.size)
        ends = np.random.default_rng(4).normal(size=(2, layout.blocks.width))
        scaled = layout.blocks.rescale(nonzeros, by), layout.blocks.diagonal(by)
        matrices = [full(layout, x) for x in (nonzeros, *scaled)]
        found.append([*matrices, layout.blocks.of_ends(nonzeros, ends)])
    for one, other in zip(*found, strict=True):
        assert np.max(np.abs(one - other)) <= 1e-13 * np.max(np.abs(one))


@pytest.mark.quick("small", "blocks", "in parts", "sparse", "kept")
def test_the_inertia_where_rows_of_constraints_are_small(stored):
    """D K D has as many negative eigenvalues as K, for any D (Sylvester)."""
    size, (layout, nonzeros, dense) = 1e-32, matrix_of("sphere", stored)
    rows = np.arange(layout.size) >= layout.unknowns
    scale = np.where(rows[:, None] != rows, size, 1.0)
    pattern = layout.kkt
    if layout.storage == "blocks":
        small = layout.blocks.rescale(nonzeros, np.where(rows, size, 1.0))
        assert np.allclose(full(layout, small), scale * dense, rtol=1e-12, atol=0)
    else:
        small = nonzeros * scale[pattern.row, pattern.col]
    assert Factors(layout, small).negative() == np.sum(np.linalg.eigvalsh(dense) < 0)
    B = np.random.default_rng(7).normal(size=(layout.size, 2))
    dense = np.block([[dense, B], [B.T, -np.eye(2)]])
    B = np.where(rows, size, 1.0)[:, None] * B
    bordered = border_matrix(layout, small, B, B.T, -np.eye(2))
    assert Factors(*bordered).negative() == np.sum(np.linalg.eigvalsh(dense) < 0)


@pytest.mark.parametrize("border", [(), (2,)], ids=str)
@pytest.mark.parametrize("kind", ["plain", "sphere"])
def test_a_closed_path_whose_coordinates_differ_much_in_size(in_blocks, kind, border):
    """The digits of a coordinate that hardly moves are not lost among those of the others."""
    layout, nonzeros, dense = matrix_with(in_blocks, "closed", kind, (1.0, 1e-9, 1e-4), border)
    diagonal = np.abs(np.diag(dense))
    unit = 1 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    unit[layout.unknowns : layout.size - layout.border] *= 1e3  # rows of constraints
    even = unit[:, None] * dense * unit
    right = np.random.default_rng(2).normal(size=layout.size) / unit
    known = np.linalg.solve(even, unit * right)
    found = Factors(layout, nonzeros).solve(right) / unit
    assert np.max(np.abs(found - known)) <= 1e-14 * np.linalg.cond(even) * np.max(np.abs(known))


@pytest.mark.parametrize("kind", KINDS)
def test_a_sparse_matrix_with_a_border(monkeypatch, kind):
    monkeypatch.setattr("actionopt.discrete.matrices.layout.BLOCK_SIZE", 0)
    monkeypatch.setattr("actionopt.discrete.matrices.layout.FILLED", 1.0)
    layout, nonzeros, dense = matrix_of(kind, ("sparse", 12))
    edges = np.random.default_rng(7).normal(size=(2, layout.size, 2))
    layout, nonzeros = border_matrix(layout, nonzeros, edges[0], edges[1].T, np.eye(2))
    dense = np.block([[dense, edges[0]], [edges[1].T, np.eye(2)]])
    right = np.random.default_rng(3).normal(size=layout.size)
    monkeypatch.delattr("casadi.ldl")  # kept factors, which take five times as long
    factors = Factors(layout, nonzeros)
    assert np.max(np.abs(dense @ factors.solve(right) - right)) <= 1e-9 * np.max(np.abs(dense))
    assert factors._direct is not None  # nothing full was made


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("kind", ["plain", "sphere"])
def test_the_inertia_of_a_sparse_matrix_with_a_border(monkeypatch, kind, sign):
    monkeypatch.setattr("actionopt.discrete.matrices.layout.BLOCK_SIZE", 0)
    monkeypatch.setattr("actionopt.discrete.matrices.layout.FILLED", 1.0)
    layout, nonzeros, dense = matrix_of(kind, ("sparse", 12))
    B, D = np.random.default_rng(7).normal(size=(layout.size, 3)), sign * np.eye(3)
    layout, nonzeros = border_matrix(layout, nonzeros, B, B.T, D)
    dense = np.block([[dense, B], [B.T, D]])
    assert Factors(layout, nonzeros).negative() == np.sum(np.linalg.eigvalsh(dense) < 0)


@pytest.mark.parametrize("name", ["small", "blocks"])
def test_several_right_hand_sides_are_solved_as_one_is(name):
    layout, nonzeros, dense = matrix_of("plain", (name, STORED[name][0]))
    right = np.random.default_rng(3).standard_normal((layout.size, 4))
    alone = np.linalg.solve(dense, right)
    found = Factors(layout, nonzeros).solve_many(right)
    assert np.abs(found - alone).max() <= 1e-9 * np.abs(alone).max()


@pytest.mark.parametrize("count", [1, 3])
def test_columns_of_a_sparse_matrix_are_solved_at_once(monkeypatch, count):
    monkeypatch.setattr("actionopt.discrete.matrices.layout.BLOCK_SIZE", 0)
    monkeypatch.setattr("actionopt.discrete.matrices.layout.FILLED", 1.0)
    layout, nonzeros, dense = matrix_of("plain", ("sparse", 12))
    right = np.random.default_rng(3).standard_normal((layout.size, count))
    found, exact = SparseFactors(layout, nonzeros).solve(right), np.linalg.solve(dense, right)
    assert found.shape == right.shape
    assert np.abs(found - exact).max() <= 1e-9 * np.abs(exact).max()


def test_matrices_of_casadi_have_the_numbers_that_are_given():
    matrices, values = Matrices(ca.Sparsity.banded(5, 1)), np.arange(13.0)
    found = [matrices.of(factor * values) for factor in (1.0, 2.0)]
    assert [x.nonzeros() for x in found] == [values.tolist(), (2 * values).tolist()]
    assert found[0].sparsity() == ca.Sparsity.banded(5, 1)


def test_a_matrix_near_another_is_solved_by_its_factors():
    ends = Event(0.0, [0.1] * 3), Event(0.5, [0.2] * 3)
    at = solve(Problem(systems.links(3), *ends)).discrete
    first, other = at.tr.kkt(at.z), at.tr.kkt(1.001 * at.z)
    near = Factors(at.tr.layout, first).near(other)
    right = np.random.default_rng(0).standard_normal(at.z.size)
    np.testing.assert_allclose(full(at.tr.layout, other) @ near.solve(right), right, atol=1e-9)
    assert (near._near is None) == at.tr.layout.small  # nor has it been factorized


@pytest.mark.parametrize("kind", ["free", "sphere"])
def test_what_is_inside_elements_is_solved_for_element_by_element(monkeypatch, kind):
    """Elements of one degree share a pattern; where elements meet nothing moves."""
    monkeypatch.setattr("actionopt.discrete.matrices.layout.BLOCK_SIZE", 0)
    system = System(springs, list("xyz"), constraint=sphere if kind == "sphere" else None)
    problem = Problem(system, Event(0, [0, 0, 0]), Event(1, [1, 1, 1]))
    tr = Transcription(problem, Mesh(np.linspace(0, 1, 5), [3, 4, 3, 4]), np.ones(3))
    layout = tr.layout
    random = np.random.default_rng(0)
    nonzeros, right = (
        tr.kkt(random.uniform(-1, 1, layout.size)),
        random.normal(size=(layout.size, 2)),
    )
    inside = ~np.isin(np.r_[layout.free // 3, layout.row_node], layout.offsets)
    found, known = solve_inside(layout, nonzeros, right), np.zeros_like(right)
    known[inside] = np.linalg.solve(full(layout, nonzeros)[np.ix_(inside, inside)], right[inside])
    np.testing.assert_allclose(found, known, rtol=1e-6, atol=1e-6 * np.abs(known).max())
    inner = [x.analysed.sparsity().nnz() for x in layout.inside_solvers.values()]
    assert sum(inner) < layout.kkt.nnz / 2


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("duration", [0.5, 8.0])
def test_the_inertia_of_a_small_matrix_with_a_border(monkeypatch, duration, sign):
    layout, nonzeros, dense = matrix_of("plain", ("small", 2), duration)
    definite = np.linalg.eigvalsh(dense)[0] > 0
    B, D = np.random.default_rng(7).normal(size=(layout.size, 3)), 50 * sign * np.eye(3)
    dense = np.block([[dense, B], [B.T, D]])
    layout, nonzeros = border_matrix(layout, nonzeros, B, B.T, D)
    asked = []
    signs = lambda A: asked.append(A) or negative_signs(A)  # noqa: E731
    monkeypatch.setattr("actionopt.discrete.matrices.factors.negative_signs", signs)
    assert Factors(layout, nonzeros).negative() == np.sum(np.linalg.eigvalsh(dense) < 0)
    assert len(asked[0]) == (3 if definite else len(dense))  # the eigenvalues of the border


def test_a_pattern_is_analysed_once_for_any_number_of_right_hand_sides(monkeypatch):
    monkeypatch.setattr("actionopt.discrete.matrices.layout.BLOCK_SIZE", 0)
    monkeypatch.setattr("actionopt.discrete.matrices.layout.FILLED", 1.0)
    layout, nonzeros, dense = matrix_of("plain", ("sparse", 5))
    right = np.random.default_rng(3).normal(size=(layout.size, 3))
    kept = SparseFactors(layout, nonzeros)
    for count in (1, 2, 3):
        known = np.linalg.solve(dense, right[:, :count])
        np.testing.assert_allclose(kept.solve(right[:, :count]), known, rtol=1e-9)
    analysed = {id(x.analysed) for k, x in layout.solvers.items() if k.startswith("ldl")}
    assert len(analysed) == 1
