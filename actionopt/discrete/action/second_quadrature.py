"""The equations of a path once more, with another quadrature.

A path is sampled where its nodes are. Forces that vary faster than it does (a narrow pulse, a kink
where a node happens to be, a total time derivative that should cancel) may be missed there, and
nothing in the path tells. Summed over other points its equations then no longer hold. The other
points leave no gap in which a narrow feature could hide (`tracing.SAMPLES`), whatever the elements
and the tolerance are.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from actionopt.discrete.action.action import Action
from actionopt.tools.immutable import immutable
from actionopt.tools.lobatto import Sampling
from actionopt.tools.types import EPS, Array, NDInt

PANEL_COUNTS = np.sort([2**k * f for k in range(13) for f in (1, 3)])  # few kinds of elements
# Ad hoc. A third of the shares or three times as much, or 2 to 8 parts: 2 % of the unknowns and two
# meshes of a hundred on the scenes.
CUT_SHARE = 0.1  # of what the worst element misses, for which one is cut
CUT_PARTS = 4  # in so many
MASSLESS = 1e-12  # of the largest inertia: what has less has none; ad hoc
NO_DEPARTURE = 16 * EPS  # of a momentum, in sums of forces; ad hoc
PEAK_SHARE = 0.05  # of the worst panel of an element: one that misses more is of the same feature


@immutable
class Batch:
    """Elements of one degree that are sampled alike."""

    elements: NDInt  # (E,)
    nodes: NDInt  # (E, d + 1)
    at: NDInt  # (E (d + 1) n,): positions of the nodes' coordinates in the full gradient (K n)
    half: Array  # (E, 1, 1): half the elements' lengths
    # rule, own: where they are sampled, and where their nodes are.
    rule: Sampling
    own: Sampling
    panels: int  # parts of each element, or 0 for a few points between the nodes
    times: Array  # (E points, 1): the first one alone, (1, 1), where nothing depends on it
    singular: bool  # whether L is infinite at an end of them


def batches(tr: Action) -> list[Batch]:
    """Return the elements with points between their nodes that leave no large gap."""
    structure, mesh, n = tr.problem.system.structure, tr.mesh, tr.problem.system.n
    found = []
    for g, half in zip(tr.layout.groups, tr.halves, strict=True):
        panels = np.zeros(half.size, dtype=int)  # a few points between the nodes will do
        if structure.samples:
            count = half.ravel() * (2 * structure.samples / (mesh.duration * g.rule.panel))
            panels = PANEL_COUNTS[
                np.minimum(np.searchsorted(PANEL_COUNTS, count), PANEL_COUNTS.size - 1)
            ]
            panels = np.where(panels > 1, panels, 0)
        kinds = set(panels.tolist())
        at = tr.layout.scatter[n * g.span.start : n * g.span.stop].reshape(half.size, -1)
        for p in sorted(kinds):
            which = np.flatnonzero(panels == p) if len(kinds) > 1 else slice(None)
            rule, times = g.rule.dense(p) if p else g.rule.other, mesh.boundaries[:1]
            if structure.depends_on_time:
                middle = mesh.since[g.elements[which], None] + half[which, 0]
                times = times + (middle + half[which, 0] * rule.nodes)
                times = tr.element_times(g.elements[which], times)[:, 0]
            where = g.elements[which], g.nodes[which], at[which].ravel(), half[which]
            found.append(Batch(*where, rule, g.rule.same, p, times[:, None], any(g.rule.ends)))
    return found


def quadrature_defect(
    tr: Action, batches: list[Batch], x: Array, *, followed: bool = True
) -> tuple[Array, float]:
    """Return what another quadrature finds left of dS/dx, less what `tr` does, in its units.

    And the drift, in the units of x, that the momentum missed with it gives to a free body: where a
    feature in q is not resolved, nor is what would hold the body there. Zero where there can be no
    such feature. Where what the nodes leave out does not matter it need not be `followed`.
    """
    works = [(b, _work(tr, b, *values)) for b, values in _values(tr, x, batches, followed)]
    parts = [(b.at, work.ravel()) for b, work in works]
    at, work = parts[0] if len(parts) == 1 else map(np.concatenate, zip(*parts, strict=True))
    whole = np.bincount(at, work, tr.layout.node_count * tr.layout.width)
    drift = 0.0
    structure = tr.problem.free.system.structure  # an obstacle adds nothing to these forces
    # Beside a singular end inertias and momenta are as large as one likes.
    freed = tr.order == 1 and not any(tr.mesh.singular_ends)
    if structure.samples and not structure.linear and freed:
        momenta = np.zeros((tr.mesh.elements, tr.problem.system.n))
        for b, work in works:
            momenta[b.elements] = work.sum(axis=1)
        for g, mine in zip(tr.layout.groups, tr.work(x), strict=True):
            momenta[g.elements] -= mine.sum(axis=1)
        if not structure.constant_mass:  # it is a velocity that it gives, by its own inertia
            momenta *= np.fmin(_lightness(tr, x), 1.0)
        # The unit of action is that of an inertia times a length squared over the duration.
        unit = tr.lengths / tr.action_unit
        if tr.origin is not None:  # as `measured` has it
            unit = unit / (1.0 + np.abs(tr.origin) / tr.lengths)
        drift = float(np.abs(np.cumsum(momenta, axis=0) * unit).max())
    return tr.free_part(whole) - tr.summed_gradient(x), drift


def _lightness(tr: Action, x: Array) -> Array:
    """Return the typical inertia of each coordinate over that on each element, (N, n)."""
    mass = np.abs(np.einsum("eii->ei", inertia(tr, x)))
    with np.errstate(all="ignore"):
        found = np.median(mass, axis=0) / mass
    return np.where(np.isfinite(found), found, 1.0)


def uneven(tr: Action, batches: list[Batch], x: Array) -> Array:
    """Return the largest part of `quadrature_defect` or `missed_action` on each element, (N,)."""
    unit = np.broadcast_to(tr.lengths / tr.action_unit, (tr.mesh.elements, tr.lengths.size))
    structure = tr.problem.system.structure
    if tr.order == 1 and not (structure.constant_mass and not structure.depends_on_time):
        unit = unit * _lightness(tr, x)  # what is light goes farther
    here: dict[int, Array] = {}
    for g, mine in zip(tr.layout.groups, tr.work(x), strict=True):
        here.update(zip(g.elements.tolist(), mine, strict=True))
    shares = np.zeros(tr.mesh.elements)
    for b, values in _values(tr, x, batches):
        for e, work in zip(b.elements.tolist(), _work(tr, b, *values), strict=True):
            off = np.abs((work - here[e]) * unit[e])
            if b.singular:  # where a force is infinite that works on no variation
                off[[end for end in (0, -1) if tr.mesh.singular_ends[end]]] = 0.0
            shares[e] = off.max()
    return np.maximum(shares, missed_action(tr, batches, x))


def missed_action(tr: Action, batches: list[Batch], x: Array) -> Array:
    """Return by how much another quadrature changes S on each element, (N,), over that of |L|.

    What L contains of the time alone moves no path, and only its integral tells how it varies. Zero
    where nothing depends on the time.
    """
    missed, structure = np.zeros(tr.mesh.elements), tr.problem.system.structure
    if not (structure.adds_time and structure.samples):
        return missed
    own, other, first = tr.first(x)[2][:, 0], values(tr, x, batches)[4], 0
    for g, half in zip(tr.layout.groups, tr.halves, strict=True):
        missed[g.elements] = own[g.span].reshape(half.size, -1) @ g.rule.weights * half.ravel()
    for b in batches:
        part = slice(first, first + b.elements.size * b.rule.nodes.size)
        missed[b.elements] -= other[part].reshape(b.half.size, -1) @ b.rule.weights * b.half.ravel()
        first = part.stop
    whole = float(tr.weight[:, 0] @ np.abs(own))
    return np.abs(missed) / (whole or 1.0)


def cuts(tr: Action, batches: list[Batch], x: Array) -> list[Array]:
    """Return for each element the times since the start at which to cut it to miss less.

    Around a peak between its nodes, or in equal parts where there is none, or where it may be a
    kink: that of a motion with a symmetry is where two parts meet.
    """
    shares = uneven(tr, batches, x)
    coarse = shares > CUT_SHARE * shares.max()
    b = tr.mesh.since
    found = [np.zeros(0)] * tr.mesh.elements
    for e in np.flatnonzero(coarse):
        found[e] = np.linspace(b[e], b[e + 1], CUT_PARTS + 1)[1:-1]
    if not tr.problem.system.structure.smooth or tr.order > 1:
        return found
    for batch, values in _sample(tr, x, batches):
        if batch.panels < CUT_PARTS or batch.singular:
            continue
        hidden = _omitted_detail(tr, x, batch, values)
        for e, panels in zip(batch.elements, hidden, strict=True):
            out = panels > PEAK_SHARE * panels.max()
            if coarse[e] and out.sum() <= batch.panels / CUT_PARTS:
                edges = 1 + np.flatnonzero(np.diff(out))  # of the peak
                found[e] = b[e] + (b[e + 1] - b[e]) * edges / batch.panels
    return found


def _values(
    tr: Action, x: Array, batches: list[Batch], followed: bool = True
) -> Iterator[tuple[Batch, tuple[Array, Array]]]:
    """Yield forces and momenta at the points of each batch, where a motion goes if it matters."""
    structure = tr.problem.system.structure
    narrow = structure.samples and not structure.linear
    # What is followed are motions of bodies with an inertia.
    return (_follow if followed and narrow and tr.order == 1 else _sample)(tr, x, batches)


def _follow(
    tr: Action, x: Array, batches: list[Batch]
) -> Iterator[tuple[Batch, tuple[Array, Array]]]:
    """Yield forces and momenta as `_sample`, but where the forces lead between the nodes.

    Polynomials that are stationary to all sums may still cross a narrow feature at a speed that is
    not the motion's, which gives it another momentum. That of the inertia times the change of
    velocity is left out: it would undo what the sums find. Constraints are followed to first order.
    """
    at = _points(tr, x, batches)
    known = [values for _, values in _sample(tr, x, batches)]
    with np.errstate(all="ignore"):
        masses = inertia(tr, x)
        inverse = inverses(masses, tr.lengths)
        own, inverse = (
            [found if len(found) == 1 else found[b.elements] for b in batches]
            for found in (masses, inverse)
        )
        along = _tangents(tr, batches, at, inverse)
        steps = [
            departure(b.rule, b.half, *values, back, tangent)
            for b, values, back, tangent in zip(batches, known, inverse, along, strict=True)
        ]
        beside = [
            (q + dq.reshape(q.shape), v + dv.reshape(v.shape))
            for (q, v), (dq, dv) in zip(at, steps, strict=True)
        ]
        moved = list(_evaluate(tr, batches, beside))
    for (b, (force, momentum)), here, mass, (_, v) in zip(moved, known, own, steps, strict=True):
        if b.singular:  # what a motion gains there has no integral
            yield b, here
            continue
        momentum = momentum - v @ mass
        if not np.isfinite(force.sum() + momentum.sum()):  # nothing is known beyond the laws
            good = np.isfinite(force) & np.isfinite(momentum)
            good = good.all(axis=(1, 2), keepdims=True)
            force, momentum = np.where(good, force, here[0]), np.where(good, momentum, here[1])
        yield b, (force, momentum)


def departure(
    rule: Sampling,
    half: Array,
    force: Array,
    momentum: Array,
    inverse: Array,
    tangent: Array | None = None,
) -> tuple[Array, Array]:
    """Return by how much a motion under these forces departs from the path, in q and v.

    Both are (E, points, n). The velocity departs by M^-1 (int force dt - momentum), and the
    coordinates by its integral, less the straight line that lets them vanish at the ends of each
    element. `inverse` are the M^-1, (E, n, n), or (1, n, n) where all are the same; constraints
    leave of a force what `tangent` (E, points, n, n) projects it on.
    """
    if tangent is None:
        gained, _ = rule.integrals(half * force)
        v = (gained - momentum) @ inverse
    else:  # of the forces of constraint, which are not known, nothing is left at any point
        gained, _ = rule.integrals(_multiply(tangent, half * force - rule.rates(momentum)))
        _, whole = rule.integrals(_multiply(tangent, gained))
        v = _multiply(tangent, gained - whole[:, None] / 2) @ inverse
    q, whole = rule.integrals(v)
    mean = whole[:, None] / 2
    q, v = q - mean * (rule.nodes[:, None] + 1), v - mean
    # Where there is little inertia the round-off of a momentum would be a large departure.
    still = (np.abs(v) <= NO_DEPARTURE * np.abs(momentum) @ np.abs(inverse)).all(axis=(1, 2))
    q[still], v[still] = 0.0, 0.0
    return half * q, v


def _multiply(matrices: Array, vectors: Array) -> Array:
    """Return the products of matrices (..., n, n) and vectors (..., n)."""
    return np.matmul(matrices, vectors[..., None])[..., 0]


def inverses(inertia: Array, lengths: Array) -> Array:
    """Return the inverses of inertias (E, n, n), zero where there is none.

    `lengths` (n,) are the coordinates' units.
    """
    unit = lengths[:, None] * lengths
    known = np.nan_to_num(unit * inertia)
    diagonal = np.einsum("eii->ei", known)  # a view
    if np.count_nonzero(known) > np.count_nonzero(diagonal):
        return unit * np.linalg.pinv(known, rcond=MASSLESS, hermitian=True)
    size = np.abs(diagonal)
    there = size > MASSLESS * size.max(axis=1, keepdims=True)
    diagonal[...] = np.where(there, 1 / diagonal, 0.0)
    return unit * known


def _tangents(
    tr: Action, batches: list[Batch], at: list[tuple[Array, Array]], inverse: list[Array]
) -> list[Array] | list[None]:
    """Return what constraints leave of forces at the points of each batch, (E, points, n, n).

    That is F - G' (G M^-1 G')^-1 G M^-1 F, with the rows that are in force on the element; None
    without constraints.
    """
    system, n, m = tr.problem.system, tr.problem.system.n, tr.problem.system.m
    if not m:
        return [None] * len(batches)
    found, function = [], system.pointwise("constraint_jacobian")
    for b, (q, _), back in zip(batches, at, inverse, strict=True):
        nonzeros = function(q, b.times, tr.problem.packed)[0]
        G = function.full(0, nonzeros).reshape(b.elements.size, -1, m, n)
        inner = b.nodes[:, 1:-1] if b.nodes.shape[1] > 2 else b.nodes
        in_force = (tr.layout.row_number[inner] >= 0).any(axis=1)
        G *= np.expand_dims(in_force, (1, 3))
        GW = G @ back[:, None]
        square = np.nan_to_num(GW @ G.swapaxes(2, 3))
        away = np.linalg.pinv(square, rcond=MASSLESS, hermitian=True) @ GW
        found.append(np.eye(n) - G.swapaxes(2, 3) @ away)
    return found


def inertia(tr: Action, x: Array) -> Array:
    """Return the mass matrix in the middle of each element, (N, n, n); one if it is constant."""
    system, n = tr.problem.system, tr.problem.system.n
    if system.structure.constant_mass and not system.structure.depends_on_time:
        return system.pointwise("second").full(2, tr.inertia[None], symmetric=True)
    nonzeros = tr.second(x)[2]
    found = np.empty((tr.mesh.elements, n, n))
    for g in tr.layout.groups:
        middle = nonzeros[g.span].reshape(*g.nodes.shape, -1)[:, g.rule.degree // 2]
        found[g.elements] = system.pointwise("second").full(2, middle, symmetric=True)
    return found


def _sample(
    tr: Action, x: Array, batches: list[Batch]
) -> Iterator[tuple[Batch, tuple[Array, Array]]]:
    """Yield dL/dq with the forces, and dL/dv, at the points of each batch: both (E, points, n)."""
    q, v, force, momentum, *_ = values(tr, x, batches)
    return _share_out(batches, _add_forces(tr, q, v, times(tr, batches), force), momentum)


def values(tr: Action, x: Array, batches: list[Batch]) -> tuple[Array, ...]:
    """Return q, v, L_q, L_v, all (points, n), L and dL/dt (points,) at all points of the batches.

    They are kept with what else is known for x. In place of dL/dt there is a zero (1,) where L does
    not contain the time, or plainly does not step.
    """
    point, structure = tr.place(x), tr.problem.system.structure
    if point.between is None:
        q, v = (_join(parts) for parts in zip(*_points(tr, x, batches), strict=True))
        timed = structure.depends_on_time and not structure.jumpless
        function = tr.problem.system.pointwise("balance" if timed else "first")
        found = [y.copy() for y in function(q, v, times(tr, batches), tr.problem.packed)]
        explicit = found[3][:, 0] if timed else np.zeros(1)
        point.between = q, v, found[0], found[1], found[2][:, 0], explicit
    return point.between


def times(tr: Action, batches: list[Batch]) -> Array:
    """Return the times of the points, (points, 1), or (1, 1) where nothing depends on them."""
    t = [b.times for b in batches]
    return _join(t if tr.problem.system.structure.depends_on_time else t[:1])


def _points(tr: Action, x: Array, batches: list[Batch]) -> list[tuple[Array, Array]]:
    """Return q and v at the points of each batch, (E points, n) each."""
    Q, n = tr.place(x).Q, tr.problem.system.n
    found = []
    for b in batches:
        if tr.order > 1:
            group, places = _group(tr, b), tr.place(x).places
            which = np.searchsorted(tr.layout.groups[group].elements, b.elements)
            rates = tr.layout.shapes[group].derivatives(tr.local(group, places)[which])
            parts = [b.rule.values @ rate / b.half**i for i, rate in enumerate(rates)]
            state = np.concatenate(parts, axis=2).reshape(-1, len(parts) * n)
            found.append((state[:, :-n], state[:, -n:]))
            continue
        local = Q[b.nodes]
        q = b.rule.values @ local
        v = b.rule.slopes @ (local - local[:, :1]) / b.half
        found.append((q.reshape(-1, n), v.reshape(-1, n)))
    return found


def _evaluate(
    tr: Action, batches: list[Batch], points: list[tuple[Array, Array]]
) -> Iterator[tuple[Batch, tuple[Array, Array]]]:
    """Yield what `_sample` does for given q and v."""
    q, v = (_join(parts) for parts in zip(*points, strict=True))
    t = times(tr, batches)
    force, momentum, _ = tr.problem.system.pointwise("first")(q, v, t, tr.problem.packed)
    return _share_out(batches, _add_forces(tr, q, v, t, force), momentum)


def _add_forces(tr: Action, q: Array, v: Array, t: Array, force: Array) -> Array:
    """Return the forces dL/dq with those that are non-conservative."""
    if not tr.problem.system.structure.forced:
        return force
    Q = tr.problem.system.pointwise("force")(q, v, t, tr.problem.packed)[0]
    return force + np.pad(Q, ((0, 0), (0, force.shape[1] - Q.shape[1])))


def _share_out(
    batches: list[Batch], force: Array, momentum: Array
) -> Iterator[tuple[Batch, tuple[Array, Array]]]:
    """Yield the parts of forces and momenta at all points that belong to each batch."""
    first = 0
    for b in batches:
        shape = b.elements.size, b.rule.nodes.size, -1
        part = slice(first, first + shape[0] * shape[1])
        first = part.stop
        yield b, (force[part].reshape(shape), momentum[part].reshape(shape))


def _join(parts: Sequence[Array]) -> Array:
    return parts[0] if len(parts) == 1 else np.concatenate(parts)


def _group(tr: Action, batch: Batch) -> int:
    """Return which of the groups of elements a batch is of."""
    nodes = batch.nodes.shape[1]
    return next(k for k, g in enumerate(tr.layout.groups) if g.nodes.shape[1] == nodes)


def _work(tr: Action, batch: Batch, force: Array, momentum: Array) -> Array:
    """Return dS/dq (virtual work included) of the elements, (E, d + 1, n)."""
    if tr.order > 1:
        shape, rule, half = tr.layout.shapes[_group(tr, batch)], batch.rule, batch.half
        parts, found = [*np.split(force, tr.order, axis=2), momentum], 0.0
        for i, (basis, part) in enumerate(zip(shape.basis, parts, strict=True)):
            weighted = (rule.weights[:, None] * (rule.values @ basis)).T
            found = found + weighted @ part * half ** (1 - i)
        return found * shape.scale(batch.half.ravel())[:, :, None]
    constant = momentum[:, 0]  # its work is done at the element's ends alone
    work = batch.rule.weighted_slopes @ (momentum - momentum[:, :1])
    work += batch.half * (batch.rule.weighted_values @ force)
    work[:, 0] -= constant
    work[:, -1] += constant
    return work


def _omitted_detail(tr: Action, x: Array, batch: Batch, values: tuple[Array, Array]) -> Array:
    """Return what the polynomials through the nodes miss in each panel, (E, panels).

    That is the largest difference of forces there, and of momenta over the element's length.
    """
    times = batch.times
    if times.size > 1:
        times = tr.element_times(batch.elements, tr.mesh.nodes[batch.nodes])
    own = replace(batch, rule=batch.own, times=times)
    (_, known), *_ = list(_evaluate(tr, [own], _points(tr, x, [own])))
    between = batch.rule.values
    units = (tr.lengths, tr.lengths / (2 * batch.half))
    total = np.zeros(values[0].shape[:2])
    for there, here, unit in zip(values, known, units, strict=True):
        total += np.abs((there - between @ here) * unit).max(axis=2)
    return total.reshape(len(total), batch.panels, -1).max(axis=2)
