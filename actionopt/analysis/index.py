"""What kind of stationary point a path is: its Morse index.

The index is the number of independent variations that lower the action. It is counted, not
computed from eigenvalues: the signs of the pivots that eliminate the path element by element
(`second_variation.condense`). Two counts at shifts -tau and +tau of the quadratic form

    d2S[eta] - mu int eta'.L_vv eta' dt

enclose the eigenvalues mu that are zero for all that can be known. These mu are numbers without
units, at most a few and accumulating at 1: 1 - (w T / k pi)^2, k = 1, 2, ... for an oscillator.
Along a closed path the variations that close are counted, eta(t1) = eta(t0): a constant one has no
rate, and int eta.L_vv eta dt / T^2 is added to the form beside mu.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from actionopt.analysis.jacobi import improve, resolve
from actionopt.analysis.regular import regular_index
from actionopt.analysis.second_variation import (
    BorderTerm,
    Form,
    check_legendre,
    condense,
    form,
    second_derivatives,
)
from actionopt.discrete.bordered import Bordered, equations_of, null_space
from actionopt.discrete.borders import Rows, moves_of, times_of
from actionopt.discrete.discrete_path import DiscretePath
from actionopt.discrete.factors import Factors, diagonal, full
from actionopt.discrete.increments import Increments, is_stiff
from actionopt.discrete.transcription import Transcription
from actionopt.tools.blas import one_thread
from actionopt.tools.types import Array

# Of the Jacobi fields; derived: eigenvalues converge twice as fast, to 1e-12, far below the
# tolerance. And of the path, where its error leaves a sign open: a tenth of the tolerance in |mu|.
INDEX_RESOLUTION, POLISHED = 1e-6, 1e-10
# |mu| below which it may be zero; measured: of families 1e-6 at most on paths to 1e-8.
NEAR_ZERO = 1e-5
INDEX_TOLERANCE = 1e-8  # least |mu| that has a sign; ad hoc: the default `tol` of a path
LOOSEST = 1e-2  # |mu| moved by a path whose error is not known; ad hoc
ERROR_GAIN = 10.0  # |mu| moved by an error of the path; ad hoc, for coefficients of order one


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
        The smallest |mu|, where it is below the tolerance; 0 if all those are `moves`.
    tolerance : float
        1e-8, or ten times the path's own error estimate where that is larger and leaves no sign
        open, or where the path cannot be improved.
    moves : int
        Of these, those that move a closed path along itself, or as a whole by a symmetry of L.
    """

    index: int
    nullity: int
    smallest: float | None
    tolerance: float
    moves: int = 0

    def __post_init__(self) -> None:
        """Raise ValueError for numbers that round-off has made of the signs."""
        if self.index < 0 or self.nullity < 0:
            raise ValueError(
                f"expected signs of the second variation that are known, found an index of "
                f"{self.index} and a nullity of {self.nullity}: round-off, as where times of "
                "contact are all but the same; a smaller tol or other events may tell"
            )

    @property
    def kind(self) -> Literal["minimum", "saddle", "degenerate"]:
        """What the action is at the path, among its near neighbours."""
        if self.nullity > self.moves:
            return "degenerate"
        return "saddle" if self.index else "minimum"


@one_thread
def inertia(
    at: DiscretePath, error: float, *, tolerance: float | None = None, moves: int = 0
) -> Inertia:
    """Return the index and the nullity of the second variation along a path known to `error`.

    Ten times the path's error is how far an eigenvalue may be off. Where that leaves signs open,
    the path is improved and they are counted again, so that "degenerate" is said of the problem
    and not of the tolerance its path was solved to. `tolerance` replaces all this. As many
    eigenvalues as `moves` are known to vanish.

    The nullity is the dimension of the family of paths between the same ends, to first order.

    Raises ValueError for non-conservative forces, where L is not convex in the velocities, along a
    path through a singularity, or where the constraints are not independent.

    References
    ----------
    Gelfand and Fomin, *Calculus of Variations* (1963), sections 24-29; Milnor, *Morse Theory*
    (1963), section 15.
    """
    if at.problem.touches:
        return _on_its_mesh(at, at.tr, at.z, tolerance_of(error))
    if at.problem.system.structure.linear:
        error = 0.0  # the second variation is the same along any path
    if tolerance is not None:
        return inertia_of(resolve(at, error, INDEX_RESOLUTION), tolerance, moves)
    if not moves:
        known = tolerance_of(error)
        index = regular_index(at, error, max(known, NEAR_ZERO))
        if index is not None:
            return Inertia(index, 0, None, known)
    return _count(at, error, moves)[0]


