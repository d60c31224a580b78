"""When a path passes its events: times that lower the action of the paths over them.

Between given times Newton's method finds a path from far away, but events and paths at once have a
small neighbourhood: as a leg becomes short its action grows without bound. The action of the path
over given times is a function of these times alone, and falls along Newton's step for it, or
against that where it bends down: so it is lowered as any function of few numbers (J. Nocedal and
S. Wright, *Numerical Optimization* (2006), section 3.1).
"""

from __future__ import annotations

import numpy as np

from actionopt.discrete.borders.bordered import Bordered
from actionopt.discrete.matrices.factors import Factors
from actionopt.discrete.meshes.element import with_degrees
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.newton.newton import approach
from actionopt.mechanics.question.problem import Problem
from actionopt.solver.refinement.iterate import coordinate_scales
from actionopt.solver.refinement.signals import HALVINGS
from actionopt.solver.refinement.workspace import PATIENT
from actionopt.tools.types import Array

# The step of logarithms of durations from which events and paths at once converge. Measured on
# splines of least snap: three hundredths is too far for legs of a fifth, a thousandth costs none.
NEAR_TIMES = 1e-3


def lower(problem: Problem, path: Path, times: Array) -> tuple[Path, Array] | None:
    """Return a path near one of least action in its times, and these; None if none is found.

    None, too, where surfaces are to be met, or paths close: those are seldom least.
    """
    path = path.on(with_degrees(path.mesh, problem.system.order))
    lengths = coordinate_scales(problem.found_at(times), path.values.T)[1]
    equations, y = Bordered.around(problem, path, None, lengths, times=times)
    if equations.times_border is None or len(equations.borders) > 1:
        return None
    border, own = equations.times_border
    energy = (problem.energy or 0.0) / equations.first.action_unit

    def over_times(y: Array) -> tuple[Array, float] | None:
        """Return the unknowns of the path over the times of y, and S + E T."""
        tr = equations.at(y)
        found = approach(tr, y[: own.start], PATIENT)
        if found is None:
            return None
        t = border.times(y[own])
        return np.r_[found[0], y[own]], tr.action(found[0]) + energy * (t[-1] - t[0])

    now = over_times(y)
    for _ in range(PATIENT):
        if now is None:
            return None
        y, action = now
        residual = equations.residual(y)
        try:
            factors = Factors(equations.layout, equations.kkt(y))
            step = -factors.solve(residual)[own]
            size = float(np.abs(step).max())
            if size < NEAR_TIMES:
                down = _downwards(factors, own, y.size)
                if down is None:
                    return equations.discrete(y).path, border.times(y[own])
                step, size = down, 1.0
        except np.linalg.LinAlgError:
            return None
        if residual[own] @ step > 0:
            step = -step
        step *= min(1.0, 1 / size)  # no duration grows by more than e
        for _ in range(HALVINGS):
            now = over_times(np.r_[y[: own.start], y[own] + step])
            if now is not None and now[1] < action:
                break
            step, now = step / 2, None
    return None


def _downwards(factors: Factors, own: slice, size: int) -> Array | None:
    """Return how times change where the action bends down most, largest change 1; None if nowhere.

    The second derivative of the action by the times `own` alone is the inverse of their part of the
    inverse of the matrix (the Schur complement). Events that divide a symmetric path evenly are
    stationary, and often a maximum.
    """
    unit = np.eye(size)[own]
    inverse = np.array([factors.solve(row)[own] for row in unit])
    values, vectors = np.linalg.eigh((inverse + inverse.T) / 2)
    # The negative value of the inverse that is nearest to zero is the matrix's most negative one.
    down = np.flatnonzero(values < 0)
    if not down.size:
        return None
    step = vectors[:, down[-1]]
    return step / np.abs(step).max()
