"""Minimise the discrete action by Newton's method with a metric, where plain Newton would raise it.

Where the Hessian H of S is not positive definite a multiple of its kinetic part K is added,
(H + mu K) step = -(1 + mu) grad S. K measures velocities (the H1 metric), so that mu means the same
on every mesh and large mu gives the steepest descent of smooth paths (Neuberger, *Sobolev Gradients
and Differential Equations* (2010), chapter 4); mu is adapted as in Levenberg and Marquardt's
method. As H = K - V, that is (K - V / (1 + mu)) step = -grad S: one stiff variation, which asks for
a large mu, does not shorten the steps along all the others, as it would without the factor.

Beyond a place where L is infinite, such as y = 0 of v^2 / y, it may be lower than anywhere: steps
to where an inertia is not positive any more are taken again from before, with a larger mu.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.matrices.factors import Factors, product
from actionopt.discrete.newton.newton import CONTRACTION
from actionopt.tools.immutable import immutable
from actionopt.tools.types import Array

# Ad hoc, as in any method of this kind, where nothing else is said.
DESCENT_STEPS = 60
FIRST_MU, RAISE_MU, LOWER_MU, LARGEST_MU = 0.01, 3.0, 0.3, 1e6  # in units of K
SUFFICIENT_DECREASE = 1e-2  # Armijo's: share of what the gradient promises that a step must bring
# A shorter step changes S by its square, 1e-20, which is round-off of S: derived, and on the safe
# side for curvatures far from one.
SHORTEST_DESCENT = 1e-10
QUOTIENT_ROUNDOFF = 1e-6  # of Rayleigh's quotient, far above its round-off
SHORTEN, SHORTEST_PART = 3.0, 3e-4  # of a step, for which no factorization is needed
# Ad hoc: the lowest modes of velocities part from others by squares; S is nearly quadratic so near.
POWER_STEPS, OFF_SADDLE = 4, 2.0**-7  # in lengths
RUNAWAY = 1e3  # coordinates this many times their own size, still going down
FAR_OUT = 8.0  # sizes from where it is asked whether S falls on and on
DOUBLINGS = 2.0 ** np.arange(1, 9)  # of a step, that are looked at together


@immutable
class Descended:
    """The end of a descent."""

    z: Array  # (size,): the last iterate
    found: bool  # whether Newton's method contracts there, and the Hessian is positive definite
    runaway: bool  # whether the path ran away instead: the action is unbounded below
    iterations: int  # factorizations used


def descend(
    tr: Transcription,
    z: Array,
    far: float = RUNAWAY,
    looked: float = FAR_OUT,
    along: Array | None = None,
) -> Descended:
    """Go down from z; S decreases at every step. The system has no constraints or forces.

    Coordinates `far` times their own size have run away; `looked` times it, they are asked whether
    they will. Where S bends down along a variation `along` (size,), smaller shifts are not tried.
    """
    mu, lower_mu, count, first, last, least = 0.0, 0.0, 0, z, None, None
    inertias, back = _inertias(tr), None
    with np.errstate(all="ignore"):
        action, gradient = tr.action(z), tr.gradient(z)
        while count < DESCENT_STEPS and np.abs(z).max() < far:
            farthest = max(1.0, float(np.abs(z).max()))  # farther it jumps over what lies between
            if farthest >= looked:
                if _falls(tr, first, z - first):
                    return Descended(z, False, True, count)
                looked = 2 * farthest
            here = _Curvature(tr, z, inertias)
            if not np.isfinite(here.H).all():
                break
            if back is not None and not here.has_mass:
                z, action, gradient, here, mu = back
            # Asked where a shift has failed, and then as long as S bends down along the last step.
            bends = least is not None and least > 0
            least = here.least_mu(last) if bends and last is not None else None
            if along is not None and (bound := here.least_mu(along)) > 0:
                least = max(least or 0.0, bound)
            while (least and mu < least) or not (factors := here.shifted(mu)).definite():
                if least is None:
                    least = here.least_mu(here.steepest(gradient) if last is None else last)
                mu = lower_mu if mu < lower_mu else max(RAISE_MU * mu, FIRST_MU)
                if mu > LARGEST_MU:  # or the mass is not positive: then there is no lowest action
                    return Descended(z, False, _runs_away(tr, first, z), count)
            while True:
                count += 1
                try:
                    step = -(1.0 + mu) * factors.solve(gradient)
                except np.linalg.LinAlgError:
                    step = np.full_like(z, np.nan)
                if np.abs(step).max() < SHORTEST_DESCENT:
                    return Descended(z, mu == 0.0, False, count)
                lower = _backtrack(tr, z, step, action, float(gradient @ step), farthest)
                if lower is not None:
                    break
                mu = max(RAISE_MU * mu, FIRST_MU)
                if mu > LARGEST_MU:
                    return Descended(z, False, _runs_away(tr, first, z), count)
                factors = here.shifted(mu)
            more = max(RAISE_MU * mu, lower_mu, FIRST_MU)
            varies = inertias is not None and here.has_mass
            back = (z, action, gradient, here, more) if varies else None
            before, (z, action) = z, lower
            last = z - before
            gradient = tr.gradient(z)
            whole = (z == before + step).all()
            if mu == 0.0 and whole:
                second = factors.solve(gradient)
                near = np.linalg.norm(second) < CONTRACTION * np.linalg.norm(step)
                if near and (back is None or _has_mass(tr, z - second, inertias)):
                    return Descended(z - second, True, False, count)
            lower_mu = LOWER_MU * mu if LOWER_MU * mu > FIRST_MU / 2 else 0.0
            mu = 0.0 if whole else lower_mu
    return Descended(z, False, bool(np.abs(z).max() >= far), count)


class _Curvature:
    """The Hessian H of S at a path, and its kinetic part K, which is computed when it is needed."""

    def __init__(self, tr: Transcription, z: Array, inertias: Array | None = None) -> None:
        self.tr, self.z = tr, z
        self.has_mass = _has_mass(tr, z, inertias)
        self.H = tr.kkt(z)

    @cached_property
    def K(self) -> Array:
        return self.tr.kinetic(self.z)

    def shifted(self, mu: float) -> Factors:
        """Return the factors of H + mu K."""
        return Factors(self.tr.layout, self.H + mu * self.K if mu else self.H)

    def least_mu(self, step: Array) -> float:
        """Return a mu below which H + mu K bends down along a step, and need not be factorized.

        By Rayleigh's quotient, which is nearly the least mu where steps run away: along the last
        one. Along constants, which cost no velocities, it is infinite.
        """
        if not step.any():
            return 0.0
        bend, metric = (float(step @ product(self.tr.layout, A, step)) for A in (self.H, self.K))
        if metric > 0:
            return -bend / metric * (1 - QUOTIENT_ROUNDOFF)
        return np.inf if bend < 0 else 0.0

    def steepest(self, gradient: Array) -> Array:
        """Return the variation of steepest descent in the metric K, or by a constant that is loose.

        Measured on pendulums, wells and charges: from a straight line the least mu is hardly more.
        """
        away, metric = loose_constants(self.tr), Factors(self.tr.layout, self.K)
        return away if away.any() or not metric.definite() else metric.solve(gradient)


def _inertias(tr: Transcription) -> Array | None:
    """Return which nonzeros of L_vv are on its diagonal, (nonzeros,); None where it is constant."""
    system = tr.problem.system
    if system.structure.constant_mass:
        return None
    rows, cols = system.pointwise("second").sparsity(2)
    return rows == cols


def _has_mass(tr: Transcription, z: Array, inertias: Array | None) -> bool:
    """Whether all inertias that vary are positive at all nodes; second derivatives are kept."""
    kept = tr.keep_second(z)
    return inertias is None or bool((kept[2][:, inertias] > 0).all())


def loose_constants(tr: Transcription) -> Array:
    """Return the variation (size,) by one constant of the coordinates that are given at no end."""
    problem, away = tr.problem, np.zeros(tr.layout.size)
    held = {*problem.start.pinned, *(problem.end.pinned if problem.advance is None else ())}
    if len(held) < problem.system.n:
        away[: tr.layout.unknowns] = ~np.isin(tr.layout.free % tr.layout.width, list(held))
    return away


def _runs_away(tr: Transcription, first: Array, z: Array) -> bool:
    """Whether a path that is farther from the first than this is long goes on and on."""
    return float(np.abs(z - first).max()) > 1.0 and _falls(tr, first, z - first)


def way_down(tr: Transcription, saddle: Array, away: Array) -> Array | None:
    """Return a variation along which S falls from a saddle all the way to a path that has run away.

    It is `away` (size,) or its opposite; where that is zero, the variation of the lowest eigenvalue
    of K^-1 H (power method). None if S does not fall so.
    """
    with np.errstate(all="ignore"):
        if not away.any():
            gradient, metric = tr.gradient(saddle), Factors(tr.layout, tr.kinetic(saddle))
            if not metric.definite():
                return None
            away = np.random.default_rng(0).standard_normal(saddle.size)
            for _ in range(POWER_STEPS):
                away *= OFF_SADDLE / np.abs(away).max()
                away = away - metric.solve(tr.gradient(saddle + away) - gradient)
        away = away * OFF_SADDLE / np.abs(away).max()
        here = tr.action_alone(saddle)
        for side in (away, -away):
            if tr.action_alone(saddle + side) < here and _falls(tr, saddle, side):
                return side
    return None


def _falls(tr: Transcription, first: Array, away: Array) -> bool:
    """Whether S falls beyond `away` from a path, each step twice as far, until it has run away."""
    before, parts = tr.action_alone(first + away), DOUBLINGS
    while True:
        sizes = np.abs(first + parts[:, None] / 2 * away).max(axis=1)
        for action, size in zip(tr.actions_along(first, away, parts), sizes, strict=True):
            if size >= RUNAWAY:
                return True
            if not action < before:
                return False
            before = action
        parts = parts * DOUBLINGS[-1]


def _backtrack(
    tr: Transcription, z: Array, step: Array, action: float, slope: float, farthest: float
) -> tuple[Array, float] | None:
    """Return where a part of the step leads that lowers the action enough, and the action there.

    None if all that do are short.
    """
    part = min(1.0, farthest / float(np.abs(step).max()))
    while part > SHORTEST_PART:
        trial = z + part * step
        lower = tr.action(trial)
        if lower <= action + SUFFICIENT_DECREASE * part * slope:
            return trial, lower
        part /= SHORTEN
    return None
