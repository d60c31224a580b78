"""Newton's method on the KKT system: plain, to follow a path that is near; damped, to approach one.

Every factorization is used twice: for the Newton step and for a simplified second step, whose
ratio to the first measures how fast the iteration contracts (Deuflhard, *Newton Methods for
Nonlinear Problems* (2011), section 2.1). `follow` has no globalisation and gives up where it does
not contract; `approach` shortens the steps until they do (ibid. section 3.3). Lengths of steps, not
residuals, decide: they mean the same on every mesh.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress

import numpy as np

from actionopt.discrete.action.equations import Equations
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.matrices.factors import Factors, product
from actionopt.discrete.newton.increments import factorize, is_reliable, is_stiff
from actionopt.tools.immutable import immutable
from actionopt.tools.types import EPS, Array

# Ad hoc, but flat: on the scenes, each also over 2.3 times its duration (65 problems and 342
# iterations), `CONTRACTION` from 0.25 to 0.75, and a third of each other (but `CHORDS`) or three
# times as much, take 2 % more iterations at the most.
CONTRACTION = 0.5  # a larger ratio of successive steps is not the neighbourhood of a path
ROUNDOFF_STEP = 1e-9  # steps that stop contracting below this size are round-off
DISTURBED = 5  # steps granted for the multipliers to settle
SURELY = 0.1  # a ratio of steps that leaves no doubt of it
DAMPED = 1e-3  # a shorter fraction of a step leads nowhere
CHORDS = 3  # simplified steps that cost less than a factorization where that is kept
# Part of the ends' movement by which they are moved for one-sided differences, as accurate as that.
ENDS_DIFFERENCE = 1e-5
HALF_DIGITS = 1e-8  # of the terms: a larger residual is no round-off, whatever the matrix is
TARGET = 1e-14  # in units of the coordinates' sizes; one step past it costs next to nothing


@immutable
class Followed:
    """The end of Newton's method."""

    z: Array  # (size,): the last iterate
    converged: bool  # whether the steps contracted down to round-off
    # Size of the correction that the remaining residual still asks for, in units of the
    # coordinates' sizes: round-off amplified by the problem's own conditioning.
    noise: float
    iterations: int  # factorizations used
    travelled: float  # distance from the first iterate, in the same units
    factors: Factors | None = None  # those of the last factorization, close to z
    # Distance from where that matrix was taken, that of the multipliers included.
    since: float = 0.0
    first_step: float = 0.0  # length of Newton's first step, in the same units, where it was lost


def follow(
    tr: Equations,
    z: Array,
    *,
    linear: bool = False,
    many: bool = False,
    target: float = TARGET,
    enough: Callable[[Array], float] | None = None,
    steps: int = 12,
    near: tuple[Factors, float] | None = None,
) -> Followed:
    """Follow the stationary path near z in at most `steps` factorizations; one if it is `linear`.

    What is left then is below `target`, in units of the coordinates' sizes, or round-off; or below
    what `enough` returns for the path at hand, whose round-off is not measured. `many` is for
    `Factors`. Those of a matrix `near` that at z, and how far it was taken from there, may do.
    """
    cut = tr.layout.unknowns
    first, rest, first_step = z, np.inf, 0.0
    with np.errstate(all="ignore"):
        residual = tr.residual(z)
        if near is not None:
            factors, since = near
            with suppress(np.linalg.LinAlgError):
                end, rest, _, converged, _ = _steps(
                    tr, factors, z, residual, linear, target, enough
                )
                if converged and np.isfinite(rest):
                    since += _size(end - z)
                    return Followed(end, True, rest, 0, _size((end - z)[:cut]), factors, since)
        for k in range(1, steps + 1):
            factors, taken = None, z  # frees the last ones before the next are made
            try:
                if linear and isinstance(tr, Transcription) and tr.problem.system.structure.steady:
                    factors = _steady(tr, z, many)
                else:
                    factors = factorize(tr, z, many=many)
                if is_stiff(tr, z) and not is_reliable(tr, factors, z, residual):
                    return Followed(z, False, np.inf, k, np.inf)
                z, rest, ratio, converged, length = _steps(
                    tr, factors, z, residual, linear, target, enough
                )
            except np.linalg.LinAlgError:
                return Followed(z, False, np.inf, k, np.inf, first_step=first_step)
            first_step = length if k == 1 else first_step
            if not np.isfinite(rest):
                return Followed(z, False, np.inf, k, np.inf, first_step=first_step)
            travelled = _size((z - first)[:cut])
            if converged:
                return Followed(z, True, rest, k, travelled, factors, _size(z - taken))
            if enough is not None and ratio < CONTRACTION and rest * ratio <= enough(z):
                return Followed(z, True, 0.0, k, travelled, factors, _size(z - taken))
            residual = tr.residual(z)
            # Multipliers far off disturb the first steps, and are right after them.
            disturbed = tr.layout.rows > 0 and k <= DISTURBED and ratio < 1 / CONTRACTION
            if ratio > CONTRACTION and not disturbed:
                break
        # A residual of round-off leaves nothing to contract: the matrix is (nearly) singular and
        # what is left of the step says how little the path is determined.
        terms = _size(factors.nonzeros) * _size(np.abs(z) + tr.magnitudes)
        small = _size(residual) < HALF_DIGITS * terms
        at_roundoff = small and is_roundoff(tr, z, residual)
    return Followed(z, at_roundoff, rest, k, _size((z - first)[:cut]), first_step=first_step)


