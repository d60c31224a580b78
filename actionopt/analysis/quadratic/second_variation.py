"""The second variation of the action along a path, element by element.

    d2S[eta] = int (eta.L_qq eta + 2 eta.L_qv eta' + eta'.L_vv eta' + sum_i lam_i eta.f_i,qq eta) dt

on variations that the constraints allow, G eta = 0. A total derivative dF(q, t)/dt in L adds
d/dt(eta.F_qq eta), whose two terms may be as large as they like and vary as fast: only the
continuous integral, no quadrature, cancels them. So they are taken away at each point, with
S(q, t) the symmetric part of L_qv at rest,

    int 2 eta.S eta' dt = [eta.S eta] - int eta.(dS/dt) eta dt,

and what is left does not depend on F. The constraints restrict each node by itself,
so a basis of their tangent space at each node reduces the quadratic form without coupling
elements. Eliminating the path from its start to its end, one element after the other, then leaves
the Hessian of the principal function S(q0, q1); the negative pivots on the way are the Morse
index (Sylvester's law of inertia). The ends of a closed path vary together, eta(t1) = eta(t0),
wherever its start is free: its start is kept until its end is reached, and goes with that.
"""

from __future__ import annotations

from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.borders.surfaces import reactions, surface_at
from actionopt.discrete.matrices.blocks import in_parts
from actionopt.discrete.meshes.mesh import rise
from actionopt.discrete.newton.discrete_path import DiscretePath, dependent
from actionopt.mechanics.laws.compiled import Pointwise
from actionopt.mechanics.laws.laws import keep
from actionopt.mechanics.question.course import check_free, check_whole
from actionopt.mechanics.question.problem import Problem
from actionopt.mechanics.system import System
from actionopt.tools.immutable import immutable
from actionopt.tools.types import RANK, Array, NDInt
from actionopt.tools.watch import check_time

# Ad hoc, between round-off and what a path is known to.
DELAYED_PIVOT = 1e-5  # pivots below this fraction of their block's largest wait for the next block
BALANCED = 5  # rounds, each takes units to their roots
BLURRED = 10.0  # times the path's error: smaller singular values of G say nothing
ASSUMED_ERROR = 1e-3  # of a path whose own is not known
MATRICES_AT_ONCE = 3  # products over all coordinates of an element, of some elements at once


@immutable
class Form:
    """The quadratic form d2S of a discrete path, in coordinates a_k of each node's variations."""

    at: DiscretePath  # the path
    units: Array  # (n,): the variation at node k is eta_k = units * (basis_k @ a_k)
    # (K, n, r): orthonormal columns that span the variations allowed at each node; at the end nodes
    # those along which the events are pinned come first.
    basis: Array
    pinned: tuple[int, int]  # number of pinned directions at the start and at the end
    passed: dict[int, int]  # number of pinned directions at the nodes of events between the ends
    # elements, kinetic ((d + 1) r, (d + 1) r): d2S and its part in L_vv on each element, in the
    # user's units of action. Where neither end pins all, int eta.L_vv eta dt / T^2 is added to that
    # part: a constant eta has no rate.
    elements: list[Array]
    kinetic: list[Array]
    legendre: Array  # (evaluations, r): eigenvalues of L_vv on the variations allowed
    frequency: float  # the `typical_frequency`

    @property
    def tr(self) -> Transcription:
        """The discrete action of the path."""
        return self.at.tr

    @property
    def freedom(self) -> int:
        """Number r of independent variations at a node."""
        return self.basis.shape[2]

    @cached_property
    def singular(self) -> tuple[int, ...]:
        """Evaluations at the first or the last node, if L_vv vanishes there and not beside it."""
        if self.closed or not self.freedom:
            return ()
        t, size = self.tr.times[:, 0], np.abs(self.legendre).max(axis=1)
        ends = int(np.argmin(t)), int(np.argmax(t))
        steps = 1, -1  # an element's nodes stand in order
        return tuple(k for k, by in zip(ends, steps, strict=True) if size[k] <= RANK * size[k + by])

    @property
    def momentum_unit(self) -> float:
        """A unit in which the momenta of Jacobi fields are of the size of their coordinates."""
        return float(np.abs(self.legendre).mean()) * self.frequency or 1.0

    @property
    def closed(self) -> bool:
        """Whether the ends vary together: a_K = a_0 in the directions that are not pinned.

        Where the path closes in another order, that is in the basis of the last node.
        """
        return bool(self.tr.layout.closed)

    @cached_property
    def masses(self) -> list[Array]:
        """The form int |eta / units|^2 dt on each element, ((d + 1) r,): it is diagonal."""
        result: list[Array] = [np.empty(0)] * len(self.elements)
        for g in self.tr.layout.groups:
            for e in g.elements:
                result[e] = np.repeat(self.tr.half[e] * g.rule.weights, self.freedom)
        return result

    def shifted(self, mu: float) -> list[Array]:
        """Return the matrices of d2S - mu (its part in L_vv)."""
        return [E - mu * K for E, K in zip(self.elements, self.kinetic, strict=True)]


