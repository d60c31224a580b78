"""The motion of a Lagrangian with accelerations, as one of first order in more coordinates.

L(q, v, a, t) has equations of motion of order four, L_q - d(L_v - d(L_a)/dt)/dt = 0, and one with
derivatives up to that of order r of order 2 r. With y_k the derivative k of q they are those of a
second order for Y = (y_0, y_2, ...), whose rates are (y_1, y_3, ...): all that integrates a motion
forwards knows them in that form. The momenta are Ostrogradsky's (E. T. Whittaker, *A Treatise on
the Analytical Dynamics* (4th ed. 1937), section 110),

    p_r = L_r,    p_k = L_k - d(p_(k + 1))/dt,    L_k = dL/dy_k.
"""

from __future__ import annotations

import casadi as ca

from actionopt.mechanics.laws.compiled import Pointwise
from actionopt.mechanics.laws.laws import keep
from actionopt.mechanics.laws.tracing import Symbols
from actionopt.mechanics.system import System


@keep
def jet_of(system: System) -> list[ca.SX]:
    """Return the symbols of q and its derivatives up to that of order 2 r, r that of L's highest.

    The first r + 1 are the system's own.
    """
    s, n, r = system.symbols, system.n, system.order
    below = ca.vertsplit(s.q, n) if r > 1 else [s.q]
    return [*below, s.v, *(ca.SX.sym(f"q{k}", n) for k in range(r + 1, 2 * r + 1))]


def rate_of(system: System, x: ca.SX) -> ca.SX:
    """Return dx/dt along a motion, of an expression of the time and all of the jet but its last."""
    jet = jet_of(system)
    return ca.jtimes(x, ca.vertcat(*jet[:-1], system.symbols.t), ca.vertcat(*jet[1:], 1))


def _symbols_of(system: System) -> tuple[Symbols, list[ca.SX]]:
    """Return the symbols of Y and its rates, and y_0, y_1, ..., y_(2 r) in them."""
    n, r, s = system.n, system.order, system.symbols
    known = Symbols(ca.SX.sym("Y", r * n), ca.SX.sym("W", r * n), s.t, s.p)
    below, rates = ca.vertsplit(known.q, n), ca.vertsplit(known.v, n)
    y = [part for pair in zip(below, rates, strict=True) for part in pair]
    return known, [*y, ca.SX.sym("y", n)]


def momenta_by(system: System, y: list[ca.SX]) -> list[ca.SX]:
    """Return p_0, p_1, ..., p_r as expressions of y_0, y_1, ..., of which p_0 = 0 is the motion."""
    n, r, s = system.n, system.order, system.symbols
    slopes = ca.vertsplit(ca.gradient(system.L, ca.vertcat(s.q, s.v)), n)
    state, now = ca.vertcat(s.q, s.v), ca.vertcat(*y[: r + 1])
    slopes = [ca.substitute(slope, state, now) for slope in slopes]
    found = [slopes[r]]
    for slope in reversed(slopes[:r]):
        place = ca.vertcat(*y[:-1], s.t)
        found.insert(0, slope - ca.jtimes(found[0], place, ca.vertcat(*y[1:], 1)))
    return found


@keep
def momenta_of(system: System) -> Pointwise:
    """Return the function of the momenta p_1, p_2, ... and how they change with y_r, y_(r + 1), ...

    Of Y and its rates, (order n,) each, the time and the packed parameters.
    """
    s, y = _symbols_of(system)
    p = ca.vertcat(*momenta_by(system, y)[1:])
    by = ca.jacobian(p, ca.vertcat(*y[system.order : -1]))
    outputs = [ca.densify(p), ca.densify(by)]
    return Pointwise(ca.Function("momenta", [s.q, s.v, s.t, s.p], outputs))


@keep
def held_motion_of(system: System) -> Pointwise:
    """Return the function of y_2r and the constraints' multipliers, of what `momenta_of` is one."""
    s, *found = _highest(system)
    return Pointwise(ca.Function("held", [s.q, s.v, s.t, s.p], [ca.densify(x) for x in found]))


def _highest(system: System) -> tuple[Symbols, ca.SX, ca.SX]:
    """Return symbols, and in them what y_2r and the multipliers of constraints are on a motion.

    As the constraints' derivative of order 2 r vanishes,

        (-1)^r L_rr y_2r + ... + G' lam = 0,    G y_2r + ... = 0.
    """
    n, m, (s, y) = system.n, system.m, _symbols_of(system)
    equations = momenta_by(system, y)[0]
    if system.Q.numel():
        state = ca.vertcat(system.symbols.q, system.symbols.v)
        equations += ca.substitute(system.Q, state, ca.vertcat(*y[: system.order + 1]))
    rows = ca.substitute(system.f, system.place, y[0])
    G = ca.jacobian(rows, y[0])
    for _ in range(2 * system.order):
        rows = ca.jtimes(rows, ca.vertcat(*y[:-1], s.t), ca.vertcat(*y[1:], 1))
    whole = ca.vertcat(equations, rows)
    matrix = ca.horzcat(ca.jacobian(whole, y[-1]), ca.vertcat(G.T, ca.SX.zeros(m, m)))
    right = -ca.substitute(whole, y[-1], ca.SX.zeros(n))
    found = ca.solve(ca.densify(matrix), ca.densify(right))
    return s, found[:n], found[n:]


@keep
def motion_of(system: System) -> System:
    """Return the system of the coordinates Y (order n,) that moves so; it has no action.

    y_2r is that of the constraints, or of p_0 = 0.
    """
    n, r = system.n, system.order
    if system.m:
        s, highest, _ = _highest(system)
        M, right = ca.SX.eye(r * n), ca.vertcat(s.q[n:], highest)
        return _without_action(system, s, M, right)
    s, y = _symbols_of(system)
    equations = momenta_by(system, y)[0]
    if system.Q.numel():
        state = ca.vertcat(system.symbols.q, system.symbols.v)
        equations += ca.substitute(system.Q, state, ca.vertcat(*y[: r + 1]))
    # They are linear in y_2r, by (-1)^r L_rr.
    mass = -ca.jacobian(equations, y[-1])
    bias = ca.substitute(equations, y[-1], ca.SX.zeros(n))
    M = ca.diagcat(ca.SX.eye((r - 1) * n), mass)
    return _without_action(system, s, M, ca.vertcat(*y[2:-1:2], bias))


def _without_action(system: System, s: Symbols, M: ca.SX, right: ca.SX) -> System:
    """Return the system of Y that moves as M Y'' = right says."""
    width = s.q.numel()
    names = tuple(c + "''" * k for k in range(system.order) for c in system.coordinates)
    laws = ca.SX(0), ca.SX(0, 1), ca.SX(0, 1)
    found = System.of_laws(s, laws, names, system.table, system.name, system.source)
    vars(found)["motion"] = M, right, ca.SX(0, width), ca.SX(0, 1)
    return found
