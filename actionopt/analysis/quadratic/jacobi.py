"""Jacobi fields: how neighbouring paths with the same start leave a path.

They solve the linearised equations of motion, on the same elements: with E the matrix of d2S on
one element, its first rows are minus the momentum at the left node, its last rows the momentum
at the right node, and the rows between are zero,

    E_0 a = -p_left,    E_1 a = ... = E_(d-1) a = 0,    p_right = E_d a.

A field that grows by many orders of magnitude would hide the others: at each element the r
fields are replaced by an orthonormal frame that spans the same Lagrangian plane.
"""

from __future__ import annotations

import numpy as np

from actionopt.analysis.quadratic.second_variation import (
    Form,
    check_independent,
    check_legendre,
    coefficient_entries,
    form,
)
from actionopt.discrete.action.equations import Equations
from actionopt.discrete.borders.bordered import equations_of
from actionopt.discrete.borders.borders import moves_of
from actionopt.discrete.matrices.factors import Factors
from actionopt.discrete.matrices.layout import border_matrix
from actionopt.discrete.meshes.mesh import MAX_DEGREE, Group, Mesh
from actionopt.discrete.meshes.resolution import SHORTEST
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.discrete.newton.newton import follow
from actionopt.tools.lobatto import Rule, lgl
from actionopt.tools.types import Array, NDInt

# Ad hoc, where nothing else is said.
FIELD_ROUNDS = 12  # of refinement: a singularity is found out by then, see `SHORTEST`
HIGHEST_DEGREE = 20  # an element of more is split instead
LOW_DEGREE = 2  # has no coefficients that could decay
# Of what a mesh may leave out: up to where degrees are raised by two, not by four, if that is
# expected then. Values of d2S go with the square. Measured on 25 random lattices to 200 masses:
# they move by 5e-13 at most.
FEW_MORE = 3e-2
COEFFICIENT_SAMPLES = 120  # of d2S, at least: it may vary faster than path and fields
COEFFICIENTS_AT_ONCE = 2**14  # coordinates at samples, or one element's; ad hoc, some 0.3 MB
COEFFICIENT_NOISE = 1e-13  # of the largest: some hundred eps
# Newton's method with a border: how far the path may move, in the coordinates' sizes, and still be
# the one; most steps; the step that ends them; and what may be left of the border's multipliers,
# in units of action for a move of the coordinates by their size.
POLISH_REACH, BORDERED_STEPS, BORDERED_TOL, FREE_FORCE = 0.5, 12, 1e-11, 1e-8


def fields(form: Form, plane: Array | None = None) -> tuple[list[Array], Array]:
    """Return r Jacobi fields on each element, at its nodes: (d + 1, r, r) in a_k, field last.

    They begin in a Lagrangian plane (2r, r), a above p in `momentum_unit`s. Without one they vanish
    at the start along its pinned directions; along its free ones their momentum vanishes there.
    From one element to the next they are recombined. And the plane at the end. Raises ValueError
    where the start does not determine them.
    """
    return _fields(form, form.elements, form.pinned[0], plane)