def are_units(units: Array, n: int) -> bool:
    """Whether numbers may be the unit of n coordinates, or one of each; energies are in squares."""
    with np.errstate(all="ignore"):
        usable = np.isfinite(units**4) & (units > 0)
    return units.shape in ((), (1,), (n,)) and bool(usable.all())


def form(
    at: DiscretePath, units: Array | None = None, *, phase: bool = True, through: bool = False
) -> Form:
    """Return the second variation along a path, the coordinates in `units` (n,).

    Without `phase` what chooses one of the paths that differ by a shift of time is left out. Paths
    `through` events are asked for where those at given times and places are known.

    Raises ValueError for a system with non-conservative forces, or a path along which L is not
    finite.
    """
    tr, problem = at.tr, at.problem
    _check_action(problem, through=through)
    q, v = tr.state(at.Q)
    A, B, C, S = coefficients(problem, q, v, tr.times)
    if problem.system.m:
        lam = np.concatenate([at.lam[:-1], at.lam[:1]]) if tr.layout.closed else at.lam
        A = A + curvature(problem, q, _inner(at, lam)[tr.layout.node_of], tr.times)
    finite = np.isfinite([A, B, C]).all(axis=(0, 2, 3))
    if not finite.all():
        raise ValueError(
            "expected finite second derivatives of L along the path, found none at t = "
            f"{tr.times[np.argmin(finite), 0]:.6g}: it runs into a singularity there, such as a "
            "collision, and its neighbours are not determined"
        )
    units = _units_of(at, units, C)
    basis, pinned, passed = _bases(at, units)
    scale = units[:, None] * units
    A, B, C = (x * scale for x in (A, B, C))
    elements, kinetic = _element_forms(at, (A, B, C), basis, max(pinned) < basis.shape[2])
    _add_boundary_terms(at, elements, basis, scale, S, phase=phase)
    Z = basis[tr.layout.node_of]
    legendre = np.linalg.eigvalsh(Z.swapaxes(1, 2) @ C @ Z)
    row, col = np.indices((units.size, units.size)).reshape(2, -1)
    full = [[(row, col, X.reshape(len(X), -1))] for X in (A, B)]
    frequency = typical_frequency(problem.duration, np.einsum("kaa->ka", C), *full)
    return Form(at, units, basis, pinned, passed, elements, kinetic, legendre, frequency)


def _check_action(problem: Problem, *, through: bool) -> None:
    """Raise ValueError where there is no action of which to take a second variation."""
    if problem.system.structure.forced:
        raise ValueError(
            "expected a system without non-conservative forces, found one that has some: its "
            "paths are not stationary points of an action, so that they have no second variation "
            "or index"
        )
    if through and all(e.t is not None and e.on is None for e in problem.original.through):
        check_free(problem, "the second variation of given curves")
    else:
        check_whole(problem, "the second variation of given curves")
    if problem.touches:
        raise ValueError(
            "expected a path that touches no obstacle, found one that does: its second variation "
            "is that of the free part, of which only the index is counted (morse_index)"
        )


