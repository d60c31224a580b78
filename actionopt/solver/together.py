"""Follow many paths of a family at once, each as `newton.follow` would, and measure each.

All are on one mesh, relative to their durations, and near already. What `iterate` and `solve` ask
of one path is asked here of arrays: what its mesh leaves out, its round-off, what another
quadrature finds, how far round-off in the matrix would move it. A path that does not contract, or
of which any of this raises doubt, is not judged here: `solve` takes it alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from actionopt.analysis.index import ERROR_GAIN, INDEX_RESOLUTION, INDEX_TOLERANCE, LOOSEST
from actionopt.analysis.jacobi import COEFFICIENT_NOISE, COEFFICIENT_SAMPLES
from actionopt.analysis.second_variation import RANK
from actionopt.discrete.mesh import MAX_DEGREE
from actionopt.discrete.newton import CHORDS, CONTRACTION, ROUNDOFF_STEP
from actionopt.discrete.resolution import left_out
from actionopt.discrete.stacks import Factored, Shape, Stack, pivots
from actionopt.mechanics.problem import NEGLIGIBLE
from actionopt.solver.iterate import (
    ORDINARY,
    POLYNOMIAL_ROUNDOFF,
    SAFETY,
    SHORT_ELEMENT,
    TINY_ELEMENT,
    VELOCITY_ERROR,
)
from actionopt.tools.lobatto import lgl
from actionopt.tools.types import Array, NDInt

STEPS = 4  # factorizations: a path that takes more was not near; ad hoc
# Numbers in the matrices, and in what is evaluated at once, that stay in a processor's cache;
# measured: half or twice as many take a tenth longer at the most.
MATRICES, VALUES = 2**20, 2**20
MOST, LEAST = 256, 8  # members followed together


@dataclass(eq=False)
class Followed:
    """Where C paths arrived.

    Attributes
    ----------
    Q : (C, K, n) array
        Coordinates at the nodes.
    converged : (C,) array of bool
        Whether the steps contracted down to round-off, and sizes and velocities are known.
    iterations : (C,) array of int
    moved, noise, omitted, missed, probed : (C,) arrays
        Distance from the first iterate; amplified round-off; the largest coefficient left out;
        how far it would move if forces were summed over other points; and if round-off were in
        the matrix. In units of each coordinate's own size.
    action : (C,) array
    momenta : (C, 2, n) array
    index : (C,) array of int
        -1 where it was not counted.
    """

    Q: Array
    converged: NDInt
    iterations: NDInt
    moved: Array
    noise: Array
    omitted: Array
    missed: Array
    probed: Array
    action: Array
    momenta: Array
    index: NDInt

    @classmethod
    def nowhere(cls, Q: Array) -> Followed:
        """Return what is known before anything was done."""
        count, n = len(Q), Q.shape[2]
        none, moved = np.zeros(count, dtype=int), np.zeros(count)
        noise, omitted, missed, probed, action = np.full((5, count), np.nan)
        measures = moved, noise, omitted, missed, probed, action
        momenta = np.full((count, 2, n), np.nan)
        return cls(Q.copy(), none > 0, none.copy(), *measures, momenta, none - 1)


def follow(
    shape: Shape, times: Array, packed: Array, Q: Array, tol: float, *, index: bool = False
) -> Followed:
    """Follow paths from coordinates Q (C, K, n); `times` (C, 2) and parameters `packed` (C, p).

    `tol` is to what their errors are to be known; with `index`, it is counted.
    """
    numbers = shape.E * shape.places**2, shape.points * 8 * shape.n
    together = int(min(MATRICES / numbers[0], VALUES / numbers[1], MOST))
    together = max(1 << together.bit_length() - 1 if together else 0, LEAST)
    found = Followed.nowhere(Q)
    with np.errstate(all="ignore"):
        for first in range(0, len(Q), together):
            here = np.arange(first, min(first + together, len(Q)))
            for _ in range(STEPS):
                here = _round(shape, times, packed, found, here, tol, index)
                if not here.size:
                    break
    return found


def _round(
    shape: Shape, times: Array, packed: Array, found: Followed, here: NDInt, tol: float, index: bool
) -> NDInt:
    """Take some members a factorization further; return those that are to go on."""
    count = here.size
    # Few numbers of members, so that memory serves again; those that are too many are copies.
    rows = np.append(here, np.repeat(here[-1:], (1 << (count - 1).bit_length()) - count))
    stack = Stack(shape, times[rows], packed[rows])
    Q = first = shape.local(found.Q[rows])
    second = stack.second(Q)
    factored = Factored(shape, stack.matrices(second))
    target = min(tol / (10 * SAFETY), ORDINARY * POLYNOMIAL_ROUNDOFF)

    def solved(part: Array) -> tuple[Array, Array]:
        """Return a step, and its length in the coordinates' sizes (C,)."""
        step = stack.step(factored.solve(stack.rows(part)))
        return step, _largest(step, sizes)

    sizes, _ = _sizes(Q)
    step, length = solved(stack.first(Q)[1])
    going, near = np.ones((2, rows.size), dtype=bool)
    near[:] = False
    converged, noise = near.copy(), np.full(rows.size, np.nan)
    S, part = np.full(rows.size, np.nan), step
    for again in range(CHORDS + 2):
        Q = Q - np.where(going, step, 0.0)
        S, part = stack.first(Q)
        step, rest = solved(part)
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
    converged &= regular & np.isfinite(S) & part.any(axis=(0, 1, 2))
    found.iterations[here] += 1
    found.Q[here] = shape.whole(Q)[:count]
    found.moved[here] += _largest(Q - first, sizes)[:count]
    if converged[:count].any():
        ready = _Arrived(stack, factored, Q, part, second, sizes)
        steady = shape.system.structure.steady
        values = {
            "noise": noise,
            "action": S,
            "momenta": np.stack([-part[0, :, 0], part[-1, :, -1]]).transpose(2, 0, 1),
            "omitted": ready.omitted(),
            "missed": np.zeros(rows.size) if steady else ready.missed(tol),
            "probed": ready.probed(),
        }
        if index:
            values["index"] = ready.index(tol)
        done = converged[:count]
        found.converged[here[done]] = True
        for name, value in values.items():
            getattr(found, name)[here[done]] = value[:count][done]
    return here[(going & ~converged)[:count]]


