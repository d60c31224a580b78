"""The functions of a test problem, counted, and nothing of its answer: what a solver is given.

    minimise f(x) subject to c(x) = 0,      grad f(x) + J(x)' lam = 0 at a stationary point

or to c_lower <= c(x) <= c_upper and x_lower <= x <= x_upper, where a member has inequalities: then
grad f + J' lam + z = 0, lam and z being >= 0 at an upper bound, <= 0 at a lower one, else 0.
x are the free coordinates at the nodes, node by node, in the units the scene is written in or those
of the member (unlike the transcription, which scales them): units of atoms or planets, or of both
at once, are a difficulty that a solver should meet. f is the discrete action and
c_k = w_k f(q_k, t_k) the constraints, weighted with the quadrature, so that lam are the
multipliers lambda(t_k) of the continuous problem.
"""

from __future__ import annotations

import copy
from collections import Counter
from collections.abc import Callable
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from actionopt.discrete.mesh import Mesh
from actionopt.discrete.transcription import Transcription
from actionopt.mechanics.system import System
from actionopt.suite.limits import UNLIMITED, Bounds
from actionopt.tools.types import Array, NDInt


class Program:
    """A smooth nonlinear program: functions of x (n,), all counted.

    `objective`, `gradient`, `constraints`, and the nonzeros `jacobian` and `hessian`, flat, in the
    order of `jacobian_structure` and `hessian_structure`.

    Parameters
    ----------
    transcription : Transcription
    decades : float
        Powers of ten over which the units of the unknowns range, evenly from the first to the
        last; 0 for those the scene is written in.
    limits : Bounds
        Bounds; none, and equations f = 0, by default.

    Attributes
    ----------
    counts : Counter
        Evaluations by name: f, grad, c, jac, hess, hprod.
    visited : list of (n,) arrays, or None
        Where f was evaluated, in this order, if it is to be kept: set it to [].
    """

    def __init__(
        self,
        transcription: Transcription,
        decades: float = 0.0,
        limits: Bounds = UNLIMITED,
    ) -> None:
        self.transcription = transcription
        self.decades = decades
        self.limits = limits
        self.counts: Counter[str] = Counter()
        self.visited: list[Array] | None = None

    def view(self) -> Program:
        """Return the same functions with counts of their own, and no answer anywhere near."""
        tr = self.transcription
        return Program(tr.between(tr.problem), self.decades, self.limits)

    # -- what it is --------------------------------------------------------------------------

    @property
    def name(self) -> str:
        """That of the system."""
        return self.transcription.problem.system.name

    @property
    def variable_names(self) -> list[str]:
        """Coordinate and node of each unknown, as "theta[1]"."""
        system = self.transcription.problem.system
        node, which = np.divmod(self.transcription.layout.free, system.n)
        return [f"{system.coordinates[a]}[{k}]" for k, a in zip(node, which, strict=True)]

    @property
    def constraint_names(self) -> list[str]:
        """Function and node of each row, as "f[1]"; "f0[1]" where there are several functions."""
        if not self.m:
            return []
        layout = self.transcription.layout
        pairs = zip(layout.row_constraint, layout.row_node, strict=True)
        several = layout.system.m > 1
        return [f"f{i}[{k}]" if several else f"f[{k}]" for i, k in pairs]

    @property
    def mesh(self) -> Mesh:
        """The mesh."""
        return self.transcription.mesh

    @property
    def n(self) -> int:
        """Number of unknowns."""
        return self.transcription.layout.unknowns

    @property
    def m(self) -> int:
        """Number of constraint rows."""
        return self.transcription.layout.rows

    @property
    def nnz_jacobian(self) -> int:
        """Structural nonzeros of the Jacobian."""
        return self.transcription.layout.jacobian.nnz if self.m else 0

    @property
    def nnz_hessian(self) -> int:
        """Structural nonzeros of the upper triangle of the Hessian of the Lagrangian."""
        return self.transcription.layout.hessian.nnz

    @property
    def classification(self) -> str:
        """The class in the manner of CUTEst, as "QUR2-MN-31-0".

        Objective Quadratic or Other; constraints Unconstrained (none), Bounds alone, Linear,
        Quadratic or Other; Regular, with second derivatives; a Model; No internal variables; n, m.
        """
        system = self.transcription.problem.system
        structure = system.structure
        quadratic = (
            structure.constant_mass and structure.constant_coupling and structure.constant_stiffness
        )
        kind = "O"
        if not self.m:
            kind = "B" if self.limits.coordinates else "U"
        elif structure.affine_constraint:
            kind = "L"
        elif _quadratic_constraint(system):
            kind = "Q"
        return f"{'Q' if quadratic else 'O'}{kind}R2-MN-{self.n}-{self.m}"

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds of x, each (n,); infinite where there are none."""
        layout = self.transcription.layout
        node, which = np.divmod(layout.free, self.transcription.problem.system.n)
        lower, upper = self.limits.of_coordinates(which, self.mesh.nodes[node])
        return lower * self.stretch, upper * self.stretch

    @cached_property
    def constraint_bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds of c, each (m,): zero both where the row is an equation."""
        if not self.m:
            return np.zeros(0), np.zeros(0)
        tr, layout = self.transcription, self.transcription.layout
        times = self.mesh.nodes[layout.row_node]
        lower, upper = self.limits.of_constraints(layout.row_constraint, times)
        weight = np.repeat(tr.row_weight.ravel(), tr.problem.system.m)[layout.row_select]
        return lower * weight, upper * weight

    @property
    def has_bounds(self) -> bool:
        """Whether x has bounds."""
        return bool(self.limits.coordinates)

    @property
    def inequalities(self) -> bool:
        """Whether anything may hold strictly: a bound of x, or a row that is no equation."""
        lower, upper = self.constraint_bounds
        return self.has_bounds or bool(np.any(lower < upper))

    @property
    def linear_rows(self) -> NDArray[np.bool_]:
        """Which rows of c are linear in x, (m,)."""
        system = self.transcription.problem.system
        slopes, q = ca.jacobian(system.f, system.symbols.q), system.symbols.q
        linear = [not ca.depends_on(slopes[i, :], q) for i in range(system.m)]
        return np.array(linear, dtype=bool)[self.transcription.layout.row_constraint]

    # -- functions ---------------------------------------------------------------------------

    @cached_property
    def stretch(self) -> Array:
        """How many of the member's units make one of the scene's, for each unknown, (n,)."""
        half = self.decades / 2
        return np.logspace(-half, half, self.n)

    @cached_property
    def unit(self) -> Array:
        """Size of each unknown, (n,), as far as the events tell."""
        return self.transcription.x_unit * self.stretch

    def objective(self, x: Array) -> float:
        """Return f(x), the discrete action."""
        self.counts["f"] += 1
        self.note(x)
        return self.transcription.action_alone(self._scale(x)) * self.transcription.action_unit

    def note(self, x: Array) -> None:
        """Keep x among the points visited, if they are kept."""
        if self.visited is not None:
            self.visited.append(np.array(x, dtype=float).ravel())

    def gradient(self, x: Array) -> Array:
        """Return grad f(x), (n,)."""
        self.counts["grad"] += 1
        return self.transcription.gradient_alone(self._scale(x)) * (
            self.transcription.action_unit / self.unit
        )

    def constraints(self, x: Array) -> Array:
        """Return c(x), (m,)."""
        self.counts["c"] += 1
        if not self.m:
            return np.zeros(0)
        return self.transcription.constraint(self._scale(x)) * self.transcription.row_unit

    @property
    def jacobian_structure(self) -> tuple[NDInt, NDInt]:
        """Rows and columns of the nonzeros of the Jacobian, by columns."""
        if not self.m:
            return np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp)
        J = self.transcription.layout.jacobian
        return J.row, J.col

    def jacobian(self, x: Array) -> Array:
        """Return the nonzeros of dc/dx, flat, in the order of `jacobian_structure`."""
        self.counts["jac"] += 1
        if not self.m:
            return np.zeros(0)
        rows, cols = self.jacobian_structure
        values = self.transcription.jacobian(self._scale(x))
        return values * self.transcription.row_unit[rows] / self.unit[cols]

    @property
    def hessian_structure(self) -> tuple[NDInt, NDInt]:
        """Rows and columns of the nonzeros of the Hessian's upper triangle, by columns."""
        H = self.transcription.layout.hessian
        return H.row, H.col

    def hessian(self, x: Array, lam: Array | None = None, factor: float = 1.0) -> Array:
        """Return the nonzeros, flat, of the upper triangle of factor * f'' + sum lam c''."""
        self.counts["hess"] += 1
        return self._hessian(x, lam, factor)

    def hessian_product(
        self, x: Array, lam: Array | None, direction: Array, factor: float = 1.0
    ) -> Array:
        """Return the Hessian of the Lagrangian times a direction, (n,)."""
        self.counts["hprod"] += 1
        rows, cols = self.hessian_structure
        values = self._hessian(x, lam, factor)
        product = np.bincount(rows, values * direction[cols], self.n)
        off = rows != cols
        return product + np.bincount(cols[off], values[off] * direction[rows[off]], self.n)

    def _hessian(self, x: Array, lam: Array | None, factor: float) -> Array:
        tr = self.transcription
        rows, cols = self.hessian_structure
        mu = np.zeros(self.m) if lam is None else np.asarray(lam) / tr.mu_unit
        scaled = self._scale(x)
        # The transcription's Hessian is f'' + sum mu c'': affine in mu.
        values = tr.hessian(np.concatenate([scaled, mu]))
        if factor != 1.0:
            bare = tr.hessian(np.concatenate([scaled, np.zeros(self.m)])) if mu.any() else values
            values = values - (1.0 - factor) * bare
        return values * (tr.action_unit / (self.unit[rows] * self.unit[cols]))

    def _scale(self, x: Array) -> Array:
        return np.asarray(x, dtype=float) / self.unit


GIVEN = (
    "n m classification has_bounds inequalities bounds constraint_bounds linear_rows nnz_jacobian "
    "nnz_hessian jacobian_structure hessian_structure"
).split()
GIVEN_FUNCTIONS = "objective gradient constraints jacobian hessian hessian_product".split()


class Given:
    """The numbers and functions of a program: nothing of its counts, nor of where it is from.

    Those of `Program`, by the same names; arrays are copies.
    """

    def __init__(self, program: Program) -> None:
        for name in GIVEN:
            setattr(self, name, copy.deepcopy(getattr(program, name)))
        for name in GIVEN_FUNCTIONS:
            setattr(self, name, _alone(getattr(program, name)))


def _alone(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that is no method: nothing that it belongs to is at hand."""
    return lambda *arguments, **named: function(*arguments, **named)


def _quadratic_constraint(system: System) -> bool:
    """Whether second derivatives of the constraint do not depend on q."""
    q = system.symbols.q
    return not ca.depends_on(ca.jacobian(ca.jacobian(system.f, q), q), q)
