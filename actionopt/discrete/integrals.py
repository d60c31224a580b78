"""Integrals of given expressions along a path, int g(q, v, t) dt, and how they change with it."""

from __future__ import annotations

import casadi as ca
import numpy as np

from actionopt.discrete.discrete_path import DiscretePath
from actionopt.discrete.end_times import by_events, measure_legs
from actionopt.mechanics.compiled import Pointwise
from actionopt.mechanics.system import System
from actionopt.tools.types import Array


def integrals(at: DiscretePath) -> tuple[Array, Array]:
    """Return the integrals of the system's `integral`, (c,), and their slopes, (c, unknowns)."""
    tr, layout = at.tr, at.tr.layout
    g, by_q, by_v, _ = _at_nodes(at)
    c, n = g.shape[1], at.problem.system.n
    slopes = np.zeros((c, layout.unknowns))
    for i in range(c):
        change = tr.weight * by_q[:, i]
        for group in layout.groups:
            local = by_v[group.span, i].reshape(*group.nodes.shape, n)
            change[group.span] += (group.rule.weighted_derivative.T @ local).reshape(-1, n)
        whole = np.bincount(layout.scatter, change.ravel(), layout.node_count * n)
        slopes[i] = tr.free_part(whole) * tr.action_unit
    return tr.weight[:, 0] @ g, slopes


def integrals_by_times(at: DiscretePath) -> Array:
    """Return how they change with the times of the events, (c, k + 2), as `by_times` does."""
    leg, s, T, (_, v, _) = measure_legs(at)
    g, _, by_v, by_t = _at_nodes(at)
    w, found = at.tr.weight[:, 0], []
    for i in range(g.shape[1]):
        own = w * (g[:, i] - np.sum(v * by_v[:, i], axis=1)) / T[leg] + s * w * by_t[:, i]
        by_start = np.bincount(leg, w * by_t[:, i], T.size)
        found.append(by_events(by_start, np.bincount(leg, own, T.size)))
    return np.array(found)


def _at_nodes(at: DiscretePath) -> tuple[Array, Array, Array, Array]:
    """Return g (K, c) and its derivatives by q and v, (K, c, n), and by t, (K, c), at the nodes."""
    system, point = at.problem.system, at.tr.place(at.x)
    g, by_q, by_v, by_t = _function_of(system)(point.at, point.v, at.tr.times, at.problem.packed)
    shape = len(point.at), system.g.numel(), system.n
    return g.copy(), by_q.reshape(shape).copy(), by_v.reshape(shape).copy(), by_t.copy()


def _function_of(system: System) -> Pointwise:
    """Return the function of g and its derivatives."""

    def build() -> Pointwise:
        s, g = system.symbols, system.g
        outputs = [g, *(ca.vec(ca.jacobian(g, x).T) for x in (s.q, s.v)), ca.jacobian(g, s.t)]
        function = ca.Function("integrals", [s.q, s.v, s.t, s.p], [ca.densify(x) for x in outputs])
        return Pointwise(function)

    return system.memoize("integrals", build)
