"""Times at which contact with an obstacle begins and ends: how the path meets it, and their moves.

A path of least action meets an obstacle tangentially, df/dt = f_q . v + f_t = 0 on the free side of
each of them.
"""

from __future__ import annotations

import numpy as np

from actionopt.discrete.discrete_path import DiscretePath
from actionopt.discrete.factors import Factors
from actionopt.discrete.transcription import Transcription
from actionopt.mechanics.held import Held
from actionopt.mechanics.obstacle import Arc
from actionopt.tools.types import Array

TANGENTIAL = 1e-15  # of a typical rate of f: a rate that is zero; ad hoc
# For derivatives by a time of contact: of the part that shrinks, but of the duration at least so
# much, far above its round-off, and of the part at most. Ad hoc.
DIFFERENCE, LEAST_DIFFERENCE, MOST_DIFFERENCE = 1e-6, 1e-11, 1e-2
VELOCITY_STEPS = 4  # of Newton's method from the polynomial's velocity: it converges in two


def stretched(tr: Transcription, times: Array, moves: Array) -> Transcription:
    """Return the discrete problem whose times of contact (J,) move, and the elements with them."""
    held = tr.problem
    assert isinstance(held, Held) and held.arcs is not None
    after = dict(zip(times.tolist(), (times + moves).tolist(), strict=True))
    moved = held.holding(
        tuple(
            Arc(arc.row, after.get(arc.begin, arc.begin), after.get(arc.end, arc.end))
            for arc in held.arcs
        )
    )
    before, now = (np.union1d(held.fixed, t) - held.start.t for t in (times, times + moves))
    before[-1] = now[-1] = held.duration
    mesh = tr.mesh.cut(np.interp(tr.mesh.since, before, now), tr.mesh.degrees)
    return Transcription(moved, mesh, tr.lengths, like=tr)


def tangential(
    at: DiscretePath, times: Array, force: Array | float = 0.0
) -> tuple[Array, Array] | None:
    """Return Newton's step (J,) for the times of contact and that of z (size,), with it.

    Both at once: between given times of contact a path that is stationary meets the obstacle at an
    angle whose square the times determine, and may not exist at all. None if there is no step.
    A `force` (size,) is what its residual is to be in place of zero.
    """
    held = at.problem
    assert isinstance(held, Held)
    slip, residual, duration = slips(at), at.tr.residual(at.z), held.duration
    knots, order = np.union1d(held.fixed, times), np.arange(times.size)
    where = np.searchsorted(held.fixed, times)  # between which of these they are
    moves, slopes = np.empty((at.z.size, times.size)), np.empty((slip.size, times.size))
    shifted = np.zeros((times.size, times.size))
    try:
        factors = Factors(at.tr.layout, at.tr.kkt(at.z), many=True)
        step = factors.solve(force - residual)
        for j in range(times.size):
            # All times from here on move, so that a short part behind them keeps its length.
            shifted[:, j] = (where == where[j]) & (order >= j)
            last = times[where == where[j]][-1]
            part = float(times[j] - knots[np.searchsorted(knots, times[j]) - 1])
            part = min(part, float(held.fixed[where[j]] - last))
            delta = min(max(DIFFERENCE * part, LEAST_DIFFERENCE * duration), MOST_DIFFERENCE * part)
            tr = stretched(at.tr, times, delta * shifted[:, j])
            move = -factors.solve(tr.residual(at.z) - residual)
            slopes[:, j] = (slips(DiscretePath(tr, at.z + move)) - slip) / delta
            moves[:, j] = move / delta
        slip = slips(DiscretePath(at.tr, at.z + step))
        if np.abs(slip).max() <= TANGENTIAL * float(at.tr.row_units.max()) / duration:
            return np.zeros(times.size), step  # whatever the times are, where nothing presses
        parts = -np.linalg.lstsq(slopes, slip, rcond=None)[0]
    except np.linalg.LinAlgError:
        return None
    return shifted @ parts, step + moves @ parts


def without(held: Held, a: float, b: float) -> tuple[Arc, ...]:
    """Return the parts in contact when what is between two times of contact has vanished."""
    both = a if a in held.fixed else b if b in held.fixed else (a + b) / 2
    found: list[Arc] = []
    for arc in sorted(held.arcs or (), key=lambda arc: (arc.row, arc.begin)):
        begin, end = (both if t in (a, b) else t for t in (arc.begin, arc.end))
        if begin == end and begin not in held.fixed:
            continue
        if found and found[-1].row == arc.row and begin <= found[-1].end:
            begin = found.pop().begin
        found.append(Arc(arc.row, begin, end))
    return tuple(found)


def slips(at: DiscretePath) -> Array:
    """Return df/dt where contact begins and ends, on the free side: zero at tangential joints."""
    held, mesh = at.problem, at.mesh
    assert isinstance(held, Held) and held.arcs is not None
    jacobian, rate = (held.system.pointwise(f"constraint_{x}") for x in ("jacobian", "rate"))
    found = []
    for arc in held.arcs:
        for t, first in ((arc.begin, False), (arc.end, True)):
            if t in held.fixed:
                continue
            b = int(np.argmin(np.abs(mesh.boundaries - t)))
            state = at.Q[None, mesh.offsets[b]], mesh.boundaries[b, None, None], held.packed
            G = jacobian.full(0, jacobian(*state)[0])[0]
            v = _free_velocity(at, b if first else b - 1, first, G, rate(*state)[0][0])
            i = held.free.system.m + arc.row
            found.append(G[i] @ v + rate(*state)[0][0, i])
    return np.array(found)


def _free_velocity(at: DiscretePath, element: int, first: bool, G: Array, rate: Array) -> Array:
    """Return the velocity (n,) at the first or the last node of an element, by its momentum.

    It satisfies the constraints in force there, of the gradients G (m + r, n) and the `rate`
    (m + r,) of all. Newton's method from the polynomial's: one step where L is quadratic in v.
    """
    held, tr = at.problem, at.tr
    assert isinstance(held, Held)
    n, mesh = held.system.n, at.mesh
    for g, work in zip(tr.layout.groups, tr.work(at.x), strict=True):
        e = np.flatnonzero(g.elements == element)
        if e.size:
            k = 0 if first else g.rule.degree
            p = work[e[0], k] * (-1.0 if first else 1.0)
            i = g.span.start + int(e[0]) * (g.rule.degree + 1) + k
            break
    else:
        raise AssertionError("an element of no degree")
    point = tr.place(at.x)
    q, v, t = point.at[i : i + 1], point.v[i].copy(), tr.times[i : i + 1]
    middle = (mesh.boundaries[element] + mesh.boundaries[element + 1]) / 2
    rows = held.active(np.array([middle]))[:, 0]
    G, rate = G[rows], rate[rows]
    first_of, second = (held.system.pointwise(x) for x in ("first", "second"))
    K = np.zeros((n + len(G), n + len(G)))
    K[n:, :n], K[:n, n:] = G, -G.T
    for _ in range(1 if held.system.structure.constant_mass else VELOCITY_STEPS):
        K[:n, :n] = second.full(2, second(q, v[None], t, held.packed)[2], symmetric=True)[0]
        short = p - first_of(q, v[None], t, held.packed)[1][0]
        v = v + np.linalg.solve(K, np.concatenate([short, -rate - G @ v]))[:n]
    return v
