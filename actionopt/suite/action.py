"""The program of a discrete action: its functions on the mesh, from a transcription.

x are the free coordinates at the nodes, node by node, in the units the scene is written in or those
of the member (unlike the transcription, which scales them): units of atoms or planets, or of both
at once, are a difficulty that a solver should meet. f is the discrete action and
c_k = w_k f(q_k, t_k) the constraints, weighted with the quadrature, so that lam are the
multipliers lambda(t_k) of the continuous problem.
"""

from __future__ import annotations

from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.mechanics.system import System
from actionopt.suite.expression import action_expression
from actionopt.suite.limits import UNLIMITED, Bounds
from actionopt.suite.program import Program
from actionopt.tools.types import Array, NDInt


class ActionProgram(Program):
    """The discrete action of a problem, and its constraint rows.

    Parameters
    ----------
    transcription : Transcription
    decades : float
        Powers of ten over which the units of the unknowns range, evenly from the first to the
        last; 0 for those the scene is written in.
    limits : Bounds
        Bounds; none, and equations f = 0, by default.
    """

    def __init__(
        self,
        transcription: Transcription,
        decades: float = 0.0,
        limits: Bounds = UNLIMITED,
    ) -> None:
        super().__init__()
        self.transcription = transcription
        self.decades = decades
        self.limits = limits

    def view(self) -> Program:
        """Return the same functions with counts of their own, and no answer anywhere near."""
        tr = self.transcription
        return ActionProgram(tr.between(tr.problem), self.decades, self.limits)

    def forget(self) -> None:
        """Forget what the system keeps of the problems that were put to it."""
        self.transcription.problem.system.forget()

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
    def classification(self) -> str:
        """The class in the manner of CUTEst, as "QUR2-MN-31-0"."""
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

    @property
    def jacobian_structure(self) -> tuple[NDInt, NDInt]:
        """Rows and columns of the nonzeros of the Jacobian, by columns."""
        if not self.m:
            return np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp)
        J = self.transcription.layout.jacobian
        return J.row, J.col

    @property
    def hessian_structure(self) -> tuple[NDInt, NDInt]:
        """Rows and columns of the nonzeros of the Hessian's upper triangle, by columns."""
        H = self.transcription.layout.hessian
        return H.row, H.col

    def _objective(self, x: Array) -> float:
        return self.transcription.action_alone(self._scale(x)) * self.transcription.action_unit

    def _gradient(self, x: Array) -> Array:
        return self.transcription.gradient_alone(self._scale(x)) * (
            self.transcription.action_unit / self.unit
        )

    def _constraints(self, x: Array) -> Array:
        return self.transcription.constraint(self._scale(x)) * self.transcription.row_unit

    def _jacobian(self, x: Array) -> Array:
        rows, cols = self.jacobian_structure
        values = self.transcription.jacobian(self._scale(x))
        return values * self.transcription.row_unit[rows] / self.unit[cols]

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

    def expression(self) -> tuple[ca.MX, ca.MX, ca.MX]:
        """Return x, f and c, the Lagrangian being mapped over the nodes."""
        return action_expression(self.transcription, self.stretch)

    def _scale(self, x: Array) -> Array:
        return np.asarray(x, dtype=float) / self.unit


def _quadratic_constraint(system: System) -> bool:
    """Whether second derivatives of the constraint do not depend on q."""
    q = system.symbols.q
    return not ca.depends_on(ca.jacobian(ca.jacobian(system.f, q), q), q)
