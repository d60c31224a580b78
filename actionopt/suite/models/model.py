"""A program that is written down and its answer, from a closed form or proven by its conditions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from actionopt.suite.member import Member, Stationary
from actionopt.suite.models.expressions import WrittenProgram
from actionopt.tools.immutable import immutable
from actionopt.tools.shown import one_line
from actionopt.tools.types import Array


@immutable
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
STEPS_TO_A_POINT, STEP_AT_A_POINT = 20, 1e-9  # the last step, in units of x
# In units of x, bounds and rows as near as that press: far above solvers' tolerances to begin with,
# and less where what is nearly touched does not press.
NEARLY_TOUCHED = (1e-4, 1e-5, 1e-6)
PULLED = 1e-6  # of the gradient: a multiplier of the wrong sign that is no pull


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

    def _bending(self, x: Array, lam: Array) -> Array:
        """Return the Hessian of f + lam'c, dense."""
        upper = np.zeros((self.n, self.n))
        upper[self.hessian_structure] = self._hessian(x, lam, 1.0)
        return upper + np.triu(upper, 1).T

    def _step(self, x: Array, touched: float) -> tuple[Array, int, bool]:
        """Return Newton's step from x for the conditions of first order, in units of x.

        With it the index, and whether all bounds and rows hold. Of those that x touches, what pulls
        by the multipliers that fit the gradient best is left out.
        """
        slope, unit = self._gradient(x) * self.unit, self.unit
        lower, upper = (
            np.concatenate(s) for s in zip(self.constraint_bounds, self.bounds, strict=True)
        )
        value, rows = np.append(self._constraints(x), x), np.zeros((self.m + self.n, self.n))
        rows[self.jacobian_structure] = self._jacobian(x)
        rows[self.m + np.arange(self.n), np.arange(self.n)] = 1.0
        rows *= unit
        size = np.linalg.norm(rows, axis=1)
        low, high = value - lower <= touched * size, upper - value <= touched * size
        equal = lower == upper
        on = low | high | equal
        lam = np.zeros(on.size)
        if not np.isfinite([*slope, *value, *rows.ravel()]).all():
            return np.full(self.n, np.inf), 0, False
        while True:
            lam[:] = 0.0
            lam[on] = np.linalg.lstsq(rows[on].T, -slope, rcond=None)[0]
            pull = np.where(equal, 0.0, np.where(low, lam, -lam)) * size
            if not on.any() or np.max(pull[on]) <= PULLED * np.linalg.norm(slope):
                break
            on[np.argmax(np.where(on, pull, -np.inf))] = False
        curved = self._bending(x, lam[: self.m]) * unit * unit[:, None]
        off = np.where(low, value - lower, value - upper)[on]
        held = rows[on]
        matrix = np.block([[curved, held.T], [held, np.zeros((held.shape[0],) * 2)]])
        right = -np.append(slope + held.T @ lam[on], off)
        found = np.linalg.lstsq(matrix, right, rcond=None)[0]
        if np.linalg.norm(matrix @ found - right) > PULLED * (1 + np.linalg.norm(right)):
            found[:] = np.inf
        outside = np.maximum(lower - value, value - upper) > touched * size
        rank = np.linalg.matrix_rank(held) if on.any() else 0
        along = np.linalg.svd(held)[2][rank:].T if rank else np.eye(self.n)
        low_ones = int(np.sum(np.linalg.eigvalsh(along.T @ curved @ along) < 0))
        return found[: self.n], low_ones, not outside.any()

    def nearest(self, x: Array, reach: float) -> Stationary | None:
        """Return a stationary point within `reach` of x, in `unit`; None if none is found.

        A known one, or one that Newton's method finds with the bounds and rows that x touches.
        """
        known = super().nearest(x, reach)
        if known is not None or self.n > DENSE_UNKNOWNS:
            return known
        for touched in NEARLY_TOUCHED:
            there = np.array(x, dtype=float)
            for _ in range(STEPS_TO_A_POINT):
                step, index, holds = self._step(there, touched)
                size = np.max(np.abs(step))
                if size <= STEP_AT_A_POINT and holds:
                    return Stationary(there, self._objective(there), index)
                there = there + step * self.unit
                if not self.distance(there, x) <= reach:  # NaN as well
                    break
        return None

    def residual(self, x: Array) -> float:
        """Return how far x is from the nearest stationary point, in units of x.

        One that is known, or, as far as Newton's method would step, another.
        """
        known = super().residual(x)
        if self.n > DENSE_UNKNOWNS:
            return known
        step = np.max(np.abs(self._step(np.asarray(x, dtype=float), NEARLY_TOUCHED[0])[0]))
        return min(known, float(np.nan_to_num(step, nan=np.inf)))