def _count(
    at: DiscretePath, error: float, moves: int, asked: tuple[Bordered, Array] | None = None
) -> tuple[Inertia, Form | None]:
    """Return the inertia over a given duration, and the form on which it was counted.

    None where L contains accelerations: then it is counted on the mesh of the path.

    An eigenvalue that is zero comes to zero as the path comes to be exact, and another one does
    not: those that are near zero are counted again along a better path, which solves the equations
    `asked` where its duration was found: a family may be of one duration, and not of those beside.
    """
    tolerance = tolerance_of(error)
    if at.tr.order > 1:
        return _on_its_mesh(at, at.tr, at.z, tolerance), None
    form = resolve(at, error, INDEX_RESOLUTION)
    found = _all_moves(form, max(tolerance, NEAR_ZERO), moves)
    if found.nullity <= moves:
        return replace(found, tolerance=max(tolerance, INDEX_TOLERANCE)), form
    if not error <= POLISHED:
        with suppress(ValueError):  # a spurious path may be resolved on no mesh
            if asked is not None:
                found = with_duration(found, *asked, form)
            better = improve(at, POLISHED, found.nullity - moves)
            if better is not None:
                form, tolerance = better, INDEX_TOLERANCE
    return _all_moves(form, tolerance, moves), form


def _all_moves(form: Form, tolerance: float, moves: int) -> Inertia:
    """Return the inertia to a tolerance at which all moves are zero: short elements round them."""
    found = inertia_of(form, tolerance, moves)
    while found.nullity < moves and found.tolerance < LOOSEST:
        found = inertia_of(form, 10 * found.tolerance, moves)
    return found


def inertia_asked(at: DiscretePath, error: float) -> Inertia:
    """Return the index and nullity of a path whose duration was found, or that closes anywhere.

    Its duration varies with it, S + E T is what is lowered. Where the paths over fixed durations
    follow one another as T changes, that has one direction more, along them, in which it bends by
    d2S/dT2 = -dE/dT. What moves a closed path along itself, or as a whole by a symmetry of L, makes
    no other path of it, but where the start gives coordinates.
    """
    asked, touches = at.problem.original, at.problem.touches
    moves = () if touches else moves_of(asked)
    times = times_of(at.problem)
    kappa = at.problem.kappa if asked.integral is not None else None
    path, rows = at.path, at.rows if at.tr.layout.rows else None
    lam = None if rows is None else np.nan_to_num(rows)
    bordered, y = Bordered.around(asked, path, lam, at.tr.lengths, moves, times=times, kappa=kappa)
    if touches or asked.integral is not None:
        found = _on_its_mesh(bordered.discrete(y), bordered, y, tolerance_of(error))
        shifts = bordered.phases - len(bordered.start_coordinates)
        return replace(found, nullity=found.nullity + shifts, moves=shifts)
    known = bordered.phases
    there = bordered.discrete(y) if asked.closes else at
    found, form = _count(there, error, known, (bordered, y))
    found = with_duration(found, bordered, y, form)
    moves, held = min(found.nullity, known), len(bordered.start_coordinates)
    if held and form is not None and found.nullity > known:
        # What is given chooses of a family; a symmetry may well lead along what is left of that.
        there = _held_at_start(form, asked.start.pinned)
        left = _signs(there, found.tolerance, _duration(form, bordered))
        return replace(found, nullity=left.nullity, moves=0)
    return replace(found, nullity=found.nullity - min(held, moves), moves=max(moves - held, 0))


def inertia_through(at: DiscretePath, error: float) -> Inertia:
    """Return the index and nullity of a path through events, of all its legs together.

    Places and times that were to be found are varied with the path: index = negative eigenvalues of
    the second derivative of W in everything unknown - multipliers (Haynsworth; J. Nocedal and S. J.
    Wright, *Numerical Optimization* (2nd ed. 2006), theorem 16.3), on the mesh of the path. Raises
    ValueError as `inertia` does.
    """
    equations, z = equations_of(at.problem.original, at)
    return _on_its_mesh(at, equations, z, tolerance_of(error))


