"""Saddles above free ends: paths of least action between ends at which that action is greatest.

Where the action falls without bound as free ends run away, the least action between given ends is
greatest somewhere: there p = dS/dq (Hamilton's principal function) vanishes at the ends. Each step
is Newton's for the path, and for the ends e Newton's with the signs of the eigenvalues of S_ee
turned to negative ones, uphill. With a spring on each end, P = H + k E E', all is had from
solutions with P, which is positive definite where the action between the ends is convex:

    (P^-1)_ee = (S_ee + k)^-1,

whose eigenvectors are those of S_ee.
"""

from __future__ import annotations

import numpy as np

from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.matrices.factors import Factors, diagonal
from actionopt.discrete.newton.newton import SURELY
from actionopt.solver.search.homotopy import RUNAWAY_CURVE
from actionopt.tools.types import Array, NDInt

CLIMB_STEPS = 20  # measured on 400 random questions: 17 that are found take 5 to 16
LONGEST_END_STEP = 1.0  # of a step of the ends, in the coordinates' sizes; ad hoc
SPRING = 4.0  # in the largest second derivative of S; ad hoc


def free_ends(tr: Transcription) -> NDInt:
    """Return which unknowns are coordinates at the first and the last node."""
    node = tr.layout.free // tr.layout.width
    return np.flatnonzero((node == 0) | (node == tr.layout.node_count - 1))


def climb(tr: Transcription, z: Array) -> tuple[Array | None, int]:
    """Return a point (size,) near such a saddle, or None, and the factorizations used."""
    ends, last = free_ends(tr), 0.0
    columns = np.zeros((tr.layout.size, 1 + ends.size))
    columns[ends, 1 + np.arange(ends.size)] = 1.0
    springs = diagonal(tr.layout, columns.sum(axis=1))
    with np.errstate(all="ignore"):
        for k in range(1, CLIMB_STEPS + 1):
            H, columns[:, 0] = tr.kkt(z), -tr.residual(z)
            spring = SPRING * float(np.abs(H).max())
            try:
                factors = Factors(tr.layout, H + spring * springs)
                if not factors.definite():
                    return None, k
                solved = factors.solve_many(columns)
                newton, moved = solved[:, 0], solved[:, 1:]  # moved = P^-1 E
                flexible, modes = np.linalg.eigh(moved[ends])  # of (S_ee + spring)^-1
            except np.linalg.LinAlgError:
                return None, k
            carried, by_newton = 1 / flexible, modes.T @ newton[ends]
            curvature = carried - spring
            step = -carried * by_newton / np.abs(curvature)  # along the modes: dS/de / |S_ee|
            length = float(np.abs(modes @ step).max())
            step *= min(1.0, LONGEST_END_STEP / length) if length else 1.0
            whole = newton + moved @ (modes @ (carried * (step - by_newton)))
            z, size = z + whole, float(np.abs(whole).max())
            if not np.abs(z).max() < RUNAWAY_CURVE:
                return None, k
            # That was a step of Newton's own.
            if curvature.max() < 0 and length <= LONGEST_END_STEP and size < SURELY * last:
                return z, k
            last = size
    return None, CLIMB_STEPS
