"""A path on a mesh, and how far it is from the continuous one.

A stationary path of the discrete action differs from the continuous one by what its polynomials
leave out, amplified: a change of the forces along the path by delta moves it by gain * delta. The
omitted Legendre coefficients say how large delta is, and the change of the path from the last mesh
to this one, over what the last one had omitted, how large the gain. To that comes round-off, which
the last step of Newton's method shows, amplified alike, and that of the polynomial's evaluation:

    error = SAFETY (gain * omitted + noise + POLYNOMIAL_ROUNDOFF).
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import field
from typing import TYPE_CHECKING, Any, Self, TypeVar

import numpy as np

from actionopt.discrete.action.equations import Equations
from actionopt.discrete.matrices.factors import Factors
from actionopt.discrete.meshes.resolution import Resolution, resolution
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.discrete.newton.increments import factorize
from actionopt.discrete.newton.newton import Followed
from actionopt.mechanics.laws.laws import Structure
from actionopt.mechanics.question.problem import Problem
from actionopt.mechanics.question.scales import NEGLIGIBLE, diagonal
from actionopt.tools.immutable import change, immutable, make_unchecked
from actionopt.tools.types import Array

if TYPE_CHECKING:
    from actionopt.discrete.borders.bordered import Bordered

# Ad hoc, in parts of the time: elements that only singularities need, and that they need first.
TINY_ELEMENT, SHORT_ELEMENT = 1e-6, 1e-2
ROUNDED = 1e-9  # of a size, what may be its round-off along a path; ad hoc
LATE_TIME = 1e3  # durations from zero, where the round-off of times counts: three digits; ad hoc
VELOCITY_ERROR = 10.0  # relative, of spurious paths; on the scenes 0.08 at most
# From the measured error of the last round to the estimate for the next. Measured: it puts 99.1 %
# of the errors in docs/calibration.md below their estimates; three times more or less changes
# iterations by 1 % over the scenes and 40 stress cases, and no status but a kink's.
SAFETY = 4.0
# The gain of paths of higher order under constraints, which hold in the mean and not at points.
# Measured on 80 random questions: without it errors were up to 46 times the estimate, mostly < 1.
HELD_GAIN = 48.0
# The round-off of a polynomial's value, in its own size; derived: an eps each for the sum and for
# the weights.
POLYNOMIAL_ROUNDOFF = 2 * float(np.finfo(float).eps)
ORDINARY = 100.0  # amplification of round-off on a mesh where nothing is sensitive, at most; ad hoc
# Assumed ratio of global to local error before there is a measured one. Measured on the problems of
# docs/calibration.md and 100 pendulums and lattices: 96 to 100 % of the errors are below their
# estimates at any tolerance. Three times more changes iterations by 1 %.
UNKNOWN_GAIN = 5.0
AT_REST = 1e-6  # of its coordinates' sizes, how far a closed path moves that is no rest; ad hoc


Number = TypeVar("Number", float, Array)


@immutable
class Iterate(DiscretePath):
    """A path under way."""

    sizes: Array  # (n,): largest values of the coordinates: the units of errors
    lengths: Array  # (n,): extents of the motion: the units of steps
    gain: float = UNKNOWN_GAIN  # ratio of global to local error
    noise: float = 0.0  # amplified round-off, in units of `sizes`
    error: float = np.inf  # the estimate; infinite where Newton's method has not been at the path
    factors: Factors | None = None  # of the matrix at the path or close to it, if they are kept
    # (size,): the `probe` of the layout after a step of inverse iteration.
    probed: Array | None = None
    since: float = 0.0  # how far it and its multipliers are from where that matrix was taken
    represented: Resolution | None = None  # how well the mesh represents it, where that is known

    @property
    def equations(self) -> Equations:
        """The equations that it is to solve: those of the path alone."""
        return self.tr

    @property
    def reach(self) -> float:
        """How far it moves, in its sizes, as a duration that is sought grows in its own."""
        return 0.0

    def with_values(self, **known: Any) -> Self:
        """Return the same path with other values of what is known; what was worked out is kept."""
        return make_unchecked(type(self), **vars(self) | known)

    def moved(self, z: Array) -> Self:
        """Return another path on the same mesh, of which nothing more is known."""
        tr = self.equations.at(z)
        return change(self, tr=tr, z=z, factors=None, probed=None, represented=None)

    def bare(self) -> Self:
        """Return the iterate without its factors, which take memory."""
        if self.factors is None and self.probed is None:
            return self
        return self.with_values(factors=None, probed=None)

    def at_result(self, result: Followed) -> Self:
        """Return the path at which Newton's method arrived."""
        tr = self.equations.at(result.z)
        z, Q = result.z, tr.coordinates(result.z)
        if tr.origin is None and np.abs(Q).max() <= NEGLIGIBLE * tr.lengths.max():
            z = z.copy()  # a rest at zero, but for the round-off of where it was
            z[: tr.layout.unknowns] = 0.0
            Q = tr.coordinates(z)
        sizes, lengths = coordinate_scales(tr.problem, Q)
        shown = resolution(tr.mesh, Q, sizes)
        known = {"sizes": sizes, "lengths": lengths, "represented": shown, "probed": None}
        unit = self._unit(sizes)
        known |= _estimate(max(self.gain, self._least_gain), result.noise * unit, unit, shown)
        known |= {"factors": result.factors, "since": result.since}
        return change(self, tr=tr, z=z, **known)

    def with_error(self, gain: float, noise: float | None = None) -> Self:
        """Return the iterate with the estimate of its error for a gain, and of its noise.

        The gain is at least what amplified round-off says that other errors are amplified.
        """
        noise = self.noise if noise is None else noise
        gain = max(gain, self._least_gain)
        return self.with_values(**_estimate(gain, noise, self.unit, self.resolution))

    @property
    def _least_gain(self) -> float:
        """The least factor by which what the mesh leaves out counts in the error."""
        layout = self.tr.layout
        return HELD_GAIN if layout.rows and self.tr.order > 1 else 0.0

    @property
    def resolution(self) -> Resolution:
        """How well the mesh represents it."""
        return self.represented or resolution(self.mesh, self.Q, self.sizes)

    @property
    def rough(self) -> float:
        """The largest coefficient that the mesh leaves out, in units of the motion."""
        return self.resolution.worst * float((self.sizes / self.lengths).max())

    @property
    def index(self) -> int:
        """The number of variations on the mesh that lower the action."""
        layout = self.tr.layout
        if self.tr.order > 1 and self.problem.touches:
            return _index_in_contact(self)
        factors = self.factors or factorize(self.tr, self.z)
        return factors.negative() - layout.rows

    @property
    def unit(self) -> float:
        """The largest factor from steps in the solver's units to those in the path's own sizes."""
        return self._unit(self.sizes)

    def _unit(self, sizes: Array) -> float:
        unit = self.tr.lengths if self.tr.origin is None else self.tr.lengths + abs(self.tr.origin)
        return max(1.0, float((unit / sizes).max()))

    def with_factors(self, many: bool) -> Self:
        """Return the iterate with factors of its matrix; `many` as `Factors` has it."""
        if self.factors is not None:
            return self
        equations = self.equations
        return self.with_values(factors=factorize(equations, self.z, many=many))

    def with_fresh_factors(self) -> Self:
        """Return the iterate with factors of the matrix at the path, not near it."""
        if self.factors is None:
            return self
        factors = self.factors.near(self.equations.kkt(self.z))
        return self.with_values(factors=factors, probed=None, since=0.0)

    def quadrature_shift(self, tol: float, many: bool) -> tuple[float, Self]:
        """Return how far the path would move if its forces were summed over other points.

        Nothing is missed where they are linear in the path and do not depend on time. And the
        iterate, with what was found on the way: one factorization may serve for the `probe`.
        """
        if self.problem.system.structure.steady_forces:
            return 0.0, self
        here = self.with_factors(many)
        assert here.factors is not None
        residual, carried = unseen(self, tol / self.unit)
        with np.errstate(all="ignore"):
            if self.can_be_one_of_many and here.factors.pairs:
                step, probed = here.factors.solve_both(residual, here.probe_momentum)
                here = here.with_values(probed=probed)
            else:
                step = here.factors.solve(residual)
        return max(self.equations.relative_step(step), carried) * self.unit, here

    @property
    def can_be_one_of_many(self) -> bool:
        """Whether ends may leave a family of paths that the path's own round-off does not show."""
        system = self.problem.system
        return (system.n > 1 or self.problem.may_be_shifted) and not system.structure.forced

    def with_probed(self, many: bool) -> Self:
        """Return the iterate with `probed`, a step of inverse iteration; `many` as above."""
        if self.probed is not None:
            return self
        here = self.with_factors(many)
        assert here.factors is not None
        return here.with_values(probed=here.factors.solve(here.probe_momentum))

    @property
    def growth(self) -> float:
        """The factor by which that step makes the variation grow, once it has been taken.

        In the kinetic metric (Golub and Van Loan, *Matrix Computations* (4th ed. 2013), section
        7.6): 1 / |mu| or less, for the eigenvalue mu of the second variation that is nearest zero.
        """
        assert self.probed is not None
        unit = self.tr.kinetic_unit
        if not unit.size:
            return 0.0
        begun = self.tr.layout.probe[: unit.size]
        return float(np.abs(self.probed[: unit.size] / unit).max() / np.abs(begun).max())

    def impulse_gain(self, many: bool) -> tuple[float, Self]:
        """Return how much farther an impulse moves the path than a free body, at least one.

        And the iterate, with what was found on the way.
        """
        try:
            here = self.with_probed(many)
        except np.linalg.LinAlgError:
            return np.inf, self
        return max(1.0, here.growth), here

    def with_larger_noise(self) -> Self:
        """Return the iterate with the larger noise of two samples: one may be small by chance.

        The other is what the residual asks for after the step that the first one was.
        """
        here, equations, z = self.with_factors(many=False), self.equations, self.z
        assert here.factors is not None
        step = here.factors.solve(equations.residual(z))
        noise = (
            equations.relative_step(here.factors.solve(equations.residual(z - step))) * self.unit
        )
        return here.with_error(here.gain, max(here.noise, noise))

    @property
    def probe_momentum(self) -> Array:
        """The momentum (size,) of the `probe` of inverse iteration, as `equations` have it.

        Where a constant is a variation, with what is as large for one, which has no rates: the path
        may be a rest, and one of a family of them.
        """
        from actionopt.discrete.borders.borders import shares

        tr, found = self.tr, np.zeros(self.equations.layout.size)
        x = tr.probe
        found[: x.size] = tr.probe_momentum
        if max(len(event.pinned) for event in self.problem.joints) < self.problem.system.n:
            mass = diagonal(self.problem.system, 2, tr.inertia[None])[0]
            unit = tr.x_unit**2 / (tr.action_unit * tr.mesh.duration ** (2 * tr.order - 1))
            found[: x.size] += shares(tr) * mass[tr.layout.free % mass.size] * unit * x
        return found

    @property
    def late(self) -> bool:
        """Whether times matter and are rounded more coarsely than what happens in them."""
        start, end = self.problem.start.t, self.problem.end.t
        far = max(abs(start), abs(end)) > LATE_TIME * (end - start)
        return far and self.problem.system.structure.depends_on_time

    @property
    def is_misread(self) -> bool:
        """Whether what is given may be rounded more coarsely than Newton's last step shows."""
        return self.late

    def misread(self) -> float:
        """Return how far the path moves if what is given is read as the numbers next to it.

        That is the round-off of times, coordinates and integrals; zero where times and coordinates
        are near zero: there it is that of all numbers.
        """
        if not self.is_misread and self.tr.origin is None:
            return 0.0
        equations = self.equations
        factors = factorize(equations, self.z)
        return equations.relative_step(factors.solve(equations.misread(self.z))) * self.unit

    @property
    def singular(self) -> bool:
        """Whether the path is known and its velocity is not: it runs through a singularity.

        Only where the mesh has been refined out of proportion.
        """
        if self.tr.order > 1:
            return False
        mesh, duration = self.mesh, self.problem.duration
        shortest = mesh.lengths.min() / duration
        if shortest > SHORT_ELEMENT:
            return False
        k, speeds = np.array(mesh.degrees) + 1, np.abs(self.tr.place(self.x).v).max(axis=0)
        speeds = np.maximum(speeds, self.sizes / duration)
        rates = self.resolution.omitted * k * (k + 1) / mesh.lengths
        limit = VELOCITY_ERROR if shortest > TINY_ELEMENT else 1.0
        return bool(rates.max() * (self.sizes / speeds).max() > limit)


