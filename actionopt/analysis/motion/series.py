"""Motions that begin where the mass matrix vanishes, such as at the centre of a radial problem.

With L ~ r^k near r = 0 the equations of motion have a regular singular point there: of all motions
one leaves it for each q(0), and it is a power series, whose velocity at the start follows from the
equations, v(0) = 0 as a rule. The series is found as a polynomial that satisfies the equations of
motion at the nodes of the first element, but for the start itself (collocation).

References: Ascher, Mattheij and Russell, *Numerical Solution of Boundary Value Problems for
Ordinary Differential Equations* (1995), section 11.4.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from actionopt.analysis.motion.flow import Flow, IntegrationError
from actionopt.mechanics.laws.compiled import Pointwise
from actionopt.mechanics.laws.laws import keep
from actionopt.mechanics.question.events import State
from actionopt.mechanics.system import System
from actionopt.tools.lobatto import lgl
from actionopt.tools.types import RANK, Array

# Ad hoc, where nothing else is said.
COMPARED_AT = 1e-3  # of the duration: where the mass is compared with that at the start
SERIES_STEPS, SERIES_CHANGE = 30, 1e-13  # and the change that ends them, in the size of q


def begins_singular(flow: Flow, state: State, t_end: float) -> bool:
    """Whether the mass matrix vanishes at the state, and not a little later."""
    system, parameters = flow.system, flow.parameters
    if system.m or not system.structure.depends_on_time:
        return False
    here = system.mass_matrix(state.q, state.v, state.t, parameters=parameters)
    if np.any(np.abs(here) > RANK * (1 + np.abs(here).max())):
        return False
    later = state.t + COMPARED_AT * (t_end - state.t)
    beside = system.mass_matrix(state.q, state.v, later, parameters=parameters)
    return bool(np.abs(here).max() <= RANK * np.abs(beside).max())


def begin(flow: Flow, state: State, t_end: float, degree: int) -> tuple[Array, Array]:
    """Return q and v (n, degree + 1) at the LGL nodes from the state to `t_end`.

    Raises IntegrationError where Newton's method finds no such polynomial.
    """
    system, n, rule = flow.system, flow.system.n, lgl(degree)
    table = system.table
    packed = table.pack(table.values(flow.parameters))
    residual = _residual(system)
    D = rule.derivative * (2 / (t_end - state.t))
    t = state.t + (t_end - state.t) * (1 + rule.nodes) / 2
    Q = np.repeat(state.q[None], degree + 1, axis=0)
    size = np.abs(state.q).max() or 1.0
    inner = slice(1, None)
    for _ in range(SERIES_STEPS):
        V = D @ Q
        A = D @ V
        R, Rq, Rv, M = (
            x.copy() for x in residual(Q[inner], V[inner], A[inner], t[inner, None], packed)
        )
        J = np.zeros((degree, n, degree + 1, n))
        here = np.arange(degree)
        for part, slopes in ((Rq, np.eye(degree + 1)), (Rv, D), (M, D @ D)):
            matrix = part.reshape(degree, n, n).swapaxes(1, 2)  # as CasADi stores it
            J += matrix[:, :, None, :] * slopes[inner][here, None, :, None]
        unit = np.abs(M).max(axis=1)  # each row in units of its mass
        if not (np.isfinite(J).all() and np.isfinite(R).all() and unit.min() > 0):
            break
        matrix = (J / unit[:, None, None, None])[:, :, inner].reshape(degree * n, degree * n)
        try:
            step = np.linalg.solve(matrix, (R / unit[:, None]).ravel()).reshape(degree, n)
        except np.linalg.LinAlgError:
            break
        Q[inner] -= step
        if np.abs(step).max() <= SERIES_CHANGE * max(size, np.abs(Q).max()):
            return Q.T, (D @ Q).T
    raise IntegrationError(
        f"no power series of the motion from the singular point t = {state.t:.6g} was found, "
        f"where the mass matrix vanishes, up to t = {t_end:.6g}; begin a little beside it",
        state.t,
    )


@keep
def _residual(system: System) -> Pointwise:
    """Return the function of M a - bias and its derivatives by q, v and a, column by column."""
    s, a = system.symbols, ca.SX.sym("a", system.n)
    M, bias, _, _ = system.motion
    R = M @ a - bias
    parts = [R, *(ca.vec(ca.densify(ca.jacobian(R, x))) for x in (s.q, s.v)), ca.vec(ca.densify(M))]
    outputs = [ca.densify(x) for x in parts]
    return Pointwise(ca.Function("collocation", [s.q, s.v, a, s.t, s.p], outputs))
