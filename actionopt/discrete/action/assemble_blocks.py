"""Second derivatives element by element: the KKT matrix in the blocks of `blocks`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from actionopt.discrete.action.action import Action
from actionopt.discrete.matrices.blocks import Coupled, in_parts
from actionopt.discrete.meshes.mesh import Group
from actionopt.tools.types import Array, NDInt


def kkt(tr: Action, z: Array) -> Array:
    """Return the nonzeros of the KKT matrix in blocks, (`layout.blocks.count`,)."""
    layout, n = tr.layout, tr.problem.system.n
    x = z[: layout.unknowns]
    A, B, C = tr.second(x)
    if tr.order > 1:
        return _of_higher_order(tr, _second(tr, z, A, B, C), x)
    constant = tr.problem.system.structure.constant_mass  # then the kinetic part is kept
    coupled = layout.blocks.across is not None
    if not coupled:
        stiff = tr.memoize_if_constant("blocks", lambda: _stiff(tr, C)) if constant else []
        mass = C if constant else _mass(tr, C)
        slopes = [(_full(tr, "second", 0, A), _full(tr, "second", 1, B), True)]
        if tr.problem.system.structure.forced:
            Fq, Fv = (_full(tr, "force_jacobian", k, F) for k, F in enumerate(tr.forces(x)))
            slopes.append((Fq, Fv, False))
    at_nodes = _constraints(tr, z) if layout.rows else None
    nonzeros = np.zeros(layout.blocks.count)
    elements, between = layout.blocks.split(nonzeros)
    for k, (whole, g) in enumerate(zip(elements, layout.groups, strict=True)):
        if coupled:
            forces = tr.forces(x) if tr.problem.system.structure.forced else None
            _couple(tr, k, whole, C, (A, B), forces)
            if at_nodes is not None:
                whole.nodal[:, 1:-1] += at_nodes[g.nodes[:, 1:-1]]
            continue
        points = g.rule.degree + 1
        whole = whole.reshape(len(whole), points, layout.blocks.width, points, -1)
        for some in in_parts(len(whole), (points * n) ** 2):
            first = g.span.start
            span = slice(first + some.start * points, first + min(some.stop, len(whole)) * points)
            half = tr.halves[k][some]
            # (E, d + 1, d + 1, n, n)
            pairs = stiff[k][some].copy() if constant else _kinetic(g, mass[span], half)
            M = whole[some]
            same = pairs.reshape(len(M), -1, n, n)[:, :: points + 1]  # a node with itself: a view
            for a, b, symmetric in slopes:
                if b is not None:
                    mixed = g.rule.weighted_derivative[:, :, None, None] * b[span].reshape(
                        -1, points, 1, n, n
                    )
                    pairs += mixed
                    if symmetric:
                        pairs += mixed.transpose(0, 2, 1, 4, 3)
                if a is not None:
                    same += (tr.weight[span][:, :, None] * a[span]).reshape(-1, points, n, n)
            M[:, :, :n, :, :n] = pairs.transpose(0, 1, 3, 2, 4)
        if at_nodes is not None:
            inner = np.einsum("ejajb->ejab", whole)[:, 1:-1]  # each node with itself: a view
            inner += at_nodes[g.nodes[:, 1:-1]]
    if layout.closed:
        _close(tr, elements)
    if at_nodes is not None:
        between += at_nodes[layout.offsets]
    for term in tr.nodal:
        between[term.boundary, :n, :n] += term.matrix * np.outer(
            tr.lengths, tr.lengths / tr.action_unit
        )
    return nonzeros


def kinetic(tr: Action, z: Array) -> Array:
    """Return the nonzeros of its kinetic part.

    For a closed path of higher order r, int eta.L_aa eta dt / T^2r is added to it: a constant
    variation has no rate, and the sum is definite.
    """
    layout, n = tr.layout, tr.problem.system.n
    if tr.order > 1:
        C, r = tr.second(z[: layout.unknowns])[2], tr.order
        L = np.zeros((layout.evaluations, r + 1, n, r + 1, n))
        L[:, r, :, r] = tr.problem.system.pointwise("second").full(2, C, symmetric=True)
        if layout.closed:
            L[:, 0, :, 0] = L[:, r, :, r] / tr.mesh.duration ** (2 * r)
        return _of_higher_order(tr, L)
    nonzeros = np.zeros(layout.blocks.count)
    elements, _ = layout.blocks.split(nonzeros)
    C = tr.second(z[: layout.unknowns])[2]
    stiff = _stiff(tr, C) if layout.blocks.across is None else []
    for k, (whole, g) in enumerate(zip(elements, layout.groups, strict=True)):
        if layout.blocks.across is not None:
            _couple(tr, k, whole, C)
            continue
        points = g.rule.degree + 1
        whole = whole.reshape(len(whole), points, layout.blocks.width, points, -1)
        whole[:, :, :n, :, :n] = stiff[k].transpose(0, 1, 3, 2, 4)
    if layout.closed:
        _close(tr, elements)
    return nonzeros


def _couple(
    tr: Action,
    group: int,
    whole: Coupled,
    C: Array,
    slopes: tuple[Array, Array] | None = None,
    forces: Sequence[Array] | None = None,
) -> None:
    """Put second derivatives in large elements of one degree, C alone or the others as well.

    `slopes` are those by q twice and by q and v, `forces` the derivatives of forces by the same.
    """
    g, system = tr.layout.groups[group], tr.problem.system
    (E, points), n, known = g.nodes.shape, system.n, whole.row * tr.layout.blocks.width + whole.col

    def find_pairs(name: str, output: int, values: Array) -> tuple[Array, NDInt, NDInt]:
        row, col = system.pointwise(name).sparsity(output)
        values = values[g.span] * (tr.lengths[row] * tr.lengths[col] / tr.action_unit)
        width = tr.layout.blocks.width
        at, mirrored = (np.searchsorted(known, p) for p in (row * width + col, col * width + row))
        return values.reshape(E, points, -1), at, mirrored

    mass, there, back = find_pairs("second", 2, C)
    pairs = (g.rule.stiffness @ (mass / tr.halves[group])).reshape(E, points, points, -1)
    whole.across[..., there] = whole.across[..., back] = pairs
    for name, given in (("second", slopes), ("force_jacobian", forces)):
        if given is None:
            continue
        a, b = given
        mixed, there, back = find_pairs(name, 1, b)
        mixed = g.rule.weighted_derivative[:, :, None] * mixed[:, :, None]
        whole.across[..., there] += mixed
        if name == "second":
            whole.across[..., back] += mixed.swapaxes(1, 2)
        for e in range(E):
            span = slice(g.span.start + e * points, g.span.start + (e + 1) * points)
            full = _full(tr, name, 0, a[span])
            if full is not None:
                whole.nodal[e, :, :n, :n] += tr.weight[span][:, :, None] * full


def _second(tr: Action, z: Array, A: Array, B: Array, C: Array) -> Array:
    """Return the second derivatives of L by q, v, a, ... twice, (evaluations, r + 1, n, r + 1, n).

    A, B, C are those by (q, v, ...), by these and the highest derivative, and by that twice; what
    forces and those of constraints change by with the same is added.
    """
    x = z[: tr.layout.unknowns]
    n, r, count = tr.problem.system.n, tr.order, tr.layout.evaluations
    second = tr.problem.system.pointwise("second")
    L = np.zeros((count, r + 1, n, r + 1, n))
    L[:, :r, :, :r] = second.full(0, A, symmetric=True).reshape(count, r, n, r, n)
    L[:, :r, :, r] = second.full(1, B).reshape(count, r, n, n)
    L[:, r, :, :r] = L[:, :r, :, r].transpose(0, 3, 1, 2)
    L[:, r, :, r] = second.full(2, C, symmetric=True)
    curvature = tr.constraint_curvature(z)
    if curvature is not None:
        row, col = tr.problem.system.pointwise("constraint_curvature").sparsity(0)
        L[:, 0, row, 0, col] += curvature
        L[:, 0, col[row != col], 0, row[row != col]] += curvature[:, row != col]
    if tr.problem.system.structure.forced:
        F, force = tr.forces(x), tr.problem.system.pointwise("force_jacobian")
        L[:, 0, :, :r] += force.full(0, F[0]).reshape(count, n, r, n)
        L[:, 0, :, r] += force.full(1, F[1])
    return L


def _of_higher_order(tr: Action, L: Array, x: Array | None = None) -> Array:
    """Return the matrix in blocks where L contains accelerations: sum w B_i' L_ij B_j (`element`).

    `second` are the second derivatives as `_second` has them; the constraints' normals at x are
    added, if that is given.
    """
    layout, n, r = tr.layout, tr.problem.system.n, tr.order
    nonzeros = np.zeros(layout.blocks.count)
    elements, _ = layout.blocks.split(nonzeros)
    unit = tr.place_units.reshape(r, n)
    for k, (whole, g) in enumerate(zip(elements, layout.groups, strict=True)):
        shape = layout.shapes[k]
        at = (shape.node * layout.blocks.width + shape.derivative * n)[:, None] + np.arange(n)
        whole[:, at.ravel()[:, None], at.ravel()] = _sum_elements(tr, L, k, shape.stiffness)
        if layout.rows and x is not None:
            m, cols = tr.problem.system.m, layout.G_cols
            row = (shape.node * layout.blocks.width + layout.width + shape.derivative * m)[:, None]
            row, col = (row + layout.G_rows)[:, None], at[:, cols][None]
            weight = tr.row_weight[g.nodes[:, shape.node], shape.derivative]
            G = tr.normals_between(x)[k] / weight[:, :, None, None] / tr.row_units[layout.G_rows]
            G = G * unit[shape.derivative][:, cols][None]
            whole[:, row, col] = whole[:, col, row] = G
    if layout.closed:
        _close(tr, elements)
    return nonzeros


def by_increments(tr: Action, z: Array, shift: float) -> list[Array]:
    """Return the elements' matrices of each degree, (E, (d + 1) n, (d + 1) n), by other unknowns.

    These tell how far each end is from the polynomial that the start of its element makes
    (`Element.derivatives`). The matrices are less `shift` times their kinetic parts.
    """
    A, B, C = tr.second(z[: tr.layout.unknowns])
    L = _second(tr, z, A, B, (1.0 - shift) * C)
    return [
        _sum_elements(tr, L, k, shape.by_increments) for k, shape in enumerate(tr.layout.shapes)
    ]


def _sum_elements(tr: Action, L: Array, group: int, stiffness: list[list[Array]]) -> Array:
    """Return sum w B_i' L_ij B_j of the elements of one degree, (E, (d + 1) n, (d + 1) n)."""
    g, shape, half = tr.layout.groups[group], tr.layout.shapes[group], tr.halves[group][:, 0]
    (E, points), n, r = g.nodes.shape, tr.problem.system.n, tr.order
    M = np.zeros((E, points * points, n * n))
    for i in range(r + 1):
        for j in range(r + 1):
            part = L[g.span, i, :, j].reshape(E, points, n * n)
            if part.any():
                M += stiffness[i][j] @ (part * (half ** (1 - i - j))[:, :, None])
    M = M.reshape(E, points, points, n, n).transpose(0, 1, 3, 2, 4)
    unit = tr.place_units.reshape(r, n)
    scale = shape.scale(half.ravel())[:, :, None] * unit[shape.derivative]
    M = M * scale[:, :, :, None, None] * (scale / tr.action_unit)[:, None, None]
    return M.reshape(E, points * n, points * n)