@dataclass(eq=False)
class _Arrived:
    """Paths at which Newton's method is, and what there is to ask of them."""

    stack: Stack
    factored: Factored
    Q: Array
    part: Array
    second: list[Array]
    sizes: Array

    def omitted(self) -> Array:
        """Return the largest coefficient left out, (C,); infinite where a velocity is not known."""
        stack, shape = self.stack, self.stack.shape
        scaled = (self.Q / self.sizes[:, None]).transpose(2, 3, 0, 1)
        found, _ = left_out(shape.rule, scaled.reshape(-1, shape.P, shape.n))
        found = found.reshape(shape.E, -1)
        shortest = shape.mesh.lengths.min()
        if shortest > SHORT_ELEMENT:
            return found.max(axis=0)
        # As `Iterate.singular`: it runs through a singularity.
        k = shape.P
        speeds = np.abs(stack.velocities(self.Q)).max(axis=(0, 2))
        speeds = np.maximum(speeds, self.sizes / stack.duration)
        rates = (found * k * (k + 1) / (2 * stack.half)).max(axis=0)
        limit = VELOCITY_ERROR if shortest > TINY_ELEMENT else 1.0
        singular = rates * (self.sizes / speeds).max(axis=0) > limit
        return np.where(singular, np.inf, found.max(axis=0))

    def missed(self, tol: float) -> Array:
        """Return how far paths would move if forces were summed over other points, (C,)."""
        stack, shape, structure = self.stack, self.stack.shape, self.stack.shape.system.structure
        miss = stack.missed(self.Q, self.part)
        moved = _largest(stack.step(self.factored.solve(stack.rows(miss))), self.sizes)
        if not structure.samples or structure.linear:
            return moved
        # As in `second_quadrature.missed` and `iterate.unseen`: what a free body would drift, at
        # the least inertia on the way to begin with.
        inertia = self._diagonal(2)
        momenta = np.abs(np.cumsum(miss.sum(axis=0), axis=1)).max(axis=1) * shape.units[:, None]
        momenta *= stack.duration / shape.action_unit * (shape.units[:, None] / self.sizes)
        carried = momenta.max(axis=0) / inertia.min(axis=(0, 1, 2))
        if not (SAFETY * carried > tol).any():
            return np.maximum(moved, carried)
        known = np.where(np.isfinite(inertia) & (inertia > 0), inertia, np.nan)
        unit = np.nanmedian(known, axis=(0, 1, 2))
        carried = momenta.max(axis=0) / np.where(np.isfinite(unit), unit, 1.0)
        square = np.median(self._diagonal(0) / inertia, axis=(0, 2))  # (n, C)
        turns = stack.duration * np.sqrt(np.where(np.isfinite(square), square, 0.0).max(axis=0))
        carried = np.where(SAFETY * carried > tol, carried / (1.0 + turns), carried)
        return np.maximum(moved, carried)

    def _diagonal(self, k: int) -> Array:
        """Return the magnitudes on the diagonal of L_qq (0) or L_vv (2), (P, n, E, C)."""
        rows, cols = self.stack.shape.system.pointwise("second").sparsity(k)
        found = np.zeros_like(self.Q)
        own = rows == cols
        found[:, rows[own]] = np.abs(self.second[k][:, own])
        return found

    def probed(self) -> Array:
        """Return how far round-off in every entry of the matrix may move the paths, (C,)."""
        shape = self.stack.shape
        # As `Layout.probe`: as smooth as the lowest modes are, of no symmetry.
        node = shape.mesh.offsets[:-1] + np.arange(shape.P)[:, None]
        probe = np.cos(1.0 + np.arange(shape.n))[:, None] * np.exp(
            2 * node[:, None] / (shape.mesh.offsets[-1] + 1)
        )  # (P, n, E)
        probe[-1, :, :-1] = 0.0  # nodes between elements once
        size = POLYNOMIAL_ROUNDOFF * self.factored.largest
        right = (probe[shape.order].reshape(shape.places, shape.E)[:, :, None]) * size
        return _largest(self.stack.step(self.factored.solve(right)), self.sizes)

    def index(self, tol: float) -> Array:
        """Return the numbers of negative eigenvalues, (C,); -1 where they are not to be trusted.

        As `index.inertia_of`: where two counts agree, on a mesh that resolves all solutions of the
        linearised equations on its elements, and what these are made of (`jacobi.finer`).
        """
        stack, shape = self.stack, self.stack.shape
        second, C = stack.second(self.Q), len(stack.times)
        tolerance = np.full(C, np.clip(ERROR_GAIN * tol, INDEX_TOLERANCE, LOOSEST))
        counts = []
        for shift in (-tolerance, tolerance):
            self.factored = Factored(shape, stack.matrices(second, shift))
            counts.append(self.factored.negative)
        fields = self.factored.responses().reshape(shape.P, -1)[shape.back]
        fields = np.abs(shape.rule.to_legendre @ fields).reshape(shape.P, -1, shape.E, C)
        size = np.abs(fields).max(axis=(0, 1))
        resolved = (fields[-2:].max(axis=(0, 1)) <= INDEX_RESOLUTION * size).all(axis=0)
        # The coefficients of d2S, at more points: at the nodes alone what varies faster is smooth.
        degree = shape.P - 1
        fine = lgl(min(max(2 * degree + 2, -(-COEFFICIENT_SAMPLES // shape.E)), 2 * MAX_DEGREE + 2))
        points = fine.degree + 1
        sampled = stack.second(self.Q, fine.nodes)
        rows, cols = shape.system.pointwise("second").sparsity(2)
        own = rows == cols
        mass = np.zeros((shape.n, shape.E, C))
        mass[rows[own]] = np.abs(sampled[2][:, own]).max(axis=0)
        mass = np.sqrt(np.maximum(mass, COEFFICIENT_NOISE * mass.max(axis=0)))
        for k, power in ((0, 2), (1, 1), (2, 0)):
            i, j = shape.system.pointwise("second").sparsity(k)
            for a, b, x in zip(i, j, sampled[k].swapaxes(0, 1), strict=True):
                unit = mass[a] * mass[b] / (2 * stack.half) ** power
                tail = np.abs(fine.to_legendre[degree - 1 :] @ x.reshape(points, -1)).max(axis=0)
                noise = COEFFICIENT_NOISE * np.abs(x).max(axis=0)
                tail = tail.reshape(shape.E, C)
                resolved &= ((tail <= noise) | (tail <= INDEX_RESOLUTION * unit)).all(axis=0)
        least = pivots(shape.n, rows, cols, second[2])  # Legendre's condition
        convex = (least > RANK * np.abs(second[2][:, own]).max(axis=1)).all(axis=(0, 1))
        return np.where(resolved & convex & (counts[0] == counts[1]), counts[0], -1)


def _sizes(Q: Array) -> tuple[Array, Array]:
    """Return the largest |q| of each coordinate along paths (P, n, E, C), (n, C), as `sizes`.

    And where these are what they seem, (C,): neither no path at all nor one up to rounding.
    """
    size = np.abs(Q).max(axis=(0, 2))
    largest = size.max(axis=0)
    zero = size <= NEGLIGIBLE * largest
    regular = (largest > 0) & ~(zero & (size > 0)).any(axis=0)
    return np.where(zero, largest, size), regular


def _largest(step: Array, sizes: Array) -> Array:
    """Return the largest change (C,) of coordinates by a step (P, n, E, C), in their sizes."""
    return (np.abs(step).max(axis=(0, 2)) / sizes).max(axis=0)
