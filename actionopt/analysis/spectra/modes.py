"""The lowest modes of the second variation: the variations in which the action bends least."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Protocol

import casadi as ca
import numpy as np

from actionopt.analysis.quadratic.assembled import AssembledForm, assemble
from actionopt.analysis.quadratic.index import Inertia
from actionopt.analysis.quadratic.jacobi import FIELD_ROUNDS, refine_where, resolve, tails
from actionopt.analysis.quadratic.second_variation import Form, are_units
from actionopt.analysis.quadratic.second_variation import form as form_of
from actionopt.analysis.solution import Solution, question
from actionopt.analysis.spectra.full_form import FORM_ROUNDS, form_until
from actionopt.discrete.matrices.factors import product, read
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.mechanics.question.course import check_whole
from actionopt.tools.blas import one_thread
from actionopt.tools.checks import numbers
from actionopt.tools.immutable import immutable
from actionopt.tools.shown import one_line
from actionopt.tools.types import Array, NDInt

DENSE_EIGENPROBLEM = 600  # free variations up to which all eigenvalues are computed at once; ad hoc
DENSE_MODES = 10  # or so many times the modes that are sought; ad hoc
# Unknowns for each mode that is resolved, at least: two of a half wave. Derived
FEWEST_UNKNOWNS = 2
ASSEMBLED = 300  # free variations from which one sparse matrix takes less time. Measured
SETTLED_VALUES = 1e-10  # of the largest, how far eigenvalues move that have settled; ad hoc
NEARLY_SETTLED = 1e-9  # of the values: steps this small that do not halve are round-off; ad hoc
# Blocks with one shift, and how many more may be needed before another one pays; ad hoc.
FIRST_BLOCKS, KRYLOV_BLOCKS = 6, 6
KRYLOV_ERROR = 1e-13  # of values and shift, how far values move that have settled
# What the mesh leaves out of Jacobi fields, values to its square: beside the path's error. Derived
MODE_RESOLUTION = 1e-5
MODE_TAIL = 1e-4  # last coefficients of modes in their units: values to its square. Measured
MODE_WORK = 1e5  # modes times unknowns: no finer mesh beyond. Ad hoc: about two seconds
SPARE_MODES = 2  # sought beside those that are asked for, which may be as low; ad hoc
RITZ_ERROR = 1e-3  # of the lowest value, how far it may be off then, where values are close; ad hoc
MODE_SHIFTS = 50  # most; ad hoc, it ends by itself after some


@immutable
class SecondVariation:
    """The lowest eigenvalues and modes of the second variation.

    Attributes
    ----------
    eigenvalues : (count,) array
        d2S[eta] for the mode eta, units of action per time and per `units` squared.
    modes : tuple of Path
        eta(t) with int |eta / units|^2 dt = 1, orthogonal to one another; zero where the
        events pin the path.
    inertia : Inertia
        Index and nullity.
    units : (n,) array
        Units of the coordinates in the norm; of those that take each other's place as a path
        closes, the largest.
    """

    eigenvalues: Array
    modes: tuple[Path, ...]
    inertia: Inertia
    units: Array

    __repr__ = one_line


@one_thread
def second_variation(
    solution: Solution, count: int = 6, *, units: Array | float = 1.0
) -> SecondVariation:
    """Return the `count` lowest eigenvalues and modes of d2S on the variations allowed.

    Parameters
    ----------
    solution : Solution
    count : int
        How many; the mesh is refined until it resolves them. Of many it returns those that it
        resolves, where more would take too long.
    units : float or (n,) array
        Units of the coordinates in the norm int |eta / units|^2 dt: one where all coordinates
        have the same unit; a length for each where some are angles.

    Raises
    ------
    ValueError
        As `index.inertia` does, for a count below one or units that are not positive, or where
        round-off hides the signs in these units.
    """
    n, asked = question(solution).system.n, numbers(units, "the units")
    whole = isinstance(count, (int, np.integer)) and count >= 1
    if not whole or not are_units(asked, n):
        raise ValueError(
            f"expected a whole count >= 1 and positive units, one{f' or {n}' * (n > 1)}, found "
            f"count = {count!r}, units = {units!r}"
        )
    given = np.broadcast_to(asked, (n,))
    found = solution.inertia
    if solution.problem.is_course:
        return _on_full_forms(solution, count, given)
    at = solution.discrete
    # No eigenproblem on a mesh that has too few nodes to resolve its modes.
    while 0 < at.tr.layout.unknowns - at.tr.layout.rows < FEWEST_UNKNOWNS * count:
        if count * at.Q.size > MODE_WORK:
            break
        at = _on(solution, refine_where(at.mesh, np.ones(at.mesh.elements), MODE_TAIL))
    for _ in range(FIELD_ROUNDS):
        values, eta, mesh, used, shifts = _on_mesh(at, solution.error, count, given, found)
        low = found.index, found.index + found.nullity + shifts
        if not min(low[0], len(values)) <= np.sum(values < 0) <= low[1]:
            raise ValueError(
                f"expected the signs of the eigenvalues to be those of index {low[0]}, found "
                f"{np.sum(values < 0)} negative: round-off hides them in these units of the "
                "coordinates; give `units=`, of the size of each"
            )
        scaled = eta / used[:, None]
        scaled = scaled / np.abs(scaled).max(axis=(0, 1), initial=0.0)
        tail = _tails_of(mesh, scaled)
        if (finer := refine_where(mesh, tail, MODE_TAIL)) is None:
            break
        if count * scaled[..., 0].size > MODE_WORK:
            shown = [
                _tails_of(mesh, x[..., None]).max() <= MODE_TAIL for x in np.moveaxis(scaled, 2, 0)
            ]
            values = values[: [*shown, False].index(False)]
            break
        at = _on(solution, finer)
    modes = tuple(Path(mesh, eta[:, :, i].T) for i in range(len(values)))
    return SecondVariation(values, modes, found, used)


def _on(solution: Solution, mesh: Mesh | None) -> DiscretePath:
    """Return the path of a solution on another mesh."""
    assert mesh is not None
    return solution.discrete.on(mesh, solution.discrete.multipliers(mesh.nodes))


def _tails_of(mesh: Mesh, eta: Array) -> Array:
    """Return the largest of the last coefficients of variations (K, n, c) on each element, (N,)."""
    return tails(mesh, [eta[g.nodes].reshape(*g.nodes.shape, -1) for g in mesh.groups])


def _on_mesh(
    first: DiscretePath, error: float, count: int, given: Array, found: Inertia
) -> tuple[Array, Array, Mesh, Array, bool]:
    """Return the lowest values and modes (K, n, c) on a mesh at least as fine as that of a path.

    With that mesh, the units and whether a shift of time is among the modes.
    """
    # A mesh for the units of the motion: in others the Jacobi fields may be lost in round-off.
    form = assemble_if_large(first, error, MODE_RESOLUTION, count)
    if form is not None:
        values, vectors = _Assembled(form, given).lowest(count, found.index + found.nullity)
        return values, _variations(form, vectors), form.at.mesh, given, False
    form = form_of(resolve(first, error, MODE_RESOLUTION).at, given, phase=False)
    values, vectors = lowest(form, count)
    nodes = np.zeros((len(form.basis), form.freedom, len(values)))
    nodes.reshape(-1, len(values))[_free(form)] = vectors
    if form.closed:
        nodes[-1] = nodes[0]
    eta = form.units[:, None] * np.einsum("knr,krc->knc", form.basis, nodes)
    shifts = any(term.phase for term in form.tr.nodal)  # of time: they are a mode of their own
    return values, eta, form.at.mesh, form.units, shifts


def _on_full_forms(solution: Solution, count: int, units: Array) -> SecondVariation:
    """Return the lowest modes where L contains accelerations, or through events, by full matrices.

    Elements are halved until the eigenvalues stay what they are.
    """
    problem = solution.problem
    if any(event.t is None for event in problem.original.through):
        check_whole(problem, "a mode of the second variation, a curve of the time,")
    if problem.system.structure.forced:
        form_of(solution.discrete)  # raises
    before = np.zeros(0)
    for rounds in range(FORM_ROUNDS):
        form = form_until(solution, None, rounds)
        values, vectors = form.lowest(units)
        values = values[:count]
        moved = np.abs(values - before[: values.size]).max() if rounds else np.inf
        if moved <= SETTLED_VALUES * np.abs(values).max():
            break
        before = values
    eta = form.variations(vectors[: form.tr.layout.unknowns, : values.size].T)
    modes = tuple(Path(form.tr.mesh, row) for row in eta)
    return SecondVariation(values, modes, solution.inertia, units)


def assemble_if_large(
    first: DiscretePath, error: float, resolution: float, count: int = 1
) -> AssembledForm | None:
    """Return d2S of a path as one matrix, if it is so large that full ones take more.

    For so many modes.
    """
    if first.tr.layout.unknowns - first.tr.layout.rows < max(ASSEMBLED, DENSE_MODES * count):
        return None
    return assemble(first, error, resolution, curves=True)


def lowest(form: Form, count: int) -> tuple[Array, Array]:
    """Return the lowest eigenvalues (count,) and vectors (free, count) of d2S in the L2 norm.

    The vectors hold the free coordinates of all nodes' variations, node by node.
    """
    free = _free(form)
    count = min(count, free.size)
    rows, cols, entries, mass = _assemble(form, free)
    scale = 1 / np.sqrt(mass)
    entries = entries * scale[rows] * scale[cols]
    if free.size <= max(DENSE_EIGENPROBLEM, DENSE_MODES * count):
        matrix = np.zeros((free.size, free.size))
        matrix[rows, cols] = entries
        values, vectors = np.linalg.eigh(matrix)
        return values[:count], scale[:, None] * vectors[:, :count]
    pattern = ca.Sparsity.triplet(free.size, free.size, rows.tolist(), cols.tolist())
    bound = min(
        np.linalg.eigvalsh(E / np.sqrt(m * m[:, None]))[0]
        for E, m in zip(form.elements, form.masses, strict=True)
    )
    values, vectors = _subspace(_Matrix(ca.DM(pattern, entries)), float(bound), count)
    return values, scale[:, None] * vectors


def _free(form: Form) -> NDInt:
    """Return the positions of the variations that the events leave free, all nodes in a row.

    Those of a closed path's last node are the first one's, and have no place of their own.
    """
    K, r = len(form.basis), form.freedom
    if form.closed:
        return np.arange(form.pinned[0], K * r - r)
    return np.r_[form.pinned[0] : K * r - r, K * r - r + form.pinned[1] : K * r]


def _assemble(form: Form, free: NDInt) -> tuple[NDInt, NDInt, Array, Array]:
    """Return rows, columns (by column) and entries of d2S over the free, and the masses there."""
    K, r = len(form.basis), form.freedom
    number = np.full(K * r, -1)
    number[free] = np.arange(free.size)
    if form.closed:
        number[K * r - r :] = number[:r]
    first = form.tr.mesh.offsets * r
    keys, parts, mass = [], [], np.zeros(K * r)
    for e, (E, m) in enumerate(zip(form.elements, form.masses, strict=True)):
        at = np.arange(first[e], first[e + 1] + r)
        mass[at] += m
        mine = number[at]
        key = mine[None, :] * free.size + mine[:, None]
        keep = (mine[:, None] >= 0) & (mine >= 0) & ((E != 0) | np.eye(len(E), dtype=bool))
        keys.append(key[keep])
        parts.append(E[keep])
    if form.closed:
        mass[:r] += mass[K * r - r :]
    unique, slots = np.unique(np.concatenate(keys), return_inverse=True)
    entries: Array = np.bincount(slots, np.concatenate(parts)).astype(float)
    return unique % free.size, unique // free.size, entries, mass[free]


class _Operator(Protocol):
    """A symmetric matrix whose lowest eigenvalues are sought."""

    @property
    def size(self) -> int:
        """The number of rows and columns."""
        ...

    def times(self, block: Array) -> Array:
        """Return the matrix times the columns of a block, (size, c)."""
        ...

    def solver(self, shift: float) -> Callable[[Array], Array] | None:
        """Return what solves with the matrix less `shift`; None if that lowers a variation."""
        ...


class _Matrix:
    """A sparse symmetric matrix."""

    def __init__(self, matrix: ca.DM) -> None:
        self.matrix, self.size, self.unit = matrix, matrix.shape[0], ca.DM.eye(matrix.shape[0])

    def times(self, block: Array) -> Array:
        """Return the matrix times the columns of a block, (size, c)."""
        return read(self.matrix @ ca.DM(block))

    def solver(self, shift: float) -> Callable[[Array], Array] | None:
        """Return what solves with the matrix less `shift`; None if that lowers a variation."""
        factors = ca.ldl(self.matrix - shift * self.unit)
        if (factors[0].full() < 0).any():
            return None
        return lambda block: read(ca.ldl_solve(ca.DM(block), *factors))


@immutable
class _Assembled:
    """An assembled form in a norm, int |eta / units|^2 dt = 1, on what the constraints allow."""

    form: AssembledForm
    units: Array

    @property
    def size(self) -> int:
        """The length of vectors: free coordinates of nodes, times the roots of their masses."""
        return self.form.at.tr.layout.unknowns

    @cached_property
    def masses(self) -> Array:
        """The masses of the unknowns of the equations, (unknowns,)."""
        tr, layout = self.form.at.tr, self.form.at.tr.layout
        node, coordinate = np.divmod(layout.free, layout.width)
        return (
            np.bincount(layout.node_of, tr.weight[:, 0])[node]
            * (tr.x_unit / self.units[coordinate]) ** 2
            / tr.action_unit
        )

    def lowest(self, count: int, index: int) -> tuple[Array, Array]:
        """Return the lowest eigenvalues (count,) and vectors (unknowns, count), `index` below 0."""
        count = min(count, self.size - self.form.at.tr.layout.rows)
        bound = self.form.bound(self.units)
        values, vectors = _subspace(self, bound if index else max(bound, 0.0), count)
        return values, vectors / np.sqrt(self.masses)[:, None]

    def times(self, block: Array) -> Array:
        """Return the matrix times the columns of a block, (size, c)."""
        layout, scale = self.form.at.tr.layout, 1 / np.sqrt(self.masses)[:, None]
        x = np.zeros((layout.size, block.shape[1]))
        x[: self.size] = scale * block
        found = [product(layout, self.form.matrix, column)[: self.size] for column in x.T]
        return scale * np.stack(found, axis=1)

    def solver(self, shift: float) -> Callable[[Array], Array] | None:
        """Return what solves with the matrix less `shift`; None if that lowers a variation."""
        layout, root = self.form.at.tr.layout, np.sqrt(self.masses)[:, None]
        factors = self.form.shifted(shift * self.masses) if shift else self.form.factors
        if factors.negative() > layout.rows:
            return None

        def solve(block: Array) -> Array:
            right = np.zeros((layout.size, block.shape[1]))
            right[: self.size] = root * block
            return root * factors.solve(right)[: self.size]

        return solve


def _variations(form: AssembledForm, vectors: Array) -> Array:
    """Return eta at the nodes, (K, n, c), of vectors (unknowns, c)."""
    tr, layout = form.at.tr, form.at.tr.layout
    eta = np.zeros((layout.node_count * layout.width, vectors.shape[1]))
    eta[layout.free] = tr.x_unit[:, None] / np.sqrt(tr.action_unit) * vectors
    return eta.reshape(layout.node_count, layout.width, -1)


def _subspace(matrix: _Operator, shift: float, count: int) -> tuple[Array, Array]:
    """Return the lowest eigenvalues (count,) and vectors (size, count), by Lanczos's method.

    On the inverse, in blocks, so that equal eigenvalues are told apart. The shift lies below the
    spectrum, which the pivots' signs tell, so that the matrix is positive definite and its
    factorization needs no pivoting. The first one is a guess; it comes nearer where many more
    blocks would be needed to settle the values.

    References
    ----------
    Golub and Underwood, in *Mathematical Software III* (1977), pp. 361-377.
    """
    size = matrix.size
    block = np.random.default_rng(0).standard_normal((size, min(count + SPARE_MODES, size)))
    below, gap, values = -np.inf, abs(shift) or 1.0, np.full(count, np.inf)
    for _ in range(MODE_SHIFTS):
        while (solve := matrix.solver(shift)) is None:
            # The lowest was no Ritz value, or no shift is known to be below it yet.
            shift, gap = max(shift - gap, (shift + below) / 2), 4 * gap
        below = shift
        block, settled = _krylov(solve, block, count, shift)
        del solve  # before the next factors are made
        ritz, turn = np.linalg.eigh(block.T @ matrix.times(block))
        block = block @ turn
        scale, change = np.abs(ritz[:count]).max() + abs(shift), np.abs(ritz[:count] - values).max()
        values = ritz[:count]
        if settled or change < NEARLY_SETTLED * scale:
            break
        shift = max(shift, _nearer(values))
    return values, block[:, :count]


def _nearer(values: Array) -> float:
    """Return a shift below the lowest eigenvalue by about what Ritz values (count,) are apart."""
    return float(2 * values[0] - values[-1] - RITZ_ERROR * abs(values[0]))


def _krylov(
    solve: Callable[[Array], Array], block: Array, count: int, shift: float
) -> tuple[Array, bool]:
    """Return what is lowest, (size, width), in the subspace of a block (size, width) and images.

    And whether the values are settled; the subspace grows as long as they soon will be.
    """
    width = block.shape[1]
    basis = [np.linalg.qr(block)[0]]
    inner, values, move = np.zeros((0, 0)), np.zeros(count), np.inf
    settled = False
    while True:
        new = solve(basis[-1])
        beside = np.concatenate([x.T @ new for x in basis])
        inner = np.block([[inner, beside[: len(inner)]], [beside.T]]) if len(inner) else beside
        inverse, turn = np.linalg.eigh(inner)
        last, values = values, shift + 1 / inverse[: -count - 1 : -1]
        before, move = move, float(np.abs(values - last).max())
        goal, room = KRYLOV_ERROR * (np.abs(values).max() + abs(shift)), len(block) - len(inner)
        ratio = min(move / before, 1.0) if before > 0 else 0.0
        late = len(inner) >= FIRST_BLOCKS * width and move * ratio**KRYLOV_BLOCKS > goal
        late = late and _nearer(values) - shift > (values[0] - shift) / 2
        if settled or late or not room:
            parts = np.split(turn[:, : -width - 1 : -1], range(width, len(inner), width))
            lowest = np.zeros((len(block), width))
            for x, part in zip(basis, parts, strict=True):
                lowest += x @ part
            return lowest, settled
        settled = move < goal  # once more then, as vectors have half the digits of values
        new = new[:, :room]
        for x in 2 * basis:
            new -= x @ (x.T @ new)
        basis.append(np.linalg.qr(new)[0])
