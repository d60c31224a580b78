"""Reach a path among resonances: hold the modes that run away, and let them go one by one.

Next to a resonance the matrix A of Newton's method has an eigenvalue near zero, and its step sends
that mode far away, where nothing is as it was. With amplitudes a given to such modes V, and forces
f along them, the bordered system

    [ A  -V ] [ dz ]   [   -R(z)  ]
    [ V'  0 ] [  f ] = [ a - V' z ]

is regular: all other modes settle in a few steps, and what is left are as many equations f(a) = 0
as modes are held (the reduction of Lyapunov and Schmidt; Golubitsky and Schaeffer, *Singularities
and Groups in Bifurcation Theory* I (1985), chapter VII). A swing that softens or stiffens has its
root where the amplitude has put it off the resonance, on either side: each amplitude is followed
both ways to where its force changes sign, and the mode is free from there on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.matrices.factors import Factors
from actionopt.discrete.newton.newton import CONTRACTION
from actionopt.solver.refinement.component_newton import SETTLED
from actionopt.solver.refinement.signals import HALVINGS
from actionopt.tools.immutable import immutable
from actionopt.tools.types import Array

# Measured on pendulums of 30 to 100 links: what is found takes 5 to 60 factorizations, and holds up
# to two modes at a time.
FACTORIZATIONS, MOST_HELD = 100, 12
# Ad hoc, lengths in units of the coordinates' sizes. A step longer than one is that of a mode that
# runs away, and no amplitude grows by more at once.
SETTLING = 2  # steps until most modes have settled
# until all other modes have settled, at first and as an amplitude grows
SETTLE_STEPS, FOLLOWING = 20, 4
FIRST_AMPLITUDE = 0.25  # by which it grows, at first
PAST = 1.5  # of the way to where the force would vanish if it were linear
FAR_FROM_LINE = 4.0  # a path that is not beside the line any more
INVERSE_STEPS = 2  # to a mode from a step that is most of it already


@immutable
class _Held:
    """A path on which other forces vanish than those f (k,) along the modes (size, k) held.

    `slopes` (k,) are those of the forces by their own amplitudes.
    """

    z: Array
    modes: Array
    forces: Array
    slopes: Array

    @property
    def root(self) -> float:
        """The growth of the first amplitude to where its force vanishes, if that is linear."""
        return float(-self.forces[0] / self.slopes[0])

    def next(self) -> _Held:
        """Return the modes in turn: the second one first, the first one last."""
        rolled = (np.roll(x, -1, axis=-1) for x in (self.modes, self.forces, self.slopes))
        return _Held(self.z, *rolled)


@dataclass(eq=False)
class _AmplitudeCurve:
    """A way along one amplitude: where it has come to, its sign, and the next growth."""

    at: _Held
    sign: float
    growth: float


def pass_resonances(tr: Transcription, z: Array) -> tuple[Array | None, int]:
    """Return a point (size,) near a stationary path, or None, and the factorizations used."""
    search = Resonances(tr)
    return search.path(z), search.count


@dataclass(eq=False)
class Resonances:
    """A search for a path of a transcription without constraints; `count` factorizations so far."""

    tr: Transcription
    count: int = 0

    def path(self, z: Array) -> Array | None:
        """Return a point (size,) near a stationary path, from z; None if that fails."""
        with np.errstate(all="ignore"):
            none = np.zeros((z.size, 0))
            at = self._settle(z, none, SETTLE_STEPS, hold=False)
            at, kept = at or self._settle(z, none, SETTLE_STEPS, hold=True), 0
            while at is not None and kept < at.forces.size:
                free = self._release(at)
                if free is None:  # another may have to go first
                    at, kept = at.next(), kept + 1
                else:
                    at, kept = self._settle(*free, SETTLE_STEPS, hold=True), 0
        return None if at is None or at.forces.size else at.z

    def _settle(
        self, z: Array, modes: Array, steps: int, *, hold: bool, grown: float = 0.0
    ) -> _Held | None:
        """Take Newton's steps with the amplitudes kept, but for the first, which has to grow.

        What runs away, or does not settle, is held as well if `hold`. Else the step is shortened if
        nothing is held: it may leap over a resonance. None if that fails.
        """
        tr, last, wanted = self.tr, math.inf, modes.T @ z
        wanted[:1] += grown
        for k in range(steps):
            if self.count == FACTORIZATIONS:
                return None
            self.count += 1
            try:
                factors = Factors(tr.layout, tr.kkt(z), many=True)
                free = factors.solve(tr.residual(z))
                carried = _displace(factors, modes)
                while True:
                    stiffness = np.linalg.inv(modes.T @ carried)
                    forces = stiffness @ (wanted - modes.T @ (z - free))
                    step = carried @ forces - free
                    size = float(np.abs(step).max())
                    slow = k >= SETTLING and size > max(CONTRACTION * last, SETTLED)
                    if not math.isfinite(size):
                        return None
                    if size <= 1 and not slow:
                        break
                    if not hold and not wanted.size and not slow:
                        step /= size
                        break
                    if not hold or wanted.size == MOST_HELD:
                        return None
                    for _ in range(INVERSE_STEPS):
                        mode = factors.solve(step / np.linalg.norm(step))
                        step = mode - carried @ (stiffness @ (modes.T @ mode))
                    step -= modes @ (modes.T @ step)
                    mode = (step / np.linalg.norm(step))[:, None]
                    modes, last = np.hstack([modes, mode]), math.inf
                    carried = np.hstack([carried, _displace(factors, mode)])
                    wanted = np.append(wanted, mode[:, 0] @ z)
            except np.linalg.LinAlgError:
                return None
            z, last = z + step, size
            if size < SETTLED:
                return _Held(z, modes, forces, np.diag(stiffness))
        return None

    def _release(self, at: _Held) -> tuple[Array, Array] | None:
        """Return where the force along the first mode vanishes, and the modes still held."""
        unit = 1.0 / float(np.abs(at.modes[:, 0]).max())
        first = min(FIRST_AMPLITUDE * unit, PAST * abs(at.root))
        ways = [_AmplitudeCurve(at, sign * np.sign(at.root), first) for sign in (1.0, -1.0)]
        while ways:
            for way in tuple(ways):
                here, ahead = way.at, way.at.root * way.sign
                growth = min(way.growth, PAST * ahead) if ahead > 0 else way.growth
                there = self._settle(
                    here.z, at.modes, FOLLOWING, hold=False, grown=way.sign * growth
                )
                if there is None or not np.abs(there.z).max() < FAR_FROM_LINE:
                    way.growth = growth / 3
                    if way.growth < 2.0**-HALVINGS * first or self.count == FACTORIZATIONS:
                        ways.remove(way)
                elif there.forces[0] * here.forces[0] <= 0:
                    part = here.forces[0] / (here.forces[0] - there.forces[0])
                    return here.z + part * (there.z - here.z), at.modes[:, 1:]
                else:
                    way.at, way.growth = there, min(2 * growth, unit)
        return None


def _displace(factors: Factors, forces: Array) -> Array:
    """Return where forces (size, k) along modes carry the path (size, k)."""
    return np.stack([factors.solve(f) for f in forces.T], axis=1) if forces.size else forces
