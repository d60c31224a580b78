"""What kind of stationary point a path is: Morse index, and the lowest modes of d2S.

The index is the number of independent variations that lower the action. It is counted, not
computed from eigenvalues: the signs of the pivots that eliminate the path element by element
(`second_variation.condense`). Two counts at shifts -tau and +tau of the quadratic form

    d2S[eta] - mu int eta'.L_vv eta' dt

enclose the eigenvalues mu that are zero for all that can be known. These mu are numbers without
units, at most a few and accumulating at 1: 1 - (w T / k pi)^2, k = 1, 2, ... for an oscillator.
Of a closed path the variations that close are counted, eta(t1) = eta(t0): a constant one has no
rate, and int eta.L_vv eta dt / T^2 is added to the form beside mu.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import casadi as ca
import numpy as np

from actionopt.analysis.jacobi import polished, resolved
from actionopt.analysis.second_variation import Form, check_legendre, condense
from actionopt.discrete.path import Path
from actionopt.tools.checks import numbers
from actionopt.tools.types import Array, NDInt

if TYPE_CHECKING:
    from actionopt.analysis.solution import Solution

RESOLUTION = 1e-6  # of the Jacobi fields; eigenvalues converge twice as fast
POLISHED = 1e-10  # of the path as well, where its error leaves a sign open
TOLERANCE = 1e-8  # least |mu| that has a sign
LOOSEST = 1e-2  # |mu| moved by a path whose error is not known
ERROR_GAIN = 10.0  # |mu| moved by an error of the path, for coefficients of order one
DENSE = 600  # free variations up to which all eigenvalues are computed at once
SWEEPS = 200


@dataclass(frozen=True)
class Inertia:
    """Numbers of negative and of vanishing eigenvalues of d2S relative to its kinetic part.

    Attributes
    ----------
    index : int
        Eigenvalues mu < -tolerance: the Morse index.
    nullity : int
        Eigenvalues |mu| <= tolerance: variations to which neither sign can be given.
    smallest : float or None
        The smallest |mu|, where it is below the tolerance.
    tolerance : float
        1e-8, or ten times the path's own error estimate where that is larger and leaves no sign
        open, or where the path cannot be improved.
    """

    index: int
    nullity: int
    smallest: float | None
    tolerance: float

    @property
    def kind(self) -> Literal["minimum", "saddle", "degenerate"]:
        """What the action is at the path, among its near neighbours."""
        if self.nullity:
            return "degenerate"
        return "saddle" if self.index else "minimum"


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
        Units of the coordinates in the norm.
    """

    eigenvalues: Array
    modes: tuple[Path, ...]
    inertia: Inertia
    units: Array


def inertia(solution: Solution, *, tolerance: float | None = None) -> Inertia:
    """Return the index and the nullity of a solution's second variation.

    Ten times the path's error is how far an eigenvalue may be off. Where that leaves signs open,
    the path is improved and they are counted again, so that "degenerate" is said of the problem
    and not of the tolerance its path was solved to. `tolerance` replaces all this.

    The nullity is the dimension of the family of paths between the same ends, to first order.

    Raises ValueError for non-conservative forces, where L is not convex in the velocities, along a
    path through a singularity, or where the constraints are not independent.

    References
    ----------
    Gelfand and Fomin, *Calculus of Variations* (1963), sections 24-29; Milnor, *Morse Theory*
    (1963), section 15.
    """
    form = resolved(solution, RESOLUTION)
    if tolerance is not None:
        return inertia_of(form, tolerance)
    error = np.fmin(solution.error, 1.0)  # unknown ones are not finite
    found = inertia_of(form, float(np.clip(ERROR_GAIN * error, TOLERANCE, LOOSEST)))
    if found.nullity and found.tolerance > TOLERANCE:
        with suppress(ValueError):  # a path that is none may be resolved on no mesh
            form = polished(solution, POLISHED, found.nullity)
            return inertia_of(form) if form is not None else found
    return found