def _fields_from_singular_end(form: Form) -> list[Array]:
    """Return what `fields` does first, from the end if L is infinite there alone.

    Fields that come from elsewhere are infinite there, and are resolved by no mesh.
    """
    if form.tr.mesh.singular_ends[0] or not form.tr.mesh.singular_ends[1]:
        return fields(form)[0]
    r = form.freedom
    shapes = [(len(E) // r, r, len(E) // r, r) for E in form.elements]
    turned = [
        E.reshape(shape)[::-1, :, ::-1].reshape(E.shape)
        for E, shape in zip(form.elements, shapes, strict=True)
    ]
    found, _ = _fields(form, turned[::-1], form.pinned[1], None)
    return [x[::-1] for x in found[::-1]]


def _fields(
    form: Form, elements: list[Array], pinned: int, plane: Array | None
) -> tuple[list[Array], Array]:
    r, unit = form.freedom, form.momentum_unit
    held = np.arange(r) < pinned
    if plane is None:
        plane = np.concatenate([np.diag(1.0 * ~held), np.diag(1.0 * held)])
    try:
        return propagate(elements, unit, plane)
    except np.linalg.LinAlgError:
        check_legendre(form)  # the usual reason
        raise ValueError(
            "expected a path whose neighbours are determined by their start, found an element "
            "along which they are not; try other elements (mesh=)"
        ) from None


def propagate(elements: list[Array], unit: float, plane: Array) -> tuple[list[Array], Array]:
    """Propagate fields as `fields` does, on elements of d2S, with momenta in a `unit`.

    Raises numpy.linalg.LinAlgError where the start does not determine them.
    """
    r, result = plane.shape[1], []
    a, p = plane[:r], plane[r:]
    for E in elements:
        inner = len(E) - r
        right = -E[:inner, :r] @ a
        right[:r] -= unit * p
        later = np.linalg.solve(E[:inner, r:], right)
        whole = np.concatenate([a, later])
        result.append(whole.reshape(-1, r, r))
        frame, _ = np.linalg.qr(np.concatenate([later[-r:], E[inner:] @ whole / unit]))
        a, p = frame[:r], frame[r:]
    return result, np.concatenate([a, p])


def resolve(first: DiscretePath, error: float, tol: float, *, polish: bool = False) -> Form:
    """Return d2S on a mesh that resolves the Jacobi fields to `tol`, and the path with `polish`.

    `error` is that of the path, which is stationary. A mesh that resolves the path need not
    resolve its neighbours: a body at rest may be passed by any number of them, and a straight path
    may lead through a valley of any shape. Raises ValueError for non-conservative forces, a path
    through a singularity, or one along which the constraints are not independent.
    """
    found = form(first)
    for _ in range(FIELD_ROUNDS):
        check_independent(found.at, found.units, error)
        tr = found.tr
        mesh = finer(tr.mesh, tol, form=found, Q=found.at.Q / tr.lengths if polish else None)
        if mesh is None:
            break
        del found, tr  # before the next are made
        at = first.on(mesh, first.multipliers(mesh.nodes))
        found = form(at.polish() if polish else at)
    return found


def improve(
    at: DiscretePath, tol: float, nullity: int, *, with_form: bool
) -> tuple[DiscretePath, Form | None] | None:
    """Return a path improved on a mesh that resolves it to `tol`, perhaps `with_form`.

    That is d2S, on a mesh that resolves its Jacobi fields as well. What was found beside the path,
    such as its duration, is improved with it. Newton's method leaves the path where it is
    along `nullity` directions in which the action hardly bends, if its own steps lead nowhere for
    them: in a family of paths any will do. What moves a closed path along itself, or as a whole, is
    not among them. None where no stationary path is found near. Raises ValueError as `resolve`.
    """
    asked = at.problem.original
    for _ in range(FIELD_ROUNDS):
        equations, z = equations_of(asked, at, moves_of(asked))
        near = _stationary(equations, z, nullity)
        if near is None:
            return None
        z, force = near
        tr = equations.at(z)
        at = DiscretePath(tr, z[: tr.layout.size])
        found = form(at) if with_form else None
        if found is not None:
            at = found.at
            check_independent(at, found.units, tol)
        mesh = finer(tr.mesh, tol, form=found, Q=at.Q / tr.lengths)
        if mesh is None:
            return (at, found) if force < FREE_FORCE else None
        at = at.on(mesh, at.multipliers(mesh.nodes) if found is not None else None)
    return None


def _stationary(equations: Equations, z: Array, nullity: int) -> tuple[Array, float] | None:
    """Return the path near z, (size,), that a force makes stationary, and that force; or None.

    Where Newton's matrix K is singular, [K B; B' 0] with as many columns B as K lacks in rank is
    not: their multipliers, the force, vanish where there is a path, up to what the mesh leaves out
    of it, and tell where there is none.
    """
    near = follow(equations, z)
    if near.converged and near.travelled < POLISH_REACH:
        return near.z, 0.0
    layout, first = equations.layout, z
    cut, size = layout.unknowns, layout.size
    border = np.zeros((size, nullity))
    border[:cut] = np.random.default_rng(0).standard_normal((cut, nullity))
    with np.errstate(all="ignore"):
        for k in range(BORDERED_STEPS):
            edges = border, border.T, np.zeros((nullity, nullity))
            right = np.eye(1 + nullity, size + nullity, size - 1)
            right[0, :size] = equations.residual(z)
            try:
                matrix = Factors(*border_matrix(layout, equations.kkt(z), *edges))
                found = np.stack([matrix.solve(column) for column in right], axis=1)
            except np.linalg.LinAlgError:  # singular all the same
                return None
            # The other columns span the kernel: the border for the next step.
            border[:cut] = np.linalg.qr(found[:cut, 1:])[0]
            if k == 0:
                continue  # random directions may be nearly across the kernel
            step = found[:, 0]
            z = z - step[:size]
            if not np.max(np.abs((z - first)[:cut]), initial=0.0) < POLISH_REACH:
                return None
            if np.max(np.abs(step[:cut])) < BORDERED_TOL:
                return z, float(np.max(np.abs(step[size:])))
    return None


def finer(
    mesh: Mesh, tol: float, *, form: Form | None = None, Q: Array | None = None
) -> Mesh | None:
    """Return a finer mesh, or None where it resolves to `tol` what it should.

    That is the Jacobi fields of `form`, relative to their size on each element, its
    coefficients, and the nodal coordinates Q (K, n), in units of their sizes. Raises ValueError
    where elements become too short to be split.
    """
    tail = np.zeros(mesh.elements)
    if Q is not None:
        tail = tails(mesh, [Q[g.nodes] for g in mesh.groups])
    if form is not None and form.freedom:
        jacobi, tables = _fields_from_singular_end(form), []
        for g in mesh.groups:
            a = np.stack([jacobi[e] for e in g.elements])
            eta = np.einsum("eknr,ekrc->eknc", form.basis[g.nodes], a)
            table = eta.reshape(*g.nodes.shape, -1)
            tables.append(table / np.max(np.abs(table), axis=(1, 2), keepdims=True))
        tail = np.maximum(tail, np.maximum(tails(mesh, tables), coefficients_left_out(form.at)[0]))
    return refine_where(mesh, tail, tol)


def tails(mesh: Mesh, tables: list[Array]) -> Array:
    """Return the largest of the last Legendre coefficients on each element, (N,).

    The values are given as tables (E, d + 1, c), at the nodes of the elements of each degree.
    """
    return decay(mesh, tables)[0]


def decay(mesh: Mesh, tables: list[Array]) -> Array:
    """Return `tails`, and what they should be of degrees higher by two, (2, N).

    As much less as they are less than those before them.
    """
    found = np.zeros((2, mesh.elements))
    for g, table in zip(mesh.groups, tables, strict=True):
        size = np.abs(g.rule.to_legendre @ table).max(axis=2)
        last = size[:, -2:] if g.rule.degree > LOW_DEGREE else size
        tail = found[:, g.elements] = last.max(axis=1)
        if size.shape[1] > 2 * last.shape[1]:
            before = size[:, -4:-2].max(axis=1)
            found[1, g.elements] = tail**2 / np.where(before > 0, before, 1.0)
    return found


def refine_where(mesh: Mesh, tail: Array, tol: float, expected: Array | None = None) -> Mesh | None:
    """Return a mesh finer where the coefficients left out, `tail` (N,), are more than `tol`.

    Only a little where far less is `expected` (N,) to be left out then. None where none is. Raises
    ValueError where elements become too short to be split.
    """
    if np.max(tail) <= tol:
        return None
    degrees = np.array(mesh.degrees)
    coarse = tail > tol
    # Raise the degree where the coefficients decay; split where they do not, or it is high.
    # Too low a degree has no coefficients that could decay.
    split = coarse & (((tail > 1e-2) & (degrees > LOW_DEGREE)) | (degrees + 4 > HIGHEST_DEGREE))
    if np.any(mesh.lengths[split] < SHORTEST * mesh.duration):
        worst = mesh.boundaries[np.argmin(np.where(split, mesh.lengths, np.inf))]
        raise ValueError(
            f"expected a smooth path, found one that no elements resolve at t = {worst:.6g}: it "
            "runs into a singularity there, such as a collision, or is not smooth, and its "
            "neighbours are not determined"
        )
    more = 4 if expected is None else np.where(expected <= FEW_MORE * tol, 2, 4)
    degrees = np.where(coarse & ~split, degrees + more, degrees)
    return mesh.divide(np.where(split, 2, 1), degrees)


def coefficients_left_out(at: DiscretePath) -> Array:
    """Return what each element's degree leaves out of the coefficients of d2S, (2, N).

    And a degree higher by two. Relative to L_vv, with the element's length as the unit of time.
    They are sampled between the nodes: at the nodes alone, what varies faster looks smooth. Once
    for a curve and an element.
    """
    mesh, known = at.mesh, at.left_out
    least, tail = -(-COEFFICIENT_SAMPLES // mesh.elements), np.zeros((2, mesh.elements))
    for g in mesh.groups:
        if any(g.rule.ends):  # infinite coefficients are no polynomials; the fields tell
            continue
        fine = lgl(min(max(2 * g.rule.degree + 2, least), 2 * MAX_DEGREE + 2))
        ends = mesh.since[g.elements], mesh.since[g.elements + 1]
        keys = [(fine.degree, *both) for both in zip(*(x.tolist() for x in ends), strict=True)]
        new = [e for e, key in enumerate(keys) if key not in known]
        few = max(COEFFICIENTS_AT_ONCE // (fine.nodes.size * at.problem.system.n), 1)
        for some in (new[k : k + few] for k in range(0, len(new), few)):
            found = _coefficient_sizes(at, g, np.array(some), fine)
            known.update(zip([keys[e] for e in some], found, strict=True))
        first = max(g.rule.degree - 1, 0)
        tail[:, g.elements] = [[known[key][k:].max() for key in keys] for k in (first, first + 2)]
    return tail


def _coefficient_sizes(at: DiscretePath, g: Group, new: NDInt, fine: Rule) -> Array:
    """Return the largest Legendre coefficients of those of d2S on some elements of a group, (E, k).

    By the degree; zero where they are round-off.
    """
    mesh, n, elements = at.mesh, at.problem.system.n, g.elements[new]
    weights, h = g.rule.interpolation(fine.nodes), mesh.lengths[elements]
    q = weights @ at.Q[g.nodes[new]]
    v = (weights @ g.rule.derivative) @ at.Q[g.nodes[new]] * (2 / h)[:, None, None]
    middle = (mesh.since[elements] + mesh.since[elements + 1]) / 2
    t = mesh.boundaries[0] + (middle[:, None] + h[:, None] / 2 * fine.nodes)
    entries = coefficient_entries(at.problem, q.reshape(-1, n), v.reshape(-1, n), t.reshape(-1, 1))
    shape = new.size, fine.degree + 1, -1
    (row, col, C), mass = entries[2], np.zeros((new.size, n))
    own = row == col
    mass[:, row[own]] = np.abs(C.reshape(shape)[:, :, own]).max(axis=1)
    mass = np.sqrt(np.maximum(mass, COEFFICIENT_NOISE * mass.max(axis=1, keepdims=True)))
    found = np.zeros(shape[:2])
    for (row, col, X), power in zip(entries, (2, 1, 0), strict=True):
        if not row.size:
            continue
        size = (mass[:, row] * mass[:, col])[:, None]
        table = X.reshape(shape) / size * h[:, None, None] ** power
        with np.errstate(invalid="ignore"):  # infinite ones are not resolved
            sizes = np.abs(fine.to_legendre @ table).max(axis=2)
        sizes = np.nan_to_num(sizes, nan=np.inf)
        noise = COEFFICIENT_NOISE * np.abs(table).max(axis=(1, 2))[:, None]
        found = np.maximum(found, np.where(sizes <= noise, 0.0, sizes))
    return found
