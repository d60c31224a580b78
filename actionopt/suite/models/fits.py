"""Motions fitted to measured positions: sums of squares whose least is known at any residual.

What was measured is the motion at x*, less a vector orthogonal to all its derivatives there:
J'r = 0 by construction, however large r is. The Hessian is J'J + sum r_i r_i'': at a size of r that
is known it ceases to be positive. Gauss and Newton's method leaves out the second term.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from actionopt.suite.models.model import KnownAnswer, WrittenModel
from actionopt.tools.types import Array

FIT_SEED = 4  # of the direction of the residuals


def decaying_oscillations(
    *, modes: int = 1, points: int = 60, residual: float = 0.1
) -> WrittenModel:
    """Return the fit of a sum of decaying oscillations, a exp(-g t) cos(w t + p) each.

    `residual` is the length of r at x*: for small ones x* is the least. Raises ValueError for
    fewer points than unknowns, and for a negative residual.
    """
    for name, count, least in (("modes", modes, 1), ("points", points, 4 * modes + 1)):
        if count != int(count) or count < least:
            raise ValueError(
                f"expected a whole number of {name}, at least {least}, found {count!r}"
            )
    if not 0 <= residual < np.inf:
        raise ValueError(f"expected a residual that is not negative, found {residual!r}")
    t = np.linspace(0, 6, points)
    x = ca.SX.sym("x", 4 * modes)
    motion = ca.SX.zeros(points)
    for a, g, w, p in (ca.vertsplit(part) for part in ca.vertsplit(x, 4)):
        motion += a * ca.exp(-g * t) * ca.cos(w * t + p)
    best = np.ravel(
        [[1 / (k + 1), 0.1 + 0.05 * k, 1.5 * (k + 1), 0.3 - 0.2 * k] for k in range(modes)]
    )
    at = ca.Function("at", [x], [motion, ca.jacobian(motion, x)])
    q, J = (np.array(part) for part in at(best))
    Q = np.linalg.qr(J)[0]
    off = np.random.default_rng(FIT_SEED).normal(size=points)
    for _ in range(2):  # once more for round-off
        off = off - Q @ (Q.T @ off)
    off *= 1 / np.linalg.norm(off)
    r = motion - (q.ravel() - residual * off)
    H = ca.Function("H", [x], [ca.hessian(ca.sumsqr(r) / 2, x)[0]])

    def by_construction() -> KnownAnswer:
        low = int(np.sum(np.linalg.eigvalsh(np.array(H(best))) < 0))
        how = "by construction: residuals orthogonal to the derivatives; eigenvalues"
        return KnownAnswer(best, np.zeros(0), how, index=low)

    return WrittenModel(
        "decaying_oscillations",
        x,
        ca.sumsqr(r) / 2,
        residuals=r,
        start=best * np.tile([0.8, 1.5, 1.05, 1.2], modes),
        answer=by_construction,
        tags=("least squares",),
    )


def largest_residual(problem: WrittenModel) -> float:
    """Return the length of r at which x* ceases to be a minimum: a smaller one is a minimum.

    The first s at which J'J + s B is singular, B being the second term where r has the length 1.
    Raises ValueError of a problem whose residuals are zero.
    """
    x, r = problem.x_star, problem.residuals(problem.x_star)
    size = float(np.linalg.norm(r))
    if not size:
        raise ValueError("expected residuals, found none: no direction of theirs is known")
    J = problem.residual_jacobian(x)
    H = np.zeros((problem.n, problem.n))
    H[problem.hessian_structure] = problem.hessian(x)
    H = H + np.triu(H, 1).T
    L = np.linalg.cholesky(J.T @ J)
    inner = np.linalg.solve(L, np.linalg.solve(L, (H - J.T @ J) / size).T)
    lowest: Array = np.linalg.eigvalsh((inner + inner.T) / 2)
    return float(-1 / lowest[0]) if lowest[0] < 0 else np.inf
