"""A program of which only values are known: no derivatives, no expression."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from actionopt.suite.models.model import KnownAnswer, Model
from actionopt.suite.program import Program
from actionopt.tools.types import Array, NDInt


class BlackBox(Program):
    """Values f(x), x (n,), without bounds or constraints.

    Parameters
    ----------
    name : str
    function : callable
        f(x).
    n : int
    """

    def __init__(self, name: str, function: Callable[[Array], float], n: int) -> None:
        Program.__init__(self)
        self._name, self._function, self._n = name, function, n

    def view(self) -> Program:
        """Return the same function with counts of its own, and no answer anywhere near."""
        return BlackBox(self._name, self._function, self._n)

    @property
    def smooth(self) -> bool:
        """It has no derivatives."""
        return False

    @property
    def functions(self) -> tuple[str, ...]:
        """A solver is given values alone."""
        return ("objective",)

    @property
    def name(self) -> str:
        """Its name."""
        return self._name

    @property
    def n(self) -> int:
        """Number of unknowns."""
        return self._n

    @property
    def m(self) -> int:
        """There are no rows."""
        return 0

    @property
    def variable_names(self) -> list[str]:
        """Names "x[0]" and so on."""
        return [f"x[{k}]" for k in range(self.n)]

    @property
    def constraint_names(self) -> list[str]:
        """There are none."""
        return []

    @property
    def classification(self) -> str:
        """The class in the manner of CUTEst: Other, Unconstrained, Irregular."""
        return f"OUI0-MN-{self.n}-0"

    @property
    def unit(self) -> Array:
        """Size of each unknown, (n,)."""
        return np.ones(self.n)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """There are none."""
        return np.full(self.n, -np.inf), np.full(self.n, np.inf)

    @property
    def constraint_bounds(self) -> tuple[Array, Array]:
        """There are none."""
        return np.zeros(0), np.zeros(0)

    @property
    def linear_rows(self) -> NDArray[np.bool_]:
        """There are none."""
        return np.zeros(0, dtype=bool)

    @property
    def jacobian_structure(self) -> tuple[NDInt, NDInt]:
        """It has no entries."""
        return np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp)

    @property
    def hessian_structure(self) -> tuple[NDInt, NDInt]:
        """There is no Hessian."""
        return self.jacobian_structure

    def _objective(self, x: Array) -> float:
        return float(self._function(np.asarray(x, dtype=float)))

    def _refuse(self, *_: Any) -> NoReturn:
        raise ValueError(
            f"expected a method that uses values of f alone: {self.name} has no derivatives"
        )

    expression = _gradient = _constraints = _jacobian = _hessian = _refuse


class BlackModel(Model, BlackBox):
    """A model of which only values are known to solvers, with its answer.

    Parameters
    ----------
    name, function
        As of `BlackBox`.
    start, answer, tags
        As of `Model`.
    f_star : float
        f at the optimum, without the noise.
    """

    def __init__(
        self,
        name: str,
        function: Callable[[Array], float],
        *,
        start: Array,
        answer: Callable[[], KnownAnswer],
        tags: tuple[str, ...] = (),
        f_star: float,
    ) -> None:
        Model.__init__(self, start=start, answer=answer, tags=tags)
        BlackBox.__init__(self, name, function, start.size)
        self._f_star = f_star

    @property
    def f_star(self) -> float:
        """F at the optimum, without the noise."""
        return self._f_star
