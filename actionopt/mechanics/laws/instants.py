"""The instants at which laws switch by the clock: where a branch depends on the time alone.

A force that is switched on, a kink in t, a coefficient that is floor(t): between these instants
the laws are smooth. With the boundaries of elements there, and each element on its own side of
them, paths are as smooth as their elements need; no quadrature has to sum across a jump.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from actionopt.mechanics.laws.compiled import Pointwise
from actionopt.mechanics.laws.switches import REMAINDERS
from actionopt.mechanics.laws.tables import pieces
from actionopt.mechanics.laws.tracing import SAMPLES, Symbols
from actionopt.tools.immutable import immutable
from actionopt.tools.tape import LINEAR_TABLE, PIECE, Node, Tape
from actionopt.tools.types import EPS, Array

Instant = tuple[float, float]  # the last time before it and the first one after it

INTERVALS = 10_000  # followed at once: more of them are round-off; ad hoc, four times `SAMPLES`
# Instants closer together, in the duration, are one, and no element is shorter. Derived: 450
# spacings of times, so that the nodes of an element of degree 10 stay apart.
SHORTEST = 1e-13

DIFFERENCES = (ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_FMIN, ca.OP_FMAX)
ROUNDING_CODES = (ca.OP_FLOOR, ca.OP_CEIL)
# Operations that have a jump or a kink where one operand is zero: 1 / x is arctan's.
ZEROS = {
    ca.OP_SIGN: 0,
    ca.OP_FABS: 0,
    ca.OP_INV: 0,
    ca.OP_ATAN2: 0,
    ca.OP_COPYSIGN: 1,
}
CLOCKED = {*ZEROS, *DIFFERENCES, *ROUNDING_CODES, *REMAINDERS, LINEAR_TABLE}


@immutable
class ClockSwitches:
    """The branches of a law that switch with the time alone."""

    # Of (t, p): steps, each constant but for the instants, (K, S), and the signs of those slopes of
    # what they are the steps of that change: between two instants close together is an extremum.
    steps: Pointwise
    # Of (t, p): the derivatives by t, (K, S), and by p, (K, P S), of what they are the steps of.
    rates: Pointwise
    # Instants of which none is missed, unless two of one step are close together: more are
    # something very fast. As many as there are samples, and points of tables.
    most: int

    def moving(self, known: tuple[Instant, ...], packed: Array) -> Array:
        """Return the derivatives of the instants (K,) by the parameters packed, (K, P)."""
        before, after = (np.array(side)[:, None] for side in zip(*known, strict=True))
        differ = self.steps(before, packed)[0].copy() != self.steps(after, packed)[0]
        first, each = np.argmax(differ, axis=1), np.arange(len(after))  # others may depend on it
        by_time, by_parameters = self.rates(after, packed)
        by_parameters = by_parameters.reshape(len(after), packed.size, by_time.shape[1])
        return -by_parameters[each, :, first] / by_time[each, first][:, None]


def clock(s: Symbols, *laws: ca.SX) -> ClockSwitches | None:
    """Return what switches with the time alone in these laws; None if nothing does."""
    arguments = [s.q, s.v, s.t, s.p]
    steps: list[ca.SX] = []
    smooth: list[ca.SX] = []
    most = SAMPLES

    def switch_of(node: Node, operands: list[tuple[ca.SX, bool] | None]) -> Any:
        """Return an expression, and whether it is of the time; None for the path's."""
        nonlocal most
        code, (of, row) = node.operation, node.entry
        if node.kind == "input":
            return None if of < 2 else (arguments[of][row], of == 2)
        if node.kind == "constant":
            return ca.SX(node.value), False
        made = None
        plain = [operand for operand in operands if operand is not None]
        if len(plain) == len(operands):
            made = node.of([x for x, _ in plain]), any([timed for _, timed in plain])
        # What has the sign of the time may be of the path.
        asked = operands[ZEROS[code] : ZEROS[code] + 1] if code in ZEROS else operands
        known = [operand for operand in asked if operand is not None]
        if len(known) == len(asked) and any([timed for _, timed in known]):
            found = _step(node, [x for x, _ in known], made[0] if made else None)
            if found is not None:
                smooth.append(found[0])
                steps.append(found[1])
                most += pieces(node.function) if code == LINEAR_TABLE else 0
        return made

    tape = Tape(arguments, laws)
    tape.fold(switch_of)
    if not steps:
        return None
    slopes = ca.densify(ca.jacobian(ca.vertcat(*smooth), s.t))
    by_parameters = ca.densify(ca.jacobian(ca.vertcat(*smooth), s.p))
    bent = ca.jacobian_sparsity(slopes, s.t).row()
    steps = [ca.densify(ca.vertcat(*steps)), ca.sign(slopes[bent])]
    made = Pointwise(ca.Function("clock", [s.t, s.p], steps))
    if LINEAR_TABLE in tape.operations:
        from actionopt.mechanics.laws.lookups import evaluator, tables_in

        made = evaluator("clock", [s.t, s.p], steps, s.t, s.p, tables_in(tape))
    return ClockSwitches(
        made,
        Pointwise(ca.Function("rates", [s.t, s.p], [slopes, by_parameters])),
        most,
    )


