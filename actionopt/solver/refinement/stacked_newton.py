"""Newton's method on many paths of a family at once, and the measures of each.

Each is followed as `newton.follow` would. All are on one mesh, relative to their durations, and
near already. What `iterate` and `solve` ask of one path is asked here of arrays: what its mesh
leaves out, its round-off, what another quadrature finds, how far round-off in the matrix would move
it. A path that does not contract, or of which any of this raises doubt, is not judged here: `solve`
takes it alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from actionopt.discrete.meshes.resolution import left_out
from actionopt.discrete.newton.newton import CHORDS, CONTRACTION, ROUNDOFF_STEP
from actionopt.discrete.stacks import Factored, Samples, Stack, StackShape
from actionopt.mechanics.question.scales import MOTIONLESS, NEGLIGIBLE, SHORT_MOTION
from actionopt.solver.refinement.iterate import (
    ORDINARY,
    POLYNOMIAL_ROUNDOFF,
    SAFETY,
    SHORT_ELEMENT,
    TINY_ELEMENT,
    VELOCITY_ERROR,
    may_matter,
)
from actionopt.tools.median import median
from actionopt.tools.types import Array, NDInt

TOGETHER_STEPS = 4  # factorizations: a path that takes more was not near; ad hoc
STRAGGLERS = 0.05  # of a part, that are not worth calls of their own: they begin nearer next time


@dataclass(eq=False)
class FollowedStack:
    """The ends of Newton's method on C paths."""

    Q: Array  # (C, K, n): coordinates at the nodes
    # (C,): whether the steps contracted down to round-off, and sizes and velocities are known.
    converged: NDInt
    iterations: NDInt  # (C,)
    # moved, noise, omitted, missed, probed, drift (C,): distance from the first iterate; amplified
    # round-off; the largest coefficient left out; how far it would move if forces were summed over
    # other points; and if round-off were in the matrix; how far it is carried by what its energy
    # varies, nan where L may step. In units of each coordinate's own size.
    moved: Array
    noise: Array
    omitted: Array
    missed: Array
    probed: Array
    drift: Array
    action: Array  # (C,)
    momenta: Array  # (C, 2, n)

    @classmethod
    def nowhere(cls, Q: Array) -> FollowedStack:
        """Return the state before any step: paths Q (C, K, n), and no measures of them."""
        count, n = len(Q), Q.shape[2]
        none, moved = np.zeros(count, dtype=int), np.zeros(count)
        noise, omitted, missed, probed, drift, action = np.full((6, count), np.nan)
        measures = moved, noise, omitted, missed, probed, drift, action
        momenta = np.full((count, 2, n), np.nan)
        return cls(Q.copy(), none > 0, none.copy(), *measures, momenta)


def follow(
    shape: StackShape,
    times: Array,
    packed: Array,
    Q: Array,
    tol: float,
    *,
    measured: bool = True,
) -> FollowedStack:
    """Follow paths from coordinates Q (C, K, n); `times` (C, 2) and parameters `packed` (C, p).

    `tol` is to what their errors are to be known, if they are `measured`.
    """
    found = FollowedStack.nowhere(Q)
    with np.errstate(all="ignore"):
        for here in shape.parts(len(Q)):
            left = here
            for _ in range(TOGETHER_STEPS):
                left = _round(shape, times, packed, found, left, tol, measured)
                if left.size <= STRAGGLERS * here.size:
                    break
    return found