def inertia_of(form: Form, tolerance: float = TOLERANCE) -> Inertia:
    """Return the index and the nullity of a discrete second variation."""
    if not form.freedom:
        return Inertia(0, 0, None, tolerance)
    check_legendre(form)

    def below(mu: float) -> int:
        return condense(form, form.shifted(kinetic=mu)).negative

    index = below(-tolerance)
    nullity = below(tolerance) - index
    if not nullity:
        return Inertia(index, 0, None, tolerance)
    low, high = 1e-17, tolerance  # the smallest |mu|, to a tenth of itself
    while high > 1.1 * low and high > 1e-16:
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if below(middle) > below(-middle) else (middle, high)
    return Inertia(index, nullity, high, tolerance)


def morse_index(solution: Solution) -> int:
    """Return the number of independent variations that lower the action; 0 is a minimum."""
    return inertia(solution).index


def kind(solution: Solution) -> Literal["minimum", "saddle", "degenerate"]:
    """Return what the action is at the path: weak minimum, saddle, or not to be told."""
    return inertia(solution).kind


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
        As `inertia` does, or for a count below one or units that are not positive.
    """
    n, asked = solution.problem.system.n, numbers(units, "the units")
    whole = isinstance(count, (int, np.integer)) and count >= 1
    if not whole or asked.shape not in ((), (1,), (n,)) or not np.all(asked > 0):
        raise ValueError(
            f"expected a whole count >= 1 and positive units, one or {n}, found count = {count!r}, "
            f"units = {units!r}"
        )
    given = np.broadcast_to(asked, (n,))
    found = inertia(solution)
    form = resolved(solution, RESOLUTION / 100, units=given)
    values, vectors = lowest(form, count)
    nodes = np.zeros((len(form.basis), form.freedom, len(values)))
    nodes.reshape(-1, len(values))[_free(form)] = vectors
    if form.closed:
        nodes[-1] = nodes[0]
    eta = given[:, None] * np.einsum("knr,krc->knc", form.basis, nodes)
    mesh = form.tr.mesh
    modes = tuple(Path(mesh, eta[:, :, i].T) for i in range(len(values)))
    return SecondVariation(values, modes, found, given)


def lowest(form: Form, count: int) -> tuple[Array, Array]:
    """Return the lowest eigenvalues (count,) and vectors (free, count) of d2S in the L2 norm.

    The vectors hold the free coordinates of all nodes' variations, node by node.
    """
    free = _free(form)
    count = min(count, free.size)
    rows, cols, entries, mass = _assembled(form, free)
    scale = 1 / np.sqrt(mass)
    entries = entries * scale[rows] * scale[cols]
    if free.size <= DENSE:
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


def _assembled(form: Form, free: NDInt) -> tuple[NDInt, NDInt, Array, Array]:
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
        keep = (mine[:, None] >= 0) & (mine >= 0)
        keys.append(key[keep])
        parts.append(E[keep])
    if form.closed:
        mass[:r] += mass[K * r - r :]
    unique, slots = np.unique(np.concatenate(keys), return_inverse=True)
    entries: Array = np.bincount(slots, np.concatenate(parts)).astype(float)
    return unique % free.size, unique // free.size, entries, mass[free]


def _subspace(form: Form, matrix: ca.DM, count: int) -> tuple[Array, Array]:
    """Return the lowest eigenpairs by inverse iteration with a block of vectors.

    The shift lies below the spectrum, which the pivots' signs tell, so that the matrix is
    positive definite and its factorization needs no pivoting.
    """
    size = matrix.shape[0]
    block = np.random.default_rng(0).standard_normal((size, min(2 * count + 6, size)))
    gap = float(np.abs(np.asarray(form.tr.action_unit))) / form.tr.problem.duration
    gap /= float(np.median(form.units / form.tr.lengths)) ** 2
    while condense(form, form.shifted(mass=-gap)).negative:
        gap *= 4
    shifted = matrix + gap * ca.DM.eye(size)
    solver = ca.Linsol("ldl", "ldl", shifted.sparsity())
    solver.sfact(shifted)
    solver.nfact(shifted)
    values = np.full(count, np.inf)
    for _ in range(SWEEPS):
        block, _ = np.linalg.qr(np.asarray(solver.solve(shifted, ca.DM(block))))
        ritz, turn = np.linalg.eigh(block.T @ np.asarray(matrix @ ca.DM(block)))
        block = block @ turn
        settled = np.max(np.abs(ritz[:count] - values)) < 1e-13 * (np.abs(ritz[count - 1]) + gap)
        values = ritz[:count]
        if settled:
            break
    return values, block[:, :count]