def _step(node: Node, x: list[ca.SX], value: ca.SX | None) -> tuple[ca.SX, ca.SX] | None:
    """Return what is smooth where an operation of x steps, and the step; None if it has none.

    `value` is what the operation gives, None if that is not of the time alone.
    """
    code = node.operation
    if code in ZEROS or code in DIFFERENCES:
        zero = x[0] if code in ZEROS else x[0] - x[1]
        return zero, ca.sign(zero)
    if value is None:
        return None
    if code in ROUNDING_CODES:
        return x[0], value
    if code in REMAINDERS:
        return x[0] / x[1], ca.floor((x[0] - value) / x[1] + 0.5)
    piece = _piece(node, x) if code == LINEAR_TABLE else None
    return None if piece is None else (x[0], piece)


def _piece(node: Node, x: list[ca.SX]) -> ca.SX | None:
    """Return what tells the piece of a table of one argument: its number, or its slope."""
    table = node.function
    if table is None or (len(x) > 1 and PIECE not in table.name_out()):
        return None
    return node.call(x)[1] if PIECE in table.name_out() else table.jacobian()(x[0], 0)


def instants(known: ClockSwitches, start: float, end: float, packed: Array) -> tuple[Instant, ...]:
    """Return the instants from `start` to `end`, in order, found to neighbouring numbers.

    Those next to zero are far closer together than times can differ: an `EPS` of that is enough.

    Wherever a step or the sign of a slope changes between two times it is followed by bisection.
    """
    least = max(SHORTEST * (end - start), 4 * EPS * max(abs(start), abs(end)))
    found = _bisect(known, start, end, packed, least, slopes=True)
    if found is None:
        found = _bisect(known, start, end, packed, least, slopes=False) or []
    found = merge(found, least)
    return tuple(found) if len(found) <= known.most else ()


def merge(found: list[Instant], least: float = 0.0) -> list[Instant]:
    """Return the instants in order, those that are no more than `least` apart as one."""
    result: list[Instant] = []
    for before, after in sorted(found):
        if result and before - result[-1][1] <= least:
            before, _ = result.pop()
        result.append((before, after))
    return result


def _bisect(
    known: ClockSwitches,
    start: float,
    end: float,
    packed: Array,
    least: float,
    *,
    slopes: bool,
) -> list[Instant] | None:
    """Return the instants, found by bisection of all intervals at once; None where too many differ.

    Where the signs of `slopes` differ, too, there may be two between.
    """

    def pattern(t: Array) -> Array:
        steps, signs = known.steps(t[:, None], packed)
        found = np.hstack([steps, signs]) if slopes else steps.copy()
        found[np.isnan(found)] = 0.0
        return found

    times = np.linspace(start, end, SAMPLES)
    there, count = pattern(times), known.steps(times[:1, None], packed)[0].shape[1]
    a, b, left, right = times[:-1], times[1:], there[:-1], there[1:]
    found: list[Instant] = []
    while True:
        differ = (left != right).any(axis=1)
        a, b, left, right = a[differ], b[differ], left[differ], right[differ]
        middle = a + (b - a) / 2
        whole = (middle <= a) | (middle >= b) | (b - a < EPS * least)
        steps = whole & (left[:, :count] != right[:, :count]).any(axis=1)
        found += zip(a[steps].tolist(), b[steps].tolist(), strict=True)
        if whole.any():
            a, b, left, right, middle = (x[~whole] for x in (a, b, left, right, middle))
        if not a.size:
            return found
        if a.size > INTERVALS / SAMPLES * known.most:
            return None
        there = pattern(middle)
        a, b = np.concatenate([a, middle]), np.concatenate([middle, b])
        left, right = np.concatenate([left, there]), np.concatenate([there, right])
