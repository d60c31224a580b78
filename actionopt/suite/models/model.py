"""A program that is written down and its answer, from a closed form or proven by its conditions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from actionopt.suite.member import Member, Stationary
from actionopt.suite.models.expressions import WrittenProgram
from actionopt.tools.shown import one_line
from actionopt.tools.types import Array


@dataclass(frozen=True, eq=False)
class KnownAnswer:
    """What is known of a model.

    Parameters
    ----------
    x, lam : (n,), (m,) array
        The optimum and its multipliers. Where nothing is feasible, x violates the rows least, and
        lam proves that.
    how : str
        How it is known, in words.
    index : int or None
        Directions that lower f there along what is feasible; None where it is degenerate.
    others : sequence of Stationary
        Other stationary points.
    least : float, optional
        Where nothing is feasible: of lam'c(x), for all x.
    """

    x: Array
    lam: Array
    how: str
    index: int | None = 0
    others: Sequence[Stationary] = ()
    least: float | None = None

    __repr__ = one_line


class Model(Member):
    """A member with one starting point, whose answer is made when it is first asked for.

    Parameters
    ----------
    start : (n,) array
    answer : callable
        Returns the `KnownAnswer`; it is called once.
    tags : tuple of str
    """

    def __init__(
        self, *, start: Array, answer: Callable[[], KnownAnswer], tags: tuple[str, ...] = ()
    ) -> None:
        self._start, self._answer, self._tags = start, answer, tags

    def __repr__(self) -> str:
        """Show the name, the class and the size."""
        return f"{type(self).__name__}({self.name}, {self.classification})"

    @property
    def tags(self) -> tuple[str, ...]:
        """What is special about it."""
        return self._tags

    @property
    def unbounded(self) -> bool:
        """No model is."""
        return False

    @property
    def default_start(self) -> str:
        """The only one."""
        return "own"

    @property
    def start_names(self) -> tuple[str, ...]:
        """Names of the starting points."""
        return ("own",)

    def start(self, name: str | None = None) -> Array:
        """Return the starting point x0, (n,); raises ValueError for another name than "own"."""
        if name not in (None, "own"):
            raise ValueError(f"expected the starting point 'own', found {name!r}")
        return np.array(self._start, dtype=float)

    # -- what is known -----------------------------------------------------------------------

    @cached_property
    def answer(self) -> KnownAnswer:
        """What is known."""
        return self._answer()

    @property
    def x_star(self) -> Array:
        """The optimum, (n,)."""
        return self.answer.x

    @property
    def lam_star(self) -> Array:
        """Its multipliers, (m,)."""
        return self.answer.lam

    @property
    def f_star(self) -> float:
        """F there."""
        return self._objective(self.x_star)

    @property
    def f_unit(self) -> float:
        """How far f falls from the start."""
        return abs(self._objective(self._start) - self.f_star)

    @property
    def index_star(self) -> int | None:
        """Number of directions that lower f there."""
        return self.answer.index

    @property
    def others(self) -> tuple[Stationary, ...]:
        """Other stationary points."""
        return tuple(self.answer.others)

    @property
    def infeasible(self) -> bool:
        """Whether nothing is feasible."""
        return self.answer.least is not None

    @property
    def kind(self) -> str:
        """What the optimum is: "minimum", "saddle", "degenerate"; "infeasible" if there is none."""
        return "infeasible" if self.infeasible else super().kind

    @property
    def lowest(self) -> float:
        """The least f that is known of a minimum; infinite if there is none."""
        return np.inf if self.infeasible else super().lowest

    @property
    def margin(self) -> float:
        """How much lam'c exceeds what is allowed, for all x; proves that none is feasible."""
        lam, (lower, upper) = self.lam_star, self.constraint_bounds
        used = np.where(lam > 0, upper, lower)[lam != 0]
        return (self.answer.least or 0.0) - float(lam[lam != 0] @ used)

    @property
    def least_violation(self) -> float:
        """The largest violation of a row is nowhere less than that."""
        return self.margin / float(np.sum(np.abs(self.lam_star))) if self.infeasible else 0.0

    @property
    def known_by(self) -> dict[str, str]:
        """How it is known."""
        return dict.fromkeys(("x_star", "f_star", "lam_star", "index_star"), self.answer.how)

    # -- judging -----------------------------------------------------------------------------

    def nearest(self, x: Array, reach: float) -> Stationary | None:
        """Return the known stationary point within `reach` of x, in `unit`; None if none is."""
        every = (self.optimum, *self.others)
        near = min(every, key=lambda s: self.distance(x, s.x))
        return near if self.distance(x, near.x) <= reach else None

    def residual(self, x: Array) -> float:
        """Return how far x is from the nearest known stationary point, in units of x."""
        return min(self.distance(x, s.x) for s in (self.optimum, *self.others))

    def violation(self, x: Array) -> float:
        """Return how far x, in its units, or c is outside its bounds."""
        lower, upper = self.bounds
        outside = [np.zeros(1), (lower - x) / self.unit, (x - upper) / self.unit]
        if self.m:
            c, (low, high) = self._constraints(x), self.constraint_bounds
            outside += [low - c, c - high]
        return float(np.max(np.concatenate(outside)))