def _units_of(at: DiscretePath, given: Array | None, mass: Array) -> Array:
    """Return the units (n,) of the coordinates: those given, or units of equal inertia.

    A small coordinate has no less inertia; `mass` (evaluations, n, n) is L_vv. Coordinates that
    take each other's place along a closed path have one unit.
    """
    units = at.tr.lengths if given is None else np.asarray(given, dtype=float)
    if given is None:
        inertia = np.abs(np.diagonal(mass, axis1=1, axis2=2)).mean(axis=0)
        size = (units * np.sqrt(inertia)).max()
        units = np.where(inertia > 0, size / np.sqrt(np.where(inertia > 0, inertia, 1.0)), units)
    order = list(at.tr.layout.closed)
    for _ in order:
        units = np.maximum(units, units[order])
    return units


def _bases(at: DiscretePath, units: Array) -> tuple[Array, tuple[int, int], dict[int, int]]:
    """Return a basis (K, n, r) of what constraints and events allow at the nodes.

    And how many of its columns each end pins, and each event between them, by nodes: they come
    first there.
    """
    problem, closed = at.problem, at.tr.layout.closed
    basis = tangent(problem, at.Q, at.tr.mesh.nodes[:, None], units).copy()
    pinned = [0, 0]
    for k, event in enumerate((problem.start, problem.end)):
        asked = problem.surfaces[k]
        normals = None if asked is None else surface_at(at, -k)[1] * units
        basis[-k], pinned[k] = _pinned_first(basis[-k], (asked or event).pinned, normals)
    passed, mesh = {}, at.tr.mesh
    for event in problem.through:
        k = int(mesh.offsets[np.argmin(np.abs(mesh.boundaries - event.t))])
        basis[k], passed[k] = _pinned_first(basis[k], event.pinned, None)
    if closed:
        basis[-1] = basis[0, list(closed)]
    return basis, (pinned[0], pinned[1]), passed


def _element_forms(
    at: DiscretePath, coefficients: tuple[Array, ...], basis: Array, loose: bool
) -> tuple[list[Array], list[Array]]:
    """Return the second variation of each element on its basis, and its kinetic part.

    Where both ends leave something `loose`, a constant variation has no rates: its kinetic part is
    int eta.L_vv eta dt / T^2.
    """
    tr, n = at.tr, at.problem.system.n
    elements: list[Array] = [np.empty(0)] * tr.mesh.elements
    kinetic: list[Array] = [np.empty(0)] * tr.mesh.elements
    for g in tr.layout.groups:
        count = g.nodes.shape[1] * n
        for some in in_parts(len(g.nodes), MATRICES_AT_ONCE * count**2):
            check_time()
            shape = *g.nodes.shape, n, n
            a, b, c = (x[g.span].reshape(shape)[some] for x in coefficients)
            own = g.elements[some]
            Z, half = basis[g.nodes[some]], tr.half[own]
            rate = _kinetic(g, c, half, Z, at.problem.system.has_diagonal_mass)
            whole = rate + _rest(g, a, b, half, Z)
            if loose:
                rate = rate + _rest(g, c / at.problem.duration**2, 0 * b, half, Z)
            for e, *blocks in zip(own, whole, rate, strict=True):
                elements[e], kinetic[e] = blocks
    return elements, kinetic