def _steady(tr: Transcription, z: Array, many: bool) -> Factors:
    """Return factors of the matrix at z, where it is the same at any z; small ones are kept."""
    watched = tr.watch is not None  # it is told of second derivatives
    if not tr.layout.small or tr.nodal or watched or is_stiff(tr, z):
        return factorize(tr, z, many=many)
    known = tr.layout.solvers.get("steady")
    if known is None or known[0] is not tr.weight:  # which problems with other ends share
        known = tr.layout.solvers["steady"] = tr.weight, Factors(tr.layout, tr.kkt(z))
    return known[1]


def _steps(
    tr: Equations,
    factors: Factors,
    z: Array,
    residual: Array,
    linear: bool,
    target: float,
    enough: Callable[[Array], float] | None,
) -> tuple[Array, float, float, bool, float]:
    """Take Newton's step from z and simplified ones, as far as they will do.

    Return the last iterate (size,), the length of the last step, its ratio to the one before, and
    whether they converged: then the last step was not taken, and its length is the round-off. And
    the length of the first step.
    """
    converged, ratio, length = False, 0.0, 0.0
    step = factors.solve(residual)
    chords = CHORDS if factors.cheap else 1
    for again in range(chords + 2):
        z, size = z - step, tr.relative_step(step)
        length = length if again else size
        residual = tr.residual(z)
        step = factors.solve(residual)
        rest = tr.relative_step(step)
        if converged or rest <= target:
            if not residual.any():  # a path of zeros has no round-off of its own
                rest = tr.relative_step(factors.solve(_roundoff(tr, factors)))
            return z, rest, ratio, True, length
        ratio = rest / size if size else 0.0
        stopped = ratio > CONTRACTION and rest < ROUNDOFF_STEP
        converged = linear or rest * ratio <= target or stopped
        if not converged and not rest * min(ratio, 1.0) ** (chords - again) <= target:
            break  # too many to come; or it is not a number
        if not converged and enough is not None and rest * ratio <= enough(z):
            break
    if again and ratio > CONTRACTION:  # near a singular matrix another one may serve
        ratio = CONTRACTION
    return z - step, rest, ratio, False, length


def move_ends(tr: Transcription, z: Array, to: Transcription) -> tuple[Array, bool]:
    """Return where the stationary path z of `tr` goes when its ends move to those of `to`.

    Along the tangent of the family of paths, which is smooth where new ends alone would kink the
    path, and by simplified steps as long as they contract. And whether there may be a path near: a
    simplified step that grows says that the family bends before. Raises numpy.linalg.LinAlgError
    if the matrix is singular.
    """
    cut = tr.layout.unknowns
    with np.errstate(all="ignore"):
        factors = Factors(tr.layout, tr.kkt(z), many=True)
        step, near = factors.solve(_residual_change(tr, z, to, factors)), True
        z = z - step
        for _ in range(CHORDS - 1 if factors.cheap else 0):
            last, step = _size(step[:cut]), factors.solve(to.residual(z))
            size = _size(step[:cut])
            if not size < CONTRACTION * last:
                near = size < last or tr.layout.rows > 0  # multipliers may disturb it
                break
            z = z - step
    return z, near


