"""Steps of L that lie between two samples of a path: what they would change of it.

Between two steps L may have a wall or a well that no sample sees, and behind them it is as before:
no sum of forces and no balance of energy from sample to sample tells. The steps are found by their
arguments (`pulses.narrow_places`). Along a motion E = v . L_v - L is constant. The path that does
not see them has another kinetic energy there than the motion, T in place of T - dE, and needs the
time dt where the motion needs dt / sqrt(1 - dE / T). The motion is ahead by

    |v| |1 - 1 / sqrt(1 - dE / T)| dt,

and ends there if dE is more than T.
"""

from __future__ import annotations

import numpy as np

from actionopt.discrete import second_quadrature
from actionopt.discrete.discrete_path import DiscretePath
from actionopt.discrete.energy_balance import ROUNDOFF, Imbalance
from actionopt.mechanics.pulses import FOOT, narrow_places
from actionopt.mechanics.system import System
from actionopt.tools.types import Array

LADDER = 2.0  # ratio of neighbouring distances from a step at which L is read; ad hoc
RUNGS = 60  # as many as there are from any width to an interval of the samples


@np.errstate(all="ignore")
def unsampled_steps(at: DiscretePath) -> tuple[Imbalance, float] | None:
    """Return where L has steps between samples, and how far they carry the path; None if nowhere.

    In its own size, as a free body; infinite where it cannot pass. What they change of L is told
    where it is most.
    """
    tr, problem = at.tr, at.problem
    system = problem.system
    if not system.structure.hides:
        return None
    start, duration = np.array([problem.start.t]), np.array([problem.duration])
    paths = at.Q.T[:, :, None], at.mesh.nodes_since[:, None], duration, start, problem.packed
    if not may_have_unsampled(system, *paths)[0]:
        return None
    known = system.steps_along
    if known is None:
        return None
    q, v, *_ = second_quadrature.values(tr, at.x, tr.between_nodes)
    t = second_quadrature.times(tr, tr.between_nodes)
    slope = known(q, v, t, problem.packed)[0]
    if not (slope < 0).any() or not (slope > 0).any():
        return None
    since = _sample_times(at)
    order = slice(None) if len(tr.between_nodes) == 1 else np.argsort(since)

    def slopes(since: Array) -> Array:
        q, v = at.path.carried_on(np.clip(since, 0.0, problem.duration), 1.0)
        return known(q.T, v.T, (problem.start.t + since)[:, None], problem.packed)[0]

    since = since[order]
    middles, widths, which = narrow_places(slopes, since, slope[order], np.diff(since).max())
    if not middles.size:
        return None
    b, found, carried = at.mesh.since, [], 0.0
    e = np.clip(np.searchsorted(b, middles, side="right") - 1, 0, at.mesh.elements - 1)
    low, high = np.maximum(since[which], b[e]), np.minimum(since[which + 1], b[e + 1])
    for a, z in np.unique(np.stack([low, high]), axis=1).T.tolist():
        here = (low == a) & (high == z)
        off, moved = _passage(at, a, z, middles[here], widths[here])
        carried += moved
        feet = np.concatenate(
            [middles[here] - FOOT * widths[here], middles[here] + FOOT * widths[here]]
        )
        found.append((max(feet.min(), a), min(feet.max(), z), off))
    low, high, off = np.array(found).T
    return Imbalance(low, high, off, np.zeros(off.size)), carried


def may_have_unsampled(
    system: System, q: Array, since: Array, duration: Array, start: Array, packed: Array
) -> Array:
    """Return on which of C paths there may be steps between samples, (C,).

    By q (n, K, C) at times (K, C) since the start, the duration and the start (C,) and the
    parameters (C, P).
    """
    arguments = system.step_arguments
    if arguments is None:
        return np.zeros(len(start), dtype=bool)
    known = q, np.empty(0), (start + since)[None], packed.T[:, None]
    return arguments.may_be_narrow(known, since, duration / system.structure.samples)


def _sample_times(at: DiscretePath) -> Array:
    """Return the times of the samples since the start, (points,), batch by batch."""
    parts = [
        (at.mesh.since[b.elements, None] + b.half[:, 0] * (1 + b.rule.nodes)).ravel()
        for b in at.tr.between_nodes
    ]
    return parts[0] if len(parts) == 1 else np.concatenate(parts)


def _passage(
    at: DiscretePath, low: float, high: float, middles: Array, widths: Array
) -> tuple[float, float]:
    """Return what L changes by between two samples, and how far that carries the path."""
    problem = at.problem
    apart = widths * LADDER ** np.arange(RUNGS)[:, None]
    near = np.unique(
        np.concatenate([(middles - apart).ravel(), middles, (middles + apart).ravel()])
    )
    near = near[(near > low) & (near < high)]
    since = np.concatenate([[np.nextafter(low, high)], near, [np.nextafter(high, low)]])
    since = np.unique(np.concatenate([since, (since[1:] + since[:-1]) / 2]))
    q, v = (y.T for y in at.path.carried_on(since, 1.0))
    t = np.full((since.size, 1), problem.start.t + (low + high) / 2)  # steps in t alone do no harm
    _, p, L = (y.copy() for y in problem.system.pointwise("first")(q, v, t, problem.packed))
    power, L = (p * v).sum(axis=1), L[:, 0]
    energy = power - L
    if not np.isfinite(energy).all():
        return 0.0, 0.0
    energy -= np.interp(since, since[[0, -1]], energy[[0, -1]])
    rounding = ROUNDOFF * (np.abs(power).max() + np.abs(L).max())
    energy = np.sign(energy) * np.maximum(np.abs(energy) - rounding, 0.0)
    mass = second_quadrature.inertia(at.tr, at.x)
    e = np.searchsorted(at.mesh.since, (low + high) / 2) - 1
    mv = v @ mass[0 if len(mass) == 1 else e]
    twice = (mv * v).sum(axis=1).max()  # the kinetic energy, where the path turns that nearby
    reach = (np.abs(mv) @ np.abs(at.tr.place(at.x).at).max(axis=0)).max()
    left = 1 - 2 * energy / twice
    ahead = np.where(energy == 0, 0.0, np.abs(1 - 1 / np.sqrt(np.maximum(left, 0.0))))
    most = energy[np.argmax(np.abs(energy))]
    return float(most), float(np.trapezoid(ahead, since) * twice / reach)
