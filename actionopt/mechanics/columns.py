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

# Times of one call; measured: half or twice as many take up to a tenth longer.
TIMES_PER_CALL = 4096


def _if_else_zero(condition: Array, value: Array, *, out: Array) -> None:
    out[...] = np.where(condition != 0, value, 0.0)


_NAMED: dict[str, Callable[..., Any]] = {
    "ASSIGN": np.positive, "NEG": np.negative, "EXP": np.exp, "LOG": np.log, "SQRT": np.sqrt,
    "SQ": np.square, "TWICE": lambda x, *, out: np.add(x, x, out=out), "INV": np.reciprocal,
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
        self._registers = function.sz_w()
        self._program: list[tuple[Any, Any, Any]] = []
        for code, to, at, value in instructions(function):
            if code == ca.OP_CONST:
                self._program.append(("constant", value, to[0]))
            elif code == ca.OP_INPUT:
                self._program.append(("input", at, to[0]))
            elif code == ca.OP_OUTPUT:
                self._program.append(("output", at[0], to))
            elif code in UFUNCS:
                self._program.append((UFUNCS[code], at, to[0]))
            else:
                raise ValueError(f"expected instructions that numpy knows, found number {code}")

    def __call__(self, points: int, members: int, inputs: Sequence[Array]) -> list[Array]:
        """Return the nonzeros of every output, (points, nonzeros, members).

        Inputs are (points, rows, members), or have length one where they are the same for all.
        """
        found = [np.zeros((points, width, members)) for width in self.widths]
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
        values: list[Any] = list(own)
        own_values = list(own)
        for what, at, to in self._program:
            if what == "input":
                values[to] = inputs[at[0]][:, at[1]]
            elif what == "constant":
                values[to] = at
            elif what == "output":
                outputs[to[0]][:, to[1]] = values[at]
            else:
                out = own_values[to]
                what(*(values[i] for i in at), out=out)
                values[to] = out
