"""A program with known answers, and what an answer is judged by."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np

from actionopt.suite.program import Program
from actionopt.tools.immutable import immutable
from actionopt.tools.types import Array

THINNED = 1 / 0.9  # histories: ad hoc


@immutable
class Stationary:
    """A stationary point that is known: x (n,), f there, and its index.

    The index is the number of directions that lower f along c = 0; None where it is degenerate.
    """

    x: Array
    f: float
    index: int | None

    @property
    def kind(self) -> str:
        """What it is: "minimum", "saddle" or "degenerate"."""
        if self.index is None:
            return "degenerate"
        return "saddle" if self.index else "minimum"


class Member(Program):
    """A program with known answers: where to begin, what is known, and how far an answer is."""

    parameters: Mapping[str, Any] = MappingProxyType({})

    @property
    def origin(self) -> dict[str, Any]:
        """Where it is from."""
        return {}

    @property
    def resolution(self) -> dict[str, int]:
        """Elements and degree of the mesh, where there is one."""
        return {}

    @property
    @abstractmethod
    def tags(self) -> tuple[str, ...]:
        """What is special about it."""

    @property
    @abstractmethod
    def unbounded(self) -> bool:
        """Whether f falls without bound among what is feasible."""

    @property
    def infeasible(self) -> bool:
        """Whether nothing is feasible."""
        return False

    @property
    def least_violation(self) -> float:
        """Nothing violates its bounds less."""
        return 0.0

    @property
    @abstractmethod
    def default_start(self) -> str:
        """The starting point that is meant where none is named."""

    @property
    @abstractmethod
    def start_names(self) -> tuple[str, ...]:
        """Names of the starting points."""

    @abstractmethod
    def start(self, name: str | None = None) -> Array:
        """Return a starting point x0, (n,)."""

    @property
    @abstractmethod
    def x_star(self) -> Array:
        """The optimum, (n,)."""

    @property
    @abstractmethod
    def lam_star(self) -> Array:
        """Its multipliers, (m,)."""

    @property
    @abstractmethod
    def f_star(self) -> float:
        """F there."""

    @property
    @abstractmethod
    def f_unit(self) -> float:
        """Size of f."""

    @property
    @abstractmethod
    def index_star(self) -> int | None:
        """Number of directions that lower f there along c = 0; None where it is degenerate."""

    @property
    @abstractmethod
    def others(self) -> tuple[Stationary, ...]:
        """Other stationary points that are known."""

    @property
    @abstractmethod
    def known_by(self) -> dict[str, str]:
        """How each answer is known, in words."""

    @property
    def kind(self) -> str:
        """What the optimum is: "minimum", "saddle" or "degenerate"."""
        return self.optimum.kind

    @property
    def optimum(self) -> Stationary:
        """All that together."""
        return Stationary(self.x_star, self.f_star, self.index_star)

    @property
    def lowest(self) -> float:
        """The least f that is known of a minimum, or of a degenerate optimum; inf without one."""
        return min(
            (s.f for s in (self.optimum, *self.others) if s.kind != "saddle"), default=np.inf
        )

    @property
    def flat(self) -> Array:
        """Directions along which the optimum is undetermined, orthonormal in `unit`: (n, k)."""
        return np.zeros((self.n, 0))

    # -- judging -----------------------------------------------------------------------------

    def distance(self, x: Array, star: Array | None = None) -> float:
        """Return max |x - x_star| in units of the coordinates, flat directions left out.

        Raises ValueError for anything but (n,) numbers.
        """
        if np.shape(x) != (self.n,):
            raise ValueError(f"expected {self.n} numbers as x, found the shape {np.shape(x)}")
        away = (np.asarray(x) - (self.x_star if star is None else star)) / self.unit
        away = away - self.flat @ (self.flat.T @ away)
        return float(np.max(np.abs(away), initial=0.0))

    @abstractmethod
    def nearest(self, x: Array, reach: float) -> Stationary | None:
        """Return a stationary point within `reach` of x, in `unit`; None if none is found."""

    @abstractmethod
    def residual(self, x: Array) -> float:
        """Return how far x is from a stationary point, in units of the coordinates."""

    @abstractmethod
    def violation(self, x: Array) -> float:
        """Return how far x or c is outside its bounds."""

    def history(self, visited: Sequence[Array]) -> list[tuple[int, float, float]]:
        """Return number, from 1, f and violation of evaluations that were better than all before.

        Better: of less f or less violation than any. Of what is better by less than a tenth, in
        violation or in what f falls still, only some are kept: there can be thousands.
        """
        with np.errstate(all="ignore"):
            f = np.array([self._objective(x) for x in visited])
            v = np.array([self.violation(x) for x in visited])
        usable = np.isfinite(f) & np.isfinite(v)
        end = np.min(f[usable], initial=np.inf)
        kept: list[tuple[int, float, float]] = []
        seen = np.empty((0, 2))
        for k in np.flatnonzero(usable):
            here = THINNED * (f[k] - end), THINNED * v[k]
            if not np.any((seen[:, 0] <= here[0]) & (seen[:, 1] <= here[1])):
                kept.append((int(k) + 1, float(f[k]), float(f"{v[k]:.3g}")))
                seen = np.vstack([seen, (f[k] - end, v[k])])
        return kept
