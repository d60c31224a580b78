"""The lowest modes of the second variation: the variations in which the action bends least."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from actionopt.analysis.index import INDEX_RESOLUTION, Inertia
from actionopt.analysis.jacobi import resolve
from actionopt.analysis.second_variation import Form, are_units
from actionopt.analysis.second_variation import form as form_of
from actionopt.analysis.solution import Solution, question
from actionopt.discrete.path import Path
from actionopt.tools.blas import one_thread
from actionopt.tools.checks import numbers
from actionopt.tools.shown import one_line
from actionopt.tools.types import Array, NDInt

DENSE_EIGENPROBLEM = 600  # free variations up to which all eigenvalues are computed at once; ad hoc
NEARLY_SETTLED = 1e-9  # of the values: steps this small that do not halve are round-off; ad hoc
SHIFT_STEPS = 4  # of inverse iteration with one shift: a factorization costs some of them; ad hoc
RITZ_ERROR = 1e-3  # of the lowest value, how far it may be off then, where values are close; ad hoc
SUBSPACE_STEPS = 200  # of inverse iteration, most; ad hoc, it ends by itself in some tens


@dataclass(frozen=True, eq=False)
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
        How many; fewer are returned on a mesh that has fewer.
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
            f"expected a whole count >= 1 and positive units, one or {n}, found count = {count!r}, "
            f"units = {units!r}"
        )
    given = np.broadcast_to(asked, (n,))
    found = solution.inertia
    # A mesh for the units of the motion: in others the Jacobi fields may be lost in round-off.
    fine = resolve(solution.discrete, solution.error, INDEX_RESOLUTION / 100)
    form = form_of(fine.at, given, phase=False)
    values, vectors = lowest(form, count)
    shifts = any(term.phase for term in form.tr.nodal)  # of time: they are a mode of their own
    low = found.index, found.index + found.nullity + shifts
    if not min(low[0], len(values)) <= np.sum(values < 0) <= low[1]:
        raise ValueError(
            f"expected the signs of the eigenvalues to be those of index {low[0]}, found "
            f"{np.sum(values < 0)} negative: round-off hides them in these units of the "
            "coordinates; give `units=`, of the size of each"
        )
    nodes = np.zeros((len(form.basis), form.freedom, len(values)))
    nodes.reshape(-1, len(values))[_free(form)] = vectors
    if form.closed:
        nodes[-1] = nodes[0]
    eta = form.units[:, None] * np.einsum("knr,krc->knc", form.basis, nodes)
    mesh = form.tr.mesh
    modes = tuple(Path(mesh, eta[:, :, i].T) for i in range(len(values)))
    return SecondVariation(values, modes, found, form.units)


def lowest(form: Form, count: int) -> tuple[Array, Array]:
    """Return the lowest eigenvalues (count,) and vectors (free, count) of d2S in the L2 norm.

    The vectors hold the free coordinates of all nodes' variations, node by node.
    """
    free = _free(form)
    count = min(count, free.size)
    rows, cols, entries, mass = _assemble(form, free)
    scale = 1 / np.sqrt(mass)
    entries = entries * scale[rows] * scale[cols]
    if free.size <= DENSE_EIGENPROBLEM:
        matrix = np.zeros((free.size, free.size))
        matrix[rows, cols] = entries
        values, vectors = np.linalg.eigh(matrix)
        return values[:count], scale[:, None] * vectors[:, :count]
    pattern = ca.Sparsity.triplet(free.size, free.size, rows.tolist(), cols.tolist())
    matrix = ca.DM(pattern, entries)
    values, vectors = _subspace(form, matrix, count)
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


def _subspace(form: Form, matrix: ca.DM, count: int) -> tuple[Array, Array]:
    """Return the lowest eigenvalues (count,) and vectors (size, count) by inverse iteration.

    The shift lies below the spectrum, which the pivots' signs tell, so that the matrix is
    positive definite and its factorization needs no pivoting. From step to step it comes nearer.
    """
    size = matrix.shape[0]
    block = np.random.default_rng(0).standard_normal((size, min(2 * count + 6, size)))
    gap = float(np.abs(np.asarray(form.tr.action_unit))) / form.tr.problem.duration
    gap /= float(np.median(form.units / form.tr.lengths)) ** 2
    shift, unit = -gap, ca.DM.eye(size)
    values, last, factors = np.full(count, np.inf), np.inf, None
    for step in range(SUBSPACE_STEPS):
        if step % SHIFT_STEPS == 0:
            if step:
                gap = values[-1] - values[0] + RITZ_ERROR * abs(values[0])
                shift = max(shift, float(values[0] - gap))
            nearer = ca.ldl(matrix - shift * unit)
            while (nearer[0].full() < 0).any():  # the lowest was not among the Ritz values
                gap *= 16
                shift -= gap
                nearer = ca.ldl(matrix - shift * unit)
            factors = nearer
        block, _ = np.linalg.qr(ca.ldl_solve(ca.DM(block), *factors).full())  # type: ignore
        ritz, turn = np.linalg.eigh(block.T @ np.asarray(matrix @ ca.DM(block)))
        block = block @ turn
        scale, change = np.abs(ritz[:count]).max() + abs(shift), np.abs(ritz[:count] - values).max()
        values = ritz[:count]
        if change < 1e-13 * scale or last / 2 < change < NEARLY_SETTLED * scale:
            break
        last = change
    return values, block[:, :count]