def _close(tr: Action, elements: list[Array]) -> None:
    """Scale a closed path's last node to the units of the first node's coordinates that it is."""
    ratio = tr.place_units[list(tr.layout.closed)] / tr.place_units
    if (ratio == 1.0).all():
        return
    scale = np.ones(tr.layout.blocks.width)
    scale[: ratio.size] = ratio
    for whole, g in zip(elements, tr.layout.groups, strict=True):
        if g.nodes[-1, -1] == tr.layout.offsets[-1]:
            whole[-1, -scale.size :] *= scale[:, None]
            whole[-1, :, -scale.size :] *= scale


def _stiff(tr: Action, C: Array) -> list[Array]:
    """Return D' w C D for the elements of each degree, (E, d + 1, d + 1, n, n)."""
    mass = _mass(tr, C)
    return [
        _kinetic(g, mass[g.span], half) for g, half in zip(tr.layout.groups, tr.halves, strict=True)
    ]


def _mass(tr: Action, C: Array) -> Array:
    """Return the mass matrices (E, n, n) in the units of the unknowns."""
    full = _full(tr, "second", 2, C)
    assert full is not None  # a Lagrangian without any velocity is refused before
    return full


def _kinetic(g: Group, mass: Array, half: Array) -> Array:
    """Return D' w C D for some elements, (E, d + 1, d + 1, n, n), for C (E (d + 1), n, n)."""
    points, n = g.rule.degree + 1, mass.shape[1]
    local = mass.reshape(-1, points, n * n) / half
    return (g.rule.stiffness @ local).reshape(-1, points, points, n, n)