@immutable
class UnfixedPath(Iterate):
    """A path under way with what is found beside it: z are the unknowns of `bordered`."""

    bordered: Bordered = field(kw_only=True)

    @property
    def equations(self) -> Bordered:
        """The equations that it is to solve: those of the path, and of what is beside it."""
        return self.bordered

    @property
    def reach(self) -> float:
        """How far it moves, in its sizes, as a duration that is sought grows in its own."""
        return self.bordered.reach

    @property
    def is_misread(self) -> bool:
        """Whether times are, or integrals are given: where they hardly change, this tells much."""
        return self.late or self.bordered.problem.integral is not None

    @property
    def index(self) -> int:
        """The number of variations on the mesh that lower W, those of times and phases besides."""
        bordered = self.bordered
        if self.tr.order > 1 and self.problem.touches:
            return _index_in_contact(bordered.discrete(self.z))
        factors = self.factors
        if factors is None or bordered.phases:  # with phases that matrix is not symmetric
            factors = factorize(bordered, self.z, nonzeros=bordered.symmetric_kkt(self.z))
        return factors.negative() - int(bordered.is_multiplier.sum())

    @property
    def push_force(self) -> float:
        """The forces that hold a closed path, in its units and sizes: none hold a motion."""
        forces = self.z[self.bordered.forces]
        largest, size = np.abs(forces).max(initial=0.0), np.abs(self.x).max()
        return float(largest / (size or 1.0))  # a rest at zero has no size but its unit

    @property
    def moves(self) -> bool:
        """Whether the path moves at all."""
        return not is_at_rest(self.Q, self.tr.lengths.max())