def inertia_on_surfaces(at: DiscretePath, error: float) -> Inertia:
    """Return the index and nullity of a path between surfaces as `inertia_through` does.

    Where `inertia_asked` refines the mesh until it resolves all Jacobi fields, to be sure.
    """
    rows = at.rows if at.tr.layout.rows else None
    lam = None if rows is None else np.nan_to_num(rows)
    bordered, y = Bordered.around(at.problem.original, at.path, lam, at.tr.lengths)
    return _on_its_mesh(at, bordered, y, tolerance_of(error))


def _on_its_mesh(
    at: DiscretePath, equations: Bordered | Transcription, z: Array, tolerance: float
) -> Inertia:
    """Return the inertia of the derivative of the equations of a path on its mesh.

    For a path in contact, variations that keep what is in contact there are counted: to second
    order S does not depend on the times of contact.
    """
    problem, tr = at.problem, at.tr
    if problem.system.structure.forced:
        form(at)  # raises
    mass = second_derivatives(problem, tr.place(at.x).at, tr.place(at.x).v, tr.times)[2]
    if not (np.linalg.eigvalsh(mass).min(axis=1) > 0).all():
        raise ValueError(
            "expected a Lagrangian that is convex in the velocities (Legendre's strengthened "
            "condition), found one that is not along the path: infinitely many variations lower "
            "the action, and no index counts them"
        )
    layout, kinetic, multipliers = equations.layout, equations.kinetic(z), equations.layout.rows
    if isinstance(equations, Bordered):
        matrix, multipliers = equations.hessian(z), multipliers + equations.multipliers
    else:
        matrix = equations.kkt(z)

    stiff = is_stiff(equations, z)
    if stiff and (layout.rows or layout.closed):
        raise ValueError(
            "expected signs of the second variation that are known, found elements so short that "
            "their round-off hides them, along a path that closes or has constraints; ask for less "
            "accuracy"
        )
    pinned = max(len(event.pinned_places(tr.order)) for event in problem.joints)
    if pinned < tr.layout.width and not stiff:
        kinetic = kinetic + _at_rest(equations, z, mass)  # a constant has no rates
    basis = null_space(equations, full(layout, matrix)) if layout.rows and tr.order > 1 else None

    def below(mu: float) -> int:
        shifted = matrix - mu * kinetic
        if basis is not None:
            # The rows are integrals of functions that nearly depend on one another on elements of a
            # high degree: signs of the pivots of the whole would be round-off.
            return int(np.sum(np.linalg.eigvalsh(basis.T @ full(layout, shifted) @ basis) < 0))
        if stiff:
            return Increments(equations, z, shifted, mu).negative() - multipliers
        return Factors(layout, shifted).negative() - multipliers

    index = below(-tolerance)
    return Inertia(index, below(tolerance) - index, None, tolerance)


def _at_rest(equations: Bordered | Transcription, z: Array, mass: Array) -> Array:
    """Return the nonzeros of int eta.L_vv eta dt / T^(2 order), over the unknowns that are q.

    `mass` (evaluations, n, n) is L_vv, or that of the highest derivatives.
    """
    tr = equations.at(z)
    layout, n = tr.layout, tr.problem.system.n
    node, place = np.divmod(layout.free, layout.width)
    weight = np.bincount(layout.node_of, tr.weight[:, 0], layout.node_count)
    whole = (place < n) & ((tr.order == 1) | np.isin(node, layout.offsets))
    inertia = np.diagonal(mass, axis1=1, axis2=2).mean(axis=0)[place % n]
    found = np.zeros(layout.size)
    found[: layout.unknowns] = np.where(whole, weight[node] * inertia, 0.0) * tr.x_unit**2
    nonzeros = diagonal(layout, found / (tr.action_unit * tr.mesh.duration ** (2 * tr.order)))
    if not isinstance(equations, Bordered):
        return nonzeros
    b = equations.layout.border
    edge = np.zeros((layout.size, b))
    return equations.layout.join(nonzeros, edge, edge.T, np.zeros((b, b)))


