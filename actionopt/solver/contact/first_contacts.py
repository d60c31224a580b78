"""First paths outside of an obstacle, f(q, t) >= 0, and which parts of them are in contact.

On a coarse mesh Ipopt minimises S with f >= 0 at the nodes, in a form that tells the distance
(`System.with_contact_distance`); its multipliers tell which parts of the path are in contact. What
passes between the nodes is looked for there: a path's polynomials are known everywhere.
"""

from __future__ import annotations

import math
from functools import cache
from time import perf_counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.borders.borders import PhaseCondition, Rows, Times, times_of
from actionopt.discrete.meshes.boundaries import with_boundaries
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.mechanics.question.held import Held, contacts_of
from actionopt.mechanics.question.obstacle import EVENT_TOLERANCE, Arc
from actionopt.mechanics.question.problem import Problem
from actionopt.solver.refinement.first_mesh import COARSE_ELEMENTS
from actionopt.solver.refinement.ipopt import Principle, find
from actionopt.solver.refinement.workspace import Workspace
from actionopt.solver.search.search import CURVED_HEIGHT
from actionopt.tools.lobatto import Rule, lgl
from actionopt.tools.types import EPS, Array

# Ad hoc, all of them.
# In the motion's sizes, of the lines to either side of the straight one.
HEIGHTS = CURVED_HEIGHT * 2.0 ** np.arange(4)
ACROSS = np.linspace(0.0, 6.4, 129)  # in the motion's sizes, where the other side is looked for
WEAK = 1e-3  # impulse in its own unit: a weaker one may be the barrier's
WINDOW = 8  # elements where a path passes through what no node sees, such as a peg
UNSEEN = 1e-9  # in units of the rows: what f is below zero there
# parts of each interval in which f is least, and how often it shrinks
CLOSEST, CLOSEST_ROUNDS = np.linspace(0.0, 1.0, 40), 4
TURN = np.pi / 4  # of the obstacle's normal along an element
ROUND_SHARE = 1e-6  # of an element, what is round-off of its length; ad hoc
BETWEEN = 8  # degree of the points in an element where contact is looked at between nodes
WHOLE = 0.01  # how near a whole number the order is of a row that grows as a power of the distance
NO_ROOM = "no path outside of the obstacle was found: its rows may contradict each other somewhere"


def sideways(problem: Problem, path: Path) -> Array:
    """Return a direction (n,) across a path's way, coordinates in units of `measures`."""
    return across((path.values[:, -1] - path.values[:, 0]) / problem.measures)


def across(along: Array) -> Array:
    """Return a direction (n,) across another one, any one if that is zero."""
    side = np.cos(np.arange(1.0, 1.0 + along.size))
    return side - (side @ along) / (along @ along) * along if along.any() else side


def lines(problem: Problem, mesh: Mesh) -> list[Path | None]:
    """Return the straight line (None), and lines curved to either side of it: past the obstacle.

    Where integrals are given, lines bent by waves until they have their values.
    """
    n, m = problem.system.n, problem.system.m
    if problem.integral is not None:
        from actionopt.solver.search.waves import first_waves

        times, random = times_of(problem), np.random.default_rng(0)
        straight = Path(mesh, Transcription(problem, mesh, problem.lengths).straight().T)
        bent = first_waves(problem, straight, times, problem.lengths, 2 * n, random)
        return [path for path, _ in bent] or [None]
    if n == 1:
        return [None]
    tr = Transcription(problem, mesh, problem.lengths)
    Q, sizes = tr.straight(), problem.measures
    last = len(problem.joints_found) - 1
    bound = [k in (0, last) or bool(e.pinned) for k, e in enumerate(problem.joints_found)]
    joints = tr.joints[bound]  # the others are passed wherever the line is then
    leg = np.minimum(np.searchsorted(joints, np.arange(len(Q)), side="right"), len(joints) - 1) - 1
    sides = np.array([across(along) for along in np.diff(Q[joints], axis=0) / sizes])
    first, last = mesh.nodes_since[joints[leg]], mesh.nodes_since[joints[leg + 1]]
    part = (mesh.nodes_since - first) / (last - first)
    bow = np.sin(np.pi * part)[:, None] * (sides[leg] * sizes)
    outside = problem.system.with_contact.pointwise("constraint")
    found: list[Path | None] = [None]
    for sign in (1.0, -1.0):
        for height in HEIGHTS:
            line = Q + sign * height * bow
            if (outside(line, mesh.nodes[:, None], problem.packed)[0][:, m:] >= 0).all():
                break
        found.append(Path(mesh, line.T))
    return found


