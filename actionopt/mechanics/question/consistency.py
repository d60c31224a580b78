"""Whether events, times and laws fit together: what a problem refuses, and why."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from actionopt.mechanics.laws.compiled import Pointwise
from actionopt.mechanics.laws.identity import (
    CANCELLED,
    GENERIC,
    general_points,
    general_states,
    negligible,
    remainder,
)
from actionopt.mechanics.question.surface import SURFACE_TOLERANCE
from actionopt.mechanics.system import System
from actionopt.tools.checks import number
from actionopt.tools.types import Array

# Points of two curves along which an integral is the same for all paths, and to which part of its
# size: their sum is, to a thousandth of that, for what varies as slowly as the curves. Ad hoc.
CURVE_POINTS, SAME_INTEGRAL = 1000, 1e-3


def check_free_time(problem: Any) -> None:
    """Raise ValueError where a free time or an energy does not fit the problem."""
    system = problem.system
    structure = system.structure
    if not problem.free_time:
        raise ValueError(
            f"expected an energy where the time of an event is free, found energy = "
            f"{problem.energy} and both times given; make one of them None"
        )
    if np.inf in (abs(e.t or 0.0) for e in (problem.start, problem.end)):
        raise ValueError(
            "expected a finite time beside one that is free, found an infinite one: the duration "
            "is then infinite; give both events their times"
        )
    energy = 0.0 if problem.energy is None else number(problem.energy, "the energy")
    object.__setattr__(problem, "energy", energy)
    if structure.forced:
        raise ValueError(
            "expected a system without non-conservative forces where a time is free: with them "
            "no action is stationary in the time; give both times"
        )
    closes = problem.end.advance is not None
    if closes and problem.laws:
        raise ValueError(
            "expected the period of a closed path along which several laws take turns, found that "
            "it is to be found; give it, Periodic(T)"
        )
    if closes and (problem.start.t is None or structure.depends_on_time):
        raise ValueError(
            "expected a closed path of a system without a clock, begun at a given time, where the "
            "period is to be found; give it, a multiple of that of the clock"
        )
    if problem.start.t is None and problem.end.t is None and structure.depends_on_time:
        raise ValueError(
            "expected one time that is given, where L depends on the time, found both free"
        )
    if system.m and structure.depends_on_time:
        _check_left_free(problem)


def _check_left_free(problem: Any) -> None:
    """Raise ValueError for a constraint that moves, and that an event of unknown time decides."""
    system = problem.system
    rows, columns = system.pointwise("constraint_jacobian").sparsity(0)
    moving, _ = ca.jacobian_sparsity(system.f, system.symbols.t).get_triplet()
    for role, event in (("start", problem.start), ("end", problem.end)):
        given = np.isin(columns, event.pinned)
        for i in moving:
            if event.t is None and given[rows == i].all():
                raise ValueError(
                    f"expected a coordinate that is free at the {role}, for constraint row {i}, "
                    "which moves in time, to decide, found all of them given: they tell the time "
                    "at which they satisfy it; give that, or leave a coordinate free (None)"
                )


def check_alike(problem: Any) -> None:
    """Raise ValueError if L tells the coordinates apart that take each other's place.

    L(P q + a, P v, t + T) = L(q, v, t) at points in general position.
    """
    system, order, advance = problem.system, list(problem.order), problem.advance
    assert advance is not None
    if system.m or system.structure.forced:
        raise ValueError(
            "expected a system without constraints and non-conservative forces where a path closes "
            "in another order, found one that has some; give the whole period, without relabel="
        )
    n, width = system.n, system.n * system.order
    q, v, t = np.split(general_points(width + n + 1), [width, width + n], axis=1)
    q, v = q * np.tile(problem.scales, system.order), v * problem.scales
    first = system.pointwise("first")
    later, moved = t if problem.free_time else t + problem.duration, q[:, problem.closed_places]
    moved[:, :n] += advance
    with np.errstate(all="ignore"):
        L = first(q, v, t, problem.packed)[2][:, 0].copy()
        there = first(moved, v[:, order], later, problem.packed)[2][:, 0]
        off = np.abs(there - L) > SURFACE_TOLERANCE * (np.abs(L) + np.abs(there))
    if off.any():
        k = int(np.argmax(off))
        names = [system.coordinates[i] for i in order]
        raise ValueError(
            "expected an order of the coordinates that leaves L as it is, L(P q, P v) = L(q, v), "
            f"found that {names} does not: at one point L is {L[k]:.6g}, and {there[k]:.6g} in "
            "that order; bodies that take each other's place have equal masses and charges"
        )


def check_integrals(problem: Any) -> None:
    """Raise ValueError for integrals of which the events tell a sum, or that no path has."""
    _check_straight(problem)
    count = problem.system.g.numel()
    for i in range(count):
        if _is_same_for_all(problem, np.eye(count)[i]):
            raise ValueError(
                "expected integrals that differ from path to path, found that of expression "
                f"{i}, which is a constant or a total derivative, to be the same for all paths "
                "between the events, so that no multiplier is determined; leave it out"
            )
    if count > 1 and (c := _dependence(problem)) is not None and _is_same_for_all(problem, c):
        raise ValueError(
            "expected integrals that do not tell one another, found that those of expressions "
            f"{np.flatnonzero(c).tolist()} do, by a sum of them that is a constant or a total "
            "derivative, so that no multipliers are determined; leave one of them out"
        )


def _is_same_for_all(problem: Any, c: Array) -> bool:
    """Whether the events tell the integral of c.g: its Euler-Lagrange equations are 0 = 0.

    Where they give all of both ends; of closed paths, where it contains neither t nor an advance.
    """
    system, events, way = problem.system, (problem.start, problem.end), problem.advance
    s, g = system.symbols, system.g[np.flatnonzero(c).tolist()]
    timed = None not in (problem.start.t, problem.end.t)
    if not timed or system.order > 1 or isinstance(problem.question, tuple):
        return False
    if way is not None and (ca.depends_on(g, s.t) or (np.any(way) and ca.depends_on(g, s.q))):
        return False
    if way is None and min(len(e.pinned) for e in events) < system.n:
        return False
    if not _is_same_for_two(problem, c):  # this tells most apart, and derives nothing
        return False
    # What is narrow lies between points in general position, and hardly changes the integrals.
    for states in (general_states(system.n), _two_curves(problem)):
        terms = [x * _equations(problem, i, *states) for i, x in enumerate(c) if x]
        try:
            if not negligible(remainder(np.concatenate(terms, axis=2))):
                return False
        except ValueError:  # it is finite nowhere there
            return False
    return True


def _equations(problem: Any, i: int, q: Array, v: Array, t: Array) -> Array:
    """Return the terms of the Euler-Lagrange equations of g_i at K states, (2 n, K, k)."""
    system = problem.system
    s, g = system.symbols, system.g[i]

    def build() -> ca.Function:
        a, p = ca.SX.sym("a", system.n), ca.gradient(g, s.v)
        rates = (ca.jacobian(p, x) @ ca.diag(y) for x, y in ((s.q, s.v), (s.v, a)))
        terms = ca.horzcat(ca.gradient(g, s.q), -ca.jacobian(p, s.t), *(-x for x in rates))
        # |v| has no equations either, but on both sides of its kink: another slope.
        kink = ca.horzcat(p, -ca.substitute(p, s.v, a), ca.SX(system.n, 2 * system.n))
        terms = ca.densify(ca.vertcat(terms, kink))
        return ca.Function("terms", [s.q, s.v, s.t, a, s.p], [terms])

    terms = system.memoize(f"equations of integral {i}", build).map(len(q))
    values = terms(q.T, v.T, t.T, v[::-1].T, problem.packed.T).full()
    return values.reshape(2 * system.n, len(q), -1)


def _dependence(problem: Any) -> Array | None:
    """Return c (count,) for which the equations of c.g vanish at points of size one, or None."""
    count = problem.system.g.numel()
    if problem.system.order > 1:
        return None
    states = [x[:GENERIC] for x in general_states(problem.system.n)]
    sums = [_equations(problem, i, *states).sum(axis=2).ravel() for i in range(count)]
    rows = np.array(sums)[:, np.isfinite(sums).all(axis=0)]
    size = np.linalg.norm(rows, axis=1)
    if not rows.shape[1] or not size.all():
        return None
    left, ratios, _ = np.linalg.svd(rows / size[:, None], full_matrices=False)
    if ratios.size == count and ratios[-1] > CANCELLED:
        return None
    c = left[:, -1]
    return np.where(np.abs(c) > CANCELLED, c, 0.0) / size


def _two_curves(problem: Any) -> tuple[Array, Array, Array]:
    """Return q, v (K, n) and t (K, 1) along a straight and a bent curve between the events."""
    n, t0, T = problem.system.n, problem.start.t, problem.duration
    q0 = np.array([0.0 if x is None else x for x in problem.start.q or [0.0] * n])
    way = problem.end.q - q0 if problem.advance is None else np.array(problem.advance)
    size = np.maximum(problem.lengths, 1e-300)
    bend = np.stack([0.0 * size, size * np.linspace(0.5, 1.0, n)])[:, None]
    s = (np.arange(CURVE_POINTS)[:, None] + 0.5) / CURVE_POINTS
    q = q0 + way * s + bend * np.sin(np.pi * s)
    v = (way + bend * np.pi * np.cos(np.pi * s)) / T
    return q.reshape(-1, n), v.reshape(-1, n), np.tile(t0 + T * s, (2, 1))


def _is_same_for_two(problem: Any, c: Array) -> bool:
    """Whether that of c.g is the same along two curves: a step may lie between all other points."""
    system = problem.system
    x = system.symbols

    def build() -> Pointwise:
        return Pointwise(ca.Function("integrands", [x.q, x.v, x.t, x.p], [ca.densify(system.g)]))

    with np.errstate(all="ignore"):
        (g,) = system.memoize("integrands", build)(*_two_curves(problem), problem.packed)
        g = (c * g)[:, c != 0].reshape(2, CURVE_POINTS, -1)
        one, other = g.mean(axis=1).sum(axis=1)
        return bool(abs(one - other) <= SAME_INTEGRAL * np.abs(g).mean(axis=1).sum(axis=1).max())


def _check_straight(problem: Any) -> None:
    """Raise ValueError for an integral of g(v) beyond that along the straight line.

    Of one that is convex, as a length is, the straight line has the least (Jensen's inequality).
    How it bends is asked at rates in units of those at which g(0) and the part of second order are
    of one size.
    """
    system, events, way = problem.system, (problem.start, problem.end), problem.advance
    T = None if None in (problem.start.t, problem.end.t) else problem.duration
    if T is None or problem.through or system.order > 1:
        return
    if way is None:
        if min(len(e.pinned) for e in events) < system.n:
            return
        way = np.subtract(events[1].q, events[0].q)
    for i, asked in enumerate(problem.integral):
        known = system.memoize(f"rates of integral {i}", lambda g=system.g[i]: _of_rates(system, g))
        if known is None:
            continue
        of, is_linear = known
        g, bends = (x.copy() for x in of(np.stack([0.0 * way, way / T]), problem.packed))
        with np.errstate(all="ignore"):
            unit = np.sqrt(np.abs(g[0] / bends[0, :: system.n + 1]))
        unit = np.where(np.isfinite(unit) & (unit > 0), unit, 1.0)
        # Of all sizes: near zero another g may bend back.
        points = general_states(system.n)[1]
        values, hessians = of(points * unit, problem.packed)
        hessians = hessians.reshape(-1, system.n, system.n) * np.outer(unit, unit)
        if not np.isfinite(hessians).all():
            continue
        bends = np.linalg.eigvalsh(hessians)
        of_value = np.abs(values[:, 0]) / np.sum(points**2, axis=1)
        size = CANCELLED * (np.abs(bends).max(axis=1) + of_value)[:, None]
        straight = T * float(g[1, 0])
        for sign, most, few in ((1, "least", "less"), (-1, "largest", "more")):
            beyond, rounding = sign * (straight - asked), CANCELLED * abs(straight)
            seen = is_linear or (sign * bends > size).any()  # |v| has more, though it never bends
            if beyond < -rounding or not seen or not (sign * bends >= -size).all():
                continue
            if beyond > rounding:
                raise ValueError(
                    "expected values of the integrals that a path between the events reaches, "
                    f"found {asked:g} and no such path: the {most} is {straight:.9g}, along the "
                    f"straight line, and none has {few}"
                )
            if not is_linear:
                raise ValueError(
                    "expected values of the integrals that neighbours have as well, found "
                    f"{asked:g}, the {most}, which the straight line has alone: nothing is left to "
                    "vary, and no multiplier is determined; change the value"
                )


def _of_rates(system: System, g: ca.SX) -> tuple[Pointwise, bool] | None:
    """Return g(v) and its second derivatives, and whether g is linear; None of more arguments."""
    s = system.symbols
    if ca.depends_on(g, ca.vertcat(s.q, s.t)):
        return None
    H, slope = ca.hessian(g, s.v)
    outputs = [ca.densify(g), ca.densify(H)]
    return Pointwise(ca.Function("g", [s.v, s.p], outputs)), not ca.depends_on(slope, s.v)


def check_surfaces(problem: Any) -> None:
    """Raise ValueError where what an event lies on does not fit the rest of the question."""
    ends = problem.start, problem.end
    both = problem.start.t is None and problem.end.t is None
    if problem.advance is not None and problem.system.r:
        if problem.system.with_contact.structure.depends_on_time:
            raise ValueError(
                "expected a closed path along an obstacle that begins on a surface to have no "
                "clock, found the time in the Lagrangian or the obstacle: it is found free of the "
                "surface and begun where it meets that, which with a clock is another motion; "
                "leave out `on`, or the time"
            )
        given = ends[0].on.count + sum(x is not None for x in ends[0].q)
        if given > 1:
            raise ValueError(
                "expected one condition on where a closed path along an obstacle begins, found "
                f"{given}: a path that may begin anywhere along itself passes no given point in "
                "general; give one expression of on, and no coordinate"
            )
    for role, event in (("start", ends[0]), ("end", ends[1])):
        on, free = event.on, [i for i, x in enumerate(event.q) if x is None]
        if on is None:
            continue
        if on.count > len(free):
            raise ValueError(
                f"expected on at the {role} to return at most as many expressions as it has free "
                f"coordinates, {len(free)}, found {on.count}; leave more coordinates free (None)"
            )
        rows, columns = on.law.jac_sparsity(0, 0).get_triplet()
        decides = {i for i, j in zip(rows, columns, strict=True) if j in free}
        for i in set(range(on.count)) - decides:
            raise ValueError(
                f"expected each expression of on at the {role} to contain a coordinate that is "
                f"free there, found that number {i} contains none; a time is given as t"
            )
        if both and on.depends_on_time:
            raise ValueError(
                f"expected one time that is given, where on at the {role} depends on the time, "
                "found both free"
            )


def check_constraint_rows(system: System) -> None:
    """Raise ValueError for a constraint row that contains no coordinate."""
    rows, _ = system.pointwise("constraint_jacobian").sparsity(0)
    count = np.bincount(rows, minlength=system.m)
    if not count.all():
        raise ValueError(
            "expected constraints that each restrict the coordinates, found that row "
            f"{np.argmin(count)} does not depend on any of them; remove it, or correct it"
        )


def check_on_surface(problem: Any) -> None:
    """Raise ValueError if a constraint that an event alone decides is not satisfied there."""
    system = problem.system
    between = {f"event {k} of through": e for k, e in enumerate(problem.through)}
    events = {"the start event": problem.start, **between, "the end event": problem.end}
    q = np.array([[0.0 if x is None else x for x in e.q] for e in events.values()])
    t = np.array([[e.t or 0.0] for e in events.values()])
    jacobian = system.pointwise("constraint_jacobian")
    G, f = jacobian(q, t, problem.packed)
    G = np.abs(G)
    rows, cols = jacobian.sparsity(0)
    # What f changes by when the coordinates and the time change by their own size: |f| alone has
    # no scale.
    scales = np.zeros(f.shape)
    for k in range(len(events)):
        np.add.at(scales[k], rows, G[k] * problem.scales[cols])
    if system.structure.depends_on_time:
        rate = system.pointwise("constraint_rate")(q, t, problem.packed)[0]
        scales += np.abs(rate) * (np.abs(t) if problem.free_time else problem.duration)
    off = ~(np.abs(f) <= SURFACE_TOLERANCE * np.maximum(scales, np.finfo(float).tiny))
    for k, (role, event) in enumerate(events.items()):
        free = np.array([x is None for x in event.q])
        off[k, rows[free[cols]]] = False  # decided along the path
        if event.t is None and system.structure.depends_on_time:
            off[k] = False  # when that is, too
        for i in np.flatnonzero(off[k]):
            raise ValueError(
                f"expected {role} on the constraint surface, found constraint row "
                f"{i} = {f[k, i]:.6g} at t = {event.t}, q = {event.q}; move the event, or "
                "leave a coordinate free (None) for the constraint to decide"
            )