def ends_hessian(form: Form) -> Array:
    """Return (k0 + k1, k0 + k1) derivatives of the action, by directions pinned at start and end.

    Where L_vv is infinite at an end, or elements there are so short that they show a singularity,
    an end that moves takes the whole path along a line (`rise`): entries of single nodes cancel to
    what is left when those between are eliminated, a part of 1e-6 or of the element's length, and
    those of lines hardly. Under constraints, which lines leave, as they are.
    """
    mesh, r, lines = form.tr.mesh, form.freedom, sum(form.pinned)
    if form.tr.problem.system.m or not mesh.moves_along_lines:
        return condense(form).hessian
    lifted, (begun, ended) = _lift_ends(form), form.pinned
    if not any(mesh.singular_ends):
        first, final = form.elements[0].diagonal(), form.elements[-1].diagonal()[-r:]
        along = np.sum([E.diagonal()[:lines] for E in lifted], axis=0)
        if (np.abs(along) > np.abs(np.r_[first[:begun], final[:ended]])).any():
            return condense(form).hessian  # in a boundary layer it is lines that cancel
    front, last = np.zeros((lines, lines)), len(form.elements) - 1
    for e, E in enumerate(lifted):
        shared = r if e else 0
        old, size = len(front), len(front) + len(E) - lines - shared
        grown, own = np.zeros((size, size)), np.r_[:lines, old - shared : size]
        grown[:old, :old] = front
        grown[np.ix_(own, own)] += E
        front, _ = _eliminate(grown, lines, size - r if e < last else size, force=e == last)
    return front


def _lift_ends(form: Form) -> list[Array]:
    """Return d2S on each element, by lines that each pinned direction moves, then by its nodes.

    Without the pinned directions of the end nodes, which are those lines.
    """
    at, tr, (begun, ended), r = form.at, form.tr, form.pinned, form.freedom
    *coefficients_of, coupling = coefficients(at.problem, *tr.state(at.Q), tr.times)
    scale, boundary = form.units[:, None] * form.units, [np.zeros_like(E) for E in form.elements]
    A, B, C = (x * scale for x in coefficients_of)
    _add_boundary_terms(at, boundary, form.basis, scale, coupling, phase=True)
    ends = np.hstack([form.basis[0][:, :begun], form.basis[-1][:, :ended]])
    rising = np.repeat([False, True], form.pinned)
    result, since, n = list(form.elements), tr.mesh.since, len(form.units)

    def between(left: Array, M: Array, right: Array) -> Array:
        a, b = (x.reshape(len(x), -1, x.shape[-1]) for x in (left, M @ right))
        return a.swapaxes(1, 2) @ b

    for g in tr.layout.groups:
        k, D, w = g.rule.degree + 1, g.rule.derivative, g.rule.weights[:, None, None]
        done, left = (abs(g.rule.nodes - end)[:, None, None] for end in g.rule.nodes[[0, -1]])
        for some in in_parts(len(g.nodes), MATRICES_AT_ONCE * k * n * (len(rising) + k * r)):
            own = g.elements[some]
            half, first, end = (
                x[own][:, None, None, None] for x in (tr.half, since[:-1], since[1:])
            )
            Z = form.basis[g.nodes[some]]
            a, b, c = (x[g.span].reshape(-1, k, n, n)[some] for x in (A, B, C))
            # Each from its own end, so that what is left by a singular one has its digits.
            before, after = first - since[0] + half * done, since[-1] - end + half * left
            up, down, rate = rise(before, after, tr.mesh.singular_ends)
            lines = ends * np.where(rising, up, down)
            turns = ends * half * np.where(rising, rate, -rate)
            nodal, slopes = (
                np.einsum("kj,ejxr->ekxjr", X, Z).reshape(*Z.shape[:3], -1) for X in (np.eye(k), D)
            )
            values = np.concatenate([lines, nodal], axis=3)
            rates = np.concatenate([turns, slopes], axis=3)
            mixed = between(values, w * b, rates)
            whole = between(values, w * half * a, values) + mixed + mixed.swapaxes(1, 2)
            whole += between(rates, w / half * c, rates)
            at_nodes = (Z.swapaxes(2, 3) @ lines).reshape(len(own), k * r, -1)
            for e, E, ends_at in zip(own, whole, at_nodes, strict=True):
                if boundary[e].any():
                    nodes = np.hstack([ends_at, np.eye(k * r)])
                    E = E + nodes.T @ boundary[e] @ nodes
                result[e] = E
    for e, gone in ((0, np.arange(begun) + begun + ended), (-1, np.arange(ended) - r)):
        result[e] = np.delete(np.delete(result[e], gone, 0), gone, 1)
    return result


