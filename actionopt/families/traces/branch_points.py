"""Branch points: where eigenvalues of Newton's matrix vanish along a branch that does not turn.

No step leads on to such a point, where another branch crosses as a rule. What does is the path that
a force along the null vectors makes stationary (Lyapunov and Schmidt's reduction). With K bordered
by near null vectors B,

    r(z, s) = B beta,    B'z = a,    [K B; B' 0] [X; -M] = [0; I],    M = d beta / da = X'K X,

amplitudes a and s may be chosen freely, and the matrix stays regular. At a branch point beta does
not change to first order, neither with a nor along the branch, in direction u: M is singular and
d beta / du = 0. Newton's method for these takes a factorization a step. The force that is left,
beta, tells how far the branches miss each other, as those of an imperfect pitchfork do (W. J. F.
Govaerts, *Numerical Methods for Bifurcations of Dynamical Equilibria* (2000), chapters 3, 6 and 7).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from actionopt.analysis.quadratic.assembled import scattered_numbers
from actionopt.discrete.borders.arclength import Branch, BranchPoint
from actionopt.discrete.matrices.factors import Factors, product
from actionopt.discrete.matrices.layout import MatrixLayout, border_matrix
from actionopt.tools.immutable import immutable
from actionopt.tools.types import Array

# Ad hoc, but for `DIFFERENCED`.
SPARE_NULLS = 2  # eigenvalues near zero beside those that vanish: others may be as near halfway
NULL_STEPS = 4  # of inverse iteration, for near null vectors: any border will do
MOST_STEPS = 12  # of Newton's method; four are usual
SETTLED_POINT = 1e-7  # arclength of the last step: one more would be of its square
BEYOND = 0.1  # how far beyond the part sought in a first estimate may be
REMAINDER = 1e-6  # what is left of right sides: Newton's method corrects the rest
# Step of differences, in arclength: near EPS^(1/4), as second ones ask.
DIFFERENCED = 1e-4


class Miss(NamedTuple):
    """Where branches miss each other: so far along a chord, and by the square of `apart`."""

    along: float
    apart: float  # of hyperbolas, amplitude times arclength


@immutable
class _Reduced:
    """The reduced equations beta(a, u) at a path, with their first and second derivatives."""

    z: Array  # corrected beside the null vectors
    correction: float
    null: Array  # X (size, m)
    beta: Array  # (m,)
    along: Array  # u (size + 1,)
    by_a: Array  # M (m, m)
    by_u: Array  # (m,)
    by_uu: Array
    by_au: Array  # dM/du (m, m)
    by_aa: Array  # dM/da (m, m, m), the last by amplitude


def branch_points(
    branch: Branch, here: tuple[Array, float], there: tuple[Array, float], change: int, gap: float
) -> list[BranchPoint] | Miss | None:
    """Return the points between two ones, each (z, s), where the index changes by one at a time.

    By `change` in all. Or the first place where branches miss each other, amplitude times
    arclength more than `gap`. None where nothing is found.
    """
    chord = np.r_[there[0] - here[0], there[1] - here[1]]
    middle = np.r_[here[0], here[1]] + chord / 2
    with np.errstate(all="ignore"):
        try:
            parts, near = _estimate(branch, middle, chord, change)
            found = [_locate(branch, middle, chord, near, k, x, gap) for k, x in enumerate(parts)]
        except np.linalg.LinAlgError:
            return None
    if missed := [point for point in found if isinstance(point, Miss)]:
        return min(missed)
    points = [point for point in found if isinstance(point, BranchPoint)]
    return points if len(points) == abs(change) else None


def _estimate(
    branch: Branch, middle: Array, chord: Array, change: int
) -> tuple[list[float], Array]:
    """Return where eigenvalues pass zero, in parts of the chord from its middle, and null vectors.

    Those eigenvalues whose passing changes the index as it changes.
    """
    tr = branch.at(float(middle[-1]))
    cut, count = tr.layout.unknowns, min(abs(change) + SPARE_NULLS, tr.layout.unknowns)
    branch.solves += 1
    K = tr.kkt(middle[:-1])
    factors = Factors(tr.layout, K)
    X = np.zeros((tr.layout.size, count))
    X[:cut] = scattered_numbers(cut * count).reshape(cut, count)
    for _ in range(NULL_STEPS):
        X[:cut], X[cut:] = np.linalg.qr(X[:cut])[0], 0.0
        X = np.stack([factors.solve(x, REMAINDER) for x in X.T], axis=1)
    X /= np.abs(X[:cut]).max(axis=0)
    h = DIFFERENCED / branch.norm(tr, chord)
    rate = X.T @ _difference(branch, middle, chord, h, X)[1]
    inverses, vectors = np.linalg.eig(-np.linalg.solve(X.T @ _times(tr.layout, K, X), rate))
    parts, vectors = 1 / np.real(inverses), np.real(vectors)
    falls = np.einsum("ik,ij,jk->k", vectors, rate, vectors)
    own = (np.abs(parts) < 0.5 + BEYOND) & np.isreal(inverses) & (falls * change < 0)
    order = np.flatnonzero(own)[np.argsort(parts[own])]
    return parts[order].tolist() if len(order) == abs(change) else [], X @ vectors[:, order]


def _locate(
    branch: Branch, middle: Array, chord: Array, near: Array, k: int, part: float, gap: float
) -> BranchPoint | Miss | None:
    """Return the point near `part` of the chord where the k-th eigenvalue of M vanishes; or None.

    Or where branches miss each other there. `near` (size, m) are near null vectors there.
    """
    y = middle + part * chord
    for _ in range(MOST_STEPS):
        at = _reduce(branch, y, chord, near)
        a, by_part = -np.linalg.solve(at.by_au, np.stack([at.by_u, at.by_uu], axis=1)).T
        M, rate = at.by_a + at.by_aa @ a, at.by_au + at.by_aa @ by_part
        move = np.sort(np.linalg.eigvals(-np.linalg.solve(rate, M)).real)[k]
        change = move * at.along
        change[:-1] += at.null @ (a + move * by_part)
        y = np.r_[at.z, y[-1]] + change
        part, near, tr = part + move, at.null, branch.at(float(y[-1]))
        size = branch.norm(tr, change) + at.correction
        if not abs(part) < 1 or not np.isfinite(size):
            return None
        # Amplitude times arclength is constant along branches that miss each other, hyperbolas.
        off = np.r_[at.null @ np.linalg.solve(at.by_au, at.beta), 0.0]
        reach = branch.norm(tr, chord)
        apart = branch.norm(tr, off) * reach
        if apart * (1 - size / reach) > gap:  # it changes by such parts
            return Miss((0.5 + part) * reach, float(np.sqrt(apart)))
        if size < SETTLED_POINT:
            is_met = abs(part) <= 0.5 and apart <= gap
            return BranchPoint(tr, y[:-1], float(y[-1]), at.along) if is_met else None
    return None


def _reduce(branch: Branch, y: Array, chord: Array, near: Array) -> _Reduced:
    """Return the reduced equations at y = (z, s), bordered by near null vectors (size, m)."""
    tr = branch.at(float(y[-1]))
    z, cut, size, m = y[:-1], tr.layout.unknowns, tr.layout.size, near.shape[1]
    B = np.zeros((size, m))
    B[:cut] = np.linalg.qr(near[:cut])[0]
    branch.solves += 1
    factors = Factors(*border_matrix(tr.layout, tr.kkt(z), B, B.T, np.zeros((m, m))))

    def solve(right: Array) -> tuple[Array, Array]:
        x = factors.solve(right, REMAINDER)
        return x[:size], x[size:]

    X, M = (np.stack(x, axis=1) for x in zip(*map(solve, np.eye(m, size + m, size)), strict=True))
    change, beta = solve(np.r_[tr.residual(z), np.zeros(m)])
    z, y = z - change, y - np.r_[change, 0.0]
    h = DIFFERENCED / branch.norm(tr, chord)
    r_v = _difference(branch, y, chord, h)[0]
    along = chord - np.r_[solve(np.r_[r_v, np.zeros(m)])[0], 0.0]
    r_u, K_u, r_uu = _difference(branch, y, along, h, X)
    by_u = solve(np.r_[r_u, np.zeros(m)])[1]
    h_a, ways = DIFFERENCED * np.sqrt(cut), np.c_[X.T, np.zeros(m)]
    by_aa = np.stack([X.T @ _difference(branch, y, a, h_a, X)[1] for a in ways], axis=2)
    by_uu = X.T @ (r_uu - 2 * tr.residual(z) / h**2)
    moved = branch.norm(tr, np.r_[change, 0.0])
    return _Reduced(z, moved, X, beta, along, -M, by_u, by_uu, X.T @ K_u, by_aa)


def _difference(
    branch: Branch, y: Array, way: Array, h: float, X: Array | None = None
) -> tuple[Array, Array, Array]:
    """Return the derivatives of r and of K X at y along a way, and the sum of r beside over h^2."""
    sides = [y + h * way, y - h * way]
    trs = [branch.at(float(x[-1])) for x in sides]
    r = [tr.residual(x[:-1]) for tr, x in zip(trs, sides, strict=True)]
    KX = [np.zeros(0)] * 2
    if X is not None:
        KX = [_times(tr.layout, tr.kkt(x[:-1]), X) for tr, x in zip(trs, sides, strict=True)]
    return (r[0] - r[1]) / (2 * h), (KX[0] - KX[1]) / (2 * h), (r[0] + r[1]) / h**2


def _times(layout: MatrixLayout, nonzeros: Array, X: Array) -> Array:
    return np.stack([product(layout, nonzeros, x) for x in X.T], axis=1)
