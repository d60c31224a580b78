"""The smooth branches of a Lagrangian with kinks in q, and the surfaces at which they meet.

|x| is x on one side of x = 0 and -x on the other; minima, comparisons and linear tables are such
functions, too. With the side, or the piece of a table, held for each of them, L is smooth; where a
path changes sides it passes from one law to the next, with the same momentum and energy.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca
import numpy as np

from actionopt.mechanics.laws.compiled import Pointwise
from actionopt.mechanics.laws.switches import KINKS
from actionopt.mechanics.laws.tables import read_table
from actionopt.tools.immutable import immutable
from actionopt.tools.tape import LINEAR_TABLE, Node
from actionopt.tools.types import Array, NDInt

TWO_SIDED = {ca.OP_FABS, ca.OP_SIGN}  # of one operand, whose sign counts
ORDERED = {ca.OP_LT, ca.OP_LE}
LESSER = {*ORDERED, ca.OP_FMIN, ca.OP_FMAX}  # of two, whose order counts
LOGIC = {ca.OP_AND, ca.OP_OR, ca.OP_NOT, ca.OP_IF_ELSE_ZERO}  # of comparisons
SIDES = np.zeros(1)


@immutable
class Branches:
    """Where a Lagrangian has kinks in q."""

    system: Any  # one that imports this module
    arguments: tuple[ca.SX, ...]  # expressions of q, t and parameters
    knots: tuple[Array, ...]  # the values of these at which the branches of each meet, increasing
    evaluate: Pointwise  # the arguments, (K, S), of (q, t, p)

    def pieces(self, x: Array) -> NDInt:
        """Return which piece arguments x (K, S) are on, from 0, for each."""
        found = [np.searchsorted(at, row) for at, row in zip(self.knots, x.T, strict=True)]
        return np.stack(found, axis=1)

    def law(self, pieces: Sequence[int]) -> Any:
        """Return the system on these pieces (S,)."""
        s = self.system

        def build() -> Any:
            given = s.symbols.q, s.symbols.v, s.symbols.t, s.symbols.p
            (law,) = self._template.call([*given, ca.SX(ca.DM(list(pieces)))])
            known = s.coordinates, s.table, s.name, s.source
            return s.of_laws(s.symbols, (law, s.f, s.Q), *known)

        return s.memoize(f"on pieces {tuple(pieces)}", build)

    @property
    def _template(self) -> ca.Function:
        """L of (q, v, t, p, pieces), each piece a number: its operations are read only once."""

        def build() -> ca.Function:
            s, pieces = self.system.symbols, ca.SX.sym("piece", len(self.knots))
            found = _fold(self.system, ca.vertsplit(pieces))
            assert found is not None
            return ca.Function("held", [s.q, s.v, s.t, s.p, pieces], [found[0]])

        return self.system.memoize("held on pieces", build)

    def surface(self, which: int, knot: int) -> Callable[..., ca.SX]:
        """Return on(q, t) of the surface at a knot of an argument."""
        s, table = self.system.symbols, self.system.table
        off = self.arguments[which] - float(self.knots[which][knot])
        parts = ca.vertsplit(
            s.p, np.cumsum([0, *(x.size for x in table.defaults.values())]).tolist()
        )
        law = ca.Function("on", [s.q, s.t, *parts], [off])

        def on(q: Any, t: Any, **parameters: Any) -> ca.SX:
            given = [parameters[name].sx for name in table.defaults]
            return law(q.sx, t.sx, *[ca.vec(x.T) for x in given])

        return on


def branches(system: Any) -> Branches | None:
    """Return where L has kinks in q; None where it has none, or others, such as those in v."""
    found = _fold(system, None)
    if found is None or not found[1]:
        return None
    arguments, knots = zip(*found[1], strict=True)
    s = system.symbols
    evaluate = ca.Function("kinks", [s.q, s.t, s.p], [ca.densify(ca.vertcat(*arguments))])
    return Branches(system, arguments, knots, Pointwise(evaluate))


def _fold(
    system: Any, pieces: Sequence[ca.SX] | None
) -> tuple[ca.SX, list[tuple[ca.SX, Array]]] | None:
    """Return L on these pieces, or as it is, and where it has kinks; None for kinks of others."""
    s = system.symbols
    inputs = s.q, s.v, s.t, s.p
    kinks: list[tuple[ca.SX, Array]] = []
    known = True

    def piece(x: ca.SX, knots: Array = SIDES) -> ca.SX:
        """Return which piece of the next kink is held."""
        kinks.append((x, knots))
        return ca.SX(0) if pieces is None else pieces[len(kinks) - 1]

    def branch(node: Node, operands: list[tuple[ca.SX, bool, bool]]) -> tuple[ca.SX, bool, bool]:
        """Return the value, and whether it is of q and of v."""
        nonlocal known
        code, (of, row) = node.operation, node.entry
        if not operands:
            x = inputs[of][row] if node.kind == "input" else ca.SX(node.value)
            return x, of == 0, of == 1
        x, of_q, of_v = zip(*operands, strict=True)
        value, moves, rates = node.of(x), any(of_q), any(of_v)
        if code not in KINKS - LOGIC or not (moves or rates):
            return value, moves, rates
        held = value
        if code in TWO_SIDED:
            side = 2 * piece(x[0]) - 1
            held = side * x[0] if code == ca.OP_FABS else side
        elif code in LESSER:
            side = piece(x[1] - x[0])
            above, below = x[::-1] if code == ca.OP_FMAX else x
            held = side if code in ORDERED else ca.if_else(side, above, below)
        elif code == LINEAR_TABLE and (points := read_table(node.function)[0]).size > 2:
            y, k = read_table(node.function)[1][:, node.nonzero], piece(x[0], points[1:-1])
            slopes, on = np.diff(y) / np.diff(points), ca.SX(np.arange(y.size - 1.0)) == k
            first, low, slope = (ca.dot(on, ca.DM(c)) for c in (points[:-1], y[:-1], slopes))
            held = low + (x[0] - first) * slope
        else:
            known = False
        known &= not rates
        return (value if pieces is None else held), moves, rates

    law = system.lagrangian_tape
    made = law.fold(branch)[law.results[0][0]][0]
    return (made, kinks) if known else None