def _round(
    shape: StackShape,
    times: Array,
    packed: Array,
    found: FollowedStack,
    here: NDInt,
    tol: float,
    measured: bool,
) -> NDInt:
    """Take some members a factorization further; return those that are to go on."""
    count = here.size
    stack = Stack(shape, times[here], packed[here])
    Q = first = shape.local(found.Q[here])
    second = stack.second(Q)
    factored = Factored(shape, stack.coefficients(second))
    target = min(tol / (10 * SAFETY), ORDINARY * POLYNOMIAL_ROUNDOFF)

    def solve(part: Array) -> tuple[Array, Array]:
        """Return a step, and its length in the coordinates' sizes (C,)."""
        step = stack.step(factored.solve(stack.rows(part)))
        return step, _largest(step, sizes)

    sizes, _ = _sizes(Q)
    step, length = solve(stack.gradient(Q))
    going, near = np.ones((2, count), dtype=bool)
    near[:] = False
    converged, noise = near.copy(), np.full(count, np.nan)
    part = step
    for again in range(CHORDS + 2):
        Q = Q - np.where(going, step, 0.0)
        part = stack.gradient(Q)
        step, rest = solve(part)
        arrived = going & (near | (rest <= target))
        noise[arrived] = rest[arrived]
        converged |= arrived & np.isfinite(rest)
        ratio = rest / length
        near = (rest * ratio <= target) | ((ratio > CONTRACTION) & (rest < ROUNDOFF_STEP))
        going &= ~arrived & (near | (ratio <= CONTRACTION))
        soon = near | (rest * np.minimum(ratio, 1.0) ** (CHORDS - again) <= target)
        if not (going & soon).any():
            break
        length = rest
    Q = Q - np.where(going | converged, step, 0.0)  # round-off, or not small yet
    sizes, regular = _sizes(Q)
    converged &= regular & part.any(axis=(0, 1, 2))
    found.iterations[here] += 1
    found.Q[here] = shape.whole(Q)
    found.moved[here] += _largest(Q - first, sizes)
    found.converged[here[converged]] = True
    if measured and converged.any():
        ready = _Arrived(stack, factored, Q, part, second, sizes)
        missed, probed = ready.displacement(tol)
        missed = np.maximum(missed, stack.missed_action(Q, ready.samples))
        values = {
            "noise": noise,
            "action": stack.action(Q),
            "momenta": np.stack([-part[0, :, 0], part[-1, :, -1]]).transpose(2, 0, 1),
            "omitted": ready.largest_omitted.max(axis=0),
            "missed": missed,
            "probed": probed,
            "drift": stack.drift(Q, ready.samples, second),
        }
        for name, value in values.items():
            getattr(found, name)[here[converged]] = value[converged]
    return here[going & ~converged]


