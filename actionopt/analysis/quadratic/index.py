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

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from actionopt.analysis.quadratic.jacobi import improve, resolve
from actionopt.analysis.quadratic.regular import regular_index
from actionopt.analysis.quadratic.second_variation import (
    Form,
    check_legendre,
    condense,
    form,
    second_derivatives,
)
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.borders.bordered import Bordered, equations_of, null_space
from actionopt.discrete.borders.borders import PhaseCondition, moves_of
from actionopt.discrete.borders.contact_times import bend_of_contacts, restrict
from actionopt.discrete.borders.integrals import are_dependent
from actionopt.discrete.matrices.factors import Factors, diagonal, full, negative_signs
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.discrete.newton.increments import Increments, is_stiff
from actionopt.tools.blas import one_thread
from actionopt.tools.types import Array
from actionopt.tools.watch import check_time

# What the mesh leaves out of Jacobi fields; derived: eigenvalues converge twice as fast, to 1e-12,
# far below the tolerance. The error of a path that is improved to tell a sign: a tenth of that.
INDEX_RESOLUTION, POLISHED = 1e-6, 1e-10
# |mu| below which it may be zero; measured: of families 1e-6 at most on paths to 1e-8.
NEAR_ZERO = 1e-5
INDEX_TOLERANCE = 1e-8  # least |mu| that has a sign; ad hoc: the default `tol` of a path
LOOSEST = 1e-2  # |mu| moved by a path whose error is not known; ad hoc
DENSE_SIGNS = 1000  # unknowns and rows up to which signs on what rows allow are full ones; ad hoc
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
        The smallest |mu|, where it is below the tolerance.
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
def inertia(at: DiscretePath, error: float) -> Inertia:
    """Return the index and the nullity of the second variation along a path known to `error`.

    Ten times the path's error is how far an eigenvalue may be off. Where that leaves signs open,
    the path is improved and they are counted again, so that "degenerate" is said of the problem
    and not of the tolerance its path was solved to.

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
    tolerance = tolerance_of(error)
    index = regular_index(at, error, max(tolerance, NEAR_ZERO))
    if index is not None:
        return Inertia(index, 0, None, tolerance)
    found, form = _count(at, error, _alone, resolved=at.tr.order == 1)
    return found if form is None else _with_smallest(found, form)


def inertia_asked(at: DiscretePath, error: float) -> Inertia:
    """Return the index and nullity of a path whose duration was found, or that closes anywhere.

    Its duration varies with it, S + E T is what is lowered: index = negative eigenvalues of the
    second derivative of W in everything unknown - multipliers, as `inertia_through` has it. What
    moves a closed path along itself, or as a whole by a symmetry of L, makes no other path of it,
    but where the start gives coordinates: phase conditions keep it from that, and those moves are
    counted as vanishing eigenvalues.
    """
    problem = at.problem
    plain = not (problem.touches or problem.original.integral is not None or at.tr.order > 1)
    return _count(at, error, _beside, resolved=plain)[0]


def inertia_beside(form: Form) -> Inertia:
    """Return the inertia of a path and of what was found beside it, on the mesh of a form."""
    return _beside(form.at, INDEX_TOLERANCE, form)


def _beside(at: DiscretePath, tolerance: float, form: Form | None) -> Inertia:
    asked = at.problem.original
    bordered, y = equations_of(asked, at, moves_of(asked))
    assert isinstance(bordered, Bordered)
    found = _on_its_mesh(bordered.discrete(y), bordered, y, tolerance, form)
    if bordered.start_coordinates and found.nullity:
        # What is given chooses of a family; a symmetry may well lead along what is left of that.
        free, places = bordered.without(PhaseCondition)
        held = [int(free.first.layout.number[0, i]) for i in asked.start.pinned]
        left = _on_its_mesh(free.discrete(y), free, y[places], tolerance, form, held)
        return replace(found, nullity=left.nullity)
    shifts = bordered.phases - len(bordered.start_coordinates)
    return replace(found, nullity=found.nullity + shifts, moves=shifts)


def inertia_through(at: DiscretePath, error: float) -> Inertia:
    """Return the index and nullity of a path through events or between surfaces, as a whole.

    Places and times that were to be found are varied with the path: index = negative eigenvalues of
    the second derivative of W in everything unknown - multipliers (Haynsworth; J. Nocedal and S. J.
    Wright, *Numerical Optimization* (2nd ed. 2006), theorem 16.3), on the mesh of the path. Raises
    ValueError as `inertia` does.
    """
    return _count(at, error, _through)[0]


def _alone(at: DiscretePath, tolerance: float, form: Form | None) -> Inertia:
    if form is None:
        return _on_its_mesh(at, at.tr, at.z, tolerance)
    return _signs_of(form, tolerance)


def _through(at: DiscretePath, tolerance: float, _: Form | None) -> Inertia:
    equations, z = equations_of(at.problem.original, at)
    return _on_its_mesh(at, equations, z, tolerance)


def _count(
    at: DiscretePath,
    error: float,
    count: Callable[[DiscretePath, float, Form | None], Inertia],
    *,
    resolved: bool = False,
) -> tuple[Inertia, Form | None]:
    """Return the inertia on the mesh of a path, or on one where Jacobi fields are `resolved`.

    And the form there. An eigenvalue that is zero comes to zero as the path comes to be exact, and
    another one does not: where signs are open they are counted again along a better path, so that
    no verdict hangs on the tolerance.
    """
    tolerance = tolerance_of(error)
    form = resolve(at, error, INDEX_RESOLUTION) if resolved else None
    near = at if form is None else form.at
    found = count(near, max(tolerance, NEAR_ZERO), form)
    if found.nullity <= found.moves:
        return replace(found, tolerance=tolerance), form
    if not (error <= POLISHED or at.problem.touches):
        with suppress(ValueError):  # a spurious path may be resolved on no mesh
            better = improve(at, POLISHED, found.nullity - found.moves, with_form=resolved)
            if better is not None:
                (near, form), tolerance = better, INDEX_TOLERANCE
    return count(near, tolerance, form), form


def _on_its_mesh(
    at: DiscretePath,
    equations: Bordered | Transcription,
    z: Array,
    tolerance: float,
    resolved: Form | None = None,
    held: Sequence[int] = (),
) -> Inertia:
    """Return the inertia of the derivative of the equations of a path on its mesh.

    The second variation on that mesh, `resolved`, tells which L are refused; without one L_vv does.
    Variations of the unknowns `held` are not counted. For a path in contact, variations that keep
    what is in contact there are counted: to second order S does not depend on the times of contact.
    """
    problem, tr = at.problem, at.tr
    if problem.system.structure.forced:
        form(at)  # raises
    if problem.integral is not None and are_dependent(at):
        raise ValueError(
            "expected integrals that are independent, found that near the path they depend on one "
            "another: no multipliers are determined, nor what these add to the second variation; "
            "leave those out that others tell"
        )
    mass = second_derivatives(problem, tr.place(at.x).at, tr.place(at.x).v, tr.times)[2]
    least = np.linalg.eigvalsh(mass).min(axis=1)
    at_ends = np.isin(tr.times[:, 0], tr.mesh.boundaries[[0, -1]])  # the mass may vanish there
    if resolved is not None:
        check_legendre(resolved)
    elif not ((least > 0) | (at_ends & (least == 0))).all():
        raise ValueError(
            "expected a Lagrangian that is convex in the velocities (Legendre's strengthened "
            "condition), found one that is not along the path: infinitely many variations lower "
            "the action, and no index counts them"
        )
    layout, multipliers = equations.layout, int(equations.is_multiplier.sum())
    kinetic, matrix = equations.kinetic(z), equations.symmetric_kkt(z)
    rows = np.zeros((0, tr.layout.unknowns))
    if tr.order > 1 and problem.touches:
        bend, rows = bend_of_contacts(at)
        matrix[: bend.size] += bend
    springs = np.zeros(layout.size)
    springs[list(held)] = np.abs(matrix).max()
    matrix = matrix + diagonal(layout, springs)

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
    projected = layout.rows and (tr.order > 1 or layout.size <= DENSE_SIGNS)
    basis = restrict(null_space(equations, full(layout, matrix)), rows) if projected else None

    def below(mu: float) -> int:
        check_time()  # signs of one matrix are counted at once
        shifted = matrix - mu * kinetic
        if basis is not None:
            # Pivots of the whole are off by what makes rows regular. In higher orders the rows are
            # integrals of functions that nearly depend on one another on elements of a high degree.
            return negative_signs(basis.T @ full(layout, shifted) @ basis)
        if stiff:
            return Increments(equations, z, shifted, mu).negative() - multipliers
        return Factors(layout, shifted).negative() - multipliers

    near = below(tolerance)  # of a clear minimum there are none to be told apart
    index = below(-tolerance) if near else 0
    return Inertia(index, near - index, None, tolerance)


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
    found = np.zeros(equations.layout.size)
    found[: layout.unknowns] = np.where(whole, weight[node] * inertia, 0.0) * tr.x_unit**2
    found /= tr.action_unit * tr.mesh.duration ** (2 * tr.order)
    return diagonal(equations.layout, found)


def tolerance_of(error: float) -> float:
    """Return |mu| below which eigenvalues have no sign along a path known to `error`, if it is."""
    return max(float(np.fmin(ERROR_GAIN * error, LOOSEST)), INDEX_TOLERANCE)


def inertia_of(form: Form, tolerance: float = INDEX_TOLERANCE) -> Inertia:
    """Return the index and the nullity of a discrete second variation, and the smallest |mu|."""
    return _with_smallest(_signs_of(form, tolerance), form)


def _with_smallest(found: Inertia, form: Form) -> Inertia:
    """Return the inertia with the smallest |mu|, to a tenth of itself, where signs are open."""
    if not found.nullity:
        return found
    low, high = 1e-17, found.tolerance
    while high > 1.1 * low and high > 1e-16:
        middle = float(np.sqrt(low * high))
        zeros = _below(form, middle) > _below(form, -middle)
        low, high = (low, middle) if zeros else (middle, high)
    return replace(found, smallest=high)


def _signs_of(form: Form, tolerance: float) -> Inertia:
    """Return what `inertia_of` does, without the smallest |mu|."""
    if not form.freedom:
        return Inertia(0, 0, None, tolerance)
    check_legendre(form)
    index = _below(form, -tolerance)
    return Inertia(index, _below(form, tolerance) - index, None, tolerance)


def _below(form: Form, mu: float) -> int:
    """Return the number of eigenvalues below mu."""
    return condense(form, form.shifted(mu)).negative