def _residual_change(tr: Transcription, z: Array, to: Transcription, factors: Factors) -> Array:
    """Return how the residual of `tr` at z changes with its ends, to those of `to`, (size,)."""
    ends = tr.ends[[0, -1]]
    change = to.ends[[0, -1]] - ends
    if tr.layout.storage == "blocks":
        padded = np.zeros((2, tr.layout.blocks.width))
        padded[:, : ends.shape[1]] = change / tr.place_units
        return tr.layout.blocks.of_ends(factors.nonzeros, padded)
    nearby = tr.with_ends(ends + ENDS_DIFFERENCE * change)
    return nearby.residual(z) / ENDS_DIFFERENCE  # that of z itself is zero


def approach(
    tr: Equations, z: Array, steps: int, *, convex: bool = False, many: bool = False
) -> tuple[Array, int] | None:
    """Return a point where Newton's method contracts, and the factorizations used; else None.

    If `convex`, only where the action is so at z: from there it hardly ever fails; `many` is for
    `Factors`. The damping
    factor comes from the curvature that the simplified step shows (Deuflhard, algorithm NLEQ-ERR).
    """
    cut = tr.layout.unknowns
    damping, last, simplified, rest = 1.0, None, None, 0.0
    with np.errstate(all="ignore"):
        residual = tr.residual(z)
        for k in range(1, steps + 1):
            try:
                factors = None  # frees the last ones before the next are made
                # From the second on they are many, which does not pay for small ones.
                often = many or (k > 1 and not tr.layout.small)
                factors = Factors(tr.layout, tr.kkt(z), many=often)
                if convex and k == 1 and not factors.definite():
                    return None
                step = -factors.solve(residual)
            except np.linalg.LinAlgError:
                return None
            length = _norm(step[:cut])
            if tr.relative_step(step) < ROUNDOFF_STEP:
                return z, k
            if last is not None and simplified is not None:
                second = _norm((simplified - step)[:cut]) * length
                damping = min(1.0, damping * last * rest / second) if second else 1.0
            while True:
                if not damping > DAMPED:
                    return None
                trial = z + damping * step
                residual = tr.residual(trial)
                try:
                    simplified = -factors.solve(residual)
                except np.linalg.LinAlgError:
                    return None
                rest = _norm(simplified[:cut])
                if rest < (1 - damping / 4) * length:
                    break
                second = _norm((simplified - (1 - damping) * step)[:cut])
                better = 0.5 * length * damping**2 / second if second else 1.0
                damping = min(better, damping / 2) if np.isfinite(rest) else damping / 4
            z, last = trial, length
            if damping == 1.0 and rest < CONTRACTION * length:  # near: the second step counts too
                z, last = z + simplified, None
                if _size(simplified[:cut]) < SURELY * _size(step[:cut]):
                    return z, k
                residual = tr.residual(z)
    return None


def _norm(step: Array) -> float:
    """Return the length, of which ratios matter alone."""
    return math.sqrt(step @ step)


def _roundoff(tr: Equations, factors: Factors) -> Array:
    """Return a residual (size,) of the size of round-off, of no preferred sign."""
    terms = product(tr.layout, np.abs(factors.nonzeros), tr.magnitudes)
    return EPS * np.cos(np.arange(terms.size)) * terms


def is_roundoff(tr: Equations, z: Array, residual: Array) -> bool:
    """Whether the residual is no larger than the round-off of its own evaluation."""
    magnitude = product(tr.layout, np.abs(tr.kkt(z)), np.abs(z) + tr.magnitudes - 1.0)
    return bool(np.max(np.abs(residual)) <= 4 * EPS * np.max(magnitude))


def _size(step: Array) -> float:
    """Return the largest magnitude."""
    return float(np.maximum.reduce(np.abs(step))) if step.size else 0.0