def _full(tr: Action, function: str, output: int, values: Array) -> Array | None:
    """Return the nonzeros of an output as matrices (E, n, n) in the units of the unknowns."""
    if not values.shape[1]:
        return None
    n = tr.problem.system.n
    key = function, output
    if key not in tr.unfolded:
        of = tr.problem.system.pointwise(function)
        index, there = of.entries(output, symmetric=function == "second" and output != 1)
        unit = there * (tr.lengths[:, None] * tr.lengths / tr.action_unit)
        tr.unfolded[key] = index.ravel(), unit.ravel()
    index, unit = tr.unfolded[key]
    return (values.take(index, 1) * unit).reshape(-1, n, n)


def _constraints(tr: Action, z: Array) -> Array:
    """Return [w lam f_qq, G'; G, 0] at each node, (K, n + m, n + m)."""
    layout, system = tr.layout, tr.problem.system
    f = system.n + system.m
    found = np.zeros((layout.node_count, f, f))
    node, row, col = layout.row_nodes[:, None], layout.G_rows + system.n, layout.G_cols
    # The units of the rows hold the nodes' weights already.
    unit = tr.lengths[col] / tr.row_units[layout.G_rows]
    if layout.partial:
        unit = unit * (layout.row_number[layout.row_nodes][:, layout.G_rows] >= 0)
    found[node, row, col] = found[node, col, row] = tr.normals(z[: layout.unknowns]) * unit
    curvature = tr.constraint_curvature(z)
    if curvature is not None:
        row, col = system.pointwise("constraint_curvature").sparsity(0)
        curvature = curvature * (tr.lengths[row] * tr.lengths[col] / tr.action_unit)
        found[node, row, col] = found[node, col, row] = curvature
    return found
