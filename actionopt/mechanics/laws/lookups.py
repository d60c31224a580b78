"""Functions of one time with tables whose values are parameters, looked up by numpy.

CasADi copies all parameters at each time at which it evaluates a function: tables of N values, read
at a number of times that grows with N, would take N^2. Here two values of a table are taken out of
the parameters at each time, and what the table gives is an argument of what CasADi evaluates.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from actionopt.mechanics.laws.compiled import Pointwise
from actionopt.mechanics.laws.tables import points_of
from actionopt.tools.tape import PIECE, Node, Tape
from actionopt.tools.types import Array, NDInt

VALUE, SLOPE, NUMBER = range(3)  # what is looked up: the last is that of the piece
DERIVATIVE = "fwd1_"  # CasADi's name of a function that is differentiated along a direction


class Lookup(NamedTuple):
    """A table at `points` (N,), whose values are the parameters `of` (N,), and what is wanted."""

    points: Array
    of: NDInt
    wanted: int

    def __call__(self, x: Array, packed: Array) -> Array:
        """Return what is wanted at arguments x (K,), for parameters (1, P) or (K, P)."""
        points, last = self.points, self.points.size - 2
        number = np.searchsorted(points, x, side="right")
        if self.wanted == NUMBER:
            return number
        k = np.clip(number - 1, 0, last)
        row = np.arange(len(packed)) if len(packed) > 1 else 0
        before = packed[row, self.of[k]]
        slope = (packed[row, self.of[k + 1]] - before) / (points[k + 1] - points[k])
        if self.wanted == SLOPE:
            return slope * ((x >= points[0]) & (x < points[-1]))
        return before + (np.clip(x, points[0], points[-1]) - points[k]) * slope


class Looked(Pointwise):
    """A function of one time in which tables are looked up.

    Parameters
    ----------
    function : casadi.Function
        The whole.
    rest, arguments : casadi.Function
        The same with fewer parameters, and what the tables give as the last argument; and the
        arguments of the tables, of the time and these parameters.
    time, parameters : int
        Which arguments these are.
    used : (U,) array of int
        The parameters that are left.
    lookups : list of Lookup
    """

    def __init__(
        self,
        function: ca.Function,
        rest: ca.Function,
        arguments: ca.Function,
        time: int,
        parameters: int,
        used: NDInt,
        lookups: list[Lookup],
    ) -> None:
        super().__init__(function)
        self._given = rest, arguments, time, parameters, used, lookups
        self._rest, self._arguments = Pointwise(rest), Pointwise(arguments)

    def __reduce__(self) -> tuple:
        """Copy the functions."""
        return Looked, (self.function, *self._given)

    def __call__(self, *arguments: Array) -> list[Array]:
        """Return the nonzeros of every output, as `Pointwise` does."""
        _, _, time, parameters, used, lookups = self._given
        given = list(arguments)
        t, packed = given[time], given[parameters]
        if len(packed) > len(t):
            t = np.broadcast_to(t, (len(packed), 1))
        given[parameters] = packed[:, used]
        found = np.empty((len(t) if lookups else 1, len(lookups)))
        if lookups:
            x = self._arguments(t, given[parameters])[0]
            for k, lookup in enumerate(lookups):
                found[:, k] = lookup(x[:, k], packed)
        return self._rest(*given, found)

    def forget(self) -> None:
        """Free the memory: where the function was evaluated last."""
        self._rest.forget()
        self._arguments.forget()


def tables_in(law: Tape) -> dict[str, Array]:
    """Return the points (N,) of the tables of a law whose values are no numbers, by their names."""
    called = {node.function.name(): node.function for node in law.nodes if node.function}
    return {
        name: points_of(function)
        for name, function in called.items()
        if PIECE in function.name_out() and function.n_in() > 1
    }


def _lookup(
    call: Node, operands: list[Node], tables: Mapping[str, Array], parameters: int
) -> Lookup | None:
    """Return what a call looks up in one of the tables; None if it is of none, or as they are not.

    The values of a table are entries of the input `parameters`, and derivatives are by the
    argument: the operands are the argument, the values, and of a derivative its direction.
    """
    points = tables.get(call.function.name().removeprefix(DERIVATIVE))
    if points is None:
        return None
    values, along = operands[1 : points.size + 1], operands[points.size + 1 :]
    if any(x.kind != "input" or x.entry[0] != parameters for x in values):
        return None
    if any(x.kind != "constant" or x.value for x in along[1:]):
        return None
    wanted = SLOPE if along else NUMBER if call.nonzero else VALUE
    return Lookup(points, np.array([x.entry[1] for x in values]), wanted)


def evaluator(
    name: str,
    inputs: Sequence[ca.SX],
    outputs: Sequence[ca.SX],
    time: ca.SX,
    parameters: ca.SX,
    tables: Mapping[str, Array],
) -> Pointwise:
    """Return a function of one time of `inputs`; tables with these points are looked up in it.

    Where that can be: they are of the time, and their values are parameters.
    """
    function = ca.Function(name, inputs, outputs)
    places = [k for x in (time, parameters) for k, y in enumerate(inputs) if y is x]
    if not tables or len(places) < 2:
        return Pointwise(function)
    at, of = places
    symbols: list[ca.SX] = []
    lookups: list[Lookup] = []
    places_of: list[ca.SX] = []
    lost = False

    def write(node: Node, operands: list[tuple[ca.SX, frozenset[int], Node]]) -> Any:
        """Return an expression, the inputs in which it is, and the node."""
        nonlocal lost
        if node.kind == "input":
            k, row = node.entry
            return inputs[k][row], frozenset([k]), node
        if node.kind == "constant":
            return ca.SX(node.value), frozenset(), node
        depends = frozenset().union(*(x[1] for x in operands))
        if node.function is None:
            return node.of([x[0] for x in operands]), depends, node
        found = _lookup(node, [x[2] for x in operands], tables, of)
        if found is None or not operands[0][1] <= {at, of}:
            lost = True
            return ca.SX(0), depends, node
        lookups.append(found)
        places_of.append(operands[0][0])
        symbols.append(ca.SX.sym(f"looked{len(symbols)}"))
        along = operands[found.points.size + 1][0] if found.wanted == SLOPE else 1
        return symbols[-1] * along, depends, node

    tape = Tape(inputs, outputs)
    made = tape.fold(write)
    if lost:
        return Pointwise(function)
    made = [
        ca.SX(y.sparsity(), ca.vertcat(*[made[row[k]][0] for k in y.sparsity().find()]))
        for y, row in zip(outputs, tape.results, strict=True)
    ]
    given = ca.vertcat(*symbols) if symbols else ca.SX.sym("none", 0)
    left = {x.name() for y in (*made, *places_of) for x in ca.symvar(y)}
    used = np.array([k for k, x in enumerate(ca.vertsplit(parameters)) if x.name() in left])
    few = parameters[used.tolist()] if used.size else ca.SX.sym("none", 0)
    fewer = [few if k == of else x for k, x in enumerate(inputs)]
    rest = ca.Function(name, [*fewer, given], made)
    arguments = ca.Function("arguments", [time, few], [ca.densify(ca.vertcat(*places_of))])
    return Looked(function, rest, arguments, at, of, used.astype(int), lookups)