def touch(ws: Workspace, mesh: Mesh, path: Path | None, principle: Principle) -> bool:
    """Ask Ipopt for a least path with f >= 0 at the nodes; False if it finds none."""
    free, started = ws.question, perf_counter()
    ws.problem = Held(free, sought=True)
    if ws.problem.boundaries:
        mesh = with_boundaries(mesh, ws.problem.boundaries)
    ws.transcribe(mesh, path, np.zeros((mesh.nodes.size, ws.problem.system.m)))
    tr = ws.here.tr
    with ws.record.clock("solve"):
        outside = tr.layout.row_constraint >= free.system.m
        equations, own = tr, slice(None, tr.layout.size)
        if free.integral is not None:
            equations, own = ws.here.equations.without(Rows, Times, PhaseCondition)
        attempt = find(equations, ws.here.z[own], principle, outside)
    ws.record.iterations["ipopt"] += attempt.iterations
    ws.unbounded = attempt.status == "Diverging_Iterates"
    ws.hint = NO_ROOM if attempt.status == "Infeasible_Problem_Detected" else ""
    if attempt.converged:
        z = ws.here.z.copy()
        z[own] = attempt.z
        ws.here = ws.here.moved(z)
        ws.record.round(tr, perf_counter() - started)
    return attempt.converged


def contact_parts(found: DiscretePath) -> tuple[Arc, ...]:
    """Return the parts in contact of what Ipopt found, as far as nodes tell."""
    tr, t, on, held = found.tr, found.mesh.nodes, _pressing(found), contacts_of(found.problem)
    f = held.system.constraint(found.Q.T, t, parameters=held.parameters)[held.free.system.m :]
    # Events on the obstacle have no rows.
    met = np.abs(f) <= EVENT_TOLERANCE * tr.row_units[-len(f) :, None]
    distance = np.sqrt(np.maximum(f, 0.0))
    arcs, inner = [], tr.joints[1:-1]
    for i, row in enumerate(on):
        row[0] |= row[1] and met[i, 0]
        row[-1] |= row[-2] and met[i, -1]
        row[inner] |= (row[inner - 1] | row[inner + 1]) & met[i, inner]
        for k, l in runs(row):
            if k == l and t[k] in held.fixed_times:  # at a free end alone, or at a kink
                arcs.append(Arc(i, float(t[k]), float(t[k])))
                continue
            begin, end = float(t[k]), float(t[l])
            if k not in inner:  # on the obstacle at an event it may leave at an angle
                begin = _where_zero(t[k::-1], distance[i, k::-1])
            if l not in inner:
                end = _where_zero(t[l:], distance[i, l:])
            arcs.append(Arc(i, begin, end))
    return tuple(arcs)


def other_sides(found: DiscretePath, arcs: tuple[Arc, ...]) -> list[Path]:
    """Return curves that pass the obstacle on its other side, one for each part in contact.

    Each curve moves the middle of its part straight across, and the path with it as far as the
    parts before and behind. Obstacles without a far side, such as a half plane,
    have no such curve.
    """
    held, mesh, curves = contacts_of(found.problem), found.mesh, []
    parameters = held.parameters
    if held.system.n == 1:
        return []
    sizes = held.measures
    for arc in arcs:
        events = [e.t for e in held.joints_found]
        a = max(t for t in (*(x.end for x in arcs), *events) if t < arc.begin or t == events[0])
        b = min(t for t in (*(x.begin for x in arcs), *events) if t > arc.end or t == events[-1])
        if not a < arc.begin <= arc.end < b:
            continue
        t, i = (arc.begin + arc.end) / 2, held.free.system.m + arc.row
        q = found.path(t)
        inwards = -sizes * held.system.constraint_jacobian(q, t, parameters=parameters)[i]
        away = sizes * inwards / np.linalg.norm(inwards)
        line = q[:, None] + away[:, None] * ACROSS
        f = held.system.constraint(line, np.full(ACROSS.size, t), parameters=parameters)[i]
        behind = np.flatnonzero(np.logical_or.accumulate(f < 0) & (f >= 0))
        if behind.size:
            bump = np.interp(mesh.nodes, [a, arc.begin, arc.end, b], [0.0, 1.0, 1.0, 0.0])
            curves.append(Path(mesh, found.Q.T + np.outer(ACROSS[behind[0]] * away, bump)))
    return curves


