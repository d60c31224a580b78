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
from actionopt.tools.types import Array, NDInt


def jumps_of(at: DiscretePath) -> tuple[tuple[Instant, ...], Array]:
    """Return the instants between the ends at which L switches, and dS/dt of each, (K,).

    That is by how much H jumps there: q and p do not.
    """
    problem, path = at.problem, at.path
    start, end = problem.start.t, problem.end.t
    inner = tuple(i for i in problem.instants if start < i[0] and i[1] < end)
    if problem.laws:  # they take turns at the events
        times = [e.t for e in problem.through]
        inner = tuple(i for i in inner if not any(i[0] <= t <= i[1] for t in times))
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


# -- the times of all events ----------------------------------------------------------------------


def by_times(at: DiscretePath) -> Array:
    """Return dS/dt at fixed coordinates at the nodes by the times of all events, (k + 2,).

    A leg over [a, a + T] has S_a = sum w L_t and S_T = (1/T) sum w (L - v.p) + sum w s L_t at times
    a + s T. Where laws take turns they do so at the events; other switches of the clock stay where
    they are. With constraints L stands for L + sum lam f.
    """
    leg, s, T, first = measure_legs(at)
    q, v, parts = first
    _, p, L = parts
    tr, system, packed = at.tr, at.problem.system, at.problem.packed
    own = tr.weight[:, 0] * (L[:, 0] - np.sum(v * p, axis=1)) / T[leg]
    by_T, by_a = np.bincount(leg, own, T.size), np.zeros(T.size)
    if system.structure.depends_on_time:
        if system.m:
            rate = explicit(system)(q, v, tr.times, packed, at.lam[tr.layout.node_of])[0]
        else:
            rate = system.pointwise("rate")(q, v, tr.times, packed)[0]
        rate = rate[:, 0] * tr.weight[:, 0]
        by_T, by_a = by_T + np.bincount(leg, s * rate, T.size), np.bincount(leg, rate, T.size)
    if at.problem.instants:  # at rest while the times about them are stretched
        inner, jumps = jumps_of(at)
        since = tr.mesh.nodes_since[tr.joints]
        for (_, t), jump in zip(inner, jumps.tolist(), strict=True):
            k = int(np.searchsorted(since[1:-1], t - at.problem.start.t))
            by_a[k] -= jump
            by_T[k] -= jump * (t - at.problem.start.t - since[k]) / T[k]
    return by_events(by_a, by_T)


def by_events(by_a: Array, by_T: Array) -> Array:
    """Return derivatives by the times of events from those by the legs' starts and durations."""
    found = np.zeros(by_T.size + 1)
    found[:-1] += by_a - by_T
    found[1:] += by_T
    return found


def measure_legs(at: DiscretePath) -> tuple[NDInt, Array, Array, tuple[Array, Array, list[Array]]]:
    """Return each evaluation's leg and its part s of that, the durations of legs, and q, v, L."""
    tr, problem, point = at.tr, at.problem, at.tr.place(at.x)
    offsets, nodes = tr.mesh.offsets, tr.joints
    boundaries = np.searchsorted(offsets, nodes)
    of_element = np.searchsorted(boundaries, np.arange(tr.mesh.elements), side="right") - 1
    leg = np.concatenate(
        [np.repeat(of_element[g.elements], g.nodes.shape[1]) for g in tr.layout.groups]
    )
    since = tr.mesh.since[boundaries]
    T = np.diff(since)
    s = (tr.mesh.nodes_since[tr.layout.node_of] - since[leg]) / T[leg]
    first = problem.system.pointwise("first")(point.at, point.v, tr.times, problem.packed)
    return leg, s, T, (point.at, point.v, [x.copy() for x in first])


def by_times_twice(at: DiscretePath) -> tuple[Array, Array]:
    """Return how dS/dx, (unknowns, k + 2), and dS/dt, (k + 2, k + 2), change with all times.

    In units of action by the first, of action over time by the second. Of one leg, with rates v,
    p = L_v, and the explicit derivatives by t written as L_t, p_t, L_tt,

        d(grad S)/da = w L_qt + D'w p_t,
        d(grad S)/dT = (w (L_q - L_qv v) - D'w L_vv v) / T + s d(grad S)/da,
        S_aa = sum w L_tt,    S_aT = (1/T) sum w (L_t - v.p_t) + sum w s L_tt,
        S_TT = (1/T^2) sum w v.L_vv v + (2/T) sum w s (L_t - v.p_t) + sum w s^2 L_tt.
    """
    tr, problem, n = at.tr, at.problem, at.problem.system.n
    system, layout = problem.system, tr.layout
    leg, s, T, (q, v, (force, _, _)) = measure_legs(at)
    second, w, count = system.pointwise("second"), tr.weight, T.size
    _, B, C = tr.second(at.x)
    mixed = second.product(1, B, v).copy()
    mass = second.product(2, C, v, symmetric=True).copy()
    size = layout.node_count * n

    def scatter(at_node: Array, by_rate: Array) -> Array:
        """Return sums over nodes, (unknowns, legs), of what acts on q and on v there."""
        change = w * at_node
        for g in layout.groups:
            local = by_rate[g.span].reshape(*g.nodes.shape, n)
            change[g.span] += (g.rule.weighted_derivative.T @ local).reshape(-1, n)
        places = layout.scatter * count + np.repeat(leg, n)
        whole = np.bincount(places, change.ravel(), size * count).reshape(size, count)
        return whole[layout.free] * (tr.x_unit / tr.action_unit)[:, None]

    each = T[leg][:, None]
    by_T = scatter((force - mixed) / each, -mass / each)
    by_a = np.zeros_like(by_T)
    weight = w[:, 0]
    bent = np.sum(v * mass, axis=1) / T[leg] ** 2
    S_aa, S_aT = np.zeros(count), np.zeros(count)
    if system.structure.depends_on_time:
        made = system.memoize("clocked", lambda: _clock_derivatives(system))
        parts = made(q, v, tr.times, problem.packed)
        L_qt, p_t, L_t, L_tt = (x.copy() for x in parts)
        by_a = scatter(L_qt, p_t)
        by_T += scatter(s[:, None] * L_qt, s[:, None] * p_t)
        off = (L_t[:, 0] - np.sum(v * p_t, axis=1)) / T[leg]
        bent = bent + 2 * s * off + s**2 * L_tt[:, 0]
        S_aa = np.bincount(leg, weight * L_tt[:, 0], count)
        S_aT = np.bincount(leg, weight * (off + s * L_tt[:, 0]), count)
    S_TT = np.bincount(leg, weight * bent, count)
    path, times = np.zeros((layout.unknowns, count + 1)), np.zeros((count + 1, count + 1))
    path[:, :-1] += by_a - by_T
    path[:, 1:] += by_T
    i = np.arange(count)
    times[i, i] += S_aa - 2 * S_aT + S_TT
    times[i + 1, i + 1] += S_TT
    times[i, i + 1] = times[i + 1, i] = S_aT - S_TT
    return path, times


def _clock_derivatives(system: System) -> Pointwise:
    """Return the function of L_qt, L_vt, L_t and L_tt."""
    s = system.symbols
    rate = ca.jacobian(system.L, s.t)
    outputs = [ca.jacobian(rate, s.q).T, ca.jacobian(rate, s.v).T, rate, ca.jacobian(rate, s.t)]
    function = ca.Function("clocked", [s.q, s.v, s.t, s.p], [ca.densify(x) for x in outputs])
    return Pointwise(function)
