"""The laws of a system as functions of CasADi's, for programs that are written with it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import casadi as ca
import numpy as np

from actionopt.mechanics.laws.laws import Laws
from actionopt.mechanics.laws.tracing import ParameterTable
from actionopt.tools.types import Array


class ParameterInputs(NamedTuple):
    """The parameters as inputs of a function: names, symbols, all in one column, and defaults."""

    names: list[str]
    symbols: list[ca.MX]
    packed: ca.MX
    defaults: list[float]

    @classmethod
    def of(cls, table: ParameterTable, values: Mapping[str, Array], taken: list[str]):
        """Return the inputs of a table's parameters; `taken` are names of other inputs and outputs.

        A parameter whose name is taken, or not allowed by CasADi, is called by its number.
        One number is the default of an input: of an array whose entries differ it is NaN.
        """
        names, symbols, columns, defaults = [], [], [ca.MX(0, 1)], []
        for k, (name, shape) in enumerate(table.shapes.items()):
            good = ca.Function.check_name(name) and name not in taken
            names.append(name if good else f"parameter_{k + 1}")
            rows, cols = (*shape, 1, 1)[:2]
            symbols.append(ca.MX.sym(names[-1], rows, cols))
            columns.append(ca.vec(symbols[-1].T))  # row by row, as numpy stores it
            same = np.unique(values[name])
            defaults.append(float(same[0]) if same.size == 1 else np.nan)
        return cls(names, symbols, ca.vertcat(*columns), defaults)


def dynamics_function(laws: Laws, table: ParameterTable) -> ca.Function:
    """Return a(q, v, t, parameters) and lambda as `System.dynamics_function` says.

    By sparse elimination with the matrix of the index-1 equations, which CasADi differentiates.
    """
    s, n, m = laws.symbols, laws.n, laws.m
    M, bias, G, gamma = laws.motion
    K = ca.blockcat([[M, -G.T], [G, ca.SX(m, m)]])
    equations = ca.Function("equations", [s.q, s.v, s.t, s.p], [K, ca.vertcat(bias, -gamma)])
    names = ["q", "v", "t", "a", "lam"]
    given = ParameterInputs.of(table, table.defaults, names)
    state = [ca.MX.sym(name, size) for name, size in zip("qvt", (n, n, 1), strict=True)]
    matrix, right = equations(*state, given.packed)
    solved = ca.solve(matrix, right, "qr", {"eps": 0.0})
    return ca.Function(
        "dynamics",
        [*state, *given.symbols],
        [solved[:n], solved[n:]],
        [*names[:3], *given.names],
        names[3:],
        {"default_in": [0.0, 0.0, 0.0, *given.defaults]},
    )
