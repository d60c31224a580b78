"""The Lagrangian and the constraints of a test problem as lists of operations, to be written out.

A member of any size is the same few operations at many times: each exporter writes them down once
for each, from arrays, and never has the whole expression in memory.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

import casadi as ca
import numpy as np

from actionopt.suite.action import ActionProgram
from actionopt.suite.stars import least_multipliers
from actionopt.tools.immutable import immutable
from actionopt.tools.tape import Tape
from actionopt.tools.types import Array, NDInt


class Listing:
    """What there is to write of a program: f = sum_e w_e L(q_e, v_e, t_e), c_r = w_r f_i(q_r, t_r).

    Attributes
    ----------
    lagrangian : Tape
        L(q (n,), v (n,), t), the parameters being numbers.
    constraints : list of Tape
        Each f_i(q (n,), t) without the terms that are linear in a coordinate.
    affine : bool
        Whether nothing of the constraints depends on q beside these.
    """

    def __init__(self, program: ActionProgram) -> None:
        self.program = program
        self.tr, self.layout = program.transcription, program.transcription.layout
        asked = self.tr.problem
        system, numbers = asked.system, ca.DM(asked.packed.ravel())
        s, n, m = system.symbols, system.n, system.m if program.m else 0
        q, v, t = ca.SX.sym("q", n), ca.SX.sym("v", n), ca.SX.sym("t")
        L = ca.Function("L", [s.q, s.v, s.t, s.p], [system.L]).expand()
        self.lagrangian = Tape([q, v, t], [L(q, v, t, numbers)], ["q", "v", "t"])
        self.constraints: list[Tape] = []
        self.affine = True
        slopes, rests = ca.SX.zeros(m, n), ca.SX.zeros(m)
        if m:
            whole = ca.Function("f", [s.q, s.t, s.p], [ca.vec(system.f)]).expand()
            f = ca.vec(whole(q, t, numbers))
        for i in range(m):
            slope = ca.densify(ca.jacobian(f[i], q))
            alone = [a for a in range(n) if not ca.depends_on(slope[a], q)]
            for a in alone:
                slopes[i, a] = slope[a]
            kept = [0 if a in alone else q[a] for a in range(n)]
            rests[i] = ca.substitute(f[i], q, ca.vertcat(*kept))
            self.affine = self.affine and not ca.depends_on(rests[i], q)
            self.constraints.append(Tape([q, t], [rests[i]], ["q", "t"]))
        self._linear = ca.Function("linear", [t], [ca.densify(slopes)])
        self._rest = ca.Function("rest", [q, t], [ca.densify(rests)])

    @property
    def moving(self) -> list[int]:
        """The coordinates of which L needs the velocity."""
        return [a for a in range(self.layout.system.n) if self.lagrangian.uses((1, a))]

    @cached_property
    def pinned_values(self) -> Array:
        """Coordinates that are given at the nodes, (K, n), and zeros."""
        return self.tr.ends.copy()

    @cached_property
    def row_weights(self) -> Array:
        """Weight of each row, (m,)."""
        weights = np.repeat(self.tr.row_weight.ravel(), self.layout.system.m)
        return weights[self.layout.row_select]

    @cached_property
    def linear(self) -> tuple[Array, Array]:
        """Coefficients of what is linear in c, one for each nonzero of the Jacobian; constants.

        A constant (m,) is what the linear terms of coordinates that are given make of them, and,
        where all is affine, what does not depend on x at all.
        """
        layout, system = self.layout, self.layout.system
        rows, cols = self.program.jacobian_structure
        if not self.program.m:
            return np.zeros(0), np.zeros(0)
        nodes, which = layout.row_node, layout.row_constraint
        times = ca.DM(self.tr.mesh.nodes[nodes][None])
        A = np.asarray(self._linear.map(nodes.size)(times)).T.reshape(-1, system.n, system.m)
        mine = A[np.arange(nodes.size), :, which]  # (rows, n)
        coefficient = mine[rows, layout.free[cols] % system.n] * self.row_weights[rows]
        constant = np.sum(mine * self.pinned_values[nodes], axis=1)
        if self.affine:
            zero = ca.DM.zeros(system.n, nodes.size)
            rest = np.asarray(self._rest.map(nodes.size)(zero, times)).T
            constant = constant + rest[np.arange(nodes.size), which]
        return coefficient / self.program.stretch[cols], constant * self.row_weights

    def rows(self) -> Iterator[ConstraintRow]:
        """Yield what f is evaluated of, row by row."""
        layout, times, number = self.layout, self.tr.mesh.nodes, self.layout.number
        for node, which, weight in zip(
            layout.row_node, layout.row_constraint, self.row_weights, strict=True
        ):
            yield ConstraintRow(
                int(which), number[node], self.pinned_values[node], times[node], weight
            )

    def evaluations(self) -> Iterator[Evaluation]:
        """Yield what L is evaluated of, node by node of each element."""
        number = self.layout.number
        for g in self.layout.groups:
            times = self.tr.times[g.span].reshape(g.nodes.shape)
            weights = self.tr.weight[g.span].reshape(g.nodes.shape)
            for e, nodes in enumerate(g.nodes):
                rate = g.rule.derivative / self.tr.half[g.elements[e]]
                columns, pinned = number[nodes], self.pinned_values[nodes]
                fixed = rate @ pinned
                for k in range(nodes.size):
                    yield Evaluation(
                        columns[k],
                        pinned[k],
                        columns,
                        rate[k],
                        fixed[k],
                        times[e, k],
                        weights[e, k],
                    )


@immutable
class Evaluation:
    """One term of f.

    Attributes
    ----------
    columns : (n,) array of int
        Unknowns that are the coordinates there, -1 of those that are given.
    given : (n,) array
        Those.
    around : (d + 1, n) array of int
        Unknowns of all nodes of the element.
    rate : (d + 1,) array
        Velocities are these times the coordinates around.
    fixed : (n,) array
        What those given add to the velocities.
    time, weight : float
    """

    columns: NDInt
    given: Array
    around: NDInt
    rate: Array
    fixed: Array
    time: float
    weight: float


@immutable
class ConstraintRow:
    """One row of c: function `which`, at a node.

    `columns` and `given`, each (n,), `time` and `weight` are as in `Evaluation`.
    """

    which: int
    columns: NDInt
    given: Array
    time: float
    weight: float


def first_multipliers(problem: ActionProgram, x0: Array) -> Array:
    """Return multipliers lam (m,) to begin with: those that fit x0 best in the sense of squares.

    None with inequalities: which of them hold is not known there.
    """
    if problem.inequalities:
        return np.zeros(0)
    tr = problem.transcription
    return least_multipliers(tr, x0 / problem.unit) * tr.mu_unit