def _add_boundary_terms(
    at: DiscretePath,
    elements: list[Array],
    basis: Array,
    scale: Array,
    coupling: Array | None,
    *,
    phase: bool,
) -> None:
    """Add terms of single boundaries to the elements there: of the ends, `nodal` ones, of surfaces.

    `coupling` (evaluations, n, n) is the S of `coefficients`, which only the ends feel.
    """
    tr, problem = at.tr, at.problem

    def add(boundary: int, matrix: Array) -> None:
        r = len(matrix)
        e, place = (boundary - 1, slice(-r, None)) if boundary else (0, slice(None, r))
        elements[e] = elements[e].copy()
        elements[e][place, place] += matrix

    last = tr.mesh.elements
    if coupling is not None:
        for k, boundary, sign in ((0, 0, -1.0), (-1, last, 1.0)):
            first = np.flatnonzero(tr.layout.node_of == (tr.mesh.offsets[-1] if boundary else 0))[0]
            add(boundary, sign * basis[k].T @ (coupling[first] * scale) @ basis[k])
    for term in tr.nodal:
        if phase or not term.phase:
            Z = basis[term.node]
            add(term.boundary, Z.T @ (term.matrix * scale) @ Z)
    for k, asked in enumerate(problem.surfaces):
        if asked is not None:
            add(k * last, basis[-k].T @ (_bend(at, k) * scale) @ basis[-k])


def typical_frequency(
    duration: float,
    mass: Array,
    springs: list[tuple[NDInt, NDInt, Array]],
    mixed: list[tuple[NDInt, NDInt, Array]],
) -> float:
    """Return how fast variations may turn, on the whole: at least one over the duration.

    `mass` (K, n) is the diagonal of L_vv; of L_qq and L_qv, which add up, the rows, columns and
    values (K, nonzeros).
    """
    mass = np.abs(mass)
    mass = np.maximum(mass, RANK * mass.max(axis=1, initial=0.0, keepdims=True))
    mass = np.where(mass > 0, mass, 1.0)
    stiff, coupled = (
        sum(float((x**2 / (mass[:, row] * mass[:, col])).sum()) for row, col, x in part) / mass.size
        for part in (springs, mixed)
    )
    return 1 / duration + stiff**0.25 + coupled**0.5


def coefficients(
    problem: Problem, q: Array, v: Array, t: Array
) -> tuple[Array, Array, Array, Array | None]:
    """Return the coefficients of d2S without its total derivative, for q, v (K, n) and t (K, 1).

    With S(q, t) the symmetric part of L_qv at v = 0, the variation eta has 2 eta.S eta' +
    eta.(dS/dt) eta = d(eta.S eta)/dt, which only the ends feel: L_qq - dS/dt, L_qv - S, L_vv and S,
    each (K, n, n). S is None where L has no terms linear in the velocities.
    """
    A, B, C = second_derivatives(problem, q, v, t)
    system = problem.system
    coupling = couples_at_rest(system)
    if coupling is None:
        return A, B, C, None
    # A Lagrangian that is singular at rest has none of which this S would be a part.
    S, rate = (np.nan_to_num(x, posinf=0.0, neginf=0.0) for x in coupling(q, v, t, problem.packed))
    S, rate = S.reshape(B.shape), rate.reshape(B.shape)
    return A - rate, B - S, C, S


def coefficient_entries(
    problem: Problem, q: Array, v: Array, t: Array
) -> list[tuple[NDInt, NDInt, Array]]:
    """Return rows, columns and values (K, nonzeros) of each of the first three `coefficients`."""
    system, n = problem.system, problem.system.n
    if couples_at_rest(system) is None:
        second = system.pointwise("second")
        values = second(q, v, t, problem.packed)
        return [(*second.sparsity(i), values[i]) for i in range(3)]
    row, col = np.divmod(np.arange(n * n), n)
    full = coefficients(problem, q, v, t)[:3]
    return [(row, col, X.reshape(len(q), -1)) for X in full if X is not None]


