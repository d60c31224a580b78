"""Levenberg and Marquardt's method on the equations of motion: from a rough path to one near it.

The second variation of a long motion has eigenvalues near zero, and along their modes the residual
of a rough path sends Newton's method far away. There the path itself knows better. With the
residual r and its derivative A the step dz = (dx, dmu) minimises

    |r + A dz|^2 + s^2 |dx|^2

where r counts as accelerations, in the norm of M^-1, and dx as displacements, in that of M, the
masses M = sum_k w_k L_vv(q_k) node by node. So s is the square of a rate: modes whose eigenvalue,
a rate squared too, is below s stay as they are; faster ones, and with them all that is only rough,
go where Newton's method would take them. Constraints are kept, and with y for a multiplier

    [ -s M  A  ] [ y  ]   [ -r ]
    [  A'  s M ] [ dz ] = [  0 ],

a symmetric quasi-definite matrix, which has factors L D L' in any order (Vanderbei, SIAM Journal on
Optimization 5 (1995) 100-113). As no such step is longer than |r| / 2 s, a radius for the steps
makes s proportional to |r|, and the method quadratic in the end (Yamashita and Fukushima, Computing
[Suppl] 15 (2001) 239-249). Newton's steps, s = 0, come first: each costs a seventh, and nothing
else is needed where they leave a tenth of the residual. After each step the path is put back on the
constraint surface, and its multipliers are those of least residual.
"""

from __future__ import annotations

import math

import casadi as ca
import numpy as np

from actionopt.discrete.action.assemble_sparse import forcing
from actionopt.discrete.action.projection import project
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.matrices.factors import REGULAR, Factors, Sparse
from actionopt.discrete.matrices.layout import Layout, Pattern
from actionopt.discrete.matrices.matrices import Matrices
from actionopt.discrete.newton.newton import CONTRACTION, SURELY
from actionopt.tools.immutable import immutable
from actionopt.tools.types import Array

# Ad hoc, where nothing else is said.
MARQUARDT_STEPS = 40
# Root mean square of a step in units of the coordinates' sizes: at first, and where it is given up.
RADIUS, NARROWEST = 0.1, 1e-3
NARROWER = 0.25  # of the radius, where a step does not help
STALLING = 0.9  # one that leads nowhere: to a mesh too coarse for the path, as a rule
# Least of s, where the fastest rate on the mesh is one: below it a square of A over s has no digit
# left of s. Derived.
LEAST_SHIFT = math.sqrt(np.finfo(float).eps)
# A step, in units of the coordinates' sizes, after which Newton's method follows. Measured on
# chains from rough guesses: a tenth of it takes a sixth more time, and as many are found.
NEAR_STEP = 1e-2


@immutable
class Settled:
    """The end of the steps: z (size,), whether a path is near it, and factorizations used."""

    z: Array
    near: bool
    iterations: int


def settle(tr: Transcription, z: Array) -> Settled:
    """Return the stationary path near z, or where the residual is least.

    Not at all where the mass matrix is not positive definite.
    """
    radius, cut, count = RADIUS, tr.layout.unknowns, 0
    with np.errstate(all="ignore"):
        try:
            at = _Masses.of(tr, z)
            first, norm = at.balance(z[:cut])
            z = first if math.isfinite(norm) else z
            plain = True  # as long as it is known at once to lead there
            while 0 < norm < math.inf and count < MARQUARDT_STEPS and radius > NARROWEST:
                count += 1
                step = _plain(tr, z) if plain else None
                if step is None:
                    plain = False
                    step = at.step(z, norm / (2 * radius * math.sqrt(at.total)))
                Q = project(tr, tr.coordinates(z + step))
                trial, left = at.balance(tr.pack(Q)[:cut])
                ratio, size = left / norm, tr.relative_step(trial - z)
                if ratio < CONTRACTION and size < NEAR_STEP:
                    return Settled(trial, True, count)
                if plain and not ratio < SURELY:
                    plain = False
                    continue
                if not ratio < 1:
                    radius *= NARROWER
                    continue
                z, norm = trial, left
                if ratio > STALLING:
                    break
        except np.linalg.LinAlgError:
            pass
    return Settled(z, False, count)


def _plain(tr: Transcription, z: Array) -> Array | None:
    """Return Newton's step (size,), None where the matrix is singular."""
    try:
        return -Factors(tr.layout, tr.kkt(z)).solve(tr.residual(z))
    except np.linalg.LinAlgError:
        return None


