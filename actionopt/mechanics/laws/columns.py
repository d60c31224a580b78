"""Evaluate a CasADi function at very many times, one instruction after the other by numpy.

CasADi goes through the instructions anew for every time, which costs more than what they do. Here
each is one call of numpy for as many times as the processor's cache has room for.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca
import numpy as np

from actionopt.tools.tape import instructions
from actionopt.tools.types import Array

# Times of one call; measured: half as many take up to a tenth longer, twice as many as long.
TIMES_PER_CALL = 8192


def _twice(x: Array, out: Array | None = None) -> Array:
    return np.add(x, x, out)


def _if_else_zero(condition: Array, value: Array, out: Array | None = None) -> Array:
    return np.multiply(1.0, np.where(condition != 0, value, 0.0), out)


_NAMED: dict[str, Callable[..., Any]] = {
    "ASSIGN": np.positive, "NEG": np.negative, "EXP": np.exp, "LOG": np.log, "SQRT": np.sqrt,
    "SQ": np.square, "TWICE": _twice, "INV": np.reciprocal,
    "SIN": np.sin, "COS": np.cos, "TAN": np.tan, "ASIN": np.arcsin, "ACOS": np.arccos,
    "ATAN": np.arctan, "SINH": np.sinh, "COSH": np.cosh, "TANH": np.tanh, "ASINH": np.arcsinh,
    "ACOSH": np.arccosh, "ATANH": np.arctanh, "FABS": np.fabs, "SIGN": np.sign,
    "FLOOR": np.floor, "CEIL": np.ceil, "NOT": np.logical_not, "LOG1P": np.log1p,
    "EXPM1": np.expm1,
    "ADD": np.add, "SUB": np.subtract, "MUL": np.multiply, "DIV": np.divide, "POW": np.power,
    "CONSTPOW": np.power, "LT": np.less, "LE": np.less_equal, "EQ": np.equal,
    "NE": np.not_equal, "AND": np.logical_and, "OR": np.logical_or, "FMOD": np.fmod,
    "COPYSIGN": np.copysign, "FMIN": np.fmin, "FMAX": np.fmax, "ATAN2": np.arctan2,
    "HYPOT": np.hypot, "IF_ELSE_ZERO": _if_else_zero,
}  # fmt: skip
UFUNCS = {getattr(ca, f"OP_{name}"): ufunc for name, ufunc in _NAMED.items()}


class Columns:
    """A function of one time, evaluated at points of many members.

    Parameters
    ----------
    function : casadi.Function
        Of SX expressions, with dense column inputs.

    Raises
    ------
    ValueError
        For an instruction that numpy has no function for.
    """

    def __init__(self, function: ca.Function) -> None:
        self.widths = [function.nnz_out(k) for k in range(function.n_out())]
        self._registers, last = function.sz_w(), function.n_in() - 1
        self._places: dict[tuple[str, Any], int] = {}  # of each kind of value, by its number
        # Operations of the last input alone, which seldom differs from time to time, and others:
        # the places of the operands and of what comes of them.
        self._first: list[tuple[Any, list[int], int]] = []
        self._program: list[tuple[Any, list[int]]] = []
        # The places of what registers hold; who are of that input; what the last operation made.
        held, same, fresh = dict[int, int](), set[int](), None
        for code, to, at, value in instructions(function):
            if code == ca.OP_CONST:
                held[to[0]] = self._place(f"number {value}", value)  # -0 is another one than 0
                same.add(held[to[0]])
            elif code == ca.OP_INPUT:
                held[to[0]] = self._place("input", tuple(at))
                if at[0] == last:
                    same.add(held[to[0]])
            elif code == ca.OP_OUTPUT:
                there = self._place("output", tuple(to))
                if held[at[0]] == fresh:
                    self._program[-1][1][-1] = held[at[0]] = there
                else:
                    self._program.append((np.positive, [held[at[0]], there]))
                fresh = None
            elif code not in UFUNCS:
                raise ValueError(f"expected instructions that numpy knows, found number {code}")
            elif same.issuperset(here := [held[i] for i in at]):
                held[to[0]] = self._place("first", len(self._first))
                same.add(held[to[0]])
                self._first.append((UFUNCS[code], here, held[to[0]]))
            else:
                held[to[0]] = fresh = self._place("register", to[0])
                self._program.append((UFUNCS[code], [*here, held[to[0]]]))

    def _place(self, kind: str, which: Any) -> int:
        return self._places.setdefault((kind, which), len(self._places))

    def __call__(self, points: int, members: int, inputs: Sequence[Array]) -> list[Array]:
        """Return the nonzeros of every output, (points, nonzeros, members).

        Inputs are (points, rows, members), or have length one where they are the same for all.
        """
        found = [np.empty((points, width, members)) for width in self.widths]
        step = min(max(TIMES_PER_CALL // members, 1), points)
        memory = np.empty((self._registers, step, members))
        with np.errstate(all="ignore"):
            for first in range(0, points, step):
                here = slice(first, min(first + step, points))
                parts = [x if len(x) == 1 else x[here] for x in inputs]
                self._run(memory[:, : here.stop - first], parts, [x[here] for x in found])
        return found

    def _run(self, own: Array, inputs: list[Array], outputs: list[Array]) -> None:
        """Run through the instructions for some points."""
        values: list[Any] = []
        for kind, which in self._places:
            if kind == "register":
                values.append(own[which])
            elif kind in ("input", "output"):
                k, row = which
                values.append((inputs if kind == "input" else outputs)[k][:, row])
            else:
                values.append(which)
        for ufunc, at, to in self._first:
            values[to] = 1.0 * ufunc(*[values[i] for i in at])  # a number, if it was a truth
        for ufunc, at in self._program:
            ufunc(*[values[i] for i in at])