@keep
def couples_at_rest(system: System) -> Pointwise | None:
    """Return the function of S(q, t) and dS/dt along a path; None where S is zero."""
    s, n = system.symbols, system.n
    mixed = ca.substitute(system.derivatives.Lqv, s.v, ca.SX.zeros(n))
    S = ca.sparsify((mixed + mixed.T) / 2)
    if not S.nnz():
        return None
    rate = ca.jtimes(ca.vec(S), s.q, s.v) + ca.jacobian(ca.vec(S), s.t)
    outputs = [ca.densify(ca.vec(S)), ca.densify(rate)]
    function = ca.Function("coupling", [s.q, s.v, s.t, s.p], outputs)
    return Pointwise(function)


def second_derivatives(problem: Problem, q: Array, v: Array, t: Array) -> tuple[Array, ...]:
    """Return L_qq, L_qv and L_vv, each (K, n, n), for q, v (K, n) and t (K, 1)."""
    system = problem.system
    second = system.pointwise("second")
    values = second(q, v, t, problem.packed)
    return tuple(second.full(i, values[i], symmetric=i != 1) for i in range(3))


def tangent(problem: Problem, q: Array, t: Array, units: Array) -> Array:
    """Return bases (K, n, n - m) of the null space of G at q (K, n), orthonormal in `units`."""
    system = problem.system
    if not system.m:
        return np.broadcast_to(np.eye(system.n), (len(q), system.n, system.n))
    across = np.swapaxes(normals(problem, q, t) * units, 1, 2)
    return np.linalg.qr(across, mode="complete")[0][:, :, system.m :]


def check_independent(at: DiscretePath, units: Array, error: float) -> None:
    """Raise ValueError where the constraints hardly are independent, for a path off by `error`.

    There, as where a mechanism passes a flat position, G loses a singular value, in `units` (n,) of
    the coordinates. Once this is as small as the path is inaccurate, the tangent plane may have any
    direction.
    """
    problem, mesh = at.problem, at.mesh
    if not problem.system.m:
        return
    G = normals(problem, at.Q, mesh.nodes[:, None]) * units
    size = np.linalg.norm(G, axis=2).max(axis=0)
    values = np.linalg.svd(G / np.where(size > 0, size, 1.0)[:, None], compute_uv=False)
    least = values.min(axis=1)
    known = (
        max(RANK, BLURRED * min(error, ASSUMED_ERROR))
        if np.isfinite(error)
        else BLURRED * ASSUMED_ERROR
    )
    if np.min(least) <= known * np.median(least):
        raise dependent(float(mesh.nodes[np.argmin(least)]))


def normals(problem: Problem, q: Array, t: Array) -> Array:
    """Return G at q (K, n), shape (K, m, n)."""
    system = problem.system
    jacobian = system.pointwise("constraint_jacobian")
    return jacobian.full(0, jacobian(q, t, problem.packed)[0])


def check_legendre(form: Form) -> None:
    """Raise ValueError unless L_vv is positive definite on the variations allowed.

    Without this (Legendre's strengthened condition) infinitely many variations lower the
    action, and an index counts nothing. At an end L_vv may vanish, as at the centre of a radial
    problem: a regular singular point.
    """
    # Node by node: along a path the mass may change by as many orders as it likes.
    own, size = form.legendre.min(axis=1), np.abs(form.legendre).max(axis=1)
    bad = ~(own > RANK * size)
    if bad.any():
        bad[list(form.singular)] = False
    if bad.any():
        worst = int(np.argmax(np.where(bad, RANK * size - own, -np.inf)))
        t, least, largest = form.tr.times[worst, 0], own[worst], size[worst]
        raise ValueError(
            "expected d2L/dv2 positive definite on the motions allowed along the path, found the "
            f"eigenvalue {least:.3g} at t = {t:.6g} (the largest is {largest:.3g}): no index "
            "counts the variations that lower such an action"
        )