def _held_at_start(form: Form, pinned: tuple[int, ...]) -> Form:
    """Return a form with springs on the coordinates that the start of a closed path gives.

    In it only those variations still vanish that leave the start where it is.
    """
    rows = form.basis[0][list(pinned)]
    first, r = form.elements[0].copy(), form.freedom
    first[:r, :r] += np.abs(np.diag(form.elements[0])).max() * rows.T @ rows
    return replace(form, elements=[first, *form.elements[1:]])


def with_duration(found: Inertia, bordered: Bordered, y: Array, form: Form | None) -> Inertia:
    """Return the inertia with the duration varying, from that over a fixed one."""
    if bordered.log_duration is None:
        return found
    if found.nullity > bordered.phases:
        beside = None if form is None else _duration(form, bordered)
        if beside is None or form is None:  # as where fixed durations have a fold
            return replace(found, index=found.index + 1, nullity=found.nullity - 1)
        return _signs(form, found.tolerance, beside, found.smallest)
    bend = bordered.bend(y)
    if abs(bend) <= found.tolerance:
        return replace(found, nullity=found.nullity + 1)
    return replace(found, index=found.index + (bend < 0))


def _signs(
    form: Form,
    tolerance: float,
    beside: tuple[BorderTerm, float] | None,
    smallest: float | None = None,
) -> Inertia:
    """Return the inertia of a form with a variable beside its path, which has a kinetic part."""

    def below(mu: float) -> int:
        variable = beside and beside[0]._replace(own=beside[0].own - mu * beside[1])
        return condense(form, form.shifted(kinetic=mu), variable).negative

    index = below(-tolerance)
    return Inertia(index, below(tolerance) - index, smallest, tolerance)


def _duration(form: Form, bordered: Bordered) -> tuple[BorderTerm, float] | None:
    """Return log T as a variable beside the path of a form, and its kinetic part.

    None where that is given, or constraints move with it: variations do not keep them then.
    """
    if bordered.log_duration is None:
        return None
    at, tr, asked = form.at, form.at.tr, bordered.problem
    lam = np.nan_to_num(at.rows) if tr.layout.rows else None
    there, y = Bordered.around(asked, at.path, lam, tr.lengths)
    row, layout = there.by_duration(y), there.first.layout
    surfaces = any(isinstance(border, Rows) for border in there.borders)
    if surfaces or row[layout.unknowns : layout.size].any():
        return None
    unit = there.first.action_unit
    across = np.zeros(tr.mesh.nodes.size * asked.system.n)
    across[layout.free] = row[: layout.unknowns] * unit / there.first.x_unit
    nodes = np.einsum("kn,knr->kr", across.reshape(tr.mesh.nodes.size, -1) * form.units, form.basis)
    parts: list[Array] = [np.empty(0)] * len(form.elements)
    for g in tr.layout.groups:
        for e, of in zip(g.elements, g.nodes, strict=True):
            first = of if e == 0 else of[1:]  # nodes between elements once
            parts[e] = np.concatenate(
                [np.zeros((of.size - first.size, form.freedom)), nodes[first]]
            ).ravel()
    point = tr.place(at.x)
    mass = asked.system.pointwise("second").product(2, tr.second(at.x)[2], point.v, symmetric=True)
    kinetic = float(np.sum(tr.weight * point.v * mass))
    assert there.log_duration is not None
    return BorderTerm(float(row[there.log_duration]) * unit, parts), kinetic


def tolerance_of(error: float) -> float:
    """Return |mu| below which eigenvalues have no sign along a path known to `error`, if it is."""
    return max(float(np.fmin(ERROR_GAIN * error, LOOSEST)), INDEX_TOLERANCE)


def inertia_of(form: Form, tolerance: float = INDEX_TOLERANCE, moves: int = 0) -> Inertia:
    """Return the index and the nullity of a discrete second variation, `moves` of it known."""
    if not form.freedom:
        return Inertia(0, 0, None, tolerance)
    check_legendre(form)

    def below(mu: float) -> int:
        return condense(form, form.shifted(kinetic=mu)).negative

    index = below(-tolerance)
    nullity = below(tolerance) - index
    if not nullity:
        return Inertia(index, 0, None, tolerance)
    if nullity == moves:
        return Inertia(index, nullity, 0.0, tolerance)
    low, high = 1e-17, tolerance  # the smallest |mu|, to a tenth of itself
    while high > 1.1 * low and high > 1e-16:
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if below(middle) > below(-middle) else (middle, high)
    return Inertia(index, nullity, high, tolerance)