@dataclass(eq=False)
class _Arrived:
    """Paths at which Newton's method is, and what there is to ask of them."""

    stack: Stack
    factored: Factored
    Q: Array
    part: Array
    second: list[Array]
    sizes: Array

    @cached_property
    def samples(self) -> list[Samples]:
        """The states between the nodes."""
        return self.stack.samples(self.Q)

    @cached_property
    def largest_omitted(self) -> Array:
        """The largest coefficients that elements leave out, (E, C).

        Infinite where a velocity is not known, or the motion is small and far from zero.
        """
        stack, shape = self.stack, self.stack.shape
        extent = self.Q.max(axis=(0, 2)) - self.Q.min(axis=(0, 2))
        far = (extent < SHORT_MOTION * self.sizes) & (extent > MOTIONLESS * self.sizes)
        scaled = (self.Q / self.sizes[:, None]).transpose(2, 3, 0, 1)
        found, _ = left_out(shape.rule, scaled.reshape(-1, shape.P, shape.n))
        found = np.where(far.any(axis=0), np.inf, found.reshape(shape.E, -1))
        shortest = shape.mesh.lengths.min()
        if shortest > SHORT_ELEMENT:
            return found
        # As `Iterate.singular`: it runs through a singularity.
        k = shape.P
        speeds = np.abs(stack.velocities(self.Q)).max(axis=(0, 2))
        speeds = np.maximum(speeds, self.sizes / stack.duration)
        rates = (found * k * (k + 1) / (2 * stack.half)).max(axis=0)
        limit = VELOCITY_ERROR if shortest > TINY_ELEMENT else 1.0
        singular = rates * (self.sizes / speeds).max(axis=0) > limit
        return np.where(singular, np.inf, found)

    def displacement(self, tol: float) -> tuple[Array, Array]:
        """Return how far paths would move if forces were summed over other points, (C,).

        And if round-off were in every entry of the matrix.
        """
        stack, structure = self.stack, self.stack.shape.system.structure
        if structure.steady:  # there is nothing to miss
            step = stack.step(self.factored.solve(self._probe()))
            return np.zeros(len(stack.times)), _largest(step, self.sizes)
        followed = may_matter(structure, self.largest_omitted, tol).any(axis=1) & (
            not structure.linear
        )
        miss = stack.quadrature_defect(self.samples, self.part, self.second, followed)
        both = np.stack([stack.rows(miss), self._probe()], axis=1)
        both = self.factored.solve(both)
        found = [_largest(stack.step(both[:, k]), self.sizes) for k in (0, 1)]
        if structure.samples and not structure.linear:
            found[0] = np.maximum(found[0], self._drift(miss, tol))
        return found[0], found[1]

    def _drift(self, miss: Array, tol: float) -> Array:
        """Return how far what is missed carries what nothing holds, (C,)."""
        stack, shape = self.stack, self.stack.shape
        # As in `second_quadrature.quadrature_defect` and `iterate.unseen`: what a free body would
        # drift, at the least inertia on the way to begin with.
        inertia = self._diagonal(2)
        momenta = np.abs(np.cumsum(miss.sum(axis=0), axis=1)).max(axis=1) * shape.units[:, None]
        momenta *= stack.duration / shape.action_unit * (shape.units[:, None] / self.sizes)
        carried = momenta.max(axis=0) / inertia.min(axis=(0, 1, 2))
        if not (SAFETY * carried > tol).any():
            return carried
        known = np.where(np.isfinite(inertia) & (inertia > 0), inertia, np.nan)
        unit = np.nanmedian(known, axis=(0, 1, 2))
        carried = momenta.max(axis=0) / np.where(np.isfinite(unit), unit, 1.0)
        square = (self._diagonal(0) / inertia).swapaxes(1, 2)  # (P, E, n, C)
        weights = np.outer(shape.rule.weights, shape.mesh.lengths)
        square = median(square.reshape(-1, *square.shape[2:]), weights.ravel())
        turns = stack.duration * np.sqrt(np.where(np.isfinite(square), square, 0.0).max(axis=0))
        return np.where(SAFETY * carried > tol, carried / (1.0 + turns), carried)

    def _diagonal(self, k: int) -> Array:
        """Return the magnitudes on the diagonal of L_qq (0) or L_vv (2), (P, n, E, C)."""
        rows, cols = self.stack.shape.system.pointwise("second").sparsity(k)
        found = np.zeros_like(self.Q)
        own = rows == cols
        found[:, rows[own]] = np.abs(self.second[k][:, own])
        return found

    def _probe(self) -> Array:
        """Return a right-hand side as round-off in every entry makes it, (places, E, C)."""
        shape = self.stack.shape
        # As `Layout.probe`: as smooth as the lowest modes are, of no symmetry.
        node = shape.mesh.offsets[:-1] + np.arange(shape.P)[:, None]
        probe = np.sin(1.0 + np.arange(shape.n))[:, None] * np.exp(
            2 * node[:, None] / (shape.mesh.offsets[-1] + 1)
        )  # (P, n, E)
        probe[-1, :, : None if shape.closed else -1] = 0.0  # nodes between elements once
        size = POLYNOMIAL_ROUNDOFF * self.factored.largest
        return probe.reshape(shape.places, shape.E)[shape.ordered, :, None] * size


def _sizes(Q: Array) -> tuple[Array, Array]:
    """Return the largest |q| of each coordinate along paths (P, n, E, C), (n, C), as `sizes`.

    And for which paths these can be relied on, (C,): some coordinate is not zero, and none is so up
    to round-off only.
    """
    size = np.abs(Q).max(axis=(0, 2))
    largest = size.max(axis=0)
    zero = size <= NEGLIGIBLE * largest
    regular = (largest > 0) & ~(zero & (size > 0)).any(axis=0)
    return np.where(zero, largest, size), regular


def _largest(step: Array, sizes: Array) -> Array:
    """Return the largest change (C,) of coordinates by a step (P, n, E, C), in their sizes."""
    return (np.abs(step).max(axis=(0, 2)) / sizes).max(axis=0)
