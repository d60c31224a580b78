"""The branches of a Lagrangian: L with the values of its comparisons, signs and roundings held.

They are in the expression as operations of their own. With their values as further arguments c,
L(q, v, t, c) is smooth; on a surface where c changes, L jumps if L(q, v, t, c before) and
L(q, v, t, c after) differ.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import NamedTuple

import casadi as ca

from actionopt.mechanics.laws.compiled import Pointwise
from actionopt.mechanics.laws.tracing import COMPARISONS, Symbols
from actionopt.tools.immutable import immutable
from actionopt.tools.tape import LINEAR_TABLE, Node, Tape, apply

STEP_CODES = {ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_SIGN, ca.OP_FLOOR, ca.OP_CEIL}
REMAINDERS = {ca.OP_FMOD, ca.OP_REMAINDER}
STEPPED = STEP_CODES | REMAINDERS | {ca.OP_COPYSIGN, ca.OP_ATAN2}
SWITCHING_CODES = {*STEP_CODES, *REMAINDERS, *COMPARISONS, ca.OP_COPYSIGN, ca.OP_FMIN, ca.OP_FMAX}
SWITCHING_CODES |= {ca.OP_IF_ELSE_ZERO}
KINKS = SWITCHING_CODES | {ca.OP_FABS, LINEAR_TABLE}
LOCALIZED = SWITCHING_CODES | {
    LINEAR_TABLE,
    ca.OP_EXP,
    ca.OP_EXPM1,
    ca.OP_SINH,
    ca.OP_COSH,
    ca.OP_TANH,
    ca.OP_ERF,
}
TAILED = {
    ca.OP_FABS, ca.OP_SQRT, ca.OP_TAN, ca.OP_POW, ca.OP_CONSTPOW, ca.OP_LOG, ca.OP_LOG1P,
    ca.OP_HYPOT, ca.OP_ASIN, ca.OP_ACOS, ca.OP_ATAN, ca.OP_ATAN2, ca.OP_ASINH, ca.OP_ACOSH,
    ca.OP_ATANH,
}  # fmt: skip
QUOTIENTS = (ca.OP_DIV, ca.OP_INV)
SUMS = (ca.OP_ADD, ca.OP_SUB, ca.OP_NEG, ca.OP_TWICE)
ENTIRE_CODES = (ca.OP_SQ, ca.OP_SIN, ca.OP_COS)
ROOTS = (ca.OP_SQRT, ca.OP_LOG)
POWERS = (ca.OP_POW, ca.OP_CONSTPOW)
MOST_PARTS = 16  # of a minimum, such as the 8 of 1 - |x| - |y| - |z|; ad hoc


@immutable
class Switches:
    """The steps of L that depend on q or v."""

    values: Pointwise  # of (q, v, t, p): the steps' values c, (K, S)
    held: Pointwise  # of (q, v, t, p, c): L with these values
    texts: tuple[str, ...]  # the steps as they are written in the coordinates, such as "0<y"


def switches(s: Symbols, lagrangian: Tape, coordinates: Sequence[str]) -> Switches | None:
    """Return the steps of the Lagrangian; None where it has none in q or v."""
    arguments = [s.q, s.v, s.t, s.p]
    names: list[ca.SX] = []  # the symbols c
    steps: list[ca.SX] = []  # what they stand for

    def step(value: ca.SX) -> ca.SX:
        names.append(ca.SX.sym(f"c{len(names)}"))
        steps.append(value)
        return names[-1]

    def branch(node: Node, operands: list[tuple[ca.SX, ca.SX, bool]]) -> tuple[ca.SX, ca.SX, bool]:
        """Return the value as it is, with the steps held, and whether it is of q or v."""
        code, (of, row) = node.operation, node.entry
        if not operands:
            x = arguments[of][row] if node.kind == "input" else ca.SX(node.value)
            return x, x, 0 <= of < 2
        plain, kept, of_path = zip(*operands, strict=True)
        made = node.of(plain)
        moves = any(of_path)
        if moves and code in STEP_CODES:
            return made, step(made), True
        if moves and code == ca.OP_COPYSIGN:
            return made, ca.fabs(kept[0]) * step(ca.sign(plain[1])), True
        if moves and code == ca.OP_ATAN2:
            side = ca.fabs(kept[0]) * step(ca.sign(plain[0]))  # of the branch cut
            return made, ca.atan2(side, kept[1]), True
        if moves and code in REMAINDERS:
            whole = step((plain[0] - made) / plain[1])
            return made, kept[0] - whole * kept[1], True
        return made, node.of(kept), moves

    held = lagrangian.fold(branch)[lagrangian.results[0][0]][1]
    if not names:
        return None
    c = ca.vertcat(*names)
    named = [[ca.SX.sym(x) for x in coordinates], [ca.SX.sym(f"v_{x}") for x in coordinates]]
    said = ca.substitute(steps, [s.q, s.v], [ca.vertcat(*row) for row in named])
    return Switches(
        Pointwise(ca.Function("steps", arguments, [ca.densify(ca.vertcat(*steps))])),
        Pointwise(ca.Function("held", [*arguments, c], [ca.densify(held)])),
        tuple(re.sub(r"^\((.*)\)$", r"\1", str(x)) for x in said),
    )


def is_smooth(law: Tape) -> bool:
    """Return whether no function with a kink or a jump is in a law.

    The derivatives of such functions hide what they depend on: fabs(q) has no second one.
    """
    return KINKS.isdisjoint(law.operations)


def is_smooth_in_path(law: Tape) -> bool:
    """Return whether no function with a kink or a jump in q or v is in a law of (q, v, t, p).

    One in t alone hides nothing of what the derivatives by q and v depend on.
    """
    if is_smooth(law):
        return True
    of_path = law.fold(lambda node, operands: any(operands) or 0 <= node.entry[0] < 2)
    return not any(
        # Only the condition c of "x where c" makes a kink, the other operand does not.
        node.operation in KINKS
        and any(of_path[i] for i in node.operands[: 2 - (node.operation == ca.OP_IF_ELSE_ZERO)])
        for node in law.nodes
    )


class Parts(NamedTuple):
    """A value, and expressions whose minimum and whose maximum it is."""

    value: ca.SX
    low: list[ca.SX]
    high: list[ca.SX]

    def times(self, number: float) -> Parts:
        """Return the parts of a multiple."""
        low, high = (self.low, self.high)[:: 1 if number > 0 else -1]
        return Parts(number * self.value, [number * x for x in low], [number * x for x in high])


def minimum_parts(row: ca.SX, s: Symbols) -> list[ca.SX]:
    """Return expressions of (q, t, p) whose minimum is a row: min(f, g) >= 0 is f >= 0 and g >= 0.

    |x| is max(x, -x), sums and multiples of minima are minima, and so are the negatives of maxima.
    It is the row alone if it is no minimum of expressions that each contain a coordinate.
    """
    arguments = [s.q, s.t, s.p]
    law = Tape(arguments, [row])
    if is_smooth(law):
        return [row]

    def pairs(code: int, a: list[ca.SX], b: list[ca.SX]) -> list[ca.SX]:
        return [apply(code, [x, y]) for x in a for y in b]

    def parts_of(node: Node, operands: list[Parts]) -> Parts:
        code, (of, entry) = node.operation, node.entry
        if not operands:
            x = arguments[of][entry] if node.kind == "input" else ca.SX(node.value)
            return Parts(x, [x], [x])
        x, y = operands[0], operands[-1]
        value = node.of([operand.value for operand in operands])
        found = whole = Parts(value, [value], [value])
        if code == ca.OP_FMIN:
            found = Parts(value, x.low + y.low, pairs(code, x.high, y.high))
        elif code == ca.OP_FMAX:
            found = Parts(value, pairs(code, x.low, y.low), x.high + y.high)
        elif code == ca.OP_FABS and len(x.low) == len(x.high) == 1:
            found = Parts(value, [value], [x.value, -x.value])
        elif code == ca.OP_ADD:
            found = Parts(value, pairs(code, x.low, y.low), pairs(code, x.high, y.high))
        elif code == ca.OP_SUB:
            found = Parts(value, pairs(code, x.low, y.high), pairs(code, x.high, y.low))
        elif code in (ca.OP_NEG, ca.OP_TWICE):
            found = x.times(-1.0 if code == ca.OP_NEG else 2.0)
        elif code == ca.OP_MUL and x.value.is_constant():
            found = y.times(float(x.value))
        elif code in (ca.OP_MUL, ca.OP_DIV) and y.value.is_constant():
            number = float(y.value)
            found = x.times(number if code == ca.OP_MUL else 1 / number)
        return found if max(len(found.low), len(found.high)) <= MOST_PARTS else whole

    parts = law.fold(parts_of)[law.results[0][0]].low
    return parts if all(ca.depends_on(part, s.q) for part in parts) else [row]


ON_PATH, ON_TIME, TIME_ALONE = (
    1,
    2,
    4,
)  # on what a value depends, and whether it has a term of time alone


def adds_time(lagrangian: Tape) -> bool:
    """Return whether a term of the time alone is added in a law of (q, v, t, p).

    It moves no path, and so no equation tells how fast it varies.
    """

    def parts_of(node: Node, operands: list[int]) -> int:
        """Return whether it depends on the path, and on the time, and has a term of time alone."""
        if node.kind == "input":
            return (ON_PATH, ON_PATH, ON_TIME | TIME_ALONE, 0)[node.entry[0]]
        found, factors = 0, 0
        for x in operands:
            found, factors = found | x, factors + (x > 0)
        scaled = node.operation in (ca.OP_MUL, ca.OP_DIV) and factors == 1
        depends = found & (ON_PATH | ON_TIME)
        kept = found & TIME_ALONE if node.operation in SUMS or scaled else 0
        return depends | (TIME_ALONE if depends == ON_TIME else kept)

    made = lagrangian.fold(parts_of)
    return any([made[i] & TIME_ALONE for i, *_ in lagrangian.results])


def narrowness(law: Tape) -> int:
    """Return how narrow a feature a law of (q, v, t, p) can have: 0, 1 or 2.

    0 for polynomials, sines and cosines, whose features are as wide as their periods; 1 for
    quotients and powers, whose features have tails that are seen from afar; 2 for functions that
    may vary in a moment and hardly at all elsewhere. Quotients by a number or by a parameter are
    of no account.
    """
    if not LOCALIZED.isdisjoint(law.operations):
        return 2
    if not TAILED.isdisjoint(law.operations):
        return 1
    if law.operations.isdisjoint(QUOTIENTS):
        return 0
    divisors = law.last_operands(QUOTIENTS)
    return int(any([code != ca.OP_CONST and of != 3 for code, of in divisors]))


# What `is_jumpless` knows of a value: one of these, its sign where that is plain, and the number
# that it is. A sign is 1 or -1 and the constants of unknown sign of which it is the product.
CONSTANT, ENTIRE, VARYING, ROOT, QUOTIENT, OTHER = range(6)
Sign = tuple[int, frozenset[tuple[int, int]]] | None
Known = tuple[int, Sign, float]
POSITIVE: Sign = (1, frozenset())


def is_jumpless(lagrangian: Tape) -> bool:
    """Return whether it is plain that L has no jump where it is finite.

    So it is for polynomials, sines and cosines of q and v, with one root, logarithm or quotient of
    a constant by these in q, or several of one sign: where their arguments vanish L has a kink, or
    is infinite. Quotients of two that vanish may step, such as q / sqrt(q^2), functions of a
    quotient, such as arctan(1 / q), and differences, such as that of roots that are large.

    What has a cusp, such as a power between 0 and 1/2, or a kink in v is not plain either: there
    the energy shows what forces at samples do not.
    """
    return lagrangian.fold(_range_of)[lagrangian.results[0][0]][0] < OTHER


def _range_of(node: Node, of: list[Known]) -> Known:
    """Return what is known of a value by what is known of its operands."""
    if node.kind == "constant":
        return CONSTANT, (1 if node.value >= 0 else -1, frozenset()), node.value
    if node.kind == "input":
        if node.entry[0] < 2:
            return (ENTIRE, VARYING)[node.entry[0]], None, math.nan
        return CONSTANT, (1, frozenset([node.entry])), math.nan
    kinds, signs, numbers = zip(*of, strict=True)
    code = node.operation
    if code in SUMS and max(kinds) == QUOTIENT and min(kinds) <= VARYING:  # where it is infinite
        signs = tuple(s for k, s in zip(kinds, signs, strict=True) if k == QUOTIENT)
        code = ca.OP_NEG if code == ca.OP_SUB and kinds[1] == QUOTIENT else ca.OP_TWICE
    sign = _sign(code, signs)
    return _kind(node.operation, kinds, numbers[-1], sign), sign, math.nan


def _kind(code: int, of: tuple[int, ...], exponent: float, sign: Sign) -> int:
    """Return what kind of function an operation makes of operands of these kinds."""
    low, high = min(of), max(of)
    if high == CONSTANT:
        return CONSTANT
    if code in SUMS:  # of two that are not entire the large parts may cancel
        return high if len(of) == 1 or low <= VARYING or sign else OTHER
    if code == ca.OP_MUL:
        return high if low == CONSTANT or (low <= VARYING and high <= ROOT) else OTHER
    if code in ENTIRE_CODES and high <= VARYING:
        return high
    if code == ca.OP_DIV and of[1] == CONSTANT:
        return of[0]
    if code == ca.OP_INV or (code == ca.OP_DIV and of[0] == CONSTANT):
        return QUOTIENT if of[-1] in (ENTIRE, ROOT) else OTHER
    if code in POWERS and of == (ENTIRE, CONSTANT):
        return QUOTIENT if exponent <= 0 or exponent >= 0.5 else OTHER
    return ROOT if code in ROOTS and high == ENTIRE else OTHER


def _sign(code: int, of: tuple[Sign, ...]) -> Sign:
    """Return the sign of a value, if not zero, by those of its operands."""
    first, last = of[0], of[-1]
    if code in (ca.OP_SQ, ca.OP_SQRT):
        return POSITIVE
    if code in POWERS:
        return POSITIVE if first == POSITIVE else None
    if first is None or last is None:
        return None
    if code in (ca.OP_NEG, ca.OP_SUB):
        last = -last[0], last[1]
    if code in (ca.OP_MUL, ca.OP_DIV):
        return first[0] * last[0], first[1] ^ last[1]
    if code in (ca.OP_ADD, ca.OP_SUB):
        return first if first == last else None
    return last if code in (ca.OP_NEG, ca.OP_INV, ca.OP_TWICE) else None
