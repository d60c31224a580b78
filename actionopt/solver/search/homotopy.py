"""Reach a path from any curve, by removing gradually the force that makes the curve a motion.

Any curve is the true motion under some applied force: the negative of its Euler-Lagrange residual
R(z0). Scaling that force down, R(z) = (1 - s) R(z0), leads from the curve at s = 0 to a path
of the problem itself at s = 1 (Newton homotopy; Allgower and Georg, *Numerical Continuation
Methods* (1990), section 11.3). The solutions (z, s) form a curve that may turn back in s, so it
is followed by its arclength (Keller's bordered system, ibid. chapter 10), from where its direction
and how this changed over the last step lead.

Where the inertia M varies by many digits along the curve, a force that moves what is heavy throws
what is light. Then the curve's accelerations are scaled down: R(z) = (1 - s) M(z) / M(z0) R(z0).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.matrices.factors import Factors
from actionopt.discrete.matrices.factors import diagonal as diagonal_matrix
from actionopt.mechanics.question.scales import diagonal
from actionopt.tools.types import Array

# Factorizations at most, and for any number of unknowns; all are taken up to some unknowns, above
# fewer in proportion. Measured on 220 random questions of 1 to 4 coordinates (190 unknowns), 40 of
# them with a guess: what is found takes 31 to 732, in 11 to 349 steps.
MOST_FACTORIZATIONS, FEWEST_FACTORIZATIONS, ALL_SIZE = 750, 60, 200
# Where the way is given up: forces so many times the first one, coordinates so many times their
# sizes. Measured on 50 systems of 1 to 4 coordinates: those that are reached come to 2.8 and 25, to
# 20 where a force is a sharp pulse; others, beyond a fold where no path is left, get farther and
# farther, in steps that get no longer.
RUNAWAY_FORCE, RUNAWAY_CURVE = 100.0, 50.0
# Ad hoc.
# Steps of arclength in s and the coordinates' root mean square; halved where the corrector fails.
FIRST_ARC, LONGEST_ARC, SHORTEST_ARC = 0.05, 0.5, 1e-6
CORRECTOR_STEPS = 5
CORRECTOR_TOL = 1e-6  # correction, in units of the coordinates' sizes, that ends a corrector
INERTIA_DIFFERENCE = 1e-7  # of the coordinates' sizes, for one-sided differences of inertias
CURVE_END = 1.5  # an s at which the curve is not near the path any more


def newton_homotopy(
    tr: Transcription, z: Array, *, uneven: bool = False
) -> tuple[Array | None, int]:
    """Return a point (size,) near a stationary path, or None, and the factorizations used.

    `z` is the curve at which the applied force starts; its accelerations where inertias are
    `uneven`.
    """
    most = MOST_FACTORIZATIONS
    if not uneven:
        most = min(most, most * ALL_SIZE // tr.layout.size + FEWEST_FACTORIZATIONS)
    way = HomotopyCurve(tr, z, tr.residual(z), Inertias(tr, z) if uneven else None)
    while way.count < most:
        before = way.z, way.s
        if not way.advance() or _returns(z[: tr.layout.unknowns], before, (way.z, way.s)):
            break
        if way.s >= 1.0 - 1e-9:
            return way.z, way.count
    return None, way.count


def _returns(first: Array, before: tuple[Array, float], here: tuple[Array, float]) -> bool:
    """Whether a step leads past where the curve began: it is closed, and never comes to s = 1.

    It began with s = 0 at `first` (k,), those of the unknowns (z, s) that are looked at. Half a
    step is near: measured, closed curves pass it by a tenth of one at most, others by six or more.
    """
    (z0, s0), (z1, s1) = before, here
    if not s0 < 0.0 <= s1:
        return False
    chord = z1[: first.size] - z0[: first.size]
    off = z0[: first.size] + s0 / (s0 - s1) * chord - first
    return float(off @ off) < float(chord @ chord) / 4


class Inertias:
    """The inertia at each node, in that at a first curve, with its velocities."""

    def __init__(self, tr: Transcription, z: Array) -> None:
        self._tr, self._node = tr, tr.layout.free // tr.layout.width
        self._v, self._known = tr.place(z).v, 1.0
        self._known = self.at(z)

    def at(self, z: Array) -> Array:
        """Return them for each equation, (size,); one for rows of constraints."""
        return self._of(self._tr.place(z).at)

    def slopes(self, z: Array) -> Array:
        """Return their derivatives, (size,), each by the unknown of its equation."""
        tr, at = self._tr, self._tr.place(z).at
        here, found = self._of(at), np.zeros(z.size)
        own = tr.layout.free % tr.layout.width
        for k, length in enumerate(tr.lengths):
            beside = at.copy()
            beside[:, k] += INERTIA_DIFFERENCE * length
            change = (self._of(beside) - here) / INERTIA_DIFFERENCE
            found[: own.size][own == k] = change[: own.size][own == k]
        return found

    def _of(self, at: Array) -> Array:
        tr, system = self._tr, self._tr.problem.system
        C = system.pointwise("second")(at, self._v, tr.times, tr.problem.packed)[2]
        inertia, node = diagonal(system, 2, C) @ tr.lengths**2, tr.layout.node_of
        nodes = np.bincount(node, inertia) / np.bincount(node)
        found = np.ones(tr.layout.size)
        found[: self._node.size] = nodes[self._node]
        return found / self._known


@dataclass(eq=False)
class HomotopyCurve:
    """A way along the curve R(z) = (1 - s) `force`, one step after the other."""

    tr: Transcription
    # z, force (size,)
    z: Array
    force: Array
    inertias: Inertias | None = None  # with which the force varies
    ds: float = 1.0  # of the direction
    s: float = 0.0
    direction: Array | None = None
    bends: tuple[Array | float, float] = 0.0, 0.0  # half of d(direction, ds) / d(arclength)
    length: float = FIRST_ARC
    count: int = 0

    def advance(self) -> bool:
        """Take a step; False if none can be taken."""
        return (self.direction is not None or self._find_direction()) and self._step_along()

    def _linearise(self, z: Array, s: float) -> tuple[Factors, Array]:
        """Return factors of the derivative of R(z) - (1 - s) F(z) by z, and the force F (size,).

        What the inertia at a node changes with another coordinate there is left out.
        """
        layout, K, force = self.tr.layout, self.tr.kkt(z), self.force
        if self.inertias is not None:
            K = K - diagonal_matrix(layout, (1.0 - s) * force * self.inertias.slopes(z))
            force = force * self.inertias.at(z)
        return Factors(layout, K, many=True), force

    def _find_direction(self) -> bool:
        """Find the direction of the curve."""
        try:
            factors, force = self._linearise(self.z, self.s)
            slope = -factors.solve(force)  # dz/ds
        except np.linalg.LinAlgError:
            return False
        self.count += 1
        self._keep_direction(slope)
        return self.ds > 0  # not where the slope is not finite

    def _keep_direction(self, slope: Array) -> None:
        """Keep going the same way along the curve, through a fold in s as well."""
        cut = self.tr.layout.unknowns
        norm = math.sqrt(slope[:cut] @ slope[:cut] / cut + 1.0)
        forward = self.ds
        if self.direction is not None:
            forward = float(slope[:cut] @ self.direction[:cut]) / cut + self.ds
        sign = 1.0 if forward >= 0 else -1.0
        self.direction, self.ds = sign * slope / norm, sign / norm

    def _step_along(self) -> bool:
        """Take a step along the curve, as long as its corrector converges and s <= `CURVE_END`.

        False if none is taken, or it led so far away that the curve is given up.
        """
        assert self.direction is not None
        while self.length >= SHORTEST_ARC:
            step, ds = self.length, self.ds
            if ds > 0 and self.s + step * ds > 1.0:
                step = min(step, (1.0 - self.s) / ds)
            bend, bend_s = self.bends
            ahead = self.z + step * (self.direction + step * bend)
            trial = self._correct(ahead, self.s + step * (ds + step * bend_s))
            if trial is None:
                self.length = step / 2
                continue
            z, s, slope, steps = trial
            if s > CURVE_END:
                self.length = float(step * (1.0 - self.s) / (s - self.s))
                continue
            self.z, self.s = z, float(s)
            if steps <= 2:
                self.length = min(2 * self.length, LONGEST_ARC)
            near = (
                bool(np.max(np.abs(z[: self.tr.layout.unknowns])) < RUNAWAY_CURVE)
                and 1.0 - s < RUNAWAY_FORCE
            )
            before = self.direction
            self._keep_direction(slope)
            self.bends = (self.direction - before) / (2 * step), (self.ds - ds) / (2 * step)
            return near
        return False

    def _correct(self, z: Array, s: float) -> tuple[Array, float, Array, int] | None:
        """Return (z, s, dz/ds, steps) on the curve, on the plane across its direction; or None."""
        tr, cut, last = self.tr, self.tr.layout.unknowns, np.inf
        assert self.direction is not None
        across = self.direction[:cut]
        with np.errstate(all="ignore"):
            for k in range(1, CORRECTOR_STEPS + 1):
                self.count += 1
                try:
                    factors, force = self._linearise(z, s)
                    left = tr.residual(z) - (1.0 - s) * force
                    miss, slope = factors.solve_both(left, -force)
                except np.linalg.LinAlgError:
                    return None
                # Bordered system: the correction is orthogonal to the direction.
                change = float(miss[:cut] @ across / (slope[:cut] @ across + self.ds * cut))
                step = slope * change - miss
                size = float(np.maximum.reduce(np.abs(step[:cut])))
                if not math.isfinite(size) or size > 2 * last:
                    return None
                z, s, last = z + step, s + change, size
                if size < CORRECTOR_TOL:
                    return z, s, slope, k
        return None
