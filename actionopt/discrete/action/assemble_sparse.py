"""Second derivatives scattered: each contribution goes to its place in a sparse matrix.

The contributions of all elements are computed in a fixed order; index arrays of the layout say
where each goes, and what goes to one place is added up.
"""

from __future__ import annotations

import numpy as np

from actionopt.discrete.action.action import Action
from actionopt.tools.blas import by_each
from actionopt.tools.types import Array

NOTHING = np.zeros(0)


def hessian(tr: Action, z: Array) -> Array:
    """Return the upper triangle's nonzeros of the Hessian of S + sum w lam f."""
    return tr.layout.hessian.sum(_curvatures(tr, z)) * tr.hessian_unit


def kkt(tr: Action, z: Array) -> Array:
    """Return the nonzeros of the KKT matrix on the pattern `layout.kkt`."""
    x = z[: tr.layout.unknowns]
    J = tr.jacobian(x) if tr.layout.rows else NOTHING
    F = forcing(tr, x) if tr.problem.system.structure.forced else NOTHING
    return _matrix(tr, hessian(tr, z), J, F)


def kinetic(tr: Action, z: Array) -> Array:
    """Return the nonzeros of its kinetic part."""
    stiff, layout = _stiffness(tr, tr.second(z)[2]), tr.layout
    contributions = np.zeros(layout.hessian.slots.size)
    last = contributions.size
    if layout.system.m and not layout.system.structure.affine_constraint:  # curvatures are behind
        last -= (
            layout.row_nodes.size
            * layout.system.pointwise("constraint_curvature").sparsity(0)[0].size
        )
    contributions[last - stiff.size : last] = stiff
    H = tr.layout.hessian.sum(contributions) * tr.hessian_unit
    J = np.zeros(layout.jacobian.nnz) if layout.rows else NOTHING
    return _matrix(tr, H, J, NOTHING)


def _curvatures(tr: Action, z: Array) -> Array:
    """Return all contributions to the Hessian of S + sum w lam f, one after the other."""
    A, B, C = tr.second(z[: tr.layout.unknowns])
    stiff = tr.memoize_if_constant("contributions", lambda: _stiffness(tr, C))
    nodal = [term.matrix[np.triu_indices(len(term.matrix))] for term in tr.nodal]
    beside = len(tr.layout.nodal) - len(nodal)  # as on surfaces, which are beside the action
    nodal.append(np.zeros(beside * tr.lengths.size * (tr.lengths.size + 1) // 2))
    parts = [*nodal, (tr.weight * A).ravel(), *_mixed_weights(tr, B, diagonal_twice=True), stiff]
    curvature = tr.constraint_curvature(z)
    return np.concatenate(parts if curvature is None else [*parts, curvature.ravel()])


def _stiffness(tr: Action, C: Array) -> Array:
    """Return D' w C D, flattened in the order of `Layout._stiff`."""
    parts = [
        by_each(g.rule.stiffness, C[g.span].reshape(*g.nodes.shape, -1) / half).ravel()
        for g, half in zip(tr.layout.groups, tr.halves, strict=True)
    ]
    return parts[0] if len(parts) == 1 else np.concatenate(parts)


def _mixed_weights(tr: Action, B: Array, diagonal_twice: bool) -> list[Array]:
    """Return w_j D_jl B_j of each degree, flattened in the order of `Layout._mixed_targets`."""
    if not B.size:
        return []
    parts = []
    for g in tr.layout.groups:
        local = B[g.span].reshape(*g.nodes.shape, -1)
        block = g.rule.weighted_derivative[None, :, :, None] * local[:, :, None, :]
        if diagonal_twice:
            rows, cols = tr.problem.system.pointwise("second").sparsity(1)
            k = np.arange(g.rule.degree + 1)
            # An entry on the diagonal receives B and its transpose.
            block[:, k[:, None], k[:, None], np.flatnonzero(rows == cols)] *= 2
        parts.append(block.ravel())
    return parts


def forcing(tr: Action, x: Array) -> Array:
    """Return the nonzeros of the derivative of the virtual work."""
    Fq, Fv = tr.forces(x)
    parts = [(tr.weight * Fq).ravel(), *_mixed_weights(tr, Fv, diagonal_twice=False)]
    F = tr.layout.forcing
    unit = tr.x_unit[F.row] * tr.x_unit[F.col] / tr.action_unit
    return F.sum(np.concatenate(parts)) * unit


def _matrix(tr: Action, H: Array, J: Array, F: Array) -> Array:
    """Return [H + F, J'; J, 0] from the nonzeros of its parts."""
    pattern = tr.layout.kkt
    parts = np.concatenate((H, J, F, np.zeros(1)))[tr.layout.kkt_source]
    return pattern.sum(parts) if tr.problem.system.structure.forced else parts
