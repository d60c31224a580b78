"""The index of a path at which no eigenvalue of the second variation is near zero.

Then one factorization of the KKT matrix [d2S, G'; G, 0] tells it, which has one negative eigenvalue
for each row besides (J. Nocedal and S. J. Wright, *Numerical Optimization* (2nd ed. 2006), theorem
16.3): work and memory are those of a step of Newton's method. How near zero an eigenvalue is, and
what round-off has made of the factors, inverse iteration tells. Where a sign may be open, or the
variations are not simply those between two events, nothing is said: `index` has the rest.
"""

from __future__ import annotations

import numpy as np

from actionopt.analysis.quadratic.assembled import (
    AssembledForm,
    assemble,
    on_mesh,
    scattered_numbers,
)
from actionopt.discrete.matrices.factors import Factors, product
from actionopt.discrete.newton.discrete_path import DiscretePath

FIELDS = 1e-4  # what a mesh may leave out of Jacobi fields: far below `CLEARLY` tolerances. Derived
LOWEST_STEPS = 3  # of inverse iteration: at each, what is near zero grows by its inverse; ad hoc
CLEARLY = 10.0  # times the tolerance: an eigenvalue so far from zero has a sign; ad hoc
LEFT_OF_LOAD = 1e-2  # of a right side, what the factors may leave of it in the lowest mode; ad hoc


def regular_index(first: DiscretePath, error: float, tolerance: float) -> int | None:
    """Return the index of a path known to `error`, or None where it is not told so easily.

    Or where an eigenvalue |mu| is near `tolerance`, 1e-5 or more. Raises ValueError where the
    constraints are not independent, or along a path through a singularity.
    """
    form = assemble(first, error, FIELDS)
    try:
        if form is None or not _is_clear(form, tolerance):
            return None
        index = form.factors.negative() - form.at.tr.layout.rows
        return index if index >= 0 else None  # below zero it is round-off
    except np.linalg.LinAlgError:
        return None


def index_on_mesh(at: DiscretePath, error: float, factors: Factors | None = None) -> int | None:
    """Return the index of a path as its own mesh has it, however that resolves Jacobi fields.

    By the `factors` of its KKT matrix, if they are known. None where the variations are not simply
    those between two events, or the mass may not be positive. Raises ValueError where the
    constraints are not independent.
    """
    form = on_mesh(at, error, factors)
    return None if form is None else index_of(form, factors)


def index_of(form: AssembledForm, factors: Factors | None = None) -> int | None:
    """Return the index of an assembled form by its pivots, None where these are singular."""
    layout = form.at.tr.layout
    try:
        if factors is None and layout.uses_condensation:
            return form.factors.negative() - layout.rows
        factors = factors or Factors(layout, form.matrix, many=True)
        return factors.negative_pivots() - layout.rows
    except np.linalg.LinAlgError:
        return None


def _is_clear(form: AssembledForm, tolerance: float) -> bool:
    """Whether no eigenvalue is near zero, and the factors tell the sign of the lowest ones."""
    tr, layout = form.at.tr, form.at.tr.layout
    kinetic = tr.kinetic(form.at.z)
    x = np.zeros(layout.size)
    x[: layout.unknowns] = scattered_numbers(layout.unknowns)
    load = product(layout, kinetic, x)
    before = float(x @ load)
    for _ in range(LOWEST_STEPS):
        x = form.factors.solve(load)
        miss = np.abs(product(layout, form.matrix, x) - load).max()
        if not miss <= LEFT_OF_LOAD * np.abs(load).max():  # or not a number
            return False
        load = product(layout, kinetic, x)
        size = float(x @ load)
        grown, before = np.sqrt(size / before), size
        if not 0 < grown * CLEARLY * tolerance < 1:
            return False
    return True
