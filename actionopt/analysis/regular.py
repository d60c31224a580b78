"""The index of a path at which no eigenvalue of the second variation is near zero.

Then one factorization of the KKT matrix [d2S, G'; G, 0] tells it, which has one negative eigenvalue
for each row besides (J. Nocedal and S. J. Wright, *Numerical Optimization* (2nd ed. 2006), theorem
16.3): work and memory are those of a step of Newton's method. How near zero an eigenvalue is, and
what round-off has made of the factors, inverse iteration tells. Where a sign may be open, or the
variations are not simply those between two events, nothing is said: `index` has the rest.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from actionopt.analysis.jacobi import FIELD_ROUNDS, coefficients_left_out, refine_where, tails
from actionopt.analysis.second_variation import check_independent, couples_at_rest, normals
from actionopt.discrete.blocks import Condensed
from actionopt.discrete.discrete_path import DiscretePath
from actionopt.discrete.factors import SparseFactors, factorize_part, product
from actionopt.mechanics.held import Held
from actionopt.mechanics.problem import diagonal
from actionopt.tools.types import EPS, Array

# What a mesh may leave out of Jacobi fields, the root of how far eigenvalues are off, and of the
# coefficients of d2S, which is as far: both far below `CLEARLY` tolerances. Derived.
FIELDS, COEFFICIENTS = 1e-4, 1e-6
# Ad hoc. Solutions between random ends of an element: each has a part of all Jacobi fields there.
RANDOM_FIELDS = 4
LOWEST_STEPS = 3  # of inverse iteration: at each, what is near zero grows by its inverse
EVEN_UNITS = 10.0  # how far units of coordinates may be from those of equal inertia
CLEARLY = 10.0  # times the tolerance: an eigenvalue so far from zero has a sign
LEFT_OF_LOAD = 1e-2  # of a right side, what the factors may leave of it in the lowest mode


def regular_index(first: DiscretePath, error: float, tolerance: float) -> int | None:
    """Return the index of a path known to `error`, or None where it is not told so easily.

    Or where an eigenvalue |mu| is near `tolerance`, 1e-5 or more. Raises ValueError where the
    constraints are not independent, or along a path through a singularity.
    """
    if not _is_plain(first):
        return None
    at = first = _in_even_units(first)
    for _ in range(FIELD_ROUNDS):
        tr = at.tr
        if not _is_convex(at):
            return None
        check_independent(at, tr.lengths, error)
        try:
            matrix = tr.kkt(at.z)
            blocks = Condensed(tr.layout.blocks, matrix) if tr.layout.storage == "blocks" else None
            tail = tails(tr.mesh, _fields(at, matrix, blocks))
        except np.linalg.LinAlgError:
            return None
        if not np.isfinite(tail).all():
            return None
        tail = np.maximum(tail, FIELDS / COEFFICIENTS * coefficients_left_out(at))
        mesh = refine_where(tr.mesh, tail, FIELDS)
        if mesh is None:
            factors = blocks or SparseFactors(tr.layout, matrix)
            if not _is_clear(at, matrix, factors.solve, tolerance):
                return None
            return factors.negative() - tr.layout.rows
        at = first.on(mesh, first.multipliers(mesh.nodes))
    return None


def _in_even_units(at: DiscretePath) -> DiscretePath:
    """Return the path in units in which all coordinates have much the same inertia.

    In others round-off of those of large equations would hide the others' signs.
    """
    tr = at.tr
    mass = np.abs(diagonal(tr.problem.system, 2, tr.second(at.x)[2])).mean(axis=0)
    size = tr.lengths * np.sqrt(np.where(mass > 0, mass, 1.0))
    if not size.max() > EVEN_UNITS * size.min():
        return at
    units = tr.lengths * (size.max() / size)
    return DiscretePath.of(tr.problem, at.path, at.rows_on(at.mesh), units)


def _is_plain(at: DiscretePath) -> bool:
    """Whether variations are those between two events, one of which leaves nothing free."""
    problem, layout = at.problem, at.tr.layout
    n, system = problem.system.n, problem.system
    ends = len(problem.start.pinned), len(problem.end.pinned)
    simple = not (isinstance(problem, Held) or problem.through or any(problem.surfaces))
    return (
        simple
        and max(ends) == n
        and system.m < n
        and layout.unknowns > 0
        and not (layout.closed or at.tr.nodal or system.structure.forced)
        and couples_at_rest(system) is None
    )


def _is_convex(at: DiscretePath) -> bool:
    """Whether L_vv surely is positive definite all along the path."""
    second, C = at.problem.system.pointwise("second"), at.tr.second(at.x)[2]
    row, col = second.sparsity(2)
    own = row == col
    if not np.isfinite(C).all():
        return False
    if own.all():
        pivots = C
    elif at.tr.layout.storage == "sparse":
        return False
    else:
        try:
            L = np.linalg.cholesky(second.full(2, C, symmetric=True))
        except np.linalg.LinAlgError:
            return False
        pivots = np.einsum("kaa->ka", L) ** 2
    size = np.abs(C[:, own]).max(axis=1, keepdims=True)
    return own.sum() == at.problem.system.n and bool((pivots > np.sqrt(EPS) * size).all())


def _fields(at: DiscretePath, matrix: Array, blocks: Condensed | None) -> list[Array]:
    """Return solutions of the linearised equations on each element, (E, d + 1, n c), of size one.

    Between random ends, tangent to the constraints.
    """
    tr, layout = at.tr, at.tr.layout
    system, n = tr.problem.system, tr.problem.system.n
    ends = scattered_numbers(layout.offsets.size * n * RANDOM_FIELDS).reshape(-1, n, RANDOM_FIELDS)
    if system.m:
        t = tr.mesh.boundaries[:, None]
        G = normals(tr.problem, at.Q[layout.offsets], t) * tr.lengths
        ends -= np.linalg.pinv(G) @ (G @ ends)
    if blocks is not None:
        given = np.zeros((len(ends), layout.blocks.width, RANDOM_FIELDS))
        given[:, :n] = ends
        at_ends = [np.stack([given[g.elements], given[g.elements + 1]], 1) for g in layout.groups]
        fields = [x[:, :, :n] for x in blocks.between(at_ends)]
    else:
        whole = _between(at, ends * tr.lengths[:, None], matrix) / tr.lengths[:, None]
        fields = [whole[g.nodes] for g in layout.groups]
    tables = [x.reshape(*x.shape[:2], -1) for x in fields]
    return [x / np.abs(x).max(axis=(1, 2), keepdims=True) for x in tables]


def _between(at: DiscretePath, ends: Array, matrix: Array) -> Array:
    """Return the variations (K, n, c) that are `ends` (N + 1, n, c) between elements, sparsely."""
    tr, layout = at.tr, at.tr.layout
    n, unknowns = ends.shape[1], layout.unknowns
    eta = np.zeros((layout.node_count, *ends.shape[1:]))
    eta[layout.offsets] = ends
    inside = np.ones(layout.node_count, dtype=bool)
    inside[layout.offsets] = False
    keep = inside[np.concatenate([layout.free // n, layout.row_node])]
    if not keep.any():
        return eta
    solve = factorize_part(layout, matrix, keep)
    loads = np.zeros((layout.size, ends.shape[2]))
    loads[:unknowns] = np.stack(
        [tr.free_part(_load(at, eta[:, :, c])) for c in range(ends.shape[2])], axis=1
    )
    found = solve(-loads[keep])
    own = keep[:unknowns]
    places = np.divmod(layout.free[own], n)
    eta[places] = found[: int(own.sum())] * tr.x_unit[own, None]
    return eta


def _load(at: DiscretePath, eta: Array) -> Array:
    """Return the change of dS/dq at all nodes, (K n,), with eta (K, n), zero inside elements."""
    tr, layout = at.tr, at.tr.layout
    second, (_, B, C) = at.problem.system.pointwise("second"), tr.second(at.x)
    local = eta[layout.node_of]
    rate = tr.velocities(local)
    p, force = second.product(2, C, rate, symmetric=True), np.zeros_like(local)
    if B.size:
        p += np.einsum("kab,ka->kb", second.full(1, B), local)
        force = tr.weight * second.product(1, B, rate)
    for g in layout.groups:
        work = g.rule.weighted_derivative.T @ p[g.span].reshape(*g.nodes.shape, -1)
        force[g.span] += work.reshape(-1, eta.shape[1])
    return np.bincount(layout.scatter, force.ravel(), eta.size)


def _is_clear(
    at: DiscretePath, matrix: Array, solve: Callable[[Array], Array], tolerance: float
) -> bool:
    """Whether no eigenvalue is near zero, and the factors tell the sign of the lowest ones."""
    tr, layout = at.tr, at.tr.layout
    kinetic = tr.kinetic(at.z)
    x = np.zeros(layout.size)
    x[: layout.unknowns] = scattered_numbers(layout.unknowns)
    load = product(layout, kinetic, x)
    before = float(x @ load)
    for _ in range(LOWEST_STEPS):
        x = solve(load)
        miss = np.abs(product(layout, matrix, x) - load).max()
        if not miss <= LEFT_OF_LOAD * np.abs(load).max():  # or not a number
            return False
        load = product(layout, kinetic, x)
        size = float(x @ load)
        grown, before = np.sqrt(size / before), size
        if not 0 < grown * CLEARLY * tolerance < 1:
            return False
    return True


def scattered_numbers(count: int) -> Array:
    """Return numbers without a pattern, (count,); numpy's generators take 16 ms to import."""
    return np.cos(np.arange(count) ** 2.0)