def hidden_contact_times(found: DiscretePath) -> list[Array]:
    """Return times since the start around which a path is inside of the obstacle unseen.

    There elements have to be shorter for their nodes to see it.
    """
    t, _, _, f = sample_rows(contacts_of(found.problem), found.path)
    reach = float(np.diff(found.mesh.nodes).max())
    arcs, windows = contact_parts(found), []
    for i, row in enumerate(f < -UNSEEN * found.tr.row_units[-len(f) :, None]):
        for k, l in runs(row):
            a, b = t[max(k - 1, 0)], t[min(l + 1, t.size - 1)]
            near = (x for x in arcs if x.begin < b + reach and a - reach < x.end)
            if all(arc.row != i for arc in near):
                windows.append(_window(found, a - (b - a), b + (b - a)))
    return windows


def narrow_contact_times(found: DiscretePath) -> list[Array]:
    """Return times since the start around which contact is seen by one or two nodes."""
    t = found.mesh.nodes
    return [
        _window(found, t[max(k - 1, 0)], t[min(l + 1, t.size - 1)])
        for row in _pressing(found)
        for k, l in runs(row)
        if l - k < 2
    ]


def cut_part(
    a: float,
    b: float,
    duration: float,
    free: float = COARSE_ELEMENTS,
    times: Array | None = None,
    turned: Array | None = None,
) -> Array:
    """Return the times after a, up to b, at which elements of a path of a duration end.

    By the angles (K,) by which an obstacle's normals `turned` at times (K,) from a to b, if there
    is contact; else by so many elements of a `free` path over the whole duration.
    """
    count = max(math.ceil((free if times is None else COARSE_ELEMENTS) * (b - a) / duration), 1)
    if times is None or turned is None or not turned[-1] > TURN * count:
        since = a + (b - a) * (np.arange(1, count + 1) / count)
        since[-1] = b
        return since
    count = math.ceil(turned[-1] / TURN)
    # Half of them by the angle, half by the time.
    both = (times - a) / (b - a) + turned / turned[-1]
    return np.append(np.interp(np.linspace(0.0, 2.0, count + 1)[1:-1], both, times), b)


def normal_turns(held: Held, path: Path, a: float, b: float) -> tuple[Array, ...]:
    """Return times (K,) from a to b, since the start, and by what angle (K,) normals turned.

    Those of the rows that are in contact all the while; of the most, where there are more. Nothing
    where there are none.
    """
    m, start = held.free.system.m, held.start.t
    rows = m + np.flatnonzero(held.active(np.array([start + (a + b) / 2]))[m:, 0])
    if not rows.size:
        return ()
    since = path.mesh.nodes_since
    times = np.concatenate([[a], since[(a < since) & (since < b)], [b]])
    turned, t = np.zeros(times.size), times + start
    jacobian = held.system.pointwise("constraint_jacobian")
    G = jacobian.full(0, jacobian(path(t).T, t[:, None], held.packed)[0])
    normals = G[:, rows] * held.measures
    normals /= np.maximum(np.linalg.norm(normals, axis=2), EPS)[:, :, None]
    cosines = np.sum(normals[1:] * normals[:-1], axis=2)
    angles = np.cumsum(np.arccos(np.clip(cosines, -1.0, 1.0)), axis=0)
    turned[1:] = angles[:, np.argmax(np.nan_to_num(angles[-1]))]
    return times, turned