def _index_in_contact(at: DiscretePath) -> int:
    """Return the index of a path with accelerations along an obstacle.

    Rows of a high degree nearly depend on one another there, and factors do not tell signs.
    """
    from actionopt.analysis.quadratic.index import inertia_through

    with suppress(ValueError):
        return inertia_through(at, 0.0).index
    return 1  # L is not convex in the accelerations


def _estimate(gain: float, noise: float, unit: float, shown: Resolution) -> dict[str, float]:
    """Return gain, noise and error as `Iterate` has them."""
    gain = max(gain, amplification(noise) / unit)
    return {"gain": gain, "noise": noise, "error": estimate(gain, shown.by_rate, noise)}


def estimate(gain: Number, omitted: Number, noise: Number) -> Number:
    """Return the estimate of the error; as well for arrays."""
    return SAFETY * (gain * omitted + noise + POLYNOMIAL_ROUNDOFF)


def amplification(noise: Number) -> Number:
    """Return how far errors are amplified at least, as noise says; as well for arrays."""
    return noise / (ORDINARY * POLYNOMIAL_ROUNDOFF)


def may_matter(structure: Structure, left: Number, tol: float) -> Any:
    """Return whether what a mesh leaves out may matter to the forces; as well for arrays.

    The narrowest feature that is looked for is a part of the whole in `samples`, and what is left
    out changes its impulse by no more than that share of it.
    """
    return SAFETY * left * structure.samples > tol


