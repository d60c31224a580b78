"""How the discrete action changes with the times of its events.

As an end time moves the mesh stretches, and every node keeps its fraction s = (t - t0) / T:

    dS/dt1 = (1/T) sum w (L - v.p) + sum w s dL/dt = -H(t1),

exactly, so that no difference is taken, and as accurate as the action is. With constraints L stands
for L + sum lam f.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from actionopt.discrete.discrete_path import DiscretePath
from actionopt.mechanics.compiled import Pointwise
from actionopt.mechanics.events import State
from actionopt.mechanics.instants import Instant
from actionopt.mechanics.jumps import across
from actionopt.mechanics.system import System
from actionopt.tools.types import Array


def by_times(at: DiscretePath) -> tuple[float, float]:
    """Return dS/dt0 and dS/dt1 at fixed coordinates at the nodes."""
    tr, problem, point = at.tr, at.problem, at.tr.place(at.x)
    system, q, v = problem.system, point.at, point.v
    _, p, L = system.pointwise("first")(q, v, tr.times, problem.packed)
    stretch = float(np.sum(tr.weight * (L - np.sum(v * p, axis=1, keepdims=True))))
    stretch /= problem.duration
    if not system.structure.depends_on_time:
        return -stretch, stretch
    lam = at.lam if system.m else at.rows
    by_time = explicit(system)(q, v, tr.times, problem.packed, lam[tr.layout.node_of])[0]
    s = (tr.times - problem.start.t) / problem.duration
    t1 = stretch + float(np.sum(tr.weight * s * by_time))
    t0 = -stretch + float(np.sum(tr.weight * (1 - s) * by_time))
    inner, jumps = jumps_of(at)
    if inner:  # at rest while the times about them are stretched
        s = (np.array(inner)[:, 1] - problem.start.t) / problem.duration
        t1, t0 = t1 - float(s @ jumps), t0 - float((1 - s) @ jumps)
    return t0, t1


def by_stretch(at: DiscretePath) -> tuple[Array, float]:
    """Return how dS/dx, (unknowns,), and T dS/dT change with log T, in units of action.

    At fixed coordinates at the nodes, of a system without a clock: rates fall as 1 / T, so that

        d(dL/dq) = L_q - L_qv v,    d(dL/dv) = -L_vv v,    d(L - v.p) = L - v.p + v.L_vv v.
    """
    tr, system, n = at.tr, at.problem.system, at.problem.system.n
    point, layout = tr.place(at.x), tr.layout
    v, second = point.v, system.pointwise("second")
    _, B, C = tr.second(at.x)
    mixed, mass = second.product(1, B, v), second.product(2, C, v, symmetric=True)
    force, p, L = system.pointwise("first")(point.at, v, tr.times, at.problem.packed)
    change = tr.weight * (force - mixed)
    for g in layout.groups:
        local = mass[g.span].reshape(*g.nodes.shape, n)
        change[g.span] -= (g.rule.weighted_derivative.T @ local).reshape(-1, n)
    whole = np.bincount(layout.scatter, change.ravel(), layout.node_count * n)
    own = tr.weight * (L + np.sum(v * (mass - p), axis=1, keepdims=True))
    return tr.free_part(whole), float(np.sum(own)) / tr.action_unit


def jumps_of(at: DiscretePath) -> tuple[tuple[Instant, ...], Array]:
    """Return the instants between the events at which L switches, and dS/dt of each, (K,).

    That is by how much H jumps there: q and p do not.
    """
    problem, path = at.problem, at.path
    start, end = problem.start.t, problem.end.t
    inner = tuple(i for i in problem.instants if start < i[0] and i[1] < end)
    system, parameters, jumps = problem.system, problem.parameters, []
    for before, after in inner:
        beyond = State(after, path(after), path.velocity(after))
        here = across(system, parameters, beyond, before)
        H = [system.energy(x.q, x.v, x.t, parameters=parameters) for x in (here, beyond)]
        jumps.append(float(H[1] - H[0]))
    return inner, np.array(jumps)


def explicit(system: System) -> Pointwise:
    """Return the partial derivatives of L + sum lam f by the time and the packed parameters."""
    return system.memoize("explicit", lambda: _explicit(system))


def _explicit(system: System) -> Pointwise:
    s = system.symbols
    lam = ca.SX.sym("lam", system.m)
    L = system.L + (ca.dot(lam, system.f) if system.m else 0)
    by_time = ca.densify(ca.jacobian(L, s.t))
    by_parameters = ca.densify(ca.jacobian(L, s.p).T)
    function = ca.Function("explicit", [s.q, s.v, s.t, s.p, lam], [by_time, by_parameters])
    return Pointwise(function)
