"""Motions across steep steps of L, such as tanh(x / w) with a w that no first mesh shows.

A motion meets such a step in a moment, and leaves it with another velocity, as light is refracted.
Where it ends depends smoothly on how it set out, however steep the step is: so the path is found by
shooting, in steps so short that each keeps the energy, as longer ones would pass unseen. A path on
elements as short as these is polished by Newton's method at once; on uniform meshes it is lost.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from actionopt.analysis.quadratic.shooting import (
    energies,
    flights,
    integrate,
    newton,
    velocities,
)
from actionopt.discrete.between_nodes.crossing import jump_or
from actionopt.discrete.between_nodes.energy_balance import Balance, Imbalance
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.mechanics.question.problem import Problem
from actionopt.tools.immutable import immutable
from actionopt.tools.types import Array, NDInt
from actionopt.tools.watch import Watch

# Of a step: the time it takes a curve to cross it, in the duration, and the energy, in what that is
# made of.
STEEP_TIME, STEEP_ENERGY = 1e-3, 1e-3
# Velocities for each coordinate, and how many are aimed: those of motions nearest to the end.
SHOTS, AIMED_SHOTS = 24, 6
STEPS_IN_ELEMENT = 1  # measured: with two or three, Newton's method loses high steps of 1e-6
ONE_MOTION = 1e-2  # of the fastest, velocities of one motion


@immutable
class _Accuracy:
    """How accurately motions are made, and aimed. Ad hoc.

    The end is to be known more finely than what it changes by when a velocity is `nudged`.
    """

    step: float
    kept: float  # of the energy, in one step
    nudged: float  # in parts of the velocity, for the derivative
    near: float  # to the end, in the coordinates' sizes
    aims: int  # measured: what has not come near by then does not


COARSE_SHOTS = _Accuracy(1e-5, 1e-3, 1e-3, 5e-2, 6)
FINE_SHOTS = _Accuracy(1e-8, 1e-7, 1e-5, 1e-7, 8)


def shows_step(at: DiscretePath, tol: float) -> bool:
    """Return whether L steps steeply, and does not jump, between the samples of a curve."""
    problem, off = at.problem, Balance.of(at).beyond(tol)
    found = jump_or(at, off)
    if off is None or not isinstance(found, Imbalance):
        return False
    t = at.mesh.nodes
    size = np.max(energies(problem, at.path(t), at.path.velocity(t))[1])
    brief = (found.high - found.low < STEEP_TIME * problem.duration).any()
    return bool(brief and np.abs(off.off).max() > STEEP_ENERGY * size)


def crossings(problem: Problem, watch: Watch | None) -> Iterator[Path]:
    """Yield motions from the start that arrive at the end, as paths, slow ones first.

    Both events give all coordinates, and there is nothing else that the path must obey.
    """
    end = np.array(problem.end.q, dtype=float)
    far = end - np.array(problem.start.q, dtype=float)
    n = far.size
    try:
        v = velocities(problem, far, SHOTS * n, np.random.default_rng(0))
    except np.linalg.LinAlgError:  # a singular mass matrix sets nothing in motion
        return
    missed = np.linalg.norm(_gap(problem, v[:, None], COARSE_SHOTS, watch)[:, 0], axis=0)
    nearest = np.argsort(missed, kind="stable")[:AIMED_SHOTS]  # what is lost comes last
    v = v[:, nearest]
    for accuracy in (COARSE_SHOTS, FINE_SHOTS):
        v = _distinct(_aim(problem, v, accuracy, watch))
        if not v.size:
            return
    q0 = np.repeat(np.array(problem.start.q, dtype=float)[:, None], v.shape[1], axis=1)
    spans = (problem.duration,)
    (found,) = flights(problem, q0, v, spans, accuracy=FINE_SHOTS.step, kept=FINE_SHOTS.kept)
    t0, t1 = problem.start.t, problem.end.t
    yield from (each.path(t0, t1, STEPS_IN_ELEMENT) for each in found if each.times[-1] == t1)


def _aim(problem: Problem, v: Array, accuracy: _Accuracy, watch: Watch | None) -> Array:
    """Return velocities v (n, K) changed until the motions end at the end, of those that do."""

    def gap(v: Array, which: NDInt) -> Array:
        return _gap(problem, v, accuracy, watch)

    return newton(v, np.eye(len(v)), gap, accuracy.nudged, accuracy.near, accuracy.aims)[0]


def _gap(problem: Problem, v: Array, accuracy: _Accuracy, watch: Watch | None) -> Array:
    """Return by how much motions with velocities v (n, G, K) miss the end, in sizes, alike."""
    start, end = (np.array(e.q, dtype=float)[:, None, None] for e in (problem.start, problem.end))
    times, span = np.full(v.shape[2], problem.start.t), np.full(v.shape[2], problem.duration)
    look = watch and (lambda _: watch.check())  # it is no search that has a price
    begin, rough = (times, np.broadcast_to(start, v.shape), v), accuracy.step
    q, _ = integrate(
        problem, begin, span, accuracy=rough, kept=accuracy.kept, watch=look, patient=True
    )
    return (q - end) / np.maximum(problem.lengths[:, None, None], np.abs(end - start))


def _distinct(v: Array) -> Array:
    """Return velocities (n, K) without those that are like others, slow ones first."""
    if not v.size:
        return v
    v = v[:, np.argsort(np.linalg.norm(v, axis=0), kind="stable")]
    apart = np.linalg.norm(v[:, :, None] - v[:, None], axis=0)
    alike = np.tril(apart < ONE_MOTION * np.linalg.norm(v, axis=0).max(), -1).any(axis=1)
    return v[:, ~alike]
