"""Steps of L, or of a force, that lie between two samples of a path: what they would change of it.

Between two steps L may have a wall or a well that no sample sees, and behind them it is as before:
no sum of forces and no balance of energy from sample to sample tells. The steps are found by their
arguments (`pulses.narrow_places`). Along a motion E = v . L_v - L is constant. The path that does
not see them has another kinetic energy there than the motion, T in place of T - dE, and needs the
time dt where the motion needs dt / sqrt(1 - dE / T). The motion is ahead by

    |v| |1 - 1 / sqrt(1 - dE / T)| dt,

and ends there if dE is more than T.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from actionopt.discrete.action import second_quadrature
from actionopt.discrete.between_nodes.energy_balance import ROUNDOFF, Imbalance
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.mechanics.laws.compiled import Pointwise
from actionopt.mechanics.laws.pulses import FOOT, StepArguments, narrow_places
from actionopt.mechanics.system import System
from actionopt.tools.types import Array

LADDER = 2.0  # ratio of neighbouring distances from a step at which L is read; ad hoc
RUNGS = 60  # as many as there are from any width to an interval of the samples


@np.errstate(all="ignore")
def unsampled_steps(at: DiscretePath) -> tuple[Imbalance, float] | None:
    """Return where L or Q has steps between samples, and how far they carry the path; else None.

    In its own size, as a free body; infinite where it cannot pass. What they change of L is told
    where it is most.
    """
    system = at.problem.system
    found = None
    if system.structure.hides:
        found = _find_steps(at, system.step_arguments, system.steps_along, _passage)
    if found is None and system.structure.pushes and system.pushes_along is not None:
        found = _find_steps(at, *system.pushes_along, _push)
    return found


def _find_steps(
    at: DiscretePath,
    arguments: StepArguments | None,
    known: Pointwise | None,
    passage: Callable[[DiscretePath, float, float, Array, Array], tuple[float, float]],
) -> tuple[Imbalance, float] | None:
    """Return what `unsampled_steps` does of the steps of one law, by what a `passage` changes."""
    tr, problem = at.tr, at.problem
    start, duration = np.array([problem.start.t]), np.array([problem.duration])
    paths = at.Q.T[:, :, None], at.mesh.nodes_since[:, None], duration, start, problem.packed
    if known is None or not may_have_unsampled(problem.system, arguments, *paths)[0]:
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
        off, moved = passage(at, a, z, middles[here], widths[here])
        carried += moved
        feet = np.concatenate(
            [middles[here] - FOOT * widths[here], middles[here] + FOOT * widths[here]]
        )
        found.append((max(feet.min(), a), min(feet.max(), z), off))
    low, high, off = np.array(found).T
    return Imbalance(low, high, off, np.zeros(off.size)), carried


def may_have_unsampled(
    system: System,
    arguments: StepArguments | None,
    q: Array,
    since: Array,
    duration: Array,
    start: Array,
    packed: Array,
) -> Array:
    """Return on which of C paths there may be steps between samples, (C,).

    By the arguments of the steps, q (n, K, C) at times (K, C) since the start, the duration and the
    start (C,) and the parameters (C, P).
    """
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
    since, q, v, t = _between(at, low, high, middles, widths)
    _, p, L = (y.copy() for y in problem.system.pointwise("first")(q, v, t, problem.packed))
    power, L = (p * v).sum(axis=1), L[:, 0]
    energy = power - L
    if not np.isfinite(energy).all():
        return 0.0, 0.0
    energy -= np.interp(since, since[[0, -1]], energy[[0, -1]])
    rounding = ROUNDOFF * (np.abs(power).max() + np.abs(L).max())
    energy = np.sign(energy) * np.maximum(np.abs(energy) - rounding, 0.0)
    twice, reach = _kinetic(at, low, high, v)
    left = 1 - 2 * energy / twice
    ahead = np.where(energy == 0, 0.0, np.abs(1 - 1 / np.sqrt(np.maximum(left, 0.0))))
    most = energy[np.argmax(np.abs(energy))]
    return float(most), float(np.trapezoid(ahead, since) * twice / reach)


def _push(
    at: DiscretePath, low: float, high: float, middles: Array, widths: Array
) -> tuple[float, float]:
    """Return the work of forces between two samples that neither shows, and how far it carries.

    The motion keeps that energy: it is ahead by |v| |1 - sqrt(1 - W / T)| for the duration at most.
    """
    problem = at.problem
    since, q, v, t = _between(at, low, high, middles, widths)
    force = problem.system.pointwise("force")(q, v, t, problem.packed)[0].copy()
    if not np.isfinite(force).all():
        return 0.0, 0.0
    for row in force.T:
        row -= np.interp(since, since[[0, -1]], row[[0, -1]])
    power = (force * v).sum(axis=1)
    work = float(np.trapezoid(power, since))
    work = np.sign(work) * max(
        abs(work) - ROUNDOFF * float(np.trapezoid(np.abs(power), since)), 0.0
    )
    twice, reach = _kinetic(at, low, high, v)
    ahead = abs(1 - np.sqrt(max(1 - 2 * abs(work) / twice, 0.0)))
    return float(work), float(ahead * problem.duration * twice / reach)


def _between(
    at: DiscretePath, low: float, high: float, middles: Array, widths: Array
) -> tuple[Array, Array, Array, Array]:
    """Return times (K,) between two samples, ever denser towards steps, and q, v, t there."""
    apart = widths * LADDER ** np.arange(RUNGS)[:, None]
    near = np.unique(
        np.concatenate([(middles - apart).ravel(), middles, (middles + apart).ravel()])
    )
    near = near[(near > low) & (near < high)]
    since = np.concatenate([[np.nextafter(low, high)], near, [np.nextafter(high, low)]])
    since = np.unique(np.concatenate([since, (since[1:] + since[:-1]) / 2]))
    q, v = (y.T for y in at.path.carried_on(since, 1.0))
    # Steps in t alone do no harm.
    return since, q, v, np.full((since.size, 1), at.problem.start.t + (low + high) / 2)


def _kinetic(at: DiscretePath, low: float, high: float, v: Array) -> tuple[float, float]:
    """Return twice the kinetic energy, where a path turns that nearby, and that in its own size."""
    mass = second_quadrature.inertia(at.tr, at.x)
    e = np.searchsorted(at.mesh.since, (low + high) / 2) - 1
    mv = v @ mass[0 if len(mass) == 1 else e]
    reach = (np.abs(mv) @ np.abs(at.tr.place(at.x).at).max(axis=0)).max()
    return (mv * v).sum(axis=1).max(), reach