class SampledPath(NamedTuple):
    """A path between its nodes, at K times in order.

    Coordinates and velocities, those of the later element where two meet, and an obstacle's rows.
    """

    t: Array  # (K,)
    q: Array  # (K, n)
    v: Array  # (K, n)
    rows: Array  # (r, K)


@cache
def _points(rule: Rule, parts: int) -> tuple[Array, Array]:
    """Return where an element is looked at, (L,), in its length, and what tells q and v there.

    But for its end; the matrices (2, L, d + 1) are of its nodes. Each of its `parts` is looked at
    as often.
    """
    xi = (np.arange(parts)[:, None] + (lgl(BETWEEN).nodes[:-1] + 1) / 2).ravel() * (2 / parts) - 1
    xi = np.union1d(rule.nodes[:-1], xi)
    xi = xi[np.diff(xi, prepend=-np.inf) > ROUND_SHARE]
    return (xi + 1) / 2, np.stack([rule.interpolation(xi), rule.slopes(xi)])


def rows_between(held: Held, path: Path) -> SampledPath:
    """Return a path at its nodes and at others between.

    These are as near each other as on elements that are not few.
    """
    mesh, Q = path.mesh, path.values.T
    n, shares = Q.shape[1], mesh.lengths * (COARSE_ELEMENTS / mesh.duration)
    # What is no longer by round-off is one part.
    parts = np.maximum(np.ceil(shares - ROUND_SHARE), 1.0)
    times, places, rates = [mesh.boundaries[-1:]], [Q[-1:]], []
    for g in mesh.groups:
        of_each = parts[g.elements]
        for count in sorted(set(of_each.tolist())):
            mine = (of_each == count).nonzero()[0]
            (part, matrices), h = _points(g.rule, int(count)), mesh.lengths[g.elements[mine], None]
            q, v = matrices[:, None] @ Q[g.nodes[mine]]
            times.append((mesh.boundaries[g.elements[mine], None] + h * part).ravel())
            places.append(q.reshape(-1, n))
            rates.append((v * (2 / h[:, :, None])).reshape(-1, n))
        if g.elements[-1] == mesh.elements - 1:
            h = mesh.lengths[-1]
            rates.insert(0, g.rule.derivative[-1:] @ Q[g.nodes[-1]] * (2 / h))
    t, q, v = (np.concatenate(x) for x in (times, places, rates))
    order = t.argsort(kind="stable")
    t, q, v = t[order], q[order], v[order]
    return SampledPath(t, q, v, held.rows(q, t))


def _is_inside(held: Held, t: Array, rows: Array) -> bool:
    """Whether one of the obstacle's rows (r, K) at times t (K,) is below zero, and not held."""
    below = rows < 0
    if held.arcs and below.any():
        below &= ~held.active(t)[held.free.system.m :]
    return bool(below.any())


def sample_rows(held: Held, path: Path) -> SampledPath:
    """Return a path between the nodes, also where a row is least among its neighbours.

    And where one may be least beside an end of the path or of contact: there f is zero and may
    fall before it grows. None of these are told where the path is outside at all of them.
    """
    seen = rows_between(held, path)
    t, rows = seen.t, seen.rows
    falls, grows = rows[:, 1:] < rows[:, :-1], rows[:, 1:] > rows[:, :-1]
    on = np.zeros(rows.shape, dtype=bool)
    if held.arcs:
        on = held.active(t)[held.free.system.m :]
    i, k = (falls[:, :-1] & grows[:, 1:] & ~on[:, 1:-1]).nonzero()
    edge = on[:, 1:] != on[:, :-1]
    edge[:, [0, -1]] |= ~on[:, [0, -1]]
    row, at = edge.nonzero()
    i = np.concatenate([i, row])
    begin, end = np.concatenate([[t[k], t[k + 2]], [t[at], t[at + 1]]], axis=1)
    parts, each = [], np.arange(i.size)
    for again in range(CLOSEST_ROUNDS if i.size else 0):
        near = begin[:, None] + (end - begin)[:, None] * CLOSEST
        times = near.ravel()
        rows = held.rows(path.at(times - held.start.t).T, times)
        f = rows.reshape(len(rows), *near.shape)[i, each]
        least = f.argmin(axis=1)
        within = (least > 0) & (least < CLOSEST.size - 1)  # at an end it is among the others
        least = np.minimum(np.maximum(least, 1), CLOSEST.size - 2)
        if again:  # later ones tell the least alone
            told = ((each * CLOSEST.size + least)[:, None] + [-1, 0, 1]).ravel()
            times, rows = times[told], rows[:, told]
        parts.append((times, rows))
        begin, end = near[each, least - 1], near[each, least + 1]
        rise = np.maximum(f[each, least - 1], f[each, least + 1]) - f[each, least]
        left = within & (f[each, least] < rise)  # else it stays outside
        if not left.any():
            break
        i, begin, end, each = i[left], begin[left], end[left], each[: np.count_nonzero(left)]
    if not any([_is_inside(held, *part) for part in parts]):
        return seen
    times, rows = zip(*parts, strict=True)
    between = np.concatenate(times)
    q, v = (x.T for x in path.carried_on(between - held.start.t, 1.0))
    t, where = np.unique(np.concatenate([t, between]), return_index=True)
    q, v = np.concatenate([seen.q, q]), np.concatenate([seen.v, v])
    rows = np.concatenate([seen.rows, *rows], axis=1)
    return SampledPath(t, q[where], v[where], rows[:, where])