@immutable
class SchurComplement:
    """The form that is left when the inside of a path is eliminated."""

    negative: int  # number of negative pivots
    # (k0 + k1, k0 + k1): second derivatives of the action by the pinned directions at the start and
    # at the end.
    hessian: Array


def condense(form: Form, elements: list[Array] | None = None) -> SchurComplement:
    """Eliminate all variations of the path but those of its pinned ends.

    `elements` are matrices in place of those of d2S, as `Form.shifted` returns them.
    """
    elements = form.elements if elements is None else elements
    r, (keep, keep_end) = form.freedom, form.pinned
    first = r if form.closed else keep
    front, negative = np.zeros((r, r)), 0
    for e, E in enumerate(elements):
        check_time()
        old = front.shape[0]
        size = old + E.shape[0] - r
        grown = np.zeros((size, size))
        grown[:old, :old] = front
        grown[old - r :, old - r :] += E
        if e < len(elements) - 1:
            front, count = _eliminate(grown, first, size - r, force=False)
            negative += count
            continue
        if form.closed:
            grown = _join(grown, np.arange(keep, r), np.arange(size - r + keep, size))
            last = np.arange(size - r, size - r + keep)
        else:
            last = np.arange(size - r, size - r + keep_end)
        # The free directions of the last node go as well.
        start = np.arange(keep)
        rest = np.setdiff1d(np.arange(len(grown)), np.r_[start, last])
        order = np.r_[start, rest, last]
        grown = grown[np.ix_(order, order)]
        front, count = _eliminate(grown, keep, len(grown) - last.size, force=True)
        negative += count
    return SchurComplement(negative, front)


def _join(M: Array, to: NDInt, gone: NDInt) -> Array:
    """Return the form M (k, k) with the variables `gone` equal to those at `to`, and left out."""
    joined = M.copy()
    joined[to] += joined[gone]
    joined[:, to] += joined[:, gone]
    left = np.setdiff1d(np.arange(len(M)), gone)
    return joined[np.ix_(left, left)]


def _eliminate(M: Array, first: int, stop: int, force: bool) -> tuple[Array, int]:
    """Eliminate the variables first to stop of M (k, k); return the rest, and how many lower it.

    Directions in which their block hardly bends wait for its neighbours, as a pivot of two rows
    waits in the factorization of Bunch and Kaufman: a node conjugate to the start has such a block.
    Others do not, nor those that are only of other units: the rest would grow with every element.
    """
    if stop <= first:
        return M, 0
    block, outer = M[first:stop, first:stop], np.r_[:first, stop : len(M)]
    values, vectors = np.linalg.eigh(block)
    late = _small(values)
    if late.any():
        units = np.ones(len(block))
        for _ in range(BALANCED):
            largest = np.abs(block * units * units[:, None]).max(axis=1)
            units /= np.sqrt(np.where(largest > 0, largest, 1.0))
        values, vectors = np.linalg.eigh(block * units * units[:, None])
        vectors, late = units[:, None] * vectors, _small(values) & (not force)
    X = vectors.T @ M[first:stop, outer]
    with np.errstate(all="ignore"):
        rest = M[np.ix_(outer, outer)] - X[~late].T @ (X[~late] / values[~late, None])
    rest, negative = (rest + rest.T) / 2, int(np.sum(values[~late] < 0))
    if not late.any():
        return rest, negative
    size = int(late.sum())
    grown = np.zeros((len(rest) + size,) * 2)
    own = np.arange(first, first + size)
    others = np.setdiff1d(np.arange(len(grown)), own)
    grown[np.ix_(others, others)], grown[own, own] = rest, values[late]
    grown[np.ix_(own, others)] = X[late]
    grown[np.ix_(others, own)] = X[late].T
    return grown, negative


def _small(values: Array) -> NDArray[np.bool_]:
    """Return which of the eigenvalues of a block wait."""
    size = np.abs(values)
    return size < DELAYED_PIVOT * size.max()


