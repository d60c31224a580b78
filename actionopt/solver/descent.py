"""Minimise the discrete action by Newton's method with a metric, where Newton's alone would climb.

Where the Hessian H of S is not positive definite a multiple of its kinetic part K is added,
(H + mu K) step = -grad S. K measures velocities (the H1 metric), so that mu means the same on
every mesh and large mu gives the steepest descent of smooth paths (Neuberger, *Sobolev Gradients
and Differential Equations* (2010), chapter 4); mu is adapted as in Levenberg and Marquardt's
method.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from actionopt.discrete.factors import Factors
from actionopt.discrete.newton import CONTRACTION
from actionopt.discrete.transcription import Transcription
from actionopt.tools.types import Array

STEPS = 60
FIRST, RAISE, LOWER, LARGEST = 0.01, 3.0, 0.3, 1e6  # of mu, in units of K
DECREASE = 1e-2  # share of the decrease that the gradient promises which a step must bring
LONGEST = 1.0  # a step longer than this many times the path jumps over what lies between
ARRIVED = 1e-10  # a shorter step is too near to round-off for S to decrease
RUNAWAY = 1e3  # coordinates this many times their own size, still going down


@dataclass(frozen=True, eq=False)
class Descended:
    """Where the descent arrived.

    Attributes
    ----------
    z : (size,) array
        The last iterate.
    found : bool
        Whether Newton's method contracts there, and the Hessian is positive definite.
    runaway : bool
        Whether the path ran away instead: the action is unbounded below.
    iterations : int
        Factorizations used.
    """

    z: Array
    found: bool
    runaway: bool
    iterations: int


def descend(tr: Transcription, z: Array) -> Descended:
    """Go down from z; S decreases at every step. For systems without constraints or forces."""
    mu, count = 0.0, 0
    with np.errstate(all="ignore"):
        action, gradient = tr.action(z), tr.gradient(z)
        while count < STEPS and np.abs(z).max() < RUNAWAY:
            farthest = LONGEST * max(1.0, float(np.abs(z).max()))
            H, K = tr.kkt(z), tr.kinetic(z)
            if not np.all(np.isfinite(H)):
                break
            while not (factors := Factors(tr.layout, H + mu * K)).definite():
                mu = max(RAISE * mu, FIRST)
                if mu > LARGEST:  # a mass matrix that is not positive has no lowest action
                    return Descended(z, False, False, count)
            while True:
                count += 1
                try:
                    step = -factors.solve(gradient)
                except np.linalg.LinAlgError:
                    step = np.full_like(z, np.nan)
                if np.abs(step).max() < ARRIVED:
                    return Descended(z, mu == 0.0, False, count)
                trial = z + step
                lower = tr.action(trial) if np.abs(step).max() < farthest else np.nan
                if lower <= action + DECREASE * float(gradient @ step):
                    break
                mu = max(RAISE * mu, FIRST)
                if mu > LARGEST:
                    return Descended(z, False, False, count)
                factors = Factors(tr.layout, H + mu * K)
            z, action, gradient = trial, lower, tr.gradient(trial)
            if mu == 0.0:
                second = factors.solve(gradient)
                if np.linalg.norm(second) < CONTRACTION * np.linalg.norm(step):
                    return Descended(z - second, True, False, count)
            mu = LOWER * mu if LOWER * mu > FIRST / 2 else 0.0
    return Descended(z, False, bool(np.abs(z).max() >= RUNAWAY), count)