def is_of_higher_order(found: DiscretePath) -> bool:
    """Return whether a row in contact grows as a whole power of the distance from its surface.

    In the form that tells the distance (`System.with_contact_distance`) a row that grows as its
    power k has the slope 1 / k at the surface. Planes, which keep their own form, may have any.
    """
    held, t = contacts_of(found.problem), found.mesh.nodes
    if not held.sought:
        return False
    own = Held(held.free, held.arcs).system
    told, given = (
        x.constraint_jacobian(found.Q.T, t, parameters=held.parameters) for x in (held.system, own)
    )
    slopes = np.linalg.norm(told * held.measures[:, None], axis=1)
    for i, row in enumerate(held.active(t) & np.isfinite(slopes)):  # none on a power's surface
        if i < held.free.system.m or not row.any() or (told[i] == given[i]).all():
            continue
        k = np.round(1 / np.maximum(np.median(slopes[i, row]), EPS))
        if k > 1 and np.abs(k * slopes[i, row] - 1).max() < WHOLE / k:
            return True
    return False


def runs(row: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return the first and the last index of each run of True in a row (K,)."""
    padded = np.concatenate([[False], row, [False]])
    change = (padded[1:] != padded[:-1]).nonzero()[0].tolist()
    return [(k, l - 1) for k, l in zip(change[::2], change[1::2], strict=True)]


def _pressing(found: DiscretePath) -> NDArray[np.bool_]:
    """Return at which nodes a row presses, (r, K): its multiplier exceeds the row."""
    tr, layout, system = found.tr, found.tr.layout, contacts_of(found.problem).system
    pressing = -found.z[layout.unknowns : layout.size] > np.maximum(tr.constraint(found.x), WEAK)
    on = np.zeros((system.m, layout.node_count), dtype=bool)
    on[layout.row_constraint[pressing], layout.row_node[pressing]] = True
    if found.problem.advance is not None:  # where a path closes, its end is its start
        on[:, -1] |= on[:, 0]
    return on[contacts_of(found.problem).free.system.m :]


def _window(found: DiscretePath, a: float, b: float) -> Array:
    """Return times since the start at which to cut elements from a to b."""
    since = np.linspace(a, b, WINDOW + 1) - found.problem.start.t
    return since[(since > 0) & (since < found.problem.duration)]


def _where_zero(t: Array, distance: Array) -> float:
    """Return the time at which contact begins, from nodes outside of it, the nearest one first.

    Near contact f grows as the square of the time from it: its square root `distance` (K,) at the
    times t (K,) is extrapolated to zero by the line through the second and the third.
    """
    if t.size < 3:
        return float(t[-1] if t.size == 1 else t.mean())
    rate = (distance[2] - distance[1]) / (t[2] - t[1])
    zero = t[1] - distance[1] / rate if rate else t[0]
    return float(np.clip(zero, min(t[0], t[1]), max(t[0], t[1])) * 0.98 + 0.02 * t[:2].mean())