def _kinetic(g, c: Array, half: Array, Z: Array, diagonal: bool) -> Array:
    """Return int eta'.c eta' dt of the elements of a group, (E, (d + 1) r, (d + 1) r).

    c (E, d + 1, n, n) is L_vv at the nodes, perhaps `diagonal`, `half` (E,) half the lengths, Z
    (E, d + 1, n, r) the bases there. As D'W D of the rule.
    """
    E, k, n, r = Z.shape
    if diagonal:
        c = np.diagonal(c, axis1=2, axis2=3)[..., None]
    local = g.rule.stiffness @ (c / half[:, None, None, None]).reshape(E, k, -1)
    local = local.reshape(E, k, k, n, -1)
    moved = local * Z[:, None] if diagonal else local @ Z[:, None]
    reduced = Z.swapaxes(2, 3)[:, :, None] @ moved
    return reduced.swapaxes(2, 3).reshape(E, k * r, k * r)


def _rest(g, a: Array, b: Array, half: Array, Z: Array) -> Array:
    """Return Z'M Z, (E, (d + 1) r, (d + 1) r), of M in int (eta.a eta + 2 eta.b eta') dt.

    Z (E, d + 1, n, r) are the bases of nodes; the half lengths of b's term cancel.
    """
    E, k, _, r = Z.shape
    result, j = np.zeros((E, k, r, k, r)), np.arange(k)
    weighted = a * (half[:, None] * g.rule.weights)[:, :, None, None]
    result[:, j, :, j, :] = (Z.swapaxes(2, 3) @ weighted @ Z).transpose(1, 0, 2, 3)
    if b.any():
        across = Z.swapaxes(2, 3) @ b
        mixed = np.einsum("ejrb,elbs->ejrls", across, Z, optimize=True)
        mixed *= g.rule.weighted_derivative[:, None, :, None]
        result += mixed
        result += mixed.transpose(0, 3, 4, 1, 2)
    return result.reshape(E, k * r, k * r)


def curvature(problem: Problem, q: Array, lam: Array, t: Array) -> Array:
    """Return sum_i lam_i f_i,qq, (K, n, n)."""
    system = problem.system
    if system.structure.affine_constraint:
        return np.zeros((len(q), system.n, system.n))
    second = system.pointwise("constraint_curvature")
    return second.full(0, second(q, lam, t, problem.packed)[0], symmetric=True)


def _inner(at: DiscretePath, lam: Array) -> Array:
    """Return the multipliers (K, m) without those of ends on a surface: `_bend` has theirs."""
    ends = [-k for k, asked in enumerate(at.problem.surfaces) if asked is not None]
    if not ends:
        return lam
    lam = lam.copy()
    lam[ends] = 0.0
    return lam


def _bend(at: DiscretePath, k: int) -> Array:
    """Return the second derivatives of mu.on + nu.f at an end on a surface, (n, n).

    How the surface bends away from its tangent plane changes the action to second order, too.
    """
    problem, q, t = at.problem, at.Q[-k], at.mesh.boundaries[[-k]]
    event, (mu, nu) = problem.surfaces[k], reactions(at, -k)
    assert event is not None
    found = event.on.curvature(q, t[0], problem.packed, mu)
    if nu.size:
        found = found + curvature(problem, q[None], nu[None], t[:, None])[0]
    return found


def _pinned_first(Z: Array, pinned: tuple[int, ...], normals: Array | None) -> tuple[Array, int]:
    """Return the basis Z (n, r) turned so that variations of pinned coordinates come first.

    So do those along the `normals` (s, n) of a surface.
    """
    if len(pinned) == len(Z):
        return Z, Z.shape[1]
    if not pinned and normals is None:
        return Z, 0
    held = Z[list(pinned)]
    if normals is not None:
        sizes = np.linalg.norm(normals, axis=1, keepdims=True)
        held = np.concatenate([held, normals / np.where(sizes > 0, sizes, 1.0) @ Z])
    _, values, right = np.linalg.svd(held)
    return Z @ right.T, int(np.sum(values > RANK))