DENSE_UNKNOWNS = 500  # beyond which eigenvalues take long, and only known points are looked at
STEPS_TO_A_POINT = 20


class WrittenModel(Model, WrittenProgram):
    """A model of mechanics as a nonlinear program, with its answer.

    Parameters
    ----------
    name, x, f, c, written
        As of `WrittenProgram`.
    start, answer, tags
        As of `Model`.
    """

    def __init__(
        self,
        name: str,
        x: ca.SX,
        f: ca.SX,
        c: ca.SX | None = None,
        *,
        start: Array,
        answer: Callable[[], KnownAnswer],
        tags: tuple[str, ...] = (),
        **written: Any,
    ) -> None:
        Model.__init__(self, start=start, answer=answer, tags=tags)
        WrittenProgram.__init__(self, name, x, f, c, **written)

    @property
    def _free(self) -> bool:
        """Whether Newton's method can look for stationary points."""
        return not (self.m or self.has_bounds) and self.n <= DENSE_UNKNOWNS

    def _bending(self, x: Array) -> Array:
        """Return the Hessian of f, dense."""
        return self.slope_and_curvature(x)[1].full()

    def _step(self, x: Array) -> Array:
        try:
            return -np.linalg.solve(self._bending(x), self._gradient(x))
        except np.linalg.LinAlgError:
            return np.full(self.n, np.nan)

    def nearest(self, x: Array, reach: float) -> Stationary | None:
        """Return a stationary point within `reach` of x, in `unit`; None if none is found.

        A known one, or, without bounds and rows, one that Newton's method finds.
        """
        known = super().nearest(x, reach)
        if known is not None or not self._free:
            return known
        there, step = np.asarray(x, dtype=float), np.full(self.n, np.inf)
        for _ in range(STEPS_TO_A_POINT):
            step = self._step(there)
            there = there + step
            if not self.distance(there, x) <= reach:  # NaN as well
                return None
        if not np.max(np.abs(step / self.unit)) <= 1e-9:
            return None
        scaled = self._bending(there) * self.unit * self.unit[:, None]
        low = int(np.sum(np.linalg.eigvalsh(scaled) < 0))
        return Stationary(there, self._objective(there), low)

    def residual(self, x: Array) -> float:
        """Return how far Newton's method would step from x, in units of x.

        With bounds or rows, how far the nearest known stationary point is.
        """
        if not self._free:
            return super().residual(x)
        step = np.abs(self._step(np.asarray(x, dtype=float)) / self.unit)
        return float(np.nan_to_num(np.max(step), nan=np.inf))
