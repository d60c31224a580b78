"""How far the multipliers of constraints are from true, estimated."""

from __future__ import annotations

import numpy as np

from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.mechanics.question.scales import NEGLIGIBLE
from actionopt.tools.types import Array


def multiplier_error(at: DiscretePath, values: Array, velocities: Array, lam: Array) -> float:
    """Return the estimate of `Solution.multiplier_error`.

    The coordinates' `values` and `velocities` (n, K) are those at the nodes, and `lam` (m, K) the
    multipliers of the discrete problem there.

    Raises ValueError without constraints, or where these are not independent.
    """
    problem, system, t = at.problem.free, at.problem.free.system, at.mesh.nodes
    if not system.m:
        raise ValueError("expected a system with constraints: this one has no multipliers")
    exact, given = at.multipliers(t).T[: system.m], lam[: system.m]
    q, times = values.T, t[:, None]
    second = system.pointwise("second")
    rows, cols = second.sparsity(2)
    inertias = np.zeros((t.size, system.n))
    mine = rows == cols
    inertias[:, rows[mine]] = np.abs(second(q, velocities.T, times, problem.packed)[2][:, mine])
    jacobian = system.pointwise("constraint_jacobian")
    rows, cols = jacobian.sparsity(0)
    squares = jacobian(q, times, problem.packed)[0] ** 2
    mass = inertias[:, cols]
    shares = np.zeros((t.size, system.m))
    np.add.at(shares.T, rows, np.where(mass > 0, squares / np.where(mass > 0, mass, 1.0), 0).T)
    unit = np.sqrt(shares.max(axis=0))
    unit = np.where(unit > 0, unit, 1.0)[:, None]  # a row of coordinates without inertia
    size = np.max(unit * np.abs(exact))
    motion = np.max(np.sqrt(inertias.max(axis=0)) * np.abs(q)) / problem.duration**2
    size = size if size > NEGLIGIBLE * motion else motion or 1.0
    return 8 * float(np.nanmax(unit * np.abs(given - exact))) / float(size)
