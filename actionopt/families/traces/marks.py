"""What changes between two neighbouring points of a branch, and where.

On a branch (z, s) without branch points s turns, at a fold, where the index changes by one, and
nowhere else: ds/dsigma and the determinant of the KKT matrix have one ratio that never vanishes
(Allgower and Georg, *Numerical Continuation Methods* (1990), chapter 8). A step that shows more
than one change, or the one without the other, is too long to tell what lies between.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from actionopt.discrete.borders.arclength import Branch, BranchPoint
from actionopt.discrete.meshes.path import Path
from actionopt.tools.immutable import immutable
from actionopt.tools.shown import one_line
from actionopt.tools.types import Array

# Arclength from a point that is known, so near that a tangent leads on: it misses the branch, and
# s where that turns, by the square. Derived: EPS^(1/2).
LOCATED = 1e-8
LOCATE_STEPS = 60
# Two folds nearer together than this part of the range of s are no pair. Ad hoc, far above what
# `arclength.LAST_CORRECTION` leaves in s; at a cusp, where ds/dsigma touches 0, met in ten steps.
FOLDS_APART = 1e-6
# How far the cubic of a step may be off, in parts of how far ds/dsigma bends within it, and how far
# from where it turns s may turn, in parts of the step. Ad hoc.
UNSURE_SLOPE, UNSURE_FOLD = 0.5, 0.1


@immutable
class Mark:
    """A point of a branch where something changes.

    Attributes
    ----------
    kind : {"fold", "index", "period doubling"}
        Whether the branch turns back there, or only the index changes; or, of closed paths, a
        multiplier passes -1: others branch off that close after two turns.
    value : float
        Of the varied quantity.
    path : Path
        The (degenerate) path there.
    before, after : int or None
        Index on either side, in the order of the trace.
    point : int
        Of the trace, the point before it.
    """

    kind: Literal["fold", "index", "period doubling"]
    value: float
    path: Path
    before: int | None
    after: int | None
    point: int = 0

    __repr__ = one_line


@dataclass(frozen=True)
class Step:
    """A step along a branch, as s shows it: a cubic with its values and slopes at both ends."""

    length: float  # along the direction of the first point; s is in units of its range
    # first, last: slopes of s at the ends.
    first: float
    last: float
    bend: float  # by how much the slope in the middle is more than the mean of these

    @classmethod
    def between(cls, branch: Branch, here: BranchPoint, there: BranchPoint) -> Step:
        """Return the step from one point of a branch to the next one."""
        change = np.r_[there.z - here.z, there.s - here.s]
        length = branch.inner(here.tr, change, here.direction)
        first = here.direction[-1] / branch.range
        last = there.direction[-1] / branch.range / branch.angle(here, there)
        mean = change[-1] / branch.range / length
        return cls(length, first, last, 1.5 * (mean - (first + last) / 2))

    @property
    def turns(self) -> bool:
        """Whether s grows at one end and falls at the other."""
        return self.first * self.last < 0

    @property
    def hides_folds(self) -> bool:
        """Whether s may turn twice, though it goes the same way at both ends."""
        towards_zero = self.bend * self.first < 0
        if self.turns or not towards_zero or abs(self.bend) * self.length < FOLDS_APART:
            return False
        part = 0.5 + (self.last - self.first) / (8 * self.bend)
        least = self._slope(part) * np.sign(self.first)
        return 0 < part < 1 and least < UNSURE_SLOPE * abs(self.bend)

    def turns_at(self, length: float) -> bool:
        """Whether the cubic turns so far along, too, as it does where nothing is hidden."""
        if abs(self.bend) * self.length < FOLDS_APART:
            return True
        near = (length / self.length + UNSURE_FOLD * np.array([-1.0, 1.0])).clip(0.0, 1.0)
        return bool(self._slope(near[0]) * self._slope(near[1]) <= 0)

    def _slope(self, part: float) -> float:
        rise = self.last - self.first
        return self.first + rise * part + 4 * self.bend * part * (1 - part)


class StepTrial(NamedTuple):
    """A point so far along a step, and the value of what vanishes somewhere on it."""

    length: float
    point: BranchPoint
    value: float


def locate(
    branch: Branch, here: BranchPoint, there: BranchPoint, function: Callable[[BranchPoint], float]
) -> BranchPoint | None:
    """Return the point between two ones at which `function` vanishes.

    By inverse interpolation, each point from where the cubic between those beside it leads. None
    where no steps lead to it, or not as many as `LOCATE_STEPS`.
    """
    chord = np.r_[there.z - here.z, there.s - here.s]
    length = branch.inner(here.tr, chord, here.direction)
    low = StepTrial(0.0, here, float(function(here)))
    high = StepTrial(length, there, float(function(there)))
    if low.value * high.value > 0:
        return None
    tried, near, left = [low, high], low, length
    for _ in range(LOCATE_STEPS):
        length = _zero(tried)
        if not low.length <= length <= high.length:
            length = (low.length + high.length) / 2
        near = min(low, high, key=lambda trial: abs(trial.length - length))
        left = length - near.length
        if abs(left) < LOCATED:
            break
        taken = branch.step(here, length, _between(branch, here, low, high, length))
        if taken is None:
            return None
        trial = StepTrial(length, taken[0], float(function(taken[0])))
        low, high = (low, trial) if trial.value * high.value > 0 else (trial, high)
        tried.append(trial)
    else:
        return None
    y = np.r_[near.point.z, near.point.s] + left * _tangent(branch, here, near)
    s = float(y[-1])
    return BranchPoint(branch.at(s), y[:-1], s, near.point.direction)


def _zero(tried: list[StepTrial]) -> float:
    """Return where the polynomial through trials vanishes that tells lengths by values."""
    values = np.array([trial.value for trial in tried])
    others = ~np.eye(values.size, dtype=bool)
    with np.errstate(all="ignore"):  # where two values are the same
        parts = values / (values - values[:, None])
        weights = np.prod(parts, axis=1, where=others)
        return float(weights @ [trial.length for trial in tried])


def _tangent(branch: Branch, here: BranchPoint, trial: StepTrial) -> Array:
    """Return the change of (z, s) by the length along the direction of a point `here`."""
    along = trial.point.direction
    return along / branch.inner(here.tr, along, here.direction)


def _between(
    branch: Branch, here: BranchPoint, low: StepTrial, high: StepTrial, length: float
) -> Array:
    """Return where the cubic between two trials is so far along, (z, s)."""
    step, x = high.length - low.length, (length - low.length) / (high.length - low.length)
    a, b = (np.r_[trial.point.z, trial.point.s] for trial in (low, high))
    left, right = (step * _tangent(branch, here, trial) for trial in (low, high))
    return a + x * (b - a) + x * (1 - x) * ((1 - x) * (left - b + a) - x * (right - b + a))