@immutable
class _Masses:
    """The norms in which residuals and steps are measured, along one path."""

    tr: Transcription
    systems: _Systems
    mass: Array  # nonzeros of M on the pattern `layout.masses`, in the units of z
    total: float  # its trace

    @classmethod
    def of(cls, tr: Transcription, z: Array) -> _Masses:
        """Return them along z. Raise numpy.linalg.LinAlgError where M is not positive definite."""
        layout, system = tr.layout, tr.problem.system
        C = tr.second(z[: layout.unknowns])[2]
        some = C[:1] if system.structure.constant_mass else C
        upper = system.pointwise("second").full(2, some)
        np.linalg.cholesky(upper + np.swapaxes(np.triu(upper, 1), 1, 2))
        if "marquardt" not in layout.solvers:
            layout.solvers["marquardt"] = _Systems(layout)
        M = layout.masses
        mass = M.sum((tr.weight * C).ravel()) * tr.x_unit[M.row] * tr.x_unit[M.col]
        mass /= tr.action_unit
        return cls(tr, layout.solvers["marquardt"], mass, float(mass[M.row == M.col].sum()))

    def balance(self, x: Array) -> tuple[Array, float]:
        """Return (x, mu) with the multipliers of least residual, and its norm."""
        g, rows = self.tr.gradient(x), self.tr.layout.rows
        J = self.tr.jacobian(x) if rows else np.zeros(0)
        # M a + J' nu = g and J a = 0: with mu = -nu the residual is M a.
        found = self.systems.balance(self.mass, J, np.concatenate([g, np.zeros(rows)]))
        M, a = self.tr.layout.masses, found[: x.size]
        twice = np.where(M.row == M.col, 1.0, 2.0)
        square = float((twice * self.mass * a[M.row]) @ a[M.col])
        norm = math.sqrt(square) if math.isfinite(square) else math.inf
        return np.concatenate([x, -found[x.size :]]), norm

    def step(self, z: Array, s: float) -> Array:
        """Return the step (size,) that keeps what is slower than sqrt(s)."""
        tr, x = self.tr, z[: self.tr.layout.unknowns]
        J = tr.jacobian(x) if tr.layout.rows else np.zeros(0)
        F = forcing(tr, x) if tr.problem.system.structure.forced else np.zeros(0)
        H = tr.hessian(z)
        s = max(s, LEAST_SHIFT * float(np.abs(H).max()) / float(np.abs(self.mass).max()))
        return self.systems.step(H, J, F, s * self.mass, -tr.residual(z))


class _Systems:
    """The two symmetric systems of a layout: for multipliers, and for steps.

    The pattern of `balancing` is that of [M, J'; J, 0], that of `stepping` of [-M, A; A', M] with
    A = [H + F, J'; J, 0], for unknowns y and dz; `place` is where each of y is, dz behind it.
    """

    def __init__(self, layout: Layout) -> None:
        n, size, rows = layout.unknowns, layout.size, np.arange(layout.unknowns, layout.size)
        H, M = layout.hessian, layout.masses
        self.H_off, self.M_off = H.row != H.col, M.row != M.col
        self.regular = np.full(layout.rows, REGULAR)
        J = (layout.jacobian.row + n, layout.jacobian.col) if layout.rows else (rows, rows)
        F = (layout.forcing.row, layout.forcing.col) if layout.system.structure.forced else J[:0]
        mass = (M.row, M.col), (M.col[self.M_off], M.row[self.M_off]), (rows, rows)
        A = [(H.row, H.col), (H.col[self.H_off], H.row[self.H_off]), J, J[::-1]]
        if F:
            A.append(F)
        self.balancing = Pattern.build(size, size, [*mass, J, J[::-1]])
        # Unknowns of y and dz take turns, in the order of least fill of A. Measured: minimum degree
        # sought among both takes 50 times the operations at 100 links.
        order = np.array(Pattern.build(size, size, A).sparsity.ldl()[1])
        self.place = np.empty_like(order)
        self.place[order] = 2 * np.arange(size)
        y, dz = self.place, self.place + 1
        self.stepping = Pattern.build(
            2 * size,
            2 * size,
            [
                *((y[row], dz[col]) for row, col in A),
                *((dz[col], y[row]) for row, col in A),
                *((y[row], y[col]) for row, col in mass),
                *((dz[row], dz[col]) for row, col in mass),
            ],
        )
        self._balancer = Sparse(self.balancing, "ldl")
        self._matrices = Matrices(self.stepping.sparsity)

    def balance(self, mass: Array, J: Array, right: Array) -> Array:
        """Solve [M, J'; J, 0] for one right-hand side (size,)."""
        parts = [mass, mass[self.M_off], -self.regular, J, J]
        return self._balancer(self.balancing.sum(np.concatenate(parts)), right)

    def step(self, H: Array, J: Array, F: Array, mass: Array, right: Array) -> Array:
        """Solve [-mass, A; A', mass] with A = [H + F, J'; J, 0] for (right, 0); the lower half."""
        A = [H, H[self.H_off], J, J, F]
        M = np.concatenate([mass, mass[self.M_off], self.regular])
        both = np.zeros(2 * right.size)
        both[self.place] = right
        values = self.stepping.sum(np.concatenate([*A, *A, -M, M]))
        # `ca.ldl` can be told to keep the unknowns' order; CasADi's solvers ignore that option.
        factors = ca.ldl(self._matrices.of(values), False)
        return ca.ldl_solve(ca.DM(both), *factors).full().ravel()[self.place + 1]