def unseen(at: Iterate, tol: float) -> tuple[Array, float]:
    """Return the residual (size,) that another quadrature leaves, and how far that moves the path.

    By what holds the path there, and by what holds it on the whole: where a feature in q is not
    resolved, the curvature that one node happens to see there would hold it far too well. The
    momentum that is missed carries a body 1 / (1 + w T) as far as a free one, w the typical rate.
    """
    with np.errstate(all="ignore"):
        followed = may_matter(at.problem.system.structure, at.resolution.worst, tol)
        residual, carried = at.equations.quadrature_defect(at.z, followed=followed)
        if SAFETY * carried > tol:
            carried /= 1.0 + at.tr.turns(at.z)
        return residual, carried


def is_at_rest(Q: Array, size: float = 0.0) -> bool:
    """Whether coordinates Q (K, n) hardly change beside the largest of them, or beside `size`."""
    return bool(np.ptp(Q, axis=0).max() <= AT_REST * max(np.abs(Q).max(), size))


def coordinate_scales(problem: Problem, Q: Array | None) -> tuple[Array, Array]:
    """Return sizes and lengths (n,) as node coordinates Q (K, n) tell, or the events alone."""
    if Q is None:
        return problem.scales, problem.lengths
    found = sizes(Q, problem.scales)
    if problem.origin is None:
        return found, found
    return found, sizes(Q - problem.origin, problem.lengths)


def sizes(Q: Array, fallback: Array) -> Array:
    """Return the largest |q| of each coordinate along a path, (n,), positive.

    One that is negligible beside another is zero up to rounding, unless `fallback`, the problem's
    own `scales`, says that it is small as it is.
    """
    size = np.abs(Q).max(axis=0)
    largest = size.max()
    if not largest > 0:
        return fallback
    negligible = NEGLIGIBLE * largest
    zero = size <= negligible
    if not zero.any():
        return size
    return np.where(zero & ((size == 0) | (fallback > negligible)), largest, size)
